!> Displacements and micro-rotations that go through the same rows, taken together: eight lanes at
!! once in place of twice four. Each lane adds up as in cpl_rows and cpl_projection, to the bit.
module cpl_identical_rows
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  use talus_kinds, only: wp, i4, i8
  use cpl_band, only: band_type
  use cpl_projection, only: projection_type
  use cpl_rows, only: rows_type, lanes
  implicit none
  private
  public :: same_rows, same_maps, apply_identical, transposed_identical, project_identical, &
    hand_on_identical

  integer(i4), parameter :: both = 2*lanes  !! displacements in the first half
  integer(i4), parameter :: whole_lines = 256  !! columns of an array that begins on a line
  real(wp), parameter :: alike = 1.0e-12_wp !! weights: of masses and of moments of equal grains

  interface
    !> Values at rows, in turn or those named (cpl_lanes.c).
    subroutine sum_rows(rows, row, first, at, weight, x, y, z) bind(c, name='cpl_sum_rows')
      import :: c_double, c_int32_t
      integer(c_int32_t), value, intent(in) :: rows
      integer(c_int32_t), intent(in), optional :: row(*)
      integer(c_int32_t), intent(in) :: first(*), at(*)
      real(c_double), intent(in) :: weight(*), x(*)   !! x (both, columns)
      real(c_double), intent(inout) :: y(*), z(*)     !! (3, rows)
    end subroutine sum_rows

    !> The transpose, onto the columns.
    subroutine add_rows(rows, row, first, at, weight, y, z, x) bind(c, name='cpl_add_rows')
      import :: c_double, c_int32_t
      integer(c_int32_t), value, intent(in) :: rows
      integer(c_int32_t), intent(in), optional :: row(*)
      integer(c_int32_t), intent(in) :: first(*), at(*)
      real(c_double), intent(in) :: weight(*), y(*), z(*)
      real(c_double), intent(inout) :: x(*)
    end subroutine add_rows
  end interface

