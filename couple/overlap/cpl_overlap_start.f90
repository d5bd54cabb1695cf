!> The start of an overlap: moduli of the solid and its initial stress from the grains, before the
!! first exchange (theory: overlap coupling, Start).
!!
!! Stress of the pack is corrected so that contacts, stress and loads balance at every node that is
!! free: a pack at rest then stays at rest when the overlap begins.
module cpl_overlap_start
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_force, verb_set
  use talus_port_names, only: dot_force, dot_moment, field_brief, field_couple, field_held, &
    field_held_phi, field_phi, field_scope, field_u, field_value, field_what, &
    role_report, scope_balance, what_initial_stress
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_homogenise, only: pack_average_type, average_pack, extend_average, stress_at
  use cpl_initial, only: initial_state_type, correct_initial
  use cpl_moduli, only: choose_moduli, send_moduli
  use cpl_overlap, only: overlap_type
  use cpl_overlap_hold, only: rehearse
  use cpl_overlap_loads, only: begin_loads
  use cpl_overlap_mass, only: prescribed_shares
  use cpl_overlap_partition, only: contacts_type, points_type, fill_partition
  use cpl_overlap_units, only: check_units
  use cpl_overlap_weights, only: set_partition, send_weights, find_pairs, send_contacts, &
    read_contacts, read_points
  use cpl_partition, only: partition_type
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: start_type, prepare_start, balance_start

  character(len=*), parameter :: all_set = 'everything'  !! all nodes of the solid
  character(len=*), parameter :: all_turns = 'turns'     !! all its micro-rotations

  !> What both sides describe, and the averages over it.
  type :: start_type
    type(contacts_type) :: contacts  !! with their whole forces
    type(points_type) :: points
    type(pack_average_type) :: average
    real(wp) :: stiffness = 0.0_wp   !! mean, normal [N/m]
    integer(i4) :: touching = 0      !! contacts
  end type start_type

