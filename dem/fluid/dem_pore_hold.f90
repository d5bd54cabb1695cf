!> Nodes whose pressure is held: those of drained sides, those of still water above the bed, and
!! those of a partner.
module dem_pore_hold
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: dem_pore_type, drain_pressure, drain_flux, by_partner
  use dem_pore_grid, only: beside, brick_count, node_count, corners_of, place_in, on_side, &
    side_share
  use dem_pore_tools, only: is_in
  implicit none
  private
  public :: hold_nodes, hold_pressures, add_sources, find_empty, find_open, layered

  real(wp), parameter :: open_share = 0.15_wp  !! solid fraction below which a brick is open water

contains

  !> Number of a side: x0 x1 y0 y1 z0 z1.
  pure integer(i4) function side_of(end, axis)
    integer(i4), intent(in) :: end, axis
    side_of = end + 2*(axis - 1)
  end function side_of

  !> Nodes that are held, as the pores are now: sides first, then bricks that hold hardly a grain
  !! and are joined to a drained side by others alike, whose corners have its pressure.
  subroutine hold_nodes(pore)
    type(dem_pore_type), intent(inout) :: pore
    integer(i4), allocatable :: still(:)
    integer(i4) :: a, c, end, axis, node(8)

    pore%hold = 0
    do axis = 1, 3
      do end = 1, 2
        if (.not. holds(pore, end, axis)) cycle
        do a = 1, node_count(pore%grid)
          if (on_side(pore%grid, a, end, axis)) pore%hold(a) = side_of(end, axis)
        end do
      end do
    end do
    if (pore%free_surface) then
      call find_still(pore, still)
      do c = 1, size(still)
        if (still(c) == 0) cycle
        node = corners_of(pore%grid, c)
        pore%hold(node) = still(c)
      end do
    end if
    if (pore%partner%held) &
      pore%hold(pore%partner%node) = merge(0, by_partner, pore%partner%yields)
    call hold_pressures(pore)
  end subroutine hold_nodes

  !> Does a side hold the pressures of its nodes? Not behind a layer.
  pure logical function holds(pore, end, axis)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: end, axis
    holds = pore%drain(end, axis) == drain_pressure .and. .not. layered(pore, end, axis)
  end function holds

  !> Is a side drained through a layer?
  pure logical function layered(pore, end, axis)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: end, axis
    layered = pore%drain(end, axis) == drain_pressure .and. pore%drain_layer(end, axis) > 0.0_wp
  end function layered

  !> Pressures of the drains to the nodes that they hold.
  subroutine hold_pressures(pore)
    type(dem_pore_type), intent(inout) :: pore
    real(wp) :: value(0:by_partner)
    value = 0.0_wp
    value(1:6) = reshape(pore%drain_value, [6])
    pore%hold_p = value(pore%hold)
    if (pore%partner%held .and. .not. pore%partner%yields) &
      pore%hold_p(pore%partner%node) = pore%partner%p
  end subroutine hold_pressures

  !> Side whose still water each brick is of, 0: none.
  subroutine find_still(pore, still)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), allocatable, intent(out) :: still(:)
    integer(i4) :: c, axis, end, at(3), next(3)
    logical :: found
    allocate (still(brick_count(pore%grid)), source=0)
    found = .true.
    do while (found)
      found = .false.
      do c = 1, size(still)
        if (still(c) > 0 .or. 1.0_wp - pore%porosity(c) >= open_share) cycle
        at = place_in(pore%grid, c)
        do axis = 1, 3
          do end = 1, 2
            next = at
            next(axis) = next(axis) + 2*end - 3
            if (next(axis) >= 0 .and. next(axis) < pore%grid%bricks(axis)) then
              if (still(number_of(next)) > 0) still(c) = still(number_of(next))
            else if (holds(pore, end, axis)) then
              still(c) = side_of(end, axis)
            end if
          end do
        end do
        found = found .or. still(c) > 0
      end do
    end do

  contains

    pure integer(i4) function number_of(place)
      integer(i4), intent(in) :: place(3)
      number_of = 1 + place(1) + pore%grid%bricks(1)*(place(2) + pore%grid%bricks(2)*place(3))
    end function number_of
  end subroutine find_still

  !> Flow that enters at the nodes of sides with a given flux [m^3/s].
  subroutine add_sources(pore, rate)
    type(dem_pore_type), intent(in) :: pore
    real(wp), intent(inout) :: rate(:)  !! (nodes)
    integer(i4) :: a, end, axis
    do axis = 1, 3
      do end = 1, 2
        if (pore%drain(end, axis) /= drain_flux) cycle
        do a = 1, node_count(pore%grid)
          if (on_side(pore%grid, a, end, axis)) &
            rate(a) = rate(a) + pore%drain_value(end, axis)*side_share(pore%grid, a, axis)
        end do
      end do
    end do
  end subroutine add_sources

  !> A brick without grains that has a corner whose pressure is not held; 0: there is none.
  integer(i4) function find_empty(pore) result(brick)
    type(dem_pore_type), intent(in) :: pore
    do brick = 1, brick_count(pore%grid)
      if (pore%fit%start(brick + 1) > pore%fit%start(brick) .or. is_in(pore%fit%tools, brick)) cycle
      if (any(pore%hold(corners_of(pore%grid, brick)) == 0)) return
    end do
    brick = 0
  end function find_empty

  !> A brick of open water at a side behind a layer, which no other drain makes still; 0: there is
  !! none.
  integer(i4) function find_open(pore) result(brick)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), allocatable :: still(:)
    integer(i4) :: side
    brick = 0
    if (.not. pore%free_surface) return
    call find_still(pore, still)
    do brick = 1, brick_count(pore%grid)
      if (still(brick) > 0 .or. 1.0_wp - pore%porosity(brick) >= open_share) cycle
      do side = 1, 6
        if (layered(pore, 2 - modulo(side, 2), (side + 1)/2) .and. &
            beside(pore%grid, brick, 2 - modulo(side, 2), (side + 1)/2)) return
      end do
    end do
    brick = 0
  end function find_open
end module dem_pore_hold
