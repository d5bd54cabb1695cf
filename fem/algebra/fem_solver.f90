!> The linear system of free degrees of freedom: numbering, order, factors, solution; by MUMPS, or
!! by conjugate gradients or multigrid where that is faster.
module fem_solver
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use fem_cg, only: cg_type
  use fem_dofs, only: fem_dofs_type
  use fem_halo, only: fem_halo_type
  use fem_sparse, only: fem_pattern_type, make_pattern
  use fem_metis, only: dissect
  use fem_multigrid, only: multigrid_type
  use fem_mumps, only: mumps_type
  implicit none
  private
  public :: fem_solver_type

  !> Factors of K_ff and what leads to them.
  type :: fem_solver_type
    integer(i4) :: free = 0                      !! free degrees of freedom
    integer(i4), allocatable :: equation(:, :)   !! (3, blocks) row, 0 = prescribed
    integer(i4), allocatable :: position(:)      !! (nodes) in the elimination order, the leader's
    type(fem_dofs_type), allocatable :: whole    !! of all ranks' elements, for the order
    integer(i4), allocatable :: block_of(:)      !! all blocks by their owners, if they are dealt
    type(mumps_type) :: mumps
    integer(i4) :: factorisations = 0
    logical :: iterative = .false.               !! no factors
    logical :: by_multigrid = .false.            !! hypre, not our conjugate gradients
    logical :: by_choice = .false.               !! that of the deck is open: factors may follow
    real(wp) :: tolerance = 1.0e-10_wp           !! of the residual of iterations, relative
    type(cg_type) :: cg
    type(multigrid_type) :: multigrid
    integer(i4) :: iterations = 0                !! of the last solution
    real(wp) :: residual = 0.0_wp                !! of the last solution, relative
    real(wp), allocatable, private :: value(:), right(:)
  contains
    procedure :: number
    procedure :: order_nodes
    procedure :: factor
    procedure :: solve
    procedure :: turn_to_factors
    procedure :: foretold
    procedure :: drop
  end type fem_solver_type

