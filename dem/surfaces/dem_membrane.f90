!> Flexible membranes of triangles with masses at their corners, stretched by the grains inside and
!! loaded by a follower pressure.
!!
!! A triangle is a plane-stress membrane of St. Venant and Kirchhoff: with the deformation gradient
!! F from its shape at the start, E = (F^T F - 1)/2 and S = K ((1 - nu) E + nu tr E 1),
!! K = E t/(1 - nu^2), the energy is A S:E/2 and its corners are pulled by -A F S grad N. Corners
!! on free edges are held: they are fixed, or follow a wall. On ranks all of them move all corners
!! alike, by the forces of all grains; the leader counts their works.
module dem_membrane
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_text, only: str
  use talus_vectors, only: cross
  use dem_integrate, only: motion_type, work_count
  use dem_state, only: dem_data_type
  use dem_surface_body, only: push_bodies
  use dem_surface_measure, only: vertex_stiffness
  use dem_surface_state, only: dem_surfaces_type, dem_membranes_type, surface_membrane, &
    first_corner
  implicit none
  private
  public :: no_membranes, shape_membrane, push_surfaces, finish_membranes, pull_membranes
  public :: set_pressure, set_pressures, set_stretches, set_forces
  public :: membranes_energy, membrane_rate, corner_stiffness, check_membranes

