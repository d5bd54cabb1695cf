!> How much liquid a solid takes across its facets in an interval for a pressure: it is asked
!! itself, by trials that are rejected.
!!
!! The grid's side gives way by this conductance, and springs as stiff as the liquid that it stands
!! for hold the facets: what they would give way by has then no part in it. With less conductance
!! and stiffer springs the exchange stays stable; with more it does not. eqs. C.45, C.46
module cpl_pore_probe
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_message, only: verb_reject, verb_solve
  use talus_port_names, only: dot_fluid_in, dot_force, dot_moment, dot_p, field_trial
  use cpl_choices, only: interface_springs
  use cpl_exchange, only: set_springs
  use cpl_interface, only: interface_type, node_set, phi_set
  use cpl_pore, only: hull_set, row_of, to_facets, wet_set
  use cpl_run, only: cpl_run_type
  use cpl_solver, only: cpl_solver_type, side_solid
  implicit none
  private
  public :: find_conductance, least_answer

  real(wp), parameter :: share = 0.8_wp    !! of what the solid takes, to be on the safe side
  integer(i4), parameter :: trials = 3     !! each with springs by the answer before
  real(wp), parameter :: locked = 10.0_wp  !! these springs over those of the run
  real(wp), parameter :: push = 1.0e3_wp   !! pressure of that estimate in the trial [Pa]

contains

  !> Conductance of the grid's side and springs of the liquid, of a run that begins (N234).
  subroutine find_conductance(face, run, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(face%pore%wet%nodes) :: area, volume, rest, pushed
    real(wp) :: guess, nodal(1, face%pore%wet%nodes), span
    integer(i4) :: trial

    associate (link => face%pore, solid => run%solvers(side_solid))
      if (.not. (link%active .and. link%permeable .and. link%yields)) return
      nodal = to_facets(link%wet, row_of(link%area))
      area = nodal(1, :)
      span = run%choices%exchange/face%pieces%most
      guess = link%estimate
      do trial = 1, trials
        call hold_facets(face, locked/guess, run, errors)
        volume = push*guess*area
        if (.not. errors%any()) &
          call try_volume(face, solid, 0.0_wp*volume, span, rest, run, errors)
        if (.not. errors%any()) call try_volume(face, solid, volume, span, pushed, run, errors)
        if (errors%any()) return
        guess = least_answer(volume/area, pushed - rest)
        if (guess > 0.0_wp .and. guess < huge(1.0_wp)) cycle
        call errors%add('N234', 'liquid that enters the facets raises no pressure there', &
                        'trial before the first exchange', "take scheme = 'reaction' in "// &
                        '&pore_interface, or open no facets where a pressure is held')
        return
      end do
      guess = share*guess
      link%conduct = guess*link%area
      call hold_facets(face, 1.0_wp/guess, run, errors)
    end associate
  end subroutine find_conductance

  !> The least volume by pressure of nodes that answer [m/Pa]; 0: none does.
  pure real(wp) function least_answer(volume, rise)
    real(wp), intent(in) :: volume(:)  !! by area [m]
    real(wp), intent(in) :: rise(:)    !! of the pressure [Pa]
    least_answer = 0.0_wp
    if (any(rise > 0.0_wp)) least_answer = minval(volume/rise, mask=rise > 0.0_wp)
  end function least_answer

  !> Springs of the ghosts with the liquid's, which have this stiffness by area [Pa/m].
  subroutine hold_facets(face, stiffness, run, errors)
    type(interface_type), intent(inout) :: face
    real(wp), intent(in) :: stiffness
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    if (run%choices%interface /= interface_springs) return
    face%pore%stiffness = stiffness*sum(face%pore%area)/face%map%ghosts
    face%springs%liquid = face%pore%stiffness
    call face%springs%make(face%springs%stiffness, face%map, face%transfer, face%place%radius)
    call set_springs(face, run%solvers(side_solid), run%solvers(side_solid)%time, run%timers, &
                     errors)
  end subroutine hold_facets

  !> Pressures after an interval in which these volumes enter and nothing else is exchanged.
  subroutine try_volume(face, solid, volume, span, p, run, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    real(wp), intent(in) :: volume(:), span  !! (c) [m^3], [s]
    real(wp), intent(out) :: p(:)            !! (c) [Pa]
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: n
    n = face%transfer%blocks - face%map%nodes
    call solid%start_request(verb_solve, face%step, solid%time, solid%time + span)
    call solid%request%put(node_set//dot_force, spread([0.0_wp, 0.0_wp, 0.0_wp], 2, &
                                                       face%map%nodes))
    if (n > 0) call solid%request%put(phi_set//dot_moment, spread([0.0_wp, 0.0_wp, 0.0_wp], 2, n))
    call solid%request%put(hull_set//dot_force, spread([0.0_wp, 0.0_wp, 0.0_wp], 2, &
                                                       face%pore%hull%nodes))
    call solid%request%put(wet_set//dot_fluid_in, volume)
    call solid%request%put_int(field_trial, 1_i4)
    call solid%ask(run%timers, errors)
    if (errors%any()) return
    call solid%reply%get(wet_set//dot_p, p, errors)
    call solid%start_request(verb_reject, face%step, solid%time, solid%time + span)
    if (.not. errors%any()) call solid%ask(run%timers, errors)
  end subroutine try_volume
end module cpl_pore_probe
