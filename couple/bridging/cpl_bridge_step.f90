!> What an exchange with a bridging domain is made of (theory: overlap coupling, Bridging domain):
!! trial kicks, drift, what binds the grains put on them, forces of both sides.
module cpl_bridge_step
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force, verb_kick_drift
  use talus_port_names, only: dot_force, dot_load, dot_moment, dot_omega, dot_theta, dot_v, &
    dot_x, field_brief, field_drift, field_force, field_kick, field_moment, field_scope, &
    field_set, scope_interface
  use talus_timers, only: timers_type
  use cpl_bridge, only: bridge_type
  use cpl_overlap, only: overlap_type, free_set, prescribed_set
  use cpl_overlap_ask, only: kick_type, evaluate_bulk, put_nodes, read_nodes
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: trial_type, trial_kick, drift, send_push, bridge_forces, bridge_bulk, read_bound, &
    bound_set, load_set

  character(len=*), parameter :: bound_set = 'bound'   !! of the grains, whose motion is reported
  character(len=*), parameter :: load_set = 'pushed'   !! the same, which multipliers act on

  !> Velocities around a kick.
  type :: trial_type
    real(wp) :: push = 0.0_wp                            !! kick of forces on grains [s]
    real(wp), allocatable :: v(:, :), spin(:, :)         !! of the grains after it, if not bound
    real(wp), allocatable :: before(:, :), before_phi(:, :)  !! of the nodes before it
  end type trial_type

