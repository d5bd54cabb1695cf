!> Watch over the process on the other side of a port: has it ended, does it still work?
!!
!! Ended: the process descriptor (pidfd) fires; a zombie counts as ended. At work: its heartbeat
!! word moved, or, on the same machine, it used CPU time since the last check. A long call into a
!! library (a factorisation) uses CPU time and is no hang; a stopped process (SIGSTOP), or one that
!! sleeps for ever, does neither. Time in which this process itself was stopped does not count.
module talus_partner
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_double, c_null_char
  use talus_kinds, only: wp, i4, i8
  use talus_c_text, only: text_of
  use talus_text, only: str
  use talus_errors, only: error_list_type
  implicit none
  private
  public :: partner_type, own_pid, own_place, own_host, own_start, now, nap
  public :: report_stranger, other_run_hint

  real(wp), parameter :: check_interval = 0.2_wp  !! s between two checks of the CPU time
  real(wp), parameter :: longest_gap = 1.0_wp !! s; a longer gap: we were stopped ourselves

  character(len=*), parameter :: other_run_hint = &
    'a solver of another run, or a foreign program: start both sides again'

  !> One watched process.
  type :: partner_type
    character(len=:), allocatable :: name  !! how messages call it: 'talus-dem (grains.nml)'
    character(len=:), allocatable :: log   !! its log file, named in messages; may be empty
    real(wp) :: time_limit = 0.0_wp        !! s of silence taken as a hang; 0 = never
    integer(i4) :: pid = 0                 !! process at the port; 0 before it joined
    logical :: same_place = .false.        !! its number means something here
    integer(i4), private :: launcher = 0   !! process that this program started
    integer(c_int), private :: pid_fd = -1, launcher_fd = -1
    integer(i8), private :: beat = -1, ticks = -1
    real(wp), private :: silence = 0.0_wp  !! s without a sign of life
    real(wp), private :: looked = -1.0_wp  !! time of the last check
    real(wp), private :: heard = -1.0_wp   !! time of the last check
    character(len=1) :: state = '?'        !! state letter of /proc/<pid>/stat
  contains
    procedure :: started => partner_started
    procedure :: joined => partner_joined
    procedure :: ended => partner_ended
    procedure :: silent => partner_silent
    procedure :: fresh => partner_fresh
    procedure :: report_end => partner_report_end
    procedure :: report_absence => partner_report_absence
    procedure :: report_loss => partner_report_loss
    procedure :: report_no_stop => partner_report_no_stop
    procedure :: report_silence => partner_report_silence
    procedure :: title => partner_title
    procedure :: close => partner_close
  end type partner_type

  interface
    function c_now() result(t) bind(c, name='talus_partner_now')
      import :: c_double
      real(c_double) :: t
    end function c_now
    subroutine c_nap(seconds) bind(c, name='talus_partner_nap')
      import :: c_double
      real(c_double), value :: seconds
    end subroutine c_nap
    function c_own_pid() result(pid) bind(c, name='talus_partner_own_pid')
      import :: c_int
      integer(c_int) :: pid
    end function c_own_pid
    function c_started(pid) result(ticks) bind(c, name='talus_partner_started')
      import :: c_int, c_int64_t
      integer(c_int), value :: pid
      integer(c_int64_t) :: ticks
    end function c_started
    subroutine c_place(text, room) bind(c, name='talus_partner_place')
      import :: c_char, c_int
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int), value :: room
    end subroutine c_place
    subroutine c_host(text, room) bind(c, name='talus_partner_host')
      import :: c_char, c_int
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int), value :: room
    end subroutine c_host
    function c_open(pid) result(fd) bind(c, name='talus_partner_open')
      import :: c_int
      integer(c_int), value :: pid
      integer(c_int) :: fd
    end function c_open
    function c_ended(fd) result(ended) bind(c, name='talus_partner_ended')
      import :: c_int
      integer(c_int), value :: fd
      integer(c_int) :: ended
    end function c_ended
    subroutine c_close(fd) bind(c, name='talus_partner_close')
      import :: c_int
      integer(c_int), value :: fd
    end subroutine c_close
    function c_ticks(pid, state) result(ticks) bind(c, name='talus_partner_ticks')
      import :: c_char, c_int, c_int64_t
      integer(c_int), value :: pid
      character(kind=c_char), intent(out) :: state
      integer(c_int64_t) :: ticks
    end function c_ticks
  end interface

