!> Masses of ghosts from the list of all grains, in any order.
program test_cpl_ghost_mass
  use talus_kinds, only: wp, i8
  use talus_test, only: test_type
  use cpl_ghost_mass, only: values_of
  implicit none
  type(test_type) :: test
  integer(i8), parameter :: all_id(6) = [7_i8, 2_i8, 90_i8, 4_i8, 5_i8, 1_i8]
  real(wp), parameter :: mass(6) = [0.7_wp, 0.2_wp, 9.0_wp, 0.4_wp, 0.5_wp, 0.1_wp]
  real(wp), parameter :: none(0) = [real(wp) ::]

  call test%check_all_close('of each, 0 of others', &
                            values_of([5_i8, 91_i8, 1_i8, 90_i8, 3_i8, 0_i8], all_id, mass), &
                            [0.5_wp, 0.0_wp, 0.1_wp, 9.0_wp, 0.0_wp, 0.0_wp], 0.0_wp)
  call test%check('none asked for', size(values_of([integer(i8) ::], all_id, mass)) == 0)
  call test%check_all_close('none there', values_of([5_i8, 1_i8], [integer(i8) ::], none), 0.0_wp, &
                            0.0_wp)
  call test%finish()
end program test_cpl_ghost_mass
