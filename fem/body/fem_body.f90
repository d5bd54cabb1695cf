!> A solid body: mesh, matrices, loads, supports, its accepted state and a trial state. Steps are
!! those of the analyses.
module fem_body
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type
  use fem_types, only: fem_mesh_type, fem_load_type, fem_springs_type, &
    fem_state_type, fem_energy_type
  use fem_assembly, only: assemble_stiffness, assemble_mass
  use fem_critical, only: largest_frequency, spring_rate, stable_step, newmark_step
  use fem_damping, only: fem_damping_type
  use fem_dofs, only: fem_dofs_type, blocks_of
  use fem_elastic, only: fem_elastic_type
  use fem_follower, only: fem_follower_type, follower_force
  use fem_leap, only: fem_leap_type, least_shared
  use fem_ledger, only: step_works, fem_works_type
  use fem_matter, only: fem_matter_type
  use fem_matter_step, only: tangent_frequency
  use fem_null_mode, only: explain_singular
  use fem_one_point, only: fem_one_point_type
  use fem_sparse, only: fem_pattern_type, make_pattern, add_springs, multiply, multiply_mass, &
    scale_mass, spring_force
  use fem_rigid, only: fem_rigid_type, place_rigid, push_rigid
  use fem_shares, only: share_pattern
  use fem_solver, only: fem_solver_type
  use fem_stages, only: fem_stages_type
  use fem_supports, only: check_supports
  use fem_recover, only: initial_stress_force, element_forces
  use fem_whole, only: fem_whole_type
  implicit none
  private
  public :: fem_body_type, fem_motion_type, fem_newton_type, fem_kept_type
  real(wp), parameter :: same_step = 1.0e-9_wp  !! relative change of dt that needs new factors
  real(wp), parameter :: margin = 0.95_wp       !! of the largest stable step, of laws with a state

  !> Prescribed motion of one component of some blocks.
  type :: fem_motion_type
    integer(i4) :: component = 1, curve = 0
    real(wp) :: scale = 1.0_wp             !! [m], [rad]
    integer(i4), allocatable :: block(:)
  end type fem_motion_type

  !> How the equilibrium of laws with a state is sought.
  type :: fem_newton_type
    real(wp) :: tolerance = 1.0e-8_wp  !! residual over loads and reactions [-]
    integer(i4) :: most_iterations = 25
    integer(i4) :: most_cuts = 10      !! halvings of a step
    integer(i4) :: rows = 0            !! of the table of the last step
    real(wp), allocatable :: table(:, :)  !! (8, rows), columns as fem_newton has them
  end type fem_newton_type

  !> An accepted state that is put aside while trials of several parts are made.
  type :: fem_kept_type
    type(fem_state_type) :: state
    type(fem_energy_type) :: energy
    real(wp), allocatable :: stress(:, :), points(:, :)
    type(fem_rigid_type), allocatable :: rigid(:)
  end type fem_kept_type

  type :: fem_body_type
    type(fem_mesh_type) :: mesh
    type(fem_dofs_type) :: dofs
    type(fem_elastic_type) :: elastic
    type(fem_whole_type) :: whole                !! mesh behind the parts of several ranks
    type(curve_type), allocatable :: curve(:)
    type(fem_load_type), allocatable :: load(:)
    type(fem_motion_type), allocatable :: motion(:)
    type(fem_rigid_type), allocatable :: rigid(:)        !! groups that move as rigid bodies
    type(fem_follower_type), allocatable :: follower(:)  !! pressures that follow the surface
    type(fem_springs_type) :: ground             !! springs to the ground, of the deck
    type(fem_springs_type) :: robin              !! springs to the last accepted state, of the port
    logical, allocatable :: held(:, :)           !! (3, blocks) supported by the deck
    logical, allocatable :: prescribed(:, :)     !! (3, blocks) moved by the port
    real(wp), allocatable :: given_u(:, :), given_v(:, :)  !! values of the port [m], output [m/s]
    real(wp), allocatable :: port_load(:, :)     !! (3, blocks) of the port, now [N]
    real(wp), allocatable :: dead_load(:, :)     !! (3, blocks) of the port, constant [N]
    real(wp), allocatable :: mass_factor(:)      !! (blocks) on mass and weight, of the port [-]
    real(wp) :: gravity(3) = 0.0_wp              !! [m/s^2]
    logical :: dynamic = .false.
    logical :: massive = .false.                 !! mass matters: dynamics or modes
    logical :: explicit = .false.                !! central differences; dynamic is true too
    logical :: linear_only = .false.             !! the analysis knows no law with a state
    real(wp) :: beta = 0.25_wp, gamma = 0.5_wp
    real(wp) :: lag = 0.0_wp                     !! HHT: share of the old balance, -alpha [-]
    type(fem_damping_type) :: damping
    type(fem_leap_type) :: leap_work             !! of undamped explicit steps
    type(fem_one_point_type) :: one_point        !! of explicit steps, if all elements are such
    type(fem_matter_type) :: matter              !! points whose laws have a state
    type(fem_newton_type) :: newton              !! how their equilibrium is sought
    type(fem_stages_type) :: stages              !! elements that are removed and placed
    type(fem_pattern_type) :: pattern
    type(fem_solver_type) :: solver
    real(wp), allocatable :: k(:, :, :), mass(:), lumped(:)
    real(wp), allocatable :: lower(:, :, :)      !! blocks of k below the diagonal, if not symmetric
    real(wp), allocatable :: node_mass(:)        !! (blocks) lumped, with the factors [kg, kg m^2]
    real(wp), allocatable :: weight_force(:, :)  !! of gravity [N]
    real(wp), allocatable :: initial_force(:, :) !! internal forces of the initial stress [N]
    real(wp) :: step_limit = huge(1.0_wp)        !! of the time integration [s]
    integer(i4) :: stiffest = 0                  !! element that sets it
    integer(i8) :: leaps = 0                     !! explicit steps of laws with a state so far
    real(wp) :: factored_dt = -1.0_wp            !! [s], 0 in statics, < 0 not factored
    real(wp) :: restored_dt = -1.0_wp            !! [s] of the factors at a checkpoint, < 0 none
    logical :: fresh_numbering = .false.
    real(wp) :: residual = 0.0_wp                !! largest of implicit steps [-]
    type(fem_state_type) :: state, accepted
    type(fem_energy_type) :: energy, accepted_energy
  contains
    procedure :: allocate_state
    procedure :: assemble
    procedure :: factor
    procedure :: number
    procedure :: accept
    procedure :: hand_over
    procedure :: reject
    procedure :: internal_force
    procedure :: trial_force
    procedure :: external_at
    procedure :: update_energy
    procedure :: interface_force
    procedure :: impose
    procedure :: push
    procedure, private :: accept_rigid
    procedure :: limit_step
    procedure :: check_finite
    procedure :: viscous_force
    procedure :: follow
    procedure :: assemble_tangent
    procedure :: matter_energy
    procedure :: matter_fault
    procedure :: count_yielding
    procedure :: safe_step
    procedure :: keep
    procedure :: put_back
  end type fem_body_type

