!> Records to lanes and back, and the sums of results.
program test_dem_lanes
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_state, only: lanes, body_size, result_size, entries_ahead
  use dem_block, only: dem_side_type, dem_load_type
  use dem_lanes, only: gather_side, gather_spheres, gather_motions, put_loads, finish_puts, &
    put_side, put_motion, take_side, take_motion, sum_results, sum_lanes
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: bodies = 3*lanes + 5
  real(wp) :: body(body_size, bodies)
  type(dem_side_type) :: side
  integer(i4) :: index(lanes), i, k

  do i = 1, bodies
    body(:, i) = [(100.0_wp*i + k, k=1, body_size)]
  end do
  index = [(1 + mod(37*k, bodies), k=1, lanes)]
  call gather_side(body, index, index, 0, side)
  call test%check('centres', all(side%x == transpose(body(1:3, index))))
  call test%check('velocities', all(side%vx == body(4, index)) .and. all(side%vz == body(6, index)))
  call test%check('spins', all(side%wx == body(7, index)) .and. all(side%wz == body(9, index)))
  call test%check('shapes', all([(all(side%s(:, k) == body(9 + k, index)), k=1, 6)]))
  call test%check('volumes', all(side%volume == body(16, index)))
  call check_spheres()
  call check_put()
  call check_take()
  call check_loads()
  call test%finish()

contains

  !> Spheres: motion and one of the shape, the rest of the side untouched.
  subroutine check_spheres()
    type(dem_side_type) :: round
    round%s = -1.0_wp
    round%volume = -1.0_wp
    call gather_spheres(body, index, index, 1, round)
    call test%check('centres of spheres', all(round%x == transpose(body(1:3, index))))
    call test%check('velocities of spheres', all(round%vx == body(4, index)) &
                    .and. all(round%vy == body(5, index)) .and. all(round%vz == body(6, index)))
    call test%check('spins of spheres', all(round%wx == body(7, index)) &
                    .and. all(round%wy == body(8, index)) .and. all(round%wz == body(9, index)))
    call test%check('radii of spheres', all(round%s(:, 1) == body(10, index)))
    call test%check('nothing else', all(round%s(:, 2:) < 0.0_wp) .and. all(round%volume < 0.0_wp))
    round%s = -1.0_wp
    call gather_motions(body, index, index, 1, round)
    call test%check('motions as sides have them', all(round%x == side%x) &
                    .and. all(round%vx == side%vx) .and. all(round%vy == side%vy) &
                    .and. all(round%vz == side%vz) .and. all(round%wx == side%wx) &
                    .and. all(round%wy == side%wy) .and. all(round%wz == side%wz))
    call test%check('motions alone', all(round%s < 0.0_wp))
  end subroutine check_spheres

  !> Back to records that follow each other; what lies behind is left alone.
  subroutine check_put()
    real(wp) :: back(body_size, lanes)
    integer(i4) :: count
    do count = 1, lanes
      back = -1.0_wp
      call put_side(side, count, back)
      if (any(back(:, :count) /= body(:, index(:count)))) exit
      if (any(back(:, count + 1:) > 0.0_wp)) exit
    end do
    call test%check('lanes go back as they came', count > lanes)
    do count = 1, lanes
      back = -1.0_wp
      call put_motion(side, count, back)
      if (any(back(:9, :count) /= body(:9, index(:count)))) exit
      if (any(back(10:, :) > 0.0_wp) .or. any(back(:, count + 1:) > 0.0_wp)) exit
    end do
    call test%check('motion goes back, shapes stay', count > lanes)
  end subroutine check_put

  !> Records that follow each other to lanes: earlier contents are overwritten, beyond `count` too.
  subroutine check_take()
    type(dem_side_type) :: taken
    real(wp) :: row(body_size, lanes)
    integer(i4) :: count
    do count = 1, lanes
      taken = side
      call take_side(body, count, taken)
      row = lanes_of(taken)
      if (any(row(:, :count) /= body(:, :count))) exit
      if (any(abs(row(:, count + 1:)) > 0.0_wp)) exit
    end do
    call test%check('records to lanes', count > lanes)
    do count = 1, lanes
      taken = side
      call take_motion(body, count, taken)
      row = lanes_of(taken)
      if (any(row(:9, :count) /= body(:9, :count))) exit
      if (any(abs(row(:9, count + 1:)) > 0.0_wp) .or. any(row(10:, :) /= body(10:, index))) exit
    end do
    call test%check('motion to lanes, shapes stay', count > lanes)
  end subroutine check_take

  !> A side as records.
  function lanes_of(from) result(row)
    type(dem_side_type), intent(in) :: from
    real(wp) :: row(body_size, lanes)
    call put_side(from, lanes, row)
  end function lanes_of

  !> A load acts on B as it is and on A reversed, summed in the order of entries.
  subroutine check_loads()
    type(dem_load_type) :: load
    real(wp) :: result(result_size, lanes), total(result_size), centre(lanes, 3)
    real(wp) :: force(lanes, 3), moment(lanes, 3)
    integer(i4) :: entry(3 + entries_ahead)
    load%fx = [(1.0_wp*k, k=1, lanes)]
    load%fy = 2.0_wp*load%fx
    load%fz = 3.0_wp*load%fx
    load%mx = 4.0_wp*load%fx
    load%my = 5.0_wp*load%fx
    load%mz = 6.0_wp*load%fx
    call put_loads(load, 0, result)
    call test%check('loads', all([(all(result(k, :) == k*load%fx), k=1, 6)]))
    call test%check('spare reals are zero', all(abs(result(7:, :)) <= 0.0_wp))
    entry = 0
    entry(:3) = [2*(3 - 1) + 1, 2*(7 - 1), 2*(lanes - 1) + 1]
    call sum_results(result, entry, 1, 3, total)
    call test%check_close('sum of a body', total(2), 2.0_wp*(3.0_wp - 7.0_wp + lanes), 0.0_wp)
    centre = 0.0_wp
    centre(2, :) = [1.0_wp, -2.0_wp, 0.5_wp]
    call sum_lanes(result, entry, [1, 1, 4], 2, centre, force, moment)
    call test%check('lane without pairs', all(abs([force(1, :), moment(1, :)]) <= 0.0_wp))
    call test%check_all_close('lane: force', force(2, :), total(:3), 0.0_wp)
    call test%check_all_close('lane: moment about the centre', moment(2, :) - total(4:6) &
                          + [-2.0_wp*total(3) - 0.5_wp*total(2), 0.5_wp*total(1) - total(3), &
                             total(2) + 2.0_wp*total(1)], 0.0_wp, 1.0e-12_wp)
    call sum_results(result, entry, 2, 1, total)
    call check_past(load, result)
    call test%check('sum of none', all(abs(total) <= 0.0_wp))
  end subroutine check_loads

  !> Streaming stores as stores through the caches, on a line of the cache and beside one.
  subroutine check_past(load, result)
    type(dem_load_type), intent(in) :: load
    real(wp), intent(in) :: result(result_size, lanes)
    real(wp), allocatable :: far(:)
    integer(i4) :: shift
    allocate (far(10000), source=-1.0_wp)
    do shift = 0, 1
      call put_loads(load, 1, far(1 + shift))
      call finish_puts()
      call test%check('loads past the caches', &
                      all(abs(far(1 + shift:size(result) + shift) - pack(result, .true.)) &
                          <= 0.0_wp))
    end do
  end subroutine check_past
end program test_dem_lanes
