!> State of the interface: where ghosts and facets are, and the forces between them.
module cpl_interface
  use talus_kinds, only: wp, i4, i8
  use talus_vectors, only: turned
  use talus_message, only: message_type
  use talus_port_names, only: field_fields, field_force, field_id, field_impulse, field_material, &
    field_moment, field_moment_impulse, field_role, field_set, field_triangle, field_work, &
    field_x, role_name, role_prescribe, role_surface
  use cpl_facet_map, only: facet_map_type
  use cpl_interface_state, only: interface_place_type, interface_start_type, &
    interface_motion_type, interface_forces_type, interface_watch_type, interface_ledger_type
  use cpl_kicks, only: kicks_type
  use cpl_pieces, only: pieces_type
  use cpl_pore, only: pore_link_type
  use cpl_relax, only: relax_type
  use cpl_springs, only: springs_type
  use cpl_transfer, only: transfer_type
  implicit none
  private
  public :: interface_type, select_ghosts, ghost_set, ghost_fields, node_set, phi_set

  character(len=*), parameter :: ghost_set = 'ghosts'     !! set of the grains
  character(len=*), parameter :: ghost_fields = field_force// &
    ','//field_moment//','//field_impulse//','//field_moment_impulse//','//field_work
  character(len=*), parameter :: node_set = 'interface'   !! set of the solid
  character(len=*), parameter :: phi_set = 'rotations'    !! set of its micro-rotations

  !> Displacements count from the state at the start, forces of ghosts have 3 rows, with rotation 6
  !! (moments behind). Nodal values of m columns
  !! are those of cpl_transfer: nodes, then micro-rotations [rad]. The ghosts follow a motion w of
  !! the nodes; the solid's own is u.
  type :: interface_type
    type(facet_map_type) :: map
    type(transfer_type) :: transfer
    type(springs_type) :: springs
    type(relax_type) :: relax
    type(pieces_type) :: pieces               !! of an exchange
    logical :: dynamic = .false.             !! the solid has inertia
    logical :: explicit = .false.            !! and steps explicitly
    type(kicks_type) :: kicks                 !! of an explicit solid
    integer(i8) :: step = 0                  !! accepted exchanges
    type(interface_place_type) :: place
    type(interface_start_type) :: start
    type(interface_motion_type) :: motion
    type(interface_forces_type) :: forces
    type(interface_watch_type) :: watch
    type(interface_ledger_type) :: ledger
    type(pore_link_type) :: pore
  contains
    procedure :: init
    procedure :: resume
    procedure :: orient
    procedure :: follow
    procedure :: follow_facets
    procedure :: lift
    procedure :: lay_springs
    procedure :: lay_springs_ahead
    procedure :: mean_motion
    procedure :: is_steady
    procedure :: predict
    procedure :: gap
    procedure :: settled
    procedure, private :: force_lag
    procedure :: accept
    procedure :: count_exchange
    procedure :: keep_rehearsed
    procedure :: finite
  end type interface_type

