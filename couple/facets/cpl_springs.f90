!> Springs (Robin) that keep the exchange stable where contacts are stiffer than the facets.
!!
!! Plain staggering contracts only while contacts are softer than the facet below. With springs
!! the solid solves (K + S) u = X + N'P + S w, S = sum k N'N, w the motion that P was measured with:
!! the same fixed point, contraction whenever k is at least half the true stiffness. Where ghosts
!! turn with the solid, their moments are held by springs on the nodes of the elements behind, or on
!! the micro-rotations that they follow.
!! eq. C.2
module cpl_springs
  use talus_kinds, only: wp, i4
  use cpl_choices, only: rotation_curl, rotation_micro
  use cpl_facet_map, only: facet_map_type
  use cpl_transfer, only: transfer_type
  implicit none
  private
  public :: springs_type

  !> Springs, each at a weighted mean of nodal values; those on micro-rotations come last.
  type :: springs_type
    integer(i4) :: n = 0
    integer(i4) :: turning = 0                !! of them on micro-rotations
    real(wp) :: stiffness = 0.0_wp            !! at each ghost [N/m]; 0: no springs
    real(wp) :: liquid = 0.0_wp               !! besides, of the liquid in the pores [N/m]
    integer(i4), allocatable :: node(:, :)    !! columns of nodal values (most, n)
    real(wp), allocatable :: weight(:, :)     !! (most, n)
    real(wp), allocatable :: each(:)          !! stiffness of each (n) [N/m, N m]
  contains
    procedure :: make
    procedure :: force
  end type springs_type

contains

  !> Springs of this stiffness at the ghosts of a map.
  subroutine make(self, stiffness, map, transfer, radius)
    class(springs_type), intent(inout) :: self
    real(wp), intent(in) :: stiffness        !! [N/m]
    type(facet_map_type), intent(in) :: map
    type(transfer_type), intent(in) :: transfer
    real(wp), intent(in) :: radius(:)        !! of the ghosts [m]
    real(wp) :: turning(transfer%nodes)
    integer(i4) :: with(4, transfer%nodes), k, n, most

    turning = 0.0_wp
    if (transfer%rotation == rotation_curl) &
      call turning_springs(transfer, stiffness*radius**2, turning, with)
    self%turning = merge(map%ghosts, 0, transfer%rotation == rotation_micro)
    n = map%ghosts + count(turning > 0.0_wp) + self%turning
    most = max(4, size(map%corner, 1))
    self%n = n
    self%stiffness = stiffness
    if (allocated(self%node)) deallocate (self%node, self%weight, self%each)
    allocate (self%node(most, n), self%each(n))
    allocate (self%weight(most, n), source=0.0_wp)
    do k = 1, map%ghosts
      call put(k, map%corner(:, k), map%weight(:, k), stiffness + self%liquid)
    end do
    n = map%ghosts
    do k = 1, transfer%nodes
      if (.not. turning(k) > 0.0_wp) cycle
      n = n + 1
      call put(n, with(:, k), [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], turning(k))
    end do
    do k = 1, self%turning
      call put(n + k, transfer%phi(:, k), transfer%phi_weight(:, k), stiffness*radius(k)**2)
    end do

  contains

    subroutine put(at, node, weight, each)
      integer(i4), intent(in) :: at, node(:)
      real(wp), intent(in) :: weight(:), each
      self%node(:, at) = node(1)
      self%node(:size(node), at) = node
      self%weight(:size(weight), at) = weight
      self%each(at) = each
    end subroutine put
  end subroutine make

  !> Stiffness at the nodes that is at least that of rotational springs at the ghosts: theta = R u
  !! with |R|^2 <= sum |grad N|^2 / 4.
  pure subroutine turning_springs(transfer, rotational, turning, with)
    type(transfer_type), intent(in) :: transfer
    real(wp), intent(in) :: rotational(:)       !! at the ghosts [N m]
    real(wp), intent(inout) :: turning(:)       !! at the nodes [N/m]
    integer(i4), intent(out) :: with(:, :)      !! the node, and three more of an element (4, nodes)
    integer(i4) :: g, a
    do g = 1, transfer%ghosts
      do a = 1, 8
        associate (k => transfer%corner(a, g))
          turning(k) = turning(k) + 0.25_wp*rotational(g)*sum(transfer%gradient(:, :, g)**2)
          with(:, k) = transfer%corner(1 + mod([a - 1, a, a + 1, a + 2], 8), g)
        end associate
      end do
    end do
  end subroutine turning_springs

  !> Forces S w on the nodes, couples on their micro-rotations [N, N m].
  pure subroutine force(self, w, f)
    class(springs_type), intent(in) :: self
    real(wp), intent(in) :: w(:, :)   !! (3, blocks) [m, rad]
    real(wp), intent(out) :: f(:, :)  !! (3, blocks) [N, N m]
    real(wp) :: pull(3)
    integer(i4) :: s, a
    f = 0.0_wp
    do s = 1, self%n
      pull = 0.0_wp
      do a = 1, size(self%node, 1)
        pull = pull + self%weight(a, s)*w(:, self%node(a, s))
      end do
      pull = self%each(s)*pull
      do a = 1, size(self%node, 1)
        f(:, self%node(a, s)) = f(:, self%node(a, s)) + self%weight(a, s)*pull
      end do
    end do
  end subroutine force
end module cpl_springs
