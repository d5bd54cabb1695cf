!> Start the solvers with a port each, and end them: no process and no port is left.
module cpl_launch
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_files, only: remove_file
  use talus_log, only: log_type
  use talus_message, only: verb_stop, verb_abort
  use talus_port_names, only: field_early
  use talus_process, only: sibling_program, signal_none
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: launch_solver, stop_solvers, abort_solvers

  real(wp), parameter :: attach_wait = 600.0_wp   !! s for a user to start a solver
  real(wp), parameter :: command_wait = 120.0_wp  !! s for a launcher or a queue
  real(wp), parameter :: fork_wait = 30.0_wp      !! s
  real(wp), parameter :: stop_grace = 30.0_wp     !! s that a solver takes to end after its reply
  real(wp), parameter :: abort_grace = 0.5_wp     !! s

contains

  !> Open the port and start the solver, or tell the user how.
  subroutine launch_solver(solver, choices, run_id, folder, log, errors)
    type(cpl_solver_type), intent(inout) :: solver
    type(cpl_choices_type), intent(in) :: choices
    character(len=*), intent(in) :: run_id
    character(len=*), intent(in) :: folder  !! of the results
    type(log_type), intent(inout) :: log
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: spec
    integer(i4) :: faults

    faults = errors%count
    spec = 'shm:/talus-'//run_id//'-'//solver%side
    if (choices%transport == 'hdf5') &
      spec = 'hdf5:'//folder//'/talus-'//run_id//'.port/'//solver%side
    solver%port%trace = choices%trace
    solver%port%partner%name = solver%title()
    solver%port%partner%log = solver%output
    solver%port%join_limit = max(choices%time_limit, fork_wait)
    if (solver%launch == 'attach') solver%port%join_limit = max(choices%time_limit, attach_wait)
    if (solver%launch == 'command') solver%port%join_limit = max(choices%time_limit, command_wait)
    call solver%port%create(spec, run_id, choices%time_limit, errors)
    if (errors%count > faults) return
    solver%started = .true.
    if (solver%launch == 'attach') then
      call invite(solver, folder//'/'//run_id//'.'//solver%side//'.port', log, errors)
    else
      call start_process(solver, spec, folder, errors)
    end if
    if (errors%count == faults .and. solver%process%pid > 0) &
      call solver%port%watch(solver%process%pid)
  end subroutine launch_solver

  !> Write the rendezvous file and say what to start.
  subroutine invite(solver, path, log, errors)
    type(cpl_solver_type), intent(inout) :: solver
    character(len=*), intent(in) :: path
    type(log_type), intent(inout) :: log
    type(error_list_type), intent(inout) :: errors
    call solver%port%publish(path, errors)
    call log%line('waiting for you to start: '//solver%program//' '//solver%deck// &
                  ' --port=attach:'//path)
  end subroutine invite

  subroutine start_process(solver, spec, folder, errors)
    type(cpl_solver_type), intent(inout) :: solver
    character(len=*), intent(in) :: spec, folder
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: argv(:)

    if (solver%launch /= 'command') call append_string(argv, sibling_program(solver%program))
    call append_string(argv, solver%deck)
    call append_string(argv, '--port='//spec)
    call append_string(argv, '--output='//folder)
    if (solver%threads > 0) call append_string(argv, '--threads='//str(solver%threads))
    if (len(solver%restart) > 0) call append_string(argv, '--restart='//solver%restart)
    if (solver%launch == 'command') then
      call solver%process%spawn_command(solver%command, '', solver%output, solver%threads, errors, &
                                        argv)
    else
      call solver%process%spawn(argv, '', solver%output, solver%threads, errors, signal_none)
    end if
  end subroutine start_process

  !> The normal end: both are asked to stop before either is read; early asks for exit code 3.
  subroutine stop_solvers(solvers, early, step, time, timers, errors)
    type(cpl_solver_type), intent(inout) :: solvers(:)
    logical, intent(in) :: early
    integer(i8), intent(in) :: step
    real(wp), intent(in) :: time  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, wanted

    do k = 1, size(solvers)
      call solvers(k)%start_request(verb_stop, step, time, time)
      call solvers(k)%request%put_int(field_early, merge(1_i4, 0_i4, early))
      call solvers(k)%send(timers, errors)
    end do
    do k = 1, size(solvers)
      call solvers(k)%receive(timers, errors)
    end do
    if (errors%any()) return
    wanted = merge(3_i4, 0_i4, early)
    do k = 1, size(solvers)
      call solvers(k)%port%close()
      if (solvers(k)%process%pid == 0) cycle
      if (.not. solvers(k)%process%wait(stop_grace)) then
        call errors%add('P422', solvers(k)%title()//' answered STOP but has not ended after '// &
                        str(stop_grace)//' s', solvers(k)%output, 'its results are complete')
      else if (solvers(k)%process%exit_code /= wanted) then
        call errors%add('P423', solvers(k)%title()//' answered STOP, but ended with '// &
                        solvers(k)%process%epitaph(), solvers(k)%output, 'its log has the reason')
      else if (.not. errors%any()) then
        call remove_file(solvers(k)%output)
      end if
      call solvers(k)%process%stop(abort_grace)
    end do
    solvers(:)%started = .false.
  end subroutine stop_solvers

  !> After a fault: ask those that still answer to leave at once, then end what is left.
  subroutine abort_solvers(solvers, step, time)
    type(cpl_solver_type), intent(inout) :: solvers(:)
    integer(i8), intent(in) :: step
    real(wp), intent(in) :: time  !! s
    type(error_list_type) :: ignored
    logical :: ended
    integer(i4) :: k

    do k = 1, size(solvers)
      if (.not. solvers(k)%started) cycle
      ended = solvers(k)%lost
      if (solvers(k)%greeted .and. .not. solvers(k)%lost) then
        call solvers(k)%start_request(verb_abort, step, time, time)
        call solvers(k)%port%send(solvers(k)%request, ignored)
        ended = solvers(k)%process%wait(2.0_wp*abort_grace)
      end if
      call solvers(k)%process%stop(merge(0.0_wp, abort_grace, ended))
      if (.not. solvers(k)%lost .and. solvers(k)%launch /= 'attach') &
        call remove_file(solvers(k)%output)
      call solvers(k)%port%close()
      solvers(k)%started = .false.
    end do
  end subroutine abort_solvers
end module cpl_launch
