!> talus-dem as a partner of talus-couple: what each request does to the grains.
!!
!! Files are opened at READY, after all checks; output is written at ACCEPT.
module dem_port
  use omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_name, verb_advance, verb_force, verb_kick_drift, &
    verb_relax, verb_sleep, verb_wake
  use talus_options, only: options_type
  use talus_port_names, only: field_fields, field_ids, field_set, field_step_limit, &
    field_substeps, field_value, field_what, role_name, role_pore, role_surface, &
    what_contact_weight, &
    what_kind, what_mass_factor
  use talus_serve, only: server_type, serve_partner, restart_file, limit_told
  use talus_text, only: str, append_string
  use dem_clock, only: dem_clock_type
  use dem_ledger, only: start_ledger
  use dem_model, only: dem_model_type, program_name
  use dem_system, only: dem_system_type
  use dem_sets, only: dem_sets_type, selection_type
  use dem_parts_forces, only: is_left, slice_of_free, stage_none
  use dem_port_breakage, only: break_accepted
  use dem_port_state, only: reply_hello, reply_describe, reply_selected, put_scalars
  use dem_port_population, only: wake, sleep, relax, set_kinds
  use dem_port_surface, only: select_surface
  use dem_surface_values, only: set_velocities
  use dem_pore_exchange, only: see_ghosts
  use dem_port_pore, only: select_pore, put_pore_sets
  use dem_port_step, only: advance, force, kick_drift, put_sets
  implicit none
  private
  public :: serve

  !> The grains and what the service remembers of them between requests.
  type, extends(server_type) :: dem_server_type
    class(dem_model_type), allocatable :: model
    type(dem_sets_type) :: sets
    type(dem_clock_type) :: kept            !! clock of the last accepted state
    integer(i8) :: late = 0                 !! late rebuilds reported so far
    logical :: held = .false.               !! driven grains and planes are at rest
    real(wp), allocatable :: held_v(:, :), held_omega(:, :)  !! of driven grains [m/s, rad/s]
    real(wp), allocatable :: held_planes(:, :)  !! velocity of the planes [m/s]
    real(wp), allocatable :: held_surfaces(:, :)  !! velocity and spin of surfaces [m/s, rad/s]
    logical :: stale = .false.              !! kinds or masses changed: forces must be rebuilt
    logical :: renewed = .false.            !! the population changed since READY
    real(wp) :: drift = 0.0_wp              !! step that a partner takes with the grains [s]
  contains
    procedure :: read => read_input
    procedure :: hello
    procedure :: describe
    procedure :: choose
    procedure :: set => set_values
    procedure :: ready
    procedure :: move
    procedure :: accept
    procedure :: reject
    procedure :: save
    procedure :: write => write_fields
    procedure :: finish
    procedure :: is_busy
    procedure :: work_on
    procedure :: catch_up
    procedure, private :: refresh
    procedure, private :: hold
    procedure, private :: let_go
    procedure, private :: repopulate
  end type dem_server_type

