!> Surfaces from triangles: corners joined to vertices, neighbours across edges, bodies added one by
!! one. Faults I223 to I226 name the triangle by its number in the file.
module dem_surface_make
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use dem_make, only: sorted_order
  use dem_surface_state, only: dem_surfaces_type, surface_cone, surface_soft, &
    surface_membrane, surface_cylinder, surface_bore
  implicit none
  private
  public :: mesh_type, round_type, join_corners, check_mesh, add_mesh, add_cone, add_cylinder

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

  !> One more body of triangles.
  subroutine add_mesh(s, mesh, name, kind, material, cos_smooth, centre)
    type(dem_surfaces_type), intent(inout) :: s
    type(mesh_type), intent(in) :: mesh
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind, material
    real(wp), intent(in) :: cos_smooth, centre(3)
    real(wp), allocatable :: zero(:, :)
    integer(i4) :: k

    call add_body(s, name, kind, centre, [material])
    s%cos_smooth(s%n) = cos_smooth
    allocate (zero(3, size(mesh%x, 2)), source=0.0_wp)
    s%mesh%corner = reshape([s%mesh%corner, mesh%corner + s%mesh%vertices], &
      [3, s%mesh%triangles + size(mesh%corner, 2)])
    s%mesh%mate = reshape([s%mesh%mate, merge(mesh%mate + s%mesh%triangles, 0, mesh%mate > 0)], &
                     [3, s%mesh%triangles + size(mesh%corner, 2)])
    s%mesh%owner = [s%mesh%owner, spread(s%n, 1, size(mesh%corner, 2))]
    s%mesh%x = joined(s%mesh%x, mesh%x)
    s%mesh%rest = joined(s%mesh%rest, mesh%x - spread(centre, 2, size(mesh%x, 2)))
    s%mesh%v = joined(s%mesh%v, zero)
    s%mesh%target = s%mesh%x
    s%mesh%reference = s%mesh%x
    s%mesh%force = joined(s%mesh%force, zero)
    s%mesh%impulse = joined(s%mesh%impulse, zero)
    do k = s%mesh%vertices + 1, size(s%mesh%x, 2)
      s%reach(s%n) = max(s%reach(s%n), sqrt(sum(s%mesh%rest(:, k)**2)))
    end do
    s%mesh%vertices = size(s%mesh%x, 2)
    s%mesh%triangles = size(s%mesh%corner, 2)
    s%first_vertex(s%n + 1) = s%mesh%vertices + 1
    s%first_triangle(s%n + 1) = s%mesh%triangles + 1
    call find_fans(s)
  end subroutine add_mesh

  pure function joined(a, b) result(c)
    real(wp), intent(in) :: a(:, :), b(:, :)
    real(wp) :: c(size(a, 1), size(a, 2) + size(b, 2))
    c(:, :size(a, 2)) = a
    c(:, size(a, 2) + 1:) = b
  end function joined

  !> Neighbours of each vertex along edges, and its lowest triangle.
  subroutine find_fans(s)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), allocatable :: ends(:, :), next(:)
    integer(i4) :: k, j

    if (allocated(s%mesh%fan_start)) deallocate (s%mesh%fan_start, s%mesh%fan, s%mesh%home)
    allocate (s%mesh%fan_start(s%mesh%vertices + 1), s%mesh%home(s%mesh%vertices), source=0)
    do k = s%mesh%triangles, 1, -1
      s%mesh%home(s%mesh%corner(:, k)) = k
    end do
    ends = edges_of(s)
    associate (start => s%mesh%fan_start)
      do k = 1, size(ends, 2)
        start(ends(:, k) + 1) = start(ends(:, k) + 1) + 1
      end do
      start(1) = 1
      do k = 2, s%mesh%vertices + 1
        start(k) = start(k) + start(k - 1)
      end do
      next = start
      allocate (s%mesh%fan(start(s%mesh%vertices + 1) - 1))
    end associate
    do k = 1, size(ends, 2)
      do j = 1, 2
        s%mesh%fan(next(ends(j, k))) = ends(3 - j, k)
        next(ends(j, k)) = next(ends(j, k)) + 1
      end do
    end do
  end subroutine find_fans

  !> The vertices at both ends of every edge, in the order of the triangles (2, edges).
  pure function edges_of(s) result(ends)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), allocatable :: ends(:, :)
    integer(i4) :: k, e, n

    allocate (ends(2, 3*s%mesh%triangles))
    n = 0
    do k = 1, s%mesh%triangles
      do e = 1, 3
        if (s%mesh%mate(e, k) > 0 .and. s%mesh%mate(e, k) < k) cycle
        n = n + 1
        ends(:, n) = [s%mesh%corner(e, k), s%mesh%corner(1 + mod(e, 3), k)]
      end do
    end do
    ends = ends(:, :n)
  end function edges_of

  !> A cone on a cylinder, the tip at the centre.
  subroutine add_cone(s, name, material, shaft, half_angle)
    type(dem_surfaces_type), intent(inout) :: s
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: material(3)           !! of tip, flank, shaft
    type(round_type), intent(in) :: shaft
    real(wp), intent(in) :: half_angle               !! of the apex [rad]

    call add_round(s, name, surface_cone, material, shaft)
    s%round%sine(s%n) = sin(half_angle)
    s%round%cosine(s%n) = cos(half_angle)
    s%reach(s%n) = shaft%radius/tan(half_angle) + shaft%length + shaft%radius
  end subroutine add_cone

  !> A cylinder around its centre; grains are outside, or inside.
  subroutine add_cylinder(s, name, material, cylinder, inside)
    type(dem_surfaces_type), intent(inout) :: s
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: material
    type(round_type), intent(in) :: cylinder
    logical, intent(in) :: inside

    call add_round(s, name, merge(surface_bore, surface_cylinder, inside), &
                   [material, material], cylinder)
    s%round%listed_radius(s%n) = cylinder%radius
    s%round%start_radius(s%n) = cylinder%radius
    s%reach(s%n) = cylinder%radius
    if (cylinder%length < huge(cylinder%length)) &
      s%reach(s%n) = sqrt(cylinder%radius**2 + cylinder%length**2)
  end subroutine add_cylinder

  !> What cones and cylinders have in common.
  subroutine add_round(s, name, kind, material, round)
    type(dem_surfaces_type), intent(inout) :: s
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind, material(:)
    type(round_type), intent(in) :: round

    call add_body(s, name, kind, round%centre, material)
    s%round%rest_axis(:, s%n) = round%axis/sqrt(sum(round%axis**2))
    s%round%axis(:, s%n) = s%round%rest_axis(:, s%n)
    s%round%radius(s%n) = round%radius
    s%round%extent(s%n) = round%length
  end subroutine add_round

  !> Everything that a body of any kind has, at rest.
  subroutine add_body(s, name, kind, centre, material)
    type(dem_surfaces_type), intent(inout) :: s
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind, material(:)
    real(wp), intent(in) :: centre(3)
    real(wp) :: zero(3, 1), up(3, 1), turn(4, 1)
    real(wp), allocatable :: sums(:, :)

    if (s%n == 0) call start_empty(s)
    s%soft = s%soft .or. kind == surface_soft .or. kind == surface_membrane
    zero = 0.0_wp
    up = reshape([0.0_wp, 0.0_wp, 1.0_wp], [3, 1])
    turn = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1])
    s%n = s%n + 1
    call add_name(s, name)
    s%kind = [s%kind, kind]
    s%cos_smooth = [s%cos_smooth, 1.0_wp]
    s%reach = [s%reach, 0.0_wp]
    s%centre = joined(s%centre, reshape(centre, [3, 1]))
    s%reference_x = s%centre
    s%quat = joined(s%quat, turn)
    s%reference_q = s%quat
    s%velocity = joined(s%velocity, zero)
    s%spin = joined(s%spin, zero)
    s%round%rest_axis = joined(s%round%rest_axis, up)
    s%round%axis = joined(s%round%axis, up)
    s%round%sine = [s%round%sine, 0.0_wp]
    s%round%cosine = [s%round%cosine, 1.0_wp]
    s%round%radius = [s%round%radius, 0.0_wp]
    s%round%extent = [s%round%extent, 0.0_wp]
    s%round%swell = [s%round%swell, 0.0_wp]
    s%round%press = [s%round%press, 0.0_wp]
    s%round%press_impulse = [s%round%press_impulse, 0.0_wp]
    s%round%listed_radius = [s%round%listed_radius, 0.0_wp]
    s%round%start_radius = [s%round%start_radius, 0.0_wp]
    s%first_vertex = [s%first_vertex, s%mesh%vertices + 1]
    s%first_triangle = [s%first_triangle, s%mesh%triangles + 1]
    s%parts = s%parts + size(material)
    s%first_part = [s%first_part, s%parts + 1]
    s%material = [s%material, material]
    allocate (sums(3, size(material)), source=0.0_wp)
    s%sums%force = joined(s%sums%force, sums)
    s%sums%moment = joined(s%sums%moment, sums)
    s%sums%impulse = joined(s%sums%impulse, sums)
    s%sums%moment_impulse = joined(s%sums%moment_impulse, sums)
    s%sums%work = [s%sums%work, sums(1, :)]
  end subroutine add_body

  subroutine add_name(s, name)
    type(dem_surfaces_type), intent(inout) :: s
    character(len=*), intent(in) :: name
    type(string_type), allocatable :: longer(:)
    integer(i4) :: k
    allocate (longer(s%n))
    do k = 1, s%n - 1
      longer(k)%s = s%name(k)%s
    end do
    longer(s%n)%s = name
    call move_alloc(longer, s%name)
  end subroutine add_name

  subroutine start_empty(s)
    type(dem_surfaces_type), intent(inout) :: s
    allocate (s%name(0))
    allocate (s%kind(0), s%first_part(1), s%first_vertex(1), s%first_triangle(1), s%material(0))
    s%first_part = 1
    s%first_vertex = 1
    s%first_triangle = 1
    allocate (s%cos_smooth(0), s%reach(0), s%sums%work(0))
    allocate (s%centre(3, 0), s%quat(4, 0), s%velocity(3, 0), s%spin(3, 0), &
              s%round%rest_axis(3, 0), s%round%axis(3, 0), s%sums%force(3, 0), &
              s%sums%moment(3, 0), s%sums%impulse(3, 0), s%sums%moment_impulse(3, 0), &
              s%mesh%rest(3, 0), s%mesh%x(3, 0), s%mesh%v(3, 0), s%mesh%force(3, 0), &
              s%mesh%impulse(3, 0), s%mesh%target(3, 0), s%mesh%reference(3, 0))
    allocate (s%mesh%corner(3, 0), s%mesh%mate(3, 0), s%mesh%owner(0))
    allocate (s%round%sine(0), s%round%cosine(0), s%round%radius(0), s%round%extent(0), &
              s%round%swell(0), s%round%press(0), s%round%press_impulse(0), &
              s%round%listed_radius(0), s%round%start_radius(0))
  end subroutine start_empty
end module dem_surface_make
