!> The solid within a closed surface or a cylinder: volume, centre, moments of inertia.
module dem_surface_solid
  use talus_kinds, only: wp, i4
  use dem_surface_state, only: dem_surfaces_type, is_cylinder, is_bore, is_round
  implicit none
  private
  public :: solid_of_triangles, solid_of_body, encloses

contains

  !> Has body b an inside: triangles without free edges, or a cylinder with ends?
  pure logical function encloses(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    if (is_round(s, b)) then
      encloses = is_cylinder(s, b) .and. .not. is_bore(s, b)
      if (encloses) encloses = s%round%extent(b) < 0.1_wp*huge(1.0_wp)
    else
      encloses = all(s%mesh%mate(:, s%first_triangle(b):s%first_triangle(b + 1) - 1) > 0)
    end if
  end function encloses

  !> Volume [m^3], mass centre [m] and second moments about the origin, int x x dV [m^5], of what
  !! closed triangles enclose that turn alike: exact sums over tetrahedra from the origin.
  pure subroutine solid_of_triangles(x, corner, volume, centre, second)
    real(wp), intent(in) :: x(:, :)           !! (3, vertices) [m]
    integer(i4), intent(in) :: corner(:, :)   !! (3, triangles)
    real(wp), intent(out) :: volume, centre(3), second(3, 3)
    real(wp) :: p(3, 3), total(3), six
    integer(i4) :: t, k

    volume = 0.0_wp
    centre = 0.0_wp
    second = 0.0_wp
    do t = 1, size(corner, 2)
      p = x(:, corner(:, t))
      six = p(1, 1)*(p(2, 2)*p(3, 3) - p(3, 2)*p(2, 3)) - p(2, 1)*(p(1, 2)*p(3, 3) &
            - p(3, 2)*p(1, 3)) + p(3, 1)*(p(1, 2)*p(2, 3) - p(2, 2)*p(1, 3))
      total = sum(p, 2)
      volume = volume + six/6.0_wp
      centre = centre + six/24.0_wp*total
      second = second + six/120.0_wp*outer(total)
      do k = 1, 3
        second = second + six/120.0_wp*outer(p(:, k))
      end do
    end do
    centre = centre/volume
    second = sign(1.0_wp, volume)*second  ! triangles may all be seen from inside
    volume = abs(volume)
  end subroutine solid_of_triangles

  pure function outer(a) result(aa)
    real(wp), intent(in) :: a(3)
    real(wp) :: aa(3, 3)
    aa = spread(a, 2, 3)*spread(a, 1, 3)
  end function outer

  !> Volume of body b [m^3], its mass centre less its centre [m], and its tensor of inertia over the
  !! density, about its centre [m^5].
  pure subroutine solid_of_body(s, b, volume, away, inertia)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(out) :: volume, away(3), inertia(3, 3)
    real(wp) :: second(3, 3), axes(3, 3), length
    integer(i4) :: k, first, last, low, high

    if (is_round(s, b)) then
      length = 2.0_wp*s%round%extent(b)
      volume = acos(-1.0_wp)*s%round%radius(b)**2*length
      away = 0.0_wp
      axes = outer(s%round%axis(:, b))
      second = 0.25_wp*volume*s%round%radius(b)**2*(unit() - axes) + volume*length**2/12.0_wp*axes
    else
      first = s%first_vertex(b)
      last = s%first_vertex(b + 1) - 1
      low = s%first_triangle(b)
      high = s%first_triangle(b + 1) - 1
      call solid_of_triangles(s%mesh%rest(:, first:last), s%mesh%corner(:, low:high) - first + 1, &
                              volume, away, second)
    end if
    inertia = -second
    do k = 1, 3
      inertia(k, k) = inertia(k, k) + second(1, 1) + second(2, 2) + second(3, 3)
    end do
  end subroutine solid_of_body

  pure function unit() result(i)
    real(wp) :: i(3, 3)
    integer(i4) :: k
    i = 0.0_wp
    do k = 1, 3
      i(k, k) = 1.0_wp
    end do
  end function unit
end module dem_surface_solid
