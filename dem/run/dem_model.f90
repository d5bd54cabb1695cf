!> A run of talus-dem: read, prepare, open, run, finish.
!!
!! Nothing is written before deck, packing and first forces are found good. Looks at the state (log
!! rows, output) leave no trace in it, so that a restart takes the same steps.
module dem_model
  use omp_lib, only: omp_set_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type, exit_stopped
  use talus_options, only: options_type
  use talus_ranks, only: ranks_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_files, only: make_folder, folder_of, run_stem
  use talus_checkpoint, only: checkpoint_type
  use talus_lock, only: lock_type
  use talus_log, only: log_type, short_number
  use talus_stop, only: stop_type, stop_none
  use talus_timers, only: timers_type
  use dem_state, only: dem_health_type, kind_driven
  use dem_system, only: dem_system_type
  use dem_packing, only: dem_packing_type
  use dem_setup_cell, only: read_cell, check_regions
  use dem_flow, only: dem_flow_type
  use dem_probe, only: dem_probe_type
  use dem_cell, only: cell_volume
  use dem_setup, only: dem_choices_type, read_model, check_initial_overlap, check_step, &
    read_step_curve
  use dem_setup_run, only: spare_inputs
  use dem_clock, only: dem_clock_type, event_history, event_output, event_checkpoint, &
    event_measure, event_count
  use dem_histories, only: dem_histories_type
  use dem_fields, only: dem_fields_type
  use dem_measures, only: dem_measures_type
  use dem_restart, only: write_checkpoint, read_checkpoint
  use dem_logbook, only: begin_log, log_model, log_row_titles, log_row, log_health, write_summary
  use dem_equilibrium, only: dem_equilibrium_type
  use dem_servo, only: dem_servo_type
  use dem_surcharge, only: dem_surcharge_type
  use dem_surcharge_renew, only: renew_surcharge
  use dem_setup_bodies, only: read_bodies
  use dem_setup_membranes, only: read_membranes
  use dem_setup_surfaces, only: refuse_cell
  use dem_surface_drive, only: surface_drive_type
  use dem_view, only: see_grains, keep_packing, wall_stiffness_of
  use dem_deck_keys, only: dem_deck_table
  implicit none
  private
  public :: dem_model_type, program_name

  character(len=*), parameter :: program_name = 'talus-dem'
  integer(i4), parameter :: block_work = 20000000 !! grain-steps between two looks round
  integer(i4), parameter :: grains_a_thread = 500  !! fewer are not worth another thread
  integer(i4), parameter :: blocks(7) = [100, 50, 20, 10, 5, 2, 1]  !! steps in a block

  type :: dem_model_type
    type(options_type) :: options
    type(ranks_type) :: ranks
    type(deck_type) :: deck
    type(dem_system_type) :: system
    type(dem_packing_type) :: packing
    type(dem_choices_type) :: choices
    type(dem_clock_type) :: clock
    type(dem_equilibrium_type) :: equilibrium
    type(dem_servo_type) :: servo
    type(dem_surcharge_type) :: surcharge
    type(dem_flow_type) :: flow
    type(surface_drive_type) :: drive
    type(dem_probe_type) :: probe
    type(dem_histories_type) :: histories
    type(dem_fields_type) :: fields
    type(dem_measures_type) :: measures
    type(checkpoint_type) :: checkpoint
    type(stop_type) :: stop
    type(timers_type) :: timers
    type(log_type) :: log
    type(lock_type) :: lock
    character(len=:), allocatable :: stem          !! of all files of the run
    character(len=:), allocatable :: restart_path  !! checkpoint gone on from, '' for none
    type(string_type), allocatable :: warnings(:)  !! for the log, once it is open
    real(wp) :: start_time = -1.0_wp               !! of the checkpoint [s], < 0: a fresh run
    integer(i8) :: start_steps = 0                 !! steps taken before
    integer(i8) :: row_step = -1                   !! step of the last log row
    logical :: served = .false.                    !! a partner drives this run
    logical :: stopped = .false.                   !! left early on request
    logical :: opened = .false.                    !! log and files are open
  contains
    procedure :: read => read_run
    procedure :: prepare
    procedure :: open => open_run
    procedure :: run, finish
    procedure :: begin_fresh
    procedure :: begin_again
    procedure :: automatic_dt
    procedure :: use_step
    procedure :: take_steps
    procedure :: load_surface
    procedure :: write_due
    procedure, private :: watch_stops, drive_surfaces, judge_rest, take_probes, &
      write_row, steps_seconds
    procedure :: save_checkpoint, needs_whole, starts_whole
  end type dem_model_type

