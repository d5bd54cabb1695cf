!> Yield surfaces and plastic potentials of the micromorphic solid, in the stresses of the
!! intermediate configuration (theory: micromorphic plasticity). Surface 1 is of the macro-stress S,
!! 2 the micro-stress Sigma, 3 to 5 the slices M_IJK of the couple stress, K = 1..3. Here are the
!! types, and the cones of Drucker and Prager; other kinds are in fem_mm_caps:
!!   f = |dev| + B p - A c,  p = C:stress/3 (tension positive),  dev = stress - p C^-1.
!! Potentials are the same with the angle of dilation. A rounded cone has sqrt(dev^2 + l^2) in the
!! place of |dev|, which has a direction at the axis. Softening ends where the tip reaches p = 0.
!! A cone of the macro-pressure P has f = |dev| - l (A c + B <-P>) with a length l.
!! eq. F.13, F.48
module fem_mm_cones
  use talus_kinds, only: wp, i4
  use fem_mm_elastic, only: mm_stress_type
  use fem_mm_tensor, only: lanes
  implicit none
  private
  public :: mm_cone_type, mm_surface_type, mm_place_type, mm_turn_type, mm_rate_type
  public :: surfaces, surface_name, kind_cone, kind_ellipse, kind_breakage, open_yield
  public :: make_cone, by_macro_pressure, cone_factors, look_cone, turn_cone, stress_slice
  public :: cohesion, cohesion_slope

  integer(i4), parameter :: surfaces = 5
  integer(i4), parameter :: kind_cone = 1, kind_ellipse = 2, kind_breakage = 3
  character(len=*), parameter :: surface_name(surfaces) = [character(len=16) :: 'macro', 'micro', &
    'micro-gradient 1', 'micro-gradient 2', 'micro-gradient 3']
  real(wp), parameter :: open_yield = 1.0e100_wp  !! of a stress for which a surface has no value

  !> One surface with its potential.
  type :: mm_cone_type
    logical :: on = .false.
    integer(i4) :: kind = kind_cone
    real(wp) :: a = 0.0_wp, b = 0.0_wp            !! of a cone [-]
    real(wp) :: a_flow = 0.0_wp, b_flow = 0.0_wp  !! of its potential [-]
    real(wp) :: rounding = 0.0_wp                 !! l [Pa] or [N/m]
    real(wp) :: cohesion = 0.0_wp                 !! at the start [Pa] or [N/m]
    real(wp) :: rest = 0.0_wp                     !! least cohesion after softening
    real(wp) :: hardening = 0.0_wp                !! of the cohesion by Z [Pa] or [N]
    logical :: of_macro = .false.                 !! friction of the macro-pressure
    real(wp) :: slope = 1.0_wp                    !! M of an ellipse or of breakage [-]
    real(wp) :: slope_flow = 1.0_wp               !! M of the potential of an ellipse [-]
    real(wp) :: tension = 0.0_wp                  !! p_t [Pa]
    real(wp) :: cap = 0.0_wp                      !! p_c at the start [Pa]
    real(wp) :: exponent = 0.0_wp                 !! zeta of p_c [-]
    real(wp) :: energy = 1.0_wp                   !! E_c of breakage [J/m^3]
    real(wp) :: crush = 1.0_wp                    !! cos^2 omega of breakage [-]
  end type mm_cone_type

  !> Where a surface is looked at.
  type :: mm_place_type
    real(wp), dimension(3, 3) :: c, inverse_c, stress
    real(wp) :: strength = 0.0_wp  !! c of a cone
    real(wp) :: cap = 0.0_wp       !! p_c [Pa]
    real(wp) :: pressure = 0.0_wp  !! P = C:S/3 [Pa]
    real(wp) :: energy = 0.0_wp    !! E_B [J/m^3]
    real(wp) :: breakage = 0.0_wp  !! B
  end type mm_place_type

  !> A surface there; e = dev/root.
  type :: mm_surface_type
    real(wp) :: norm = 0.0_wp, p = 0.0_wp  !! |dev| (rounded), or the root of f; p
    real(wp) :: e(3, 3) = 0.0_wp           !! dev/|dev|, zero at the axis
    real(wp) :: t = 0.0_wp                 !! e:C^-1
    real(wp) :: root = 0.0_wp              !! what divides dev in the flow
    real(wp) :: slope = 0.0_wp             !! derivative of the potential by p
    real(wp) :: flow(3, 3) = 0.0_wp        !! derivative of the potential by the stress
    real(wp) :: yield = -1.0_wp            !! f
    real(wp) :: size = 0.0_wp              !! what f is small against
  end type mm_surface_type

  !> Derivatives of a place.
  type :: mm_turn_type
    real(wp), dimension(lanes, 3, 3) :: c, inverse_c, stress
    real(wp), dimension(lanes) :: cap = 0.0_wp, pressure = 0.0_wp, energy = 0.0_wp
    real(wp), dimension(lanes) :: breakage = 0.0_wp
  end type mm_turn_type

  !> Derivatives of the numbers of a surface: p and `along` = e:d dev make those of root, slope, f.
  type :: mm_rate_type
    real(wp), dimension(lanes) :: p, along, root, slope, yield
  end type mm_rate_type

