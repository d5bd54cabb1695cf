!> Vectors, small matrices and rotations that several parts need.
module talus_vectors
  use talus_kinds, only: wp
  implicit none
  private
  public :: cross, inverse, turned

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
    real(wp), parameter :: small = 1.0e-3_wp  !! below, the next terms of the series are nothing
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
end module talus_vectors
