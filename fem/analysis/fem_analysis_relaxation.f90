!> kind = 'relaxation': equilibrium at each step by a damped pseudo-motion.
module fem_analysis_relaxation
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_log, only: log_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_parts, only: fem_scheme_type
  use fem_relaxation, only: relax
  use fem_supports, only: check_supports
  implicit none
  private
  public :: fem_analysis_relaxation_type

  type, extends(fem_analysis_type) :: fem_analysis_relaxation_type
    real(wp) :: tolerance = 1.0e-8_wp       !! residual over loads and reactions [-]
    integer(i4) :: most_iterations = 100000 !! of a step
    integer(i4) :: iterations = 0           !! of the last one
  contains
    procedure :: read => read_relaxation
    procedure :: check_port
    procedure :: begin
    procedure :: step
    procedure :: report
  end type fem_analysis_relaxation_type

contains

  subroutine read_relaxation(self, deck, scheme, errors)
    class(fem_analysis_relaxation_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    call scheme%keep_linear(massive=.false.)
    if (deck%given('analysis', 1, 'tolerance')) &
      call deck%get('analysis', 1, 'tolerance', self%tolerance)
    if (deck%given('analysis', 1, 'max_iterations')) &
      call deck%get('analysis', 1, 'max_iterations', self%most_iterations)
  end subroutine read_relaxation

  subroutine check_port(self, deck, errors)
    class(fem_analysis_relaxation_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    call deck%fault(errors, 'D325', 'a coupled run is not relaxed', 'analysis', 1, 'kind', &
                    "take kind = 'static'")
  end subroutine check_port

  !> There is nothing to factor.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_relaxation_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    call check_supports(body%mesh, body%dofs, body%system%pattern, body%supports%held, &
      body%supports%ground, errors)
  end subroutine begin

  subroutine step(self, body, t1, errors)
    class(fem_analysis_relaxation_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    call relax(body, t1, self%tolerance, self%most_iterations, self%iterations, errors)
  end subroutine step

  subroutine report(self, body, log)
    class(fem_analysis_relaxation_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
    call log%item('relaxed', str(self%iterations)//' iterations')
  end subroutine report
end module fem_analysis_relaxation
