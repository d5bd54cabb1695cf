!> What the tests of a solver's service at the port share. The service runs in the test program
!! itself, started as `serve SPEC DECK`; the test sends requests through shared memory.
module talus_port_fixture
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, protocol_version, verb_hello
  use talus_options, only: options_type, parse_arguments
  use talus_partner, only: own_pid
  use talus_port, only: port_type
  use talus_process, only: process_type
  use talus_test, only: test_type
  implicit none
  private
  public :: port_test_type, asked_to_serve

  real(wp), parameter :: patience = 20.0_wp  !! s for an answer, and for the end of a service

  !> A tally, and the service under test. Set `program` and `folder` before `start`.
  type, extends(test_type) :: port_test_type
    character(len=:), allocatable :: program  !! name that HELLO must report
    character(len=:), allocatable :: folder   !! with deck.nml
    type(port_type) :: port
    type(process_type) :: child
  contains
    procedure :: start
    procedure :: expect
    procedure :: ends_with
  end type port_test_type

contains

  !> Was this program started as a service? Its options are those of PROGRAM DECK --port=SPEC.
  logical function asked_to_serve(program, options)
    character(len=*), intent(in) :: program
    type(options_type), intent(out) :: options
    type(string_type), allocatable :: arguments(:)
    type(error_list_type) :: faults
    character(len=512) :: argument(3)
    integer :: k

    do k = 1, 3
      call get_command_argument(k, argument(k))
    end do
    asked_to_serve = argument(1) == 'serve'
    if (.not. asked_to_serve) return
    call append_string(arguments, trim(argument(3)))
    call append_string(arguments, '--port='//trim(argument(2)))
    call parse_arguments(options, program, arguments, faults)
    if (faults%any()) error stop 'bug: options of a service'
  end function asked_to_serve

  !> Start a service and send HELLO; `time` [s] is its time.
  subroutine start(self, name, ask, reply, time, restart)
    class(port_test_type), intent(inout) :: self
    character(len=*), intent(in) :: name  !! of this service, for its port and its output
    type(message_type), intent(inout) :: ask, reply
    real(wp), intent(out) :: time
    character(len=*), intent(in), optional :: restart
    type(string_type), allocatable :: argv(:)
    type(error_list_type) :: errors
    character(len=:), allocatable :: spec, text
    integer(i4) :: ranks

    spec = 'shm:/talus-porttest-'//str(own_pid())//'-'//name
    call self%port%create(spec, 'run', patience, errors)
    call append_string(argv, '/proc/self/exe')
    call append_string(argv, 'serve')
    call append_string(argv, spec)
    call append_string(argv, self%folder//'/deck.nml')
    self%child = process_type()
    call self%child%spawn(argv, '', self%folder//'/'//name//'.out', 1_i4, errors)
    call self%port%watch(self%child%pid)
    call ask%start(verb_hello)
    call ask%put_text('run_id', 'run')
    text = ''
    if (present(restart)) text = restart
    call ask%put_text('restart', text)
    call ask%put_int('protocol', int(protocol_version, i4))
    call self%port%ask(ask, reply, errors)
    call reply%get_text('program', text, errors)
    call self%check_text('HELLO reports the program', text, self%program)
    time = 0.0_wp
    call reply%get('time', time, errors)
    call reply%get_int('ranks', ranks, errors)
    call self%check('HELLO without faults', ranks == 1 .and. .not. errors%any())
    if (errors%any()) call errors%print(0)
  end subroutine start

  !> Ask, and expect the fault `code` ('' for none).
  subroutine expect(self, what, code, ask, reply)
    class(port_test_type), intent(inout) :: self
    character(len=*), intent(in) :: what, code
    type(message_type), intent(inout) :: ask, reply
    type(error_list_type) :: faults

    call self%port%ask(ask, reply, faults)
    if (len(code) == 0) then
      call self%check(what, .not. faults%any())
      if (faults%any()) call faults%print(0)
    else if (faults%any()) then
      call self%check_text(what, faults%item(1)%code, code)
    else
      call self%check(what//': no fault', .false.)
    end if
  end subroutine expect

  !> The service leaves with this exit code; its port is closed.
  subroutine ends_with(self, code)
    class(port_test_type), intent(inout) :: self
    integer, intent(in) :: code
    call self%check('it ends with '//str(int(code, i4)), self%child%wait(patience) .and. &
                    self%child%exit_code == code)
    call self%port%close()
  end subroutine ends_with
end module talus_port_fixture
