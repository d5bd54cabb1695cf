!> State of the liquid in the pores of a body: which elements have one, held pressures, inflow and
!! leaks of a step, and the books of what entered. What elements do with it: fem_pore.
module fem_pore_state
  use talus_kinds, only: wp, i4
  use talus_curve, only: curve_type
  use fem_dofs, only: fem_dofs_type
  use fem_face_set, only: leaking, reactions_of
  use fem_pore_element, only: fem_flow_step_type, fem_skeleton_type
  use fem_pore_faces, only: fem_held_pressure_type, fem_inflow_type, fem_leak_type
  use fem_pore_integrals, only: fem_wet_integrals_type
  implicit none
  private
  public :: fem_pore_state_type, fem_pore_books_type

  !> What entered so far, by held groups, then by inflows and leaks, and what is there.
  type :: fem_pore_books_type
    real(wp), allocatable :: entered(:)     !! [m^3]
    real(wp), allocatable :: rate(:)        !! of the last step [m^3/s]
    real(wp) :: content = 0.0_wp            !! beyond that of the start [m^3]
    real(wp) :: numerical = 0.0_wp          !! dissipated by the integration of the flow [J]
    real(wp) :: kept = 0.0_wp               !! stored in unsaturated pores since the start [J]
    real(wp) :: through = 0.0_wp            !! sum of what passed any face, either way [m^3]
    integer(i4) :: leaks = 0                !! nodes that became leaks, of all steps
  end type fem_pore_books_type

  type :: fem_pore_state_type
    logical :: active = .false.
    logical :: constant = .false.           !! the matrix depends on the length of a step alone
    logical :: unsaturated = .false.        !! some pores can be
    logical :: resting = .false.            !! pressures stay: equilibrium without time
    type(fem_flow_step_type) :: step
    type(fem_skeleton_type), allocatable :: skeleton(:)
    integer(i4), allocatable :: skeleton_of(:)  !! (elements) 0: no liquid
    real(wp), allocatable :: pervious(:)    !! (elements) mobility over that of the start
    real(wp), allocatable :: shear(:)       !! (elements) that steadies equal orders [Pa]
    real(wp), allocatable :: confined(:)    !! (elements) oedometric moduli at the start [Pa]
    type(fem_wet_integrals_type), allocatable :: kept(:)  !! (elements) in statics, if there is room
    type(fem_held_pressure_type), allocatable :: held(:)
    type(fem_inflow_type), allocatable :: inflow(:)
    type(fem_leak_type), allocatable :: leak(:)
    integer(i4) :: partner = 0              !! number of the inflow that is a partner's, 0: none
    real(wp), allocatable :: beside(:)      !! (blocks) storage of a partner's nodes besides the
                                            !! pores [m^3/Pa]
    real(wp), allocatable :: given(:)       !! (blocks) inflow of the step, without leaks [m^3/s]
    real(wp), allocatable :: rate(:)        !! (blocks) with leaks [m^3/s]
    real(wp), allocatable :: start(:, :)    !! (3, blocks) state that contents count from
    type(fem_pore_books_type) :: books, accepted_books
    real(wp), allocatable :: tried_from(:, :)  !! (3, blocks) last trial of a step with unsaturated
    real(wp), allocatable :: tried(:, :)       !! pores: state before it, and what it moves
    real(wp), allocatable :: swing(:, :)    !! (3, blocks) mean acceleration of a step [m/s^2]
    real(wp), allocatable :: gross(:)       !! (blocks) sizes of what a step's balance sums [m^3]
  contains
    procedure :: prepare
    procedure :: prepare_start
    procedure :: undrained
    procedure :: impose
    procedure :: begin
    procedure :: take_step
    procedure :: take_inertia
    procedure :: take_swing
    procedure :: forget_books
    procedure :: expect_partner
    procedure :: let_partner_in
    procedure :: store_beside
    procedure :: kept_beside
    procedure :: solid_of
    procedure :: note_trial
    procedure :: enter
    procedure :: accept
  end type fem_pore_state_type

