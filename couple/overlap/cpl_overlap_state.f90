!> What an overlap is made of, beside its cells, sets and operators: a type for each thing that is
!! known, moves, acts or is accounted for (theory: overlap coupling).
module cpl_overlap_state
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_moduli, only: isotropic_type
  use talus_scalars, only: scalar_count
  use cpl_fine_damping, only: fine_damping_type
  use cpl_inertia, only: inertia_type
  use cpl_initial, only: initial_type
  use cpl_parts, only: parts_type
  use cpl_weight_fit, only: fit_type
  implicit none
  private
  public :: loads_type, overlap_rules_type, overlap_map_type, overlap_own_type, &
    overlap_limit_type, overlap_share_type, overlap_start_type, overlap_motion_type, &
    increment_type, overlap_forces_type, overlap_ledger_type

  !> Loads of the solid's deck on prescribed nodes, without weight.
  type :: loads_type
    logical :: active = .false.
    logical :: steady = .true.                     !! they do not change with time
    real(wp), allocatable :: f(:, :), c(:, :)      !! (3, prescribed) [N], (3, prescribed_phi) [N m]
  end type loads_type

  !> How the overlap is run: chosen once, from the deck and what both sides are.
  type :: overlap_rules_type
    integer(i4) :: substeps = 1                    !! of the grains in an exchange
    logical :: symmetric = .true.
    logical :: static = .false.                    !! the solid has no inertia
    logical :: turns = .false.                     !! rotations of free grains matter
    logical :: round = .true.                      !! all ghosts are spheres
    logical :: round_free = .true.                 !! all free grains are spheres
    logical :: in_parts = .false.                  !! forces between ghosts come once an exchange
    logical :: reads_force = .false.               !! contact forces of the free grains are reported
    logical :: reads_speed = .false.               !! velocities of the free grains are reported
    real(wp) :: least_weight = 0.0_wp              !! of either side of a bridging domain; 0: ghosts
    logical :: stressed = .false.                  !! the solid begins with the grains' stress
    real(wp) :: fine_damping = 0.0_wp              !! of the deck [1/s]
  end type overlap_rules_type

  !> Where the maps count from, and how far grains have moved past the nodes since.
  type :: overlap_map_type
    real(wp) :: identity = 0.0_wp                  !! largest error of the operators
    real(wp), allocatable :: x_free(:, :), x_ghost(:, :), x_node(:, :)  !! reference (3, :) [m]
    real(wp), allocatable :: theta_ref(:, :)       !! rotation of the free grains then [rad]
    logical, allocatable :: seen(:)                !! free grains that the nodes see
    logical, allocatable :: logged(:)              !! that they have left was logged
    real(wp), allocatable :: u_map(:, :), phi_map(:, :)  !! of the nodes when P was made
    real(wp) :: checked = 0.0_wp                   !! motion past the nodes at the last check [m]
    real(wp) :: fine = 0.0_wp, past = 0.0_wp       !! the same now: root mean square, largest [m]
    integer(i8) :: remaps = 0
    character(len=:), allocatable :: sets_hash     !! of the sets and the first operators
  contains
    procedure :: init => init_map
    procedure :: put => put_map
    procedure :: get => get_map
  end type overlap_map_type

  !> Who owns which mass, and what the solid's deck holds.
  type :: overlap_own_type
    type(inertia_type) :: carried, carried_phi     !! masses that prescribed nodes carry
    type(fine_damping_type) :: damping, damping_phi
    real(wp) :: moved_mass = 0.0_wp                !! from prescribed nodes to free grains [kg]
    real(wp), allocatable :: factor(:)             !! on the masses of the free grains
    real(wp), allocatable :: mass(:)               !! of the nodes, what they own [kg]
    real(wp), allocatable :: inertia(:)            !! of their micro-rotations [kg m^2]
    logical, allocatable :: held(:, :), held_phi(:, :)  !! by the solid's deck
  end type overlap_own_type

  !> Stable steps.
  type :: overlap_limit_type
    real(wp) :: step_limit = huge(1.0_wp)          !! of the grains' step in the overlap [s]
    real(wp) :: kick_limit = huge(1.0_wp)          !! of the exchange, of what acts in kicks [s]
    character(len=:), allocatable :: kick_critical    !! who moves most at it
  end type overlap_limit_type

  !> How energy is shared: weights of contacts and quadrature points.
  type :: overlap_share_type
    integer(i8), allocatable :: weight_ids(:, :)   !! (2, pairs) of ghosts that may touch
    integer(i4), allocatable :: active_ghosts(:, :)  !! the same by their rows, before a fresh start
    real(wp), allocatable :: weight(:)             !! of their contacts [-]
    real(wp), allocatable :: beta(:)               !! of the quadrature points [-]
    character(len=:), allocatable :: shared        !! how the weights were found
    type(fit_type) :: fit                          !! of the weights
    real(wp) :: disorder = 0.0_wp                  !! unbalance of grains in uniform strain [-]
    logical :: unfit = .false.                     !! no weights were found for a lattice
  contains
    procedure :: put => put_share
    procedure :: get => get_share
  end type overlap_share_type

  !> What the grains were at the start: moduli, stress, scale of forces.
  type :: overlap_start_type
    real(wp), allocatable :: stress(:, :)          !! initial, of the points (9, n) [Pa]
    real(wp), allocatable :: couple(:, :)          !! the same (9, n) [N/m]
    type(initial_type) :: initial                  !! its correction to balance
    real(wp) :: start_rest = 0.0_wp                !! largest rest at nodes / contact force [-]
    real(wp), allocatable :: moduli(:, :)          !! of the elements, if not the deck's (6, n)
    real(wp) :: lambda = 0.0_wp, shear = 0.0_wp    !! taken for them [Pa]
    type(isotropic_type) :: affine                 !! of the pack's contacts
    real(wp) :: contact_stiffness = 0.0_wp         !! static: mean at the start [N/m]
    integer(i4) :: contact_count = 0               !! static: at the start
  contains
    procedure :: put => put_start
    procedure :: get => get_start
  end type overlap_start_type

  !> Where all are, from the reference state.
  type :: overlap_motion_type
    real(wp), allocatable :: q(:, :), theta(:, :)  !! of the free grains (3, free) [m], [rad]
    real(wp), allocatable :: q_before(:, :), theta_before(:, :)  !! a step before
    real(wp), allocatable :: u(:, :), v(:, :)      !! of the nodes (3, nodes) [m], [m/s]
    real(wp), allocatable :: phi(:, :), w(:, :)    !! (3, nodes_phi) [rad], [rad/s]
    real(wp), allocatable :: d(:, :), turn(:, :)   !! of the ghosts (3, ghosts) [m], [rad]
    real(wp), allocatable :: quat(:, :)            !! of the ghosts (4, ghosts)
    real(wp), allocatable :: speed(:, :), spin(:, :)  !! of free grains, half a step ago [m/s]
  contains
    procedure :: init => init_motion
    procedure :: put => put_motion
    procedure :: get => get_motion
  end type overlap_motion_type

  !> Motion in a step of the grains, for works.
  type :: increment_type
    real(wp), allocatable :: u(:, :), phi(:, :)        !! nodes at its start [m], [rad]
    real(wp), allocatable :: moved(:, :), turns(:, :)  !! of the (active) ghosts, in it
  end type increment_type

  !> Forces on what is free, and those of ghosts and elements that they come from.
  type :: overlap_forces_type
    real(wp), allocatable :: steady(:, :), steady_phi(:, :)
    !! forces of the solid at the start, which act in every step of the grains
    real(wp), allocatable :: p(:, :), m(:, :)      !! on the ghosts [N], [N m]
    real(wp), allocatable :: f(:, :), c(:, :)      !! on the nodes, every step of the grains
    real(wp), allocatable :: bulk(:, :), bulk_phi(:, :)  !! the same, once an exchange
    real(wp), allocatable :: element(:, :), element_phi(:, :)  !! of elements with prescribed nodes
    real(wp), allocatable :: force(:, :), moment(:, :)  !! on the free grains [N], [N m]
    real(wp), allocatable :: contact(:, :), contact_moment(:, :)  !! of contacts on free grains
    real(wp), allocatable :: inertial(:, :), inertial_phi(:, :)  !! of what prescribed nodes carry
    real(wp), allocatable :: f_hold(:, :), c_hold(:, :)  !! that balance the start
    real(wp), allocatable :: force_hold(:, :), moment_hold(:, :)
    type(loads_type) :: loads                      !! of the solid's deck on prescribed nodes
    type(parts_type) :: parts                      !! forces between ghosts, once an exchange
  contains
    procedure :: init => init_forces
    procedure :: put => put_forces
    procedure :: get => get_forces
  end type overlap_forces_type

  !> Works and energies.
  type :: overlap_ledger_type
    real(wp) :: unbalanced = 0.0_wp                !! static: largest rest / contact force [-]
    real(wp) :: work_given = 0.0_wp                !! by ghosts and nodes on what is free [J]
    real(wp) :: work_taken = 0.0_wp                !! by what is free on ghosts and nodes [J]
    real(wp) :: turnover = 0.0_wp                  !! sum of both without sign [J]
    real(wp) :: hold_work = 0.0_wp                 !! of the loads that balance the start [J]
    real(wp) :: lost = 0.0_wp                      !! taken by what binds a domain [J]
    real(wp) :: bond = 0.0_wp                      !! stored in what binds a domain [J]
    real(wp) :: grains(scalar_count) = 0.0_wp, solid(scalar_count) = 0.0_wp
  contains
    procedure :: add => add_to_ledger
    procedure :: put => put_ledger
    procedure :: get => get_ledger
  end type overlap_ledger_type
