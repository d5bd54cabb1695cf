!> Motion of blocks: half kicks and drifts of free grains, and the work.
!!
!! A step is an explicit half kick, a drift, forces, an implicit half kick; together
!! v+ = [(2 - a dt) v- + 2 F dt/(s m)]/(2 + a dt), x+ = x + v+ dt, and v is known at the times of x.
!! Rotation: symmetric splitting of the free rigid body into five turns about body axes
!! (Dullweber, Leimkuhler & McLachlan 1997) in Cayley form, so that |L| is kept without sine or
!! cosine. Work of a half kick: half a step with its forces and the velocity between two kicks,
!! which is what the kinetic energy m v-.v+/2 of the leapfrog gains.
!! eqs. D.1 and D.2
module dem_integrate
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_data_type, mode_relaxation, lanes
  use dem_block, only: dem_side_type
  use dem_integration_block, only: integration_block_type, block_state_type
  use dem_orientation, only: rotations, shape_matrices
  implicit none
  private
  public :: motion_type, motion_of, kick_block, drift_block, scaled_spin_momentum, work_count

  integer(i4), parameter :: work_count = 4  !! gravity, external, background damping, boundary

  !> Constants of a step.
  type :: motion_type
    real(wp) :: dt = 0.0_wp             !! [s]
    real(wp) :: damping = 0.0_wp        !! a [1/s]
    real(wp) :: mass_scale = 1.0_wp     !! [-]
    real(wp) :: inertia_scale = 1.0_wp  !! [-]
    real(wp) :: gravity(3) = 0.0_wp     !! scaled already [m/s^2]
  end type motion_type

  !> Constants of a half kick: v <- (keep v + half/(scale m) F) kicked.
  type :: kick_type
    real(wp) :: half = 0.0_wp     !! half a step [s]
    real(wp) :: keep = 1.0_wp     !! [-]
    real(wp) :: kicked = 1.0_wp   !! [-]
    real(wp) :: mix = 0.0_wp      !! 1: explicit, 0: implicit
    real(wp) :: scale = 1.0_wp    !! of mass or inertia [-]
    real(wp) :: pull = 0.0_wp     !! this component of gravity [m/s^2]
    real(wp) :: damping = 0.0_wp  !! a [1/s]
  end type kick_type

