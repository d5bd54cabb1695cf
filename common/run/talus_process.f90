!> Child processes: start in a group of their own, wait with a limit, end, report how they ended.
!!
!! A child gets no variables of a parent MPI launcher, a passive OpenMP wait policy, its thread
!! counts, and is killed by the kernel when this program dies, however it dies; unless it looks
!! after that itself (death_signal = 0): TALUS_PARENT in its environment is our process then.
module talus_process
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use talus_kinds, only: wp, i4
  use talus_command, only: command_words
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_system, only: process_id
  use talus_c_text, only: text_of
  implicit none
  private
  public :: process_type, sibling_program, tail_of, signal_kill, signal_term, signal_stop, &
    signal_continue, signal_none

  integer(i4), parameter :: signal_kill = 9, signal_term = 15, signal_stop = 19
  integer(i4), parameter :: signal_continue = 18
  integer(i4), parameter :: signal_none = 0
  integer, parameter :: room = 4096

  !> One child. After `spawn`: pid > 0 while it is ours to wait for.
  type :: process_type
    integer(i4) :: pid = 0
    integer(i4) :: exit_code = -1       !! after its end; -1 when a signal killed it
    integer(i4) :: signal = 0           !! signal that killed it, 0 when none
    logical :: ended = .false.          !! it has ended and was waited for
    integer(c_int), private :: fd = -1
  contains
    procedure :: spawn => process_spawn
    procedure :: spawn_command => process_spawn_command
    procedure :: wait => process_wait
    procedure :: running => process_running
    procedure :: kill_group => process_kill_group
    procedure :: stop => process_stop
    procedure :: epitaph => process_epitaph
  end type process_type

  interface
    function c_spawn(arguments, count, edits, edit_count, folder, log, death_signal, code) &
      result(pid) bind(c, name='talus_process_spawn')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: arguments(*), edits(*), folder(*), log(*)
      integer(c_int), value :: count, edit_count, death_signal
      integer(c_int), intent(out) :: code
      integer(c_int) :: pid
    end function c_spawn
    function c_open(pid) result(fd) bind(c, name='talus_process_open')
      import :: c_int
      integer(c_int), value :: pid
      integer(c_int) :: fd
    end function c_open
    function c_wait(pid, fd, milliseconds, exit_code, signal_number) result(state) &
      bind(c, name='talus_process_wait')
      import :: c_int
      integer(c_int), value :: pid, fd, milliseconds
      integer(c_int), intent(inout) :: exit_code, signal_number
      integer(c_int) :: state
    end function c_wait
    function c_kill_group(pid, signal_number) result(code) bind(c, name='talus_process_kill_group')
      import :: c_int
      integer(c_int), value :: pid, signal_number
      integer(c_int) :: code
    end function c_kill_group
    subroutine c_close(fd) bind(c, name='talus_process_close')
      import :: c_int
      integer(c_int), value :: fd
    end subroutine c_close
    subroutine c_sibling(name, path, room) bind(c, name='talus_process_sibling')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*)
      character(kind=c_char), intent(inout) :: path(*)
      integer(c_int), value :: room
    end subroutine c_sibling
    subroutine c_core_type(text, room) bind(c, name='talus_process_core_type')
      import :: c_char, c_int
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int), value :: room
    end subroutine c_core_type
  end interface