contains

  !> Room for the properties of membranes.
  subroutine no_membranes(s)
    type(dem_surfaces_type), intent(inout) :: s
    allocate (s%membranes)
    associate (m => s%membranes)
      allocate (m%modulus(s%n), m%poisson(s%n), m%pressure(s%n), m%side(s%n), m%damping(s%n), &
                m%limit(s%n), m%stretch(s%n), m%mass(s%mesh%vertices), m%area(s%mesh%triangles), &
                m%inverse(2, 2, s%mesh%triangles), m%press(3, s%mesh%vertices), &
                m%pull(3, s%mesh%vertices), source=0.0_wp)
      allocate (m%wall(s%mesh%vertices), source=-1_i4)
    end associate
  end subroutine no_membranes

  !> The pressure of membrane b from now on [Pa].
  pure subroutine set_pressure(s, b, pressure)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: pressure
    s%membranes%pressure(b) = pressure
  end subroutine set_pressure

  !> Those of all bodies (bodies) [Pa].
  pure subroutine set_pressures(s, pressure)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: pressure(:)
    s%membranes%pressure = pressure
  end subroutine set_pressures

  !> The largest stretches so far (bodies) [-].
  pure subroutine set_stretches(s, stretch)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: stretch(:)
    s%membranes%stretch = stretch
  end subroutine set_stretches

  !> The forces on all corners at the end of the last step.
  pure subroutine set_forces(s, press, pull)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: press(:, :)           !! (3, vertices) of the pressure [N]
    real(wp), intent(in), optional :: pull(:, :)  !! (3, vertices) of the stretch [N]
    s%membranes%press = press
    if (present(pull)) s%membranes%pull = pull
  end subroutine set_forces

  !> Shape at the start, masses of the corners, and on which side the point inside lies, of body b.
  subroutine shape_membrane(s, b, weight, inside)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: weight     !! density times thickness [kg/m^2]
    real(wp), intent(in) :: inside(3)  !! [m]
    real(wp) :: e(3, 2), n(3), long, along, high, towards
    integer(i4) :: k

    towards = 0.0_wp
    associate (m => s%membranes)
      do k = s%first_triangle(b), s%first_triangle(b + 1) - 1
        associate (c => s%mesh%corner(:, k))
          e(:, 1) = s%mesh%x(:, c(2)) - s%mesh%x(:, c(1))
          e(:, 2) = s%mesh%x(:, c(3)) - s%mesh%x(:, c(1))
          n = cross(e(:, 1), e(:, 2))
          m%area(k) = 0.5_wp*norm2(n)
          long = norm2(e(:, 1))
          along = dot_product(e(:, 2), e(:, 1))/long
          high = 2.0_wp*m%area(k)/long
          m%inverse(:, 1, k) = [1.0_wp/long, 0.0_wp]
          m%inverse(:, 2, k) = [-along/(long*high), 1.0_wp/high]
          m%mass(c) = m%mass(c) + weight*m%area(k)/3.0_wp
          towards = towards + dot_product(n, inside - sum(s%mesh%x(:, c), 2)/3.0_wp)
        end associate
      end do
      m%side(b) = sign(1.0_wp, towards)
    end associate
  end subroutine shape_membrane

  !> Half kick of bodies that are free and of membranes, see below.
  pure subroutine push_surfaces(s, wall_velocity, step, explicit, work)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: wall_velocity(:, :)  !! (3, walls) [m/s]
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(inout) :: work(work_count)
    call push_bodies(s, step, explicit, work)
    if (allocated(s%membranes)) call push_membranes(s, wall_velocity, step, explicit, work)
  end subroutine push_surfaces

  !> Half kick of all corners that are not held, with the current forces: explicit before a drift,
  !! else after one. Held corners take the velocity of their wall.
  pure subroutine push_membranes(s, wall_velocity, step, explicit, work)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: wall_velocity(:, :)  !! (3, walls) [m/s]
    type(motion_type), intent(in) :: step
    logical, intent(in) :: explicit
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: half, keep, kicked, old(3), new(3), between(3), now(3)
    real(wp) :: before(work_count)
    integer(i4) :: b, k

    call hold_corners(s, wall_velocity)
    half = 0.5_wp*step%dt
    before = work
    associate (m => s%membranes)
      do b = 1, s%n
        if (s%kind(b) /= surface_membrane) cycle
        keep = merge(1.0_wp - half*m%damping(b), 1.0_wp, explicit)
        kicked = merge(1.0_wp, 1.0_wp/(1.0_wp + half*m%damping(b)), explicit)
        do k = s%first_vertex(b), s%first_vertex(b + 1) - 1
          if (m%wall(k) >= 0) cycle
          old = s%mesh%v(:, k)
          new = corner_load(s, k) + m%press(:, k) + m%pull(:, k) + m%mass(k)*step%gravity
          new = (old*keep + half/m%mass(k)*new)*kicked
          between = merge(new, old, explicit)
          now = merge(old, new, explicit)
          work(1) = work(1) + half*m%mass(k)*dot_product(step%gravity, between)
          work(3) = work(3) + half*m%damping(b)*m%mass(k)*dot_product(now, between)
          s%mesh%v(:, k) = new
        end do
      end do
    end associate
    if (.not. s%counted) work = before
  end subroutine push_membranes

  !> Held corners stand still, or have the velocity of their wall.
  pure subroutine hold_corners(s, wall_velocity)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: wall_velocity(:, :)  !! (3, walls) [m/s]
    integer(i4) :: k
    do k = 1, s%mesh%vertices
      if (s%membranes%wall(k) == 0) s%mesh%v(:, k) = 0.0_wp
      if (s%membranes%wall(k) > 0) s%mesh%v(:, k) = wall_velocity(:, s%membranes%wall(k))
    end do
  end subroutine hold_corners

  !> What the grains, of all ranks, do to corner k [N].
  pure function corner_load(s, k) result(force)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: k
    real(wp) :: force(3)
    if (allocated(s%mesh%acting)) then
      force = s%mesh%acting(:, k)
    else
      force = s%mesh%force(:, k)
    end if
  end function corner_load

  !> New forces of pressure and stretch at the places of now; work of the pressure on all corners,
  !! and of the held ones against both.
  pure subroutine finish_membranes(s, dt, work)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: press(3, s%mesh%vertices), pull(3, s%mesh%vertices)
    integer(i4) :: k

    press = s%membranes%press
    pull = s%membranes%pull
    call pull_membranes(s)
    if (.not. s%counted) return
    associate (m => s%membranes)
      do k = 1, s%mesh%vertices
        if (.not. m%mass(k) > 0.0_wp) cycle
        press(:, k) = 0.5_wp*dt*(press(:, k) + m%press(:, k))
        work(2) = work(2) + dot_product(press(:, k), s%mesh%v(:, k))
        if (m%wall(k) < 0) cycle
        pull(:, k) = 0.5_wp*dt*(pull(:, k) + m%pull(:, k))
        work(4) = work(4) - dot_product(press(:, k) + pull(:, k), s%mesh%v(:, k))
      end do
    end associate
  end subroutine finish_membranes

  !> Forces of pressure and stretch on all corners, and the largest stretch of each membrane.
  pure subroutine pull_membranes(s)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp) :: f(3, 2), strain(2, 2), stress(2, 2), t(3, 2), push(3), part(3, 2)
    integer(i4) :: b, k, c(3)

    associate (m => s%membranes)
      m%press = 0.0_wp
      m%pull = 0.0_wp
      do b = 1, s%n
        if (s%kind(b) /= surface_membrane) cycle
        do k = s%first_triangle(b), s%first_triangle(b + 1) - 1
          c = s%mesh%corner(:, k)
          call strain_of(s, k, f, strain)
          m%stretch(b) = max(m%stretch(b), largest_stretch(strain))
          stress = m%modulus(b)*(1.0_wp - m%poisson(b))*strain
          stress(1, 1) = stress(1, 1) + m%modulus(b)*m%poisson(b)*(strain(1, 1) + strain(2, 2))
          stress(2, 2) = stress(2, 2) + m%modulus(b)*m%poisson(b)*(strain(1, 1) + strain(2, 2))
          t = m%area(k)*matmul(f, stress)
          part = matmul(t, transpose(m%inverse(:, :, k)))
          m%pull(:, c(2)) = m%pull(:, c(2)) - part(:, 1)
          m%pull(:, c(3)) = m%pull(:, c(3)) - part(:, 2)
          m%pull(:, c(1)) = m%pull(:, c(1)) + part(:, 1) + part(:, 2)
          push = cross(s%mesh%x(:, c(2)) - s%mesh%x(:, c(1)), s%mesh%x(:, c(3)) &
            - s%mesh%x(:, c(1)))
          push = m%side(b)*m%pressure(b)/6.0_wp*push
          m%press(:, c(1)) = m%press(:, c(1)) + push
          m%press(:, c(2)) = m%press(:, c(2)) + push
          m%press(:, c(3)) = m%press(:, c(3)) + push
        end do
      end do
    end associate
  end subroutine pull_membranes

  !> Deformation gradient and Green's strain of triangle k.
  pure subroutine strain_of(s, k, f, strain)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: f(3, 2), strain(2, 2)
    real(wp) :: e(3, 2)
    e(:, 1) = s%mesh%x(:, s%mesh%corner(2, k)) - s%mesh%x(:, s%mesh%corner(1, k))
    e(:, 2) = s%mesh%x(:, s%mesh%corner(3, k)) - s%mesh%x(:, s%mesh%corner(1, k))
    f = matmul(e, s%membranes%inverse(:, :, k))
    strain = 0.5_wp*matmul(transpose(f), f)
    strain(1, 1) = strain(1, 1) - 0.5_wp
    strain(2, 2) = strain(2, 2) - 0.5_wp
  end subroutine strain_of

  !> Largest principal stretch of a strain [-].
  pure real(wp) function largest_stretch(strain) result(stretch)
    real(wp), intent(in) :: strain(2, 2)
    real(wp) :: mean, half
    mean = 0.5_wp*(strain(1, 1) + strain(2, 2))
    half = sqrt(0.25_wp*(strain(1, 1) - strain(2, 2))**2 + strain(1, 2)**2)
    stretch = sqrt(max(1.0_wp + 2.0_wp*(mean + half), 0.0_wp))
  end function largest_stretch

  !> Kinetic energy of the corners that are not held, its part that the leapfrog staggers, and the
  !! energy of the stretch [J].
  pure function membranes_energy(s, step) result(part)
    type(dem_surfaces_type), intent(in) :: s
    type(motion_type), intent(in) :: step
    real(wp) :: part(3), force(3), f(3, 2), strain(2, 2)
    integer(i4) :: b, k

    part = 0.0_wp
    if (.not. s%counted) return
    associate (m => s%membranes)
      do b = 1, s%n
        if (s%kind(b) /= surface_membrane) cycle
        do k = s%first_vertex(b), s%first_vertex(b + 1) - 1
          if (m%wall(k) >= 0) cycle
          force = corner_load(s, k) + m%press(:, k) + m%pull(:, k) &
                  + m%mass(k)*(step%gravity - m%damping(b)*s%mesh%v(:, k))
          part(1) = part(1) + 0.5_wp*m%mass(k)*sum(s%mesh%v(:, k)**2)
          part(2) = part(2) + step%dt**2/8.0_wp*sum(force**2)/m%mass(k)
        end do
        do k = s%first_triangle(b), s%first_triangle(b + 1) - 1
          call strain_of(s, k, f, strain)
          part(3) = part(3) + 0.5_wp*m%area(k)*m%modulus(b) &
            *((1.0_wp - m%poisson(b))*sum(strain**2) &
              + m%poisson(b)*(strain(1, 1) + strain(2, 2))**2)
        end do
      end do
    end associate
  end function membranes_energy

  !> Stiffness that the contacts of this rank's grains give to the corners of membranes, from the
  !! first one on [N/m].
  function corner_stiffness(d) result(stiffness)
    type(dem_data_type), intent(in) :: d
    real(wp), allocatable :: stiffness(:)
    integer(i4) :: b
    allocate (stiffness(0))
    do b = 1, d%surfaces%n
      if (d%surfaces%kind(b) == surface_membrane) stiffness = [stiffness, vertex_stiffness(d, b)]
    end do
  end function corner_stiffness

  !> Largest row sum of a corner over its mass, of stretch and contacts [1/s^2].
  pure real(wp) function membrane_rate(s, stiffness) result(rate)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: stiffness(:)  !! of all contacts, see corner_stiffness
    real(wp), allocatable :: row(:)
    integer(i4) :: b, k, low, first

    rate = 0.0_wp
    first = first_corner(s)
    do b = 1, s%n
      if (s%kind(b) /= surface_membrane) cycle
      low = s%first_vertex(b)
      row = 2.0_wp*stiffness(low - first + 1:s%first_vertex(b + 1) - first)
      call add_stretch_rows(s, b, row)
      do k = low, s%first_vertex(b + 1) - 1
        if (s%membranes%wall(k) < 0) rate = max(rate, row(k - low + 1)/s%membranes%mass(k))
      end do
    end do
  end function membrane_rate

  !> Row sums of the stretch of membrane b.
  pure subroutine add_stretch_rows(s, b, row)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(inout) :: row(:)  !! of its corners [N/m]
    real(wp) :: slope(3)
    integer(i4) :: k

    do k = s%first_triangle(b), s%first_triangle(b + 1) - 1
      associate (m => s%membranes, g => s%membranes%inverse(:, :, k), &
                 c => s%mesh%corner(:, k) - s%first_vertex(b) + 1)
        slope(2:3) = sqrt(sum(g**2, 2))
        slope(1) = sqrt(sum(sum(g, 1)**2))
        row(c) = row(c) + m%modulus(b)*m%area(k)*slope*sum(slope)*m%stretch(b)**2
      end associate
    end do
  end subroutine add_stretch_rows

  !> A membrane that was stretched beyond its limit has torn (N207); one that is too fine for a
  !! grain (N208).
  subroutine check_membranes(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: b

    if (.not. allocated(d%surfaces%membranes)) return
    associate (m => d%surfaces%membranes)
      do b = 1, d%surfaces%n
        if (d%surfaces%kind(b) /= surface_membrane) cycle
        if (m%stretch(b) <= m%limit(b)) cycle
        call errors%add('N207', "membrane '"//d%surfaces%name(b)%s//"' has torn: it was "// &
                        'stretched to '//short_number(m%stretch(b))//' of its length, its '// &
                        'limit is '//short_number(m%limit(b)), 'step '//str(d%health%steps), &
                        'less pressure, a stiffer or finer membrane, or a larger stretch_limit '// &
                        'if the material bears it')
      end do
      if (errors%any() .or. d%surfaces%list%near == 0) return
      b = maxloc(d%surfaces%list%contacts, 1)
      if (d%surfaces%list%contacts(b) < d%surfaces%list%slots) return
      call errors%add('N208', 'grain '//str(d%grains%id(d%surfaces%list%near_grain(b)))// &
                      ' touches '//str(d%surfaces%list%contacts(b))// &
                      ' faces, edges and corners of membranes, more than there is room for', &
                      'step '//str(d%health%steps), 'larger triangles')
    end associate
  end subroutine check_membranes
end module dem_membrane
