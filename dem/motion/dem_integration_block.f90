!> Grains in lanes: what a step leaves to the next, what it takes for its length, and how far they
!! have gone since the list was made.
module dem_integration_block
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_grains_type, dem_pairs_type, kind_free, lanes, body_size
  use dem_block, only: dem_side_type
  use dem_shape_state, only: dem_forms_type, form_ellipsoid, put_frames
  use dem_lanes, only: call_for, read_in_order, put_side, put_motion, take_side, take_motion
  use dem_orientation, only: rotations, shapes
  implicit none
  private
  public :: mover_type, push_type, load_mover, store_mover, load_forces, store_forces, load_side
  public :: recall_side, ready_push, read_mover, put_bodies, travel_of_mover, follow_travel

  !> Consecutive grains, one short array a quantity; lanes that are not free stand still. Centres,
  !! velocities, spins and shapes are in the body records, from where a push takes them. Nothing has
  !! a value before load_mover: each thread is the first to touch its own.
  type :: mover_type
    integer(i4) :: low, count            !! grains low+1 .. low+count
    integer(i4) :: free_count            !! of these, free
    logical :: round                     !! all are spheres
    logical :: pushed                    !! some have extra forces or moments
    logical :: eased                     !! some have more margin than half the skin
    real(wp) :: travel                   !! since the list was made, or more [m]
    real(wp) :: arm                      !! greatest reach, see dem_pairs_type [m]
    real(wp) :: free(lanes)              !! 1 for free grains, else 0
    real(wp) :: q(lanes, 4), theta(lanes, 3), mass(lanes)
    real(wp) :: inertia(lanes, 3), square(lanes, 3)
    real(wp) :: ease(lanes)              !! see dem_margin; read where some are below 1
  end type mover_type

  !> What is needed of a mover for the length of a half step: it stays in the cache.
  type :: push_type
    type(dem_side_type) :: s                !! centres, velocities, spins, shape matrices
    real(wp) :: f(lanes, 3), m(lanes, 3)    !! contact force and moment of the free lanes
    real(wp) :: ef(lanes, 3), em(lanes, 3)  !! extra force and moment
    real(wp) :: r(lanes, 9)                 !! rotation, body to space, by columns
    real(wp) :: turned(lanes)               !! by the last drift: change of the quaternion, squared
    real(wp) :: light(lanes), agile(lanes, 3)  !! 1/mass [1/kg], 1/inertia [1/(kg m^2)]
  end type push_type

