!> The sets of the overlap, found from geometry: free grains under prescribed nodes (Q, D^), ghosts
!! under free nodes (Q^, D), and the rules that they must keep (theory: overlap coupling).
module cpl_sets
  use talus_kinds, only: wp, i4, i8
  use talus_log, only: short_number
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_cells, only: cells_type, spot_type
  use cpl_hull, only: hull_type
  implicit none
  private
  public :: sets_type, pack_type, numbering, part_rest, part_ghost, part_free, part_none

  integer(i4), parameter :: part_none = -1  !! of the elements: grains alone, no continuum
  integer(i4), parameter :: part_rest = 0   !! continuum alone
  integer(i4), parameter :: part_ghost = 1  !! ghosts are in them
  integer(i4), parameter :: part_free = 2   !! free grains are in them
  integer(i4), parameter :: named = 5       !! ids that a message names
  integer(i4), parameter :: kind_ghost = 3  !! of grains, at the port

  !> Grains as the partner describes them.
  type :: pack_type
    integer(i8), allocatable :: id(:)
    real(wp), allocatable :: x(:, :)      !! (3, n) [m]
    real(wp), allocatable :: quat(:, :)   !! orientations (4, n)
    real(wp), allocatable :: radius(:)    !! of the ball around each [m]
    real(wp), allocatable :: mass(:)      !! [kg]
    real(wp), allocatable :: inertia(:)   !! a third of the trace [kg m^2]
    real(wp), allocatable :: slimmest(:)  !! least principal moment of inertia [kg m^2]
    real(wp), allocatable :: volume(:)    !! [m^3]
    integer(i4), allocatable :: kind(:)   !! 0 free, 1 fixed, 2 driven
    logical, allocatable :: round(:)
  contains
    procedure :: lay_out
  end type pack_type

  !> Grains by their row in the pack, nodes by their id.
  type :: sets_type
    logical :: by_kind = .false.               !! grains know whether they are ghosts: free ones in
                                               !! elements of ghosts stay free
    logical :: free_rim = .false.              !! no node follows the free grains
    integer(i4), allocatable :: part(:)        !! (elements) part_*
    integer(i4), allocatable :: free(:)        !! free grains under prescribed nodes
    integer(i4), allocatable :: ghost(:)
    integer(i4), allocatable :: outside(:)     !! free grains under no element
    type(spot_type), allocatable :: free_spot(:), ghost_spot(:)
    integer(i4), allocatable :: prescribed(:)         !! nodes that the free grains move
    integer(i4), allocatable :: edge(:)        !! free nodes of elements with ghosts
    integer(i4), allocatable :: off(:)         !! nodes of no continuum
    logical, allocatable :: fast(:)            !! (elements) has a prescribed node and own energy
    type(hull_type) :: hull                    !! of the elements of the free grains
    real(wp) :: d_max = 0.0_wp                 !! largest diameter of all coupled grains [m]
    real(wp) :: depth = 0.0_wp                 !! of the ghosts' layer [m]
    real(wp) :: least_depth = 3.0_wp           !! of it, in largest diameters [-]
    integer(i4) :: least_in_element = 0        !! free grains in an element, fewest
    real(wp) :: mean_in_element = 0.0_wp
    real(wp) :: least_size = 0.0_wp            !! of the elements of free grains [m]
  contains
    procedure :: sort
    procedure :: take_neighbours
  end type sets_type

