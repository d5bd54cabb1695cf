!> Rotation and shape matrices of a block of lanes. In a file of their own so that no caller inlines
!! them: a block that is reloaded must have, bit for bit, the matrices of one that moved on.
module dem_orientation
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  implicit none
  private
  public :: rotations, shape_matrices

contains

  !> Rotation matrices, body to space, by columns.
  pure subroutine rotations(q, r)
    real(wp), intent(in) :: q(lanes, 4)   !! unit quaternions w, x, y, z
    real(wp), intent(out) :: r(lanes, 9)
    integer(i4) :: k
    real(wp) :: w, x, y, z
    !$omp simd private(w, x, y, z)
    do k = 1, lanes
      w = q(k, 1)
      x = q(k, 2)
      y = q(k, 3)
      z = q(k, 4)
      r(k, 1) = 1.0_wp - 2.0_wp*(y*y + z*z)
      r(k, 2) = 2.0_wp*(x*y + w*z)
      r(k, 3) = 2.0_wp*(x*z - w*y)
      r(k, 4) = 2.0_wp*(x*y - w*z)
      r(k, 5) = 1.0_wp - 2.0_wp*(x*x + z*z)
      r(k, 6) = 2.0_wp*(y*z + w*x)
      r(k, 7) = 2.0_wp*(x*z + w*y)
      r(k, 8) = 2.0_wp*(y*z - w*x)
      r(k, 9) = 1.0_wp - 2.0_wp*(x*x + y*y)
    end do
  end subroutine rotations

  !> Shape matrices, xx yy zz xy yz zx [m^2].
  pure subroutine shape_matrices(square, r, round, a)
    real(wp), intent(in) :: square(lanes, 3)  !! squares of the semi-axes [m^2]
    real(wp), intent(in) :: r(lanes, 9)       !! rotation, body to space, by columns
    logical, intent(in) :: round              !! all are spheres
    real(wp), intent(out) :: a(lanes, 6)
    real(wp) :: s1, s2, s3
    integer(i4) :: k
    if (round) then
      a(:, 1:3) = square
      a(:, 4:6) = 0.0_wp
      return
    end if
    !$omp simd private(s1, s2, s3)
    do k = 1, lanes
      s1 = square(k, 1)
      s2 = square(k, 2)
      s3 = square(k, 3)
      a(k, 1) = s1*r(k, 1)*r(k, 1) + s2*r(k, 4)*r(k, 4) + s3*r(k, 7)*r(k, 7)
      a(k, 2) = s1*r(k, 2)*r(k, 2) + s2*r(k, 5)*r(k, 5) + s3*r(k, 8)*r(k, 8)
      a(k, 3) = s1*r(k, 3)*r(k, 3) + s2*r(k, 6)*r(k, 6) + s3*r(k, 9)*r(k, 9)
      a(k, 4) = s1*r(k, 1)*r(k, 2) + s2*r(k, 4)*r(k, 5) + s3*r(k, 7)*r(k, 8)
      a(k, 5) = s1*r(k, 2)*r(k, 3) + s2*r(k, 5)*r(k, 6) + s3*r(k, 8)*r(k, 9)
      a(k, 6) = s1*r(k, 3)*r(k, 1) + s2*r(k, 6)*r(k, 4) + s3*r(k, 9)*r(k, 7)
    end do
  end subroutine shape_matrices
end module dem_orientation
