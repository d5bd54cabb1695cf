!> Does the analysis of the solid fit the way of coupling? Asked of the answer to HELLO, and by
!! --check of what the solver's own check says of its deck.
module cpl_analysis
  use talus_errors, only: error_list_type
  use cpl_choices, only: cpl_choices_type, interface_springs, rotation_micro, scheme_iterated, &
    scheme_symmetric
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: check_analysis

contains

  !> D414 relaxed together with a solid that has inertia, or exchanged in pieces (D418), D417 and
  !! D419 schemes that do not fit an explicit solid, or only that, D422 an overlap with a solid that
  !! is not explicit, or not static.
  subroutine check_analysis(solid, choices, errors)
    type(cpl_solver_type), intent(in) :: solid
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors

    if (choices%overlap%given) then
      call check_overlap(solid, choices%overlap%scheme == 'static', errors)
      return
    end if
    call check_explicit(solid, choices, errors)
    if (choices%relaxed .and. solid%analysis /= 'static') &
      call errors%add('D414', "initial = 'relax' needs a static solid, "//solid%title()// &
                      ' is dynamic ('//solid%analysis//')', solid%deck, "write initial = "// &
                      "'dead_load', or &analysis kind = 'static' in the solid's deck")
    if (choices%pieces > 1 .and. solid%analysis /= 'static') &
      call errors%add('D418', '&clock pieces need a static solid, '//solid%title()// &
                      ' is dynamic ('//solid%analysis//')', solid%deck, &
                      'leave pieces out: the step of a dynamic solid is the exchange')
  end subroutine check_analysis

  subroutine check_explicit(solid, choices, errors)
    type(cpl_solver_type), intent(in) :: solid
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors

    if (choices%scheme == scheme_symmetric) then
      if (solid%analysis /= 'explicit') &
        call errors%add('D419', "scheme = 'symmetric' kicks a solid that steps explicitly, "// &
                        solid%title()//' does not', solid%deck, "write &analysis kind = "// &
                        "'explicit', or &clock scheme = 'average' or 'iterated'")
      if (choices%rotation == rotation_micro) &
        call errors%add('D419', "scheme = 'symmetric' kicks displacements alone", solid%deck, &
                        "write &clock scheme = 'iterated' with rotation = 'micro'")
    else if (solid%analysis == 'explicit') then
      if (choices%scheme /= scheme_iterated) &
        call errors%add('D417', "scheme = '"//choices%scheme_name//"' feeds energy to "// &
                        solid%title()//', which is explicit', solid%deck, "write &clock "// &
                        "scheme = 'symmetric', or 'iterated'")
      if (choices%interface == interface_springs) &
        call errors%add('D417', "interface = 'springs' needs a solid that solves for its step, "// &
                        solid%title()//' is explicit', solid%deck, "write interface = 'none'")
    end if
  end subroutine check_explicit

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
