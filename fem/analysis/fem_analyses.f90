!> The registry of analyses: one line each. No other module names them.
module fem_analyses
  use talus_deck, only: deck_type
  use fem_analysis, only: fem_analysis_type
  use fem_analysis_arc, only: fem_analysis_arc_type
  use fem_analysis_explicit, only: fem_analysis_explicit_type
  use fem_analysis_harmonic, only: fem_analysis_harmonic_type
  use fem_analysis_hht, only: fem_analysis_hht_type
  use fem_analysis_modal, only: fem_analysis_modal_type
  use fem_analysis_newmark, only: fem_analysis_newmark_type
  use fem_analysis_relaxation, only: fem_analysis_relaxation_type
  use fem_analysis_stages, only: fem_analysis_stages_type
  use fem_analysis_static, only: fem_analysis_static_type
  implicit none
  private
  public :: choose_analysis

contains

  !> The analysis of the deck: that of `kind`, in statics that of `continuation` or of
  !! the stages.
  subroutine choose_analysis(deck, analysis)
    type(deck_type), intent(in) :: deck
    class(fem_analysis_type), allocatable, intent(out) :: analysis
    character(len=:), allocatable :: kind, continuation, name
    call deck%get('analysis', 1, 'kind', kind)
    call deck%get('analysis', 1, 'continuation', continuation)
    name = kind
    if (kind == 'static' .and. deck%count('stage') > 0) name = 'stages'
    if (kind == 'static' .and. continuation /= 'load') name = continuation
    select case (name)
    case ('static'); allocate (fem_analysis_static_type :: analysis)
    case ('stages'); allocate (fem_analysis_stages_type :: analysis)
    case ('arc_length'); allocate (fem_analysis_arc_type :: analysis)
    case ('relaxation'); allocate (fem_analysis_relaxation_type :: analysis)
    case ('newmark'); allocate (fem_analysis_newmark_type :: analysis)
    case ('hht'); allocate (fem_analysis_hht_type :: analysis)
    case ('explicit'); allocate (fem_analysis_explicit_type :: analysis)
    case ('harmonic'); allocate (fem_analysis_harmonic_type :: analysis)
    case ('modal'); allocate (fem_analysis_modal_type :: analysis)
    case default; error stop 'bug: a kind of deck.toml is not in the registry of analyses'
    end select
    analysis%kind = kind
    call deck%get('analysis', 1, 'follows', analysis%follows)
    if (.not. allocated(analysis%table)) analysis%table = ''
  end subroutine choose_analysis
end module fem_analyses
