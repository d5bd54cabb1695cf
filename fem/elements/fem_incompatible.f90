!> Stress of hexahedra with incompatible modes: what the modes 1 - xi_i^2 add to it. They have the
!! amplitudes for which no work is done on them; the stiffness has them condensed (fem_batch).
module fem_incompatible
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use fem_hex8, only: hex8_geometry_type, hex8_points
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: add_mode_stress, mode_gradients

  integer(i4), parameter :: n = 9  !! amplitudes: three modes of three components

contains

  !> Gradients (3, modes, points) of the modes by the Jacobian of the centre, times j0/j [1/m].
  pure subroutine mode_gradients(rule, x, geometry, g)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(3, 8)   !! [m]
    type(hex8_geometry_type), intent(in) :: geometry
    real(wp), intent(out) :: g(3, 3, hex8_points)
    real(wp) :: t(3, 3), r(3, 3)
    integer(i4) :: a, q
    t = matmul(x, transpose(rule%centre_slope))
    r(:, 1) = cross(t(:, 2), t(:, 3))  ! Jacobian times gradients of the natural coordinates
    r(:, 2) = cross(t(:, 3), t(:, 1))
    r(:, 3) = cross(t(:, 1), t(:, 2))
    do q = 1, hex8_points
      do a = 1, 3
        g(:, a, q) = r(:, a)*rule%mode_slope(a, q)/geometry%weight(q)
      end do
    end do
  end subroutine mode_gradients

  !> Add the stress of the modes to that of the nodes, xx yy zz xy yz zx [Pa].
  pure subroutine add_mode_stress(rule, x, geometry, lame, factor, stress)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(3, 8)
    type(hex8_geometry_type), intent(in) :: geometry
    real(wp), intent(in) :: lame(2)    !! lambda, mu [Pa]
    real(wp), intent(in) :: factor(hex8_points)
    real(wp), intent(inout) :: stress(6, hex8_points)
    real(wp) :: g(3, 3, hex8_points), k(n, n), r(n), h(3, 3), s(3, 3), w, trace
    integer(i4) :: a, b, i, q

    if (.not. any(abs(factor) > 0.0_wp)) return  ! no energy, nothing to release
    call mode_gradients(rule, x, geometry, g)
    k = 0.0_wp
    r = 0.0_wp
    do q = 1, hex8_points
      w = geometry%weight(q)*factor(q)
      s = reshape(stress([1, 4, 6, 4, 2, 5, 6, 5, 3], q), [3, 3])
      do b = 1, 3
        r(3*b - 2:3*b) = r(3*b - 2:3*b) - w*matmul(s, g(:, b, q))
        do a = 1, 3
          do i = 1, 3
            k(3*a - 2:3*a, 3*b - 3 + i) = k(3*a - 2:3*a, 3*b - 3 + i) + w*( &
              lame(1)*g(:, a, q)*g(i, b, q) + lame(2)*g(:, b, q)*g(i, a, q))
            k(3*a - 3 + i, 3*b - 3 + i) = k(3*a - 3 + i, 3*b - 3 + i) &
              + w*lame(2)*dot_product(g(:, a, q), g(:, b, q))
          end do
        end do
      end do
    end do
    call solve(k, r)
    do q = 1, hex8_points
      h = matmul(reshape(r, [3, 3]), transpose(g(:, :, q)))
      trace = lame(1)*(h(1, 1) + h(2, 2) + h(3, 3))
      stress(:, q) = stress(:, q) + lame(2)*[2.0_wp*h(1, 1), 2.0_wp*h(2, 2), 2.0_wp*h(3, 3), &
        h(1, 2) + h(2, 1), h(2, 3) + h(3, 2), h(3, 1) + h(1, 3)]
      stress(:3, q) = stress(:3, q) + trace
    end do
  end subroutine add_mode_stress

  !> Solve k x = r for a symmetric positive matrix by elimination; r becomes x.
  pure subroutine solve(k, r)
    real(wp), intent(inout) :: k(n, n), r(n)
    integer(i4) :: i, j
    do i = 1, n
      do j = i + 1, n
        r(j) = r(j) - k(j, i)/k(i, i)*r(i)
        k(j, i + 1:) = k(j, i + 1:) - k(j, i)/k(i, i)*k(i, i + 1:)
      end do
    end do
    do i = n, 1, -1
      r(i) = (r(i) - dot_product(k(i, i + 1:), r(i + 1:)))/k(i, i)
    end do
  end subroutine solve
end module fem_incompatible
