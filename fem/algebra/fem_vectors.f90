!> Sums over block vectors (3, blocks) by threads, chunk by chunk: the same bits for any number of
!! threads.
module fem_vectors
  use talus_kinds, only: wp, i4
  use fem_leap, only: least_shared, chunk
  implicit none
  private
  public :: dot, dot_of, add_scaled, scale_add

contains

  !> sum a b
  real(wp) function dot(a, b)
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)
    real(wp) :: part((size(a, 2) + chunk - 1)/chunk)
    integer(i4) :: k
    !$omp parallel do default(none) shared(a, b, part) private(k) schedule(static) &
    !$omp if(size(a, 2) > least_shared)
    do k = 1, size(part)
      part(k) = sum(a(:, (k - 1)*chunk + 1:min(k*chunk, int(size(a, 2), i4))) &
                    *b(:, (k - 1)*chunk + 1:min(k*chunk, int(size(a, 2), i4))))
    end do
    !$omp end parallel do
    dot = sum_in_order(part)
  end function dot

  !> sum a b over chosen blocks
  real(wp) function dot_of(chosen, a, b)
    logical, intent(in), contiguous :: chosen(:)
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)
    real(wp) :: part((size(a, 2) + chunk - 1)/chunk)
    integer(i4) :: k, i
    part = 0.0_wp
    !$omp parallel do default(none) shared(chosen, a, b, part) private(k, i) schedule(static) &
    !$omp if(size(a, 2) > least_shared)
    do k = 1, size(part)
      do i = (k - 1)*chunk + 1, min(k*chunk, int(size(a, 2), i4))
        if (chosen(i)) part(k) = part(k) + sum(a(:, i)*b(:, i))
      end do
    end do
    !$omp end parallel do
    dot_of = sum_in_order(part)
  end function dot_of

  pure real(wp) function sum_in_order(part)
    real(wp), intent(in) :: part(:)
    integer(i4) :: k
    sum_in_order = 0.0_wp
    do k = 1, size(part)
      sum_in_order = sum_in_order + part(k)
    end do
  end function sum_in_order

  !> y = y + factor x
  subroutine add_scaled(factor, x, y)
    real(wp), intent(in) :: factor
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(inout), contiguous :: y(:, :)
    integer(i4) :: i
    !$omp parallel do default(none) shared(factor, x, y) private(i) schedule(static) &
    !$omp if(size(x, 2) > least_shared)
    do i = 1, size(x, 2)
      y(:, i) = y(:, i) + factor*x(:, i)
    end do
    !$omp end parallel do
  end subroutine add_scaled

  !> y = x + factor y
  subroutine scale_add(factor, x, y)
    real(wp), intent(in) :: factor
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(inout), contiguous :: y(:, :)
    integer(i4) :: i
    !$omp parallel do default(none) shared(factor, x, y) private(i) schedule(static) &
    !$omp if(size(x, 2) > least_shared)
    do i = 1, size(x, 2)
      y(:, i) = x(:, i) + factor*y(:, i)
    end do
    !$omp end parallel do
  end subroutine scale_add
end module fem_vectors
