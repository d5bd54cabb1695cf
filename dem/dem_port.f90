!> talus-dem as a partner of talus-couple: requests come in at the port, replies go out.
!!
!! A fault of a request is told in its reply and the service goes on: what to do is the partner's
!! decision. Files are opened at READY, when all is found good; output is written at ACCEPT.
module dem_port
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type, exit_stopped
  use talus_files, only: file_exists
  use talus_hash, only: hash_file
  use talus_message, only: message_type, protocol_version, verb_name, verb_hello, verb_describe, &
    verb_select, verb_set, verb_ready, verb_advance, verb_solve, verb_force, verb_kick_drift, &
    verb_accept, verb_reject, verb_checkpoint, verb_write, verb_stop, verb_abort
  use talus_options, only: options_type
  use talus_port, only: port_type
  use talus_system, only: install_signals
  use dem_clock, only: dem_clock_type
  use dem_model, only: dem_model_type
  use dem_sets, only: dem_sets_type
  use dem_port_state, only: reply_hello, reply_describe, reply_selected, put_scalars
  use dem_port_step, only: advance, force, kick_drift, put_sets
  implicit none
  private
  public :: serve

  !> What the service remembers between requests.
  type :: service_type
    type(dem_sets_type) :: sets
    type(dem_clock_type) :: kept            !! clock of the last accepted state
    real(wp), allocatable :: base_mass(:)   !! of the packing, before factors [kg]
    real(wp), allocatable :: base_inertia(:, :)  !! [kg m^2]
    real(wp), allocatable :: factor(:)      !! mass factors set through the port [-]
    integer(i8) :: late = 0                 !! late rebuilds told so far
    logical :: greeted = .false.            !! HELLO was answered
    logical :: stale = .false.              !! kinds or masses changed: forces must be made anew
    logical :: leave = .false.              !! STOP or ABORT came
  end type service_type

