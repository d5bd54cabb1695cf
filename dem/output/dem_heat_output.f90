!> Heat in the results: a history of the heat of the grains and of what each boundary has given.
module dem_heat_output
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use talus_history, only: history_type
  use dem_heat, only: heat_content
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: dem_heat_history_type

  character(len=16), parameter :: columns(7) = [character(len=16) :: 'time [s]', 'content [J]', &
    'given [J]', 'closure [J]', 'mean [K]', 'least [K]', 'greatest [K]']

  type :: dem_heat_history_type
    type(history_type) :: history
  contains
    procedure :: open => open_history
    procedure :: write => write_row
  end type dem_heat_history_type

contains

  !> Begin the file of a run with heat, or go on in it after a restart at time >= 0.
  subroutine open_history(self, d, stem, time, errors)
    class(dem_heat_history_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    integer(i4) :: k
    if (.not. d%heat%active) return
    allocate (names(0))
    do k = 1, size(columns)
      call append_string(names, trim(columns(k)))
    end do
    do k = 1, d%heat%boundaries
      call append_string(names, 'given_'//d%heat%name(k)%s//' [J]')
    end do
    call self%history%begin(stem//'_heat.csv', names, time, errors)
  end subroutine open_history

  !> Content of the free grains, heat given by boundaries, what is left over, temperatures.
  subroutine write_row(self, time, d, errors)
    class(dem_heat_history_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: content
    if (.not. self%history%is_open()) return
    content = heat_content(d)
    associate (t => d%heat%temperature)
      call self%history%write([time, content, sum(d%heat%given), &
                               content - d%heat%start - sum(d%heat%given), sum(t)/max(1, size(t)), &
                               minval(t), maxval(t), d%heat%given], errors)
    end associate
  end subroutine write_row
end module dem_heat_output
