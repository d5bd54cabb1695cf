!> Files and folders: existence, folders, renaming, syncing, text files that replace others whole.
!!
!! Faults: S001 cannot be made or opened for writing, S002 no room, S003 cannot be read, S007 cannot
!! be renamed, removed or synced, S008 folder cannot be made.
module talus_files
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_int64_t, c_ptr
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_c_text, only: c_string
  use talus_system, only: system_error_text
  use talus_text, only: str, string_type, append_string
  implicit none
  private
  public :: file_exists, folder_exists, plain_file, same_file
  public :: file_size, file_changed, disk_free, list_files
  public :: make_folder, remove_empty_folder
  public :: rename_file, link_file, remove_file, sync_file, sync_folder
  public :: open_append, write_text, close_file, truncate_file, reserve_room
  public :: replace_file, read_file, write_fault
  public :: folder_of, name_of, stem_of, run_stem

  integer(i4), parameter :: no_space = 28, file_too_big = 27, over_quota = 122  !! Linux errno
  integer(i4), parameter :: not_there = 2

  interface
    integer(c_int) function c_mkdirs(path) bind(c, name='talus_c_mkdirs')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_mkdirs
    integer(c_int) function c_rename(from, to) bind(c, name='talus_c_rename')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
    end function c_rename
    integer(c_int) function c_link(from, to) bind(c, name='talus_c_link')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
    end function c_link
    integer(c_int) function c_unlink(path) bind(c, name='talus_c_unlink')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_unlink
    integer(c_int) function c_rmdir(path) bind(c, name='talus_c_rmdir')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_rmdir
    integer(c_int) function c_sync_path(path) bind(c, name='talus_c_sync_path')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_sync_path
    integer(c_int) function c_stat(path, size, changed, is_folder) bind(c, name='talus_c_stat')
      import :: c_char, c_double, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(out) :: size
      real(c_double), intent(out) :: changed
      integer(c_int), intent(out) :: is_folder
    end function c_stat
    integer(c_int) function c_is_plain(path) bind(c, name='talus_c_is_plain')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_is_plain
    integer(c_int) function c_same_file(a, b) bind(c, name='talus_c_same_file')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: a(*), b(*)
    end function c_same_file
    integer(c_int) function c_writable(folder) bind(c, name='talus_c_writable')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: folder(*)
    end function c_writable
    integer(c_int64_t) function c_disk_free(folder) bind(c, name='talus_c_disk_free')
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: folder(*)
    end function c_disk_free
    integer(c_int) function c_open_append(path, fresh, fd) bind(c, name='talus_c_open_append')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: fresh
      integer(c_int), intent(out) :: fd
    end function c_open_append
    integer(c_int) function c_write(fd, data, size) bind(c, name='talus_c_write')
      import :: c_char, c_int, c_int64_t
      integer(c_int), value :: fd
      character(kind=c_char), intent(in) :: data(*)
      integer(c_int64_t), value :: size
    end function c_write
    integer(c_int) function c_close(fd, sync) bind(c, name='talus_c_close')
      import :: c_int
      integer(c_int), value :: fd, sync
    end function c_close
    integer(c_int) function c_truncate(path, size) bind(c, name='talus_c_truncate')
      import :: c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), value :: size
    end function c_truncate
    integer(c_int) function c_reserve(path, bytes) bind(c, name='talus_c_reserve')
      import :: c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), value :: bytes
    end function c_reserve
    integer(c_int) function c_list(folder, prefix, text, size) bind(c, name='talus_c_list')
      import :: c_char, c_int, c_int64_t, c_ptr
      character(kind=c_char), intent(in) :: folder(*), prefix(*)
      type(c_ptr), intent(out) :: text
      integer(c_int64_t), intent(out) :: size
    end function c_list
    subroutine c_free(text) bind(c, name='talus_c_free')
      import :: c_ptr
      type(c_ptr), value :: text
    end subroutine c_free
  end interface

