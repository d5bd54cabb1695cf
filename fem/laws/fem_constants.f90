!> Constants that laws share, from the deck: those of isotropic and of Eringen's elasticity.
module fem_constants
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_micropolar, only: technical_type, eringen_moduli, lame_moduli, violated_inequality
  implicit none
  private
  public :: elastic_constants, shear_ratio, pressure_constants, polar_constants, given_or, eringen
  public :: technical

  character(len=*), parameter :: eringen(6) = [character(len=6) :: 'lambda', 'mu', 'kappa', &
    'alpha', 'beta', 'gamma']
  character(len=*), parameter :: technical(7) = [character(len=11) :: 'poisson', 'l_t', 'l_b', &
    'coupling', 'polar_ratio', 'shear', 'young']

contains

  !> Bulk modulus, its ratio to the shear modulus, and both as Lame's moduli.
  subroutine elastic_constants(deck, m, bulk, ratio, moduli)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: bulk, ratio, moduli(6)  !! [Pa], [-], [Pa]
    real(wp) :: young, poisson
    call deck%get('material', m, 'young', young)
    call deck%get('material', m, 'poisson', poisson)
    bulk = young/(3.0_wp*(1.0_wp - 2.0_wp*poisson))
    ratio = shear_ratio(poisson)
    moduli = lame_moduli(young, poisson)
  end subroutine elastic_constants

  !> Shear over bulk modulus.
  pure real(wp) function shear_ratio(poisson)
    real(wp), intent(in) :: poisson
    shear_ratio = 1.5_wp*(1.0_wp - 2.0_wp*poisson)/(1.0_wp + poisson)
  end function shear_ratio

  !> An optional constant, `usual` by default.
  real(wp) function given_or(deck, m, key, usual)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    character(len=*), intent(in) :: key
    real(wp), intent(in) :: usual
    given_or = usual
    if (deck%given('material', m, key)) call deck%get('material', m, key, given_or)
  end function given_or

  !> How stiffness grows with the pressure.
  subroutine pressure_constants(deck, m, exponent, reference, least)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: exponent, reference, least  !! [-], [Pa], [Pa]
    real(wp), parameter :: usual_least = 0.01_wp         !! least over reference pressure
    call deck%get('material', m, 'exponent', exponent)
    call deck%get('material', m, 'reference_pressure', reference)
    least = given_or(deck, m, 'least_pressure', usual_least*reference)
  end subroutine pressure_constants

  !> Eringen's moduli of material m, given as they are or by engineering constants; faults D320 of
  !! constants that are missing, D321 of values that give energy.
  subroutine polar_constants(deck, m, moduli, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: moduli(6)  !! [Pa, N]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i4) :: k, before
    before = errors%count
    if (any([(deck%given('material', m, trim(eringen(k))), k=1, 6)])) then
      call read_eringen(deck, m, moduli, errors)
    else
      call read_technical(deck, m, moduli, errors)
    end if
    if (errors%count > before) return
    text = violated_inequality(moduli)
    if (len(text) > 0) call deck%fault(errors, 'D321', text, 'material', m, 'id', &
      'these limits keep the stored energy positive; mu itself may be negative')
  end subroutine polar_constants

  !> The six constants of Eringen; all are needed and no others.
  subroutine read_eringen(deck, m, moduli, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: moduli(6)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    moduli = 0.0_wp
    do k = 1, 6
      if (deck%given('material', m, trim(eringen(k)))) then
        call deck%get('material', m, trim(eringen(k)), moduli(k))
      else
        call deck%fault(errors, 'D320', 'the constant '//trim(eringen(k))//' is missing', &
          'material', m, 'id', 'give lambda, mu, kappa, alpha, beta and gamma, all six')
      end if
    end do
    do k = 1, size(technical)
      if (deck%given('material', m, trim(technical(k)))) call deck%fault(errors, 'D320', &
        'the material has constants of both kinds', 'material', m, trim(technical(k)), &
        'give either lambda to gamma or the engineering constants')
    end do
  end subroutine read_eringen

  !> Engineering constants; N = 1 and Psi = 0 would need infinite moduli.
  subroutine read_technical(deck, m, moduli, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: moduli(6)
    type(error_list_type), intent(inout) :: errors
    type(technical_type) :: t
    integer(i4) :: k, before

    before = errors%count
    moduli = 0.0_wp
    do k = 1, 5
      if (.not. deck%given('material', m, trim(technical(k)))) call deck%fault(errors, 'D320', &
        'the constant '//trim(technical(k))//' is missing', 'material', m, 'id', &
        'give shear or young, poisson, l_t, l_b, coupling and polar_ratio; or lambda to gamma')
    end do
    if (deck%given('material', m, 'shear') .eqv. deck%given('material', m, 'young')) &
      call deck%fault(errors, 'D320', 'a micropolar solid needs shear or young, one of them', &
                      'material', m, 'id', 'G = mu + kappa/2, E = 2 G (1 + nu)')
    call deck%get('material', m, 'shear', t%shear)
    call deck%get('material', m, 'young', t%young)
    call deck%get('material', m, 'poisson', t%poisson)
    call deck%get('material', m, 'l_t', t%length_torsion)
    call deck%get('material', m, 'l_b', t%length_bending)
    call deck%get('material', m, 'coupling', t%coupling)
    call deck%get('material', m, 'polar_ratio', t%polar_ratio)
    if (errors%count > before) return
    if (t%coupling >= 1.0_wp .or. t%coupling < 0.0_wp) &
      call deck%fault(errors, 'D321', 'the coupling number N must be in [0, 1), not '// &
        str(t%coupling), 'material', m, 'coupling', &
        'N = 1 means an infinite kappa (couple stress theory): N = 0.99 comes close to it')
    if (.not. t%polar_ratio > 0.0_wp .or. t%polar_ratio > 1.5_wp) &
      call deck%fault(errors, 'D321', 'the polar ratio Psi must be in (0, 3/2], not '// &
        str(t%polar_ratio), 'material', m, 'polar_ratio', &
        'Psi = 0 means an infinite alpha: Psi = 0.01 comes close to it')
    if (errors%count == before) moduli = eringen_moduli(t)
  end subroutine read_technical
end module fem_constants
