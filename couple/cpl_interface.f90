!> State of the interface: where ghosts and facets are, and the forces between them.
module cpl_interface
  use talus_kinds, only: wp, i4, i8
  use talus_scalars, only: scalar_count
  use cpl_facet_map, only: facet_map_type
  use cpl_relax, only: relax_type
  implicit none
  private
  public :: interface_type, ghost_set, ghost_fields, node_set

  character(len=*), parameter :: ghost_set = 'ghosts'     !! set of the grains
  character(len=*), parameter :: ghost_fields = 'force,impulse,moment_impulse,work'
  character(len=*), parameter :: node_set = 'interface'   !! set of the solid

  !> Displacements count from the reference state, in which the facet map was made.
  type :: interface_type
    type(facet_map_type) :: map
    type(relax_type) :: relax
    logical :: dynamic = .false.             !! the solid has inertia
    integer(i8) :: step = 0                  !! accepted exchanges
    real(wp), allocatable :: x_ref(:, :)     !! ghosts (3, g) [m]
    real(wp), allocatable :: x_node(:, :)    !! interface nodes (3, m) [m]
    real(wp), allocatable :: d(:, :)         !! displacement of the ghosts (3, g) [m]
    real(wp), allocatable :: u(:, :)         !! of the nodes, accepted (3, m) [m]
    real(wp), allocatable :: v(:, :)         !! velocity of the nodes, accepted (3, m) [m/s]
    real(wp), allocatable :: v_before(:, :)  !! one exchange earlier
    real(wp), allocatable :: u_new(:, :)     !! trial values
    real(wp), allocatable :: v_new(:, :)
    real(wp), allocatable :: d_new(:, :)
    real(wp), allocatable :: d_spring(:, :)  !! where the springs are laid (3, g) [m]
    real(wp), allocatable :: p_mean(:, :)    !! mean force on each ghost over the interval (3, g)
                                             !! [N]
    real(wp), allocatable :: p_end(:, :)     !! force at its end [N]
    real(wp), allocatable :: p_before(:, :)  !! force at the end of the interval before [N]
    real(wp), allocatable :: p_put(:, :)     !! force at tn that the implicit solid holds [N]
    real(wp), allocatable :: m_mean(:, :)    !! mean moment on each ghost [N m]
    real(wp), allocatable :: dead_load(:, :) !! (3, m) [N]
    real(wp) :: grains_work = 0.0_wp         !! by the ghosts' motion on the grains, total [J]
    real(wp) :: solid_work = 0.0_wp          !! by the forces put on the solid, total [J]
    real(wp) :: work_turnover = 0.0_wp       !! sum of |work| over the exchanges [J]
    real(wp) :: step_work = 0.0_wp           !! by the ghosts in this exchange [J]
    real(wp) :: lost_impulse = 0.0_wp        !! of moments, total [N m s]
    real(wp) :: spring_residual = 0.0_wp     !! what the springs held back in the last exchange [-]
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
    procedure :: predict
    procedure :: gap
    procedure, private :: held_back
    procedure :: accept
    procedure :: finite
  end type interface_type

contains

  !> Zero state for a map that has been built.
  subroutine init(self, x_ghost, x_all)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: x_ghost(:, :)  !! (3, g) [m]
    real(wp), intent(in) :: x_all(:, :)    !! all nodes of the mesh (3, n) [m]
    integer(i4) :: g, m

    g = self%map%ghosts
    m = self%map%nodes
    self%x_ref = x_ghost
    self%x_node = x_all(:, self%map%node_id)
    allocate (self%d(3, g), self%d_new(3, g), self%d_spring(3, g), self%p_mean(3, g), &
              self%p_end(3, g), self%p_put(3, g), self%p_before(3, g), self%m_mean(3, g), &
              source=0.0_wp)
    allocate (self%u(3, m), self%v(3, m), self%v_before(3, m), self%u_new(3, m), &
              self%v_new(3, m), self%dead_load(3, m), source=0.0_wp)
  end subroutine init

  !> Displacement of the ghosts at the end of the next interval of length h [s]. Statics: where the
  !! facets were found last (lagged: extrapolation halves the stable stiffness). Dynamics: straight
  !! on with the velocity and its last change.
  subroutine predict(self, h, d)
    class(interface_type), intent(in) :: self
    real(wp), intent(in) :: h
    real(wp), intent(out) :: d(:, :)
    if (self%dynamic) then
      call self%map%to_ghosts(self%u + h*self%v + 0.5_wp*h*(self%v - self%v_before), d)
    else
      call self%map%to_ghosts(self%u, d)
    end if
  end subroutine predict

  !> Largest distance between the ghosts (trial) and the facets (trial) [m].
  pure real(wp) function gap(self)
    class(interface_type), intent(in) :: self
    real(wp) :: on_facet(3, self%map%ghosts)
    call self%map%to_ghosts(self%u_new, on_facet)
    gap = sqrt(maxval(sum((on_facet - self%d_new)**2, 1)))
  end function gap

  !> Largest force of the springs over the largest mean force: what they still hold back [-].
  pure real(wp) function held_back(self)
    class(interface_type), intent(in) :: self
    real(wp) :: on_facet(3, self%map%ghosts), scale
    held_back = 0.0_wp
    scale = sqrt(maxval(sum(self%p_mean**2, 1)))
    if (self%relax%stiffness <= 0.0_wp .or. scale <= 0.0_wp) return
    call self%map%to_ghosts(self%u_new, on_facet)
    held_back = self%relax%stiffness &
      *sqrt(maxval(sum((on_facet - self%d_spring)**2, 1)))/scale
  end function held_back

  !> The trial becomes the state; h is the interval's length [s].
  subroutine accept(self, h)
    class(interface_type), intent(inout) :: self
    real(wp), intent(in) :: h
    real(wp) :: before(3, self%map%ghosts), after(3, self%map%ghosts), work

    self%spring_residual = self%held_back()
    call self%map%to_ghosts(self%u, before)
    call self%map%to_ghosts(self%u_new, after)
    work = sum(self%relax%held*(after - before))
    self%solid_work = self%solid_work + work
    self%grains_work = self%grains_work + self%step_work
    self%work_turnover = self%work_turnover + max(abs(work), abs(self%step_work))
    self%lost_impulse = self%lost_impulse + h*norm2(sum(self%m_mean, 2) + &
                                                    self%map%moment_of(self%p_mean))
    self%u = self%u_new
    self%v_before = self%v
    self%v = self%v_new
    self%d = self%d_new
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
