!> What of LAPACK is called, by its own names.
module talus_lapack
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: dsyev, dsygv, dgesv, dgetrf, dgetrs, dpotrf, dpotrs

  interface
    !> Eigenvalues, and vectors if requested, of a symmetric matrix.
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: wp, i4
      character(len=1), intent(in) :: jobz, uplo
      integer(i4), intent(in) :: n, lda, lwork
      real(wp), intent(inout) :: a(lda, *)
      real(wp), intent(out) :: w(*), work(*)
      integer(i4), intent(out) :: info
    end subroutine dsyev

    !> The same of a symmetric matrix and a positive definite one.
    subroutine dsygv(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, info)
      import :: wp, i4
      integer(i4), intent(in) :: itype, n, lda, ldb, lwork
      character(len=1), intent(in) :: jobz, uplo
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      real(wp), intent(out) :: w(*), work(*)
      integer(i4), intent(out) :: info
    end subroutine dsygv

    !> Solution of a general system.
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp, i4
      integer(i4), intent(in) :: n, nrhs, lda, ldb
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      integer(i4), intent(out) :: ipiv(*), info
    end subroutine dgesv

    !> Factors of a general matrix, in place.
    subroutine dgetrf(m, n, a, lda, ipiv, info)
      import :: wp, i4
      integer(i4), intent(in) :: m, n, lda
      real(wp), intent(inout) :: a(lda, *)
      integer(i4), intent(out) :: ipiv(*), info
    end subroutine dgetrf

    !> Solution by these factors.
    subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp, i4
      character(len=1), intent(in) :: trans
      integer(i4), intent(in) :: n, nrhs, lda, ldb, ipiv(*)
      real(wp), intent(in) :: a(lda, *)
      real(wp), intent(inout) :: b(ldb, *)
      integer(i4), intent(out) :: info
    end subroutine dgetrs

    !> Cholesky factor of a symmetric positive matrix, in place.
    subroutine dpotrf(uplo, n, a, lda, info)
      import :: wp, i4
      character(len=1), intent(in) :: uplo
      integer(i4), intent(in) :: n, lda
      real(wp), intent(inout) :: a(lda, *)
      integer(i4), intent(out) :: info
    end subroutine dpotrf

    !> Solution by the Cholesky factor.
    subroutine dpotrs(uplo, n, nrhs, a, lda, b, ldb, info)
      import :: wp, i4
      character(len=1), intent(in) :: uplo
      integer(i4), intent(in) :: n, nrhs, lda, ldb
      real(wp), intent(in) :: a(lda, *)
      real(wp), intent(inout) :: b(ldb, *)
      integer(i4), intent(out) :: info
    end subroutine dpotrs
  end interface
end module talus_lapack
