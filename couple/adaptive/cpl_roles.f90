!> Which elements of the background mesh are whose as a body travels through the bed
!! (theory-overlap, Conversion). Faults D460 to D462.
!!
!! Elements near the way of the body are opened, and those of ghosts that are strained much: grains
!! there are free. The outer layers of the opened elements keep nodes, which follow the free grains;
!! in those inside there is no continuum. Layers around them hold ghosts. What was opened once stays
!! open, until far behind the body it holds nothing any more (eq. C.20) or closes (cpl_closing).
module cpl_roles
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_text, only: str
  use cpl_cells, only: cells_type
  use cpl_choices, only: cpl_choices_type
  use cpl_sets, only: part_none, part_rest, part_ghost, part_free
  implicit none
  private
  public :: roles_type, by_strain, by_ratio, by_plastic

  integer(i4), parameter :: by_strain = 1, by_ratio = 2, by_plastic = 3  !! of what is too much
  character(len=*), parameter :: by_plan = 'adapt'  !! in place of the name of a group

  type :: roles_type
    real(wp) :: centre(3) = 0.0_wp      !! of a box around the body at the start [m]
    real(wp) :: half(3) = 0.0_wp        !! half its edges [m]
    real(wp) :: velocity(3) = 0.0_wp    !! [m/s]
    real(wp) :: within = 0.0_wp         !! elements so near are opened [m]
    integer(i4) :: free_layers = 1, ghost_layers = 2
    integer(i8) :: every = 1            !! exchanges between two plans
    integer(i4) :: rest_steps = 0       !! of new free grains, at most; 0: none
    real(wp) :: rest_reach = 2.0_wp     !! others that may move with them, in largest diameters
    real(wp) :: unbalanced = 2.0e-4_wp  !! at which they are at rest
    integer(i4) :: most_grains = 0      !! awake
    real(wp) :: keep_behind = 0.0_wp    !! grains farther behind the box leave; 0: they stay [m]
    real(wp) :: most_gap = 0.5_wp       !! of the stress of tile and element, over the pressure
    real(wp) :: close_behind = 0.0_wp   !! elements farther behind may close; 0: none does [m]
    !> Strain, q/p and plastic strain at which elements of ghosts are opened; 0: none is [-].
    real(wp) :: opening(3) = 0.0_wp
    logical :: replay = .false.         !! grains wake after the history of their element
    real(wp) :: hold_behind = 0.0_wp    !! depth of the layer before that is held [m]
    real(wp), allocatable :: middle(:, :)     !! of the elements (3, n) [m]
    real(wp), allocatable :: reach(:)         !! from there backwards along the way [m]
    integer(i4), allocatable :: start(:), element(:)  !! elements of each node
    integer(i4), allocatable :: part(:)       !! (elements) now
  contains
    procedure :: read => read_roles
    procedure :: set_mesh
    procedure :: is_due
    procedure :: plan
    procedure :: may_close
    procedure :: far_behind
    procedure, private :: is_near
    procedure, private :: grown
    procedure, private :: fill
  end type roles_type

