!> The pore liquid in a step of Newton's method (fem_newton): what it has in common, which factors
!! serve it, its balance, its books and energies.
module fem_flow_step
  use talus_kinds, only: wp, i4
  use fem_body, only: fem_body_type
  use fem_newmark, only: newmark_motion
  use fem_pore_element, only: fem_flow_energy_type
  implicit none
  private
  public :: begin_flow, finish_flow, matrix_step, measure_leak, out_of_balance, resting_force
  public :: same_matrix, swing, take_length, tight, work_on

  real(wp), parameter :: same_step = 1.0e-9_wp   !! relative change of dt that needs new factors

contains

  !> What the pore liquid has in common in a part.
  subroutine begin_flow(self, dt)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    if (.not. self%pore%active) return
    call self%pore%begin(self%loads%curve, self%accepted%time, self%state%time)
    call self%pore%renew_mobility(self%mesh, self%dofs, self%elastic, self%accepted%u)
    call take_length(self, dt)
  end subroutine begin_flow

  !> The length of a step, or that of its matrix.
  subroutine take_length(self, dt)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    call self%pore%take_step(dt)
    if (self%scheme%dynamic) call self%pore%take_inertia(1.0_wp/(self%scheme%beta*dt**2))
  end subroutine take_length

  !> Are the factors those of this part? Only a linear solid with a liquid keeps them.
  pure logical function same_matrix(self, dt)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: dt  !! [s]
    same_matrix = self%pore%constant .and. self%system%factored_dt >= 0.0_wp .and. &
      abs(dt - self%system%factored_dt) <= same_step*dt
  end function same_matrix

  !> Step of the matrix of a part [s]: that of the factors at a checkpoint where it is the same but
  !! for rounding, so that a restart repeats every bit.
  pure real(wp) function matrix_step(self, dt)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: dt  !! [s]
    matrix_step = dt
    if (self%pore%constant .and. abs(dt - self%system%restored_dt) <= same_step*dt) &
      matrix_step = self%system%restored_dt
  end function matrix_step

  !> Work of a residual on a correction; the rows of pressures, which are negative, count positive,
  !! so that the work of a stable body falls on the way [J].
  real(wp) function work_on(self, du, residual)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: du(:, :), residual(:, :)
    integer(i4) :: n
    n = self%dofs%solid
    work_on = self%dofs%halo%total_of(du(:, :n)*residual(:, :n))
    if (self%pore%active) work_on = work_on - sum(du(1, n + 1:)*residual(1, n + 1:))
  end function work_on

  !> Volume of liquid out of balance over that which the balances of the nodes sum.
  subroutine measure_leak(self, residual, leak)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: leak
    leak = 0.0_wp
    if (self%pore%active) leak = out_of_balance(self, residual)/max(norm2(self%pore%gross), &
                                                                    tiny(1.0_wp))
  end subroutine measure_leak

  !> Norm of the volumes of liquid out of balance at the nodes [m^3].
  pure real(wp) function out_of_balance(self, residual)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: residual(:, :)
    out_of_balance = norm2(residual(1, self%dofs%solid + 1:))
  end function out_of_balance

  !> Is the liquid in balance? Contents of unsaturated pores are not linear: what an iteration
  !! leaves out of balance is lost, so they take one correction more than the tolerance asks for.
  pure logical function tight(self, leak, before)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: leak, before  !! as `measure_leak`, and in the last iteration
    real(wp), parameter :: closed = 1.0e-14_wp
    tight = leak <= self%newton%tolerance
    if (self%pore%unsaturated) tight = tight .and. (leak <= closed .or. &
                                                    before <= self%newton%tolerance)
  end function tight

  !> Books and energies of the pore liquid: work of the mean pressure on what entered, and of the
  !! weight of the liquid on its flow.
  subroutine finish_flow(self)
    type(fem_body_type), intent(inout) :: self
    type(fem_flow_energy_type) :: energy
    associate (s => self%state, old => self%accepted, e => self%energy, p => self%pore)
      call p%account(self%mesh, self%dofs, self%elastic, old%u, s%u, energy)
      call p%enter(-s%reaction(1, :))
      p%books%kept = p%accepted_books%kept + energy%gained
      e%liquid = energy%stored + p%books%kept
      e%load = e%load + energy%weight
      e%gravity = e%gravity + energy%weight
      e%darcy = e%darcy + energy%darcy
      e%flow = e%flow + energy%fall + 0.5_wp*sum((s%u(1, self%dofs%solid + 1:) &
        + old%u(1, self%dofs%solid + 1:))*(p%step%dt*p%rate(self%dofs%solid + 1:) &
        - s%reaction(1, self%dofs%solid + 1:)))
      p%books%numerical = p%accepted_books%numerical + energy%numerical
      e%numerical = e%numerical + p%books%numerical  ! statics have the sum, dynamics the step's
      if (self%scheme%dynamic) e%numerical = e%numerical - p%accepted_books%numerical
    end associate
  end subroutine finish_flow

  !> Internal forces of a linear solid that stays in the accepted state, which is one of balance;
  !! its liquid flows.
  subroutine resting_force(self, internal)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(out) :: internal(:, :)
    integer(i4) :: n
    n = self%dofs%solid
    internal = 0.0_wp
    call self%pore%force(self%mesh, self%dofs, self%elastic, self%accepted%u, 0.0_wp*internal, &
                         internal)
    internal(:, :n) = self%accepted%external(:, :n) + self%accepted%reaction(:, :n)
  end subroutine resting_force

  !> Accelerations for displacements `moved` in the step: the liquid falls with them.
  subroutine swing(self, moved)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: moved(:, :)  !! (3, blocks)
    self%state%u = self%accepted%u + moved
    call newmark_motion(self, self%pore%step%dt)
    call self%pore%take_swing(self%accepted%a, self%state%a)
  end subroutine swing
end module fem_flow_step
