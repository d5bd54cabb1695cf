!> What flows between the grains of each brick: porosity, diameter, mobility.
!!
!! The volume of a grain is shared among bricks by the parts of its bounding box that lie in them,
!! so that a grain that goes from one to the next changes both gradually. eq. D.41
module dem_pore_medium
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type, dem_pore_type
  use dem_pore_grid, only: brick_count, brick_edges, corners_of
  use dem_pore_laws, only: drag_of, law_constant
  use dem_pore_tools, only: tool_share
  implicit none
  private
  public :: count_pores, set_mobility, see_flow, darcy_velocity, ellipsoid_area, drag_in
  public :: porosity_change

  real(wp), parameter :: clear = 0.01_wp  !! solid fraction that a brick has at least, for the law
  real(wp), parameter :: sliver = 0.02_wp !! part of a brick beside a tool in which grains are not
                                          !! counted
  real(wp), parameter :: dense = 0.3_wp   !! porosity where no brick is without a tool
  real(wp), parameter :: closed = 1.0e-6_wp  !! of the mobility that a brick within a tool keeps

contains

  !> Porosity and diameter of Sauter of all bricks, of boxes of half edges `reach` around grains.
  subroutine count_pores(pore, x, reach)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: x(:, :), reach(:, :)  !! (3, grains) [m]
    real(wp), allocatable :: solid(:), surface(:)
    integer(i4) :: i, bricks
    bricks = brick_count(pore%grid)
    allocate (solid(bricks), surface(bricks), source=0.0_wp)
    do i = 1, size(x, 2)
      call share_grain(pore%grid, x(:, i) - reach(:, i), x(:, i) + reach(:, i), &
                       [pore%volume(i), pore%area(i)], is_whole(i), solid, surface)
    end do
    call find_porosity(pore, solid/product(brick_edges(pore%grid)))
    pore%sauter = 6.0_wp*solid/max(surface, tiny(1.0_wp))

  contains

    !> Of a ghost on a side only that part counts that is in the grid.
    pure logical function is_whole(i)
      integer(i4), intent(in) :: i
      is_whole = .true.
      if (allocated(pore%fit%counts)) is_whole = pore%fit%counts(i)
    end function is_whole
  end subroutine count_pores

  !> Porosity of what tools leave of a brick. Grains beside a tool are counted by their boxes, which
  !! reach into it: there pores are not below those of the densest brick without one.
  subroutine find_porosity(pore, solid)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: solid(:)  !! (bricks) volume of grains over that of the brick [-]
    real(wp) :: tightest
    integer(i4) :: c
    pore%porosity = 1.0_wp - solid
    do c = 1, size(solid)
      pore%room(c) = max(0.0_wp, 1.0_wp - tool_share(pore%grid, pore%fit%tools, c))
    end do
    if (all(pore%room >= 1.0_wp)) return
    tightest = dense
    if (any(pore%room >= 1.0_wp)) tightest = minval(pore%porosity, mask=pore%room >= 1.0_wp)
    do c = 1, size(solid)
      if (pore%room(c) >= 1.0_wp) cycle
      pore%porosity(c) = tightest
      if (pore%room(c) > sliver) pore%porosity(c) = max(tightest, 1.0_wp - solid(c)/pore%room(c))
    end do
  end subroutine find_porosity

  !> One grain's volume and surface into the bricks that its box meets; what is outside the grid
  !! counts for those inside, if it is to count as a whole.
  pure subroutine share_grain(grid, low, high, amount, in_whole, solid, surface)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: low(3), high(3)  !! corners of the box [m]
    real(wp), intent(in) :: amount(2)        !! volume [m^3], surface [m^2]
    logical, intent(in) :: in_whole
    real(wp), intent(inout) :: solid(:), surface(:)
    integer(i4) :: first(3), last(3), i, j, k, c
    real(wp) :: h(3), whole, part
    real(wp) :: share(3, 2)  !! of two bricks along each axis

    if (any(high <= grid%lower .or. low >= grid%upper)) return
    h = brick_edges(grid)
    first = max(0, min(int((low - grid%lower)/h, i4), grid%bricks - 1))
    last = max(first, min(int((high - grid%lower)/h, i4), grid%bricks - 1))
    last = min(last, first + 1)
    share(:, 1) = min(high, grid%lower + h*(first + 1)) - max(low, grid%lower)
    share(:, 2) = min(high, grid%upper) - (grid%lower + h*(first + 1))
    where (last == first) share(:, 2) = 0.0_wp
    whole = product(high - low)
    if (in_whole) whole = product(share(:, 1) + share(:, 2))
    do k = first(3), last(3)
      do j = first(2), last(2)
        do i = first(1), last(1)
          c = 1 + i + grid%bricks(1)*(j + grid%bricks(2)*k)
          part = share(1, 1 + i - first(1))*share(2, 1 + j - first(2))* &
                 share(3, 1 + k - first(3))/whole
          solid(c) = solid(c) + part*amount(1)
          surface(c) = surface(c) + part*amount(2)
        end do
      end do
    end do
  end subroutine share_grain

  !> Mobility of all bricks by the law, at the speed that was seen last.
  subroutine set_mobility(pore)
    type(dem_pore_type), intent(inout) :: pore
    real(wp) :: n
    integer(i4) :: c
    do c = 1, brick_count(pore%grid)
      if (pore%liquid%law == law_constant) then
        pore%mobility(c) = pore%liquid%factor*pore%liquid%permeability/pore%liquid%viscosity
      else
        n = min(pore%porosity(c), 1.0_wp - clear)
        pore%mobility(c) = pore%liquid%factor*n**2/drag_in(pore, c)
      end if
      pore%mobility(c) = max(pore%room(c), closed)*pore%mobility(c)
    end do
  end subroutine set_mobility

  !> Drag on the grains of a unit of volume of a brick, without the factor on the permeability
  !! [Pa s/m^2].
  pure real(wp) function drag_in(pore, c) result(beta)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: c
    real(wp) :: n, d
    n = min(pore%porosity(c), 1.0_wp - clear)
    if (pore%liquid%law == law_constant) then
      beta = n**2*pore%liquid%viscosity/max(pore%liquid%permeability, tiny(1.0_wp))
      return
    end if
    d = pore%sauter(c)
    if (.not. d > 0.0_wp) d = maxval(pore%sauter)
    beta = drag_of(pore%liquid%law, n, d, pore%liquid%viscosity, &
                   pore%liquid%density*pore%speed(c)*d/pore%liquid%viscosity)
  end function drag_in

  !> The law sees the mean of the speed of the flow now and that it saw before; the largest Reynolds
  !! number is kept.
  subroutine see_flow(pore)
    type(dem_pore_type), intent(inout) :: pore
    real(wp) :: reynolds
    integer(i4) :: c
    reynolds = 0.0_wp
    do c = 1, brick_count(pore%grid)
      pore%speed(c) = 0.5_wp*(pore%speed(c) + norm2(darcy_velocity(pore, c)))
      reynolds = max(reynolds, pore%liquid%density*pore%speed(c)*pore%sauter(c)/ &
                               pore%liquid%viscosity)
    end do
    if (reynolds > pore%fastest(1)) pore%fastest = [reynolds, pore%since]
  end subroutine see_flow

  !> Largest change of the porosity of a brick since the start, of those that hold a bed and no tool
  !! has half of [-].
  pure real(wp) function porosity_change(pore) result(change)
    type(dem_pore_type), intent(in) :: pore
    change = maxval(abs(pore%porosity - pore%first_porosity), mask=pore%room > 0.5_wp)
    change = max(change, 0.0_wp)
  end function porosity_change

  !> Darcy's velocity at the centre of a brick [m/s].
  pure function darcy_velocity(pore, c) result(w)
    type(dem_pore_type), intent(in) :: pore
    integer(i4), intent(in) :: c
    real(wp) :: w(3), p(8)
    p = pore%p(corners_of(pore%grid, c))
    w(1) = sum(p(2:8:2) - p(1:7:2))
    w(2) = sum(p([3, 4, 7, 8]) - p([1, 2, 5, 6]))
    w(3) = sum(p(5:8) - p(1:4))
    w = -pore%mobility(c)*w/(4.0_wp*brick_edges(pore%grid))
  end function darcy_velocity

  !> Surface of an ellipsoid, to 1.1 % (Thomsen); of a sphere exactly [m^2].
  pure real(wp) function ellipsoid_area(axes) result(area)
    real(wp), intent(in) :: axes(3)  !! semi-axes [m]
    real(wp), parameter :: pi = acos(-1.0_wp), power = 1.6075_wp
    real(wp) :: t(3)
    t = (axes/maxval(axes))**power
    area = 4.0_wp*pi*maxval(axes)**2*((t(1)*t(2) + t(2)*t(3) + t(3)*t(1))/3.0_wp)**(1.0_wp/power)
  end function ellipsoid_area
end module dem_pore_medium
