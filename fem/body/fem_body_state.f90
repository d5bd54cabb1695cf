!> A solid body as data: mesh, laws, loads, supports, matrices, the accepted state and a trial, and
!! how the trial becomes the accepted one. Forces are in fem_body_forces, matrices in fem_body.
module fem_body_state
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use fem_damping, only: fem_damping_type
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_leap, only: fem_leap_type
  use fem_matter, only: fem_matter_type
  use fem_one_point, only: fem_one_point_type
  use fem_parts, only: fem_scheme_type, fem_loads_type, fem_supports_type, fem_port_values_type, &
    fem_system_type, fem_limit_type, fem_newton_type, fem_kept_type
  use fem_pore, only: fem_pore_type
  use fem_rigid, only: place_rigid, push_rigid
  use fem_stages, only: fem_stages_type
  use fem_types, only: fem_mesh_type, fem_state_type, fem_energy_type
  use fem_whole, only: fem_whole_type
  implicit none
  private
  public :: fem_body_state_type

  type :: fem_body_state_type
    type(fem_mesh_type) :: mesh
    type(fem_dofs_type) :: dofs
    type(fem_whole_type) :: whole                !! mesh behind the parts of several ranks
    type(fem_elastic_type) :: elastic            !! moduli, quadrature and densities of elements
    type(fem_matter_type) :: matter              !! points whose laws have a state
    type(fem_pore_type) :: pore                  !! liquid in the pores
    type(fem_stages_type) :: stages              !! elements that are removed and placed
    type(fem_scheme_type) :: scheme              !! what the analysis requires
    type(fem_newton_type) :: newton              !! iteration for the equilibrium of `matter`
    type(fem_loads_type) :: loads
    type(fem_supports_type) :: supports
    type(fem_port_values_type) :: port           !! what a partner sets
    type(fem_damping_type) :: damping
    type(fem_system_type) :: system              !! matrices and factors
    type(fem_one_point_type) :: one_point        !! of explicit steps, if all elements are such
    type(fem_leap_type) :: leap_work             !! of undamped explicit steps
    type(fem_limit_type) :: limit                !! largest stable step
    real(wp) :: residual = 0.0_wp                !! largest of implicit steps [-]
    logical :: lean = .false.                    !! read to be dealt out: few arrays are there
    type(fem_state_type) :: state, accepted
    type(fem_energy_type) :: energy, accepted_energy
  contains
    procedure :: allocate_state
    procedure :: allocate_rest
    procedure :: drop_state
    procedure :: impose
    procedure :: push
    procedure :: check_finite
    procedure :: collect_blocks
    procedure :: keep
    procedure :: put_back
    procedure :: hand_over
    procedure :: begin_energy
    procedure :: take_energy
    procedure :: begin_ledger
    procedure :: accept
    procedure :: reject
    procedure, private :: accept_rigid
  end type fem_body_state_type

