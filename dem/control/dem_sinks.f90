!> Sinks: free grains whose centres lie in a region leave the run (theory-dem, Sources and sinks).
!!
!! What has left so far is part of the state (drained). eq. D.23
module dem_sinks
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use talus_region, only: region_type
  use talus_region_deck, only: read_region
  use dem_cell, only: folded
  use dem_clock, only: interval_ends
  use dem_breakage_masses, only: counted_mass
  use dem_state, only: kind_free
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: dem_sinks_type

  integer(i4), parameter :: drained_grains = 1, drained_mass = 2, drained_momentum(2) = [3, 5], &
                            drained_energy = 6
  real(wp), parameter :: near = 1.0e-6_wp  !! what counts as on time, in intervals
  character(len=18), parameter :: columns(8) = [character(len=18) :: 'time [s]', 'sink [-]', &
    'grains [-]', 'mass [kg]', 'momentum_x [N s]', 'momentum_y [N s]', 'momentum_z [N s]', &
    'energy [J]']

  !> One sink: a region, or all beyond a plane.
  type :: sink_type
    character(len=:), allocatable :: id
    logical :: beyond = .false.         !! the plane
    type(region_type) :: region
    real(wp) :: point(3) = 0.0_wp       !! of the plane [m]
    real(wp) :: normal(3) = 0.0_wp      !! out of the run [-]
    real(wp) :: begin = 0.0_wp          !! [s]
    real(wp) :: every = 0.0_wp          !! [s]
  end type sink_type

  type :: dem_sinks_type
    type(sink_type), allocatable :: item(:)
    type(history_type) :: history
  contains
    procedure :: read => read_sinks
    procedure :: update
    procedure :: text => sinks_text
    procedure :: open => open_history
    procedure :: write => write_rows
    procedure, private :: drain
  end type dem_sinks_type

contains

  !> All &sink groups (D261).
  subroutine read_sinks(self, deck, errors)
    class(dem_sinks_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kind
    real(wp), allocatable :: three(:)
    integer(i4) :: k
    allocate (self%item(deck%count('sink')))
    do k = 1, size(self%item)
      associate (sink => self%item(k))
        call deck%get('sink', k, 'id', sink%id)
        call deck%get('sink', k, 'start', sink%begin)
        call deck%get('sink', k, 'every_time', sink%every)
        call deck%get('sink', k, 'region', kind)
        sink%beyond = kind == 'plane'
        if (.not. sink%beyond) then
          call read_region(deck, 'sink', k, 'D261', sink%region, errors)
          cycle
        end if
        call deck%get('sink', k, 'point', three)
        sink%point = three
        call deck%get('sink', k, 'normal', three)
        sink%normal = three
        if (.not. norm2(three) > 0.0_wp) &
          call deck%fault(errors, 'D261', 'the normal has no length', 'sink', k, 'normal', &
                          'it points to where grains leave, for example 0.0, 0.0, -1.0')
      end associate
    end do
  end subroutine read_sinks

  !> Grains that have come into a sink leave at this time.
  subroutine update(self, system, unit, turns)
    class(dem_sinks_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    real(wp), intent(in) :: unit         !! of time [s]
    integer(i8), intent(in) :: turns(2)  !! units until now, and at the last update
    integer(i8) :: each
    integer(i4) :: k
    do k = 1, size(self%item)
      each = nint(self%item(k)%every/unit, i8)
      if (.not. interval_ends(turns, each)) cycle
      if (turns(1)*unit < self%item(k)%begin - near*unit) cycle
      call self%drain(k, system)
    end do
  end subroutine update

  !> Those in one sink.
  subroutine drain(self, k, system)
    class(dem_sinks_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    type(dem_system_type), intent(inout) :: system
    logical, allocatable :: leaving(:)
    real(wp), allocatable :: x(:, :)
    real(wp) :: before, momentum(3), mass
    integer(i4) :: i

    call system%gather()
    allocate (leaving(system%grains%n), source=.false.)
    allocate (x, source=folded(system%cell, system%grains%x))
    mass = 0.0_wp
    momentum = 0.0_wp
    do i = 1, system%grains%n
      if (system%grains%kind(i) /= kind_free) cycle
      leaving(i) = is_in(self%item(k), x(:, i))
      if (.not. leaving(i)) cycle
      mass = mass + counted_mass(system%dem_data_type, system%grains, i)
      momentum = momentum + system%grains%mass(i)*system%grains%v(:, i)
    end do
    if (.not. any(leaving)) return
    before = system%ledger%left
    call system%leave(leaving)
    system%drained(:, k) = system%drained(:, k) + &
      [real(count(leaving), wp), mass, momentum, system%ledger%left - before]
  end subroutine drain

  !> Does a centre lie in a sink?
  pure logical function is_in(sink, x)
    type(sink_type), intent(in) :: sink
    real(wp), intent(in) :: x(3)  !! [m]
    if (sink%beyond) then
      is_in = dot_product(x - sink%point, sink%normal) > 0.0_wp
    else
      is_in = sink%region%contains(x)
    end if
  end function is_in

  !> What has left, for the log.
  function sinks_text(self, k, system) result(text)
    class(dem_sinks_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(dem_system_type), intent(in) :: system
    character(len=:), allocatable :: text
    associate (drained => system%drained(:, k))
      text = str(nint(drained(drained_grains), i8))//' grains, '// &
        short_number(drained(drained_mass))//' kg'
    end associate
  end function sinks_text

  !> <stem>_sinks.csv, one row a time and a sink.
  subroutine open_history(self, stem, time, errors)
    class(dem_sinks_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (size(self%item) > 0) call self%history%begin(stem//'_sinks.csv', columns, time, errors)
  end subroutine open_history

  subroutine write_rows(self, time, system, errors)
    class(dem_sinks_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (.not. self%history%is_open()) return
    do k = 1, size(self%item)
      call self%history%write([time, real(k, wp), system%drained(:, k)], errors)
    end do
  end subroutine write_rows
end module dem_sinks
