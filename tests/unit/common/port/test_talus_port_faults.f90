!> Partners that die, hang or disagree: one clear fault each, nothing left behind.
!!
!! The partner is this program itself, started with `serve SPEC MODE` or `ask SPEC`.
program test_talus_port_faults
  use, intrinsic :: iso_c_binding, only: c_int
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_hello, verb_ready, verb_force, verb_stop
  use talus_message_file, only: write_message_file
  use talus_partner, only: now, nap, own_pid
  use talus_port, only: port_type
  use talus_port_shm, only: shm_port_type
  use talus_process, only: process_type, signal_kill, signal_stop
  use talus_test, only: test_type
  implicit none

  interface
    function c_kill(pid, signal) result(code) bind(c, name='kill')
      import :: c_int
      integer(c_int), value :: pid, signal
      integer(c_int) :: code
    end function c_kill
  end interface

  real(wp), parameter :: limit = 0.4_wp  !! s of silence that count as a hang here
  real(wp), parameter :: long = 3.2_wp   !! s; more than a lost message is waited for
  type(test_type) :: test
  character(len=512) :: argument(3)
  integer :: k

  do k = 1, 3
    call get_command_argument(k, argument(k))
  end do
  select case (argument(1))
  case ('serve')
    call serve(trim(argument(2)), trim(argument(3)))
  case ('forge')
    call forge(trim(argument(2)), trim(argument(3)))
  case ('ask')
    call ask_and_wait(trim(argument(2)))
  case default
    do k = 1, 2
      call expect_fault('die', 'P001', k)
      call expect_fault('leave', 'P001', k)
      call expect_fault('stop', 'P002', k)
      call expect_answer('work', k)
      call expect_answer('beat', k)
      call expect_fault('fail', 'N999', k)
      call asker_dies(k)
      call other_works(k)
    end do
    call never_joins()
    call attached()
    call forged('protocol', 'P005')
    call forged('magic', 'P005')
    call forged('checksum', 'P006')
    call forged('short', 'P006')
    call forged('cut', 'P006')
    call forged('sequence', 'P007')
    call forged('verb', 'P008')
    call bad_files()
    call bad_specs()
    call left_over()
    call test%finish()
  end select

