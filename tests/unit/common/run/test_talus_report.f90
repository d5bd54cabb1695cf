!> Faults and key tables as JSON.
program test_talus_report
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck_table, only: key_table_type
  use talus_report, only: faults_json, keys_json, split_place
  use talus_test, only: test_type
  implicit none
  character(len=*), parameter :: lf = achar(10)
  type(test_type) :: test
  type(error_list_type) :: errors
  type(key_table_type) :: table
  character(len=:), allocatable :: place, source, text
  integer(i4) :: line, column

  call split_place('a:b/deck.nml:12:8'//lf//'   12 | x'//lf//'      | ^', place, line, column, &
                   source)
  call test%check_text('place', place, 'a:b/deck.nml:12:8')
  call test%check('line and column', line == 12 .and. column == 8)
  call test%check_text('source', source, '   12 | x'//lf//'      | ^')
  call split_place('grain 7', place, line, column, source)
  call test%check('no deck place', place == 'grain 7' .and. line == 0 .and. column == 0)
  call split_place('a:b:c', place, line, column, source)
  call test%check('colons', line == 0 .and. column == 0)
  call test%check('good deck', index(faults_json('talus-dem', 'd.nml', errors), '"ok": true') > 0)
  call errors%add('D011', 'unknown "key"', 'd.nml:3:4'//lf//'x', 'hint')
  text = faults_json('talus-dem', 'd.nml', errors)
  call test%check('faults', index(text, '"code": "D011"') > 0 .and. index(text, '"line": 3') > 0 &
                  .and. index(text, '"column": 4') > 0 .and. index(text, 'unknown \"key\"') > 0 &
                  .and. index(text, '"ok": false') > 0 .and. index(text, '"exit_code": 1') > 0)
  call table%init('talus-test', 1)
  call table%add_group('run', 3, 'Doc.', required=.true.)
  call table%add_key('t_end', 'real', 's', 'End.')
  call table%bounds(above=0.0_wp)
  text = keys_json(table)
  call test%check('keys', index(text, '"name": "t_end"') > 0 .and. index(text, '"above": 0') > 0 &
                  .and. index(text, '"unit": "s"') > 0)
  call table%add_key('law', 'string', '', 'Law.')
  call table%allow('linear|hertz')
  call table%add_key('stiffness', 'real', 'N/m', 'Stiffness.')
  call table%only_with('law', 'linear')
  call table%need_with('run.law', 'linear')
  call table%needs('t_end')
  call table%one_of('t_end|stiffness')
  text = keys_json(table)
  text = tight(text)
  call test%check('rules: '//text, index(text, '"of":{"law":["linear"]}') > 0 &
                  .and. index(text, '"required_with":{"run.law":["linear"]}') > 0 &
                  .and. index(text, '"needs":["t_end"]') > 0 .and. &
                  index(text, '"sets":[{"keys":["t_end","stiffness"],"exactly_one":true}]') > 0)
  call test%finish()

contains

  !> A text without blanks and line feeds.
  pure function tight(text) result(short)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: short
    integer(i4) :: k
    short = ''
    do k = 1, len(text)
      if (text(k:k) /= ' ' .and. text(k:k) /= lf) short = short//text(k:k)
    end do
  end function tight
end program test_talus_report
