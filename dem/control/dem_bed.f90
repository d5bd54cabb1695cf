!> A bed of copies of one periodic packing, the tile, most of whose grains sleep: they exist, but no
!! one looks at them (theory-dem, Conversion). Faults I254, I460, D300; of several tiles
!! dem_library.
!!
!! Copy (i, j, k) of the tile of N grains is number c = i + n_x (j + n_y k) of n_x n_y n_z; row r
!! of it, from 1 in the order of the tile's ids, has the id r + N c and is at x_r + (i, j, k) edges.
!! Several tiles lie over each other in the same copies; ids of one follow those of the one before.
!! Grains may wake in the state of a history of stretch that a copy of the tile has gone through
!! (dem_replay).
!! eq. D.24
module dem_bed
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_homogenise, only: inverse_of
  use dem_ellipsoid, only: quaternion_product, rotation_of
  use dem_library, only: tile_type, check_library, read_stamp
  use dem_make, only: sorted_order
  use dem_packing, only: dem_packing_type, read_packing
  use dem_records, only: index_of
  use dem_replay, only: replays_type
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_data_type, kind_free
  use dem_system, only: dem_system_type
  use dem_tile_contacts, only: tile_contacts_type, sort_contacts
  implicit none
  private
  public :: dem_bed_type, waking_type, order_rows

  !> How grains of the bed wake, by grain, where it is not as the tile is.
  type :: waking_type
    integer(i4), allocatable :: history(:)  !! number of a state of the tile, 0: as it is
    real(wp), allocatable :: turn(:, :)     !! (4, n) rotation of the tile
  end type waking_type

  type :: dem_bed_type
    logical :: active = .false.
    type(tile_type), allocatable :: tile(:)
    integer(i4) :: copies(3) = 1
    type(replays_type) :: replays          !! of the first tile
  contains
    procedure :: read => read_bed
    procedure :: grains => all_grains
    procedure :: tile_of
    procedure :: place_of
    procedure :: near
    procedure :: list_asleep
    procedure :: fill => fill_batch
    procedure :: springs_of
    procedure :: follow_histories
    procedure, private :: row_of_id
    procedure, private :: copy_of
    procedure, private :: id_of
  end type dem_bed_type

