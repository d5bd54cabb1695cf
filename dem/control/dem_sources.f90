!> Sources: grains that enter a run, one by one at a rate or as whole packings (theory-dem, Sources
!! and sinks).
!!
!! What has entered so far is part of the state (fed); sizes, orientations and places are hashes of
!! seed, number and time, so that a restart repeats them. eq. D.23
module dem_sources
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use talus_random, only: random_turn
  use dem_clock, only: interval_ends
  use dem_contacts, only: dem_contacts_type
  use dem_entry, only: size_batch, trim_batch, make_entering, check_ids
  use dem_packing, only: dem_packing_type
  use dem_source, only: source_type, read_source
  use dem_source_place, only: room_type, gather_neighbours, find_place
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_grains_type
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: dem_sources_type

  integer(i4), parameter :: fed_grains = 1, fed_mass = 2, fed_energy = 3, fed_waits = 4
  integer(i8), parameter :: how_turned = 4      !! what a random number is for
  real(wp), parameter :: near = 1.0e-6_wp       !! what counts as on time, in intervals
  character(len=18), parameter :: columns(6) = [character(len=18) :: 'time [s]', 'source [-]', &
    'grains [-]', 'mass [kg]', 'energy [J]', 'waits [-]']

  type :: dem_sources_type
    type(source_type), allocatable :: item(:)
    real(wp) :: overlap_limit = 0.0_wp  !! of entering grains, of the least semi-axis [-]
    type(history_type) :: history
  contains
    procedure :: read => read_sources
    procedure :: update
    procedure :: least_axis
    procedure :: shaped
    procedure :: text => sources_text
    procedure :: open => open_history
    procedure :: write => write_rows
    procedure, private :: feed
  end type dem_sources_type

