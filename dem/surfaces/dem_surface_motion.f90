!> Motion of surfaces: rigid bodies by velocity and spin, soft ones vertex by vertex; what the
!! grains do to them: forces, moments, impulses and work.
module dem_surface_motion
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_data_type, column_count
  use dem_surface_state, only: dem_surfaces_type, is_soft, surface_soft, surface_bore, &
    is_bore, is_cylinder
  use dem_surface_body, only: turn_free, turns_freely, is_free, held_power
  use dem_ellipsoid, only: quaternion_from_rotation, quaternion_product, rotation_of
  implicit none
  private
  public :: drift_surfaces, finish_surfaces, surface_travel, reset_surfaces, reset_works
  public :: surface_columns, loads_of_bodies, loads_of_vertices

contains

  !> All surfaces by dt; soft ones end on their targets if this is the last step.
  pure subroutine drift_surfaces(s, dt, last)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: dt
    logical, intent(in) :: last
    real(wp) :: q(4)
    integer(i4) :: b, low, high

    do b = 1, s%n
      low = s%first_vertex(b)
      high = s%first_vertex(b + 1) - 1
      if (is_soft(s, b)) then
        s%mesh%x(:, low:high) = s%mesh%x(:, low:high) + dt*s%mesh%v(:, low:high)
        if (last .and. s%mesh%has_target .and. s%kind(b) == surface_soft) &
          s%mesh%x(:, low:high) = s%mesh%target(:, low:high)
        cycle
      end if
      if (is_bore(s, b)) s%round%radius(b) = s%round%radius(b) + dt*s%round%swell(b)
      if (.not. any(abs([s%velocity(:, b), s%spin(:, b)]) > 0.0_wp)) cycle
      s%centre(:, b) = s%centre(:, b) + dt*s%velocity(:, b)
      if (turns_freely(s, b)) then
        call turn_free(s%rigid%inertia(:, b), s%rigid%frame(:, b), dt, s%quat(:, b), s%spin(:, b))
      else if (any(abs(s%spin(:, b)) > 0.0_wp)) then
        q = quaternion_product(quaternion_from_rotation(dt*s%spin(:, b)), s%quat(:, b))
        s%quat(:, b) = q/sqrt(sum(q*q))
      end if
      call place_body(s, b)
    end do
  end subroutine drift_surfaces

  !> Vertices and axis of a rigid body from its centre and turn.
  pure subroutine place_body(s, b)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: b
    real(wp) :: r(3, 3)
    integer(i4) :: k
    r = rotation_of(s%quat(:, b))
    s%round%axis(:, b) = matmul(r, s%round%rest_axis(:, b))
    do k = s%first_vertex(b), s%first_vertex(b + 1) - 1
      s%mesh%x(:, k) = s%centre(:, b) + r(:, 1)*s%mesh%rest(1, k) + r(:, 2)*s%mesh%rest(2, k) &
                  + r(:, 3)*s%mesh%rest(3, k)
    end do
  end subroutine place_body

  !> Largest displacement of a point of any surface since the list was made [m].
  pure real(wp) function surface_travel(s) result(travel)
    type(dem_surfaces_type), intent(in) :: s
    real(wp) :: cosine, sine, this
    integer(i4) :: b, k

    travel = 0.0_wp
    do b = 1, s%n
      if (is_soft(s, b)) then
        do k = s%first_vertex(b), s%first_vertex(b + 1) - 1
          this = sqrt(sum((s%mesh%x(:, k) - s%mesh%reference(:, k))**2))
          if (.not. this <= travel) travel = this
        end do
        cycle
      end if
      cosine = dot_product(s%quat(:, b), s%reference_q(:, b))
      sine = sqrt(max(1.0_wp - cosine*cosine, 0.0_wp))
      this = sqrt(sum((s%centre(:, b) - s%reference_x(:, b))**2)) + 2.0_wp*sine*s%reach(b)
      if (is_cylinder(s, b)) this = cylinder_travel(s, b)
      if (.not. this <= travel) travel = this
    end do
  end function surface_travel

  !> The same of a cylinder, whose spin about its axis moves nothing [m].
  pure real(wp) function cylinder_travel(s, b) result(travel)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp) :: before(3), r(3, 3)
    r = rotation_of(s%reference_q(:, b))
    before = matmul(r, s%round%rest_axis(:, b))
    travel = sqrt(sum((s%centre(:, b) - s%reference_x(:, b))**2)) &
             + sqrt(sum((s%round%axis(:, b) - before)**2))*s%reach(b) &
             + abs(s%round%radius(b) - s%round%listed_radius(b))
  end function cylinder_travel

  !> New contact forces are in: sums of the parts, impulses of the step and work of the motion, each
  !! with the mean of the forces at both ends, in the order of the grains.
  pure subroutine finish_surfaces(s, dt, boundary)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: boundary  !! work of prescribed motion on the grains [J]
    real(wp) :: force(3, s%parts), moment(3, s%parts), f(3), m(3), done
    integer(i4) :: p, b

    call sum_parts(s, force, moment)
    do b = 1, s%n
      do p = s%first_part(b), s%first_part(b + 1) - 1
        f = 0.5_wp*dt*(s%sums%force(:, p) + force(:, p))
        m = 0.5_wp*dt*(s%sums%moment(:, p) + moment(:, p))
        s%sums%impulse(:, p) = s%sums%impulse(:, p) + f
        s%sums%moment_impulse(:, p) = s%sums%moment_impulse(:, p) + m
        if (is_soft(s, b)) cycle
        done = -dot_product(f, s%velocity(:, b)) - dot_product(m, s%spin(:, b))
        s%sums%work(p) = s%sums%work(p) + done
        if (is_free(s, b)) done = -held_power(s, b, f, m)
        boundary = boundary + done
      end do
    end do
    s%sums%force = force
    s%sums%moment = moment
    if (any(s%kind == surface_bore)) call finish_bores(s, dt, boundary)
    if (s%soft) call finish_vertices(s, dt, boundary)
  end subroutine finish_surfaces

  !> Normal forces on the walls of bores, their impulses, and work of walls that move outwards.
  pure subroutine finish_bores(s, dt, boundary)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: boundary
    real(wp) :: press, mean, done
    integer(i4) :: b, g, k

    do b = 1, s%n
      if (.not. is_bore(s, b)) cycle
      press = 0.0_wp
      do g = 1, s%list%near
        do k = 1, s%list%contacts(g)
          if (s%list%part(k, g) /= s%first_part(b)) cycle
          press = press + dot_product(s%list%push(k, :, g), s%list%normal(k, :, g))
        end do
      end do
      mean = 0.5_wp*dt*(s%round%press(b) + press)
      s%round%press(b) = press
      s%round%press_impulse(b) = s%round%press_impulse(b) + mean
      done = -mean*s%round%swell(b)
      s%sums%work(s%first_part(b)) = s%sums%work(s%first_part(b)) + done
      boundary = boundary + done
    end do
  end subroutine finish_bores

  !> Forces and moments about the centres from all contacts.
  pure subroutine sum_parts(s, force, moment)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(out) :: force(:, :), moment(:, :)
    real(wp) :: f(3), r(3)
    integer(i4) :: g, k, p, body(s%parts)

    do k = 1, s%n
      body(s%first_part(k):s%first_part(k + 1) - 1) = k
    end do
    force = 0.0_wp
    moment = 0.0_wp
    do g = 1, s%list%near
      do k = 1, s%list%contacts(g)
        p = s%list%part(k, g)
        f = -s%list%push(k, :, g)
        r = s%list%point(k, :, g) - s%list%offset(k, :, g) - s%centre(:, body(p))
        force(:, p) = force(:, p) + f
        moment(1, p) = moment(1, p) + r(2)*f(3) - r(3)*f(2)
        moment(2, p) = moment(2, p) + r(3)*f(1) - r(1)*f(3)
        moment(3, p) = moment(3, p) + r(1)*f(2) - r(2)*f(1)
        if (size(s%list%couple) > 0) moment(:, p) = moment(:, p) - s%list%couple(k, :, g)
      end do
    end do
  end subroutine sum_parts

  !> What this rank's grains do to each body, the sums of its parts: force and moment [N], [N m].
  pure function loads_of_bodies(s) result(load)
    type(dem_surfaces_type), intent(in) :: s
    real(wp) :: load(6, s%n), force(3, s%parts), moment(3, s%parts)
    integer(i4) :: b, p
    call sum_parts(s, force, moment)
    load = 0.0_wp
    do b = 1, s%n
      do p = s%first_part(b), s%first_part(b + 1) - 1
        load(:, b) = load(:, b) + [force(:, p), moment(:, p)]
      end do
    end do
  end function loads_of_bodies

  !> Forces, impulses and work of the vertices of soft bodies.
  pure subroutine finish_vertices(s, dt, boundary)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: boundary
    real(wp) :: force(3, s%mesh%vertices), mean(3), done
    integer(i4) :: k, b

    force = loads_of_vertices(s)
    do b = 1, s%n
      if (.not. is_soft(s, b)) cycle
      do k = s%first_vertex(b), s%first_vertex(b + 1) - 1
        mean = 0.5_wp*dt*(s%mesh%force(:, k) + force(:, k))
        s%mesh%impulse(:, k) = s%mesh%impulse(:, k) + mean
        done = -dot_product(mean, s%mesh%v(:, k))
        s%sums%work(s%first_part(b)) = s%sums%work(s%first_part(b)) + done
        if (allocated(s%membranes)) then
          if (s%membranes%mass(k) > 0.0_wp .and. s%membranes%wall(k) < 0) cycle
        end if
        boundary = boundary + done
      end do
    end do
    s%mesh%force = force
  end subroutine finish_vertices

  !> What this rank's grains do to each vertex of soft bodies [N].
  pure function loads_of_vertices(s) result(force)
    type(dem_surfaces_type), intent(in) :: s
    real(wp) :: force(3, s%mesh%vertices)
    integer(i4) :: g, c, k, vertex
    force = 0.0_wp
    do g = 1, s%list%near
      if (s%list%contacts(g) == 0) cycle
      do c = s%list%near_start(g), s%list%near_start(g + 1) - 1
        if (s%list%candidate(c) <= 0) cycle
        if (.not. is_soft(s, s%mesh%owner(s%list%candidate(c)))) cycle
        do k = 1, 3
          vertex = s%mesh%corner(k, s%list%candidate(c))
          force(:, vertex) = force(:, vertex) + s%list%share(:, 3*(c - 1) + k)
        end do
      end do
    end do
  end function loads_of_vertices

  !> Work columns of all contacts, in the order of the grains [J].
  pure function surface_columns(s) result(total)
    type(dem_surfaces_type), intent(in) :: s
    real(wp) :: total(column_count)
    integer(i4) :: g
    total = 0.0_wp
    do g = 1, s%list%near
      total = total + s%list%columns(:, g)
    end do
  end function surface_columns

  !> Impulses and works to zero (start of an exchange).
  pure subroutine reset_surfaces(s)
    type(dem_surfaces_type), intent(inout) :: s
    s%sums%impulse = 0.0_wp
    s%sums%moment_impulse = 0.0_wp
    s%mesh%impulse = 0.0_wp
    call reset_works(s)
  end subroutine reset_surfaces

  !> Works to zero.
  pure subroutine reset_works(s)
    type(dem_surfaces_type), intent(inout) :: s
    s%sums%work = 0.0_wp
  end subroutine reset_works
end module dem_surface_motion
