!> Forces of a body: loads, internal forces of any law, damping, and the ledger of the works they
!! do.
module fem_body_forces
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use fem_body_state, only: fem_body_state_type
  use fem_dofs, only: blocks_of
  use fem_follower, only: follower_force
  use fem_leap, only: least_shared
  use fem_ledger, only: step_works, fem_works_type
  use fem_recover, only: element_forces
  use fem_sparse, only: multiply, multiply_mass, spring_force
  implicit none
  private
  public :: fem_body_forces_type

  type, extends(fem_body_state_type) :: fem_body_forces_type
  contains
    procedure :: external_at
    procedure :: follow
    procedure :: trial_force
    procedure :: internal_force
    procedure :: viscous_force
    procedure :: ground_force
    procedure :: interface_force
    procedure :: update_energy
    procedure :: matter_energy
    procedure :: matter_fault
    procedure :: count_yielding
  end type fem_body_forces_type

contains

  !> All loads at time t [N], reactions not counted.
  subroutine external_at(self, t, force)
    class(fem_body_forces_type), intent(in) :: self
    real(wp), intent(in) :: t
    real(wp), intent(out) :: force(:, :)
    real(wp) :: value(size(self%loads%load))
    integer(i4) :: i, k
    value = 1.0_wp
    do k = 1, size(self%loads%load)
      if (self%loads%load(k)%curve > 0) value(k) = self%loads%curve(self%loads%load(k)%curve)%at(t)
    end do
    !$omp parallel do default(none) shared(self, force, value) private(i, k) schedule(static) &
    !$omp if(size(force, 2) > least_shared)
    do i = 1, size(force, 2)
      force(:, i) = self%system%weight_force(:, i) + self%port%dead_load(:, i) &
        + self%port%port_load(:, i)
      if (self%port%settling .and. self%port%answering(i)) &
        force(:, i) = force(:, i) - self%port%dead_load(:, i)
      do k = 1, size(value)
        force(:, i) = force(:, i) + value(k)*self%loads%load(k)%force(:, i)
      end do
    end do
    !$omp end parallel do
  end subroutine external_at

  !> Add the pressures that follow the surface, for displacements u at time t.
  subroutine follow(self, t, u, force)
    class(fem_body_forces_type), intent(in) :: self
    real(wp), intent(in) :: t, u(:, :)
    real(wp), intent(inout) :: force(:, :)
    real(wp) :: value
    integer(i4) :: k
    if (.not. allocated(self%loads%follower)) return
    do k = 1, size(self%loads%follower)
      value = 1.0_wp
      if (self%loads%follower(k)%curve > 0) value = &
        self%loads%curve(self%loads%follower(k)%curve)%at(t)
      call follower_force(self%mesh, self%loads%follower(k), value, u, force)
    end do
  end subroutine follow

  !> Internal forces for displacements u, of any law; those of laws with a state make the trial
  !! state of their points [N].
  subroutine trial_force(self, u, force)
    class(fem_body_forces_type), intent(inout) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    real(wp), allocatable :: springs(:, :)
    integer(i4) :: bad
    if (.not. self%matter%active) then
      call self%internal_force(u, force)
      return
    end if
    call self%matter%update(self%mesh, self%dofs, self%elastic, u, u - self%accepted%u, force, bad)
    call self%pore%force(self%mesh, self%dofs, self%elastic, self%accepted%u, &
                         u - self%accepted%u, force)
    if (.not. self%supports%sprung()) return
    allocate (springs, mold=u)
    call self%ground_force(u, springs)
    force = force - springs
  end subroutine trial_force

  !> Internal forces K u plus those of the initial stress [N].
  subroutine internal_force(self, u, force)
    class(fem_body_forces_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :)
    if (self%one_point%ready) then
      call self%one_point%force(u, force)
      call self%dofs%halo%sum_up(force)
    else
      call multiply(self%system%pattern, self%system%k, u, force)
    end if
    if (self%elastic%has_initial) force = force + self%system%initial_force
  end subroutine internal_force

  !> Forces of the springs to the ground [N]; where nodes are dealt out each rank has its own.
  subroutine ground_force(self, u, force)
    class(fem_body_forces_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out), contiguous :: force(:, :)
    call spring_force(self%supports%ground, 0.0_wp*u, u, force)
    if (self%dofs%halo%dealt) call self%dofs%halo%sum_up(force)
  end subroutine ground_force

  !> C v of the damping [N, N m].
  subroutine viscous_force(self, v, force)
    class(fem_body_forces_type), intent(in) :: self
    real(wp), intent(in) :: v(:, :)
    real(wp), intent(out) :: force(:, :)
    force = 0.0_wp
    if (self%scheme%dynamic .and. self%damping%active()) &
      call self%damping%force(self%system%pattern, self%system%k, self%system%mass, v, force)
  end subroutine viscous_force

  !> Internal forces of some elements alone, of this rank, or of those that have a prescribed
  !! node [N].
  subroutine interface_force(self, u, force, list)
    class(fem_body_forces_type), intent(inout) :: self
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
          [(any(self%port%prescribed(:, blocks_of(self%dofs, e))), e=1, self%mesh%elements)]), &
            force)
      end if
    else if (present(list)) then
      call element_forces(self%mesh, self%dofs, self%elastic, u, list, force)
    else
      call element_forces(self%mesh, self%dofs, self%elastic, u, pack([(e, e=1, &
        self%mesh%elements)], [(any(self%port%prescribed(:, blocks_of(self%dofs, e))), e=1, &
        self%mesh%elements)]), force)
    end if
  end subroutine interface_force

  !> Ledger of the trial state: stored energies now, works by the trapezoidal rule.
  subroutine update_energy(self, internal)
    class(fem_body_forces_type), intent(inout) :: self
    real(wp), intent(in) :: internal(:, :)  !! K u + initial [N]
    real(wp) :: momentum(3, self%dofs%blocks), before
    type(fem_works_type) :: works
    logical :: loaded
    associate (s => self%state, old => self%accepted, e => self%energy)
      ! the first static step raises the weight from zero, as all loads
      loaded = any(abs(old%external) > 0.0_wp)
      call self%dofs%halo%anywhere(loaded)
      before = merge(1.0_wp, 0.0_wp, loaded)
      call step_works(self%dofs%halo, old, s, internal, self%system%initial_force, &
        self%system%weight_force, works)
      call self%begin_energy()
      e%strain = works%strain
      e%load = e%load + works%load
      e%gravity = e%gravity + 0.5_wp*(1.0_wp + before)*works%weight
      e%support = e%support + works%support
      e%spring = e%spring + works%spring
      if (.not. self%scheme%dynamic) return
      e%damping = e%damping + works%damping
      if (self%scheme%explicit) return
      call multiply_mass(self%system%pattern, self%system%mass, s%v, momentum)
      e%kinetic = 0.5_wp*sum(s%v*momentum)
    end associate
  end subroutine update_energy

  !> Ledger of laws with a state: stored energy and dissipation now. What integration dissipates is
  !! counted since the accepted state.
  subroutine matter_energy(self)
    class(fem_body_forces_type), intent(inout) :: self
    real(wp) :: works(4)
    real(wp), allocatable :: springs(:, :)
    works(:3) = self%matter%works()
    works(4) = 0.0_wp
    if (self%scheme%dynamic) works(4) = self%matter%growth()
    call self%dofs%halo%add_up(works)
    self%energy%strain = works(1)
    self%energy%plastic = works(2)
    if (self%scheme%dynamic) then
      self%energy%numerical = self%energy%numerical + works(4)
    else
      self%energy%numerical = works(3)
    end if
    if (.not. self%supports%sprung()) return
    allocate (springs, mold=self%state%u)
    call self%ground_force(self%state%u, springs)
    self%energy%strain = self%energy%strain &
      - 0.5_wp*self%dofs%halo%total_of(springs*self%state%u)
  end subroutine matter_energy

  !> Faults N312 and N313 where the last update found a point without a state.
  subroutine matter_fault(self, errors)
    class(fem_body_forces_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    logical :: inverted
    if (.not. self%matter%active .or. self%matter%bad == 0 .or. errors%any()) return
    call self%matter%trouble(self%elastic, text, inverted)
    if (inverted) then
      call errors%add('N312', text, 'time '//str(self%state%time)//' s', &
        'the load is more than this mesh can follow: use a finer mesh or a stiffer law there, '// &
        'or less load; shorter steps help where the load comes suddenly')
    else
      call errors%add('N313', text, 'time '//str(self%state%time)//' s', &
        'shorter steps, or check the stress of the last state')
    end if
  end subroutine matter_fault

  !> Points that yielded in the trial increment, and the most local iterations, over all ranks.
  subroutine count_yielding(self, counts)
    class(fem_body_forces_type), intent(in) :: self
    real(wp), intent(out) :: counts(2)
    counts = real(self%matter%yielding(), wp)
    call self%dofs%halo%add_up(counts(:1))
    call self%dofs%halo%most(counts(2:))
  end subroutine count_yielding
end module fem_body_forces
