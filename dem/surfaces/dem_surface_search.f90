!> Candidates of each grain: triangles within its bounding sphere and the skin, and cones. Current
!! contacts are kept with their grains.
module dem_surface_search
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_kinds, only: moved_by_forces
  use dem_state, only: dem_data_type, kind_fixed, kind_driven
  use dem_surface_body, only: is_free
  use dem_surface_additional, only: surface_kept_reals
  use dem_cell, only: is_periodic
  use dem_surface_contacts, only: begin_list, allocate_contacts, keep_contacts, take_contacts
  use dem_surface_images, only: reached_images, image_count, image_at
  use dem_surface_state, only: dem_surfaces_type, dem_touches_type, surface_cone, is_bore, is_round
  use dem_surface_values, only: mark_reference
  implicit none
  private
  public :: list_near, triangle_distance

  integer(i4), parameter :: most_cells = 2000000

  !> Cells over the triangles; each triangle is in every cell that its box meets.
  type :: grid_type
    real(wp) :: low(3) = 0.0_wp, size = 1.0_wp
    integer(i4) :: n(3) = 1
    integer(i4), allocatable :: start(:), member(:)
    integer(i4), allocatable :: next(:)  !! place in member that is free, while triangles enter
  end type grid_type

  !> Candidates as they are found, with room for more.
  type :: found_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: candidate(:)  !! see dem_touches_type
    real(wp), allocatable :: image(:, :)      !! (3, candidates) [m]
  end type found_type

