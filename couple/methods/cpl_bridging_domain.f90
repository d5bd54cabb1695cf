!> Bridging domain with Lagrange multipliers on the velocities of grains and nodes (Xiao and
!! Belytschko 2004; theory: overlap coupling, Bridging domain). Gravity and the forces of the start
!! are part of the trial step.
module cpl_bridging_domain
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_log, only: log_type
  use cpl_bridge, only: bridge_field_type
  use cpl_bridge_limit, only: check_bridge_step
  use cpl_bridge_step, only: trial_type, trial_kick
  use cpl_domain_method, only: domain_method_type
  use cpl_overlap_partition, only: points_type
  use cpl_run, only: cpl_run_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: bridging_domain_type

  type, extends(domain_method_type) :: bridging_domain_type
  contains
    procedure :: lumped
    procedure :: check_step
    procedure :: bind
    procedure :: log_bond
  end type bridging_domain_type

contains

  logical function lumped(self, run)
    class(bridging_domain_type), intent(in) :: self
    type(cpl_run_type), intent(in) :: run
    lumped = run%choices%overlap%multipliers == 'lumped'
  end function lumped

  subroutine check_step(self, run, points, errors)
    class(bridging_domain_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(points_type), intent(in) :: points
    type(error_list_type), intent(inout) :: errors
    call check_bridge_step(self%o, self%bridge, run%solvers, points, run%timers, errors)
  end subroutine check_step

  !> Trial kick, then the multipliers that bind grains and nodes.
  subroutine bind(self, grains, kick, bulk, dt)
    class(bridging_domain_type), intent(inout) :: self
    type(cpl_solver_type), intent(in) :: grains
    real(wp), intent(in) :: kick, bulk, dt
    type(trial_type) :: trial
    associate (o => self%o, b => self%bridge)
      call trial_kick(o, b, grains, kick, bulk, trial)
      call bind_field(b%move, b%move%gap(o%motion%d, o%motion%u)/dt, b%v, trial%before, trial%v, &
        o%motion%v, b%push)
      b%push = b%push/trial%push + b%hold
      if (.not. b%turns) return
      call bind_field(b%turn, b%turn%gap(o%motion%turn, o%motion%phi)/dt, b%spin, &
        trial%before_phi, trial%spin, o%motion%w, b%couple)
      b%couple = b%couple/trial%push + b%hold_couple
    end associate

  contains

    !> Bind one field; works of the multipliers on both, with the mean velocities of the kick.
    subroutine bind_field(field, mending, v, d0, trial, d, impulse)
      type(bridge_field_type), intent(in) :: field
      real(wp), intent(in) :: mending(:, :)        !! gap over the step (3, grains) [m/s]
      real(wp), intent(in) :: v(:, :), d0(:, :)    !! before the kick
      real(wp), intent(inout) :: trial(:, :), d(:, :)  !! after it: of grains, of nodes
      real(wp), intent(out) :: impulse(:, :)
      real(wp) :: on_nodes(3, size(field%at)), given, taken
      call field%bind(mending, trial, d, impulse)
      on_nodes = 0.0_wp
      call field%n%transposed(impulse, on_nodes)
      given = 0.5_wp*sum(impulse*(v + trial))
      taken = 0.5_wp*sum(on_nodes*(d0(:, field%at) + d(:, field%at)))
      call self%o%ledger%add(given, taken, 0.5_wp*sum(abs(impulse*(v + trial))))
      call self%o%ledger%lose(taken, given)
    end subroutine bind_field
  end subroutine bind

  subroutine log_bond(self, log)
    class(bridging_domain_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    if (self%bridge%lumped) then
      call log%item('multipliers', 'lumped: row sums')
      call log%warn('lumped multipliers dissipate what the mesh cannot '// &
        'carry (above its cut-off): waves are then not reflected but lost, and grains of the '// &
        'domain are cooled; the audit has what they took')
    else
      call log%item('multipliers', 'consistent: grains follow the nodes')
    end if
  end subroutine log_bond
end module cpl_bridging_domain
