!> A side of the liquid's grid that is a partner's, as facets of a solid are.
!!
!! It moves as the partner says, with velocities at its nodes between which it is bilinear. What it
!! sweeps and the forces on it are integrals over the side with the same numbers, so that their
!! powers agree to rounding. Where the partner holds the pressures all liquid that comes to the
!! nodes of the side is the partner's, who has the storage of the half bricks there, too. Or the
!! side gives way: liquid goes over by a conductance, as the partner would take it. eqs. D.60, D.61
module dem_pore_partner
  use talus_kinds, only: wp, i4
  use dem_pore_grid, only: brick_edges, node_count, on_side
  use dem_pore_operator, only: storage
  use dem_pore_state, only: dem_pore_type, pore_grid_type, by_partner, sum_partner
  implicit none
  private
  public :: axis_of, end_of, side_of_nodes, take_side, begin_interval, add_partner, book_partner
  public :: move_partner, node_storage, over_side, side_force, yield_to, add_yield, take_yield

  real(wp), parameter :: closed = 1.0e-3_wp  !! of the pores that a brick within a tool keeps

contains

  !> The side whose nodes these are, all of them and in rising order; 0: there is none.
  pure integer(i4) function side_of_nodes(grid, node) result(side)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: node(:)
    integer(i4), allocatable :: own(:)
    do side = 1, 6
      own = nodes_of(grid, side)
      if (size(own) /= size(node)) cycle
      if (all(own == node)) return
    end do
    side = 0
  end function side_of_nodes

  !> Nodes of a side, rising.
  pure function nodes_of(grid, side) result(node)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: side
    integer(i4), allocatable :: node(:)
    integer(i4) :: a
    node = pack([(a, a=1, node_count(grid))], &
                [(on_side(grid, a, end_of(side), axis_of(side)), a=1, node_count(grid))])
  end function nodes_of

  pure integer(i4) function axis_of(side)
    integer(i4), intent(in) :: side
    axis_of = (side + 1)/2
  end function axis_of

  !> 1: the lower end of its axis, 2: the upper.
  pure integer(i4) function end_of(side)
    integer(i4), intent(in) :: side
    end_of = 2 - modulo(side, 2)
  end function end_of

  !> From now on this side is the partner's, with pressures that it holds or impervious.
  subroutine take_side(pore, side, held)
    type(dem_pore_type), intent(inout) :: pore
    integer(i4), intent(in) :: side
    logical, intent(in) :: held
    pore%partner%side = side
    pore%partner%held = held
    pore%partner%node = nodes_of(pore%grid, side)
    if (held) pore%partner%p = pore%p(pore%partner%node)
    pore%partner%v = 0.0_wp*pore%p(pore%partner%node)
    call yield_to(pore, 0.0_wp*pore%partner%v, 0.0_wp*pore%partner%v)
    call begin_interval(pore)
  end subroutine take_side

  !> From now on liquid goes over by this conductance, beside what is expected; none anywhere: the
  !! partner holds the pressures.
  subroutine yield_to(pore, conduct, expected)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: conduct(:)   !! at the side's nodes [m^3/Pa]
    real(wp), intent(in) :: expected(:)  !! [m^3/s]
    associate (s => pore%partner)
      s%conduct = conduct
      s%expected = expected
      s%yields = s%held .and. any(conduct > 0.0_wp)
      if (s%held) pore%hold(s%node) = merge(0, by_partner, s%yields)
    end associate
  end subroutine yield_to

  !> What the side gives way by in an exchange, into its equations. eq. D.61
  subroutine add_yield(pore, span, storage, rhs)
    type(dem_pore_type), intent(in) :: pore
    real(wp), intent(in) :: span                       !! [s]
    real(wp), intent(inout) :: storage(:)              !! (nodes) [m^3/Pa]
    real(wp), intent(inout) :: rhs(:)                  !! (nodes) [m^3]
    if (.not. pore%partner%yields) return
    associate (s => pore%partner)
      storage(s%node) = storage(s%node) + s%conduct
      rhs(s%node) = rhs(s%node) + s%conduct*s%p + span*s%expected
    end associate
  end subroutine add_yield

  !> Liquid that came over in an exchange; the next one begins at its pressures. eq. D.61
  subroutine take_yield(pore, span, inflow)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: span          !! [s]
    real(wp), intent(inout) :: inflow(:)  !! (nodes) [m^3]
    if (.not. pore%partner%yields) return
    associate (s => pore%partner)
      inflow(s%node) = span*s%expected - s%conduct*(pore%p(s%node) - s%p)
      pore%omega(s%node) = pore%omega(s%node) + inflow(s%node)
      s%p = pore%p(s%node)
    end associate
  end subroutine take_yield

  !> An interval of the partner begins: nothing has come yet.
  subroutine begin_interval(pore)
    type(dem_pore_type), intent(inout) :: pore
    pore%partner%inflow = 0.0_wp*pore%partner%v
    pore%partner%impulse = pore%partner%inflow
    pore%partner%work = 0.0_wp
  end subroutine begin_interval

  !> Integrals over the side of its functions times a bilinear field of nodal values.
  pure function over_side(grid, side, value) result(total)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: side
    real(wp), intent(in) :: value(:)  !! at the side's nodes
    real(wp) :: total(size(value))    !! [m^2] times its unit
    real(wp), allocatable :: at(:, :)
    real(wp) :: h(2)
    integer(i4) :: n(2), k
    n = pack(grid%bricks, [1, 2, 3] /= axis_of(side)) + 1
    h = pack(brick_edges(grid), [1, 2, 3] /= axis_of(side))
    at = reshape(value, n)
    do k = 1, n(2)
      at(:, k) = along(h(1), at(:, k))
    end do
    do k = 1, n(1)
      at(k, :) = along(h(2), at(k, :))
    end do
    total = reshape(at, [size(total)])
  end function over_side

  !> The same along a line of nodes at distances h [m].
  pure function along(h, value) result(total)
    real(wp), intent(in) :: h, value(:)
    real(wp) :: total(size(value))
    integer(i4) :: k
    total = 0.0_wp
    do k = 1, size(value) - 1
      total(k) = total(k) + h/6.0_wp*(2.0_wp*value(k) + value(k + 1))
      total(k + 1) = total(k + 1) + h/6.0_wp*(value(k) + 2.0_wp*value(k + 1))
    end do
  end function along

  !> Add what the side compresses in a time `span`, by node.
  subroutine add_partner(pore, span, hull)
    type(dem_pore_type), intent(in) :: pore
    real(wp), intent(in) :: span         !! [s], 1 for rates
    real(wp), intent(inout) :: hull(:)   !! (nodes) [m^3]
    if (pore%partner%side == 0) return
    associate (s => pore%partner)
      hull(s%node) = hull(s%node) + inward(s%side)*span*over_side(pore%grid, s%side, s%v)
    end associate
  end subroutine add_partner

  !> Sign of a motion along the axis that makes the grid smaller.
  pure real(wp) function inward(side)
    integer(i4), intent(in) :: side
    inward = merge(1.0_wp, -1.0_wp, end_of(side) == 1)
  end function inward

  !> Forces of the liquid on the side, along the axis, by node [N].
  pure function side_force(pore, rest) result(force)
    type(dem_pore_type), intent(in) :: pore
    real(wp), intent(in) :: rest(:)  !! (nodes) hydrostatic pressure [Pa]
    real(wp) :: force(size(pore%partner%node))
    associate (s => pore%partner)
      force = -inward(s%side)*over_side(pore%grid, s%side, pore%p(s%node) + rest(s%node))
    end associate
  end function side_force

  !> Liquid that came, forces and work of an exchange.
  subroutine book_partner(pore, span, inflow, rest)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: span                !! [s]
    real(wp), intent(in) :: inflow(:), rest(:)  !! (nodes) [m^3], hydrostatic pressure [Pa]
    real(wp), allocatable :: force(:)
    if (pore%partner%side == 0) return
    force = side_force(pore, rest)
    associate (s => pore%partner)
      if (s%held) s%inflow = s%inflow + inflow(s%node)
      if (s%held) pore%sums(sum_partner) = pore%sums(sum_partner) + sum(inflow(s%node))
      s%impulse = s%impulse + span*force
      s%work = s%work - span*sum(force*s%v)
    end associate
  end subroutine book_partner

  !> The side goes on by its mean motion: the grid stays a box.
  subroutine move_partner(pore, span)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: span  !! [s]
    real(wp) :: way
    integer(i4) :: axis
    if (pore%partner%side == 0) return
    associate (s => pore%partner, g => pore%grid)
      axis = axis_of(s%side)
      way = span*sum(over_side(g, s%side, s%v)) &
            /product(pack(g%upper - g%lower, [1, 2, 3] /= axis))
      if (end_of(s%side) == 1) then
        g%lower(axis) = g%lower(axis) + way
      else
        g%upper(axis) = g%upper(axis) + way
      end if
    end associate
  end subroutine move_partner

  !> Storage of all nodes; that of the partner's nodes is his.
  subroutine node_storage(pore, c)
    type(dem_pore_type), intent(in) :: pore
    real(wp), intent(out) :: c(:)  !! (nodes) [m^3/Pa]
    call storage(pore%grid, pore%porosity*max(pore%room, closed), pore%liquid%compliance, c)
    if (pore%partner%held) c(pore%partner%node) = 0.0_wp
  end subroutine node_storage
end module dem_pore_partner
