!> summary.json: what a program that reads no logs wants to know of a run.
module dem_summary
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_health, only: health_type
  use talus_summary, only: summary_type
  use dem_state, only: kind_free
  use dem_histories, only: relative_closure
  use dem_pore, only: mass_error
  use dem_rank_team, only: dem_rank_team_type
  use dem_run_state, only: dem_run_state_type, program_name
  implicit none
  private
  public :: write_summary

contains

  !> <stem>_summary.json of a run that ends with this exit code and these faults.
  subroutine write_summary(run, health, exit_code, faults, errors)
    class(dem_run_state_type), intent(inout) :: run
    type(health_type), intent(in) :: health
    integer(i4), intent(in) :: exit_code
    type(error_list_type), intent(in) :: faults
    type(error_list_type), intent(inout) :: errors
    type(summary_type) :: summary
    real(wp) :: rate, steps_time

    steps_time = run%steps_seconds()
    call run%system%refresh_ledger()
    call summary%set_program(program_name, run%deck%source%path, run%deck%hash())
    call summary%set('exit_code', exit_code)
    call summary%set('wall_time_s', run%timers%elapsed())
    call summary%set('steps', run%clock%steps)
    call summary%set('time_s', run%clock%time())
    call summary%set('dt_s', run%clock%dt)
    call summary%set('grains', run%system%grains%n)
    call summary%set('free_grains', int(count(run%system%grains%kind == kind_free), i4))
    if (run%system%clumps%n > 0) call summary%set('clumps', run%system%clumps%n)
    call summary%set('contacts', run%system%contact_number())
    rate = 0.0_wp
    if (steps_time > 0.0_wp) rate = real(run%clock%steps - run%start_steps, wp)/steps_time
    call summary%set('grain_steps_per_s', rate*run%system%grains%n)
    call summary%set('free_grain_steps_per_s', rate*count(run%system%grains%kind == kind_free))
    call health%summarise(summary)
    call summary%set('health.energy_error', relative_closure(run%system))
    call summary%set('health.closure_J', run%system%closure())
    call summary%set('health.max_overlap', run%system%health%max_overlap)
    call summary%set('health.rebuilds', run%system%health%rebuilds)
    call summary%set('health.late_rebuilds', run%system%health%late_rebuilds)
    call summary%set('health.steps_above_limit', run%clock%unstable)
    if (run%system%pairs%additional%bond%given) then
      call summary%set('health.bonds_made', run%system%pairs%additional%made)
      call summary%set('health.bonds_torn', run%system%pairs%additional%torn)
      call summary%set('health.bonds_sheared', run%system%pairs%additional%sheared)
    end if
    if (run%pore%active) &
      call summary%set('health.liquid_balance', mass_error(run%system%dem_data_type))
    if (run%equilibrium%watched) then
      call summary%set('health.equilibrium', run%equilibrium%reached)
      call summary%set('health.unbalanced_force', run%equilibrium%unbalanced)
      call summary%set('health.kinetic_over_elastic', run%equilibrium%energy_ratio)
    end if
    if (allocated(run%system%rank_team)) call put_ranks(summary, run%system%rank_team)
    call summary%set('energy.kinetic_J', run%system%ledger%kinetic)
    call summary%set('energy.elastic_J', run%system%ledger%elastic_normal &
                     + run%system%ledger%elastic_tangential)
    call summary%set_timers(run%timers)
    call summary%set_errors(faults)
    call summary%write(run%stem//'_summary.json', errors)
  end subroutine write_summary

  !> How the ranks shared the work.
  subroutine put_ranks(summary, rank_team)
    type(summary_type), intent(inout) :: summary
    type(dem_rank_team_type), intent(in) :: rank_team
    call summary%set('ranks.count', rank_team%team%ranks)
    call summary%set('ranks.exchange_s', rank_team%marks%exchange(2))
    call summary%set('ranks.least_exchange_s', rank_team%marks%exchange(1))
    call summary%set('ranks.most_exchange_s', rank_team%marks%exchange(3))
    call summary%set('ranks.imbalance', rank_team%marks%imbalance)
    call summary%set('ranks.least_grains', nint(rank_team%marks%own(1), i4))
    call summary%set('ranks.most_grains', nint(rank_team%marks%own(2), i4))
    call summary%set('ranks.most_mirrors', nint(rank_team%marks%mirrors(2), i4))
    call summary%set('ranks.bytes_a_step', rank_team%marks%bytes)
    call summary%set('ranks.messages_a_step', rank_team%marks%messages)
  end subroutine put_ranks
end module dem_summary
