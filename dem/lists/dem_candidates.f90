!> Candidate pairs before they are put into blocks: grains near each other or near planes, their
!! gaps, normals, slots in the list before, and the groups that blocks are made of.
module dem_candidates
  use talus_kinds, only: wp, i4
  use dem_kinds, only: moved_by_forces
  use dem_state, only: dem_grains_type, dem_planes_type, dem_pairs_type, dem_cell_type, &
    kind_ghost, kind_mirror, lanes, history_side
  use dem_cell, only: is_periodic
  use dem_cells, only: find_candidates
  use dem_additional_list, only: held_lanes
  use dem_shape, only: shape_support
  use dem_shape_gap, only: find_shape_gap
  use dem_shape_state, only: shape_ellipsoid
  use dem_gap, only: solve_gap
  use dem_feature_pairs, only: cannot_touch, of_features, find_feature_gap, meets_planes, &
    bounding_records
  use dem_feature_state, only: shape_features
  use dem_images, only: find_over_faces
  use dem_margin, only: spare_margins, pair_skin
  use dem_ellipsoid, only: matrix_times
  implicit none
  private
  public :: list_type, list_grain_pairs, list_plane_pairs, slot_of
  public :: bands, geometries, first_border_group, first_rim_group, first_ghost_group, &
    first_wall_group

  integer(i4), parameter :: bands = 4  !! of gaps, see band_of
  integer(i4), parameter :: most_materials = 1000
  !> Spheres, ellipsoids, two kinds of shapes, features of polyhedra.
  integer(i4), parameter :: geometries = 2 + shape_features
  integer(i4), parameter :: first_border_group = &
    geometries*bands*most_materials*(most_materials + 2)
  integer(i4), parameter :: first_rim_group = 2*first_border_group
  integer(i4), parameter :: first_ghost_group = 3*first_border_group
  integer(i4), parameter :: first_wall_group = 4*first_border_group
  integer(i4), parameter :: batch = 2**17  !! pairs that are tested together

  !> Candidates before they are put into blocks.
  type :: list_type
    integer(i4) :: count = 0
    integer(i4), allocatable :: first(:), second(:)
    integer(i4), allocatable :: old(:)      !! slot in the last list, 0 if new
    integer(i4), allocatable :: group(:)    !! law, geometry and band of gaps
    real(wp), allocatable :: normal(:, :)
    real(wp), allocatable :: gap(:)         !! a lower bound, in_skins; -1 for contacts [m]
  end type list_type

