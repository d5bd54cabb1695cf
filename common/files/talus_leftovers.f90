!> Files that a killed run of the same stem was about to finish: nobody will, so they are removed.
!!
!! Talus writes whole files under another name (path.tmp; a manifest as .new) and renames them. Only
!! names that it gives itself are touched, and only by who holds the lock of the stem.
module talus_leftovers
  use talus_kinds, only: i4
  use talus_files, only: file_exists, folder_of, list_files, name_of, remove_file
  use talus_text, only: string_type, ends_with
  implicit none
  private
  public :: remove_leftovers

  !> What follows the stem in names of files that are written whole.
  character(len=14), parameter :: whole(8) = [character(len=14) :: '.chk.h5', '.h5', '.xdmf', &
    '_surfaces.xdmf', '_summary.json', '_probe.json', '_sets.h5', '.manifest.new']

contains

  !> Remove the unfinished files of a stem (path without ending) whose lock the caller holds.
  subroutine remove_leftovers(stem)
    character(len=*), intent(in) :: stem
    type(string_type), allocatable :: names(:)
    character(len=:), allocatable :: rest
    integer(i4) :: k, from

    from = len(name_of(stem)) + 1
    call list_files(folder_of(stem), name_of(stem), names)
    do k = 1, size(names)
      rest = names(k)%s(from:)
      if (.not. is_unfinished(rest)) cycle
      if (is_of_another(stem, rest)) cycle
      call remove_file(folder_of(stem)//'/'//names(k)%s)
    end do
  end subroutine remove_leftovers

  !> Is this, behind the stem, the name of a file that was not finished?
  pure logical function is_unfinished(rest)
    character(len=*), intent(in) :: rest
    integer :: length

    is_unfinished = rest == '.manifest.new'
    length = len(rest) - len('.tmp')
    if (is_unfinished .or. length < 1 .or. .not. ends_with(rest, '.tmp')) return
    is_unfinished = any(whole == rest(:length)) .or. is_tagged(rest(:length)) .or. &
      (index(rest, '_grid_') == 1 .and. (ends_with(rest, '.h5.tmp') .or. &
      ends_with(rest, '.xdmf.tmp')))
  end function is_unfinished

  !> A checkpoint of a coupled run: .x120.chk.h5, .x120-2.chk.h5.
  pure logical function is_tagged(rest)
    character(len=*), intent(in) :: rest
    integer :: length
    length = len(rest) - len('.chk.h5')
    is_tagged = .false.
    if (length < 3 .or. .not. ends_with(rest, '.chk.h5')) return
    is_tagged = rest(:2) == '.x' .and. verify(rest(3:length), '0123456789-') == 0
  end function is_tagged

  !> Does a run with a longer stem, whose lock is there, write the file? `a.b` for `a`, `.b.chk.h5`.
  logical function is_of_another(stem, rest)
    character(len=*), intent(in) :: stem, rest
    integer :: k
    is_of_another = .false.
    do k = 2, len(rest)
      if (scan(rest(k:k), '._') == 0) cycle
      is_of_another = file_exists(stem//rest(:k - 1)//'.lock')
      if (is_of_another) exit
    end do
  end function is_of_another
end module talus_leftovers
