!> Is the body supported? Rigid motions of every connected part that supports leave free are named.
module fem_supports
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dsyev
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use fem_types, only: fem_mesh_type, fem_springs_type
  use fem_dofs, only: fem_dofs_type
  use fem_halo, only: fem_halo_type
  use fem_sparse, only: fem_pattern_type
  implicit none
  private
  public :: check_supports

  real(wp), parameter :: negligible = 1.0e-10_wp  !! eigenvalue / largest that counts as free

contains

  !> Fault I307 for every part that can still move as a rigid body.
  subroutine check_supports(mesh, dofs, pattern, fixed, springs, errors)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: fixed(:, :)             !! (3, blocks)
    type(fem_springs_type), intent(in) :: springs
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: part(:), first(:)
    real(wp), allocatable :: gram(:, :, :), centre(:, :), nodes(:), sums(:)
    integer(i4) :: p

    if (pattern%halo%dealt) then
      call parts_of_pieces(mesh, pattern, part, first)
    else
      call connected_parts(pattern, part, first)
    end if
    call part_centres(mesh, pattern%halo, part, size(first), centre, nodes)
    call hold(mesh, dofs, part, fixed, springs, centre, gram)
    sums = reshape(gram, [size(gram)])
    call pattern%halo%total(sums)
    gram = reshape(sums, shape(gram))
    do p = 1, size(first)
      call judge([first(p), nint(nodes(p), i4), mesh%total_nodes()], gram(:, :, p), errors)
    end do
  end subroutine check_supports

  !> Part number of each block, and the first block of each part.
  subroutine connected_parts(pattern, part, first)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), allocatable, intent(out) :: part(:), first(:)
    integer(i4), allocatable :: root(:)
    integer(i4) :: i, parts

    call connect(pattern, root)
    call join_over_ranks(pattern, root)
    allocate (part(pattern%nodes))
    first = pack([(i, i=1, pattern%nodes)], root == [(i, i=1, pattern%nodes)])
    parts = 0
    do i = 1, pattern%nodes
      if (root(i) == i) then
        parts = parts + 1
        part(i) = parts
      else
        part(i) = part(top(root, i))
      end if
    end do
  end subroutine connected_parts

  !> The same of nodes that are dealt out; the first nodes by their ids in the whole mesh.
  subroutine parts_of_pieces(mesh, pattern, part, first)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), allocatable, intent(out) :: part(:), first(:)
    integer(i4), allocatable :: root(:), label(:), shared(:)
    integer(i4) :: i, least
    logical :: again

    call connect(pattern, root)
    do i = 1, size(root)
      root(i) = top(root, i)
    end do
    label = mesh%number_of(root)  ! the least id of those that are connected here
    again = .true.
    do while (again)
      shared = label
      call pattern%halo%least_shared(shared)
      again = any(shared /= label)
      do i = 1, size(root)
        label(root(i)) = min(label(root(i)), shared(i))
      end do
      label = label(root)
      call pattern%halo%any_of(again)
    end do
    allocate (first(0), part(size(label)))
    least = 0
    do
      least = minval(label, mask=label > least)  ! the largest of all where there is none
      call pattern%halo%least_number(least)
      if (least == huge(least)) exit
      first = [first, least]
      where (label == least) part = int(size(first), i4)
    end do
  end subroutine parts_of_pieces

  !> The block that each is connected to by elements of this rank, which may be itself.
  pure subroutine connect(pattern, root)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), allocatable, intent(out) :: root(:)
    integer(i4) :: i, p, a, b
    root = [(i, i=1, pattern%nodes)]
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        a = top(root, i)
        b = top(root, pattern%column(p))
        root(max(a, b)) = min(a, b)
      end do
    end do
  end subroutine connect

  !> Connect parts by the elements of other ranks; all ranks find the same.
  subroutine join_over_ranks(pattern, root)
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(inout) :: root(:)
    integer(i4), allocatable :: first(:)
    integer(i4) :: i, a, b
    logical :: again
    again = pattern%halo%several()
    do while (again)
      do i = 1, size(root)
        root(i) = top(root, i)
      end do
      first = root
      call pattern%halo%least_numbers(first)
      again = any(first /= root)
      do i = 1, size(root)
        a = top(root, i)
        b = top(root, first(i))
        root(max(a, b)) = min(a, b)
      end do
      call pattern%halo%any_of(again)
    end do
  end subroutine join_over_ranks

  pure integer(i4) function top(root, i)
    integer(i4), intent(in) :: root(:), i
    top = i
    do while (root(top) /= top)
      top = root(top)
    end do
  end function top

  !> Centres of the parts, and how many nodes each has.
  subroutine part_centres(mesh, halo, part, parts, centre, nodes)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_halo_type), intent(in) :: halo
    integer(i4), intent(in) :: part(:), parts
    real(wp), allocatable, intent(out) :: centre(:, :), nodes(:)
    integer(i4) :: i
    allocate (centre(3, parts), nodes(parts), source=0.0_wp)
    do i = 1, mesh%nodes
      if (.not. halo%counts(i)) cycle
      centre(:, part(i)) = centre(:, part(i)) + mesh%x(:, i)
      nodes(part(i)) = nodes(part(i)) + 1.0_wp
    end do
    call halo%total(nodes)
    do i = 1, 3
      call halo%total(centre(i, :))
      centre(i, :) = centre(i, :)/nodes
    end do
  end subroutine part_centres

  !> Sum of R'R over held degrees of freedom, R the six rigid motions (lengths scaled to the body);
  !! a micro-rotation follows the rotation of the body.
  subroutine hold(mesh, dofs, part, fixed, springs, centre, gram)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:)
    logical, intent(in) :: fixed(:, :)
    type(fem_springs_type), intent(in) :: springs
    real(wp), intent(in) :: centre(:, :)
    real(wp), allocatable, intent(out) :: gram(:, :, :)
    real(wp) :: motion(3, 6), length
    integer(i4) :: i, c, s, a

    allocate (gram(6, 6, size(centre, 2)))
    gram = 0.0_wp
    length = dofs%halo%extent(mesh%x)
    do i = 1, mesh%nodes
      if (.not. dofs%halo%counts(i)) cycle
      motion = rigid((mesh%x(:, i) - centre(:, part(i)))/length)
      do c = 1, 3
        if (fixed(c, i)) call add(gram(:, :, part(i)), motion(c, :))
      end do
    end do
    do i = mesh%nodes + 1, dofs%solid
      motion = turning(dofs, i)
      do c = 1, 3
        if (fixed(c, i)) call add(gram(:, :, part(i)), motion(c, :))
      end do
    end do
    do s = 1, springs%n
      if (any(springs%node(:, s) > mesh%nodes)) cycle  ! inner ties give way to rigid motions
      motion = 0.0_wp
      do a = 1, size(springs%node, 1)
        i = springs%node(a, s)
        motion = motion + springs%weight(a, s)*rigid((mesh%x(:, i) - centre(:, part(i)))/length)
      end do
      do c = 1, 3
        if (springs%stiffness(c, c, s) > 0.0_wp) call add(gram(:, :, part(i)), motion(c, :))
      end do
    end do
  end subroutine hold

  !> Second field of block i under unit rotations about x, y, z: the micro-rotation itself, or a
  !! column of the micro-deformation.
  pure function turning(dofs, i) result(motion)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: i
    real(wp) :: motion(3, 6), at(3, 6), unit(3)
    integer(i4) :: c
    motion = 0.0_wp
    if (dofs%parts == 1) then
      do c = 1, 3
        motion(c, 3 + c) = 1.0_wp
      end do
    else
      unit = 0.0_wp
      unit(1 + i - dofs%phi(dofs%node(i))) = 1.0_wp
      at = rigid(unit)
      motion(:, 4:) = at(:, 4:)
    end if
  end function turning

  pure subroutine add(gram, row)
    real(wp), intent(inout) :: gram(6, 6)
    real(wp), intent(in) :: row(6)
    integer(i4) :: k
    do k = 1, 6
      gram(:, k) = gram(:, k) + row*row(k)
    end do
  end subroutine add

  !> Displacement at r of unit translations along and unit rotations about x, y, z.
  pure function rigid(r) result(motion)
    real(wp), intent(in) :: r(3)
    real(wp) :: motion(3, 6)
    motion = 0.0_wp
    motion(1, 1) = 1.0_wp
    motion(2, 2) = 1.0_wp
    motion(3, 3) = 1.0_wp
    motion(:, 4) = [0.0_wp, -r(3), r(2)]
    motion(:, 5) = [r(3), 0.0_wp, -r(1)]
    motion(:, 6) = [-r(2), r(1), 0.0_wp]
  end function rigid

  !> Names of free motions: of the projection on what is free the axis with most of it, and so on
  !! with what is left.
  pure function free_motions(vectors) result(text)
    real(wp), intent(in) :: vectors(:, :)  !! (6, free) orthonormal
    character(len=:), allocatable :: text
    character(len=24), parameter :: names(6) = [character(len=24) :: 'translation along x', &
      'translation along y', 'translation along z', 'rotation about x', 'rotation about y', &
      'rotation about z']
    real(wp) :: left(6, 6)
    logical :: chosen(6)
    integer(i4) :: n, k
    left = matmul(vectors, transpose(vectors))
    chosen = .false.
    do n = 1, int(size(vectors, 2), i4)
      k = int(maxloc([(left(k, k), k=1, 6)], 1), i4)
      chosen(k) = .true.
      left = left - matmul(reshape(left(:, k), [6, 1]), reshape(left(k, :), [1, 6]))/left(k, k)
    end do
    text = ''
    do k = 1, 6
      if (.not. chosen(k)) cycle
      if (len(text) > 0) text = text//', '
      text = text//trim(names(k))
    end do
  end function free_motions

  !> Fault of a part that is not held.
  subroutine judge(part, gram, errors)
    integer(i4), intent(in) :: part(3)  !! its first node, its nodes, and those of the mesh
    real(wp), intent(in) :: gram(6, 6)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: vectors(6, 6), values(6), work(64)
    integer :: info
    integer(i4) :: free

    vectors = gram
    call dsyev('V', 'U', 6, vectors, 6, values, work, size(work), info)
    free = count(values <= negligible*max(1.0_wp, values(6)))
    if (info /= 0 .or. free == 0) return
    call errors%add('I307', 'the body is not held: '//str(free)//' of 6 rigid motions are '// &
                    'free: '//free_motions(vectors(:, :free)), &
                    'the part with node '//str(part(1))//' ('// &
                    str(part(2))//' of '//str(part(3))//' nodes)', &
                    'add a &support, or springs, that stop it')
  end subroutine judge
end module fem_supports
