!> A solid body: the data of fem_body_state, the forces of fem_body_forces, and here its matrices,
!! their factors and the largest stable step. Steps are those of the analyses.
module fem_body
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use fem_assembly, only: assemble_stiffness, assemble_mass
  use fem_body_forces, only: fem_body_forces_type
  use fem_dofs, only: number_fields
  use fem_critical, only: largest_frequency, spring_rate, stable_step, newmark_step
  use fem_matter_step, only: tangent_frequency
  use fem_null_mode, only: explain_singular
  use fem_parts, only: fem_motion_type, fem_kept_type
  use fem_recover, only: initial_stress_force
  use fem_pore_element, only: fem_flow_energy_type
  use fem_shares, only: share_pattern
  use fem_sparse, only: make_pattern, add_springs, multiply_mass, scale_mass
  use fem_supports, only: check_supports
  use fem_types, only: fem_energy_type
  implicit none
  private
  public :: fem_body_type, fem_motion_type, fem_kept_type
  real(wp), parameter :: same_step = 1.0e-9_wp  !! relative change of dt that needs new factors
  real(wp), parameter :: margin = 0.95_wp       !! of the largest stable step, of laws with a state

  type, extends(fem_body_forces_type) :: fem_body_type
  contains
    procedure :: assemble
    procedure :: assemble_tangent
    procedure :: limit_step
    procedure :: factor
    procedure :: number
    procedure :: number_free
    procedure :: safe_step
    procedure :: hold_pressures
    procedure :: begin_liquid
  end type fem_body_type

