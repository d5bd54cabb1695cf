!> What a run with overlap reports: census, audit, rows, health and summary.
module cpl_overlap_log
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_log, only: log_type, short_number
  use talus_scalars, only: scalar_kinetic, scalar_elastic, scalar_max_overlap
  use talus_summary, only: summary_type
  use cpl_audit_columns, only: begin_columns, append_momenta, append_vector, begin_values, momenta
  use cpl_choices, only: cpl_choices_type, rotation_micro, rotation_curl
  use cpl_logbook, only: log_cells
  use cpl_overlap_limit, only: kick_warning
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_rest, part_ghost, part_free
  implicit none
  private
  public :: log_census, log_masses, log_exchanges, overlap_columns, overlap_values, &
    overlap_row, overlap_health, overlap_summary, work_error

  integer(i4), parameter :: column_count = 28
  real(wp), parameter :: much_rest = 0.05_wp  !! of the largest load on a node

contains

  !> Who is in which set, the operators, and the masses.
  subroutine log_census(log, o, choices, bound)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: bound  !! grains of the overlap are free and bound to the nodes
    character(len=:), allocatable :: turning

    turning = 'do not turn (moments on them are lost)'
    if (o%op%rotation == rotation_curl) turning = 'turn with half the curl of the displacement'
    if (o%op%rotation == rotation_micro) turning = 'turn with the micro-rotation'
    if (bound) turning = 'are bound to the nodes under them'
    call log%section('Overlap')
    call log%item('elements', str(count(o%sets%part == part_free))//' of free grains, '// &
                  str(count(o%sets%part == part_ghost))//' of ghosts, '// &
                  str(count(o%sets%part == part_rest))//' of continuum alone')
    call log%item('free grains', str(count(o%map%seen)), 'under elements, '// &
                  str(size(o%sets%outside) + count(.not. o%map%seen))//' elsewhere; '// &
                  str(o%sets%least_in_element)//' to an element at least, '// &
                  short_number(o%sets%mean_in_element)//' in the mean')
    call log%item(trim(merge('bound grains', 'ghosts      ', bound)), &
                  str(o%op%ghosts), turning)
    call log%item('nodes', str(o%op%prescribed)//' follow free grains', str(o%op%nodes &
      - o%op%prescribed)// &
                  ' of the edge, micro-rotations '//str(o%op%prescribed_phi)//' and '// &
                  str(o%op%nodes_phi - o%op%prescribed_phi))
    call log%item('depth of the ghosts', short_number(o%sets%depth)//' m', &
                  short_number(o%sets%depth/o%sets%d_max)//' largest diameters')
    call log%item('projection', choices%overlap%projection//', weights '// &
                  choices%overlap%weights, "condition of N'WN "//short_number(o%op%p%condition))
    call log%item('identities', 'within '//short_number(o%map%identity))
    call log_weights(log, o, choices)
    call log_start(log, o, choices, bound)
  end subroutine log_census

  !> Exchanges, and what goes wrong with ghosts that do not turn.
  subroutine log_exchanges(log, o, choices)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    call log%item('exchanges', str(choices%exchanges), 'of '//short_number(choices%exchange)// &
                  ' s, '//str(o%rules%substeps)//' steps of the grains each, scheme '// &
                  choices%overlap%scheme)
    if (choices%overlap%rotation == 'fixed') &
      call log%warn("rotation = 'fixed': ghosts resist turning, and moments on them are lost")
    call log%memory()
  end subroutine log_exchanges

  !> Masses of prescribed nodes, the stable step, damping.
  subroutine log_masses(log, o, choices)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    if (o%own%carried%active) then
      call log%item('mass carried', short_number(o%own%moved_mass)//' kg', &
                    'of elements outside, by nodes that follow free grains')
      if (o%op%micro%active) then
        call log%item('micro-inertia', 'left out', 'that of these nodes: the grains have their own')
      else if (o%rules%turns .and. .not. o%rules%round_free) then
        call log%item('micro-inertia', 'left out', 'that of these nodes: free grains are no '// &
          'spheres')
      end if
    else
      call log%item('mass moved', short_number(o%own%moved_mass)//' kg', 'of elements outside, '// &
        'from prescribed nodes to free grains, '//choices%overlap%mass//'; factors '// &
        short_number(minval(o%own%factor))//' to '//short_number(maxval(o%own%factor)))
    end if
    if (o%limit%step_limit < huge(1.0_wp)) call log%item('stable step', &
      short_number(o%limit%step_limit)// ' s', 'of grains and nodes that step with them')
    call log_kicks(log, o, choices%exchange)
    if (o%own%damping%active) call log%item('fine scale damped', short_number( &
      choices%overlap%fine_damping)//' 1/s', 'at the ghosts, fading to the far end')
  end subroutine log_masses

  !> How long an exchange may be for the kicks.
  subroutine log_kicks(log, o, exchange)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: exchange  !! [s]
    if (.not. o%limit%kick_limit < huge(1.0_wp)) return
    call log%item('stable exchange', short_number(o%limit%kick_limit)//' s', &
      'of forces between ghosts, in kicks, as if no contact slid; '//o%limit%kick_critical// &
      ' fastest')
    if (exchange > o%limit%kick_limit) call log%warn(kick_warning(o, exchange))
  end subroutine log_kicks

  !> How energy is shared.
  subroutine log_weights(log, o, choices)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    character(len=:), allocatable :: note
    note = ''
    if (o%share%fit%rows > 0 .and. .not. o%share%unfit) note = str(o%share%fit%rows)//' rows, '// &
      str(o%share%fit%unknowns)//' weights, '//str(o%share%fit%rounds)//' rounds: largest row '// &
      short_number(o%share%fit%before)//' -> '//short_number(o%share%fit%after)// &
      ' of a contact force, '// str(o%share%fit%clipped)//' weights on bounds'
    if (o%share%shared == 'ramp' .and. o%share%disorder > 0.0_wp) note = &
      'unbalance of free grains under uniform strain '//short_number(o%share%disorder)// &
      ' of a contact force'
    call log%item('energy shared by', o%share%shared, note)
    if (o%share%unfit) call log%warn( &
      'the pack is a lattice, but no weights leave its nodes at rest: the solid has another '// &
      'stiffness than the pack; ramps are taken')
  end subroutine log_weights

  !> Moduli, loads and initial stress.
  subroutine log_start(log, o, choices, bound)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: bound
    if (o%start%shear > 0.0_wp) then
      call log%item('moduli of the solid', 'K '//short_number(o%start%lambda &
        + 2.0_wp*o%start%shear/3.0_wp)// ' Pa, G '//short_number(o%start%shear)//' Pa', &
        choices%overlap%moduli//'; affine bound K '//short_number(o%start%affine%bulk)// &
        ' Pa, G '// short_number(o%start%affine%shear)//' Pa')
      if (choices%overlap%moduli == 'affine') call log%warn('affine moduli are an upper bound '// &
        "of the pack's: probe it with talus-dem (&probe)")
      if (any(o%cells%polar)) call log%warn('micropolar constants are affine, no probe gives '// &
        'them: kappa '//short_number(o%start%affine%kappa)//' Pa, gamma '// &
        short_number(o%start%affine%gamma)// &
        ' N (equal spheres have no gamma: that of the deck is kept)')
    end if
    if (o%forces%loads%active .and. .not. bound) call log%item('loads on prescribed nodes', &
      short_number(norm2(sum(o%forces%loads%f, 2)))//' N', &
      'of the solid''s deck, transferred to the free grains'//trim(merge('                 ', &
      '; they change now', o%forces%loads%steady)))
    if (o%start%solid_node > 0) call log_rest(log, o)
    if (o%start%initial%rounds == 0 .and. .not. o%start%initial%after > 0.0_wp) return
    call log%item('initial stress', 'rest '//short_number(o%start%initial%before)//' -> '// &
                  short_number(o%start%initial%after)//' of a contact force', 'changed by '// &
                  short_number(o%start%initial%change)//' of the pressure at most, in element '// &
                  str(o%start%initial%element)//', '//str(o%start%initial%rounds)//' rounds')
    call log%item('at rest within', short_number(o%start%start_rest)//' of a contact force', &
                  'forces on the nodes as both solvers give them')
  end subroutine log_start

  !> What nothing balances at the nodes of the solid alone, and a warning when it is much.
  subroutine log_rest(log, o)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    character(len=:), allocatable :: seen
    logical :: held
    held = allocated(o%start%hold)
    call log%item('solid out of balance', short_number(o%start%solid_rest)//' N', &
      'at node '//str(o%start%solid_node)//', '//short_number(o%start%solid_share)// &
      ' of the largest load; '//trim(merge('held   ', 'it acts', held)))
    if (.not. o%start%solid_share > much_rest) return
    seen = 'the solid is not in balance at the start: '//short_number(o%start%solid_rest)// &
      ' N at node '//str(o%start%solid_node)//', '//short_number(o%start%solid_share)// &
      ' of the largest load on a node, '
    if (held) then
      call log%warn('W431'//': '//seen//'are held by dead loads; that suffices for linear '// &
        'elements, others lack the stress of their loads (&geostatic, &initial_stress)')
    else
      call log%warn('W430'//': '//seen//"move it: write initial = 'dead_load', or give "// &
        'elements of laws with a state the stress of their loads (&geostatic, &initial_stress)')
    end if
  end subroutine log_rest

  !> Columns of the audit that every overlap has.
  subroutine overlap_columns(columns)
    type(string_type), allocatable, intent(out) :: columns(:)

    call begin_columns(columns)
    call append_string(columns, 'edge_kinetic [J]')
    call append_string(columns, 'total_energy [J]')
    call append_string(columns, 'interface_work_given [J]')
    call append_string(columns, 'interface_work_taken [J]')
    call append_string(columns, 'held_load_work [J]')
    call append_string(columns, 'fine_scale_damping [J]')
    call append_momenta(columns)
    call append_vector(columns, 'force_on_edge', 'N')
    call append_string(columns, 'fine_scale [m]')
    call append_string(columns, 'largest_ghost_displacement [m]')
    call append_string(columns, 'largest_overlap [-]')
    if (size(columns) /= column_count) error stop 'bug: columns of the audit'
  end subroutine overlap_columns

  !> Kinetic and elastic energy of all, less the work of the loads that balance the start, and what
  !! the damping of the fine scale has taken [J].
  pure real(wp) function total_energy(o)
    type(overlap_type), intent(in) :: o
    total_energy = o%ledger%grains(scalar_kinetic) + o%ledger%grains(scalar_elastic) &
      + o%ledger%solid(scalar_kinetic) + o%ledger%solid(scalar_elastic) + o%edge_kinetic() &
      - o%ledger%hold_work + fine_loss(o) + o%ledger%bond
  end function total_energy

  !> What the damping of the fine scale has taken [J].
  pure real(wp) function fine_loss(o)
    type(overlap_type), intent(in) :: o
    fine_loss = o%own%damping%lost + o%own%damping_phi%lost + o%ledger%lost
  end function fine_loss

  pure real(wp) function ghost_motion(o)
    type(overlap_type), intent(in) :: o
    integer(i4) :: k
    ghost_motion = 0.0_wp
    do k = 1, size(o%motion%d, 2)
      ghost_motion = max(ghost_motion, o%motion%d(1, k)**2 + o%motion%d(2, k)**2 + o%motion%d(3, &
        k)**2)
    end do
    ghost_motion = sqrt(ghost_motion)
  end function ghost_motion

  !> A row at time [s], after the exchange was accepted.
  pure function overlap_values(o, time) result(value)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: value(column_count), edge(6)

    associate (g => o%ledger%grains, s => o%ledger%solid)
      value(:10) = begin_values(time, g, s)
      value(11) = o%edge_kinetic()
      value(12) = total_energy(o)
      value(13:15) = [o%ledger%work_given, o%ledger%work_taken, o%ledger%hold_work]
      edge = o%edge_momentum()
      value(16) = fine_loss(o)
      value(17:22) = momenta(g, s) + edge
      value(23:25) = sum(o%forces%f(:, o%op%prescribed + 1:), 2)
      value(26) = o%map%fine
      value(27) = ghost_motion(o)
      value(28) = g(scalar_max_overlap)
    end associate
  end function overlap_values

  subroutine overlap_row(log, o, fine, time, overhead, left)
    type(log_type), intent(inout) :: log
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: fine      !! scale that the nodes do not see, now [m]
    real(wp), intent(in) :: time      !! s
    real(wp), intent(in) :: overhead  !! share of the run time
    real(wp), intent(in) :: left      !! wall time [s], < 0 not known
    associate (g => o%ledger%grains, s => o%ledger%solid)
      call log_cells(log, [time, ghost_motion(o), fine, g(scalar_kinetic) + s(scalar_kinetic) &
        + o%edge_kinetic(), g(scalar_elastic), s(scalar_elastic), overhead], left)
    end associate
  end subroutine overlap_row

  !> Difference of the works from both sides, relative to what went through.
  pure real(wp) function work_error(o)
    type(overlap_type), intent(in) :: o
    work_error = 0.0_wp
    if (o%ledger%turnover > 0.0_wp) work_error = abs(o%ledger%work_given &
      - o%ledger%work_taken)/o%ledger%turnover
  end function work_error

  !> What the health line says of an overlap.
  function overlap_health(o, fine) result(text)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: fine  !! [m]
    character(len=:), allocatable :: text
    text = 'works of both sides differ by '// &
      short_number(100.0_wp*work_error(o))//' % of what went through, fine scale '// &
      short_number(fine)//' m, ghosts moved by '//short_number(ghost_motion(o))// &
      ' m, largest overlap '//short_number(100.0_wp*o%ledger%grains(scalar_max_overlap))//' %, '
  end function overlap_health

  !> The part of summary.json that every overlap has.
  subroutine overlap_summary(summary, o, fine)
    type(summary_type), intent(inout) :: summary
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: fine  !! [m]
    call summary%set('free_grains', count(o%map%seen))
    call summary%set('ghosts', o%op%ghosts)
    call summary%set('hat_nodes', o%op%prescribed)
    call summary%set('edge_nodes', o%op%nodes - o%op%prescribed)
    call summary%set('health.interface_work_error', work_error(o))
    call summary%set('health.identity_error', o%map%identity)
    call summary%set('health.projection_condition', o%op%p%condition)
    call summary%set('health.fine_scale_m', fine)
    call summary%set('health.max_overlap', o%ledger%grains(scalar_max_overlap))
    if (allocated(o%share%shared)) call summary%set('overlap.shared_by', o%share%shared)
    call summary%set('overlap.fit_residual', o%share%fit%after)
    call summary%set('overlap.depth_m', o%sets%depth)
    if (o%start%shear > 0.0_wp) then
      call summary%set('overlap.lambda_Pa', o%start%lambda)
      call summary%set('overlap.shear_Pa', o%start%shear)
    end if
    if (allocated(o%start%stress)) then
      call summary%set('overlap.initial_rest', o%start%initial%after)
      call summary%set('overlap.initial_change', o%start%initial%change)
      call summary%set('overlap.start_rest', o%start%start_rest)
    end if
    if (o%start%solid_node > 0) then
      call summary%set('overlap.solid_rest_N', o%start%solid_rest)
      call summary%set('overlap.solid_rest_share', o%start%solid_share)
    end if
    call summary%set('overlap.moved_mass_kg', o%own%moved_mass)
    if (o%limit%step_limit < huge(1.0_wp)) call summary%set('overlap.stable_step_s', &
      o%limit%step_limit)
    if (o%limit%kick_limit < huge(1.0_wp)) call summary%set('overlap.stable_exchange_s', &
      o%limit%kick_limit)
    call summary%set('overlap.fine_scale_damping_J', fine_loss(o))
    call summary%set('overlap.remaps', o%map%remaps)
    call summary%set('overlap.total_energy_J', total_energy(o))
  end subroutine overlap_summary
end module cpl_overlap_log
