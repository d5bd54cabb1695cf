!> Kinds of elements and facets: names, node counts, reference nodes, faces and edges.
!!
!! Node order is VTK's throughout (it is also that of mesh.h5 and of XDMF): corners first, then the
!! middles of the edges, then of the faces, then the centre. gmsh orders hex20, hex27 and tet10
!! otherwise; prepost/talus/elements.py has the permutations. The wedge has the order of gmsh and of
!! VTK's parametric coordinates: nodes 1 2 3 turn counter-clockwise seen from nodes 4 5 6.
!! Hexahedra, quadrangles and the axis of wedges span [-1, 1]; tetrahedra and triangles are the unit
!! simplex.
module fem_kinds
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: hex8, hex20, hex27, tet4, tet10, wedge6, quad4, quad8, quad9, tri3, tri6
  public :: kinds, solid_kinds, first_facet, most_nodes, most_facet_nodes, most_faces
  public :: node_count, corner_count, corner_kind, kind_name, kind_of_name, dimension_of
  public :: face_count, face_kind, face_nodes, edge_count, edge_nodes, reference_nodes
  public :: is_quadratic

  integer(i4), parameter :: hex8 = 1, hex20 = 2, hex27 = 3, tet4 = 4, tet10 = 5, wedge6 = 6
  integer(i4), parameter :: quad4 = 7, quad8 = 8, quad9 = 9, tri3 = 10, tri6 = 11
  integer(i4), parameter :: kinds = 11, solid_kinds = 6, first_facet = quad4
  integer(i4), parameter :: most_nodes = 27, most_facet_nodes = 9, most_faces = 6

  integer(i4), parameter :: nodes_of(kinds) = [8, 20, 27, 4, 10, 6, 4, 8, 9, 3, 6]
  integer(i4), parameter :: corners_of(kinds) = [8, 8, 8, 4, 4, 6, 4, 4, 4, 3, 3]
  integer(i4), parameter :: corner_kind_of(kinds) = [hex8, hex8, hex8, tet4, tet4, wedge6, &
                                                     quad4, quad4, quad4, tri3, tri3]
  integer(i4), parameter :: faces_of(kinds) = [6, 6, 6, 4, 4, 5, 0, 0, 0, 0, 0]
  integer(i4), parameter :: edges_of(kinds) = [12, 12, 12, 6, 6, 9, 4, 4, 4, 3, 3]
  character(len=6), parameter :: name_of(kinds) = [character(len=6) :: 'hex8', 'hex20', 'hex27', &
                                                   'tet4', 'tet10', 'wedge6', 'quad4', 'quad8', &
                                                   'quad9', 'tri3', 'tri6']

  integer(i4), parameter :: hex_face(4, 6) = reshape([1, 4, 3, 2, 5, 6, 7, 8, 1, 2, 6, 5, &
                                                      3, 4, 8, 7, 2, 3, 7, 6, 1, 5, 8, 4], [4, 6])
  integer(i4), parameter :: hex_face_middle(6) = [25, 26, 23, 24, 22, 21]  !! of hex27
  integer(i4), parameter :: tet_face(3, 4) = reshape([1, 3, 2, 1, 2, 4, 2, 3, 4, 1, 4, 3], [3, 4])
  integer(i4), parameter :: wedge_face(4, 5) = reshape([1, 3, 2, 0, 4, 5, 6, 0, 1, 2, 5, 4, &
                                                        2, 3, 6, 5, 3, 1, 4, 6], [4, 5])
  integer(i4), parameter :: hex_edge(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, &
                                                       7, 8, 8, 5, 1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
  integer(i4), parameter :: tet_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 1, 4, 2, 4, 3, 4], [2, 6])
  integer(i4), parameter :: wedge_edge(2, 9) = reshape([1, 2, 2, 3, 3, 1, 4, 5, 5, 6, 6, 4, &
                                                        1, 4, 2, 5, 3, 6], [2, 9])

  real(wp), parameter :: hex_nodes(3, 27) = reshape(real([ &
    -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1, &
    0, -1, -1, 1, 0, -1, 0, 1, -1, -1, 0, -1, 0, -1, 1, 1, 0, 1, 0, 1, 1, -1, 0, 1, &
    -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, &
    -1, 0, 0, 1, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0], wp), [3, 27])
  real(wp), parameter :: quad_nodes(2, 9) = reshape(real([ &
    -1, -1, 1, -1, 1, 1, -1, 1, 0, -1, 1, 0, 0, 1, -1, 0, 0, 0], wp), [2, 9])
  real(wp), parameter :: tet_nodes(3, 10) = 0.5_wp*reshape(real([ &
    0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1], &
    wp), [3, 10])
  real(wp), parameter :: wedge_nodes(3, 6) = reshape(real([ &
    0, 0, -1, 1, 0, -1, 0, 1, -1, 0, 0, 1, 1, 0, 1, 0, 1, 1], wp), [3, 6])

