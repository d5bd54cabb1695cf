!> A solid body: mesh, matrices, loads, supports, state; one static or implicit step (Newmark,
!! HHT-alpha) from the last accepted state. Linear: a residual and a back-substitution.
module fem_body
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use fem_types, only: fem_mesh_type, fem_curve_type, fem_load_type, fem_springs_type, &
    fem_state_type, fem_energy_type
  use fem_assembly, only: assemble_stiffness, assemble_mass
  use fem_critical, only: largest_frequency, stable_step
  use fem_damping, only: fem_damping_type
  use fem_dofs, only: fem_dofs_type, blocks_of
  use fem_elastic, only: fem_elastic_type
  use fem_explicit, only: drift_half, kick_half, explicit_kinetic
  use fem_leap, only: fem_leap_type, drift_all, kick_all
  use fem_one_point, only: fem_one_point_type
  use fem_sparse, only: fem_pattern_type, make_pattern, add_springs, multiply, multiply_mass
  use fem_solver, only: fem_solver_type
  use fem_supports, only: check_supports
  use fem_loads, only: curve_value
  use fem_recover, only: initial_stress_force, element_forces
  implicit none
  private
  public :: fem_body_type, fem_motion_type

  real(wp), parameter :: same_step = 1.0e-9_wp  !! relative change of dt that needs new factors

  !> Prescribed motion of one component of some blocks.
  type :: fem_motion_type
    integer(i4) :: component = 1, curve = 0
    real(wp) :: scale = 1.0_wp             !! [m], [rad]
    integer(i4), allocatable :: block(:)
  end type fem_motion_type

  type :: fem_body_type
    type(fem_mesh_type) :: mesh
    type(fem_dofs_type) :: dofs
    type(fem_elastic_type) :: elastic
    type(fem_curve_type), allocatable :: curve(:)
    type(fem_load_type), allocatable :: load(:)
    type(fem_motion_type), allocatable :: motion(:)
    type(fem_springs_type) :: ground             !! springs to the ground, of the deck
    type(fem_springs_type) :: robin              !! springs to the last accepted state, of the port
    logical, allocatable :: held(:, :)           !! (3, blocks) supported by the deck
    logical, allocatable :: prescribed(:, :)     !! (3, blocks) moved by the port
    real(wp), allocatable :: given_u(:, :)       !! (3, blocks) values of the port [m]
    real(wp), allocatable :: port_load(:, :)     !! (3, blocks) of the port, now [N]
    real(wp), allocatable :: dead_load(:, :)     !! (3, blocks) of the port, constant [N]
    real(wp), allocatable :: mass_factor(:)      !! (blocks) for explicit steps [-]
    real(wp) :: gravity(3) = 0.0_wp              !! [m/s^2]
    logical :: dynamic = .false.
    logical :: massive = .false.                 !! mass matters: dynamics or modes
    logical :: explicit = .false.                !! central differences; dynamic is true too
    real(wp) :: beta = 0.25_wp, gamma = 0.5_wp
    real(wp) :: lag = 0.0_wp                     !! HHT: share of the old balance, -alpha [-]
    type(fem_damping_type) :: damping
    type(fem_leap_type) :: leap_work             !! of undamped explicit steps
    type(fem_one_point_type) :: one_point        !! of explicit steps, if all elements are such
    type(fem_pattern_type) :: pattern
    type(fem_solver_type) :: solver
    real(wp), allocatable :: k(:, :, :), mass(:), lumped(:)
    real(wp), allocatable :: weight_force(:, :)  !! of gravity [N]
    real(wp), allocatable :: initial_force(:, :) !! internal forces of the initial stress [N]
    real(wp) :: step_limit = huge(1.0_wp)        !! of central differences [s]
    integer(i4) :: stiffest = 0                  !! element that sets it
    real(wp) :: factored_dt = -1.0_wp            !! [s], 0 in statics, < 0 not factored
    real(wp) :: restored_dt = -1.0_wp            !! [s] of the factors at a checkpoint, < 0 none
    logical :: fresh_numbering = .false.
    type(fem_state_type) :: state, accepted
    type(fem_energy_type) :: energy, accepted_energy
  contains
    procedure :: allocate_state
    procedure :: assemble
    procedure :: factor
    procedure :: step
    procedure :: accept
    procedure :: reject
    procedure :: internal_force
    procedure :: external_at
    procedure :: update_energy
    procedure :: start_acceleration
    procedure :: interface_force
    procedure :: explicit_energy
    procedure, private :: leap
    procedure :: impose
    procedure, private :: predict
    procedure, private :: correct
    procedure, private :: dynamic_work
    procedure :: viscous_force
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
    allocate (self%given_u(3, n), self%port_load(3, n), self%dead_load(3, n), source=0.0_wp)
    allocate (self%weight_force(3, n), self%initial_force(3, n), source=0.0_wp)
    allocate (self%held(3, n), self%prescribed(3, n), source=.false.)
    allocate (self%mass_factor(n), source=1.0_wp)
    self%accepted = self%state
  end subroutine allocate_state

  !> Pattern, stiffness, mass and weight; again after moduli or weights have changed.
  subroutine assemble(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: frequency
    real(wp) :: fall(3, self%dofs%blocks)
    if (.not. allocated(self%pattern%start)) call make_pattern(self%dofs, self%pattern)
    call assemble_stiffness(self%mesh, self%dofs, self%elastic, self%pattern, self%k)
    call add_springs(self%ground, self%pattern, self%k)
    call assemble_mass(self%mesh, self%dofs, self%elastic, self%pattern, self%mass, self%lumped)
    fall = 0.0_wp
    fall(:, :self%mesh%nodes) = spread(self%gravity, 2, self%mesh%nodes)
    call multiply_mass(self%pattern, self%mass, fall, self%weight_force)  ! sum of N_b is one
    call initial_stress_force(self%mesh, self%dofs, self%elastic, self%initial_force)
    if (self%explicit .and. self%ground%n == 0) &
      call self%one_point%prepare(self%mesh, self%dofs, self%elastic, self%pattern)
    if (self%explicit) then
      call largest_frequency(self%mesh, self%dofs, self%elastic, self%ground, self%lumped, &
                             frequency, self%stiffest)
      self%step_limit = stable_step(frequency, self%damping%stiffness)
    end if
    self%factored_dt = -1.0_wp
  end subroutine assemble

  !> Factor for a step dt (statics: dt is not used); nothing to do if that is done.
  subroutine factor(self, dt, errors)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: k(:, :, :)
    real(wp) :: wanted, mass_term, share, rate
    logical :: fixed(3, self%dofs%blocks)

    if (self%explicit) return
    wanted = merge(dt, 0.0_wp, self%dynamic)
    if (self%factored_dt >= 0.0_wp .and. abs(wanted - self%factored_dt) <= same_step*wanted) return
    if (.not. self%fresh_numbering) then
      fixed = self%held .or. self%prescribed
      if (.not. self%dynamic) &
        call check_supports(self%mesh, self%dofs, self%pattern, fixed, self%ground, errors)
      if (errors%any()) return
      call self%solver%number(self%dofs, self%pattern, fixed, errors)
      if (errors%any()) return
      self%fresh_numbering = .true.
    end if
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
    if (.not. errors%any()) self%factored_dt = wanted
  end subroutine factor

  !> All loads at time t [N], reactions not counted.
  subroutine external_at(self, t, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: t
    real(wp), intent(out) :: force(:, :)
    integer(i4) :: k
    force = self%weight_force + self%dead_load + self%port_load
    do k = 1, size(self%load)
      if (self%load(k)%curve == 0) then
        force = force + self%load(k)%force
      else
        force = force + curve_value(self%curve(self%load(k)%curve), t)*self%load(k)%force
      end if
    end do
  end subroutine external_at

  !> Internal forces K u plus those of the initial stress [N].
  subroutine internal_force(self, u, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    if (self%one_point%ready) then
      call self%one_point%force(u, force)
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
        value = m%scale*curve_value(self%curve(m%curve), t)
        u(m%component, m%block) = value
      end associate
    end do
  end subroutine impose

  !> C v of the damping [N, N m].
  subroutine viscous_force(self, v, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: v(:, :)
    real(wp), intent(out) :: force(:, :)
    force = 0.0_wp
    if (self%dynamic .and. self%damping%active()) &
      call self%damping%force(self%pattern, self%k, self%mass, v, force)
  end subroutine viscous_force

  !> One step from the accepted state to time t1; the new state stays a trial until `accept`.
  !! With lag = -alpha the balance of HHT is M a1 = (1 - lag) b1 + lag b0, b = f - K u - C v.
  subroutine step(self, t1, errors)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, self%dofs%blocks) :: internal, inertia, residual, du, tie, old_balance
    real(wp) :: dt

    if (self%explicit) then
      call self%leap(t1, errors)
      return
    end if
    dt = t1 - self%accepted%time
    call self%factor(dt, errors)
    if (errors%any()) return
    associate (s => self%state, old => self%accepted, share => 1.0_wp - self%lag)
      s%time = t1
      s%u = old%u
      call self%impose(t1, s%u)
      call self%external_at(t1, s%external)
      inertia = 0.0_wp
      old_balance = 0.0_wp
      if (self%dynamic) then
        call self%predict(dt)
        call multiply_mass(self%pattern, self%mass, s%a, inertia)
        if (self%lag > 0.0_wp) call balance(self, old, old_balance)
      end if
      call inner_forces(self, s, internal)
      call robin_force(self%robin, old%u, s%u, tie)
      residual = tie + share*(s%external - internal) + self%lag*old_balance - inertia
      call self%solver%solve(self%pattern, residual, du, errors)
      if (errors%any()) return
      s%u = s%u + du
      call check_finite(self, errors)
      if (errors%any()) return
      if (self%dynamic) then
        call self%correct(dt, du)
        call multiply_mass(self%pattern, self%mass, s%a, inertia)
      end if
      call self%internal_force(s%u, internal)
      call self%viscous_force(s%v, s%viscous)
      call robin_force(self%robin, old%u, s%u, tie)
      s%reaction = (inertia - tie - self%lag*old_balance)/share + internal &
                   + s%viscous - s%external
      where (.not. (self%held .or. self%prescribed)) s%reaction = 0.0_wp
      s%tie = tie
      call self%update_energy(internal)
      if (self%dynamic) call self%dynamic_work(dt, inertia, old_balance)
    end associate
  end subroutine step

  !> One step of central differences.
  subroutine leap(self, t1, errors)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, self%dofs%blocks) :: internal, half, force
    real(wp) :: mass(self%dofs%blocks), dt, discrete, supports
    logical :: fixed(3, self%dofs%blocks)

    if (.not. self%damping%active()) then
      call quick_leap(self, t1, errors)
      return
    end if
    dt = t1 - self%accepted%time
    fixed = self%held .or. self%prescribed
    mass = self%lumped*self%mass_factor
    associate (s => self%state, old => self%accepted)
      s%time = t1
      s%u = old%u
      call self%impose(t1, s%u)
      call drift_half(dt, fixed, old, s, half)
      call check_finite(self, errors)
      if (errors%any()) return
      call self%external_at(t1, s%external)
      call self%internal_force(s%u, internal)
      s%viscous = 0.0_wp
      if (self%damping%stiffness > 0.0_wp) then
        call multiply(self%pattern, self%k, half, s%viscous)
        s%viscous = self%damping%stiffness*s%viscous
      end if
      force = s%external - internal - s%viscous
      call kick_half(dt, fixed, mass, self%damping, force, half, old, s)
      s%reaction = merge(internal + s%viscous - s%external, 0.0_wp, fixed)
      where (fixed) s%reaction = s%reaction + s%a*spread(mass, 1, 3)
      s%tie = 0.0_wp
      call self%update_energy(internal)
      call explicit_kinetic(dt, fixed, mass, old, s, self%energy%kinetic, discrete, supports)
      self%energy%support = self%energy%support - supports
      self%energy%numerical = self%energy%numerical + discrete
    end associate
  end subroutine leap

  !> One undamped step of central differences.
  subroutine quick_leap(self, t1, errors)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: dt
    integer(i4) :: k

    dt = t1 - self%accepted%time
    associate (s => self%state, old => self%accepted, work => self%leap_work)
      s%time = t1
      call drift_all(dt, self%held, self%prescribed, self%given_u, old, s, work)
      do k = 1, size(self%motion)
        associate (m => self%motion(k))
          s%u(m%component, m%block) = m%scale*curve_value(self%curve(m%curve), t1)
          work%half(m%component, m%block) = (s%u(m%component, m%block) &
                                             - old%u(m%component, m%block))/dt
        end associate
      end do
      work%mass = self%lumped*self%mass_factor
      call self%external_at(t1, s%external)
      call self%internal_force(s%u, work%internal)
      call kick_all(dt, self%initial_force, self%weight_force, old, s, work)
      if (.not. is_finite(work%strain)) call check_finite(self, errors)
      self%energy = self%accepted_energy
      associate (e => self%energy)
        e%strain = work%strain
        e%load = e%load + work%load
        ! the first step from rest brings the weight up from nothing, as it does all loads
        e%gravity = e%gravity + merge(1.0_wp, 0.5_wp, any(abs(old%external) > 0.0_wp))*work%weight
        e%support = e%support + work%support
        e%kinetic = work%kinetic
        e%numerical = e%numerical + work%discrete
      end associate
    end associate
  end subroutine quick_leap

  !> Fault N304 for the first displacement that is not finite.
  subroutine check_finite(self, errors)
    class(fem_body_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: bad(2)
    if (all(is_finite(self%state%u))) return
    bad = findloc(is_finite(self%state%u), .false.)
    call errors%add('N304', 'the displacement of node '//str(self%dofs%node(bad(2)))// &
                    ' is not finite', 'time '//str(self%state%time)//' s', &
                    'check loads, moduli and supports')
  end subroutine check_finite

  !> K u + C v and the forces of the initial stress [N, N m].
  subroutine inner_forces(self, s, force)
    class(fem_body_type), intent(in) :: self
    type(fem_state_type), intent(in) :: s
    real(wp), intent(out) :: force(:, :)
    real(wp) :: viscous(3, self%dofs%blocks)
    call self%internal_force(s%u, force)
    call self%viscous_force(s%v, viscous)
    force = force + viscous
  end subroutine inner_forces

  !> Forces that are not in balance, inertia left out: f + reactions - K u - C v [N, N m].
  subroutine balance(self, s, force)
    class(fem_body_type), intent(in) :: self
    type(fem_state_type), intent(in) :: s
    real(wp), intent(out) :: force(:, :)
    call inner_forces(self, s, force)
    force = s%external + s%reaction - force
  end subroutine balance

  !> Velocities and accelerations for unchanged free displacements (Newmark). What is prescribed
  !! has a velocity constant over the step and the backward difference of it as acceleration:
  !! Newmark's own relations would let both ring about a ramp, without bound.
  subroutine predict(self, dt)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    associate (s => self%state, old => self%accepted)
      where (self%held .or. self%prescribed)
        s%v = (s%u - old%u)/dt
        s%a = (s%v - old%v)/dt
      elsewhere
        s%a = -old%v/(self%beta*dt) - (0.5_wp/self%beta - 1.0_wp)*old%a
        s%v = old%v + dt*((1.0_wp - self%gamma)*old%a + self%gamma*s%a)
      end where
    end associate
  end subroutine predict

  !> Accelerations and velocities of what is free after its displacements have changed by du [m].
  subroutine correct(self, dt, du)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt, du(:, :)
    associate (s => self%state, old => self%accepted)
      where (.not. (self%held .or. self%prescribed))
        s%a = s%a + du/(self%beta*dt*dt)
        s%v = old%v + dt*((1.0_wp - self%gamma)*old%a + self%gamma*s%a)
      end where
    end associate
  end subroutine correct

  !> What trapezoidal works leave over. By their balance in every state it is D = du'b - dv'M v_mean
  !! with b the mean of what accelerates (M a, or the balances of HHT): the dissipation of the
  !! scheme. Moved supports do not obey Newmark's relations; with e = du - dt v_mean and
  !! f = dt a_mean - dv there (zero where free) f'M v_mean + e'M a_mean is work of theirs.
  subroutine dynamic_work(self, dt, inertia, old_balance)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt                                 !! [s]
    real(wp), intent(in) :: inertia(:, :), old_balance(:, :)   !! M a1, b0 of HHT [N]
    real(wp), dimension(3, self%dofs%blocks) :: mean, product, defect, moved
    real(wp) :: left, supports
    associate (s => self%state, old => self%accepted, fixed => self%held .or. self%prescribed)
      moved = s%u - old%u
      if (self%lag <= 0.0_wp .and. abs(self%gamma - 0.5_wp) + abs(self%beta - 0.25_wp) <= 0.0_wp &
          .and. .not. any(fixed .and. abs(moved) + abs(s%v) + abs(old%v) + abs(s%a) + abs(old%a) &
                          > 0.0_wp)) return
      mean = 0.5_wp*(s%a + old%a)
      call multiply_mass(self%pattern, self%mass, mean, product)
      defect = merge(moved - 0.5_wp*dt*(s%v + old%v), 0.0_wp, fixed)
      supports = sum(defect*product)
      left = sum(moved*product)
      if (self%lag > 0.0_wp) left = 0.5_wp*sum(moved*(old_balance + s%tie &
        + (inertia - s%tie - self%lag*old_balance)/(1.0_wp - self%lag)))
      defect = merge(dt*mean - (s%v - old%v), 0.0_wp, fixed)
      mean = 0.5_wp*(s%v + old%v)
      call multiply_mass(self%pattern, self%mass, mean, product)
      supports = supports + sum(defect*product)
      left = left - sum((s%v - old%v)*product)
      self%energy%support = self%energy%support - supports
      self%energy%numerical = self%energy%numerical + left - supports
    end associate
  end subroutine dynamic_work

  !> Forces of the Robin springs, S (u_old - u) [N].
  pure subroutine robin_force(robin, old, u, force)
    type(fem_springs_type), intent(in) :: robin
    real(wp), intent(in) :: old(:, :), u(:, :)
    real(wp), intent(out) :: force(:, :)
    real(wp) :: stretch(3)
    integer(i4) :: s, a
    force = 0.0_wp
    do s = 1, robin%n
      stretch = 0.0_wp
      do a = 1, size(robin%node, 1)
        stretch = stretch + robin%weight(a, s)*(old(:, robin%node(a, s)) - u(:, robin%node(a, s)))
      end do
      stretch = matmul(robin%stiffness(:, :, s), stretch)
      do a = 1, size(robin%node, 1)
        force(:, robin%node(a, s)) = force(:, robin%node(a, s)) + robin%weight(a, s)*stretch
      end do
    end do
  end subroutine robin_force

  !> Ledger of the trial state: stored energies now, works by the trapezoidal rule.
  subroutine update_energy(self, internal)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: internal(:, :)  !! K u + initial [N]
    real(wp), dimension(3, self%dofs%blocks) :: moved, momentum
    real(wp) :: before
    associate (s => self%state, old => self%accepted, e => self%energy)
      ! the first static step brings the weight up from nothing, as it does all loads
      before = merge(1.0_wp, 0.0_wp, any(abs(old%external) > 0.0_wp))
      e = self%accepted_energy
      moved = s%u - old%u
      e%strain = 0.5_wp*sum(s%u*(internal + self%initial_force))
      e%load = e%load + 0.5_wp*sum((s%external + old%external)*moved)
      e%gravity = e%gravity + 0.5_wp*(1.0_wp + before)*sum(self%weight_force*moved)
      e%support = e%support + 0.5_wp*sum((s%reaction + old%reaction)*moved)
      e%spring = e%spring + 0.5_wp*sum((s%tie + old%tie)*moved)
      if (.not. self%dynamic) return
      e%damping = e%damping + 0.5_wp*sum((s%viscous + old%viscous)*moved)
      if (self%explicit) return
      call multiply_mass(self%pattern, self%mass, s%v, momentum)
      e%kinetic = 0.5_wp*sum(s%v*momentum)
    end associate
  end subroutine update_energy

  !> Accelerations and reactions at the start of a dynamic run from the loads there: M a = f - K u.
  subroutine start_acceleration(self, errors)
    class(fem_body_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(fem_solver_type) :: solver
    real(wp), dimension(3, self%dofs%blocks) :: internal, residual, inertia
    real(wp), allocatable :: none(:, :, :)
    logical :: fixed(3, self%dofs%blocks)

    call self%external_at(self%state%time, self%state%external)
    call self%internal_force(self%state%u, internal)
    residual = self%state%external - internal
    fixed = self%held .or. self%prescribed
    if (self%explicit) then
      self%state%a = merge(0.0_wp, residual/spread(self%lumped*self%mass_factor, 1, 3), fixed)
      self%state%reaction = merge(-residual, 0.0_wp, fixed)
    else if (maxval(abs(residual)) > 0.0_wp) then
      call solver%number(self%dofs, self%pattern, fixed, errors)
      if (errors%any()) return
      allocate (none(3, 3, size(self%mass)), source=0.0_wp)
      call solver%factor(self%pattern, none, self%mass, 1.0_wp, errors)
      if (.not. errors%any()) call solver%solve(self%pattern, residual, self%state%a, errors)
      call solver%mumps%free()
      call multiply_mass(self%pattern, self%mass, self%state%a, inertia)
      self%state%reaction = merge(inertia - residual, 0.0_wp, fixed)
    end if
    self%accepted = self%state
  end subroutine start_acceleration

  !> Internal forces of the elements alone that have a prescribed node [N].
  subroutine interface_force(self, u, force)
    class(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    logical :: chosen(self%mesh%elements)
    integer(i4) :: e
    do e = 1, self%mesh%elements
      chosen(e) = any(self%prescribed(:, blocks_of(self%dofs, e)))
    end do
    call element_forces(self%mesh, self%dofs, self%elastic, u, chosen, force)
  end subroutine interface_force

  !> Ledger of an explicit state with lumped mass; loads by what moved since the accepted state.
  subroutine explicit_energy(self)
    class(fem_body_type), intent(inout) :: self
    real(wp), dimension(3, self%dofs%blocks) :: internal
    integer(i4) :: i
    call self%internal_force(self%state%u, internal)
    self%state%tie = 0.0_wp
    self%state%reaction = merge(internal - self%state%external, 0.0_wp, &
                                self%held .or. self%prescribed)
    call self%update_energy(internal)
    self%energy%kinetic = 0.0_wp
    do i = 1, self%dofs%blocks
      self%energy%kinetic = self%energy%kinetic + 0.5_wp*self%lumped(i)*self%mass_factor(i) &
                            *sum(self%state%v(:, i)**2)
    end do
  end subroutine explicit_energy

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
  end subroutine accept

  subroutine reject(self)
    class(fem_body_type), intent(inout) :: self
    self%state = self%accepted
    self%energy = self%accepted_energy
    where (self%prescribed) self%given_u = self%accepted%u
  end subroutine reject
end module fem_body
