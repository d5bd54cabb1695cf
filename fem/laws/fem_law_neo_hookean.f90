!> A compressible neo-Hookean solid, `neo_hookean`: W = mu/2 (tr C - 3) - mu ln J + lambda/2
!! (ln J)^2 (theory: finite strain).
module fem_law_neo_hookean
  use talus_kinds, only: wp, i4
  use fem_law_finite, only: fem_law_finite_type, invert_cauchy
  use fem_voigt, only: unit, outer
  implicit none
  private
  public :: fem_law_neo_hookean_type

  integer(i4), parameter :: row(6) = [1, 2, 3, 1, 2, 3], column(6) = [1, 2, 3, 2, 3, 1]

  type, extends(fem_law_finite_type) :: fem_law_neo_hookean_type
  contains
    procedure :: define
    procedure :: stored_energy
  end type fem_law_neo_hookean_type

contains

  subroutine define(self)
    class(fem_law_neo_hookean_type), intent(inout) :: self
    call self%define_finite('neo_hookean')
  end subroutine define

  pure subroutine stored_energy(self, green, energy, stress, tangent, ratio, good)
    class(fem_law_neo_hookean_type), intent(in) :: self
    real(wp), intent(in) :: green(6)
    real(wp), intent(out) :: energy, stress(6), tangent(6, 6), ratio
    logical, intent(out) :: good
    real(wp) :: c(3, 3), inverse(6), logarithm, square
    integer(i4) :: i, j

    call invert_cauchy(green, inverse, square, ratio, good)
    energy = 0.0_wp
    stress = 0.0_wp
    tangent = 0.0_wp
    if (.not. good) return
    logarithm = 0.5_wp*log(square)
    stress = self%mu*(unit - inverse) + self%lambda*logarithm*inverse
    energy = self%mu*(sum(green(:3)) - logarithm) + 0.5_wp*self%lambda*logarithm**2
    tangent = self%lambda*outer(inverse, inverse)
    c = reshape(inverse([1, 4, 6, 4, 2, 5, 6, 5, 3]), [3, 3])
    do j = 1, 6
      do i = 1, 6
        tangent(i, j) = tangent(i, j) + (self%mu - self%lambda*logarithm) &
          *(c(row(i), row(j))*c(column(i), column(j)) + c(row(i), column(j))*c(column(i), row(j)))
      end do
    end do
  end subroutine stored_energy
end module fem_law_neo_hookean
