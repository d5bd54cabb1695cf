!> Faults and memory in a solver's --check --json, as talus_report writes them, are read unchanged.
program test_cpl_check
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_memory_text, only: foretold_type
  use talus_report, only: faults_json
  use talus_test, only: test_type
  use cpl_check, only: take_analysis, take_faults, take_memory
  use cpl_memory, only: coupling_memory
  implicit none

  type(test_type) :: test
  type(error_list_type) :: told, heard
  type(foretold_type) :: foretold
  real(wp), allocatable :: memory(:)
  integer(i4) :: entities
  character(len=:), allocatable :: analysis
  character(len=1), parameter :: nl = new_line('a')

  call told%add('D017', 'kind = ''a "b" \ c'' is wrong', 'solid.nml:6:16'//nl//'  6 | &x'//nl// &
                '    | ^', 'it takes: static, newmark')
  call told%add('I210', 'grain 5 is no number, "code": none', 'pack.h5', '')
  call take_faults('talus-fem', faults_json('talus-fem', 'solid.nml', told), heard)
  call test%check('both', heard%count == 2)
  call test%check_text('code', heard%item(1)%code, 'D017')
  call test%check_text('message', heard%item(1)%message, 'talus-fem: '//told%item(1)%message)
  call test%check_text('place', heard%item(1)%place, told%item(1)%place)
  call test%check_text('hint', heard%item(1)%hint, told%item(1)%hint)
  call test%check_text('second', heard%item(2)%message, 'talus-fem: '//told%item(2)%message)
  call test%check_text('second place', heard%item(2)%place, 'pack.h5')
  call heard%clear()
  call told%clear()
  call take_faults('talus-fem', faults_json('talus-fem', 'solid.nml', told), heard)
  call test%check('none', heard%count == 0)
  call take_faults('talus-fem', 'Segmentation fault', heard)
  call test%check('no JSON', heard%count == 0)
  call take_analysis(faults_json('talus-fem', 'solid.nml', told, 'explicit'), analysis)
  call test%check_text('analysis of a solid', analysis, 'explicit')
  call take_analysis(faults_json('talus-dem', 'grains.nml', told), analysis)
  call test%check('grains have none', .not. allocated(analysis))
  call take_memory(faults_json('talus-dem', 'grains.nml', told), memory, entities)
  call test%check('no memory', .not. allocated(memory) .and. entities == 0)
  call take_memory('{"memory": [1.0, x], "entities": 3}', memory, entities)
  call test%check('no numbers', .not. allocated(memory))
  foretold%most = [12.5_wp, 7.25_wp, 1.0e3_wp]
  foretold%entities = 4711
  call take_memory(faults_json('talus-dem', 'grains.nml', told, foretold=foretold), memory, &
                   entities)
  call test%check('memory of three ranks', all(abs(memory - foretold%most) <= 0.0_wp))
  call test%check('grains', entities == 4711)
  call test%check('more in an overlap', coupling_memory(.true., .false., 1000, 1000) > &
                  coupling_memory(.false., .false., 1000, 1000))
  call test%check('more of more grains', coupling_memory(.false., .false., 2000, 1000) > &
                  coupling_memory(.false., .false., 1000, 1000))
  call test%check('more where intervals are repeated', coupling_memory(.false., .true., 1000, &
                  1000) > coupling_memory(.false., .false., 1000, 1000))
  call test%finish()
end program test_cpl_check
