!> The linear micropolar law of Eringen (1968) at small strains (theory: micropolar continuum).
!!
!! Strain gamma_kl = u_l,k + e_lkm phi_m and curvature kappa_kl = phi_l,k; with the face's normal
!! as first index of stress sigma_kl and couple stress m_kl,
!!   sigma_kl = lambda gamma_mm d_kl + (mu + kappa) gamma_kl + mu gamma_lk,
!!   m_kl     = alpha phi_r,r d_kl + beta phi_k,l + gamma phi_l,k.
!! Nine-vectors hold kl = 11 12 13 21 22 23 31 32 33. Moduli are (lambda, mu, kappa [Pa], alpha,
!! beta, gamma [N]); the last four are zero in a classical solid and sigma is then symmetric.
!! eqs. F.2, F.3 and F.5
module fem_micropolar
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  implicit none
  private
  public :: micropolar_strain, micropolar_stress, eringen_moduli
  public :: violated_inequality, axial, lame_moduli, technical_type

  real(wp), parameter :: round_off = 1.0e-12_wp

  !> Engineering constants.
  type :: technical_type
    real(wp) :: shear = 0.0_wp, young = 0.0_wp, poisson = 0.0_wp      !! [Pa], [Pa], [-]
    real(wp) :: length_torsion = 0.0_wp, length_bending = 0.0_wp      !! [m]
    real(wp) :: coupling = 0.0_wp, polar_ratio = 0.0_wp               !! N, Psi [-]
  end type technical_type

contains

  !> gamma (9) from h(i, j) = u_i,j and phi; e_lkm phi_m added to u_l,k.
  pure function micropolar_strain(h, phi) result(gamma)
    real(wp), intent(in) :: h(3, 3)  !! displacement gradient [-]
    real(wp), intent(in) :: phi(3)   !! [rad]
    real(wp) :: gamma(9)
    gamma = [h(1, 1), h(2, 1) - phi(3), h(3, 1) + phi(2), &
             h(1, 2) + phi(3), h(2, 2), h(3, 2) - phi(1), &
             h(1, 3) - phi(2), h(2, 3) + phi(1), h(3, 3)]
  end function micropolar_strain

  !> sigma (9) [Pa] and m (9) [N/m] from the strain and c(i, j) = phi_i,j [1/m].
  pure subroutine micropolar_stress(moduli, gamma, c, sigma, couple)
    real(wp), intent(in) :: moduli(6), gamma(9), c(3, 3)
    real(wp), intent(out) :: sigma(9), couple(9)
    integer(i4), parameter :: turned(9) = [1, 4, 7, 2, 5, 8, 3, 6, 9], diagonal(3) = [1, 5, 9]
    real(wp) :: curvature(9)
    sigma = (moduli(2) + moduli(3))*gamma + moduli(2)*gamma(turned)
    sigma(diagonal) = sigma(diagonal) + moduli(1)*sum(gamma(diagonal))
    curvature = reshape(c, [9])  ! kl holds phi_l,k
    couple = moduli(6)*curvature + moduli(5)*curvature(turned)
    couple(diagonal) = couple(diagonal) + moduli(4)*sum(curvature(diagonal))
  end subroutine micropolar_stress

  !> e_kmn sigma_mn [Pa].
  pure function axial(sigma) result(vector)
    real(wp), intent(in) :: sigma(9)
    real(wp) :: vector(3)
    vector = [sigma(6) - sigma(8), sigma(7) - sigma(3), sigma(2) - sigma(4)]
  end function axial

  !> Moduli of a classical solid.
  pure function lame_moduli(young, poisson) result(moduli)
    real(wp), intent(in) :: young, poisson  !! [Pa], [-]
    real(wp) :: moduli(6)
    moduli = 0.0_wp
    moduli(1) = young*poisson/((1.0_wp + poisson)*(1.0_wp - 2.0_wp*poisson))
    moduli(2) = young/(2.0_wp*(1.0_wp + poisson))
  end function lame_moduli

  !> Eringen's moduli from G (or E), nu, l_t, l_b, N < 1 and Psi > 0.
  pure function eringen_moduli(t) result(moduli)
    type(technical_type), intent(in) :: t
    real(wp) :: moduli(6), g
    g = t%shear
    if (.not. g > 0.0_wp) g = t%young/(2.0_wp*(1.0_wp + t%poisson))
    moduli(3) = 2.0_wp*g*t%coupling**2/(1.0_wp - t%coupling**2)
    moduli(2) = g - 0.5_wp*moduli(3)
    moduli(1) = 2.0_wp*g*t%poisson/(1.0_wp - 2.0_wp*t%poisson)
    moduli(6) = 4.0_wp*g*t%length_bending**2
    moduli(5) = 2.0_wp*g*t%length_torsion**2 - moduli(6)
    moduli(4) = (moduli(5) + moduli(6))*(1.0_wp/t%polar_ratio - 1.0_wp)
  end function eringen_moduli

  !> The first inequality of a stored energy that is never negative which the moduli violate, with
  !! its value; '' if there is none. Eringen's mu itself may be negative.
  pure function violated_inequality(m) result(text)
    real(wp), intent(in) :: m(6)
    character(len=:), allocatable :: text
    real(wp) :: slack
    slack = round_off*maxval(abs(m(4:6)))  ! limits such as Psi = 3/2 are allowed
    text = ''
    if (.not. 3.0_wp*m(1) + 2.0_wp*m(2) + m(3) > 0.0_wp) then
      text = '3 lambda + 2 mu + kappa > 0 is violated: '// &
             str(3.0_wp*m(1) + 2.0_wp*m(2) + m(3))//' Pa'
    else if (.not. 2.0_wp*m(2) + m(3) > 0.0_wp) then
      text = '2 mu + kappa > 0 is violated: '//str(2.0_wp*m(2) + m(3))//' Pa'
    else if (.not. m(3) > 0.0_wp) then
      text = 'kappa > 0 is violated: '//str(m(3))//' Pa'
    else if (3.0_wp*m(4) + m(5) + m(6) < -slack) then
      text = '3 alpha + beta + gamma >= 0 is violated: '//str(3.0_wp*m(4) + m(5) + m(6))//' N'
    else if (m(5) - m(6) > slack) then
      text = 'beta <= gamma is violated: gamma - beta = '//str(m(6) - m(5))//' N'
    else if (m(5) + m(6) < -slack) then
      text = 'beta >= -gamma is violated: gamma + beta = '//str(m(6) + m(5))//' N'
    end if
  end function violated_inequality
end module fem_micropolar