contains

  !> The group &tile, if there is one.
  subroutine read_bed(self, deck, served, errors)
    class(dem_bed_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served  !! a partner drives the run
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: copies(:)
    integer(i4) :: before, t

    self%active = deck%count('tile') > 0
    if (.not. self%active) return
    before = errors%count
    if (.not. served) call deck%fault(errors, 'D300', 'no one wakes the grains of the tile', &
      'tile', 1, '', 'this group is for runs of talus-couple; alone use &window')
    call deck%get('tile', 1, 'copies', copies)
    self%copies = copies
    allocate (self%tile(deck%count('tile')))
    do t = 1, size(self%tile)
      call read_tile(self, deck, t, errors)
    end do
    if (errors%count > before) return
    call check_library(self%tile, deck, errors)
    if (self%grains() >= int(huge(1_i4), i8)) &
      call errors%add('I460', 'copies of the tile have more than '//str(huge(1_i4))//' grains', &
                      deck%path('tile', 1, 'file'), 'ids are whole numbers below that: a '// &
                      'smaller bed')
    call self%replays%read(deck)
  end subroutine read_bed

  !> One tile, whose ids follow those of the one before.
  subroutine read_tile(self, deck, t, errors)
    class(dem_bed_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: t
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: before
    before = errors%count
    associate (tile => self%tile(t))
      call read_packing(tile%rows, deck%path('tile', t, 'file'), errors)
      if (errors%count > before) return
      if (.not. tile%rows%has_cell .or. tile%rows%springs%given == 0) then
        call errors%add('I254', 'the tile has no cell or no contacts', &
          deck%path('tile', t, 'file'), &
          'take the packing that a run with &cell leaves at its end, at rest')
        return
      end if
      if (t > 1) tile%before = self%tile(t - 1)%before &
        + int(self%tile(t - 1)%rows%n, i8)*product(int(self%copies, i8))
      call deck%get('tile', t, 'plastic_strain', tile%plastic)
      if (size(self%tile) > 1) call read_stamp(tile, deck%path('tile', t, 'file'), errors)
      call order_rows(tile%rows)
      tile%rows%kind = kind_free
      call sort_contacts(tile%contacts, tile%rows%id, tile%rows%springs)
    end associate
  end subroutine read_tile

  !> Grains of the bed, awake or not.
  pure integer(i8) function all_grains(self) result(n)
    class(dem_bed_type), intent(in) :: self
    integer(i4) :: t
    n = 0
    do t = 1, size(self%tile)
      n = n + int(self%tile(t)%rows%n, i8)*product(int(self%copies, i8))
    end do
  end function all_grains

  !> Tile of a grain.
  pure integer(i4) function tile_of(self, id) result(t)
    class(dem_bed_type), intent(in) :: self
    integer(i8), intent(in) :: id
    do t = size(self%tile, kind=i4), 2, -1
      if (id > self%tile(t)%before) return
    end do
  end function tile_of

  !> Row of a grain in its tile.
  pure integer(i4) function row_of_id(self, id) result(r)
    class(dem_bed_type), intent(in) :: self
    integer(i8), intent(in) :: id
    associate (tile => self%tile(self%tile_of(id)))
      r = 1 + int(mod(id - tile%before - 1, int(tile%rows%n, i8)), i4)
    end associate
  end function row_of_id

  !> Grains of a packing in the order of their ids.
  pure subroutine order_rows(tile)
    type(dem_packing_type), intent(inout) :: tile
    integer(i4) :: order(tile%n)
    order = sorted_order(tile%id)
    tile%id = tile%id(order)
    tile%kind = tile%kind(order)
    tile%x = tile%x(:, order)
    tile%quat = tile%quat(:, order)
    tile%axes = tile%axes(:, order)
    tile%skew = tile%skew(:, order)
    tile%exponent = tile%exponent(order)
    tile%v = tile%v(:, order)
    tile%omega = tile%omega(:, order)
  end subroutine order_rows

  !> Ids and places of all that sleep.
  subroutine list_asleep(self, d, ids, x)
    class(dem_bed_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i8), allocatable, intent(out) :: ids(:)
    real(wp), allocatable, intent(out) :: x(:, :)  !! (3, n) [m]
    logical, allocatable :: awake(:)
    integer(i4) :: i, k, n

    n = int(self%grains(), i4)
    allocate (awake(n), source=.false.)
    do i = 1, d%grains%n
      if (d%grains%id(i) <= n) awake(d%grains%id(i)) = .true.
    end do
    ids = pack([(int(i, i8), i=1, n)], .not. awake)
    allocate (x(3, size(ids)))
    do k = 1, size(ids)
      x(:, k) = self%place_of(ids(k))
    end do
  end subroutine list_asleep

  !> What the tile knows of a batch's grains by their ids, in the state in which they wake; places
  !! only where none are given.
  subroutine fill_batch(self, batch, placed, turned, waking)
    class(dem_bed_type), intent(in) :: self
    type(dem_packing_type), intent(inout) :: batch
    logical, intent(in) :: placed, turned  !! with places, with orientations of their own
    type(waking_type), intent(in) :: waking
    real(wp) :: quat(4), offset(3)
    integer(i4) :: i, r
    do i = 1, batch%n
      r = self%row_of_id(batch%id(i))
      associate (rows => self%tile(self%tile_of(batch%id(i)))%rows)
        quat = rows%quat(:, r)
        batch%axes(:, i) = rows%axes(:, r)
        batch%skew(:, i) = rows%skew(:, r)
        batch%exponent(i) = rows%exponent(r)
      end associate
      offset = 0.0_wp
      if (waking%history(i) > 0) then
        associate (state => self%replays%kept(waking%history(i)))
          quat = state%quat(:, r)
          offset = matmul(rotation_of(waking%turn(:, i)), state%offset(:, r))
        end associate
      end if
      if (.not. placed) batch%x(:, i) = self%place_of(batch%id(i))
      batch%x(:, i) = batch%x(:, i) + offset
      if (.not. turned) batch%quat(:, i) = quaternion_product(waking%turn(:, i), quat)
    end do
  end subroutine fill_batch

  !> States of the tile at the end of some histories, in their order; others are forgotten.
  subroutine follow_histories(self, like, material, knots, stretch, steps, errors)
    class(dem_bed_type), intent(inout) :: self
    type(dem_system_type), intent(in) :: like
    integer(i4), intent(in) :: material        !! of the grains
    integer(i4), intent(in) :: knots(:)        !! of each history
    real(wp), intent(in) :: stretch(:, :, :)   !! (3, 3, all knots)
    integer(i4), intent(out) :: steps          !! taken for them
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: number(size(knots)), k, last
    last = 0
    steps = 0
    do k = 1, size(knots)
      associate (history => stretch(:, :, last + 1:last + knots(k)))
        number(k) = self%replays%find(history)
        if (number(k) == 0) then
          call self%replays%follow(self%tile(1)%rows, like, material, history, errors)
          if (errors%any()) return
          number(k) = size(self%replays%kept)
          steps = steps + self%replays%kept(number(k))%steps
        end if
      end associate
      last = last + knots(k)
    end do
    self%replays%kept = self%replays%kept(number)
  end subroutine follow_histories

  !> Where a grain sleeps [m].
  pure function place_of(self, id) result(x)
    class(dem_bed_type), intent(in) :: self
    integer(i8), intent(in) :: id
    real(wp) :: x(3)
    associate (rows => self%tile(self%tile_of(id))%rows)
      x = rows%x(:, self%row_of_id(id)) + matmul(rows%cell, real(self%copy_of(id), wp))
    end associate
  end function place_of

  !> Copy in which a grain is, from 0.
  pure function copy_of(self, id) result(copy)
    class(dem_bed_type), intent(in) :: self
    integer(i8), intent(in) :: id
    integer(i4) :: copy(3), c
    associate (tile => self%tile(self%tile_of(id)))
      c = int((id - tile%before - 1)/tile%rows%n, i4)
    end associate
    copy(1) = mod(c, self%copies(1))
    copy(2) = mod(c/self%copies(1), self%copies(2))
    copy(3) = c/(self%copies(1)*self%copies(2))
  end function copy_of

  !> Id of a row of a tile in a copy, 0 outside of the bed.
  pure integer(i8) function id_of(self, tile, row, copy) result(id)
    class(dem_bed_type), intent(in) :: self
    type(tile_type), intent(in) :: tile
    integer(i4), intent(in) :: row, copy(3)
    id = 0
    if (any(copy < 0 .or. copy >= self%copies)) return
    id = tile%before + row + int(tile%rows%n, i8) &
         *(copy(1) + self%copies(1)*(copy(2) + self%copies(2)*copy(3)))
  end function id_of

  !> Ids of the grains of the same tile whose centres are nearer to that of a grain than a reach.
  pure function near(self, id, reach) result(others)
    class(dem_bed_type), intent(in) :: self
    integer(i8), intent(in) :: id
    real(wp), intent(in) :: reach  !! less than half of the cell [m]
    integer(i8), allocatable :: others(:)
    real(wp) :: apart(3), back(3, 3)
    integer(i4) :: r, own, shift(3), n
    integer(i8) :: found
    associate (tile => self%tile(self%tile_of(id)))
      allocate (others(tile%rows%n))
      own = self%row_of_id(id)
      back = inverse_of(tile%rows%cell)
      n = 0
      do r = 1, tile%rows%n
        apart = tile%rows%x(:, r) - tile%rows%x(:, own)
        shift = -nint(matmul(back, apart))
        if (norm2(apart + matmul(tile%rows%cell, real(shift, wp))) > reach .or. r == own) cycle
        found = self%id_of(tile, r, self%copy_of(id) + shift)
        if (found == 0) cycle
        n = n + 1
        others(n) = found
      end do
      others = others(:n)
    end associate
  end function near

  !> Tangential forces of the tile's contacts between grains that wake (ids, rising) and those and
  !! others that are awake; of two that wake the state of the one with the lower id counts.
  subroutine springs_of(self, d, ids, springs, waking)
    class(dem_bed_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: ids(:)
    type(start_springs_type), intent(inout) :: springs
    type(waking_type), intent(in), optional :: waking  !! left out: as the tile is
    real(wp) :: turn(3, 3)
    integer(i4) :: k, m, before

    m = 0
    allocate (springs%ids(2, 16*size(ids)), springs%force(3, 16*size(ids)))
    do k = 1, size(ids)
      if (.not. present(waking)) then
        call add_springs(self, d, ids, k, self%tile(self%tile_of(ids(k)))%contacts, springs, m)
        cycle
      end if
      before = m
      if (waking%history(k) > 0) then
        call add_springs(self, d, ids, k, self%replays%kept(waking%history(k))%contacts, springs, m)
      else
        call add_springs(self, d, ids, k, self%tile(self%tile_of(ids(k)))%contacts, springs, m)
      end if
      turn = rotation_of(waking%turn(:, k))
      springs%force(:, before + 1:m) = matmul(turn, springs%force(:, before + 1:m))
    end do
    springs%ids = springs%ids(:, :m)
    springs%force = springs%force(:, :m)
    springs%given = m
  end subroutine springs_of

  !> Contacts of the k-th of these grains in a state of the tile.
  subroutine add_springs(self, d, ids, k, contacts, springs, m)
    type(dem_bed_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: ids(:)
    integer(i4), intent(in) :: k
    type(tile_contacts_type), intent(in) :: contacts
    type(start_springs_type), intent(inout) :: springs
    integer(i4), intent(inout) :: m  !! so far
    integer(i4) :: c, r, end_of, shift(3)
    integer(i8) :: other

    r = self%row_of_id(ids(k))
    do c = contacts%start(r), contacts%start(r + 1) - 1
      associate (at => abs(contacts%contact(c)))
        end_of = merge(1, 2, contacts%contact(c) > 0)  ! this grain is the first, or the second
        shift = merge(1, -1, end_of == 1)*contacts%shift(:, at)
        other = self%id_of(self%tile(self%tile_of(ids(k))), contacts%row(3 - end_of, at), &
                           self%copy_of(ids(k)) + shift)
        if (.not. joins(d, ids, other, ids(k))) cycle
        m = m + 1
        if (m > size(springs%ids, 2)) call more_room(springs)
        springs%ids(:, m) = [ids(k), other]
        springs%force(:, m) = merge(1.0_wp, -1.0_wp, end_of == 1)*contacts%force(:, at)
      end associate
    end do
  end subroutine add_springs

  !> Twice the room.
  pure subroutine more_room(springs)
    type(start_springs_type), intent(inout) :: springs
    integer(i8), allocatable :: ids(:, :)
    real(wp), allocatable :: force(:, :)
    associate (n => size(springs%ids, 2))
      allocate (ids(2, 2*n), force(3, 2*n))
      ids(:, :n) = springs%ids
      force(:, :n) = springs%force
    end associate
    call move_alloc(ids, springs%ids)
    call move_alloc(force, springs%force)
  end subroutine more_room

  !> Is the other one awake, or wakes and has the larger id, so that the pair comes once?
  pure logical function joins(d, ids, other, this)
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: ids(:), other, this
    integer(i4) :: low, high, middle
    joins = .false.
    if (other == 0) return
    joins = index_of(d, real(other, wp)) > 0
    if (joins .or. other < this) return
    low = 1
    high = size(ids, kind=i4)
    do while (low < high)
      middle = (low + high)/2
      if (ids(middle) < other) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    joins = ids(low) == other
  end function joins
end module dem_bed
