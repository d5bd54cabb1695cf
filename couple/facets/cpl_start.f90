!> initial = 'relax': grains and solid find their balance with the tool at rest before the run.
!!
!! Both solvers rehearse: the grains run exchanges with the driven bodies fixed, the solid is
!! solved for their mean force from its undeformed state, until neither the facets nor the forces
!! change. Then the solid's state becomes its reference: the stress becomes initial
!! stress, what other springs carry as dead load, and displacements count from there.
module cpl_start
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: log_type, short_number
  use talus_message, only: verb_accept, verb_describe, verb_force, verb_reject, verb_set
  use talus_port_names, only: dot_force, dot_moment, field_couple, field_couple_stress, &
    field_force, field_moment, field_phi, field_scope, field_set, field_stress, field_value, &
    field_what, role_load, scope_all, what_dead_load, what_initial_stress, what_quadrature
  use talus_stop, only: stop_type, stop_none
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_exchange, only: advance_grains, solve_solid, automatic_springs, check_stiffness, lead
  use cpl_interface, only: interface_type, node_set
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: relax_together, put_reference

  character(len=*), parameter :: all_set = 'everything'  !! all nodes of the solid
  character(len=*), parameter :: all_turns = 'turns'     !! all its micro-rotations
  integer(i4), parameter :: check_interval = 10_i4        !! exchanges between checks of stiffness

  real(wp), parameter :: unbalanced = 0.05_wp            !! motion in the balance over all motion

