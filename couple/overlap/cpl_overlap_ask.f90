!> What talus-couple asks of both solvers in an exchange of an overlap, and what it reads of their
!! replies.
module cpl_overlap_ask
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_accept, verb_force, verb_kick_drift
  use talus_port_names, only: dot_force, dot_load, dot_mean_force, dot_mean_moment, dot_moment, &
    dot_omega, dot_phi, dot_phi_rate, dot_quat, dot_theta, dot_u, dot_v, dot_x, field_ahead, &
    field_brief, field_drift, field_final, field_force, field_kick, field_moment, field_reaction, &
    field_reaction_moment, field_scalars, field_scope, field_set, scope_interface
  use talus_timers, only: timers_type
  use cpl_overlap, only: overlap_type, ghost_set, free_set, pulled_set, prescribed_set, edge_set, &
    prescribed_phi_set, edge_phi_set
  use cpl_overlap_parts, only: put_active, put_between, read_active, read_between, renew_kicks
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid, sides
  implicit none
  private
  public :: kick_type, answers_type, send_kick, read_free, send_bulk, read_bulk
  public :: evaluate_bulk, ask_solid, ask_grains, take_forces, put_nodes, read_nodes
  public :: send_accept, accept_both

  character(len=*), parameter :: messages = 'exchange'  !! timer of what goes into and out of them

  !> What KICK_DRIFT asks for.
  type :: kick_type
    real(wp) :: kick = 0.0_wp, drift = 0.0_wp  !! durations [s]
    real(wp) :: t0 = 0.0_wp, t1 = 0.0_wp       !! interval [s]
  end type kick_type

  !> What is awaited where forces are taken, and what is asked for next.
  type :: answers_type
    logical :: between = .false.         !! forces of ghosts on ghosts are asked for next
    logical :: elements = .true.         !! the solid was asked for forces of elements
    logical :: ends = .false.            !! the solid's last kick of an exchange is asked for next
    real(wp) :: end_kick = 0.0_wp        !! its length [s]
  end type answers_type

