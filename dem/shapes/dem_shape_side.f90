!> Support, surface point and Hessian of one side of a block of shapes (dem_shape), a lane each.
module dem_shape_side
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  use dem_shape, only: shape_size, at_upper, at_lower, at_centre, at_half, at_rounding, at_scale, &
    hertz_radius
  use dem_orientation, only: rotations
  use dem_power, only: raise, raise_near
  implicit none
  private
  public :: shape_side_type, turn_side, raise_sides, support_side, bend_side, curve_side

  !> Forms of one body of each pair, and what their support along the last normal was made of.
  !! Octants without powers are ellipsoids about the octants' origin, as long as the normal stays on
  !! one side of each axis.
  type :: shape_side_type
    real(wp) :: record(lanes, shape_size)  !! see dem_shape
    real(wp) :: r(lanes, 9)               !! rotation, octants to space, by columns
    real(wp) :: length(lanes)             !! of a m; without powers the support about the origin [m]
    real(wp) :: inside(lanes)             !! square of the least component of m
    ! without powers
    real(wp) :: centre(lanes, 3)          !! of mass from the octants' origin, in space [m]
    real(wp) :: shape(lanes, 6)           !! of the ellipsoid, xx yy zz xy yz zx [m^2]
    real(wp) :: volume(lanes)             !! square of the product of its semi-axes [m^6]
    real(wp) :: point(lanes, 3)           !! sign times the surface point from the origin [m]
    ! with powers
    real(wp) :: a(lanes, 3)               !! semi-axes on the side of the normal [m]
    real(wp) :: m(lanes, 3)               !! normal in the frame of the octants
    real(wp) :: w(lanes, 3)               !! a m over its length [-]
    real(wp) :: power(lanes, 3)           !! (w^2 + e^2)^(q/2 - 1)
    real(wp) :: total(lanes)              !! sum of (w^2 + e^2)^(q/2)
    real(wp) :: factor(lanes)             !! total^(1/q - 1)
  end type shape_side_type

