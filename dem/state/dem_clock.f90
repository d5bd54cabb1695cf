!> Simulated time, the time step, and when histories, fields and checkpoints are due.
!!
!! Time is base + count dt, so that a fixed step gathers no rounding. An automatic step is cut so
!! that steps end on multiples of the grid (the interval of histories, else output, else measures).
!! All data that determine a step are part of the state: a restart repeats the same steps.
module dem_clock
  use talus_intervals, only: intervals_until
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: dem_clock_type, event_history, event_output, event_checkpoint, event_measure
  public :: event_count, event_opening, interval_ends

  integer(i4), parameter :: event_history = 1, event_output = 2, event_checkpoint = 3
  integer(i4), parameter :: event_measure = 4, event_opening = 5
  integer(i4), parameter :: event_count = 5
  integer(i4), parameter :: check_steps = 100   !! steps between two checks of the step limit
  real(wp), parameter :: near = 1.0e-6_wp       !! what counts as on time, in steps
  real(wp), parameter :: growth = 1.1_wp        !! automatic step, largest growth in one go
  real(wp), parameter :: worth = 1.25_wp        !! it grows when the limit has grown by so much

  type :: dem_clock_type
    logical :: automatic = .false.        !! the program chooses dt
    real(wp) :: dt = 0.0_wp               !! present step [s]
    real(wp) :: base = 0.0_wp             !! time of the last change of step [s]
    integer(i8) :: count = 0              !! steps since
    integer(i8) :: steps = 0              !! steps since the start
    integer(i8) :: unstable = 0           !! checks at which a fixed step was above the limit
    real(wp) :: t_end = 0.0_wp            !! end of the run [s]
    real(wp) :: grid = 0.0_wp             !! automatic steps end on multiples [s]; 0: none
    real(wp) :: every(event_count) = 0.0_wp  !! intervals [s]; 0: never
    integer(i8) :: next(event_count) = 0     !! number of the next event
  contains
    procedure :: time
    procedure :: start_at
    procedure :: set_events
    procedure :: chosen_step
    procedure :: review_due
    procedure :: review
    procedure :: steps_ahead
    procedure :: advance
    procedure :: jump
    procedure :: due
    procedure :: turns
    procedure :: passed
    procedure :: on_time
    procedure :: finished
  end type dem_clock_type

