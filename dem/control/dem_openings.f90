!> Where a run is open: its sources and sinks of grains and its window, and when they act
!! (theory-dem, Sources and sinks, Moving window). Faults D262, D297.
module dem_openings
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: log_type
  use dem_shape_make, only: admit_shapes
  use dem_sinks, only: dem_sinks_type
  use dem_sources, only: dem_sources_type
  use dem_state, only: fed_size, drained_size
  use dem_system, only: dem_system_type
  use dem_window, only: dem_window_type
  implicit none
  private
  public :: dem_openings_type

  real(wp), parameter :: near = 1.0e-6_wp  !! what counts as a multiple
  character(len=9), parameter :: barred(3) = [character(len=9) :: 'surcharge', 'bond', 'probe']

  type :: dem_openings_type
    type(dem_sources_type) :: sources
    type(dem_sinks_type) :: sinks
    type(dem_window_type) :: window
    integer(i4) :: n = 0           !! of all
    real(wp) :: every = 0.0_wp     !! least interval [s]; 0: there are none
    character(len=:), allocatable :: path  !! of the deck
  contains
    procedure :: read => read_openings
    procedure :: update
    procedure :: log_totals
    procedure :: open => open_histories
    procedure :: write => write_histories
    procedure :: flush => flush_histories
    procedure :: close => close_histories
  end type dem_openings_type

contains

  !> Sources, sinks and window of the deck; the system is open from now on if there are any.
  subroutine read_openings(self, deck, materials, served, system, errors)
    class(dem_openings_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: materials(:)  !! of the packing and of each source
    logical, intent(in) :: served           !! a partner drives the run
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, before

    before = errors%count
    self%path = deck%source%path
    call self%sources%read(deck, materials(2:), system, errors)
    call self%sinks%read(deck, errors)
    call self%window%read(deck, materials(1), system, errors)
    self%n = size(self%sources%item) + size(self%sinks%item) + merge(1, 0, self%window%active)
    if (self%n == 0 .or. errors%count > before) return
    call check_intervals(self, deck, errors)
    if (served) call bar(deck, 'a partner counts on the grains that it knows', errors)
    if (self%window%active .and. self%n > 1) &
      call bar(deck, 'a window gives and takes all grains itself', errors)
    do k = 1, size(barred)
      if (deck%count(trim(barred(k))) > 0) &
        call bar(deck, '&'//trim(barred(k))//' counts on the grains of the start', errors)
    end do
    system%open = .true.
    system%coming_axis = self%sources%least_axis()
    if (self%sources%shaped()) call admit_shapes(system%grains, system%materials, errors)
    if (system%grains%n > 0) system%last_id = maxval(system%grains%id)
    allocate (system%fed(fed_size, size(self%sources%item)), source=0.0_wp)
    allocate (system%drained(drained_size, size(self%sinks%item)), source=0.0_wp)
  end subroutine read_openings

  !> Fault D297 at the first source or sink, or at the window.
  subroutine bar(deck, reason, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: reason
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: group
    group = 'window'
    if (deck%count('sink') > 0) group = 'sink'
    if (deck%count('source') > 0) group = 'source'
    call deck%fault(errors, 'D297', reason, group, 1, '', &
                    'leave one of the two out, or run in two stages: fill, then go on '// &
                    'from the packing')
  end subroutine bar

  !> All intervals are multiples of the least one (D262).
  subroutine check_intervals(self, deck, errors)
    class(dem_openings_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    self%every = huge(1.0_wp)
    do k = 1, size(self%sources%item)
      self%every = min(self%every, self%sources%item(k)%every)
    end do
    do k = 1, size(self%sinks%item)
      self%every = min(self%every, self%sinks%item(k)%every)
    end do
    if (self%window%active) self%every = min(self%every, self%window%every)
    do k = 1, size(self%sources%item)
      call check(self%sources%item(k)%every, 'source', k)
    end do
    do k = 1, size(self%sinks%item)
      call check(self%sinks%item(k)%every, 'sink', k)
    end do

  contains

    subroutine check(every, group, number)
      real(wp), intent(in) :: every
      character(len=*), intent(in) :: group
      integer(i4), intent(in) :: number
      real(wp) :: turns
      turns = every/self%every
      if (abs(turns - anint(turns)) <= near) return
      call deck%fault(errors, 'D262', 'the interval '//str(every)//' s is no multiple of the '// &
                      'least one, '//str(self%every)//' s', group, number, 'every_time', &
                      'take '//str(anint(turns)*self%every))
    end subroutine check
  end subroutine check_intervals

  !> Grains leave, then others enter, whatever is due. Have there been any?
  subroutine update(self, system, turns, changed, errors)
    class(dem_openings_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i8), intent(in) :: turns(2)  !! intervals until now, and at the last update; -1: none
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    real(wp) :: before(2)
    before = [sum(system%fed(1, :)), sum(system%drained(1, :))]
    call self%sinks%update(system, self%every, turns)
    call self%sources%update(system, self%every, turns, self%path, errors)
    changed = any(abs([sum(system%fed(1, :)), sum(system%drained(1, :))] - before) > 0.0_wp)
    if (self%window%active .and. .not. errors%any()) &
      call self%window%update(system, self%every, turns, changed, errors)
  end subroutine update

  !> What has entered and left, for the log.
  subroutine log_totals(self, log, system)
    class(dem_openings_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(in) :: system
    integer(i4) :: k
    do k = 1, size(self%sources%item)
      call log%line('source '//self%sources%item(k)%id//': '//self%sources%text(k, system))
    end do
    do k = 1, size(self%sinks%item)
      call log%line('sink '//self%sinks%item(k)%id//': '//self%sinks%text(k, system))
    end do
    if (self%window%active) call log%line('window: '//self%window%text(system))
  end subroutine log_totals

  subroutine open_histories(self, stem, time, errors)
    class(dem_openings_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    call self%sources%open(stem, time, errors)
    call self%sinks%open(stem, time, errors)
    call self%window%open(stem, time, errors)
  end subroutine open_histories

  subroutine write_histories(self, time, system, errors)
    class(dem_openings_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    call self%sources%write(time, system, errors)
    call self%sinks%write(time, system, errors)
    call self%window%write(time, system, errors)
  end subroutine write_histories

  subroutine flush_histories(self, errors)
    class(dem_openings_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%sources%history%flush(errors)
    call self%sinks%history%flush(errors)
    call self%window%history%flush(errors)
  end subroutine flush_histories

  subroutine close_histories(self, errors)
    class(dem_openings_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%sources%history%close(errors)
    call self%sinks%history%close(errors)
    call self%window%history%close(errors)
  end subroutine close_histories
end module dem_openings
