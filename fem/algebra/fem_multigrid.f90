!> Large systems by Krylov methods with one cycle of algebraic multigrid (hypre's BoomerAMG) before
!! each product: conjugate gradients for symmetric matrices, least residuals (GMRES) for others and
!! where gradients find no way, since the tangent of a law may be indefinite.
!!
!! Rows of what is prescribed stay, with a diagonal alone: every block has three. With ranks each
!! owns the rows of its blocks; hypre sends entries of its elements in rows of others there.
module fem_multigrid
  use, intrinsic :: iso_c_binding, only: c_associated, c_null_ptr, c_ptr
  use talus_kinds, only: wp, i4, i8
  use talus_ranks, only: start_mpi
  use talus_text, only: is_finite
  use fem_dofs, only: fem_dofs_type
  use fem_hypre, only: hypre_new, hypre_add, hypre_set_up, hypre_solve, hypre_free
  use fem_sparse, only: fem_pattern_type, largest_entry
  implicit none
  private
  public :: multigrid_type

  integer(i4), parameter :: most_iterations = 500
  integer(i4), parameter :: batch = 2**20          !! entries handed over at once
  real(wp), parameter :: drift = 10.0_wp           !! of the true residual, over that of a method
  integer(i4), parameter :: gradients = 1, least_residuals = 0
  !> Memory [byte]: of each entry of the matrix in all levels, of what does not grow with it, and of
  !! each unknown in the vectors of least residuals. Measured (manual, Ranks).
  real(wp), parameter :: each_entry = 26.0_wp, at_least = 8.0e6_wp, each_vector = 800.0_wp

  type :: multigrid_type
    logical :: ready = .false.
    integer(i4) :: iterations = 0     !! of the last solution
    real(wp) :: residual = 0.0_wp     !! of the last solution, over that at its start
    logical :: symmetric = .true.
    logical :: indefinite = .false.   !! perhaps: least residuals where gradients fail
    real(wp), private :: largest = 0.0_wp            !! entry, diagonal of what is prescribed
    integer(i4), private :: first = 0                !! row of this rank, from 0
    integer(i4), allocatable, private :: own(:)      !! blocks of this rank
    integer(i4), allocatable, private :: row(:)      !! (blocks) first row of each, from 0
    integer(i4), allocatable, private :: kind(:)     !! (blocks) field of each, from 0
    logical, allocatable, private :: free(:, :)      !! (3, blocks)
    type(c_ptr), private :: system = c_null_ptr
  contains
    procedure :: number
    procedure :: prepare
    procedure :: solve
    procedure, nopass :: foretold
    procedure :: drop
  end type multigrid_type

  !> Rows on their way to hypre.
  type :: batch_type
    integer(i4) :: rows = 0, entries = 0
    integer(i4), allocatable :: counts(:), row(:), column(:)
    real(wp), allocatable :: value(:)
    logical :: failed = .false.
  end type batch_type

  !> Entries of the upper triangle by columns: those of column j, without its diagonal, are
  !! entry(:, first(j):first(j + 1) - 1).
  type :: below_type
    integer(i4), allocatable :: first(:)
    integer(i4), allocatable :: entry(:, :)  !! (2, n) row and place of each
  end type below_type

contains

  !> Rows of the blocks, those of each rank together, and what is solved for.
  subroutine number(self, dofs, pattern, free)
    class(multigrid_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: free(:, :)    !! (3, blocks)
    integer(i4) :: i, part
    self%free = free
    if (pattern%halo%several()) then
      self%own = pattern%halo%own_blocks()
      self%first = 3*(pattern%halo%first_own(pattern%halo%rank) - 1)
      self%row = 3*pattern%halo%rows()
    else
      self%own = [(i, i=1, pattern%nodes)]
      self%row = [(3*(i - 1), i=1, pattern%nodes)]
    end if
    self%kind = [(0, i=1, pattern%nodes)]
    do i = 1, dofs%nodes
      if (dofs%phi(i) == 0) cycle
      do part = 1, dofs%parts
        self%kind(dofs%phi(i) + part - 1) = part
      end do
    end do
  end subroutine number

  !> Set a matrix and make its hierarchy; `ready` is true on success. Of matrices that are not
  !! symmetric `lower` has the blocks below the diagonal, block j, i in the place of i, j.
  subroutine prepare(self, pattern, k, lower)
    class(multigrid_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)     !! (3, 3, entries) upper triangle
    real(wp), intent(in) :: lower(:, :, :) !! of none for symmetric matrices
    type(below_type) :: below
    integer(i4), allocatable :: room(:)
    logical :: good
    integer(i4) :: i

    call release(self)
    self%symmetric = size(lower, 3) == 0
    call entries_below(pattern, below)
    room = [(3*(pattern%start(self%own(i) + 1) - pattern%start(self%own(i)) + &
      below%first(self%own(i) + 1) - below%first(self%own(i))), i=1, size(self%own))]
    room = reshape(spread(room, 1, 3), [3*size(self%own)])
    good = is_finite(sum(abs(k)) + sum(abs(lower))) .and. &
      9_i8*(2_i8*size(pattern%column, kind=i8) + pattern%nodes) < huge(0_i4)
    good = .not. on_any(pattern, .not. good)
    if (.not. good) return
    call start_mpi()
    self%system = hypre_new(pattern%halo%comm, self%first, 3*size(self%own), room)
    good = c_associated(self%system)
    if (good) call give_entries(self, pattern, k, lower, below, good)
    if (.not. on_any(pattern, .not. good)) good = hypre_set_up(self%system, &
      3*(maxval(self%kind) + 1), functions(self), merge(1, 0, self%symmetric)) == 0
    self%ready = .not. on_any(pattern, .not. good)
  end subroutine prepare

  subroutine entries_below(pattern, below)
    type(fem_pattern_type), intent(in) :: pattern
    type(below_type), intent(out) :: below
    integer(i4), allocatable :: next(:)
    integer(i4) :: i, j, p
    allocate (below%first(pattern%nodes + 1))
    allocate (below%entry(2, size(pattern%column) - pattern%nodes))
    associate (first => below%first)
      first = 0
      do i = 1, pattern%nodes
        do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
          first(pattern%column(p) + 1) = first(pattern%column(p) + 1) + 1
        end do
      end do
      first(1) = 1
      do i = 1, pattern%nodes
        first(i + 1) = first(i) + first(i + 1)
      end do
      next = first
    end associate
    do i = 1, pattern%nodes
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        below%entry(:, next(j)) = [i, p]
        next(j) = next(j) + 1
      end do
    end do
  end subroutine entries_below

  !> Hand over the rows of the blocks of this rank's elements.
  subroutine give_entries(self, pattern, k, lower, below, good)
    class(multigrid_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), lower(:, :, :)
    type(below_type), intent(in) :: below
    logical, intent(out) :: good
    type(batch_type) :: out
    logical :: here(pattern%nodes)
    integer(i4) :: i, c, most

    here = .true.
    if (pattern%halo%several()) then
      here = pattern%halo%mine
      here(pattern%halo%common) = .true.
    end if
    self%largest = largest_entry(pattern, k)
    most = 9*maxval(pattern%start(2:) - pattern%start(:pattern%nodes) &
      + below%first(2:) - below%first(:pattern%nodes))
    allocate (out%counts(batch), out%row(batch))
    allocate (out%column(batch + most), out%value(batch + most))
    do i = 1, pattern%nodes
      if (.not. here(i)) cycle
      do c = 1, 3
        if (self%free(c, i)) then
          call put_row(self, pattern, k, lower, below, [i, c], out)
        else if (pattern%halo%owns(i)) then
          call put(self%row(i) + c - 1, self%largest, out)
          call end_row(self%row(i) + c - 1, 1, out)
        end if
      end do
      if (out%entries > batch .or. out%rows > batch - 3) call hand_over(self, out)
    end do
    call hand_over(self, out)
    good = .not. out%failed
  end subroutine give_entries

  !> One row: component c of block i.
  subroutine put_row(self, pattern, k, lower, below, at, out)
    class(multigrid_type), intent(in) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), lower(:, :, :)
    type(below_type), intent(in) :: below
    integer(i4), intent(in) :: at(2)  !! block, component
    type(batch_type), intent(inout) :: out
    integer(i4) :: p, l, before
    before = out%entries
    associate (i => at(1), c => at(2))
      do l = below%first(i), below%first(i + 1) - 1
        p = below%entry(2, l)
        if (self%symmetric) then
          call put_block(self, below%entry(1, l), k(:, c, p), out)
        else
          call put_block(self, below%entry(1, l), lower(c, :, p), out)
        end if
      end do
      do p = pattern%start(i), pattern%start(i + 1) - 1
        call put_block(self, pattern%column(p), k(c, :, p), out)
      end do
      call end_row(self%row(i) + c - 1, out%entries - before, out)
    end associate
  end subroutine put_row

  !> Entries of a row at block j.
  pure subroutine put_block(self, j, values, out)
    class(multigrid_type), intent(in) :: self
    integer(i4), intent(in) :: j
    real(wp), intent(in) :: values(3)
    type(batch_type), intent(inout) :: out
    integer(i4) :: b
    do b = 1, 3
      if (self%free(b, j)) call put(self%row(j) + b - 1, values(b), out)
    end do
  end subroutine put_block

  pure subroutine put(column, value, out)
    integer(i4), intent(in) :: column
    real(wp), intent(in) :: value
    type(batch_type), intent(inout) :: out
    out%entries = out%entries + 1
    out%column(out%entries) = column
    out%value(out%entries) = value
  end subroutine put

  !> The entries that were put last are those of a row.
  pure subroutine end_row(row, count_of, out)
    integer(i4), intent(in) :: row, count_of
    type(batch_type), intent(inout) :: out
    out%rows = out%rows + 1
    out%row(out%rows) = row
    out%counts(out%rows) = count_of
  end subroutine end_row

  !> The rows that were collected, which hypre adds up.
  subroutine hand_over(self, out)
    class(multigrid_type), intent(in) :: self
    type(batch_type), intent(inout) :: out
    if (out%rows > 0) then
      if (hypre_add(self%system, out%rows, out%counts, out%row, out%column, out%value) /= 0) &
        out%failed = .true.
    end if
    out%rows = 0
    out%entries = 0
  end subroutine hand_over

  !> Component of each row of this rank, from 0: those of the fields are coarsened apart.
  pure function functions(self) result(list)
    class(multigrid_type), intent(in) :: self
    integer(i4) :: list(3*size(self%own)), i, c
    do i = 1, size(self%own)
      do c = 1, 3
        list(3*(i - 1) + c) = 3*self%kind(self%own(i)) + c - 1
      end do
    end do
  end function functions

  !> Memory that the levels of a matrix and the vectors of a solution will take on this rank [byte].
  pure real(wp) function foretold(pattern, symmetric)
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: symmetric
    foretold = at_least + each_entry*9.0_wp*(2.0_wp*size(pattern%column) - pattern%nodes)
    if (.not. symmetric) foretold = foretold + 3.0_wp*each_vector*pattern%nodes
  end function foretold

  !> x(3, blocks) for a right-hand side; zero where nothing is free. `found` if the residual fell
  !! to the tolerance, and the true one about so, or to its rounding. The right-hand side is scaled
  !! to a norm of one.
  subroutine solve(self, pattern, right, tolerance, x, found)
    class(multigrid_type), intent(inout) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: right(:, :)
    real(wp), intent(in) :: tolerance  !! of the residual's norm, relative
    real(wp), intent(out), contiguous :: x(:, :)
    logical, intent(out) :: found
    real(wp), allocatable :: b(:, :), y(:, :)
    real(wp) :: square(1)

    x = 0.0_wp
    found = .true.
    self%iterations = 0
    self%residual = 0.0_wp
    b = merge(right(:, self%own), 0.0_wp, self%free(:, self%own))
    square = sum(b**2)
    call pattern%halo%add_up(square)
    if (.not. abs(square(1)) > 0.0_wp) return
    b = b/sqrt(square(1))
    allocate (y, mold=b)
    call iterate(merge(gradients, least_residuals, self%symmetric))
    if (.not. found .and. self%symmetric .and. self%indefinite) call iterate(least_residuals)
    x(:, self%own) = sqrt(square(1))*merge(y, 0.0_wp, self%free(:, self%own))
    call pattern%halo%spread_out(x)

  contains

    subroutine iterate(method)
      integer(i4), intent(in) :: method
      integer(i4) :: n
      real(wp) :: left(2), size_of(1)
      n = hypre_solve(self%system, method, tolerance, most_iterations, b, y, left)
      self%residual = left(2)
      size_of = sum(y**2)
      call pattern%halo%add_up(size_of)
      self%iterations = self%iterations + max(0, n)
      found = .not. on_any(pattern, n < 0 .or. .not. &
        (left(1) <= tolerance .and. left(2) <= drift* &
         max(tolerance, epsilon(1.0_wp)*self%largest*sqrt(size_of(1)))))
    end subroutine iterate
  end subroutine solve

  !> Release the memory.
  subroutine drop(self)
    class(multigrid_type), intent(inout) :: self
    call release(self)
    if (allocated(self%free)) deallocate (self%free, self%own, self%row, self%kind)
  end subroutine drop

  subroutine release(self)
    class(multigrid_type), intent(inout) :: self
    self%ready = .false.
    if (c_associated(self%system)) call hypre_free(self%system)
    self%system = c_null_ptr
  end subroutine release

  !> Does it hold on any rank?
  logical function on_any(pattern, flag)
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: flag
    on_any = flag
    call pattern%halo%any_of(on_any)
  end function on_any
end module fem_multigrid