contains

  !> Grains low+1 .. low+count into lanes; the other lanes are made harmless.
  pure subroutine load_mover(g, pairs, low, count, b)
    type(dem_grains_type), intent(in) :: g
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: low, count
    type(mover_type), intent(inout) :: b
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
    if (g%forms%n > 0) call bound_forms(g, b)
    b%free_count = nint(sum(b%free))
    b%arm = maxval(pairs%reach(low + 1:low + count))
    b%round = .not. b%arm > 0.0_wp
    b%travel = huge(b%travel)
    b%ease(:count) = pairs%ease(low + 1:low + count)
    b%ease(count + 1:) = 1.0_wp
    b%eased = any(b%ease < 1.0_wp)
    b%pushed = any(abs(g%extra_force(:, low + 1:low + count)) > 0.0_wp) &
               .or. any(abs(g%extra_moment(:, low + 1:low + count)) > 0.0_wp)
  end subroutine load_mover

  !> Forms stand in the body records as their bounding spheres.
  pure subroutine bound_forms(g, b)
    type(dem_grains_type), intent(in) :: g
    type(mover_type), intent(inout) :: b
    integer(i4) :: k
    do k = 1, b%count
      if (g%forms%kind(b%low + k) /= form_ellipsoid) b%square(k, :) = g%radius(b%low + k)**2
    end do
  end subroutine bound_forms

  !> Centres of a mover's grains, velocities and spins of the free ones, and shapes.
  pure subroutine load_side(b, g, pairs, push)
    type(mover_type), intent(in) :: b
    type(dem_grains_type), intent(in) :: g
    type(dem_pairs_type), intent(in) :: pairs  !! bodies
    type(push_type), intent(inout) :: push
    real(wp) :: r(lanes, 9)
    integer(i4) :: k, i

    push%s%x = 0.0_wp
    push%s%volume = 1.0_wp
    do k = 1, b%count
      i = b%low + k
      push%s%x(k, :) = g%x(:, i)
      push%s%volume(k) = pairs%body(body_size, i)
      push%s%vx(k) = g%v(1, i)
      push%s%vy(k) = g%v(2, i)
      push%s%vz(k) = g%v(3, i)
      push%s%wx(k) = g%omega(1, i)
      push%s%wy(k) = g%omega(2, i)
      push%s%wz(k) = g%omega(3, i)
    end do
    call stop_others(b%free, push%s)
    call rotations(b%q, r)
    call shapes(b%square, r, b%round, push%s%s)
  end subroutine load_side

  !> Lanes that are not free stand still.
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
  !! changes in them. Lanes that are not free stand still.
  pure subroutine recall_side(b, body, push)
    type(mover_type), intent(in) :: b
    real(wp), intent(in), contiguous :: body(:, :)
    type(push_type), intent(inout) :: push
    if (b%round) then
      call take_motion(body(:, b%low + 1:b%low + b%count), b%count, push%s)
    else
      call take_side(body(:, b%low + 1:b%low + b%count), b%count, push%s)
    end if
    if (b%free_count < lanes) call stop_others(b%free, push%s)
  end subroutine recall_side

  !> Bring a mover into the cache, now or soon; spheres have no use of what follows their one moment
  !! of inertia.
  subroutine read_mover(b, soon)
    type(mover_type), intent(in) :: b
    logical, intent(in) :: soon
    integer(i4) :: reals
    reals = merge(10, 15, b%round)*lanes
    if (soon) then
      call call_for(b%free, reals)
    else
      call read_in_order(b%free, reals)
    end if
  end subroutine read_mover

  !> Contact forces and moments of the free grains as they stand with the grains.
  pure subroutine load_forces(b, g, push)
    type(mover_type), intent(in) :: b
    type(dem_grains_type), intent(in) :: g
    type(push_type), intent(inout) :: push
    integer(i4) :: k
    push%f = 0.0_wp
    push%m = 0.0_wp
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      push%f(k, :) = g%force(:, b%low + k)
      push%m(k, :) = g%moment(:, b%low + k)
    end do
  end subroutine load_forces

  !> The same back.
  pure subroutine store_forces(b, push, g)
    type(mover_type), intent(in) :: b
    type(push_type), intent(in) :: push
    type(dem_grains_type), intent(inout) :: g
    integer(i4) :: k
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      g%force(:, b%low + k) = push%f(k, :)
      g%moment(:, b%low + k) = push%m(k, :)
    end do
  end subroutine store_forces

  !> Extra forces, and rotations for the current orientations: what a kick and a drift need.
  pure subroutine ready_push(b, g, push)
    type(mover_type), intent(in) :: b
    type(dem_grains_type), intent(in) :: g
    type(push_type), intent(inout) :: push
    integer(i4) :: k
    push%ef = 0.0_wp
    push%em = 0.0_wp
    push%light = 1.0_wp/b%mass
    push%agile(:, 1) = 1.0_wp/b%inertia(:, 1)
    if (.not. b%round) then
      push%agile(:, 2:) = 1.0_wp/b%inertia(:, 2:)
      call rotations(b%q, push%r)
    end if
    if (.not. b%pushed) return
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      push%ef(k, :) = g%extra_force(:, b%low + k)
      push%em(k, :) = g%extra_moment(:, b%low + k)
    end do
  end subroutine ready_push

  !> All lanes as spheres of unit mass that are not free.
  pure subroutine idle(b)
    type(mover_type), intent(inout) :: b
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
  pure real(wp) function travel_of_mover(b, push, x0, q0, reach) result(most)
    type(mover_type), intent(in) :: b
    type(push_type), intent(in) :: push
    real(wp), intent(in), contiguous :: x0(:, :), q0(:, :)  !! (:, grains) then [m], [-]
    real(wp), intent(in) :: reach(:)                        !! (grains) of that difference [m]
    real(wp) :: square(lanes), cosine, sine, travel(lanes)
    integer(i4) :: k

    square = 0.0_wp
    travel = 0.0_wp
    do k = 1, b%count
      square(k) = b%free(k)*((push%s%x(k, 1) - x0(1, k))**2 + (push%s%x(k, 2) - x0(2, k))**2 &
                             + (push%s%x(k, 3) - x0(3, k))**2)*b%ease(k)**2
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
  end function travel_of_mover

  !> Bring a mover's travel up to date after a drift of dt: by what its fastest lane did in it, or,
  !! if that is wanted or comes up to the limit, to what it is. So most steps need not read where
  !! the list was made.
  pure subroutine follow_travel(b, push, pairs, dt, exact)
    type(mover_type), intent(inout) :: b
    type(push_type), intent(in) :: push
    type(dem_pairs_type), intent(in) :: pairs  !! the limit is half the skin
    real(wp), intent(in) :: dt                 !! [s]
    logical, intent(in) :: exact               !! wanted
    real(wp) :: square(lanes), turned(lanes), most
    integer(i4) :: k

    if (.not. exact) then
      !$omp simd
      do k = 1, lanes
        square(k) = push%s%vx(k)**2 + push%s%vy(k)**2 + push%s%vz(k)**2
      end do
      if (b%eased) square = square*b%ease**2
      most = dt*sqrt(maxval(square))
      ! a radian adds at most 1.32 reach to the travel, and half a radian to the quaternion
      if (.not. b%round) then
        turned = push%turned
        if (b%eased) turned = turned*b%ease**2
        most = most + 2.7_wp*b%arm*sqrt(maxval(turned))
      end if
      b%travel = b%travel + most
      if (all(square <= huge(most)) .and. b%travel <= 0.5_wp*pairs%skin) return
    end if
    associate (low => b%low + 1, high => b%low + b%count)
      b%travel = travel_of_mover(b, push, pairs%reference_x(:, low:high), &
                                 pairs%reference_q(:, low:high), pairs%reach(low:high))
    end associate
  end subroutine follow_travel

  !> Free lanes back to the grains.
  pure subroutine store_mover(b, push, g)
    type(mover_type), intent(in) :: b
    type(push_type), intent(in) :: push
    type(dem_grains_type), intent(inout) :: g
    integer(i4) :: k, i

    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      i = b%low + k
      g%x(:, i) = [push%s%x(k, 1), push%s%x(k, 2), push%s%x(k, 3)]
      g%v(:, i) = [push%s%vx(k), push%s%vy(k), push%s%vz(k)]
      g%omega(:, i) = [push%s%wx(k), push%s%wy(k), push%s%wz(k)]
      g%theta(:, i) = b%theta(k, :)
      g%quat(:, i) = b%q(k, :)
    end do
  end subroutine store_mover

  !> Body records of all lanes, of spheres what changes in them; those of prescribed grains are put
  !! right by their own motion.
  pure subroutine put_bodies(b, push, body, forms)
    type(mover_type), intent(in) :: b
    type(push_type), intent(in) :: push
    real(wp), intent(inout), contiguous :: body(:, :)
    type(dem_forms_type), intent(inout) :: forms
    if (b%round) then
      call put_motion(push%s, b%count, body(:, b%low + 1:b%low + b%count))
    else
      call put_side(push%s, b%count, body(:, b%low + 1:b%low + b%count))
    end if
    call put_frames(forms, b%low, b%count, b%q)
  end subroutine put_bodies
end module dem_integration_block
