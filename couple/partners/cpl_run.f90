!> What a coupled run passes to its coupling method: deck, both solvers, log, timers, checkpoint.
module cpl_run
  use talus_kinds, only: wp
  use talus_checkpoint, only: checkpoint_type
  use talus_deck, only: deck_type
  use talus_log, only: log_type
  use talus_stop, only: stop_type
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: cpl_run_type

  type :: cpl_run_type
    type(deck_type) :: deck
    type(cpl_choices_type) :: choices
    type(cpl_solver_type) :: solvers(2)
    type(checkpoint_type) :: checkpoint
    type(stop_type) :: stop
    type(timers_type) :: timers
    type(log_type) :: log
    character(len=:), allocatable :: stem   !! path without ending of the run's files
    logical :: dynamic = .false.            !! the solid has inertia
    logical :: again = .false.              !! continues from a checkpoint
    character(len=:), allocatable :: state  !! its file of the coupling's state
    real(wp) :: begins = 0.0_wp             !! its time [s]
  end type cpl_run_type
end module cpl_run
