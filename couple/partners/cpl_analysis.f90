!> Does the analysis of the solid fit the way of coupling? Asked of the answer to HELLO, and by
!! --check of what the solver's own check says of its deck.
module cpl_analysis
  use talus_errors, only: error_list_type
  use cpl_choices, only: cpl_choices_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: check_analysis

contains

  !> D414 relaxed together with a solid that has inertia, or exchanged in pieces (D418), D417 facets
  !! of an explicit solid, D422 an overlap with a solid that is not explicit, or not static.
  subroutine check_analysis(solid, choices, errors)
    type(cpl_solver_type), intent(in) :: solid
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors

    if (choices%overlap%given) then
      call check_overlap(solid, choices%overlap%scheme == 'static', errors)
      return
    end if
    if (solid%analysis == 'explicit') &
      call errors%add('D417', '&facets needs a solid that solves for its step, '//solid%title()// &
                      ' is explicit', solid%deck, "write &analysis kind = 'static', 'newmark' "// &
                      "or 'hht', or couple an explicit solid by &overlap")
    if (choices%relaxed .and. solid%analysis /= 'static') &
      call errors%add('D414', "initial = 'relax' needs a static solid, "//solid%title()// &
                      ' is dynamic ('//solid%analysis//')', solid%deck, "write initial = "// &
                      "'dead_load', or &analysis kind = 'static' in the solid's deck")
    if (choices%pieces > 1 .and. solid%analysis /= 'static') &
      call errors%add('D418', '&clock pieces need a static solid, '//solid%title()// &
                      ' is dynamic ('//solid%analysis//')', solid%deck, &
                      'leave pieces out: the step of a dynamic solid is the exchange')
  end subroutine check_analysis

  subroutine check_overlap(solid, static, errors)
    type(cpl_solver_type), intent(in) :: solid
    logical, intent(in) :: static  !! scheme of the overlap
    type(error_list_type), intent(inout) :: errors
    if (static .and. solid%analysis /= 'static') then
      call errors%add('D422', solid%title()//' is not static', solid%deck, &
                      "write &analysis kind = 'static', or another scheme in &overlap")
    else if (.not. static .and. solid%analysis /= 'explicit') then
      call errors%add('D422', solid%title()//' does not step explicitly', solid%deck, &
                      "write &analysis kind = 'explicit', or for a static solid &overlap "// &
                      "scheme = 'static'")
    end if
  end subroutine check_overlap
end module cpl_analysis
