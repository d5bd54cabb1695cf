!> A linear velocity in each brick, fitted to its grains by their volumes.
!!
!! [a L]' = A^-1 sum V [1 x]' v', A = sum V [1 x][1 x]': exact for every rigid motion and uniform
!! strain. Closed bodies (tools) count by their volume (dem_pore_tools). A brick with few grains, or
!! grains that do not span it, has the mean velocity alone.
!! eq. D.35
module dem_pore_fit
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type, pore_fit_type
  use dem_pore_grid, only: brick_count, brick_edges, brick_of, place_in
  implicit none
  private
  public :: make_fit, fit_fields, fit_ways

  integer(i4), parameter :: fewest = 8           !! grains that make a slope
  real(wp), parameter :: least = 0.01_wp         !! of a brick, of a body that makes one
  real(wp), parameter :: most_skewed = 1.0e4_wp  !! condition of A beyond which there is none

contains

  !> Grains into bricks, and the fit of each. Inverse masses are there; without, nothing gives way.
  !! Ghosts do not count: what moves them bears no force of the liquid but that on its side.
  subroutine make_fit(grid, x, volume, fit)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(:, :)    !! (3, grains) [m]
    real(wp), intent(in) :: volume(:)  !! [m^3]
    type(pore_fit_type), intent(inout) :: fit
    integer(i4) :: c, k, many
    real(wp) :: a(4, 4), b(4, 4)

    call size_fit(size(x, 2, kind=i4), brick_count(grid), fit)
    call sort_grains(grid, x, fit)
    !$omp parallel do default(none) schedule(static) private(c, a, b, k, many) &
    !$omp   shared(grid, x, volume, fit)
    do c = 1, brick_count(grid)
      call place_grains(grid, c, x, volume, fit)
      call moments(fit, c, a, b)
      many = fit%start(c + 1) - fit%start(c)
      do k = first_share(fit, c), last_share(fit, c)
        a = a + fit%tools%weight(c)*fit%tools%moment(:, :, k)
        if (fit%tools%moment(1, 1, k) > least*product(brick_edges(grid))) many = many + fewest
      end do
      call invert(a, many, fit%inverse(:, :, c))
      fit%yield(:, :, c) = matmul(fit%inverse(:, :, c), matmul(b, fit%inverse(:, :, c)))
    end do
    !$omp end parallel do
    fit%ready = .true.
  end subroutine make_fit

  !> First and last share of closed bodies in a brick.
  pure integer(i4) function first_share(fit, c)
    type(pore_fit_type), intent(in) :: fit
    integer(i4), intent(in) :: c
    first_share = 1
    if (fit%tools%n > 0) first_share = fit%tools%start(c)
  end function first_share

  pure integer(i4) function last_share(fit, c)
    type(pore_fit_type), intent(in) :: fit
    integer(i4), intent(in) :: c
    last_share = 0
    if (fit%tools%n > 0) last_share = fit%tools%start(c + 1) - 1
  end function last_share

  !> Room for so many grains and bricks.
  subroutine size_fit(grains, bricks, fit)
    integer(i4), intent(in) :: grains, bricks
    type(pore_fit_type), intent(inout) :: fit
    if (allocated(fit%brick)) then
      if (size(fit%brick) /= grains) deallocate (fit%brick, fit%grain, fit%weight, fit%local)
    end if
    if (.not. allocated(fit%brick)) &
      allocate (fit%brick(grains), fit%grain(grains), fit%weight(grains), fit%local(3, grains))
    if (.not. allocated(fit%inverse_mass)) allocate (fit%inverse_mass(grains), source=0.0_wp)
    if (allocated(fit%inverse)) then
      if (size(fit%inverse, 3) /= bricks) deallocate (fit%inverse, fit%yield)
    end if
    if (.not. allocated(fit%inverse)) allocate (fit%inverse(4, 4, bricks), fit%yield(4, 4, bricks))
  end subroutine size_fit

  !> Count and list the grains of each brick.
  subroutine sort_grains(grid, x, fit)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(:, :)
    type(pore_fit_type), intent(inout) :: fit
    integer(i4), allocatable :: next(:)
    integer(i4) :: i, c
    real(wp) :: scale(3)
    scale = 1.0_wp/brick_edges(grid)
    !$omp parallel do default(none) schedule(static) private(i) shared(grid, x, fit, scale)
    do i = 1, size(x, 2)
      fit%brick(i) = brick_of(grid, scale, x(:, i))
    end do
    !$omp end parallel do
    if (allocated(fit%counts)) where (.not. fit%counts) fit%brick = -1
    allocate (next(brick_count(grid) + 1), source=0)
    do i = 1, size(x, 2)
      c = fit%brick(i)
      if (c > 0) next(c + 1) = next(c + 1) + 1
    end do
    next(1) = 1
    do c = 2, size(next)
      next(c) = next(c) + next(c - 1)
    end do
    fit%start = next
    do i = 1, size(x, 2)
      c = fit%brick(i)
      if (c <= 0) cycle
      fit%grain(next(c)) = i
      next(c) = next(c) + 1
    end do
  end subroutine sort_grains

  !> Places in a brick and weights.
  pure subroutine place_grains(grid, c, x, volume, fit)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: x(:, :), volume(:)
    type(pore_fit_type), intent(inout) :: fit
    real(wp) :: h(3), centre(3), scale(3)
    integer(i4) :: k, i
    h = brick_edges(grid)
    scale = 1.0_wp/h
    centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
    do k = fit%start(c), fit%start(c + 1) - 1
      i = fit%grain(k)
      fit%local(1, k) = (x(1, i) - centre(1))*scale(1)
      fit%local(2, k) = (x(2, i) - centre(2))*scale(2)
      fit%local(3, k) = (x(3, i) - centre(3))*scale(3)
      fit%weight(k) = volume(i)
    end do
  end subroutine place_grains

  !> A = sum V [1 x][1 x]' and B = sum V^2/m [1 x][1 x]' of a brick.
  pure subroutine moments(fit, c, a, b)
    type(pore_fit_type), intent(in) :: fit
    integer(i4), intent(in) :: c
    real(wp), intent(out) :: a(4, 4), b(4, 4)
    real(wp) :: product(10), v, w, sums(10, 2)
    integer(i4) :: k
    sums = 0.0_wp
    do k = fit%start(c), fit%start(c + 1) - 1
      v = fit%weight(k)
      w = v*v*fit%inverse_mass(fit%grain(k))
      associate (x => fit%local(1, k), y => fit%local(2, k), z => fit%local(3, k))
        product = [1.0_wp, x, y, z, x*x, x*y, x*z, y*y, y*z, z*z]
      end associate
      sums(:, 1) = sums(:, 1) + v*product
      sums(:, 2) = sums(:, 2) + w*product
    end do
    a = unfolded(sums(:, 1))
    b = unfolded(sums(:, 2))
  end subroutine moments

  !> A symmetric matrix of its lower columns.
  pure function unfolded(s) result(a)
    real(wp), intent(in) :: s(10)
    real(wp) :: a(4, 4)
    a = reshape([s(1), s(2), s(3), s(4), s(2), s(5), s(6), s(7), s(3), s(6), s(8), s(9), s(4), &
                 s(7), s(9), s(10)], [4, 4])
  end function unfolded

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

  !> Coefficients of the linear fields of all bricks of the grains' velocities:
  !! (1 + coordinates, axis, brick).
  subroutine fit_fields(fit, v, field)
    type(pore_fit_type), intent(in) :: fit
    real(wp), intent(in) :: v(:, :)          !! (3, grains)
    real(wp), intent(out) :: field(:, :, :)  !! (4, 3, bricks)
    integer(i4) :: c, k, i
    real(wp) :: total(4, 3)
    !$omp parallel do default(none) schedule(static) private(c, k, i, total) shared(fit, v, field)
    do c = 1, size(field, 3)
      total = 0.0_wp
      do k = fit%start(c), fit%start(c + 1) - 1
        i = fit%grain(k)
        call add_motion(fit%weight(k), fit%local(:, k), v(:, i), total)
      end do
      field(:, :, c) = matmul(fit%inverse(:, :, c), total)
    end do
    !$omp end parallel do
  end subroutine fit_fields

  !> The same of their ways from where the fit was made.
  subroutine fit_ways(grid, fit, x, field)
    type(pore_grid_type), intent(in) :: grid  !! as then
    type(pore_fit_type), intent(in) :: fit
    real(wp), intent(in) :: x(:, :)           !! (3, grains) now [m]
    real(wp), intent(out) :: field(:, :, :)
    integer(i4) :: c, k
    real(wp) :: total(4, 3), h(3), scale(3), centre(3), way(3)
    h = brick_edges(grid)
    scale = 1.0_wp/h
    !$omp parallel do default(none) schedule(static) private(c, k, total, centre, way) &
    !$omp   shared(grid, fit, x, field, h, scale)
    do c = 1, size(field, 3)
      centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
      total = 0.0_wp
      do k = fit%start(c), fit%start(c + 1) - 1
        way = h*((x(:, fit%grain(k)) - centre)*scale - fit%local(:, k))
        call add_motion(fit%weight(k), fit%local(:, k), way, total)
      end do
      field(:, :, c) = matmul(fit%inverse(:, :, c), total)
    end do
    !$omp end parallel do
  end subroutine fit_ways

  !> Add V [1 x]' v'.
  pure subroutine add_motion(weight, local, v, total)
    real(wp), intent(in) :: weight, local(3), v(3)
    real(wp), intent(inout) :: total(4, 3)
    real(wp) :: w
    integer(i4) :: j
    do j = 1, 3
      w = weight*v(j)
      total(1, j) = total(1, j) + w
      total(2, j) = total(2, j) + w*local(1)
      total(3, j) = total(3, j) + w*local(2)
      total(4, j) = total(4, j) + w*local(3)
    end do
  end subroutine add_motion
end module dem_pore_fit
