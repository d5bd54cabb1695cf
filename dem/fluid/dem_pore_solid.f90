!> Closed bodies in the grid of the liquid: their triangles, and what of them lies in each brick.
!!
!! Volumes and moments are sums over columns a sixth of a brick apart, along each axis in turn,
!! whose ends are exact: a body that fills a brick has all of its volume, and a side of it along
!! those of the bricks is off by a 72nd of their edge at most. eq. D.75
module dem_pore_solid
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_pore_state, only: pore_grid_type
  use dem_pore_grid, only: brick_edges
  use dem_surface_solid, only: encloses, solid_of_triangles
  use dem_surface_state, only: dem_surfaces_type, surface_cone, is_round
  implicit none
  private
  public :: has_inside, facets_of, facets_of_tip, size_of_facets, fill_bricks, columns

  integer(i4), parameter :: sides = 72   !! of a round body
  integer(i4), parameter :: columns = 6  !! along an edge of a brick

  !> Columns along one axis, and the bricks around a body; places along u, v, w are in this order.
  type :: columns_type
    integer(i4) :: u, v, w   !! axes: w along the columns, u, v, w in cyclic order
    integer(i4) :: low(3)    !! bricks before the first along x, y, z
    real(wp) :: lower(3)     !! corner of the grid [m]
    real(wp) :: h(3)         !! edges of a brick [m]
  end type columns_type

