!> Dead loads that hold the solid beyond the edge at the start (theory: overlap coupling, Start).
!!
!! Loads, weight and stress of the solid's deck need not balance at nodes that neither follow grains
!! nor lie at the ghosts: an elastic solid without initial stress sinks under its weight and its
!! pressures. With initial = 'dead_load' the rest at each of these nodes is held against from then
!! on; with 'none' it acts. Either way the user is told how large it is.
module cpl_overlap_hold
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force, verb_ready, verb_set
  use talus_port_names, only: dot_force, field_brief, field_force, field_held, field_mass, &
    field_rehearsal, field_scope, field_set, field_u, field_what, role_report, scope_balance, &
    scope_loads, what_dead_load
  use talus_timers, only: timers_type
  use cpl_overlap, only: overlap_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: hold_solid, release_edge, hold_beyond, hold_weight, rest_beyond, rehearse

  character(len=*), parameter :: all_nodes = 'everything'  !! set of all nodes of the solid
  real(wp), parameter :: stressless = 1.0e-9_wp  !! inner forces over loads of a body without stress

contains

  !> A fresh run finds the rest and, where asked, holds it; a restarted one holds what the
  !! checkpoint says. In statics a solid without stress finds its own balance with its loads.
  subroutine hold_solid(o, solid, again, hold, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: again  !! after a restart
    logical, intent(in) :: hold   !! initial = 'dead_load'
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rest(:, :), load(:, :)
    logical, allocatable :: free(:, :), edge(:, :)

    if (again .and. .not. allocated(o%start%hold)) return
    call select_all(o, solid, free, edge, load, timers, errors)
    if (.not. (again .or. errors%any())) then
      call rehearse(o, solid, timers, errors)
      call ask_forces(o, solid, scope_balance, rest, timers, errors)
      call add_loads(o, solid, load, timers, errors)
      if (errors%any()) return
      if (.not. o%rules%static .or. any(abs(rest - load) > stressless*maxval(abs(load)))) then
        call rest_beyond(rest, load, free, o%start%solid_rest, o%start%solid_node, &
                         o%start%solid_share)
        if (hold) o%start%hold = merge(-rest, 0.0_wp, free .or. edge)
      end if
    end if
    if (allocated(o%start%hold)) call send_hold(o, solid, timers, errors)
    call select_one(o, solid, timers, errors)
  end subroutine hold_solid

  !> In statics the solid solves for the edge, too, and found its start with all of it held, since
  !! forces on it come with the first step. Elements with prescribed nodes are among these: what
  !! they bear is no dead load any more.
  subroutine release_edge(o, solid, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: load(:, :)
    logical, allocatable :: free(:, :), edge(:, :)
    integer(i4) :: k
    if (errors%any() .or. .not. (o%rules%static .and. allocated(o%start%hold))) return
    call select_all(o, solid, free, edge, load, timers, errors)
    if (errors%any()) return
    do k = o%op%prescribed + 1, o%op%nodes
      associate (hold => o%start%hold(:, o%op%node(k)), loose => edge(:, o%op%node(k)))
        hold = hold + merge(o%forces%element(:, k), 0.0_wp, loose)
      end associate
    end do
    call send_hold(o, solid, timers, errors)
    call select_one(o, solid, timers, errors)
  end subroutine release_edge

  !> Within a run: nodes beyond the edge go on under the forces that they had, some of which
  !! talus-couple put on them until now.
  subroutine hold_beyond(o, solid, total, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: total(:, :)  !! (3, nodes) [N]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: now(:, :), weight(:, :)
    logical, allocatable :: free(:, :), edge(:, :)

    call select_all(o, solid, free, edge, weight, timers, errors)
    if (errors%any()) return
    call ask_forces(o, solid, scope_balance, now, timers, errors)
    if (errors%any()) return
    o%start%hold = o%start%hold + merge(total - now, 0.0_wp, free)
    call send_hold(o, solid, timers, errors)
    call select_one(o, solid, timers, errors)
  end subroutine hold_beyond

  !> Dead loads on the free grains against the weight of what elements outside give to the nodes
  !! that follow them: it acts with the mass, and no stress carries it when the coupling begins.
  subroutine hold_weight(o, gravity)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: gravity(3)  !! [m/s^2]
    real(wp) :: weight(3, o%op%prescribed), push(3, o%op%free)
    integer(i4) :: a, g
    do a = 1, o%op%prescribed
      weight(:, a) = o%own%mass(a)*gravity
    end do
    push = 0.0_wp
    call o%op%p%transposed(weight, push)
    do g = 1, o%op%free
      push(:, g) = push(:, g) + (o%own%factor(g) - 1.0_wp)*o%pack%mass(o%sets%free(g))*gravity
    end do
    o%forces%force_hold = o%forces%force_hold - push
    call o%forces%parts%forget_dead()
  end subroutine hold_weight

  !> Largest force that nothing balances at the free components of nodes, where it acts, and its
  !! share of the largest load.
  pure subroutine rest_beyond(rest, load, free, largest, node, share)
    real(wp), intent(in) :: rest(:, :), load(:, :)  !! (3, nodes) [N]
    logical, intent(in) :: free(:, :)               !! (3, nodes)
    real(wp), intent(out) :: largest                !! [N]
    integer(i4), intent(out) :: node                !! 0: none is free
    real(wp), intent(out) :: share                  !! of the largest load on a node [-]
    real(wp) :: scale
    integer(i4) :: a
    largest = 0.0_wp
    scale = 0.0_wp
    node = 0
    do a = 1, size(rest, 2)
      if (.not. any(free(:, a))) cycle
      scale = max(scale, norm2(load(:, a)))
      if (node > 0 .and. .not. norm2(pack(rest(:, a), free(:, a))) > largest) cycle
      largest = norm2(pack(rest(:, a), free(:, a)))
      node = a
    end do
    share = 0.0_wp
    if (largest > 0.0_wp) share = largest/max(scale, tiny(1.0_wp)*largest)
  end subroutine rest_beyond

  !> SELECT all nodes: which components nothing holds and talus-couple does not move, those at the
  !! edge that the solid solves for in statics, and the weight of all.
  subroutine select_all(o, solid, free, edge, weight, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, allocatable, intent(out) :: free(:, :)    !! (3, nodes)
    logical, allocatable, intent(out) :: edge(:, :)    !! (3, nodes)
    real(wp), allocatable, intent(out) :: weight(:, :)  !! (3, nodes) [N]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: held(:, :)
    real(wp), allocatable :: mass(:)
    integer(i4) :: a

    call solid%start_select(o%step, all_nodes, role_report, &
                            [(int(a, i8), a=1, o%cells%nodes)], field_u)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%take_int(field_held, held, errors)
    call solid%reply%take(field_mass, mass, errors)
    if (errors%any()) return
    free = held == 0
    free(:, o%op%node) = .false.
    free(:, o%sets%off) = .false.
    edge = free .neqv. free
    if (o%rules%static) then
      associate (node => o%op%node(o%op%prescribed + 1:))
        edge(:, node) = held(:, node) == 0
      end associate
    end if
    allocate (weight(3, o%cells%nodes))
    do a = 1, o%cells%nodes
      weight(:, a) = mass(a)*solid%gravity
    end do
  end subroutine select_all

  !> The set becomes one node, so that replies stay short.
  subroutine select_one(o, solid, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call solid%start_select(o%step, all_nodes, role_report, [1_i8], field_u)
    call solid%ask(timers, errors)
  end subroutine select_one

  !> READY for a rehearsal, in which forces can be asked for without a file being opened.
  subroutine rehearse(o, solid, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call solid%start_request(verb_ready, o%step, solid%time, solid%time)
    call solid%request%put_int(field_rehearsal, 1_i4)
    call solid%ask(timers, errors)
  end subroutine rehearse

  !> FORCE at all nodes, as what acts on them: loads less inner forces, or loads alone.
  subroutine ask_forces(o, solid, scope, f, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    character(len=*), intent(in) :: scope
    real(wp), allocatable, intent(out) :: f(:, :)  !! (3, nodes) [N]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    allocate (f(3, o%cells%nodes), source=0.0_wp)
    if (errors%any()) return
    call solid%start_request(verb_force, o%step, solid%time, solid%time)
    call solid%request%put_text(field_scope, scope)
    call solid%request%put_int(field_brief, 1_i4)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%get(all_nodes//dot_force, f, errors)
  end subroutine ask_forces

  !> Add the loads of the deck at the start, without weight.
  subroutine add_loads(o, solid, load, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), allocatable, intent(inout) :: load(:, :)  !! (3, nodes) [N]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: deck(:, :)
    call ask_forces(o, solid, scope_loads, deck, timers, errors)
    if (.not. errors%any()) load = load + deck
  end subroutine add_loads

  !> SET dead_load on all nodes.
  subroutine send_hold(o, solid, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call solid%start_request(verb_set, o%step, solid%time, solid%time)
    call solid%request%put_text(field_what, what_dead_load)
    call solid%request%put_text(field_set, all_nodes)
    call solid%request%put(field_force, o%start%hold)
    call solid%ask(timers, errors)
  end subroutine send_hold
end module cpl_overlap_hold
