!> Nearest names.
program test_talus_suggest
  use talus_text, only: string_type, append_string
  use talus_suggest, only: edit_distance, nearest_name, did_you_mean
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test
  type(string_type), allocatable :: names(:)

  call append_string(names, 'young')
  call append_string(names, 'poisson')
  call append_string(names, 'density')
  call append_string(names, 'tangential_stiffness')
  call test%check('same', edit_distance('young', 'young') == 0)
  call test%check('swap', edit_distance('yuong', 'young') == 1)
  call test%check('insert', edit_distance('youngs', 'young') == 1)
  call test%check('replace and delete', edit_distance('kitten', 'sitin') == 3)
  call test%check('empty', edit_distance('', 'abc') == 3)
  call test%check_text('nearest', nearest_name('yuong', names), 'young')
  call test%check_text('case', nearest_name('YOUNG_', names), 'young')
  call test%check_text('holds the other', nearest_name('youngs_modulus', names), 'young')
  call test%check_text('part of the other', nearest_name('stiffness', names), &
                       'tangential_stiffness')
  call test%check_text('none', nearest_name('mesh', names), '')
  call test%check_text('no name', nearest_name('', names), '')
  call test%check_text('hint', did_you_mean('densty', names, 'keys:'), 'did you mean ''density''?')
  call test%check_text('list', did_you_mean('zz', names(:2), 'keys:'), 'keys: young, poisson')
  call test%finish()
end program test_talus_suggest
