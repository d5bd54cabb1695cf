!> Arrays of a file that must have a shape that the reader knows; after a fault they have it, too,
!! and are zero, so that what follows finds nothing amiss. Faults of talus_hdf5, I002 another shape.
module talus_h5_shaped
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  implicit none
  private
  public :: get_shaped

  !> get_shaped(file, name, extent, values, errors): reals of rank 1 or 2.
  interface get_shaped
    module procedure get_shaped_1, get_shaped_2
  end interface get_shaped

contains

  subroutine get_shaped_1(file, name, extent, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: extent
    real(wp), allocatable, intent(inout) :: values(:)
    type(error_list_type), intent(inout) :: errors
    if (allocated(values)) deallocate (values)
    allocate (values(extent), source=0.0_wp)
    call file%get_into(name, values, errors)
  end subroutine get_shaped_1

  subroutine get_shaped_2(file, name, extent, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: extent(2)  !! Fortran shape
    real(wp), allocatable, intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    if (allocated(values)) deallocate (values)
    allocate (values(extent(1), extent(2)), source=0.0_wp)
    call file%get_into(name, values, errors)
  end subroutine get_shaped_2
end module talus_h5_shaped
