!> Pressures that follow the surface: along the normals, and over the areas, of the deformed facets.
module fem_follower
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use fem_facets, only: facet_point
  use fem_quadrature, only: quadrature_rule, full_degree
  use fem_shape, only: shape_functions, node_count, most_facet_nodes
  use fem_sparse, only: fem_pattern_type, place
  use fem_topology, only: facet_total
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_follower_type, follower_force, add_follower_stiffness

  type :: fem_follower_type
    integer(i4) :: group = 0          !! facets
    integer(i4) :: curve = 0          !! 0 means constant
    real(wp) :: pressure = 0.0_wp     !! into the solid, at the origin of x [Pa]
    real(wp) :: slope(3) = 0.0_wp     !! along x, where the surface is now [Pa/m]
    logical, allocatable :: here(:)   !! (facets) in this rank's matrix? Not given: all are
  end type fem_follower_type

contains

  !> Add the nodal forces of a pressure on the facets where they are now: -int p N n da [N].
  subroutine follower_force(mesh, follower, share, u, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_follower_type), intent(in) :: follower
    real(wp), intent(in) :: share        !! of the pressure that acts now [-]
    real(wp), intent(in) :: u(:, :)      !! (3, blocks) [m]
    real(wp), intent(inout) :: force(:, :)
    integer(i4) :: f
    associate (group => mesh%group(follower%group))
      do f = 1, facet_total(group)
        associate (node => group%facet(:node_count(group%facet_kind(f)), f))
          call facet_force(group%facet_kind(f), node, mesh%x(:, node) + u(:, node), &
                           share*follower%pressure, share*follower%slope, force)
        end associate
      end do
    end associate
  end subroutine follower_force

  !> Add the forces of one facet with its nodes at x [m].
  subroutine facet_force(kind, node, x, pressure, gradient, force)
    integer(i4), intent(in) :: kind, node(:)
    real(wp), intent(in) :: x(:, :), pressure, gradient(3)
    real(wp), intent(inout) :: force(:, :)
    real(wp) :: n(size(node)), area(3), here
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: q, a
    call quadrature_rule(kind, full_degree(kind), points, weights)
    do q = 1, size(weights)
      call facet_point(kind, x, points(:, q), n, area)
      here = pressure + dot_product(gradient, matmul(x, n))
      do a = 1, size(node)
        force(:, node(a)) = force(:, node(a)) - weights(q)*here*n(a)*area
      end do
    end do
  end subroutine facet_force

  !> Add minus the slopes of these forces to a general matrix: blocks
  !! w N_a (p (N_b,eta [x,xi]x - N_b,xi [x,eta]x) + N_b n da (grad p)'), `lower` below the diagonal.
  subroutine add_follower_stiffness(mesh, follower, share, u, pattern, k, lower)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_follower_type), intent(in) :: follower
    real(wp), intent(in) :: share, u(:, :)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    integer(i4) :: f
    associate (group => mesh%group(follower%group))
      do f = 1, facet_total(group)
        if (allocated(follower%here)) then
          if (.not. follower%here(f)) cycle
        end if
        associate (node => group%facet(:node_count(group%facet_kind(f)), f))
          call facet_stiffness(group%facet_kind(f), node, mesh%x(:, node) + u(:, node), &
                               share*[follower%pressure, follower%slope], pattern, k, lower)
        end associate
      end do
    end associate
  end subroutine add_follower_stiffness

  !> Add the slopes of one facet with its nodes at x [m].
  subroutine facet_stiffness(kind, node, x, pressure, pattern, k, lower)
    integer(i4), intent(in) :: kind, node(:)
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: pressure(4)  !! at the origin [Pa], and along x [Pa/m]
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    real(wp) :: n(size(node)), slope(2, size(node)), along(3, 2), block(3, 3), here
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: q, a, b, p
    call quadrature_rule(kind, full_degree(kind), points, weights)
    do q = 1, size(weights)
      call shape_functions(kind, points(:, q), n, slope)
      along = matmul(x, transpose(slope))
      here = pressure(1) + dot_product(pressure(2:), matmul(x, n))
      do b = 1, size(node)
        block = weights(q)*(here*(slope(2, b)*cross_matrix(along(:, 1)) &
                                  - slope(1, b)*cross_matrix(along(:, 2))) &
                            + n(b)*outer(cross(along(:, 1), along(:, 2)), pressure(2:)))
        do a = 1, size(node)
          p = place(pattern, min(node(a), node(b)), max(node(a), node(b)))
          if (node(a) <= node(b)) k(:, :, p) = k(:, :, p) + n(a)*block
          if (node(a) > node(b)) lower(:, :, p) = lower(:, :, p) + n(a)*block
        end do
      end do
    end do
  end subroutine facet_stiffness

  pure function outer(a, b) result(m)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: m(3, 3)
    m = spread(a, 2, 3)*spread(b, 1, 3)
  end function outer

  !> The matrix of a x.
  pure function cross_matrix(a) result(m)
    real(wp), intent(in) :: a(3)
    real(wp) :: m(3, 3)
    m(:, 1) = [0.0_wp, a(3), -a(2)]
    m(:, 2) = [-a(3), 0.0_wp, a(1)]
    m(:, 3) = [a(2), -a(1), 0.0_wp]
  end function cross_matrix
end module fem_follower
