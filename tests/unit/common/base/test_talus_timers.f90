!> Timers: sums, calls and the table.
program test_talus_timers
  use talus_kinds, only: wp, i4
  use talus_system, only: wall_clock
  use talus_test, only: test_type
  use talus_text, only: string_type
  use talus_timers, only: timers_type
  implicit none
  type(test_type) :: test
  type(timers_type) :: timers
  type(string_type), allocatable :: lines(:)
  integer(i4) :: short, long, again
  real(wp) :: before, after

  call timers%init()
  call timers%index('contacts', long)
  call timers%index('output', short)
  call timers%index('contacts', again)
  call test%check('same name, same timer', again == long .and. timers%count == 2)
  before = wall_clock()
  call timers%start(long)
  call wait(0.02_wp)
  call timers%stop(long)
  after = wall_clock()
  call test%check('between the clocks', timers%seconds(long) >= 0.02_wp .and. &
                  timers%seconds(long) <= after - before)
  call timers%stop(long)
  call test%check('a stop without start counts nothing', timers%seconds(long) <= after - before)
  call test%check_close('all of it between the clocks', timers%within(long, before, after), &
                        timers%seconds(long), 1.0e-12_wp)
  call test%check_close('nothing of it before', timers%within(long, before - 1.0_wp, before), &
                        0.0_wp, 0.0_wp)
  call test%check_close('parts of it add up', &
                        timers%within(long, before, 0.5_wp*(before + after)) &
                        + timers%within(long, 0.5_wp*(before + after), after), &
                        timers%seconds(long), 1.0e-9_wp)
  call timers%start('output')
  call timers%stop('output')
  call test%check('by name', timers%seconds(short) >= 0.0_wp)
  call test%check('whole time', timers%elapsed() >= timers%seconds(long) + timers%seconds(short))
  call timers%table(lines)
  call test%check('title, two timers, rest, whole', size(lines) == 5)
  call test%check('longest first', index(lines(2)%s, 'contacts') > 0)
  call test%check('calls', lines(2)%s(len(lines(2)%s) - 1:) == ' 1')
  call test%check('whole last', index(lines(5)%s, '(whole)') > 0 .and. &
                  index(lines(5)%s, '100.0 %') > 0)
  call timers%init()
  call test%check('init forgets', timers%count == 0)
  call test%finish()

contains

  subroutine wait(seconds)
    real(wp), intent(in) :: seconds
    real(wp) :: begun
    begun = wall_clock()
    do while (wall_clock() - begun < seconds)
    end do
  end subroutine wait
end program test_talus_timers
