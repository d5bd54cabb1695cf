!> The step that dashpots of contacts allow: below it a rough, damped contact comes to rest, above
!! it runs away, though the limit of its springs is far off; automatic steps keep to it.
program test_dem_damped_limit
  use talus_kinds, only: wp, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_damped_limit, only: damped_step, mode_step
  use dem_law, only: make_linear_law
  use dem_limits, only: gershgorin_step
  use dem_make, only: make_grains, make_planes
  use dem_state, only: kind_free
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: radius = 1.0e-3_wp, stiffness = 1.0e5_wp, overlap = 1.0e-5_wp

  call check_mode()
  call check_contact()
  call check_weak()
  call test%finish()

contains

  !> Roots of z^2 - (2 - c dt - k dt^2) z + 1 - c dt: on the unit circle at the limit, at -1.
  subroutine check_mode()
    real(wp) :: dt, z
    real(wp), parameter :: k = 3.0_wp, c = 5.0_wp
    dt = mode_step(k, c)
    z = -1.0_wp
    call test%check_close('a root of -1', z*z - (2.0_wp - c*dt - k*dt*dt)*z + 1.0_wp - c*dt, &
                          0.0_wp, 1.0e-14_wp)
    call test%check_close('without dashpot 2/omega', mode_step(4.0_wp, 0.0_wp), 1.0_wp, 1.0e-15_wp)
  end subroutine check_mode

  !> A sphere on a rough plane under its weight, slightly perturbed.
  subroutine make_sphere(s, ratio)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: ratio
    type(error_list_type) :: errors
    real(wp) :: zero(3, 1), axes(3, 1), q(4, 1), up(3, 1)

    zero = 0.0_wp
    axes = radius
    q(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    up(:, 1) = [0.0_wp, 0.0_wp, 1.0_wp]
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 1.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws = make_linear_law(stiffness, stiffness, 1.0e9_wp, ratio, ratio)
    call make_grains(s%grains, s%materials, [1_i8], [kind_free], [1], &
                     up*(radius - overlap), q, axes, up*0.0_wp, zero, errors)
    s%grains%v(1, 1) = 1.0e-9_wp
    s%par%gravity = [0.0_wp, 0.0_wp, -stiffness*overlap/s%grains%mass(1)]
    call make_planes(s%planes, zero, up, zero, [1])
    s%par%dt = 1.0e-8_wp
    call s%init(errors)
    call test%check('a sphere', .not. errors%any())
  end subroutine make_sphere

  !> The tangential mode has 7/2 k_t/m and 7/2 c_t/m; where it runs away, and where not.
  subroutine check_contact()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: limit, exact, rate
    real(wp), parameter :: ratio = 0.5_wp

    call make_sphere(s, ratio)
    limit = damped_step(s%dem_data_type, 0.3_wp)
    rate = stiffness/s%grains%mass(1)
    exact = mode_step(3.5_wp*rate, 3.5_wp*2.0_wp*ratio*sqrt(rate))
    call test%check_close('limit of one contact / exact', limit/exact, 1.0_wp, 0.02_wp)
    call test%check('springs alone allow more', gershgorin_step(s%dem_data_type) > 2.0_wp*limit)
    call test%check_close('the same for a fixed step near the limit of springs', &
                          damped_step(s%dem_data_type, 0.9_wp), limit, 1.0e-15_wp*limit)
    call test%check('nothing to check for very small steps', &
                    damped_step(s%dem_data_type, 0.0_wp) >= huge(1.0_wp))
    s%par%dt = 0.97_wp*limit
    call s%step(200, errors)
    call test%check('below it slip comes to rest', slip(s) < 1.0e-12_wp)
    s%grains%v(1, 1) = 1.0e-9_wp
    s%par%dt = 1.05_wp*limit
    call s%step(200, errors)
    call test%check('above it slip runs away', slip(s) > 1.0e-8_wp)
    s%par%dt_factor = 0.7_wp
    call test%check('automatic steps keep off it', &
                    s%automatic_step(0.0_wp) <= 0.95_wp*limit*(1.0_wp + 1.0e-12_wp))
  end subroutine check_contact

  !> Speed of the point of contact along the plane; rolling continues [m/s].
  real(wp) function slip(s)
    type(dem_system_type), intent(in) :: s
    slip = abs(s%grains%v(1, 1) - (radius - 0.5_wp*overlap)*s%grains%omega(2, 1))
  end function slip

  !> Weak dashpots change no step.
  subroutine check_weak()
    type(dem_system_type) :: s
    call make_sphere(s, 0.05_wp)
    call test%check('weak dashpots are left alone', &
                    damped_step(s%dem_data_type, 0.3_wp) >= huge(1.0_wp))
    s%par%dt_factor = 0.7_wp
    call test%check_close('and do not count at 0.7', s%automatic_step(0.0_wp), &
                          0.7_wp*min(s%step_limit(), s%rayleigh_limit()), &
                          0.02_wp*s%automatic_step(0.0_wp))
  end subroutine check_weak
end program test_dem_damped_limit
