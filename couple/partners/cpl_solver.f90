!> A solver as talus-couple sees it: process, port, messages, what it reported of itself.
module cpl_solver
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_describe, verb_select
  use talus_port, only: port_type
  use talus_port_names, only: field_fields, field_group, field_id, field_role, field_set, &
    field_what, role_name
  use talus_process, only: process_type, tail_of
  use talus_system, only: wall_clock
  use talus_timers, only: timers_type
  implicit none
  private
  public :: cpl_solver_type, side_grains, side_solid, sides

  integer(i4), parameter :: side_grains = 1, side_solid = 2
  character(len=6), parameter :: sides(2) = ['grains', 'solid ']
  integer(i4), parameter :: tail_lines = 12       !! of a log, shown with a fault
  real(wp), parameter :: end_wait = 5.0_wp        !! s until a partner that ended can be waited for

  !> One solver. `ask` is `send` and `receive`; both solvers may be sent to before either is read.
  type :: cpl_solver_type
    character(len=:), allocatable :: side     !! 'grains' or 'solid'
    character(len=:), allocatable :: program  !! 'talus-dem' or 'talus-fem'
    character(len=:), allocatable :: deck     !! path
    character(len=:), allocatable :: launch   !! fork, command or attach
    character(len=:), allocatable :: command  !! launcher and program, without deck
    character(len=:), allocatable :: output   !! file that takes its stdout and stderr
    character(len=:), allocatable :: restart  !! checkpoint to go on from, '' for a fresh run
    integer(i4) :: threads = 0
    type(process_type) :: process
    type(port_type) :: port
    type(message_type) :: request, reply
    logical :: started = .false.   !! its port is open, it is or will be there
    logical :: greeted = .false.   !! HELLO was answered
    logical :: lost = .false.      !! its port gave a fault: nothing more can be asked
    logical :: owes = .false.      !! a reply that nobody needs, to be read before the next request
    character(len=:), allocatable :: version, deck_hash, capabilities
    character(len=:), allocatable :: analysis  !! kind of a solid's analysis
    real(wp) :: gravity(3) = 0.0_wp  !! m/s2
    real(wp) :: time = 0.0_wp        !! s
    real(wp) :: t_end = 0.0_wp       !! s, 0: none given
    real(wp) :: step_limit = 0.0_wp  !! s
    real(wp) :: dt = 0.0_wp          !! step of its deck that must divide an interval [s], 0: none
    real(wp) :: motion(3) = [0.0_wp, 1.0_wp, 1.0_wp]  !! background damping of grains [1/s], factors
                                     !! on their masses and on their moments of inertia
    integer(i4) :: ranks = 1
    real(wp), allocatable :: memory(:)  !! of each rank as its check told [MiB]
    integer(i4) :: entities = 0      !! grains or nodes, as its check told
    real(wp) :: stood = 0.0_wp       !! it waited for the coupling so far [s]
    real(wp), private :: asked = 0.0_wp     !! wall clock when it was asked last [s]
  contains
    procedure :: start_request
    procedure :: send
    procedure :: receive
    procedure :: ask
    procedure :: describe
    procedure :: start_select
    procedure :: can
    procedure :: title
  end type cpl_solver_type

