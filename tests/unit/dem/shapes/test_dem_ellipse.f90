!> Hertz contacts of elliptic area against quadratures of the elliptic integrals.
program test_dem_ellipse
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, test_type
  use dem_figure, only: figure_type
  use dem_ellipse, only: radius_ratio, ratio_on_plane, narrow_ellipsoids, narrow_shapes
  use dem_block, only: dem_block_type
  use dem_shape, only: shape_of
  use dem_shape_lanes, only: shape_block_type
  use dem_gap, only: add_curvatures
  use dem_state, only: lanes
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp)

  call check_ratios()
  call check_circle()
  call check_plane()
  call check_pairs()
  call test%finish()

contains

  !> Ratio of curvatures and R_x/R_e of an area with the axes b/a, by the trapezoidal rule, which is
  !! exact to rounding for periodic functions.
  pure subroutine by_quadrature(axis, ratio, factor)
    real(wp), intent(in) :: axis
    real(wp), intent(out) :: ratio, factor
    integer(i4), parameter :: points = 4000
    real(wp) :: m, k, e, d, s, root
    integer(i4) :: j
    m = 1.0_wp - axis**2
    k = 0.0_wp
    e = 0.0_wp
    d = 0.0_wp
    do j = 1, points
      s = sin(0.5_wp*pi*(2*j - 1)/(2*points))**2
      root = sqrt(1.0_wp - m*s)
      k = k + 1.0_wp/root
      e = e + root
      d = d + s/root
    end do
    k = 0.5_wp*pi*k/points
    e = 0.5_wp*pi*e/points
    d = 0.5_wp*pi*d/points
    ratio = (k - d)/(axis**2*d)
    factor = 0.25_wp*pi**2*e/(axis**2*k**3)
  end subroutine by_quadrature

  subroutine check_ratios()
    real(wp), parameter :: axes(8) = [0.999999_wp, 0.999_wp, 0.97_wp, 0.8_wp, 0.5_wp, 0.2_wp, &
                                      0.05_wp, 0.01_wp]
    real(wp) :: ratio, factor, worst, rough
    integer(i4) :: j
    worst = 0.0_wp
    rough = 0.0_wp
    do j = 1, size(axes)
      call by_quadrature(axes(j), ratio, factor)
      worst = larger(worst, abs(radius_ratio(ratio)/factor - 1.0_wp))
      if (axes(j) >= 0.1_wp) rough = larger(rough, abs(axes(j)*ratio**0.6360_wp*1.0339_wp - 1.0_wp))
    end do
    call test%check_close('against quadrature', worst, 0.0_wp, 1.0e-12_wp)
    call test%check('fit of Brewe and Hamrock within 4 per cent', rough < 0.04_wp)
  end subroutine check_ratios

  !> A circle is Hertz's; close to it the ratio grows with the square.
  subroutine check_circle()
    call test%check('a circle, to the bit', abs(radius_ratio(1.0_wp) - 1.0_wp) <= 0.0_wp)
    call test%check_close('no jump', radius_ratio(1.0_wp + 2.0e-8_wp), 1.0_wp, 1.0e-14_wp)
    call test%check('slim contacts are stiffer', radius_ratio(2.0_wp) > 1.0_wp .and. &
                    radius_ratio(1.0e6_wp) > radius_ratio(1.0e3_wp))
    call test%check('the slimmest is finite', radius_ratio(1.0e300_wp) < huge(1.0_wp))
  end subroutine check_circle

  !> An ellipsoid on its flat side: curvatures c/a^2 and c/b^2.
  subroutine check_plane()
    type(figure_type) :: figure
    real(wp) :: ratio
    figure%a = [9.0_wp, 4.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    ratio = ratio_on_plane(figure, [0.0_wp, 0.0_wp, 1.0_wp])
    call test%check_close('on the flat side', ratio, radius_ratio(2.25_wp), 1.0e-14_wp)
    ratio = ratio_on_plane(figure, [0.6_wp, 0.0_wp, 0.8_wp])
    call test%check('on a slope', ratio > 1.0_wp)
  end subroutine check_plane

  !> Two alike ellipsoids on each other: crossed they touch in a circle, parallel in the ellipse of
  !! one on a plane; as shapes they do the same.
  subroutine check_pairs()
    type(dem_block_type) :: b, other
    type(shape_block_type) :: f
    real(wp), parameter :: axes(3) = [3.0_wp, 2.0_wp, 1.0_wp]
    integer(i4) :: k
    do k = 1, lanes
      b%nx(k) = 0.0_wp
      b%ny(k) = 0.0_wp
      b%nz(k) = 1.0_wp
      b%gap(k) = merge(-0.01_wp, 0.01_wp, k <= 2)
      b%a%s(k, :) = [9.0_wp, 4.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      b%b%s(k, :) = b%a%s(k, :)
      f%a%record(k, :) = shape_of(axes, axes, [0.0_wp, 0.0_wp, 0.0_wp], 2.0_wp)
      f%b%record(k, :) = f%a%record(k, :)
    end do
    b%b%s(1, 1:2) = [4.0_wp, 9.0_wp]
    f%b%record(1, 1:4) = [sqrt(0.5_wp), 0.0_wp, 0.0_wp, sqrt(0.5_wp)]
    b%a%volume = 36.0_wp
    b%b%volume = 36.0_wp
    b%ax = 0.0_wp
    b%ay = 0.0_wp
    b%az = 1.0_wp
    b%bx = 0.0_wp
    b%by = 0.0_wp
    b%bz = 1.0_wp
    b%ha = 1.0_wp
    b%hb = 1.0_wp
    call add_curvatures(b, .true.)
    other = b
    call narrow_ellipsoids(b, .true.)
    call test%check_close('crossed', b%curvature(1), 13.0_wp/36.0_wp, 1.0e-14_wp)
    call test%check_close('parallel', b%curvature(2)*radius_ratio(2.25_wp), 13.0_wp/36.0_wp, &
                          1.0e-14_wp)
    call test%check_close('no contact', b%curvature(3), 13.0_wp/36.0_wp, 1.0e-15_wp)
    call narrow_shapes(other, f, .true.)
    call test%check_all_close('forms', other%curvature, b%curvature, 1.0e-14_wp)
  end subroutine check_pairs
end program test_dem_ellipse
