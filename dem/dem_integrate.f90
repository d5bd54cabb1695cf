!> Motion of single grains: half kicks, drift, prescribed motion, and the work that goes with them.
!!
!! A step is start_grain (explicit half kick and drift), forces, finish_grain (implicit half kick);
!! together v+ = [(2 - a dt) v- + 2 F dt/(s m)]/(2 + a dt), x+ = x + v+ dt, and v is known at the
!! times of x. Rotation: symmetric splitting of the free rigid body into five turns about body axes
!! (Dullweber, Leimkuhler & McLachlan 1997) in Cayley form, so that |L| is kept without sine or
!! cosine. Works: half a step with the forces at each end and the velocity between.
module dem_integrate
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_grains_type, kind_free, kind_fixed
  use dem_shape, only: rotation_of, shape_matrix, quaternion_product
  implicit none
  private
  public :: motion_type, start_grain, finish_grain, kick_grain, drift_free, drift_prescribed
  public :: scaled_spin_momentum, work_count

  integer(i4), parameter :: work_count = 4  !! gravity, external, background damping, boundary

  !> Constants of a step.
  type :: motion_type
    real(wp) :: dt = 0.0_wp             !! [s]
    real(wp) :: damping = 0.0_wp        !! a [1/s]
    real(wp) :: mass_scale = 1.0_wp     !! [-]
    real(wp) :: inertia_scale = 1.0_wp  !! [-]
    real(wp) :: gravity(3) = 0.0_wp     !! scaled already [m/s^2]
  end type motion_type

