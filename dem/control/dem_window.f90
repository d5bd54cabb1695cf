!> A window of grains that goes with a body: copies of a tile enter in front of it and leave behind,
!! the layers at both ends are held (theory-dem, Moving window). Faults I251 to I253, D299, N211.
!!
!! Copy c of the tile stands c edges along the way of the body, its grains have the ids
!! row + N c, row from 1 to N in the order of the tile's ids. eq. D.24
module dem_window
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use talus_suggest, only: did_you_mean
  use dem_bed, only: order_rows
  use dem_clock, only: interval_ends
  use dem_entry, only: make_entering, check_ids
  use dem_packed_contacts, only: row_of
  use dem_packing, only: dem_packing_type, read_packing
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_grains_type, kind_free, kind_fixed, kind_driven, window_size
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: dem_window_type

  real(wp), parameter :: same = 1.0e-9_wp    !! what counts as the same size, relative
  real(wp), parameter :: square = 1.0e-9_wp  !! cosine of edges that count as being at right angles
  integer(i4), parameter :: rear = 1, front = 2, have_left = 3, have_entered = 4, moved = 5
  character(len=12), parameter :: columns(7) = [character(len=12) :: 'time [s]', 'rear [-]', &
    'front [-]', 'place [m]', 'entered [-]', 'left [-]', 'moved [m]']

  type :: dem_window_type
    logical :: active = .false.
    type(dem_packing_type) :: tile       !! rows in the order of their ids
    integer(i4) :: material = 0          !! of its grains
    integer(i4) :: body = 0              !! surface that it goes with
    real(wp) :: along(3) = 0.0_wp        !! way of the body [-]
    real(wp) :: length = 0.0_wp          !! of the tile along it [m]
    real(wp) :: origin = 0.0_wp          !! of copy 0, along it [m]
    real(wp) :: reach(2) = 0.0_wp        !! from the body to the ends at least: behind, ahead [m]
    real(wp) :: hold = 0.0_wp            !! depth of the held layers [m]
    real(wp) :: most_moved = 0.0_wp      !! of the grains of the first tile, root mean square [m]
    real(wp) :: every = 0.0_wp           !! [s]
    character(len=:), allocatable :: path
    type(history_type) :: history
  contains
    procedure :: read => read_window
    procedure :: update
    procedure :: text => window_text
    procedure :: open => open_history
    procedure :: write => write_row
    procedure, private :: check_bed
    procedure, private :: place_in
    procedure, private :: hold_ends
    procedure, private :: wake
    procedure, private :: drop
    procedure, private :: springs_of
  end type dem_window_type

