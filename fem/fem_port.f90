!> talus-fem as a partner of talus-couple: requests come in at the port, replies go out.
!!
!! A fault of a request is told in its reply and the service goes on: what to do is the partner's
!! decision. Files are opened at READY, when all is found good; output is written at ACCEPT.
module fem_port
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type, exit_stopped, exit_numerical
  use talus_files, only: file_exists
  use talus_hash, only: hash_file
  use talus_message, only: message_type, protocol_version, verb_name, verb_hello, verb_describe, &
    verb_select, verb_set, verb_ready, verb_advance, verb_solve, verb_force, verb_kick_drift, &
    verb_accept, verb_reject, verb_checkpoint, verb_write, verb_stop, verb_abort
  use talus_options, only: options_type
  use talus_port, only: port_type
  use talus_system, only: install_signals
  use fem_types, only: role_prescribe
  use fem_model, only: fem_model_type
  use fem_sets, only: fem_sets_type
  use fem_port_state, only: reply_hello, reply_describe, set_values, put_scalars
  use fem_port_step, only: solve, advance, force, kick_drift
  use fem_sparse, only: block_diagonal
  implicit none
  private
  public :: serve

  type :: service_type
    type(fem_sets_type) :: sets
    logical :: greeted = .false., ready = .false., leave = .false.
  end type service_type

