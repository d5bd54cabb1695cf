!> A partner's side of the liquid's grid: which nodes it has, that motions without strain compress
!! nothing at any node, that powers of sweeping and forces agree, and that the grid follows.
program test_dem_pore_partner
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type, max_abs
  use dem_pore_fit, only: make_fit, fit_fields
  use dem_pore_grid, only: brick_count, brick_edges, node_count, node_place, on_side, side_share
  use dem_pore_hold, only: hold_nodes
  use dem_pore_operator, only: compress
  use dem_pore_partner, only: side_of_nodes, take_side, begin_interval, add_partner, &
    book_partner, move_partner, node_storage, over_side, side_force, yield_to, add_yield, &
    take_yield
  use dem_pore_state, only: dem_pore_type, by_partner, sum_partner
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 1500
  real(wp), parameter :: size_of(3) = [0.03_wp, 0.02_wp, 0.04_wp]
  type(dem_pore_type) :: pore
  real(wp) :: x(3, n)

  call make_cloud()
  call check_sides()
  call check_area()
  call check_shear()
  call check_squeeze()
  call check_books()
  call check_storage()
  call check_yield()
  call test%finish()

contains

  !> Grains of equal volume all over 3 x 2 x 4 bricks.
  subroutine make_cloud()
    real(wp), parameter :: step(3) = [0.6180339887_wp, 0.7548776662_wp, 0.5698402909_wp]
    integer(i4) :: i
    pore%grid%bricks = [3, 2, 4]
    pore%grid%lower = [-0.01_wp, 0.005_wp, 0.1_wp]
    pore%grid%upper = pore%grid%lower + size_of
    do i = 1, n
      x(:, i) = pore%grid%lower + size_of*modulo(i*step + 0.5_wp, 1.0_wp)
    end do
    call make_fit(pore%grid, x, spread(1.0e-9_wp, 1, n), pore%fit)
    allocate (pore%p(node_count(pore%grid)), pore%hold_p(node_count(pore%grid)), source=0.0_wp)
    allocate (pore%hold(node_count(pore%grid)), source=0_i4)
    allocate (pore%porosity(brick_count(pore%grid)), source=0.4_wp)
    allocate (pore%room(brick_count(pore%grid)), source=1.0_wp)
    pore%liquid%compliance = 5.0e-10_wp
  end subroutine make_cloud

  pure function nodes_on(end, axis) result(node)
    integer(i4), intent(in) :: end, axis
    integer(i4), allocatable :: node(:)
    integer(i4) :: a
    node = pack([(a, a=1, node_count(pore%grid))], &
                [(on_side(pore%grid, a, end, axis), a=1, node_count(pore%grid))])
  end function nodes_on

  subroutine check_sides()
    call test%check('lower x', side_of_nodes(pore%grid, nodes_on(1, 1)) == 1)
    call test%check('upper z', side_of_nodes(pore%grid, nodes_on(2, 3)) == 6)
    associate (node => nodes_on(2, 3))
      call test%check('a part of a side is none', side_of_nodes(pore%grid, node(2:)) == 0)
    end associate
  end subroutine check_sides

  !> A constant field: the shares of the nodes.
  subroutine check_area()
    integer(i4) :: a
    associate (node => nodes_on(2, 2))
      call test%check_all_close('shares of a side', over_side(pore%grid, 4, &
        [(1.0_wp, a=1, size(node))]), [(side_share(pore%grid, node(a), 2), a=1, size(node))], &
        1.0e-18_wp)
    end associate
  end subroutine check_area

  !> What the grains and these two z sides compress, with velocities v_z(x, z) of both.
  function compressed(slope, stretch) result(rate)
    real(wp), intent(in) :: slope, stretch  !! of v_z along x and z [1/s]
    real(wp) :: rate(node_count(pore%grid)), v(3, n), field(4, 3, brick_count(pore%grid))
    integer(i4) :: side
    v = 0.0_wp
    v(3, :) = slope*x(1, :) + stretch*(x(3, :) - pore%grid%lower(3))
    call fit_fields(pore%fit, v, field)
    call compress(pore%grid, field, rate)
    do side = 5, 6
      call take_side(pore, side, .false.)
      pore%partner%v = v_of(pore%partner%node, slope, stretch)
      call add_partner(pore, 1.0_wp, rate)
    end do
  end function compressed

  pure function v_of(node, slope, stretch) result(v)
    integer(i4), intent(in) :: node(:)
    real(wp), intent(in) :: slope, stretch
    real(wp) :: v(size(node)), at(3)
    integer(i4) :: k
    do k = 1, size(node)
      at = pore%grid%lower + brick_edges(pore%grid)*node_place(pore%grid, node(k))
      v(k) = slope*at(1) + stretch*(at(3) - pore%grid%lower(3))
    end do
  end function v_of

  !> A simple shear, which no mean motion of a side would get right at its edges.
  subroutine check_shear()
    real(wp) :: rate(node_count(pore%grid))
    rate = compressed(2.0_wp, 0.0_wp)
    call test%check_close('a shear compresses no node', max_abs(rate), 0.0_wp, 1.0e-17_wp)
  end subroutine check_shear

  subroutine check_squeeze()
    real(wp) :: rate(node_count(pore%grid))
    rate = compressed(0.0_wp, -3.0_wp)
    call test%check_close('a squeeze compresses all', sum(rate), 3.0_wp*product(size_of), &
                          1.0e-18_wp)
    call test%check('and every node', minval(rate) > 0.0_wp)
  end subroutine check_squeeze

  !> Work is minus force times way, sums of the liquid that came are kept, the box follows the mean.
  subroutine check_books()
    real(wp) :: hull(node_count(pore%grid)), rest(node_count(pore%grid)), came(size(hull))
    real(wp) :: before
    integer(i4) :: a
    pore%p = [(1.0e3_wp*sin(1.0_wp*a), a=1, size(pore%p))]
    rest = 500.0_wp
    call take_side(pore, 6, .true.)
    pore%partner%v = [(0.1_wp*cos(2.0_wp*a), a=1, size(pore%partner%v))]
    call begin_interval(pore)
    hull = 0.0_wp
    call add_partner(pore, 2.0_wp, hull)
    came = [(1.0e-9_wp*a, a=1, size(came))]
    call book_partner(pore, 2.0_wp, came, rest)
    call test%check_close('work of the side', pore%partner%work, sum((pore%p + rest)*hull), &
                          1.0e-15_wp)
    call test%check_all_close('impulse', pore%partner%impulse, 2.0_wp*side_force(pore, rest), &
                              1.0e-15_wp)
    call test%check_close('pressure on the upper side pushes it up', sum(side_force(pore, rest)), &
                          sum((pore%p + rest)*[(share(a), a=1, size(pore%p))]), 1.0e-14_wp)
    call test%check_all_close('liquid that came', pore%partner%inflow, came(pore%partner%node), &
                              0.0_wp)
    call test%check_close('its sum', pore%sums(sum_partner), sum(came(pore%partner%node)), &
                          1.0e-22_wp)
    before = pore%grid%upper(3)
    call move_partner(pore, 2.0_wp)
    call test%check_close('the box follows', pore%grid%upper(3) - before, &
                          -sum(hull)/product(size_of(:2)), 1.0e-16_wp)
    pore%grid%upper(3) = before
  end subroutine check_books

  pure real(wp) function share(a)
    integer(i4), intent(in) :: a
    share = 0.0_wp
    if (on_side(pore%grid, a, 2, 3)) share = side_share(pore%grid, a, 3)
  end function share

  !> The partner has the storage of its nodes, and holds them; not of an impervious side.
  subroutine check_storage()
    real(wp) :: c(node_count(pore%grid)), whole
    whole = 0.4_wp*5.0e-10_wp*product(size_of)
    call take_side(pore, 6, .false.)
    call node_storage(pore, c)
    call test%check_close('an impervious side keeps its storage', sum(c)/whole, 1.0_wp, 1.0e-14_wp)
    call take_side(pore, 6, .true.)
    pore%partner%p = 7.0_wp
    call node_storage(pore, c)
    call test%check_close('of four layers of bricks half a one is away', sum(c)/whole, 0.875_wp, &
                          1.0e-14_wp)
    call hold_nodes(pore)
    call test%check('its nodes are held', all(pore%hold(nodes_on(2, 3)) == by_partner))
    call test%check_close('by its pressures', sum(pore%hold_p), 7.0_wp*12, 1.0e-12_wp)
  end subroutine check_storage

  !> A side that gives way: its nodes are free, a pressure above that of the exchange before lets
  !! liquid out, none stays uncounted; without a conductance the pressures are held again.
  subroutine check_yield()
    real(wp), dimension(node_count(pore%grid)) :: storage, rhs, inflow
    real(wp) :: conduct(12), expected(12), whole
    integer(i4) :: node(12), a
    node = nodes_on(2, 3)
    conduct = [(1.0e-14_wp*a, a=1, 12)]
    expected = [(1.0e-9_wp*(a - 4), a=1, 12)]
    call yield_to(pore, conduct, expected)
    call hold_nodes(pore)
    call test%check('no node is held', all(pore%hold == 0))
    storage = 1.0e-15_wp
    rhs = 0.0_wp
    call add_yield(pore, 2.0_wp, storage, rhs)
    call test%check_all_close('as a storage', storage(node) - 1.0e-15_wp, conduct, 1.0e-28_wp)
    call test%check_all_close('from the pressure before', rhs(node), &
                              7.0_wp*conduct + 2.0_wp*expected, 1.0e-22_wp)
    call test%check_close('at the side alone', sum(storage), sum(conduct) + size(rhs)*1.0e-15_wp, &
                          1.0e-27_wp)
    pore%p = [(7.0_wp + modulo(a, 5), a=1, size(pore%p))]
    pore%omega = 0.0_wp*pore%p
    inflow = 0.0_wp
    call take_yield(pore, 2.0_wp, inflow)
    call test%check_all_close('what comes', inflow(node), &
                              2.0_wp*expected - conduct*(pore%p(node) - 7.0_wp), 1.0e-22_wp)
    whole = sum(pore%omega)
    call test%check_close('is in the grid', whole, sum(inflow), 1.0e-22_wp)
    call take_yield(pore, 0.0_wp, inflow)
    call test%check_close('the same pressure lets none over', max_abs(inflow(node)), 0.0_wp, &
                          1.0e-30_wp)
    call yield_to(pore, 0.0_wp*conduct, 0.0_wp*expected)
    call test%check('held again', all(pore%hold(node) == by_partner))
  end subroutine check_yield
end program test_dem_pore_partner
