!> What a run with facets reports: interface, rows, health and summary.
module cpl_facet_log
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_log, only: log_type, short_number
  use talus_scalars, only: scalar_kinetic, scalar_elastic, scalar_max_overlap
  use talus_summary, only: summary_type
  use cpl_audit, only: audit_type
  use cpl_choices, only: cpl_choices_type, interface_springs
  use cpl_interface, only: interface_type
  use cpl_lag, only: lag_limit, shorter_exchange
  use cpl_logbook, only: log_cells, overhead_text
  implicit none
  private
  public :: log_interface, log_row, log_health, put_summary

contains

  !> Ghosts, facets, identities, springs.
  subroutine log_interface(log, face, choices, identity)
    type(log_type), intent(inout) :: log
    type(interface_type), intent(in) :: face
    type(cpl_choices_type), intent(in) :: choices
    real(wp), intent(in) :: identity  !! largest error of the operator identities
    call log%section('Interface')
    call log%item('ghosts', str(face%map%ghosts), 'on '//str(used_facets(face))//' facets with '// &
                  str(face%map%nodes)//' nodes, map '//face%map%hash())
    call log%item('identities', 'sum N = 1, sum N x = x_g within '//short_number(identity))
    call log%item('largest offset', short_number(sqrt(maxval(sum(face%map%offset**2, 1))))//' m')
    call log%item('contact stiffness', short_number(face%watch%contact_stiffness)//' N/m', &
                  'largest of a ghost')
    if (face%relax%method == interface_springs) &
      call log%item('spring stiffness', short_number(face%springs%stiffness)//' N/m at each ghost')
    call log%item('solid', trim(merge('dynamic', 'static ', face%dynamic)))
    call log%item('exchanges', str(choices%exchanges), 'of '//short_number(choices%exchange)// &
                  ' s, scheme '//choices%scheme_name//', interface '//choices%interface_name)
    if (face%kicks%active) call log%item('stable exchange', &
      short_number(face%kicks%limit(choices%exchange))//' s', &
      'at most that of the deck; contacts of now')
    if (face%pieces%most > 1) call log%item('pieces', str(face%pieces%most), &
      'of an exchange at most, as the force lag asks for')
    if (face%dynamic .and. face%relax%method == interface_springs) &
      call log%warn("interface = 'springs' acts like dampers on a dynamic solid: choose 'none'"// &
                    " or 'aitken'")
    call log%memory()
  end subroutine log_interface

  pure integer(i4) function used_facets(face)
    type(interface_type), intent(in) :: face
    logical :: used(maxval(face%map%facet))
    used = .false.
    used(face%map%facet) = .true.
    used_facets = count(used)
  end function used_facets

  subroutine log_row(log, face, audit, time, overhead, left)
    type(log_type), intent(inout) :: log
    type(interface_type), intent(in) :: face
    type(audit_type), intent(in) :: audit
    real(wp), intent(in) :: time      !! s
    real(wp), intent(in) :: overhead  !! share of the run time
    real(wp), intent(in) :: left      !! wall time [s], < 0 not known
    associate (g => face%ledger%grains, s => face%ledger%solid)
      call log_cells(log, [time, audit%ghost_motion, audit%ghost_force, g(scalar_kinetic) &
        + s(scalar_kinetic), g(scalar_elastic), s(scalar_elastic), overhead], left)
    end associate
  end subroutine log_row

  !> The health line: whether the run can be trusted.
  subroutine log_health(log, face, audit, exchange, overhead)
    type(log_type), intent(inout) :: log
    type(interface_type), intent(in) :: face
    type(audit_type), intent(in) :: audit
    real(wp), intent(in) :: exchange     !! interval of the deck [s]
    real(wp), intent(in) :: overhead(2)  !! shares that the grains waited for, and worked
    character(len=:), allocatable :: text
    text = 'interface work differs by '//short_number(100.0_wp*audit%work_error(face))// &
      ' % between the sides, ghosts off their facets by '//short_number(audit%gap)// &
      ' m at most, iterations '//str(audit%iterations)//' at most, force lag '// &
      short_number(100.0_wp*audit%lag%overall())//' % of all forces (limit '// &
      short_number(100.0_wp*lag_limit)//' %), windows that did not settle '// &
      str(audit%lag%stalls)//', springs raised '// &
      str(face%watch%refactored)//' times, largest overlap '// &
      short_number(100.0_wp*face%ledger%grains(scalar_max_overlap))//' %, '//overhead_text(overhead)
    call log%health(text)
    if (audit%lag%overall() > lag_limit .and. .not. audit%lag%warned) &
      call log%warn('the solid did not carry '//short_number(100.0_wp*audit%lag%overall())// &
        " % of the ghosts' forces: "//shorter_exchange(audit%lag%overall(), exchange)// &
        ", or write scheme = 'iterated'")
  end subroutine log_health

  !> The method's part of summary.json.
  subroutine put_summary(summary, face, audit)
    type(summary_type), intent(inout) :: summary
    type(interface_type), intent(in) :: face
    type(audit_type), intent(in) :: audit
    call summary%set('ghosts', face%map%ghosts)
    call summary%set('interface_nodes', face%map%nodes)
    call summary%set('iterations', face%ledger%all_iterations)
    call summary%set('health.interface_work_error', audit%work_error(face))
    call summary%set('health.constraint_residual_m', audit%gap)
    call summary%set('health.force_lag', audit%lag%overall())
    call summary%set('health.windows_not_settled', audit%lag%stalls)
    call summary%set('health.most_iterations', audit%iterations)
    call summary%set('health.springs_raised', face%watch%refactored)
    call summary%set('health.lost_moment_impulse_Nms', face%ledger%lost_impulse)
    call summary%set('health.max_overlap', face%ledger%grains(scalar_max_overlap))
    call summary%set('interface.spring_stiffness_N_per_m', face%springs%stiffness)
    if (face%kicks%active) call summary%set('interface.stable_exchange_s', face%kicks%shortest)
    call summary%set('interface.work_on_grains_J', face%ledger%grains_work)
    call summary%set('interface.work_on_solid_J', face%ledger%solid_work)
    call summary%set('interface.largest_ghost_displacement_m', audit%ghost_motion)
  end subroutine put_summary
end module cpl_facet_log
