!> Drucker-Prager plasticity with linear elasticity (theory-fem, Laws with a state): yield function
!! f = |s| + B p - A c, p the mean stress, tension positive; flow from |s| + B_psi p; cohesion
!! c = c0 + H Z, dZ = A_psi dgamma, not below a residual one. Return to the cone or to its apex in
!! closed form.
module fem_law_drucker
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use fem_law, only: fem_law_type, common_size, at_flag, at_iterations, at_plastic, flag_elastic, &
    flag_yielding, flag_apex
  use fem_voigt, only: unit, twice, project, isotropic, trace, magnitude, elastic_matrix, outer
  implicit none
  private
  public :: fem_law_drucker_type, cone_constants

  integer(i4), parameter :: at_hardening = common_size + 1
  real(wp), parameter :: outside = 1.0e-9_wp  !! of the strength, that an initial stress may exceed
  real(wp), parameter :: remnant = 1.0e-9_wp  !! of the elastic stiffness that is left at the apex

  type, extends(fem_law_type) :: fem_law_drucker_type
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp           !! [Pa]
    real(wp) :: a = 0.0_wp, b = 0.0_wp                  !! A and B of the yield function [-]
    real(wp) :: a_flow = 0.0_wp, b_flow = 0.0_wp        !! A_psi and B_psi of the flow [-]
    real(wp) :: cohesion = 0.0_wp                       !! c0 [Pa]
    real(wp) :: hardening = 0.0_wp                      !! H [Pa]
    real(wp) :: residual = 0.0_wp                       !! least cohesion of softening [Pa]
  contains
    procedure :: begin
    procedure :: update
    procedure :: state_name
    procedure :: modulus
    procedure, private :: cohesion_at
    procedure, private :: to_cone
    procedure, private :: to_apex
  end type fem_law_drucker_type

contains

  !> A and B for an angle [rad]: the cone through the compressive (`place` -1) or extensive (+1)
  !! edges of Mohr and Coulomb's pyramid, or (0) that with its strength in plane strain for a
  !! dilation `flow` [rad], where b_flow of that angle counts (theory: plasticity).
  pure subroutine cone_constants(angle, flow, place, a, b)
    real(wp), intent(in) :: angle, flow
    integer(i4), intent(in) :: place
    real(wp), intent(out) :: a, b
    real(wp) :: beta, q
    if (place /= 0) then
      beta = 2.0_wp*sqrt(6.0_wp)/(3.0_wp + place*sin(angle))
    else
      q = sin(flow)*sqrt(6.0_wp/(3.0_wp + sin(flow)**2))
      beta = 1.0_wp/(sqrt(0.5_wp*(1.0_wp - q**2/6.0_wp)) + q*sin(angle)/6.0_wp)
    end if
    a = beta*cos(angle)
    b = beta*sin(angle)
  end subroutine cone_constants

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp) :: p, f, scale
    state = 0.0_wp
    fault = ''
    cure = ''
    p = trace(stress)/3.0_wp
    f = magnitude(stress - p*unit) + self%b*p - self%a*self%cohesion
    scale = magnitude(stress) + self%a*self%cohesion
    if (f <= outside*scale) return
    fault = 'the initial stress is outside the yield surface: |s| + B p - A c = '//str(f)// &
            ' Pa with |s| = '//str(magnitude(stress - p*unit))//' Pa, p = '//str(p)//' Pa'
    cure = 'raise k0 or the confining stress, or give cohesion'
  end subroutine begin

  !> Cohesion at a hardening variable, and its slope [Pa].
  pure subroutine cohesion_at(self, z, c, slope)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: z
    real(wp), intent(out) :: c, slope
    c = self%cohesion + self%hardening*z
    slope = self%hardening
    if (self%hardening >= 0.0_wp .or. c > self%residual) return
    c = self%residual
    slope = 0.0_wp
  end subroutine cohesion_at

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
    call self%cohesion_at(state(at_hardening), c, slope)
    if (size_of + self%b*p - self%a*c <= 0.0_wp .and. &
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
    real(wp) :: c, slope, rate, step, left, n(6), two_g
    integer(i4) :: k

    two_g = 2.0_wp*self%shear
    call self%cohesion_at(state(at_hardening), c, slope)
    do k = 1, 2  ! the second time where softening ends within the step
      rate = two_g + self%bulk*self%b*self%b_flow + self%a*self%a_flow*slope
      step = max(0.0_wp, (size_of + self%b*p - self%a*c)/rate)
      if (slope >= 0.0_wp .or. c + slope*self%a_flow*step >= self%residual) exit
      c = self%residual
      slope = 0.0_wp
    end do
    good = size_of > two_g*step
    if (.not. good) return
    left = 1.0_wp - two_g*step/size_of
    n = s/size_of
    stress = left*s + (p - self%bulk*self%b_flow*step)*unit
    tangent = self%bulk*isotropic + two_g*left*project + two_g*(1.0_wp - left)*outer(n, n) &
      - outer(two_g*n + self%bulk*self%b_flow*unit, two_g*n + self%bulk*self%b*unit)/rate
    state(at_hardening) = state(at_hardening) + self%a_flow*step
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) &
      + step*(twice*n + self%b_flow/3.0_wp*unit)
    state(at_flag) = flag_yielding
  end subroutine to_cone

  !> Return to the apex; without dilation the cone ends in a cut-off that does not harden.
  pure subroutine to_apex(self, s, p, stress, state, tangent)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: s(6), p
    real(wp), intent(inout) :: stress(6), state(:), tangent(6, 6)
    real(wp) :: c, slope, share, rate, grown
    integer(i4) :: k

    call self%cohesion_at(state(at_hardening), c, slope)
    share = 0.0_wp
    if (self%b_flow > 0.0_wp) share = self%a_flow/self%b_flow
    rate = huge(1.0_wp)
    grown = 0.0_wp
    do k = 1, 2
      if (.not. self%b > 0.0_wp) exit  ! no friction: the mean stress does not count
      rate = self%bulk + self%a/self%b*share*slope
      grown = max(0.0_wp, (p - self%a/self%b*c)/rate)
      if (slope >= 0.0_wp .or. c + slope*share*grown >= self%residual) exit
      c = self%residual
      slope = 0.0_wp
    end do
    stress = (p - self%bulk*grown)*unit
    tangent = self%bulk*(1.0_wp - self%bulk/rate)*isotropic + remnant*tangent
    state(at_hardening) = state(at_hardening) + share*grown
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) &
      + twice*s/(2.0_wp*self%shear) + grown/3.0_wp*unit
    state(at_flag) = flag_apex
  end subroutine to_apex

  pure function state_name(self, k) result(name)
    class(fem_law_drucker_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: name
    name = 'hardening [-]'
  end function state_name

  pure function modulus(self, stress) result(moduli)
    class(fem_law_drucker_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%bulk, self%shear]
  end function modulus
end module fem_law_drucker
