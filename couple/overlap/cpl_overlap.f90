!> State of an overlap: free grains, ghosts, prescribed nodes and edge nodes, and the forces that
!! are transferred between them (theory: overlap coupling).
!!
!! Prescribed nodes follow the free grains; those of the edge have mass and are moved here. Forces
!! are those on what is free: `force` on the free grains through prescribed nodes, `f` on the edge.
module cpl_overlap
  use talus_kinds, only: wp, i4, i8
  use talus_vectors, only: cross, turn_all
  use cpl_cells, only: cells_type
  use cpl_choices, only: interface_aitken
  use cpl_operators, only: operators_type
  use cpl_overlap_forces, only: overlap_forces_type
  use cpl_overlap_motion, only: overlap_motion_type, nodes_type, increment_type
  use cpl_overlap_state, only: overlap_rules_type, overlap_map_type, overlap_own_type, &
    overlap_limit_type, overlap_share_type, overlap_start_type, overlap_ledger_type
  use cpl_relax, only: relax_type
  use cpl_sets, only: sets_type, pack_type
  use cpl_sums, only: work_since, add_works
  implicit none
  private
  public :: overlap_type, ghost_set, free_set, pulled_set, prescribed_set, edge_set, &
    prescribed_phi_set, edge_phi_set, off_set

  real(wp), parameter :: least_factor = 0.1_wp          !! of Aitken
  character(len=*), parameter :: ghost_set = 'ghosts'   !! of the grains
  character(len=*), parameter :: free_set = 'free'      !! of the grains, whose motion is reported
  character(len=*), parameter :: pulled_set = 'pulled'  !! the same, which forces are put on
  character(len=*), parameter :: prescribed_set = 'hats'       !! of the solid
  character(len=*), parameter :: edge_set = 'edge'
  character(len=*), parameter :: off_set = 'off'        !! nodes of no continuum
  character(len=*), parameter :: prescribed_phi_set = 'hat_rotations'
  character(len=*), parameter :: edge_phi_set = 'edge_rotations'

  type :: overlap_type
    type(cells_type) :: cells
    type(sets_type) :: sets
    type(pack_type) :: pack
    type(operators_type) :: op
    integer(i8) :: step = 0                        !! accepted exchanges
    type(relax_type) :: relax                      !! static: what the edge is loaded with
    type(overlap_rules_type) :: rules
    type(overlap_map_type) :: map
    type(overlap_own_type) :: own
    type(overlap_limit_type) :: limit
    type(overlap_share_type) :: share
    type(overlap_start_type) :: start
    type(overlap_motion_type) :: motion
    type(overlap_forces_type) :: forces
    type(overlap_ledger_type) :: ledger
  contains
    procedure :: allocate_state
    procedure :: follow
    procedure :: follow_prescribed
    procedure :: pull
    procedure :: resist
    procedure :: note_work
    procedure :: note_dead
    procedure :: count_exchange
    procedure :: count_from_here
    procedure :: kick_edge
    procedure :: drift_edge
    procedure :: place_edge
    procedure :: kick_nodes
    procedure :: kick_turns
    procedure :: drift_nodes
    procedure :: drift_turns
    procedure :: follow_around
    procedure :: edge_kinetic
    procedure :: edge_momentum
    procedure :: past_nodes
    procedure :: measure_past
    procedure :: fine_scale
    procedure :: finite
    procedure :: relax_as_static
    procedure :: hold_loads
    procedure :: go_on_from
  end type overlap_type

