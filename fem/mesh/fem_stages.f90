!> Stages of construction: groups of elements that are removed or placed at given times, and what is
!! then out of balance, which is released along a curve. Data only; fem_staging applies them.
module fem_stages
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: fem_stages_type, fem_stage_type, next_stage

  !> One removal or placing.
  type :: fem_stage_type
    logical :: place = .false.
    real(wp) :: time = 0.0_wp      !! [s]
    real(wp) :: duration = 0.0_wp  !! over which the release decreases to zero [s]
    integer(i4), allocatable :: element(:)
  end type fem_stage_type

  type :: fem_stages_type
    logical :: active = .false.
    type(fem_stage_type), allocatable :: stage(:)  !! in the order of their times
    integer(i4) :: done = 0                        !! the first of them
    integer(i4) :: load = 0                        !! place of the release among the loads
    integer(i4) :: curve = 0                       !! and of its curve
    real(wp), allocatable :: density(:)            !! (elements) when they are there [kg/m^3]
    real(wp), allocatable :: stress(:, :), state(:, :)  !! of all points when they are placed
  end type fem_stages_type

contains

  !> Time of the first stage that is to come, at most `latest` [s].
  pure real(wp) function next_stage(stages, latest)
    type(fem_stages_type), intent(in) :: stages
    real(wp), intent(in) :: latest
    next_stage = latest
    if (stages%done < size(stages%stage)) &
      next_stage = min(latest, stages%stage(stages%done + 1)%time)
  end function next_stage
end module fem_stages
