!> Displacements and micro-rotations that go through the same rows, taken together: eight lanes at
!! once in place of twice four. Each lane adds up as in cpl_rows and cpl_projection, to the bit.
module cpl_twins
  use talus_kinds, only: wp, i4, i8
  use cpl_band, only: band_type
  use cpl_projection, only: projection_type
  use cpl_rows, only: rows_type, lanes
  implicit none
  private
  public :: same_rows, same_maps, apply_twins, transposed_twins, project_twins, hand_on_twins

  integer(i4), parameter :: both = 2*lanes  !! displacements in the first half
  real(wp), parameter :: alike = 1.0e-12_wp !! weights: of masses and of moments of equal grains

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
  pure subroutine apply_twins(n, rows, x, phi, y, z)
    type(rows_type), intent(in) :: n
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: x(:, :), phi(:, :)    !! (3, columns)
    real(wp), intent(out) :: y(:, :), z(:, :)     !! (3, size(rows))
    real(wp) :: padded(both, n%columns), s(both)
    integer(i4) :: k
    call pad(x, phi, padded)
    do k = 1, size(rows)
      s = of_row(n, rows(k), n%column, padded)
      y(:, k) = s(:3)
      z(:, k) = s(lanes + 1:lanes + 3)
    end do
  end subroutine apply_twins

  !> Sum of row i of n, whose columns are found at `at`.
  pure function of_row(n, i, at, x) result(s)
    type(rows_type), intent(in) :: n
    integer(i4), intent(in) :: i, at(:)
    real(wp), intent(in) :: x(both, n%columns)
    real(wp) :: s(both), t(both)
    integer(i4) :: e, last
    s = 0.0_wp
    t = 0.0_wp
    last = n%first(i + 1) - 1
    do e = n%first(i), last - 1, 2  ! two sums, so that none waits for the other
      s = s + n%weight(e)*x(:, at(e))
      t = t + n%weight(e + 1)*x(:, at(e + 1))
    end do
    if (mod(last - n%first(i), 2) == 0) s = s + n%weight(last)*x(:, at(last))
    s = s + t
  end function of_row

  pure subroutine pad(x, phi, padded)
    real(wp), intent(in) :: x(:, :), phi(:, :)
    real(wp), intent(out) :: padded(both, size(x, 2))
    integer(i4) :: a
    do a = 1, size(x, 2)
      padded(:3, a) = x(:, a)
      padded(lanes, a) = 0.0_wp
      padded(lanes + 1:lanes + 3, a) = phi(:, a)
      padded(both, a) = 0.0_wp
    end do
  end subroutine pad

  !> x and phi with the transposes of y and z at the rows named; zeros of both add nothing.
  pure subroutine transposed_twins(n, rows, y, z, x, phi)
    type(rows_type), intent(in) :: n
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: y(:, :), z(:, :)         !! (3, size(rows))
    real(wp), intent(inout) :: x(:, :), phi(:, :)    !! (3, columns)
    real(wp) :: padded(both, n%columns), f(both)
    integer(i4) :: k
    call pad(x, phi, padded)
    f = 0.0_wp
    do k = 1, size(rows)
      f(:3) = y(:, k)
      f(lanes + 1:lanes + 3) = z(:, k)
      if (all(abs(f) <= 0.0_wp)) cycle
      call add_row(n%first(rows(k)), n%first(rows(k) + 1) - 1, n%column, n%weight, f, padded)
    end do
    x = padded(:3, :)
    phi = padded(lanes + 1:lanes + 3, :)
  end subroutine transposed_twins

  pure subroutine add_row(first, last, column, weight, f, x)
    integer(i4), intent(in) :: first, last, column(:)
    real(wp), intent(in) :: weight(:), f(both)
    real(wp), intent(inout) :: x(both, *)
    integer(i4) :: e, l, a
    do e = first, last
      a = column(e)
      !$omp simd
      do l = 1, both
        x(l, a) = x(l, a) + weight(e)*f(l)
      end do
    end do
  end subroutine add_row

  !> Nodes from the motion of the grains: d of q by p, phi of theta by p_phi.
  subroutine project_twins(p, p_phi, q, theta, d, phi)
    type(projection_type), intent(in) :: p, p_phi
    real(wp), intent(in) :: q(:, :), theta(:, :)   !! (3, grains)
    real(wp), intent(out) :: d(:, :), phi(:, :)    !! (3, nodes)
    real(wp) :: r(both, p%n%columns), f(both)
    integer(i4) :: i, a
    r = 0.0_wp
    f = 0.0_wp
    if (p%mls) then
      associate (n => p%by_grain)
        do i = 1, n%rows
          f(:3) = q(:, i)
          f(lanes + 1:lanes + 3) = theta(:, i)
          call add_row(n%first(i), n%first(i + 1) - 1, n%column, n%weight, f, r)
        end do
      end associate
      d = r(:3, :)
      phi = r(lanes + 1:lanes + 3, :)
      return
    end if
    do i = 1, p%n%rows
      f(:3) = p%w(i)*q(:, i)
      f(lanes + 1:lanes + 3) = p_phi%w(i)*theta(:, i)
      call add_row(p%n%first(i), p%n%first(i + 1) - 1, p%at, p%n%weight, f, r)
    end do
    call solve(p, p_phi, r)
    do a = 1, p%n%columns
      d(:, a) = r(:3, p%place(a))
      phi(:, a) = r(lanes + 1:lanes + 3, p%place(a))
    end do
  end subroutine project_twins

  !> What nodes hand on to the grains, with what acts there besides: force of f, moment of c.
  subroutine hand_on_twins(p, p_phi, f, c, besides, besides_phi, force, moment)
    type(projection_type), intent(in) :: p, p_phi
    real(wp), intent(in) :: f(:, :), c(:, :)                  !! (3, nodes)
    real(wp), intent(in) :: besides(:, :), besides_phi(:, :)  !! (3, grains)
    real(wp), intent(out) :: force(:, :), moment(:, :)        !! (3, grains)
    real(wp) :: r(both, p%n%columns), s(both)
    integer(i4) :: i, a
    r = 0.0_wp
    if (p%mls) then
      r(:3, :) = f
      r(lanes + 1:lanes + 3, :) = c
      do i = 1, p%by_grain%rows
        s = of_row(p%by_grain, i, p%by_grain%column, r)
        force(:, i) = besides(:, i) + s(:3)
        moment(:, i) = besides_phi(:, i) + s(lanes + 1:lanes + 3)
      end do
      return
    end if
    do a = 1, p%n%columns
      r(:3, p%place(a)) = f(:, a)
      r(lanes + 1:lanes + 3, p%place(a)) = c(:, a)
    end do
    call solve(p, p_phi, r)
    do i = 1, p%n%rows
      s = of_row(p%n, i, p%at, r)
      force(:, i) = besides(:, i) + p%w(i)*s(:3)
      moment(:, i) = besides_phi(:, i) + p_phi%w(i)*s(lanes + 1:lanes + 3)
    end do
  end subroutine hand_on_twins

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
end module cpl_twins
