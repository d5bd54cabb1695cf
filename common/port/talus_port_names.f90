!> Names of the exchange port: fields, roles, scopes, capabilities (manual/port.md).
!!
!! made by tools/port.py from common/port/port.toml: change that file, then `make port`.
module talus_port_names
  use talus_kinds, only: i4
  implicit none
  private
  public :: protocol_version, name_length, header_words, description_words, kind_real
  public :: kind_integer, kind_text, role_report, role_prescribe, role_load, role_surface
  public :: role_border, role_pore, role_count, role_name, role_number, field_a, field_ahead
  public :: field_analysis, field_area, field_axes, field_band, field_border_old, field_branch
  public :: field_brief, field_capabilities, field_compressibility, field_conductance
  public :: field_connectivity, field_content, field_couple, field_couple_stress, field_darcy
  public :: field_deck_hash, field_density, field_drift, field_dt, field_early, field_element
  public :: field_entered, field_error_code, field_error_hint, field_error_message
  public :: field_error_place, field_exponent, field_fields, field_final, field_flow_work
  public :: field_fluid_in, field_force, field_gravity, field_group, field_guest, field_hash
  public :: field_held, field_held_phi, field_history, field_id, field_ids, field_impulse
  public :: field_inertia, field_iterations, field_kick, field_kind, field_knots, field_law
  public :: field_load, field_mass, field_mass_phi, field_mass_u, field_material, field_mean
  public :: field_mean_force, field_mean_moment, field_micro_stress, field_micromorphic
  public :: field_micropolar, field_mobility, field_moduli, field_moment, field_moment_impulse
  public :: field_motion, field_moved, field_names, field_node, field_node_phi, field_normal
  public :: field_omega, field_overlap, field_p, field_path, field_phi, field_phi_acceleration
  public :: field_phi_rate, field_plastic, field_point, field_poisson, field_polar
  public :: field_pressure, field_program, field_protocol, field_quat, field_radius, field_ranks
  public :: field_reaction, field_reaction_moment, field_rehearsal, field_restart, field_role
  public :: field_run_id, field_scalars, field_scope, field_set, field_skew, field_speed
  public :: field_speed_phi, field_start, field_steady, field_step_limit, field_steps
  public :: field_stiffness, field_stiffness_phi, field_storage, field_stress, field_stretch
  public :: field_substeps, field_t_end, field_tag, field_tangent, field_theta, field_tile
  public :: field_time, field_tolerance, field_trial, field_triangle, field_turn, field_u
  public :: field_unbalanced, field_v, field_value, field_value_phi, field_version, field_weight
  public :: field_weight_phi, field_what, field_woken, field_work, field_x, field_young, dot_a
  public :: dot_conductance, dot_content, dot_darcy, dot_entered, dot_flow_work, dot_fluid_in
  public :: dot_force, dot_impulse, dot_load, dot_mean_force, dot_mean_moment, dot_moment
  public :: dot_moment_impulse, dot_omega, dot_p, dot_phi, dot_phi_acceleration, dot_phi_rate
  public :: dot_quat, dot_reaction, dot_reaction_moment, dot_theta, dot_u, dot_v, dot_work, dot_x
  public :: what_grains, what_contacts, what_border, what_asleep, what_mesh, what_facets
  public :: what_quadrature, what_moduli, what_pore, what_groups, what_group, what_contact_weight
  public :: what_kind, what_places, what_mass_factor, what_quad_weight, what_initial_stress
  public :: what_springs, what_dead_load, what_pore_storage, scope_all, scope_interface
  public :: scope_balance, scope_loads, scope_split, scope_between, can_report, can_prescribe
  public :: can_load, can_surface, can_border, can_advance, can_solve, can_force, can_kick_drift
  public :: can_reject, can_checkpoint, can_rehearsal, can_contact_weight, can_mass_factor
  public :: can_population, can_springs, can_dead_load, can_initial_stress, can_quad_weight
  public :: can_moduli, can_impulse, can_places, can_element_stress, can_pore

  integer(i4), parameter :: protocol_version = 2
  integer(i4), parameter :: name_length = 48
  integer(i4), parameter :: header_words = 16
  integer(i4), parameter :: description_words = 10

  integer(i4), parameter :: kind_real = 1  !! IEEE 64-bit
  integer(i4), parameter :: kind_integer = 2  !! 64 bits
  integer(i4), parameter :: kind_text = 3  !! bytes, ASCII

  ! Roles of sets; a message has their names, role_name(role_load).
  integer(i4), parameter :: role_report = 1  !! its state is reported in replies
  integer(i4), parameter :: role_prescribe = 2  !! talus-couple moves it
  integer(i4), parameter :: role_load = 3  !! talus-couple puts forces on it; grains of it are free
  !> vertices of triangles that talus-couple moves; forces on each vertex in return
  integer(i4), parameter :: role_surface = 4
  !> ghosts that free grains can reach, placed in every FORCE
  integer(i4), parameter :: role_border = 5
  !> nodes at which the liquid in the pores goes over: all of a side of the grains' grid, or nodes
  !! of a saturated solid
  integer(i4), parameter :: role_pore = 6
  integer(i4), parameter :: role_count = 6
  character(len=9), parameter :: role_names(role_count) = [character(len=9) :: &
    'report', 'prescribe', 'load', 'surface', 'border', 'pore']

  ! Fields; those of sets alone have no comment here.
  character(len=*), parameter :: field_a = 'a'
  character(len=*), parameter :: field_ahead = 'ahead'  !! KICK_DRIFT
  character(len=*), parameter :: field_analysis = 'analysis'  !! HELLO
  character(len=*), parameter :: field_area = 'area'  !! DESCRIBE pore
  character(len=*), parameter :: field_axes = 'axes'  !! WAKE, DESCRIBE grains
  character(len=*), parameter :: field_band = 'band'  !! DESCRIBE asleep
  character(len=*), parameter :: field_border_old = 'border_old'  !! FORCE
  character(len=*), parameter :: field_branch = 'branch'  !! DESCRIBE contacts
  character(len=*), parameter :: field_brief = 'brief'  !! FORCE, KICK_DRIFT
  character(len=*), parameter :: field_capabilities = 'capabilities'  !! HELLO
  character(len=*), parameter :: field_compressibility = 'compressibility'  !! DESCRIBE pore
  character(len=*), parameter :: field_conductance = 'conductance'
  !> DESCRIBE mesh, DESCRIBE facets
  character(len=*), parameter :: field_connectivity = 'connectivity'
  character(len=*), parameter :: field_content = 'content'
  character(len=*), parameter :: field_couple = 'couple'  !! SET initial_stress
  character(len=*), parameter :: field_couple_stress = 'couple_stress'  !! DESCRIBE quadrature
  character(len=*), parameter :: field_darcy = 'darcy'
  character(len=*), parameter :: field_deck_hash = 'deck_hash'  !! HELLO
  character(len=*), parameter :: field_density = 'density'  !! DESCRIBE asleep, SET initial_stress
  character(len=*), parameter :: field_drift = 'drift'  !! KICK_DRIFT
  character(len=*), parameter :: field_dt = 'dt'  !! HELLO
  character(len=*), parameter :: field_early = 'early'  !! STOP
  character(len=*), parameter :: field_element = 'element'  !! DESCRIBE quadrature and 3 more
  character(len=*), parameter :: field_entered = 'entered'
  character(len=*), parameter :: field_error_code = 'error.code'
  character(len=*), parameter :: field_error_hint = 'error.hint'
  character(len=*), parameter :: field_error_message = 'error.message'
  character(len=*), parameter :: field_error_place = 'error.place'
  character(len=*), parameter :: field_exponent = 'exponent'  !! WAKE
  character(len=*), parameter :: field_fields = 'fields'  !! SELECT
  character(len=*), parameter :: field_final = 'final'  !! ACCEPT
  character(len=*), parameter :: field_flow_work = 'flow_work'
  character(len=*), parameter :: field_fluid_in = 'fluid_in'
  character(len=*), parameter :: field_force = 'force'  !! WAKE, DESCRIBE contacts, SET dead_load
  character(len=*), parameter :: field_gravity = 'gravity'  !! HELLO
  character(len=*), parameter :: field_group = 'group'  !! DESCRIBE
  character(len=*), parameter :: field_guest = 'guest'  !! WAKE
  character(len=*), parameter :: field_hash = 'hash'  !! CHECKPOINT
  character(len=*), parameter :: field_held = 'held'  !! SELECT
  character(len=*), parameter :: field_held_phi = 'held_phi'  !! SELECT
  character(len=*), parameter :: field_history = 'history'  !! WAKE
  character(len=*), parameter :: field_id = 'id'  !! SELECT and 10 more
  character(len=*), parameter :: field_ids = 'ids'  !! WAKE, DESCRIBE contacts, SET contact_weight
  character(len=*), parameter :: field_impulse = 'impulse'
  character(len=*), parameter :: field_inertia = 'inertia'  !! SELECT, DESCRIBE grains
  character(len=*), parameter :: field_iterations = 'iterations'  !! READY, SOLVE
  character(len=*), parameter :: field_kick = 'kick'  !! KICK_DRIFT
  character(len=*), parameter :: field_kind = 'kind'  !! WAKE and 4 more
  character(len=*), parameter :: field_knots = 'knots'  !! WAKE
  character(len=*), parameter :: field_law = 'law'  !! DESCRIBE moduli
  character(len=*), parameter :: field_load = 'load'
  character(len=*), parameter :: field_mass = 'mass'  !! SELECT, DESCRIBE grains
  character(len=*), parameter :: field_mass_phi = 'mass_phi'  !! DESCRIBE mesh
  character(len=*), parameter :: field_mass_u = 'mass_u'  !! DESCRIBE mesh
  character(len=*), parameter :: field_material = 'material'  !! SELECT, WAKE
  character(len=*), parameter :: field_mean = 'mean'  !! DESCRIBE moduli
  character(len=*), parameter :: field_mean_force = 'mean_force'
  character(len=*), parameter :: field_mean_moment = 'mean_moment'
  character(len=*), parameter :: field_micro_stress = 'micro_stress'  !! DESCRIBE quadrature
  character(len=*), parameter :: field_micromorphic = 'micromorphic'  !! DESCRIBE mesh
  character(len=*), parameter :: field_micropolar = 'micropolar'  !! SET moduli
  character(len=*), parameter :: field_mobility = 'mobility'  !! DESCRIBE pore
  character(len=*), parameter :: field_moduli = 'moduli'  !! DESCRIBE moduli
  character(len=*), parameter :: field_moment = 'moment'  !! SET dead_load
  character(len=*), parameter :: field_moment_impulse = 'moment_impulse'
  character(len=*), parameter :: field_motion = 'motion'  !! HELLO
  character(len=*), parameter :: field_moved = 'moved'  !! WAKE, RELAX
  character(len=*), parameter :: field_names = 'names'  !! DESCRIBE groups
  character(len=*), parameter :: field_node = 'node'  !! DESCRIBE mesh, SET places, SET springs
  character(len=*), parameter :: field_node_phi = 'node_phi'  !! SET springs
  character(len=*), parameter :: field_normal = 'normal'  !! DESCRIBE contacts
  character(len=*), parameter :: field_omega = 'omega'  !! WAKE
  character(len=*), parameter :: field_overlap = 'overlap'  !! WAKE
  character(len=*), parameter :: field_p = 'p'
  character(len=*), parameter :: field_path = 'path'  !! CHECKPOINT, WRITE
  character(len=*), parameter :: field_phi = 'phi'
  character(len=*), parameter :: field_phi_acceleration = 'phi_acceleration'
  character(len=*), parameter :: field_phi_rate = 'phi_rate'
  character(len=*), parameter :: field_plastic = 'plastic'  !! DESCRIBE asleep, DESCRIBE quadrature
  character(len=*), parameter :: field_point = 'point'  !! DESCRIBE contacts
  character(len=*), parameter :: field_poisson = 'poisson'  !! SET moduli
  character(len=*), parameter :: field_polar = 'polar'  !! DESCRIBE mesh
  character(len=*), parameter :: field_pressure = 'pressure'  !! WAKE
  character(len=*), parameter :: field_program = 'program'  !! HELLO
  character(len=*), parameter :: field_protocol = 'protocol'  !! HELLO
  character(len=*), parameter :: field_quat = 'quat'  !! WAKE, DESCRIBE grains
  character(len=*), parameter :: field_radius = 'radius'  !! DESCRIBE grains
  character(len=*), parameter :: field_ranks = 'ranks'  !! HELLO
  character(len=*), parameter :: field_reaction = 'reaction'
  character(len=*), parameter :: field_reaction_moment = 'reaction_moment'
  character(len=*), parameter :: field_rehearsal = 'rehearsal'  !! READY
  character(len=*), parameter :: field_restart = 'restart'  !! HELLO
  character(len=*), parameter :: field_role = 'role'  !! SELECT
  character(len=*), parameter :: field_run_id = 'run_id'  !! HELLO
  character(len=*), parameter :: field_scalars = 'scalars'  !! READY and 4 more
  character(len=*), parameter :: field_scope = 'scope'  !! FORCE
  character(len=*), parameter :: field_set = 'set'  !! SELECT and 4 more
  character(len=*), parameter :: field_skew = 'skew'  !! WAKE
  character(len=*), parameter :: field_speed = 'speed'  !! SELECT
  character(len=*), parameter :: field_speed_phi = 'speed_phi'  !! SELECT
  character(len=*), parameter :: field_start = 'start'  !! DESCRIBE asleep, DESCRIBE mesh
  character(len=*), parameter :: field_steady = 'steady'  !! FORCE
  character(len=*), parameter :: field_step_limit = 'step_limit'  !! HELLO and 4 more
  character(len=*), parameter :: field_steps = 'steps'  !! RELAX
  !> SELECT, DESCRIBE contacts, SET springs
  character(len=*), parameter :: field_stiffness = 'stiffness'
  character(len=*), parameter :: field_stiffness_phi = 'stiffness_phi'  !! SELECT, SET springs
  character(len=*), parameter :: field_storage = 'storage'  !! DESCRIBE pore
  character(len=*), parameter :: field_stress = 'stress'  !! WAKE, DESCRIBE quadrature
  character(len=*), parameter :: field_stretch = 'stretch'  !! WAKE
  character(len=*), parameter :: field_substeps = 'substeps'  !! READY and 3 more
  character(len=*), parameter :: field_t_end = 't_end'  !! HELLO
  character(len=*), parameter :: field_tag = 'tag'  !! CHECKPOINT, WRITE
  character(len=*), parameter :: field_tangent = 'tangent'  !! DESCRIBE moduli
  character(len=*), parameter :: field_theta = 'theta'
  character(len=*), parameter :: field_tile = 'tile'  !! DESCRIBE asleep
  character(len=*), parameter :: field_time = 'time'  !! HELLO
  character(len=*), parameter :: field_tolerance = 'tolerance'  !! RELAX
  character(len=*), parameter :: field_trial = 'trial'  !! SOLVE
  character(len=*), parameter :: field_triangle = 'triangle'  !! SELECT
  character(len=*), parameter :: field_turn = 'turn'  !! WAKE
  character(len=*), parameter :: field_u = 'u'
  character(len=*), parameter :: field_unbalanced = 'unbalanced'  !! WAKE, RELAX
  character(len=*), parameter :: field_v = 'v'  !! WAKE, SET kind
  character(len=*), parameter :: field_value = 'value'  !! SET contact_weight and 4 more
  character(len=*), parameter :: field_value_phi = 'value_phi'  !! SET mass_factor
  character(len=*), parameter :: field_version = 'version'  !! HELLO
  character(len=*), parameter :: field_weight = 'weight'  !! DESCRIBE quadrature, SET springs
  character(len=*), parameter :: field_weight_phi = 'weight_phi'  !! SET springs
  character(len=*), parameter :: field_what = 'what'  !! DESCRIBE, SET
  character(len=*), parameter :: field_woken = 'woken'  !! WAKE
  character(len=*), parameter :: field_work = 'work'
  character(len=*), parameter :: field_x = 'x'  !! SELECT and 7 more
  character(len=*), parameter :: field_young = 'young'  !! SET moduli

  ! Fields of a set, to follow its name: '<set>.<name>'.
  character(len=*), parameter :: dot_a = '.a'  !! solid prescribe, solid load, solid report
  character(len=*), parameter :: dot_conductance = '.conductance'  !! grains pore
  character(len=*), parameter :: dot_content = '.content'  !! grains pore, solid pore
  character(len=*), parameter :: dot_darcy = '.darcy'  !! grains pore, solid pore
  character(len=*), parameter :: dot_entered = '.entered'  !! grains pore, solid pore
  character(len=*), parameter :: dot_flow_work = '.flow_work'  !! grains pore, solid pore
  character(len=*), parameter :: dot_fluid_in = '.fluid_in'  !! grains pore, solid pore
  character(len=*), parameter :: dot_force = '.force'  !! grains prescribe and 8 more
  character(len=*), parameter :: dot_impulse = '.impulse'  !! grains prescribe and 3 more
  character(len=*), parameter :: dot_load = '.load'  !! grains load, grains report
  character(len=*), parameter :: dot_mean_force = '.mean_force'  !! grains load
  character(len=*), parameter :: dot_mean_moment = '.mean_moment'  !! grains load
  character(len=*), parameter :: dot_moment = '.moment'  !! grains prescribe and 6 more
  !> grains prescribe, solid prescribe
  character(len=*), parameter :: dot_moment_impulse = '.moment_impulse'
  !> grains prescribe, grains report, grains border
  character(len=*), parameter :: dot_omega = '.omega'
  character(len=*), parameter :: dot_p = '.p'  !! grains pore, solid pore
  character(len=*), parameter :: dot_phi = '.phi'  !! solid prescribe, solid load, solid report
  !> solid prescribe, solid load, solid report
  character(len=*), parameter :: dot_phi_acceleration = '.phi_acceleration'
  !> solid prescribe, solid load, solid report
  character(len=*), parameter :: dot_phi_rate = '.phi_rate'
  !> grains prescribe, grains report, grains border
  character(len=*), parameter :: dot_quat = '.quat'
  character(len=*), parameter :: dot_reaction = '.reaction'  !! solid prescribe
  character(len=*), parameter :: dot_reaction_moment = '.reaction_moment'  !! solid prescribe
  character(len=*), parameter :: dot_theta = '.theta'  !! grains report
  character(len=*), parameter :: dot_u = '.u'  !! solid prescribe, solid load, solid report
  character(len=*), parameter :: dot_v = '.v'  !! grains prescribe and 7 more
  character(len=*), parameter :: dot_work = '.work'  !! grains prescribe and 3 more
  character(len=*), parameter :: dot_x = '.x'  !! grains prescribe and 3 more

  ! Values of the field `what` of DESCRIBE and SET.
  character(len=*), parameter :: what_grains = 'grains'  !! DESCRIBE
  character(len=*), parameter :: what_contacts = 'contacts'  !! DESCRIBE
  character(len=*), parameter :: what_border = 'border'  !! DESCRIBE
  character(len=*), parameter :: what_asleep = 'asleep'  !! DESCRIBE
  character(len=*), parameter :: what_mesh = 'mesh'  !! DESCRIBE
  character(len=*), parameter :: what_facets = 'facets'  !! DESCRIBE
  character(len=*), parameter :: what_quadrature = 'quadrature'  !! DESCRIBE
  character(len=*), parameter :: what_moduli = 'moduli'  !! DESCRIBE, SET
  character(len=*), parameter :: what_pore = 'pore'  !! DESCRIBE
  character(len=*), parameter :: what_groups = 'groups'  !! DESCRIBE
  character(len=*), parameter :: what_group = 'group'  !! DESCRIBE
  character(len=*), parameter :: what_contact_weight = 'contact_weight'  !! SET
  character(len=*), parameter :: what_kind = 'kind'  !! SET
  character(len=*), parameter :: what_places = 'places'  !! SET
  character(len=*), parameter :: what_mass_factor = 'mass_factor'  !! SET
  character(len=*), parameter :: what_quad_weight = 'quad_weight'  !! SET
  character(len=*), parameter :: what_initial_stress = 'initial_stress'  !! SET
  character(len=*), parameter :: what_springs = 'springs'  !! SET
  character(len=*), parameter :: what_dead_load = 'dead_load'  !! SET
  character(len=*), parameter :: what_pore_storage = 'pore_storage'  !! SET

  ! Values of the field `scope` of FORCE.
  character(len=*), parameter :: scope_all = 'all'
  character(len=*), parameter :: scope_interface = 'interface'
  character(len=*), parameter :: scope_balance = 'balance'
  character(len=*), parameter :: scope_loads = 'loads'
  character(len=*), parameter :: scope_split = 'split'
  character(len=*), parameter :: scope_between = 'between'

  ! Words of HELLO's capabilities.
  character(len=*), parameter :: can_report = 'report'  !! SELECT with the role report
  character(len=*), parameter :: can_prescribe = 'prescribe'  !! SELECT with the role prescribe
  character(len=*), parameter :: can_load = 'load'  !! SELECT with the role load
  character(len=*), parameter :: can_surface = 'surface'  !! SELECT with the role surface
  !> SELECT with the role border, DESCRIBE border, FORCE with scopes split and between
  character(len=*), parameter :: can_border = 'border'
  character(len=*), parameter :: can_advance = 'advance'  !! ADVANCE
  character(len=*), parameter :: can_solve = 'solve'  !! SOLVE
  character(len=*), parameter :: can_force = 'force'  !! FORCE
  character(len=*), parameter :: can_kick_drift = 'kick_drift'  !! KICK_DRIFT
  !> REJECT brings the accepted state back, bit for bit
  character(len=*), parameter :: can_reject = 'reject'
  !> CHECKPOINT, and HELLO with `restart`
  character(len=*), parameter :: can_checkpoint = 'checkpoint'
  character(len=*), parameter :: can_rehearsal = 'rehearsal'  !! READY with `rehearsal` = 1
  character(len=*), parameter :: can_contact_weight = 'contact_weight'  !! SET contact_weight
  character(len=*), parameter :: can_mass_factor = 'mass_factor'  !! SET mass_factor
  character(len=*), parameter :: can_population = 'population'  !! WAKE, SLEEP, RELAX, SET kind
  character(len=*), parameter :: can_springs = 'springs'  !! SET springs
  character(len=*), parameter :: can_dead_load = 'dead_load'  !! SET dead_load
  character(len=*), parameter :: can_initial_stress = 'initial_stress'  !! SET initial_stress
  character(len=*), parameter :: can_quad_weight = 'quad_weight'  !! SET quad_weight
  character(len=*), parameter :: can_moduli = 'moduli'  !! SET moduli
  !> impulses on sets of the role load in ADVANCE, and in KICK_DRIFT without kick and drift
  character(len=*), parameter :: can_impulse = 'impulse'
  character(len=*), parameter :: can_places = 'places'  !! SET places
  !> SET initial_stress of some elements, within a run: their laws have a state
  character(len=*), parameter :: can_element_stress = 'element_stress'
  !> SELECT with the role pore, DESCRIBE pore; the solid SET pore_storage
  character(len=*), parameter :: can_pore = 'pore'

contains

  !> Name of a role as messages have it.
  pure function role_name(role) result(name)
    integer(i4), intent(in) :: role
    character(len=:), allocatable :: name
    name = trim(role_names(role))
  end function role_name

  !> Number of a role, 0 for a name that is none.
  pure integer(i4) function role_number(name)
    character(len=*), intent(in) :: name
    role_number = findloc(role_names == name, .true., 1)
  end function role_number
end module talus_port_names
