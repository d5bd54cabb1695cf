!> State of an overlap: free grains, ghosts, nodes of the hat and of the edge, and the forces that
!! are handed between them (theory: overlap coupling).
!!
!! Nodes of the hat follow the free grains; those of the edge have mass and are moved here. Forces
!! are those on what is free: `force` on the free grains through hat nodes, `f` on the edge.
module cpl_overlap
  use talus_kinds, only: wp, i4, i8
  use talus_moduli, only: isotropic_type
  use talus_vectors, only: cross, turn_all
  use talus_scalars, only: scalar_count
  use cpl_cells, only: cells_type
  use cpl_choices, only: interface_aitken
  use cpl_fine_damping, only: fine_damping_type
  use cpl_inertia, only: inertia_type
  use cpl_initial, only: initial_type
  use cpl_operators, only: operators_type
  use cpl_parts, only: parts_type
  use cpl_relax, only: relax_type
  use cpl_sets, only: sets_type, pack_type
  use cpl_sums, only: work_since, add_works
  use cpl_weight_fit, only: fit_type
  implicit none
  private
  public :: overlap_type, loads_type, ghost_set, free_set, pulled_set, hat_set, edge_set, &
    hat_phi_set, edge_phi_set

  real(wp), parameter :: least_factor = 0.1_wp          !! of Aitken
  character(len=*), parameter :: ghost_set = 'ghosts'   !! of the grains
  character(len=*), parameter :: free_set = 'free'      !! of the grains, whose motion is told
  character(len=*), parameter :: pulled_set = 'pulled'  !! the same, which forces are put on
  character(len=*), parameter :: hat_set = 'hats'       !! of the solid
  character(len=*), parameter :: edge_set = 'edge'
  character(len=*), parameter :: hat_phi_set = 'hat_rotations'
  character(len=*), parameter :: edge_phi_set = 'edge_rotations'

  !> Loads of the solid's deck on hat nodes, without weight.
  type :: loads_type
    logical :: active = .false.
    logical :: steady = .true.                     !! they do not change with time
    real(wp), allocatable :: f(:, :), c(:, :)      !! (3, hats) [N], (3, hats_phi) [N m]
  end type loads_type

  type :: overlap_type
    type(cells_type) :: cells
    type(sets_type) :: sets
    type(pack_type) :: pack
    type(operators_type) :: op
    integer(i8) :: step = 0                        !! accepted exchanges
    integer(i4) :: substeps = 1                    !! of the grains in an exchange
    logical :: symmetric = .true.
    logical :: static = .false.                    !! the solid has no inertia
    logical :: turns = .false.                     !! rotations of free grains matter
    logical :: round = .true.                      !! all ghosts are spheres
    logical :: round_free = .true.                 !! all free grains are spheres
    logical :: in_parts = .false.                  !! forces between ghosts come once an exchange
    logical :: hears_force = .false.               !! contact forces of the free grains are told
    logical :: hears_speed = .false.               !! velocities of the free grains are told
    real(wp) :: least_weight = 0.0_wp              !! of either side of a bridging domain; 0: ghosts
    type(inertia_type) :: carried, carried_phi     !! masses that hat nodes carry
    type(fine_damping_type) :: damping, damping_phi
    real(wp) :: step_limit = huge(1.0_wp)          !! of the grains' step in the overlap [s]
    real(wp) :: kick_limit = huge(1.0_wp)          !! of the exchange, of what acts in kicks [s]
    character(len=:), allocatable :: kick_mover    !! who moves most at it
    real(wp) :: identity = 0.0_wp                  !! largest error of the operators
    real(wp) :: moved_mass = 0.0_wp                !! from hat nodes to free grains [kg]
    integer(i8), allocatable :: weight_ids(:, :)   !! (2, pairs) of ghosts that may touch
    integer(i4), allocatable :: near_ghosts(:, :)  !! the same by their rows, before a fresh start
    real(wp), allocatable :: weight(:)             !! of their contacts [-]
    real(wp), allocatable :: beta(:)               !! of the quadrature points [-]
    character(len=:), allocatable :: shared        !! how the weights were found
    type(fit_type) :: fit                          !! of the weights
    real(wp) :: disorder = 0.0_wp                  !! unbalance of grains in uniform strain [-]
    logical :: unfit = .false.                     !! no weights were found for a lattice
    logical :: stressed = .false.                  !! the solid begins with the grains' stress
    real(wp), allocatable :: stress(:, :)          !! initial, of the points (9, n) [Pa]
    real(wp), allocatable :: couple(:, :)          !! the same (9, n) [N/m]
    real(wp), allocatable :: steady(:, :), steady_phi(:, :)   !! forces of the solid at the start,
                                                   !! which act in every step of the grains
    type(initial_type) :: initial                  !! its correction to balance
    real(wp) :: start_rest = 0.0_wp                !! largest rest at nodes / contact force [-]
    real(wp), allocatable :: moduli(:, :)          !! of the elements, if not the deck's (6, n)
    real(wp) :: lambda = 0.0_wp, shear = 0.0_wp    !! taken for them [Pa]
    type(isotropic_type) :: affine                 !! of the pack's contacts
    real(wp), allocatable :: factor(:)             !! on the masses of the free grains
    real(wp), allocatable :: x_free(:, :), x_ghost(:, :), x_node(:, :)  !! reference (3, :) [m]
    real(wp), allocatable :: theta_ref(:, :)       !! rotation of the free grains then [rad]
    logical, allocatable :: seen(:)                !! free grains that the nodes see
    logical, allocatable :: told(:)                !! that they have left was said
    real(wp), allocatable :: u_map(:, :), phi_map(:, :)  !! of the nodes when P was made
    real(wp) :: looked = 0.0_wp                    !! motion past the nodes at the last look [m]
    real(wp) :: fine = 0.0_wp, past = 0.0_wp       !! the same now: root mean square, largest [m]
    real(wp) :: fine_damping = 0.0_wp              !! of the deck [1/s]
    integer(i8) :: remaps = 0
    character(len=:), allocatable :: sets_hash     !! of the sets and the first operators
    real(wp), allocatable :: mass(:)               !! of the nodes, what they own [kg]
    real(wp), allocatable :: inertia(:)            !! of their micro-rotations [kg m^2]
    logical, allocatable :: held(:, :), held_phi(:, :)  !! by the solid's deck
    real(wp), allocatable :: q(:, :), theta(:, :)  !! of the free grains (3, free) [m], [rad]
    real(wp), allocatable :: q_before(:, :), theta_before(:, :)  !! a step before
    real(wp), allocatable :: u(:, :), v(:, :)      !! of the nodes (3, nodes) [m], [m/s]
    real(wp), allocatable :: phi(:, :), w(:, :)    !! (3, nodes_phi) [rad], [rad/s]
    real(wp), allocatable :: d(:, :), turn(:, :)   !! of the ghosts (3, ghosts) [m], [rad]
    real(wp), allocatable :: quat(:, :)            !! of the ghosts (4, ghosts)
    real(wp), allocatable :: p(:, :), m(:, :)      !! on the ghosts [N], [N m]
    real(wp), allocatable :: f(:, :), c(:, :)      !! on the nodes, every step of the grains
    real(wp), allocatable :: bulk(:, :), bulk_phi(:, :)      !! the same, once an exchange
    real(wp), allocatable :: element(:, :), element_phi(:, :) !! of elements with hat nodes alone
    real(wp), allocatable :: force(:, :), moment(:, :)        !! on the free grains [N], [N m]
    real(wp), allocatable :: contact(:, :), contact_moment(:, :)  !! of contacts on free grains
    real(wp), allocatable :: speed(:, :), spin(:, :)  !! of free grains, half a step ago [m/s]
    real(wp), allocatable :: inertial(:, :), inertial_phi(:, :)  !! of what hat nodes carry
    real(wp), allocatable :: f_hold(:, :), c_hold(:, :)       !! that balance the start
    real(wp), allocatable :: force_hold(:, :), moment_hold(:, :)
    type(loads_type) :: loads                      !! of the solid's deck on hat nodes
    type(parts_type) :: parts                      !! forces between ghosts, once an exchange
    type(relax_type) :: relax                      !! static: what the edge is loaded with
    real(wp) :: contact_stiffness = 0.0_wp         !! static: mean at the start [N/m]
    integer(i4) :: contact_count = 0               !! static: at the start
    real(wp) :: unbalanced = 0.0_wp                !! static: largest rest / contact force [-]
    real(wp) :: work_given = 0.0_wp                !! by ghosts and nodes on what is free [J]
    real(wp) :: work_taken = 0.0_wp                !! by what is free on ghosts and nodes [J]
    real(wp) :: turnover = 0.0_wp                  !! sum of both without sign [J]
    real(wp) :: hold_work = 0.0_wp                 !! of the loads that balance the start [J]
    real(wp) :: lost = 0.0_wp                      !! taken by what binds a domain [J]
    real(wp) :: grains(scalar_count) = 0.0_wp, solid(scalar_count) = 0.0_wp
  contains
    procedure :: allocate_state
    procedure :: follow
    procedure :: follow_hats
    procedure :: pull
    procedure :: resist
    procedure :: note_work
    procedure :: note_dead
    procedure :: kick_edge
    procedure :: drift_edge
    procedure :: edge_kinetic
    procedure :: edge_momentum
    procedure :: past_nodes
    procedure :: look_past
    procedure :: fine_scale
    procedure :: finite
    procedure :: relax_as_static
  end type overlap_type

