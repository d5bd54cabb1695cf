!> Consistent tangent of the plastic micromorphic point: derivatives of the plastic parts by the
!! motion at the end of the step, carried from substep to substep, and of the forces.
!! With R(X, D, X_old) = 0,  dX = -(dR/dX)^-1 (dR/dD dD + dR/dX_old dX_old).
module fem_mm_tangent
  use talus_kinds, only: wp, i4
  use fem_mm_cones, only: surfaces, cohesion_slope
  use fem_mm_elastic, only: mm_strain_type, mm_dual_type, mm_stress_type, mm_strain_d_type
  use fem_mm_elastic, only: mm_dual_d_type, mm_stress_d_type, duals_from_stress
  use fem_mm_elastic, only: duals_from_stress_of, stresses_of
  use fem_mm_flow, only: mm_law_type, mm_old_type, mm_iterate_type, mm_change_type
  use fem_mm_flow, only: mm_residual_d_type, residual_of, change_strains, stress_by_breakage
  use fem_mm_motion, only: mm_motion_type, mm_motion_d_type, strains, strains_of, seed, forces_of
  use fem_mm_return, only: mm_system_type, set_unknowns, factor_system, back_substitute
  use fem_mm_return, only: pack_change, unpack_rows, yield_scale
  use fem_mm_tensor, only: lanes, leg_one, leg_two, leg_three, left, right, turned, leg_one_of
  use fem_mm_tensor, only: leg_two_of, leg_three_of, leg_one_by, leg_two_by, leg_three_by
  implicit none
  private
  public :: mm_memory_type, forget, carry, force_tangent

  integer(i4), parameter :: blocks = 48/lanes, most = 45 + surfaces

  !> Derivatives of the state by the 45 components of the motion at the end of the whole step.
  type :: mm_memory_type
    logical :: empty = .true.
    real(wp) :: f(lanes, 3, 3, blocks), x(lanes, 3, 3, blocks), g(lanes, 3, 3, 3, blocks)
    real(wp) :: z(lanes, surfaces, blocks)
  end type mm_memory_type

