!> The manifest of a coupled checkpoint: which files of the three programs belong together.
!!
!! <stem>.manifest is the newest, <stem>.1.manifest the one before it, and so on. It is written
!! last, so that a manifest always names whole files. A line each: word, then value; a file has its
!! hash before its path.
module cpl_manifest
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string, starts_with
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, rename_file, remove_file, replace_file, read_file, &
    folder_of, name_of
  use talus_hash, only: hash_file
  implicit none
  private
  public :: manifest_type, write_manifest, read_manifest, find_manifest, is_in_a_manifest

  character(len=*), parameter :: first_line = 'talus-manifest 1'
  character(len=*), parameter :: nl = new_line('a')
  integer(i4), parameter :: most_kept = 1000

  !> One coupled checkpoint; files: 1 grains, 2 solid, 3 couple.
  type :: manifest_type
    real(wp) :: time = 0.0_wp  !! s
    integer(i8) :: step = 0
    character(len=:), allocatable :: deck_hash
    type(string_type) :: path(3)
    character(len=16) :: hash(3) = ''
  end type manifest_type

  character(len=*), parameter :: words(3) = ['grains', 'solid ', 'couple']

contains

  !> Move the older manifests on, write this one, remove those beyond keep with their files.
  subroutine write_manifest(stem, manifest, keep, errors)
    character(len=*), intent(in) :: stem
    type(manifest_type), intent(in) :: manifest
    integer(i4), intent(in) :: keep
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i4) :: k

    text = first_line//nl//'time '//str(manifest%time)//nl//'step '//str(manifest%step)//nl// &
      'deck_hash '//manifest%deck_hash//nl
    do k = 1, 3
      text = text//trim(words(k))//' '//manifest%hash(k)//' '//manifest%path(k)%s//nl
    end do
    call replace_file(path_of(stem, 0)//'.new', text//'complete'//nl, errors)
    if (errors%any()) return
    do k = keep, 1, -1
      if (file_exists(path_of(stem, k - 1))) &
        call rename_file(path_of(stem, k - 1), path_of(stem, k), errors)
    end do
    call rename_file(path_of(stem, 0)//'.new', path_of(stem, 0), errors)
    do k = keep, most_kept
      if (.not. file_exists(path_of(stem, k)) .or. errors%any()) exit
      call forget(path_of(stem, k), manifest)
    end do
  end subroutine write_manifest

  !> Whether a manifest of this stem names a file of this path (in any folder). It must not be
  !! written anew: until the next manifest is there, the old one is what a restart needs.
  logical function is_in_a_manifest(stem, path)
    character(len=*), intent(in) :: stem, path
    type(error_list_type) :: ignored
    character(len=:), allocatable :: text
    integer(i4) :: age

    is_in_a_manifest = .false.
    do age = 0, most_kept
      if (.not. file_exists(path_of(stem, age))) then
        if (age > 0) exit
        cycle
      end if
      call read_file(path_of(stem, age), text, ignored)
      is_in_a_manifest = index(text, '/'//name_of(path)//nl) > 0 .or. &
        index(text, ' '//name_of(path)//nl) > 0
      if (is_in_a_manifest) exit
    end do
  end function is_in_a_manifest

  !> Path of a manifest by its age, 0 the newest.
  pure function path_of(stem, age) result(path)
    character(len=*), intent(in) :: stem
    integer(i4), intent(in) :: age
    character(len=:), allocatable :: path
    path = stem//'.manifest'
    if (age > 0) path = stem//'.'//str(age)//'.manifest'
  end function path_of

  !> Remove an old manifest and its files, unless the new one names them too.
  subroutine forget(path, new)
    character(len=*), intent(in) :: path
    type(manifest_type), intent(in) :: new
    type(manifest_type) :: old
    type(error_list_type) :: ignored
    integer(i4) :: k

    call read_manifest(path, old, ignored)
    call remove_file(path)
    if (ignored%any()) return
    do k = 1, 3
      if (old%path(k)%s /= new%path(k)%s) call remove_file(old%path(k)%s)
    end do
  end subroutine forget

  !> Read a manifest and check whether its files are whole: I430 no manifest, S431 file lost.
  subroutine read_manifest(path, manifest, errors)
    character(len=*), intent(in) :: path
    type(manifest_type), intent(inout) :: manifest
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text, line
    logical :: complete
    integer(i4) :: before, first, last

    before = errors%count
    call read_file(path, text, errors)
    if (errors%count > before) return
    if (.not. starts_with(text, first_line//nl)) then
      call errors%add('I430', 'this is no manifest of a coupled run', path, &
                      '--restart=auto finds the newest; a name must end in .manifest')
      return
    end if
    complete = .false.
    first = 1
    do while (first <= len(text))
      last = index(text(first:), nl)
      if (last == 0) exit
      line = text(first:first + last - 2)
      complete = line == 'complete'
      call take_line(line, manifest)
      first = first + last
    end do
    if (.not. complete .or. .not. all_named(manifest)) then
      call errors%add('I430', 'the manifest is cut off', path, 'take an older one')
      return
    end if
    call check_files(path, manifest, errors)
  end subroutine read_manifest

  pure logical function all_named(manifest)
    type(manifest_type), intent(in) :: manifest
    all_named = allocated(manifest%deck_hash) .and. allocated(manifest%path(1)%s) .and. &
      allocated(manifest%path(2)%s) .and. allocated(manifest%path(3)%s)
  end function all_named

  subroutine take_line(line, manifest)
    character(len=*), intent(in) :: line
    type(manifest_type), intent(inout) :: manifest
    integer :: blank, stat, k

    blank = index(line, ' ')
    if (blank == 0) return
    select case (line(:blank - 1))
    case ('time')
      read (line(blank + 1:), *, iostat=stat) manifest%time
    case ('step')
      read (line(blank + 1:), *, iostat=stat) manifest%step
    case ('deck_hash')
      manifest%deck_hash = line(blank + 1:)
    case default
      do k = 1, 3
        if (line(:blank - 1) /= words(k) .or. len(line) < blank + 18) cycle
        manifest%hash(k) = line(blank + 1:blank + 16)
        manifest%path(k)%s = line(blank + 18:)
      end do
    end select
  end subroutine take_line

  !> The files must be there, as they were; files that moved together with the manifest are found.
  subroutine check_files(path, manifest, errors)
    character(len=*), intent(in) :: path
    type(manifest_type), intent(inout) :: manifest
    type(error_list_type), intent(inout) :: errors
    character(len=16) :: hash
    character(len=:), allocatable :: beside
    integer(i4) :: k, status

    do k = 1, 3
      beside = folder_of(path)//'/'//name_of(manifest%path(k)%s)
      if (.not. file_exists(manifest%path(k)%s) .and. file_exists(beside)) &
        manifest%path(k)%s = beside
      call hash_file(manifest%path(k)%s, hash, status)
      if (status == 0 .and. hash == manifest%hash(k)) cycle
      if (status == 0) then
        call errors%add('S431', 'the checkpoint '//manifest%path(k)%s//' was changed since the '// &
                        'manifest was written', path, 'take an older manifest')
      else
        call errors%add('S431', 'the checkpoint '//manifest%path(k)%s//' is missing', path, &
                        'take an older manifest')
      end if
    end do
  end subroutine check_files

  !> The manifest to go on from: 'auto' takes the newest whole one (warnings name what was passed
  !! over); found is false when there is none at all.
  subroutine find_manifest(restart, stem, manifest, path, found, warnings, errors)
    character(len=*), intent(in) :: restart, stem
    type(manifest_type), intent(inout) :: manifest
    character(len=:), allocatable, intent(out) :: path
    logical, intent(out) :: found
    type(string_type), allocatable, intent(inout) :: warnings(:)
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: faults
    integer(i4) :: age, seen

    found = .false.
    path = restart
    if (restart /= 'auto') then
      call read_manifest(path, manifest, errors)
      found = .not. errors%any()
      return
    end if
    seen = 0
    do age = 0, most_kept
      path = path_of(stem, age)
      if (.not. file_exists(path)) cycle
      seen = seen + 1
      call faults%clear()
      call read_manifest(path, manifest, faults)
      found = .not. faults%any()
      if (found) return
      call append_string(warnings, path//' passed over: '//faults%item(1)%message)
    end do
    path = ''
    if (seen > 0) call errors%add('S432', 'none of the '//str(seen)//' manifests can be used: '// &
                                  faults%item(1)%message, path_of(stem, 0), &
                                  'start again without --restart')
  end subroutine find_manifest
end module cpl_manifest
