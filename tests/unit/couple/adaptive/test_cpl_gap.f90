!> q/p of elements from the stresses of their points: triaxial, sheared, one with nine components,
!! at a surface and in tension.
program test_cpl_gap
  use talus_kinds, only: wp
  use talus_test, only: test_type
  use cpl_gap, only: stress_type, mobilised, six
  implicit none

  real(wp), parameter :: triaxial(6) = [-100.0_wp, -100.0_wp, -220.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  real(wp), parameter :: sheared(6) = [-100.0_wp, -100.0_wp, -100.0_wp, 30.0_wp, 0.0_wp, 40.0_wp]
  real(wp), parameter :: surface(6) = [-0.1_wp, -0.1_wp, -2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  real(wp), parameter :: tension(6) = [50.0_wp, 50.0_wp, 50.0_wp, 9.0_wp, 0.0_wp, 0.0_wp]
  real(wp), parameter :: exact(4) = [120.0_wp/140.0_wp, sqrt(3.0_wp)*0.5_wp, 0.0_wp, 0.0_wp]
  type(test_type) :: test
  type(stress_type) :: points
  integer :: k

  points%element = [2, 1, 1, 3, 4]
  points%weight = [3.0_wp, 1.0_wp, 3.0_wp, 1.0_wp, 1.0_wp]
  allocate (points%stress(6, 5))
  points%stress(:, 1) = sheared
  points%stress(:, 2) = triaxial - [0.0_wp, 0.0_wp, 30.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  points%stress(:, 3) = triaxial + [0.0_wp, 0.0_wp, 10.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  points%stress(:, 4) = surface
  points%stress(:, 5) = tension
  call test%check_all_close('six components', mobilised(points, 4), exact, 1.0e-14_wp)
  call nine()
  call test%check_all_close('nine components', mobilised(points, 4), exact, 1.0e-14_wp)
  call test%finish()

contains

  !> The same with nine components, some of them skew, which do not count alone.
  subroutine nine()
    real(wp), allocatable :: short(:, :)
    call move_alloc(points%stress, short)
    allocate (points%stress(9, size(short, 2)), source=0.0_wp)
    do k = 1, size(short, 2)
      points%stress(six, k) = short(:, k)
      points%stress([4, 8, 3], k) = short(4:, k)
    end do
  end subroutine nine
end program test_cpl_gap
