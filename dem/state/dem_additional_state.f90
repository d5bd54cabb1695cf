!> Additional contact models of a run, and what contacts keep for laws and models.
!!
!! What is kept is in arrays of its own, which are allocated only if a law or model of the run needs
!! them.
module dem_additional_state
  use talus_kinds, only: wp, i4, i8
  use dem_additional_model, only: additional_model_type
  use dem_additional_numbers, only: most_models, most_own
  implicit none
  private
  public :: kept_part_type, kept_places_type, dem_additional_type, dem_bond_type
  public :: dem_liquid_type, liquid_size
  public :: part_of_law, part_of_model, kept_range, most_parts, most_laws
  public :: turning_reals, turning_knots

  integer(i4), parameter :: liquid_size = 6       !! reals of dem_liquid_type
  integer(i4), parameter :: turning_knots = 26    !! knots that a contact keeps
  integer(i4), parameter :: turning_reals = 3 + 4*turning_knots  !! kept by dem_turning

  ! The table of parts is in checkpoints: three models, base laws, further models.
  integer(i4), parameter :: first_models = 3
  integer(i4), parameter :: most_laws = 8         !! room in dem_law_registry
  integer(i4), parameter :: most_parts = most_models + most_laws

  !> The bonds of a run; their constants are those of the model in dem_additional_type.
  type :: dem_bond_type
    logical :: given = .false.
    integer(i8), allocatable :: pairs(:, :)   !! (2, n) ids of the only ones; else all in reach
  end type dem_bond_type

  !> Capillary bridges so far; of many ranks this one's part.
  type :: dem_liquid_type
    real(wp) :: formed = 0.0_wp, ruptured = 0.0_wp  !! bridges
    real(wp) :: drawn = 0.0_wp, returned = 0.0_wp   !! liquid into and out of bridges [m^3]
    real(wp) :: bridges = 0.0_wp, held = 0.0_wp     !! there now, at the last report of the ranks
  end type dem_liquid_type

  !> A part of what a contact keeps.
  type :: kept_part_type
    character(len=12) :: name = ''            !! in checkpoints
    integer(i4) :: reals = 0
    integer(i4) :: at = 0                     !! first real, 0: the run does not need it
    logical :: holds = .false.                !! over a gap, where the first real is > 0
    logical :: at_surfaces = .true.           !! contacts with surfaces keep it, too
  end type kept_part_type

  !> Places in what a contact keeps.
  type :: kept_places_type
    integer(i4) :: reals = 0                  !! kept for a candidate
    type(kept_part_type) :: part(most_parts)  !! of all laws and models
  contains
    procedure :: first_of
  end type kept_places_type

  !> What contacts keep; empty unless active.
  type, extends(kept_places_type) :: dem_additional_type
    logical :: active = .false.
    integer(i4) :: models = 0                        !! in the registry
    type(additional_model_type) :: model(most_models)
    logical :: of_run(most_models) = .false.         !! acts between all grains
    real(wp) :: own(most_own, most_models) = 0.0_wp  !! its constants then
    type(dem_bond_type) :: bond
    integer(i8) :: made = 0                   !! bonds at the start
    integer(i8) :: torn = 0, sheared = 0      !! bonds broken so far
    real(wp) :: broken(2) = 0.0_wp            !! the same; of many ranks this one's part
    integer(i8) :: lost = 0                   !! bonds that left the candidate list
    type(dem_liquid_type) :: liquid           !! of capillary bridges
    real(wp), allocatable :: kept(:, :, :)    !! (lanes, reals, blocks)
    real(wp), allocatable :: work(:, :)       !! (additional_work_count, blocks) of this step [J]
  end type dem_additional_type

contains

  !> First of the reals that a law or model of this name keeps; 0: the run does not need it.
  pure integer(i4) function first_of(self, name) result(at)
    class(kept_places_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i4) :: k
    at = 0
    do k = 1, size(self%part)
      if (self%part(k)%name == name) at = self%part(k)%at
    end do
  end function first_of

  !> Part of a base law, by its place in dem_law_registry.
  pure integer(i4) function part_of_law(kind) result(part)
    integer(i4), intent(in) :: kind
    part = first_models + kind
  end function part_of_law

  !> Part of a model, by its place in dem_additional_registry.
  pure integer(i4) function part_of_model(m) result(part)
    integer(i4), intent(in) :: m
    part = m
    if (m > first_models) part = most_laws + m
  end function part_of_model

  !> First and last real of a part; none: [1, 0].
  pure function kept_range(part) result(range)
    type(kept_part_type), intent(in) :: part
    integer(i4) :: range(2)
    range = [1, 0]
    if (part%at > 0) range = [part%at, part%at + part%reals - 1]
  end function kept_range
end module dem_additional_state
