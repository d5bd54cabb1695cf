!> The operators of the liquid on its grid: divergence D of what grains and walls do, its transpose,
!! storage C and flow L, and their sum as one matrix a brick.
!!
!! D v is the rate at which grains and walls compress the liquid of a node; the forces on the grains
!! are -D'p with the same numbers, so that power and resultants agree to rounding. eqs. D.36, D.37
module dem_pore_operator
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type, pore_fit_type
  use dem_pore_grid, only: brick_count, brick_edges, corners_of, node_count, slopes, stiffness, &
    on_side, side_share
  implicit none
  private
  public :: compress, add_hull, grain_forces, add_flow, storage, brick_matrices

contains

  !> What a motion of the grains compresses, by node, walls at rest: (D v)_a.
  subroutine compress(grid, field, rate)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: field(:, :, :)  !! (4, 3, bricks) of velocities or ways, fit_fields
    real(wp), intent(out) :: rate(:)        !! (nodes)
    real(wp) :: g(4, 3, 8)
    integer(i4) :: c, a, node(8)
    g = slopes(brick_edges(grid))
    rate = 0.0_wp
    do c = 1, brick_count(grid)
      node = corners_of(grid, c)
      do a = 1, 8
        rate(node(a)) = rate(node(a)) + sum(g(:, :, a)*field(:, :, c))
      end do
    end do
  end subroutine compress

  !> The same of a side that moves along its axis: what it sweeps is compressed.
  subroutine add_hull(grid, end, axis, v, rate)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: end, axis
    real(wp), intent(in) :: v            !! along the axis, velocity or displacement
    real(wp), intent(inout) :: rate(:)   !! (nodes)
    integer(i4) :: a
    real(wp) :: inward
    if (.not. abs(v) > 0.0_wp) return
    inward = merge(v, -v, end == 1)
    do a = 1, node_count(grid)
      if (on_side(grid, a, end, axis)) rate(a) = rate(a) + inward*side_share(grid, a, axis)
    end do
  end subroutine add_hull

  !> Forces -D'p on the grains; none outside the grid.
  subroutine grain_forces(grid, fit, p, force)
    type(pore_grid_type), intent(in) :: grid
    type(pore_fit_type), intent(in) :: fit
    real(wp), intent(in) :: p(:)            !! (nodes) [Pa]
    real(wp), intent(inout) :: force(:, :)  !! (3, grains) [N]
    real(wp) :: g(4, 3, 8), pull(4, 3), w
    integer(i4) :: c, a, k, node(8), i
    g = slopes(brick_edges(grid))
    !$omp parallel default(none) private(c, a, k, i, node, pull, w) shared(grid, fit, p, force, g)
    !$omp do schedule(static)
    do i = 1, size(force, 2)
      force(:, i) = 0.0_wp
    end do
    !$omp end do
    !$omp do schedule(static)
    do c = 1, brick_count(grid)
      node = corners_of(grid, c)
      pull = 0.0_wp
      do a = 1, 8
        pull = pull + p(node(a))*g(:, :, a)
      end do
      pull = matmul(fit%inverse(:, :, c), pull)
      do k = fit%start(c), fit%start(c + 1) - 1
        i = fit%grain(k)
        w = -fit%weight(k)
        do a = 1, 3
          force(a, i) = w*(pull(1, a) + fit%local(1, k)*pull(2, a) + fit%local(2, k)*pull(3, a) &
                           + fit%local(3, k)*pull(4, a))
        end do
      end do
    end do
    !$omp end do
    !$omp end parallel
  end subroutine grain_forces

  !> Add the rate at which Darcy's flow leaves the nodes, L p, and what it dissipates.
  subroutine add_flow(grid, mobility, p, rate, power)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: mobility(:)  !! (bricks) [m^2/(Pa s)]
    real(wp), intent(in) :: p(:)
    real(wp), intent(inout) :: rate(:)   !! (nodes) [m^3/s]
    real(wp), intent(out) :: power       !! [W]
    real(wp) :: l(8, 8), q(8)
    integer(i4) :: c, node(8)
    l = stiffness(brick_edges(grid))
    power = 0.0_wp
    do c = 1, brick_count(grid)
      node = corners_of(grid, c)
      q = mobility(c)*matmul(l, p(node))
      rate(node) = rate(node) + q
      power = power + dot_product(p(node), q)
    end do
  end subroutine add_flow

  !> Storage C of each node, lumped: the integral of N n/K_f [m^3/Pa].
  subroutine storage(grid, porosity, compliance, c)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: porosity(:)  !! (bricks)
    real(wp), intent(in) :: compliance   !! 1/K_f [1/Pa]
    real(wp), intent(out) :: c(:)        !! (nodes)
    real(wp) :: part
    integer(i4) :: b, node(8)
    c = 0.0_wp
    part = compliance*product(brick_edges(grid))/8.0_wp
    do b = 1, brick_count(grid)
      node = corners_of(grid, b)
      c(node) = c(node) + part*porosity(b)
    end do
  end subroutine storage

  !> span L + span^2 D M^-1 D' of every brick: what the liquid loses by flow and by the grains that
  !! give way to it in a time `span`.
  subroutine brick_matrices(grid, fit, mobility, span, matrix)
    type(pore_grid_type), intent(in) :: grid
    type(pore_fit_type), intent(in) :: fit
    real(wp), intent(in) :: mobility(:), span     !! [s]
    real(wp), intent(out) :: matrix(:, :, :)      !! (8, 8, bricks) [m^3/Pa]
    real(wp) :: l(8, 8), g(4, 3, 8), by(8, 4, 3), w(8, 4)
    integer(i4) :: c, b, j
    l = stiffness(brick_edges(grid))
    g = slopes(brick_edges(grid))
    by = reshape(g, [8, 4, 3], order=[2, 3, 1])  ! the corners first: eight go at once
    !$omp parallel do default(none) schedule(static) private(c, b, j, w) &
    !$omp   shared(grid, fit, mobility, span, matrix, l, g, by)
    do c = 1, brick_count(grid)
      do b = 1, 8
        matrix(:, b, c) = span*mobility(c)*l(:, b)
      end do
      if (fit%start(c + 1) == fit%start(c)) cycle
      do j = 1, 3
        w = span**2*matmul(by(:, :, j), fit%yield(:, :, c))
        do b = 1, 8
          matrix(:, b, c) = matrix(:, b, c) + matmul(w, g(:, j, b))
        end do
      end do
    end do
    !$omp end parallel do
  end subroutine brick_matrices
end module dem_pore_operator
