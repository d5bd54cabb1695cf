!> The service of a solver at the exchange port: requests are received, replies sent.
!!
!! Where ranks answer together the first speaks with the partner. It sends each request to the
!! others as it came; all do the same work with it, and the faults of one are those of all.
!!
!! A solver extends `server_type` by what each verb does; order of the verbs, faults, restart tags
!! and the end are the same for all. A fault of a request is reported in its reply; the service goes
!! on: what to do is the partner's decision. A numerical failure, or a fault before HELLO was
!! answered, ends the run.
module talus_serve
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type, exit_numerical
  use talus_files, only: file_exists
  use talus_hash, only: hash_file
  use talus_message, only: message_type, protocol_version, verb_name, verb_hello, verb_describe, &
    verb_select, verb_set, verb_ready, verb_force, verb_accept, verb_reject, verb_checkpoint, &
    verb_write, verb_stop, verb_abort, verb_relax, verb_sleep, verb_wake
  use talus_options, only: options_type
  use talus_port, only: port_type
  use talus_port_names, only: field_brief, field_early, field_final, field_group, field_hash, &
    field_id, field_path, field_protocol, field_rehearsal, field_restart, field_role, &
    field_run_id, field_set, field_tag, field_what
  use talus_ranks, only: ranks_type
  use talus_system, only: install_signals, wall_clock
  use talus_text, only: starts_with
  implicit none
  private
  public :: server_type, serve_partner, restart_file, take_brief, take_flag, limit_told

  !> What every solver's service remembers, and what each solver must do.
  type, abstract :: server_type
    character(len=:), allocatable :: program  !! 'talus-dem'
    type(ranks_type) :: team                  !! that answer together
    logical :: greeted = .false.              !! HELLO was answered
    logical :: begun = .false.                !! READY was answered
    logical :: rehearsing = .false.           !! READY requested steps that do not count
    logical :: final = .false.                !! the last ACCEPT said that no REJECT follows it
    logical :: leave = .false.                !! STOP or ABORT was received
    integer(i4) :: exit_code = 0
    type(error_list_type) :: fatal            !! faults that end the run
  contains
    procedure(take_options), deferred :: read      !! deck and input
    procedure(answer_hello), deferred :: hello     !! first state or checkpoint; who we are
    procedure(answer_describe), deferred :: describe
    procedure(answer_select), deferred :: choose
    procedure(answer_request), deferred :: set
    procedure(answer), deferred :: ready           !! open files; state at zero duration
    procedure(answer_request), deferred :: move    !! the step verbs
    procedure :: hear_accept                       !! what ACCEPT brings besides
    procedure(judge), deferred :: accept
    procedure(judge), deferred :: reject
    procedure(file_of), deferred :: save           !! CHECKPOINT
    procedure(file_of), deferred :: write          !! WRITE
    procedure(end_run), deferred :: finish         !! sets exit_code
    procedure :: is_busy                           !! is there work that no request waits for yet?
    procedure :: work_on                           !! a slice of it, while no request arrives
    procedure :: catch_up                          !! all of it, before any request but FORCE
  end type server_type

  abstract interface
    subroutine take_options(self, options, errors)
      import :: server_type, options_type, error_list_type
      class(server_type), intent(inout) :: self
      type(options_type), intent(in) :: options
      type(error_list_type), intent(inout) :: errors
    end subroutine take_options
    subroutine answer_hello(self, restart, reply, errors)
      import :: server_type, message_type, error_list_type
      class(server_type), intent(inout) :: self
      character(len=*), intent(in) :: restart  !! checkpoint, tag of one, 'auto' or ''
      type(message_type), intent(inout) :: reply
      type(error_list_type), intent(inout) :: errors
    end subroutine answer_hello
    subroutine answer_describe(self, what, group, reply, errors)
      import :: server_type, message_type, error_list_type
      class(server_type), intent(inout) :: self
      character(len=*), intent(in) :: what, group
      type(message_type), intent(inout) :: reply
      type(error_list_type), intent(inout) :: errors
    end subroutine answer_describe
    subroutine answer_select(self, request, name, role, ids, reply, errors)
      import :: server_type, message_type, error_list_type, i8
      class(server_type), intent(inout) :: self
      type(message_type), intent(inout) :: request  !! its fields are for the solver to read
      character(len=*), intent(in) :: name, role
      integer(i8), intent(in) :: ids(:)
      type(message_type), intent(inout) :: reply
      type(error_list_type), intent(inout) :: errors
    end subroutine answer_select
    subroutine answer_request(self, request, reply, errors)
      import :: server_type, message_type, error_list_type
      class(server_type), intent(inout) :: self
      type(message_type), intent(inout) :: request, reply
      type(error_list_type), intent(inout) :: errors
    end subroutine answer_request
    subroutine answer(self, reply, errors)
      import :: server_type, message_type, error_list_type
      class(server_type), intent(inout) :: self
      type(message_type), intent(inout) :: reply
      type(error_list_type), intent(inout) :: errors
    end subroutine answer
    subroutine judge(self, errors)
      import :: server_type, error_list_type
      class(server_type), intent(inout) :: self
      type(error_list_type), intent(inout) :: errors
    end subroutine judge
    subroutine file_of(self, tag, path, errors)
      import :: server_type, error_list_type
      class(server_type), intent(inout) :: self
      character(len=*), intent(in) :: tag
      character(len=:), allocatable, intent(out) :: path
      type(error_list_type), intent(inout) :: errors
    end subroutine file_of
    subroutine end_run(self, regular, early, errors)
      import :: server_type, error_list_type
      class(server_type), intent(inout) :: self
      logical, intent(in) :: regular  !! by STOP
      logical, intent(in) :: early    !! on request, before the end
      type(error_list_type), intent(inout) :: errors
    end subroutine end_run
  end interface