contains

  !> The group &adapt; D460 what it does not go with, D461 a body that stands.
  subroutine read_roles(self, deck, choices, errors)
    class(roles_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: vector(:)
    character(len=:), allocatable :: birth
    real(wp) :: every

    call deck%get('adapt', 1, 'centre', vector)
    self%centre = vector
    call deck%get('adapt', 1, 'half', vector)
    self%half = vector
    call deck%get('adapt', 1, 'velocity', vector)
    self%velocity = vector
    call deck%get('adapt', 1, 'free_within', self%within)
    call deck%get('adapt', 1, 'free_layers', self%free_layers)
    call deck%get('adapt', 1, 'ghost_layers', self%ghost_layers)
    call deck%get('adapt', 1, 'every_time', every)
    call deck%get('adapt', 1, 'rest_steps', self%rest_steps)
    call deck%get('adapt', 1, 'rest_reach', self%rest_reach)
    call deck%get('adapt', 1, 'unbalanced', self%unbalanced)
    call deck%get('adapt', 1, 'most_grains', self%most_grains)
    call deck%get('adapt', 1, 'birth', birth)
    call deck%get('adapt', 1, 'most_gap', self%most_gap)
    self%replay = birth == 'replay'
    call deck%get('adapt', 1, 'keep_behind', self%keep_behind)
    call deck%get('adapt', 1, 'hold_behind', self%hold_behind)
    call deck%get('adapt', 1, 'close_behind', self%close_behind)
    call deck%get('adapt', 1, 'open_strain', self%opening(by_strain))
    call deck%get('adapt', 1, 'open_ratio', self%opening(by_ratio))
    call deck%get('adapt', 1, 'open_plastic', self%opening(by_plastic))
    self%every = max(1_i8, nint(every/choices%exchange, i8))
    associate (o => choices%overlap)
      if (o%bound .or. o%scheme == 'static' .or. o%partition /= 'share' .or. &
          o%initial /= 'dead_load' .or. o%moduli /= 'deck') &
        call deck%fault(errors, 'D460', 'grains follow a body with ghosts of the bridging '// &
          "scale, partition = 'share', initial = 'dead_load' and the moduli of the deck alone", &
          'adapt', 1, '', 'change &overlap')
      if (o%free_elements /= by_plan .or. o%ghost_elements /= by_plan) &
        call deck%fault(errors, 'D460', 'the plan of &adapt says which elements are whose', &
          'adapt', 1, '', "write free_elements = 'adapt', ghost_elements = 'adapt' in &overlap")
    end associate
    if (.not. any(abs(self%velocity) > 0.0_wp)) &
      call deck%fault(errors, 'D461', 'the body of &adapt stands still', 'adapt', 1, 'velocity', &
                      'give the velocity of the body in the deck of the grains')
  end subroutine read_roles

  !> Middles of the elements at rest, and who is beside whom. D462: the way leaves the mesh.
  subroutine set_mesh(self, cells, t_end, path, errors)
    class(roles_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells  !! not displaced
    real(wp), intent(in) :: t_end          !! [s]
    character(len=*), intent(in) :: path   !! of the deck
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: fill(:)
    real(wp) :: last(3), room
    integer(i4) :: e, k, c

    allocate (self%middle(3, cells%elements), self%reach(cells%elements), &
              self%start(cells%nodes + 1))
    self%start = 0
    do e = 1, cells%elements
      associate (node => cells%nodes_of(e))
        self%middle(:, e) = sum(cells%x(:, node), 2)/size(node)
        self%reach(e) = dot_product(self%velocity, self%middle(:, e)) &
                        - minval(matmul(self%velocity, cells%x(:, node)))
        self%start(node + 1) = self%start(node + 1) + 1
      end associate
    end do
    self%reach = self%reach/norm2(self%velocity)
    self%start(1) = 1
    do k = 1, cells%nodes
      self%start(k + 1) = self%start(k + 1) + self%start(k)
    end do
    allocate (self%element(self%start(cells%nodes + 1)))
    fill = self%start
    do e = 1, cells%elements
      do k = cells%start(e), cells%start(e + 1) - 1
        self%element(fill(cells%node(k))) = e
        fill(cells%node(k)) = fill(cells%node(k)) + 1
      end do
    end do
    last = self%centre + t_end*self%velocity
    do c = 1, 3
      if (.not. abs(self%velocity(c)) > 0.0_wp) cycle
      room = maxval(sign(1.0_wp, self%velocity(c))*cells%x(c, :)) &
             - sign(1.0_wp, self%velocity(c))*last(c) - self%half(c) - self%within
      if (room > 0.0_wp) cycle
      call errors%add('D462', 'the way of the body leaves the mesh: at t_end it lacks '// &
                      str(-room)//' m along '//'xyz'(c:c), path, 'a longer mesh, or an earlier '// &
                      't_end: ghosts and continuum belong before the opened elements')
    end do
  end subroutine set_mesh

  !> Is a plan due after this exchange?
  pure logical function is_due(self, step)
    class(roles_type), intent(in) :: self
    integer(i8), intent(in) :: step
    is_due = mod(step, self%every) == 0
  end function is_due

  !> Parts of the elements from a time on, until the next plan but one.
  subroutine plan(self, cells, time, spell, part, closing, strained)
    class(roles_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: time, spell    !! [s]; two intervals
    integer(i4), allocatable, intent(out) :: part(:)
    logical, intent(in), optional :: closing(:)   !! (elements) are not open any more
    logical, intent(in), optional :: strained(:)  !! (elements) are opened wherever they are
    logical, dimension(size(self%middle, 2)) :: open, inside, ghost
    integer(i4) :: e, k

    open = .false.
    if (allocated(self%part)) open = self%part == part_none .or. self%part == part_free
    if (present(closing)) open = open .and. .not. closing
    if (present(strained)) open = open .or. strained
    do e = 1, size(open)
      if (.not. open(e)) open(e) = self%is_near(self%middle(:, e), time, spell)
    end do
    if (present(strained)) then
      if (any(strained)) call self%fill(cells, open)
    end if
    inside = open
    do k = 1, self%free_layers
      inside = .not. self%grown(cells, .not. inside)
    end do
    ghost = open
    do k = 1, self%ghost_layers
      ghost = self%grown(cells, ghost)
    end do
    part = merge(part_ghost, part_rest, ghost)
    part = merge(part_free, part, open)
    part = merge(part_none, part, inside)
    if (.not. self%keep_behind > 0.0_wp) return
    do e = 1, size(part)
      if (self%far_behind(self%middle(:, e), time) - self%reach(e) < self%hold_behind) &
        part(e) = part_none
    end do
  end subroutine plan

  !> Elements at the rim of what is open that lie far enough behind the body to close.
  subroutine may_close(self, cells, time, spell, may)
    class(roles_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: time, spell    !! [s]; two intervals
    logical, intent(out) :: may(:)         !! (elements)
    integer(i4) :: e
    may = .false.
    if (.not. self%close_behind > 0.0_wp) return
    may = self%grown(cells, self%part == part_ghost .or. self%part == part_rest) &
          .and. self%part == part_free
    do e = 1, size(may)
      if (may(e)) may(e) = self%far_behind(self%middle(:, e), time) + self%reach(e) &
        + self%close_behind < 0.0_wp .and. .not. self%is_near(self%middle(:, e), time, spell)
    end do
  end subroutine may_close

  !> How far a point lies before the plane behind which grains leave, along the way [m].
  pure real(wp) function far_behind(self, x, time) result(before)
    class(roles_type), intent(in) :: self
    real(wp), intent(in) :: x(3), time  !! [m], [s]
    real(wp) :: along(3)
    along = self%velocity/norm2(self%velocity)
    before = dot_product(along, x - self%centre - time*self%velocity) &
             + dot_product(abs(along), self%half) + self%keep_behind
  end function far_behind

  !> Is a point within free_within of the box on its way from time on for a spell? The distance is
  !! convex along the way: its least value is found by cutting the way.
  pure logical function is_near(self, x, time, spell) result(near)
    class(roles_type), intent(in) :: self
    real(wp), intent(in) :: x(3), time, spell
    real(wp) :: low, high, a, b
    integer(i4) :: k
    low = 0.0_wp
    high = spell
    do k = 1, 40
      a = low + (high - low)/3.0_wp
      b = high - (high - low)/3.0_wp
      if (distance(time + a) <= distance(time + b)) then
        high = b
      else
        low = a
      end if
    end do
    near = distance(time + 0.5_wp*(low + high)) <= self%within

  contains

    pure real(wp) function distance(t)
      real(wp), intent(in) :: t
      distance = norm2(max(abs(x - self%centre - t*self%velocity) - self%half, 0.0_wp))
    end function distance
  end function is_near

  !> Elements of ghosts that lie between opened ones with all of their nodes are opened, too.
  subroutine fill(self, cells, open)
    class(roles_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    logical, intent(inout) :: open(:)
    logical :: node(cells%nodes), more
    integer(i4) :: e
    more = allocated(self%part)
    do while (more)
      node = .false.
      do e = 1, size(open)
        if (open(e)) node(cells%nodes_of(e)) = .true.
      end do
      more = .false.
      do e = 1, size(open)
        if (open(e) .or. self%part(e) /= part_ghost) cycle
        if (.not. all(node(cells%nodes_of(e)))) cycle
        open(e) = .true.
        more = .true.
      end do
    end do
  end subroutine fill

  !> These elements and all that share a node with one of them.
  pure function grown(self, cells, marked) result(more)
    class(roles_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: marked(:)
    logical :: more(size(marked)), node(cells%nodes)
    integer(i4) :: e, k
    node = .false.
    do e = 1, size(marked)
      if (marked(e)) node(cells%nodes_of(e)) = .true.
    end do
    more = marked
    do k = 1, cells%nodes
      if (node(k)) more(self%element(self%start(k):self%start(k + 1) - 1)) = .true.
    end do
  end function grown
end module cpl_roles
