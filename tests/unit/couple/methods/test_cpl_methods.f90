!> Every method that a coupled deck can name has its line in the registry.
program test_cpl_methods
  use talus_kinds, only: i4
  use talus_deck_table, only: key_table_type
  use talus_test, only: test_type
  use cpl_deck_keys, only: cpl_deck_table
  use cpl_method, only: cpl_method_type
  use cpl_methods, only: choose_method
  implicit none

  type(test_type) :: test
  type(key_table_type) :: table
  integer(i4) :: g, k, c

  call cpl_deck_table(table)
  g = table%find('overlap')
  k = table%group(g)%find('method')
  call test%check('the deck has methods', size(table%group(g)%key(k)%choice) >= 3)
  do c = 1, size(table%group(g)%key(k)%choice)
    call chosen(table%group(g)%key(k)%choice(c)%s)
  end do
  call chosen('facets')
  call chosen('static_overlap')
  call test%finish()

contains

  subroutine chosen(name)
    character(len=*), intent(in) :: name
    class(cpl_method_type), allocatable :: method
    call choose_method(name, method)
    call test%check(name//' is there and has not stepped', allocated(method))
    if (allocated(method)) call test%check(name//' begins at exchange 0', method%step == 0)
  end subroutine chosen
end program test_cpl_methods