contains

  !> Moduli that steady equal orders, and the state that contents count from.
  subroutine prepare(self, dofs, moduli, u)
    class(fem_pore_state_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(in) :: moduli(:, :)  !! (6, elements)
    real(wp), intent(in) :: u(:, :)       !! (3, blocks) [m], [Pa]
    if (.not. self%active) return
    self%shear = moduli(2, :) + 0.5_wp*moduli(3, :)
    if (.not. allocated(self%pervious)) allocate (self%pervious(size(moduli, 2)), source=1.0_wp)
    self%confined = moduli(1, :) + 2.0_wp*moduli(2, :) + moduli(3, :)
    if (allocated(self%rate)) return
    self%start = u
    allocate (self%rate(dofs%blocks), self%gross(dofs%blocks), self%given(dofs%blocks), &
      source=0.0_wp)
    allocate (self%books%entered(size(self%held) + size(self%inflow) + size(self%leak)), &
      source=0.0_wp)
    self%books%rate = self%books%entered
    self%accepted_books = self%books
  end subroutine prepare

  !> Modulus that the liquid adds where it cannot flow, alpha^2/S; 0 where there is none [Pa].
  pure function undrained(self, elements) result(modulus)
    class(fem_pore_state_type), intent(in) :: self
    integer(i4), intent(in) :: elements
    real(wp) :: modulus(elements)
    integer(i4) :: e
    modulus = 0.0_wp
    if (.not. self%active) return
    do e = 1, elements
      if (self%skeleton_of(e) == 0) cycle
      associate (s => self%skeleton(self%skeleton_of(e)))
        modulus(e) = s%biot**2/max(s%storage, tiny(1.0_wp))
      end associate
    end do
  end function undrained

  !> Contents count from this state.
  subroutine prepare_start(self, u)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: u(:, :)  !! (3, blocks)
    self%start = u
    self%step%dt = 0.0_wp
  end subroutine prepare_start

  !> Put the held pressures at time t into u.
  subroutine impose(self, curve, t, u)
    class(fem_pore_state_type), intent(in) :: self
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: t
    real(wp), intent(inout) :: u(:, :)
    integer(i4) :: k
    if (.not. allocated(self%held)) return
    do k = 1, size(self%held)
      associate (h => self%held(k))
        u(1, h%block) = h%value
        if (h%curve > 0) u(1, h%block) = curve(h%curve)%at(t)*h%value
      end associate
    end do
  end subroutine impose

  !> A step from t0 to t1: its length and the inflow.
  subroutine begin(self, curve, t0, t1)
    class(fem_pore_state_type), intent(inout) :: self
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: t0, t1  !! [s]
    integer(i4) :: k
    if (.not. self%active) return
    self%step%dt = t1 - t0
    self%given = 0.0_wp
    do k = 1, size(self%inflow)
      associate (i => self%inflow(k), theta => self%step%theta)
        if (i%curve > 0) i%factor = theta*curve(i%curve)%at(t1) &
          + (1.0_wp - theta)*curve(i%curve)%at(t0)
        self%given = self%given + i%factor*i%rate
      end associate
    end do
    do k = 1, size(self%leak)
      associate (l => self%leak(k), theta => self%step%theta)
        l%now = l%outside
        if (l%curve > 0) l%now = l%outside*(theta*curve(l%curve)%at(t1) &
          + (1.0_wp - theta)*curve(l%curve)%at(t0))
        if (l%rain > 0) l%raining = theta*curve(l%rain)%at(t1) &
          + (1.0_wp - theta)*curve(l%rain)%at(t0)
      end associate
    end do
  end subroutine begin

  !> The length of a step.
  subroutine take_step(self, dt)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    self%step%dt = dt
  end subroutine take_step

  !> Acceleration of free nodes by their displacement in a step, 0 in statics.
  subroutine take_inertia(self, inertia)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: inertia  !! [1/s^2]
    self%step%inertia = inertia
  end subroutine take_inertia

  !> The mean acceleration of a step from those at its start and end.
  subroutine take_swing(self, start, after)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: start(:, :), after(:, :)  !! (3, blocks) [m/s^2]
    self%swing = self%step%theta*after + (1.0_wp - self%step%theta)*start
  end subroutine take_swing

  !> Nothing has entered yet.
  subroutine forget_books(self)
    class(fem_pore_state_type), intent(inout) :: self
    self%books%entered = 0.0_wp
    self%books%rate = 0.0_wp
    self%books%content = 0.0_wp
    self%books%numerical = 0.0_wp
    self%books%kept = 0.0_wp
    self%books%through = 0.0_wp
    self%books%leaks = 0
    self%accepted_books = self%books
  end subroutine forget_books

  !> A partner will let liquid in at nodes: an inflow that has no rate yet.
  subroutine expect_partner(self, blocks)
    class(fem_pore_state_type), intent(inout) :: self
    integer(i4), intent(in) :: blocks
    type(fem_inflow_type), allocatable :: longer(:)
    self%partner = int(size(self%inflow), i4) + 1
    allocate (longer(self%partner))
    longer(:self%partner - 1) = self%inflow
    longer(self%partner)%name = 'partner'
    allocate (longer(self%partner)%rate(blocks), source=0.0_wp)
    call move_alloc(longer, self%inflow)
    allocate (self%beside(blocks), source=0.0_wp)
  end subroutine expect_partner

  !> What a partner lets in at blocks in a step of this length.
  subroutine let_partner_in(self, block, volume, span)
    class(fem_pore_state_type), intent(inout) :: self
    integer(i4), intent(in) :: block(:)
    real(wp), intent(in) :: volume(:)  !! [m^3]
    real(wp), intent(in) :: span       !! [s]
    if (self%partner > 0) self%inflow(self%partner)%rate(block) = volume/span
  end subroutine let_partner_in

  !> Add what nodes store besides the pores in a step, and its size. eq. F.70
  pure subroutine store_beside(self, moved, total)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: moved(:, :)     !! (3, blocks)
    real(wp), intent(inout) :: total(:, :)  !! (3, blocks) [m^3]
    if (.not. allocated(self%beside)) return
    total(1, :) = total(1, :) - self%beside*moved(1, :)
    self%gross = self%gross + self%beside*abs(moved(1, :))
  end subroutine store_beside

  !> Volume that is stored besides the pores since the start [m^3], and its energy [J].
  pure function kept_beside(self, u) result(kept)
    class(fem_pore_state_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)  !! (3, blocks)
    real(wp) :: kept(2)
    kept = 0.0_wp
    if (.not. allocated(self%beside)) return
    kept = [sum(self%beside*(u(1, :) - self%start(1, :))), 0.5_wp*sum(self%beside*u(1, :)**2)]
  end function kept_beside

  !> Solid and liquid of element e, with its permeability now.
  pure function solid_of(self, e) result(solid)
    class(fem_pore_state_type), intent(in) :: self
    integer(i4), intent(in) :: e
    type(fem_skeleton_type) :: solid
    solid = self%skeleton(self%skeleton_of(e))
    solid%mobility = self%pervious(e)*solid%mobility
  end function solid_of

  !> The trial whose slopes the next matrix has, where they depend on it.
  subroutine note_trial(self, old, moved)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: old(:, :), moved(:, :)  !! (3, blocks)
    if (.not. self%unsaturated) return
    self%tried_from = old
    self%tried = moved
  end subroutine note_trial

  !> Book what entered in the step; `raw` has the volume that the held nodes gave [m^3].
  subroutine enter(self, raw)
    class(fem_pore_state_type), intent(inout) :: self
    real(wp), intent(in) :: raw(:)  !! (blocks)
    real(wp) :: left(size(raw)), volume(size(self%books%entered))
    integer(i4) :: k, n
    left = raw
    do k = 1, size(self%held)
      volume(k) = sum(left(self%held(k)%block))
      left(self%held(k)%block) = 0.0_wp  ! a node of two groups counts in the first
    end do
    n = int(size(self%held), i4)
    do k = 1, size(self%inflow)
      volume(n + k) = self%step%dt*self%inflow(k)%factor*sum(self%inflow(k)%rate)
    end do
    n = n + int(size(self%inflow), i4)
    do k = 1, size(self%leak)
      call reactions_of(self%leak(k), left, volume(n + k))
      volume(n + k) = volume(n + k) + self%step%dt*self%leak(k)%rate
    end do
    associate (b => self%books, old => self%accepted_books)
      b%entered = old%entered + volume
      b%through = old%through + sum(abs(volume))
      b%leaks = old%leaks + leaking(self%leak)
      if (self%step%dt > 0.0_wp) b%rate = volume/self%step%dt
    end associate
  end subroutine enter

  !> The trial is the state.
  subroutine accept(self)
    class(fem_pore_state_type), intent(inout) :: self
    if (self%active) self%accepted_books = self%books
  end subroutine accept
end module fem_pore_state