contains

  pure real(wp) function time(self)
    class(dem_clock_type), intent(in) :: self
    time = self%base + real(self%count, wp)*self%dt
  end function time

  !> Begin (again) at a time with a step.
  pure subroutine start_at(self, t, dt)
    class(dem_clock_type), intent(inout) :: self
    real(wp), intent(in) :: t, dt
    self%base = t
    self%count = 0
    self%dt = dt
  end subroutine start_at

  !> Intervals of the events; events up to now have happened.
  pure subroutine set_events(self, every)
    class(dem_clock_type), intent(inout) :: self
    real(wp), intent(in) :: every(event_count)
    integer(i4) :: k
    self%every = every
    self%grid = every(event_history)
    if (.not. self%grid > 0.0_wp) self%grid = every(event_output)
    if (.not. self%grid > 0.0_wp) self%grid = every(event_measure)
    if (.not. self%grid > 0.0_wp) self%grid = every(event_opening)
    do k = 1, event_count
      call self%passed(k)
    end do
  end subroutine set_events

  !> Step not above the limit that ends on the grid; without grid the limit's first two digits.
  pure real(wp) function chosen_step(self, limit) result(dt)
    class(dem_clock_type), intent(in) :: self
    real(wp), intent(in) :: limit  !! s
    real(wp) :: rest, unit

    if (self%grid > 0.0_wp) then
      rest = (floor(self%time()/self%grid + near, i8) + 1)*self%grid - self%time()
      dt = rest/real(max(1_i8, ceiling(rest/limit - near, i8)), wp)
    else
      unit = 10.0_wp**(floor(log10(limit)) - 1)
      dt = unit*floor(limit/unit)
    end if
  end function chosen_step

  !> Is a check of the step limit due? On the grid, and every so many steps.
  pure logical function review_due(self)
    class(dem_clock_type), intent(in) :: self
    real(wp) :: cells
    review_due = modulo(self%steps, int(check_steps, i8)) == 0
    if (review_due .or. .not. self%grid > 0.0_wp) return
    cells = self%time()/self%grid
    review_due = abs(cells - anint(cells))*self%grid < near*self%dt
  end function review_due

  !> Compare the step with its limit: an automatic one follows, a fixed one is counted.
  pure subroutine review(self, automatic, stable)
    class(dem_clock_type), intent(inout) :: self
    real(wp), intent(in) :: automatic  !! step that an automatic choice would take [s]
    real(wp), intent(in) :: stable     !! stability limit [s]
    real(wp) :: dt

    if (.not. self%automatic) then
      if (self%dt > stable) self%unstable = self%unstable + 1
      return
    end if
    dt = self%dt
    if (automatic < self%dt) then
      dt = self%chosen_step(automatic)
    else if (automatic > worth*self%dt) then
      dt = self%chosen_step(min(automatic, growth*self%dt))
    end if
    if (abs(dt - self%dt) > near*self%dt) call self%start_at(self%time(), dt)
  end subroutine review

  !> Steps until the next event, the next check of the limits or the end, at least 1. Blocks end on
  !! multiples of `block`, which divides 100.
  pure integer(i4) function steps_ahead(self, block, t_end) result(n)
    class(dem_clock_type), intent(in) :: self
    integer(i4), intent(in) :: block
    real(wp), intent(in) :: t_end  !! s
    real(wp) :: until
    integer(i4) :: k

    until = t_end
    do k = 1, event_count
      if (self%every(k) > 0.0_wp) until = min(until, self%next(k)*self%every(k))
    end do
    if (self%automatic .and. self%grid > 0.0_wp) &
      until = min(until, (floor(self%time()/self%grid + near, i8) + 1)*self%grid)
    n = block - int(modulo(self%steps, int(block, i8)), i4)
    if (until - self%time() < real(n, wp)*self%dt) &
      n = ceiling((until - self%time())/self%dt - near)
    n = max(n, 1_i4)
  end function steps_ahead

  pure subroutine advance(self, n)
    class(dem_clock_type), intent(inout) :: self
    integer(i4), intent(in) :: n
    self%count = self%count + n
    self%steps = self%steps + n
  end subroutine advance

  !> After n steps of a partner's interval: exactly at t.
  pure subroutine jump(self, t, n)
    class(dem_clock_type), intent(inout) :: self
    real(wp), intent(in) :: t
    integer(i4), intent(in) :: n
    self%base = t
    self%count = 0
    self%steps = self%steps + n
  end subroutine jump

  pure logical function due(self, event)
    class(dem_clock_type), intent(in) :: self
    integer(i4), intent(in) :: event
    due = .false.
    if (self%every(event) > 0.0_wp) &
      due = self%time() >= self%next(event)*self%every(event) - near*self%dt
  end function due

  !> Number of an event that is due now, and of the last one that happened.
  pure function turns(self, event) result(number)
    class(dem_clock_type), intent(in) :: self
    integer(i4), intent(in) :: event
    integer(i8) :: number(2)
    number = [intervals_until(self%time() + near*self%dt, self%every(event)), self%next(event) - 1]
  end function turns

  !> Has an interval of `each` turns ended since the last update? At turn 0 the zeroth one has.
  pure logical function interval_ends(turns, each)
    integer(i8), intent(in) :: turns(2)  !! now, at the last update; -1: there was none
    integer(i8), intent(in) :: each
    interval_ends = turns(1)/each > turns(2)/each .or. turns(2) < 0
  end function interval_ends

  !> The event has happened (or is no longer requested): schedule the next one.
  pure subroutine passed(self, event)
    class(dem_clock_type), intent(inout) :: self
    integer(i4), intent(in) :: event
    if (self%every(event) > 0.0_wp) &
      self%next(event) = intervals_until(self%time() + near*self%dt, self%every(event)) + 1
  end subroutine passed

  !> Is an event due at the present time?
  pure logical function on_time(self, event)
    class(dem_clock_type), intent(in) :: self
    integer(i4), intent(in) :: event
    real(wp) :: turns
    on_time = .false.
    if (.not. self%every(event) > 0.0_wp) return
    turns = self%time()/self%every(event)
    on_time = abs(turns - anint(turns))*self%every(event) <= near*self%dt
  end function on_time

  pure logical function finished(self)
    class(dem_clock_type), intent(in) :: self
    finished = self%time() >= self%t_end - near*self%dt
  end function finished
end module dem_clock
