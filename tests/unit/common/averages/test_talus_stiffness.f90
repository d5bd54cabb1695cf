!> Stiffness as 6 x 6: an isotropic one is found again, a cubic one has the misfit of its formula,
!! and nine rows become six.
program test_talus_stiffness
  use talus_kinds, only: wp, i4
  use talus_stiffness, only: six_by_six, fit_isotropic, fit_type, six_of
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test

  call check_isotropic()
  call check_cubic()
  call check_nine()
  call test%finish()

contains

  !> lambda on the upper block, mu on the diagonal.
  pure function isotropic(lambda, mu) result(c6)
    real(wp), intent(in) :: lambda, mu
    real(wp) :: c6(6, 6)
    integer(i4) :: i
    c6 = 0.0_wp
    c6(:3, :3) = lambda
    do i = 1, 6
      c6(i, i) = c6(i, i) + merge(2.0_wp, 1.0_wp, i <= 3)*mu
    end do
  end function isotropic

  subroutine check_isotropic()
    type(fit_type) :: fit
    fit = fit_isotropic(isotropic(30.0_wp, 20.0_wp))
    call test%check_close('lambda', fit%lambda, 30.0_wp, 1.0e-13_wp)
    call test%check_close('shear modulus', fit%shear, 20.0_wp, 1.0e-13_wp)
    call test%check_close('bulk modulus', fit%bulk, 30.0_wp + 40.0_wp/3.0_wp, 1.0e-13_wp)
    call test%check_close('Young', fit%young, 20.0_wp*130.0_wp/50.0_wp, 1.0e-13_wp)
    call test%check_close('Poisson', fit%poisson, 0.3_wp, 1.0e-15_wp)
    call test%check_close('misfit', fit%misfit, 0.0_wp, 1.0e-15_wp)
    call test%check_close('asymmetry', fit%asymmetry, 0.0_wp, 1.0e-15_wp)
  end subroutine check_isotropic

  !> With 2 mu of the diagonal d more and mu of the shears as it was, G grows by d/5, and what is
  !! left is d sqrt(6/5) in the norm; one skew entry s gives an asymmetry s/sqrt(2) over the norm.
  subroutine check_cubic()
    type(fit_type) :: fit
    real(wp) :: c6(6, 6), norm
    integer(i4) :: i
    real(wp), parameter :: d = 3.0_wp
    c6 = isotropic(30.0_wp, 20.0_wp)
    do i = 1, 3
      c6(i, i) = c6(i, i) + 2.0_wp*d/3.0_wp
      c6(i, 1 + mod(i, 3)) = c6(i, 1 + mod(i, 3)) - d/3.0_wp
      c6(1 + mod(i, 3), i) = c6(1 + mod(i, 3), i) - d/3.0_wp
    end do
    norm = sqrt(3.0_wp*72.0_wp**2 + 6.0_wp*29.0_wp**2 + 3.0_wp*40.0_wp**2)
    fit = fit_isotropic(c6)
    call test%check_close('bulk stays', fit%bulk, 30.0_wp + 40.0_wp/3.0_wp, 1.0e-13_wp)
    call test%check_close('shear', fit%shear, 20.0_wp + d/5.0_wp, 1.0e-13_wp)
    call test%check_close('misfit', fit%misfit, d*sqrt(1.2_wp)/norm, 1.0e-13_wp)
    c6(1, 2) = c6(1, 2) + 1.0e-3_wp
    fit = fit_isotropic(c6)
    call test%check_close('asymmetry', fit%asymmetry, 1.0e-3_wp/sqrt(2.0_wp)/norm, 1.0e-9_wp)
  end subroutine check_cubic

  !> Micropolar isotropic: C_ijkl = la d_ij d_kl + (mu + ka) d_ik d_jl + mu d_il d_jk; its
  !! symmetric part is classical with G = mu + ka/2.
  subroutine check_nine()
    real(wp) :: c9(9, 9), t(3, 3)
    real(wp), parameter :: la = 7.0_wp, mu = 5.0_wp, ka = 4.0_wp
    integer(i4) :: i, j
    c9 = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        c9(4*i - 3, 4*j - 3) = c9(4*i - 3, 4*j - 3) + la
        c9(3*i + j - 3, 3*i + j - 3) = c9(3*i + j - 3, 3*i + j - 3) + mu + ka
        c9(3*i + j - 3, 3*j + i - 3) = c9(3*i + j - 3, 3*j + i - 3) + mu
      end do
    end do
    call test%check_all_close('classical part', six_by_six(c9), &
                          isotropic(la, mu + 0.5_wp*ka), 1.0e-14_wp)
    t = reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp, 7.0_wp, 8.0_wp, 9.0_wp], [3, 3])
    call test%check_all_close('six of nine', six_of(t), [1.0_wp, 5.0_wp, 9.0_wp, 7.0_wp, &
                                                                 5.0_wp, 3.0_wp], 0.0_wp)
  end subroutine check_nine
end program test_talus_stiffness