contains

  !> Serve a partner until STOP, ABORT or its end; exit_code is that of the program.
  subroutine serve_partner(server, options, errors)
    class(server_type), intent(inout) :: server
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: faults
    real(wp) :: waiting

    call join_partner(server, port, options, errors)
    server%exit_code = errors%exit_code()
    if (errors%any()) return
    call server%read(options, faults)
    call server%team%agree(faults)
    call server%fatal%take(faults)
    do while (.not. server%leave)
      call next_request(server, port, request, waiting, errors)
      if (errors%any()) exit
      if (request%verb /= verb_force) call server%catch_up()
      call reply%answer(request)
      reply%waited = waiting
      call faults%clear()
      if (server%fatal%any() .and. .not. leaving(request%verb)) then
        call faults%take(server%fatal)
      else
        call handle(server, request, reply, faults)
      end if
      call server%team%agree(faults)
      if (faults%any()) call reply%fail_with(faults)
      if (.not. server%fatal%any() .and. faults%exit_code() == exit_numerical) &
        call server%fatal%take(faults)
      if (server%team%leads()) call send_reply(server, port, reply, errors)
      if (server%fatal%any() .and. .not. server%greeted) exit
    end do
    call errors%take(server%fatal)
    if (.not. server%leave) then
      call server%finish(.false., .false., errors)
      if (errors%any()) server%exit_code = errors%exit_code()
    end if
    if (server%team%leads()) call port%close()
  end subroutine serve_partner

  !> The leader connects.
  subroutine join_partner(server, port, options, errors)
    class(server_type), intent(in) :: server
    type(port_type), intent(inout) :: port
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    ! who waits for a user to start talus-couple is still the user's to stop
    if (.not. starts_with(options%port, 'attach:')) call install_signals(.false.)
    if (server%team%leads()) call port%connect(options%port, errors)
    call install_signals(.false.)
    call server%team%agree(errors)
  end subroutine join_partner

  !> Wait for a request, or work on what is left to do until one arrives.
  subroutine next_request(server, port, request, waiting, errors)
    class(server_type), intent(inout) :: server
    type(port_type), intent(inout) :: port
    type(message_type), intent(inout) :: request
    real(wp), intent(out) :: waiting  !! [s]
    type(error_list_type), intent(inout) :: errors

    do while (server%is_busy() .and. .not. errors%any())
      if (port%arrived()) exit
      call server%work_on()
      call port%beat()
    end do
    waiting = wall_clock()
    if (server%team%leads() .and. .not. errors%any()) call port%receive(request, errors)
    waiting = wall_clock() - waiting
    call share_request(server%team, request, errors)
  end subroutine next_request

  !> Every rank gets the request of the leader, or its faults.
  subroutine share_request(team, request, errors)
    type(ranks_type), intent(in) :: team
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i8), parameter :: half = 2_i8**31
    type(error_list_type) :: damage
    integer(i4) :: numbers(2)
    integer(i8) :: words

    if (.not. team%several()) return
    numbers = 0  ! nothing but faults comes
    if (team%leads() .and. .not. errors%any()) &
      numbers = int([request%used/half, modulo(request%used, half)], i4)
    call team%await(numbers)
    words = half*numbers(1) + numbers(2)
    if (words == 0) then
      call team%agree(errors)
      return
    end if
    call request%reserve(words)
    call team%broadcast_words(request%word(:words))
    if (team%leads()) return
    call request%parse(words, damage)
    if (damage%any()) error stop 'bug: a request that ranks share is damaged'
  end subroutine share_request

  subroutine send_reply(server, port, reply, errors)
    class(server_type), intent(in) :: server
    type(port_type), intent(inout) :: port
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    if (.not. server%leave) call port%beat()
    call port%send(reply, errors)
  end subroutine send_reply

  !> A solver that needs nothing more to accept what it did.
  subroutine hear_accept(self, request, errors)
    class(server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request  !! its fields are for the solver to read
    type(error_list_type), intent(inout) :: errors
  end subroutine hear_accept

  !> A solver that leaves nothing undone.
  logical function is_busy(self)
    class(server_type), intent(in) :: self
    is_busy = self%leave .and. .false.
  end function is_busy

  subroutine work_on(self)
    class(server_type), intent(inout) :: self
    if (self%is_busy()) error stop 'bug: work that nobody does'
  end subroutine work_on

  subroutine catch_up(self)
    class(server_type), intent(inout) :: self
    if (self%is_busy()) call self%work_on()
  end subroutine catch_up

  pure logical function leaving(verb)
    integer(i4), intent(in) :: verb
    leaving = verb == verb_stop .or. verb == verb_abort
  end function leaving

  !> Answer one request.
  subroutine handle(server, request, reply, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors  !! faults of this request

    call check_order(server, request, errors)
    if (errors%any()) return
    select case (request%verb)
    case (verb_hello)
      call hello(server, request, reply, errors)
    case (verb_describe)
      call describe(server, request, reply, errors)
    case (verb_select)
      call choose(server, request, reply, errors)
    case (verb_set)
      call server%set(request, reply, errors)
    case (verb_ready)
      call ready(server, request, reply, errors)
    case (verb_accept, verb_reject)
      if (request%verb == verb_accept) call take_flag(request, field_final, server%final, errors)
      if (request%verb == verb_accept) call server%hear_accept(request, errors)
      call request%all_read(errors)
      if (errors%any()) return
      if (request%verb == verb_accept) call server%accept(errors)
      if (request%verb == verb_reject) call server%reject(errors)
    case (verb_checkpoint, verb_write)
      call write_files(server, request, reply, errors)
    case (verb_stop, verb_abort)
      call leave(server, request, errors)
    case default
      call server%move(request, reply, errors)
    end select
  end subroutine handle

  !> HELLO precedes all, READY all that takes time or judges (P021).
  subroutine check_order(server, request, errors)
    class(server_type), intent(in) :: server
    type(message_type), intent(in) :: request
    type(error_list_type), intent(inout) :: errors
    if (leaving(request%verb) .or. request%verb == verb_hello) return
    if (.not. server%greeted) then
      call errors%add('P021', verb_name(request%verb)//' before HELLO', request%place(), &
                      'HELLO is the first request')
      return
    end if
    select case (request%verb)
    case (verb_describe, verb_select, verb_set, verb_ready, verb_checkpoint, verb_write, &
          verb_wake, verb_sleep, verb_relax)
      return
    end select
    if (.not. server%begun) &
      call errors%add('P021', verb_name(request%verb)//' before READY', request%place(), &
                      'READY must precede all steps')
  end subroutine check_order

  !> Same protocol? Then the first state, or that of a checkpoint; a fault of it ends the run.
  subroutine hello(server, request, reply, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: run_id, restart
    integer(i4) :: protocol

    protocol = 0
    call request%get_text(field_run_id, run_id, errors)
    call request%get_text(field_restart, restart, errors)
    call request%get_int(field_protocol, protocol, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (protocol /= protocol_version) then
      call errors%add('P005', 'the partner uses another protocol than '//server%program, &
                      request%place(), 'use programs with the same version of the port')
      return
    end if
    call server%hello(restart, reply, errors)
    if (errors%any() .and. .not. server%greeted) call server%fatal%take(errors)
    server%greeted = server%greeted .or. .not. errors%any()
  end subroutine hello

  !> READY. With rehearsal = 1 steps may be tried and accepted, but what the deck itself moves
  !! does not advance and no file is written; the READY that ends it resets the clock.
  subroutine ready(server, request, reply, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: rehearsal

    rehearsal = 0
    if (request%has(field_rehearsal)) call request%get_int(field_rehearsal, rehearsal, errors)
    call request%all_read(errors)
    if (errors%any()) return
    server%rehearsing = rehearsal == 1
    call server%ready(reply, errors)
    server%begun = server%begun .or. .not. errors%any()
  end subroutine ready

  !> The checkpoint that a restart text names: a file, 'auto', or the tag of one of this run.
  function restart_file(restart, stem) result(path)
    character(len=*), intent(in) :: restart, stem
    character(len=:), allocatable :: path
    path = restart
    if (len(restart) == 0 .or. restart == 'auto') return
    if (.not. file_exists(restart)) path = stem//'.'//restart//'.chk.h5'
  end function restart_file

  subroutine describe(server, request, reply, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what, group

    group = ''
    call request%get_text(field_what, what, errors)
    if (request%has(field_group)) call request%get_text(field_group, group, errors)
    call request%all_read(errors)
    if (.not. errors%any()) call server%describe(what, group, reply, errors)
  end subroutine describe

  subroutine choose(server, request, reply, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, role
    integer(i8), allocatable :: ids(:)

    call request%get_text(field_set, name, errors)
    call request%get_text(field_role, role, errors)
    call request%take_int(field_id, ids, errors)
    if (.not. errors%any()) call server%choose(request, name, role, ids, reply, errors)
  end subroutine choose

  !> CHECKPOINT and WRITE at the accepted state; they reply with the file's path.
  subroutine write_files(server, request, reply, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: tag, path
    character(len=16) :: hash
    integer(i4) :: status

    tag = ''
    if (request%has(field_tag)) call request%get_text(field_tag, tag, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (request%verb == verb_checkpoint) then
      call server%save(tag, path, errors)
      if (errors%any()) return
      call hash_file(path, hash, status)
      call reply%put_text(field_hash, hash)
    else
      call server%write(tag, path, errors)
      if (errors%any()) return
    end if
    call reply%put_text(field_path, path)
  end subroutine write_files

  !> STOP: the normal end, with early = 1 the one on request. ABORT: leave at once (P022, exit 4,
  !! unless a fault of our own was the reason).
  subroutine leave(server, request, errors)
    class(server_type), intent(inout) :: server
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: reasons
    integer(i4) :: early

    server%leave = .true.
    early = 0
    if (request%has(field_early)) call request%get_int(field_early, early, errors)
    call reasons%take(server%fatal)
    if (request%verb == verb_abort .and. .not. reasons%any()) &
      call reasons%add('P022', 'the partner has ended this run', request%place(), &
                            'the reason is in the log of the coupled run')
    call server%finish(request%verb == verb_stop, early == 1, reasons)
    call server%fatal%clear()
    call server%fatal%take(reasons)
    if (request%verb == verb_stop) call errors%take(reasons)
  end subroutine leave

  !> Does the partner want a reply without scalars?
  subroutine take_brief(request, brief, errors)
    type(message_type), intent(inout) :: request
    logical, intent(out) :: brief
    type(error_list_type), intent(inout) :: errors
    call take_flag(request, field_brief, brief, errors)
  end subroutine take_brief

  !> A field that is 1, or another number or left out.
  subroutine take_flag(request, name, flag, errors)
    type(message_type), intent(inout) :: request
    character(len=*), intent(in) :: name
    logical, intent(out) :: flag
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: value
    value = 0
    if (request%has(name)) call request%get_int(name, value, errors)
    flag = value == 1
  end subroutine take_flag

  !> A step limit [s] as the port has it: 0 where nothing limits the step.
  pure real(wp) function limit_told(limit)
    real(wp), intent(in) :: limit  !! s; huge: none
    limit_told = merge(0.0_wp, limit, limit >= 0.1_wp*huge(1.0_wp))
  end function limit_told
end module talus_serve
