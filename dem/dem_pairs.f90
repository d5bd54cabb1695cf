!> The candidate list: made from cells, ordered into blocks, history carried over by pair.
!!
!! Blocks hold pairs of one law, those between ghosts apart; inside a law those that touch or nearly
!! touch come first, so that far blocks cost one gap test. Per-body maps list a body's pairs by
!! partner, so that sums do not depend on the order of the list.
module dem_pairs
  use talus_kinds, only: wp, i4, i8
  use dem_state, only: dem_grains_type, dem_planes_type, dem_pairs_type, dem_weights_type, &
    dem_cell_type, kind_free, kind_ghost, kind_mirror, lanes, body_size, history_size, &
    history_side, history_root, result_size, column_count, entries_ahead
  use dem_cell, only: is_periodic, list_in_cell
  use dem_cells, only: find_candidates
  use dem_form, only: form_support
  use dem_form_gap, only: find_form_gap
  use dem_form_state, only: form_ellipsoid, put_frame
  use dem_extra_list, only: move_extras, mark_touched, held_lanes
  use dem_gap, only: solve_gap
  use dem_images, only: find_over_faces, place_images
  use dem_prescribed, only: put_body
  use dem_shape, only: matrix_times
  implicit none
  private
  public :: build_pairs, update_bodies, allocate_bodies, slot_of

  integer(i4), parameter :: bands = 4  !! of gaps, see band_of
  integer(i4), parameter :: many_results = 2**18  !! reals, 2 MB: more do not stay in the cache
  integer(i4), parameter :: most_materials = 1000
  integer(i4), parameter :: geometries = 4  !! spheres, ellipsoids, two kinds of forms
  integer(i4), parameter :: first_border_group = &
    geometries*bands*most_materials*(most_materials + 2)
  integer(i4), parameter :: first_ghost_group = 2*first_border_group
  integer(i4), parameter :: first_wall_group = 3*first_border_group

  !> Candidates before they are put into blocks.
  type :: list_type
    integer(i4) :: count = 0
    integer(i4), allocatable :: first(:), second(:)
    integer(i4), allocatable :: old(:)      !! slot in the last list, 0 if new
    integer(i4), allocatable :: group(:)    !! law, geometry and band of gaps
    real(wp), allocatable :: normal(:, :)
    real(wp), allocatable :: gap(:)         !! a lower bound; -1 for contacts [m]
  end type list_type

