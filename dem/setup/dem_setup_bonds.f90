!> From the deck: the bonds of a run. Faults D256.
module dem_setup_bonds
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use talus_deck, only: deck_type
  use dem_additional_state, only: dem_bond_type
  implicit none
  private
  public :: read_bonds

contains

  !> The group &bond, if there is one.
  subroutine read_bonds(deck, bond, errors)
    type(deck_type), intent(in) :: deck
    type(dem_bond_type), intent(inout) :: bond
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: ids(:)

    bond%given = deck%count('bond') > 0
    if (.not. bond%given) return
    call deck%get('bond', 1, 'young', bond%young)
    call deck%get('bond', 1, 'stiffness_ratio', bond%stiffness_ratio)
    call deck%get('bond', 1, 'radius', bond%radius)
    call deck%get('bond', 1, 'tensile_strength', bond%tensile_strength)
    call deck%get('bond', 1, 'shear_strength', bond%shear_strength)
    call deck%get('bond', 1, 'damping_ratio', bond%damping_ratio)
    call deck%get('bond', 1, 'reach', bond%reach)
    if (.not. deck%given('bond', 1, 'pairs')) return
    call deck%get('bond', 1, 'pairs', ids)
    if (mod(size(ids), 2) == 1) then
      call deck%fault(errors, 'D256', 'an odd number of ids, '//str(size(ids, kind=i4))// &
                      ', makes no pairs', 'bond', 1, 'pairs', 'two ids a bond: 1, 2,  2, 3, ...')
      return
    end if
    bond%pairs = reshape(int(ids, i8), [2, size(ids)/2])
  end subroutine read_bonds
end module dem_setup_bonds
