!> Meshes and exact shapes before they become bodies of the surfaces: corners joined to vertices,
!! neighbours across edges. Faults I223 to I226 name the triangle by its number in the file.
module dem_surface_make
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use dem_make, only: sorted_order
  implicit none
  private
  public :: mesh_type, round_type, join_corners, check_mesh

  real(wp), parameter :: flat = 1.0e-9_wp  !! height over longest side of a degenerate triangle

  !> A mesh before it becomes a body.
  type :: mesh_type
    character(len=:), allocatable :: name          !! for messages
    real(wp), allocatable :: x(:, :)               !! (3, vertices) [m]
    integer(i4), allocatable :: corner(:, :)       !! (3, triangles)
    integer(i4), allocatable :: mate(:, :)         !! (3, triangles)
    integer(i4) :: rim = 0                         !! edges of one triangle alone
  end type mesh_type

  !> A cylinder, or the shaft of a cone, before it becomes a body.
  type :: round_type
    real(wp) :: centre(3) = 0.0_wp                 !! of a cylinder; tip of a cone [m]
    real(wp) :: axis(3) = 0.0_wp                   !! of any length; of a cone from the tip up
    real(wp) :: radius = 0.0_wp                    !! [m]
    real(wp) :: length = huge(1.0_wp)              !! of a shaft, half that of a cylinder; huge if
                                                   !! it has no end [m]
  end type round_type

contains

  !> Corners at the same place become one vertex; vertices are numbered in the order of the corners.
  subroutine join_corners(corner, mesh)
    real(wp), intent(in) :: corner(:, :, :)  !! (3, 3, triangles) [m]
    type(mesh_type), intent(inout) :: mesh
    real(wp), allocatable :: x(:, :)
    integer(i4), allocatable :: order(:), lead(:), number(:)
    integer(i4) :: n, k, c

    n = 3*size(corner, 3)
    x = reshape(corner, [3, n]) + 0.0_wp
    allocate (order(n), source=[(k, k=1, n)])
    do c = 3, 1, -1
      order = order(sorted_order(transfer(x(c, order), [0_i8])))
    end do
    allocate (lead(n), number(n))
    do k = 1, n
      lead(order(k)) = order(k)
      if (k == 1) cycle
      if (all(abs(x(:, order(k)) - x(:, &
        order(k - 1))) <= 0.0_wp)) lead(order(k)) = lead(order(k - 1))
    end do
    c = 0
    do k = 1, n
      if (lead(k) == k) then
        c = c + 1
        x(:, c) = x(:, k)
        number(k) = c
      end if
    end do
    mesh%x = x(:, :c)
    mesh%corner = reshape(number(lead), [3, n/3])
  end subroutine join_corners

  !> Triangles with an area (I223), turned alike (I224), two at an edge at most (I225), without
  !! holes if requested (I226). Neighbours are found.
  subroutine check_mesh(mesh, closed, errors)
    type(mesh_type), intent(inout) :: mesh
    logical, intent(in) :: closed
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, before
    real(wp) :: side, area

    before = errors%count
    do k = 1, size(mesh%corner, 2)
      call size_of(mesh%x(:, mesh%corner(:, k)), side, area)
      if (area > flat*side*side) cycle
      call errors%add('I223', &
        mesh%name//': triangle '//str(k)//' has no area: its longest side is '// &
                      str(side)//' m, its area '//str(area)//' m2', mesh%name, &
                      'take it out, or mesh the surface again')
      return
    end do
    call find_mates(mesh, errors)
    if (errors%count > before .or. .not. closed .or. mesh%rim == 0) return
    k = findloc(any(mesh%mate == 0, 1), .true., 1)
    call errors%add('I226', &
      mesh%name//': the surface has holes: '//str(mesh%rim)//' edges belong '// &
                    'to one triangle alone, the first of them to triangle '//str(k), mesh%name, &
                    'close the surface, or leave closed = .true. out if it is open')
  end subroutine check_mesh

  pure subroutine size_of(p, side, area)
    real(wp), intent(in) :: p(3, 3)
    real(wp), intent(out) :: side, area
    real(wp) :: a(3), b(3), n(3)
    a = p(:, 2) - p(:, 1)
    b = p(:, 3) - p(:, 1)
    n = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
    area = 0.5_wp*sqrt(sum(n*n))
    side = sqrt(max(sum(a*a), sum(b*b), sum((b - a)**2)))
  end subroutine size_of

  !> Neighbours across the edges.
  subroutine find_mates(mesh, errors)
    type(mesh_type), intent(inout) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: key(:)
    integer(i4), allocatable :: order(:), wrong(:)
    integer(i4) :: n, k, e, a, b, length

    n = size(mesh%corner, 2)
    allocate (key(3*n), wrong(n))
    wrong = 0
    do k = 1, n
      do e = 1, 3
        a = mesh%corner(e, k)
        b = mesh%corner(1 + mod(e, 3), k)
        key(3*(k - 1) + e) = int(min(a, b), i8)*(size(mesh%x, 2) + 1_i8) + max(a, b)
      end do
    end do
    order = sorted_order(key)
    if (allocated(mesh%mate)) deallocate (mesh%mate)
    allocate (mesh%mate(3, n), source=0)
    mesh%rim = 0
    k = 1
    do while (k <= 3*n)
      length = 1
      do while (k + length <= 3*n)
        if (key(order(k + length)) /= key(order(k))) exit
        length = length + 1
      end do
      if (length == 1) mesh%rim = mesh%rim + 1
      if (length == 2) call join_edge(mesh, order(k), order(k + 1), wrong)
      if (length > 2) then
        call errors%add('I225', &
          mesh%name//': '//str(length)//' triangles share one edge, among '// &
                        'them '//str(1 + (order(k) - 1)/3)//', '//str(1 + (order(k + 1) - 1)/3)// &
                        ' and '//str(1 + (order(k + 2) - 1)/3), mesh%name, &
                        'remove duplicate triangles; give fins a surface of their own')
        return
      end if
      k = k + length
    end do
    if (.not. any(wrong > 0)) return
    k = maxloc(wrong, 1)
    call errors%add('I224', &
      mesh%name//': triangle '//str(k)//' is flipped: it turns the other way '// &
                    'than '//str(wrong(k))//' of its neighbours', mesh%name, &
                    'exchange two of its corners; all normals must point to one side')
  end subroutine find_mates

  !> Two triangles at an edge, as places in the list of edges; they pass it in opposite directions.
  pure subroutine join_edge(mesh, first, second, wrong)
    type(mesh_type), intent(inout) :: mesh
    integer(i4), intent(in) :: first, second
    integer(i4), intent(inout) :: wrong(:)
    integer(i4) :: a, b, ea, eb
    a = 1 + (first - 1)/3
    b = 1 + (second - 1)/3
    ea = first - 3*(a - 1)
    eb = second - 3*(b - 1)
    mesh%mate(ea, a) = b
    mesh%mate(eb, b) = a
    if (mesh%corner(ea, a) /= mesh%corner(eb, b)) return
    wrong(a) = wrong(a) + 1
    wrong(b) = wrong(b) + 1
  end subroutine join_edge
end module dem_surface_make
