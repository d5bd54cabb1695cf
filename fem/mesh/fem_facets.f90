!> Geometry of facets of all kinds: points, area vectors, the natural coordinates of a position.
module fem_facets
  use talus_kinds, only: wp, i4
  use fem_shape, only: shape_functions, reference_nodes, node_count, corner_count, corner_kind, &
    most_facet_nodes, tri3, tri6
  implicit none
  private
  public :: facet_point, facet_tangents, locate_on_facet

contains

  !> Shape functions n(nodes) and area vector (normal times area element) [m^2] at natural
  !! coordinates xi of a facet with nodes x(3, nodes) [m].
  pure subroutine facet_point(kind, x, xi, n, area)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: x(:, :), xi(2)
    real(wp), intent(out) :: n(:), area(3)
    real(wp) :: d(3, 2)
    call facet_tangents(kind, x, xi, n, d)
    area = [d(2, 1)*d(3, 2) - d(3, 1)*d(2, 2), d(3, 1)*d(1, 2) - d(1, 1)*d(3, 2), &
            d(1, 1)*d(2, 2) - d(2, 1)*d(1, 2)]
  end subroutine facet_point

  !> Shape functions and the tangents dx/dxi [m].
  pure subroutine facet_tangents(kind, x, xi, n, d)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: x(:, :), xi(2)
    real(wp), intent(out) :: n(:), d(3, 2)
    real(wp) :: dn(2, most_facet_nodes)
    integer(i4) :: a
    call shape_functions(kind, xi, n, dn(:, :size(n)))
    d = 0.0_wp
    do a = 1, size(n)
      d(:, 1) = d(:, 1) + x(:, a)*dn(1, a)
      d(:, 2) = d(:, 2) + x(:, a)*dn(2, a)
    end do
  end subroutine facet_tangents

  !> Natural coordinates of the point of a facet nearest to p (Newton), and how far p is off it,
  !! distance over size. Outside the facet xi is that of its plane; `off` counts from the rim.
  pure subroutine locate_on_facet(kind, x, p, xi, off)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: x(:, :), p(3)
    real(wp), intent(out) :: xi(2), off
    integer(i4), parameter :: most = 20
    real(wp) :: node(2, corner_count(kind))
    real(wp) :: n(most_facet_nodes), d(3, 2), r(3), g(2, 2), b(2), det, step(2)
    integer(i4) :: k, m, c

    m = node_count(kind)
    c = corner_count(kind)
    node = reference_nodes(corner_kind(kind))
    xi = sum(node, dim=2)/c
    do k = 1, most
      call facet_tangents(kind, x, xi, n(:m), d)
      r = p - matmul(x(:, :m), n(:m))
      b = matmul(r, d)
      g = matmul(transpose(d), d)
      det = g(1, 1)*g(2, 2) - g(1, 2)**2
      step = [g(2, 2)*b(1) - g(1, 2)*b(2), g(1, 1)*b(2) - g(1, 2)*b(1)]/det
      xi = xi + step
      if (maxval(abs(step)) < 1.0e-12_wp) exit
    end do
    call facet_tangents(kind, x, clipped(kind, xi), n(:m), d)
    off = norm2(p - matmul(x(:, :m), n(:m)))/norm2(x(:, 3) - x(:, 1))
  end subroutine locate_on_facet

  !> Natural coordinates moved into the facet.
  pure function clipped(kind, xi) result(inside)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(2)
    real(wp) :: inside(2)
    if (kind == tri3 .or. kind == tri6) then
      inside = max(0.0_wp, xi)
      if (sum(inside) > 1.0_wp) inside = inside/sum(inside)
    else
      inside = max(-1.0_wp, min(1.0_wp, xi))
    end if
  end function clipped
end module fem_facets
