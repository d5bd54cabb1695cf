!> Incomplete Cholesky factorisation of 3 x 3 blocks without fill (Meijerink and van der Vorst
!! 1977), held in single precision. Where a pivot is not positive the diagonal is raised and tried
!! again (Manteuffel 1980).
!!
!! With threads the sweeps run by levels: the rows of a level depend on those of earlier levels
!! alone. Each product is added by itself and in the order of the rows, in the sweeps of one thread
!! too, so that the bits do not depend on the number of threads.
module fem_cholesky
  use, intrinsic :: iso_fortran_env, only: sp => real32
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4
  use fem_levels, only: fem_levels_type, make_levels
  use fem_sparse, only: fem_pattern_type
  implicit none
  private
  public :: cholesky_type

  real(wp), parameter :: first_raise = 5.0e-3_wp, last_raise = 2.0_wp

  type :: cholesky_type
    logical :: ready = .false.
    real(wp) :: raise = 0.0_wp        !! share by which the diagonal was raised
    real(wp) :: memory = 0.0_wp       !! of the factors [MB]
    integer(i4) :: least_rows = 400   !! least mean size of a level for threads
    real(sp), allocatable, private :: upper(:, :, :)  !! D^-1 U by rows; the diagonal holds D^-1
    real(sp), allocatable, private :: lower(:, :, :)  !! the same by columns, for threads
    real(sp), allocatable, private :: y(:, :)         !! (3, blocks)
    type(fem_levels_type), private :: levels
    logical, private :: by_threads = .false.
  contains
    procedure :: prepare
    procedure :: apply
    procedure :: drop
  end type cholesky_type

