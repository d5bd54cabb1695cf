!> Shape functions and quadrature of every kind: partition of unity, Kronecker delta, derivatives by
!! differences, completeness, outward faces, rules exact for all monomials of their degree.
program test_fem_shape
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use fem_shape, only: shape_functions, kinds, solid_kinds, node_count, corner_count, corner_kind, &
    kind_name, kind_of_name, dimension_of, face_count, face_kind, face_nodes, edge_count, &
    edge_nodes, reference_nodes, is_quadratic, most_nodes, most_facet_nodes, &
    hex8, hex20, hex27, tet4, tet10, wedge6, quad4, quad8, quad9, tri3, tri6
  use fem_quadrature, only: quadrature_rule, full_degree, mass_degree, fem_rule_type, tabulate
  implicit none
  type(test_type) :: test
  integer(i4) :: kind

  do kind = 1, kinds
    call check_functions(kind)
    call check_completeness(kind)
    call check_rules(kind)
    call check_edges(kind)
    if (kind <= solid_kinds) call check_faces(kind)
  end do
  call check_counts()
  call test%finish()

contains

  !> A point inside the reference element.
  pure function inside() result(xi)
    real(wp) :: xi(3)
    xi = [0.21_wp, 0.34_wp, 0.17_wp]
  end function inside

  subroutine check_functions(kind)
    integer(i4), intent(in) :: kind
    real(wp), dimension(node_count(kind)) :: n, plus, minus
    real(wp), dimension(dimension_of(kind), node_count(kind)) :: dn, other
    real(wp) :: xi(dimension_of(kind)), node(dimension_of(kind), node_count(kind)), p(3)
    real(wp), parameter :: h = 1.0e-4_wp
    integer(i4) :: a, i

    p = inside()
    xi = p(:dimension_of(kind))
    call shape_functions(kind, xi, n, dn)
    call test%check_close(kind_name(kind)//': partition of unity', sum(n), 1.0_wp, 1.0e-14_wp)
    call test%check(kind_name(kind)//': derivatives of unity', &
                    max_abs(sum(dn, dim=2)) < 1.0e-14_wp)
    do i = 1, size(xi)
      p(:size(xi)) = xi
      p(i) = xi(i) + h
      call shape_functions(kind, p(:size(xi)), plus, other)
      p(i) = xi(i) - h
      call shape_functions(kind, p(:size(xi)), minus, other)
      ! at most cubic along a line: the error of the central difference is h^2 times its coefficient
      call test%check(kind_name(kind)//': derivatives by differences', &
                      max_abs((plus - minus)/(2.0_wp*h) - dn(i, :)) < 1.0e-8_wp)
    end do
    node = reference_nodes(kind)
    do a = 1, node_count(kind)
      call shape_functions(kind, node(:, a), n, dn)
      n(a) = n(a) - 1.0_wp
      call test%check(kind_name(kind)//': one at its node, zero at others', &
                      max_abs(n) < 1.0e-14_wp)
    end do
  end subroutine check_functions

  !> Linear fields, quadratic ones of quadratic kinds, are reproduced with their gradients.
  subroutine check_completeness(kind)
    integer(i4), intent(in) :: kind
    real(wp) :: n(node_count(kind)), dn(dimension_of(kind), node_count(kind))
    real(wp) :: value(node_count(kind)), xi(dimension_of(kind)), p(3)
    real(wp) :: node(dimension_of(kind), node_count(kind)), gradient(dimension_of(kind))
    real(wp) :: slope(dimension_of(kind)), bend(dimension_of(kind), dimension_of(kind))
    integer(i4) :: a, d, i, j

    d = dimension_of(kind)
    p = inside()
    xi = p(:d)
    do j = 1, d
      slope(j) = 0.7_wp - 0.4_wp*j
      do i = 1, d
        bend(i, j) = merge(0.3_wp + 0.2_wp*(i + j) - 0.5_wp*i*j, 0.0_wp, is_quadratic(kind))
      end do
    end do
    node = reference_nodes(kind)
    do a = 1, size(n)
      value(a) = 1.5_wp + sum(slope*node(:, a)) + sum(node(:, a)*matmul(bend, node(:, a)))
    end do
    call shape_functions(kind, xi, n, dn)
    gradient = slope + 2.0_wp*matmul(bend, xi)
    call test%check_close(kind_name(kind)//': complete field', sum(n*value), &
                          1.5_wp + sum(slope*xi) + sum(xi*matmul(bend, xi)), 1.0e-14_wp)
    call test%check(kind_name(kind)//': its gradient', &
                    max_abs(matmul(dn, value) - gradient) < 1.0e-14_wp)
  end subroutine check_completeness

  !> All monomials up to the degree of the rule, against their exact integrals.
  subroutine check_rules(kind)
    integer(i4), intent(in) :: kind
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4) :: degree, most
    type(fem_rule_type) :: rule

    most = merge(7, 5, any(kind == [hex8, hex20, hex27, quad4, quad8, quad9]))
    do degree = 0, most
      call quadrature_rule(kind, degree, points, weights)
      call test%check_close(kind_name(kind)//': rule exact', &
                            worst_monomial(kind, degree, points, weights), 0.0_wp, 2.0e-15_wp)
      call test%check(kind_name(kind)//': weights positive', all(weights > 0.0_wp))
    end do
    call tabulate(kind, full_degree(kind), rule)
    call test%check_close(kind_name(kind)//': volume', sum(rule%weight), exact(kind, [0, 0, 0]), &
                          1.0e-14_wp)
    call test%check(kind_name(kind)//': tables', &
                    max_abs(sum(rule%n, dim=1) - 1.0_wp) < 1.0e-14_wp &
                    .and. mass_degree(kind) >= full_degree(kind))
  end subroutine check_rules

  !> Largest error of a rule over the monomials up to a degree.
  real(wp) function worst_monomial(kind, degree, points, weights) result(worst)
    integer(i4), intent(in) :: kind, degree
    real(wp), intent(in) :: points(:, :), weights(:)
    integer(i4) :: i, j, k, d
    real(wp) :: value

    d = dimension_of(kind)
    worst = 0.0_wp
    do k = 0, merge(degree, 0, d == 3)
      do j = 0, degree - k
        do i = 0, degree - k - j
          value = sum(weights*points(1, :)**i*points(2, :)**j*points(d, :)**k)
          worst = larger(worst, abs(value - exact(kind, [i, j, k])))
        end do
      end do
    end do
  end function worst_monomial

  !> Integral of x^p1 y^p2 z^p3 over the reference element.
  pure real(wp) function exact(kind, p)
    integer(i4), intent(in) :: kind, p(3)
    select case (kind)
    case (hex8, hex20, hex27)
      exact = line(p(1))*line(p(2))*line(p(3))
    case (quad4, quad8, quad9)
      exact = line(p(1))*line(p(2))
    case (tet4, tet10)
      exact = gamma(p(1) + 1.0_wp)*gamma(p(2) + 1.0_wp)*gamma(p(3) + 1.0_wp)/gamma(sum(p) + 4.0_wp)
    case (tri3, tri6)
      exact = gamma(p(1) + 1.0_wp)*gamma(p(2) + 1.0_wp)/gamma(sum(p) + 3.0_wp)
    case default
      exact = line(p(3))*gamma(p(1) + 1.0_wp)*gamma(p(2) + 1.0_wp)/gamma(p(1) + p(2) + 3.0_wp)
    end select
  end function exact

  pure real(wp) function line(p)
    integer(i4), intent(in) :: p
    line = merge(2.0_wp/(p + 1), 0.0_wp, mod(p, 2) == 0)
  end function line

  !> Middles of edges lie in the middle of their ends.
  subroutine check_edges(kind)
    integer(i4), intent(in) :: kind
    real(wp) :: node(dimension_of(kind), node_count(kind))
    integer(i4) :: e
    integer(i4), allocatable :: ends(:)
    node = reference_nodes(kind)
    do e = 1, edge_count(kind)
      ends = edge_nodes(kind, e)
      call test%check(kind_name(kind)//': ends of edges are corners', &
                      all(ends(:2) <= corner_count(kind)))
      if (size(ends) == 3) &
        call test%check(kind_name(kind)//': middle of an edge', &
                        max_abs(node(:, ends(3)) - 0.5_wp*(node(:, ends(1)) &
                        + node(:, ends(2)))) < 1.0e-14_wp)
    end do
  end subroutine check_edges

  !> The faces close, point outward and enclose the volume: integral of x . n = 3 V.
  subroutine check_faces(kind)
    integer(i4), intent(in) :: kind
    real(wp) :: node(3, node_count(kind)), n(most_facet_nodes), dn(2, most_facet_nodes)
    real(wp) :: centre(3), t(3, 2), area(3), total(3), volume, x(3)
    real(wp), allocatable :: points(:, :), weights(:)
    integer(i4), allocatable :: local(:)
    integer(i4) :: f, q, m, of

    node = reference_nodes(kind)
    centre = sum(node, dim=2)/size(node, 2)
    total = 0.0_wp
    volume = 0.0_wp
    do f = 1, face_count(kind)
      local = face_nodes(kind, f)
      of = face_kind(kind, f)
      m = node_count(of)
      call test%check(kind_name(kind)//': nodes of a face', size(local) == m)
      call quadrature_rule(of, full_degree(of), points, weights)
      do q = 1, size(weights)
        call shape_functions(of, points(:, q), n(:m), dn(:, :m))
        x = matmul(node(:, local), n(:m))
        t = matmul(node(:, local), transpose(dn(:, :m)))
        area = [t(2, 1)*t(3, 2) - t(3, 1)*t(2, 2), t(3, 1)*t(1, 2) - t(1, 1)*t(3, 2), &
                t(1, 1)*t(2, 2) - t(2, 1)*t(1, 2)]
        call test%check(kind_name(kind)//': face outward', dot_product(x - centre, area) > 0.0_wp)
        total = total + weights(q)*area
        volume = volume + weights(q)*dot_product(x, area)/3.0_wp
      end do
    end do
    call test%check(kind_name(kind)//': surface closed', max_abs(total) < 1.0e-14_wp)
    call test%check_close(kind_name(kind)//': volume inside the faces', volume, &
                          exact(kind, [0, 0, 0]), 1.0e-14_wp)
  end subroutine check_faces

  subroutine check_counts()
    integer(i4) :: k
    do k = 1, kinds
      call test%check('name of '//kind_name(k), kind_of_name(kind_name(k)) == k)
      call test%check('corners of '//kind_name(k), &
                      node_count(corner_kind(k)) == corner_count(k) &
                      .and. node_count(k) <= most_nodes)
    end do
    call test%check('no such kind', kind_of_name('hex9') == 0)
    call test%check('corners alone', corner_kind(hex27) == hex8 .and. corner_kind(tet10) == tet4 &
                    .and. corner_kind(tri6) == tri3 .and. corner_kind(wedge6) == wedge6)
    call test%check('counts', all([node_count(tet4), node_count(tri3)] == [4, 3]))
  end subroutine check_counts
end program test_fem_shape