contains

  !> Have both the same weights, but for rounding, in the same places?
  pure logical function same_rows(a, b)
    type(rows_type), intent(in) :: a, b
    same_rows = a%rows == b%rows .and. a%columns == b%columns
    if (same_rows) same_rows = size(a%column) == size(b%column)
    if (.not. same_rows) return
    same_rows = all(a%first == b%first)
    if (same_rows) same_rows = all(a%column == b%column) .and. &
      .not. any(abs(a%weight - b%weight) > alike)
  end function same_rows

  !> Can both projections be taken together? Weights of the grains may differ, but not those of
  !! moving least squares.
  pure logical function same_maps(p, p_phi)
    type(projection_type), intent(in) :: p, p_phi
    same_maps = p%mls .eqv. p_phi%mls
    if (.not. same_maps) return
    if (p%mls) then
      same_maps = same_rows(p%fit, p_phi%fit)
    else
      same_maps = same_rows(p%n, p_phi%n)
      if (same_maps) same_maps = all(p%place == p_phi%place)
    end if
  end function same_maps

  !> Values at the rows named, one after another: y of x, z of phi.
  subroutine apply_identical(n, rows, x, phi, y, z)
    type(rows_type), intent(in) :: n
    integer(i4), intent(in), contiguous :: rows(:)
    real(wp), intent(in) :: x(:, :), phi(:, :)           !! (3, columns)
    real(wp), intent(out), contiguous :: y(:, :), z(:, :)  !! (3, size(rows))
    real(wp), allocatable :: padded(:, :)
    call pad(x, phi, padded)
    call sum_rows(size(rows, kind=i4), rows, n%first, n%column, n%weight, padded, y, z)
  end subroutine apply_identical

  !> Eight lanes of each column. Arrays of this size and larger begin on a line of the cache
  !! (talus_memory.c), so that no column lies across two.
  pure subroutine pad(x, phi, padded)
    real(wp), intent(in) :: x(:, :), phi(:, :)
    real(wp), allocatable, intent(out) :: padded(:, :)  !! (both, columns)
    integer(i4) :: a
    allocate (padded(both, max(whole_lines, size(x, 2))))
    do a = 1, size(x, 2)
      padded(:3, a) = x(:, a)
      padded(lanes, a) = 0.0_wp
      padded(lanes + 1:lanes + 3, a) = phi(:, a)
      padded(both, a) = 0.0_wp
    end do
  end subroutine pad

  !> x and phi with the transposes of y and z at the rows named; zeros of both add nothing.
  subroutine transposed_identical(n, rows, y, z, x, phi)
    type(rows_type), intent(in) :: n
    integer(i4), intent(in), contiguous :: rows(:)
    real(wp), intent(in), contiguous :: y(:, :), z(:, :)  !! (3, size(rows))
    real(wp), intent(inout) :: x(:, :), phi(:, :)         !! (3, columns)
    real(wp), allocatable :: padded(:, :)
    integer(i4) :: a
    call pad(x, phi, padded)
    call add_rows(size(rows, kind=i4), rows, n%first, n%column, n%weight, y, z, padded)
    do a = 1, size(x, 2)
      x(:, a) = padded(:3, a)
      phi(:, a) = padded(lanes + 1:lanes + 3, a)
    end do
  end subroutine transposed_identical

  !> Nodes from the motion of the grains: d of q by p, phi of theta by p_phi.
  subroutine project_identical(p, p_phi, q, theta, d, phi)
    type(projection_type), intent(in) :: p, p_phi
    real(wp), intent(in), contiguous :: q(:, :), theta(:, :)  !! (3, grains)
    real(wp), intent(out) :: d(:, :), phi(:, :)               !! (3, nodes)
    real(wp), allocatable :: r(:, :)
    integer(i4) :: a
    allocate (r(both, max(whole_lines, p%n%columns)), source=0.0_wp)
    if (p%mls) then
      associate (n => p%by_grain)
        call add_rows(n%rows, first=n%first, at=n%column, weight=n%weight, y=q, z=theta, x=r)
      end associate
      do a = 1, p%n%columns
        d(:, a) = r(:3, a)
        phi(:, a) = r(lanes + 1:lanes + 3, a)
      end do
      return
    end if
    call add_rows(p%n%rows, first=p%n%first, at=p%at, weight=p%n%weight, y=weighed(p%w, q), &
                  z=weighed(p_phi%w, theta), x=r)
    call solve(p, p_phi, r)
    do a = 1, p%n%columns
      d(:, a) = r(:3, p%place(a))
      phi(:, a) = r(lanes + 1:lanes + 3, p%place(a))
    end do
  end subroutine project_identical

  pure function weighed(w, x) result(y)
    real(wp), intent(in) :: w(:), x(:, :)
    real(wp) :: y(3, size(w))
    integer(i4) :: i
    do i = 1, size(w)
      y(:, i) = w(i)*x(:, i)
    end do
  end function weighed

  !> What nodes transfer to the grains, with what acts there besides: force of f, moment of c.
  subroutine hand_on_identical(p, p_phi, f, c, besides, besides_phi, force, moment)
    type(projection_type), intent(in) :: p, p_phi
    real(wp), intent(in) :: f(:, :), c(:, :)                  !! (3, nodes)
    real(wp), intent(in) :: besides(:, :), besides_phi(:, :)  !! (3, grains)
    real(wp), intent(out), contiguous :: force(:, :), moment(:, :)  !! (3, grains)
    real(wp), allocatable :: r(:, :)
    integer(i4) :: i, a
    if (p%mls) then
      call pad(f, c, r)
      associate (n => p%by_grain)
        call sum_rows(n%rows, first=n%first, at=n%column, weight=n%weight, x=r, y=force, z=moment)
      end associate
      do i = 1, size(force, 2)
        force(:, i) = besides(:, i) + force(:, i)
        moment(:, i) = besides_phi(:, i) + moment(:, i)
      end do
      return
    end if
    allocate (r(both, max(whole_lines, p%n%columns)), source=0.0_wp)
    do a = 1, p%n%columns
      r(:3, p%place(a)) = f(:, a)
      r(lanes + 1:lanes + 3, p%place(a)) = c(:, a)
    end do
    call solve(p, p_phi, r)
    call sum_rows(p%n%rows, first=p%n%first, at=p%at, weight=p%n%weight, x=r, y=force, z=moment)
    do i = 1, size(force, 2)
      force(:, i) = besides(:, i) + p%w(i)*force(:, i)
      moment(:, i) = besides_phi(:, i) + p_phi%w(i)*moment(:, i)
    end do
  end subroutine hand_on_identical

  !> Both systems at once, each half of the lanes with its own factor.
  pure subroutine solve(p, p_phi, r)
    type(projection_type), intent(in) :: p, p_phi
    real(wp), intent(inout) :: r(both, p%n%columns)
    call scale_both(p%scale, p_phi%scale, r)
    call solve_both(p%factor, p_phi%factor, r)
    call scale_both(p%scale, p_phi%scale, r)
  end subroutine solve

  pure subroutine scale_both(u, phi, r)
    real(wp), intent(in) :: u(:), phi(:)
    real(wp), intent(inout) :: r(both, size(u))
    integer(i4) :: a
    do a = 1, size(u)
      r(:lanes, a) = u(a)*r(:lanes, a)
      r(lanes + 1:, a) = phi(a)*r(lanes + 1:, a)
    end do
  end subroutine scale_both

  !> As solve_vectors of cpl_band, of two factors of one profile.
  pure subroutine solve_both(u, phi, x)
    type(band_type), intent(in) :: u, phi
    real(wp), intent(inout) :: x(both, u%n)
    real(wp), dimension(both) :: s, t, v
    integer(i4) :: i, j
    integer(i8) :: b
    do i = 1, u%n
      b = u%base(i)
      s = x(:, i)
      t = 0.0_wp
      do j = u%left(i), i - 2, 2
        call pair(u%value(b + j), phi%value(b + j), v)
        s = s - v*x(:, j)
        call pair(u%value(b + j + 1), phi%value(b + j + 1), v)
        t = t - v*x(:, j + 1)
      end do
      if (mod(i - u%left(i), 2) == 1) then
        call pair(u%value(b + i - 1), phi%value(b + i - 1), v)
        s = s - v*x(:, i - 1)
      end if
      call pair(u%value(b + i), phi%value(b + i), v)
      x(:, i) = (s + t)/v
    end do
    do i = u%n, 1, -1
      b = u%base(i)
      call pair(u%value(b + i), phi%value(b + i), v)
      s = x(:, i)/v
      x(:, i) = s
      do j = u%left(i), i - 1
        call pair(u%value(b + j), phi%value(b + j), v)
        x(:, j) = x(:, j) - v*s
      end do
    end do
  end subroutine solve_both

  !> One number in each half.
  pure subroutine pair(u, phi, v)
    real(wp), intent(in) :: u, phi
    real(wp), intent(out) :: v(both)
    v(:lanes) = u
    v(lanes + 1:) = phi
  end subroutine pair
end module cpl_identical_rows
