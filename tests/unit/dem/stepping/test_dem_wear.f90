!> Wear of surfaces: which contacts slide, how far, and which triangle they wear.
program test_dem_wear
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_state, only: dem_data_type, lanes, history_size, history_side, body_size
  use dem_wear, only: begin_wear, make_wear_room, wear_near, add_wear, worn_volumes
  implicit none
  type(test_type) :: test
  real(wp), parameter :: kn = 1.0e5_wp, press = 5.0_wp, friction = 0.5_wp, h = 1.0e-3_wp

  call check_slides()
  call check_triangles()
  call test%finish()

contains

  !> A sphere on a square of two triangles, which moves; the contact point is `foot`.
  subroutine make_contact(d, foot, shear)
    type(dem_data_type), intent(out) :: d
    real(wp), intent(in) :: foot(3)  !! [m]
    real(wp), intent(in) :: shear    !! tangential force along -x [N]
    d%grains%n = 1
    d%grains%material = [1_i4]
    allocate (d%laws(1, 1))
    d%laws(1, 1)%kn = kn
    d%laws(1, 1)%friction = friction
    allocate (d%pairs%body(body_size, 1), source=0.0_wp)
    d%pairs%body(1:3, 1) = foot + [0.0_wp, 0.0_wp, 1.0_wp]
    d%pairs%body(4, 1) = 3.0_wp
    d%pairs%body(8, 1) = 1.0_wp
    associate (s => d%surfaces)
      s%n = 1
      s%parts = 1
      s%material = [1_i4]
      s%first_part = [1_i4, 2_i4]
      s%mesh%triangles = 2
      s%mesh%x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, &
                          0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], [3, 4])
      s%mesh%corner = reshape([1_i4, 2_i4, 3_i4, 1_i4, 3_i4, 4_i4], [3, 2])
      s%mesh%owner = [1_i4, 1_i4]
      s%list%near = 1
      s%list%near_grain = [1_i4]
      s%list%near_start = [1_i4, 3_i4]
      s%list%candidate = [1_i4, 2_i4]
      s%list%slots = lanes
      s%list%contacts = [1_i4]
      allocate (s%list%image(3, 2), s%list%history(lanes, history_size, 1), &
                s%list%foot(lanes, 3, 1), s%list%normal(lanes, 3, 1), s%list%point(lanes, 3, 1), &
                s%list%push(lanes, 3, 1), s%list%motion(lanes, 6, 1), source=0.0_wp)
      allocate (s%list%part(lanes, 1), source=1_i4)
      allocate (s%list%kept(lanes, 0, 1))
      s%list%foot(1, :, 1) = foot
      s%list%point(1, :, 1) = foot
      s%list%normal(1, 3, 1) = 1.0_wp
      s%list%push(1, :, 1) = [-shear, 0.0_wp, press]
      s%list%history(1, history_side, 1) = sqrt(press/kn)
      s%list%motion(1, 1:3, 1) = [0.5_wp, 0.0_wp, -7.0_wp]
    end associate
    call begin_wear(d)
    d%wear%body_rate = 2.0e-9_wp
    call make_wear_room(d)
  end subroutine make_contact

  !> A step of wear.
  subroutine wear_once(d)
    type(dem_data_type), intent(inout) :: d
    call wear_near(d, h, 0, 1)
    call add_wear(d)
  end subroutine wear_once

  !> v 3, spin 1 about y at an arm of 1 below, surface 0.5: the point slides with 1.5 m/s.
  subroutine check_slides()
    type(dem_data_type) :: d
    real(wp), parameter :: path = h*press*1.5_wp
    call make_contact(d, [0.7_wp, 0.2_wp, 0.0_wp], friction*press)
    call wear_once(d)
    call test%check_close('a contact at the limit slides', d%wear%body(1), path, 1.0e-15_wp)
    call wear_once(d)
    call test%check_close('steps add up', d%wear%body(1), 2.0_wp*path, 1.0e-15_wp)
    call test%check_close('volume of the triangle', sum(worn_volumes(d)), 4.0e-9_wp*path, &
                          1.0e-24_wp)
    call make_contact(d, [0.7_wp, 0.2_wp, 0.0_wp], 0.9_wp*friction*press)
    call wear_once(d)
    call test%check_close('one below the limit sticks', d%wear%body(1), 0.0_wp, 0.0_wp)
    call make_contact(d, [0.7_wp, 0.2_wp, 0.0_wp], friction*press)
    d%surfaces%list%push(1, 3, 1) = -press
    call wear_once(d)
    call test%check_close('what pulls does not wear', d%wear%body(1), 0.0_wp, 0.0_wp)
    call make_contact(d, [0.7_wp, 0.2_wp, 0.0_wp], friction*press)
    d%wear%body_rate = 0.0_wp
    call wear_once(d)
    call test%check_close('what has no coefficient does not wear', d%wear%body(1), 0.0_wp, 0.0_wp)
  end subroutine check_slides

  !> The triangle that is nearest to the foot: inside each, and beyond an edge.
  subroutine check_triangles()
    type(dem_data_type) :: d
    real(wp), parameter :: feet(3, 4) = reshape([0.7_wp, 0.2_wp, 0.0_wp, 0.2_wp, 0.7_wp, 0.0_wp, &
      1.1_wp, 0.4_wp, 0.01_wp, 0.4_wp, 1.1_wp, 0.01_wp], [3, 4])
    integer(i4) :: k
    do k = 1, 4
      call make_contact(d, feet(:, k), friction*press)
      call wear_once(d)
      call test%check('the nearest triangle wears', d%wear%triangle(2 - mod(k, 2)) > 0.0_wp)
      call test%check('and no other', .not. d%wear%triangle(1 + mod(k, 2)) > 0.0_wp)
    end do
  end subroutine check_triangles
end program test_dem_wear