contains

  !> Deck, packing and all that can be checked without forces.
  subroutine read_run(self, options, errors)
    class(dem_model_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(key_table_type) :: table
    integer(i4) :: threads

    self%options = options
    self%served = len(options%port) > 0
    self%restart_path = ''
    allocate (self%warnings(0))
    call self%timers%init()
    call dem_deck_table(table)
    call self%deck%read(options%deck, table, errors)
    if (errors%any()) return
    self%stem = run_stem(options%deck, options%output_dir)
    call self%deck%get('run', 1, 't_end', self%clock%t_end)
    if (.not. self%served .and. .not. self%deck%given('run', 1, 't_end')) &
      call self%deck%fault(errors, 'D246', 'the run has no end', 'run', 1, '', &
                           'add t_end = ... in s; only under talus-couple it may be left out')
    call spare_inputs(self%deck, self%stem, errors)
    call read_model(self%deck, self%system, self%packing, self%choices, errors)
    call self%measures%read(self%deck, errors)
    call self%equilibrium%read(self%deck, self%choices%adaptive, self%served, errors)
    call self%servo%read(self%deck, self%system%dem_data_type, self%choices%wall, self%served, &
                         errors)
    call read_step_curve(self%deck, self%servo%curve, self%choices, errors)
    call self%surcharge%read(self%deck, self%system%dem_data_type, self%servo%curve, errors)
    if (errors%any()) return
    call read_cell(self%deck, self%packing, self%choices%wall, self%served, self%system, errors)
    call check_regions(self%deck, self%system, self%measures, errors)
    call self%flow%read(self%deck, self%system%dem_data_type, self%servo%curve, errors)
    call refuse_cell(self%deck, self%system%cell%active, errors)
    call read_bodies(self%deck, self%served, self%system%surfaces, errors)
    call read_membranes(self%deck, self%choices%wall, self%served, self%system, errors)
    call self%drive%read(self%deck, self%system%dem_data_type, self%servo%curve, self%served, &
                         errors)
    call self%probe%read(self%deck, self%system%dem_data_type, errors)
    call self%system%use_ranks(self%ranks)
    threads = options%threads
    if (threads == 0) call self%deck%get('run', 1, 'threads', threads)
    if (threads == 0) threads = min(max(1_i4, int(omp_get_max_threads(), i4)/self%ranks%on_host), &
                                    1 + self%system%grains%n/(grains_a_thread*self%ranks%ranks))
    call omp_set_num_threads(threads)
    if (errors%any() .or. self%served) return
    if (size(self%choices%idle) > 0) &
      call self%deck%fault(errors, 'D243', 'grain '//str(self%choices%idle(1))//' is marked as '// &
                           'driven in the packing, but no &driven group moves it', 'particles', 1, &
                           'file', 'add &driven ids = '//str(self%choices%idle(1))// &
                           ', velocity = ... /, or &fixed')
  end subroutine read_run

  !> First forces and time step, or the state of a checkpoint.
  subroutine prepare(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: found(:)
    real(wp) :: every(event_count), every_wall
    integer(i4) :: keep, k

    call self%deck%get('checkpoint', 1, 'keep', keep)
    call self%checkpoint%init(self%stem, program_name, self%deck%hash(), keep)
    call self%deck%get('history', 1, 'every_time', every(event_history))
    call self%deck%get('output', 1, 'every_time', every(event_output))
    call self%deck%get('checkpoint', 1, 'every_time', every(event_checkpoint))
    if (self%served) every(event_checkpoint) = 0.0_wp
    every(event_measure) = self%measures%every
    self%clock%automatic = .not. self%choices%dt > 0.0_wp
    if (len(self%options%restart) > 0 .and. .not. self%options%check) then
      call self%checkpoint%find(self%options%restart, self%restart_path, found, errors)
      if (errors%any()) return
      do k = 1, size(found)
        call append_string(self%warnings, found(k)%s)
      end do
      if (len(self%restart_path) == 0) call append_string(self%warnings, &
        'there is no checkpoint to go on from: a fresh run')
    end if
    call self%histories%init(self%system)
    self%system%apart = self%ranks%several() .and. .not. self%starts_whole()
    if (len(self%restart_path) > 0) then
      call self%begin_again(self%restart_path, every, errors)
    else
      call self%begin_fresh(every, errors)
    end if
    every_wall = 0.0_wp
    if (.not. self%served) call self%deck%get('checkpoint', 1, 'every_wall', every_wall)
    call self%checkpoint%schedule(every_wall, 0.0_wp, self%clock%time())
    if (errors%any()) return
    if (self%servo%active()) call self%servo%start(self%system%dem_data_type, self%clock%time(), &
                                                   wall_stiffness_of(self%system))
    call renew_surcharge(self%surcharge, self%system, self%clock, .true., errors)
  end subroutine prepare

  !> Start at time zero from the packing.
  subroutine begin_fresh(self, every, errors)
    class(dem_model_type), intent(inout) :: self
    real(wp), intent(in) :: every(event_count)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: warning
    real(wp) :: dt

    self%system%par%dt = self%choices%dt
    call self%system%init(errors)
    if (errors%any()) return
    call check_initial_overlap(self%system, self%choices, self%deck%path('particles', 1, 'file'), &
                               errors)
    call check_step(self%deck, self%system, self%choices, warning, errors)
    if (errors%any()) return
    if (len(warning) > 0) call append_string(self%warnings, warning)
    call self%clock%set_events(every)
    dt = self%choices%dt
    if (self%clock%automatic) dt = self%clock%chosen_step(self%automatic_dt())
    call self%clock%start_at(0.0_wp, dt)
    call self%use_step(dt)
    call self%system%glance()
    call self%flow%look(self%system%dem_data_type, 0.0_wp)
    call self%drive_surfaces()
  end subroutine begin_fresh

  !> Start from a checkpoint.
  subroutine begin_again(self, path, every, errors)
    class(dem_model_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: every(event_count)
    type(error_list_type), intent(inout) :: errors
    logical :: deck_changed

    call read_checkpoint(self%checkpoint, path, self%system, self%clock, self%histories, &
                         deck_changed, errors)
    if (errors%any()) return
    self%restart_path = path
    self%start_time = self%clock%time()
    self%start_steps = self%clock%steps
    call self%clock%set_events(every)
    if (deck_changed) call self%system%follow_laws()
    if (deck_changed) call self%flow%look(self%system%dem_data_type, self%clock%time())
    if (deck_changed .and. .not. self%servo%active()) &
      self%system%planes%velocity = self%servo%wall_velocity
    if (deck_changed) call self%drive%follow(self%system%dem_data_type, self%clock%time())
    if (deck_changed) call append_string(self%warnings, 'the deck is not the one that wrote '// &
      path//'; grains, driven motion and places of walls go on as in the checkpoint')
    if (self%clock%automatic .or. abs(self%choices%dt - self%clock%dt) <= 0.0_wp) return
    call self%clock%start_at(self%clock%time(), self%choices%dt)
    call self%use_step(self%choices%dt)
  end subroutine begin_again

  !> Step that an automatic choice takes now [s].
  real(wp) function automatic_dt(self) result(dt)
    class(dem_model_type), intent(in) :: self
    real(wp), parameter :: least_steps = 100.0_wp
    dt = self%clock%dt
    if (self%clock%automatic) dt = self%system%automatic_step(self%system%top_speed())
    if (self%choices%dt_curve > 0) &
      dt = dt*self%servo%curve(self%choices%dt_curve)%at(self%clock%time())
    if (self%clock%t_end > 0.0_wp) dt = min(dt, self%clock%t_end/least_steps)
  end function automatic_dt

  !> Steps of this length from now on; driven grains turn by spin times step.
  subroutine use_step(self, dt)
    class(dem_model_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! s
    self%system%par%dt = dt
    associate (driven => self%histories%index)
      if (size(driven) > 0) call self%system%set_velocity( &
        driven, self%system%grains%v(:, driven), self%system%grains%omega(:, driven))
    end associate
  end subroutine use_step

  !> Open log, histories, fields; write a fresh run's first state; a last field off the times goes.
  subroutine open_run(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: fields(:)
    character(len=:), allocatable :: note
    real(wp) :: kept
    integer(i4) :: k

    call self%watch_stops()
    call make_folder(folder_of(self%stem), errors)
    if (.not. errors%any()) call self%lock%take(self%stem, program_name, errors)
    if (errors%any()) return
    call self%log%open(self%stem//'.log', errors, append=self%start_time >= 0.0_wp)
    if (errors%any()) return
    self%opened = .true.
    call begin_log(self%log, program_name, self%deck, self%ranks%ranks, &
                   int(omp_get_max_threads(), i4))
    call log_model(self%log, self%deck, self%system, self%choices, self%clock)
    if (self%surcharge%active) &
      call self%log%item('surcharge', self%surcharge%text(self%system%dem_data_type))
    if (len(self%restart_path) > 0) call self%log%item('goes on from', self%restart_path, &
      'time '//str(self%start_time)//' s, step '//str(self%start_steps))
    if (self%deck%count('history') > 0) then
      call self%histories%open(self%stem, self%start_time, errors)
      call self%servo%open(self%stem, self%start_time, errors)
      call self%surcharge%open(self%stem, self%start_time, errors)
      call self%flow%open(self%stem, self%start_time, errors)
    end if
    if (self%deck%count('output') > 0 .and. .not. errors%any()) then
      call self%deck%get('output', 1, 'fields', fields)
      do k = 1, size(fields)
        self%fields%contacts = self%fields%contacts .or. fields(k)%s == 'contacts'
      end do
      kept = self%start_time
      if (.not. self%clock%on_time(event_output)) kept = kept*(1.0_wp - epsilon(kept))
      call self%fields%open(self%stem, kept, note, errors)
      if (len(note) > 0) call append_string(self%warnings, note)
    end if
    if (.not. errors%any()) call self%measures%open(self%stem, self%start_time, errors)
    do k = 1, size(self%warnings)
      call self%log%warn(self%warnings(k)%s)
    end do
    call log_row_titles(self%log)
    if (self%start_time >= 0.0_wp .or. errors%any()) return
    call self%histories%write(0.0_wp, self%system, errors)
    call self%servo%write(0.0_wp, self%system%dem_data_type, errors)
    call self%surcharge%write(0.0_wp, self%system%dem_data_type, errors)
    call self%flow%write(0.0_wp, self%system%dem_data_type, errors)
    call self%fields%write(0.0_wp, self%system, errors)
    call self%measures%write(0.0_wp, self%system, .true., errors)
  end subroutine open_run

  !> Signals, wall limit and stop file are watched from here on; a partner has its own.
  subroutine watch_stops(self)
    class(dem_model_type), intent(inout) :: self
    character(len=:), allocatable :: stop_file
    real(wp) :: wall_limit
    wall_limit = 0.0_wp
    stop_file = ''
    if (.not. self%served) then
      call self%deck%get('run', 1, 'wall_limit', wall_limit)
      call self%deck%get('run', 1, 'stop_file', stop_file)
      if (len(stop_file) > 0) stop_file = self%deck%path('run', 1, 'stop_file')
    end if
    call self%stop%init(wall_limit, stop_file, obey_signals=.not. self%served)
  end subroutine watch_stops

  !> Steps until the end, a fault or a request to stop.
  subroutine run(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: block

    block = blocks(findloc(blocks*real(self%system%grains%n, wp) <= block_work, .true., 1) &
                   + merge(7, 0, self%system%grains%n > block_work))
    block = min(block, self%equilibrium%longest_block(), self%servo%longest_block(), &
                self%surcharge%longest_block(), self%flow%longest_block(), &
                self%drive%longest_block())
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
      if (self%clock%review_due()) then
        call self%clock%review(self%automatic_dt(), self%system%step_limit())
        if (abs(self%clock%dt - self%system%par%dt) > 0.0_wp) call self%use_step(self%clock%dt)
      end if
      call self%take_steps(block, errors)
      if (errors%any()) return
      if (self%servo%due(self%clock%steps) .and. self%needs_whole()) call self%system%look()
      if (self%flow%due(self%clock%steps)) call self%system%glance()
      if (self%servo%due(self%clock%steps)) &
        call self%servo%look(self%system%dem_data_type, self%clock%time(), &
                             wall_stiffness_of(self%system))
      call self%load_surface(.false., errors)
      if (self%flow%due(self%clock%steps)) &
        call self%flow%look(self%system%dem_data_type, self%clock%time())
      if (self%drive%due(self%clock%steps)) call self%drive_surfaces()
      if (self%equilibrium%due(self%clock%steps)) call self%judge_rest()
      call self%equilibrium%damp(self%system, self%clock%steps)
      call self%write_due(errors)
    end do
  end subroutine run

  !> Velocities of surfaces and loads of free bodies for the steps to come.
  subroutine drive_surfaces(self)
    class(dem_model_type), intent(inout) :: self
    real(wp) :: start
    start = self%system%ledger%start
    call self%drive%look(self%system%dem_data_type, self%clock%time())
    call self%system%start_moved(start)
  end subroutine drive_surfaces

  !> Is anything in use that looks at all grains and their contacts?
  logical function needs_whole(self)
    class(dem_model_type), intent(in) :: self
    needs_whole = self%servo%surfaces%active() .or. self%probe%wanted .or. self%served
  end function needs_whole

  !> Does one process make the first list and forces, whatever the ranks?
  logical function starts_whole(self)
    class(dem_model_type), intent(in) :: self
    starts_whole = self%needs_whole() .or. self%system%pairs%extras%bond%given &
      .or. self%system%springs%given > 0
  end function starts_whole

  !> Have the grains come to rest, and do all servos hold their stresses?
  subroutine judge_rest(self)
    class(dem_model_type), intent(inout) :: self
    if (.not. self%equilibrium%watched) return
    call self%equilibrium%look(self%system, self%servo%satisfied(self%system%dem_data_type) .and. &
                               self%flow%satisfied(self%system%dem_data_type))
  end subroutine judge_rest

  !> Moduli of the last state.
  subroutine take_probes(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%timers%start('probes')
    call self%probe%run(self%system, self%deck%source%path, errors)
    call self%timers%stop('probes')
    call self%probe%write(self%stem, program_name, self%deck, self%clock%time(), &
                          cell_volume(self%system%cell), self%log, errors)
  end subroutine take_probes

  !> Steps up to the next thing to do. A stop at an odd time (t_end off the grid) must not show in
  !! the health counters, or a run that goes on from there would differ.
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

  !> The surcharge finds the surface anew, when it is due, or before the first step when kinds have
  !! changed.
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

  !> Histories, fields and log rows that are due.
  subroutine write_due(self, errors)
    class(dem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t

    if (errors%any()) return
    t = self%clock%time()
    call self%timers%start('output')
    if (self%clock%due(event_history)) then
      if (self%needs_whole()) call self%system%look()
      if (self%surcharge%active) call see_grains(self%system)
      call self%histories%write(t, self%system, errors)
      call self%servo%write(t, self%system%dem_data_type, errors)
      call self%surcharge%write(t, self%system%dem_data_type, errors)
      call self%flow%write(t, self%system%dem_data_type, errors)
      call self%clock%passed(event_history)
    end if
    if (self%clock%due(event_output)) then
      call self%fields%write(t, self%system, errors)
      call self%clock%passed(event_output)
    end if
    if (self%clock%due(event_measure)) then
      call self%measures%write(t, self%system, .false., errors)
      call self%clock%passed(event_measure)
    end if
    if (self%log%row_due()) then
      call self%histories%flush(errors)
      call self%servo%flush(errors)
      call self%surcharge%history%flush(errors)
      call self%flow%history%flush(errors)
      call self%write_row()
    end if
    call self%timers%stop('output')
    if (self%clock%t_end > 0.0_wp .and. .not. self%served) &
      call self%log%progress(t/self%clock%t_end, short_number(t)//' s')
  end subroutine write_due

  !> A row of the log, with the wall time of a step and what is left.
  subroutine write_row(self)
    class(dem_model_type), intent(inout) :: self
    real(wp) :: step_time, left
    integer(i8) :: steps

    steps = max(self%clock%steps - self%start_steps, 1_i8)
    step_time = self%timers%elapsed()/real(steps, wp)
    left = -1.0_wp
    if (self%clock%t_end > 0.0_wp .and. .not. self%served) &
      left = max(0.0_wp, self%clock%t_end - self%clock%time())/self%clock%dt*step_time
    step_time = self%steps_seconds()/real(steps, wp)
    call log_row(self%log, self%system, self%clock, step_time, left)
    self%row_step = self%clock%steps
  end subroutine write_row

  !> Wall time spent in steps so far [s].
  real(wp) function steps_seconds(self)
    class(dem_model_type), intent(inout) :: self
    integer(i4) :: number
    call self%timers%index('steps', number)
    steps_seconds = self%timers%seconds(number)
  end function steps_seconds

  !> Write a checkpoint; histories reach the disk first.
  subroutine save_checkpoint(self, tag, errors)
    class(dem_model_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors

    call self%timers%start('checkpoint')
    if (self%system%surfaces%n > 0) call self%system%look()
    call self%histories%flush(errors)
    call self%servo%flush(errors)
    call self%surcharge%history%flush(errors)
    call self%measures%flush(errors)
    call self%system%refresh_ledger()
    call self%clock%passed(event_checkpoint)
    if (.not. errors%any()) call write_checkpoint(self%checkpoint, self%system, self%clock, &
                                                  self%histories, tag, errors)
    call self%timers%stop('checkpoint')
  end subroutine save_checkpoint

  !> Last state, checkpoint, packing, health, timers, summary; exit_code is that of the run.
  subroutine finish(self, exit_code, errors)
    class(dem_model_type), intent(inout) :: self
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: ignored
    character(len=:), allocatable :: packing

    call self%deck%get('output', 1, 'packing', packing)
    if (self%needs_whole()) call self%system%look()
    if (self%surcharge%active) call see_grains(self%system)
    call self%system%glance()
    if (.not. (errors%any() .or. self%stopped)) call self%judge_rest()
    if (.not. errors%any()) then
      call self%fields%write(self%clock%time(), self%system, errors)
      call self%measures%write(self%clock%time(), self%system, .true., errors)
      if (.not. self%served .and. (self%stopped .or. self%deck%count('checkpoint') > 0)) &
        call self%save_checkpoint('', errors)
      if (len(packing) > 0 .and. .not. self%stopped .and. .not. errors%any()) &
        call keep_packing(self%system, folder_of(self%stem)//'/'//packing, &
                          self%packing%group, errors)
    else if (self%opened) then
      call self%fields%write(self%clock%time(), self%system, ignored)
    end if
    call self%histories%close(errors)
    call self%servo%close(errors)
    call self%surcharge%history%close(errors)
    call self%flow%history%close(errors)
    call self%measures%close(errors)
    if (.not. (self%stopped .or. errors%any())) then
      call self%equilibrium%judge(self%clock%time(), self%deck%source%path, errors)
      if (self%servo%active()) call self%servo%judge(self%system%dem_data_type, &
        self%clock%time(), wall_stiffness_of(self%system), self%deck%source%path, errors)
      call self%flow%judge(self%system%dem_data_type, self%deck%source%path, errors)
      if (self%probe%wanted .and. .not. errors%any()) call self%take_probes(errors)
    end if
    exit_code = errors%exit_code()
    if (exit_code == 0 .and. self%stopped) exit_code = exit_stopped
    if (.not. self%opened) call self%lock%release()
    if (.not. self%opened) return
    if (self%row_step < self%clock%steps) call self%write_row()
    call self%log%faults(errors)
    if (self%equilibrium%watched) call self%log%line(self%equilibrium%text())
    if (self%surcharge%active) call self%log%line( &
      'surcharge: '//self%surcharge%text(self%system%dem_data_type))
    call log_health(self%log, self%system, self%clock)
    if (allocated(self%system%crew)) &
      call self%log%item('ranks', self%system%crew%text(self%steps_seconds()))
    call self%log%timer_table(self%timers)
    call write_summary(self%stem//'_summary.json', program_name, self%deck, self%system, &
                       self%clock, self%timers, self%clock%steps - self%start_steps, &
                       self%steps_seconds(), exit_code, errors, self%equilibrium, ignored)
    call self%log%finish(program_name, exit_code, 'time '//short_number(self%clock%time())// &
                         ' s, '//str(self%clock%steps)//' steps')
    call self%log%close()
    call self%lock%release()
  end subroutine finish
end module dem_model
