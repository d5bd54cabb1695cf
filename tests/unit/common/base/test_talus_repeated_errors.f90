!> Faults that occur often: the first few by name, the rest as a count.
program test_talus_repeated_errors
  use talus_kinds, only: i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_repeated_errors, only: repeated_errors_type, most_alike
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  type(repeated_errors_type) :: few
  integer(i4) :: k

  do k = 1, most_alike
    call few%add('I210', 'grain '//str(k), 'mend it', errors)
  end do
  call few%finish('grains', errors)
  call test%check('as many as are reported', errors%count == most_alike)
  call errors%clear()
  do k = 1, 1000
    call few%add('I210', 'grain '//str(k), 'mend it', errors)
    if (modulo(k, 100) == 0) call few%add('I212', 'turned '//str(k), 'turn it', errors)
    if (k == 7) call few%add('I214', 'alone', 'let it be', errors)
  end do
  call few%finish('grains', errors)
  call test%check('five, five, one and two counts', errors%count == 2*most_alike + 3)
  call test%check_text('first', errors%text(1), 'error I210: grain 1'//new_line('a')// &
                       '  hint: mend it')
  call test%check_text('rest', errors%item(errors%count - 1)%message, &
                       'and 995 more grains with this fault')
  call test%check_text('of its code', errors%item(errors%count - 1)%code, 'I210')
  call test%check_text('rest of the other', errors%item(errors%count)%message, &
                       'and 5 more grains with this fault')
  call test%check('exit code', errors%exit_code() == 1)
  call errors%clear()
  call few%add('I210', 'again', 'mend it', errors)
  call few%finish('grains', errors)
  call test%check('finish starts a new count', errors%count == 1)
  call test%finish()
end program test_talus_repeated_errors
