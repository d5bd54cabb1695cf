!> The step verbs of talus-fem: SOLVE, ADVANCE, FORCE, KICK_DRIFT.
module fem_port_step
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_impulse, dot_moment_impulse, dot_work, field_drift, &
    field_iterations, field_kick, field_scope, field_set, field_steady, field_substeps, &
    field_trial, scope_all, scope_balance, scope_interface, scope_loads
  use talus_serve, only: take_brief
  use fem_central, only: explicit_energy
  use fem_explicit, only: kick_lumped
  use fem_interval, only: begin_interval, give_impulse, check_impulse
  use fem_sparse, only: multiply
  use fem_body, only: fem_body_type, fem_kept_type
  use fem_types, only: role_prescribe, role_load
  use fem_model, only: fem_model_type
  use fem_sets, only: fem_sets_type
  use fem_port_state, only: put_scalars
  implicit none
  private
  public :: solve, advance, force, kick_drift

contains

  !> One static or implicit step from the accepted state to t1.
  subroutine solve(model, sets, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(fem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    type(fem_kept_type) :: kept
    integer(i4) :: trial

    trial = 1
    if (.not. model%analysis%solves) then
      call errors%add('P301', 'an explicit body does not answer SOLVE', request%place(), &
                      "use ADVANCE, or kind = 'newmark'")
      return
    end if
    if (request%has(field_trial)) call request%get_int(field_trial, trial, errors)
    call sets%take_loads(model%body, request, errors)
    call sets%take_motion(model%body, request, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (model%body%matter%active) call model%body%keep(kept)
    call model%analysis%step(model%body, request%t1, errors)
    if (model%body%matter%active) call model%body%put_back(kept)
    if (errors%any()) return
    call sets%put_states(model%body, reply)
    call reply%put_int(field_iterations, max(1_i4, model%body%newton%rows))
    call put_scalars(model%body, reply)
  end subroutine solve

  !> Own steps to t1 (one if the deck gives no dt) under loads that are held from t0 on, and after
  !! impulses at t0; impulses and work on prescribed sets. The accepted state stays as it was, so
  !! that REJECT finds it.
  subroutine advance(model, sets, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(fem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: start_u(:, :), end_u(:, :), impulse(:, :), work(:), before(:, :), &
      moved(:, :), push(:, :)
    type(fem_kept_type) :: kept
    real(wp) :: t0, share, dt
    integer(i4) :: k, n
    logical :: pushed

    call sets%take_loads(model%body, request, errors)
    call sets%take_impulses(model%body, request, pushed, push, errors)
    allocate (start_u, source=model%body%accepted%u)
    if (pushed) call check_impulse(model%body, push, request%place(), errors)
    call sets%take_motion(model%body, request, errors)
    call request%all_read(errors)
    if (errors%any()) return
    allocate (end_u, source=model%body%port%given_u)
    t0 = model%body%accepted%time
    n = model%analysis%steps_between(model%body, t0, request%t1)
    dt = (request%t1 - t0)/n
    allocate (impulse, mold=start_u)
    impulse = 0.0_wp
    allocate (work(sets%n), source=0.0_wp)
    allocate (before, moved, mold=start_u)
    associate (body => model%body)
      call body%keep(kept)
      if (body%scheme%explicit) call begin_interval(body, push)
      start: do k = 1, n
        share = real(k, wp)/real(n, wp)
        call body%port%move_along(start_u, end_u, share)
        before(:, :) = body%accepted%reaction
        moved(:, :) = body%accepted%u
        call model%analysis%step(body, t0 + share*(request%t1 - t0), errors)
        if (errors%any()) exit start
        moved(:, :) = body%state%u - moved
        impulse = impulse + 0.5_wp*dt*(before + body%state%reaction)
        call add_work(sets, before, body%state%reaction, moved, work)
        if (k < n) call body%accept()
      end do start
      call body%put_back(kept)
      if (errors%any()) return
      call sets%put_states(body, reply)
      call put_impulses(sets, impulse, work, reply)
      call reply%put_int(field_substeps, n)
      call put_scalars(body, reply)
    end associate
  end subroutine advance

  !> Add the trapezoidal works of the reactions on each set [J].
  subroutine add_work(sets, before, after, moved, work)
    type(fem_sets_type), intent(in) :: sets
    real(wp), intent(in) :: before(:, :), after(:, :), moved(:, :)  !! (3, blocks)
    real(wp), intent(inout) :: work(:)
    integer(i4) :: s, i
    do s = 1, sets%n
      associate (block => [sets%set(s)%node, sets%set(s)%phi])
        do i = 1, size(block)
          work(s) = work(s) + 0.5_wp*dot_product(before(:, block(i)) + after(:, block(i)), &
                                                 moved(:, block(i)))
        end do
      end associate
    end do
  end subroutine add_work

  !> Impulses and works of the prescribed sets; signs as on the partner.
  subroutine put_impulses(sets, impulse, work, reply)
    type(fem_sets_type), intent(in) :: sets
    real(wp), intent(in) :: impulse(:, :), work(:)
    type(message_type), intent(inout) :: reply
    integer(i4) :: s
    do s = 1, sets%n
      if (sets%set(s)%role /= role_prescribe) cycle
      call reply%put(trim(sets%set(s)%name)//dot_impulse, -impulse(:, sets%set(s)%node))
      if (size(sets%set(s)%phi) > 0) call reply%put(trim(sets%set(s)%name)// &
        dot_moment_impulse, -impulse(:, sets%set(s)%phi))
      call reply%put(trim(sets%set(s)%name)//dot_work, work(s))
    end do
  end subroutine put_impulses

  !> Internal forces of the present state with prescribed nodes as given in the request.
  !! Scope `interface`: only elements that have a node of a prescribed set count, or of `set`;
  !! `balance`: with all loads, so that zero is left where the body is at rest; `loads`: the loads
  !! of the deck alone, without weight, at the time of the request.
  subroutine force(model, sets, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(fem_sets_type), intent(inout) :: sets
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: scope
    real(wp), allocatable :: f(:, :), external(:, :)
    logical :: brief
    integer(i4) :: chosen

    scope = scope_all
    if (request%has(field_scope)) call request%get_text(field_scope, scope, errors)
    if (all(scope /= [character(len=9) :: scope_all, scope_interface, scope_balance, &
                                         scope_loads])) &
      call errors%add('P301', "FORCE has no scope '"//scope//"'", request%place(), &
                      "it is 'all', 'interface', 'balance' or 'loads'")
    call choose_set(sets, model, request, chosen, errors)
    call take_brief(request, brief, errors)
    call sets%take_motion(model%body, request, errors)
    call request%all_read(errors)
    if (errors%any()) return
    associate (body => model%body)
      where (body%port%prescribed) body%state%u = body%port%given_u
      if (scope == scope_interface .and. chosen > 0) then
        call sets%put_force_of_elements(chosen, body, reply, errors)
        if (.not. (brief .or. errors%any())) call put_scalars(body, reply)
        return
      end if
      allocate (f(3, body%dofs%blocks), external(3, body%dofs%blocks))
      if (scope == scope_loads) then
        call deck_loads(body, request%t0, f)
        f = -f
        call reply%put_int(field_steady, merge(1_i4, 0_i4, steady_loads(body, sets, chosen)))
      else if (scope == scope_interface) then
        call body%interface_force(body%state%u, f)
      else
        call body%trial_force(body%state%u, f)
      end if
      call body%matter_fault(errors)
      if (errors%any()) return
      if (scope == scope_all) f = f - body%system%weight_force
      if (scope == scope_balance) then
        call body%external_at(body%state%time, external)
        f = f - external
      end if
      if (scope == scope_interface) then
        call sets%put_parts(body%dofs%halo, f, reply)
      else
        call sets%put_forces(f, reply)
      end if
      if (.not. brief) call put_scalars(body, reply)
    end associate
  end subroutine force

  !> Loads of the deck at time t: tractions, pressures, forces, couples [N, N m].
  subroutine deck_loads(body, t, f)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: t
    real(wp), intent(out) :: f(:, :)  !! (3, blocks)
    real(wp) :: value
    integer(i4) :: k
    f = 0.0_wp
    do k = 1, size(body%loads%load)
      value = 1.0_wp
      if (body%loads%load(k)%curve > 0) value = body%loads%curve(body%loads%load(k)%curve)%at(t)
      f = f + value*body%loads%load(k)%force
    end do
    call body%follow(t, body%state%u, f)
  end subroutine deck_loads

  !> Do the loads on a set, or on all (0), stay what they are?
  pure logical function steady_loads(body, sets, chosen)
    type(fem_body_type), intent(in) :: body
    type(fem_sets_type), intent(in) :: sets
    integer(i4), intent(in) :: chosen
    integer(i4) :: k, s
    steady_loads = .not. allocated(body%loads%follower)
    if (allocated(body%loads%follower)) steady_loads = size(body%loads%follower) == 0
    do s = 1, sets%n
      if (chosen > 0 .and. s /= chosen) cycle
      associate (block => [sets%set(s)%node, sets%set(s)%phi])
        do k = 1, size(body%loads%load)
          if (body%loads%load(k)%curve == 0) cycle
          steady_loads = steady_loads .and. &
            .not. any(abs(body%loads%load(k)%force(:, block)) > 0.0_wp)
        end do
      end associate
    end do
  end function steady_loads

  !> The set to whose elements FORCE is restricted, 0 if none is named (P302).
  subroutine choose_set(sets, model, request, chosen, errors)
    type(fem_sets_type), intent(inout) :: sets
    type(fem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: request
    integer(i4), intent(out) :: chosen
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    chosen = 0
    if (.not. request%has(field_set)) return
    call request%get_text(field_set, name, errors)
    if (errors%any()) return
    call sets%find(name, chosen)
    if (chosen == 0) then
      call errors%add('P302', "no set '"//name//"' was selected", request%place(), &
                      'SELECT it first')
    end if
  end subroutine choose_set

  !> v += kick (F + X)/m, x += drift v on free degrees of freedom, with lumped mass. Dashpots and
  !! a M act in the kick by the mean of the velocities before and after it; what the deck moves has
  !! its position at t1.
  subroutine kick_drift(model, sets, request, reply, errors)
    type(fem_model_type), intent(inout) :: model
    type(fem_sets_type), intent(inout) :: sets
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: f(:, :), internal(:, :), external(:, :), push(:, :)
    real(wp) :: kick, drift
    logical :: brief, pushed
    integer(i4) :: i

    kick = 0.0_wp
    drift = 0.0_wp
    call request%get(field_kick, kick, errors)
    call request%get(field_drift, drift, errors)
    call take_brief(request, brief, errors)
    call sets%take_impulses(model%body, request, pushed, push, errors)
    if (pushed) then
      call push_alone(model%body, sets, push, max(kick, drift) > 0.0_wp, request, reply, errors)
      return
    end if
    call sets%take_loads(model%body, request, errors)
    call sets%take_motion(model%body, request, errors)
    call request%all_read(errors)
    if (errors%any()) return
    associate (body => model%body)
      allocate (internal(3, body%dofs%blocks), external(3, body%dofs%blocks))
      where (body%port%prescribed) body%state%u = body%port%given_u
      call sets%whole_force(body, internal)
      call body%matter_fault(errors)
      if (errors%any()) return
      call body%external_at(request%t0, external)
      call body%follow(request%t0, body%state%u, external)
      f = external - internal
      if (body%damping%stiffness > 0.0_wp) then
        call multiply(body%system%pattern, body%system%k, body%state%v, body%state%viscous)
        f = f - body%damping%stiffness*body%state%viscous
      end if
      if (kick > 0.0_wp) call kick_lumped(kick, body%supports%held .or. body%port%prescribed, &
        body%system%node_mass, &
                                          body%damping, f, body%state%v)
      if (drift > 0.0_wp) then
        do i = 1, body%dofs%blocks
          where (.not. (body%supports%held(:, i) .or. body%port%prescribed(:, i))) &
            body%state%u(:, i) = body%state%u(:, i) + drift*body%state%v(:, i)
        end do
        call body%impose(request%t1, body%state%u)
      end if
      body%state%external = external
      body%state%time = request%t1
      if (brief) return
      if (drift > 0.0_wp) call body%trial_force(body%state%u, internal)
      call explicit_energy(body, internal)
      call body%matter_fault(errors)
      if (errors%any()) return
      call sets%put_states(body, reply)
      call put_scalars(body, reply)
    end associate
  end subroutine kick_drift
  !> KICK_DRIFT with impulses: they act on the state as it is, at once, and nothing else does.
  subroutine push_alone(body, sets, push, moves, request, reply, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_sets_type), intent(in) :: sets
    real(wp), intent(in) :: push(:, :)  !! (3, blocks) [N s]
    logical, intent(in) :: moves        !! the request has a kick or a drift, too
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors

    call request%all_read(errors)
    call check_impulse(body, push, request%place(), errors)
    if (moves) call errors%add('P302', 'impulses come in a KICK_DRIFT of their own', &
                               request%place(), 'send kick = drift = 0 with them')
    if (errors%any()) return
    call give_impulse(body, push, body%state%v, body%energy)
    call sets%put_states(body, reply)
    call put_scalars(body, reply)
  end subroutine push_alone
end module fem_port_step
