!> Elastic law of the finite-strain micromorphic solid (theory: micromorphic solids).
!!
!! Strains C = F^T F, Psi = F^T chi, Gamma_KLM = F_kK chi_kL,M; E = (C - 1)/2, e = Psi - 1. With
!! 18 moduli the energy per reference volume is W(E, e, Gamma), its derivatives are
!!   E^ = dW/dE, P^ = dW/de, G^ = dW/dGamma,
!! and with T = (P^ Psi^T + G^_IQR Gamma_SQR) C^-1 the stresses are
!!   S = E^ + T,  Sigma = E^ + T + T^T,  M_IJK = G^_JKI.
!! The reduced form (Regueiro 2010) drops the products of T: S and Sigma are linear in E and e.
!! eqs. F.9 and F.10
module fem_mm_elastic
  use talus_kinds, only: wp, i4
  use fem_mm_tensor, only: lanes, identity, inverse, fold, left, right, turned, fold_of
  implicit none
  private
  public :: mm_elastic_type, mm_strain_type, mm_dual_type, mm_stress_type
  public :: mm_strain_d_type, mm_dual_d_type, mm_stress_d_type
  public :: set_moduli, weakened, duals, duals_of, couple, couple_of, stored_energy
  public :: stresses, stresses_of, duals_from_stress, duals_from_stress_of

  !> The moduli: seven of the strains [Pa], eleven of the gradient [N].
  type :: mm_elastic_type
    real(wp) :: lambda = 0.0_wp, mu = 0.0_wp, eta = 0.0_wp, tau = 0.0_wp, kappa = 0.0_wp
    real(wp) :: nu = 0.0_wp, sigma = 0.0_wp
    real(wp) :: taus(11) = 0.0_wp
    logical :: reduced = .false.        !! S and Sigma without products
    logical :: only_seventh = .false.   !! of taus, only the seventh is not zero
  end type mm_elastic_type

  type :: mm_strain_type
    real(wp) :: c(3, 3) = identity, psi(3, 3) = identity  !! [-]
    real(wp) :: gamma(3, 3, 3) = 0.0_wp                    !! [1/m]
  end type mm_strain_type

  !> Derivatives of the energy; e is symmetric.
  type :: mm_dual_type
    real(wp) :: e(3, 3), p(3, 3)  !! [Pa]
    real(wp) :: g(3, 3, 3)        !! [N/m]
  end type mm_dual_type

  type :: mm_stress_type
    real(wp) :: s(3, 3), sigma(3, 3)  !! [Pa]
    real(wp) :: m(3, 3, 3)            !! [N/m]
  end type mm_stress_type

  type :: mm_strain_d_type
    real(wp) :: c(lanes, 3, 3), psi(lanes, 3, 3), gamma(lanes, 3, 3, 3)
  end type mm_strain_d_type

  type :: mm_dual_d_type
    real(wp) :: e(lanes, 3, 3), p(lanes, 3, 3), g(lanes, 3, 3, 3)
  end type mm_dual_d_type

  type :: mm_stress_d_type
    real(wp) :: s(lanes, 3, 3), sigma(lanes, 3, 3), m(lanes, 3, 3, 3)
  end type mm_stress_d_type

