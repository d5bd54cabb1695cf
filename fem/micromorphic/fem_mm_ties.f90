!> Facets on which the micro-deformation follows the deformation gradient: the energy
!! k/2 int |chi - F|^2 dA as springs between the blocks of the element behind each facet.
module fem_mm_ties
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_facets, only: facet_point
  use fem_kinds, only: face_count, face_kind, face_nodes, node_count, reference_nodes, &
    corner_kind, most_nodes
  use fem_mm_tensor, only: inverse
  use fem_quadrature, only: quadrature_rule, full_degree
  use fem_shape, only: shape_functions
  use fem_topology, only: element_nodes, facet_nodes, facet_total, same_set
  use fem_types, only: fem_mesh_type, fem_group_type, fem_springs_type
  implicit none
  private
  public :: tie_springs

contains

  !> Append the springs of a group with k [N/m] to those of the ground. `lost` is the first facet
  !! whose element is missing, 0 if none is.
  subroutine tie_springs(mesh, dofs, elastic, group, k, springs, lost)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_group_type), intent(in) :: group
    real(wp), intent(in) :: k
    type(fem_springs_type), intent(inout) :: springs
    integer(i4), intent(out) :: lost
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: f, q, e, face, more

    lost = 0
    more = 0
    do f = 1, facet_total(group)
      call quadrature_rule(group%facet_kind(f), full_degree(group%facet_kind(f)), points, weights)
      more = more + 3*size(weights)
    end do
    call make_room(more, 2*most_nodes, springs)
    do f = 1, facet_total(group)
      e = 0
      if (allocated(group%element)) e = group%element(f)
      face = 0
      if (e > 0) face = face_of(mesh, e, facet_nodes(group, f))
      if (face == 0) then
        lost = f
        return
      end if
      call quadrature_rule(group%facet_kind(f), full_degree(group%facet_kind(f)), points, weights)
      do q = 1, size(weights)
        call tie_point(mesh, dofs, elastic, e, face, points(:, q), k*weights(q), springs)
      end do
    end do
  end subroutine tie_springs

  !> Number of the face of element e with these nodes, 0 if there is none.
  pure integer(i4) function face_of(mesh, e, node) result(face)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: e, node(:)
    integer(i4) :: own(mesh%start(e + 1) - mesh%start(e)), k
    own = element_nodes(mesh, e)
    face = 0
    do k = 1, face_count(mesh%kind(e))
      if (node_count(face_kind(mesh%kind(e), k)) /= size(node)) cycle
      if (same_set(own(face_nodes(mesh%kind(e), k)), node)) face = k
    end do
  end function face_of

  !> Three springs, one for each column of chi - F, at a point of a face.
  subroutine tie_point(mesh, dofs, elastic, e, face, at, k, springs)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e, face
    real(wp), intent(in) :: at(2), k  !! natural coordinates on the face; k times their weight
    type(fem_springs_type), intent(inout) :: springs
    real(wp), allocatable :: xi(:, :), n(:), slope(:, :), micro(:), micro_slope(:, :), share(:)
    integer(i4), allocatable :: local(:)
    integer(i4) :: block(dofs%start(e + 1) - dofs%start(e)), c, i, m, r, a
    real(wp) :: here(3), jacobian(3, 3), area(3)

    associate (rule => elastic%rule(elastic%rule_of(e)), kind => mesh%kind(e))
      m = rule%nodes
      r = rule%rotations
      block = dofs%block(dofs%start(e):dofs%start(e + 1) - 1)
      allocate (local, source=face_nodes(kind, face))
      allocate (share(size(local)), n(m), slope(3, m), micro(r), micro_slope(3, r))
      call facet_point(face_kind(kind, face), mesh%x(:, block(local)), at, share, area)
      allocate (xi, source=reference_nodes(kind))
      here = matmul(xi(:, local), share)
      call shape_functions(kind, here, n, slope)
      call shape_functions(merge(kind, corner_kind(kind), r == m), here, micro, micro_slope)
      jacobian = matmul(slope, transpose(mesh%x(:, block(:m))))
      slope = matmul(inverse(jacobian), slope)
      do c = 1, 3
        springs%n = springs%n + 1
        i = springs%n
        springs%node(:, i) = block(1)
        springs%node(:m, i) = block(:m)
        springs%weight(:m, i) = -slope(c, :)
        springs%node(m + 1:m + r, i) = [(block(m + 3*(a - 1) + c), a=1, r)]
        springs%weight(m + 1:m + r, i) = micro
        do a = 1, 3
          springs%stiffness(a, a, i) = k*norm2(area)
        end do
      end do
    end associate
  end subroutine tie_point

  !> Lengthen springs by `more` of up to `most` blocks each, without weight and stiffness yet.
  pure subroutine make_room(more, most, springs)
    integer(i4), intent(in) :: more, most
    type(fem_springs_type), intent(inout) :: springs
    type(fem_springs_type) :: longer
    integer(i4) :: m, n, c
    n = springs%n
    m = most
    if (n > 0) m = max(m, int(size(springs%node, 1), i4))
    longer%n = n
    allocate (longer%node(m, n + more), source=1)
    allocate (longer%weight(m, n + more), longer%stiffness(3, 3, n + more), source=0.0_wp)
    do c = 1, n
      longer%node(:, c) = springs%node(1, c)
      longer%node(:size(springs%node, 1), c) = springs%node(:, c)
      longer%weight(:size(springs%node, 1), c) = springs%weight(:, c)
      longer%stiffness(:, :, c) = springs%stiffness(:, :, c)
    end do
    springs = longer
  end subroutine make_room
end module fem_mm_ties
