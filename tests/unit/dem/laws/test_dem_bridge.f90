!> Capillary bridges: the pull at touch and far, the energy as its integral, rupture, bounds; the
!! table against exact profiles between its nodes.
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
    call check_rupture()
    call check_bounds()
    bridge%tabled = .true.
    call check_energy()
    call check_bounds()
  end do
  call check_table(15.0_wp, 3.0e-4_wp, 7.32633400e-2_wp, &
    [0.91765111_wp, 0.71600315_wp, 0.18664808_wp, 0.067778757_wp, 0.034784714_wp])
  call check_table(35.0_wp, 5.0e-6_wp, 2.19844615e-2_wp, &
    [0.80061546_wp, 0.46315662_wp, 0.052092591_wp, 0.017099488_wp, 0.0092446048_wp])
  call check_table(45.0_wp, 2.0e-3_wp, 1.79686285e-1_wp, &
    [0.61941146_wp, 0.53202858_wp, 0.21749572_wp, 0.099785530_wp, 0.061244523_wp])
  call check_table(5.0_wp, 2.0e-5_wp, 2.76894161e-2_wp, &
    [0.97244383_wp, 0.63634243_wp, 0.092300634_wp, 0.029339104_wp, 0.013909176_wp])
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
      if (bridge%tabled .and. d + step > rupture_distance(bridge, radius)) exit
      call test%check_close('slope of the energy', (bridge_energy(bridge, radius, d + step) &
        - bridge_energy(bridge, radius, d - step))/(2.0_wp*step) &
        /bridge_pull(bridge, radius, d), 1.0_wp, 1.0e-7_wp)
    end do
    call test%check('none at touch', abs(bridge_energy(bridge, radius, 0.0_wp)) <= 0.0_wp)
    call test%check_close('from there on', bridge_energy(bridge, radius, 1.0e-4_wp*step) &
      /(1.0e-4_wp*step*bridge_pull(bridge, radius, 0.0_wp)), 1.0_wp, 1.0e-6_wp)
    if (bridge%tabled) return
    d = 0.13_wp*length
    call test%check_close('steepest', (bridge_pull(bridge, radius, d) &
      - bridge_pull(bridge, radius, d + step))/step/bridge_stiffness(bridge, radius), 1.0_wp, &
      1.0e-2_wp)
  end subroutine check_energy

  subroutine check_rupture()
    real(wp) :: width
    width = bridge%volume**(1.0_wp/3.0_wp)
    call test%check_close('rupture', rupture_distance(bridge, radius)/((1.0_wp &
      + 0.5_wp*bridge%angle)*(width + 0.1_wp*width**2/radius)), 1.0_wp, 1.0e-14_wp)
  end subroutine check_rupture

  !> The rupture distance of sharp and of blunt bodies has a bound; the slope of the pull, too.
  subroutine check_bounds()
    real(wp) :: step, d
    integer(i4) :: j
    step = 1.0e-3_wp*rupture_distance(bridge, radius)
    do j = 0, 980
      d = j*step
      call test%check('no steeper', bridge_pull(bridge, radius, d) - bridge_pull(bridge, radius, &
        d + step) <= step*bridge_stiffness(bridge, radius))
    end do
    do j = -6, 6
      call test%check('none is longer', rupture_distance(bridge, radius*10.0_wp**j) &
        <= longest_bridge(bridge)*(1.0_wp + 1.0e-14_wp))
    end do
  end subroutine check_bounds

  !> Largest separation and pulls at 0, 0.05, 0.3, 0.6, 0.9 V^(1/3) of profiles between nodes of the
  !! table. Cubics over angles of 5 degrees, half decades of volume and 20 intervals.
  subroutine check_table(angle, volume, most, pull)
    real(wp), intent(in) :: angle, volume, most, pull(5)  !! [deg], all others over R
    real(wp), parameter :: places(5) = [0.0_wp, 0.05_wp, 0.3_wp, 0.6_wp, 0.9_wp]
    real(wp) :: scale
    integer(i4) :: j
    bridge = bridge_type(0.072_wp, angle*pi/180.0_wp, volume*radius**3, .true.)
    scale = 2.0_wp*pi*radius*0.072_wp
    call test%check_close('largest separation', rupture_distance(bridge, radius)/(radius*most), &
                          1.0_wp, 1.0e-3_wp)
    do j = 1, 5
      call test%check_close('pull of the table', bridge_pull(bridge, radius, &
        places(j)*volume**(1.0_wp/3.0_wp)*radius)/scale, pull(j), 5.0e-4_wp)
      call test%check_close('relative', bridge_pull(bridge, radius, &
        places(j)*volume**(1.0_wp/3.0_wp)*radius)/scale/pull(j), 1.0_wp, 1.0e-2_wp)
    end do
  end subroutine check_table
end program test_dem_bridge
