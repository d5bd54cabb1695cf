!> Matrices of elements to the blocks of a pattern, symmetric or with what is below the diagonal.
module fem_scatter
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_sparse, only: fem_pattern_type, place
  implicit none
  private
  public :: add_element, clear_rows

contains

  !> Zero in the rows of a range of nodes, of both fields.
  pure subroutine clear_rows(dofs, pattern, range, symmetric, k, lower)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: range(2)
    logical, intent(in) :: symmetric
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    integer(i4) :: n, i
    do n = range(1), range(2) - 1
      k(:, :, pattern%start(n):pattern%start(n + 1) - 1) = 0.0_wp
      if (.not. symmetric) lower(:, :, pattern%start(n):pattern%start(n + 1) - 1) = 0.0_wp
      if (dofs%phi(n) == 0) cycle
      i = dofs%phi(n) + dofs%parts
      k(:, :, pattern%start(dofs%phi(n)):pattern%start(i) - 1) = 0.0_wp
      if (.not. symmetric) lower(:, :, pattern%start(dofs%phi(n)):pattern%start(i) - 1) = 0.0_wp
    end do
  end subroutine clear_rows

  !> Add an element to the rows of its blocks that are `mine`.
  pure subroutine add_element(block, mine, pattern, symmetric, ke, k, lower)
    integer(i4), intent(in) :: block(:)
    logical, intent(in) :: mine(:)
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: symmetric
    real(wp), intent(in) :: ke(:, :)
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    integer(i4) :: a, b, p
    do b = 1, size(block)
      do a = 1, size(block)
        if (.not. merge(mine(a), mine(b), block(a) <= block(b))) cycle
        if (symmetric .and. block(a) > block(b)) cycle
        p = place(pattern, min(block(a), block(b)), max(block(a), block(b)))
        if (block(a) <= block(b)) then
          k(:, :, p) = k(:, :, p) + ke(3*a - 2:3*a, 3*b - 2:3*b)
        else
          lower(:, :, p) = lower(:, :, p) + ke(3*a - 2:3*a, 3*b - 2:3*b)
        end if
      end do
    end do
  end subroutine add_element
end module fem_scatter
