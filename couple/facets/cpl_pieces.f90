!> Into how many pieces an exchange is divided: few where the solid carries what the ghosts bring,
!! many where it lags behind (theory: facet coupling, Why springs).
module cpl_pieces
  use talus_kinds, only: wp, i4
  use cpl_lag, only: lag_limit
  implicit none
  private
  public :: pieces_type

  real(wp), parameter :: newest = 0.3_wp  !! share of the last exchange in the mean of the lag
  real(wp), parameter :: aim = 0.7_wp     !! of the limit, where the number is changed
  integer(i4), parameter :: settling = 10 !! pieces that do not count after they got longer
  integer(i4), parameter :: longest = 128 !! exchanges before fewer are tried once more

  !> The lag falls with the square of a piece: its mean says what another number would give.
  type :: pieces_type
    integer(i4) :: most = 1             !! of the deck; numbers are its divisors
    integer(i4) :: now = 1              !! in the next exchange
    integer(i4) :: rest = 0             !! exchanges until the lag counts again
    integer(i4) :: wait = 0             !! exchanges until fewer are tried
    integer(i4) :: patience = 2         !! the last such wait
    logical :: changed = .false.        !! the last piece had another length than the next one
    real(wp) :: lag = 0.0_wp            !! force lag that counts: the last, or the mean of many [-]
  contains
    procedure :: begin
    procedure :: choose
    procedure :: kept
    procedure :: resume
  end type pieces_type

contains

  !> As many as the deck allows: what comes first is not known.
  pure subroutine begin(self, most)
    class(pieces_type), intent(inout) :: self
    integer(i4), intent(in) :: most
    self%most = most
    self%now = most
    self%lag = 0.0_wp
  end subroutine begin

  !> The number for the next exchange, after one with this lag. longer: a piece over one of before.
  pure subroutine choose(self, lag, longer)
    class(pieces_type), intent(inout) :: self
    real(wp), intent(in) :: lag      !! mean of the pieces [-]
    real(wp), intent(out) :: longer
    integer(i4) :: before
    before = self%now
    longer = 1.0_wp
    self%changed = .false.
    self%rest = max(self%rest - 1, 0)
    self%wait = max(self%wait - 1, 0)
    if (self%rest > 0) return
    self%lag = max(lag, self%lag + newest*(lag - self%lag))  ! more at once, fewer after a while
    if (self%lag > lag_limit) then
      do while (self%now < self%most)
        self%now = next(self, 1_i4)
        if (foreseen(self, before) <= aim*lag_limit) exit
      end do
    else if (self%now > 1 .and. self%wait == 0) then
      self%now = next(self, -1_i4)
      if (foreseen(self, before) > aim*lag_limit) self%now = before
    end if
    self%lag = foreseen(self, before)
    self%changed = self%now /= before
    if (self%now < before) self%rest = 1 + settling/self%now
    if (self%now > before) then
      self%patience = min(2*self%patience, longest)
      self%wait = self%patience
    end if
    longer = real(before, wp)/self%now
  end subroutine choose

  !> What a checkpoint keeps.
  pure function kept(self) result(number)
    class(pieces_type), intent(in) :: self
    real(wp) :: number(6)
    number(:4) = real([self%now, self%rest, self%wait, self%patience], wp)
    number(5:) = [merge(1.0_wp, 0.0_wp, self%changed), self%lag]
  end function kept

  !> Go on with it; a number that is no longer a divisor gives way to the most.
  pure subroutine resume(self, number)
    class(pieces_type), intent(inout) :: self
    real(wp), intent(in) :: number(6)
    self%now = nint(number(1))
    self%rest = nint(number(2))
    self%wait = nint(number(3))
    self%patience = nint(number(4))
    self%changed = number(5) > 0.5_wp
    self%lag = number(6)
    if (self%now < 1) self%now = self%most
    if (mod(self%most, self%now) /= 0) self%now = self%most
  end subroutine resume

  !> Mean of the lag if there were so many pieces as now, and not those of before [-].
  pure real(wp) function foreseen(self, before)
    class(pieces_type), intent(in) :: self
    integer(i4), intent(in) :: before
    foreseen = self%lag*(real(before, wp)/self%now)**2
  end function foreseen

  !> The next divisor above (way = 1) or below (-1) the number of now, which is not the last one.
  pure integer(i4) function next(self, way)
    class(pieces_type), intent(in) :: self
    integer(i4), intent(in) :: way
    next = self%now + way
    do while (mod(self%most, next) /= 0)
      next = next + way
    end do
  end function next
end module cpl_pieces