contains

  !> Number of nodes of a kind.
  pure integer(i4) function node_count(kind)
    integer(i4), intent(in) :: kind
    node_count = nodes_of(kind)
  end function node_count

  !> Number of corner nodes; they come first.
  pure integer(i4) function corner_count(kind)
    integer(i4), intent(in) :: kind
    corner_count = corners_of(kind)
  end function corner_count

  !> The kind that the corner nodes alone make: hex8 of hex20, tri3 of tri6.
  pure integer(i4) function corner_kind(kind)
    integer(i4), intent(in) :: kind
    corner_kind = corner_kind_of(kind)
  end function corner_kind

  !> Does the kind have nodes on its edges?
  pure logical function is_quadratic(kind)
    integer(i4), intent(in) :: kind
    is_quadratic = nodes_of(kind) > corners_of(kind)
  end function is_quadratic

  !> Number of natural coordinates: 3 of elements, 2 of facets.
  pure integer(i4) function dimension_of(kind)
    integer(i4), intent(in) :: kind
    dimension_of = merge(3, 2, kind < first_facet)
  end function dimension_of

  !> Name as in mesh.h5 and decks.
  pure function kind_name(kind) result(name)
    integer(i4), intent(in) :: kind
    character(len=:), allocatable :: name
    name = trim(name_of(kind))
  end function kind_name

  !> Kind of a name; 0 where there is none.
  pure integer(i4) function kind_of_name(name)
    character(len=*), intent(in) :: name
    kind_of_name = int(findloc(name_of == name, .true., 1), i4)
  end function kind_of_name

  !> Number of faces of an element.
  pure integer(i4) function face_count(kind)
    integer(i4), intent(in) :: kind
    face_count = faces_of(kind)
  end function face_count

  !> Kind of a face of an element.
  pure integer(i4) function face_kind(kind, face)
    integer(i4), intent(in) :: kind, face
    select case (kind)
    case (hex8)
      face_kind = quad4
    case (hex20)
      face_kind = quad8
    case (hex27)
      face_kind = quad9
    case (tet4)
      face_kind = tri3
    case (tet10)
      face_kind = tri6
    case (wedge6)
      face_kind = merge(tri3, quad4, face <= 2)
    case default
      error stop 'bug: a facet has no faces'
    end select
  end function face_kind

  !> Local nodes of a face, counter-clockwise seen from outside, in the order of its kind.
  pure function face_nodes(kind, face) result(node)
    integer(i4), intent(in) :: kind, face
    integer(i4), allocatable :: node(:)
    select case (kind)
    case (hex8)
      node = hex_face(:, face)
    case (hex20)
      node = with_middles(kind, hex_face(:, face))
    case (hex27)
      node = [with_middles(kind, hex_face(:, face)), hex_face_middle(face)]
    case (tet4)
      node = tet_face(:, face)
    case (tet10)
      node = with_middles(kind, tet_face(:, face))
    case (wedge6)
      node = wedge_face(:merge(3, 4, face <= 2), face)
    case default
      error stop 'bug: a facet has no faces'
    end select
  end function face_nodes

  !> Corners of a face and the middles of the edges between them.
  pure function with_middles(kind, corner) result(node)
    integer(i4), intent(in) :: kind, corner(:)
    integer(i4) :: node(2*size(corner))
    integer(i4) :: c, e, pair(2), n
    n = size(corner)
    node(:n) = corner
    do c = 1, n
      pair = [corner(c), corner(1 + mod(c, n))]
      do e = 1, edge_count(kind)
        if (all(edge_corners(kind, e) == pair) .or. all(edge_corners(kind, e) == pair(2:1:-1))) &
          node(n + c) = corner_count(kind) + e
      end do
    end do
  end function with_middles

  !> Number of edges of an element or facet.
  pure integer(i4) function edge_count(kind)
    integer(i4), intent(in) :: kind
    edge_count = edges_of(kind)
  end function edge_count

  pure function edge_corners(kind, edge) result(pair)
    integer(i4), intent(in) :: kind, edge
    integer(i4) :: pair(2)
    select case (kind)
    case (hex8, hex20, hex27)
      pair = hex_edge(:, edge)
    case (tet4, tet10)
      pair = tet_edge(:, edge)
    case (wedge6)
      pair = wedge_edge(:, edge)
    case default
      pair = [edge, 1 + mod(edge, edges_of(kind))]
    end select
  end function edge_corners

  !> Both ends of an edge, then its middle if the kind has one.
  pure function edge_nodes(kind, edge) result(node)
    integer(i4), intent(in) :: kind, edge
    integer(i4), allocatable :: node(:)
    node = edge_corners(kind, edge)
    if (is_quadratic(kind)) node = [node, corner_count(kind) + edge]
  end function edge_nodes

  !> Natural coordinates of the nodes, (3, nodes) of elements and (2, nodes) of facets.
  pure function reference_nodes(kind) result(xi)
    integer(i4), intent(in) :: kind
    real(wp), allocatable :: xi(:, :)
    select case (kind)
    case (hex8, hex20, hex27)
      xi = hex_nodes(:, :nodes_of(kind))
    case (tet4, tet10)
      xi = tet_nodes(:, :nodes_of(kind))
    case (wedge6)
      xi = wedge_nodes
    case (quad4, quad8, quad9)
      xi = quad_nodes(:, :nodes_of(kind))
    case (tri3)
      xi = tet_nodes(:2, :3)
    case (tri6)
      xi = tet_nodes(:2, [1, 2, 3, 5, 6, 7])
    case default
      error stop 'bug: no such kind of element'
    end select
  end function reference_nodes
end module fem_kinds
