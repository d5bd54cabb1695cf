!> History of the liquid in capillary bridges (CSV): what was drawn and returned, what is held, and
!! what of it went with grains that left.
module dem_liquid
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_history, only: history_type
  use dem_liquid_counts, only: capillary_at, held_liquid
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: dem_liquid_history_type

  character(len=18), parameter :: columns(8) = [character(len=18) :: 'time [s]', 'bridges [-]', &
    'held [m3]', 'formed [-]', 'ruptured [-]', 'drawn [m3]', 'returned [m3]', 'balance [m3]']

  type :: dem_liquid_history_type
    type(history_type) :: history
  contains
    procedure :: open => open_history
    procedure :: write => write_row
  end type dem_liquid_history_type

contains

  !> Begin the file of a run with bridges, or go on in it after a restart at time >= 0.
  subroutine open_history(self, d, stem, time, errors)
    class(dem_liquid_history_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (capillary_at(d%pairs%additional) > 0) &
      call self%history%begin(stem//'_liquid.csv', columns, time, errors)
  end subroutine open_history

  subroutine write_row(self, time, d, errors)
    class(dem_liquid_history_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: held(2)
    if (.not. self%history%is_open()) return
    held = held_liquid(d)
    associate (l => d%pairs%additional%liquid)
      call self%history%write([time, held, l%formed, l%ruptured, l%drawn, l%returned, &
                               l%drawn - l%returned - held(2)], errors)
    end associate
  end subroutine write_row
end module dem_liquid
