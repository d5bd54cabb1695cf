!> Micropolar Drucker-Prager plasticity at small strains (theory-fem; Muehlhaus and Vardoulakis
!! 1987, de Borst 1991): linear elasticity of Eringen's moduli; yield function
!! f = q + B p - A c, p the mean stress, tension positive, with
!! q^2 = 2 (a1 s_ij s_ij + a2 s_ij s_ji + a3 m_ij m_ij/l^2), a1 + a2 = 1/2;
!! flow from q + B_psi p; c = c0 + H Z, dZ = A_psi dgamma, not below a residual one.
!!
!! Backward Euler scales each family of stresses (fem_polar) by 1/(1 + t E w), t = dgamma/q: one
!! equation for t, or for x = t E1/(1 + t E1) in 0..1, where x = 1 is the apex. It is linear, and
!! solved at once, where all products of modulus E and weight w are the same.
module fem_law_polar
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use fem_law, only: fem_law_type, common_size, at_flag, at_iterations, at_stored, at_dissipated, &
    at_numerical, at_plastic, flag_elastic, flag_yielding, flag_apex
  use fem_polar, only: polar_size, families, spread_families, family_matrix, family_squares, &
    polar_outer, polar_unit, full_of, symmetric_of
  use fem_voigt, only: unit, trace, magnitude
  implicit none
  private
  public :: fem_law_polar_type, polar_states

  integer(i4), parameter :: at_hardening = common_size + 1
  integer(i4), parameter :: at_skew = at_hardening + 1       !! plastic skew part, 23 31 12
  integer(i4), parameter :: at_curvature = at_skew + 3       !! plastic curvature, nine
  integer(i4), parameter :: polar_states = at_curvature + 8
  integer(i4), parameter :: mean_family = 3
  integer(i4), parameter :: most_iterations = 100
  real(wp), parameter :: outside = 1.0e-9_wp  !! of the strength, that an initial stress may exceed
  real(wp), parameter :: remnant = 1.0e-9_wp  !! of the elastic stiffness that is left at the apex
  real(wp), parameter :: accuracy = 1.0e-14_wp  !! of the yield function, over the trial stress
  character(len=2), parameter :: kl(9) = ['11', '12', '13', '21', '22', '23', '31', '32', '33']

  type, extends(fem_law_type) :: fem_law_polar_type
    real(wp) :: modulus_of(families) = 0.0_wp     !! elastic, of the families [Pa, N]
    real(wp) :: weight_of(families) = 0.0_wp      !! w, of the families in q^2 [-, 1/m^2]
    logical :: plastic = .true.
    real(wp) :: a = 0.0_wp, b = 0.0_wp            !! A and B of the yield function [-]
    real(wp) :: a_flow = 0.0_wp, b_flow = 0.0_wp  !! A_psi and B_psi of the flow [-]
    real(wp) :: cohesion = 0.0_wp                 !! c0 [Pa]
    real(wp) :: hardening = 0.0_wp                !! H [Pa]
    real(wp) :: residual = 0.0_wp                 !! least cohesion of softening [Pa]
  contains
    procedure :: begin
    procedure :: update
    procedure :: state_name
    procedure :: modulus
    procedure :: polar_update
    procedure, private :: cohesion_at
    procedure, private :: find_return
    procedure, private :: to_cone
    procedure, private :: to_apex
  end type fem_law_polar_type

  !> A trial stress, of which q counts.
  type :: trial_type
    real(wp) :: square(families) = 0.0_wp  !! w |sigma|^2 of the families [Pa^2]
    real(wp) :: ratio(families) = 0.0_wp   !! E w over that of the first [-]
    real(wp) :: mean = 0.0_wp              !! p [Pa]
    real(wp) :: z = 0.0_wp                 !! hardening variable at the start [-]
  end type trial_type

