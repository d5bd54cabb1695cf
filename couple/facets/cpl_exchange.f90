!> One exchange: the grains run the interval, the solid answers, both are accepted.
module cpl_exchange
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: verb_advance, verb_solve, verb_accept, verb_reject, verb_select, &
    verb_set, verb_kick_drift
  use talus_port_names, only: dot_a, dot_force, dot_impulse, dot_moment, dot_moment_impulse, &
    dot_phi, dot_phi_acceleration, dot_phi_rate, dot_quat, dot_u, dot_v, dot_work, dot_x, &
    field_drift, field_final, field_iterations, field_kick, field_mass, field_node, &
    field_node_phi, field_scalars, field_stiffness, field_stiffness_phi, field_substeps, &
    field_trial, field_weight, field_weight_phi, field_what, what_springs
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type, scheme_average, scheme_iterated, scheme_state, &
    scheme_symmetric, interface_springs
  use cpl_interface, only: interface_type, select_ghosts, ghost_set, node_set, phi_set
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: exchange, set_springs, read_forces, read_motion, advance_grains, solve_solid
  public :: automatic_springs, check_stiffness, lead, note_kicks

  real(wp), parameter :: raise = 1.5_wp           !! springs over contact stiffness
  integer(i8), parameter :: check_interval = 50_i8    !! exchanges between checks of the stiffness
  real(wp), parameter :: growth = 1.5_wp          !! of the largest force that triggers a check
  integer(i4), parameter :: patience = 2          !! checks at which it must be exceeded

