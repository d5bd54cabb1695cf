!> kind = 'static' with continuation = 'arc_length': the path of equilibrium, with the
!! load as an unknown. <deck>_arc.csv has its factor.
module fem_analysis_arc
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_text, only: string_type, append_string
  use talus_deck, only: deck_type
  use talus_hdf5, only: h5_file_type
  use fem_analysis_static, only: fem_analysis_static_type
  use fem_arc, only: fem_arc_data_type, arc_step, put_arc, get_arc
  use fem_body, only: fem_body_type
  use fem_parts, only: fem_scheme_type
  implicit none
  private
  public :: fem_analysis_arc_type

  type, extends(fem_analysis_static_type) :: fem_analysis_arc_type
    type(fem_arc_data_type) :: path
  contains
    procedure :: read => read_arc
    procedure :: check
    procedure :: check_port
    procedure :: read_times
    procedure :: step
    procedure :: put
    procedure :: get
    procedure :: columns
    procedure :: row
  end type fem_analysis_arc_type

contains

  subroutine read_arc(self, deck, scheme, errors)
    class(fem_analysis_arc_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    self%table = 'arc'
    self%path%settled = deck%count('geostatic') + deck%count('initial_stress') > 0
    if (deck%given('analysis', 1, 'first_share')) &
      call deck%get('analysis', 1, 'first_share', self%path%first)
    call deck%get('analysis', 1, 'arc_growth', self%path%growth)
    call deck%get('analysis', 1, 'arc_iterations', self%path%wanted)
  end subroutine read_arc

  subroutine check(self, deck, body, errors)
    class(fem_analysis_arc_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    if (body%matter%active .and. deck%count('stage') > 0) call deck%fault(errors, 'D340', &
      'stages have times, which a path by arc length has not', 'analysis', 1, 'continuation', &
      'use one of both')
  end subroutine check

  subroutine check_port(self, deck, errors)
    class(fem_analysis_arc_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    call deck%fault(errors, 'D340', 'a coupled run is not followed by arc length', 'analysis', 1, &
                    'continuation', 'leave it out')
  end subroutine check_port

  !> The loads and motions at the end have the factor one.
  subroutine read_times(self, deck, served, errors)
    class(fem_analysis_arc_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    call self%fem_analysis_static_type%read_times(deck, served, errors)
    self%path%t_end = self%t_end
    if (.not. self%path%first > 0.0_wp .and. self%t_end > 0.0_wp) &
      self%path%first = self%dt/self%t_end
  end subroutine read_times

  subroutine step(self, body, t1, errors)
    class(fem_analysis_arc_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    call arc_step(body, self%path, t1, errors)
  end subroutine step

  subroutine put(self, body, file, errors)
    class(fem_analysis_arc_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call put_arc(self%path, file, errors)
  end subroutine put

  subroutine get(self, body, file, errors)
    class(fem_analysis_arc_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call get_arc(self%path, body%dofs%blocks, file, errors)
  end subroutine get

  subroutine columns(self, body, names)
    class(fem_analysis_arc_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable, intent(out) :: names(:)
    call append_string(names, 'time [s]')
    call append_string(names, 'load factor [-]')
    call append_string(names, 'next radius [m]')
    call append_string(names, 'iterations [-]')
    call append_string(names, 'limit points [-]')
  end subroutine columns

  subroutine row(self, body, values)
    class(fem_analysis_arc_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable, intent(out) :: values(:)
    values = [body%accepted%time, self%path%factor, self%path%radius, &
              real([self%path%iterations, self%path%limits], wp)]
  end subroutine row
end module fem_analysis_arc
