!> A solver is refused for what the coupled deck needs and it lacks, and for nothing else.
program test_cpl_capabilities
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use cpl_capabilities, only: check_capabilities
  use cpl_choices, only: cpl_choices_type, interface_none, interface_springs, scheme_average, &
    scheme_iterated
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none

  type(test_type) :: test
  type(cpl_solver_type) :: solvers(2)
  type(cpl_choices_type) :: choices

  solvers(side_grains)%program = 'grains'
  solvers(side_grains)%deck = 'grains.nml'
  solvers(side_solid)%program = 'plate'
  solvers(side_solid)%deck = 'plate.toml'
  choices%surface = ''
  choices%interface = interface_none
  choices%scheme = scheme_average
  choices%dead_load = .false.
  call told('advance,prescribe', 'load,solve,rehearsal')
  call lacks('enough for facets', '')
  call told('advance prescribe', 'solve rehearsal load')
  call lacks('with blanks between, in any order', '')
  call told('advances,prescribe', 'load,solve,rehearsal')
  call lacks('a word must be whole', 'advance')
  call told('advance,prescribe', 'load,rehearsal')
  call lacks('a solid that does not solve', 'solve')
  choices%interface = interface_springs
  call told('advance,prescribe', 'load,solve,rehearsal')
  call lacks('springs', 'springs')
  choices%dead_load = .true.
  call told('advance,prescribe', 'load,solve,rehearsal,springs')
  call lacks('a dead load', 'dead_load')
  choices%scheme = scheme_iterated
  call told('advance,prescribe,reject', 'load,solve,rehearsal,springs,dead_load')
  call lacks('iterations', 'reject')
  choices%surface = 'quartz'
  call told('advance,prescribe,reject', 'load,solve,rehearsal,springs,dead_load,reject')
  call lacks('facets that grains touch', 'surface')
  call overlap()
  call test%finish()

contains

  subroutine overlap()
    choices%overlap%given = .true.
    choices%overlap%scheme = 'symmetric'
    call told('report,load,force,kick_drift,prescribe', 'prescribe,load,force,kick_drift')
    call lacks('enough for an overlap', '')
    call told('report,load,force,kick_drift,prescribe', 'prescribe,load,force')
    call lacks('a solid that takes no kicks', 'kick_drift')
    call told('report,load,force,kick_drift', 'prescribe,load,force,kick_drift')
    call lacks('ghosts', 'prescribe')
    choices%overlap%bound = .true.
    call lacks('the bridging domain has none', '')
    choices%overlap%scheme = 'static'
    call lacks('a static overlap', 'solve')
  end subroutine overlap

  subroutine told(grains, solid)
    character(len=*), intent(in) :: grains, solid
    solvers(side_grains)%capabilities = grains
    solvers(side_solid)%capabilities = solid
  end subroutine told

  !> The one word that is lacking, '' for none.
  subroutine lacks(what, word)
    character(len=*), intent(in) :: what, word
    type(error_list_type) :: errors
    call check_capabilities(solvers, choices, errors)
    if (len(word) == 0) then
      call test%check(what, .not. errors%any())
    else if (errors%count == 1) then
      call test%check_text(what, errors%item(1)%code, 'P411')
      call test%check(what//': the word', &
        index(errors%item(1)%message, "capability '"//word//"'") > 0)
    else
      call test%check(what//': one fault', .false.)
    end if
  end subroutine lacks
end program test_cpl_capabilities
