!> Places for entering grains: random in a region, such that bounding spheres touch neither each
!! other nor grains and planes that are there.
module dem_source_place
  use talus_kinds, only: wp, i4, i8
  use talus_random, only: uniform
  use talus_region, only: region_type, region_box, region_cylinder
  use talus_vectors, only: cross
  use dem_cell, only: is_periodic, fractions
  use dem_state, only: dem_data_type, dem_cell_type
  implicit none
  private
  public :: room_type, gather_neighbours, find_place, shortest_image

  integer(i8), parameter :: where_to = 3  !! what a random number is for
  real(wp), parameter :: circle = 2.0_wp*acos(-1.0_wp)

  !> Where new bounding spheres may lie, and those that they must not touch.
  type :: room_type
    type(region_type) :: region
    integer(i4) :: n = 0
    real(wp), allocatable :: x(:, :)    !! (3, room) [m]
    real(wp), allocatable :: radius(:)  !! (room) [m]
  contains
    procedure :: add
  end type room_type

contains

  !> The grains of d whose bounding spheres reach into that of a region.
  subroutine gather_neighbours(d, region, room)
    type(dem_data_type), intent(in) :: d
    type(region_type), intent(in) :: region
    type(room_type), intent(out) :: room
    real(wp) :: centre(3), apart(3), reach
    integer(i4) :: i

    room%region = region
    centre = region%centre()
    reach = region%radius
    if (region%kind == region_box) reach = 0.5_wp*norm2(region%upper - region%lower)
    if (region%kind == region_cylinder) reach = norm2([region%radius, 0.5_wp*region%length])
    allocate (room%x(3, 64), room%radius(64))
    do i = 1, d%grains%n
      apart = shortest_image(d%cell, d%grains%x(:, i) - centre)
      if (norm2(apart) > reach + d%grains%radius(i)) cycle
      call room%add(d%grains%x(:, i), d%grains%radius(i))
    end do
  end subroutine gather_neighbours

  !> One more bounding sphere.
  subroutine add(self, x, radius)
    class(room_type), intent(inout) :: self
    real(wp), intent(in) :: x(3), radius  !! [m]
    real(wp), allocatable :: longer(:, :), radii(:)
    if (self%n == size(self%radius)) then
      allocate (longer(3, 2*self%n), radii(2*self%n))
      longer(:, :self%n) = self%x
      radii(:self%n) = self%radius
      call move_alloc(longer, self%x)
      call move_alloc(radii, self%radius)
    end if
    self%n = self%n + 1
    self%x(:, self%n) = x
    self%radius(self%n) = radius
  end subroutine add

  !> A place in the region for a bounding sphere: the first of some random ones that is free.
  subroutine find_place(d, room, radius, key, tries, x, found)
    type(dem_data_type), intent(in) :: d
    type(room_type), intent(in) :: room
    real(wp), intent(in) :: radius     !! [m]
    integer(i8), intent(in) :: key(:)  !! of the random numbers
    integer(i4), intent(in) :: tries
    real(wp), intent(out) :: x(3)      !! [m]
    logical, intent(out) :: found
    real(wp) :: part(3)
    integer(i4) :: attempt, i

    do attempt = 1, tries
      part = [(uniform([key, where_to, int(attempt, i8), int(i, i8)]), i=1, 3)]
      x = point_in(room%region, radius, part)
      found = is_free(d, room, x, radius)
      if (found) return
    end do
    found = .false.
  end subroutine find_place

  !> The point of the region, less a margin, that belongs to three numbers from 0 to 1; equal
  !! volumes belong to equal volumes.
  pure function point_in(region, margin, part) result(x)
    type(region_type), intent(in) :: region
    real(wp), intent(in) :: margin, part(3)
    real(wp) :: x(3), first(3), second(3), away, height, angle

    if (region%kind == region_box) then
      x = region%lower + margin + part*(region%upper - region%lower - 2.0_wp*margin)
    else if (region%kind == region_cylinder) then
      first = 0.0_wp
      first(minloc(abs(region%axis), 1)) = 1.0_wp
      first = cross(region%axis, first)
      first = first/norm2(first)
      second = cross(region%axis, first)
      away = (region%radius - margin)*sqrt(part(1))
      x = region%base + (margin + part(3)*(region%length - 2.0_wp*margin))*region%axis &
          + away*(cos(circle*part(2))*first + sin(circle*part(2))*second)
    else
      away = (region%radius - margin)*part(1)**(1.0_wp/3.0_wp)
      height = 2.0_wp*part(2) - 1.0_wp
      angle = circle*part(3)
      x = region%base + away*[sqrt(1.0_wp - height**2)*cos(angle), &
                              sqrt(1.0_wp - height**2)*sin(angle), height]
    end if
  end function point_in

  !> Does a sphere touch neither these spheres nor a plane?
  pure logical function is_free(d, room, x, radius)
    type(dem_data_type), intent(in) :: d
    type(room_type), intent(in) :: room
    real(wp), intent(in) :: x(3), radius
    integer(i4) :: k
    is_free = .false.
    do k = 1, d%planes%n
      if (dot_product(x - d%planes%point(:, k), d%planes%normal(:, k)) < radius) return
    end do
    do k = 1, room%n
      if (sum(shortest_image(d%cell, x - room%x(:, k))**2) < (radius + room%radius(k))**2) return
    end do
    is_free = .true.
  end function is_free

  !> The shortest of a vector's images in a periodic cell, for edges that are nearly square [m].
  pure function shortest_image(cell, r) result(shortest)
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: r(3)
    real(wp) :: shortest(3), s(3)
    integer(i4) :: k
    shortest = r
    if (.not. is_periodic(cell)) return
    s = fractions(cell, cell%origin + r)
    do k = 1, 3
      if (cell%periodic(k)) shortest = shortest - anint(s(k))*cell%vectors(:, k)
    end do
  end function shortest_image
end module dem_source_place
