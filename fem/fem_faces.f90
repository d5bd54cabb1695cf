!> What acts on faces beyond tractions: couples, and absorbing dashpots (Lysmer and Kuhlemeyer 1969).
module fem_faces
  use talus_kinds, only: wp, i4
  use fem_damping, only: fem_damping_type
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: node_count, corner_kind, most_facet_nodes
  use fem_quadrature, only: quadrature_rule
  use fem_shape, only: shape_functions
  use fem_types, only: fem_mesh_type, fem_group_type
  implicit none
  private
  public :: couple_force, absorb, surface_points

  integer(i4), parameter :: degree = 4  !! three points a direction, six on triangles

contains

  !> Points of a facet with nodes x: shape functions of its kind and of the corners, normals, areas.
  pure subroutine surface_points(kind, x, n, corner, normal, area)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: x(:, :)                                !! (3, nodes) [m]
    real(wp), allocatable, intent(out) :: n(:, :), corner(:, :)    !! (nodes, points)
    real(wp), allocatable, intent(out) :: normal(:, :), area(:)    !! (3, points), [m^2]
    real(wp), allocatable :: xi(:, :), weight(:)
    real(wp) :: d(2, most_facet_nodes), t(3, 2), v(3)
    integer(i4) :: q, m, c

    call quadrature_rule(kind, degree, xi, weight)
    m = node_count(kind)
    c = node_count(corner_kind(kind))
    allocate (n(m, size(weight)), corner(c, size(weight)), normal(3, size(weight)))
    allocate (area(size(weight)))
    do q = 1, size(weight)
      call shape_functions(corner_kind(kind), xi(:, q), corner(:, q), d(:, :c))
      call shape_functions(kind, xi(:, q), n(:, q), d(:, :m))
      t = matmul(x, transpose(d(:, :m)))
      v = [t(2, 1)*t(3, 2) - t(3, 1)*t(2, 2), t(3, 1)*t(1, 2) - t(1, 1)*t(3, 2), &
           t(1, 1)*t(2, 2) - t(2, 1)*t(1, 2)]
      normal(:, q) = v/norm2(v)
      area(q) = norm2(v)*weight(q)
    end do
  end subroutine surface_points

  !> Add the forces (3, blocks) of a couple per area on the facets of a group, by the interpolation
  !! of the micro-rotation. `missing` is a node that has none, 0 if all have.
  subroutine couple_force(mesh, dofs, group, couple, force, missing)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_group_type), intent(in) :: group
    real(wp), intent(in) :: couple(3)  !! [N/m]
    real(wp), intent(inout) :: force(:, :)
    integer(i4), intent(out) :: missing
    real(wp), allocatable :: n(:, :), corner(:, :), normal(:, :), area(:)
    integer(i4) :: f, a, m, c

    missing = 0
    do f = 1, size(group%facet_kind)
      m = node_count(group%facet_kind(f))
      c = node_count(corner_kind(group%facet_kind(f)))
      associate (node => group%facet(:m, f))
        call surface_points(group%facet_kind(f), mesh%x(:, node), n, corner, normal, area)
        if (any(dofs%phi(node(:c)) == 0)) then
          missing = node(findloc(dofs%phi(node(:c)), 0, 1))
          return
        end if
        if (all(dofs%phi(node) > 0)) then
          do a = 1, m
            force(:, dofs%phi(node(a))) = force(:, dofs%phi(node(a))) + sum(n(a, :)*area)*couple
          end do
        else
          do a = 1, c
            force(:, dofs%phi(node(a))) = force(:, dofs%phi(node(a))) &
              + sum(corner(a, :)*area)*couple
          end do
        end if
      end associate
    end do
  end subroutine couple_force

  !> Dashpots rho c_p along the normal and rho c_s in the plane of the facets of a group; shares of
  !! the nodes are int N^2, scaled to the area, so that none is negative. `lost` is a facet whose
  !! element is not known, 0 if there is none.
  subroutine absorb(mesh, elastic, group, damping, lost)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_group_type), intent(in) :: group
    type(fem_damping_type), intent(inout) :: damping
    integer(i4), intent(out) :: lost
    real(wp), allocatable :: n(:, :), corner(:, :), normal(:, :), area(:), c(:, :, :)
    real(wp) :: press, shear, whole, share
    integer(i4) :: f, a, q, i, j, m, e

    lost = 0
    do f = 1, size(group%facet_kind)
      e = 0
      if (allocated(group%element)) e = group%element(f)
      if (e == 0) lost = f
      if (e == 0) return
      associate (k => elastic%moduli(:, e), rho => elastic%density(e))
        press = sqrt(rho*(k(1) + 2.0_wp*k(2) + k(3)))
        shear = sqrt(rho*(k(2) + 0.5_wp*k(3)))
      end associate
      m = node_count(group%facet_kind(f))
      call surface_points(group%facet_kind(f), mesh%x(:, group%facet(:m, f)), n, corner, normal, &
                          area)
      allocate (c(3, 3, m))
      c = 0.0_wp
      whole = 0.0_wp
      do q = 1, size(area)
        whole = whole + area(q)*sum(n(:, q)**2)
      end do
      do q = 1, size(area)
        do a = 1, m
          share = area(q)*n(a, q)**2*sum(area)/whole
          do j = 1, 3
            do i = 1, 3
              c(i, j, a) = c(i, j, a) + share*(press - shear)*normal(i, q)*normal(j, q)
            end do
            c(j, j, a) = c(j, j, a) + share*shear
          end do
        end do
      end do
      call damping%add_face(group%facet(:m, f), c)
      deallocate (c)
    end do
  end subroutine absorb
end module fem_faces
