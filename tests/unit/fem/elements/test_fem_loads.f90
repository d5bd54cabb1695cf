!> Tractions, pressures, couples, springs and point positions on facets of every kind.
program test_fem_loads
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_facets, only: facet_point, locate_on_facet
  use fem_kinds, only: solid_kinds, most_facet_nodes, kind_name, node_count, corner_count, &
    face_count, face_kind, face_nodes, reference_nodes, quad4, quad8, quad9, tri3, tri6, hex20, &
    hex27, tet10, is_quadratic
  use fem_loads, only: traction_force, pressure_force, couple_force, facet_springs
  use fem_quadrature, only: fem_rule_type, tabulate, mass_degree
  use fem_topology, only: set_elements
  use fem_types, only: fem_mesh_type, fem_springs_type, group_facet
  implicit none
  type(test_type) :: test
  integer(i4) :: kind

  do kind = 1, solid_kinds
    call check_surface(kind)
    call check_slopes(kind)
  end do
  call check_shares()
  call check_locate()
  call check_couples()
  call test%finish()

contains

  !> One element with all its faces as a group; corners moved, edges straight.
  subroutine make_element(kind, mesh)
    integer(i4), intent(in) :: kind
    type(fem_mesh_type), intent(out) :: mesh
    integer(i4) :: a, f
    real(wp) :: p(3), node(3, node_count(kind))

    node = reference_nodes(kind)
    allocate (mesh%x(3, node_count(kind)))
    do a = 1, node_count(kind)
      p = node(:, a)  ! an affine map keeps all edges straight
      mesh%x(:, a) = [1.0_wp + 0.9_wp*p(1) + 0.2_wp*p(2), 0.7_wp*p(2) - 0.1_wp*p(3) + 0.3_wp*p(1), &
                      1.1_wp*p(3) + 0.15_wp*p(1) - 2.0_wp]
    end do
    call set_elements(mesh, kind, reshape([(a, a=1, node_count(kind))], [node_count(kind), 1]))
    allocate (mesh%group(1))
    mesh%group(1)%kind = group_facet
    allocate (mesh%group(1)%facet(most_facet_nodes, face_count(kind)), source=0)
    allocate (mesh%group(1)%facet_kind(face_count(kind)))
    do f = 1, face_count(kind)
      mesh%group(1)%facet_kind(f) = face_kind(kind, f)
      mesh%group(1)%facet(:node_count(face_kind(kind, f)), f) = face_nodes(kind, f)
    end do
  end subroutine make_element

  real(wp) function volume(mesh)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_rule_type) :: rule
    real(wp) :: t(3, 3)
    integer(i4) :: q
    call tabulate(mesh%kind(1), mass_degree(mesh%kind(1)), rule)
    volume = 0.0_wp
    do q = 1, rule%points
      t = matmul(mesh%x, transpose(rule%dn(:, :, q)))
      volume = volume + rule%weight(q)*(t(1, 1)*(t(2, 2)*t(3, 3) - t(3, 2)*t(2, 3)) &
        + t(2, 1)*(t(3, 2)*t(1, 3) - t(1, 2)*t(3, 3)) + t(3, 1)*(t(1, 2)*t(2, 3) - t(2, 2)*t(1, 3)))
    end do
  end function volume

  !> Pressure all round has no resultant, and its work on u = x is -3 p V; a traction's resultant is
  !! the area's, its moment that at the centroids.
  subroutine check_surface(kind)
    integer(i4), intent(in) :: kind
    type(fem_mesh_type) :: mesh
    type(fem_springs_type) :: springs
    real(wp), allocatable :: force(:, :), moment(:, :)
    real(wp), parameter :: none(3, 3) = 0.0_wp
    real(wp) :: area, n(most_facet_nodes), normal(3), moved(3)
    integer(i4) :: f, m, s

    call make_element(kind, mesh)
    allocate (force(3, mesh%nodes), source=0.0_wp)
    call pressure_force(mesh, mesh%group(1), 2.5_wp, [0.0_wp, 0.0_wp, 0.0_wp], force)
    call test%check(kind_name(kind)//': pressure has no resultant', &
                    max_abs(sum(force, dim=2)) < 1.0e-13_wp)
    call test%check_close(kind_name(kind)//': work of pressure', sum(force*mesh%x), &
                          -7.5_wp*volume(mesh), 1.0e-13_wp*abs(volume(mesh))*100.0_wp)
    moment = force(:, :)
    moment(1, :) = mesh%x(2, :)*force(3, :) - mesh%x(3, :)*force(2, :)
    call test%check_close(kind_name(kind)//': moment of pressure', sum(moment(1, :)), 0.0_wp, &
                          1.0e-12_wp)
    area = 0.0_wp
    do f = 1, face_count(kind)  ! flat faces: parallelograms or triangles
      m = corner_count(face_kind(kind, f))
      call facet_point(face_kind(kind, f), mesh%x(:, face_nodes(kind, f)), [0.3_wp, 0.3_wp], &
                       n(:node_count(face_kind(kind, f))), normal)
      area = area + merge(4.0_wp, 0.5_wp, m == 4)*norm2(normal)
    end do
    force = 0.0_wp
    call traction_force(mesh, mesh%group(1), [3.0_wp, -1.0_wp, 2.0_wp], none, force)
    call test%check(kind_name(kind)//': resultant of a traction', &
                    max_abs(sum(force, dim=2) - area*[3.0_wp, -1.0_wp, 2.0_wp]) < 1.0e-12_wp)
    call facet_springs(mesh, mesh%group(1), 5.0_wp, 5.0_wp, springs)
    normal = 0.0_wp
    do s = 1, springs%n
      moved = sum(springs%weight(:, s))*[1.0_wp, 2.0_wp, 3.0_wp]
      normal = normal + matmul(springs%stiffness(:, :, s), moved)
    end do
    call test%check(kind_name(kind)//': resultant of springs', &
                    max_abs(normal - 5.0_wp*area*[1.0_wp, 2.0_wp, 3.0_wp]) < 1.0e-11_wp)
  end subroutine check_surface

  !> Gauss: the resultant of a pressure of slope g on a closed surface is -g V. On a flat face the
  !! traction -(p + g x) n gives the same forces.
  subroutine check_slopes(kind)
    integer(i4), intent(in) :: kind
    type(fem_mesh_type) :: mesh
    real(wp), parameter :: g(3) = [0.4_wp, -1.3_wp, 0.9_wp]
    real(wp), allocatable :: force(:, :), other(:, :)
    real(wp) :: n(most_facet_nodes), normal(3), weight
    integer(i4) :: j

    call make_element(kind, mesh)
    allocate (force(3, mesh%nodes), other(3, mesh%nodes), source=0.0_wp)
    call pressure_force(mesh, mesh%group(1), -3.0_wp, g, force)
    weight = volume(mesh)
    do j = 1, 3
      call test%check_close(kind_name(kind)//': resultant of a sloping pressure', &
                            sum(force(j, :)), -g(j)*weight, 1.0e-12_wp*weight)
    end do
    mesh%group(1)%facet = mesh%group(1)%facet(:, 1:1)
    mesh%group(1)%facet_kind = mesh%group(1)%facet_kind(1:1)
    associate (face => mesh%group(1)%facet_kind(1))
      call facet_point(face, mesh%x(:, face_nodes(kind, 1)), [0.3_wp, 0.3_wp], &
                       n(:node_count(face)), normal)
    end associate
    normal = normal/norm2(normal)
    force = 0.0_wp
    call pressure_force(mesh, mesh%group(1), -3.0_wp, g, force)
    call traction_force(mesh, mesh%group(1), 3.0_wp*normal, &
                        -spread(normal, 2, 3)*spread(g, 1, 3), other)
    call test%check(kind_name(kind)//': traction of a sloping pressure', &
                    max_abs(force - other) < 1.0e-12_wp .and. max_abs(force) > 0.1_wp)
  end subroutine check_slopes

  !> Known shares of a uniform pressure on flat facets: quad8 -1/12 and 1/3, quad9 1/36, 1/9 and
  !! 4/9, tri6 0 and 1/3 of the whole.
  subroutine check_shares()
    call share_of(hex20, 1.0_wp, [-1.0_wp/12.0_wp, 1.0_wp/3.0_wp, 0.0_wp], 'quad8')
    call share_of(hex27, 1.0_wp, [1.0_wp/36.0_wp, 1.0_wp/9.0_wp, 4.0_wp/9.0_wp], 'quad9')
    call share_of(tet10, 1.0_wp, [0.0_wp, 1.0_wp/3.0_wp, 0.0_wp], 'tri6')
  end subroutine check_shares

  subroutine share_of(kind, pressure, expected, name)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: pressure, expected(3)
    character(len=*), intent(in) :: name
    type(fem_mesh_type) :: mesh
    real(wp) :: force(3, node_count(kind)), area
    integer(i4) :: c, m
    call make_element(kind, mesh)
    mesh%group(1)%facet = mesh%group(1)%facet(:, 1:1)
    mesh%group(1)%facet_kind = mesh%group(1)%facet_kind(1:1)
    force = 0.0_wp
    call pressure_force(mesh, mesh%group(1), pressure, [0.0_wp, 0.0_wp, 0.0_wp], force)
    area = norm2(sum(force, dim=2))
    associate (node => mesh%group(1)%facet(:, 1))
      c = corner_count(mesh%group(1)%facet_kind(1))
      m = node_count(mesh%group(1)%facet_kind(1))
      call test%check_close(name//': corner', dot_product(force(:, node(1)), sum(force, dim=2)) &
                            /area**2, expected(1), 1.0e-13_wp)
      call test%check_close(name//': edge', dot_product(force(:, node(c + 1)), sum(force, dim=2)) &
                            /area**2, expected(2), 1.0e-13_wp)
      if (m > 2*c) call test%check_close(name//': middle', &
        dot_product(force(:, node(m)), sum(force, dim=2))/area**2, expected(3), 1.0e-13_wp)
    end associate
  end subroutine share_of

  !> Natural coordinates of points on curved facets are recovered; a point off it is reported.
  subroutine check_locate()
    integer(i4), parameter :: facets(5) = [quad4, quad8, quad9, tri3, tri6]
    real(wp) :: x(3, most_facet_nodes), n(most_facet_nodes), area(3), xi(2), off
    real(wp) :: node(2, most_facet_nodes)
    integer(i4) :: k, m, a
    do k = 1, size(facets)
      m = node_count(facets(k))
      node(:, :m) = reference_nodes(facets(k))
      do a = 1, m
        x(:, a) = [node(1, a) + 0.1_wp*node(2, a), 0.8_wp*node(2, a), 0.0_wp]
        if (is_quadratic(facets(k))) x(3, a) = 0.2_wp*node(1, a)**2 - 0.1_wp*node(1, a)*node(2, a)
      end do
      call facet_point(facets(k), x(:, :m), [0.35_wp, 0.2_wp], n(:m), area)
      call locate_on_facet(facets(k), x(:, :m), matmul(x(:, :m), n(:m)), xi, off)
      call test%check(kind_name(facets(k))//': located', &
                      max_abs(xi - [0.35_wp, 0.2_wp]) < 1.0e-12_wp .and. off < 1.0e-12_wp)
      call locate_on_facet(facets(k), x(:, :m), [9.0_wp, 0.0_wp, 0.0_wp], xi, off)
      call test%check(kind_name(facets(k))//': off the facet', off > 1.0_wp)
    end do
  end subroutine check_locate

  !> Couples act on the corners of mixed orders, to all nodes of equal ones; nodes without
  !! micro-rotation are named.
  subroutine check_couples()
    type(fem_mesh_type) :: mesh
    real(wp) :: force(3, 28)
    integer(i4) :: phi(20), missing, a
    call make_element(hex20, mesh)
    phi = 0
    phi(:8) = [(20 + a, a=1, 8)]
    force = 0.0_wp
    call couple_force(mesh, mesh%group(1), phi, [0.0_wp, 0.0_wp, 2.0_wp], force, missing)
    call test%check('couples at corners', missing == 0 .and. all(force(3, 21:) > 0.0_wp) &
                    .and. all(abs(force(:, :20)) <= 0.0_wp))
    phi(3) = 0
    call couple_force(mesh, mesh%group(1), phi, [0.0_wp, 0.0_wp, 2.0_wp], force, missing)
    call test%check('node without rotation named', missing == 3)
    phi = [(a, a=1, 20)]
    force = 0.0_wp
    call couple_force(mesh, mesh%group(1), phi, [0.0_wp, 0.0_wp, 2.0_wp], force, missing)
    call test%check('couples at all nodes', missing == 0 .and. all(abs(force(3, :20)) > 0.0_wp))
  end subroutine check_couples
end program test_fem_loads
