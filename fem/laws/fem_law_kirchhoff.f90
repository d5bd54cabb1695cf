!> St. Venant and Kirchhoff's solid, `st_venant_kirchhoff`: W = lambda/2 (tr E)^2 + mu E:E (theory:
!! finite strain).
module fem_law_kirchhoff
  use talus_kinds, only: wp, i4
  use fem_law_finite, only: fem_law_finite_type, invert_cauchy
  use fem_voigt, only: isotropic
  implicit none
  private
  public :: fem_law_kirchhoff_type

  type, extends(fem_law_finite_type) :: fem_law_kirchhoff_type
  contains
    procedure :: define
    procedure :: stored_energy
  end type fem_law_kirchhoff_type

contains

  subroutine define(self)
    class(fem_law_kirchhoff_type), intent(inout) :: self
    call self%define_finite('st_venant_kirchhoff')
  end subroutine define

  pure subroutine stored_energy(self, green, energy, stress, tangent, ratio, good)
    class(fem_law_kirchhoff_type), intent(in) :: self
    real(wp), intent(in) :: green(6)
    real(wp), intent(out) :: energy, stress(6), tangent(6, 6), ratio
    logical, intent(out) :: good
    real(wp) :: inverse(6), square
    integer(i4) :: i
    call invert_cauchy(green, inverse, square, ratio, good)
    energy = 0.0_wp
    stress = 0.0_wp
    tangent = 0.0_wp
    if (.not. good) return
    tangent = self%lambda*isotropic
    do i = 1, 6
      tangent(i, i) = tangent(i, i) + merge(2.0_wp, 1.0_wp, i <= 3)*self%mu
    end do
    stress = matmul(tangent, green)
    energy = 0.5_wp*sum(stress*green)
  end subroutine stored_energy
end module fem_law_kirchhoff
