!> Both halves of a step of clumps, after those of the grains: forces on members add up to those on
!! their clumps, which move as grains do and take their members with them.
!!
!! Chunks of clumps follow those of grains and planes in the sums of works and travels. A thread
!! works whole chunks, and within them all is in the order of members.
module dem_clump_steps
  use talus_kinds, only: wp, i4, i8
  use dem_carry, only: slow_down, sum_images, lead
  use dem_clumps, only: place_members, move_members, add_load
  use dem_feature_pairs, only: meets_planes
  use dem_images, only: place_image
  use dem_integrate, only: motion_type, kick_block, drift_block, work_count
  use dem_integration_block, only: integration_block_type, block_state_type, load_block, &
    load_side, load_forces, ready_state, store_block, put_bodies
  use dem_lanes, only: sum_lanes
  use dem_relist, only: larger
  use dem_state, only: dem_data_type, lanes
  use dem_step_work, only: step_memory_type
  use dem_surface_forces, only: surface_load
  implicit none
  private
  public :: pass_clumps, sum_clumps

contains

  !> This thread's clumps: the end of a step, the start of the next one, or both. All threads of the
  !! region are here; they wait for the chunks of grains, some of which have members among others.
  subroutine pass_clumps(d, motion, halves, work, me, threads)
    type(dem_data_type), intent(inout) :: d
    type(motion_type), intent(in) :: motion
    logical, intent(in) :: halves(2)  !! the end, the start
    type(step_memory_type), intent(inout) :: work
    integer(i4), intent(in) :: me, threads
    integer(i4) :: chunks, c, slot, low, count

    if (d%clumps%n == 0) return
    !$omp barrier
    chunks = (d%clumps%n + lanes - 1)/lanes
    do c = 1 + int(int(chunks, i8)*me/threads, i4), int(int(chunks, i8)*(me + 1)/threads, i4)
      slot = size(work%load, kind=i4) + c
      low = (c - 1)*lanes
      count = min(lanes, d%clumps%n - low)
      if (halves(1)) then
        work%finished(:, slot) = 0.0_wp
        call finish_clumps(d, low, count, motion, work%finished(:, slot))
      end if
      if (.not. halves(2)) cycle
      work%started(:, slot) = 0.0_wp
      call start_clumps(d, low, count, motion, work%started(:, slot), work%travel(slot))
    end do
  end subroutine pass_clumps

  !> Explicit half kick and drift of the clumps low + 1 .. low + count.
  subroutine start_clumps(d, low, count, motion, work, travel)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: low, count
    type(motion_type), intent(in) :: motion
    real(wp), intent(inout) :: work(work_count)
    real(wp), intent(out) :: travel  !! since the list was made [m]
    type(integration_block_type) :: block
    type(block_state_type) :: state
    real(wp) :: u(3, lanes)
    integer(i4) :: k

    call load_clumps(d, low, count, block, state)
    u = 0.0_wp
    if (d%cell%active) then
      do k = 1, count
        u(:, k) = matmul(d%cell%step, state%s%x(k, :) - d%cell%origin)
      end do
    end if
    call kick_block(block, state, motion, .true., work)
    if (d%cell%active) then
      do k = 1, count
        state%s%x(k, :) = state%s%x(k, :) + u(:, k)
        work(4) = work(4) - 0.5_wp*dot_product(state%f(k, :), u(:, k))
      end do
    end if
    call drift_block(block, state, motion%dt)
    call store_block(block, state, d%clumps%grains)
    call put_bodies(block, state, d%clumps%pairs%body, d%clumps%grains%shapes)
    travel = 0.0_wp
    do k = 1, count
      if (d%cell%active) then
        call slow_down(d%cell%back, motion%mass_scale*block%mass(k), &
                       [state%s%vx(k), state%s%vy(k), state%s%vz(k)], &
                       d%clumps%grains%v(:, low + k), work)
        d%clumps%pairs%body(4:6, low + k) = d%clumps%pairs%body(4:6, low + k) + u(:, k)/motion%dt
      end if
      call place_members(d%clumps, d%grains, d%pairs%body, low + k)
      call follow_members(d, low + k, motion%dt, work, travel)
    end do
    if (d%cell%active) travel = travel + d%cell%stretch
  end subroutine start_clumps

  !> Images of the members of a clump, and how far the members have come since the list was made.
  subroutine follow_members(d, clump, dt, work, travel)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: clump
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: work(work_count), travel
    real(wp) :: x0(3)
    integer(i4) :: i, k

    do i = d%clumps%first(clump), d%clumps%last(clump)
      if (.not. meets_planes(d%pairs, i)) exit  ! edges and faces go no further than vertices
      x0 = d%pairs%reference_x(:, i)
      if (d%cell%active) x0 = d%cell%origin + matmul(d%cell%deform, x0 - d%cell%origin)
      travel = larger(travel, norm2(d%grains%x(:, i) - x0))
    end do
    do i = d%clumps%first(clump), d%clumps%last(clump)
      if (d%pairs%images == 0) cycle
      do k = d%pairs%image_start(i), d%pairs%image_start(i + 1) - 1
        call place_image(d%pairs, d%cell, k)
      end do
      work(4) = work(4) - 0.5_wp*dt*images_power(d, i)
    end do
  end subroutine follow_members

  !> New forces, and the implicit half kick.
  subroutine finish_clumps(d, low, count, motion, work)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: low, count
    type(motion_type), intent(in) :: motion
    real(wp), intent(inout) :: work(work_count)
    type(integration_block_type) :: block
    type(block_state_type) :: state
    integer(i4) :: k

    do k = low + 1, low + count
      call sum_members(d, k, motion%dt, work)
      call add_load(d%clumps, d%grains, k)
      if (d%cell%active) work(4) = work(4) - 0.5_wp*motion%dt*dot_product( &
        d%clumps%grains%force(:, k), d%clumps%pairs%body(4:6, k) - d%clumps%grains%v(:, k))
    end do
    call load_clumps(d, low, count, block, state)
    call kick_block(block, state, motion, .false., work)
    call store_block(block, state, d%clumps%grains)
    do k = low + 1, low + count
      call move_members(d%clumps, d%grains, k)
    end do
  end subroutine finish_clumps

  !> Forces and moments on the members of a clump about their own centres.
  subroutine sum_members(d, clump, dt, work)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: clump
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: x(lanes, 3), force(lanes, 3), moment(lanes, 3), load(6)
    integer(i4) :: first, count, k, i

    do first = d%clumps%first(clump), d%clumps%last(clump), lanes
      count = min(lanes, d%clumps%last(clump) - first + 1)
      x = 0.0_wp
      x(:count, :) = transpose(d%grains%x(:, first:first + count - 1))
      call sum_lanes(d%pairs%result, d%pairs%entry, d%pairs%start(first:), count, x, force, moment)
      do k = 1, count
        i = first + k - 1
        d%grains%force(:, i) = force(k, :)
        d%grains%moment(:, i) = moment(k, :)
        if (d%cell%active) call sum_images(d, i, d%grains%force(:, i), d%grains%moment(:, i))
        if (d%pairs%images > 0) work(4) = work(4) - 0.5_wp*dt*images_power(d, i)
        if (d%surfaces%list%near == 0) cycle
        load = surface_load(d%surfaces, i)
        d%grains%force(:, i) = d%grains%force(:, i) + load(:3)
        d%grains%moment(:, i) = d%grains%moment(:, i) + load(4:)
      end do
    end do
  end subroutine sum_members

  !> Power of the flow on the images of grain i, against their forces [W].
  pure real(wp) function images_power(d, i) result(power)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    integer(i4) :: k
    power = 0.0_wp
    do k = d%pairs%image_start(i), d%pairs%image_start(i + 1) - 1
      power = power + dot_product(d%pairs%image_force(:, k), lead(d, k))
    end do
  end function images_power

  !> A block of clumps as they are now.
  subroutine load_clumps(d, low, count, block, state)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: low, count
    type(integration_block_type), intent(out) :: block
    type(block_state_type), intent(out) :: state
    call load_block(d%clumps%grains, d%clumps%pairs, low, count, block)
    call load_side(block, d%clumps%grains, d%clumps%pairs, state)
    call load_forces(block, d%clumps%grains, state)
    call ready_state(block, d%clumps%grains, state)
  end subroutine load_clumps

  !> Loads of all clumps from those of their members.
  pure subroutine sum_clumps(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: k
    do k = 1, d%clumps%n
      call add_load(d%clumps, d%grains, k)
    end do
  end subroutine sum_clumps
end module dem_clump_steps
