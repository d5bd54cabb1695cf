!> Figures of health: green, amber, red, allowed; what is no number is red.
program test_talus_health
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use talus_kinds, only: wp
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_errors, only: error_list_type
  use talus_files, only: remove_file, replace_file
  use talus_health, only: health_type, green, amber, red
  use talus_summary, only: summary_type
  use talus_system, only: process_id
  use talus_test, only: test_type
  use talus_text, only: str
  implicit none
  real(wp), parameter :: limits(2) = [0.01_wp, 0.1_wp]
  type(test_type) :: test
  type(deck_type) :: deck

  call read_limits()
  call check('green', 'energy', 0.01_wp, green)
  call check('amber', 'energy', 0.02_wp, amber)
  call check('red', 'energy', 0.2_wp, red)
  call check('red, allowed', 'strain', 0.2_wp, amber)
  call check('no number', 'energy', ieee_value(1.0_wp, ieee_quiet_nan), red)
  call check('without end', 'energy', huge(1.0_wp), red)
  call check_two()
  call test%finish()

contains

  !> A deck that allows the figure 'strain'.
  subroutine read_limits()
    type(key_table_type) :: table
    type(error_list_type) :: errors
    character(len=:), allocatable :: path
    path = '/tmp/talus_test_health_'//str(process_id())//'.nml'
    call table%init('talus-test', 1)
    call table%add_group('limits', 1, 'Limits.')
    call table%add_key('allow', 'string', '', 'Figures.')
    call table%sized(1, huge(1))
    call replace_file(path, "&limits allow = 'strain' /"//new_line('a'), errors)
    call deck%read(path, table, errors)
    call test%check('the deck is read', .not. errors%any())
    call remove_file(path)
  end subroutine read_limits

  subroutine check(name, key, value, state)
    character(len=*), intent(in) :: name, key
    real(wp), intent(in) :: value
    integer, intent(in) :: state
    type(health_type) :: health
    type(error_list_type) :: errors
    call test%check(name//': without figures', health%state() == green)
    call health%judge(deck, key, 'the '//key, value, limits, 'less')
    call test%check(name, health%state() == state)
    call health%complain('deck.nml', errors)
    call test%check(name//': a fault only if red', errors%any() .eqv. (state == red))
    if (state /= red) return
    call test%check_text(name//': code', errors%item(1)%code, 'N001')
    call test%check(name//': exit code', errors%exit_code() == 2)
    call test%check(name//': the way out', &
                    index(errors%item(1)%hint, "less; &limits allow = '"//key//"'") == 1)
  end subroutine check

  !> The worst one counts, both are noted.
  subroutine check_two()
    type(health_type) :: health
    type(summary_type) :: summary
    call health%judge(deck, 'energy', 'the energy error', 0.02_wp, limits, 'less')
    call health%judge(deck, 'strain', 'the strain', 0.2_wp, limits, 'less')
    call health%judge(deck, 'work', 'the work', 0.0_wp, limits, 'less')
    call test%check('the worst of three', health%state() == amber)
    call health%summarise(summary)
    call test%check('verdict', index(summary%text(), '"verdict": "amber"') > 0)
    call test%check('notes', index(summary%text(), &
      'health amber: the energy error 0.020000, limit 0.010000; '// &
      'health amber: the strain 0.20000, limit 0.10000 (allowed by the deck)') > 0)
  end subroutine check_two
end program test_talus_health
