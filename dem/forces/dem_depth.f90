!> Overlaps beyond the limit at any evaluation: an impact is over in a dozen steps, so that a look
!! at the last state of a hundred misses it. An evaluation compares gaps with the least overlap that
!! can be too much; what lies beyond is compared with the limit of its pair here.
module dem_depth
  use talus_kinds, only: wp, i4, i8
  use dem_state, only: dem_data_type, lanes, history_side
  implicit none
  private
  public :: watch_depth, note_block, note_touch

contains

  !> Overlaps that may be beyond the limit are noted from now on; `fresh`: forget those of before.
  subroutine watch_depth(d, fresh)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: fresh
    d%pairs%shallow = huge(1.0_wp)
    if (d%grains%n > 0) d%pairs%shallow = d%par%overlap_limit*minval(d%grains%axes)
    if (.not. fresh) return
    d%health%deepest = 0.0_wp
    d%health%deepest_pair = 0
  end subroutine watch_depth

  !> The deepest contact of block k, as largest_overlap counts it.
  subroutine note_block(d, k)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: k
    integer(i8) :: partner
    integer(i4) :: lane, first, second
    real(wp) :: axis

    do lane = 1, lanes
      if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
      first = d%pairs%first(lane, k)
      second = d%pairs%grain(d%pairs%second(lane, k))
      axis = minval(d%grains%axes(:, second))
      if (first <= d%grains%n) then
        axis = min(axis, minval(d%grains%axes(:, first)))
        partner = d%grains%id(first)
      else
        partner = -(first - d%grains%n - 3)
      end if
      call note(d, d%pairs%history(lane, history_side, k)**2/axis, [d%grains%id(second), partner])
    end do
  end subroutine note_block

  !> A contact of a grain with a body of the surfaces.
  subroutine note_touch(d, grain, body, overlap)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: grain, body
    real(wp), intent(in) :: overlap  !! [m]
    call note(d, overlap/minval(d%grains%axes(:, grain)), &
              [d%grains%id(grain), -int(d%planes%n + body, i8)])
  end subroutine note_touch

  !> Keep the largest beyond the limit; of equal ones that of the higher ids, whatever the threads.
  subroutine note(d, ratio, pair)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: ratio
    integer(i8), intent(in) :: pair(2)
    logical :: more
    if (.not. ratio > d%par%overlap_limit) return
    !$omp critical (talus_depth)
    more = ratio > d%health%deepest
    if (.not. (more .or. ratio < d%health%deepest)) then
      more = pair(1) > d%health%deepest_pair(1)
      if (pair(1) == d%health%deepest_pair(1)) more = pair(2) > d%health%deepest_pair(2)
    end if
    if (more) then
      d%health%deepest = ratio
      d%health%deepest_pair = pair
    end if
    !$omp end critical (talus_depth)
  end subroutine note
end module dem_depth
