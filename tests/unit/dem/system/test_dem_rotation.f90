!> Free rotation: |L| and L in space kept, energy bounded, second order, exact turns of spheres.
program test_dem_rotation
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, test_type
  use dem_state, only: kind_free, kind_driven
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_ellipsoid, only: rotation_of, rotation_between, quaternion_from_rotation, &
    quaternion_product
  use dem_integrate, only: scaled_spin_momentum
  use dem_measure, only: angular_momentum_of
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test

  call omp_set_num_threads(1)
  call check_free_body()
  call check_order()
  call check_constant_spin()
  call test%finish()

contains

  !> One grain with a spin, alone in the world.
  subroutine make_one(s, kind, axes, spin)
    type(dem_system_type), intent(inout) :: s
    integer(i4), intent(in) :: kind
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
    call make_grains(s%grains, s%materials, [1_i8], [kind], [1], zero, q, reshape(axes, [3, 1]), &
                     zero, reshape(spin, [3, 1]), errors)
    call s%init(errors)
    call test%check('one grain made', .not. errors%any())
  end subroutine make_one

  real(wp) function spin_energy(s)
    type(dem_system_type), intent(in) :: s
    spin_energy = 0.5_wp*dot_product(s%grains%omega(:, 1), angular_momentum_of(s%dem_data_type))
  end function spin_energy

  !> Triaxial body, spin near the middle axis (it tumbles), 2e5 steps, several tumbles.
  subroutine check_free_body()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: l(3), energy, worst, turned
    integer :: k
    call make_one(s, kind_free, [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], [100.0_wp, 2.0_wp, -40.0_wp])
    s%par%dt = 1.0e-5_wp
    l = angular_momentum_of(s%dem_data_type)
    energy = spin_energy(s)
    worst = 0.0_wp
    do k = 1, 200
      call s%step(1000, errors)
      worst = larger(worst, abs(spin_energy(s)/energy - 1.0_wp))
    end do
    turned = sqrt(sum(s%grains%theta(:, 1)**2))
    call test%check_close('momentum in space', &
                          sqrt(sum((angular_momentum_of(s%dem_data_type) - l)**2)/sum(l**2)), &
                              0.0_wp, &
                          1.0e-11_wp)
    call test%check_close('energy stays within the step error', worst, 0.0_wp, 1.0e-6_wp)
    call test%check('it did turn', turned > 100.0_wp)
    call test%check_close('unit quaternion', sum(s%grains%quat(:, 1)**2), 1.0_wp, 1.0e-15_wp)
  end subroutine check_free_body

  !> Halving the step divides the error of the orientation by four.
  subroutine check_order()
    real(wp) :: q1(4), q2(4), q4(4), ratio
    q1 = orientation_after(200)
    q2 = orientation_after(400)
    q4 = orientation_after(800)
    ratio = sqrt(sum(rotation_between(q1, q2)**2)/sum(rotation_between(q2, q4)**2))
    call test%check_close('order of rotation', log(ratio)/log(2.0_wp), 2.0_wp, 0.05_wp)
  end subroutine check_order

  function orientation_after(steps) result(q)
    integer(i4), intent(in) :: steps
    real(wp) :: q(4)
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    call make_one(s, kind_free, [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], [100.0_wp, 2.0_wp, -40.0_wp])
    s%par%dt = 0.1_wp/steps
    call s%step(steps, errors)
    q = s%grains%quat(:, 1)
  end function orientation_after

  !> Driven grain: constant spin by exact quaternions; a target rotation follows the shortest path.
  subroutine check_constant_spin()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: q0(4), expected(4), spin(3)
    spin = [3.0_wp, -20.0_wp, 11.0_wp]
    call make_one(s, kind_driven, [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], spin)
    s%par%dt = 1.0e-4_wp
    q0 = s%grains%quat(:, 1)
    call s%step(1000, errors)
    expected = quaternion_product(quaternion_from_rotation(0.1_wp*spin), q0)
    call test%check_close('driven spin', sqrt(sum(rotation_between(expected, s%grains%quat(:, &
                                                  1))**2)), &
                          0.0_wp, 1.0e-12_wp)
    call test%check_all_close('accumulated rotation', &
                          s%grains%theta(:, 1), 0.1_wp*spin, 1.0e-12_wp)
    call s%set_motion([1], reshape([1.0e-3_wp, 0.0_wp, 0.0_wp], [3, 1]), reshape(-q0, [4, 1]), 10)
    call test%check_all_close('shortest way back', s%grains%omega(:, 1) + 100.0_wp*spin, &
                          0.0_wp, 1.0e-9_wp)
    call test%check_all_close('momentum of a sphere', &
                          scaled_spin_momentum(rotation_of(q0), [2.0_wp, 2.0_wp, &
                                                  2.0_wp], &
                          spin), 2.0_wp*spin, 1.0e-13_wp)
  end subroutine check_constant_spin
end program test_dem_rotation
