!> Shares of the threads in products with the matrix (fem_sparse).
module fem_shares
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: i4
  use fem_assembly, only: share_nodes
  use fem_dofs, only: fem_dofs_type
  use fem_sparse, only: fem_pattern_type, fem_share_type, rows_inner, rows_border, rows_foreign, &
    has_block
  implicit none
  private
  public :: share_pattern

  integer(i4), parameter :: least = 2000  !! least number of blocks for threads

contains

  !> Shares of all threads; none where one thread does it all.
  subroutine share_pattern(dofs, pattern)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(inout) :: pattern
    integer(i4), allocatable :: first(:)
    integer(i4) :: t, threads

    if (allocated(pattern%share)) deallocate (pattern%share)
    threads = omp_get_max_threads()
    if (threads == 1 .or. pattern%nodes < least) return
    call share_nodes(dofs, pattern, threads, first)
    allocate (pattern%share(threads))
    !$omp parallel do default(none) shared(dofs, pattern, first, threads) private(t) &
    !$omp schedule(static, 1)
    do t = 1, threads
      call fill_share(dofs, pattern, first(t), first(t + 1) - 1, pattern%share(t))
    end do
    !$omp end parallel do
  end subroutine share_pattern

  !> Blocks of the nodes first to last, and the rows that touch them.
  pure subroutine fill_share(dofs, pattern, first, last, share)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: first, last
    type(fem_share_type), intent(inout) :: share
    integer(i4) :: i, n, kind, previous, pass

    share%first(1) = first
    share%last(1) = last
    do i = dofs%blocks, dofs%nodes + 1, -1  ! in the order of their nodes
      if (dofs%node(i) < first .or. dofs%node(i) > last) cycle
      share%first(2) = i
      share%last(2) = max(share%last(2), i)
    end do
    do pass = 1, 2
      n = 0
      previous = 0
      do i = 1, pattern%nodes
        kind = kind_of_row(pattern, share, i)
        if (kind > 0 .and. kind /= previous) n = n + 1
        if (pass == 2 .and. kind > 0) then
          if (kind /= previous) share%rows(:, n) = [i, i, kind]
          share%rows(2, n) = i
        end if
        previous = kind
      end do
      if (pass == 1) allocate (share%rows(3, n))
    end do
  end subroutine fill_share

  !> Kind of row i for a share; 0: nothing to do with it.
  pure integer(i4) function kind_of_row(pattern, share, i) result(kind)
    type(fem_pattern_type), intent(in) :: pattern
    type(fem_share_type), intent(in) :: share
    integer(i4), intent(in) :: i
    logical :: mine(pattern%start(i + 1) - pattern%start(i))
    mine = has_block(share, pattern%column(pattern%start(i):pattern%start(i + 1) - 1))
    kind = 0
    if (has_block(share, i)) then
      kind = merge(rows_inner, rows_border, all(mine))
    else if (any(mine)) then
      kind = rows_foreign
    end if
  end function kind_of_row
end module fem_shares
