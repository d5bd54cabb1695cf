!> Bricks and nodes of the grid of the liquid, and integrals of its trilinear functions.
!!
!! Places within a brick are in its edges from its centre: N_a = prod (1/2 + s_i x_i), s = -1, 1.
module dem_pore_grid
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type
  implicit none
  private
  public :: brick_count, node_count, brick_edges, brick_of, place_in, corners_of, node_place
  public :: sign_of, slopes, stiffness, on_side, side_share, beside

  !> Signs of the corners of a brick along x, y, z.
  real(wp), parameter :: sign_of(3, 8) = reshape([-1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, &
    -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, &
    -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp], [3, 8])

contains

  pure integer(i4) function brick_count(grid)
    type(pore_grid_type), intent(in) :: grid
    brick_count = product(grid%bricks)
  end function brick_count

  pure integer(i4) function node_count(grid)
    type(pore_grid_type), intent(in) :: grid
    node_count = product(grid%bricks + 1)
  end function node_count

  !> Edges of a brick [m].
  pure function brick_edges(grid) result(h)
    type(pore_grid_type), intent(in) :: grid
    real(wp) :: h(3)
    h = (grid%upper - grid%lower)/grid%bricks
  end function brick_edges

  !> Brick that holds a point, 0 outside the grid.
  pure integer(i4) function brick_of(grid, scale, x) result(brick)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: scale(3)  !! one over the edges of a brick [1/m]
    real(wp), intent(in) :: x(3)      !! [m]
    integer(i4) :: at(3)
    brick = 0
    if (.not. all(x >= grid%lower .and. x <= grid%upper)) return
    at = min(int((x - grid%lower)*scale, i4), grid%bricks - 1)
    brick = 1 + at(1) + grid%bricks(1)*(at(2) + grid%bricks(2)*at(3))
  end function brick_of

  !> Place of a brick along x, y, z, from 0.
  pure function place_in(grid, brick) result(at)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: brick
    integer(i4) :: at(3)
    at(1) = modulo(brick - 1, grid%bricks(1))
    at(2) = modulo((brick - 1)/grid%bricks(1), grid%bricks(2))
    at(3) = (brick - 1)/(grid%bricks(1)*grid%bricks(2))
  end function place_in

  !> Nodes at the corners of a brick, in the order of sign_of.
  pure function corners_of(grid, brick) result(node)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: brick
    integer(i4) :: node(8), at(3), row, layer
    at = place_in(grid, brick)
    row = grid%bricks(1) + 1
    layer = row*(grid%bricks(2) + 1)
    node(1) = 1 + at(1) + row*at(2) + layer*at(3)
    node(2) = node(1) + 1
    node(3:4) = node(1:2) + row
    node(5:8) = node(1:4) + layer
  end function corners_of

  !> Place of a node along x, y, z, from 0.
  pure function node_place(grid, node) result(at)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: node
    integer(i4) :: at(3)
    at(1) = modulo(node - 1, grid%bricks(1) + 1)
    at(2) = modulo((node - 1)/(grid%bricks(1) + 1), grid%bricks(2) + 1)
    at(3) = (node - 1)/((grid%bricks(1) + 1)*(grid%bricks(2) + 1))
  end function node_place

  !> Is a node on the side at an end (1, 2) of an axis?
  pure logical function on_side(grid, node, end, axis)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: node, end, axis
    integer(i4) :: at(3)
    at = node_place(grid, node)
    on_side = at(axis) == merge(0_i4, grid%bricks(axis), end == 1)
  end function on_side

  !> Is a brick at the side at an end (1, 2) of an axis?
  pure logical function beside(grid, brick, end, axis)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: brick, end, axis
    integer(i4) :: at(3)
    at = place_in(grid, brick)
    beside = at(axis) == merge(0_i4, grid%bricks(axis) - 1, end == 1)
  end function beside

  !> Part of a side's area that a node of it has: the integral of its function [m^2].
  pure real(wp) function side_share(grid, node, axis) result(area)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: node, axis
    real(wp) :: part(3)
    integer(i4) :: at(3)
    at = node_place(grid, node)
    part = brick_edges(grid)
    where (at == 0 .or. at == grid%bricks) part = 0.5_wp*part
    part(axis) = 1.0_wp
    area = product(part)
  end function side_share

  !> Integral over a brick of the derivative of N_a along j, times 1 and each local coordinate:
  !! (1 + coordinates, axis j, corner a) [m^2]. eq. D.36
  pure function slopes(h) result(g)
    real(wp), intent(in) :: h(3)  !! edges [m]
    real(wp) :: g(4, 3, 8)
    integer(i4) :: a, i, j
    g = 0.0_wp
    do a = 1, 8
      do j = 1, 3
        g(1, j, a) = sign_of(j, a)*product(h)/(4.0_wp*h(j))
        do i = 1, 3
          if (i == j) cycle
          g(1 + i, j, a) = sign_of(i, a)*sign_of(j, a)*product(h)/(24.0_wp*h(j))
        end do
      end do
    end do
  end function slopes

  !> Integral of grad N_a . grad N_b over a brick [m].
  pure function stiffness(h) result(l)
    real(wp), intent(in) :: h(3)
    real(wp) :: l(8, 8), factor(3)
    integer(i4) :: a, b, j
    do b = 1, 8
      do a = 1, 8
        l(a, b) = 0.0_wp
        do j = 1, 3
          factor = 0.25_wp + sign_of(:, a)*sign_of(:, b)/12.0_wp
          factor(j) = sign_of(j, a)*sign_of(j, b)/h(j)**2
          l(a, b) = l(a, b) + product(h)*product(factor)
        end do
      end do
    end do
  end function stiffness
end module dem_pore_grid
