!> A region from a group of a deck with the keys region, lower, upper, base, axis, centre, radius
!! and length.
module talus_region_deck
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_region, only: region_type, region_all, region_box, region_cylinder, region_sphere
  implicit none
  private
  public :: read_region

contains

  !> Region of the k-th group of this name; a box without volume and an axis without length are
  !! faults (code).
  subroutine read_region(deck, group, k, code, region, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group, code
    integer(i4), intent(in) :: k
    type(region_type), intent(inout) :: region
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kind

    call deck%get(group, k, 'region', kind)
    region%kind = region_all
    if (kind == 'box') then
      region%kind = region_box
      call get_three(deck, group, k, 'lower', region%lower)
      call get_three(deck, group, k, 'upper', region%upper)
      if (.not. all(region%upper > region%lower)) &
        call deck%fault(errors, code, 'the box has no volume', group, k, 'upper', &
                        'upper must be above lower in x, y and z')
    else if (kind == 'cylinder') then
      region%kind = region_cylinder
      call get_three(deck, group, k, 'base', region%base)
      call get_three(deck, group, k, 'axis', region%axis)
      call deck%get(group, k, 'radius', region%radius)
      call deck%get(group, k, 'length', region%length)
      if (.not. norm2(region%axis) > 0.0_wp) then
        call deck%fault(errors, code, 'the axis has no length', group, k, 'axis', &
                        'give a direction, for example 0.0, 0.0, 1.0')
        return
      end if
      region%axis = region%axis/norm2(region%axis)
    else if (kind == 'sphere') then
      region%kind = region_sphere
      call get_three(deck, group, k, 'centre', region%base)
      call deck%get(group, k, 'radius', region%radius)
    end if
  end subroutine read_region

  subroutine get_three(deck, group, k, key, value)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: value(3)
    real(wp), allocatable :: list(:)
    call deck%get(group, k, key, list)
    value = list
  end subroutine get_three
end module talus_region_deck
