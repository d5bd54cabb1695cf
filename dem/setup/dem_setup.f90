!> From deck and packing to a system of grains that is ready to move. Faults D240 to D249, I234.
module dem_setup
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use dem_damped_limit, only: damped_step
  use dem_kinds, only: moved_by_forces
  use dem_state, only: kind_fixed, kind_driven, mode_dynamic, mode_relaxation
  use dem_slabs, only: slab_grains
  use dem_system, only: dem_system_type, dem_contacts_type
  use dem_shape_make, only: make_shapes
  use dem_make, only: make_grains, sorted_order
  use dem_measure, only: largest_overlap
  use dem_packing, only: dem_packing_type, read_packing, empty_packing, drop_grains
  use dem_setup_clumps, only: mark_members, make_clumps
  use dem_setup_surfaces, only: read_surfaces, check_units
  use dem_setup_grains, only: named_rows, usual_materials, materials_of_grains
  use dem_setup_bonds, only: read_bonds
  use dem_setup_laws, only: read_materials, read_contacts, read_walls, check_pair, &
    material_index
  implicit none
  private
  public :: dem_choices_type, read_model, check_initial_overlap, check_step
  public :: read_step_curve

  !> Data of the deck beyond the state of the system.
  type :: dem_choices_type
    type(string_type), allocatable :: material(:)  !! names
    type(string_type), allocatable :: wall(:)      !! names
    real(wp) :: dt = 0.0_wp                        !! fixed step [s]; 0: automatic
    integer(i4) :: dt_curve = 0                    !! of an automatic step, 0: none
    logical :: allow_unstable = .false.
    logical :: adaptive = .false.                  !! damping stops grains as they need it
    real(wp) :: initial_overlap = 0.0_wp           !! limit, of the least semi-axis [-]
    integer(i8), allocatable :: idle(:)            !! driven grains that no group drives
    integer(i4), allocatable :: of_entering(:)     !! materials: of a window, of each source
    integer(i4), allocatable :: of_breakage(:)     !! materials of each &breakage
  end type dem_choices_type

  integer(i4), parameter :: named = 5  !! pairs that overlap