contains

  !> Make the list for the current positions (bodies and vertices up to date).
  subroutine list_near(d)
    type(dem_data_type), intent(inout) :: d
    type(grid_type) :: grid
    type(dem_touches_type) :: old
    type(found_type) :: found
    integer(i4), allocatable :: grain(:), start(:)
    real(wp), allocatable :: gap(:)
    integer(i4) :: i, near

    if (d%surfaces%mesh%triangles > 0) call make_grid(d%surfaces, d%pairs%skin, d%grains%radius, &
      grid)
    allocate (grain(d%grains%n), start(d%grains%n + 1), gap(d%grains%n))
    allocate (found%candidate(64), found%image(3, 64))
    near = 0
    start(1) = 1
    do i = 1, d%grains%n
      if (.not. may_touch(d, i)) cycle
      gap(near + 1) = huge(1.0_wp)
      if (d%surfaces%mesh%triangles > 0) call find_triangles(d, grid, i, found, gap(near + 1))
      call find_cones(d, i, found, gap(near + 1))
      if (found%n < start(near + 1)) cycle
      near = near + 1
      grain(near) = i
      start(near + 1) = found%n + 1
    end do
    call keep_contacts(d%surfaces%list, old)
    associate (s => d%surfaces)
      call begin_list(s%list, grain(:near), start(:near + 1), found%candidate(:found%n), &
                      found%image(:, :found%n), gap(:near))
      call allocate_contacts(s, d%grains%n, surface_kept_reals(d))
      call take_contacts(s%list, old)
      call mark_reference(s)
    end associate
  end subroutine list_near

  !> Prescribed grains meet free bodies and membranes alone, on one rank, as all ranks hold them.
  pure logical function may_touch(d, i)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    may_touch = moved_by_forces(d%grains%kind(i))
    if (may_touch .or. .not. (allocated(d%surfaces%rigid%free) .and. d%surfaces%counted)) return
    may_touch = d%grains%kind(i) == kind_fixed .or. d%grains%kind(i) == kind_driven
  end function may_touch

  !> Cells as large as the grains reach, so that a grain searches its own cell alone.
  subroutine make_grid(s, skin, radius, grid)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: skin, radius(:)
    type(grid_type), intent(out) :: grid
    real(wp) :: reach
    integer(i4) :: k, c, cells

    reach = max(maxval(radius), 0.0_wp) + skin  ! there may be no grains
    call size_grid(s, reach, grid)
    cells = product(grid%n)
    allocate (grid%start(cells + 1), grid%next(cells), source=0)
    do k = 1, s%mesh%triangles
      call enter(s, reach, k, grid)
    end do
    grid%start(1) = 1
    do c = 1, cells
      grid%start(c + 1) = grid%start(c) + grid%next(c)
    end do
    allocate (grid%member(grid%start(cells + 1) - 1))
    grid%next = grid%start(:cells)
    do k = 1, s%mesh%triangles
      call enter(s, reach, k, grid)
    end do
  end subroutine make_grid

  !> Size and number of the cells: no smaller than the mean triangle or the reach, and not too many.
  pure subroutine size_grid(s, reach, grid)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: reach  !! of the grains [m]
    type(grid_type), intent(inout) :: grid
    real(wp) :: high(3), cells, size
    integer(i4) :: k

    grid%low = minval(s%mesh%x, 2) - reach
    high = maxval(s%mesh%x, 2) + reach
    size = 0.0_wp
    do k = 1, s%mesh%triangles
      size = size + maxval(maxval(s%mesh%x(:, s%mesh%corner(:, k)), 2) &
        - minval(s%mesh%x(:, s%mesh%corner(:, k)), 2))
    end do
    grid%size = max(reach, size/s%mesh%triangles)
    cells = product(max((high - grid%low)/grid%size, 1.0_wp))
    if (cells > most_cells) grid%size = grid%size*(cells/most_cells)**(1.0_wp/3.0_wp)*1.01_wp
    grid%n = 1 + int((high - grid%low)/grid%size, i4)
  end subroutine size_grid

  !> Triangle k in the cells that its box meets: counted, and a member once there is room.
  pure subroutine enter(s, reach, k, grid)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: reach  !! of the grains [m]
    integer(i4), intent(in) :: k
    type(grid_type), intent(inout) :: grid
    integer(i4) :: c, cx, cy, cz, low(3), high(3)

    low = cell_of(grid, minval(s%mesh%x(:, s%mesh%corner(:, k)), 2) - reach)
    high = cell_of(grid, maxval(s%mesh%x(:, s%mesh%corner(:, k)), 2) + reach)
    do cz = low(3), high(3)
      do cy = low(2), high(2)
        do cx = low(1), high(1)
          c = cx + grid%n(1)*(cy - 1 + grid%n(2)*(cz - 1))
          if (allocated(grid%member)) grid%member(grid%next(c)) = k
          grid%next(c) = grid%next(c) + 1
        end do
      end do
    end do
  end subroutine enter

  pure function cell_of(grid, x) result(c)
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(3)
    integer(i4) :: c(3)
    c = min(1 + int(max((x - grid%low)/grid%size, 0.0_wp), i4), grid%n)
  end function cell_of

  !> Triangles that the bounding sphere of grain i and the skin reach, ascending, of one image after
  !! the other.
  subroutine find_triangles(d, grid, i, found, gap)
    type(dem_data_type), intent(in) :: d
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: i
    type(found_type), intent(inout) :: found
    real(wp), intent(inout) :: gap
    integer(i4) :: first(3), last(3), low(3), high(3), b, k

    first = 0
    last = 0
    if (is_periodic(d%cell)) then
      first = huge(first)
      last = -huge(last)
      do b = 1, d%surfaces%n
        if (is_round(d%surfaces, b)) cycle
        call reached_images(d%surfaces, b, d%cell, d%grains%x(:, i), &
                            d%grains%radius(i) + d%pairs%skin, low, high)
        first = min(first, low)
        last = max(last, high)
      end do
    end if
    do k = 1, image_count(first, last)
      call find_in_image(d, grid, i, image_at(d%cell, first, last, k), found, gap)
    end do
  end subroutine find_triangles

  !> The same of one image.
  subroutine find_in_image(d, grid, i, image, found, gap)
    type(dem_data_type), intent(in) :: d
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: image(3)  !! from the surfaces [m]
    type(found_type), intent(inout) :: found
    real(wp), intent(inout) :: gap
    real(wp) :: x(3), distance
    integer(i4) :: cell(3), c, m, k

    x = d%grains%x(:, i) - image
    if (any(x < grid%low) .or. any(x > grid%low + grid%n*grid%size)) return
    cell = cell_of(grid, x)
    c = cell(1) + grid%n(1)*(cell(2) - 1 + grid%n(2)*(cell(3) - 1))
    do m = grid%start(c), grid%start(c + 1) - 1
      k = grid%member(m)
      if (.not. moved_by_forces(d%grains%kind(i))) then
        if (.not. is_free(d%surfaces, d%surfaces%mesh%owner(k))) cycle
      end if
      distance = triangle_distance(d%surfaces%mesh%x(:, d%surfaces%mesh%corner(:, k)), x) &
        - d%grains%radius(i)
      if (distance > d%pairs%skin) cycle
      gap = min(gap, distance)
      call put(found, k, image)
    end do
  end subroutine find_in_image

  !> Round bodies that the bounding sphere of grain i and the skin reach, and their images.
  subroutine find_cones(d, i, found, gap)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    type(found_type), intent(inout) :: found
    real(wp), intent(inout) :: gap
    real(wp) :: image(3), distance
    integer(i4) :: b, first(3), last(3), k

    do b = 1, d%surfaces%n
      if (.not. is_round(d%surfaces, b)) cycle
      if (.not. moved_by_forces(d%grains%kind(i)) .and. .not. is_free(d%surfaces, b)) cycle
      call reached_images(d%surfaces, b, d%cell, d%grains%x(:, i), &
                          d%grains%radius(i) + d%pairs%skin, first, last)
      do k = 1, image_count(first, last)
        image = image_at(d%cell, first, last, k)
        distance = round_distance(d%surfaces, b, d%grains%x(:, i) - image) - d%grains%radius(i)
        if (distance > d%pairs%skin) cycle
        gap = min(gap, distance)
        call put(found, -b, image)
      end do
    end do
  end subroutine find_cones

  !> Distance of a point from round body b, at least [m].
  pure real(wp) function round_distance(s, b, x) result(distance)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: x(3)
    real(wp) :: r(3), along, across, height
    r = x - s%centre(:, b)
    along = dot_product(r, s%round%axis(:, b))
    across = sqrt(max(sum(r*r) - along**2, 0.0_wp)) - s%round%radius(b)
    if (is_bore(s, b)) across = -across
    if (s%kind(b) == surface_cone) then
      height = s%round%radius(b)*s%round%cosine(b)/s%round%sine(b) &
        + min(s%round%extent(b), 0.5_wp*huge(height))
      distance = max(across, -along, along - height)
    else
      distance = max(across, abs(along) - s%round%extent(b))
    end if
  end function round_distance

  subroutine put(found, item, image)
    type(found_type), intent(inout) :: found
    integer(i4), intent(in) :: item
    real(wp), intent(in) :: image(3)  !! [m]
    integer(i4), allocatable :: candidate(:)
    real(wp), allocatable :: images(:, :)
    if (found%n == size(found%candidate)) then
      allocate (candidate(2*found%n), images(3, 2*found%n))
      candidate(:found%n) = found%candidate
      images(:, :found%n) = found%image
      call move_alloc(candidate, found%candidate)
      call move_alloc(images, found%image)
    end if
    found%n = found%n + 1
    found%candidate(found%n) = item
    found%image(:, found%n) = image
  end subroutine put

  !> Distance of a point from a triangle [m].
  pure real(wp) function triangle_distance(p, x) result(distance)
    real(wp), intent(in) :: p(3, 3), x(3)
    real(wp) :: n(3), t(3), r(3), along
    integer(i4) :: k
    logical :: inside

    n = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))
    n = n/sqrt(sum(n*n))
    distance = abs(dot_product(x - p(:, 1), n))
    inside = .true.
    do k = 1, 3
      t = p(:, 1 + mod(k, 3)) - p(:, k)
      inside = inside .and. dot_product(x - p(:, k), cross(n, t)) >= 0.0_wp
    end do
    if (inside) return
    distance = huge(1.0_wp)
    do k = 1, 3
      t = p(:, 1 + mod(k, 3)) - p(:, k)
      r = x - p(:, k)
      along = min(max(dot_product(r, t)/sum(t*t), 0.0_wp), 1.0_wp)
      distance = min(distance, sqrt(sum((r - along*t)**2)))
    end do
  end function triangle_distance
end module dem_surface_search
