!> Checks of a mesh: ids in range, elements right way round, facets that are faces of elements,
!! neighbours that share all nodes of their faces.
module fem_mesh_checks
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use fem_kinds, only: solid_kinds, most_nodes, kind_name, corner_count
  use fem_mesh_hanging, only: check_hanging
  use fem_quadrature, only: fem_rule_type, tabulate, mass_degree
  use fem_topology, only: element_nodes, facet_nodes, facet_total, fem_faces_type, list_faces, &
    find_face, nodes_of_face, twin_of, same_set
  use fem_types, only: fem_mesh_type, fem_group_type, group_facet, group_volume
  implicit none
  private
  public :: check_ids, check_mesh

  real(wp), parameter :: flat = 1.0e-14_wp  !! Jacobian over the cube of the size, of no volume

contains

  !> All checks that follow `check_ids`, each only if those before it found nothing; faults I302,
  !! I303, I305, I308, I310.
  subroutine check_mesh(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    type(fem_faces_type) :: faces

    call check_nodes(path, mesh, errors)
    call check_groups(path, mesh, errors)
    if (.not. errors%any()) call check_shape(path, mesh, errors)
    if (errors%any()) return
    call list_faces(mesh, faces)
    call check_facets(path, mesh, faces, errors)
    if (.not. errors%any()) call check_nesting(path, mesh, faces, errors)
    if (.not. errors%any()) call check_hanging(path, mesh, faces, errors)
  end subroutine check_mesh

  !> Fault I305 for the first coordinate that is NaN or infinite.
  subroutine check_nodes(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: n
    do n = 1, mesh%nodes
      if (all(is_finite(mesh%x(:, n)))) cycle
      call errors%add('I305', 'node '//str(n)//' has the coordinates '//str(mesh%x(:, n)), path)
      return
    end do
  end subroutine check_nodes

  !> Faults of groups: I305 where facets name wrong elements, I310 for an element twice.
  subroutine check_groups(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: g

    do g = 1, size(mesh%group)
      if (mesh%group(g)%kind == group_facet) &
        call check_cells(path, mesh%group(g), mesh%elements, errors)
      if (mesh%group(g)%kind == group_volume) &
        call check_once(path, mesh%group(g), mesh%elements, errors)
      if (errors%any()) return
    end do
  end subroutine check_groups

  !> Fault I310 for the first element that a group has twice.
  subroutine check_once(path, group, elements, errors)
    character(len=*), intent(in) :: path
    type(fem_group_type), intent(in) :: group
    integer(i4), intent(in) :: elements
    type(error_list_type), intent(inout) :: errors
    logical :: seen(elements)
    integer(i4) :: k
    seen = .false.
    do k = 1, size(group%element)
      if (seen(group%element(k))) then
        call member_twice(path, group, 'element '//str(group%element(k)), errors)
        return
      end if
      seen(group%element(k)) = .true.
    end do
  end subroutine check_once

  !> Fault I305 where the elements that a group's facets name are not one a facet, or do not exist.
  subroutine check_cells(path, group, elements, errors)
    character(len=*), intent(in) :: path
    type(fem_group_type), intent(in) :: group
    integer(i4), intent(in) :: elements
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: f
    if (.not. allocated(group%element)) return
    f = 0
    if (size(group%element) == facet_total(group)) &
      f = findloc(group%element < 1 .or. group%element > elements, .true., 1)
    if (f == 0 .and. size(group%element) == facet_total(group)) return
    if (f == 0) then
      call errors%add('I305', "group '"//trim(group%name)//"' has "//str(facet_total(group))// &
                      ' facets and names '//str(size(group%element, kind=i4))//' elements', path)
    else
      call errors%add('I305', 'facet '//str(f)//" of group '"//trim(group%name)// &
                      "' names element "//str(group%element(f))//' of '//str(elements), path)
    end if
  end subroutine check_cells

  subroutine member_twice(path, group, member, errors)
    character(len=*), intent(in) :: path, member
    type(fem_group_type), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    call errors%add('I310', "group '"//trim(group%name)//"' holds "//member//' twice', path, &
                    'loads there would count twice: give it once')
  end subroutine member_twice

  !> Fault I305 for ids out of range or twice in an element, I304 for nodes of no element.
  subroutine check_ids(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    logical, allocatable :: used(:)
    integer(i4) :: e, a, n

    allocate (used(mesh%nodes), source=.false.)
    do e = 1, mesh%elements
      do a = mesh%start(e), mesh%start(e + 1) - 1
        n = mesh%node(a)
        if (n < 1 .or. n > mesh%nodes) then
          call errors%add('I305', 'element '//str(e)//' names node '//str(n)//' of '// &
                          str(mesh%nodes), path)
          return
        end if
        if (any(mesh%node(mesh%start(e):a - 1) == n)) then
          call errors%add('I305', 'element '//str(e)//' names node '//str(n)//' twice', path)
          return
        end if
        used(n) = .true.
      end do
    end do
    if (all(used)) return
    call errors%add('I304', 'node '//str(int(findloc(used, .false., 1), i4))// &
                    ' belongs to no element ('//str(int(count(.not. used), i4))// &
                    ' such nodes)', path, 'drop such nodes: `talus mesh convert` does so')
  end subroutine check_ids

  !> Fault I302 for elements whose Jacobian is not positive at every quadrature point.
  subroutine check_shape(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    type(fem_rule_type) :: rule(solid_kinds)
    real(wp) :: least, worst
    integer(i4) :: e, k, bad, first

    do k = 1, solid_kinds
      if (any(mesh%kind == k)) call tabulate(k, mass_degree(k), rule(k))
    end do
    bad = 0
    first = 0
    worst = 0.0_wp
    do e = 1, mesh%elements
      call least_jacobian(mesh, rule(mesh%kind(e)), e, least)
      if (least > 0.0_wp) cycle
      bad = bad + 1
      if (first == 0) then
        first = e
        worst = least
      end if
    end do
    if (bad == 0) return
    call errors%add('I302', str(bad)//' elements are inside out or flat, the first is element '// &
                    str(first)//' ('//kind_name(mesh%kind(first))//', least Jacobian '// &
                    str(worst)//' m3)', path, &
                    'nodes must follow the VTK order (manual, Files); move middle nodes inward '// &
                    'where edges are curved')
  end subroutine check_shape

  !> Least Jacobian determinant at the quadrature points [m^3]; 0 if it is but rounding.
  subroutine least_jacobian(mesh, rule, e, least)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_rule_type), intent(in) :: rule
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: least
    real(wp) :: x(3, most_nodes), t(3, 3), size3
    integer(i4) :: n, q, a
    n = rule%nodes
    x(:, :n) = mesh%x(:, mesh%node(mesh%start(e):mesh%start(e) + n - 1))
    least = huge(1.0_wp)
    do q = 1, rule%points
      t = 0.0_wp
      do a = 1, n
        t(:, 1) = t(:, 1) + rule%dn(1, a, q)*x(:, a)
        t(:, 2) = t(:, 2) + rule%dn(2, a, q)*x(:, a)
        t(:, 3) = t(:, 3) + rule%dn(3, a, q)*x(:, a)
      end do
      least = min(least, t(1, 1)*(t(2, 2)*t(3, 3) - t(3, 2)*t(2, 3)) &
                  + t(2, 1)*(t(3, 2)*t(1, 3) - t(1, 2)*t(3, 3)) &
                  + t(3, 1)*(t(1, 2)*t(2, 3) - t(2, 2)*t(1, 3)))
    end do
    size3 = maxval(maxval(x(:, :n), dim=2) - minval(x(:, :n), dim=2))**3
    if (abs(least) <= flat*size3) least = 0.0_wp
  end subroutine least_jacobian

  !> Fault I305 for the first facet of a group that is no face of an element, I310 for one that the
  !! group has twice.
  subroutine check_facets(path, mesh, faces, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: last(:)  !! group in which each face was met last
    integer(i4) :: g, f, face

    allocate (last(faces%n), source=0_i4)
    do g = 1, size(mesh%group)
      do f = 1, facet_total(mesh%group(g))
        face = find_face(mesh, faces, mesh%group(g)%facet_kind(f), facet_nodes(mesh%group(g), f))
        if (face == 0) then
          call errors%add('I305', 'facet '//str(f)//" of group '"//trim(mesh%group(g)%name)// &
                          "' (nodes "//str(facet_nodes(mesh%group(g), f))// &
                          ') is no face of an element', path, &
                          'facet groups hold faces of the elements, with all their nodes')
          return
        end if
        if (last(face) == g) then
          call member_twice(path, mesh%group(g), 'facet '//str(f)//' (nodes '// &
                            str(facet_nodes(mesh%group(g), f))//')', errors)
          return
        end if
        last(face) = g
      end do
    end do
  end subroutine check_facets

  !> Fault I308 for the first two elements that share the corners of a face but not all its nodes.
  subroutine check_nesting(path, mesh, faces, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: q, twin, e, other

    do q = 1, faces%n
      if (corner_count(mesh%kind(faces%element(q))) == size(element_nodes(mesh, &
        faces%element(q)))) cycle
      twin = twin_of(faces, q)
      if (twin == 0) cycle
      if (same_set(nodes_of_face(mesh, faces, q), nodes_of_face(mesh, faces, twin))) cycle
      e = min(faces%element(q), faces%element(twin))
      other = max(faces%element(q), faces%element(twin))
      call errors%add('I308', 'elements '//str(e)//' ('//kind_name(mesh%kind(e))//') and '// &
                      str(other)//' ('//kind_name(mesh%kind(other))// &
                      ') share the corners of a face but not the nodes between them', path, &
                      'give neighbours the same order, and the same nodes on the common face')
      return
    end do
  end subroutine check_nesting
end module fem_mesh_checks
