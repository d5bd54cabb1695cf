!> Linear elasticity, `linear_elastic`; with a state, for elastic parts of bodies that have other
!! laws too.
!! eq. F.1
module fem_law_linear
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_constants, only: elastic_constants
  use fem_law, only: fem_law_type, at_flag, at_iterations, flag_elastic
  use fem_voigt, only: elastic_matrix
  implicit none
  private
  public :: fem_law_linear_type

  type, extends(fem_law_type) :: fem_law_linear_type
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp  !! [Pa]
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: update
    procedure :: modulus
  end type fem_law_linear_type

contains

  subroutine define(self)
    class(fem_law_linear_type), intent(inout) :: self
    self%name = 'linear_elastic'
    self%stateful = .false.
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_linear_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: ratio
    if (.not. (deck%given('material', m, 'young') .and. deck%given('material', m, 'poisson'))) then
      call deck%fault(errors, 'D320', 'the material has no young or no poisson', 'material', m, &
                      'id', 'a linear elastic solid needs both')
      return
    end if
    call elastic_constants(deck, m, self%bulk, ratio, self%moduli)
    self%shear = ratio*self%bulk
  end subroutine read_constants

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

  pure function modulus(self, stress) result(moduli)
    class(fem_law_linear_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%bulk, self%shear]
  end function modulus
end module fem_law_linear
