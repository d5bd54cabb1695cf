!> Materials with a state of their own from the deck: constants, and whether they can work.
module fem_setup_laws
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_law, only: fem_law_box_type
  use fem_law_clay, only: fem_law_clay_type
  use fem_law_drucker, only: fem_law_drucker_type, cone_constants
  use fem_law_finite, only: fem_law_finite_type, finite_states, kirchhoff, neo_hookean
  use fem_law_linear, only: fem_law_linear_type
  use fem_law_polar, only: fem_law_polar_type, polar_states
  use fem_law_pressure, only: fem_law_pressure_type
  use fem_polar, only: eringen_families
  implicit none
  private
  public :: read_law, has_state, check_law_keys

  character(len=*), parameter :: keys(24) = [character(len=18) :: 'exponent', &
    'reference_pressure', 'least_pressure', 'cohesion', 'friction_deg', 'dilation_deg', 'cone', &
    'hardening', 'residual_cohesion', 'critical_slope', 'compression_index', 'swelling_index', &
    'specific_volume', 'preconsolidation', 'overconsolidation', 'young', 'layer_thickness', &
    'joint_normal', 'joint_shear', 'layer_normal', 'spin_modulus', 'layer_moduli', &
    'plastic_length', 'invariant']
  character(len=*), parameter :: cones = 'drucker_prager micropolar_drucker_prager'
  character(len=*), parameter :: owner(24) = [character(len=130) :: 'pressure_elastic', &
    'pressure_elastic', 'pressure_elastic', cones, cones, cones, cones, cones, cones, 'cam_clay', &
    'cam_clay', 'cam_clay', 'cam_clay', 'cam_clay', 'cam_clay', 'linear_elastic '// &
    'pressure_elastic drucker_prager micropolar micropolar_drucker_prager layered neo_hookean '// &
    'st_venant_kirchhoff', 'layered', 'layered', 'layered', 'layered', 'layered', 'layered', &
    'micropolar_drucker_prager', 'micropolar_drucker_prager']
  character(len=*), parameter :: laws(7) = [character(len=25) :: 'pressure_elastic', &
    'drucker_prager', 'cam_clay', 'neo_hookean', 'st_venant_kirchhoff', &
    'micropolar_drucker_prager', 'layered']
  real(wp), parameter :: round_off = 1.0e-12_wp
  integer(i4), parameter :: stateful = 6  !! the first of them have a state
  character(len=*), parameter :: needed(7) = [character(len=80) :: &
    'young poisson exponent reference_pressure', 'young poisson cohesion friction_deg', &
    'poisson critical_slope compression_index swelling_index specific_volume', &
    'young poisson', 'young poisson', 'cohesion friction_deg plastic_length', &
    'young poisson layer_thickness joint_normal joint_shear']

  !> What the cones of classical and micropolar Drucker-Prager share.
  type :: cone_type
    real(wp) :: a = 0.0_wp, b = 0.0_wp, a_flow = 0.0_wp, b_flow = 0.0_wp  !! [-]
    real(wp) :: cohesion = 0.0_wp, hardening = 0.0_wp, residual = 0.0_wp  !! [Pa]
  end type cone_type

