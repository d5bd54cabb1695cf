!> Micropolar Drucker-Prager plasticity at small strains, `micropolar_drucker_prager` (formulation
!! A3; Muehlhaus and Vardoulakis 1987, de Borst 1991): linear elasticity of Eringen's moduli and the
!! cone of fem_cone with
!! q^2 = 2 (a1 s_ij s_ij + a2 s_ij s_ji + a3 m_ij m_ij/l^2), a1 + a2 = 1/2.
module fem_law_polar_drucker
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_cone, only: fem_cone_type, fem_trial_type, remnant
  use fem_law, only: common_size, at_flag, at_iterations, at_plastic, flag_elastic, &
    flag_yielding, flag_apex
  use fem_law_polar, only: fem_law_polar_type, count_polar_work, mean_family
  use fem_polar, only: polar_size, families, spread_families, family_matrix, family_squares, &
    polar_outer, polar_unit
  implicit none
  private
  public :: fem_law_polar_drucker_type, polar_states

  integer(i4), parameter :: at_hardening = common_size + 1
  integer(i4), parameter :: at_skew = at_hardening + 1       !! plastic skew part, 23 31 12
  integer(i4), parameter :: at_curvature = at_skew + 3       !! plastic curvature, nine
  integer(i4), parameter :: polar_states = at_curvature + 8
  real(wp), parameter :: round_off = 1.0e-12_wp

  type, extends(fem_law_polar_type) :: fem_law_polar_drucker_type
    real(wp) :: weight_of(families) = 0.0_wp     !! w, of the families in q^2 [-, 1/m^2]
    type(fem_cone_type) :: cone
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: begin
    procedure :: polar_update
    procedure, private :: trial_of
    procedure, private :: to_cone
    procedure, private :: to_apex
  end type fem_law_polar_drucker_type

