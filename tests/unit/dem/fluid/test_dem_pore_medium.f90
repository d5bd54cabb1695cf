!> Pores of bricks: shares of grains, diameters, mobilities, flow; still water above a bed; bounds.
program test_dem_pore_medium
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_pore_cavity, only: solve_bounded, hydrostatic, is_cavity
  use dem_pore_grid, only: node_count, brick_edges
  use dem_pore_hold, only: hold_nodes, find_empty, add_sources
  use dem_pore_laws, only: law_index
  use dem_pore_medium, only: count_pores, set_mobility, see_flow, darcy_velocity, ellipsoid_area
  use dem_pore_solve, only: pore_equations_type, apply
  use dem_pore_start, only: size_pore
  use dem_pore_state, only: dem_pore_type, drain_pressure, drain_flux
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp), h = 4.0e-3_wp

  call check_shares()
  call check_flow()
  call check_still_water()
  call check_bound()
  call test%finish()

contains

  !> A column of so many bricks, for one grain of 1 mm.
  subroutine make_column(bricks, pore)
    integer(i4), intent(in) :: bricks(3)
    type(dem_pore_type), intent(out) :: pore
    pore%grid%bricks = bricks
    pore%grid%upper = h*bricks
    pore%liquid%density = 1000.0_wp
    pore%liquid%viscosity = 1.0e-3_wp
    pore%liquid%law = law_index('kozeny_carman')
    call size_pore(1, pore)
    pore%volume = [pi/6.0_wp*1.0e-9_wp]
    pore%area = [pi*1.0e-6_wp]
  end subroutine make_column

  !> A grain counts for the bricks that its box meets, as a whole.
  subroutine check_shares()
    type(dem_pore_type) :: pore
    real(wp) :: reach(3, 1), solid(4), long(3)
    call make_column([2, 1, 2], pore)
    reach = 0.5e-3_wp
    call count_pores(pore, reshape([2.0e-3_wp, 2.0e-3_wp, 2.0e-3_wp], [3, 1]), reach)
    solid = (1.0_wp - pore%porosity)*h**3/pore%volume(1)
    call test%check_all_close('in one brick', solid, [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1.0e-12_wp)
    call test%check_close('diameter of Sauter', pore%sauter(1), 1.0e-3_wp, 1.0e-15_wp)
    call count_pores(pore, reshape([h, 2.0e-3_wp, h + 0.25e-3_wp], [3, 1]), reach)
    solid = (1.0_wp - pore%porosity)*h**3/pore%volume(1)
    call test%check_all_close('on an edge', solid, [0.125_wp, 0.125_wp, 0.375_wp, 0.375_wp], &
                              1.0e-12_wp)
    call count_pores(pore, reshape([0.25e-3_wp, 2.0e-3_wp, 2.0e-3_wp], [3, 1]), reach)
    solid = (1.0_wp - pore%porosity)*h**3/pore%volume(1)
    call test%check_close('over a side: inside', solid(1), 1.0_wp, 1.0e-12_wp)
    call test%check_close('surface of a sphere', ellipsoid_area([2.0_wp, 2.0_wp, 2.0_wp]), &
                          16.0_wp*pi, 1.0e-12_wp)
    long = [1.0_wp, 1.0_wp, 2.0_wp]
    call test%check_close('of a prolate one', ellipsoid_area(long), 21.4784_wp, 0.011_wp*21.4784_wp)
  end subroutine check_shares

  !> Kozeny and Carman's permeability; Darcy's velocity, of which the law sees the mean.
  subroutine check_flow()
    type(dem_pore_type) :: pore
    real(wp) :: w(3)
    integer(i4) :: a
    call make_column([1, 1, 2], pore)
    pore%porosity = 0.4_wp
    pore%sauter = 1.0e-3_wp
    pore%liquid%factor = 0.5_wp
    call set_mobility(pore)
    call test%check_close('mobility', pore%mobility(1)/(0.5_wp*0.4_wp**3*1.0e-6_wp &
                          /(180.0_wp*0.36_wp*1.0e-3_wp)), 1.0_wp, 1.0e-12_wp)
    pore%p = [((a - 1)/4*100.0_wp, a=1, node_count(pore%grid))]
    w = darcy_velocity(pore, 2)
    call test%check_all_close('flow', w/(pore%mobility(2)*100.0_wp/h), [0.0_wp, 0.0_wp, -1.0_wp], &
                              1.0e-12_wp)
    call see_flow(pore)
    call test%check_close('seen', pore%speed(2), 0.5_wp*abs(w(3)), 1.0e-18_wp)
  end subroutine check_flow

  !> Open bricks at a drained side have its pressure, unless the grid is closed; fluxes enter.
  subroutine check_still_water()
    type(dem_pore_type) :: pore
    real(wp), allocatable :: entered(:)
    call make_column([1, 1, 4], pore)
    pore%porosity = [0.4_wp, 0.95_wp, 0.5_wp, 0.9_wp]
    pore%drain(2, 3) = drain_pressure
    pore%drain_value(2, 3) = 7.0_wp
    pore%drain(1, 3) = drain_flux
    pore%drain_value(1, 3) = 0.25_wp
    call hold_nodes(pore)
    call test%check('still water down to the bed', all(pore%hold(13:) == 6) .and. &
                    all(pore%hold(:12) == 0))
    call test%check_all_close('its pressure', pore%hold_p(13:), 7.0_wp, 0.0_wp)
    allocate (entered(node_count(pore%grid)), source=0.0_wp)
    call add_sources(pore, entered)
    call test%check_close('flux over the side', sum(entered), 0.25_wp*h**2, 1.0e-18_wp)
    call test%check_close('at its nodes', sum(entered(:4)), 0.25_wp*h**2, 1.0e-18_wp)
    pore%fit%start = [1, 2, 2, 3, 3]
    call test%check('the cavity is found', find_empty(pore) == 2)
    pore%free_surface = .false.
    call hold_nodes(pore)
    call test%check('closed: the side alone', all(pore%hold(17:) == 6) .and. &
                    all(pore%hold(:16) == 0))
  end subroutine check_still_water

  !> Pressures at the bound lack liquid, those above it do not.
  subroutine check_bound()
    type(dem_pore_type) :: pore
    type(pore_equations_type) :: e
    real(wp), dimension(8) :: p, low, free, left
    integer(i4) :: a, turns
    call make_column([1, 1, 1], pore)
    allocate (e%matrix(8, 8, 1), source=-0.1_wp)
    do a = 1, 8
      e%matrix(a, a, 1) = 1.0_wp
    end do
    e%storage = [(0.5_wp, a=1, 8)]
    e%rhs = [-4.0_wp, 1.0_wp, -0.1_wp, 2.0_wp, -9.0_wp, 0.0_wp, 0.3_wp, -0.4_wp]
    low = -1.0_wp - hydrostatic(pore%grid, [0.0_wp, 0.0_wp, -100.0_wp])
    call test%check_all_close('rest', low, [-1.4_wp, -1.4_wp, -1.4_wp, -1.4_wp, -1.0_wp, -1.0_wp, &
                              -1.0_wp, -1.0_wp], 1.0e-14_wp)
    free = 1.0_wp
    p = 0.0_wp
    call solve_bounded(pore%grid, e, free, low, p, turns)
    call apply(pore%grid, e, p, left)
    left = left - e%rhs
    call test%check('found', turns > 0)
    call test%check('two cavities', count(is_cavity(p, low)) == 2)
    call test%check('none below', all(p >= low - 1.0e-12_wp))
    call test%check('they lack liquid', all(left > -1.0e-8_wp))
    call test%check_all_close('others do not', merge(0.0_wp, left, is_cavity(p, low)), 0.0_wp, &
                              1.0e-8_wp)
    call test%check('edges', all(abs(brick_edges(pore%grid) - h) < 1.0e-18_wp))
  end subroutine check_bound
end program test_dem_pore_medium
