!> Contact forces of all blocks, and their sums per grain in the order of partner ids.
module dem_forces
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_pairs_type, dem_law_type, lanes, history_size, history_side, &
    history_root, result_size, body_size
  use dem_block, only: dem_block_type
  use dem_shape_lanes, only: shape_block_type, ready_shapes, evaluate_shapes, &
    evaluate_shape_planes, evaluate_again, refine_shapes, add_shape_curvatures, solve_shape_lane
  use dem_feature_pairs, only: evaluate_features
  use dem_feature_state, only: shape_features
  use dem_shape_state, only: dem_shapes_type, shape_powers
  use dem_lanes, only: call_for, read_in_order, gather_side, gather_spheres, gather_motions, &
    gather_records, put_loads, sum_results
  use dem_gap, only: branch_vectors, evaluate_pairs, evaluate_spheres, evaluate_planes, &
    refine_normals, add_curvatures, solve_lane
  use dem_law_registry, only: place_of_memory
  use dem_ellipse, only: narrow_ellipsoids, narrow_shapes
  use dem_additional_list, only: held_lanes
  use dem_additional, only: additional_forces
  implicit none
  private
  public :: block_forces, sum_body

  integer(i4), parameter :: ahead = 3  !! blocks: histories and normals are called for so early

  !> Scratch of one block, each thread's own. On the stack its arrays may lie across lines of the
  !! cache, as chance has it: a tenth of the speed of a bed hung on that.
  type(dem_block_type) :: mine
  type(shape_block_type) :: mine_shapes
  !$omp threadprivate(mine, mine_shapes)

