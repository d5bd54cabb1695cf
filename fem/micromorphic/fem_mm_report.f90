!> Checks of a micromorphic solid before use: eigenvalues of the stored energy, the inequalities of
!! isotropic strains by name, the moduli of its limits, surfaces that call for a warning.
module fem_mm_report
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dsyev
  use talus_text, only: str
  use fem_mm_elastic, only: mm_elastic_type, mm_strain_type, mm_dual_type, duals, couple
  use fem_mm_cones, only: kind_cone, kind_ellipse
  use fem_mm_flow, only: mm_law_type
  use fem_mm_tensor, only: identity
  implicit none
  private
  public :: strain_form, gradient_form, eigenvalues, energy_warning, micropolar_limit
  public :: homogeneous_limit, uniform_limit, flow_warning, held_warning, inertia_warning

  real(wp), parameter :: round_off = 1.0e-12_wp

contains

  !> Matrix (15, 15) [Pa] of the energy in E (11 22 33, sqrt(2) times 12 13 23) and e (9).
  pure function strain_form(law) result(form)
    type(mm_elastic_type), intent(in) :: law
    real(wp) :: form(15, 15)
    type(mm_dual_type) :: dual
    type(mm_strain_type) :: strain
    real(wp) :: unit(15)
    integer(i4) :: k
    do k = 1, 15
      unit = 0.0_wp
      unit(k) = 1.0_wp
      strain%c = identity + 2.0_wp*symmetric(unit(:6))
      strain%psi = identity + reshape(unit(7:), [3, 3])
      dual = duals(law, strain)
      form(:3, k) = [dual%e(1, 1), dual%e(2, 2), dual%e(3, 3)]
      form(4:6, k) = sqrt(2.0_wp)*[dual%e(1, 2), dual%e(1, 3), dual%e(2, 3)]
      form(7:, k) = reshape(dual%p, [9])
    end do
  end function strain_form

  !> Symmetric matrix of six numbers, with the norm of the vector.
  pure function symmetric(v) result(a)
    real(wp), intent(in) :: v(6)
    real(wp) :: a(3, 3)
    real(wp), parameter :: half = sqrt(0.5_wp)
    a = reshape([v(1), half*v(4), half*v(5), half*v(4), v(2), half*v(6), half*v(5), half*v(6), &
                 v(3)], [3, 3])
  end function symmetric

  !> Matrix (27, 27) [N] of the energy in Gamma, the first index running fastest.
  pure function gradient_form(law) result(form)
    type(mm_elastic_type), intent(in) :: law
    real(wp) :: form(27, 27), unit(27)
    integer(i4) :: k
    do k = 1, 27
      unit = 0.0_wp
      unit(k) = 1.0_wp
      form(:, k) = reshape(couple(law, reshape(unit, [3, 3, 3])), [27])
    end do
  end function gradient_form

  !> Eigenvalues of a symmetric matrix, rising.
  function eigenvalues(form) result(value)
    real(wp), intent(in) :: form(:, :)
    real(wp) :: value(size(form, 1))
    real(wp) :: a(size(form, 1), size(form, 1)), work(8*size(form, 1))
    integer(i4) :: info
    a = form
    call dsyev('N', 'U', size(a, 1), a, size(a, 1), value, work, size(work), info)
    if (info /= 0) error stop 'bug: eigenvalues of the stored energy'
  end function eigenvalues

  !> Why the stored energy could be negative, '' if it could not: the least eigenvalue and the
  !! inequalities violated. Such moduli are in use; they are warned of, not refused.
  function energy_warning(law) result(text)
    type(mm_elastic_type), intent(in) :: law
    character(len=:), allocatable :: text
    real(wp) :: of_strain(15), of_gradient(27), shear, bulk
    of_strain = eigenvalues(strain_form(law))
    of_gradient = eigenvalues(gradient_form(law))
    text = ''
    if (of_strain(1) < -round_off*of_strain(15)) &
      text = 'least eigenvalue in E and e '//str(of_strain(1))//' Pa'
    if (of_gradient(1) < -round_off*of_gradient(27)) then
      if (len(text) > 0) text = text//'; '
      text = text//'least eigenvalue in Gamma '//str(of_gradient(1))//' N'
    end if
    shear = law%kappa + law%nu - 2.0_wp*law%sigma
    bulk = law%kappa + law%nu + 3.0_wp*law%eta - 3.0_wp*law%tau - 2.0_wp*law%sigma
    call note(law%kappa - law%nu, 'kappa > nu', text)
    call note(law%mu, 'mu > 0', text)
    call note(shear, 'kappa + nu > 2 sigma', text)
    call note(law%mu*shear - 2.0_wp*law%sigma**2, 'mu (kappa + nu - 2 sigma) > 2 sigma^2', text)
    call note(3.0_wp*law%lambda + 2.0_wp*law%mu, '3 lambda + 2 mu > 0', text)
    call note(bulk, 'kappa + nu + 3 eta > 3 tau + 2 sigma', text)
    call note(bulk*(3.0_wp*law%lambda + 2.0_wp*law%mu) &
      - (3.0_wp*law%tau + 2.0_wp*law%sigma)**2, '(kappa + nu + 3 eta - 3 tau - 2 sigma) '// &
      '(3 lambda + 2 mu) > (3 tau + 2 sigma)^2', text)
  end function energy_warning

  !> W304 where the potential of an ellipse is so steep that flow could give energy, '' elsewhere.
  pure function flow_warning(law) result(text)
    type(mm_law_type), intent(in) :: law
    character(len=:), allocatable :: text
    real(wp), parameter :: most = sqrt(2.0_wp)
    text = ''
    if (any(law%cone%kind == kind_ellipse .and. law%cone%slope_flow > most*law%cone%slope)) &
      text = 'W304'//': flow_slope of an ellipse is more than sqrt(2) times critical_slope: '// &
      'between the critical state and p = 0 plastic flow can give energy'
  end function flow_warning

  !> W305 where a closed macro-surface is to relieve a point whose chi is held, '' elsewhere.
  pure function held_warning(law, held) result(text)
    type(mm_law_type), intent(in) :: law
    logical, intent(in) :: held
    character(len=:), allocatable :: text
    text = ''
    if (.not. (held .and. law%cone(1)%on .and. law%cone(1)%kind /= kind_cone)) return
    if (law%cone(2)%on .or. all([law%elastic%eta, law%elastic%tau, law%elastic%kappa, &
                                 law%elastic%nu, law%elastic%sigma] == 0.0_wp)) return
    text = 'W305'//': only the macro-surface yields where chi is held: stress that chi carries '// &
      'goes on growing past the critical state; give the solid a surface of level micro too, '// &
      'or leave chi free'
  end function held_warning

  !> W306 where grains break in motion, '' elsewhere: the micro-inertia does not change.
  pure function inertia_warning(law, massive) result(text)
    type(mm_law_type), intent(in) :: law
    logical, intent(in) :: massive
    character(len=:), allocatable :: text
    text = ''
    if (massive .and. law%breaks) text = 'W306'//': the micro-inertia stays that of whole '// &
      'grains; of broken ones it would be '//str(1.0_wp - law%theta(3))//' of it'
  end function inertia_warning

  subroutine note(value, name, text)
    real(wp), intent(in) :: value
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(inout) :: text
    if (value >= 0.0_wp) return
    if (len(text) > 0) text = text//'; '
    text = text//name//' is violated by '//str(-value)
  end subroutine note

  !> Moduli of the micropolar solid that chi = rotation gives at small strains, as in
  !! `fem_micropolar`: lambda mu kappa [Pa], alpha beta gamma [N].
  pure function micropolar_limit(law) result(moduli)
    type(mm_elastic_type), intent(in) :: law
    real(wp) :: moduli(6)
    real(wp) :: one, sheared, both
    moduli(1) = law%lambda + law%eta + law%tau
    moduli(2) = law%mu + law%sigma + law%nu
    moduli(3) = law%kappa - law%nu
    one = curvature_energy(law, reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                                         0.0_wp, 0.0_wp], [3, 3]))
    sheared = curvature_energy(law, reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
                                             0.0_wp, 0.0_wp, 0.0_wp], [3, 3]))
    both = curvature_energy(law, reshape([0.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
                                          0.0_wp, 0.0_wp, 0.0_wp], [3, 3]))
    moduli(6) = 2.0_wp*sheared
    moduli(5) = both - moduli(6)
    moduli(4) = 2.0_wp*one - moduli(5) - moduli(6)
  end function micropolar_limit

  !> Energy of phi_k,l = a(k, l), with Gamma_KLM = e_KNL phi_N,M.
  pure real(wp) function curvature_energy(law, a)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(in) :: a(3, 3)
    real(wp) :: gamma(3, 3, 3)
    integer(i4) :: k, l, n
    gamma = 0.0_wp
    do n = 1, 3
      l = mod(n, 3) + 1
      k = mod(n + 1, 3) + 1
      gamma(k, l, :) = a(n, :)
      gamma(l, k, :) = -a(n, :)
    end do
    curvature_energy = 0.5_wp*sum(gamma*couple(law, gamma))
  end function curvature_energy

  !> Shear and bulk modulus [Pa] at small strains where chi is free and homogeneous.
  pure function homogeneous_limit(law) result(moduli)
    type(mm_elastic_type), intent(in) :: law
    real(wp) :: moduli(2)
    moduli(1) = law%mu - 2.0_wp*law%sigma**2/(law%kappa + law%nu - 2.0_wp*law%sigma)
    moduli(2) = (3.0_wp*law%lambda + 2.0_wp*law%mu - (3.0_wp*law%tau + 2.0_wp*law%sigma)**2 &
      /(law%kappa + law%nu + 3.0_wp*law%eta - 3.0_wp*law%tau - 2.0_wp*law%sigma))/3.0_wp
  end function homogeneous_limit

  !> Eringen's six moduli with which a micropolar solid is as stiff in uniform strain, where chi is
  !! free, and in rotations of chi: lambda mu kappa [Pa], alpha beta gamma [N].
  pure function uniform_limit(law) result(moduli)
    type(mm_elastic_type), intent(in) :: law
    real(wp) :: moduli(6), free(2)
    moduli = micropolar_limit(law)
    free = [law%mu, law%lambda + 2.0_wp/3.0_wp*law%mu]
    if (law%kappa + law%nu > 2.0_wp*law%sigma .and. law%kappa + law%nu + 3.0_wp*law%eta > &
        3.0_wp*law%tau + 2.0_wp*law%sigma) free = homogeneous_limit(law)
    moduli(1) = free(2) - 2.0_wp/3.0_wp*free(1)
    moduli(2) = free(1) - 0.5_wp*moduli(3)
  end function uniform_limit
end module fem_mm_report
