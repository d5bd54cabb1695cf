!> Plasticity of Drucker and Prager in invariants, for classical and micropolar solids alike: yield
!! function f = q + B p - A c, q a measure of shear (classically |s|), p the mean stress, tension
!! positive; flow from q + B_psi p; c = c0 + H Z, dZ = A_psi dgamma, not below a residual one
!! (theory: laws with a state).
!!
!! Backward Euler scales each family of stresses by 1/(1 + t E w), t = dgamma/q, E its modulus and w
!! its weight in q^2: one equation for x = t E1/(1 + t E1) in 0..1, where x = 1 is the apex. With
!! one family, or where all products E w are the same, the return is linear: `cone_step`.
module fem_cone
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_polar, only: families
  use fem_voigt, only: unit, trace, magnitude
  implicit none
  private
  public :: fem_cone_type, fem_trial_type, cone_constants, remnant

  integer(i4), parameter :: most_iterations = 100
  real(wp), parameter :: outside = 1.0e-9_wp    !! of the strength, by which a start may exceed it
  real(wp), parameter :: remnant = 1.0e-9_wp    !! of the elastic stiffness that is left at the apex
  real(wp), parameter :: accuracy = 1.0e-14_wp  !! of the yield function, over the trial stress

  type :: fem_cone_type
    real(wp) :: a = 0.0_wp, b = 0.0_wp            !! A and B of the yield function [-]
    real(wp) :: a_flow = 0.0_wp, b_flow = 0.0_wp  !! A_psi and B_psi of the flow [-]
    real(wp) :: cohesion = 0.0_wp                 !! c0 [Pa]
    real(wp) :: hardening = 0.0_wp                !! H [Pa]
    real(wp) :: residual = 0.0_wp                 !! least cohesion of softening [Pa]
  contains
    procedure :: read => read_cone
    procedure :: associated_flow
    procedure :: check_start
    procedure :: bring_inside
    procedure :: cohesion_at
    procedure :: cone_step
    procedure :: apex_step
    procedure :: yield_at
    procedure :: find_return
  end type fem_cone_type

  !> A trial stress, of which q counts.
  type :: fem_trial_type
    real(wp) :: stiff = 0.0_wp             !! E1, modulus of the first family [Pa]
    real(wp) :: bulk = 0.0_wp              !! [Pa]
    real(wp) :: square(families) = 0.0_wp  !! w |sigma|^2 of the families [Pa^2]
    real(wp) :: ratio(families) = 0.0_wp   !! E w over that of the first [-]
    real(wp) :: mean = 0.0_wp              !! p [Pa]
    real(wp) :: z = 0.0_wp                 !! hardening variable at the start [-]
    real(wp) :: x = 0.0_wp                 !! place of its return, 1 at the apex [-]
  end type fem_trial_type

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

  !> Constants of material m of the deck. Faults D331: flow that produces energy, a cone without
  !! strength, softening faster than the elastic unloading of `stiff` + K B B_psi.
  subroutine read_cone(self, deck, m, stiff, bulk, errors)
    class(fem_cone_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(in) :: stiff, bulk  !! [Pa]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: shape
    real(wp) :: friction, dilation, least
    real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
    integer(i4) :: place

    call deck%get('material', m, 'friction_deg', friction)
    call deck%get('material', m, 'dilation_deg', dilation)
    call deck%get('material', m, 'cohesion', self%cohesion)
    call deck%get('material', m, 'hardening', self%hardening)
    call deck%get('material', m, 'residual_cohesion', self%residual)
    call deck%get('material', m, 'cone', shape)
    place = -1
    if (shape == 'plane_strain') place = 0
    if (shape == 'extension') place = 1
    if (dilation > friction) call deck%fault(errors, 'D331', 'dilation_deg = '//str(dilation)// &
      ' is above friction_deg = '//str(friction), 'material', m, 'dilation_deg', &
      'plastic flow would give energy: equal angles are the limit')
    if (.not. (friction > 0.0_wp .or. self%cohesion > 0.0_wp)) call deck%fault(errors, 'D331', &
      'the material has neither friction nor cohesion', 'material', m, 'cohesion', &
      'give one of both')
    call cone_constants(friction*degree, dilation*degree, place, self%a, self%b)
    call cone_constants(dilation*degree, dilation*degree, place, self%a_flow, self%b_flow)
    least = -(stiff + bulk*self%b*self%b_flow)/(self%a*self%a_flow)
    if (.not. self%hardening > least) call deck%fault(errors, 'D331', &
      'hardening = '//str(self%hardening)//' Pa softens faster than elastic unloading', &
      'material', m, 'hardening', 'no increment would converge: it must be above '//str(least)// &
      ' Pa')
    if (self%residual > self%cohesion) call deck%fault(errors, 'D331', 'residual_cohesion = '// &
      str(self%residual)//' Pa is above cohesion = '//str(self%cohesion)//' Pa', 'material', m, &
      'residual_cohesion', 'it is what softening leaves')
  end subroutine read_cone

  !> Is the flow that of the yield function? Then the tangent is symmetric.
  pure logical function associated_flow(self)
    class(fem_cone_type), intent(in) :: self
    associated_flow = abs(self%b - self%b_flow) <= 0.0_wp
  end function associated_flow

  !> What is wrong with an initial stress, and a remedy; '' if it is not outside the cone.
  subroutine check_start(self, stress, fault, cure)
    class(fem_cone_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp) :: p, f
    fault = ''
    cure = ''
    p = trace(stress)/3.0_wp
    f = magnitude(stress - p*unit) + self%b*p - self%a*self%cohesion
    if (f <= outside*(magnitude(stress) + self%a*self%cohesion)) return
    fault = 'the initial stress is outside the yield surface: |s| + B p - A c = '//str(f)// &
            ' Pa with |s| = '//str(magnitude(stress - p*unit))//' Pa, p = '//str(p)//' Pa'
    cure = 'raise k0 or the confining stress, or give cohesion'
  end subroutine check_start

  !> A stress outside the cone goes back to it along its deviator, or to its apex. eq. F.75
  pure subroutine bring_inside(self, stress)
    class(fem_cone_type), intent(in) :: self
    real(wp), intent(inout) :: stress(6)  !! [Pa]
    real(wp) :: p, q, bound, s(6)
    p = trace(stress)/3.0_wp
    s = stress - p*unit
    q = magnitude(s)
    bound = self%a*self%cohesion
    if (q + self%b*p <= bound) return
    if (self%b*p > bound) p = bound/self%b
    if (q > 0.0_wp) s = s*min(1.0_wp, max(0.0_wp, bound - self%b*p)/q)
    stress = s + p*unit
  end subroutine bring_inside

  !> Cohesion at a hardening variable, and its slope [Pa].
  pure subroutine cohesion_at(self, z, c, slope)
    class(fem_cone_type), intent(in) :: self
    real(wp), intent(in) :: z
    real(wp), intent(out) :: c, slope
    c = self%cohesion + self%hardening*z
    slope = self%hardening
    if (self%hardening >= 0.0_wp .or. c > self%residual) return
    c = self%residual
    slope = 0.0_wp
  end subroutine cohesion_at

  !> dgamma of the linear return to the cone of a trial stress q, p, and the slope of f along it.
  pure subroutine cone_step(self, q, p, z, moduli, step, rate)
    class(fem_cone_type), intent(in) :: self
    real(wp), intent(in) :: q, p, z    !! [Pa], [Pa], [-]
    real(wp), intent(in) :: moduli(2)  !! that of q (2 G of |s|) and the bulk modulus [Pa]
    real(wp), intent(out) :: step, rate
    real(wp) :: c, slope
    integer(i4) :: k
    call self%cohesion_at(z, c, slope)
    do k = 1, 2  ! the second time where softening ends within the step
      rate = moduli(1) + moduli(2)*self%b*self%b_flow + self%a*self%a_flow*slope
      step = max(0.0_wp, (q + self%b*p - self%a*c)/rate)
      if (slope >= 0.0_wp .or. c + slope*self%a_flow*step >= self%residual) exit
      c = self%residual
      slope = 0.0_wp
    end do
  end subroutine cone_step

  !> Plastic volume of the return to the apex, the growth of z, and the slope of p along it; without
  !! dilation the cone ends in a cut-off that does not harden.
  pure subroutine apex_step(self, p, z, bulk, grown, growth, rate)
    class(fem_cone_type), intent(in) :: self
    real(wp), intent(in) :: p, z, bulk  !! [Pa], [-], [Pa]
    real(wp), intent(out) :: grown, growth, rate
    real(wp) :: c, slope, share
    integer(i4) :: k
    call self%cohesion_at(z, c, slope)
    share = 0.0_wp
    if (self%b_flow > 0.0_wp) share = self%a_flow/self%b_flow
    rate = huge(1.0_wp)
    grown = 0.0_wp
    do k = 1, 2
      if (.not. self%b > 0.0_wp) exit  ! no friction: the mean stress does not count
      rate = bulk + self%a/self%b*share*slope
      grown = max(0.0_wp, (p - self%a/self%b*c)/rate)
      if (slope >= 0.0_wp .or. c + slope*share*grown >= self%residual) exit
      c = self%residual
      slope = 0.0_wp
    end do
    growth = share*grown
  end subroutine apex_step

  !> q = (1 - x) g, and dgamma = x g/E1, at a place of the return; g' is `slope`.
  pure subroutine sizes(trial, x, g, slope)
    type(fem_trial_type), intent(in) :: trial
    real(wp), intent(in) :: x
    real(wp), intent(out) :: g, slope
    real(wp) :: left
    integer(i4) :: i
    g = 0.0_wp
    slope = 0.0_wp
    do i = 1, families
      if (.not. trial%square(i) > 0.0_wp) cycle
      left = 1.0_wp + x*(trial%ratio(i) - 1.0_wp)
      g = g + trial%square(i)/left**2
      slope = slope - trial%square(i)*(trial%ratio(i) - 1.0_wp)/left**3
    end do
    g = sqrt(g)
    if (g > 0.0_wp) slope = slope/g
  end subroutine sizes

  !> Yield function at a place of the return [Pa].
  pure real(wp) function yield_at(self, trial, x)
    class(fem_cone_type), intent(in) :: self
    type(fem_trial_type), intent(in) :: trial
    real(wp), intent(in) :: x
    real(wp) :: g, slope, step, c
    call sizes(trial, x, g, slope)
    step = x*g/trial%stiff
    call self%cohesion_at(trial%z + self%a_flow*step, c, slope)
    yield_at = (1.0_wp - x)*g + self%b*(trial%mean - trial%bulk &
                                        *self%b_flow*step) - self%a*c
  end function yield_at

  !> The place x of the return by Newton's method, kept between places where the sign of f differs;
  !! 1 where f is positive up to the apex.
  pure subroutine find_return(self, trial, x, iterations, good)
    class(fem_cone_type), intent(in) :: self
    type(fem_trial_type), intent(in) :: trial
    real(wp), intent(out) :: x
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp) :: low, high, f, g, slope, c, hard, growth, least
    iterations = 1
    good = .true.
    x = 1.0_wp
    if (self%yield_at(trial, x) > 0.0_wp) return
    call sizes(trial, 0.0_wp, g, slope)
    least = accuracy*(g + abs(self%b*trial%mean) + self%a*self%cohesion)
    low = 0.0_wp
    high = 1.0_wp
    x = 0.0_wp
    do iterations = 1, most_iterations
      f = self%yield_at(trial, x)
      if (abs(f) <= least .or. (x <= 0.0_wp .and. f <= 0.0_wp)) return
      if (f > 0.0_wp) low = x
      if (f < 0.0_wp) high = x
      call sizes(trial, x, g, slope)
      growth = (g + x*slope)/trial%stiff
      call self%cohesion_at(trial%z + self%a_flow*x*g/trial%stiff, c, hard)
      slope = (1.0_wp - x)*slope - g - (trial%bulk*self%b*self%b_flow &
                                        + self%a*self%a_flow*hard)*growth
      if (slope < 0.0_wp) x = x - f/slope
      if (.not. (slope < 0.0_wp .and. x > low .and. x < high)) x = 0.5_wp*(low + high)
      if (high - low <= epsilon(x)) return
    end do
    good = .false.
  end subroutine find_return
end module fem_cone
