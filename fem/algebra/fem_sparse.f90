!> Symmetric matrix of 3 x 3 blocks on the pattern of the fields: upper triangle by rows.
!!
!! The pattern is built once; stiffness and mass share it (mass is a scalar a pair of blocks). Where
!! there are several ranks the matrix is the sum of theirs, and products are complete on all.
module fem_sparse
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_halo, only: fem_halo_type
  use fem_types, only: fem_springs_type
  implicit none
  private
  public :: spring_force, multiply_general, largest_entry
  public :: fem_pattern_type, fem_share_type, rows_inner, rows_border, rows_foreign, has_block
  public :: make_pattern, elements_of_blocks, place, add_springs
  public :: multiply, multiply_part, multiply_mass, scale_mass, block_diagonal, holders_of
  public :: mass_diagonal

  !> Rows whose columns are all of their share, some of which are, or that belong to another.
  integer(i4), parameter :: rows_inner = 1, rows_border = 2, rows_foreign = 3

  !> Work of a thread in a product: its blocks are two ranges, displacements and micro-rotations
  !! of the same nodes.
  type :: fem_share_type
    integer(i4) :: first(2) = 1, last(2) = 0
    integer(i4), allocatable :: rows(:, :)  !! (3, n) first and last row, and their kind
  end type fem_share_type

  !> Rows of the upper triangle: row n has the columns column(start(n):start(n+1)-1), all >= n.
  type :: fem_pattern_type
    integer(i4) :: nodes = 0  !! rows: one a block
    integer(i4), allocatable :: start(:), column(:)
    type(fem_share_type), allocatable :: share(:)  !! of the threads, none for one
    type(fem_halo_type) :: halo                    !! ranks that have a part of the matrix each
  end type fem_pattern_type

