!> Drucker-Prager plasticity with linear elasticity, `drucker_prager` (theory-fem, Laws with a
!! state): the cone of fem_cone with q = |s|; the return to the cone or to its apex is in closed
!! form.
!! eq. F.17
module fem_law_drucker
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_cone, only: fem_cone_type, remnant
  use fem_constants, only: elastic_constants
  use fem_law, only: fem_law_type, common_size, at_flag, at_iterations, at_plastic, flag_elastic, &
    flag_yielding, flag_apex
  use fem_voigt, only: unit, twice, project, isotropic, trace, magnitude, elastic_matrix, outer
  implicit none
  private
  public :: fem_law_drucker_type

  integer(i4), parameter :: at_hardening = common_size + 1

  type, extends(fem_law_type) :: fem_law_drucker_type
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp  !! [Pa]
    type(fem_cone_type) :: cone
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: begin
    procedure :: take_over
    procedure :: update
    procedure :: modulus
    procedure, private :: to_cone
    procedure, private :: to_apex
  end type fem_law_drucker_type

contains

  subroutine define(self)
    class(fem_law_drucker_type), intent(inout) :: self
    self%name = 'drucker_prager'
    call self%add_states(['hardening [-]'])
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_drucker_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: ratio
    call elastic_constants(deck, m, self%bulk, ratio, self%moduli)
    self%shear = ratio*self%bulk
    call self%cone%read(deck, m, 2.0_wp*self%shear, self%bulk, errors)
    self%symmetric = self%cone%associated_flow()
  end subroutine read_constants

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    state = 0.0_wp
    call self%cone%check_start(stress, fault, cure)
  end subroutine begin

  subroutine take_over(self, density, stress, state, fault, cure)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: density
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    call self%cone%bring_inside(stress)
    call self%begin(stress, state, fault, cure)
  end subroutine take_over

  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: trial(6), s(6), p, size_of, c, slope
    logical :: still

    good = .true.
    still = .not. any(abs(strain) > 0.0_wp)
    tangent = elastic_matrix(self%bulk, self%shear)
    p = trace(strain)
    trial = stress + self%shear*strain
    trial(:3) = trial(:3) + self%shear*strain(:3) + (self%bulk - self%shear/1.5_wp)*p
    p = trace(trial)/3.0_wp
    s = trial - p*unit
    size_of = magnitude(s)
    call self%cone%cohesion_at(state(at_hardening), c, slope)
    if (size_of + self%cone%b*p - self%cone%a*c <= 0.0_wp .and. &
        .not. (still .and. state(at_flag) > flag_elastic)) then
      stress = trial
      state(at_flag) = flag_elastic
      state(at_iterations) = 0.0_wp
      return
    end if
    state(at_iterations) = 1.0_wp
    call self%to_cone(s, p, size_of, stress, state, tangent, good)
    if (.not. good) call self%to_apex(s, p, stress, state, tangent)
    good = .true.
  end subroutine update

  !> Return to the cone; `good` is false where that would pass its apex.
  pure subroutine to_cone(self, s, p, size_of, stress, state, tangent, good)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: s(6), p, size_of
    real(wp), intent(inout) :: stress(6), state(:), tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: rate, step, left, n(6), two_g

    two_g = 2.0_wp*self%shear
    call self%cone%cone_step(size_of, p, state(at_hardening), [two_g, self%bulk], step, rate)
    good = size_of > two_g*step
    if (.not. good) return
    left = 1.0_wp - two_g*step/size_of
    n = s/size_of
    associate (a_flow => self%cone%a_flow, b => self%cone%b, b_flow => self%cone%b_flow)
      stress = left*s + (p - self%bulk*b_flow*step)*unit
      tangent = self%bulk*isotropic + two_g*left*project + two_g*(1.0_wp - left)*outer(n, n) &
        - outer(two_g*n + self%bulk*b_flow*unit, two_g*n + self%bulk*b*unit)/rate
      state(at_hardening) = state(at_hardening) + a_flow*step
      state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) &
        + step*(twice*n + b_flow/3.0_wp*unit)
    end associate
    state(at_flag) = flag_yielding
  end subroutine to_cone

  !> Return to the apex.
  pure subroutine to_apex(self, s, p, stress, state, tangent)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: s(6), p
    real(wp), intent(inout) :: stress(6), state(:), tangent(6, 6)
    real(wp) :: rate, grown, growth

    call self%cone%apex_step(p, state(at_hardening), self%bulk, grown, growth, rate)
    stress = (p - self%bulk*grown)*unit
    tangent = self%bulk*(1.0_wp - self%bulk/rate)*isotropic + remnant*tangent
    state(at_hardening) = state(at_hardening) + growth
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) &
      + twice*s/(2.0_wp*self%shear) + grown/3.0_wp*unit
    state(at_flag) = flag_apex
  end subroutine to_apex

  pure function modulus(self, stress) result(moduli)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%bulk, self%shear]
  end function modulus
end module fem_law_drucker
