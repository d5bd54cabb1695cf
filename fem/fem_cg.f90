!> Conjugate gradients for large symmetric positive systems, preconditioned by an incomplete
!! Cholesky factorisation of 3 x 3 blocks without fill (Meijerink and van der Vorst 1977), held in
!! single precision. Where a pivot is not positive the diagonal is raised and tried again
!! (Manteuffel 1980).
module fem_cg
  use, intrinsic :: iso_fortran_env, only: sp => real32
  use talus_kinds, only: wp, i4
  use fem_sparse, only: fem_pattern_type, multiply
  implicit none
  private
  public :: cg_type

  real(wp), parameter :: first_raise = 5.0e-3_wp, last_raise = 2.0_wp
  integer(i4), parameter :: most_iterations = 3000

  type :: cg_type
    logical :: ready = .false.
    real(wp) :: raise = 0.0_wp        !! share by which the diagonal was raised
    integer(i4) :: iterations = 0     !! of the last solution
    real(wp) :: residual = 0.0_wp     !! of the last solution, over that at its start
    real(wp) :: memory = 0.0_wp       !! of the factors [MB]
    logical, allocatable, private :: free(:, :)       !! (3, blocks)
    real(wp), allocatable, private :: k(:, :, :)      !! (3, 3, entries)
    real(sp), allocatable, private :: upper(:, :, :)  !! D^-1 U by rows; the diagonal holds D^-1
  contains
    procedure :: prepare
    procedure :: solve
    procedure :: drop
  end type cg_type