contains

  !> Begin a request about the interval t0 to t1 [s].
  subroutine start_request(self, verb, step, t0, t1)
    class(cpl_solver_type), intent(inout) :: self
    integer(i4), intent(in) :: verb
    integer(i8), intent(in) :: step
    real(wp), intent(in) :: t0, t1
    call self%request%start(verb, step, t0, t1)
  end subroutine start_request

  !> Send a request. Where cores are short the solver that wakes up may take ours at once, so
  !! that this, too, is a wait for it.
  subroutine send(self, timers, errors)
    class(cpl_solver_type), intent(inout) :: self
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: faults
    if (self%owes) call self%receive(timers, errors)
    if (self%lost) return
    call timers%start('waiting for '//self%side)
    call self%port%send(self%request, faults)
    self%asked = wall_clock()
    call timers%stop('waiting for '//self%side)
    if (faults%any()) call say_how_it_ended(self, faults)
    call errors%take(faults)
  end subroutine send

  !> Wait for the reply; the wait is put on the solver's timer. A fault that the solver reports is
  !! passed on as it is.
  subroutine receive(self, timers, errors)
    class(cpl_solver_type), intent(inout) :: self
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: faults
    self%owes = .false.
    if (self%lost) return
    call timers%start('waiting for '//self%side)
    call self%port%receive(self%reply, faults)
    call timers%stop('waiting for '//self%side)
    if (.not. faults%any()) call note_standing(self, timers)
    if (faults%any()) then
      call say_how_it_ended(self, faults)
    else
      call self%reply%faults(faults)
      if (faults%any()) then
        faults%item(1)%message = self%program//': '//faults%item(1)%message
        if (len(faults%item(1)%place) == 0) faults%item(1)%place = self%deck
      end if
    end if
    call errors%take(faults)
  end subroutine receive

  !> The solver waited until it was asked: for the coupling, but for the time in which that
  !! waited for the other side.
  subroutine note_standing(self, timers)
    type(cpl_solver_type), intent(inout) :: self
    type(timers_type), intent(inout) :: timers
    integer(i4) :: other, number
    other = merge(side_solid, side_grains, self%side == sides(side_grains))
    call timers%index('waiting for '//trim(sides(other)), number)
    self%stood = self%stood + max(0.0_wp, self%reply%waited - &
      timers%within(number, self%asked - self%reply%waited, self%asked))
  end subroutine note_standing

  subroutine ask(self, timers, errors)
    class(cpl_solver_type), intent(inout) :: self
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: faults
    faults = errors%count
    call self%send(timers, errors)
    if (errors%count == faults) call self%receive(timers, errors)
  end subroutine ask

  !> Ask DESCRIBE `what`, of a group unless its name is empty.
  subroutine describe(self, what, group, timers, errors)
    class(cpl_solver_type), intent(inout) :: self
    character(len=*), intent(in) :: what, group
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call self%start_request(verb_describe, 0_i8, self%time, self%time)
    call self%request%put_text(field_what, what)
    if (len(group) > 0) call self%request%put_text(field_group, group)
    call self%ask(timers, errors)
  end subroutine describe

  !> Begin a SELECT: entities `id` as a set with a role, and the fields wanted of it.
  subroutine start_select(self, step, set, role, id, fields)
    class(cpl_solver_type), intent(inout) :: self
    integer(i8), intent(in) :: step
    character(len=*), intent(in) :: set
    integer(i4), intent(in) :: role  !! role_... of talus_port_names
    integer(i8), intent(in) :: id(:)
    character(len=*), intent(in), optional :: fields  !! with commas between
    call self%start_request(verb_select, step, self%time, self%time)
    call self%request%put_text(field_set, set)
    call self%request%put_text(field_role, role_name(role))
    call self%request%put_int(field_id, id)
    if (present(fields)) call self%request%put_text(field_fields, fields)
  end subroutine start_select

  !> A fault of the port: add how the process ended and the end of what it wrote. Before HELLO its
  !! own exit code 1 or 2 is passed on (I420, N421).
  subroutine say_how_it_ended(self, errors)
    class(cpl_solver_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors  !! the first is it
    character(len=:), allocatable :: tail
    logical :: ended

    self%lost = .true.
    if (self%launch == 'attach') return
    ended = self%process%wait(merge(end_wait, 0.0_wp, errors%item(1)%code == 'P001'))
    tail = tail_of(self%output, tail_lines)
    associate (fault => errors%item(1))
      if (ended) fault%message = fault%message//': '//self%process%epitaph()
      if (.not. self%greeted .and. self%process%ended) then
        if (self%process%exit_code == 1) fault%code = 'I420'
        if (self%process%exit_code == 2) fault%code = 'N421'
        if (self%process%exit_code == 1 .or. self%process%exit_code == 2) &
          fault%hint = 'its output is above; `'//self%program//' --check '//self%deck// &
          '` says all'
      end if
      fault%place = self%output
      if (fault%code == 'I420') fault%place = self%deck
      if (len(tail) > 0) fault%place = fault%place//', the end of its output:'//new_line('a')// &
        without_end(tail)
    end associate
  end subroutine say_how_it_ended

  pure function without_end(text) result(shorter)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: shorter
    shorter = text
    if (len(text) > 0) then
      if (text(len(text):) == new_line('a')) shorter = text(:len(text) - 1)
    end if
  end function without_end

  !> Does HELLO's list of capabilities hold this word?
  pure logical function can(self, word)
    class(cpl_solver_type), intent(in) :: self
    character(len=*), intent(in) :: word
    character(len=:), allocatable :: list
    integer :: k
    can = .false.
    if (.not. allocated(self%capabilities)) return
    list = ' '//self%capabilities//' '
    do k = 1, len(list)
      if (list(k:k) == ',' .or. list(k:k) == new_line('a')) list(k:k) = ' '
    end do
    can = index(list, ' '//word//' ') > 0
  end function can

  !> 'talus-dem (grains.nml)'
  pure function title(self) result(text)
    class(cpl_solver_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = self%program//' ('//self%deck//')'
  end function title
end module cpl_solver
