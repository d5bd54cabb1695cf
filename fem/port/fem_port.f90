!> talus-fem as a partner of talus-couple: the effect of each request on the solid. All ranks do the
!! same, each with its elements; vectors of nodes are complete on all.
!!
!! Files are opened at READY, once all checks have passed; output is written at ACCEPT.
module fem_port
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_name, verb_solve, verb_advance, verb_force, &
    verb_kick_drift
  use talus_options, only: options_type
  use talus_port_names, only: field_fields, field_held, field_held_phi, field_inertia, &
    field_iterations, field_mass, field_speed, field_speed_phi, field_step_limit, &
    field_stiffness, field_stiffness_phi, role_name, role_pore
  use talus_serve, only: server_type, serve_partner, restart_file, limit_told
  use fem_model, only: fem_model_type, program_name
  use fem_run_files, only: open_run, finish_run, log_row, log_factors
  use fem_sets, only: fem_sets_type
  use fem_port_describe, only: reply_describe
  use fem_port_state, only: reply_hello, set_matter => set_values, put_scalars
  use fem_port_step, only: solve, advance, force, kick_drift
  use fem_sparse, only: block_diagonal
  implicit none
  private
  public :: serve

  !> The solid and the sets that the partner has selected.
  type, extends(server_type) :: fem_server_type
    logical :: rehearsed = .false.            !! since the last READY that counts
    real(wp) :: true_time = 0.0_wp            !! s, of the state before the rehearsal
    class(fem_model_type), allocatable :: model
    type(fem_sets_type) :: sets
  contains
    procedure :: read => read_input
    procedure :: hello
    procedure :: describe
    procedure :: choose
    procedure :: set => set_values
    procedure :: ready
    procedure :: move
    procedure :: hear_accept
    procedure :: accept
    procedure :: reject
    procedure :: save
    procedure :: write => write_fields
    procedure :: finish
  end type fem_server_type