contains

  !> Arrays of the state and loads for the numbered fields, all zero; those alone that the deck
  !! fills where the body is read to be dealt out.
  subroutine allocate_state(self)
    class(fem_body_state_type), intent(inout) :: self
    integer(i4) :: n
    n = self%dofs%blocks
    allocate (self%state%u(3, n), self%state%v(3, n), source=0.0_wp)
    allocate (self%port%given_u(3, n), source=0.0_wp)
    allocate (self%supports%held(3, n), self%port%prescribed(3, n), source=.false.)
    if (self%lean) then
      self%accepted = self%state
    else
      call self%allocate_rest()
    end if
  end subroutine allocate_state

  !> The others.
  subroutine allocate_rest(self)
    class(fem_body_state_type), intent(inout) :: self
    integer(i4) :: n
    self%lean = .false.
    n = self%dofs%blocks
    allocate (self%state%a(3, n), source=0.0_wp)
    allocate (self%state%external(3, n), self%state%reaction(3, n), source=0.0_wp)
    allocate (self%state%tie(3, n), self%state%viscous(3, n), source=0.0_wp)
    allocate (self%port%given_v(3, n), source=0.0_wp)
    allocate (self%port%port_load(3, n), self%port%dead_load(3, n), source=0.0_wp)
    allocate (self%system%weight_force(3, n), self%system%initial_force(3, n), source=0.0_wp)
    allocate (self%port%mass_factor(n), source=1.0_wp)
    allocate (self%port%answering(n), source=.false.)
    if (allocated(self%accepted%u)) then  ! as the deck has filled it
      self%accepted%a = self%state%a
      self%accepted%external = self%state%external
      self%accepted%reaction = self%state%reaction
      self%accepted%tie = self%state%tie
      self%accepted%viscous = self%state%viscous
    else
      self%accepted = self%state
    end if
  end subroutine allocate_rest

  !> Without what a body that is read to be dealt out has of them.
  subroutine drop_state(self)
    class(fem_body_state_type), intent(inout) :: self
    deallocate (self%state%u, self%state%v, self%accepted%u, self%accepted%v)
    deallocate (self%port%given_u, self%port%prescribed, self%supports%held)
  end subroutine drop_state

  !> Put prescribed displacements at time t into u.
  subroutine impose(self, t, u)
    class(fem_body_state_type), intent(in) :: self
    real(wp), intent(in) :: t
    real(wp), intent(inout) :: u(:, :)
    real(wp) :: value
    integer(i4) :: k
    where (self%supports%held) u = 0.0_wp
    where (self%port%prescribed) u = self%port%given_u
    do k = 1, size(self%supports%motion)
      associate (m => self%supports%motion(k))
        value = m%scale*self%loads%curve(m%curve)%at(t)
        u(m%component, m%block) = value
      end associate
    end do
    call self%pore%impose(self%loads%curve, t, u)
    if (.not. allocated(self%supports%rigid)) return
    do k = 1, size(self%supports%rigid)
      call place_rigid(self%supports%rigid(k), self%loads%curve, self%mesh%x, t, u)
    end do
  end subroutine impose

  !> Free shifts of rigid groups, from the accepted state to time t1.
  subroutine push(self, t1)
    class(fem_body_state_type), intent(inout) :: self
    real(wp), intent(in) :: t1
    integer(i4) :: k
    if (.not. allocated(self%supports%rigid)) return
    do k = 1, size(self%supports%rigid)
      call push_rigid(self%supports%rigid(k), self%loads%curve, self%accepted%reaction, &
        self%accepted%time, t1)
    end do
  end subroutine push

  !> The free shifts of the trial are the accepted ones.
  subroutine accept_rigid(self)
    class(fem_body_state_type), intent(inout) :: self
    integer(i4) :: k
    if (.not. allocated(self%supports%rigid)) return
    do k = 1, size(self%supports%rigid)
      self%supports%rigid(k)%accepted_d = self%supports%rigid(k)%d
      self%supports%rigid(k)%accepted_v = self%supports%rigid(k)%v
    end do
  end subroutine accept_rigid

  !> Fault N304 for the first displacement that is not finite.
  subroutine check_finite(self, errors)
    class(fem_body_state_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: bad(2), node
    logical :: lost
    lost = .not. is_finite(sum(abs(self%state%u)))
    call self%dofs%halo%anywhere(lost)
    if (.not. lost) return
    bad = findloc(is_finite(self%state%u), .false.)
    node = huge(node)
    if (bad(2) > 0) node = self%mesh%number_of(self%dofs%node(bad(2)))
    call self%dofs%halo%least_number(node)
    call errors%add('N304', 'the displacement of node '//str(node)// &
                    ' is not finite', 'time '//str(self%state%time)//' s', &
                    'check loads, moduli and supports')
  end subroutine check_finite

  !> Values (m, blocks) of all blocks on the leader, in the order of the mesh; none elsewhere.
  subroutine collect_blocks(self, values, all)
    class(fem_body_state_type), intent(in) :: self
    real(wp), intent(in) :: values(:, :)
    real(wp), allocatable, intent(out) :: all(:, :)
    integer(i4) :: none(0)
    if (self%dofs%halo%dealt) then
      call self%whole%collect_blocks(self%dofs%halo%own, values, all)
    else
      call self%whole%collect_blocks(none, values, all)
    end if
  end subroutine collect_blocks

  !> Save the accepted state.
  subroutine keep(self, kept)
    class(fem_body_state_type), intent(in) :: self
    type(fem_kept_type), intent(out) :: kept
    kept%state = self%accepted
    kept%energy = self%accepted_energy
    if (allocated(self%supports%rigid)) kept%rigid = self%supports%rigid
    if (.not. self%matter%active) return
    kept%stress = self%matter%accepted_stress
    kept%points = self%matter%accepted_state
  end subroutine keep

  !> Restore the saved accepted state; the trial stays.
  subroutine put_back(self, kept)
    class(fem_body_state_type), intent(inout) :: self
    type(fem_kept_type), intent(in) :: kept
    integer(i4) :: k
    self%accepted = kept%state
    self%accepted_energy = kept%energy
    if (allocated(kept%rigid)) then
      do k = 1, size(self%supports%rigid)
        self%supports%rigid(k)%accepted_d = kept%rigid(k)%accepted_d
        self%supports%rigid(k)%accepted_v = kept%rigid(k)%accepted_v
      end do
    end if
    if (.not. self%matter%active) return
    self%matter%accepted_stress = kept%stress
    self%matter%accepted_state = kept%points
  end subroutine put_back

  !> The ledger of a trial begins with the accepted one.
  pure subroutine begin_energy(self)
    class(fem_body_state_type), intent(inout) :: self
    self%energy = self%accepted_energy
  end subroutine begin_energy

  !> The ledger of the trial is this.
  pure subroutine take_energy(self, energy)
    class(fem_body_state_type), intent(inout) :: self
    type(fem_energy_type), intent(in) :: energy
    self%energy = energy
  end subroutine take_energy

  !> The ledger of the accepted state, and of the trial, is this.
  pure subroutine begin_ledger(self, energy)
    class(fem_body_state_type), intent(inout) :: self
    type(fem_energy_type), intent(in) :: energy
    self%energy = energy
    self%accepted_energy = energy
  end subroutine begin_ledger

  !> Accept the trial state without a copy: the arrays change places, and `state` holds what is old
  !! until the next step fills it. For runs that use `accepted` alone and never reject.
  subroutine hand_over(self)
    class(fem_body_state_type), intent(inout) :: self
    call swap(self%state%u, self%accepted%u)
    call swap(self%state%v, self%accepted%v)
    call swap(self%state%a, self%accepted%a)
    call swap(self%state%external, self%accepted%external)
    call swap(self%state%reaction, self%accepted%reaction)
    call swap(self%state%tie, self%accepted%tie)
    call swap(self%state%viscous, self%accepted%viscous)
    self%accepted%time = self%state%time
    call self%energy%keep_largest()
    self%accepted_energy = self%energy
    call self%matter%accept()
    call self%pore%accept()
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
    class(fem_body_state_type), intent(inout) :: self
    if (self%scheme%explicit .and. .not. self%damping%active()) then
      self%accepted%time = self%state%time  ! all that an undamped explicit step changes
      self%accepted%u = self%state%u
      self%accepted%v = self%state%v
      self%accepted%a = self%state%a
      self%accepted%external = self%state%external
      self%accepted%reaction = self%state%reaction
    else
      self%accepted = self%state
    end if
    call self%energy%keep_largest()
    self%accepted_energy = self%energy
    call self%matter%accept()
    call self%pore%accept()
    call self%accept_rigid()
  end subroutine accept

  subroutine reject(self)
    class(fem_body_state_type), intent(inout) :: self
    self%state = self%accepted
    call self%begin_energy()
    where (self%port%prescribed) self%port%given_u = self%accepted%u
    call self%matter%reject()
  end subroutine reject
end module fem_body_state