contains

  !> Zero motion; quat of the ghosts as they are.
  subroutine init_motion(self, free, nodes, nodes_phi, quat)
    class(overlap_motion_type), intent(inout) :: self
    integer(i4), intent(in) :: free, nodes, nodes_phi
    real(wp), intent(in) :: quat(:, :)  !! (4, ghosts)
    integer(i4) :: ghosts
    ghosts = size(quat, 2, i4)
    allocate (self%q(3, free), self%theta(3, free), self%q_before(3, free), &
              self%theta_before(3, free), self%speed(3, free), self%spin(3, free), source=0.0_wp)
    allocate (self%u(3, nodes), self%v(3, nodes), self%phi(3, nodes_phi), self%w(3, nodes_phi), &
              self%d(3, ghosts), self%turn(3, ghosts), source=0.0_wp)
    self%quat = quat
  end subroutine init_motion

  subroutine put_motion(self, file, errors)
    class(overlap_motion_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/free/q', self%q, errors)
    call file%put('/free/theta', self%theta, errors)
    call file%put('/ghosts/d', self%d, errors)
    call file%put('/ghosts/turn', self%turn, errors)
    call file%put('/ghosts/quat', self%quat, errors)
    call file%put('/nodes/u', self%u, errors)
    call file%put('/nodes/v', self%v, errors)
    call file%put('/rotations/phi', self%phi, errors)
    call file%put('/rotations/w', self%w, errors)
  end subroutine put_motion

  subroutine get_motion(self, file, errors)
    class(overlap_motion_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%get_into('/free/q', self%q, errors)
    call file%get_into('/free/theta', self%theta, errors)
    call file%get_into('/ghosts/d', self%d, errors)
    call file%get_into('/ghosts/turn', self%turn, errors)
    call file%get_into('/ghosts/quat', self%quat, errors)
    call file%get_into('/nodes/u', self%u, errors)
    call file%get_into('/nodes/v', self%v, errors)
    call file%get_into('/rotations/phi', self%phi, errors)
    call file%get_into('/rotations/w', self%w, errors)
  end subroutine get_motion

  !> No forces.
  subroutine init_forces(self, free, ghosts, nodes, nodes_phi, prescribed, prescribed_phi)
    class(overlap_forces_type), intent(inout) :: self
    integer(i4), intent(in) :: free, ghosts, nodes, nodes_phi, prescribed, prescribed_phi
    allocate (self%force(3, free), self%moment(3, free), self%force_hold(3, free), &
              self%moment_hold(3, free), self%contact(3, free), self%contact_moment(3, free), &
              source=0.0_wp)
    allocate (self%inertial(3, prescribed), self%inertial_phi(3, prescribed_phi), source=0.0_wp)
    allocate (self%f(3, nodes), self%bulk(3, nodes), self%element(3, nodes), &
              self%f_hold(3, nodes), self%steady(3, nodes), source=0.0_wp)
    allocate (self%c(3, nodes_phi), self%bulk_phi(3, nodes_phi), self%element_phi(3, nodes_phi), &
              self%c_hold(3, nodes_phi), self%steady_phi(3, nodes_phi), source=0.0_wp)
    allocate (self%p(3, ghosts), self%m(3, ghosts), source=0.0_wp)
  end subroutine init_forces

  subroutine put_forces(self, file, errors)
    class(overlap_forces_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/free/force', self%force, errors)
    call file%put('/free/moment', self%moment, errors)
    call file%put('/free/force_hold', self%force_hold, errors)
    call file%put('/free/moment_hold', self%moment_hold, errors)
    call file%put('/nodes/f', self%f, errors)
    call file%put('/nodes/bulk', self%bulk, errors)
    call file%put('/nodes/element', self%element, errors)
    call file%put('/nodes/f_hold', self%f_hold, errors)
    call file%put('/rotations/c', self%c, errors)
    call file%put('/rotations/bulk', self%bulk_phi, errors)
    call file%put('/rotations/element', self%element_phi, errors)
    call file%put('/rotations/c_hold', self%c_hold, errors)
    call file%put('/start/steady', self%steady, errors)
    call file%put('/start/steady_phi', self%steady_phi, errors)
    if (.not. self%loads%active) return
    call file%put('/loads/f', self%loads%f, errors)
    call file%put('/loads/c', self%loads%c, errors)
  end subroutine put_forces

  subroutine get_forces(self, file, errors)
    class(overlap_forces_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%get_into('/free/force', self%force, errors)
    call file%get_into('/free/moment', self%moment, errors)
    call file%get_into('/free/force_hold', self%force_hold, errors)
    call file%get_into('/free/moment_hold', self%moment_hold, errors)
    call file%get_into('/nodes/f', self%f, errors)
    call file%get_into('/nodes/bulk', self%bulk, errors)
    call file%get_into('/nodes/element', self%element, errors)
    call file%get_into('/nodes/f_hold', self%f_hold, errors)
    call file%get_into('/rotations/c', self%c, errors)
    call file%get_into('/rotations/bulk', self%bulk_phi, errors)
    call file%get_into('/rotations/element', self%element_phi, errors)
    call file%get_into('/rotations/c_hold', self%c_hold, errors)
    call file%get_into('/start/steady', self%steady, errors)
    call file%get_into('/start/steady_phi', self%steady_phi, errors)
    if (file%exists('/loads/f')) call file%get('/loads/f', self%loads%f, errors)
    if (file%exists('/loads/c')) call file%get('/loads/c', self%loads%c, errors)
  end subroutine get_forces

  !> Maps of the reference state: nothing has moved since.
  subroutine init_map(self, x_free, x_ghost, x_node, nodes_phi, seen)
    class(overlap_map_type), intent(inout) :: self
    real(wp), intent(in) :: x_free(:, :), x_ghost(:, :), x_node(:, :)  !! (3, :) [m]
    integer(i4), intent(in) :: nodes_phi
    logical, intent(in) :: seen(:)  !! (free)
    allocate (self%theta_ref(3, size(x_free, 2)), self%u_map(3, size(x_node, 2)), &
              self%phi_map(3, nodes_phi), source=0.0_wp)
    allocate (self%logged(size(seen)), source=.false.)
    self%seen = seen
    self%x_free = x_free
    self%x_ghost = x_ghost
    self%x_node = x_node
  end subroutine init_map

  subroutine put_map(self, file, errors)
    class(overlap_map_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/free/theta_ref', self%theta_ref, errors)
    call file%put('/map/looked', [self%checked], errors)
    call file%put('/map/told', merge(1_i4, 0_i4, self%logged), errors)
    if (self%remaps == 0) return
    call file%put('/map/x_free', self%x_free, errors)
    call file%put('/map/u', self%u_map, errors)
    call file%put('/map/phi', self%phi_map, errors)
  end subroutine put_map

  subroutine get_map(self, file, remaps, errors)
    class(overlap_map_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    integer(i8), intent(in) :: remaps
    type(error_list_type), intent(inout) :: errors
    real(wp) :: looked(1)
    integer(i4) :: told(size(self%logged))
    looked = 0.0_wp
    told = 0
    call file%get_into('/free/theta_ref', self%theta_ref, errors)
    call file%get_into('/map/looked', looked, errors)
    call file%get_into('/map/told', told, errors)
    self%checked = looked(1)
    self%logged = told == 1
    self%remaps = remaps
    if (remaps == 0) return
    call file%get_into('/map/x_free', self%x_free, errors)
    call file%get_into('/map/u', self%u_map, errors)
    call file%get_into('/map/phi', self%phi_map, errors)
  end subroutine get_map

  !> Works of both sides, and what went through without sign [J].
  pure subroutine add_to_ledger(self, given, taken, through)
    class(overlap_ledger_type), intent(inout) :: self
    real(wp), intent(in) :: given, taken, through
    self%work_given = self%work_given + given
    self%work_taken = self%work_taken + taken
    self%turnover = self%turnover + through
  end subroutine add_to_ledger

  !> lost: what damping of the fine scale has taken of motion and rotation [J].
  subroutine put_ledger(self, lost, file, errors)
    class(overlap_ledger_type), intent(in) :: self
    real(wp), intent(in) :: lost(2)
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/numbers', [self%work_given, self%work_taken, self%turnover, self%hold_work, &
                               lost], errors)
    call file%put('/scalars/grains', self%grains, errors)
    call file%put('/scalars/solid', self%solid, errors)
  end subroutine put_ledger

  subroutine get_ledger(self, lost, file, errors)
    class(overlap_ledger_type), intent(inout) :: self
    real(wp), intent(out) :: lost(2)
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp) :: numbers(6)
    numbers = 0.0_wp
    call file%get_into('/numbers', numbers, errors)
    call file%get_into('/scalars/grains', self%grains, errors)
    call file%get_into('/scalars/solid', self%solid, errors)
    self%work_given = numbers(1)
    self%work_taken = numbers(2)
    self%turnover = numbers(3)
    self%hold_work = numbers(4)
    lost = numbers(5:)
  end subroutine get_ledger

  subroutine put_share(self, file, errors)
    class(overlap_share_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/weights/ids', self%weight_ids, errors)
    call file%put('/weights/contacts', self%weight, errors)
    call file%put('/weights/points', self%beta, errors)
  end subroutine put_share

  subroutine get_share(self, file, errors)
    class(overlap_share_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%get('/weights/ids', self%weight_ids, errors)
    call file%get('/weights/contacts', self%weight, errors)
    call file%get('/weights/points', self%beta, errors)
  end subroutine get_share

  subroutine put_start(self, file, errors)
    class(overlap_start_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (allocated(self%moduli)) call file%put('/start/moduli', self%moduli, errors)
    if (.not. allocated(self%stress)) return
    call file%put('/start/stress', self%stress, errors)
    call file%put('/start/couple', self%couple, errors)
  end subroutine put_start

  subroutine get_start(self, file, errors)
    class(overlap_start_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (file%exists('/start/moduli')) call file%get('/start/moduli', self%moduli, errors)
    if (.not. file%exists('/start/stress')) return
    call file%get('/start/stress', self%stress, errors)
    call file%get('/start/couple', self%couple, errors)
  end subroutine get_start
end module cpl_overlap_state
