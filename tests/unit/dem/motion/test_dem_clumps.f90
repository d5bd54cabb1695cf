!> Members of a clump: places, velocities, loads and least effective masses.
program test_dem_clumps
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_clumps, only: ready_clumps, place_members, add_load, set_lightness
  use dem_make, only: allocate_grains
  use dem_state, only: dem_clumps_type, dem_grains_type, body_size
  use talus_test, only: test_type
  implicit none

  integer(i4), parameter :: members = 3
  real(wp), parameter :: inertia(3) = [2.0_wp, 3.0_wp, 4.0_wp], mass = 5.0_wp
  type(dem_clumps_type) :: clumps
  type(dem_grains_type) :: grains
  real(wp) :: body(body_size, members)
  type(test_type) :: test

  call make()
  call judge_motion()
  call judge_loads()
  call judge_lightness()
  call test%finish()

contains

  !> One clump with a turn of a quarter about z.
  subroutine make()
    grains%n = members
    call allocate_grains(grains, .false.)
    clumps%n = 1
    allocate (clumps%grains, clumps%pairs)
    clumps%grains%n = 1
    call allocate_grains(clumps%grains, .false.)
    clumps%first = [1_i4]
    clumps%last = [members]
    allocate (clumps%lightness(members), source=1.0_wp)
    clumps%place = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.0_wp, 0.5_wp, -0.3_wp, &
                            0.7_wp], [3, members])
    clumps%grains%quat(:, 1) = [sqrt(0.5_wp), 0.0_wp, 0.0_wp, sqrt(0.5_wp)]
    clumps%grains%x(:, 1) = [10.0_wp, 20.0_wp, 30.0_wp]
    clumps%grains%v(:, 1) = [1.0_wp, 2.0_wp, 3.0_wp]
    clumps%grains%omega(:, 1) = [0.1_wp, -0.2_wp, 0.3_wp]
    clumps%grains%axes = 1.0_wp
    clumps%grains%mass = mass
    clumps%grains%inertia(:, 1) = inertia
    call ready_clumps(clumps, grains)
    call place_members(clumps, grains, body, 1_i4)
  end subroutine make

  subroutine judge_motion()
    call test%check_close('a member is turned with its clump', &
                          norm2(grains%x(:, 1) - [10.0_wp, 21.0_wp, 30.0_wp]), 0.0_wp, 1.0e-14_wp)
    call test%check_close('another one', norm2(grains%x(:, 2) - [8.0_wp, 20.0_wp, 30.0_wp]), &
                          0.0_wp, 1.0e-14_wp)
    call test%check_close('a member goes with the spin', norm2(grains%v(:, 1) &
      - [0.7_wp, 2.0_wp, 3.1_wp]), 0.0_wp, 1.0e-14_wp)
    call test%check_close('its record, too', norm2(body(4:6, 1) - grains%v(:, 1)), 0.0_wp, &
                          1.0e-14_wp)
    call test%check_close('reach', clumps%pairs%reach(1), 2.0_wp, 1.0e-14_wp)
  end subroutine judge_motion

  !> Loads of members about their own centres add up about that of the clump.
  subroutine judge_loads()
    real(wp) :: moment(3)
    integer(i4) :: i
    moment = 0.0_wp
    do i = 1, members
      grains%force(:, i) = [1.0_wp, -2.0_wp, 0.5_wp]*i
      grains%moment(:, i) = [0.1_wp, 0.2_wp, -0.3_wp]/i
      moment = moment + grains%moment(:, i) + cross(grains%x(:, i) - clumps%grains%x(:, 1), &
                                                    grains%force(:, i))
    end do
    call add_load(clumps, grains, 1_i4)
    call test%check_close('force', norm2(clumps%grains%force(:, 1) - [6.0_wp, -12.0_wp, 3.0_wp]), &
                          0.0_wp, 1.0e-14_wp)
    call test%check_close('moment', norm2(clumps%grains%moment(:, 1) - moment), 0.0_wp, 1.0e-13_wp)
  end subroutine judge_loads

  !> Along no direction is a member lighter than the bound, and along one it is as light.
  subroutine judge_lightness()
    real(wp) :: n(3), lever(3), most
    integer(i4) :: i, k, j
    call set_lightness(clumps)
    do i = 1, members
      most = 0.0_wp
      do k = 0, 400
        do j = 0, 400
          n = [sin(k*0.008_wp)*cos(j*0.016_wp), sin(k*0.008_wp)*sin(j*0.016_wp), cos(k*0.008_wp)]
          lever = cross(clumps%place(:, i), n)
          most = max(most, 1.0_wp + mass*sum(lever**2/inertia))
        end do
      end do
      call test%check_close('least effective mass', clumps%lightness(i), most, 1.0e-3_wp)
      call test%check('it is a bound', clumps%lightness(i) >= most*(1.0_wp - 1.0e-12_wp))
    end do
  end subroutine judge_lightness
end program test_dem_clumps
