!> kind = 'newmark': implicit dynamics with consistent mass.
module fem_analysis_newmark
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_text, only: string_type, append_string
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use talus_summary, only: summary_type
  use fem_analysis, only: fem_analysis_type, demand_times
  use fem_body, only: fem_body_type
  use fem_linear_step, only: linear_step
  use fem_newton, only: newton_step
  use fem_parts, only: fem_scheme_type
  use fem_start, only: start_motion
  implicit none
  private
  public :: fem_analysis_newmark_type

  type, extends(fem_analysis_type) :: fem_analysis_newmark_type
  contains
    procedure :: read => read_newmark
    procedure :: read_times
    procedure :: after_matrices
    procedure :: begin
    procedure :: check_held
    procedure :: step
    procedure :: summarise
  end type fem_analysis_newmark_type

contains

  subroutine read_newmark(self, deck, scheme, errors)
    class(fem_analysis_newmark_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    call scheme%take_inertia(.true.)
    call deck%get('analysis', 1, 'beta', scheme%beta)
    call deck%get('analysis', 1, 'gamma', scheme%gamma)
  end subroutine read_newmark

  subroutine read_times(self, deck, served, errors)
    class(fem_analysis_newmark_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    call deck%get('run', 1, 't_end', self%t_end)
    call deck%get('analysis', 1, 'dt', self%dt)
    if (.not. served) call demand_times(deck, self%t_end, self%dt, .true., errors)
  end subroutine read_times

  subroutine after_matrices(self, deck, body, warnings, errors)
    class(fem_analysis_newmark_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(string_type), allocatable, intent(inout) :: warnings(:)
    type(error_list_type), intent(inout) :: errors
    if (body%limit%step < huge(1.0_wp)) call append_string(warnings, &
      'beta < gamma/2: Newmark is stable up to a step of '//short_number(body%limit%step)//' s')
  end subroutine after_matrices

  !> Accelerations at the start. A coupled run has dt from its first step; after a restart the
  !! factors are for that of the checkpoint, bit for bit.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_newmark_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    if (fresh) call start_motion(body, errors)
    if (errors%any()) return
    if (body%system%restored_dt > 0.0_wp) then
      call body%factor(body%system%restored_dt, errors)
    else if (dt > 0.0_wp) then
      call body%factor(dt, errors)
    end if
  end subroutine begin

  !> Inertia holds the body.
  subroutine check_held(self, body, errors)
    class(fem_analysis_newmark_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
  end subroutine check_held

  subroutine step(self, body, t1, errors)
    class(fem_analysis_newmark_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (body%matter%active) then
      call newton_step(body, t1, errors)
    else
      call linear_step(body, t1, errors)
    end if
  end subroutine step

  subroutine summarise(self, body, summary)
    class(fem_analysis_newmark_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(summary_type), intent(inout) :: summary
    call summary%set('health.residual', body%residual)
  end subroutine summarise
end module fem_analysis_newmark