contains

  !> Number the free degrees of freedom and analyse the pattern.
  subroutine number(self, dofs, pattern, fixed, errors)
    class(fem_solver_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: fixed(:, :)  !! (3, blocks) supported or prescribed
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: irn(:), jcn(:), order(:)
    integer(i4) :: i, c

    if (.not. allocated(self%position) .and. .not. self%iterative) &
      call order_nodes(self, dofs, pattern, errors)
    if (errors%any()) return
    if (allocated(self%equation)) deallocate (self%equation)
    allocate (self%equation(3, pattern%nodes))
    self%free = 0
    do i = 1, pattern%nodes
      do c = 1, 3
        self%equation(c, i) = 0
        if (fixed(c, i)) cycle
        self%free = self%free + 1
        self%equation(c, i) = self%free
      end do
    end do
    if (pattern%halo%dealt) call number_over_ranks(self, pattern%halo)
    if (self%free == 0) return
    if (self%by_multigrid) call self%multigrid%number(dofs, pattern, self%equation > 0)
    if (self%iterative) return
    call entries_of(self, pattern, irn, jcn)
    if (pattern%halo%dealt) then
      call elimination_of_dealt(self, pattern%halo, order)
    else
      call elimination(self, dofs, order)
    end if
    self%mumps%ranks = pattern%halo%ranks_type
    call self%mumps%analyse(self%free, irn, jcn, order, errors)
    if (allocated(self%value)) deallocate (self%value, self%right)
    allocate (self%value(size(irn)), self%right(self%free))
  end subroutine number

  !> Rows of what is free on all ranks together, those of each rank's own blocks one after the
  !! other, where blocks are dealt out.
  subroutine number_over_ranks(self, halo)
    class(fem_solver_type), intent(inout) :: self
    type(fem_halo_type), intent(in) :: halo
    real(wp) :: rows(3, size(halo%mine)), counts(0:halo%ranks - 1)
    integer(i4) :: i, c, n
    counts = 0.0_wp
    counts(halo%rank) = real(count(self%equation(:, halo%own) > 0), wp)
    call halo%add_up(counts)
    n = nint(sum(counts(:halo%rank - 1)), i4)
    rows = 0.0_wp
    do i = 1, size(halo%own)
      do c = 1, 3
        if (self%equation(c, halo%own(i)) == 0) cycle
        n = n + 1
        rows(c, halo%own(i)) = real(n, wp)
      end do
    end do
    call halo%spread_out(rows)
    self%equation = nint(rows, i4)
    self%free = nint(sum(counts), i4)
  end subroutine number_over_ranks

  !> Positions of the nodes; the leader alone finds the order, others have none.
  subroutine order_nodes(self, dofs, pattern, errors)
    class(fem_solver_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    type(error_list_type), intent(inout) :: errors
    type(fem_pattern_type) :: whole
    if (.not. pattern%halo%several()) then
      call dissect(dofs, pattern, 1_i4, self%position, errors)
    else if (allocated(self%whole)) then
      call make_pattern(self%whole, whole)
      call dissect(self%whole, whole, pattern%halo%ranks, self%position, errors)
      deallocate (self%whole)
    else
      allocate (self%position(0))
    end if
  end subroutine order_nodes

  !> Rows and columns of all entries between free degrees of freedom: the upper triangle, or with
  !! each entry beside the diagonal blocks its mirror image.
  subroutine entries_of(self, pattern, irn, jcn)
    class(fem_solver_type), intent(in) :: self
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), allocatable, intent(out) :: irn(:), jcn(:)
    integer(i4) :: i, j, p, l, m, n, pairs(2, 9)

    n = 0
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        call free_pairs(self, i, pattern%column(p), m, pairs)
        n = n + merge(2*m, m, self%mumps%general .and. i /= pattern%column(p))
      end do
    end do
    allocate (irn(n), jcn(n))
    n = 0
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        j = pattern%column(p)
        call free_pairs(self, i, j, m, pairs)
        do l = 1, m
          n = n + 1
          irn(n) = self%equation(pairs(1, l), i)
          jcn(n) = self%equation(pairs(2, l), j)
          if (i == j .or. .not. self%mumps%general) cycle
          n = n + 1
          irn(n) = self%equation(pairs(2, l), j)
          jcn(n) = self%equation(pairs(1, l), i)
        end do
      end do
    end do
  end subroutine entries_of

  !> The m pairs of components (a, b) of block i, j between free degrees of freedom; of a diagonal
  !! block of a symmetric matrix its upper triangle.
  pure subroutine free_pairs(self, i, j, m, pairs)
    class(fem_solver_type), intent(in) :: self
    integer(i4), intent(in) :: i, j
    integer(i4), intent(out) :: m, pairs(2, 9)
    integer(i4) :: a, b
    m = 0
    do b = 1, 3
      do a = 1, merge(b, 3, i == j .and. .not. self%mumps%general)
        if (self%equation(a, i) == 0 .or. self%equation(b, j) == 0) cycle
        m = m + 1
        pairs(:, m) = [a, b]
      end do
    end do
  end subroutine free_pairs

  !> Elimination order of the equations: by node position, then by field, then by component.
  subroutine elimination(self, dofs, order)
    class(fem_solver_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), allocatable, intent(out) :: order(:)
    integer(i4), allocatable :: node_at(:)
    integer(i4) :: i, c, n

    if (size(self%position) < dofs%nodes) then
      allocate (order(0))
      return
    end if
    allocate (node_at(dofs%nodes), order(self%free))
    do i = 1, dofs%nodes
      node_at(self%position(i)) = i
    end do
    n = 0
    do i = 1, dofs%nodes
      call take(node_at(i))
      if (allocated(dofs%p)) call take_pressure(dofs%p(node_at(i)))
      if (dofs%phi(node_at(i)) == 0) cycle
      do c = 1, dofs%parts
        call take(dofs%phi(node_at(i)) + c - 1)
      end do
    end do

  contains

    subroutine take(block)
      integer(i4), intent(in) :: block
      integer(i4) :: c
      do c = 1, 3
        if (self%equation(c, block) == 0) cycle
        n = n + 1
        order(self%equation(c, block)) = n
      end do
    end subroutine take

    subroutine take_pressure(block)
      integer(i4), intent(in) :: block  !! 0: none
      if (block > 0) call take(block)
    end subroutine take_pressure
  end subroutine elimination

  !> The same where nodes are dealt out and blocks are nodes: the leader has the positions, and the
  !! rows of each owner after those of the one before.
  subroutine elimination_of_dealt(self, halo, order)
    class(fem_solver_type), intent(in) :: self
    type(fem_halo_type), intent(in) :: halo
    integer(i4), allocatable, intent(out) :: order(:)
    real(wp), allocatable :: rows(:, :)
    integer(i4), allocatable :: at(:)
    integer(i4) :: i, k, c, n
    call halo%collect_columns(real(self%equation(:, halo%own), wp), rows)
    if (.not. halo%leads()) then
      allocate (order(0))
      return
    end if
    allocate (order(self%free), at(size(self%position)))
    do k = 1, size(self%block_of)
      at(self%position(self%block_of(k))) = k
    end do
    n = 0
    do i = 1, size(at)
      do c = 1, 3
        k = nint(rows(c, at(i)), i4)
        if (k == 0) cycle
        n = n + 1
        order(k) = n
      end do
    end do
  end subroutine elimination_of_dealt

  !> Factor K + mass_factor M (blocks of the pattern); of general matrices `lower` has the blocks
  !! below the diagonal, block j, i in the place of i, j.
  subroutine factor(self, pattern, k, mass, mass_factor, errors, lower)
    class(fem_solver_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), mass(:)
    real(wp), intent(in) :: mass_factor  !! [1/s^2], 0 in statics
    type(error_list_type), intent(inout) :: errors
    real(wp), intent(in), optional :: lower(:, :, :)

    if (self%free == 0) return
    if (self%iterative) then
      if (mass_factor > 0.0_wp) error stop 'bug: the iterative solver is for statics'
      self%factorisations = self%factorisations + 1
      if (self%by_multigrid) then
        call make_hierarchy(self, pattern, k, errors, lower)
        return
      end if
      call self%cg%prepare(pattern, k, self%equation > 0)
      if (.not. self%cg%factors%ready) &
        call errors%add('N302', 'the stiffness is not positive definite', &
        hint='check supports, moduli and the mesh')
      return
    end if
    call fill_values(self, pattern, k, mass, mass_factor, lower)
    call self%mumps%factor(self%value, errors)
    self%factorisations = self%factorisations + 1
  end subroutine factor

  !> The levels of multigrid for a matrix.
  subroutine make_hierarchy(self, pattern, k, errors, lower)
    class(fem_solver_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), intent(in), optional :: lower(:, :, :)
    real(wp) :: none(3, 3, 0)
    self%multigrid%indefinite = self%mumps%indefinite
    if (present(lower)) then
      call self%multigrid%prepare(pattern, k, lower)
    else
      call self%multigrid%prepare(pattern, k, none)
    end if
    if (.not. self%multigrid%ready) call errors%add('S306', 'hypre made no hierarchy of levels '// &
      'for '//str(self%free)//' unknowns', hint="take solver = 'direct' in &analysis")
  end subroutine make_hierarchy

  !> Values of the entries of K + mass_factor M, in the order of `entries_of`.
  subroutine fill_values(self, pattern, k, mass, mass_factor, lower)
    class(fem_solver_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), mass(:)
    real(wp), intent(in) :: mass_factor  !! [1/s^2]
    real(wp), intent(in), optional :: lower(:, :, :)
    integer(i4) :: i, j, p, a, b, l, m, n, pairs(2, 9)
    n = 0
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        j = pattern%column(p)
        call free_pairs(self, i, j, m, pairs)
        do l = 1, m
          a = pairs(1, l)
          b = pairs(2, l)
          n = n + 1
          self%value(n) = k(a, b, p)
          if (a == b .and. mass_factor > 0.0_wp) self%value(n) = self%value(n) &
            + mass_factor*mass(p)
          if (i == j .or. .not. self%mumps%general) cycle
          n = n + 1
          self%value(n) = lower(b, a, p)
          if (a == b .and. mass_factor > 0.0_wp) self%value(n) = self%value(n) &
            + mass_factor*mass(p)
        end do
      end do
    end do
  end subroutine fill_values

  !> du(3, blocks) from residual(3, blocks); prescribed entries of du are zero.
  subroutine solve(self, pattern, residual, du, errors)
    class(fem_solver_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: du(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i, c

    du = 0.0_wp
    if (self%free == 0) return
    if (self%iterative) then
      call iterate(self, pattern, residual, du, errors)
      return
    end if
    if (pattern%halo%dealt) self%right = 0.0_wp
    do i = 1, size(self%equation, 2)
      if (.not. pattern%halo%counts(i)) cycle
      do c = 1, 3
        if (self%equation(c, i) > 0) self%right(self%equation(c, i)) = residual(c, i)
      end do
    end do
    if (pattern%halo%dealt) call pattern%halo%add_up(self%right)
    call self%mumps%solve(self%right, errors)
    if (errors%any()) return
    do i = 1, size(self%equation, 2)
      do c = 1, 3
        if (self%equation(c, i) > 0) du(c, i) = self%right(self%equation(c, i))
      end do
    end do
  end subroutine solve

  !> du without factors.
  subroutine iterate(self, pattern, residual, du, errors)
    class(fem_solver_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out), contiguous :: du(:, :)
    type(error_list_type), intent(inout) :: errors
    logical :: found
    if (self%by_multigrid) then
      call self%multigrid%solve(pattern, residual, self%tolerance, du, found)
      self%iterations = self%multigrid%iterations
      self%residual = self%multigrid%residual
      if (.not. found) call errors%add('N308', 'multigrid stopped after '// &
        str(self%iterations)//' iterations at a residual of '//str(self%residual), &
        hint="take solver = 'direct' in &analysis")
      return
    end if
    call self%cg%solve(pattern, residual, self%tolerance, du, found)
    self%iterations = self%cg%iterations
    self%residual = self%cg%residual
    if (.not. found) call errors%add('N306', 'conjugate gradients stopped after '// &
      str(self%iterations)//' iterations at a residual of '//str(self%residual), &
      hint="take solver = 'direct' in &analysis")
  end subroutine iterate

  !> Factors from now on; what is free is to be numbered again.
  subroutine turn_to_factors(self)
    class(fem_solver_type), intent(inout) :: self
    self%iterative = .false.
    self%by_multigrid = .false.
    call self%drop()
  end subroutine turn_to_factors

  !> Memory that factors, levels or incomplete factors will take on this rank beside what it has
  !! now, with the values that go into them [byte]; what is free must have been numbered.
  real(wp) function foretold(self, pattern)
    class(fem_solver_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), parameter :: block = 72.0_wp, index = 4.0_wp, value = 8.0_wp
    foretold = 0.0_wp
    if (self%mumps%general) foretold = block*size(pattern%column)  ! the lower triangle
    if (self%by_multigrid) then
      foretold = foretold + self%multigrid%foretold(pattern, .not. self%mumps%general)
    else if (self%iterative) then
      foretold = foretold + (block + index)*size(pattern%column)
    else
      foretold = foretold + self%mumps%foretold()
      if (allocated(self%value)) foretold = foretold + 2.0_wp*value*size(self%value)
    end if
  end function foretold

  !> Release factors and levels.
  subroutine drop(self)
    class(fem_solver_type), intent(inout) :: self
    call self%cg%drop()
    call self%multigrid%drop()
    call self%mumps%free()
  end subroutine drop
end module fem_solver
