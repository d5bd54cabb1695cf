!> Make an overlap from what the solvers describe: mesh, grains, sets, operators; select the sets,
!! give each energy and each mass to one side, and find the forces at the start.
module cpl_overlap_setup
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_message, only: verb_set, verb_ready
  use talus_port_names, only: can_border, dot_force, dot_moment, dot_theta, &
    field_axes, field_element, field_force, field_held, field_held_phi, field_id, field_inertia, &
    field_kind, field_load, field_mass, field_mass_phi, field_mass_u, field_micromorphic, &
    field_moment, field_node, field_omega, field_phi, field_polar, field_quat, field_radius, &
    field_scalars, field_set, field_speed, field_speed_phi, field_start, field_step_limit, &
    field_theta, field_u, field_v, field_value, field_what, field_x, role_load, role_prescribe, &
    role_report, what_grains, what_group, what_mass_factor, what_mesh
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type, rotation_fixed, rotation_curl, rotation_micro
  use cpl_operators, only: map_choice_type, weigh_unit, weigh_mass, weigh_volume
  use cpl_overlap, only: overlap_type, ghost_set, free_set, pulled_set, prescribed_set, edge_set, &
    prescribed_phi_set, edge_phi_set, off_set
  use cpl_overlap_carry, only: carried_type, hold_difference, any_closes
  use cpl_overlap_file, only: hash_of
  use cpl_overlap_hold, only: hold_solid, release_edge, hold_beyond, hold_weight
  use cpl_overlap_limit, only: check_step
  use cpl_overlap_loads, only: begin_loads
  use cpl_overlap_mass, only: own_rim, share_mass, damp_fine_scale
  use cpl_overlap_parts, only: begin_parts
  use cpl_overlap_static, only: begin_static
  use cpl_overlap_start, only: start_type, prepare_start, balance_start
  use cpl_overlap_ask, only: evaluate_bulk, read_free
  use cpl_overlap_step, only: evaluate_forces
  use cpl_sets, only: part_rest, part_ghost, part_free
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: make_overlap, give_masses, begin_overlap, read_grains, read_mesh

