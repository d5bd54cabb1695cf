!> Hanging nodes: a node of the surface inside a surface face, or on an edge, that does not have it;
!! two nodes in one place among them.
module fem_mesh_hanging
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use fem_kinds, only: quad4, quad8, quad9, tri3, tri6, face_kind
  use fem_topology, only: fem_faces_type, nodes_of_face, twin_of
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: check_hanging

  real(wp), parameter :: near = 1.0e-6_wp  !! distance / face size that counts as on it

  !> Surface nodes in a grid of cubic cells.
  type :: grid_type
    real(wp) :: low(3) = 0.0_wp, cell = 1.0_wp  !! [m]
    integer(i4) :: cells(3) = 1
    integer(i4), allocatable :: first(:), next(:)
  end type grid_type

contains

  !> Fault I303 for the first hanging node.
  subroutine check_hanging(path, mesh, faces, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    type(error_list_type), intent(inout) :: errors
    type(grid_type) :: grid
    integer(i4), allocatable :: outer(:)
    integer(i4) :: f, hit, corner

    call outer_faces(faces, outer)
    call fill_grid(mesh, faces, outer, grid)
    do f = 1, size(outer)
      call search_face(mesh, faces, grid, outer(f), hit, corner)
      if (hit == 0) cycle
      if (corner > 0) then
        call errors%add('I303', 'nodes '//str(min(hit, corner))//' and '//str(max(hit, corner))// &
                        ' are at the same position (element '//str(faces%element(outer(f)))// &
                        ' hangs on a face or edge there, at '//str(mesh%x(:, hit))//' m)', path, &
                        'join the meshes so that neighbours share their nodes')
      else
        call errors%add('I303', 'node '//str(hit)//' hangs on a face or edge of element '// &
                        str(faces%element(outer(f)))//' (at '//str(mesh%x(:, hit))//' m)', path, &
                        'join the meshes so that neighbours share their nodes')
      end if
      return
    end do
  end subroutine check_hanging

  !> Faces that only one element has.
  subroutine outer_faces(faces, outer)
    type(fem_faces_type), intent(in) :: faces
    integer(i4), allocatable, intent(out) :: outer(:)
    logical, allocatable :: single(:)
    integer(i4) :: q
    allocate (single(faces%n))
    do q = 1, faces%n
      single(q) = twin_of(faces, q) == 0
    end do
    outer = pack([(q, q=1, faces%n)], single)
  end subroutine outer_faces

  subroutine fill_grid(mesh, faces, outer, grid)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    integer(i4), intent(in) :: outer(:)
    type(grid_type), intent(out) :: grid
    logical, allocatable :: surface(:)
    integer(i4), allocatable :: node(:)
    real(wp) :: largest, span(3)
    integer(i4) :: f, m, at(3), place

    allocate (surface(mesh%nodes), source=.false.)
    largest = 0.0_wp
    do f = 1, size(outer)
      node = nodes_of_face(mesh, faces, outer(f))
      surface(node) = .true.
      span = maxval(mesh%x(:, node), dim=2) - minval(mesh%x(:, node), dim=2)
      largest = max(largest, maxval(span))
    end do
    grid%low = minval(mesh%x, dim=2)
    span = maxval(mesh%x, dim=2) - grid%low
    grid%cell = max(largest, maxval(span)/200.0_wp)
    grid%cells = int(span/grid%cell) + 1
    allocate (grid%first(product(grid%cells)), grid%next(mesh%nodes), source=0)
    do m = 1, mesh%nodes
      if (.not. surface(m)) cycle
      at = min(grid%cells, 1 + int((mesh%x(:, m) - grid%low)/grid%cell))
      place = at(1) + grid%cells(1)*(at(2) - 1 + grid%cells(2)*(at(3) - 1))
      grid%next(m) = grid%first(place)
      grid%first(place) = m
    end do
  end subroutine fill_grid

  !> The first surface node on face q that is none of its own; `corner` is the own node in the same
  !! place, 0 if there is none.
  subroutine search_face(mesh, faces, grid, q, hit, corner)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_faces_type), intent(in) :: faces
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: q
    integer(i4), intent(out) :: hit, corner
    integer(i4), allocatable :: own(:)
    real(wp), allocatable :: x(:, :)
    integer(i4) :: low(3), high(3), extent(3), place, cell, at(3), kind

    allocate (own, source=nodes_of_face(mesh, faces, q))
    allocate (x, source=mesh%x(:, own))
    kind = face_kind(mesh%kind(faces%element(q)), faces%local(q))
    low = max(1, int((minval(x, dim=2) - grid%low)/grid%cell))
    high = min(grid%cells, 2 + int((maxval(x, dim=2) - grid%low)/grid%cell))
    extent = high - low + 1
    corner = 0
    do cell = 0, product(extent) - 1
      at = low + [mod(cell, extent(1)), mod(cell/extent(1), extent(2)), &
                  cell/(extent(1)*extent(2))]
      place = at(1) + grid%cells(1)*(at(2) - 1 + grid%cells(2)*(at(3) - 1))
      hit = grid%first(place)
      do while (hit > 0)
        if (is_foreign(kind, own, x, hit, mesh%x(:, hit))) then
          corner = same_place(own, x, mesh%x(:, hit))
          return
        end if
        hit = grid%next(hit)
      end do
    end do
  end subroutine search_face

  !> Is a node at p on the face with the nodes `own` at x, and none of them?
  logical function is_foreign(kind, own, x, node, p)
    integer(i4), intent(in) :: kind, own(:), node
    real(wp), intent(in) :: x(:, :), p(3)
    is_foreign = .false.
    if (any(own == node)) return
    is_foreign = on_face(kind, p, x)
  end function is_foreign

  !> Which of the nodes at x is at p; 0 if none is.
  pure integer(i4) function same_place(own, x, p)
    integer(i4), intent(in) :: own(:)
    real(wp), intent(in) :: x(:, :), p(3)
    integer(i4) :: a
    real(wp) :: scale
    scale = norm2(maxval(x, dim=2) - minval(x, dim=2))
    same_place = 0
    do a = 1, size(own)
      if (norm2(x(:, a) - p) < near*scale) same_place = own(a)
    end do
  end function same_place

  !> Does p lie on the face (within a small distance), its rim included? Curved faces are taken as
  !! the triangles between their nodes.
  pure logical function on_face(kind, p, x)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: p(3), x(:, :)
    integer(i4), allocatable :: triangle(:, :)
    real(wp) :: margin
    integer(i4) :: t
    margin = 0.1_wp*maxval(maxval(x, dim=2) - minval(x, dim=2))
    on_face = .false.
    if (any(p < minval(x, dim=2) - margin) .or. any(p > maxval(x, dim=2) + margin)) return
    triangle = triangles(kind)
    do t = 1, size(triangle, 2)
      on_face = in_triangle(p, x(:, triangle(1, t)), x(:, triangle(2, t)), x(:, triangle(3, t)))
      if (on_face) return
    end do
  end function on_face

  !> Triangles (3, t) between the nodes of a facet.
  pure function triangles(kind) result(node)
    integer(i4), intent(in) :: kind
    integer(i4), allocatable :: node(:, :)
    select case (kind)
    case (quad4)
      node = reshape([1, 2, 3, 1, 3, 4], [3, 2])
    case (quad8)
      node = reshape([1, 5, 8, 5, 2, 6, 6, 3, 7, 7, 4, 8, 5, 6, 7, 5, 7, 8], [3, 6])
    case (quad9)
      node = reshape([1, 5, 9, 5, 2, 9, 2, 6, 9, 6, 3, 9, 3, 7, 9, 7, 4, 9, 4, 8, 9, 8, 1, 9], &
                     [3, 8])
    case (tri3)
      node = reshape([1, 2, 3], [3, 1])
    case (tri6)
      node = reshape([1, 4, 6, 4, 2, 5, 5, 3, 6, 4, 5, 6], [3, 4])
    case default
      error stop 'bug: no kind of facet'
    end select
  end function triangles

  pure logical function in_triangle(p, a, b, c)
    real(wp), intent(in) :: p(3), a(3), b(3), c(3)
    real(wp) :: e(3), f(3), r(3), g(2, 2), det, s, t, off(3), scale
    e = b - a
    f = c - a
    r = p - a
    g(1, 1) = dot_product(e, e)
    g(2, 2) = dot_product(f, f)
    g(1, 2) = dot_product(e, f)
    det = g(1, 1)*g(2, 2) - g(1, 2)**2
    scale = sqrt(max(g(1, 1), g(2, 2)))
    in_triangle = .false.
    if (.not. det > 0.0_wp) return
    s = (dot_product(r, e)*g(2, 2) - dot_product(r, f)*g(1, 2))/det
    t = (dot_product(r, f)*g(1, 1) - dot_product(r, e)*g(1, 2))/det
    off = r - s*e - t*f
    in_triangle = norm2(off) < near*scale .and. s > -near .and. t > -near .and. s + t < 1.0_wp &
      + near
  end function in_triangle
end module fem_mesh_hanging