contains

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp) :: p, f
    state = 0.0_wp
    fault = ''
    cure = ''
    if (.not. self%plastic) return
    p = trace(stress)/3.0_wp
    f = magnitude(stress - p*unit) + self%b*p - self%a*self%cohesion
    if (f <= outside*(magnitude(stress) + self%a*self%cohesion)) return
    fault = 'the initial stress is outside the yield surface: |s| + B p - A c = '//str(f)// &
            ' Pa with |s| = '//str(magnitude(stress - p*unit))//' Pa, p = '//str(p)//' Pa'
    cure = 'raise k0 or the confining stress, or give cohesion'
  end subroutine begin

  !> Cohesion at a hardening variable, and its slope [Pa].
  pure subroutine cohesion_at(self, z, c, slope)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: z
    real(wp), intent(out) :: c, slope
    c = self%cohesion + self%hardening*z
    slope = self%hardening
    if (self%hardening >= 0.0_wp .or. c > self%residual) return
    c = self%residual
    slope = 0.0_wp
  end subroutine cohesion_at

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

  !> Stress and state after an increment of the strain and of the curvature, 18 components in all,
  !! with the tangent and the ledger of the point as `integrate` of fem_law has it.
  pure subroutine polar_update(self, strain, stress, state, tangent, good)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: strain(polar_size)
    real(wp), intent(inout) :: stress(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    logical, intent(out) :: good
    real(wp), dimension(polar_size) :: elastic, flow, new
    type(trial_type) :: trial
    real(wp) :: x, lost
    integer(i4) :: iterations
    logical :: still, yields

    still = .not. any(abs(strain) > 0.0_wp)
    elastic = stress + spread_families(self%modulus_of, strain)
    flow = 0.0_wp
    new = elastic
    good = .true.
    iterations = 0
    yields = .false.
    if (self%plastic) then
      call make_trial(self, elastic, state(at_hardening), trial)
      yields = yield_at(self, trial, 0.0_wp) > 0.0_wp .or. &
        (still .and. state(at_flag) > flag_elastic)
    end if
    if (yields) then
      call self%find_return(trial, x, iterations, good)
      if (.not. good) return
      if (x < 1.0_wp) then
        call self%to_cone(trial, elastic, x, new, flow, state, tangent)
      else
        call self%to_apex(trial, elastic, new, flow, state, tangent)
      end if
    else
      tangent = family_matrix(self%modulus_of)
      state(at_flag) = flag_elastic
    end if
    state(at_iterations) = real(iterations, wp)
    call keep_flow(flow, state)
    lost = sum(new*flow)
    state(at_stored) = state(at_stored) + 0.5_wp*sum((stress + new)*(strain - flow))
    state(at_dissipated) = state(at_dissipated) + lost
    state(at_numerical) = state(at_numerical) + 0.5_wp*sum((stress + new)*flow) - lost
    stress = new
  end subroutine polar_update

  pure subroutine make_trial(self, stress, z, trial)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: stress(polar_size), z
    type(trial_type), intent(out) :: trial
    trial%square = self%weight_of*family_squares(stress)
    trial%ratio = self%modulus_of*self%weight_of/self%modulus_of(1)
    trial%mean = sum(stress*polar_unit)/3.0_wp
    trial%z = z
  end subroutine make_trial

  !> q = (1 - x) g, and dgamma = x g/E1, at a place of the return; g' is `slope`.
  pure subroutine sizes(trial, x, g, slope)
    type(trial_type), intent(in) :: trial
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
    class(fem_law_polar_type), intent(in) :: self
    type(trial_type), intent(in) :: trial
    real(wp), intent(in) :: x
    real(wp) :: g, slope, step, c
    call sizes(trial, x, g, slope)
    step = x*g/self%modulus_of(1)
    call self%cohesion_at(trial%z + self%a_flow*step, c, slope)
    yield_at = (1.0_wp - x)*g + self%b*(trial%mean - self%modulus_of(mean_family)/3.0_wp &
                                        *self%b_flow*step) - self%a*c
  end function yield_at

  !> The place x of the return by Newton's method, kept between places where the sign of f differs;
  !! 1 where f is positive up to the apex.
  pure subroutine find_return(self, trial, x, iterations, good)
    class(fem_law_polar_type), intent(in) :: self
    type(trial_type), intent(in) :: trial
    real(wp), intent(out) :: x
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp) :: low, high, f, g, slope, c, hard, growth, least
    iterations = 1
    good = .true.
    x = 1.0_wp
    if (yield_at(self, trial, x) > 0.0_wp) return
    call sizes(trial, 0.0_wp, g, slope)
    least = accuracy*(g + abs(self%b*trial%mean) + self%a*self%cohesion)
    low = 0.0_wp
    high = 1.0_wp
    x = 0.0_wp
    do iterations = 1, most_iterations
      f = yield_at(self, trial, x)
      if (abs(f) <= least .or. (x <= 0.0_wp .and. f <= 0.0_wp)) return
      if (f > 0.0_wp) low = x
      if (f < 0.0_wp) high = x
      call sizes(trial, x, g, slope)
      growth = (g + x*slope)/self%modulus_of(1)
      call self%cohesion_at(trial%z + self%a_flow*x*g/self%modulus_of(1), c, hard)
      slope = (1.0_wp - x)*slope - g - (self%modulus_of(mean_family)/3.0_wp*self%b*self%b_flow &
                                        + self%a*self%a_flow*hard)*growth
      if (slope < 0.0_wp) x = x - f/slope
      if (.not. (slope < 0.0_wp .and. x > low .and. x < high)) x = 0.5_wp*(low + high)
      if (high - low <= epsilon(x)) return
    end do
    good = .false.
  end subroutine find_return

  !> Stress, flow and tangent of a return to the cone.
  pure subroutine to_cone(self, trial, elastic, x, new, flow, state, tangent)
    class(fem_law_polar_type), intent(in) :: self
    type(trial_type), intent(in) :: trial
    real(wp), intent(in) :: elastic(polar_size), x
    real(wp), intent(out) :: new(polar_size), flow(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    real(wp) :: left(families), n(polar_size), v(polar_size), rate(polar_size)
    real(wp) :: q, t, q_rate, bulk, c, slope, hard, step
    bulk = self%modulus_of(mean_family)/3.0_wp
    t = x/(self%modulus_of(1)*(1.0_wp - x))
    left = (1.0_wp - x)/(1.0_wp + x*(trial%ratio - 1.0_wp))
    left(mean_family) = 1.0_wp
    new = spread_families(left, elastic)
    q = sqrt(sum(trial%square*left**2))
    step = t*q
    n = spread_families(self%weight_of, new)/q
    call self%cohesion_at(trial%z + self%a_flow*step, c, slope)
    hard = bulk*self%b*self%b_flow + self%a*self%a_flow*slope
    ! slopes of q by the strain (v) and by t, then those of t by the strain (rate)
    v = spread_families(self%modulus_of*left, n)
    q_rate = -sum(self%modulus_of*self%weight_of*trial%square*left**3)/q
    rate = ((1.0_wp - hard*t)*v + self%b*bulk*polar_unit)/(hard*q - (1.0_wp - hard*t)*q_rate)
    tangent = family_matrix(self%modulus_of*left) - polar_outer(q*v, rate) &
      - polar_outer(bulk*self%b_flow*polar_unit, t*v + (q + t*q_rate)*rate)
    new = new - bulk*self%b_flow*step*polar_unit
    flow = step*(n + self%b_flow/3.0_wp*polar_unit)
    state(at_hardening) = trial%z + self%a_flow*step
    state(at_flag) = flag_yielding
  end subroutine to_cone

  !> Stress, flow and tangent of a return to the apex: what has a weight vanishes.
  pure subroutine to_apex(self, trial, elastic, new, flow, state, tangent)
    class(fem_law_polar_type), intent(in) :: self
    type(trial_type), intent(in) :: trial
    real(wp), intent(in) :: elastic(polar_size)
    real(wp), intent(out) :: new(polar_size), flow(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    real(wp) :: c, slope, share, rate, grown, bulk, left(families), soft(families)
    integer(i4) :: k

    bulk = self%modulus_of(mean_family)/3.0_wp
    call self%cohesion_at(trial%z, c, slope)
    share = 0.0_wp
    if (self%b_flow > 0.0_wp) share = self%a_flow/self%b_flow
    rate = huge(1.0_wp)
    grown = 0.0_wp
    do k = 1, 2
      if (.not. self%b > 0.0_wp) exit  ! no friction: the mean stress does not count
      rate = bulk + self%a/self%b*share*slope
      grown = max(0.0_wp, (trial%mean - self%a/self%b*c)/rate)
      if (slope >= 0.0_wp .or. c + slope*share*grown >= self%residual) exit
      c = self%residual
      slope = 0.0_wp
    end do
    left = merge(0.0_wp, 1.0_wp, self%weight_of > 0.0_wp)
    new = spread_families(left, elastic) - bulk*grown*polar_unit
    soft = merge(1.0_wp/max(self%modulus_of, tiny(1.0_wp)), 0.0_wp, self%weight_of > 0.0_wp .and. &
                 self%modulus_of > 0.0_wp)
    flow = spread_families(soft, elastic) + grown/3.0_wp*polar_unit
    left = self%modulus_of*max(left, remnant)
    left(mean_family) = 3.0_wp*bulk*(1.0_wp - bulk/rate + remnant)
    tangent = family_matrix(left)
    state(at_hardening) = trial%z + share*grown
    state(at_flag) = flag_apex
  end subroutine to_apex

  !> Plastic strain: the symmetric part among the common states (engineering shears), then the skew
  !! part and the curvature.
  pure subroutine keep_flow(flow, state)
    real(wp), intent(in) :: flow(polar_size)
    real(wp), intent(inout) :: state(:)
    integer(i4), parameter :: first(3) = [6, 7, 2], second(3) = [8, 3, 4]
    state(at_plastic:at_plastic + 2) = state(at_plastic:at_plastic + 2) + flow([1, 5, 9])
    state(at_plastic + 3:at_plastic + 5) = state(at_plastic + 3:at_plastic + 5) &
      + flow([2, 6, 3]) + flow([4, 8, 7])
    state(at_skew:at_skew + 2) = state(at_skew:at_skew + 2) + 0.5_wp*(flow(first) - flow(second))
    state(at_curvature:at_curvature + 8) = state(at_curvature:at_curvature + 8) + flow(10:)
  end subroutine keep_flow

  pure function state_name(self, k) result(name)
    class(fem_law_polar_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: name
    character(len=2), parameter :: skew(3) = ['23', '31', '12']
    if (k == at_hardening) then
      name = 'hardening [-]'
    else if (k < at_curvature) then
      name = 'plastic_skew_'//skew(k - at_skew + 1)//' [-]'
    else
      name = 'plastic_curvature_'//kl(k - at_curvature + 1)//' [1/m]'
    end if
  end function state_name

  pure function modulus(self, stress) result(moduli)
    class(fem_law_polar_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%modulus_of(mean_family)/3.0_wp, 0.5_wp*self%modulus_of(1)]
  end function modulus
end module fem_law_polar