contains

  !> Describe, sort, make the operators and check their identities. Positions and masses of a
  !! checkpoint's reference state are used for those of the grains now.
  subroutine make_overlap(o, solvers, choices, dynamic, reference, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: dynamic                 !! the solid has inertia
    real(wp), allocatable, intent(in) :: reference(:, :)
    !! (6, all grains) x, mass, mean and least moment of inertia
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    call check_solvers(solvers, choices, o%rules%substeps, errors)
    if (errors%any()) return
    o%rules%symmetric = choices%overlap%scheme == 'symmetric'
    o%rules%static = choices%overlap%scheme == 'static'
    o%rules%stressed = choices%overlap%initial == 'stress'
    if (choices%overlap%bound) o%rules%least_weight = choices%overlap%least_weight
    call read_grains(o, solvers(side_grains), timers, errors)
    if (errors%any()) return
    if (allocated(reference)) call take_reference(o, reference, errors)
    if (errors%any()) return
    call read_mesh(o, solvers(side_solid), timers, errors)
    if (errors%any()) return
    if (.not. allocated(o%sets%part)) &
      call choose_elements(o, solvers(side_solid), choices, timers, errors)
    call check_micro(o, choices, solvers(side_solid), errors)
    if (errors%any()) return
    if (o%cells%micromorphic .and. rotation_of(o, choices) == rotation_micro) then
      o%op%micro%positions = choices%overlap%micro_deformation == 'positions'
      o%op%micro%rigid = choices%overlap%micro_deformation == 'spins'
    end if
    if (choices%overlap%partition == 'share') o%sets%least_depth = 1.5_wp  ! nothing fades
    o%sets%free_rim = choices%overlap%free_rim
    call o%sets%sort(o%cells, o%pack, errors)
    if (errors%any()) return
    if (choices%overlap%remap > 0.0_wp .and. .not. choices%overlap%bound) &
      call o%sets%take_neighbours(o%pack)
    call o%op%build(o%cells, o%sets, o%pack, map_choice_type(rotation_of(o, choices), &
      weights_of(choices), choices%overlap%projection == 'mls'), errors)
    if (errors%any()) return
    o%rules%turns = o%op%prescribed_phi > 0
    o%rules%in_parts = o%rules%symmetric .and. o%rules%substeps > 1 .and. &
      choices%overlap%ghost_contacts == 'exchange'
    if (o%rules%in_parts .and. (o%op%micro%active &
      .or. .not. solvers(side_grains)%can(can_border))) &
      call errors%add('D421', "ghost_contacts = 'exchange' is for classical and micropolar "// &
                      'solids, and for grains that have the role border', '', &
                      "write ghost_contacts = 'step'")
    o%rules%round = all(o%pack%round(o%sets%ghost))
    o%rules%fine_damping = choices%overlap%fine_damping
    o%rules%round_free = all(o%pack%round(o%sets%free))
    o%rules%reads_force = choices%overlap%mass == 'consistent' .or. o%rules%static
    o%rules%reads_speed = o%rules%reads_force .or. choices%overlap%fine_damping > 0.0_wp
    call o%allocate_state()
    call own_rim(o)
    call o%op%identity_error(o%map%x_free, o%map%x_node, o%map%x_ghost, o%map%identity, errors)
    o%map%sets_hash = hash_of(o)
  end subroutine make_overlap

  !> The grains as they were when the operators were made. Grains that have broken since are among
  !! them: no operator holds one, but rows stay as they were.
  subroutine take_reference(o, reference, errors)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: reference(:, :)  !! (7, grains) [m], [kg], [kg m^2], [m], ids
    type(error_list_type), intent(inout) :: errors
    if (all(reference(7, :) > 0.0_wp) .and. .not. same_ids(o%pack%id, reference(7, :))) &
      call o%pack%lay_out(nint(reference(7, :), i8))
    if (size(reference, 2) /= size(o%pack%id)) then
      call errors%add('I404', 'the checkpoint has '//str(size(reference, 2))// &
                      ' grains, talus-dem has '//str(size(o%pack%id)), 'checkpoint', &
                      'go on with the packing and the deck that wrote it')
      return
    end if
    o%pack%x = reference(:3, :)
    o%pack%mass = reference(4, :)
    o%pack%inertia = reference(5, :)
    o%pack%slimmest = reference(6, :)
  end subroutine take_reference

  pure logical function same_ids(id, reference)
    integer(i8), intent(in) :: id(:)
    real(wp), intent(in) :: reference(:)
    same_ids = size(id) == size(reference)
    if (same_ids) same_ids = all(id == nint(reference, i8))
  end function same_ids

  !> Factors on masses of free grains, masses that prescribed nodes carry, damping of the fine
  !! scale.
  subroutine give_masses(o, choices, grains, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_choices_type), intent(in) :: choices
    type(cpl_solver_type), intent(in) :: grains
    type(error_list_type), intent(inout) :: errors
    call share_mass(o, choices%overlap%mass, errors)
    if (.not. errors%any()) call make_damping(o, choices%overlap%fine_damping, grains, errors)
  end subroutine give_masses

  !> D422: grains without a step of their own. D432: grains whose masses are scaled beside a solid
  !! with inertia. D423: an exchange above the stable step of the solid.
  subroutine check_solvers(solvers, choices, substeps, errors)
    type(cpl_solver_type), intent(in) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    integer(i4), intent(out) :: substeps
    type(error_list_type), intent(inout) :: errors
    logical :: static

    substeps = 1
    static = choices%overlap%scheme == 'static'
    if (.not. solvers(side_grains)%dt > 0.0_wp) then
      call errors%add('D422', solvers(side_grains)%title()//' has no step of its own', &
                      solvers(side_grains)%deck, 'write dt in &dynamics or &relaxation of its '// &
                      'deck: the exchange is a multiple of it')
      return
    end if
    if (.not. static .and. any(abs(solvers(side_grains)%motion(2:) - 1.0_wp) > 0.0_wp)) &
      call errors%add('D432', 'the masses of the grains are scaled, by '// &
                      str(solvers(side_grains)%motion(2))//', their moments of inertia by '// &
                      str(solvers(side_grains)%motion(3)), solvers(side_grains)%deck, &
                      'the solid beside them has its own mass: leave mass_scale and '// &
                      "inertia_scale out of &relaxation, or take a static solid")
    substeps = max(1, nint(choices%exchange/solvers(side_grains)%dt))
    if (.not. static .and. solvers(side_solid)%step_limit > 0.0_wp .and. &
        choices%exchange > solvers(side_solid)%step_limit) &
      call errors%add('D423', 'exchange = '//str(choices%exchange)//' s is longer than the '// &
                      'stable step of the solid, '//str(solvers(side_solid)%step_limit)//' s', &
                      solvers(side_solid)%deck, 'shorten &clock exchange')
  end subroutine check_solvers

  subroutine read_grains(o, grains, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: axes(:, :), inertia(:, :)
    real(wp), parameter :: sphere = 4.188790204786390984617_wp  !! 4 pi/3

    call grains%describe(what_grains, '', timers, errors)
    if (errors%any()) return
    associate (reply => grains%reply, p => o%pack)
      call reply%take_int(field_id, p%id, errors)
      call reply%take(field_x, p%x, errors)
      call reply%take(field_quat, p%quat, errors)
      call reply%take(field_axes, axes, errors)
      call reply%take(field_radius, p%radius, errors)
      call reply%take(field_mass, p%mass, errors)
      call reply%take(field_inertia, inertia, errors)
      call reply%take_int(field_kind, p%kind, errors)
      if (errors%any()) return
      p%inertia = sum(inertia, 1)/3.0_wp
      p%slimmest = minval(inertia, 1)
      p%volume = sphere*product(axes, 1)
      p%round = maxval(axes, 1) - minval(axes, 1) <= 0.0_wp
    end associate
  end subroutine read_grains

  subroutine read_mesh(o, solid, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: polar(:)

    call solid%describe(what_mesh, '', timers, errors)
    if (errors%any()) return
    associate (reply => solid%reply, c => o%cells)
      call reply%take(field_x, c%x, errors)
      call reply%take_int(field_kind, c%kind, errors)
      call reply%take_int(field_start, c%start, errors)
      call reply%take_int(field_node, c%node, errors)
      call reply%take(field_mass_u, c%mass, errors)
      if (errors%any()) return
      if (allocated(o%map%base)) c%x = c%x + o%map%base
      c%nodes = size(c%x, 2)
      c%elements = size(c%kind)
      allocate (c%polar(c%nodes), source=.false.)
      allocate (c%inertia(c%nodes), source=0.0_wp)
      if (reply%has(field_polar)) then
        call reply%take_int(field_polar, polar, errors)
        call reply%take(field_mass_phi, c%inertia, errors)
        if (errors%any()) return
        c%polar = polar == 1
      end if
      c%micromorphic = reply%has(field_micromorphic)
      if (c%micromorphic) then
        call reply%take_int(field_micromorphic, polar, errors)
        call reply%take(field_mass_phi, c%inertia, errors)
        if (errors%any()) return
        c%polar = polar == 1
      end if
      call c%check(errors)
      if (.not. errors%any()) call c%prepare()
    end associate
  end subroutine read_mesh

  !> D427: what a micromorphic solid cannot be given, and what it alone has.
  subroutine check_micro(o, choices, solid, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    type(cpl_solver_type), intent(in) :: solid
    type(error_list_type), intent(inout) :: errors
    if (o%cells%micromorphic .and. o%rules%stressed) &
      call errors%add('D427', "initial = 'stress' does not know micromorphic solids", solid%deck, &
      'give the stress in the deck of the solid '// &
      "(&initial_stress, &geostatic), and write initial = 'dead_load' in &overlap")
    if (o%cells%micromorphic .and. choices%overlap%moduli /= 'deck') call errors%add('D427', &
      "moduli = '"//choices%overlap%moduli//"' does not know micromorphic solids", solid%deck, &
      'give the moduli in &micromorphic; `talus measure` finds them from a pack')
    if (choices%overlap%micro_deformation_given .and. .not. o%cells%micromorphic) &
      call errors%add('D427', 'micro_deformation is given, and the solid is not micromorphic', &
      solid%deck, 'leave it out of &overlap')
  end subroutine check_micro

  !> Which elements are whose. I421: a group without elements, an element in both.
  subroutine choose_elements(o, solid, choices, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(cpl_choices_type), intent(in) :: choices
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical :: free(o%cells%elements), ghost(o%cells%elements)
    integer(i4) :: e

    associate (c => choices%overlap)
      call chosen(o, solid, c%free_elements, c%free_box, free, timers, errors)
      if (errors%any()) return
      call chosen(o, solid, c%ghost_elements, c%ghost_box, ghost, timers, errors)
      if (errors%any()) return
      if (len(c%ghost_elements) == 0) ghost = ghost .and. .not. free
    end associate
    if (any(free .and. ghost)) then
      e = findloc(free .and. ghost, .true., 1)
      call errors%add('I421', str(count(free .and. ghost))//' elements are of free grains and '// &
                      'of ghosts, such as '//str(e), solid%deck, 'their groups must not overlap')
    end if
    if (.not. (any(free) .and. any(ghost))) &
      call errors%add('I421', str(count(free))//' elements are of free grains, '// &
                      str(count(ghost))//' of ghosts', solid%deck, 'name groups of elements or '// &
                      'boxes that hold some: the middle of an element must lie in a box')
    o%sets%part = merge(part_free, merge(part_ghost, part_rest, ghost), free)
  end subroutine choose_elements

  subroutine chosen(o, solid, group, box, list, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    character(len=*), intent(in) :: group
    real(wp), intent(in) :: box(6)
    logical, intent(out) :: list(:)  !! (elements)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: ids(:)
    real(wp) :: middle(3)
    integer(i4) :: e

    list = .false.
    if (len(group) == 0) then
      do e = 1, o%cells%elements
        associate (node => o%cells%node(o%cells%start(e):o%cells%start(e + 1) - 1))
          middle = sum(o%cells%x(:, node), 2)/size(node)
        end associate
        list(e) = all(middle >= box(:3)) .and. all(middle <= box(4:))
      end do
      return
    end if
    call solid%describe(what_group, group, timers, errors)
    if (errors%any()) return
    if (.not. solid%reply%has(field_element)) then
      call errors%add('I421', "the group '"//group//"' is not one of elements", solid%deck, &
                      '&overlap wants volume groups')
      return
    end if
    call solid%reply%take_int(field_element, ids, errors)
    if (.not. errors%any()) list(ids) = .true.
  end subroutine chosen

  pure integer(i4) function rotation_of(o, choices)
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    if (choices%overlap%bound) then
      rotation_of = merge(rotation_micro, rotation_fixed, any(o%cells%polar))
      return
    end if
    select case (choices%overlap%rotation)
    case ('fixed')
      rotation_of = rotation_fixed
    case ('curl')
      rotation_of = rotation_curl
    case ('micro')
      rotation_of = rotation_micro
    case default
      rotation_of = merge(rotation_micro, rotation_curl, any(o%cells%polar))
    end select
  end function rotation_of

  pure integer(i4) function weights_of(choices)
    type(cpl_choices_type), intent(in) :: choices
    select case (choices%overlap%weights)
    case ('unit')
      weights_of = weigh_unit
    case ('volume')
      weights_of = weigh_volume
    case default
      weights_of = weigh_mass
    end select
  end function weights_of

  !> SELECT, weights, masses, READY; a fresh run then takes the forces at the start. Sets that are
  !! made anew within a run take over what is carried.
  subroutine begin_overlap(o, solvers, choices, again, timers, errors, carried)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: again  !! after a restart
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(carried_type), intent(in), optional :: carried
    real(wp), dimension(3, o%op%ghosts) :: v, spin
    type(start_type) :: start

    call select_sets(o, solvers, again, timers, errors)
    if (errors%any()) return
    call prepare_start(o, solvers, choices, again, start, timers, errors)
    if (errors%any()) return
    call set_inertia(o, solvers, again, timers, errors)
    if (errors%any()) return
    call ready(solvers(side_grains), o%step, timers, errors)
    if (.not. again) call read_start(o, solvers(side_grains), timers, errors)
    if (errors%any()) return
    if (o%rules%stressed) then
      call balance_start(o, solvers(side_solid), again, start, timers, errors)
    else if (.not. present(carried)) then
      call hold_solid(o, solvers(side_solid), again, choices%overlap%dead_load, timers, errors)
    end if
    if (errors%any()) return
    if (.not. present(carried)) call ready(solvers(side_solid), o%step, timers, errors)
    call begin_loads(o, solvers(side_solid), again, timers, errors)
    if (errors%any()) return
    if (again) then
      if (o%rules%in_parts) call begin_parts(o, solvers(side_grains), o%forces%parts%active, &
        timers, errors)
      return
    end if
    if (present(carried)) call go_on(o, solvers(side_solid), carried, timers, errors)
    if (errors%any()) return
    call o%op%to_ghosts(o%motion%v, o%motion%w, v, spin)
    call evaluate_forces(o, solvers, v, spin, solvers(1)%time, timers, errors)
    if (.not. present(carried)) call release_edge(o, solvers(side_solid), timers, errors)
    if (.not. (o%rules%static .or. errors%any())) &
      call evaluate_bulk(o, solvers(side_solid), 0.0_wp, solvers(1)%time, timers, errors)
    if (errors%any()) return
    if (o%rules%in_parts) call begin_parts(o, solvers(side_grains), .false., timers, errors)
    if (errors%any()) return
    if ((o%rules%stressed .or. choices%overlap%dead_load) &
      .and. .not. o%rules%static) call steady_forces(o)
    if (choices%overlap%dead_load) then
      call o%pull()
      if (present(carried)) then
        call hold_difference(o, carried)
      else
        call o%forces%hold()
      end if
      if (.not. o%rules%static) call hold_weight(o, solvers(side_grains)%gravity)
      call o%pull()
      call o%resist()
    end if
    if (o%rules%static) call begin_static(o, start%stiffness, start%touching)
  end subroutine begin_overlap

  !> Masses of the grains, and the step that they leave stable.
  subroutine set_inertia(o, solvers, again, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    logical, intent(in) :: again  !! after a restart
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call set_mass(o, solvers(side_grains), timers, errors)
    if (.not. (again .or. o%rules%static .or. errors%any())) &
      call check_step(o, solvers, timers, errors)
  end subroutine set_inertia

  !> Nodes go on with the velocities that they had; where elements close those beyond the edge do so
  !! under the forces that they had.
  subroutine go_on(o, solid, carried, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(carried_type), intent(in) :: carried
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call o%motion%set_speed(merge(0.0_wp, carried%v(:, o%op%node), o%own%held), &
                            merge(0.0_wp, carried%w(:, o%op%node_phi), o%own%held_phi))
    if (any_closes(o, carried)) call hold_beyond(o, solid, carried%total, timers, errors)
  end subroutine go_on

  !> Damping of the fine scale, strongest at the ghosts. D426: more than a step can take.
  subroutine make_damping(o, rate, grains, errors)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: rate  !! [1/s]
    type(cpl_solver_type), intent(in) :: grains
    type(error_list_type), intent(inout) :: errors
    if (.not. rate > 0.0_wp) return
    if (rate*grains%dt > 1.0_wp) then
      call errors%add('D426', 'fine_damping = '//str(rate)//' 1/s stops the fine scale in less '// &
                      'than a step of the grains, '//str(grains%dt)//' s', grains%deck, &
                      'take at most 1/dt; a tenth of the highest frequency of the grains is much')
      return
    end if
    call damp_fine_scale(o, o%cells)
  end subroutine make_damping

  !> Forces of the elements without prescribed nodes at the start, which the others or dead loads
  !! balance, act on the edge in every step of the grains, too: in kicks they would shake it.
  subroutine steady_forces(o)
    type(overlap_type), intent(inout) :: o
    call o%forces%make_steady(o%op%prescribed, o%op%prescribed_phi)
    call o%pull()
    call o%resist()
  end subroutine steady_forces

  !> State of the grains before the first exchange, from their reply to READY.
  subroutine read_start(o, grains, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call grains%reply%get(field_scalars, o%ledger%grains, errors)
    if (o%rules%turns) call grains%reply%get(free_set//dot_theta, o%map%theta_ref, errors)
    call grains%reply%get(ghost_set//dot_force, o%forces%p, errors)
    call grains%reply%get(ghost_set//dot_moment, o%forces%m, errors)
    call read_free(o, grains, timers, errors)
  end subroutine read_start

  subroutine ready(solver, step, timers, errors)
    type(cpl_solver_type), intent(inout) :: solver
    integer(i8), intent(in) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solver%start_request(verb_ready, step, solver%time, solver%time)
    call solver%ask(timers, errors)
  end subroutine ready

  !> SELECT; at a fresh start the edge begins with the velocities of the solid's deck (&initial).
  subroutine select_sets(o, solvers, again, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    logical, intent(in) :: again
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: held(:, :)
    real(wp) :: v(3, o%op%nodes - o%op%prescribed), w(3, o%op%nodes_phi - o%op%prescribed_phi)
    integer(i4) :: edge_role

    edge_role = role_prescribe
    if (o%rules%static) edge_role = role_load
    associate (grains => solvers(side_grains), solid => solvers(side_solid), n => o%op%prescribed, &
               m => o%op%prescribed_phi)
      call choose(grains, ghost_set, role_prescribe, o%pack%id(o%sets%ghost), &
        field_force//','//field_moment)
      call choose(grains, free_set, role_report, o%pack%id(o%sets%free), reported(o))
      call choose(grains, pulled_set, role_load, o%pack%id(o%sets%free), 'none')
      call choose(solid, prescribed_set, role_prescribe, int(o%op%node(:n), i8), field_u)
      if (.not. (again .or. errors%any())) call solid%reply%get(field_speed, o%motion%v(:, :n), &
                                                                errors)
      if (size(o%sets%off) > 0) &
        call choose(solid, off_set, role_prescribe, int(o%sets%off, i8), field_u)
      call choose(solid, edge_set, edge_role, int(o%op%node(n + 1:), i8), field_u)
      if (errors%any()) return
      call solid%reply%take_int(field_held, held, errors)
      call solid%reply%get(field_speed, v, errors)
      if (errors%any()) return
      o%own%held(:, n + 1:) = held == 1
      if (.not. (again .or. o%rules%static)) call o%motion%begin_speed(n, v)
      if (o%op%nodes_phi == 0) return
      call choose(solid, prescribed_phi_set, role_prescribe, &
        int(o%op%node_phi(:m:o%op%stride), i8), field_phi)
      call choose(solid, edge_phi_set, edge_role, int(o%op%node_phi(m + 1::o%op%stride), i8), &
                  field_phi)
      if (errors%any()) return
      call solid%reply%take_int(field_held_phi, held, errors)
      call solid%reply%get(field_speed_phi, w, errors)
      if (errors%any()) return
      o%own%held_phi(:, m + 1:) = held == 1
      if (.not. (again .or. o%rules%static)) call o%motion%begin_spin(m, w)
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
  end subroutine select_sets

  !> What the grains report of the free ones.
  pure function reported(o) result(fields)
    type(overlap_type), intent(in) :: o
    character(len=:), allocatable :: fields
    fields = field_x
    if (o%rules%turns) fields = fields//','//field_theta
    if (o%rules%reads_force) fields = fields//','//field_force//','//field_load
    if (o%rules%reads_force .and. o%rules%turns) fields = fields//','//field_moment
    if (o%rules%reads_speed) fields = fields//','//field_v
    if (o%rules%reads_speed .and. o%rules%turns) fields = fields//','//field_omega
  end function reported

  !> Factors on the masses of the free grains. D425: the step is above the limit that comes back.
  subroutine set_mass(o, grains, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: limit
    integer(i4) :: light
    call grains%start_request(verb_set, o%step, grains%time, grains%time)
    call grains%request%put_text(field_what, what_mass_factor)
    call grains%request%put_text(field_set, pulled_set)
    call grains%request%put(field_value, o%own%factor)
    call grains%ask(timers, errors)
    if (errors%any() .or. .not. any(abs(o%own%factor - 1.0_wp) > 0.0_wp)) return
    call grains%reply%get(field_step_limit, limit, errors)
    if (errors%any() .or. grains%dt <= limit) return
    light = minloc(o%own%factor, 1)
    call errors%add('D425', 'the step of the grains, '//str(grains%dt)//' s, is above the '// &
      'stable step with the masses of the overlap, '//short_number(limit)//' s: grain '// &
      str(o%pack%id(o%sets%free(light)))//' keeps '//short_number(o%own%factor(light))// &
      ' of its mass', grains%deck, "shorten dt in its deck, or write mass = 'consistent' in "// &
      '&overlap')
  end subroutine set_mass
end module cpl_overlap_setup
