!> Geometry in the plan (x and y): outlines of ellipsoids, cells of points in a rectangle and the
!! part of them that lies outside discs. Areas are exact: cells are polygons, discs are cut along
!! their arcs. The rectangle may be periodic along x, y or both: then its sides are no borders.
module dem_plan
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: plan_type, free_area, cell_areas, disc_part, folded_in, nearest, with_images
  public :: outline_of, largest_reach, holds_centre, outlines_meet

  integer(i4), parameter :: sections = 40  !! of the golden section: 4e-9 of its interval

  !> A rectangle less discs, which must not overlap.
  type :: plan_type
    real(wp) :: lower(2) = 0.0_wp         !! corner [m]
    real(wp) :: upper(2) = 0.0_wp         !! [m]
    real(wp), allocatable :: disc(:, :)   !! (3, n) centre, radius, with images over faces [m]
    logical :: periodic(2) = .false.      !! along x, y
  end type plan_type

contains

  !> A point moved by whole periods into the rectangle [m].
  pure function folded_in(plan, x) result(inside)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: x(2)
    real(wp) :: inside(2)
    inside = x
    where (plan%periodic) inside = x - (plan%upper - plan%lower)* &
      floor((x - plan%lower)/(plan%upper - plan%lower))
  end function folded_in

  !> A vector between two points made as short as periods allow [m].
  pure function nearest(plan, apart) result(r)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: apart(2)
    real(wp) :: r(2)
    r = apart
    where (plan%periodic) r = apart - (plan%upper - plan%lower)* &
      anint(apart/(plan%upper - plan%lower))
  end function nearest

  !> Points (2, n) of the rectangle and, behind them, their images within a distance of it; `row`
  !! tells of which point each is one.
  pure subroutine with_images(plan, x, reach, points, row)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: x(:, :)   !! [m]
    real(wp), intent(in) :: reach(2)  !! along x, y [m]
    real(wp), allocatable, intent(out) :: points(:, :)
    integer(i4), allocatable, intent(out) :: row(:)
    logical :: close(size(x, 2))
    real(wp) :: moved(2, size(x, 2)), edge(2)
    integer(i4) :: i, j, k

    points = x
    row = [(k, k=1, size(x, 2))]
    edge = merge(plan%upper - plan%lower, 0.0_wp, plan%periodic)
    do j = -1, 1
      do i = -1, 1
        if ((i == 0 .and. j == 0) .or. any([i, j] /= 0 .and. .not. plan%periodic)) cycle
        do k = 1, size(x, 2)
          moved(:, k) = x(:, k) + [i, j]*edge
          close(k) = all(moved(:, k) > plan%lower - reach .and. moved(:, k) < plan%upper + reach)
        end do
        row = [row, pack([(k, k=1, size(x, 2))], close)]
        points = reshape([points, moved(:, pack([(k, k=1, size(x, 2))], close))], &
                         [2, size(row)])
      end do
    end do
  end subroutine with_images

  !> Area of the rectangle outside the discs [m^2].
  pure real(wp) function free_area(plan) result(area)
    type(plan_type), intent(in) :: plan
    real(wp) :: corner(2, 4)
    integer(i4) :: k
    corner = corners_of(plan)
    area = polygon_area(corner)
    do k = 1, size(plan%disc, 2)
      area = area - disc_part(corner, plan%disc(:, k))
    end do
  end function free_area

  !> Corners of the rectangle, counter-clockwise.
  pure function corners_of(plan) result(corner)
    type(plan_type), intent(in) :: plan
    real(wp) :: corner(2, 4)
    corner(:, 1) = plan%lower
    corner(:, 2) = [plan%upper(1), plan%lower(2)]
    corner(:, 3) = plan%upper
    corner(:, 4) = [plan%lower(1), plan%upper(2)]
  end function corners_of

  !> Free area of the Voronoi cell of each point (2, n) of the rectangle [m^2]; they add up to the
  !! free area. No two points may be the same.
  pure subroutine cell_areas(plan, x, area)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: x(:, :)     !! [m]
    real(wp), intent(out) :: area(:)    !! (n)
    real(wp), allocatable :: point(:, :), distance(:), cell(:, :)
    integer(i4), allocatable :: row(:)
    real(wp) :: reach
    integer(i4) :: i, j, k, n

    call with_images(plan, x, plan%upper - plan%lower, point, row)
    allocate (cell(2, size(row) + 4))
    do i = 1, size(x, 2)
      distance = (point(1, :) - x(1, i))**2 + (point(2, :) - x(2, i))**2
      distance(i) = huge(1.0_wp)
      n = 4
      cell(:, :4) = borders_of(plan, x(:, i))
      do
        reach = maxval((cell(1, :n) - x(1, i))**2 + (cell(2, :n) - x(2, i))**2)
        j = minloc(distance, 1)
        if (distance(j) > 4.0_wp*reach) exit
        call cut(cell, n, 0.5_wp*(x(:, i) + point(:, j)), point(:, j) - x(:, i))
        distance(j) = huge(1.0_wp)
      end do
      area(i) = polygon_area(cell(:, :n))
      do k = 1, size(plan%disc, 2)
        area(i) = area(i) - disc_part(cell(:, :n), plan%disc(:, k))
      end do
    end do
  end subroutine cell_areas

  !> Corners of the largest cell that a point can have: the rectangle, along periods about it.
  pure function borders_of(plan, x) result(corner)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: x(2)
    real(wp) :: corner(2, 4)
    type(plan_type) :: own
    own%lower = merge(x - 0.5_wp*(plan%upper - plan%lower), plan%lower, plan%periodic)
    own%upper = merge(x + 0.5_wp*(plan%upper - plan%lower), plan%upper, plan%periodic)
    corner = corners_of(own)
  end function borders_of

  !> Keep of a convex polygon what lies against the direction d from a point.
  pure subroutine cut(p, n, point, d)
    real(wp), intent(inout) :: p(:, :)
    integer(i4), intent(inout) :: n
    real(wp), intent(in) :: point(2), d(2)
    real(wp) :: old(2, n), side(n)
    integer(i4) :: k, next, m

    old = p(:, :n)
    side = (old(1, :) - point(1))*d(1) + (old(2, :) - point(2))*d(2)
    m = 0
    do k = 1, n
      next = 1 + mod(k, n)
      if (side(k) <= 0.0_wp) then
        m = m + 1
        p(:, m) = old(:, k)
      end if
      if (side(k)*side(next) < 0.0_wp) then
        m = m + 1
        p(:, m) = old(:, k) + side(k)/(side(k) - side(next))*(old(:, next) - old(:, k))
      end if
    end do
    n = m
  end subroutine cut

  !> Area of a polygon, counter-clockwise [m^2].
  pure real(wp) function polygon_area(p) result(area)
    real(wp), intent(in) :: p(:, :)
    integer(i4) :: k
    area = 0.0_wp
    do k = 2, size(p, 2) - 1
      area = area + 0.5_wp*cross(p(:, k) - p(:, 1), p(:, k + 1) - p(:, 1))
    end do
  end function polygon_area

  pure real(wp) function cross(a, b)
    real(wp), intent(in) :: a(2), b(2)
    cross = a(1)*b(2) - a(2)*b(1)
  end function cross

  !> Area that a polygon (counter-clockwise) and a disc have in common [m^2].
  pure real(wp) function disc_part(p, disc) result(area)
    real(wp), intent(in) :: p(:, :)  !! (2, corners) [m]
    real(wp), intent(in) :: disc(3)  !! centre, radius [m]
    integer(i4) :: k, next
    area = 0.0_wp
    do k = 1, size(p, 2)
      next = 1 + mod(k, size(p, 2))
      area = area + wedge(p(:, k) - disc(:2), p(:, next) - disc(:2), disc(3))
    end do
  end function disc_part

  !> Part of the triangle origin, a, b within a circle about the origin; negative if clockwise.
  pure real(wp) function wedge(a, b, radius) result(area)
    real(wp), intent(in) :: a(2), b(2), radius
    real(wp) :: d(2), square, half, rest, enter, leave, from(2), to(2)

    d = b - a
    square = dot_product(d, d)
    half = dot_product(a, d)
    rest = half*half - square*(dot_product(a, a) - radius*radius)
    enter = 1.0_wp
    leave = 0.0_wp
    if (rest > 0.0_wp .and. square > 0.0_wp) then
      enter = (-half - sqrt(rest))/square
      leave = (-half + sqrt(rest))/square
    end if
    if (enter >= 1.0_wp .or. leave <= 0.0_wp) then
      area = sector(a, b, radius)
      return
    end if
    from = a + max(enter, 0.0_wp)*d
    to = a + min(leave, 1.0_wp)*d
    area = 0.5_wp*cross(from, to)
    if (enter > 0.0_wp) area = area + sector(a, from, radius)
    if (leave < 1.0_wp) area = area + sector(to, b, radius)
  end function wedge

  !> Sector between two directions from the centre.
  pure real(wp) function sector(a, b, radius)
    real(wp), intent(in) :: a(2), b(2), radius
    sector = 0.5_wp*radius*radius*atan2(cross(a, b), dot_product(a, b))
  end function sector

  !> Outline in the plan of an ellipsoid with shape Q diag(a^2) Q^T: the matrix xx, yy, xy whose
  !! ellipse r.S^-1 r = 1 it is [m^2].
  pure function outline_of(turn, axes) result(s)
    real(wp), intent(in) :: turn(3, 3)  !! rotation, body to space
    real(wp), intent(in) :: axes(3)     !! semi-axes [m]
    real(wp) :: s(3)
    s(1) = sum((turn(1, :)*axes)**2)
    s(2) = sum((turn(2, :)*axes)**2)
    s(3) = sum(turn(1, :)*turn(2, :)*axes**2)
  end function outline_of

  !> Largest semi-axis of an outline [m].
  pure real(wp) function largest_reach(s) result(reach)
    real(wp), intent(in) :: s(3)
    reach = sqrt(0.5_wp*(s(1) + s(2)) + sqrt((0.5_wp*(s(1) - s(2)))**2 + s(3)**2))
  end function largest_reach

  !> r.S^-1 r [-].
  pure real(wp) function shape(s, r)
    real(wp), intent(in) :: s(3), r(2)
    shape = (s(2)*r(1)**2 - 2.0_wp*s(3)*r(1)*r(2) + s(1)*r(2)**2)/(s(1)*s(2) - s(3)**2)
  end function shape

  !> Does an outline hold the point at r from its centre?
  pure logical function holds_centre(s, r)
    real(wp), intent(in) :: s(3), r(2)
    holds_centre = shape(s, r) < 1.0_wp
  end function holds_centre

  !> Do two outlines, centres r apart, overlap? By the contact function of Perram and Wertheim
  !! (1985), max over t of t (1 - t) r.[(1 - t) S1 + t S2]^-1 r < 1; any t with more separates them
  !! apart.
  pure logical function outlines_meet(s1, s2, r) result(meet)
    real(wp), intent(in) :: s1(3), s2(3), r(2)
    real(wp), parameter :: golden = 0.61803398874989485_wp
    real(wp) :: low, high, left, right, at_left, at_right
    integer(i4) :: k

    low = 0.0_wp
    high = 1.0_wp
    left = high - golden
    right = low + golden
    at_left = value(left)
    at_right = value(right)
    meet = .false.
    do k = 1, sections
      if (max(at_left, at_right) >= 1.0_wp) return
      if (at_left < at_right) then
        low = left
        left = right
        at_left = at_right
        right = low + golden*(high - low)
        at_right = value(right)
      else
        high = right
        right = left
        at_right = at_left
        left = high - golden*(high - low)
        at_left = value(left)
      end if
    end do
    meet = max(at_left, at_right) < 1.0_wp

  contains

    pure real(wp) function value(t)
      real(wp), intent(in) :: t
      value = t*(1.0_wp - t)*shape((1.0_wp - t)*s1 + t*s2, r)
    end function value
  end function outlines_meet
end module dem_plan
