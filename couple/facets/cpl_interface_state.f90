!> What the interface is made of, beside its map: a type for each thing that is placed, moves, acts
!! or is accounted for.
module cpl_interface_state
  use talus_kinds, only: wp, i4, i8
  use talus_scalars, only: scalar_count
  implicit none
  private
  public :: interface_place_type, interface_start_type, interface_motion_type, &
    interface_forces_type, interface_watch_type, interface_ledger_type

  !> Where ghosts and nodes were when the map was made and at the start.
  type :: interface_place_type
    character(len=:), allocatable :: material     !! of a surface that grains touch; '' for ghosts
    integer(i8), allocatable :: triangle(:, :)    !! of the surface (3, k), numbers of ghosts
    real(wp), allocatable :: radius(:)       !! of the ghosts [m]
    real(wp), allocatable :: x_ref(:, :)     !! ghosts where the map was made (3, g) [m]
    real(wp), allocatable :: x_start(:, :)   !! ghosts at the start (3, g) [m]
    real(wp), allocatable :: x_node(:, :)    !! interface nodes (3, m) [m]
    real(wp), allocatable :: u_start(:, :)   !! of the nodes, from the map's state to the start
    integer(i4) :: all_nodes = 0             !! of the solid
    integer(i8), allocatable :: polar_id(:)      !! all nodes with micro-rotations
  end type interface_place_type

  !> What the solid carries at the start, in balance with the ghosts.
  type :: interface_start_type
    real(wp), allocatable :: start_stress(:, :)  !! of the relaxed solid at its points (6, q), or
                                                 !! (9, q) if it is micropolar [Pa]
    real(wp), allocatable :: start_couple(:, :)  !! couple stress there (9, q) [N/m]; not allocated
                                                 !! where no node has a micro-rotation
    real(wp), allocatable :: start_load(:, :)    !! on all its nodes [N]
    real(wp), allocatable :: start_moment(:, :)  !! on all its micro-rotations [N m]
    real(wp), allocatable :: dead_load(:, :) !! (3, m) [N]
  end type interface_start_type

  !> Motion of nodes and ghosts, accepted and on trial.
  type :: interface_motion_type
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
    real(wp), allocatable :: drift(:, :)     !! steady part of the motion in an interval (3, m) [m]
  end type interface_motion_type

  !> Forces on the ghosts.
  type :: interface_forces_type
    real(wp), allocatable :: p_mean(:, :)    !! mean force on each ghost over the interval
                                             !! (rows, g) [N, N m]
    real(wp), allocatable :: p_end(:, :)     !! force at its end [N]
    real(wp), allocatable :: p_before(:, :)  !! force at the end of the interval before [N]
    real(wp), allocatable :: p_put(:, :)     !! force at tn that the implicit solid holds [N]
    real(wp), allocatable :: m_mean(:, :)    !! mean moment on each ghost (3, g) [N m]
  contains
    procedure :: begin => begin_forces
    procedure :: foretell
    procedure :: average
  end type interface_forces_type

  !> Checks of the stiffness of the contacts, for springs.
  type :: interface_watch_type
    integer(i4) :: outgrown = 0              !! checks at which contacts were stiffer than the
                                             !! springs
    integer(i4) :: refactored = 0            !! times the springs were raised
    real(wp), allocatable :: stiffness(:)    !! of the ghosts' contacts at the last check (g) [N/m]
    real(wp) :: contact_stiffness = 0.0_wp   !! largest of a ghost then [N/m]
    real(wp) :: force_at_check = 0.0_wp       !! largest force on a ghost then [N]
  contains
    procedure :: note_stiffness
    procedure :: note_force
  end type interface_watch_type

  !> Works, energies, iterations.
  type :: interface_ledger_type
    real(wp) :: grains_work = 0.0_wp         !! by the ghosts' motion on the grains, total [J]
    real(wp) :: solid_work = 0.0_wp          !! by the forces put on the solid, total [J]
    real(wp) :: work_turnover = 0.0_wp       !! sum of |work| over the exchanges [J]
    real(wp) :: step_work = 0.0_wp           !! by the ghosts in this exchange [J]
    real(wp) :: lost_impulse = 0.0_wp        !! of moments, total [N m s]
    real(wp) :: lag = 0.0_wp                 !! force lag of the last exchange [-]
    real(wp) :: largest = 0.0_wp             !! |N'P| or |K u| so far [N]
    integer(i4) :: iterations = 0            !! of the last exchange
    integer(i4) :: pieces = 1                !! of the last exchange
    integer(i8) :: all_iterations = 0
    real(wp) :: grains(scalar_count) = 0.0_wp, solid(scalar_count) = 0.0_wp
    real(wp) :: grains_new(scalar_count) = 0.0_wp, solid_new(scalar_count) = 0.0_wp
  end type interface_ledger_type

contains

  !> Forces at the start: those of the interval before are the same.
  pure subroutine begin_forces(self, p)
    class(interface_forces_type), intent(inout) :: self
    real(wp), intent(in) :: p(:, :)  !! (rows, g) [N, N m]
    self%p_end = p
    self%p_before = p
  end subroutine begin_forces

  !> Mean force of the next interval: that at its start, or (straight) where the last two lead.
  pure subroutine foretell(self, straight)
    class(interface_forces_type), intent(inout) :: self
    logical, intent(in) :: straight
    self%p_mean = self%p_end
    if (straight) self%p_mean = 1.5_wp*self%p_end - 0.5_wp*self%p_before
    self%p_before = self%p_end
  end subroutine foretell

  !> Mean over an interval from the impulses; the mean moments are those of the ghosts' turning.
  pure subroutine average(self, impulse, moment_impulse, span)
    class(interface_forces_type), intent(inout) :: self
    real(wp), intent(in) :: impulse(:, :), moment_impulse(:, :)  !! (3, g) [N s], [N m s]
    real(wp), intent(in) :: span                                 !! [s]
    self%m_mean = moment_impulse/span
    self%p_mean(:3, :) = impulse/span
    if (size(self%p_mean, 1) > 3) self%p_mean(4:, :) = self%m_mean
  end subroutine average

  !> Stiffness of the ghosts' contacts.
  pure subroutine note_stiffness(self, stiffness)
    class(interface_watch_type), intent(inout) :: self
    real(wp), intent(in) :: stiffness(:)  !! (g) [N/m]
    self%stiffness = stiffness
    self%contact_stiffness = maxval(stiffness)
  end subroutine note_stiffness

  !> Forces on the ghosts when their stiffness is known: the largest is kept.
  pure subroutine note_force(self, p)
    class(interface_watch_type), intent(inout) :: self
    real(wp), intent(in) :: p(:, :)  !! (rows, g) [N, N m]
    self%force_at_check = maxval(abs(p))
  end subroutine note_force
end module cpl_interface_state
