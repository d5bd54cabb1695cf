!> What an overlap is made of: each procedure does to its components what it says, on numbers that
!! are exact.
program test_cpl_overlap_state
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_overlap_forces, only: overlap_forces_type
  use cpl_overlap_motion, only: overlap_motion_type
  use cpl_overlap_state, only: overlap_ledger_type, overlap_own_type
  implicit none

  type(test_type) :: test

  call motion_counts()
  call ghosts_come_in_pieces()
  call start_is_held()
  call bulk_and_steady()
  call masses_and_works()
  call test%finish()

contains

  !> Two free grains, two nodes (one prescribed), three ghosts.
  subroutine motion_counts()
    type(overlap_motion_type) :: motion
    real(wp) :: x(3, 2), theta(3, 2), quat(4, 3)
    quat = 0.5_wp
    call motion%init(2, 2, 2, quat)
    motion%q = 5.0_wp
    motion%theta = 3.0_wp
    x = 1.0_wp
    theta = 2.0_wp
    call motion%count_free(x)
    call test%check_all_close('free grains', motion%q, 4.0_wp, 0.0_wp)
    call test%check_all_close('rotations are left', motion%theta, 3.0_wp, 0.0_wp)
    call motion%count_free(x, theta)
    call test%check_all_close('rotations', motion%theta, 1.0_wp, 0.0_wp)
    call motion%count_ghosts(spread(x(:, 1), 2, 3), spread(theta(:, 1), 2, 3))
    call test%check_all_close('ghosts', motion%d, -1.0_wp, 0.0_wp)
    call test%check_all_close('ghosts turned', motion%turn, -2.0_wp, 0.0_wp)
    call motion%begin_speed(1_i4, x(:, :1))
    call motion%begin_spin(1_i4, theta(:, :1))
    call test%check_all_close('the edge begins', motion%v(:, 2), 1.0_wp, 0.0_wp)
    call test%check_all_close('and turns', motion%w(:, 2), 2.0_wp, 0.0_wp)
    call test%check_all_close('prescribed nodes rest', [motion%v(:, 1), motion%w(:, 1)], 0.0_wp, &
                              0.0_wp)
  end subroutine motion_counts

  subroutine ghosts_come_in_pieces()
    type(overlap_motion_type) :: motion
    real(wp), allocatable :: d(:, :), turn(:, :)
    real(wp) :: quat(4, 3), new(3, 3)
    quat = 0.5_wp
    new(:, 1) = 1.0_wp
    new(:, 2) = 2.0_wp
    new(:, 3) = 3.0_wp
    call motion%init(1, 1, 0, quat)
    motion%d = 7.0_wp
    motion%turn = 8.0_wp
    call motion%begin_ghosts(d, turn)
    call test%check_all_close('what was is handed over', d, 7.0_wp, 0.0_wp)
    call test%check_all_close('with rotations', turn, 8.0_wp, 0.0_wp)
    call motion%put_ghosts([3_i4, 1_i4], new(:, [3, 1]), 2.0_wp*new(:, [3, 1]))
    call motion%put_ghosts([2_i4], new(:, 2:2), 2.0_wp*new(:, 2:2))
    call test%check_all_close('all ghosts are placed', motion%d - new, 0.0_wp, 0.0_wp)
    call test%check_all_close('and turned', motion%turn - 2.0_wp*new, 0.0_wp, 0.0_wp)
  end subroutine ghosts_come_in_pieces

  subroutine start_is_held()
    type(overlap_forces_type) :: forces
    call forces%init(1, 1, 2, 2, 1, 1)
    forces%force = 4.0_wp
    forces%moment = 3.0_wp
    forces%f = 2.0_wp
    forces%c = 1.0_wp
    forces%element = 6.0_wp
    forces%element_phi = 5.0_wp
    forces%parts%dead_known = .true.
    call forces%hold()
    call test%check_all_close('free grains are held', forces%force_hold, -4.0_wp, 0.0_wp)
    call test%check_all_close('their moments', forces%moment_hold, -3.0_wp, 0.0_wp)
    call test%check_all_close('nodes are held', forces%f_hold, -2.0_wp, 0.0_wp)
    call test%check_all_close('their couples', forces%c_hold, -1.0_wp, 0.0_wp)
    call test%check_all_close('nothing is left there', [forces%f, forces%c], 0.0_wp, 0.0_wp)
    call test%check('dead loads are others', .not. forces%parts%dead_known)
    call forces%take_elements()
    call test%check_all_close('elements beside what is held', forces%f, 4.0_wp, 0.0_wp)
    call test%check_all_close('couples beside it', forces%c, 4.0_wp, 0.0_wp)
  end subroutine start_is_held

  subroutine bulk_and_steady()
    type(overlap_forces_type) :: forces
    real(wp), dimension(3, 1) :: f, c, push, turn
    call forces%init(1, 1, 2, 2, 1, 1)
    forces%bulk = 10.0_wp
    forces%bulk_phi = 20.0_wp
    forces%element = 1.0_wp
    forces%element_phi = 2.0_wp
    call forces%take_reactions()
    call test%check_all_close('reactions less elements', forces%bulk, -11.0_wp, 0.0_wp)
    call test%check_all_close('couples too', forces%bulk_phi, -22.0_wp, 0.0_wp)
    call forces%make_steady(1_i4, 1_i4)
    call test%check_all_close('steady on the edge', forces%steady(:, 2), -11.0_wp, 0.0_wp)
    call test%check_all_close('not on prescribed nodes', forces%steady(:, 1), 0.0_wp, 0.0_wp)
    call test%check_all_close('nothing is left in kicks', forces%bulk(:, 2), 0.0_wp, 0.0_wp)
    call test%check_all_close('nor of couples', forces%bulk_phi(:, 2), 0.0_wp, 0.0_wp)
    call forces%add_weight([1.0_wp, 2.0_wp], [0.0_wp, 0.0_wp, -9.0_wp])
    call test%check_all_close('weight of a node', forces%bulk(:, 2), [0.0_wp, 0.0_wp, -18.0_wp], &
                              0.0_wp)
    f = 1.0_wp
    c = 2.0_wp
    push = 3.0_wp
    turn = 4.0_wp
    call forces%renew_loads(f, c, push, turn)
    call forces%renew_loads(f, c, push, turn)
    call test%check_all_close('new loads', [forces%loads%f - f, forces%loads%c - c], 0.0_wp, 0.0_wp)
    call test%check_all_close('add to forces', forces%force, 6.0_wp, 0.0_wp)
    call test%check_all_close('and moments', forces%moment, 8.0_wp, 0.0_wp)
  end subroutine bulk_and_steady

  subroutine masses_and_works()
    type(overlap_own_type) :: own
    type(overlap_ledger_type) :: ledger
    call own%take_masses([1.0_wp, 2.0_wp], [3.0_wp, 4.0_wp])
    call own%drop_masses([.true., .false.])
    call own%drop_inertias([.false., .true.])
    call test%check_all_close('masses that are kept', own%mass, [1.0_wp, 0.0_wp], 0.0_wp)
    call test%check_all_close('inertias that are kept', own%inertia, [0.0_wp, 4.0_wp], 0.0_wp)
    call ledger%lose(5.0_wp, 3.0_wp)
    call ledger%lose(1.0_wp, 0.0_wp)
    call ledger%hold_to(7.0_wp)
    call test%check_close('what binds takes', ledger%lost, 3.0_wp, 0.0_wp)
    call test%check_close('what is held', ledger%hold_work, 7.0_wp, 0.0_wp)
  end subroutine masses_and_works
end program test_cpl_overlap_state
