!> Eringen's linear solid, `micropolar` (fem_micropolar); with a state, for elastic parts of bodies
!! that have other laws too.
module fem_law_micropolar
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_law, only: at_flag, at_iterations, flag_elastic
  use fem_law_polar, only: fem_law_polar_type, count_polar_work
  use fem_polar, only: polar_size, spread_families, family_matrix
  implicit none
  private
  public :: fem_law_micropolar_type

  type, extends(fem_law_polar_type) :: fem_law_micropolar_type
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: polar_update
  end type fem_law_micropolar_type

contains

  subroutine define(self)
    class(fem_law_micropolar_type), intent(inout) :: self
    self%name = 'micropolar'
    self%stateful = .false.
    self%polar = .true.
    self%eringen = .true.
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_micropolar_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    call self%read_eringen(deck, m, errors)
  end subroutine read_constants

  pure subroutine polar_update(self, strain, stress, state, tangent, good)
    class(fem_law_micropolar_type), intent(in) :: self
    real(wp), intent(in) :: strain(polar_size)
    real(wp), intent(inout) :: stress(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    logical, intent(out) :: good
    real(wp) :: new(polar_size)
    new = stress + spread_families(self%modulus_of, strain)
    tangent = family_matrix(self%modulus_of)
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    call count_polar_work(strain, 0.0_wp*strain, stress, new, state)
    stress = new
    good = .true.
  end subroutine polar_update
end module fem_law_micropolar
