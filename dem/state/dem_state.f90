!> Data of a system of grains: grains, planes, contact laws, candidate pairs, parameters, energy
!! ledger, health counters. Plain arrays, no behaviour (theory-dem).
module dem_state
  use talus_kinds, only: wp, i4, i8
  use dem_sizes, only: lanes
  use dem_shape_state, only: dem_shapes_type
  use dem_law_state, only: dem_material_type, dem_law_type, history_size, history_side, &
    history_root, history_point, column_count
  use dem_additional_state, only: dem_additional_type
  use dem_surface_state, only: dem_surfaces_type
  use dem_feature_state, only: dem_features_type
  use dem_halo_state, only: dem_halo_type
  use dem_pore_state, only: dem_pore_type
  use dem_exact_state, only: dem_exact_type
  use dem_wear_state, only: dem_wear_type
  use dem_heat_state, only: dem_heat_type
  implicit none
  private
  public :: dem_grains_type, dem_planes_type, dem_law_type, dem_material_type, dem_pairs_type
  public :: dem_parameters_type, dem_ledger_type, dem_health_type, dem_weights_type, dem_data_type
  public :: dem_cell_type, dem_parts_type, dem_pore_type, dem_clumps_type
  public :: copy_data, keep_data
  public :: kind_free, kind_fixed, kind_driven, kind_ghost, kind_mirror, kind_member
  public :: mode_dynamic, mode_relaxation
  public :: lanes, body_size, history_size, result_size, column_count
  public :: servo_seen_size, surcharge_seen_size, fed_size, drained_size, window_size, crushed_size
  public :: graded_size, grown_size
  public :: entries_ahead, history_side, history_root, history_point

  integer(i4), parameter :: kind_free = 0    !! moved by the forces on it
  integer(i4), parameter :: kind_fixed = 1   !! never moves
  integer(i4), parameter :: kind_driven = 2  !! moved by the deck
  integer(i4), parameter :: kind_ghost = 3   !! moved by the port
  integer(i4), parameter :: kind_mirror = 4  !! a free grain of another rank
  integer(i4), parameter :: kind_member = 5  !! a sphere of a clump, which forces move

  integer(i4), parameter :: mode_dynamic = 1, mode_relaxation = 2

  integer(i4), parameter :: body_size = 16     !! reals in a body record, see dem_pairs_type
  integer(i4), parameter :: result_size = 8    !! force, moment about the origin, two spare

  integer(i4), parameter :: servo_seen_size = 7      !! impulse, time, stress, target of
                                                     !! the last update, v_i
  integer(i4), parameter :: surcharge_seen_size = 8  !! see dem_surcharge
  integer(i4), parameter :: fed_size = 4             !! see dem_sources
  integer(i4), parameter :: drained_size = 6         !! see dem_sinks
  integer(i4), parameter :: window_size = 5          !! see dem_window
  integer(i4), parameter :: crushed_size = 10        !! see dem_breakage
  integer(i4), parameter :: grown_size = 5           !! see dem_breakage_growth
  integer(i4), parameter :: graded_size = 4          !! see dem_grading
  integer(i4), parameter :: entries_ahead = 48  !! spare entries that sums may read

  !> All grains, in ascending order of id. Arrays are (components, grains).
  type :: dem_grains_type
    integer(i4) :: n = 0                           !! number of grains
    integer(i8), allocatable :: id(:)              !! identity, ascending
    integer(i4), allocatable :: kind(:)            !! kind_...
    integer(i4), allocatable :: material(:)        !! index into the materials
    real(wp), allocatable :: x(:, :)               !! centre [m]
    real(wp), allocatable :: quat(:, :)            !! orientation w,x,y,z: body to space [-]
    real(wp), allocatable :: v(:, :)               !! velocity [m/s]
    real(wp), allocatable :: omega(:, :)           !! spin, space frame [rad/s]
    real(wp), allocatable :: axes(:, :)            !! semi-axes a, b, c; of shapes those of an
                                                   !! ellipsoid of the same volume [m]
    real(wp), allocatable :: radius(:)             !! of the bounding sphere [m]
    real(wp), allocatable :: mass(:)               !! unscaled mass [kg]
    real(wp), allocatable :: inertia(:, :)         !! principal moments, body frame [kg m^2]
    real(wp), allocatable :: force(:, :)           !! contact force, no gravity [N]
    real(wp), allocatable :: moment(:, :)          !! contact moment about the centre [N m]
    real(wp), allocatable :: theta(:, :)           !! accumulated rotation [rad]
    real(wp), allocatable :: extra_force(:, :)     !! held external force on free grains [N]
    real(wp), allocatable :: extra_moment(:, :)    !! held external moment on free grains [N m]
    integer(i4), allocatable :: clump(:)           !! of members of clumps, 0 of others; not
                                                   !! there without clumps
    type(dem_shapes_type) :: shapes                  !! of grains that are no ellipsoids
    ! What only prescribed grains have: no columns as long as all grains are free (dem_make).
    real(wp), allocatable :: impulse(:, :)         !! time integral of force since reset [N s]
    real(wp), allocatable :: moment_impulse(:, :)  !! time integral of moment since reset [N m s]
    real(wp), allocatable :: work(:)               !! work of the prescription since reset [J]
    logical, allocatable :: has_target(:)          !! prescribed to end exactly on the target
    real(wp), allocatable :: target_x(:, :)        !! centre at the end of the interval [m]
    real(wp), allocatable :: target_quat(:, :)     !! orientation at the end of the interval [-]
    real(wp), allocatable :: turn(:, :)            !! rotation of one sub-step, quaternion [-]
  end type dem_grains_type

  !> Infinite planes; grains are on the side to which the normal points.
  type :: dem_planes_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: material(:)
    real(wp), allocatable :: point(:, :)     !! a point of the plane, moves with it [m]
    real(wp), allocatable :: normal(:, :)    !! unit normal, into the grains [-]
    real(wp), allocatable :: velocity(:, :)  !! [m/s]
    real(wp), allocatable :: force(:, :)     !! of the grains on the plane [N]
    real(wp), allocatable :: moment(:, :)    !! of that about the plane's point [N m]
    real(wp), allocatable :: impulse(:, :)   !! time integral of the force since reset [N s]
    real(wp), allocatable :: work(:)         !! of the plane on the grains since reset [J]
  end type dem_planes_type

  !> Candidate pairs in blocks, their cached normals and contact history.
  !!
  !! Bodies 1..n are grains, n+1 and n+2 pads far away, n+3 a pad plane, n+3+k is plane k; images of
  !! grains in a periodic cell follow, ordered by their grain, then by their shift. A pair of grains
  !! has the lower id as itself and, where it reaches over a face, an image of the other.
  !! A body record: x(3), v(3), omega(3), A = Q diag(a^2,b^2,c^2) Q^T as xx yy zz xy yz zx,
  !! (a b c)^2; planes use x and v only. Blocks come in groups of one law, one kind of geometry and
  !! one band of gaps; a slot is lanes (block - 1) + lane, counted on through all blocks.
  type :: dem_pairs_type
    integer(i4) :: blocks = 0                    !! blocks in use
    integer(i4) :: grain_blocks = 0              !! of these, grain-grain (the first ones)
    integer(i4) :: bare_blocks = 0               !! of these, without ghosts (the first ones)
    integer(i4) :: rim_blocks = 0                !! these and those of a ghost and another grain
    logical :: keep_results = .false.            !! pairs keep their forces in a new list
    integer(i4) :: groups = 0                    !! groups of blocks
    integer(i4) :: count = 0                     !! real pairs, pads not counted
    real(wp) :: skin = 0.0_wp                    !! pairs with a gap below it are listed [m]
    real(wp) :: least_skin = 0.0_wp              !! the skin grows above it while grains move [m]
    real(wp) :: most_skin = 0.0_wp               !! and never beyond this [m]
    integer(i8) :: built_at = 0                  !! step of the last rebuild
    integer(i4), allocatable :: group_end(:)     !! (groups) last block of each
    logical, allocatable :: round(:)             !! (blocks) all pairs are of spheres
    integer(i4), allocatable :: shape(:)          !! (blocks) greatest kind, see dem_shape_state
    real(wp), allocatable :: least_gap(:)        !! (blocks) when the list was made [m]
    real(wp), allocatable :: share(:)            !! (blocks) of their work that is this rank's [-];
                                                 !! none: all of it
    integer(i4), allocatable :: first(:, :)      !! (lanes, blocks) body A, the lower id
    integer(i4), allocatable :: second(:, :)     !! (lanes, blocks) body B
    integer(i4), allocatable :: law_first(:)     !! (blocks) material of A
    integer(i4), allocatable :: law_second(:)    !! (blocks) material of B
    real(wp), allocatable :: normal(:, :, :)     !! (lanes, 3, blocks) last normal, A to B [-]; not
                                                 !! kept up for spheres
    real(wp), allocatable :: history(:, :, :)    !! (lanes, history_size, blocks), see dem_contact
    real(wp), allocatable :: weight(:, :)        !! (lanes, blocks) contact weight; one column of
                                                 !! ones if none was set [-]
    real(wp), allocatable :: m_star(:, :)        !! (lanes, blocks) reduced mass m* [kg]
    logical, allocatable :: touched(:)           !! (blocks) some lane had contact last time
    real(wp), allocatable :: result(:, :)        !! (result_size, slots) on B [N, N m]
    integer(i4) :: past = 0                      !! 1: too much for the caches, see dem_lanes
    real(wp), allocatable :: columns(:, :)       !! (column_count, blocks) work of this step [J]
    real(wp) :: shallow = huge(1.0_wp)           !! an overlap up to it is within the limit [m]
    real(wp), allocatable :: body(:, :)          !! (body_size, bodies) records
    real(wp), allocatable :: reference_x(:, :)   !! (3, bodies) where the list was made [m]
    real(wp), allocatable :: reference_q(:, :)   !! (4, bodies) orientation then [-]
    real(wp), allocatable :: reach(:)            !! (bodies) greatest minus least semi-axis [m]
    real(wp), allocatable :: ease(:)             !! (bodies) half the skin over their margin
    integer(i4), allocatable :: start(:)         !! (bodies+1) first entry of a body
    integer(i4), allocatable :: entry(:)         !! 2*(slot-1) + side, by partner id
    integer(i4) :: plain = 0                     !! bodies that are no images
    integer(i4) :: images = 0                    !! bodies plain+1 .. plain+images
    integer(i4), allocatable :: grain(:)         !! (bodies) itself, or whose image; 0: no grain
    integer(i4), allocatable :: shift(:, :)      !! (3, images) in edges of the cell
    integer(i4), allocatable :: image_start(:)   !! (grains+1) first image of each grain
    integer(i4), allocatable :: former(:)        !! (images) body in the list before, 0: none
    real(wp), allocatable :: image_force(:, :)   !! (3, images) at the last evaluation [N]
    type(dem_additional_type) :: additional              !! of the additional contact models
    class(dem_features_type), allocatable :: features    !! of polyhedra; not there without them
  end type dem_pairs_type

  !> Periodic cell and the homogeneous flow that carries all grains. Velocities of grains are those
  !! relative to the flow. Without any periodic edge the flow alone is left (theory-dem, cell).
  type :: dem_cell_type
    logical :: active = .false.
    logical :: periodic(3) = .false.         !! (edges)
    real(wp) :: origin(3) = 0.0_wp           !! corner; the point that the flow leaves in place [m]
    real(wp) :: vectors(3, 3) = 0.0_wp       !! edges as columns [m]
    real(wp) :: start(3, 3) = 0.0_wp         !! edges at the start of the run [m]
    real(wp) :: rate(3, 3) = 0.0_wp          !! velocity gradient dv_i/dx_j [1/s]
    real(wp) :: step(3, 3) = 0.0_wp          !! displacement gradient of the step under way [-]
    real(wp) :: back(3, 3) = 0.0_wp          !! (1 + step)^-1 [-]
    real(wp) :: speed(3, 3) = 0.0_wp         !! velocity of the edges in this step [m/s]
    real(wp) :: held(10) = 0.0_wp            !! slow part of the servos' rates, see dem_flow [1/s]
    real(wp) :: listed(3, 3) = 0.0_wp        !! edges when the list was made [m]
    real(wp) :: deform(3, 3) = 0.0_wp        !! deformation gradient since then [-]
    real(wp) :: reach = 0.0_wp               !! longest branch that the list may hold [m]
    real(wp) :: stretch = 0.0_wp             !! half of what deform may add to a branch [m]
  end type dem_cell_type

  !> Contact weights set through the port, sorted by (lower id, higher id); all others weigh 1.
  type :: dem_weights_type
    integer(i4) :: n = 0
    integer(i8), allocatable :: id(:, :)  !! (2, n) lower id first
    real(wp), allocatable :: value(:)     !! [-]
  end type dem_weights_type

  !> How the system moves.
  type :: dem_parameters_type
    integer(i4) :: mode = mode_dynamic           !! mode_...
    real(wp) :: dt = 0.0_wp                      !! time step [s]
    real(wp) :: mass_scale = 1.0_wp              !! s, relaxation mode [-]
    real(wp) :: inertia_scale = 1.0_wp           !! s_I, relaxation mode [-]
    real(wp) :: damping = 0.0_wp                 !! background damping a [1/s]
    logical :: full_damping = .false.            !! a = 2/dt, whatever dt is
    real(wp) :: gravity(3) = 0.0_wp              !! [m/s^2]
    real(wp) :: gravity_scale = 1.0_wp           !! [-]
    real(wp) :: skin = -1.0_wp                   !! list margin [m]; <= 0: chosen at init
    real(wp) :: dt_factor = 0.3_wp               !! automatic step / step limit [-]
    real(wp) :: overlap_limit = 0.1_wp           !! overlap / least semi-axis that is a fault [-]
    real(wp) :: energy_limit = 1.0e3_wp          !! kinetic energy / reference that is a fault [-]
    logical :: allow_late = .false.              !! a step may go beyond the margin of the list
    logical :: ghost_pairs = .false.             !! keep ghost-ghost contacts
    logical :: overlapped = .false.              !! ghosts go on the bed within a solid
  end type dem_parameters_type

  !> Energy ledger since the start of the run [J]. Closure: see dem_ledger.
  type :: dem_ledger_type
    real(wp) :: kinetic = 0.0_wp                !! now, with scaled masses
    real(wp) :: elastic_normal = 0.0_wp         !! now, stored in normal springs
    real(wp) :: elastic_tangential = 0.0_wp     !! now, stored in tangential springs
    real(wp) :: elastic_other = 0.0_wp          !! now, in springs of rolling, bonds and cohesion
    real(wp) :: staggering = 0.0_wp             !! now, (dt^2/8m) F^2 of the leapfrog
    real(wp) :: friction = 0.0_wp               !! dissipated by sliding
    real(wp) :: contact_damping = 0.0_wp        !! dissipated by contact dashpots
    real(wp) :: background_damping = 0.0_wp     !! dissipated by background damping
    real(wp) :: curvature = 0.0_wp              !! curvature work, fed into the normal springs
    real(wp) :: tangential_relaxation = 0.0_wp  !! lost by tangential springs without sliding
    real(wp) :: rolling = 0.0_wp                !! dissipated by rolling and twisting
    real(wp) :: breakage = 0.0_wp               !! lost when bonds break, necks form or tear
    real(wp) :: plastic = 0.0_wp                !! dissipated by plastic deformation of contacts
    real(wp) :: boundary = 0.0_wp               !! work of prescribed grains and planes
    real(wp) :: external = 0.0_wp               !! work of held extra forces
    real(wp) :: gravity = 0.0_wp                !! work of gravity
    real(wp) :: entered = 0.0_wp                !! brought along by grains that have entered
    real(wp) :: left = 0.0_wp                   !! taken along by grains that have left
    real(wp) :: released = 0.0_wp               !! stored energy that grains lost as they broke
    real(wp) :: fines = 0.0_wp                  !! kinetic energy of the fines of broken grains
    real(wp) :: growth = 0.0_wp                 !! work of fragments that grow on their contacts
    real(wp) :: liquid = 0.0_wp                 !! stored in the liquid at the last exchange
    real(wp) :: liquid_flow = 0.0_wp            !! work of walls and drains on the liquid
    real(wp) :: liquid_work = 0.0_wp            !! of the liquid on grains
    real(wp) :: darcy = 0.0_wp                  !! dissipated by the flow through the grains
    real(wp) :: liquid_drag = 0.0_wp            !! dissipated by drag within bricks
    real(wp) :: liquid_exchange = 0.0_wp        !! taken by the exchanges' order
    real(wp) :: start = 0.0_wp                  !! kinetic + elastic - staggering at the start
    real(wp) :: largest = 0.0_wp                !! largest energy turned over so far, for scale
  end type dem_ledger_type

  !> Counters of the health of a run.
  type :: dem_health_type
    integer(i8) :: steps = 0                !! sub-steps taken
    integer(i8) :: rebuilds = 0             !! list rebuilds
    integer(i8) :: late_rebuilds = 0        !! of these, after more than the margin was used up
    integer(i8) :: evaluations = 0          !! force evaluations
    real(wp) :: max_overlap = 0.0_wp        !! largest overlap / least semi-axis so far [-]
    real(wp) :: reference_energy = 0.0_wp   !! scale for the runaway test [J]
    real(wp) :: deepest = 0.0_wp            !! largest overlap / least semi-axis of an evaluation
                                            !! in these steps, if it was beyond the limit [-]
    integer(i8) :: deepest_pair(2) = 0      !! its grain, and its partner: a grain, -k: plane k or,
                                            !! behind these, a surface
    integer(i8) :: passed(2) = 0            !! grain, and grain or -surface, of a contact that a
                                            !! step may have missed; 0 without one
  end type dem_health_type

  !> Forces in two parts, once a partner has chosen it: those of free grains and of active ghosts in
  !! every step, those between ghosts once an exchange (dem_parts).
  type :: dem_parts_type
    logical :: active = .false.
    integer(i4), allocatable :: near(:)     !! ghosts that may touch a free grain
    logical, allocatable :: is_near(:)      !! (grains)
    real(wp), allocatable :: of_free(:, :)  !! (6, grains) force, moment of free ones on ghosts [N]
    real(wp), allocatable :: of_ghosts(:, :)  !! (6, grains) the same of ghosts on ghosts
    real(wp) :: pending = 0.0_wp            !! drift since those were evaluated [s]
    real(wp), allocatable :: spare(:)       !! (grains) what their margins may have more [m]
    integer(i8) :: chosen = 0               !! rebuilds of the list when near was chosen
    integer(i4) :: stage = 0                !! of an evaluation that is under way: stage_*
    integer(i4) :: next = 0                 !! block of pairs without ghosts that is due
    real(wp) :: travel = 0.0_wp             !! of what is no ghost since the list was made [m]
  end type dem_parts_type

  !> Clumps: rigid grains of several spheres. The spheres, their members, are grains of kind_member
  !! with the mass of the clump; those of a clump follow each other. Rounded polyhedra are clumps
  !! whose members are their vertices, edges and faces (dem_feature_state).
  type :: dem_clumps_type
    integer(i4) :: n = 0
    class(dem_grains_type), allocatable :: grains  !! centres of mass, principal frames, mass,
                                               !! motion; class for the sake of compilation, which
                                               !! else writes out copies of types within types
    class(dem_pairs_type), allocatable :: pairs  !! records of these, nothing else
    integer(i4), allocatable :: first(:)       !! (clumps) first member, index of a grain
    integer(i4), allocatable :: last(:)        !! (clumps) last member
    real(wp), allocatable :: place(:, :)       !! (3, grains) of members from the centre of mass, in
                                               !! principal axes [m]
    real(wp), allocatable :: arm(:, :)         !! (3, grains) the same in space; 0 of others [m]
    real(wp), allocatable :: lightness(:)      !! (grains) mass over the least effective mass under
                                               !! a normal force; 1 of others [-]
    integer(i4), allocatable :: template(:)    !! (clumps)
    real(wp), allocatable :: scale(:)          !! (clumps) of the template's lengths [-]
    real(wp), allocatable :: frame(:, :)       !! (4, clumps) template to principal frame [-]
    real(wp), allocatable :: origin(:, :)      !! (3, clumps) of the template from the centre of
                                               !! mass, in principal axes [m]
  end type dem_clumps_type

  !> A whole system, without behaviour.
  type :: dem_data_type
    type(dem_grains_type) :: grains
    type(dem_planes_type) :: planes
    type(dem_surfaces_type) :: surfaces
    type(dem_material_type), allocatable :: materials(:)
    type(dem_law_type), allocatable :: laws(:, :)  !! (first, second material)
    type(dem_parameters_type) :: par
    type(dem_pairs_type) :: pairs
    type(dem_cell_type) :: cell
    type(dem_halo_type) :: halo
    type(dem_weights_type) :: weights
    type(dem_ledger_type) :: ledger
    type(dem_health_type) :: health
    type(dem_parts_type) :: parts
    type(dem_pore_type) :: pore
    type(dem_exact_type) :: exact
    type(dem_wear_type) :: wear
    type(dem_heat_type) :: heat
    type(dem_clumps_type) :: clumps
    real(wp) :: pending = 0.0_wp                   !! drift since forces were evaluated [s]
    real(wp) :: ledger_dt = 0.0_wp                 !! step that ledger%staggering is for [s]
    real(wp), allocatable :: seen_kinetic(:)  !! (grains) at the last check of adaptive damping [J]
    real(wp), allocatable :: servo_seen(:, :)      !! (:, planes) last update of servos, dem_servo
    real(wp) :: kept_volume = 0.0_wp               !! of the box [m^3], dem_volume; 0: not yet
    real(wp), allocatable :: surcharge(:)          !! (grains) force downwards now [N]
    logical, allocatable :: surcharge_top(:)       !! (grains) on the surface at the last update
    real(wp), allocatable :: surcharge_seen(:)     !! last update, dem_surcharge
    logical :: open = .false.                      !! grains may enter and leave
    integer(i8) :: last_id = 0                     !! largest id that was ever given, if open
    real(wp), allocatable :: base(:, :)            !! (4, grains) mass and moments of inertia before
                                                   !! a partner's factors [kg], [kg m^2]
    real(wp), allocatable :: fed(:, :)             !! (fed_size, sources) so far, dem_sources
    real(wp), allocatable :: drained(:, :)         !! (drained_size, sinks) so far, dem_sinks
    real(wp), allocatable :: window(:)             !! (window_size) so far, dem_window
    real(wp), allocatable :: graded(:)             !! (graded_size) at the start, dem_grading
    real(wp), allocatable :: crushed(:)            !! (crushed_size) so far, dem_breakage
    integer(i8), allocatable :: lineage(:, :)      !! (3, fragments) id, rising, that of the grain
                                                   !! that broke, generation
    real(wp), allocatable :: fines(:, :)           !! (2, broken grains) mass of fines [kg], least
                                                   !! diameter of their fragments [m]
    real(wp), allocatable :: growing(:, :)         !! (grown_size, fragments), rising ids,
                                                   !! dem_breakage_growth; only if they grow
    logical :: ready = .false.                     !! lists and forces exist
  end type dem_data_type

contains

  !> One state over another. What holds a state does so as `class, allocatable` and copies it here:
  !! compilers write out what a copy of types within types takes wherever there is one.
  subroutine copy_data(from, to)
    type(dem_data_type), intent(in) :: from
    type(dem_data_type), intent(inout) :: to
    to = from
  end subroutine copy_data

  !> A state, kept.
  subroutine keep_data(from, kept)
    type(dem_data_type), intent(in) :: from
    class(dem_data_type), allocatable, intent(inout) :: kept
    if (.not. allocated(kept)) allocate (kept)
    call copy_data(from, kept)
  end subroutine keep_data
end module dem_state
