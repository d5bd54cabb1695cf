!> The system: clock, memory, environment, files and folders, faults of paths.
program test_talus_system
  use, intrinsic :: iso_c_binding, only: c_loc, c_intptr_t
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: disk_free, file_changed, file_exists, file_size, folder_exists, &
    folder_of, link_file, list_files, make_folder, name_of, read_file, remove_file, rename_file, &
    replace_file, stem_of, sync_file, sync_folder, truncate_file
  use talus_system, only: boot_id, compiler_text, environment, host_name, memory_free, &
    memory_resident, process_id, set_environment, system_error_text, wall_clock, date_text
  use talus_test, only: test_type
  use talus_text, only: str, string_type
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder

  folder = '/tmp/talus_test_system_'//str(process_id())
  call machine()
  call names_of_paths()
  call files()
  call faults()
  call execute_command_line('rm -rf '//folder)
  deallocate (folder)
  call test%finish()

contains

  subroutine machine()
    real(wp) :: first
    real(wp), allocatable, target :: large(:)
    allocate (large(100000))
    call test%check('large arrays begin on a line of the cache', &
                    modulo(transfer(c_loc(large), 0_c_intptr_t), 64_c_intptr_t) == 0)
    first = wall_clock()
    call test%check('clock goes on', wall_clock() >= first)
    call test%check('host name', len(host_name()) > 0)
    call test%check('boot id has no blanks', index(boot_id(), ' ') == 0)
    call test%check('process', process_id() > 1)
    call test%check('memory free', memory_free() > 0)
    call test%check('memory in use', memory_resident() > 100000_i8)
    call test%check('compiler', index(compiler_text(), 'GCC') > 0)
    call test%check_text('words of ENOSPC', system_error_text(28_i4), 'No space left on device')
    call test%check('date', len(date_text()) == 19)
    call set_environment('TALUS_TEST_A', 'one', .true.)
    call set_environment('TALUS_TEST_A', 'two', .false.)
    call test%check_text('environment kept', environment('TALUS_TEST_A'), 'one')
    call set_environment('TALUS_TEST_A', 'two', .true.)
    call test%check_text('environment replaced', environment('TALUS_TEST_A'), 'two')
    call test%check_text('environment not set', environment('TALUS_TEST_NOT_SET'), '')
  end subroutine machine

  subroutine names_of_paths()
    call test%check_text('folder', folder_of('runs/a/grains.nml'), 'runs/a')
    call test%check_text('no folder', folder_of('grains.nml'), '.')
    call test%check_text('root', folder_of('/grains.nml'), '/')
    call test%check_text('name', name_of('runs/a/grains.nml'), 'grains.nml')
    call test%check_text('stem', stem_of('runs.d/grains.v2.nml'), 'grains.v2')
    call test%check_text('stem without ending', stem_of('runs.d/grains'), 'grains')
    call test%check_text('hidden file', stem_of('.grains'), '.grains')
  end subroutine names_of_paths

  subroutine files()
    character(len=:), allocatable :: text
    type(string_type), allocatable :: names(:)
    call make_folder(folder//'/one/two', errors)
    call make_folder(folder//'/one/two', errors)
    call test%check('folders', folder_exists(folder//'/one/two') .and. .not. errors%any())
    call test%check('a folder is no file', .not. file_exists(folder//'/one'))
    call replace_file(folder//'/a.txt', 'first', errors)
    call replace_file(folder//'/a.txt', 'second text', errors)
    call read_file(folder//'/a.txt', text, errors)
    call test%check_text('replaced', text, 'second text')
    call test%check('size', file_size(folder//'/a.txt') == 11)
    call test%check('time of change', file_changed(folder//'/a.txt') > 1.0e9_wp)
    call truncate_file(folder//'/a.txt', 6_i8, errors)
    call read_file(folder//'/a.txt', text, errors)
    call test%check_text('cut', text, 'second')
    call link_file(folder//'/a.txt', folder//'/a.link', errors)
    call link_file(folder//'/a.txt', folder//'/a.link', errors)
    call rename_file(folder//'/a.txt', folder//'/b.txt', errors)
    call sync_file(folder//'/b.txt', errors)
    call sync_folder(folder//'/b.txt', errors)
    call test%check('renamed, linked', file_exists(folder//'/b.txt') .and. &
                    file_exists(folder//'/a.link') .and. .not. file_exists(folder//'/a.txt'))
    call list_files(folder, 'a.', names)
    call test%check('list', size(names) == 1)
    call test%check_text('listed', names(1)%s, 'a.link')
    call list_files(folder, '', names)
    call test%check('whole list', size(names) == 3)
    call list_files(folder//'/none', '', names)
    call test%check('no such folder', size(names) == 0)
    call remove_file(folder//'/b.txt', errors)
    call remove_file(folder//'/b.txt', errors)
    call test%check('removed', .not. file_exists(folder//'/b.txt'))
    call test%check('size of nothing', file_size(folder//'/b.txt') == -1)
    call test%check('disk', disk_free(folder) > 0 .and. disk_free(folder//'/none') < 0)
    call test%check('no faults', .not. errors%any())
  end subroutine files

  subroutine faults()
    character(len=:), allocatable :: text
    call make_folder(folder//'/a.link/under', errors)
    call expect('folder under a file', 'S008')
    call make_folder(folder//'/a.link', errors)
    call expect('folder that is a file', 'S008')
    call replace_file(folder//'/a.link/b.txt', 'text', errors)
    call expect('file under a file', 'S001')
    call replace_file(folder//'/none/b.txt', 'text', errors)
    call expect('no such folder', 'S001')
    call rename_file(folder//'/none', folder//'/b', errors)
    call expect('nothing to rename', 'S007')
    call sync_folder(folder//'/none/file', errors)
    call expect('nothing to sync', 'S007')
    call remove_file(folder//'/one', errors)
    call expect('a folder cannot be removed as a file', 'S007')
    call read_file(folder//'/none', text, errors)
    call expect('nothing to read', 'S003')
    call execute_command_line('ln -s /dev/full '//folder//'/c.txt.tmp')
    call replace_file(folder//'/c.txt', 'text', errors)
    call expect('full disk', 'S002')
    call test%check('nothing left over', .not. file_exists(folder//'/c.txt'))
  end subroutine faults

  subroutine expect(name, code)
    character(len=*), intent(in) :: name, code
    call test%check(name//': one fault', errors%count == 1)
    if (errors%any()) call test%check_text(name//': '//errors%text(1), errors%item(1)%code, code)
    call errors%clear()
  end subroutine expect
end program test_talus_system
