!> Distance of points from a triangle with legs of 3 and 4 m: above its face, beside an edge, beyond
!! a corner, in its plane.
program test_dem_surface_search
  use talus_kinds, only: wp
  use talus_test, only: test_type
  use dem_surface_search, only: triangle_distance
  implicit none
  type(test_type) :: test
  real(wp), parameter :: few_roundings = 1.0e-14_wp  !! of lengths of some metres [m]
  real(wp) :: p(3, 3)

  p = 0.0_wp
  p(1, 2) = 3.0_wp
  p(2, 3) = 4.0_wp
  call check('above the face', [1.0_wp, 1.0_wp, 2.5_wp], 2.5_wp)
  call check('below the face', [1.0_wp, 1.0_wp, -2.5_wp], 2.5_wp)
  call check('in the face', [1.0_wp, 1.0_wp, 0.0_wp], 0.0_wp)
  call check('beside an edge', [1.0_wp, -3.0_wp, 4.0_wp], 5.0_wp)
  call check('beside the long edge', [1.5_wp + 4.0_wp, 2.0_wp + 3.0_wp, 0.0_wp], 5.0_wp)
  call check('beyond a corner', [-2.0_wp, -3.0_wp, 6.0_wp], 7.0_wp)
  call test%finish()

contains

  subroutine check(name, x, distance)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: x(3), distance
    call test%check_close(name, triangle_distance(p, x), distance, few_roundings)
  end subroutine check
end program test_dem_surface_search
