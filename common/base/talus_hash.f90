!> Hash of a text or a file as 16 hexadecimal digits (64-bit FNV-1a): shows whether two are the
!! same, is no protection against intent.
module talus_hash
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_null_char
  use talus_kinds, only: i4, i8
  implicit none
  private
  public :: hash_text, hash_file

  interface
    pure subroutine c_hash(data, count, hash) bind(c, name='talus_c_hash')
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: data(*)
      integer(c_int64_t), value :: count
      integer(c_int64_t), intent(inout) :: hash
    end subroutine c_hash
    integer(c_int) function c_hash_file(path, hash) bind(c, name='talus_c_hash_file')
      import :: c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(inout) :: hash
    end function c_hash_file
  end interface

contains

  !> Hash of a text.
  pure function hash_text(text) result(hex)
    character(len=*), intent(in) :: text
    character(len=16) :: hex
    integer(c_int64_t) :: hash
    hash = 0
    call c_hash(text, len(text, i8), hash)
    write (hex, '(z16.16)') hash
  end function hash_text

  !> Hash of a file; status is 0 or the system's error number (then hex is blank).
  subroutine hash_file(path, hex, status)
    character(len=*), intent(in) :: path
    character(len=16), intent(out) :: hex
    integer(i4), intent(out) :: status
    integer(c_int64_t) :: hash

    hash = 0
    status = int(c_hash_file(path//c_null_char, hash), i4)
    hex = ''
    if (status == 0) write (hex, '(z16.16)') hash
  end subroutine hash_file
end module talus_hash