contains

  !> Is there a file (not a folder) of this name?
  logical function file_exists(path)
    character(len=*), intent(in) :: path
    integer(c_int64_t) :: bytes
    real(c_double) :: changed
    integer(c_int) :: is_folder
    file_exists = .false.
    if (c_stat(c_string(path), bytes, changed, is_folder) == 0) file_exists = is_folder == 0
  end function file_exists

  !> Is it a file with content of its own: no folder, pipe or device?
  logical function plain_file(path)
    character(len=*), intent(in) :: path
    plain_file = c_is_plain(c_string(path)) /= 0
  end function plain_file

  !> Are both there, and one and the same file (links and './' seen through)?
  logical function same_file(a, b)
    character(len=*), intent(in) :: a, b
    same_file = c_same_file(c_string(a), c_string(b)) /= 0
  end function same_file

  logical function folder_exists(path)
    character(len=*), intent(in) :: path
    integer(c_int64_t) :: bytes
    real(c_double) :: changed
    integer(c_int) :: is_folder
    folder_exists = .false.
    if (c_stat(c_string(path), bytes, changed, is_folder) == 0) folder_exists = is_folder /= 0
  end function folder_exists

  !> Size of a file [byte], -1 if it is not there.
  integer(i8) function file_size(path)
    character(len=*), intent(in) :: path
    integer(c_int64_t) :: bytes
    real(c_double) :: changed
    integer(c_int) :: is_folder
    file_size = -1
    if (c_stat(c_string(path), bytes, changed, is_folder) == 0) file_size = bytes
  end function file_size

  !> Time of the last change [s since 1970], -1 if the file is not there.
  real(wp) function file_changed(path)
    character(len=*), intent(in) :: path
    integer(c_int64_t) :: bytes
    real(c_double) :: changed
    integer(c_int) :: is_folder
    file_changed = -1.0_wp
    if (c_stat(c_string(path), bytes, changed, is_folder) == 0) file_changed = changed
  end function file_changed

  !> Space left on the disk of a folder [byte], -1 where unknown.
  integer(i8) function disk_free(folder)
    character(len=*), intent(in) :: folder
    disk_free = c_disk_free(c_string(folder))
  end function disk_free

  !> Sorted names in a folder that begin with a prefix; none when the folder cannot be read.
  subroutine list_files(folder, prefix, names)
    character(len=*), intent(in) :: folder, prefix
    type(string_type), allocatable, intent(out) :: names(:)
    type(c_ptr) :: address
    integer(c_int64_t) :: bytes
    character(kind=c_char), pointer :: letters(:)
    character(len=:), allocatable :: name
    integer(i8) :: k

    allocate (names(0))
    if (c_list(c_string(folder), c_string(prefix), address, bytes) /= 0) return
    call c_f_pointer(address, letters, [bytes])
    name = ''
    do k = 1, bytes
      if (letters(k) == new_line('a')) then
        call append_string(names, name)
        name = ''
      else
        name = name//letters(k)
      end if
    end do
    call c_free(address)
  end subroutine list_files

  !> Make a folder and those above it; one that is there already is no fault.
  subroutine make_folder(path, errors)
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    if (len(path) == 0) return
    stat = c_mkdirs(c_string(path))
    if (stat /= 0) call errors%add('S008', "folder '"//path//"' cannot be made: "// &
                                   system_error_text(stat), path, &
                                   'choose another folder with --output=DIR')
    if (stat /= 0) return
    stat = c_writable(c_string(path))
    if (stat /= 0) call errors%add('S001', "nothing can be written into folder '"//path//"': "// &
                                   system_error_text(stat), path, &
                                   'check its permissions, or choose --output=DIR')
  end subroutine make_folder

  subroutine rename_file(from, to, errors)
    character(len=*), intent(in) :: from, to
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_rename(c_string(from), c_string(to))
    if (stat /= 0) call errors%add('S007', "'"//from//"' cannot be renamed to '"//to//"': "// &
                                   system_error_text(stat), to, 'check the folder')
  end subroutine rename_file

  !> Give a file a second name; where the file system has no links the file is renamed.
  subroutine link_file(from, to, errors)
    character(len=*), intent(in) :: from, to
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_unlink(c_string(to))
    stat = c_link(c_string(from), c_string(to))
    if (stat /= 0) call rename_file(from, to, errors)
  end subroutine link_file

  !> Remove a file; one that is not there is no fault.
  subroutine remove_file(path, errors)
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout), optional :: errors
    integer(i4) :: stat
    stat = c_unlink(c_string(path))
    if (stat == 0 .or. stat == not_there .or. .not. present(errors)) return
    call errors%add('S007', "'"//path//"' cannot be removed: "//system_error_text(stat), path, &
                    'check the folder')
  end subroutine remove_file

  !> Remove a folder if nothing is in it.
  subroutine remove_empty_folder(path)
    character(len=*), intent(in) :: path
    integer(i4) :: stat
    stat = c_rmdir(c_string(path))
  end subroutine remove_empty_folder

  !> Bring a closed file to the disk.
  subroutine sync_file(path, errors)
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_sync_path(c_string(path))
    if (stat /= 0) call write_fault(path, stat, errors)
  end subroutine sync_file

  !> Bring the folder's list of names to the disk, after a file in it was made or renamed.
  subroutine sync_folder(path_of_file, errors)
    character(len=*), intent(in) :: path_of_file
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_sync_path(c_string(folder_of(path_of_file)))
    if (stat /= 0) call errors%add('S007', "folder '"//folder_of(path_of_file)// &
                                   "' cannot be synced: "//system_error_text(stat), &
                                   path_of_file, 'check the disk')
  end subroutine sync_folder

  !> Open a file for writing at its end.
  subroutine open_append(path, fresh, descriptor, errors)
    character(len=*), intent(in) :: path
    logical, intent(in) :: fresh            !! empty it first
    integer(i4), intent(out) :: descriptor  !! -1 after a fault
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_open_append(c_string(path), merge(1_c_int, 0_c_int, fresh), descriptor)
    if (stat == 0) return
    descriptor = -1
    call write_fault(path, stat, errors)
  end subroutine open_append

  !> Write text unchanged; a full disk is found here.
  subroutine write_text(descriptor, path, text, errors)
    integer(i4), intent(in) :: descriptor
    character(len=*), intent(in) :: path  !! for the message
    character(len=*), intent(in) :: text
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_write(descriptor, text, len(text, kind=c_int64_t))
    if (stat /= 0) call write_fault(path, stat, errors)
  end subroutine write_text

  subroutine close_file(descriptor, path, sync, errors)
    integer(i4), intent(inout) :: descriptor  !! -1 afterwards
    character(len=*), intent(in) :: path
    logical, intent(in) :: sync
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    if (descriptor < 0) return
    stat = c_close(descriptor, merge(1_c_int, 0_c_int, sync))
    descriptor = -1
    if (stat /= 0) call write_fault(path, stat, errors)
  end subroutine close_file

  !> Cut a file after this many bytes.
  subroutine truncate_file(path, bytes, errors)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: bytes
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_truncate(c_string(path), bytes)
    if (stat /= 0) call write_fault(path, stat, errors)
  end subroutine truncate_file

  !> Room for so many bytes more behind the end of a file (S002), whose size stays.
  subroutine reserve_room(path, bytes, errors)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: bytes
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: stat
    stat = c_reserve(c_string(path), bytes)
    if (stat /= 0) call write_fault(path, stat, errors)
  end subroutine reserve_room

  !> Write a text file whole: under path.tmp, synced, then renamed. Readers never see a part of it.
  subroutine replace_file(path, text, errors)
    character(len=*), intent(in) :: path, text
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: descriptor, before
    before = errors%count
    call open_append(path//'.tmp', .true., descriptor, errors)
    if (errors%count > before) return
    call write_text(descriptor, path//'.tmp', text, errors)
    call close_file(descriptor, path//'.tmp', errors%count == before, errors)
    if (errors%count == before) then
      call rename_file(path//'.tmp', path, errors)
    else
      call remove_file(path//'.tmp')
    end if
  end subroutine replace_file

  !> All bytes of a file.
  subroutine read_file(path, text, errors)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_list_type), intent(inout) :: errors
    integer :: unit, stat
    integer(i8) :: bytes
    character(len=256) :: message

    text = ''
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read', &
          status='old', iostat=stat, iomsg=message)
    if (stat == 0) then
      inquire (unit=unit, size=bytes)
      deallocate (text)
      allocate (character(len=bytes) :: text)
      if (bytes > 0) read (unit, iostat=stat, iomsg=message) text
      close (unit)
    end if
    if (stat == 0) return
    text = ''
    call errors%add('S003', "'"//path//"' cannot be read: "//trim(message), path, &
                    'check the name and the permissions')
  end subroutine read_file

  !> The fault of a failed write: S002 when there is no room, S001 otherwise.
  subroutine write_fault(path, error, errors)
    character(len=*), intent(in) :: path
    integer(i4), intent(in) :: error  !! errno
    type(error_list_type), intent(inout) :: errors
    select case (error)
    case (no_space, file_too_big, over_quota)
      call errors%add('S002', "no room to write '"//path//"': "//system_error_text(error)// &
                      room_text(path), path, 'make room, then go on with --restart=auto')
    case default
      call errors%add('S001', "'"//path//"' cannot be written: "//system_error_text(error), path, &
                      'check the folder and its permissions, or choose --output=DIR')
    end select
  end subroutine write_fault

  function room_text(path) result(text)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    integer(i8) :: bytes
    bytes = disk_free(folder_of(path))
    text = ''
    if (bytes >= 0) text = ' ('//str(bytes/1048576_i8)//' MiB free there)'
  end function room_text

  !> Folder part of a path without the closing slash; '.' when there is none.
  pure function folder_of(path) result(folder)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: folder
    integer :: k
    k = scan(path, '/', back=.true.)
    if (k == 0) then
      folder = '.'
    else if (k == 1) then
      folder = '/'
    else
      folder = path(:k - 1)
    end if
  end function folder_of

  !> Last part of a path.
  pure function name_of(path) result(name)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name
    name = path(scan(path, '/', back=.true.) + 1:)
  end function name_of

  !> Last part of a path without its last ending: 'runs/grains.nml' gives 'grains'.
  pure function stem_of(path) result(stem)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: stem
    integer :: k
    stem = name_of(path)
    k = scan(stem, '.', back=.true.)
    if (k > 1) stem = stem(:k - 1)
  end function stem_of

  !> What the names of all files of a run begin with: the deck's stem, in its folder or another one.
  pure function run_stem(deck, folder) result(stem)
    character(len=*), intent(in) :: deck
    character(len=*), intent(in) :: folder  !! '': that of the deck
    character(len=:), allocatable :: stem
    stem = stem_of(deck)
    if (len(folder) > 0) then
      stem = folder//'/'//stem
    else if (folder_of(deck) /= '.') then
      stem = folder_of(deck)//'/'//stem
    end if
  end function run_stem
end module talus_files
