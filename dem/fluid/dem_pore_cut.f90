!> Where a closed body goes through a side of the liquid's grid: integrals over its cross-section
!! there of the functions of the nodes, times the velocity of each motion of the body. eq. D.76
module dem_pore_cut
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_pore_state, only: pore_grid_type
  use dem_pore_grid, only: brick_edges
  implicit none
  private
  public :: add_cuts

  !> One side, seen along its axis w; u, v, w are in cyclic order.
  type :: side_type
    integer(i4) :: u, v, w
    integer(i4) :: plane       !! of nodes on it along w, from 0
    real(wp) :: outward        !! sign of its normal along w
    real(wp) :: height         !! place along w [m]
    real(wp) :: h(3)           !! edges of a brick [m]
    real(wp) :: centre(3)      !! of the body, about which it turns [m]
  end type side_type

contains

  !> What motions of a body sweep at all sides that it goes through: added to (6, nodes) [m^2],
  !! [m^3].
  subroutine add_cuts(grid, p, centre, cut)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: p(:, :, :)  !! (3, corners, triangles), normals outwards [m]
    real(wp), intent(in) :: centre(3)   !! [m]
    real(wp), intent(inout) :: cut(:, :)
    type(side_type) :: side
    integer(i4) :: axis, end, k

    side%h = brick_edges(grid)
    side%centre = centre
    do axis = 1, 3
      side%w = axis
      side%u = 1 + modulo(axis, 3)
      side%v = 1 + modulo(axis + 1, 3)
      do end = 1, 2
        side%outward = merge(-1.0_wp, 1.0_wp, end == 1)
        side%plane = merge(0, grid%bricks(axis), end == 1)
        side%height = merge(grid%lower(axis), grid%upper(axis), end == 1)
        if (all(side%outward*(p(axis, :, :) - side%height) < 0.0_wp)) cycle
        if (all(side%outward*(p(axis, :, :) - side%height) >= 0.0_wp)) cycle
        do k = 1, size(p, 3)
          call add_facet(grid, side, p(:, :, k), cut)
        end do
      end do
    end do
  end subroutine add_cuts

  !> Where a triangle meets the side: lines along u from the side's edge to there count, or do not
  !! where the body begins. Between the edges of bricks integrals along v are exact.
  pure subroutine add_facet(grid, side, p, cut)
    type(pore_grid_type), intent(in) :: grid
    type(side_type), intent(in) :: side
    real(wp), intent(in) :: p(3, 3)
    real(wp), intent(inout) :: cut(:, :)
    real(wp) :: n(3), ends(3, 2), part(grid%bricks(side%u) + grid%bricks(side%v) + 4)
    integer(i4) :: k, many
    logical :: met

    call meet(side, p, ends, met)
    if (.not. met) return
    n = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))
    part(:2) = [0.0_wp, 1.0_wp]
    many = 2
    call split(grid, side%u, ends, part, many)
    call split(grid, side%v, ends, part, many)
    do k = 1, many - 1
      call add_piece(grid, side, ends, part(k:k + 1), cut, sign(1.0_wp, n(side%u)))
    end do
  end subroutine add_facet

  !> Add where a line meets the edges of bricks across an axis to its parts, which rise.
  pure subroutine split(grid, axis, ends, part, many)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: axis
    real(wp), intent(in) :: ends(3, 2)
    real(wp), intent(inout) :: part(:)
    integer(i4), intent(inout) :: many
    real(wp) :: way, t
    integer(i4) :: i, k
    way = ends(axis, 2) - ends(axis, 1)
    if (.not. abs(way) > 0.0_wp) return
    do i = 0, grid%bricks(axis)
      t = (grid%lower(axis) + (grid%upper(axis) - grid%lower(axis))*i/grid%bricks(axis) &
           - ends(axis, 1))/way
      if (.not. (t > 0.0_wp .and. t < 1.0_wp)) cycle
      k = many
      do while (part(k) > t)
        part(k + 1) = part(k)
        k = k - 1
      end do
      part(k + 1) = t
      many = many + 1
    end do
  end subroutine split

  !> A part of a line that is within one brick along u and v, by Gauss' rule of three points.
  pure subroutine add_piece(grid, side, ends, part, cut, sense)
    type(pore_grid_type), intent(in) :: grid
    type(side_type), intent(in) :: side
    real(wp), intent(in) :: ends(3, 2), part(2)
    real(wp), intent(inout) :: cut(:, :)
    real(wp), intent(in) :: sense  !! 1: the body ends there, along u
    real(wp), parameter :: gauss(3) = 0.5_wp + 0.5_wp*sqrt(0.6_wp)*[-1.0_wp, 0.0_wp, 1.0_wp]
    real(wp), parameter :: weight(3) = [5.0_wp, 8.0_wp, 5.0_wp]/18.0_wp
    real(wp) :: way(3), place(3), middle, width
    integer(i4) :: g, j
    way = ends(:, 2) - ends(:, 1)
    middle = ends(side%v, 1) + 0.5_wp*sum(part)*way(side%v)
    if (middle < grid%lower(side%v) .or. middle > grid%upper(side%v)) return
    j = min(int((middle - grid%lower(side%v))/side%h(side%v), i4), grid%bricks(side%v) - 1)
    width = abs(way(side%v))*(part(2) - part(1))
    do g = 1, 3
      place = ends(:, 1) + (part(1) + gauss(g)*(part(2) - part(1)))*way
      call add_line(grid, side, [place(side%u), place(side%v)], j, sense*width*weight(g), cut)
    end do
  end subroutine add_piece

  !> Both ends of the line in which a triangle meets the side.
  pure subroutine meet(side, p, ends, met)
    type(side_type), intent(in) :: side
    real(wp), intent(in) :: p(3, 3)
    real(wp), intent(out) :: ends(3, 2)
    logical, intent(out) :: met
    real(wp) :: d(3)
    integer(i4) :: k, in, out, found
    ends = 0.0_wp
    d = side%outward*(p(side%w, :) - side%height)
    met = any(d >= 0.0_wp) .and. any(d < 0.0_wp)
    if (.not. met) return
    found = 0
    do k = 1, 3
      in = k
      out = 1 + modulo(k, 3)
      if ((d(in) >= 0.0_wp) .eqv. (d(out) >= 0.0_wp)) cycle
      if (d(in) >= 0.0_wp) then  ! the same place for both triangles at the edge
        in = out
        out = k
      end if
      found = found + 1
      ends(:, found) = p(:, in) + (p(:, out) - p(:, in))*(d(in)/(d(in) - d(out)))
    end do
  end subroutine meet

  !> A line along u up to a place, at v in brick j of that axis.
  pure subroutine add_line(grid, side, place, j, weight, cut)
    type(pore_grid_type), intent(in) :: grid
    type(side_type), intent(in) :: side
    real(wp), intent(in) :: place(2)      !! u, v [m]
    integer(i4), intent(in) :: j          !! from 0
    real(wp), intent(in) :: weight        !! [m]
    real(wp), intent(inout) :: cut(:, :)
    real(wp) :: x, y, low, n(2), whole(2), arm(2), part(3)
    integer(i4) :: i, a, b, at(3), node

    y = (place(2) - grid%lower(side%v))/side%h(side%v) - j
    n = [1.0_wp - y, y]
    at(side%w) = side%plane
    do i = 0, grid%bricks(side%u) - 1
      low = grid%lower(side%u) + side%h(side%u)*i
      x = min((place(1) - low)/side%h(side%u), 1.0_wp)
      if (x <= 0.0_wp) return
      whole = side%h(side%u)*[x - 0.5_wp*x**2, 0.5_wp*x**2]
      arm = (low - side%centre(side%u))*whole &
            + side%h(side%u)**2*[0.5_wp*x**2 - x**3/3.0_wp, x**3/3.0_wp]
      do b = 1, 2
        do a = 1, 2
          at(side%u) = i + a - 1
          at(side%v) = j + b - 1
          node = 1 + at(1) + (grid%bricks(1) + 1)*(at(2) + (grid%bricks(2) + 1)*at(3))
          part = -side%outward*weight*n(b)*[whole(a), &
                 (place(2) - side%centre(side%v))*whole(a), -arm(a)]
          cut(side%w, node) = cut(side%w, node) + part(1)
          cut(3 + side%u, node) = cut(3 + side%u, node) + part(2)
          cut(3 + side%v, node) = cut(3 + side%v, node) + part(3)
        end do
      end do
    end do
  end subroutine add_line
end module dem_pore_cut
