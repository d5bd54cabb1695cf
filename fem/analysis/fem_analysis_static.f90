!> kind = 'static': equilibrium at each step, linear or by Newton's method.
module fem_analysis_static
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_summary, only: summary_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_linear_step, only: linear_step
  use fem_newton, only: newton_step
  use fem_parts, only: fem_scheme_type
  implicit none
  private
  public :: fem_analysis_static_type

  type, extends(fem_analysis_type) :: fem_analysis_static_type
  contains
    procedure :: read => read_static
    procedure :: step
    procedure :: check
    procedure :: summarise
  end type fem_analysis_static_type

contains

  subroutine read_static(self, deck, scheme, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    self%iterative = .true.
  end subroutine read_static

  subroutine step(self, body, t1, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (body%matter%active) then
      call newton_step(body, t1, errors)
    else
      call linear_step(body, t1, errors)
    end if
  end subroutine step

  !> Keys of arc length without it (D340); those of linear solids are checked with the laws.
  subroutine check(self, deck, body, errors)
    class(fem_analysis_static_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: keys(3) = [character(len=14) :: 'first_share', 'arc_growth', &
      'arc_iterations']
    integer :: k
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