contains

  !> First part of a step for grain i: half kick and drift, or the prescribed motion.
  pure subroutine start_grain(g, i, step, last, body, work)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: step
    logical, intent(in) :: last                   !! targets are reached by this step
    real(wp), intent(inout) :: body(:)            !! body record
    real(wp), intent(inout) :: work(work_count)   !! added to [J]

    if (g%kind(i) == kind_free) then
      call half_kick(g, i, step, .true., work)
      call drift_free(g, i, step%dt, body)
    else
      call drift_prescribed(g, i, step%dt, last, body)
    end if
  end subroutine start_grain

  !> Last part of a step: new forces are in, half kick or work and impulse of the prescription.
  pure subroutine finish_grain(g, i, step, force, moment, work)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: step
    real(wp), intent(in) :: force(3), moment(3)  !! new contact force and moment [N, N m]
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: mean_force(3), mean_moment(3), done

    if (g%kind(i) == kind_free) then
      g%force(:, i) = force
      g%moment(:, i) = moment
      call half_kick(g, i, step, .false., work)
      return
    end if
    mean_force = 0.5_wp*step%dt*(g%force(:, i) + force)
    mean_moment = 0.5_wp*step%dt*(g%moment(:, i) + moment)
    g%force(:, i) = force
    g%moment(:, i) = moment
    g%impulse(:, i) = g%impulse(:, i) + mean_force
    g%moment_impulse(:, i) = g%moment_impulse(:, i) + mean_moment
    done = -dot_product(mean_force, g%v(:, i)) - dot_product(mean_moment, g%omega(:, i))
    g%work(i) = g%work(i) + done
    work(4) = work(4) + done
  end subroutine finish_grain

  !> Half kick with the forces in hand: explicit before a drift, implicit after one.
  pure subroutine half_kick(g, i, step, explicit, work)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: half, keep, kicked, m, v(3), between(3), now(3), weight(3)
    real(wp) :: r(3, 3), inertia(3), spin(3), before(3), moment(3)

    half = 0.5_wp*step%dt
    m = step%mass_scale*g%mass(i)
    keep = 1.0_wp - step%damping*half
    kicked = 1.0_wp
    if (.not. explicit) then
      keep = 1.0_wp
      kicked = 1.0_wp/(1.0_wp + step%damping*half)
    end if
    weight = g%mass(i)*step%gravity
    v = (g%v(:, i)*keep + half/m*(g%force(:, i) + weight + g%extra_force(:, i)))*kicked
    if (explicit) then
      between = v
      now = g%v(:, i)
    else
      between = g%v(:, i)
      now = v
    end if
    g%v(:, i) = v
    work(1) = work(1) + half*dot_product(weight, between)
    work(2) = work(2) + half*dot_product(g%extra_force(:, i), between)
    work(3) = work(3) + half*step%damping*m*dot_product(now, between)

    r = rotation_of(g%quat(:, i))
    inertia = step%inertia_scale*g%inertia(:, i)
    before = turned_back(r, g%omega(:, i))
    moment = turned_back(r, g%moment(:, i) + g%extra_moment(:, i))
    spin = (before*keep + half*moment/inertia)*kicked
    g%omega(:, i) = turned(r, spin)
    if (explicit) then
      between = spin
      now = before
    else
      between = before
      now = spin
    end if
    work(2) = work(2) + half*dot_product(turned_back(r, g%extra_moment(:, i)), between)
    work(3) = work(3) + half*step%damping*dot_product(inertia*now, between)
  end subroutine half_kick

  !> Full kick over dt of a free grain, as two half kicks in one (split verbs of the port).
  pure subroutine kick_grain(g, i, step, work)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: step
    real(wp), intent(inout) :: work(work_count)
    call half_kick(g, i, step, .false., work)
    call half_kick(g, i, step, .true., work)
  end subroutine kick_grain

  !> Move a free grain by dt: x, orientation, accumulated rotation, body record.
  pure subroutine drift_free(g, i, dt, body)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: body(:)
    real(wp) :: r(3, 3), momentum(3), inertia(3), q(4), scale

    g%x(:, i) = g%x(:, i) + dt*g%v(:, i)
    q = g%quat(:, i)
    r = rotation_of(q)
    inertia = g%inertia(:, i)
    momentum = inertia*turned_back(r, g%omega(:, i))
    call turn(1, 2, 3, 0.5_wp*dt, inertia, momentum, q)
    call turn(2, 3, 1, 0.5_wp*dt, inertia, momentum, q)
    call turn(3, 1, 2, dt, inertia, momentum, q)
    call turn(2, 3, 1, 0.5_wp*dt, inertia, momentum, q)
    call turn(1, 2, 3, 0.5_wp*dt, inertia, momentum, q)
    scale = 1.0_wp/sqrt(q(1)*q(1) + q(2)*q(2) + q(3)*q(3) + q(4)*q(4))
    q = scale*q
    r = rotation_of(q)
    g%quat(:, i) = q
    g%omega(:, i) = turned(r, momentum/inertia)
    g%theta(:, i) = g%theta(:, i) + dt*g%omega(:, i)
    body(1:3) = g%x(:, i)
    body(4:9) = shape_matrix(r, g%axes(:, i))
    body(10:12) = g%v(:, i)
    body(13:15) = g%omega(:, i)
  end subroutine drift_free

  !> Turn about body axis a: orientation (not normalised) and momentum in the body frame.
  pure subroutine turn(a, b, c, dt, inertia, momentum, q)
    integer(i4), intent(in) :: a, b, c  !! the axis and the two after it
    real(wp), intent(in) :: dt, inertia(3)
    real(wp), intent(inout) :: momentum(3), q(4)
    real(wp) :: t, cosine, sine, second, w, qa

    t = 0.5_wp*dt*momentum(a)/inertia(a)
    sine = 1.0_wp/(1.0_wp + t*t)
    cosine = (1.0_wp - t*t)*sine
    sine = 2.0_wp*t*sine
    second = momentum(b)
    momentum(b) = cosine*second + sine*momentum(c)
    momentum(c) = cosine*momentum(c) - sine*second
    w = q(1)
    qa = q(1 + a)
    second = q(1 + b)
    q(1) = w - t*qa
    q(1 + a) = qa + t*w
    q(1 + b) = second + t*q(1 + c)
    q(1 + c) = q(1 + c) - t*second
  end subroutine turn

  !> Move a prescribed grain by dt with its velocity and spin; the last step ends on the target.
  pure subroutine drift_prescribed(g, i, dt, last, body)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: dt
    logical, intent(in) :: last
    real(wp), intent(inout) :: body(:)
    real(wp) :: q(4)

    if (g%kind(i) == kind_fixed) return
    g%x(:, i) = g%x(:, i) + dt*g%v(:, i)
    q = quaternion_product(g%turn(:, i), g%quat(:, i))
    q = q/sqrt(q(1)*q(1) + q(2)*q(2) + q(3)*q(3) + q(4)*q(4))
    g%quat(:, i) = q
    g%theta(:, i) = g%theta(:, i) + dt*g%omega(:, i)
    if (last .and. g%has_target(i)) then
      g%x(:, i) = g%target_x(:, i)
      g%quat(:, i) = g%target_quat(:, i)
    end if
    body(1:3) = g%x(:, i)
    body(4:9) = shape_matrix(rotation_of(g%quat(:, i)), g%axes(:, i))
    body(10:12) = g%v(:, i)
    body(13:15) = g%omega(:, i)
  end subroutine drift_prescribed

  !> Space to body.
  pure function turned_back(r, a) result(b)
    real(wp), intent(in) :: r(3, 3), a(3)
    real(wp) :: b(3)
    b(1) = r(1, 1)*a(1) + r(2, 1)*a(2) + r(3, 1)*a(3)
    b(2) = r(1, 2)*a(1) + r(2, 2)*a(2) + r(3, 2)*a(3)
    b(3) = r(1, 3)*a(1) + r(2, 3)*a(2) + r(3, 3)*a(3)
  end function turned_back

  !> Body to space.
  pure function turned(r, a) result(b)
    real(wp), intent(in) :: r(3, 3), a(3)
    real(wp) :: b(3)
    b(1) = r(1, 1)*a(1) + r(1, 2)*a(2) + r(1, 3)*a(3)
    b(2) = r(2, 1)*a(1) + r(2, 2)*a(2) + r(2, 3)*a(3)
    b(3) = r(3, 1)*a(1) + r(3, 2)*a(2) + r(3, 3)*a(3)
  end function turned

  !> Spin angular momentum in space with scaled inertia [kg m^2/s].
  pure function scaled_spin_momentum(quat, inertia, omega) result(l)
    real(wp), intent(in) :: quat(4), inertia(3), omega(3)
    real(wp) :: l(3), r(3, 3)
    r = rotation_of(quat)
    l = turned(r, inertia*turned_back(r, omega))
  end function scaled_spin_momentum
end module dem_integrate