contains

  !> Factor a matrix incompletely; `ready` is true on success.
  subroutine prepare(self, pattern, k, free)
    class(cholesky_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)   !! (3, 3, entries) upper triangle
    logical, intent(in) :: free(:, :)    !! (3, blocks) what is solved for
    real(wp), allocatable :: w(:, :, :)

    if (.not. allocated(self%upper)) &
      allocate (self%upper(3, 3, size(k, 3)), self%y(3, pattern%nodes))
    self%raise = 0.0_wp
    do
      call masked(pattern, k, free, self%raise, w)
      call factor(pattern, w, self%upper, self%ready)
      if (self%ready .or. self%raise > last_raise) exit
      self%raise = merge(first_raise, 2.0_wp*self%raise, self%raise <= 0.0_wp)
    end do
    if (self%ready .and. omp_get_max_threads() > 1) call prepare_threads(self, pattern)
    self%memory = real(storage_size(1.0_sp)/8, wp)*size(self%upper)/1.0e6_wp
    if (self%by_threads) self%memory = 2.0_wp*self%memory
  end subroutine prepare

  !> Levels, and the factors by columns.
  subroutine prepare_threads(self, pattern)
    class(cholesky_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4) :: q
    if (.not. allocated(self%levels%row)) call make_levels(pattern, self%levels)
    self%by_threads = pattern%nodes >= self%least_rows*self%levels%down
    if (.not. self%by_threads) return
    if (.not. allocated(self%lower)) allocate (self%lower(3, 3, size(self%levels%entry)))
    !$omp parallel do default(none) shared(self) private(q) schedule(static)
    do q = 1, size(self%levels%entry)
      self%lower(:, :, q) = self%upper(:, :, self%levels%entry(q))
    end do
    !$omp end parallel do
  end subroutine prepare_threads

  !> Release the memory.
  subroutine drop(self)
    class(cholesky_type), intent(inout) :: self
    if (allocated(self%upper)) deallocate (self%upper, self%y)
    if (allocated(self%lower)) deallocate (self%lower)
    self%levels = fem_levels_type()
    self%ready = .false.
    self%by_threads = .false.
  end subroutine drop

  !> Copy of the matrix, rows and columns of what is not free cleared, the diagonal raised.
  subroutine masked(pattern, k, free, raise, w)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), raise
    logical, intent(in) :: free(:, :)
    real(wp), allocatable, intent(out) :: w(:, :, :)
    integer(i4) :: i, p, c
    allocate (w, mold=k)
    !$omp parallel do default(none) shared(pattern, k, w, free, raise) private(i, p, c) &
    !$omp schedule(static)
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        w(:, :, p) = k(:, :, p)
        do c = 1, 3
          if (.not. free(c, i)) w(c, :, p) = 0.0_wp
          if (.not. free(c, pattern%column(p))) w(:, c, p) = 0.0_wp
        end do
      end do
      p = pattern%start(i)
      do c = 1, 3
        w(c, c, p) = merge(w(c, c, p)*(1.0_wp + raise), 1.0_wp, free(c, i))
      end do
    end do
    !$omp end parallel do
  end subroutine masked

  !> Incomplete factors; `good` if all pivots are positive.
  pure subroutine factor(pattern, w, upper, good)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(inout) :: w(:, :, :)
    real(sp), intent(inout) :: upper(:, :, :)
    logical, intent(out) :: good
    real(wp) :: inverse(3, 3), scaled(3, 3)
    integer(i4) :: i, p, q, r
    good = .true.
    do i = 1, pattern%nodes
      p = pattern%start(i)
      call invert(w(:, :, p), inverse, good)
      if (.not. good) return
      upper(:, :, p) = real(inverse, sp)
      do q = p + 1, pattern%start(i + 1) - 1
        scaled = matmul(inverse, w(:, :, q))
        upper(:, :, q) = real(scaled, sp)
        ! rows j up to this column lose w_ij' D^-1 w_iq where they have a block
        do r = p + 1, q
          call subtract(pattern, pattern%column(r), pattern%column(q), w(:, :, r), scaled, w)
        end do
      end do
    end do
  end subroutine factor

  !> w_jk = w_jk - a' b if row j has column k.
  pure subroutine subtract(pattern, j, k, a, b, w)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: j, k
    real(wp), intent(in) :: a(3, 3), b(3, 3)
    real(wp), intent(inout) :: w(:, :, :)
    integer(i4) :: s, c
    do s = pattern%start(j), pattern%start(j + 1) - 1
      if (pattern%column(s) < k) cycle
      if (pattern%column(s) > k) return
      do c = 1, 3
        w(1, c, s) = w(1, c, s) - (a(1, 1)*b(1, c) + a(2, 1)*b(2, c) + a(3, 1)*b(3, c))
        w(2, c, s) = w(2, c, s) - (a(1, 2)*b(1, c) + a(2, 2)*b(2, c) + a(3, 2)*b(3, c))
        w(3, c, s) = w(3, c, s) - (a(1, 3)*b(1, c) + a(2, 3)*b(2, c) + a(3, 3)*b(3, c))
      end do
      return
    end do
  end subroutine subtract

  !> Inverse of a symmetric 3 x 3 block; `good` if it is positive definite.
  pure subroutine invert(a, inverse, good)
    real(wp), intent(in) :: a(3, 3)
    real(wp), intent(out) :: inverse(3, 3)
    logical, intent(out) :: good
    real(wp) :: minor, determinant
    minor = a(1, 1)*a(2, 2) - a(1, 2)*a(1, 2)
    inverse(1, 1) = a(2, 2)*a(3, 3) - a(2, 3)*a(2, 3)
    inverse(1, 2) = a(1, 3)*a(2, 3) - a(1, 2)*a(3, 3)
    inverse(1, 3) = a(1, 2)*a(2, 3) - a(1, 3)*a(2, 2)
    inverse(2, 2) = a(1, 1)*a(3, 3) - a(1, 3)*a(1, 3)
    inverse(2, 3) = a(1, 2)*a(1, 3) - a(1, 1)*a(2, 3)
    inverse(3, 3) = minor
    determinant = a(1, 1)*inverse(1, 1) + a(1, 2)*inverse(1, 2) + a(1, 3)*inverse(1, 3)
    good = a(1, 1) > 0.0_wp .and. minor > 0.0_wp .and. determinant > 0.0_wp
    if (.not. good) return
    inverse(2, 1) = inverse(1, 2)
    inverse(3, 1) = inverse(1, 3)
    inverse(3, 2) = inverse(2, 3)
    inverse = inverse/determinant
  end subroutine invert

  !> z = (U' D U)^-1 r with the incomplete factors; r within the range of single precision.
  subroutine apply(self, pattern, r, z)
    class(cholesky_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: r(:, :)
    real(wp), intent(out), contiguous :: z(:, :)
    integer(i4) :: i
    if (.not. self%by_threads) then
      self%y = real(r, sp)
      call forward(pattern, self%upper, self%y)
      call backward(pattern, self%upper, self%y)
      z = real(self%y, wp)
      return
    end if
    !$omp parallel default(none) shared(self, pattern, r, z) private(i)
    !$omp do schedule(static)
    do i = 1, size(r, 2)
      self%y(:, i) = real(r(:, i), sp)
    end do
    !$omp end do
    call sweep_levels(self, pattern)
    !$omp do schedule(static)
    do i = 1, size(z, 2)
      z(:, i) = real(self%y(:, i), wp)
    end do
    !$omp end do
    !$omp end parallel
  end subroutine apply

  !> Both sweeps level by level, inside a parallel region.
  subroutine sweep_levels(self, pattern)
    class(cholesky_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4) :: l, n
    associate (s => self%levels)
      do l = 1, s%down
        !$omp do schedule(static)
        do n = s%first(l), s%first(l + 1) - 1
          call gather_row(s, self%lower, s%row(n), self%y)
        end do
        !$omp end do
      end do
      !$omp do schedule(static)
      do n = 1, pattern%nodes
        call scale_row(self%upper(:, :, pattern%start(n)), self%y(:, n))
      end do
      !$omp end do
      do l = s%up, 1, -1
        !$omp do schedule(static)
        do n = s%first_up(l), s%first_up(l + 1) - 1
          call backward_row(pattern, self%upper, s%row_up(n), self%y)
        end do
        !$omp end do
      end do
    end associate
  end subroutine sweep_levels

  !> Forward sweep by one thread: each row adds its products to later ones.
  pure subroutine forward(pattern, u, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(sp), intent(in), contiguous :: u(:, :, :)
    real(sp), intent(inout), contiguous :: y(:, :)
    real(sp) :: a, b, c
    integer(i4) :: i, j, k, p
    do i = 1, pattern%nodes
      a = y(1, i)
      b = y(2, i)
      c = y(3, i)
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        do k = 1, 3
          y(k, j) = y(k, j) - u(1, k, p)*a
          y(k, j) = y(k, j) - u(2, k, p)*b
          y(k, j) = y(k, j) - u(3, k, p)*c
        end do
      end do
      call scale_row(u(:, :, pattern%start(i)), y(:, i))
    end do
  end subroutine forward

  !> Row j of the forward sweep from the earlier rows, not scaled yet.
  pure subroutine gather_row(levels, lower, j, y)
    type(fem_levels_type), intent(in) :: levels
    real(sp), intent(in), contiguous :: lower(:, :, :)
    integer(i4), intent(in) :: j
    real(sp), intent(inout), contiguous :: y(:, :)
    real(sp) :: x(3)
    integer(i4) :: i, k, q
    x = y(:, j)
    do q = levels%start(j), levels%start(j + 1) - 1
      i = levels%from(q)
      do k = 1, 3
        x(k) = x(k) - lower(1, k, q)*y(1, i)
        x(k) = x(k) - lower(2, k, q)*y(2, i)
        x(k) = x(k) - lower(3, k, q)*y(3, i)
      end do
    end do
    y(:, j) = x
  end subroutine gather_row

  !> y = D^-1 y of a row.
  pure subroutine scale_row(d, y)
    real(sp), intent(in) :: d(3, 3)
    real(sp), intent(inout) :: y(3)
    real(sp) :: x(3)
    x = y
    y = d(:, 1)*x(1)
    y = y + d(:, 2)*x(2)
    y = y + d(:, 3)*x(3)
  end subroutine scale_row

  !> Backward sweep by one thread.
  pure subroutine backward(pattern, u, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(sp), intent(in), contiguous :: u(:, :, :)
    real(sp), intent(inout), contiguous :: y(:, :)
    integer(i4) :: i
    do i = pattern%nodes, 1, -1
      call backward_row(pattern, u, i, y)
    end do
  end subroutine backward

  pure subroutine backward_row(pattern, u, i, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(sp), intent(in), contiguous :: u(:, :, :)
    integer(i4), intent(in) :: i
    real(sp), intent(inout), contiguous :: y(:, :)
    real(sp) :: x(3)
    integer(i4) :: j, k, p
    x = y(:, i)
    do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
      j = pattern%column(p)
      do k = 1, 3
        x(k) = x(k) - u(k, 1, p)*y(1, j)
        x(k) = x(k) - u(k, 2, p)*y(2, j)
        x(k) = x(k) - u(k, 3, p)*y(3, j)
      end do
    end do
    y(:, i) = x
  end subroutine backward_row
end module fem_cholesky
