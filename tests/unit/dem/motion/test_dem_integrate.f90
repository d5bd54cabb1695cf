!> One grain by itself: orientation of a sphere against the exact turn, ledger of a damped fall.
program test_dem_integrate
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_state, only: kind_free
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_ellipsoid, only: rotation_between, quaternion_from_rotation, quaternion_product
  use dem_ledger, only: start_ledger, refresh_stored, closure_of, turnover_of
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test

  call omp_set_num_threads(1)
  call check_sphere()
  call check_damped_fall([2.0e-3_wp, 2.0e-3_wp, 2.0e-3_wp], 1.0e-11_wp, 'sphere')
  call check_damped_fall([2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], 1.0e-8_wp, 'ellipsoid')
  call test%finish()

contains

  !> One free grain with a spin and an oblique orientation.
  subroutine make_one(s, axes, spin)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: axes(3), spin(3)
    type(error_list_type) :: errors
    real(wp) :: q(4, 1), zero(3, 1)
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, &
                            0.0_wp)
    q(:, 1) = [0.5_wp, -0.5_wp, 0.1_wp, 0.7_wp]
    q = q/sqrt(sum(q**2))
    zero = 0.0_wp
    call make_grains(s%grains, s%materials, [1_i8], [kind_free], [1], zero, q, &
                     reshape(axes, [3, 1]), zero, reshape(spin, [3, 1]), errors)
    call s%init(errors)
    call test%check('one grain made', .not. errors%any())
  end subroutine make_one

  !> The turn of a step has the Cayley angle 2 atan(w dt/2): (w dt)^3/12 a step is lost.
  subroutine check_sphere()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: spin(3) = [3.0_wp, -20.0_wp, 11.0_wp], dt = 1.0e-4_wp
    integer, parameter :: steps = 1000
    real(wp) :: q0(4), expected(4), off(3)
    call make_one(s, [2.0e-3_wp, 2.0e-3_wp, 2.0e-3_wp], spin)
    s%par%dt = dt
    q0 = s%grains%quat(:, 1)
    call s%step(steps, errors)
    expected = quaternion_product(quaternion_from_rotation(steps*dt*spin), q0)
    off = rotation_between(expected, s%grains%quat(:, 1))
    call test%check_all_close('a free sphere turns about its spin', off, 0.0_wp, &
                              1.01_wp*steps*(dt*norm2(spin))**3/12.0_wp)
    call test%check_all_close('its spin stays', s%grains%omega(:, 1), spin, 1.0e-12_wp)
  end subroutine check_sphere

  !> Works of gravity and background damping are the energy gained: to round-off without a
  !! gyroscopic
  !! term; the splitting of free rotations keeps energy to (w dt)^2 of the energy of rotation, 1e-5,
  !! which is 1e-3 of what is turned over here.
  subroutine check_damped_fall(axes, limit, name)
    real(wp), intent(in) :: axes(3), limit
    character(len=*), intent(in) :: name
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    call make_one(s, axes, [30.0_wp, -20.0_wp, 10.0_wp])
    s%par%dt = 1.0e-4_wp
    s%par%damping = 40.0_wp
    s%par%gravity = [0.0_wp, 3.0_wp, -9.81_wp]
    call start_ledger(s%dem_data_type, s%par%dt)
    call s%step(2000, errors)
    call refresh_stored(s%dem_data_type, s%par%dt, s%ledger)
    call test%check(name//' is damped', s%ledger%background_damping > 0.1_wp*s%ledger%gravity)
    call test%check_close(name//': works and energy', closure_of(s%ledger) &
                          /turnover_of(s%ledger), 0.0_wp, limit)
  end subroutine check_damped_fall
end program test_dem_integrate
