!> Forms: support, surface point and Hessian against differences and ellipsoids, mass properties
!! against quadrature and closed shapes, gaps of random pairs against a search by values, and all
!! that by blocks of lanes.
program test_dem_shape
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: larger, max_abs, test_type
  use dem_block, only: dem_block_type
  use dem_shape, only: shape_size, shape_of, shape_support, shape_tangent, shape_height, &
    mean_curvature_of, bounded_curvature, flattest_radius, turned, at_half
  use dem_shape_gap, only: solve_shapes, gap_of_shapes
  use dem_shape_lanes, only: shape_block_type, ready_shapes, evaluate_shapes, refine_shapes, &
    add_shape_curvatures
  use dem_shape_mass, only: shape_mass_type, mass_of_shape
  use dem_shape_state, only: dem_shapes_type, allocate_shapes, put_frame, put_frames
  use dem_gap, only: solve_gap
  use dem_power, only: raise, raise_near
  use dem_ellipsoid, only: rotation_of, shape_matrix, support, surface_point, quaternion_product
  use dem_state, only: lanes
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp), none(3) = 0.0_wp
  real(wp), parameter :: upper(3) = [2.5_wp, 2.0_wp, 1.1_wp], lower(3) = [1.4_wp, 2.4_wp, 1.5_wp]
  integer(i4) :: state = 4711

  call check_ellipsoid()
  call check_derivatives()
  call check_flat_spots()
  call check_mass()
  call check_extent()
  call check_pairs()
  call check_raise()
  call check_frames()
  call check_lanes(.false., 1.0e-6_wp)
  call check_lanes(.false., 1.0e-2_wp)
  call check_lanes(.true., 1.0e-6_wp)
  call check_lanes(.true., 1.0e-2_wp)
  call test%finish()

