!> Manifests: written, rotated, read back; files that are lost or changed are noticed.
program test_cpl_manifest
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_files, only: make_folder, replace_file, file_exists, remove_file, list_files
  use talus_hash, only: hash_file
  use talus_system, only: process_id
  use talus_test, only: test_type
  use cpl_manifest, only: manifest_type, write_manifest, read_manifest, find_manifest, &
    is_in_a_manifest
  implicit none

  type(test_type) :: test
  character(len=:), allocatable :: folder, stem

  folder = '/tmp/talus-test-'//str(process_id())
  stem = folder//'/run'
  call rotation()
  deallocate (folder, stem)
  call test%finish()

contains

  !> Three checkpoints of which two are kept; then their files go one by one.
  subroutine rotation()
    type(error_list_type) :: errors
    type(manifest_type) :: manifest
    type(string_type), allocatable :: warnings(:), names(:)
    character(len=:), allocatable :: path
    logical :: found
    integer(i4) :: k

    call make_folder(folder, errors)
    allocate (warnings(0))
    call find_manifest('auto', stem, manifest, path, found, warnings, errors)
    call test%check('none is there', .not. found .and. .not. errors%any())
    do k = 1, 3
      call save(k, errors)
    end do
    call test%check('no faults', .not. errors%any())
    call test%check('two are kept', file_exists(stem//'.1.manifest') .and. &
                    .not. file_exists(stem//'.2.manifest'))
    call test%check('files of the oldest are gone', .not. file_exists(name_of(1, 1)) .and. &
                    file_exists(name_of(2, 1)) .and. file_exists(name_of(3, 3)))
    call find_manifest('auto', stem, manifest, path, found, warnings, errors)
    call test%check('newest', found .and. manifest%step == 30_i8 .and. size(warnings) == 0)
    call test%check_close('time', manifest%time, 0.3_wp, 0.0_wp)
    call test%check_text('deck hash', manifest%deck_hash, 'ABC')
    call test%check('files of a restart are not for others', is_in_a_manifest(stem, name_of(3, 3)) &
                    .and. is_in_a_manifest(stem, name_of(2, 3)))
    call test%check('others are', .not. is_in_a_manifest(stem, name_of(1, 3)) .and. &
                    .not. is_in_a_manifest(stem, 'x20.chk.h5') .and. &
                    .not. is_in_a_manifest(folder//'/other', name_of(3, 3)))

    call remove_file(name_of(3, 2))
    call find_manifest('auto', stem, manifest, path, found, warnings, errors)
    call test%check('older one taken', found .and. manifest%step == 20_i8 .and. size(warnings) == 1)
    call replace_file(name_of(2, 3), 'changed', errors)
    call find_manifest('auto', stem, manifest, path, found, warnings, errors)
    call test%check('none left', .not. found .and. errors%count == 1)
    call test%check_text('code', errors%item(1)%code, 'S432')
    call errors%clear()
    call read_manifest(stem//'.1.manifest', manifest, errors)
    call test%check_text('changed file', errors%item(1)%code, 'S431')
    call errors%clear()
    call replace_file(stem//'.manifest', 'talus-manifest 1'//new_line('a')//'time 0.1'// &
                      new_line('a'), errors)
    call read_manifest(stem//'.manifest', manifest, errors)
    call test%check_text('cut off', errors%item(1)%code, 'I430')

    call list_files(folder, '', names)
    do k = 1, size(names)
      call remove_file(folder//'/'//names(k)%s)
    end do
    call execute_command_line('rmdir '//folder)
  end subroutine rotation

  function name_of(number, program) result(name)
    integer(i4), intent(in) :: number, program
    character(len=:), allocatable :: name
    name = folder//'/part'//str(program)//'.x'//str(10*number)//'.chk.h5'
  end function name_of

  !> A coupled checkpoint of three small files.
  subroutine save(number, errors)
    integer(i4), intent(in) :: number
    type(error_list_type), intent(inout) :: errors
    type(manifest_type) :: new
    integer(i4) :: program, status

    new%time = 0.1_wp*number
    new%step = 10_i8*number
    if (number == 3) new%time = 0.3_wp
    new%deck_hash = 'ABC'
    do program = 1, 3
      new%path(program)%s = name_of(number, program)
      call replace_file(new%path(program)%s, 'file '//str(number)//str(program), errors)
      call hash_file(new%path(program)%s, new%hash(program), status)
    end do
    call write_manifest(stem, new, 2_i4, errors)
  end subroutine save
end program test_cpl_manifest
