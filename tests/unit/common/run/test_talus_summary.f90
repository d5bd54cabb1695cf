!> summary.json: nesting, numbers, escapes, faults.
program test_talus_summary
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, read_file, remove_file
  use talus_summary, only: summary_type
  use talus_system, only: process_id
  use talus_test, only: test_type
  use talus_text, only: str
  implicit none
  character(len=*), parameter :: nl = new_line('a')
  type(test_type) :: test
  type(error_list_type) :: errors, faults
  type(summary_type) :: summary
  character(len=:), allocatable :: path, text

  call test%check_text('empty', summary%text(), '{}'//nl)
  call summary%set('steps', 5000000000_i8)
  call summary%set('health.energy_error', 1.25e-5_wp)
  call summary%set('title', 'a "quoted" \ path'//nl//achar(9))
  call summary%set('health.late_rebuilds', 0_i4)
  call summary%set('health.deep.flag', .true.)
  call summary%set('nan', ieee_value(1.0_wp, ieee_quiet_nan))
  call summary%set('gravity', [0.0_wp, 0.0_wp, -9.81_wp])
  call summary%set('steps', 7_i4)
  call test%check_text('whole object', summary%text(), '{'//nl// &
    '  "steps": 7,'//nl// &
    '  "health": {'//nl// &
    '    "energy_error": 1.25e-5,'//nl// &
    '    "late_rebuilds": 0,'//nl// &
    '    "deep": {'//nl// &
    '      "flag": true'//nl// &
    '    }'//nl// &
    '  },'//nl// &
    '  "title": "a \"quoted\" \\ path\n\u0009",'//nl// &
    '  "nan": null,'//nl// &
    '  "gravity": [0, 0, -9.81]'//nl//'}'//nl)

  call faults%add('S002', 'no room', 'a.h5', 'make room')
  call summary%set_errors(faults)
  call summary%set_program('talus-dem', 'grains.nml', 'abc')
  text = summary%text()
  call test%check('faults', index(text, '{"code": "S002", "message": "no room",') > 0)
  call test%check('program', index(text, '"program": "talus-dem"') > 0)
  call test%check('version', index(text, '"version": "') > 0 .and. index(text, '"git": "') > 0)

  path = '/tmp/talus_test_summary_'//str(process_id())//'.json'
  call summary%write(path, errors)
  call read_file(path, text, errors)
  call test%check('written', text == summary%text() .and. .not. errors%any())
  call test%check('nothing left over', .not. file_exists(path//'.tmp'))
  call summary%write(path//'/under.json', errors)
  call test%check('unwritable', errors%count == 1)
  if (errors%any()) call test%check_text('unwritable: code', errors%item(1)%code, 'S001')
  call remove_file(path)
  deallocate (path, text)
  call test%finish()
end program test_talus_summary
