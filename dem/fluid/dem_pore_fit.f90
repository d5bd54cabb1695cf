!> A linear velocity in each brick, fitted to its grains by their volumes.
!!
!! [a L]' = A^-1 sum V [1 x]' v', A = sum V [1 x][1 x]': exact for every rigid motion and uniform
!! strain. A brick with few grains, or grains that do not span it, has the mean velocity alone.
!! eq. D.35
module dem_pore_fit
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type, pore_fit_type
  use dem_pore_grid, only: brick_count, brick_edges, brick_of, place_in
  implicit none
  private
  public :: make_fit, fitted

  integer(i4), parameter :: fewest = 8           !! grains that make a slope
  real(wp), parameter :: most_skewed = 1.0e4_wp  !! condition of A beyond which there is none

contains

  !> Grains into bricks, and the fit of each. What does not yield has no inverse mass.
  subroutine make_fit(grid, x, volume, inverse_mass, fit)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(:, :)          !! (3, grains) [m]
    real(wp), intent(in) :: volume(:)        !! [m^3]
    real(wp), intent(in) :: inverse_mass(:)  !! [1/kg]
    type(pore_fit_type), intent(inout) :: fit
    integer(i4) :: bricks, c
    real(wp) :: a(4, 4), b(4, 4)

    bricks = brick_count(grid)
    call sort_grains(grid, x, fit)
    call place_grains(grid, x, volume, fit)
    if (allocated(fit%inverse)) then
      if (size(fit%inverse, 3) /= bricks) deallocate (fit%inverse, fit%yield)
    end if
    if (.not. allocated(fit%inverse)) allocate (fit%inverse(4, 4, bricks), fit%yield(4, 4, bricks))
    do c = 1, bricks
      call moments(fit, c, inverse_mass, a, b)
      call invert(a, fit%start(c + 1) - fit%start(c), fit%inverse(:, :, c))
      fit%yield(:, :, c) = matmul(fit%inverse(:, :, c), matmul(b, fit%inverse(:, :, c)))
    end do
    fit%ready = .true.
  end subroutine make_fit

  !> Count and list the grains of each brick.
  subroutine sort_grains(grid, x, fit)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(:, :)
    type(pore_fit_type), intent(inout) :: fit
    integer(i4), allocatable :: next(:)
    integer(i4) :: i, c
    if (allocated(fit%brick)) then
      if (size(fit%brick) /= size(x, 2)) deallocate (fit%brick, fit%grain)
    end if
    if (.not. allocated(fit%brick)) allocate (fit%brick(size(x, 2)), fit%grain(size(x, 2)))
    allocate (next(brick_count(grid) + 1), source=0)
    do i = 1, size(x, 2)
      c = brick_of(grid, x(:, i))
      fit%brick(i) = c
      if (c > 0) next(c + 1) = next(c + 1) + 1
    end do
    next(1) = 1
    do c = 2, size(next)
      next(c) = next(c) + next(c - 1)
    end do
    fit%start = next
    do i = 1, size(x, 2)
      c = fit%brick(i)
      if (c == 0) cycle
      fit%grain(next(c)) = i
      next(c) = next(c) + 1
    end do
  end subroutine sort_grains

  !> Places in the bricks and weights, by brick.
  subroutine place_grains(grid, x, volume, fit)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(:, :), volume(:)
    type(pore_fit_type), intent(inout) :: fit
    real(wp) :: h(3), centre(3)
    integer(i4) :: c, k, many
    many = size(x, 2)
    if (allocated(fit%weight)) then
      if (size(fit%weight) /= many) deallocate (fit%weight, fit%local)
    end if
    if (.not. allocated(fit%weight)) allocate (fit%weight(many), fit%local(3, many))
    h = brick_edges(grid)
    do c = 1, brick_count(grid)
      centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
      do k = fit%start(c), fit%start(c + 1) - 1
        fit%local(:, k) = (x(:, fit%grain(k)) - centre)/h
        fit%weight(k) = volume(fit%grain(k))
      end do
    end do
  end subroutine place_grains

  !> A = sum V [1 x][1 x]' and B = sum V^2/m [1 x][1 x]' of a brick.
  pure subroutine moments(fit, c, inverse_mass, a, b)
    type(pore_fit_type), intent(in) :: fit
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: inverse_mass(:)
    real(wp), intent(out) :: a(4, 4), b(4, 4)
    real(wp) :: base(4), v, w
    integer(i4) :: k, j
    a = 0.0_wp
    b = 0.0_wp
    do k = fit%start(c), fit%start(c + 1) - 1
      base = [1.0_wp, fit%local(:, k)]
      v = fit%weight(k)
      w = v*v*inverse_mass(fit%grain(k))
      do j = 1, 4
        a(:, j) = a(:, j) + (v*base(j))*base
        b(:, j) = b(:, j) + (w*base(j))*base
      end do
    end do
  end subroutine moments

  !> Inverse of A, or of its first entry alone, or zero without grains.
  pure subroutine invert(a, many, inverse)
    real(wp), intent(in) :: a(4, 4)
    integer(i4), intent(in) :: many
    real(wp), intent(out) :: inverse(4, 4)
    real(wp) :: lower(4, 4), column(4)
    integer(i4) :: j
    logical :: found

    inverse = 0.0_wp
    if (many == 0) return
    found = many >= fewest
    if (found) call factor(a, lower, found)
    if (found) then
      do j = 1, 4
        column = 0.0_wp
        column(j) = 1.0_wp
        inverse(:, j) = solved(lower, column)
      end do
      inverse = 0.5_wp*(inverse + transpose(inverse))
      found = norm2(a)*norm2(inverse) <= most_skewed
    end if
    if (found) return
    inverse = 0.0_wp
    inverse(1, 1) = 1.0_wp/a(1, 1)
  end subroutine invert

  !> Cholesky factor of a; not found where a is not positive definite.
  pure subroutine factor(a, lower, found)
    real(wp), intent(in) :: a(4, 4)
    real(wp), intent(out) :: lower(4, 4)
    logical, intent(out) :: found
    integer(i4) :: i, j
    real(wp) :: rest
    lower = 0.0_wp
    found = .false.
    do j = 1, 4
      rest = a(j, j) - sum(lower(j, :j - 1)**2)
      if (.not. rest > a(j, j)/most_skewed**2) return
      lower(j, j) = sqrt(rest)
      do i = j + 1, 4
        lower(i, j) = (a(i, j) - sum(lower(i, :j - 1)*lower(j, :j - 1)))/lower(j, j)
      end do
    end do
    found = .true.
  end subroutine factor

  !> Solution of l l' y = b.
  pure function solved(lower, b) result(y)
    real(wp), intent(in) :: lower(4, 4), b(4)
    real(wp) :: y(4)
    integer(i4) :: i
    do i = 1, 4
      y(i) = (b(i) - sum(lower(i, :i - 1)*y(:i - 1)))/lower(i, i)
    end do
    do i = 4, 1, -1
      y(i) = (y(i) - sum(lower(i + 1:, i)*y(i + 1:)))/lower(i, i)
    end do
  end function solved

  !> Coefficients of a brick's linear field of v, which is a velocity or a displacement of the
  !! grains: (1 + coordinates, axis).
  pure function fitted(fit, c, v) result(field)
    type(pore_fit_type), intent(in) :: fit
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: v(:, :)  !! (3, grains)
    real(wp) :: field(4, 3), total(4, 3), base(4)
    integer(i4) :: k, j
    total = 0.0_wp
    do k = fit%start(c), fit%start(c + 1) - 1
      base = fit%weight(k)*[1.0_wp, fit%local(:, k)]
      do j = 1, 3
        total(:, j) = total(:, j) + v(j, fit%grain(k))*base
      end do
    end do
    field = matmul(fit%inverse(:, :, c), total)
  end function fitted
end module dem_pore_fit