contains

  !> The group &window, if there is one.
  subroutine read_window(self, deck, material, system, errors)
    class(dem_window_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: material  !! of the grains
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: before
    real(wp) :: part

    self%active = deck%count('window') > 0
    if (.not. self%active) return
    before = errors%count
    self%path = deck%source%path
    self%material = material
    call deck%get('window', 1, 'behind', self%reach(rear))
    call deck%get('window', 1, 'ahead', self%reach(front))
    call deck%get('window', 1, 'hold', self%hold)
    call deck%get('window', 1, 'every_time', self%every)
    call find_body(self, deck, system, errors)
    call read_packing(self%tile, deck%path('window', 1, 'tile'), errors)
    if (errors%count > before) return
    call order_rows(self%tile)
    call read_way(self, deck, errors)
    if (errors%count > before) return
    call deck%get('window', 1, 'moved', part)
    self%most_moved = part*(sum(product(self%tile%axes, 1))/self%tile%n)**(1.0_wp/3.0_wp)
    call self%check_bed(deck, system, errors)
    if (errors%count > before) return
    allocate (system%window(window_size), source=0.0_wp)
    system%window(rear) = real((minval(system%grains%id) - 1)/self%tile%n, wp)
    system%window(front) = real((maxval(system%grains%id) - 1)/self%tile%n, wp)
  end subroutine read_window

  !> The surface, penetrometer or cylinder that it goes with (D299).
  subroutine find_body(self, deck, system, errors)
    class(dem_window_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: b
    call deck%get('window', 1, 'surface', name)
    do b = 1, system%surfaces%n
      if (system%surfaces%name(b)%s == name) self%body = b
    end do
    if (self%body > 0) return
    if (system%surfaces%n == 0) then
      call deck%fault(errors, 'D299', 'the window has no body to go with', 'window', 1, 'surface', &
                      'add the &surface, &penetrometer or &cylinder that travels')
    else
      call deck%fault(errors, 'D299', "there is no surface '"//name//"'", 'window', 1, 'surface', &
                      did_you_mean(name, system%surfaces%name, 'surfaces of this deck:'))
    end if
  end subroutine find_body

  !> Direction and length of a copy: an edge of the cell, at right angles to the others (I251,
  !! I252); the held layers fit into a tile (D299).
  subroutine read_way(self, deck, errors)
    class(dem_window_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: edge
    real(wp) :: own(3), other(3)
    integer(i4) :: k, j

    if (.not. self%tile%has_cell .or. self%tile%springs%given == 0) then
      call errors%add('I251', 'the tile has no cell or no contacts', &
                      deck%path('window', 1, 'tile'), 'take the packing that a run with &cell '// &
                      'leaves at its end, at rest')
      return
    end if
    call deck%get('window', 1, 'edge', edge)
    k = index('abc', edge)
    own = self%tile%cell(:, k)
    self%length = norm2(own)
    self%along = own/self%length
    do j = 1, 3
      other = self%tile%cell(:, j)
      if (j == k .or. abs(dot_product(self%along, other)) <= square*norm2(other)) cycle
      call errors%add('I252', "edge '"//edge//"' of the tile is not at right angles to the "// &
                      'others', deck%path('window', 1, 'tile'), 'copies are slices of the bed')
      return
    end do
    self%origin = dot_product(self%along, self%tile%cell_origin)
    if (self%hold > 0.5_wp*self%length) call deck%fault(errors, 'D299', 'held layers of '// &
      str(self%hold)//' m do not fit into a tile of '//str(self%length)//' m', 'window', 1, &
      'hold', 'two grains deep, at most half a tile')
    self%tile%kind = merge(kind_fixed, kind_free, self%tile%kind == kind_fixed)
  end subroutine read_way

  !> All grains of the run are grains of copies (I253): sizes and ids; none is driven.
  subroutine check_bed(self, deck, system, errors)
    class(dem_window_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    real(wp) :: off(3), axes(3), size
    integer(i4) :: i, row, copy

    size = maxval(self%tile%axes)
    do i = 1, system%grains%n
      copy = int((system%grains%id(i) - 1)/self%tile%n, i4)
      row = int(system%grains%id(i) - int(copy, i8)*self%tile%n, i4)
      axes = system%grains%axes(:, i)
      if (system%grains%shapes%in_use) axes = system%grains%shapes%axes(:, i)
      off = system%grains%x(:, i) - place_of(self, row, copy)
      if (maxval(abs(axes - self%tile%axes(:, row))) <= same*size .and. &
          dot_product(self%along, off)**2 <= self%length**2 .and. &
          system%grains%kind(i) /= kind_driven) cycle
      call errors%add('I253', 'grain '//str(system%grains%id(i))//' is not row '//str(row)// &
                      ' of copy '//str(copy)//' of the tile', deck%source%path, &
                      "make the bed of the same tile: 'talus pack edit --repeat'")
      return
    end do
  end subroutine check_bed

  !> Where a row stands in a copy [m].
  pure function place_of(self, row, copy) result(x)
    class(dem_window_type), intent(in) :: self
    integer(i4), intent(in) :: row, copy
    real(wp) :: x(3)
    x = self%tile%x(:, row) + copy*self%length*self%along
  end function place_of

  !> Where a point is along the way, from the rear face of copy 0 [m].
  pure real(wp) function place_in(self, x) result(place)
    class(dem_window_type), intent(in) :: self
    real(wp), intent(in) :: x(3)
    place = dot_product(self%along, x) - self%origin
  end function place_in

  !> Copies enter and leave as the body has gone on.
  subroutine update(self, system, unit, turns, changed, errors)
    class(dem_window_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    real(wp), intent(in) :: unit         !! of time [s]
    integer(i8), intent(in) :: turns(2)  !! units until now, and at the last update; -1: none
    logical, intent(inout) :: changed
    type(error_list_type), intent(inout) :: errors
    real(wp) :: place

    if (.not. self%active) return
    if (.not. interval_ends(turns, nint(self%every/unit, i8))) return
    call system%gather()
    if (turns(2) < 0) call self%hold_ends(system)
    changed = changed .or. turns(2) < 0
    do
      place = self%place_in(system%surfaces%centre(:, self%body))
      if (self%length*(system%window(front) + 1) - place < self%reach(front)) then
        call self%wake(system, errors)
        if (errors%any()) return
      else if (place - self%length*(system%window(rear) + 1) > self%reach(rear)) then
        call self%drop(system)
      else
        return
      end if
      changed = .true.
    end do
  end subroutine update

  !> Both ends, at the start of a run.
  subroutine hold_ends(self, system)
    class(dem_window_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i4) :: kind(system%grains%n), i
    logical :: none(system%grains%n)
    real(wp) :: place, ends(2)
    kind = system%grains%kind
    ends = self%length*[system%window(rear), system%window(front) + 1]
    do i = 1, system%grains%n
      place = self%place_in(system%grains%x(:, i))
      if (place < ends(rear) + self%hold .or. place > ends(front) - self%hold) kind(i) = kind_fixed
    end do
    none = .false.
    call system%leave(none, kind)
  end subroutine hold_ends

  !> The next copy enters: its far layer is held, that of the last one is let go.
  subroutine wake(self, system, errors)
    class(dem_window_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    type(dem_packing_type) :: copy
    type(dem_grains_type) :: entering
    type(start_springs_type) :: springs
    integer(i4) :: kind(system%grains%n), i, last
    logical, allocatable :: fresh(:)
    real(wp) :: end

    last = nint(system%window(front), i4)
    call measure_front(self, system, errors)
    if (errors%any()) return
    kind = system%grains%kind
    allocate (fresh(2*self%tile%n), source=.false.)
    fresh(self%tile%n + 1:) = .true.
    do i = 1, system%grains%n
      if (kind(i) /= kind_fixed .or. system%grains%id(i) <= int(last, i8)*self%tile%n) cycle
      associate (row => int(system%grains%id(i) - int(last, i8)*self%tile%n, i4))
        if (self%place_in(system%grains%x(:, i)) < self%length*(last + 1) - self%hold) cycle
        kind(i) = self%tile%kind(row)
        fresh(row) = kind(i) == kind_free
      end associate
    end do
    copy = self%tile
    copy%id = [(i, i=1, copy%n)] + int(last + 1, i8)*copy%n
    end = self%length*(last + 2)
    do i = 1, copy%n
      copy%x(:, i) = place_of(self, i, last + 1)
      if (self%place_in(copy%x(:, i)) <= end - self%hold) cycle
      copy%kind(i) = kind_fixed
      copy%v(:, i) = 0.0_wp
      copy%omega(:, i) = 0.0_wp
    end do
    call check_ids('the window', copy, self%path, errors)
    if (errors%any()) return
    call make_entering(copy, self%material, system, entering, errors)
    if (errors%any()) return
    call self%springs_of(last, fresh, springs)
    call system%enter(entering, springs, kind)
    system%window(front) = real(last + 1, wp)
    system%window(have_entered) = system%window(have_entered) + copy%n
  end subroutine wake

  !> How far the free grains of the last copy have moved from where the tile has them: a copy joins
  !! a bed that is still as the tile (N211).
  subroutine measure_front(self, system, errors)
    class(dem_window_type), intent(in) :: self
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    real(wp) :: off(3), square_sum
    integer(i8) :: first
    integer(i4) :: i, n, last
    last = nint(system%window(front), i4)
    first = int(last, i8)*self%tile%n
    square_sum = 0.0_wp
    n = 0
    do i = 1, system%grains%n
      if (system%grains%id(i) <= first .or. system%grains%kind(i) /= kind_free) cycle
      off = system%grains%x(:, i) - place_of(self, int(system%grains%id(i) - first, i4), last)
      square_sum = square_sum + sum(off**2)
      n = n + 1
    end do
    system%window(moved) = sqrt(square_sum/max(n, 1))
    if (system%window(moved) <= self%most_moved) return
    call errors%add('N211', 'grains at the front of the window have moved by '// &
                    short_number(1.0e3_wp*system%window(moved))//' mm (root mean square), '// &
                    'more than '//short_number(1.0e3_wp*self%most_moved)// &
                    ' mm: no tile fits there any more', self%path, &
                    'look farther ahead: a larger &window ahead')
  end subroutine measure_front

  !> Forces of the tile's contacts between grains of copies last and last + 1 that are all fresh:
  !! new, or held until now.
  subroutine springs_of(self, last, fresh, springs)
    class(dem_window_type), intent(in) :: self
    integer(i4), intent(in) :: last
    logical, intent(in) :: fresh(:)  !! (rows of both copies)
    type(start_springs_type), intent(out) :: springs
    integer(i4), allocatable :: row(:, :), shift(:, :)
    integer(i8), allocatable :: ids(:, :)
    integer(i4) :: n, c, k, edge, away, a, b
    associate (t => self%tile)
      n = t%springs%given
      allocate (row(2, n), ids(2, 2*n), shift(3, 2*n), springs%force(3, 2*n))
      edge = maxloc(abs(matmul(self%along, t%cell)), 1)
      call rows_of(t, row)
      k = 0
      do c = 1, n
        do away = 0, 1  ! the copy of the first grain, from the last one on
          a = row(1, c) + t%n*away
          b = row(2, c) + t%n*(away + shift_of(t%springs, edge, c))
          if (min(a, b) < 1 .or. max(a, b) > 2*t%n) cycle
          if (.not. (fresh(a) .and. fresh(b))) cycle
          k = k + 1
          ids(:, k) = [a, b] + int(last, i8)*t%n
          springs%force(:, k) = t%springs%force(:, c)
          shift(:, k) = 0
          if (allocated(t%springs%shift)) shift(:, k) = t%springs%shift(:, c)
          shift(edge, k) = 0
        end do
      end do
      springs%ids = ids(:, :k)
      springs%force = springs%force(:, :k)
      if (allocated(t%springs%shift)) springs%shift = shift(:, :k)
      springs%given = k
    end associate
  end subroutine springs_of

  !> Edges along the way from the second grain of contact c to its image that is touched.
  pure integer(i4) function shift_of(springs, edge, c) result(shift)
    type(start_springs_type), intent(in) :: springs
    integer(i4), intent(in) :: edge, c
    shift = 0
    if (allocated(springs%shift)) shift = springs%shift(edge, c)
  end function shift_of

  !> Rows of the grains of all contacts.
  pure subroutine rows_of(tile, row)
    type(dem_packing_type), intent(in) :: tile
    integer(i4), intent(out) :: row(:, :)  !! (2, contacts)
    integer(i4) :: c
    do c = 1, size(row, 2)
      row(1, c) = row_of(tile%id, tile%springs%ids(1, c))
      row(2, c) = row_of(tile%id, tile%springs%ids(2, c))
    end do
  end subroutine rows_of

  !> What is behind the next copy leaves, a layer of that is held.
  subroutine drop(self, system)
    class(dem_window_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    logical :: leaving(system%grains%n)
    integer(i4) :: kind(system%grains%n), i
    real(wp) :: place, end
    end = self%length*(system%window(rear) + 1)
    kind = system%grains%kind
    do i = 1, system%grains%n
      place = self%place_in(system%grains%x(:, i))
      leaving(i) = place < end
      if (place < end + self%hold) kind(i) = kind_fixed
    end do
    call system%leave(leaving, kind)
    system%window(rear) = system%window(rear) + 1.0_wp
    system%window(have_left) = system%window(have_left) + count(leaving)
  end subroutine drop

  !> Where it is, for the log.
  function window_text(self, system) result(text)
    class(dem_window_type), intent(in) :: self
    type(dem_system_type), intent(in) :: system
    character(len=:), allocatable :: text
    text = 'copies '//str(nint(system%window(rear)))//' to '//str(nint(system%window(front)))// &
      ' of the tile, '//str(nint(system%window(have_entered), i8))//' grains have entered, '// &
      str(nint(system%window(have_left), i8))//' have left'
  end function window_text

  !> <stem>_window.csv.
  subroutine open_history(self, stem, time, errors)
    class(dem_window_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (self%active) call self%history%begin(stem//'_window.csv', columns, time, errors)
  end subroutine open_history

  subroutine write_row(self, time, system, errors)
    class(dem_window_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    if (.not. self%history%is_open()) return
    associate (w => system%window)
      call self%history%write([time, w(rear), w(front), &
                               self%place_in(system%surfaces%centre(:, self%body)), &
                               w(have_entered), w(have_left), w(moved)], errors)
    end associate
  end subroutine write_row
end module dem_window
