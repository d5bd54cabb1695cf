!> Rendezvous file: where programs that the user starts one by one find their port.
!!
!! Four lines: port, host, place (boot id and process namespace), run id. talus-couple writes it
!! when launch = 'attach'; the solver is started with --port=attach:FILE.
module talus_rendezvous
  use talus_kinds, only: wp
  use talus_text, only: str, string_type, starts_with
  use talus_errors, only: error_list_type
  use talus_system, only: signal_seen
  use talus_partner, only: now, nap, own_host, own_place
  use talus_port_file, only: read_lines, write_lines, remove_file
  implicit none
  private
  public :: write_rendezvous, read_rendezvous, remove_rendezvous

contains

  !> talus-couple: write where the port is.
  subroutine write_rendezvous(path, spec, run_id, errors)
    character(len=*), intent(in) :: path, spec, run_id
    type(error_list_type), intent(inout) :: errors
    character(len=1), parameter :: nl = new_line('a')
    integer :: code
    code = write_lines(path, spec//nl//own_host()//nl//own_place()//nl//run_id//nl)
    if (code /= 0) &
      call errors%add('P018', 'the rendezvous file cannot be written (system error '// &
                      str(code)//')', path, 'a writable folder that both sides see')
  end subroutine write_rendezvous

  !> Serve side: wait for the file and learn the port; shared memory needs the same machine.
  subroutine read_rendezvous(path, limit, spec, run_id, errors)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: limit  !! s to wait for the file
    character(len=:), allocatable, intent(out) :: spec, run_id
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: line(:)
    real(wp) :: started

    spec = ''
    run_id = ''
    started = now()
    do
      call read_lines(path, line)
      if (size(line) == 4) exit
      if (signal_seen() /= 0) then
        call errors%add('P003', 'stopped by a signal before a talus-couple had written the '// &
                        'rendezvous file', path, 'start talus-couple with launch = ''attach''')
        return
      end if
      if (now() - started > limit) then
        call errors%add('P003', 'no talus-couple has written the rendezvous file within '// &
                        str(limit)//' s', path, 'start talus-couple with launch = ''attach''')
        return
      end if
      call nap(0.05_wp)
    end do
    spec = line(1)%s
    run_id = line(4)%s
    if (.not. starts_with(spec, 'shm:') .or. line(3)%s == own_place()) return
    call errors%add('P016', 'talus-couple runs on '//line(2)%s//', this program on '// &
                    own_host()//': shared memory does not reach so far', path, &
                    'use transport = ''hdf5'' in &port, or one host')
  end subroutine read_rendezvous

  subroutine remove_rendezvous(path)
    character(len=*), intent(in) :: path
    call remove_file(path)
  end subroutine remove_rendezvous
end module talus_rendezvous
