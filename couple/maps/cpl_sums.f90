!> Sums of products over flat arrays, several lanes at once: works of forces.
module cpl_sums
  use talus_kinds, only: wp
  implicit none
  private
  public :: work_since, add_works

contains

  !> Sum of f times (x - x0).
  pure real(wp) function work_since(n, f, x, x0) result(total)
    integer, intent(in) :: n
    real(wp), intent(in) :: f(n), x(n), x0(n)
    integer :: k
    total = 0.0_wp
    !$omp simd reduction(+:total)
    do k = 1, n
      total = total + f(k)*(x(k) - x0(k))
    end do
  end function work_since

  !> Add the sum of p times d, and that of their amounts.
  pure subroutine add_works(n, p, d, total, amount)
    integer, intent(in) :: n
    real(wp), intent(in) :: p(n), d(n)
    real(wp), intent(inout) :: total, amount
    integer :: k
    !$omp simd reduction(+:total, amount)
    do k = 1, n
      total = total + p(k)*d(k)
      amount = amount + abs(p(k)*d(k))
    end do
  end subroutine add_works
end module cpl_sums