contains

  !> Pattern of the fields of a mesh; springs on facets fit into it, their nodes share an element.
  !! Every block has its diagonal, also where this rank has no element.
  subroutine make_pattern(dofs, pattern)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(out) :: pattern
    integer(i4), allocatable :: first(:), list(:), mark(:)
    integer(i4) :: e, n, k, total, a
    integer(i4) :: pass

    pattern%nodes = dofs%blocks
    pattern%halo = dofs%halo
    call elements_of_blocks(dofs, first, list)
    allocate (mark(dofs%blocks), pattern%start(dofs%blocks + 1))
    do pass = 1, 2
      mark = 0
      total = 0
      do n = 1, dofs%blocks
        if (pass == 2) pattern%start(n) = total + 1
        call take(n)
        do k = first(n), first(n + 1) - 1
          e = list(k)
          do a = dofs%start(e), dofs%start(e + 1) - 1
            call take(dofs%block(a))
          end do
          if (.not. allocated(dofs%wet)) cycle
          do a = dofs%wet_start(e), dofs%wet_start(e + 1) - 1
            call take(dofs%wet(a))
          end do
        end do
        if (pass == 2) call sort(pattern%column(pattern%start(n):total))
      end do
      if (pass == 1) allocate (pattern%column(total))
    end do
    pattern%start(dofs%blocks + 1) = total + 1

  contains

    subroutine take(other)
      integer(i4), intent(in) :: other
      if (other < n .or. mark(other) == n) return
      mark(other) = n
      total = total + 1
      if (pass == 2) pattern%column(total) = other
    end subroutine take
  end subroutine make_pattern

  !> CSR list of the elements at each block.
  subroutine elements_of_blocks(dofs, first, list)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), allocatable, intent(out) :: first(:), list(:)
    integer(i4), allocatable :: next(:)
    integer(i4) :: e, n, wet

    wet = 0
    if (allocated(dofs%wet)) wet = size(dofs%wet)
    allocate (first(dofs%blocks + 1), list(size(dofs%block) + wet))
    first = 0
    call count_blocks(dofs%block, first)
    if (allocated(dofs%wet)) call count_blocks(dofs%wet, first)
    first(1) = 1
    do n = 1, dofs%blocks
      first(n + 1) = first(n) + first(n + 1)
    end do
    next = first
    do e = 1, size(dofs%start) - 1
      call enter(dofs%block(dofs%start(e):dofs%start(e + 1) - 1), e, next, list)
      if (allocated(dofs%wet)) &
        call enter(dofs%wet(dofs%wet_start(e):dofs%wet_start(e + 1) - 1), e, next, list)
    end do
  end subroutine elements_of_blocks

  !> Count how often each block n is in a list, in count_of(n + 1).
  pure subroutine count_blocks(block, count_of)
    integer(i4), intent(in) :: block(:)
    integer(i4), intent(inout) :: count_of(:)
    integer(i4) :: a
    do a = 1, size(block)
      count_of(block(a) + 1) = count_of(block(a) + 1) + 1
    end do
  end subroutine count_blocks

  !> Enter element e at its blocks.
  pure subroutine enter(block, e, next, list)
    integer(i4), intent(in) :: block(:), e
    integer(i4), intent(inout) :: next(:), list(:)
    integer(i4) :: a
    do a = 1, size(block)
      list(next(block(a))) = e
      next(block(a)) = next(block(a)) + 1
    end do
  end subroutine enter

  !> Insertion sort; rows have about fourteen entries (hex8).
  pure subroutine sort(list)
    integer(i4), intent(inout) :: list(:)
    integer(i4) :: i, j, value
    do i = 2, size(list)
      value = list(i)
      do j = i - 1, 1, -1
        if (list(j) <= value) exit
        list(j + 1) = list(j)
      end do
      list(j + 1) = value
    end do
  end subroutine sort

  !> Position of the pair (i, j), i <= j, in the pattern; 0 if absent. Rows are short:
  !! counting the columns before j is a few vector operations without a branch.
  pure integer(i4) function place(pattern, i, j)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: i, j
    integer(i4) :: p

    place = pattern%start(i)
    do p = pattern%start(i), pattern%start(i + 1) - 1
      place = place + merge(1, 0, pattern%column(p) < j)
    end do
    if (place < pattern%start(i + 1)) then
      if (pattern%column(place) == j) return
    end if
    place = 0
  end function place

  !> The first rank that has an element with all nodes of each spring, -1 where none has.
  subroutine holders_of(pattern, springs, holder)
    type(fem_pattern_type), intent(in) :: pattern
    type(fem_springs_type), intent(in) :: springs
    integer(i4), intent(out) :: holder(:)  !! (springs)
    integer(i4) :: s
    do s = 1, springs%n
      holder(s) = merge(pattern%halo%rank, huge(s), share_element(pattern, springs%node(:, s)))
    end do
    call pattern%halo%least_numbers(holder)
    where (holder == huge(s)) holder = -1
  end subroutine holders_of

  !> Do these nodes exist, and does the pattern have a block for each pair of them?
  pure logical function share_element(pattern, node)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: node(:)
    integer(i4) :: a, b
    share_element = all(node >= 1 .and. node <= pattern%nodes)
    if (.not. share_element) return
    do b = 1, size(node)
      do a = 1, b - 1
        share_element = share_element .and. &
                        place(pattern, min(node(a), node(b)), max(node(a), node(b))) > 0
      end do
    end do
  end function share_element

  !> Add springs, sum over points of N' k N, to the stiffness; their nodes share an element. The
  !! matrices k are symmetric. Each spring belongs to one rank.
  subroutine add_springs(springs, pattern, k, lower)
    type(fem_springs_type), intent(in) :: springs
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(inout) :: k(:, :, :)
    real(wp), intent(inout), optional :: lower(:, :, :)  !! blocks below the diagonal, or none
    integer(i4) :: s, a, b, i, j, p
    do s = 1, springs%n
      if (allocated(springs%here)) then
        if (.not. springs%here(s)) cycle
      end if
      do b = 1, size(springs%node, 1)
        do a = 1, size(springs%node, 1)
          i = springs%node(a, s)
          j = springs%node(b, s)
          if (i > j) cycle
          p = place(pattern, i, j)
          k(:, :, p) = k(:, :, p) &
            + springs%weight(a, s)*springs%weight(b, s)*springs%stiffness(:, :, s)
          if (i == j .or. .not. present(lower)) cycle
          if (size(lower, 3) > 0) lower(:, :, p) = lower(:, :, p) &
            + springs%weight(a, s)*springs%weight(b, s)*springs%stiffness(:, :, s)
        end do
      end do
    end do
  end subroutine add_springs

  !> Forces of springs between an old and a new displacement, S (u_old - u) [N].
  pure subroutine spring_force(springs, old, u, force)
    type(fem_springs_type), intent(in) :: springs
    real(wp), intent(in) :: old(:, :), u(:, :)
    real(wp), intent(out) :: force(:, :)
    real(wp) :: stretch(3)
    integer(i4) :: s, a
    force = 0.0_wp
    do s = 1, springs%n
      stretch = 0.0_wp
      do a = 1, size(springs%node, 1)
        stretch = stretch &
          + springs%weight(a, s)*(old(:, springs%node(a, s)) - u(:, springs%node(a, s)))
      end do
      stretch = matmul(springs%stiffness(:, :, s), stretch)
      do a = 1, size(springs%node, 1)
        force(:, springs%node(a, s)) = force(:, springs%node(a, s)) + springs%weight(a, s)*stretch
      end do
    end do
  end subroutine spring_force

  !> y = K u for the symmetric blocks, of all ranks.
  subroutine multiply(pattern, k, u, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: k(:, :, :), u(:, :)
    real(wp), intent(out), contiguous :: y(:, :)
    call multiply_part(pattern, k, u, y)
    call pattern%halo%sum_up(y)
  end subroutine multiply

  !> The part of this rank. With shares each thread owns the rows of a range of nodes and
  !! adds to them alone, in the order of the rows: the same bits for any number of threads.
  subroutine multiply_part(pattern, k, u, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: k(:, :, :), u(:, :)
    real(wp), intent(out), contiguous :: y(:, :)
    integer(i4) :: t
    if (.not. allocated(pattern%share)) then
      y = 0.0_wp
      call inner_rows(pattern, k, u, 1, pattern%nodes, y)
      return
    end if
    !$omp parallel do default(none) shared(pattern, k, u, y) private(t) schedule(static, 1) &
    !$omp num_threads(size(pattern%share))
    do t = 1, size(pattern%share)
      call share_rows(pattern, pattern%share(t), k, u, y)
    end do
    !$omp end parallel do
  end subroutine multiply_part

  !> The rows of one share, and what rows of others have in its columns, in the order of the rows.
  pure subroutine share_rows(pattern, share, k, u, y)
    type(fem_pattern_type), intent(in) :: pattern
    type(fem_share_type), intent(in) :: share
    real(wp), intent(in), contiguous :: k(:, :, :), u(:, :)
    real(wp), intent(inout), contiguous :: y(:, :)
    integer(i4) :: s, i
    do s = 1, 2
      y(:, share%first(s):share%last(s)) = 0.0_wp
    end do
    do s = 1, size(share%rows, 2)
      select case (share%rows(3, s))
      case (rows_inner)
        call inner_rows(pattern, k, u, share%rows(1, s), share%rows(2, s), y)
      case default
        do i = share%rows(1, s), share%rows(2, s)
          call border_row(pattern, share, k, u, i, share%rows(3, s) == rows_border, y)
        end do
      end select
    end do
  end subroutine share_rows

  !> Rows first to last, all of whose columns are of this rank.
  pure subroutine inner_rows(pattern, k, u, first, last, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: k(:, :, :), u(:, :)
    integer(i4), intent(in) :: first, last
    real(wp), intent(inout), contiguous :: y(:, :)
    real(wp) :: u1, u2, u3, y1, y2, y3
    integer(i4) :: i, j, p
    do i = first, last
      u1 = u(1, i)
      u2 = u(2, i)
      u3 = u(3, i)
      p = pattern%start(i)
      call diagonal_block(k(:, :, p), u1, u2, u3, y1, y2, y3)
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        y1 = y1 + k(1, 1, p)*u(1, j) + k(1, 2, p)*u(2, j) + k(1, 3, p)*u(3, j)
        y2 = y2 + k(2, 1, p)*u(1, j) + k(2, 2, p)*u(2, j) + k(2, 3, p)*u(3, j)
        y3 = y3 + k(3, 1, p)*u(1, j) + k(3, 2, p)*u(2, j) + k(3, 3, p)*u(3, j)
        y(1, j) = y(1, j) + k(1, 1, p)*u1 + k(2, 1, p)*u2 + k(3, 1, p)*u3
        y(2, j) = y(2, j) + k(1, 2, p)*u1 + k(2, 2, p)*u2 + k(3, 2, p)*u3
        y(3, j) = y(3, j) + k(1, 3, p)*u1 + k(2, 3, p)*u2 + k(3, 3, p)*u3
      end do
      y(1, i) = y(1, i) + y1
      y(2, i) = y(2, i) + y2
      y(3, i) = y(3, i) + y3
    end do
  end subroutine inner_rows

  !> Products of which each sum has one: the loop does not decide whether they are fused.
  pure subroutine diagonal_block(k, u1, u2, u3, y1, y2, y3)
    real(wp), intent(in) :: k(3, 3), u1, u2, u3
    real(wp), intent(out) :: y1, y2, y3
    y1 = k(1, 1)*u1
    y2 = k(2, 1)*u1
    y3 = k(3, 1)*u1
    y1 = y1 + k(1, 2)*u2
    y2 = y2 + k(2, 2)*u2
    y3 = y3 + k(3, 2)*u2
    y1 = y1 + k(1, 3)*u3
    y2 = y2 + k(2, 3)*u3
    y3 = y3 + k(3, 3)*u3
  end subroutine diagonal_block

  !> Row i, which has columns of other shares; `own`: the row itself belongs to this one.
  pure subroutine border_row(pattern, share, k, u, i, own, y)
    type(fem_pattern_type), intent(in) :: pattern
    type(fem_share_type), intent(in) :: share
    real(wp), intent(in), contiguous :: k(:, :, :), u(:, :)
    integer(i4), intent(in) :: i
    logical, intent(in) :: own
    real(wp), intent(inout), contiguous :: y(:, :)
    real(wp) :: u1, u2, u3, y1, y2, y3
    integer(i4) :: j, p
    u1 = u(1, i)
    u2 = u(2, i)
    u3 = u(3, i)
    p = pattern%start(i)
    call diagonal_block(k(:, :, p), u1, u2, u3, y1, y2, y3)
    do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
      j = pattern%column(p)
      if (own) then
        y1 = y1 + k(1, 1, p)*u(1, j) + k(1, 2, p)*u(2, j) + k(1, 3, p)*u(3, j)
        y2 = y2 + k(2, 1, p)*u(1, j) + k(2, 2, p)*u(2, j) + k(2, 3, p)*u(3, j)
        y3 = y3 + k(3, 1, p)*u(1, j) + k(3, 2, p)*u(2, j) + k(3, 3, p)*u(3, j)
      end if
      if (.not. has_block(share, j)) cycle
      y(1, j) = y(1, j) + k(1, 1, p)*u1 + k(2, 1, p)*u2 + k(3, 1, p)*u3
      y(2, j) = y(2, j) + k(1, 2, p)*u1 + k(2, 2, p)*u2 + k(3, 2, p)*u3
      y(3, j) = y(3, j) + k(1, 3, p)*u1 + k(2, 3, p)*u2 + k(3, 3, p)*u3
    end do
    if (.not. own) return
    y(1, i) = y(1, i) + y1
    y(2, i) = y(2, i) + y2
    y(3, i) = y(3, i) + y3
  end subroutine border_row

  !> Is block j one of a share?
  elemental logical function has_block(share, j)
    type(fem_share_type), intent(in) :: share
    integer(i4), intent(in) :: j
    has_block = (j >= share%first(1) .and. j <= share%last(1)) &
                .or. (j >= share%first(2) .and. j <= share%last(2))
  end function has_block

  !> y = K u where the blocks below the diagonal are given too.
  subroutine multiply_general(pattern, k, lower, u, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), lower(:, :, :), u(:, :)
    real(wp), intent(out) :: y(:, :)
    integer(i4) :: i, j, p
    y = 0.0_wp
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        j = pattern%column(p)
        y(:, i) = y(:, i) + matmul(k(:, :, p), u(:, j))
        if (j == i) cycle
        if (size(lower, 3) == 0) then
          y(:, j) = y(:, j) + matmul(transpose(k(:, :, p)), u(:, i))
        else
          y(:, j) = y(:, j) + matmul(lower(:, :, p), u(:, i))
        end if
      end do
    end do
    call pattern%halo%sum_up(y)
  end subroutine multiply_general

  !> y = M a for the scalar mass blocks.
  subroutine multiply_mass(pattern, mass, a, y)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: mass(:), a(:, :)
    real(wp), intent(out) :: y(:, :)
    integer(i4) :: i, j, p
    y = 0.0_wp
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        j = pattern%column(p)
        y(:, i) = y(:, i) + mass(p)*a(:, j)
        if (j /= i) y(:, j) = y(:, j) + mass(p)*a(:, i)
      end do
    end do
    call pattern%halo%sum_up(y)
  end subroutine multiply_mass

  !> Mass between blocks i and j times sqrt(f_i f_j): factors at the blocks that leave it positive.
  pure subroutine scale_mass(pattern, factor, mass)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: factor(:)    !! (blocks) [-]
    real(wp), intent(inout) :: mass(:)
    integer(i4) :: i, p
    if (all(abs(factor - 1.0_wp) <= 0.0_wp)) return
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        mass(p) = sqrt(factor(i)*factor(pattern%column(p)))*mass(p)
      end do
    end do
  end subroutine scale_mass

  !> Largest size of an entry; of a matrix that ranks share, which is symmetric and positive, it
  !! is in the diagonal.
  real(wp) function largest_entry(pattern, k)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)
    real(wp), allocatable :: diagonal(:, :)
    integer(i4) :: i, c
    if (.not. pattern%halo%several()) then
      largest_entry = maxval(abs(k))
      return
    end if
    allocate (diagonal(3, pattern%nodes))
    do i = 1, pattern%nodes
      diagonal(:, i) = [(k(c, c, pattern%start(i)), c=1, 3)]
    end do
    call pattern%halo%sum_up(diagonal)
    largest_entry = maxval(abs(diagonal))
    call pattern%halo%highest(largest_entry)
  end function largest_entry

  !> Mean of the diagonal of each node's own block, of all ranks [N/m].
  function block_diagonal(pattern, k) result(diagonal)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)
    real(wp) :: diagonal(pattern%nodes), mean(1, pattern%nodes)
    integer(i4) :: i, p
    do i = 1, pattern%nodes
      p = pattern%start(i)
      mean(1, i) = (k(1, 1, p) + k(2, 2, p) + k(3, 3, p))/3.0_wp
    end do
    call pattern%halo%sum_up(mean)
    diagonal = mean(1, :)
  end function block_diagonal

  !> Consistent mass of each block with itself, of all ranks [kg, kg m^2].
  function mass_diagonal(pattern, mass) result(diagonal)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: mass(:)
    real(wp) :: diagonal(pattern%nodes), own(1, pattern%nodes)
    own(1, :) = mass(pattern%start(:pattern%nodes))
    call pattern%halo%sum_up(own)
    diagonal = own(1, :)
  end function mass_diagonal
end module fem_sparse
