!> State of the interface: where ghosts and facets are, and the forces between them.
module cpl_interface
  use talus_kinds, only: wp, i4, i8
  use talus_vectors, only: turned
  use talus_message, only: message_type
  use talus_scalars, only: scalar_count
  use cpl_facet_map, only: facet_map_type
  use cpl_relax, only: relax_type
  use cpl_springs, only: springs_type
  use cpl_transfer, only: transfer_type
  implicit none
  private
  public :: interface_type, select_ghosts, ghost_set, ghost_fields, node_set, phi_set

  character(len=*), parameter :: ghost_set = 'ghosts'     !! set of the grains
  character(len=*), parameter :: ghost_fields = 'force,moment,impulse,moment_impulse,work'
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
    character(len=:), allocatable :: material     !! of a surface that grains touch; '' for ghosts
    integer(i8), allocatable :: triangle(:, :)    !! of the surface (3, k), numbers of ghosts
    logical :: dynamic = .false.             !! the solid has inertia
    integer(i8) :: step = 0                  !! accepted exchanges
    real(wp), allocatable :: radius(:)       !! of the ghosts [m]
    real(wp), allocatable :: x_ref(:, :)     !! ghosts where the map was made (3, g) [m]
    real(wp), allocatable :: x_start(:, :)   !! ghosts at the start (3, g) [m]
    real(wp), allocatable :: x_node(:, :)    !! interface nodes (3, m) [m]
    real(wp), allocatable :: u_start(:, :)   !! of the nodes, from the map's state to the start
    integer(i4) :: all_nodes = 0             !! of the solid
    real(wp), allocatable :: start_stress(:, :)  !! of the relaxed solid at its points (6, q), or
                                                 !! (9, q) if it is micropolar [Pa]
    real(wp), allocatable :: start_couple(:, :)  !! couple stress there (9, q) [N/m]; not allocated
                                                 !! where no node has a micro-rotation
    real(wp), allocatable :: start_load(:, :)    !! on all its nodes [N]
    real(wp), allocatable :: start_moment(:, :)  !! on all its micro-rotations [N m]
    integer(i8), allocatable :: polar_id(:)      !! all nodes with micro-rotations
    real(wp), allocatable :: w(:, :)         !! of the nodes, that the ghosts follow (3, m) [m]
    real(wp), allocatable :: u(:, :)         !! of the nodes, accepted (3, m) [m]
    real(wp), allocatable :: v(:, :)         !! velocity of the nodes, accepted (3, m) [m/s]
    real(wp), allocatable :: v_before(:, :)  !! one exchange earlier
    real(wp), allocatable :: d(:, :)         !! motion of the ghosts, W w (rows, g) [m, rad]
    real(wp), allocatable :: quat(:, :)      !! orientation of the ghosts (4, g)
    real(wp), allocatable :: w_new(:, :)     !! trial values
    real(wp), allocatable :: u_new(:, :)
    real(wp), allocatable :: v_new(:, :)
    real(wp), allocatable :: d_new(:, :)
    real(wp), allocatable :: quat_new(:, :)
    real(wp), allocatable :: w_spring(:, :)  !! where the springs are laid (3, m) [m]
    real(wp), allocatable :: p_mean(:, :)    !! mean force on each ghost over the interval
                                             !! (rows, g) [N, N m]
    real(wp), allocatable :: p_end(:, :)     !! force at its end [N]
    real(wp), allocatable :: p_before(:, :)  !! force at the end of the interval before [N]
    real(wp), allocatable :: p_put(:, :)     !! force at tn that the implicit solid holds [N]
    real(wp), allocatable :: m_mean(:, :)    !! mean moment on each ghost (3, g) [N m]
    real(wp), allocatable :: dead_load(:, :) !! (3, m) [N]
    real(wp) :: grains_work = 0.0_wp         !! by the ghosts' motion on the grains, total [J]
    real(wp) :: solid_work = 0.0_wp          !! by the forces put on the solid, total [J]
    real(wp) :: work_turnover = 0.0_wp       !! sum of |work| over the exchanges [J]
    real(wp) :: step_work = 0.0_wp           !! by the ghosts in this exchange [J]
    real(wp) :: lost_impulse = 0.0_wp        !! of moments, total [N m s]
    real(wp) :: lag = 0.0_wp                 !! force lag of the last exchange [-]
    real(wp) :: largest = 0.0_wp             !! |N'P| or |K u| so far [N]
    integer(i4) :: iterations = 0            !! of the last exchange
    integer(i8) :: all_iterations = 0
    integer(i4) :: outgrown = 0              !! looks at which contacts were stiffer than the
                                             !! springs
    integer(i4) :: refactored = 0            !! times the springs were raised
    real(wp) :: contact_stiffness = 0.0_wp   !! largest of a ghost at the last look [N/m]
    real(wp) :: force_at_look = 0.0_wp       !! largest force on a ghost then [N]
    real(wp) :: grains(scalar_count) = 0.0_wp, solid(scalar_count) = 0.0_wp
    real(wp) :: grains_new(scalar_count) = 0.0_wp, solid_new(scalar_count) = 0.0_wp
  contains
    procedure :: init
    procedure :: resume
    procedure :: follow
    procedure :: predict
    procedure :: gap
    procedure :: settled
    procedure, private :: force_lag
    procedure :: accept
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
    self%x_ref = x_ghost
    self%x_start = x_ghost
    self%x_node = x_all(:, self%map%node_id)
    self%all_nodes = size(x_all, 2)
    allocate (self%d(c, g), self%d_new(c, g), self%p_mean(c, g), self%p_end(c, g), &
              self%p_put(c, g), self%p_before(c, g), self%m_mean(3, g), self%quat(4, g), &
              self%quat_new(4, g), source=0.0_wp)
    allocate (self%u(3, m), self%v(3, m), self%v_before(3, m), self%u_new(3, m), &
              self%v_new(3, m), self%w(3, m), self%w_new(3, m), self%w_spring(3, m), &
              self%u_start(3, m), self%dead_load(3, m), source=0.0_wp)
    self%quat(1, :) = 1.0_wp
    self%quat_new = self%quat
  end subroutine init

  !> Request of SELECT: the ghosts, or the corners of the surface as vertices.
  subroutine select_ghosts(self, request)
    type(interface_type), intent(in) :: self
    type(message_type), intent(inout) :: request
    call request%put_text('set', ghost_set)
    call request%put_int('id', self%map%ghost_id)
    if (len(self%material) == 0) then
      call request%put_text('role', 'prescribe')
      call request%put_text('fields', ghost_fields)
      return
    end if
    call request%put_text('role', 'surface')
    call request%put_text('fields', 'force,impulse,work')
    call request%put_text('material', self%material)
    call request%put('x', self%x_start)
    call request%put_int('triangle', self%triangle)
  end subroutine select_ghosts

  !> Motion of the ghosts from that of the nodes, after a checkpoint was read or a start was found.
  subroutine resume(self)
    class(interface_type), intent(inout) :: self
    call self%transfer%to_ghosts(self%u_start, self%d)
    self%x_start = self%x_ref + self%d(:3, :)
    call self%transfer%to_ghosts(self%w, self%d)
    self%quat_new = self%quat
  end subroutine resume

  !> The ghosts go where the trial motion w_new of the nodes takes them. They turn by the change of
  !! their rotation since the accepted state, at a constant spin: the power of the moments is then
  !! that of the nodal forces.
  subroutine follow(self)
    class(interface_type), intent(inout) :: self
    integer(i4) :: g
    call self%transfer%to_ghosts(self%w_new, self%d_new)
    if (self%transfer%rows == 3) return
    do g = 1, self%map%ghosts
      self%quat_new(:, g) = turned(self%quat(:, g), self%d_new(4:6, g) - self%d(4:6, g))
    end do
  end subroutine follow

  !> Motion that the ghosts follow in the next interval of length h [s]. Statics: to where the
  !! facets were found last (lagged: extrapolation halves the stable stiffness). Dynamics: straight
  !! on with the velocity and its last change.
  subroutine predict(self, h)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: h
    self%w_new = self%u
    if (self%dynamic) &
      self%w_new = self%u + h*self%v + 0.5_wp*h*(self%v - self%v_before)
    call self%follow()
  end subroutine predict

  !> Largest distance between the ghosts (trial) and the facets (trial) [m].
  pure real(wp) function gap(self)
    class(interface_type), intent(in) :: self
    real(wp) :: on_facet(self%transfer%rows, self%map%ghosts)
    call self%transfer%to_ghosts(self%u_new, on_facet)
    gap = sqrt(maxval(sum((on_facet(:3, :) - self%d_new(:3, :))**2, 1)))
  end function gap

  !> Are the force measured and the force put on the solid the same, within a relative tolerance?
  pure logical function settled(self, tolerance)
    class(interface_type), intent(in) :: self
    real(wp), intent(in) :: tolerance
    real(wp) :: scale
    scale = maxval(abs(self%p_mean(:3, :)))
    settled = maxval(abs(self%p_mean(:3, :) - self%relax%held(:3, :))) <= tolerance*scale
    if (self%transfer%rows == 3 .or. .not. settled) return
    scale = max(scale*self%relax%arm, maxval(abs(self%p_mean(4:, :))))
    settled = maxval(abs(self%p_mean(4:, :) - self%relax%held(4:, :))) <= tolerance*scale
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
    call self%transfer%to_nodes(self%p_mean, whole)
    if (self%springs%n > 0) then
      call self%springs%force(self%w_spring - self%u_new, rest)
    else
      call self%transfer%to_nodes(self%p_mean - self%relax%held, rest)
    end if
    whole(:, self%map%nodes + 1:) = whole(:, self%map%nodes + 1:)/self%relax%arm
    rest(:, self%map%nodes + 1:) = rest(:, self%map%nodes + 1:)/self%relax%arm
    scale = sqrt(max(sum(whole**2), sum((whole - rest)**2)))
    self%largest = max(self%largest, scale)
    scale = max(scale, nothing*self%largest)
    if (scale > 0.0_wp) lag = sqrt(sum(rest**2))/scale
  end subroutine force_lag

  !> The trial becomes the state; h is the interval's length [s].
  subroutine accept(self, h)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: h
    real(wp) :: nodal(3, self%transfer%blocks), work

    call self%force_lag(self%lag)
    call self%transfer%to_nodes(self%relax%held, nodal)
    work = sum(nodal*(self%u_new - self%u))
    self%solid_work = self%solid_work + work
    self%grains_work = self%grains_work + self%step_work
    self%work_turnover = self%work_turnover + max(abs(work), abs(self%step_work))
    if (self%transfer%rows == 3) self%lost_impulse = self%lost_impulse + &
      h*norm2(sum(self%m_mean, 2) + self%transfer%moment_of(self%p_mean))
    self%u = self%u_new
    self%w = self%w_new
    self%v_before = self%v
    self%v = self%v_new
    self%d = self%d_new
    self%quat = self%quat_new
    self%grains = self%grains_new
    self%solid = self%solid_new
    self%step = self%step + 1
    self%all_iterations = self%all_iterations + self%iterations
  end subroutine accept

  !> Are motion and forces numbers?
  pure logical function finite(self)
    class(interface_type), intent(in) :: self
    finite = all(abs(self%u_new) < huge(1.0_wp)) .and. all(abs(self%p_mean) < huge(1.0_wp)) .and. &
      all(abs(self%p_end) < huge(1.0_wp))
  end function finite
end module cpl_interface
