!> Steps of a run of its own, to the end, a fault or a request to stop.
module fem_run
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_stop, only: stop_none
  use fem_body, only: fem_body_type
  use fem_mm_watch, only: watch_ellipticity
  use fem_judgement, only: watch_gradient
  use fem_model, only: fem_model_type
  use fem_run_files, only: log_row, log_factors
  implicit none
  private
  public :: run_model

  real(wp), parameter :: near = 1.0e-9_wp  !! of a step that counts as the end
  real(wp), parameter :: round_off = 1.0e-10_wp  !! of sums that cancel
  real(wp), parameter :: runaway = 10.0_wp !! stored energy / supplied work that ends a run

contains

  !> Steps to the end, a fault or a request to stop.
  subroutine run_model(model, errors)
    type(fem_model_type), intent(inout) :: model
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t1
    integer(i8) :: rows  !! of histories
    logical :: last, save_now, iterated

    do
      if (model%analysis%complete(model%body)) exit
      call check_requests(model, save_now)
      if (model%stopped) exit
      if (save_now) call model%save_checkpoint('', errors)
      call next_time(model, t1, last)
      call model%timers%start('steps')
      iterated = model%body%system%solver%iterative
      call model%analysis%step(model%body, t1, errors)
      call model%analysis%report(model%body, model%log)
      if (errors%any() .and. model%auto_solver .and. model%body%system%solver%iterative) &
        call go_direct(model, t1, errors)
      if (iterated .and. .not. model%body%system%solver%iterative) call tell_factors(model)
      call model%timers%stop('steps')
      if (model%body%matter%active) call model%output%write_iterations(model%body, errors)
      if (.not. errors%any()) call check_energy(model%body, errors)
      call watch_ellipticity(model%body, model%log, errors%any(), model%elliptic)
      call model%ranks%agree(errors)
      if (errors%any()) return
      call model%body%hand_over()
      if (model%analysis%variable) last = model%analysis%complete(model%body)
      model%steps = model%steps + 1
      call model%timers%start('output')
      rows = model%output%next_history
      call model%output%write_due(model%body, model%analysis, last, errors)
      if (model%output%next_history > rows) call watch_gradient(model)
      call model%timers%stop('output')
      call model%ranks%agree(errors)
      if (errors%any()) return
      call log_iterations(model)
      if (row_due(model)) call log_row(model)
      if (.not. model%ranks%several()) &  ! a launcher's screen is a terminal, also into a file
        call model%log%progress(t1/model%analysis%t_end, 'time '//short_number(t1)//' s')
    end do
  end subroutine run_model

  !> Is a row of the log due? Where nodes are dealt out all ranks have a part in it.
  logical function row_due(model)
    type(fem_model_type), intent(inout) :: model
    integer(i4) :: due(1)
    row_due = model%log%row_due()
    if (.not. model%body%dofs%halo%dealt) return
    due = merge(1, 0, row_due)
    call model%ranks%broadcast_numbers(due)
    row_due = due(1) > 0
  end function row_due

  !> Time of the next step, which is the `last` if it reaches the end.
  subroutine next_time(model, t1, last)
    type(fem_model_type), intent(in) :: model
    real(wp), intent(out) :: t1  !! [s]
    logical, intent(out) :: last
    associate (a => model%analysis)
      t1 = real(model%steps + 1, wp)*a%dt
      if (a%variable) t1 = before_output(model, a%next_time(model%body))
      last = t1 >= a%t_end - near*a%dt
      if (last) t1 = a%t_end
    end associate
  end subroutine next_time

  !> A time, or that of the next fields where these come first, or half-way to them where they come
  !! second [s].
  pure real(wp) function before_output(model, t)
    type(fem_model_type), intent(in) :: model
    real(wp), intent(in) :: t
    real(wp) :: due, now
    before_output = t
    if (.not. model%output%every_output > 0.0_wp) return
    due = real(model%output%next_output, wp)*model%output%every_output
    now = model%body%accepted%time
    if (due <= now .or. t + (t - now) <= due) return
    before_output = merge(due, now + 0.5_wp*(due - now), t >= due)
  end function before_output

  !> Iterations of the solver, and new factors of kinds that compute them as needed.
  subroutine log_iterations(model)
    type(fem_model_type), intent(inout) :: model
    if (model%analysis%listed) call log_factors(model)
    if (model%body%system%solver%iterative) call model%log%item('iterations', &
      str(model%body%system%solver%iterations), 'residual '// &
      short_number(model%body%system%solver%residual))
  end subroutine log_iterations

  !> Is the run to stop, or a checkpoint due? The leader decides.
  subroutine check_requests(model, save_now)
    type(fem_model_type), intent(inout) :: model
    logical, intent(out) :: save_now
    integer(i4) :: asked(2)
    asked(1) = model%stop%check()
    save_now = model%stop%checkpoint_asked()
    if (.not. save_now .and. asked(1) == stop_none) &
      save_now = model%checkpoint%due(model%body%accepted%time)
    asked(2) = merge(1, 0, save_now)
    call model%ranks%broadcast_numbers(asked)
    save_now = asked(2) > 0 .and. asked(1) == stop_none
    model%stopped = asked(1) /= stop_none
    if (model%stopped) call model%log%line('stopped by '//model%stop%text())
  end subroutine check_requests

  !> The step again by factors, where iterations were chosen and did not converge.
  subroutine go_direct(model, t1, errors)
    type(fem_model_type), intent(inout) :: model
    real(wp), intent(in) :: t1
    type(error_list_type), intent(inout) :: errors
    call errors%clear()
    call model%body%reject()
    call model%body%system%solver%turn_to_factors()
    call model%body%system%forget_numbers()
    call model%body%system%forget_factors()
    call model%analysis%step(model%body, t1, errors)
  end subroutine go_direct

  subroutine tell_factors(model)
    type(fem_model_type), intent(inout) :: model
    call model%log%warn('the iterations did not converge; factors are made')
    call log_factors(model)
  end subroutine tell_factors

  !> A dynamic body cannot store more than was supplied; the fastest node is named.
  subroutine check_energy(body, errors)
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp) :: stored, most
    integer(i4) :: node
    if (.not. body%scheme%dynamic) return
    associate (e => body%energy)
      stored = e%strain + e%kinetic
      if (body%scheme%explicit) stored = stored + e%numerical
      if (body%pore%unsaturated) stored = stored + e%liquid  ! suction gives what the skeleton takes
      if (stored <= runaway*(e%start + abs(e%load) + abs(e%support) + abs(e%spring)) &
          + round_off*(e%strain + e%kinetic)) return
      node = body%mesh%number_of(int(maxloc(sum(body%state%v**2, 1), 1), i4))
      most = maxval(sum(body%state%v**2, 1))
      if (body%dofs%halo%dealt) call body%dofs%halo%largest(most, node)
      call errors%add('N303', 'runaway energy: '//short_number(stored)// &
        ' J are stored, '//short_number(e%start + e%load + e%support)//' J were put in; node '// &
        str(node)//' is fastest', 'time '//str(body%state%time)//' s', &
        'is beta < gamma/2? Then the step must resolve the highest frequency of the mesh')
    end associate
  end subroutine check_energy
end module fem_run
