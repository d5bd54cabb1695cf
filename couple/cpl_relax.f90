!> What the solid is loaded with, so that the exchange of motion and force settles.
!!
!! Plain staggering contracts only while contacts are softer than the facet below them. Springs
!! (Robin): (K + sum k N'N) u = X + N'P + sum k N'N d, d the ghosts' motion with which P was
!! measured; the same fixed point, contraction whenever k is at least half the true stiffness.
module cpl_relax
  use talus_kinds, only: wp, i4
  use cpl_choices, only: interface_springs, interface_theta, interface_aitken, interface_none
  implicit none
  private
  public :: relax_type

  real(wp), parameter :: least_factor = 1.0e-3_wp  !! of Aitken
  real(wp), parameter :: first_factor = 0.1_wp     !! of Aitken, unless the deck says theta

  !> Method and memory of the relaxation.
  type :: relax_type
    integer(i4) :: method = interface_none
    real(wp) :: stiffness = 0.0_wp           !! springs: at each ghost [N/m]
    real(wp) :: theta = 1.0_wp               !! share of the new force
    real(wp) :: factor = 1.0_wp              !! Aitken: the present share
    logical :: begun = .false.               !! held and residual have a past
    real(wp), allocatable :: held(:, :)      !! force last put on the solid (3, ghosts) [N]
    real(wp), allocatable :: residual(:, :)  !! Aitken: last new minus held [N]
  contains
    procedure :: init
    procedure :: force
  end type relax_type

contains

  subroutine init(self, method, theta, ghosts)
    class(relax_type), intent(inout) :: self
    integer(i4), intent(in) :: method
    real(wp), intent(in) :: theta  !! 0: not given
    integer(i4), intent(in) :: ghosts
    self%method = method
    self%theta = 1.0_wp
    if (theta > 0.0_wp) self%theta = theta
    self%factor = first_factor
    if (theta > 0.0_wp) self%factor = theta
    self%begun = .false.
    if (allocated(self%held)) deallocate (self%held, self%residual)
    allocate (self%held(3, ghosts), self%residual(3, ghosts), source=0.0_wp)
  end subroutine init

  !> Force to put on the solid at the ghosts, from the force measured with the ghosts displaced by
  !! d, while the solid's springs hold it at d_solid.
  subroutine force(self, measured, d, d_solid, load)
    class(relax_type), intent(inout) :: self
    real(wp), intent(in) :: measured(:, :)           !! (3, ghosts) [N]
    real(wp), intent(in) :: d(:, :), d_solid(:, :)   !! (3, ghosts) [m]
    real(wp), intent(out) :: load(:, :)              !! (3, ghosts) [N]
    real(wp) :: new(3, size(measured, 2)), change

    select case (self%method)
    case (interface_springs)
      load = measured + self%stiffness*(d - d_solid)
      self%held = measured
    case (interface_theta)
      if (.not. self%begun) self%held = 0.0_wp
      self%held = self%held + self%theta*(measured - self%held)
      load = self%held
    case (interface_aitken)
      new = measured - self%held
      if (self%begun) then
        change = sum((new - self%residual)**2)
        if (change > 0.0_wp) self%factor = min(1.0_wp, max(least_factor, &
          -self%factor*sum(self%residual*(new - self%residual))/change))
      end if
      self%residual = new
      self%held = self%held + self%factor*new
      load = self%held
    case default
      self%held = measured
      load = measured
    end select
    self%begun = .true.
  end subroutine force
end module cpl_relax
