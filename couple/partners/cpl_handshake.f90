!> HELLO to both solvers: who are they, do they agree with each other and with the coupled deck?
module cpl_handshake
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: verb_hello, protocol_version
  use talus_port_names, only: field_analysis, field_capabilities, field_deck_hash, field_dt, &
    field_gravity, field_motion, field_program, field_protocol, field_ranks, field_restart, &
    field_run_id, field_step_limit, field_t_end, field_time, field_version
  use talus_timers, only: timers_type
  use cpl_analysis, only: check_analysis
  use cpl_capabilities, only: check_capabilities
  use cpl_choices, only: cpl_choices_type
  use cpl_solver, only: cpl_solver_type, side_solid
  implicit none
  private
  public :: shake_hands

  real(wp), parameter :: same = 1.0e-9_wp  !! relative, for times and gravity

contains

  !> Greet both before either answer is read, then compare.
  subroutine shake_hands(solvers, choices, run_id, time, timers, dynamic, errors)
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    character(len=*), intent(in) :: run_id
    real(wp), intent(in) :: time  !! at which both must be [s]
    type(timers_type), intent(inout) :: timers
    logical, intent(out) :: dynamic  !! the solid has inertia
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, faults

    dynamic = .false.
    do k = 1, 2
      call solvers(k)%start_request(verb_hello, 0_i8, time, time)
      call solvers(k)%request%put_text(field_run_id, run_id)
      call solvers(k)%request%put_text(field_restart, solvers(k)%restart)
      call solvers(k)%request%put_int(field_protocol, int(protocol_version, i4))
      call solvers(k)%send(timers, errors)
      if (errors%any()) return
    end do
    do k = 1, 2
      faults = errors%count
      call solvers(k)%receive(timers, errors)
      solvers(k)%greeted = errors%count == faults
    end do
    if (errors%any()) return
    solvers(side_solid)%analysis = 'static'
    if (solvers(side_solid)%reply%has(field_analysis)) &
      call solvers(side_solid)%reply%get_text(field_analysis, solvers(side_solid)%analysis, errors)
    dynamic = solvers(side_solid)%analysis /= 'static'
    do k = 1, 2
      call read_answer(solvers(k), errors)
    end do
    if (errors%any()) return
    do k = 1, 2
      call compare(solvers(k), choices, time, errors)
    end do
    call compare_gravity(solvers, choices, errors)
    faults = errors%count
    call check_analysis(solvers(side_solid), choices, errors)
    ! an analysis that does not fit says more than the verb that it lacks
    if (errors%count == faults) call check_capabilities(solvers, choices, errors)
  end subroutine shake_hands

  subroutine read_answer(solver, errors)
    type(cpl_solver_type), intent(inout) :: solver
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: program

    call solver%reply%get_text(field_program, program, errors)
    call solver%reply%get_text(field_version, solver%version, errors)
    call solver%reply%get_text(field_deck_hash, solver%deck_hash, errors)
    call solver%reply%get_text(field_capabilities, solver%capabilities, errors)
    call solver%reply%get(field_gravity, solver%gravity, errors)
    call solver%reply%get(field_time, solver%time, errors)
    call solver%reply%get(field_t_end, solver%t_end, errors)
    call solver%reply%get(field_step_limit, solver%step_limit, errors)
    if (solver%reply%has(field_dt)) call solver%reply%get(field_dt, solver%dt, errors)
    if (solver%reply%has(field_motion)) call solver%reply%get(field_motion, solver%motion, errors)
    call solver%reply%get_int(field_ranks, solver%ranks, errors)
    call solver%reply%all_read(errors)
    if (errors%any()) return
    solver%program = program
  end subroutine read_answer

  !> Start time, end time and step; D410, D415, P412.
  subroutine compare(solver, choices, time, errors)
    type(cpl_solver_type), intent(in) :: solver
    type(cpl_choices_type), intent(in) :: choices
    real(wp), intent(in) :: time  !! s
    type(error_list_type), intent(inout) :: errors
    real(wp) :: steps

    if (abs(solver%time - time) > same*max(choices%exchange, time)) &
      call errors%add('P412', solver%title()//' is at '//str(solver%time)// &
                      ' s, the coupled run begins at '//str(time)//' s', solver%deck, &
                      'go on with --restart=auto of the coupled run, not of a solver')
    if (solver%t_end > 0.0_wp .and. abs(solver%t_end - choices%t_end) > same*choices%t_end) &
      call errors%add('D410', 't_end is '//str(solver%t_end)//' s in '//solver%deck//', '// &
                      str(choices%t_end)//' s in the coupled deck', solver%deck, &
                      'leave t_end out of the solver''s deck, or write the same')
    if (.not. solver%dt > 0.0_wp) return
    steps = choices%exchange/choices%pieces/solver%dt
    if (steps < 1.0_wp - same .or. abs(steps - anint(steps)) > same*steps) &
      call errors%add('D415', what_is_cut(choices)//' is no multiple of dt = '// &
                      str(solver%dt)//' s in '//solver%deck, solver%deck, &
                      'choose a multiple, or leave dt out of the solver''s deck')
  end subroutine compare

  !> 'exchange = 5e-5 s', 'exchange = 5e-5 s in 10 pieces'
  function what_is_cut(choices) result(text)
    type(cpl_choices_type), intent(in) :: choices
    character(len=:), allocatable :: text
    text = 'exchange = '//str(choices%exchange)//' s'
    if (choices%pieces > 1) text = text//' in '//str(choices%pieces)//' pieces'
  end function what_is_cut

  !> Gravity must be the same on both sides, and that of the coupled deck when it names one (D413).
  subroutine compare_gravity(solvers, choices, errors)
    type(cpl_solver_type), intent(in) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors

    if (differs(solvers(1)%gravity, solvers(2)%gravity)) then
      call errors%add('D413', 'gravity is '//str(solvers(1)%gravity)//' for '// &
                      solvers(1)%title()//', '//str(solvers(2)%gravity)//' for '// &
                      solvers(2)%title(), solvers(2)%deck, &
                      'write the same &run gravity in both decks (a relaxation without '// &
                      'gravity_scale has none)')
    else if (choices%gravity_given) then
      if (differs(solvers(1)%gravity, choices%gravity)) &
        call errors%add('D413', 'gravity is '//str(choices%gravity)//' in the coupled deck, '// &
                        str(solvers(1)%gravity)//' for both solvers', solvers(1)%deck, &
                        'leave gravity out of the coupled deck')
    end if
  end subroutine compare_gravity

  pure logical function differs(a, b)
    real(wp), intent(in) :: a(3), b(3)  !! m/s2
    differs = norm2(a - b) > same*max(norm2(a), norm2(b), tiny(1.0_wp))
  end function differs
end module cpl_handshake