contains

  !> Has body b an inside that no liquid is in? A penetrometer's upper end counts as closed.
  pure logical function has_inside(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    has_inside = s%kind(b) == surface_cone
    if (.not. has_inside) has_inside = encloses(s, b)
  end function has_inside

  !> Triangles of body b, from its centre at the start, normals outwards. Round bodies have so many
  !! sides, with the volume of the circle.
  function facets_of(s, b) result(p)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), allocatable :: p(:, :, :)  !! (3, corners, triangles) [m]
    real(wp) :: volume, centre(3)
    integer(i4) :: k, first

    if (is_round(s, b)) then
      p = round_facets(s, b)
    else
      first = s%first_triangle(b)
      allocate (p(3, 3, s%first_triangle(b + 1) - first))
      do k = 1, size(p, 3)
        p(:, :, k) = s%mesh%rest(:, s%mesh%corner(:, first + k - 1))
      end do
    end if
    call size_of_facets(p, volume, centre)
    if (volume < 0.0_wp) p = p(:, [1, 3, 2], :)
  end function facets_of

  !> Volume, negative where normals point inwards, and its centre.
  pure subroutine size_of_facets(p, volume, centre)
    real(wp), intent(in) :: p(:, :, :)
    real(wp), intent(out) :: volume, centre(3)
    real(wp) :: second(3, 3), six
    integer(i4) :: k
    call solid_of_triangles(reshape(p, [3, 3*size(p, 3)]), &
                            reshape([(k, k=1, 3*size(p, 3))], [3, size(p, 3)]), volume, centre, &
                            second)
    six = 0.0_wp
    do k = 1, size(p, 3)
      six = six + dot_product(p(:, 1, k), cross(p(:, 2, k), p(:, 3, k)))
    end do
    volume = sign(volume, six)
  end subroutine size_of_facets

  !> Triangles of the cone of a penetrometer, from its tip, with the disc at the shoulder.
  pure function facets_of_tip(s, b) result(p)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp) :: p(3, 3, 2*sides), ring(3, 0:sides), low(3)
    integer(i4) :: k
    low = shoulder(s, b)
    ring = ring_around(s%round%rest_axis(:, b), s%round%radius(b))
    do k = 1, sides
      p(:, :, 2*k - 1) = reshape([[0.0_wp, 0.0_wp, 0.0_wp], low + ring(:, k), &
                                  low + ring(:, k - 1)], [3, 3])
      p(:, :, 2*k) = reshape([low, low + ring(:, k - 1), low + ring(:, k)], [3, 3])
    end do
  end function facets_of_tip

  !> Middle of the disc where the cone of a penetrometer becomes its shaft, from the tip [m].
  pure function shoulder(s, b) result(x)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp) :: x(3)
    x = s%round%radius(b)*s%round%cosine(b)/s%round%sine(b)*s%round%rest_axis(:, b)
  end function shoulder

  !> Corners of a polygon across an axis, of the area of a circle [m].
  pure function ring_around(axis, radius) result(ring)
    real(wp), intent(in) :: axis(3), radius  !! [-], [m]
    real(wp), parameter :: step = 2.0_wp*acos(-1.0_wp)/sides
    real(wp) :: ring(3, 0:sides), e(3), f(3)
    integer(i4) :: k
    e = 0.0_wp
    e(minloc(abs(axis), 1)) = 1.0_wp
    e = e - dot_product(e, axis)*axis
    e = e/norm2(e)
    f = cross(axis, e)
    do k = 0, sides
      ring(:, k) = radius*sqrt(step/sin(step))*(cos(modulo(k, sides)*step)*e &
                                                + sin(modulo(k, sides)*step)*f)
    end do
  end function ring_around

  !> Rings around the axis and the ends of a cylinder, or of a cone from its tip up.
  pure function round_facets(s, b) result(p)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), allocatable :: p(:, :, :)
    real(wp) :: ring(3, 0:sides), low(3), high(3), foot(3)
    integer(i4) :: k

    associate (axis => s%round%rest_axis(:, b))
      ring = ring_around(axis, s%round%radius(b))
      low = -s%round%extent(b)*axis
      foot = low
      high = s%round%extent(b)*axis
      if (s%kind(b) == surface_cone) then
        foot = 0.0_wp
        low = shoulder(s, b)
        high = low + high
      end if
    end associate
    allocate (p(3, 3, 4*sides))
    do k = 1, sides
      p(:, :, 4*k - 3) = reshape([foot, low + ring(:, k), low + ring(:, k - 1)], [3, 3])
      p(:, :, 4*k - 2) = reshape([low + ring(:, k - 1), low + ring(:, k), high + ring(:, k)], &
                                 [3, 3])
      p(:, :, 4*k - 1) = reshape([low + ring(:, k - 1), high + ring(:, k), high + ring(:, k - 1)], &
                                 [3, 3])
      p(:, :, 4*k) = reshape([high, high + ring(:, k - 1), high + ring(:, k)], [3, 3])
    end do
  end function round_facets

  !> Integrals of [1 x][1 x]' over a body's parts of the bricks from low + 1 on [m^3], x from the
  !! centre of a brick in its edges.
  subroutine fill_bricks(grid, p, low, moment)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: p(:, :, :)                        !! (3, corners, triangles) [m]
    integer(i4), intent(out) :: low(3)
    real(wp), allocatable, intent(out) :: moment(:, :, :, :, :)  !! (4, 4, along x, y, z)
    type(columns_type) :: c
    integer(i4) :: high(3), axis, k

    c%h = brick_edges(grid)
    c%lower = grid%lower
    do axis = 1, 3
      low(axis) = whole((minval(p(axis, :, :)) - grid%lower(axis))/c%h(axis), grid%bricks(axis))
      high(axis) = whole((maxval(p(axis, :, :)) - grid%lower(axis))/c%h(axis), &
                         grid%bricks(axis) - 1) + 1
      high(axis) = max(high(axis), low(axis))
    end do
    c%low = low
    allocate (moment(4, 4, high(1) - low(1), high(2) - low(2), high(3) - low(3)), source=0.0_wp)
    if (size(moment) == 0) return
    do axis = 1, 3
      c%w = axis
      c%u = 1 + modulo(axis, 3)
      c%v = 1 + modulo(axis + 1, 3)
      do k = 1, size(p, 3)
        call add_facet(c, p(:, :, k), moment)
      end do
    end do
  end subroutine fill_bricks

  !> A number rounded down, from 0 to a most.
  pure integer(i4) function whole(x, most)
    real(wp), intent(in) :: x
    integer(i4), intent(in) :: most
    whole = int(min(max(floor(max(min(x, 1.0e9_wp), -1.0e9_wp)), 0), most), i4)
  end function whole

  !> All columns that meet a triangle, up to it, or down from it where its normal points down.
  pure subroutine add_facet(c, p, moment)
    type(columns_type), intent(in) :: c
    real(wp), intent(in) :: p(3, 3)  !! (axes, corners)
    real(wp), intent(inout) :: moment(:, :, :, :, :)
    real(wp) :: n(3), at(2), step(2), corner(2, 3), height, weight
    integer(i4) :: first(2), last(2), most(2), i, j

    n = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))
    if (.not. abs(n(c%w)) > 0.0_wp) return
    step = c%h([c%u, c%v])/columns
    corner = p([c%u, c%v], :)
    if (n(c%w) < 0.0_wp) corner = corner(:, [1, 3, 2])
    weight = sign(product(c%h)/(3.0_wp*columns**2), n(c%w))
    most = [size(moment, 2 + c%u), size(moment, 2 + c%v)]
    do i = 1, 2
      at(i) = c%lower(merge(c%u, c%v, i == 1)) + columns*step(i)*c%low(merge(c%u, c%v, i == 1))
      first(i) = whole((minval(corner(i, :)) - at(i))/step(i), columns*most(i) - 1)
      last(i) = whole((maxval(corner(i, :)) - at(i))/step(i), columns*most(i) - 1)
    end do
    do j = first(2), last(2)
      do i = first(1), last(1)
        associate (place => at + step*([i, j] + 0.5_wp + shift([i, j])))
          if (.not. holds(corner, place)) cycle
          height = p(c%w, 1) - (n(c%u)*(place(1) - p(c%u, 1)) + n(c%v)*(place(2) - p(c%v, 1))) &
                   /n(c%w)
          height = min(max(height, minval(p(c%w, :))), maxval(p(c%w, :)))
          call add_column(c, [i, j], height, weight, moment)
        end associate
      end do
    end do
  end subroutine add_facet

  !> Does a triangle that turns to the left hold a point? One on an edge is of one of both triangles
  !! there: it counts as moved a little along the first axis, and far less along the second.
  pure logical function holds(corner, place)
    real(wp), intent(in) :: corner(2, 3), place(2)
    real(wp) :: side, a(2), b(2)
    integer(i4) :: k
    logical :: turned
    holds = .false.
    do k = 1, 3
      a = corner(:, k)
      b = corner(:, 1 + modulo(k, 3))
      turned = b(1) < a(1) .or. (b(1) <= a(1) .and. b(2) < a(2))
      if (turned) then  ! the same number for both triangles
        b = a
        a = corner(:, 1 + modulo(k, 3))
      end if
      side = (b(1) - a(1))*(place(2) - a(2)) - (b(2) - a(2))*(place(1) - a(1))
      if (.not. abs(side) > 0.0_wp) side = merge(-1.0_wp, 1.0_wp, b(2) > a(2) .or. &
                                                 (b(2) >= a(2) .and. b(1) <= a(1)))
      if (turned .neqv. (side < 0.0_wp)) return
    end do
    holds = .true.
  end function holds

  !> A column from the middle of its cell, in cells: no two of a brick are in one plane along a
  !! side.
  pure function shift(at)
    integer(i4), intent(in) :: at(2)
    real(wp) :: shift(2)
    shift = (modulo([at(2), at(1)], columns) + 0.5_wp)/columns - 0.5_wp
  end function shift

  !> The part of a column below a height.
  pure subroutine add_column(c, at, height, weight, moment)
    type(columns_type), intent(in) :: c
    integer(i4), intent(in) :: at(2)        !! number along u and v, from 0
    real(wp), intent(in) :: height, weight  !! [m], volume of the column in a brick [m^3]
    real(wp), intent(inout) :: moment(:, :, :, :, :)
    real(wp) :: base(4), part(4, 4), top, z
    integer(i4) :: brick(3), k

    base = 0.0_wp
    base(1) = 1.0_wp
    base([1 + c%u, 1 + c%v]) = (modulo(at, columns) + 0.5_wp + shift(at))/columns - 0.5_wp
    brick(c%u) = 1 + at(1)/columns
    brick(c%v) = 1 + at(2)/columns
    top = (height - c%lower(c%w))/c%h(c%w) - c%low(c%w)
    do k = 1, size(moment, 2 + c%w)
      z = min(top - (k - 1), 1.0_wp)
      if (z <= 0.0_wp) return
      brick(c%w) = k
      part = z*spread(base, 2, 4)*spread(base, 1, 4)
      part(:, 1 + c%w) = 0.5_wp*z*(z - 1.0_wp)*base
      part(1 + c%w, :) = part(:, 1 + c%w)
      part(1 + c%w, 1 + c%w) = ((z - 0.5_wp)**3 + 0.125_wp)/3.0_wp
      associate (m => moment(:, :, brick(1), brick(2), brick(3)))
        m = m + weight*part
      end associate
    end do
  end subroutine add_column
end module dem_pore_solid
