!> Does the exchange converge? The force lag over windows of exchanges, and one warning if it stays.
!! eq. C.3
module cpl_lag
  use talus_kinds, only: wp, i4, i8
  use talus_log, only: short_number
  use cpl_choices, only: interface_aitken, interface_springs, interface_theta, scheme_iterated
  implicit none
  private
  public :: lag_type, lag_limit, shorter_exchange

  real(wp), parameter :: lag_limit = 0.02_wp !! of the force lag, worth a warning [-]
  integer(i4), parameter :: half = 25        !! exchanges in half a window
  real(wp), parameter :: falling = 0.8_wp    !! second half over first: it is settling

  type :: lag_type
    real(wp) :: now = 0.0_wp                 !! of the last exchange [-]
    real(wp) :: mean = 0.0_wp                !! over the last half window [-]
    integer(i8) :: stalls = 0                !! windows in which it was large all along
    logical :: warned = .false.              !! the warning was given
    integer(i4), private :: count = 0        !! in the window
    real(wp), private :: first = 0.0_wp, second = 0.0_wp  !! sums of the halves
    real(wp), private :: lagging = 0.0_wp, force = 0.0_wp !! sums since the start or restart [N]
  contains
    procedure :: note
    procedure :: overall
    procedure :: warning
  end type lag_type

contains

  !> The lag of one more exchange.
  pure subroutine note(self, lag, force)
    class(lag_type), intent(inout) :: self
    real(wp), intent(in) :: lag
    real(wp), intent(in) :: force  !! of a ghost in the mean [N]
    self%now = lag
    self%lagging = self%lagging + lag*force
    self%force = self%force + force
    self%count = self%count + 1
    if (self%count <= half) then
      self%first = self%first + lag
    else
      self%second = self%second + lag
    end if
    if (self%count < 2*half) then
      if (self%count == half) self%mean = self%first/half
      return
    end if
    self%mean = self%second/half
    if (min(self%first, self%second) > half*lag_limit .and. &
        self%second > falling*self%first) self%stalls = self%stalls + 1
    self%count = 0
    self%first = 0.0_wp
    self%second = 0.0_wp
  end subroutine note

  !> What of all forces was not carried: exchanges that load much weigh much.
  pure real(wp) function overall(self)
    class(lag_type), intent(in) :: self
    overall = 0.0_wp
    if (self%force > 0.0_wp) overall = self%lagging/self%force
  end function overall

  !> Warning for the log, once: empty when all is well or it was given.
  function warning(self, method, scheme, exchange) result(text)
    class(lag_type), intent(inout) :: self
    integer(i4), intent(in) :: method, scheme
    real(wp), intent(in) :: exchange  !! interval of the deck [s]
    character(len=:), allocatable :: text
    text = ''
    if (self%warned .or. self%stalls == 0) return
    self%warned = .true.
    text = 'the solid lags behind the grains: '//short_number(100.0_wp*self%mean)// &
      ' % of the ghosts'' force are not carried, and this has not fallen over '// &
      short_number(real(2*half, wp))//' exchanges: '
    if (scheme == scheme_iterated) then
      text = text//'lower &clock tolerance'
    else if (method == interface_aitken) then
      text = text//"interface = 'aitken' with scheme = 'average' ends in a limit cycle here; "// &
        "write interface = 'springs', or scheme = 'iterated'"
    else if (method == interface_springs .or. method == interface_theta) then
      text = text//'the wall moves too slowly; '//shorter_exchange(self%mean, exchange)// &
        ", or write pieces = 10 in &clock, or scheme = 'iterated'"
    else
      text = text//"write interface = 'springs', or shorten &clock exchange"
    end if
  end function warning

  !> What would bring the lag to its limit; it falls with the square of the exchange.
  function shorter_exchange(lag, exchange) result(text)
    real(wp), intent(in) :: lag       !! [-]
    real(wp), intent(in) :: exchange  !! interval of the deck [s]
    character(len=:), allocatable :: text
    text = '&clock exchange = '//short_number(exchange*sqrt(lag_limit/lag))// &
      ' would bring it to '//short_number(100.0_wp*lag_limit)//' %'
  end function shorter_exchange
end module cpl_lag
