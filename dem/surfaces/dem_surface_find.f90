!> Where a grain touches the surfaces near it.
!!
!! A feature is a face, an edge or a corner of the mesh (or a part of a cone) that is nearest to the
!! grain in its own right: the grain's deepest point against the face lies inside it, or the normal
!! lies in the cone of normals of the edge or corner. On flat and convex meshes there is one. On
!! faces bent inwards by less than the smooth angle there may be several: they are one contact,
!! weighted by their distance from the bend, so that none appears or vanishes with a jump. For
!! membranes see dem_membrane_find.
module dem_surface_find
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_figure, only: figure_type, figure_point, figure_curvature
  use dem_surface_state, only: dem_surfaces_type, is_soft, surface_cone, surface_membrane, &
    part_tip, part_flank, part_shaft, part_side, part_end, is_bore
  use dem_surface_feature, only: touches_type, features_type, most_features, add_feature, add
  use dem_membrane_find, only: search_membrane
  use dem_round_gap, only: circle_gap, corner_gap, bore_gap, most_places
  implicit none
  private
  public :: find_touches

  real(wp), parameter :: slack = 1.0e-9_wp     !! of the grain's radius: shared edges count on both
                                               !! sides, and once

contains

  !> All contacts of near grain g, whose figure is given.
  subroutine find_touches(s, g, grain, features, touches)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: features
    type(touches_type), intent(inout) :: touches
    integer(i4) :: c

    features%n = 0
    do c = s%list%near_start(g), s%list%near_start(g + 1) - 1
      features%image = s%list%image(:, c)
      if (s%list%candidate(c) > 0) then
        if (s%kind(s%mesh%owner(s%list%candidate(c))) == surface_membrane) then
          call search_membrane(s, g, c, grain, features)
        else
          call search_triangle(s, c, grain, features)
        end if
      else if (s%kind(-s%list%candidate(c)) == surface_cone) then
        call search_cone(s, -s%list%candidate(c), grain, features)
      else if (is_bore(s, -s%list%candidate(c))) then
        call search_bore(s, -s%list%candidate(c), grain, features)
      else
        call search_cylinder(s, -s%list%candidate(c), grain, features)
      end if
    end do
    call join_features(s, g, grain%radius, features, touches%n)
    touches%n = min(touches%n, ubound(s%list%history, 1))
    call sum_features(s, features, touches)
  end subroutine find_touches

  !> Face, edges and corners of a triangle.
  pure subroutine search_triangle(s, c, grain, features)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: c
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: features
    real(wp) :: p(3, 3), t(3, 3), m(3, 3), length(3), n(3), u(3), h, gap, foot(3), inside(3)
    integer(i4) :: triangle, k

    triangle = s%list%candidate(c)
    do k = 1, 3
      p(:, k) = s%mesh%x(:, s%mesh%corner(k, triangle)) + features%image
    end do
    n = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))
    n = n/sqrt(sum(n*n))
    gap = dot_product(grain%x - p(:, 1), n)
    if (abs(gap) > grain%span) return
    do k = 1, 3
      t(:, k) = p(:, 1 + mod(k, 3)) - p(:, k)
      length(k) = sqrt(sum(t(:, k)**2))
      t(:, k) = t(:, k)/length(k)
      m(:, k) = cross(n, t(:, k))
    end do
    if (gap < 0.0_wp) n = -n
    call figure_point(grain, n, u, h)
    gap = abs(gap) - h
    if (gap >= grain%reach) return
    foot = grain%x - u - gap*n
    do k = 1, 3
      inside(k) = dot_product(foot - p(:, k), m(:, k))
    end do
    if (all(inside >= -slack*grain%radius)) &
      call add(s, c, grain, n, gap, foot, shares(inside, length), features)
    do k = 1, 3
      if (inside(k) <= slack*grain%radius) &
        call search_edge(s, c, k, p(:, k), t(:, k), m(:, k), length(k), grain, features)
    end do
    do k = 1, 3
      if (inside(k) <= slack*grain%radius .or. inside(1 + mod(k + 1, 3)) <= slack*grain%radius) &
        call search_corner(s, c, k, p(:, k), grain, features)
    end do
  end subroutine search_triangle

  !> Shares of the corners at a foot with these distances from the edges k, k+1.
  pure function shares(inside, length) result(share)
    real(wp), intent(in) :: inside(3), length(3)
    real(wp) :: share(3)
    share = inside*length
    share = share/sum(share)
    share = share([2, 3, 1])
  end function shares

  !> Edge k of a candidate, worked by the lower of its two triangles.
  pure subroutine search_edge(s, c, k, p, t, m, length, grain, features)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: c, k
    real(wp), intent(in) :: p(3), t(3), m(3)  !! start, direction, inwards
    real(wp), intent(in) :: length
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: features
    real(wp) :: r(3), e(3), n(3), gap, u(3), h, along, share(3)
    integer(i4) :: triangle, mate

    triangle = s%list%candidate(c)
    mate = s%mesh%mate(k, triangle)
    if (mate > 0 .and. mate < triangle) return
    r = grain%x - p
    h = dot_product(r, t)
    if (h < -grain%span .or. h > length + grain%span) return
    if (sum(r*r) - h*h > grain%span*grain%span) return
    call circle_gap(r, grain, t, 0.0_wp, 1.0_wp, e, n, gap)
    if (gap >= grain%reach) return
    if (dot_product(n, m) > slack) return
    if (mate > 0) then
      if (dot_product(n, inwards(s, mate, s%mesh%corner(k, triangle), t, &
                                 p - features%image)) > slack) return
    end if
    call figure_point(grain, n, u, h)
    along = dot_product(r - u, t)
    if (along < -slack*grain%radius .or. along > length + slack*grain%radius) return
    share = 0.0_wp
    share(k) = 1.0_wp - along/length
    share(1 + mod(k, 3)) = along/length
    call add(s, c, grain, n, gap, p + along*t, share, features)
  end subroutine search_edge

  !> Direction from an edge into the triangle that holds it, at right angles to it.
  pure function inwards(s, triangle, first, t, p) result(m)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: triangle, first  !! first: a vertex of the edge
    real(wp), intent(in) :: t(3), p(3)          !! direction of the edge, a point of it
    real(wp) :: m(3), far(3), best
    integer(i4) :: k
    best = -1.0_wp
    m = 0.0_wp
    do k = 1, 3
      if (s%mesh%corner(k, triangle) == first) cycle
      far = s%mesh%x(:, s%mesh%corner(k, triangle)) - p
      far = far - dot_product(far, t)*t
      if (sum(far*far) <= best) cycle
      best = sum(far*far)
      m = far
    end do
    m = m/sqrt(best)
  end function inwards

  !> Corner k of a candidate, worked by the lowest of its triangles.
  pure subroutine search_corner(s, c, k, p, grain, features)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: c, k
    real(wp), intent(in) :: p(3)
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: features
    real(wp) :: r(3), n(3), gap, far(3), share(3)
    integer(i4) :: vertex, j

    vertex = s%mesh%corner(k, s%list%candidate(c))
    if (s%mesh%home(vertex) /= s%list%candidate(c)) return
    r = grain%x - p
    if (sum(r*r) > grain%span*grain%span) return
    call corner_gap(r, grain, [0.0_wp, 0.0_wp, 1.0_wp], 0.0_wp, n, gap)
    if (gap >= grain%reach) return
    do j = s%mesh%fan_start(vertex), s%mesh%fan_start(vertex + 1) - 1
      far = s%mesh%x(:, s%mesh%fan(j)) - (p - features%image)
      if (dot_product(n, far) > slack*sqrt(sum(far*far))) return
    end do
    share = 0.0_wp
    share(k) = 1.0_wp
    call add(s, c, grain, n, gap, p, share, features)
  end subroutine search_corner

  !> Tip, flank, shoulder and shaft of a cone; the shoulder counts to the flank.
  subroutine search_cone(s, b, grain, features)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: features
    real(wp) :: r(3), e(3), n(3), gap, u(3), h, along, height, axis(3), q(3), tip(3)

    axis = s%round%axis(:, b)
    associate (sine => s%round%sine(b), cosine => s%round%cosine(b), wide => s%round%radius(b))
      height = wide*cosine/sine
      tip = s%centre(:, b) + features%image
      r = grain%x - tip
      along = dot_product(r, axis)
      if (along < -grain%span .or. along > height + s%round%extent(b) + grain%span) return
      if (sum(r*r) - along**2 > (wide + grain%span)**2) return

      call corner_gap(r, grain, axis, 0.0_wp, n, gap)
      h = dot_product(n, axis)
      if (gap < grain%reach .and. sine*sqrt(max(1.0_wp - h*h, 0.0_wp)) + cosine*h <= slack) &
        call add_part(part_tip, tip, 0.0_wp)

      call circle_gap(r, grain, axis, sine, cosine, e, n, gap)
      call figure_point(grain, n, u, h)
      along = dot_product(r - u, sine*e + cosine*axis)
      h = slack*grain%radius
      if (gap < grain%reach .and. along >= -h .and. along <= wide/sine + h) &
        call add_part(part_flank, tip + along*(sine*e + cosine*axis), along*sine)

      q = r - height*axis
      call corner_gap(q, grain, axis, wide, n, gap)
      h = dot_product(n, axis)
      e = n - h*axis
      e = e/max(sqrt(sum(e*e)), tiny(1.0_wp))
      if (gap < grain%reach .and. h <= slack .and. h >= -sine - slack) &
        call add_part(part_flank, tip + height*axis + wide*e, wide)

      call circle_gap(q, grain, axis, 0.0_wp, 1.0_wp, e, n, gap)
      gap = gap - wide
      call figure_point(grain, n, u, h)
      along = dot_product(q - u, axis)
      if (gap < grain%reach .and. along >= -slack*grain%radius .and. along <= s%round%extent(b)) &
        call add_part(part_shaft, tip + (height + along)*axis + wide*e, wide)
    end associate

  contains

    !> The tool's curvature counts, but never for more than the grain's own.
    subroutine add_part(part, foot, distance)
      integer(i4), intent(in) :: part
      real(wp), intent(in) :: foot(3), distance  !! distance from the axis [m]
      real(wp) :: own
      integer(i4) :: k
      k = features%n
      call add_feature(b, s%first_part(b) + part, 0, n, gap, foot, grain%radius, features)
      if (features%n == k) return
      own = figure_curvature(grain, n)
      h = sqrt(max(1.0_wp - dot_product(n, axis)**2, 0.0_wp))
      features%curvature(features%n) = own + 0.5_wp*h/max(distance, 1.0_wp/own)
    end subroutine add_part
  end subroutine search_cone

  !> Side, end or rim of a cylinder with the grain outside: it is convex, so one of them is nearest.
  subroutine search_cylinder(s, b, grain, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: f
    real(wp) :: r(3), e(3), n(3), gap, u(3), h, along, axis(3), foot(3), wide, half

    axis = s%round%axis(:, b)
    wide = s%round%radius(b)
    half = s%round%extent(b)
    r = grain%x - (s%centre(:, b) + f%image)
    along = dot_product(r, axis)
    if (abs(along) - grain%span > half) return
    if (sum(r*r) - along**2 > (wide + grain%span)**2) return
    call circle_gap(r, grain, axis, 0.0_wp, 1.0_wp, e, n, gap)
    call figure_point(grain, n, u, h)
    along = dot_product(r - u, axis)
    if (abs(along) <= half) then
      call add_round(s, b, part_side, grain, n, gap - wide, along*axis + wide*e, 1.0_wp, f)
      return
    end if
    axis = sign(1.0_wp, along)*axis
    call figure_point(grain, axis, u, h)
    gap = dot_product(r, axis) - half - h
    foot = r - u - gap*axis
    if (sum(foot**2) - half**2 <= wide**2) then
      call add_round(s, b, part_end, grain, axis, gap, foot, 0.0_wp, f)
      return
    end if
    call corner_gap(r - half*axis, grain, axis, wide, n, gap)
    e = n - dot_product(n, axis)*axis
    h = sqrt(max(sum(e*e), tiny(1.0_wp)))
    call add_round(s, b, part_end, grain, n, gap, half*axis + wide/h*e, h, f)
  end subroutine search_cylinder

  !> The wall of a cylinder from inside; its ends are open. Grains wholly beyond it are not its own.
  subroutine search_bore(s, b, grain, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(figure_type), intent(in) :: grain
    type(features_type), intent(inout) :: f
    real(wp) :: r(3), e(3, most_places), gap(most_places), u(3), h, along
    integer(i4) :: k, places

    r = grain%x - (s%centre(:, b) + f%image)
    along = dot_product(r, s%round%axis(:, b))
    if (abs(along) - grain%span > s%round%extent(b)) return
    if (sum(r*r) - along**2 < max(s%round%radius(b) - grain%span, 0.0_wp)**2) return
    if (sum(r*r) - along**2 > (s%round%radius(b) + grain%span)**2) return
    call bore_gap(r, grain, s%round%axis(:, b), s%round%radius(b), places, e, gap)
    do k = 1, places
      call figure_point(grain, -e(:, k), u, h)
      along = dot_product(r - u, s%round%axis(:, b))
      if (abs(along) > s%round%extent(b)) cycle
      call add_round(s, b, part_side, grain, -e(:, k), gap(k), along*s%round%axis(:, b) &
                     + s%round%radius(b)*e(:, k), -1.0_wp, f)
    end do
  end subroutine search_bore

  !> A feature of a cylinder: half its curvature counts, by the part of the normal across the axis,
  !! towards the grain or, inside, away from it.
  subroutine add_round(s, b, part, grain, n, gap, foot, across, f)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b, part
    type(figure_type), intent(in) :: grain
    real(wp), intent(in) :: n(3), gap
    real(wp), intent(in) :: foot(3)  !! from the centre [m]
    real(wp), intent(in) :: across   !! of the normal; negative: inside [-]
    type(features_type), intent(inout) :: f
    real(wp) :: own
    integer(i4) :: k

    if (gap >= grain%reach) return
    k = f%n
    call add_feature(b, s%first_part(b) + part, 0, n, gap, s%centre(:, b) + f%image + foot, &
                     grain%radius, f)
    if (f%n == k) return
    own = figure_curvature(grain, n)
    f%curvature(f%n) = max(own + 0.5_wp*across/s%round%radius(b), 0.01_wp*own)
  end subroutine add_round

  !> Features of one smooth face become one contact; the others stay separate.
  pure subroutine join_features(s, g, radius, f, touches)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: radius
    type(features_type), intent(inout) :: f
    integer(i4), intent(out) :: touches
    integer(i4) :: i, j, group(most_features), number(most_features)

    group(:f%n) = [(i, i=1, f%n)]
    do i = 2, f%n
      do j = 1, i - 1
        if (group(j) == group(i)) cycle
        if (.not. linked(s, f, i, j)) cycle
        where (group(:f%n) == max(group(i), group(j))) group(:f%n) = min(group(i), group(j))
      end do
    end do
    call drop_apart(f, group)
    touches = 0
    do i = 1, f%n
      if (group(i) == i) then
        touches = touches + 1
        number(i) = touches
      end if
      f%touch(i) = number(group(i))
    end do
    f%weight(:f%n) = 1.0_wp
    do i = 1, f%n
      if (count(group(:f%n) == group(i)) > 1) f%weight(i) = bend_distance(s, g, f, i, radius)
    end do
  end subroutine join_features

  !> Features over a gap, which a neck may bridge, leave a group that has an overlap.
  pure subroutine drop_apart(f, group)
    type(features_type), intent(inout) :: f
    integer(i4), intent(inout) :: group(:)
    integer(i4) :: i, n, lead
    logical :: stays(most_features)

    if (.not. any(f%gap(:f%n) >= 0.0_wp)) return
    do i = 1, f%n
      stays(i) = f%gap(i) < 0.0_wp .or. .not. any(f%gap(:f%n) < 0.0_wp .and. &
                                                  group(:f%n) == group(i))
    end do
    n = 0
    do i = 1, f%n
      if (.not. stays(i)) cycle
      n = n + 1
      group(n) = group(i)
      f%body(n) = f%body(i)
      f%part(n) = f%part(i)
      f%candidate(n) = f%candidate(i)
      f%gap(n) = f%gap(i)
      f%curvature(n) = f%curvature(i)
      f%normal(:, n) = f%normal(:, i)
      f%foot(:, n) = f%foot(:, i)
      f%offset(:, n) = f%offset(:, i)
      f%share(:, n) = f%share(:, i)
    end do
    f%n = n
    do i = 1, n
      lead = findloc(group(:n), group(i), 1)
      where (group(:n) == group(i)) group(:n) = -lead
    end do
    group(:n) = -group(:n)
  end subroutine drop_apart

  !> Two features of a mesh that meet in a vertex and are bent by less than the smooth angle.
  pure logical function linked(s, f, i, j)
    type(dem_surfaces_type), intent(in) :: s
    type(features_type), intent(in) :: f
    integer(i4), intent(in) :: i, j
    integer(i4) :: k, a, b
    linked = .false.
    if (f%body(i) /= f%body(j) .or. f%candidate(i) == 0 .or. f%candidate(j) == 0) return
    if (s%kind(f%body(i)) == surface_membrane) return
    if (any(abs(f%offset(:, i) - f%offset(:, j)) > 0.0_wp)) return
    if (dot_product(f%normal(:, i), f%normal(:, j)) < s%cos_smooth(f%body(i))) return
    a = s%list%candidate(f%candidate(i))
    b = s%list%candidate(f%candidate(j))
    do k = 1, 3
      linked = linked .or. any(s%mesh%corner(:, a) == s%mesh%corner(k, b))
    end do
  end function linked

  !> Distance of a foot from the nearest edge that is bent towards the grain, at most the radius
  !! [m].
  pure real(wp) function bend_distance(s, g, f, i, radius) result(distance)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g
    type(features_type), intent(in) :: f
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: radius
    real(wp) :: p(3), t(3), m(3), length, r(3)
    integer(i4) :: c, k, triangle

    distance = radius
    do c = s%list%near_start(g), s%list%near_start(g + 1) - 1
      triangle = s%list%candidate(c)
      if (triangle <= 0) cycle
      if (s%mesh%owner(triangle) /= f%body(i)) cycle
      if (any(abs(s%list%image(:, c) - f%offset(:, i)) > 0.0_wp)) cycle
      do k = 1, 3
        if (s%mesh%mate(k, triangle) <= triangle) cycle
        p = s%mesh%x(:, s%mesh%corner(k, triangle))
        t = s%mesh%x(:, s%mesh%corner(1 + mod(k, 3), triangle)) - p
        length = sqrt(sum(t*t))
        t = t/length
        m = inwards(s, triangle, s%mesh%corner(k, triangle), t, p) &
            + inwards(s, s%mesh%mate(k, triangle), s%mesh%corner(k, triangle), t, p)
        if (dot_product(m, f%normal(:, i)) <= 1.0e-12_wp) cycle
        r = f%foot(:, i) - f%offset(:, i) - p
        r = r - min(max(dot_product(r, t), 0.0_wp), length)*t
        distance = min(distance, sqrt(sum(r*r)))
      end do
    end do
    distance = max(distance, 1.0e-15_wp*radius)
  end function bend_distance

  !> Contacts as weighted means of their features.
  pure subroutine sum_features(s, f, touches)
    type(dem_surfaces_type), intent(in) :: s
    type(features_type), intent(inout) :: f
    type(touches_type), intent(inout) :: touches
    integer(i4) :: k, i
    real(wp) :: whole, motion(6)

    do k = 1, touches%n
      whole = sum(f%weight(:f%n), mask=f%touch(:f%n) == k)
      touches%gap(k) = 0.0_wp
      touches%curvature(k) = 0.0_wp
      touches%normal(:, k) = 0.0_wp
      touches%foot(:, k) = 0.0_wp
      touches%motion(:, k) = 0.0_wp
      do i = 1, f%n
        if (f%touch(i) /= k) cycle
        f%weight(i) = f%weight(i)/whole
        call surface_motion(s, f, i, motion)
        touches%body(k) = f%body(i)
        touches%part(k) = f%part(i)
        touches%sign(k) = f%sign(i)
        touches%offset(:, k) = f%offset(:, i)
        touches%gap(k) = touches%gap(k) + f%weight(i)*f%gap(i)
        touches%curvature(k) = touches%curvature(k) + f%weight(i)*f%curvature(i)
        touches%normal(:, k) = touches%normal(:, k) + f%weight(i)*f%normal(:, i)
        touches%foot(:, k) = touches%foot(:, k) + f%weight(i)*f%foot(:, i)
        touches%motion(:, k) = touches%motion(:, k) + f%weight(i)*motion
      end do
      touches%normal(:, k) = touches%normal(:, k)/sqrt(sum(touches%normal(:, k)**2))
    end do
  end subroutine sum_features

  !> Velocity and spin of the surface at the foot of a feature.
  pure subroutine surface_motion(s, f, i, motion)
    type(dem_surfaces_type), intent(in) :: s
    type(features_type), intent(in) :: f
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: motion(6)
    integer(i4) :: b, corner(3)

    b = f%body(i)
    if (.not. is_soft(s, b)) then
      motion(1:3) = s%velocity(:, b) + cross(s%spin(:, b), f%foot(:, i) - f%offset(:, i) &
                                                   - s%centre(:, b))
      motion(4:6) = s%spin(:, b)
      if (is_bore(s, b)) motion(1:3) = motion(1:3) - s%round%swell(b)*f%normal(:, i)
      return
    end if
    corner = s%mesh%corner(:, s%list%candidate(f%candidate(i)))
    motion(1:3) = matmul(s%mesh%v(:, corner), f%share(:, i))
    motion(4:6) = triangle_spin(s%mesh%x(:, corner), s%mesh%v(:, corner))
  end subroutine surface_motion

  !> Spin of a triangle: the turn of its normal, and half the curl in its plane [rad/s].
  pure function triangle_spin(x, v) result(spin)
    real(wp), intent(in) :: x(3, 3), v(3, 3)
    real(wp) :: spin(3), e(3, 2), d(3, 2), n(3), area, dual(3, 2)
    integer(i4) :: k

    e(:, 1) = x(:, 2) - x(:, 1)
    e(:, 2) = x(:, 3) - x(:, 1)
    d(:, 1) = v(:, 2) - v(:, 1)
    d(:, 2) = v(:, 3) - v(:, 1)
    n = cross(e(:, 1), e(:, 2))
    area = sqrt(sum(n*n))
    n = n/area
    dual(:, 1) = cross(e(:, 2), n)/area
    dual(:, 2) = cross(n, e(:, 1))/area
    spin = 0.0_wp
    do k = 1, 2
      spin = spin - cross(n, dual(:, k))*dot_product(d(:, k), n) &
             + 0.5_wp*n*dot_product(cross(dual(:, k), d(:, k)), n)
    end do
  end function triangle_spin
end module dem_surface_find