contains

  !> Serve a partner until STOP, ABORT or its end; exit_code is that of the program.
  subroutine serve(model, options, exit_code, errors)
    type(dem_model_type), intent(inout) :: model
    type(options_type), intent(in) :: options
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(port_type) :: port
    type(message_type) :: request, reply
    type(service_type) :: service
    type(error_list_type) :: faults, fatal

    call install_signals(.false.)
    call port%connect(options%port, errors)
    if (errors%any()) then
      exit_code = errors%exit_code()
      return
    end if
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
      if (.not. fatal%any() .and. faults%exit_code() == 2) call fatal%take(faults)
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
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    integer(i4), intent(inout) :: exit_code
    type(error_list_type), intent(inout) :: fatal   !! faults that end the run
    type(error_list_type), intent(inout) :: errors  !! faults of this request

    if (.not. service%greeted .and. request%verb /= verb_hello .and. &
        .not. leaving(request%verb)) then
      call errors%add('P258', verb_name(request%verb)//' came before HELLO', request%place(), &
                      'HELLO is the first request')
      return
    end if
    select case (request%verb)
    case (verb_hello)
      call hello(model, service, request, reply, fatal, errors)
    case (verb_describe)
      call describe(model, service, request, reply, errors)
    case (verb_select)
      call select_set(model, service, request, reply, errors)
    case (verb_set)
      call set_values(model, service, request, reply, errors)
    case (verb_ready)
      call ready(model, service, request, reply, errors)
    case (verb_advance, verb_force, verb_kick_drift)
      call move(model, service, request, reply, errors)
    case (verb_accept, verb_reject)
      call judge(model, service, request, errors)
    case (verb_checkpoint, verb_write)
      call write_files(model, request, reply, errors)
    case (verb_stop, verb_abort)
      call leave(model, service, request, exit_code, fatal, errors)
    case default
      call errors%add('P259', 'talus-dem has no '//verb_name(request%verb), request%place(), &
                      'grains are moved with ADVANCE, or FORCE and KICK_DRIFT')
    end select
  end subroutine handle

  !> Prepare the first state, or go on from a checkpoint, and say who we are.
  subroutine hello(model, service, request, reply, fatal, errors)
    type(dem_model_type), intent(inout) :: model
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
      call errors%add('P005', 'the partner speaks another protocol than talus-dem', &
                      request%place(), 'use programs of the same version')
      return
    end if
    if (.not. service%greeted) then
      service%base_mass = model%system%grains%mass
      service%base_inertia = model%system%grains%inertia
      allocate (service%factor(model%system%grains%n), source=1.0_wp)
      if (len(restart) > 0 .and. len(model%options%restart) == 0) then
        model%options%restart = restart
        if (.not. file_exists(restart) .and. restart /= 'auto') &
          model%options%restart = model%stem//'.'//restart//'.chk.h5'
      end if
      call model%prepare(fatal)
      call errors%take(fatal)
      if (errors%any()) return
      service%factor = model%system%grains%mass/service%base_mass
      service%late = model%system%health%late_rebuilds
    end if
    service%greeted = .true.
    call reply_hello(model, reply)
  end subroutine hello

  !> After a change of kinds or masses before the first step: lists, forces and ledger anew.
  subroutine refresh(model, service, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(error_list_type), intent(inout) :: errors
    if (.not. service%stale) return
    service%stale = .false.
    call model%histories%init(model%system)
    call model%system%init(errors)
  end subroutine refresh

  subroutine describe(model, service, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what, group

    group = ''
    call request%get_text('what', what, errors)
    if (request%has('group')) call request%get_text('group', group, errors)
    call request%all_read(errors)
    call refresh(model, service, errors)
    if (.not. errors%any()) call reply_describe(model, what, group, reply, errors)
  end subroutine describe

  subroutine select_set(model, service, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, role, fields
    integer(i8), allocatable :: ids(:)
    logical :: changed
    integer(i4) :: k

    fields = ''
    call request%get_text('set', name, errors)
    call request%get_text('role', role, errors)
    call request%take_int('id', ids, errors)
    if (request%has('fields')) call request%get_text('fields', fields, errors)
    call request%all_read(errors)
    if (errors%any()) return
    call service%sets%select(name, role, ids, fields, model%system, model%clock%steps == 0, &
                             changed, errors)
    if (errors%any()) return
    service%stale = service%stale .or. changed
    call refresh(model, service, errors)
    if (errors%any()) return
    call service%sets%find(name, k, errors)
    call reply_selected(model%system, service%sets%set(k), reply)
  end subroutine select_set

  !> Contact weights and mass factors.
  subroutine set_values(model, service, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    integer(i8), allocatable :: ids(:, :)
    real(wp), allocatable :: value(:)

    call request%get_text('what', what, errors)
    if (errors%any()) return
    select case (what)
    case ('contact_weight')
      call request%take_int('ids', ids, errors)
      allocate (value(size(ids, 2)))
      call request%get('value', value, errors)
      call request%all_read(errors)
      if (errors%any()) return
      if (.not. model%system%par%ghost_pairs .or. model%clock%steps == 0) then
        model%system%par%ghost_pairs = .true.
        call model%system%set_weights(ids, value)
        if (model%clock%steps == 0) call model%system%init(errors)
      else
        call model%system%set_weights(ids, value)
      end if
    case ('mass_factor')
      call set_mass(model, service, request, errors)
    case default
      call errors%add('P255', "talus-dem cannot set '"//what//"'", request%place(), &
                      'it knows contact_weight and mass_factor')
    end select
    if (.not. errors%any()) call reply%put('step_limit', model%system%step_limit())
  end subroutine set_values

  !> Masses and moments of inertia of a set, times a factor; only before the first step, or the
  !! same as they are (after a restart).
  subroutine set_mass(model, service, request, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: value(:)
    real(wp), parameter :: same = 1.0e-12_wp
    integer(i4) :: k, j, i

    call request%get_text('set', name, errors)
    if (errors%any()) return
    call service%sets%find(name, k, errors)
    if (errors%any()) return
    allocate (value(size(service%sets%set(k)%index)))
    call request%get('value', value, errors)
    call request%all_read(errors)
    if (errors%any()) return
    associate (index => service%sets%set(k)%index, g => model%system%grains)
      if (all(abs(value - service%factor(index)) <= same*value)) return
      if (model%clock%steps > 0 .or. .not. all(value > 0.0_wp)) then
        call errors%add('P253', 'mass factors must be positive and be set before the first step', &
                        request%place(), 'send them before READY')
        return
      end if
      do j = 1, size(index)
        i = index(j)
        service%factor(i) = value(j)
        g%mass(i) = value(j)*service%base_mass(i)
        g%inertia(:, i) = value(j)*service%base_inertia(:, i)
      end do
    end associate
    service%stale = .true.
    call refresh(model, service, errors)
  end subroutine set_mass

  !> All is set: open the files, keep this state, reply as after a step of no length.
  subroutine ready(model, service, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors

    call request%all_read(errors)
    call refresh(model, service, errors)
    if (errors%any()) return
    if (.not. model%opened) call model%open(errors)
    if (errors%any()) return
    call model%system%reset_impulses()
    call model%system%save()
    service%kept = model%clock
    call put_sets(model%system, service%sets, .true., reply)
    call reply%put_int('substeps', 0_i4)
    call put_scalars(model%system, service%late, reply)
  end subroutine ready

  subroutine move(model, service, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors

    if (.not. model%opened) then
      call errors%add('P258', verb_name(request%verb)//' came before READY', request%place(), &
                      'READY comes before all steps')
    else if (request%verb == verb_advance) then
      call advance(model, service%sets, request, reply, service%late, errors)
    else if (request%verb == verb_force) then
      call force(model, service%sets, request, reply, service%late, errors)
    else
      call kick_drift(model, service%sets, request, reply, service%late, errors)
    end if
  end subroutine move

  !> ACCEPT keeps the step and writes what is due; REJECT goes back to the last accepted state.
  subroutine judge(model, service, request, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors

    call request%all_read(errors)
    if (errors%any()) return
    if (.not. model%opened) then
      call errors%add('P258', verb_name(request%verb)//' came before READY', request%place(), &
                      'READY comes before all steps')
    else if (request%verb == verb_reject) then
      call model%system%restore()
      model%clock = service%kept
    else
      call model%histories%keep_work(model%system)
      call model%timers%start('keeping states')
      call model%system%save()
      call model%timers%stop('keeping states')
      call model%write_due(errors)
      service%kept = model%clock
    end if
  end subroutine judge

  !> CHECKPOINT and WRITE at the accepted state; they reply with the file's path.
  subroutine write_files(model, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: tag, path
    character(len=16) :: hash
    integer(i4) :: status

    tag = ''
    if (request%has('tag')) call request%get_text('tag', tag, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (request%verb == verb_checkpoint) then
      call model%save_checkpoint(tag, errors)
      path = model%checkpoint%tag_path(tag)
      if (errors%any()) return
      call hash_file(path, hash, status)
      call reply%put_text('hash', hash)
    else
      call model%histories%flush(errors)
      call model%fields%write(model%clock%time(), model%system, errors)
      path = ''
      if (model%fields%opened) path = model%stem//'.h5'
    end if
    call reply%put_text('path', path)
  end subroutine write_files

  !> STOP: the normal end, with early = 1 the one on request. ABORT: leave at once.
  subroutine leave(model, service, request, exit_code, fatal, errors)
    type(dem_model_type), intent(inout) :: model
    type(service_type), intent(inout) :: service
    type(message_type), intent(inout) :: request
    integer(i4), intent(inout) :: exit_code
    type(error_list_type), intent(inout) :: fatal, errors
    integer(i4) :: early

    service%leave = .true.
    early = 0
    if (request%has('early')) call request%get_int('early', early, errors)
    if (request%verb == verb_abort .and. .not. fatal%any()) &
      call fatal%add('P260', 'talus-couple has ended this run', request%place(), &
                     'the reason stands in the log of the coupled run')
    model%stopped = early == 1
    call model%finish(exit_code, fatal)
    if (request%verb == verb_stop) call errors%take(fatal)
  end subroutine leave
end module dem_port
