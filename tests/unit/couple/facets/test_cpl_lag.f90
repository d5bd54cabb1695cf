!> The lag over windows of exchanges: one warning when it is large and stays, none while it falls.
program test_cpl_lag
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_choices, only: interface_aitken, interface_none, interface_springs, scheme_average, &
    scheme_iterated
  use talus_log, only: short_number
  use cpl_lag, only: lag_type, lag_limit
  implicit none
  type(test_type) :: test

  call small()
  call falls()
  call stays()
  call weighted()
  call test%finish()

contains

  !> Exchanges count by their forces: 0.5 of 1 N and 0.01 of 99 N are 0.0149 of all.
  subroutine weighted()
    type(lag_type) :: lag
    call test%check_close('weighted: nothing yet', lag%overall(), 0.0_wp, 0.0_wp)
    call lag%note(0.5_wp, 1.0_wp)
    call lag%note(0.01_wp, 99.0_wp)
    call test%check_close('weighted: of all forces', lag%overall(), 0.0149_wp, 1.0e-14_wp)
  end subroutine weighted

  subroutine small()
    type(lag_type) :: lag
    integer(i4) :: k
    do k = 1, 200
      call lag%note(0.5_wp*lag_limit, 1.0_wp)
    end do
    call test%check('small: no stall', lag%stalls == 0)
    call test%check_close('small: mean', lag%mean, 0.5_wp*lag_limit, 1.0e-14_wp)
    call test%check_text('small: no warning', &
                         lag%warning(interface_springs, scheme_average, 1.0e-4_wp), '')
  end subroutine small

  !> Large at first, but each exchange carries a twentieth more.
  subroutine falls()
    type(lag_type) :: lag
    integer(i4) :: k
    do k = 1, 150
      call lag%note(0.95_wp**k, 1.0_wp)
    end do
    call test%check('falls: no stall', lag%stalls == 0)
    call test%check('falls: the last is known', lag%now < 1.0e-3_wp)
  end subroutine falls

  !> A limit cycle: told once, with what to change.
  subroutine stays()
    type(lag_type) :: lag
    character(len=:), allocatable :: text
    integer(i4) :: k
    do k = 1, 100
      call lag%note(merge(0.9_wp, 0.05_wp, mod(k, 2) == 0), 1.0_wp)
    end do
    call test%check('stays: two windows', lag%stalls == 2)
    text = lag%warning(interface_aitken, scheme_average, 1.0e-4_wp)
    call test%check('stays: limit cycle', index(text, 'limit cycle') > 0)
    call test%check('stays: what to write', index(text, "interface = 'springs'") > 0)
    call test%check_text('stays: told once', &
                         lag%warning(interface_aitken, scheme_average, 1.0e-4_wp), '')
    lag%warned = .false.
    text = lag%warning(interface_springs, scheme_average, 1.0e-4_wp)
    call test%check('springs: which exchange', index(text, '&clock exchange = '// &
      short_number(1.0e-4_wp*sqrt(lag_limit/lag%mean))//' would bring it to 2') > 0)
    lag%warned = .false.
    text = lag%warning(interface_none, scheme_iterated, 1.0e-4_wp)
    call test%check('iterated: tolerance', index(text, 'tolerance') > 0)
  end subroutine stays
end program test_cpl_lag