contains

  !> Zero state for a map and an operator that have been built.
  subroutine init(self, x_ghost, x_all)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: x_ghost(:, :)  !! (3, g) [m]
    real(wp), intent(in) :: x_all(:, :)    !! all nodes of the mesh (3, n) [m]
    integer(i4) :: g, m, c

    g = self%map%ghosts
    m = self%transfer%blocks
    c = self%transfer%rows
    self%place%x_ref = x_ghost
    self%place%x_start = x_ghost
    self%place%x_node = x_all(:, self%map%node_id)
    self%place%all_nodes = size(x_all, 2)
    allocate (self%motion%d(c, g), self%motion%d_new(c, g), self%forces%p_mean(c, g), &
      self%forces%p_end(c, g), self%forces%p_put(c, g), self%forces%p_before(c, g), &
      self%forces%m_mean(3, g), self%motion%quat(4, g), self%motion%quat_new(4, g), source=0.0_wp)
    allocate (self%motion%u(3, m), self%motion%v(3, m), self%motion%v_before(3, m), &
      self%motion%u_new(3, m), self%motion%v_new(3, m), self%motion%w(3, m), self%motion%w_new(3, &
      m), self%motion%w_spring(3, m), self%motion%drift(3, m), self%place%u_start(3, m), &
      self%start%dead_load(3, m), source=0.0_wp)
    self%motion%quat(1, :) = 1.0_wp
    self%motion%quat_new = self%motion%quat
  end subroutine init

  !> Request of SELECT: the ghosts, or the corners of the surface as vertices.
  subroutine select_ghosts(self, request)
    type(interface_type), intent(in) :: self
    type(message_type), intent(inout) :: request
    call request%put_text(field_set, ghost_set)
    call request%put_int(field_id, self%map%ghost_id)
    if (len(self%place%material) == 0) then
      call request%put_text(field_role, role_name(role_prescribe))
      call request%put_text(field_fields, ghost_fields)
      return
    end if
    call request%put_text(field_role, role_name(role_surface))
    call request%put_text(field_fields, field_force//','//field_impulse//','//field_work)
    call request%put_text(field_material, self%place%material)
    call request%put(field_x, self%place%x_start)
    call request%put_int(field_triangle, self%place%triangle)
  end subroutine select_ghosts

  !> Motion of the ghosts from that of the nodes, after a checkpoint was read or a start was found.
  subroutine resume(self)
    class(interface_type), intent(inout) :: self
    call self%transfer%to_ghosts(self%place%u_start, self%motion%d)
    self%place%x_start = self%place%x_ref + self%motion%d(:3, :)
    call self%transfer%to_ghosts(self%motion%w, self%motion%d)
    self%motion%quat_new = self%motion%quat
  end subroutine resume

  !> Orientations of the ghosts, accepted and on trial.
  subroutine orient(self, quat)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: quat(:, :)  !! (4, g)
    self%motion%quat = quat
    self%motion%quat_new = quat
  end subroutine orient

  !> The ghosts go where the trial motion w_new of the nodes takes them. They turn by the change of
  !! their rotation since the accepted state, at a constant spin: the power of the moments is then
  !! that of the nodal forces.
  subroutine follow(self)
    class(interface_type), intent(inout) :: self
    integer(i4) :: g
    call self%transfer%to_ghosts(self%motion%w_new, self%motion%d_new)
    if (self%transfer%rows == 3) return
    do g = 1, self%map%ghosts
      self%motion%quat_new(:, g) = turned(self%motion%quat(:, g), self%motion%d_new(4:6, g) &
        - self%motion%d(4:6, g))
    end do
  end subroutine follow

  !> The ghosts go where the facets are (trial).
  subroutine follow_facets(self)
    class(interface_type), intent(inout) :: self
    self%motion%w_new = self%motion%u_new
    call self%follow()
    call self%pore%follow_facets()
  end subroutine follow_facets

  !> A dead load bears the weight of masses that nodes have besides their own.
  subroutine lift(self, mass, gravity)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: mass(:)     !! of the map's nodes [kg]
    real(wp), intent(in) :: gravity(3)  !! [m/s^2]
    integer(i4) :: k
    do k = 1, size(mass)
      self%start%dead_load(:, k) = self%start%dead_load(:, k) - mass(k)*gravity
    end do
  end subroutine lift

  !> Springs are laid where the ghosts are (trial), or ahead of them by a share of the motion of
  !! the interval.
  subroutine lay_springs(self, ahead)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in), optional :: ahead  !! [-]
    self%motion%w_spring = self%motion%w_new
    if (present(ahead)) &
      self%motion%w_spring = self%motion%w_spring + ahead*(self%motion%w_new - self%motion%w)
  end subroutine lay_springs

  !> The running mean of the motion in an interval, its steady part.
  subroutine mean_motion(self)
    class(interface_type), intent(inout) :: self
    real(wp), parameter :: newest = 0.3_wp  !! share of the newest motion in the mean
    associate (m => self%motion)
      m%drift = m%drift + newest*(m%w_new - m%w - m%drift)
    end associate
  end subroutine mean_motion

  !> Is the motion of an interval small beside the whole of it? With a liquid, that lets go of what
  !! it bears bit by bit, also where it is hardly another than those before. Not where a load has
  !! just come: what it moves at first is no steady motion. Exchanges in pieces need not be so
  !! careful: they get shorter where springs overshoot.
  pure logical function is_steady(self)
    class(interface_type), intent(in) :: self
    real(wp), parameter :: small = 0.005_wp, in_pieces = 0.1_wp, alike = 0.3_wp
    real(wp) :: share
    share = small
    if (self%pieces%most > 1) share = in_pieces/self%pieces%now
    associate (m => self%motion)
      is_steady = maxval(abs(m%drift)) <= share*maxval(abs(m%w_new))
      if (self%pore%active .and. .not. is_steady) &
        is_steady = maxval(abs(m%w_new - m%w - m%drift)) <= alike*maxval(abs(m%drift))
    end associate
  end function is_steady

  !> Springs are laid ahead of the ghosts by the steady part of their motion, so that they do not
  !! hold it back.
  !! eq. C.2
  subroutine lay_springs_ahead(self)
    class(interface_type), intent(inout) :: self
    self%motion%w_spring = self%motion%w_new + self%motion%drift
  end subroutine lay_springs_ahead

  !> Motion that the ghosts follow in the next interval of length h [s]. Statics: to where the
  !! facets were found last (lagged: extrapolation halves the stable stiffness). Dynamics: straight
  !! on with the velocity and its last change.
  subroutine predict(self, h)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: h
    self%motion%w_new = self%motion%u
    if (self%dynamic) &
      self%motion%w_new = self%motion%u + h*self%motion%v + 0.5_wp*h*(self%motion%v &
      - self%motion%v_before)
    call self%follow()
    call self%pore%predict(h, self%dynamic)
  end subroutine predict

  !> Largest distance between the ghosts (trial) and the facets (trial) [m].
  pure real(wp) function gap(self)
    class(interface_type), intent(in) :: self
    real(wp) :: on_facet(self%transfer%rows, self%map%ghosts)
    call self%transfer%to_ghosts(self%motion%u_new, on_facet)
    gap = sqrt(maxval(sum((on_facet(:3, :) - self%motion%d_new(:3, :))**2, 1)))
  end function gap

  !> Are the force measured and the force put on the solid the same, within a relative tolerance?
  pure logical function settled(self, tolerance)
    class(interface_type), intent(in) :: self
    real(wp), intent(in) :: tolerance
    real(wp) :: scale
    scale = maxval(abs(self%forces%p_mean(:3, :)))
    settled = maxval(abs(self%forces%p_mean(:3, :) - self%relax%held(:3, :))) <= tolerance*scale
    if (self%transfer%rows == 3 .or. .not. settled) return
    scale = max(scale*self%relax%arm, maxval(abs(self%forces%p_mean(4:, :))))
    settled = maxval(abs(self%forces%p_mean(4:, :) - self%relax%held(4:, :))) <= tolerance*scale
  end function settled

  !> Forces of the ghosts that the solid does not carry yet, |N'P - K u| over the larger of |N'P|
  !! and |K u|, or a thousandth of the largest so far [-]: what springs hold back, what
  !! under-relaxation withholds, what came after the solid had stepped.
  subroutine force_lag(self, lag)
    class(interface_type), intent(inout) :: self
    real(wp), intent(out) :: lag
    real(wp), dimension(3, self%transfer%blocks) :: whole, rest
    real(wp), parameter :: nothing = 1.0e-3_wp  !! of the largest force
    real(wp) :: scale
    lag = 0.0_wp
    call self%transfer%to_nodes(self%forces%p_mean, whole)
    if (self%springs%n > 0) then
      call self%springs%force(self%motion%w_spring - self%motion%u_new, rest)
    else
      call self%transfer%to_nodes(self%forces%p_mean - self%relax%held, rest)
    end if
    whole(:, self%map%nodes + 1:) = whole(:, self%map%nodes + 1:)/self%relax%arm
    rest(:, self%map%nodes + 1:) = rest(:, self%map%nodes + 1:)/self%relax%arm
    scale = sqrt(max(sum(whole**2), sum((whole - rest)**2)))
    self%ledger%largest = max(self%ledger%largest, scale)
    scale = max(scale, nothing*self%ledger%largest)
    if (scale > 0.0_wp) lag = sqrt(sum(rest**2))/scale
  end subroutine force_lag

  !> The trial becomes the state; h is the interval's length [s].
  subroutine accept(self, h)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: h
    real(wp) :: nodal(3, self%transfer%blocks), work

    call self%force_lag(self%ledger%lag)
    call self%transfer%to_nodes(self%relax%held, nodal)
    work = sum(nodal*(self%motion%u_new - self%motion%u))
    if (self%kicks%active) work = self%kicks%work &
      - sum(self%start%dead_load*(self%motion%u_new - self%motion%u))
    self%ledger%solid_work = self%ledger%solid_work + work
    self%ledger%grains_work = self%ledger%grains_work + self%ledger%step_work
    self%ledger%work_turnover = self%ledger%work_turnover + max(abs(work), &
      abs(self%ledger%step_work))
    if (self%transfer%rows == 3) self%ledger%lost_impulse = self%ledger%lost_impulse + &
      h*norm2(sum(self%forces%m_mean, 2) + self%transfer%moment_of(self%forces%p_mean))
    self%motion%u = self%motion%u_new
    self%motion%w = self%motion%w_new
    self%motion%v_before = self%motion%v
    self%motion%v = self%motion%v_new
    self%motion%d = self%motion%d_new
    self%motion%quat = self%motion%quat_new
    self%ledger%grains = self%ledger%grains_new
    self%ledger%solid = self%ledger%solid_new
    call self%pore%accept()
    self%ledger%all_iterations = self%ledger%all_iterations + self%ledger%iterations
  end subroutine accept

  !> An exchange is complete.
  pure subroutine count_exchange(self)
    class(interface_type), intent(inout) :: self
    self%step = self%step + 1
    self%ledger%pieces = self%pieces%now
  end subroutine count_exchange

  !> What the ghosts did on trial in a rehearsal is where they are; the solid stays on trial.
  subroutine keep_rehearsed(self)
    class(interface_type), intent(inout) :: self
    self%motion%w = self%motion%w_new
    self%motion%d = self%motion%d_new
    self%motion%quat = self%motion%quat_new
  end subroutine keep_rehearsed

  !> Are motion and forces numbers?
  pure logical function finite(self)
    class(interface_type), intent(in) :: self
    finite = all(abs(self%motion%u_new) < huge(1.0_wp)) &
      .and. all(abs(self%forces%p_mean) < huge(1.0_wp)) &
      .and. all(abs(self%forces%p_end) < huge(1.0_wp)) .and. self%pore%finite()
  end function finite
end module cpl_interface
