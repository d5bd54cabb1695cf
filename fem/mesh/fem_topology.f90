!> Adjacency in a mesh: nodes of elements and facets, faces of elements, outer faces.
module fem_topology
  use talus_kinds, only: i4
  use fem_kinds, only: hex8, node_count, corner_count, face_count, face_nodes, face_kind, &
    most_faces, solid_kinds
  use fem_types, only: fem_mesh_type, fem_group_type
  implicit none
  private
  public :: set_elements, element_nodes, facet_nodes, facet_total
  public :: fem_faces_type, list_faces, nodes_of_face, find_face, same_set, twin_of

  integer(i4), parameter :: most_corners = 4

  !> All faces of all elements, and lists of those with the same smallest corner.
  type :: fem_faces_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: element(:)     !! (n)
    integer(i4), allocatable :: local(:)       !! (n) number of the face in its element
    integer(i4), allocatable :: corner(:, :)   !! (4, n) node ids; the fourth of a triangle is 0
    integer(i4), allocatable :: head(:)        !! (nodes) first face with this smallest corner
    integer(i4), allocatable :: link(:)        !! (n) the next one, 0 at the end
  end type fem_faces_type

contains

  !> Make a mesh of one kind from connectivity (nodes of the kind, elements); x is there already.
  pure subroutine set_elements(mesh, kind, connectivity)
    type(fem_mesh_type), intent(inout) :: mesh
    integer(i4), intent(in) :: kind, connectivity(:, :)
    integer(i4) :: e
    mesh%nodes = size(mesh%x, 2)
    mesh%elements = size(connectivity, 2)
    if (allocated(mesh%kind)) deallocate (mesh%kind)
    allocate (mesh%kind(mesh%elements), source=kind)
    mesh%start = [(1 + (e - 1)*size(connectivity, 1), e=1, mesh%elements + 1)]
    mesh%node = reshape(connectivity, [size(connectivity)])
    if (kind == hex8) mesh%hex8 = connectivity
  end subroutine set_elements

  !> Node ids of element e.
  pure function element_nodes(mesh, e) result(node)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: e
    integer(i4) :: node(mesh%start(e + 1) - mesh%start(e))
    node = mesh%node(mesh%start(e):mesh%start(e + 1) - 1)
  end function element_nodes

  !> Number of facets of a group.
  pure integer(i4) function facet_total(group)
    type(fem_group_type), intent(in) :: group
    facet_total = 0
    if (allocated(group%facet_kind)) facet_total = size(group%facet_kind)
  end function facet_total

  !> Node ids of facet f of a group.
  pure function facet_nodes(group, f) result(node)
    type(fem_group_type), intent(in) :: group
    integer(i4), intent(in) :: f
    integer(i4) :: node(node_count(group%facet_kind(f)))
    node = group%facet(:size(node), f)
  end function facet_nodes

  !> All faces of a mesh.
  subroutine list_faces(mesh, faces)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(out) :: faces
    integer(i4) :: local(most_corners, most_faces, solid_kinds), count_of(solid_kinds)
    integer(i4) :: e, f, q, n, k, node(8)

    call face_corners(local, count_of)
    faces%n = sum(count_of(mesh%kind))
    allocate (faces%element(faces%n), faces%local(faces%n), faces%corner(most_corners, faces%n))
    allocate (faces%link(faces%n), faces%head(mesh%nodes))
    faces%head = 0
    q = 0
    do e = 1, mesh%elements
      k = mesh%kind(e)
      n = corner_count(k)
      node(:n) = mesh%node(mesh%start(e):mesh%start(e) + n - 1)
      do f = 1, count_of(k)
        q = q + 1
        faces%element(q) = e
        faces%local(q) = f
        faces%corner(:3, q) = node(local(:3, f, k))
        faces%corner(4, q) = 0
        if (local(4, f, k) > 0) faces%corner(4, q) = node(local(4, f, k))
        n = smallest(faces%corner(:, q))
        faces%link(q) = faces%head(n)
        faces%head(n) = q
      end do
    end do
  end subroutine list_faces

  !> Local corner nodes of every face of every kind; the fourth of a triangle is 0.
  pure subroutine face_corners(local, count_of)
    integer(i4), intent(out) :: local(:, :, :), count_of(:)
    integer(i4) :: k, f, c
    integer(i4), allocatable :: node(:)
    local = 0
    do k = 1, solid_kinds
      count_of(k) = face_count(k)
      do f = 1, count_of(k)
        node = face_nodes(k, f)
        c = corner_count(face_kind(k, f))
        local(:c, f, k) = node(:c)
      end do
    end do
  end subroutine face_corners

  pure integer(i4) function smallest(corner)
    integer(i4), intent(in) :: corner(:)
    smallest = minval(corner(:3))
    if (corner(4) > 0) smallest = min(smallest, corner(4))
  end function smallest

  !> All nodes of face q, in the order of its kind, normal outward.
  pure function nodes_of_face(mesh, faces, q) result(node)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    integer(i4), intent(in) :: q
    integer(i4), allocatable :: node(:)
    integer(i4) :: e
    e = faces%element(q)
    node = mesh%node(mesh%start(e) - 1 + face_nodes(mesh%kind(e), faces%local(q)))
  end function nodes_of_face

  !> The face of an element with exactly these nodes, in any order; 0 if there is none.
  pure integer(i4) function find_face(mesh, faces, kind, node)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    integer(i4), intent(in) :: kind, node(:)
    integer(i4) :: corner(most_corners), c
    corner = 0
    c = corner_count(kind)
    corner(:c) = node(:c)
    find_face = faces%head(smallest(corner))
    do while (find_face > 0)
      if (same_set(corner, faces%corner(:, find_face))) then
        if (same_set(node, nodes_of_face(mesh, faces, find_face))) return
      end if
      find_face = faces%link(find_face)
    end do
  end function find_face

  !> The face of another element with the same corners as face q; 0 on the surface.
  pure integer(i4) function twin_of(faces, q)
    type(fem_faces_type), intent(in) :: faces
    integer(i4), intent(in) :: q
    twin_of = faces%head(smallest(faces%corner(:, q)))
    do while (twin_of > 0)
      if (twin_of /= q) then
        if (same_set(faces%corner(:, q), faces%corner(:, twin_of))) return
      end if
      twin_of = faces%link(twin_of)
    end do
  end function twin_of

  !> Are these the same nodes, in any order?
  pure logical function same_set(a, b)
    integer(i4), intent(in) :: a(:), b(:)
    integer(i4) :: k
    same_set = size(a) == size(b)
    if (.not. same_set) return
    do k = 1, size(a)
      if (any(b == a(k))) cycle
      same_set = .false.
      return
    end do
  end function same_set
end module fem_topology
