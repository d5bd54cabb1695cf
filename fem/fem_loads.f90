!> Nodal forces of tractions; curves; springs of facets.
module fem_loads
  use talus_kinds, only: wp, i4
  use fem_types, only: fem_mesh_type, fem_curve_type, fem_springs_type
  use fem_hex8, only: quad4_shape
  implicit none
  private
  public :: traction_force, curve_value, facet_springs, facet_point

  real(wp), parameter :: g = 0.57735026918962576451_wp
  real(wp), parameter :: gauss2(2, 4) = reshape([-g, -g, g, -g, g, g, -g, g], [2, 4])

contains

  !> Point, shape functions and area vector (normal times area element) at facet coordinates.
  pure subroutine facet_point(x, xi, n, area)
    real(wp), intent(in) :: x(3, 4), xi(2)
    real(wp), intent(out) :: n(4), area(3)
    real(wp) :: d1(3), d2(3)
    n = quad4_shape(xi)
    d1 = 0.25_wp*((1.0_wp - xi(2))*(x(:, 2) - x(:, 1)) + (1.0_wp + xi(2))*(x(:, 3) - x(:, 4)))
    d2 = 0.25_wp*((1.0_wp - xi(1))*(x(:, 4) - x(:, 1)) + (1.0_wp + xi(1))*(x(:, 3) - x(:, 2)))
    area = [d1(2)*d2(3) - d1(3)*d2(2), d1(3)*d2(1) - d1(1)*d2(3), d1(1)*d2(2) - d1(2)*d2(1)]
  end subroutine facet_point

  !> Add the nodal forces of a constant traction [Pa] on facets.
  subroutine traction_force(mesh, facet, traction, force)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: facet(:, :)
    real(wp), intent(in) :: traction(3)
    real(wp), intent(inout) :: force(:, :)
    real(wp) :: n(4), area(3)
    integer(i4) :: f, q, a
    do f = 1, size(facet, 2)
      do q = 1, 4
        call facet_point(mesh%x(:, facet(:, f)), gauss2(:, q), n, area)
        do a = 1, 4
          force(:, facet(a, f)) = force(:, facet(a, f)) + n(a)*norm2(area)*traction
        end do
      end do
    end do
  end subroutine traction_force

  !> Value of a curve at time t.
  pure real(wp) function curve_value(curve, t)
    type(fem_curve_type), intent(in) :: curve
    real(wp), intent(in) :: t
    integer(i4) :: k, n
    n = size(curve%time)
    if (t <= curve%time(1)) then
      curve_value = curve%value(1)
    else if (t >= curve%time(n)) then
      curve_value = curve%value(n)
    else
      k = count(curve%time <= t)
      curve_value = curve%value(k) + (curve%value(k + 1) - curve%value(k)) &
                    *(t - curve%time(k))/(curve%time(k + 1) - curve%time(k))
    end if
  end function curve_value

  !> Springs at the Gauss points of facets from stiffnesses per area [N/m^3]; appended.
  subroutine facet_springs(mesh, facet, normal, tangential, springs)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: facet(:, :)
    real(wp), intent(in) :: normal, tangential
    type(fem_springs_type), intent(inout) :: springs
    type(fem_springs_type) :: longer
    real(wp) :: area(3), unit(3)
    integer(i4) :: f, q, s, i, j

    longer%n = springs%n + 4*size(facet, 2)
    allocate (longer%node(4, longer%n), longer%weight(4, longer%n), &
      longer%stiffness(3, 3, longer%n))
    s = springs%n
    if (s > 0) then
      longer%node(:, :s) = springs%node
      longer%weight(:, :s) = springs%weight
      longer%stiffness(:, :, :s) = springs%stiffness
    end if
    do f = 1, size(facet, 2)
      do q = 1, 4
        s = s + 1
        longer%node(:, s) = facet(:, f)
        call facet_point(mesh%x(:, facet(:, f)), gauss2(:, q), longer%weight(:, s), area)
        unit = area/norm2(area)
        do j = 1, 3
          do i = 1, 3
            longer%stiffness(i, j, s) = norm2(area)*(normal - tangential)*unit(i)*unit(j)
          end do
          longer%stiffness(j, j, s) = longer%stiffness(j, j, s) + norm2(area)*tangential
        end do
      end do
    end do
    springs = longer
  end subroutine facet_springs
end module fem_loads
