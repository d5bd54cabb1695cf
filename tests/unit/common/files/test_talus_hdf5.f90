!> HDF5 files: what is put is read back; wrong, foreign, truncated and full are distinguished.
program test_talus_hdf5
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, file_size, remove_file, replace_file, make_folder, &
    truncate_file
  use talus_hdf5, only: h5_file_type
  use talus_system, only: process_id, install_signals
  use talus_test, only: test_type
  use talus_text, only: str, string_type
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder

  folder = '/tmp/talus_test_hdf5_'//str(process_id())
  call install_signals(.true.)
  call make_folder(folder, errors)
  call test%check('folder made', .not. errors%any())
  call round_trip()
  call slabs()
  call attributes()
  call wrong_contents()
  call wrong_files()
  call failing_writes()
  call appending()
  call no_numbers()
  call execute_command_line('rm -rf '//folder)
  deallocate (folder)
  call test%finish()

contains

  !> Arrays put in parts, some of them empty, are those put whole; a part beyond the end is a fault.
  subroutine slabs()
    type(h5_file_type) :: file
    real(wp), allocatable :: x(:, :), back(:, :)
    integer(i8), allocatable :: ids(:)
    integer(i4) :: k, low
    x = reshape([(real(k, wp)/3.0_wp, k=1, 15)], [3, 5])
    call file%create(folder//'/s.h5', errors)
    do low = 1, 5, 2
      file%slab = [low - 1, 5]
      call file%put('/some/x', x(:, low:min(low + 1, 5)), errors)
      call file%put('/some/id', [(int(k, i8), k=low, min(low + 1, 5))], errors)
      call file%put('/some/x', x(:, 1:0), errors)
    end do
    file%slab = [0, 0]
    call file%put('/none', x(:, 1:0), errors)
    file%slab = [0, -1]
    call file%put('/whole', x, errors)
    call file%commit(errors)
    call file%open(folder//'/s.h5', errors)
    call file%get('/some/x', back, errors)
    call file%get('/some/id', ids, errors)
    call test%check('slabs: no faults', .not. errors%any())
    call test%check('slabs: columns', size(back, 2) == 5)
    call test%check('slabs: values', all(abs(back - x) <= 0.0_wp) .and. all(ids == [1, 2, 3, 4, 5]))
    call file%get('/none', back, errors)
    call test%check('slabs: nothing in all', size(back) == 0)
    call file%close(errors)
    call errors%clear()
    call file%create(folder//'/s.h5', errors)
    file%slab = [4, 5]
    call file%put('/some/x', x(:, 1:2), errors)
    call test%check('slabs: beyond the end', errors%any())
    call file%discard()
    call errors%clear()
  end subroutine slabs

  subroutine round_trip()
    type(h5_file_type) :: file
    real(wp), allocatable :: x(:, :), back(:, :), line(:)
    integer(i4), allocatable :: kinds(:), table(:, :)
    integer(i8), allocatable :: ids(:)
    integer(i8) :: shape_seen(2)
    type(string_type), allocatable :: read_words(:)
    character(len=:), allocatable :: text
    real(wp) :: into(3, 2), scalar
    integer(i4) :: k, count

    x = reshape([(real(k, wp)/3.0_wp, k=1, 12)], [3, 4])
    call write_all(x)
    call file%open(folder//'/a.h5', errors, format='talus-packing')
    call file%get('/grains/x', back, errors)
    call test%check('reals of rank 2, bit for bit', all(abs(back - x) <= 0.0_wp))
    call file%get_into('/grains/part', into, errors)
    call test%check('a strided slice', all(abs(into - x(:, 1:4:3)) <= 0.0_wp))
    call file%get('/grains/id', ids, errors)
    call test%check('long integers', all(ids == [10_i8, 20_i8, 3000000000_i8]))
    call file%get('/grains/kind', kinds, errors)
    call test%check('integers', all(kinds == [0, 1, -2]))
    call file%get('/grains/table', table, errors)
    call test%check('integers of rank 2', all(table == reshape([1, 2, 3, 4], [2, 2])))
    call file%get('/grains/kind', line, errors)
    call test%check('integers read as reals', abs(line(3) + 2.0_wp) <= 0.0_wp)
    call file%get('/scalars/time', scalar, errors)
    call test%check_close('scalar', scalar, 0.1_wp, 0.0_wp)
    call file%get('/scalars/count', count, errors)
    call test%check('integer scalar', count == 7)
    call file%get('/text/deck', text, errors)
    call test%check_text('text', text, 'one line')
    call file%get('/text/words', read_words, errors)
    call test%check('list of text', size(read_words) == 3)
    call test%check_text('empty word', read_words(2)%s, '')
    call test%check_text('third word', read_words(3)%s, 'three words long')
    call file%get('/empty', back, errors)
    call test%check('empty array', all(shape(back) == [3, 0]))
    shape_seen = file%shape('/grains/x')
    call test%check('shape', all(shape_seen == [3, 4]))
    call test%check('exists', file%exists('/grains') .and. file%exists('/grains/x'))
    call test%check('does not exist', .not. file%exists('/no/such/thing'))
    call file%names('/grains', read_words)
    call test%check('names', size(read_words) == 5)
    call test%check_text('first name', read_words(1)%s, 'id')
    call file%close(errors)
    call test%check('read without faults', .not. errors%any())
  end subroutine round_trip

  subroutine write_all(x)
    real(wp), intent(in) :: x(:, :)
    type(h5_file_type) :: file
    type(string_type) :: words(3)

    words(1)%s = 'one'
    words(2)%s = ''
    words(3)%s = 'three words long'
    call file%create(folder//'/a.h5', errors, format='talus-packing')
    call file%put('/grains/x', x, errors)
    call file%put('/grains/part', x(:, 1:4:3), errors)
    call file%put('/grains/id', [10_i8, 20_i8, 3000000000_i8], errors)
    call file%put('/grains/kind', [0_i4, 1_i4, -2_i4], errors)
    call file%put('/grains/table', reshape([1_i4, 2_i4, 3_i4, 4_i4], [2, 2]), errors)
    call file%put('/scalars/time', 0.1_wp, errors)
    call file%put('/scalars/count', 7_i4, errors)
    call file%put('/text/deck', 'one line', errors)
    call file%put('/text/words', words, errors)
    call file%put('/empty', x(:, 1:0), errors)
    call test%check('not there before commit', .not. file_exists(folder//'/a.h5'))
    call file%commit(errors)
    call test%check('written without faults', .not. errors%any())
    call test%check('renamed', file_exists(folder//'/a.h5') .and. &
                    .not. file_exists(folder//'/a.h5.tmp'))
  end subroutine write_all

  subroutine attributes()
    type(h5_file_type) :: file
    real(wp) :: time
    integer(i4) :: version
    integer(i8) :: step
    character(len=:), allocatable :: text

    call file%create(folder//'/b.h5', errors)
    call file%group('/steps/000001', errors)
    call file%group('/steps/000001', errors)
    call file%attr_put('/steps/000001', 'time', 0.3_wp, errors)
    call file%attr_put('/', 'version', 1_i4, errors)
    call file%attr_put('/', 'version', 2_i4, errors)
    call file%attr_put('/', 'step', 5000000000_i8, errors)
    call file%attr_put('/', 'gravity', [0.0_wp, 0.0_wp, -9.81_wp], errors)
    call file%attr_put('/', 'program', 'talus-dem', errors)
    call file%commit(errors)
    call file%open(folder//'/b.h5', errors)
    call file%attr_get('/steps/000001', 'time', time, errors)
    call file%attr_get('/', 'version', version, errors)
    call file%attr_get('/', 'step', step, errors)
    call file%attr_get('/', 'program', text, errors)
    call test%check('attributes without faults', .not. errors%any())
    call test%check_close('time', time, 0.3_wp, 0.0_wp)
    call test%check('version replaced', version == 2)
    call test%check('step', step == 5000000000_i8)
    call test%check_text('program', text, 'talus-dem')
    call file%attr_get('/', 'missing', version, errors)
    call expect('missing attribute', 'I004', "no attribute 'missing'")
    call file%attr_get('/', 'gravity', time, errors)
    call expect('an attribute of three values', 'I004', 'gravity')
    call file%attr_get('/', 'program', version, errors)
    call expect('text for a number', 'I004', 'program')
    call file%close(errors)
  end subroutine attributes

  subroutine wrong_contents()
    type(h5_file_type) :: file
    real(wp), allocatable :: line(:)
    integer(i4), allocatable :: kinds(:)
    real(wp) :: into(3, 5)

    call file%open(folder//'/a.h5', errors)
    call file%get('/grains/quat', line, errors)
    call expect('missing dataset', 'I001', 'no dataset /grains/quat')
    call file%get('/grains', line, errors)
    call expect('a group for a dataset', 'I001', '/grains')
    call file%get('/grains/x', line, errors)
    call expect('wrong rank', 'I002', '(4, 3)')
    call file%get_into('/grains/x', into, errors)
    call expect('wrong shape', 'I002', 'not (5, 3)')
    call file%get('/text/words', line, errors)
    call expect('text for reals', 'I003', 'kind text')
    call file%get('/scalars/time', kinds, errors)
    call expect('reals for integers', 'I003', 'kind real')
    call file%get('/grains/id', kinds, errors)
    call expect('too large', 'I005', '3000000000')
    call file%close(errors)
  end subroutine wrong_contents

  subroutine wrong_files()
    type(h5_file_type) :: file
    call file%open(folder//'/none.h5', errors)
    call expect('not there', 'S003', 'there is no such file')
    call file%open(folder, errors)
    call expect('a folder', 'S003', 'it is a folder')
    call replace_file(folder//'/text.h5', 'id,x,y,z and other words', errors)
    call file%open(folder//'/text.h5', errors)
    call expect('foreign', 'S004', 'not an HDF5 file')
    call replace_file(folder//'/empty.h5', '', errors)
    call file%open(folder//'/empty.h5', errors)
    call expect('empty', 'S005', 'is empty')
    call file%open(folder//'/a.h5', errors, format='talus-mesh')
    call expect('other format', 'S006', "'talus-packing'")
    call test%check('closed after a wrong format', .not. file%is_open())
    call file%open(folder//'/b.h5', errors, format='talus-mesh')
    call expect('no format', 'S006', "no attribute 'format'")
    call truncate_file(folder//'/b.h5', file_size(folder//'/b.h5')/2, errors)
    call file%open(folder//'/b.h5', errors)
    call expect('truncated', 'S005', 'truncated')
  end subroutine wrong_files

  subroutine failing_writes()
    type(h5_file_type) :: file
    real(wp) :: x(3, 1000)
    x = 1.0_wp
    call file%create(folder//'/text.h5/under/a/file.h5', errors)
    call expect('unwritable', 'S001', 'Not a directory')
    call file%put('/x', x, errors)
    call file%commit(errors)
    call test%check('silent after a fault', .not. errors%any())

    call execute_command_line('ln -s /dev/full '//folder//'/a.h5.tmp')
    call file%create(folder//'/a.h5', errors)
    call file%put('/x', x, errors)
    call file%commit(errors)
    call expect('full disk', 'S002', 'No space left')
    call file%open(folder//'/a.h5', errors)
    call test%check('the older file is intact', file%exists('/grains/x') .and. .not. errors%any())
    call file%close(errors)
  end subroutine failing_writes

  subroutine appending()
    type(h5_file_type) :: file
    integer(i4) :: k
    type(string_type), allocatable :: steps(:)
    call file%create(folder//'/run.h5', errors, grows=.true.)
    call file%commit(errors)
    do k = 1, 3
      call file%open(folder//'/run.h5', errors, write=.true.)
      call file%put('/steps/'//str(k)//'/x', [real(k, wp)], errors)
      call file%close(errors)
    end do
    call file%open(folder//'/run.h5', errors, write=.true.)
    call file%delete('/steps/2', errors)
    call file%put('/steps/1/x', [1.0_wp], errors)
    call expect('twice the same name', 'S009', '/steps/1/x')
    call file%close(errors)
    call file%open(folder//'/run.h5', errors)
    call file%names('/steps', steps)
    call test%check('two steps left', size(steps) == 2)
    call file%close(errors)
    call remove_file(folder//'/run.h5', errors)
    call test%check('no faults at the end', .not. errors%any())
  end subroutine appending

  !> NaN fails a file that has a checksum, the older one stays; a growing file takes it, reported.
  subroutine no_numbers()
    type(h5_file_type) :: file
    real(wp) :: x(2, 3), back
    x = 1.0_wp
    call file%create(folder//'/n.h5', errors)
    call file%put('/x', 1.0_wp, errors)
    call file%commit(errors)
    x(2, 2) = ieee_value(back, ieee_quiet_nan)
    call file%create(folder//'/n.h5', errors)
    call file%put('/x', x, errors)
    call file%put('/y', x, errors)
    call file%commit(errors)
    call expect('NaN in a checkpoint', 'N002', 'value 4 of 6 of /x is NaN')
    call file%open(folder//'/n.h5', errors)
    call file%get('/x', back, errors)
    call file%close(errors)
    call test%check('the older file stays', abs(back - 1.0_wp) <= 0.0_wp .and. .not. errors%any())

    call file%create(folder//'/g.h5', errors, grows=.true.)
    call file%commit(errors)
    call file%open(folder//'/g.h5', errors, write=.true.)
    call file%put('/steps/1/x', x, errors)
    call file%put('/steps/1/y', 2.0_wp, errors)
    call file%close(errors)
    call expect('NaN in a field', 'N002', '/steps/1/x')
    call file%open(folder//'/g.h5', errors)
    call file%get('/steps/1/y', back, errors)
    call test%check('what follows is written', abs(back - 2.0_wp) <= 0.0_wp)
    call file%close(errors)
    call test%check('no more faults', .not. errors%any())
  end subroutine no_numbers

  !> One fault with this code whose text has this part; the list is cleared.
  subroutine expect(name, code, part)
    character(len=*), intent(in) :: name, code, part
    call test%check(name//': one fault', errors%count == 1)
    if (errors%count > 0) then
      call test%check_text(name//': code', errors%item(1)%code, code)
      call test%check(name//': text has "'//part//'": '//errors%text(1), &
                      index(errors%text(1), part) > 0)
    end if
    call errors%clear()
  end subroutine expect
end program test_talus_hdf5
