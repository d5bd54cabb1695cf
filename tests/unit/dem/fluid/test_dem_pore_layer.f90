!> Drains behind a layer: a steady flow through a column and its layer, and what leaves it.
program test_dem_pore_layer
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use dem_pore_fit, only: make_fit
  use dem_pore_grid, only: brick_count, node_count, node_place
  use dem_pore_hold, only: add_sources, hold_nodes
  use dem_pore_layer, only: add_layers, take_layers
  use dem_pore_partner, only: take_side, yield_to
  use dem_pore_operator, only: brick_matrices
  use dem_pore_solve, only: pore_equations_type, solve_pressure
  use dem_pore_start, only: size_pore
  use dem_pore_state, only: dem_pore_type, drain_flux, drain_pressure, sum_seepage
  implicit none
  type(test_type) :: test
  real(wp), parameter :: h = 4.0e-3_wp, layer = 1.0e-3_wp, outside = 500.0_wp, mobility = 1.0e-9_wp
  real(wp), parameter :: flux = 2.0e-4_wp, span = 1.0e-5_wp

  call check_column()
  call test%finish()

contains

  !> What comes in at the bottom of 2 x 2 x 3 bricks goes out at the top, through the layer there:
  !! p = p_d + q (layer + depth)/mobility.
  subroutine check_column()
    type(dem_pore_type) :: pore
    type(pore_equations_type) :: e
    real(wp), allocatable :: wanted(:), source(:), inflow(:)
    real(wp) :: area, depth
    integer(i4) :: a, turns, at(3)
    pore%grid%bricks = [2, 2, 3]
    pore%grid%upper = h*[2, 2, 3]
    call size_pore(1, pore)
    pore%mobility = mobility
    pore%porosity = 0.4_wp
    pore%drain(1, 3) = drain_flux
    pore%drain_value(1, 3) = flux
    pore%drain(2, 3) = drain_pressure
    pore%drain_value(2, 3) = outside
    pore%drain_layer(2, 3) = layer
    call hold_nodes(pore)
    call test%check('no node is held', all(pore%hold == 0))
    allocate (wanted(node_count(pore%grid)), source(node_count(pore%grid)))
    allocate (inflow(node_count(pore%grid)), source=0.0_wp)
    do a = 1, size(wanted)
      at = node_place(pore%grid, a)
      depth = h*(3 - at(3))
      wanted(a) = outside + flux*(layer + depth)/mobility
    end do
    allocate (e%matrix(8, 8, brick_count(pore%grid)))
    allocate (pore%fit%inverse_mass(1), source=0.0_wp)
    call make_fit(pore%grid, spread([h, h, h], 2, 1), [1.0e-9_wp], pore%fit)
    call brick_matrices(pore%grid, pore%fit, pore%mobility, span, e%matrix)
    source = 0.0_wp
    call add_sources(pore, source)
    e%storage = 0.0_wp*wanted
    e%rhs = span*source
    call add_layers(pore, span, e%storage, e%rhs)
    pore%p = 0.0_wp
    call solve_pressure(pore%grid, e, 0.0_wp*wanted + 1.0_wp, pore%p, turns)
    call test%check_all_close('pressures', pore%p/outside, wanted/outside, 1.0e-8_wp)
    pore%omega = 0.0_wp*wanted
    call take_layers(pore, span, inflow)
    area = 4.0_wp*h**2
    call test%check_close('what leaves', sum(inflow)/(flux*area*span), -1.0_wp, 1.0e-8_wp)
    call test%check_close('of the nodes', sum(pore%omega)/sum(inflow), 1.0_wp, 1.0e-14_wp)
    call test%check_close('by that side', pore%sums(sum_seepage + 6)/sum(inflow), -1.0_wp, &
                          1.0e-14_wp)
    call check_partner(pore)
    pore%drain_layer = 0.0_wp
    call hold_nodes(pore)
    call test%check('without a layer they are', count(pore%hold == 6) == 9)
    inflow = 0.0_wp
    call take_layers(pore, span, inflow)
    call test%check_all_close('and nothing flows', inflow, 0.0_wp, 0.0_wp)
  end subroutine check_column

  !> At the edge with a side of a partner that gives way no liquid goes through the layer.
  subroutine check_partner(pore)
    type(dem_pore_type), intent(inout) :: pore
    type(dem_pore_type) :: shared
    real(wp) :: inflow(size(pore%p)), alone(size(pore%p))
    shared = pore
    call take_side(shared, 1, .true.)
    call yield_to(shared, 0.0_wp*shared%partner%v + 1.0_wp, 0.0_wp*shared%partner%v)
    alone = 0.0_wp
    call take_layers(pore, span, alone)
    inflow = 0.0_wp
    call take_layers(shared, span, inflow)
    call test%check('it flows at the edge without one', all(alone(28:34:3) < 0.0_wp))
    alone(28:34:3) = 0.0_wp
    call test%check_all_close('none at the edge', inflow, alone, 1.0e-14_wp*max_abs(alone))
  end subroutine check_partner
end program test_dem_pore_layer
