!> The checksum of an HDF5 file that is written once and read again: packings, checkpoints.
!!
!! CRC-64 (that of xz) of all bytes behind the first 512, which HDF5 leaves to the user (user
!! block) and which hold it: data, names, shapes, attributes and HDF5's own tables are covered, and
!! a damaged file is never handed to the library. Files of others have none. Faults S003, S005 and
!! those of writing.
module talus_file_checksum
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t
  use talus_kinds, only: i4, i8
  use talus_errors, only: error_list_type
  use talus_c_text, only: c_string
  use talus_files, only: write_fault
  use talus_system, only: system_error_text
  use talus_text, only: str
  implicit none
  private
  public :: write_checksum, check_checksum, room_for_checksum

  integer(i8), parameter :: room_for_checksum = 512  !! before the HDF5 file itself [byte]

  interface
    integer(c_int) function c_write(path) bind(c, name='talus_c_write_checksum')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_write
    integer(c_int) function c_check(path, found, sizes, sums) &
      bind(c, name='talus_c_check_checksum')
      import :: c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), intent(out) :: found
      integer(c_int64_t), intent(out) :: sizes(2), sums(2)
    end function c_check
  end interface

contains

  !> Write the checksum of a closed file that was made with room for it.
  subroutine write_checksum(path, errors)
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_write(c_string(path))
    if (stat /= 0) call write_fault(path, stat, errors)
  end subroutine write_checksum

  !> Is the file as it was written? found: it has a checksum. A fault is in the list then.
  subroutine check_checksum(path, found, errors)
    character(len=*), intent(in) :: path
    logical, intent(out) :: found
    type(error_list_type), intent(inout) :: errors
    integer(c_int) :: stat, there
    integer(c_int64_t) :: sizes(2), sums(2)
    character(len=:), allocatable :: what

    stat = c_check(c_string(path), there, sizes, sums)
    found = there == 1
    if (stat /= 0) then
      call errors%add('S003', "'"//path//"' cannot be read: "//system_error_text(int(stat, i4)), &
                      path, 'check the permissions and the disk')
      return
    end if
    if (.not. found) return
    if (sizes(1) < 0) then
      what = 'its first 512 bytes are not as they were written'
    else if (sizes(1) /= sizes(2)) then
      what = str(sizes(2))//' bytes instead of '//str(sizes(1))
    else if (sums(1) /= sums(2)) then
      what = 'its checksum is '//hexadecimal(sums(2))//', it was written with '// &
             hexadecimal(sums(1))
    else
      return
    end if
    call errors%add('S005', "'"//path//"' is truncated or damaged: "//what, path, &
                    "make it again or use an older one; 'talus checksum' accepts a change that "// &
                    'was meant')
  end subroutine check_checksum

  pure function hexadecimal(number) result(text)
    integer(i8), intent(in) :: number
    character(len=16) :: text
    write (text, '(z16.16)') number
  end function hexadecimal
end module talus_file_checksum
