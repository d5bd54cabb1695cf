!> Report of a run: log (header, model, rows, health) and summary.json.
module dem_logbook
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: log_type, short_number, duration_text
  use talus_summary, only: summary_type
  use talus_timers, only: timers_type
  use dem_state, only: kind_free, kind_fixed, kind_driven, kind_ghost
  use dem_equilibrium, only: dem_equilibrium_type
  use dem_shape, only: bulge, hertz_radius
  use dem_shape_state, only: shape_octants, shape_powers
  use dem_system, only: dem_system_type
  use dem_histories, only: relative_closure
  use dem_clock, only: dem_clock_type
  use dem_rank_team, only: dem_rank_team_type
  use dem_surface_body, only: is_free
  use dem_surface_state, only: dem_surfaces_type, surface_cone, is_cylinder, is_bore
  use dem_setup, only: dem_choices_type
  use dem_setup_laws, only: law_lines
  implicit none
  private
  public :: begin_log, log_model, log_row_titles, log_row, log_health, write_summary

contains

  !> Header and deck as understood.
  subroutine begin_log(log, program, deck, ranks, threads)
    type(log_type), intent(inout) :: log
    character(len=*), intent(in) :: program
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: ranks, threads
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: title

    call deck%get('run', 1, 'title', title)
    call log%header(program, title, deck%source%path, deck%hash(), ranks, threads)
    call deck%echo(lines)
    call log%deck_echo(lines)
  end subroutine begin_log

  !> Size of the model, laws, step and its limits.
  subroutine log_model(log, deck, system, choices, clock)
    type(log_type), intent(inout) :: log
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(dem_choices_type), intent(in) :: choices
    type(dem_clock_type), intent(in) :: clock
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: how
    real(wp) :: limit
    integer(i4) :: k

    call log%section('Model')
    call log%item('grains', str(system%grains%n), counted(system, kind_free)//' free, '// &
                  counted(system, kind_fixed)//' fixed, '//counted(system, kind_driven)// &
                  ' driven, '//counted(system, kind_ghost)//' ghosts')
    if (system%grains%shapes%n > 0) call log_shapes(log, system)
    call log%item('walls', str(system%planes%n))
    do k = 1, system%surfaces%n
      call log%item(trim(merge('surfaces', '        ', k == 1)), system%surfaces%name(k)%s, &
                    surface_text(system%surfaces, k))
    end do
    call law_lines(deck, system%laws, choices%material, lines)
    do k = 1, size(lines)
      call log%item(trim(merge('contact laws', '            ', k == 1)), lines(k)%s)
    end do
    call log%item('contacts', str(system%contact_number()), &
                  str(system%pair_number())//' candidate pairs, skin '// &
                  short_number(system%pairs%skin)//' m')
    if (system%springs%given > 0) call log%item('friction', str(system%springs%used), &
      'of these contacts begin with the tangential force of the packing ('// &
      str(system%springs%given)//' in the file)')
    limit = system%step_limit()
    how = 'no contacts yet'
    if (limit < 0.1_wp*huge(limit)) how = short_number(limit)//' s'
    call log%item('stability limit', how)
    limit = system%rayleigh_limit()
    if (limit < 0.1_wp*huge(limit)) call log%item('Rayleigh time', short_number(limit)//' s')
    how = 'given'
    if (clock%automatic) how = 'automatic, '//short_number(system%par%dt_factor)// &
      ' of the limits'
    if (clock%dt > 0.0_wp) call log%item('time step', str(clock%dt)//' s', how)
    call log%memory()
  end subroutine log_model

  !> How many grains are no ellipsoids, and how far the flat spots of superquadrics are rounded.
  subroutine log_shapes(log, system)
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(in) :: system
    real(wp) :: most
    associate (f => system%grains%shapes)
      call log%item('poly-ellipsoids', str(count(f%kind(:f%n) == shape_octants)))
      most = maxval(f%exponent)
      if (.not. most > 2.0_wp) return
      call log%item('superquadrics', str(count(f%kind(:f%n) == shape_powers)), &
                    'exponents to '//short_number(most)//', flat spots rounded by '// &
                    short_number(bulge)//' of the semi-axis, radii in Hertz''s law to '// &
                    short_number(hertz_radius)//' mean semi-axes')
    end associate
  end subroutine log_shapes

  !> Size of a surface, and its free edges if it has any.
  function surface_text(s, k) result(text)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: text
    integer(i4) :: rim
    if (s%kind(k) == surface_cone) then
      text = 'cone and shaft'//free_text(s, k)
      return
    end if
    if (is_cylinder(s, k)) then
      text = 'cylinder of radius '//short_number(s%round%radius(k))//' m, grains '// &
        trim(merge('inside ', 'outside', is_bore(s, k)))//free_text(s, k)
      return
    end if
    associate (low => s%first_triangle(k), high => s%first_triangle(k + 1) - 1)
      rim = count(s%mesh%mate(:, low:high) == 0)
      text = str(high - low + 1)//' triangles, '//str(s%first_vertex(k + 1) - s%first_vertex(k))// &
        ' corners'
    end associate
    if (rim == 0) text = text//', closed'
    if (rim > 0) text = text//', open: '//str(rim)//' free edges'
    text = text//free_text(s, k)
  end function surface_text

  !> In which directions a body moves and turns freely.
  function free_text(s, k) result(text)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: text
    character(len=3), parameter :: direction(6) = [' x ', ' y ', ' z ', ' rx', ' ry', ' rz']
    integer(i4) :: j
    text = ''
    if (.not. is_free(s, k)) return
    text = ', free:'
    do j = 1, 6
      if (s%rigid%free(j, k) > 0.5_wp) text = text//trim(direction(j))
    end do
  end function free_text

  function counted(system, kind) result(text)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: kind
    character(len=:), allocatable :: text
    text = str(count(system%grains%kind == kind))
  end function counted

  subroutine log_row_titles(log)
    type(log_type), intent(inout) :: log
    type(string_type) :: titles(8)
    titles(1)%s = 'time [s]'
    titles(2)%s = 'steps'
    titles(3)%s = 'contacts'
    titles(4)%s = 'kinetic [J]'
    titles(5)%s = 'energy error'
    titles(6)%s = 'max overlap'
    titles(7)%s = 'ms/step'
    titles(8)%s = 'time left'
    call log%row_titles(titles)
  end subroutine log_row_titles

  !> One row; step_time and left are wall times [s], left < 0 is not known.
  subroutine log_row(log, system, clock, step_time, left)
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    real(wp), intent(in) :: step_time, left
    type(string_type) :: cells(8)

    call system%refresh_ledger()
    cells(1)%s = short_number(clock%time())
    cells(2)%s = str(clock%steps)
    cells(3)%s = str(system%contact_number())
    cells(4)%s = short_number(system%ledger%kinetic)
    cells(5)%s = short_number(relative_closure(system))
    cells(6)%s = short_number(system%health%max_overlap)
    cells(7)%s = short_number(1.0e3_wp*step_time)
    cells(8)%s = '-'
    if (left >= 0.0_wp) cells(8)%s = duration_text(left)
    call log%row(cells)
  end subroutine log_row

  !> The line on the health of the run.
  subroutine log_health(log, system, clock)
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    character(len=:), allocatable :: text

    call system%refresh_ledger()
    text = 'energy error '//short_number(relative_closure(system))//', largest overlap '// &
      short_number(100.0_wp*system%health%max_overlap)//' % of the least semi-axis, '// &
      str(system%health%rebuilds)//' list rebuilds, '//str(system%health%late_rebuilds)//' late'
    if (system%pairs%extras%bond%given) text = text//', '//str(system%pairs%extras%made)// &
      ' bonds, of which '//str(system%pairs%extras%torn)//' torn and '// &
      str(system%pairs%extras%sheared)//' sheared'
    if (clock%unstable > 0) text = text//', step above the stability limit at '// &
      str(clock%unstable)//' checks'
    call log%health(text)
  end subroutine log_health

  !> summary.json; steps_time is the wall time spent in steps [s].
  subroutine write_summary(path, program, deck, system, clock, timers, steps_done, steps_time, &
                           exit_code, faults, equilibrium, errors)
    character(len=*), intent(in) :: path, program
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    type(timers_type), intent(in) :: timers
    integer(i8), intent(in) :: steps_done  !! in this run, without those before a restart
    real(wp), intent(in) :: steps_time
    integer(i4), intent(in) :: exit_code
    type(error_list_type), intent(in) :: faults
    type(dem_equilibrium_type), intent(in) :: equilibrium
    type(error_list_type), intent(inout) :: errors
    type(summary_type) :: summary
    real(wp) :: rate

    call system%refresh_ledger()
    call summary%set_program(program, deck%source%path, deck%hash())
    call summary%set('exit_code', exit_code)
    call summary%set('wall_time_s', timers%elapsed())
    call summary%set('steps', clock%steps)
    call summary%set('time_s', clock%time())
    call summary%set('dt_s', clock%dt)
    call summary%set('grains', system%grains%n)
    call summary%set('free_grains', int(count(system%grains%kind == kind_free), i4))
    call summary%set('contacts', system%contact_number())
    rate = 0.0_wp
    if (steps_time > 0.0_wp) rate = real(steps_done, wp)/steps_time
    call summary%set('grain_steps_per_s', rate*system%grains%n)
    call summary%set('free_grain_steps_per_s', rate*count(system%grains%kind == kind_free))
    call summary%set('health.energy_error', relative_closure(system))
    call summary%set('health.closure_J', system%closure())
    call summary%set('health.max_overlap', system%health%max_overlap)
    call summary%set('health.rebuilds', system%health%rebuilds)
    call summary%set('health.late_rebuilds', system%health%late_rebuilds)
    call summary%set('health.steps_above_limit', clock%unstable)
    if (system%pairs%extras%bond%given) then
      call summary%set('health.bonds_made', system%pairs%extras%made)
      call summary%set('health.bonds_torn', system%pairs%extras%torn)
      call summary%set('health.bonds_sheared', system%pairs%extras%sheared)
    end if
    if (equilibrium%watched) then
      call summary%set('health.equilibrium', equilibrium%reached)
      call summary%set('health.unbalanced_force', equilibrium%unbalanced)
      call summary%set('health.kinetic_over_elastic', equilibrium%energy_ratio)
    end if
    if (allocated(system%rank_team)) call put_ranks(summary, system%rank_team)
    call summary%set('energy.kinetic_J', system%ledger%kinetic)
    call summary%set('energy.elastic_J', system%ledger%elastic_normal &
                     + system%ledger%elastic_tangential)
    call summary%set_timers(timers)
    call summary%set_errors(faults)
    call summary%write(path, errors)
  end subroutine write_summary

  !> How the ranks shared the work.
  subroutine put_ranks(summary, rank_team)
    type(summary_type), intent(inout) :: summary
    type(dem_rank_team_type), intent(in) :: rank_team
    call summary%set('ranks.count', rank_team%team%ranks)
    call summary%set('ranks.exchange_s', rank_team%marks%exchange(2))
    call summary%set('ranks.least_exchange_s', rank_team%marks%exchange(1))
    call summary%set('ranks.most_exchange_s', rank_team%marks%exchange(3))
    call summary%set('ranks.imbalance', rank_team%marks%imbalance)
    call summary%set('ranks.least_grains', nint(rank_team%marks%own(1), i4))
    call summary%set('ranks.most_grains', nint(rank_team%marks%own(2), i4))
    call summary%set('ranks.most_mirrors', nint(rank_team%marks%mirrors(2), i4))
    call summary%set('ranks.bytes_a_step', rank_team%marks%bytes)
    call summary%set('ranks.messages_a_step', rank_team%marks%messages)
  end subroutine put_ranks
end module dem_logbook
