!> The liquid at the start: sizes of all arrays, volumes of the grains, pores, carried mass.
module dem_pore_start
  use talus_kinds, only: wp, i4
  use dem_ellipsoid, only: rotation_of
  use dem_state, only: dem_data_type, dem_grains_type
  use dem_pore_state, only: dem_pore_type
  use dem_pore_grid, only: brick_count, node_count, brick_of, brick_edges
  use dem_pore_mixing, only: find_beside
  use dem_pore_medium, only: count_pores, set_mobility, ellipsoid_area
  implicit none
  private
  public :: begin_pore, boxes_of, size_pore, carry_liquid

  real(wp), parameter :: fullest = 0.8_wp  !! least solid fraction for what grains carry, over the
                                           !! largest of all bricks

contains

  !> Grains, grid and liquid are there: make all arrays and count the pores; p is zero.
  subroutine begin_pore(g, pore)
    type(dem_grains_type), intent(in) :: g
    type(dem_pore_type), intent(inout) :: pore
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: reach(3, g%n)
    integer(i4) :: i
    allocate (pore%volume(g%n), pore%area(g%n), pore%carried(g%n))
    do i = 1, g%n
      pore%volume(i) = 4.0_wp/3.0_wp*pi*product(g%axes(:, i))
      pore%area(i) = ellipsoid_area(g%axes(:, i))
    end do
    pore%carried = 0.0_wp
    call size_pore(g%n, pore)
    call boxes_of(g, reach)
    call count_pores(pore, g%x, reach)
    pore%first_porosity = pore%porosity
    call set_mobility(pore)
  end subroutine begin_pore

  !> Arrays of nodes, bricks and grains, all zero.
  subroutine size_pore(grains, pore)
    integer(i4), intent(in) :: grains
    type(dem_pore_type), intent(inout) :: pore
    integer(i4) :: nodes, bricks
    nodes = node_count(pore%grid)
    bricks = brick_count(pore%grid)
    allocate (pore%p(nodes), pore%omega(nodes), pore%hold_p(nodes), source=0.0_wp)
    allocate (pore%hold(nodes), source=0)
    allocate (pore%room(bricks), source=1.0_wp)
    allocate (pore%porosity(bricks), pore%sauter(bricks), pore%speed(bricks), &
              pore%mobility(bricks), source=0.0_wp)
    call find_beside(pore%grid, pore%mixing)
    allocate (pore%start_x(3, grains), pore%held(3, grains), pore%drag(3, grains), source=0.0_wp)
  end subroutine size_pore

  !> Half edges of the boxes around grains [m].
  subroutine boxes_of(g, reach)
    type(dem_grains_type), intent(in) :: g
    real(wp), intent(out) :: reach(:, :)  !! (3, grains)
    real(wp) :: r(3, 3)
    integer(i4) :: i, k
    do i = 1, g%n
      if (g%shapes%in_use .or. .not. maxval(g%axes(:, i)) > minval(g%axes(:, i))) then
        reach(:, i) = g%radius(i)
        cycle
      end if
      r = rotation_of(g%quat(:, i))
      do k = 1, 3
        reach(k, i) = norm2(r(k, :)*g%axes(:, i))
      end do
    end do
  end subroutine boxes_of

  !> Mass of the liquid that moves with each grain, (n/phi) V rho, as the pores are at the start;
  !! the masses of the grains have it in them from now on. A brick that the bed fills only in part
  !! counts as one that is nearly full.
  subroutine carry_liquid(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: least, solid
    integer(i4) :: i, c
    associate (pore => d%pore)
      least = fullest*(1.0_wp - minval(pore%porosity))
      do i = 1, d%grains%n
        c = brick_of(pore%grid, 1.0_wp/brick_edges(pore%grid), d%grains%x(:, i))
        if (c == 0) cycle
        solid = max(1.0_wp - pore%porosity(c), least)
        pore%carried(i) = (1.0_wp - solid)/solid*pore%volume(i)*pore%liquid%density
        d%grains%mass(i) = d%grains%mass(i) + pore%carried(i)
      end do
    end associate
  end subroutine carry_liquid
end module dem_pore_start
