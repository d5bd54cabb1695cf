!> A coupled run: read, open, launch, run, finish.
!!
!! Only this program obeys signals, wall limit and stop file. Whatever happens, `finish` ends both
!! solvers and removes the ports.
module cpl_model
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type, exit_stopped, exit_input, exit_numerical
  use talus_options, only: options_type
  use talus_deck_table, only: key_table_type
  use talus_files, only: make_folder, remove_empty_folder, remove_file, folder_exists, &
    folder_of, run_stem
  use talus_hash, only: hash_file, hash_text
  use talus_lock, only: lock_type
  use talus_health, only: health_type
  use talus_log, only: short_number
  use talus_message, only: verb_checkpoint
  use talus_port_names, only: field_hash, field_path, field_tag
  use talus_port_remains, only: remove_remains
  use talus_stop, only: stop_none
  use talus_summary, only: summary_type
  use talus_system, only: process_id, date_text
  use cpl_capabilities, only: warn_of_versions
  use cpl_choices, only: read_choices, read_solvers, method_name
  use cpl_deck_keys, only: cpl_deck_table
  use cpl_handshake, only: shake_hands
  use cpl_launch, only: launch_solver, stop_solvers, abort_solvers
  use cpl_logbook, only: begin_log, log_solvers, work_share
  use cpl_manifest, only: manifest_type, write_manifest, find_manifest, is_in_a_manifest
  use cpl_method, only: cpl_method_type
  use cpl_methods, only: choose_method
  use cpl_run, only: cpl_run_type
  implicit none
  private
  public :: cpl_model_type, program_name

  character(len=*), parameter :: program_name = 'talus-couple'

  type :: cpl_model_type
    type(options_type) :: options
    type(cpl_run_type) :: run
    class(cpl_method_type), allocatable :: method
    type(manifest_type) :: manifest        !! gone on from
    type(lock_type) :: lock
    character(len=:), allocatable :: run_id
    type(string_type), allocatable :: warnings(:)
    integer(i4) :: keep = 2
    logical :: begun_log = .false.         !! the log is on the screen
    logical :: opened = .false.            !! the log is a file
    logical :: new_folder = .false.        !! the folder of the results was made by this run
    logical :: running = .false.           !! exchanges have begun
    logical :: stopped = .false.           !! left early on request
    real(wp) :: begun = 0.0_wp             !! elapsed time when the exchanges began [s]
    real(wp) :: waited = 0.0_wp            !! waits until then [s]
    real(wp) :: stood = 0.0_wp             !! the grains had waited until then [s]
    integer(i8) :: first_step = 0          !! of this part of the run
    integer(i8) :: saved_step = -1         !! of the last checkpoint
  contains
    procedure :: read => read_run
    procedure :: open => open_run
    procedure :: prepare
    procedure :: execute
    procedure :: finish
    procedure, private :: sum_up
    procedure, private :: open_log
    procedure, private :: close_all
    procedure, private :: time_of
    procedure, private :: overhead
    procedure, private :: save_checkpoint
    procedure, private :: write_row
  end type cpl_model_type

