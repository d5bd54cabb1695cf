!> A stiffness that is singular though supports hold the body as a whole: hinges, elements without
!! control of their hourglass modes, weights of zero. Inverse iteration with the factors finds
!! the motion with the least resistance; where it has none its nodes are named.
module fem_null_mode
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use fem_dofs, only: fem_dofs_type
  use fem_solver, only: fem_solver_type
  use fem_sparse, only: fem_pattern_type, multiply
  implicit none
  private
  public :: explain_singular

  real(wp), parameter :: suspicious = 1.0e-9_wp  !! x K x / x D x below which a motion is examined
  real(wp), parameter :: nothing = 1.0e-13_wp    !! that counts as no resistance
  real(wp), parameter :: shift = 1.0e-9_wp       !! of the diagonal where there are no factors
  real(wp), parameter :: takes_part = 0.1_wp     !! of the largest motion
  integer(i4), parameter :: named = 4            !! nodes that the message names

contains

  !> Fault N301 with the nodes of the null mode, instead of the factorisation's fault of pivots. Not
  !! where nodes are dealt out: factors are made there only after iterations have failed.
  subroutine explain_singular(solver, pattern, dofs, k, errors)
    type(fem_solver_type), intent(inout) :: solver
    type(fem_pattern_type), intent(in) :: pattern
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(in) :: k(:, :, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, pattern%nodes) :: diagonal, x, kx
    type(error_list_type) :: late
    integer(i4) :: i, c

    if (solver%iterative .or. solver%free == 0 .or. pattern%halo%dealt) return
    if (errors%any()) then
      if (errors%item(errors%count)%code(1:1) /= 'N') return
    end if
    do i = 1, pattern%nodes
      do c = 1, 3
        diagonal(c, i) = k(c, c, pattern%start(i))
        x(c, i) = sin(real(3*i + c, wp))
      end do
    end do
    call pattern%halo%sum_up(diagonal)
    where (solver%equation == 0) x = 0.0_wp
    if (.not. solver%mumps%factored) call shifted_factors(solver, pattern, k, diagonal, late)
    do i = 1, 3
      if (late%any()) return
      kx = diagonal*x
      call solver%solve(pattern, kx, x, late)
      if (.not. maxval(abs(x)) > 0.0_wp) return
      if (i == 1 .and. abs(sum(kx*x)) > suspicious*sum(diagonal*x**2)) return
      x = x/maxval(abs(x))
    end do
    call multiply(pattern, k, x, kx)
    if (abs(sum(x*kx)) > nothing*sum(diagonal*x**2)) return
    call errors%clear()
    call errors%add('N301', 'the stiffness is singular: '//mode_text(dofs, x), '', &
      'are parts connected by an edge or a corner alone, are hourglass modes left free, '// &
      'have points no weight, or is poisson nearly 1/2? Hold these nodes, or tie them')
  end subroutine explain_singular

  !> Factors of the matrix with its diagonal raised a little, by the owner of each block.
  subroutine shifted_factors(solver, pattern, k, diagonal, errors)
    type(fem_solver_type), intent(inout) :: solver
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), diagonal(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: raised(:, :, :)
    real(wp) :: none(size(k, 3)), most
    integer(i4) :: i, p, c
    allocate (raised, source=k)
    none = 0.0_wp
    most = max(0.0_wp, maxval(diagonal))
    do i = 1, pattern%nodes
      if (.not. pattern%halo%owns(i)) cycle
      p = pattern%start(i)
      do c = 1, 3
        raised(c, c, p) = k(c, c, p) + shift*diagonal(c, i)
        if (.not. diagonal(c, i) > 0.0_wp) raised(c, c, p) = most
      end do
    end do
    call solver%factor(pattern, raised, none, 0.0_wp, errors)
  end subroutine shifted_factors

  !> The nodes that move most, and how many move.
  function mode_text(dofs, x) result(text)
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(in) :: x(:, :)
    character(len=:), allocatable :: text
    real(wp) :: size_of(size(x, 2))
    integer(i4) :: n, i, c, moving
    size_of = maxval(abs(x), 1)
    moving = int(count(size_of > takes_part*maxval(size_of)), i4)
    text = 'a motion without resistance, of '
    do n = 1, min(named, moving)
      i = int(maxloc(size_of, 1), i4)
      c = int(maxloc(abs(x(:, i)), 1), i4)
      if (n > 1) text = text//', '
      text = text//'node '//str(dofs%node(i))
      if (i > dofs%nodes) then
        text = text//' about '//'xyz'(c:c)
      else
        text = text//' along '//'xyz'(c:c)
      end if
      size_of(i) = 0.0_wp
    end do
    if (moving > named) text = text//' and '//str(moving - named)//' more'
  end function mode_text
end module fem_null_mode
