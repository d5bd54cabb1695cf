!> Motion of grains, 64 at a time: half kicks and drifts of free grains, and the work done.
!!
!! A step is an explicit half kick, a drift, forces, an implicit half kick; together
!! v+ = [(2 - a dt) v- + 2 F dt/(s m)]/(2 + a dt), x+ = x + v+ dt, and v is known at the times of x.
!! Rotation: symmetric splitting of the free rigid body into five turns about body axes
!! (Dullweber, Leimkuhler & McLachlan 1997) in Cayley form, so that |L| is kept without sine or
!! cosine. Work of a half kick: half a step with its forces and the velocity between two kicks,
!! which is what the kinetic energy m v-.v+/2 of the leapfrog gains.
module dem_integrate
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_grains_type, kind_free, lanes
  implicit none
  private
  public :: motion_type, mover_type, load_mover, kick_mover, drift_mover, store_mover
  public :: put_bodies, scaled_spin_momentum, work_count

  integer(i4), parameter :: work_count = 4  !! gravity, external, background damping, boundary

  !> Constants of a step.
  type :: motion_type
    real(wp) :: dt = 0.0_wp             !! [s]
    real(wp) :: damping = 0.0_wp        !! a [1/s]
    real(wp) :: mass_scale = 1.0_wp     !! [-]
    real(wp) :: inertia_scale = 1.0_wp  !! [-]
    real(wp) :: gravity(3) = 0.0_wp     !! scaled already [m/s^2]
  end type motion_type

  !> Up to 64 grains, one short array a quantity; lanes that are not free are carried idle.
  type :: mover_type
    integer(i4) :: low = 0, count = 0    !! grains low+1 .. low+count
    real(wp) :: free(lanes)              !! 1 for free grains, else 0
    real(wp) :: x(lanes, 3), v(lanes, 3), w(lanes, 3), q(lanes, 4)
    real(wp) :: f(lanes, 3), m(lanes, 3), ef(lanes, 3), em(lanes, 3)
    real(wp) :: mass(lanes), inertia(lanes, 3), square(lanes, 3), theta(lanes, 3)
    real(wp) :: r(lanes, 9)              !! rotation, body to space, by columns
    real(wp) :: a(lanes, 6)              !! shape matrix
  end type mover_type

