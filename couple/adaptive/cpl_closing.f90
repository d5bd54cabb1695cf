!> Elements behind a body that close again: what was opened becomes ghosts, then continuum, whose
!! grains fall asleep (theory-overlap, Closing).
!!
!! Elements at the rim of what is open close together when they lie far enough behind the body and
!! are quiet: between two plans they were strained little, and their grains moved little past that
!! strain. eq. C.23
module cpl_closing
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_hdf5, only: h5_file_type
  use talus_homogenise, only: inverse_of
  use talus_vectors, only: cross
  use cpl_cells, only: cells_type, spot_type
  use cpl_roles, only: roles_type
  use cpl_sets, only: pack_type, part_none, part_rest, part_ghost, part_free
  implicit none
  private
  public :: closing_type, fate_type

  integer(i4), parameter :: free = 0, ghost = 3  !! kinds at the port
  integer(i4), parameter :: fewest = 8           !! grains that a strain is found from
  real(wp), parameter :: flat = 1.0e-6_wp        !! det/trace^3 of places without a strain
  !> How far beside an element a grain is still of it, of natural coordinates.
  real(wp), parameter :: slack(4) = [0.1_wp, 0.3_wp, 0.6_wp, 1.2_wp]

  type :: closing_type
    logical :: active = .false.
    real(wp) :: strain = 0.0_wp             !! between two plans, at most [-]
    real(wp) :: moved = 0.0_wp              !! past it, of the largest diameter [-]
    logical, allocatable :: shut(:)         !! (elements) was open once
    integer(i8), allocatable :: id(:)       !! free grains at the last plan
    real(wp), allocatable :: x(:, :)        !! (3, n) [m]
    real(wp) :: found(2) = 0.0_wp           !! strain and motion of the last look
  contains
    procedure :: read => read_closing
    procedure :: look
    procedure :: note_parts
    procedure :: sort_out
    procedure :: put => put_closing
    procedure :: get => get_closing
  end type closing_type

  !> What becomes of the grains in elements that have closed.
  type :: fate_type
    logical, allocatable :: bound(:), leaving(:)  !! (grains) become ghosts, fall asleep
    real(wp), allocatable :: v(:, :)              !! (3, grains) of bound ones [m/s]
  end type fate_type