contains

  !> Zero state for sets and operators that have been made.
  subroutine allocate_state(self)
    class(overlap_type), intent(inout) :: self
    associate (op => self%op, x => self%pack%x, sets => self%sets)
      call self%motion%init(op%free, op%nodes, op%nodes_phi, self%pack%quat(:, sets%ghost))
      call self%forces%init(op%free, op%ghosts, op%nodes, op%nodes_phi, op%prescribed, &
        op%prescribed_phi)
      call self%map%init(x(:, sets%free), x(:, sets%ghost), self%cells%x(:, op%node), &
                         op%nodes_phi, sets%free_spot%element > 0 .and. .not. sets%free_rim)
      allocate (self%own%held(3, op%nodes), self%own%held_phi(3, op%nodes_phi), source=.false.)
      call self%own%take_masses(self%cells%mass(op%node), self%cells%inertia(op%node_phi))
    end associate
  end subroutine allocate_state

  !> Prescribed nodes and ghosts where free grains and edge are now; velocity and spin with which
  !! ghosts came there in dt.
  subroutine follow(self, dt, v, spin)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt                      !! [s]
    real(wp), intent(out) :: v(:, :), spin(:, :)    !! (3, ghosts) [m/s], [rad/s]
    real(wp), dimension(3, self%op%ghosts) :: d, turn

    call self%follow_prescribed(dt)
    call self%op%to_ghosts(self%motion%u, self%motion%phi, d, turn)
    if (self%op%micro%active) then
      turn = self%motion%turn
      call self%op%micro%follow(self%op%ghost_phi, self%motion%phi, turn)
    end if
    v = (d - self%motion%d)/dt
    spin = (turn - self%motion%turn)/dt
    if (.not. self%rules%round) call turn_all(self%motion%quat, turn - self%motion%turn)
    self%motion%d = d
    self%motion%turn = turn
  end subroutine follow

  !> Prescribed nodes where free grains are now.
  subroutine follow_prescribed(self, dt)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt                      !! [s]
    real(wp) :: prescribed(3, self%op%prescribed), prescribed_phi(3, self%op%prescribed_phi)

    prescribed = self%motion%u(:, :self%op%prescribed)
    prescribed_phi = self%motion%phi(:, :self%op%prescribed_phi)
    call self%op%to_prescribed(self%motion%q, self%motion%theta, self%motion%u, self%motion%phi)
    if (self%map%remaps > 0) then
      associate (n => self%op%prescribed, m => self%op%prescribed_phi)
        self%motion%u(:, :n) = self%motion%u(:, :n) + self%map%u_map(:, :n)
        self%motion%phi(:, :m) = self%motion%phi(:, :m) + self%map%phi_map(:, :m)
      end associate
    end if
    self%motion%v(:, :self%op%prescribed) = (self%motion%u(:, :self%op%prescribed) - prescribed)/dt
    self%motion%w(:, :self%op%prescribed_phi) = (self%motion%phi(:, :self%op%prescribed_phi) &
      - prescribed_phi)/dt
  end subroutine follow_prescribed

  !> Forces on ghosts (p, m) and of elements with prescribed nodes (element) transferred to what is
  !! free.
  subroutine pull(self)
    class(overlap_type), intent(inout) :: self
    self%forces%f = self%forces%element
    self%forces%c = self%forces%element_phi
    if (self%forces%loads%active) then
      associate (a => self%op%prescribed, b => self%op%prescribed_phi)
        self%forces%f(:, :a) = self%forces%f(:, :a) + self%forces%loads%f
        self%forces%c(:, :b) = self%forces%c(:, :b) + self%forces%loads%c
      end associate
    end if
    if (self%forces%parts%active) then
      associate (parts => self%forces%parts)
        if (.not. parts%dead_known) then
          parts%dead = parts%mean%force + self%forces%force_hold
          parts%dead_phi = parts%mean%moment + self%forces%moment_hold
          parts%dead_f = parts%mean%f + self%forces%steady + self%forces%f_hold
          parts%dead_c = parts%mean%c + self%forces%steady_phi + self%forces%c_hold
          parts%dead_known = .true.
        end if
        call self%op%pull_some(parts%active_rows, parts%p_active, parts%m_active, self%forces%f, &
          self%forces%c, parts%dead, parts%dead_phi, self%forces%force, self%forces%moment)
        self%forces%f = self%forces%f + parts%dead_f
        self%forces%c = self%forces%c + parts%dead_c
      end associate
    else
      call self%op%pull(self%forces%p, self%forces%m, self%forces%f, self%forces%c, &
        self%forces%force, self%forces%moment)
      self%forces%force = self%forces%force + self%forces%force_hold
      self%forces%moment = self%forces%moment + self%forces%moment_hold
      self%forces%f = self%forces%f + self%forces%steady + self%forces%f_hold
      self%forces%c = self%forces%c + self%forces%steady_phi + self%forces%c_hold
    end if
  end subroutine pull

  !> Damping of the fine scale, then inertia of what prescribed nodes carry under all forces that
  !! act on the free grains now.
  subroutine resist(self)
    class(overlap_type), intent(inout) :: self
    if (self%own%damping%active) call self%own%damping%act(self%op%p, self%motion%speed, &
      self%forces%force)
    if (self%own%damping_phi%active) call self%own%damping_phi%act(self%op%p_phi, &
      self%motion%spin, self%forces%moment)
    if (self%own%carried%active) then
      call self%own%carried%resist(self%forces%contact + self%forces%force, self%forces%inertial)
      call self%op%p%transposed(self%forces%inertial, self%forces%force)
    end if
    if (self%own%carried_phi%active) then
      call self%own%carried_phi%resist(self%forces%contact_moment + self%forces%moment, &
        self%forces%inertial_phi)
      call self%op%p_phi%transposed(self%forces%inertial_phi, self%forces%moment)
    end if
  end subroutine resist

  !> Works of a step of the grains from both sides, with the forces at its end; free grains moved
  !! from where they were a step before. Where forces come in parts ghosts are the active ones, and
  !! `note_dead` is due at the end of the exchange.
  subroutine note_work(self, step)
    class(overlap_type), intent(inout) :: self
    type(increment_type), intent(in) :: step
    real(wp) :: given, taken, through
    given = edge_work(self, self%forces%f, self%forces%c, step%u, step%phi)
    call add_grain_work(self, self%forces%force, self%forces%moment, self%motion%q_before, &
      self%motion%theta_before, given)
    taken = 0.0_wp
    through = 0.0_wp
    if (self%forces%parts%active) then
      call add_works(size(step%moved), self%forces%parts%p_active, step%moved, taken, through)
      call add_works(size(step%turns), self%forces%parts%m_active, step%turns, taken, through)
    else
      call add_works(size(step%moved), self%forces%p, step%moved, taken, through)
      call add_works(size(step%turns), self%forces%m, step%turns, taken, through)
    end if
    call add_loads_work(self, step%u, step%phi, taken, through)
    if (self%own%damping%active) taken = taken + work_since(size(self%motion%q), &
      self%own%damping%force, self%motion%q, self%motion%q_before)
    if (self%own%damping_phi%active) taken = taken + work_since(size(self%motion%q), &
      self%own%damping_phi%force, self%motion%theta, self%motion%theta_before)
    call self%ledger%add(given, taken, through)
    if (.not. self%forces%parts%active) call self%note_dead(self%motion%q_before, &
      self%motion%theta_before, step%u, step%phi)
  end subroutine note_work

  !> Works of elements, loads and inertia on the prescribed nodes since u0, phi0.
  pure subroutine add_loads_work(self, u0, phi0, taken, through)
    type(overlap_type), intent(in) :: self
    real(wp), intent(in), contiguous :: u0(:, :), phi0(:, :)  !! [m], [rad]
    real(wp), intent(inout) :: taken, through
    call add_works(size(u0), self%forces%element, self%motion%u - u0, taken, through)
    call add_works(size(phi0), self%forces%element_phi, self%motion%phi - phi0, taken, through)
    associate (a => self%op%prescribed, b => self%op%prescribed_phi)
      if (self%forces%loads%active) taken = taken + sum(self%forces%loads%f*(self%motion%u(:, :a) &
        - u0(:, :a))) + sum(self%forces%loads%c*(self%motion%phi(:, :b) - phi0(:, :b)))
      if (self%own%carried%active) taken = taken + sum(self%forces%inertial*(self%motion%u(:, :a) &
        - u0(:, :a)))
      if (self%own%carried_phi%active) &
        taken = taken + sum(self%forces%inertial_phi*(self%motion%phi(:, :b) - phi0(:, :b)))
    end associate
  end subroutine add_loads_work

  !> Loads that do not change are no work of the other side: those that balance the start and the
  !! solid's steady ones.
  subroutine note_dead(self, q0, theta0, u0, phi0)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in), contiguous :: q0(:, :), theta0(:, :), u0(:, :), phi0(:, :)  !! [m], [rad]
    real(wp) :: hold
    hold = edge_work(self, self%forces%f_hold, self%forces%c_hold, u0, phi0)
    call add_grain_work(self, self%forces%force_hold, self%forces%moment_hold, q0, theta0, hold)
    self%ledger%hold_work = self%ledger%hold_work + hold
    self%ledger%work_given = self%ledger%work_given - hold
    self%ledger%work_given = self%ledger%work_given - edge_work(self, self%forces%steady, &
      self%forces%steady_phi, u0, phi0)
  end subroutine note_dead

  !> Add the work of forces on the free grains since q0, theta0.
  pure subroutine add_grain_work(self, force, moment, q0, theta0, work)
    type(overlap_type), intent(in) :: self
    real(wp), intent(in), contiguous :: force(:, :), moment(:, :)  !! [N], [N m]
    real(wp), intent(in), contiguous :: q0(:, :), theta0(:, :)     !! [m], [rad]
    real(wp), intent(inout) :: work                                !! [J]
    work = work + work_since(size(q0), force, self%motion%q, q0)
    if (self%rules%turns) work = work + work_since(size(q0), moment, self%motion%theta, theta0)
  end subroutine add_grain_work

  !> Work of forces on the edge since u0, phi0 [J].
  pure real(wp) function edge_work(self, f, c, u0, phi0) result(work)
    type(overlap_type), intent(in) :: self
    real(wp), intent(in), contiguous :: f(:, :), c(:, :), u0(:, :), phi0(:, :)
    associate (a => self%op%prescribed + 1, b => self%op%prescribed_phi + 1)
      work = work_since(size(f(:, a:)), f(:, a:), self%motion%u(:, a:), u0(:, a:)) &
             + work_since(size(c(:, b:)), c(:, b:), self%motion%phi(:, b:), phi0(:, b:))
    end associate
  end function edge_work

  !> An exchange is accepted.
  pure subroutine count_exchange(self)
    class(overlap_type), intent(inout) :: self
    self%step = self%step + 1
  end subroutine count_exchange

  !> Displacements of the free grains count from where they are now; those of the nodes are kept.
  subroutine count_from_here(self)
    class(overlap_type), intent(inout) :: self
    self%map%x_free = self%map%x_free + self%motion%q
    self%map%theta_ref = self%map%theta_ref + self%motion%theta
    self%motion%q = 0.0_wp
    self%motion%theta = 0.0_wp
    self%map%u_map = self%motion%u
    self%map%phi_map = self%motion%phi
    self%map%remaps = self%map%remaps + 1
    self%map%checked = 0.0_wp
  end subroutine count_from_here

  !> Velocities of the edge: v += dt f/m of what the deck does not hold. Nodes of the edge are
  !! integrated here, by talus-couple with every step of the grains, and not by talus-fem, which
  !! holds them as prescribed and returns their forces.
  subroutine kick_edge(self, dt, f, c)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt                !! [s]
    real(wp), intent(in) :: f(:, :), c(:, :)  !! (3, nodes) [N], (3, nodes_phi) [N m]
    integer(i4) :: a
    do a = self%op%prescribed + 1, self%op%nodes
      where (.not. self%own%held(:, a)) self%motion%v(:, a) = self%motion%v(:, a) &
        + dt*f(:, a)/self%own%mass(a)
    end do
    do a = self%op%prescribed_phi + 1, self%op%nodes_phi
      where (.not. self%own%held_phi(:, a)) self%motion%w(:, a) = self%motion%w(:, a) &
        + dt*c(:, a)/self%own%inertia(a)
    end do
  end subroutine kick_edge

  subroutine drift_edge(self, dt)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    associate (a => self%op%prescribed + 1, b => self%op%prescribed_phi + 1)
      self%motion%u(:, a:) = self%motion%u(:, a:) + dt*self%motion%v(:, a:)
      self%motion%phi(:, b:) = self%motion%phi(:, b:) + dt*self%motion%w(:, b:)
    end associate
  end subroutine drift_edge

  !> The edge at a share [-] of its way.
  subroutine place_edge(self, from, to, share)
    class(overlap_type), intent(inout) :: self
    type(nodes_type), intent(in) :: from, to
    real(wp), intent(in) :: share
    associate (a => self%op%prescribed + 1, b => self%op%prescribed_phi + 1)
      self%motion%u(:, a:) = from%u(:, a:) + share*(to%u(:, a:) - from%u(:, a:))
      self%motion%phi(:, b:) = from%phi(:, b:) + share*(to%phi(:, b:) - from%phi(:, b:))
    end associate
  end subroutine place_edge

  !> Velocities of some nodes of a bridging domain: forces of elements over free grains, and once an
  !! exchange those of the others.
  subroutine kick_nodes(self, at, kick, bulk)
    class(overlap_type), intent(inout) :: self
    integer(i4), intent(in) :: at(:)
    real(wp), intent(in) :: kick, bulk  !! [s]
    integer(i4) :: k, a
    do k = 1, size(at)
      a = at(k)
      where (.not. self%own%held(:, a)) self%motion%v(:, a) = self%motion%v(:, a) &
        + (kick*self%forces%f(:, a) + bulk*self%forces%bulk(:, a))/self%own%mass(a)
    end do
  end subroutine kick_nodes

  !> The same of micro-rotations.
  subroutine kick_turns(self, at, kick, bulk)
    class(overlap_type), intent(inout) :: self
    integer(i4), intent(in) :: at(:)
    real(wp), intent(in) :: kick, bulk  !! [s]
    integer(i4) :: k, a
    do k = 1, size(at)
      a = at(k)
      where (.not. self%own%held_phi(:, a)) self%motion%w(:, a) = self%motion%w(:, a) &
        + (kick*self%forces%c(:, a) + bulk*self%forces%bulk_phi(:, a))/self%own%inertia(a)
    end do
  end subroutine kick_turns

  !> Some nodes of a bridging domain go on.
  subroutine drift_nodes(self, at, dt)
    class(overlap_type), intent(inout) :: self
    integer(i4), intent(in) :: at(:)
    real(wp), intent(in) :: dt  !! [s]
    integer(i4) :: a
    do a = 1, size(at)
      associate (k => at(a))
        self%motion%u(:, k) = self%motion%u(:, k) + dt*self%motion%v(:, k)
      end associate
    end do
  end subroutine drift_nodes

  !> The same of micro-rotations.
  subroutine drift_turns(self, at, dt)
    class(overlap_type), intent(inout) :: self
    integer(i4), intent(in) :: at(:)
    real(wp), intent(in) :: dt  !! [s]
    integer(i4) :: a
    do a = 1, size(at)
      associate (k => at(a))
        self%motion%phi(:, k) = self%motion%phi(:, k) + dt*self%motion%w(:, k)
      end associate
    end do
  end subroutine drift_turns

  !> Nodes of the free grains' elements follow the grains, but for some that move by themselves.
  subroutine follow_around(self, at, at_phi)
    class(overlap_type), intent(inout) :: self
    integer(i4), intent(in) :: at(:)
    integer(i4), intent(in), optional :: at_phi(:)
    real(wp) :: u(3, self%op%nodes), phi(3, self%op%nodes_phi)
    u = self%motion%u
    phi = self%motion%phi
    call self%op%to_prescribed(self%motion%q, self%motion%theta, self%motion%u, self%motion%phi)
    self%motion%u(:, at) = u(:, at)
    if (present(at_phi)) self%motion%phi(:, at_phi) = phi(:, at_phi)
  end subroutine follow_around

  !> Kinetic energy of the edge, and of what prescribed nodes carry [J].
  pure real(wp) function edge_kinetic(self)
    class(overlap_type), intent(in) :: self
    integer(i4) :: a
    edge_kinetic = 0.0_wp
    do a = 1, self%op%nodes
      edge_kinetic = edge_kinetic + 0.5_wp*self%own%mass(a)*sum(self%motion%v(:, a)**2)
    end do
    do a = 1, self%op%nodes_phi
      edge_kinetic = edge_kinetic + 0.5_wp*self%own%inertia(a)*sum(self%motion%w(:, a)**2)
    end do
  end function edge_kinetic

  !> Momentum and angular momentum of the edge and of what prescribed nodes carry, about the origin
  !! [kg m/s], [N m s].
  pure function edge_momentum(self) result(momentum)
    class(overlap_type), intent(in) :: self
    real(wp) :: momentum(6), x(3), p(3)
    integer(i4) :: a, k
    momentum = 0.0_wp
    do a = 1, self%op%nodes
      x = self%map%x_node(:, a) + self%motion%u(:, a)
      p = self%own%mass(a)*self%motion%v(:, a)
      momentum(:3) = momentum(:3) + p
      momentum(4:) = momentum(4:) + [x(2)*p(3) - x(3)*p(2), x(3)*p(1) - x(1)*p(3), &
                                     x(1)*p(2) - x(2)*p(1)]
    end do
    do a = 1, self%op%nodes_phi
      p = self%own%inertia(a)*self%motion%w(:, a)
      if (self%op%micro%active) then
        x = self%motion%phi(:, a)
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
    call self%op%p%n%apply(self%motion%u(:, :self%op%prescribed) - self%map%u_map(:, &
      :self%op%prescribed), &
      coarse)
    do k = 1, self%op%free
      past(k) = sqrt((self%motion%q(1, k) - coarse(1, k))**2 + (self%motion%q(2, k) - coarse(2, &
        k))**2 + (self%motion%q(3, k) - coarse(3, k))**2)
    end do
    past = merge(past, 0.0_wp, self%map%seen)
  end function past_nodes

  !> Motion past the nodes now, for the end of an exchange.
  pure subroutine measure_past(self)
    class(overlap_type), intent(inout) :: self
    real(wp) :: past(self%op%free)
    past = self%past_nodes()
    self%map%fine = sqrt(sum(past**2)/max(1, count(self%map%seen)))
    self%map%past = maxval(past)
  end subroutine measure_past

  !> Root mean square of what the nodes do not see of the free grains' motion [m].
  pure real(wp) function fine_scale(self)
    class(overlap_type), intent(in) :: self
    fine_scale = sqrt(sum(self%past_nodes()**2)/max(1, count(self%map%seen)))
  end function fine_scale

  !> Constants of the relaxation of the edge's load: Aitken, whose factor is kept up, as batches end
  !! before the grains are at rest.
  subroutine relax_as_static(self)
    class(overlap_type), intent(inout) :: self
    self%relax%method = interface_aitken
    self%relax%least = least_factor
    self%relax%arm = self%sets%d_max
  end subroutine relax_as_static

  !> Exchanges, works and loads beyond the edge of an overlap whose sets are made anew.
  subroutine go_on_from(self, other)
    class(overlap_type), intent(inout) :: self
    type(overlap_type), intent(in) :: other
    self%step = other%step
    self%ledger = other%ledger
    call self%ledger%lose(other%own%damping%lost + other%own%damping_phi%lost, 0.0_wp)
    if (allocated(other%start%hold)) self%start%hold = other%start%hold
  end subroutine go_on_from

  !> Loads on the nodes from here on, those of prescribed nodes through the free grains.
  subroutine hold_loads(self, f, c)
    class(overlap_type), intent(inout) :: self
    real(wp), intent(in) :: f(:, :), c(:, :)  !! (3, nodes) [N], (3, nodes_phi) [N m]
    self%forces%f_hold = f
    self%forces%c_hold = c
    call self%op%from_prescribed(self%forces%f_hold, self%forces%c_hold, self%forces%force_hold, &
      self%forces%moment_hold)
    call self%forces%parts%forget_dead()
  end subroutine hold_loads

  !> Are motion and forces numbers?
  pure logical function finite(self)
    class(overlap_type), intent(in) :: self
    finite = all(abs(self%motion%u) < huge(1.0_wp)) .and. all(abs(self%forces%p) < huge(1.0_wp)) &
      .and. all(abs(self%forces%force) < huge(1.0_wp)) &
      .and. all(abs(self%forces%bulk) < huge(1.0_wp))
  end function finite
end module cpl_overlap
