!> The surcharge on grains of one rank or of many: the leader holds all grains and sends their
!! forces to the ranks.
module dem_surcharge_renew
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use dem_clock, only: dem_clock_type
  use dem_surcharge, only: dem_surcharge_type
  use dem_system, only: dem_system_type
  use dem_view, only: see_grains
  implicit none
  private
  public :: renew_surcharge

contains

  !> Determine the surface again, or (first) at the start of a run, when the extra forces of a
  !! checkpoint without surcharge are removed.
  subroutine renew_surcharge(surcharge, system, clock, first, errors)
    type(dem_surcharge_type), intent(inout) :: surcharge
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    logical, intent(in) :: first
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: before(:, :)
    real(wp) :: start
    if (.not. (surcharge%active .or. allocated(system%surcharge))) return
    call see_grains(system)
    allocate (before, source=system%grains%extra_force)
    start = system%ledger%start
    if (first) then
      call surcharge%start(system%dem_data_type, system%springs%load, clock%time(), clock%steps, &
                           errors)
    else
      call surcharge%update(system%dem_data_type, clock%time(), clock%steps, errors)
    end if
    call system%loads_changed(before)
    call system%start_moved(start)
  end subroutine renew_surcharge
end module dem_surcharge_renew
