!> Additional contact models: their parameters, and the history of their contacts.
!!
!! The history is in arrays of its own, which are allocated only if a model of the run needs them.
module dem_additional_state
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: additional_law_type, kept_part_type, kept_places_type, dem_additional_type
  public :: dem_bond_type
  public :: part_rolling, part_cohesion, part_bond, part_base, most_parts
  public :: additional_work_count, work_rolling, work_breakage, work_torn, work_sheared
  public :: rolling_reals, cohesion_reals, bond_reals, turning_reals, turning_knots
  public :: cohesion_none, cohesion_constant, cohesion_dmt, cohesion_jkr

  integer(i4), parameter :: additional_work_count = 4  !! works and counts of a block
  integer(i4), parameter :: work_rolling = 1      !! dissipated by rolling and twisting
  integer(i4), parameter :: work_breakage = 2     !! lost when bonds break or necks form or tear

  integer(i4), parameter :: work_torn = 3         !! bonds broken by tension and bending [-]
  integer(i4), parameter :: work_sheared = 4      !! by shear and twisting [-]

  integer(i4), parameter :: rolling_reals = 8     !! kept by dem_rolling
  integer(i4), parameter :: cohesion_reals = 4    !! kept by dem_cohesion
  integer(i4), parameter :: bond_reals = 17       !! kept by dem_bond
  integer(i4), parameter :: turning_knots = 26    !! knots that a contact keeps
  integer(i4), parameter :: turning_reals = 3 + 4*turning_knots  !! kept by dem_turning

  integer(i4), parameter :: cohesion_none = 0, cohesion_constant = 1, cohesion_dmt = 2, &
    cohesion_jkr = 3

  !> Parameters of a pair of materials.
  type :: additional_law_type
    logical :: used = .false.                   !! any of the following
    real(wp) :: rolling = 0.0_wp                !! rolling friction: moment / (R_e force) [-]
    real(wp) :: twisting = 0.0_wp               !! the same about the normal [-]
    real(wp) :: rolling_stiffness = 1.0_wp      !! spring / (k_t R_e^2) [-]
    real(wp) :: twisting_stiffness = 1.0_wp     !! the same about the normal [-]
    real(wp) :: rolling_damping = 0.0_wp        !! fraction of critical, m* R_e^2 as inertia [-]
    integer(i4) :: cohesion = cohesion_none     !! cohesion_...
    real(wp) :: pull = 0.0_wp                   !! of cohesion_constant [N]
    real(wp) :: surface_energy = 0.0_wp         !! w, to part a unit of area [J/m^2]
  end type additional_law_type

  !> The bonds of a run.
  type :: dem_bond_type
    logical :: given = .false.
    real(wp) :: young = 0.0_wp                  !! of the beam [Pa]
    real(wp) :: stiffness_ratio = 1.0_wp        !! normal / shear stiffness [-]
    real(wp) :: radius = 1.0_wp                 !! beam / least semi-axis of the two grains [-]
    real(wp) :: tensile_strength = 0.0_wp       !! [Pa]
    real(wp) :: shear_strength = 0.0_wp         !! [Pa]
    real(wp) :: damping_ratio = 0.0_wp          !! of critical [-]
    real(wp) :: reach = 0.0_wp                  !! grains with at most this gap are bonded [m]
    integer(i8), allocatable :: pairs(:, :)     !! (2, n) ids of the only ones; else all in reach
  end type dem_bond_type

  ! Places of models and laws in the table of parts; what a base law keeps is part_base + its place
  ! in dem_law_registry.
  integer(i4), parameter :: part_rolling = 1, part_cohesion = 2, part_bond = 3, part_base = 3
  integer(i4), parameter :: most_parts = 16

  !> A part of what a contact keeps.
  type :: kept_part_type
    character(len=12) :: name = ''            !! in checkpoints
    integer(i4) :: reals = 0
    integer(i4) :: at = 0                     !! first real, 0: the run does not need it
  end type kept_part_type

  !> Places in what a contact keeps; 0 means that no law needs it.
  type :: kept_places_type
    integer(i4) :: reals = 0                  !! kept for a candidate
    integer(i4) :: rolling_at = 0             !! first of dem_rolling
    integer(i4) :: cohesion_at = 0            !! first of dem_cohesion
    integer(i4) :: bond_at = 0                !! first of dem_bond
    type(kept_part_type) :: part(most_parts)  !! of all laws and models
  end type kept_places_type

  !> What contacts keep; empty unless active.
  type, extends(kept_places_type) :: dem_additional_type
    logical :: active = .false.
    type(dem_bond_type) :: bond
    integer(i8) :: made = 0                   !! bonds at the start
    integer(i8) :: torn = 0, sheared = 0      !! bonds broken so far
    real(wp) :: broken(2) = 0.0_wp            !! the same; of many ranks this one's part
    integer(i8) :: lost = 0                   !! bonds that left the candidate list
    real(wp), allocatable :: kept(:, :, :)    !! (lanes, reals, blocks)
    real(wp), allocatable :: work(:, :)       !! (additional_work_count, blocks) of this step [J]
  end type dem_additional_type
end module dem_additional_state
