!> One exchange of an overlap with a static solid (theory: overlap coupling, Static).
!!
!! The solid is solved for what ghosts put on the edge, then the grains go on for a batch of their
!! own damped steps, in which prescribed nodes and ghosts follow them and pull-backs are renewed in
!! every step; the edge moves evenly through the batch. What the edge is loaded with is
!! under-relaxed by Aitken. Both come to rest where all forces balance.
module cpl_overlap_static
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: verb_solve
  use talus_port_names, only: dot_force, dot_moment, dot_phi, dot_u, field_scalars
  use talus_scalars, only: scalar_elastic
  use talus_timers, only: timers_type
  use cpl_choices, only: interface_aitken
  use cpl_overlap, only: overlap_type, prescribed_set, edge_set, prescribed_phi_set, edge_phi_set
  use cpl_overlap_loads, only: follow_loads
  use cpl_overlap_ask, only: kick_type, send_kick, read_free, accept_both
  use cpl_overlap_motion, only: increment_type, nodes_type
  use cpl_overlap_step, only: evaluate_forces
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: static_step, begin_static

  real(wp), parameter :: first_factor = 0.5_wp  !! of Aitken

contains

  !> The edge carries at first what is there; `stiffness` (mean, normal) and number of the contacts
  !! at the start give the scale of forces.
  subroutine begin_static(o, stiffness, contacts)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: stiffness       !! [N/m]
    integer(i4), intent(in) :: contacts
    real(wp), allocatable :: load(:, :)
    o%start%contact_stiffness = stiffness
    o%start%contact_count = contacts
    call edge_load(o, load)
    call o%relax%init(interface_aitken, first_factor, size(load, 1, i4), size(load, 2, i4))
    call o%relax_as_static()
    call o%relax%hold(load)
  end subroutine begin_static

  !> From t0 to t1 [s], a batch of the grains, accepted on both sides.
  subroutine static_step(o, solvers, h, t0, t1, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: h, t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, o%op%ghosts) :: v, spin
    type(nodes_type) :: start, solved
    type(increment_type) :: step
    real(wp), allocatable :: load(:, :)
    real(wp) :: dt, now
    integer(i4) :: k

    dt = h/o%rules%substeps
    start = nodes_type(o%motion%u, o%motion%phi)
    call solve_solid(o, solvers(side_solid), t0, t1, solved, timers, errors)
    call follow_loads(o, solvers(side_solid), t1, timers, errors)
    if (errors%any()) return
    do k = 1, o%rules%substeps
      now = merge(t1, t0 + k*dt, k == o%rules%substeps)
      call send_kick(o, solvers(side_grains), kick_type(merge(0.5_wp*dt, dt, k == 1), dt, &
        now - dt, now), .false., timers, errors)
      if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
      if (errors%any()) return
      o%motion%q_before = o%motion%q
      o%motion%theta_before = o%motion%theta
      step%u = o%motion%u
      step%phi = o%motion%phi
      call read_free(o, solvers(side_grains), timers, errors)
      call o%place_edge(start, solved, real(k, wp)/o%rules%substeps)
      call o%follow(dt, v, spin)
      call evaluate_forces(o, solvers, v, spin, now, timers, errors)
      if (errors%any()) return
      step%moved = dt*v
      step%turns = dt*spin
      call o%note_work(step)
    end do
    call send_kick(o, solvers(side_grains), kick_type(0.5_wp*dt, 0.0_wp, t1, t1), .false., timers, &
                   errors)
    if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
    if (errors%any()) return
    call read_free(o, solvers(side_grains), timers, errors)
    call solvers(side_grains)%reply%get(field_scalars, o%ledger%grains, errors)
    call edge_load(o, load)
    call measure_balance(o, load, solvers(side_grains)%gravity)
    call o%relax%force(load)
    call o%measure_past()
    call check_numbers(o, t1, errors)
    if (.not. errors%any()) call accept_both(o, solvers, t0, t1, timers, errors)
    if (.not. errors%any()) call o%count_exchange()
  end subroutine static_step

  subroutine check_numbers(o, t1, errors)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: t1
    type(error_list_type), intent(inout) :: errors
    if (o%finite()) return
    call errors%add('N407', 'a force or displacement of the overlap is no number', &
                    'exchange to '//str(t1)//' s', 'the grains have become unstable: check '// &
                    'their step against its limit, and at their damping')
  end subroutine check_numbers

  !> SOLVE at t1 with the prescribed nodes where the grains hold them and the edge's load; the
  !! edge's place comes back.
  subroutine solve_solid(o, solid, t0, t1, solved, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: t0, t1
    type(nodes_type), intent(out) :: solved
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: edge(3, o%op%nodes - o%op%prescribed), turn(3, o%op%nodes_phi - o%op%prescribed_phi)
    integer(i4) :: turning(size(turn, 2)/o%op%stride)

    solved = nodes_type(o%motion%u, o%motion%phi)
    call solid%start_request(verb_solve, o%step, t0, t1)
    call solid%request%put(prescribed_set//dot_u, o%motion%u(:, :o%op%prescribed))
    call solid%request%put(edge_set//dot_force, o%relax%held(:3, :))
    if (o%op%nodes_phi > 0) then
      call find_turning(o, turning)
      call solid%request%put(prescribed_phi_set//dot_phi, o%motion%phi(:, :o%op%prescribed_phi))
      call solid%request%put(edge_phi_set//dot_moment, reshape(o%relax%held(4:, turning), &
                                                              shape(turn)))
    end if
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(edge_set//dot_u, edge, errors)
    if (o%op%nodes_phi > 0) call solid%reply%get(edge_phi_set//dot_phi, turn, errors)
    call solid%reply%get(field_scalars, o%ledger%solid, errors)
    if (errors%any()) return
    solved%u(:, o%op%prescribed + 1:) = edge
    if (o%op%nodes_phi > 0) solved%phi(:, o%op%prescribed_phi + 1:) = turn
  end subroutine solve_solid

  !> Edge nodes that have a micro-rotation, counted along the edge.
  pure subroutine find_turning(o, turning)
    type(overlap_type), intent(in) :: o
    integer(i4), intent(out) :: turning(:)
    integer(i4) :: k
    do k = 1, size(turning)
      turning(k) = findloc(o%op%node(o%op%prescribed + 1:), &
                           o%op%node_phi(o%op%prescribed_phi + o%op%stride*k), 1)
    end do
  end subroutine find_turning

  !> What the edge is loaded with by all but the solid itself: forces, then moments or couples
  !! (3, 6 or 12, edge).
  subroutine edge_load(o, load)
    type(overlap_type), intent(in) :: o
    real(wp), allocatable, intent(out) :: load(:, :)
    integer(i4) :: turning((o%op%nodes_phi - o%op%prescribed_phi)/o%op%stride)
    allocate (load(3 + merge(3*o%op%stride, 0, o%op%nodes_phi > 0), o%op%nodes - o%op%prescribed), &
              source=0.0_wp)
    associate (a => o%op%prescribed + 1, b => o%op%prescribed_phi + 1)
      load(:3, :) = o%forces%f(:, a:) - o%forces%element(:, a:)
      if (o%op%nodes_phi == 0) return
      call find_turning(o, turning)
      load(4:, turning) = reshape(o%forces%c(:, b:) - o%forces%element_phi(:, b:), &
                                  [int(3*o%op%stride), size(turning)])
    end associate
  end subroutine edge_load

  !> Largest force not in balance, on a free grain and on an edge node that nothing holds, over the
  !! root mean square of the contact forces, from the elastic energy: E = n f^2/(2 k).
  subroutine measure_balance(o, load, gravity)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: load(:, :), gravity(3)
    real(wp) :: scale, rest(3, o%op%free), lag(size(load, 1), size(load, 2))
    integer(i4) :: k

    scale = sqrt(2.0_wp*o%start%contact_stiffness*max(0.0_wp, o%ledger%grains(scalar_elastic)) &
                 /max(1, o%start%contact_count))
    do k = 1, o%op%free
      rest(:, k) = o%forces%contact(:, k) + o%forces%force(:, k) &
        + gravity*o%own%factor(k)*o%pack%mass(o%sets%free(k))
    end do
    o%ledger%unbalanced = sqrt(maxval(sum(rest**2, 1)))
    if (o%rules%turns) then
      rest = (o%forces%contact_moment + o%forces%moment)/o%sets%d_max
      o%ledger%unbalanced = max(o%ledger%unbalanced, sqrt(maxval(sum(rest**2, 1))))
    end if
    lag = load - o%relax%held
    where (o%own%held(:, o%op%prescribed + 1:)) lag(:3, :) = 0.0_wp
    if (size(lag, 1) > 3) lag(4:, :) = lag(4:, :)/o%sets%d_max
    if (size(lag) > 0) o%ledger%unbalanced = max(o%ledger%unbalanced, maxval(abs(lag)))
    if (scale > 0.0_wp) then
      o%ledger%unbalanced = o%ledger%unbalanced/scale
    else if (o%ledger%unbalanced > 0.0_wp) then
      o%ledger%unbalanced = 1.0_wp
    end if
  end subroutine measure_balance
end module cpl_overlap_static
