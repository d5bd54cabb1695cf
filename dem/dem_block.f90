!> One block of pairs in a form that the processor likes: one short array a quantity.
module dem_block
  use talus_kinds, only: wp, i4
  use dem_state, only: lanes, body_size
  implicit none
  private
  public :: dem_block_type, gather_geometry, gather_motion

  !> Everything known of 64 pairs while they are worked on; A is the first body, B the second.
  type :: dem_block_type
    real(wp) :: rx(lanes), ry(lanes), rz(lanes)     !! x_B - x_A [m]
    real(wp) :: a(lanes, 6), b(lanes, 6)            !! shape matrices, xx yy zz xy yz zx [m^2]
    real(wp) :: nx(lanes), ny(lanes), nz(lanes)     !! normal, A to B [-]
    real(wp) :: ox(lanes), oy(lanes), oz(lanes)     !! normal of the last evaluation [-]
    real(wp) :: ax(lanes), ay(lanes), az(lanes)     !! surface point of A from its centre [m]
    real(wp) :: bx(lanes), by(lanes), bz(lanes)     !! centre of B from its surface point [m]
    real(wp) :: ha(lanes), hb(lanes)                !! supports along n [m]
    real(wp) :: gap(lanes)                          !! g(n) [m]
    real(wp) :: tx(lanes), ty(lanes), tz(lanes)     !! tangential part of d, gradient of g [m]
    real(wp) :: residual(lanes)                     !! |t|^2 [m^2]
    real(wp) :: curvature(lanes)                    !! sum of the mean curvatures 1/R_e [1/m]
    real(wp) :: vax(lanes), vay(lanes), vaz(lanes)  !! velocity of A [m/s]
    real(wp) :: wax(lanes), way(lanes), waz(lanes)  !! spin of A [rad/s]
    real(wp) :: vbx(lanes), vby(lanes), vbz(lanes)  !! velocity of B [m/s]
    real(wp) :: wbx(lanes), wby(lanes), wbz(lanes)  !! spin of B [rad/s]
    real(wp) :: traces(lanes, 2)                    !! traces of the shape matrices [m^2]
    real(wp) :: volumes(lanes, 2)                   !! (a b c)^2 of both [m^6]
    real(wp) :: f(lanes, 9)                         !! force on B, moments on A and B [N, N m]
  end type dem_block_type

contains

  !> Branch vectors and shape matrices of the lanes' bodies.
  pure subroutine gather_geometry(body, first, second, block)
    real(wp), intent(in), contiguous :: body(:, :)  !! (body_size, bodies)
    integer(i4), intent(in) :: first(lanes), second(lanes)
    type(dem_block_type), intent(inout) :: block
    integer(i4) :: k, i, j

    do k = 1, lanes
      i = first(k)
      j = second(k)
      block%rx(k) = body(1, j) - body(1, i)
      block%ry(k) = body(2, j) - body(2, i)
      block%rz(k) = body(3, j) - body(3, i)
      block%a(k, 1) = body(4, i)
      block%a(k, 2) = body(5, i)
      block%a(k, 3) = body(6, i)
      block%a(k, 4) = body(7, i)
      block%a(k, 5) = body(8, i)
      block%a(k, 6) = body(9, i)
      block%b(k, 1) = body(4, j)
      block%b(k, 2) = body(5, j)
      block%b(k, 3) = body(6, j)
      block%b(k, 4) = body(7, j)
      block%b(k, 5) = body(8, j)
      block%b(k, 6) = body(9, j)
    end do
  end subroutine gather_geometry

  !> Velocities, spins and curvature constants of the lanes' bodies.
  pure subroutine gather_motion(body, first, second, block)
    real(wp), intent(in), contiguous :: body(:, :)
    integer(i4), intent(in) :: first(lanes), second(lanes)
    type(dem_block_type), intent(inout) :: block
    integer(i4) :: k, i, j

    do k = 1, lanes
      i = first(k)
      j = second(k)
      block%vax(k) = body(10, i)
      block%vay(k) = body(11, i)
      block%vaz(k) = body(12, i)
      block%wax(k) = body(13, i)
      block%way(k) = body(14, i)
      block%waz(k) = body(15, i)
      block%vbx(k) = body(10, j)
      block%vby(k) = body(11, j)
      block%vbz(k) = body(12, j)
      block%wbx(k) = body(13, j)
      block%wby(k) = body(14, j)
      block%wbz(k) = body(15, j)
      block%traces(k, 1) = body(16, i)
      block%traces(k, 2) = body(16, j)
      block%volumes(k, 1) = body(17, i)
      block%volumes(k, 2) = body(17, j)
    end do
  end subroutine gather_motion
end module dem_block