contains

  !> Deck and all that can be checked from it alone.
  subroutine read_run(self, options, errors)
    class(cpl_model_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(key_table_type) :: table

    self%options = options
    allocate (self%warnings(0))
    call self%run%timers%init()
    call cpl_deck_table(table)
    call self%run%deck%read(options%deck, table, errors)
    if (errors%any()) return
    self%run%stem = run_stem(options%deck, options%output_dir)
    self%run_id = str(process_id())//'-'//hash_text(date_text()//self%run%stem// &
      str(secret()))
    call read_choices(self%run%deck, self%run%choices, errors)
    call read_solvers(self%run%deck, self%run%stem, self%run%solvers, errors)
    call choose_method(method_name(self%run%choices), self%method)
    call self%method%check(self%run, errors)
  end subroutine read_run

  !> A number that nobody can guess, for names that all users of a machine can see; 0 without
  !! /dev/urandom.
  integer(i8) function secret()
    integer :: unit, status
    secret = 0
    open (newunit=unit, file='/dev/urandom', access='stream', form='unformatted', action='read', &
          status='old', iostat=status)
    if (status /= 0) return
    read (unit, iostat=status) secret
    close (unit)
  end function secret

  !> Lock, signals, checkpoint to go on from; the log, which goes to its file when both solvers and
  !! the facet map are found good.
  subroutine open_run(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: path
    integer(i4) :: k

    call self%run%stop%read(self%run%deck, .false., errors)
    if (errors%any()) return
    self%new_folder = .not. folder_exists(folder_of(self%run%stem))
    call make_folder(folder_of(self%run%stem), errors)
    if (.not. errors%any()) call self%lock%take(self%run%stem, program_name, errors)
    if (errors%any()) return
    call self%run%deck%get('checkpoint', 1, 'keep', self%keep)
    call self%run%checkpoint%init(self%run%stem, program_name, self%run%deck%hash(), self%keep)
    if (len(self%options%restart) > 0) then
      call find_manifest(self%options%restart, self%run%stem, self%manifest, path, self%run%again, &
                         self%warnings, errors)
      if (errors%any()) return
      if (.not. self%run%again) call append_string(self%warnings, &
        'there is no manifest to go on from: a fresh run')
    end if
    call self%run%log%hold()
    self%begun_log = .true.
    call begin_log(self%run%log, program_name, self%run%deck)
    if (self%run%again) then
      call self%run%log%item('goes on from', path, 'time '//str(self%manifest%time)// &
        ' s, exchange '// str(self%manifest%step))
      if (self%manifest%deck_hash /= self%run%deck%hash()) call append_string(self%warnings, &
        'the deck is not the one that wrote '//path)
    end if
    do k = 1, size(self%warnings)
      call self%run%log%warn(self%warnings(k)%s)
    end do
  end subroutine open_run

  !> From here on the log is also a file.
  subroutine open_log(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%run%log%open(self%run%stem//'.log', errors, append=self%run%again)
    self%opened = .not. errors%any()
  end subroutine open_log

  !> Launch, HELLO, map, sets, READY.
  subroutine prepare(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    call remove_remains(folder_of(self%run%stem))
    do k = 1, 2
      self%run%solvers(k)%restart = ''
      if (self%run%again) self%run%solvers(k)%restart = self%manifest%path(k)%s
      self%run%solvers(k)%port%wall_end = self%run%stop%wall_end()
      call launch_solver(self%run%solvers(k), self%run%choices, self%run_id, &
                         folder_of(self%run%stem), self%run%log, errors)
      if (errors%any()) return
    end do
    call shake_hands(self%run%solvers, self%run%choices, self%run_id, self%manifest%time, &
                     self%run%timers, self%run%dynamic, errors)
    if (errors%any()) return
    call log_solvers(self%run%log, self%run%solvers)
    call warn_of_versions(self%run%log, self%run%solvers)
    self%run%begins = self%manifest%time
    if (self%run%again) self%run%state = self%manifest%path(3)%s
    call self%method%make(self%run, errors)
    if (self%run%again .and. .not. errors%any()) call self%method%restore(self%run, errors)
    if (.not. errors%any()) call self%method%begin(self%run, errors)
    if (.not. errors%any()) call self%open_log(errors)
    if (.not. errors%any()) call self%method%start(self%run, errors)
  end subroutine prepare

  !> Exchanges until the end, a fault or a request to stop.
  subroutine execute(self, errors)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t0, t1, every_wall, every_time

    call self%run%deck%get('checkpoint', 1, 'every_wall', every_wall)
    call self%run%deck%get('checkpoint', 1, 'every_time', every_time)
    call self%run%checkpoint%schedule(every_wall, every_time, self%time_of(self%method%step))
    self%first_step = self%method%step
    if (self%run%again) self%saved_step = self%method%step
    self%running = .true.
    self%begun = self%run%timers%elapsed()
    self%waited = (1.0_wp - work_share(self%run%timers, 0.0_wp, 0.0_wp))*self%begun
    self%stood = self%run%solvers(1)%stood
    call self%method%titles(self%run%log)
    do while (self%method%step < self%run%choices%exchanges)
      if (self%run%stop%check() /= stop_none) exit
      t0 = self%time_of(self%method%step)
      t1 = self%time_of(self%method%step + 1)
      call self%method%exchange(self%run, t0, t1, errors)
      if (.not. errors%any()) call self%method%after(self%run, t1, errors)
      if (errors%any()) return
      call self%run%timers%start('audit and log')
      if (self%run%log%row_due()) call self%write_row()
      call self%run%log%progress(t1/self%run%choices%t_end, short_number(t1)//' s')
      call self%run%timers%stop('audit and log')
      if (self%run%checkpoint%due(t1) .or. self%run%stop%checkpoint_asked()) &
        call self%save_checkpoint(errors)
      if (errors%any()) return
    end do
    if (self%method%step < self%run%choices%exchanges) then
      self%stopped = .true.
      call self%run%log%line('stopping early: '//self%run%stop%text())
      call self%save_checkpoint(errors)
    else if (self%run%deck%count('checkpoint') > 0) then
      call self%save_checkpoint(errors)
    end if
  end subroutine execute

  !> Time of an exchange [s]: a multiple of the interval, the same however often it is restarted.
  pure real(wp) function time_of(self, step)
    class(cpl_model_type), intent(in) :: self
    integer(i8), intent(in) :: step
    time_of = step*self%run%choices%exchange
    if (step == self%run%choices%exchanges) time_of = self%run%choices%t_end
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

    if (self%method%step == self%saved_step) return
    time = self%time_of(self%method%step)
    tag = free_tag(self)
    call self%method%audit%flush(errors)
    do k = 1, 2
      call self%run%solvers(k)%start_request(verb_checkpoint, self%method%step, time, time)
      call self%run%solvers(k)%request%put_text(field_tag, tag)
      call self%run%solvers(k)%send(self%run%timers, errors)
    end do
    do k = 1, 2
      if (errors%any()) return
      call self%run%solvers(k)%receive(self%run%timers, errors)
      if (errors%any()) return
      call self%run%solvers(k)%reply%get_text(field_path, manifest%path(k)%s, errors)
      call self%run%solvers(k)%reply%get_text(field_hash, hash, errors)
      manifest%hash(k) = hash
    end do
    call self%run%timers%start('checkpoint')
    call self%method%save(self%run, time, tag, errors)
    if (.not. errors%any()) then
      manifest%path(3)%s = self%run%checkpoint%tag_path(tag)
      call hash_file(manifest%path(3)%s, own, status)
      manifest%hash(3) = own
      manifest%time = time
      manifest%step = self%method%step
      manifest%deck_hash = self%run%deck%hash()
      call write_manifest(self%run%stem, manifest, self%keep, errors)
      self%saved_step = self%method%step
    end if
    call self%run%timers%stop('checkpoint')
  end subroutine save_checkpoint

  !> 'x' and the step; with a number behind it where a manifest of an earlier run, or of one that
  !! went further, names the file that this would overwrite.
  function free_tag(self) result(tag)
    class(cpl_model_type), intent(in) :: self
    character(len=:), allocatable :: tag
    integer(i4) :: k

    tag = 'x'//str(self%method%step)
    k = 1
    do while (is_in_a_manifest(self%run%stem, self%run%checkpoint%tag_path(tag)))
      k = k + 1
      tag = 'x'//str(self%method%step)//'-'//str(k)
    end do
  end function free_tag

  subroutine write_row(self)
    class(cpl_model_type), intent(inout) :: self
    type(error_list_type) :: ignored
    real(wp) :: left, overhead(2)
    integer(i8) :: done
    overhead = self%overhead()
    done = max(self%method%step - self%first_step, 1_i8)
    left = (self%run%timers%elapsed() - self%begun)/done*(self%run%choices%exchanges &
      - self%method%step)
    call self%method%row(self%run%log, self%time_of(self%method%step), overhead(1), left)
    call self%method%audit%flush(ignored)
  end subroutine write_row

  !> Shares of the time of the exchanges that the grains waited for the coupling, and that it
  !! worked: less or more, as much of the work is done while they work.
  function overhead(self)
    class(cpl_model_type), intent(inout) :: self
    real(wp) :: overhead(2)
    overhead = work_share(self%run%timers, self%begun, self%waited)
    if (self%run%solvers(1)%stood > self%stood) overhead(1) = (self%run%solvers(1)%stood &
      - self%stood) /max(self%run%timers%elapsed() - self%begun, tiny(1.0_wp))
  end function overhead

  !> End both solvers, log, summary; exit_code is that of the run.
  subroutine finish(self, exit_code, errors)
    class(cpl_model_type), intent(inout) :: self
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: ignored
    type(health_type) :: health
    real(wp) :: time, overhead(2)

    time = self%time_of(self%method%step)
    overhead = 0.0_wp
    if (self%running) overhead = self%overhead()
    if (.not. errors%any()) &
      call stop_solvers(self%run%solvers, self%stopped, self%method%step, time, self%run%timers, &
      errors)
    call abort_solvers(self%run%solvers, self%method%step, time)
    call self%method%audit%close(errors)
    if (self%running) call self%method%judge(self%run%deck, health)
    if (.not. (self%stopped .or. errors%any())) &
      call health%complain(self%run%deck%source%path, errors)
    exit_code = errors%exit_code()
    if (exit_code == exit_input .and. self%method%step > self%first_step) exit_code = exit_numerical
    if (exit_code == 0 .and. self%stopped) exit_code = exit_stopped
    if (self%begun_log .and. exit_code /= exit_input .and. .not. self%opened) &
      call self%open_log(ignored)
    if (.not. self%opened) then
      call self%close_all(exit_code)
      return
    end if
    call errors%locate(self%run%deck%source%path)
    call self%run%log%faults(errors)
    if (self%running) then
      if (self%method%step > self%first_step) call self%write_row()
      call self%sum_up(time, overhead, health, exit_code, errors)
    end if
    call self%run%log%finish(program_name, exit_code, 'time '//short_number(time)//' s, '// &
                         str(self%method%step)//' exchanges')
    call self%close_all(exit_code)
  end subroutine finish

  !> Health line, timers, summary.json.
  subroutine sum_up(self, time, overhead, health, exit_code, errors)
    class(cpl_model_type), intent(inout) :: self
    real(wp), intent(in) :: time, overhead(2)  !! [s], shares of the run time
    type(health_type), intent(in) :: health
    integer(i4), intent(in) :: exit_code
    type(error_list_type), intent(in) :: errors
    type(error_list_type) :: ignored
    type(summary_type) :: page

    call self%method%health(self%run, overhead)
    call health%warn(self%run%log)
    call self%run%log%timer_table(self%run%timers)
    call page%set_program(program_name, self%run%deck%source%path, self%run%deck%hash())
    call page%set('exit_code', exit_code)
    call page%set('wall_time_s', self%run%timers%elapsed())
    call page%set('steps', self%method%step)
    call page%set('time_s', time)
    call page%set('coupling_overhead', overhead(1))
    call page%set('coupling_work', overhead(2))
    call health%summarise(page)
    call self%method%summary(page)
    call page%set_timers(self%run%timers)
    call page%set_errors(errors)
    call page%write(self%run%stem//'_summary.json', ignored)
  end subroutine sum_up

  !> Log and lock; a run that was refused leaves nothing.
  subroutine close_all(self, exit_code)
    class(cpl_model_type), intent(inout) :: self
    integer(i4), intent(in) :: exit_code
    integer(i4) :: k
    if (self%opened) call self%run%log%close()
    if (exit_code == exit_input .and. .not. self%opened .and. self%begun_log) then
      do k = 1, 2
        call remove_file(self%run%solvers(k)%output)
      end do
    end if
    call self%lock%release()
    if (exit_code == exit_input .and. self%new_folder) &
      call remove_empty_folder(folder_of(self%run%stem))
  end subroutine close_all
end module cpl_model