contains

  !> Arrays of the state and loads for the numbered fields, all zero.
  subroutine allocate_state(self)
    class(fem_body_type), intent(inout) :: self
    integer(i4) :: n
    n = self%dofs%blocks
    allocate (self%state%u(3, n), self%state%v(3, n), self%state%a(3, n), source=0.0_wp)
    allocate (self%state%external(3, n), self%state%reaction(3, n), source=0.0_wp)
    allocate (self%state%tie(3, n), self%state%viscous(3, n), source=0.0_wp)
    allocate (self%given_v(3, n), source=0.0_wp)
    allocate (self%given_u(3, n), self%port_load(3, n), self%dead_load(3, n), source=0.0_wp)
    allocate (self%weight_force(3, n), self%initial_force(3, n), source=0.0_wp)
    allocate (self%held(3, n), self%prescribed(3, n), source=.false.)
    allocate (self%mass_factor(n), source=1.0_wp)
    self%accepted = self%state
  end subroutine allocate_state

  !> Pattern, stiffness, mass and weight; again after moduli or weights have changed.
  subroutine assemble(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: fall(3, self%dofs%blocks)
    integer(i4) :: i
    if (.not. allocated(self%pattern%start)) then
      call make_pattern(self%dofs, self%pattern)
      call share_pattern(self%dofs, self%pattern)
    end if
    if (self%matter%active) then
      call self%matter%prepare(self%mesh, self%dofs, self%elastic)
      if (.not. allocated(self%k)) &
        allocate (self%k(3, 3, size(self%pattern%column)), source=0.0_wp)
    else
      call assemble_stiffness(self%mesh, self%dofs, self%elastic, self%pattern, self%k)
      call add_springs(self%ground, self%pattern, self%k)
    end if
    call assemble_mass(self%mesh, self%dofs, self%elastic, self%pattern, self%mass, self%lumped)
    fall = 0.0_wp
    fall(:, :self%mesh%nodes) = spread(self%gravity, 2, self%mesh%nodes)
    call multiply_mass(self%pattern, self%mass, fall, self%weight_force)  ! sum of N_b is one
    do i = 1, self%dofs%blocks
      self%weight_force(:, i) = self%mass_factor(i)*self%weight_force(:, i)
    end do
    call scale_mass(self%pattern, self%mass_factor, self%mass)
    self%node_mass = self%lumped*self%mass_factor
    call initial_stress_force(self%mesh, self%dofs, self%elastic, self%initial_force)
    if (self%explicit .and. self%ground%n == 0) &
      call self%one_point%prepare(self%mesh, self%dofs, self%elastic, self%pattern)
    call self%limit_step()
    self%factored_dt = -1.0_wp
  end subroutine assemble

  !> Stiffness of the accepted state where laws have a state.
  subroutine assemble_tangent(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: internal(3, self%dofs%blocks)
    call self%trial_force(self%accepted%u, internal)
    call self%matter%assemble(self%mesh, self%dofs, self%elastic, self%pattern, self%k, self%lower)
    call self%matter%reject()
  end subroutine assemble_tangent

  !> Largest stable step of the time integration, and the element that sets it. Springs of the port
  !! stand for what hangs at the nodes of an explicit body: they act on its step alone.
  subroutine limit_step(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: square
    if (self%explicit) then
      square = 0.0_wp
      if (self%matter%micro%active) then
        call self%matter%stiffen(self%mesh, self%dofs, self%elastic, self%state%u)
      else
        call largest_frequency(self%mesh, self%dofs, self%elastic, self%mass_factor, .true., &
                               square, self%stiffest)
      end if
      if (self%matter%micro%active .or. (self%matter%finite .and. allocated(self%matter%u))) &
        call tangent_frequency(self%mesh, self%dofs, self%elastic, self%matter, &
                               self%mass_factor, square, self%stiffest)
      call name_stiffest(self, square)
      square = square + spring_rate(self%ground, self%node_mass) &
               + spring_rate(self%robin, self%node_mass)
      self%step_limit = stable_step(sqrt(square), self%damping%stiffness)
    else if (self%dynamic .and. 2.0_wp*self%beta < self%gamma) then
      call largest_frequency(self%mesh, self%dofs, self%elastic, self%mass_factor, .false., &
                             square, self%stiffest)
      call name_stiffest(self, square)
      self%step_limit = newmark_step(sqrt(square), self%beta, self%gamma)
    end if
  end subroutine limit_step

  !> The stiffest element of all ranks, by its number in the mesh.
  subroutine name_stiffest(self, square)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(inout) :: square
    self%stiffest = self%elastic%number_of(self%stiffest)
    call self%dofs%halo%largest(square, self%stiffest)
  end subroutine name_stiffest

  !> Factor for a step dt (statics: dt is not used); nothing to do if that is done.
  subroutine factor(self, dt, errors)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: k(:, :, :)
    real(wp) :: wanted, mass_term, share, rate

    if (self%explicit) return
    wanted = merge(dt, 0.0_wp, self%dynamic)
    if (self%factored_dt >= 0.0_wp .and. abs(wanted - self%factored_dt) <= same_step*wanted) return
    call self%number(errors)
    if (errors%any() .or. self%matter%active) return
    mass_term = 0.0_wp
    k = self%k
    if (self%dynamic) then
      share = 1.0_wp - self%lag
      rate = share*self%gamma/(self%beta*dt)
      mass_term = 1.0_wp/(self%beta*dt*dt) + rate*self%damping%mass
      if (self%damping%active() .or. share < 1.0_wp) k = (share + rate*self%damping%stiffness)*k
      call self%damping%add_dashpots(self%pattern, rate, k)
    end if
    call add_springs(self%robin, self%pattern, k)
    call self%solver%factor(self%pattern, k, self%mass, mass_term, errors)
    if (.not. self%dynamic) call explain_singular(self%solver, self%pattern, self%dofs, k, errors)
    if (.not. errors%any()) self%factored_dt = wanted
  end subroutine factor

  !> Number the free degrees of freedom, if that is to be done; a static body must be held.
  subroutine number(self, errors)
    class(fem_body_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    logical :: fixed(3, self%dofs%blocks)
    if (self%fresh_numbering) return
    fixed = self%held .or. self%prescribed
    if (.not. self%dynamic) &
      call check_supports(self%mesh, self%dofs, self%pattern, fixed, self%ground, errors)
    if (errors%any()) return
    self%solver%mumps%general = self%matter%active .and. .not. self%matter%symmetric
    self%solver%mumps%indefinite = self%matter%active
    call self%solver%number(self%dofs, self%pattern, fixed, errors)
    if (.not. errors%any()) self%fresh_numbering = .true.
  end subroutine number

  !> All loads at time t [N], reactions not counted.
  subroutine external_at(self, t, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: t
    real(wp), intent(out) :: force(:, :)
    real(wp) :: value(size(self%load))
    integer(i4) :: i, k
    value = 1.0_wp
    do k = 1, size(self%load)
      if (self%load(k)%curve > 0) value(k) = self%curve(self%load(k)%curve)%at(t)
    end do
    !$omp parallel do default(none) shared(self, force, value) private(i, k) schedule(static) &
    !$omp if(size(force, 2) > least_shared)
    do i = 1, size(force, 2)
      force(:, i) = self%weight_force(:, i) + self%dead_load(:, i) + self%port_load(:, i)
      do k = 1, size(value)
        force(:, i) = force(:, i) + value(k)*self%load(k)%force(:, i)
      end do
    end do
    !$omp end parallel do
  end subroutine external_at

  !> Add the pressures that follow the surface, for displacements u at time t.
  subroutine follow(self, t, u, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: t, u(:, :)
    real(wp), intent(inout) :: force(:, :)
    real(wp) :: value
    integer(i4) :: k
    if (.not. allocated(self%follower)) return
    do k = 1, size(self%follower)
      value = self%follower(k)%pressure
      if (self%follower(k)%curve > 0) value = value*self%curve(self%follower(k)%curve)%at(t)
      call follower_force(self%mesh, self%follower(k), value, u, force)
    end do
  end subroutine follow

  !> Internal forces for displacements u, of any law; those of laws with a state make the trial
  !! state of their points [N].
  subroutine trial_force(self, u, force)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    real(wp), allocatable :: springs(:, :)
    integer(i4) :: bad
    if (.not. self%matter%active) then
      call self%internal_force(u, force)
      return
    end if
    call self%matter%update(self%mesh, self%dofs, self%elastic, u, u - self%accepted%u, force, bad)
    if (self%ground%n == 0) return
    allocate (springs, mold=u)
    call spring_force(self%ground, 0.0_wp*u, u, springs)
    force = force - springs
  end subroutine trial_force

  !> Internal forces K u plus those of the initial stress [N].
  subroutine internal_force(self, u, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    if (self%one_point%ready) then
      call self%one_point%force(u, force)
      call self%dofs%halo%sum_up(force)
    else
      call multiply(self%pattern, self%k, u, force)
    end if
    if (self%elastic%has_initial) force = force + self%initial_force
  end subroutine internal_force

  !> Put prescribed displacements at time t into u.
  subroutine impose(self, t, u)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: t
    real(wp), intent(inout) :: u(:, :)
    real(wp) :: value
    integer(i4) :: k
    where (self%held) u = 0.0_wp
    where (self%prescribed) u = self%given_u
    do k = 1, size(self%motion)
      associate (m => self%motion(k))
        value = m%scale*self%curve(m%curve)%at(t)
        u(m%component, m%block) = value
      end associate
    end do
    if (.not. allocated(self%rigid)) return
    do k = 1, size(self%rigid)
      call place_rigid(self%rigid(k), self%curve, self%mesh%x, t, u)
    end do
  end subroutine impose

  !> Free shifts of rigid groups, from the accepted state to time t1.
  subroutine push(self, t1)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1
    integer(i4) :: k
    if (.not. allocated(self%rigid)) return
    do k = 1, size(self%rigid)
      call push_rigid(self%rigid(k), self%curve, self%accepted%reaction, self%accepted%time, t1)
    end do
  end subroutine push

  !> The free shifts of the trial are the accepted ones.
  subroutine accept_rigid(self)
    class(fem_body_type), intent(inout) :: self
    integer(i4) :: k
    if (.not. allocated(self%rigid)) return
    do k = 1, size(self%rigid)
      self%rigid(k)%accepted_d = self%rigid(k)%d
      self%rigid(k)%accepted_v = self%rigid(k)%v
    end do
  end subroutine accept_rigid

  !> C v of the damping [N, N m].
  subroutine viscous_force(self, v, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: v(:, :)
    real(wp), intent(out) :: force(:, :)
    force = 0.0_wp
    if (self%dynamic .and. self%damping%active()) &
      call self%damping%force(self%pattern, self%k, self%mass, v, force)
  end subroutine viscous_force

  !> Fault N304 for the first displacement that is not finite.
  subroutine check_finite(self, errors)
    class(fem_body_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: bad(2)
    if (is_finite(sum(abs(self%state%u)))) return
    bad = findloc(is_finite(self%state%u), .false.)
    call errors%add('N304', 'the displacement of node '//str(self%dofs%node(bad(2)))// &
                    ' is not finite', 'time '//str(self%state%time)//' s', &
                    'check loads, moduli and supports')
  end subroutine check_finite

  !> Ledger of the trial state: stored energies now, works by the trapezoidal rule.
  subroutine update_energy(self, internal)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: internal(:, :)  !! K u + initial [N]
    real(wp) :: momentum(3, self%dofs%blocks), before
    type(fem_works_type) :: works
    associate (s => self%state, old => self%accepted, e => self%energy)
      ! the first static step brings the weight up from nothing, as it does all loads
      before = merge(1.0_wp, 0.0_wp, any(abs(old%external) > 0.0_wp))
      call step_works(old, s, internal, self%initial_force, self%weight_force, works)
      e = self%accepted_energy
      e%strain = works%strain
      e%load = e%load + works%load
      e%gravity = e%gravity + 0.5_wp*(1.0_wp + before)*works%weight
      e%support = e%support + works%support
      e%spring = e%spring + works%spring
      if (.not. self%dynamic) return
      e%damping = e%damping + works%damping
      if (self%explicit) return
      call multiply_mass(self%pattern, self%mass, s%v, momentum)
      e%kinetic = 0.5_wp*sum(s%v*momentum)
    end associate
  end subroutine update_energy

  !> Internal forces of some elements alone, or of those that have a prescribed node [N].
  subroutine interface_force(self, u, force, list)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    integer(i4), intent(in), optional :: list(:)  !! elements
    integer(i4) :: e
    if (self%matter%active) then
      if (.not. present(list)) call self%trial_force(u, force)
      if (present(list)) then
        call self%matter%update_some(self%mesh, self%dofs, self%elastic, u, u - self%accepted%u, &
                                     list)
        call self%matter%element_forces(self%dofs, list, force)
      else
        call self%matter%element_forces(self%dofs, pack([(e, e=1, self%mesh%elements)], &
          [(any(self%prescribed(:, blocks_of(self%dofs, e))), e=1, self%mesh%elements)]), force)
      end if
    else if (present(list)) then
      call element_forces(self%mesh, self%dofs, self%elastic, u, list, force)
    else
      call element_forces(self%mesh, self%dofs, self%elastic, u, pack([(e, e=1, &
        self%mesh%elements)], [(any(self%prescribed(:, blocks_of(self%dofs, e))), e=1, &
        self%mesh%elements)]), force)
    end if
  end subroutine interface_force

  !> Ledger of laws with a state: stored energy and dissipation now. What their integration takes is
  !! counted since the accepted state.
  subroutine matter_energy(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: works(4)
    real(wp), allocatable :: springs(:, :)
    works(:3) = self%matter%works()
    works(4) = 0.0_wp
    if (self%dynamic) works(4) = self%matter%growth()
    call self%dofs%halo%add_up(works)
    self%energy%strain = works(1)
    self%energy%plastic = works(2)
    if (self%dynamic) then
      self%energy%numerical = self%energy%numerical + works(4)
    else
      self%energy%numerical = works(3)
    end if
    if (self%ground%n == 0) return
    allocate (springs, mold=self%state%u)
    call spring_force(self%ground, 0.0_wp*self%state%u, self%state%u, springs)
    self%energy%strain = self%energy%strain - 0.5_wp*sum(springs*self%state%u)
  end subroutine matter_energy

  !> Points that yielded in the trial increment, and the most local iterations, over all ranks.
  subroutine count_yielding(self, counts)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(out) :: counts(2)
    counts = real(self%matter%yielding(), wp)
    call self%dofs%halo%add_up(counts(:1))
    call self%dofs%halo%most(counts(2:))
  end subroutine count_yielding

  !> Faults N312 and N313 where the last update found a point without a state.
  subroutine matter_fault(self, errors)
    class(fem_body_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    logical :: inverted
    if (.not. self%matter%active .or. self%matter%bad == 0 .or. errors%any()) return
    call self%matter%trouble(self%elastic, text, inverted)
    if (inverted) then
      call errors%add('N312', text, 'time '//str(self%state%time)//' s', &
        'the load is more than this mesh can follow: take a finer mesh or a stiffer law there, '// &
        'or less load; shorter steps help where the load comes suddenly')
    else
      call errors%add('N313', text, 'time '//str(self%state%time)//' s', &
        'shorter steps, or look at the stress of the last state')
    end if
  end subroutine matter_fault

  !> Explicit steps that are taken at most: those of laws with a state leave room for what stiffens
  !! until the next look at the largest stable one [s].
  pure real(wp) function safe_step(self)
    class(fem_body_type), intent(in) :: self
    safe_step = self%step_limit
    if (self%matter%active) safe_step = margin*self%step_limit
  end function safe_step

  !> Put the accepted state aside.
  subroutine keep(self, kept)
    class(fem_body_type), intent(in) :: self
    type(fem_kept_type), intent(out) :: kept
    kept%state = self%accepted
    kept%energy = self%accepted_energy
    if (allocated(self%rigid)) kept%rigid = self%rigid
    if (.not. self%matter%active) return
    kept%stress = self%matter%accepted_stress
    kept%points = self%matter%accepted_state
  end subroutine keep

  !> What was put aside is the accepted state again; the trial stays.
  subroutine put_back(self, kept)
    class(fem_body_type), intent(inout) :: self
    type(fem_kept_type), intent(in) :: kept
    integer(i4) :: k
    self%accepted = kept%state
    self%accepted_energy = kept%energy
    if (allocated(kept%rigid)) then
      do k = 1, size(self%rigid)
        self%rigid(k)%accepted_d = kept%rigid(k)%accepted_d
        self%rigid(k)%accepted_v = kept%rigid(k)%accepted_v
      end do
    end if
    if (.not. self%matter%active) return
    self%matter%accepted_stress = kept%stress
    self%matter%accepted_state = kept%points
  end subroutine put_back

  !> Accept the trial state without a copy: the arrays change places, and `state` holds what is old
  !! until the next step fills it. For runs that look at `accepted` alone and never reject.
  subroutine hand_over(self)
    class(fem_body_type), intent(inout) :: self
    call swap(self%state%u, self%accepted%u)
    call swap(self%state%v, self%accepted%v)
    call swap(self%state%a, self%accepted%a)
    call swap(self%state%external, self%accepted%external)
    call swap(self%state%reaction, self%accepted%reaction)
    call swap(self%state%tie, self%accepted%tie)
    call swap(self%state%viscous, self%accepted%viscous)
    self%accepted%time = self%state%time
    self%accepted_energy = self%energy
    call self%matter%accept()
    call self%accept_rigid()
  end subroutine hand_over

  pure subroutine swap(a, b)
    real(wp), allocatable, intent(inout) :: a(:, :), b(:, :)
    real(wp), allocatable :: spare(:, :)
    call move_alloc(a, spare)
    call move_alloc(b, a)
    call move_alloc(spare, b)
  end subroutine swap

  subroutine accept(self)
    class(fem_body_type), intent(inout) :: self
    if (self%explicit .and. .not. self%damping%active()) then
      self%accepted%time = self%state%time  ! all that an undamped explicit step changes
      self%accepted%u = self%state%u
      self%accepted%v = self%state%v
      self%accepted%a = self%state%a
      self%accepted%external = self%state%external
      self%accepted%reaction = self%state%reaction
    else
      self%accepted = self%state
    end if
    self%accepted_energy = self%energy
    call self%matter%accept()
    call self%accept_rigid()
  end subroutine accept

  subroutine reject(self)
    class(fem_body_type), intent(inout) :: self
    self%state = self%accepted
    self%energy = self%accepted_energy
    where (self%prescribed) self%given_u = self%accepted%u
    call self%matter%reject()
  end subroutine reject
end module fem_body
