!> One block of pairs in a form that the processor likes: one short array a quantity.
module dem_block
  use, intrinsic :: iso_c_binding, only: c_double
  use talus_kinds, only: wp
  use dem_sizes, only: lanes
  implicit none
  private
  public :: dem_block_type, dem_side_type, dem_load_type

  !> One body of each pair; the layout is that of the body records turned round (dem_lanes).
  type, bind(c) :: dem_side_type
    real(c_double) :: x(lanes, 3)                      !! centre [m]
    real(c_double) :: vx(lanes), vy(lanes), vz(lanes)  !! velocity [m/s]
    real(c_double) :: wx(lanes), wy(lanes), wz(lanes)  !! spin [rad/s]
    real(c_double) :: s(lanes, 6)                      !! shape matrix, xx yy zz xy yz zx [m^2]
    real(c_double) :: volume(lanes)                    !! (a b c)^2 [m^6]
  end type dem_side_type

  !> What the contact does to B (A gets the opposite); layout of the result records turned round.
  type, bind(c) :: dem_load_type
    real(c_double) :: fx(lanes), fy(lanes), fz(lanes)  !! force [N]
    real(c_double) :: mx(lanes), my(lanes), mz(lanes)  !! moment about the origin [N m]
  end type dem_load_type

  !> Everything known of the pairs while they are worked on; A is the first body, B the second.
  type :: dem_block_type
    type(dem_side_type) :: a, b
    type(dem_load_type) :: load
    real(wp) :: rx(lanes), ry(lanes), rz(lanes)     !! x_B - x_A [m]
    real(wp) :: nx(lanes), ny(lanes), nz(lanes)     !! normal, A to B [-]
    real(wp) :: ax(lanes), ay(lanes), az(lanes)     !! surface point of A from its centre [m]
    real(wp) :: bx(lanes), by(lanes), bz(lanes)     !! centre of B from its surface point [m]
    real(wp) :: ha(lanes), hb(lanes)                !! supports along n [m]
    real(wp) :: gap(lanes)                          !! g(n) [m]
    real(wp) :: tx(lanes), ty(lanes), tz(lanes)     !! tangential part of d, gradient of g [m]
    real(wp) :: residual(lanes)                     !! |t|^2/(h_A + h_B)^2 [-]
    real(wp) :: curvature(lanes)                    !! sum of the mean curvatures 1/R_e [1/m]
  end type dem_block_type
end module dem_block
