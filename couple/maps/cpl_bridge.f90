!> Bridging domain: grains and nodes of the same volume share its energy and its mass, and are bound
!! together by multipliers after a trial step (Xiao and Belytschko 2004; theory: overlap coupling,
!! Bridging domain).
!!
!! With v of the grains, V of the nodes and g = v - N V after the trial step, multipliers L act on
!! the grains and -N'L on the nodes. Consistent: g becomes 0; what is solved is not the system in
!! the grains, A = N M^-1 N' + m^-1, but the one in the nodes that gives the same, M + N'm N.
!! Lumped: A by its row sums, which takes only a part of g, and energy with it.
!! eq. C.17
module cpl_bridge
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use cpl_projection, only: projection_type
  use cpl_rows, only: rows_type
  implicit none
  private
  public :: bridge_type, bridge_field_type, domain_type

  real(wp), parameter :: fixed = 1.0e12_wp  !! times the largest mass, of what a deck holds
  real(wp), parameter :: mend = 0.1_wp      !! of a gap, taken back in a step (consistent)
  real(wp), parameter :: slight = 1.0e-6_wp !! share of the nodes' masses that steadies a fit
  integer(i4), parameter :: fits = 6        !! one after the other, until that share is not felt

  !> What a field is made of: all nodes of the overlap, of which `bound` take part.
  type :: domain_type
    type(rows_type) :: n                       !! functions of the nodes at the grains
    logical, allocatable :: bound(:)           !! (nodes)
    real(wp), allocatable :: x_node(:, :)      !! (3, nodes) [m]
    real(wp), allocatable :: node(:)           !! their masses
    real(wp), allocatable :: grain(:)          !! masses of the grains
    logical, allocatable :: held(:, :)         !! (3, nodes) by the solid's deck
  end type domain_type

  !> Displacements, or rotations, that are bound.
  type :: bridge_field_type
    integer(i4), allocatable :: at(:)          !! (columns) which of the overlap's nodes
    type(rows_type) :: n                       !! their functions at the grains
    real(wp), allocatable :: node(:)           !! masses of the nodes [kg], or inertia [kg m^2]
    real(wp), allocatable :: grain(:)          !! of the grains
    real(wp), allocatable :: light(:, :)       !! (3, columns) 1/mass, 0 where the deck holds
    type(projection_type), allocatable :: both(:)  !! (M + N'm N)^-1 N'm, one or one a direction
    real(wp), allocatable :: share(:, :)       !! (3, grains) 1/row sum of A (lumped)
  contains
    procedure :: build
    procedure :: gap
    procedure :: bind
    procedure :: start
    procedure :: node_accelerations
  end type bridge_field_type

  type :: bridge_type
    logical :: lumped = .false.                !! row sums in place of factors
    real(wp), allocatable :: weight(:)         !! of the bound grains [-]
    type(bridge_field_type) :: move, turn
    logical :: turns = .false.                 !! rotations are bound
    real(wp), allocatable :: v(:, :), spin(:, :)        !! of the grains (3, n) [m/s], [rad/s]
    real(wp), allocatable :: theta_ref(:, :)            !! their rotation at the start [rad]
    real(wp), allocatable :: push(:, :), couple(:, :)   !! put on the grains [N], [N m]
    real(wp), allocatable :: hold(:, :), hold_couple(:, :)  !! part that balances the start
    real(wp), allocatable :: weight_excess(:)  !! (nodes) mass less that of the solid [kg]
  end type bridge_type

contains

  !> Columns, masses, and the factors or the row sums.
  subroutine build(self, domain, lumped, errors)
    class(bridge_field_type), intent(inout) :: self
    type(domain_type), intent(in) :: domain
    logical, intent(in) :: lumped
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, c, column(size(domain%bound))

    self%at = pack([(k, k=1, int(size(column), i4))], domain%bound)
    column = 0
    column(self%at) = [(k, k=1, int(size(self%at), i4))]
    self%n = domain%n
    self%n%columns = int(size(self%at), i4)
    self%n%column = column(domain%n%column)
    self%node = domain%node(self%at)
    self%grain = domain%grain
    allocate (self%light(3, size(self%at)))
    do k = 1, size(self%at)
      self%light(:, k) = merge(0.0_wp, 1.0_wp/self%node(k), domain%held(:, self%at(k)))
    end do
    if (lumped) then
      call row_sums(self)
      return
    end if
    allocate (self%both(merge(3, 1, any(domain%held(:, self%at)))))
    do c = 1, size(self%both)
      call self%both(c)%build_massive(self%n, self%grain, loaded(self, c, 1.0_wp), &
                                      domain%x_node(:, self%at), errors)
    end do
  end subroutine build

  !> A share of the masses, with what is held in a direction too heavy to move.
  pure function loaded(self, direction, share) result(mass)
    type(bridge_field_type), intent(in) :: self
    integer(i4), intent(in) :: direction
    real(wp), intent(in) :: share
    real(wp) :: mass(size(self%node))
    mass = merge(share*self%node, fixed*maxval(self%node), self%light(direction, :) > 0.0_wp)
  end function loaded

  !> 1 over the row sums of A = N M^-1 N' + 1/m.
  subroutine row_sums(self)
    type(bridge_field_type), intent(inout) :: self
    real(wp) :: ones(3, self%n%rows), reach(3, self%n%columns)
    integer(i4) :: k
    ones = 1.0_wp
    reach = 0.0_wp
    call self%n%transposed(ones, reach)
    reach = reach*self%light
    allocate (self%share(3, self%n%rows))
    call self%n%apply(reach, self%share)
    do k = 1, self%n%rows
      self%share(:, k) = 1.0_wp/(self%share(:, k) + 1.0_wp/self%grain(k))
    end do
  end subroutine row_sums

  !> g = q - N d.
  pure function gap(self, q, d) result(g)
    class(bridge_field_type), intent(in) :: self
    real(wp), intent(in) :: q(:, :), d(:, :)  !! (3, grains), (3, nodes of the overlap)
    real(wp) :: g(3, size(q, 2))
    call self%n%apply(d(:, self%at), g)
    g = q - g
  end function gap

  !> Multipliers that bind velocities v and d; `mending` is a gap of the places over the step, of
  !! which a part is taken back (consistent).
  subroutine bind(self, mending, v, d, impulse)
    class(bridge_field_type), intent(in) :: self
    real(wp), intent(in) :: mending(:, :)    !! (3, grains) [m/s]
    real(wp), intent(inout) :: v(:, :)       !! of the grains (3, grains) [m/s]
    real(wp), intent(inout) :: d(:, :)       !! of the overlap's nodes (3, nodes) [m/s]
    real(wp), intent(out) :: impulse(:, :)   !! on the grains (3, grains) [N s]
    real(wp) :: g(3, size(v, 2)), part(3, size(self%at)), change(3, size(self%at))
    integer(i4) :: c, k

    g = self%gap(v, d)
    if (allocated(self%both)) then
      g = g + mend*mending
      do c = 1, size(self%both)
        call self%both(c)%apply(g, part)
        if (size(self%both) == 1) change = part
        change(c, :) = part(c, :)
      end do
      change = merge(change, 0.0_wp, self%light > 0.0_wp)
      call self%n%apply(change, impulse)
      do k = 1, size(v, 2)
        impulse(:, k) = self%grain(k)*(impulse(:, k) - g(:, k))
      end do
    else
      impulse = -g*self%share
      change = 0.0_wp
      call self%n%transposed(impulse, change)
      change = -change*self%light
    end if
    d(:, self%at) = d(:, self%at) + change
    do k = 1, size(v, 2)
      v(:, k) = v(:, k) + impulse(:, k)/self%grain(k)
    end do
  end subroutine bind

  !> Velocities of the nodes that fit those of the grains best. Where the grains are too few for a
  !! fit of their own the nodes' masses, reduced, decide.
  subroutine start(self, v, x_node, d, errors)
    class(bridge_field_type), intent(in) :: self
    real(wp), intent(in) :: v(:, :)         !! of the grains (3, grains) [m/s]
    real(wp), intent(in) :: x_node(:, :)    !! (3, nodes of the overlap) [m]
    real(wp), intent(inout) :: d(:, :)      !! of the overlap's nodes (3, nodes) [m/s]
    type(error_list_type), intent(inout) :: errors
    type(projection_type) :: fit
    real(wp) :: part(3, size(self%at))
    integer(i4) :: c, k

    d(:, self%at) = 0.0_wp
    do c = 1, 3
      call fit%build_massive(self%n, self%grain, loaded(self, c, slight), x_node(:, self%at), &
                             errors)
      if (errors%any()) return
      do k = 1, fits
        call fit%apply(self%gap(v, d), part)
        d(c, self%at) = d(c, self%at) + merge(part(c, :), 0.0_wp, self%light(c, :) > 0.0_wp)
      end do
    end do
  end subroutine start

  !> Accelerations of nodes with the grains that are bound to them, of forces on both (which are
  !! transferred to the nodes already), in place.
  subroutine node_accelerations(self, f)
    class(bridge_field_type), intent(in) :: self
    real(wp), intent(inout) :: f(:, :)  !! (3, nodes of the overlap)
    real(wp) :: part(3, size(self%at)), whole(3, size(self%at))
    integer(i4) :: c
    whole = f(:, self%at)
    do c = 1, size(self%both)
      part = whole
      call self%both(c)%solve_nodes(part)
      if (size(self%both) == 1) f(:, self%at) = part
      f(c, self%at) = part(c, :)
    end do
  end subroutine node_accelerations
end module cpl_bridge
