!> Equations of `sanisand`, the critical-state sand of Dafalias and Manzari (2004): constants,
!! elastic path, yield surface, flow and rates (theory-fem, Laws with a state). Compression
!! positive, six components with tensor shears; the pressure holds the residual one already.
!! eq. F.41, F.42
module fem_sanisand
  use talus_kinds, only: wp, i4
  use fem_voigt, only: unit, twice, trace, magnitude, elastic_matrix, outer
  implicit none
  private
  public :: sand_type, sand_flow_type, elastic_path, yield_ratio, flow_at, rates, continuum
  public :: critical_void, bulk_and_shear, bounding, lode, growth, start_hardening
  public :: at_stress, at_alpha, at_fabric, at_void, at_flow, sand_size

  !> Places in the vector of a point.
  integer(i4), parameter :: at_stress = 1  !! six components [Pa]
  integer(i4), parameter :: at_alpha = 7   !! back-stress ratio
  integer(i4), parameter :: at_fabric = 13 !! fabric dilatancy z
  integer(i4), parameter :: at_void = 19   !! void ratio e
  integer(i4), parameter :: at_flow = 20   !! plastic strain
  integer(i4), parameter :: sand_size = 25

  real(wp), parameter :: root_2_3 = sqrt(2.0_wp/3.0_wp)
  real(wp), parameter :: void_limit = 2.97_wp  !! of the stiffness of sands with angular grains
  real(wp), parameter :: least_hardening = 1.0e-3_wp  !! of 1 - c_h e

  type :: sand_type
    real(wp) :: shear = 0.0_wp           !! G0 [-]
    real(wp) :: ratio = 1.0_wp           !! bulk over shear modulus [-]
    real(wp) :: slope = 0.0_wp           !! M in compression [-]
    real(wp) :: extension = 1.0_wp       !! c, slope in extension over M [-]
    real(wp) :: line_void = 0.0_wp       !! e0 of the critical state line [-]
    real(wp) :: line_slope = 0.0_wp      !! lambda_c [-]
    real(wp) :: line_exponent = 0.7_wp   !! xi [-]
    real(wp) :: opening = 0.01_wp        !! m [-]
    real(wp) :: hardening = 0.0_wp       !! h0 [-]
    real(wp) :: hardening_void = 0.0_wp  !! c_h [-]
    real(wp) :: bounding_rate = 0.0_wp   !! n^b [-]
    real(wp) :: dilatancy = 0.0_wp       !! A0 [-]
    real(wp) :: dilatancy_rate = 0.0_wp  !! n^d [-]
    real(wp) :: fabric_limit = 0.0_wp    !! z_max [-]
    real(wp) :: fabric_rate = 0.0_wp     !! c_z [-]
    real(wp) :: atmosphere = 101.0e3_wp  !! p_at [Pa]
    real(wp) :: residual = 0.0_wp        !! p_r [Pa]
    real(wp) :: least = 0.0_wp           !! pressure, with p_r, at which a point is held [Pa]
  end type sand_type

  !> Direction of loading and of flow at a point.
  type :: sand_flow_type
    real(wp) :: p, bulk, shear    !! [Pa]
    real(wp) :: n(6)              !! of loading, unit deviator
    real(wp) :: along             !! n:r
    real(wp) :: to_bound(6)       !! alpha^b - alpha
    real(wp) :: flow(6)           !! deviator of R
    real(wp) :: spread            !! largest slope of the flow's deviator by n
    real(wp) :: dilation          !! D
    real(wp) :: softness          !! 1/h [-]
    real(wp) :: resistance        !! K_p/h + (1/h) (2G (B - C tr n^3) - K D n:r) [Pa]
  end type sand_flow_type