contains

  function spec_of(transport, name) result(spec)
    integer, intent(in) :: transport
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: spec
    if (transport == 1) then
      spec = 'shm:/talus-'//str(own_pid())//'-'//name
    else
      spec = 'hdf5:talus-faults-'//str(own_pid())//'/'//name
    end if
  end function spec_of

  !> A partner that answers HELLO and then behaves according to its mode.
  subroutine serve(spec, mode)
    character(len=*), intent(in) :: spec, mode
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: errors, fault
    integer :: code

    call port%connect(spec, errors)
    do while (.not. errors%any())
      call port%receive(request, errors)
      if (errors%any()) exit
      call reply%answer(request)
      if (request%verb == verb_force) then
        select case (mode)
        case ('die')
          code = c_kill(own_pid(), signal_kill)
        case ('leave')
          stop 3, quiet=.true.
        case ('stop')
          code = c_kill(own_pid(), signal_stop)
        case ('work')
          call work(2.5_wp*limit)
        case ('beat')
          call sleep_and_beat(port, 2.5_wp*limit)
        case ('long')
          call sleep_and_beat(port, long)
        case ('fail')
          call fault%add('N999', 'grain 17 is gone', 'grain 17', 'a hint')
          call reply%fail_with(fault)
        end select
      end if
      call port%send(reply, errors)
      if (request%verb == verb_stop) exit
    end do
    call port%close()
    if (errors%any()) stop 4, quiet=.true.
  end subroutine serve

  !> A long call into a library: no heartbeat, but CPU time.
  subroutine work(seconds)
    real(wp), intent(in) :: seconds
    real(wp) :: started, x
    integer(i8) :: n
    started = now()
    x = 1.0_wp
    n = 0
    do
      n = n + 1
      x = sin(x + 1.0e-3_wp*n)
      if (now() - started > seconds .or. x > 2.0_wp) exit
    end do
  end subroutine work

  !> Long work that waits for something else: no CPU time, but a heartbeat.
  subroutine sleep_and_beat(port, seconds)
    type(port_type), intent(inout) :: port
    real(wp), intent(in) :: seconds
    real(wp) :: started
    started = now()
    do while (now() - started < seconds)
      call port%beat()
      call nap(0.02_wp)
    end do
  end subroutine sleep_and_beat

  subroutine start_partner(role, spec, mode, process, errors)
    character(len=*), intent(in) :: role, spec, mode
    type(process_type), intent(inout) :: process
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: argv(:)
    call append_string(argv, '/proc/self/exe')
    call append_string(argv, role)
    call append_string(argv, spec)
    call append_string(argv, mode)
    call process%spawn(argv, '', '', 1, errors)
  end subroutine start_partner

  subroutine open_pair(spec, role, mode, port, process, errors)
    character(len=*), intent(in) :: spec, role, mode
    type(port_type), intent(inout) :: port
    type(process_type), intent(inout) :: process
    type(error_list_type), intent(inout) :: errors
    port%partner%name = 'talus-dummy'
    port%partner%log = 'dummy.log'
    call port%create(spec, 'faults', limit, errors)
    call start_partner(role, spec, mode, process, errors)
    call port%watch(process%pid)
  end subroutine open_pair

  subroutine hello_and_force(port, errors)
    type(port_type), intent(inout) :: port
    type(error_list_type), intent(inout) :: errors
    type(message_type) :: request, reply
    call request%start(verb_hello)
    call port%ask(request, reply, errors)
    call request%start(verb_force)
    if (.not. errors%any()) call port%ask(request, reply, errors)
  end subroutine hello_and_force

  subroutine expect_fault(mode, code, transport)
    character(len=*), intent(in) :: mode, code
    integer, intent(in) :: transport
    type(port_type) :: port
    type(process_type) :: process
    type(error_list_type) :: errors
    character(len=:), allocatable :: title

    title = mode//' through '//trim(merge('shm ', 'hdf5', transport == 1))
    call open_pair(spec_of(transport, mode), 'serve', mode, port, process, errors)
    call hello_and_force(port, errors)
    call test%check('one fault: '//title, errors%count == 1)
    if (errors%any()) then
      call test%check_text(title, errors%item(1)%code, code)
      if (code(1:1) == 'P') then
        call test%check(title//' names the partner: '//errors%item(1)%message, &
          index(errors%item(1)%message, 'talus-dummy (process '//str(process%pid)//')') == 1)
        call test%check_text(title//' names the log', errors%item(1)%place, 'dummy.log')
      end if
    end if
    if (mode == 'stop' .and. errors%any()) &
      call test%check('SIGSTOP is named', index(errors%item(1)%message, 'stopped') > 0)
    call process%stop(0.1_wp)
    if (mode == 'die') call test%check_text('end', process%epitaph(), &
      'killed by signal 9 (SIGKILL)')
    if (mode == 'leave') call test%check_text('end', process%epitaph(), 'exit code 3')
    call port%close()
  end subroutine expect_fault

  subroutine expect_answer(mode, transport)
    character(len=*), intent(in) :: mode
    integer, intent(in) :: transport
    type(port_type) :: port
    type(process_type) :: process
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp) :: started

    call open_pair(spec_of(transport, mode), 'serve', mode, port, process, errors)
    started = now()
    call hello_and_force(port, errors)
    call test%check('slow but alive: '//mode, &
                    .not. errors%any() .and. now() - started > 2.0_wp*limit)
    call request%start(verb_stop)
    if (.not. errors%any()) call port%ask(request, reply, errors)
    call process%stop(2.0_wp)
    call test%check_text('end of '//mode, process%epitaph(), 'exit code 0')
    call port%close()
  end subroutine expect_answer

  !> One solver works long; the other waits all the while, and is not taken for one that has lost a
  !! message.
  subroutine other_works(transport)
    integer, intent(in) :: transport
    type(port_type) :: busy, idle
    type(process_type) :: process(2)
    type(message_type) :: request, reply
    type(error_list_type) :: errors

    call open_pair(spec_of(transport, 'busy'), 'serve', 'long', busy, process(1), errors)
    call open_pair(spec_of(transport, 'idle'), 'serve', '-', idle, process(2), errors)
    call request%start(verb_hello)
    call idle%ask(request, reply, errors)
    call hello_and_force(busy, errors)
    call request%start(verb_stop)
    call idle%ask(request, reply, errors)
    call busy%ask(request, reply, errors)
    call test%check('a solver waits while the other works', .not. errors%any())
    if (errors%any()) call errors%print(0)
    call process(1)%stop(2.0_wp)
    call process(2)%stop(2.0_wp)
    call busy%close()
    call idle%close()
  end subroutine other_works

  !> The other way round: a solver whose asker is killed leaves by itself, soon.
  subroutine asker_dies(transport)
    integer, intent(in) :: transport
    type(process_type) :: asker, server
    type(error_list_type) :: errors
    real(wp) :: started
    logical :: ended

    call start_partner('ask', spec_of(transport, 'orphan'), '-', asker, errors)
    call start_partner('serve', spec_of(transport, 'orphan'), '-', server, errors)
    call nap(0.3_wp)
    call test%check('both run', asker%running() .and. server%running())
    call asker%kill_group(signal_kill)
    started = now()
    ended = server%wait(5.0_wp)
    call test%check('the solver leaves by itself', ended .and. server%exit_code == 4)
    call test%check('and soon', now() - started < 2.0_wp)
    call asker%stop(0.1_wp)
    call server%stop(0.1_wp)
  end subroutine asker_dies

  subroutine ask_and_wait(spec)
    character(len=*), intent(in) :: spec
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    call port%create(spec, 'faults', 10.0_wp, errors)
    call request%start(verb_ready)
    call port%ask(request, reply, errors)
    call nap(60.0_wp)
  end subroutine ask_and_wait

  subroutine never_joins()
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp) :: started
    logical :: left

    call port%create(spec_of(1, 'alone'), 'faults', 0.2_wp, errors)
    call request%start(verb_hello)
    started = now()
    call port%ask(request, reply, errors)
    call test%check('nobody joins', errors%count == 1 .and. now() - started > 0.2_wp)
    if (errors%any()) call test%check_text('nobody joins', errors%item(1)%code, 'P003')
    call port%close()
    inquire (file='/dev/shm/talus-'//str(own_pid())//'-alone', exist=left)
    call test%check('nothing left of a port that nobody joined', .not. left)
  end subroutine never_joins

  !> A solver that finds its port in a rendezvous file; one on another machine gets a fault.
  subroutine attached()
    type(port_type) :: port, far
    type(process_type) :: process
    type(message_type) :: request, reply
    type(error_list_type) :: errors, more
    character(len=*), parameter :: path = 'talus-faults.port'
    integer :: unit
    logical :: left

    call port%create(spec_of(1, 'attach'), 'faults', 5.0_wp, errors)
    call port%publish(path, errors)
    call start_partner('serve', 'attach:'//path, '-', process, errors)
    call request%start(verb_stop)
    call port%ask(request, reply, errors)
    call test%check('attached', .not. errors%any())
    call process%stop(2.0_wp)
    call port%close()
    inquire (file=path, exist=left)
    call test%check('rendezvous file is gone', .not. left)
    open (newunit=unit, file=path)
    write (unit, '(a)') 'shm:/talus-far', 'farhost', 'another-boot/1', 'run'
    close (unit)
    call far%connect('attach:'//path, more)
    open (newunit=unit, file=path)
    close (unit, status='delete')
    call test%check('another machine', more%count == 1)
    if (more%any()) call test%check('named, with the way out: '//more%item(1)%message, &
      more%item(1)%code == 'P016' .and. index(more%item(1)%message, 'farhost') > 0 .and. &
      index(more%item(1)%hint, 'hdf5') > 0)
  end subroutine attached

  !> A partner that answers HELLO with a reply that is wrong in one way.
  subroutine forge(spec, mode)
    character(len=*), intent(in) :: spec, mode
    type(shm_port_type) :: shm
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    integer(i8) :: words, sequence
    logical :: absent, finished

    call shm%connect(spec(5:), '', absent, errors)
    do
      call shm%pull(request, 1.0_wp, words)
      if (words /= 0) exit
    end do
    call request%parse(words, errors)
    call reply%answer(request)
    if (mode == 'verb') call reply%start(verb_ready)
    call reply%put('x', [1.0_wp, 2.0_wp])
    sequence = request%sequence
    if (mode == 'sequence') sequence = sequence + 1
    call reply%seal(sequence)
    if (mode == 'magic') reply%word(1) = 12345
    if (mode == 'protocol') reply%word(2) = 99
    if (mode == 'checksum') reply%word(28) = reply%word(28) + 1
    if (mode == 'short') reply%used = 3
    if (mode == 'cut') reply%used = reply%used - 1
    call shm%push(reply, 1.0_wp, finished)
    call nap(5.0_wp)
  end subroutine forge

  subroutine forged(mode, code)
    character(len=*), intent(in) :: mode, code
    type(port_type) :: port
    type(process_type) :: process
    type(error_list_type) :: errors

    call open_pair(spec_of(1, mode), 'forge', mode, port, process, errors)
    call hello_and_force(port, errors)
    call test%check('one fault: '//mode, errors%count == 1)
    if (errors%any()) then
      call test%check_text('forged '//mode, errors%item(1)%code, code)
      call test%check('the partner is named: '//errors%item(1)%message, &
                      index(errors%item(1)%message, 'talus-dummy') == 1)
    end if
    call process%kill_group(signal_kill)
    call process%stop(1.0_wp)
    call port%close()
  end subroutine forged

  !> Reply files that are no HDF5, cut off, or changed after they were sealed.
  subroutine bad_files()
    type(message_type) :: reply
    character(len=:), allocatable :: failed
    character(len=1), allocatable :: bytes(:)
    character(len=*), parameter :: path = 'talus-faults-message.h5'
    integer :: unit, length

    call reply%start(verb_hello)
    call reply%put('x', [1.0_wp, 2.0_wp])
    call reply%put_text('t', 'text')
    call reply%seal(1_i8)
    call write_message_file(path, reply, failed)
    call test%check_text('message file', failed, '')
    open (newunit=unit, file=path, access='stream', action='read', status='old')
    inquire (unit, size=length)
    allocate (bytes(length))
    read (unit) bytes
    close (unit, status='delete')
    call bad_file(bytes, '')
    call bad_file(bytes(:length/2), 'P019')
    call bad_file(bytes(:0), 'P019')
    call bad_file([character(len=7) :: ('garbage', unit=1, 100)], 'P019')
    reply%word(27) = 7
    call write_message_file(path, reply, failed)
    open (newunit=unit, file=path, access='stream', action='read', status='old')
    read (unit) bytes
    close (unit, status='delete')
    call bad_file(bytes, 'P006')
  end subroutine bad_files

  !> Let a reply of these bytes arrive; code '' expects no fault.
  subroutine bad_file(bytes, code)
    character(len=*), intent(in) :: bytes(:), code
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    character(len=:), allocatable :: spec
    integer :: unit

    spec = spec_of(2, 'bad')
    call port%create(spec, 'faults', limit, errors)
    open (newunit=unit, file=spec(6:)//'.00000001.reply.h5', access='stream', action='write')
    write (unit) bytes
    close (unit)
    call request%start(verb_hello)
    call port%ask(request, reply, errors)
    if (code == '') then
      call test%check('good file', .not. errors%any())
    else
      call test%check('one fault of a file', errors%count == 1)
      if (errors%any()) call test%check_text('bad file', errors%item(1)%code, code)
    end if
    call port%close()
  end subroutine bad_file

  subroutine bad_specs()
    character(len=24), parameter :: spec(8) = [character(len=24) :: '', 'shm:', 'shm:/', &
      'shm:name', &
      'shm:/a/b', 'hdf5:side', 'hdf5:dir/', 'tcp:host']
    type(port_type) :: port
    type(error_list_type) :: errors
    integer :: j
    do j = 1, size(spec)
      call port%create(trim(spec(j)), 'faults', limit, errors)
      call test%check('bad port '''//trim(spec(j))//'''', errors%count == j)
      if (errors%count == j) call test%check_text('bad port', errors%item(j)%code, 'P004')
    end do
    call errors%clear()
    call port%create('hdf5:/proc/no/side', 'faults', limit, errors)
    call test%check('unwritable folder', errors%count == 1)
    if (errors%any()) call test%check_text('unwritable folder', errors%item(1)%code, 'P018')
    call test%check('none is open', .not. port%is_open())
  end subroutine bad_specs

  !> Nothing of all this stays: no segment, no folder.
  subroutine left_over()
    character(len=8), parameter :: name(20) = [character(len=8) :: 'busy', 'idle', 'die', &
      'leave', 'stop', 'work', 'beat', 'fail', 'orphan', 'alone', 'protocol', 'magic', &
      'checksum', 'short', 'cut', 'sequence', 'verb', 'bad', 'attach', '']
    logical :: left
    integer :: j
    do j = 1, size(name)
      inquire (file='/dev/shm/talus-'//str(own_pid())//'-'//trim(name(j)), exist=left)
      call test%check('no segment left: '//trim(name(j)), .not. left)
    end do
    inquire (file='talus-faults-'//str(own_pid())//'/.', exist=left)
    call test%check('no folder left', .not. left)
  end subroutine left_over
end program test_talus_port_faults
