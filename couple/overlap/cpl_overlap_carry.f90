!> What is carried over when the sets of an overlap are made anew within a run: motion of all nodes
!! of the mesh, and the forces on them, with which the loads are chosen that hold the difference
!! (theory: overlap coupling, Conversion).
module cpl_overlap_carry
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force, verb_kick_drift
  use talus_port_names, only: can_element_stress, dot_force, dot_u, dot_v, field_brief, &
    field_drift, field_held, field_kick, field_scope, field_u, role_report, scope_balance
  use talus_timers, only: timers_type
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_none
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: carried_type, carry_from, look_at_motion, hold_difference, any_closes

  character(len=*), parameter :: all_nodes = 'everything'  !! set of all nodes of the solid
  integer(i4), parameter :: was_bulk = 0, was_edge = 1, was_prescribed = 2, &
    was_off = 3

  !> By the ids of the nodes.
  type :: carried_type
    real(wp), allocatable :: u(:, :), v(:, :)   !! (3, nodes) [m], [m/s]
    real(wp), allocatable :: total(:, :)        !! force on what is no prescribed node (3, nodes)
                                                !! [N]; on those what free grains get of it
    integer(i4), allocatable :: was(:)          !! (nodes) was_...
    integer(i4), allocatable :: part(:)         !! (elements) see cpl_sets
    logical, allocatable :: held(:, :)          !! (3, nodes) by the solid's deck
    logical :: stressed = .false.               !! elements had a stress before the start
  end type carried_type

contains

  !> State of all nodes at an accepted exchange.
  subroutine carry_from(o, solid, carried, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(carried_type), intent(out) :: carried
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, a

    call carry_motion(o, solid, carried, timers, errors)
    if (errors%any()) return
    carried%stressed = solid%can(can_element_stress)
    call solid%start_request(verb_force, o%step, solid%time, solid%time)
    call solid%request%put_text(field_scope, scope_balance)
    call solid%request%put_int(field_brief, 1_i4)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(all_nodes//dot_force, carried%total, errors)
    call select_nodes(o, solid, [1_i8], timers, errors)
    carried%was(o%sets%off) = was_off
    do k = 1, o%op%nodes
      a = o%op%node(k)
      carried%was(a) = merge(was_prescribed, was_edge, k <= o%op%prescribed)
      carried%total(:, a) = o%forces%f(:, k)
      if (k > o%op%prescribed) carried%total(:, a) = carried%total(:, a) + o%forces%bulk(:, k)
    end do
  end subroutine carry_from

  !> Motion of all nodes at an accepted exchange, without more.
  subroutine look_at_motion(o, solid, carried, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(carried_type), intent(out) :: carried
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call carry_motion(o, solid, carried, timers, errors)
    call select_nodes(o, solid, [1_i8], timers, errors)
  end subroutine look_at_motion

  !> Motion of all nodes at an accepted exchange; all nodes are selected then.
  subroutine carry_motion(o, solid, carried, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(carried_type), intent(out) :: carried
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: held(:, :)
    integer(i4) :: k, a

    allocate (carried%u(3, o%cells%nodes), carried%v(3, o%cells%nodes), &
              carried%total(3, o%cells%nodes), source=0.0_wp)
    allocate (carried%was(o%cells%nodes), source=was_bulk)
    carried%part = o%sets%part
    call select_nodes(o, solid, [(int(k, i8), k=1, o%cells%nodes)], timers, errors)
    if (errors%any()) return
    call solid%reply%take_int(field_held, held, errors)
    if (errors%any()) return
    carried%held = held == 1
    call solid%start_request(verb_kick_drift, o%step, solid%time, solid%time)
    call solid%request%put(field_kick, 0.0_wp)
    call solid%request%put(field_drift, 0.0_wp)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(all_nodes//dot_u, carried%u, errors)
    call solid%reply%get(all_nodes//dot_v, carried%v, errors)
    do k = 1, o%op%nodes
      a = o%op%node(k)
      carried%u(:, a) = o%motion%u(:, k)
      if (allocated(o%map%base)) carried%u(:, a) = carried%u(:, a) + o%map%base(:, a)
      carried%v(:, a) = o%motion%v(:, k)
    end do
  end subroutine carry_motion

  subroutine select_nodes(o, solid, ids, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    integer(i8), intent(in) :: ids(:)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call solid%start_select(o%step, all_nodes, role_report, ids, field_u)
    call solid%ask(timers, errors)
  end subroutine select_nodes

  !> Loads that hold what jumps: what moves by itself gets the force that it had, and so do free
  !! grains by nodes around which no element has changed its part. Of other nodes that follow free
  !! grains the elements act, strained since the start as they are, and the ghosts' part is held:
  !! what the changed elements carried the grains in them carry now. Where elements close nodes that
  !! followed grains, or had no continuum, begin in balance, and no grain feels a new force. So do
  !! all of a solid with a stress before the start: the grains have it, too, and act by themselves.
  subroutine hold_difference(o, carried)
    type(overlap_type), intent(inout) :: o
    type(carried_type), intent(in) :: carried
    real(wp) :: f(3, o%op%nodes)
    logical :: changed(o%cells%nodes), closed(o%cells%nodes)
    integer(i4) :: k, a, e
    changed = .false.
    closed = .false.
    do e = 1, o%cells%elements
      if (o%sets%part(e) == carried%part(e)) cycle
      changed(o%cells%nodes_of(e)) = .true.
      if (closes(carried%part(e), o%sets%part(e))) closed(o%cells%nodes_of(e)) = .true.
    end do
    do k = 1, o%op%nodes
      a = o%op%node(k)
      if (closed(a) .and. k > o%op%prescribed .and. carried%was(a) >= was_prescribed) then
        f(:, k) = -o%forces%f(:, k) - o%forces%bulk(:, k)
      else if ((closed(a) .or. carried%stressed) .and. k <= o%op%prescribed) then
        f(:, k) = merge(carried%total(:, a), 0.0_wp, carried%was(a) == was_prescribed) &
          - o%forces%f(:, k)
      else if (k > o%op%prescribed) then
        f(:, k) = carried%total(:, a) - o%forces%f(:, k) - o%forces%bulk(:, k)
      else if (carried%was(a) == was_prescribed .and. .not. changed(a)) then
        f(:, k) = carried%total(:, a) - o%forces%f(:, k)
      else
        f(:, k) = o%forces%element(:, k) - o%forces%f(:, k)
      end if
    end do
    call o%hold_loads(f)
  end subroutine hold_difference

  !> Does any element close?
  pure logical function any_closes(o, carried)
    type(overlap_type), intent(in) :: o
    type(carried_type), intent(in) :: carried
    any_closes = any(closes(carried%part, o%sets%part))
  end function any_closes

  !> Does an element go towards continuum?
  pure elemental logical function closes(before, after)
    integer(i4), intent(in) :: before, after  !! part_*
    closes = openness(after) < openness(before)
  end function closes

  !> Continuum alone, with ghosts, with free grains, grains alone: 0 to 3.
  pure elemental integer(i4) function openness(part)
    integer(i4), intent(in) :: part
    openness = merge(3_i4, part, part == part_none)
  end function openness
end module cpl_overlap_carry
