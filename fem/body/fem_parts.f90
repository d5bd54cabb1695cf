!> The parts of a solid body (fem_body), by job: scheme of the analysis, loads, supports, what the
!! port sets, matrices with their factors, the largest stable step. Plain data.
module fem_parts
  use talus_kinds, only: wp, i4, i8
  use talus_curve, only: curve_type
  use fem_follower, only: fem_follower_type
  use fem_rigid, only: fem_rigid_type
  use fem_solver, only: fem_solver_type
  use fem_sparse, only: fem_pattern_type
  use fem_types, only: fem_load_type, fem_springs_type, fem_state_type, fem_energy_type
  implicit none
  private
  public :: fem_scheme_type, fem_loads_type, fem_supports_type, fem_motion_type
  public :: fem_port_values_type, fem_system_type, fem_limit_type, fem_newton_type, fem_kept_type

  !> What the analysis requires of the body.
  type :: fem_scheme_type
    logical :: dynamic = .false.      !! steps in time with velocities
    logical :: massive = .false.      !! mass matters: dynamics or modes
    logical :: damped = .false.       !! damping and absorbing faces act
    logical :: explicit = .false.     !! central differences, lumped mass; dynamic is true too
    logical :: linear_only = .false.  !! no law with a state
    real(wp) :: beta = 0.25_wp, gamma = 0.5_wp  !! Newmark's
    real(wp) :: lag = 0.0_wp          !! HHT: share of the old balance, -alpha [-]
  contains
    procedure :: take_inertia
    procedure :: keep_linear
  end type fem_scheme_type

  type :: fem_loads_type
    type(curve_type), allocatable :: curve(:)
    type(fem_load_type), allocatable :: load(:)
    type(fem_follower_type), allocatable :: follower(:)  !! pressures that follow the surface
    real(wp) :: gravity(3) = 0.0_wp                      !! [m/s^2]
  contains
    procedure :: append => append_load
  end type fem_loads_type

  !> Prescribed motion of one component of some blocks.
  type :: fem_motion_type
    integer(i4) :: component = 1, curve = 0
    real(wp) :: scale = 1.0_wp             !! [m], [rad]
    integer(i4), allocatable :: block(:)
  end type fem_motion_type

  type :: fem_supports_type
    logical, allocatable :: held(:, :)             !! (3, blocks) supported or moved by the deck
    type(fem_motion_type), allocatable :: motion(:)
    type(fem_rigid_type), allocatable :: rigid(:)  !! groups that move as rigid bodies
    type(fem_springs_type) :: ground               !! springs to the ground
    logical :: sprung_elsewhere = .false.          !! other ranks have some, of dealt nodes
  contains
    procedure :: hold
    procedure :: sprung
  end type fem_supports_type

  !> What a partner at the port sets.
  type :: fem_port_values_type
    logical, allocatable :: prescribed(:, :)     !! (3, blocks) moved
    real(wp), allocatable :: moved(:, :)  !! places at rest, from those of the mesh (3, nodes) [m]
    real(wp), allocatable :: given_u(:, :), given_v(:, :)  !! (3, blocks) [m], for output [m/s]
    real(wp), allocatable :: port_load(:, :)     !! (3, blocks) now [N]
    real(wp), allocatable :: dead_load(:, :)     !! (3, blocks) constant [N]
    logical, allocatable :: answering(:)         !! dead load answers forces of later steps
    logical :: settling = .false.                !! in the equilibrium of the start
    real(wp), allocatable :: mass_factor(:)      !! (blocks) on mass and weight [-]
    type(fem_springs_type) :: robin              !! springs to the last accepted state
  contains
    procedure :: prescribe
    procedure :: fix_at
    procedure :: move_along
  end type fem_port_values_type

  !> Matrices and their factors.
  type :: fem_system_type
    type(fem_pattern_type) :: pattern
    type(fem_solver_type) :: solver
    real(wp), allocatable :: k(:, :, :)          !! (3, 3, entries) stiffness or tangent [N/m]
    real(wp), allocatable :: lower(:, :, :)      !! blocks below the diagonal, if not symmetric
    real(wp), allocatable :: mass(:)             !! (entries) consistent [kg], [kg m^2]
    real(wp), allocatable :: lumped(:)           !! (blocks) without the factors [kg], [kg m^2]
    real(wp), allocatable :: node_mass(:)        !! (blocks) lumped, with the factors
    real(wp), allocatable :: weight_force(:, :)  !! (3, blocks) of gravity [N]
    real(wp), allocatable :: initial_force(:, :) !! (3, blocks) of the initial stress [N]
    real(wp) :: factored_dt = -1.0_wp            !! [s], 0 in statics, < 0 not factored
    real(wp) :: restored_dt = -1.0_wp            !! [s] of the factors at a checkpoint, < 0 none
    logical :: fresh_numbering = .false.
    real(wp) :: cost_quotient = -1.0_wp          !! factors over iterations, < 0 not known
    logical :: multigrid_is_less = .false.       !! of both iterations, by the same estimate
  contains
    procedure :: keep_factors
    procedure :: forget_factors
    procedure :: forget_numbers
  end type fem_system_type

  !> Largest stable step of the time integration.
  type :: fem_limit_type
    real(wp) :: step = huge(1.0_wp)  !! [s]
    integer(i4) :: stiffest = 0      !! element that sets it
    integer(i8) :: leaps = 0         !! explicit steps of laws with a state so far
  end type fem_limit_type

  !> Settings of the equilibrium iteration of laws with a state.
  type :: fem_newton_type
    real(wp) :: tolerance = 1.0e-8_wp  !! residual over loads and reactions [-]
    real(wp) :: largest = 0.0_wp       !! norm of loads and reactions of a static run so far [N]
    integer(i4) :: most_iterations = 25
    integer(i4) :: most_cuts = 10      !! halvings of a step
    integer(i4) :: rows = 0            !! of the table of the last step
    real(wp), allocatable :: table(:, :)  !! (8, rows), columns as fem_newton has them
  end type fem_newton_type

  !> A saved accepted state, for trials of several parts.
  type :: fem_kept_type
    type(fem_state_type) :: state
    type(fem_energy_type) :: energy
    real(wp), allocatable :: stress(:, :), points(:, :)
    type(fem_rigid_type), allocatable :: rigid(:)
  end type fem_kept_type

