!> Texts of Fortran and of C: closed by a null character there, of a length of their own here.
module talus_c_text
  use, intrinsic :: iso_c_binding, only: c_char, c_null_char
  implicit none
  private
  public :: c_string, text_of

contains

  !> Text with the closing null character that C wants; trailing blanks stay.
  pure function c_string(text) result(closed)
    character(len=*), intent(in) :: text
    character(kind=c_char, len=:), allocatable :: closed
    closed = text//c_null_char
  end function c_string

  !> A buffer that C has filled, up to its null character.
  pure function text_of(buffer) result(text)
    character(kind=c_char), intent(in) :: buffer(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(buffer)
      if (buffer(k) == c_null_char) exit
      text = text//buffer(k)
    end do
  end function text_of
end module talus_c_text
