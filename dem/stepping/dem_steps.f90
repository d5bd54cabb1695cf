!> Time stepping: one parallel region for many steps, two barriers a step (three on ranks).
!!
!! A step is (1) half kick and drift of every grain, (2) forces of every block, (3) sums and second
!! half kick; (3) and the next (1) go together, chunk by chunk, without a barrier between them. A
!! thread owns a run of grains, whose motion stays in its blocks as long as the region lasts, and a
!! run of the blocks of each group: as grains and blocks both follow the ids, most bodies of its
!! blocks are its own. Work is added to the ledger by one thread in a fixed order, so that the
!! thread count changes no bit. The region is left when the list must be rebuilt. On ranks the first
!! thread sends the bodies at the borders before (2) and takes those of others before the blocks
!! that need them, which come last.
module dem_steps
  use, intrinsic :: omp_lib, only: omp_get_thread_num, omp_get_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_state, only: dem_data_type, dem_pairs_type, kind_free, kind_fixed, kind_ghost, &
    kind_mirror, kind_member
  use dem_carry, only: sum_images
  use dem_cell, only: advance_cell
  use dem_lost, only: all_finite, name_lost_grain, name_stray
  use dem_bonds_make, only: check_bonds
  use dem_clump_steps, only: pass_clumps, sum_clumps
  use dem_depth, only: watch_depth, note_block
  use dem_forces, only: block_forces, sum_body
  use dem_lanes, only: finish_puts
  use dem_integrate, only: motion_type, motion_of, kick_block, drift_block, work_count
  use dem_integration_block, only: integration_block_type, block_state_type, load_block, &
    store_block, load_forces, load_side, ready_state, put_bodies
  use dem_relist, only: rebuild_list, fit_skin, outlived
  use dem_passages, only: name_passage
  use dem_prescribed, only: drift_prescribed, finish_prescribed
  use dem_ellipsoid, only: quaternion_from_rotation
  use dem_exact_forces, only: begin_exact, find_places, settle_exact
  use dem_membrane_forces, only: share_near
  use dem_surface_forces, only: surface_load
  use dem_wear, only: make_wear_room, wear_block, wear_near
  use dem_swap, only: agree_travel, begin_swap, end_swap, add_loads
  use dem_chunks, only: set_turns, start_chunk, recall_chunk, finish_chunk, start_planes, &
    finish_planes
  use dem_step_work, only: step_memory_type, plan_work, settle_work, share_chunks, &
    add_grain_work, add_contact_work, chunk
  implicit none
  private
  public :: step_memory_type, take_steps, evaluate_forces, kick_and_drift

  integer(i8), parameter :: look = 32      !! steps after which a chunk's travel is computed exactly

