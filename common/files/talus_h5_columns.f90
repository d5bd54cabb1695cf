!> Some columns of a large matrix in a file, so that it need not be held whole.
module talus_h5_columns
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: hid_t, hsize_t, h5dopen_f, h5dget_space_f, h5dread_f, h5dclose_f, h5sclose_f, &
    h5screate_simple_f, h5sselect_hyperslab_f, h5s_select_set_f, h5t_native_double
  use talus_kinds, only: wp, i8
  use talus_errors, only: error_list_type
  use talus_h5_raw, only: object_fault
  use talus_hdf5, only: h5_file_type
  implicit none
  private
  public :: get_columns

contains

  !> Columns of a matrix of reals from number `first`, from 1, on: `many`, or as many as there are.
  subroutine get_columns(file, name, first, many, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: first, many
    real(wp), allocatable, intent(out), target :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    integer(hid_t) :: dataset, space, memory
    integer :: status, ignored
    type(c_ptr) :: address

    allocate (values(0, 0))
    call file%check_dataset(name, 'real', 2, extent, errors)
    if (.not. allocated(extent)) return
    extent(2) = max(min(many, extent(2) - first + 1), 0_i8)
    deallocate (values)
    allocate (values(extent(1), extent(2)))
    if (size(values) == 0) return
    address = c_loc(values)
    call h5dopen_f(file%id, name, dataset, status)
    if (status >= 0) then
      call h5dget_space_f(dataset, space, ignored)
      call h5screate_simple_f(2, extent, memory, ignored)
      call h5sselect_hyperslab_f(space, h5s_select_set_f, [0_hsize_t, int(first - 1, hsize_t)], &
                                 extent, status)
      if (status >= 0) &
        call h5dread_f(dataset, h5t_native_double, address, status, memory, space)
      call h5sclose_f(memory, ignored)
      call h5sclose_f(space, ignored)
      call h5dclose_f(dataset, ignored)
    end if
    if (status < 0) call object_fault(file%path, name, 'read', errors)
    call file%check_numbers(name, size(values, kind=i8), values, errors)
  end subroutine get_columns
end module talus_h5_columns
