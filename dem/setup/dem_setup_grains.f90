!> Grains of the packing that groups of the deck name, and the materials of all. Faults D240, D241,
!! D381.
module dem_setup_grains
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use talus_region, only: region_type
  use talus_region_deck, only: read_region
  use dem_make, only: sorted_order
  use dem_packing, only: dem_packing_type, group_index
  use dem_setup_laws, only: material_index
  use dem_state, only: kind_fixed, kind_driven
  implicit none
  private
  public :: named_rows, usual_materials, materials_of_grains

contains

  !> Materials of free, fixed and driven grains.
  subroutine usual_materials(deck, names, material, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)  !! of the materials
    integer(i4), intent(out) :: material(3)
    type(error_list_type), intent(inout) :: errors
    character(len=15), parameter :: keys(3) = [character(len=15) :: &
      'material', 'fixed_material', 'driven_material']
    integer(i4) :: k

    material = 0
    do k = 1, 3
      if (.not. deck%given('particles', 1, trim(keys(k)))) then
        material(k) = material(1)
        cycle
      end if
      call material_index(deck, names, 'particles', 1, trim(keys(k)), material(k), &
                          errors)
    end do
  end subroutine usual_materials

  !> Material of each grain: the usual one of its kind, or that of the last group grains that it
  !! belongs to (D381).
  subroutine materials_of_grains(deck, packing, names, usual, of_grain, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(in) :: packing
    type(string_type), intent(in) :: names(:)  !! of the materials
    integer(i4), intent(in) :: usual(3)        !! of free, fixed, driven grains
    integer(i4), allocatable, intent(out) :: of_grain(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: rows(:)
    integer(i4) :: k, number

    allocate (of_grain(packing%n), source=usual(1))
    where (packing%kind == kind_fixed) of_grain = usual(2)
    where (packing%kind == kind_driven) of_grain = usual(3)
    if (deck%count('grains') > 0 .and. deck%count('window') + deck%count('tile') > 0) then
      call deck%fault(errors, 'D381', 'copies of a tile have one material', 'grains', 1, '', &
                      'take the groups grains out, or the window or tile')
      return
    end if
    do k = 1, deck%count('grains')
      call material_index(deck, names, 'grains', k, 'material', number, errors)
      if (deck%given('grains', k, 'region')) then
        call rows_within(deck, packing, k, rows, errors)
      else
        call named_rows(deck, packing, 'grains', k, rows, errors)
      end if
      of_grain(rows) = number
    end do
  end subroutine materials_of_grains

  !> Rows of the grains whose centres lie in the region of a group grains (D381).
  subroutine rows_within(deck, packing, k, rows, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(in) :: packing
    integer(i4), intent(in) :: k
    integer(i4), allocatable, intent(out) :: rows(:)
    type(error_list_type), intent(inout) :: errors
    type(region_type) :: region
    integer(i4) :: j, before

    before = errors%count
    call read_region(deck, 'grains', k, 'D381', region, errors)
    rows = pack([(j, j=1, packing%n)], [(region%contains(packing%x(:, j)), j=1, packing%n)])
    if (size(rows) == 0 .and. errors%count == before) &
      call deck%fault(errors, 'D381', 'no centre of a grain lies in the region', 'grains', k, &
                      'region', 'check its place and unit: the bed reaches from '// &
                      extreme(packing%x, -1)//' to '//extreme(packing%x, 1)//' m')
  end subroutine rows_within

  !> Least (side -1) or largest coordinates of all centres.
  function extreme(x, side) result(text)
    real(wp), intent(in) :: x(:, :)
    integer(i4), intent(in) :: side
    character(len=:), allocatable :: text
    integer(i4) :: i
    text = ''
    do i = 1, 3
      if (i > 1) text = text//', '
      text = text//short_number(side*maxval(side*x(i, :)))
    end do
  end function extreme

  !> Rows of the packing that a group with the keys group and ids names (D240, D241).
  subroutine named_rows(deck, packing, group, k, rows, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(in) :: packing
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    integer(i4), allocatable, intent(out) :: rows(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    integer(i4), allocatable :: numbers(:)
    character(len=:), allocatable :: name, hint
    integer(i4) :: g, j

    allocate (rows(0))
    if (deck%given(group, k, 'group')) then
      call deck%get(group, k, 'group', name)
      call group_index(packing%group, name, g, hint)
      if (g == 0) then
        call deck%fault(errors, 'D240', "the packing has no group '"//name//"'", group, k, &
                        'group', hint)
        return
      end if
      ids = packing%group(g)%id
    else
      call deck%get(group, k, 'ids', numbers)
      ids = int(numbers, i8)
    end if
    deallocate (rows)
    rows = rows_of(packing%id, ids)
    do j = 1, size(ids)
      if (rows(j) > 0) cycle
      call deck%fault(errors, 'D241', 'the packing has no grain with id '//str(ids(j)), group, k, &
                      'ids', 'ids run from '//str(minval(packing%id))//' to '// &
                      str(maxval(packing%id)))
      rows = rows(:0)
      return
    end do
  end subroutine named_rows

  !> Rows of some ids, 0 for an id that is not known.
  pure function rows_of(known, ids) result(rows)
    integer(i8), intent(in) :: known(:), ids(:)
    integer(i4), allocatable :: rows(:), order(:)
    integer(i4) :: k, low, high, middle

    allocate (rows(size(ids)), source=0)
    order = sorted_order(known)
    do k = 1, size(ids)
      low = 1
      high = size(known)
      do while (low < high)
        middle = (low + high)/2
        if (known(order(middle)) < ids(k)) then
          low = middle + 1
        else
          high = middle
        end if
      end do
      if (known(order(low)) == ids(k)) rows(k) = order(low)
    end do
  end function rows_of
end module dem_setup_grains