contains

  !> Moduli and weights; after a restart those of the checkpoint.
  subroutine prepare_start(o, solvers, choices, again, start, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: again  !! after a restart
    type(start_type), intent(inout) :: start
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    if (again) then
      o%share%shared = 'the weights of the checkpoint'
      if (allocated(o%start%moduli)) call send_moduli(o, solvers(side_solid), timers, errors)
      if (.not. errors%any()) call send_weights(o, solvers, timers, errors)
      return
    end if
    call read_points(solvers(side_solid), start%points, timers, errors)
    if (errors%any()) return
    call find_pairs(o)
    if (o%rules%static .or. o%rules%stressed .or. choices%overlap%moduli /= 'deck' .or. &
        any(choices%overlap%partition == [character(len=5) :: 'auto', 'fit', 'share'])) then
      call read_whole_contacts()
      if (errors%any()) return
    end if
    if (o%rules%stressed .or. choices%overlap%moduli /= 'deck') then
      call average_pack(o, start%contacts, start%points, start%average)
      call choose_moduli(o, choices, start%average%affine, start%points, errors)
      if (allocated(o%start%moduli) .and. .not. errors%any()) &
        call send_moduli(o, solvers(side_solid), timers, errors)
      if (errors%any()) return
    end if
    call check_units(o, start%contacts, start%points, errors)
    if (errors%any()) return
    call set_partition(o, choices, start%contacts, start%points, errors)
    if (.not. errors%any()) call send_weights(o, solvers, timers, errors)

  contains

    !> Contacts, while all count fully.
    subroutine read_whole_contacts()
      real(wp), allocatable :: ones(:)
      allocate (ones(size(o%share%weight_ids, 2)), source=1.0_wp)
      call send_contacts(o, solvers(side_grains), ones, timers, errors)
      if (.not. errors%any()) &
        call read_contacts(solvers(side_grains), start%contacts, timers, errors)
      if (errors%any()) return
      start%touching = size(start%contacts%stiffness, 2)
      start%stiffness = sum(start%contacts%stiffness(1, :))/max(1, start%touching)
    end subroutine read_whole_contacts
  end subroutine prepare_start

  !> Initial stress in balance with the forces p and m of the ghosts; after a restart that of the
  !! checkpoint.
  subroutine balance_start(o, solid, again, start, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: again
    type(start_type), intent(inout) :: start
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(partition_type) :: partition
    integer(i4), allocatable :: row(:), at(:)
    type(initial_state_type) :: state
    real(wp), allocatable :: outer(:, :), load(:, :), rest(:, :)
    logical, allocatable :: free(:, :), chosen(:)
    integer(i4), allocatable :: prescribed(:)

    if (again) then
      call send_stress(o, solid, timers, errors)
      return
    end if
    call extend_average(o%cells, solid%gravity, start%average)
    call fill_partition(o, start%contacts, start%points, partition, row, at, whole=.true.)
    call point_stresses(start, at, partition%polar, state%stress, state%couple)
    call rehearse(o, solid, timers, errors)
    call begin_loads(o, solid, .false., timers, errors)
    call choose_nodes(o, solid, .true., free, timers, errors)
    call outer_loads(o, solid, outer, timers, errors)
    if (errors%any()) return
    prescribed = [o%op%node(:o%op%prescribed), o%cells%nodes + o%op%node_phi(:o%op%prescribed_phi)]
    load = outer
    load(:, prescribed) = 0.0_wp
    call add_ghosts(o, solid%gravity, load)
    state%load = load(:, :partition%blocks())
    state%beta = o%share%beta(at)
    state%force = start%contacts%force(:, row)
    allocate (state%w(size(row)), source=0.0_wp)
    allocate (chosen(size(partition%region)), source=.true.)
    call correct_initial(partition, state, free(:, :partition%blocks()), chosen, &
                         o%start%initial, errors)
    if (errors%any()) return
    call keep_stress(o, start%points, at, state%stress, state%couple)
    call send_stress(o, solid, timers, errors)
    call outer_loads(o, solid, rest, timers, errors)
    if (errors%any()) return
    rest(:, prescribed) = rest(:, prescribed) - outer(:, prescribed)
    call add_ghosts(o, solid%gravity, rest)
    o%start%start_rest = maxval(abs(rest(:, :o%cells%nodes)), free(:, :o%cells%nodes)) &
                   /max(start%average%mean_force, tiny(1.0_wp))
    call choose_nodes(o, solid, .false., free, timers, errors)
  end subroutine balance_start

  !> Stresses of the points that the partition has.
  subroutine point_stresses(start, at, polar, stress, couple)
    type(start_type), intent(in) :: start
    integer(i4), intent(in) :: at(:)
    logical, intent(in) :: polar
    real(wp), allocatable, intent(out) :: stress(:, :), couple(:, :)  !! (9, points)
    integer(i4) :: k
    allocate (stress(9, size(at)), couple(9, size(at)))
    do k = 1, size(at)
      call stress_at(start%average, start%points%element(at(k)), start%points%x(:, at(k)), &
                     stress(:, k), couple(:, k))
      if (.not. polar) stress(:, k) = 0.5_wp*(stress(:, k) + stress([1, 4, 7, 2, 5, 8, 3, 6, 9], k))
    end do
    if (.not. polar) couple = 0.0_wp
  end subroutine point_stresses

  !> SELECT all nodes and all micro-rotations, or one of each; which of them nothing holds.
  !! Prescribed nodes follow the grains, whatever the solid's deck says.
  subroutine choose_nodes(o, solid, all, free, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: all
    logical, allocatable, intent(inout) :: free(:, :)  !! (3, 2 nodes)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: held(:, :), turning(:)
    integer(i4) :: k, n

    n = merge(o%cells%nodes, 1, all)
    call choose(all_set, field_u, [(int(k, i8), k=1, n)])
    if (errors%any()) return
    if (all) then
      allocate (free(3, 2*o%cells%nodes), source=.false.)
      call solid%reply%take_int(field_held, held, errors)
      if (errors%any()) return
      free(:, :o%cells%nodes) = held == 0
      free(:, o%op%node(:o%op%prescribed)) = .true.
    end if
    turning = pack([(k, k=1, o%cells%nodes)], o%cells%polar)
    if (size(turning) == 0) return
    if (.not. all) turning = turning(:1)
    call choose(all_turns, field_phi, int(turning, i8))
    if (errors%any() .or. .not. all) return
    call solid%reply%take_int(field_held_phi, held, errors)
    if (errors%any()) return
    free(:, o%cells%nodes + turning) = held == 0
    free(:, o%cells%nodes + o%op%node_phi(:o%op%prescribed_phi)) = .true.

  contains

    subroutine choose(set, fields, ids)
      character(len=*), intent(in) :: set, fields
      integer(i8), intent(in) :: ids(:)
      if (errors%any()) return
      call solid%start_select(o%step, set, role_report, ids, fields)
      call solid%ask(timers, errors)
    end subroutine choose
  end subroutine choose_nodes

  !> Loads of the solid's deck less its inner forces, at all nodes.
  subroutine outer_loads(o, solid, load, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), allocatable, intent(out) :: load(:, :)  !! (3, 2 nodes) [N], [N m]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: part(:, :)
    integer(i4) :: k

    allocate (load(3, 2*o%cells%nodes), source=0.0_wp)
    if (errors%any()) return
    call solid%start_request(verb_force, o%step, solid%time, solid%time)
    call solid%request%put_text(field_scope, scope_balance)
    call solid%request%put_int(field_brief, 1_i4)
    call solid%ask(timers, errors)
    if (errors%any()) return
    allocate (part(3, o%cells%nodes))
    call solid%reply%get(all_set//dot_force, part, errors)
    load(:, :o%cells%nodes) = part
    if (.not. any(o%cells%polar) .or. errors%any()) return
    deallocate (part)
    allocate (part(3, count(o%cells%polar)))
    call solid%reply%get(all_turns//dot_moment, part, errors)
    load(:, o%cells%nodes + pack([(k, k=1, o%cells%nodes)], o%cells%polar)) = part
  end subroutine outer_loads

  !> Add what ghosts transfer to the nodes, and on prescribed nodes the loads of the deck and the
  !! weight that free grains carry for them.
  subroutine add_ghosts(o, gravity, load)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: gravity(3)      !! [m/s^2]
    real(wp), intent(inout) :: load(:, :)   !! (3, 2 nodes) [N], [N m]
    real(wp) :: f(3, o%op%nodes), c(3, o%op%nodes_phi), mass(o%op%prescribed)
    real(wp) :: force(3, o%op%free), moment(3, o%op%free)
    integer(i4) :: a

    f = 0.0_wp
    c = 0.0_wp
    call o%op%pull(o%forces%p, o%forces%m, f, c, force, moment)
    call prescribed_shares(o, mass)
    do a = 1, o%op%prescribed
      f(:, a) = f(:, a) + mass(a)*gravity + o%forces%loads%f(:, a)
    end do
    c(:, :o%op%prescribed_phi) = c(:, :o%op%prescribed_phi) + o%forces%loads%c
    load(:, o%op%node) = load(:, o%op%node) + f
    load(:, o%cells%nodes + o%op%node_phi) = load(:, o%cells%nodes + o%op%node_phi) + c
  end subroutine add_ghosts

  !> Stresses of all points; those of free grains' elements do not count and are zero.
  subroutine keep_stress(o, points, at, stress, couple)
    type(overlap_type), intent(inout) :: o
    type(points_type), intent(in) :: points
    integer(i4), intent(in) :: at(:)
    real(wp), intent(in) :: stress(:, :), couple(:, :)  !! (9, size(at)) [Pa], [N/m]
    allocate (o%start%stress(9, size(points%element)), o%start%couple(9, size(points%element)), &
      source=0.0_wp)
    o%start%stress(:, at) = stress
    o%start%couple(:, at) = couple
  end subroutine keep_stress

  !> SET initial_stress: nine components in a micropolar body, else six.
  subroutine send_stress(o, solid, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call solid%start_request(verb_set, o%step, solid%time, solid%time)
    call solid%request%put_text(field_what, what_initial_stress)
    if (any(o%cells%polar)) then
      call solid%request%put(field_value, o%start%stress)
      call solid%request%put(field_couple, o%start%couple)
    else
      call solid%request%put(field_value, o%start%stress([1, 5, 9, 2, 6, 7], :))
    end if
    call solid%ask(timers, errors)
  end subroutine send_stress
end module cpl_overlap_start