contains

  !> Keys of &adapt.
  subroutine read_closing(self, deck)
    class(closing_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    real(wp) :: behind
    call deck%get('adapt', 1, 'close_behind', behind)
    self%active = behind > 0.0_wp
    call deck%get('adapt', 1, 'quiet_strain', self%strain)
    call deck%get('adapt', 1, 'quiet_moved', self%moved)
  end subroutine read_closing

  !> Are these elements quiet? Where the free grains are is kept for the next look. In the first
  !! look nothing is known: they are not.
  subroutine look(self, cells, part, pack_of, chosen, quiet)
    class(closing_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:)      !! (elements)
    type(pack_type), intent(in) :: pack_of  !! as it is now
    logical, intent(in) :: chosen(:)        !! (elements)
    logical, intent(out) :: quiet
    integer(i4), allocatable :: row(:), element(:)
    real(wp), allocatable :: x(:, :), d(:, :)
    type(spot_type) :: spot
    integer(i4) :: k, g, n

    quiet = .false.
    self%found = 0.0_wp
    if (allocated(self%id) .and. any(chosen)) then
      row = rows_of(pack_of%id, self%id)
      allocate (x(3, size(row)), d(3, size(row)), element(size(row)))
      n = 0
      do k = 1, size(row)
        g = row(k)
        if (g == 0) cycle
        spot = spot_type()
        call cells%find(pack_of%x(:, g), part, spot)
        if (spot%element == 0) cycle
        if (.not. chosen(spot%element)) cycle
        n = n + 1
        element(n) = spot%element
        x(:, n) = pack_of%x(:, g)
        d(:, n) = pack_of%x(:, g) - self%x(:, k)
      end do
      call measure(element(:n), x(:, :n), d(:, :n), self%found)
      self%found(2) = self%found(2)/(2.0_wp*maxval(pack_of%radius))
      quiet = self%found(1) <= self%strain .and. self%found(2) <= self%moved
    end if
    associate (rows => pack([(k, k=1, size(pack_of%id))], pack_of%kind == free))
      self%id = pack_of%id(rows)
      self%x = pack_of%x(:, rows)
    end associate
  end subroutine look

  !> Rows of ids in a list, 0 where they are not in it.
  pure function rows_of(list, id) result(row)
    integer(i8), intent(in) :: list(:), id(:)
    integer(i4) :: row(size(id))
    integer(i4), allocatable :: at(:)
    integer(i4) :: k
    allocate (at(0:max(maxval(list), maxval(id))), source=0_i4)
    do k = 1, size(list)
      at(list(k)) = k
    end do
    row = at(id)
  end function rows_of

  !> Largest strain of an element, and root mean square of the motion past it [m].
  subroutine measure(element, x, d, found)
    integer(i4), intent(in) :: element(:)    !! of the grains
    real(wp), intent(in) :: x(:, :), d(:, :)  !! (3, grains) [m]
    real(wp), intent(out) :: found(2)
    real(wp) :: middle(3), mean(3), a(3, 3), b(3, 3), gradient(3, 3), r(3), past
    logical :: mine(size(element))
    integer(i4) :: e, k, n, counted

    found = 0.0_wp
    past = 0.0_wp
    counted = 0
    do e = minval(element), maxval(element)
      mine = element == e
      n = count(mine)
      if (n < fewest) cycle
      middle = sum(x, 2, spread(mine, 1, 3))/n
      mean = sum(d, 2, spread(mine, 1, 3))/n
      a = 0.0_wp
      b = 0.0_wp
      do k = 1, size(element)
        if (.not. mine(k)) cycle
        r = x(:, k) - middle
        a = a + spread(d(:, k) - mean, 2, 3)*spread(r, 1, 3)
        b = b + spread(r, 2, 3)*spread(r, 1, 3)
      end do
      gradient = 0.0_wp
      if (dot_product(b(:, 1), cross(b(:, 2), b(:, 3))) > flat*(b(1, 1) + b(2, 2) + b(3, 3))**3) &
        gradient = matmul(a, inverse_of(b))
      found(1) = max(found(1), 0.5_wp*maxval(abs(gradient + transpose(gradient))))
      do k = 1, size(element)
        if (mine(k)) past = past + sum((d(:, k) - mean - matmul(gradient, x(:, k) - middle))**2)
      end do
      counted = counted + n
    end do
    found(2) = sqrt(past/max(1, counted))
  end subroutine measure

  !> Elements that were open and are not any more.
  subroutine note_parts(self, before, after)
    class(closing_type), intent(inout) :: self
    integer(i4), intent(in) :: before(:), after(:)  !! (elements)
    if (.not. allocated(self%shut)) allocate (self%shut(size(before)), source=.false.)
    self%shut = self%shut .or. &
      ((before == part_none .or. before == part_free) .and. &
       (after == part_ghost .or. after == part_rest))
  end subroutine note_parts

  !> What becomes of the grains in elements that have closed: free ones are ghosts where ghosts are
  !! now, and sleep where continuum alone is. Grains beside the mesh are of the nearest element.
  subroutine sort_out(self, cells, roles, pack_of, v, fate)
    class(closing_type), intent(in) :: self
    type(cells_type), intent(in) :: cells   !! where the nodes are now
    type(roles_type), intent(in) :: roles
    type(pack_type), intent(in) :: pack_of  !! as it is now
    real(wp), intent(in) :: v(:, :)         !! of the nodes (3, nodes) [m/s]
    type(fate_type), intent(out) :: fate
    logical :: material(cells%elements)
    type(spot_type) :: spot
    integer(i4) :: g, s

    allocate (fate%bound(size(pack_of%id)), fate%leaving(size(pack_of%id)), source=.false.)
    allocate (fate%v(3, size(pack_of%id)), source=0.0_wp)
    material = .true.
    do g = 1, size(pack_of%id)
      if (pack_of%kind(g) /= free .and. pack_of%kind(g) /= ghost) cycle
      spot = spot_type()
      call cells%find(pack_of%x(:, g), roles%part, spot)
      do s = 1, size(slack)
        if (spot%element > 0) exit
        call cells%find_beside(pack_of%x(:, g), material, slack(s), spot)
      end do
      if (spot%element == 0) cycle
      associate (part => roles%part(spot%element))
        fate%leaving(g) = part == part_rest
        fate%bound(g) = part == part_ghost .and. self%shut(spot%element) .and. &
          pack_of%kind(g) == free
      end associate
      if (fate%bound(g)) &
        fate%v(:, g) = matmul(v(:, cells%nodes_of(spot%element)), spot%weight(:spot%n))
    end do
  end subroutine sort_out

  subroutine put_closing(self, file, errors)
    class(closing_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    call file%put('/adapt/shut', merge(1_i4, 0_i4, self%shut), errors)
    if (.not. allocated(self%id)) return
    call file%put('/adapt/seen', self%id, errors)
    call file%put('/adapt/seen_x', self%x, errors)
  end subroutine put_closing

  !> The same from a checkpoint (I404).
  subroutine get_closing(self, elements, file, errors)
    class(closing_type), intent(inout) :: self
    integer(i4), intent(in) :: elements
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: shut(elements)
    self%shut = spread(.false., 1, elements)
    if (.not. self%active) return
    shut = 0
    call file%get_into('/adapt/shut', shut, errors)
    self%shut = shut == 1
    if (errors%any() .or. .not. file%exists('/adapt/seen')) return
    call file%get('/adapt/seen', self%id, errors)
    if (errors%any()) return
    allocate (self%x(3, size(self%id)), source=0.0_wp)
    call file%get_into('/adapt/seen_x', self%x, errors)
    if (any(self%id < 1 .or. self%id > huge(1_i4))) call errors%add('I404', "'"//file%path// &
      "': /adapt/seen has no ids", file%path//':/adapt/seen', 'use an older checkpoint')
  end subroutine get_closing
end module cpl_closing
