!> What an overlap is made of, beside its cells, sets and operators: a type for each thing that is
!! known, moves, acts or is accounted for (theory: overlap coupling).
module cpl_overlap_state
  use talus_kinds, only: wp, i4, i8
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
    overlap_forces_type, overlap_ledger_type

  !> Loads of the solid's deck on hat nodes, without weight.
  type :: loads_type
    logical :: active = .false.
    logical :: steady = .true.                     !! they do not change with time
    real(wp), allocatable :: f(:, :), c(:, :)      !! (3, hats) [N], (3, hats_phi) [N m]
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
    logical :: hears_force = .false.               !! contact forces of the free grains are told
    logical :: hears_speed = .false.               !! velocities of the free grains are told
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
    logical, allocatable :: told(:)                !! that they have left was said
    real(wp), allocatable :: u_map(:, :), phi_map(:, :)  !! of the nodes when P was made
    real(wp) :: looked = 0.0_wp                    !! motion past the nodes at the last look [m]
    real(wp) :: fine = 0.0_wp, past = 0.0_wp       !! the same now: root mean square, largest [m]
    integer(i8) :: remaps = 0
    character(len=:), allocatable :: sets_hash     !! of the sets and the first operators
  end type overlap_map_type

  !> Who owns which mass, and what the solid's deck holds.
  type :: overlap_own_type
    type(inertia_type) :: carried, carried_phi     !! masses that hat nodes carry
    type(fine_damping_type) :: damping, damping_phi
    real(wp) :: moved_mass = 0.0_wp                !! from hat nodes to free grains [kg]
    real(wp), allocatable :: factor(:)             !! on the masses of the free grains
    real(wp), allocatable :: mass(:)               !! of the nodes, what they own [kg]
    real(wp), allocatable :: inertia(:)            !! of their micro-rotations [kg m^2]
    logical, allocatable :: held(:, :), held_phi(:, :)  !! by the solid's deck
  end type overlap_own_type

  !> Stable steps.
  type :: overlap_limit_type
    real(wp) :: step_limit = huge(1.0_wp)          !! of the grains' step in the overlap [s]
    real(wp) :: kick_limit = huge(1.0_wp)          !! of the exchange, of what acts in kicks [s]
    character(len=:), allocatable :: kick_mover    !! who moves most at it
  end type overlap_limit_type

  !> How energy is shared: weights of contacts and quadrature points.
  type :: overlap_share_type
    integer(i8), allocatable :: weight_ids(:, :)   !! (2, pairs) of ghosts that may touch
    integer(i4), allocatable :: near_ghosts(:, :)  !! the same by their rows, before a fresh start
    real(wp), allocatable :: weight(:)             !! of their contacts [-]
    real(wp), allocatable :: beta(:)               !! of the quadrature points [-]
    character(len=:), allocatable :: shared        !! how the weights were found
    type(fit_type) :: fit                          !! of the weights
    real(wp) :: disorder = 0.0_wp                  !! unbalance of grains in uniform strain [-]
    logical :: unfit = .false.                     !! no weights were found for a lattice
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
  end type overlap_motion_type

  !> Forces on what is free, and those of ghosts and elements that they come from.
  type :: overlap_forces_type
    real(wp), allocatable :: steady(:, :), steady_phi(:, :)
    !! forces of the solid at the start, which act in every step of the grains
    real(wp), allocatable :: p(:, :), m(:, :)      !! on the ghosts [N], [N m]
    real(wp), allocatable :: f(:, :), c(:, :)      !! on the nodes, every step of the grains
    real(wp), allocatable :: bulk(:, :), bulk_phi(:, :)  !! the same, once an exchange
    real(wp), allocatable :: element(:, :), element_phi(:, :)  !! of elements with hat nodes alone
    real(wp), allocatable :: force(:, :), moment(:, :)  !! on the free grains [N], [N m]
    real(wp), allocatable :: contact(:, :), contact_moment(:, :)  !! of contacts on free grains
    real(wp), allocatable :: inertial(:, :), inertial_phi(:, :)  !! of what hat nodes carry
    real(wp), allocatable :: f_hold(:, :), c_hold(:, :)  !! that balance the start
    real(wp), allocatable :: force_hold(:, :), moment_hold(:, :)
    type(loads_type) :: loads                      !! of the solid's deck on hat nodes
    type(parts_type) :: parts                      !! forces between ghosts, once an exchange
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
  end type overlap_ledger_type
end module cpl_overlap_state