contains

  !> Kick of the nodes, then velocities that the bound grains would have after their kick, which is
  !! two halves with background damping a, the first with the velocity after it, the second with
  !! that before it: v -> ((1 - a kick/2) v + kick F/m)/(1 + a kick/2).
  subroutine trial_kick(o, b, grains, kick, bulk, trial)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    type(cpl_solver_type), intent(in) :: grains
    real(wp), intent(in) :: kick, bulk  !! of contacts and fast elements, of others [s]
    type(trial_type), intent(inout) :: trial
    real(wp) :: keep
    integer(i4) :: g

    associate (half => 0.5_wp*grains%motion(1)*kick)
      keep = (1.0_wp - half)/(1.0_wp + half)
      trial%push = kick/(1.0_wp + half)
    end associate
    trial%before = o%motion%v
    trial%before_phi = o%motion%w
    call o%kick_nodes(b%move%at, kick, bulk)
    if (b%turns) call o%kick_turns(b%turn%at, kick, bulk)
    if (.not. allocated(trial%v)) allocate (trial%v(3, o%op%ghosts), trial%spin(3, o%op%ghosts))
    do g = 1, o%op%ghosts
      trial%v(:, g) = keep*b%v(:, g) + trial%push*((o%forces%p(:, g) + b%hold(:, &
        g))/b%move%grain(g) + grains%gravity)
    end do
    if (.not. b%turns) return
    do g = 1, o%op%ghosts
      trial%spin(:, g) = keep*b%spin(:, g) &
        + trial%push*(o%forces%m(:, g) + b%hold_couple(:, g))/b%turn%grain(g)
    end do
  end subroutine trial_kick

  !> Nodes of the domain go on; the other nodes of the free grains' elements follow the grains when
  !! an exchange ends: nothing depends on them. Work of the loads that balance the start.
  subroutine drift(o, b, dt, last)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: last
    call note_hold(o, b, dt)
    call o%drift_nodes(b%move%at, dt)
    if (b%turns) call o%drift_turns(b%turn%at, dt)
    if (.not. last) return
    if (b%turns) then
      call o%follow_around(b%move%at, b%turn%at)
    else
      call o%follow_around(b%move%at)
    end if
  end subroutine drift

  !> Work of the loads that balance the start.
  subroutine note_hold(o, b, dt)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    real(wp), intent(in) :: dt  !! [s]
    real(wp) :: work
    integer(i4) :: a

    work = o%ledger%hold_work
    do a = 1, size(b%move%at)
      associate (k => b%move%at(a))
        work = work + dt*dot_product(o%forces%f_hold(:, k), o%motion%v(:, k))
      end associate
    end do
    work = work + dt*sum(b%hold*b%v)
    if (b%turns) then
      do a = 1, size(b%turn%at)
        associate (k => b%turn%at(a))
          work = work + dt*dot_product(o%forces%c_hold(:, k), o%motion%w(:, k))
        end associate
      end do
      work = work + dt*sum(b%hold_couple*b%spin)
    end if
    call o%ledger%hold_to(work)
  end subroutine note_hold

  !> KICK_DRIFT of the grains with the multipliers on the bound ones.
  subroutine send_push(o, b, grains, by, timers, errors)
    type(overlap_type), intent(in) :: o
    type(bridge_type), intent(in) :: b
    type(cpl_solver_type), intent(inout) :: grains
    type(kick_type), intent(in) :: by
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call grains%start_request(verb_kick_drift, o%step, by%t0, by%t1)
    call grains%request%put(field_kick, by%kick)
    call grains%request%put(field_drift, by%drift)
    call grains%request%put(load_set//dot_force, b%push)
    if (b%turns) call grains%request%put(load_set//dot_moment, b%couple)
    if (by%drift > 0.0_wp) call grains%request%put_int(field_brief, 1_i4)
    call grains%send(timers, errors)
  end subroutine send_push

  !> Motion of the bound grains from a reply, and where wanted that of the free ones.
  subroutine read_bound(o, b, grains, all, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    type(cpl_solver_type), intent(inout) :: grains
    logical, intent(in) :: all  !! with the free grains
    type(error_list_type), intent(inout) :: errors
    call grains%reply%get(bound_set//dot_x, o%motion%d, errors)
    call grains%reply%get(bound_set//dot_v, b%v, errors)
    if (b%turns) then
      call grains%reply%get(bound_set//dot_omega, b%spin, errors)
      call grains%reply%get(bound_set//dot_theta, o%motion%turn, errors)
      call o%motion%count_ghosts(o%map%x_ghost, b%theta_ref)
    else
      call o%motion%count_ghosts(o%map%x_ghost)
    end if
    if (.not. all) return
    call grains%reply%get(free_set//dot_x, o%motion%q, errors)
    if (o%rules%turns) then
      call grains%reply%get(free_set//dot_theta, o%motion%theta, errors)
      call o%motion%count_free(o%map%x_free, o%map%theta_ref)
    else
      call o%motion%count_free(o%map%x_free)
    end if
  end subroutine read_bound

  !> FORCE on both sides where grains and nodes are now; the surcharge of the grains' deck is part
  !! of what acts on the bound ones.
  subroutine bridge_forces(o, b, solvers, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: t  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: load(3, o%op%ghosts)

    associate (grains => solvers(side_grains), solid => solvers(side_solid))
      call grains%start_request(verb_force, o%step, t, t)
      call grains%request%put_int(field_brief, 1_i4)
      call grains%send(timers, errors)
      call solid%start_request(verb_force, o%step, t, t)
      call solid%request%put_text(field_scope, scope_interface)
      call solid%request%put_text(field_set, prescribed_set)
      call put_nodes(o, solid)
      call solid%request%put_int(field_brief, 1_i4)
      if (.not. errors%any()) call solid%send(timers, errors)
      if (.not. errors%any()) call grains%receive(timers, errors)
      if (.not. errors%any()) call solid%receive(timers, errors)
      if (errors%any()) return
      call grains%reply%get(bound_set//dot_force, o%forces%p, errors)
      call grains%reply%get(bound_set//dot_load, load, errors)
      o%forces%p = o%forces%p + load
      if (b%turns) call grains%reply%get(bound_set//dot_moment, o%forces%m, errors)
      call read_nodes(o, solid, field_force, field_moment, o%forces%element, &
        o%forces%element_phi, errors)
    end associate
    call o%forces%take_elements()
  end subroutine bridge_forces

  !> Forces of the other elements on the nodes; the weight there is that of their own mass.
  subroutine bridge_bulk(o, b, solid, kick, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: kick, t  !! [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call evaluate_bulk(o, solid, kick, t, timers, errors)
    call o%forces%add_weight(b%weight_excess, solid%gravity)
  end subroutine bridge_bulk
end module cpl_bridge_step
