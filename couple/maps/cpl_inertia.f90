!> Mass that nodes carry with the free grains that move them: with D^ = P Q for good, Q'' follows
!! from (M_Q + P' M P) Q'' = F, without a system in the grains.
!!
!! With P = (N'M_Q N)^-1 N'M_Q the nodes' acceleration is a = (N'M_Q N + M)^-1 N'F, and the grains
!! feel F - P' M a. What acts on all mass alike (gravity, background damping) stays with the grains
!! and needs no correction. (theory: overlap coupling, Who owns what)
!! eq. C.11
module cpl_inertia
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_projection, only: projection_type
  implicit none
  private
  public :: inertia_type

  type :: inertia_type
    logical :: active = .false.
    real(wp), allocatable :: grain(:)  !! masses of the free grains [kg], or inertia [kg m^2]
    real(wp), allocatable :: node(:)   !! masses that the nodes carry
    type(projection_type) :: both      !! (N'M_Q N + M)^-1 N'M_Q
  contains
    procedure :: build
    procedure :: resist
  end type inertia_type

contains

  !> The factor for grains and nodes of these masses; p projects with weights that are those of the
  !! grains' masses.
  subroutine build(self, p, grain, node, errors)
    class(inertia_type), intent(inout) :: self
    type(projection_type), intent(in) :: p
    real(wp), intent(in) :: grain(:), node(:)
    type(error_list_type), intent(inout) :: errors
    self%active = any(node > 0.0_wp)
    if (.not. self%active) return
    self%grain = grain
    self%node = node
    call self%both%build_loaded(p, grain, node, errors)
  end subroutine build

  !> Forces of inertia - M a on the nodes, for all other forces on the free grains.
  subroutine resist(self, force, inertial)
    class(inertia_type), intent(in) :: self
    real(wp), intent(in) :: force(:, :)      !! (3, free) [N]
    real(wp), intent(out) :: inertial(:, :)  !! (3, prescribed) [N]
    real(wp) :: a(3, size(force, 2))
    integer(i4) :: k
    do k = 1, size(force, 2)
      a(:, k) = force(:, k)/self%grain(k)
    end do
    call self%both%apply(a, inertial)
    do k = 1, size(inertial, 2)
      inertial(:, k) = -self%node(k)*inertial(:, k)
    end do
  end subroutine resist
end module cpl_inertia