contains

  !> KICK_DRIFT of the grains with the forces on the free ones; at the ends of an exchange with
  !! those that act in kicks of half of it. Where forces come in parts contacts between free grains
  !! may then begin before the ghosts are placed.
  subroutine send_kick(o, grains, by, at_end, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(kick_type), intent(in) :: by
    logical, intent(in) :: at_end
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call timers%start(messages)
    call grains%start_request(verb_kick_drift, o%step, by%t0, by%t1)
    call grains%request%put(field_kick, by%kick)
    call grains%request%put(field_drift, by%drift)
    if (at_end .and. o%forces%parts%active) then
      call grains%request%put(pulled_set//dot_force, o%forces%force &
        + o%rules%substeps*o%forces%parts%kick)
      if (o%rules%turns) &
        call grains%request%put(pulled_set//dot_moment, o%forces%moment &
        + o%rules%substeps*o%forces%parts%kick_phi)
      if (.not. by%drift > 0.0_wp) then  ! energies are reported
        call grains%request%put(pulled_set//dot_mean_force, o%forces%force + o%forces%parts%kick)
        if (o%rules%turns) &
          call grains%request%put(pulled_set//dot_mean_moment, o%forces%moment &
          + o%forces%parts%kick_phi)
      end if
    else
      call grains%request%put(pulled_set//dot_force, o%forces%force)
      if (o%rules%turns) call grains%request%put(pulled_set//dot_moment, o%forces%moment)
    end if
    call timers%stop(messages)
    if (by%drift > 0.0_wp) call grains%request%put_int(field_brief, 1_i4)
    if (by%drift > 0.0_wp .and. o%forces%parts%active) &
      call grains%request%put_int(field_ahead, 1_i4)
    call grains%send(timers, errors)
  end subroutine send_kick

  !> Displacements and rotations of the free grains from a reply.
  subroutine read_free(o, grains, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call timers%start(messages)
    call grains%reply%get(free_set//dot_x, o%motion%q, errors)
    if (o%rules%reads_speed) call grains%reply%get(free_set//dot_v, o%motion%speed, errors)
    if (o%rules%turns) then
      if (o%rules%reads_speed) call grains%reply%get(free_set//dot_omega, o%motion%spin, errors)
      call grains%reply%get(free_set//dot_theta, o%motion%theta, errors)
      call o%motion%count_free(o%map%x_free, o%map%theta_ref)
    else
      call o%motion%count_free(o%map%x_free)
    end if
    call timers%stop(messages)
  end subroutine read_free

  !> KICK_DRIFT of the solid's free nodes; edge and prescribed nodes stay where the last forces were
  !! taken.
  subroutine send_bulk(o, solid, by, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(kick_type), intent(in) :: by
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solid%start_request(verb_kick_drift, o%step, by%t0, by%t1)
    call solid%request%put(field_kick, by%kick)
    call solid%request%put(field_drift, by%drift)
    if (by%drift > 0.0_wp) call solid%request%put_int(field_brief, 1_i4)
    call solid%send(timers, errors)
  end subroutine send_bulk

  !> All ghosts, in a request FORCE.
  subroutine put_ghosts(o, request, v, spin)
    type(overlap_type), intent(in) :: o
    type(message_type), intent(inout) :: request
    real(wp), intent(in) :: v(:, :), spin(:, :)  !! (3, ghosts) [m/s], [rad/s]
    call request%put(ghost_set//dot_x, o%map%x_ghost + o%motion%d)
    call request%put(ghost_set//dot_v, v)
    call request%put(ghost_set//dot_omega, spin)
    if (.not. o%rules%round) call request%put(ghost_set//dot_quat, o%motion%quat)
  end subroutine put_ghosts

  !> Forces on ghosts and free grains, from a reply; all but gravity and what comes from here.
  subroutine read_forces(o, grains, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(error_list_type), intent(inout) :: errors
    real(wp) :: load(3, merge(o%op%free, 0_i4, o%rules%reads_force))
    if (o%forces%parts%active) then
      call read_active(o, grains, errors)
    else
      call grains%reply%get(ghost_set//dot_force, o%forces%p, errors)
      call grains%reply%get(ghost_set//dot_moment, o%forces%m, errors)
    end if
    if (o%rules%reads_force) then
      call grains%reply%get(free_set//dot_force, o%forces%contact, errors)
      call grains%reply%get(free_set//dot_load, load, errors)
      if (.not. errors%any()) o%forces%contact = o%forces%contact + load
    end if
    if (o%rules%reads_force .and. o%rules%turns) &
      call grains%reply%get(free_set//dot_moment, o%forces%contact_moment, errors)
  end subroutine read_forces

  !> Where the nodes that talus-couple moves are, in a request to the solid.
  subroutine put_nodes(o, solid)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp) :: u(3, o%op%nodes), phi(3, o%op%nodes_phi)
    u = o%motion%u
    phi = o%motion%phi
    if (allocated(o%map%base)) u = u + o%map%base(:, o%op%node)
    if (allocated(o%map%base_phi)) phi = phi + o%map%base_phi(:, o%op%node_phi)
    call solid%request%put(prescribed_set//dot_u, u(:, :o%op%prescribed))
    if (.not. o%rules%static) call solid%request%put(edge_set//dot_u, u(:, o%op%prescribed + 1:))
    if (o%op%nodes_phi == 0) return
    call solid%request%put(prescribed_phi_set//dot_phi, phi(:, :o%op%prescribed_phi))
    if (.not. o%rules%static) &
      call solid%request%put(edge_phi_set//dot_phi, phi(:, o%op%prescribed_phi + 1:))
  end subroutine put_nodes

  !> A field of all nodes from a reply of the solid.
  subroutine read_nodes(o, solid, field, field_phi, f, c, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    character(len=*), intent(in) :: field, field_phi
    real(wp), intent(inout) :: f(:, :), c(:, :)  !! (3, nodes), (3, nodes_phi)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: prescribed(3, o%op%prescribed), edge(3, o%op%nodes - o%op%prescribed)
    real(wp) :: prescribed_phi(3, o%op%prescribed_phi), edge_phi(3, o%op%nodes_phi &
      - o%op%prescribed_phi)
    call solid%reply%get(prescribed_set//'.'//field, prescribed, errors)
    call solid%reply%get(edge_set//'.'//field, edge, errors)
    f(:, :o%op%prescribed) = prescribed
    f(:, o%op%prescribed + 1:) = edge
    if (o%op%nodes_phi == 0) return
    call solid%reply%get(prescribed_phi_set//'.'//field_phi, prescribed_phi, errors)
    call solid%reply%get(edge_phi_set//'.'//field_phi, edge_phi, errors)
    c(:, :o%op%prescribed_phi) = prescribed_phi
    c(:, o%op%prescribed_phi + 1:) = edge_phi
  end subroutine read_nodes

  !> Forces of the elements without prescribed nodes on the edge: all that the solid exerts, less
  !! those of the elements with prescribed nodes. The free nodes are kicked on the way.
  subroutine evaluate_bulk(o, solid, kick, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: kick, t  !! [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call send_bulk(o, solid, kick_type(kick, 0.0_wp, t, t), timers, errors)
    if (.not. errors%any()) call solid%receive(timers, errors)
    if (.not. errors%any()) call read_bulk(o, solid, errors)
  end subroutine evaluate_bulk

  subroutine read_bulk(o, solid, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(error_list_type), intent(inout) :: errors
    call read_nodes(o, solid, field_reaction, field_reaction_moment, o%forces%bulk, &
      o%forces%bulk_phi, &
      errors)
    call o%forces%take_reactions()
    call solid%reply%get(field_scalars, o%ledger%solid, errors)
  end subroutine read_bulk

  !> ACCEPT; nothing will be rejected. The solid is sent velocities of prescribed and edge nodes,
  !! for its field output.
  subroutine send_accept(o, solver, t0, t1, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solver
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solver%start_request(verb_accept, o%step, t0, t1)
    call solver%request%put_int(field_final, 1_i4)
    if (solver%side == sides(side_solid) .and. .not. o%rules%static) then
      call solver%request%put(prescribed_set//dot_v, o%motion%v(:, :o%op%prescribed))
      call solver%request%put(edge_set//dot_v, o%motion%v(:, o%op%prescribed + 1:))
      if (o%op%nodes_phi > 0) then
        call solver%request%put(prescribed_phi_set//dot_phi_rate, &
          o%motion%w(:, :o%op%prescribed_phi))
        call solver%request%put(edge_phi_set//dot_phi_rate, &
          o%motion%w(:, o%op%prescribed_phi + 1:))
      end if
    end if
    call solver%send(timers, errors)
  end subroutine send_accept

  subroutine accept_both(o, solvers, t0, t1, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, 2
      call send_accept(o, solvers(k), t0, t1, timers, errors)
    end do
    do k = 1, 2
      if (.not. errors%any()) call solvers(k)%receive(timers, errors)
    end do
  end subroutine accept_both

  !> FORCE of the elements with prescribed nodes, with the nodes where they are now.
  subroutine ask_solid(o, solid, t, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: t  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call timers%start(messages)
    call solid%start_request(verb_force, o%step, t, t)
    call solid%request%put_text(field_scope, scope_interface)
    call solid%request%put_text(field_set, prescribed_set)
    call put_nodes(o, solid)
    call solid%request%put_int(field_brief, 1_i4)
    call timers%stop(messages)
    call solid%send(timers, errors)
  end subroutine ask_solid

  !> FORCE of the grains with ghosts where they are now. v and spin are those of the ghosts; where
  !! forces come in parts those of the active ghosts.
  subroutine ask_grains(o, grains, v, spin, t, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: grains
    real(wp), intent(in) :: v(:, :), spin(:, :)  !! (3, ghosts) or (3, active) [m/s], [rad/s]
    real(wp), intent(in) :: t                    !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call timers%start(messages)
    call grains%start_request(verb_force, o%step, t, t)
    if (o%forces%parts%active) then
      call put_active(o, grains%request, v, spin)
    else
      call put_ghosts(o, grains%request, v, spin)
    end if
    call grains%request%put_int(field_brief, 1_i4)
    call timers%stop(messages)
    call grains%send(timers, errors)
  end subroutine ask_grains

  !> Wait for the forces that were asked for, and transfer them to what is free. Those of ghosts on
  !! ghosts are evaluated meanwhile; the solid begins its last kick of an exchange as soon as its
  !! forces are there.
  subroutine take_forces(o, solvers, answers, t, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(answers_type), intent(in) :: answers
    real(wp), intent(in) :: t  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    associate (grains => solvers(side_grains), solid => solvers(side_solid))
      if (answers%between) then
        call timers%start(messages)
        call grains%start_request(verb_force, o%step, t, t)
        call put_between(o, grains%request)
        call timers%stop(messages)
      end if
      if (.not. errors%any()) call grains%receive(timers, errors)
      if (answers%between .and. .not. errors%any()) call grains%send(timers, errors)
      if (answers%elements .and. .not. errors%any()) call solid%receive(timers, errors)
      if (errors%any()) return
      if (answers%ends) &
        call send_bulk(o, solid, kick_type(answers%end_kick, 0.0_wp, t, t), timers, errors)
      call timers%start(messages)
      call read_forces(o, grains, errors)
      if (answers%elements) call read_nodes(o, solid, field_force, field_moment, &
        o%forces%element, o%forces%element_phi, errors)
      call timers%stop(messages)
      if (errors%any()) return
      call timers%start('pull-backs')
      call o%pull()
      call o%resist()
      call timers%stop('pull-backs')
      if (.not. answers%between) return
      call grains%receive(timers, errors)
      if (.not. errors%any()) call read_between(o, grains, errors)
      if (errors%any()) return
      call timers%start('pull-backs')
      call renew_kicks(o)
      call timers%stop('pull-backs')
    end associate
  end subroutine take_forces
end module cpl_overlap_ask