contains

  !> Grains low+1 .. low+count into lanes; the other lanes are made harmless.
  pure subroutine load_mover(g, low, count, b)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: low, count
    type(mover_type), intent(inout) :: b
    integer(i4) :: k, i, c

    b%low = low
    b%count = count
    do k = 1, count
      i = low + k
      b%free(k) = merge(1.0_wp, 0.0_wp, g%kind(i) == kind_free)
      b%mass(k) = g%mass(i)
      b%q(k, 1) = g%quat(1, i)
      b%q(k, 2) = g%quat(2, i)
      b%q(k, 3) = g%quat(3, i)
      b%q(k, 4) = g%quat(4, i)
      do c = 1, 3
        b%x(k, c) = g%x(c, i)
        b%v(k, c) = g%v(c, i)
        b%w(k, c) = g%omega(c, i)
        b%f(k, c) = g%force(c, i)
        b%m(k, c) = g%moment(c, i)
        b%ef(k, c) = g%extra_force(c, i)
        b%em(k, c) = g%extra_moment(c, i)
        b%inertia(k, c) = g%inertia(c, i)
        b%square(k, c) = g%axes(c, i)*g%axes(c, i)
        b%theta(k, c) = g%theta(c, i)
      end do
    end do
    do k = count + 1, lanes
      b%free(k) = 0.0_wp
      b%mass(k) = 1.0_wp
      b%q(k, :) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      b%x(k, :) = 0.0_wp
      b%v(k, :) = 0.0_wp
      b%w(k, :) = 0.0_wp
      b%f(k, :) = 0.0_wp
      b%m(k, :) = 0.0_wp
      b%ef(k, :) = 0.0_wp
      b%em(k, :) = 0.0_wp
      b%inertia(k, :) = 1.0_wp
      b%square(k, :) = 1.0_wp
      b%theta(k, :) = 0.0_wp
    end do
    call rotations(b)
  end subroutine load_mover

  !> Rotation matrices of all lanes.
  pure subroutine rotations(b)
    type(mover_type), intent(inout) :: b
    integer(i4) :: k
    real(wp) :: w, x, y, z
    !$omp simd private(w, x, y, z)
    do k = 1, lanes
      w = b%q(k, 1)
      x = b%q(k, 2)
      y = b%q(k, 3)
      z = b%q(k, 4)
      b%r(k, 1) = 1.0_wp - 2.0_wp*(y*y + z*z)
      b%r(k, 2) = 2.0_wp*(x*y + w*z)
      b%r(k, 3) = 2.0_wp*(x*z - w*y)
      b%r(k, 4) = 2.0_wp*(x*y - w*z)
      b%r(k, 5) = 1.0_wp - 2.0_wp*(x*x + z*z)
      b%r(k, 6) = 2.0_wp*(y*z + w*x)
      b%r(k, 7) = 2.0_wp*(x*z + w*y)
      b%r(k, 8) = 2.0_wp*(y*z - w*x)
      b%r(k, 9) = 1.0_wp - 2.0_wp*(x*x + y*y)
    end do
  end subroutine rotations

  !> Half kick of all lanes with the forces in hand: explicit before a drift, implicit after one.
  pure subroutine kick_mover(b, step, explicit, work)
    type(mover_type), intent(inout) :: b
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: keep, kicked

    keep = 1.0_wp
    kicked = 1.0_wp
    if (explicit) keep = 1.0_wp - 0.5_wp*step%damping*step%dt
    if (.not. explicit) kicked = 1.0_wp/(1.0_wp + 0.5_wp*step%damping*step%dt)
    call kick_centres(b, step, explicit, keep, kicked, work)
    call kick_spins(b, step, explicit, keep, kicked, work)
  end subroutine kick_mover

  !> Translation of kick_mover.
  pure subroutine kick_centres(b, step, explicit, keep, kicked, work)
    type(mover_type), intent(inout) :: b
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(in) :: keep, kicked
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: half, rate, old, new, between, now, push, mass
    real(wp) :: gravity, external, damping, mix
    integer(i4) :: k, c

    half = 0.5_wp*step%dt
    gravity = 0.0_wp
    external = 0.0_wp
    damping = 0.0_wp
    mix = merge(1.0_wp, 0.0_wp, explicit)
    do c = 1, 3
      !$omp simd private(mass, rate, old, new, between, now, push) &
      !$omp   reduction(+: gravity, external, damping)
      do k = 1, lanes
        mass = step%mass_scale*b%mass(k)
        rate = half/mass
        push = b%mass(k)*step%gravity(c)
        old = b%v(k, c)
        new = (old*keep + rate*(b%f(k, c) + push + b%ef(k, c)))*kicked
        between = mix*new + (1.0_wp - mix)*old
        now = mix*old + (1.0_wp - mix)*new
        gravity = gravity + b%free(k)*push*between
        external = external + b%free(k)*b%ef(k, c)*between
        damping = damping + b%free(k)*mass*now*between
        b%v(k, c) = new
      end do
    end do
    work(1) = work(1) + half*gravity
    work(2) = work(2) + half*external
    work(3) = work(3) + half*step%damping*damping
  end subroutine kick_centres

  !> Rotation of kick_mover, in the body frame.
  pure subroutine kick_spins(b, step, explicit, keep, kicked, work)
    type(mover_type), intent(inout) :: b
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(in) :: keep, kicked
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: half, inertia, old, new, between, now, moment, extra, external, damping, mix
    real(wp) :: sx, sy, sz, rx, ry, rz
    integer(i4) :: k, c

    half = 0.5_wp*step%dt
    external = 0.0_wp
    damping = 0.0_wp
    mix = merge(1.0_wp, 0.0_wp, explicit)
    !$omp simd private(inertia, old, new, between, now, moment, extra, sx, sy, sz, rx, ry, rz, c) &
    !$omp   reduction(+: external, damping)
    do k = 1, lanes
      sx = 0.0_wp
      sy = 0.0_wp
      sz = 0.0_wp
      do c = 1, 3
        rx = b%r(k, 3*c - 2)
        ry = b%r(k, 3*c - 1)
        rz = b%r(k, 3*c)
        inertia = step%inertia_scale*b%inertia(k, c)
        old = rx*b%w(k, 1) + ry*b%w(k, 2) + rz*b%w(k, 3)
        moment = rx*b%m(k, 1) + ry*b%m(k, 2) + rz*b%m(k, 3)
        extra = rx*b%em(k, 1) + ry*b%em(k, 2) + rz*b%em(k, 3)
        new = (old*keep + half*(moment + extra)/inertia)*kicked
        between = mix*new + (1.0_wp - mix)*old
        now = mix*old + (1.0_wp - mix)*new
        external = external + b%free(k)*extra*between
        damping = damping + b%free(k)*inertia*now*between
        sx = sx + rx*new
        sy = sy + ry*new
        sz = sz + rz*new
      end do
      b%w(k, 1) = sx
      b%w(k, 2) = sy
      b%w(k, 3) = sz
    end do
    work(2) = work(2) + half*external
    work(3) = work(3) + half*step%damping*damping
  end subroutine kick_spins

  !> Drift of all lanes by dt: centres, orientations, spins, accumulated rotations, shapes.
  pure subroutine drift_mover(b, dt)
    type(mover_type), intent(inout) :: b
    real(wp), intent(in) :: dt
    real(wp) :: l1, l2, l3, q1, q2, q3, q4, i1, i2, i3, scale
    integer(i4) :: k

    b%x = b%x + dt*b%v
    !$omp simd private(l1, l2, l3, q1, q2, q3, q4, i1, i2, i3, scale)
    do k = 1, lanes
      l1 = b%inertia(k, 1)*(b%r(k, 1)*b%w(k, 1) + b%r(k, 2)*b%w(k, 2) + b%r(k, 3)*b%w(k, 3))
      l2 = b%inertia(k, 2)*(b%r(k, 4)*b%w(k, 1) + b%r(k, 5)*b%w(k, 2) + b%r(k, 6)*b%w(k, 3))
      l3 = b%inertia(k, 3)*(b%r(k, 7)*b%w(k, 1) + b%r(k, 8)*b%w(k, 2) + b%r(k, 9)*b%w(k, 3))
      i1 = dt/b%inertia(k, 1)
      i2 = dt/b%inertia(k, 2)
      i3 = dt/b%inertia(k, 3)
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
      b%q(k, 1) = scale*q1
      b%q(k, 2) = scale*q2
      b%q(k, 3) = scale*q3
      b%q(k, 4) = scale*q4
      b%w(k, 1) = l1/b%inertia(k, 1)
      b%w(k, 2) = l2/b%inertia(k, 2)
      b%w(k, 3) = l3/b%inertia(k, 3)
    end do
    call rotations(b)
    call spins_to_space(b, dt)
    call shapes(b)
  end subroutine drift_mover

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

  !> Spins from the body frame to space, and into the accumulated rotation.
  pure subroutine spins_to_space(b, dt)
    type(mover_type), intent(inout) :: b
    real(wp), intent(in) :: dt
    real(wp) :: s1, s2, s3
    integer(i4) :: k
    !$omp simd private(s1, s2, s3)
    do k = 1, lanes
      s1 = b%w(k, 1)
      s2 = b%w(k, 2)
      s3 = b%w(k, 3)
      b%w(k, 1) = b%r(k, 1)*s1 + b%r(k, 4)*s2 + b%r(k, 7)*s3
      b%w(k, 2) = b%r(k, 2)*s1 + b%r(k, 5)*s2 + b%r(k, 8)*s3
      b%w(k, 3) = b%r(k, 3)*s1 + b%r(k, 6)*s2 + b%r(k, 9)*s3
      b%theta(k, 1) = b%theta(k, 1) + dt*b%w(k, 1)
      b%theta(k, 2) = b%theta(k, 2) + dt*b%w(k, 2)
      b%theta(k, 3) = b%theta(k, 3) + dt*b%w(k, 3)
    end do
  end subroutine spins_to_space

  !> Shape matrices of all lanes.
  pure subroutine shapes(b)
    type(mover_type), intent(inout) :: b
    real(wp) :: s1, s2, s3
    integer(i4) :: k
    !$omp simd private(s1, s2, s3)
    do k = 1, lanes
      s1 = b%square(k, 1)
      s2 = b%square(k, 2)
      s3 = b%square(k, 3)
      b%a(k, 1) = s1*b%r(k, 1)*b%r(k, 1) + s2*b%r(k, 4)*b%r(k, 4) + s3*b%r(k, 7)*b%r(k, 7)
      b%a(k, 2) = s1*b%r(k, 2)*b%r(k, 2) + s2*b%r(k, 5)*b%r(k, 5) + s3*b%r(k, 8)*b%r(k, 8)
      b%a(k, 3) = s1*b%r(k, 3)*b%r(k, 3) + s2*b%r(k, 6)*b%r(k, 6) + s3*b%r(k, 9)*b%r(k, 9)
      b%a(k, 4) = s1*b%r(k, 1)*b%r(k, 2) + s2*b%r(k, 4)*b%r(k, 5) + s3*b%r(k, 7)*b%r(k, 8)
      b%a(k, 5) = s1*b%r(k, 2)*b%r(k, 3) + s2*b%r(k, 5)*b%r(k, 6) + s3*b%r(k, 8)*b%r(k, 9)
      b%a(k, 6) = s1*b%r(k, 3)*b%r(k, 1) + s2*b%r(k, 6)*b%r(k, 4) + s3*b%r(k, 9)*b%r(k, 7)
    end do
  end subroutine shapes

  !> Free lanes back to the grains: velocities, and after a drift the positions too.
  pure subroutine store_mover(b, moved, g)
    type(mover_type), intent(in) :: b
    logical, intent(in) :: moved
    type(dem_grains_type), intent(inout) :: g
    integer(i4) :: k, i, c

    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      i = b%low + k
      do c = 1, 3
        g%v(c, i) = b%v(k, c)
        g%omega(c, i) = b%w(k, c)
      end do
      if (.not. moved) cycle
      do c = 1, 3
        g%x(c, i) = b%x(k, c)
        g%theta(c, i) = b%theta(k, c)
      end do
      g%quat(1, i) = b%q(k, 1)
      g%quat(2, i) = b%q(k, 2)
      g%quat(3, i) = b%q(k, 3)
      g%quat(4, i) = b%q(k, 4)
    end do
  end subroutine store_mover

  !> Body records of the free lanes after a drift.
  pure subroutine put_bodies(b, body)
    type(mover_type), intent(in) :: b
    real(wp), intent(inout), contiguous :: body(:, :)
    integer(i4) :: k, i, c
    do k = 1, b%count
      if (b%free(k) < 0.5_wp) cycle
      i = b%low + k
      do c = 1, 3
        body(c, i) = b%x(k, c)
        body(9 + c, i) = b%v(k, c)
        body(12 + c, i) = b%w(k, c)
      end do
      do c = 1, 6
        body(3 + c, i) = b%a(k, c)
      end do
    end do
  end subroutine put_bodies

  !> Spin angular momentum in space [kg m^2/s].
  pure function scaled_spin_momentum(r, inertia, omega) result(l)
    real(wp), intent(in) :: r(3, 3)     !! rotation, body to space
    real(wp), intent(in) :: inertia(3)  !! principal moments [kg m^2]
    real(wp), intent(in) :: omega(3)    !! spin in space [rad/s]
    real(wp) :: l(3)
    l = matmul(r, inertia*matmul(omega, r))
  end function scaled_spin_momentum
end module dem_integrate
