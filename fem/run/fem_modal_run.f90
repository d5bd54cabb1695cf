!> An analysis of kind 'modal': finds the modes, writes <stem>_modes.csv and a field step a mode,
!! whose time is the number of the mode.
module fem_modal_run
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use fem_modal, only: fem_modes_type, find_modes
  use fem_model, only: fem_model_type
  implicit none
  private
  public :: run_modal

contains

  !> Modes of the body of a model that is open.
  subroutine run_modal(model, errors)
    type(fem_model_type), intent(inout) :: model
    type(error_list_type), intent(inout) :: errors
    type(fem_modes_type) :: modes
    real(wp) :: tolerance
    integer(i4) :: wanted, most, k

    call model%deck%get('analysis', 1, 'modes', wanted)
    call model%deck%get('analysis', 1, 'tolerance', tolerance)
    call model%deck%get('analysis', 1, 'max_iterations', most)
    call model%timers%start('modes')
    call find_modes(model%body, wanted, tolerance, most, modes, errors)
    call model%timers%stop('modes')
    if (errors%any()) return
    call model%log_factors()
    call model%log%item('subspace iterations', str(modes%iterations))
    call write_table(model%stem//'_modes.csv', modes, errors)
    do k = 1, modes%n
      call model%log%item('mode '//str(k), short_number(frequency(modes%omega(k)))//' Hz', &
                          'residual '//short_number(modes%residual(k)))
      associate (state => model%body%state)
        state%time = real(k, wp)
        state%u = modes%shape(:, :, k)/maxval(abs(modes%shape(:, :model%body%mesh%nodes, k)))
        state%v = 0.0_wp
        state%reaction = 0.0_wp
      end associate
      call model%body%accept()
      if (model%output%every_output > 0.0_wp) call model%output%write_fields(model%body, errors)
      if (errors%any()) return
      model%steps = model%steps + 1
    end do
  end subroutine run_modal

  pure real(wp) function frequency(omega)
    real(wp), intent(in) :: omega
    frequency = omega/(8.0_wp*atan(1.0_wp))
  end function frequency

  subroutine write_table(path, modes, errors)
    character(len=*), intent(in) :: path
    type(fem_modes_type), intent(in) :: modes
    type(error_list_type), intent(inout) :: errors
    type(history_type) :: file
    type(string_type), allocatable :: columns(:)
    integer(i4) :: k
    call append_string(columns, 'mode [-]')
    call append_string(columns, 'omega [rad/s]')
    call append_string(columns, 'frequency [Hz]')
    call append_string(columns, 'residual [-]')
    call append_string(columns, 'mass x [kg]')
    call append_string(columns, 'mass y [kg]')
    call append_string(columns, 'mass z [kg]')
    call file%open(path, columns, .false., errors)
    if (errors%any()) return
    do k = 1, modes%n
      call file%write([real(k, wp), modes%omega(k), frequency(modes%omega(k)), &
                       modes%residual(k), modes%mass(:, k)], errors)
    end do
    call file%close(errors)
  end subroutine write_table
end module fem_modal_run
