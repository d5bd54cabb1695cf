!> Exchange port: talus-couple sends requests, a solver replies (manual/port.md).
!!
!! Ask side: `create`, launch the solver with `--port=SPEC`, `watch` its process, then `send` and
!! `receive` (or `ask`); several ports may be sent to before any is read. Serve side: `connect`,
!! then `receive` and `send` in turn; `beat` in long work. A partner that ends, hangs or disagrees
!! gives one P fault that names it.
module talus_port
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, starts_with
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_name
  use talus_partner, only: partner_type, now, nap
  use talus_port_shm, only: shm_port_type
  use talus_port_file, only: file_port_type
  use talus_port_remains, only: watch_asker, is_orphan
  use talus_system, only: signal_seen
  use talus_rendezvous, only: write_rendezvous, read_rendezvous, remove_rendezvous
  implicit none
  private
  public :: port_type

  integer(i4), parameter :: transport_none = 0, transport_shm = 1, transport_file = 2
  real(wp), parameter :: slice = 0.05_wp             !! s between two checks of the partner
  real(wp), parameter :: connect_limit = 30.0_wp     !! s that a solver waits for its port
  real(wp), parameter :: attach_limit = 600.0_wp     !! s that it waits for a rendezvous file
  real(wp), parameter :: far_ask_limit = 600.0_wp    !! s of silence of talus-couple on another host
  real(wp), parameter :: stop_limit = 60.0_wp        !! s for an answer after a request to stop
  real(wp), parameter :: join_stop_limit = 5.0_wp    !! the same where nobody has joined yet
  !> Signs of a partner that waits as we do, after which a message is lost: sleeps of a slice in
  !! shared memory; beats in files, of which those of another host may be seen late.
  integer(i8), parameter :: sleeps_of_loss = 20, beats_of_loss = 8, far_beats_of_loss = 240

  !> One end of a port. Set `partner%name` and `partner%log` for good messages, `trace` and
  !! `join_limit` before `create`.
  type :: port_type
    type(partner_type) :: partner
    logical :: trace = .false.            !! keep the message files (hdf5 transport)
    real(wp) :: join_limit = 0.0_wp       !! s until the partner must have joined; 0 = time limit
    real(wp) :: wall_end = 0.0_wp         !! wall clock at which the run is to stop, s; 0 none
    character(len=:), allocatable :: spec
    character(len=:), allocatable :: run_id
    integer(i4), private :: transport = transport_none
    logical, private :: asks = .false.
    integer(i8), private :: sequence = 0  !! of the last request
    integer(i4), private :: verb = 0      !! of the last request
    integer(i8), private :: first_sign = -1       !! of a partner that waits as we do
    real(wp), private :: stopping = -1.0_wp       !! since when a stop is requested in this wait, s
    character(len=:), allocatable, private :: rendezvous  !! file that is there while both are
    type(shm_port_type), private :: shm
    type(file_port_type), private :: file
  contains
    procedure :: create
    procedure :: connect
    procedure :: publish
    procedure :: watch
    procedure :: send
    procedure :: receive
    procedure :: ask
    procedure :: beat
    procedure :: arrived
    procedure :: is_open
    procedure :: close => port_close
  end type port_type

