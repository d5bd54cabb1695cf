!> Hertz contacts of elliptic area: the radius of the circular contact of the same force.
!!
!! With the principal relative curvatures k1 >= k2, R_e = 2/(k1 + k2), the semi-axes a >= b of the
!! contact, k = b/a, m = 1 - k^2 and the complete elliptic integrals K, E, D = (K - E)/m, B = K - D
!! (Johnson, Contact Mechanics, 4.2):
!!   k1/k2 = B/(k^2 D),  F = 4/3 E* sqrt(R_x) delta^(3/2),  R_x/R_e = pi^2/4 E/(k^2 K^3).
!! R_x replaces R_e in all that follows; with k1 = k2 they are the same.
!! eq. D.15
module dem_ellipse
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  use dem_block, only: dem_block_type
  use dem_shape, only: shape_size, shape_tangent, hertz_radius, at_half, at_lower, at_upper
  use dem_shape_lanes, only: shape_block_type
  use dem_figure, only: figure_type, figure_bend
  implicit none
  private
  public :: radius_ratio, narrow_ellipsoids, narrow_shapes, ratio_on_plane

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: round = 1.0e-8_wp    !! k1/k2 - 1 that counts as a circle [-]
  real(wp), parameter :: slimmest = 1.0e10_wp  !! greatest k1/k2 [-]

