!> Version and git hash of this build; the makefile writes them into talus_build.c when they change.
module talus_version
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_ptr, c_size_t
  implicit none
  private
  public :: version_text, git_hash

  interface
    type(c_ptr) function c_version() bind(c, name='talus_build_version')
      import :: c_ptr
    end function c_version
    type(c_ptr) function c_git_hash() bind(c, name='talus_build_git_hash')
      import :: c_ptr
    end function c_git_hash
    integer(c_size_t) function c_strlen(address) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value :: address
    end function c_strlen
  end interface

contains

  !> '0.2.0'
  function version_text() result(text)
    character(len=:), allocatable :: text
    text = taken(c_version())
  end function version_text

  !> Abbreviated hash of the commit, '-dirty' after it when files were changed, 'none' without git.
  function git_hash() result(text)
    character(len=:), allocatable :: text
    text = taken(c_git_hash())
  end function git_hash

  function taken(address) result(text)
    type(c_ptr), intent(in) :: address
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer :: k
    call c_f_pointer(address, letters, [c_strlen(address)])
    text = repeat(' ', size(letters))
    do k = 1, size(letters)
      text(k:k) = letters(k)
    end do
  end function taken
end module talus_version
