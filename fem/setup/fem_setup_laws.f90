!> Which keys of &material belong to which law.
module fem_setup_laws
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  implicit none
  private
  public :: check_law_keys

  character(len=*), parameter :: keys(24) = [character(len=18) :: 'exponent', &
    'reference_pressure', 'least_pressure', 'cohesion', 'friction_deg', 'dilation_deg', 'cone', &
    'hardening', 'residual_cohesion', 'critical_slope', 'compression_index', 'swelling_index', &
    'specific_volume', 'preconsolidation', 'overconsolidation', 'young', 'layer_thickness', &
    'joint_normal', 'joint_shear', 'layer_normal', 'spin_modulus', 'layer_moduli', &
    'plastic_length', 'invariant']
  character(len=*), parameter :: pressures = 'pressure_elastic micropolar_pressure'
  character(len=*), parameter :: cones = 'drucker_prager micropolar_drucker_prager'
  character(len=*), parameter :: owner(24) = [character(len=150) :: pressures, pressures, &
    pressures, cones, cones, cones, cones, cones, cones, 'cam_clay', &
    'cam_clay', 'cam_clay', 'cam_clay', 'cam_clay', 'cam_clay', 'linear_elastic '// &
    'pressure_elastic drucker_prager micropolar micropolar_drucker_prager layered neo_hookean '// &
    'st_venant_kirchhoff micropolar_pressure', 'layered', 'layered', 'layered', 'layered', &
    'layered', 'layered', 'micropolar_drucker_prager', 'micropolar_drucker_prager']
  character(len=*), parameter :: laws(8) = [character(len=25) :: 'pressure_elastic', &
    'drucker_prager', 'cam_clay', 'neo_hookean', 'st_venant_kirchhoff', &
    'micropolar_drucker_prager', 'layered', 'micropolar_pressure']
  character(len=*), parameter :: needed(8) = [character(len=80) :: &
    'young poisson exponent reference_pressure', 'young poisson cohesion friction_deg', &
    'poisson critical_slope compression_index swelling_index specific_volume', &
    'young poisson', 'young poisson', 'cohesion friction_deg plastic_length', &
    'young poisson layer_thickness joint_normal joint_shear', &
    'exponent reference_pressure']

contains

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
end module fem_setup_laws
