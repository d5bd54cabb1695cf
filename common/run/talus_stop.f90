!> When to stop before the end: a signal, the wall limit, or a stop file.
!!
!! check() is cheap enough for every step. A stop file is removed when it is seen, so that the
!! restarted run does not stop at once; one too large for a sign is somebody's data, and stays.
module talus_stop
  use talus_kinds, only: wp, i4, i8
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, file_size, remove_file
  use talus_system, only: install_signals, signal_seen, signal_checkpoint, wall_clock
  use talus_text, only: str
  implicit none
  private
  public :: stop_type, stop_none, stop_signal, stop_wall, stop_file

  integer(i4), parameter :: stop_none = 0    !! go on
  integer(i4), parameter :: stop_signal = 1  !! SIGINT, SIGTERM, SIGQUIT or SIGHUP
  integer(i4), parameter :: stop_wall = 2    !! the wall limit is reached
  integer(i4), parameter :: stop_file = 3    !! the stop file is there

  integer(i8), parameter :: largest_sign = 4096_i8       !! bytes of a stop file that is removed
  real(wp), parameter :: check_interval = 0.5_wp         !! [s] between checks of the stop file

  !> Reasons to stop that are watched.
  type :: stop_type
    real(wp) :: wall_limit = 0.0_wp                  !! [s], 0 none
    character(len=:), allocatable :: file            !! empty none
    integer(i4) :: reason = stop_none                !! first reason met; it stays
    real(wp), private :: begun = 0.0_wp              !! wall clock at init [s]
    real(wp), private :: looked = 0.0_wp             !! wall clock at the last check [s]
  contains
    procedure :: init
    procedure :: read => read_stops
    procedure :: check
    procedure :: checkpoint_asked
    procedure :: elapsed
    procedure :: wall_end
    procedure :: text => reason_text
  end type stop_type

contains

  !> Watch for what &run of the deck says; a run under a coupler has no limits of its own. A stop
  !! file that is there already and holds something is refused (D027), as it would be removed.
  subroutine read_stops(self, deck, served, errors)
    class(stop_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served  !! the run is a partner's
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: file
    real(wp) :: wall_limit

    wall_limit = 0.0_wp
    file = ''
    if (.not. served) then
      call deck%get('run', 1, 'wall_limit', wall_limit)
      call deck%get('run', 1, 'stop_file', file)
      if (len(file) > 0) file = deck%path('run', 1, 'stop_file')
    end if
    if (len(file) > 0) then
      if (file_exists(file) .and. file_size(file) > 0) call deck%fault(errors, 'D027', &
        "the stop file '"//file//"' is there and holds "//str(file_size(file))// &
        ' bytes: it would be removed', 'run', 1, 'stop_file', &
        'give a name that no other file has; remove a sign that was left behind')
    end if
    call self%init(wall_limit, file, obey_signals=.not. served)
  end subroutine read_stops

  !> Watch from here on. A run under a coupler obeys no signals: they are the coupler's.
  subroutine init(self, wall_limit, file, obey_signals)
    class(stop_type), intent(inout) :: self
    real(wp), intent(in) :: wall_limit    !! [s] from now, 0 or less: none
    character(len=*), intent(in) :: file  !! name of the stop file, empty: none
    logical, intent(in), optional :: obey_signals  !! default .true.
    logical :: obey
    obey = .true.
    if (present(obey_signals)) obey = obey_signals
    self%wall_limit = wall_limit
    self%file = file
    self%reason = stop_none
    self%begun = wall_clock()
    self%looked = self%begun - 2.0_wp*check_interval
    call install_signals(obey)
  end subroutine init

  !> Reason to stop now, stop_none to go on.
  integer(i4) function check(self)
    class(stop_type), intent(inout) :: self
    real(wp) :: now

    check = self%reason
    if (self%reason /= stop_none) return
    now = wall_clock()
    if (signal_seen() /= 0) then
      self%reason = stop_signal
    else if (self%wall_limit > 0.0_wp .and. now - self%begun >= self%wall_limit) then
      self%reason = stop_wall
    else if (now - self%looked >= check_interval) then
      self%looked = now
      if (len(self%file) > 0) call check_file(self)
    end if
    check = self%reason
  end function check

  !> Stop, and remove the file, if the stop file exists.
  subroutine check_file(self)
    class(stop_type), intent(inout) :: self

    if (.not. file_exists(self%file)) return
    self%reason = stop_file
    if (file_size(self%file) <= largest_sign) call remove_file(self%file)
  end subroutine check_file

  !> True once after SIGUSR1: write a checkpoint and go on.
  logical function checkpoint_asked(self)
    class(stop_type), intent(in) :: self
    checkpoint_asked = signal_checkpoint()
  end function checkpoint_asked

  !> Wall time since init [s].
  real(wp) function elapsed(self)
    class(stop_type), intent(in) :: self
    elapsed = wall_clock() - self%begun
  end function elapsed

  !> Wall clock at which the wall limit is reached [s]; 0: none.
  real(wp) function wall_end(self)
    class(stop_type), intent(in) :: self
    wall_end = 0.0_wp
    if (self%wall_limit > 0.0_wp) wall_end = self%begun + self%wall_limit
  end function wall_end

  !> The reason in words: 'signal SIGTERM', 'wall limit of 3600 s', "stop file 'stop'".
  function reason_text(self) result(text)
    class(stop_type), intent(in) :: self
    character(len=:), allocatable :: text
    select case (self%reason)
    case (stop_signal)
      text = 'signal '//signal_name(signal_seen())
    case (stop_wall)
      text = 'wall limit of '//str(self%wall_limit)//' s'
    case (stop_file)
      text = "stop file '"//self%file//"'"
    case default
      text = ''
    end select
  end function reason_text

  function signal_name(number) result(name)
    integer(i4), intent(in) :: number
    character(len=:), allocatable :: name
    select case (number)
    case (1)
      name = 'SIGHUP'
    case (2)
      name = 'SIGINT'
    case (3)
      name = 'SIGQUIT'
    case default
      name = 'SIGTERM'
    end select
  end function signal_name
end module talus_stop
