!> The surface of a group of elements, as triangles, and how far points are from it.
module cpl_hull
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use cpl_cells, only: cells_type
  use cpl_elements, only: corner_count
  implicit none
  private
  public :: hull_type, outer_faces

  integer(i4), parameter :: hex_face(4, 6) = reshape([1, 4, 3, 2, 5, 6, 7, 8, 1, 2, 6, 5, &
                                                      3, 4, 8, 7, 2, 3, 7, 6, 1, 5, 8, 4], [4, 6])
  integer(i4), parameter :: tet_face(3, 4) = reshape([1, 3, 2, 1, 2, 4, 2, 3, 4, 1, 4, 3], [3, 4])

  !> Triangles with a ball around each.
  type :: hull_type
    integer(i4) :: n = 0
    real(wp), allocatable :: corner(:, :, :)  !! (3, 3, n) [m]
    real(wp), allocatable :: middle(:, :)     !! (3, n) [m]
    real(wp), allocatable :: reach(:)         !! (n) [m]
  contains
    procedure :: build
    procedure :: distance
  end type hull_type

contains

  !> Faces that only one of the chosen elements has; two triangles a quadrilateral.
  subroutine build(self, cells, chosen)
    class(hull_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: chosen(:)  !! (elements)
    integer(i4), allocatable :: faces(:, :)
    integer(i4) :: k

    call outer_faces(cells, chosen, faces)
    allocate (self%corner(3, 3, 2*size(faces, 2)))
    self%n = 0
    do k = 1, size(faces, 2)
      call add_triangle(self, cells%x(:, faces(:3, k)))
      if (faces(4, k) > 0) call add_triangle(self, cells%x(:, faces([1, 3, 4], k)))
    end do
    self%corner = self%corner(:, :, :self%n)
    self%middle = sum(self%corner, 2)/3.0_wp
    allocate (self%reach(self%n))
    do k = 1, self%n
      self%reach(k) = sqrt(maxval(sum((self%corner(:, :, k) &
                                       - spread(self%middle(:, k), 2, 3))**2, 1)))
    end do
  end subroutine build

  !> Corners of the faces that only one of the chosen elements has (4, n), of triangles the last 0;
  !! their outer normals.
  subroutine outer_faces(cells, chosen, faces, normal)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: chosen(:)                        !! (elements)
    integer(i4), allocatable, intent(out) :: faces(:, :)
    real(wp), allocatable, optional, intent(out) :: normal(:, :)  !! (3, n)
    integer(i4), allocatable :: all(:, :), head(:), next(:), left(:)
    integer(i4) :: e, f, k, n, most

    most = 6*count(chosen)
    allocate (all(4, most), head(cells%nodes), next(most))
    head = 0
    n = 0
    do e = 1, cells%elements
      if (.not. chosen(e)) cycle
      do f = 1, merge(6, 4, corner_count(cells%kind(e)) == 8)
        call put_face(face_of(cells, e, f), all, head, next, n)
      end do
    end do
    left = pack([(k, k=1, n)], all(1, :n) > 0)
    faces = all(:, left)
    if (.not. present(normal)) return
    allocate (normal(3, size(left)))
    do k = 1, size(left)
      associate (x => cells%x(:, faces(:3, k)))
        normal(:, k) = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 2))
      end associate
      normal(:, k) = normal(:, k)/norm2(normal(:, k))
    end do
  end subroutine outer_faces

  pure function face_of(cells, e, f) result(face)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: e, f
    integer(i4) :: face(4)
    face = 0
    if (corner_count(cells%kind(e)) == 8) then
      face = cells%node(cells%start(e) - 1 + hex_face(:, f))
    else
      face(:3) = cells%node(cells%start(e) - 1 + tet_face(:, f))
    end if
  end function face_of

  !> A face that comes a second time is inside: it is removed. Lists belong to the lowest node.
  subroutine put_face(face, faces, head, next, n)
    integer(i4), intent(in) :: face(4)
    integer(i4), intent(inout) :: faces(:, :), head(:), next(:), n
    integer(i4) :: low, k, c
    low = minval(face, face > 0)
    k = head(low)
    do while (k > 0)
      if (faces(1, k) > 0) then
        if (all([(any(faces(:, k) == face(c)), c=1, 4)])) then
          faces(:, k) = 0
          return
        end if
      end if
      k = next(k)
    end do
    n = n + 1
    faces(:, n) = face
    next(n) = head(low)
    head(low) = n
  end subroutine put_face

  pure subroutine add_triangle(self, x)
    type(hull_type), intent(inout) :: self
    real(wp), intent(in) :: x(3, 3)
    self%n = self%n + 1
    self%corner(:, :, self%n) = x
  end subroutine add_triangle

  !> Distance of a point from the surface, huge if there is none [m].
  pure real(wp) function distance(self, x)
    class(hull_type), intent(in) :: self
    real(wp), intent(in) :: x(3)
    integer(i4) :: k
    distance = huge(1.0_wp)
    do k = 1, self%n
      if (norm2(x - self%middle(:, k)) - self%reach(k) >= distance) cycle
      distance = min(distance, norm2(x - closest(self%corner(:, :, k), x)))
    end do
  end function distance

  !> The point of a triangle that is nearest to x (Ericson 2005, section 5.1.5).
  pure function closest(t, x) result(p)
    real(wp), intent(in) :: t(3, 3), x(3)
    real(wp) :: p(3), ab(3), ac(3), d1, d2, d3, d4, d5, d6, va, vb, vc
    ab = t(:, 2) - t(:, 1)
    ac = t(:, 3) - t(:, 1)
    d1 = dot_product(ab, x - t(:, 1))
    d2 = dot_product(ac, x - t(:, 1))
    d3 = dot_product(ab, x - t(:, 2))
    d4 = dot_product(ac, x - t(:, 2))
    d5 = dot_product(ab, x - t(:, 3))
    d6 = dot_product(ac, x - t(:, 3))
    va = d3*d6 - d5*d4
    vb = d5*d2 - d1*d6
    vc = d1*d4 - d3*d2
    if (d1 <= 0.0_wp .and. d2 <= 0.0_wp) then
      p = t(:, 1)
    else if (d3 >= 0.0_wp .and. d4 <= d3) then
      p = t(:, 2)
    else if (d6 >= 0.0_wp .and. d5 <= d6) then
      p = t(:, 3)
    else if (vc <= 0.0_wp .and. d1 >= 0.0_wp .and. d3 <= 0.0_wp) then
      p = t(:, 1) + d1/(d1 - d3)*ab
    else if (vb <= 0.0_wp .and. d2 >= 0.0_wp .and. d6 <= 0.0_wp) then
      p = t(:, 1) + d2/(d2 - d6)*ac
    else if (va <= 0.0_wp .and. d4 >= d3 .and. d5 >= d6) then
      p = t(:, 2) + (d4 - d3)/((d4 - d3) + (d5 - d6))*(t(:, 3) - t(:, 2))
    else
      p = t(:, 1) + (vb*ab + vc*ac)/(va + vb + vc)
    end if
  end function closest
end module cpl_hull
