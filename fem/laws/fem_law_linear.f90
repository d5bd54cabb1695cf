!> Linear elasticity as a law with a state, for elastic parts of bodies that have other laws too.
module fem_law_linear
  use talus_kinds, only: wp, i4
  use fem_law, only: fem_law_type, at_flag, at_iterations, flag_elastic
  use fem_voigt, only: elastic_matrix
  implicit none
  private
  public :: fem_law_linear_type

  type, extends(fem_law_type) :: fem_law_linear_type
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp  !! [Pa]
  contains
    procedure :: begin
    procedure :: update
    procedure :: state_name
    procedure :: modulus
  end type fem_law_linear_type

contains

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_linear_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    state = 0.0_wp
    fault = ''
    cure = ''
  end subroutine begin

  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_linear_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    tangent = elastic_matrix(self%bulk, self%shear)
    stress = stress + matmul(tangent, strain)
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    good = .true.
  end subroutine update

  pure function state_name(self, k) result(name)
    class(fem_law_linear_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: name
    name = ''
  end function state_name

  pure function modulus(self, stress) result(moduli)
    class(fem_law_linear_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%bulk, self%shear]
  end function modulus
end module fem_law_linear
