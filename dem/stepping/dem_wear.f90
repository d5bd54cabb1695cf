!> Wear by Archard's law, W = k F_n s/H: what slides on planes and surfaces in each step.
!!
!! Threads find the parts of their own contacts beside the forces; one thread adds them in the order
!! of the grains, so that the thread count changes no bit. The geometry does not change. eq. D.85
module dem_wear
  use talus_kinds, only: wp, i4, i8
  use talus_vectors, only: cross
  use dem_contact, only: contact_point
  use dem_pair_law, only: pair_stiffness, at_friction_limit
  use dem_state, only: dem_data_type, lanes, history_side
  use dem_surface_measure, only: surface_stiffness, body_of_part
  use dem_surface_state, only: dem_surfaces_type
  implicit none
  private
  public :: begin_wear, make_wear_room, wear_block, wear_near, add_wear, worn_volumes

contains

  !> Nothing has worn yet.
  subroutine begin_wear(d)
    type(dem_data_type), intent(inout) :: d
    allocate (d%wear%plane_rate(d%planes%n), d%wear%plane(d%planes%n), source=0.0_wp)
    allocate (d%wear%body_rate(d%surfaces%n), d%wear%body(d%surfaces%n), source=0.0_wp)
    allocate (d%wear%triangle(d%surfaces%mesh%triangles), source=0.0_wp)
    d%wear%active = .true.
  end subroutine begin_wear

  !> Room for the parts of a step, before threads fill it; the list may be another than before.
  subroutine make_wear_room(d)
    type(dem_data_type), intent(inout) :: d
    if (.not. d%wear%active) return
    if (allocated(d%wear%plane_step)) &
      deallocate (d%wear%plane_step, d%wear%body_step, d%wear%triangle_step)
    allocate (d%wear%plane_step(lanes, d%pairs%blocks - d%pairs%grain_blocks), source=0.0_wp)
    allocate (d%wear%body_step(d%surfaces%list%slots, d%surfaces%list%near), source=0.0_wp)
    allocate (d%wear%triangle_step(d%surfaces%list%slots, d%surfaces%list%near), source=0_i4)
  end subroutine make_wear_room

  !> Normal force times sliding distance of the contacts of block k with a plane.
  subroutine wear_block(d, k, h)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: h  !! time since the last evaluation [s]
    integer(i4) :: lane, at, plane
    at = k - d%pairs%grain_blocks
    d%wear%plane_step(:, at) = 0.0_wp
    if (.not. d%pairs%touched(k)) return
    do lane = 1, lanes
      if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
      plane = d%pairs%first(lane, k) - d%grains%n - 3
      if (.not. d%wear%plane_rate(plane) > 0.0_wp) cycle
      d%wear%plane_step(lane, at) = load_path_on_plane(d, lane, k, plane, h)
    end do
  end subroutine wear_block

  !> That of one contact with a plane [J].
  pure real(wp) function load_path_on_plane(d, lane, k, plane, h) result(path)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k, plane
    real(wp), intent(in) :: h
    real(wp) :: force(3), n(3), point(3), stiffness(2)
    integer(i4) :: i
    path = 0.0_wp
    n = d%planes%normal(:, plane)
    force = d%pairs%result(1:3, (k - 1)*lanes + lane)
    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)))
      stiffness = pair_stiffness(d, lane, k)
      if (.not. at_friction_limit(law, force, n, stiffness(1), &
                                  d%pairs%history(lane, history_side, k)**2)) return
      point = d%pairs%body(1:3, d%pairs%first(lane, k)) &
              + contact_point(d%pairs, law%share, lane, k)
    end associate
    i = d%pairs%second(lane, k)
    path = h*normal_force(force, n)*slip_speed(d%pairs%body(:, i), point, n, &
                                               d%planes%velocity(:, plane))
  end function load_path_on_plane

  !> The same of contacts with surfaces, for this thread's run of the grains near them.
  subroutine wear_near(d, h, me, threads)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: h
    integer(i4), intent(in) :: me, threads
    integer(i4) :: g, k, b
    associate (list => d%surfaces%list)
      do g = 1 + int(int(list%near, i8)*me/threads, i4), &
        int(int(list%near, i8)*(me + 1)/threads, i4)
        d%wear%body_step(:, g) = 0.0_wp
        do k = 1, list%contacts(g)
          b = body_of_part(d, list%part(k, g))
          if (.not. d%wear%body_rate(b) > 0.0_wp) cycle
          d%wear%body_step(k, g) = load_path_on_surface(d, k, g, h)
          if (.not. d%wear%body_step(k, g) > 0.0_wp) cycle
          d%wear%triangle_step(k, g) = nearest_triangle(d%surfaces, g, b, list%foot(k, :, g))
        end do
      end do
    end associate
  end subroutine wear_near

  !> That of contact k of near grain g [J].
  pure real(wp) function load_path_on_surface(d, k, g, h) result(path)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    real(wp), intent(in) :: h
    real(wp) :: stiffness(2), v(3)
    integer(i4) :: i
    path = 0.0_wp
    associate (list => d%surfaces%list)
      i = list%near_grain(g)
      stiffness = surface_stiffness(d, k, g)
      if (.not. at_friction_limit(d%laws(d%surfaces%material(list%part(k, g)), &
                                         d%grains%material(i)), list%push(k, :, g), &
                                  list%normal(k, :, g), stiffness(1), &
                                  list%history(k, history_side, g)**2)) return
      v = list%motion(k, 1:3, g) &
          + cross(list%motion(k, 4:6, g), list%point(k, :, g) - list%foot(k, :, g))
      path = h*normal_force(list%push(k, :, g), list%normal(k, :, g)) &
             *slip_speed(d%pairs%body(:, i), list%point(k, :, g), list%normal(k, :, g), v)
    end associate
  end function load_path_on_surface

  !> What presses; what pulls does not wear [N].
  pure real(wp) function normal_force(force, n)
    real(wp), intent(in) :: force(3), n(3)
    normal_force = max(dot_product(force, n), 0.0_wp)
  end function normal_force

  !> Speed of a grain along the surface at a point of it that has velocity v [m/s].
  pure real(wp) function slip_speed(body, point, n, v) result(speed)
    real(wp), intent(in) :: body(:)  !! record of the grain
    real(wp), intent(in) :: point(3), n(3), v(3)
    real(wp) :: w(3)
    w = body(4:6) + cross(body(7:9), point - body(1:3)) - v
    speed = norm2(w - dot_product(w, n)*n)
  end function slip_speed

  !> Triangle of body b among the candidates of near grain g that is nearest to a point; 0: none.
  pure integer(i4) function nearest_triangle(s, g, b, point) result(nearest)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g, b
    real(wp), intent(in) :: point(3)
    real(wp) :: least, this
    integer(i4) :: c, t
    nearest = 0
    least = huge(1.0_wp)
    do c = s%list%near_start(g), s%list%near_start(g + 1) - 1
      t = s%list%candidate(c)
      if (t <= 0) cycle
      if (s%mesh%owner(t) /= b) cycle
      this = square_distance(s%mesh%x(:, s%mesh%corner(:, t)), point - s%list%image(:, c))
      if (this >= least) cycle
      least = this
      nearest = t
    end do
  end function nearest_triangle

  !> Square of the distance of a point from a triangle (3, corners) [m^2].
  pure real(wp) function square_distance(p, x) result(square)
    real(wp), intent(in) :: p(3, 3), x(3)
    real(wp) :: n(3), edge(3), r(3), t
    logical :: inside
    integer(i4) :: k
    n = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))
    inside = .true.
    square = huge(1.0_wp)
    do k = 1, 3
      edge = p(:, 1 + mod(k, 3)) - p(:, k)
      r = x - p(:, k)
      inside = inside .and. dot_product(cross(n, edge), r) >= 0.0_wp
      t = min(max(dot_product(r, edge)/sum(edge**2), 0.0_wp), 1.0_wp)
      square = min(square, sum((r - t*edge)**2))
    end do
    if (inside) square = dot_product(x - p(:, 1), n)**2/sum(n**2)
  end function square_distance

  !> The parts of a step into the sums, by one thread.
  subroutine add_wear(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: k, lane, g, plane, b, t
    do k = d%pairs%grain_blocks + 1, d%pairs%blocks
      do lane = 1, lanes
        associate (path => d%wear%plane_step(lane, k - d%pairs%grain_blocks))
          if (.not. path > 0.0_wp) cycle
          plane = d%pairs%first(lane, k) - d%grains%n - 3
          d%wear%plane(plane) = d%wear%plane(plane) + path
        end associate
      end do
    end do
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        associate (path => d%wear%body_step(k, g))
          if (.not. path > 0.0_wp) cycle
          b = body_of_part(d, d%surfaces%list%part(k, g))
          d%wear%body(b) = d%wear%body(b) + path
          t = d%wear%triangle_step(k, g)
          if (t > 0) d%wear%triangle(t) = d%wear%triangle(t) + path
        end associate
      end do
    end do
  end subroutine add_wear

  !> Worn volume of every triangle [m^3].
  pure function worn_volumes(d) result(volume)
    type(dem_data_type), intent(in) :: d
    real(wp), allocatable :: volume(:)
    volume = d%wear%body_rate(d%surfaces%mesh%owner)*d%wear%triangle
  end function worn_volumes
end module dem_wear
