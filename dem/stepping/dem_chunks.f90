!> Both halves of a step for a chunk of grains; the last chunk is that of planes and surfaces.
module dem_chunks
  use talus_kinds, only: wp, i4
  use dem_kinds, only: gives_way
  use dem_state, only: dem_data_type, dem_pairs_type, kind_fixed, kind_ghost, body_size
  use dem_carry, only: start_carried, finish_carried, recall_carried
  use dem_forces, only: sum_body
  use dem_lanes, only: sum_lanes, call_for
  use dem_integrate, only: motion_type, kick_block, drift_block, work_count
  use dem_integration_block, only: integration_block_type, block_state_type, store_block, &
    load_forces, store_forces, load_side, recall_side, ready_state, read_block, put_bodies, &
    follow_travel
  use dem_relist, only: travel_of, larger
  use dem_prescribed, only: drift_prescribed, finish_prescribed
  use dem_ellipsoid, only: quaternion_from_rotation
  use dem_exact_forces, only: note_ghost, note_vertices
  use dem_membrane, only: push_surfaces, finish_membranes
  use dem_surface_forces, only: add_surface_loads
  use dem_surface_motion, only: drift_surfaces, finish_surfaces, surface_travel
  use dem_step_work, only: step_memory_type
  use dem_wear, only: add_wear
  use dem_heat, only: conduct
  implicit none
  private
  public :: set_turns, start_chunk, recall_chunk, finish_chunk, start_planes, finish_planes