contains

  !> From t0 to t1 [s], in as many pieces as the force lag asks for.
  subroutine exchange(face, solvers, choices, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: begin, end, lag, longer
    integer(i4) :: k

    lag = 0.0_wp
    end = t0
    do k = 1, face%pieces%now
      begin = end
      end = t1
      if (k < face%pieces%now) end = t0 + k*(t1 - t0)/face%pieces%now
      call one_piece(face, solvers, choices, begin, end, timers, errors)
      if (errors%any()) return
      lag = lag + face%ledger%lag
    end do
    call face%count_exchange()
    if (face%pieces%most > 1) then
      face%ledger%lag = lag/face%pieces%now
      call face%pieces%choose(face%ledger%lag, longer)
      face%motion%drift = longer*face%motion%drift
    end if
    if (.not. (automatic_springs(face, choices) .or. face%kicks%active)) return
    if (mod(face%step, check_interval) == 0 .or. face%watch%outgrown > 0 .or. &
        maxval(abs(face%forces%p_end)) > growth*face%watch%force_at_check) then
      if (face%kicks%active) then
        call ask_stiffness(face, solvers(side_grains), t1, timers, errors)
        call note_kicks(face)
      else
        call check_stiffness(face, solvers, t1, .false., timers, errors)
      end if
    end if
  end subroutine exchange

  !> After a fault nothing of it was accepted.
  subroutine one_piece(face, solvers, choices, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    if (choices%scheme == scheme_state) then
      call step_with_state(face, solvers, t0, t1, timers, errors)
    else if (choices%scheme == scheme_symmetric) then
      call step_symmetric(face, solvers, t0, t1, timers, errors)
    else
      call step_with_mean(face, solvers, choices, t0, t1, timers, errors)
    end if
    if (errors%any()) return
    call accept_both(solvers, choices, face%step, t0, t1, timers, errors)
    if (errors%any()) return
    call face%accept(t1 - t0)
  end subroutine one_piece

  !> Springs whose stiffness the deck does not give.
  pure logical function automatic_springs(face, choices)
    type(interface_type), intent(in) :: face
    type(cpl_choices_type), intent(in) :: choices
    automatic_springs = face%relax%method == interface_springs .and. &
      .not. choices%stiffness > 0.0_wp
  end function automatic_springs

  !> Grains on a predicted motion, then the solid with their mean force; iterated: until the ghosts
  !! end where the facets do.
  subroutine step_with_mean(face, solvers, choices, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: gap, moved, gap_before
    integer(i4) :: trial

    gap_before = huge(1.0_wp)
    call face%predict(t1 - t0)
    do trial = 1, choices%max_iterations
      face%ledger%iterations = trial
      call advance_grains(face, solvers(side_grains), t0, t1, timers, errors)
      if (errors%any()) return
      if (choices%scheme == scheme_average) then
        call lay_springs_for_mean(face)
      else
        call face%lay_springs()
      end if
      call solve_solid(face, solvers(side_solid), trial, t0, t1, timers, errors)
      if (errors%any() .or. choices%scheme == scheme_average) exit
      gap = face%gap()
      moved = sqrt(maxval(sum((face%motion%d_new(:3, :) - face%motion%d(:3, :))**2, 1)))
      if (gap <= choices%tolerance*max(moved, least_motion(face)) .and. &
          face%settled(choices%tolerance)) exit
      if (trial == choices%max_iterations) then
        call errors%add('N406', 'ghosts and facets differ by '//str(gap)//' m after '// &
                        str(trial)//' iterations, in which they move by '//str(moved)//' m', &
                        'exchange from '//str(t0)//' s to '//str(t1)//' s', &
                        "shorten &clock exchange, use interface = 'aitken' or 'springs', or "// &
                        'raise max_iterations')
        return
      end if
      if (automatic_springs(face, choices) .and. gap > gap_before) &
        call check_stiffness(face, solvers, t1, .true., timers, errors)
      gap_before = gap
      if (.not. errors%any()) &
        call reject_both(solvers, face%step, t0, t1, timers, errors)
      if (errors%any()) return
      call face%follow_facets()
    end do
    if (errors%any()) return
    if (use_midpoint(face)) face%forces%p_put = 2.0_wp*face%relax%held - face%forces%p_put
  end subroutine step_with_mean

  !> Springs ahead of the ghosts, as far as is stable. In the first of pieces of another length
  !! ghosts still move as in those of before.
  subroutine lay_springs_for_mean(face)
    type(interface_type), intent(inout) :: face
    if (.not. face%pieces%changed) call face%mean_motion()
    face%pieces%changed = .false.
    if (follows_drift(face)) then
      call face%lay_springs_ahead()
    else
      call face%lay_springs(lead(face))
    end if
  end subroutine lay_springs_for_mean

  !> May springs be laid ahead by the whole steady motion? On a scalar model of a static solid that
  !! is stable for contacts up to 1.85 times as stiff as the springs.
  pure logical function follows_drift(face)
    type(interface_type), intent(in) :: face
    real(wp), parameter :: most = 1.5_wp  !! contact stiffness over that of the springs
    follows_drift = face%watch%contact_stiffness <= most*(face%springs%stiffness + &
                                                          face%springs%liquid) .and. &
                    face%is_steady() .and. .not. face%dynamic
  end function follows_drift

  !> How far ahead of the ghosts the springs are laid, in motions of the last interval, so that they
  !! hold back a steady motion as little as they can. On a scalar model with contact stiffness k and
  !! spring stiffness s the exchange is stable for lead < 1 - k/(2 s).
  pure real(wp) function lead(face)
    type(interface_type), intent(in) :: face
    real(wp), parameter :: share = 0.6_wp     !! of what is stable
    real(wp), parameter :: least = -0.5_wp    !! at the mean of the interval: stable for k < 3 s
    lead = 0.0_wp
    if (face%springs%n == 0) return
    lead = max(least, share*(1.0_wp - 0.5_wp*face%watch%contact_stiffness/face%springs%each(1)))
    if (face%dynamic) lead = 0.0_wp
  end function lead

  !> Motion below which the convergence of an iteration is not checked [m].
  pure real(wp) function least_motion(face)
    type(interface_type), intent(in) :: face
    real(wp), parameter :: share = 1.0e-9_wp  !! of the extent of the facets
    least_motion = share*maxval(maxval(face%place%x_node, 2) - minval(face%place%x_node, 2))
  end function least_motion

  !> An implicit dynamic solid uses the mean of its loads at t0 and t1: to apply the mean force
  !! of the interval, the load at t1 is twice the mean less the load at t0 (exact momentum). An
  !! explicit one holds its loads over the interval.
  pure logical function use_midpoint(face)
    type(interface_type), intent(in) :: face
    use_midpoint = face%dynamic .and. .not. face%explicit .and. &
      face%relax%method /= interface_springs
  end function use_midpoint

  !> The solid steps with the force at t0, then the grains follow its motion. A dynamic solid takes
  !! the mean force of the interval as the last two forces foretell it.
  subroutine step_with_state(face, solvers, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    face%ledger%iterations = 1
    call face%forces%foretell(face%dynamic)
    call solve_solid(face, solvers(side_solid), 1_i4, t0, t1, timers, errors)
    if (errors%any()) return
    if (use_midpoint(face)) face%forces%p_put = 2.0_wp*face%relax%held - face%forces%p_put
    call face%follow_facets()
    call advance_grains(face, solvers(side_grains), t0, t1, timers, errors)
  end subroutine step_with_state

  !> The solid gets half the impulse of the forces at t0 and goes to t1 by its own steps, the grains
  !! follow its motion, and the rest of their impulse comes at t1. Loads that balance the forces of
  !! the start come with the kicks: what is at rest is not kicked.
  !! eq. C.56
  subroutine step_symmetric(face, solvers, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, face%map%nodes) :: first, rest

    face%ledger%iterations = 1
    face%kicks%work = 0.0_wp
    call face%transfer%to_nodes(face%forces%p_end, first)
    first = 0.5_wp*(t1 - t0)*(first + face%start%dead_load)
    call face%kicks%add_work(first, face%motion%v)
    call kick_solid(face, solvers(side_solid), verb_advance, first, [t0, t1], timers, errors)
    if (errors%any()) return
    call face%follow_facets()
    call advance_grains(face, solvers(side_grains), t0, t1, timers, errors)
    if (errors%any()) return
    call face%relax%force(face%forces%p_mean)
    call face%transfer%to_nodes(face%forces%p_mean, rest)
    rest = (t1 - t0)*(rest + face%start%dead_load) - first
    call face%kicks%add_work(rest, face%motion%v_new)
    call kick_solid(face, solvers(side_solid), verb_kick_drift, rest, [t1, t1], timers, errors)
  end subroutine step_symmetric

  !> ADVANCE after a kick of the interface nodes, or KICK_DRIFT for the kick alone.
  subroutine kick_solid(face, solid, verb, push, span, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    integer(i4), intent(in) :: verb
    real(wp), intent(in) :: push(:, :)  !! (3, nodes) [N s]
    real(wp), intent(in) :: span(2)     !! from and to [s]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    call solid%start_request(verb, face%step, span(1), span(2))
    call solid%request%put(node_set//dot_impulse, push)
    if (verb == verb_kick_drift) then
      call solid%request%put(field_kick, 0.0_wp)
      call solid%request%put(field_drift, 0.0_wp)
    end if
    call solid%ask(timers, errors)
    if (errors%any()) return
    call read_solid(face, solid, errors)
    if (verb == verb_advance) call solid%reply%get_int(field_substeps, face%kicks%substeps, errors)
    call solid%reply%all_read(errors)
    if (.not. errors%any()) call check_motion(face, span(1), span(2), errors)
  end subroutine kick_solid

  !> N407: a displacement is no number.
  subroutine check_motion(face, t0, t1, errors)
    type(interface_type), intent(in) :: face
    real(wp), intent(in) :: t0, t1
    type(error_list_type), intent(inout) :: errors
    if (face%finite()) return
    call errors%add('N407', 'a displacement of the interface is no number', &
                    'exchange from '//str(t0)//' s to '//str(t1)//' s', &
                    'check the log of the solid')
  end subroutine check_motion

  !> ADVANCE: ghosts go to d_new in a straight line; mean and end forces come back.
  subroutine advance_grains(face, grains, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: grains
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, face%map%ghosts) :: impulse, moment_impulse
    integer(i4) :: substeps

    call grains%start_request(verb_advance, face%step, t0, t1)
    call grains%request%put(ghost_set//dot_x, face%place%x_start + face%motion%d_new(:3, :))
    if (face%transfer%rows > 3) call grains%request%put(ghost_set//dot_quat, face%motion%quat_new)
    call face%pore%put_grains(grains%request, t1 - t0)
    call grains%ask(timers, errors)
    if (errors%any()) return
    associate (reply => grains%reply)
      call read_forces(face, grains, face%forces%p_end, errors)
      call reply%get(ghost_set//dot_impulse, impulse, errors)
      moment_impulse = 0.0_wp
      if (len(face%place%material) == 0) &
        call reply%get(ghost_set//dot_moment_impulse, moment_impulse, errors)
      call reply%get(ghost_set//dot_work, face%ledger%step_work, errors)
      call reply%get(field_scalars, face%ledger%grains_new, errors)
      call reply%get_int(field_substeps, substeps, errors)
      call face%pore%read_grains(reply, errors)
      call reply%all_read(errors)
    end associate
    if (errors%any()) return
    call face%forces%average(impulse, moment_impulse, t1 - t0)
    if (face%finite()) return
    call errors%add('N407', 'a force on a ghost is no number', &
      'exchange from '//str(t0)//' s to '// &
                    str(t1)//' s', 'the grains have become unstable: check their step limit')
  end subroutine advance_grains

  !> Forces and, with rotation, moments on the ghosts now, from a reply of the grains.
  subroutine read_forces(face, grains, p, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: grains
    real(wp), intent(out) :: p(:, :)  !! (rows, ghosts)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: part(3, face%map%ghosts)
    call grains%reply%get(ghost_set//dot_force, part, errors)
    p(:3, :) = part
    if (len(face%place%material) > 0) return
    call grains%reply%get(ghost_set//dot_moment, part, errors)
    if (face%transfer%rows > 3) p(4:, :) = part
  end subroutine read_forces

  !> SOLVE, of an explicit solid ADVANCE, with N'P; the springs are laid at w_spring.
  subroutine solve_solid(face, solid, trial, t0, t1, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    integer(i4), intent(in) :: trial
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, face%transfer%blocks) :: nodal, pull
    integer(i4) :: iterations

    call face%relax%force(face%forces%p_mean)
    if (use_midpoint(face)) then
      call face%transfer%to_nodes(2.0_wp*face%relax%held - face%forces%p_put, nodal)
    else
      call face%transfer%to_nodes(face%relax%held, nodal)
    end if
    if (face%springs%n > 0) then
      call face%springs%force(face%motion%w_spring - face%motion%u, pull)
      nodal = nodal + pull
    end if
    call solid%start_request(merge(verb_advance, verb_solve, face%explicit), face%step, t0, t1)
    call solid%request%put(node_set//dot_force, nodal(:, :face%map%nodes))
    if (face%transfer%blocks > face%map%nodes) &
      call solid%request%put(phi_set//dot_moment, nodal(:, face%map%nodes + 1:))
    if (.not. face%explicit) call solid%request%put_int(field_trial, trial)
    call face%pore%put_solid(solid%request)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call read_solid(face, solid, errors)
    if (face%explicit) then
      call solid%reply%get_int(field_substeps, face%kicks%substeps, errors)
    else
      call solid%reply%get_int(field_iterations, iterations, errors)
    end if
    if (.not. allocated(face%start%start_load)) call solid%reply%all_read(errors)
    if (.not. errors%any()) call check_motion(face, t0, t1, errors)
  end subroutine solve_solid

  !> Motion of the interface nodes and scalars from a reply of the solid.
  subroutine read_solid(face, solid, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(error_list_type), intent(inout) :: errors
    call read_motion(face, solid, face%motion%u_new, face%motion%v_new, errors)
    call solid%reply%get(field_scalars, face%ledger%solid_new, errors)
    call face%pore%read_solid(solid%reply, errors)
  end subroutine read_solid

  !> Displacements, micro-rotations and their rates from a reply of the solid.
  subroutine read_motion(face, solid, u, v, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(inout) :: u(:, :)  !! (3, blocks) [m, rad]
    real(wp), intent(inout) :: v(:, :)  !! (3, blocks) [m/s, rad/s]
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, face%map%nodes) :: at, rate, unused
    real(wp), dimension(3, size(face%transfer%phi_id)) :: turn, turn_rate, unused_phi

    call solid%reply%get(node_set//dot_u, at, errors)
    call solid%reply%get(node_set//dot_v, rate, errors)
    call solid%reply%get(node_set//dot_a, unused, errors)
    if (errors%any()) return
    u(:, :face%map%nodes) = at
    v(:, :face%map%nodes) = rate
    if (face%transfer%blocks == face%map%nodes) return
    call solid%reply%get(phi_set//dot_u, unused_phi, errors)
    call solid%reply%get(phi_set//dot_v, unused_phi, errors)
    call solid%reply%get(phi_set//dot_a, unused_phi, errors)
    call solid%reply%get(phi_set//dot_phi, turn, errors)
    call solid%reply%get(phi_set//dot_phi_rate, turn_rate, errors)
    call solid%reply%get(phi_set//dot_phi_acceleration, unused_phi, errors)
    if (errors%any()) return
    u(:, face%map%nodes + 1:) = turn
    v(:, face%map%nodes + 1:) = turn_rate
  end subroutine read_motion

  !> ACCEPT to both. Grains of which no interval is repeated need no copy of their state.
  subroutine accept_both(solvers, choices, step, t0, t1, timers, errors)
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    integer(i8), intent(in) :: step
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, 2
      call solvers(k)%start_request(verb_accept, step, t0, t1)
    end do
    if (choices%scheme /= scheme_iterated) &
      call solvers(side_grains)%request%put_int(field_final, 1_i4)
    call ask_both(solvers, timers, errors)
  end subroutine accept_both

  subroutine reject_both(solvers, step, t0, t1, timers, errors)
    type(cpl_solver_type), intent(inout) :: solvers(2)
    integer(i8), intent(in) :: step
    real(wp), intent(in) :: t0, t1
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solvers(side_grains)%start_request(verb_reject, step, t0, t1)
    call solvers(side_solid)%start_request(verb_reject, step, t0, t1)
    call ask_both(solvers, timers, errors)
  end subroutine reject_both

  !> Both are asked before either is read.
  subroutine ask_both(solvers, timers, errors)
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, 2
      call solvers(k)%send(timers, errors)
    end do
    do k = 1, 2
      if (.not. errors%any()) call solvers(k)%receive(timers, errors)
    end do
  end subroutine ask_both

  !> Ask how stiff the ghosts' contacts are now; raise the springs when they were outgrown twice,
  !! or at once.
  subroutine check_stiffness(face, solvers, time, at_once, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    real(wp), intent(in) :: time  !! s
    logical, intent(in) :: at_once
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    call ask_stiffness(face, solvers(side_grains), time, timers, errors)
    if (errors%any()) return
    if (face%watch%contact_stiffness <= face%springs%stiffness) then
      face%watch%outgrown = 0
      return
    end if
    face%watch%outgrown = face%watch%outgrown + 1
    if (face%watch%outgrown < patience .and. face%springs%stiffness > 0.0_wp &
      .and. .not. at_once) return
    call face%springs%make(raise*face%watch%contact_stiffness, face%map, face%transfer, &
      face%place%radius)
    face%watch%outgrown = 0
    face%watch%refactored = face%watch%refactored + 1
    call set_springs(face, solvers(side_solid), time, timers, errors)
  end subroutine check_stiffness

  !> How stiff are the ghosts' contacts now?
  subroutine ask_stiffness(face, grains, time, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: grains
    real(wp), intent(in) :: time  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: mass(face%map%ghosts), stiffness(face%map%ghosts)

    call grains%start_request(verb_select, face%step, time, time)
    call select_ghosts(face, grains%request)
    call grains%ask(timers, errors)
    if (errors%any()) return
    call grains%reply%get(field_mass, mass, errors)
    call grains%reply%get(field_stiffness, stiffness, errors)
    call grains%reply%all_read(errors)
    if (errors%any()) return
    call face%watch%note_stiffness(stiffness)
    call face%watch%note_force(face%forces%p_end)
  end subroutine ask_stiffness

  !> Stiffness of the contacts at the nodes, by which kicks are limited.
  subroutine note_kicks(face)
    type(interface_type), intent(inout) :: face
    real(wp) :: p(face%transfer%rows, face%map%ghosts), nodal(3, face%transfer%blocks)
    if (.not. allocated(face%watch%stiffness)) return
    p = 0.0_wp
    p(1, :) = face%watch%stiffness
    call face%transfer%to_nodes(p, nodal)
    call face%kicks%note_rate(nodal(1, :))
  end subroutine note_kicks

  !> Put the springs on the facets of the solid.
  subroutine set_springs(face, solid, time, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: time  !! s
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: node(size(face%springs%node, 1), face%springs%n), ids(face%transfer%blocks)
    integer(i4) :: k, n

    ids = [face%map%node_id, face%transfer%phi_id]
    do k = 1, face%springs%n
      node(:, k) = ids(face%springs%node(:, k))
    end do
    n = face%springs%n - face%springs%turning
    call solid%start_request(verb_set, face%step, time, time)
    call solid%request%put_text(field_what, what_springs)
    call solid%request%put_int(field_node, node(:, :n))
    call solid%request%put(field_weight, face%springs%weight(:, :n))
    call solid%request%put(field_stiffness, face%springs%each(:n))
    if (face%springs%turning > 0) then
      call solid%request%put_int(field_node_phi, node(:, n + 1:))
      call solid%request%put(field_weight_phi, face%springs%weight(:, n + 1:))
      call solid%request%put(field_stiffness_phi, face%springs%each(n + 1:))
    end if
    call solid%ask(timers, errors)
  end subroutine set_springs
end module cpl_exchange
