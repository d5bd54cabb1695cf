!> One exchange of an overlap in dynamics (r-RESPA; theory: overlap coupling, Time).
!!
!! Forces of contacts and of elements with prescribed nodes act in every step of the grains, on the
!! free grains and on the edge alike; forces of the other elements are kicks of half an exchange at
!! its start and at its end. All forces are those of one energy and every map is a constant matrix,
!! so that momentum is exact and energy bounded.
module cpl_overlap_step
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_port_names, only: field_scalars
  use talus_timers, only: timers_type
  use cpl_audit_file, only: audit_file_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_ask, only: kick_type, answers_type, send_kick, read_free, send_bulk, read_bulk, &
    ask_solid, ask_grains, take_forces, send_accept
  use cpl_overlap_loads, only: renew_loads
  use cpl_overlap_motion, only: increment_type
  use cpl_overlap_parts, only: remember_start, follow_active, follow_all, work_of_parts, &
    finish_parts
  use cpl_run, only: cpl_run_type
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: overlap_step, evaluate_forces

  !> A step of the grains in an exchange.
  type :: step_type
    real(wp) :: h = 0.0_wp, dt = 0.0_wp            !! lengths of exchange and step [s]
    real(wp) :: t0 = 0.0_wp, t1 = 0.0_wp           !! of the exchange [s]
    real(wp) :: now = 0.0_wp                       !! end of the step [s]
    logical :: first = .false., last = .false.     !! of the exchange
    logical :: due = .false.                       !! its works are yet to be noted
    logical :: drifts = .false.                    !! the solid may still be busy with its drift
    logical :: asked = .false.                     !! the solid was asked for forces
    type(increment_type) :: increment
  end type step_type