contains

  !> Body records for all grains, planes and pads.
  subroutine allocate_bodies(pairs, grains, planes)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    integer(i4) :: n, bodies, i

    n = grains%n
    bodies = n + 3 + planes%n
    if (allocated(pairs%body)) deallocate (pairs%body, pairs%reference_x, pairs%reference_q, &
                                           pairs%reach, pairs%grain)
    allocate (pairs%body(body_size, bodies), pairs%reference_x(3, bodies), source=0.0_wp)
    allocate (pairs%reference_q(4, bodies), pairs%reach(bodies), source=0.0_wp)
    allocate (pairs%grain(bodies), source=0)
    pairs%plain = bodies
    pairs%images = 0
    do i = n + 1, bodies
      pairs%body(10:12, i) = 1.0_wp
      pairs%body(16, i) = 1.0_wp
    end do
    pairs%body(1, n + 1) = -1.0e4_wp
    pairs%body(1, n + 2) = 1.0e4_wp
    do i = 1, n
      pairs%reach(i) = maxval(grains%axes(:, i)) - minval(grains%axes(:, i))
      pairs%grain(i) = i
    end do
    if (grains%forms%n == 0) return
    where (grains%forms%kind(:n) /= form_ellipsoid) pairs%reach(:n) = grains%forms%reach
  end subroutine allocate_bodies

  !> Body records from the state of grains, planes and cell.
  subroutine update_bodies(pairs, grains, planes, cell)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(inout) :: grains  !! frames of forms
    type(dem_planes_type), intent(in) :: planes
    type(dem_cell_type), intent(in) :: cell
    integer(i4) :: i, k

    do i = 1, grains%n
      call put_body(grains, i, pairs%body(:, i))
      call put_frame(grains%forms, i, grains%quat(:, i))
    end do
    do k = 1, planes%n
      pairs%body(1:3, grains%n + 3 + k) = planes%point(:, k)
      pairs%body(4:6, grains%n + 3 + k) = planes%velocity(:, k)
    end do
    if (cell%active) call place_images(pairs, cell)
  end subroutine update_bodies

  !> Make the list anew for the current bodies; contacts keep normal and history, bit for bit.
  subroutine build_pairs(pairs, grains, planes, weights, ghost_pairs, cell)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    type(dem_weights_type), intent(in) :: weights
    logical, intent(in) :: ghost_pairs
    type(dem_cell_type), intent(inout) :: cell
    type(list_type) :: list
    integer(i4), allocatable :: slot(:)
    integer(i4) :: i

    call list_grain_pairs(pairs, grains, ghost_pairs, cell, list)
    call list_plane_pairs(pairs, grains, planes, list)
    call order_blocks(pairs, grains, planes, list, slot)
    call move_lanes(pairs, grains%n, weights%n > 0, list, slot)
    call map_bodies(pairs, pairs%plain + pairs%images, list, slot)
    call set_lane_constants(pairs, grains, weights, list, slot)
    do i = 1, grains%n
      pairs%reference_x(:, i) = grains%x(:, i)
      pairs%reference_q(:, i) = grains%quat(:, i)
    end do
    do i = 1, planes%n
      pairs%reference_x(:, grains%n + 3 + i) = planes%point(:, i)
    end do
    if (cell%active) call list_in_cell(cell, 2.0_wp*max(maxval(grains%radius), 0.0_wp) &
                                       + pairs%skin)
  end subroutine build_pairs

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

  !> Grain pairs with a gap below the skin, with their normals and old slots.
  subroutine list_grain_pairs(pairs, grains, ghost_pairs, cell, list)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    logical, intent(in) :: ghost_pairs
    type(dem_cell_type), intent(in) :: cell
    type(list_type), intent(inout) :: list
    integer(i4) :: k, kept

    if (is_periodic(cell)) then
      call find_over_faces(pairs, grains, cell, ghost_pairs, list%first, list%second, list%count)
    else
      call find_candidates(pairs%body, grains%radius, grains%kind, pairs%skin, ghost_pairs, &
                           list%first, list%second, list%count)
    end if
    allocate (list%old(list%count), list%group(list%count))
    allocate (list%normal(3, list%count), list%gap(list%count))
    !$omp parallel do default(none) shared(list, pairs, grains) schedule(static)
    do k = 1, list%count
      call look_at_pair(pairs, grains, list, k)
    end do
    kept = 0
    do k = 1, list%count
      if (list%gap(k) > pairs%skin) cycle
      kept = kept + 1
      if (kept == k) cycle
      list%first(kept) = list%first(k)
      list%second(kept) = list%second(k)
      list%old(kept) = list%old(k)
      list%normal(:, kept) = list%normal(:, k)
      list%gap(kept) = list%gap(k)
      list%group(kept) = list%group(k)
    end do
    list%count = kept
  end subroutine list_grain_pairs

  !> Old slot, normal, gap and group of candidate k.
  pure subroutine look_at_pair(pairs, grains, list, k)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(list_type), intent(inout) :: list
    integer(i4), intent(in) :: k
    integer(i4) :: i, j, lane, block
    integer(i4) :: geometry
    logical :: contact

    i = list%first(k)
    j = list%second(k)
    if (j > pairs%plain) j = pairs%former(j - pairs%plain)
    list%old(k) = 0
    if (j > 0) list%old(k) = slot_of(pairs, i, j)
    j = list%second(k)
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
    if (geometry > 1 .and. .not. contact) then
      call find_form_gap(pairs%body(1:3, j) - pairs%body(1:3, i), grains%forms%record(:, i), &
                         grains%forms%record(:, pairs%grain(j)), pairs%skin, list%normal(:, k), &
                         list%gap(k))
    else if (.not. contact) then
      call find_gap(pairs%body(:, i), pairs%body(:, j), list%normal(:, k), list%gap(k))
    end if
    list%group(k) = group_of(.false., grains%material(i), grains%material(pairs%grain(j)), &
                             geometry, band_of(list%gap(k), pairs%skin))
    if (grains%kind(i) == kind_mirror .or. grains%kind(pairs%grain(j)) == kind_mirror) &
      list%group(k) = list%group(k) + first_border_group
    if (grains%kind(i) == kind_ghost .and. grains%kind(pairs%grain(j)) == kind_ghost) &
      list%group(k) = list%group(k) + first_ghost_group
  end subroutine look_at_pair

  !> Pairs that touch or nearly touch are in band 0; the others can be passed over for a while.
  pure integer(i4) function band_of(gap, skin) result(band)
    real(wp), intent(in) :: gap, skin  !! [m]
    real(wp), parameter :: ends(bands - 1) = [0.05_wp, 0.25_wp, 0.5_wp]
    band = count(gap >= ends*skin)
  end function band_of

  !> Geometry of a pair of grains: 0 spheres, 1 ellipsoids, 1 + the greater kind of form.
  pure integer(i4) function geometry_of(pairs, grains, i, j) result(geometry)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    integer(i4), intent(in) :: i, j
    integer(i4) :: kind
    geometry = merge(1, 0, pairs%reach(i) > 0.0_wp .or. pairs%reach(j) > 0.0_wp)
    if (grains%forms%n == 0) return
    kind = max(grains%forms%kind(i), grains%forms%kind(pairs%grain(j)))
    if (kind /= form_ellipsoid) geometry = 1 + kind
  end function geometry_of

  !> Order of blocks: planes last, materials of first and second, geometry, band of gaps; pairs of
  !! ghosts come between the other grains and the planes.
  pure integer(i4) function group_of(wall, first, second, geometry, band)
    logical, intent(in) :: wall
    integer(i4), intent(in) :: first, second, geometry, band
    group_of = band + bands*(geometry + geometries*(second + most_materials*first))
    if (wall) group_of = group_of + first_wall_group
  end function group_of

  !> Gap along the given normal if that already separates the bodies, else along the true one.
  pure subroutine find_gap(body_a, body_b, normal, gap)
    real(wp), intent(in) :: body_a(:), body_b(:)
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
    call solve_gap(r, body_a(10:15), body_b(10:15), normal, gap)
  end subroutine find_gap

  !> Plane-grain pairs, after all grain pairs.
  subroutine list_plane_pairs(pairs, grains, planes, list)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    type(list_type), intent(inout) :: list
    type(list_type) :: longer
    integer(i4) :: k, j, n, body, geometry
    real(wp) :: gap, normal(3), support, point(3)

    if (planes%n == 0) return
    n = list%count + grains%n*planes%n
    allocate (longer%first(n), longer%second(n), longer%old(n), longer%group(n))
    allocate (longer%normal(3, n), longer%gap(n))
    n = list%count
    longer%first(:n) = list%first(:n)
    longer%second(:n) = list%second(:n)
    longer%old(:n) = list%old(:n)
    longer%group(:n) = list%group(:n)
    longer%normal(:, :n) = list%normal(:, :n)
    longer%gap(:n) = list%gap(:n)
    do k = 1, planes%n
      body = grains%n + 3 + k
      normal = planes%normal(:, k)
      do j = 1, grains%n
        if (grains%kind(j) /= kind_free) cycle
        gap = dot_product(pairs%body(1:3, j) - planes%point(:, k), normal)
        if (gap - grains%radius(j) > pairs%skin) cycle
        geometry = 1
        if (grains%forms%n > 0) geometry = 1 + grains%forms%kind(j)
        if (geometry > 1) then
          call form_support(grains%forms%record(:, j), -normal, support, point)
          gap = gap - support
        else
          gap = gap - sqrt(dot_product(normal, matrix_times(pairs%body(10:15, j), normal)))
        end if
        if (gap > pairs%skin) cycle
        n = n + 1
        longer%first(n) = body
        longer%second(n) = j
        longer%old(n) = slot_of(pairs, body, j)
        longer%normal(:, n) = normal
        if (longer%old(n) > 0) then
          if (in_contact(pairs, longer%old(n))) gap = -1.0_wp
        end if
        longer%gap(n) = gap
        longer%group(n) = group_of(.true., planes%material(k), grains%material(j), geometry, &
                                   band_of(gap, pairs%skin))
      end do
    end do
    longer%count = n
    call move_alloc(longer%first, list%first)
    call move_alloc(longer%second, list%second)
    call move_alloc(longer%old, list%old)
    call move_alloc(longer%group, list%group)
    call move_alloc(longer%normal, list%normal)
    call move_alloc(longer%gap, list%gap)
    list%count = n
  end subroutine list_plane_pairs

  !> Does a contact, a neck or a bond hold this pair? Its normal is then carried over as it is.
  pure logical function in_contact(pairs, slot)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: slot
    logical :: held(lanes)
    in_contact = pairs%history(1 + mod(slot - 1, lanes), history_side, &
                               1 + (slot - 1)/lanes) > 0.0_wp
    if (.not. pairs%extras%active) return
    held = held_lanes(pairs%extras, 1 + (slot - 1)/lanes)
    in_contact = in_contact .or. held(1 + mod(slot - 1, lanes))
  end function in_contact

  !> Give every pair its slot: by group, in the order of the list; pad the blocks of a group.
  subroutine order_blocks(pairs, grains, planes, list, slot)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    type(list_type), intent(in) :: list
    integer(i4), allocatable, intent(out) :: slot(:)
    integer(i4), allocatable :: groups(:), next(:)
    integer(i4) :: k, g, length

    call find_groups(list, groups)
    allocate (next(size(groups)), source=0)
    do k = 1, list%count
      g = place_of(groups, list%group(k))
      next(g) = next(g) + 1
    end do
    if (allocated(pairs%group_end)) deallocate (pairs%group_end)
    allocate (pairs%group_end(size(groups)))
    pairs%groups = size(groups)
    pairs%count = list%count
    pairs%blocks = 0
    pairs%grain_blocks = 0
    do g = 1, size(groups)
      length = (next(g) + lanes - 1)/lanes
      next(g) = pairs%blocks*lanes
      pairs%blocks = pairs%blocks + length
      pairs%group_end(g) = pairs%blocks
      if (groups(g) < first_wall_group) pairs%grain_blocks = pairs%blocks
    end do
    allocate (slot(list%count))
    do k = 1, list%count
      g = place_of(groups, list%group(k))
      next(g) = next(g) + 1
      slot(k) = next(g)
    end do
    call name_blocks(pairs, grains, planes, list, slot)
  end subroutine order_blocks

  !> The groups that occur, ascending.
  pure subroutine find_groups(list, groups)
    type(list_type), intent(in) :: list
    integer(i4), allocatable, intent(out) :: groups(:)
    integer(i4) :: k, g, last
    allocate (groups(0))
    last = -1
    do k = 1, list%count
      if (list%group(k) == last) cycle
      last = list%group(k)
      g = place_of(groups, last)
      if (g <= size(groups)) then
        if (groups(g) == last) cycle
      end if
      groups = [groups(:g - 1), last, groups(g:)]
    end do
  end subroutine find_groups

  !> First place in an ascending list whose group is not less, one past the end if there is none.
  pure integer(i4) function place_of(groups, group) result(low)
    integer(i4), intent(in) :: groups(:), group
    integer(i4) :: high, middle
    low = 1
    high = size(groups) + 1
    do while (low < high)
      middle = (low + high)/2
      if (groups(middle) < group) then
        low = middle + 1
      else
        high = middle
      end if
    end do
  end function place_of

  !> Materials, geometry, least gap of each block; a pair with another rank's grain is shared.
  subroutine name_blocks(pairs, grains, planes, list, slot)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    type(list_type), intent(in) :: list
    integer(i4), intent(in) :: slot(:)
    integer(i4) :: k, block

    if (allocated(pairs%law_first)) then
      deallocate (pairs%law_first, pairs%law_second, pairs%round, pairs%form, pairs%least_gap)
    end if
    if (allocated(pairs%share)) deallocate (pairs%share)
    allocate (pairs%law_first(pairs%blocks), pairs%law_second(pairs%blocks))
    allocate (pairs%round(pairs%blocks), pairs%form(pairs%blocks))
    allocate (pairs%least_gap(pairs%blocks), source=huge(1.0_wp))
    do k = 1, list%count
      block = 1 + (slot(k) - 1)/lanes
      if (list%first(k) <= grains%n) then
        pairs%law_first(block) = grains%material(list%first(k))
      else
        pairs%law_first(block) = planes%material(list%first(k) - grains%n - 3)
      end if
      pairs%law_second(block) = grains%material(pairs%grain(list%second(k)))
      pairs%round(block) = mod(list%group(k)/bands, geometries) == 0
      pairs%form(block) = max(mod(list%group(k)/bands, geometries) - 1, 0)
      pairs%least_gap(block) = min(pairs%least_gap(block), list%gap(k))
      if (list%group(k) < first_border_group .or. list%group(k) >= first_ghost_group) cycle
      if (.not. allocated(pairs%share)) allocate (pairs%share(pairs%blocks), source=1.0_wp)
      pairs%share(block) = 0.5_wp
    end do
  end subroutine name_blocks

  !> Fill the lanes of the new blocks from the old ones.
  subroutine move_lanes(pairs, n, weighted, list, slot)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: n
    logical, intent(in) :: weighted
    type(list_type), intent(in) :: list
    integer(i4), intent(in) :: slot(:)
    real(wp), allocatable :: normal(:, :, :), history(:, :, :)
    integer(i4) :: k, lane, block, old_lane, old_block

    allocate (normal(lanes, 3, pairs%blocks), history(lanes, history_size, pairs%blocks), &
              source=0.0_wp)
    normal(:, 1, :) = 1.0_wp
    call allocate_blocks(pairs, n, weighted)
    !$omp parallel do default(none) shared(list, slot, pairs, normal, history) &
    !$omp   private(lane, block, old_lane, old_block) schedule(static)
    do k = 1, list%count
      lane = 1 + mod(slot(k) - 1, lanes)
      block = 1 + (slot(k) - 1)/lanes
      pairs%first(lane, block) = list%first(k)
      pairs%second(lane, block) = list%second(k)
      normal(lane, :, block) = list%normal(:, k)
      if (list%old(k) > 0) then
        old_lane = 1 + mod(list%old(k) - 1, lanes)
        old_block = 1 + (list%old(k) - 1)/lanes
        history(lane, :, block) = pairs%history(old_lane, :, old_block)
      end if
    end do
    !$omp end parallel do
    do block = 1, pairs%blocks
      pairs%touched(block) = any(history(:, history_side, block) > 0.0_wp)
    end do
    call move_alloc(normal, pairs%normal)
    call move_alloc(history, pairs%history)
    if (.not. pairs%extras%active) return
    call move_extras(pairs%extras, pairs%blocks, list%old(:list%count), slot)
    call mark_touched(pairs%extras, pairs%touched)
  end subroutine move_lanes

  !> Arrays of the blocks, all lanes pads.
  subroutine allocate_blocks(pairs, n, weighted)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: n
    logical, intent(in) :: weighted
    if (allocated(pairs%first)) then
      deallocate (pairs%first, pairs%second, pairs%weight, pairs%m_star)
      deallocate (pairs%touched, pairs%result, pairs%columns)
    end if
    allocate (pairs%first(lanes, pairs%blocks), source=n + 1)
    allocate (pairs%second(lanes, pairs%blocks), source=n + 2)
    if (pairs%blocks > pairs%grain_blocks) pairs%first(:, pairs%grain_blocks + 1:) = n + 3
    allocate (pairs%m_star(lanes, pairs%blocks), source=1.0_wp)
    allocate (pairs%weight(lanes, merge(pairs%blocks, 1, weighted)), source=1.0_wp)
    allocate (pairs%touched(pairs%blocks), source=.false.)
    allocate (pairs%result(result_size, lanes*pairs%blocks), source=0.0_wp)
    pairs%past = merge(1_i4, 0_i4, size(pairs%result) > many_results)
    allocate (pairs%columns(column_count, pairs%blocks), source=0.0_wp)
  end subroutine allocate_blocks

  !> Per-body maps; pairs come in ascending order, so entries are ordered by partner.
  subroutine map_bodies(pairs, bodies, list, slot)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: bodies
    type(list_type), intent(in) :: list
    integer(i4), intent(in) :: slot(:)
    integer(i4), allocatable :: fill(:)
    integer(i4) :: k, i, j

    if (allocated(pairs%start)) deallocate (pairs%start, pairs%entry)
    allocate (pairs%start(bodies + 1), source=0)
    allocate (pairs%entry(2*list%count + entries_ahead), source=0)
    do k = 1, list%count
      i = list%first(k)
      j = list%second(k)
      pairs%start(i + 1) = pairs%start(i + 1) + 1
      pairs%start(j + 1) = pairs%start(j + 1) + 1
    end do
    pairs%start(1) = 1
    do k = 2, bodies + 1
      pairs%start(k) = pairs%start(k) + pairs%start(k - 1)
    end do
    allocate (fill, source=pairs%start)
    do k = 1, list%count
      i = list%first(k)
      j = list%second(k)
      pairs%entry(fill(i)) = 2*(slot(k) - 1)
      pairs%entry(fill(j)) = 2*(slot(k) - 1) + 1
      fill(i) = fill(i) + 1
      fill(j) = fill(j) + 1
    end do
  end subroutine map_bodies

  !> Reduced masses (free mass where the partner is prescribed) and contact weights.
  subroutine set_lane_constants(pairs, grains, weights, list, slot)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_weights_type), intent(in) :: weights
    type(list_type), intent(in) :: list
    integer(i4), intent(in) :: slot(:)
    integer(i4) :: k, i, j, lane, block
    logical :: free_i, free_j

    !$omp parallel do default(none) shared(list, slot, pairs, grains, weights) &
    !$omp   private(i, j, lane, block, free_i, free_j) schedule(static)
    do k = 1, list%count
      i = list%first(k)
      j = pairs%grain(list%second(k))
      lane = 1 + mod(slot(k) - 1, lanes)
      block = 1 + (slot(k) - 1)/lanes
      if (i > grains%n) then
        pairs%m_star(lane, block) = grains%mass(j)
        cycle
      end if
      if (pairs%round(block)) pairs%history(lane, history_root, block) = &
        effective_root(grains%radius(i)**2, grains%radius(j)**2)
      free_i = grains%kind(i) == kind_free .or. grains%kind(i) == kind_mirror
      free_j = grains%kind(j) == kind_free .or. grains%kind(j) == kind_mirror
      pairs%m_star(lane, block) = grains%mass(i)*grains%mass(j)/(grains%mass(i) + grains%mass(j))
      if (free_i .and. .not. free_j) pairs%m_star(lane, block) = grains%mass(i)
      if (free_j .and. .not. free_i) pairs%m_star(lane, block) = grains%mass(j)
      if (weights%n > 0) pairs%weight(lane, block) = weight_of(weights, grains%id(i), grains%id(j))
    end do
    !$omp end parallel do
  end subroutine set_lane_constants

  !> Square root of the effective radius of two spheres from the squares of their radii [m^1/2].
  pure real(wp) function effective_root(a, b)
    real(wp), intent(in) :: a, b  !! [m^2]
    effective_root = sqrt(sqrt(a*b)/(sqrt(a) + sqrt(b)))
  end function effective_root

  !> Weight of a pair by binary search, 1 if none was set.
  pure real(wp) function weight_of(weights, first, second) result(value)
    type(dem_weights_type), intent(in) :: weights
    integer(i8), intent(in) :: first, second
    integer(i4) :: low, high, middle
    logical :: below
    value = 1.0_wp
    low = 1
    high = weights%n
    do while (low <= high)
      middle = (low + high)/2
      if (weights%id(1, middle) == first .and. weights%id(2, middle) == second) then
        value = weights%value(middle)
        return
      end if
      below = weights%id(1, middle) < first
      if (weights%id(1, middle) == first) below = weights%id(2, middle) < second
      if (below) then
        low = middle + 1
      else
        high = middle - 1
      end if
    end do
  end function weight_of
end module dem_pairs
