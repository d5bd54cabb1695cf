!> What moves grains of a kind.
module dem_kinds
  use talus_kinds, only: i4
  use dem_state, only: kind_free, kind_mirror, kind_member
  implicit none
  private
  public :: moved_by_forces, gives_way

contains

  !> Do forces move grains of this kind, alone or as members of clumps?
  elemental logical function moved_by_forces(kind)
    integer(i4), intent(in) :: kind
    moved_by_forces = kind == kind_free .or. kind == kind_member
  end function moved_by_forces

  !> Do grains of this kind give way to a partner, here or on another rank?
  elemental logical function gives_way(kind)
    integer(i4), intent(in) :: kind
    gives_way = kind == kind_free .or. kind == kind_mirror .or. kind == kind_member
  end function gives_way
end module dem_kinds
