!> Child processes: exit codes, signals, logs, environment, groups; none outlives its parent.
!!
!! `middle FILE` is this program itself as a parent that is killed.
program test_talus_process
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use, intrinsic :: iso_fortran_env, only: output_unit
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_partner, only: now, nap, own_pid, partner_type
  use talus_process, only: process_type, sibling_program, tail_of, signal_kill, signal_stop
  use talus_test, only: test_type
  implicit none

  interface
    function c_setenv(name, text, overwrite) result(code) bind(c, name='setenv')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*), text(*)
      integer(c_int), value :: overwrite
      integer(c_int) :: code
    end function c_setenv
  end interface

  type(test_type) :: test
  character(len=512) :: argument(2)
  character(len=:), allocatable :: log_file

  call get_command_argument(1, argument(1))
  call get_command_argument(2, argument(2))
  if (argument(1) == 'middle') then
    call middle(trim(argument(2)))
  else
    log_file = 'talus-process-'//str(own_pid())//'.log'
    call ends()
    call cannot_start()
    call environment()
    call stopped_group()
    call parent_killed()
    call log_tail()
    call remove(log_file)
    deallocate (log_file)
    call test%finish()
  end if

contains

  subroutine remove(path)
    character(len=*), intent(in) :: path
    integer :: unit, stat
    open (newunit=unit, file=path, iostat=stat)
    if (stat == 0) close (unit, status='delete')
  end subroutine remove

  subroutine ends()
    type(process_type) :: process
    type(error_list_type) :: errors

    call process%spawn_command('sh -c "exit 7"', '', '', 0, errors)
    call test%check('waits for its end', process%wait(10.0_wp))
    call test%check_text('exit code', process%epitaph(), 'exit code 7')
    call process%spawn_command('sleep 30', '', '', 0, errors)
    call test%check('runs', process%running() .and. .not. process%wait(0.05_wp))
    call test%check_text('still there', process%epitaph(), 'still running')
    call process%kill_group(signal_kill)
    call test%check('killed', process%wait(10.0_wp))
    call test%check_text('signal', process%epitaph(), 'killed by signal 9 (SIGKILL)')
    call process%stop(0.0_wp)
    call test%check('none left to wait for', .not. process%running())
    call test%check('no fault', .not. errors%any())
  end subroutine ends

  subroutine cannot_start()
    type(process_type) :: process
    type(error_list_type) :: errors
    type(string_type), allocatable :: argv(:)

    call append_string(argv, '/no/such/program')
    call process%spawn(argv, '', '', 0, errors)
    call process%spawn_command('true', '/no/such/folder', '', 0, errors)
    call process%spawn_command('true', '', '/no/such/folder/log', 0, errors)
    call test%check('three faults', errors%count == 3)
    call test%check_text('code', errors%item(1)%code, 'P020')
    call test%check('named: '//errors%item(1)%message, &
                    index(errors%item(1)%message, '/no/such/program') > 0 .and. &
                    index(errors%item(1)%message, 'no such file') > 0)
    call test%check('no process', process%pid == 0 .and. .not. process%running())
  end subroutine cannot_start

  !> A parent launcher's variables stay away, thread counts arrive, stdout goes to the log.
  subroutine environment()
    type(process_type) :: process
    type(error_list_type) :: errors
    character(len=:), allocatable :: text
    integer :: code

    code = c_setenv('PMIX_RANK'//c_null_char, '0'//c_null_char, 1_c_int)
    code = c_setenv('OMPI_COMM_WORLD_SIZE'//c_null_char, '2'//c_null_char, 1_c_int)
    code = c_setenv('OMP_NUM_THREADS'//c_null_char, '64'//c_null_char, 1_c_int)
    call process%spawn_command('env', '', log_file, 3, errors)
    call test%check('env ends', process%wait(10.0_wp))
    text = tail_of(log_file, 1000)
    call test%check('no launcher', index(text, 'PMIX_') == 0 .and. index(text, 'OMPI_COMM') == 0)
    call test%check('threads', index(text, '| OMP_NUM_THREADS=3') > 0 .and. &
                    index(text, '| OPENBLAS_NUM_THREADS=3') > 0)
    call test%check('given once', index(text, '| OMP_NUM_THREADS=64') == 0)
    call test%check('passive wait', index(text, '| OMP_WAIT_POLICY=passive') > 0)
    call test%check('the rest stays', index(text, '| PATH=') > 0)
  end subroutine environment

  !> A stopped child with a child of its own: both end with the group.
  subroutine stopped_group()
    type(process_type) :: process
    type(error_list_type) :: errors
    type(partner_type) :: grandchild
    integer(i4) :: pid

    call process%spawn_command('sh -c "sleep 60 & echo \$!; wait"', '', log_file, 0, errors)
    pid = pid_in(log_file)
    call test%check('grandchild runs', pid > 0)
    call grandchild%started(pid)
    call process%kill_group(signal_stop)
    call process%stop(0.05_wp)
    call nap(0.05_wp)
    call test%check('the group is gone', grandchild%ended())
    call grandchild%close()
  end subroutine stopped_group

  !> The number that a child writes into a file; 0 when there is none.
  integer(i4) function pid_in(path)
    character(len=*), intent(in) :: path
    integer :: unit, stat
    real(wp) :: started
    pid_in = 0
    started = now()
    do while (now() - started < 5.0_wp .and. pid_in == 0)
      open (newunit=unit, file=path, status='old', action='read', iostat=stat)
      if (stat == 0) then
        read (unit, *, iostat=stat) pid_in
        close (unit)
      end if
      call nap(0.01_wp)
    end do
  end function pid_in

  subroutine middle(path)
    character(len=*), intent(in) :: path
    type(process_type) :: process
    type(error_list_type) :: errors
    integer :: unit
    call process%spawn_command('sleep 60', '', '', 0, errors)
    open (newunit=unit, file=path)
    write (unit, '(i0)') process%pid
    close (unit)
    call nap(60.0_wp)
  end subroutine middle

  !> The grandchild has a group of its own; only the kernel can signal that its parent was killed.
  subroutine parent_killed()
    type(process_type) :: process
    type(error_list_type) :: errors
    type(partner_type) :: grandchild
    type(string_type), allocatable :: argv(:)
    real(wp) :: started
    integer(i4) :: pid

    call remove(log_file)
    call append_string(argv, '/proc/self/exe')
    call append_string(argv, 'middle')
    call append_string(argv, log_file)
    call process%spawn(argv, '', '', 0, errors)
    pid = pid_in(log_file)
    call test%check('grandchild of the middle runs', pid > 0)
    call grandchild%started(pid)
    call test%check('it lives', .not. grandchild%ended())
    call process%kill_group(signal_kill)
    call process%stop(1.0_wp)
    started = now()
    do while (.not. grandchild%ended() .and. now() - started < 5.0_wp)
      call nap(0.01_wp)
    end do
    call test%check('no child outlives its killed parent', grandchild%ended())
    call grandchild%close()
  end subroutine parent_killed

  subroutine log_tail()
    integer :: unit
    open (newunit=unit, file=log_file)
    write (unit, '(a)') 'one', 'two', 'three'
    close (unit)
    call test%check_text('tail', tail_of(log_file, 2), &
                         '  | two'//new_line('a')//'  | three'//new_line('a'))
    call test%check_text('no file', tail_of('no-such-file.log', 2), '')
    call test%check_text('a program of PATH', sibling_program('no-such-program'), 'no-such-program')
    call test%check('a program beside this one', &
      index(sibling_program('test_talus_process'), '/') == 1)
    flush (output_unit)
  end subroutine log_tail
end program test_talus_process
