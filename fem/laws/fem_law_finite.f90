!> Elastic solids at finite strain by their stored energy, with Green's strain E and the second
!! Piola-Kirchhoff stress S = dW/dE: St. Venant and Kirchhoff's, W = lambda/2 (tr E)^2 + mu E:E,
!! and a compressible neo-Hookean one, W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2 (theory:
!! finite strain). Here `strain` of a law is E, with engineering shears, and `stress` is S.
module fem_law_finite
  use talus_kinds, only: wp, i4
  use fem_law, only: fem_law_type, at_flag, at_iterations, at_stored, common_size, flag_elastic
  use fem_voigt, only: unit, isotropic, outer
  implicit none
  private
  public :: fem_law_finite_type, kirchhoff, neo_hookean, finite_states, at_green, at_ratio, &
    stored_energy

  integer(i4), parameter :: kirchhoff = 1, neo_hookean = 2
  integer(i4), parameter :: at_green = common_size + 1  !! E, six components
  integer(i4), parameter :: at_ratio = common_size + 7  !! J, volume over that of the reference
  integer(i4), parameter :: finite_states = common_size + 7
  integer(i4), parameter :: row(6) = [1, 2, 3, 1, 2, 3], column(6) = [1, 2, 3, 2, 3, 1]

  type, extends(fem_law_type) :: fem_law_finite_type
    integer(i4) :: kind = neo_hookean
    real(wp) :: lambda = 0.0_wp, mu = 0.0_wp  !! [Pa]
  contains
    procedure :: begin
    procedure :: update
    procedure :: state_name
    procedure :: modulus
  end type fem_law_finite_type

contains

  !> The reference is free of stress.
  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_finite_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    state = 0.0_wp
    state(at_ratio) = 1.0_wp
    fault = ''
    cure = ''
    if (maxval(abs(stress)) <= 0.0_wp) return
    fault = 'a solid at finite strain starts without stress'
    cure = 'leave the initial stress out, or take a law of small strains'
  end subroutine begin

  !> Energy per reference volume [J/m^3], stress S and dS/dE [Pa] at Green's strain `green`; J is
  !! `ratio`. `good` is false where no motion has this strain: C = I + 2 E is not positive.
  pure subroutine stored_energy(self, green, energy, stress, tangent, ratio, good)
    class(fem_law_finite_type), intent(in) :: self
    real(wp), intent(in) :: green(6)
    real(wp), intent(out) :: energy, stress(6), tangent(6, 6), ratio
    logical, intent(out) :: good
    real(wp) :: c(3, 3), inverse(6), logarithm, square
    integer(i4) :: i, j

    c = reshape([1.0_wp + 2.0_wp*green(1), green(4), green(6), green(4), 1.0_wp + 2.0_wp*green(2), &
                 green(5), green(6), green(5), 1.0_wp + 2.0_wp*green(3)], [3, 3])
    call invert(c, inverse, square)
    good = c(1, 1) > 0.0_wp .and. inverse(3)*square > 0.0_wp .and. square > 0.0_wp
    ratio = sqrt(max(square, 0.0_wp))
    energy = 0.0_wp
    stress = 0.0_wp
    tangent = 0.0_wp
    if (.not. good) return
    if (self%kind == kirchhoff) then
      tangent = self%lambda*isotropic
      do i = 1, 6
        tangent(i, i) = tangent(i, i) + merge(2.0_wp, 1.0_wp, i <= 3)*self%mu
      end do
      stress = matmul(tangent, green)
      energy = 0.5_wp*sum(stress*green)
      return
    end if
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

  !> Inverse of a symmetric matrix as six components, and its determinant.
  pure subroutine invert(c, inverse, determinant)
    real(wp), intent(in) :: c(3, 3)
    real(wp), intent(out) :: inverse(6), determinant
    inverse = [c(2, 2)*c(3, 3) - c(2, 3)**2, c(1, 1)*c(3, 3) - c(1, 3)**2, &
               c(1, 1)*c(2, 2) - c(1, 2)**2, c(1, 3)*c(2, 3) - c(1, 2)*c(3, 3), &
               c(1, 2)*c(1, 3) - c(1, 1)*c(2, 3), c(1, 2)*c(2, 3) - c(1, 3)*c(2, 2)]
    determinant = c(1, 1)*inverse(1) + c(1, 2)*inverse(4) + c(1, 3)*inverse(6)
    if (determinant > 0.0_wp) inverse = inverse/determinant
  end subroutine invert

  !> The path counts not: what was there is forgotten.
  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_finite_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: energy, found(6), ratio, green(6)

    green = state(at_green:at_green + 5) + strain
    call stored_energy(self, green, energy, found, tangent, ratio, good)
    if (.not. good) return
    stress = found
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    state(at_stored) = energy
    state(at_green:at_green + 5) = green
    state(at_ratio) = ratio
  end subroutine update

  pure function state_name(self, k) result(name)
    class(fem_law_finite_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: name
    character(len=2), parameter :: component(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'zx']
    name = 'volume_ratio [-]'
    if (k < at_ratio) name = 'green_'//component(k - at_green + 1)//' [-]'
  end function state_name

  pure function modulus(self, stress) result(moduli)
    class(fem_law_finite_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%lambda + 2.0_wp/3.0_wp*self%mu, self%mu]
  end function modulus
end module fem_law_finite
