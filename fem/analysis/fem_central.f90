!> A step of central differences of a body with lumped masses, with and without damping, and the
!! ledger of explicit states.
module fem_central
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: is_finite
  use fem_body, only: fem_body_type
  use fem_explicit, only: drift_half, kick_half, explicit_kinetic
  use fem_leap, only: drift_all, kick_all
  use fem_sparse, only: multiply
  implicit none
  private
  public :: central_step, explicit_energy, central_steps

  integer(i4), parameter :: between = 50     !! steps between updates of the largest stable one

contains

  !> To time t1 with laws that have a state, in parts where the largest stable step has become
  !! shorter; parts before the last one are accepted.
  subroutine central_steps(self, t1, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: left
    integer(i4) :: parts

    do
      left = t1 - self%accepted%time
      parts = ceiling(left/self%safe_step())
      if (parts > 1) then
        call central_step(self, self%accepted%time + left/parts, errors)
      else
        call central_step(self, t1, errors)
      end if
      if (errors%any()) return
      self%limit%leaps = self%limit%leaps + 1
      if (modulo(self%limit%leaps, int(between, i8)) == 0) call look_again(self)
      if (parts <= 1) return
      call self%accept()
    end do
  end subroutine central_steps

  !> The largest stable step at the present state of the points.
  subroutine look_again(self)
    type(fem_body_type), intent(inout) :: self
    if (.not. self%matter%micro%active) call self%matter%renew_moduli(self%elastic)
    call self%limit_step()
  end subroutine look_again

  !> One step of central differences.
  subroutine central_step(self, t1, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, self%dofs%blocks) :: internal, half, force
    real(wp) :: mass(self%dofs%blocks), dt, works(3)
    logical :: fixed(3, self%dofs%blocks)
    integer(i4) :: i

    call self%push(t1)
    if (.not. self%damping%active()) then
      call quick_leap(self, t1, errors)
      return
    end if
    dt = t1 - self%accepted%time
    fixed = self%supports%held .or. self%port%prescribed
    mass = self%system%node_mass
    associate (s => self%state, old => self%accepted)
      s%time = t1
      s%u = old%u
      call self%impose(t1, s%u)
      call drift_half(dt, fixed, old, s, half)
      call self%check_finite(errors)
      if (errors%any()) return
      call self%external_at(t1, s%external)
      call self%follow(t1, s%u, s%external)
      call self%trial_force(s%u, internal)
      s%viscous = 0.0_wp
      if (self%damping%stiffness > 0.0_wp) then
        call multiply(self%system%pattern, self%system%k, half, s%viscous)
        s%viscous = self%damping%stiffness*s%viscous
      end if
      force = s%external - internal - s%viscous
      call kick_half(dt, fixed, mass, self%damping, force, half, old, s)
      s%reaction = merge(internal + s%viscous - s%external, 0.0_wp, fixed)
      where (fixed) s%reaction = s%reaction + s%a*spread(mass, 1, 3)
      s%tie = 0.0_wp
      call self%update_energy(internal)
      where (.not. self%dofs%halo%counts([(i, i=1, self%dofs%blocks)])) mass = 0.0_wp
      call explicit_kinetic(dt, fixed, mass, old, s, works(1), works(2), works(3))
      call self%dofs%halo%total(works)
      self%energy%kinetic = works(1)
      self%energy%support = self%energy%support - works(3)
      self%energy%numerical = self%energy%numerical + works(2)
      if (self%matter%active) call self%matter_energy()
      call self%matter_fault(errors)
    end associate
  end subroutine central_step

  !> One undamped step of central differences.
  subroutine quick_leap(self, t1, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: dt
    logical :: loaded

    dt = t1 - self%accepted%time
    if (self%dofs%halo%dealt .and. .not. allocated(self%leap_work%counted)) &
      self%leap_work%counted = self%dofs%halo%mine
    associate (s => self%state, old => self%accepted, work => self%leap_work)
      s%time = t1
      call drift_all(dt, self%supports%held, self%port%prescribed, self%port%given_u, old, s, work)
      call quick_motions(self, t1, dt)
      call self%external_at(t1, s%external)
      call self%follow(t1, s%u, s%external)
      call self%trial_force(s%u, work%internal)
      call kick_all(dt, self%system%node_mass, self%system%initial_force, &
        self%system%weight_force, old, s, work)
      call sum_over_ranks(self)
      loaded = any(abs(old%external) > 0.0_wp)
      call self%dofs%halo%anywhere(loaded)
      if (.not. is_finite(work%strain)) call self%check_finite(errors)
      call self%begin_energy()
      associate (e => self%energy)
        e%strain = work%strain
        e%load = e%load + work%load
        ! the first step from rest raises the weight from zero, as all loads
        e%gravity = e%gravity + merge(1.0_wp, 0.5_wp, loaded)*work%weight
        e%support = e%support + work%support
        e%kinetic = work%kinetic
        e%numerical = e%numerical + work%discrete
      end associate
      if (self%matter%active) call self%matter_energy()
      call self%matter_fault(errors)
    end associate
  end subroutine quick_leap

  !> The sums of a step over the blocks of all ranks.
  subroutine sum_over_ranks(self)
    type(fem_body_type), intent(inout) :: self
    real(wp) :: sums(6)
    if (.not. self%dofs%halo%dealt) return
    associate (work => self%leap_work)
      sums = [work%strain, work%load, work%weight, work%support, work%kinetic, work%discrete]
      call self%dofs%halo%total(sums)
      work%strain = sums(1)
      work%load = sums(2)
      work%weight = sums(3)
      work%support = sums(4)
      work%kinetic = sums(5)
      work%discrete = sums(6)
    end associate
  end subroutine sum_over_ranks

  !> Displacements at t1 of the motions of the deck and of rigid groups, and their velocities in the
  !! step.
  subroutine quick_motions(self, t1, dt)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1, dt  !! [s]
    integer(i4) :: k
    associate (s => self%state, old => self%accepted, work => self%leap_work)
      do k = 1, size(self%supports%motion)
        associate (m => self%supports%motion(k))
          s%u(m%component, m%block) = m%scale*self%loads%curve(m%curve)%at(t1)
          work%half(m%component, m%block) = (s%u(m%component, m%block) &
                                             - old%u(m%component, m%block))/dt
        end associate
      end do
      if (.not. allocated(self%supports%rigid)) return
      call self%impose(t1, s%u)
      do k = 1, size(self%supports%rigid)
        associate (node => self%supports%rigid(k)%node)
          work%half(:, node) = (s%u(:, node) - old%u(:, node))/dt
        end associate
      end do
    end associate
  end subroutine quick_motions

  !> Ledger of an explicit state with lumped mass; loads by what moved since the accepted state.
  subroutine explicit_energy(self, internal)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: internal(:, :)  !! forces of the state [N], [N m]
    integer(i4) :: i
    self%state%tie = 0.0_wp
    self%state%reaction = merge(internal - self%state%external, 0.0_wp, &
                                self%supports%held .or. self%port%prescribed)
    call self%update_energy(internal)
    if (self%matter%active) call self%matter_energy()
    self%energy%kinetic = 0.0_wp
    do i = 1, self%dofs%blocks
      self%energy%kinetic = self%energy%kinetic &
        + 0.5_wp*self%system%node_mass(i)*sum(self%state%v(:, i)**2)
    end do
  end subroutine explicit_energy
end module fem_central
