!> Pressures of an exchange: conjugate gradients on the free nodes, with the diagonal before it.
module dem_pore_solve
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type, pore_mixing_type
  use dem_pore_grid, only: brick_count, corners_of
  use dem_pore_mixing, only: add_mixing, mixing_diagonal
  implicit none
  private
  public :: pore_equations_type, solve_pressure, apply

  real(wp), parameter :: close = 1.0e-10_wp  !! residual over the right-hand side
  integer(i4), parameter :: most = 2000      !! turns

  !> (C + matrices + span S + give give') p = rhs.
  type :: pore_equations_type
    real(wp), allocatable :: storage(:)       !! (nodes) diagonal C [m^3/Pa]
    real(wp), allocatable :: matrix(:, :, :)  !! (8, 8, bricks) [m^3/Pa]
    real(wp), allocatable :: rhs(:)           !! (nodes) [m^3]
    real(wp), allocatable :: give(:, :)       !! (nodes, n) its columns' outer products add to the
                                              !! matrix: free bodies give way
    type(pore_mixing_type) :: mixing          !! S
    real(wp) :: span = 0.0_wp                 !! for which it mixes; 0: it does not [s]
  end type pore_equations_type

contains

  !> Pressures of nodes that are not held; held ones keep the p they come with.
  subroutine solve_pressure(grid, equations, free, p, turns)
    type(pore_grid_type), intent(in) :: grid
    type(pore_equations_type), intent(in) :: equations
    real(wp), intent(in) :: free(:)    !! (nodes) 1, or 0 where p is held
    real(wp), intent(inout) :: p(:)    !! (nodes) first guess in, pressures out [Pa]
    integer(i4), intent(out) :: turns  !! -1: it does not converge
    real(wp), dimension(size(p)) :: diagonal, r, z, s, q
    real(wp) :: rho, before, scale, step
    integer(i4), allocatable :: brick(:), corner(:, :)

    associate (e => equations, rhs => equations%rhs)
      call list_bricks(grid, free, brick, corner)
      call diagonal_of(grid, e, diagonal)
      call multiply(e, brick, corner, (1.0_wp - free)*p, q)
      scale = sum(free*(rhs - q)**2/diagonal)
      if (.not. scale > 0.0_wp) then
        p = (1.0_wp - free)*p
        turns = merge(0, -1, abs(scale) <= 0.0_wp)
        return
      end if
      call multiply(e, brick, corner, p, q)
      r = free*(rhs - q)
      s = 0.0_wp
      before = 1.0_wp
      do turns = 0, most
        z = r/diagonal
        rho = sum(r*z)
        if (rho <= close**2*scale) return
        s = z + merge(rho/before, 0.0_wp, turns > 0)*s
        call multiply(e, brick, corner, s, q)
        q = free*q
        step = rho/sum(s*q)
        p = p + step*s
        r = r - step*q
        before = rho
      end do
      turns = -1
    end associate
  end subroutine solve_pressure

  !> The left side at all nodes.
  subroutine apply(grid, equations, p, product)
    type(pore_grid_type), intent(in) :: grid
    type(pore_equations_type), intent(in) :: equations
    real(wp), intent(in) :: p(:)
    real(wp), intent(out) :: product(:)
    integer(i4), allocatable :: brick(:), corner(:, :)
    call list_bricks(grid, 0.0_wp*p + 1.0_wp, brick, corner)
    call multiply(equations, brick, corner, p, product)
  end subroutine apply

  !> Bricks with a corner that is free, and their corners; others add to nothing that is asked for.
  pure subroutine list_bricks(grid, free, brick, corner)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: free(:)                       !! (nodes)
    integer(i4), allocatable, intent(out) :: brick(:)
    integer(i4), allocatable, intent(out) :: corner(:, :)  !! (8, as brick)
    integer(i4) :: listed(brick_count(grid)), nodes(8, brick_count(grid)), c, n
    n = 0
    do c = 1, brick_count(grid)
      nodes(:, n + 1) = corners_of(grid, c)
      if (.not. any(free(nodes(:, n + 1)) > 0.0_wp)) cycle
      n = n + 1
      listed(n) = c
    end do
    brick = listed(:n)
    corner = nodes(:, :n)
  end subroutine list_bricks

  !> The same with these bricks.
  pure subroutine multiply(equations, brick, corner, p, product)
    type(pore_equations_type), intent(in) :: equations
    real(wp), intent(in) :: p(:)
    integer(i4), contiguous, intent(in) :: brick(:), corner(:, :)
    real(wp), intent(out) :: product(:)
    integer(i4) :: k
    call multiply_bricks(equations%storage, equations%matrix, brick, corner, p, product)
    if (equations%span > 0.0_wp) call add_mixing(equations%mixing, equations%span, p, product)
    if (.not. allocated(equations%give)) return
    do k = 1, size(equations%give, 2)
      product = product + dot_product(equations%give(:, k), p)*equations%give(:, k)
    end do
  end subroutine multiply

  !> The part of storage and bricks.
  pure subroutine multiply_bricks(storage, matrix, brick, corner, p, product)
    real(wp), intent(in) :: storage(:), p(:)
    real(wp), contiguous, intent(in) :: matrix(:, :, :)
    integer(i4), contiguous, intent(in) :: brick(:), corner(:, :)
    real(wp), intent(out) :: product(:)
    real(wp) :: to(8), at
    integer(i4) :: k, b, a
    product = storage*p
    do k = 1, size(brick)
      to = 0.0_wp
      do b = 1, 8
        at = p(corner(b, k))
        to = to + matrix(1:8, b, brick(k))*at
      end do
      do a = 1, 8
        product(corner(a, k)) = product(corner(a, k)) + to(a)
      end do
    end do
  end subroutine multiply_bricks

  subroutine diagonal_of(grid, equations, diagonal)
    type(pore_grid_type), intent(in) :: grid
    type(pore_equations_type), intent(in) :: equations
    real(wp), intent(out) :: diagonal(:)
    integer(i4) :: c, a, node(8)
    diagonal = equations%storage
    do c = 1, brick_count(grid)
      node = corners_of(grid, c)
      do a = 1, 8
        diagonal(node(a)) = diagonal(node(a)) + equations%matrix(a, a, c)
      end do
    end do
    if (equations%span > 0.0_wp) diagonal = diagonal + equations%span* &
      mixing_diagonal(equations%mixing, size(diagonal, kind=i4))
    if (allocated(equations%give)) diagonal = diagonal + sum(equations%give**2, 2)
    where (.not. diagonal > 0.0_wp) diagonal = tiny(1.0_wp)**0.5_wp
  end subroutine diagonal_of
end module dem_pore_solve
