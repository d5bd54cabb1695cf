!> Numbers to text and back.
program test_talus_text
  use talus_kinds, only: wp
  use talus_text, only: str, lower, starts_with
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test

  call test%check_text('one', str(1.0_wp), '1')
  call test%check_text('large', str(29.0e9_wp), '2.9e10')
  call test%check_text('small', str(5.0e-6_wp), '5e-6')
  call test%check_text('tenth', str(0.1_wp), '0.1')
  call test%check_text('negative', str(-1250.5_wp), '-1250.5')
  call test%check_text('zero', str(0.0_wp), '0')
  call test%check_text('third', str(1.0_wp/3.0_wp), '0.33333333333333331')
  call test%check_text('vector', str([1.0_wp, 2.5_wp]), '1, 2.5')
  call test%check_text('lower', lower('AbC'), 'abc')
  call test%check('starts', starts_with('shm:/x', 'shm:'))
  call test%finish()
end program test_talus_text
