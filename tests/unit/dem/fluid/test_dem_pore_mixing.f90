!> Mixing of the liquid within bricks: what it takes and what it leaves, its mass, its rate.
program test_dem_pore_mixing
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type, max_abs
  use dem_pore_fit, only: make_fit
  use dem_pore_grid, only: brick_count, node_count, node_place
  use dem_pore_mixing, only: add_mixing, alternating, begin_mixing, mixing_diagonal
  use dem_pore_solve, only: apply, pore_equations_type, solve_pressure
  use dem_pore_start, only: size_pore
  use dem_pore_state, only: dem_pore_type, pore_mixing_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: h = 4.0e-3_wp, mass = 2.0e-6_wp, diameter = 1.0e-3_wp, span = 3.0e-6_wp

  call check_pattern()
  call check_smooth()
  call check_order()
  call check_operator()
  call check_rate()
  call test%finish()

contains

  !> Bricks with eight spheres each, at the corners of a cube.
  subroutine make_bed(bricks, edge, pore)
    integer(i4), intent(in) :: bricks(3)
    real(wp), intent(in) :: edge
    type(dem_pore_type), intent(out) :: pore
    real(wp) :: x(3, 8*product(bricks)), volume(8*product(bricks))
    integer(i4) :: i, j, k, n, at(3)
    pore%grid%bricks = bricks
    pore%grid%upper = edge*bricks
    n = size(volume)
    call size_pore(n, pore)
    k = 0
    do i = 0, product(bricks) - 1
      at = [modulo(i, bricks(1)), modulo(i/bricks(1), bricks(2)), i/(bricks(1)*bricks(2))]
      do j = 0, 7
        k = k + 1
        x(:, k) = edge*(at + 0.25_wp + 0.5_wp*[modulo(j, 2), modulo(j/2, 2), j/4])
      end do
    end do
    volume = diameter**3/2.0_wp
    allocate (pore%fit%inverse_mass(n), source=1.0_wp/mass)
    call make_fit(pore%grid, x, volume, pore%fit)
    pore%sauter = diameter
    pore%room = 1.0_wp
    pore%span = span
    pore%p = 0.0_wp*pore%p
  end subroutine make_bed

  !> Places of the nodes along x, y, z in bricks.
  pure function places(pore) result(x)
    type(dem_pore_type), intent(in) :: pore
    real(wp) :: x(3, node_count(pore%grid))
    integer(i4) :: a
    do a = 1, size(x, 2)
      x(:, a) = node_place(pore%grid, a)
    end do
  end function places

  !> Pressures of +1 and -1 in turn are seen as they are, flow from one to the other, and what the
  !! solver finds of them in a time is what is left of the volume that they have.
  subroutine check_pattern()
    type(dem_pore_type) :: pore
    type(pore_equations_type) :: e
    real(wp), allocatable :: x(:, :), p(:), flow(:)
    integer(i4) :: turns
    call make_bed([2, 3, 4], h, pore)
    x = places(pore)
    p = 7.0_wp*(-1.0_wp)**nint(sum(x, 1))
    pore%p = p
    call test%check_close('amplitude', alternating(pore), 7.0_wp, 1.0e-13_wp)
    pore%room(1) = 0.5_wp
    call test%check_close('bricks with a body do not count', alternating(pore), 7.0_wp, 1.0e-13_wp)
    call begin_mixing(pore)
    e%mixing = pore%mixing
    flow = 0.0_wp*p
    call add_mixing(e%mixing, 1.0_wp, p, flow)
    call test%check_close('what is lost', sum(p*flow)/(49.0_wp*sum(e%mixing%rate)), 1.0_wp, &
                          1.0e-12_wp)
    call test%check('from high to low', all(flow*p > 0.0_wp))
    e%span = span
    e%storage = 1.0e-3_wp*span*e%mixing%rate(1) + 0.0_wp*p
    e%rhs = e%storage*p
    allocate (e%matrix(8, 8, brick_count(pore%grid)), source=0.0_wp)
    pore%p = 0.0_wp
    call solve_pressure(pore%grid, e, 0.0_wp*p + 1.0_wp, pore%p, turns)
    call test%check('the solver converges', turns > 0 .and. turns < 60)
    call test%check('hardly anything is left', alternating(pore) < 0.05_wp*7.0_wp)
    call test%check_close('volumes are kept', sum(e%storage*pore%p)/sum(e%storage*abs(p)), &
                          sum(e%storage*p)/sum(e%storage*abs(p)), 1.0e-9_wp)
  end subroutine check_pattern

  !> Pressures that are linear, bilinear or trilinear over the whole grid stay.
  subroutine check_smooth()
    type(dem_pore_type) :: pore
    type(pore_mixing_type) :: mixing
    real(wp), allocatable :: x(:, :), p(:), flow(:)
    call make_bed([3, 4, 5], h, pore)
    call begin_mixing(pore)
    mixing = pore%mixing
    x = places(pore)
    p = 3.0_wp - x(1, :) + 2.0_wp*x(2, :) + 5.0_wp*x(3, :) + x(1, :)*x(2, :) &
        - x(2, :)*x(3, :) + 2.0_wp*x(3, :)*x(1, :)
    flow = 0.0_wp*p
    call add_mixing(mixing, 1.0_wp, p, flow)
    call test%check_all_close('bilinear', flow/(max_abs(p)*mixing%rate(1)), 0.0_wp, 1.0e-14_wp)
    p = x(1, :)*x(2, :)*x(3, :)
    flow = 0.0_wp*p
    call add_mixing(mixing, 1.0_wp, p, flow)
    call test%check_all_close('trilinear', flow/(max_abs(p)*mixing%rate(1)), 0.0_wp, 1.0e-14_wp)
  end subroutine check_smooth

  !> What mixing takes of a wave falls with the fifth power of the brick.
  subroutine check_order()
    type(dem_pore_type) :: pore
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: amplitude(2)
    real(wp), allocatable :: x(:, :)
    integer(i4) :: k, n
    do k = 1, 2
      n = 8*k
      call make_bed([n, n, n], h/n, pore)
      x = places(pore)*pi/n
      pore%p = cos(x(1, :) + 0.3_wp)*cos(x(2, :) + 0.4_wp)*cos(x(3, :) + 0.5_wp)
      amplitude(k) = alternating(pore)
    end do
    call test%check('little', amplitude(1) < 1.0e-3_wp)
    call test%check('order', amplitude(1)/amplitude(2) > 2.0_wp**4.0_wp)
  end subroutine check_order

  !> Symmetric, not negative, without a sum; its diagonal serves the solver.
  subroutine check_operator()
    type(dem_pore_type) :: pore
    type(pore_mixing_type) :: mixing
    real(wp), allocatable :: p(:), q(:), of_p(:), of_q(:), unit(:), diagonal(:)
    integer(i4) :: a
    call make_bed([3, 2, 4], h, pore)
    call begin_mixing(pore)
    mixing = pore%mixing
    mixing%rate = mixing%rate*[(1.0_wp + modulo(0.37_wp*a, 1.0_wp), a=1, size(mixing%rate))]
    p = [(modulo(0.618_wp*a, 1.0_wp), a=1, size(pore%p))]
    q = [(modulo(0.755_wp*a, 1.0_wp) - 0.5_wp, a=1, size(pore%p))]
    of_p = 0.0_wp*p
    of_q = 0.0_wp*p
    call add_mixing(mixing, 1.0_wp, p, of_p)
    call add_mixing(mixing, 1.0_wp, q, of_q)
    call test%check_close('symmetric', sum(q*of_p)/sum(p*of_p), sum(p*of_q)/sum(p*of_p), &
                          1.0e-13_wp)
    call test%check('not negative', sum(p*of_p) > 0.0_wp .and. sum(q*of_q) > 0.0_wp)
    call test%check_close('no liquid comes or goes', sum(of_p)/max_abs(of_p), 0.0_wp, 1.0e-13_wp)
    diagonal = mixing_diagonal(mixing, size(p, kind=i4))
    do a = 1, size(p)
      unit = 0.0_wp*p
      unit(a) = 1.0_wp
      of_q = 0.0_wp*p
      call add_mixing(mixing, 1.0_wp, unit, of_q)
      if (diagonal(a)/of_q(a) < 0.4_wp .or. diagonal(a)/of_q(a) > 2.5_wp) &
        call test%check_close('diagonal', diagonal(a)/of_q(a), 1.0_wp, 0.5_wp)
    end do
  end subroutine check_operator

  !> By the mass of the grains in a brick: 13 T V^2/(m d^2), and the operator goes with it.
  subroutine check_rate()
    type(dem_pore_type) :: pore
    type(pore_equations_type) :: e
    real(wp), allocatable :: p(:), flow(:), product(:)
    call make_bed([2, 2, 2], h, pore)
    call begin_mixing(pore)
    e%mixing = pore%mixing
    call test%check_all_close('rate', e%mixing%rate/(13.0_wp*span*(h**3/diameter)**2 &
                              /(8.0_wp*mass)), 1.0_wp, 1.0e-12_wp)
    p = (-1.0_wp)**nint(sum(places(pore), 1))
    flow = 0.0_wp*p
    product = flow
    call add_mixing(e%mixing, span, p, flow)
    e%span = span
    e%storage = 0.0_wp*p
    allocate (e%matrix(8, 8, brick_count(pore%grid)), source=0.0_wp)
    call apply(pore%grid, e, p, product)
    call test%check_all_close('in the equations', product/max_abs(flow), flow/max_abs(flow), &
                              1.0e-13_wp)
    pore%partner%side = 6
    call begin_mixing(pore)
    e%mixing = pore%mixing
    call test%check_all_close('none beside a partner', e%mixing%rate, 0.0_wp, 0.0_wp)
    pore%partner%side = 0
    pore%sauter(3) = 0.0_wp
    call begin_mixing(pore)
    e%mixing = pore%mixing
    call test%check_close('a brick of a body takes the largest diameter', e%mixing%rate(3) &
                          /e%mixing%rate(1), 1.0_wp, 1.0e-12_wp)
  end subroutine check_rate
end program test_dem_pore_mixing
