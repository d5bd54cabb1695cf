!> Loads of the solid's deck on nodes that follow free grains, P' X (theory: overlap coupling,
!! Who owns what): tractions, pressures, forces and couples. They go to the free grains by the
!! transposed projection, weight by the masses. What changes in time acts in the mean of the start
!! and the end of an exchange, as the solid's kicks do.
module cpl_overlap_loads
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force
  use talus_port_names, only: dot_force, dot_moment, field_brief, field_scope, field_set, &
    field_steady, scope_loads
  use talus_timers, only: timers_type
  use cpl_overlap, only: overlap_type, prescribed_set, prescribed_phi_set
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: begin_loads, renew_loads, follow_loads

contains

  !> Loads now, or after a restart those of the checkpoint; they are asked for again only if they
  !! change.
  subroutine begin_loads(o, solid, again, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: again
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: f(3, o%op%prescribed), c(3, o%op%prescribed_phi)
    integer(i4) :: steady

    call ask(o, solid, solid%time, f, c, timers, errors)
    if (errors%any()) return
    call solid%reply%get_int(field_steady, steady, errors)
    associate (loads => o%forces%loads)
      loads%steady = steady == 1
      if (.not. (again .and. allocated(loads%f))) then
        loads%f = f
        loads%c = c
      end if
      loads%active = .not. loads%steady .or. any(abs(loads%f) > 0.0_wp) &
        .or. any(abs(loads%c) > 0.0_wp)
    end associate
  end subroutine begin_loads

  !> Loads of the exchange from t0 to t1: their mean. What is new in them is added to the forces on
  !! the free grains, with the inertia of what prescribed nodes carry.
  subroutine renew_loads(o, solid, t0, t1, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: t0, t1  !! [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, o%op%prescribed) :: f, f1
    real(wp), dimension(3, o%op%prescribed_phi) :: c, c1
    real(wp), dimension(3, o%op%free) :: push, turn

    if (.not. o%forces%loads%active .or. o%forces%loads%steady .or. errors%any()) return
    call ask(o, solid, t0, f, c, timers, errors)
    call ask(o, solid, t1, f1, c1, timers, errors)
    if (errors%any()) return
    f = 0.5_wp*(f + f1)
    c = 0.5_wp*(c + c1)
    call o%op%from_prescribed(f - o%forces%loads%f, c - o%forces%loads%c, push, turn)
    if (o%own%carried%active) then
      call o%own%carried%resist(push, f1)
      call o%op%p%transposed(f1, push)
    end if
    if (o%own%carried_phi%active) then
      call o%own%carried_phi%resist(turn, c1)
      call o%op%p_phi%transposed(c1, turn)
    end if
    call o%forces%renew_loads(f, c, push, turn)
  end subroutine renew_loads

  !> Loads at time t of a solid without inertia.
  subroutine follow_loads(o, solid, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: t  !! [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (.not. o%forces%loads%active .or. o%forces%loads%steady) return
    call ask(o, solid, t, o%forces%loads%f, o%forces%loads%c, timers, errors)
  end subroutine follow_loads

  !> FORCE: loads of the solid's deck on the prescribed nodes at time t.
  subroutine ask(o, solid, t, f, c, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: t                     !! [s]
    real(wp), intent(inout) :: f(:, :), c(:, :)   !! (3, prescribed) [N], (3, prescribed_phi) [N m]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call solid%start_request(verb_force, o%step, t, t)
    call solid%request%put_text(field_scope, scope_loads)
    call solid%request%put_text(field_set, prescribed_set)
    call solid%request%put_int(field_brief, 1_i4)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(prescribed_set//dot_force, f, errors)
    if (size(c) > 0) call solid%reply%get(prescribed_phi_set//dot_moment, c, errors)
  end subroutine ask
end module cpl_overlap_loads
