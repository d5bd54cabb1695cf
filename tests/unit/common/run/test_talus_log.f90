!> The log: contents of the file, numbers for people, spacing of rows, full disk.
program test_talus_log
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, read_file, remove_file
  use talus_log, only: log_type, short_number, duration_text
  use talus_system, only: process_id, install_signals
  use talus_test, only: test_type
  use talus_text, only: str, string_type
  use talus_timers, only: timers_type
  use talus_version, only: git_hash, version_text
  implicit none
  character(len=*), parameter :: nl = new_line('a')
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: path

  call install_signals(.true.)
  path = '/tmp/talus_test_log_'//str(process_id())//'.log'
  call numbers()
  call whole_log()
  call faults()
  call held_back()
  call remove_file(path)
  deallocate (path)
  call test%finish()

contains

  !> Lines of a log that is held go to the file when it is opened; before, there is none.
  subroutine held_back()
    type(log_type) :: log
    character(len=:), allocatable :: text
    call remove_file(path)
    log%screen = .false.
    call log%hold()
    call log%line('first')
    call test%check('held: no file yet', .not. file_exists(path))
    call log%open(path, errors)
    call log%line('second')
    call log%close()
    call read_file(path, text, errors)
    call test%check_text('held: all lines in order', text, 'first'//nl//'second'//nl)
  end subroutine held_back

  subroutine numbers()
    call test%check_text('zero', short_number(0.0_wp), '0')
    call test%check_text('whole', short_number(2760.0_wp), '2760')
    call test%check_text('negative', short_number(-1.5_wp), '-1.5000')
    call test%check_text('small', short_number(1.23456e-5_wp), '1.2346E-05')
    call test%check_text('below one', short_number(0.25_wp), '0.25000')
    call test%check_text('thousands', short_number(12345.6_wp), '12346.')
    call test%check_text('no number', short_number(ieee_value(1.0_wp, ieee_quiet_nan)), 'NaN')
    call test%check_text('large', short_number(1.5e12_wp), '1.5000E+12')
    call test%check_text('seconds', duration_text(41.7_wp), '42 s')
    call test%check_text('minutes', duration_text(200.0_wp), '3 min 20 s')
    call test%check_text('hours', duration_text(18720.0_wp), '5 h 12 min')
  end subroutine numbers

  subroutine whole_log()
    type(log_type) :: log
    type(timers_type) :: timers
    type(string_type) :: echo(1), titles(3)
    character(len=:), allocatable :: text

    echo(1)%s = '&run t_end = 0.4'
    titles(1)%s = 'time [s]'
    titles(2)%s = 'contacts'
    titles(3)%s = 'a wide column'
    call timers%init()
    call timers%start('contacts')
    call timers%stop('contacts')
    call log%open(path, errors, screen=.false.)
    call log%header('talus-dem', 'a title', 'grains.nml', 'abc123', 1, 2)
    call log%deck_echo(echo)
    call log%section('Model')
    call log%item('grains', '2760', 'free 2600')
    call log%memory()
    call log%warn('something')
    call log%row_titles(titles)
    call test%check('first row at once', log%row_due())
    call test%check('next row later', .not. log%row_due())
    call log%row([0.25_wp, 8000.0_wp, 1.0e-9_wp])
    call log%progress(0.5_wp, 'half')
    call log%health('energy error 1e-5')
    call log%timer_table(timers)
    call log%finish('talus-dem', 0, 't = 0.4 s')
    call log%close()
    call read_file(path, text, errors)
    call test%check('no faults', .not. errors%any())
    call has(text, 'talus-dem '//version_text()//', git '//git_hash()//nl)
    call has(text, '  deck hash               abc123'//nl)
    call has(text, '  ranks x threads         1 x 2'//nl)
    call has(text, nl//'Deck as understood'//nl//'  &run t_end = 0.4'//nl)
    call has(text, nl//'Model'//nl//'  grains                  2760   free 2600'//nl)
    call has(text, 'warning: something'//nl)
    call has(text, '    time [s]    contacts  a wide column'//nl)
    call has(text, '     0.25000        8000     1.0000E-09'//nl)
    call has(text, nl//'health: energy error 1e-5'//nl)
    call has(text, '(whole)')
    call has(text, nl//'talus-dem: finished, exit 0, wall ')
    call has(text, ' s, t = 0.4 s'//nl)
    call test%check('no bar in the file', index(text, '====') == 0)
    call log%open(path, errors, append=.true., screen=.false.)
    call log%finish('talus-dem', 3, '')
    call log%close()
    call read_file(path, text, errors)
    call has(text, 'talus-dem: stopped early on request, exit 3, wall ')
    call has(text, 'talus-dem: finished, exit 0, wall ')
  end subroutine whole_log

  subroutine faults()
    type(log_type) :: log
    call log%open(path//'/under.log', errors, screen=.false.)
    call test%check('unwritable: one fault', errors%count == 1)
    if (errors%any()) call test%check_text('unwritable', errors%item(1)%code, 'S001')
    call errors%clear()
    call log%line('goes nowhere')
    call log%close()
    call test%check('and the run goes on', .not. errors%any())
    errors%count = 0
    call errors%add('S002', 'no room', 'a.h5', 'make room')
    call log%open(path, errors, screen=.false.)
    call log%faults(errors)
    call log%close()
    call has_file('error S002: no room'//nl//'  at a.h5'//nl//'  hint: make room'//nl)
    call errors%clear()
  end subroutine faults

  subroutine has_file(part)
    character(len=*), intent(in) :: part
    character(len=:), allocatable :: text
    call read_file(path, text, errors)
    call has(text, part)
  end subroutine has_file

  subroutine has(text, part)
    character(len=*), intent(in) :: text, part
    call test%check('log has "'//part//'"', index(text, part) > 0)
  end subroutine has
end program test_talus_log
