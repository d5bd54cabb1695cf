!> What the group &overlap of the coupled deck asks for, checked.
module cpl_overlap_choices
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  implicit none
  private
  public :: overlap_choices_type, read_overlap

  !> Names as in the deck; a box is given when its upper corner is above the lower.
  type :: overlap_choices_type
    logical :: given = .false.
    character(len=:), allocatable :: free_elements, ghost_elements  !! groups, '' none
    real(wp) :: free_box(6) = 0.0_wp, ghost_box(6) = 0.0_wp  !! lower and upper corner [m]
    character(len=:), allocatable :: rotation, projection, weights, scheme, partition
    real(wp) :: rho = 1.0_wp  !! relaxed over affine stiffness of the pack [-]
    character(len=:), allocatable :: mass   !! what happens to that of hat nodes
    character(len=:), allocatable :: ghost_contacts  !! when those between ghosts act
    real(wp) :: fine_damping = 0.0_wp  !! [1/s]
    real(wp) :: remap = 0.0_wp         !! share of an element; 0 never
    character(len=:), allocatable :: leaving  !! what happens when a free grain leaves
    character(len=:), allocatable :: micro_deformation  !! of nodes over free grains
    logical :: micro_deformation_given = .false.
    logical :: dead_load = .true.
    character(len=:), allocatable :: method
    logical :: bound = .false.         !! grains of the overlap are free and bound to the nodes
    character(len=:), allocatable :: multipliers
    real(wp) :: least_weight = 0.0_wp  !! of either side in the domain [-]
    real(wp) :: settled = 0.0_wp  !! static: rest / contact force at which a run has settled [-]
    character(len=:), allocatable :: initial, moduli, probe  !! probe: path of a file
  end type overlap_choices_type

