!> A run of talus-dem: read, prepare (dem_run_start), open (dem_run_output), run, finish.
!!
!! Nothing is written before deck, packing and first forces have passed all checks.
module dem_model
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type, exit_stopped
  use talus_files, only: folder_of
  use talus_health, only: health_type
  use talus_log, only: short_number
  use talus_stop, only: stop_none
  use dem_state, only: dem_health_type
  use dem_clock, only: event_checkpoint, event_opening
  use dem_heat, only: told_of_heat
  use dem_judgement, only: judge_health
  use dem_logbook, only: log_health
  use dem_summary, only: write_summary
  use dem_surcharge_renew, only: renew_surcharge
  use dem_view, only: see_grains, keep_packing, wall_stiffness_of
  use dem_run_output, only: dem_written_run_type
  use dem_run_state, only: program_name
  implicit none
  private
  public :: dem_model_type, program_name

  integer(i4), parameter :: block_work = 20000000 !! grain-steps between two updates
  integer(i4), parameter :: blocks(7) = [100, 50, 20, 10, 5, 2, 1]  !! steps in a block

  type, extends(dem_written_run_type) :: dem_model_type
  contains
    procedure :: run, finish
    procedure :: take_steps
    procedure :: load_surface
    procedure, private :: judge_rest, take_probes, review_step, meet_liquid
  end type dem_model_type