contains

  !> Serve a partner until STOP, ABORT or its end; exit_code is that of the program.
  subroutine serve(model, options, exit_code, errors)
    type(fem_model_type), intent(inout) :: model
    type(options_type), intent(in) :: options
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(port_type) :: port
    type(message_type) :: request, reply
    type(service_type) :: service
    type(error_list_type) :: faults, fatal

    call install_signals(.false.)
    call port%connect(options%port, errors)
    exit_code = errors%exit_code()
    if (errors%any()) return
    call model%read(options, fatal)
    do while (.not. service%leave)
      call port%receive(request, errors)
      if (errors%any()) exit
      call reply%answer(request)
      call faults%clear()
      if (fatal%any() .and. .not. leaving(request%verb)) then
        call faults%take(fatal)
      else
        call handle(model, service, request, reply, exit_code, fatal, faults)
      end if
      if (faults%any()) call reply%fail_with(faults)
      if (.not. fatal%any() .and. faults%exit_code() == exit_numerical) call fatal%take(faults)
      if (.not. service%leave) call port%beat()
      call port%send(reply, errors)
      if (errors%any() .or. (fatal%any() .and. .not. service%greeted)) exit
    end do
    if (.not. service%leave) then
      call errors%take(fatal)
      call model%finish(exit_code, errors)
      if (errors%any()) exit_code = errors%exit_code()
    else
      call errors%take(fatal)
    end if
    call port%close()
  end subroutine serve

  pure logical function leaving(verb)
    integer(i4), intent(in) :: verb
    leaving = verb == verb_stop .or. verb == verb_abort
  end function leaving

  !> Answer one request.
  subroutine handle(model, service, request, reply, exit_code, fatal, errors)
    type(fem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    integer(i4), intent(inout) :: exit_code
    type(error_list_type), intent(inout) :: fatal   !! faults that end the run
    type(error_list_type), intent(inout) :: errors  !! faults of this request

    if (.not. service%greeted .and. request%verb /= verb_hello &
      .and. .not. leaving(request%verb)) then
      call errors%add('P303', verb_name(request%verb)//' came before HELLO', request%place(), &
                      'HELLO is the first request')
      return
    end if
    select case (request%verb)
    case (verb_hello)
      call hello(model, service, request, reply, fatal, errors)
    case (verb_describe)
      call describe(model, request, reply, errors)
    case (verb_select)
      call select_set(model, service, request, reply, errors)
    case (verb_set)
      call set_values(model%body, service%sets, request, errors)
      if (.not. errors%any()) call request%all_read(errors)
      if (.not. errors%any()) call reply%put('step_limit', huge(1.0_wp))
    case (verb_ready)
      call ready(model, service, request, reply, errors)
    case (verb_solve, verb_advance, verb_force, verb_kick_drift)
      call move(model, service, request, reply, errors)
    case (verb_accept, verb_reject)
      call judge(model, request, errors)
    case (verb_checkpoint, verb_write)
      call write_files(model, request, reply, errors)
    case default
      call leave(model, service, request, exit_code, fatal, errors)
    end select
  end subroutine handle

  !> Matrices, or the state of a checkpoint, and who we are.
  subroutine hello(model, service, request, reply, fatal, errors)
    type(fem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: fatal, errors
    character(len=:), allocatable :: run_id, restart
    integer(i4) :: protocol

    protocol = 0
    call request%get_text('run_id', run_id, errors)
    call request%get_text('restart', restart, errors)
    call request%get_int('protocol', protocol, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (protocol /= protocol_version) then
      call errors%add('P005', 'the partner speaks another protocol than talus-fem', &
        request%place(), &
                      'use programs of the same version')
      return
    end if
    if (.not. service%greeted) then
      if (len(restart) > 0 .and. len(model%options%restart) == 0) then
        model%options%restart = restart
        if (.not. file_exists(restart) .and. restart /= 'auto') &
          model%options%restart = model%stem//'.'//restart//'.chk.h5'
      end if
      call model%prepare(fatal)
      call errors%take(fatal)
      if (errors%any()) return
    end if
    service%greeted = .true.
    call reply_hello(model, reply)
  end subroutine hello

  subroutine describe(model, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what, group

    group = ''
    call request%get_text('what', what, errors)
    if (request%has('group')) call request%get_text('group', group, errors)
    call request%all_read(errors)
    if (.not. errors%any()) call reply_describe(model%body, what, group, reply, errors)
  end subroutine describe

  subroutine select_set(model, service, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, role, fields
    integer(i8), allocatable :: ids(:)
    real(wp), allocatable :: diagonal(:)
    logical :: changed

    fields = ''
    call request%get_text('set', name, errors)
    call request%get_text('role', role, errors)
    call request%take_int('id', ids, errors)
    if (request%has('fields')) call request%get_text('fields', fields, errors)
    call request%all_read(errors)
    if (errors%any()) return
    call service%sets%select(name, role, ids, model%body, changed, errors)
    if (errors%any()) return
    if (changed) then
      model%body%factored_dt = -1.0_wp
      model%body%fresh_numbering = .false.
    end if
    diagonal = block_diagonal(model%body%pattern, model%body%k)
    call reply%put('mass', model%body%lumped(ids))
    call reply%put('stiffness', diagonal(ids))
  end subroutine select_set

  !> All is set: factors, files, and a reply as after a step of no length.
  subroutine ready(model, service, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors

    call request%all_read(errors)
    if (errors%any()) return
    call model%begin(model%dt, errors)
    if (errors%any()) return
    if (.not. model%opened) call model%open(errors)
    if (errors%any()) return
    service%ready = .true.
    call model%body%accept()
    call service%sets%put_states(model%body, reply)
    call reply%put_int('iterations', 0_i4)
    call put_scalars(model%body, reply)
  end subroutine ready

  subroutine move(model, service, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors

    if (.not. service%ready) then
      call errors%add('P303', verb_name(request%verb)//' came before READY', request%place(), &
                      'READY comes before all steps')
      return
    end if
    call model%timers%start('steps')
    select case (request%verb)
    case (verb_solve)
      call solve(model, service%sets, request, reply, errors)
    case (verb_advance)
      call advance(model, service%sets, request, reply, errors)
    case (verb_force)
      call force(model, service%sets, request, reply, errors)
    case default
      call kick_drift(model, service%sets, request, reply, errors)
    end select
    call model%timers%stop('steps')
    call model%log_factors()
  end subroutine move

  !> ACCEPT: the trial becomes the state and is written if due; REJECT: back.
  subroutine judge(model, request, errors)
    type(fem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors

    call request%all_read(errors)
    if (errors%any()) return
    if (request%verb == verb_reject) then
      call model%body%reject()
      return
    end if
    call model%body%accept()
    model%steps = model%steps + 1
    if (.not. model%opened) return
    call model%timers%start('output')
    call model%output%write_due(model%body, .false., errors)
    if (model%log%row_due()) call model%log_row()
    call model%timers%stop('output')
  end subroutine judge

  !> CHECKPOINT and WRITE.
  subroutine write_files(model, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: tag, path
    character(len=16) :: hash
    integer(i4) :: status

    call request%get_text('tag', tag, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (request%verb == verb_write) then
      if (model%output%every_output > 0.0_wp) call model%output%write_fields(model%body, errors)
      call reply%put_text('path', model%stem//'.h5')
      return
    end if
    call model%save_checkpoint(tag, errors)
    if (errors%any()) return
    path = model%checkpoint%tag_path(tag)
    call hash_file(path, hash, status)
    call reply%put_text('path', path)
    call reply%put_text('hash', hash)
  end subroutine write_files

  !> STOP: last state, summary; ABORT: leave at once.
  subroutine leave(model, service, request, exit_code, fatal, errors)
    type(fem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request
    integer(i4), intent(inout) :: exit_code
    type(error_list_type), intent(inout) :: fatal, errors
    integer(i4) :: early

    service%leave = .true.
    early = 0
    if (request%has('early')) call request%get_int('early', early, errors)
    model%stopped = early == 1 .or. request%verb == verb_abort
    if (request%verb == verb_stop .and. model%opened .and. .not. fatal%any()) &
      call model%output%write_due(model%body, .true., errors)
    call fatal%take(errors)
    call model%finish(exit_code, fatal)
    if (request%verb == verb_abort .and. exit_code == 0) exit_code = exit_stopped
  end subroutine leave
end module fem_port
