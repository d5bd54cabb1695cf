!> One static or implicit step of a linear body (Newmark, HHT-alpha) from the last accepted state: a
!! residual and a back-substitution.
module fem_linear_step
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use fem_body, only: fem_body_type
  use fem_newmark, only: dynamic_work
  use fem_sparse, only: multiply_mass, spring_force
  use fem_types, only: fem_state_type
  implicit none
  private
  public :: linear_step

contains

  !> One step from the accepted state to time t1; the new state stays a trial until `accept`.
  !! With lag = -alpha the balance of HHT is M a1 = (1 - lag) b1 + lag b0, b = f - K u - C v.
  subroutine linear_step(self, t1, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, self%dofs%blocks) :: internal, inertia, residual, du, tie, old_balance
    real(wp) :: dt

    dt = t1 - self%accepted%time
    call self%factor(dt, errors)
    if (errors%any()) return
    associate (s => self%state, old => self%accepted, share => 1.0_wp - self%scheme%lag)
      s%time = t1
      s%u = old%u
      call self%push(t1)
      call self%impose(t1, s%u)
      call self%external_at(t1, s%external)
      inertia = 0.0_wp
      old_balance = 0.0_wp
      if (self%scheme%dynamic) then
        call predict(self, dt)
        call multiply_mass(self%system%pattern, self%system%mass, s%a, inertia)
        if (self%scheme%lag > 0.0_wp) call balance(self, old, old_balance)
      end if
      call inner_forces(self, s, internal)
      call spring_force(self%port%robin, old%u, s%u, tie)
      residual = tie + share*(s%external - internal) + self%scheme%lag*old_balance - inertia
      call self%system%solver%solve(self%system%pattern, residual, du, errors)
      if (errors%any()) return
      s%u = s%u + du
      call self%check_finite(errors)
      if (errors%any()) return
      if (self%scheme%dynamic) then
        call correct(self, dt, du)
        call multiply_mass(self%system%pattern, self%system%mass, s%a, inertia)
      end if
      call self%internal_force(s%u, internal)
      call self%viscous_force(s%v, s%viscous)
      call spring_force(self%port%robin, old%u, s%u, tie)
      s%reaction = (inertia - tie - self%scheme%lag*old_balance)/share + internal &
                   + s%viscous - s%external
      call part_reactions(self)
      s%tie = tie
      call self%update_energy(internal)
      if (self%scheme%dynamic) call dynamic_work(self, dt, inertia, old_balance)
    end associate
  end subroutine linear_step

  !> Reactions are the unbalanced forces at supports; elsewhere these are the residual,
  !! relative to loads and reactions.
  subroutine part_reactions(self)
    type(fem_body_type), intent(inout) :: self
    real(wp) :: left, scale, sums(2)
    logical :: fixed(3), counted
    integer(i4) :: i, c
    left = 0.0_wp
    scale = 0.0_wp
    associate (s => self%state)
      do i = 1, size(s%reaction, 2)
        fixed = self%supports%held(:, i) .or. self%port%prescribed(:, i)
        counted = self%dofs%halo%counts(i)
        do c = 1, 3
          if (fixed(c) .and. counted) scale = scale + s%reaction(c, i)**2
          if (fixed(c)) cycle
          if (counted) left = left + s%reaction(c, i)**2
          if (counted) scale = scale + s%external(c, i)**2
          s%reaction(c, i) = 0.0_wp
        end do
      end do
    end associate
    sums = [left, scale]
    call self%dofs%halo%total(sums)
    if (sums(2) > 0.0_wp) self%residual = max(self%residual, sqrt(sums(1)/sums(2)))
  end subroutine part_reactions

  !> K u + C v and the forces of the initial stress [N, N m].
  subroutine inner_forces(self, s, force)
    type(fem_body_type), intent(in) :: self
    type(fem_state_type), intent(in) :: s
    real(wp), intent(out) :: force(:, :)
    real(wp) :: viscous(3, self%dofs%blocks)
    call self%internal_force(s%u, force)
    call self%viscous_force(s%v, viscous)
    force = force + viscous
  end subroutine inner_forces

  !> Forces that are not in balance, inertia left out: f + reactions - K u - C v [N, N m].
  subroutine balance(self, s, force)
    type(fem_body_type), intent(in) :: self
    type(fem_state_type), intent(in) :: s
    real(wp), intent(out) :: force(:, :)
    call inner_forces(self, s, force)
    force = s%external + s%reaction - force
  end subroutine balance

  !> Velocities and accelerations for unchanged free displacements (Newmark). What is prescribed
  !! has a velocity constant over the step and the backward difference of it as acceleration:
  !! Newmark's own relations would let both ring about a ramp, without bound.
  subroutine predict(self, dt)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    associate (s => self%state, old => self%accepted)
      where (self%supports%held .or. self%port%prescribed)
        s%v = (s%u - old%u)/dt
        s%a = (s%v - old%v)/dt
      elsewhere
        s%a = -old%v/(self%scheme%beta*dt) - (0.5_wp/self%scheme%beta - 1.0_wp)*old%a
        s%v = old%v + dt*((1.0_wp - self%scheme%gamma)*old%a + self%scheme%gamma*s%a)
      end where
    end associate
  end subroutine predict

  !> Accelerations and velocities of what is free after its displacements have changed by du [m].
  subroutine correct(self, dt, du)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt, du(:, :)
    associate (s => self%state, old => self%accepted)
      where (.not. (self%supports%held .or. self%port%prescribed))
        s%a = s%a + du/(self%scheme%beta*dt*dt)
        s%v = old%v + dt*((1.0_wp - self%scheme%gamma)*old%a + self%scheme%gamma*s%a)
      end where
    end associate
  end subroutine correct
end module fem_linear_step
