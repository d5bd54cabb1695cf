!> Nearest points of features against a search over them.
program test_dem_feature_gap
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_feature_gap, only: nearest_of_polygon, nearest_of_segments, polygon_normal
  use talus_test, only: test_type
  implicit none

  integer(i4), parameter :: tries = 400
  type(test_type) :: test
  integer(i4) :: seed = 12345

  call judge_segments()
  call judge_parallel()
  call judge_polygons()
  call test%finish()

contains

  !> A number from -1 to 1, the same in every run.
  real(wp) function chance()
    seed = ieor(seed, ishft(seed, 13))
    seed = ieor(seed, ishft(seed, -17))
    seed = ieor(seed, ishft(seed, 5))
    chance = real(seed, wp)/real(huge(seed), wp)
  end function chance

  function place() result(x)
    real(wp) :: x(3)
    integer(i4) :: k
    x = [(chance(), k=1, 3)]
  end function place

  !> Least distance of two segments: the distance from a point of one to the other is convex, so
  !! that halving brackets of three points comes to its minimum.
  real(wp) function searched(a, b) result(least)
    real(wp), intent(in) :: a(3, 2), b(3, 2)
    real(wp) :: low, high, m(2)
    integer(i4) :: k
    low = 0.0_wp
    high = 1.0_wp
    do k = 1, 90
      m = low + (high - low)*[1.0_wp, 2.0_wp]/3.0_wp
      if (from_point(a(:, 1) + m(1)*(a(:, 2) - a(:, 1)), b) &
          < from_point(a(:, 1) + m(2)*(a(:, 2) - a(:, 1)), b)) then
        high = m(2)
      else
        low = m(1)
      end if
    end do
    least = from_point(a(:, 1) + low*(a(:, 2) - a(:, 1)), b)
  end function searched

  !> Distance of a point from a segment.
  pure real(wp) function from_point(x, b)
    real(wp), intent(in) :: x(3), b(3, 2)
    real(wp) :: s
    s = dot_product(x - b(:, 1), b(:, 2) - b(:, 1))/sum((b(:, 2) - b(:, 1))**2)
    from_point = norm2(x - b(:, 1) - min(max(s, 0.0_wp), 1.0_wp)*(b(:, 2) - b(:, 1)))
  end function from_point

  subroutine judge_segments()
    real(wp) :: a(3, 2), b(3, 2), p(3), q(3), worst, off
    integer(i4) :: k
    worst = 0.0_wp
    off = 0.0_wp
    do k = 1, tries
      a = reshape([place(), place()], [3, 2])
      b = reshape([place(), place()], [3, 2])
      call nearest_of_segments(a, b, p, q)
      worst = max(worst, abs(norm2(p - q) - searched(a, b)))
      off = max(off, norm2(p - a(:, 1)) + norm2(p - a(:, 2)) - norm2(a(:, 2) - a(:, 1)), &
                norm2(q - b(:, 1)) + norm2(q - b(:, 2)) - norm2(b(:, 2) - b(:, 1)))
    end do
    call test%check_close('least distance of two segments', worst, 0.0_wp, 1.0e-10_wp)
    call test%check_close('its points lie on them', off, 0.0_wp, 1.0e-14_wp)
  end subroutine judge_segments

  !> Parallel segments side by side: the middle of what lies beside each other.
  subroutine judge_parallel()
    real(wp) :: a(3, 2), b(3, 2), p(3), q(3)
    a = reshape([0.0_wp, 0.0_wp, 0.0_wp, 4.0_wp, 0.0_wp, 0.0_wp], [3, 2])
    b = reshape([5.0_wp, 0.0_wp, 2.0_wp, 2.0_wp, 0.0_wp, 2.0_wp], [3, 2])
    call nearest_of_segments(a, b, p, q)
    call test%check_close('parallel segments', norm2(p - [3.0_wp, 0.0_wp, 0.0_wp]) &
                          + norm2(q - [3.0_wp, 0.0_wp, 2.0_wp]), 0.0_wp, 1.0e-14_wp)
    b(1, :) = b(1, :) + 4.0_wp
    call nearest_of_segments(a, b, p, q)
    call test%check_close('one behind the other', norm2(p - q), sqrt(8.0_wp), 1.0e-14_wp)
  end subroutine judge_parallel

  !> Convex polygons: no point of a grid over them is nearer, and the nearest one is no further than
  !! the grid's own mesh allows; inside, on and beyond edges.
  subroutine judge_polygons()
    integer(i4), parameter :: corners = 5
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: x(3, corners), e(3, 2), n(3), y(3), p(3), least, under, over
    integer(i4) :: k, t
    under = 0.0_wp
    over = 0.0_wp
    do t = 1, tries/4
      n = place()
      n = n/norm2(n)
      e(:, 1) = cross(n, place())
      e(:, 1) = e(:, 1)/norm2(e(:, 1))
      e(:, 2) = cross(n, e(:, 1))
      do k = 1, corners
        x(:, k) = cos(2.0_wp*pi*k/corners)*e(:, 1) + 0.7_wp*sin(2.0_wp*pi*k/corners)*e(:, 2)
      end do
      if (t == 1) call test%check_close('normal', norm2(polygon_normal(x) - n), 0.0_wp, 1.0e-14_wp)
      y = 1.5_wp*place()
      p = nearest_of_polygon(y, x)
      least = huge(1.0_wp)
      do k = 3, corners
        least = min(least, least_of_grid(y, x(:, [1, k - 1, k])))
      end do
      under = max(under, norm2(y - p) - least)
      over = max(over, least - norm2(y - p))
    end do
    call test%check_close('no point of a polygon is nearer', under, 0.0_wp, 1.0e-14_wp)
    call test%check_close('and it is a point of it', over, 0.0_wp, 2.0e-2_wp)
  end subroutine judge_polygons

  !> Least distance of y from the points of a grid over a triangle.
  pure real(wp) function least_of_grid(y, x) result(least)
    real(wp), intent(in) :: y(3), x(3, 3)
    integer(i4), parameter :: fine = 60
    integer(i4) :: j, m
    least = huge(1.0_wp)
    do j = 0, fine
      do m = 0, fine - j
        least = min(least, norm2(y - (x(:, 1)*(fine - j - m) + x(:, 2)*j + x(:, 3)*m)/fine))
      end do
    end do
  end function least_of_grid
end program test_dem_feature_gap