contains

  !> Steps are in time, with velocities, or (no) in balance.
  pure subroutine take_inertia(self, yes)
    class(fem_scheme_type), intent(inout) :: self
    logical, intent(in) :: yes
    self%dynamic = yes
  end subroutine take_inertia

  !> No law with a state is allowed.
  pure subroutine keep_linear(self, massive)
    class(fem_scheme_type), intent(inout) :: self
    logical, intent(in) :: massive  !! mass matters
    self%linear_only = .true.
    self%massive = massive
  end subroutine keep_linear

  !> One load more.
  pure subroutine append_load(self, load)
    class(fem_loads_type), intent(inout) :: self
    type(fem_load_type), intent(in) :: load
    type(fem_load_type), allocatable :: longer(:)
    allocate (longer(size(self%load) + 1))
    longer(:size(self%load)) = self%load
    longer(size(longer)) = load
    call move_alloc(longer, self%load)
  end subroutine append_load

  !> A component of some blocks is supported or moved by the deck.
  pure subroutine hold(self, component, block)
    class(fem_supports_type), intent(inout) :: self
    integer(i4), intent(in) :: component, block(:)
    self%held(component, block) = .true.
  end subroutine hold

  !> Are there springs to the ground, here or on another rank?
  pure logical function sprung(self)
    class(fem_supports_type), intent(in) :: self
    sprung = self%ground%n > 0 .or. self%sprung_elsewhere
  end function sprung

  !> What a partner moves; what it did not move before keeps its displacement u.
  pure subroutine prescribe(self, chosen, u)
    class(fem_port_values_type), intent(inout) :: self
    logical, intent(in) :: chosen(:, :)  !! (3, blocks)
    real(wp), intent(in) :: u(:, :)      !! (3, blocks) [m]
    where (chosen .and. .not. self%prescribed) self%given_u = u
    self%prescribed = chosen
  end subroutine prescribe

  !> Only these are kept where they are, at u.
  pure subroutine fix_at(self, chosen, u)
    class(fem_port_values_type), intent(inout) :: self
    logical, intent(in) :: chosen(:, :)  !! (3, blocks)
    real(wp), intent(in) :: u(:, :)      !! (3, blocks) [m]
    self%prescribed = chosen
    self%given_u = merge(u, 0.0_wp, chosen)
  end subroutine fix_at

  !> What a partner moves at a share [-] of its way.
  pure subroutine move_along(self, from, to, share)
    class(fem_port_values_type), intent(inout) :: self
    real(wp), intent(in) :: from(:, :), to(:, :)  !! (3, blocks) [m]
    real(wp), intent(in) :: share
    self%given_u = from + share*(to - from)
  end subroutine move_along

  !> The factors are those of steps dt.
  subroutine keep_factors(self, dt)
    class(fem_system_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    self%factored_dt = dt
  end subroutine keep_factors

  !> The factors are those of another matrix from now on.
  subroutine forget_factors(self)
    class(fem_system_type), intent(inout) :: self
    self%factored_dt = -1.0_wp
  end subroutine forget_factors

  !> Other degrees of freedom are free from now on.
  subroutine forget_numbers(self)
    class(fem_system_type), intent(inout) :: self
    self%fresh_numbering = .false.
  end subroutine forget_numbers
end module fem_parts
