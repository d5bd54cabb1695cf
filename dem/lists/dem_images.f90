!> Images of grains across the faces of a periodic cell: bodies at a grain's place plus a whole
!! number of edges, so that pairs over a face are evaluated like all others.
!!
!! Centres of grains are never folded back, so that a contact has one shift as long as it lasts;
!! the search folds copies of them. Of a pair over a face the higher id is the image.
module dem_images
  use talus_kinds, only: wp, i4, i8
  use talus_homogenise, only: inverse_of
  use dem_kinds, only: moved_by_forces
  use dem_state, only: dem_pairs_type, dem_grains_type, dem_cell_type, kind_free, kind_fixed, &
    body_size
  use dem_cell, only: reduced_basis, shift_of, is_periodic
  use dem_cells, only: find_candidates
  use dem_feature_state, only: feature_edge
  use dem_make, only: sorted_order
  implicit none
  private
  public :: find_over_faces, place_images, place_image, resize_images, name_images, image_of
  public :: most_shift

  integer(i8), parameter :: span = 8192_i8  !! shifts lie within half of it
  integer(i8), parameter :: most_shift = span/2 - 1

  !> Grains folded into the short-edged cell, and copies of those near its faces.
  type :: folded_type
    integer(i4) :: count = 0
    integer(i4), allocatable :: grain(:)     !! grains first, then copies
    integer(i4), allocatable :: shift(:, :)  !! (3, count) from the grain's own centre, in edges
    real(wp), allocatable :: body(:, :)      !! records
  end type folded_type

