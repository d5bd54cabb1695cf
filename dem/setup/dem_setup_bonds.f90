!> From the deck: the bonds of a run. Faults D256.
module dem_setup_bonds
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use talus_deck, only: deck_type
  use dem_additional_registry, only: use_in_run
  use dem_additional_state, only: dem_additional_type
  use dem_bond, only: bond_type, own_of
  implicit none
  private
  public :: read_bonds

contains

  !> The group &bond, if there is one.
  subroutine read_bonds(deck, additional, errors)
    type(deck_type), intent(in) :: deck
    type(dem_additional_type), intent(inout) :: additional
    type(error_list_type), intent(inout) :: errors
    type(bond_type) :: bond
    integer(i4), allocatable :: ids(:)

    additional%bond%given = deck%count('bond') > 0
    if (.not. additional%bond%given) return
    call deck%get('bond', 1, 'young', bond%young)
    call deck%get('bond', 1, 'stiffness_ratio', bond%stiffness_ratio)
    call deck%get('bond', 1, 'radius', bond%radius)
    call deck%get('bond', 1, 'tensile_strength', bond%tensile_strength)
    call deck%get('bond', 1, 'shear_strength', bond%shear_strength)
    call deck%get('bond', 1, 'damping_ratio', bond%damping_ratio)
    call deck%get('bond', 1, 'reach', bond%reach)
    call use_in_run(additional, 'bond', own_of(bond))
    if (.not. deck%given('bond', 1, 'pairs')) return
    call deck%get('bond', 1, 'pairs', ids)
    if (mod(size(ids), 2) == 1) then
      call deck%fault(errors, 'D256', 'an odd number of ids, '//str(size(ids, kind=i4))// &
                      ', makes no pairs', 'bond', 1, 'pairs', 'two ids a bond: 1, 2,  2, 3, ...')
      return
    end if
    additional%bond%pairs = reshape(int(ids, i8), [2, size(ids)/2])
  end subroutine read_bonds
end module dem_setup_bonds