contains

  !> Steps until the end, a fault or a request to stop.
  subroutine run(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: block

    block = blocks(findloc(blocks*real(self%system%grains%n, wp) <= block_work, .true., 1) &
                   + merge(7, 0, self%system%grains%n > block_work))
    block = min(block, self%equilibrium%longest_block(), self%servo%longest_block(), &
                self%surcharge%longest_block(), self%flow%longest_block(), &
                self%drive%longest_block(), self%breakage%longest_block())
    block = self%pore%fitting_block(self%system%dem_data_type, block)
    do
      if (errors%any() .or. self%clock%finished() .or. self%equilibrium%reached) return
      if (self%stop%check() /= stop_none) then
        self%stopped = .true.
        call self%log%line('')
        call self%log%line('stopped by '//self%stop%text())
        return
      end if
      if (self%stop%checkpoint_asked() .or. self%checkpoint%due(self%clock%time()) &
          .or. self%clock%due(event_checkpoint)) call self%save_checkpoint('', errors)
      if (errors%any()) return  ! ranks must not step with a fault that the first alone has
      if (self%clock%review_due()) call self%review_step(errors)
      if (errors%any()) return
      call self%meet_liquid(errors)
      if (errors%any()) return
      call self%take_steps(block, errors)
      if (errors%any()) return
      if (self%servo%due(self%clock%steps) .and. self%needs_whole()) call self%system%gather()
      if (self%flow%due(self%clock%steps)) call self%system%glance()
      if (self%servo%due(self%clock%steps)) &
        call self%servo%update(self%system%dem_data_type, self%clock%time(), &
                             wall_stiffness_of(self%system))
      call self%load_surface(.false., errors)
      if (self%flow%due(self%clock%steps)) &
        call self%flow%update(self%system%dem_data_type, self%clock%time())
      if (self%drive%due(self%clock%steps)) call self%drive_surfaces()
      if (self%clock%due(event_opening)) then
        call self%timers%start('sources and sinks')
        call self%renew_grains(self%clock%turns(event_opening), errors)
        call self%clock%passed(event_opening)
        call self%timers%stop('sources and sinks')
      end if
      if (self%breakage%due(self%clock%steps)) then
        call self%timers%start('breakage')
        call self%break_grains(errors)
        call self%timers%stop('breakage')
      end if
      if (self%equilibrium%due(self%clock%steps)) call self%judge_rest()
      call self%equilibrium%damp(self%system, self%clock%steps)
      call self%write_due(errors)
    end do
  end subroutine run

  !> The step follows its limits.
  subroutine review_step(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%clock%review(self%automatic_dt(), self%system%step_limit())
    if (abs(self%clock%dt - self%system%par%dt) > 0.0_wp) call self%use_step(self%clock%dt)
    if (self%pore%active) call self%pore%watch(self%system%dem_data_type, self%clock%time(), &
                                               self%system%step_limit(), errors)
  end subroutine review_step

  !> The exchange of grains and liquid that is due.
  subroutine meet_liquid(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (.not. self%pore%due(self%system%dem_data_type, self%clock%steps)) return
    call self%timers%start('liquid')
    call self%pore%exchange(self%system%dem_data_type, self%clock%time(), errors)
    call self%timers%stop('liquid')
  end subroutine meet_liquid

  !> Have the grains come to rest, and do all servos hold their stresses?
  subroutine judge_rest(self)
    class(dem_model_type), intent(inout) :: self
    if (.not. self%equilibrium%watched) return
    call self%equilibrium%check(self%system, self%servo%satisfied(self%system%dem_data_type) .and. &
                               self%flow%satisfied(self%system%dem_data_type))
  end subroutine judge_rest

  !> Moduli of the last state.
  subroutine take_probes(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%timers%start('probes')
    call self%probe%run(self%system, self%deck%source%path, errors)
    call self%timers%stop('probes')
    call self%probe%write(self%stem, program_name, self%deck, self%clock%time(), self%log, errors)
  end subroutine take_probes

  !> Steps until the next event. A stop at an odd time (t_end off the grid) must not show in the
  !! health counters, or a run restarted there would differ.
  subroutine take_steps(self, block, errors)
    class(dem_model_type), intent(inout) :: self
    integer(i4), intent(in) :: block
    type(error_list_type), intent(inout) :: errors
    type(dem_health_type) :: kept
    integer(i4) :: n, whole

    n = self%clock%steps_ahead(block, self%clock%t_end)
    whole = self%clock%steps_ahead(block, huge(1.0_wp))
    kept = self%system%health
    call self%timers%start('steps')
    call self%system%step(n, errors)
    call self%timers%stop('steps')
    call self%clock%advance(int(self%system%health%steps - kept%steps, i4))
    if (n < whole) then
      self%system%health%max_overlap = kept%max_overlap
      self%system%health%reference_energy = kept%reference_energy
    end if
  end subroutine take_steps

  !> The surcharge determines the surface again, when it is due, or before the first step when kinds
  !! have changed.
  subroutine load_surface(self, changed, errors)
    class(dem_model_type), intent(inout) :: self
    logical, intent(in) :: changed
    type(error_list_type), intent(inout) :: errors
    if (changed .and. .not. (self%surcharge%active .and. self%clock%steps == 0)) return
    if (.not. (changed .or. self%surcharge%due(self%system%dem_data_type, self%clock%steps))) return
    call self%timers%start('surcharge')
    call renew_surcharge(self%surcharge, self%system, self%clock, .false., errors)
    call self%timers%stop('surcharge')
  end subroutine load_surface

  !> Last state, checkpoint, packing, health, timers, summary; exit_code is that of the run.
  subroutine finish(self, exit_code, errors)
    class(dem_model_type), intent(inout) :: self
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(health_type) :: health

    if (self%needs_whole()) call self%system%gather()
    if (self%surcharge%active) call see_grains(self%system)
    call self%system%glance()
    if (.not. (errors%any() .or. self%stopped)) call self%judge_rest()
    call write_last(self, errors)
    call self%close_files(errors)
    if (.not. (self%stopped .or. errors%any())) call judge_end(self, errors)
    if (self%opened) then
      call self%system%refresh_ledger()
      call judge_health(self, health)
      if (.not. (self%served .or. self%stopped .or. errors%any())) &
        call health%complain(self%deck%source%path, errors)
    end if
    exit_code = errors%exit_code()
    if (exit_code == 0 .and. self%stopped) exit_code = exit_stopped
    if (.not. self%opened) call self%lock%release()
    if (.not. self%opened) return
    call report_end(self, health, exit_code, errors)
    call self%lock%release()
  end subroutine finish

  !> The state in which a run ends: fields, measures, checkpoint, packing; of a fault what there is.
  subroutine write_last(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: ignored
    character(len=:), allocatable :: packing
    call self%deck%get('output', 1, 'packing', packing)
    if (.not. errors%any()) then
      call self%fields%write(self%clock%time(), self%system, errors)
      call self%pore_fields%write(self%clock%time(), self%system%dem_data_type, errors)
      call self%measures%write(self%clock%time(), self%system, .true., errors)
      if (.not. self%served .and. (self%stopped .or. self%deck%count('checkpoint') > 0)) &
        call self%save_checkpoint('', errors)
      if (len(packing) > 0 .and. .not. self%stopped .and. .not. errors%any()) &
        call keep_packing(self%system, folder_of(self%stem)//'/'//packing, &
                          self%packing, errors)
    else if (self%opened) then
      call self%fields%write(self%clock%time(), self%system, ignored)
    end if
  end subroutine write_last

  !> Was the run long enough for rest, servos and flow? Then moduli are probed.
  subroutine judge_end(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%equilibrium%judge(self%clock%time(), self%deck%source%path, errors)
    if (self%servo%active()) call self%servo%judge(self%system%dem_data_type, &
      self%clock%time(), wall_stiffness_of(self%system), self%deck%source%path, errors)
    call self%flow%judge(self%system%dem_data_type, self%deck%source%path, errors)
    if (self%probe%wanted .and. .not. errors%any()) call self%take_probes(errors)
  end subroutine judge_end

  !> The end of the log, and the summary.
  subroutine report_end(self, health, exit_code, errors)
    class(dem_model_type), intent(inout) :: self
    type(health_type), intent(in) :: health
    integer(i4), intent(in) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: ignored
    if (self%row_step < self%clock%steps) call self%write_row()
    call errors%locate(self%options%deck)
    call self%log%faults(errors)
    if (self%equilibrium%watched) call self%log%line(self%equilibrium%text())
    if (self%surcharge%active) call self%log%line( &
      'surcharge: '//self%surcharge%text(self%system%dem_data_type))
    if (self%pore%active) call self%log%line('liquid: '//self%pore%audit(self%system%dem_data_type))
    call self%pore%warn(self%system%dem_data_type, self%log)
    if (self%openings%n > 0) call self%openings%log_totals(self%log, self%system)
    if (self%system%heat%active) call log_heat(self)
    call self%breakage%log_totals(self%log, self%system%dem_data_type)
    call log_health(self%log, self%system, self%clock)
    call health%warn(self%log)
    if (allocated(self%system%rank_team)) &
      call self%log%item('ranks', self%system%rank_team%text(self%steps_seconds()))
    call self%log%timer_table(self%timers)
    call write_summary(self, health, exit_code, errors, ignored)
    call self%log%finish(program_name, exit_code, 'time '//short_number(self%clock%time())// &
                         ' s, '//str(self%clock%steps)//' steps')
    call self%log%close()
  end subroutine report_end

  !> The steps of heat conduction, at the end of the log.
  subroutine log_heat(self)
    class(dem_model_type), intent(inout) :: self
    character(len=:), allocatable :: text, warning
    call told_of_heat(self%system%dem_data_type, text, warning)
    call self%log%line('heat: '//text)
    if (len(warning) > 0) call self%log%warn(warning)
  end subroutine log_heat
end module dem_model