contains

  !> Take a matrix and factor it incompletely; `ready` tells whether that worked.
  subroutine prepare(self, pattern, k, free)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)   !! (3, 3, entries) upper triangle
    logical, intent(in) :: free(:, :)    !! (3, blocks) what is solved for
    self%k = k
    self%free = free
    self%raise = 0.0_wp
    do
      call factor(self, pattern)
      if (self%ready .or. self%raise > last_raise) exit
      self%raise = merge(first_raise, 2.0_wp*self%raise, self%raise <= 0.0_wp)
    end do
    self%memory = real(storage_size(1.0_sp)/8, wp)*size(self%upper)/1.0e6_wp
  end subroutine prepare

  !> Give the memory back.
  subroutine drop(self)
    class(cg_type), intent(inout) :: self
    if (allocated(self%k)) deallocate (self%k, self%upper, self%free)
    self%ready = .false.
  end subroutine drop

  !> Incomplete factors of the matrix with what is not free replaced by ones on the diagonal.
  subroutine factor(self, pattern)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable :: w(:, :, :)
    real(wp) :: inverse(3, 3), scaled(3, 3)
    integer(i4) :: i, j, p, q, r, last
    logical :: good

    call masked(self, pattern, w)
    if (allocated(self%upper)) deallocate (self%upper)
    allocate (self%upper(3, 3, size(w, 3)))
    self%ready = .false.
    do i = 1, pattern%nodes
      p = pattern%start(i)
      last = pattern%start(i + 1) - 1
      call invert(w(:, :, p), inverse, good)
      if (.not. good) return
      self%upper(:, :, p) = real(inverse, sp)
      do q = p + 1, last
        scaled = matmul(inverse, w(:, :, q))
        self%upper(:, :, q) = real(scaled, sp)
        ! rows j up to this column lose w_ij' D^-1 w_iq where they have a block
        do r = p + 1, q
          j = pattern%column(r)
          call subtract(pattern, j, pattern%column(q), w(:, :, r), scaled, w)
        end do
      end do
    end do
    self%ready = .true.
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

  !> Copy of the matrix, rows and columns of what is not free cleared, the diagonal raised.
  subroutine masked(self, pattern, w)
    class(cg_type), intent(in) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(out) :: w(:, :, :)
    integer(i4) :: i, p, c
    allocate (w, source=self%k)
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        do c = 1, 3
          if (.not. self%free(c, i)) w(c, :, p) = 0.0_wp
          if (.not. self%free(c, pattern%column(p))) w(:, c, p) = 0.0_wp
        end do
      end do
      p = pattern%start(i)
      do c = 1, 3
        if (self%free(c, i)) then
          w(c, c, p) = w(c, c, p)*(1.0_wp + self%raise)
        else
          w(c, c, p) = 1.0_wp
        end if
      end do
    end do
  end subroutine masked

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

  !> z = (U' D U)^-1 r with the incomplete factors.
  subroutine precondition(self, pattern, r, z)
    class(cg_type), intent(in) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: r(:, :)
    real(wp), intent(out), contiguous :: z(:, :)
    real(sp) :: y(3, size(r, 2)), a, b, c, x1, x2, x3
    integer(i4) :: i, j, p

    y = real(r, sp)
    associate (u => self%upper)
      do i = 1, pattern%nodes
        a = y(1, i)
        b = y(2, i)
        c = y(3, i)
        do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
          j = pattern%column(p)
          y(1, j) = y(1, j) - (u(1, 1, p)*a + u(2, 1, p)*b + u(3, 1, p)*c)
          y(2, j) = y(2, j) - (u(1, 2, p)*a + u(2, 2, p)*b + u(3, 2, p)*c)
          y(3, j) = y(3, j) - (u(1, 3, p)*a + u(2, 3, p)*b + u(3, 3, p)*c)
        end do
        p = pattern%start(i)
        y(:, i) = u(:, 1, p)*a + u(:, 2, p)*b + u(:, 3, p)*c
      end do
      do i = pattern%nodes, 1, -1
        x1 = y(1, i)
        x2 = y(2, i)
        x3 = y(3, i)
        do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
          j = pattern%column(p)
          x1 = x1 - (u(1, 1, p)*y(1, j) + u(1, 2, p)*y(2, j) + u(1, 3, p)*y(3, j))
          x2 = x2 - (u(2, 1, p)*y(1, j) + u(2, 2, p)*y(2, j) + u(2, 3, p)*y(3, j))
          x3 = x3 - (u(3, 1, p)*y(1, j) + u(3, 2, p)*y(2, j) + u(3, 3, p)*y(3, j))
        end do
        y(:, i) = [x1, x2, x3]
      end do
    end associate
    z = real(y, wp)
  end subroutine precondition

  !> x(3, blocks) for a right-hand side; zero where nothing is free. `found` if the residual fell
  !! to the tolerance.
  subroutine solve(self, pattern, right, tolerance, x, found)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: right(:, :)
    real(wp), intent(in) :: tolerance  !! of the residual's norm, relative
    real(wp), intent(out) :: x(:, :)
    logical, intent(out) :: found
    real(wp), allocatable :: r(:, :), z(:, :), p(:, :), q(:, :)
    real(wp) :: start, rho, before, step

    x = 0.0_wp
    found = .true.
    self%iterations = 0
    self%residual = 0.0_wp
    allocate (r, z, p, q, mold=right)
    r(:, :) = merge(right, 0.0_wp, self%free)
    start = norm2(r)
    if (.not. start > 0.0_wp) return
    p = 0.0_wp
    before = 1.0_wp
    do
      self%residual = norm2(r)/start
      found = self%residual <= tolerance
      if (found .or. self%iterations == most_iterations) return
      call precondition(self, pattern, r/start, z)  ! within the range of single precision
      rho = sum(r*z)
      if (.not. rho > 0.0_wp) return
      if (self%iterations == 0) then
        p = z
      else
        p = z + (rho/before)*p
      end if
      call multiply(pattern, self%k, p, q)
      where (.not. self%free) q = 0.0_wp
      step = rho/sum(p*q)
      x = x + step*p
      r = r - step*q
      before = rho
      self%iterations = self%iterations + 1
    end do
  end subroutine solve
end module fem_cg
