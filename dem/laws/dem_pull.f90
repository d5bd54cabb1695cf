!> A force along the normal of a contact, as additional models add it: where, how fast, and the load
!! on the block.
module dem_pull
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_block, only: dem_block_type
  implicit none
  private
  public :: place_of_contact, speed_of_contact, add_pull

contains

  !> Normal of lane k, and its contact point from the centre of A [m].
  pure subroutine place_of_contact(b, share, k, normal, point)
    type(dem_block_type), intent(in) :: b
    real(wp), intent(in) :: share  !! of the gap that is A's
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: normal(3), point(3)
    normal = [b%nx(k), b%ny(k), b%nz(k)]
    point = [b%ax(k), b%ay(k), b%az(k)] + share*b%gap(k)*normal
  end subroutine place_of_contact

  !> Velocity of B from A along the normal at a point from the centre of A [m/s].
  pure real(wp) function speed_of_contact(b, k, point, normal) result(speed)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: point(3), normal(3)
    real(wp) :: arm(3), v(3)
    arm = point - [b%rx(k), b%ry(k), b%rz(k)]
    v = [b%b%vx(k) - b%a%vx(k), b%b%vy(k) - b%a%vy(k), b%b%vz(k) - b%a%vz(k)] &
        + cross([b%b%wx(k), b%b%wy(k), b%b%wz(k)], arm) &
        - cross([b%a%wx(k), b%a%wy(k), b%a%wz(k)], point)
    speed = dot_product(v, normal)
  end function speed_of_contact

  !> Add a force on B at a point from the centre of A.
  pure subroutine add_pull(b, k, point, force)
    type(dem_block_type), intent(inout) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: point(3), force(3)
    real(wp) :: place(3)
    place = point + b%a%x(k, :)
    b%load%fx(k) = b%load%fx(k) + force(1)
    b%load%fy(k) = b%load%fy(k) + force(2)
    b%load%fz(k) = b%load%fz(k) + force(3)
    b%load%mx(k) = b%load%mx(k) + place(2)*force(3) - place(3)*force(2)
    b%load%my(k) = b%load%my(k) + place(3)*force(1) - place(1)*force(3)
    b%load%mz(k) = b%load%mz(k) + place(1)*force(2) - place(2)*force(1)
  end subroutine add_pull
end module dem_pull