contains

  !> Candidate pairs in a periodic cell, ascending in first, then second; second may be an image.
  !! The images that they need become bodies.
  subroutine find_over_faces(pairs, grains, cell, ghost_pairs, first, second, count)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_cell_type), intent(in) :: cell
    logical, intent(in) :: ghost_pairs
    integer(i4), allocatable, intent(out) :: first(:), second(:)
    integer(i4), intent(out) :: count
    type(folded_type) :: folded
    integer(i4), allocatable :: a(:), b(:), kind(:)
    integer(i8), allocatable :: key(:)
    integer(i4) :: n, k, found

    call fold(pairs, grains, cell, folded)
    n = grains%n
    kind = grains%kind(folded%grain)
    where (moved_by_forces(kind)) kind = kind_free
    if (allocated(pairs%features)) call bound_copies(pairs, grains%radius, folded)
    if (all(kind == kind_free)) kind(n + 1:) = kind_fixed  ! copies do not meet each other
    call find_candidates(folded%body, grains%radius(folded%grain), [(0.0_wp, k=1, size(kind))], &
                         kind, pairs%skin, ghost_pairs, a, b, found)
    allocate (first(found), second(found), key(found))
    count = 0
    do k = 1, found
      if (a(k) > n .or. folded%grain(b(k)) <= a(k)) cycle
      count = count + 1
      first(count) = a(k)
      second(count) = folded%grain(b(k))
      key(count) = key_of(second(count), folded%shift(:, b(k)) - folded%shift(:, a(k)))
    end do
    call make_images(pairs, n, key(:count))
    do k = 1, count
      second(k) = body_of(pairs, n, key(k))
    end do
    call sort_partners(first(:count), second(:count))
    call place_images(pairs, cell)
  end subroutine find_over_faces

  !> Edges and faces of polyhedra are found as their bounding spheres.
  pure subroutine bound_copies(pairs, radius, folded)
    type(dem_pairs_type), intent(in) :: pairs
    real(wp), intent(in) :: radius(:)  !! (grains) [m]
    type(folded_type), intent(inout) :: folded
    integer(i4) :: k
    do k = 1, folded%count
      if (pairs%features%kind(folded%grain(k)) >= feature_edge) &
        folded%body(10:12, k) = radius(folded%grain(k))**2
    end do
  end subroutine bound_copies

  !> Fold all grains into the reduced cell and copy those within reach of its faces.
  subroutine fold(pairs, grains, cell, folded)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_cell_type), intent(in) :: cell
    type(folded_type), intent(out) :: folded
    real(wp) :: h(3, 3), inverse(3, 3), depth(3)
    real(wp), allocatable :: s(:, :)
    integer(i4) :: whole(3, 3), i, k, m(3), round
    integer(i4), allocatable :: home(:, :)

    allocate (s(3, grains%n), home(3, grains%n))
    call reduced_basis(cell, h, whole)
    inverse = inverse_of(h)
    home = 0
    do i = 1, grains%n
      s(:, i) = matmul(inverse, pairs%body(1:3, i) - cell%origin)
      where (cell%periodic) home(:, i) = floor(s(:, i))
      s(:, i) = s(:, i) - home(:, i)
    end do
    do k = 1, 3
      depth(k) = (2.0_wp*maxval(grains%radius) + pairs%skin)*norm2(inverse(k, :))
    end do
    do round = 1, 2
      folded%count = 0
      do k = 0, 26
        m = [mod(k + 1, 3), mod(k/3 + 1, 3), mod(k/9 + 1, 3)] - 1
        if (any(m /= 0 .and. .not. cell%periodic)) cycle
        do i = 1, grains%n
          if (any(m /= 0 .and. (s(:, i) + m < -depth .or. s(:, i) + m > 1.0_wp + depth))) cycle
          folded%count = folded%count + 1
          if (round == 2) call put(i, matmul(whole, m - home(:, i)))
        end do
      end do
      if (round == 1) allocate (folded%grain(folded%count), folded%shift(3, folded%count), &
                                folded%body(body_size, folded%count))
    end do

  contains

    subroutine put(i, shift)
      integer(i4), intent(in) :: i, shift(3)
      folded%grain(folded%count) = i
      folded%shift(:, folded%count) = shift
      folded%body(:, folded%count) = pairs%body(:, i)
      folded%body(1:3, folded%count) = pairs%body(1:3, i) + shift_of(cell, shift)
    end subroutine put
  end subroutine fold

  !> One number for a grain and a shift, ascending by both; grains themselves have the shift 0.
  pure integer(i8) function key_of(grain, shift) result(key)
    integer(i4), intent(in) :: grain, shift(3)
    key = ((grain*span + shift(1) + span/2)*span + shift(2) + span/2)*span + shift(3) + span/2
  end function key_of

  !> Bodies for all images among the keys; `former` holds their former indices.
  subroutine make_images(pairs, n, key)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: n
    integer(i8), intent(in) :: key(:)
    integer(i8), allocatable :: sorted(:), before(:)
    integer(i8) :: rest
    integer(i4), allocatable :: shift(:, :), owner(:)
    integer(i4) :: k, images

    allocate (shift(3, size(key)), owner(size(key)))
    before = image_keys(pairs)
    sorted = key(sorted_order(key))
    images = 0
    do k = 1, size(sorted)
      if (k > 1) then
        if (sorted(k) == sorted(k - 1)) cycle
      end if
      rest = sorted(k)
      images = images + 1
      shift(3, images) = int(modulo(rest, span) - span/2, i4)
      rest = rest/span
      shift(2, images) = int(modulo(rest, span) - span/2, i4)
      rest = rest/span
      shift(1, images) = int(modulo(rest, span) - span/2, i4)
      owner(images) = int(rest/span, i4)
      if (all(shift(:, images) == 0)) images = images - 1
    end do
    call resize_images(pairs, n, owner(:images), shift(:, :images))
    do k = 1, images
      pairs%former(k) = place_of(before, key_of(owner(k), shift(:, k)))
      if (pairs%former(k) > 0) pairs%former(k) = pairs%former(k) + pairs%plain
    end do
  end subroutine make_images

  !> Images for contacts that come from elsewhere: seconds with a shift become images.
  subroutine name_images(pairs, n, shift, second)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: n              !! grains
    integer(i4), intent(in) :: shift(:, :)    !! (3, contacts)
    integer(i4), intent(inout) :: second(:)   !! (contacts) grains, 0: none
    integer(i8) :: key(size(second))
    integer(i4) :: k
    do k = 1, size(second)
      key(k) = key_of(second(k), shift(:, k))
    end do
    call make_images(pairs, n, pack(key, second > 0))
    do k = 1, size(second)
      if (second(k) > 0) second(k) = body_of(pairs, n, key(k))
    end do
  end subroutine name_images

  !> Image of a grain with a shift; the grain itself if there is none.
  pure integer(i4) function image_of(pairs, n, grain, shift) result(body)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: n, grain, shift(3)
    body = body_of(pairs, n, key_of(grain, shift))
  end function image_of

  pure function image_keys(pairs) result(key)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i8), allocatable :: key(:)
    integer(i4) :: k
    allocate (key(pairs%images))
    do k = 1, pairs%images
      key(k) = key_of(pairs%grain(pairs%plain + k), pairs%shift(:, k))
    end do
  end function image_keys

  !> Arrays for images of given grains, ordered, with their shifts.
  subroutine resize_images(pairs, n, owner, shift)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: n                     !! grains
    integer(i4), intent(in) :: owner(:), shift(:, :)  !! (images), (3, images)
    integer(i4) :: k

    pairs%images = size(owner)
    pairs%grain = [pairs%grain(:pairs%plain), owner]
    pairs%reach = [pairs%reach(:pairs%plain), pairs%reach(owner)]
    pairs%body = reshape([pairs%body(:, :pairs%plain), pairs%body(:, owner)], &
                         [body_size, pairs%plain + pairs%images])
    pairs%shift = shift
    pairs%former = spread(0_i4, 1, pairs%images)
    pairs%image_force = spread(spread(0.0_wp, 1, 3), 2, pairs%images)
    if (allocated(pairs%image_start)) deallocate (pairs%image_start)
    allocate (pairs%image_start(n + 1), source=0_i4)
    do k = 1, pairs%images
      pairs%image_start(owner(k) + 1) = pairs%image_start(owner(k) + 1) + 1
    end do
    pairs%image_start(1) = 1
    do k = 1, n
      pairs%image_start(k + 1) = pairs%image_start(k) + pairs%image_start(k + 1)
    end do
  end subroutine resize_images

  !> Place of a value in an ascending list, 0 if it is not there.
  pure integer(i4) function place_of(list, value) result(place)
    integer(i8), intent(in) :: list(:), value
    integer(i4) :: low, high
    low = 1
    high = size(list)
    do while (low <= high)
      place = (low + high)/2
      if (list(place) == value) return
      if (list(place) < value) then
        low = place + 1
      else
        high = place - 1
      end if
    end do
    place = 0
  end function place_of

  !> Body of a key: the grain itself, or its image.
  pure integer(i4) function body_of(pairs, n, key) result(body)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: n
    integer(i8), intent(in) :: key
    integer(i4) :: k
    body = int(key/span**3, i4)
    do k = pairs%image_start(body), pairs%image_start(body + 1) - 1
      if (key_of(body, pairs%shift(:, k)) /= key) cycle
      body = pairs%plain + k
      return
    end do
  end function body_of

  !> Seconds of each first in ascending order.
  pure subroutine sort_partners(first, second)
    integer(i4), intent(in) :: first(:)
    integer(i4), intent(inout) :: second(:)
    integer(i4) :: i, k, item
    do i = 2, size(first)
      item = second(i)
      k = i - 1
      do while (k >= 1)
        if (first(k) /= first(i) .or. second(k) <= item) exit
        second(k + 1) = second(k)
        k = k - 1
      end do
      second(k + 1) = item
    end do
  end subroutine sort_partners

  !> Records of all images from those of their grains, for the step under way.
  pure subroutine place_images(pairs, cell)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_cell_type), intent(in) :: cell
    integer(i4) :: k
    if (.not. is_periodic(cell)) return
    do k = 1, pairs%images
      call place_image(pairs, cell, k)
    end do
  end subroutine place_images

  !> Record of one image: velocity of the flow between it and its grain added.
  pure subroutine place_image(pairs, cell, k)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: k
    associate (record => pairs%body(:, pairs%plain + k), shift => pairs%shift(:, k))
      record = pairs%body(:, pairs%grain(pairs%plain + k))
      record(1:3) = record(1:3) + shift_of(cell, shift)
      record(4:6) = record(4:6) + shift(1)*cell%speed(:, 1) &
                    + shift(2)*cell%speed(:, 2) + shift(3)*cell%speed(:, 3)
    end associate
  end subroutine place_image
end module dem_images
