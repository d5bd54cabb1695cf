!> Groups heat, heat_material and temperature. Faults D392, D393, D394.
module dem_setup_heat
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_suggest, only: did_you_mean
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_heat, only: begin_heat, heat_content, heat_limit
  use dem_packing, only: dem_group_type, group_index
  use dem_records, only: index_of
  use dem_setup_laws, only: material_index
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: read_heat, check_heat_step

  !> What changes the number of grains, or their sizes.
  character(len=8), parameter :: others(4) = [character(len=8) :: 'source', 'sink', 'window', &
    'breakage']

contains

  !> Materials, what is held at a temperature, and where heat cannot be followed (D393).
  subroutine read_heat(deck, walls, materials, groups, d, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: walls(:), materials(:)  !! names
    type(dem_group_type), intent(in) :: groups(:)            !! of the packing
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: start
    integer(i4) :: k, m
    if (errors%any()) return
    if (deck%count('heat') == 0) then
      if (deck%count('temperature') + deck%count('heat_material') > 0) &
        call deck%fault(errors, 'D392', 'the deck has temperatures or thermal constants, and '// &
                        'no &heat', trim(merge('temperature  ', 'heat_material', &
                        deck%count('temperature') > 0)), 1, '', 'add &heat start = 293.0 /')
      return
    end if
    call deck%get('heat', 1, 'start', start)
    call begin_heat(d, start)
    do k = 1, size(others)
      if (deck%count(trim(others(k))) > 0) &
        call deck%fault(errors, 'D393', 'heat is not followed where grains enter, leave or '// &
                        'break (&'//trim(others(k))//')', 'heat', 1, '', 'leave one of both out')
    end do
    do k = 1, deck%count('heat_material')
      call material_index(deck, materials, 'heat_material', k, 'material', m, errors)
      if (errors%any()) return
      call deck%get('heat_material', k, 'conductivity', d%heat%conductivity(m))
      call deck%get('heat_material', k, 'capacity', d%heat%capacity(m))
    end do
    do k = 1, deck%count('temperature')
      call read_temperature(deck, k, walls, groups, d, errors)
    end do
    if (.not. errors%any()) call check_materials(deck, materials, d, errors)
    d%heat%start = heat_content(d)
  end subroutine read_heat

  !> One group temperature: a wall, a surface or grains.
  subroutine read_temperature(deck, k, walls, groups, d, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: walls(:)
    type(dem_group_type), intent(in) :: groups(:)
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp) :: value
    logical :: hold
    integer(i4) :: b
    call deck%get('temperature', k, 'value', value)
    call deck%get('temperature', k, 'hold', hold)
    b = d%heat%boundaries + 1
    if (deck%given('temperature', k, 'wall')) then
      call set_boundary(deck, k, 'wall', walls, b, d%heat%plane, errors)
      call deck%get('temperature', k, 'wall', name)
    else if (deck%given('temperature', k, 'surface')) then
      if (d%surfaces%n > 0) then
        call set_boundary(deck, k, 'surface', d%surfaces%name, b, d%heat%body, errors)
      else
        call deck%fault(errors, 'D392', 'the deck has no surface', 'temperature', k, 'surface', &
                        'name a wall or grains')
      end if
      call deck%get('temperature', k, 'surface', name)
    else
      name = 'grains_'//str(k)
      call set_grains(deck, k, groups, value, merge(b, 0_i4, hold), d, errors)
      if (.not. hold) return
    end if
    d%heat%boundaries = b
    call append_string(d%heat%name, name)
    d%heat%value = [d%heat%value, value]
    d%heat%given = [d%heat%given, 0.0_wp]
  end subroutine read_temperature

  !> A wall or surface becomes boundary b.
  subroutine set_boundary(deck, k, key, names, b, boundary, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, b
    character(len=*), intent(in) :: key
    type(string_type), intent(in) :: names(:)
    integer(i4), intent(inout) :: boundary(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: j
    call deck%get('temperature', k, key, name)
    do j = 1, size(names)
      if (names(j)%s /= name) cycle
      if (boundary(j) > 0) call deck%fault(errors, 'D392', key//" '"//name//"' has two "// &
                                           'temperatures', 'temperature', k, key, 'give one')
      boundary(j) = b
      return
    end do
    call deck%fault(errors, 'D392', 'there is no '//key//" '"//name//"'", 'temperature', k, key, &
                    did_you_mean(name, names, key//'s of this deck:'))
  end subroutine set_boundary

  !> Grains of a group or of some ids have a temperature from the start, and keep it if they are
  !! held by boundary b (D240, D241, D392).
  subroutine set_grains(deck, k, groups, value, b, d, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, b
    type(dem_group_type), intent(in) :: groups(:)
    real(wp), intent(in) :: value
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    integer(i4), allocatable :: numbers(:)
    character(len=:), allocatable :: name, hint
    integer(i4) :: g, j, i
    if (deck%given('temperature', k, 'group')) then
      call deck%get('temperature', k, 'group', name)
      call group_index(groups, name, g, hint)
      if (g == 0) then
        call deck%fault(errors, 'D240', "the packing has no group '"//name//"'", 'temperature', k, &
                        'group', hint)
        return
      end if
      ids = groups(g)%id
    else
      call deck%get('temperature', k, 'ids', numbers)
      ids = int(numbers, i8)
    end if
    do j = 1, size(ids)
      i = index_of(d, real(ids(j), wp))
      if (i < 1 .or. i > d%grains%n) then
        call deck%fault(errors, 'D241', 'the packing has no grain with id '//str(ids(j)), &
                        'temperature', k, 'ids', 'ids are those of the packing')
        return
      end if
      if (d%heat%held(i) > 0) call deck%fault(errors, 'D392', 'grain '//str(ids(j))//' has two '// &
        'temperatures', 'temperature', k, '', 'give one')
      d%heat%temperature(i) = value
      d%heat%held(i) = b
    end do
  end subroutine set_grains

  !> Every material of grains, and of what is held at a temperature, conducts (D392).
  subroutine check_materials(deck, materials, d, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: materials(:)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    logical :: needed(size(materials))
    integer(i4) :: k
    needed = .false.
    needed(d%grains%material) = .true.
    do k = 1, d%planes%n
      if (d%heat%plane(k) > 0) needed(d%planes%material(k)) = .true.
    end do
    do k = 1, d%surfaces%n
      if (d%heat%body(k) > 0) needed(d%surfaces%material(d%surfaces%first_part(k): &
        d%surfaces%first_part(k + 1) - 1)) = .true.
    end do
    do k = 1, size(materials)
      if (needed(k) .and. .not. d%heat%conductivity(k) > 0.0_wp) &
        call deck%fault(errors, 'D392', "material '"//materials(k)%s//"' has no conductivity", &
                        'heat', 1, '', "add &heat_material material = '"//materials(k)%s//"' ... /")
    end do
  end subroutine check_materials

  !> A step above the limit of conduction overshoots (D394).
  subroutine check_heat_step(deck, d, dt, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: dt  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: limit
    if (.not. d%heat%active) return
    limit = heat_limit(d)
    if (dt <= limit) return
    call deck%fault(errors, 'D394', 'the time step '//str(dt)//' s is above the limit of heat '// &
                    'conduction, '//str(limit)//' s', 'heat', 1, '', &
                    'take a smaller dt, a larger capacity or a smaller conductivity')
  end subroutine check_heat_step
end module dem_setup_heat