contains

  subroutine define(self)
    class(fem_law_polar_drucker_type), intent(inout) :: self
    self%name = 'micropolar_drucker_prager'
    self%polar = .true.
    self%eringen = .true.
    call self%add_states([character(len=28) :: 'hardening [-]', 'plastic_skew_23 [-]', &
      'plastic_skew_31 [-]', 'plastic_skew_12 [-]', 'plastic_curvature_11 [1/m]', &
      'plastic_curvature_12 [1/m]', 'plastic_curvature_13 [1/m]', 'plastic_curvature_21 [1/m]', &
      'plastic_curvature_22 [1/m]', 'plastic_curvature_23 [1/m]', 'plastic_curvature_31 [1/m]', &
      'plastic_curvature_32 [1/m]', 'plastic_curvature_33 [1/m]'])
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_polar_drucker_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: share(:)
    real(wp) :: length
    integer(i4) :: before

    before = errors%count
    call self%read_eringen(deck, m, errors)
    if (errors%count > before) return
    call deck%get('material', m, 'plastic_length', length)
    call deck%get('material', m, 'invariant', share)
    if (abs(share(1) + share(2) - 0.5_wp) > round_off .or. share(2) > share(1) + round_off .or. &
        share(3) < 0.0_wp) call deck%fault(errors, 'D331', 'invariant = '//str(share(1))//', '// &
      str(share(2))//', '//str(share(3))//' is no measure of shear', 'material', m, &
      'invariant', 'a1 + a2 = 1/2 leaves classical states as they are, and a1 >= a2, a3 >= 0')
    self%weight_of = [1.0_wp, 2.0_wp*max(0.0_wp, share(1) - share(2)), 0.0_wp, &
                      2.0_wp*share(3)/length**2*[1.0_wp, 1.0_wp, 1.0_wp]]
    call self%cone%read(deck, m, self%modulus_of(1), self%modulus_of(mean_family)/3.0_wp, errors)
    self%symmetric = self%cone%associated_flow()
  end subroutine read_constants

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_polar_drucker_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    state = 0.0_wp
    call self%cone%check_start(stress, fault, cure)
  end subroutine begin

  pure subroutine polar_update(self, strain, stress, state, tangent, good)
    class(fem_law_polar_drucker_type), intent(in) :: self
    real(wp), intent(in) :: strain(polar_size)
    real(wp), intent(inout) :: stress(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    logical, intent(out) :: good
    real(wp), dimension(polar_size) :: elastic, flow, new
    type(fem_trial_type) :: trial
    real(wp) :: x
    integer(i4) :: iterations
    logical :: still, yields

    still = .not. any(abs(strain) > 0.0_wp)
    elastic = stress + spread_families(self%modulus_of, strain)
    flow = 0.0_wp
    new = elastic
    good = .true.
    iterations = 0
    trial = self%trial_of(elastic, state(at_hardening))
    yields = self%cone%yield_at(trial, 0.0_wp) > 0.0_wp .or. &
      (still .and. state(at_flag) > flag_elastic)
    if (yields) then
      call self%cone%find_return(trial, x, iterations, good)
      if (.not. good) return
      trial%x = x
      if (x < 1.0_wp) then
        call self%to_cone(trial, elastic, new, flow, state, tangent)
      else
        call self%to_apex(trial, elastic, new, flow, state, tangent)
      end if
    else
      tangent = family_matrix(self%modulus_of)
      state(at_flag) = flag_elastic
    end if
    state(at_iterations) = real(iterations, wp)
    call keep_flow(flow, state)
    call count_polar_work(strain, flow, stress, new, state)
    stress = new
  end subroutine polar_update

  pure function trial_of(self, stress, z) result(trial)
    class(fem_law_polar_drucker_type), intent(in) :: self
    real(wp), intent(in) :: stress(polar_size), z
    type(fem_trial_type) :: trial
    trial%stiff = self%modulus_of(1)
    trial%bulk = self%modulus_of(mean_family)/3.0_wp
    trial%square = self%weight_of*family_squares(stress)
    trial%ratio = self%modulus_of*self%weight_of/self%modulus_of(1)
    trial%mean = sum(stress*polar_unit)/3.0_wp
    trial%z = z
  end function trial_of

  !> Stress, flow and tangent of a return to the cone.
  pure subroutine to_cone(self, trial, elastic, new, flow, state, tangent)
    class(fem_law_polar_drucker_type), intent(in) :: self
    type(fem_trial_type), intent(in) :: trial
    real(wp), intent(in) :: elastic(polar_size)
    real(wp), intent(out) :: new(polar_size), flow(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    real(wp) :: left(families), n(polar_size), v(polar_size), rate(polar_size)
    real(wp) :: x, q, t, q_rate, bulk, c, slope, hard, step
    bulk = trial%bulk
    x = trial%x
    t = x/(self%modulus_of(1)*(1.0_wp - x))
    left = (1.0_wp - x)/(1.0_wp + x*(trial%ratio - 1.0_wp))
    left(mean_family) = 1.0_wp
    new = spread_families(left, elastic)
    q = sqrt(sum(trial%square*left**2))
    step = t*q
    n = spread_families(self%weight_of, new)/q
    call self%cone%cohesion_at(trial%z + self%cone%a_flow*step, c, slope)
    hard = bulk*self%cone%b*self%cone%b_flow + self%cone%a*self%cone%a_flow*slope
    ! slopes of q by the strain (v) and by t, then those of t by the strain (rate)
    v = spread_families(self%modulus_of*left, n)
    q_rate = -sum(self%modulus_of*self%weight_of*trial%square*left**3)/q
    rate = ((1.0_wp - hard*t)*v + self%cone%b*bulk*polar_unit)/(hard*q - (1.0_wp - hard*t)*q_rate)
    tangent = family_matrix(self%modulus_of*left) - polar_outer(q*v, rate) &
      - polar_outer(bulk*self%cone%b_flow*polar_unit, t*v + (q + t*q_rate)*rate)
    new = new - bulk*self%cone%b_flow*step*polar_unit
    flow = step*(n + self%cone%b_flow/3.0_wp*polar_unit)
    state(at_hardening) = trial%z + self%cone%a_flow*step
    state(at_flag) = flag_yielding
  end subroutine to_cone

  !> Stress, flow and tangent of a return to the apex: what has a weight vanishes.
  pure subroutine to_apex(self, trial, elastic, new, flow, state, tangent)
    class(fem_law_polar_drucker_type), intent(in) :: self
    type(fem_trial_type), intent(in) :: trial
    real(wp), intent(in) :: elastic(polar_size)
    real(wp), intent(out) :: new(polar_size), flow(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    real(wp) :: rate, grown, growth, bulk, left(families), soft(families)

    bulk = trial%bulk
    call self%cone%apex_step(trial%mean, trial%z, bulk, grown, growth, rate)
    left = merge(0.0_wp, 1.0_wp, self%weight_of > 0.0_wp)
    new = spread_families(left, elastic) - bulk*grown*polar_unit
    soft = merge(1.0_wp/max(self%modulus_of, tiny(1.0_wp)), 0.0_wp, self%weight_of > 0.0_wp .and. &
                 self%modulus_of > 0.0_wp)
    flow = spread_families(soft, elastic) + grown/3.0_wp*polar_unit
    left = self%modulus_of*max(left, remnant)
    left(mean_family) = 3.0_wp*bulk*(1.0_wp - bulk/rate + remnant)
    tangent = family_matrix(left)
    state(at_hardening) = trial%z + growth
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
end module fem_law_polar_drucker
