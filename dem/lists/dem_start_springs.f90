!> Tangential forces that contacts of a packing begin with (manual: files, Packing).
!!
!! A packing at rest is not at rest without them. They are hung on the candidates before the first
!! evaluation, which turns them into the tangent plane, cuts them at the limit of friction and drops
!! those of pairs that do not touch. Fault: I232 and I233 of dem_packing.
module dem_start_springs
  use talus_kinds, only: wp, i4, i8
  use dem_records, only: index_of
  use dem_state, only: dem_data_type, lanes
  implicit none
  private
  public :: start_springs_type, hang_springs, count_springs

  type :: start_springs_type
    integer(i8), allocatable :: ids(:, :)  !! (2, n) of the grains
    real(wp), allocatable :: force(:, :)   !! (3, n) tangential, on the second [N]
    real(wp), allocatable :: load(:)       !! (grains) surcharge, downwards [N]
    integer(i4) :: given = 0               !! of the packing
    integer(i4) :: used = 0                !! of contacts
  end type start_springs_type

contains

  !> The forces of candidates; those of laws with turning points are left out.
  pure subroutine hang_springs(d, springs)
    type(dem_data_type), intent(inout) :: d
    type(start_springs_type), intent(in) :: springs
    integer(i4) :: k, a, b, e, slot, lane, block

    do k = 1, springs%given
      a = index_of(d, real(springs%ids(1, k), wp))
      b = index_of(d, real(springs%ids(2, k), wp))
      if (a == 0 .or. b == 0) cycle
      do e = d%pairs%start(a), d%pairs%start(a + 1) - 1
        slot = d%pairs%entry(e)/2
        lane = 1 + mod(slot, lanes)
        block = 1 + slot/lanes
        associate (first => d%pairs%first(lane, block), second => d%pairs%second(lane, block))
          if (.not. (all([first, second] == [a, b]) .or. all([first, second] == [b, a]))) cycle
          if (.not. d%laws(d%pairs%law_first(block), d%pairs%law_second(block))%base%starts) exit
          d%pairs%history(lane, 1:3, block) = merge(1.0_wp, -1.0_wp, second == b) &
                                              *springs%force(:, k)
        end associate
        exit
      end do
    end do
  end subroutine hang_springs

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
