!> Make a bridging domain of an overlap's sets: rules, sets of both solvers, weights and masses, the
!! multipliers, and the forces at the start (theory: overlap coupling, Bridging domain).
module cpl_bridge_setup
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_message, only: verb_set, verb_ready
  use talus_port_names, only: field_held, field_held_phi, dot_theta, field_force, field_load, &
    field_moment, field_omega, field_phi, field_scalars, field_set, field_step_limit, field_theta, &
    field_u, field_v, field_value, field_what, field_x, role_load, role_prescribe, role_report, &
    what_mass_factor
  use talus_timers, only: timers_type
  use cpl_bridge, only: bridge_type, domain_type
  use cpl_bridge_mass, only: check_domain, share_domain
  use cpl_bridge_step, only: bridge_forces, bridge_bulk, read_bound, bound_set, load_set
  use cpl_overlap, only: overlap_type, free_set, prescribed_set, edge_set, prescribed_phi_set, &
    edge_phi_set
  use cpl_overlap_loads, only: begin_loads
  use cpl_overlap_start, only: start_type, prepare_start
  use cpl_overlap_weights, only: read_points
  use cpl_run, only: cpl_run_type
  use cpl_sets, only: part_ghost
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: make_bridge, begin_domain, start_domain

contains

  !> What can be checked from sets and deck alone; lumped: row sums in place of a system of
  !! equations.
  subroutine make_bridge(o, b, lumped, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    logical, intent(in) :: lumped
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: n

    n = o%op%ghosts
    b%lumped = lumped
    b%turns = o%rules%turns
    allocate (b%v(3, n), b%spin(3, n), b%push(3, n), b%couple(3, n), b%hold(3, n), &
              b%hold_couple(3, n), b%theta_ref(3, n), source=0.0_wp)
    allocate (o%own%factor(o%op%free), source=1.0_wp)
    o%rules%in_parts = .false.
    o%rules%reads_force = .false.
    o%rules%reads_speed = .false.
    call check_domain(o, errors)
  end subroutine make_bridge

  !> Sets of both solvers, weights of energy and mass, fields that are bound.
  subroutine begin_domain(o, b, run, start, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    type(cpl_run_type), intent(inout) :: run
    type(start_type), intent(inout) :: start
    type(error_list_type), intent(inout) :: errors

    call select_domain(o, run%solvers, run%timers, errors)
    if (errors%any()) return
    call prepare_start(o, run%solvers, run%choices, run%again, start, run%timers, errors)
    if (errors%any()) return
    if (run%again) call read_points(run%solvers(side_solid), start%points, run%timers, errors)
    if (errors%any()) return
    call share_domain(o, b, start%points)
    call build_fields(o, b, errors)
    if (.not. errors%any()) call set_mass(o, b, run%solvers(side_grains), run%timers, errors)
  end subroutine begin_domain

  !> READY; a fresh run then takes velocities and forces at the start.
  subroutine start_domain(o, b, run, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors

    associate (solvers => run%solvers)
      call ready(solvers(side_grains))
      if (.not. (run%again .or. errors%any())) call read_grains(o, b, solvers(side_grains), errors)
      call ready(solvers(side_solid))
      call begin_loads(o, solvers(side_solid), run%again, run%timers, errors)
      if (run%again .or. errors%any()) return
      call start_speeds(o, b, errors)
      if (.not. errors%any()) &
        call bridge_forces(o, b, solvers, solvers(1)%time, run%timers, errors)
      if (.not. errors%any()) call bridge_bulk(o, b, solvers(side_solid), 0.0_wp, &
                                               solvers(1)%time, run%timers, errors)
      if (run%choices%overlap%dead_load .and. .not. errors%any()) &
        call hold_start(o, b, solvers(side_grains)%gravity)
    end associate

  contains

    subroutine ready(solver)
      type(cpl_solver_type), intent(inout) :: solver
      if (errors%any()) return
      call solver%start_request(verb_ready, o%step, solver%time, solver%time)
      call solver%ask(run%timers, errors)
    end subroutine ready
  end subroutine start_domain

  !> What carries the start is held against, weight of the bound grains with it.
  subroutine hold_start(o, b, gravity)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    real(wp), intent(in) :: gravity(3)  !! [m/s^2]
    integer(i4) :: g
    do g = 1, o%op%ghosts
      b%hold(:, g) = -o%forces%p(:, g) - b%move%grain(g)*gravity
    end do
    if (b%turns) b%hold_couple = -o%forces%m
    call o%forces%hold_nodes()
  end subroutine hold_start

  !> Sets of both solvers. Prescribed for the solid are all nodes of the overlap, bound or not.
  subroutine select_domain(o, solvers, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fields

    fields = field_x//','//field_v//','//field_force//','//field_load
    if (o%rules%turns) fields = fields//','//field_theta//','//field_omega//','//field_moment
    associate (grains => solvers(side_grains), solid => solvers(side_solid), n => o%op%prescribed, &
               m => o%op%prescribed_phi, bound => o%pack%id(o%sets%ghost))
      call choose(grains, bound_set, role_report, bound, fields)
      call choose(grains, load_set, role_load, bound, '')
      fields = field_x
      if (o%rules%turns) fields = field_x//','//field_theta
      call choose(grains, free_set, role_report, o%pack%id(o%sets%free), fields)
      call choose(solid, prescribed_set, role_prescribe, int(o%op%node(:n), i8), field_u)
      call take_held(field_held, o%own%held(:, :n))
      call choose(solid, edge_set, role_prescribe, int(o%op%node(n + 1:), i8), field_u)
      call take_held(field_held, o%own%held(:, n + 1:))
      if (o%op%nodes_phi == 0) return
      call choose(solid, prescribed_phi_set, role_prescribe, &
        int(o%op%node_phi(:m), i8), field_phi)
      call take_held(field_held_phi, o%own%held_phi(:, :m))
      call choose(solid, edge_phi_set, role_prescribe, int(o%op%node_phi(m + 1:), i8), &
        field_phi)
      call take_held(field_held_phi, o%own%held_phi(:, m + 1:))
    end associate

  contains

    subroutine choose(solver, set, role, id, fields)
      type(cpl_solver_type), intent(inout) :: solver
      character(len=*), intent(in) :: set, fields
      integer(i4), intent(in) :: role
      integer(i8), intent(in) :: id(:)
      if (errors%any()) return
      call solver%start_select(o%step, set, role, id, fields)
      call solver%ask(timers, errors)
    end subroutine choose

    subroutine take_held(field, held)
      character(len=*), intent(in) :: field
      logical, intent(inout) :: held(:, :)
      integer(i4), allocatable :: list(:, :)
      if (errors%any()) return
      call solvers(side_solid)%reply%take_int(field, list, errors)
      if (.not. errors%any()) held = list == 1
    end subroutine take_held
  end subroutine select_domain

  !> Multipliers of displacements and rotations; of grains that are no spheres the rotation by their
  !! least moment of inertia, so that no multiplier is too large for an axis.
  subroutine build_fields(o, b, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    type(error_list_type), intent(inout) :: errors
    type(domain_type) :: domain
    logical :: bound(o%cells%nodes)
    integer(i4) :: e

    bound = .false.
    do e = 1, o%cells%elements
      if (o%sets%part(e) == part_ghost) bound(o%cells%nodes_of(e)) = .true.
    end do
    associate (ghost => o%sets%ghost)
      domain%n = o%op%ghost
      domain%bound = bound(o%op%node)
      domain%x_node = o%map%x_node
      domain%node = o%own%mass
      domain%grain = b%weight*o%pack%mass(ghost)
      domain%held = o%own%held
      call b%move%build(domain, b%lumped, errors)
      call o%own%drop_masses(bound(o%op%node))
      if (.not. b%turns .or. errors%any()) return
      domain%n = o%op%ghost_phi
      domain%bound = bound(o%op%node_phi)
      domain%x_node = o%cells%x(:, o%op%node_phi)
      domain%node = o%own%inertia
      domain%grain = b%weight*o%pack%slimmest(ghost)
      domain%held = o%own%held_phi
      call b%turn%build(domain, b%lumped, errors)
      call o%own%drop_inertias(bound(o%op%node_phi))
    end associate
  end subroutine build_fields

  !> Weights on the masses of the bound grains. D425: the step is above the limit that comes back.
  subroutine set_mass(o, b, grains, timers, errors)
    type(overlap_type), intent(in) :: o
    type(bridge_type), intent(in) :: b
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: limit
    call grains%start_request(verb_set, o%step, grains%time, grains%time)
    call grains%request%put_text(field_what, what_mass_factor)
    call grains%request%put_text(field_set, load_set)
    call grains%request%put(field_value, b%weight)
    call grains%ask(timers, errors)
    if (errors%any()) return
    call grains%reply%get(field_step_limit, limit, errors)
    if (errors%any() .or. grains%dt <= limit .or. .not. limit > 0.0_wp) return
    call errors%add('D425', 'the step of the grains, '//str(grains%dt)//' s, is above the '// &
      'stable step with the masses of the bridging domain, '//short_number(limit)//' s', &
      grains%deck, 'shorten dt in its deck, or raise least_weight in &overlap')
  end subroutine set_mass

  !> State of the grains before the first exchange, from their reply to READY.
  subroutine read_grains(o, b, grains, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    type(cpl_solver_type), intent(inout) :: grains
    type(error_list_type), intent(inout) :: errors
    call grains%reply%get(field_scalars, o%ledger%grains, errors)
    if (o%rules%turns) call grains%reply%get(free_set//dot_theta, o%map%theta_ref, errors)
    if (b%turns) call grains%reply%get(bound_set//dot_theta, b%theta_ref, errors)
    call read_bound(o, b, grains, .true., errors)
  end subroutine read_grains

  !> Velocities of the nodes at the start are those of the grains.
  subroutine start_speeds(o, b, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    type(error_list_type), intent(inout) :: errors
    if (any(abs(b%v) > 0.0_wp)) call b%move%start(b%v, o%map%x_node, o%motion%v, errors)
    if (.not. b%turns) return
    if (any(abs(b%spin) > 0.0_wp)) &
      call b%turn%start(b%spin, o%cells%x(:, o%op%node_phi), o%motion%w, errors)
  end subroutine start_speeds
end module cpl_bridge_setup
