!> Nodal forces of tractions, pressures and couples on facets of all kinds; springs.
module fem_loads
  use talus_kinds, only: wp, i4
  use fem_facets, only: facet_point
  use fem_quadrature, only: quadrature_rule, full_degree
  use fem_shape, only: shape_functions, node_count, corner_kind, most_facet_nodes
  use fem_topology, only: facet_nodes, facet_total
  use fem_types, only: fem_mesh_type, fem_group_type, &
    fem_springs_type
  implicit none
  private
  public :: traction_force, pressure_force, couple_force, facet_springs

contains

  !> Add the nodal forces (3, nodes and more) of a traction [Pa] on facets [N] that varies linearly:
  !! `traction` at the origin of x, `slope`(i, j) of component i along x_j [Pa/m].
  subroutine traction_force(mesh, group, traction, slope, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_group_type), intent(in) :: group
    real(wp), intent(in) :: traction(3), slope(3, 3)
    real(wp), intent(inout) :: force(:, :)
    real(wp) :: n(most_facet_nodes), area(3), here(3)
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: f, q, m
    do f = 1, facet_total(group)
      m = node_count(group%facet_kind(f))
      call quadrature_rule(group%facet_kind(f), full_degree(group%facet_kind(f)), points, weights)
      associate (node => group%facet(:m, f))
        do q = 1, size(weights)
          call facet_point(group%facet_kind(f), mesh%x(:, node), points(:, q), n(:m), area)
          here = traction + matmul(slope, matmul(mesh%x(:, node), n(:m)))
          call add_shares(node, n(:m), weights(q)*norm2(area)*here, force)
        end do
      end associate
    end do
  end subroutine traction_force

  !> Add the nodal forces of a pressure [Pa] on facets, positive into the solid [N], that varies
  !! linearly: `pressure` at the origin of x, `slope` along x [Pa/m]; that of a `liquid` is never
  !! negative.
  subroutine pressure_force(mesh, group, pressure, slope, force, liquid)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_group_type), intent(in) :: group
    real(wp), intent(in) :: pressure, slope(3)
    real(wp), intent(inout) :: force(:, :)
    logical, intent(in), optional :: liquid
    real(wp) :: n(most_facet_nodes), area(3), here
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: f, q, m
    do f = 1, facet_total(group)
      m = node_count(group%facet_kind(f))
      call quadrature_rule(group%facet_kind(f), full_degree(group%facet_kind(f)), points, weights)
      associate (node => group%facet(:m, f))
        do q = 1, size(weights)
          call facet_point(group%facet_kind(f), mesh%x(:, node), points(:, q), n(:m), area)
          here = pressure + dot_product(slope, matmul(mesh%x(:, node), n(:m)))
          if (present(liquid)) here = merge(max(0.0_wp, here), here, liquid)
          call add_shares(node, n(:m), -weights(q)*here*area, force)
        end do
      end associate
    end do
  end subroutine pressure_force

  !> Add the couples (3, blocks) of a couple per area [N/m] on facets to the micro-rotations
  !! [N m]: shared by the facet's own functions where all its nodes have one, by those of the
  !! corners in mixed orders. `missing` is the first node that has none, 0 if all have.
  subroutine couple_force(mesh, group, phi, couple, force, missing)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_group_type), intent(in) :: group
    integer(i4), intent(in) :: phi(:)    !! (nodes) block of the micro-rotation, 0 where none
    real(wp), intent(in) :: couple(3)
    real(wp), intent(inout) :: force(:, :)
    integer(i4), intent(out) :: missing
    real(wp) :: n(most_facet_nodes), area(3), slope(2, most_facet_nodes)
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4), allocatable :: node(:)
    integer(i4) :: f, q, kind

    missing = 0
    do f = 1, facet_total(group)
      kind = group%facet_kind(f)
      node = facet_nodes(group, f)
      call quadrature_rule(kind, full_degree(kind), points, weights)
      if (any(phi(node) == 0)) kind = corner_kind(kind)
      if (any(phi(node(:node_count(kind))) == 0)) then
        missing = node(findloc(phi(node(:node_count(kind))), 0, 1))
        return
      end if
      do q = 1, size(weights)
        call facet_point(group%facet_kind(f), mesh%x(:, node), points(:, q), n(:size(node)), area)
        call shape_functions(kind, points(:, q), n(:node_count(kind)), slope(:, :node_count(kind)))
        call add_shares(phi(node(:node_count(kind))), n(:node_count(kind)), &
                        weights(q)*norm2(area)*couple, force)
      end do
    end do
  end subroutine couple_force

  pure subroutine add_shares(block, n, value, force)
    integer(i4), intent(in) :: block(:)
    real(wp), intent(in) :: n(:), value(3)
    real(wp), intent(inout) :: force(:, :)
    integer(i4) :: a
    do a = 1, size(block)
      force(:, block(a)) = force(:, block(a)) + n(a)*value
    end do
  end subroutine add_shares

  !> Springs at the quadrature points of facets from stiffnesses per area [N/m^3]; appended.
  subroutine facet_springs(mesh, group, normal, tangential, springs)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_group_type), intent(in) :: group
    real(wp), intent(in) :: normal, tangential
    type(fem_springs_type), intent(inout) :: springs
    real(wp), allocatable :: points(:, :), weights(:)
    real(wp) :: area(3)
    integer(i4) :: f, q, s, m, kind

    s = springs%n
    call make_room(group, springs)
    do f = 1, facet_total(group)
      kind = group%facet_kind(f)
      m = node_count(kind)
      call quadrature_rule(kind, full_degree(kind), points, weights)
      do q = 1, size(weights)
        s = s + 1
        springs%node(:, s) = group%facet(1, f)  ! beyond the facet's nodes the weight is zero
        springs%weight(:, s) = 0.0_wp
        springs%node(:m, s) = group%facet(:m, f)
        call facet_point(kind, mesh%x(:, group%facet(:m, f)), points(:, q), &
                         springs%weight(:m, s), area)
        springs%stiffness(:, :, s) = spring_stiffness(normal, tangential, area, weights(q))
      end do
    end do
  end subroutine facet_springs

  !> Stiffness [N/m] of a point with a weight, from the stiffnesses per area along the normal and in
  !! the plane, and the area vector.
  pure function spring_stiffness(normal, tangential, area, weight) result(k)
    real(wp), intent(in) :: normal, tangential, area(3), weight
    real(wp) :: k(3, 3), unit(3), weighted(3)
    integer(i4) :: i, j
    unit = area/norm2(area)
    weighted = weight*area
    do j = 1, 3
      do i = 1, 3
        k(i, j) = norm2(weighted)*(normal - tangential)*unit(i)*unit(j)
      end do
      k(j, j) = k(j, j) + norm2(weighted)*tangential
    end do
  end function spring_stiffness

  !> Lengthen springs by those of a group; `n` counts them already.
  subroutine make_room(group, springs)
    type(fem_group_type), intent(in) :: group
    type(fem_springs_type), intent(inout) :: springs
    type(fem_springs_type) :: longer
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: f, m, n
    n = springs%n
    longer%n = n
    do f = 1, facet_total(group)
      call quadrature_rule(group%facet_kind(f), full_degree(group%facet_kind(f)), points, weights)
      longer%n = longer%n + size(weights)
    end do
    m = size(group%facet, 1)
    if (n > 0) m = max(m, size(springs%node, 1))
    allocate (longer%node(m, longer%n), source=1)
    allocate (longer%weight(m, longer%n), longer%stiffness(3, 3, longer%n), source=0.0_wp)
    do f = 1, n
      longer%node(:, f) = springs%node(1, f)
      longer%node(:size(springs%node, 1), f) = springs%node(:, f)
      longer%weight(:size(springs%node, 1), f) = springs%weight(:, f)
      longer%stiffness(:, :, f) = springs%stiffness(:, :, f)
    end do
    springs = longer
  end subroutine make_room
end module fem_loads
