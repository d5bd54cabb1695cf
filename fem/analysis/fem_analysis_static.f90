!> kind = 'static': equilibrium at each step, linear or by Newton's method.
module fem_analysis_static
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_hdf5, only: h5_file_type
  use talus_summary, only: summary_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_linear_step, only: linear_step
  use fem_newton, only: newton_step
  use fem_parts, only: fem_scheme_type
  use fem_step_control, only: step_control_type
  implicit none
  private
  public :: fem_analysis_static_type

  type, extends(fem_analysis_type) :: fem_analysis_static_type
    type(step_control_type) :: control  !! of consolidation
  contains
    procedure :: read => read_static
    procedure :: step
    procedure :: check
    procedure :: begin
    procedure :: next_time
    procedure :: put
    procedure :: get
    procedure :: summarise
  end type fem_analysis_static_type

contains

  subroutine read_static(self, deck, scheme, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    self%iterative = .true.
    call deck%get('analysis', 1, 'step_error', self%control%target)
    self%control%active = self%control%target > 0.0_wp
    self%variable = self%control%active
  end subroutine read_static

  subroutine step(self, body, t1, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (self%variable) then
      call controlled_step(self, body, t1, errors)
    else if (body%matter%active) then
      call newton_step(body, t1, errors)
    else
      call linear_step(body, t1, errors)
    end if
  end subroutine step

  !> A step to t1, or a shorter one whose error is below the target. Where Newton's method cut a
  !! step into parts, its error is not known.
  subroutine controlled_step(self, body, t1, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: near = 1.0e-9_wp
    real(wp) :: t0, length, error
    t0 = body%accepted%time
    length = t1 - t0
    do
      call newton_step(body, t0 + length, errors)
      if (errors%any()) return
      error = 1.0_wp
      if (body%accepted%time > t0) exit
      error = self%control%error_of(body)
      if (error <= 1.0_wp .or. length <= (1.0_wp + near)*self%control%shortest) exit
      call body%reject()
      length = max(self%control%shortest, 0.5_wp*length)
      self%control%next = length
    end do
    call self%control%learn(body, error)
  end subroutine controlled_step

  !> Control of the steps, once the body has its start.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    call self%control%begin(body, dt)
    call body%factor(dt, errors)
  end subroutine begin

  pure real(wp) function next_time(self, body)
    class(fem_analysis_static_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    next_time = body%accepted%time + self%control%next
  end function next_time

  subroutine put(self, body, file, errors)
    class(fem_analysis_static_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call self%control%put(file, errors)
  end subroutine put

  subroutine get(self, body, file, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call self%control%get(body, file, errors)
  end subroutine get

  !> Keys of arc length without it (D340); those of linear solids are checked with the laws.
  subroutine check(self, deck, body, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: keys(3) = [character(len=14) :: 'first_share', 'arc_growth', &
      'arc_iterations']
    integer :: k
    if (self%variable .and. .not. body%pore%active) call deck%fault(errors, 'D480', &
      'steps of a solid without pore liquid have no error in time', 'analysis', 1, 'step_error', &
      'leave step_error out')
    if (.not. body%matter%active) return
    do k = 1, size(keys)
      if (.not. deck%given('analysis', 1, trim(keys(k)))) cycle
      call deck%fault(errors, 'D340', trim(keys(k))//' belongs to arc length', 'analysis', 1, &
                      trim(keys(k)), "add continuation = 'arc_length', or leave it out")
    end do
  end subroutine check

  subroutine summarise(self, body, summary)
    class(fem_analysis_static_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(summary_type), intent(inout) :: summary
    call summary%set('health.residual', body%residual)
  end subroutine summarise
end module fem_analysis_static
