!> The micromorphic solid at a point: from the motions at both ends of a step and the state at its
!! start to state, stresses and forces at its end (theory: micromorphic plasticity). Where the
!! return fails the step is halved inside, down to 1/1024 of it.
module fem_mm_plastic
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use fem_mm_cones, only: surfaces, surface_name, open_yield, stress_slice
  use fem_mm_elastic, only: mm_strain_type, mm_stress_type, mm_dual_type
  use fem_mm_elastic, only: duals, stresses, duals_from_stress
  use fem_mm_flow, only: mm_law_type, mm_state_type, mm_old_type, mm_iterate_type, evaluate
  use fem_mm_flow, only: start_step, energy_of
  use fem_mm_motion, only: mm_motion_type, mm_force_type, strains, forces, elastic_tangent
  use fem_mm_return, only: mm_system_type, return_to_surfaces
  use fem_mm_tangent, only: mm_memory_type, forget, carry, force_tangent
  use fem_mm_tensor, only: identity, inverse, leg_one, leg_two, leg_three
  implicit none
  private
  public :: mm_point_type, update_point, failure_text

  real(wp), parameter :: least_share = 1.0_wp/1024.0_wp  !! of a step, before it fails

  !> A point at the end of a step, with diagnostics.
  type :: mm_point_type
    type(mm_state_type) :: state
    type(mm_stress_type) :: stress            !! S, Sigma, M in the reference configuration
    type(mm_force_type) :: force
    real(wp) :: stored = 0.0_wp               !! energy per reference volume [J/m^3]
    real(wp) :: gamma(surfaces) = 0.0_wp      !! multipliers of the (whole) step
    real(wp) :: yield(surfaces) = -1.0_wp     !! yield functions at the end
    real(wp) :: cap(2) = 0.0_wp               !! p_c of the ellipses [Pa]
    real(wp) :: breakage = 0.0_wp, energy_b = 0.0_wp  !! B, E_B [J/m^3]
    logical :: active(surfaces) = .false.     !! surfaces that yielded
    logical :: done = .true.                  !! else the fields are those of the last iterate
    integer(i4) :: substeps = 0, iterations = 0
  end type mm_point_type

