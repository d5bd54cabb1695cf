!> Largest eigenvalues of several symmetric matrices of one size at once: the innermost index runs
!! over matrices. Householder's reflections to tridiagonal form, then bisection with Sturm counts
!! from Gershgorin's bound down (Golub and Van Loan, Matrix Computations, 8.3 and 8.4).
module fem_spectrum
  use talus_kinds, only: wp, i4
  use fem_hourglass, only: lanes
  implicit none
  private
  public :: lanes, largest_values

  integer(i4), parameter :: halvings = 48  !! of the bounds; what is left is below 1e-13 of them

contains

  !> Upper bounds of the largest eigenvalues, to rounding; the lower triangles of `a` are used up.
  pure subroutine largest_values(a, top)
    real(wp), intent(inout), contiguous :: a(:, :, :)  !! (lanes, n, n)
    real(wp), intent(out) :: top(lanes)
    real(wp) :: square(lanes, size(a, 2))  !! of the entries off the diagonal
    call tridiagonal(int(size(a, 2), i4), a, square)
    call bisect(int(size(a, 2), i4), a, square, top)
  end subroutine largest_values

  !> The diagonal stays in a(:, k, k); square(:, k) belongs to rows k and k + 1.
  pure subroutine tridiagonal(n, a, square)
    integer(i4), intent(in) :: n
    real(wp), intent(inout) :: a(lanes, n, n)
    real(wp), intent(out) :: square(lanes, n)
    real(wp) :: v(lanes, n), p(lanes, n), over(lanes), length(lanes)
    integer(i4) :: i, j, k

    do k = 1, n - 2
      length = 0.0_wp
      do i = k + 1, n
        v(:, i) = a(:, i, k)
        length = length + v(:, i)**2
      end do
      square(:, k) = length
      length = -sign(sqrt(length), v(:, k + 1))
      over = square(:, k) - v(:, k + 1)*length  ! v'v/2 with the new v
      v(:, k + 1) = v(:, k + 1) - length
      over = merge(1.0_wp/max(over, tiny(1.0_wp)), 0.0_wp, over > 0.0_wp)
      call product_with(n, k, a, v, p)
      length = 0.0_wp
      do i = k + 1, n
        p(:, i) = over*p(:, i)
        length = length + v(:, i)*p(:, i)
      end do
      length = 0.5_wp*over*length
      do i = k + 1, n
        p(:, i) = p(:, i) - length*v(:, i)
      end do
      do j = k + 1, n
        do i = j, n
          a(:, i, j) = a(:, i, j) - v(:, i)*p(:, j) - p(:, i)*v(:, j)
        end do
      end do
    end do
    square(:, n) = 0.0_wp
    if (n > 1) square(:, n - 1) = a(:, n, n - 1)**2
  end subroutine tridiagonal

  !> p = A v by the lower triangle of rows and columns beyond k.
  pure subroutine product_with(n, k, a, v, p)
    integer(i4), intent(in) :: n, k
    real(wp), intent(in) :: a(lanes, n, n), v(lanes, n)
    real(wp), intent(out) :: p(lanes, n)
    real(wp) :: sums(lanes)
    integer(i4) :: i, j
    p(:, k + 1:) = 0.0_wp
    do j = k + 1, n
      sums = a(:, j, j)*v(:, j)
      do i = j + 1, n
        sums = sums + a(:, i, j)*v(:, i)
        p(:, i) = p(:, i) + a(:, i, j)*v(:, j)
      end do
      p(:, j) = p(:, j) + sums
    end do
  end subroutine product_with

  !> A number is above all eigenvalues if all pivots of (number - T) are positive.
  pure subroutine bisect(n, a, square, top)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: a(lanes, n, n), square(lanes, n)
    real(wp), intent(out) :: top(lanes)
    real(wp), dimension(lanes) :: low, middle, pivot, least, beside
    integer(i4) :: i, h

    low = a(:, 1, 1)
    top = a(:, 1, 1)
    beside = 0.0_wp
    do i = 1, n
      low = max(low, a(:, i, i))
      top = max(top, a(:, i, i) + beside + sqrt(square(:, i)))
      beside = sqrt(square(:, i))
    end do
    do h = 1, halvings
      middle = 0.5_wp*(low + top)
      pivot = middle - a(:, 1, 1)
      least = pivot
      do i = 2, n
        pivot = middle - a(:, i, i) - square(:, i - 1)/merge(pivot, 1.0_wp, pivot > 0.0_wp)
        least = min(least, pivot)
      end do
      low = merge(low, middle, least > 0.0_wp)
      top = merge(middle, top, least > 0.0_wp)
    end do
  end subroutine bisect
end module fem_spectrum
