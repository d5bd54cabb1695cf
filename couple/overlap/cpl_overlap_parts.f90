!> Steps of an overlap in which forces between ghosts are evaluated once an exchange: only ghosts
!! that free grains can reach are moved with every step of the grains (theory: overlap coupling,
!! Time).
module cpl_overlap_parts
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_force
  use talus_port_names, only: dot_force, dot_moment, dot_omega, dot_quat, dot_v, dot_x, &
    field_border_old, field_brief, field_id, field_scope, role_border, scope_between, &
    scope_interface, scope_split, what_border
  use talus_timers, only: timers_type
  use talus_vectors, only: turn_all
  use cpl_overlap, only: overlap_type, ghost_set
  use cpl_solver, only: cpl_solver_type
  use cpl_sums, only: work_since, add_works
  implicit none
  private
  public :: begin_parts, settle_parts, remember_start, follow_active, follow_all, put_active, &
    put_between, read_active, read_between, renew_kicks, work_of_parts, finish_parts

  character(len=*), parameter :: active_set = 'border'  !! of the grains

contains

  !> From here on forces come in parts; ghosts and all else are where they were when the present
  !! forces were evaluated. Again: after a restart, with all of it read.
  subroutine begin_parts(o, grains, again, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    logical, intent(in) :: again
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, o%op%ghosts) :: v, spin

    if (again) then
      call o%forces%parts%pull_all(o%op)
      call renew_kicks(o)
      call select_active(o, grains, timers, errors)
      return
    end if
    call o%forces%parts%begin(o%op)
    call choose_border(o, grains, timers, errors)
    if (errors%any()) return
    call o%op%to_ghosts(o%motion%v, o%motion%w, v, spin)
    call grains%start_request(verb_force, o%step, grains%time, grains%time)
    call grains%request%put_text(field_scope, scope_split)
    call put_ghosts(o, grains%request, v, spin)
    call grains%request%put(active_set//dot_v, v(:, o%forces%parts%active_rows))
    call grains%request%put(active_set//dot_omega, spin(:, o%forces%parts%active_rows))
    call grains%request%put_int(field_brief, 1_i4)
    call grains%ask(timers, errors)
    if (.not. errors%any()) call read_active(o, grains, errors)
    if (.not. errors%any()) call read_between(o, grains, errors)
    if (.not. errors%any()) call settle_parts(o)
  end subroutine begin_parts

  !> What acts between ghosts now acts in every step from here on.
  subroutine settle_parts(o)
    type(overlap_type), intent(inout) :: o
    call o%forces%parts%settle(o%op)
    o%forces%parts%kick = o%forces%parts%remainder%force
    o%forces%parts%kick_phi = o%forces%parts%remainder%moment
    call o%pull()
    call o%resist()
  end subroutine settle_parts

  !> Works of an exchange, with the forces at its end, which belong to the window; the mean part
  !! was counted with the steps.
  subroutine work_of_parts(o, timers)
    type(overlap_type), intent(inout) :: o
    type(timers_type), intent(inout) :: timers
    real(wp) :: given, taken, turnover

    call timers%start('works')
    taken = 0.0_wp
    turnover = 0.0_wp
    associate (parts => o%forces%parts, now => o%motion, a => o%op%prescribed + 1, &
               b => o%op%prescribed_phi + 1)
      call add_works(size(now%d), parts%p, now%d - parts%d, taken, turnover)
      call add_works(size(now%turn), parts%m, now%turn - parts%turn, taken, turnover)
      given = work_since(size(now%q), parts%remainder%force, now%q, parts%q) &
              + work_since(size(now%theta), parts%remainder%moment, now%theta, parts%theta) &
              + sum(parts%remainder%f(:, a:)*(now%u(:, a:) - parts%u(:, a:))) &
              + sum(parts%remainder%c(:, b:)*(now%phi(:, b:) - parts%phi(:, b:)))
    end associate
    call o%ledger%add(given, taken, turnover)
    call o%note_dead(o%forces%parts%q, o%forces%parts%theta, o%forces%parts%u, o%forces%parts%phi)
    call o%forces%parts%gather()
    call timers%stop('works')
  end subroutine work_of_parts

  !> After an exchange: a border that is too old is chosen again; after a window of exchanges its
  !! mean forces act in every step.
  subroutine finish_parts(o, grains, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    if (o%forces%parts%old) call choose_border(o, grains, timers, errors)
    if (.not. o%forces%parts%is_due()) return
    call o%forces%parts%renew(o%op)
    call renew_kicks(o)
    call o%pull()
    call o%resist()
  end subroutine finish_parts

  !> Ask which ghosts free grains can reach, and have them moved with the steps.
  subroutine choose_border(o, grains, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    real(wp), allocatable :: p(:, :), m(:, :)
    integer(i4) :: row(o%op%ghosts), k, g, at

    call grains%describe(what_border, '', timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, ids, errors)
    if (errors%any()) return
    allocate (p(3, o%op%ghosts), m(3, o%op%ghosts), source=0.0_wp)
    if (allocated(o%forces%parts%active_rows)) then
      p(:, o%forces%parts%active_rows) = o%forces%parts%p_active
      m(:, o%forces%parts%active_rows) = o%forces%parts%m_active
    end if
    g = 0
    at = 1
    do k = 1, o%op%ghosts  ! both in the order of ids; ghosts that no node moves are not of ours
      do while (at < size(ids))
        if (ids(at) >= o%pack%id(o%sets%ghost(k))) exit
        at = at + 1
      end do
      if (at > size(ids)) exit
      if (o%pack%id(o%sets%ghost(k)) /= ids(at)) cycle
      g = g + 1
      row(g) = k
      at = at + 1
    end do
    o%forces%parts%active_rows = row(:g)
    o%forces%parts%p_active = p(:, o%forces%parts%active_rows)
    o%forces%parts%m_active = m(:, o%forces%parts%active_rows)
    call select_active(o, grains, timers, errors)
  end subroutine choose_border

  subroutine select_active(o, grains, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical :: is_far(o%op%ghosts)
    associate (parts => o%forces%parts)
      is_far = .true.
      is_far(parts%active_rows) = .false.
      parts%other_rows = pack(o%op%every, is_far)
      if (.not. allocated(parts%v)) &
        allocate (parts%v(3, o%op%ghosts), parts%spin(3, o%op%ghosts))
      parts%x_active = o%map%x_ghost(:, parts%active_rows)
      parts%d_active = o%motion%d(:, parts%active_rows)
      parts%turn_active = o%motion%turn(:, parts%active_rows)
      parts%quat_active = o%motion%quat(:, parts%active_rows)
    end associate
    call grains%start_select(o%step, active_set, role_border, &
                             o%pack%id(o%sets%ghost(o%forces%parts%active_rows)))
    call grains%ask(timers, errors)
  end subroutine select_active

  !> Where nodes and free grains are at the start of an exchange.
  subroutine remember_start(o)
    type(overlap_type), intent(inout) :: o
    o%forces%parts%q = o%motion%q
    o%forces%parts%theta = o%motion%theta
    o%forces%parts%u = o%motion%u
    o%forces%parts%phi = o%motion%phi
  end subroutine remember_start

  !> The active ghosts where the nodes are now; how far they came.
  subroutine follow_active(o, moved, turns)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(out) :: moved(:, :), turns(:, :)  !! (3, active) [m], [rad]

    associate (parts => o%forces%parts)
      moved = parts%d_active
      turns = parts%turn_active
      call o%op%to_some_ghosts(parts%active_rows, o%motion%u, o%motion%phi, parts%d_active, &
        parts%turn_active)
      moved = parts%d_active - moved
      turns = parts%turn_active - turns
      if (.not. o%rules%round) call turn_all(parts%quat_active, turns)
    end associate
  end subroutine follow_active

  !> At the end of an exchange of length h the other ghosts, too; mean velocities of all. The active
  !! ones have followed already.
  subroutine follow_all(o, h)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: h                     !! [s]
    real(wp), dimension(3, size(o%forces%parts%other_rows)) :: d, turn
    real(wp) :: rate
    integer(i4) :: k

    call o%op%to_some_ghosts(o%forces%parts%other_rows, o%motion%u, o%motion%phi, d, turn)
    call o%motion%begin_ghosts(o%forces%parts%d, o%forces%parts%turn)
    call o%motion%put_ghosts(o%forces%parts%other_rows, d, turn)
    call o%motion%put_ghosts(o%forces%parts%active_rows, o%forces%parts%d_active, &
      o%forces%parts%turn_active)
    rate = 1.0_wp/h
    associate (parts => o%forces%parts)
      do k = 1, o%op%ghosts
        parts%v(:, k) = rate*(o%motion%d(:, k) - parts%d(:, k))
        parts%spin(:, k) = rate*(o%motion%turn(:, k) - parts%turn(:, k))
      end do
      if (o%rules%round) return
      call turn_all(o%motion%quat, o%motion%turn - parts%turn)
      do k = 1, size(parts%active_rows)
        o%motion%quat(:, parts%active_rows(k)) = parts%quat_active(:, k)
      end do
    end associate
  end subroutine follow_all

  !> The active ghosts, in a request FORCE: contacts of free grains alone.
  subroutine put_active(o, request, v, spin)
    type(overlap_type), intent(in) :: o
    type(message_type), intent(inout) :: request
    real(wp), intent(in) :: v(:, :), spin(:, :)  !! (3, active) [m/s], [rad/s]
    call request%put_text(field_scope, scope_interface)
    call request%put(active_set//dot_x, o%forces%parts%x_active + o%forces%parts%d_active)
    if (.not. o%rules%round) call request%put(active_set//dot_quat, o%forces%parts%quat_active)
    call request%put(active_set//dot_v, v)
    call request%put(active_set//dot_omega, spin)
  end subroutine put_active

  !> All ghosts, in a request FORCE: their contacts with each other, after those of free grains.
  subroutine put_between(o, request)
    type(overlap_type), intent(in) :: o
    type(message_type), intent(inout) :: request
    call request%put_text(field_scope, scope_between)
    call put_ghosts(o, request, o%forces%parts%v, o%forces%parts%spin)
    call request%put_int(field_brief, 1_i4)
  end subroutine put_between

  subroutine put_ghosts(o, request, v, spin)
    type(overlap_type), intent(in) :: o
    type(message_type), intent(inout) :: request
    real(wp), intent(in) :: v(:, :), spin(:, :)  !! mean of the exchange (3, ghosts)
    call request%put(ghost_set//dot_x, o%map%x_ghost + o%motion%d)
    if (.not. o%rules%round) call request%put(ghost_set//dot_quat, o%motion%quat)
    call request%put(ghost_set//dot_v, v)
    call request%put(ghost_set//dot_omega, spin)
  end subroutine put_ghosts

  !> Forces of free grains on the active ghosts, from a reply.
  subroutine read_active(o, grains, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(error_list_type), intent(inout) :: errors
    call grains%reply%get(active_set//dot_force, o%forces%parts%p_active, errors)
    call grains%reply%get(active_set//dot_moment, o%forces%parts%m_active, errors)
  end subroutine read_active

  !> Forces of ghosts on ghosts, from a reply.
  subroutine read_between(o, grains, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: old
    call grains%reply%get(ghost_set//dot_force, o%forces%parts%p, errors)
    call grains%reply%get(ghost_set//dot_moment, o%forces%parts%m, errors)
    call grains%reply%get_int(field_border_old, old, errors)
    if (errors%any()) return
    o%forces%parts%old = old == 1
  end subroutine read_between

  !> Kicks with the forces between ghosts now, with the inertia of what prescribed nodes carry.
  subroutine renew_kicks(o)
    type(overlap_type), intent(inout) :: o
    real(wp) :: load(3, o%op%prescribed), load_phi(3, o%op%prescribed_phi)

    call o%forces%parts%pull_remainder(o%op)
    associate (parts => o%forces%parts)
      parts%kick = parts%remainder%force
      parts%kick_phi = parts%remainder%moment
      if (o%own%carried%active) then
        call o%own%carried%resist(parts%remainder%force, load)
        call o%op%p%transposed(load, parts%kick)
      end if
      if (o%own%carried_phi%active) then
        call o%own%carried_phi%resist(parts%remainder%moment, load_phi)
        call o%op%p_phi%transposed(load_phi, parts%kick_phi)
      end if
    end associate
  end subroutine renew_kicks
end module cpl_overlap_parts
