!> What a killed run had not finished goes; finished files, those of others and of users stay.
program test_talus_leftovers
  use talus_kinds, only: i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, make_folder, remove_empty_folder, remove_file, replace_file
  use talus_lock, only: lock_type
  use talus_system, only: process_id
  use talus_test, only: test_type
  implicit none

  character(len=28), parameter :: unfinished(9) = [character(len=28) :: 'a.chk.h5.tmp', &
    'a.x40.chk.h5.tmp', 'a.x40-2.chk.h5.tmp', 'a.h5.tmp', 'a.xdmf.tmp', 'a_summary.json.tmp', &
    'a.manifest.new', 'a.manifest.new.tmp', 'a_grid_top.h5.tmp']
  character(len=28), parameter :: others(12) = [character(len=28) :: 'a.chk.h5', 'a.x40.chk.h5', &
    'a.tmp', 'a.notes.tmp', 'a.x40.chk.h5.kept', 'ab.h5.tmp', 'a.xyz.chk.h5.tmp', 'b.h5.tmp', &
    'a.new', 'a.x9.lock', 'a.x9.chk.h5.tmp', 'packing.h5.tmp']
  type(test_type) :: test
  type(error_list_type) :: errors
  type(lock_type) :: lock
  character(len=:), allocatable :: folder
  integer(i4) :: k

  folder = '/tmp/talus-leftovers-'//str(process_id())
  call make_folder(folder, errors)
  do k = 1, size(unfinished)
    call replace_file(folder//'/'//trim(unfinished(k)), 'x', errors)
  end do
  do k = 1, size(others)
    call replace_file(folder//'/'//trim(others(k)), 'x', errors)
  end do
  call lock%take(folder//'/a', 'talus-dem', errors)
  do k = 1, size(unfinished)
    call test%check(trim(unfinished(k))//' goes', &
                    .not. file_exists(folder//'/'//trim(unfinished(k))))
  end do
  do k = 1, size(others)
    call test%check(trim(others(k))//' stays', file_exists(folder//'/'//trim(others(k))))
    call remove_file(folder//'/'//trim(others(k)))
  end do
  call lock%release()
  call remove_empty_folder(folder)
  call test%check('no faults', .not. errors%any())
  call test%finish()
end program test_talus_leftovers
