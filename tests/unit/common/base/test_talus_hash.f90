!> Hashes against published values of FNV-1a, and of files.
program test_talus_hash
  use talus_kinds, only: i4
  use talus_text, only: str
  use talus_hash, only: hash_text, hash_file
  use talus_system, only: process_id
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test
  character(len=16) :: hex
  character(len=:), allocatable :: path
  integer(i4) :: status
  integer :: unit

  ! values of the reference implementation (Fowler, Noll, Vo)
  call test%check_text('empty', hash_text(''), 'CBF29CE484222325')
  call test%check_text('a', hash_text('a'), 'AF63DC4C8601EC8C')
  call test%check_text('foobar', hash_text('foobar'), '85944171F73967E8')
  path = '/tmp/talus_test_hash_'//str(int(process_id(), i4))
  open (newunit=unit, file=path, access='stream', form='unformatted', status='replace')
  write (unit) 'foobar'
  close (unit)
  call hash_file(path, hex, status)
  call test%check('file read', status == 0)
  call test%check_text('file', hex, '85944171F73967E8')
  open (newunit=unit, file=path, status='old')
  close (unit, status='delete')
  call hash_file(path, hex, status)
  call test%check('no file', status /= 0 .and. hex == '')
  call test%finish()
end program test_talus_hash
