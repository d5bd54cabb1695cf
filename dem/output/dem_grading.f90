!> Grading over time: what passes sieves, with and without fines, and measures of breakage
!! (&grading; theory-dem, Breakage of grains). Fault D363.
!!
!! A grain passes by its second-largest extent. Fines of a broken grain are spread below its least
!! fragment by (x/d_f)^(3-D_u).
!! eq. D.30 D.31
module dem_grading
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use dem_breakage_masses, only: counted_masses
  use dem_state, only: dem_data_type, graded_size
  implicit none
  private
  public :: dem_grading_type, grading_of, potential_of

  real(wp), parameter :: hardin_size = 0.074e-3_wp  !! silt, which breaks no more [m]
  real(wp), parameter :: usual(2) = [0.2_wp, 0.6_wp]  !! sizes of the slope, of the start's median
  integer(i4), parameter :: fit_points = 21         !! of the slope
  integer(i4), parameter :: first_columns = 7
  ! places in graded: potentials of Hardin and Einav, largest and median size at the start
  integer(i4), parameter :: start_hardin = 1, start_einav = 2, start_most = 3, start_median = 4

  type :: dem_grading_type
    logical :: active = .false.
    real(wp), allocatable :: sieves(:)   !! rising [m]
    real(wp) :: finest = 0.0_wp          !! of the ultimate grading [m]
    real(wp) :: power = 0.5_wp           !! 3 - D_u [-]
    real(wp) :: between(2) = 0.0_wp      !! sizes that the slope is of [m]; 0: usual
    type(history_type) :: history
  contains
    procedure :: read => read_grading
    procedure :: open => open_history
    procedure :: write => write_row
  end type dem_grading_type

