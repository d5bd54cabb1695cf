!> Field files: steps are added and removed as the run does, and their XDMF description names them.
program test_talus_xdmf
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, file_size, make_folder, read_file, truncate_file
  use talus_hdf5, only: h5_file_type
  use talus_series, only: series_type
  use talus_system, only: process_id, install_signals, environment
  use talus_test, only: test_type
  use talus_text, only: str, string_type
  use talus_xdmf, only: xdmf_type, xdmf_node, xdmf_cell
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder

  folder = '/tmp/talus_test_xdmf_'//str(process_id())
  call install_signals(.true.)
  call make_folder(folder, errors)
  call grains()
  call marks()
  call restart()
  call solid()
  call damaged()
  call full_disk()
  if (environment('TALUS_TEST_KEEP') == '') call execute_command_line('rm -rf '//folder)
  deallocate (folder)
  call test%finish()

contains

  subroutine save_grains(series, time, n)
    type(series_type), intent(inout) :: series
    real(wp), intent(in) :: time
    integer, intent(in) :: n
    type(h5_file_type) :: file
    character(len=:), allocatable :: group
    real(wp) :: x(3, n), quat(4, n)
    integer :: k
    do k = 1, n
      x(:, k) = [1.0_wp*k, 2.0_wp*k, time]
      quat(:, k) = [1.0_wp, 0.1_wp*k, 0.0_wp, 0.5_wp]
    end do
    call series%begin_step(time, file, group, errors)
    call file%put(group//'/grains/x', x, errors)
    call file%put(group//'/grains/v', -x, errors)
    call file%put(group//'/grains/quat', quat, errors)
    call file%put(group//'/grains/id', [(int(k, i8), k=1, n)], errors)
    call series%end_step(int(n, i8), file, errors)
  end subroutine save_grains

  !> A name with marks of XML and a byte that is no UTF-8.
  subroutine marks()
    type(series_type) :: series
    type(xdmf_type) :: xdmf
    type(h5_file_type) :: file
    character(len=:), allocatable :: text
    call series%start(folder//'/a&b<'//achar(252)//'.h5', 'talus-grains', file, errors)
    call file%commit(errors)
    call describe(xdmf)
    call save_grains(series, 0.0_wp, 2)
    call xdmf%write(series, errors)
    call read_file(folder//'/grains.xdmf', text, errors)
    call test%check('no faults with marks', .not. errors%any())
    call test%check('marks escaped', index(text, '>a&amp;b&lt;?.h5:/steps/000000/grains/x<') > 0)
  end subroutine marks

  subroutine grains()
    type(series_type) :: series
    type(xdmf_type) :: xdmf
    type(h5_file_type) :: file
    character(len=:), allocatable :: text

    call series%start(folder//'/grains.h5', 'talus-grains', file, errors)
    call file%commit(errors)
    call describe(xdmf)
    call save_grains(series, 0.0_wp, 5)
    call xdmf%write(series, errors)
    call save_grains(series, 0.25_wp, 4)
    call save_grains(series, 0.5_wp, 4)
    call xdmf%write(series, errors)
    call test%check('no faults', .not. errors%any())
    call read_file(folder//'/grains.xdmf', text, errors)
    call test%check('three steps', series%count == 3 .and. occurrences(text, '<Time ') == 3)
    call test%check('time', index(text, '<Time Value="0.25"/>') > 0)
    call test%check('points of step 1', index(text, &
      'Dimensions="4 3">grains.h5:/steps/000001/grains/x<') > 0)
    call test%check('vector', occurrences(text, 'Name="velocity" AttributeType="Vector"') == 3)
    call test%check('components', occurrences(text, 'Name="quat_w" AttributeType="Scalar"') == 3)
    call test%check('integers', index(text, &
      'NumberType="Int" Precision="8" Dimensions="5">grains.h5:/steps/000000/grains/id<') > 0)
  end subroutine grains

  subroutine describe(xdmf)
    type(xdmf_type), intent(inout) :: xdmf
    call xdmf%describe_points(folder//'/grains.xdmf', 'grains/x')
    call xdmf%attribute('velocity', 'grains/v', xdmf_node, 3)
    call xdmf%attribute('id', 'grains/id', xdmf_node, 1, kind='int8')
    call xdmf%attribute('quat', 'grains/quat', xdmf_node, 4)
  end subroutine describe

  !> Back to t = 0.25: the step at 0.5 is removed, and the next replaces it.
  subroutine restart()
    type(series_type) :: series
    type(h5_file_type) :: file
    type(string_type), allocatable :: names(:)
    logical :: found
    real(wp) :: time
    type(xdmf_type) :: xdmf
    character(len=:), allocatable :: text
    call file%open(folder//'/grains.h5', errors, write=.true.)
    call file%group('/steps/000003', errors)
    call file%attr_put('/steps/000003', 'time', 0.1_wp, errors)
    call file%close(errors)
    call series%resume(folder//'/grains.h5', 'talus-grains', 0.25_wp, found, errors)
    call test%check('found', found .and. series%note == '')
    call test%check('later and unfinished steps are gone', series%count == 2)
    call test%check('counts are known', series%step(1)%count == 5 .and. series%step(2)%count == 4)
    call save_grains(series, 0.75_wp, 6)
    call describe(xdmf)
    call xdmf%write(series, errors)
    call read_file(folder//'/grains.xdmf', text, errors)
    call test%check('described again', occurrences(text, '<Time ') == 3 .and. &
                    index(text, 'Dimensions="6 3">grains.h5:/steps/000002/grains/x<') > 0)
    call file%open(folder//'/grains.h5', errors, format='talus-grains')
    call file%names('/steps', names)
    call test%check('three steps again', size(names) == 3)
    call file%attr_get('/steps/000002', 'time', time, errors)
    call test%check_close('time of the new step', time, 0.75_wp, 0.0_wp)
    call file%close(errors)
    call test%check('no faults at restart', .not. errors%any())
    call series%resume(folder//'/none.h5', 'talus-grains', 0.25_wp, found, errors)
    call test%check('nothing to go on with', .not. found)
  end subroutine restart

  subroutine solid()
    type(series_type) :: series
    type(xdmf_type) :: xdmf
    type(h5_file_type) :: file
    character(len=:), allocatable :: text, group
    real(wp) :: x(3, 8), stress(6, 1)
    integer :: k
    x = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
    stress(:, 1) = [(real(k, wp), k=1, 6)]
    call series%start(folder//'/solid.h5', 'talus-solid', file, errors)
    call file%put('/mesh/x', x, errors)
    call file%put('/mesh/hex8', reshape([(int(k, i4), k=0, 7)], [8, 1]), errors)
    call file%commit(errors)
    call xdmf%describe_hex8(folder//'/solid.xdmf', '/mesh/x', '/mesh/hex8', 8_i8, 1_i8)
    call xdmf%attribute('displacement', 'u', xdmf_node, 3)
    call xdmf%attribute('stress', 'stress', xdmf_cell, 6)
    call series%begin_step(1.0_wp, file, group, errors)
    call file%put(group//'/u', 0.1_wp*x, errors)
    call file%put(group//'/stress', stress, errors)
    call series%end_step(8_i8, file, errors)
    call xdmf%write(series, errors)
    call test%check('no faults of the solid', .not. errors%any())
    call read_file(folder//'/solid.xdmf', text, errors)
    call test%check('cells', index(text, 'Precision="4" Dimensions="1 8">solid.h5:/mesh/hex8<') > 0)
    call test%check('mesh nodes', index(text, 'Dimensions="8 3">solid.h5:/mesh/x<') > 0)
    call test%check('displacement', index(text, '>solid.h5:/steps/000000/u<') > 0)
    call test%check('stress by components', index(text, &
      'Name="stress_zx" AttributeType="Scalar" Center="Cell"') > 0)
  end subroutine solid

  subroutine damaged()
    type(series_type) :: series
    logical :: found
    call execute_command_line('cp '//folder//'/solid.h5 '//folder//'/torn.h5')
    call truncate_file(folder//'/torn.h5', file_size(folder//'/torn.h5')/2, errors)
    call series%resume(folder//'/torn.h5', 'talus-solid', 1.0_wp, found, errors)
    call test%check('a damaged file is moved aside', .not. found .and. .not. errors%any())
    call test%check('and is still there', file_exists(folder//'/torn.h5.damaged'))
    call test%check('and reported: '//series%note, index(series%note, 'truncated') > 0)
  end subroutine damaged

  subroutine full_disk()
    type(series_type) :: series
    type(h5_file_type) :: file
    call execute_command_line('ln -s /dev/full '//folder//'/full.h5.tmp')
    call series%start(folder//'/full.h5', 'talus-grains', file, errors)
    call file%commit(errors)
    call test%check('full disk: one fault', errors%count == 1)
    if (errors%any()) call test%check_text('full disk', errors%item(1)%code, 'S002')
    call errors%clear()
  end subroutine full_disk

  pure integer function occurrences(text, part)
    character(len=*), intent(in) :: text, part
    integer :: k
    occurrences = 0
    do k = 1, len(text) - len(part) + 1
      if (text(k:k + len(part) - 1) == part) occurrences = occurrences + 1
    end do
  end function occurrences
end program test_talus_xdmf
