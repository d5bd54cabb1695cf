!> Bodies that move and turn by forces in some directions, and as prescribed in the others.
!!
!! A body has half kicks before and after its drift, as a grain has; the spin of one that turns
!! freely about all axes follows the symmetric splitting of dem_integrate.
!! eq. D.14
module dem_surface_body
  use talus_kinds, only: wp, i4
  use dem_integrate, only: motion_type, work_count
  use dem_ellipsoid, only: rotation_of, quaternion_product
  use dem_surface_state, only: dem_surfaces_type
  implicit none
  private
  public :: no_free_bodies, set_load, set_loads, set_liquid, push_bodies, turn_free, turns_freely
  public :: body_energy, held_power, load_left, is_free, principal_axes

contains

  !> Room for the properties of bodies of which none is free yet.
  subroutine no_free_bodies(s)
    type(dem_surfaces_type), intent(inout) :: s
    allocate (s%rigid%free(6, s%n), s%rigid%mass(s%n), s%rigid%inertia(3, s%n), &
              s%rigid%given(6, s%n), s%rigid%frame(4, s%n), source=0.0_wp)
    s%rigid%frame(1, :) = 1.0_wp
  end subroutine no_free_bodies

  !> The given load of body b: force and moment [N], [N m].
  pure subroutine set_load(s, b, load)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: load(6)
    s%rigid%given(:, b) = load
  end subroutine set_load

  !> Those of all bodies (6, bodies).
  pure subroutine set_loads(s, load)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: load(:, :)
    s%rigid%given = load
  end subroutine set_loads

  !> Loads of a liquid on all bodies (6, bodies), held from now on.
  pure subroutine set_liquid(s, load)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: load(:, :)
    s%rigid%liquid = load
  end subroutine set_liquid

  !> What acts on body b besides contacts and its weight [N], [N m].
  pure function outer_load(s, b) result(load)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp) :: load(6)
    load = s%rigid%given(:, b)
    if (allocated(s%rigid%liquid)) load = load + s%rigid%liquid(:, b)
  end function outer_load

  !> Does body b move freely in any direction?
  pure logical function is_free(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    is_free = .false.
    if (allocated(s%rigid%free)) is_free = any(s%rigid%free(:, b) > 0.5_wp)
  end function is_free

  !> Does body b turn freely about all axes?
  pure logical function turns_freely(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    turns_freely = .false.
    if (allocated(s%rigid%free)) turns_freely = all(s%rigid%free(4:, b) > 0.5_wp)
  end function turns_freely

  !> Principal axes of body b now, as columns.
  pure function principal_axes(s, b) result(r)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp) :: r(3, 3)
    r = rotation_of(quaternion_product(s%quat(:, b), s%rigid%frame(:, b)))
  end function principal_axes

  !> What acts on body b in its free directions: contacts, given load, liquid, weight [N], [N m].
  pure function load_left(s, b, gravity) result(load)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: gravity(3)  !! [m/s^2]
    real(wp) :: load(6)
    integer(i4) :: p
    load = outer_load(s, b)
    load(1:3) = load(1:3) + s%rigid%mass(b)*gravity
    if (allocated(s%rigid%acting)) load = load + s%rigid%acting(:, b)
    do p = s%first_part(b), merge(0_i4, s%first_part(b + 1) - 1, allocated(s%rigid%acting))
      load = load + [s%sums%force(:, p), s%sums%moment(:, p)]
    end do
    load = s%rigid%free(:, b)*load
  end function load_left

  !> Half kick of all free bodies with the current forces: explicit before a drift, else after one.
  pure subroutine push_bodies(s, step, explicit, work)
    type(dem_surfaces_type), intent(inout) :: s
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: load(6), old(6), between(6), r(3, 3), half
    integer(i4) :: b

    if (.not. allocated(s%rigid%free)) return
    half = 0.5_wp*step%dt
    do b = 1, s%n
      if (.not. is_free(s, b)) cycle
      load = load_left(s, b, step%gravity)
      old = [s%velocity(:, b), s%spin(:, b)]
      if (any(s%rigid%free(:3, b) > 0.5_wp)) &
        s%velocity(:, b) = s%velocity(:, b) + half/s%rigid%mass(b)*load(1:3)
      if (turns_freely(s, b)) then
        r = principal_axes(s, b)
        s%spin(:, b) = s%spin(:, b) + half*matmul(r, matmul(load(4:6), r)/s%rigid%inertia(:, b))
      else if (any(s%rigid%free(4:, b) > 0.5_wp)) then
        where (s%rigid%free(4:, b) > 0.5_wp) &
          s%spin(:, b) = s%spin(:, b) + half*load(4:6)/s%rigid%inertia(:, b)
      end if
      if (.not. s%counted) cycle
      between = merge([s%velocity(:, b), s%spin(:, b)], old, explicit)
      work(1) = work(1) + half*s%rigid%mass(b)*dot_product(s%rigid%free(:3, b)*step%gravity, &
        between(1:3))
      work(2) = work(2) + half*dot_product(s%rigid%free(:, b)*outer_load(s, b), between)
    end do
  end subroutine push_bodies

  !> Power of a load in the directions in which body b is not free [W].
  pure real(wp) function held_power(s, b, force, moment) result(power)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: force(3), moment(3)
    power = dot_product((1.0_wp - s%rigid%free(:3, b))*force, s%velocity(:, b)) &
            + dot_product((1.0_wp - s%rigid%free(4:, b))*moment, s%spin(:, b))
  end function held_power

  !> Kinetic energy of the free directions of body b, and the leapfrog's part of it [J].
  pure function body_energy(s, b, dt, gravity) result(part)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: dt, gravity(3)
    real(wp) :: part(2), load(6), r(3, 3), spin(3)

    part = 0.0_wp
    if (.not. (is_free(s, b) .and. s%counted)) return
    load = load_left(s, b, gravity)
    if (any(s%rigid%free(:3, b) > 0.5_wp)) then
      part(1) = 0.5_wp*s%rigid%mass(b)*sum(s%rigid%free(:3, b)*s%velocity(:, b)**2)
      part(2) = dt**2/8.0_wp*sum(load(1:3)**2)/s%rigid%mass(b)
    end if
    if (.not. any(s%rigid%free(4:, b) > 0.5_wp)) return
    spin = s%spin(:, b)
    if (turns_freely(s, b)) then
      r = principal_axes(s, b)
      spin = matmul(spin, r)
      load(4:6) = matmul(load(4:6), r)
    end if
    part(1) = part(1) + 0.5_wp*sum(s%rigid%inertia(:, b)*s%rigid%free(4:, b)*spin**2)
    part(2) = part(2) + dt**2/8.0_wp*sum(load(4:6)**2/s%rigid%inertia(:, b), &
                                         mask=s%rigid%free(4:, b) > 0.5_wp)
  end function body_energy

  !> Free rotation by dt: five turns about body axes (Dullweber, Leimkuhler & McLachlan).
  pure subroutine turn_free(inertia, frame, dt, quat, spin)
    real(wp), intent(in) :: inertia(3)  !! about the principal axes [kg m^2]
    real(wp), intent(in) :: frame(4)    !! these axes at the start [-]
    real(wp), intent(in) :: dt          !! [s]
    real(wp), intent(inout) :: quat(4)  !! turn since the start [-]
    real(wp), intent(inout) :: spin(3)  !! [rad/s]
    integer(i4), parameter :: about(5) = [1, 2, 3, 2, 1]
    real(wp), parameter :: part(5) = [0.5_wp, 0.5_wp, 1.0_wp, 0.5_wp, 0.5_wp]
    real(wp) :: l(3), q(4), r(3, 3)
    integer(i4) :: k

    q = quaternion_product(quat, frame)
    r = rotation_of(q)
    l = inertia*matmul(spin, r)
    do k = 1, 5
      call turn_about(about(k), 0.5_wp*part(k)*dt/inertia(about(k)), l, q)
    end do
    q = q/sqrt(sum(q*q))
    quat = quaternion_product(q, [frame(1), -frame(2:)])
    spin = matmul(rotation_of(q), l/inertia)
  end subroutine turn_free

  !> Turn about body axis a by the Cayley angle 2 atan(factor l(a)): momentum in the body frame,
  !! quaternion not normalised.
  pure subroutine turn_about(a, factor, l, q)
    integer(i4), intent(in) :: a
    real(wp), intent(in) :: factor
    real(wp), intent(inout) :: l(3), q(4)
    real(wp) :: t, sine, cosine, old(3), was(4)
    integer(i4) :: b, c

    b = 1 + mod(a, 3)
    c = 1 + mod(b, 3)
    t = factor*l(a)
    sine = 2.0_wp*t/(1.0_wp + t*t)
    cosine = (1.0_wp - t*t)/(1.0_wp + t*t)
    old = l
    l(b) = cosine*old(b) + sine*old(c)
    l(c) = cosine*old(c) - sine*old(b)
    was = q
    q(1) = was(1) - t*was(1 + a)
    q(1 + a) = was(1 + a) + t*was(1)
    q(1 + b) = was(1 + b) + t*was(1 + c)
    q(1 + c) = was(1 + c) - t*was(1 + b)
  end subroutine turn_about
end module dem_surface_body
