!> kind = 'modal': the lowest free vibrations. <deck>_modes.csv has a row a mode; a field step has
!! its shape, the time is the number of the mode.
module fem_analysis_modal
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str, string_type, append_string
  use talus_deck, only: deck_type
  use talus_log, only: log_type, short_number
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_modal, only: fem_modes_type, find_modes
  use fem_parts, only: fem_scheme_type
  implicit none
  private
  public :: fem_analysis_modal_type

  type, extends(fem_analysis_type) :: fem_analysis_modal_type
    integer(i4) :: wanted = 0, most_iterations = 0
    real(wp) :: tolerance = 0.0_wp  !! relative, of the squared frequencies [-]
    integer(i4) :: mode = 0         !! the present one
    type(fem_modes_type) :: modes
  contains
    procedure :: read => read_modal
    procedure :: check_port
    procedure :: begin
    procedure :: complete
    procedure :: step
    procedure :: columns
    procedure :: row
    procedure :: report
  end type fem_analysis_modal_type

contains

  subroutine read_modal(self, deck, scheme, errors)
    class(fem_analysis_modal_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    self%table = 'modes'
    self%listed = .true.
    call scheme%keep_linear(massive=.true.)
    call deck%get('analysis', 1, 'modes', self%wanted)
    call deck%get('analysis', 1, 'tolerance', self%tolerance)
    call deck%get('analysis', 1, 'max_iterations', self%most_iterations)
  end subroutine read_modal

  subroutine check_port(self, deck, errors)
    class(fem_analysis_modal_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    call deck%fault(errors, 'D325', 'a coupled run does not support modes', 'analysis', 1, 'kind', &
                    'run this deck alone')
  end subroutine check_port

  !> Factors are computed with the modes; a mode is a step of one.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_modal_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    self%dt = 1.0_wp
    self%t_end = real(self%wanted, wp)
  end subroutine begin

  logical function complete(self, body)
    class(fem_analysis_modal_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    complete = self%modes%n > 0 .and. self%mode >= self%modes%n
  end function complete

  !> The next mode; all are found with the first.
  subroutine step(self, body, t1, errors)
    class(fem_analysis_modal_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! number of the mode
    type(error_list_type), intent(inout) :: errors
    if (self%modes%n == 0) call find_modes(body, self%wanted, self%tolerance, &
                                           self%most_iterations, self%modes, errors)
    if (errors%any()) return
    self%mode = self%mode + 1
    self%t_end = real(self%modes%n, wp)
    associate (state => body%state, shape => self%modes%shape(:, :, self%mode))
      state%time = real(self%mode, wp)
      state%u = shape/maxval(abs(shape(:, :body%mesh%nodes)))
      state%v = 0.0_wp
      state%reaction = 0.0_wp
    end associate
  end subroutine step

  subroutine columns(self, body, names)
    class(fem_analysis_modal_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable, intent(out) :: names(:)
    call append_string(names, 'mode [-]')
    call append_string(names, 'omega [rad/s]')
    call append_string(names, 'frequency [Hz]')
    call append_string(names, 'residual [-]')
    call append_string(names, 'mass x [kg]')
    call append_string(names, 'mass y [kg]')
    call append_string(names, 'mass z [kg]')
  end subroutine columns

  subroutine row(self, body, values)
    class(fem_analysis_modal_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable, intent(out) :: values(:)
    associate (m => self%modes, k => self%mode)
      values = [real(k, wp), m%omega(k), frequency(m%omega(k)), m%residual(k), m%mass(:, k)]
    end associate
  end subroutine row

  subroutine report(self, body, log)
    class(fem_analysis_modal_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
    if (self%mode == 0) return
    if (self%mode == 1) call log%item('subspace iterations', str(self%modes%iterations))
    call log%item('mode '//str(self%mode), &
                  short_number(frequency(self%modes%omega(self%mode)))//' Hz', &
                  'residual '//short_number(self%modes%residual(self%mode)))
  end subroutine report

  pure real(wp) function frequency(omega)
    real(wp), intent(in) :: omega
    frequency = omega/(8.0_wp*atan(1.0_wp))
  end function frequency
end module fem_analysis_modal
