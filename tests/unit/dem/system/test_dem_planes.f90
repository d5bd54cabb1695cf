!> Grains on planes: restitution, weight at rest, sliding to rolling, a plane that moves.
program test_dem_planes
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_state, only: kind_free
  use dem_law, only: make_law, restitution_of
  use dem_make, only: make_grains, make_planes
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: hertz = sqrt(1.2_wp)  !! oscillator of its laws

  call omp_set_num_threads(1)
  call check_bounce()
  call check_rest()
  call check_rolling()
  call check_moving_plane()
  call test%finish()

contains

  !> One grain above the plane z = 0.
  subroutine make_drop(s, axes, height, speed, friction, ratio, plane_speed)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: axes(3), height, speed(3), friction, ratio, plane_speed
    type(error_list_type) :: errors
    real(wp) :: q(4, 1), zero(3, 1), up(3, 1)
    allocate (s%materials(2), s%laws(2, 2))
    s%materials(1)%young = 29.0e6_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%materials(2) = s%materials(1)
    s%materials(2)%young = 210.0e9_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), friction, &
                            ratio, ratio)
    s%laws(1, 2) = make_law('hertz_mindlin', s%materials(1), s%materials(2), friction, &
                            ratio, ratio)
    s%laws(2, 1) = make_law('hertz_mindlin', s%materials(2), s%materials(1), friction, &
                            ratio, ratio)
    s%laws(2, 2) = s%laws(1, 1)
    q(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    zero = 0.0_wp
    up = 0.0_wp
    up(3, 1) = 2.0_wp
    call make_grains(s%grains, s%materials, [7_i8], [kind_free], [1], &
                     reshape([0.0_wp, 0.0_wp, height], [3, 1]), q, reshape(axes, [3, 1]), &
                     reshape(speed, [3, 1]), zero, errors)
    call make_planes(s%planes, zero, up, 0.5_wp*plane_speed*up, [2])
    call s%init(errors)
    call test%check('grain above a plane', .not. errors%any())
  end subroutine make_drop

  !> Restitution on a plane of another material is that of the formula; momentum from impulse.
  subroutine check_bounce()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: r = 2.0e-3_wp
    call make_drop(s, [r, r, r], r, [0.0_wp, 0.0_wp, -0.3_wp], 0.5_wp, 0.1_wp, 0.0_wp)
    s%par%dt = 1.0e-7_wp
    call s%step(5000, errors)
    call test%check_close('restitution on a plane', s%grains%v(3, 1)/0.3_wp, &
                          restitution_of(hertz, 0.1_wp), 3.0e-4_wp)
    call test%check_close('impulse on the plane', -s%planes%impulse(3, 1), &
                          s%grains%mass(1)*(s%grains%v(3, 1) + 0.3_wp), 1.0e-15_wp)
    call s%refresh_ledger()
    call test%check_close('ledger of the bounce', s%closure()/s%ledger%start, 0.0_wp, 1.0e-5_wp)
  end subroutine check_bounce

  !> An ellipsoid on its flat side comes to rest and weighs what it weighs; overlap of Hertz with
  !! R_e from the mean curvature (c/a^2 + c/b^2)/2.
  subroutine check_rest()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: weight, overlap, radius
    real(wp), parameter :: a = 2.5e-3_wp, b = 2.0e-3_wp, c = 1.5e-3_wp
    call make_drop(s, [a, b, c], c, [0.0_wp, 0.0_wp, 0.0_wp], 0.5_wp, 0.3_wp, 0.0_wp)
    s%par%gravity = [0.0_wp, 0.0_wp, -9.81_wp]
    s%par%dt = 2.0e-6_wp
    s%par%damping = 300.0_wp
    call s%step(60000, errors)
    weight = 9.81_wp*s%grains%mass(1)
    radius = 2.0_wp/(c/a**2 + c/b**2)
    overlap = (0.75_wp*weight/(s%laws(1, 2)%e_star*sqrt(radius)))**(2.0_wp/3.0_wp)
    call test%check_close('weight on the plane', -s%planes%force(3, 1)/weight, 1.0_wp, 1.0e-9_wp)
    call test%check_close('overlap at rest', (c - s%grains%x(3, 1))/overlap, 1.0_wp, 1.0e-7_wp)
  end subroutine check_rest

  !> A sliding sphere ends rolling with 5/7 of its speed.
  subroutine check_rolling()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: r = 2.0e-3_wp, v = 0.1_wp
    real(wp) :: height
    call make_drop(s, [r, r, r], r, [0.0_wp, 0.0_wp, 0.0_wp], 0.5_wp, 0.3_wp, 0.0_wp)
    height = (0.75_wp*9.81_wp*s%grains%mass(1)/(s%laws(1, 2)%e_star*sqrt(r)))**(2.0_wp/3.0_wp)
    call make_drop_again(s, r - height, v)
    s%par%gravity = [0.0_wp, 0.0_wp, -9.81_wp]
    s%par%dt = 2.0e-6_wp
    call s%step(20000, errors)
    call test%check_close('sliding ends in rolling', s%grains%v(1, 1)/v, 5.0_wp/7.0_wp, 2.0e-3_wp)
    call test%check_close('rolling without slip', s%grains%omega(2, 1)*r/s%grains%v(1, 1), 1.0_wp, &
                          5.0e-3_wp)
    call s%refresh_ledger()
    call test%check_close('slip took 2/7 of the energy', s%ledger%friction/s%ledger%start, &
                          2.0_wp/7.0_wp, 5.0e-3_wp)
    call test%check_close('ledger of rolling', s%closure()/s%ledger%start, 0.0_wp, 1.0e-4_wp)
  end subroutine check_rolling

  !> The same grain again, at rest height and with another speed.
  subroutine make_drop_again(s, height, v)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: height, v
    type(error_list_type) :: errors
    s%grains%x(3, 1) = height
    s%grains%v(1, 1) = v
    call s%init(errors)
    call test%check('made again', .not. errors%any())
  end subroutine make_drop_again

  !> A plane that rises with 0.2 m/s throws an elastic grain off with twice that.
  subroutine check_moving_plane()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: r = 2.0e-3_wp
    call make_drop(s, [r, r, r], 1.01_wp*r, [0.0_wp, 0.0_wp, 0.0_wp], 0.5_wp, 0.0_wp, 0.2_wp)
    s%par%dt = 1.0e-7_wp
    call s%step(6000, errors)
    call test%check_close('thrown off', s%grains%v(3, 1), 0.4_wp, 1.0e-5_wp)
    call test%check_close('work of the plane', s%planes%work(1), &
                          0.5_wp*s%grains%mass(1)*0.16_wp, 1.0e-5_wp*s%grains%mass(1)*0.16_wp)
    call s%refresh_ledger()
    call test%check_close('ledger with a moving plane', s%closure()/s%ledger%boundary, 0.0_wp, &
                          1.0e-5_wp)
  end subroutine check_moving_plane
end program test_dem_planes
