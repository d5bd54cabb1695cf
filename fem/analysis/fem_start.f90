!> The start of a dynamic run: initial velocities and displacements, accelerations and reactions in
!! balance with the loads, and the initial energy of the body.
module fem_start
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use fem_body, only: fem_body_type
  use fem_pore_motion, only: add_lacking, lacking_inertia
  use fem_sparse, only: multiply_mass
  implicit none
  private
  public :: start_motion

contains

  !> Start from the velocities and displacements of the deck (zero where held), with accelerations
  !! and reactions in balance with the loads there: M a = f - K u - C v.
  subroutine start_motion(self, errors)
    type(fem_body_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, self%dofs%blocks) :: internal, residual, mass, momentum
    logical :: fixed(3, self%dofs%blocks)

    fixed = self%supports%held .or. self%port%prescribed
    associate (s => self%state)
      where (fixed) s%v = 0.0_wp
      call self%external_at(s%time, s%external)
      call self%follow(s%time, s%u, s%external)
      call self%trial_force(s%u, internal)
      call self%matter_fault(errors)
      if (errors%any()) return
      call self%viscous_force(s%v, s%viscous)
      residual = s%external - internal - s%viscous
      if (self%scheme%explicit) then
        mass = spread(self%system%node_mass, 1, 3)
        s%a = merge(0.0_wp, residual/mass, fixed)
        s%reaction = merge(-residual, 0.0_wp, fixed)
        momentum = mass*s%v
      else
        if (maxval(abs(residual)) > 0.0_wp) call consistent_start(self, fixed, residual, errors)
        if (errors%any()) return
        call multiply_mass(self%system%pattern, self%system%mass, s%v, momentum)
        momentum = momentum + lacking_inertia(self, s%u, s%v)
      end if
      self%energy%kinetic = 0.5_wp*self%dofs%halo%total_of(s%v*momentum)
    end associate
    call store_strain(self, internal)
    self%energy%start = self%energy%kinetic + self%energy%strain + self%energy%plastic &
      + self%energy%numerical
    self%accepted = self%state
    call self%energy%keep_largest()
    self%accepted_energy = self%energy
  end subroutine start_motion

  !> Energy and state of the strain of initial displacements; without them nothing is strained yet.
  subroutine store_strain(self, internal)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: internal(:, :)  !! [N]
    real(wp) :: most
    most = maxval(abs(self%state%u))
    call self%dofs%halo%highest(most)
    if (.not. most > 0.0_wp) return
    if (self%matter%active) then
      call self%matter_energy()
      call self%matter%accept()
    else
      self%energy%strain = 0.5_wp*self%dofs%halo%total_of(self%state%u &
        *(internal + self%system%initial_force))
    end if
  end subroutine store_strain

  !> Accelerations and reactions by factors of the consistent mass; the analysis of the pattern
  !! serves the steps too.
  subroutine consistent_start(self, fixed, residual, errors)
    type(fem_body_type), intent(inout) :: self
    logical, intent(in) :: fixed(:, :)
    real(wp), intent(in) :: residual(:, :)  !! [N, N m]
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: none(:, :, :), below(:, :, :)
    real(wp) :: inertia(3, self%dofs%blocks)

    call self%hold_pressures(.true.)  ! which have no mass
    call self%number(errors)
    if (errors%any()) return
    allocate (none(3, 3, size(self%system%mass)), source=0.0_wp)
    allocate (below, source=none)
    call add_lacking(self, 1.0_wp, none, below)
    call self%system%solver%factor(self%system%pattern, none, self%system%mass, 1.0_wp, errors, &
      below)
    call self%system%forget_factors()
    if (errors%any()) return
    call self%system%solver%solve(self%system%pattern, residual, self%state%a, errors)
    call self%hold_pressures(.false.)
    if (errors%any()) return
    call multiply_mass(self%system%pattern, self%system%mass, self%state%a, inertia)
    inertia = inertia + lacking_inertia(self, self%state%u, self%state%a)
    self%state%reaction = merge(inertia - residual, 0.0_wp, fixed)
  end subroutine consistent_start
end module fem_start
