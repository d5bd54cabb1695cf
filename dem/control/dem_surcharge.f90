!> Surcharge: a pressure on the free surface of a bed, carried by its uppermost grains.
!!
!! Each grain of the surface (dem_surface) is pushed down by the stress times the free part of its
!! Voronoi cell in the plan, so that the forces add up to stress times free area whatever the grains
!! do. The free area is a rectangle, given, between upright walls or that of a cell that is periodic
!! along x and y, less a disc around every driven grain and one that the deck may name. Surface and
!! areas are updated every so many steps; in between the forces are constant. They are extra forces:
!! the ledger counts their work as external. In an overlap with a solid, the share of ghosts is
!! applied by the loads of the solid.
!! eq. D.7
module dem_surcharge
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use dem_ledger, only: staggering_of, follow_load
  use dem_cell, only: is_periodic
  use dem_plan, only: plan_type, free_area, cell_areas, outline_of, largest_reach, folded_in, &
    with_images
  use dem_ellipsoid, only: rotation_of
  use dem_state, only: dem_data_type, kind_driven, kind_free, seen_size => surcharge_seen_size
  use dem_surface, only: surface_rows
  implicit none
  private
  public :: dem_surcharge_type

  integer(i4), parameter :: longest = 100  !! steps in a block
  integer(i4), parameter :: seen_stress = 1, seen_area = 2, seen_grains = 3, seen_force = 4, &
                            seen_least = 5, seen_most = 6, seen_height = 7, seen_step = 8
  real(wp), parameter :: upright = 1.0e-9_wp  !! cosine to the axis, less than 1 by this
  character(len=20), parameter :: columns(11) = [character(len=20) :: 'time [s]', &
    'stress [Pa]', 'free_area [m2]', 'grains [-]', 'force [N]', 'least_area [m2]', &
    'most_area [m2]', 'height [m]', 'moment_x [N m]', 'moment_y [N m]', 'external_work [J]']

  type :: dem_surcharge_type
    logical :: active = .false.
    real(wp) :: stress = 0.0_wp              !! [Pa]
    integer(i4) :: curve = 0                 !! that multiplies it, 0: none
    type(curve_type), allocatable :: curves(:)
    real(wp) :: lower(2) = 0.0_wp            !! rectangle, if it is given [m]
    real(wp) :: upper(2) = 0.0_wp
    integer(i4) :: wall(2, 2) = 0            !! (side, axis) else the walls that bound it
    real(wp) :: clearance = 0.0_wp           !! radius of discs over that of driven grains [-]
    real(wp), allocatable :: hole(:, :)      !! (3, 0 or 1) disc of the deck [m]
    integer(i4) :: every = longest           !! steps between two updates
    real(wp) :: follow = 20.0_wp             !! updates over which a grain's load follows its share
    type(history_type) :: history
  contains
    procedure :: read => read_surcharge
    procedure :: longest_block
    procedure :: due
    procedure :: start
    procedure :: update
    procedure :: text => surcharge_text
    procedure :: open => open_history
    procedure :: write => write_row
    procedure, private :: plan_now
    procedure, private :: approach
  end type dem_surcharge_type

