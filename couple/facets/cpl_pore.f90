!> The liquid in the pores across facets: a whole side of the grid of the grains lies on them.
!!
!! The grid's nodes follow the facets, x = sum N x_a, and hold the pressures p = sum N p_a of the
!! facets' corners. What liquid comes to them in an interval goes to the corners by the transpose,
!! and their forces to the nodes of the facets, so that no liquid and no force is lost. A step of
!! the solid does not know how much more liquid the grains would take for more pressure: an
!! admittance on the corners stands for that; what it withholds is given back in the next interval.
!! Or the grid does not hold the pressures but gives way to its own as the solid would, by a
!! conductance, and springs hold the facets against the liquid. eqs. C.40 to C.46
module cpl_pore
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_a, dot_conductance, dot_content, dot_darcy, dot_entered, &
    dot_flow_work, dot_fluid_in, dot_force, dot_p, dot_u, dot_v, dot_work
  use cpl_facet_map, only: facet_map_type
  implicit none
  private
  real(wp), parameter :: newest = 0.3_wp  !! share of the newest flow in the mean one

  public :: pore_link_type, pore_books_type, side_set, wet_set, hull_set, to_facets, row_of

  character(len=*), parameter :: side_set = 'side'   !! of the grains: nodes of the grid
  character(len=*), parameter :: wet_set = 'wet'     !! of the solid: corners, pressures
  character(len=*), parameter :: hull_set = 'hull'   !! of the solid: nodes of the facets

  !> Volumes and works, as both sides report them and as they went over.
  type :: pore_books_type
    real(wp) :: content(2) = 0.0_wp    !! gained by grains, solid [m^3]
    real(wp) :: entered(2) = 0.0_wp    !! of that through their own boundaries [m^3]
    real(wp) :: flow_work(2) = 0.0_wp  !! [J]
    real(wp) :: darcy(2) = 0.0_wp      !! [J]
    real(wp) :: step_work = 0.0_wp     !! of the side on the grains' liquid in the interval [J]
    real(wp) :: work(2) = 0.0_wp       !! of the facets on grains, of the liquid on the solid [J]
    real(wp) :: to_solid = 0.0_wp      !! came from the grains [m^3]
    real(wp) :: lent = 0.0_wp          !! put into the solid beyond that [m^3]
    real(wp) :: passed = 0.0_wp        !! either way [m^3]
  end type pore_books_type

  !> Nodal values of the grid (g), of the facets' nodes (m) and of their corners (c).
  type :: pore_link_type
    logical :: active = .false.
    logical :: permeable = .true.
    logical :: returned = .true.
    logical :: yields = .false.              !! by a conductance of the grid's side
    logical :: dynamic = .false.             !! the solid uses the mean of its loads at both ends
    logical :: held_start = .false.          !! the force at the start is balanced by a dead load
    type(facet_map_type) :: hull             !! grid's nodes on the facets
    type(facet_map_type) :: wet              !! grid's nodes on the facets' corners
    real(wp), allocatable :: x_ref(:, :)     !! of the grid's nodes (3, g) [m]
    real(wp), allocatable :: storage(:)      !! of the half bricks, at corners (c) [m^3/Pa]
    real(wp), allocatable :: ahead(:)        !! admittance times an interval (c) [m^3/Pa]
    real(wp), allocatable :: area(:)         !! of the grid's nodes on the side (g) [m^2]
    real(wp), allocatable :: conduct(:)      !! of the grid's side (g) [m^3/Pa]
    real(wp) :: estimate = 0.0_wp            !! of it, by area [m/Pa]
    real(wp) :: stiffness = 0.0_wp           !! of the liquid, for each ghost's spring [N/m]
    real(wp) :: span = 0.0_wp                !! of the interval [s]
    real(wp), allocatable :: mean_flow(:)    !! to the grains, running mean (g) [m^3/s]
    real(wp), allocatable :: expected(:)     !! to the grains in the interval (g) [m^3/s]
    real(wp), allocatable :: u(:, :), v(:, :), v_before(:, :), w(:, :)  !! of the nodes (3, m)
    real(wp), allocatable :: u_new(:, :), v_new(:, :), w_new(:, :)      !! on trial
    real(wp), allocatable :: p(:), p_new(:)  !! at the corners, accepted and on trial [Pa]
    real(wp), allocatable :: p_held(:)       !! that the grid holds in the interval [Pa]
    real(wp), allocatable :: kept(:)         !! withheld in the interval before (c) [m^3]
    real(wp), allocatable :: flow(:)         !! to the grains in the interval (g) [m^3]
    real(wp), allocatable :: force(:, :)     !! of the liquid on the side (3, g) [N]
    real(wp), allocatable :: force_put(:, :)    !! that a dynamic solid holds at the start (3, g)
    real(wp), allocatable :: start_force(:, :)  !! at the start (3, g) [N]
    type(pore_books_type) :: books, books_new
  contains
    procedure :: init
    procedure :: predict
    procedure :: follow_facets
    procedure :: put_grains
    procedure :: read_grains
    procedure :: start_grains
    procedure :: put_solid
    procedure :: read_solid
    procedure :: start_solid
    procedure :: accept
    procedure :: balance
    procedure :: finite
  end type pore_link_type