contains

  !> Rows for these ids, rising as those of the pack; what is there no more is a free grain of no
  !! size.
  subroutine lay_out(self, id)
    class(pack_type), intent(inout) :: self
    integer(i8), intent(in) :: id(:)
    type(pack_type) :: now
    integer(i4) :: k, row
    now%id = id
    allocate (now%x(3, size(id)), now%quat(4, size(id)), now%radius(size(id)), &
              now%mass(size(id)), now%inertia(size(id)), now%slimmest(size(id)), &
              now%volume(size(id)), source=0.0_wp)
    allocate (now%kind(size(id)), source=0_i4)
    allocate (now%round(size(id)), source=.false.)
    now%quat(1, :) = 1.0_wp
    row = 1
    do k = 1, size(id)
      do while (row < size(self%id))
        if (self%id(row) >= id(k)) exit
        row = row + 1
      end do
      if (row > size(self%id)) exit
      if (self%id(row) /= id(k)) cycle
      now%x(:, k) = self%x(:, row)
      now%quat(:, k) = self%quat(:, row)
      now%radius(k) = self%radius(row)
      now%mass(k) = self%mass(row)
      now%inertia(k) = self%inertia(row)
      now%slimmest(k) = self%slimmest(row)
      now%volume(k) = self%volume(row)
      now%kind(k) = self%kind(row)
      now%round(k) = self%round(row)
    end do
    self%id = now%id
    self%x = now%x
    self%quat = now%quat
    self%radius = now%radius
    self%mass = now%mass
    self%inertia = now%inertia
    self%slimmest = now%slimmest
    self%volume = now%volume
    self%kind = now%kind
    self%round = now%round
  end subroutine lay_out

  !> Sort grains and nodes; part is set already. Faults I422 to I424, I426, I428.
  subroutine sort(self, cells, pack, errors)
    class(sets_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(pack_type), intent(in) :: pack
    type(error_list_type), intent(inout) :: errors

    call sort_nodes(self, cells, errors)
    if (errors%any()) return
    call sort_grains(self, cells, pack, errors)
    if (errors%any()) return
    call self%hull%build(cells, self%part == part_free)
    call check_counts(self, cells, errors)
    call check_depth(self, cells, errors)
  end subroutine sort

  !> Nodes of the free grains' elements are prescribed, unless the rim is free; all others that
  !! ghosts or they reach are of the edge. I423: an element with ghosts but without a free node.
  subroutine sort_nodes(self, cells, errors)
    type(sets_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(error_list_type), intent(inout) :: errors
    logical :: prescribed(cells%nodes), edge(cells%nodes), used(cells%nodes)
    integer(i4), allocatable :: bad(:)
    integer(i4) :: e, k

    prescribed = .false.
    edge = .false.
    used = .false.
    allocate (bad(0))
    do e = 1, cells%elements
      if (self%part(e) == part_free .and. .not. self%free_rim) &
        prescribed(cells%nodes_of(e)) = .true.
    end do
    allocate (self%fast(cells%elements))
    do e = 1, cells%elements
      associate (node => cells%node(cells%start(e):cells%start(e + 1) - 1))
        if (is_continuum(self, e)) used(node) = .true.
        self%fast(e) = self%part(e) /= part_free .and. self%part(e) /= part_none .and. &
                       any(prescribed(node))
        if (self%part(e) == part_ghost .and. all(prescribed(node))) bad = [bad, e]
        if (self%part(e) == part_ghost .or. self%fast(e)) edge(node) = .true.
      end associate
    end do
    self%prescribed = pack([(k, k=1, cells%nodes)], prescribed)
    self%edge = pack([(k, k=1, cells%nodes)], edge .and. .not. prescribed)
    self%off = pack([(k, k=1, cells%nodes)], .not. used)
    if (size(bad) > 0) call errors%add('I423', str(size(bad))//' elements of the ghosts have '// &
      'no free node, such as '//list(int(bad, i8)), '', 'all their nodes belong to elements of '// &
      'free grains: give these elements to free_elements, or let the layers of both be blocks')
  end subroutine sort_nodes

  !> Has element e continuum? Where free grains are it is what their nodes carry.
  pure logical function is_continuum(self, e)
    type(sets_type), intent(in) :: self
    integer(i4), intent(in) :: e
    is_continuum = self%part(e) /= part_none .and. .not. (self%free_rim .and. &
                                                          self%part(e) == part_free)
  end function is_continuum

  !> A grain that is a ghost already moves with the element of ghosts that it is in or just beside:
  !! within its element it does not stand where the nodes alone would carry it; least of all one
  !! that has made room beside another tile, and may stand in continuum alone.
  subroutine prefer_ghosts(self, cells, x, spot)
    type(sets_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: x(3)  !! [m]
    type(spot_type), intent(inout) :: spot
    real(wp), parameter :: slack(3) = [0.1_wp, 0.3_wp, 0.6_wp]  !! of natural coordinates
    type(spot_type) :: beside
    integer(i4) :: k
    if (spot%element > 0) then
      if (self%part(spot%element) == part_ghost) return
    end if
    do k = 1, size(slack)
      call cells%find_beside(x, self%part == part_ghost, slack(k), beside)
      if (beside%element > 0) exit
      if (spot%element == 0) exit
      if (self%part(spot%element) /= part_rest) exit
    end do
    if (beside%element > 0) spot = beside
  end subroutine prefer_ghosts

  !> I422 free grains where only continuum is, I428 grains that cannot be ghosts.
  subroutine sort_grains(self, cells, pack_of, errors)
    type(sets_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(pack_type), intent(in) :: pack_of
    type(error_list_type), intent(inout) :: errors
    integer(i4), dimension(size(pack_of%id)) :: free, ghost, outside, lost, held
    type(spot_type), allocatable :: spot(:)
    integer(i4) :: g, n(5)

    allocate (spot(size(pack_of%id)))
    n = 0
    do g = 1, size(pack_of%id)
      call cells%find(pack_of%x(:, g), self%part, spot(g))
      if (self%by_kind .and. pack_of%kind(g) == kind_ghost) &
        call prefer_ghosts(self, cells, pack_of%x(:, g), spot(g))
      if (spot(g)%element > 0) then
        associate (part => self%part(spot(g)%element))
          if (part == part_none .or. (self%by_kind .and. part /= part_free .and. &
                                      pack_of%kind(g) == 0)) spot(g) = spot_type()
        end associate
      end if
      if (spot(g)%element == 0) then
        if (pack_of%kind(g) == 0) call put(g, n(1), outside)
      else if (self%part(spot(g)%element) == part_free) then
        if (pack_of%kind(g) == 0) call put(g, n(2), free)
      else if (self%part(spot(g)%element) == part_ghost) then
        if (pack_of%kind(g) == 2) call put(g, n(5), held)
        call put(g, n(3), ghost)
      else
        call put(g, n(4), lost)
      end if
    end do
    self%outside = outside(:n(1))
    self%free = free(:n(2))
    self%ghost = ghost(:n(3))
    self%free_spot = spot(self%free)
    self%ghost_spot = spot(self%ghost)
    associate (at => [self%free, self%ghost])
      if (size(at) > 0) self%d_max = 2.0_wp*maxval(pack_of%radius(at))
    end associate
    if (n(4) > 0) call errors%add('I422', str(n(4))//' grains are in elements of continuum '// &
      'alone, such as '//list(pack_of%id(lost(:n(4)))), '', 'cut them off the packing, or name '// &
      'these elements in &overlap ghost_elements')
    if (n(5) > 0) call errors%add('I428', str(n(5))//' driven grains are among the ghosts, '// &
      'such as '//list(pack_of%id(held(:n(5)))), '', 'what the deck drives must stay out of '// &
      'the elements of the ghosts')
    if (n(2) == 0 .or. n(3) == 0) call errors%add('I421', str(n(2))//' free grains and '// &
      str(n(3))//' ghosts are in the elements of the overlap', '', &
      'grains and mesh must overlap: check units and positions of both')
  end subroutine sort_grains

  !> Free grains under no element but within the length of one of those of the free grains: they may
  !! come under one, and become free grains that no node sees yet (spot%element = 0).
  subroutine take_neighbours(self, pack_of)
    class(sets_type), intent(inout) :: self
    type(pack_type), intent(in) :: pack_of
    type(spot_type), allocatable :: spot(:)
    logical :: near(size(self%outside))
    integer(i4) :: k, n
    do k = 1, size(near)
      near(k) = self%hull%distance(pack_of%x(:, self%outside(k))) < self%least_size
    end do
    n = int(size(self%free), i4)
    allocate (spot(n + count(near)))
    spot(:n) = self%free_spot
    call move_alloc(spot, self%free_spot)
    self%free = [self%free, pack(self%outside, near)]
    self%outside = pack(self%outside, .not. near)
  end subroutine take_neighbours

  pure subroutine put(g, n, list_of)
    integer(i4), intent(in) :: g
    integer(i4), intent(inout) :: n, list_of(:)
    n = n + 1
    list_of(n) = g
  end subroutine put

  !> The first few ids.
  pure function list(id) result(text)
    integer(i8), intent(in) :: id(:)
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = ''
    do k = 1, min(named, int(size(id), i4))
      if (k > 1) text = text//', '
      text = text//str(id(k))
    end do
    if (size(id) > named) text = text//', ...'
  end function list

  !> I426: fewer free grains in an element than it has nodes.
  subroutine check_counts(self, cells, errors)
    type(sets_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: inside(cells%elements), k, e
    integer(i4), allocatable :: poor(:)

    inside = 0
    do k = 1, size(self%free)
      e = self%free_spot(k)%element
      inside(e) = inside(e) + 1
    end do
    self%least_size = huge(1.0_wp)
    do e = 1, cells%elements
      if (self%part(e) == part_free) self%least_size = min(self%least_size, &
                                                           cells%volume(e)**(1.0_wp/3.0_wp))
    end do
    self%least_in_element = minval(inside, self%part == part_free)
    self%mean_in_element = real(size(self%free), wp)/count(self%part == part_free)
    if (self%by_kind) return  ! behind a body elements may be poor: the projection is the judge
    poor = pack([(e, e=1, cells%elements)], self%part == part_free .and. &
                inside < cells%start(2:) - cells%start(:cells%elements))
    if (size(poor) > 0) call errors%add('I426', str(size(poor))//' elements of the free grains '// &
      'hold fewer grains than nodes, such as '//list(int(poor, i8))//' with '// &
      str(inside(poor(1))), '', 'take larger elements: about 30 grains an element are wanted '// &
      'for hex8, 60 for hex20')
  end subroutine check_counts

  !> The depth of the ghosts' layer: least distance of nodes that it shares with the continuum from
  !! the free grains' elements. I424: less than asked.
  subroutine check_depth(self, cells, errors)
    type(sets_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(error_list_type), intent(inout) :: errors
    logical :: ghosted(cells%nodes), rest(cells%nodes)
    real(wp), parameter :: slack = 0.01_wp  !! for grains that overlap
    real(wp) :: s
    integer(i4) :: e, a, worst

    ghosted = .false.
    rest = .false.
    do e = 1, cells%elements
      if (self%part(e) == part_ghost) ghosted(cells%nodes_of(e)) = .true.
      if (self%part(e) == part_rest) rest(cells%nodes_of(e)) = .true.
    end do
    self%depth = 0.0_wp
    worst = 0
    do a = 1, cells%nodes
      if (.not. ghosted(a)) cycle
      if (any(rest) .and. .not. rest(a)) cycle
      s = self%hull%distance(cells%x(:, a))
      if (any(rest)) then
        if (worst > 0 .and. s >= self%depth) cycle
      else if (s <= self%depth) then
        cycle
      end if
      self%depth = s
      worst = a
    end do
    if (worst == 0 .or. self%depth >= self%least_depth*self%d_max*(1.0_wp - slack)) return
    call errors%add('I424', 'the layer of ghosts is '//str(self%depth)//' m deep at node '// &
      str(worst)//', less than '//short_number(self%least_depth)//' largest diameters of '// &
      str(self%d_max)//' m', '', 'give more elements to &overlap ghost_elements')
  end subroutine check_depth

  !> Rows of a list of ids: number(id), 0 where an id is not in it.
  pure function numbering(ids, most) result(number)
    integer(i4), intent(in) :: ids(:), most
    integer(i4) :: number(most)
    integer(i4) :: k
    number = 0
    do k = 1, size(ids)
      number(ids(k)) = k
    end do
  end function numbering
end module cpl_sets