contains

  pure subroutine forget(memory)
    type(mm_memory_type), intent(inout) :: memory
    memory%empty = .true.
    memory%f = 0.0_wp
    memory%x = 0.0_wp
    memory%g = 0.0_wp
    memory%z = 0.0_wp
  end subroutine forget

  !> Derivatives at the end of a substep, which is at the share `now` of the whole step, from those
  !! at its start (backward Euler, unless it is the first).
  subroutine carry(law, motion, now, old, at, system, memory)
    type(mm_law_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion
    real(wp), intent(in) :: now
    type(mm_old_type), intent(in) :: old
    type(mm_iterate_type), intent(in) :: at
    type(mm_system_type), intent(inout) :: system
    type(mm_memory_type), intent(inout) :: memory
    type(mm_change_type) :: change
    type(mm_strain_d_type) :: d
    real(wp) :: rows(most, lanes), b(most, lanes*blocks)
    integer(i4) :: i

    if (.not. any(at%active)) return
    call set_unknowns(law, at%active, yield_scale(law, at), .not. memory%empty, system)
    call factor_system(law, at, old, system)
    do i = 1, blocks
      call elastic_change(motion, now, at, i, d)
      call right_side(law, at, old, d, memory, i, system, rows)
      b(:, (i - 1)*lanes + 1:i*lanes) = -rows
    end do
    call back_substitute(system, lanes*blocks, b)
    do i = 1, blocks
      call pack_change(system, b(:, (i - 1)*lanes + 1:i*lanes), change)
      call remember(law, at, system, change, b(:, (i - 1)*lanes + 1:i*lanes), i, memory)
    end do
    memory%empty = .false.
  end subroutine carry

  !> Derivatives of the elastic strains by the motion, at fixed plastic parts.
  pure subroutine elastic_change(motion, share, at, i, d)
    type(mm_motion_type), intent(in) :: motion
    real(wp), intent(in) :: share
    type(mm_iterate_type), intent(in) :: at
    integer(i4), intent(in) :: i
    type(mm_strain_d_type), intent(out) :: d
    type(mm_motion_d_type) :: moved
    type(mm_strain_d_type) :: total
    real(wp) :: a(lanes, 3, 3), g(lanes, 3, 3, 3), t(3, 3)

    call seed((i - 1)*lanes + 1, moved)
    moved%f = share*moved%f
    moved%chi = share*moved%chi
    moved%g = share*moved%g
    call strains_of(motion, moved, total)
    t = transpose(at%inverse_fp)
    call left(t, total%c, a)
    call right(a, at%inverse_fp, d%c)
    call left(t, total%psi, a)
    call right(a, at%inverse_xp, d%psi)
    call leg_one_of(t, total%gamma, g)
    call leg_two_of(transpose(at%inverse_xp), g, total%gamma)
    call leg_three_of(t, total%gamma, d%gamma)
    call leg_one_by(-1.0_wp, d%psi, at%gp, d%gamma)
  end subroutine elastic_change

  !> dR/dD dD + dR/dX_old dX_old.
  pure subroutine right_side(law, at, old, d, memory, i, system, rows)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_old_type), intent(in) :: old
    type(mm_strain_d_type), intent(in) :: d
    type(mm_memory_type), intent(in) :: memory
    integer(i4), intent(in) :: i
    type(mm_system_type), intent(in) :: system
    real(wp), intent(out) :: rows(most, lanes)
    type(mm_change_type) :: none, moved
    type(mm_residual_d_type) :: r
    integer(i4) :: k

    none%w = 0.0_wp
    none%x = 0.0_wp
    none%y = 0.0_wp
    if (law%breaks) none%b = at%b_keep*memory%z(:, 1, i)
    call residual_of(law, at, old, none, d, r)
    if (.not. memory%empty) then
      call in_frame(at, memory, i, moved)
      r%f = r%f - at%kf*moved%w
      r%x = r%x - at%kx*moved%x
      r%g = r%g - at%kx*moved%y
      do k = 1, surfaces
        r%yield(:, k) = r%yield(:, k) &
          - law%cone(k)%a*cohesion_slope(law%cone(k), at%state%z(k))*memory%z(:, k, i)
      end do
    end if
    call unpack_rows(system, r, rows)
  end subroutine right_side

  !> Derivatives of the plastic parts in the intermediate configuration.
  pure subroutine in_frame(at, memory, i, change)
    type(mm_iterate_type), intent(in) :: at
    type(mm_memory_type), intent(in) :: memory
    integer(i4), intent(in) :: i
    type(mm_change_type), intent(out) :: change
    real(wp) :: g(lanes, 3, 3, 3)
    call right(memory%f(:, :, :, i), at%inverse_fp, change%w)
    call right(memory%x(:, :, :, i), at%inverse_xp, change%x)
    call leg_two_of(transpose(at%inverse_xp), memory%g(:, :, :, :, i), g)
    call leg_three_of(transpose(at%inverse_fp), g, change%y)
  end subroutine in_frame

  !> Keep the derivatives of a solution.
  pure subroutine remember(law, at, system, change, columns, i, memory)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_system_type), intent(in) :: system
    type(mm_change_type), intent(in) :: change
    real(wp), intent(in) :: columns(most, lanes)
    integer(i4), intent(in) :: i
    type(mm_memory_type), intent(inout) :: memory
    real(wp) :: g(lanes, 3, 3, 3)
    integer(i4) :: k, s
    call right(change%w, at%state%fp, memory%f(:, :, :, i))
    call right(change%x, at%state%xp, memory%x(:, :, :, i))
    call leg_two_of(transpose(at%state%xp), change%y, g)
    call leg_three_of(transpose(at%state%fp), g, memory%g(:, :, :, :, i))
    if (law%breaks) memory%z(:, 1, i) = at%b_keep*memory%z(:, 1, i)
    do k = system%parts + 1, system%n
      s = system%surface(k - system%parts)
      if (law%breaks .and. s == 1) memory%z(:, 1, i) = memory%z(:, 1, i) + at%b_slope*columns(k, :)
      memory%z(:, s, i) = memory%z(:, s, i) + law%cone(s)%a_flow*columns(k, :)
    end do
  end subroutine remember

  !> Derivatives of the forces by the motion.
  pure subroutine force_tangent(law, motion, at, memory, tangent)
    type(mm_law_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion
    type(mm_iterate_type), intent(in) :: at
    type(mm_memory_type), intent(in) :: memory
    real(wp), intent(out) :: tangent(45, 45)
    type(mm_strain_type) :: total
    type(mm_stress_type) :: stress
    type(mm_dual_type) :: dual
    type(mm_motion_d_type) :: moved
    type(mm_change_type) :: change
    type(mm_strain_d_type) :: d, d_total
    type(mm_stress_d_type) :: d_stress
    type(mm_dual_d_type) :: d_dual
    real(wp) :: column(45, lanes), a(3, 3)
    integer(i4) :: i, first, last

    a = at%inverse_fp
    stress%s = at%volume*matmul(a, matmul(at%stress%s, transpose(a)))
    stress%sigma = at%volume*matmul(a, matmul(at%stress%sigma, transpose(a)))
    stress%m = at%volume*leg_three(at%inverse_xp, leg_two(a, leg_one(a, at%stress%m)))
    total = strains(motion)
    dual = duals_from_stress(total, stress)
    do i = 1, blocks
      first = (i - 1)*lanes + 1
      last = min(first + lanes - 1, 45)
      call elastic_change(motion, 1.0_wp, at, i, d)
      call in_frame(at, memory, i, change)
      call change_strains(at, change, d)
      call stresses_of(at%elastic, at%strain, at%dual, at%stress, at%inverse_c, d, d_stress)
      if (law%breaks) call stress_by_breakage(at, memory%z(:, 1, i), d_stress)
      call to_reference(at, change, d_stress)
      call seed(first, moved)
      call strains_of(motion, moved, d_total)
      call duals_from_stress_of(total, stress, dual, d_total, d_stress, d_dual)
      call forces_of(motion, dual, moved, d_dual, column)
      tangent(:, first:last) = column(:, :last - first + 1)
    end do
  end subroutine force_tangent

  !> Derivatives of stresses from the intermediate to the reference configuration.
  pure subroutine to_reference(at, change, d)
    type(mm_iterate_type), intent(in) :: at
    type(mm_change_type), intent(in) :: change
    type(mm_stress_d_type), intent(inout) :: d
    real(wp), dimension(lanes, 3, 3) :: w_turned, x_turned
    real(wp) :: g(lanes, 3, 3, 3), trace(lanes)
    integer(i4) :: i, j, k

    trace = change%w(:, 1, 1) + change%w(:, 2, 2) + change%w(:, 3, 3)
    call turned(change%w, w_turned)
    call turned(change%x, x_turned)
    call turn_back(at, at%stress%s, change%w, w_turned, trace, d%s)
    call turn_back(at, at%stress%sigma, change%w, w_turned, trace, d%sigma)
    do k = 1, 3
      do j = 1, 3
        do i = 1, 3
          d%m(:, i, j, k) = d%m(:, i, j, k) + trace*at%stress%m(i, j, k)
        end do
      end do
    end do
    call leg_one_by(-1.0_wp, change%w, at%stress%m, d%m)
    call leg_two_by(-1.0_wp, w_turned, at%stress%m, d%m)
    call leg_three_by(-1.0_wp, x_turned, at%stress%m, d%m)
    d%m = at%volume*d%m
    call leg_one_of(at%inverse_fp, d%m, g)
    call leg_two_of(at%inverse_fp, g, d%m)
    call leg_three_of(at%inverse_xp, d%m, g)
    d%m = g
  end subroutine to_reference

  !> Derivative of det(Fp) Fp^-1 s Fp^-T.
  pure subroutine turn_back(at, s, w, w_turned, trace, d)
    type(mm_iterate_type), intent(in) :: at
    real(wp), intent(in) :: s(3, 3), w(lanes, 3, 3), w_turned(lanes, 3, 3), trace(lanes)
    real(wp), intent(inout) :: d(lanes, 3, 3)
    real(wp), dimension(lanes, 3, 3) :: a, b
    integer(i4) :: i, j
    call right(w, s, a)
    call left(s, w_turned, b)
    do j = 1, 3
      do i = 1, 3
        d(:, i, j) = at%volume*(d(:, i, j) + trace*s(i, j) - a(:, i, j) - b(:, i, j))
      end do
    end do
    call left(at%inverse_fp, d, a)
    call right(a, transpose(at%inverse_fp), d)
  end subroutine turn_back
end module fem_mm_tangent
