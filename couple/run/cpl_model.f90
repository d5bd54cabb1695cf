!> A coupled run: read, open, launch, run, finish.
!!
!! Only this program obeys signals, wall limit and stop file. Whatever happens, `finish` ends both
!! solvers and removes the ports.
module cpl_model
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type, exit_stopped, exit_input
  use talus_options, only: options_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_checkpoint, only: checkpoint_type
  use talus_files, only: make_folder, remove_empty_folder, remove_file, folder_exists, &
    folder_of, run_stem
  use talus_hash, only: hash_file, hash_text
  use talus_lock, only: lock_type
  use talus_log, only: log_type, short_number
  use talus_message, only: verb_checkpoint
  use talus_stop, only: stop_type, stop_none
  use talus_system, only: process_id, date_text
  use talus_timers, only: timers_type
  use cpl_audit, only: audit_type
  use cpl_bridge_step, only: bridge_step
  use cpl_choices, only: cpl_choices_type, read_choices, read_solvers, rotation_fixed
  use cpl_deck_keys, only: cpl_deck_table
  use cpl_exchange, only: exchange
  use cpl_handshake, only: shake_hands
  use cpl_interface, only: interface_type
  use cpl_launch, only: launch_solver, stop_solvers, abort_solvers
  use cpl_logbook, only: begin_log, log_solvers, log_interface, log_row_titles, log_row, &
    log_health, write_summary, work_share
  use cpl_manifest, only: manifest_type, write_manifest, find_manifest
  use cpl_overlap, only: overlap_type
  use cpl_overlap_file, only: write_overlap, read_overlap_state, read_overlap_reference
  use cpl_overlap_limit, only: kick_watch_type
  use cpl_overlap_log, only: log_census, open_overlap_audit, audit_row_type, &
    overlap_row_titles, overlap_row, overlap_health, overlap_summary
  use cpl_overlap_remap, only: look_after, rebuild_map
  use cpl_overlap_setup, only: make_overlap, begin_overlap
  use cpl_overlap_static, only: static_step
  use cpl_overlap_step, only: overlap_step
  use cpl_sets_file, only: write_sets
  use cpl_setup, only: find_ghosts, find_vertices, find_radii, make_map, select_sets, &
    begin_interface, end_rehearsal
  use cpl_solver, only: cpl_solver_type
  use cpl_start, only: relax_together
  use cpl_state_file, only: write_state, read_state, read_reference
  implicit none
  private
  public :: cpl_model_type, program_name

  character(len=*), parameter :: program_name = 'talus-couple'

  type :: cpl_model_type
    type(options_type) :: options
    type(deck_type) :: deck
    type(cpl_choices_type) :: choices
    type(cpl_solver_type) :: solvers(2)
    type(interface_type) :: face           !! its step counts for overlaps, too
    type(overlap_type) :: overlap
    type(kick_watch_type) :: kick_watch
    type(audit_type) :: audit
    type(audit_row_type) :: row            !! of an overlap, taken and not written yet
    type(checkpoint_type) :: checkpoint
    type(manifest_type) :: manifest        !! gone on from
    type(stop_type) :: stop
    type(timers_type) :: timers
    type(log_type) :: log
    type(lock_type) :: lock
    character(len=:), allocatable :: stem
    character(len=:), allocatable :: run_id
    type(string_type), allocatable :: warnings(:)
    integer(i4) :: keep = 2
    logical :: again = .false.             !! goes on from a checkpoint
    logical :: begun_log = .false.         !! the log is on the screen
    logical :: opened = .false.            !! the log is a file
    logical :: new_folder = .false.        !! the folder of the results was made by this run
    logical :: running = .false.           !! exchanges have begun
    logical :: stopped = .false.           !! left early on request
    real(wp) :: begun = 0.0_wp             !! elapsed time when the exchanges began [s]
    real(wp) :: waited = 0.0_wp            !! waits until then [s]
    real(wp) :: stood = 0.0_wp             !! the grains had stood still until then [s]
    integer(i8) :: first_step = 0          !! of this part of the run
    integer(i8) :: saved_step = -1         !! of the last checkpoint
  contains
    procedure :: read => read_run
    procedure :: open => open_run
    procedure :: prepare
    procedure :: run
    procedure :: finish
    procedure, private :: advance
    procedure, private :: look
    procedure, private :: sum_up
    procedure, private :: open_log
    procedure, private :: close_all
    procedure, private :: time_of
    procedure, private :: overhead
    procedure, private :: prepare_overlap
    procedure, private :: rebuild
    procedure, private :: save_checkpoint
    procedure, private :: write_row
    procedure, private :: tell_of_lag
  end type cpl_model_type