contains

  !> Rehearse until grains touch the ghosts and the change of facets and forces in an exchange is
  !! below the tolerance, relative to what they are, or until the number of exchanges is used up.
  !! Both solvers are ready for it.
  subroutine relax_together(face, solvers, choices, log, stop, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    type(log_type), intent(inout) :: log
    type(stop_type), intent(inout) :: stop
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: change(2)  !! of facets, of forces
    integer(i4) :: k
    logical :: settled

    settled = .false.
    do k = 1, choices%relax_exchanges
      call rehearse(face, solvers, choices, k, change, timers, errors)
      if (errors%any()) return
      settled = k > 1 .and. maxval(change) <= choices%relax_tolerance .and. &
        any(abs(face%forces%p_mean) > 0.0_wp)
      if (settled .or. stop%check() /= stop_none) exit
    end do
    k = min(k, choices%relax_exchanges)
    call log%item('relaxed', str(k)//' exchanges', 'last change of the facets '// &
                  short_number(change(1))//', of the forces '//short_number(change(2)))
    if (.not. settled) call log%warn('the start has not settled within '// &
      short_number(choices%relax_tolerance)//' in '//str(k)//" exchanges: raise &facets "// &
      'relax_exchanges, or relax_tolerance if that is close enough')
    call make_reference(face, solvers(side_solid), timers, errors)
    if (errors%any()) return
    call log%item('moved meanwhile', &
      short_number(sqrt(maxval(sum((face%place%x_start - face%place%x_ref)**2, 1))))//' m', &
      'the ghosts at most; displacements count from there')
    call log%item('balance', short_number(sqrt(maxval(sum(face%motion%u_new**2, 1))))//' m', &
                  'that the solid moves on under the same forces')
    if (settled .and. relative(face%motion%u_new, face%place%u_start) > unbalanced) &
      call errors%add('N408', 'the relaxed solid moves by '// &
                      str(relative(face%motion%u_new, face%place%u_start))// &
                      ' of what it has moved', solvers(side_solid)%deck, &
                      'it carries something at the start that is '// &
                      "neither stress nor force on nodes: write initial = 'dead_load'")
  end subroutine relax_together

  !> One exchange of the rehearsal; relative changes of facets and forces in it.
  subroutine rehearse(face, solvers, choices, k, change, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: change(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: p_before(face%transfer%rows, face%map%ghosts), u_before(3, face%transfer%blocks), t1

    change = 0.0_wp
    u_before = face%motion%u_new
    p_before = face%forces%p_mean
    call face%follow_facets()
    t1 = k*choices%exchange
    call advance_grains(face, solvers(side_grains), (k - 1)*choices%exchange, t1, timers, errors)
    if (.not. errors%any()) call send_verb(solvers(side_grains), verb_accept, timers, errors)
    if (errors%any()) return
    call face%lay_springs(lead(face))
    call face%keep_rehearsed()
    call solve_solid(face, solvers(side_solid), k, 0.0_wp, 0.0_wp, timers, errors)
    if (errors%any()) return
    change(1) = relative(face%motion%u_new - u_before, face%motion%u_new)
    change(2) = relative(face%forces%p_mean(:3, :) - p_before(:3, :), face%forces%p_mean(:3, :))
    if (automatic_springs(face, choices) .and. mod(k, check_interval) == 0) &
      call check_stiffness(face, solvers, t1, .false., timers, errors)
  end subroutine rehearse

  pure real(wp) function relative(change, whole)
    real(wp), intent(in) :: change(:, :), whole(:, :)
    relative = 0.0_wp
    if (maxval(abs(change)) > 0.0_wp) relative = sqrt(maxval(sum(change**2, 1)) &
      /max(maxval(sum(whole**2, 1)), tiny(1.0_wp)))
  end function relative

  subroutine send_verb(solver, verb, timers, errors)
    type(cpl_solver_type), intent(inout) :: solver
    integer(i4), intent(in) :: verb
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solver%start_request(verb, 0_i8, solver%time, solver%time)
    call solver%ask(timers, errors)
  end subroutine send_verb

  !> The solid's trial state becomes its reference; then it is solved once more under the same
  !! forces and must stay where it is.
  subroutine make_reference(face, solid, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: with_motion(:, :), without(:, :), with_turns(:, :), still(:, :)

    face%place%u_start = face%motion%w
    call solid%start_request(verb_describe, 0_i8, 0.0_wp, 0.0_wp)
    call solid%request%put_text(field_what, what_quadrature)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%take(field_stress, face%start%start_stress, errors)
    if (solid%reply%has(field_couple_stress)) &
      call solid%reply%take(field_couple_stress, face%start%start_couple, errors)
    call choose_nodes(face, solid, .true., timers, errors)
    call forces_now(face, solid, with_motion, with_turns, timers, errors)
    if (.not. errors%any()) call send_verb(solid, verb_reject, timers, errors)
    if (.not. errors%any()) call put_stress(face, solid, timers, errors)
    call forces_now(face, solid, without, still, timers, errors)
    if (errors%any()) return
    face%start%start_load = with_motion - without
    face%start%start_moment = with_turns - still
    call put_load(face, solid, timers, errors)
    if (errors%any()) return
    face%motion%w_spring = 0.0_wp
    call solve_solid(face, solid, 1_i4, 0.0_wp, 0.0_wp, timers, errors)
    if (.not. errors%any()) call send_verb(solid, verb_accept, timers, errors)
    face%motion%w = 0.0_wp
    call face%resume()
  end subroutine make_reference

  !> After a restart: the same reference again, before READY.
  subroutine put_reference(face, solid, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call put_stress(face, solid, timers, errors)
    call choose_nodes(face, solid, .true., timers, errors)
    if (.not. errors%any()) call put_load(face, solid, timers, errors)
  end subroutine put_reference

  !> SELECT all nodes of the solid and all its micro-rotations, or one of each.
  subroutine choose_nodes(face, solid, all, timers, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: all
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: k
    if (errors%any()) return
    call solid%start_select(0_i8, all_set, role_load, &
                            [(k, k=1, merge(int(face%place%all_nodes, i8), 1_i8, all))])
    call solid%ask(timers, errors)
    if (size(face%place%polar_id) == 0 .or. errors%any()) return
    call solid%start_select(0_i8, all_turns, role_load, &
                            face%place%polar_id(:merge(size(face%place%polar_id), 1, all)), &
                            field_phi)
    call solid%ask(timers, errors)
  end subroutine choose_nodes

  !> FORCE on all nodes [N], and moments on all micro-rotations [N m], in the present (trial) state.
  subroutine forces_now(face, solid, force, moment, timers, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), allocatable, intent(out) :: force(:, :), moment(:, :)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    allocate (force(3, face%place%all_nodes), moment(3, size(face%place%polar_id)), source=0.0_wp)
    if (errors%any()) return
    call solid%start_request(verb_force, 0_i8, 0.0_wp, 0.0_wp)
    call solid%request%put_text(field_scope, scope_all)
    call solid%ask(timers, errors)
    if (.not. errors%any()) call solid%reply%get(all_set//dot_force, force, errors)
    if (size(face%place%polar_id) > 0 .and. .not. errors%any()) &
      call solid%reply%get(all_turns//dot_moment, moment, errors)
  end subroutine forces_now

  subroutine put_stress(face, solid, timers, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solid%start_request(verb_set, 0_i8, solid%time, solid%time)
    call solid%request%put_text(field_what, what_initial_stress)
    call solid%request%put(field_value, face%start%start_stress)
    if (allocated(face%start%start_couple)) call solid%request%put(field_couple, &
      face%start%start_couple)
    call solid%ask(timers, errors)
  end subroutine put_stress

  !> SET the dead loads; afterwards the sets of all nodes shrink to one, so that replies stay short.
  subroutine put_load(face, solid, timers, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solid%start_request(verb_set, 0_i8, solid%time, solid%time)
    call solid%request%put_text(field_what, what_dead_load)
    call solid%request%put_text(field_set, all_set)
    call solid%request%put(field_force, face%start%start_load)
    call solid%ask(timers, errors)
    if (size(face%place%polar_id) > 0 .and. .not. errors%any()) then
      call solid%start_request(verb_set, 0_i8, solid%time, solid%time)
      call solid%request%put_text(field_what, what_dead_load)
      call solid%request%put_text(field_set, all_turns)
      call solid%request%put(field_moment, face%start%start_moment)
      call solid%ask(timers, errors)
    end if
    call choose_nodes(face, solid, .false., timers, errors)
  end subroutine put_load
end module cpl_start
