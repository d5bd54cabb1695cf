!> Size of the unit of work of all hot loops.
module dem_sizes
  use talus_kinds, only: i4
  implicit none
  private
  public :: lanes

  integer(i4), parameter :: lanes = 16  !! pairs in a block
end module dem_sizes
