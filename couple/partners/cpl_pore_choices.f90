!> What the group &pore_interface of the coupled deck asks for, checked.
module cpl_pore_choices
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  implicit none
  private
  public :: pore_choices_type, read_pore

  type :: pore_choices_type
    logical :: given = .false.
    character(len=:), allocatable :: facets  !! group of the mesh
    logical :: permeable = .true.
    logical :: returned = .true.    !! what the admittance withholds is given back
    logical :: yields = .true.      !! the grid's side gives way by a conductance
    real(wp) :: robin = 1.0_wp      !! admittance over that of a half space [-]
    real(wp) :: modulus = 0.0_wp    !! of the grains [Pa], 0: not given
    real(wp) :: ghost_mass = 0.5_wp !! share of theirs that a solid with inertia carries [-]
  end type pore_choices_type

contains

  !> Read &pore_interface; D453 where the interface is of a kind that knows no liquid.
  subroutine read_pore(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(pore_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: scheme

    choices%given = deck%count('pore_interface') > 0
    if (.not. choices%given) return
    call deck%get('pore_interface', 1, 'facets', choices%facets)
    call deck%get('pore_interface', 1, 'permeable', choices%permeable)
    call deck%get('pore_interface', 1, 'ghost_mass', choices%ghost_mass)
    if (choices%permeable) then
      call deck%get('pore_interface', 1, 'scheme', scheme)
      choices%returned = scheme /= 'held'
      choices%yields = scheme == 'conductance'
      call deck%get('pore_interface', 1, 'robin', choices%robin)
      if (deck%given('pore_interface', 1, 'modulus')) &
        call deck%get('pore_interface', 1, 'modulus', choices%modulus)
    end if
    call check_kind(deck, errors)
    if (.not. choices%permeable) then
      call check_impervious(deck, errors)
    else if (choices%yields) then
      call check_held(deck, errors)
    end if
  end subroutine read_pore

  !> A conductance wants facets that springs hold, or that trials find (D455).
  subroutine check_held(deck, errors)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: scheme, word
    if (deck%count('facets') == 0) return
    call deck%get('clock', 1, 'scheme', scheme)
    call deck%get('facets', 1, 'interface', word)
    if (scheme /= 'average' .or. word == 'springs') return
    call deck%fault(errors, 'D455', "with interface = '"//word//"' nothing holds the facets "// &
                    "against the liquid in an interval", 'facets', 1, 'interface', &
                    "take 'springs', or scheme = 'iterated' in &clock, or 'reaction' here")
  end subroutine check_held

  !> What means nothing where no liquid passes.
  subroutine check_impervious(deck, errors)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    character(len=7), parameter :: idle(3) = [character(len=7) :: 'scheme', 'robin', 'modulus']
    integer(i4) :: k
    do k = 1, size(idle)
      if (deck%given('pore_interface', 1, trim(idle(k)))) &
        call deck%fault(errors, 'D453', trim(idle(k))//' means nothing on impervious facets', &
                        'pore_interface', 1, trim(idle(k)), 'leave it out')
    end do
  end subroutine check_impervious

  !> Ghosts on facets, with a mean force of the interval.
  subroutine check_kind(deck, errors)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: word
    if (deck%count('facets') == 0) then
      call deck%fault(errors, 'D453', 'the liquid crosses facets, and there are none', &
                      'pore_interface', 1, '', 'leave the liquid of both sides out in an overlap')
      return
    end if
    if (deck%given('facets', 1, 'surface')) &
      call deck%fault(errors, 'D453', 'grains that touch a surface have no side of a grid on it', &
                      'facets', 1, 'surface', 'take ghosts')
    call deck%get('clock', 1, 'scheme', word)
    if (word == 'state_at_n' .or. word == 'symmetric') &
      call deck%fault(errors, 'D453', "with scheme = '"//word//"' the solid steps before the "// &
                      'liquid has come', 'clock', 1, 'scheme', "take 'average' or 'iterated'")
    call deck%get('facets', 1, 'initial', word)
    if (word == 'relax') &
      call deck%fault(errors, 'D453', "initial = 'relax' moves no liquid", 'facets', 1, &
                      'initial', "take 'dead_load' or 'none'")
  end subroutine check_kind
end module cpl_pore_choices
