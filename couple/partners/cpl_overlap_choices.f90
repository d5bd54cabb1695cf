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
    character(len=:), allocatable :: mass   !! what happens to that of prescribed nodes
    character(len=:), allocatable :: ghost_contacts  !! when those between ghosts act
    real(wp) :: fine_damping = 0.0_wp  !! [1/s]
    real(wp) :: remap = 0.0_wp         !! share of an element; 0 never
    character(len=:), allocatable :: leaving  !! what happens when a free grain leaves
    character(len=:), allocatable :: micro_deformation  !! of nodes over free grains
    logical :: micro_deformation_given = .false.
    logical :: dead_load = .true.
    logical :: free_rim = .false.      !! no node follows the free grains
    character(len=:), allocatable :: method
    logical :: bound = .false.         !! grains of the overlap are free and bound to the nodes
    character(len=:), allocatable :: multipliers
    real(wp) :: least_weight = 0.0_wp  !! of either side in the domain [-]
    real(wp) :: settled = 0.0_wp  !! static: rest / contact force at which a run has settled [-]
    character(len=:), allocatable :: initial, moduli, probe  !! probe: path of a file
  end type overlap_choices_type

contains

  !> Read &overlap; D420 not exactly one of facets and overlap, D421 a box or a scheme.
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
                        'ghosts on facets of the solid, or grains and mesh overlap')
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
    call deck%get('overlap', 1, 'partition', choices%partition)
    call deck%get('overlap', 1, 'rho', choices%rho)
    call deck%get('overlap', 1, 'mass', choices%mass)
    if (choices%mass == 'auto' .and. choices%scheme == 'static') choices%mass = 'nearest'
    if (choices%mass == 'auto') choices%mass = trim(merge('consistent', 'projected ', &
      choices%weights == 'mass' .and. choices%projection == 'l2'))
    call deck%get('overlap', 1, 'ghost_contacts', choices%ghost_contacts)
    call deck%get('overlap', 1, 'fine_damping', choices%fine_damping)
    call deck%get('overlap', 1, 'remap', choices%remap)
    call deck%get('overlap', 1, 'leaving', choices%leaving)
    call deck%get('overlap', 1, 'initial', choices%initial)
    choices%dead_load = choices%initial == 'dead_load'
    call read_rim(deck, choices)
    call read_moduli(deck, choices)
    call read_method(deck, choices)
    if (deck%given('clock', 1, 'scheme')) &
      call deck%fault(errors, 'D421', 'scheme of &clock goes with &facets', 'clock', 1, 'scheme', &
                      'write it in &overlap')
  end subroutine read_overlap

  !> Which method, and what goes with it.
  subroutine read_method(deck, choices)
    type(deck_type), intent(in) :: deck
    type(overlap_choices_type), intent(inout) :: choices

    call deck%get('overlap', 1, 'method', choices%method)
    choices%bound = choices%method /= 'bridging_scale'
    call deck%get('overlap', 1, 'multipliers', choices%multipliers)
    call deck%get('overlap', 1, 'least_weight', choices%least_weight)
  end subroutine read_method

  !> Whether nodes follow the free grains: where none does no mass goes to a grain.
  subroutine read_rim(deck, choices)
    type(deck_type), intent(in) :: deck
    type(overlap_choices_type), intent(inout) :: choices
    character(len=:), allocatable :: rim
    call deck%get('overlap', 1, 'rim_nodes', rim)
    choices%free_rim = rim == 'free'
    if (choices%free_rim) choices%mass = 'projected'
  end subroutine read_rim

  !> Where the solid's moduli come from.
  subroutine read_moduli(deck, choices)
    type(deck_type), intent(in) :: deck
    type(overlap_choices_type), intent(inout) :: choices
    call deck%get('overlap', 1, 'moduli', choices%moduli)
    choices%probe = ''
    if (deck%given('overlap', 1, 'probe')) choices%probe = deck%path('overlap', 1, 'probe')
  end subroutine read_moduli

  !> A group, or a box, of the elements for one kind of grains.
  subroutine read_elements(deck, what, group, box, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: what
    character(len=:), allocatable, intent(out) :: group
    real(wp), intent(out) :: box(6)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: corners(:)

    group = ''
    box = 0.0_wp
    if (deck%given('overlap', 1, what//'_elements')) then
      call deck%get('overlap', 1, what//'_elements', group)
      return
    end if
    call deck%get('overlap', 1, what//'_box', corners)
    box = corners
    if (any(box(4:) <= box(:3))) &
      call deck%fault(errors, 'D421', 'the box has no inside: '//str(box), 'overlap', 1, &
                      what//'_box', 'give x y z of the lower corner, then of the upper one')
  end subroutine read_elements
end module cpl_overlap_choices
