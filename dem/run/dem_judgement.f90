!> Health of a run of talus-dem; what the figures and their limits mean stands in the manual
!! (running, Health). Deep overlaps, runaway energy and missed contacts end a run at once (N201,
!! N202, N209).
module dem_judgement
  use talus_kinds, only: wp
  use talus_health, only: health_type
  use dem_histories, only: relative_closure
  use dem_state, only: mode_relaxation
  use dem_run_state, only: dem_run_state_type
  implicit none
  private
  public :: judge_health

  real(wp), parameter :: none = huge(1.0_wp)
  real(wp), parameter :: energy_limits(2) = [1.0e-2_wp, 1.0e-1_wp]  !! closure over turnover
  real(wp), parameter :: overlap_limits(2) = [0.1_wp, none]         !! over the least semi-axis
  real(wp), parameter :: late_limits(2) = [0.0_wp, none]            !! late rebuilds
  real(wp), parameter :: unstable_limits(2) = [0.0_wp, 0.1_wp]      !! of the checks of the step
  real(wp), parameter :: check_steps = 100.0_wp                     !! between these

contains

  !> All figures of the run so far; the ledger is up to date.
  subroutine judge_health(run, health)
    class(dem_run_state_type), intent(in) :: run
    type(health_type), intent(inout) :: health
    real(wp) :: limits(2), checks
    call health%judge(run%deck, 'energy_error', 'the energy error', relative_closure(run%system), &
                      energy_limits, 'a smaller dt or dt_factor')
    call health%judge(run%deck, 'max_overlap', 'the largest overlap over the least semi-axis', &
                      run%system%health%max_overlap, overlap_limits, 'a stiffer material')
    call health%judge(run%deck, 'late_rebuilds', 'the number of late rebuilds', &
                      real(run%system%health%late_rebuilds, wp), late_limits, 'a smaller dt')
    limits = unstable_limits
    if (run%choices%allow_unstable) limits(2) = none
    ! relaxation has no time to be true to, and the bound is on the safe side
    if (run%system%par%mode == mode_relaxation) limits = none
    checks = max(real(run%clock%steps, wp)/check_steps, real(run%clock%unstable, wp), 1.0_wp)
    call health%judge(run%deck, 'steps_above_limit', &
                      'the share of checks with the step above the stability limit', &
                      real(run%clock%unstable, wp)/checks, limits, 'a smaller dt')
  end subroutine judge_health
end module dem_judgement
