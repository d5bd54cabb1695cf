!> Checksums of HDF5 files: each damaged byte and shortened file is found, foreign files are read.
program test_talus_file_checksum
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: file_size, make_folder, truncate_file
  use talus_hdf5, only: h5_file_type
  use talus_system, only: process_id
  use talus_test, only: test_type
  use talus_text, only: str
  implicit none
  type(test_type) :: test
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder, path
  integer, parameter :: room = 512  !! bytes before the HDF5 file

  folder = '/tmp/talus_test_checksum_'//str(process_id())
  path = folder//'/x.h5'
  call make_folder(folder, errors)
  call write_file(grows=.false.)
  call test%check('written and read', .not. errors%any())
  call whole()
  call every_byte()
  call shortened()
  call write_file(grows=.true.)
  call without()
  call execute_command_line('rm -rf '//folder)
  deallocate (folder, path)
  call test%finish()

contains

  subroutine write_file(grows)
    logical, intent(in) :: grows
    type(h5_file_type) :: file
    call file%create(path, errors, format='talus-test', grows=grows)
    call file%put('/group/x', [1.0_wp, 2.0_wp, 3.0_wp], errors)
    call file%attr_put('/group', 'time', 0.25_wp, errors)
    call file%commit(errors)
  end subroutine write_file

  !> Is the file read, and with the numbers that were written?
  subroutine read_file(read, same, code, checked)
    logical, intent(out) :: read, same, checked
    character(len=4), intent(out) :: code
    type(error_list_type) :: faults
    type(h5_file_type) :: file
    real(wp), allocatable :: x(:)
    real(wp) :: time
    code = ''
    time = 0.0_wp
    call file%open(path, faults, format='talus-test')
    checked = file%checked
    call file%get('/group/x', x, faults)
    call file%attr_get('/group', 'time', time, faults)
    call file%close(faults)
    read = .not. faults%any()
    same = .false.
    if (.not. read) code = faults%item(1)%code
    if (.not. read) return
    same = size(x) == 3
    if (same) same = all(abs(x - [1.0_wp, 2.0_wp, 3.0_wp]) <= 0.0_wp)
    same = same .and. abs(time - 0.25_wp) <= 0.0_wp
  end subroutine read_file

  subroutine whole()
    logical :: read, same, checked
    character(len=4) :: code
    call read_file(read, same, code, checked)
    call test%check('whole: read', read .and. same)
    call test%check('whole: with a checksum', checked)
  end subroutine whole

  !> Turn one bit of each byte in turn: the file is refused.
  subroutine every_byte()
    logical :: read, same, checked
    character(len=4) :: code
    integer :: unit, stat
    integer(i8) :: k
    integer(i4) :: refused
    character(len=1) :: byte
    refused = 0
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', iostat=stat)
    do k = 1, file_size(path)
      read (unit, pos=k, iostat=stat) byte
      write (unit, pos=k, iostat=stat) achar(ieor(iachar(byte), 2**int(mod(k, 7_i8))))
      flush (unit)
      call read_file(read, same, code, checked)
      if (.not. read .and. code == 'S005') refused = refused + 1
      write (unit, pos=k, iostat=stat) byte
    end do
    close (unit, iostat=stat)
    call test%check('bytes: all refused', refused == int(file_size(path), i4))
  end subroutine every_byte

  subroutine shortened()
    logical :: read, same, checked
    character(len=4) :: code
    integer(i8) :: size
    size = file_size(path)
    call truncate_file(path, size - 1, errors)
    call read_file(read, same, code, checked)
    call test%check('a byte short', code == 'S005')
    call truncate_file(path, int(room, i8), errors)
    call read_file(read, same, code, checked)
    call test%check('the block alone', code == 'S005')
    call truncate_file(path, 100_i8, errors)
    call read_file(read, same, code, checked)
    call test%check('less than the block', code == 'S005')
  end subroutine shortened

  subroutine without()
    logical :: read, same, checked
    character(len=4) :: code
    call read_file(read, same, code, checked)
    call test%check('without: read', read .and. same)
    call test%check('without: told', .not. checked)
  end subroutine without
end program test_talus_file_checksum