contains

  !> Room for all nodal values, zero; the maps are there.
  subroutine init(self)
    class(pore_link_type), intent(inout) :: self
    integer(i4) :: g, m, c
    g = self%hull%ghosts
    m = self%hull%nodes
    c = merge(self%wet%nodes, 0, self%permeable)
    allocate (self%u(3, m), self%v(3, m), self%v_before(3, m), self%w(3, m), self%u_new(3, m), &
              self%v_new(3, m), self%w_new(3, m), self%force(3, g), self%start_force(3, g), &
              self%force_put(3, g), source=0.0_wp)
    allocate (self%p(c), self%p_new(c), self%p_held(c), self%kept(c), self%flow(g), source=0.0_wp)
    allocate (self%mean_flow(g), self%expected(g), source=0.0_wp)
    if (.not. allocated(self%storage)) allocate (self%storage(c), self%ahead(c), source=0.0_wp)
    if (.not. allocated(self%conduct)) allocate (self%conduct(g), source=0.0_wp)
    self%active = .true.
  end subroutine init

  !> Values at the grid's nodes of nodal values of facets.
  pure function to_side(map, nodal) result(value)
    type(facet_map_type), intent(in) :: map
    real(wp), intent(in) :: nodal(:, :)  !! (rows, nodes)
    real(wp) :: value(size(nodal, 1), map%ghosts)
    integer(i4) :: g, a
    value = 0.0_wp
    do g = 1, map%ghosts
      do a = 1, size(map%weight, 1)
        value(:, g) = value(:, g) + map%weight(a, g)*nodal(:, map%corner(a, g))
      end do
    end do
  end function to_side

  !> The transpose: sums are kept.
  pure function to_facets(map, value) result(nodal)
    type(facet_map_type), intent(in) :: map
    real(wp), intent(in) :: value(:, :)  !! (rows, g)
    real(wp) :: nodal(size(value, 1), map%nodes)
    integer(i4) :: g, a
    nodal = 0.0_wp
    do g = 1, map%ghosts
      do a = 1, size(map%weight, 1)
        associate (n => map%corner(a, g))
          nodal(:, n) = nodal(:, n) + map%weight(a, g)*value(:, g)
        end associate
      end do
    end do
  end function to_facets

  !> One row of values.
  pure function row_of(value) result(row)
    real(wp), intent(in) :: value(:)
    real(wp) :: row(1, size(value))
    row(1, :) = value
  end function row_of

  !> Motion of the side in the next interval of length h [s], as that of the ghosts; pressures are
  !! those found last.
  subroutine predict(self, h, dynamic)
    class(pore_link_type), intent(inout) :: self
    real(wp), intent(in) :: h
    logical, intent(in) :: dynamic
    if (.not. self%active) return
    self%w_new = self%u
    if (dynamic) self%w_new = self%u + h*self%v + 0.5_wp*h*(self%v - self%v_before)
    self%p_held = self%p
    self%span = h
    self%dynamic = dynamic
    self%expected = self%mean_flow
  end subroutine predict

  !> The side goes where the facets are on trial and holds their pressures; or it expects what makes
  !! the flow of the trial end at them. eq. C.44
  subroutine follow_facets(self)
    class(pore_link_type), intent(inout) :: self
    if (.not. self%active) return
    self%w_new = self%u_new
    if (self%yields) then
      self%expected = (self%flow + self%conduct*rise(self))/self%span
    else
      self%p_held = self%p_new
    end if
  end subroutine follow_facets

  !> How the pressures of the side have risen in the trial [Pa].
  pure function rise(self) result(p)
    class(pore_link_type), intent(in) :: self
    real(wp) :: p(self%hull%ghosts), side(1, self%hull%ghosts)
    side = to_side(self%wet, row_of(self%p_new - self%p))
    p = side(1, :)
  end function rise

  !> ADVANCE: velocities and pressures of the side, and how it gives way. eq. C.44
  subroutine put_grains(self, request, h)
    class(pore_link_type), intent(in) :: self
    type(message_type), intent(inout) :: request
    real(wp), intent(in) :: h  !! length of the interval [s]
    real(wp) :: p(1, self%hull%ghosts)
    if (.not. self%active) return
    call request%put(side_set//dot_v, to_side(self%hull, (self%w_new - self%w)/h))
    if (.not. self%permeable) return
    p = to_side(self%wet, row_of(self%p_held))
    call request%put(side_set//dot_p, p(1, :))
    if (.not. self%yields) return
    call request%put(side_set//dot_conductance, self%conduct)
    call request%put(side_set//dot_fluid_in, self%expected*h)
  end subroutine put_grains

  !> Liquid that came to the grains, and forces on the side.
  subroutine read_grains(self, reply, errors)
    class(pore_link_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    call reply%get(side_set//dot_force, self%force, errors)
    call reply%get(side_set//dot_fluid_in, self%flow, errors)
    call reply%get(side_set//dot_work, self%books_new%step_work, errors)
    call read_books(self, reply, side_set, 1_i4, errors)
  end subroutine read_grains

  !> Contents and works of a side (1 grains, 2 solid).
  subroutine read_books(self, reply, set, side, errors)
    class(pore_link_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    character(len=*), intent(in) :: set
    integer(i4), intent(in) :: side
    type(error_list_type), intent(inout) :: errors
    call reply%get(set//dot_content, self%books_new%content(side), errors)
    call reply%get(set//dot_entered, self%books_new%entered(side), errors)
    call reply%get(set//dot_flow_work, self%books_new%flow_work(side), errors)
    call reply%get(set//dot_darcy, self%books_new%darcy(side), errors)
  end subroutine read_books

  !> READY of the grains: the force at the start, which a dead load may balance.
  subroutine start_grains(self, reply, balanced, errors)
    class(pore_link_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    logical, intent(in) :: balanced
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    call self%read_grains(reply, errors)
    if (balanced) self%start_force = self%force
    self%force_put = self%force - self%start_force
  end subroutine start_grains

  !> SOLVE: forces on the facets; to the corners the liquid that came, what was withheld before, and
  !! what the admittance counts from another pressure than the accepted one.
  subroutine put_solid(self, request)
    class(pore_link_type), intent(in) :: self
    type(message_type), intent(inout) :: request
    if (.not. self%active) return
    call request%put(hull_set//dot_force, to_facets(self%hull, force_at_end(self)))
    if (self%permeable) call request%put(wet_set//dot_fluid_in, came(self) + lent(self))
  end subroutine put_solid

  !> Load of the solid at the end of the interval [N]: with inertia and pressures that change within
  !! the interval, the mean of the loads at both ends is the mean force.
  pure function force_at_end(self) result(force)
    class(pore_link_type), intent(in) :: self
    real(wp) :: force(3, self%hull%ghosts)
    force = self%force - self%start_force
    if (self%dynamic .and. self%yields) force = 2.0_wp*force - self%force_put
  end function force_at_end

  !> Liquid from the grains at the corners in the interval [m^3].
  pure function came(self) result(volume)
    class(pore_link_type), intent(in) :: self
    real(wp) :: volume(self%wet%nodes), nodal(1, self%wet%nodes)
    nodal = to_facets(self%wet, row_of(-self%flow))
    volume = nodal(1, :)
  end function came

  !> What the coupling puts in besides: what it withheld before, and what the solid stores in its
  !! place for the pressures that the grid held. eq. C.42
  pure function lent(self) result(volume)
    class(pore_link_type), intent(in) :: self
    real(wp) :: volume(self%wet%nodes)
    volume = self%ahead*(self%p_held - self%p)
    if (self%returned) volume = volume + self%kept
  end function lent

  !> Motion and pressures from a reply of the solid.
  subroutine read_solid(self, reply, errors)
    class(pore_link_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    real(wp) :: unused(3, self%hull%nodes)
    if (.not. self%active) return
    call reply%get(hull_set//dot_u, self%u_new, errors)
    call reply%get(hull_set//dot_v, self%v_new, errors)
    call reply%get(hull_set//dot_a, unused, errors)
    if (.not. self%permeable) return
    call reply%get(wet_set//dot_p, self%p_new, errors)
    call read_books(self, reply, wet_set, 2_i4, errors)
  end subroutine read_solid

  !> READY of the solid.
  subroutine start_solid(self, reply, errors)
    class(pore_link_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    call self%read_solid(reply, errors)
    self%u = self%u_new
    self%w = self%u_new
    self%v = self%v_new
    self%v_before = self%v_new
    self%p = self%p_new
    self%books = self%books_new
  end subroutine start_solid

  !> The trial becomes the state.
  subroutine accept(self)
    class(pore_link_type), intent(inout) :: self
    real(wp) :: nodal(3, self%hull%nodes)
    if (.not. self%active) return
    nodal = to_facets(self%hull, self%force)
    self%force_put = force_at_end(self)
    associate (b => self%books_new, old => self%books)
      b%work = old%work + [b%step_work, sum(nodal*(self%u_new - self%u))]
      if (self%permeable) then
        b%to_solid = old%to_solid + sum(came(self))
        b%passed = old%passed + sum(abs(came(self)))
        b%lent = old%lent + sum(lent(self))
        self%kept = self%ahead*(self%p_new - self%p_held)
        self%mean_flow = self%mean_flow + newest*(self%flow/self%span - self%mean_flow)
      end if
    end associate
    self%books = self%books_new
    self%u = self%u_new
    self%w = self%w_new
    self%v_before = self%v
    self%v = self%v_new
    self%p = self%p_new
  end subroutine accept

  !> Liquid that neither came through a boundary nor went over, in both sides together [m^3].
  pure real(wp) function balance(self)
    class(pore_link_type), intent(in) :: self
    balance = 0.0_wp
    associate (b => self%books)
      if (self%permeable) balance = sum(b%content - b%entered) - b%lent
    end associate
  end function balance

  !> Are pressures and forces numbers?
  pure logical function finite(self)
    class(pore_link_type), intent(in) :: self
    finite = .true.
    if (self%active) finite = all(abs(self%p_new) < huge(1.0_wp)) .and. &
      all(abs(self%flow) < huge(1.0_wp)) .and. all(abs(self%force) < huge(1.0_wp))
  end function finite
end module cpl_pore