contains

  !> Constants of a step of length dt.
  pure function motion_of(d, dt) result(motion)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: dt
    type(motion_type) :: motion
    motion%dt = dt
    motion%damping = d%par%damping
    if (d%par%full_damping .and. d%par%dt > 0.0_wp) motion%damping = 2.0_wp/d%par%dt
    if (d%par%mode == mode_relaxation) then
      motion%mass_scale = d%par%mass_scale
      motion%inertia_scale = d%par%inertia_scale
    end if
    motion%gravity = d%par%gravity_scale*d%par%gravity
  end function motion_of

  !> Half kick of all lanes with the current forces: explicit before a drift, implicit after one.
  pure subroutine kick_block(b, state, step, explicit, work)
    type(integration_block_type), intent(in) :: b
    type(block_state_type), intent(inout) :: state
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(inout) :: work(work_count)
    type(kick_type) :: kick
    real(wp) :: tally(lanes, 3)

    tally = 0.0_wp
    kick%half = 0.5_wp*step%dt
    kick%damping = step%damping
    if (explicit) then
      kick%keep = 1.0_wp - 0.5_wp*step%damping*step%dt
      kick%mix = 1.0_wp
    else
      kick%kicked = 1.0_wp/(1.0_wp + 0.5_wp*step%damping*step%dt)
    end if
    kick%scale = step%mass_scale
    kick%pull = step%gravity(1)
    call kick_lanes(kick, b%mass, state%inverse_mass, b%free, state%f(:, 1), state%ef(:, 1), &
      state%s%vx, tally)
    kick%pull = step%gravity(2)
    call kick_lanes(kick, b%mass, state%inverse_mass, b%free, state%f(:, 2), state%ef(:, 2), &
      state%s%vy, tally)
    kick%pull = step%gravity(3)
    call kick_lanes(kick, b%mass, state%inverse_mass, b%free, state%f(:, 3), state%ef(:, 3), &
      state%s%vz, tally)
    kick%scale = step%inertia_scale
    kick%pull = 0.0_wp
    if (.not. b%round) then
      call kick_spins(b, state, kick, tally)
    else
      call kick_lanes(kick, b%inertia(:, 1), state%inverse_inertia(:, 1), b%free, state%m(:, 1), &
                      state%em(:, 1), state%s%wx, tally)
      call kick_lanes(kick, b%inertia(:, 1), state%inverse_inertia(:, 1), b%free, state%m(:, 2), &
                      state%em(:, 2), state%s%wy, tally)
      call kick_lanes(kick, b%inertia(:, 1), state%inverse_inertia(:, 1), b%free, state%m(:, 3), &
                      state%em(:, 3), state%s%wz, tally)
    end if
    call add_tally(tally, kick, work)
  end subroutine kick_block

  !> Works of all lanes into the chunk's sums.
  pure subroutine add_tally(tally, kick, work)
    real(wp), intent(in) :: tally(lanes, 3)
    type(kick_type), intent(in) :: kick
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: gravity, external, damping
    integer(i4) :: k
    gravity = 0.0_wp
    external = 0.0_wp
    damping = 0.0_wp
    !$omp simd reduction(+: gravity, external, damping)
    do k = 1, lanes
      gravity = gravity + tally(k, 1)
      external = external + tally(k, 2)
      damping = damping + tally(k, 3)
    end do
    work(1) = work(1) + kick%half*gravity
    work(2) = work(2) + kick%half*external
    work(3) = work(3) + kick%half*kick%damping*damping
  end subroutine add_tally

  !> One component of the velocities, or of the spins of spheres.
  pure subroutine kick_lanes(kick, mass, inverse_mass, free, load, extra, v, tally)
    type(kick_type), intent(in) :: kick
    real(wp), intent(in) :: mass(lanes), inverse_mass(lanes)  !! mass or inertia, not scaled;
                                                              !! inverse
    real(wp), intent(in) :: free(lanes)
    real(wp), intent(in) :: load(lanes), extra(lanes)  !! force or moment
    real(wp), intent(inout) :: v(lanes)
    real(wp), intent(inout) :: tally(lanes, 3)         !! works/half: gravity, extra, damping
    real(wp) :: old, new, between, now, weight, scaled, rate
    integer(i4) :: k

    rate = kick%half/kick%scale
    !$omp simd private(scaled, old, new, between, now, weight)
    do k = 1, lanes
      scaled = kick%scale*mass(k)
      weight = mass(k)*kick%pull
      old = v(k)
      new = free(k)*(old*kick%keep + rate*inverse_mass(k)*(load(k) + weight + extra(k)))*kick%kicked
      between = kick%mix*new + (1.0_wp - kick%mix)*old
      now = kick%mix*old + (1.0_wp - kick%mix)*new
      tally(k, 1) = tally(k, 1) + weight*between
      tally(k, 2) = tally(k, 2) + extra(k)*between
      tally(k, 3) = tally(k, 3) + scaled*now*between
      v(k) = new
    end do
  end subroutine kick_lanes

  !> Spins of kick_block, in the body frame.
  pure subroutine kick_spins(b, state, kick, tally)
    type(integration_block_type), intent(in) :: b
    type(block_state_type), intent(inout) :: state
    type(kick_type), intent(in) :: kick
    real(wp), intent(inout) :: tally(lanes, 3)
    real(wp) :: inertia, old, new, between, now, moment, extra, rate
    real(wp) :: sx, sy, sz, rx, ry, rz
    integer(i4) :: k, c

    rate = kick%half/kick%scale
    !$omp simd private(inertia, old, new, between, now, moment, extra, sx, sy, sz, rx, ry, rz, c)
    do k = 1, lanes
      sx = 0.0_wp
      sy = 0.0_wp
      sz = 0.0_wp
      do c = 1, 3
        rx = state%r(k, 3*c - 2)
        ry = state%r(k, 3*c - 1)
        rz = state%r(k, 3*c)
        inertia = kick%scale*b%inertia(k, c)
        old = rx*state%s%wx(k) + ry*state%s%wy(k) + rz*state%s%wz(k)
        moment = rx*state%m(k, 1) + ry*state%m(k, 2) + rz*state%m(k, 3)
        extra = rx*state%em(k, 1) + ry*state%em(k, 2) + rz*state%em(k, 3)
        new = b%free(k)*(old*kick%keep + rate*state%inverse_inertia(k, c)*(moment &
          + extra))*kick%kicked
        between = kick%mix*new + (1.0_wp - kick%mix)*old
        now = kick%mix*old + (1.0_wp - kick%mix)*new
        tally(k, 2) = tally(k, 2) + extra*between
        tally(k, 3) = tally(k, 3) + inertia*now*between
        sx = sx + rx*new
        sy = sy + ry*new
        sz = sz + rz*new
      end do
      state%s%wx(k) = sx
      state%s%wy(k) = sy
      state%s%wz(k) = sz
    end do
  end subroutine kick_spins

  !> Drift of all lanes by dt: centres, orientations, spins, accumulated rotations, shapes.
  pure subroutine drift_block(b, state, dt)
    type(integration_block_type), intent(inout) :: b
    type(block_state_type), intent(inout) :: state
    real(wp), intent(in) :: dt
    integer(i4) :: k

    !$omp simd
    do k = 1, lanes
      state%s%x(k, 1) = state%s%x(k, 1) + dt*state%s%vx(k)
      state%s%x(k, 2) = state%s%x(k, 2) + dt*state%s%vy(k)
      state%s%x(k, 3) = state%s%x(k, 3) + dt*state%s%vz(k)
    end do
    if (b%round) then
      call turn_round(b, state, dt)
    else
      call turn_bodies(b, state, dt)
      call rotations(b%q, state%r)
      call spins_to_space(state%r, state%s)
      call shape_matrices(b%square, state%r, .false., state%s%s)
    end if
    !$omp simd
    do k = 1, lanes
      b%theta(k, 1) = b%theta(k, 1) + dt*state%s%wx(k)
      b%theta(k, 2) = b%theta(k, 2) + dt*state%s%wy(k)
      b%theta(k, 3) = b%theta(k, 3) + dt*state%s%wz(k)
    end do
  end subroutine drift_block

  !> Orientations of spheres: their spin stays, the turn has its Cayley angle.
  pure subroutine turn_round(b, state, dt)
    type(integration_block_type), intent(inout) :: b
    type(block_state_type), intent(in) :: state
    real(wp), intent(in) :: dt
    real(wp) :: hx, hy, hz, q1, q2, q3, q4, p1, p2, p3, p4, scale
    integer(i4) :: k

    !$omp simd private(hx, hy, hz, q1, q2, q3, q4, p1, p2, p3, p4, scale)
    do k = 1, lanes
      hx = 0.5_wp*dt*state%s%wx(k)
      hy = 0.5_wp*dt*state%s%wy(k)
      hz = 0.5_wp*dt*state%s%wz(k)
      q1 = b%q(k, 1)
      q2 = b%q(k, 2)
      q3 = b%q(k, 3)
      q4 = b%q(k, 4)
      p1 = q1 - hx*q2 - hy*q3 - hz*q4
      p2 = q2 + hx*q1 + hy*q4 - hz*q3
      p3 = q3 + hy*q1 + hz*q2 - hx*q4
      p4 = q4 + hz*q1 + hx*q3 - hy*q2
      scale = 1.0_wp/sqrt(p1*p1 + p2*p2 + p3*p3 + p4*p4)
      b%q(k, 1) = merge(scale*p1, b%q(k, 1), b%free(k) > 0.5_wp)
      b%q(k, 2) = merge(scale*p2, b%q(k, 2), b%free(k) > 0.5_wp)
      b%q(k, 3) = merge(scale*p3, b%q(k, 3), b%free(k) > 0.5_wp)
      b%q(k, 4) = merge(scale*p4, b%q(k, 4), b%free(k) > 0.5_wp)
    end do
  end subroutine turn_round

  !> Free rotation of all lanes by dt; spins are left in the body frame.
  pure subroutine turn_bodies(b, state, dt)
    type(integration_block_type), intent(inout) :: b
    type(block_state_type), intent(inout) :: state
    real(wp), intent(in) :: dt
    real(wp) :: l1, l2, l3, q1, q2, q3, q4, i1, i2, i3, scale
    integer(i4) :: k

    !$omp simd private(l1, l2, l3, q1, q2, q3, q4, i1, i2, i3, scale)
    do k = 1, lanes
      q1 = state%s%wx(k)
      q2 = state%s%wy(k)
      q3 = state%s%wz(k)
      l1 = b%inertia(k, 1)*(state%r(k, 1)*q1 + state%r(k, 2)*q2 + state%r(k, 3)*q3)
      l2 = b%inertia(k, 2)*(state%r(k, 4)*q1 + state%r(k, 5)*q2 + state%r(k, 6)*q3)
      l3 = b%inertia(k, 3)*(state%r(k, 7)*q1 + state%r(k, 8)*q2 + state%r(k, 9)*q3)
      i1 = dt*state%inverse_inertia(k, 1)
      i2 = dt*state%inverse_inertia(k, 2)
      i3 = dt*state%inverse_inertia(k, 3)
      q1 = b%q(k, 1)
      q2 = b%q(k, 2)
      q3 = b%q(k, 3)
      q4 = b%q(k, 4)
      call turn(0.25_wp*i1, l1, l2, l3, q1, q2, q3, q4)
      call turn(0.25_wp*i2, l2, l3, l1, q1, q3, q4, q2)
      call turn(0.5_wp*i3, l3, l1, l2, q1, q4, q2, q3)
      call turn(0.25_wp*i2, l2, l3, l1, q1, q3, q4, q2)
      call turn(0.25_wp*i1, l1, l2, l3, q1, q2, q3, q4)
      scale = 1.0_wp/sqrt(q1*q1 + q2*q2 + q3*q3 + q4*q4)
      state%turned(k) = b%free(k)*((scale*q1 - b%q(k, 1))**2 + (scale*q2 - b%q(k, 2))**2 &
                                  + (scale*q3 - b%q(k, 3))**2 + (scale*q4 - b%q(k, 4))**2)
      b%q(k, 1) = merge(scale*q1, b%q(k, 1), b%free(k) > 0.5_wp)
      b%q(k, 2) = merge(scale*q2, b%q(k, 2), b%free(k) > 0.5_wp)
      b%q(k, 3) = merge(scale*q3, b%q(k, 3), b%free(k) > 0.5_wp)
      b%q(k, 4) = merge(scale*q4, b%q(k, 4), b%free(k) > 0.5_wp)
      state%s%wx(k) = l1*state%inverse_inertia(k, 1)
      state%s%wy(k) = l2*state%inverse_inertia(k, 2)
      state%s%wz(k) = l3*state%inverse_inertia(k, 3)
    end do
  end subroutine turn_bodies

  !> Turn about a body axis by the Cayley angle 2 atan(t), t = factor * momentum about it: momentum
  !! in the body frame, quaternion not normalised.
  pure subroutine turn(factor, la, lb, lc, q, qa, qb, qc)
    real(wp), intent(in) :: factor, la
    real(wp), intent(inout) :: lb, lc, q, qa, qb, qc
    real(wp) :: t, sine, cosine, old
    t = factor*la
    sine = 1.0_wp/(1.0_wp + t*t)
    cosine = (1.0_wp - t*t)*sine
    sine = 2.0_wp*t*sine
    old = lb
    lb = cosine*old + sine*lc
    lc = cosine*lc - sine*old
    old = q
    q = old - t*qa
    qa = qa + t*old
    old = qb
    qb = old + t*qc
    qc = qc - t*old
  end subroutine turn

  !> Spins from the body frame to space.
  pure subroutine spins_to_space(r, s)
    real(wp), intent(in) :: r(lanes, 9)
    type(dem_side_type), intent(inout) :: s
    real(wp) :: s1, s2, s3
    integer(i4) :: k
    !$omp simd private(s1, s2, s3)
    do k = 1, lanes
      s1 = s%wx(k)
      s2 = s%wy(k)
      s3 = s%wz(k)
      s%wx(k) = r(k, 1)*s1 + r(k, 4)*s2 + r(k, 7)*s3
      s%wy(k) = r(k, 2)*s1 + r(k, 5)*s2 + r(k, 8)*s3
      s%wz(k) = r(k, 3)*s1 + r(k, 6)*s2 + r(k, 9)*s3
    end do
  end subroutine spins_to_space

  !> Spin angular momentum in space [kg m^2/s].
  pure function scaled_spin_momentum(r, inertia, omega) result(l)
    real(wp), intent(in) :: r(3, 3)     !! rotation, body to space
    real(wp), intent(in) :: inertia(3)  !! principal moments [kg m^2]
    real(wp), intent(in) :: omega(3)    !! spin in space [rad/s]
    real(wp) :: l(3)
    l = matmul(r, inertia*matmul(omega, r))
  end function scaled_spin_momentum
end module dem_integrate