contains

  !> Zero state for sets and operators that have been made.
  subroutine allocate_state(self)
    class(overlap_type), intent(inout) :: self
    integer(i4) :: nf, ng, n, np
    nf = self%op%free
    ng = self%op%ghosts
    n = self%op%nodes
    np = self%op%nodes_phi
    allocate (self%q_before(3, nf), self%theta_before(3, nf), source=0.0_wp)
    allocate (self%q(3, nf), self%theta(3, nf), self%force(3, nf), self%moment(3, nf), &
              self%theta_ref(3, nf), self%force_hold(3, nf), self%moment_hold(3, nf), &
              self%contact(3, nf), self%contact_moment(3, nf), self%speed(3, nf), &
              self%spin(3, nf), source=0.0_wp)
    allocate (self%inertial(3, self%op%hats), self%inertial_phi(3, self%op%hats_phi), &
              source=0.0_wp)
    allocate (self%u(3, n), self%v(3, n), self%f(3, n), self%bulk(3, n), self%element(3, n), &
              self%f_hold(3, n), source=0.0_wp)
    allocate (self%phi(3, np), self%w(3, np), self%c(3, np), self%bulk_phi(3, np), &
              self%element_phi(3, np), self%c_hold(3, np), source=0.0_wp)
    allocate (self%d(3, ng), self%turn(3, ng), self%p(3, ng), self%m(3, ng), source=0.0_wp)
    self%quat = self%pack%quat(:, self%sets%ghost)
    allocate (self%held(3, n), self%held_phi(3, np), source=.false.)
    allocate (self%u_map(3, n), self%phi_map(3, np), source=0.0_wp)
    self%seen = self%sets%free_spot%element > 0
    allocate (self%told(nf), source=.false.)
    allocate (self%steady(3, n), self%steady_phi(3, np), source=0.0_wp)
    self%x_free = self%pack%x(:, self%sets%free)
    self%x_ghost = self%pack%x(:, self%sets%ghost)
    self%x_node = self%cells%x(:, self%op%node)
    self%mass = self%cells%mass(self%op%node)
    self%inertia = self%cells%inertia(self%op%node_phi)
  end subroutine allocate_state

  !> Hat nodes and ghosts where free grains and edge are now; velocity and spin with which ghosts
  !! came there in dt.
  subroutine follow(self, dt, v, spin)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt                      !! [s]
    real(wp), intent(out) :: v(:, :), spin(:, :)    !! (3, ghosts) [m/s], [rad/s]
    real(wp), dimension(3, self%op%ghosts) :: d, turn

    call self%follow_hats(dt)
    call self%op%to_ghosts(self%u, self%phi, d, turn)
    if (self%op%micro%active) then
      turn = self%turn
      call self%op%micro%follow(self%op%ghost_phi, self%phi, turn)
    end if
    v = (d - self%d)/dt
    spin = (turn - self%turn)/dt
    if (.not. self%round) call turn_all(self%quat, turn - self%turn)
    self%d = d
    self%turn = turn
  end subroutine follow

  !> Hat nodes where free grains are now.
  subroutine follow_hats(self, dt)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt                      !! [s]
    real(wp) :: hat(3, self%op%hats), hat_phi(3, self%op%hats_phi)

    hat = self%u(:, :self%op%hats)
    hat_phi = self%phi(:, :self%op%hats_phi)
    call self%op%to_hats(self%q, self%theta, self%u, self%phi)
    if (self%remaps > 0) then
      associate (n => self%op%hats, m => self%op%hats_phi)
        self%u(:, :n) = self%u(:, :n) + self%u_map(:, :n)
        self%phi(:, :m) = self%phi(:, :m) + self%phi_map(:, :m)
      end associate
    end if
    self%v(:, :self%op%hats) = (self%u(:, :self%op%hats) - hat)/dt
    self%w(:, :self%op%hats_phi) = (self%phi(:, :self%op%hats_phi) - hat_phi)/dt
  end subroutine follow_hats

  !> Forces on ghosts (p, m) and of elements with hat nodes (element) handed to what is free.
  subroutine pull(self)
    class(overlap_type), intent(inout) :: self
    self%f = self%element
    self%c = self%element_phi
    if (self%loads%active) then
      associate (a => self%op%hats, b => self%op%hats_phi)
        self%f(:, :a) = self%f(:, :a) + self%loads%f
        self%c(:, :b) = self%c(:, :b) + self%loads%c
      end associate
    end if
    if (self%parts%active) then
      associate (parts => self%parts)
        if (.not. parts%dead_known) then
          parts%dead = parts%still%force + self%force_hold
          parts%dead_phi = parts%still%moment + self%moment_hold
          parts%dead_f = parts%still%f + self%steady + self%f_hold
          parts%dead_c = parts%still%c + self%steady_phi + self%c_hold
          parts%dead_known = .true.
        end if
        call self%op%pull_some(parts%near, parts%p_near, parts%m_near, self%f, self%c, &
                               parts%dead, parts%dead_phi, self%force, self%moment)
        self%f = self%f + parts%dead_f
        self%c = self%c + parts%dead_c
      end associate
    else
      call self%op%pull(self%p, self%m, self%f, self%c, self%force, self%moment)
      self%force = self%force + self%force_hold
      self%moment = self%moment + self%moment_hold
      self%f = self%f + self%steady + self%f_hold
      self%c = self%c + self%steady_phi + self%c_hold
    end if
  end subroutine pull

  !> Damping of the fine scale, then inertia of what hat nodes carry under all forces that act on
  !! the free grains now.
  subroutine resist(self)
    class(overlap_type), intent(inout) :: self
    if (self%damping%active) call self%damping%act(self%op%p, self%speed, self%force)
    if (self%damping_phi%active) call self%damping_phi%act(self%op%p_phi, self%spin, self%moment)
    if (self%carried%active) then
      call self%carried%resist(self%contact + self%force, self%inertial)
      call self%op%p%transposed(self%inertial, self%force)
    end if
    if (self%carried_phi%active) then
      call self%carried_phi%resist(self%contact_moment + self%moment, self%inertial_phi)
      call self%op%p_phi%transposed(self%inertial_phi, self%moment)
    end if
  end subroutine resist

  !> Works of a step of the grains from both sides, with the forces at its end; ghosts, or those of
  !! them that p and m act on, moved by d and turn in it, the others from q0, theta0, u0, phi0.
  !! Where forces come in parts `note_dead` is due at the end of the exchange.
  subroutine note_work(self, q0, theta0, u0, phi0, p, m, d, turn)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in), contiguous :: q0(:, :), theta0(:, :), u0(:, :), phi0(:, :)  !! [m], [rad]
    real(wp), intent(in), contiguous :: p(:, :), m(:, :)     !! [N], [N m]
    real(wp), intent(in), contiguous :: d(:, :), turn(:, :)  !! [m], [rad]
    real(wp) :: given, taken, through
    given = work_of(self, self%force, self%moment, self%f, self%c, q0, theta0, u0, phi0)
    taken = 0.0_wp
    through = 0.0_wp
    call add_works(size(p), p, d, taken, through)
    call add_works(size(m), m, turn, taken, through)
    call add_works(size(u0), self%element, self%u - u0, taken, through)
    call add_works(size(phi0), self%element_phi, self%phi - phi0, taken, through)
    associate (a => self%op%hats, b => self%op%hats_phi)
      if (self%loads%active) taken = taken + sum(self%loads%f*(self%u(:, :a) - u0(:, :a))) &
        + sum(self%loads%c*(self%phi(:, :b) - phi0(:, :b)))
      if (self%carried%active) taken = taken + sum(self%inertial*(self%u(:, :a) - u0(:, :a)))
      if (self%carried_phi%active) &
        taken = taken + sum(self%inertial_phi*(self%phi(:, :b) - phi0(:, :b)))
    end associate
    if (self%damping%active) &
      taken = taken + work_since(size(q0), self%damping%force, self%q, q0)
    if (self%damping_phi%active) &
      taken = taken + work_since(size(q0), self%damping_phi%force, self%theta, theta0)
    self%turnover = self%turnover + through
    self%work_given = self%work_given + given
    self%work_taken = self%work_taken + taken
    if (.not. self%parts%active) call self%note_dead(q0, theta0, u0, phi0)
  end subroutine note_work

  !> Loads that do not change are no work of the other side: those that balance the start and the
  !! solid's steady ones.
  subroutine note_dead(self, q0, theta0, u0, phi0)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in), contiguous :: q0(:, :), theta0(:, :), u0(:, :), phi0(:, :)  !! [m], [rad]
    real(wp) :: hold
    hold = work_of(self, self%force_hold, self%moment_hold, self%f_hold, self%c_hold, q0, theta0, &
                   u0, phi0)
    self%hold_work = self%hold_work + hold
    self%work_given = self%work_given - hold
    self%work_given = self%work_given - edge_work(self, self%steady, self%steady_phi, u0, phi0)
  end subroutine note_dead

  !> Work of forces on the free grains and on the edge since q0, theta0, u0, phi0.
  pure real(wp) function work_of(self, force, moment, f, c, q0, theta0, u0, phi0) result(work)
    type(overlap_type), intent(in) :: self
    real(wp), intent(in), contiguous :: force(:, :), moment(:, :), f(:, :), c(:, :)  !! [N], [N m]
    real(wp), intent(in), contiguous :: q0(:, :), theta0(:, :), u0(:, :), phi0(:, :)
    work = edge_work(self, f, c, u0, phi0) + work_since(size(q0), force, self%q, q0)
    if (self%turns) work = work + work_since(size(q0), moment, self%theta, theta0)
  end function work_of

  pure real(wp) function edge_work(self, f, c, u0, phi0) result(work)
    type(overlap_type), intent(in) :: self
    real(wp), intent(in), contiguous :: f(:, :), c(:, :), u0(:, :), phi0(:, :)
    associate (a => self%op%hats + 1, b => self%op%hats_phi + 1)
      work = work_since(size(f(:, a:)), f(:, a:), self%u(:, a:), u0(:, a:)) &
             + work_since(size(c(:, b:)), c(:, b:), self%phi(:, b:), phi0(:, b:))
    end associate
  end function edge_work

  !> Velocities of the edge: v += dt f/m of what the deck does not hold. Nodes of the edge are
  !! integrated here, by talus-couple with every step of the grains, and not by talus-fem, which
  !! holds them as prescribed and returns their forces.
  subroutine kick_edge(self, dt, f, c)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt                !! [s]
    real(wp), intent(in) :: f(:, :), c(:, :)  !! (3, nodes) [N], (3, nodes_phi) [N m]
    integer(i4) :: a
    do a = self%op%hats + 1, self%op%nodes
      where (.not. self%held(:, a)) self%v(:, a) = self%v(:, a) + dt*f(:, a)/self%mass(a)
    end do
    do a = self%op%hats_phi + 1, self%op%nodes_phi
      where (.not. self%held_phi(:, a)) self%w(:, a) = self%w(:, a) + dt*c(:, a)/self%inertia(a)
    end do
  end subroutine kick_edge

  subroutine drift_edge(self, dt)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    associate (a => self%op%hats + 1, b => self%op%hats_phi + 1)
      self%u(:, a:) = self%u(:, a:) + dt*self%v(:, a:)
      self%phi(:, b:) = self%phi(:, b:) + dt*self%w(:, b:)
    end associate
  end subroutine drift_edge

  !> Kinetic energy of the edge, and of what hat nodes carry [J].
  pure real(wp) function edge_kinetic(self)
    class(overlap_type), intent(in) :: self
    integer(i4) :: a
    edge_kinetic = 0.0_wp
    do a = 1, self%op%nodes
      edge_kinetic = edge_kinetic + 0.5_wp*self%mass(a)*sum(self%v(:, a)**2)
    end do
    do a = 1, self%op%nodes_phi
      edge_kinetic = edge_kinetic + 0.5_wp*self%inertia(a)*sum(self%w(:, a)**2)
    end do
  end function edge_kinetic

  !> Momentum and angular momentum of the edge and of what hat nodes carry, about the origin
  !! [kg m/s], [N m s].
  pure function edge_momentum(self) result(momentum)
    class(overlap_type), intent(in) :: self
    real(wp) :: momentum(6), x(3), p(3)
    integer(i4) :: a, k
    momentum = 0.0_wp
    do a = 1, self%op%nodes
      x = self%x_node(:, a) + self%u(:, a)
      p = self%mass(a)*self%v(:, a)
      momentum(:3) = momentum(:3) + p
      momentum(4:) = momentum(4:) + [x(2)*p(3) - x(3)*p(2), x(3)*p(1) - x(1)*p(3), &
                                     x(1)*p(2) - x(2)*p(1)]
    end do
    do a = 1, self%op%nodes_phi
      p = self%inertia(a)*self%w(:, a)
      if (self%op%micro%active) then
        x = self%phi(:, a)
        k = mod(a - 1, self%op%stride) + 1
        x(k) = x(k) + 1.0_wp
        p = cross(x, p)
      end if
      momentum(4:) = momentum(4:) + p
    end do
  end function edge_momentum

  !> Motion of the free grains past the nodes since P was made, |Q - N D^|; 0 of those that the
  !! nodes do not see [m].
  pure function past_nodes(self) result(past)
    class(overlap_type), intent(in) :: self
    real(wp) :: past(self%op%free), coarse(3, self%op%free)
    integer(i4) :: k
    call self%op%p%n%apply(self%u(:, :self%op%hats) - self%u_map(:, :self%op%hats), coarse)
    do k = 1, self%op%free
      past(k) = sqrt((self%q(1, k) - coarse(1, k))**2 + (self%q(2, k) - coarse(2, k))**2 &
                     + (self%q(3, k) - coarse(3, k))**2)
    end do
    past = merge(past, 0.0_wp, self%seen)
  end function past_nodes

  !> Motion past the nodes now, for the end of an exchange.
  pure subroutine look_past(self)
    class(overlap_type), intent(inout) :: self
    real(wp) :: past(self%op%free)
    past = self%past_nodes()
    self%fine = sqrt(sum(past**2)/max(1, count(self%seen)))
    self%past = maxval(past)
  end subroutine look_past

  !> Root mean square of what the nodes do not see of the free grains' motion [m].
  pure real(wp) function fine_scale(self)
    class(overlap_type), intent(in) :: self
    fine_scale = sqrt(sum(self%past_nodes()**2)/max(1, count(self%seen)))
  end function fine_scale

  !> Constants of the relaxation of the edge's load: Aitken, whose factor is kept up, as batches end
  !! before the grains are at rest.
  subroutine relax_as_static(self)
    class(overlap_type), intent(inout) :: self
    self%relax%method = interface_aitken
    self%relax%least = least_factor
    self%relax%arm = self%sets%d_max
  end subroutine relax_as_static

  !> Are motion and forces numbers?
  pure logical function finite(self)
    class(overlap_type), intent(in) :: self
    finite = all(abs(self%u) < huge(1.0_wp)) .and. all(abs(self%p) < huge(1.0_wp)) .and. &
      all(abs(self%force) < huge(1.0_wp)) .and. all(abs(self%bulk) < huge(1.0_wp))
  end function finite
end module cpl_overlap