contains

  !> Group surcharge (D280).
  subroutine read_surcharge(self, deck, d, curves, errors)
    class(dem_surcharge_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(curve_type), intent(in) :: curves(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: hole(:)

    self%active = deck%count('surcharge') > 0
    if (.not. self%active) return
    self%curves = curves
    call deck%get('surcharge', 1, 'stress', self%stress)
    call curve_index(deck, 'D250', curves, 'surcharge', 1, self%curve, errors)
    call deck%get('surcharge', 1, 'clearance', self%clearance)
    call deck%get('surcharge', 1, 'update_every', self%every)
    call deck%get('surcharge', 1, 'follow', self%follow)
    if (modulo(self%every, longest) /= 0) &
      call deck%fault(errors, 'D248', 'updates are made at multiples of 100 steps', 'surcharge', &
                      1, 'update_every', 'take 100, 200, ...')
    allocate (self%hole(3, 0))
    if (deck%given('surcharge', 1, 'hole')) then
      call deck%get('surcharge', 1, 'hole', hole)
      self%hole = reshape(hole, [3, 1])
      if (.not. hole(3) > 0.0_wp) &
        call deck%fault(errors, 'D280', 'the hole has no radius', 'surcharge', 1, 'hole', &
                        'give x, y and a radius above 0 in m')
    end if
    call check_cell(deck, d, errors)
    if (deck%count('cell') > 0 .and. .not. d%cell%active) return  ! it had faults
    if (is_periodic(d%cell)) return
    call read_rectangle(self, deck, d, errors)
  end subroutine read_surcharge

  !> A cell is periodic along x and y alone, or along neither (D280).
  subroutine check_cell(deck, d, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    real(wp) :: off(3, 2)

    if (.not. is_periodic(d%cell)) return
    off = d%cell%vectors(:, :2)
    off(1, 1) = 0.0_wp
    off(2, 2) = 0.0_wp
    what = ''
    if (d%cell%periodic(3)) then
      what = 'a cell that is periodic along its third edge has no free surface'
    else if (.not. all(d%cell%periodic(:2))) then
      what = 'a cell that is periodic in one direction has no known free surface'
    else if (any(abs(off) > upright*maxval(abs(d%cell%vectors)))) then
      what = 'the edges of the cell do not lie along x and y'
    else if (deck%count('cell_rate') + deck%count('cell_stress') > 0) then
      what = 'the cell is strained under its surcharge'
    else if (deck%given('surcharge', 1, 'lower')) then
      what = 'in a cell the free surface is that of the cell'
    end if
    if (len(what) > 0) &
      call deck%fault(errors, 'D280', what, 'surcharge', 1, '', "&cell periodic = 'a', 'b', a "// &
                      'box at rest, without lower and upper; or leave the surcharge out')
  end subroutine check_cell

  !> The rectangle: lower and upper, or one wall on each side (D280).
  subroutine read_rectangle(self, deck, d, errors)
    type(dem_surcharge_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: corner(:)
    integer(i4) :: k, axis, side

    if (deck%given('surcharge', 1, 'lower')) then
      call deck%get('surcharge', 1, 'lower', corner)
      self%lower = corner
      call deck%get('surcharge', 1, 'upper', corner)
      self%upper = corner
      if (.not. all(self%upper > self%lower)) &
        call deck%fault(errors, 'D280', 'the rectangle has no area', 'surcharge', 1, 'upper', &
                        'upper must be above lower in x and y')
    else
      do k = 1, d%planes%n
        do axis = 1, 2
          if (1.0_wp - abs(d%planes%normal(axis, k)) > upright) cycle
          side = merge(1, 2, d%planes%normal(axis, k) > 0.0_wp)
          self%wall(side, axis) = merge(k, -1_i4, self%wall(side, axis) == 0)
        end do
      end do
      if (any(self%wall <= 0)) &
        call deck%fault(errors, 'D280', 'the free surface of the surcharge is not known: there '// &
                        'is not one wall on each side across x and y', 'surcharge', 1, '', &
                        'give lower = x, y and upper = x, y in m')
    end if
  end subroutine read_rectangle

  !> Largest number of steps without an update.
  pure integer(i4) function longest_block(self)
    class(dem_surcharge_type), intent(in) :: self
    longest_block = merge(longest, huge(longest), self%active)
  end function longest_block

  pure logical function due(self, d, steps)
    class(dem_surcharge_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: steps  !! taken so far
    integer(i8) :: passed
    due = .false.
    if (.not. self%active) return
    passed = steps - nint(d%surcharge_seen(seen_step), i8)
    due = passed >= self%every .or. passed < 0
  end function due

  !> First forces of a fresh run, or of one that restarts from a checkpoint without surcharge; one
  !! from a checkpoint that had it keeps its forces, one from a packing that has loads begins with
  !! those of its grains within the free area. Loads of others, as of ghosts in an overlap, would
  !! be counted in the sum, which the free ones would then lack.
  subroutine start(self, d, given, time, steps, errors)
    class(dem_surcharge_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), allocatable, intent(in) :: given(:)  !! (grains) loads of the packing [N]
    real(wp), intent(in) :: time                   !! [s]
    integer(i8), intent(in) :: steps               !! taken so far
    type(error_list_type), intent(inout) :: errors
    type(plan_type) :: plan
    if (.not. self%active .and. allocated(d%surcharge)) call take_off(d)
    if (.not. self%active .or. allocated(d%surcharge)) return
    allocate (d%surcharge(d%grains%n), d%surcharge_seen(seen_size), source=0.0_wp)
    if (allocated(given)) then
      call self%plan_now(d, plan, errors)
      if (errors%any()) return
      d%surcharge = merge(given, 0.0_wp, d%grains%kind == kind_free .and. within(plan, d%grains%x))
      d%surcharge_top = d%surcharge > 0.0_wp
      d%grains%extra_force(3, :) = d%grains%extra_force(3, :) - d%surcharge
    end if
    call self%update(d, time, steps, errors)
  end subroutine start

  !> Which centres lie in the rectangle of the plan; all do where it is periodic.
  pure function within(plan, x)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: x(:, :)  !! (3, grains) [m]
    logical :: within(size(x, 2))
    integer(i4) :: i
    within = [(all(plan%periodic .or. (x(:2, i) >= plan%lower .and. x(:2, i) <= plan%upper)), &
               i=1, size(x, 2))]
  end function within

  !> The checkpoint had a surcharge, the deck has none.
  subroutine take_off(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: before
    before = staggering_of(d)
    d%grains%extra_force(3, :) = d%grains%extra_force(3, :) + d%surcharge
    deallocate (d%surcharge, d%surcharge_seen, d%surcharge_top)
    call follow_load(d, before)
  end subroutine take_off

  !> Find the surface and share the load (N230, N231).
  subroutine update(self, d, time, steps, errors)
    class(dem_surcharge_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time        !! [s]
    integer(i8), intent(in) :: steps    !! taken so far
    type(error_list_type), intent(inout) :: errors
    type(plan_type) :: plan
    integer(i4), allocatable :: rows(:)
    real(wp), allocatable :: area(:), force(:), place(:, :)
    logical, allocatable :: carries(:)
    real(wp) :: stress, before, loaded
    integer(i4) :: i

    call self%plan_now(d, plan, errors)
    if (errors%any()) return
    rows = surface_rows(d%grains, plan, d%par%overlapped, d%surcharge_top)
    d%surcharge_top = [(.false., i=1, d%grains%n)]
    d%surcharge_top(rows) = .true.
    carries = d%grains%kind(rows) == kind_free
    if (.not. any(carries)) then
      call errors%add('N230', 'no grain carries the surcharge at '//short_number(time)//' s: '// &
                      'none lies in the free area of '//short_number(free_area(plan))//' m2', &
                      'group surcharge', 'check lower, upper, clearance and where the bed is')
      return
    end if
    allocate (area(size(rows)), place(2, size(rows)))
    do i = 1, size(rows)
      place(:, i) = folded_in(plan, d%grains%x(:2, rows(i)))
    end do
    call cell_areas(plan, place, area)
    stress = self%stress
    if (self%curve > 0) stress = self%stress*self%curves(self%curve)%at(time)
    allocate (force(d%grains%n), source=0.0_wp)
    force(rows) = merge(stress*area, 0.0_wp, carries)
    call self%approach(merge(d%surcharge, 0.0_wp, d%grains%kind == kind_free), force)
    before = staggering_of(d)
    d%grains%extra_force(3, :) = (d%grains%extra_force(3, :) + d%surcharge) - force
    d%surcharge = force
    call follow_load(d, before)
    loaded = free_area(plan) - sum(area, .not. carries)
    area = pack(area, carries)
    rows = pack(rows, carries)
    d%surcharge_seen = [stress, loaded, real(size(rows), wp), sum(force), minval(area), &
                        maxval(area), sum(area*d%grains%x(3, rows))/sum(area), real(steps, wp)]
  end subroutine update

  !> Loads on the way from what they were to what they shall be, of the same sum: a grain that comes
  !! to the surface or leaves it is not struck.
  pure subroutine approach(self, before, force)
    class(dem_surcharge_type), intent(in) :: self
    real(wp), intent(in) :: before(:)    !! (grains) [N]
    real(wp), intent(inout) :: force(:)  !! shares in, loads out [N]
    real(wp) :: whole, part
    if (.not. (self%follow > 1.0_wp .and. sum(before) > 0.0_wp)) return
    whole = sum(force)
    force = before + (force - before)/self%follow
    part = sum(force)
    if (part > 0.0_wp) force = force*(whole/part)
  end subroutine approach

  !> Rectangle and discs as they are now; discs that overlap are a fault (N231).
  subroutine plan_now(self, d, plan, errors)
    class(dem_surcharge_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    type(plan_type), intent(out) :: plan
    type(error_list_type), intent(inout) :: errors
    real(wp) :: ring(3)
    integer(i4) :: i, j, axis

    plan%lower = self%lower
    plan%upper = self%upper
    do axis = 1, merge(2, 0, all(self%wall > 0))
      plan%lower(axis) = d%planes%point(axis, self%wall(1, axis))
      plan%upper(axis) = d%planes%point(axis, self%wall(2, axis))
    end do
    if (is_periodic(d%cell)) then
      plan%periodic = .true.
      plan%lower = d%cell%origin(:2)
      plan%upper = d%cell%origin(:2) + [d%cell%vectors(1, 1), d%cell%vectors(2, 2)]
    end if
    plan%disc = self%hole
    do i = 1, merge(d%grains%n, 0, self%clearance > 0.0_wp)
      if (d%grains%kind(i) /= kind_driven) cycle
      ring(:2) = d%grains%x(:2, i)
      ring(3) = self%clearance*largest_reach(outline_of(rotation_of(d%grains%quat(:, i)), &
                                                        d%grains%axes(:, i)))
      plan%disc = reshape([plan%disc, ring], [3, size(plan%disc, 2) + 1])
    end do
    call repeat_discs(plan)
    do i = 2, size(plan%disc, 2)
      do j = 1, i - 1
        if (sum((plan%disc(:2, i) - plan%disc(:2, j))**2) >= &
            (plan%disc(3, i) + plan%disc(3, j))**2) cycle
        call errors%add('N231', 'two discs without surcharge overlap: at '// &
                        str(plan%disc(:2, j))//' m and '//str(plan%disc(:2, i))//' m, radii '// &
                        short_number(plan%disc(3, j))//' and '//short_number(plan%disc(3, i))// &
                        ' m', 'group surcharge', &
                        'set clearance = 0 and name one hole around all driven grains')
        return
      end do
    end do
  end subroutine plan_now

  !> Images of the discs over the faces of a periodic plan, behind them.
  pure subroutine repeat_discs(plan)
    type(plan_type), intent(inout) :: plan
    real(wp), allocatable :: points(:, :), disc(:, :)
    integer(i4), allocatable :: row(:)
    integer(i4) :: k
    if (.not. any(plan%periodic)) return
    do k = 1, size(plan%disc, 2)
      plan%disc(:2, k) = folded_in(plan, plan%disc(:2, k))
    end do
    call with_images(plan, plan%disc(:2, :), plan%upper - plan%lower, points, row)
    disc = plan%disc(:, row)
    disc(:2, :) = points
    call move_alloc(disc, plan%disc)
  end subroutine repeat_discs

  !> What carries how much, as last seen.
  function surcharge_text(self, d) result(text)
    class(dem_surcharge_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    character(len=:), allocatable :: text
    text = 'none'
    if (.not. self%active .or. .not. allocated(d%surcharge_seen)) return
    associate (seen => d%surcharge_seen)
      text = short_number(seen(seen_force))//' N on '//str(nint(seen(seen_grains), i4))// &
        ' grains: '//short_number(seen(seen_stress))//' Pa on '// &
        short_number(seen(seen_area))//' m2, '//short_number(seen(seen_least))//' to '// &
        short_number(seen(seen_most))//' m2 a grain'
    end associate
  end function surcharge_text

  !> Begin <stem>_surcharge.csv, or go on in it after a restart at time >= 0.
  subroutine open_history(self, stem, time, errors)
    class(dem_surcharge_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    call self%history%begin(stem//'_surcharge.csv', columns, time, errors)
  end subroutine open_history

  !> The last update, the moment of the forces about the origin, and the work of all extra forces so
  !! far.
  subroutine write_row(self, time, d, errors)
    class(dem_surcharge_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: moment(2)
    if (.not. self%history%is_open()) return
    moment = [-dot_product(d%grains%x(2, :), d%surcharge), &
              dot_product(d%grains%x(1, :), d%surcharge)]
    call self%history%write([time, d%surcharge_seen(:seen_height), moment, d%ledger%external], &
                            errors)
  end subroutine write_row
end module dem_surcharge