contains

  !> Geometry, law and results of one block. A block without contact whose bodies cannot have met
  !! since the list was made is left alone.
  subroutine block_forces(pairs, laws, shapes, k, h, travel, deep)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_law_type), intent(in) :: laws(:, :)
    type(dem_shapes_type), intent(in) :: shapes
    integer(i4), intent(in) :: k        !! block
    real(wp), intent(in) :: h           !! time since the last evaluation [s]
    real(wp), intent(in) :: travel      !! no surface has moved further since the list was made [m]
    logical, intent(out) :: deep        !! some contact may be beyond the limit, see dem_depth
    integer(i4) :: next, later
    logical :: contact

    deep = .false.
    if (pairs%additional%active) pairs%additional%work(:, k) = 0.0_wp
    if (travel < 0.5_wp*pairs%least_gap(k) .and. .not. pairs%touched(k)) then
      pairs%columns(:, k) = 0.0_wp
      return
    end if
    next = min(k + 1, pairs%blocks)
    later = min(k + ahead, pairs%blocks)
    if (pairs%round(k)) then
      if (pairs%touched(k)) call read_in_order(pairs%history(:, 1, k), history_root*lanes)
      call gather_pair(pairs, k, next)
      if (pairs%touched(later)) call call_for(pairs%history(:, 1, later), history_root*lanes)
      call branch_vectors(mine)
      call evaluate_spheres(mine)
    else
      if (pairs%touched(k)) call read_in_order(pairs%history(:, 1, k), history_size*lanes)
      call read_in_order(pairs%normal(:, 1, k), 3*lanes)
      call gather_pair(pairs, k, next)
      if (pairs%touched(later)) call call_for(pairs%history(:, 1, later), history_size*lanes)
      call call_for(pairs%normal(:, 1, later), 3*lanes)
      call branch_vectors(mine)
      call take_normals(pairs, mine, k)
      if (pairs%shape(k) == shape_features) then
        call evaluate_features(pairs, k, mine)
        call keep_normals(pairs, mine, k)
      else if (pairs%shape(k) > 0) then
        call meet_shapes(pairs, shapes, mine, mine_shapes, k)
      else if (k <= pairs%grain_blocks) then
        call evaluate_pairs(mine)
        call find_contacts(pairs, mine, k)
      else
        call evaluate_planes(mine)
      end if
      if (pairs%additional%active .and. k <= pairs%grain_blocks) call find_held(pairs, mine, &
                                                                            mine_shapes, k)
    end if
    contact = any(mine%gap < 0.0_wp)
    if (contact) deep = any(mine%gap < -pairs%shallow)
    if (.not. contact .and. .not. pairs%touched(k)) then
      pairs%columns(:, k) = 0.0_wp
      return
    end if
    if (.not. (pairs%round(k) .or. pairs%shape(k) == shape_features)) call curve_block(pairs, k, &
      laws(pairs%law_first(k), pairs%law_second(k))%elliptic)
    call apply_law(pairs, laws(pairs%law_first(k), pairs%law_second(k)), k, h)
    pairs%touched(k) = contact
    if (pairs%additional%active) call additional_forces(mine, laws(pairs%law_first(k), &
                                                          pairs%law_second(k)), k, h, pairs)
    call put_loads(mine%load, pairs%past, pairs%result(:, (k - 1)*lanes + 1:k*lanes))
  end subroutine block_forces

  !> Mean curvatures of a block of ellipsoids or shapes, for areas that are elliptic or not.
  subroutine curve_block(pairs, k, elliptic)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: k
    logical, intent(in) :: elliptic
    if (pairs%shape(k) > 0) then
      call add_shape_curvatures(mine, mine_shapes, k <= pairs%grain_blocks)
      if (elliptic) call narrow_shapes(mine, mine_shapes, k <= pairs%grain_blocks)
    else
      call add_curvatures(mine, k <= pairs%grain_blocks)
      if (elliptic) call narrow_ellipsoids(mine, k <= pairs%grain_blocks)
    end if
  end subroutine curve_block

  !> Forces of the base law of block k.
  subroutine apply_law(pairs, law, k, h)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: h  !! time since the last evaluation [s]
    integer(i4) :: range(2)
    real(wp) :: none(lanes, 0)
    associate (weight => pairs%weight(:, min(k, size(pairs%weight, 2))))
      if (law%base%reals > 0) then
        range = place_of_memory(law, pairs%additional)
        call law%base%forces(mine, law%law_numbers_type, pairs%round(k), h, pairs%m_star(:, k), &
                             weight, pairs%history(:, :, k), &
                             pairs%additional%kept(:, range(1):range(2), k), pairs%columns(:, k))
      else
        call law%base%forces(mine, law%law_numbers_type, pairs%round(k), h, pairs%m_star(:, k), &
                             weight, pairs%history(:, :, k), none, pairs%columns(:, k))
      end if
    end associate
  end subroutine apply_law

  !> Both bodies of block k; those of the next block are called for. Of spheres, and shapes as their
  !! bounding spheres, no shapes; of features the spheres that sweep them.
  subroutine gather_pair(pairs, k, next)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: k, next
    associate (a => pairs%first, b => pairs%second)
      if (pairs%round(k)) then
        call gather_spheres(pairs%body, a(:, k), a(:, next), pairs%past, mine%a)
        call gather_spheres(pairs%body, b(:, k), b(:, next), pairs%past, mine%b)
      else if (pairs%shape(k) > 0 .and. pairs%shape(k) < shape_features) then
        call gather_motions(pairs%body, a(:, k), a(:, next), pairs%past, mine%a)
        call gather_motions(pairs%body, b(:, k), b(:, next), pairs%past, mine%b)
      else
        call gather_side(pairs%body, a(:, k), a(:, next), pairs%past, mine%a)
        call gather_side(pairs%body, b(:, k), b(:, next), pairs%past, mine%b)
      end if
    end associate
  end subroutine gather_pair

  pure subroutine take_normals(pairs, block, k)
    type(dem_pairs_type), intent(in) :: pairs
    type(dem_block_type), intent(inout) :: block
    integer(i4), intent(in) :: k
    block%nx = pairs%normal(:, 1, k)
    block%ny = pairs%normal(:, 2, k)
    block%nz = pairs%normal(:, 3, k)
  end subroutine take_normals

  pure subroutine keep_normals(pairs, block, k)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_block_type), intent(in) :: block
    integer(i4), intent(in) :: k
    pairs%normal(:, 1, k) = block%nx
    pairs%normal(:, 2, k) = block%ny
    pairs%normal(:, 3, k) = block%nz
  end subroutine keep_normals

  !> Converge the normals of overlapping lanes; a new contact starts from the line of centres, so
  !! that its normal depends on the two bodies alone and not on the history of the list.
  subroutine find_contacts(pairs, block, k)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_block_type), intent(inout) :: block
    integer(i4), intent(in) :: k
    integer(i4) :: lane
    logical :: fresh

    if (.not. any(block%gap <= 0.0_wp)) return
    call refine_normals(block)
    if (any(block%gap <= 0.0_wp .and. pairs%history(:, history_side, k) <= 0.0_wp)) then
      fresh = .false.
      do lane = 1, lanes
        if (block%gap(lane) > 0.0_wp .or. pairs%history(lane, history_side, k) > 0.0_wp) cycle
        call solve_lane(block, lane, .true.)
        fresh = .true.
      end do
      if (fresh) call evaluate_pairs(block)
    end if
    call keep_normals(pairs, block, k)
  end subroutine find_contacts

  !> The same for shapes: gaps, and normals of overlapping lanes.
  subroutine meet_shapes(pairs, shapes, block, figures, k)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_shapes_type), intent(in) :: shapes
    type(dem_block_type), intent(inout) :: block
    type(shape_block_type), intent(inout) :: figures
    integer(i4), intent(in) :: k
    integer(i4) :: lane, next
    logical :: grains

    next = min(k + 1, pairs%blocks)
    grains = k <= pairs%grain_blocks
    call gather_shapes(pairs%second(:, k), pairs%second(:, next), figures%b%record)
    if (grains) call gather_shapes(pairs%first(:, k), pairs%first(:, next), figures%a%record)
    call ready_shapes(figures, grains, pairs%shape(k) == shape_powers)
    if (.not. grains) then
      call evaluate_shape_planes(block, figures)
      return
    end if
    call evaluate_shapes(block, figures)
    if (.not. any(block%gap <= 0.0_wp)) return
    call refine_shapes(block, figures)
    if (new_contacts(block, pairs%history(:, history_side, k))) then
      do lane = 1, lanes
        if (block%gap(lane) > 0.0_wp .or. pairs%history(lane, history_side, k) > 0.0_wp) cycle
        call solve_shape_lane(block, figures, lane, .true.)
      end do
      call evaluate_again(block, figures)
    end if
    call keep_normals(pairs, block, k)

  contains

    !> Records of bodies, those of their grains where bodies are images.
    subroutine gather_shapes(body, ahead, record)
      integer(i4), intent(in) :: body(lanes), ahead(lanes)
      real(wp), intent(inout) :: record(lanes, body_size)
      if (pairs%images > 0) then
        call gather_records(shapes%record, owners(body), owners(ahead), pairs%past, record)
      else
        call gather_records(shapes%record, body, ahead, pairs%past, record)
      end if
    end subroutine gather_shapes

    !> Grains of bodies; pads have the record behind the last grain.
    pure function owners(body) result(owner)
      integer(i4), intent(in) :: body(lanes)
      integer(i4) :: owner(lanes)
      owner = pairs%grain(body)
      owner = merge(owner, shapes%n + 1, owner > 0)
    end function owners
  end subroutine meet_shapes

  !> True if some lane overlaps that did not before.
  pure logical function new_contacts(block, side) result(some)
    type(dem_block_type), intent(in) :: block
    real(wp), intent(in) :: side(lanes)
    integer(i4) :: k
    real(wp) :: count
    count = 0.0_wp
    !$omp simd reduction(+:count)
    do k = 1, lanes
      count = count + merge(1.0_wp, 0.0_wp, block%gap(k) <= 0.0_wp .and. side(k) <= 0.0_wp)
    end do
    some = count > 0.5_wp
  end function new_contacts

  !> Converge the normals of lanes that are held over a gap.
  subroutine find_held(pairs, block, figures, k)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_block_type), intent(inout) :: block
    type(shape_block_type), intent(inout) :: figures
    integer(i4), intent(in) :: k
    integer(i4) :: lane
    logical :: needs(lanes)

    needs = block%gap > 0.0_wp .and. held_lanes(pairs%additional, k)
    if (.not. any(needs)) return
    do lane = 1, lanes
      if (.not. needs(lane)) cycle
      if (pairs%shape(k) > 0) then
        call solve_shape_lane(block, figures, lane, .false.)
      else
        call solve_lane(block, lane, .false.)
      end if
    end do
    if (pairs%shape(k) > 0) then
      call evaluate_again(block, figures)
    else
      call evaluate_pairs(block)
    end if
    call keep_normals(pairs, block, k)
  end subroutine find_held

  !> Force and moment on a body: its pairs in the order of partner ids.
  pure subroutine sum_body(pairs, body, force, moment)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: body
    real(wp), intent(out) :: force(3), moment(3)
    real(wp) :: total(result_size)

    call sum_results(pairs%result, pairs%entry, pairs%start(body), pairs%start(body + 1) - 1, total)
    force = total(1:3)
    moment(1) = total(4) - (pairs%body(2, body)*total(3) - pairs%body(3, body)*total(2))
    moment(2) = total(5) - (pairs%body(3, body)*total(1) - pairs%body(1, body)*total(3))
    moment(3) = total(6) - (pairs%body(1, body)*total(2) - pairs%body(2, body)*total(1))
  end subroutine sum_body
end module dem_forces
