!> The mosaic of a seam: depth of overlaps, the cut against all sets, what stays in any case.
program test_dem_mosaic
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: test_type
  use dem_mosaic, only: lying_type, choose_mosaic, depth_of, square_of
  implicit none
  type(test_type) :: test
  real(wp), parameter :: upright(4) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  type(lying_type) :: lying
  logical, allocatable :: stay(:)
  real(wp) :: overlap, ball(3, 3), long(3, 3), turned(4), tip(3)

  ball = square_of([1.0_wp, 1.0_wp, 1.0_wp], upright)
  call test%check_close('spheres', depth_of([0.0_wp, 1.2_wp, 0.9_wp], ball, ball), 0.25_wp, &
                        1.0e-12_wp)
  turned = [cos(0.3_wp), 0.0_wp, 0.0_wp, sin(0.3_wp)]
  long = square_of([2.0_wp, 1.0_wp, 1.0_wp], turned)
  tip = [cos(0.6_wp), sin(0.6_wp), 0.0_wp]
  call test%check_close('a sphere at the tip of an ellipsoid', depth_of(3.0_wp*tip, long, ball), &
                        0.0_wp, 1.0e-12_wp)

  ! a row of three of the first pack with two of the second between them
  call row_of_five([.false., .false., .false., .false., .false.])
  call choose_mosaic(lying, stay, overlap)
  call test%check('the heavier pack of a row stays', all(stay .eqv. lying%tile == 1))
  call test%check_close('without an overlap', overlap, 0.0_wp, 0.0_wp)
  call row_of_five([.false., .false., .false., .true., .false.])
  call choose_mosaic(lying, stay, overlap)
  call test%check('but for the neighbours of what stays in any case', &
                  all(stay .eqv. [.false., .false., .true., .true., .false.]))
  call test%finish()

contains

  !> Spheres 1, 2, 3 of the first and 4, 5 of the second pack, by place 1 4 2 5 3; the third is
  !! larger.
  subroutine row_of_five(fixed)
    logical, intent(in) :: fixed(5)
    integer(i4), parameter :: place(5) = [1, 3, 5, 2, 4]
    integer(i4) :: k
    lying%n = 5
    lying%id = [(int(k, i8), k=1, 5)]
    lying%tile = [1, 1, 1, 2, 2]
    lying%fixed = fixed
    lying%home = lying%tile == 1
    lying%x = reshape([(real(place(k), wp), 0.0_wp, 0.0_wp, k=1, 5)], [3, 5])
    lying%quat = spread(upright, 2, 5)
    lying%axes = spread(spread(1.0_wp, 1, 3), 2, 5)
    lying%axes(:, 3) = 1.1_wp
  end subroutine row_of_five
end program test_dem_mosaic
