!> Grains as surfaces see them: a form with equal halves and the exponent 2 is the ellipsoid against
!! lines, points, rings and bores; gaps of any form are those that many directions find.
program test_dem_figure
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use dem_ellipse, only: ratio_on_plane
  use dem_figure, only: figure_type, figure_point, figure_bend, figure_curvature
  use dem_shape, only: shape_of, turned, shape_size
  use dem_round_gap, only: circle_gap, corner_gap, bore_gap, most_places
  use dem_ellipsoid, only: rotation_of
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: semi(3) = [2.5_wp, 2.0_wp, 1.5_wp]
  real(wp), parameter :: axis(3) = [0.0_wp, 0.6_wp, 0.8_wp]

  call check_same()
  call check_many([0.3_wp, -0.2_wp, 0.1_wp], 2.0_wp, 'poly-ellipsoid')
  call check_many([0.0_wp, 0.0_wp, 0.0_wp], 4.0_wp, 'superquadric')
  call check_many([0.2_wp, 0.1_wp, -0.2_wp], 8.0_wp, 'both')
  call check_square()
  call test%finish()

contains

  !> A grain turned by some quaternion.
  function grain_of(skew, exponent, seed, shaped) result(f)
    real(wp), intent(in) :: skew(3), exponent
    integer(i4), intent(in) :: seed
    logical, intent(in) :: shaped
    type(figure_type) :: f
    real(wp) :: q(4), r(3, 3), m(3, 3), shape(shape_size)
    integer(i4) :: k
    q = [cos(1.0_wp*seed), sin(2.0_wp*seed), cos(3.0_wp*seed), sin(5.0_wp*seed + 1.0_wp)]
    q = q/norm2(q)
    r = rotation_of(q)
    m = 0.0_wp
    do k = 1, 3
      m(k, k) = semi(k)**2
    end do
    m = matmul(r, matmul(m, transpose(r)))
    f%a = [m(1, 1), m(2, 2), m(3, 3), m(1, 2), m(2, 3), m(3, 1)]
    f%square = product(semi)**2
    f%radius = 4.0_wp
    f%shaped = shaped
    shape = shape_of(semi*(1.0_wp + skew), semi*(1.0_wp - skew), [0.05_wp, -0.02_wp, 0.03_wp], &
                   exponent)
    if (exponent <= 2.0_wp .and. all(abs(skew) <= 0.0_wp)) shape(11:13) = 0.0_wp
    f%shape = turned(shape, q)
  end function grain_of

  !> A place beside the grain.
  function place_of(seed) result(r)
    integer(i4), intent(in) :: seed
    real(wp) :: r(3)
    r = [sin(3.0_wp*seed), cos(4.0_wp*seed), sin(7.0_wp*seed + 0.5_wp)]
    r = (2.2_wp + 0.4_wp*sin(11.0_wp*seed))*r/norm2(r)
  end function place_of

  !> Every quantity of a surface, once from the matrix and once from the shape.
  subroutine check_same()
    type(figure_type) :: a, b
    real(wp) :: worst(6), n(3), u(3, 2), h(2), k(6, 2), e(3), gap(2), other(3)
    real(wp) :: places(3, most_places), gaps(most_places, 2)
    integer(i4) :: seed, found(2)

    worst = 0.0_wp
    do seed = 1, 500
      a = grain_of([0.0_wp, 0.0_wp, 0.0_wp], 2.0_wp, seed, .false.)
      b = grain_of([0.0_wp, 0.0_wp, 0.0_wp], 2.0_wp, seed, .true.)
      n = place_of(seed)
      n = n/norm2(n)
      call figure_bend(a, n, u(:, 1), h(1), k(:, 1))
      call figure_bend(b, n, u(:, 2), h(2), k(:, 2))
      worst(1) = larger(worst(1), max_abs(u(:, 1) - u(:, 2)), abs(h(1) - h(2)), &
                     max_abs(k(:, 1) - k(:, 2)))
      worst(2) = larger(worst(2), abs(figure_curvature(a, n) - figure_curvature(b, n)))
      worst(3) = larger(worst(3), abs(ratio_on_plane(a, n) - ratio_on_plane(b, n)))
      call circle_gap(place_of(seed), a, axis, 0.3_wp, sqrt(0.91_wp), e, n, gap(1))
      call circle_gap(place_of(seed), b, axis, 0.3_wp, sqrt(0.91_wp), e, other, gap(2))
      worst(4) = larger(worst(4), abs(gap(1) - gap(2)), 1.0e-4_wp*max_abs(n - other))
      call corner_gap(place_of(seed), a, axis, 0.2_wp, n, gap(1))
      call corner_gap(place_of(seed), b, axis, 0.2_wp, other, gap(2))
      worst(5) = larger(worst(5), abs(gap(1) - gap(2)), 1.0e-4_wp*max_abs(n - other))
      call bore_gap(place_of(seed), a, axis, 9.0_wp, found(1), places, gaps(:, 1))
      call bore_gap(place_of(seed), b, axis, 9.0_wp, found(2), places, gaps(:, 2))
      if (found(1) == found(2)) then
        worst(6) = larger(worst(6), max_abs(gaps(:found(1), 1) - gaps(:found(1), 2)))
      else
        worst(6) = 1.0_wp
      end if
    end do
    call test%check_close('support and Hessian of an ellipsoid', worst(1), 0.0_wp, 1.0e-13_wp)
    call test%check_close('its mean curvature', worst(2), 0.0_wp, 1.0e-12_wp)
    call test%check_close('its ellipse', worst(3), 0.0_wp, 1.0e-12_wp)
    call test%check_close('its gap to a cone', worst(4), 0.0_wp, 1.0e-12_wp)
    call test%check_close('its gap to a ring', worst(5), 0.0_wp, 1.0e-12_wp)
    call test%check_close('its gaps in a bore', worst(6), 0.0_wp, 1.0e-12_wp)
  end subroutine check_same

  !> Gaps to a line, a point and a bore are greatest among very many normals, and the vector
  !! between the two points lies along the normal.
  subroutine check_many(skew, exponent, name)
    real(wp), intent(in) :: skew(3), exponent
    character(len=*), intent(in) :: name
    type(figure_type) :: f
    real(wp) :: r(3), n(3), e(3), u(3), h, gap, best(3), off(2)
    real(wp) :: places(3, most_places), gaps(most_places)
    integer(i4) :: seed, found

    best = -huge(1.0_wp)
    off = 0.0_wp
    do seed = 1, 60
      f = grain_of(skew, exponent, seed, .true.)
      r = 2.0_wp*place_of(seed)
      call corner_gap(r, f, axis, 0.0_wp, n, gap)
      call figure_point(f, n, u, h)
      off(1) = larger(off(1), norm2(r - u - gap*n))
      best(1) = larger(best(1), best_of(f, r, 0) - gap)
      call circle_gap(r, f, axis, 0.0_wp, 1.0_wp, e, n, gap)
      call figure_point(f, n, u, h)
      u = r - u - gap*n
      off(2) = larger(off(2), norm2(u - dot_product(u, axis)*axis))
      best(2) = larger(best(2), best_of(f, r, 1) - gap)
      call bore_gap(r, f, axis, 12.0_wp, found, places, gaps)
      best(3) = larger(best(3), minval(gaps(:found)) + best_of(f, r, 2) - 12.0_wp)
    end do
    call test%check(name//': no normal is better for a point', best(1) <= 1.0e-12_wp)
    call test%check(name//': nor for a line', best(2) <= 1.0e-12_wp)
    call test%check(name//': nor in a bore', best(3) <= 1.0e-12_wp)
    call test%check_close(name//': nearest points face a point', off(1), 0.0_wp, 1.0e-9_wp)
    call test%check_close(name//': and a line', off(2), 0.0_wp, 1.0e-9_wp)
  end subroutine check_many

  !> Best value among many normals, where the centre is farther away than the grain reaches: all of
  !! the sphere (0), those across the axis (1), the reach across it (2).
  real(wp) function best_of(f, r, what) result(best)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: r(3)
    integer(i4), intent(in) :: what
    real(wp) :: n(3), u(3), h, z
    integer(i4) :: k
    integer(i4), parameter :: many = 4000
    real(wp), parameter :: across(3) = [1.0_wp, 0.0_wp, 0.0_wp]
    real(wp), parameter :: other(3) = [0.0_wp, 0.8_wp, -0.6_wp]
    best = -huge(1.0_wp)
    do k = 1, many
      if (what == 0) then
        z = 2.0_wp*(k - 0.5_wp)/many - 1.0_wp
        n = [sqrt(1.0_wp - z*z)*cos(2.4_wp*k), sqrt(1.0_wp - z*z)*sin(2.4_wp*k), z]
      else
        n = cos(2.0_wp*pi*k/many)*across + sin(2.0_wp*pi*k/many)*other
      end if
      if (what == 2) n = -n
      call figure_point(f, n, u, h)
      best = larger(best, merge(h - dot_product(r, n), dot_product(r, n) - h, what == 2))
    end do
  end function best_of

  !> A square grain in the middle of a bore meets it in four places, alike.
  subroutine check_square()
    type(figure_type) :: f
    real(wp) :: e(3, most_places), gap(most_places)
    integer(i4) :: n
    f%shaped = .true.
    f%shape = shape_of([1.0_wp, 1.0_wp, 1.0_wp], [1.0_wp, 1.0_wp, 1.0_wp], [0.0_wp, 0.0_wp, &
      0.0_wp], &
                     6.0_wp)
    call bore_gap([0.0_wp, 0.0_wp, 0.0_wp], f, [0.0_wp, 0.0_wp, 1.0_wp], 2.0_wp, n, e, gap)
    call test%check('four places', n == 4)
    call test%check_all_close('alike', gap(:n), gap(1), 1.0e-12_wp)
    call test%check_close('at the corners', gap(1), 2.0_wp - sqrt(2.0_wp)*0.5_wp**(1.0_wp/6.0_wp), &
                          1.0e-3_wp)
  end subroutine check_square
end program test_dem_figure