contains

  !> Law of 18 moduli: lambda mu eta tau kappa nu sigma [Pa], tau_1 to tau_11 [N].
  pure function set_moduli(moduli, reduced) result(law)
    real(wp), intent(in) :: moduli(18)
    logical, intent(in) :: reduced
    type(mm_elastic_type) :: law
    law%lambda = moduli(1)
    law%mu = moduli(2)
    law%eta = moduli(3)
    law%tau = moduli(4)
    law%kappa = moduli(5)
    law%nu = moduli(6)
    law%sigma = moduli(7)
    law%taus = moduli(8:18)
    law%reduced = reduced
    law%only_seventh = all(moduli(8:13) == 0.0_wp) .and. all(moduli(15:18) == 0.0_wp)
  end function set_moduli

  !> The law plus a share of another one.
  pure function weakened(law, share, other) result(sum_of)
    type(mm_elastic_type), intent(in) :: law, other
    real(wp), intent(in) :: share
    type(mm_elastic_type) :: sum_of
    sum_of = law
    sum_of%lambda = law%lambda + share*other%lambda
    sum_of%mu = law%mu + share*other%mu
    sum_of%eta = law%eta + share*other%eta
    sum_of%tau = law%tau + share*other%tau
    sum_of%kappa = law%kappa + share*other%kappa
    sum_of%nu = law%nu + share*other%nu
    sum_of%sigma = law%sigma + share*other%sigma
    sum_of%taus = law%taus + share*other%taus
  end function weakened

  !> G^_KLM = C_KLMNPQ Gamma_NPQ with the eleven isotropic parts of C.
  pure function couple(law, gamma) result(g)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(in) :: gamma(3, 3, 3)
    real(wp) :: g(3, 3, 3)
    real(wp) :: a(3), b(3), c(3), x(3), y(3), z(3)
    integer(i4) :: k, l, m

    g = law%taus(7)*gamma
    if (law%only_seventh) return
    do m = 1, 3
      a(m) = gamma(m, 1, 1) + gamma(m, 2, 2) + gamma(m, 3, 3)
      b(m) = gamma(1, m, 1) + gamma(2, m, 2) + gamma(3, m, 3)
      c(m) = gamma(1, 1, m) + gamma(2, 2, m) + gamma(3, 3, m)
    end do
    x = law%taus(1)*a + law%taus(2)*b + law%taus(3)*c
    y = law%taus(1)*c + law%taus(4)*a + law%taus(5)*b
    z = law%taus(2)*c + law%taus(5)*a + law%taus(6)*b
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          g(k, l, m) = g(k, l, m) + law%taus(8)*(gamma(m, k, l) + gamma(l, m, k)) &
            + law%taus(9)*gamma(k, m, l) + law%taus(10)*gamma(l, k, m) &
            + law%taus(11)*gamma(m, l, k)
        end do
        g(l, l, m) = g(l, l, m) + x(m)
        g(m, l, l) = g(m, l, l) + y(m)
        g(l, m, l) = g(l, m, l) + z(m)
      end do
    end do
  end function couple

  !> Derivatives of `couple`, which is linear.
  pure subroutine couple_of(law, gamma, g)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(in) :: gamma(lanes, 3, 3, 3)
    real(wp), intent(out) :: g(lanes, 3, 3, 3)
    real(wp) :: a(lanes), b(lanes), c(lanes)
    integer(i4) :: k, l, m

    g = law%taus(7)*gamma
    if (law%only_seventh) return
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          g(:, k, l, m) = g(:, k, l, m) + law%taus(8)*(gamma(:, m, k, l) + gamma(:, l, m, k)) &
            + law%taus(9)*gamma(:, k, m, l) + law%taus(10)*gamma(:, l, k, m) &
            + law%taus(11)*gamma(:, m, l, k)
        end do
      end do
    end do
    do m = 1, 3
      a = gamma(:, m, 1, 1) + gamma(:, m, 2, 2) + gamma(:, m, 3, 3)
      b = gamma(:, 1, m, 1) + gamma(:, 2, m, 2) + gamma(:, 3, m, 3)
      c = gamma(:, 1, 1, m) + gamma(:, 2, 2, m) + gamma(:, 3, 3, m)
      do l = 1, 3
        g(:, l, l, m) = g(:, l, l, m) + law%taus(1)*a + law%taus(2)*b + law%taus(3)*c
        g(:, m, l, l) = g(:, m, l, l) + law%taus(1)*c + law%taus(4)*a + law%taus(5)*b
        g(:, l, m, l) = g(:, l, m, l) + law%taus(2)*c + law%taus(5)*a + law%taus(6)*b
      end do
    end do
  end subroutine couple_of

  !> Derivatives of the energy with respect to E, e and Gamma.
  pure function duals(law, strain) result(dual)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: strain
    type(mm_dual_type) :: dual
    real(wp) :: e(3, 3), micro(3, 3), tr_e, tr_m
    integer(i4) :: k

    e = 0.5_wp*(strain%c - identity)
    micro = strain%psi - identity
    tr_e = e(1, 1) + e(2, 2) + e(3, 3)
    tr_m = micro(1, 1) + micro(2, 2) + micro(3, 3)
    dual%e = 2.0_wp*law%mu*e + law%sigma*(micro + transpose(micro))
    dual%p = (law%kappa - law%sigma)*micro + (law%nu - law%sigma)*transpose(micro) &
      + 2.0_wp*law%sigma*e
    do k = 1, 3
      dual%e(k, k) = dual%e(k, k) + law%lambda*tr_e + law%tau*tr_m
      dual%p(k, k) = dual%p(k, k) + (law%eta - law%tau)*tr_m + law%tau*tr_e
    end do
    dual%g = couple(law, strain%gamma)
  end function duals

  !> Derivatives of `duals`.
  pure subroutine duals_of(law, strain, dual)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_d_type), intent(in) :: strain
    type(mm_dual_d_type), intent(out) :: dual
    real(wp) :: tr_e(lanes), tr_m(lanes)
    integer(i4) :: k, l

    tr_e = 0.5_wp*(strain%c(:, 1, 1) + strain%c(:, 2, 2) + strain%c(:, 3, 3))
    tr_m = strain%psi(:, 1, 1) + strain%psi(:, 2, 2) + strain%psi(:, 3, 3)
    do l = 1, 3
      do k = 1, 3
        dual%e(:, k, l) = law%mu*strain%c(:, k, l) &
          + law%sigma*(strain%psi(:, k, l) + strain%psi(:, l, k))
        dual%p(:, k, l) = (law%kappa - law%sigma)*strain%psi(:, k, l) &
          + (law%nu - law%sigma)*strain%psi(:, l, k) + law%sigma*strain%c(:, k, l)
      end do
      dual%e(:, l, l) = dual%e(:, l, l) + law%lambda*tr_e + law%tau*tr_m
      dual%p(:, l, l) = dual%p(:, l, l) + (law%eta - law%tau)*tr_m + law%tau*tr_e
    end do
    call couple_of(law, strain%gamma, dual%g)
  end subroutine duals_of

  !> W [J/m^3].
  pure real(wp) function stored_energy(law, strain)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: strain
    type(mm_dual_type) :: dual
    dual = duals(law, strain)
    stored_energy = 0.5_wp*(0.5_wp*sum(dual%e*(strain%c - identity)) &
      + sum(dual%p*(strain%psi - identity)) + sum(dual%g*strain%gamma))
  end function stored_energy

  !> Stresses of the strains and of the derivatives of the energy there.
  pure function stresses(law, strain, dual) result(stress)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: strain
    type(mm_dual_type), intent(in) :: dual
    type(mm_stress_type) :: stress
    real(wp) :: t(3, 3)

    if (law%reduced) then
      call reduced_stresses(law, strain, stress%s, stress%sigma)
    else
      t = matmul(matmul(dual%p, transpose(strain%psi)) + fold(dual%g, strain%gamma), &
                 inverse(strain%c))
      stress%s = dual%e + t
      stress%sigma = stress%s + transpose(t)
    end if
    stress%m = reshape(dual%g, [3, 3, 3], order=[2, 3, 1])
  end function stresses

  !> S and Sigma without products.
  pure subroutine reduced_stresses(law, strain, s, sigma)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: strain
    real(wp), intent(out) :: s(3, 3), sigma(3, 3)
    real(wp) :: e(3, 3), micro(3, 3), tr_e, tr_m
    integer(i4) :: k
    e = 0.5_wp*(strain%c - identity)
    micro = strain%psi - identity
    tr_e = e(1, 1) + e(2, 2) + e(3, 3)
    tr_m = micro(1, 1) + micro(2, 2) + micro(3, 3)
    s = 2.0_wp*(law%mu + law%sigma)*e + law%kappa*micro + law%nu*transpose(micro)
    sigma = 2.0_wp*(law%mu + 2.0_wp*law%sigma)*e &
      + (law%nu + law%kappa - law%sigma)*(micro + transpose(micro))
    do k = 1, 3
      s(k, k) = s(k, k) + (law%lambda + law%tau)*tr_e + law%eta*tr_m
      sigma(k, k) = sigma(k, k) + (law%lambda + 2.0_wp*law%tau)*tr_e &
        + (2.0_wp*law%eta - law%tau)*tr_m
    end do
  end subroutine reduced_stresses

  !> Derivatives of `stresses` at strain, dual, stress.
  pure subroutine stresses_of(law, strain, dual, stress, inverse_c, d_strain, d_stress)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: strain
    type(mm_dual_type), intent(in) :: dual
    type(mm_stress_type), intent(in) :: stress
    real(wp), intent(in) :: inverse_c(3, 3)
    type(mm_strain_d_type), intent(in) :: d_strain
    type(mm_stress_d_type), intent(out) :: d_stress
    type(mm_dual_d_type) :: d_dual
    real(wp), dimension(lanes, 3, 3) :: a, b, c
    real(wp) :: t(3, 3)
    integer(i4) :: k, l

    call duals_of(law, d_strain, d_dual)
    do k = 1, 3
      do l = 1, 3
        d_stress%m(:, k, :, l) = d_dual%g(:, :, l, k)
      end do
    end do
    if (law%reduced) then
      call reduced_of(law, d_strain, d_stress)
      return
    end if
    t = transpose(stress%sigma - stress%s)
    call right(d_dual%p, transpose(strain%psi), a)
    call turned(d_strain%psi, c)
    call left(dual%p, c, b)
    a = a + b
    call left(t, d_strain%c, b)
    a = a - b
    call fold_of(d_dual%g, strain%gamma, a)
    b = 0.0_wp
    call fold_of(d_strain%gamma, dual%g, b)
    call turned(b, c)
    a = a + c
    call right(a, inverse_c, b)
    d_stress%s = d_dual%e + b
    call turned(b, c)
    d_stress%sigma = d_stress%s + c
  end subroutine stresses_of

  !> Derivatives of `reduced_stresses`.
  pure subroutine reduced_of(law, strain, stress)
    type(mm_elastic_type), intent(in) :: law
    type(mm_strain_d_type), intent(in) :: strain
    type(mm_stress_d_type), intent(inout) :: stress
    real(wp) :: tr_e(lanes), tr_m(lanes)
    integer(i4) :: k, l
    tr_e = 0.5_wp*(strain%c(:, 1, 1) + strain%c(:, 2, 2) + strain%c(:, 3, 3))
    tr_m = strain%psi(:, 1, 1) + strain%psi(:, 2, 2) + strain%psi(:, 3, 3)
    do l = 1, 3
      do k = 1, 3
        stress%s(:, k, l) = (law%mu + law%sigma)*strain%c(:, k, l) &
          + law%kappa*strain%psi(:, k, l) + law%nu*strain%psi(:, l, k)
        stress%sigma(:, k, l) = (law%mu + 2.0_wp*law%sigma)*strain%c(:, k, l) &
          + (law%nu + law%kappa - law%sigma)*(strain%psi(:, k, l) + strain%psi(:, l, k))
      end do
      stress%s(:, l, l) = stress%s(:, l, l) + (law%lambda + law%tau)*tr_e + law%eta*tr_m
      stress%sigma(:, l, l) = stress%sigma(:, l, l) + (law%lambda + 2.0_wp*law%tau)*tr_e &
        + (2.0_wp*law%eta - law%tau)*tr_m
    end do
  end subroutine reduced_of

  !> The work conjugates of E, e and Gamma that belong to any stresses:
  !! E^ = S - T, P^ = (T C - G^_KLM Gamma_SLM) Psi^-T, T = (Sigma - S)^T.
  pure function duals_from_stress(strain, stress) result(dual)
    type(mm_strain_type), intent(in) :: strain
    type(mm_stress_type), intent(in) :: stress
    type(mm_dual_type) :: dual
    real(wp) :: t(3, 3)
    t = transpose(stress%sigma - stress%s)
    dual%e = stress%s - t
    dual%g = reshape(stress%m, [3, 3, 3], order=[3, 1, 2])
    dual%p = matmul(matmul(t, strain%c) - fold(dual%g, strain%gamma), &
                    transpose(inverse(strain%psi)))
  end function duals_from_stress

  !> Derivatives of `duals_from_stress`.
  pure subroutine duals_from_stress_of(strain, stress, dual, d_strain, d_stress, d_dual)
    type(mm_strain_type), intent(in) :: strain
    type(mm_stress_type), intent(in) :: stress
    type(mm_dual_type), intent(in) :: dual
    type(mm_strain_d_type), intent(in) :: d_strain
    type(mm_stress_d_type), intent(in) :: d_stress
    type(mm_dual_d_type), intent(out) :: d_dual
    real(wp), dimension(lanes, 3, 3) :: a, b, c
    integer(i4) :: k, l

    b = d_stress%sigma - d_stress%s
    call turned(b, a)
    d_dual%e = d_stress%s - a
    do k = 1, 3
      do l = 1, 3
        d_dual%g(:, :, l, k) = d_stress%m(:, k, :, l)
      end do
    end do
    call right(a, strain%c, b)
    call left(transpose(stress%sigma - stress%s), d_strain%c, a)
    b = b + a
    call turned(d_strain%psi, c)
    call left(dual%p, c, a)
    b = b - a
    a = 0.0_wp
    call fold_of(d_dual%g, strain%gamma, a)
    b = b - a
    a = 0.0_wp
    call fold_of(d_strain%gamma, dual%g, a)
    call turned(a, c)
    b = b - c
    call right(b, transpose(inverse(strain%psi)), d_dual%p)
  end subroutine duals_from_stress_of
end module fem_mm_elastic
