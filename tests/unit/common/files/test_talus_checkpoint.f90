!> Checkpoints: rotation, tags, fall-back to an older one, faults that leave the older ones whole.
program test_talus_checkpoint
  use talus_kinds, only: wp, i4, i8
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, file_size, make_folder, truncate_file, remove_file, &
    replace_file, rename_file
  use talus_hdf5, only: h5_file_type
  use talus_system, only: process_id, install_signals
  use talus_test, only: test_type
  use talus_text, only: str, string_type
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  type(checkpoint_type) :: checkpoint
  character(len=:), allocatable :: folder, stem

  folder = '/tmp/talus_test_checkpoint_'//str(process_id())
  stem = folder//'/grains'
  call install_signals(.true.)
  call make_folder(folder, errors)
  call checkpoint%init(stem, 'talus-dem', 'abc123', 3)
  call nothing_yet()
  call rotation()
  call tags()
  call fall_back()
  call full_disk()
  call wrong_ones()
  call schedule()
  call execute_command_line('rm -rf '//folder)
  deallocate (folder, stem)
  call test%finish()

contains

  subroutine save_one(step, tag)
    integer(i8), intent(in) :: step
    character(len=*), intent(in), optional :: tag
    type(h5_file_type) :: file
    call checkpoint%begin(file, 0.1_wp*real(step, wp), step, errors, tag)
    call file%put('/state/x', [real(step, wp), 2.0_wp, 3.0_wp], errors)
    call checkpoint%finish(file, errors)
  end subroutine save_one

  integer(i8) function step_of(path)
    character(len=*), intent(in) :: path
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    real(wp), allocatable :: x(:)
    step_of = -1
    call checkpoint%open(path, file, info, errors)
    if (.not. file%is_open()) return
    call file%get('/state/x', x, errors)
    call file%close(errors)
    if (abs(x(1) - real(info%step, wp)) <= 0.0_wp) step_of = info%step
  end function step_of

  subroutine expect_found(name, path, warning_count)
    character(len=*), intent(in) :: name, path
    integer, intent(in) :: warning_count
    character(len=:), allocatable :: found
    type(string_type), allocatable :: warnings(:)
    call checkpoint%find('auto', found, warnings, errors)
    call test%check_text(name, found, path)
    call test%check(name//': warnings', size(warnings) == warning_count)
  end subroutine expect_found

  subroutine nothing_yet()
    call expect_found('none at all', '', 0)
    call test%check('that is no fault', .not. errors%any())
  end subroutine nothing_yet

  subroutine rotation()
    integer(i8) :: step
    do step = 1, 5
      call save_one(step)
    end do
    call test%check('no faults', .not. errors%any())
    call test%check('newest', step_of(stem//'.chk.h5') == 5)
    call test%check('number 1', step_of(stem//'.chk.1.h5') == 4)
    call test%check('number 2', step_of(stem//'.chk.2.h5') == 3)
    call test%check('three are kept', .not. file_exists(stem//'.chk.3.h5'))
    call test%check('nothing left over', .not. file_exists(stem//'.chk.h5.tmp') .and. &
                    .not. file_exists(stem//'.chk.h5.kept'))
    checkpoint%keep = 2
    call save_one(6_i8)
    call test%check('fewer are kept', .not. file_exists(stem//'.chk.2.h5'))
    call test%check('of them the newest', step_of(stem//'.chk.1.h5') == 5)
    checkpoint%keep = 3
    call expect_found('the newest', stem//'.chk.h5', 0)
  end subroutine rotation

  subroutine tags()
    call save_one(40_i8, 'end_of_settling')
    call test%check('tagged', step_of(stem//'.end_of_settling.chk.h5') == 40)
    call test%check_text('path of a tag', checkpoint%tag_path('end_of_settling'), &
                         stem//'.end_of_settling.chk.h5')
    call test%check('not rotated', step_of(stem//'.chk.h5') == 6)
  end subroutine tags

  subroutine fall_back()
    call truncate_file(stem//'.chk.h5', file_size(stem//'.chk.h5')/2, errors)
    call expect_found('truncated newest', stem//'.chk.1.h5', 1)
    call remove_file(stem//'.chk.h5', errors)
    call expect_found('newest missing', stem//'.chk.1.h5', 0)
    call truncate_file(stem//'.chk.1.h5', 100_i8, errors)
    call test%check('no faults so far', .not. errors%any())
    call expect_found('none usable', '', 1)
    call expect('none usable', 'S013')
    call save_one(7_i8)
    call save_one(8_i8)
    call rename_file(stem//'.chk.h5', stem//'.chk.h5.kept', errors)
    call expect_found('killed while renaming', stem//'.chk.h5.kept', 0)
    call rename_file(stem//'.chk.h5.kept', stem//'.chk.h5', errors)
    call test%check('no faults after it', .not. errors%any())
  end subroutine fall_back

  subroutine full_disk()
    call execute_command_line('ln -s /dev/full '//stem//'.chk.h5.tmp')
    call save_one(9_i8)
    call expect('full disk', 'S002')
    call test%check('newest still whole', step_of(stem//'.chk.h5') == 8)
    call test%check('older one too', step_of(stem//'.chk.1.h5') == 7)
    call save_one(10_i8)
    call test%check('goes on when there is room', step_of(stem//'.chk.h5') == 10)
    call test%check('and rotates', step_of(stem//'.chk.1.h5') == 8)
  end subroutine full_disk

  subroutine wrong_ones()
    type(checkpoint_type) :: other
    type(checkpoint_info_type) :: info
    type(h5_file_type) :: file
    call other%init(folder//'/solid', 'talus-fem', 'abc123', 2)
    call other%open(stem//'.chk.h5', file, info, errors)
    call expect('of another program', 'S012')
    call file%create(folder//'/half.chk.h5', errors, format='talus-checkpoint')
    call file%attr_put('/', 'program', 'talus-dem', errors)
    call file%commit(errors)
    call checkpoint%open(folder//'/half.chk.h5', file, info, errors)
    call expect('incomplete', 'S011')
    call checkpoint%open(folder//'/none.chk.h5', file, info, errors)
    call expect('not there', 'S003')
    call replace_file(folder//'/text', 'words', errors)
    call checkpoint%open(folder//'/text', file, info, errors)
    call expect('foreign', 'S004')
    call checkpoint%init(folder//'/text/grains', 'talus-dem', 'abc123', 2)
    call save_one(1_i8)
    call expect('unwritable', 'S001')
  end subroutine wrong_ones

  subroutine schedule()
    call checkpoint%schedule(0.0_wp, 0.1_wp, 0.2_wp)
    call test%check('not yet', .not. checkpoint%due(0.25_wp))
    call test%check('due', checkpoint%due(0.3_wp))
    call test%check('once', .not. checkpoint%due(0.31_wp))
    call test%check('due after a gap', checkpoint%due(0.77_wp))
    call test%check('next multiple', .not. checkpoint%due(0.79_wp) .and. checkpoint%due(0.8_wp))
    call checkpoint%schedule(1.0e-9_wp, 0.0_wp, 0.0_wp)
    call test%check('due by wall time', checkpoint%due(0.0_wp))
  end subroutine schedule

  subroutine expect(name, code)
    character(len=*), intent(in) :: name, code
    call test%check(name//': one fault', errors%count == 1)
    if (errors%any()) call test%check_text(name//': '//errors%text(1), errors%item(1)%code, code)
    call errors%clear()
  end subroutine expect
end program test_talus_checkpoint
