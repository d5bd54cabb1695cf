!> Large arrays: where they begin, and that they are kept for the next of their size and not
!! longer than there is room.
program test_talus_memory
  use, intrinsic :: iso_c_binding, only: c_loc, c_intptr_t
  use talus_kinds, only: wp, i8
  use talus_system, only: keep_memory, memory_most, memory_resident
  use talus_test, only: test_type
  implicit none

  integer, parameter :: many = 4*2**20, fewer = 15*2**18  !! reals, 32 and 30 MiB
  type(test_type) :: test
  real(wp), allocatable, target :: first(:), second(:)
  integer(c_intptr_t) :: place
  integer(i8) :: most

  if (command_argument_count() > 0) call ask_for_too_much()
  if (watched()) then  ! by the address sanitizer of MODE=debug, which keeps all that is freed
    call test%check('nothing to be seen here', .true.)
    call test%finish()
    stop
  end if
  allocate (first(many), source=1.0_wp)
  call test%check('begins on a line', modulo(at(first), 64_c_intptr_t) == 0)
  deallocate (first)
  call keep_memory()

  allocate (first(many), source=1.0_wp)
  place = at(first)
  deallocate (first)
  allocate (first(fewer), source=2.0_wp)
  call test%check('one of a little less takes its place', at(first) == place)
  deallocate (first)
  allocate (first(many/2), source=3.0_wp)
  call test%check('one of half the size does not', at(first) /= place)
  deallocate (first)

  ! two together, then one as large as both: what is kept is freed first
  allocate (first(many), source=4.0_wp)
  allocate (second(many), source=5.0_wp)
  most = memory_most()
  deallocate (first, second)
  allocate (first(2*many), source=6.0_wp)
  call test%check('what is kept does not add to the most', memory_most() < most + 8*many/4)
  call test%check('values are its own', all(abs(first - 6.0_wp) <= 0.0_wp))
  most = memory_resident()
  deallocate (first)
  call test%check('given back where it is asked for', memory_resident() < most - 8_i8*many)
  call no_memory()
  call test%finish()

contains

  !> More than an address has room for: in a process of its own.
  subroutine ask_for_too_much()
    real(wp), allocatable :: all(:)
    allocate (all(2_i8**56))
    all(1) = 1.0_wp
    print '(f4.1)', all(1)
    stop
  end subroutine ask_for_too_much

  !> S018 in one line, which begins a new one, and exit code 4.
  subroutine no_memory()
    character(len=512) :: program, line, more
    integer :: code, unit, stat
    call get_command_argument(0, program)
    call execute_command_line(trim(program)//' ask >'//trim(program)//'.out 2>&1', exitstat=code)
    call test%check('exit code of a system failure', code == 4)
    open (newunit=unit, file=trim(program)//'.out', action='read')
    read (unit, '(a)') more
    call test%check('a new line', len_trim(more) == 0)
    read (unit, '(a)') line
    read (unit, '(a)', iostat=stat) more
    close (unit, status='delete')
    call test%check('S018 tells how much', index(line, 'error S018: no memory for 549755813888.0 ' &
                                                 //'MiB more') == 1)
    call test%check('and what to do', index(line, 'take a smaller model') > 0)
    call test%check('and no more', stat /= 0)
  end subroutine no_memory

  !> Is the library of the address sanitizer loaded?
  logical function watched()
    character(len=512) :: line
    integer :: unit, stat
    watched = .false.
    open (newunit=unit, file='/proc/self/maps', action='read', iostat=stat)
    do while (stat == 0)
      read (unit, '(a)', iostat=stat) line
      if (stat == 0) watched = watched .or. index(line, 'libasan') > 0
    end do
    close (unit)
  end function watched

  integer(c_intptr_t) function at(array)
    real(wp), intent(in), target :: array(:)
    at = transfer(c_loc(array(1)), at)
  end function at
end program test_talus_memory
