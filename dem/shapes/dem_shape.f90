!> Grains of any smooth convex form: eight octants of six semi-axes and an exponent, through their
!! support function. Spheres, ellipsoids, poly-ellipsoids and superquadrics are cases of it.
!!
!! About the octants' origin, in their frame, with m the direction, a_i the semi-axis on the side of
!! m_i, u_i = a_i m_i, l = |u|, w = u/l, 1/p + 1/q = 1:
!!   h(m) = s l (sum (w_i^2 + e^2)^(q/2))^(1/q), s = (1 + 3 e^2)^(-1/2).
!! With e = 0 this is the superquadric of exponent p; its flat spots have no greatest radius of
!! curvature. e rounds them: they bulge by `bulge` of the semi-axis, all radii are bounded, and
!! p = 2 is an ellipsoid whatever e is (theory-dem, Shapes).
!! eq. D.12
module dem_shape
  use talus_kinds, only: wp, i4
  use dem_power, only: raise
  use dem_ellipsoid, only: rotation_of, quaternion_product
  implicit none
  private
  public :: shape_size, shape_of, shape_support, shape_height, shape_tangent, mean_curvature_of, &
    turned
  public :: octant_support, flattest_radius
  public :: least_exponent, most_exponent, bulge, hertz_radius, bounded_curvature
  public :: at_upper, at_lower, at_centre, at_half, at_rounding, at_scale

  integer(i4), parameter :: shape_size = 16  !! reals in the record of a form
  ! places in a record: 1-4 orientation of the octants now (w, x, y, z), then
  integer(i4), parameter :: at_upper = 5      !! semi-axes on the positive sides [m]
  integer(i4), parameter :: at_lower = 8      !! semi-axes on the negative sides [m]
  integer(i4), parameter :: at_centre = 11    !! centre of mass from the octants' origin [m]
  integer(i4), parameter :: at_half = 14      !! q/2, 1 without powers [-]
  integer(i4), parameter :: at_rounding = 15  !! e^2 [-]
  integer(i4), parameter :: at_scale = 16     !! s [-]

  real(wp), parameter :: least_exponent = 2.0_wp, most_exponent = 10.0_wp
  real(wp), parameter :: bulge = 1.0e-4_wp  !! of flat spots, in units of the semi-axis [-]
  real(wp), parameter :: hertz_radius = 10.0_wp  !! greatest in Hertz's law, of superquadrics [-]

