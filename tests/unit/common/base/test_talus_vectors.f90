!> Rotations of orientations: small ones by series, many at once.
program test_talus_vectors
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use talus_vectors, only: turned, turn_all
  implicit none

  type(test_type) :: test

  call one_axis()
  call many(1.0e-4_wp)
  call many(2.0e-3_wp)
  call test%finish()

contains

  !> A turn about z: angles on both sides of where the series ends.
  subroutine one_axis()
    real(wp), parameter :: angles(6) = [1.0e-9_wp, 1.0e-5_wp, 9.9e-4_wp, 1.1e-3_wp, 0.5_wp, 3.0_wp]
    real(wp) :: quat(4), expected(4)
    integer(i4) :: k
    do k = 1, size(angles)
      quat = turned([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, angles(k)])
      expected = [cos(0.5_wp*angles(k)), 0.0_wp, 0.0_wp, sin(0.5_wp*angles(k))]
      call test%check_all_close('about z', quat, expected, 2.3e-16_wp)
      call test%check_close('its sine', quat(4)/expected(4), 1.0_wp, 4.0e-16_wp)
    end do
  end subroutine one_axis

  !> Many after one another: those of one by one.
  subroutine many(size_of)
    real(wp), intent(in) :: size_of  !! rad
    integer(i4), parameter :: n = 37
    real(wp) :: quat(4, n), alone(4, n), rotation(3, n)
    integer(i4) :: k, step
    do k = 1, n
      quat(:, k) = [cos(1.0_wp*k), sin(2.0_wp*k), cos(3.0_wp*k), sin(5.0_wp*k)]
      quat(:, k) = quat(:, k)/norm2(quat(:, k))
      rotation(:, k) = size_of*[sin(1.0_wp*k), cos(4.0_wp*k), sin(3.0_wp*k)]/sqrt(3.0_wp)
    end do
    alone = quat
    do step = 1, 100
      call turn_all(quat, rotation)
      do k = 1, n
        alone(:, k) = turned(alone(:, k), rotation(:, k))
      end do
    end do
    call test%check_all_close('many at once', quat, alone, 1.0e-14_wp)
    call test%check_all_close('unit length', norm2(quat, 1), 1.0_wp, 1.0e-15_wp)
  end subroutine many
end program test_talus_vectors
