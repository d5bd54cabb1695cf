!> Motion of a micromorphic point: strains of (F, chi, grad chi), forces that do work on them, and
!! the tangent of the forces. Motions and forces are packed as 45 numbers: F_iI, chi_iK, chi_iK,L,
!! the first index running fastest. Forces P, Q, R are the derivatives of the energy with respect
!! to F, chi and grad chi,
!!   P = F E^ + chi P^T + chi_iQ,R G^_IQR,  Q = F P^,  R_iKL = F_iI G^_IKL.
!! eqs. F.8, F.11 and F.12
module fem_mm_motion
  use talus_kinds, only: wp, i4
  use fem_mm_elastic, only: mm_elastic_type, mm_strain_type, mm_dual_type, mm_stress_type
  use fem_mm_elastic, only: mm_strain_d_type, mm_dual_d_type, mm_stress_d_type
  use fem_mm_elastic, only: duals, duals_of, stresses, stresses_of, duals_from_stress
  use fem_mm_elastic, only: duals_from_stress_of
  use fem_mm_tensor, only: lanes, identity, inverse, determinant, leg_one, leg_two, leg_three, fold
  use fem_mm_tensor, only: left, right, turned, leg_one_of, leg_one_by, fold_of
  implicit none
  private
  public :: mm_motion_type, mm_motion_d_type, mm_force_type, mm_spatial_type
  public :: strains, strains_of, seed, forces, forces_of, elastic_forces, elastic_tangent
  public :: pushed, packed_motion, packed_force, unpacked_motion, unpacked_force

  type :: mm_motion_type
    real(wp) :: f(3, 3) = identity, chi(3, 3) = identity  !! [-]
    real(wp) :: g(3, 3, 3) = 0.0_wp                        !! chi_iK,L [1/m]
  end type mm_motion_type

  type :: mm_force_type
    real(wp) :: p(3, 3), q(3, 3)  !! per reference volume [Pa]
    real(wp) :: r(3, 3, 3)        !! [N/m]
  end type mm_force_type

  !> Stresses per area of the present state.
  type :: mm_spatial_type
    real(wp) :: sigma(3, 3), s(3, 3)  !! Cauchy and micro-stress [Pa]
    real(wp) :: m(3, 3, 3)            !! couple stress [N/m]
  end type mm_spatial_type

  type :: mm_motion_d_type
    real(wp) :: f(lanes, 3, 3), chi(lanes, 3, 3), g(lanes, 3, 3, 3)
  end type mm_motion_d_type

