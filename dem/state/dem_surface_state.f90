!> Data of surfaces: bodies and their motion; as components the triangles, the exact round bodies,
!! the forces of grains on bodies, free bodies, membranes, and the current contacts. Plain arrays.
module dem_surface_state
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type
  implicit none
  private
  public :: dem_surfaces_type, surface_rigid, surface_soft, surface_cone
  public :: dem_membranes_type, surface_membrane, is_soft, first_corner
  public :: surface_cylinder, surface_bore, part_side, part_end, is_bore, is_cylinder, is_round
  public :: dem_touches_type
  public :: part_tip, part_flank, part_shaft, soft_smooth, servo_size, servo_velocity

  integer(i4), parameter :: surface_rigid = 1  !! triangles that move as one body
  integer(i4), parameter :: surface_soft = 2   !! triangles whose vertices a partner moves
  integer(i4), parameter :: surface_cone = 3   !! cone on a cylinder, exact

  integer(i4), parameter :: surface_cylinder = 4  !! cylinder, exact, grains outside

  integer(i4), parameter :: surface_membrane = 5  !! triangles whose vertices have masses

  integer(i4), parameter :: surface_bore = 6  !! cylinder, exact, grains inside; no ends

  integer(i4), parameter :: part_side = 0, part_end = 1  !! of a cylinder
  integer(i4), parameter :: part_tip = 0, part_flank = 1, part_shaft = 2  !! of a cone

  !> Rows of a body's servo: see dem_surface_servo; the velocity that it adds is the last row.
  integer(i4), parameter :: servo_size = 10, servo_velocity = 8

  !> Cosine of the smooth angle of soft bodies, 20 degrees, the default of decks.
  real(wp), parameter :: soft_smooth = cos(acos(-1.0_wp)/9.0_wp)

  !> Membranes; bodies, vertices and triangles are those of all surfaces.
  type :: dem_membranes_type
    real(wp), allocatable :: modulus(:)        !! (bodies) E t/(1 - nu^2) [N/m]
    real(wp), allocatable :: poisson(:)        !! (bodies) [-]
    real(wp), allocatable :: pressure(:)       !! (bodies) now [Pa]
    real(wp), allocatable :: side(:)           !! (bodies) 1: it acts along the triangles' normals
    real(wp), allocatable :: damping(:)        !! (bodies) background damping [1/s]
    real(wp), allocatable :: limit(:)          !! (bodies) largest stretch that it bears [-]
    real(wp), allocatable :: stretch(:)        !! (bodies) largest so far [-]
    real(wp), allocatable :: mass(:)           !! (vertices) [kg]
    integer(i4), allocatable :: wall(:)        !! (vertices) that holds it; 0: fixed, -1: free
    real(wp), allocatable :: inverse(:, :, :)  !! (2, 2, triangles) of the edges at the start [1/m]
    real(wp), allocatable :: area(:)           !! (triangles) at the start [m^2]
    real(wp), allocatable :: press(:, :)       !! (3, vertices) of the pressure [N]
    real(wp), allocatable :: pull(:, :)        !! (3, vertices) of the stretch [N]
  end type dem_membranes_type

  !> Triangles of all bodies, and their vertices.
  type :: dem_mesh_type
    integer(i4) :: vertices = 0
    real(wp), allocatable :: rest(:, :)        !! (3, vertices) from the centre at the start [m]
    real(wp), allocatable :: x(:, :)           !! (3, vertices) now [m]
    real(wp), allocatable :: v(:, :)           !! (3, vertices) of soft bodies [m/s]
    logical :: has_target = .false.            !! vertices end exactly on the target
    real(wp), allocatable :: target(:, :)      !! (3, vertices) at the end of the interval [m]
    real(wp), allocatable :: reference(:, :)   !! (3, vertices) where the list was made [m]
    real(wp), allocatable :: force(:, :)       !! (3, vertices) of the grains, soft bodies [N]
    real(wp), allocatable :: impulse(:, :)     !! (3, vertices) its integral since reset [N s]
    real(wp), allocatable :: acting(:, :)      !! (3, vertices) on ranks: what the grains of all of
                                               !! them do to corners of membranes [N]
    integer(i4), allocatable :: home(:)        !! (vertices) lowest triangle at the vertex
    integer(i4), allocatable :: fan_start(:)   !! (vertices+1)
    integer(i4), allocatable :: fan(:)         !! neighbours of each vertex
    integer(i4) :: triangles = 0
    integer(i4), allocatable :: corner(:, :)   !! (3, triangles) vertices, seen against the normal
    integer(i4), allocatable :: owner(:)       !! (triangles) body
    integer(i4), allocatable :: mate(:, :)     !! (3, triangles) across edge k, k+1; 0: none
  end type dem_mesh_type

  !> Cones on a shaft, cylinders and bores; all bodies have a column.
  type :: dem_round_type
    real(wp), allocatable :: rest_axis(:, :)   !! (3, n) at the start; of a cone from the tip up [-]
    real(wp), allocatable :: axis(:, :)        !! (3, n) the same now [-]
    real(wp), allocatable :: sine(:)           !! (n) of half the apex angle of a cone [-]
    real(wp), allocatable :: cosine(:)         !! (n) of the same [-]
    real(wp), allocatable :: radius(:)         !! (n) of the cylinder, the bore or the shaft [m]
    real(wp), allocatable :: extent(:)         !! (n) length of a cone's shaft, half the length of a
                                               !! cylinder or bore [m]
    real(wp), allocatable :: swell(:)          !! (n) velocity of the wall of a bore outwards [m/s]
    real(wp), allocatable :: press(:)          !! (n) normal forces of the grains on it, summed [N]
    real(wp), allocatable :: press_impulse(:)  !! (n) time integral of that since reset [N s]
    real(wp), allocatable :: listed_radius(:)  !! (n) when the list was made [m]
    real(wp), allocatable :: start_radius(:)   !! (n) at the start [m]
  end type dem_round_type

  !> Forces of the grains on the parts of bodies. Forces are sums over the parts' contacts, moments
  !! are about the body's centre.
  type :: dem_body_sums_type
    real(wp), allocatable :: force(:, :)           !! (3, parts) [N]
    real(wp), allocatable :: moment(:, :)          !! (3, parts) [N m]
    real(wp), allocatable :: impulse(:, :)         !! (3, parts) its integral since reset [N s]
    real(wp), allocatable :: moment_impulse(:, :)  !! (3, parts) [N m s]
    real(wp), allocatable :: work(:)               !! (parts) on the grains since reset [J]
  end type dem_body_sums_type

  !> Free rigid bodies, moved by forces.
  type :: dem_rigid_type
    real(wp), allocatable :: free(:, :)     !! (6, n) 1: moves along x, y, z, turns about them by
                                            !! forces; empty: no body does
    real(wp), allocatable :: mass(:)        !! (n) of free bodies, else 0 [kg]
    real(wp), allocatable :: inertia(:, :)  !! (3, n) about the axes of frame [kg m^2]
    real(wp), allocatable :: frame(:, :)    !! (4, n) principal axes at the start, w x y z
    real(wp), allocatable :: given(:, :)    !! (6, n) load: force, moment [N], [N m]
    real(wp), allocatable :: liquid(:, :)   !! (6, n) of a liquid among the grains, none without
                                            !! [N], [N m]
    real(wp), allocatable :: acting(:, :)   !! (6, n) on ranks: what the grains of all of them do to
                                            !! free bodies [N], [N m]
  end type dem_rigid_type

  !> Grains that something is near to, and their contacts.
  type :: dem_touches_type
    integer(i4) :: near = 0                    !! grains with something near
    integer(i4), allocatable :: near_grain(:)  !! (near) ascending
    integer(i4), allocatable :: near_start(:)  !! (near+1)
    integer(i4), allocatable :: candidate(:)   !! triangles, and round bodies as -body
    real(wp), allocatable :: image(:, :)       !! (3, candidates) from the surface to its image that
                                               !! is near, in a periodic cell [m]
    real(wp), allocatable :: least_gap(:)      !! (near) of bounding spheres, at the list [m]
    integer(i4), allocatable :: near_of(:)     !! (grains) place among the near ones, or 0
    integer(i4), allocatable :: contacts(:)    !! (near)
    integer(i4) :: slots = 0                   !! contacts of a grain that there is room for, a
                                               !! multiple of lanes
    real(wp), allocatable :: sign(:, :)        !! (slots, near) see dem_membrane_find [-]
    real(wp), allocatable :: history(:, :, :)  !! (slots, history_size, near), see dem_contact
    real(wp), allocatable :: foot(:, :, :)     !! (slots, 3, near) contact point, surface [m]
    real(wp), allocatable :: normal(:, :, :)   !! (slots, 3, near) surface to grain [-]
    real(wp), allocatable :: point(:, :, :)    !! (slots, 3, near) where the force acts [m]
    real(wp), allocatable :: push(:, :, :)     !! (slots, 3, near) force on the grain [N]
    real(wp), allocatable :: motion(:, :, :)   !! (slots, 6, near) velocity, spin of the surface
    integer(i4), allocatable :: part(:, :)     !! (slots, near)
    real(wp), allocatable :: offset(:, :, :)   !! (slots, 3, near) from the surface to the image of
                                               !! the contact [m]
    real(wp), allocatable :: kept(:, :, :)     !! (slots, reals, near) for additional models, none
                                               !! without them; see dem_additional_state
    real(wp), allocatable :: couple(:, :, :)   !! (slots, 3, near) on the grain besides the force
                                               !! [N m]; none without such models
    real(wp), allocatable :: additional_work(:, :)  !! (additional_work_count, near) of the step
    real(wp), allocatable :: load(:, :)        !! (6, near) on the grain, about its centre
    real(wp), allocatable :: columns(:, :)     !! (column_count, near) work of the step [J]
    real(wp), allocatable :: share(:, :)       !! (3, 3*candidates) on corners of soft triangles
  end type dem_touches_type

  !> All surfaces. A body has one part, a cone three: tip, flank of the cone, shaft.
  type :: dem_surfaces_type
    integer(i4) :: n = 0                           !! bodies
    type(string_type), allocatable :: name(:)      !! (n)
    integer(i4), allocatable :: kind(:)            !! (n) surface_...
    real(wp), allocatable :: cos_smooth(:)         !! (n) edges bent by less are of one face [-]
    integer(i4) :: parts = 0
    integer(i4), allocatable :: material(:)        !! (parts)
    integer(i4), allocatable :: first_part(:)      !! (n+1)
    integer(i4), allocatable :: first_vertex(:)    !! (n+1)
    integer(i4), allocatable :: first_triangle(:)  !! (n+1)
    logical :: soft = .false.                      !! there are soft bodies

    real(wp), allocatable :: centre(:, :)          !! (3, n) [m]
    real(wp), allocatable :: quat(:, :)            !! (4, n) turn since the start [-]
    real(wp), allocatable :: velocity(:, :)        !! (3, n) of the centre [m/s]
    real(wp), allocatable :: spin(:, :)            !! (3, n) about the centre [rad/s]
    real(wp), allocatable :: reach(:)              !! (n) farthest point from the centre [m]
    real(wp), allocatable :: reference_x(:, :)     !! (3, n) centre where the list was made [m]
    real(wp), allocatable :: reference_q(:, :)     !! (4, n) turn then [-]
    real(wp), allocatable :: servo(:, :)           !! (servo_size, n) last update of servos, if any
    logical :: counted = .true.                    !! this rank counts works of free bodies and of
                                                   !! membranes, and works the contacts of free
                                                   !! bodies with prescribed grains

    type(dem_mesh_type) :: mesh
    type(dem_round_type) :: round
    type(dem_body_sums_type) :: sums
    type(dem_rigid_type) :: rigid
    type(dem_touches_type) :: list
    type(dem_membranes_type), allocatable :: membranes
  end type dem_surfaces_type

contains

  !> Do the vertices of body b move one by one?
  pure logical function is_soft(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    is_soft = s%kind(b) == surface_soft .or. s%kind(b) == surface_membrane
  end function is_soft

  !> First vertex of the membranes, which are the last surfaces.
  pure integer(i4) function first_corner(s)
    type(dem_surfaces_type), intent(in) :: s
    first_corner = minval(s%first_vertex(:s%n), mask=s%kind == surface_membrane)
  end function first_corner

  !> Is body b a cylinder with grains inside?
  pure logical function is_bore(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    is_bore = s%kind(b) == surface_bore
  end function is_bore

  !> Is body b a cylinder with grains outside or inside?
  pure logical function is_cylinder(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    is_cylinder = s%kind(b) == surface_cylinder .or. s%kind(b) == surface_bore
  end function is_cylinder

  !> Has body b an exact shape, and no triangles?
  pure logical function is_round(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    is_round = s%kind(b) == surface_cone .or. is_cylinder(s, b)
  end function is_round
end module dem_surface_state