contains

  !> A process that this program launched (the solver itself, or mpirun): its end is the end.
  subroutine partner_started(self, pid)
    class(partner_type), intent(inout) :: self
    integer(i4), intent(in) :: pid
    self%launcher = pid
    self%launcher_fd = c_open(pid)
    if (self%launcher_fd < -1) self%launcher_fd = -1
    call self%fresh()
  end subroutine partner_started

  !> The process that joined the port; `place` shows whether it runs under the same kernel.
  subroutine partner_joined(self, pid, place)
    class(partner_type), intent(inout) :: self
    integer(i4), intent(in) :: pid
    character(len=*), intent(in) :: place
    self%pid = pid
    self%same_place = place == own_place()
    self%ticks = -1
    if (self%same_place) self%pid_fd = c_open(pid)
    if (self%pid_fd < -1) self%pid_fd = -1
    call self%fresh()
  end subroutine partner_joined

  logical function partner_ended(self)
    class(partner_type), intent(in) :: self
    partner_ended = .false.
    if (self%pid_fd >= 0) partner_ended = c_ended(self%pid_fd) /= 0
    if (self%launcher_fd >= 0 .and. .not. partner_ended) &
      partner_ended = c_ended(self%launcher_fd) /= 0
  end function partner_ended

  !> Restart the count of silence (a wait begins).
  subroutine partner_fresh(self)
    class(partner_type), intent(inout) :: self
    self%silence = 0.0_wp
    self%heard = -1.0_wp
    self%looked = -1.0_wp
  end subroutine partner_fresh

  !> Whether there was no sign of the partner for the time limit. Call it often while waiting.
  logical function partner_silent(self, beat)
    class(partner_type), intent(inout) :: self
    integer(i8), intent(in) :: beat  !! heartbeat word as it is now
    real(wp) :: t
    integer(i8) :: ticks
    integer(i4) :: pid

    t = now()
    if (self%heard >= 0.0_wp) self%silence = self%silence + min(t - self%heard, longest_gap)
    self%heard = t
    if (beat /= self%beat) then
      self%beat = beat
      self%silence = 0.0_wp
    end if
    if (t - self%looked >= check_interval) then
      self%looked = t
      pid = merge(self%pid, 0, self%same_place)
      if (self%pid == 0) pid = self%launcher
      if (pid > 0) then
        ticks = c_ticks(pid, self%state)
        if (ticks >= 0 .and. ticks /= self%ticks) self%silence = 0.0_wp
        self%ticks = ticks
      end if
    end if
    partner_silent = self%time_limit > 0.0_wp .and. self%silence > self%time_limit
  end function partner_silent

  !> 'talus-dem (grains.nml, process 4711)'.
  function partner_title(self) result(text)
    class(partner_type), intent(in) :: self
    character(len=:), allocatable :: text
    integer(i4) :: pid
    text = 'the partner'
    if (allocated(self%name)) text = self%name
    pid = self%pid
    if (pid == 0) pid = self%launcher
    if (pid > 0) text = text//' (process '//str(pid)//')'
  end function partner_title

  !> Fault: the process ended in the middle of the run.
  subroutine partner_report_end(self, errors)
    class(partner_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    call errors%add('P001', self%title()//' ended before it answered', log_place(self), &
                    'see the end of its log; the last checkpoint is valid')
  end subroutine partner_report_end

  !> Fault: it waits for a message, as we do: one that was sent has not arrived.
  subroutine partner_report_loss(self, message, errors)
    class(partner_type), intent(in) :: self
    character(len=*), intent(in) :: message  !! the one that is due
    type(error_list_type), intent(inout) :: errors
    call errors%add('P024', self%title()//' waits, and so do we: a message was lost ('// &
                    message//' is due)', log_place(self), 'was a file of the port''s '// &
                    'folder removed? The last checkpoint is valid')
  end subroutine partner_report_loss

  !> Fault: a stop was requested, and the answer under way does not come.
  subroutine partner_report_no_stop(self, request, limit, errors)
    class(partner_type), intent(in) :: self
    character(len=*), intent(in) :: request
    real(wp), intent(in) :: limit  !! s
    type(error_list_type), intent(inout) :: errors
    call errors%add('P026', self%title()//' has not answered '//request//' within '// &
                    str(limit)//' s after the request to stop', log_place(self), &
                    'time_limit in &port sets how long an answer under way is waited for')
  end subroutine partner_report_no_stop

  !> Fault: it did not join the port in time.
  subroutine partner_report_absence(self, errors)
    class(partner_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    call errors%add('P003', self%title()//' did not join the port within '// &
                    str(self%time_limit)//' s', log_place(self), &
                    'see its log; for another host use transport = ''hdf5''')
  end subroutine partner_report_absence

  !> Fault: no sign of life for the time limit.
  subroutine partner_report_silence(self, errors)
    class(partner_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what

    what = ' hangs: no heartbeat and no CPU time for '//str(self%time_limit)//' s'
    if (self%state == 'T' .or. self%state == 't') what = what//' (it is stopped by a signal)'
    call errors%add('P002', self%title()//what, log_place(self), &
                    'see its log; time_limit in &port sets how long silence may last')
  end subroutine partner_report_silence

  function log_place(self) result(text)
    class(partner_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (allocated(self%log)) text = self%log
  end function log_place

  subroutine partner_close(self)
    class(partner_type), intent(inout) :: self
    call c_close(self%pid_fd)
    call c_close(self%launcher_fd)
    self%pid_fd = -1
    self%launcher_fd = -1
    self%pid = 0
    self%launcher = 0
  end subroutine partner_close

  !> Monotonic clock, s.
  real(wp) function now()
    now = c_now()
  end function now

  subroutine nap(seconds)
    real(wp), intent(in) :: seconds
    call c_nap(seconds)
  end subroutine nap

  integer(i4) function own_pid()
    own_pid = c_own_pid()
  end function own_pid

  !> When this process started, in clock ticks since the start of the machine.
  integer(i8) function own_start()
    own_start = c_started(c_own_pid())
  end function own_start

  !> Boot id and process namespace of this machine.
  function own_place() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(96)
    call c_place(buffer, size(buffer))
    text = text_of(buffer)
  end function own_place

  function own_host() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(96)
    call c_host(buffer, size(buffer))
    text = text_of(buffer)
  end function own_host

  !> P027: who has joined does not know whose run this is.
  subroutine report_stranger(partner, errors)
    character(len=*), intent(in) :: partner  !! its title
    type(error_list_type), intent(inout) :: errors
    call errors%add('P027', partner//': who has joined this port does not know the run id', '', &
                    other_run_hint)
  end subroutine report_stranger
end module talus_partner
