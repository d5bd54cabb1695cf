!> What is carried over when the sets of an overlap are made anew within a run: motion of all nodes
!! of the mesh, and the forces on them, with which the loads are chosen that hold the difference
!! (theory: overlap coupling, Conversion).
module cpl_overlap_carry
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force, verb_kick_drift
  use talus_port_names, only: can_element_stress, dot_force, dot_moment, dot_phi, &
    dot_phi_rate, dot_u, dot_v, field_brief, field_drift, field_held, field_kick, field_phi, &
    field_scope, field_u, role_report, scope_balance
  use talus_timers, only: timers_type
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_none
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: carried_type, carry_from, look_at_motion, hold_difference, any_closes

  character(len=*), parameter :: all_nodes = 'everything'  !! set of all nodes of the solid
  character(len=*), parameter :: all_turns = 'every_turn'  !! of all with micro-rotations
  !> Loads that hold: all that acted, balance of what acts now, what free grains got, no force on
  !! free grains, elements alone.
  integer(i4), parameter :: hold_all = 0, hold_balance = 1, hold_share = 2, hold_nothing = 3, &
    hold_ghosts = 4
  integer(i4), parameter :: was_bulk = 0, was_edge = 1, was_prescribed = 2, &
    was_off = 3

  !> By the ids of the nodes.
  type :: carried_type
    real(wp), allocatable :: u(:, :), v(:, :)   !! (3, nodes) [m], [m/s]
    real(wp), allocatable :: total(:, :)        !! force on what is no prescribed node (3, nodes)
                                                !! [N]; on those what free grains get of it
    real(wp), allocatable :: phi(:, :), w(:, :) !! micro-rotations (3, nodes) [rad], [rad/s]
    real(wp), allocatable :: total_phi(:, :)    !! couples like total (3, nodes) [N m]
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
    integer(i4) :: k, a, turning

    call carry_motion(o, solid, carried, timers, errors)
    if (errors%any()) return
    carried%stressed = solid%can(can_element_stress)
    call solid%start_request(verb_force, o%step, solid%time, solid%time)
    call solid%request%put_text(field_scope, scope_balance)
    call solid%request%put_int(field_brief, 1_i4)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(all_nodes//dot_force, carried%total, errors)
    call read_turns(o, solid, dot_moment, carried%total_phi, errors)
    call select_nodes(o, solid, .false., timers, errors)
    carried%was(o%sets%off) = was_off
    do k = 1, o%op%nodes
      a = o%op%node(k)
      carried%was(a) = merge(was_prescribed, was_edge, k <= o%op%prescribed)
      carried%total(:, a) = o%forces%f(:, k)
      if (k > o%op%prescribed) carried%total(:, a) = carried%total(:, a) + o%forces%bulk(:, k)
    end do
    do turning = 1, o%op%nodes_phi
      a = o%op%node_phi(turning)
      carried%total_phi(:, a) = o%forces%c(:, turning)
      if (turning > o%op%prescribed_phi) carried%total_phi(:, a) = carried%total_phi(:, a) &
        + o%forces%bulk_phi(:, turning)
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
    call select_nodes(o, solid, .false., timers, errors)
  end subroutine look_at_motion

  !> Motion of all nodes at an accepted exchange; all nodes are selected then.
  subroutine carry_motion(o, solid, carried, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(carried_type), intent(out) :: carried
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, a

    associate (n => o%cells%nodes)
      allocate (carried%u(3, n), carried%v(3, n), carried%total(3, n), carried%phi(3, n), &
                carried%w(3, n), carried%total_phi(3, n), source=0.0_wp)
      allocate (carried%was(n), source=was_bulk)
    end associate
    carried%part = o%sets%part
    call select_nodes(o, solid, .true., timers, errors, carried%held)
    if (errors%any()) return
    call solid%start_request(verb_kick_drift, o%step, solid%time, solid%time)
    call solid%request%put(field_kick, 0.0_wp)
    call solid%request%put(field_drift, 0.0_wp)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(all_nodes//dot_u, carried%u, errors)
    call solid%reply%get(all_nodes//dot_v, carried%v, errors)
    call read_turns(o, solid, dot_phi, carried%phi, errors)
    call read_turns(o, solid, dot_phi_rate, carried%w, errors)
    do k = 1, o%op%nodes
      a = o%op%node(k)
      carried%u(:, a) = o%motion%u(:, k)
      if (allocated(o%map%base)) carried%u(:, a) = carried%u(:, a) + o%map%base(:, a)
      carried%v(:, a) = o%motion%v(:, k)
    end do
    do k = 1, o%op%nodes_phi
      a = o%op%node_phi(k)
      carried%phi(:, a) = o%motion%phi(:, k)
      if (allocated(o%map%base_phi)) &
        carried%phi(:, a) = carried%phi(:, a) + o%map%base_phi(:, a)
      carried%w(:, a) = o%motion%w(:, k)
    end do
  end subroutine carry_motion

  !> All nodes and all micro-rotations, or one of each; what the deck of the solid holds.
  subroutine select_nodes(o, solid, all, timers, errors, held)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: all
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical, allocatable, intent(out), optional :: held(:, :)  !! (3, nodes)
    integer(i4), allocatable :: fixed(:, :), turning(:)
    integer(i4) :: k
    if (errors%any()) return
    call solid%start_select(o%step, all_nodes, role_report, &
      [(int(k, i8), k=1, merge(o%cells%nodes, 1_i4, all))], field_u)
    call solid%ask(timers, errors)
    if (errors%any()) return
    if (present(held)) then
      call solid%reply%take_int(field_held, fixed, errors)
      if (errors%any()) return
      held = fixed == 1
    end if
    turning = turning_nodes(o)
    if (size(turning) == 0) return
    if (.not. all) turning = turning(:1)
    call solid%start_select(o%step, all_turns, role_report, int(turning, i8), field_phi)
    call solid%ask(timers, errors)
  end subroutine select_nodes

  !> Nodes with micro-rotations.
  pure function turning_nodes(o) result(ids)
    type(overlap_type), intent(in) :: o
    integer(i4) :: ids(count(o%cells%polar)), k
    ids = pack([(k, k=1, o%cells%nodes)], o%cells%polar)
  end function turning_nodes

  !> A field of all micro-rotations from a reply, by the ids of the nodes.
  subroutine read_turns(o, solid, field, values, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    character(len=*), intent(in) :: field  !! dot_...
    real(wp), intent(inout) :: values(:, :)  !! (3, nodes)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: part(3, count(o%cells%polar))
    if (size(part) == 0 .or. errors%any()) return
    call solid%reply%get(all_turns//field, part, errors)
    if (.not. errors%any()) values(:, turning_nodes(o)) = part
  end subroutine read_turns

  !> Loads that hold what jumps: what moves by itself gets the force that it had, and so do free
  !! grains by nodes around which no element has changed its part. Of other nodes that follow free
  !! grains the elements act, strained since the start as they are, and the ghosts' part is held:
  !! what the changed elements carried the grains in them carry now. Where elements close nodes that
  !! followed grains, or had no continuum, begin in balance, and no grain feels a new force. So do
  !! all of a solid with a stress before the start: the grains have it, too, and act by themselves.
  subroutine hold_difference(o, carried)
    type(overlap_type), intent(inout) :: o
    type(carried_type), intent(in) :: carried
    real(wp) :: f(3, o%op%nodes), c(3, o%op%nodes_phi)
    integer(i4) :: rule(o%cells%nodes)
    integer(i4) :: k, a
    call choose_rules(o, carried, rule)
    associate (own => o%forces)
      do k = 1, o%op%nodes
        a = o%op%node(k)
        f(:, k) = load_by(rule(a), own%f(:, k), own%bulk(:, k), own%element(:, k), &
                          carried%total(:, a))
      end do
      do k = 1, o%op%nodes_phi
        a = o%op%node_phi(k)
        c(:, k) = load_by(rule(a), own%c(:, k), own%bulk_phi(:, k), own%element_phi(:, k), &
                       carried%total_phi(:, a))
      end do
    end associate
    call o%hold_loads(f, c)
  end subroutine hold_difference

  !> What is held at the nodes of prescribed ones and of the edge.
  pure subroutine choose_rules(o, carried, rule)
    type(overlap_type), intent(in) :: o
    type(carried_type), intent(in) :: carried
    integer(i4), intent(out) :: rule(:)  !! (nodes) hold_...
    logical, dimension(size(rule)) :: changed, closed
    integer(i4) :: k, a, e
    changed = .false.
    closed = .false.
    rule = hold_all
    do e = 1, o%cells%elements
      if (o%sets%part(e) == carried%part(e)) cycle
      changed(o%cells%nodes_of(e)) = .true.
      if (closes(carried%part(e), o%sets%part(e))) closed(o%cells%nodes_of(e)) = .true.
    end do
    do k = 1, o%op%nodes
      a = o%op%node(k)
      associate (followed => carried%was(a) == was_prescribed)
        if (k > o%op%prescribed) then
          rule(a) = merge(hold_balance, hold_all, closed(a) .and. carried%was(a) >= was_prescribed)
        else if (closed(a) .or. carried%stressed) then
          rule(a) = merge(hold_share, hold_nothing, followed)
        else
          rule(a) = merge(hold_share, hold_ghosts, followed .and. .not. changed(a))
        end if
      end associate
    end do
  end subroutine choose_rules

  !> Held by one of the rules [N] or [N m].
  pure function load_by(rule, f, bulk, element, total) result(load)
    integer(i4), intent(in) :: rule
    real(wp), intent(in) :: f(3), bulk(3), element(3), total(3)
    real(wp) :: load(3)
    select case (rule)
    case (hold_balance)
      load = -f - bulk
    case (hold_share)
      load = total - f
    case (hold_nothing)
      load = -f
    case (hold_ghosts)
      load = element - f
    case default
      load = total - f - bulk
    end select
  end function load_by

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
