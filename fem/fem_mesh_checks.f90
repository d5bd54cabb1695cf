!> Hanging nodes: a node of the surface inside a surface face, or on an edge, that does not have it.
!! Facets of groups: each must be a face of an element.
module fem_mesh_checks
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use fem_types, only: fem_mesh_type, group_facet
  implicit none
  private
  public :: check_hanging, check_facets

  integer(i4), parameter :: face(4, 6) = reshape([1, 4, 3, 2, 5, 6, 7, 8, 1, 2, 6, 5, &
                                                  3, 4, 8, 7, 2, 3, 7, 6, 1, 5, 8, 4], [4, 6])
  real(wp), parameter :: near = 1.0e-6_wp  !! distance / face size that counts as on it

contains

  !> Fault I303 for the first hanging node.
  subroutine check_hanging(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: quad(:, :), owner(:), first(:), next(:)
    logical, allocatable :: surface(:)
    real(wp) :: low(3), high(3), size_max, cell
    integer(i4) :: cells(3), f, n, c(3), d(3), i, j, k, hit

    call outer_faces(mesh, quad, owner)
    allocate (surface(mesh%nodes), source=.false.)
    size_max = 0.0_wp
    do f = 1, size(owner)
      surface(quad(:, f)) = .true.
      size_max = max(size_max, maxval(extent(mesh%x(:, quad(:, f)))))
    end do
    low = minval(mesh%x, dim=2)
    high = maxval(mesh%x, dim=2)
    cell = max(size_max, maxval(high - low)/200.0_wp)
    cells = int((high - low)/cell) + 1
    call fill_grid()
    do f = 1, size(owner)
      c = 1 + int((minval(mesh%x(:, quad(:, f)), dim=2) - low)/cell)
      d = 1 + int((maxval(mesh%x(:, quad(:, f)), dim=2) - low)/cell)
      c = max(1, c - 1)
      d = min(cells, d + 1)
      do k = c(3), d(3)
        do j = c(2), d(2)
          do i = c(1), d(1)
            n = first(i + cells(1)*(j - 1 + cells(2)*(k - 1)))
            do while (n > 0)
              hit = 0
              if (.not. any(quad(:, f) == n)) then
                if (on_face(mesh%x(:, n), mesh%x(:, quad(:, f)))) hit = n
              end if
              if (hit > 0) then
                call errors%add('I303', 'node '//str(hit)// &
                  ' hangs on a face or edge of element '// &
                                str(owner(f))//' (at '//str(mesh%x(:, hit))//' m)', path, &
                                'join the meshes so that neighbours share their nodes')
                return
              end if
              n = next(n)
            end do
          end do
        end do
      end do
    end do

  contains

    !> Linked lists of the surface nodes in a grid of cells.
    subroutine fill_grid()
      integer(i4) :: m, at(3), place
      allocate (first(product(cells)), next(mesh%nodes))
      first = 0
      next = 0
      do m = 1, mesh%nodes
        if (.not. surface(m)) cycle
        at = min(cells, 1 + int((mesh%x(:, m) - low)/cell))
        place = at(1) + cells(1)*(at(2) - 1 + cells(2)*(at(3) - 1))
        next(m) = first(place)
        first(place) = m
      end do
    end subroutine fill_grid
  end subroutine check_hanging

  !> Fault I305 for the first facet of a group that is no face of an element.
  subroutine check_facets(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: quads(:, :), head(:), link(:)
    integer(i4) :: g, f, q

    call all_faces(mesh, quads, head, link)
    do g = 1, size(mesh%group)
      if (mesh%group(g)%kind /= group_facet) cycle
      do f = 1, size(mesh%group(g)%facet, 2)
        q = head(minval(mesh%group(g)%facet(:, f)))
        do while (q > 0)
          if (same(mesh%group(g)%facet(:, f), quads(:, q))) exit
          q = link(q)
        end do
        if (q > 0) cycle
        call errors%add('I305', 'facet '//str(f)//" of group '"//trim(mesh%group(g)%name)// &
                        "' (nodes "//str(mesh%group(g)%facet(:, f))// &
                        ') is no face of an element', path, &
                        'facet groups hold faces of the hexahedra, four nodes each')
        return
      end do
    end do
  end subroutine check_facets

  !> All faces of all elements, and lists of those with the same smallest node.
  subroutine all_faces(mesh, quads, head, link)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), allocatable, intent(out) :: quads(:, :), head(:), link(:)
    integer(i4) :: e, f, q, n
    allocate (quads(4, 6*mesh%elements), link(6*mesh%elements))
    allocate (head(mesh%nodes), source=0)
    do e = 1, mesh%elements
      do f = 1, 6
        q = 6*(e - 1) + f
        quads(:, q) = mesh%hex8(face(:, f), e)
        n = minval(quads(:, q))
        link(q) = head(n)
        head(n) = q
      end do
    end do
  end subroutine all_faces

  pure function extent(x) result(length)
    real(wp), intent(in) :: x(3, 4)
    real(wp) :: length(3)
    length = maxval(x, dim=2) - minval(x, dim=2)
  end function extent

  !> Does p lie on the quadrangle (within a small distance), its rim included?
  pure logical function on_face(p, x)
    real(wp), intent(in) :: p(3), x(3, 4)
    on_face = in_triangle(p, x(:, 1), x(:, 2), x(:, 3)) &
      .or. in_triangle(p, x(:, 1), x(:, 3), x(:, 4))
  end function on_face

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

  !> Faces that only one element has, by sorting their node sets.
  subroutine outer_faces(mesh, quad, owner)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), allocatable, intent(out) :: quad(:, :), owner(:)
    integer(i4), allocatable :: head(:), link(:), all_quads(:, :)
    logical, allocatable :: single(:)
    integer(i4) :: e, f, q, n, other

    call all_faces(mesh, all_quads, head, link)
    allocate (single(size(link)), source=.true.)
    do q = 1, size(link)
      other = link(q)
      do while (other > 0)
        if (same(all_quads(:, q), all_quads(:, other))) then
          single(q) = .false.
          single(other) = .false.
          exit
        end if
        other = link(other)
      end do
    end do
    owner = pack([((e, f=1, 6), e=1, mesh%elements)], single)
    allocate (quad(4, size(owner)))
    n = 0
    do q = 1, size(single)
      if (.not. single(q)) cycle
      n = n + 1
      quad(:, n) = all_quads(:, q)
    end do
  end subroutine outer_faces

  pure logical function same(a, b)
    integer(i4), intent(in) :: a(4), b(4)
    integer(i4) :: k
    same = .true.
    do k = 1, 4
      same = same .and. any(b == a(k))
    end do
  end function same
end module fem_mesh_checks
