!> Verbs of the port in which grains move: ADVANCE, FORCE, KICK_DRIFT, and what they reply.
module dem_port_step
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_force, dot_impulse, dot_load, dot_mean_force, dot_mean_moment, &
    dot_moment, dot_moment_impulse, dot_omega, dot_quat, dot_theta, dot_v, dot_work, dot_x, &
    field_ahead, field_border_old, field_drift, field_force, field_impulse, field_kick, &
    field_load, field_moment, field_moment_impulse, field_omega, field_quat, field_scope, &
    field_substeps, field_theta, field_v, field_work, field_x, scope_all, scope_between, &
    scope_interface, scope_split
  use talus_serve, only: take_brief, take_flag
  use dem_system, only: dem_system_type
  use dem_model, only: dem_model_type
  use dem_parts, only: border_is_old, check_border
  use dem_passages, only: name_passage
  use dem_parts_forces, only: begin_ahead, forces_on_rim, stage_reported
  use dem_sets, only: dem_sets_type, dem_set_type, role_prescribe, role_load, role_report, &
    role_surface, role_border, role_pore
  use dem_port_pore, only: fit_exchanges, put_pore_sets, take_side_motion, wet_steps
  use dem_port_surface, only: take_vertices, place_vertices, put_vertices
  use dem_port_state, only: put_scalars
  implicit none
  private
  public :: advance, force, kick_drift, put_sets

  real(wp), parameter :: round_off = 1.0e-9_wp  !! relative, for times of both sides

  real(wp), parameter :: far = 1.0e6_wp  !! [m] where no grain is
  integer(i8), parameter :: review = 100  !! steps from one check of a fixed step to the next

