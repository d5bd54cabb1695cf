!> Two-body impacts against closed shapes: Hertz time and overlap, restitution, linear law, ledger.
program test_dem_impact
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, max_abs, test_type
  use dem_state, only: kind_free, kind_fixed
  use dem_law, only: make_law, make_linear_law, restitution_of, uncut_restitution_of, &
    damping_ratio_for
  use dem_make, only: make_grains
  use dem_measure, only: momentum_of, angular_momentum_of
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: hertz = sqrt(1.2_wp)  !! oscillator of its laws
  real(wp), parameter :: pi = acos(-1.0_wp)

  call omp_set_num_threads(1)
  call check_restitution_formulas()
  call check_hertz_impact()
  call check_restitution(0.05_wp, 0.8468_wp)
  call check_restitution(0.10_wp, 0.7247_wp)
  call check_restitution(0.30_wp, 0.4231_wp)
  call check_linear_impact()
  call check_ellipsoid_ledger()
  call check_frozen_radius()
  call check_oblique()
  call test%finish()

contains

  !> Two grains on a line along x, a hair apart, the second at rest.
  subroutine make_pair(s, axes, quat1, quat2, offset, speed, law_kind, friction, ratio)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: axes(3), quat1(4), quat2(4), offset(3), speed(3)
    character(len=*), intent(in) :: law_kind
    real(wp), intent(in) :: friction, ratio
    type(error_list_type) :: errors
    real(wp) :: x(3, 2), q(4, 2), a(3, 2), v(3, 2), w(3, 2)

    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    if (law_kind == 'linear') then
      s%laws(1, 1) = make_linear_law(1.0e6_wp, 0.5e6_wp, friction, ratio, 0.0_wp)
    else
      s%laws(1, 1) = make_law(law_kind, s%materials(1), s%materials(1), friction, ratio, ratio)
    end if
    x(:, 1) = 0.0_wp
    x(:, 2) = offset
    q(:, 1) = quat1/sqrt(sum(quat1**2))
    q(:, 2) = quat2/sqrt(sum(quat2**2))
    a(:, 1) = axes
    a(:, 2) = axes
    v(:, 1) = speed
    v(:, 2) = 0.0_wp
    w = 0.0_wp
    call make_grains(s%grains, s%materials, [1_i8, 2_i8], [kind_free, kind_free], [1, 1], x, q, a, &
                     v, w, errors)
    call s%init(errors)
    call test%check('pair made without faults', .not. errors%any())
  end subroutine make_pair

  subroutine check_restitution_formulas()
    call test%check_close('cut restitution, xi 0.05', restitution_of(hertz, 0.05_wp), &
                          0.8468_wp, 5.0e-5_wp)
    call test%check_close('uncut restitution, xi 0.05', &
                          uncut_restitution_of(hertz, 0.05_wp), 0.8417_wp, 5.0e-5_wp)
    call test%check_close('cut restitution, xi 0.30', restitution_of(hertz, 0.30_wp), &
                          0.4231_wp, 5.0e-5_wp)
    call test%check_close('inverse of the law in force', &
                          restitution_of(hertz, &
                                         damping_ratio_for(hertz, 0.6_wp)), 0.6_wp, &
                                             1.0e-12_wp)
    call test%check_close('beyond critical damping', restitution_of(1.0_wp, &
                                                  1.0_wp + 1.0e-7_wp), &
                          restitution_of(1.0_wp, 1.0_wp - 1.0e-7_wp), 1.0e-6_wp)
  end subroutine check_restitution_formulas

  !> t = 2.9433 delta_max/v and delta_max = (15 m* v^2/(16 E* sqrt R))^(2/5).
  subroutine check_hertz_impact()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: radius = 2.0e-3_wp, v = 1.0_wp
    real(wp) :: depth, time, e_star, m, largest, touch
    integer :: k

    call make_pair(s, [radius, radius, radius], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                   [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [2.0_wp*radius*(1.0_wp + 1.0e-12_wp), &
                                                  0.0_wp, 0.0_wp], &
                   [v, 0.0_wp, 0.0_wp], 'hertz_mindlin', 0.5_wp, 0.0_wp)
    e_star = s%laws(1, 1)%e_star
    m = 0.5_wp*s%grains%mass(1)
    depth = (15.0_wp*m*v**2/(16.0_wp*e_star*sqrt(0.5_wp*radius)))**0.4_wp
    time = 2.9432683_wp*depth/v
    s%par%dt = time/2000.0_wp
    largest = 0.0_wp
    touch = 0.0_wp
    do k = 1, 2200
      call s%step(1, errors)
      largest = larger(largest, 2.0_wp*radius - (s%grains%x(1, 2) - s%grains%x(1, 1)))
      if (sum(abs(s%grains%force(:, 1))) > 0.0_wp) touch = touch + s%par%dt
    end do
    call test%check('no fault in impact', .not. errors%any())
    call test%check_close('largest overlap', largest/depth, 1.0_wp, 2.0e-6_wp)
    call test%check_close('contact time', touch/time, 1.0_wp, 1.0e-3_wp)
    call test%check_close('second takes the speed', s%grains%v(1, 2)/v, 1.0_wp, 1.0e-6_wp)
    call s%refresh_ledger()
    call test%check_close('ledger of the elastic impact', s%closure()/(0.5_wp*2.0_wp*m*v**2), &
                          0.0_wp, 1.0e-6_wp)
  end subroutine check_hertz_impact

  subroutine check_restitution(ratio, expected)
    real(wp), intent(in) :: ratio, expected
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: radius = 2.0e-3_wp
    real(wp) :: v

    v = 0.7_wp
    call make_pair(s, [radius, radius, radius], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                   [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [2.0_wp*radius, 0.0_wp, 0.0_wp], &
                   [v, 0.0_wp, 0.0_wp], 'hertz_mindlin', 0.5_wp, ratio)
    s%par%dt = 5.0e-9_wp
    call s%step(6000, errors)
    call test%check_close('restitution at work', (s%grains%v(1, 2) - s%grains%v(1, 1))/v, &
                          expected, &
                          3.0e-4_wp)
    call s%refresh_ledger()
    call test%check_close('ledger of the damped impact', &
                          s%closure()/(0.5_wp*s%grains%mass(1)*v**2), 0.0_wp, 1.0e-5_wp)
  end subroutine check_restitution

  !> Linear spring: contact lasts pi sqrt(m*/k), restitution 1.
  subroutine check_linear_impact()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: radius = 2.0e-3_wp
    real(wp) :: time
    integer :: k, steps

    call make_pair(s, [radius, radius, radius], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                   [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [2.0_wp*radius, 0.0_wp, 0.0_wp], &
                   [1.0_wp, 0.0_wp, 0.0_wp], 'linear', 0.5_wp, 0.0_wp)
    time = pi*sqrt(0.5_wp*s%grains%mass(1)/1.0e6_wp)
    s%par%dt = time/1000.0_wp
    call s%step(10, errors)
    call test%check_close('step limit of a linear pair', s%step_limit(), &
                          2.0_wp/sqrt(2.0_wp*1.5e6_wp/s%grains%mass(1)), 1.0e-6_wp*time)
    steps = 9
    do k = 1, 1100
      call s%step(1, errors)
      if (sum(abs(s%grains%force(:, 1))) > 0.0_wp) steps = steps + 1
    end do
    call test%check_close('linear contact time', steps*s%par%dt/time, 1.0_wp, 2.0e-3_wp)
    call test%check_close('linear restitution', s%grains%v(1, 2), 1.0_wp, 1.0e-5_wp)
  end subroutine check_linear_impact

  !> Ellipsoids out of line: the ledger closes with the curvature work and misses without.
  subroutine check_ellipsoid_ledger()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: p(3), l(3), energy, closure

    call make_pair(s, [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], [0.9_wp, 0.2_wp, 0.3_wp, -0.1_wp], &
                   [0.7_wp, -0.3_wp, 0.4_wp, 0.5_wp], [4.3e-3_wp, -0.5e-3_wp, 0.8e-3_wp], &
                   [20.0_wp, 2.0_wp, 0.0_wp], 'hertz_mindlin', 0.0_wp, 0.0_wp)
    s%par%dt = 5.0e-10_wp
    energy = 0.5_wp*s%grains%mass(1)*sum(s%grains%v(:, 1)**2)
    p = momentum_of(s%dem_data_type)
    l = angular_momentum_of(s%dem_data_type)
    call s%step(80000, errors)
    call s%refresh_ledger()
    closure = s%closure()
    call test%check('ellipsoids have met and parted', s%grains%v(1, 2) > 2.0_wp &
                    .and. s%ledger%elastic_normal <= 0.0_wp)
    call test%check_close('ellipsoid ledger', closure/energy, 0.0_wp, 1.0e-6_wp)
    call test%check('curvature work matters', abs(closure - s%ledger%curvature)/energy > 1.0e-3_wp)
    call test%check_close('momentum', &
                          max_abs(momentum_of(s%dem_data_type) - p)/sqrt(sum(p**2)), &
                          0.0_wp, 1.0e-13_wp)
    l = angular_momentum_of(s%dem_data_type) - l
    call test%check_close('angular momentum', max_abs(l)/sqrt(sum(p**2))/4.0e-3_wp, 0.0_wp, &
                          1.0e-9_wp)
  end subroutine check_ellipsoid_ledger

  !> With the radius of the first touch the normal force is conservative by itself.
  subroutine check_frozen_radius()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: energy

    call make_pair(s, [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], [0.9_wp, 0.2_wp, 0.3_wp, -0.1_wp], &
                   [0.7_wp, -0.3_wp, 0.4_wp, 0.5_wp], [4.3e-3_wp, -0.5e-3_wp, 0.8e-3_wp], &
                   [20.0_wp, 2.0_wp, 0.0_wp], 'hertz_mindlin', 0.0_wp, 0.0_wp)
    s%laws(1, 1)%frozen = .true.
    s%par%dt = 5.0e-10_wp
    energy = 0.5_wp*s%grains%mass(1)*sum(s%grains%v(:, 1)**2)
    call s%step(80000, errors)
    call s%refresh_ledger()
    call test%check('frozen: ellipsoids have met and parted', s%grains%v(1, 2) > 2.0_wp &
                    .and. s%ledger%elastic_normal <= 0.0_wp)
    call test%check_close('frozen: no curvature work', s%ledger%curvature, 0.0_wp, 0.0_wp)
    call test%check_close('frozen: conservative', s%closure()/energy, 0.0_wp, 1.0e-6_wp)
  end subroutine check_frozen_radius

  !> Oblique impact with gross sliding: the tangential impulse is friction times the normal one,
  !! the slip speed decreases from 2 v to 2 v - 7 mu v, v the normal speed.
  subroutine check_oblique()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: radius = 2.0e-3_wp, mu = 0.1_wp, v = 1.0e-3_wp
    real(wp) :: energy, m

    call make_pair(s, [radius, radius, radius], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                   [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [2.0_wp*radius, 0.0_wp, 0.0_wp], &
                   [v, 0.0_wp, 2.0_wp*v], 'hertz_mindlin', mu, 0.0_wp)
    s%par%dt = 1.0e-8_wp
    m = s%grains%mass(1)
    energy = 0.5_wp*m*5.0_wp*v**2
    call s%step(8000, errors)
    call s%refresh_ledger()
    call test%check_close('sliding impulse', s%grains%v(3, 2)/v, mu, 1.0e-3_wp*mu)
    call test%check_close('spin from sliding', s%grains%omega(2, 2)*radius/v, 2.5_wp*mu, &
                          1.0e-3_wp*mu)
    call test%check_close('friction work', s%ledger%friction/energy, &
                          mu*m*v*(2.0_wp*v - 3.5_wp*mu*v)/energy, 1.0e-2_wp*mu)
    call test%check('relaxation is not negative', &
                    s%ledger%tangential_relaxation > -1.0e-7_wp*energy)
    call test%check_close('oblique ledger', s%closure()/energy, 0.0_wp, 1.0e-5_wp)
  end subroutine check_oblique
end program test_dem_impact
