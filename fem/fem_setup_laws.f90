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
  use fem_law_pressure, only: fem_law_pressure_type
  implicit none
  private
  public :: read_law, has_state, check_law_keys

  character(len=*), parameter :: keys(22) = [character(len=18) :: 'exponent', &
    'reference_pressure', 'least_pressure', 'cohesion', 'friction_deg', 'dilation_deg', 'cone', &
    'hardening', 'residual_cohesion', 'critical_slope', 'compression_index', 'swelling_index', &
    'specific_volume', 'preconsolidation', 'overconsolidation', 'young', 'layer_thickness', &
    'joint_normal', 'joint_shear', 'layer_normal', 'spin_modulus', 'layer_moduli']
  character(len=*), parameter :: owner(22) = [character(len=100) :: 'pressure_elastic', &
    'pressure_elastic', 'pressure_elastic', 'drucker_prager', 'drucker_prager', &
    'drucker_prager', 'drucker_prager', 'drucker_prager', 'drucker_prager', 'cam_clay', &
    'cam_clay', 'cam_clay', 'cam_clay', 'cam_clay', 'cam_clay', 'linear_elastic '// &
    'pressure_elastic drucker_prager micropolar layered neo_hookean st_venant_kirchhoff', &
    'layered', 'layered', 'layered', 'layered', 'layered', 'layered']
  character(len=*), parameter :: laws(6) = [character(len=19) :: 'pressure_elastic', &
    'drucker_prager', 'cam_clay', 'neo_hookean', 'st_venant_kirchhoff', 'layered']
  integer(i4), parameter :: stateful = 5  !! the first of them have a state
  character(len=*), parameter :: needed(6) = [character(len=80) :: &
    'young poisson exponent reference_pressure', 'young poisson cohesion friction_deg', &
    'poisson critical_slope compression_index swelling_index specific_volume', &
    'young poisson', 'young poisson', &
    'young poisson layer_thickness joint_normal joint_shear']

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
  subroutine read_law(deck, m, box, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
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

  !> Faults D331: flow that gives energy, a cone without strength, softening faster than elastic
  !! unloading.
  subroutine read_drucker(deck, m, box, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_law_box_type), intent(inout) :: box
    type(error_list_type), intent(inout) :: errors
    type(fem_law_drucker_type) :: law
    character(len=:), allocatable :: cone
    real(wp) :: ratio, friction, dilation, stiff
    real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
    integer(i4) :: place

    call elastic_constants(deck, m, law%bulk, ratio)
    law%shear = ratio*law%bulk
    call deck%get('material', m, 'friction_deg', friction)
    call deck%get('material', m, 'dilation_deg', dilation)
    call deck%get('material', m, 'cohesion', law%cohesion)
    call deck%get('material', m, 'hardening', law%hardening)
    call deck%get('material', m, 'residual_cohesion', law%residual)
    call deck%get('material', m, 'cone', cone)
    place = -1
    if (cone == 'plane_strain') place = 0
    if (cone == 'extension') place = 1
    if (dilation > friction) call deck%fault(errors, 'D331', 'dilation_deg = '//str(dilation)// &
      ' is above friction_deg = '//str(friction), 'material', m, 'dilation_deg', &
      'plastic flow would give energy: equal angles are the limit')
    if (.not. (friction > 0.0_wp .or. law%cohesion > 0.0_wp)) call deck%fault(errors, 'D331', &
      'the material has neither friction nor cohesion', 'material', m, 'cohesion', &
      'give one of both')
    call cone_constants(friction*degree, dilation*degree, place, law%a, law%b)
    call cone_constants(dilation*degree, dilation*degree, place, law%a_flow, law%b_flow)
    stiff = 2.0_wp*law%shear + law%bulk*law%b*law%b_flow
    if (.not. stiff + law%a*law%a_flow*law%hardening > 0.0_wp) call deck%fault(errors, 'D331', &
      'hardening = '//str(law%hardening)//' Pa softens faster than elastic unloading', &
      'material', m, 'hardening', 'no increment would converge: it must be above '// &
      str(-stiff/(law%a*law%a_flow))//' Pa')
    if (law%residual > law%cohesion) call deck%fault(errors, 'D331', 'residual_cohesion = '// &
      str(law%residual)//' Pa is above cohesion = '//str(law%cohesion)//' Pa', 'material', m, &
      'residual_cohesion', 'it is what softening leaves')
    law%symmetric = abs(law%b - law%b_flow) <= 0.0_wp
    law%states = law%states + 1
    box%law = law
  end subroutine read_drucker

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
