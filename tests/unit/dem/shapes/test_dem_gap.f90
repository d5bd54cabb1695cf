!> Gap and common normal of ellipsoid pairs: closest-point conditions, brute force, the geometric
!! potential, spheres, the batched path against the scalar one.
program test_dem_gap
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: larger, max_abs, test_type
  use dem_state, only: lanes
  use dem_block, only: dem_block_type
  use dem_gap, only: branch_vectors, evaluate_spheres, solve_gap, evaluate_pairs, refine_normals, &
    add_curvatures
  use dem_ellipsoid, only: rotation_of, shape_matrix, matrix_times, support, surface_point
  implicit none
  type(test_type) :: test
  real(wp), parameter :: axes(3) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]
  integer(i4) :: state = 12345

  call check_closest_points()
  call check_brute_force()
  call check_potential()
  call check_batch()
  call check_one_centre()
  call test%finish()

contains

  !> Own generator, so that the pairs are the same everywhere (Park and Miller).
  real(wp) function uniform()
    state = int(mod(16807_i8*state, 2147483647_i8), i4)
    uniform = state/2147483647.0_wp
  end function uniform

  !> Two ellipsoids in random directions, centres `distance` apart.
  subroutine random_pair(distance, r, a, b, q1, q2)
    real(wp), intent(in) :: distance
    real(wp), intent(out) :: r(3), a(6), b(6), q1(4), q2(4)
    integer :: k
    do k = 1, 4
      q1(k) = uniform() - 0.5_wp
      q2(k) = uniform() - 0.5_wp
    end do
    do k = 1, 3
      r(k) = uniform() - 0.5_wp
    end do
    q1 = q1/sqrt(sum(q1**2))
    q2 = q2/sqrt(sum(q2**2))
    r = distance*r/sqrt(sum(r**2))
    a = shape_matrix(rotation_of(q1), axes)
    b = shape_matrix(rotation_of(q2), axes)
  end subroutine random_pair

  pure real(wp) function gap_along(r, a, b, n)
    real(wp), intent(in) :: r(3), a(6), b(6), n(3)
    gap_along = dot_product(r, n) - support(a, n) - support(b, n)
  end function gap_along

  !> The surface points with normals n and -n lie on one line along n.
  subroutine check_closest_points()
    real(wp) :: r(3), a(6), b(6), q1(4), q2(4), n(3), gap, d(3), worst
    integer :: k, touching
    worst = 0.0_wp
    touching = 0
    do k = 1, 2000
      call random_pair(3.4e-3_wp + 1.6e-3_wp*uniform(), r, a, b, q1, q2)
      n = 0.0_wp
      call solve_gap(r, a, b, n, gap)
      d = r - surface_point(b, n) - surface_point(a, n)
      worst = larger(worst, sqrt(sum((d - gap*n)**2)))
      if (gap < 0.0_wp) touching = touching + 1
    end do
    call test%check('pairs apart and in touch were both tried', &
                    touching > 200 .and. touching < 1800)
    call test%check_close('closest points on the normal', worst/axes(1), 0.0_wp, 1.0e-12_wp)
  end subroutine check_closest_points

  !> No direction of a fine net gives a larger gap.
  subroutine check_brute_force()
    real(wp) :: r(3), a(6), b(6), q1(4), q2(4), n(3), gap, best, worst
    integer :: k
    worst = -1.0_wp
    do k = 1, 200
      call random_pair(3.4e-3_wp + 1.6e-3_wp*uniform(), r, a, b, q1, q2)
      n = 0.0_wp
      call solve_gap(r, a, b, n, gap)
      best = net_maximum(r, a, b)
      worst = larger(worst, best - gap)
      if (abs(best - gap) > 1.0e-9_wp) exit
    end do
    call test%check_close('brute force finds no better normal', worst/axes(1), 0.0_wp, 1.0e-10_wp)
    call test%check('brute force finds the same gap', k > 200)
  end subroutine check_brute_force

  !> Largest gap over a net of directions, narrowed around the best one.
  real(wp) function net_maximum(r, a, b) result(best)
    real(wp), intent(in) :: r(3), a(6), b(6)
    real(wp) :: n(3), centre(3), found(3), size, t, p
    real(wp), parameter :: pi = acos(-1.0_wp)
    integer :: i, j, round
    best = -huge(1.0_wp)
    found = 0.0_wp
    do i = 0, 40
      do j = 0, 79
        t = pi*i/40.0_wp
        p = pi*j/40.0_wp
        n = [sin(t)*cos(p), sin(t)*sin(p), cos(t)]
        call keep_larger(gap_along(r, a, b, n), n, best, found)
      end do
    end do
    size = 0.1_wp
    do round = 1, 60
      centre = found
      do i = -2, 2
        do j = -2, 2
          n = centre + size*i*across(centre, 1) + size*j*across(centre, 2)
          n = n/sqrt(sum(n**2))
          call keep_larger(gap_along(r, a, b, n), n, best, found)
        end do
      end do
      if (sum(abs(found - centre)) <= 0.0_wp) size = 0.5_wp*size
    end do
  end function net_maximum

  subroutine keep_larger(gap, n, best, found)
    real(wp), intent(in) :: gap, n(3)
    real(wp), intent(inout) :: best, found(3)
    if (gap <= best) return
    best = gap
    found = n
  end subroutine keep_larger

  !> Two directions at right angles to n.
  pure function across(n, which) result(e)
    real(wp), intent(in) :: n(3)
    integer, intent(in) :: which
    real(wp) :: e(3), other(3)
    other = 0.0_wp
    other(minloc(abs(n), dim=1)) = 1.0_wp
    e = [n(2)*other(3) - n(3)*other(2), n(3)*other(1) - n(1)*other(3), &
         n(1)*other(2) - n(2)*other(1)]
    e = e/sqrt(sum(e**2))
    if (which == 2) e = [n(2)*e(3) - n(3)*e(2), n(3)*e(1) - n(1)*e(3), n(1)*e(2) - n(2)*e(1)]
  end function across

  !> Deepest points of each body in the other's potential, from the secular equation: normal and
  !! overlap agree with the common normal to the order of overlap/radius.
  subroutine check_potential()
    real(wp) :: r(3), a(6), b(6), q1(4), q2(4), n(3), gap, p(3), q(3), m(3), worst_n, worst_gap
    integer :: k
    worst_n = 0.0_wp
    worst_gap = 0.0_wp
    do k = 1, 300
      call random_pair(3.9e-3_wp, r, a, b, q1, q2)
      n = 0.0_wp
      call solve_gap(r, a, b, n, gap)
      r = r - (gap + 1.0e-7_wp)*n
      call solve_gap(r, a, b, n, gap)
      p = deepest(q1, q2, -r)
      q = deepest(q2, q1, r)
      m = potential_gradient(q1, r + p)
      worst_n = larger(worst_n, sqrt(sum((m - n)**2)))
      worst_gap = larger(worst_gap, abs(dot_product(q - (r + p), n)/(-gap) - 1.0_wp))
    end do
    call test%check('geometric potential: normal', worst_n < 20.0_wp*1.0e-7_wp/axes(3))
    call test%check('geometric potential: overlap', worst_gap < 20.0_wp*1.0e-7_wp/axes(3))
    call test%check('geometric potential: not identical', worst_n > 1.0e-9_wp)
  end subroutine check_potential

  !> Point on body 2, from its centre, deepest in the potential of body 1 with centre d from that of
  !! 2: (A1 + l A2) y = A1 d, y.A2 y = 1, by bisection on l > 0.
  function deepest(q1, q2, d) result(y)
    real(wp), intent(in) :: q1(4), q2(4), d(3)
    real(wp) :: y(3), a1(6), a2(6), low, high, l
    integer :: k
    a1 = shape_matrix(rotation_of(q1), 1.0e-3_wp/axes)
    a2 = shape_matrix(rotation_of(q2), 1.0e-3_wp/axes)
    low = 0.0_wp
    high = 1.0e6_wp
    do k = 1, 200
      l = 0.5_wp*(low + high)
      y = solved(a1 + l*a2, matrix_times(a1, d))
      if (dot_product(y, matrix_times(a2, y)) > 1.0e-6_wp) then
        low = l
      else
        high = l
      end if
    end do
  end function deepest

  pure function solved(s, c) result(y)
    real(wp), intent(in) :: s(6), c(3)
    real(wp) :: y(3), m(6)
    m(1) = s(2)*s(3) - s(5)*s(5)
    m(2) = s(3)*s(1) - s(6)*s(6)
    m(3) = s(1)*s(2) - s(4)*s(4)
    m(4) = s(5)*s(6) - s(4)*s(3)
    m(5) = s(6)*s(4) - s(5)*s(1)
    m(6) = s(4)*s(5) - s(6)*s(2)
    y = matrix_times(m, c)/(s(1)*m(1) + s(4)*m(4) + s(6)*m(6))
  end function solved

  !> Unit gradient of the potential of a body at a point from its centre.
  pure function potential_gradient(q, x) result(n)
    real(wp), intent(in) :: q(4), x(3)
    real(wp) :: n(3)
    n = matrix_times(shape_matrix(rotation_of(q), 1.0e-3_wp/axes), x)
    n = n/sqrt(sum(n**2))
  end function potential_gradient

  !> A block: warm normals converge to the scalar ones; curvature of spheres is 1/R1 + 1/R2.
  subroutine check_batch()
    type(dem_block_type) :: block
    real(wp) :: r(3), a(6), b(6), q1(4), q2(4), n(3, lanes), gap(lanes), worst
    integer :: k
    do k = 1, lanes
      call random_pair(3.2e-3_wp, r, a, b, q1, q2)
      block%a%s(k, :) = a
      block%b%s(k, :) = b
      n(:, k) = 0.0_wp
      call solve_gap(r, a, b, n(:, k), gap(k))
      r = r - (gap(k) + 1.0e-6_wp)*n(:, k)
      n(:, k) = 0.0_wp
      call solve_gap(r, a, b, n(:, k), gap(k))
      block%rx(k) = r(1)
      block%ry(k) = r(2)
      block%rz(k) = r(3)
      r = n(:, k) + 1.0e-3_wp*[uniform(), uniform(), uniform()]
      r = r/sqrt(sum(r**2))
      block%nx(k) = r(1)
      block%ny(k) = r(2)
      block%nz(k) = r(3)
    end do
    call evaluate_pairs(block)
    call refine_normals(block)
    worst = max_abs([block%nx - n(1, :), block%ny - n(2, :), block%nz - n(3, :)])
    call test%check_close('batched normals', worst, 0.0_wp, 2.0e-8_wp)
    call test%check_all_close('batched gaps', block%gap, gap, 1.0e-15_wp)

    block%a%s = spread([4.0_wp, 4.0_wp, 4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1, lanes)
    block%b%s = spread([9.0_wp, 9.0_wp, 9.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1, lanes)
    block%a%volume = 64.0_wp
    block%b%volume = 729.0_wp
    call evaluate_pairs(block)
    call add_curvatures(block, .true.)
    call test%check_all_close('curvature of spheres', block%curvature, 5.0_wp/6.0_wp, &
                          1.0e-14_wp)
    call evaluate_spheres(block)
    call test%check_all_close('curvature on the path of spheres', &
                          block%curvature, 5.0_wp/6.0_wp, 1.0e-14_wp)
    call test%check_all_close('gap of spheres', block%gap + 5.0_wp, &
                          sqrt(block%rx**2 + block%ry**2 + block%rz**2), 1.0e-15_wp)
    call test%check_all_close('normal of spheres', block%nx*block%ry, block%ny*block%rx, &
                          1.0e-15_wp)
  end subroutine check_batch

  !> Bodies with the same centre overlap along a unit vector, by no less than the sum of the least
  !! semi-axes: spheres, ellipsoids by both paths, centres that are apart by less than squares hold.
  subroutine check_one_centre()
    type(dem_block_type) :: block
    real(wp) :: r(3), a(6), b(6), q1(4), q2(4), n(3), gap, least
    integer :: k
    least = 2.0_wp*minval(axes)
    block%a%x = 0.0_wp
    block%b%x = 0.0_wp
    block%b%x(2::2, 1) = 1.0e-170_wp
    call branch_vectors(block)
    block%a%s = spread([4.0_wp, 4.0_wp, 4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1, lanes)
    block%b%s = block%a%s
    call evaluate_spheres(block)
    call test%check_all_close('gap of spheres with one centre', block%gap, -4.0_wp, 1.0e-15_wp)
    call test%check_all_close('their normal', block%nx**2 + block%ny**2 + block%nz**2, 1.0_wp, &
                              1.0e-15_wp)
    do k = 1, 20
      call random_pair(0.0_wp, r, a, b, q1, q2)
      if (k == 1) b = a
      n = 0.0_wp
      call solve_gap(r, a, b, n, gap)
      call test%check('ellipsoids with one centre overlap', gap <= -(1.0_wp - 1.0e-12_wp)*least)
      call test%check_close('along a unit vector', sum(n**2), 1.0_wp, 1.0e-14_wp)
    end do
  end subroutine check_one_centre
end program test_dem_gap
