!> Shape functions of all kinds of elements and facets (fem_kinds) and their natural derivatives.
module fem_shape
  use talus_kinds, only: wp, i4
  use fem_kinds, only: hex8, hex20, hex27, tet4, tet10, wedge6, quad4, quad8, quad9, tri3, tri6, &
    node_count, corner_count, corner_kind, kind_name, kind_of_name, dimension_of, face_count, &
    face_kind, face_nodes, edge_count, edge_nodes, reference_nodes, is_quadratic, most_nodes, &
    most_facet_nodes, most_faces, kinds, solid_kinds, first_facet
  implicit none
  private
  public :: shape_functions
  public :: hex8, hex20, hex27, tet4, tet10, wedge6, quad4, quad8, quad9, tri3, tri6
  public :: node_count, corner_count, corner_kind, kind_name, kind_of_name, dimension_of
  public :: face_count, face_kind, face_nodes, edge_count, edge_nodes, reference_nodes
  public :: is_quadratic, most_nodes, most_facet_nodes, most_faces, kinds, solid_kinds, first_facet

contains

  !> Shape functions n(nodes) and their derivatives dn(dimension, nodes) at natural coordinates xi.
  pure subroutine shape_functions(kind, xi, n, dn)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(:)
    real(wp), intent(out) :: n(:), dn(:, :)
    select case (kind)
    case (hex8, hex27, quad4, quad9)
      call lagrange(reference_nodes(kind), is_quadratic(kind), xi, n, dn)
    case (hex20, quad8)
      call serendipity(reference_nodes(kind), xi, n, dn)
    case (tet4, tri3)
      call barycentric(xi, n, dn)
    case (tet10, tri6)
      call quadratic_simplex(kind, xi, n, dn)
    case (wedge6)
      call prism(xi, n, dn)
    case default
      error stop 'bug: no such kind of element'
    end select
  end subroutine shape_functions

  !> Products of linear or quadratic Lagrange polynomials, one a direction.
  pure subroutine lagrange(node, quadratic, xi, n, dn)
    real(wp), intent(in) :: node(:, :), xi(:)
    logical, intent(in) :: quadratic
    real(wp), intent(out) :: n(:), dn(:, :)
    real(wp) :: f(size(xi)), d(size(xi))
    integer(i4) :: a, i
    do a = 1, size(node, 2)
      do i = 1, size(xi)
        if (.not. quadratic) then
          f(i) = 0.5_wp*(1.0_wp + xi(i)*node(i, a))
          d(i) = 0.5_wp*node(i, a)
        else if (abs(node(i, a)) > 0.5_wp) then
          f(i) = 0.5_wp*xi(i)*(xi(i) + node(i, a))
          d(i) = xi(i) + 0.5_wp*node(i, a)
        else
          f(i) = 1.0_wp - xi(i)**2
          d(i) = -2.0_wp*xi(i)
        end if
      end do
      n(a) = product(f)
      do i = 1, size(xi)
        dn(i, a) = d(i)*product(f(:i - 1))*product(f(i + 1:))
      end do
    end do
  end subroutine lagrange

  !> Quadratic serendipity functions: corners, and middles of edges.
  pure subroutine serendipity(node, xi, n, dn)
    real(wp), intent(in) :: node(:, :), xi(:)
    real(wp), intent(out) :: n(:), dn(:, :)
    real(wp) :: f(size(xi)), d(size(xi)), sum_term, scale
    integer(i4) :: a, i, m
    m = size(xi)
    do a = 1, size(node, 2)
      where (abs(node(:, a)) > 0.5_wp)
        f = 1.0_wp + xi*node(:, a)
        d = node(:, a)
      elsewhere
        f = 1.0_wp - xi**2
        d = -2.0_wp*xi
      end where
      if (all(abs(node(:, a)) > 0.5_wp)) then
        scale = 0.5_wp**m
        sum_term = sum(xi*node(:, a)) - real(m - 1, wp)
        n(a) = scale*product(f)*sum_term
        do i = 1, m
          dn(i, a) = scale*node(i, a)*product(f(:i - 1))*product(f(i + 1:))*(sum_term + f(i))
        end do
      else
        scale = 0.5_wp**(m - 1)
        n(a) = scale*product(f)
        do i = 1, m
          dn(i, a) = scale*d(i)*product(f(:i - 1))*product(f(i + 1:))
        end do
      end if
    end do
  end subroutine serendipity

  !> Barycentric coordinates of the unit simplex.
  pure subroutine barycentric(xi, n, dn)
    real(wp), intent(in) :: xi(:)
    real(wp), intent(out) :: n(:), dn(:, :)
    integer(i4) :: i
    n(1) = 1.0_wp - sum(xi)
    dn = 0.0_wp
    dn(:, 1) = -1.0_wp
    do i = 1, size(xi)
      n(i + 1) = xi(i)
      dn(i, i + 1) = 1.0_wp
    end do
  end subroutine barycentric

  !> Corners l (2 l - 1), middles of edges 4 l_i l_j.
  pure subroutine quadratic_simplex(kind, xi, n, dn)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(:)
    real(wp), intent(out) :: n(:), dn(:, :)
    real(wp) :: l(size(xi) + 1), dl(size(xi), size(xi) + 1)
    integer(i4) :: a, e, node(3)
    call barycentric(xi, l, dl)
    do a = 1, size(l)
      n(a) = l(a)*(2.0_wp*l(a) - 1.0_wp)
      dn(:, a) = (4.0_wp*l(a) - 1.0_wp)*dl(:, a)
    end do
    do e = 1, edge_count(kind)
      node = edge_nodes(kind, e)
      n(node(3)) = 4.0_wp*l(node(1))*l(node(2))
      dn(:, node(3)) = 4.0_wp*(dl(:, node(1))*l(node(2)) + l(node(1))*dl(:, node(2)))
    end do
  end subroutine quadratic_simplex

  !> Linear triangle times linear line.
  pure subroutine prism(xi, n, dn)
    real(wp), intent(in) :: xi(:)
    real(wp), intent(out) :: n(:), dn(:, :)
    real(wp) :: l(3), dl(2, 3), below, above
    integer(i4) :: a
    call barycentric(xi(:2), l, dl)
    below = 0.5_wp*(1.0_wp - xi(3))
    above = 0.5_wp*(1.0_wp + xi(3))
    do a = 1, 3
      n(a) = l(a)*below
      n(a + 3) = l(a)*above
      dn(:2, a) = dl(:, a)*below
      dn(:2, a + 3) = dl(:, a)*above
      dn(3, a) = -0.5_wp*l(a)
      dn(3, a + 3) = 0.5_wp*l(a)
    end do
  end subroutine prism
end module fem_shape
