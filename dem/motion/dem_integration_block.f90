!> Integration blocks: grains in lanes, with what one step hands to the next, their work arrays, and
!! their travel since the list was made.
module dem_integration_block
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_grains_type, dem_pairs_type, kind_free, lanes, body_size
  use dem_block, only: dem_side_type
  use dem_shape_state, only: dem_shapes_type, shape_ellipsoid, put_frames
  use dem_lanes, only: call_for, read_in_order, put_side, put_motion, take_side, take_motion
  use dem_orientation, only: rotations, shape_matrices
  implicit none
  private
  public :: integration_block_type, block_state_type, load_block, store_block, load_forces, &
    store_forces, load_side
  public :: recall_side, ready_state, read_block, put_bodies, travel_of_block, follow_travel

  !> Consecutive grains, one short array a quantity; lanes of prescribed grains are not moved.
  !! Centres, velocities, spins and shapes are in the body records, from which a block is loaded.
  !! Nothing has a value before load_block, so that each thread is the first to touch its own.
  type :: integration_block_type
    integer(i4) :: low, count            !! grains low+1 .. low+count
    integer(i4) :: free_count            !! of these, free
    logical :: round                     !! all are spheres
    logical :: pushed                    !! some have extra forces or moments
    logical :: eased                     !! some have more margin than half the skin
    real(wp) :: travel                   !! since the list was made, or more [m]
    real(wp) :: arm                      !! greatest reach, see dem_pairs_type [m]
    real(wp) :: filler(3)                !! none: lanes begin on a line of the cache
    real(wp) :: free(lanes)              !! 1 for free grains, else 0
    real(wp) :: q(lanes, 4), theta(lanes, 3), mass(lanes)
    real(wp) :: inertia(lanes, 3), square(lanes, 3)
    real(wp) :: ease(lanes)              !! see dem_margin; read where some are below 1
  end type integration_block_type

  !> Work arrays of a block during a half step: they stay in the cache.
  type :: block_state_type
    type(dem_side_type) :: s                !! centres, velocities, spins, shape matrices
    real(wp) :: f(lanes, 3), m(lanes, 3)    !! contact force and moment of the free lanes
    real(wp) :: ef(lanes, 3), em(lanes, 3)  !! extra force and moment
    real(wp) :: r(lanes, 9)                 !! rotation, body to space, by columns
    real(wp) :: turned(lanes)               !! by the last drift: change of the quaternion, squared
    real(wp) :: inverse_mass(lanes), inverse_inertia(lanes, 3)  !! 1/mass [1/kg], 1/inertia [1/(kg
                                                                !! m^2)]
  end type block_state_type