contains

  !> Serve a partner until STOP, ABORT or its end; exit_code is that of the program.
  subroutine serve(model, options, exit_code, errors)
    class(fem_model_type), allocatable, intent(inout) :: model
    type(options_type), intent(in) :: options
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    class(fem_server_type), allocatable :: server

    allocate (server)
    call move_alloc(model, server%model)
    server%team = server%model%ranks
    server%program = program_name
    call serve_partner(server, options, errors)
    exit_code = server%exit_code
    call move_alloc(server%model, model)
  end subroutine serve

  subroutine read_input(self, options, errors)
    class(fem_server_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    call self%model%read(options, errors)
  end subroutine read_input

  !> Matrices, or the state of a checkpoint, and the reply to HELLO.
  subroutine hello(self, restart, reply, errors)
    class(fem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: restart
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors

    if (.not. self%greeted) then
      if (len(self%model%options%restart) == 0) &
        self%model%options%restart = restart_file(restart, self%model%stem)
      call self%model%prepare(errors)
      if (errors%any()) return
    end if
    call reply_hello(self%model, reply)
  end subroutine hello

  subroutine describe(self, what, group, reply, errors)
    class(fem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: what, group
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    call reply_describe(self%model%body, what, group, reply, errors)
  end subroutine describe

  subroutine choose(self, request, name, role, ids, reply, errors)
    class(fem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request
    character(len=*), intent(in) :: name, role
    integer(i8), intent(in) :: ids(:)
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fields
    real(wp), allocatable :: diagonal(:)
    integer(i4) :: k
    logical :: changed

    fields = ''
    if (request%has(field_fields)) call request%get_text(field_fields, fields, errors)
    call request%all_read(errors)
    if (errors%any()) return
    associate (body => self%model%body)
      call self%sets%select(name, role, fields, ids, body, changed, errors)
      if (errors%any() .or. role == role_name(role_pore)) return
      if (changed) then
        call body%system%forget_factors()
        call body%system%forget_numbers()
      end if
      if (body%matter%active) call body%assemble_tangent()
      diagonal = block_diagonal(body%system%pattern, body%system%k)
      call reply%put(field_mass, body%system%lumped(ids))
      call reply%put(field_speed, body%state%v(:, ids))
      call reply%put_int(field_held, merge(1_i4, 0_i4, body%supports%held(:, ids)))
      call reply%put(field_stiffness, diagonal(ids))
      if (index(','//fields//',', ',phi,') > 0) then
        call self%sets%find(name, k)
        associate (phi => self%sets%set(k)%phi)
          call reply%put(field_inertia, body%system%lumped(phi))
          call reply%put(field_speed_phi, body%state%v(:, phi))
          call reply%put_int(field_held_phi, merge(1_i4, 0_i4, body%supports%held(:, phi)))
          call reply%put(field_stiffness_phi, diagonal(phi))
        end associate
      end if
    end associate
  end subroutine choose

  subroutine set_values(self, request, reply, errors)
    class(fem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    call set_matter(self%model%body, self%sets, request, errors)
    call self%sets%forget_elements()
    if (.not. errors%any()) call request%all_read(errors)
    if (.not. errors%any()) call reply%put(field_step_limit, &
      limit_told(self%model%body%limit%step))
  end subroutine set_values

  !> All is set: factors, files, and a reply as after a step of no length. A rehearsal writes no
  !! file, and its steps factor on demand.
  subroutine ready(self, reply, errors)
    class(fem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors

    associate (model => self%model)
      if (self%rehearsing) then
        if (.not. self%rehearsed) self%true_time = model%body%accepted%time
        self%rehearsed = .true.
        call model%look_at_supports(errors)
      else
        if (self%rehearsed) model%body%state%time = self%true_time
        self%rehearsed = .false.
        call model%begin(errors)
      end if
      if (errors%any()) return
      if (.not. (model%opened .or. self%rehearsing)) call open_run(model, errors)
      if (errors%any()) return
      call model%body%accept()
      self%sets%begun = .not. self%rehearsing
      call self%sets%put_states(model%body, reply)
      call reply%put_int(field_iterations, 0_i4)
      call put_scalars(model%body, reply)
    end associate
  end subroutine ready

  subroutine move(self, request, reply, errors)
    class(fem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors

    call self%model%timers%start('steps')
    select case (request%verb)
    case (verb_solve)
      call solve(self%model, self%sets, request, reply, errors)
    case (verb_advance)
      call advance(self%model, self%sets, request, reply, errors)
    case (verb_force)
      call force(self%model, self%sets, request, reply, errors)
    case (verb_kick_drift)
      call kick_drift(self%model, self%sets, request, reply, errors)
    case default
      call errors%add('P301', 'talus-fem does not answer '//verb_name(request%verb), &
                      request%place(), 'HELLO lists its capabilities')
    end select
    call self%model%timers%stop('steps')
    call log_factors(self%model)
  end subroutine move

  !> Velocities of prescribed nodes, for what is written next.
  subroutine hear_accept(self, request, errors)
    class(fem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    call self%sets%take_speeds(self%model%body, request, errors)
  end subroutine hear_accept

  !> The trial becomes the state and is written if due.
  subroutine accept(self, errors)
    class(fem_server_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    associate (model => self%model)
      call model%analysis%accept(model%body)
      if (self%rehearsing) return
      model%steps = model%steps + 1
      call model%timers%start('output')
      call model%output%write_due(model%body, model%analysis, .false., errors)
      if (model%log%row_due()) call log_row(model)
      call model%timers%stop('output')
    end associate
  end subroutine accept

  subroutine reject(self, errors)
    class(fem_server_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (.not. errors%any()) call self%model%analysis%reject(self%model%body)
  end subroutine reject

  subroutine save(self, tag, path, errors)
    class(fem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    character(len=:), allocatable, intent(out) :: path
    type(error_list_type), intent(inout) :: errors
    call self%model%save_checkpoint(tag, errors)
    path = ''
    if (self%model%ranks%leads()) path = self%model%checkpoint%tag_path(tag)
  end subroutine save

  !> Fields now; no path when the deck has no &output.
  subroutine write_fields(self, tag, path, errors)
    class(fem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    character(len=:), allocatable, intent(out) :: path
    type(error_list_type), intent(inout) :: errors
    path = ''
    if (.not. self%model%output%every_output > 0.0_wp) return
    call self%model%output%write_fields(self%model%body, errors)
    path = self%model%stem//'.h5'
  end subroutine write_fields

  subroutine finish(self, regular, early, errors)
    class(fem_server_type), intent(inout) :: self
    logical, intent(in) :: regular, early
    type(error_list_type), intent(inout) :: errors
    associate (model => self%model)
      model%stopped = early
      if (regular .and. model%opened .and. .not. errors%any()) &
        call model%output%write_due(model%body, model%analysis, .true., errors)
      call finish_run(model, self%exit_code, errors)
    end associate
  end subroutine finish
end module fem_port
