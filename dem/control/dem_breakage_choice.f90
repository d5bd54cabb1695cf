!> Grains that break in a look (theory-dem, Breakage of grains).
module dem_breakage_choice
  use talus_kinds, only: wp, i4, i8
  use dem_make, only: sorted_order
  use dem_state, only: dem_data_type, lanes, history_side
  implicit none
  private
  public :: choose_grains

contains

  !> Grains that break in this look, in the order of stress over strength, then of ids; one that
  !! touches another that breaks waits.
  subroutine choose_grains(d, stress, limit, order)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: stress(:), limit(:)  !! (grains) now, and that they bear [Pa]
    integer(i4), allocatable, intent(out) :: order(:)
    integer(i4), allocatable :: some(:), start(:), partner(:)
    logical :: breaks(d%grains%n)
    integer(i4) :: i, k

    some = pack([(i, i=1, d%grains%n)], stress > limit)
    if (size(some) == 0) then
      order = some
      return
    end if
    ! positive reals are in the order of their bits; equal ones stay in that of their ids
    some = some(sorted_order(-transfer(stress(some)/limit(some), [0_i8])))
    breaks = .false.
    breaks(some) = .true.
    call find_partners(d, breaks, start, partner)
    breaks = .false.
    do k = 1, size(some)
      i = some(k)
      breaks(i) = .not. any(breaks(partner(start(i):start(i + 1) - 1)))
    end do
    order = pack(some, breaks(some))
  end subroutine choose_grains

  !> Marked grains that touch each other: those of grain i from start(i) to start(i + 1) - 1.
  pure subroutine find_partners(d, marked, start, partner)
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: marked(:)
    integer(i4), allocatable, intent(out) :: start(:), partner(:)
    integer(i4) :: round, k, lane, i, j, next(size(marked))

    allocate (start(size(marked) + 1), source=0_i4)
    do round = 1, 2
      next = start(:size(marked))
      do k = 1, d%pairs%grain_blocks
        if (.not. d%pairs%touched(k)) cycle
        do lane = 1, lanes
          if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
          i = d%pairs%grain(d%pairs%first(lane, k))
          j = d%pairs%grain(d%pairs%second(lane, k))
          if (.not. (marked(i) .and. marked(j))) cycle
          if (round == 2) partner([next(i), next(j)]) = [j, i]
          next(i) = next(i) + 1
          next(j) = next(j) + 1
        end do
      end do
      if (round == 2) return
      start(1) = 1
      do k = 1, size(marked)
        start(k + 1) = start(k) + next(k)
      end do
      allocate (partner(start(size(start)) - 1), source=0_i4)
    end do
  end subroutine find_partners
end module dem_breakage_choice