contains

  !> Slot of a pair in the current list, 0 if it is not a candidate.
  pure integer(i4) function slot_of(pairs, first, second) result(slot)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: first, second
    integer(i4) :: e
    slot = 0
    if (.not. allocated(pairs%entry)) return
    do e = pairs%start(first), pairs%start(first + 1) - 1
      if (mod(pairs%entry(e), 2) == 1) cycle
      slot = pairs%entry(e)/2 + 1
      if (pairs%second(1 + mod(slot - 1, lanes), 1 + (slot - 1)/lanes) == second) return
    end do
    slot = 0
  end function slot_of

  !> Grain pairs with a gap below the skin, with their normals and old slots, batch by batch: most
  !! pairs of bounding spheres are no candidates.
  subroutine list_grain_pairs(pairs, grains, ghost_pairs, cell, list)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    logical, intent(in) :: ghost_pairs
    type(dem_cell_type), intent(in) :: cell
    type(list_type), intent(inout) :: list
    type(list_type) :: near
    integer(i4), allocatable :: first(:), second(:)
    integer(i4) :: low, k, count

    if (is_periodic(cell)) then
      call find_over_faces(pairs, grains, cell, ghost_pairs, first, second, count)
    else if (allocated(pairs%features)) then
      call find_candidates(bounding_records(pairs, grains%radius), grains%radius, &
                           spare_margins(pairs, grains%n), grains%kind, pairs%skin, ghost_pairs, &
                           first, second, count)
    else
      call find_candidates(pairs%body, grains%radius, spare_margins(pairs, grains%n), &
                           grains%kind, pairs%skin, ghost_pairs, first, second, count)
    end if
    call make_room(near, min(batch, count))
    call make_room(list, 0)
    do low = 0, count - 1, batch
      near%count = min(batch, count - low)
      near%first(:near%count) = first(low + 1:low + near%count)
      near%second(:near%count) = second(low + 1:low + near%count)
      !$omp parallel do default(none) shared(near, pairs, grains) schedule(static)
      do k = 1, near%count
        call examine_pair(pairs, grains, near, k)
      end do
      call take_near(near, pairs%skin, low, count, list)
    end do
  end subroutine list_grain_pairs

  !> Append the pairs of a batch whose gap is below the skin.
  subroutine take_near(near, skin, done, count, list)
    type(list_type), intent(in) :: near
    real(wp), intent(in) :: skin          !! [m]
    integer(i4), intent(in) :: done, count  !! pairs before this batch, and in all
    type(list_type), intent(inout) :: list
    real(wp), parameter :: spare = 1.05_wp
    integer(i4) :: k, more

    more = 0
    do k = 1, near%count
      if (.not. near%gap(k) > skin) more = more + 1
    end do
    if (list%count + more > size(list%first)) call make_room(list, &
      int(spare*(list%count + more)*(real(count, wp)/real(done + near%count, wp)), i4) + 1_i4)
    do k = 1, near%count
      if (near%gap(k) > skin) cycle
      list%count = list%count + 1
      call copy_pair(near, k, list, list%count)
    end do
  end subroutine take_near

  pure subroutine copy_pair(from, k, to, at)
    type(list_type), intent(in) :: from
    integer(i4), intent(in) :: k, at
    type(list_type), intent(inout) :: to
    to%first(at) = from%first(k)
    to%second(at) = from%second(k)
    to%old(at) = from%old(k)
    to%normal(:, at) = from%normal(:, k)
    to%gap(at) = from%gap(k)
    to%group(at) = from%group(k)
  end subroutine copy_pair

  !> Room for n pairs; those that are there stay.
  subroutine make_room(list, n)
    type(list_type), intent(inout) :: list
    integer(i4), intent(in) :: n
    type(list_type) :: longer
    integer(i4) :: m
    allocate (longer%first(n), longer%second(n), longer%old(n), longer%group(n))
    allocate (longer%normal(3, n), longer%gap(n))
    m = list%count
    if (m > 0) then
      longer%first(:m) = list%first(:m)
      longer%second(:m) = list%second(:m)
      longer%old(:m) = list%old(:m)
      longer%group(:m) = list%group(:m)
      longer%normal(:, :m) = list%normal(:, :m)
      longer%gap(:m) = list%gap(:m)
    end if
    call move_alloc(longer%first, list%first)
    call move_alloc(longer%second, list%second)
    call move_alloc(longer%old, list%old)
    call move_alloc(longer%normal, list%normal)
    call move_alloc(longer%gap, list%gap)
    call move_alloc(longer%group, list%group)
  end subroutine make_room

  !> Old slot, normal, gap and group of candidate k.
  pure subroutine examine_pair(pairs, grains, list, k)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(list_type), intent(inout) :: list
    integer(i4), intent(in) :: k
    integer(i4) :: i, j, lane, block
    integer(i4) :: geometry
    logical :: contact
    real(wp) :: skin

    i = list%first(k)
    j = list%second(k)
    if (allocated(grains%clump) .and. j <= pairs%plain) then
      if (grains%clump(i) > 0 .and. grains%clump(i) == grains%clump(j)) then
        list%gap(k) = huge(1.0_wp)  ! one body
        return
      end if
    end if
    if (cannot_touch(pairs, i, j)) then
      list%gap(k) = huge(1.0_wp)
      return
    end if
    if (j > pairs%plain) j = pairs%former(j - pairs%plain)
    list%old(k) = 0
    if (j > 0) list%old(k) = slot_of(pairs, i, j)
    j = list%second(k)
    skin = pair_skin(pairs, i, pairs%grain(j))
    list%normal(:, k) = 0.0_wp
    contact = .false.
    if (list%old(k) > 0) then
      lane = 1 + mod(list%old(k) - 1, lanes)
      block = 1 + (list%old(k) - 1)/lanes
      list%normal(:, k) = pairs%normal(lane, :, block)
      contact = in_contact(pairs, list%old(k))
    end if
    geometry = geometry_of(pairs, grains, i, j)
    list%gap(k) = -1.0_wp
    if (geometry > shape_features .and. .not. contact) then
      call find_feature_gap(pairs, i, j, list%normal(:, k), list%gap(k))
    else if (geometry > 1 .and. .not. contact) then
      call find_shape_gap(pairs%body(1:3, j) - pairs%body(1:3, i), grains%shapes%record(:, i), &
                         grains%shapes%record(:, pairs%grain(j)), skin, list%normal(:, k), &
                         list%gap(k))
    else if (.not. contact) then
      call find_gap(pairs%body(:, i), pairs%body(:, j), skin, list%normal(:, k), list%gap(k))
    end if
    list%gap(k) = in_skins(list%gap(k), skin, pairs%skin)
    list%group(k) = group_of(.false., grains%material(i), grains%material(pairs%grain(j)), &
                             geometry, band_of(list%gap(k), pairs%skin))
    associate (kinds => grains%kind([i, pairs%grain(j)]))
      if (any(kinds == kind_mirror)) then
        list%group(k) = list%group(k) + first_border_group
      else if (all(kinds == kind_ghost)) then
        list%group(k) = list%group(k) + first_ghost_group
      else if (any(kinds == kind_ghost)) then
        list%group(k) = list%group(k) + first_rim_group
      end if
    end associate
  end subroutine examine_pair

  !> A gap in the margins of its pair, as if these were the skin.
  pure real(wp) function in_skins(gap, pair, skin)
    real(wp), intent(in) :: gap, pair, skin  !! [m]
    in_skins = gap
    if (gap > 0.0_wp .and. pair > skin) in_skins = gap*(skin/pair)
  end function in_skins

  !> Pairs that touch or nearly touch are in band 0; the others can be passed over for a while.
  pure integer(i4) function band_of(gap, skin) result(band)
    real(wp), intent(in) :: gap, skin  !! [m]
    real(wp), parameter :: ends(bands - 1) = [0.05_wp, 0.25_wp, 0.5_wp]
    band = count(gap >= ends*skin)
  end function band_of

  !> Geometry of a pair of grains: 0 spheres, 1 ellipsoids, 1 + the greater kind of form, or
  !! features of polyhedra.
  pure integer(i4) function geometry_of(pairs, grains, i, j) result(geometry)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    integer(i4), intent(in) :: i, j
    integer(i4) :: kind
    geometry = merge(1, 0, pairs%reach(i) > 0.0_wp .or. pairs%reach(j) > 0.0_wp)
    if (of_features(pairs, i, j)) geometry = 1 + shape_features
    if (.not. grains%shapes%in_use) return
    kind = max(grains%shapes%kind(i), grains%shapes%kind(pairs%grain(j)))
    if (kind /= shape_ellipsoid) geometry = 1 + kind
  end function geometry_of

  !> Order of blocks: planes last, materials of first and second, geometry, band of gaps; pairs of
  !! one ghost, then those of two, come between the other grains and the planes.
  pure integer(i4) function group_of(wall, first, second, geometry, band)
    logical, intent(in) :: wall
    integer(i4), intent(in) :: first, second, geometry, band
    group_of = band + bands*(geometry + geometries*(second + most_materials*first))
    if (wall) group_of = group_of + first_wall_group
  end function group_of

  !> Gap along the given normal if that already separates the bodies, else along the true one.
  pure subroutine find_gap(body_a, body_b, skin, normal, gap)
    real(wp), intent(in) :: body_a(:), body_b(:)
    real(wp), intent(in) :: skin  !! pairs with a larger gap are not listed [m]
    real(wp), intent(inout) :: normal(3)
    real(wp), intent(out) :: gap
    real(wp) :: r(3)
    r = body_b(1:3) - body_a(1:3)
    if (sum(normal**2) > 0.5_wp) then
      gap = dot_product(r, normal) &
            - sqrt(dot_product(normal, matrix_times(body_a(10:15), normal))) &
            - sqrt(dot_product(normal, matrix_times(body_b(10:15), normal)))
      if (gap > 0.0_wp) return
    end if
    call solve_gap(r, body_a(10:15), body_b(10:15), normal, gap, skin)
  end subroutine find_gap

  !> Plane-grain pairs, after all grain pairs.
  subroutine list_plane_pairs(pairs, grains, planes, list)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    type(list_type), intent(inout) :: list
    integer(i4) :: k, j, body, geometry
    integer(i4), allocatable :: old(:)  !! (grains) slot in the list before, 0: none
    real(wp) :: gap, normal(3), support, point(3), skin

    if (planes%n == 0) return
    allocate (old(grains%n), source=0_i4)
    do k = 1, planes%n
      body = grains%n + 3 + k
      normal = planes%normal(:, k)
      call mark_slots(pairs, body, .true., old)
      do j = 1, grains%n
        if (.not. (moved_by_forces(grains%kind(j)) .and. meets_planes(pairs, j))) cycle
        gap = dot_product(pairs%body(1:3, j) - planes%point(:, k), normal)
        skin = pair_skin(pairs, body, j)
        if (gap - grains%radius(j) > skin) cycle
        geometry = 1
        if (grains%shapes%in_use) geometry = 1 + grains%shapes%kind(j)
        if (geometry > 1) then
          call shape_support(grains%shapes%record(:, j), -normal, support, point)
          gap = gap - support
        else
          gap = gap - sqrt(dot_product(normal, matrix_times(pairs%body(10:15, j), normal)))
        end if
        if (gap > skin) cycle
        gap = in_skins(gap, skin, pairs%skin)
        if (old(j) > 0) then
          if (in_contact(pairs, old(j))) gap = -1.0_wp
        end if
        if (list%count == size(list%first)) &
          call make_room(list, list%count + list%count/8_i4 + 64_i4)
        list%count = list%count + 1
        associate (n => list%count)
          list%first(n) = body
          list%second(n) = j
          list%old(n) = old(j)
          list%normal(:, n) = normal
          list%gap(n) = gap
          list%group(n) = group_of(.true., planes%material(k), grains%material(j), geometry, &
                                   band_of(gap, pairs%skin))
        end associate
      end do
      call mark_slots(pairs, body, .false., old)
    end do
  end subroutine list_plane_pairs

  !> Slots of the pairs of a plane with grains, of which it may have many, or zeros again.
  pure subroutine mark_slots(pairs, plane, there, slot)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: plane  !! body
    logical, intent(in) :: there
    integer(i4), intent(inout) :: slot(:)
    integer(i4) :: e, at
    if (.not. allocated(pairs%entry)) return
    do e = pairs%start(plane), pairs%start(plane + 1) - 1
      at = pairs%entry(e)/2 + 1
      slot(pairs%second(1 + mod(at - 1, lanes), 1 + (at - 1)/lanes)) = merge(at, 0_i4, there)
    end do
  end subroutine mark_slots

  !> Does a contact, a neck or a bond hold this pair? Its normal is then carried over as it is.
  pure logical function in_contact(pairs, slot)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: slot
    logical :: held(lanes)
    in_contact = pairs%history(1 + mod(slot - 1, lanes), history_side, &
                               1 + (slot - 1)/lanes) > 0.0_wp
    if (.not. pairs%additional%active) return
    held = held_lanes(pairs%additional, 1 + (slot - 1)/lanes)
    in_contact = in_contact .or. held(1 + mod(slot - 1, lanes))
  end function in_contact
end module dem_candidates