contains

  !> From t0 to t1 [s], accepted on both sides; after a fault nothing was accepted. The length h is
  !! the same in every exchange, free of the rounding of times. What no solver waits for is done
  !! while they work, such as writing the row of the exchange before.
  subroutine overlap_step(o, run, t0, t1, audit, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t0, t1
    type(audit_file_type), intent(inout) :: audit
    type(error_list_type), intent(inout) :: errors
    type(step_type) :: step
    integer(i4) :: k

    step%h = run%choices%exchange
    step%dt = step%h/o%rules%substeps
    step%t0 = t0
    step%t1 = t1
    associate (solvers => run%solvers, timers => run%timers)
      call renew_loads(o, solvers(side_solid), t0, t1, timers, errors)
      if (errors%any()) return
      do k = 1, o%rules%substeps
        step%first = k == 1
        step%last = k == o%rules%substeps
        step%now = merge(t1, t0 + k*step%dt, step%last)
        call begin_step(o, solvers, step, timers, errors)
        if (errors%any()) return
        if (o%forces%parts%active) then
          call step_in_parts(o, solvers, step, timers, errors)
        else
          call step_at_once(o, solvers, step, timers, errors)
        end if
        if (errors%any()) return
        call note_damping(o)
      end do
      call finish_step(o, solvers, step, audit, timers, errors)
      if (errors%any()) return
      solvers%owes = .true.  ! answers to ACCEPT, which nobody needs yet
      call o%count_exchange()
      if (o%forces%parts%active) call finish_parts(o, solvers(side_grains), timers, errors)
    end associate
  end subroutine overlap_step

  !> KICK_DRIFT of the grains, and of the solid once an exchange; meanwhile the edge is moved.
  subroutine begin_step(o, solvers, step, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(step_type), intent(inout) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: kick

    kick = merge(0.5_wp*step%dt, step%dt, step%first)
    call send_kick(o, solvers(side_grains), kick_type(kick, step%dt, step%now - step%dt, &
      step%now), step%first, timers, errors)
    if (step%first) then
      call send_bulk(o, solvers(side_solid), kick_type(merge(0.5_wp*step%h, step%h, &
        o%rules%symmetric), step%h, step%t0, step%t1), timers, errors)
      step%drifts = .true.
      call begin_exchange(o, step%h)
    end if
    call note_step(o, step, timers)
    step%increment%u = o%motion%u
    step%increment%phi = o%motion%phi
    if (o%rules%symmetric) call o%kick_edge(kick, o%forces%f, o%forces%c)
    call o%drift_edge(step%dt)
    if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
    if (errors%any()) return
    call keep_before(o)
    call read_free(o, solvers(side_grains), timers, errors)
    call note_damping(o)
  end subroutine begin_step

  !> State at the start, and the edge's kick with the forces that come once an exchange.
  subroutine begin_exchange(o, h)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: h  !! [s]
    if (o%forces%parts%active) call remember_start(o)
    if (o%rules%symmetric) then
      call kick_with_bulk(o, 0.5_wp*h)
    else
      call o%kick_edge(h, o%forces%bulk + o%forces%f, o%forces%bulk_phi + o%forces%c)
    end if
  end subroutine begin_exchange

  !> Works of the step before this one.
  subroutine note_step(o, step, timers)
    type(overlap_type), intent(inout) :: o
    type(step_type), intent(inout) :: step
    type(timers_type), intent(inout) :: timers
    if (.not. step%due) return
    step%due = .false.
    call timers%start('works')
    call o%note_work(step%increment)
    call timers%stop('works')
  end subroutine note_step

  !> What the free grains did until now becomes what they did before; it is read next.
  subroutine keep_before(o)
    type(overlap_type), intent(inout) :: o
    call exchange_arrays(o%motion%q, o%motion%q_before)
    if (o%rules%turns) call exchange_arrays(o%motion%theta, o%motion%theta_before)
  end subroutine keep_before

  pure subroutine exchange_arrays(a, b)
    real(wp), allocatable, intent(inout) :: a(:, :), b(:, :)
    real(wp), allocatable :: c(:, :)
    call move_alloc(a, c)
    call move_alloc(b, a)
    call move_alloc(c, b)
  end subroutine exchange_arrays

  !> Ghosts follow, all forces.
  subroutine step_at_once(o, solvers, step, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(step_type), intent(inout) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, o%op%ghosts) :: v, spin

    call timers%start('projection and maps')
    call o%follow(step%dt, v, spin)
    call timers%stop('projection and maps')
    call ask_elements(o, solvers(side_solid), step, timers, errors)
    call ask_grains(o, solvers(side_grains), v, spin, step%now, timers, errors)
    step%increment%moved = step%dt*v
    step%increment%turns = step%dt*spin
    step%due = .true.
    call take_step_forces(o, solvers, step, timers, errors)
  end subroutine step_at_once

  !> The same where forces come in parts. The solid goes on as soon as the nodes are known, unless
  !! it may still be busy with its own step.
  subroutine step_in_parts(o, solvers, step, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(step_type), intent(inout) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, size(o%forces%parts%active_rows)) :: moved, turns
    logical :: late  !! the solid is asked after the grains

    call timers%start('projection and maps')
    call o%follow_prescribed(step%dt)
    call timers%stop('projection and maps')
    late = step%drifts
    if (.not. late) call ask_elements(o, solvers(side_solid), step, timers, errors)
    call timers%start('projection and maps')
    call follow_active(o, moved, turns)
    call timers%stop('projection and maps')
    call ask_grains(o, solvers(side_grains), moved/step%dt, turns/step%dt, step%now, timers, &
                    errors)
    if (late) call ask_elements(o, solvers(side_solid), step, timers, errors)
    step%increment%moved = moved
    step%increment%turns = turns
    step%due = .true.
    if (step%last) call place_all(o, step%h)
    call take_step_forces(o, solvers, step, timers, errors)

  contains

    !> All ghosts, for the forces between them, which are asked for next.
    subroutine place_all(o, h)
      type(overlap_type), intent(inout) :: o
      real(wp), intent(in) :: h  !! [s]
      call timers%start('projection and maps')
      call follow_all(o, h)
      call timers%stop('projection and maps')
    end subroutine place_all
  end subroutine step_in_parts

  !> Forces of the elements with prescribed nodes. Where no node follows free grains there are none,
  !! and the solid goes on with its drift until it must know where the edge came.
  subroutine ask_elements(o, solid, step, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(step_type), intent(inout) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    step%asked = step%last .or. o%op%prescribed > 0 .or. o%op%prescribed_phi > 0
    if (.not. step%asked) return
    if (step%drifts .and. .not. errors%any()) call solid%receive(timers, errors)
    step%drifts = .false.
    call ask_solid(o, solid, step%now, timers, errors)
  end subroutine ask_elements

  !> Forces at the end of a step; at that of an exchange also those that come once an exchange.
  subroutine take_step_forces(o, solvers, step, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(step_type), intent(in) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(answers_type) :: answers
    answers = answers_type(step%last .and. o%forces%parts%active, step%asked, step%last, &
                           merge(0.5_wp*step%h, 0.0_wp, o%rules%symmetric))
    call take_forces(o, solvers, answers, step%now, timers, errors)
  end subroutine take_step_forces

  !> Kick of the edge with the forces that are evaluated once an exchange.
  subroutine kick_with_bulk(o, kick)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: kick  !! [s]
    if (o%forces%parts%active) then
      call o%kick_edge(kick, o%forces%bulk + o%forces%parts%remainder%f, o%forces%bulk_phi &
        + o%forces%parts%remainder%c)
    else
      call o%kick_edge(kick, o%forces%bulk, o%forces%bulk_phi)
    end if
  end subroutine kick_with_bulk

  !> Half of what the damping takes in a step.
  subroutine note_damping(o)
    type(overlap_type), intent(inout) :: o
    if (o%own%damping%active) call o%own%damping%note(o%motion%q - o%motion%q_before)
    if (o%own%damping_phi%active) call o%own%damping_phi%note(o%motion%theta &
      - o%motion%theta_before)
  end subroutine note_damping

  !> The last half kicks, with everything at t1; ACCEPT is sent to both.
  subroutine finish_step(o, solvers, step, audit, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(step_type), intent(inout) :: step
    type(audit_file_type), intent(inout) :: audit
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    call send_kick(o, solvers(side_grains), kick_type(0.5_wp*step%dt, 0.0_wp, step%t1, step%t1), &
      .true., timers, errors)
    if (errors%any()) return
    if (o%rules%symmetric) call o%kick_edge(0.5_wp*step%dt, o%forces%f, o%forces%c)
    call note_step(o, step, timers)
    if (o%forces%parts%active) call work_of_parts(o, timers)
    call o%measure_past()
    call timers%start('audit and log')
    call audit%write(errors)
    call timers%stop('audit and log')
    if (.not. errors%any()) call solvers(side_solid)%receive(timers, errors)
    if (.not. errors%any()) call read_bulk(o, solvers(side_solid), errors)
    if (errors%any()) return
    if (o%rules%symmetric) call kick_with_bulk(o, 0.5_wp*step%h)
    if (.not. o%finite()) &
      call errors%add('N407', 'a force or displacement of the overlap is no number', &
                      'exchange to '//str(step%t1)//' s', 'one side has become unstable: check '// &
                      'the steps of both against their limits')
    if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
    if (errors%any()) return
    call send_accept(o, solvers(side_grains), step%t0, step%t1, timers, errors)
    if (o%rules%reads_speed) call read_free(o, solvers(side_grains), timers, errors)
    call solvers(side_grains)%reply%get(field_scalars, o%ledger%grains, errors)
    if (o%own%carried%active) call o%op%to_prescribed(o%motion%speed, o%motion%spin, o%motion%v, &
      o%motion%w)
    call send_accept(o, solvers(side_solid), step%t0, step%t1, timers, errors)
  end subroutine finish_step

  !> FORCE on both sides with ghosts and nodes where they are now, and what comes back to the free.
  subroutine evaluate_forces(o, solvers, v, spin, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: v(:, :), spin(:, :)  !! of the ghosts (3, ghosts) [m/s], [rad/s]
    real(wp), intent(in) :: t                    !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call ask_solid(o, solvers(side_solid), t, timers, errors)
    call ask_grains(o, solvers(side_grains), v, spin, t, timers, errors)
    call take_forces(o, solvers, answers_type(), t, timers, errors)
  end subroutine evaluate_forces
end module cpl_overlap_step
