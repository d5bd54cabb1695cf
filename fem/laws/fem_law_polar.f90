!> What micropolar laws share: stress and couple stress (fem_polar) from an increment of strain and
!! curvature, 18 components in all, with tangent and ledger; six components for states that are
!! symmetric and have no couple stress.
!! eqs. F.18 and F.19
module fem_law_polar
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_constants, only: polar_constants
  use fem_law, only: fem_law_type, at_stored, at_dissipated, at_numerical
  use fem_polar, only: polar_size, families, full_of, symmetric_of, eringen_families
  implicit none
  private
  public :: fem_law_polar_type, count_polar_work, mean_family

  integer(i4), parameter :: mean_family = 3

  type, abstract, extends(fem_law_type) :: fem_law_polar_type
    real(wp) :: modulus_of(families) = 0.0_wp  !! elastic, of the families, from `moduli` [Pa, N]
  contains
    procedure :: read_eringen
    procedure :: update
    procedure :: modulus
    procedure :: moduli_at
    procedure(polar_face), deferred :: polar_update
  end type fem_law_polar_type

  abstract interface
    !> Stress and state after an increment of the strain and of the curvature, with the tangent and
    !! the ledger of the point as `integrate` of fem_law has it. `good` is false where the local
    !! equations do not converge; nothing is changed then.
    pure subroutine polar_face(self, strain, stress, state, tangent, good)
      import :: fem_law_polar_type, polar_size, wp
      class(fem_law_polar_type), intent(in) :: self
      real(wp), intent(in) :: strain(polar_size)
      real(wp), intent(inout) :: stress(polar_size)
      real(wp), intent(inout) :: state(:)
      real(wp), intent(out) :: tangent(polar_size, polar_size)
      logical, intent(out) :: good
    end subroutine polar_face
  end interface

contains

  !> The elastic constants.
  subroutine read_eringen(self, deck, m, errors)
    class(fem_law_polar_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    call polar_constants(deck, m, self%moduli, errors)
    self%modulus_of = eringen_families(self%moduli)
  end subroutine read_eringen

  !> States that are symmetric and have no couple stress, six components: the micro-rotation is
  !! that of the material.
  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    integer(i4), parameter :: other(6) = [1, 5, 9, 4, 8, 7]
    real(wp) :: wide(polar_size), long(polar_size), d(polar_size, polar_size), there(size(state))
    integer(i4) :: j
    wide = 0.0_wp
    long = 0.0_wp
    wide(:9) = stress(full_of)
    long(:9) = strain(full_of)
    long([2, 3, 4, 6, 7, 8]) = 0.5_wp*long([2, 3, 4, 6, 7, 8])
    there = state
    call self%polar_update(long, wide, there, d, good)
    if (.not. good) return
    there(at_stored:at_numerical) = state(at_stored:at_numerical)  ! counted by `integrate`
    state = there
    stress = wide(symmetric_of)
    do j = 1, 6
      tangent(:, j) = 0.5_wp*(d(symmetric_of, symmetric_of(j)) + d(symmetric_of, other(j)))
    end do
  end subroutine update

  pure function modulus(self, stress) result(moduli)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%modulus_of(mean_family)/3.0_wp, 0.5_wp*self%modulus_of(1)]
  end function modulus

  pure function moduli_at(self, stress) result(moduli)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: stress(:)
    real(wp) :: moduli(6)
    moduli = self%moduli
  end function moduli_at

  !> Ledger of an increment whose stress changes from `stress` to `new`, of which `flow` is plastic.
  pure subroutine count_polar_work(strain, flow, stress, new, state)
    real(wp), dimension(polar_size), intent(in) :: strain, flow, stress, new
    real(wp), intent(inout) :: state(:)
    real(wp) :: lost
    lost = sum(new*flow)
    state(at_stored) = state(at_stored) + 0.5_wp*sum((stress + new)*(strain - flow))
    state(at_dissipated) = state(at_dissipated) + lost
    state(at_numerical) = state(at_numerical) + 0.5_wp*sum((stress + new)*flow) - lost
  end subroutine count_polar_work
end module fem_law_polar
