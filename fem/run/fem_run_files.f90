!> Log, results and summary of a run: opened once all checks have passed, closed at its end.
module fem_run_files
  use omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type, exit_stopped
  use talus_files, only: make_folder, folder_of
  use talus_health, only: health_type
  use talus_log, only: log_type, short_number
  use talus_summary, only: summary_type
  use fem_consolidation, only: describe_pores
  use fem_judgement, only: judge_health
  use fem_model, only: fem_model_type, program_name
  use fem_output, only: energy_error
  use fem_output_pore, only: balance_error
  implicit none
  private
  public :: open_run, finish_run, log_row, log_factors

contains

  !> Open log and results; the first state of a fresh run is written.
  subroutine open_run(model, errors)
    type(fem_model_type), intent(inout) :: model
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: title
    real(wp) :: mass
    integer(i4) :: k

    call model%stop%read(model%deck, model%served, errors)
    if (errors%any()) return
    call open_log(model, errors)
    if (errors%any()) return
    model%opened = .true.
    call model%deck%get('run', 1, 'title', title)
    call model%log%header(program_name, title, model%options%deck, model%deck%hash(), &
                         model%ranks%ranks, int(omp_get_max_threads(), i4))
    call model%deck%echo(lines)
    call model%log%deck_echo(lines)
    call model%log%section('Model')
    call model%log%item('nodes', str(model%body%mesh%total_nodes()))
    call model%log%item('elements', str(model%body%whole%elements(model%body%mesh%elements)))
    mass = model%body%dofs%halo%total_of(reshape(model%body%system%lumped(: &
      model%body%mesh%nodes), [1_i4, model%body%mesh%nodes]))
    call model%log%item('mass', str(mass)//' kg')
    if (model%start_time >= 0.0_wp) call model%log%item('goes on from', str(model%start_time)//' s')
    call describe_pores(model%body, model%log)
    call model%analysis%describe(model%body, model%log)
    if (model%settled) call model%log%item('settled under the initial stress', &
      short_number(model%settlement)//' m', 'displacements count from there')
    call log_factors(model)
    call model%log%memory()
    do k = 1, size(model%warnings)
      call model%log%warn(model%warnings(k)%s)
    end do
    call row_titles(model%log)
    call model%output%open(model%deck, model%stem, model%body, model%analysis, model%start_time, &
                           errors)
    call model%ranks%agree(errors)
    if (model%start_time < 0.0_wp .and. .not. (model%analysis%listed .or. errors%any())) &
      call model%output%write_due(model%body, model%analysis, .false., errors)
    call model%ranks%agree(errors)
  end subroutine open_run

  !> Lock and log of the leader; the others are silent.
  subroutine open_log(model, errors)
    type(fem_model_type), intent(inout) :: model
    type(error_list_type), intent(inout) :: errors
    if (model%ranks%leads()) then
      call make_folder(folder_of(model%stem), errors)
      if (.not. errors%any()) call model%lock%take(model%stem, program_name, errors)
      if (.not. errors%any()) &
        call model%log%open(model%stem//'.log', errors, append=model%start_time >= 0.0_wp)
    else
      call model%log%open('', errors, screen=.false.)
    end if
    call model%ranks%agree(errors)
  end subroutine open_log

  subroutine row_titles(log)
    type(log_type), intent(inout) :: log
    type(string_type) :: titles(6)
    titles(1)%s = 'time [s]'
    titles(2)%s = 'steps'
    titles(3)%s = 'largest u [m]'
    titles(4)%s = 'strain [J]'
    titles(5)%s = 'kinetic [J]'
    titles(6)%s = 'energy error'
    call log%row_titles(titles)
  end subroutine row_titles

  subroutine log_row(model)
    type(fem_model_type), intent(inout) :: model
    real(wp) :: largest
    model%row_step = model%steps
    largest = sqrt(maxval(sum(model%body%accepted%u(:, :model%body%dofs%solid)**2, 1)))
    call model%body%dofs%halo%highest(largest)
    call model%log%row([model%body%accepted%time, real(model%steps, wp), largest, &
                       model%body%accepted_energy%strain, model%body%accepted_energy%kinetic, &
                       energy_error(model%body)])
  end subroutine log_row

  !> Log the factorisations that are not yet logged.
  subroutine log_factors(model)
    type(fem_model_type), intent(inout) :: model
    real(wp), parameter :: giga = 1.0e9_wp
    associate (solver => model%body%system%solver)
      if (.not. model%opened .or. solver%factorisations <= model%logged_factors) return
      if ((model%body%matter%active .or. model%analysis%listed) .and. &
          model%logged_factors > 0) return  ! one an iteration or a step
      model%logged_factors = solver%factorisations
      if (solver%by_multigrid) then
        call model%log%item('solver', 'multigrid', str(solver%free)// &
          ' free degrees of freedom, '//trim(merge('conjugate gradients', &
          'least residuals    ', solver%multigrid%symmetric)))
        return
      end if
      if (solver%iterative) then
        call model%log%item('solver', 'conjugate gradients', str(solver%free)// &
          ' free degrees of freedom, incomplete factors '// &
          short_number(solver%cg%factors%memory)//' MB, diagonal raised by '// &
          short_number(solver%cg%factors%raise))
        return
      end if
      call model%log%item('factorisation '//str(solver%factorisations), &
                         str(solver%free)//' free degrees of freedom', &
                         short_number(real(solver%mumps%entries, wp))//' entries, '// &
                         short_number(solver%mumps%flops/giga)//' GFlop, METIS order'// &
                         trim(merge(', on disk', '         ', solver%mumps%on_disk)))
    end associate
  end subroutine log_factors

  !> Checkpoint if stopped or asked for, close everything, summary, last line.
  subroutine finish_run(model, exit_code, errors)
    type(fem_model_type), intent(inout) :: model
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: late
    type(summary_type) :: summary
    type(health_type) :: health

    if (model%opened) then
      if (errors%any()) call model%output%write_last(model%body, late)
      if (.not. (model%served .or. errors%any()) .and. (model%stopped .or. keeps_end(model))) &
        call model%save_checkpoint('', errors)
      call model%output%close(errors)
    end if
    call model%ranks%agree(errors)
    if (model%opened) then
      call judge_health(model, health)
      if (.not. (model%stopped .or. errors%any())) call health%complain(model%options%deck, errors)
    end if
    exit_code = errors%exit_code()
    if (exit_code == 0 .and. model%stopped) exit_code = exit_stopped
    if (.not. model%opened) call model%lock%release()
    if (.not. model%opened) return
    if (model%row_step < model%steps) call log_row(model)
    call model%log%health('energy error '//short_number(energy_error(model%body))//', '// &
                         str(model%body%system%solver%factorisations)//' factorisations')
    call health%warn(model%log)
    call tell_leaks(model)
    call model%log%timer_table(model%timers)
    call errors%locate(model%options%deck)
    call model%log%faults(errors)
    call summary%set_program(program_name, model%options%deck, model%deck%hash())
    call summary%set('exit_code', exit_code)
    call summary%set('wall_time_s', model%timers%elapsed())
    call summary%set('steps', model%steps)
    call summary%set('time_s', model%body%accepted%time)
    call health%summarise(summary)
    call summary%set('health.energy_error', energy_error(model%body))
    call summary%set('health.displacement_gradient', model%gradient)
    call summary%set('health.factorisations', model%body%system%solver%factorisations)
    if (model%body%system%solver%iterative) call summary%set('health.iterations', &
      model%body%system%solver%iterations)
    if (model%body%pore%active) then
      call summary%set('health.liquid_balance', balance_error(model%body))
      call summary%set('health.face_leaks', model%body%pore%accepted_books%leaks)
    end if
    call model%analysis%summarise(model%body, summary)
    call summary%set_timers(model%timers)
    call summary%set_errors(errors)
    if (model%ranks%leads()) call summary%write(model%stem//'_summary.json', late)
    call model%log%finish(program_name, exit_code, 'time '// &
                         short_number(model%body%accepted%time)// &
                         ' s, '//str(model%steps)//' steps', model%timers%elapsed())
    call model%log%close()
    call model%lock%release()
  end subroutine finish_run

  !> Warning W434 of nodes that changed sides until they were leaks.
  subroutine tell_leaks(model)
    type(fem_model_type), intent(inout) :: model
    if (.not. model%body%pore%active) return
    if (model%body%pore%accepted_books%leaks == 0) return
    call model%log%warn('W434'//': nodes of &seepage or &infiltration did not come to rest and '// &
      'were leaks of ten times the conductance of an element, '// &
      str(model%body%pore%accepted_books%leaks)//' in all steps together: pressures there are '// &
      'somewhat above those outside')
  end subroutine tell_leaks

  !> Does a run that has come to its end leave a checkpoint, from which another deck may go on?
  logical function keeps_end(model)
    type(fem_model_type), intent(in) :: model
    keeps_end = model%deck%count('checkpoint') > 0 .and. .not. model%analysis%listed
  end function keeps_end
end module fem_run_files
