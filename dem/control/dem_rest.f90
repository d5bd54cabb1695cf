!> Some free grains come to rest while all else is held; no time passes (theory-dem, Conversion).
!!
!! Steps are those of the run, with adaptive damping (eq. D.4) whatever the run has; the ledger
!! books what is dissipated as in any other step.
module dem_rest
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use dem_equilibrium, only: mean_unbalanced
  use dem_system, only: dem_system_type, held_type
  implicit none
  private
  public :: rest_type

  integer(i4), parameter :: block = 20  !! steps between two checks of the damping

  type :: rest_type
    integer(i4) :: most_steps = 0
    real(wp) :: tolerance = 0.0_wp    !! of what is left, see mean_unbalanced [-]
    integer(i4) :: steps = 0          !! taken
    real(wp) :: unbalanced = 0.0_wp   !! at the end [-]
    real(wp) :: moved = 0.0_wp        !! largest way of a grain [m]
  contains
    procedure :: reach
  end type rest_type

contains

  !> The grains that may move, at rest or after the most steps; with the velocities of before.
  subroutine reach(self, system, moving, errors)
    class(rest_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    logical, intent(in) :: moving(:)  !! (grains)
    type(error_list_type), intent(inout) :: errors
    type(held_type) :: held
    real(wp) :: x(3, size(moving)), extra(3, size(moving))
    integer(i4) :: n

    self%steps = 0
    x = system%grains%x
    extra = system%grains%extra_force
    system%grains%extra_force = 0.0_wp
    call system%hold(moving, held)
    if (allocated(system%seen_kinetic)) deallocate (system%seen_kinetic)
    do
      self%unbalanced = mean_unbalanced(system)
      if (self%unbalanced <= self%tolerance .or. self%steps >= self%most_steps) exit
      n = min(block, self%most_steps - self%steps)
      call system%step(n, errors)
      if (errors%any()) return
      self%steps = self%steps + n
      call system%slow_down()
    end do
    if (allocated(system%seen_kinetic)) deallocate (system%seen_kinetic)
    self%moved = sqrt(maxval(sum((system%grains%x - x)**2, 1)))
    call system%let_go(held)
    system%grains%extra_force = extra
  end subroutine reach
end module dem_rest