contains

  !> Record of a form, unturned.
  pure function shape_of(upper, lower, centre, exponent) result(shape)
    real(wp), intent(in) :: upper(3), lower(3)  !! semi-axes on the positive and negative sides [m]
    real(wp), intent(in) :: centre(3)           !! of mass from the octants' origin [m]
    real(wp), intent(in) :: exponent            !! p [-]
    real(wp) :: shape(shape_size)
    shape(1:4) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    shape(at_upper:at_upper + 2) = upper
    shape(at_lower:at_lower + 2) = lower
    shape(at_centre:at_centre + 2) = centre
    shape(at_half) = 1.0_wp
    shape(at_rounding) = 0.0_wp
    if (exponent > least_exponent) then
      shape(at_half) = 0.5_wp*exponent/(exponent - 1.0_wp)
      shape(at_rounding) = (shape(at_half)*bulge)**(1.0_wp/shape(at_half))
    end if
    shape(at_scale) = 1.0_wp/sqrt(1.0_wp + 3.0_wp*shape(at_rounding))
  end function shape_of

  !> Greatest radius of curvature of an exponent, in units of a semi-axis.
  pure real(wp) function flattest_radius(exponent) result(radius)
    real(wp), intent(in) :: exponent
    real(wp) :: shape(shape_size), h, u(3), k(6)
    shape = shape_of([1.0_wp, 1.0_wp, 1.0_wp], [1.0_wp, 1.0_wp, 1.0_wp], [0.0_wp, 0.0_wp, 0.0_wp], &
                   exponent)
    call octant_tangent(shape, [1.0_wp, 0.0_wp, 0.0_wp], h, u, k)
    radius = k(2)
  end function flattest_radius

  !> The record with the octants turned by q.
  pure function turned(shape, q) result(other)
    real(wp), intent(in) :: shape(shape_size), q(4)
    real(wp) :: other(shape_size)
    other = shape
    other(1:4) = quaternion_product(q, shape(1:4))
  end function turned

  !> Support about the centre of mass and surface point from it, in space [m].
  pure subroutine shape_support(shape, n, h, u)
    real(wp), intent(in) :: shape(shape_size)
    real(wp), intent(in) :: n(3)          !! unit vector in space
    real(wp), intent(out) :: h, u(3)
    real(wp) :: r(3, 3), m(3)
    r = rotation_of(shape(1:4))
    m = matmul(n, r)
    call octant_support(shape, m, h, u)
    h = h - dot_product(m, shape(at_centre:at_centre + 2))
    u = matmul(r, u - shape(at_centre:at_centre + 2))
  end subroutine shape_support

  !> The support alone; without powers in short [m].
  pure real(wp) function shape_height(shape, n) result(h)
    real(wp), intent(in) :: shape(shape_size), n(3)
    real(wp) :: r(3, 3), m(3), a(3), u(3)
    if (shape(at_half) < 1.0_wp) then
      call shape_support(shape, n, h, u)
      return
    end if
    r = rotation_of(shape(1:4))
    m = r(1, :)*n(1) + r(2, :)*n(2) + r(3, :)*n(3)
    a = m*merge(shape(at_upper:at_upper + 2), shape(at_lower:at_lower + 2), m >= 0.0_wp)
    h = sqrt(a(1)*a(1) + a(2)*a(2) + a(3)*a(3)) - m(1)*shape(at_centre) &
        - m(2)*shape(at_centre + 1) - m(3)*shape(at_centre + 2)
  end function shape_height

  !> Support and surface point as shape_support gives them, and the Hessian of the support, which
  !! holds the radii of curvature on the tangent plane, as xx yy zz xy yz zx [m].
  pure subroutine shape_tangent(shape, n, h, u, k)
    real(wp), intent(in) :: shape(shape_size), n(3)
    real(wp), intent(out) :: h, u(3), k(6)
    real(wp) :: r(3, 3), m(3), body(3, 3)
    r = rotation_of(shape(1:4))
    m = matmul(n, r)
    call octant_tangent(shape, m, h, u, k)
    h = h - dot_product(m, shape(at_centre:at_centre + 2))
    u = matmul(r, u - shape(at_centre:at_centre + 2))
    body = reshape([k(1), k(4), k(6), k(4), k(2), k(5), k(6), k(5), k(3)], [3, 3])
    body = matmul(r, matmul(body, transpose(r)))
    k = [body(1, 1), body(2, 2), body(3, 3), body(1, 2), body(2, 3), body(3, 1)]
  end subroutine shape_tangent

  !> Support about the octants' origin and surface point from it, in their frame.
  pure subroutine octant_support(shape, m, h, u)
    real(wp), intent(in) :: shape(shape_size), m(3)
    real(wp), intent(out) :: h, u(3)
    real(wp) :: a(3), w(3), length, power(3), total, factor
    call shares(shape, m, a, w, length, power, total, factor)
    h = shape(at_scale)*length*total*factor
    u = shape(at_scale)*factor*a*w*(power + shape(at_rounding)*sum(power))
  end subroutine octant_support

  !> The same and the Hessian.
  pure subroutine octant_tangent(shape, m, h, u, k)
    real(wp), intent(in) :: shape(shape_size), m(3)
    real(wp), intent(out) :: h, u(3), k(6)
    real(wp) :: a(3), w(3), length, power(3), total, factor, weight(3), g(3), s(3), steep(3)
    real(wp) :: e, bend, over
    call shares(shape, m, a, w, length, power, total, factor)
    e = shape(at_rounding)
    weight = power + e*sum(power)
    g = a*w*weight
    h = shape(at_scale)*length*total*factor
    u = shape(at_scale)*factor*g
    s = a*w
    steep = power/max(w*w + e, tiny(1.0_wp))
    bend = 2.0_wp*shape(at_half) - 2.0_wp
    over = (2.0_wp*shape(at_half) - 1.0_wp)/total
    k(1:3) = a*a*weight + bend*s*s*(steep + 2.0_wp*e*steep + e*e*sum(steep)) - over*g*g
    k(4) = bend*s(1)*s(2)*(e*(steep(1) + steep(2)) + e*e*sum(steep)) - over*g(1)*g(2)
    k(5) = bend*s(2)*s(3)*(e*(steep(2) + steep(3)) + e*e*sum(steep)) - over*g(2)*g(3)
    k(6) = bend*s(3)*s(1)*(e*(steep(3) + steep(1)) + e*e*sum(steep)) - over*g(3)*g(1)
    k = shape(at_scale)*factor/length*k
  end subroutine octant_tangent

  !> What support and Hessian are made of.
  pure subroutine shares(shape, m, a, w, length, power, total, factor)
    real(wp), intent(in) :: shape(shape_size), m(3)
    real(wp), intent(out) :: a(3)      !! semi-axes on the side of m [m]
    real(wp), intent(out) :: w(3)      !! a m over its length [-]
    real(wp), intent(out) :: length    !! of a m [m]
    real(wp), intent(out) :: power(3)  !! (w^2 + e^2)^(q/2 - 1)
    real(wp), intent(out) :: total     !! sum (w^2 + e^2)^(q/2)
    real(wp), intent(out) :: factor    !! total^(1/q - 1)
    real(wp) :: square(3), last(1)
    a = merge(shape(at_upper:at_upper + 2), shape(at_lower:at_lower + 2), m >= 0.0_wp)
    w = a*m
    length = sqrt(sum(w*w))
    w = w/length
    square = w*w + shape(at_rounding)
    if (shape(at_half) < 1.0_wp) then
      call raise(3_i4, square, spread(shape(at_half) - 1.0_wp, 1, 3), power)
      total = sum(power*square)
      call raise(1_i4, [total], [0.5_wp/shape(at_half) - 1.0_wp], last)
      factor = last(1)
    else
      power = 1.0_wp
      total = sum(square)
      factor = 1.0_wp/sqrt(total)
    end if
  end subroutine shares

  !> Mean curvature for Hertz's law: that of a superquadric has the fourth power of 1/(hertz_radius
  !! mean semi-axis) added to its own, so that a flat spot stays softer than a punch as wide as the
  !! grain [1/m].
  pure real(wp) function bounded_curvature(shape, k) result(curvature)
    real(wp), intent(in) :: shape(shape_size), k(6)
    real(wp) :: least
    curvature = mean_curvature_of(k)
    least = 6.0_wp/(hertz_radius*sum(shape(at_upper:at_lower + 2)))
    if (shape(at_half) < 1.0_wp) curvature = sqrt(sqrt(curvature**4 + least**4))
  end function bounded_curvature

  !> Mean curvature of the surface, from the Hessian of the support on the tangent plane: half its
  !! trace over its determinant [1/m].
  pure real(wp) function mean_curvature_of(k) result(curvature)
    real(wp), intent(in) :: k(6)
    curvature = 0.5_wp*(k(1) + k(2) + k(3))/(k(1)*k(2) - k(4)*k(4) + k(2)*k(3) - k(5)*k(5) &
                                             + k(3)*k(1) - k(6)*k(6))
  end function mean_curvature_of
end module dem_shape
