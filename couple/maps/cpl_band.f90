!> Symmetric positive matrices stored by profile, and their Cholesky factors: each row from its
!! first entry to the diagonal. Sums are added in a fixed order.
module cpl_band
  use talus_kinds, only: wp, i4, i8
  use cpl_rows, only: lanes
  implicit none
  private
  public :: band_type, condition_of

  integer(i4), parameter :: rounds = 40  !! of the power iterations for the condition

  !> A matrix of n rows, after `factor` its factor L.
  type :: band_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: left(:)   !! first column of each row
    integer(i8), allocatable :: base(:)   !! entry (i, j) is value(base(i) + j)
    real(wp), allocatable :: value(:)
  contains
    procedure :: shape_by
    procedure :: add
    procedure :: multiply
    procedure :: factor
    procedure :: solve
    procedure :: solve_vectors
  end type band_type

contains

  !> Zero matrix with the given first columns of its rows.
  subroutine shape_by(self, left)
    class(band_type), intent(inout) :: self
    integer(i4), intent(in) :: left(:)
    integer(i4) :: i
    integer(i8) :: used
    self%n = size(left)
    self%left = left
    if (allocated(self%base)) deallocate (self%base, self%value)
    allocate (self%base(self%n))
    used = 0
    do i = 1, self%n
      self%base(i) = used - left(i) + 1
      used = used + i - left(i) + 1
    end do
    allocate (self%value(used), source=0.0_wp)
  end subroutine shape_by

  !> Add to entry (i, j) of the lower half.
  pure subroutine add(self, i, j, value)
    class(band_type), intent(inout) :: self
    integer(i4), intent(in) :: i, j  !! j <= i
    real(wp), intent(in) :: value
    self%value(self%base(i) + j) = self%value(self%base(i) + j) + value
  end subroutine add

  !> y = A x; only before the factor is made.
  pure subroutine multiply(self, x, y)
    class(band_type), intent(in) :: self
    real(wp), intent(in) :: x(:)
    real(wp), intent(out) :: y(:)
    integer(i4) :: i, j
    y = 0.0_wp
    do i = 1, self%n
      do j = self%left(i), i - 1
        y(i) = y(i) + self%value(self%base(i) + j)*x(j)
        y(j) = y(j) + self%value(self%base(i) + j)*x(i)
      end do
      y(i) = y(i) + self%value(self%base(i) + i)*x(i)
    end do
  end subroutine multiply

  !> The factor in place of the matrix; bad is the first row without a positive pivot, 0 if none.
  subroutine factor(self, bad)
    class(band_type), intent(inout) :: self
    integer(i4), intent(out) :: bad
    real(wp), parameter :: least = 1.0e-13_wp  !! pivot over diagonal
    real(wp) :: s, diagonal
    integer(i4) :: i, j, low
    integer(i8) :: bi, bj

    bad = 0
    do i = 1, self%n
      bi = self%base(i)
      diagonal = self%value(bi + i)
      do j = self%left(i), i
        bj = self%base(j)
        low = max(self%left(i), self%left(j))
        s = self%value(bi + j) - dot_product(self%value(bi + low:bi + j - 1), &
                                             self%value(bj + low:bj + j - 1))
        if (j < i) then
          self%value(bi + j) = s/self%value(bj + j)
        else if (s > least*diagonal) then
          self%value(bi + i) = sqrt(s)
        else
          bad = i
          return
        end if
      end do
    end do
  end subroutine factor

  !> Solutions for several right-hand sides, in place.
  pure subroutine solve(self, x)
    class(band_type), intent(in) :: self
    real(wp), intent(inout) :: x(:, :)  !! (n, sides)
    integer(i4) :: i, c
    integer(i8) :: b
    do c = 1, size(x, 2)
      do i = 1, self%n
        b = self%base(i)
        x(i, c) = (x(i, c) - dot_product(self%value(b + self%left(i):b + i - 1), &
                                         x(self%left(i):i - 1, c)))/self%value(b + i)
      end do
      do i = self%n, 1, -1
        b = self%base(i)
        x(i, c) = x(i, c)/self%value(b + i)
        x(self%left(i):i - 1, c) = x(self%left(i):i - 1, c) &
                                   - x(i, c)*self%value(b + self%left(i):b + i - 1)
      end do
    end do
  end subroutine solve

  !> The same for a right-hand side of vectors, all components at once.
  pure subroutine solve_vectors(self, x)
    class(band_type), intent(in) :: self
    real(wp), intent(inout) :: x(lanes, self%n)
    real(wp), dimension(lanes) :: s, t
    integer(i4) :: i, j
    integer(i8) :: b
    do i = 1, self%n
      b = self%base(i)
      s = x(:, i)
      t = 0.0_wp
      do j = self%left(i), i - 2, 2
        s = s - self%value(b + j)*x(:, j)
        t = t - self%value(b + j + 1)*x(:, j + 1)
      end do
      if (mod(i - self%left(i), 2) == 1) s = s - self%value(b + i - 1)*x(:, i - 1)
      x(:, i) = (s + t)/self%value(b + i)
    end do
    do i = self%n, 1, -1
      b = self%base(i)
      s = x(:, i)/self%value(b + i)
      x(:, i) = s
      do j = self%left(i), i - 1
        x(:, j) = x(:, j) - self%value(b + j)*s
      end do
    end do
  end subroutine solve_vectors

  !> Largest over least eigenvalue, by power iterations with the matrix and with its factor.
  pure real(wp) function condition_of(matrix, factored) result(condition)
    type(band_type), intent(in) :: matrix, factored
    real(wp) :: x(matrix%n, 1), y(matrix%n), large, small
    integer(i4) :: k
    x(:, 1) = [(1.0_wp + 0.3_wp*sin(real(k, wp)), k=1, matrix%n)]
    x = x/norm2(x)
    large = 1.0_wp
    do k = 1, rounds
      call matrix%multiply(x(:, 1), y)
      large = norm2(y)
      x(:, 1) = y/large
    end do
    x(:, 1) = [(sin(1.7_wp*k) + 0.2_wp, k=1, matrix%n)]
    x = x/norm2(x)
    small = 1.0_wp
    do k = 1, rounds
      call factored%solve(x)
      small = 1.0_wp/norm2(x)
      x = x*small
    end do
    condition = large/small
  end function condition_of
end module cpl_band
