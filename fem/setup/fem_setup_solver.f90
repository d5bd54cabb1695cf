!> How the equations are solved: by factors, in memory or on disk, or by iterations.
module fem_setup_solver
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_solver_choice, only: estimate_costs
  use fem_mumps, only: storage_memory, storage_disk
  use fem_solver, only: fem_solver_type
  implicit none
  private
  public :: read_storage, choose_solver

  real(wp), parameter :: few_steps = 10.0_wp
  real(wp), parameter :: in_newton = 1.0e-6_wp  !! residual of equations whose tangent changes

contains

  !> Where factors are kept, and which ranks make them.
  subroutine read_storage(deck, folder, served, solver)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: folder  !! of factors on disk, unless the deck names one
    logical, intent(in) :: served           !! a partner drives the run
    type(fem_solver_type), intent(inout) :: solver
    character(len=:), allocatable :: factors, who
    call deck%get('analysis', 1, 'factors', factors)
    call deck%get('analysis', 1, 'factor_ranks', who)
    solver%mumps%by_leader = who == 'first' .or. (who == 'auto' .and. served)
    associate (mumps => solver%mumps)
      if (factors == 'memory') mumps%storage = storage_memory
      if (factors == 'disk') mumps%storage = storage_disk
      mumps%scratch = folder
      if (deck%given('analysis', 1, 'scratch')) &
        mumps%scratch = deck%path('analysis', 1, 'scratch')
    end associate
  end subroutine read_storage

  !> What costs least for statics: conjugate gradients, multigrid or factors;
  !! `by_itself` is true that the deck leaves the choice open. The estimate is made once, before
  !! ranks keep their own elements alone: all choose alike.
  subroutine choose_solver(deck, body, analysis, served, by_itself)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    class(fem_analysis_type), intent(in) :: analysis
    logical, intent(in) :: served
    logical, intent(out) :: by_itself
    character(len=:), allocatable :: choice
    call deck%get('analysis', 1, 'solver', choice)
    by_itself = choice == 'auto'
    associate (solver => body%system%solver)
      solver%by_multigrid = choice == 'multigrid'
      solver%iterative = choice == 'iterative' .or. solver%by_multigrid
      if (body%matter%active) then
        solver%tolerance = in_newton
      else if (solver%iterative .and. deck%given('analysis', 1, 'tolerance')) then
        call deck%get('analysis', 1, 'tolerance', solver%tolerance)
      end if
      solver%by_choice = by_itself
      if (.not. by_itself) return
      solver%iterative = may_iterate(body, analysis) .and. .not. served
      if (.not. solver%iterative) return
      if (body%system%cost_quotient < 0.0_wp) call estimate_costs(body%mesh, body%elastic, &
        body%supports%held, body%matter%active, body%system%cost_quotient, &
        body%system%multigrid_is_less)
      solver%iterative = body%system%cost_quotient > 1.0_wp .and. (body%matter%active .or. &
        analysis%t_end <= body%system%cost_quotient*analysis%dt)
      solver%by_multigrid = solver%iterative .and. body%system%multigrid_is_less
    end associate
  end subroutine choose_solver

  !> Statics: of linear solids in few steps, which factors would share, or of laws with a state.
  pure logical function may_iterate(body, analysis)
    type(fem_body_type), intent(in) :: body
    class(fem_analysis_type), intent(in) :: analysis
    may_iterate = analysis%iterative .and. .not. (body%matter%micro%active .or. body%pore%active)
    if (.not. body%matter%active) &
      may_iterate = may_iterate .and. analysis%t_end <= few_steps*analysis%dt
  end function may_iterate
end module fem_setup_solver
