!> Gap of an ellipsoid to what has few normals: a line, a cylinder, a cone (their normals lie on a
!! circle), a point and a ring (any normal). The gap is the maximum of g(n) = r.n - h_A(n) - h_B(n)
!! over these normals, h_B the ellipsoid's support (theory-dem, Surfaces). Starts from the line of
!! centres, so that a result depends on the two bodies alone. Inside a cylinder the gap is the least
!! distance of the ellipsoid's shadow from its circle, which two places of a long one can reach.
module dem_round_gap
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_shape, only: matrix_times
  implicit none
  private
  public :: circle_gap, corner_gap, bore_gap, mean_curvature, ellipsoid_point

  integer(i4), parameter :: most_steps = 60, most_cuts = 30
  real(wp), parameter :: longest_turn = 0.7_wp  !! of a Newton step [rad]

contains

  !> Surface point of the ellipsoid against n, from its centre, and its support.
  pure subroutine ellipsoid_point(a, n, u, h)
    real(wp), intent(in) :: a(6), n(3)
    real(wp), intent(out) :: u(3)  !! A n/h: the point is -u [m]
    real(wp), intent(out) :: h     !! [m]
    u = matrix_times(a, n)
    h = sqrt(dot_product(n, u))
    u = u/h
  end subroutine ellipsoid_point

  !> Mean curvature of the ellipsoid at the point with normal n [1/m]; square is (a b c)^2.
  pure real(wp) function mean_curvature(a, square, n) result(curvature)
    real(wp), intent(in) :: a(6), square, n(3)
    real(wp) :: u(3), h
    call ellipsoid_point(a, n, u, h)
    curvature = 0.5_wp*(a(1) + a(2) + a(3) - sum(u*u))*h*h*h/square
  end function mean_curvature

  !> Largest g(n) = r.n - h_B(n) over n = c e(phi) - s axis, e a unit vector at right angles to the
  !! axis: lines and cylinders (s = 0), cones (s the sine of half the apex angle).
  pure subroutine circle_gap(r, a, axis, sine, cosine, e, n, gap)
    real(wp), intent(in) :: r(3)          !! centre of the ellipsoid from a point of the axis [m]
    real(wp), intent(in) :: a(6)          !! shape matrix [m^2]
    real(wp), intent(in) :: axis(3), sine, cosine
    real(wp), intent(out) :: e(3), n(3)   !! direction from the axis, normal
    real(wp), intent(out) :: gap          !! [m]
    real(wp) :: across(3), slope, bend, turn, other(3), value, rounding
    integer(i4) :: step, cut

    e = outward(r, axis)
    rounding = 4.0_wp*epsilon(1.0_wp)*sqrt(sum(r*r))
    do step = 1, most_steps
      call look(e, across, n, gap, slope, bend)
      turn = sign(longest_turn, slope)
      if (bend < 0.0_wp) turn = min(max(-slope/bend, -longest_turn), longest_turn)
      if (abs(turn) <= epsilon(1.0_wp)) return
      do cut = 1, most_cuts
        other = e + turn*across
        other = other/sqrt(sum(other*other))
        value = value_of(other)
        if (value >= gap - rounding) exit
        turn = 0.5_wp*turn
      end do
      if (cut > most_cuts) return
      e = other
      if (abs(turn) <= 1.0e-14_wp) exit
    end do
    call look(e, across, n, gap, slope, bend)

  contains

    pure subroutine look(e, across, n, gap, slope, bend)
      real(wp), intent(in) :: e(3)
      real(wp), intent(out) :: across(3), n(3), gap, slope, bend
      real(wp) :: u(3), h, d(3)
      across = cross(axis, e)
      n = cosine*e - sine*axis
      call ellipsoid_point(a, n, u, h)
      d = r - u
      gap = dot_product(r, n) - h
      slope = cosine*dot_product(d, across)
      bend = -cosine*dot_product(d, e) - cosine**2 &
             *(dot_product(across, matrix_times(a, across)) - dot_product(u, across)**2)/h
    end subroutine look

    pure real(wp) function value_of(e)
      real(wp), intent(in) :: e(3)
      real(wp) :: n(3)
      n = cosine*e - sine*axis
      value_of = dot_product(r, n) - sqrt(dot_product(n, matrix_times(a, n)))
    end function value_of
  end subroutine circle_gap

  !> Places where an ellipsoid inside a cylinder comes nearest to its wall: the greatest values of
  !! f(phi) = r.e + h_B(e) over the unit vectors e across the axis, at most two.
  pure subroutine bore_gap(r, a, axis, radius, n, e, gap)
    real(wp), intent(in) :: r(3)          !! centre of the ellipsoid from a point of the axis [m]
    real(wp), intent(in) :: a(6)          !! shape matrix [m^2]
    real(wp), intent(in) :: axis(3), radius
    integer(i4), intent(out) :: n         !! places
    real(wp), intent(out) :: e(3, 2)      !! directions from the axis, the first most outwards
    real(wp), intent(out) :: gap(2)       !! [m]
    integer(i4), parameter :: looks = 24
    real(wp), parameter :: apart = 2.0_wp*acos(-1.0_wp)/looks
    real(wp) :: first(3), across(3), value(0:looks + 1), trial(3)
    integer(i4) :: k

    first = outward(r, axis)
    across = cross(axis, first)
    do k = 0, looks + 1
      trial = cos((k - 1)*apart)*first + sin((k - 1)*apart)*across
      value(k) = reach_of(r, a, trial)
    end do
    n = 0
    do k = 1, looks
      if (value(k) < value(k - 1) .or. value(k) <= value(k + 1) .or. n == 2) cycle
      n = n + 1
      trial = cos((k - 1)*apart)*first + sin((k - 1)*apart)*across
      call climb(r, a, axis, trial)
      e(:, n) = trial
      gap(n) = radius - reach_of(r, a, trial)
    end do
    if (n > 0) return
    n = 1
    e(:, 1) = first
    gap(1) = radius - value(1)
  end subroutine bore_gap

  !> f(phi) of bore_gap [m].
  pure real(wp) function reach_of(r, a, e)
    real(wp), intent(in) :: r(3), a(6), e(3)
    reach_of = dot_product(r, e) + sqrt(dot_product(e, matrix_times(a, e)))
  end function reach_of

  !> From a direction near it to the greatest f(phi), by Newton's method.
  pure subroutine climb(r, a, axis, e)
    real(wp), intent(in) :: r(3), a(6), axis(3)
    real(wp), intent(inout) :: e(3)
    real(wp) :: across(3), u(3), h, slope, bend, turn, other(3), value
    integer(i4) :: step, cut

    do step = 1, most_steps
      across = cross(axis, e)
      call ellipsoid_point(a, e, u, h)
      slope = dot_product(r + u, across)
      bend = -dot_product(r + u, e) + (dot_product(across, matrix_times(a, across)) &
                                       - dot_product(u, across)**2)/h
      turn = sign(longest_turn, slope)
      if (bend < 0.0_wp) turn = min(max(-slope/bend, -longest_turn), longest_turn)
      value = dot_product(r, e) + h
      do cut = 1, most_cuts
        other = e + turn*across
        other = other/sqrt(sum(other*other))
        if (reach_of(r, a, other) >= value - 4.0_wp*epsilon(1.0_wp)*value) exit
        turn = 0.5_wp*turn
      end do
      if (cut > most_cuts) return
      e = other
      if (abs(turn) <= 1.0e-14_wp) return
    end do
  end subroutine climb

  !> Largest g(n) = r.n - radius |n across the axis| - h_B(n) over all n near the line of centres: a
  !! point (radius 0) or a ring around the axis.
  pure subroutine corner_gap(r, a, axis, radius, n, gap)
    real(wp), intent(in) :: r(3)      !! centre of the ellipsoid from the point or ring's centre [m]
    real(wp), intent(in) :: a(6)      !! shape matrix [m^2]
    real(wp), intent(in) :: axis(3), radius
    real(wp), intent(out) :: n(3)     !! normal, towards the ellipsoid
    real(wp), intent(out) :: gap      !! [m]
    real(wp) :: t(3), trial(3), other(3), value, residual, fraction, rounding
    integer(i4) :: step, cut

    n = r
    if (radius > 0.0_wp) n = r - radius*outward(r, axis)
    if (.not. sum(n*n) > tiny(1.0_wp)) n = outward(r, axis)
    n = n/sqrt(sum(n*n))
    rounding = 4.0_wp*epsilon(1.0_wp)*sqrt(sum(r*r))
    call corner_slope(r, a, axis, radius, n, gap, t, residual)
    do step = 1, most_steps
      if (residual <= 1.0e-30_wp) return
      fraction = min(1.0_wp, longest_turn/sqrt(sum(t*t)))
      do cut = 1, most_cuts
        trial = n + fraction*t
        trial = trial/sqrt(sum(trial*trial))
        call corner_slope(r, a, axis, radius, trial, value, other, residual)
        if (value >= gap - rounding) exit
        fraction = 0.5_wp*fraction
      end do
      if (cut > most_cuts) return
      n = trial
      gap = value
      t = other
    end do
  end subroutine corner_gap

  !> Unit vector across the axis towards r, any if r lies on it.
  pure function outward(r, axis) result(e)
    real(wp), intent(in) :: r(3), axis(3)
    real(wp) :: e(3), other(3)
    e = r - dot_product(r, axis)*axis
    if (.not. sum(e*e) > tiny(1.0_wp)) then
      other = 0.0_wp
      other(minloc(abs(axis), 1)) = 1.0_wp
      e = cross(axis, other)
    end if
    e = e/sqrt(sum(e*e))
  end function outward

  !> g(n), relative squared residual and ascent direction (Newton's, else the gradient's).
  pure subroutine corner_slope(r, a, axis, radius, n, gap, t, residual)
    real(wp), intent(in) :: r(3), a(6), axis(3), radius, n(3)
    real(wp), intent(out) :: gap, t(3), residual
    real(wp) :: u(3), h, d(3), s(6), m(6), det, e(3), across(3), sine

    call ellipsoid_point(a, n, u, h)
    gap = dot_product(r, n) - h
    d = r - u
    s(1:3) = (a(1:3) - u*u)/h + h*n*n
    s(4) = (a(4) - u(1)*u(2))/h + h*n(1)*n(2)
    s(5) = (a(5) - u(2)*u(3))/h + h*n(2)*n(3)
    s(6) = (a(6) - u(3)*u(1))/h + h*n(3)*n(1)
    if (radius > 0.0_wp) then
      e = outward(n, axis)
      sine = max(dot_product(n, e), 1.0e-3_wp)
      across = cross(axis, e)
      gap = gap - radius*dot_product(n, e)
      d = d - radius*e
      s(1:3) = s(1:3) + radius/sine*across*across
      s(4) = s(4) + radius/sine*across(1)*across(2)
      s(5) = s(5) + radius/sine*across(2)*across(3)
      s(6) = s(6) + radius/sine*across(3)*across(1)
    end if
    s(1:3) = s(1:3) + gap
    d = d - gap*n
    residual = sum(d*d)/(h*h)
    m(1) = s(2)*s(3) - s(5)*s(5)
    m(2) = s(3)*s(1) - s(6)*s(6)
    m(3) = s(1)*s(2) - s(4)*s(4)
    m(4) = s(5)*s(6) - s(4)*s(3)
    m(5) = s(6)*s(4) - s(5)*s(1)
    m(6) = s(4)*s(5) - s(6)*s(2)
    det = s(1)*m(1) + s(4)*m(4) + s(6)*m(6)
    if (det > 0.0_wp .and. m(3) > 0.0_wp .and. s(1) > 0.0_wp) then
      t = matrix_times(m, d)/det
    else
      t = d/h
    end if
    t = t - dot_product(t, n)*n
  end subroutine corner_slope
end module dem_round_gap
