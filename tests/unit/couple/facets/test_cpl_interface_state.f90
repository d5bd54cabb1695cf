!> Forces of the interface and the watch on its stiffness, on numbers that are exact.
program test_cpl_interface_state
  use talus_kinds, only: wp
  use talus_test, only: test_type
  use cpl_interface_state, only: interface_forces_type, interface_watch_type
  implicit none

  type(test_type) :: test
  type(interface_forces_type) :: forces
  type(interface_watch_type) :: watch
  real(wp) :: p(6, 2)

  allocate (forces%p_mean(6, 2), source=0.0_wp)
  p = 4.0_wp
  p(1, 2) = -9.0_wp
  call forces%begin(p)
  call forces%foretell(.true.)
  call test%check_all_close('a force that rests goes on', forces%p_mean - p, 0.0_wp, 0.0_wp)
  forces%p_end = 2.0_wp*p
  call forces%foretell(.true.)
  call test%check_all_close('two forces lead half an interval on', forces%p_mean - 2.5_wp*p, &
                            0.0_wp, 0.0_wp)
  forces%p_end = 4.0_wp*p
  call forces%foretell(.false.)
  call test%check_all_close('the last force', forces%p_mean - 4.0_wp*p, 0.0_wp, 0.0_wp)
  call test%check_all_close('is that of the interval before', forces%p_before - 4.0_wp*p, 0.0_wp, &
                            0.0_wp)
  call forces%average(p(:3, :), p(4:, :), 0.5_wp)
  call test%check_all_close('mean force', forces%p_mean(:3, :) - 2.0_wp*p(:3, :), 0.0_wp, 0.0_wp)
  call test%check_all_close('mean moment', forces%p_mean(4:, :), 8.0_wp, 0.0_wp)
  call test%check_all_close('the same beside', forces%m_mean, 8.0_wp, 0.0_wp)
  call watch%note_stiffness([1.0_wp, 3.0_wp, 2.0_wp])
  call watch%note_force(p)
  call test%check_close('stiffest contact', watch%contact_stiffness, 3.0_wp, 0.0_wp)
  call test%check_close('largest force', watch%force_at_check, 9.0_wp, 0.0_wp)
  call test%finish()
end program test_cpl_interface_state
