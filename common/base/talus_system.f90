!> The process and its machine: signals, wall clock, host, memory, environment, start-up and exit.
!!
!! Signals: the first SIGINT, SIGTERM, SIGQUIT or SIGHUP requests a stop with a checkpoint
!! (talus_stop), one at the very start too. What follows within two seconds counts as the same
!! request, since launchers deliver it twice; a later one ends the program at once. SIGUSR1 requests
!! a checkpoint and the run continues.
module talus_system
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int64_t, c_null_char
  use, intrinsic :: iso_fortran_env, only: compiler_version, error_unit, output_unit
  use talus_kinds, only: wp, i4, i8
  use talus_c_text, only: c_string, text_of
  implicit none
  private
  public :: begin_signals, install_signals, signal_seen, signal_checkpoint
  public :: wall_clock, host_name, boot_id, process_id, date_text
  public :: memory_free, memory_resident, memory_most, keep_memory, is_terminal
  public :: environment, set_environment, clear_environment, talus_blas_kernels, talus_short_spins
  public :: talus_exit
  public :: compiler_text, system_error_text

  interface
    subroutine c_signals(obey, second_leaves) bind(c, name='talus_c_signals')
      import :: c_int
      integer(c_int), value :: obey, second_leaves
    end subroutine c_signals
    integer(c_int) function c_signal_seen() bind(c, name='talus_c_signal_seen')
      import :: c_int
    end function c_signal_seen
    integer(c_int) function c_signal_checkpoint() bind(c, name='talus_c_signal_checkpoint')
      import :: c_int
    end function c_signal_checkpoint
    real(c_double) function c_wall() bind(c, name='talus_c_wall')
      import :: c_double
    end function c_wall
    integer(c_int) function c_pid() bind(c, name='talus_c_pid')
      import :: c_int
    end function c_pid
    subroutine c_host(text, room) bind(c, name='talus_c_host')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: text(*)
      integer(c_int), value :: room
    end subroutine c_host
    integer(c_int64_t) function c_memory_free() bind(c, name='talus_c_memory_free')
      import :: c_int64_t
    end function c_memory_free
    integer(c_int64_t) function c_memory_resident() bind(c, name='talus_c_memory_resident')
      import :: c_int64_t
    end function c_memory_resident
    subroutine c_keep_memory() bind(c, name='talus_keep_memory')
    end subroutine c_keep_memory
    subroutine c_give_back() bind(c, name='talus_give_back')
    end subroutine c_give_back
    integer(c_int64_t) function c_memory_most() bind(c, name='talus_c_memory_most')
      import :: c_int64_t
    end function c_memory_most
    integer(c_int) function c_is_terminal(fd) bind(c, name='talus_c_is_terminal')
      import :: c_int
      integer(c_int), value :: fd
    end function c_is_terminal
    integer(c_int) function c_setenv(name, text, overwrite) bind(c, name='talus_c_setenv')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*), text(*)
      integer(c_int), value :: overwrite
    end function c_setenv
    integer(c_int) function c_unsetenv(name) bind(c, name='talus_c_unsetenv')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*)
    end function c_unsetenv
    subroutine c_exit(code) bind(c, name='talus_c_exit')
      import :: c_int
      integer(c_int), value :: code
    end subroutine c_exit
    integer(c_int) function c_blas_kernels() bind(c, name='talus_c_blas_kernels')
      import :: c_int
    end function c_blas_kernels
    subroutine c_first_signals() bind(c, name='talus_c_first_signals')
    end subroutine c_first_signals
    integer(c_int) function c_short_spins() bind(c, name='talus_c_short_spins')
      import :: c_int
    end function c_short_spins
    subroutine c_error_text(error, text, room) bind(c, name='talus_c_error_text')
      import :: c_char, c_int
      integer(c_int), value :: error, room
      character(kind=c_char), intent(out) :: text(*)
    end subroutine c_error_text
  end interface

