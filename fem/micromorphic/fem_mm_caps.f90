!> Closed yield surfaces of the micromorphic solid (theory: micromorphic plasticity), tension
!! positive. The ellipse, cone and cap in one,
!!   f = sqrt(|dev|^2 + M^2 (p - p_o)^2) - M R,  R = (p_c + p_t)/2,  p_o = (p_t - p_c)/2,
!! flows from the like with another M, and hardens with the plastic volume: p_c falls as
!! (det Fp)^-zeta. The surface of breakage B, energy E_B of the grains' strains over E_c,
!!   f = sqrt((1 - B)^2 E_B/E_c + |dev|^2/(M (p - p_t))^2) - 1,
!! has no value at p >= p_t.
!! eq. F.47, F.49 and F.50
module fem_mm_caps
  use talus_kinds, only: wp
  use fem_mm_cones, only: mm_cone_type, mm_place_type, mm_surface_type, mm_turn_type, &
    mm_rate_type, kind_ellipse, kind_breakage, open_yield
  implicit none
  private
  public :: make_ellipse, look_ellipse, turn_ellipse
  public :: make_breakage, look_breakage, turn_breakage, breakage_after, moments

  real(wp), parameter :: least_left = 0.5_wp  !! of 1/(1 - B) that an iterate may have

contains

  !> Ellipse of slopes M and M_g in |dev| over p, pressures [Pa], and the exponent of hardening.
  pure function make_ellipse(slope, slope_flow, cap, tension, exponent) result(cone)
    real(wp), intent(in) :: slope, slope_flow, cap, tension, exponent
    type(mm_cone_type) :: cone
    cone%on = .true.
    cone%kind = kind_ellipse
    cone%slope = slope
    cone%slope_flow = slope_flow
    cone%cap = cap
    cone%tension = tension
    cone%exponent = exponent
  end function make_ellipse

  !> Numbers of an ellipse; surface has p, and dev in e.
  pure subroutine look_ellipse(cone, place, surface)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(inout) :: surface
    real(wp) :: square, off, radius
    square = sum(surface%e**2)
    off = surface%p - 0.5_wp*(cone%tension - place%cap)
    radius = 0.5_wp*cone%slope*(place%cap + cone%tension)
    surface%norm = sqrt(square + (cone%slope*off)**2)
    surface%root = sqrt(square + (cone%slope_flow*off)**2)
    surface%slope = 0.0_wp
    if (surface%root > 0.0_wp) then
      surface%e = surface%e/surface%root
      surface%slope = cone%slope_flow**2*off/surface%root
    end if
    surface%yield = surface%norm - radius
    surface%size = surface%norm + radius
  end subroutine look_ellipse

  !> Derivatives of the numbers of an ellipse.
  pure subroutine turn_ellipse(cone, place, surface, turn, rate)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(in) :: surface
    type(mm_turn_type), intent(in) :: turn
    type(mm_rate_type), intent(inout) :: rate
    rate%root = rate%along + surface%slope*(rate%p + 0.5_wp*turn%cap)
    rate%slope = (cone%slope_flow**2*(rate%p + 0.5_wp*turn%cap) - surface%slope*rate%root) &
      /surface%root
    rate%yield = (surface%root*rate%along + cone%slope**2*(surface%p - 0.5_wp*(cone%tension &
      - place%cap))*(rate%p + 0.5_wp*turn%cap))/surface%norm - 0.5_wp*cone%slope*turn%cap
  end subroutine turn_ellipse

  !> Surface of breakage: M in |dev| over p, E_c [J/m^3], omega [rad], p_t [Pa].
  pure function make_breakage(slope, energy, angle, tension) result(cone)
    real(wp), intent(in) :: slope, energy, angle, tension
    type(mm_cone_type) :: cone
    cone%on = .true.
    cone%kind = kind_breakage
    cone%slope = slope
    cone%energy = energy
    cone%crush = cos(angle)**2
    cone%tension = tension
  end function make_breakage

  !> theta of the moments 2, 4 and 5 of the ultimate grading: strains, gradients, micro-inertia.
  pure function moments(ratio, dimension_of) result(theta)
    real(wp), intent(in) :: ratio         !! smallest over largest size, that of the start
    real(wp), intent(in) :: dimension_of  !! D
    real(wp) :: theta(3)
    real(wp), parameter :: power(3) = [2.0_wp, 4.0_wp, 5.0_wp]
    real(wp) :: low
    low = 3.0_wp - dimension_of
    theta = 1.0_wp - low/(low + power)*(1.0_wp - ratio**(low + power))/(1.0_wp - ratio**low)
  end function moments

  !> B after a multiplier, exactly, and its slopes by the multiplier and by B before.
  pure subroutine breakage_after(cone, before, gamma, b, by_gamma, by_before)
    type(mm_cone_type), intent(in) :: cone
    real(wp), intent(in) :: before, gamma  !! [-], [J/m^3]
    real(wp), intent(out) :: b, by_gamma, by_before
    real(wp) :: grown
    grown = max(1.0_wp + 2.0_wp*cone%crush*gamma/cone%energy*(1.0_wp - before), least_left)
    b = before + (1.0_wp - before)*(1.0_wp - 1.0_wp/grown)
    by_gamma = 2.0_wp*cone%crush*(1.0_wp - b)**2/cone%energy
    by_before = 1.0_wp/grown**2
  end subroutine breakage_after

  !> Numbers of a surface of breakage; surface has p, and dev in e. Without stress f = -1.
  pure subroutine look_breakage(cone, place, surface)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(inout) :: surface
    real(wp) :: p, square, grow
    p = surface%p - cone%tension
    square = sum(surface%e**2)
    surface%size = 1.0_wp
    if (.not. p < 0.0_wp) then
      surface%yield = merge(open_yield, -1.0_wp, square + place%energy + p > 0.0_wp)
      surface%norm = 1.0_wp
      surface%root = 1.0_wp
      surface%slope = 0.0_wp
      return
    end if
    grow = (1.0_wp - place%breakage)**2*place%energy/cone%energy
    surface%norm = sqrt(max(grow + square/(cone%slope*p)**2, 0.0_wp))
    surface%root = 0.5_wp*(cone%slope*p)**2
    surface%slope = 2.0_wp*(1.0_wp - cone%crush)*grow/p
    surface%e = surface%e/surface%root
    surface%yield = surface%norm - 1.0_wp
  end subroutine look_breakage

  !> Derivatives of the numbers of a surface of breakage.
  pure subroutine turn_breakage(cone, place, surface, turn, rate)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(in) :: surface
    type(mm_turn_type), intent(in) :: turn
    type(mm_rate_type), intent(inout) :: rate
    real(wp) :: grow(size(turn%energy)), p, friction
    p = surface%p - cone%tension
    grow = (1.0_wp - place%breakage)/cone%energy &
      *((1.0_wp - place%breakage)*turn%energy - 2.0_wp*place%energy*turn%breakage)
    friction = 2.0_wp*sum(surface%e**2)*(surface%root/(cone%slope*p))**2
    rate%root = cone%slope**2*p*rate%p
    rate%slope = (2.0_wp*(1.0_wp - cone%crush)*grow - surface%slope*rate%p)/p
    rate%yield = 0.5_wp*(grow + rate%along - friction*rate%p/p)/surface%norm
  end subroutine turn_breakage
end module fem_mm_caps
