!> Dense symmetric positive systems by LAPACK, on one thread: bits do not depend on their number.
module cpl_dense
  use, intrinsic :: iso_c_binding, only: c_int
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dpotrf, dpotrs
  implicit none
  private
  public :: factor_dense, solve_dense

  interface
    !> Threads of OpenBLAS.
    subroutine openblas_set_num_threads(n) bind(c, name='openblas_set_num_threads')
      import :: c_int
      integer(c_int), value :: n
    end subroutine openblas_set_num_threads
  end interface

contains

  !> Replace the lower triangle of a by its Cholesky factor; `good` is whether that worked.
  subroutine factor_dense(a, good)
    real(wp), contiguous, intent(inout) :: a(:, :)
    logical, intent(out) :: good
    integer(i4) :: info
    call openblas_set_num_threads(1_c_int)
    call dpotrf('L', size(a, 1, i4), a, max(1_i4, size(a, 1, i4)), info)
    good = info == 0
  end subroutine factor_dense

  !> Replace b by the solution of the factored system.
  subroutine solve_dense(a, b)
    real(wp), contiguous, intent(in) :: a(:, :)
    real(wp), intent(inout) :: b(:)
    real(wp) :: x(size(b), 1)
    integer(i4) :: info
    x(:, 1) = b
    call dpotrs('L', size(a, 1, i4), 1_i4, a, max(1_i4, size(a, 1, i4)), x, &
                max(1_i4, size(b, 1, i4)), info)
    if (info /= 0) error stop 'bug: wrong shapes in a dense solve'
    b = x(:, 1)
  end subroutine solve_dense
end module cpl_dense