contains

  !> To be called at the start of the main program: SIGPIPE and SIGXFSZ become write errors, and the
  !! first request to stop (SIGINT, SIGTERM, SIGQUIT, SIGHUP) is kept for those who look for it.
  subroutine begin_signals()
    call c_first_signals()
  end subroutine begin_signals

  !> Set up the signals; SIGPIPE and SIGXFSZ are always ignored, so that they become write errors.
  subroutine install_signals(obey, second_leaves)
    logical, intent(in) :: obey                    !! .false.: stops and USR1 are the starter's
    logical, intent(in), optional :: second_leaves !! a second request ends at once (default true)
    logical :: leaves
    leaves = .true.
    if (present(second_leaves)) leaves = second_leaves
    call c_signals(merge(1_c_int, 0_c_int, obey), merge(1_c_int, 0_c_int, leaves))
  end subroutine install_signals

  !> Number of the first stop signal received, 0 if none.
  integer(i4) function signal_seen()
    signal_seen = c_signal_seen()
  end function signal_seen

  !> True once after each SIGUSR1.
  logical function signal_checkpoint()
    signal_checkpoint = c_signal_checkpoint() /= 0
  end function signal_checkpoint

  !> Monotonic wall clock [s]; only differences mean anything.
  real(wp) function wall_clock()
    wall_clock = c_wall()
  end function wall_clock

  integer(i4) function process_id()
    process_id = c_pid()
  end function process_id

  function host_name() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(256)
    call c_host(buffer, size(buffer, kind=c_int))
    text = text_of(buffer)
  end function host_name

  !> Identity of this boot of this machine; empty where the kernel does not report it.
  function boot_id() result(text)
    character(len=:), allocatable :: text
    character(len=64) :: line
    integer :: unit, stat
    text = ''
    open (newunit=unit, file='/proc/sys/kernel/random/boot_id', action='read', status='old', &
          iostat=stat)
    if (stat /= 0) return
    read (unit, '(a)', iostat=stat) line
    if (stat == 0) text = trim(line)
    close (unit, iostat=stat)
  end function boot_id

  !> Local date and time, '2026-11-21 05:30:12'.
  function date_text() result(text)
    character(len=:), allocatable :: text
    integer :: now(8)
    character(len=19) :: buffer
    call date_and_time(values=now)
    write (buffer, '(i4.4,"-",i2.2,"-",i2.2," ",i2.2,":",i2.2,":",i2.2)') now(1:3), now(5:7)
    text = buffer
  end function date_text

  !> Memory that programs can still get [byte], -1 where unknown.
  integer(i8) function memory_free()
    memory_free = c_memory_free()
  end function memory_free

  !> Large arrays that are given back are kept for others of their size from now on.
  subroutine keep_memory()
    call c_keep_memory()
  end subroutine keep_memory

  !> Memory that this process holds now and has use for [byte], -1 where unknown.
  integer(i8) function memory_resident()
    call c_give_back()
    memory_resident = c_memory_resident()
  end function memory_resident

  !> The most memory that this process ever had [byte], -1 if unknown.
  integer(i8) function memory_most()
    memory_most = c_memory_most()
  end function memory_most

  !> Does a file descriptor (1: standard output) lead to a terminal?
  logical function is_terminal(descriptor)
    integer(i4), intent(in) :: descriptor
    is_terminal = c_is_terminal(int(descriptor, c_int)) /= 0
  end function is_terminal

  !> Value of an environment variable, empty when it is not set.
  function environment(name) result(text)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    integer :: length, stat
    call get_environment_variable(name, length=length, status=stat)
    if (stat /= 0) length = 0
    allocate (character(len=length) :: text)
    if (length > 0) call get_environment_variable(name, value=text)
  end function environment

  subroutine set_environment(name, text, overwrite)
    character(len=*), intent(in) :: name, text
    logical, intent(in) :: overwrite
    integer(c_int) :: stat
    stat = c_setenv(c_string(name), c_string(text), merge(1_c_int, 0_c_int, overwrite))
    if (stat /= 0) error stop 'bug: set_environment: not a variable name'
  end subroutine set_environment

  !> Take a variable out of the environment; none of that name is no fault.
  subroutine clear_environment(name)
    character(len=*), intent(in) :: name
    integer(c_int) :: stat
    stat = c_unsetenv(c_string(name))
    if (stat /= 0) error stop 'bug: clear_environment: not a variable name'
  end subroutine clear_environment

  !> OpenBLAS uses the kernels of this CPU: unless OPENBLAS_CORETYPE was set, the program has set it
  !! and restarted itself before its libraries were loaded (talus_start.c). Warns if that failed.
  subroutine talus_blas_kernels()
    integer(c_int) :: stat
    flush (output_unit)
    stat = c_blas_kernels()
    if (stat /= 0) write (error_unit, '(a)') 'warning: BLAS kernels of this CPU not chosen: '// &
      system_error_text(int(stat, i4))//'; set OPENBLAS_CORETYPE by hand'
  end subroutine talus_blas_kernels

  !> Waiting OpenMP threads sleep soon: unless OMP_WAIT_POLICY or GOMP_SPINCOUNT was set, a short
  !! spin is set in the same way. On a busy machine the library's default spins for milliseconds
  !! at every barrier. Warns if that failed.
  subroutine talus_short_spins()
    integer(c_int) :: stat
    flush (output_unit)
    stat = c_short_spins()
    if (stat /= 0) write (error_unit, '(a)') 'warning: threads may spin: '// &
      system_error_text(int(stat, i4))//'; set OMP_WAIT_POLICY=passive by hand'
  end subroutine talus_short_spins

  !> Flush all units and leave with this exit code.
  subroutine talus_exit(code)
    integer(i4), intent(in) :: code
    flush (output_unit)
    flush (error_unit)
    call c_exit(int(code, c_int))
  end subroutine talus_exit

  !> Name and version of the compiler.
  function compiler_text() result(text)
    character(len=:), allocatable :: text
    text = compiler_version()
  end function compiler_text

  !> The system's words for an error number.
  function system_error_text(error) result(text)
    integer(i4), intent(in) :: error
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(256)
    call c_error_text(int(error, c_int), buffer, size(buffer, kind=c_int))
    text = text_of(buffer)
  end function system_error_text
end module talus_system
