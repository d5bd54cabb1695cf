!> Gap of a grain to what has few normals: a line, a cylinder, a cone (their normals lie on a
!! circle), a point and a ring (any normal). The gap is the maximum of g(n) = r.n - h_A(n) - h_B(-n)
!! over these normals, h_B the grain's support (theory-dem, Surfaces). Starts from the line of
!! centres, so that a result depends on the two bodies alone. Inside a cylinder the gap is the least
!! distance of the grain's shadow from its circle, which several places of a long or angular one
!! can reach.
module dem_round_gap
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_figure, only: figure_type, figure_point, figure_bend, bend_along
  use dem_shape, only: at_half
  use dem_ellipsoid, only: matrix_times
  implicit none
  private
  public :: circle_gap, corner_gap, bore_gap, most_places

  integer(i4), parameter :: most_steps = 200, most_cuts = 30
  integer(i4), parameter :: most_places = 4  !! where a grain meets a bore
  integer(i4), parameter :: most_checks = 96  !! directions of the first search, around the circle
  real(wp), parameter :: longest_turn = 0.7_wp  !! of a Newton step [rad]

contains

  !> Largest g(n) = r.n - h_B(n) over n = c e(phi) - s axis, e a unit vector at right angles to the
  !! axis: lines and cylinders (s = 0), cones (s the sine of half the apex angle).
  pure subroutine circle_gap(r, f, axis, sine, cosine, e, n, gap)
    real(wp), intent(in) :: r(3)          !! centre of the grain from a point of the axis [m]
    type(figure_type), intent(in) :: f
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
      real(wp) :: u(3), h, d(3), radius
      across = cross(axis, e)
      n = cosine*e - sine*axis
      call bend_along(f, n, across, u, h, radius)
      d = r - u
      gap = dot_product(r, n) - h
      slope = cosine*dot_product(d, across)
      bend = -cosine*dot_product(d, e) - cosine**2*radius
    end subroutine look

    pure real(wp) function value_of(e)
      real(wp), intent(in) :: e(3)
      real(wp) :: n(3), u(3), h
      n = cosine*e - sine*axis
      call figure_point(f, n, u, h)
      value_of = dot_product(r, n) - h
    end function value_of
  end subroutine circle_gap

  !> Places where a grain inside a cylinder comes nearest to its wall: the greatest values of
  !! f(phi) = r.e + h_B(e) over the unit vectors e across the axis.
  subroutine bore_gap(r, f, axis, radius, n, e, gap)
    real(wp), intent(in) :: r(3)          !! centre of the grain from a point of the axis [m]
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: axis(3), radius
    integer(i4), intent(out) :: n         !! places
    real(wp), intent(out) :: e(3, most_places)  !! directions from the axis
    real(wp), intent(out) :: gap(most_places)   !! [m]
    real(wp) :: first(3), across(3), apart
    real(wp) :: value(0:most_checks + 1)
    integer(i4) :: k, looks

    first = outward(r, axis)
    across = cross(axis, first)
    looks = merge(most_checks, most_checks/4, flat_spots(f))
    apart = 2.0_wp*acos(-1.0_wp)/looks
    n = 0
    if (touches_once(f, radius)) then
      call climb_from(0.0_wp, longest_turn)
      if (gap(1) <= 0.0_wp) return
      n = 0
    end if
    do k = 0, looks + 1
      value(k) = reach_of(r, f, direction(real(k - 1, wp)))
    end do
    do k = 1, looks
      if (value(k) < value(k - 1) .or. value(k) <= value(k + 1)) cycle
      if (flat_spots(f)) then
        call climb_from(k - 2.0_wp, 0.25_wp*apart)
        call climb_from(real(k, wp), 0.25_wp*apart)
      else
        call climb_from(k - 1.0_wp, longest_turn)
      end if
    end do
    if (n > 0) return
    n = 1
    e(:, 1) = first
    gap(1) = radius - value(1)

  contains

    pure function direction(look) result(trial)
      real(wp), intent(in) :: look
      real(wp) :: trial(3)
      trial = cos(look*apart)*first + sin(look*apart)*across
    end function direction

    !> One more place, unless it was found before.
    subroutine climb_from(look, longest)
      real(wp), intent(in) :: look, longest
      real(wp), parameter :: same = 1.0e-6_wp  !! [rad]
      real(wp) :: trial(3)
      integer(i4) :: j
      trial = direction(look)
      call climb(r, f, axis, longest, trial)
      do j = 1, n
        if (sum((e(:, j) - trial)**2) < same**2) return
      end do
      if (n == most_places) return
      n = n + 1
      e(:, n) = trial
      gap(n) = radius - reach_of(r, f, trial)
    end subroutine climb_from
  end subroutine bore_gap

  !> Can the grain touch a bore in one place alone? An ellipsoid whose radii of curvature are all
  !! less than the bore's, and with them those of its shadow, rolls freely in it (Blaschke). They
  !! are at most a^2/c <= a^4/(a b c).
  pure logical function touches_once(f, radius)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: radius  !! of the bore [m]
    touches_once = .not. f%shaped
    if (touches_once) touches_once = f%radius**4 < radius*sqrt(f%square)
  end function touches_once

  !> Has the grain flat spots? Both rims of one may touch a wall that is bent, close to each other.
  pure logical function flat_spots(f)
    type(figure_type), intent(in) :: f
    flat_spots = f%shaped .and. f%shape(at_half) < 1.0_wp
  end function flat_spots

  !> f(phi) of bore_gap [m].
  pure real(wp) function reach_of(r, f, e)
    real(wp), intent(in) :: r(3), e(3)
    type(figure_type), intent(in) :: f
    real(wp) :: u(3), h
    call figure_point(f, -e, u, h)
    reach_of = dot_product(r, e) + h
  end function reach_of

  !> From a direction near it to the greatest f(phi), by Newton's method.
  pure subroutine climb(r, f, axis, longest, e)
    real(wp), intent(in) :: r(3), axis(3)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: longest  !! step [rad]
    real(wp), intent(inout) :: e(3)
    real(wp) :: across(3), u(3), h, radius, slope, bend, turn, other(3), value
    integer(i4) :: step, cut

    do step = 1, most_steps
      across = cross(axis, e)
      call bend_along(f, -e, across, u, h, radius)
      slope = dot_product(r - u, across)
      bend = -dot_product(r - u, e) + radius
      turn = sign(longest, slope)
      if (bend < 0.0_wp) turn = min(max(-slope/bend, -longest), longest)
      value = dot_product(r, e) + h
      do cut = 1, most_cuts
        other = e + turn*across
        other = other/sqrt(sum(other*other))
        if (reach_of(r, f, other) >= value - 4.0_wp*epsilon(1.0_wp)*value) exit
        turn = 0.5_wp*turn
      end do
      if (cut > most_cuts) return
      e = other
      if (abs(turn) <= 1.0e-14_wp) return
    end do
  end subroutine climb

  !> Largest g(n) = r.n - radius |n across the axis| - h_B(n) over all n near the line of centres: a
  !! point (radius 0) or a ring around the axis.
  pure subroutine corner_gap(r, f, axis, radius, n, gap)
    real(wp), intent(in) :: r(3)      !! centre of the grain from the point or ring's centre [m]
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: axis(3), radius
    real(wp), intent(out) :: n(3)     !! normal, towards the grain
    real(wp), intent(out) :: gap      !! [m]
    real(wp) :: t(3), trial(3), other(3), value, residual, fraction, rounding
    integer(i4) :: step, cut

    n = r
    if (radius > 0.0_wp) n = r - radius*outward(r, axis)
    if (.not. sum(n*n) > tiny(1.0_wp)) n = outward(r, axis)
    n = n/sqrt(sum(n*n))
    rounding = 4.0_wp*epsilon(1.0_wp)*sqrt(sum(r*r))
    call corner_slope(r, f, axis, radius, n, gap, t, residual)
    do step = 1, most_steps
      if (residual <= 1.0e-30_wp) return
      fraction = min(1.0_wp, longest_turn/sqrt(sum(t*t)))
      do cut = 1, most_cuts
        trial = n + fraction*t
        trial = trial/sqrt(sum(trial*trial))
        call corner_slope(r, f, axis, radius, trial, value, other, residual)
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
  pure subroutine corner_slope(r, f, axis, radius, n, gap, t, residual)
    real(wp), intent(in) :: r(3), axis(3), radius, n(3)
    type(figure_type), intent(in) :: f
    real(wp), intent(out) :: gap, t(3), residual
    real(wp) :: u(3), h, d(3), k(6), s(6), m(6), det, e(3), across(3), sine

    call figure_bend(f, n, u, h, k)
    gap = dot_product(r, n) - h
    d = r - u
    s(1:3) = k(1:3) + h*n*n
    s(4) = k(4) + h*n(1)*n(2)
    s(5) = k(5) + h*n(2)*n(3)
    s(6) = k(6) + h*n(3)*n(1)
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
