!> kind = 'explicit': central differences with lumped mass, steps below the largest stable one.
module fem_analysis_explicit
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str, string_type, append_string
  use talus_deck, only: deck_type
  use talus_log, only: log_type, short_number
  use fem_analysis, only: fem_analysis_type, demand_times, own_steps
  use fem_body, only: fem_body_type
  use fem_central, only: central_step, central_steps
  use fem_critical, only: scale_rotations
  use fem_parts, only: fem_scheme_type
  use fem_start, only: start_motion
  implicit none
  private
  public :: fem_analysis_explicit_type

  type, extends(fem_analysis_type) :: fem_analysis_explicit_type
  contains
    procedure :: read => read_explicit
    procedure :: read_times
    procedure :: before_matrices
    procedure :: after_matrices
    procedure :: begin
    procedure :: check_held
    procedure :: steps_between
    procedure :: step
    procedure :: describe
  end type fem_analysis_explicit_type

contains

  subroutine read_explicit(self, deck, scheme, errors)
    class(fem_analysis_explicit_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    self%solves = .false.
    call scheme%take_inertia(.true.)
    scheme%explicit = .true.
  end subroutine read_explicit

  subroutine read_times(self, deck, served, errors)
    class(fem_analysis_explicit_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    call deck%get('run', 1, 't_end', self%t_end)
    call deck%get('analysis', 1, 'dt', self%dt)
    if (.not. served) call demand_times(deck, self%t_end, self%dt, .false., errors)
  end subroutine read_times

  !> Rotational mass scaling.
  subroutine before_matrices(self, deck, body, warnings)
    class(fem_analysis_explicit_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(string_type), allocatable, intent(inout) :: warnings(:)
    real(wp) :: factor, most
    call deck%get('analysis', 1, 'rotation_mass', factor)
    if (body%dofs%blocks == body%mesh%nodes .or. abs(factor - 1.0_wp) <= 0.0_wp) return
    call scale_rotations(body%mesh, body%dofs, body%elastic, factor, most)
    call append_string(warnings, 'micro-inertia is raised by up to '//short_number(most)// &
                       ' (rotation_mass)')
  end subroutine before_matrices

  !> The step of the run: that of the deck, or a factor times the largest stable one and a whole
  !! number of them to t_end. Fault D324 for one that is too long.
  subroutine after_matrices(self, deck, body, warnings, errors)
    class(fem_analysis_explicit_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(string_type), allocatable, intent(inout) :: warnings(:)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: factor
    logical :: allowed

    call deck%get('analysis', 1, 'dt_factor', factor)
    call deck%get('analysis', 1, 'allow_unstable', allowed)
    if (self%dt > body%limit%step) then
      if (allowed) then
        call append_string(warnings, 'dt is '//short_number(self%dt/body%limit%step)// &
                           ' times the largest stable step (allow_unstable)')
      else
        call deck%fault(errors, 'D324', 'dt = '//short_number(self%dt)// &
          ' s is above the largest stable step '//short_number(body%limit%step)// &
          ' s, which element '//str(body%limit%stiffest)//' sets', 'analysis', 1, 'dt', &
            'leave dt out')
      end if
    else if (.not. self%dt > 0.0_wp) then
      self%dt = factor*body%limit%step
      if (self%t_end > 0.0_wp) self%dt = self%t_end/ceiling(self%t_end/self%dt, i8)
    end if
  end subroutine after_matrices

  !> Accelerations at the start; there is nothing to factor.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_explicit_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    if (fresh) call start_motion(body, errors)
  end subroutine begin

  !> Inertia holds the body.
  subroutine check_held(self, body, errors)
    class(fem_analysis_explicit_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
  end subroutine check_held

  !> No step at the port is longer than the largest stable one.
  integer(i4) function steps_between(self, body, t0, t1)
    class(fem_analysis_explicit_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: t0, t1  !! [s]
    steps_between = max(own_steps(self%dt, t0, t1), ceiling((t1 - t0)/body%safe_step()))
  end function steps_between

  subroutine step(self, body, t1, errors)
    class(fem_analysis_explicit_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (body%matter%active) then
      call central_steps(body, t1, errors)
    else
      call central_step(body, t1, errors)
    end if
  end subroutine step

  subroutine describe(self, body, log)
    class(fem_analysis_explicit_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
    call log%item('largest stable step', short_number(body%limit%step)//' s', &
                  'dt '//short_number(self%dt)//' s')
  end subroutine describe
end module fem_analysis_explicit
