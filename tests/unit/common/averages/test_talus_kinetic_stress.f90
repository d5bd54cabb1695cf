!> Stress of the motion about a linear field, and the deviatoric stress of known tensors.
program test_talus_kinetic_stress
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: kinetic_stress, deviator_of
  use talus_sample, only: sample_type
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test

  call check_kinetic()
  call check_deviator()
  call test%finish()

contains

  !> Four grains of 2 kg at +-x and +-y that move with v = G x and, apart from it, up and down by w.
  subroutine check_kinetic()
    type(sample_type) :: sample
    real(wp), parameter :: w = 3.0_wp, volume = 5.0_wp
    real(wp) :: gradient(3, 3), wanted(3, 3)
    integer(i4) :: i
    gradient = reshape([0.1_wp, 0.0_wp, 0.2_wp, -0.4_wp, 0.3_wp, 0.0_wp, 0.0_wp, 0.5_wp, 0.0_wp], &
                       [3, 3])
    call sample%make(4, 0)
    sample%mass = 2.0_wp
    sample%x = 0.0_wp
    sample%x(1, 1:2) = [1.0_wp, -1.0_wp]
    sample%x(2, 3:4) = [1.0_wp, -1.0_wp]
    do i = 1, 4
      sample%v(:, i) = matmul(gradient, sample%x(:, i)) + [7.0_wp, 0.0_wp, 0.0_wp]
    end do
    sample%v(3, 1:2) = sample%v(3, 1:2) + w
    sample%v(3, 3:4) = sample%v(3, 3:4) - w
    wanted = 0.0_wp
    wanted(3, 3) = -4.0_wp*2.0_wp*w**2/volume  ! pressure of a gas: tension positive
    call test%check_all_close('stress of the motion', &
                              kinetic_stress(sample, [(.true., i=1, 4)], gradient, volume), &
                              wanted, 1.0e-13_wp)
  end subroutine check_kinetic

  !> Triaxial stress: |s1 - s3|; pure shear: sqrt(3) tau; no part of the mean or of the skew part.
  subroutine check_deviator()
    real(wp) :: t(3, 3)
    t = 0.0_wp
    t(1, 1) = -5.0_wp
    t(2, 2) = -2.0_wp
    t(3, 3) = -2.0_wp
    call test%check_close('triaxial', deviator_of(t), 3.0_wp, 1.0e-14_wp)
    t = 0.0_wp
    t(1, 2) = 2.0_wp
    t(2, 1) = 2.0_wp
    call test%check_close('shear', deviator_of(t), 2.0_wp*sqrt(3.0_wp), 1.0e-14_wp)
    t(2, 1) = -2.0_wp
    call test%check_close('skew', deviator_of(t), 0.0_wp, 1.0e-14_wp)
  end subroutine check_deviator
end program test_talus_kinetic_stress
