!> Which entry of the stress tensor and of the velocity gradient a controlled component is.
program test_dem_flow
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_flow, only: stress_in, direction
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: mean_stress = 10
  real(wp) :: sigma(3, 3), gradient(3, 3), wanted
  integer(i4) :: i, j, component

  sigma = reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp, 7.0_wp, 8.0_wp, 12.0_wp], [3, 3])
  component = 0
  do i = 1, 3
    do j = 1, 3
      component = component + 1  ! in the order xx, xy, xz, yx, ...
      wanted = sigma(j, i)       ! traction j on the face whose normal is i, as the rate dv_j/dx_i
      if (i == j) wanted = -wanted
      call test%check_close('stress of a component', stress_in(sigma, component), wanted, 0.0_wp)
      gradient = direction(component)
      call test%check_close('its rate', gradient(i, j), 1.0_wp, 0.0_wp)
      call test%check_close('and no other', sum(abs(gradient)), 1.0_wp, 0.0_wp)
    end do
  end do
  call test%check_close('mean pressure', stress_in(sigma, mean_stress), -6.0_wp, 1.0e-15_wp)
  call test%check_close('rate of volume', sum(direction(mean_stress)), 3.0_wp, 0.0_wp)
  call test%finish()
end program test_dem_flow
