!> Sides that are drained through a layer, as permeable as the bricks behind it: their nodes are not
!! held, what flows is proportional to their pressure over that of the drain. Nodes that a partner
!! has beside such a side, or that another drain holds, have no layer. eq. D.82
module dem_pore_layer
  use talus_kinds, only: wp, i4
  use dem_pore_grid, only: beside, brick_count, brick_edges, corners_of, on_side
  use dem_pore_hold, only: layered
  use dem_pore_partner, only: axis_of, end_of
  use dem_pore_state, only: dem_pore_type, sum_seepage
  implicit none
  private
  public :: add_layers, take_layers

contains

  !> How much flows through the layer of a side at each node, by pressure [m^3/(Pa s)].
  pure function conductance(pore, side) result(g)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: side  !! x0 x1 y0 y1 z0 z1
    real(wp) :: g(size(pore%p)), h(3), part
    integer(i4) :: c, k, axis, end, node(8)
    g = 0.0_wp
    axis = axis_of(side)
    end = end_of(side)
    if (.not. layered(pore, end, axis)) return
    h = brick_edges(pore%grid)
    part = 0.25_wp*product(h)/(h(axis)*pore%drain_layer(end, axis))
    do c = 1, brick_count(pore%grid)
      if (.not. beside(pore%grid, c, end, axis)) cycle
      node = corners_of(pore%grid, c)
      do k = 1, 8
        if (pore%hold(node(k)) == 0 .and. on_side(pore%grid, node(k), end, axis)) &
          g(node(k)) = g(node(k)) + part*pore%mobility(c)
      end do
    end do
    if (pore%partner%held) g(pore%partner%node) = 0.0_wp
  end function conductance

  !> What flows through layers in a time, into the equations of the pressures.
  pure subroutine add_layers(pore, span, storage, rhs)
    type(dem_pore_type), intent(in) :: pore
    real(wp), intent(in) :: span           !! [s]
    real(wp), intent(inout) :: storage(:)  !! (nodes) [m^3/Pa]
    real(wp), intent(inout) :: rhs(:)      !! (nodes) [m^3]
    real(wp) :: g(size(rhs))
    integer(i4) :: side
    do side = 1, 6
      g = span*conductance(pore, side)
      storage = storage + g
      rhs = rhs + g*pore%drain_value(end_of(side), axis_of(side))
    end do
  end subroutine add_layers

  !> What flowed through them: into the volumes of the nodes, and out of the sides.
  pure subroutine take_layers(pore, span, inflow)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: span          !! [s]
    real(wp), intent(inout) :: inflow(:)  !! (nodes) [m^3]
    real(wp) :: came(size(inflow))
    integer(i4) :: side
    do side = 1, 6
      came = span*conductance(pore, side)*(pore%drain_value(end_of(side), axis_of(side)) - pore%p)
      pore%omega = pore%omega + came
      inflow = inflow + came
      pore%sums(sum_seepage + side) = pore%sums(sum_seepage + side) - sum(came)
    end do
  end subroutine take_layers
end module dem_pore_layer
