!> Vectors, small matrices and rotations that several parts need.
module talus_vectors
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: cross, inverse, turned, turn_all

  real(wp), parameter :: small = 1.0e-3_wp  !! rotation below which a short series is exact [rad]

contains

  pure function cross(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross

  !> Inverse of a matrix that is known to have one.
  pure function inverse(m) result(inv)
    real(wp), intent(in) :: m(3, 3)
    real(wp) :: inv(3, 3)
    inv(1, :) = cross(m(:, 2), m(:, 3))
    inv(2, :) = cross(m(:, 3), m(:, 1))
    inv(3, :) = cross(m(:, 1), m(:, 2))
    inv = inv/dot_product(m(:, 1), inv(1, :))
  end function inverse

  !> Orientation (w, x, y, z) after a rotation about a fixed axis [rad].
  pure function turned(quat, rotation) result(new)
    real(wp), intent(in) :: quat(4), rotation(3)
    real(wp) :: new(4), s, a(3)
    s = sum(rotation**2)
    if (s < small**2) then
      a = (0.5_wp - s*(1.0_wp/48.0_wp - s*(1.0_wp/3840.0_wp)))*rotation
      s = 1.0_wp - s*(0.125_wp - s*(1.0_wp/384.0_wp - s*(1.0_wp/46080.0_wp)))
    else
      s = sqrt(s)
      a = sin(0.5_wp*s)/s*rotation
      s = cos(0.5_wp*s)
    end if
    new(1) = s*quat(1) - dot_product(a, quat(2:4))
    new(2:4) = s*quat(2:4) + quat(1)*a + cross(a, quat(2:4))
    new = new/sqrt(sum(new**2))
  end function turned

  !> Many orientations (4, n) after rotations (3, n), several at once where all are small.
  pure subroutine turn_all(quat, rotation)
    real(wp), intent(inout), contiguous :: quat(:, :)
    real(wp), intent(in), contiguous :: rotation(:, :)
    real(wp) :: s, h, a, b, c, w, x, y, z
    integer(i4) :: k

    if (.not. all(sum(rotation**2, 1) < small**2)) then
      do k = 1, size(quat, 2)
        quat(:, k) = turned(quat(:, k), rotation(:, k))
      end do
      return
    end if
    !$omp simd private(s, h, a, b, c, w, x, y, z)
    do k = 1, size(quat, 2)
      s = rotation(1, k)**2 + rotation(2, k)**2 + rotation(3, k)**2
      h = 0.5_wp - s*(1.0_wp/48.0_wp - s*(1.0_wp/3840.0_wp))
      a = h*rotation(1, k)
      b = h*rotation(2, k)
      c = h*rotation(3, k)
      s = 1.0_wp - s*(0.125_wp - s*(1.0_wp/384.0_wp - s*(1.0_wp/46080.0_wp)))
      w = s*quat(1, k) - (a*quat(2, k) + b*quat(3, k) + c*quat(4, k))
      x = s*quat(2, k) + quat(1, k)*a + (b*quat(4, k) - c*quat(3, k))
      y = s*quat(3, k) + quat(1, k)*b + (c*quat(2, k) - a*quat(4, k))
      z = s*quat(4, k) + quat(1, k)*c + (a*quat(3, k) - b*quat(2, k))
      h = 1.0_wp/sqrt(w**2 + x**2 + y**2 + z**2)
      quat(1, k) = w*h
      quat(2, k) = x*h
      quat(3, k) = y*h
      quat(4, k) = z*h
    end do
  end subroutine turn_all
end module talus_vectors
