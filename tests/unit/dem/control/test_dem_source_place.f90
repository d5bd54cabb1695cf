!> Places for entering grains: in each kind of region, clear of grains, walls and images; none where
!! there is no room.
program test_dem_source_place
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_region, only: region_type, region_box, region_cylinder, region_sphere
  use talus_test, only: test_type
  use dem_cell, only: set_cell
  use dem_make, only: make_grains, make_planes
  use dem_source_place, only: room_type, gather_neighbours, find_place
  use dem_state, only: dem_data_type, dem_material_type, kind_free
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: places = 300
  real(wp), parameter :: radius = 0.1_wp

  call check_regions()
  call check_clear()
  call check_images()
  call test%finish()

contains

  !> One sphere of radius 0.5 at a place, a floor through the origin.
  subroutine make_world(d, x)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: x(3)
    type(dem_material_type) :: material(1)
    type(error_list_type) :: errors
    real(wp) :: zero(3, 1), up(3, 1)
    zero = 0.0_wp
    material(1)%density = 1.0_wp
    call make_grains(d%grains, material, [1_i8], [kind_free], [1], reshape(x, [3, 1]), &
                     reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1]), zero + 0.5_wp, zero, zero, &
                     errors)
    up = zero
    up(3, 1) = 1.0_wp
    call make_planes(d%planes, zero, up, zero, [1])
  end subroutine make_world

  !> Bounding spheres lie in the region as a whole, and reach all of it.
  subroutine check_regions()
    type(dem_data_type) :: d
    type(region_type) :: region
    real(wp) :: x(3, places), away(places)
    call make_world(d, [50.0_wp, 0.0_wp, 0.0_wp])
    region%kind = region_box
    region%lower = [1.0_wp, 2.0_wp, 3.0_wp]
    region%upper = [2.0_wp, 4.0_wp, 6.0_wp]
    x = drawn(d, region)
    call test%check('in the box', all(x > spread(region%lower + radius, 2, places)) .and. &
                    all(x < spread(region%upper - radius, 2, places)))
    call test%check('all of the box', all(maxval(x, 2) - minval(x, 2) > &
                                          0.95_wp*(region%upper - region%lower - 2.0_wp*radius)))
    region%kind = region_cylinder
    region%base = [1.0_wp, 2.0_wp, 3.0_wp]
    region%axis = [0.6_wp, 0.0_wp, 0.8_wp]
    region%radius = 2.0_wp
    region%length = 3.0_wp
    x = drawn(d, region) - spread(region%base, 2, places)
    away = matmul(region%axis, x)
    call test%check('along the cylinder', all(away > radius) .and. all(away < 3.0_wp - radius))
    away = norm2(x - spread(region%axis, 2, places)*spread(away, 1, 3), 1)
    call test%check('across the cylinder', maxval(away) < 2.0_wp - radius .and. &
                    maxval(away) > 1.8_wp)
    call test%check_close('half of it within 1/sqrt 2', &
                          count(away < (2.0_wp - radius)/sqrt(2.0_wp))/real(places, wp), 0.5_wp, &
                          4.0_wp*0.5_wp/sqrt(real(places, wp)))
    region%kind = region_sphere
    x = drawn(d, region) - spread(region%base, 2, places)
    away = norm2(x, 1)
    call test%check('in the sphere', maxval(away) < 2.0_wp - radius)
    call test%check_close('half of it within the cube root', &
                          count(away < (2.0_wp - radius)*0.5_wp**(1.0_wp/3.0_wp))/ &
                          real(places, wp), 0.5_wp, 4.0_wp*0.5_wp/sqrt(real(places, wp)))
  end subroutine check_regions

  !> Places in a region, each with a key of its own.
  function drawn(d, region) result(x)
    type(dem_data_type), intent(in) :: d
    type(region_type), intent(in) :: region
    real(wp) :: x(3, places)
    type(room_type) :: room
    logical :: found
    integer(i4) :: k
    call gather_neighbours(d, region, room)
    do k = 1, places
      call find_place(d, room, radius, [5_i8, int(k, i8)], 1000, x(:, k), found)
      call test%check('there is room', found)
    end do
  end function drawn

  !> Clear of the sphere and above the floor; no place where both leave none.
  subroutine check_clear()
    type(dem_data_type) :: d
    type(region_type) :: region
    type(room_type) :: room
    real(wp) :: x(3, places), least
    logical :: found
    integer(i4) :: k
    call make_world(d, [0.0_wp, 0.0_wp, 0.5_wp])
    region%kind = region_box
    region%lower = [-0.7_wp, -0.7_wp, -0.2_wp]
    region%upper = [0.7_wp, 0.7_wp, 1.2_wp]
    x = drawn(d, region)
    call test%check('above the floor', all(x(3, :) >= radius))
    least = huge(least)
    do k = 1, places
      least = min(least, norm2(x(:, k) - d%grains%x(:, 1)))
    end do
    call test%check('clear of the sphere', least >= 0.5_wp + radius)
    call test%check('and close to it', least < 0.5_wp + 1.5_wp*radius)
    region%lower = [-0.2_wp, -0.2_wp, 0.1_wp]
    region%upper = [0.2_wp, 0.2_wp, 0.9_wp]
    call gather_neighbours(d, region, room)
    call find_place(d, room, radius, [1_i8], 1000, x(:, 1), found)
    call test%check('no room', .not. found)
  end subroutine check_clear

  !> In a periodic cell an image of the sphere is in the way.
  subroutine check_images()
    type(dem_data_type) :: d
    type(region_type) :: region
    type(room_type) :: room
    real(wp) :: x(3)
    logical :: found
    call make_world(d, [0.1_wp, 0.0_wp, 0.5_wp])
    call set_cell(d%cell, [0.0_wp, -2.0_wp, 0.0_wp], &
                  reshape([4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                           4.0_wp], [3, 3]), [.true., .false., .false.])
    region%kind = region_box
    region%lower = [3.8_wp, -0.2_wp, 0.3_wp]
    region%upper = [4.2_wp, 0.2_wp, 0.7_wp]
    call gather_neighbours(d, region, room)
    call test%check('the image is near', room%n == 1)
    call find_place(d, room, radius, [1_i8], 1000, x, found)
    call test%check('it leaves no room', .not. found)
  end subroutine check_images
end program test_dem_source_place
