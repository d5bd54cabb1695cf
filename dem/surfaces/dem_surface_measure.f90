!> Measures of the contacts of surfaces: energy, stiffness, overlap, coordination.
module dem_surface_measure
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_kinds, only: moved_by_forces
  use dem_state, only: dem_data_type, history_side, history_root
  use dem_surface_body, only: is_free
  use dem_surface_state, only: dem_surfaces_type, surface_membrane
  use dem_contact, only: contact_constants_type, constants_of
  use dem_surface_additional, only: surface_additional_stiffness, has_own_energy, &
    has_hertz_energy, own_energy, &
    surface_stiffness => surface_base_stiffness
  implicit none
  private
  public :: vertex_stiffness, body_rows, body_rate
  public :: surface_contact_count, surface_energy, add_surface_rows, add_surface_coordination, &
    largest_surface_overlap, surface_stiffness, body_of_part

contains

  pure integer(i4) function surface_contact_count(d) result(n)
    type(dem_data_type), intent(in) :: d
    n = 0
    if (d%surfaces%list%near > 0) n = sum(d%surfaces%list%contacts)
  end function surface_contact_count

  !> Body that a part belongs to.
  pure integer(i4) function body_of_part(d, part) result(body)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: part
    body = count(d%surfaces%first_part(:d%surfaces%n) <= part)
  end function body_of_part

  !> Constants of the law of contact k of near grain g.
  pure function law_of(d, k, g) result(c)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    type(contact_constants_type) :: c
    associate (law => d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                             d%grains%material(d%surfaces%list%near_grain(g))))
      c = constants_of(law%law_numbers_type)
    end associate
  end function law_of

  !> Normal stiffness of the contacts of a soft body, shared among its vertices as their forces
  !! are [N/m].
  function vertex_stiffness(d, body) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: body
    real(wp), allocatable :: stiffness(:)
    real(wp) :: whole, sum_of, pair(2), part
    integer(i4) :: g, k, c, first, vertex

    first = d%surfaces%first_vertex(body)
    allocate (stiffness(d%surfaces%first_vertex(body + 1) - first), source=0.0_wp)
    do g = 1, d%surfaces%list%near
      whole = 0.0_wp
      do k = 1, d%surfaces%list%contacts(g)
        if (d%surfaces%list%part(k, g) /= d%surfaces%first_part(body)) cycle
        pair = surface_stiffness(d, k, g)
        whole = whole + pair(1)
      end do
      if (.not. whole > 0.0_wp) cycle
      sum_of = 0.0_wp
      do k = 3*d%surfaces%list%near_start(g) - 2, 3*d%surfaces%list%near_start(g + 1) - 3
        sum_of = sum_of + norm2(d%surfaces%list%share(:, k))
      end do
      do k = 3*d%surfaces%list%near_start(g) - 2, 3*d%surfaces%list%near_start(g + 1) - 3
        c = d%surfaces%list%candidate((k + 2)/3)
        part = norm2(d%surfaces%list%share(:, k))
        if (c <= 0 .or. .not. part > 0.0_wp) cycle
        if (d%surfaces%mesh%owner(c) /= body) cycle
        vertex = d%surfaces%mesh%corner(k - 3*((k + 2)/3 - 1), c) - first + 1
        stiffness(vertex) = stiffness(vertex) + whole*part/sum_of
      end do
    end do
  end function vertex_stiffness

  !> Stored normal and tangential energy [J].
  pure function surface_energy(d) result(energy)
    type(dem_data_type), intent(in) :: d
    real(wp) :: energy(2)
    integer(i4) :: g, k

    energy = 0.0_wp
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        call add_energy(d, k, g, energy)
      end do
    end do
  end function surface_energy

  !> That of contact k of near grain g.
  pure subroutine add_energy(d, k, g, energy)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    real(wp), intent(inout) :: energy(2)
    real(wp) :: overlap, stiffness(2), tangential, own(2)
    type(contact_constants_type) :: c

    associate (history => d%surfaces%list%history(k, :, g))
      c = law_of(d, k, g)
      stiffness = surface_stiffness(d, k, g)
      overlap = history(history_side)**2
      if (d%surfaces%list%sign(k, g) < 0.0_wp) then
        c%c = d%surfaces%list%sign(k, g)*c%c
        c%kn = d%surfaces%list%sign(k, g)*c%kn
      end if
      tangential = 0.0_wp
      if (stiffness(2) > 0.0_wp) tangential = 0.5_wp*sum(history(1:3)**2)/stiffness(2)
      own = 0.0_wp
      if (has_own_energy(d, k, g)) own = own_energy(d, k, g)
      if (has_own_energy(d, k, g)) tangential = own(2)
      if (.not. has_own_energy(d, k, g) .or. has_hertz_energy(d, k, g)) then
        energy(1) = energy(1) &
          + overlap*overlap*(c%c*history(history_root)*history(history_side) + 0.5_wp*c%kn)
      else
        energy(1) = energy(1) + own(1)
      end if
      if (d%surfaces%list%sign(k, g) < 0.0_wp) then
        energy(2) = energy(2) + d%surfaces%list%sign(k, g)*tangential
      else
        energy(2) = energy(2) + tangential
      end if
    end associate
  end subroutine add_energy

  !> Row sums of the step limit: see dem_limits; a surface counts as a prescribed partner.
  pure subroutine add_surface_rows(d, lambda)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(inout) :: lambda(:, :)  !! (2, grains)
    real(wp) :: stiffness(2), more(2), arm(3), factor
    integer(i4) :: g, k, i, b

    do g = 1, d%surfaces%list%near
      i = d%surfaces%list%near_grain(g)
      do k = 1, d%surfaces%list%contacts(g)
        if (d%surfaces%list%sign(k, g) < 0.0_wp) cycle
        stiffness = surface_stiffness(d, k, g)
        factor = 1.0_wp
        b = body_of_part(d, d%surfaces%list%part(k, g))
        if (is_free(d%surfaces, b) .or. d%surfaces%kind(b) == surface_membrane) factor = 2.0_wp
        stiffness = factor*stiffness
        arm = d%surfaces%list%point(k, :, g) - d%pairs%body(1:3, i)
        lambda(1, i) = lambda(1, i) + sum(stiffness)
        lambda(2, i) = lambda(2, i) + stiffness(2)*sum(arm**2)
        more = surface_additional_stiffness(d, k, g)
        if (any(more > 0.0_wp)) lambda(:, i) = lambda(:, i) + factor*more
      end do
    end do
  end subroutine add_surface_rows

  !> Row sums of the step limit of all bodies, with the contacts of this rank's grains: turns about
  !! x, y, z [N m] and motion [N/m].
  pure function body_rows(d) result(row)
    type(dem_data_type), intent(in) :: d
    real(wp) :: stiffness(2), more(2), arm(3), lever(3), row(4, d%surfaces%n)
    integer(i4) :: g, k, b

    row = 0.0_wp
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        b = body_of_part(d, d%surfaces%list%part(k, g))
        stiffness = surface_stiffness(d, k, g)
        more = surface_additional_stiffness(d, k, g)
        if (moved_by_forces(d%grains%kind(d%surfaces%list%near_grain(g)))) then
          stiffness = 2.0_wp*stiffness
          more = 2.0_wp*more
        end if
        arm = d%surfaces%list%point(k, :, g) - d%surfaces%list%offset(k, :, g) &
          - d%surfaces%centre(:, b)
        lever = cross(arm, d%surfaces%list%normal(k, :, g))
        row(:3, b) = row(:3, b) + stiffness(1)*lever**2 + stiffness(2)*(sum(arm**2) - arm**2)
        row(4, b) = row(4, b) + sum(stiffness)
        if (any(more > 0.0_wp)) row(:, b) = row(:, b) + [more(1)*lever**2 + more(2), more(1)]
      end do
    end do
  end function body_rows

  !> Largest row sum of a free body over its mass or inertia, as those of grains [1/s^2].
  pure real(wp) function body_rate(s, row) result(rate)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: row(:, :)  !! of all contacts, see body_rows
    integer(i4) :: a, b
    rate = 0.0_wp
    do b = 1, s%n
      if (any(s%rigid%free(:3, b) > 0.5_wp)) rate = max(rate, row(4, b)/s%rigid%mass(b))
      do a = 1, 3
        if (s%rigid%free(3 + a, b) > 0.5_wp) &
          rate = max(rate, sum(row(:3, b), mask=s%rigid%free(4:, b) > 0.5_wp)/s%rigid%inertia(a, b))
      end do
    end do
  end function body_rate

  pure subroutine add_surface_coordination(d, z)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(inout) :: z(:)
    integer(i4) :: g
    do g = 1, d%surfaces%list%near
      z(d%surfaces%list%near_grain(g)) = z(d%surfaces%list%near_grain(g)) &
        + nint(sum(d%surfaces%list%sign(:d%surfaces%list%contacts(g), g)))
    end do
  end subroutine add_surface_coordination

  !> Largest overlap over the grain's least semi-axis, if it is larger than what was found before.
  pure subroutine largest_surface_overlap(d, ratio, body, grain)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(inout) :: ratio
    integer(i4), intent(inout) :: body   !! surfaces count on after pads and planes
    integer(i4), intent(inout) :: grain
    real(wp) :: this
    integer(i4) :: g, k, i

    do g = 1, d%surfaces%list%near
      i = d%surfaces%list%near_grain(g)
      do k = 1, d%surfaces%list%contacts(g)
        this = d%surfaces%list%history(k, history_side, g)**2/minval(d%grains%axes(:, i))
        if (this <= ratio) cycle
        ratio = this
        grain = i
        body = d%grains%n + 3 + d%planes%n + body_of_part(d, d%surfaces%list%part(k, g))
      end do
    end do
  end subroutine largest_surface_overlap
end module dem_surface_measure
