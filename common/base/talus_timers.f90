!> Named timers: how the wall time of a run is spent.
!!
!! Timers are made once by name and used by number; they do not nest (a start inside another timer
!! counts in both, and the shares then add up to more than the whole).
module talus_timers
  use talus_kinds, only: wp, i4, i8
  use talus_system, only: wall_clock
  use talus_text, only: str, string_type, append_string
  implicit none
  private
  public :: timers_type

  integer(i4), parameter :: most = 64  !! timers of one program
  integer(i4), parameter :: recent = 8 !! intervals that a timer remembers

  type :: timer_type
    character(len=32) :: name = ''
    real(wp) :: total = 0.0_wp    !! [s]
    real(wp) :: begun = -1.0_wp   !! wall clock at start, negative while stopped
    integer(i8) :: calls = 0
    real(wp) :: span(2, recent) = 0.0_wp  !! wall clock at start and stop of the last ones
  end type timer_type

  !> All timers of a program, and the time since they were set up.
  type :: timers_type
    integer(i4) :: count = 0
    type(timer_type), private :: timer(most)
    real(wp), private :: begun = 0.0_wp
  contains
    procedure :: init
    procedure :: index => timer_index
    procedure, private :: start_number, start_name, stop_number, stop_name
    generic :: start => start_number, start_name
    generic :: stop => stop_number, stop_name
    procedure :: seconds
    procedure :: within
    procedure :: name => timer_name
    procedure :: elapsed
    procedure :: table
  end type timers_type

contains

  !> The whole time counts from here.
  subroutine init(self)
    class(timers_type), intent(inout) :: self
    self%begun = wall_clock()
    self%count = 0
  end subroutine init

  !> Number of the timer of this name; made when it is new.
  subroutine timer_index(self, name, number)
    class(timers_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: number
    do number = 1, self%count
      if (self%timer(number)%name == name) return
    end do
    if (self%count == most) error stop 'bug: more timers than talus_timers holds'
    self%count = self%count + 1
    self%timer(self%count) = timer_type(name=name)
  end subroutine timer_index

  subroutine start_number(self, number)
    class(timers_type), intent(inout) :: self
    integer(i4), intent(in) :: number
    self%timer(number)%begun = wall_clock()
  end subroutine start_number

  subroutine stop_number(self, number)
    class(timers_type), intent(inout) :: self
    integer(i4), intent(in) :: number
    real(wp) :: now
    associate (timer => self%timer(number))
      if (timer%begun < 0.0_wp) return
      now = wall_clock()
      timer%total = timer%total + (now - timer%begun)
      timer%span(:, 1 + int(mod(timer%calls, int(recent, i8)))) = [timer%begun, now]
      timer%calls = timer%calls + 1
      timer%begun = -1.0_wp
    end associate
  end subroutine stop_number

  subroutine start_name(self, name)
    class(timers_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4) :: number
    call self%index(name, number)
    call self%start(number)
  end subroutine start_name

  subroutine stop_name(self, name)
    class(timers_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4) :: number
    call self%index(name, number)
    call self%stop(number)
  end subroutine stop_name

  !> Time on a timer so far [s].
  pure real(wp) function seconds(self, number)
    class(timers_type), intent(in) :: self
    integer(i4), intent(in) :: number
    seconds = self%timer(number)%total
  end function seconds

  !> Time on a timer between two readings of the wall clock not long ago [s].
  pure real(wp) function within(self, number, from, to)
    class(timers_type), intent(in) :: self
    integer(i4), intent(in) :: number
    real(wp), intent(in) :: from, to
    integer(i4) :: k
    within = 0.0_wp
    associate (span => self%timer(number)%span)
      do k = 1, recent
        within = within + max(0.0_wp, min(to, span(2, k)) - max(from, span(1, k)))
      end do
    end associate
  end function within

  pure function timer_name(self, number) result(name)
    class(timers_type), intent(in) :: self
    integer(i4), intent(in) :: number
    character(len=:), allocatable :: name
    name = trim(self%timer(number)%name)
  end function timer_name

  !> Wall time since init [s].
  real(wp) function elapsed(self)
    class(timers_type), intent(in) :: self
    elapsed = wall_clock() - self%begun
  end function elapsed

  !> Lines 'name  seconds  share  calls', longest first, the rest and the whole at the end.
  subroutine table(self, lines)
    class(timers_type), intent(in) :: self
    type(string_type), allocatable, intent(out) :: lines(:)
    logical :: shown(most)
    integer(i4) :: k, n
    real(wp) :: whole, rest

    allocate (lines(0))
    whole = max(self%elapsed(), tiny(1.0_wp))
    rest = whole
    shown = .false.
    call append_string(lines, '  timer                             time [s]    share      calls')
    do n = 1, self%count
      k = int(maxloc(self%timer(:self%count)%total, 1, .not. shown(:self%count)), i4)
      shown(k) = .true.
      rest = rest - self%timer(k)%total
      call append_string(lines, table_line(self%timer(k)%name, self%timer(k)%total, whole)// &
                         calls_text(self%timer(k)%calls))
    end do
    call append_string(lines, table_line('(rest)', max(rest, 0.0_wp), whole))
    call append_string(lines, table_line('(whole)', whole, whole))
  end subroutine table

  pure function table_line(name, time, whole) result(line)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: time, whole  !! [s]
    character(len=:), allocatable :: line
    character(len=80) :: buffer
    write (buffer, '(2x, a30, f12.3, f8.1, " %")') adjustl(name//repeat(' ', 30)), time, &
      100.0_wp*time/whole
    line = trim(buffer)
  end function table_line

  pure function calls_text(calls) result(text)
    integer(i8), intent(in) :: calls
    character(len=:), allocatable :: text
    text = str(calls)
    text = repeat(' ', max(1, 11 - len(text)))//text
  end function calls_text
end module talus_timers
