!> Largest eigenvalues of batches of matrices against those of LAPACK, and of matrices whose
!! spectrum is known: diagonal, singular, with a row of zeros.
program test_fem_spectrum
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use talus_text, only: str
  use fem_spectrum, only: lanes, largest_values
  implicit none
  type(test_type) :: test

  interface
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: wp
      character(len=1), intent(in) :: jobz, uplo
      integer, intent(in) :: n, lda, lwork
      real(wp), intent(inout) :: a(lda, *)
      real(wp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsyev
  end interface

  call random_ones(1)
  call random_ones(2)
  call random_ones(24)
  call random_ones(57)
  call known_ones()
  call test%finish()

contains

  !> Sums of squares (as stiffnesses are) of other sizes in each lane.
  subroutine random_ones(n)
    integer(i4), intent(in) :: n
    real(wp), dimension(lanes, n, n) :: a, used
    real(wp) :: g(n, n), one(n, n), top(lanes), values(n), work(34*n), off
    integer(i4) :: l, i, j
    integer :: info
    off = 0.0_wp
    do l = 1, lanes
      do j = 1, n
        do i = 1, n
          g(i, j) = sin(1.7_wp*i + 0.3_wp*l*j*i + 2.0_wp*j)
        end do
      end do
      a(l, :, :) = matmul(g, transpose(g))*10.0_wp**(3*l)
    end do
    do l = 2, lanes, 3
      a(l, :, :) = -a(l, :, :)  ! none positive
    end do
    used = a
    call largest_values(used, top)
    do l = 1, lanes
      one = a(l, :, :)
      call dsyev('N', 'L', n, one, n, values, work, size(work), info)
      off = larger(off, abs(top(l) - values(n))/max_abs(values))
    end do
    call test%check('n = '//str(n)//': as LAPACK', off < 1.0e-12_wp)
  end subroutine random_ones

  subroutine known_ones()
    real(wp) :: a(lanes, 5, 5), top(lanes)
    integer(i4) :: i
    a = 0.0_wp
    do i = 1, 5
      a(1, i, i) = real(i, wp)       ! diagonal
      a(2, i, :) = 2.0_wp            ! rank one
    end do
    a(3, 4, 2) = 3.0_wp              ! zeros but one pair
    a(4, 1, 1) = -1.0_wp             ! the others are zero
    call largest_values(a, top)
    call test%check_close('diagonal', top(1), 5.0_wp, 1.0e-12_wp)
    call test%check_close('rank one', top(2), 10.0_wp, 1.0e-12_wp)
    call test%check_close('one pair', top(3), 3.0_wp, 1.0e-12_wp)
    call test%check_close('negative and zeros', top(4), 0.0_wp, 1.0e-12_wp)
    call test%check_close('all zeros', top(5), 0.0_wp, 1.0e-12_wp)
  end subroutine known_ones
end program test_fem_spectrum