contains

  !> Own sub-steps to t1: prescribed grains go there in a straight line, loads are held.
  subroutine advance(model, sets, request, reply, late, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request, reply
    integer(i8), intent(inout) :: late
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, substeps

    call check_start(model, request, errors)
    call count_substeps(model, request%t1, substeps, errors)
    if (errors%any()) return
    do k = 1, sets%count
      if (sets%set(k)%role == role_prescribe) &
        call take_motion(model%system, sets%set(k), request, substeps, errors)
      if (sets%set(k)%role == role_load) call take_load(model%system, sets%set(k), request, errors)
      if (sets%set(k)%role == role_surface) &
        call take_vertices(model%system, sets%set(k), request, &
                           substeps*model%system%par%dt, errors)
      if (sets%set(k)%role == role_pore) &
        call take_side_motion(model, sets%set(k), request, errors)
    end do
    call request%all_read(errors)
    if (errors%any()) return
    call model%load_surface(.false., errors)
    if (errors%any()) return
    call model%system%reset_impulses()
    call model%timers%start('steps')
    if (model%pore%active) then
      call wet_steps(model, request%t1, substeps, errors)
    else
      call model%system%step(substeps, errors)
    end if
    call model%timers%stop('steps')
    call model%clock%jump(request%t1, substeps)
    if (errors%any()) return
    call model%system%gather()
    call put_sets(model%system, sets, .true., reply)
    call put_pore_sets(model, sets, substeps*model%system%par%dt, reply)
    call reply%put_int(field_substeps, substeps)
    call put_scalars(model%system, late, reply)
  end subroutine advance

  !> The partner's interval must begin at the time of the grains (P256).
  subroutine check_start(model, request, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(in) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp) :: now, slack
    now = model%clock%time()
    slack = round_off*max(abs(now), request%t1 - request%t0)
    if (abs(request%t0 - now) <= slack .and. request%t1 > request%t0) return
    call errors%add('P256', 'an interval from '//str(request%t0)//' s to '//str(request%t1)// &
                    ' s was requested, the grains are at '//str(now)//' s', request%place(), &
                    'both sides must go on from the same accepted time')
  end subroutine check_start

  !> Number of sub-steps to t1, and their length: a fixed step must divide the interval (P254), an
  !! automatic one is cut so that it does. A fixed step is checked as often as in a run alone.
  subroutine count_substeps(model, t1, substeps, errors)
    type(dem_model_type), intent(inout) :: model
    real(wp), intent(in) :: t1  !! s
    integer(i4), intent(out) :: substeps
    type(error_list_type), intent(inout) :: errors
    real(wp) :: span, dt

    substeps = 1
    if (errors%any()) return
    span = t1 - model%clock%time()
    if (model%clock%automatic) then
      substeps = max(1_i4, ceiling(span/model%automatic_dt() - round_off))
      call fit_exchanges(model, .true., substeps, errors)
      dt = span/substeps
      if (abs(dt - model%system%par%dt) <= round_off*dt) dt = model%system%par%dt
    else
      dt = model%choices%dt
      substeps = nint(span/dt)
      if (substeps < 1 .or. abs(substeps*dt - span) > round_off*max(span, t1)) then
        call errors%add('P254', 'the interval of '//str(span)//' s is no multiple of the '// &
                        'grains'' time step '//str(dt)//' s', model%deck%source%path, &
                        'choose &clock exchange as a multiple of dt, or leave dt out of the '// &
                        'grains'' deck')
        return
      end if
      call fit_exchanges(model, .false., substeps, errors)
      if (modulo(model%clock%steps, review) < substeps) then
        if (dt > model%system%step_limit()) model%clock%unstable = model%clock%unstable + 1
      end if
    end if
    model%clock%dt = dt
    if (abs(dt - model%system%par%dt) > 0.0_wp) call model%use_step(dt)
  end subroutine count_substeps

  !> Where a prescribed set is at t1; a set that is not mentioned is at rest.
  subroutine take_motion(system, set, request, substeps, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    integer(i4), intent(in) :: substeps
    type(error_list_type), intent(inout) :: errors
    real(wp) :: x(3, size(set%index)), quat(4, size(set%index))

    x = system%grains%x(:, set%index)
    quat = system%grains%quat(:, set%index)
    if (request%has(set%name//dot_x)) call request%get(set%name//dot_x, x, errors)
    if (request%has(set%name//dot_quat)) call request%get(set%name//dot_quat, quat, errors)
    call check_motion(system, set, x, quat, errors)
    if (errors%any()) return
    call system%set_motion(set%index, x, quat, substeps)
  end subroutine take_motion

  !> A partner's motion must be numbers, its orientations unit quaternions (P257).
  subroutine check_motion(system, set, x, quat, errors)
    type(dem_system_type), intent(in) :: system
    type(dem_set_type), intent(in) :: set
    real(wp), intent(in) :: x(:, :), quat(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, size(x, 2)
      if (all(is_finite(x(:, k))) .and. all(is_finite(quat(:, k)))) then
        if (all(abs(x(:, k)) < far) .and. abs(norm2(quat(:, k)) - 1.0_wp) < 5.0e-7_wp) cycle
      end if
      call errors%add('P257', "set '"//set%name//"': grain "// &
                      str(system%grains%id(set%index(k)))//' was sent to '//str(x(:, k))// &
                      ', orientation '//str(quat(:, k)), 'exchange port', &
                      'positions must be numbers, orientations unit quaternions')
      return
    end do
  end subroutine check_motion

  subroutine take_load(system, set, request, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp) :: force(3, size(set%index)), moment(3, size(set%index))

    force = 0.0_wp
    moment = 0.0_wp
    if (request%has(set%name//dot_force)) call request%get(set%name//dot_force, force, errors)
    if (request%has(set%name//dot_moment)) call request%get(set%name//dot_moment, moment, errors)
    if (.not. errors%any()) call system%set_extra(set%index, force, moment)
  end subroutine take_load

  !> Mean part of a load, by which the reported kinetic energy is computed where a kick holds
  !! impulses of many steps: `mean_force`, `mean_moment`. Returns extra forces of all grains; the
  !! load itself is applied by the kick.
  subroutine take_mean(system, set, request, force, moment, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    real(wp), allocatable, intent(inout) :: force(:, :), moment(:, :)  !! (3, grains) [N], [N m]
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, size(set%index)) :: mean, mean_moment

    if (.not. request%has(set%name//dot_mean_force)) return
    mean_moment = 0.0_wp
    call request%get(set%name//dot_mean_force, mean, errors)
    if (request%has(set%name//dot_mean_moment)) &
      call request%get(set%name//dot_mean_moment, mean_moment, errors)
    if (errors%any()) return
    call system%set_extra(set%index, mean, mean_moment)
    force = system%grains%extra_force
    moment = system%grains%extra_moment
  end subroutine take_mean

  !> Forces with prescribed grains placed as requested; time does not advance. Where a border was
  !! selected the scope interface takes contacts of free grains alone, between those of ghosts with
  !! each other, split both; the forces on free grains are then completed after the reply, unless it
  !! reports them.
  subroutine force(model, sets, request, reply, late, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request, reply
    integer(i8), intent(inout) :: late
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: scope
    logical :: brief, owner_changed, ghosts

    scope = scope_all
    if (request%has(field_scope)) call request%get_text(field_scope, scope, errors)
    owner_changed = scope /= scope_all .and. model%system%parts%active
    ghosts = scope == scope_split .or. scope == scope_between
    if (all(scope /= [character(len=9) :: scope_all, scope_interface, scope_split, &
                                         scope_between])) then
      call errors%add('P255', "FORCE has no scope '"//scope//"'", request%place(), &
                      "it is 'all', 'interface', 'split' or 'between'")
    else if (ghosts .and. .not. owner_changed) then
      call errors%add('P255', 'FORCE cannot be split: no border was selected', request%place(), &
                      'SELECT a set with the role border first')
    end if
    call take_brief(request, brief, errors)
    if (errors%any()) return
    if (model%system%parts%stage == stage_reported) call model%system%free_forces()
    if (ghosts .or. .not. owner_changed) &
      call place_sets(model%system, sets, role_prescribe, request, errors)
    if (errors%any()) return
    call model%timers%start('steps')
    if (ghosts) call model%system%ghost_forces(scope == scope_between)
    if (owner_changed .and. scope /= scope_between) &
      call place_sets(model%system, sets, role_border, request, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (scope == scope_between) then
      continue  ! all else is as it was
    else if (owner_changed) then
      call forces_on_rim(model%system%dem_data_type)
      if (.not. brief .or. any_free_force(sets)) call model%system%free_forces()
    else
      call model%system%forces()
    end if
    call model%timers%stop('steps')
    call name_passage(model%system%dem_data_type, errors)
    if (errors%any()) return
    call put_forces(model%system, sets, scope, reply)
    if (ghosts) call put_border(model%system, reply, errors)
    if (.not. brief) call put_scalars(model%system, late, reply)
  end subroutine force

  !> Does a set request forces on grains that no partner moves, or on vertices?
  pure logical function any_free_force(sets)
    type(dem_sets_type), intent(in) :: sets
    integer(i4) :: k
    any_free_force = .false.
    do k = 1, sets%count
      associate (set => sets%set(k))
        if (set%role == role_prescribe .or. set%role == role_border) cycle
        any_free_force = any_free_force .or. set%role == role_surface &
          .or. set%wants(field_force) .or. set%wants(field_moment)
      end associate
    end do
  end function any_free_force

  !> Grains of all sets of a role, and vertices, where the request places them.
  subroutine place_sets(system, sets, role, request, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_sets_type), intent(in) :: sets
    integer(i4), intent(in) :: role
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, sets%count
      if (sets%set(k)%role == role) call take_state(system, sets%set(k), request, errors)
      if (sets%set(k)%role == role_surface) &
        call place_vertices(system, sets%set(k), request, errors)
    end do
  end subroutine place_sets

  !> Forces evaluated: of ghosts the part that the scope selects.
  subroutine put_forces(system, sets, scope, reply)
    type(dem_system_type), intent(in) :: system
    type(dem_sets_type), intent(in) :: sets
    character(len=*), intent(in) :: scope
    type(message_type), intent(inout) :: reply
    integer(i4) :: k
    do k = 1, sets%count
      if (scope == scope_between .and. sets%set(k)%role /= role_prescribe) cycle
      associate (set => sets%set(k), parts => system%parts)
        if (set%role == role_surface) then
          call put_vertices(system, set, .false., reply)
        else if (set%role == role_border) then
          if (scope /= scope_all) call put_pair(set, parts%of_free(:, set%index))
        else if (set%role == role_prescribe .and. any(scope == [character(len=7) :: &
                 scope_split, scope_between])) then
          call put_pair(set, parts%of_ghosts(:, set%index))
        else if (set%role /= role_prescribe .or. scope == scope_all .or. .not. parts%active) then
          if (set%wants(field_force)) &
            call reply%put(set%name//dot_force, system%grains%force(:, set%index))
          if (set%wants(field_moment)) &
            call reply%put(set%name//dot_moment, system%grains%moment(:, set%index))
          if (index(set%fields, ','//field_load//',') > 0) call put_load(set)
        end if
      end associate
    end do

  contains

    !> Loads of the grains' own deck: the surcharge.
    subroutine put_load(set)
      type(dem_set_type), intent(in) :: set
      real(wp) :: load(3, size(set%index))
      load = 0.0_wp
      if (allocated(system%surcharge)) load(3, :) = -system%surcharge(set%index)
      call reply%put(set%name//dot_load, load)
    end subroutine put_load

    subroutine put_pair(set, load)
      type(dem_set_type), intent(in) :: set
      real(wp), intent(in) :: load(:, :)  !! (6, grains) [N], [N m]
      call reply%put(set%name//dot_force, load(:3, :))
      call reply%put(set%name//dot_moment, load(4:, :))
    end subroutine put_pair
  end subroutine put_forces

  !> Report whether the border must be selected again; check that it has been wide enough.
  subroutine put_border(system, reply, errors)
    type(dem_system_type), intent(in) :: system
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    logical :: old
    old = border_is_old(system%dem_data_type)
    if (old) call check_border(system%dem_data_type, errors)
    call reply%put_int(field_border_old, merge(1_i4, 0_i4, old))
  end subroutine put_border

  !> Place, velocity and spin of a prescribed set now; what is not mentioned stays.
  subroutine take_state(system, set, request, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp) :: x(3, size(set%index)), v(3, size(set%index)), omega(3, size(set%index))
    real(wp) :: quat(4, size(set%index))

    call take_field(dot_x, system%grains%x, x)
    call take_field(dot_quat, system%grains%quat, quat)
    call take_field(dot_v, system%grains%v, v)
    call take_field(dot_omega, system%grains%omega, omega)
    call check_motion(system, set, x, quat, errors)
    if (errors%any()) return
    if (system%parts%active) then
      call system%place(set%index, x, quat, v, omega)
    else
      call system%set_state(set%index, x, quat, v, omega)
    end if

  contains

    subroutine take_field(name, now, field)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: now(:, :)      !! of all grains
      real(wp), intent(inout), contiguous :: field(:, :)
      if (request%has(set%name//name)) then
        call request%get(set%name//name, field, errors)
      else
        field = now(:, set%index)
      end if
    end subroutine take_field
  end subroutine take_state

  !> v += kick (F + X)/m of free grains, then x += drift v of all. With ahead = 1 forces in parts
  !! are requested next: contacts without ghosts begin after the reply.
  subroutine kick_drift(model, sets, request, reply, late, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request, reply
    integer(i8), intent(inout) :: late
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: force(:, :), moment(:, :)
    real(wp) :: kick, drift, t1
    logical :: brief, ahead
    integer(i4) :: k

    kick = 0.0_wp
    drift = 0.0_wp
    call request%get(field_kick, kick, errors)
    call request%get(field_drift, drift, errors)
    call take_brief(request, brief, errors)
    call take_flag(request, field_ahead, ahead, errors)
    do k = 1, sets%count
      if (sets%set(k)%role /= role_load) cycle
      call take_mean(model%system, sets%set(k), request, force, moment, errors)
      call take_load(model%system, sets%set(k), request, errors)
    end do
    call request%all_read(errors)
    if (errors%any()) return
    call model%load_surface(.false., errors)
    if (errors%any()) return
    call model%timers%start('steps')
    call model%system%kick_drift(kick, drift)
    call model%timers%stop('steps')
    if (drift > 0.0_wp) then
      t1 = model%clock%time() + drift
      if (abs(request%t1 - t1) <= round_off*drift) t1 = request%t1  ! free of rounding
      call model%clock%jump(t1, 1_i4)
    end if
    call put_sets(model%system, sets, .false., reply)
    if (.not. brief) then
      call swap_loads(model%system, force, moment)
      call put_scalars(model%system, late, reply)
      call swap_loads(model%system, force, moment)
    end if
    if (ahead .and. model%system%parts%active) call begin_ahead(model%system%dem_data_type)
  end subroutine kick_drift

  !> Extra forces for those of take_mean, and back.
  subroutine swap_loads(system, force, moment)
    type(dem_system_type), intent(inout) :: system
    real(wp), allocatable, intent(inout) :: force(:, :), moment(:, :)  !! (3, grains) [N], [N m]
    real(wp), allocatable :: aside(:, :)
    if (.not. allocated(force)) return
    call move_alloc(system%grains%extra_force, aside)
    call move_alloc(force, system%grains%extra_force)
    call move_alloc(aside, force)
    call move_alloc(system%grains%extra_moment, aside)
    call move_alloc(moment, system%grains%extra_moment)
    call move_alloc(aside, moment)
  end subroutine swap_loads

  !> Replies of the sets after motion: forces and impulses on request, and states.
  subroutine put_sets(system, sets, forces, reply)
    type(dem_system_type), intent(in) :: system
    type(dem_sets_type), intent(in) :: sets
    logical, intent(in) :: forces  !! with force, moment, impulses and work of prescribed sets
    type(message_type), intent(inout) :: reply
    integer(i4) :: k
    do k = 1, sets%count
      if (sets%set(k)%role == role_prescribe .and. forces) &
        call put_prescribed(system, sets%set(k), reply)
      if (sets%set(k)%role == role_surface .and. forces) &
        call put_vertices(system, sets%set(k), .true., reply)
      if (sets%set(k)%role == role_report) call put_state(system, sets%set(k), reply)
    end do
  end subroutine put_sets

  subroutine put_prescribed(system, set, reply)
    type(dem_system_type), intent(in) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: reply
    associate (g => system%grains, index => set%index)
      if (set%wants(field_force)) call reply%put(set%name//dot_force, g%force(:, index))
      if (set%wants(field_moment)) call reply%put(set%name//dot_moment, g%moment(:, index))
      if (set%wants(field_impulse)) call reply%put(set%name//dot_impulse, g%impulse(:, index))
      if (set%wants(field_moment_impulse)) &
        call reply%put(set%name//dot_moment_impulse, g%moment_impulse(:, index))
      if (set%wants(field_work)) call reply%put(set%name//dot_work, sum(g%work(index)))
    end associate
  end subroutine put_prescribed

  subroutine put_state(system, set, reply)
    type(dem_system_type), intent(in) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: reply
    associate (g => system%grains, index => set%index)
      if (set%wants(field_x)) call reply%put(set%name//dot_x, g%x(:, index))
      if (set%wants(field_quat)) call reply%put(set%name//dot_quat, g%quat(:, index))
      if (set%wants(field_v)) call reply%put(set%name//dot_v, g%v(:, index))
      if (set%wants(field_omega)) call reply%put(set%name//dot_omega, g%omega(:, index))
      if (set%wants(field_theta)) call reply%put(set%name//dot_theta, g%theta(:, index))
    end associate
  end subroutine put_state
end module dem_port_step
