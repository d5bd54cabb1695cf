!> Whole intervals until a time, also where there are more than can be counted.
program test_talus_intervals
  use talus_kinds, only: wp, i8
  use talus_intervals, only: intervals_until
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test

  call test%check('none yet', intervals_until(0.9_wp, 1.0_wp) == 0)
  call test%check('one', intervals_until(1.0_wp, 1.0_wp) == 1)
  call test%check('before 0', intervals_until(-0.1_wp, 1.0_wp) == -1)
  call test%check('many', intervals_until(1.0_wp, 2.0_wp**(-52)) == 2_i8**52)
  call test%check('too many', intervals_until(1.0e18_wp, 1.0e-4_wp) == 4000000000000000000_i8)
  call test%check('too many before 0', &
                  intervals_until(-1.0e18_wp, 1.0e-4_wp) == -4000000000000000000_i8)
  call test%finish()
end program test_talus_intervals
