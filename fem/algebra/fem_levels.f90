!> Levels of a pattern for sweeps by threads: a row of the forward sweep depends on rows of earlier
!! levels alone, one of the backward sweep on rows of later ones (Saad 2003, section 11.6).
module fem_levels
  use talus_kinds, only: i4
  use fem_sparse, only: fem_pattern_type
  implicit none
  private
  public :: fem_levels_type, make_levels

  type :: fem_levels_type
    integer(i4) :: down = 0, up = 0                       !! levels of the two sweeps
    integer(i4), allocatable :: row(:), first(:)          !! rows by levels, first of each level
    integer(i4), allocatable :: row_up(:), first_up(:)
    integer(i4), allocatable :: start(:)                  !! (rows + 1) columns of the pattern
    integer(i4), allocatable :: from(:), entry(:)         !! rows above the diagonal, their entries
  end type fem_levels_type

contains

  subroutine make_levels(pattern, levels)
    type(fem_pattern_type), intent(in) :: pattern
    type(fem_levels_type), intent(out) :: levels
    integer(i4) :: level(pattern%nodes), next(pattern%nodes), i, j, p

    level = 1
    allocate (levels%start(pattern%nodes + 1), source=0)
    do i = 1, pattern%nodes
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        level(j) = max(level(j), level(i) + 1)
        levels%start(j + 1) = levels%start(j + 1) + 1
      end do
    end do
    call sort_rows(level, levels%down, levels%row, levels%first)
    level = 1
    do i = pattern%nodes, 1, -1
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        level(i) = max(level(i), level(pattern%column(p)) + 1)
      end do
    end do
    level = maxval(level) + 1 - level  ! the backward sweep runs from the last level to the first
    call sort_rows(level, levels%up, levels%row_up, levels%first_up)
    levels%start(1) = 1
    do i = 1, pattern%nodes
      levels%start(i + 1) = levels%start(i) + levels%start(i + 1)
    end do
    allocate (levels%from(levels%start(pattern%nodes + 1) - 1))
    allocate (levels%entry, mold=levels%from)
    next = levels%start(:pattern%nodes)
    do i = 1, pattern%nodes
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        levels%from(next(j)) = i
        levels%entry(next(j)) = p
        next(j) = next(j) + 1
      end do
    end do
  end subroutine make_levels

  !> Rows by levels, ascending in each.
  pure subroutine sort_rows(level, n, row, first)
    integer(i4), intent(in) :: level(:)
    integer(i4), intent(out) :: n
    integer(i4), allocatable, intent(out) :: row(:), first(:)
    integer(i4), allocatable :: next(:)
    integer(i4) :: i
    n = maxval(level)
    allocate (first(n + 1), source=0)
    allocate (row(size(level)))
    do i = 1, size(level)
      first(level(i) + 1) = first(level(i) + 1) + 1
    end do
    first(1) = 1
    do i = 1, n
      first(i + 1) = first(i) + first(i + 1)
    end do
    next = first(:n)
    do i = 1, size(level)
      row(next(level(i))) = i
      next(level(i)) = next(level(i)) + 1
    end do
  end subroutine sort_rows
end module fem_levels