contains

  !> The group &grading, if there is one.
  subroutine read_grading(self, deck, d, errors)
    class(dem_grading_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: two(:)
    real(wp) :: ultimate

    self%active = deck%count('grading') > 0
    if (.not. self%active) return
    call deck%get('grading', 1, 'sieves', self%sieves)
    call deck%get('grading', 1, 'finest', self%finest)
    call deck%get('grading', 1, 'ultimate', ultimate)
    self%power = 3.0_wp - ultimate
    if (any(self%sieves(2:) <= self%sieves(:size(self%sieves) - 1))) &
      call deck%fault(errors, 'D363', 'sieves do not rise', 'grading', 1, 'sieves', &
                      'give openings in m, the finest first')
    if (deck%given('grading', 1, 'between')) then
      call deck%get('grading', 1, 'between', two)
      self%between = two
      if (two(2) <= two(1)) call deck%fault(errors, 'D363', 'the sizes of the slope do not rise', &
                                            'grading', 1, 'between', 'give the smaller one first')
    end if
    if (deck%count('history') == 0) &
      call deck%fault(errors, 'D363', 'gradings are written with histories, of which there are '// &
                      'none', 'grading', 1, '', 'add &history every_time = ... /')
    allocate (d%graded(graded_size), source=-1.0_wp)
  end subroutine read_grading

  !> Size of a grain as sieved: its second-largest extent [m].
  pure function sieved_sizes(d) result(sizes)
    type(dem_data_type), intent(in) :: d
    real(wp) :: sizes(d%grains%n), axes(3)
    integer(i4) :: i
    do i = 1, d%grains%n
      axes = d%grains%axes(:, i)
      if (d%grains%shapes%in_use) axes = d%grains%shapes%axes(:, i)
      sizes(i) = 2.0_wp*(sum(axes) - maxval(axes) - minval(axes))
    end do
  end function sieved_sizes

  !> Part of the mass that passes a sieve: of grains, and of their fines.
  pure function grading_of(sizes, mass, fines, power, sieve) result(passing)
    real(wp), intent(in) :: sizes(:), mass(:)  !! (grains) [m], [kg]
    real(wp), intent(in) :: fines(:, :)        !! (2, broken) [kg], [m]
    real(wp), intent(in) :: power              !! 3 - D_u [-]
    real(wp), intent(in) :: sieve              !! [m]
    real(wp) :: passing(2)                     !! of all, of the grains alone [-]
    real(wp) :: grains
    grains = sum(mass, mask=sizes < sieve)
    passing = 0.0_wp
    if (sum(mass) > 0.0_wp) passing(2) = grains/sum(mass)
    if (sum(mass) + sum(fines(1, :)) > 0.0_wp) passing(1) = (grains + sum( &
      fines(1, :)*min(1.0_wp, sieve/fines(2, :))**power))/(sum(mass) + sum(fines(1, :)))
  end function grading_of

  !> Mean of ln(x/least) over all mass above `least`: area between the curve and it, over ln x.
  pure real(wp) function potential_of(sizes, mass, fines, power, least) result(potential)
    real(wp), intent(in) :: sizes(:), mass(:), fines(:, :), power
    real(wp), intent(in) :: least  !! [m]
    real(wp) :: whole
    integer(i4) :: k
    whole = sum(mass) + sum(fines(1, :))
    potential = sum(mass*log(max(sizes, least)/least))
    do k = 1, size(fines, 2)
      if (fines(2, k) <= least) cycle
      potential = potential + fines(1, k)*(log(fines(2, k)/least) &
                                           - (1.0_wp - (least/fines(2, k))**power)/power)
    end do
    if (whole > 0.0_wp) potential = potential/whole
  end function potential_of

  !> The same of the ultimate grading (x^p - finest^p)/(most^p - finest^p).
  pure real(wp) function ultimate_potential(most, finest, power) result(potential)
    real(wp), intent(in) :: most, finest, power
    real(wp) :: r
    r = finest/most
    potential = (-log(r) - (1.0_wp - r**power)/power)/(1.0_wp - r**power)
  end function ultimate_potential

  !> Slope of log N(> x) between two sizes, by least squares; 0 without grains there [-].
  pure real(wp) function slope_of(sizes, between) result(slope)
    real(wp), intent(in) :: sizes(:), between(2)
    real(wp) :: x(fit_points), y(fit_points)
    integer(i4) :: k
    do k = 1, fit_points
      x(k) = log(between(1)) + (k - 1)*log(between(2)/between(1))/(fit_points - 1)
      y(k) = real(count(sizes > exp(x(k))), wp)
    end do
    slope = 0.0_wp
    if (.not. minval(y) > 0.0_wp) return
    y = log(y)
    slope = -sum((x - sum(x)/fit_points)*y)/sum((x - sum(x)/fit_points)**2)
  end function slope_of

  !> Size that half of the mass passes [m].
  pure real(wp) function median_of(sizes, mass) result(median)
    real(wp), intent(in) :: sizes(:), mass(:)
    real(wp) :: low, high
    integer(i4) :: k
    low = 0.0_wp
    high = maxval(sizes)
    do k = 1, digits(low)
      median = 0.5_wp*(low + high)
      if (sum(mass, mask=sizes <= median) < 0.5_wp*sum(mass)) then
        low = median
      else
        high = median
      end if
    end do
    median = high
  end function median_of

  !> <stem>_grading.csv, one row a time.
  subroutine open_history(self, stem, time, errors)
    class(dem_grading_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    integer(i4) :: k, n
    if (.not. self%active) return
    n = size(self%sieves)
    allocate (columns(first_columns + 2*n))
    columns(1)%s = 'time [s]'
    columns(2)%s = 'grains [-]'
    columns(3)%s = 'mass [kg]'
    columns(4)%s = 'fines [kg]'
    columns(5)%s = 'hardin [-]'
    columns(6)%s = 'einav [-]'
    columns(7)%s = 'slope [-]'
    do k = 1, n
      columns(first_columns + k)%s = 'passing_'//str(self%sieves(k))//' [-]'
      columns(first_columns + n + k)%s = 'resolved_'//str(self%sieves(k))//' [-]'
    end do
    call self%history%begin(stem//'_grading.csv', columns, time, errors)
  end subroutine open_history

  subroutine write_row(self, time, d, errors)
    class(dem_grading_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: fines(:, :), passing(:, :)
    real(wp) :: sizes(d%grains%n), mass(d%grains%n), breakage(2), part
    integer(i4) :: k

    if (.not. self%history%is_open() .or. d%grains%n == 0) return
    sizes = sieved_sizes(d)
    mass = counted_masses(d)
    allocate (fines(2, 0), passing(2, size(self%sieves)))
    if (allocated(d%fines)) fines = d%fines
    if (d%graded(start_most) < 0.0_wp) call keep_start(self, d, sizes, mass)
    do k = 1, size(self%sieves)
      passing(:, k) = grading_of(sizes, mass, fines, self%power, self%sieves(k))
    end do
    breakage = 0.0_wp
    if (d%graded(start_hardin) > 0.0_wp) breakage(1) = 1.0_wp - potential_of(sizes, &
      mass, fines, self%power, hardin_size)/d%graded(start_hardin)
    part = d%graded(start_einav)
    if (d%graded(start_most) > self%finest) part = part &
      - ultimate_potential(d%graded(start_most), self%finest, self%power)
    if (part > 0.0_wp .and. d%graded(start_most) > self%finest) breakage(2) = &
      (d%graded(start_einav) - potential_of(sizes, mass, fines, self%power, &
                                            self%finest))/part
    call self%history%write([time, real(d%grains%n, wp), sum(mass), sum(fines(1, :)), &
                             breakage, slope_of(sizes, sizes_of_slope(self, d)), passing(1, :), &
                             passing(2, :)], errors)
  end subroutine write_row

  !> Sizes that the slope is of [m].
  pure function sizes_of_slope(self, d) result(between)
    class(dem_grading_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    real(wp) :: between(2)
    between = self%between
    if (.not. between(2) > 0.0_wp) between = usual*d%graded(start_median)
  end function sizes_of_slope

  !> The grading that all later ones are held against.
  subroutine keep_start(self, d, sizes, mass)
    class(dem_grading_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: sizes(:), mass(:)  !! [m], [kg]
    real(wp) :: none(2, 0)
    d%graded(start_hardin) = potential_of(sizes, mass, none, self%power, hardin_size)
    d%graded(start_einav) = potential_of(sizes, mass, none, self%power, self%finest)
    d%graded(start_most) = maxval(sizes)
    d%graded(start_median) = median_of(sizes, mass)
  end subroutine keep_start
end module dem_grading
