!> Room for surfaces: bodies added one by one, or of given sizes at once; and their values set from
!! outside of a step: places, motion, what grains have done to them. Within a step they are moved by
!! dem_surface_motion, dem_surface_body and dem_membrane.
module dem_surface_values
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type
  use dem_surface_make, only: mesh_type, round_type
  use dem_surface_state, only: dem_surfaces_type, surface_cone, surface_soft, surface_membrane, &
    surface_cylinder, surface_bore, servo_velocity
  implicit none
  private
  public :: surface_sizes_type, make_room, add_mesh, add_cone, add_cylinder
  public :: mark_reference, set_reference, set_places, copy_places, set_radii
  public :: set_velocity, set_velocities, set_swell, copy_velocities
  public :: set_vertices, aim_vertices, set_aimed, set_vertex_velocities
  public :: set_sums, set_vertex_loads, set_press, set_servos, stop_servos

  type :: surface_sizes_type
    integer(i4) :: bodies = 0, parts = 0, vertices = 0, triangles = 0
    integer(i4) :: fan = 0       !! neighbours of all vertices
    logical :: soft = .false.    !! there are soft bodies
  end type surface_sizes_type

contains

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
    call mark_reference(s)
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
    call mark_reference(s)
  end subroutine add_round

  !> Everything that a body of any kind has, at rest.
  subroutine add_body(s, name, kind, centre, material)
    type(dem_surfaces_type), intent(inout) :: s
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind, material(:)
    real(wp), intent(in) :: centre(3)
    real(wp) :: zero(3, 1), up(3, 1), turn(4, 1)
    real(wp), allocatable :: sums(:, :)

    if (s%n == 0) call make_room(s, surface_sizes_type())
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
    s%quat = joined(s%quat, turn)
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

  !> Room for surfaces of these sizes, all values zero, in place of what there was.
  subroutine make_room(s, sizes)
    type(dem_surfaces_type), intent(inout) :: s
    type(surface_sizes_type), intent(in) :: sizes
    type(dem_surfaces_type) :: fresh

    s = fresh
    s%n = sizes%bodies
    s%parts = sizes%parts
    s%mesh%vertices = sizes%vertices
    s%mesh%triangles = sizes%triangles
    s%soft = sizes%soft
    associate (n => s%n, parts => s%parts, vertices => s%mesh%vertices, &
               triangles => s%mesh%triangles)
      allocate (s%name(n), s%kind(n), s%material(parts))
      allocate (s%first_part(n + 1), s%first_vertex(n + 1), s%first_triangle(n + 1), &
                s%mesh%fan_start(vertices + 1), source=1_i4)
      allocate (s%cos_smooth(n), s%reach(n), s%round%sine(n), s%round%cosine(n), &
                s%round%radius(n), s%round%extent(n), s%round%swell(n), s%round%press(n), &
                s%round%press_impulse(n), s%round%listed_radius(n), s%round%start_radius(n), &
                s%sums%work(parts), source=0.0_wp)
      allocate (s%centre(3, n), s%velocity(3, n), s%spin(3, n), s%quat(4, n), &
                s%round%rest_axis(3, n), s%round%axis(3, n), s%sums%force(3, parts), &
                s%sums%moment(3, parts), s%sums%impulse(3, parts), &
                s%sums%moment_impulse(3, parts), s%mesh%rest(3, vertices), &
                s%mesh%x(3, vertices), s%mesh%v(3, vertices), s%mesh%target(3, vertices), &
                s%mesh%force(3, vertices), s%mesh%impulse(3, vertices), source=0.0_wp)
      allocate (s%mesh%home(vertices), s%mesh%fan(sizes%fan))
      allocate (s%mesh%corner(3, triangles), s%mesh%owner(triangles), s%mesh%mate(3, triangles))
    end associate
    call mark_reference(s)
  end subroutine make_room

  !> The list of what is near was made here: travel counts from the places of now.
  pure subroutine mark_reference(s)
    type(dem_surfaces_type), intent(inout) :: s
    s%reference_x = s%centre
    s%reference_q = s%quat
    s%mesh%reference = s%mesh%x
    s%round%listed_radius = s%round%radius
  end subroutine mark_reference

  !> The list was made where a checkpoint says.
  pure subroutine set_reference(s, x, q, vertices)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: x(:, :)         !! (3, bodies) centres [m]
    real(wp), intent(in) :: q(:, :)         !! (4, bodies) turns [-]
    real(wp), intent(in) :: vertices(:, :)  !! (3, vertices) [m]
    s%reference_x = x
    s%reference_q = q
    s%mesh%reference = vertices
  end subroutine set_reference

  !> Where all bodies are.
  pure subroutine set_places(s, centre, quat, axis)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: centre(:, :)  !! (3, bodies) [m]
    real(wp), intent(in) :: quat(:, :)    !! (4, bodies) turns since the start [-]
    real(wp), intent(in) :: axis(:, :)    !! (3, bodies) of cones and cylinders [-]
    s%centre = centre
    s%quat = quat
    s%round%axis = axis
  end subroutine set_places

  !> Where the bodies and vertices of other surfaces of the same sizes are.
  pure subroutine copy_places(from, s)
    type(dem_surfaces_type), intent(in) :: from
    type(dem_surfaces_type), intent(inout) :: s
    call set_places(s, from%centre, from%quat, from%round%axis)
    s%mesh%x = from%mesh%x
    s%round%radius = from%round%radius
  end subroutine copy_places

  !> How body b moves.
  pure subroutine set_velocity(s, b, velocity, spin)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: velocity(3)        !! of the centre [m/s]
    real(wp), intent(in), optional :: spin(3)  !! absent: as before [rad/s]
    s%velocity(:, b) = velocity
    if (present(spin)) s%spin(:, b) = spin
  end subroutine set_velocity

  !> How all bodies move.
  pure subroutine set_velocities(s, velocity, spin)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: velocity(:, :)  !! (3, bodies) of the centres [m/s]
    real(wp), intent(in) :: spin(:, :)      !! (3, bodies) [rad/s]
    s%velocity = velocity
    s%spin = spin
  end subroutine set_velocities

  !> The radius of cylinder b grows by so much a second [m/s].
  pure subroutine set_swell(s, b, speed)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: speed
    s%round%swell(b) = speed
  end subroutine set_swell

  !> How bodies, walls of bores and vertices of soft bodies move, as other surfaces do.
  pure subroutine copy_velocities(from, s)
    type(dem_surfaces_type), intent(in) :: from
    type(dem_surfaces_type), intent(inout) :: s
    call set_velocities(s, from%velocity, from%spin)
    s%round%swell = from%round%swell
    if (.not. s%soft) return
    call set_vertex_velocities(s, from%mesh%v)
    s%mesh%target = from%mesh%target
    call set_aimed(s, from%mesh%has_target)
  end subroutine copy_velocities

  !> Do vertices of soft bodies end exactly on their targets?
  pure subroutine set_aimed(s, aimed)
    type(dem_surfaces_type), intent(inout) :: s
    logical, intent(in) :: aimed
    s%mesh%has_target = aimed
  end subroutine set_aimed

  !> How all vertices of soft bodies move (3, vertices) [m/s].
  pure subroutine set_vertex_velocities(s, v)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: v(:, :)
    s%mesh%v = v
  end subroutine set_vertex_velocities

  !> Vertices from low on are at target at the end of an interval, at constant velocity.
  pure subroutine aim_vertices(s, low, v, target)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: low
    real(wp), intent(in) :: v(:, :)       !! (3, vertices) [m/s]
    real(wp), intent(in) :: target(:, :)  !! (3, vertices) [m]
    integer(i4) :: high
    high = low + size(v, 2, i4) - 1
    s%mesh%v(:, low:high) = v
    s%mesh%target(:, low:high) = target
    call set_aimed(s, .true.)
  end subroutine aim_vertices

  !> Vertices from low on are there now and move so, without a target.
  pure subroutine set_vertices(s, low, x, v)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: low
    real(wp), intent(in) :: x(:, :)  !! (3, vertices) [m]
    real(wp), intent(in) :: v(:, :)  !! (3, vertices) [m/s]
    integer(i4) :: high
    high = low + size(v, 2, i4) - 1
    s%mesh%x(:, low:high) = x
    s%mesh%v(:, low:high) = v
    s%mesh%target(:, low:high) = x
    call set_aimed(s, .false.)
  end subroutine set_vertices

  !> What grains do to the parts of bodies.
  pure subroutine set_sums(s, sums, work)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: sums(:, :, :)  !! (3, parts, 4) force, moment, impulse, moment_impulse
    real(wp), intent(in) :: work(:)        !! (parts) since reset [J]
    s%sums%force = sums(:, :, 1)
    s%sums%moment = sums(:, :, 2)
    s%sums%impulse = sums(:, :, 3)
    s%sums%moment_impulse = sums(:, :, 4)
    s%sums%work = work
  end subroutine set_sums

  !> What grains do to vertices.
  pure subroutine set_vertex_loads(s, force, impulse)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: force(:, :)    !! (3, vertices) [N]
    real(wp), intent(in) :: impulse(:, :)  !! (3, vertices) since reset [N s]
    s%mesh%force = force
    s%mesh%impulse = impulse
  end subroutine set_vertex_loads

  !> What grains do to walls of cylinders.
  pure subroutine set_press(s, press, impulse)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: press(:)    !! (bodies) normal forces, summed [N]
    real(wp), intent(in) :: impulse(:)  !! (bodies) since reset [N s]
    s%round%press = press
    s%round%press_impulse = impulse
  end subroutine set_press

  !> Radii of cylinders [m]: now, when the list was made, at the start (bodies).
  pure subroutine set_radii(s, radius, listed, start)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: radius(:), listed(:), start(:)
    s%round%radius = radius
    s%round%listed_radius = listed
    s%round%start_radius = start
  end subroutine set_radii

  !> Last updates of servos (servo_size, bodies), of a checkpoint.
  pure subroutine set_servos(s, rows)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: rows(:, :)
    s%servo = rows
  end subroutine set_servos

  !> No surface has a velocity from a servo.
  pure subroutine stop_servos(s)
    type(dem_surfaces_type), intent(inout) :: s
    if (allocated(s%servo)) s%servo(servo_velocity:, :) = 0.0_wp
    s%round%swell = 0.0_wp
  end subroutine stop_servos
end module dem_surface_values
