!> How the equations are solved: by factors, in memory or on disk, or by conjugate gradients.
module fem_setup_solver
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_solver_choice, only: cost_quotient
  use fem_mumps, only: storage_memory, storage_disk
  use fem_solver, only: fem_solver_type
  implicit none
  private
  public :: read_storage, choose_solver

  real(wp), parameter :: few_steps = 10.0_wp
  real(wp), parameter :: in_newton = 1.0e-6_wp  !! residual of equations whose tangent changes

contains

  !> Where factors are kept.
  subroutine read_storage(deck, folder, solver)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: folder  !! of factors on disk, unless the deck names one
    type(fem_solver_type), intent(inout) :: solver
    character(len=:), allocatable :: factors
    call deck%get('analysis', 1, 'factors', factors)
    associate (mumps => solver%mumps)
      if (factors == 'memory') mumps%storage = storage_memory
      if (factors == 'disk') mumps%storage = storage_disk
      mumps%scratch = folder
      if (deck%given('analysis', 1, 'scratch')) &
        mumps%scratch = deck%path('analysis', 1, 'scratch')
    end associate
  end subroutine read_storage

  !> Conjugate gradients for statics of few steps where they cost less, factors otherwise;
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
      if (.not. by_itself) return
      solver%iterative = analysis%iterative .and. .not. (served .or. body%matter%active) .and. &
        analysis%t_end <= few_steps*analysis%dt
      if (.not. solver%iterative) return
      if (body%system%cost_quotient < 0.0_wp) body%system%cost_quotient = &
        cost_quotient(body%mesh, body%elastic, body%supports%held)
      solver%iterative = body%system%cost_quotient > 1.0_wp .and. &
        analysis%t_end <= body%system%cost_quotient*analysis%dt
    end associate
  end subroutine choose_solver
end module fem_setup_solver