contains

  pure function strains(motion) result(strain)
    type(mm_motion_type), intent(in) :: motion
    type(mm_strain_type) :: strain
    real(wp) :: t(3, 3)
    t = transpose(motion%f)
    strain%c = matmul(t, motion%f)
    strain%psi = matmul(t, motion%chi)
    strain%gamma = leg_one(t, motion%g)
  end function strains

  !> Derivatives of `strains`.
  pure subroutine strains_of(motion, d, strain)
    type(mm_motion_type), intent(in) :: motion
    type(mm_motion_d_type), intent(in) :: d
    type(mm_strain_d_type), intent(out) :: strain
    real(wp), dimension(lanes, 3, 3) :: a, b, f_turned
    real(wp) :: t(3, 3)
    t = transpose(motion%f)
    call turned(d%f, f_turned)
    call right(f_turned, motion%f, a)
    call turned(a, b)
    strain%c = a + b
    call right(f_turned, motion%chi, a)
    call left(t, d%chi, b)
    strain%psi = a + b
    call leg_one_of(t, d%g, strain%gamma)
    call leg_one_by(1.0_wp, f_turned, motion%g, strain%gamma)
  end subroutine strains_of

  !> Directions first to first + lanes - 1 of the 45; zero beyond.
  pure subroutine seed(first, d)
    integer(i4), intent(in) :: first
    type(mm_motion_d_type), intent(out) :: d
    integer(i4) :: l, k
    d%f = 0.0_wp
    d%chi = 0.0_wp
    d%g = 0.0_wp
    do l = 1, lanes
      k = first + l - 2  ! from zero
      if (k < 9) then
        d%f(l, 1 + mod(k, 3), 1 + k/3) = 1.0_wp
      else if (k < 18) then
        d%chi(l, 1 + mod(k, 3), k/3 - 2) = 1.0_wp
      else if (k < 45) then
        d%g(l, 1 + mod(k, 3), 1 + mod(k/3 - 6, 3), k/9 - 1) = 1.0_wp
      end if
    end do
  end subroutine seed

  pure function forces(motion, dual) result(force)
    type(mm_motion_type), intent(in) :: motion
    type(mm_dual_type), intent(in) :: dual
    type(mm_force_type) :: force
    force%p = matmul(motion%f, dual%e) + matmul(motion%chi, transpose(dual%p)) &
      + fold(motion%g, dual%g)
    force%q = matmul(motion%f, dual%p)
    force%r = leg_one(motion%f, dual%g)
  end function forces

  !> Derivatives of `forces`, packed: columns (45, lanes).
  pure subroutine forces_of(motion, dual, d, d_dual, column)
    type(mm_motion_type), intent(in) :: motion
    type(mm_dual_type), intent(in) :: dual
    type(mm_motion_d_type), intent(in) :: d
    type(mm_dual_d_type), intent(in) :: d_dual
    real(wp), intent(out) :: column(45, lanes)
    real(wp), dimension(lanes, 3, 3) :: a, b, p
    real(wp) :: r(lanes, 3, 3, 3)
    integer(i4) :: k, l, m, n

    call left(motion%f, d_dual%e, p)
    call right(d%f, dual%e, a)
    p = p + a
    call right(d%chi, transpose(dual%p), a)
    p = p + a
    call turned(d_dual%p, b)
    call left(motion%chi, b, a)
    p = p + a
    call fold_of(d%g, dual%g, p)
    a = 0.0_wp
    call fold_of(d_dual%g, motion%g, a)
    call turned(a, b)
    p = p + b
    call right(d%f, dual%p, a)
    call left(motion%f, d_dual%p, b)
    a = a + b
    call leg_one_of(motion%f, d_dual%g, r)
    call leg_one_by(1.0_wp, d%f, dual%g, r)
    n = 0
    do l = 1, 3
      do k = 1, 3
        n = n + 1
        column(n, :) = p(:, k, l)
        column(n + 9, :) = a(:, k, l)
        do m = 1, 3
          column(9*m + n + 9, :) = r(:, k, l, m)
        end do
      end do
    end do
  end subroutine forces_of

  !> Forces of an elastic point.
  pure function elastic_forces(law, motion) result(force)
    type(mm_elastic_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion
    type(mm_force_type) :: force
    type(mm_strain_type) :: strain
    type(mm_dual_type) :: dual
    strain = strains(motion)
    dual = duals(law, strain)
    if (law%reduced) dual = duals_from_stress(strain, stresses(law, strain, dual))
    force = forces(motion, dual)
  end function elastic_forces

  !> Forces and their derivatives (45, 45) with respect to the motion of an elastic point.
  pure subroutine elastic_tangent(law, motion, force, tangent)
    type(mm_elastic_type), intent(in) :: law
    type(mm_motion_type), intent(in) :: motion
    type(mm_force_type), intent(out) :: force
    real(wp), intent(out) :: tangent(45, 45)
    type(mm_strain_type) :: strain
    type(mm_dual_type) :: dual, conjugate
    type(mm_stress_type) :: stress
    type(mm_motion_d_type) :: d
    type(mm_strain_d_type) :: d_strain
    type(mm_dual_d_type) :: d_dual
    type(mm_stress_d_type) :: d_stress
    real(wp) :: column(45, lanes), inverse_c(3, 3)
    integer(i4) :: first, last

    strain = strains(motion)
    dual = duals(law, strain)
    conjugate = dual
    if (law%reduced) then
      stress = stresses(law, strain, dual)
      conjugate = duals_from_stress(strain, stress)
      inverse_c = inverse(strain%c)
    end if
    force = forces(motion, conjugate)
    do first = 1, 45, lanes
      call seed(first, d)
      call strains_of(motion, d, d_strain)
      if (law%reduced) then
        call stresses_of(law, strain, dual, stress, inverse_c, d_strain, d_stress)
        call duals_from_stress_of(strain, stress, conjugate, d_strain, d_stress, d_dual)
      else
        call duals_of(law, d_strain, d_dual)
      end if
      call forces_of(motion, conjugate, d, d_dual, column)
      last = min(first + lanes - 1, 45)
      tangent(:, first:last) = column(:, :last - first + 1)
    end do
  end subroutine elastic_tangent

  !> sigma = F S F^T/J, s = F Sigma F^T/J, m_ijk = F_iI F_jJ chi_kK M_IJK/J.
  pure function pushed(motion, stress) result(spatial)
    type(mm_motion_type), intent(in) :: motion
    type(mm_stress_type), intent(in) :: stress
    type(mm_spatial_type) :: spatial
    real(wp) :: t(3, 3), volume
    t = transpose(motion%f)
    volume = determinant(motion%f)
    spatial%sigma = matmul(motion%f, matmul(stress%s, t))/volume
    spatial%s = matmul(motion%f, matmul(stress%sigma, t))/volume
    spatial%m = leg_three(motion%chi, leg_two(motion%f, leg_one(motion%f, stress%m)))/volume
  end function pushed

  pure function packed_motion(motion) result(v)
    type(mm_motion_type), intent(in) :: motion
    real(wp) :: v(45)
    v(:9) = reshape(motion%f, [9])
    v(10:18) = reshape(motion%chi, [9])
    v(19:) = reshape(motion%g, [27])
  end function packed_motion

  pure function unpacked_motion(v) result(motion)
    real(wp), intent(in) :: v(45)
    type(mm_motion_type) :: motion
    motion%f = reshape(v(:9), [3, 3])
    motion%chi = reshape(v(10:18), [3, 3])
    motion%g = reshape(v(19:), [3, 3, 3])
  end function unpacked_motion

  pure function packed_force(force) result(v)
    type(mm_force_type), intent(in) :: force
    real(wp) :: v(45)
    v(:9) = reshape(force%p, [9])
    v(10:18) = reshape(force%q, [9])
    v(19:) = reshape(force%r, [27])
  end function packed_force

  pure function unpacked_force(v) result(force)
    real(wp), intent(in) :: v(45)
    type(mm_force_type) :: force
    force%p = reshape(v(:9), [3, 3])
    force%q = reshape(v(10:18), [3, 3])
    force%r = reshape(v(19:), [3, 3, 3])
  end function unpacked_force
end module fem_mm_motion
