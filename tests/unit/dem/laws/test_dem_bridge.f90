!> Capillary bridges: the pull at touch and far, the energy as its integral, rupture, bounds.
program test_dem_bridge
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_bridge, only: bridge_type, bridge_pull, bridge_energy, bridge_stiffness, &
    rupture_distance, longest_bridge
  implicit none
  real(wp), parameter :: pi = acos(-1.0_wp), radius = 1.0e-3_wp
  type(test_type) :: test
  type(bridge_type) :: bridge
  integer(i4) :: k

  do k = 1, 3
    bridge = bridge_type(0.072_wp, 0.3_wp*(k - 1), 10.0_wp**(-11 - k))
    call check_ends()
    call check_energy()
    call check_bounds()
  end do
  call test%finish()

contains

  !> Willett et al.: 2 pi R gamma cos(theta) at touch and under overlap, and its value at s = 1.
  subroutine check_ends()
    real(wp) :: first, length
    first = 2.0_wp*pi*radius*0.072_wp*cos(bridge%angle)
    length = sqrt(bridge%volume/radius)
    call test%check_close('at touch', bridge_pull(bridge, radius, 0.0_wp)/first, 1.0_wp, 1e-14_wp)
    call test%check_close('overlap', bridge_pull(bridge, radius, -1.0e-5_wp)/first, 1.0_wp, &
                          1e-14_wp)
    call test%check_close('at s = 1', bridge_pull(bridge, radius, length)/first, &
                          1.0_wp/4.55_wp, 1e-14_wp)
  end subroutine check_ends

  !> Slopes by central differences, of second order: 1e-4 of the length, squared.
  subroutine check_energy()
    real(wp) :: length, d, step
    integer(i4) :: j
    length = sqrt(bridge%volume/radius)
    step = 1.0e-4_wp*length
    do j = -2, 20
      d = 0.2_wp*j*length + 0.01_wp*length
      call test%check_close('slope of the energy', (bridge_energy(bridge, radius, d + step) &
        - bridge_energy(bridge, radius, d - step))/(2.0_wp*step) &
        /bridge_pull(bridge, radius, d), 1.0_wp, 1.0e-7_wp)
    end do
    call test%check('none at touch', abs(bridge_energy(bridge, radius, 0.0_wp)) <= 0.0_wp)
    call test%check_close('slope of the pull', (bridge_pull(bridge, radius, 0.0_wp) &
      - bridge_pull(bridge, radius, step))/step/bridge_stiffness(bridge, radius), 1.0_wp, &
      1.0e-3_wp)
  end subroutine check_energy

  !> The rupture distance, and its bound for sharp bodies.
  subroutine check_bounds()
    real(wp) :: width
    integer(i4) :: j
    width = bridge%volume**(1.0_wp/3.0_wp)
    call test%check_close('rupture', rupture_distance(bridge, radius)/((1.0_wp &
      + 0.5_wp*bridge%angle)*(width + 0.1_wp*width**2/radius)), 1.0_wp, 1.0e-14_wp)
    do j = -6, 6
      call test%check('none is longer', rupture_distance(bridge, radius*10.0_wp**j) &
        <= longest_bridge(bridge)*(1.0_wp + 1.0e-14_wp))
    end do
  end subroutine check_bounds
end program test_dem_bridge
