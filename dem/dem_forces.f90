!> Contact forces of all blocks, and their sums per grain in the order of partner ids.
module dem_forces
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_pairs_type, dem_law_type, lanes, history_size, result_size
  use dem_block, only: dem_block_type, gather_geometry, gather_motion
  use dem_gap, only: evaluate_pairs, evaluate_planes, refine_normals, add_curvatures, solve_lane
  use dem_contact, only: contact_block, constants_of
  implicit none
  private
  public :: block_forces, sum_body

contains

  !> Geometry, law and results of one block; h is the time since the last evaluation.
  subroutine block_forces(pairs, laws, k, h)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_law_type), intent(in) :: laws(:, :)
    integer(i4), intent(in) :: k  !! block
    real(wp), intent(in) :: h     !! [s]
    type(dem_block_type) :: block
    logical :: contact

    call gather_geometry(pairs%body, pairs%first(:, k), pairs%second(:, k), block)
    block%nx = pairs%normal(:, 1, k)
    block%ny = pairs%normal(:, 2, k)
    block%nz = pairs%normal(:, 3, k)
    if (k <= pairs%grain_blocks) then
      call evaluate_pairs(block)
      call find_contacts(pairs, block, k)
    else
      call evaluate_planes(block)
      block%ox = block%nx
      block%oy = block%ny
      block%oz = block%nz
    end if
    contact = any(block%gap < 0.0_wp)
    if (.not. contact .and. .not. pairs%touched(k)) then
      pairs%columns(:, k) = 0.0_wp
      return
    end if
    call gather_motion(pairs%body, pairs%first(:, k), pairs%second(:, k), block)
    call add_curvatures(block, k <= pairs%grain_blocks)
    call contact_block(block, constants_of(laws(pairs%law_first(k), pairs%law_second(k))), h, &
                       pairs%m_star(:, k), pairs%weight(:, k), pairs%history(:, :, k), &
                       pairs%columns(:, k))
    pairs%touched(k) = contact
    call put_results(block, pairs%result(:, :, k))
  end subroutine block_forces

  !> Converge the normals of overlapping lanes; a new contact starts from the line of centres, so
  !! that its normal depends on the two bodies alone and not on the history of the list.
  subroutine find_contacts(pairs, block, k)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_block_type), intent(inout) :: block
    integer(i4), intent(in) :: k
    integer(i4) :: lane
    logical :: moved, fresh

    block%ox = block%nx
    block%oy = block%ny
    block%oz = block%nz
    if (.not. any(block%gap <= 0.0_wp)) return
    call refine_normals(block)
    if (any(block%gap <= 0.0_wp .and. pairs%history(:, 12, k) <= 0.0_wp)) then
      fresh = .false.
      do lane = 1, lanes
        if (block%gap(lane) > 0.0_wp .or. pairs%history(lane, 12, k) > 0.0_wp) cycle
        call solve_lane(block, lane, .true.)
        fresh = .true.
      end do
      if (fresh) call evaluate_pairs(block)
    end if
    moved = any(block%nx /= block%ox .or. block%ny /= block%oy .or. block%nz /= block%oz)
    if (.not. moved) return
    pairs%normal(:, 1, k) = block%nx
    pairs%normal(:, 2, k) = block%ny
    pairs%normal(:, 3, k) = block%nz
  end subroutine find_contacts

  !> Lane results to one record a pair.
  pure subroutine put_results(block, result)
    type(dem_block_type), intent(in) :: block
    real(wp), intent(out) :: result(result_size, lanes)
    integer(i4) :: lane
    do lane = 1, lanes
      result(1, lane) = block%f(lane, 1)
      result(2, lane) = block%f(lane, 2)
      result(3, lane) = block%f(lane, 3)
      result(4, lane) = block%f(lane, 4)
      result(5, lane) = block%f(lane, 5)
      result(6, lane) = block%f(lane, 6)
      result(7, lane) = block%f(lane, 7)
      result(8, lane) = block%f(lane, 8)
      result(9, lane) = block%f(lane, 9)
    end do
  end subroutine put_results

  !> Force and moment on a body: its pairs in the order of partner ids.
  pure subroutine sum_body(start, entry, result, body, force, moment)
    integer(i4), intent(in), contiguous :: start(:), entry(:)
    real(wp), intent(in), contiguous :: result(:, :, :)  !! (result_size, lanes, blocks)
    integer(i4), intent(in) :: body
    real(wp), intent(out) :: force(3), moment(3)
    integer(i4) :: e, slot, lane, block

    force = 0.0_wp
    moment = 0.0_wp
    do e = start(body), start(body + 1) - 1
      slot = entry(e)/2
      lane = 1 + mod(slot, lanes)
      block = 1 + slot/lanes
      if (mod(entry(e), 2) == 0) then
        force = force - result(1:3, lane, block)
        moment = moment + result(4:6, lane, block)
      else
        force = force + result(1:3, lane, block)
        moment = moment + result(7:9, lane, block)
      end if
    end do
  end subroutine sum_body
end module dem_forces
