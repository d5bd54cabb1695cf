!> Time histories: full precision, cut at restart, full disk and other columns reported.
program test_talus_history
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_files, only: make_folder, read_file, replace_file
  use talus_history, only: history_type
  use talus_system, only: process_id, install_signals
  use talus_test, only: test_type
  use talus_text, only: str, string_type
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder
  type(string_type) :: columns(3)

  columns(1)%s = 'time [s]'
  columns(2)%s = 'kinetic [J]'
  columns(3)%s = 'elastic [J]'
  folder = '/tmp/talus_test_history_'//str(process_id())
  call install_signals(.true.)
  call make_folder(folder, errors)
  call round_trip()
  call restart_equals_whole()
  call torn_last_row()
  call faults()
  call no_numbers()
  call execute_command_line('rm -rf '//folder)
  deallocate (folder)
  call test%finish()

contains

  subroutine rows(history, first, last)
    type(history_type), intent(inout) :: history
    integer, intent(in) :: first, last
    integer :: k
    do k = first, last
      call history%write([0.1_wp*k, sin(real(k, wp)), -1.0e-123_wp/(k + 1)], errors)
    end do
  end subroutine rows

  subroutine round_trip()
    type(history_type) :: history
    character(len=:), allocatable :: text
    integer :: first
    real(wp) :: values(3)
    call history%open(folder//'/a.csv', columns, .false., errors)
    call rows(history, 1, 2000)
    call history%close(errors)
    call test%check('no faults', .not. errors%any())
    call read_file(folder//'/a.csv', text, errors)
    first = index(text, new_line('a'))
    call test%check_text('header', text(:first - 1), 'time [s],kinetic [J],elastic [J]')
    read (text(first + 1:), *) values
    call test%check('values come back bit for bit', &
                    all(abs(values - [0.1_wp, sin(1.0_wp), -1.0e-123_wp/2]) <= 0.0_wp))
    call test%check('all rows', count_lines(text) == 2001)
  end subroutine round_trip

  !> NaN and infinity are written and reported, once a file.
  subroutine no_numbers()
    type(history_type) :: history
    character(len=:), allocatable :: text
    real(wp) :: nothing
    call history%open(folder//'/n.csv', columns, .false., errors)
    call history%write([0.1_wp, 1.0_wp, 2.0_wp], errors)
    call test%check('numbers are no fault', .not. errors%any())
    nothing = ieee_value(nothing, ieee_quiet_nan)
    call history%write([0.2_wp, 1.0_wp, nothing], errors)
    call test%check('NaN is one fault', errors%count == 1)
    call test%check_text('its code', errors%item(1)%code, 'N002')
    call test%check('column and time', index(errors%item(1)%message, 'elastic [J] is NaN at time ' &
                                             //'0.2 s') > 0)
    call errors%clear()
    call history%write([0.3_wp, ieee_value(nothing, ieee_positive_inf), 2.0_wp], errors)
    call history%close(errors)
    call test%check('said once', .not. errors%any())
    call read_file(folder//'/n.csv', text, errors)
    call test%check('all rows are there', count_lines(text) == 4)
  end subroutine no_numbers

  !> 0 to 20 at once equals 0 to 15, killed, continued from 10 to 20.
  subroutine restart_equals_whole()
    type(history_type) :: history
    character(len=:), allocatable :: whole, parts
    call history%open(folder//'/whole.csv', columns, .false., errors)
    call rows(history, 0, 20)
    call history%close(errors)
    call history%open(folder//'/parts.csv', columns, .false., errors)
    call rows(history, 0, 15)
    call history%close(errors)
    call history%resume(folder//'/parts.csv', columns, 0.1_wp*10, errors)
    call test%check('rows of an earlier run', .not. history%fresh)
    call rows(history, 11, 20)
    call history%close(errors)
    call read_file(folder//'/whole.csv', whole, errors)
    call read_file(folder//'/parts.csv', parts, errors)
    call test%check('restarted file equals the whole one', whole == parts)
    call history%resume(folder//'/new.csv', columns, 1.0_wp, errors)
    call test%check('no row of an earlier run', history%fresh)
    call history%close(errors)
    call read_file(folder//'/new.csv', parts, errors)
    call test%check('a missing file is begun', count_lines(parts) == 1)
    call history%open(folder//'/parts.csv', columns, .true., errors)
    call rows(history, 21, 21)
    call history%close(errors)
    call read_file(folder//'/parts.csv', parts, errors)
    call test%check('appended', parts(:len(whole)) == whole .and. count_lines(parts) == 23)
    call test%check('no faults at restart', .not. errors%any())
  end subroutine restart_equals_whole

  subroutine torn_last_row()
    type(history_type) :: history
    character(len=:), allocatable :: text
    character(len=*), parameter :: nl = new_line('a')
    call replace_file(folder//'/torn.csv', 'time [s],kinetic [J],elastic [J]'//nl//'0,1,2'//nl// &
                      '0.1,3,4'//nl//'0.2,5', errors)
    call history%resume(folder//'/torn.csv', columns, 1.0_wp, errors)
    call history%close(errors)
    call read_file(folder//'/torn.csv', text, errors)
    call test%check('a torn row is cut', count_lines(text) == 3 .and. index(text, '0.2') == 0)
  end subroutine torn_last_row

  subroutine faults()
    type(history_type) :: history
    call history%resume(folder//'/a.csv', columns(1:2), 1.0_wp, errors)
    call expect('other columns', 'S010', 'other columns')
    call history%open('/dev/full', columns, .false., errors)
    call expect('full disk at the header', 'S002', 'No space left')
    call history%open('/dev/full', columns, .true., errors)
    call rows(history, 1, 5)
    call test%check('rows wait in the buffer', .not. errors%any())
    call history%flush(errors)
    call expect('full disk at flush', 'S002', 'No space left')
    call rows(history, 1, 5000)
    call history%close(errors)
    call test%check('reported once only', .not. errors%any())
    call history%open(folder//'/a.csv/b.csv', columns, .false., errors)
    call expect('unwritable', 'S001', 'Not a directory')
    call history%write([0.0_wp, 0.0_wp, 0.0_wp], errors)
    call history%close(errors)
    call test%check('not open: nothing happens', .not. errors%any())
  end subroutine faults

  subroutine expect(name, code, part)
    character(len=*), intent(in) :: name, code, part
    call test%check(name//': one fault', errors%count == 1)
    if (errors%count > 0) then
      call test%check_text(name//': code', errors%item(1)%code, code)
      call test%check(name//': text '//errors%text(1), index(errors%text(1), part) > 0)
    end if
    call errors%clear()
  end subroutine expect

  pure integer function count_lines(text)
    character(len=*), intent(in) :: text
    integer :: k
    count_lines = 0
    do k = 1, len(text)
      if (text(k:k) == new_line('a')) count_lines = count_lines + 1
    end do
  end function count_lines
end program test_talus_history
