!> What an overlap is made of, beside its cells, sets and operators: a type for each thing that is
!! known or accounted for (theory: overlap coupling). What moves is in cpl_overlap_motion, what acts
!! in cpl_overlap_forces.
module cpl_overlap_state
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_moduli, only: isotropic_type
  use talus_scalars, only: scalar_count
  use cpl_fine_damping, only: fine_damping_type
  use cpl_inertia, only: inertia_type
  use cpl_initial, only: initial_type
  use cpl_weight_fit, only: fit_type
  implicit none
  private
  public :: overlap_rules_type, overlap_map_type, overlap_own_type, &
    overlap_limit_type, overlap_share_type, overlap_start_type, overlap_ledger_type

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
    real(wp), allocatable :: base(:, :)            !! displacement of all nodes of the mesh when the
                                                   !! sets were made, (3, nodes) [m]; none: zero
    real(wp), allocatable :: base_phi(:, :)        !! the same of micro-rotations [rad]
    real(wp) :: checked = 0.0_wp                   !! motion past the nodes at the last check [m]
    real(wp) :: fine = 0.0_wp, past = 0.0_wp       !! the same now: root mean square, largest [m]
    integer(i8) :: remaps = 0
    character(len=:), allocatable :: sets_hash     !! of the sets and the first operators
  contains
    procedure :: init => init_map
    procedure :: put => put_map
    procedure :: get => get_map
    procedure :: note_check
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
  contains
    procedure :: take_masses
    procedure :: drop_masses
    procedure :: drop_inertias
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
    real(wp), allocatable :: hold(:, :)            !! dead loads on the solid's nodes (3, n) [N]
    real(wp) :: solid_rest = 0.0_wp                !! largest force they hold, or would [N]
    real(wp) :: solid_share = 0.0_wp               !! of the largest load on a node [-]
    integer(i4) :: solid_node = 0                  !! where
    real(wp), allocatable :: moduli(:, :)          !! of the elements, if not the deck's (6, n)
    real(wp) :: lambda = 0.0_wp, shear = 0.0_wp    !! taken for them [Pa]
    type(isotropic_type) :: affine                 !! of the pack's contacts
    real(wp) :: contact_stiffness = 0.0_wp         !! static: mean at the start [N/m]
    integer(i4) :: contact_count = 0               !! static: at the start
  contains
    procedure :: put => put_start
    procedure :: get => get_start
  end type overlap_start_type

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
    procedure :: hold_to
    procedure :: lose
    procedure :: put => put_ledger
    procedure :: get => get_ledger
    procedure :: put_bond
    procedure :: get_bond
  end type overlap_ledger_type

contains

  !> What the nodes own of mass and of inertia of their micro-rotations.
  pure subroutine take_masses(self, mass, inertia)
    class(overlap_own_type), intent(inout) :: self
    real(wp), intent(in) :: mass(:), inertia(:)  !! (nodes) [kg], (nodes_phi) [kg m^2]
    self%mass = mass
    self%inertia = inertia
  end subroutine take_masses

  !> Nodes that are not kept own no mass.
  pure subroutine drop_masses(self, kept)
    class(overlap_own_type), intent(inout) :: self
    logical, intent(in) :: kept(:)  !! (nodes)
    where (.not. kept) self%mass = 0.0_wp
  end subroutine drop_masses

  pure subroutine drop_inertias(self, kept)
    class(overlap_own_type), intent(inout) :: self
    logical, intent(in) :: kept(:)  !! (nodes_phi)
    where (.not. kept) self%inertia = 0.0_wp
  end subroutine drop_inertias

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

  !> The grains are checked as they are now.
  pure subroutine note_check(self)
    class(overlap_map_type), intent(inout) :: self
    self%checked = self%past
  end subroutine note_check

  !> Works of both sides, and what went through without sign [J].
  pure subroutine add_to_ledger(self, given, taken, through)
    class(overlap_ledger_type), intent(inout) :: self
    real(wp), intent(in) :: given, taken, through
    self%work_given = self%work_given + given
    self%work_taken = self%work_taken + taken
    self%turnover = self%turnover + through
  end subroutine add_to_ledger

  !> Work of the loads that balance the start is this now [J].
  pure subroutine hold_to(self, work)
    class(overlap_ledger_type), intent(inout) :: self
    real(wp), intent(in) :: work
    self%hold_work = work
  end subroutine hold_to

  !> What binds a domain takes from one side and does not give to the other [J].
  pure subroutine lose(self, taken, given)
    class(overlap_ledger_type), intent(inout) :: self
    real(wp), intent(in) :: taken, given
    self%lost = self%lost + taken - given
  end subroutine lose

  subroutine put_bond(self, file, errors)
    class(overlap_ledger_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/bridge/lost', [self%lost], errors)
    call file%put('/bridge/bond', [self%bond], errors)
  end subroutine put_bond

  subroutine get_bond(self, file, errors)
    class(overlap_ledger_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp) :: lost(1), bond(1)
    lost = 0.0_wp
    bond = 0.0_wp
    call file%get_into('/bridge/lost', lost, errors)
    if (file%exists('/bridge/bond')) call file%get_into('/bridge/bond', bond, errors)
    self%lost = lost(1)
    self%bond = bond(1)
  end subroutine get_bond

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
    if (allocated(self%hold)) call file%put('/start/hold', self%hold, errors)
    if (.not. allocated(self%stress)) return
    call file%put('/start/stress', self%stress, errors)
    call file%put('/start/couple', self%couple, errors)
  end subroutine put_start

  subroutine get_start(self, file, errors)
    class(overlap_start_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (file%exists('/start/moduli')) call file%get('/start/moduli', self%moduli, errors)
    if (file%exists('/start/hold')) call file%get('/start/hold', self%hold, errors)
    if (.not. file%exists('/start/stress')) return
    call file%get('/start/stress', self%stress, errors)
    call file%get('/start/couple', self%couple, errors)
  end subroutine get_start
end module cpl_overlap_state