contains

  !> Update from motion(1) with state `before` to motion(2); the tangent (45, 45) is that of the
  !! forces by the motion at the end, of all substeps together.
  subroutine update_point(law, motion, before, point, tangent)
    type(mm_law_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion(2)
    type(mm_state_type), intent(in) :: before
    type(mm_point_type), intent(out) :: point
    real(wp), intent(out), optional :: tangent(45, 45)
    type(mm_iterate_type) :: at
    type(mm_old_type) :: old
    type(mm_system_type) :: system
    type(mm_memory_type) :: memory
    type(mm_motion_type) :: here, there
    real(wp) :: now, share

    old%state = before
    now = 0.0_wp
    share = 1.0_wp/law%parts
    here = motion(1)
    if (present(tangent)) call forget(memory)
    do while (now < 1.0_wp - 0.5_wp*least_share/law%parts)
      there = between(motion, now + share)
      call step_point(law, [here, there], share == 1.0_wp, old, at, system, point)
      if (.not. point%done) then
        share = 0.5_wp*share
        if (share < least_share/law%parts) exit
        cycle
      end if
      now = now + share
      if (present(tangent)) call carry(law, there, now, old, at, system, memory)
      old%state = at%state
      here = there
      share = min(2.0_wp*share, 1.0_wp/law%parts, 1.0_wp - now)
    end do
    call finish_point(law, motion(2), at, point)
    if (.not. (point%done .and. present(tangent))) return
    if (untouched(at%state)) then
      call elastic_tangent(at%elastic, motion(2), point%force, tangent)
    else
      call force_tangent(law, motion(2), at, memory, tangent)
    end if
  end subroutine update_point

  !> The motion on the straight way, a share of it.
  pure function between(motion, share) result(there)
    type(mm_motion_type), intent(in) :: motion(2)
    real(wp), intent(in) :: share
    type(mm_motion_type) :: there
    there = motion(2)
    if (share == 1.0_wp) return
    there%f = motion(1)%f + share*(motion(2)%f - motion(1)%f)
    there%chi = motion(1)%chi + share*(motion(2)%chi - motion(1)%chi)
    there%g = motion(1)%g + share*(motion(2)%g - motion(1)%g)
  end function between

  !> One (sub)step: trial state and return. Substeps are backward Euler.
  subroutine step_point(law, motion, whole, old, at, system, point)
    type(mm_law_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion(2)
    logical, intent(in) :: whole
    type(mm_old_type), intent(inout) :: old
    type(mm_iterate_type), intent(inout) :: at
    type(mm_system_type), intent(inout) :: system
    type(mm_point_type), intent(inout) :: point
    type(mm_strain_type) :: total
    integer(i4) :: k

    at%state = old%state
    at%gamma = 0.0_wp
    at%active = .false.
    old%theta = 1.0_wp
    if (whole .and. law%trapezoidal .and. old%state%yielded) then
      call evaluate(law, strains(motion(1)), old, at)
      call start_step(law, at, old)
    end if
    total = strains(motion(2))
    call evaluate(law, total, old, at)
    call return_to_surfaces(law, total, old, at, system, point%done)
    point%iterations = point%iterations + system%iterations
    if (.not. point%done) then
      point%active = at%active
      return
    end if
    point%substeps = point%substeps + 1
    at%state%yielded = any(at%active)
    do k = 1, surfaces
      if (.not. at%active(k)) cycle
      at%state%dissipated = at%state%dissipated + at%volume*at%gamma(k) &
        *sum(at%surface(k)%flow*stress_slice(at%stress, k))
      if (k == 1 .and. law%breaks) at%state%dissipated = at%state%dissipated &
        + at%volume*at%gamma(1)*at%energy_b*at%b_slope
      point%gamma(k) = point%gamma(k) + at%gamma(k)
    end do
    if (any(at%active(:2))) at%state%shifted = at%state%shifted + shift_of(at)
  end subroutine step_point

  !> Work [J/m^3] of the stored energy on the plastic change of volume and of the gradient's last
  !! index: energy of a step beside the stored and dissipated one.
  pure real(wp) function shift_of(at)
    type(mm_iterate_type), intent(in) :: at
    real(wp) :: l(3, 3)
    integer(i4) :: c, r
    l = at%gamma(1)*at%f_unit(:, :, 1) + at%gamma(2)*at%f_unit(:, :, 2)
    shift_of = -energy_of(at%strain, at%dual)*(l(1, 1) + l(2, 2) + l(3, 3))
    do r = 1, 3
      do c = 1, 3
        shift_of = shift_of + l(c, r)*sum(at%dual%g(:, :, r)*at%strain%gamma(:, :, c))
      end do
    end do
    shift_of = at%volume*shift_of
  end function shift_of

  !> Stresses of the reference configuration and forces at the end.
  pure subroutine finish_point(law, motion, at, point)
    type(mm_law_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion
    type(mm_iterate_type), intent(in) :: at
    type(mm_point_type), intent(inout) :: point
    type(mm_strain_type) :: total
    type(mm_dual_type) :: dual
    real(wp) :: a(3, 3)

    point%state = at%state
    point%yield = at%yield
    point%cap = at%cap
    if (law%breaks) then
      point%breakage = at%state%z(1)
      point%energy_b = at%energy_b
    end if
    if (point%done) point%active = at%active
    a = at%inverse_fp
    point%stress%s = at%volume*matmul(a, matmul(at%stress%s, transpose(a)))
    point%stress%sigma = at%volume*matmul(a, matmul(at%stress%sigma, transpose(a)))
    point%stress%m = at%volume*leg_three(at%inverse_xp, leg_two(a, leg_one(a, at%stress%m)))
    point%stored = at%volume*energy_of(at%strain, at%dual)
    total = strains(motion)
    dual = duals_from_stress(total, point%stress)
    point%force = forces(motion, dual)
  end subroutine finish_point

  !> No plastic part has moved yet.
  pure logical function untouched(state)
    type(mm_state_type), intent(in) :: state
    untouched = all(state%fp == identity) .and. all(state%xp == identity) &
      .and. all(state%gp == 0.0_wp)
  end function untouched

  !> What failed, for a message: the surfaces that were active and their values.
  pure function failure_text(point) result(text)
    type(mm_point_type), intent(in) :: point
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = ''
    do k = 1, surfaces
      if (.not. point%active(k)) cycle
      if (len(text) > 0) text = text//', '
      if (point%yield(k) < open_yield) then
        text = text//trim(surface_name(k))//' (f = '//str(point%yield(k))//')'
      else
        text = text//trim(surface_name(k))//' (breakage has no surface in tension)'
      end if
    end do
    if (len(text) == 0) text = 'none'
    text = 'the return to the yield surfaces failed in 1/1024 of the step; active: '//text
  end function failure_text
end module fem_mm_plastic
