!> The candidate list: made from cells, ordered into blocks, history carried over by pair.
!!
!! Blocks hold pairs of one law, those of a ghost and those between ghosts apart; inside a law those
!! that touch or nearly touch come first, so that far blocks cost one gap test. Per-body maps list a
!! body's pairs by partner, so that sums do not depend on the order of the list.
module dem_pairs
  use talus_kinds, only: wp, i4, i8
  use dem_kinds, only: gives_way
  use dem_state, only: dem_grains_type, dem_planes_type, dem_pairs_type, dem_weights_type, &
    dem_cell_type, lanes, body_size, history_size, &
    history_side, history_root, result_size, column_count, entries_ahead
  use dem_candidates, only: list_type, list_grain_pairs, list_plane_pairs, bands, geometries, &
    first_border_group, first_rim_group, first_ghost_group, first_wall_group
  use dem_cell, only: list_in_cell
  use dem_additional_list, only: move_additional, mark_touched
  use dem_shape_state, only: shape_ellipsoid, put_frame
  use dem_images, only: place_images
  use dem_prescribed, only: put_body
  implicit none
  private
  public :: build_pairs, update_bodies, allocate_bodies, effective_root

  integer(i4), parameter :: many_results = 2**18  !! reals, 2 MB: more do not stay in the cache

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
                                           pairs%reach, pairs%ease, pairs%grain)
    allocate (pairs%body(body_size, bodies), pairs%reference_x(3, bodies), source=0.0_wp)
    allocate (pairs%reference_q(4, bodies), pairs%reach(bodies), source=0.0_wp)
    allocate (pairs%ease(bodies), source=1.0_wp)
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
    if (.not. grains%shapes%in_use) return
    where (grains%shapes%kind(:n) /= shape_ellipsoid) pairs%reach(:n) = grains%shapes%reach
  end subroutine allocate_bodies

  !> Body records from the state of grains, planes and cell.
  subroutine update_bodies(pairs, grains, planes, cell)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(inout) :: grains  !! frames of shapes
    type(dem_planes_type), intent(in) :: planes
    type(dem_cell_type), intent(in) :: cell
    integer(i4) :: i, k

    do i = 1, grains%n
      call put_body(grains, i, pairs%body(:, i))
      call put_frame(grains%shapes, i, grains%quat(:, i))
    end do
    do k = 1, planes%n
      pairs%body(1:3, grains%n + 3 + k) = planes%point(:, k)
      pairs%body(4:6, grains%n + 3 + k) = planes%velocity(:, k)
    end do
    if (cell%active) call place_images(pairs, cell)
  end subroutine update_bodies

  !> Rebuild the list for the current bodies; contacts keep normal and history, bit for bit.
  subroutine build_pairs(pairs, grains, planes, weights, ghost_pairs, cell)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_grains_type), intent(in) :: grains
    type(dem_planes_type), intent(in) :: planes
    type(dem_weights_type), intent(in) :: weights
    logical, intent(in) :: ghost_pairs
    type(dem_cell_type), intent(inout) :: cell
    type(list_type) :: list
    integer(i4), allocatable :: slot(:)
    real(wp), allocatable :: result(:, :)
    integer(i4) :: i

    if (pairs%keep_results) allocate (result, source=pairs%result)
    ! peak of memory: parts of the old list that are not needed are freed first
    if (allocated(pairs%result)) deallocate (pairs%result, pairs%columns, pairs%m_star, &
                                             pairs%weight)
    call list_grain_pairs(pairs, grains, ghost_pairs, cell, list)
    call list_plane_pairs(pairs, grains, planes, list)
    call order_blocks(pairs, grains, planes, list, slot)
    deallocate (list%group, list%gap)
    call move_lanes(pairs, grains%n, weights%n > 0, list, slot)
    do i = 1, merge(list%count, 0_i4, pairs%keep_results)
      if (list%old(i) > 0) pairs%result(:, slot(i)) = result(:, list%old(i))
    end do
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
    pairs%bare_blocks = 0
    pairs%rim_blocks = 0
    do g = 1, size(groups)
      length = (next(g) + lanes - 1)/lanes
      next(g) = pairs%blocks*lanes
      pairs%blocks = pairs%blocks + length
      pairs%group_end(g) = pairs%blocks
      if (groups(g) < first_wall_group) pairs%grain_blocks = pairs%blocks
      if (groups(g) < first_rim_group) pairs%bare_blocks = pairs%blocks
      if (groups(g) < first_ghost_group) pairs%rim_blocks = pairs%blocks
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
      deallocate (pairs%law_first, pairs%law_second, pairs%round, pairs%shape, pairs%least_gap)
    end if
    if (allocated(pairs%share)) deallocate (pairs%share)
    allocate (pairs%law_first(pairs%blocks), pairs%law_second(pairs%blocks))
    allocate (pairs%round(pairs%blocks), pairs%shape(pairs%blocks))
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
      pairs%shape(block) = max(mod(list%group(k)/bands, geometries) - 1, 0)
      pairs%least_gap(block) = min(pairs%least_gap(block), list%gap(k))
      if (list%group(k) < first_border_group .or. list%group(k) >= first_rim_group) cycle
      if (.not. allocated(pairs%share)) allocate (pairs%share(pairs%blocks), source=1.0_wp)
      pairs%share(block) = 0.5_wp
    end do
  end subroutine name_blocks

  !> Fill the lanes of the new blocks from the old ones.
  subroutine move_lanes(pairs, n, weighted, list, slot)
    type(dem_pairs_type), intent(inout) :: pairs
    integer(i4), intent(in) :: n
    logical, intent(in) :: weighted
    type(list_type), intent(inout) :: list
    integer(i4), intent(in) :: slot(:)
    real(wp), allocatable :: normal(:, :, :), history(:, :, :)
    integer(i4) :: k, lane, block, old_lane, old_block

    if (allocated(pairs%first)) deallocate (pairs%first, pairs%second, pairs%touched)
    if (allocated(pairs%normal)) deallocate (pairs%normal)
    allocate (history(lanes, history_size, pairs%blocks), source=0.0_wp)
    !$omp parallel do default(none) shared(list, slot, pairs, history) &
    !$omp   private(lane, block, old_lane, old_block) schedule(static)
    do k = 1, list%count
      if (list%old(k) == 0) cycle
      lane = 1 + mod(slot(k) - 1, lanes)
      block = 1 + (slot(k) - 1)/lanes
      old_lane = 1 + mod(list%old(k) - 1, lanes)
      old_block = 1 + (list%old(k) - 1)/lanes
      history(lane, :, block) = pairs%history(old_lane, :, old_block)
    end do
    !$omp end parallel do
    call move_alloc(history, pairs%history)
    allocate (normal(lanes, 3, pairs%blocks), source=0.0_wp)
    normal(:, 1, :) = 1.0_wp
    allocate (pairs%first(lanes, pairs%blocks), source=n + 1)
    allocate (pairs%second(lanes, pairs%blocks), source=n + 2)
    if (pairs%blocks > pairs%grain_blocks) pairs%first(:, pairs%grain_blocks + 1:) = n + 3
    !$omp parallel do default(none) shared(list, slot, pairs, normal) private(lane, block) &
    !$omp   schedule(static)
    do k = 1, list%count
      lane = 1 + mod(slot(k) - 1, lanes)
      block = 1 + (slot(k) - 1)/lanes
      pairs%first(lane, block) = list%first(k)
      pairs%second(lane, block) = list%second(k)
      normal(lane, :, block) = list%normal(:, k)
    end do
    !$omp end parallel do
    call move_alloc(normal, pairs%normal)
    deallocate (list%normal)
    call allocate_blocks(pairs, weighted)
    do block = 1, pairs%blocks
      pairs%touched(block) = any(pairs%history(:, history_side, block) > 0.0_wp)
    end do
    if (.not. pairs%additional%active) return
    call move_additional(pairs%additional, pairs%blocks, list%old(:list%count), slot)
    call mark_touched(pairs%additional, pairs%touched)
  end subroutine move_lanes

  !> What blocks need beside their bodies, normals and histories.
  subroutine allocate_blocks(pairs, weighted)
    type(dem_pairs_type), intent(inout) :: pairs
    logical, intent(in) :: weighted
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
      free_i = gives_way(grains%kind(i))
      free_j = gives_way(grains%kind(j))
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
