!> Lock on the results of a run: two runs must not write the same files at the same time.
!!
!! <stem>.lock is beside the results while a run writes them. The kernel drops the lock when its
!! process ends, however it ends, so that a file left by a killed run is taken over; what that run
!! had not finished is removed. On file systems without locks nothing is locked.
module talus_lock
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use talus_kinds, only: i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: folder_of
  use talus_leftovers, only: remove_leftovers
  use talus_c_text, only: c_string
  use talus_system, only: date_text, host_name, process_id
  implicit none
  private
  public :: lock_type

  integer(i4), parameter :: room = 512  !! bytes read of a holder's description

  !> Held from `take` to `release`.
  type :: lock_type
    character(len=:), allocatable :: path
    integer(i4), private :: descriptor = -1
  contains
    procedure :: take
    procedure :: release
  end type lock_type

  interface
    integer(c_int) function c_lock(path, text, fd, holder, room) bind(c, name='talus_c_lock')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*), text(*)
      integer(c_int), intent(out) :: fd
      character(kind=c_char), intent(out) :: holder(*)
      integer(c_int), value :: room
    end function c_lock
    subroutine c_unlock(path, fd) bind(c, name='talus_c_unlock')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: fd
    end subroutine c_unlock
  end interface

contains

  !> Lock the files of a run, which all begin with `stem`; S014 when another run holds them.
  subroutine take(self, stem, program, errors)
    class(lock_type), intent(inout) :: self
    character(len=*), intent(in) :: stem     !! path without ending
    character(len=*), intent(in) :: program  !! 'talus-dem'
    type(error_list_type), intent(inout) :: errors
    character(kind=c_char) :: said(room)
    character(len=:), allocatable :: holder
    integer(c_int) :: descriptor

    if (self%descriptor >= 0) return
    self%path = stem//'.lock'
    if (c_lock(c_string(self%path), c_string(program//', process '//str(process_id())// &
        ' on host '//host_name()//', since '//date_text()//new_line('a')), descriptor, said, &
        int(room, c_int)) == 0) then
      self%descriptor = int(descriptor, i4)
      if (self%descriptor >= 0) call remove_leftovers(stem)
      return
    end if
    holder = first_line(said)
    if (len(holder) == 0) holder = 'a process that has not written its name yet'
    call errors%add('S014', 'another run writes '//stem//'.* now: '//holder, self%path, &
                    'wait for its end, or give this run another folder with --output='// &
                    'FOLDER; results in '//folder_of(stem)//' are untouched')
  end subroutine take

  pure function first_line(said) result(text)
    character(kind=c_char), intent(in) :: said(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(said)
      if (said(k) == c_null_char .or. said(k) == new_line('a')) exit
      text = text//said(k)
    end do
  end function first_line

  !> Let others write; the file is removed.
  subroutine release(self)
    class(lock_type), intent(inout) :: self
    if (self%descriptor < 0) return
    call c_unlock(c_string(self%path), int(self%descriptor, c_int))
    self%descriptor = -1
  end subroutine release
end module talus_lock