contains

  !> Pattern, stiffness, mass and weight; again after moduli or weights have changed.
  subroutine assemble(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: fall(3, self%dofs%blocks)
    integer(i4) :: i
    if (.not. allocated(self%system%pattern%start)) then
      call make_pattern(self%dofs, self%system%pattern)
      if (.not. self%pore%active) call share_pattern(self%dofs, self%system%pattern)
    end if
    if (self%matter%active) then
      call self%matter%prepare(self%mesh, self%dofs, self%elastic)
      call prepare_pore(self)
      if (.not. allocated(self%system%k)) &
        allocate (self%system%k(3, 3, size(self%system%pattern%column)), source=0.0_wp)
    else
      call assemble_stiffness(self%mesh, self%dofs, self%elastic, self%system%pattern, &
        self%system%k)
      call add_springs(self%supports%ground, self%system%pattern, self%system%k)
    end if
    call assemble_mass(self%mesh, self%dofs, self%elastic, self%system%pattern, &
      self%system%mass, self%system%lumped)
    fall = 0.0_wp
    fall(:, :self%mesh%nodes) = spread(self%loads%gravity, 2, self%mesh%nodes)
    call multiply_mass(self%system%pattern, self%system%mass, fall, &
      self%system%weight_force)  ! sum of N_b is one
    do i = 1, self%dofs%blocks
      self%system%weight_force(:, i) = self%port%mass_factor(i)*self%system%weight_force(:, i)
    end do
    call scale_mass(self%system%pattern, self%port%mass_factor, self%system%mass)
    self%system%node_mass = self%system%lumped*self%port%mass_factor
    call initial_stress_force(self%mesh, self%dofs, self%elastic, self%system%initial_force)
    if (self%scheme%explicit .and. self%supports%ground%n == 0) &
      call self%one_point%prepare(self%mesh, self%dofs, self%elastic, self%system%pattern)
    call self%limit_step()
    call self%system%forget_factors()
  end subroutine assemble

  !> The pore liquid; moduli are those of the first points, with laws that depend on stress.
  subroutine prepare_pore(self)
    type(fem_body_type), intent(inout) :: self
    real(wp) :: moduli(6, self%mesh%elements)
    integer(i4) :: e
    if (.not. self%pore%active) return
    do e = 1, self%mesh%elements
      moduli(:, e) = self%matter%law(self%matter%law_of(e))%law%moduli_at( &
        self%matter%accepted_stress(:, self%elastic%point(e)))
    end do
    call self%pore%prepare(self%dofs, moduli, self%accepted%u)
    if (.not. self%scheme%dynamic) call self%pore%keep(self%mesh, self%elastic)
    call self%begin_liquid()
  end subroutine prepare_pore

  !> The books and the ledger of the pore liquid count from the accepted state.
  subroutine begin_liquid(self)
    class(fem_body_type), intent(inout) :: self
    type(fem_flow_energy_type) :: energy
    type(fem_energy_type) :: ledger
    if (.not. self%pore%active) return
    call self%pore%prepare_start(self%accepted%u)
    call self%pore%account(self%mesh, self%dofs, self%elastic, self%accepted%u, self%accepted%u, &
                           energy)
    call self%pore%forget_books()
    ledger = self%accepted_energy
    ledger%start = ledger%start + energy%stored - ledger%liquid
    ledger%liquid = energy%stored
    call self%begin_ledger(ledger)
  end subroutine begin_liquid

  !> Keep all pressures where they are, or let them go.
  subroutine hold_pressures(self, yes)
    class(fem_body_type), intent(inout) :: self
    logical, intent(in) :: yes
    logical :: chosen(3, self%dofs%blocks)
    if (.not. self%pore%active) return
    chosen = .false.
    chosen(:, self%dofs%solid + 1:) = yes
    call self%port%fix_at(chosen, self%accepted%u)
    call self%system%forget_numbers()
    call self%system%forget_factors()
  end subroutine hold_pressures

  !> Stiffness of the accepted state where laws have a state.
  subroutine assemble_tangent(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: internal(3, self%dofs%blocks)
    call self%trial_force(self%accepted%u, internal)
    call self%matter%assemble(self%mesh, self%dofs, self%elastic, self%system%pattern, &
      self%system%k, self%system%lower)
    call self%matter%reject()
  end subroutine assemble_tangent

  !> Largest stable step of the time integration, and the element that sets it. Springs of the port
  !! represent what the partner ties to the nodes of an explicit body: they act on its step alone.
  subroutine limit_step(self)
    class(fem_body_type), intent(inout) :: self
    real(wp) :: square
    if (self%scheme%explicit) then
      square = 0.0_wp
      if (self%matter%micro%active) then
        call self%matter%stiffen(self%mesh, self%dofs, self%elastic, self%state%u)
      else
        call largest_frequency(self%mesh, self%dofs, self%elastic, self%port%mass_factor, .true., &
                               square, self%limit%stiffest)
      end if
      if (self%matter%micro%active .or. (self%matter%finite .and. allocated(self%matter%u))) &
        call tangent_frequency(self%mesh, self%dofs, self%elastic, self%matter, &
                               self%port%mass_factor, square, self%limit%stiffest)
      call name_stiffest(self, square)
      square = square + spring_rate(self%dofs%halo, self%supports%ground, self%system%node_mass) &
               + spring_rate(self%dofs%halo, self%port%robin, self%system%node_mass)
      self%limit%step = stable_step(sqrt(square), self%damping%stiffness)
    else if (self%scheme%dynamic .and. 2.0_wp*self%scheme%beta < self%scheme%gamma) then
      call largest_frequency(self%mesh, self%dofs, self%elastic, self%port%mass_factor, .false., &
                             square, self%limit%stiffest)
      call name_stiffest(self, square)
      self%limit%step = newmark_step(sqrt(square), self%scheme%beta, self%scheme%gamma)
    end if
  end subroutine limit_step

  !> The stiffest element of all ranks, by its number in the mesh.
  subroutine name_stiffest(self, square)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(inout) :: square
    self%limit%stiffest = self%elastic%number_of(self%limit%stiffest)
    call self%dofs%halo%largest(square, self%limit%stiffest)
  end subroutine name_stiffest

  !> Factor for a step dt (statics: dt is not used); no action if done already.
  subroutine factor(self, dt, errors)
    class(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: k(:, :, :)
    real(wp) :: wanted, mass_term, share, rate

    if (self%scheme%explicit) return
    wanted = merge(dt, 0.0_wp, self%scheme%dynamic)
    if (self%system%factored_dt >= 0.0_wp .and. abs(wanted &
      - self%system%factored_dt) <= same_step*wanted) return
    call self%number(errors)
    if (errors%any() .or. self%matter%active) return
    mass_term = 0.0_wp
    k = self%system%k
    if (self%scheme%dynamic) then
      share = 1.0_wp - self%scheme%lag
      rate = share*self%scheme%gamma/(self%scheme%beta*dt)
      mass_term = 1.0_wp/(self%scheme%beta*dt*dt) + rate*self%damping%mass
      if (self%damping%active() .or. share < 1.0_wp) k = (share + rate*self%damping%stiffness)*k
      call self%damping%add_dashpots(self%system%pattern, rate, k)
    end if
    call add_springs(self%port%robin, self%system%pattern, k)
    call self%system%solver%factor(self%system%pattern, k, self%system%mass, mass_term, errors)
    if (.not. self%scheme%dynamic) call explain_singular(self%system%solver, &
      self%system%pattern, self%dofs, k, errors)
    if (.not. errors%any()) self%system%factored_dt = wanted
  end subroutine factor

  !> Number the free degrees of freedom, on request; a static body must be held.
  subroutine number(self, errors)
    class(fem_body_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    logical :: fixed(3, self%dofs%blocks)
    if (self%system%fresh_numbering) return
    fixed = self%supports%held .or. self%port%prescribed
    if (.not. self%scheme%dynamic) &
      call check_supports(self%mesh, self%dofs, self%system%pattern, fixed, &
        self%supports%ground, errors)
    if (.not. errors%any()) call self%number_free(errors)
  end subroutine number

  !> The same, held or not.
  subroutine number_free(self, errors)
    class(fem_body_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    logical :: fixed(3, self%dofs%blocks)
    fixed = self%supports%held .or. self%port%prescribed
    if (self%whole%dealt .and. .not. self%system%solver%iterative) call give_order(self)
    self%system%solver%mumps%general = self%matter%active .and. .not. self%matter%symmetric
    self%system%solver%mumps%indefinite = self%matter%active
    self%system%solver%mumps%pivoting = self%pore%active
    call self%system%solver%number(self%dofs, self%system%pattern, fixed, errors)
    if (.not. errors%any()) self%system%fresh_numbering = .true.
  end subroutine number_free

  !> What the leader orders the nodes of all ranks by, for factors, where nodes are dealt out.
  subroutine give_order(self)
    class(fem_body_type), intent(inout) :: self
    integer(i4) :: e
    associate (solver => self%system%solver, mesh => self%whole%mesh)
      if (.not. self%whole%ranks%leads() .or. allocated(solver%position)) return
      allocate (solver%whole)
      call number_fields(mesh, [(0_i4, e=1, mesh%elements)], solver%whole)
      solver%block_of = self%whole%block_of
    end associate
  end subroutine give_order

  !> Largest explicit steps in use: those of laws with a state have a margin for stiffening
  !! until the next update of the largest stable one [s].
  pure real(wp) function safe_step(self)
    class(fem_body_type), intent(in) :: self
    safe_step = self%limit%step
    if (self%matter%active) safe_step = margin*self%limit%step
  end function safe_step
end module fem_body
