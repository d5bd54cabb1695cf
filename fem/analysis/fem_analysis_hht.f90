!> kind = 'hht': Newmark's relations with a balance between the two ends of a step (Hilber, Hughes
!! and Taylor 1977), which dissipates high frequencies.
module fem_analysis_hht
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_analysis_newmark, only: fem_analysis_newmark_type
  use fem_parts, only: fem_scheme_type
  implicit none
  private
  public :: fem_analysis_hht_type

  type, extends(fem_analysis_newmark_type) :: fem_analysis_hht_type
  contains
    procedure :: read => read_hht
  end type fem_analysis_hht_type

contains

  subroutine read_hht(self, deck, scheme, errors)
    class(fem_analysis_hht_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    real(wp) :: alpha
    call deck%get('analysis', 1, 'alpha', alpha)
    call scheme%take_inertia(.true.)
    scheme%lag = -alpha
    scheme%beta = 0.25_wp*(1.0_wp - alpha)**2
    scheme%gamma = 0.5_wp - alpha
  end subroutine read_hht
end module fem_analysis_hht
