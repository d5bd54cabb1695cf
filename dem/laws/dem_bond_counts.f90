!> Bonds as a run counts them: made at the start, broken since, left by the list of candidates.
module dem_bond_counts
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_additional_state, only: dem_additional_type, kept_places_type
  implicit none
  private
  public :: bond_at, count_lost, count_broken, put_bonds, get_bonds

contains

  !> First of the reals that a bond keeps, > 0 where it holds; 0: the run has no bonds.
  pure integer(i4) function bond_at(places) result(at)
    class(kept_places_type), intent(in) :: places
    at = places%first_of('bond')
  end function bond_at

  !> Bonds that a new list has no longer.
  pure subroutine count_lost(additional, kept)
    type(dem_additional_type), intent(inout) :: additional
    real(wp), intent(in) :: kept(:, :, :)  !! of the new list
    integer(i4) :: at
    at = bond_at(additional)
    if (at == 0 .or. .not. allocated(additional%kept)) return
    additional%lost = additional%lost + count(additional%kept(:, at, :) > 0.0_wp, kind=i8) &
                      - count(kept(:, at, :) > 0.0_wp, kind=i8)
  end subroutine count_lost

  !> Bonds broken so far, in whole numbers.
  pure subroutine count_broken(additional)
    type(dem_additional_type), intent(inout) :: additional
    additional%torn = nint(additional%broken(1), i8)
    additional%sheared = nint(additional%broken(2), i8)
  end subroutine count_broken

  subroutine put_bonds(additional, archive)
    type(dem_additional_type), intent(in) :: additional
    class(dem_archive_type), intent(inout) :: archive
    if (bond_at(additional) > 0) call archive%put_integers('extras.bonds', &
      reshape([additional%made, additional%torn, additional%sheared], [3, 1]))
  end subroutine put_bonds

  subroutine get_bonds(additional, archive, errors)
    type(dem_additional_type), intent(inout) :: additional
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: counts(:, :)
    if (bond_at(additional) == 0 .or. archive%find('extras.bonds') == 0) return
    call archive%get_integers('extras.bonds', 3, 1, counts, errors)
    if (errors%any()) return
    additional%made = counts(1, 1)
    additional%broken = real(counts(2:3, 1), wp)
    call count_broken(additional)
  end subroutine get_bonds
end module dem_bond_counts