contains

  !> Serve a partner until STOP, ABORT or its end; exit_code is that of the program.
  subroutine serve(model, options, exit_code, errors)
    class(dem_model_type), allocatable, intent(inout) :: model
    type(options_type), intent(in) :: options
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(dem_server_type) :: server

    call move_alloc(model, server%model)
    server%program = program_name
    call serve_partner(server, options, errors)
    exit_code = server%exit_code
    call move_alloc(server%model, model)
  end subroutine serve

  subroutine read_input(self, options, errors)
    class(dem_server_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    call self%model%read(options, errors)
  end subroutine read_input

  !> Prepare the first state, or restart from a checkpoint, and identify the program.
  subroutine hello(self, restart, reply, errors)
    class(dem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: restart
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: base(:, :)

    associate (model => self%model)
      if (.not. self%greeted) then
        base = base_of(model%system)
        if (len(model%options%restart) == 0) &
          model%options%restart = restart_file(restart, model%stem)
        call model%prepare(errors)
        if (errors%any()) return
        if (.not. allocated(model%system%base)) call move_alloc(base, model%system%base)
        self%late = model%system%health%late_rebuilds
      end if
      call reply_hello(model, reply)
    end associate
  end subroutine hello

  !> Masses and moments of inertia now, (4, grains).
  pure function base_of(system) result(base)
    type(dem_system_type), intent(in) :: system
    real(wp), allocatable :: base(:, :)
    allocate (base(4, system%grains%n))
    base(1, :) = system%grains%mass
    base(2:, :) = system%grains%inertia
  end function base_of

  !> After a change of kinds or masses before the first step: rebuild lists, forces and ledger.
  subroutine refresh(self, errors)
    class(dem_server_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (.not. self%stale) return
    self%stale = .false.
    if (self%model%system%open) then  ! what grains brought along is in the list, not in the packing
      call find_anew(self)
      return
    end if
    call self%model%histories%init(self%model%system)
    call self%model%system%init(errors)
    if (.not. errors%any()) call self%model%load_surface(.true., errors)
  end subroutine refresh

  subroutine describe(self, what, group, reply, errors)
    class(dem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: what, group
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    call self%refresh(errors)
    if (.not. errors%any()) call reply_describe(self%model, what, group, reply, errors)
  end subroutine describe

  subroutine choose(self, request, name, role, ids, reply, errors)
    class(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request
    character(len=*), intent(in) :: name, role
    integer(i8), intent(in) :: ids(:)
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    type(selection_type) :: wish
    logical :: changed
    integer(i4) :: k

    if (role == role_name(role_surface)) then
      call select_surface(self%model, self%sets, request, name, ids, changed, errors)
    else if (role == role_name(role_pore)) then
      changed = .false.
      call select_pore(self%model, self%sets, request, name, ids, errors)
    else
      wish%name = name
      wish%role = role
      wish%fields = ''
      wish%ids = ids
      if (request%has(field_fields)) call request%get_text(field_fields, wish%fields, errors)
      call request%all_read(errors)
      if (errors%any()) return
      call self%sets%select(wish, self%model%system, self%model%clock%steps == 0, changed, errors)
    end if
    if (errors%any()) return
    self%stale = self%stale .or. changed
    call self%refresh(errors)
    if (errors%any()) return
    call see_ghosts(self%model%system%dem_data_type)
    call self%sets%find(name, k, errors)
    call reply_selected(self%model%system, self%sets%set(k), reply)
  end subroutine choose

  !> Contact weights and mass factors.
  subroutine set_values(self, request, reply, errors)
    class(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what

    call request%get_text(field_what, what, errors)
    if (errors%any()) return
    if (what == what_contact_weight) call go_alone(self)
    select case (what)
    case (what_contact_weight)
      call set_weights(self, request, errors)
    case (what_mass_factor)
      call set_mass(self, request, errors)
    case (what_kind)
      call self%repopulate(request, reply, errors)
    case default
      call errors%add('P255', "talus-dem cannot set '"//what//"'", request%place(), &
                      'valid are contact_weight, mass_factor and kind')
    end select
    if (.not. errors%any()) call reply%put(field_step_limit, &
      limit_told(self%model%system%step_limit()))
  end subroutine set_values

  subroutine set_weights(self, request, errors)
    type(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:, :)
    real(wp), allocatable :: value(:)
    logical :: listed

    call request%take_int(field_ids, ids, errors)
    if (errors%any()) return
    allocate (value(size(ids, 2)))
    call request%get(field_value, value, errors)
    call request%all_read(errors)
    if (errors%any()) return
    associate (model => self%model)
      listed = any(value > 0.0_wp)  ! else contacts between ghosts do not count: none are listed
      if (.not. model%system%par%overlapped .or. model%clock%steps == 0 .or. self%renewed) then
        model%system%par%overlapped = .true.
        if (self%renewed) then
          call model%system%change_weights(ids, value, listed)
          call find_anew(self)
          return
        end if
        model%system%par%ghost_pairs = listed
        call model%system%set_weights(ids, value)
        if (model%clock%steps == 0 .and. .not. model%system%open) then
          call model%system%init(errors)
        end if
        if (.not. errors%any()) call model%load_surface(.true., errors)
      else
        call model%system%set_weights(ids, value)
      end if
    end associate
  end subroutine set_weights

  !> WAKE, SLEEP, RELAX, SET kind: afterwards all that is by grain is made anew.
  subroutine repopulate(self, request, reply, errors)
    class(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)

    call self%refresh(errors)
    if (errors%any()) return
    call go_alone(self)
    ids = self%model%system%grains%id
    select case (request%verb)
    case (verb_wake)
      call wake(self%model, request, reply, errors)
    case (verb_sleep)
      call sleep(self%model, request, reply, errors)
    case (verb_relax)
      call relax(self%model, request, reply, errors)
    case default
      call set_kinds(self%model, request, errors)
    end select
    if (errors%any()) return
    self%renewed = .true.
    call self%sets%forget_grains()
    call self%model%system%clear_extra()  ! held for sets that are none now
    call carry_masses(self, ids)
  end subroutine repopulate

  !> Masses without factors of the grains that were there; others have none yet.
  subroutine carry_masses(self, before)
    type(dem_server_type), intent(inout) :: self
    integer(i8), intent(in) :: before(:)  !! ids, rising
    real(wp), allocatable :: base(:, :)
    integer(i4) :: i, j
    base = base_of(self%model%system)
    associate (g => self%model%system%grains)
      j = 1
      do i = 1, g%n
        do while (j < size(before))
          if (before(j) >= g%id(i)) exit
          j = j + 1
        end do
        if (j > size(before)) exit
        if (before(j) == g%id(i)) base(:, i) = self%model%system%base(:, j)
      end do
    end associate
    call move_alloc(base, self%model%system%base)
  end subroutine carry_masses

  !> Masses and moments of inertia of a set, times a factor; only before the first step, after a
  !! change of the population, or the same as they are (after a restart).
  subroutine set_mass(self, request, errors)
    type(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: value(:)
    real(wp), allocatable :: mass(:), inertia(:, :)
    real(wp), parameter :: same = 1.0e-12_wp
    integer(i4) :: k, j, i

    call request%get_text(field_set, name, errors)
    if (errors%any()) return
    call self%sets%find(name, k, errors)
    if (errors%any()) return
    allocate (value(size(self%sets%set(k)%index)))
    call request%get(field_value, value, errors)
    call request%all_read(errors)
    if (errors%any()) return
    associate (index => self%sets%set(k)%index, g => self%model%system%grains, &
               base => self%model%system%base)
      if (all(abs(value - g%mass(index)/base(1, index)) <= same*value)) return
      if ((self%model%clock%steps > 0 .and. .not. self%renewed) .or. &
          .not. all(value > 0.0_wp)) then
        call errors%add('P253', 'mass factors must be positive and be set before the first step', &
                        request%place(), 'send them before READY')
        return
      end if
      mass = g%mass
      inertia = g%inertia
      do j = 1, size(index)
        i = index(j)
        mass(i) = value(j)*base(1, i)
        inertia(:, i) = value(j)*base(2:, i)
      end do
      if (self%renewed) then
        call self%model%system%weigh(mass, inertia)
        return
      end if
      g%mass = mass
      g%inertia = inertia
    end associate
    self%stale = .true.
    call self%refresh(errors)
  end subroutine set_mass

  !> All is set: open the files, keep this state, reply as after a step of no length.
  subroutine ready(self, reply, errors)
    class(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors

    call self%refresh(errors)
    if (errors%any()) return
    if (self%renewed) call find_anew(self)
    self%renewed = .false.
    if (self%rehearsing) then
      call self%hold()
    else
      call self%let_go()
      self%model%histories%open_system = .true.  ! the partner may change the population
      if (self%model%breakage%active()) call self%model%system%be_open()
      if (.not. self%model%opened) call self%model%open(errors)
    end if
    if (errors%any()) return
    associate (system => self%model%system)
      call system%reset_impulses()
      call system%save()
      self%kept = self%model%clock
      call put_sets(system, self%sets, .true., reply)
      call put_pore_sets(self%model, self%sets, 0.0_wp, reply)
      call reply%put_int(field_substeps, 0_i4)
      call put_scalars(system, self%late, reply)
    end associate
  end subroutine ready

  !> Forces of the grains that there are now, with the weights that they have now.
  subroutine find_anew(self)
    type(dem_server_type), intent(inout) :: self
    logical :: none(self%model%system%grains%n)
    none = .false.
    call self%model%system%leave(none)
  end subroutine find_anew

  !> Motion prescribed by the deck is suspended during a rehearsal.
  subroutine hold(self)
    class(dem_server_type), intent(inout) :: self
    real(wp), parameter :: still(3) = 0.0_wp
    real(wp) :: rest(3, size(self%model%histories%index))
    if (self%held) return
    self%held = .true.
    associate (system => self%model%system, driven => self%model%histories%index)
      self%held_v = system%grains%v(:, driven)
      self%held_omega = system%grains%omega(:, driven)
      self%held_planes = system%planes%velocity
      rest = 0.0_wp
      call system%set_velocity(driven, rest, rest)
      system%planes%velocity = 0.0_wp
      if (system%surfaces%n > 0) then
        self%held_surfaces = reshape([system%surfaces%velocity, system%surfaces%spin], &
                                     [3*system%surfaces%n, 2])
        call set_velocities(system%surfaces, spread(still, 2, system%surfaces%n), &
                            spread(still, 2, system%surfaces%n))
      end if
    end associate
  end subroutine hold

  !> After a rehearsal: resume this motion, restart clock and ledger.
  subroutine let_go(self)
    class(dem_server_type), intent(inout) :: self
    if (.not. self%held) return
    self%held = .false.
    associate (model => self%model, system => self%model%system)
      call system%set_velocity(model%histories%index, self%held_v, self%held_omega)
      system%planes%velocity = self%held_planes
      if (system%surfaces%n > 0) then
        call set_velocities(system%surfaces, &
                            reshape(self%held_surfaces(:, 1), [3, system%surfaces%n]), &
                            reshape(self%held_surfaces(:, 2), [3, system%surfaces%n]))
      end if
      call model%clock%start_at(0.0_wp, system%par%dt)
      model%clock%steps = 0
      model%clock%unstable = 0
      call system%reset_impulses()
      call model%histories%init(system)
      call start_ledger(system%dem_data_type, system%par%dt)
      call system%begin_anew()
    end associate
  end subroutine let_go

  !> Forces that nobody waits for yet.
  logical function is_busy(self)
    class(dem_server_type), intent(in) :: self
    is_busy = .false.
    if (allocated(self%model)) is_busy = is_left(self%model%system%dem_data_type)
  end function is_busy

  subroutine work_on(self)
    class(dem_server_type), intent(inout) :: self
    call self%model%timers%start('steps')
    call slice_of_free(self%model%system%dem_data_type)
    call self%model%timers%stop('steps')
  end subroutine work_on

  !> All that nobody waited for until now.
  subroutine catch_up(self)
    class(dem_server_type), intent(inout) :: self
    if (.not. allocated(self%model)) return
    if (self%model%system%parts%stage == stage_none) return
    call self%model%timers%start('steps')
    call self%model%system%free_forces()
    call self%model%timers%stop('steps')
  end subroutine catch_up

  subroutine move(self, request, reply, errors)
    class(dem_server_type), intent(inout) :: self
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    real(wp) :: start  !! of a step of the partner [s]

    if (self%model%pore%active .and. request%verb /= verb_advance) then
      call errors%add('P259', 'a liquid among the grains does not go with '// &
                      verb_name(request%verb), request%place(), &
                      'such grains are moved with ADVANCE alone')
      return
    end if
    if (any(request%verb == [verb_force, verb_kick_drift])) call go_alone(self)
    select case (request%verb)
    case (verb_advance)
      call advance(self%model, self%sets, request, reply, self%late, errors)
    case (verb_force)
      call force(self%model, self%sets, request, reply, self%late, errors)
    case (verb_kick_drift)
      start = self%model%clock%time()
      call kick_drift(self%model, self%sets, request, reply, self%late, errors)
      self%drift = max(self%drift, self%model%clock%time() - start)
    case (verb_wake, verb_sleep, verb_relax)
      call self%repopulate(request, reply, errors)
    case default
      call errors%add('P259', 'talus-dem has no '//verb_name(request%verb), request%place(), &
                      'grains are moved with ADVANCE, or FORCE and KICK_DRIFT')
    end select
  end subroutine move

  !> Many ranks move whole intervals; grains with which a partner steps, or whose contacts it
  !! weighs, the first of them moves alone.
  subroutine go_alone(self)
    type(dem_server_type), intent(inout) :: self
    character(len=:), allocatable :: text
    associate (model => self%model)
      if (.not. model%ranks%several()) return
      if (model%system%rank_team%alone) return
      call model%system%rank_team%go_alone(model%system%dem_data_type)
      text = 'the partner steps with the grains, or weighs their contacts: the first of '// &
        str(model%ranks%ranks)//' ranks moves them all, with '// &
        str(int(omp_get_max_threads(), i4))//' threads'
      if (model%opened) then
        call model%log%warn(text)
      else
        call append_string(model%warnings, text)
      end if
    end associate
  end subroutine go_alone

  !> Keep the step and write what is due.
  subroutine accept(self, errors)
    class(dem_server_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    associate (model => self%model)
      if (.not. self%rehearsing) call model%histories%keep_work(model%system)
      if (.not. self%rehearsing) call break_grains(self, errors)
      call model%timers%start('keeping states')
      if (self%final) then
        call model%system%forget()
      else
        call model%system%save()
      end if
      call model%timers%stop('keeping states')
      if (.not. self%rehearsing) call model%write_due(errors)
      self%kept = model%clock
    end associate
  end subroutine accept

  !> Grains break at the accepted state; masses without factors follow.
  subroutine break_grains(self, errors)
    class(dem_server_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    logical :: changed
    if (.not. self%model%breakage%active() .or. errors%any()) return
    ids = self%model%system%grains%id
    call break_accepted(self%model, self%sets, self%kept, self%drift, changed, errors)
    if (changed .and. .not. errors%any()) call carry_masses(self, ids)
  end subroutine break_grains

  !> Back to the last accepted state.
  subroutine reject(self, errors)
    class(dem_server_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    if (self%final) then
      call errors%add('P260', 'REJECT follows an ACCEPT that was said to be final', &
                      'exchange port', 'leave `final` out of ACCEPT where steps are tried')
      return
    end if
    call self%model%system%restore()
    self%model%clock = self%kept
  end subroutine reject

  subroutine save(self, tag, path, errors)
    class(dem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    character(len=:), allocatable, intent(out) :: path
    type(error_list_type), intent(inout) :: errors
    call self%model%save_checkpoint(tag, errors)
    path = self%model%checkpoint%tag_path(tag)
  end subroutine save

  !> Fields and histories now; no path when the deck has no &output.
  subroutine write_fields(self, tag, path, errors)
    class(dem_server_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    character(len=:), allocatable, intent(out) :: path
    type(error_list_type), intent(inout) :: errors
    associate (model => self%model)
      call model%histories%flush(errors)
      call model%fields%write(model%clock%time(), model%system, errors)
      path = ''
      if (model%fields%opened) path = model%stem//'.h5'
    end associate
  end subroutine write_fields

  subroutine finish(self, regular, early, errors)
    class(dem_server_type), intent(inout) :: self
    logical, intent(in) :: regular, early
    type(error_list_type), intent(inout) :: errors
    self%model%stopped = early
    call self%model%finish(self%exit_code, errors)
  end subroutine finish
end module dem_port