contains

  !> Start a program. argv(1) is a path, or a name found in PATH.
  subroutine process_spawn(self, argv, folder, log_file, threads, errors, death_signal)
    class(process_type), intent(inout) :: self
    type(string_type), intent(in) :: argv(:)
    character(len=*), intent(in) :: folder    !! working folder; '' = ours
    character(len=*), intent(in) :: log_file  !! of stdout, stderr, in folder; '' = ours
    integer(i4), intent(in) :: threads        !! of OpenMP and BLAS; 0 = as it is
    type(error_list_type), intent(inout) :: errors
    integer(i4), intent(in), optional :: death_signal  !! sent when we die; kill by default
    type(string_type), allocatable :: edits(:)
    integer(c_int) :: code, on_death

    on_death = signal_kill
    if (present(death_signal)) on_death = death_signal
    call environment_edits(threads, edits)
    if (on_death == signal_none) &
      call append_string(edits, 'TALUS_PARENT='//str(process_id()))
    self%ended = .false.
    self%exit_code = -1
    self%signal = 0
    self%pid = c_spawn(flat(argv), size(argv), flat(edits), size(edits), folder//c_null_char, &
                       log_file//c_null_char, on_death, code)
    if (self%pid == 0) then
      call errors%add('P020', 'the program '''//argv(1)%s//''' cannot be started (system error '// &
                      str(code)//reason(code)//')', log_file, &
                      'its path and rights, or those of its log')
      return
    end if
    self%fd = c_open(self%pid)
  end subroutine process_spawn

  !> Start a command line (talus_command), with more arguments behind it: 'mpirun -np 8 talus-dem'.
  !! The launcher gets SIGTERM when we die, so that it can take its ranks along.
  subroutine process_spawn_command(self, command, folder, log_file, threads, errors, arguments)
    class(process_type), intent(inout) :: self
    character(len=*), intent(in) :: command, folder, log_file
    integer(i4), intent(in) :: threads
    type(error_list_type), intent(inout) :: errors
    type(string_type), intent(in), optional :: arguments(:)
    type(string_type), allocatable :: argv(:)
    logical :: closed
    integer :: k

    call command_words(command, argv, closed)
    if (present(arguments)) then
      do k = 1, size(arguments)
        call append_string(argv, arguments(k)%s)
      end do
    end if
    call self%spawn(argv, folder, log_file, threads, errors, signal_term)
  end subroutine process_spawn_command

  subroutine environment_edits(threads, edits)
    integer(i4), intent(in) :: threads
    type(string_type), allocatable, intent(out) :: edits(:)
    character(len=:), allocatable :: core
    character(kind=c_char) :: buffer(16)

    call append_string(edits, 'OMP_WAIT_POLICY=passive')
    if (threads > 0) then
      call append_string(edits, 'OMP_NUM_THREADS='//str(threads))
      call append_string(edits, 'OPENBLAS_NUM_THREADS='//str(threads))
    end if
    call c_core_type(buffer, size(buffer))
    core = text_of(buffer)
    if (len(core) > 0) call append_string(edits, 'OPENBLAS_CORETYPE='//core)
  end subroutine environment_edits

  !> The strings one behind the other, each ended by a zero byte.
  pure function flat(list) result(text)
    type(string_type), intent(in) :: list(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(list)
      text = text//list(k)%s//c_null_char
    end do
    text = text//c_null_char
  end function flat

  pure function reason(code) result(text)
    integer(c_int), intent(in) :: code
    character(len=:), allocatable :: text
    select case (code)
    case (2)
      text = ', no such file'
    case (8)
      text = ', no program'
    case (13)
      text = ', not allowed'
    case default
      text = ''
    end select
  end function reason

  !> Wait at most so long for its end; limit < 0 waits for ever. True when it has ended.
  logical function process_wait(self, limit)
    class(process_type), intent(inout) :: self
    real(wp), intent(in) :: limit  !! s
    integer(c_int) :: milliseconds, state, code, signal_number

    process_wait = .true.
    if (self%ended .or. self%pid == 0) return
    milliseconds = -1
    if (limit >= 0.0_wp) milliseconds = nint(1000.0_wp*min(limit, 1.0e6_wp))
    code = -1
    signal_number = 0
    do
      state = c_wait(self%pid, self%fd, milliseconds, code, signal_number)
      if (state /= 0 .or. milliseconds >= 0) exit
    end do
    process_wait = state /= 0
    if (state == 0) return
    self%exit_code = code
    self%signal = signal_number
    self%ended = .true.
    call c_close(self%fd)
    self%fd = -1
  end function process_wait

  logical function process_running(self)
    class(process_type), intent(inout) :: self
    process_running = .false.
    if (self%pid > 0) process_running = .not. self%wait(0.0_wp)
  end function process_running

  !> Send a signal to the child and all it started in its group.
  subroutine process_kill_group(self, signal)
    class(process_type), intent(in) :: self
    integer(i4), intent(in) :: signal
    integer(c_int) :: code
    ! an empty group cannot be signalled: that is what we want it to be
    if (self%pid > 0) code = c_kill_group(self%pid, signal)
  end subroutine process_kill_group

  !> End it: wait `grace`, then SIGTERM, wait `grace`, then SIGKILL to the whole group.
  subroutine process_stop(self, grace)
    class(process_type), intent(inout) :: self
    real(wp), intent(in) :: grace  !! s
    if (self%pid == 0) return
    if (.not. self%wait(grace)) then
      call self%kill_group(signal_term)
      call self%kill_group(signal_continue)
      if (.not. self%wait(grace)) then
        call self%kill_group(signal_kill)
        if (.not. self%wait(-1.0_wp)) error stop 'bug: a killed child does not end'
      end if
    end if
    call self%kill_group(signal_kill)
    self%pid = 0
  end subroutine process_stop

  !> How it ended: 'exit code 2', 'killed by signal 9 (SIGKILL)', 'still running'.
  function process_epitaph(self) result(text)
    class(process_type), intent(in) :: self
    character(len=:), allocatable :: text
    character(len=4), parameter :: names(15) = [character(len=4) :: 'HUP', 'INT', 'QUIT', 'ILL', &
      'TRAP', 'ABRT', 'BUS', 'FPE', 'KILL', 'USR1', 'SEGV', 'USR2', 'PIPE', 'ALRM', 'TERM']

    if (.not. self%ended) then
      text = 'still running'
    else if (self%signal == 0) then
      text = 'exit code '//str(self%exit_code)
    else
      text = 'killed by signal '//str(self%signal)
      if (self%signal <= size(names)) text = text//' (SIG'//trim(names(self%signal))//')'
    end if
  end function process_epitaph

  !> Path of a program beside this one, or its bare name for PATH to find.
  function sibling_program(name) result(path)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    character(kind=c_char) :: buffer(room)
    call c_sibling(name//c_null_char, buffer, int(room, c_int))
    path = text_of(buffer)
  end function sibling_program

  !> The last lines of a log file, each with '  | ' before it; '' when there is no file.
  function tail_of(path, lines) result(text)
    character(len=*), intent(in) :: path
    integer(i4), intent(in) :: lines
    character(len=:), allocatable :: text
    type(string_type), allocatable :: ring(:)
    character(len=512) :: line
    integer :: unit, stat, n, k

    text = ''
    open (newunit=unit, file=path, status='old', action='read', iostat=stat)
    if (stat /= 0) return
    allocate (ring(0:lines - 1))
    n = 0
    do
      read (unit, '(a)', iostat=stat) line
      if (stat /= 0) exit
      ring(mod(n, lines))%s = trim(line)
      n = n + 1
    end do
    close (unit)
    do k = max(0, n - lines), n - 1
      text = text//'  | '//ring(mod(k, lines))%s//new_line('a')
    end do
  end function tail_of
end module talus_process
