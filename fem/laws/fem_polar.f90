!> Isotropic operators on micropolar strains and stresses: 18 components, nine of gamma_kl
!! (sigma_kl) and nine of kappa_kl (m_kl), kl = 11 12 13 21 22 23 31 32 33. Such an operator has
!! a coefficient for each family of components that isotropy does not mix: the symmetric deviator,
!! the skew part and the mean, of either half.
module fem_polar
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: polar_size, families, spread_families, family_matrix, family_squares, polar_outer
  public :: polar_unit, full_of, symmetric_of, eringen_families

  integer(i4), parameter :: polar_size = 18
  integer(i4), parameter :: families = 6  !! deviator, skew part, mean of sigma; the same of m
  integer(i4), parameter :: turned(9) = [1, 4, 7, 2, 5, 8, 3, 6, 9]
  integer(i4), parameter :: diagonal(3) = [1, 5, 9]
  integer(i4), parameter :: full_of(9) = [1, 4, 6, 4, 2, 5, 6, 5, 3]  !! kl among xx yy zz xy yz zx
  integer(i4), parameter :: symmetric_of(6) = [1, 5, 9, 2, 6, 3]      !! and back
  real(wp), parameter :: polar_unit(polar_size) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
    0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]

contains

  !> Coefficients of the elasticity of Eringen's moduli [Pa, N].
  pure function eringen_families(moduli) result(c)
    real(wp), intent(in) :: moduli(6)  !! lambda, mu, kappa, alpha, beta, gamma
    real(wp) :: c(families)
    c(1) = 2.0_wp*moduli(2) + moduli(3)
    c(2) = moduli(3)
    c(3) = 3.0_wp*moduli(1) + c(1)
    c(4) = moduli(5) + moduli(6)
    c(5) = moduli(6) - moduli(5)
    c(6) = 3.0_wp*moduli(4) + c(4)
  end function eringen_families

  !> The families of v times their coefficients.
  pure function spread_families(c, v) result(w)
    real(wp), intent(in) :: c(families), v(polar_size)
    real(wp) :: w(polar_size)
    w(:9) = half_of(c(:3), v(:9))
    w(10:) = half_of(c(4:), v(10:))
  end function spread_families

  pure function half_of(c, v) result(w)
    real(wp), intent(in) :: c(3), v(9)
    real(wp) :: w(9)
    w = 0.5_wp*(c(1) + c(2))*v + 0.5_wp*(c(1) - c(2))*v(turned)
    w(diagonal) = w(diagonal) + (c(3) - c(1))/3.0_wp*sum(v(diagonal))
  end function half_of

  !> The operator as a matrix.
  pure function family_matrix(c) result(d)
    real(wp), intent(in) :: c(families)
    real(wp) :: d(polar_size, polar_size), direction(polar_size)
    integer(i4) :: j
    do j = 1, polar_size
      direction = 0.0_wp
      direction(j) = 1.0_wp
      d(:, j) = spread_families(c, direction)
    end do
  end function family_matrix

  !> Sums of the squares of the components of each family.
  pure function family_squares(v) result(squares)
    real(wp), intent(in) :: v(polar_size)
    real(wp) :: squares(families)
    squares(:3) = half_squares(v(:9))
    squares(4:) = half_squares(v(10:))
  end function family_squares

  pure function half_squares(v) result(squares)
    real(wp), intent(in) :: v(9)
    real(wp) :: squares(3), mean, s(9)
    mean = sum(v(diagonal))/3.0_wp
    s = 0.5_wp*(v + v(turned))
    s(diagonal) = s(diagonal) - mean
    squares = [sum(s**2), 0.25_wp*sum((v - v(turned))**2), 3.0_wp*mean**2]
  end function half_squares

  !> a b'
  pure function polar_outer(a, b) result(c)
    real(wp), intent(in) :: a(polar_size), b(polar_size)
    real(wp) :: c(polar_size, polar_size)
    integer(i4) :: j
    do j = 1, polar_size
      c(:, j) = a*b(j)
    end do
  end function polar_outer
end module fem_polar
