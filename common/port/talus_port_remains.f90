!> What a killed talus-couple leaves at its ports, and who removes it (talus_port_remains.c).
module talus_port_remains
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use talus_kinds, only: i4
  implicit none
  private
  public :: remove_remains, watch_asker, is_orphan

  interface
    subroutine c_sweep(folder) bind(c, name='talus_remains_sweep')
      import :: c_char
      character(kind=c_char), intent(in) :: folder(*)
    end subroutine c_sweep
    subroutine c_watch(pid, segment, folder, keep_messages) bind(c, name='talus_remains_watch')
      import :: c_char, c_int
      integer(c_int), value :: pid, keep_messages
      character(kind=c_char), intent(in) :: segment(*), folder(*)
    end subroutine c_watch
    function c_orphaned() result(orphaned) bind(c, name='talus_remains_orphaned')
      import :: c_int
      integer(c_int) :: orphaned
    end function c_orphaned
  end interface

contains

  !> Remove segments of dead runs on this machine, and their ports in a folder of results.
  subroutine remove_remains(folder)
    character(len=*), intent(in) :: folder
    call c_sweep(folder//c_null_char)
  end subroutine remove_remains

  !> Solver: once talus-couple has ended, its port is removed, and this process ends at once (exit
  !! code 4) if it was started by talus-couple.
  subroutine watch_asker(pid, segment, folder, keep_messages)
    integer(i4), intent(in) :: pid            !! of talus-couple, on this machine
    character(len=*), intent(in) :: segment   !! '/talus-RUN-SIDE'; '' for the hdf5 transport
    character(len=*), intent(in) :: folder    !! of the hdf5 transport, else ''
    logical, intent(in) :: keep_messages
    call c_watch(pid, segment//c_null_char, folder//c_null_char, &
                 merge(1_c_int, 0_c_int, keep_messages))
  end subroutine watch_asker

  !> Whether talus-couple had started this process and has ended.
  logical function is_orphan()
    is_orphan = c_orphaned() /= 0
  end function is_orphan
end module talus_port_remains
