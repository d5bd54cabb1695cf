!> Measures of regions and coarse-grained fields (&measure and &grid), during the run and
!! afterwards. The formulas are those of common (talus_measures, talus_coarse).
!!
!! Faults: D260 name, D261 region, D262 interval, D263 grid.
module dem_measures
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_contact_measures, only: contact_columns, contact_row
  use talus_measures, only: request_type, measure_columns, measure_row, moduli_columns, &
    moduli_row, micro_columns, micro_row
  use talus_coarse, only: reach_of
  use talus_region, only: region_all, region_box
  use talus_region_deck, only: read_region
  use talus_sample, only: sample_type
  use dem_cell, only: is_periodic
  use dem_contact_file, only: dem_contact_file_type
  use dem_grids, only: dem_grid_type, read_grid
  use dem_sample, only: fill_sample
  use dem_state, only: kind_free
  use dem_tiles, only: tile
  use dem_system, only: dem_system_type, dem_contacts_type
  use dem_view, only: see_grains, see_contacts
  implicit none
  private
  public :: dem_measures_type

  real(wp), parameter :: near = 1.0e-6_wp  !! what counts as on time, in steps or intervals

  type :: measure_type
    character(len=:), allocatable :: id
    type(request_type) :: request
    logical :: moduli = .false.        !! write the affine moduli in full
    logical :: contacts = .false.      !! write what the contacts bear, and each of them
    real(wp) :: every = 0.0_wp         !! [s]; 0: first and last state only
    real(wp) :: last_time = -1.0_wp    !! of the last row [s]
    type(history_type) :: history, full, micro, bears
    type(dem_contact_file_type) :: each
  end type measure_type

  type :: dem_measures_type
    integer(i4) :: n = 0, grids = 0
    type(measure_type), allocatable :: item(:)
    type(dem_grid_type), allocatable :: grid(:)
    real(wp) :: every = 0.0_wp               !! least interval [s]; 0: none
    type(sample_type) :: sample
    type(sample_type) :: tiled               !! images around the regions of a periodic cell
    real(wp) :: grains(2) = 0.0_wp           !! lambda and mu of the free grains' material [Pa]
    logical, private :: opened = .false.
  contains
    procedure :: read => read_measures
    procedure :: open => open_measures
    procedure :: write => write_measures
    procedure :: flush => flush_measures
    procedure :: close => close_measures
    procedure, private :: write_sample
  end type dem_measures_type