contains

  !> Void ratio of the critical state at a pressure.
  pure real(wp) function critical_void(sand, p)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: p  !! [Pa]
    critical_void = sand%line_void - sand%line_slope*(p/sand%atmosphere)**sand%line_exponent
  end function critical_void

  !> Shear modulus over the root of the pressure, at a void ratio [Pa^(1/2)].
  pure real(wp) function stiffness(sand, void)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: void
    stiffness = sand%shear*sqrt(sand%atmosphere)*max(void_limit - void, 0.0_wp)**2/(1.0_wp + void)
  end function stiffness

  !> Bulk and shear modulus [Pa].
  pure function bulk_and_shear(sand, p, void) result(moduli)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: p, void
    real(wp) :: moduli(2)
    moduli = stiffness(sand, void)*sqrt(p)*[sand%ratio, 1.0_wp]
  end function bulk_and_shear

  !> Stress and void ratio after an elastic strain, in closed form along a straight path but for the
  !! mean of the stiffness over the void ratio (Gauss); `fall` is the root of the pressure, negative
  !! where it would be below zero.
  pure subroutine elastic_path(sand, strain, before, after, fall)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6), before(sand_size)
    real(wp), intent(out) :: after(sand_size), fall
    real(wp), parameter :: place(3) = 0.5_wp + sqrt(0.15_wp)*[-1.0_wp, 0.0_wp, 1.0_wp]
    real(wp), parameter :: weight(3) = [5.0_wp, 8.0_wp, 5.0_wp]/18.0_wp
    real(wp) :: v, mean, root, bulk
    integer(i4) :: k
    v = trace(strain)
    mean = 0.0_wp
    do k = 1, 3
      mean = mean + sand%ratio*weight(k)*stiffness(sand, void_after(before(at_void), place(k)*v))
    end do
    root = sqrt(max(trace(before(:6))/3.0_wp, 0.0_wp))
    fall = root + 0.5_wp*mean*v
    bulk = mean*(root + 0.25_wp*mean*v)
    after = before
    after(:6) = before(:6) + bulk*(v*unit + 2.0_wp/sand%ratio*(strain - v/3.0_wp*unit))
    after(at_void) = void_after(before(at_void), v)
  end subroutine elastic_path

  !> Void ratio after a volumetric compression.
  pure real(wp) function void_after(void, v)
    real(wp), intent(in) :: void, v
    void_after = (1.0_wp + void)*exp(-v) - 1.0_wp
  end function void_after

  !> Yield function over the pressure: negative inside.
  pure real(wp) function yield_ratio(sand, y)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: y(sand_size)
    real(wp) :: p
    p = trace(y(:6))/3.0_wp
    yield_ratio = magnitude(y(:6)/p - unit - y(at_alpha:at_alpha + 5)) - root_2_3*sand%opening
  end function yield_ratio

  !> Lode's factor g and cos 3 theta of a unit deviator.
  pure subroutine lode(sand, n, g, cosine)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: n(6)
    real(wp), intent(out) :: g, cosine
    cosine = min(1.0_wp, max(-1.0_wp, sqrt(6.0_wp)*sum(twice*n*squared(n))))
    g = 2.0_wp*sand%extension/(1.0_wp + sand%extension - (1.0_wp - sand%extension)*cosine)
  end subroutine lode

  !> Size of the back-stress ratio on the bounding surface, in a direction of factor g.
  pure real(wp) function bounding(sand, g, psi)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: g, psi
    bounding = root_2_3*(g*sand%slope*growth(-sand%bounding_rate*psi) - sand%opening)
  end function bounding

  !> exp(x), bounded so that trials of sub-steps that are too long stay numbers.
  pure real(wp) function growth(x)
    real(wp), intent(in) :: x
    real(wp), parameter :: bound = 50.0_wp
    growth = exp(min(x, bound))
  end function growth

  !> b0, hardening times the way from where the loading began [-].
  pure real(wp) function start_hardening(sand, p, void)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: p, void
    start_hardening = sand%shear*sand%hardening*max(1.0_wp - sand%hardening_void*void, &
                                                    least_hardening)/sqrt(p/sand%atmosphere)
  end function start_hardening

  !> Everything that rates and tangent of a point on the yield surface need.
  pure function flow_at(sand, y, start) result(flow)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: y(sand_size), start(6)  !! start: alpha where the loading began
    type(sand_flow_type) :: flow
    real(wp), dimension(6) :: ratio, square
    real(wp) :: g, cosine, b, c, psi, moduli(2), size_of, b0, skew

    associate (alpha => y(at_alpha:at_alpha + 5), void => y(at_void))
      flow%p = max(trace(y(:6))/3.0_wp, sand%least*0.5_wp)
      moduli = bulk_and_shear(sand, flow%p, void)
      flow%bulk = moduli(1)
      flow%shear = moduli(2)
      ratio = (y(:6) - trace(y(:6))/3.0_wp*unit)/flow%p
      size_of = max(magnitude(ratio - alpha), tiny(1.0_wp))
      flow%n = (ratio - alpha)/size_of
      flow%along = sum(twice*flow%n*ratio)
      call lode(sand, flow%n, g, cosine)
      psi = void - critical_void(sand, flow%p)
      skew = (1.0_wp - sand%extension)/sand%extension*g
      b = 1.0_wp + 1.5_wp*skew*cosine
      c = 3.0_wp*sqrt(1.5_wp)*skew
      flow%spread = abs(b) + c*2.0_wp/sqrt(6.0_wp)
      square = squared(flow%n)
      flow%flow = b*flow%n - c*(square - unit/3.0_wp)
      flow%to_bound = bounding(sand, g, psi)*flow%n - alpha
      flow%dilation = sand%dilatancy*(1.0_wp + max(0.0_wp, sum(twice*y(at_fabric:at_fabric + 5) &
        *flow%n)))*(root_2_3*(g*sand%slope*growth(sand%dilatancy_rate*psi) - sand%opening) &
                    - sum(twice*alpha*flow%n))
      b0 = start_hardening(sand, flow%p, void)
      flow%softness = max(0.0_wp, sum(twice*(alpha - start)*flow%n))/b0
    end associate
    flow%resistance = max(tiny(1.0_wp), 2.0_wp/3.0_wp*flow%p*sum(twice*flow%to_bound*flow%n) &
      + flow%softness*(2.0_wp*flow%shear*(b - c*cosine/sqrt(6.0_wp)) &
                       - flow%bulk*flow%dilation*flow%along))
  end function flow_at

  !> Rates of a point for a rate of strain; `drive` is the numerator of the loading index, elastic
  !! where it is negative. 1/h and L h are finite where a loading begins, h is not. `fast` is the
  !! rate at which n turns into the direction of the strain, as fast as the surface is narrow.
  pure subroutine rates(sand, strain, y, start, rate, drive, fast)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6), y(sand_size), start(6)
    real(wp), intent(out) :: rate(sand_size), drive, fast
    type(sand_flow_type) :: flow
    real(wp) :: v, hard, index
    flow = flow_at(sand, y, start)
    v = trace(strain)
    drive = 2.0_wp*flow%shear*sum(twice*flow%n*strain) - flow%bulk*flow%along*v
    hard = max(drive, 0.0_wp)/flow%resistance
    index = hard*flow%softness
    fast = (2.0_wp*flow%shear*index*flow%spread/flow%p &
            + 2.0_wp/3.0_wp*hard*magnitude(flow%to_bound + y(at_alpha:at_alpha + 5))) &
      /(root_2_3*sand%opening)
    rate(:6) = 2.0_wp*flow%shear*(strain - v/3.0_wp*unit - index*flow%flow) &
      + flow%bulk*(v - index*flow%dilation)*unit
    rate(at_alpha:at_alpha + 5) = 2.0_wp/3.0_wp*hard*flow%to_bound
    rate(at_fabric:at_fabric + 5) = -sand%fabric_rate*max(0.0_wp, -index*flow%dilation) &
      *(sand%fabric_limit*flow%n + y(at_fabric:at_fabric + 5))
    rate(at_void) = -(1.0_wp + y(at_void))*v
    rate(at_flow:) = index*(flow%flow + flow%dilation/3.0_wp*unit)
  end subroutine rates

  !> Tangent of a small increment, by strains with engineering shears.
  pure function continuum(sand, y, start, loads) result(tangent)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: y(sand_size), start(6)
    logical, intent(in) :: loads
    real(wp) :: tangent(6, 6)
    type(sand_flow_type) :: flow
    flow = flow_at(sand, y, start)
    tangent = elastic_matrix(flow%bulk, flow%shear)
    if (loads) tangent = tangent - flow%softness/flow%resistance &
      *outer(2.0_wp*flow%shear*flow%flow + flow%bulk*flow%dilation*unit, &
             2.0_wp*flow%shear*flow%n - flow%bulk*flow%along*unit)
  end function continuum

  !> Square of a symmetric tensor.
  pure function squared(a) result(b)
    real(wp), intent(in) :: a(6)
    real(wp) :: b(6)
    b = [a(1)**2 + a(4)**2 + a(6)**2, a(2)**2 + a(4)**2 + a(5)**2, a(3)**2 + a(5)**2 + a(6)**2, &
         a(1)*a(4) + a(4)*a(2) + a(6)*a(5), a(4)*a(6) + a(2)*a(5) + a(5)*a(3), &
         a(1)*a(6) + a(4)*a(5) + a(6)*a(3)]
  end function squared
end module fem_sanisand