contains

  !> A = beta cos(angle), B = beta sin(angle), beta = 2 sqrt(6)/(3 + shape sin(angle)); shape -1
  !! meets Mohr-Coulomb in triaxial compression, +1 in extension.
  pure function cone_factors(angle, shape) result(factors)
    real(wp), intent(in) :: angle  !! [rad]
    real(wp), intent(in) :: shape  !! [-]
    real(wp) :: factors(2)
    factors = 2.0_wp*sqrt(6.0_wp)/(3.0_wp + shape*sin(angle))*[cos(angle), sin(angle)]
  end function cone_factors

  !> Cone of friction and dilation [rad] with their shapes; rounding is l as a share of A c.
  pure function make_cone(angle, shape, cohesion, hardening, rounding) result(cone)
    real(wp), intent(in) :: angle(2), shape(2), cohesion, hardening, rounding
    type(mm_cone_type) :: cone
    real(wp) :: factors(2)
    factors = cone_factors(angle(1), shape(1))
    cone%a = factors(1)
    cone%b = factors(2)
    factors = cone_factors(angle(2), shape(2))
    cone%a_flow = factors(1)
    cone%b_flow = factors(2)
    cone%cohesion = cohesion
    cone%hardening = hardening
    cone%rounding = rounding*cone%a*cohesion
    cone%rest = rounding*cohesion
    cone%on = .true.
  end function make_cone

  !> c = c0 + H Z [Pa] or [N/m], not below the residual value.
  elemental real(wp) function cohesion(cone, z)
    type(mm_cone_type), intent(in) :: cone
    real(wp), intent(in) :: z
    cohesion = max(cone%rest, cone%cohesion + cone%hardening*z)
  end function cohesion

  !> Its derivative by Z.
  elemental real(wp) function cohesion_slope(cone, z)
    type(mm_cone_type), intent(in) :: cone
    real(wp), intent(in) :: z
    cohesion_slope = merge(0.0_wp, cone%hardening, cone%cohesion + cone%hardening*z < cone%rest)
  end function cohesion_slope

  !> The stress that surface k acts on.
  pure function stress_slice(stress, k) result(s)
    type(mm_stress_type), intent(in) :: stress
    integer(i4), intent(in) :: k
    real(wp) :: s(3, 3)
    if (k == 1) then
      s = stress%s
    else if (k == 2) then
      s = stress%sigma
    else
      s = stress%m(:, :, k - 2)
    end if
  end function stress_slice

  !> A cone of the macro-pressure with a length [m]: its cohesion [Pa] and friction are those of
  !! stresses, its flow is that of the couple stress alone, its Z has no unit.
  pure function by_macro_pressure(cone, length) result(other)
    type(mm_cone_type), intent(in) :: cone
    real(wp), intent(in) :: length
    type(mm_cone_type) :: other
    other = cone
    other%of_macro = .true.
    other%a = length*cone%a
    other%b = length*cone%b
    other%a_flow = length*cone%a_flow
    other%b_flow = 0.0_wp
    other%rounding = length*cone%rounding
  end function by_macro_pressure

  !> Numbers of a cone; surface has p, and dev in e.
  pure subroutine look_cone(cone, place, surface)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(inout) :: surface
    real(wp) :: p
    surface%norm = sqrt(sum(surface%e**2) + cone%rounding**2)
    surface%root = surface%norm
    if (surface%norm > 0.0_wp) surface%e = surface%e/surface%norm
    surface%slope = cone%b_flow
    p = surface%p
    if (cone%of_macro) p = min(0.0_wp, place%pressure)
    surface%yield = surface%norm + cone%b*p - cone%a*place%strength
    surface%size = surface%norm + abs(cone%b*p) + cone%a*place%strength
  end subroutine look_cone

  !> Derivatives of the numbers of a cone.
  pure subroutine turn_cone(cone, place, turn, rate)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_turn_type), intent(in) :: turn
    type(mm_rate_type), intent(inout) :: rate
    rate%root = rate%along
    rate%slope = 0.0_wp
    rate%yield = rate%along
    if (.not. cone%of_macro) then
      rate%yield = rate%along + cone%b*rate%p
    else if (place%pressure < 0.0_wp) then
      rate%yield = rate%along + cone%b*turn%pressure
    end if
  end subroutine turn_cone
end module fem_mm_cones
