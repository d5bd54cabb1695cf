!> Matrices of elements to the blocks of a pattern, symmetric or with what is below the diagonal.
module fem_scatter
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_sparse, only: fem_pattern_type, place
  implicit none
  private
  public :: add_element, add_flow, clear_rows

contains

  !> Zero in the rows of a range of nodes, of all fields.
  pure subroutine clear_rows(dofs, pattern, range, symmetric, k, lower)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: range(2)
    logical, intent(in) :: symmetric
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    integer(i4) :: n
    do n = range(1), range(2) - 1
      call clear(pattern, [n, n], k)
      if (.not. symmetric) call clear(pattern, [n, n], lower)
      if (dofs%phi(n) > 0) then
        call clear(pattern, dofs%phi(n) + [0, dofs%parts - 1], k)
        if (.not. symmetric) call clear(pattern, dofs%phi(n) + [0, dofs%parts - 1], lower)
      end if
      if (.not. allocated(dofs%p)) cycle
      if (dofs%p(n) == 0) cycle
      call clear(pattern, [dofs%p(n), dofs%p(n)], k)
      if (.not. symmetric) call clear(pattern, [dofs%p(n), dofs%p(n)], lower)
    end do
  end subroutine clear_rows

  !> Zero in the rows of the first to the last of some blocks.
  pure subroutine clear(pattern, block, k)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: block(2)
    real(wp), intent(inout) :: k(:, :, :)
    k(:, :, pattern%start(block(1)):pattern%start(block(2) + 1) - 1) = 0.0_wp
  end subroutine clear

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

  !> Add the couplings of displacements and pressures of an element, those of the rows of
  !! displacements and, transposed, of the rows of pressures, and the matrix of the pressures.
  pure subroutine add_flow(block, wet, pattern, coupling, flow, k, lower)
    integer(i4), intent(in) :: block(:), wet(:)  !! of displacements and, all above, of pressures
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: coupling(:, :, :)    !! (3 nodes, corners, 2) [m^2]
    real(wp), intent(in) :: flow(:, :)           !! (corners, corners) [m^3/Pa]
    real(wp), intent(inout) :: k(:, :, :)
    real(wp), intent(inout) :: lower(:, :, :)    !! below the diagonal, or none
    integer(i4) :: a, b, p
    do b = 1, size(wet)
      do a = 1, size(block)
        p = place(pattern, block(a), wet(b))
        k(:, 1, p) = k(:, 1, p) + coupling(3*a - 2:3*a, b, 1)
        if (size(lower, 3) > 0) lower(1, :, p) = lower(1, :, p) + coupling(3*a - 2:3*a, b, 2)
      end do
      do a = 1, size(wet)
        if (wet(a) > wet(b)) cycle
        p = place(pattern, wet(a), wet(b))
        k(1, 1, p) = k(1, 1, p) + flow(a, b)
        if (size(lower, 3) > 0 .and. a /= b) lower(1, 1, p) = lower(1, 1, p) + flow(b, a)
      end do
    end do
  end subroutine add_flow
end module fem_scatter