contains

  !> Open the asking side: 'shm:/talus-NAME' or 'hdf5:FOLDER/SIDE'.
  subroutine create(self, spec, run_id, time_limit, errors)
    class(port_type), intent(inout) :: self
    character(len=*), intent(in) :: spec, run_id
    real(wp), intent(in) :: time_limit  !! s of silence that count as a hang; 0 = never
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: transport, faults

    faults = errors%count
    call read_spec(spec, transport, errors)
    if (errors%count > faults) return
    self%asks = .true.
    self%sequence = 0
    self%spec = spec
    self%run_id = run_id
    self%partner%time_limit = time_limit
    if (transport == transport_shm) then
      call self%shm%create(spec(5:), run_id, errors)
    else
      call self%file%create(spec(6:), run_id, self%trace, errors)
    end if
    if (errors%count == faults) self%transport = transport
  end subroutine create

  !> Write to a file where the port is, for a solver that the user starts with --port=attach:FILE.
  subroutine publish(self, path, errors)
    class(port_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    call write_rendezvous(path, self%spec, self%run_id, errors)
    self%rendezvous = path
  end subroutine publish

  !> Open the answering side; waits a while for talus-couple to make the port. `spec` is that of the
  !! other side, or 'attach:FILE' with the file that it publishes.
  subroutine connect(self, spec, errors)
    class(port_type), intent(inout) :: self
    character(len=*), intent(in) :: spec
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: transport, faults
    logical :: absent
    real(wp) :: started

    faults = errors%count
    self%spec = spec
    self%run_id = ''
    if (starts_with(spec, 'attach:')) then
      self%rendezvous = spec(8:)
      call read_rendezvous(self%rendezvous, attach_limit, self%spec, self%run_id, errors)
    end if
    if (errors%count == faults) call read_spec(self%spec, transport, errors)
    if (errors%count > faults) return
    self%asks = .false.
    self%sequence = 0
    started = now()
    do
      if (transport == transport_shm) then
        call self%shm%connect(self%spec(5:), self%run_id, absent, errors)
      else
        call self%file%connect(self%spec(6:), self%run_id, absent, errors)
      end if
      if (errors%count > faults) return
      if (.not. absent) exit
      if (now() - started > connect_limit) then
        call report_absent(self%spec, transport, errors)
        return
      end if
      if (is_orphan()) then
        call errors%add('P001', 'talus-couple has ended before this program joined its port', &
                        self%spec, 'the reason is in the log of the coupled run')
        return
      end if
      call nap(0.01_wp)
    end do
    self%transport = transport
    if (.not. allocated(self%partner%name)) self%partner%name = 'talus-couple'
    call meet(self)
    if (.not. self%partner%same_place) then
      self%partner%time_limit = far_ask_limit
    else if (transport == transport_shm) then
      call watch_asker(self%partner%pid, self%spec(5:), '', .false.)
    else
      call self%file%watch()
    end if
  end subroutine connect

  subroutine read_spec(spec, transport, errors)
    character(len=*), intent(in) :: spec
    integer(i4), intent(out) :: transport
    type(error_list_type), intent(inout) :: errors
    integer :: slash

    transport = transport_none
    if (starts_with(spec, 'shm:/')) then
      if (len(spec) > 5 .and. len(spec) < 200 .and. index(spec(6:), '/') == 0) &
        transport = transport_shm
    else if (starts_with(spec, 'hdf5:')) then
      slash = index(spec, '/', back=.true.)
      if (slash > 6 .and. slash < len(spec)) transport = transport_file
    end if
    if (transport == transport_none) &
      call errors%add('P004', 'the port '''//spec//''' is neither ''shm:/NAME'', '// &
                      '''hdf5:FOLDER/SIDE'' nor ''attach:FILE''', '', &
                      'talus-couple hands it on as --port=SPEC')
  end subroutine read_spec

  subroutine report_absent(spec, transport, errors)
    character(len=*), intent(in) :: spec
    integer(i4), intent(in) :: transport
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: hint
    hint = 'is talus-couple running? For another host use transport = ''hdf5'''
    if (transport == transport_file) hint = 'is talus-couple running, and is the folder shared?'
    call errors%add('P003', 'nobody has opened the port '''//spec//''' on this host within '// &
                    str(connect_limit)//' s', '', hint)
  end subroutine report_absent

  !> The process that was launched to serve this port: its end ends every wait.
  subroutine watch(self, pid)
    class(port_type), intent(inout) :: self
    integer(i4), intent(in) :: pid
    call self%partner%started(pid)
  end subroutine watch

  !> Send a request (ask side) or the reply to the last request (serve side).
  subroutine send(self, message, errors)
    class(port_type), intent(inout) :: self
    type(message_type), intent(inout) :: message
    type(error_list_type), intent(inout) :: errors
    logical :: finished
    integer(i4) :: faults

    if (self%transport == transport_none) error stop 'bug: the port is not open'
    faults = errors%count
    if (self%asks) then
      self%sequence = self%sequence + 1
      self%verb = message%verb
    end if
    call message%seal(self%sequence)
    call begin_wait(self)
    do
      if (self%transport == transport_shm) then
        call self%shm%push(message, slice, finished)
      else
        call self%file%push(message, errors)
        finished = .true.
      end if
      if (finished .or. errors%count > faults) return
      call look(self, .false., errors)
      if (errors%count > faults) return
    end do
  end subroutine send

  !> Wait for the reply (ask side) or the next request (serve side), and check it.
  subroutine receive(self, message, errors)
    class(port_type), intent(inout) :: self
    type(message_type), intent(inout) :: message
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: words
    integer(i4) :: faults

    if (self%transport == transport_none) error stop 'bug: the port is not open'
    faults = errors%count
    call begin_wait(self)
    do
      if (self%transport == transport_shm) then
        call self%shm%pull(message, slice, words)
        if (words < 0) call self%shm%inspect(self%partner%title(), errors)
      else
        call self%file%pull(message, slice, words, errors)
      end if
      if (errors%count > faults) return
      if (words /= 0) exit
      call look(self, .true., errors)
      if (errors%count > faults) return
    end do
    if (self%partner%pid == 0) then
      call meet(self)
      call look_for_damage(self, errors)
      if (errors%count > faults) return
    end if
    call check(self, message, words, errors)
  end subroutine receive

  !> The message must be whole, and the one that is due.
  subroutine check(self, message, words, errors)
    class(port_type), intent(inout) :: self
    type(message_type), intent(inout) :: message
    integer(i8), intent(in) :: words
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: faults

    faults = errors%count
    call message%parse(words, errors)
    if (errors%count == faults) then
      if (.not. self%asks) self%sequence = self%sequence + 1
      if (message%sequence /= self%sequence) then
        call errors%add('P007', 'message '//str(message%sequence)//' arrived, message '// &
                        str(self%sequence)//' is due', message%place(), &
                        'the partner has lost or repeated a message')
      else if (self%asks .and. message%verb /= self%verb) then
        call errors%add('P008', 'the reply is to '//verb_name(message%verb)//', '// &
                        verb_name(self%verb)//' was asked', message%place(), &
                        'the partner does not implement this port')
      else if (message%verb < 1) then
        call errors%add('P017', 'the request has a verb that is not known here', &
                        message%place(), 'use programs with the same version of the port')
      end if
      self%verb = message%verb
    end if
    if (errors%count > faults) &
      errors%item(faults + 1)%message = self%partner%title()//': '//errors%item(faults + 1)%message
  end subroutine check

  !> Send, receive, and add the fault that the reply reports.
  subroutine ask(self, request, reply, errors)
    class(port_type), intent(inout) :: self
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: faults
    faults = errors%count
    call self%send(request, errors)
    if (errors%count == faults) call self%receive(reply, errors)
    if (errors%count == faults) call reply%faults(errors)
  end subroutine ask

  subroutine begin_wait(self)
    class(port_type), intent(inout) :: self
    call self%partner%fresh()
    self%first_sign = -1
    self%stopping = -1.0_wp
  end subroutine begin_wait

  !> While waiting: has the partner joined, ended, stopped answering; is the port whole; is this run
  !! to stop?
  subroutine look(self, reading, errors)
    class(port_type), intent(inout) :: self
    logical, intent(in) :: reading  !! a message that arrived counts more than the end of its sender
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: beat, signs
    integer(i4) :: faults
    logical :: gone

    faults = errors%count
    if (self%partner%pid == 0) call meet(self)
    gone = self%partner%ended()
    if (self%transport == transport_shm) gone = gone .or. self%shm%partner_gone()
    if (gone .and. reading) gone = .not. self%arrived()
    if (gone) then
      call self%partner%report_end(errors)
      return
    end if
    call look_at_port(self, beat, signs, errors)
    if (errors%count == faults .and. reading) call judge_loss(self, signs, errors)
    if (errors%count == faults) call judge_silence(self, beat, errors)
    if (errors%count == faults .and. self%asks) call heed_stop(self, errors)
  end subroutine look

  !> The partner's heartbeat, and a count of signs that it, too, waits for a message (-1: it does
  !! not); P023 or P025 where the port itself is damaged or gone.
  subroutine look_at_port(self, beat, signs, errors)
    class(port_type), intent(inout) :: self
    integer(i8), intent(out) :: beat, signs
    type(error_list_type), intent(inout) :: errors
    logical :: waits

    if (self%transport == transport_shm) then
      beat = self%shm%partner_beat()
      signs = self%shm%partner_waits()
    else
      call self%file%beat(waits=.true.)
      call self%file%partner_beat(beat, waits)
      signs = merge(beat, -1_i8, waits)
    end if
    call look_for_damage(self, errors)
  end subroutine look_at_port

  !> P023, P025 where the port is damaged or gone, P027 where a stranger has joined it.
  subroutine look_for_damage(self, errors)
    class(port_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (self%transport == transport_shm) then
      call self%shm%inspect(self%partner%title(), errors)
    else
      call self%file%inspect(self%partner%title(), errors)
    end if
  end subroutine look_for_damage

  !> P024 when both sides have waited for each other for a while and nothing has arrived.
  subroutine judge_loss(self, signs, errors)
    class(port_type), intent(inout) :: self
    integer(i8), intent(in) :: signs
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: limit

    if (signs < 0 .or. signs < self%first_sign .or. self%arrived()) then
      self%first_sign = -1
      return
    end if
    if (self%first_sign < 0) self%first_sign = signs
    limit = merge(beats_of_loss, far_beats_of_loss, self%partner%same_place)
    if (self%transport == transport_shm) limit = sleeps_of_loss
    if (signs - self%first_sign >= limit) call self%partner%report_loss( &
      trim(merge('the reply  ', 'the request', self%asks))//' '//str(self%sequence + &
      merge(0_i8, 1_i8, self%asks)), errors)
  end subroutine judge_loss

  !> P002 or P003 when the partner has given no sign of life for the time limit.
  subroutine judge_silence(self, beat, errors)
    class(port_type), intent(inout) :: self
    integer(i8), intent(in) :: beat
    type(error_list_type), intent(inout) :: errors
    real(wp) :: limit
    logical :: silent

    limit = self%partner%time_limit
    if (self%partner%pid == 0 .and. self%join_limit > 0.0_wp) &
      self%partner%time_limit = self%join_limit
    silent = self%partner%silent(beat)
    if (silent .and. self%partner%pid == 0) then
      call self%partner%report_absence(errors)
    else if (silent) then
      call self%partner%report_silence(errors)
    end if
    self%partner%time_limit = limit
  end subroutine judge_silence

  !> After a signal or the wall limit an answer is waited for no longer than the time limit, even
  !! where the partner works on it (P026).
  subroutine heed_stop(self, errors)
    class(port_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: limit

    if (signal_seen() == 0 .and. .not. (self%wall_end > 0.0_wp .and. now() >= self%wall_end)) return
    if (self%stopping < 0.0_wp) self%stopping = now()
    limit = stop_limit
    if (self%partner%time_limit > 0.0_wp) limit = self%partner%time_limit
    if (self%partner%pid == 0) limit = min(limit, join_stop_limit)
    if (now() - self%stopping >= limit) &
      call self%partner%report_no_stop(verb_name(self%verb), limit, errors)
  end subroutine heed_stop

  !> Learn who is on the other side, once it has joined.
  subroutine meet(self)
    class(port_type), intent(inout) :: self
    character(len=:), allocatable :: place
    integer(i4) :: pid

    if (self%transport == transport_shm) then
      call self%shm%partner(pid, place)
      if (pid > 0 .and. .not. self%asks) self%run_id = self%shm%run_id()
    else
      call self%file%partner(pid, place)
      if (pid > 0 .and. .not. self%asks) self%run_id = self%file%run_id
    end if
    if (pid > 0) call self%partner%joined(pid, place)
  end subroutine meet

  !> Sign of life; call it in loops that may run long. Costs a few nanoseconds.
  subroutine beat(self)
    class(port_type), intent(inout) :: self
    if (self%transport == transport_shm) call self%shm%beat()
    if (self%transport == transport_file) call self%file%beat()
  end subroutine beat

  !> Does a message wait to be received?
  logical function arrived(self)
    class(port_type), intent(in) :: self
    arrived = .false.
    if (self%transport == transport_shm) arrived = self%shm%arrived()
    if (self%transport == transport_file) arrived = self%file%arrived()
  end function arrived

  pure logical function is_open(self)
    class(port_type), intent(in) :: self
    is_open = self%transport /= transport_none
  end function is_open

  !> Leave the port; its files are removed.
  subroutine port_close(self)
    class(port_type), intent(inout) :: self
    if (self%transport == transport_shm) call self%shm%close()
    if (self%transport == transport_file) call self%file%close(self%partner%ended())
    self%transport = transport_none
    if (allocated(self%rendezvous)) then
      if (self%asks .or. self%partner%ended()) call remove_rendezvous(self%rendezvous)
      deallocate (self%rendezvous)
    end if
    call self%partner%close()
  end subroutine port_close
end module talus_port