contains

  !> Grains low+1 .. low+count into lanes; the other lanes are made harmless.
  pure subroutine load_block(g, pairs, low, count, b)
    type(dem_grains_type), intent(in) :: g
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: low, count
    type(integration_block_type), intent(inout) :: b
    integer(i4) :: k, i, c

    b%low = low
    b%count = count
    call idle(b)
    do k = 1, count
      i = low + k
      b%mass(k) = g%mass(i)
      do c = 1, 4
        b%q(k, c) = g%quat(c, i)
      end do
      do c = 1, 3
        b%theta(k, c) = g%theta(c, i)
        b%inertia(k, c) = g%inertia(c, i)
        b%square(k, c) = g%axes(c, i)*g%axes(c, i)
      end do
      if (g%kind(i) == kind_free) b%free(k) = 1.0_wp
    end do
    if (g%shapes%in_use) call bound_shapes(g, b)
    b%free_count = nint(sum(b%free))
    b%arm = maxval(pairs%reach(low + 1:low + count))
    b%round = .not. b%arm > 0.0_wp
    b%travel = huge(b%travel)
    b%ease(:count) = pairs%ease(low + 1:low + count)
    b%ease(count + 1:) = 1.0_wp
    b%eased = any(b%ease < 1.0_wp)
    b%pushed = any(abs(g%extra_force(:, low + 1:low + count)) > 0.0_wp) &
               .or. any(abs(g%extra_moment(:, low + 1:low + count)) > 0.0_wp)
  end subroutine load_block

  !> Shapes are in the body records as their bounding spheres.
  pure subroutine bound_shapes(g, b)
    type(dem_grains_type), intent(in) :: g
    type(integration_block_type), intent(inout) :: b
    integer(i4) :: k
    do k = 1, b%count
      if (g%shapes%kind(b%low + k) /= shape_ellipsoid) b%square(k, :) = g%radius(b%low + k)**2
    end do
  end subroutine bound_shapes

  !> Centres of a block's grains, velocities and spins of the free ones, and shapes.
  pure subroutine load_side(b, g, pairs, state)
    type(integration_block_type), intent(in) :: b
    type(dem_grains_type), intent(in) :: g
    type(dem_pairs_type), intent(in) :: pairs  !! bodies
    type(block_state_type), intent(inout) :: state
    real(wp) :: r(lanes, 9)
    integer(i4) :: k, i

    state%s%x = 0.0_wp
    state%s%volume = 1.0_wp
    do k = 1, b%count
      i = b%low + k
      state%s%x(k, :) = g%x(:, i)
      state%s%volume(k) = pairs%body(body_size, i)
      state%s%vx(k) = g%v(1, i)
      state%s%vy(k) = g%v(2, i)
      state%s%vz(k) = g%v(3, i)
      state%s%wx(k) = g%omega(1, i)
      state%s%wy(k) = g%omega(2, i)
      state%s%wz(k) = g%omega(3, i)
    end do
    call stop_others(b%free, state%s)
    call rotations(b%q, r)
    call shape_matrices(b%square, r, b%round, state%s%s)
  end subroutine load_side

  !> Lanes of prescribed grains are not moved.
  pure subroutine stop_others(free, s)
    real(wp), intent(in) :: free(lanes)
    type(dem_side_type), intent(inout) :: s
    where (.not. free > 0.5_wp)
      s%vx = 0.0_wp
      s%vy = 0.0_wp
      s%vz = 0.0_wp
      s%wx = 0.0_wp
      s%wy = 0.0_wp
      s%wz = 0.0_wp
    end where
  end subroutine stop_others

  !> What put_bodies left in the records: of spheres centres, velocities and spins, as nothing else
  !! changes in them. Lanes of prescribed grains are not moved.
  pure subroutine recall_side(b, body, state)
    type(integration_block_type), intent(in) :: b
    real(wp), intent(in), contiguous :: body(:, :)
    type(block_state_type), intent(inout) :: state
    if (b%round) then
      call take_motion(body(:, b%low + 1:b%low + b%count), b%count, state%s)
    else
      call take_side(body(:, b%low + 1:b%low + b%count), b%count, state%s)
    end if
    if (b%free_count < lanes) call stop_others(b%free, state%s)
  end subroutine recall_side

  !> Bring a block into the cache, now or soon; spheres have no use of what follows their one moment
  !! of inertia.
  subroutine read_block(b, soon)
    type(integration_block_type), intent(in) :: b
    logical, intent(in) :: soon
    integer(i4) :: reals
    reals = merge(10, 15, b%round)*lanes
    if (soon) then
      call call_for(b%free, reals)
    else
      call read_in_order(b%free, reals)
    end if
  end subroutine read_block

  !> Contact forces and moments of the free grains from the grains.
  pure subroutine load_forces(b, g, state)
    type(integration_block_type), intent(in) :: b
    type(dem_grains_type), intent(in) :: g
    type(block_state_type), intent(inout) :: state
    integer(i4) :: k
    state%f = 0.0_wp
    state%m = 0.0_wp
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      state%f(k, :) = g%force(:, b%low + k)
      state%m(k, :) = g%moment(:, b%low + k)
    end do
  end subroutine load_forces

  !> The same back.
  pure subroutine store_forces(b, state, g)
    type(integration_block_type), intent(in) :: b
    type(block_state_type), intent(in) :: state
    type(dem_grains_type), intent(inout) :: g
    integer(i4) :: k
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      g%force(:, b%low + k) = state%f(k, :)
      g%moment(:, b%low + k) = state%m(k, :)
    end do
  end subroutine store_forces

  !> Extra forces, and rotations for the current orientations: what a kick and a drift need.
  pure subroutine ready_state(b, g, state)
    type(integration_block_type), intent(in) :: b
    type(dem_grains_type), intent(in) :: g
    type(block_state_type), intent(inout) :: state
    integer(i4) :: k
    state%ef = 0.0_wp
    state%em = 0.0_wp
    state%inverse_mass = 1.0_wp/b%mass
    state%inverse_inertia(:, 1) = 1.0_wp/b%inertia(:, 1)
    if (.not. b%round) then
      state%inverse_inertia(:, 2:) = 1.0_wp/b%inertia(:, 2:)
      call rotations(b%q, state%r)
    end if
    if (.not. b%pushed) return
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      state%ef(k, :) = g%extra_force(:, b%low + k)
      state%em(k, :) = g%extra_moment(:, b%low + k)
    end do
  end subroutine ready_state

  !> All lanes as spheres of unit mass that are not free.
  pure subroutine idle(b)
    type(integration_block_type), intent(inout) :: b
    b%free = 0.0_wp
    b%q = 0.0_wp
    b%q(:, 1) = 1.0_wp
    b%theta = 0.0_wp
    b%mass = 1.0_wp
    b%inertia = 1.0_wp
    b%square = 1.0_wp
  end subroutine idle

  !> Largest travel of the surfaces of the free lanes, along any normal, since the list was made:
  !! displacement, and rotation times the difference of the extreme semi-axes, in their own margins
  !! (dem_margin) [m].
  pure real(wp) function travel_of_block(b, state, x0, q0, reach) result(most)
    type(integration_block_type), intent(in) :: b
    type(block_state_type), intent(in) :: state
    real(wp), intent(in), contiguous :: x0(:, :), q0(:, :)  !! (:, grains) then [m], [-]
    real(wp), intent(in) :: reach(:)                        !! (grains) of that difference [m]
    real(wp) :: square(lanes), cosine, sine, travel(lanes)
    integer(i4) :: k

    square = 0.0_wp
    travel = 0.0_wp
    do k = 1, b%count
      square(k) = b%free(k)*((state%s%x(k, 1) - x0(1, k))**2 + (state%s%x(k, 2) - x0(2, k))**2 &
                             + (state%s%x(k, 3) - x0(3, k))**2)*b%ease(k)**2
    end do
    if (b%round) then
      most = sqrt(maxval(square))
      if (.not. all(square <= huge(most))) most = huge(most)
      return
    end if
    do k = 1, b%count
      cosine = b%q(k, 1)*q0(1, k) + b%q(k, 2)*q0(2, k) + b%q(k, 3)*q0(3, k) + b%q(k, 4)*q0(4, k)
      sine = sqrt(max(1.0_wp - cosine*cosine, 0.0_wp))
      ! asin(s) <= s + (pi/2 - 1) s^3
      travel(k) = sqrt(square(k)) &
                  + b%free(k)*b%ease(k)*2.0_wp*reach(k)*sine*(1.0_wp + 0.571_wp*sine*sine)
    end do
    most = maxval(travel)
    if (.not. all(travel <= huge(most))) most = huge(most)
  end function travel_of_block

  !> Bring a block's travel up to date after a drift of dt: by what its fastest lane did in it, or,
  !! if requested or near the limit, exactly. So most steps need not read the positions at which the
  !! list was made.
  pure subroutine follow_travel(b, state, pairs, dt, exact)
    type(integration_block_type), intent(inout) :: b
    type(block_state_type), intent(in) :: state
    type(dem_pairs_type), intent(in) :: pairs  !! the limit is half the skin
    real(wp), intent(in) :: dt                 !! [s]
    logical, intent(in) :: exact               !! wanted
    real(wp) :: square(lanes), turned(lanes), most
    integer(i4) :: k

    if (.not. exact) then
      !$omp simd
      do k = 1, lanes
        square(k) = state%s%vx(k)**2 + state%s%vy(k)**2 + state%s%vz(k)**2
      end do
      if (b%eased) square = square*b%ease**2
      most = dt*sqrt(maxval(square))
      ! a radian adds at most 1.32 reach to the travel, and half a radian to the quaternion
      if (.not. b%round) then
        turned = state%turned
        if (b%eased) turned = turned*b%ease**2
        most = most + 2.7_wp*b%arm*sqrt(maxval(turned))
      end if
      b%travel = b%travel + most
      if (all(square <= huge(most)) .and. b%travel <= 0.5_wp*pairs%skin) return
    end if
    associate (low => b%low + 1, high => b%low + b%count)
      b%travel = travel_of_block(b, state, pairs%reference_x(:, low:high), &
                                 pairs%reference_q(:, low:high), pairs%reach(low:high))
    end associate
  end subroutine follow_travel

  !> Free lanes back to the grains.
  pure subroutine store_block(b, state, g)
    type(integration_block_type), intent(in) :: b
    type(block_state_type), intent(in) :: state
    type(dem_grains_type), intent(inout) :: g
    integer(i4) :: k, i

    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      i = b%low + k
      g%x(:, i) = [state%s%x(k, 1), state%s%x(k, 2), state%s%x(k, 3)]
      g%v(:, i) = [state%s%vx(k), state%s%vy(k), state%s%vz(k)]
      g%omega(:, i) = [state%s%wx(k), state%s%wy(k), state%s%wz(k)]
      g%theta(:, i) = b%theta(k, :)
      g%quat(:, i) = b%q(k, :)
    end do
  end subroutine store_block

  !> Body records of all lanes, of spheres what changes in them; those of prescribed grains are put
  !! right by their own motion.
  pure subroutine put_bodies(b, state, body, shapes)
    type(integration_block_type), intent(in) :: b
    type(block_state_type), intent(in) :: state
    real(wp), intent(inout), contiguous :: body(:, :)
    type(dem_shapes_type), intent(inout) :: shapes
    if (b%round) then
      call put_motion(state%s, b%count, body(:, b%low + 1:b%low + b%count))
    else
      call put_side(state%s, b%count, body(:, b%low + 1:b%low + b%count))
    end if
    call put_frames(shapes, b%low, b%count, b%q)
  end subroutine put_bodies
end module dem_integration_block
