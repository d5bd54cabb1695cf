!> Tangential forces that contacts of a packing begin with (manual: files, Packing).
!!
!! A packing at rest is not at rest without them. They are hung on the candidates before the first
!! evaluation, which turns them into the tangent plane, cuts them at the limit of friction and drops
!! those of pairs that do not touch. In a periodic cell two grains may touch over several faces:
!! each force belongs to one image of the second, by its shift or, without one, the nearest.
!! Faults: those of dem_packed_contacts.
module dem_start_springs
  use talus_kinds, only: wp, i4, i8
  use dem_records, only: index_of
  use dem_state, only: dem_data_type, dem_cell_type, lanes
  implicit none
  private
  public :: start_springs_type, hang_springs, count_springs, count_unreachable

  type :: start_springs_type
    integer(i8), allocatable :: ids(:, :)    !! (2, n) of the grains
    real(wp), allocatable :: force(:, :)     !! (3, n) tangential, on the second [N]
    integer(i4), allocatable :: shift(:, :)  !! (3, n) edges from the second to its image that is
                                             !! touched; none given: the nearest image
    real(wp), allocatable :: load(:)         !! (grains) surcharge, downwards [N]
    integer(i4) :: given = 0                 !! of the packing
    integer(i4) :: used = 0                  !! of contacts
  end type start_springs_type

contains

  !> The forces of candidates; those of laws with turning points are left out.
  pure subroutine hang_springs(d, springs)
    type(dem_data_type), intent(inout) :: d
    type(start_springs_type), intent(in) :: springs
    real(wp) :: side
    integer(i4) :: k, a, b, slot, lane, block, shift(3)

    do k = 1, springs%given
      a = index_of(d, real(springs%ids(1, k), wp))
      b = index_of(d, real(springs%ids(2, k), wp))
      if (a == 0 .or. b == 0) cycle
      shift = 0
      if (allocated(springs%shift)) shift = springs%shift(:, k)
      side = merge(1.0_wp, -1.0_wp, a < b)  ! of a pair the lower one is the first
      slot = slot_of(d, min(a, b), max(a, b), nint(side)*shift, .not. allocated(springs%shift))
      if (slot < 0) cycle
      lane = 1 + mod(slot, lanes)
      block = 1 + slot/lanes
      if (.not. d%laws(d%pairs%law_first(block), d%pairs%law_second(block))%base%starts) cycle
      d%pairs%history(lane, 1:3, block) = side*springs%force(:, k)
      d%pairs%touched(block) = .true.
    end do
  end subroutine hang_springs

  !> Slot of the pair of grain a with an image of grain b > a: that of a shift, or the nearest;
  !! -1 if there is none.
  pure integer(i4) function slot_of(d, a, b, shift, nearest) result(slot)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: a, b, shift(3)
    logical, intent(in) :: nearest
    real(wp) :: apart, least
    integer(i4) :: e, at, body, own(3)

    slot = -1
    least = huge(least)
    do e = d%pairs%start(a), d%pairs%start(a + 1) - 1
      if (mod(d%pairs%entry(e), 2) == 1) cycle
      at = d%pairs%entry(e)/2
      body = d%pairs%second(1 + mod(at, lanes), 1 + at/lanes)
      if (d%pairs%grain(body) /= b) cycle
      own = 0
      if (body > d%pairs%plain) own = d%pairs%shift(:, body - d%pairs%plain)
      if (.not. nearest .and. any(own /= shift)) cycle
      apart = norm2(d%pairs%body(1:3, body) - d%pairs%body(1:3, a))
      if (apart >= least) cycle
      least = apart
      slot = at
    end do
  end function slot_of

  !> How many lie over faces that are not periodic in this run: no contact can take them over.
  pure integer(i4) function count_unreachable(springs, cell) result(n)
    type(start_springs_type), intent(in) :: springs
    type(dem_cell_type), intent(in) :: cell
    logical :: open(3)
    integer(i4) :: k
    n = 0
    if (.not. allocated(springs%shift)) return
    open = .not. (cell%active .and. cell%periodic)
    do k = 1, springs%given
      if (any(open .and. springs%shift(:, k) /= 0)) n = n + 1
    end do
  end function count_unreachable

  !> How many of them contacts have taken over; the forces have been evaluated.
  pure integer(i4) function count_springs(d, springs) result(used)
    type(dem_data_type), intent(in) :: d
    type(start_springs_type), intent(in) :: springs
    integer(i4) :: block, lane
    used = 0
    if (springs%given == 0) return
    do block = 1, d%pairs%blocks
      do lane = 1, lanes
        if (any(abs(d%pairs%history(lane, 1:3, block)) > 0.0_wp)) used = used + 1
      end do
    end do
  end function count_springs
end module dem_start_springs
