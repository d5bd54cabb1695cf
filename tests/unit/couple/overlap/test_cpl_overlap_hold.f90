!> The largest force that nothing balances in the solid: free components alone count.
program test_cpl_overlap_hold
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_overlap_hold, only: rest_beyond
  implicit none

  type(test_type) :: test
  real(wp) :: rest(3, 4), load(3, 4), largest, share
  logical :: free(3, 4)
  integer(i4) :: node

  rest(:, 1) = [100.0_wp, 0.0_wp, 0.0_wp]  ! held along x
  rest(:, 2) = [0.0_wp, 3.0_wp, -4.0_wp]
  rest(:, 3) = [0.0_wp, 0.0_wp, 4.9_wp]
  rest(:, 4) = [9.0_wp, 9.0_wp, 9.0_wp]    ! moved by the coupling
  load = 0.0_wp
  load(3, 3) = -20.0_wp
  load(1, 4) = 1000.0_wp
  free = .true.
  free(1, 1) = .false.
  free(:, 4) = .false.
  call rest_beyond(rest, load, free, largest, node, share)
  call test%check_close('largest', largest, 5.0_wp, 1.0e-15_wp)
  call test%check('where', node == 2)
  call test%check_close('share of the largest load', share, 0.25_wp, 1.0e-15_wp)
  call rest_beyond(0.0_wp*rest, load, free, largest, node, share)
  call test%check('in balance', node == 1 .and. .not. largest > 0.0_wp .and. .not. share > 0.0_wp)
  free = .false.
  call rest_beyond(rest, load, free, largest, node, share)
  call test%check('nothing is free', node == 0 .and. .not. largest > 0.0_wp)
  call test%finish()
end program test_cpl_overlap_hold