contains

  !> Groups measure and grid.
  subroutine read_measures(self, deck, errors)
    class(dem_measures_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    self%n = deck%count('measure')
    self%grids = deck%count('grid')
    allocate (self%item(self%n), self%grid(self%grids))
    do k = 1, self%n
      call deck%get('measure', k, 'id', self%item(k)%id)
      call deck%get('measure', k, 'every_time', self%item(k)%every)
      call deck%get('measure', k, 'moduli', self%item(k)%moduli)
      call deck%get('measure', k, 'contacts', self%item(k)%contacts)
      call check_name(deck, 'measure', k, self%item(k)%id, errors)
      call read_request(deck, k, self%item(k)%request, errors)
    end do
    do k = 1, self%grids
      call read_grid(deck, k, self%grid(k), errors)
      call check_name(deck, 'grid', k, self%grid(k)%id, errors)
    end do
    self%every = least_interval(self)
    do k = 1, self%n
      call check_interval(deck, 'measure', k, self%item(k)%every, self%every, errors)
    end do
    do k = 1, self%grids
      call check_interval(deck, 'grid', k, self%grid(k)%every, self%every, errors)
    end do
  end subroutine read_measures

  !> Names make file names: letters, digits, _ and -, each once (D260).
  subroutine check_name(deck, group, k, id, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group, id
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: allowed = &
      'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-'
    character(len=:), allocatable :: other
    integer(i4) :: j

    if (len(id) == 0 .or. verify(id, allowed) > 0) &
      call deck%fault(errors, 'D260', "'"//id//"' cannot be part of a file name", group, k, 'id', &
                      'take letters, digits, _ and -')
    do j = 1, k - 1
      call deck%get(group, j, 'id', other)
      if (other == id) &
        call deck%fault(errors, 'D260', "there are two of the name '"//id//"'", group, k, 'id', &
                        'each has its own file: give it its own name')
    end do
  end subroutine check_name

  !> Least interval that was given [s], 0 if none was.
  pure real(wp) function least_interval(self) result(least)
    class(dem_measures_type), intent(in) :: self
    real(wp) :: every(self%n + self%grids)
    integer(i4) :: k
    every = [(self%item(k)%every, k=1, self%n), (self%grid(k)%every, k=1, self%grids)]
    least = 0.0_wp
    if (any(every > 0.0_wp)) least = minval(every, mask=every > 0.0_wp)
  end function least_interval

  !> Intervals are multiples of the least one (D262).
  subroutine check_interval(deck, group, k, every, least, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: every, least
    type(error_list_type), intent(inout) :: errors
    if (.not. every > 0.0_wp) return
    if (abs(every/least - anint(every/least)) > near) &
      call deck%fault(errors, 'D262', 'the interval '//str(every)//' s is no multiple of the '// &
                      'least one, '//str(least)//' s', group, k, 'every_time', &
                      'take '//str(anint(every/least)*least))
  end subroutine check_interval

  !> Region of a measure, and how it is measured (D261).
  subroutine read_request(deck, k, request, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(request_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: origin(:)
    call read_region(deck, 'measure', k, 'D261', request%region, errors)
    call deck%get('measure', k, 'resolution', request%resolution)
    request%has_origin = deck%given('measure', k, 'origin')
    if (.not. request%has_origin) return
    call deck%get('measure', k, 'origin', origin)
    request%origin = origin
  end subroutine read_request

  !> Begin the files, or go on in them after a restart at time >= 0.
  subroutine open_measures(self, stem, time, errors)
    class(dem_measures_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    real(wp) :: kept
    integer(i4) :: k

    do k = 1, self%n
      associate (item => self%item(k))
        kept = kept_time(time, item%every)
        call measure_columns(names)
        call item%history%begin(stem//'_measure_'//item%id//'.csv', names, kept, errors)
        if (item%moduli) call open_moduli(item, stem, kept, errors)
        if (item%contacts) then
          call contact_columns(names)
          call item%bears%begin(stem//'_contacts_'//item%id//'.csv', names, kept, errors)
          call item%each%open(stem//'_contacts_'//item%id, kept, errors)
        end if
        item%last_time = -1.0_wp
        if (kept >= time .and. time >= 0.0_wp) item%last_time = time
      end associate
    end do
    do k = 1, self%grids
      call self%grid(k)%open(stem, kept_time(time, self%grid(k)%every), errors)
    end do
    self%opened = .not. errors%any()
  end subroutine open_measures

  !> The files of affine moduli of a measure.
  subroutine open_moduli(item, stem, time, errors)
    type(measure_type), intent(inout) :: item
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! rows up to here are kept [s]
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    call moduli_columns(names)
    call item%full%begin(stem//'_moduli_'//item%id//'.csv', names, time, errors)
    call micro_columns(names)
    call item%micro%begin(stem//'_micromorphic_'//item%id//'.csv', names, time, errors)
  end subroutine open_moduli

  !> Rows up to here are in an uninterrupted run too: a last row off the interval is not.
  pure real(wp) function kept_time(time, every) result(kept)
    real(wp), intent(in) :: time, every
    kept = time
    if (.not. time > 0.0_wp) return
    if (every > 0.0_wp) then
      if (abs(time/every - anint(time/every)) <= near) return
    end if
    kept = time*(1.0_wp - epsilon(time))
  end function kept_time

  !> Measure what is due now, or (all) everything that was not measured at this time.
  subroutine write_measures(self, time, system, all, errors, list)
    class(dem_measures_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! s
    type(dem_system_type), intent(inout) :: system
    logical, intent(in) :: all
    type(error_list_type), intent(inout) :: errors
    type(dem_contacts_type), intent(in), optional :: list  !! instead of the system's own
    type(dem_contacts_type) :: now
    integer(i4) :: before

    if (.not. self%opened .or. self%n + self%grids == 0) return
    before = errors%count
    if (present(list)) then
      call fill_sample(system, list, self%sample, errors)
    else
      call see_grains(system)
      call see_contacts(system, now)
      call fill_sample(system, now, self%sample, errors)
    end if
    if (errors%count > before) return
    self%grains = moduli_of_grains(system)
    if (is_periodic(system%cell)) call fill_tiles(self, system)
    call self%write_sample(time, system%par%dt, is_periodic(system%cell), all, errors)
  end subroutine write_measures

  !> lambda and mu of the free grains, mean over their volume [Pa].
  pure function moduli_of_grains(system) result(mean)
    type(dem_system_type), intent(in) :: system
    real(wp) :: mean(2), mu, weight, total
    integer(i4) :: i
    mean = 0.0_wp
    total = 0.0_wp
    do i = 1, system%grains%n
      if (system%grains%kind(i) /= kind_free) cycle
      associate (m => system%materials(system%grains%material(i)))
        mu = 0.5_wp*m%young/(1.0_wp + m%poisson)
        weight = product(system%grains%axes(:, i))
        mean = mean + weight*mu*[2.0_wp*m%poisson/(1.0_wp - 2.0_wp*m%poisson), 1.0_wp]
        total = total + weight
      end associate
    end do
    if (total > 0.0_wp) mean = mean/total
  end function moduli_of_grains

  !> Images of grains and contacts around all regions and grids.
  subroutine fill_tiles(self, system)
    class(dem_measures_type), intent(inout) :: self
    type(dem_system_type), intent(in) :: system
    real(wp) :: lower(3), upper(3), reach
    integer(i4) :: k

    lower = huge(1.0_wp)
    upper = -huge(1.0_wp)
    reach = 0.0_wp
    do k = 1, self%n
      associate (r => self%item(k)%request%region)
        if (r%kind == region_all) cycle
        lower = min(lower, r%lower)
        upper = max(upper, r%upper)
        if (r%kind == region_box) cycle
        lower = min(lower, r%base, r%base + r%length*r%axis) - r%radius
        upper = max(upper, r%base, r%base + r%length*r%axis) + r%radius
      end associate
    end do
    do k = 1, self%grids
      lower = min(lower, self%grid(k)%grid%lower)
      upper = max(upper, self%grid(k)%grid%upper)
      reach = max(reach, reach_of(self%grid(k)%grid))
    end do
    if (any(lower > upper)) return  ! only regions of all grains
    reach = reach + 4.0_wp*maxval(system%grains%radius)
    call tile(self%sample, system%cell, lower - reach, upper + reach, self%tiled)
  end subroutine fill_tiles

  subroutine write_sample(self, time, dt, periodic, all, errors)
    class(dem_measures_type), intent(inout) :: self
    real(wp), intent(in) :: time, dt
    logical, intent(in) :: periodic, all
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    do k = 1, self%n
      if (.not. wanted(time, dt, self%item(k)%last_time, self%item(k)%every, self%every, all)) cycle
      if (periodic .and. self%item(k)%request%region%kind /= region_all) then
        call write_rows(self%item(k), time, self%tiled, self%grains, errors)
      else
        call write_rows(self%item(k), time, self%sample, self%grains, errors)
      end if
    end do
    do k = 1, self%grids
      associate (grid => self%grid(k))
        if (.not. wanted(time, dt, grid%last_time, grid%every, self%every, all)) cycle
        if (periodic) then
          call grid%write(time, self%tiled, errors)
        else
          call grid%write(time, self%sample, errors)
        end if
      end associate
    end do
  end subroutine write_sample

  subroutine write_rows(item, time, sample, grains, errors)
    type(measure_type), intent(inout) :: item
    real(wp), intent(in) :: time, grains(2)
    type(sample_type), intent(in) :: sample
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:)
    call measure_row(time, sample, item%request, row)
    call item%history%write(row, errors)
    item%last_time = time
    if (item%contacts) then
      call contact_row(time, sample, item%request, row)
      call item%bears%write(row, errors)
      call item%each%write(time, sample, item%request, errors)
    end if
    if (.not. item%moduli) return
    call moduli_row(time, sample, item%request, row)
    call item%full%write(row, errors)
    call micro_row(time, sample, item%request, grains, row)
    call item%micro%write(row, errors)
  end subroutine write_rows

  !> Is something with this interval to be measured at the present event?
  pure logical function wanted(time, dt, last_time, every, least, all)
    real(wp), intent(in) :: time, dt, last_time, every, least
    logical, intent(in) :: all
    integer(i4) :: event, stride
    wanted = time > last_time .and. all
    if (all .or. .not. every > 0.0_wp .or. .not. time > last_time) return
    event = floor((time + near*dt)/least)
    stride = nint(every/least)
    wanted = modulo(event, stride) == 0
  end function wanted

  subroutine flush_measures(self, errors)
    class(dem_measures_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, self%n
      call self%item(k)%history%flush(errors)
      call self%item(k)%full%flush(errors)
      call self%item(k)%micro%flush(errors)
      call self%item(k)%bears%flush(errors)
    end do
  end subroutine flush_measures

  subroutine close_measures(self, errors)
    class(dem_measures_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, self%n
      call self%item(k)%history%close(errors)
      call self%item(k)%full%close(errors)
      call self%item(k)%micro%close(errors)
      call self%item(k)%bears%close(errors)
    end do
  end subroutine close_measures
end module dem_measures
