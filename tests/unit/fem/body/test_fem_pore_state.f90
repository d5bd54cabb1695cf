!> A partner of the liquid in a solid: what it lets in, what its nodes store besides the pores.
program test_fem_pore_state
  use talus_kinds, only: wp, i4
  use talus_curve, only: curve_type
  use talus_test, only: test_type
  use fem_pore_state, only: fem_pore_state_type
  implicit none
  type(test_type) :: test
  type(fem_pore_state_type) :: pore
  type(curve_type) :: curve(0)

  call make_state()
  call check_inflow()
  call check_storage()
  call test%finish()

contains

  !> Six blocks, the last four with pressures; no other inflow.
  subroutine make_state()
    pore%active = .true.
    allocate (pore%inflow(0), pore%leak(0), pore%held(0))
    call pore%expect_partner(6_i4)
    allocate (pore%given(6), pore%rate(6), pore%gross(6), source=0.0_wp)
    allocate (pore%start(3, 6), source=0.0_wp)
    pore%start(1, 3:) = 100.0_wp
  end subroutine make_state

  !> A volume in a step is a rate over it; one that is not said again stays.
  subroutine check_inflow()
    call test%check('an inflow of its own', pore%partner == 1)
    call test%check('named so', pore%inflow(1)%name == 'partner')
    call pore%let_partner_in([4_i4, 6_i4], [2.0e-9_wp, -1.0e-9_wp], 0.5_wp)
    call pore%begin(curve, 1.0_wp, 1.5_wp)
    call test%check_all_close('rates', pore%given, [0.0_wp, 0.0_wp, 0.0_wp, 4.0e-9_wp, 0.0_wp, &
                                                    -2.0e-9_wp], 1.0e-24_wp)
    call test%check_close('length of the step', pore%step%dt, 0.5_wp, 1.0e-15_wp)
  end subroutine check_inflow

  !> A rise of pressure takes S dp from the row of the node, content counts from the start.
  subroutine check_storage()
    real(wp) :: moved(3, 6), total(3, 6), u(3, 6), kept(2)
    pore%beside = 0.0_wp
    pore%beside(4) = 3.0e-12_wp
    moved = 0.0_wp
    moved(1, 3:) = -20.0_wp
    total = 1.0e-9_wp
    call pore%store_beside(moved, total)
    call test%check_all_close('volume given back', total(1, :) - 1.0e-9_wp, &
                              [0.0_wp, 0.0_wp, 0.0_wp, 6.0e-11_wp, 0.0_wp, 0.0_wp], 1.0e-24_wp)
    call test%check_all_close('no force', total(2:, :), spread(spread(1.0e-9_wp, 1, 2), 2, 6), &
                              0.0_wp)
    call test%check_close('size of the balance', sum(pore%gross), 6.0e-11_wp, 1.0e-24_wp)
    u = pore%start
    u(1, 3:) = 80.0_wp
    kept = pore%kept_beside(u)
    call test%check_close('content since the start', kept(1), -6.0e-11_wp, 1.0e-24_wp)
    call test%check_close('energy', kept(2), 0.5_wp*3.0e-12_wp*6400.0_wp, 1.0e-22_wp)
  end subroutine check_storage
end program test_fem_pore_state
