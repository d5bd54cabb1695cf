!> The lock on results: refused while another process holds it, taken over when that one is dead.
program test_talus_lock
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, make_folder, read_file, remove_empty_folder, folder_exists, &
    remove_file
  use talus_lock, only: lock_type
  use talus_partner, only: own_pid
  use talus_process, only: process_type
  use talus_test, only: test_type
  implicit none

  character(len=512) :: argument(2)
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: stem

  call get_command_argument(1, argument(1))
  call get_command_argument(2, argument(2))
  if (argument(1) == 'try') then
    call try(trim(argument(2)))
  else
    stem = '/tmp/talus-lock-'//str(own_pid())//'/grains'
    call make_folder(stem(:index(stem, '/', back=.true.) - 1), errors)
    call held()
    call left_behind()
    call no_folder()
    call remove_empty_folder(stem(:index(stem, '/', back=.true.) - 1))
    call test%check('nothing is left', .not. &
                    folder_exists(stem(:index(stem, '/', back=.true.) - 1)))
    call test%finish()
  end if

contains

  !> The other process: acquires the lock and ends without giving it back.
  subroutine try(stem)
    character(len=*), intent(in) :: stem
    type(lock_type) :: lock
    type(error_list_type) :: faults
    call lock%take(stem, 'talus-fem', faults)
    if (faults%any()) call faults%print(0)
    stop faults%exit_code(), quiet=.true.
  end subroutine try

  !> Exit code and output of the other process.
  subroutine run_other(exit_code, text)
    integer(i4), intent(out) :: exit_code
    character(len=:), allocatable, intent(out) :: text
    type(process_type) :: child
    type(string_type), allocatable :: argv(:)
    character(len=512) :: program_path
    call get_command_argument(0, program_path)
    call append_string(argv, trim(program_path))
    call append_string(argv, 'try')
    call append_string(argv, stem)
    call child%spawn(argv, '', stem//'.out', 1_i4, errors)
    call test%check('the other process ends', child%wait(20.0_wp))
    exit_code = child%exit_code
    call read_file(stem//'.out', text, errors)
    call remove_file(stem//'.out')
  end subroutine run_other

  subroutine held()
    type(lock_type) :: lock
    character(len=:), allocatable :: text
    integer(i4) :: exit_code
    call lock%take(stem, 'talus-dem', errors)
    call test%check('taken', .not. errors%any() .and. file_exists(stem//'.lock'))
    call lock%take(stem, 'talus-dem', errors)
    call test%check('taken twice by the same holder', .not. errors%any())
    call run_other(exit_code, text)
    call test%check('the other one is refused with 4', exit_code == 4)
    call test%check('code', index(text, 'S014') > 0)
    call test%check('holder', index(text, 'talus-dem, process '//str(own_pid())//' on host ') > 0)
    call test%check('hint', index(text, '--output=') > 0)
    call lock%release()
    call test%check('released', .not. file_exists(stem//'.lock'))
  end subroutine held

  subroutine left_behind()
    type(lock_type) :: lock
    character(len=:), allocatable :: text
    integer(i4) :: exit_code
    call run_other(exit_code, text)
    call test%check('free again', exit_code == 0)
    call test%check('left behind', file_exists(stem//'.lock'))
    call lock%take(stem, 'talus-dem', errors)
    call test%check('taken over from a dead process', .not. errors%any())
    call read_file(stem//'.lock', text, errors)
    call test%check('and marked', index(text, 'process '//str(own_pid())) > 0)
    call lock%release()
  end subroutine left_behind

  !> Where no file can be made, the log reports it, not the lock.
  subroutine no_folder()
    type(lock_type) :: lock
    call lock%take('/nowhere/at/all', 'talus-dem', errors)
    call test%check('no folder: no fault of the lock', .not. errors%any())
    call lock%release()
  end subroutine no_folder
end program test_talus_lock