contains

  !> Deck and all that it alone can tell.
  subroutine read_run(self, options, errors)
    class(cpl_model_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(key_table_type) :: table

    self%options = options
    allocate (self%warnings(0))
    call self%timers%init()
    call cpl_deck_table(table)
    call self%deck%read(options%deck, table, errors)
    if (errors%any()) return
    self%stem = run_stem(options%deck, options%output_dir)
    self%run_id = str(process_id())//'-'//hash_text(date_text()//self%stem)
    call read_choices(self%deck, self%choices, errors)
    call read_solvers(self%deck, self%stem, self%solvers, errors)
  end subroutine read_run

  !> Lock, signals, checkpoint to go on from; the log, which goes to its file when both solvers and
  !! the facet map are found good.
  subroutine open_run(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: stop_file, path
    real(wp) :: wall_limit
    integer(i4) :: k

    self%new_folder = .not. folder_exists(folder_of(self%stem))
    call make_folder(folder_of(self%stem), errors)
    if (.not. errors%any()) call self%lock%take(self%stem, program_name, errors)
    if (errors%any()) return
    call self%deck%get('checkpoint', 1, 'keep', self%keep)
    call self%checkpoint%init(self%stem, program_name, self%deck%hash(), self%keep)
    if (len(self%options%restart) > 0) then
      call find_manifest(self%options%restart, self%stem, self%manifest, path, self%again, &
                         self%warnings, errors)
      if (errors%any()) return
      if (.not. self%again) call append_string(self%warnings, &
        'there is no manifest to go on from: a fresh run')
    end if
    call self%log%hold()
    self%begun_log = .true.
    call begin_log(self%log, program_name, self%deck)
    if (self%again) then
      call self%log%item('goes on from', path, 'time '//str(self%manifest%time)//' s, exchange '// &
                         str(self%manifest%step))
      if (self%manifest%deck_hash /= self%deck%hash()) call append_string(self%warnings, &
        'the deck is not the one that wrote '//path)
    end if
    do k = 1, size(self%warnings)
      call self%log%warn(self%warnings(k)%s)
    end do
    call self%deck%get('run', 1, 'wall_limit', wall_limit)
    call self%deck%get('run', 1, 'stop_file', stop_file)
    if (len(stop_file) > 0) stop_file = self%deck%path('run', 1, 'stop_file')
    call self%stop%init(wall_limit, stop_file)
  end subroutine open_run

  !> From here on the log is also a file.
  subroutine open_log(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%log%open(self%stem//'.log', errors, append=self%again)
    self%opened = .not. errors%any()
  end subroutine open_log

  !> Launch, HELLO, map, sets, READY.
  subroutine prepare(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: identity
    integer(i4) :: k

    do k = 1, 2
      self%solvers(k)%restart = ''
      if (self%again) self%solvers(k)%restart = self%manifest%path(k)%s
      call launch_solver(self%solvers(k), self%choices, self%run_id, folder_of(self%stem), &
                         self%log, errors)
      if (errors%any()) return
    end do
    call shake_hands(self%solvers, self%choices, self%run_id, self%manifest%time, self%timers, &
                     self%face%dynamic, errors)
    if (errors%any()) return
    call log_solvers(self%log, self%solvers)
    if (self%choices%overlap%given) then
      call self%prepare_overlap(errors)
      return
    end if
    call self%rebuild(identity, errors)
    if (errors%any()) return
    call select_sets(self%face, self%solvers, self%timers, errors)
    if (self%again .and. .not. errors%any()) &
      call read_state(self%checkpoint, self%manifest%path(3)%s, self%face, errors)
    if (errors%any()) return
    call begin_interface(self%face, self%solvers, self%choices, self%again, self%timers, errors)
    if (.not. errors%any()) call self%open_log(errors)
    if (self%choices%relaxed .and. .not. (self%again .or. errors%any())) then
      call relax_together(self%face, self%solvers, self%choices, self%log, self%stop, &
                          self%timers, errors)
      if (.not. errors%any()) call end_rehearsal(self%face, self%solvers, self%timers, errors)
    end if
    if (errors%any()) return
    call log_interface(self%log, self%face, self%choices, identity)
    call self%audit%open(self%stem//'_audit.csv', self%again, self%manifest%time, errors)
  end subroutine prepare

  !> The same for an overlap: sets and operators, from the reference state after a restart.
  subroutine prepare_overlap(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: reference(:, :)

    if (self%again) call read_overlap_reference(self%checkpoint, self%manifest%path(3)%s, &
                                                reference, errors)
    if (errors%any()) return
    call make_overlap(self%overlap, self%solvers, self%choices, self%face%dynamic, reference, &
                      self%timers, errors)
    if (self%again .and. .not. errors%any()) &
      call read_overlap_state(self%checkpoint, self%manifest%path(3)%s, self%overlap, errors)
    if (self%overlap%remaps > 0 .and. .not. errors%any()) call rebuild_map(self%overlap, errors)
    if (errors%any()) return
    self%face%step = self%overlap%step
    call begin_overlap(self%overlap, self%solvers, self%choices, self%again, self%timers, errors)
    if (.not. (self%again .or. errors%any())) &
      call self%kick_watch%begin(self%overlap, self%solvers, self%timers, errors)
    if (.not. errors%any()) call self%open_log(errors)
    if (errors%any()) return
    call log_census(self%log, self%overlap, self%choices)
    if (.not. self%again) call write_sets(self%stem//'_sets.h5', self%overlap, errors)
    call open_overlap_audit(self%audit%file, self%stem//'_audit.csv', self%overlap%static, &
                            self%again, self%manifest%time, errors)
  end subroutine prepare_overlap

  !> The operators: from the packing and the mesh, or from the stored reference state, whose hash
  !! must come out again (I404).
  subroutine rebuild(self, identity, errors)
    class(cpl_model_type), intent(inout) :: self
    real(wp), intent(out) :: identity
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    real(wp), allocatable :: x(:, :)
    character(len=:), allocatable :: map_hash
    character(len=16) :: own
    real(wp) :: time

    identity = 0.0_wp
    if (self%again) then
      call read_reference(self%checkpoint, self%manifest%path(3)%s, ids, x, map_hash, time, errors)
    else if (len(self%choices%surface) > 0) then
      call find_vertices(self%solvers(2), self%choices%facets, ids, x, self%timers, errors)
    else
      call find_ghosts(self%solvers(1), self%choices%ghosts, ids, x, self%timers, errors)
    end if
    if (errors%any()) return
    call make_map(self%face, self%solvers(2), self%choices, ids, x, identity, self%timers, errors)
    if (self%choices%rotation /= rotation_fixed .and. .not. errors%any()) &
      call find_radii(self%face, self%solvers(1), self%timers, errors)
    if (errors%any() .or. .not. self%again) return
    own = self%face%transfer%hash(self%face%map)
    if (own /= map_hash) &
      call errors%add('I404', 'the facet map is not the one of the checkpoint ('// &
                      own//', not '//map_hash//')', self%manifest%path(3)%s, &
                      'go on with the mesh and the deck that wrote it')
  end subroutine rebuild

  !> Exchanges until the end, a fault or a request to stop.
  subroutine run(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t0, t1, every_wall, every_time

    call self%deck%get('checkpoint', 1, 'every_wall', every_wall)
    call self%deck%get('checkpoint', 1, 'every_time', every_time)
    call self%checkpoint%schedule(every_wall, every_time, self%time_of(self%face%step))
    self%first_step = self%face%step
    if (self%again) self%saved_step = self%face%step
    self%running = .true.
    self%begun = self%timers%elapsed()
    self%waited = (1.0_wp - work_share(self%timers, 0.0_wp, 0.0_wp))*self%begun
    self%stood = self%solvers(1)%stood
    if (self%choices%overlap%given) then
      call overlap_row_titles(self%log)
    else
      call log_row_titles(self%log)
    end if
    do while (self%face%step < self%choices%exchanges)
      if (self%stop%check() /= stop_none) exit
      t0 = self%time_of(self%face%step)
      t1 = self%time_of(self%face%step + 1)
      call self%advance(t0, t1, errors)
      if (errors%any()) return
      call self%timers%start('audit and log')
      if (self%log%row_due()) call self%write_row()
      call self%log%progress(t1/self%choices%t_end, short_number(t1)//' s')
      call self%timers%stop('audit and log')
      if (self%checkpoint%due(t1) .or. self%stop%checkpoint_asked()) &
        call self%save_checkpoint(errors)
      if (errors%any()) return
    end do
    if (self%face%step < self%choices%exchanges) then
      self%stopped = .true.
      call self%log%line('stopping early: '//self%stop%text())
      call self%save_checkpoint(errors)
    else if (self%deck%count('checkpoint') > 0) then
      call self%save_checkpoint(errors)
    end if
  end subroutine run

  !> One exchange and its row in the audit.
  subroutine advance(self, t0, t1, errors)
    class(cpl_model_type), intent(inout) :: self
    real(wp), intent(in) :: t0, t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: gap

    if (self%choices%overlap%given) then
      if (self%overlap%bridge%active) then
        call bridge_step(self%overlap, self%solvers, self%choices%exchange, t0, t1, &
                         self%timers, errors)
      else if (self%overlap%static) then
        call static_step(self%overlap, self%solvers, self%choices%exchange, t0, t1, self%timers, &
                         errors)
      else
        call overlap_step(self%overlap, self%solvers, self%choices%exchange, t0, t1, &
                          self%row, self%audit%file, self%timers, errors)
      end if
      if (errors%any()) return
      self%face%step = self%overlap%step
      call self%timers%start('audit and log')
      call self%row%write(self%audit%file, errors)
      call self%row%take(self%overlap, t1)
      call self%timers%stop('audit and log')
      if (.not. self%overlap%bridge%active) call self%look(t1, errors)
      return
    end if
    call exchange(self%face, self%solvers, self%choices, t0, t1, self%timers, errors)
    if (errors%any()) return
    call self%timers%start('audit and log')
    call self%audit%note(self%face, gap)
    call self%audit%row(self%face, t1, gap, errors)
    call self%tell_of_lag()
    call self%timers%stop('audit and log')
  end subroutine advance

  !> Have free grains moved past the nodes? A new map may have another limit of its kicks.
  subroutine look(self, time, errors)
    class(cpl_model_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: said
    integer(i8) :: remaps

    call self%timers%start('audit and log')
    remaps = self%overlap%remaps
    associate (wanted => self%choices%overlap)
      call look_after(self%overlap, wanted%remap, wanted%leaving, time, said, errors)
    end associate
    if (len(said) > 0) call self%log%line(said)
    call self%timers%stop('audit and log')
    if (errors%any() .or. self%overlap%remaps == remaps) return
    call self%kick_watch%renew(self%overlap, self%choices%exchange, self%timers, said)
    if (len(said) > 0) call self%log%line(said)
  end subroutine look

  !> Time of an exchange [s]: a multiple of the interval, the same however often it is restarted.
  pure real(wp) function time_of(self, step)
    class(cpl_model_type), intent(in) :: self
    integer(i8), intent(in) :: step
    time_of = step*self%choices%exchange
    if (step == self%choices%exchanges) time_of = self%choices%t_end
  end function time_of

  !> Files of all three at the accepted exchange, then the manifest.
  subroutine save_checkpoint(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(manifest_type) :: manifest
    character(len=:), allocatable :: tag, hash
    character(len=16) :: own
    real(wp) :: time
    integer(i4) :: k, status

    if (self%face%step == self%saved_step) return
    time = self%time_of(self%face%step)
    tag = 'x'//str(self%face%step)
    call self%row%write(self%audit%file, errors)
    call self%audit%file%flush(errors)
    do k = 1, 2
      call self%solvers(k)%start_request(verb_checkpoint, self%face%step, time, time)
      call self%solvers(k)%request%put_text('tag', tag)
      call self%solvers(k)%send(self%timers, errors)
    end do
    do k = 1, 2
      if (errors%any()) return
      call self%solvers(k)%receive(self%timers, errors)
      if (errors%any()) return
      call self%solvers(k)%reply%get_text('path', manifest%path(k)%s, errors)
      call self%solvers(k)%reply%get_text('hash', hash, errors)
      manifest%hash(k) = hash
    end do
    call self%timers%start('checkpoint')
    if (self%choices%overlap%given) then
      call write_overlap(self%checkpoint, self%overlap, time, tag, errors)
    else
      call write_state(self%checkpoint, self%face, time, tag, errors)
    end if
    if (.not. errors%any()) then
      manifest%path(3)%s = self%checkpoint%tag_path(tag)
      call hash_file(manifest%path(3)%s, own, status)
      manifest%hash(3) = own
      manifest%time = time
      manifest%step = self%face%step
      manifest%deck_hash = self%deck%hash()
      call write_manifest(self%stem, manifest, self%keep, errors)
      self%saved_step = self%face%step
    end if
    call self%timers%stop('checkpoint')
  end subroutine save_checkpoint

  subroutine write_row(self)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type) :: ignored
    real(wp) :: left, overhead(2)
    integer(i8) :: done
    overhead = self%overhead()
    done = max(self%face%step - self%first_step, 1_i8)
    left = (self%timers%elapsed() - self%begun)/done*(self%choices%exchanges - self%face%step)
    if (self%choices%overlap%given) then
      call overlap_row(self%log, self%overlap, self%time_of(self%face%step), overhead(1), left)
    else
      call log_row(self%log, self%face, self%audit, self%time_of(self%face%step), &
        overhead(1), left)
    end if
    call self%row%write(self%audit%file, ignored)
    call self%audit%file%flush(ignored)
  end subroutine write_row

  !> One warning when the exchange does not settle.
  subroutine tell_of_lag(self)
    class(cpl_model_type), intent(inout) :: self
    character(len=:), allocatable :: text
    if (self%audit%lag%stalls == 0 .or. self%audit%lag%told) return
    text = self%audit%lag%warning(self%choices%interface, self%choices%scheme)
    call self%log%warn('time '//short_number(self%time_of(self%face%step))//' s: '//text)
  end subroutine tell_of_lag

  !> Shares of the time of the exchanges that the grains stood still for the coupling, and that it
  !! worked: less or more, as much of the work is done while they work.
  function overhead(self)
    class(cpl_model_type), intent(inout) :: self
    real(wp) :: overhead(2)
    overhead = work_share(self%timers, self%begun, self%waited)
    if (self%solvers(1)%stood > self%stood) overhead(1) = (self%solvers(1)%stood - self%stood) &
      /max(self%timers%elapsed() - self%begun, tiny(1.0_wp))
  end function overhead

  !> End both solvers, log, summary; exit_code is that of the run.
  subroutine finish(self, exit_code, errors)
    class(cpl_model_type), intent(inout) :: self
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: ignored
    real(wp) :: time, overhead(2)

    time = self%time_of(self%face%step)
    overhead = 0.0_wp
    if (self%running) overhead = self%overhead()
    if (.not. errors%any()) &
      call stop_solvers(self%solvers, self%stopped, self%face%step, time, self%timers, errors)
    call abort_solvers(self%solvers, self%face%step, time)
    call self%row%write(self%audit%file, errors)
    call self%audit%file%close(errors)
    exit_code = errors%exit_code()
    if (exit_code == 0 .and. self%stopped) exit_code = exit_stopped
    if (self%begun_log .and. exit_code /= exit_input .and. .not. self%opened) &
      call self%open_log(ignored)
    if (.not. self%opened) then
      call self%close_all(exit_code)
      return
    end if
    call self%log%faults(errors)
    if (self%running) then
      if (self%face%step > self%first_step) call self%write_row()
      call self%sum_up(time, overhead, exit_code, errors)
    end if
    call self%log%finish(program_name, exit_code, 'time '//short_number(time)//' s, '// &
                         str(self%face%step)//' exchanges')
    call self%close_all(exit_code)
  end subroutine finish

  !> Health line, timers, summary.json.
  subroutine sum_up(self, time, overhead, exit_code, errors)
    class(cpl_model_type), intent(inout) :: self
    real(wp), intent(in) :: time, overhead(2)  !! [s], shares of the run time
    integer(i4), intent(in) :: exit_code
    type(error_list_type), intent(in) :: errors
    type(error_list_type) :: ignored
    if (self%choices%overlap%given) then
      call overlap_health(self%log, self%overlap, self%choices%overlap%settled, overhead)
      call self%log%timer_table(self%timers)
      call overlap_summary(self%stem//'_summary.json', program_name, self%deck, self%overlap, &
                           self%timers, time, overhead, exit_code, errors, ignored)
    else
      call log_health(self%log, self%face, self%audit, overhead)
      call self%log%timer_table(self%timers)
      call write_summary(self%stem//'_summary.json', program_name, self%deck, self%face, &
                         self%audit, self%timers, time, overhead, exit_code, errors, ignored)
    end if
  end subroutine sum_up

  !> Log and lock; a run that was refused leaves nothing.
  subroutine close_all(self, exit_code)
    class(cpl_model_type), intent(inout) :: self
    integer(i4), intent(in) :: exit_code
    integer(i4) :: k
    if (self%opened) call self%log%close()
    if (exit_code == exit_input .and. .not. self%opened .and. self%begun_log) then
      do k = 1, 2
        call remove_file(self%solvers(k)%output)
      end do
    end if
    call self%lock%release()
    if (exit_code == exit_input .and. self%new_folder) &
      call remove_empty_folder(folder_of(self%stem))
  end subroutine close_all
end module cpl_model
