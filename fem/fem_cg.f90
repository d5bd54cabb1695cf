!> Conjugate gradients for large symmetric positive systems, preconditioned by an incomplete
!! Cholesky factorisation (fem_cholesky). Products and sums go by threads, with the same bits for
!! any number of them.
module fem_cg
  use talus_kinds, only: wp, i4
  use fem_cholesky, only: cholesky_type
  use fem_sparse, only: fem_pattern_type, multiply
  use fem_vectors, only: dot, norm, add_scaled, scale_add
  implicit none
  private
  public :: cg_type

  integer(i4), parameter :: most_iterations = 3000

  type :: cg_type
    integer(i4) :: iterations = 0     !! of the last solution
    real(wp) :: residual = 0.0_wp     !! of the last solution, over that at its start
    type(cholesky_type) :: factors
    logical, allocatable, private :: free(:, :)       !! (3, blocks)
    real(wp), allocatable, private :: k(:, :, :)      !! (3, 3, entries)
  contains
    procedure :: prepare
    procedure :: solve
    procedure :: drop
  end type cg_type

contains

  !> Take a matrix and factor it incompletely; `factors%ready` tells whether that worked.
  subroutine prepare(self, pattern, k, free)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)   !! (3, 3, entries) upper triangle
    logical, intent(in) :: free(:, :)    !! (3, blocks) what is solved for
    self%k = k
    self%free = free
    call self%factors%prepare(pattern, k, free)
  end subroutine prepare

  !> Give the memory back.
  subroutine drop(self)
    class(cg_type), intent(inout) :: self
    if (allocated(self%k)) deallocate (self%k, self%free)
    call self%factors%drop()
  end subroutine drop

  !> x(3, blocks) for a right-hand side; zero where nothing is free. `found` if the residual fell
  !! to the tolerance. The iteration works on what is scaled to a residual of one at its start.
  subroutine solve(self, pattern, right, tolerance, x, found)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: right(:, :)
    real(wp), intent(in) :: tolerance  !! of the residual's norm, relative
    real(wp), intent(out), contiguous :: x(:, :)
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
    r = r/start
    p = 0.0_wp
    before = 1.0_wp
    do
      self%residual = norm(r)
      found = self%residual <= tolerance
      if (found .or. self%iterations == most_iterations) exit
      call self%factors%apply(pattern, r, z)
      rho = dot(r, z)
      if (.not. rho > 0.0_wp) exit
      call scale_add(merge(0.0_wp, rho/before, self%iterations == 0), z, p)
      call multiply(pattern, self%k, p, q)
      call mask(self%free, q)
      step = rho/dot(p, q)
      call add_scaled(step, p, x)
      call add_scaled(-step, q, r)
      before = rho
      self%iterations = self%iterations + 1
    end do
    x = start*x
  end subroutine solve

  !> Nothing where nothing is free.
  subroutine mask(free, q)
    logical, intent(in), contiguous :: free(:, :)
    real(wp), intent(inout), contiguous :: q(:, :)
    integer(i4) :: i
    !$omp parallel do default(none) shared(free, q) private(i) schedule(static)
    do i = 1, size(q, 2)
      where (.not. free(:, i)) q(:, i) = 0.0_wp
    end do
    !$omp end parallel do
  end subroutine mask
end module fem_cg
