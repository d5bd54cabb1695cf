!> What a coupled run asks of its solvers, beside the capabilities that they name in HELLO; another
!! version of the same protocol is worth a warning and no more.
module cpl_capabilities
  use talus_kinds, only: i4
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use talus_log, only: log_type
  use talus_port_names, only: can_advance, can_dead_load, can_force, can_impulse, &
    can_kick_drift, can_load, &
    can_pore, can_prescribe, can_rehearsal, can_reject, can_report, can_solve, can_springs, &
    can_surface
  use talus_version, only: version_text
  use cpl_choices, only: cpl_choices_type, interface_springs, scheme_iterated, scheme_symmetric
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: check_capabilities, warn_of_versions

contains

  !> One fault for each capability that the coupled deck needs and a solver lacks (P411); a liquid
  !! that nothing says of how it meets the other side (D454).
  subroutine check_capabilities(solvers, choices, errors)
    type(cpl_solver_type), intent(in) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: needed(:)
    integer(i4) :: side, k

    do side = 1, 2
      if (choices%pore%given .or. .not. solvers(side)%can(can_pore)) cycle
      if (side == side_solid .and. .not. choices%overlap%given) cycle
      call errors%add('D454', solvers(side)%title()//' has a liquid in its pores', &
                      solvers(side)%deck, 'add &pore_interface to the coupled deck; in an '// &
                      'overlap leave the liquid out')
    end do
    do side = 1, 2
      if (choices%overlap%given) then
        call needs_of_overlap(side, choices, needed)
      else
        call needs_of_facets(side, choices, solvers(side_solid)%analysis == 'explicit', needed)
      end if
      do k = 1, size(needed)
        if (.not. solvers(side)%can(needed(k)%s)) &
          call errors%add('P411', solvers(side)%title()//" lacks the capability '"// &
                          needed(k)%s//"', which the coupled deck needs", solvers(side)%deck, &
                          "it names '"//solvers(side)%capabilities//"'")
      end do
    end do
  end subroutine check_capabilities

  !> Capabilities for &facets.
  subroutine needs_of_facets(side, choices, explicit, needed)
    integer(i4), intent(in) :: side  !! side_grains or side_solid
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: explicit  !! the solid steps explicitly
    type(string_type), allocatable, intent(out) :: needed(:)

    allocate (needed(0))
    if (choices%scheme == scheme_iterated) call append_string(needed, can_reject)
    if (choices%pore%given .and. (side == side_grains .or. choices%pore%permeable)) &
      call append_string(needed, can_pore)
    if (side == side_grains) then
      call append_string(needed, can_advance)
      if (len(choices%surface) > 0) then
        call append_string(needed, can_surface)
      else
        call append_string(needed, can_prescribe)
      end if
    else
      call append_string(needed, can_load)
      if (.not. explicit) call append_string(needed, can_solve)
      if (explicit) call append_string(needed, can_advance)
      if (choices%scheme == scheme_symmetric) then
        call append_string(needed, can_kick_drift)
        call append_string(needed, can_impulse)
      end if
      call append_string(needed, can_rehearsal)
      if (choices%interface == interface_springs) call append_string(needed, can_springs)
      if (choices%dead_load) call append_string(needed, can_dead_load)
    end if
  end subroutine needs_of_facets

  !> Capabilities for &overlap.
  subroutine needs_of_overlap(side, choices, needed)
    integer(i4), intent(in) :: side  !! side_grains or side_solid
    type(cpl_choices_type), intent(in) :: choices
    type(string_type), allocatable, intent(out) :: needed(:)

    allocate (needed(0))
    if (side == side_grains) then
      call append_string(needed, can_report)
      call append_string(needed, can_load)
      call append_string(needed, can_force)
      call append_string(needed, can_kick_drift)
      if (.not. choices%overlap%bound) call append_string(needed, can_prescribe)
    else
      call append_string(needed, can_prescribe)
      call append_string(needed, can_load)
      call append_string(needed, can_force)
      if (choices%overlap%scheme == 'static') then
        call append_string(needed, can_solve)
      else
        call append_string(needed, can_kick_drift)
      end if
    end if
  end subroutine needs_of_overlap

  !> Solvers of another version than talus-couple: they speak its protocol, so the run goes on.
  subroutine warn_of_versions(log, solvers)
    type(log_type), intent(inout) :: log
    type(cpl_solver_type), intent(in) :: solvers(2)
    integer(i4) :: side
    do side = 1, 2
      if (solvers(side)%version == version_text()) cycle
      call log%warn(solvers(side)%title()//' has version '//solvers(side)%version// &
                    ', talus-couple has '//version_text())
    end do
  end subroutine warn_of_versions
end module cpl_capabilities
