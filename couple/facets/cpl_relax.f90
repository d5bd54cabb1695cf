!> What the solid is loaded with, so that the exchange of motion and force settles: under-relaxed
!! forces, constant or by Aitken. Springs are in cpl_springs.
module cpl_relax
  use talus_kinds, only: wp, i4
  use cpl_choices, only: interface_springs, interface_theta, interface_aitken, interface_none
  implicit none
  private
  public :: relax_type

  real(wp), parameter :: first_factor = 0.1_wp     !! of Aitken, unless the deck says theta

  !> Method and memory of the relaxation.
  type :: relax_type
    integer(i4) :: method = interface_none
    real(wp) :: theta = 1.0_wp               !! share of the new force
    real(wp) :: factor = 1.0_wp              !! Aitken: the present share
    real(wp) :: least = 1.0e-3_wp            !! Aitken: bound of it
    logical :: begun = .false.               !! held and residual have a past
    real(wp) :: arm = 1.0_wp                 !! length that makes moments forces [m]
    real(wp), allocatable :: held(:, :)      !! force last put on the solid (rows, ghosts) [N, N m]
    real(wp), allocatable :: residual(:, :)  !! Aitken: last new minus held
  contains
    procedure :: init
    procedure :: force
    procedure :: hold
    procedure :: resume
    procedure, private :: weighted
  end type relax_type

contains

  subroutine init(self, method, theta, rows, ghosts)
    class(relax_type), intent(inout) :: self
    integer(i4), intent(in) :: method
    real(wp), intent(in) :: theta  !! 0: not given
    integer(i4), intent(in) :: rows, ghosts
    self%method = method
    self%theta = 1.0_wp
    if (theta > 0.0_wp) self%theta = theta
    self%factor = first_factor
    if (theta > 0.0_wp) self%factor = theta
    self%begun = .false.
    if (allocated(self%held)) deallocate (self%held, self%residual)
    allocate (self%held(rows, ghosts), self%residual(rows, ghosts), source=0.0_wp)
  end subroutine init

  !> The solid carries this already.
  subroutine hold(self, load)
    class(relax_type), intent(inout) :: self
    real(wp), intent(in) :: load(:, :)  !! (rows, ghosts) [N, N m]
    self%held = load
  end subroutine hold

  !> Memory after a restart, beside held and residual.
  subroutine resume(self, factor, begun)
    class(relax_type), intent(inout) :: self
    real(wp), intent(in) :: factor
    logical, intent(in) :: begun
    self%factor = factor
    self%begun = begun
  end subroutine resume

  !> Force to put on the solid at the ghosts, from the force measured there. Springs act beside it
  !! (cpl_springs).
  subroutine force(self, measured)
    class(relax_type), intent(inout) :: self
    real(wp), intent(in) :: measured(:, :)  !! (rows, ghosts) [N, N m]
    real(wp) :: new(size(measured, 1), size(measured, 2)), change

    select case (self%method)
    case (interface_theta)
      if (.not. self%begun) self%held = 0.0_wp
      self%held = self%held + self%theta*(measured - self%held)
    case (interface_aitken)
      new = measured - self%held
      if (self%begun) then
        change = self%weighted(new - self%residual, new - self%residual)
        if (change > 0.0_wp) self%factor = min(1.0_wp, max(self%least, &
          -self%factor*self%weighted(self%residual, new - self%residual)/change))
      end if
      self%residual = new
      self%held = self%held + self%factor*new
    case default
      self%held = measured
    end select
    self%begun = .true.
  end subroutine force

  !> Scalar product of forces; moments count by their arm [N2].
  pure real(wp) function weighted(self, a, b)
    class(relax_type), intent(in) :: self
    real(wp), intent(in) :: a(:, :), b(:, :)  !! (rows, ghosts)
    weighted = sum(a(:3, :)*b(:3, :))
    if (size(a, 1) > 3) weighted = weighted + sum(a(4:, :)*b(4:, :))/self%arm**2
  end function weighted
end module cpl_relax