contains

  !> R_x/R_e of a ratio of principal curvatures of at least 1.
  pure real(wp) function radius_ratio(ratio) result(factor)
    real(wp), intent(in) :: ratio
    real(wp) :: x(2), f(2), k, d, e, next
    integer(i4) :: step
    integer(i4), parameter :: most_steps = 30
    real(wp), parameter :: exact = 1.0e-15_wp

    factor = 1.0_wp
    if (.not. ratio - 1.0_wp > round) return
    ! secant in log(b/a), from the two slopes that bracket it
    x = -[2.0_wp/3.0_wp, 2.0_wp/pi]*log(min(ratio, slimmest))
    f = [misfit(x(1), ratio), misfit(x(2), ratio)]
    do step = 1, most_steps
      if (abs(f(2)) <= exact .or. .not. abs(f(2) - f(1)) > 0.0_wp) exit
      next = min(x(2) - f(2)*(x(2) - x(1))/(f(2) - f(1)), 0.0_wp)
      x = [x(2), next]
      f = [f(2), misfit(next, ratio)]
    end do
    call integrals(exp(x(2)), k, d, e)
    factor = 0.25_wp*pi**2*e/(exp(2.0_wp*x(2))*k**3)
  end function radius_ratio

  !> Log of the ratio of curvatures at b/a = exp(x) over the required one.
  pure real(wp) function misfit(x, ratio)
    real(wp), intent(in) :: x, ratio
    real(wp) :: k, d, e
    call integrals(exp(x), k, d, e)
    misfit = log((k - d)/d) - 2.0_wp*x - log(min(ratio, slimmest))
  end function misfit

  !> Complete elliptic integrals of the axis ratio b/a, by the arithmetic-geometric mean.
  pure subroutine integrals(axis, k, d, e)
    real(wp), intent(in) :: axis
    real(wp), intent(out) :: k, d, e
    real(wp) :: a, b, c, m, sum_of, power
    integer(i4) :: step
    m = (1.0_wp - axis)*(1.0_wp + axis)
    a = 1.0_wp
    b = axis
    sum_of = 0.0_wp
    power = 1.0_wp
    do step = 1, 12
      c = 0.5_wp*(a - b)
      if (.not. c > 1.0e-9_wp*a) exit
      sum_of = sum_of + power*c*c
      power = 2.0_wp*power
      b = sqrt(a*b)
      a = a - c
    end do
    k = pi/(a + b)
    d = 0.5_wp*k
    if (m > 0.0_wp) d = k*(0.5_wp + sum_of/m)
    e = k - m*d
  end subroutine integrals

  !> From the mean curvatures of a block of ellipsoids to those of the circular contacts of the
  !! same force.
  pure subroutine narrow_ellipsoids(b, with_first)
    type(dem_block_type), intent(inout) :: b
    logical, intent(in) :: with_first  !! false: A is a plane
    real(wp) :: n(3), c(3)
    integer(i4) :: k
    do k = 1, lanes
      if (.not. b%gap(k) < 0.0_wp) cycle
      n = [b%nx(k), b%ny(k), b%nz(k)]
      c = curvature_of(n, (b%b%s(k, :) - products(b%bx(k), b%by(k), b%bz(k)))/b%hb(k))
      if (with_first) &
        c = c + curvature_of(n, (b%a%s(k, :) - products(b%ax(k), b%ay(k), b%az(k)))/b%ha(k))
      b%curvature(k) = b%curvature(k)/ratio_of(c)
    end do
  end subroutine narrow_ellipsoids

  !> The same for shapes.
  pure subroutine narrow_shapes(b, f, with_first)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(in) :: f
    logical, intent(in) :: with_first
    real(wp) :: n(3), c(3)
    integer(i4) :: k
    do k = 1, lanes
      if (.not. b%gap(k) < 0.0_wp) cycle
      n = [b%nx(k), b%ny(k), b%nz(k)]
      c = shape_curvature(f%b%record(k, :), n, -1.0_wp)
      if (with_first) c = c + shape_curvature(f%a%record(k, :), n, 1.0_wp)
      b%curvature(k) = b%curvature(k)/ratio_of(c)
    end do
  end subroutine narrow_shapes

  !> R_x/R_e of a grain on a plane with the normal n.
  pure real(wp) function ratio_on_plane(figure, n) result(ratio)
    type(figure_type), intent(in) :: figure
    real(wp), intent(in) :: n(3)
    real(wp) :: u(3), h, k(6)
    if (figure%shaped) then
      ratio = ratio_of(shape_curvature(figure%shape, n, -1.0_wp))
      return
    end if
    call figure_bend(figure, n, u, h, k)
    ratio = ratio_of(curvature_of(n, k))
  end function ratio_on_plane

  !> Curvatures xx yy xy of a form in the plane across n where its normal is side n [1/m]; each
  !! of a superquadric is bounded as its mean is in dem_shape.
  pure function shape_curvature(shape, n, side) result(c)
    real(wp), intent(in) :: shape(shape_size), n(3), side
    real(wp) :: c(3), h, u(3), k(6), least, mean, half, principal(2)
    call shape_tangent(shape, side*n, h, u, k)
    c = curvature_of(n, k)
    if (.not. shape(at_half) < 1.0_wp) return
    least = 6.0_wp/(hertz_radius*sum(shape(at_upper:at_lower + 2)))
    mean = 0.5_wp*(c(1) + c(2))
    half = sqrt((0.5_wp*(c(1) - c(2)))**2 + c(3)**2)
    principal = sqrt(sqrt([mean + half, max(mean - half, 0.0_wp)]**4 + least**4))
    c = (c - [mean, mean, 0.0_wp])*(0.5_wp*(principal(1) - principal(2))/max(half, tiny(half))) &
        + 0.5_wp*(principal(1) + principal(2))*[1.0_wp, 1.0_wp, 0.0_wp]
  end function shape_curvature

  pure function products(x, y, z) result(p)
    real(wp), intent(in) :: x, y, z
    real(wp) :: p(6)
    p = [x*x, y*y, z*z, x*y, y*z, z*x]
  end function products

  !> Curvatures xx yy xy in the plane across n, from the radii of curvature as xx yy zz xy yz zx
  !! [1/m].
  pure function curvature_of(n, k) result(c)
    real(wp), intent(in) :: n(3), k(6)
    real(wp) :: c(3), e(3, 2), r(3)
    integer(i4) :: j
    j = minloc(abs(n), 1)
    e(:, 1) = -n(j)*n
    e(j, 1) = e(j, 1) + 1.0_wp
    e(:, 1) = e(:, 1)/sqrt(sum(e(:, 1)**2))
    e(:, 2) = [n(2)*e(3, 1) - n(3)*e(2, 1), n(3)*e(1, 1) - n(1)*e(3, 1), &
               n(1)*e(2, 1) - n(2)*e(1, 1)]
    r = [sandwich(e(:, 1), e(:, 1)), sandwich(e(:, 2), e(:, 2)), sandwich(e(:, 1), e(:, 2))]
    c = [r(2), r(1), -r(3)]/(r(1)*r(2) - r(3)**2)

  contains

    pure real(wp) function sandwich(a, b)
      real(wp), intent(in) :: a(3), b(3)
      sandwich = k(1)*a(1)*b(1) + k(2)*a(2)*b(2) + k(3)*a(3)*b(3) + k(4)*(a(1)*b(2) + a(2)*b(1)) &
                 + k(5)*(a(2)*b(3) + a(3)*b(2)) + k(6)*(a(3)*b(1) + a(1)*b(3))
    end function sandwich
  end function curvature_of

  !> R_x/R_e of relative curvatures xx yy xy.
  pure real(wp) function ratio_of(c)
    real(wp), intent(in) :: c(3)
    real(wp) :: mean, half
    mean = 0.5_wp*(c(1) + c(2))
    half = sqrt((0.5_wp*(c(1) - c(2)))**2 + c(3)**2)
    ratio_of = radius_ratio((mean + half)/max(mean - half, mean/slimmest))
  end function ratio_of
end module dem_ellipse
