!> Conjugate gradients for large symmetric positive systems, preconditioned by an incomplete
!! Cholesky factorisation (fem_cholesky). Products and sums run in threads, with the same bits for
!! any number of them. With ranks each factors the matrix of all blocks of its elements, and what
!! they find is added with weights (symmetric additive Schwarz: 188 iterations on two ranks for 40^3
!! hexahedra, where one needs 167 and blocks without overlap 208).
module fem_cg
  use talus_kinds, only: wp, i4
  use fem_cholesky, only: cholesky_type
  use fem_own_matrix, only: own_matrix
  use fem_sparse, only: fem_pattern_type, multiply_part
  use fem_vectors, only: dot, dot_of, add_scaled, scale_add
  implicit none
  private
  public :: cg_type

  integer(i4), parameter :: most_iterations = 3000

  type :: cg_type
    integer(i4) :: iterations = 0     !! of the last solution
    real(wp) :: residual = 0.0_wp     !! of the last solution, over that at its start
    type(cholesky_type) :: factors
    logical, allocatable, private :: free(:, :)       !! (3, blocks), and of this rank's elements
    real(wp), allocatable, private :: weight(:)       !! (blocks that others have too)
    real(wp), allocatable, private :: k(:, :, :)      !! (3, 3, entries)
  contains
    procedure :: prepare
    procedure :: solve
    procedure :: drop
  end type cg_type

contains

  !> Set a matrix and factor it incompletely; `factors%ready` is true on success.
  subroutine prepare(self, pattern, k, free)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)   !! (3, 3, entries) upper triangle
    logical, intent(in) :: free(:, :)    !! (3, blocks) what is solved for
    real(wp), allocatable :: own(:, :, :)
    logical :: failed
    self%k = k
    self%free = free
    if (.not. pattern%halo%several()) then
      call self%factors%prepare(pattern, k, free)
      return
    end if
    call choose_own(self, pattern)
    call own_matrix(pattern, k, own)
    call self%factors%prepare(pattern, own, self%free)
    failed = .not. self%factors%ready
    call pattern%halo%any_of(failed)
    self%factors%ready = .not. failed
  end subroutine prepare

  !> The blocks of this rank, and the roots of one over the number of ranks that have them.
  subroutine choose_own(self, pattern)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    logical :: here(pattern%nodes)
    integer(i4) :: ranks(pattern%nodes), i
    here = pattern%halo%mine
    here(pattern%halo%common) = .true.
    ranks = 1
    do i = 1, size(pattern%halo%shared)
      ranks(pattern%halo%shared(i)) = ranks(pattern%halo%shared(i)) + 1
    end do
    self%free = self%free .and. spread(here, 1, 3)
    self%weight = 1.0_wp/sqrt(real(ranks(pattern%halo%common), wp))
  end subroutine choose_own

  !> Release the memory.
  subroutine drop(self)
    class(cg_type), intent(inout) :: self
    if (allocated(self%k)) deallocate (self%k, self%free)
    call self%factors%drop()
  end subroutine drop

  !> x(3, blocks) for a right-hand side; zero where nothing is free. `found` if the residual fell
  !! to the tolerance. The iteration is scaled to an initial residual of one.
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
    if (pattern%halo%several()) start = sqrt(total(pattern, r, r))
    if (.not. start > 0.0_wp) return
    r = r/start
    p = 0.0_wp
    before = 1.0_wp
    do
      self%residual = sqrt(total(pattern, r, r))
      found = self%residual <= tolerance
      if (found .or. self%iterations == most_iterations) exit
      call precondition(self, pattern, r, q, z)
      rho = total(pattern, r, z)
      if (.not. rho > 0.0_wp) exit
      call scale_add(merge(0.0_wp, rho/before, self%iterations == 0), z, p)
      call multiply_part(pattern, self%k, p, q)
      call pattern%halo%exchange(q)
      call mask(self%free, q)
      step = rho/total(pattern, p, q)
      call add_scaled(step, p, x)
      call add_scaled(-step, q, r)
      before = rho
      self%iterations = self%iterations + 1
    end do
    x = start*x
    call pattern%halo%spread_out(x)
  end subroutine solve

  !> z from r; q is workspace.
  subroutine precondition(self, pattern, r, q, z)
    class(cg_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: r(:, :)
    real(wp), intent(inout), contiguous :: q(:, :)
    real(wp), intent(out), contiguous :: z(:, :)
    integer(i4) :: i
    if (.not. pattern%halo%several()) then
      call self%factors%apply(pattern, r, z)
      return
    end if
    associate (common => pattern%halo%common)
      q = r
      do i = 1, size(common)
        q(:, common(i)) = self%weight(i)*q(:, common(i))
      end do
      call self%factors%apply(pattern, q, z)
      call mask(self%free, z)
      do i = 1, size(common)
        z(:, common(i)) = self%weight(i)*z(:, common(i))
      end do
    end associate
    call pattern%halo%exchange(z)
  end subroutine precondition

  !> sum a b over the owners of the blocks.
  real(wp) function total(pattern, a, b)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)
    real(wp) :: sums(1)
    if (pattern%halo%several()) then
      sums = dot_of(pattern%halo%mine, a, b)
      call pattern%halo%add_up(sums)
    else
      sums = dot(a, b)
    end if
    total = sums(1)
  end function total

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
