!> Plastic flow of the micromorphic solid (Regueiro 2009, 2010; theory: micromorphic plasticity):
!! the residual of one step and its derivatives.
!!
!! Unknowns are the plastic parts of F, chi and grad chi and a multiplier for each active surface.
!! Their changes are in the intermediate configuration,
!!   dFp = w Fp,  dchi_p = x chi_p,  dchi_p,jIJ = y_jAB chi_p,AI Fp_BJ,
!! in which the elastic strains move by -Cw - (Cw)^T, -w^T Psi - Psi x, and so on, and the residuals
!! are multiplied from the right by Fp^-1 and chi_p^-1.
!! eq. F.14
module fem_mm_flow
  use talus_kinds, only: wp, i4
  use fem_mm_caps, only: breakage_after
  use fem_mm_cones, only: mm_cone_type, mm_surface_type, mm_place_type, mm_turn_type, surfaces
  use fem_mm_cones, only: kind_ellipse, stress_slice, cohesion
  use fem_mm_elastic, only: mm_elastic_type, mm_strain_type, mm_dual_type, mm_stress_type
  use fem_mm_elastic, only: mm_strain_d_type, mm_stress_d_type, duals, stresses, stresses_of
  use fem_mm_elastic, only: weakened
  use fem_mm_surfaces, only: surface_at, turn_surface
  use fem_mm_tensor, only: lanes, identity, inverse, determinant, leg_one, leg_two, leg_three
  use fem_mm_tensor, only: left, right, turned, leg_one_of, leg_two_of, leg_one_by, leg_two_by
  use fem_mm_tensor, only: leg_three_by
  implicit none
  private
  public :: mm_law_type, mm_state_type, mm_old_type, mm_iterate_type, mm_change_type
  public :: mm_residual_d_type
  public :: pulled, evaluate, start_step, residual_of, change_strains, unit_columns
  public :: energy_of, stress_by_breakage

  !> A micromorphic solid with friction.
  type :: mm_law_type
    type(mm_elastic_type) :: elastic
    type(mm_cone_type) :: cone(surfaces)
    logical :: plastic = .false.      !! any surface is on
    logical :: breaks = .false.       !! the macro-surface is that of breakage
    type(mm_elastic_type) :: fall     !! derivative of the moduli by the breakage
    real(wp) :: theta(3) = 0.0_wp     !! of strains, gradients, micro-inertia
    logical :: trapezoidal = .false.  !! second order in the step where both ends yield
    logical :: exact_volume = .false. !! det Fp and det chi_p follow the flow exactly
    integer(i4) :: parts = 1          !! equal parts of a step, each of them one of its own
    real(wp) :: length = 1.0_wp       !! that makes gradients comparable to strains [m]
    real(wp) :: modulus = 0.0_wp      !! largest of the strains [Pa]: rounding of stresses
  end type mm_law_type

  !> State of a point.
  type :: mm_state_type
    real(wp) :: fp(3, 3) = identity, xp(3, 3) = identity  !! plastic parts of F and chi [-]
    real(wp) :: gp(3, 3, 3) = 0.0_wp                       !! plastic part of grad chi [1/m]
    !> hardening variables; of an ellipse ln det of the plastic part at the start, of breakage B
    real(wp) :: z(surfaces) = 0.0_wp
    real(wp) :: dissipated = 0.0_wp                        !! per reference volume [J/m^3]
    real(wp) :: shifted = 0.0_wp                           !! work of stored energy on the flow
    logical :: yielded = .false.                           !! at the last step
  end type mm_state_type

  !> Start of a step: its state, and what a unit of each multiplier adds explicitly.
  type :: mm_old_type
    type(mm_state_type) :: state
    real(wp) :: theta = 1.0_wp  !! share of the end of the step in the flow
    real(wp) :: f(3, 3, surfaces) = 0.0_wp, x(3, 3, surfaces) = 0.0_wp
    real(wp) :: g(3, 3, 3, surfaces) = 0.0_wp
  end type mm_old_type

  !> Everything at one iterate.
  type :: mm_iterate_type
    type(mm_state_type) :: state
    real(wp) :: gamma(surfaces) = 0.0_wp
    logical :: active(surfaces) = .false.
    real(wp) :: inverse_fp(3, 3), inverse_xp(3, 3), volume  !! volume: det Fp
    real(wp) :: gp(3, 3, 3)                     !! gp chi_p^-1 Fp^-1
    type(mm_elastic_type) :: elastic            !! moduli with the breakage there is
    type(mm_strain_type) :: strain              !! elastic
    type(mm_dual_type) :: dual
    type(mm_stress_type) :: stress              !! in the intermediate configuration
    real(wp), dimension(3, 3) :: inverse_c, inverse_psi
    real(wp) :: x(3, 3, 3)                      !! Psi^-1 Gamma
    type(mm_surface_type) :: surface(surfaces)
    real(wp) :: yield(surfaces)                 !! yield functions
    real(wp) :: cap(2) = 0.0_wp                 !! p_c of ellipses [Pa]
    real(wp) :: pressure = 0.0_wp               !! of the macro-stress [Pa]
    real(wp) :: energy_b = 0.0_wp               !! E_B [J/m^3]
    real(wp) :: b_slope = 0.0_wp, b_keep = 1.0_wp  !! slopes of B by the multiplier and B before
    type(mm_dual_type) :: fall                  !! derivatives of dual and stress by B
    type(mm_stress_type) :: fallen
    real(wp) :: f_unit(3, 3, surfaces), x_unit(3, 3), g_unit(3, 3, 3, surfaces)
    real(wp) :: lf(3, 3), lx(3, 3), lg(3, 3, 3)  !! theta times plastic gradients of the step
    real(wp) :: kf = 1.0_wp, kx = 1.0_wp         !! factors of the explicit part
    real(wp), dimension(3, 3) :: drift_f, drift_x !! derivatives of their logarithms by lf, lx
    real(wp) :: yf(3, 3), yx(3, 3), yg(3, 3, 3)  !! the explicit part, factors included
    real(wp) :: rf(3, 3), rx(3, 3), rg(3, 3, 3)  !! residuals
  end type mm_iterate_type

  !> Changes of the unknowns.
  type :: mm_change_type
    real(wp) :: w(lanes, 3, 3), x(lanes, 3, 3), y(lanes, 3, 3, 3)
    real(wp) :: b(lanes) = 0.0_wp  !! of the breakage
  end type mm_change_type

  !> Derivatives of residuals, yield functions and stress.
  type :: mm_residual_d_type
    real(wp) :: f(lanes, 3, 3), x(lanes, 3, 3), g(lanes, 3, 3, 3)
    real(wp) :: yield(lanes, surfaces)
    type(mm_stress_d_type) :: stress
  end type mm_residual_d_type

