!> Grid of the liquid: rigid motions compress nothing, uniform strains exactly, forces are the
!! transpose, resultants and moments those of the pressure, matrices symmetric and positive.
program test_dem_pore_operator
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type, max_abs
  use talus_vectors, only: cross
  use dem_pore_state, only: pore_grid_type, pore_fit_type
  use dem_pore_grid, only: brick_count, node_count, brick_edges, corners_of, node_place, brick_of, &
    place_in, stiffness, slopes, side_share, on_side, sign_of
  use dem_pore_fit, only: make_fit, fit_fields
  use dem_pore_operator, only: compress, add_hull, grain_forces, add_flow, storage, brick_matrices
  use dem_pore_solve, only: pore_equations_type, solve_pressure, apply
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 1500
  type(pore_grid_type) :: grid
  type(pore_fit_type) :: fit
  real(wp) :: x(3, n), volume(n), inverse_mass(n)
  real(wp), parameter :: size_of(3) = [0.03_wp, 0.02_wp, 0.04_wp]

  call make_cloud()
  call check_places()
  call check_integrals()
  call check_rigid()
  call check_strain()
  call check_power()
  call check_resultants()
  call check_matrices()
  call check_solution()
  call check_few()
  call test%finish()

contains

  !> A cloud of grains of many sizes in 3 x 2 x 4 bricks; one in ten does not give way.
  subroutine make_cloud()
    integer(i4) :: i
    grid%bricks = [3, 2, 4]
    grid%lower = [-0.01_wp, 0.005_wp, 0.1_wp]
    grid%upper = grid%lower + size_of
    do i = 1, n
      x(:, i) = grid%lower + size_of*[some(i, 1), some(i, 2), some(i, 3)]
      volume(i) = 1.0e-9_wp*(0.2_wp + some(i, 4))
      inverse_mass(i) = 1.0_wp/(2650.0_wp*volume(i))
      if (modulo(i, 10) == 0) inverse_mass(i) = 0.0_wp
    end do
    fit%inverse_mass = inverse_mass
    call make_fit(grid, x, volume, fit)
  end subroutine make_cloud

  !> Numbers in (0, 1) without pattern.
  pure real(wp) function some(i, k)
    integer(i4), intent(in) :: i, k
    real(wp), parameter :: step(5) = [0.6180339887_wp, 0.7548776662_wp, 0.5698402909_wp, &
                                      0.8191725134_wp, 0.4501945237_wp]
    some = modulo(i*step(k) + 0.5_wp, 1.0_wp)
  end function some

  subroutine check_places()
    integer(i4) :: node(8)
    call test%check('24 bricks', brick_count(grid) == 24)
    call test%check('60 nodes', node_count(grid) == 60)
    node = corners_of(grid, 24)
    call test%check('corners of the last brick', node(1) == 43 .and. node(8) == 60)
    call test%check('place of its last corner', all(node_place(grid, node(8)) == [3, 2, 4]))
    call test%check('place of a brick', all(place_in(grid, 24) == [2, 1, 3]))
    call test%check('brick of a corner', brick_of(grid, 1.0_wp/brick_edges(grid), grid%upper) == 24)
    call test%check('brick outside', brick_of(grid, 1.0_wp/brick_edges(grid), &
                                             grid%upper + 1.0e-6_wp) == 0)
    call test%check('all grains are listed', fit%start(25) == n + 1)
    call test%check('in rising order', all(fit%grain(fit%start(2):fit%start(3) - 2) < &
                                           fit%grain(fit%start(2) + 1:fit%start(3) - 1)))
  end subroutine check_places

  !> Functions of all nodes add up to 1: derivatives and flows to 0, shares to the side.
  subroutine check_integrals()
    real(wp) :: g(4, 3, 8), l(8, 8), area
    integer(i4) :: a
    g = slopes([1.0_wp, 2.0_wp, 3.0_wp])
    call test%check_all_close('slopes add up to nothing', sum(g, 3), 0.0_wp, 1.0e-14_wp)
    do a = 1, 8
      call test%check_all_close('slopes are integrals', g(:, :, a), integrated(a), 1.0e-14_wp)
    end do
    l = stiffness([1.0_wp, 2.0_wp, 3.0_wp])
    call test%check_all_close('flows add up to nothing', sum(l, 1), 0.0_wp, 1.0e-14_wp)
    call test%check_close('flow along z', dot_product([0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, &
      1.0_wp, 1.0_wp, 1.0_wp], matmul(l, [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, &
      1.0_wp, 1.0_wp])), 2.0_wp/3.0_wp, 1.0e-14_wp)
    area = 0.0_wp
    do a = 1, node_count(grid)
      if (on_side(grid, a, 2, 3)) area = area + side_share(grid, a, 3)
    end do
    call test%check_close('area of a side', area, size_of(1)*size_of(2), 1.0e-18_wp)
  end subroutine check_integrals

  !> Integral of the derivatives of N_a times 1 and each coordinate, by Gauss' rule, over a brick of
  !! 1 x 2 x 3.
  pure function integrated(a) result(total)
    integer(i4), intent(in) :: a
    real(wp) :: total(4, 3), place(3), n(3), slope(3), factor(3)
    real(wp), parameter :: edge(3) = [1.0_wp, 2.0_wp, 3.0_wp], at = 0.5_wp/sqrt(3.0_wp)
    integer(i4) :: k, j
    total = 0.0_wp
    do k = 0, 7
      place = at*merge(1.0_wp, -1.0_wp, [btest(k, 0), btest(k, 1), btest(k, 2)])
      n = 0.5_wp + sign_of(:, a)*place
      do j = 1, 3
        factor = n
        factor(j) = sign_of(j, a)/edge(j)
        slope(j) = product(factor)
        total(:, j) = total(:, j) + product(edge)/8.0_wp*slope(j)*[1.0_wp, place]
      end do
    end do
  end function integrated

  !> Translation and rotation of grains and walls: each compresses nothing inside; with the flow
  !! over the sides nothing at all. (A side that turns has no velocity along its normal in common:
  !! inner nodes alone are looked at there.)
  subroutine check_rigid()
    real(wp) :: v(3, n), rate(node_count(grid)), scale
    real(wp), parameter :: speed(3) = [0.3_wp, -0.7_wp, 0.4_wp]
    real(wp), parameter :: spin(3) = [40.0_wp, 25.0_wp, -9.0_wp]
    integer(i4) :: i, axis
    v = spread(speed, 2, n)
    call press(v, rate)
    call test%check_close('what a motion compresses adds up to nothing', sum(rate), 0.0_wp, &
                          1.0e-16_wp)
    do axis = 1, 3
      call add_hull(grid, 1, axis, speed(axis), rate)
      call add_hull(grid, 2, axis, speed(axis), rate)
    end do
    scale = max_abs(speed)*product(brick_edges(grid))**(2.0_wp/3.0_wp)
    call test%check_all_close('translation', rate/scale, 0.0_wp, 1.0e-12_wp)
    do i = 1, n
      v(:, i) = cross(spin, x(:, i))
    end do
    call press(v, rate)
    scale = max_abs(v)*product(brick_edges(grid))**(2.0_wp/3.0_wp)
    call test%check_all_close('rotation', inner(rate)/scale, 0.0_wp, 1.0e-12_wp)
  end subroutine check_rigid

  !> D v of the cloud.
  subroutine press(v, rate)
    real(wp), intent(in) :: v(:, :)
    real(wp), intent(out) :: rate(:)
    real(wp) :: field(4, 3, brick_count(grid))
    call fit_fields(fit, v, field)
    call compress(grid, field, rate)
  end subroutine press

  !> Values of nodes on no side.
  function inner(values) result(some_values)
    real(wp), intent(in) :: values(:)
    real(wp), allocatable :: some_values(:)
    integer(i4) :: a, at(3)
    allocate (some_values(0))
    do a = 1, node_count(grid)
      at = node_place(grid, a)
      if (all(at > 0 .and. at < grid%bricks)) some_values = [some_values, values(a)]
    end do
  end function inner

  !> Grains and walls strain uniformly: every node loses its share of volume.
  subroutine check_strain()
    real(wp) :: v(3, n), rate(node_count(grid)), share(node_count(grid))
    real(wp), parameter :: strain(3) = [0.02_wp, -0.05_wp, -0.01_wp], shear = 0.03_wp
    real(wp) :: one(brick_count(grid))
    integer(i4) :: i, axis
    do i = 1, n
      v(:, i) = strain*x(:, i)
    end do
    call press(v, rate)
    do axis = 1, 3
      call add_hull(grid, 1, axis, strain(axis)*grid%lower(axis), rate)
      call add_hull(grid, 2, axis, strain(axis)*grid%upper(axis), rate)
    end do
    one = 1.0_wp
    call storage(grid, one, 1.0_wp, share)
    call test%check_close('storage adds up to the volume', sum(share), product(size_of), 1.0e-18_wp)
    call test%check_all_close('uniform strain', rate/share, -sum(strain), 1.0e-12_wp)
    v(1, :) = v(1, :) + shear*x(2, :)
    call press(v, rate)
    call test%check_all_close('with shear', inner(rate/share), -sum(strain), 1.0e-12_wp)
  end subroutine check_strain

  !> F.v = -p.Dv for any motion and pressure.
  subroutine check_power()
    real(wp) :: v(3, n), force(3, n), rate(node_count(grid)), p(node_count(grid)), power(2)
    integer(i4) :: i
    do i = 1, n
      v(:, i) = [some(i, 5), some(i + 7, 2), some(i + 3, 4)] - 0.5_wp
    end do
    p = [(1.0e5_wp*(some(i, 3) - 0.3_wp), i=1, size(p))]
    call press(v, rate)
    call grain_forces(grid, fit, p, force)
    power = [sum(force*v), -sum(p*rate)]
    call test%check_close('power', power(1)/power(2), 1.0_wp, 1.0e-12_wp)
  end subroutine check_power

  !> Sums of forces and moments are those of -grad p over the grid.
  subroutine check_resultants()
    real(wp) :: force(3, n), p(node_count(grid)), total(3), moment(3), wanted(3), arm(3), h(3)
    real(wp) :: g(4, 3, 8), pull(4, 3), turning(3), centre(3)
    integer(i4) :: i, c, a, node(8)
    p = [(1.0e5_wp*(some(i, 3) - 0.3_wp), i=1, size(p))]
    call grain_forces(grid, fit, p, force)
    total = sum(force, 2)
    moment = 0.0_wp
    do i = 1, n
      moment = moment + cross(x(:, i), force(:, i))
    end do
    h = brick_edges(grid)
    g = slopes(h)
    wanted = 0.0_wp
    turning = 0.0_wp
    do c = 1, brick_count(grid)
      node = corners_of(grid, c)
      pull = 0.0_wp
      do a = 1, 8
        pull = pull - p(node(a))*g(:, :, a)
      end do
      wanted = wanted + pull(1, :)
      centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
      turning = turning + cross(centre, pull(1, :))
      do i = 1, 3
        arm = 0.0_wp
        arm(i) = h(i)
        turning = turning + cross(arm, pull(1 + i, :))
      end do
    end do
    call test%check_all_close('resultant', total/norm2(wanted), wanted/norm2(wanted), 1.0e-12_wp)
    call test%check_all_close('moment', moment/norm2(turning), turning/norm2(turning), 1.0e-12_wp)
  end subroutine check_resultants

  !> T L + T^2 D M^-1 D' by bricks is what the operators give, symmetric, and not negative.
  subroutine check_matrices()
    real(wp) :: mobility(brick_count(grid))
    type(pore_equations_type) :: e
    real(wp), dimension(node_count(grid)) :: p, q, flow, give, product, other
    real(wp) :: force(3, n), power
    real(wp), parameter :: span = 3.0e-6_wp
    integer(i4) :: i
    mobility = [(1.0e-9_wp*(1.0_wp + some(i, 1)), i=1, size(mobility))]
    p = [(some(i, 3) - 0.3_wp, i=1, size(p))]
    q = [(some(i, 2) - 0.6_wp, i=1, size(p))]
    allocate (e%matrix(8, 8, brick_count(grid)), e%storage(node_count(grid)))
    call brick_matrices(grid, fit, mobility, span, e%matrix)
    e%storage = 0.0_wp
    call apply(grid, e, p, product)
    flow = 0.0_wp
    call add_flow(grid, mobility, p, flow, power)
    call test%check_close('what flow dissipates', power, sum(p*flow), 1.0e-12_wp*power)
    call grain_forces(grid, fit, p, force)
    do i = 1, n
      force(:, i) = -inverse_mass(i)*force(:, i)
    end do
    call press(force, give)
    give = span*flow + span**2*give
    call test%check_all_close('matrices of bricks', product/max_abs(give), give/max_abs(give), &
                              1.0e-12_wp)
    call apply(grid, e, q, other)
    call test%check_close('symmetric', sum(q*product)/sum(p*other), 1.0_wp, 1.0e-12_wp)
    call test%check('positive', sum(p*product) > 0.0_wp .and. sum(q*other) > 0.0_wp)
    p = 1.0_wp
    call apply(grid, e, p, product)
    call test%check_all_close('one pressure moves nothing', product/max_abs(give), 0.0_wp, &
                              1.0e-12_wp)
  end subroutine check_matrices

  !> Pressures solve their equations where they are free and are kept where they are held.
  subroutine check_solution()
    type(pore_equations_type) :: e
    real(wp) :: mobility(brick_count(grid))
    real(wp), dimension(node_count(grid)) :: p, free, found
    integer(i4) :: i, turns
    mobility = 1.0e-9_wp
    allocate (e%matrix(8, 8, brick_count(grid)))
    call brick_matrices(grid, fit, mobility, 3.0e-6_wp, e%matrix)
    e%storage = [(1.0e-17_wp, i=1, size(p))]
    free = 1.0_wp
    free(:12) = 0.0_wp
    p = 0.0_wp
    p(:12) = 50.0_wp
    e%rhs = [(1.0e-13_wp*(some(i, 3) - 0.3_wp), i=1, size(p))]
    call solve_pressure(grid, e, free, p, turns)
    call apply(grid, e, p, found)
    call test%check('it converges', turns > 0 .and. turns < 200)
    call test%check_all_close('equations', free*found/max_abs(e%rhs), free*e%rhs/max_abs(e%rhs), &
                              1.0e-8_wp)
    call test%check_all_close('held pressures', p(:12), 50.0_wp, 0.0_wp)
    e%rhs = 0.0_wp
    p(:12) = 0.0_wp
    call solve_pressure(grid, e, free, p, turns)
    call test%check_all_close('nothing for nothing', p, 0.0_wp, 0.0_wp)
  end subroutine check_solution

  !> Few grains have one velocity; grains in a plane as well.
  subroutine check_few()
    type(pore_grid_type) :: one
    type(pore_fit_type) :: few
    real(wp) :: place(3, 12), v(3, 12), weight(12), field(4, 3, 1)
    integer(i4) :: i
    one%bricks = 1
    one%upper = 1.0_wp
    do i = 1, 12
      place(:, i) = [some(i, 1), some(i, 2), 0.5_wp]
      v(:, i) = [some(i, 3), 0.0_wp, 1.0_wp]
    end do
    weight = 1.0_wp
    call make_fit(one, place, weight, few)
    call fit_fields(few, v, field)
    call test%check_all_close('grains in a plane: the mean', field(1, :, 1), sum(v, 2)/12.0_wp, &
                              1.0e-14_wp)
    call test%check_all_close('and no slope', field(2:, :, 1), 0.0_wp, 0.0_wp)
  end subroutine check_few
end program test_dem_pore_operator