contains

  !> All &source groups. The materials are numbers of those of the run.
  subroutine read_sources(self, deck, material, system, errors)
    class(dem_sources_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: material(:)  !! (sources)
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    allocate (self%item(deck%count('source')))
    do k = 1, size(self%item)
      self%item(k)%material = material(k)
      call read_source(deck, k, system%materials, self%item(k), errors)
    end do
    call deck%get('limits', 1, 'initial_overlap', self%overlap_limit)
  end subroutine read_sources

  !> Grains that are due at this time enter.
  subroutine update(self, system, unit, turns, path, errors)
    class(dem_sources_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    real(wp), intent(in) :: unit          !! of time [s]
    integer(i8), intent(in) :: turns(2)   !! units until now, and at the last update
    character(len=*), intent(in) :: path  !! of the deck
    type(error_list_type), intent(inout) :: errors
    real(wp) :: time
    integer(i4) :: k
    time = turns(1)*unit
    do k = 1, size(self%item)
      if (.not. interval_ends(turns, nint(self%item(k)%every/unit, i8))) cycle
      if (is_due(self%item(k), time, system%fed(:, k))) &
        call self%feed(k, system, time, path, errors)
      if (errors%any()) return
    end do
  end subroutine update

  !> Does a grain, or the whole packing, enter at this time, if there is room?
  pure logical function is_due(source, time, fed)
    type(source_type), intent(in) :: source
    real(wp), intent(in) :: time   !! [s]
    real(wp), intent(in) :: fed(:) !! so far
    real(wp) :: margin
    if (source%whole) then
      margin = near*source%every
      is_due = time >= source%begin - margin .and. time <= source%end + margin
    else
      is_due = owed(source, time, nint(fed(fed_grains), i8), fed(fed_mass))
    end if
  end function is_due

  !> Least semi-axis of any grain that may enter [m].
  pure real(wp) function least_axis(self)
    class(dem_sources_type), intent(in) :: self
    integer(i4) :: k
    least_axis = huge(1.0_wp)
    do k = 1, size(self%item)
      least_axis = min(least_axis, self%item(k)%least_axis())
    end do
  end function least_axis

  !> May a grain enter that is no ellipsoid?
  pure logical function shaped(self)
    class(dem_sources_type), intent(in) :: self
    integer(i4) :: k
    shaped = .false.
    do k = 1, size(self%item)
      shaped = shaped .or. self%item(k)%shaped()
    end do
  end function shaped

  !> Grains of one source enter.
  subroutine feed(self, k, system, time, path, errors)
    class(dem_sources_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    type(dem_system_type), intent(inout) :: system
    real(wp), intent(in) :: time
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(dem_packing_type) :: batch
    type(dem_grains_type) :: entering
    type(start_springs_type) :: springs
    real(wp) :: before
    logical :: waits

    call system%gather()
    waits = .false.
    if (self%item(k)%whole) then
      call take_packing(self%item(k), system, k, batch, springs)
    else
      call draw_grains(self%item(k), system, k, time, batch, waits)
    end if
    if (waits) system%fed(fed_waits, k) = system%fed(fed_waits, k) + 1.0_wp
    if (batch%n == 0) return
    call check_ids("source '"//self%item(k)%id//"'", batch, path, errors)
    if (errors%any()) return
    call make_entering(batch, self%item(k)%material, system, entering, errors)
    if (errors%any()) return
    before = system%ledger%entered
    call system%enter(entering, springs)
    system%fed(:fed_energy, k) = system%fed(:fed_energy, k) + &
      [real(batch%n, wp), sum(entering%mass), system%ledger%entered - before]
    call check_room(self, k, system, batch%id(1), path, errors)
  end subroutine feed

  !> A whole packing, once more, unless it would go beyond a limit; its spins and velocities are
  !! added to those of the source, its contacts keep their friction.
  subroutine take_packing(source, system, k, batch, springs)
    type(source_type), intent(in) :: source
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: k
    type(dem_packing_type), intent(out) :: batch
    type(start_springs_type), intent(out) :: springs
    integer(i8) :: first
    integer(i4) :: i

    associate (p => source%packing)
      if (system%fed(fed_grains, k) + p%n > source%most_grains) return
      if (system%fed(fed_mass, k) + sum(source%mass) > source%most_mass) return
      call size_batch(batch, p%n)
      first = system%last_id - minval(p%id) + 1
      batch%n = p%n
      batch%id = p%id + first
      do i = 1, p%n
        call copy_row(p, i, batch, i)
        batch%x(:, i) = p%x(:, i) + source%shift
        batch%quat(:, i) = p%quat(:, i)
        batch%v(:, i) = p%v(:, i) + source%velocity
        batch%omega(:, i) = p%omega(:, i) + source%spin
      end do
      springs = p%springs
      if (allocated(springs%ids)) springs%ids = springs%ids + first
    end associate
  end subroutine take_packing

  !> Grains that are due by the rate, as far as there is room for them.
  subroutine draw_grains(source, system, k, time, batch, waits)
    type(source_type), intent(in) :: source
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: time   !! [s]
    type(dem_packing_type), intent(out) :: batch
    logical, intent(out) :: waits  !! there was no room for all
    type(room_type) :: room
    real(wp) :: mass, scale, x(3)
    integer(i8) :: n, turn
    integer(i4) :: row
    logical :: found

    waits = .false.
    n = nint(system%fed(fed_grains, k), i8)
    mass = system%fed(fed_mass, k)
    turn = nint(time/source%every, i8)
    call gather_neighbours(system%dem_data_type, source%region, room)
    call size_batch(batch, 16)
    do
      if (.not. owed(source, time, n, mass)) exit
      row = max(source%row_of(n + 1), 1)
      scale = source%size_of(n + 1)
      call find_place(system%dem_data_type, room, source%radius(row)*scale, &
                      [source%seed, int(k, i8), n + 1, turn], source%tries, x, found)
      waits = .not. found
      if (waits) exit
      n = n + 1
      mass = mass + source%mass(row)*scale**3
      call room%add(x, source%radius(row)*scale)
      call enlist(source, row, scale, x, n, batch)
      batch%id(batch%n) = system%last_id + batch%n
    end do
    call trim_batch(batch, batch%n)
  end subroutine draw_grains

  !> Is one more grain due? By mass it is when half of it is; limits are not exceeded.
  pure logical function owed(source, time, n, mass)
    type(source_type), intent(in) :: source
    real(wp), intent(in) :: time  !! [s]
    integer(i8), intent(in) :: n  !! entered so far
    real(wp), intent(in) :: mass  !! of these [kg]
    real(wp) :: duration, next
    duration = min(time, source%end) - source%begin
    next = source%mass(max(source%row_of(n + 1), 1))*source%size_of(n + 1)**3
    if (source%mass_rate > 0.0_wp) then
      owed = mass + 0.5_wp*next <= source%mass_rate*duration
    else
      owed = real(n + 1, wp) <= source%number_rate*duration*(1.0_wp + near)
    end if
    owed = owed .and. real(n + 1, wp) <= source%most_grains .and. mass + next <= source%most_mass
  end function owed

  !> The n-th grain of a source.
  subroutine enlist(source, row, scale, x, n, batch)
    type(source_type), intent(in) :: source
    integer(i4), intent(in) :: row
    real(wp), intent(in) :: scale, x(3)
    integer(i8), intent(in) :: n
    type(dem_packing_type), intent(inout) :: batch
    integer(i4) :: i
    if (batch%n == size(batch%id)) call trim_batch(batch, 2*batch%n)
    batch%n = batch%n + 1
    i = batch%n
    batch%quat(:, i) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    batch%skew(:, i) = 0.0_wp
    batch%exponent(i) = 2.0_wp
    batch%axes(:, i) = scale*source%semi_axes
    if (source%packing%n > 0) then
      call copy_row(source%packing, row, batch, i)
      batch%quat(:, i) = source%packing%quat(:, row)
    end if
    if (source%turned) batch%quat(:, i) = random_turn([source%seed, how_turned, n])
    batch%x(:, i) = x
    batch%v(:, i) = source%velocity
    batch%omega(:, i) = source%spin
  end subroutine enlist

  !> Size and shape of a grain of a packing.
  pure subroutine copy_row(packing, row, batch, i)
    type(dem_packing_type), intent(in) :: packing
    integer(i4), intent(in) :: row, i
    type(dem_packing_type), intent(inout) :: batch
    batch%axes(:, i) = packing%axes(:, row)
    batch%skew(:, i) = packing%skew(:, row)
    batch%exponent(i) = packing%exponent(row)
  end subroutine copy_row

  !> Grains that have entered may overlap what is there no more than those of a packing at the start
  !! (N206).
  subroutine check_room(self, k, system, first, path, errors)
    class(dem_sources_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(dem_system_type), intent(in) :: system
    integer(i8), intent(in) :: first      !! id of the first of them
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(dem_contacts_type) :: list
    character(len=:), allocatable :: other
    integer(i4), allocatable :: grain(:)
    real(wp) :: ratio
    integer(i4) :: c

    call system%contacts(list)
    do c = 1, list%n
      if (list%ids(2, c) < first .or. list%ids(1, c) >= first) cycle
      call system%find(list%ids(2:2, c), grain, errors)
      ratio = list%overlap(c)/minval(system%grains%axes(:, grain(1)))
      if (ratio <= self%overlap_limit) cycle
      other = 'grain '//str(list%ids(1, c))
      if (list%ids(1, c) < 0) other = 'wall or surface '//str(-list%ids(1, c))
      call errors%add('N206', "source '"//self%item(k)%id//"': grain "//str(list%ids(2, c))// &
                      ' overlaps '//other//' by '//short_number(100.0_wp*ratio)// &
                      ' % of its least semi-axis as it enters', path, &
                      'a region that is clear of walls, surfaces and, with packings, of grains')
      return
    end do
  end subroutine check_room

  !> What has entered, for the log.
  function sources_text(self, k, system) result(text)
    class(dem_sources_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(dem_system_type), intent(in) :: system
    character(len=:), allocatable :: text
    associate (fed => system%fed(:, k))
      text = str(nint(fed(fed_grains), i8))//' grains, '//short_number(fed(fed_mass))//' kg'
      if (fed(fed_waits) > 0.0_wp) text = text//'; no room for all that were due at '// &
        str(nint(fed(fed_waits), i8))//' times'
    end associate
  end function sources_text

  !> <stem>_sources.csv, one row a time and a source.
  subroutine open_history(self, stem, time, errors)
    class(dem_sources_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (size(self%item) > 0) call self%history%begin(stem//'_sources.csv', columns, time, errors)
  end subroutine open_history

  subroutine write_rows(self, time, system, errors)
    class(dem_sources_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (.not. self%history%is_open()) return
    do k = 1, size(self%item)
      call self%history%write([time, real(k, wp), system%fed(:, k)], errors)
    end do
  end subroutine write_rows
end module dem_sources