contains

  !> Everything that does not need forces; all faults are found in one go.
  subroutine read_model(deck, system, packing, choices, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(inout) :: system
    type(dem_packing_type), intent(inout) :: packing
    type(dem_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: material(3)

    call check_mode(deck, errors)
    call read_materials(deck, system%materials, choices%material, errors)
    call read_contacts(deck, system%materials, choices%material, system%laws, errors)
    call read_walls(deck, choices%material, system%planes, choices%wall, errors)
    call read_surfaces(deck, choices%material, system%surfaces, errors)
    call read_bonds(deck, system%pairs%additional, errors)
    call usual_materials(deck, choices%material, material, errors)
    call source_materials(deck, material(1), choices, errors)
    call read_parameters(deck, system, choices)
    call read_grains(deck, packing, errors)
    if (errors%any()) return
    call check_units(deck, system%surfaces, packing, errors)
    call hold_grains(deck, packing, errors)
    call drive_grains(deck, packing, choices, errors)
    call mark_members(packing, deck%path('particles', 1, 'file'), errors)
    if (errors%any()) return
    call place_grains(deck, system, packing, choices, material, errors)
    if (.not. errors%any()) call make_clumps(packing%clumps, system%dem_data_type, &
      deck%path('particles', 1, 'file'), errors)
    system%springs = packing%springs
    if (allocated(packing%springs%load) .and. .not. errors%any()) &
      system%springs%load = packing%springs%load(sorted_order(packing%id))
    call drop_grains(packing)
  end subroutine read_model

  !> Exactly one of dynamics and relaxation (D244).
  subroutine check_mode(deck, errors)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: modes
    modes = deck%count('dynamics') + deck%count('relaxation')
    if (modes == 0) then
      call errors%add('D244', 'neither dynamics nor relaxation is given', deck%source%path, &
                      'add &dynamics / for motion as it is, or &relaxation ... /')
    else if (modes == 2) then
      call deck%fault(errors, 'D244', 'dynamics and relaxation are both given', 'relaxation', 1, &
                      '', 'a deck has exactly one of the two')
    end if
  end subroutine check_mode

  !> Materials of what a window and sources bring, and of what breaks.
  subroutine source_materials(deck, usual, choices, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: usual  !! that of the grains of the packing
    type(dem_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    allocate (choices%of_entering(1 + deck%count('source')), source=usual)
    do k = 1, deck%count('source')
      if (.not. deck%given('source', k, 'material')) cycle
      call material_index(deck, choices%material, 'source', k, 'material', &
                          choices%of_entering(1 + k), errors)
    end do
    allocate (choices%of_breakage(deck%count('breakage')), source=0_i4)
    do k = 1, deck%count('breakage')
      call material_index(deck, choices%material, 'breakage', k, 'material', &
                          choices%of_breakage(k), errors)
    end do
  end subroutine source_materials

  !> The packing; none where all grains come from sources (D298).
  subroutine read_grains(deck, packing, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(inout) :: packing
    type(error_list_type), intent(inout) :: errors
    if (deck%given('particles', 1, 'file')) then
      call read_packing(packing, deck%path('particles', 1, 'file'), errors)
    else if (deck%count('source') > 0) then
      call empty_packing(packing)
    else
      call deck%fault(errors, 'D298', 'the run has neither a packing nor a source of grains', &
                      'particles', 1, 'file', "make one with 'talus pack', or add a &source")
    end if
  end subroutine read_grains

  subroutine read_parameters(deck, system, choices)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(inout) :: system
    type(dem_choices_type), intent(inout) :: choices
    character(len=:), allocatable :: mode
    real(wp), allocatable :: gravity(:)

    associate (par => system%par)
      call deck%get('run', 1, 'gravity', gravity)
      par%gravity = gravity
      mode = 'dynamics'
      par%mode = mode_dynamic
      if (deck%count('relaxation') > 0) then
        mode = 'relaxation'
        par%mode = mode_relaxation
        call deck%get(mode, 1, 'mass_scale', par%mass_scale)
        call deck%get(mode, 1, 'inertia_scale', par%inertia_scale)
        call deck%get(mode, 1, 'gravity_scale', par%gravity_scale)
      end if
      call deck%get(mode, 1, 'damping', par%damping)
      choices%adaptive = par%damping < -1.5_wp
      par%full_damping = par%damping < 0.0_wp .and. .not. choices%adaptive
      par%damping = max(par%damping, 0.0_wp)
      call deck%get(mode, 1, 'dt', choices%dt)
      call deck%get(mode, 1, 'dt_factor', par%dt_factor)
      call deck%get(mode, 1, 'allow_unstable', choices%allow_unstable)
      call deck%get('search', 1, 'skin', par%skin)
      call deck%get('limits', 1, 'overlap', par%overlap_limit)
      call deck%get('limits', 1, 'energy', par%energy_limit)
      call deck%get('limits', 1, 'initial_overlap', choices%initial_overlap)
      par%allow_late = allows(deck, 'late_rebuilds')
    end associate
  end subroutine read_parameters

  !> Does the deck allow a figure of health to be red?
  logical function allows(deck, key)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: key
    type(string_type), allocatable :: allow(:)
    integer(i4) :: k
    allows = .false.
    call deck%get('limits', 1, 'allow', allow)
    do k = 1, size(allow)
      allows = allows .or. allow(k)%s == key
    end do
  end function allows

  !> The curve of an automatic step: positive, and never above all limits (D253).
  subroutine read_step_curve(deck, curve, choices, errors)
    type(deck_type), intent(in) :: deck
    type(curve_type), intent(in) :: curve(:)
    type(dem_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    real(wp) :: factor

    if (deck%count('dynamics') == 0) return
    call curve_index(deck, 'D250', curve, 'dynamics', 1, choices%dt_curve, errors)
    if (choices%dt_curve == 0) return
    call deck%get('dynamics', 1, 'dt_factor', factor)
    if (choices%dt > 0.0_wp) then
      call deck%fault(errors, 'D253', 'a given step does not follow a curve', 'dynamics', 1, &
                      'curve', 'leave dt out, or the curve')
    else if (.not. (minval(curve(choices%dt_curve)%value) > 0.0_wp .and. &
                    factor*maxval(curve(choices%dt_curve)%value) <= 1.0_wp)) then
      call deck%fault(errors, 'D253', 'the curve takes the step to nothing or beyond its limits', &
                      'dynamics', 1, 'curve', 'values above 0, and at most 1 when multiplied '// &
                      'by dt_factor')
    end if
  end subroutine read_step_curve

  !> Fixed grains of the deck; all fixed grains are at rest.
  subroutine hold_grains(deck, packing, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(inout) :: packing
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: rows(:)
    integer(i4) :: k
    do k = 1, deck%count('fixed')
      call named_rows(deck, packing, 'fixed', k, rows, errors)
      packing%kind(rows) = kind_fixed
    end do
    do k = 1, packing%n
      if (packing%kind(k) /= kind_fixed) cycle
      ! what is no number stays, to be named with the other faults of the packing (I210)
      if (.not. all(abs([packing%v(:, k), packing%omega(:, k)]) <= huge(1.0_wp))) cycle
      packing%v(:, k) = 0.0_wp
      packing%omega(:, k) = 0.0_wp
    end do
  end subroutine hold_grains

  !> Driven grains of the deck; a grain is driven once and is not fixed by the deck (D242).
  subroutine drive_grains(deck, packing, choices, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(inout) :: packing
    type(dem_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: rows(:)
    real(wp), allocatable :: v(:), omega(:)
    logical, allocatable :: taken(:), fixed(:)
    integer(i4) :: k, j

    allocate (taken(packing%n), fixed(packing%n), source=.false.)
    do k = 1, deck%count('fixed')
      call named_rows(deck, packing, 'fixed', k, rows, errors)
      if (errors%any()) return
      fixed(rows) = .true.
    end do
    do k = 1, deck%count('driven')
      call named_rows(deck, packing, 'driven', k, rows, errors)
      call deck%get('driven', k, 'velocity', v)
      call deck%get('driven', k, 'spin', omega)
      do j = 1, size(rows)
        if (taken(rows(j)) .or. fixed(rows(j))) then
          call deck%fault(errors, 'D242', 'grain '//str(packing%id(rows(j)))//' is '// &
                          trim(merge('driven twice    ', 'fixed and driven', taken(rows(j)))), &
                          'driven', k, '', 'name each grain in one group')
          return
        end if
        taken(rows(j)) = .true.
        packing%kind(rows(j)) = kind_driven
        packing%v(:, rows(j)) = v
        packing%omega(:, rows(j)) = omega
      end do
    end do
    choices%idle = pack(packing%id, packing%kind == kind_driven .and. .not. taken)
  end subroutine drive_grains

  !> Make the grains; contact laws must cover all that can meet (D233).
  subroutine place_grains(deck, system, packing, choices, material, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(inout) :: system
    type(dem_packing_type), intent(in) :: packing
    type(dem_choices_type), intent(in) :: choices
    integer(i4), intent(in) :: material(3)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: of_grain(:)
    logical, allocatable :: grains(:), walls(:)
    integer(i4) :: a, b

    call materials_of_grains(deck, packing, choices%material, material, of_grain, errors)
    if (errors%any()) return
    allocate (grains(size(system%materials)), walls(size(system%materials)), source=.false.)
    grains(of_grain) = .true.
    grains(choices%of_entering) = .true.
    if (system%planes%n > 0) walls(system%planes%material) = .true.
    if (system%surfaces%n > 0) walls(system%surfaces%material) = .true.
    do a = 1, size(grains)
      do b = 1, size(grains)
        if (grains(a) .and. grains(b) .and. b >= a) then
          call check_pair(deck, system%laws, choices%material, a, b, 'grains', errors)
        else if (grains(a) .and. walls(b) .and. .not. grains(b)) then
          call check_pair(deck, system%laws, choices%material, a, b, 'grains and walls', errors)
        end if
      end do
    end do
    call make_grains(system%grains, system%materials, packing%id, packing%kind, of_grain, &
                     packing%x, packing%quat, packing%axes, packing%v, packing%omega, errors)
    if (errors%any()) return
    call make_shapes(system%grains, system%materials, packing%id, packing%skew, packing%exponent, &
                    errors)
  end subroutine place_grains

  !> Free grains that overlap too much at the start are a fault of the packing (I234).
  subroutine check_initial_overlap(system, choices, path, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_choices_type), intent(in) :: choices
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(dem_contacts_type) :: list
    character(len=:), allocatable :: text
    real(wp) :: ratio
    integer(i4) :: low, found, first, second

    found = 0
    text = ''
    if (system%owner_changed()) then
      do low = 1, system%grains%n, slab_grains
        call system%rank_team%some_contacts(system%grains%id(low), system%grains%id( &
          min(low + slab_grains - 1, system%grains%n)), list)
        call name_overlaps(system, choices, list, found, text, errors)
      end do
    else
      call largest_overlap(system%dem_data_type, ratio, first, second)
      if (ratio <= choices%initial_overlap) return
      call system%contacts(list)
      call name_overlaps(system, choices, list, found, text, errors)
    end if
    if (found == 0) return
    if (found > named) text = text//' and '//str(found - named)//' more pairs'
    call errors%add('I234', 'grains overlap at the start: '//text//' of the smaller grain''s '// &
                    'least semi-axis, more than '//str(100.0_wp*choices%initial_overlap)//' %', &
                    path, 'correct the packing, or raise &limits initial_overlap')
  end subroutine check_initial_overlap

  !> Pairs of free grains of a list that overlap too much; the first ones are named.
  subroutine name_overlaps(system, choices, list, found, text, errors)
    type(dem_system_type), intent(in) :: system
    type(dem_choices_type), intent(in) :: choices
    type(dem_contacts_type), intent(in) :: list
    integer(i4), intent(inout) :: found
    character(len=:), allocatable, intent(inout) :: text
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: pair(:)
    real(wp) :: ratio
    integer(i4) :: k

    do k = 1, list%n
      if (list%ids(1, k) < 0) cycle
      call system%find(list%ids(:, k), pair, errors)
      if (.not. all(moved_by_forces(system%grains%kind(pair)))) cycle
      ratio = list%overlap(k)/minval(system%grains%axes(:, pair))
      if (ratio <= choices%initial_overlap) cycle
      found = found + 1
      if (found > named) cycle
      if (found > 1) text = text//', '
      text = text//str(list%ids(1, k))//' and '//str(list%ids(2, k))//' by '// &
        str(anint(1000.0_wp*ratio)/10.0_wp)//' %'
    end do
  end subroutine name_overlaps

  !> A given step above the stability limit is refused unless the deck allows it (D245).
  subroutine check_step(deck, system, choices, warning, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(dem_choices_type), intent(in) :: choices
    character(len=:), allocatable, intent(out) :: warning
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: mode
    real(wp) :: limit, rayleigh, damped

    warning = ''
    if (.not. choices%dt > 0.0_wp) return
    limit = system%step_limit()
    rayleigh = system%rayleigh_limit()
    mode = 'dynamics'
    if (system%par%mode == mode_relaxation) mode = 'relaxation'
    if (choices%dt > limit .and. .not. choices%allow_unstable) then
      call deck%fault(errors, 'D245', 'the time step '//str(choices%dt)//' s is above the '// &
                      'stability limit '//short(limit)//' s', mode, 1, 'dt', &
                      'take dt below the limit, leave dt out, or set allow_unstable = .true.')
    else if (choices%dt > limit) then
      warning = 'the time step is above the stability limit '//short(limit)// &
        ' s; the deck allows it'
    else if (choices%dt > rayleigh) then
      warning = 'the time step is above the Rayleigh time '//short(rayleigh)// &
        ' s: new contacts may be unstable'
    else
      damped = damped_step(system%dem_data_type, choices%dt/limit)
      if (choices%dt > damped) warning = 'the time step is above '//short(damped)// &
        ' s, which the dashpots of contacts allow for sure: contacts may run away'
    end if
  end subroutine check_step

  !> Four digits are enough for a limit.
  pure function short(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=16) :: buffer
    write (buffer, '(es10.3)') value
    text = trim(adjustl(buffer))
  end function short
end module dem_setup
