!> Increments of sand side by side end where each ends alone in the same sub-steps; lanes that do
!! not yield all the way are refused.
program test_fem_sanisand_lanes
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_sanisand, only: sand_type, at_void, sand_size
  use fem_sanisand_lanes, only: follow_lanes, sand_lanes
  use fem_sanisand_path, only: sand_record_type, follow_strain
  use fem_voigt, only: unit
  implicit none
  type(test_type) :: test
  type(sand_type) :: sand
  real(wp) :: y(sand_size), start(6)
  real(wp), parameter :: shear(6) = [-0.6_wp, -0.4_wp, 1.0_wp, 0.2_wp, -0.1_wp, 0.3_wp]

  sand = sand_type(shear=125.0_wp, ratio=14.0_wp, slope=1.25_wp, extension=0.712_wp, &
                   line_void=0.934_wp, line_slope=0.019_wp, hardening=7.05_wp, &
                   hardening_void=0.968_wp, bounding_rate=1.1_wp, dilatancy=0.704_wp, &
                   dilatancy_rate=3.5_wp, fabric_limit=4.0_wp, fabric_rate=600.0_wp, least=10.0_wp)
  call load_sand(1.0e-2_wp*shear)
  call check_lanes('one way', 2.0e-4_wp*shear, 2.0e-7_wp)
  call check_refused()
  call test%finish()

contains

  !> Sand at 100 kPa after a strain.
  subroutine load_sand(strain)
    real(wp), intent(in) :: strain(6)
    type(sand_record_type) :: record
    real(wp) :: flag
    logical :: good
    y = 0.0_wp
    y(:6) = 1.0e5_wp*unit
    y(at_void) = 0.8_wp
    start = 0.0_wp
    call follow_strain(sand, strain, y, start, record, flag, good)
    call test%check('loaded', good)
  end subroutine load_sand

  subroutine check_lanes(what, strain, part)
    character(len=*), intent(in) :: what
    real(wp), intent(in) :: strain(6)
    real(wp), intent(in) :: part  !! more of a component in each lane
    type(sand_record_type) :: record
    real(wp) :: moved(sand_lanes, 6), end_of(sand_lanes, sand_size), begun(sand_lanes, 6)
    real(wp) :: alone(sand_size), from(6), flag
    logical :: good
    integer(i4) :: k, i

    alone = y
    from = start
    call follow_strain(sand, strain, alone, from, record, flag, good)
    call test%check(what//': several sub-steps', good .and. record%count > 1)
    moved = spread(strain, 1, sand_lanes)
    do k = 1, 6
      moved(k, k) = moved(k, k) + part
    end do
    end_of = spread(y, 1, sand_lanes)
    begun = spread(start, 1, sand_lanes)
    call follow_lanes(sand, moved, end_of, begun, record, good)
    call test%check(what//': good', good)
    record%known = .true.
    do k = 1, sand_lanes
      alone = y
      from = start
      call follow_strain(sand, moved(k, :), alone, from, record, flag, good)
      do i = 1, sand_size
        if (i >= 7 .and. i <= 12) cycle  ! settled by the next increment
        call test%check_close(what, end_of(k, i), alone(i), 1.0e-11_wp*max(abs(alone(i)), 1.0_wp))
      end do
    end do
  end subroutine check_lanes

  !> A strain back leaves the surface, and its record holds an elastic part.
  subroutine check_refused()
    type(sand_record_type) :: record
    real(wp) :: end_of(sand_lanes, sand_size), begun(sand_lanes, 6), alone(sand_size), from(6), flag
    logical :: good
    alone = y
    from = start
    call follow_strain(sand, -1.0e-3_wp*shear, alone, from, record, flag, good)
    call test%check('back: yields after an elastic part', good .and. record%count > 0)
    end_of = spread(y, 1, sand_lanes)
    begun = spread(start, 1, sand_lanes)
    call follow_lanes(sand, spread(-1.0e-3_wp*shear, 1, sand_lanes), end_of, begun, record, good)
    call test%check('back: refused', .not. good)
  end subroutine check_refused
end program test_fem_sanisand_lanes