contains

  !> Is a law of the deck one with a state?
  pure logical function has_state(law)
    character(len=*), intent(in) :: law
    has_state = any(laws(:stateful) == law)
  end function has_state

  !> Fault D330 for keys that the law of material m does not know, and for those that it misses.
  subroutine check_law_keys(deck, m, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    character(len=*), intent(in) :: law
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: list
    integer(i4) :: k, first, last
    list = ''
    do k = 1, size(keys)
      if (.not. deck%given('material', m, trim(keys(k)))) cycle
      if (index(' '//trim(owner(k))//' ', ' '//law//' ') > 0) cycle
      call deck%fault(errors, 'D330', trim(keys(k))//" means nothing to law = '"//law//"'", &
        'material', m, trim(keys(k)), 'it belongs to: '//trim(owner(k)))
    end do
    do k = 1, size(laws)
      if (laws(k) == law) list = trim(needed(k))//' '
    end do
    first = 1
    do while (first < len(list))
      last = first + index(list(first:), ' ') - 2
      if (.not. deck%given('material', m, list(first:last))) call deck%fault(errors, 'D330', &
        'the constant '//list(first:last)//' is missing', 'material', m, 'id', &
        "law = '"//law//"' needs "//list)
      first = last + 2
    end do
  end subroutine check_law_keys

  !> The law of material m of the deck, whose keys were checked; linear elasticity as a law too.
  subroutine read_law(deck, m, moduli, box, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(in) :: moduli(6)  !! of the material, as in fem_micropolar [Pa, N]
    type(fem_law_box_type), intent(inout) :: box
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: law, id
    call deck%get('material', m, 'law', law)
    call deck%get('material', m, 'id', id)
    select case (law)
    case ('pressure_elastic')
      call read_pressure(deck, m, box)
    case ('drucker_prager')
      call read_drucker(deck, m, box, errors)
    case ('micropolar', 'micropolar_drucker_prager')
      call read_polar(deck, m, moduli, law == 'micropolar', box, errors)
    case ('cam_clay')
      call read_clay(deck, m, box, errors)
    case ('neo_hookean')
      call read_finite(deck, m, neo_hookean, box)
    case ('st_venant_kirchhoff')
      call read_finite(deck, m, kirchhoff, box)
    case default
      call read_linear(deck, m, box)
    end select
    box%law%id = id
  end subroutine read_law

  !> Bulk modulus and its ratio to the shear modulus.
  subroutine elastic_constants(deck, m, bulk, ratio)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: bulk, ratio
    real(wp) :: young, poisson
    call deck%get('material', m, 'young', young)
    call deck%get('material', m, 'poisson', poisson)
    bulk = young/(3.0_wp*(1.0_wp - 2.0_wp*poisson))
    ratio = 1.5_wp*(1.0_wp - 2.0_wp*poisson)/(1.0_wp + poisson)
  end subroutine elastic_constants

  subroutine read_linear(deck, m, box)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_law_box_type), intent(inout) :: box
    type(fem_law_linear_type) :: law
    real(wp) :: ratio
    call elastic_constants(deck, m, law%bulk, ratio)
    law%shear = ratio*law%bulk
    box%law = law
  end subroutine read_linear

  subroutine read_finite(deck, m, kind, box)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m, kind
    type(fem_law_box_type), intent(inout) :: box
    type(fem_law_finite_type) :: law
    real(wp) :: bulk, ratio
    call elastic_constants(deck, m, bulk, ratio)
    law%kind = kind
    law%mu = ratio*bulk
    law%lambda = bulk - 2.0_wp/3.0_wp*law%mu
    law%finite = .true.
    law%states = finite_states
    box%law = law
  end subroutine read_finite

  subroutine read_pressure(deck, m, box)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_law_box_type), intent(inout) :: box
    type(fem_law_pressure_type) :: law
    real(wp), parameter :: usual_least = 0.01_wp  !! of the reference pressure
    call elastic_constants(deck, m, law%bulk, law%ratio)
    call deck%get('material', m, 'exponent', law%exponent)
    call deck%get('material', m, 'reference_pressure', law%reference)
    law%least = usual_least*law%reference
    if (deck%given('material', m, 'least_pressure')) &
      call deck%get('material', m, 'least_pressure', law%least)
    law%symmetric = .false.
    box%law = law
  end subroutine read_pressure

  subroutine read_drucker(deck, m, box, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_law_box_type), intent(inout) :: box
    type(error_list_type), intent(inout) :: errors
    type(fem_law_drucker_type) :: law
    type(cone_type) :: cone
    real(wp) :: ratio

    call elastic_constants(deck, m, law%bulk, ratio)
    law%shear = ratio*law%bulk
    call read_cone(deck, m, 2.0_wp*law%shear, law%bulk, cone, errors)
    law%a = cone%a
    law%b = cone%b
    law%a_flow = cone%a_flow
    law%b_flow = cone%b_flow
    law%cohesion = cone%cohesion
    law%hardening = cone%hardening
    law%residual = cone%residual
    law%symmetric = abs(law%b - law%b_flow) <= 0.0_wp
    law%states = law%states + 1
    box%law = law
  end subroutine read_drucker

  !> Eringen's solid (`elastic`), or that with a yield surface.
  subroutine read_polar(deck, m, moduli, elastic, box, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(in) :: moduli(6)
    logical, intent(in) :: elastic
    type(fem_law_box_type), intent(inout) :: box
    type(error_list_type), intent(inout) :: errors
    type(fem_law_polar_type) :: law
    type(cone_type) :: cone
    real(wp), allocatable :: share(:)
    real(wp) :: length

    law%modulus_of = eringen_families(moduli)
    law%plastic = .not. elastic
    law%polar = .true.
    law%states = polar_states
    if (law%plastic) then
      call deck%get('material', m, 'plastic_length', length)
      call deck%get('material', m, 'invariant', share)
      if (abs(share(1) + share(2) - 0.5_wp) > round_off .or. share(2) > share(1) + round_off .or. &
          share(3) < 0.0_wp) call deck%fault(errors, 'D331', 'invariant = '//str(share(1))//', '// &
        str(share(2))//', '//str(share(3))//' is no measure of shear', 'material', m, &
        'invariant', 'a1 + a2 = 1/2 leaves classical states as they are, and a1 >= a2, a3 >= 0')
      law%weight_of = [1.0_wp, 2.0_wp*max(0.0_wp, share(1) - share(2)), 0.0_wp, &
                       2.0_wp*share(3)/length**2*[1.0_wp, 1.0_wp, 1.0_wp]]
      call read_cone(deck, m, law%modulus_of(1), law%modulus_of(3)/3.0_wp, cone, errors)
      law%a = cone%a
      law%b = cone%b
      law%a_flow = cone%a_flow
      law%b_flow = cone%b_flow
      law%cohesion = cone%cohesion
      law%hardening = cone%hardening
      law%residual = cone%residual
    end if
    law%symmetric = abs(law%b - law%b_flow) <= 0.0_wp
    box%law = law
  end subroutine read_polar

  !> Faults D331: flow that gives energy, a cone without strength, softening faster than the elastic
  !! unloading of `stiff` + K B B_psi.
  subroutine read_cone(deck, m, stiff, bulk, cone, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(in) :: stiff, bulk  !! [Pa]
    type(cone_type), intent(out) :: cone
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: shape
    real(wp) :: friction, dilation, least
    real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
    integer(i4) :: place

    call deck%get('material', m, 'friction_deg', friction)
    call deck%get('material', m, 'dilation_deg', dilation)
    call deck%get('material', m, 'cohesion', cone%cohesion)
    call deck%get('material', m, 'hardening', cone%hardening)
    call deck%get('material', m, 'residual_cohesion', cone%residual)
    call deck%get('material', m, 'cone', shape)
    place = -1
    if (shape == 'plane_strain') place = 0
    if (shape == 'extension') place = 1
    if (dilation > friction) call deck%fault(errors, 'D331', 'dilation_deg = '//str(dilation)// &
      ' is above friction_deg = '//str(friction), 'material', m, 'dilation_deg', &
      'plastic flow would give energy: equal angles are the limit')
    if (.not. (friction > 0.0_wp .or. cone%cohesion > 0.0_wp)) call deck%fault(errors, 'D331', &
      'the material has neither friction nor cohesion', 'material', m, 'cohesion', &
      'give one of both')
    call cone_constants(friction*degree, dilation*degree, place, cone%a, cone%b)
    call cone_constants(dilation*degree, dilation*degree, place, cone%a_flow, cone%b_flow)
    least = -(stiff + bulk*cone%b*cone%b_flow)/(cone%a*cone%a_flow)
    if (.not. cone%hardening > least) call deck%fault(errors, 'D331', &
      'hardening = '//str(cone%hardening)//' Pa softens faster than elastic unloading', &
      'material', m, 'hardening', 'no increment would converge: it must be above '//str(least)// &
      ' Pa')
    if (cone%residual > cone%cohesion) call deck%fault(errors, 'D331', 'residual_cohesion = '// &
      str(cone%residual)//' Pa is above cohesion = '//str(cone%cohesion)//' Pa', 'material', m, &
      'residual_cohesion', 'it is what softening leaves')
  end subroutine read_cone

  subroutine read_clay(deck, m, box, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_law_box_type), intent(inout) :: box
    type(error_list_type), intent(inout) :: errors
    type(fem_law_clay_type) :: law
    real(wp) :: lambda, kappa, volume, poisson

    call deck%get('material', m, 'critical_slope', law%slope)
    call deck%get('material', m, 'compression_index', lambda)
    call deck%get('material', m, 'swelling_index', kappa)
    call deck%get('material', m, 'specific_volume', volume)
    call deck%get('material', m, 'poisson', poisson)
    if (deck%given('material', m, 'overconsolidation')) &
      call deck%get('material', m, 'overconsolidation', law%overconsolidation)
    if (deck%given('material', m, 'preconsolidation')) &
      call deck%get('material', m, 'preconsolidation', law%preconsolidation)
    if (.not. lambda > kappa) call deck%fault(errors, 'D331', 'compression_index = '// &
      str(lambda)//' is not above swelling_index = '//str(kappa), 'material', m, &
      'compression_index', 'the virgin line is steeper than the swelling lines')
    law%swelling = kappa/volume
    law%plastic = (lambda - kappa)/volume
    law%ratio = 1.5_wp*(1.0_wp - 2.0_wp*poisson)/(1.0_wp + poisson)
    law%symmetric = .false.
    law%states = law%states + 1
    box%law = law
  end subroutine read_clay
end module fem_setup_laws