contains

  !> Rotation of one step of the grains that keep a constant spin.
  subroutine set_turns(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: i
    do i = 1, d%grains%n
      if (stands(d%grains%kind(i))) cycle
      if (d%grains%has_target(i)) cycle
      d%grains%turn(:, i) = quaternion_from_rotation(d%par%dt*d%grains%omega(:, i))
    end do
  end subroutine set_turns

  !> Is the grain of a kind that no prescription moves here?
  pure logical function stands(kind)
    integer(i4), intent(in) :: kind
    stands = gives_way(kind) .or. kind == kind_fixed
  end function stands

  !> Start of a step for the grains of chunk c; the last chunk is the planes'. The integration block
  !! is that left by finish_chunk, or it is fresh.
  subroutine start_chunk(d, c, motion, last, exact, work, state, fresh)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: c
    type(motion_type), intent(in) :: motion
    logical, intent(in) :: last
    logical, intent(in) :: exact  !! the travel is computed exactly, see follow_travel
    type(step_memory_type), intent(inout) :: work
    type(block_state_type), intent(inout) :: state
    logical, intent(in) :: fresh
    real(wp) :: travel
    integer(i4) :: i

    work%started(:, c) = 0.0_wp
    travel = 0.0_wp
    if (c > size(work%blocks)) then
      call push_surfaces(d%surfaces, d%planes%velocity, motion, .true., work%started(:, c))
      call start_planes(d, motion%dt, last, travel)
    else if (d%cell%active) then
      if (fresh) call ready_chunk(d, work%blocks(c), state)
      call start_carried(d, work%blocks(c), motion, last, state, work%started(:, c), travel)
    else
      associate (block => work%blocks(c))
        if (block%free_count > 0) then
          if (fresh) call ready_chunk(d, block, state)
          call kick_block(block, state, motion, .true., work%started(:, c))
          call drift_block(block, state, motion%dt)
          call put_bodies(block, state, d%pairs%body, d%grains%shapes)
          call follow_travel(block, state, d%pairs, motion%dt, exact)
          travel = block%travel
        end if
        do i = block%low + 1, block%low + merge(0, block%count, block%free_count == block%count)
          if (stands(d%grains%kind(i))) cycle
          call drift_prescribed(d%grains, i, motion%dt, last, d%pairs%body(:, i))
          travel = larger(travel, travel_of(d, i))
        end do
      end associate
    end if
    work%travel(c) = travel
  end subroutine start_chunk

  !> Data with which a step of a chunk begins, from the grains.
  subroutine ready_chunk(d, block, state)
    type(dem_data_type), intent(in) :: d
    type(integration_block_type), intent(in) :: block
    type(block_state_type), intent(inout) :: state
    call load_side(block, d%grains, d%pairs, state)
    call load_forces(block, d%grains, state)
    call ready_state(block, d%grains, state)
  end subroutine ready_chunk

  !> Where the grains of a chunk are and how they move in a step that is half done.
  subroutine recall_chunk(d, block, state)
    type(dem_data_type), intent(in) :: d
    type(integration_block_type), intent(in) :: block
    type(block_state_type), intent(inout) :: state
    call recall_side(block, d%pairs%body, state)
    if (d%cell%active) call recall_carried(d, block, state)
  end subroutine recall_chunk

  !> Planes and surfaces.
  subroutine start_planes(d, dt, last, travel)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt
    logical, intent(in) :: last
    real(wp), intent(inout) :: travel
    integer(i4) :: i, body
    do i = 1, d%planes%n
      body = d%grains%n + 3 + i
      d%planes%point(:, i) = d%planes%point(:, i) + dt*d%planes%velocity(:, i)
      d%pairs%body(1:3, body) = d%planes%point(:, i)
      d%pairs%body(4:6, body) = d%planes%velocity(:, i)
      travel = max(travel, sqrt(sum((d%planes%point(:, i) - d%pairs%reference_x(:, body))**2)))
    end do
    if (d%surfaces%n == 0) return
    call drift_surfaces(d%surfaces, dt, last)
    travel = larger(travel, surface_travel(d%surfaces))
  end subroutine start_planes

  !> Sums and end of the step for the grains of chunk c; the last chunk is the planes'.
  subroutine finish_chunk(d, c, motion, last, work, state)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: c
    type(motion_type), intent(in) :: motion
    logical, intent(in) :: last  !! the forces are stored with the grains
    type(step_memory_type), intent(inout) :: work
    type(block_state_type), intent(inout) :: state
    integer(i4) :: k

    work%finished(:, c) = 0.0_wp
    if (c > size(work%blocks)) then
      call finish_planes(d, motion%dt, work%finished(:, c))
      call push_surfaces(d%surfaces, d%planes%velocity, motion, .false., work%finished(:, c))
      return
    end if
    if (c < size(work%blocks)) call call_chunk(d%pairs, work%blocks(c + 1))
    associate (block => work%blocks(c))
      call read_block(block, .false.)
      call recall_chunk(d, block, state)
      call sum_lanes(d%pairs%result, d%pairs%entry, d%pairs%start(block%low + 1:), block%count, &
                     state%s%x, state%f, state%m)
      if (d%cell%active) call finish_carried(d, block, motion%dt, state, work%finished(:, c))
      if (d%surfaces%list%near > 0) call add_surface_loads(d%surfaces, block%low, block%count, &
        state%f, state%m)
      do k = 1, merge(0, block%count, block%free_count == block%count)
        if (gives_way(d%grains%kind(block%low + k))) cycle
        call finish_prescribed(d%grains, block%low + k, motion%dt, state%f(k, :), state%m(k, :), &
                               work%finished(:, c))
        if (d%grains%kind(block%low + k) == kind_ghost) call note_ghost(d, block%low + k)
      end do
      if (block%free_count == 0) return
      if (last) call store_forces(block, state, d%grains)
      call ready_state(block, d%grains, state)
      call kick_block(block, state, motion, .false., work%finished(:, c))
      if (last) call store_block(block, state, d%grains)
    end associate
  end subroutine finish_chunk

  !> Call for the next chunk while this one is worked on.
  subroutine call_chunk(pairs, block)
    type(dem_pairs_type), intent(in) :: pairs
    type(integration_block_type), intent(in) :: block
    call read_block(block, .true.)
    call call_for(pairs%body(:, block%low + 1), body_size*block%count)
  end subroutine call_chunk

  !> Planes and surfaces.
  subroutine finish_planes(d, dt, work)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: force(3), moment(3), mean(3), done
    integer(i4) :: i
    do i = 1, d%planes%n
      call sum_body(d%pairs, d%grains%n + 3 + i, force, moment)
      mean = 0.5_wp*dt*(d%planes%force(:, i) + force)
      d%planes%force(:, i) = force
      d%planes%moment(:, i) = moment
      d%planes%impulse(:, i) = d%planes%impulse(:, i) + mean
      done = -dot_product(mean, d%planes%velocity(:, i))
      d%planes%work(i) = d%planes%work(i) + done
      work(4) = work(4) + done
    end do
    if (d%surfaces%n > 0) call finish_surfaces(d%surfaces, dt, work(4))
    if (d%surfaces%n > 0) call note_vertices(d%surfaces, d%exact%vertices)
    if (allocated(d%surfaces%membranes)) call finish_membranes(d%surfaces, dt, work)
    if (d%wear%active) call add_wear(d)
    if (d%heat%active) call conduct(d, dt)
  end subroutine finish_planes
end module dem_chunks
