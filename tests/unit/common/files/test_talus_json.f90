!> JSON text: nesting, commas, escapes, numbers.
program test_talus_json
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use talus_kinds, only: wp, i8
  use talus_text, only: string_type, append_string
  use talus_json, only: json_type, json_escape, utf8_bytes
  use talus_test, only: test_type
  implicit none
  character(len=*), parameter :: lf = achar(10)
  type(test_type) :: test
  type(json_type) :: json
  type(string_type), allocatable :: names(:)

  call append_string(names, 'x')
  call append_string(names, 'y"')
  call test%check_text('UTF-8 stays', json_escape('M'//achar(195)//achar(188)//'hle'), &
                       'M'//achar(195)//achar(188)//'hle')
  call test%check_text('other bytes', json_escape('M'//achar(252)//'hle'//achar(195)), &
                       'M\u00FChle\u00C3')
  call test%check('lengths in UTF-8', all([utf8_bytes('a'), utf8_bytes(achar(226)//achar(130)// &
    achar(172)), utf8_bytes(achar(240)//achar(159)//achar(152)//achar(128)), &
    utf8_bytes(achar(192)//achar(128)), utf8_bytes(achar(237)//achar(160)//achar(128))] &
    == [1, 3, 4, 0, 0]))
  call test%check_text('escape', json_escape('a"b\c'//achar(9)//lf//achar(1)), 'a\"b\\c\t\n\u0001')
  call json%begin()
  call json%put('name', 'it''s')
  call json%put('value', 0.1_wp)
  call json%put('nan', ieee_value(1.0_wp, ieee_quiet_nan))
  call json%put('count', 3)
  call json%put('large', 123456789012_i8)
  call json%put('ok', .true.)
  call json%put('list', [1.0_wp, 2.5e-7_wp])
  call json%put('ids', [1, 2])
  call json%put('names', names)
  call json%begin('inner')
  call json%end()
  call json%begin_array('items')
  call json%begin()
  call json%put('a', 1)
  call json%end()
  call json%put('', 'b')
  call json%end()
  call json%put_null('none')
  call json%end()
  call test%check_text('text', json%text(), &
                       '{'//lf//'  "name": "it''s",'//lf//'  "value": 0.1,'//lf//'  "nan": null,' &
                       //lf// &
                       '  "count": 3,'//lf//'  "large": 123456789012,'//lf//'  "ok": true,'//lf// &
                       '  "list": [1, 2.5e-7],'//lf//'  "ids": [1, 2],'//lf// &
                       '  "names": ["x", "y\""],'//lf//'  "inner": {},'//lf//'  "items": ['//lf// &
                       '    {'//lf//'      "a": 1'//lf//'    },'//lf//'    "b"'//lf//'  ],'//lf// &
                       '  "none": null'//lf//'}'//lf)
  call test%finish()
end program test_talus_json