contains

  !> Take n steps of par%dt; grains with targets reach them at the last one.
  subroutine take_steps(d, work, n, errors)
    type(dem_data_type), intent(inout) :: d
    type(step_memory_type), intent(inout) :: work
    integer(i4), intent(in) :: n
    type(error_list_type), intent(inout) :: errors
    type(motion_type) :: motion
    real(wp) :: travel(1)
    integer(i4) :: done
    logical :: rebuild, resumed

    motion = motion_of(d, d%par%dt)
    call watch_depth(d, .true.)
    call plan_work(d, work)
    call set_turns(d)
    call begin_exact(d)
    done = 0
    resumed = .false.
    do while (done < n)
      call make_wear_room(d)
      call run_region(d, motion, n, done, resumed, rebuild, work)
      if (.not. rebuild) exit
      if (.not. all_finite(d)) then
        call name_lost_grain(d, errors)
        return
      end if
      call fit_skin(d, errors)
      if (errors%any()) return
      travel = maxval(work%travel)
      if (d%halo%team%several()) then
        call settle_work(d, work, done > 0)
        travel = max(travel, 2.0_wp*d%halo%before)  ! late if steps were taken beyond half the skin
        call d%halo%team%most(travel)
      end if
      if (allocated(work%blocks)) deallocate (work%blocks)  ! most memory is in use at a rebuild
      call rebuild_list(d, travel(1), d%par%dt)
      call name_passage(d, errors)
      call watch_depth(d, .false.)
      if (d%pairs%additional%active) call check_bonds(d, errors)
      if (errors%any()) return
      resumed = .true.
      if (d%halo%team%several()) call name_stray(d, errors)
      if (d%halo%strayed) return
      call find_places(d, d%grains%kind(:d%grains%n) == kind_ghost)
      call plan_work(d, work)
    end do
    if (n > 0) call settle_exact(d, d%par%dt)
    if (n > 0) call add_grain_work(d, work%finished)
    d%grains%has_target = .false.
    if (.not. all_finite(d)) call name_lost_grain(d, errors)
  end subroutine take_steps

  !> Steps done+1 to n, or until the list is used up (then half of step done+1 is done).
  subroutine run_region(d, motion, n, done, resumed, rebuild, work)
    type(dem_data_type), intent(inout) :: d
    type(motion_type), intent(in) :: motion
    integer(i4), intent(in) :: n
    integer(i4), intent(inout) :: done
    logical, intent(in) :: resumed         !! step done+1 was begun before
    logical, intent(out) :: rebuild
    type(step_memory_type), intent(inout) :: work
    integer(i4) :: s, c, me, threads, low, high
    integer(i4) :: swaps  !! steps with an exchange so far
    logical :: begun, leave, several, exact
    integer(i8) :: before
    real(wp) :: travel, foreseen
    type(block_state_type), allocatable :: states(:)  !! of each thread, on lines of the cache

    before = d%health%steps - done
    several = d%halo%team%several()
    rebuild = .false.
    if (d%cell%active .and. .not. resumed) call advance_cell(d%cell, motion%dt)
    allocate (states(0:omp_get_max_threads() - 1))
    !$omp parallel default(none) private(s, c, begun, leave, me, threads, low, high, travel) &
    !$omp   private(swaps, foreseen, exact) shared(d, motion, n, done, resumed, rebuild, work) &
    !$omp   shared(several, before, states)
    me = omp_get_thread_num()
    threads = omp_get_num_threads()
    call share_chunks(work%load, me, threads, low, high)
    call load_chunks(d, low, high, work)
    if (.not. resumed) then
      do c = low, high
        call start_chunk(d, c, motion, done + 1 == n, .true., work, states(me), .true.)
      end do
      call pass_clumps(d, motion, [.false., .true.], work, me, threads)
    end if
    begun = resumed
    leave = .false.
    travel = 0.0_wp
    foreseen = 0.0_wp
    swaps = 0
    do s = done + 1, n
      if (.not. begun) then
        !$omp barrier
        travel = maxval(work%travel)
        leave = .not. all(work%travel <= 0.5_wp*d%pairs%skin) .or. outlived(d, before + s)
        if (several) then
          if (swaps < 2) then  ! no prediction yet
            call agree_travel(d, work%travel)
            foreseen = d%halo%most
          end if
          leave = .not. foreseen <= 0.5_wp*d%pairs%skin .or. outlived(d, before + s)
        end if
        if (leave) exit
      end if
      !$omp master
      if (several .and. .not. begun) call begin_swap(d, work%travel)
      if (s > 1) call add_grain_work(d, work%finished)
      call add_grain_work(d, work%started)
      if (d%cell%active .and. s < n .and. .not. several) call advance_cell(d%cell, motion%dt)
      !$omp end master
      call share_forces(d, motion%dt, travel, .false., me, threads)
      if (several) then
        !$omp master
        if (.not. begun) call end_swap(d)
        if (d%cell%active .and. s < n) call advance_cell(d%cell, motion%dt)
        !$omp end master
        !$omp barrier
        if (.not. begun) then
          foreseen = d%halo%foreseen
          travel = d%halo%travel
          swaps = swaps + 1
        end if
        call share_forces(d, motion%dt, travel, .true., me, threads)
      end if
      begun = .false.
      !$omp barrier
      call add_loads(d)
      !$omp master
      call add_contact_work(d)
      !$omp end master
      do c = low, high
        call finish_chunk(d, c, motion, s == n, work, states(me))
        exact = several .or. mod(before + s + c, look) == 0
        if (s < n) call start_chunk(d, c, motion, s + 1 == n, exact, work, states(me), .false.)
      end do
      call pass_clumps(d, motion, [.true., s < n], work, me, threads)
    end do
    do c = low, merge(min(high, size(work%blocks)), 0, leave)
      call recall_chunk(d, work%blocks(c), states(me))
      call store_block(work%blocks(c), states(me), d%grains)
    end do
    !$omp barrier
    !$omp master
    rebuild = leave
    d%health%steps = d%health%steps + s - 1 - done
    done = s - 1
    !$omp end master
    !$omp end parallel
  end subroutine run_region

  !> Integration blocks of the chunks of a thread.
  subroutine load_chunks(d, low, high, work)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: low, high
    type(step_memory_type), intent(inout) :: work
    integer(i4) :: c
    do c = low, min(high, size(work%blocks))
      call load_block(d%grains, d%pairs, (c - 1)*chunk, min(chunk, d%grains%n - (c - 1)*chunk), &
                      work%blocks(c))
    end do
  end subroutine load_chunks

  !> Forces of this thread's run of the blocks of each group: those at the border, which other ranks
  !! have too, or all others.
  subroutine share_forces(d, h, travel, border, me, threads)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: h       !! time since the last evaluation [s]
    real(wp), intent(in) :: travel  !! since the list was made [m]
    logical, intent(in) :: border
    integer(i4), intent(in) :: me, threads
    integer(i4) :: g, k, base, length
    logical :: deep
    base = 0
    do g = 1, d%pairs%groups
      length = d%pairs%group_end(g) - base
      if (at_border(d%pairs, d%pairs%group_end(g)) .neqv. border) length = 0
      do k = base + 1 + int(int(length, i8)*me/threads, i4), &
             base + int(int(length, i8)*(me + 1)/threads, i4)
        call block_forces(d%pairs, d%laws, d%grains%shapes, k, h, travel, deep)
        if (deep) call note_block(d, k)
        if (d%wear%active .and. k > d%pairs%grain_blocks) call wear_block(d, k, h)
      end do
      base = d%pairs%group_end(g)
    end do
    if (d%surfaces%list%near > 0 .and. .not. border) call share_near(d, h, travel, me, threads)
    if (d%wear%active .and. .not. border) call wear_near(d, h, me, threads)
    if (d%pairs%past > 0) call finish_puts()
  end subroutine share_forces

  !> Is a block one of pairs with other ranks' grains?
  pure logical function at_border(pairs, k)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: k
    at_border = .false.
    if (allocated(pairs%share)) at_border = pairs%share(k) < 1.0_wp
  end function at_border

  !> Kick over `kick`, then drift over `drift` of everything that moves [s]; zero leaves one out. No
  !! forces. After a drift targets are reached.
  subroutine kick_and_drift(d, kick, drift)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: kick, drift
    type(motion_type) :: motion
    type(integration_block_type) :: block
    type(block_state_type) :: state
    real(wp) :: work(work_count, 1), travel
    integer(i4) :: low, many

    motion = motion_of(d, kick)
    work = 0.0_wp
    do low = 0, d%grains%n - 1, chunk
      many = min(chunk, d%grains%n - low)
      if (.not. any(d%grains%kind(low + 1:low + many) == kind_free)) cycle
      call load_block(d%grains, d%pairs, low, many, block)
      call load_side(block, d%grains, d%pairs, state)
      if (kick > 0.0_wp) call load_forces(block, d%grains, state)
      call ready_state(block, d%grains, state)
      if (kick > 0.0_wp) then
        call kick_block(block, state, motion, .false., work(:, 1))
        call kick_block(block, state, motion, .true., work(:, 1))
      end if
      if (drift > 0.0_wp) call drift_block(block, state, drift)
      call store_block(block, state, d%grains)
      if (drift > 0.0_wp) call put_bodies(block, state, d%pairs%body, d%grains%shapes)
    end do
    if (kick > 0.0_wp) call add_grain_work(d, work)
    if (.not. drift > 0.0_wp) return
    call drift_all_prescribed(d, drift)
    travel = 0.0_wp
    call start_planes(d, drift, .true., travel)
  end subroutine kick_and_drift

  !> Prescribed grains over the last step of their way; ghosts stay where the partner puts them when
  !! forces are evaluated in parts.
  subroutine drift_all_prescribed(d, dt)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt
    integer(i4) :: i
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_free .or. d%grains%kind(i) == kind_fixed) cycle
      if (d%parts%active .and. d%grains%kind(i) == kind_ghost) cycle
      d%grains%turn(:, i) = quaternion_from_rotation(dt*d%grains%omega(:, i))
      call drift_prescribed(d%grains, i, dt, .true., d%pairs%body(:, i))
      d%grains%has_target(i) = .false.
    end do
  end subroutine drift_all_prescribed

  !> Forces at the current state over the pending drift h; sums go to the grains and planes.
  subroutine evaluate_forces(d, h)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: h
    real(wp) :: work(work_count, 1), force(3), moment(3), load(6)
    integer(i4) :: i
    call make_wear_room(d)
    !$omp parallel default(none) shared(d, h)
    call share_forces(d, h, huge(h), .false., omp_get_thread_num(), omp_get_num_threads())
    call share_forces(d, h, huge(h), .true., omp_get_thread_num(), omp_get_num_threads())
    !$omp end parallel
    work = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_mirror) cycle
      call sum_body(d%pairs, i, force, moment)
      call sum_images(d, i, force, moment)
      if (d%surfaces%list%near > 0) then
        load = surface_load(d%surfaces, i)
        force = force + load(1:3)
        moment = moment + load(4:6)
      end if
      if (d%grains%kind(i) == kind_free .or. d%grains%kind(i) == kind_member) then
        d%grains%force(:, i) = force
        d%grains%moment(:, i) = moment
      else
        call finish_prescribed(d%grains, i, h, force, moment, work(:, 1))
      end if
    end do
    call sum_clumps(d)
    call finish_planes(d, h, work(:, 1))
    call add_contact_work(d)
    call add_grain_work(d, work)
  end subroutine evaluate_forces
end module dem_steps
