!> Closest points of a point and a convex polygon, and of two segments (theory-dem, Rounded
!! polyhedra). Closed forms, no iteration: distances are right to rounding for any position.
!! eq. D.95
module dem_feature_gap
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  implicit none
  private
  public :: nearest_of_segment, nearest_of_polygon, nearest_of_segments, polygon_normal

contains

  !> Point of the segment a, b nearest to x.
  pure function nearest_of_segment(x, a, b) result(p)
    real(wp), intent(in) :: x(3), a(3), b(3)  !! [m]
    real(wp) :: p(3), d(3), s
    d = b - a
    s = dot_product(x - a, d)/max(dot_product(d, d), tiny(1.0_wp))
    p = a + min(max(s, 0.0_wp), 1.0_wp)*d
  end function nearest_of_segment

  !> Unit normal of a plane polygon, about which its corners go round.
  pure function polygon_normal(corner) result(n)
    real(wp), intent(in) :: corner(:, :)  !! (3, corners) [m]
    real(wp) :: n(3)
    integer(i4) :: k
    n = 0.0_wp
    do k = 3, size(corner, 2)
      n = n + cross(corner(:, k - 1) - corner(:, 1), corner(:, k) - corner(:, 1))
    end do
    n = n/max(norm2(n), tiny(1.0_wp))
  end function polygon_normal

  !> Point of a convex plane polygon, with its inside, nearest to x.
  pure function nearest_of_polygon(x, corner) result(p)
    real(wp), intent(in) :: x(3)          !! [m]
    real(wp), intent(in) :: corner(:, :)  !! (3, corners) in turn [m]
    real(wp) :: p(3), n(3), q(3), least, this
    integer(i4) :: k, next, m
    logical :: inside

    m = size(corner, 2, kind=i4)
    n = polygon_normal(corner)
    inside = .true.
    least = huge(1.0_wp)
    p = x
    do k = 1, m
      next = merge(1, k + 1, k == m)
      if (dot_product(cross(corner(:, next) - corner(:, k), x - corner(:, k)), n) >= 0.0_wp) cycle
      inside = .false.
      q = nearest_of_segment(x, corner(:, k), corner(:, next))
      this = sum((x - q)**2)
      if (this >= least) cycle
      least = this
      p = q
    end do
    if (inside) p = x - dot_product(x - corner(:, 1), n)*n
  end function nearest_of_polygon

  !> Nearest points p of the segment a and q of b. Where several pairs of points are as near, as of
  !! parallel segments side by side, their mean.
  pure subroutine nearest_of_segments(a, b, p, q)
    real(wp), intent(in) :: a(3, 2), b(3, 2)  !! ends [m]
    real(wp), intent(out) :: p(3), q(3)
    real(wp), parameter :: same = 1.0e-12_wp  !! of squares of lengths
    real(wp) :: trial(3, 2, 5), square(5), d(3, 2), r(3), m(3), det, s, t
    integer(i4) :: k, few

    do k = 1, 2
      trial(:, 1, k) = a(:, k)
      trial(:, 2, k) = nearest_of_segment(a(:, k), b(:, 1), b(:, 2))
      trial(:, 1, k + 2) = nearest_of_segment(b(:, k), a(:, 1), a(:, 2))
      trial(:, 2, k + 2) = b(:, k)
    end do
    few = 4
    d(:, 1) = a(:, 2) - a(:, 1)
    d(:, 2) = b(:, 2) - b(:, 1)
    r = b(:, 1) - a(:, 1)
    m = cross(d(:, 1), d(:, 2))
    det = sum(m*m)
    if (det > same*sum(d(:, 1)**2)*sum(d(:, 2)**2)) then
      s = dot_product(cross(r, d(:, 2)), m)/det
      t = dot_product(cross(r, d(:, 1)), m)/det
      if (s > 0.0_wp .and. s < 1.0_wp .and. t > 0.0_wp .and. t < 1.0_wp) then
        few = 5
        trial(:, 1, 5) = a(:, 1) + s*d(:, 1)
        trial(:, 2, 5) = b(:, 1) + t*d(:, 2)
      end if
    end if
    square = huge(1.0_wp)
    do k = 1, few
      square(k) = sum((trial(:, 1, k) - trial(:, 2, k))**2)
    end do
    if (few == 5) then
      if (square(5) <= minval(square(:4))) square(:4) = huge(1.0_wp)
    end if
    det = minval(square) + same*sqrt(sum(d(:, 1)**2)*sum(d(:, 2)**2))
    p = 0.0_wp
    q = 0.0_wp
    few = 0
    do k = 1, 5
      if (square(k) > det) cycle
      few = few + 1
      p = p + trial(:, 1, k)
      q = q + trial(:, 2, k)
    end do
    p = p/few
    q = q/few
  end subroutine nearest_of_segments
end module dem_feature_gap