contains

  !> Elastic strains of total ones: F^e = F Fp^-1, chi^e = chi chi_p^-1,
  !! chi^e_iA,B = (chi_iI,J - chi^e_ij chi_p,jI,J) chi_p^-1_IA Fp^-1_JB.
  pure function pulled(total, at) result(strain)
    type(mm_strain_type), intent(in) :: total
    type(mm_iterate_type), intent(in) :: at
    type(mm_strain_type) :: strain
    real(wp) :: t(3, 3), x(3, 3)
    t = transpose(at%inverse_fp)
    x = transpose(at%inverse_xp)
    strain%c = matmul(t, matmul(total%c, at%inverse_fp))
    strain%psi = matmul(t, matmul(total%psi, at%inverse_xp))
    strain%gamma = leg_three(t, leg_two(x, leg_one(t, total%gamma))) - leg_one(strain%psi, at%gp)
  end function pulled

  !> All at the state and multipliers of `at`, for total strains; the yield of surfaces that are
  !! off is negative.
  pure subroutine evaluate(law, total, old, at)
    type(mm_law_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: total
    type(mm_old_type), intent(in) :: old
    type(mm_iterate_type), intent(inout) :: at
    integer(i4) :: k

    at%inverse_fp = inverse(at%state%fp)
    at%inverse_xp = inverse(at%state%xp)
    at%volume = determinant(at%state%fp)
    at%gp = back(at, at%state%gp)
    at%strain = pulled(total, at)
    at%inverse_c = inverse(at%strain%c)
    at%state%z = old%state%z + law%cone%a_flow*at%gamma
    at%elastic = law%elastic
    if (law%breaks) call break_grains(law, old, at)
    at%dual = duals(at%elastic, at%strain)
    at%stress = stresses(at%elastic, at%strain, at%dual)
    at%pressure = sum(at%strain%c*at%stress%s)/3.0_wp
    if (any(law%cone(:2)%kind == kind_ellipse)) &
      at%cap = law%cone(:2)%cap*exp(-law%cone(:2)%exponent &
                  *(log([at%volume, determinant(at%state%xp)]) - at%state%z(:2)))
    at%yield = -1.0_wp
    do k = 1, surfaces
      if (.not. law%cone(k)%on) cycle
      at%surface(k) = surface_at(law%cone(k), place_of(law, at, k))
      at%yield(k) = at%surface(k)%yield
    end do
    if (any(at%active)) then
      call units(law, at)
      call residuals(law, old, at)
    end if
  end subroutine evaluate

  !> Breakage of the multiplier, the moduli it leaves, and derivatives by it.
  pure subroutine break_grains(law, old, at)
    type(mm_law_type), intent(in) :: law
    type(mm_old_type), intent(in) :: old
    type(mm_iterate_type), intent(inout) :: at
    call breakage_after(law%cone(1), old%state%z(1), at%gamma(1), at%state%z(1), at%b_slope, &
                        at%b_keep)
    at%elastic = weakened(law%elastic, at%state%z(1), law%fall)
    at%fall = duals(law%fall, at%strain)
    at%fallen = stresses(law%fall, at%strain, at%fall)
    at%energy_b = -energy_of(at%strain, at%fall)
  end subroutine break_grains

  !> Stored energy [J/m^3] of strains and its derivatives there.
  pure real(wp) function energy_of(strain, dual)
    type(mm_strain_type), intent(in) :: strain
    type(mm_dual_type), intent(in) :: dual
    energy_of = 0.5_wp*(0.5_wp*sum(dual%e*(strain%c - identity)) &
      + sum(dual%p*(strain%psi - identity)) + sum(dual%g*strain%gamma))
  end function energy_of

  !> Where surface k is looked at.
  pure function place_of(law, at, k) result(place)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    integer(i4), intent(in) :: k
    type(mm_place_type) :: place
    place%c = at%strain%c
    place%inverse_c = at%inverse_c
    place%stress = stress_slice(at%stress, k)
    place%strength = cohesion(law%cone(k), at%state%z(k))
    if (k < 3) place%cap = at%cap(k)
    place%pressure = at%pressure
    place%energy = at%energy_b
    if (k == 1 .and. law%breaks) place%breakage = at%state%z(1)
  end function place_of

  !> g_jIJ chi_p^-1_IA Fp^-1_JB.
  pure function back(at, g) result(h)
    type(mm_iterate_type), intent(in) :: at
    real(wp), intent(in) :: g(3, 3, 3)
    real(wp) :: h(3, 3, 3)
    h = leg_three(transpose(at%inverse_fp), leg_two(transpose(at%inverse_xp), g))
  end function back

  !> Plastic gradients for a unit of each multiplier.
  pure subroutine units(law, at)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(inout) :: at
    integer(i4) :: k
    at%f_unit = 0.0_wp
    at%x_unit = 0.0_wp
    at%g_unit = 0.0_wp
    at%inverse_psi = inverse(at%strain%psi)
    at%x = leg_one(at%inverse_psi, at%strain%gamma)
    do k = 1, 2
      at%f_unit(:, :, k) = matmul(at%inverse_c, transpose(at%surface(k)%flow))
    end do
    if (law%cone(2)%on) then
      at%x_unit = matmul(at%inverse_psi, matmul(matmul(transpose(at%surface(2)%flow), &
                                                       at%inverse_c), at%strain%psi))
      at%g_unit(:, :, :, 2) = leg_one(at%x_unit, at%x) - leg_two(transpose(at%x_unit), at%x)
    end if
    do k = 3, surfaces
      at%g_unit(:, k - 2, :, k) = matmul(at%inverse_psi, transpose(at%surface(k)%flow))
    end do
  end subroutine units

  !> R_F = 1 - theta L - Y_F, likewise for chi, (1 - theta L_chi) gp - theta L_grad - Y_G.
  pure subroutine residuals(law, old, at)
    type(mm_law_type), intent(in) :: law
    type(mm_old_type), intent(in) :: old
    type(mm_iterate_type), intent(inout) :: at
    real(wp) :: f(3, 3), x(3, 3), g(3, 3, 3)
    integer(i4) :: k

    at%lf = old%theta*(at%gamma(1)*at%f_unit(:, :, 1) + at%gamma(2)*at%f_unit(:, :, 2))
    at%lx = old%theta*at%gamma(2)*at%x_unit
    at%lg = 0.0_wp
    f = old%state%fp
    x = old%state%xp
    g = old%state%gp
    do k = 1, surfaces
      if (.not. at%active(k)) cycle
      at%lg = at%lg + old%theta*at%gamma(k)*at%g_unit(:, :, :, k)
      if (old%theta == 1.0_wp) cycle
      f = f + at%gamma(k)*old%f(:, :, k)
      x = x + at%gamma(k)*old%x(:, :, k)
      g = g + at%gamma(k)*old%g(:, :, :, k)
    end do
    if (law%exact_volume) then
      call keep_volume(at%lf, at%kf, at%drift_f)
      call keep_volume(at%lx, at%kx, at%drift_x)
    end if
    at%yf = at%kf*matmul(f, at%inverse_fp)
    at%yx = at%kx*matmul(x, at%inverse_xp)
    at%yg = at%kx*back(at, g)
    at%rf = identity - at%lf - at%yf
    at%rx = identity - at%lx - at%yx
    at%rg = at%gp - leg_one(at%lx, at%gp) - at%lg - at%yg
  end subroutine residuals

  !> k = [det(1 - l) exp(tr l)]^(1/3), with which (1 - l) F = k F_n changes the volume by
  !! exp(tr l), and the derivatives of ln k by l. eq. F.46
  pure subroutine keep_volume(l, k, drift)
    real(wp), intent(in) :: l(3, 3)
    real(wp), intent(out) :: k, drift(3, 3)
    real(wp) :: left_over(3, 3), det
    left_over = identity - l
    det = determinant(left_over)
    k = 0.0_wp
    drift = 0.0_wp
    if (.not. det > 0.0_wp) return  ! no step of the flow: the residual says so
    k = exp((log(det) + l(1, 1) + l(2, 2) + l(3, 3))/3.0_wp)
    drift = (identity - transpose(inverse(left_over)))/3.0_wp
  end subroutine keep_volume

  !> Start of a step from the state in `at`, evaluated with the strains of the start. The
  !! flow at the start counts only where the point yielded there: elsewhere it has no direction.
  pure subroutine start_step(law, at, old)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(inout) :: at
    type(mm_old_type), intent(inout) :: old
    real(wp) :: share
    integer(i4) :: k

    old%theta = 1.0_wp
    if (.not. (law%trapezoidal .and. old%state%yielded)) return
    old%theta = 0.5_wp
    share = 1.0_wp - old%theta
    call units(law, at)
    old%x = 0.0_wp
    old%x(:, :, 2) = share*matmul(at%x_unit, old%state%xp)
    do k = 1, surfaces
      old%f(:, :, k) = share*matmul(at%f_unit(:, :, k), old%state%fp)
      old%g(:, :, :, k) = share*leg_three(transpose(old%state%fp), &
        leg_two(transpose(old%state%xp), at%g_unit(:, :, :, k)))
      if (k == 2) old%g(:, :, :, k) = old%g(:, :, :, k) + share*leg_one(at%x_unit, old%state%gp)
    end do
  end subroutine start_step

  !> Derivatives of the residuals by the multiplier of surface k, packed as w, x, y (45).
  pure function unit_columns(law, at, old, k) result(column)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_old_type), intent(in) :: old
    integer(i4), intent(in) :: k
    real(wp) :: column(45)
    real(wp) :: f(3, 3), x(3, 3), g(3, 3, 3)
    f = old%theta*at%f_unit(:, :, k)
    x = 0.0_wp
    g = old%theta*at%g_unit(:, :, :, k)
    if (k == 2) then
      x = old%theta*at%x_unit
      g = g + leg_one(x, at%gp)
    end if
    if (law%exact_volume) then
      g = g + sum(at%drift_x*x)*at%yg
      f = f + sum(at%drift_f*f)*at%yf
      x = x + sum(at%drift_x*x)*at%yx
    end if
    if (old%theta < 1.0_wp) then
      f = f + matmul(old%f(:, :, k), at%inverse_fp)
      x = x + matmul(old%x(:, :, k), at%inverse_xp)
      g = g + back(at, old%g(:, :, :, k))
    end if
    column(:9) = -reshape(f, [9])
    column(10:18) = -reshape(x, [9])
    column(19:) = -reshape(g, [27])
  end function unit_columns

  !> Add to the derivatives of the elastic strains what changes of the unknowns do.
  pure subroutine change_strains(at, change, d)
    type(mm_iterate_type), intent(in) :: at
    type(mm_change_type), intent(in) :: change
    type(mm_strain_d_type), intent(inout) :: d
    real(wp), dimension(lanes, 3, 3) :: a, b, w_turned
    real(wp), dimension(lanes, 3, 3, 3) :: h, q

    call left(at%strain%c, change%w, a)
    call turned(a, b)
    d%c = d%c - a - b
    call turned(change%w, w_turned)
    call right(w_turned, at%strain%psi, a)
    call left(at%strain%psi, change%x, b)
    d%psi = d%psi - a - b
    h = -change%y
    call leg_one_by(1.0_wp, change%x, at%gp, h)
    call leg_one_of(at%strain%psi, h, q)
    d%gamma = d%gamma + q
    call leg_one_by(-1.0_wp, w_turned, at%strain%gamma, d%gamma)
    call leg_two_by(-1.0_wp, change%x, at%strain%gamma, d%gamma)
    call leg_three_by(-1.0_wp, change%w, at%strain%gamma, d%gamma)
  end subroutine change_strains

  !> Derivatives of the residuals along derivatives d of the elastic strains (which hold those by
  !! `change` already) and along the changes of the unknowns.
  pure subroutine residual_of(law, at, old, change, d, r)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_old_type), intent(in) :: old
    type(mm_change_type), intent(in) :: change
    type(mm_strain_d_type), intent(in) :: d
    type(mm_residual_d_type), intent(out) :: r
    real(wp), dimension(lanes, 3, 3, 3) :: dg, moved

    call stresses_of(at%elastic, at%strain, at%dual, at%stress, at%inverse_c, d, r%stress)
    if (law%breaks) call stress_by_breakage(at, change%b, r%stress)
    call flow_of(law, at, old%theta, change, d, r)
    call right_by_left(at%yf, change%w, r%f)
    call right_by_left(at%yx, change%x, r%x)
    dg = change%y
    call leg_two_by(-1.0_wp, change%x, at%gp, dg)
    call leg_three_by(-1.0_wp, change%w, at%gp, dg)
    call leg_one_of(identity - at%lx, dg, moved)
    r%g = r%g + moved
    call leg_two_by(1.0_wp, change%x, at%yg, r%g)
    call leg_three_by(1.0_wp, change%w, at%yg, r%g)
  end subroutine residual_of

  !> Add what a change of the breakage does to the stress.
  pure subroutine stress_by_breakage(at, b, stress)
    type(mm_iterate_type), intent(in) :: at
    real(wp), intent(in) :: b(lanes)
    type(mm_stress_d_type), intent(inout) :: stress
    integer(i4) :: i, j, k
    do j = 1, 3
      do i = 1, 3
        stress%s(:, i, j) = stress%s(:, i, j) + at%fallen%s(i, j)*b
        stress%sigma(:, i, j) = stress%sigma(:, i, j) + at%fallen%sigma(i, j)*b
        do k = 1, 3
          stress%m(:, i, j, k) = stress%m(:, i, j, k) + at%fallen%m(i, j, k)*b
        end do
      end do
    end do
  end subroutine stress_by_breakage

  !> Add y dw to r.
  pure subroutine right_by_left(y, dw, r)
    real(wp), intent(in) :: y(3, 3), dw(lanes, 3, 3)
    real(wp), intent(inout) :: r(lanes, 3, 3)
    real(wp) :: a(lanes, 3, 3)
    call left(y, dw, a)
    r = r + a
  end subroutine right_by_left

  !> The parts of `residual_of` that come from the flow, and the yield functions.
  pure subroutine flow_of(law, at, theta, change, d, r)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    real(wp), intent(in) :: theta
    type(mm_change_type), intent(in) :: change
    type(mm_strain_d_type), intent(in) :: d
    type(mm_residual_d_type), intent(inout) :: r
    type(mm_turn_type) :: turn
    real(wp) :: sum_flow(3, 3), share
    real(wp), dimension(lanes, 3, 3) :: a, b, dn, d_sum
    integer(i4) :: k

    call turn_around(law, at, change, d, r%stress%s, turn)
    r%x = 0.0_wp
    r%g = 0.0_wp
    r%yield = 0.0_wp
    d_sum = 0.0_wp
    sum_flow = 0.0_wp
    do k = 1, surfaces
      if (.not. at%active(k)) cycle
      if (k == 1) then
        turn%stress = r%stress%s
      else if (k == 2) then
        turn%stress = r%stress%sigma
      else
        turn%stress = r%stress%m(:, :, :, k - 2)
      end if
      if (k < 3) turn%cap = cap_of(law, at, k, change)
      call turn_surface(law%cone(k), place_of(law, at, k), at%surface(k), turn, r%yield(:, k), dn)
      share = theta*at%gamma(k)
      if (k < 3) then
        call turned(dn, a)
        d_sum = d_sum + share*a
        sum_flow = sum_flow + share*transpose(at%surface(k)%flow)
      end if
      if (k == 2) call micro_flow_of(at, share, turn%inverse_c, dn, d, r)
      if (k > 2) call gradient_flow_of(at, share, k, dn, d, r)
    end do
    call left(at%inverse_c, d_sum, a)
    call right(turn%inverse_c, sum_flow, b)
    r%f = -a - b
    if (law%exact_volume) call volume_of(at, r)
  end subroutine flow_of

  !> Derivatives of what all surfaces are looked at with.
  pure subroutine turn_around(law, at, change, d, ds, turn)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_change_type), intent(in) :: change
    type(mm_strain_d_type), intent(in) :: d
    real(wp), intent(in) :: ds(lanes, 3, 3)  !! of the macro-stress
    type(mm_turn_type), intent(out) :: turn
    real(wp), dimension(lanes, 3, 3) :: a
    integer(i4) :: i, j, k

    call left(at%inverse_c, d%c, a)
    call right(a, at%inverse_c, turn%inverse_c)
    turn%inverse_c = -turn%inverse_c
    turn%c = d%c
    if (any(law%cone(3:)%of_macro)) then
      do j = 1, 3
        do i = 1, 3
          turn%pressure = turn%pressure + (d%c(:, i, j)*at%stress%s(i, j) &
            + at%strain%c(i, j)*ds(:, i, j))/3.0_wp
        end do
      end do
    end if
    if (.not. law%breaks) return
    turn%breakage = change%b
    do j = 1, 3
      do i = 1, 3
        turn%energy = turn%energy - 0.5_wp*at%fall%e(i, j)*d%c(:, i, j) &
          - at%fall%p(i, j)*d%psi(:, i, j)
        do k = 1, 3
          turn%energy = turn%energy - at%fall%g(i, j, k)*d%gamma(:, i, j, k)
        end do
      end do
    end do
  end subroutine turn_around

  !> Derivative of p_c of surface k by the volume of its plastic part.
  pure function cap_of(law, at, k, change) result(d)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    integer(i4), intent(in) :: k
    type(mm_change_type), intent(in) :: change
    real(wp) :: d(lanes)
    d = change%w(:, 1, 1) + change%w(:, 2, 2) + change%w(:, 3, 3)
    if (k == 2) d = change%x(:, 1, 1) + change%x(:, 2, 2) + change%x(:, 3, 3)
    d = -law%cone(k)%exponent*at%cap(k)*d
  end function cap_of

  !> Derivatives of the factors of the explicit part, from those of the flow, which r holds.
  pure subroutine volume_of(at, r)
    type(mm_iterate_type), intent(in) :: at
    type(mm_residual_d_type), intent(inout) :: r
    real(wp) :: df(lanes), dx(lanes)
    integer(i4) :: i, j, k
    df = 0.0_wp
    dx = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        df = df + at%drift_f(i, j)*r%f(:, i, j)
        dx = dx + at%drift_x(i, j)*r%x(:, i, j)
      end do
    end do
    do j = 1, 3
      do i = 1, 3
        r%f(:, i, j) = r%f(:, i, j) + at%yf(i, j)*df
        r%x(:, i, j) = r%x(:, i, j) + at%yx(i, j)*dx
        do k = 1, 3
          r%g(:, i, j, k) = r%g(:, i, j, k) + at%yg(i, j, k)*dx
        end do
      end do
    end do
  end subroutine volume_of

  !> Flow of the micro-surface: of chi_p, and of its gradient with it.
  pure subroutine micro_flow_of(at, share, d_inverse_c, dn, d, r)
    type(mm_iterate_type), intent(in) :: at
    real(wp), intent(in) :: share, d_inverse_c(lanes, 3, 3), dn(lanes, 3, 3)
    type(mm_strain_d_type), intent(in) :: d
    type(mm_residual_d_type), intent(inout) :: r
    real(wp), dimension(lanes, 3, 3) :: a, b, dl
    real(wp), dimension(lanes, 3, 3, 3) :: dx, h
    real(wp) :: n(3, 3)

    n = transpose(at%surface(2)%flow)
    call turned(dn, a)
    call right(a, at%inverse_c, b)
    call left(n, d_inverse_c, a)
    a = share*(a + b)
    call right(a, at%strain%psi, b)
    call left(share*matmul(n, at%inverse_c), d%psi, a)
    b = b + a
    call right(d%psi, at%lx, a)
    b = b - a
    call left(at%inverse_psi, b, dl)
    r%x = -dl
    h = d%gamma
    call leg_one_by(-1.0_wp, d%psi, at%x, h)
    call leg_one_of(at%inverse_psi, h, dx)
    call leg_one_by(-1.0_wp, dl, at%x + at%gp, r%g)
    call leg_two_by(1.0_wp, dl, at%x, r%g)
    call leg_one_of(at%lx, dx, h)
    r%g = r%g - h
    call leg_two_of(transpose(at%lx), dx, h)
    r%g = r%g + h
  end subroutine micro_flow_of

  !> Flow of the micro-gradient surface k.
  pure subroutine gradient_flow_of(at, share, k, dn, d, r)
    type(mm_iterate_type), intent(in) :: at
    real(wp), intent(in) :: share
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: dn(lanes, 3, 3)
    type(mm_strain_d_type), intent(in) :: d
    type(mm_residual_d_type), intent(inout) :: r
    real(wp), dimension(lanes, 3, 3) :: a, b
    call right(d%psi, at%g_unit(:, k - 2, :, k), a)
    call turned(dn, b)
    b = share*(b - a)
    call left(at%inverse_psi, b, a)
    r%g(:, :, k - 2, :) = r%g(:, :, k - 2, :) - a
  end subroutine gradient_flow_of
end module fem_mm_flow
