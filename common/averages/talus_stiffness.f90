!> Stiffness of a pack as a 6 x 6 matrix, and the isotropic solid nearest to it.
!!
!! Order xx yy zz yz zx xy; sigma = C eps with eps_4 = 2 eps_yz and so on.
module talus_stiffness
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: six_by_six, fit_isotropic, fit_type, six_of, pairs_of_six

  integer(i4), parameter :: pairs_of_six(2, 6) = reshape([1, 1, 2, 2, 3, 3, 2, 3, 3, 1, 1, 2], &
                                                         [2, 6])
  real(wp), parameter :: root2 = sqrt(2.0_wp)

  !> The isotropic part (least squares over all components of the tensor).
  type :: fit_type
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp     !! [Pa]
    real(wp) :: lambda = 0.0_wp, young = 0.0_wp   !! [Pa]
    real(wp) :: poisson = 0.0_wp                  !! [-]
    real(wp) :: misfit = 0.0_wp     !! norm of what is not isotropic over that of all [-]
    real(wp) :: asymmetry = 0.0_wp  !! norm of the skew part over that of all [-]
  end type fit_type

contains

  !> Components of the symmetric part of a tensor, without factor 2.
  pure function six_of(t) result(row)
    real(wp), intent(in) :: t(3, 3)
    real(wp) :: row(6)
    integer(i4) :: k
    do k = 1, 6
      row(k) = 0.5_wp*(t(pairs_of_six(1, k), pairs_of_six(2, k)) &
                       + t(pairs_of_six(2, k), pairs_of_six(1, k)))
    end do
  end function six_of

  !> From 9 x 9 (rows xx xy xz yx ...) to 6 x 6, stress and strain made symmetric.
  pure function six_by_six(c9) result(c6)
    real(wp), intent(in) :: c9(9, 9)
    real(wp) :: c6(6, 6)
    integer(i4) :: a, b, row(2), column(2)
    do b = 1, 6
      column = [place(pairs_of_six(1, b), pairs_of_six(2, b)), &
                place(pairs_of_six(2, b), pairs_of_six(1, b))]
      do a = 1, 6
        row = [place(pairs_of_six(1, a), pairs_of_six(2, a)), &
               place(pairs_of_six(2, a), pairs_of_six(1, a))]
        c6(a, b) = 0.25_wp*sum(c9(row, column))
      end do
    end do
  end function six_by_six

  pure integer(i4) function place(i, j)
    integer(i4), intent(in) :: i, j
    place = 3*(i - 1) + j
  end function place

  !> Isotropic part: bulk and shear modulus are the means of Voigt.
  pure function fit_isotropic(c6) result(fit)
    real(wp), intent(in) :: c6(6, 6)
    type(fit_type) :: fit
    real(wp) :: weighted(6, 6), isotropic(6, 6), norm
    integer(i4) :: i

    weighted = c6
    weighted(4:, :) = root2*weighted(4:, :)
    weighted(:, 4:) = root2*weighted(:, 4:)
    fit%bulk = sum(c6(:3, :3))/9.0_wp
    fit%shear = 0.0_wp
    do i = 1, 3
      fit%shear = fit%shear + c6(i, i) + 3.0_wp*c6(i + 3, i + 3)
    end do
    fit%shear = (fit%shear - 0.5_wp*(sum(c6(:3, :3)) - c6(1, 1) - c6(2, 2) - c6(3, 3)))/15.0_wp
    fit%lambda = fit%bulk - 2.0_wp*fit%shear/3.0_wp
    isotropic = 0.0_wp
    isotropic(:3, :3) = fit%lambda
    do i = 1, 6
      isotropic(i, i) = isotropic(i, i) + 2.0_wp*fit%shear
    end do
    norm = sqrt(sum(weighted**2))
    if (.not. norm > 0.0_wp) return
    fit%misfit = sqrt(sum((weighted - isotropic)**2))/norm
    fit%asymmetry = 0.5_wp*sqrt(sum((weighted - transpose(weighted))**2))/norm
    if (.not. 3.0_wp*fit%bulk + fit%shear > 0.0_wp) return
    fit%young = 9.0_wp*fit%bulk*fit%shear/(3.0_wp*fit%bulk + fit%shear)
    fit%poisson = (3.0_wp*fit%bulk - 2.0_wp*fit%shear)/(6.0_wp*fit%bulk + 2.0_wp*fit%shear)
  end function fit_isotropic
end module talus_stiffness
