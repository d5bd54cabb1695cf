!> Ellipsoids through their support function: shape matrices, support, surface point, curvature.
!!
!! h(n) = sqrt(n.A n), A = Q diag(a^2,b^2,c^2) Q^T; its gradient is the surface point u = A n/h, its
!! tangential Hessian K = (A - u u^T)/h holds the radii of curvature (theory-dem, Contact geometry).
module dem_ellipsoid
  use talus_kinds, only: wp
  implicit none
  private
  public :: rotation_of, shape_matrix, support, surface_point, matrix_times
  public :: quaternion_product, quaternion_from_rotation, rotation_between
  public :: line_of_centres, one_centre

  real(wp), parameter :: one_centre = 1.0e-150_wp  !! centres no further apart coincide [m]

contains

  !> Rotation matrix, body to space, of a unit quaternion (w, x, y, z).
  pure function rotation_of(q) result(r)
    real(wp), intent(in) :: q(4)
    real(wp) :: r(3, 3)
    r(1, 1) = 1.0_wp - 2.0_wp*(q(3)*q(3) + q(4)*q(4))
    r(2, 1) = 2.0_wp*(q(2)*q(3) + q(1)*q(4))
    r(3, 1) = 2.0_wp*(q(2)*q(4) - q(1)*q(3))
    r(1, 2) = 2.0_wp*(q(2)*q(3) - q(1)*q(4))
    r(2, 2) = 1.0_wp - 2.0_wp*(q(2)*q(2) + q(4)*q(4))
    r(3, 2) = 2.0_wp*(q(3)*q(4) + q(1)*q(2))
    r(1, 3) = 2.0_wp*(q(2)*q(4) + q(1)*q(3))
    r(2, 3) = 2.0_wp*(q(3)*q(4) - q(1)*q(2))
    r(3, 3) = 1.0_wp - 2.0_wp*(q(2)*q(2) + q(3)*q(3))
  end function rotation_of

  !> Shape matrix in space as xx yy zz xy yz zx [m^2].
  pure function shape_matrix(r, axes) result(a)
    real(wp), intent(in) :: r(3, 3)  !! rotation, body to space
    real(wp), intent(in) :: axes(3)  !! semi-axes [m]
    real(wp) :: a(6), p(3, 3)
    integer :: k
    do k = 1, 3
      p(:, k) = axes(k)*r(:, k)
    end do
    a(1) = p(1, 1)*p(1, 1) + p(1, 2)*p(1, 2) + p(1, 3)*p(1, 3)
    a(2) = p(2, 1)*p(2, 1) + p(2, 2)*p(2, 2) + p(2, 3)*p(2, 3)
    a(3) = p(3, 1)*p(3, 1) + p(3, 2)*p(3, 2) + p(3, 3)*p(3, 3)
    a(4) = p(1, 1)*p(2, 1) + p(1, 2)*p(2, 2) + p(1, 3)*p(2, 3)
    a(5) = p(2, 1)*p(3, 1) + p(2, 2)*p(3, 2) + p(2, 3)*p(3, 3)
    a(6) = p(3, 1)*p(1, 1) + p(3, 2)*p(1, 2) + p(3, 3)*p(1, 3)
  end function shape_matrix

  pure function matrix_times(a, n) result(p)
    real(wp), intent(in) :: a(6), n(3)
    real(wp) :: p(3)
    p(1) = a(1)*n(1) + a(4)*n(2) + a(6)*n(3)
    p(2) = a(4)*n(1) + a(2)*n(2) + a(5)*n(3)
    p(3) = a(6)*n(1) + a(5)*n(2) + a(3)*n(3)
  end function matrix_times

  !> Support h(n) [m].
  pure real(wp) function support(a, n)
    real(wp), intent(in) :: a(6), n(3)
    support = sqrt(dot_product(n, matrix_times(a, n)))
  end function support

  !> Surface point with outward normal n, from the centre [m].
  pure function surface_point(a, n) result(u)
    real(wp), intent(in) :: a(6), n(3)
    real(wp) :: u(3)
    u = matrix_times(a, n)
    u = u/sqrt(dot_product(n, u))
  end function surface_point

  !> Unit vector along r; of bodies with one centre z, so that they overlap and are no NaN.
  pure function line_of_centres(r) result(n)
    real(wp), intent(in) :: r(3)  !! from one centre to the other [m]
    real(wp) :: n(3), distance
    distance = sqrt(sum(r*r))
    n = [0.0_wp, 0.0_wp, 1.0_wp]
    if (distance > one_centre) n = r/distance
  end function line_of_centres

  pure function quaternion_product(p, q) result(r)
    real(wp), intent(in) :: p(4), q(4)
    real(wp) :: r(4)
    r(1) = p(1)*q(1) - p(2)*q(2) - p(3)*q(3) - p(4)*q(4)
    r(2) = p(1)*q(2) + p(2)*q(1) + p(3)*q(4) - p(4)*q(3)
    r(3) = p(1)*q(3) - p(2)*q(4) + p(3)*q(1) + p(4)*q(2)
    r(4) = p(1)*q(4) + p(2)*q(3) - p(3)*q(2) + p(4)*q(1)
  end function quaternion_product

  !> Unit quaternion of a rotation vector (space frame) [rad].
  pure function quaternion_from_rotation(rotation) result(q)
    real(wp), intent(in) :: rotation(3)
    real(wp) :: q(4), angle, factor
    angle = sqrt(sum(rotation**2))
    factor = 0.5_wp - angle*angle/48.0_wp
    if (angle > 1.0e-4_wp) factor = sin(0.5_wp*angle)/angle
    q(1) = cos(0.5_wp*angle)
    q(2:4) = factor*rotation
  end function quaternion_from_rotation

  !> Rotation vector (space frame, shortest way) that turns orientation q0 into q1 [rad].
  pure function rotation_between(q0, q1) result(rotation)
    real(wp), intent(in) :: q0(4), q1(4)
    real(wp) :: rotation(3), d(4), s
    d = quaternion_product(q1, [q0(1), -q0(2), -q0(3), -q0(4)])
    if (d(1) < 0.0_wp) d = -d
    s = sqrt(d(2)**2 + d(3)**2 + d(4)**2)
    if (s > 1.0e-6_wp) then
      rotation = 2.0_wp*atan2(s, d(1))/s*d(2:4)
    else
      rotation = 2.0_wp*d(2:4)/d(1)
    end if
  end function rotation_between
end module dem_ellipsoid