contains

  real(wp) function uniform()
    state = int(mod(16807_i8*state, 2147483647_i8), i4)
    uniform = state/2147483647.0_wp
  end function uniform

  !> Normally distributed by a sum of twelve.
  function direction() result(n)
    real(wp) :: n(3)
    integer :: k, i
    n = -6.0_wp
    do i = 1, 12
      do k = 1, 3
        n(k) = n(k) + uniform()
      end do
    end do
    n = n/norm2(n)
  end function direction

  function orientation() result(q)
    real(wp) :: q(4)
    integer :: k, i
    q = -6.0_wp
    do i = 1, 12
      do k = 1, 4
        q(k) = q(k) + uniform()
      end do
    end do
    q = q/norm2(q)
  end function orientation

  !> Equal halves and exponent 2, with or without the powers at work, are the ellipsoid.
  subroutine check_ellipsoid()
    real(wp) :: shape(shape_size), q(4), n(3), a(6), h, u(3), k(6), worst(3), exact
    integer :: i, which
    do which = 1, 2
      worst = 0.0_wp
      do i = 1, 300
        q = orientation()
        shape = turned(shape_of(upper, upper, none, 2.0_wp), q)
        if (which == 2) shape = turned(shape_of(upper, upper, none, 2.0_wp + 1.0e-13_wp), q)
        a = shape_matrix(rotation_of(q), upper)
        n = direction()
        call shape_tangent(shape, n, h, u, k)
        worst(1) = larger(worst(1), abs(h - support(a, n)))
        worst(2) = larger(worst(2), norm2(u - surface_point(a, n)))
        exact = 0.5_wp*(sum(a(1:3)) - sum(u*u))*h**3/product(upper)**2
        worst(3) = larger(worst(3), abs(mean_curvature_of(k) - exact)/exact)
      end do
      call test%check_close('support of an ellipsoid', worst(1), 0.0_wp, 1.0e-12_wp)
      call test%check_close('surface point of an ellipsoid', worst(2), 0.0_wp, 1.0e-12_wp)
      call test%check_close('mean curvature of an ellipsoid', worst(3), 0.0_wp, 1.0e-11_wp)
    end do
  end subroutine check_ellipsoid

  !> The surface point is the slope of the support, the Hessian that of the surface point; the
  !! Hessian does not see n itself.
  subroutine check_derivatives()
    real(wp), parameter :: small = 1.0e-5_wp, exponents(4) = [2.0_wp, 2.5_wp, 4.0_wp, 8.0_wp]
    real(wp) :: shape(shape_size), n(3), h, u(3), k(6), low(3), high(3), hl, hh, e(3), worst(3), &
      m(3)
    integer :: i, c, p
    worst = 0.0_wp
    do p = 1, size(exponents)
      do i = 1, 50
        shape = turned(shape_of(upper, lower, [0.1_wp, -0.2_wp, 0.3_wp], exponents(p)), &
          orientation())
        n = direction()
        m = matmul(n, rotation_of(shape(1:4)))
        if (any(abs(m) < 0.1_wp)) cycle  ! differences must not straddle octants
        call shape_tangent(shape, n, h, u, k)
        worst(1) = larger(worst(1), norm2(matmul(square(k), n)), abs(dot_product(n, u) - h))
        do c = 1, 3
          e = 0.0_wp
          e(c) = small
          call shape_support(shape, n + e, hh, high)
          call shape_support(shape, n - e, hl, low)
          worst(2) = larger(worst(2), abs((hh - hl)/(2.0_wp*small) - u(c)))
          e = (high - low)/(2.0_wp*small)
          worst(3) = larger(worst(3), norm2(e - reshape(matmul(square(k), unit_vector(c)), [3])))
        end do
      end do
    end do
    call test%check_close('K n = 0 and n.u = h', worst(1), 0.0_wp, 1.0e-11_wp)
    call test%check_close('surface point = slope of the support', worst(2), 0.0_wp, 1.0e-7_wp)
    call test%check_close('Hessian = slope of the surface point', worst(3), 0.0_wp, 1.0e-5_wp)
  end subroutine check_derivatives

  pure function square(k) result(m)
    real(wp), intent(in) :: k(6)
    real(wp) :: m(3, 3)
    m = reshape([k(1), k(4), k(6), k(4), k(2), k(5), k(6), k(5), k(3)], [3, 3])
  end function square

  pure function unit_vector(c) result(e)
    integer, intent(in) :: c
    real(wp) :: e(3)
    e = 0.0_wp
    e(c) = 1.0_wp
  end function unit_vector

  !> The rounded superquadric leaves the sharp one by no more than the bulge, its points lie on
  !! |x/a|^p + ... = 1 to the same, and its radii are bounded.
  subroutine check_flat_spots()
    real(wp), parameter :: exponents(3) = [2.2_wp, 4.0_wp, 10.0_wp]
    real(wp) :: shape(shape_size), n(3), h, u(3), k(6), sharp, worst(2), q, radius
    integer :: i, p
    do p = 1, size(exponents)
      shape = shape_of(upper, upper, none, exponents(p))
      q = exponents(p)/(exponents(p) - 1.0_wp)
      worst = 0.0_wp
      radius = 0.0_wp
      do i = 1, 3000
        n = direction()
        if (i <= 3) n = unit_vector(i)
        call shape_tangent(shape, n, h, u, k)
        sharp = sum(abs(upper*n)**q)**(1.0_wp/q)
        worst(1) = larger(worst(1), abs(h/sharp - 1.0_wp))
        worst(2) = larger(worst(2), abs(sum(abs(u/upper)**exponents(p))**(1.0_wp/exponents(p)) &
                                     - 1.0_wp))
        radius = larger(radius, k(1) + k(2) + k(3))
      end do
      call test%check('support within the bulge', worst(1) < 1.1e-4_wp)
      call test%check('surface within the bulge', worst(2) < 3.0e-4_wp)
      call test%check('radii of curvature are bounded', radius < &
                      2.1_wp*flattest_radius(exponents(p))*maxval(upper)**2/minval(upper))
    end do
  end subroutine check_flat_spots

  !> Volume, centre and moments: closed shapes against Gauss quadrature over each octant, in which
  !! x = a s^(2/p) and so on, with s on the sphere; half an ellipsoid; an ellipsoid.
  subroutine check_mass()
    real(wp), parameter :: exponents(4) = [2.0_wp, 2.5_wp, 4.0_wp, 8.0_wp]
    type(shape_mass_type) :: mass
    real(wp) :: volume, centre(3), tensor(3, 3), v(3, 3), back(3, 3), moments(3)
    integer :: p, k
    do p = 1, size(exponents)
      mass = mass_of_shape(upper, lower, exponents(p))
      call integrate(exponents(p), volume, centre, tensor)
      call test%check_close('volume', mass%volume/volume, 1.0_wp, 1.0e-10_wp)
      call test%check_close('centre', norm2(mass%centre - centre), 0.0_wp, 1.0e-10_wp)
      v = rotation_of(mass%turn)
      moments = mass%moment
      back = 0.0_wp
      do k = 1, 3
        back(k, k) = 0.5_wp*sum(moments) - moments(k)
      end do
      back = matmul(v, matmul(back, transpose(v)))
      call test%check_close('second moments', max_abs(back - tensor)/volume, 0.0_wp, 1.0e-9_wp)
    end do
    mass = mass_of_shape(upper, upper, 2.0_wp)
    call test%check_close('volume of an ellipsoid', mass%volume/(4.0_wp/3.0_wp*pi*product(upper)), &
                          1.0_wp, 1.0e-14_wp)
    call test%check_close('moment of an ellipsoid', mass%moment(1)/(0.2_wp*mass%volume &
                          *(upper(2)**2 + upper(3)**2)), 1.0_wp, 1.0e-14_wp)
    call test%check_close('an ellipsoid is not turned', norm2(mass%turn(2:4)), 0.0_wp, 0.0_wp)
    mass = mass_of_shape([4.0_wp, 1.0_wp, 1.0_wp], [2.0_wp, 1.0_wp, 1.0_wp], 2.0_wp)
    call test%check_close('centre of two half ellipsoids', mass%centre(1), 0.75_wp, 1.0e-14_wp)
    call test%check_close('they are not turned', norm2(mass%turn(2:4)), 0.0_wp, 0.0_wp)
  end subroutine check_mass

  !> By Gauss points on sines: x = a s1^(2/p), s1 = sin t cos f ...; radial part in closed form.
  subroutine integrate(p, volume, centre, tensor)
    real(wp), intent(in) :: p
    real(wp), intent(out) :: volume, centre(3), tensor(3, 3)
    integer, parameter :: n = 240
    real(wp) :: z(n), rest(n), weight(n), a(3), s(3), x(3), part
    integer :: octant, i, j, k
    call double_exponential(z, rest, weight)
    volume = 0.0_wp
    centre = 0.0_wp
    tensor = 0.0_wp
    do octant = 0, 7
      a = merge(upper, lower, [btest(octant, 0), btest(octant, 1), btest(octant, 2)])
      do i = 1, n
        do j = 1, n
          s(1) = sin(0.5_wp*pi*z(i))*sin(0.5_wp*pi*rest(j))
          s(2) = sin(0.5_wp*pi*z(i))*sin(0.5_wp*pi*z(j))
          s(3) = sin(0.5_wp*pi*rest(i))
          x = a*s**(2.0_wp/p)
          ! d(volume) = r^2 dr (2/p)^2 a b c (s1 s2 s3)^(2/p - 1) sin t dt df
          part = weight(i)*weight(j)*(0.5_wp*pi)**2*(2.0_wp/p)**2*product(a) &
                 *product(s)**(2.0_wp/p - 1.0_wp)*sin(0.5_wp*pi*z(i))
          x = merge(x, -x, [btest(octant, 0), btest(octant, 1), btest(octant, 2)])
          volume = volume + part/3.0_wp
          centre = centre + part*x/4.0_wp
          tensor = tensor + part*spread(x, 2, 3)*spread(x, 1, 3)/5.0_wp
        end do
      end do
    end do
    centre = centre/volume
    do k = 1, 3
      tensor(:, k) = tensor(:, k) - volume*centre*centre(k)
    end do
  end subroutine integrate

  !> Points z, 1 - z and weights on (0, 1) that take end singularities (tanh-sinh rule).
  subroutine double_exponential(z, rest, weight)
    real(wp), intent(out) :: z(:), rest(:), weight(:)
    real(wp), parameter :: range = 4.6_wp
    real(wp) :: t, step, inner
    integer :: i
    step = 2.0_wp*range/(size(z) - 1)
    do i = 1, size(z)
      t = -range + step*(i - 1)
      inner = 0.5_wp*pi*sinh(t)
      z(i) = 1.0_wp/(1.0_wp + exp(-2.0_wp*inner))
      rest(i) = 1.0_wp/(1.0_wp + exp(2.0_wp*inner))
      weight(i) = step*0.25_wp*pi*cosh(t)/cosh(inner)**2
    end do
  end subroutine double_exponential

  !> No surface point lies outside the bounding radius, none moves more under a rotation than reach.
  subroutine check_extent()
    type(shape_mass_type) :: mass
    real(wp) :: a(3), b(3), p, shape(shape_size), n(3), h, u(3), worst(2), tight
    integer :: trial, i, k
    worst = 0.0_wp
    tight = 0.0_wp
    do trial = 1, 100
      do k = 1, 3
        a(k) = 1.0_wp + 3.0_wp*uniform()
        b(k) = 1.0_wp + 3.0_wp*uniform()
      end do
      p = 2.0_wp
      if (mod(trial, 2) == 0) p = 2.0_wp + 6.0_wp*uniform()
      if (mod(trial, 3) == 0) b = a
      mass = mass_of_shape(a, b, p)
      shape = shape_of(a, b, mass%centre, p)
      h = 0.0_wp
      do i = 1, 2000
        n = direction()
        call shape_support(shape, n, h, u)
        worst(1) = larger(worst(1), norm2(u)/mass%radius)
        worst(2) = larger(worst(2), norm2(u - h*n)/mass%reach)
        tight = larger(tight, norm2(u)/mass%radius)
      end do
    end do
    call test%check('all points lie inside the bounding sphere', worst(1) <= 1.0_wp)
    call test%check('no point moves more than its reach', worst(2) <= 1.0_wp)
    call test%check('the bounding sphere is tight', tight > 0.999_wp)
  end subroutine check_extent

  !> Random pairs of all kinds, aspect ratios to 5 and overlaps to 5 %: the normal is stationary and
  !! no direction of a search by values around it gives a larger gap; ellipsoids give the gap of
  !! dem_gap.
  subroutine check_pairs()
    real(wp) :: a(shape_size), b(shape_size), r(3), n(3), m(3), gap, best, worst(3), size_of
    real(wp) :: e(6), f(6), other, q(4), axes(3)
    integer :: trial
    worst = 0.0_wp
    do trial = 1, 3000
      call random_pair(a, b, r, size_of)
      n = 0.0_wp
      call solve_shapes(r, a, b, n, gap)
      worst(1) = larger(worst(1), tilt(r, a, b, n)/size_of)
      if (mod(trial, 10) == 0) then
        call climb(r, a, b, n, best)
        worst(2) = larger(worst(2), (best - gap)/size_of)
      end if
      axes = [1.0_wp + 4.0_wp*uniform(), 1.0_wp + 4.0_wp*uniform(), 1.0_wp]
      q = orientation()
      a = turned(shape_of(axes, axes, none, 2.0_wp), q)
      e = shape_matrix(rotation_of(q), axes)
      q = orientation()
      b = turned(shape_of(axes, axes, none, 2.0_wp), q)
      f = shape_matrix(rotation_of(q), axes)
      n = 0.0_wp
      call solve_shapes(r, a, b, n, gap)
      m = n
      call solve_gap(r, e, f, m, other)
      worst(3) = larger(worst(3), abs(other - gap)/maxval(axes))
    end do
    call test%check_close('surface points lie on the normal', worst(1), 0.0_wp, 1.0e-10_wp)
    call test%check('a search by values finds no larger gap', worst(2) < 1.0e-13_wp)
    call test%check_close('ellipsoids as forms have the gap of ellipsoids', worst(3), 0.0_wp, &
                          1.0e-12_wp)
  end subroutine check_pairs

  !> Powers against the compiler's.
  subroutine check_raise()
    integer(i4), parameter :: count = 4000
    real(wp) :: x(count), e(count), y(count)
    integer(i4) :: k
    do k = 1, count
      x(k) = 10.0_wp**(-7.0_wp*uniform())
      e(k) = -0.5_wp*uniform()
    end do
    call raise(count, x, e, y)
    call test%check_all_close('powers', y/x**e, 1.0_wp, 4.0e-15_wp)
    do k = 1, count
      x(k) = 1.0_wp + 0.8_wp*uniform()
      e(k) = uniform() - 0.5_wp
    end do
    call raise_near(count, x, e, y)
    call test%check_all_close('powers of numbers near 1', y/x**e, 1.0_wp, &
                          5.0e-16_wp)
  end subroutine check_raise

  !> Frames in turned bodies, one by one and many at once, the same bits.
  subroutine check_frames()
    integer(i4), parameter :: n = 7, low = 2
    type(dem_shapes_type) :: shapes
    real(wp) :: quat(lanes, 4), one(4, n), worst
    integer(i4) :: i
    call allocate_shapes(shapes, n)
    worst = 0.0_wp
    do i = 1, n
      shapes%frame(:, i) = orientation()
      quat(i, :) = orientation()
      call put_frame(shapes, i, quat(i, :))
      one(:, i) = shapes%record(1:4, i)
      worst = larger(worst, max_abs(one(:, i) - quaternion_product(quat(i, :), &
                                                                   shapes%frame(:, i))))
    end do
    call test%check_close('frames in turned bodies', worst, 0.0_wp, 1.0e-15_wp)
    quat(:n - low, :) = quat(low + 1:n, :)
    shapes%record(1:4, low + 1:n) = 0.0_wp
    call put_frames(shapes, low, n - low - 1, quat)
    call test%check('many frames at once', all(shapes%record(1:4, :n - 1) == one(:, :n - 1)) &
                    .and. all(shapes%record(1:4, n) == 0.0_wp))
  end subroutine check_frames

  !> Blocks of pairs whose normals are somewhat off, as after a step.
  subroutine check_lanes(powers, off)
    logical, intent(in) :: powers
    real(wp), intent(in) :: off  !! of the normal [rad]
    type(dem_block_type) :: b, start
    type(shape_block_type) :: f
    real(wp) :: r(3, lanes), n(3), u(3), v(3), h, ka(6), kb(6), gap, size_of(lanes), worst(4)
    integer(i4) :: trial, k
    logical :: same
    character(:), allocatable :: what
    worst = 0.0_wp
    same = .true.
    do trial = 1, 12
      do k = 1, lanes
        do
          call random_pair(f%a%record(k, :), f%b%record(k, :), r(:, k), size_of(k))
          if (powers) exit
          if (min(f%a%record(k, at_half), f%b%record(k, at_half)) >= 1.0_wp) exit
        end do
        n = 0.0_wp
        call solve_shapes(r(:, k), f%a%record(k, :), f%b%record(k, :), n, gap)
        n = n + off*direction()
        n = n/norm2(n)
        b%rx(k) = r(1, k)
        b%ry(k) = r(2, k)
        b%rz(k) = r(3, k)
        b%nx(k) = n(1)
        b%ny(k) = n(2)
        b%nz(k) = n(3)
      end do
      start = b
      call refine(b, f, powers)
      do k = 1, lanes
        same = same .and. all(lane_of(b, k) == alone(start, f, powers, k))
        if (b%gap(k) > 0.0_wp) cycle
        n = [b%nx(k), b%ny(k), b%nz(k)]
        worst(1) = larger(worst(1), tilt(r(:, k), f%a%record(k, :), f%b%record(k, :), n)/size_of(k))
        call shape_tangent(f%a%record(k, :), n, h, u, ka)
        call shape_tangent(f%b%record(k, :), -n, h, v, kb)
        worst(2) = larger(worst(2), norm2(u - [b%ax(k), b%ay(k), b%az(k)])/size_of(k), &
                       norm2(v + [b%bx(k), b%by(k), b%bz(k)])/size_of(k))
        gap = dot_product(r(:, k), n) - shape_height(f%a%record(k, :), n) &
              - shape_height(f%b%record(k, :), -n)
        worst(3) = larger(worst(3), abs(gap - b%gap(k))/size_of(k))
        gap = bounded_curvature(f%a%record(k, :), ka) + bounded_curvature(f%b%record(k, :), kb)
        worst(4) = larger(worst(4), abs(b%curvature(k)/gap - 1.0_wp))
      end do
    end do
    what = 'lanes of octants: '
    if (powers) what = 'lanes with powers: '
    call test%check(what//'the same bits whatever the other lanes are', same)
    call test%check_close(what//'surface points on the normal', worst(1), 0.0_wp, 1.0e-7_wp)
    call test%check_close(what//'surface points', worst(2), 0.0_wp, 1.0e-7_wp)
    call test%check_close(what//'gaps', worst(3), 0.0_wp, 1.0e-13_wp)
    call test%check_close(what//'curvatures', worst(4), 0.0_wp, 1.0e-4_wp)
  end subroutine check_lanes

  subroutine refine(b, f, powers)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    logical, intent(in) :: powers
    call ready_shapes(f, .true., powers)
    call evaluate_shapes(b, f)
    call refine_shapes(b, f)
    call add_shape_curvatures(b, f, .true.)
  end subroutine refine

  pure function lane_of(b, k) result(row)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp) :: row(11)
    row = [b%gap(k), b%nx(k), b%ny(k), b%nz(k), b%ax(k), b%ay(k), b%az(k), b%bx(k), b%by(k), &
           b%bz(k), b%curvature(k)]
  end function lane_of

  !> Result of lane k in a block of copies of itself.
  function alone(start, f, powers, k) result(row)
    type(dem_block_type), intent(in) :: start
    type(shape_block_type), intent(in) :: f
    logical, intent(in) :: powers
    integer(i4), intent(in) :: k
    real(wp) :: row(11)
    type(dem_block_type) :: b
    type(shape_block_type) :: one
    b = start
    one = f
    b%rx = start%rx(k)
    b%ry = start%ry(k)
    b%rz = start%rz(k)
    b%nx = start%nx(k)
    b%ny = start%ny(k)
    b%nz = start%nz(k)
    one%a%record = spread(f%a%record(k, :), 1, lanes)
    one%b%record = spread(f%b%record(k, :), 1, lanes)
    call refine(b, one, powers)
    row = lane_of(b, 1_i4)
  end function alone

  !> Two random shapes whose centres lie outside each other, overlapping by at most 5 %.
  subroutine random_pair(a, b, r, size_of)
    real(wp), intent(out) :: a(shape_size), b(shape_size), r(3), size_of
    real(wp) :: low, high, middle, n(3), gap, wanted, line(3), least
    integer :: k
    call random_shape(a)
    call random_shape(b)
    least = min(minval(a(5:10)), minval(b(5:10)))
    size_of = least
    wanted = -0.05_wp*least*uniform()
    line = direction()
    low = 0.0_wp
    high = 12.0_wp
    n = line
    do k = 1, 50
      middle = 0.5_wp*(low + high)
      n = 0.0_wp
      call solve_shapes(middle*line, a, b, n, gap)
      if (gap < wanted) then
        low = middle
      else
        high = middle
      end if
    end do
    r = high*line
  end subroutine random_pair

  subroutine random_shape(shape)
    real(wp), intent(out) :: shape(shape_size)
    real(wp) :: a(3), b(3), p
    type(shape_mass_type) :: mass
    integer :: k
    do k = 1, 3
      a(k) = 1.0_wp + 4.0_wp*uniform()**2
      b(k) = a(k)
    end do
    p = 2.0_wp
    if (uniform() < 0.5_wp) p = 2.0_wp + 6.0_wp*uniform()
    if (uniform() < 0.5_wp) then
      do k = 1, 3
        b(k) = 1.0_wp + 4.0_wp*uniform()**2
      end do
    end if
    mass = mass_of_shape(a, b, p)
    shape = turned(shape_of(a, b, mass%centre, p), orientation())
  end subroutine random_shape

  !> How far the surface points lie off the normal.
  real(wp) function tilt(r, a, b, n)
    real(wp), intent(in) :: r(3), a(shape_size), b(shape_size), n(3)
    real(wp) :: ha, hb, ua(3), ub(3)
    call shape_support(a, n, ha, ua)
    call shape_support(b, -n, hb, ub)
    tilt = norm2(r + ub - ua - (dot_product(r, n) - ha - hb)*n)
  end function tilt

  !> Best of ever finer nets around n.
  subroutine climb(r, a, b, n, best)
    real(wp), intent(in) :: r(3), a(shape_size), b(shape_size), n(3)
    real(wp), intent(out) :: best
    real(wp) :: centre(3), trial(3), width, value, e(3), f(3)
    integer :: round, i
    centre = n
    best = gap_of_shapes(r, a, b, n)
    width = 0.2_wp
    do round = 1, 60
      e = direction()
      e = e - dot_product(e, centre)*centre
      e = e/norm2(e)
      f = [centre(2)*e(3) - centre(3)*e(2), centre(3)*e(1) - centre(1)*e(3), &
           centre(1)*e(2) - centre(2)*e(1)]
      do i = 0, 15
        trial = centre + width*(cos(pi*i/8.0_wp)*e + sin(pi*i/8.0_wp)*f)
        trial = trial/norm2(trial)
        value = gap_of_shapes(r, a, b, trial)
        if (value > best) then
          best = value
          centre = trial
        end if
      end do
      width = 0.8_wp*width
    end do
  end subroutine climb
end program test_dem_shape
