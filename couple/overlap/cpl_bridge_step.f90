!> One exchange with a bridging domain (theory: overlap coupling, Bridging domain).
!!
!! As in cpl_overlap_step contacts and the elements at the free grains act in every step of the
!! grains, the other elements in kicks of half an exchange. After each kick grains and nodes of the
!! domain are bound by multipliers, which go to the grains as extra forces; gravity and the forces
!! of the start are part of the trial step.
module cpl_bridge_step
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force, verb_kick_drift
  use talus_timers, only: timers_type
  use cpl_bridge, only: bridge_field_type
  use cpl_overlap, only: overlap_type, free_set, hat_set
  use cpl_overlap_ask, only: send_bulk, accept_both, evaluate_bulk, put_nodes, read_nodes
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: bridge_step, bridge_forces, bridge_bulk, read_bound, bound_set, load_set

  character(len=*), parameter :: bound_set = 'bound'   !! of the grains, whose motion is told
  character(len=*), parameter :: load_set = 'pushed'   !! the same, which multipliers act on

contains

  !> From t0 to t1 [s], accepted on both sides; after a fault nothing was accepted.
  subroutine bridge_step(o, solvers, h, t0, t1, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: h, t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: dt, kick, now
    integer(i4) :: k

    dt = h/o%substeps
    call send_bulk(o, solvers(side_solid), 0.5_wp*h, h, t0, t1, timers, errors)
    do k = 1, o%substeps
      now = merge(t1, t0 + k*dt, k == o%substeps)
      kick = merge(0.5_wp*dt, dt, k == 1)
      call timers%start('multipliers')
      call bind(o, solvers(side_grains), kick, merge(0.5_wp*h, 0.0_wp, k == 1), dt)
      call timers%stop('multipliers')
      call send_push(o, solvers(side_grains), kick, dt, now - dt, now, timers, errors)
      if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
      if (k == 1 .and. .not. errors%any()) call solvers(side_solid)%receive(timers, errors)
      if (errors%any()) return
      call read_bound(o, solvers(side_grains), k == o%substeps, errors)
      call drift(o, dt, k == o%substeps)
      call bridge_forces(o, solvers, now, timers, errors)
      if (errors%any()) return
    end do
    call bridge_bulk(o, solvers(side_solid), 0.5_wp*h, t1, timers, errors)
    if (errors%any()) return
    call bind(o, solvers(side_grains), 0.5_wp*dt, 0.5_wp*h, dt)
    call send_push(o, solvers(side_grains), 0.5_wp*dt, 0.0_wp, t1, t1, timers, errors)
    if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
    if (errors%any()) return
    call read_bound(o, solvers(side_grains), .true., errors)
    call solvers(side_grains)%reply%get('scalars', o%grains, errors)
    if (errors%any()) return
    if (.not. o%finite()) then
      call errors%add('N407', 'a force or displacement of the overlap is no number', &
                      'exchange to '//str(t1)//' s', 'one side has become unstable: look at '// &
                      'the steps of both against their limits')
      return
    end if
    call o%look_past()
    call accept_both(o, solvers, t0, t1, timers, errors)
    if (.not. errors%any()) o%step = o%step + 1
  end subroutine bridge_step

  !> Trial kick of nodes and grains of the domain, then the multipliers that bind them: what is put
  !! on the grains, and the nodes' velocities. A kick of the grains is two halves with background
  !! damping a, the first with the velocity after it, the second with that before it:
  !! v -> ((1 - a kick/2) v + kick F/m)/(1 + a kick/2).
  subroutine bind(o, grains, kick, bulk, dt)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(in) :: grains
    real(wp), intent(in) :: kick, bulk  !! of contacts and near elements, of the others [s]
    real(wp), intent(in) :: dt          !! step of the grains [s]
    real(wp), dimension(3, o%op%ghosts) :: trial
    real(wp) :: before(3, o%op%nodes), before_phi(3, o%op%nodes_phi), keep, push
    integer(i4) :: g

    associate (b => o%bridge, half => 0.5_wp*grains%motion(1)*kick)
      keep = (1.0_wp - half)/(1.0_wp + half)
      push = kick/(1.0_wp + half)
      before = o%v
      before_phi = o%w
      call kick_nodes(o, kick, bulk)
      do g = 1, o%op%ghosts
        trial(:, g) = keep*b%v(:, g) + push*((o%p(:, g) + b%hold(:, g))/b%move%grain(g) &
                                             + grains%gravity)
      end do
      call bind_field(b%move, b%v, o%d, o%u, before, o%v, b%push)
      b%push = b%push/push + b%hold
      if (.not. b%turns) return
      do g = 1, o%op%ghosts
        trial(:, g) = keep*b%spin(:, g) + push*(o%m(:, g) + b%hold_couple(:, g))/b%turn%grain(g)
      end do
      call bind_field(b%turn, b%spin, o%turn, o%phi, before_phi, o%w, b%couple)
      b%couple = b%couple/push + b%hold_couple
    end associate

  contains

    !> Bind one field; works of the multipliers on both, with the mean velocities of the kick.
    subroutine bind_field(field, v, q, u, d0, d, impulse)
      type(bridge_field_type), intent(in) :: field
      real(wp), intent(in) :: v(:, :), q(:, :), u(:, :), d0(:, :)  !! before the kick
      real(wp), intent(inout) :: d(:, :)
      real(wp), intent(out) :: impulse(:, :)
      real(wp) :: on_nodes(3, size(field%at)), given, taken
      call field%bind(field%gap(q, u)/dt, trial, d, impulse)
      on_nodes = 0.0_wp
      call field%n%transposed(impulse, on_nodes)
      given = 0.5_wp*sum(impulse*(v + trial))
      taken = 0.5_wp*sum(on_nodes*(d0(:, field%at) + d(:, field%at)))
      o%work_given = o%work_given + given
      o%work_taken = o%work_taken + taken
      o%turnover = o%turnover + 0.5_wp*sum(abs(impulse*(v + trial)))
      o%bridge%lost = o%bridge%lost + taken - given
    end subroutine bind_field
  end subroutine bind

  !> Velocities of the nodes of the domain: forces of near elements, and once an exchange those of
  !! the others.
  subroutine kick_nodes(o, kick, bulk)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: kick, bulk  !! [s]
    integer(i4) :: k, a
    associate (at => o%bridge%move%at)
      do k = 1, size(at)
        a = at(k)
        where (.not. o%held(:, a)) o%v(:, a) = o%v(:, a) &
          + (kick*o%f(:, a) + bulk*o%bulk(:, a))/o%mass(a)
      end do
    end associate
    if (.not. o%bridge%turns) return
    associate (at => o%bridge%turn%at)
      do k = 1, size(at)
        a = at(k)
        where (.not. o%held_phi(:, a)) o%w(:, a) = o%w(:, a) &
          + (kick*o%c(:, a) + bulk*o%bulk_phi(:, a))/o%inertia(a)
      end do
    end associate
  end subroutine kick_nodes

  !> Nodes of the domain go on; the other nodes of the free grains' elements follow the grains when
  !! an exchange ends: nothing depends on them. Work of the loads that balance the start.
  subroutine drift(o, dt, last)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: last
    real(wp) :: u(3, o%op%nodes), phi(3, o%op%nodes_phi)
    integer(i4) :: a

    associate (b => o%bridge)
      do a = 1, size(b%move%at)
        associate (k => b%move%at(a))
          o%u(:, k) = o%u(:, k) + dt*o%v(:, k)
          o%hold_work = o%hold_work + dt*dot_product(o%f_hold(:, k), o%v(:, k))
        end associate
      end do
      o%hold_work = o%hold_work + dt*sum(b%hold*b%v)
      if (b%turns) then
        do a = 1, size(b%turn%at)
          associate (k => b%turn%at(a))
            o%phi(:, k) = o%phi(:, k) + dt*o%w(:, k)
            o%hold_work = o%hold_work + dt*dot_product(o%c_hold(:, k), o%w(:, k))
          end associate
        end do
        o%hold_work = o%hold_work + dt*sum(b%hold_couple*b%spin)
      end if
      if (.not. last) return
      u = o%u
      phi = o%phi
      call o%op%to_hats(o%q, o%theta, o%u, o%phi)
      o%u(:, b%move%at) = u(:, b%move%at)
      if (b%turns) o%phi(:, b%turn%at) = phi(:, b%turn%at)
    end associate
  end subroutine drift

  !> KICK_DRIFT of the grains with the multipliers on the bound ones.
  subroutine send_push(o, grains, kick, drift, t0, t1, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: grains
    real(wp), intent(in) :: kick, drift, t0, t1  !! [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call grains%start_request(verb_kick_drift, o%step, t0, t1)
    call grains%request%put('kick', kick)
    call grains%request%put('drift', drift)
    call grains%request%put(load_set//'.force', o%bridge%push)
    if (o%bridge%turns) call grains%request%put(load_set//'.moment', o%bridge%couple)
    if (drift > 0.0_wp) call grains%request%put_int('brief', 1_i4)
    call grains%send(timers, errors)
  end subroutine send_push

  !> Motion of the bound grains from a reply, and where wanted that of the free ones.
  subroutine read_bound(o, grains, all, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    logical, intent(in) :: all  !! with the free grains
    type(error_list_type), intent(inout) :: errors
    associate (b => o%bridge)
      call grains%reply%get(bound_set//'.x', o%d, errors)
      call grains%reply%get(bound_set//'.v', b%v, errors)
      o%d = o%d - o%x_ghost
      if (b%turns) then
        call grains%reply%get(bound_set//'.omega', b%spin, errors)
        call grains%reply%get(bound_set//'.theta', o%turn, errors)
        o%turn = o%turn - b%theta_ref
      end if
    end associate
    if (.not. all) return
    call grains%reply%get(free_set//'.x', o%q, errors)
    o%q = o%q - o%x_free
    if (.not. o%turns) return
    call grains%reply%get(free_set//'.theta', o%theta, errors)
    o%theta = o%theta - o%theta_ref
  end subroutine read_bound

  !> FORCE on both sides where grains and nodes are now; the surcharge of the grains' deck is part
  !! of what acts on the bound ones.
  subroutine bridge_forces(o, solvers, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: t  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: load(3, o%op%ghosts)

    associate (grains => solvers(side_grains), solid => solvers(side_solid))
      call grains%start_request(verb_force, o%step, t, t)
      call grains%request%put_int('brief', 1_i4)
      call grains%send(timers, errors)
      call solid%start_request(verb_force, o%step, t, t)
      call solid%request%put_text('scope', 'interface')
      call solid%request%put_text('set', hat_set)
      call put_nodes(o, solid)
      call solid%request%put_int('brief', 1_i4)
      if (.not. errors%any()) call solid%send(timers, errors)
      if (.not. errors%any()) call grains%receive(timers, errors)
      if (.not. errors%any()) call solid%receive(timers, errors)
      if (errors%any()) return
      call grains%reply%get(bound_set//'.force', o%p, errors)
      call grains%reply%get(bound_set//'.load', load, errors)
      o%p = o%p + load
      if (o%bridge%turns) call grains%reply%get(bound_set//'.moment', o%m, errors)
      call read_nodes(o, solid, 'force', 'moment', o%element, o%element_phi, errors)
    end associate
    o%f = o%element + o%f_hold
    o%c = o%element_phi + o%c_hold
  end subroutine bridge_forces

  !> Forces of the other elements on the nodes; the weight there is that of their own mass.
  subroutine bridge_bulk(o, solid, kick, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: kick, t  !! [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: a
    call evaluate_bulk(o, solid, kick, t, timers, errors)
    do a = 1, o%op%nodes
      o%bulk(:, a) = o%bulk(:, a) + o%bridge%weight_excess(a)*solid%gravity
    end do
  end subroutine bridge_bulk
end module cpl_bridge_step
