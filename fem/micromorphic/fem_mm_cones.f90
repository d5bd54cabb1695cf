!> Yield surfaces and plastic potentials of the micromorphic solid: Drucker-Prager cones in the
!! stresses of the intermediate configuration (theory: micromorphic plasticity). Surface 1 is of the
!! macro-stress S, 2 the micro-stress Sigma, 3 to 5 the slices M_IJK of the couple stress, K = 1..3:
!!   f = |dev| + B p - A c,  p = C:stress/3 (tension positive),  dev = stress - p C^-1.
!! Potentials are the same with the angle of dilation. A rounded cone has sqrt(dev^2 + l^2) in the
!! place of |dev|, which has a direction at the axis. Softening ends where the tip reaches p = 0.
!! eq. F.13
module fem_mm_cones
  use talus_kinds, only: wp, i4
  use fem_mm_elastic, only: mm_stress_type, mm_stress_d_type
  use fem_mm_tensor, only: lanes
  implicit none
  private
  public :: mm_cone_type, mm_surface_type, surfaces, surface_name
  public :: make_cone, cone_factors, surface_of, stress_slice, turn_surface
  public :: cohesion, cohesion_slope

  integer(i4), parameter :: surfaces = 5
  character(len=*), parameter :: surface_name(surfaces) = [character(len=16) :: 'macro', 'micro', &
    'micro-gradient 1', 'micro-gradient 2', 'micro-gradient 3']

  real(wp), parameter :: least = 1.0e-60_wp  !! |dev| that is divided by, at the axis

  !> One surface with its potential.
  type :: mm_cone_type
    logical :: on = .false.
    real(wp) :: a = 0.0_wp, b = 0.0_wp            !! of the surface [-]
    real(wp) :: a_flow = 0.0_wp, b_flow = 0.0_wp  !! of the potential [-]
    real(wp) :: rounding = 0.0_wp                 !! l [Pa] or [N/m]
    real(wp) :: cohesion = 0.0_wp                 !! at the start [Pa] or [N/m]
    real(wp) :: rest = 0.0_wp                     !! least cohesion after softening
    real(wp) :: hardening = 0.0_wp                !! of the cohesion by Z [Pa] or [N]
  end type mm_cone_type

  !> A surface at one stress.
  type :: mm_surface_type
    real(wp) :: norm = 0.0_wp, p = 0.0_wp  !! |dev| (rounded), p
    real(wp) :: e(3, 3) = 0.0_wp           !! dev/|dev|, zero at the axis
    real(wp) :: t = 0.0_wp                 !! e:C^-1
    real(wp) :: flow(3, 3) = 0.0_wp        !! derivative of the potential by the stress
  end type mm_surface_type

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

  !> The surface at stress s, with C and its inverse.
  pure function surface_of(cone, s, c, inverse_c) result(surface)
    type(mm_cone_type), intent(in) :: cone
    real(wp), intent(in) :: s(3, 3), c(3, 3), inverse_c(3, 3)
    type(mm_surface_type) :: surface
    surface%p = sum(c*s)/3.0_wp
    surface%e = s - surface%p*inverse_c
    surface%norm = sqrt(sum(surface%e**2) + cone%rounding**2)
    if (surface%norm > 0.0_wp) surface%e = surface%e/surface%norm
    surface%t = sum(surface%e*inverse_c)
    surface%flow = surface%e + (cone%b_flow - surface%t)/3.0_wp*c
  end function surface_of

  !> Derivatives of |dev| + b p (df) and of the flow (dn) of surface k.
  !! around = C, C^-1 and the stress of the surface; moved = derivatives of C and of C^-1.
  pure subroutine turn_surface(cone, surface, around, moved, ds, df, dn)
    type(mm_cone_type), intent(in) :: cone
    type(mm_surface_type), intent(in) :: surface
    real(wp), intent(in) :: around(3, 3, 3)
    real(wp), intent(in) :: moved(lanes, 3, 3, 2), ds(lanes, 3, 3)
    real(wp), intent(out) :: df(lanes), dn(lanes, 3, 3)
    real(wp), dimension(lanes) :: dp, d_norm, dt
    integer(i4) :: i, j

    dp = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        dp = dp + moved(:, i, j, 1)*around(i, j, 3) + around(i, j, 1)*ds(:, i, j)
      end do
    end do
    dp = dp/3.0_wp
    d_norm = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        dn(:, i, j) = ds(:, i, j) - dp*around(i, j, 2) - surface%p*moved(:, i, j, 2)
        d_norm = d_norm + surface%e(i, j)*dn(:, i, j)
      end do
    end do
    dt = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        dn(:, i, j) = (dn(:, i, j) - surface%e(i, j)*d_norm)/max(surface%norm, least)
        dt = dt + dn(:, i, j)*around(i, j, 2) + surface%e(i, j)*moved(:, i, j, 2)
      end do
    end do
    do j = 1, 3
      do i = 1, 3
        dn(:, i, j) = dn(:, i, j) + (cone%b_flow - surface%t)/3.0_wp*moved(:, i, j, 1) &
          - around(i, j, 1)/3.0_wp*dt
      end do
    end do
    df = d_norm + cone%b*dp
  end subroutine turn_surface
end module fem_mm_cones