contains

  !> Read &overlap; D420 not exactly one of facets and overlap, D421 elements.
  subroutine read_overlap(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(overlap_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors

    choices%given = deck%count('overlap') > 0
    if (choices%given .eqv. deck%count('facets') > 0) then
      if (choices%given) then
        call deck%fault(errors, 'D420', 'the deck has &facets and &overlap', 'overlap', 1, '', &
                        'a coupled run has one of them')
      else
        call errors%add('D420', 'the deck has neither &facets nor &overlap', deck%source%path, &
                        'ghosts ride on facets of the solid, or grains and mesh overlap')
      end if
      return
    end if
    if (.not. choices%given) return
    call read_elements(deck, 'free', choices%free_elements, choices%free_box, errors)
    call read_elements(deck, 'ghost', choices%ghost_elements, choices%ghost_box, errors)
    call deck%get('overlap', 1, 'rotation', choices%rotation)
    call deck%get('overlap', 1, 'micro_deformation', choices%micro_deformation)
    choices%micro_deformation_given = deck%given('overlap', 1, 'micro_deformation')
    call deck%get('overlap', 1, 'projection', choices%projection)
    call deck%get('overlap', 1, 'weights', choices%weights)
    call deck%get('overlap', 1, 'scheme', choices%scheme)
    call deck%get('overlap', 1, 'settled', choices%settled)
    if (deck%given('overlap', 1, 'settled') .and. choices%scheme /= 'static') &
      call deck%fault(errors, 'D421', "settled goes with scheme = 'static'", 'overlap', 1, &
                      'settled', 'leave it out')
    call deck%get('overlap', 1, 'partition', choices%partition)
    call deck%get('overlap', 1, 'rho', choices%rho)
    if (deck%given('overlap', 1, 'rho') .and. any(choices%partition == &
      [character(len=5) :: 'twice', 'share'])) &
      call deck%fault(errors, 'D443', "rho goes with ramps, not with partition = '"// &
                      choices%partition//"'", 'overlap', 1, 'rho', 'leave it out')
    call deck%get('overlap', 1, 'mass', choices%mass)
    if (choices%mass == 'auto' .and. choices%scheme == 'static') choices%mass = 'nearest'
    if (choices%mass == 'auto') choices%mass = trim(merge('consistent', 'projected ', &
      choices%weights == 'mass' .and. choices%projection == 'l2'))
    call deck%get('overlap', 1, 'ghost_contacts', choices%ghost_contacts)
    if (choices%ghost_contacts == 'exchange' .and. choices%scheme /= 'symmetric') &
      call deck%fault(errors, 'D421', "ghost_contacts = 'exchange' goes with the scheme "// &
                      "'symmetric'", 'overlap', 1, 'ghost_contacts', 'leave it out')
    call deck%get('overlap', 1, 'fine_damping', choices%fine_damping)
    if (choices%mass == 'consistent' .and. (choices%weights /= 'mass' .or. &
                                            choices%projection /= 'l2')) &
      call deck%fault(errors, 'D424', "mass = 'consistent' needs weights = 'mass' and "// &
                      "projection = 'l2'", 'overlap', 1, 'mass', "write mass = 'projected'")
    call deck%get('overlap', 1, 'remap', choices%remap)
    call deck%get('overlap', 1, 'leaving', choices%leaving)
    call deck%get('overlap', 1, 'initial', choices%initial)
    choices%dead_load = choices%initial == 'dead_load'
    call read_moduli(deck, choices, errors)
    call read_method(deck, choices, errors)
    if (deck%given('clock', 1, 'scheme')) &
      call deck%fault(errors, 'D421', 'scheme of &clock goes with &facets', 'clock', 1, 'scheme', &
                      'write it in &overlap')
  end subroutine read_overlap

  !> Which method, and what goes with it. D430 a key of the other method, D431 a choice that the
  !! bridging domain does not have.
  subroutine read_method(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(overlap_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors

    call deck%get('overlap', 1, 'method', choices%method)
    choices%bound = choices%method /= 'bridging_scale'
    call deck%get('overlap', 1, 'multipliers', choices%multipliers)
    call deck%get('overlap', 1, 'least_weight', choices%least_weight)
    if (choices%method /= 'bridging_domain') call idle('multipliers')
    if (choices%method /= 'penalty') then
      call idle('penalty')
      call idle('penalty_damping')
    end if
    if (.not. choices%bound) then
      call idle('least_weight')
      return
    end if
    call idle('mass')
    call idle('fine_damping')
    call idle('remap')
    call idle('leaving')
    call idle('ghost_contacts')
    if (choices%scheme /= 'symmetric') call missing('scheme', choices%scheme)
    if (choices%initial == 'stress') call missing('initial', choices%initial)
    if (choices%rotation == 'fixed' .or. choices%rotation == 'curl') &
      call missing('rotation', choices%rotation)

  contains

    subroutine idle(key)
      character(len=*), intent(in) :: key
      if (deck%given('overlap', 1, key)) call deck%fault(errors, 'D430', key//' has no meaning '// &
        "with method = '"//choices%method//"'", 'overlap', 1, key, 'leave it out')
    end subroutine idle

    subroutine missing(key, value)
      character(len=*), intent(in) :: key, value
      call deck%fault(errors, 'D431', key//" = '"//value//"' does not go with method = '"// &
                      choices%method//"'", 'overlap', 1, key, "leave it out, or write method = "// &
                      "'bridging_scale'")
    end subroutine missing
  end subroutine read_method

  !> Where the solid's moduli come from; D444 a file of probed moduli that is missing or idle.
  subroutine read_moduli(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(overlap_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    call deck%get('overlap', 1, 'moduli', choices%moduli)
    choices%probe = ''
    if (deck%given('overlap', 1, 'probe')) choices%probe = deck%path('overlap', 1, 'probe')
    if ((choices%moduli == 'probed') .eqv. len(choices%probe) > 0) return
    if (len(choices%probe) > 0) then
      call deck%fault(errors, 'D444', "probe goes with moduli = 'probed'", 'overlap', 1, 'probe', &
                      "write moduli = 'probed', or leave it out")
    else
      call deck%fault(errors, 'D444', "moduli = 'probed' needs a file of probed moduli", &
                      'overlap', 1, 'moduli', "write probe = '..._probe.json', which "// &
                      'talus-dem makes with &probe')
    end if
  end subroutine read_moduli

  !> A group, or a box, of the elements for one kind of grains.
  subroutine read_elements(deck, what, group, box, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: what
    character(len=:), allocatable, intent(out) :: group
    real(wp), intent(out) :: box(6)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: corners(:)
    logical :: by_group, by_box

    group = ''
    box = 0.0_wp
    by_group = deck%given('overlap', 1, what//'_elements')
    by_box = deck%given('overlap', 1, what//'_box')
    if (by_group .eqv. by_box) then
      call deck%fault(errors, 'D421', 'exactly one of '//what//'_elements and '//what// &
                      '_box is wanted', 'overlap', 1, '', 'name a volume group of the mesh, or '// &
                      'give the lower and the upper corner of a box')
      return
    end if
    if (by_group) then
      call deck%get('overlap', 1, what//'_elements', group)
      return
    end if
    call deck%get('overlap', 1, what//'_box', corners)
    if (size(corners) /= 6) return
    box = corners
    if (any(box(4:) <= box(:3))) &
      call deck%fault(errors, 'D421', 'the box has no inside: '//str(box), 'overlap', 1, &
                      what//'_box', 'give x y z of the lower corner, then of the upper one')
  end subroutine read_elements
end module cpl_overlap_choices
