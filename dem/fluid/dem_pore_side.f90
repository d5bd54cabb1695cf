!> The liquid at the sides of its grid, as walls on them feel it.
module dem_pore_side
  use talus_kinds, only: wp, i4
  use dem_pore_grid, only: node_count, on_side, side_share
  use dem_pore_state, only: dem_pore_type
  implicit none
  private
  public :: side_mean, wall_pressure, wall_stiffness

contains

  !> Mean pressure over a side, x0 x1 y0 y1 z0 z1 [Pa].
  pure real(wp) function side_mean(pore, side) result(mean)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: side
    integer(i4) :: a, axis
    real(wp) :: area, share
    axis = (side + 1)/2
    mean = 0.0_wp
    area = 0.0_wp
    do a = 1, node_count(pore%grid)
      if (.not. on_side(pore%grid, a, 2 - modulo(side, 2), axis)) cycle
      share = side_share(pore%grid, a, axis)
      mean = mean + share*pore%p(a)
      area = area + share
    end do
    mean = mean/area
  end function side_mean

  !> Mean pressure on a wall; none on one that is on no side [Pa].
  pure real(wp) function wall_pressure(pore, wall) result(pressure)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: wall
    integer(i4) :: side
    pressure = 0.0_wp
    if (.not. pore%active) return
    side = findloc(reshape(pore%wall, [6]), wall, 1)
    if (side > 0) pressure = side_mean(pore, side)
  end function wall_pressure

  !> Stiffness of the liquid against a wall of this area, as if none drained [N/m].
  pure real(wp) function wall_stiffness(pore, wall, area) result(stiffness)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: wall
    real(wp), intent(in) :: area  !! [m^2]
    integer(i4) :: side, axis
    stiffness = 0.0_wp
    if (.not. pore%active) return
    side = findloc(reshape(pore%wall, [6]), wall, 1)
    if (side == 0 .or. .not. pore%liquid%compliance > 0.0_wp) return
    axis = (side + 1)/2
    stiffness = area*size(pore%porosity)/(pore%liquid%compliance*sum(pore%porosity*pore%room) &
                                          *(pore%grid%upper(axis) - pore%grid%lower(axis)))
  end function wall_stiffness
end module dem_pore_side
