!> Where a grain touches a membrane, so that energy is conserved as the membrane bends and the grain
!! slides over its edges.
!!
!! The distance of the points of the membrane from the grain has minima, saddles and maxima: faces
!! whose foot lies inside are minima; an edge or corner is one of them, or none, by the number of
!! ways down from it. Each one that the grain overlaps is a contact of the contact law, and counts
!! by its index: 1 - (Euler's characteristic of the ways down), which is 1 for minima and maxima and
!! -1 for saddles. A minimum is born and dies with a saddle at the same place, so that the sum of
!! the energies and the forces stay continuous for any bend. On a flat membrane one contact is left,
!! in a sharp groove there are two. Each contact's force is the gradient of its own energy by the
!! places of grain and corners: the foot is a critical point, so its motion along the membrane does
!! no work.
module dem_membrane_find
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_figure, only: figure_type, figure_point, figure_curvature
  use dem_surface_state, only: dem_surfaces_type
  use dem_surface_feature, only: features_type, append
  use dem_round_gap, only: circle_gap, corner_gap
  implicit none
  private
  public :: search_membrane

  real(wp), parameter :: as_round = 1.0e-12_wp  !! part of the shape matrix

contains

  !> Face, edges and corners of candidate c of near grain g; edges and corners are worked by the
  !! lowest of their triangles.
  pure subroutine search_membrane(s, g, c, grain, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g, c
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: f
    real(wp) :: n(3), gap, foot(3), inside(3), length(3), share(3)
    integer(i4) :: triangle, k

    triangle = s%list%candidate(c)
    call look_down(s, triangle, grain, n, gap, foot, inside, length)
    if (gap >= grain%reach) return
    if (all(inside >= 0.0_wp)) then
      share = inside*length
      share = share/sum(share)
      call put(s, c, grain, n, gap, foot, share([2, 3, 1]), 1, f)
    end if
    do k = 1, 3
      if (s%mesh%mate(k, triangle) == 0 .or. s%mesh%mate(k, triangle) > triangle) &
        call search_edge(s, c, k, inside(k), grain, f)
      if (s%mesh%home(s%mesh%corner(k, triangle)) == triangle) &
        call search_corner(s, g, c, k, grain, f)
    end do
  end subroutine search_membrane

  !> The deepest point of the grain against the plane of a triangle: normal towards the grain, gap,
  !! foot, and its distances inwards from the edges k, k+1.
  pure subroutine look_down(s, triangle, grain, n, gap, foot, inside, length)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: triangle
    type(figure_type), intent(in) :: grain
    real(wp), intent(out) :: n(3), gap, foot(3), inside(3), length(3)
    real(wp) :: p(3, 3), t(3), up(3), u(3), h
    integer(i4) :: k

    p = s%mesh%x(:, s%mesh%corner(:, triangle))
    up = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))
    up = up/sqrt(sum(up*up))
    gap = dot_product(grain%x - p(:, 1), up)
    n = up
    if (gap < 0.0_wp) n = -up
    call figure_point(grain, n, u, h)
    gap = abs(gap) - h
    foot = grain%x - u - gap*n
    do k = 1, 3
      t = p(:, 1 + mod(k, 3)) - p(:, k)
      length(k) = sqrt(sum(t**2))
      inside(k) = dot_product(foot - p(:, k), cross(up, t))/length(k)
    end do
  end subroutine look_down

  !> Edge k of a candidate; inside: of the foot on the candidate's own plane.
  pure subroutine search_edge(s, c, k, inside, grain, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: c, k
    real(wp), intent(in) :: inside
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: f
    real(wp) :: p(3), t(3), r(3), e(3), n(3), gap, u(3), h, length, share(3)
    integer(i4) :: first, second, down

    first = s%mesh%corner(k, s%list%candidate(c))
    second = s%mesh%corner(1 + mod(k, 3), s%list%candidate(c))
    p = s%mesh%x(:, first)
    t = s%mesh%x(:, second) - p
    length = sqrt(sum(t*t))
    t = t/length
    r = grain%x - p
    h = dot_product(r, t)
    if (h < -grain%span .or. h > length + grain%span) return
    if (sum(r*r) - h*h > grain%span**2) return
    down = merge(1, 0, inside >= 0.0_wp) &
           + across(s, s%mesh%mate(k, s%list%candidate(c)), first, second, grain)
    if (down == 1) return
    call circle_gap(r, grain, t, 0.0_wp, 1.0_wp, e, n, gap)
    if (gap >= grain%reach) return
    if (.not. falls(s, first, second, grain)) return
    if (.not. falls(s, second, first, grain)) return
    call figure_point(grain, n, u, h)
    h = min(max(dot_product(r - u, t)/length, 0.0_wp), 1.0_wp)
    share = 0.0_wp
    share(k) = 1.0_wp - h
    share(1 + mod(k, 3)) = h
    call put(s, c, grain, n, gap, p + h*length*t, share, 1 - down, f)
  end subroutine search_edge

  !> 1 if there is a way down from an edge into its other triangle, if any, else 0.
  pure integer(i4) function across(s, mate, first, second, grain) result(down)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: mate, first, second
    type(figure_type), intent(in) :: grain
    real(wp) :: n(3), gap, foot(3), inside(3), length(3)
    integer(i4) :: k
    down = 0
    if (mate == 0) return
    call look_down(s, mate, grain, n, gap, foot, inside, length)
    do k = 1, 3
      if (all(s%mesh%corner([k, 1 + mod(k, 3)], mate) == [first, second]) .or. &
          all(s%mesh%corner([k, 1 + mod(k, 3)], mate) == [second, first])) &
        down = merge(1, 0, inside(k) >= 0.0_wp)
    end do
  end function across

  !> Corner k of a candidate: its ways down are the edges that descend, joined where both edges of a
  !! triangle do.
  pure subroutine search_corner(s, g, c, k, grain, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g, c, k
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: f
    real(wp) :: r(3), n(3), gap, share(3)
    integer(i4) :: vertex, j, down, triangle, other(2)

    vertex = s%mesh%corner(k, s%list%candidate(c))
    r = grain%x - s%mesh%x(:, vertex)
    if (sum(r*r) > grain%span**2) return
    call corner_gap(r, grain, [0.0_wp, 0.0_wp, 1.0_wp], 0.0_wp, n, gap)
    if (gap >= grain%reach) return
    down = 0
    do j = s%mesh%fan_start(vertex), s%mesh%fan_start(vertex + 1) - 1
      if (falls(s, vertex, s%mesh%fan(j), grain)) down = down + 1
    end do
    do j = s%list%near_start(g), s%list%near_start(g + 1) - 1
      triangle = s%list%candidate(j)
      if (triangle <= 0) cycle
      if (.not. any(s%mesh%corner(:, triangle) == vertex)) cycle
      other = pack(s%mesh%corner(:, triangle), s%mesh%corner(:, triangle) /= vertex)
      if (.not. falls(s, vertex, other(1), grain)) cycle
      if (falls(s, vertex, other(2), grain)) down = down - 1
    end do
    if (down == 1) return
    share = 0.0_wp
    share(k) = 1.0_wp
    call put(s, c, grain, n, gap, s%mesh%x(:, vertex), share, 1 - down, f)
  end subroutine search_corner

  !> Does the grain come nearer from one corner towards another?
  pure logical function falls(s, from, towards, grain)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: from, towards
    type(figure_type), intent(in) :: grain
    real(wp) :: r(3), n(3), gap
    r = grain%x - s%mesh%x(:, from)
    n = r
    if (grain%shaped .or. &
        any(abs(grain%a - grain%a(1)*[1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]) &
            > as_round*grain%a(1))) &
      call corner_gap(r, grain, [0.0_wp, 0.0_wp, 1.0_wp], 0.0_wp, n, gap)
    falls = dot_product(n, s%mesh%x(:, towards) - s%mesh%x(:, from)) >= 0.0_wp
  end function falls

  pure subroutine put(s, c, grain, n, gap, foot, share, index, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: c, index
    type(figure_type), intent(in) :: grain
    real(wp), intent(in) :: n(3), gap, foot(3), share(3)
    type(features_type), intent(inout) :: f
    integer(i4) :: k, body
    k = f%n
    body = s%mesh%owner(s%list%candidate(c))
    call append(body, s%first_part(body), c, n, gap, foot, f)
    if (f%n == k) return
    f%sign(f%n) = real(index, wp)
    f%share(:, f%n) = share
    f%curvature(f%n) = figure_curvature(grain, n)
  end subroutine put
end module dem_membrane_find
