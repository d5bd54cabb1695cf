!> What elastic solids at finite strain share: a stored energy W(E) of Green's strain E, with the
!! second Piola-Kirchhoff stress S = dW/dE (theory: finite strain). Here `strain` of a law is E,
!! with engineering shears, and `stress` is S.
!! eq. F.21
module fem_law_finite
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_constants, only: elastic_constants
  use fem_law, only: fem_law_type, at_flag, at_iterations, at_stored, common_size, flag_elastic
  implicit none
  private
  public :: fem_law_finite_type, at_green, at_ratio, invert_cauchy

  integer(i4), parameter :: at_green = common_size + 1  !! E, six components
  integer(i4), parameter :: at_ratio = common_size + 7  !! J, volume over that of the reference

  type, abstract, extends(fem_law_type) :: fem_law_finite_type
    real(wp) :: lambda = 0.0_wp, mu = 0.0_wp  !! [Pa]
  contains
    procedure :: define_finite
    procedure :: read_constants
    procedure :: begin
    procedure :: update
    procedure :: modulus
    procedure(energy_face), deferred :: stored_energy
  end type fem_law_finite_type

  abstract interface
    !> Energy per reference volume [J/m^3], stress S and dS/dE [Pa] at Green's strain `green`; J is
    !! `ratio`. `good` is false where no motion has this strain: C = I + 2 E is not positive.
    pure subroutine energy_face(self, green, energy, stress, tangent, ratio, good)
      import :: fem_law_finite_type, wp
      class(fem_law_finite_type), intent(in) :: self
      real(wp), intent(in) :: green(6)
      real(wp), intent(out) :: energy, stress(6), tangent(6, 6), ratio
      logical, intent(out) :: good
    end subroutine energy_face
  end interface

contains

  !> What all of them are.
  subroutine define_finite(self, name)
    class(fem_law_finite_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    self%name = name
    self%finite = .true.
    call self%add_states([character(len=16) :: 'green_xx [-]', 'green_yy [-]', 'green_zz [-]', &
      'green_xy [-]', 'green_yz [-]', 'green_zx [-]', 'volume_ratio [-]'])
  end subroutine define_finite

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_finite_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: bulk, ratio
    call elastic_constants(deck, m, bulk, ratio, self%moduli)
    self%mu = ratio*bulk
    self%lambda = bulk - 2.0_wp/3.0_wp*self%mu
  end subroutine read_constants

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
    cure = 'leave the initial stress out, or use a law of small strains'
  end subroutine begin

  !> C = I + 2 E, its inverse as six components, and J; `good` is false where C is not positive.
  pure subroutine invert_cauchy(green, inverse, square, ratio, good)
    real(wp), intent(in) :: green(6)
    real(wp), intent(out) :: inverse(6), square, ratio  !! [-], J^2, J
    logical, intent(out) :: good
    real(wp) :: c(3, 3)
    c = reshape([1.0_wp + 2.0_wp*green(1), green(4), green(6), green(4), 1.0_wp + 2.0_wp*green(2), &
                 green(5), green(6), green(5), 1.0_wp + 2.0_wp*green(3)], [3, 3])
    call invert(c, inverse, square)
    good = c(1, 1) > 0.0_wp .and. inverse(3)*square > 0.0_wp .and. square > 0.0_wp
    ratio = sqrt(max(square, 0.0_wp))
  end subroutine invert_cauchy

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

  !> The result is independent of the path: earlier values are not used.
  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_finite_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: energy, found(6), ratio, green(6)

    green = state(at_green:at_green + 5) + strain
    call self%stored_energy(green, energy, found, tangent, ratio, good)
    if (.not. good) return
    stress = found
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    state(at_stored) = energy
    state(at_green:at_green + 5) = green
    state(at_ratio) = ratio
  end subroutine update

  pure function modulus(self, stress) result(moduli)
    class(fem_law_finite_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%lambda + 2.0_wp/3.0_wp*self%mu, self%mu]
  end function modulus
end module fem_law_finite
