!> Damping of what the nodes do not see of the free grains' motion: F = -Pi' c Pi v, Pi = 1 - N P,
!! c = rate x mass, fading with the distance from the ghosts (theory: overlap coupling, What a mesh
!! reflects). The coarse motion is left alone: N'F = 0 for every motion.
!! eq. C.15
module cpl_fine_damping
  use talus_kinds, only: wp, i4
  use cpl_cells, only: cells_type
  use cpl_hull, only: hull_type
  use cpl_projection, only: projection_type
  implicit none
  private
  public :: fine_damping_type, ramp_from_ghosts

  type :: fine_damping_type
    logical :: active = .false.
    real(wp), allocatable :: c(:)         !! of the free grains [kg/s], or [N m s]
    real(wp), allocatable :: force(:, :)  !! (3, free), as it acts now [N], or [N m]
    real(wp) :: lost = 0.0_wp             !! energy taken so far [J]
  contains
    procedure :: build
    procedure :: act
    procedure :: note
  end type fine_damping_type

contains

  !> 1 at the ghosts' elements, 0 at the free grain farthest from them.
  subroutine ramp_from_ghosts(cells, ghosts, x, seen, ramp)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: ghosts(:)       !! (elements) hold ghosts
    real(wp), intent(in) :: x(:, :)        !! free grains (3, free) [m]
    logical, intent(in) :: seen(:)         !! those that the nodes see; 0 for others
    real(wp), intent(out) :: ramp(:)
    type(hull_type) :: hull
    integer(i4) :: k
    call hull%build(cells, ghosts)
    do k = 1, size(x, 2)
      ramp(k) = hull%distance(x(:, k))
    end do
    ramp = merge(1.0_wp - ramp/max(maxval(ramp, seen), tiny(1.0_wp)), 0.0_wp, seen)
  end subroutine ramp_from_ghosts

  !> rate [1/s] at the ghosts, mass [kg] or inertia [kg m^2] of the free grains.
  subroutine build(self, rate, ramp, mass)
    class(fine_damping_type), intent(inout) :: self
    real(wp), intent(in) :: rate, ramp(:), mass(:)
    self%active = rate > 0.0_wp
    if (.not. self%active) return
    self%c = rate*ramp*mass
    if (.not. allocated(self%force)) allocate (self%force(3, size(mass)), source=0.0_wp)
  end subroutine build

  !> The force for velocities v of the free grains, added to total.
  subroutine act(self, p, v, total)
    class(fine_damping_type), intent(inout) :: self
    type(projection_type), intent(in) :: p
    real(wp), intent(in) :: v(:, :)          !! (3, free) [m/s] or [rad/s]
    real(wp), intent(inout) :: total(:, :)   !! (3, free)
    real(wp) :: prescribed(3, p%n%columns), coarse(3, size(v, 2))
    integer(i4) :: k
    call p%apply(v, prescribed)
    call p%n%apply(prescribed, coarse)
    do k = 1, size(v, 2)
      self%force(:, k) = -self%c(k)*(v(:, k) - coarse(:, k))
    end do
    prescribed = 0.0_wp
    call p%n%transposed(-self%force, prescribed)
    call p%transposed(prescribed, self%force)
    total = total + self%force
  end subroutine act

  !> Half of what the force takes in a step that moves the free grains by dq: each force acts over
  !! half of the step before and half of the step after it.
  subroutine note(self, dq)
    class(fine_damping_type), intent(inout) :: self
    real(wp), intent(in) :: dq(:, :)  !! (3, free) [m] or [rad]
    self%lost = self%lost - 0.5_wp*sum(self%force*dq)
  end subroutine note
end module cpl_fine_damping