contains

  !> Rotations of the records, and where the centres of mass are.
  pure subroutine turn_side(f)
    type(shape_side_type), intent(inout) :: f
    integer(i4) :: k
    call rotations(f%record(:, 1:4), f%r)
    !$omp simd
    do k = 1, lanes
      f%centre(k, 1) = f%r(k, 1)*f%record(k, at_centre) + f%r(k, 4)*f%record(k, at_centre + 1) &
                       + f%r(k, 7)*f%record(k, at_centre + 2)
      f%centre(k, 2) = f%r(k, 2)*f%record(k, at_centre) + f%r(k, 5)*f%record(k, at_centre + 1) &
                       + f%r(k, 8)*f%record(k, at_centre + 2)
      f%centre(k, 3) = f%r(k, 3)*f%record(k, at_centre) + f%r(k, 6)*f%record(k, at_centre + 1) &
                       + f%r(k, 9)*f%record(k, at_centre + 2)
    end do
  end subroutine turn_side

  !> Shares and powers of one or two bodies along n, -n for the last one; both at once, as short
  !! loops wait for each other's results.
  pure subroutine raise_sides(nx, ny, nz, b, a)
    real(wp), intent(in) :: nx(lanes), ny(lanes), nz(lanes)
    type(shape_side_type), intent(inout) :: b
    type(shape_side_type), intent(inout), optional :: a
    real(wp) :: square(lanes, 6), exponent(lanes, 6), power(lanes, 6)
    real(wp) :: total(lanes, 2), last(lanes, 2), factor(lanes, 2)

    call pick_axes(b, -1.0_wp, nx, ny, nz)
    call find_squares(b, square(:, 1:3), exponent(:, 1:3))
    if (present(a)) then
      call pick_axes(a, 1.0_wp, nx, ny, nz)
      call find_squares(a, square(:, 4:6), exponent(:, 4:6))
      call raise(6*lanes, square, exponent, power)
      call find_totals(a, square(:, 4:6), power(:, 4:6), total(:, 2), last(:, 2))
      call find_totals(b, square(:, 1:3), power(:, 1:3), total(:, 1), last(:, 1))
      call raise_near(2*lanes, total, last, factor)
      a%factor = factor(:, 2)
    else
      call raise(3*lanes, square, exponent, power)
      call find_totals(b, square(:, 1:3), power(:, 1:3), total(:, 1), last(:, 1))
      call raise_near(lanes, total, last, factor)
    end if
    b%factor = factor(:, 1)
  end subroutine raise_sides

  !> Squares of the shares, rounded, and their exponent. Lanes without powers have the exponent 0
  !! and come out as 1.
  pure subroutine find_squares(f, square, exponent)
    type(shape_side_type), intent(in) :: f
    real(wp), intent(out) :: square(lanes, 3), exponent(lanes, 3)
    integer(i4) :: k, c
    real(wp), parameter :: least = 1.0e-200_wp
    do c = 1, 3
      !$omp simd
      do k = 1, lanes
        square(k, c) = max(f%w(k, c)*f%w(k, c) + f%record(k, at_rounding), least)
        exponent(k, c) = f%record(k, at_half) - 1.0_wp
      end do
    end do
  end subroutine find_squares

  pure subroutine find_totals(f, square, power, total, last)
    type(shape_side_type), intent(inout) :: f
    real(wp), intent(in) :: square(lanes, 3), power(lanes, 3)
    real(wp), intent(out) :: total(lanes), last(lanes)  !! its exponent
    integer(i4) :: k
    !$omp simd
    do k = 1, lanes
      f%power(k, 1) = power(k, 1)
      f%power(k, 2) = power(k, 2)
      f%power(k, 3) = power(k, 3)
      total(k) = power(k, 1)*square(k, 1) + power(k, 2)*square(k, 2) + power(k, 3)*square(k, 3)
      f%total(k) = total(k)
      last(k) = 0.5_wp/f%record(k, at_half) - 1.0_wp
    end do
  end subroutine find_totals

  !> Support along sign n about the centre of mass, and sign times the surface point from it; with
  !! powers raise_sides is called first.
  pure subroutine support_side(f, sign, powers, nx, ny, nz, h, ux, uy, uz)
    type(shape_side_type), intent(inout) :: f
    real(wp), intent(in) :: sign
    logical, intent(in) :: powers
    real(wp), intent(in) :: nx(lanes), ny(lanes), nz(lanes)
    real(wp), intent(out) :: h(lanes), ux(lanes), uy(lanes), uz(lanes)
    if (powers) then
      call support_powers(f, sign, h, ux, uy, uz)
    else
      call support_octants(f, sign, nx, ny, nz, h, ux, uy, uz)
    end if
  end subroutine support_side

  !> Without powers, in one go.
  pure subroutine support_octants(f, sign, nx, ny, nz, h, ux, uy, uz)
    type(shape_side_type), intent(inout) :: f
    real(wp), intent(in) :: sign
    real(wp), intent(in) :: nx(lanes), ny(lanes), nz(lanes)
    real(wp), intent(out) :: h(lanes), ux(lanes), uy(lanes), uz(lanes)
    real(wp) :: r(9), a1, a2, a3, p(9), s(6), length, inverse, x, y, z
    integer(i4) :: k

    !$omp simd private(r, a1, a2, a3, p, s, length, inverse, x, y, z)
    do k = 1, lanes
      r(1) = f%r(k, 1)
      r(2) = f%r(k, 2)
      r(3) = f%r(k, 3)
      r(4) = f%r(k, 4)
      r(5) = f%r(k, 5)
      r(6) = f%r(k, 6)
      r(7) = f%r(k, 7)
      r(8) = f%r(k, 8)
      r(9) = f%r(k, 9)
      x = sign*(r(1)*nx(k) + r(2)*ny(k) + r(3)*nz(k))
      y = sign*(r(4)*nx(k) + r(5)*ny(k) + r(6)*nz(k))
      z = sign*(r(7)*nx(k) + r(8)*ny(k) + r(9)*nz(k))
      a1 = merge(f%record(k, at_upper), f%record(k, at_lower), x >= 0.0_wp)
      a2 = merge(f%record(k, at_upper + 1), f%record(k, at_lower + 1), y >= 0.0_wp)
      a3 = merge(f%record(k, at_upper + 2), f%record(k, at_lower + 2), z >= 0.0_wp)
      f%inside(k) = min(x*x, y*y, z*z)
      f%volume(k) = (a1*a2*a3)**2
      p(1) = a1*r(1)
      p(2) = a1*r(2)
      p(3) = a1*r(3)
      p(4) = a2*r(4)
      p(5) = a2*r(5)
      p(6) = a2*r(6)
      p(7) = a3*r(7)
      p(8) = a3*r(8)
      p(9) = a3*r(9)
      s(1) = p(1)*p(1) + p(4)*p(4) + p(7)*p(7)
      s(2) = p(2)*p(2) + p(5)*p(5) + p(8)*p(8)
      s(3) = p(3)*p(3) + p(6)*p(6) + p(9)*p(9)
      s(4) = p(1)*p(2) + p(4)*p(5) + p(7)*p(8)
      s(5) = p(2)*p(3) + p(5)*p(6) + p(8)*p(9)
      s(6) = p(3)*p(1) + p(6)*p(4) + p(9)*p(7)
      x = s(1)*nx(k) + s(4)*ny(k) + s(6)*nz(k)
      y = s(4)*nx(k) + s(2)*ny(k) + s(5)*nz(k)
      z = s(6)*nx(k) + s(5)*ny(k) + s(3)*nz(k)
      length = sqrt(nx(k)*x + ny(k)*y + nz(k)*z)
      inverse = 1.0_wp/length
      x = inverse*x
      y = inverse*y
      z = inverse*z
      f%shape(k, 1) = s(1)
      f%shape(k, 2) = s(2)
      f%shape(k, 3) = s(3)
      f%shape(k, 4) = s(4)
      f%shape(k, 5) = s(5)
      f%shape(k, 6) = s(6)
      f%length(k) = length
      f%point(k, 1) = x
      f%point(k, 2) = y
      f%point(k, 3) = z
      h(k) = length - sign*(f%centre(k, 1)*nx(k) + f%centre(k, 2)*ny(k) + f%centre(k, 3)*nz(k))
      ux(k) = x - sign*f%centre(k, 1)
      uy(k) = y - sign*f%centre(k, 2)
      uz(k) = z - sign*f%centre(k, 3)
    end do
  end subroutine support_octants

  !> From the shares and their powers.
  pure subroutine support_powers(f, sign, h, ux, uy, uz)
    type(shape_side_type), intent(in) :: f
    real(wp), intent(in) :: sign
    real(wp), intent(out) :: h(lanes), ux(lanes), uy(lanes), uz(lanes)
    real(wp) :: scale, p, p1, p2, p3
    integer(i4) :: k

    !$omp simd private(scale, p, p1, p2, p3)
    do k = 1, lanes
      scale = f%record(k, at_scale)*f%factor(k)
      p = f%record(k, at_rounding)*(f%power(k, 1) + f%power(k, 2) + f%power(k, 3))
      p1 = scale*f%a(k, 1)*f%w(k, 1)*(f%power(k, 1) + p)
      p2 = scale*f%a(k, 2)*f%w(k, 2)*(f%power(k, 2) + p)
      p3 = scale*f%a(k, 3)*f%w(k, 3)*(f%power(k, 3) + p)
      h(k) = scale*f%length(k)*f%total(k) - f%m(k, 1)*f%record(k, at_centre) &
             - f%m(k, 2)*f%record(k, at_centre + 1) - f%m(k, 3)*f%record(k, at_centre + 2)
      p1 = sign*(p1 - f%record(k, at_centre))
      p2 = sign*(p2 - f%record(k, at_centre + 1))
      p3 = sign*(p3 - f%record(k, at_centre + 2))
      ux(k) = f%r(k, 1)*p1 + f%r(k, 4)*p2 + f%r(k, 7)*p3
      uy(k) = f%r(k, 2)*p1 + f%r(k, 5)*p2 + f%r(k, 8)*p3
      uz(k) = f%r(k, 3)*p1 + f%r(k, 6)*p2 + f%r(k, 9)*p3
    end do
  end subroutine support_powers

  !> Semi-axes on the side of sign n, and their shares.
  pure subroutine pick_axes(f, sign, nx, ny, nz)
    type(shape_side_type), intent(inout) :: f
    real(wp), intent(in) :: sign
    real(wp), intent(in) :: nx(lanes), ny(lanes), nz(lanes)
    real(wp) :: m1, m2, m3, a1, a2, a3, length, inverse
    integer(i4) :: k

    !$omp simd private(m1, m2, m3, a1, a2, a3, length, inverse)
    do k = 1, lanes
      m1 = sign*(f%r(k, 1)*nx(k) + f%r(k, 2)*ny(k) + f%r(k, 3)*nz(k))
      m2 = sign*(f%r(k, 4)*nx(k) + f%r(k, 5)*ny(k) + f%r(k, 6)*nz(k))
      m3 = sign*(f%r(k, 7)*nx(k) + f%r(k, 8)*ny(k) + f%r(k, 9)*nz(k))
      a1 = merge(f%record(k, at_upper), f%record(k, at_lower), m1 >= 0.0_wp)
      a2 = merge(f%record(k, at_upper + 1), f%record(k, at_lower + 1), m2 >= 0.0_wp)
      a3 = merge(f%record(k, at_upper + 2), f%record(k, at_lower + 2), m3 >= 0.0_wp)
      f%a(k, 1) = a1
      f%a(k, 2) = a2
      f%a(k, 3) = a3
      f%m(k, 1) = m1
      f%m(k, 2) = m2
      f%m(k, 3) = m3
      f%inside(k) = min(m1*m1, m2*m2, m3*m3)
      m1 = a1*m1
      m2 = a2*m2
      m3 = a3*m3
      length = sqrt(m1*m1 + m2*m2 + m3*m3)
      inverse = 1.0_wp/length
      f%length(k) = length
      f%w(k, 1) = inverse*m1
      f%w(k, 2) = inverse*m2
      f%w(k, 3) = inverse*m3
    end do
  end subroutine pick_axes

  !> Mean curvature of the surface along the last normal [1/m]: half of trace over determinant of
  !! the tangent Hessian, which rotations leave as they are; see bounded_curvature of dem_shape.
  pure subroutine curve_side(f, powers, curvature)
    type(shape_side_type), intent(in) :: f
    logical, intent(in) :: powers
    real(wp), intent(out) :: curvature(lanes)
    real(wp) :: s(lanes, 6), least
    integer(i4) :: k

    if (.not. powers) then
      call curve_octants(f, curvature)
      return
    end if
    call bend_powers(f, s)
    !$omp simd
    do k = 1, lanes
      curvature(k) = 0.5_wp*(s(k, 1) + s(k, 2) + s(k, 3)) &
                     /(s(k, 1)*s(k, 2) - s(k, 4)*s(k, 4) + s(k, 2)*s(k, 3) - s(k, 5)*s(k, 5) &
                       + s(k, 3)*s(k, 1) - s(k, 6)*s(k, 6))
    end do
    !$omp simd private(least)
    do k = 1, lanes
      least = 6.0_wp/(hertz_radius*(f%record(k, 5) + f%record(k, 6) + f%record(k, 7) &
                                    + f%record(k, 8) + f%record(k, 9) + f%record(k, 10)))
      least = merge(least, 0.0_wp, f%record(k, at_half) < 1.0_wp)
      curvature(k) = sqrt(sqrt(curvature(k)**4 + least**4))
    end do
  end subroutine curve_side

  !> Without powers: (trace of the shape matrix - u.u) l^3 over its determinant.
  pure subroutine curve_octants(f, curvature)
    type(shape_side_type), intent(in) :: f
    real(wp), intent(out) :: curvature(lanes)
    real(wp) :: l
    integer(i4) :: k

    !$omp simd private(l)
    do k = 1, lanes
      l = f%length(k)
      curvature(k) = 0.5_wp*(f%shape(k, 1) + f%shape(k, 2) + f%shape(k, 3) &
                             - f%point(k, 1)**2 - f%point(k, 2)**2 - f%point(k, 3)**2) &
                     *(l*l*l)/f%volume(k)
    end do
  end subroutine curve_octants

  !> Hessian of the support along the last normal in space, xx yy zz xy yz zx [m].
  pure subroutine bend_side(f, powers, s)
    type(shape_side_type), intent(in) :: f
    logical, intent(in) :: powers
    real(wp), intent(out) :: s(lanes, 6)
    if (powers) then
      call bend_powers(f, s)
      call bring_to_space(f%r, s)
    else
      call bend_octants(f, s)
    end if
  end subroutine bend_side

  !> (S - u u^T)/l.
  pure subroutine bend_octants(f, s)
    type(shape_side_type), intent(in) :: f
    real(wp), intent(out) :: s(lanes, 6)
    real(wp) :: inverse, x, y, z
    integer(i4) :: k

    !$omp simd private(inverse, x, y, z)
    do k = 1, lanes
      inverse = 1.0_wp/f%length(k)
      x = f%point(k, 1)
      y = f%point(k, 2)
      z = f%point(k, 3)
      s(k, 1) = inverse*(f%shape(k, 1) - x*x)
      s(k, 2) = inverse*(f%shape(k, 2) - y*y)
      s(k, 3) = inverse*(f%shape(k, 3) - z*z)
      s(k, 4) = inverse*(f%shape(k, 4) - x*y)
      s(k, 5) = inverse*(f%shape(k, 5) - y*z)
      s(k, 6) = inverse*(f%shape(k, 6) - z*x)
    end do
  end subroutine bend_octants

  !> See octant_tangent of dem_shape.
  pure subroutine bend_powers(f, s)
    type(shape_side_type), intent(in) :: f
    real(wp), intent(out) :: s(lanes, 6)
    real(wp) :: e, p, q1, q2, q3, s1, s2, s3, w1, w2, w3, g1, g2, g3, bend, over, scale
    integer(i4) :: k

    !$omp simd private(e, p, q1, q2, q3, s1, s2, s3, w1, w2, w3, g1, g2, g3, bend, over, scale)
    do k = 1, lanes
      e = f%record(k, at_rounding)
      p = e*(f%power(k, 1) + f%power(k, 2) + f%power(k, 3))
      w1 = f%power(k, 1) + p
      w2 = f%power(k, 2) + p
      w3 = f%power(k, 3) + p
      s1 = f%a(k, 1)*f%w(k, 1)
      s2 = f%a(k, 2)*f%w(k, 2)
      s3 = f%a(k, 3)*f%w(k, 3)
      g1 = s1*w1
      g2 = s2*w2
      g3 = s3*w3
      q1 = f%power(k, 1)/max(f%w(k, 1)*f%w(k, 1) + e, tiny(1.0_wp))
      q2 = f%power(k, 2)/max(f%w(k, 2)*f%w(k, 2) + e, tiny(1.0_wp))
      q3 = f%power(k, 3)/max(f%w(k, 3)*f%w(k, 3) + e, tiny(1.0_wp))
      bend = 2.0_wp*f%record(k, at_half) - 2.0_wp
      over = (2.0_wp*f%record(k, at_half) - 1.0_wp)/f%total(k)
      p = e*e*(q1 + q2 + q3)
      scale = f%record(k, at_scale)*f%factor(k)/f%length(k)
      s(k, 1) = scale*(f%a(k, 1)*f%a(k, 1)*w1 + bend*s1*s1*(q1 + 2.0_wp*e*q1 + p) - over*g1*g1)
      s(k, 2) = scale*(f%a(k, 2)*f%a(k, 2)*w2 + bend*s2*s2*(q2 + 2.0_wp*e*q2 + p) - over*g2*g2)
      s(k, 3) = scale*(f%a(k, 3)*f%a(k, 3)*w3 + bend*s3*s3*(q3 + 2.0_wp*e*q3 + p) - over*g3*g3)
      s(k, 4) = scale*(bend*s1*s2*(e*(q1 + q2) + p) - over*g1*g2)
      s(k, 5) = scale*(bend*s2*s3*(e*(q2 + q3) + p) - over*g2*g3)
      s(k, 6) = scale*(bend*s3*s1*(e*(q3 + q1) + p) - over*g3*g1)
    end do
  end subroutine bend_powers

  !> R s R^T.
  pure subroutine bring_to_space(r, s)
    real(wp), intent(in) :: r(lanes, 9)
    real(wp), intent(inout) :: s(lanes, 6)
    real(wp) :: x1, x2, x3, y1, y2, y3, z1, z2, z3, s1, s2, s3, s4, s5, s6
    integer(i4) :: k

    !$omp simd private(x1, x2, x3, y1, y2, y3, z1, z2, z3, s1, s2, s3, s4, s5, s6)
    do k = 1, lanes
      s1 = s(k, 1)
      s2 = s(k, 2)
      s3 = s(k, 3)
      s4 = s(k, 4)
      s5 = s(k, 5)
      s6 = s(k, 6)
      x1 = s1*r(k, 1) + s4*r(k, 4) + s6*r(k, 7)
      x2 = s4*r(k, 1) + s2*r(k, 4) + s5*r(k, 7)
      x3 = s6*r(k, 1) + s5*r(k, 4) + s3*r(k, 7)
      y1 = s1*r(k, 2) + s4*r(k, 5) + s6*r(k, 8)
      y2 = s4*r(k, 2) + s2*r(k, 5) + s5*r(k, 8)
      y3 = s6*r(k, 2) + s5*r(k, 5) + s3*r(k, 8)
      z1 = s1*r(k, 3) + s4*r(k, 6) + s6*r(k, 9)
      z2 = s4*r(k, 3) + s2*r(k, 6) + s5*r(k, 9)
      z3 = s6*r(k, 3) + s5*r(k, 6) + s3*r(k, 9)
      s(k, 1) = r(k, 1)*x1 + r(k, 4)*x2 + r(k, 7)*x3
      s(k, 2) = r(k, 2)*y1 + r(k, 5)*y2 + r(k, 8)*y3
      s(k, 3) = r(k, 3)*z1 + r(k, 6)*z2 + r(k, 9)*z3
      s(k, 4) = r(k, 1)*y1 + r(k, 4)*y2 + r(k, 7)*y3
      s(k, 5) = r(k, 2)*z1 + r(k, 5)*z2 + r(k, 8)*z3
      s(k, 6) = r(k, 3)*x1 + r(k, 6)*x2 + r(k, 9)*x3
    end do
  end subroutine bring_to_space
end module dem_shape_side
