!> Reasons to stop: none, signal, wall limit, stop file; SIGUSR1 requests a checkpoint only.
program test_talus_stop
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, replace_file
  use talus_stop, only: stop_type, stop_none, stop_signal, stop_wall, stop_file
  use talus_system, only: process_id, signal_seen, wall_clock
  use talus_test, only: test_type
  use talus_text, only: str
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  type(stop_type) :: watch
  character(len=:), allocatable :: path
  real(wp) :: begun

  path = '/tmp/talus_test_stop_'//str(process_id())
  call watch%init(0.0_wp, '')
  call test%check('go on', watch%check() == stop_none)
  call test%check_text('no reason', watch%text(), '')

  call watch%init(0.02_wp, '')
  begun = wall_clock()
  do while (wall_clock() - begun < 0.03_wp)
  end do
  call test%check('wall limit', watch%check() == stop_wall)
  call test%check_text('wall limit in words', watch%text(), 'wall limit of 0.02 s')
  call test%check('the reason stays', watch%check() == stop_wall)
  call test%check('elapsed', watch%elapsed() >= 0.03_wp)

  call watch%init(3600.0_wp, path)
  call test%check('no stop file yet', watch%check() == stop_none)
  call watch%init(3600.0_wp, path)
  call replace_file(path, '', errors)
  call test%check('stop file', watch%check() == stop_file)
  call test%check_text('stop file in words', watch%text(), "stop file '"//path//"'")
  call test%check('stop file taken away', .not. file_exists(path) .and. .not. errors%any())

  call watch%init(0.0_wp, '', obey_signals=.false.)
  call kill_self('TERM')
  call kill_self('INT')
  call kill_self('USR1')
  call test%check('signals left to the coupler', watch%check() == stop_none)
  call test%check('no checkpoint asked', .not. watch%checkpoint_asked())

  call watch%init(0.0_wp, '')
  call kill_self('USR1')
  call test%check('SIGUSR1 is no stop', watch%check() == stop_none)
  call test%check('checkpoint asked', watch%checkpoint_asked())
  call test%check('once', .not. watch%checkpoint_asked())
  call kill_self('PIPE')
  call kill_self('TERM')
  call kill_self('TERM')
  call test%check('signal', watch%check() == stop_signal .and. signal_seen() == 15)
  call test%check_text('signal in words', watch%text(), 'signal SIGTERM')
  deallocate (path)
  call test%finish()

contains

  subroutine kill_self(name)
    character(len=*), intent(in) :: name
    call execute_command_line('kill -'//name//' '//str(process_id()))
  end subroutine kill_self
end program test_talus_stop
