!> Quadrature rules of all kinds of elements and facets, exact for polynomials up to a degree.
!!
!! Lines: Gauss-Legendre, 1 to 4 points, degree 1, 3, 5, 7, and products of them. Triangles: 1, 3, 6
!! and 7 points, degree 1, 2, 4, 5 (Dunavant 1985). Tetrahedra: 1, 4, 14 points, degree 1, 2, 5
!! (Walkington 2000); all weights are positive. Rules of two points a direction follow the order of
!! the corner nodes; other products run fastest along the first coordinate.
module fem_quadrature
  use talus_kinds, only: wp, i4
  use fem_shape, only: hex8, hex20, hex27, tet4, tet10, wedge6, quad4, quad8, quad9, tri3, tri6, &
    node_count, dimension_of, reference_nodes, corner_kind, shape_functions
  implicit none
  private
  public :: quadrature_rule, full_degree, mass_degree, fem_rule_type, tabulate

  real(wp), parameter :: third = 1.0_wp/3.0_wp

  !> A rule with the shape functions of a kind at its points.
  type :: fem_rule_type
    integer(i4) :: kind = 0, nodes = 0, points = 0
    real(wp), allocatable :: xi(:, :)     !! (dimension, points) natural coordinates
    real(wp), allocatable :: weight(:)    !! (points)
    real(wp), allocatable :: n(:, :)      !! (nodes, points) shape functions
    real(wp), allocatable :: dn(:, :, :)  !! (dimension, nodes, points) their natural derivatives
  end type fem_rule_type

contains

  !> Degree of the usual full integration of stiffness and tractions: hex8 2 x 2 x 2, hex20 and
  !! hex27 3 x 3 x 3, tet4 1, tet10 4, wedge6 3 x 2 points. Reduced hex20: degree 3.
  pure integer(i4) function full_degree(kind)
    integer(i4), intent(in) :: kind
    select case (kind)
    case (hex8, quad4)
      full_degree = 3
    case (hex20, hex27, quad8, quad9)
      full_degree = 5
    case (tet4)
      full_degree = 1
    case (tet10, wedge6, tri3)
      full_degree = 2
    case (tri6)
      full_degree = 4
    case default
      error stop 'bug: no such kind of element'
    end select
  end function full_degree

  !> Degree that integrates products of two shape functions of elements with straight edges exactly.
  pure integer(i4) function mass_degree(kind)
    integer(i4), intent(in) :: kind
    select case (kind)
    case (tet4, tri3)
      mass_degree = 2
    case (tet10, tri6)
      mass_degree = 4
    case default
      mass_degree = full_degree(kind)
    end select
  end function mass_degree

  !> Points (dimension, q) and weights (q) of the smallest rule that is exact up to the degree.
  pure subroutine quadrature_rule(kind, degree, points, weights)
    integer(i4), intent(in) :: kind, degree
    real(wp), allocatable, intent(out) :: points(:, :), weights(:)
    select case (kind)
    case (hex8, hex20, hex27, quad4, quad8, quad9)
      call tensor_rule(kind, degree, points, weights)
    case (tet4, tet10)
      call tetrahedron_rule(degree, points, weights)
    case (tri3, tri6)
      call triangle_rule(degree, points, weights)
    case (wedge6)
      call wedge_rule(degree, points, weights)
    case default
      error stop 'bug: no such kind of element'
    end select
  end subroutine quadrature_rule

  !> Rule of a degree together with the shape functions of a kind.
  pure subroutine tabulate(kind, degree, rule)
    integer(i4), intent(in) :: kind, degree
    type(fem_rule_type), intent(out) :: rule
    integer(i4) :: q
    call quadrature_rule(kind, degree, rule%xi, rule%weight)
    rule%kind = kind
    rule%nodes = node_count(kind)
    rule%points = size(rule%weight)
    allocate (rule%n(rule%nodes, rule%points))
    allocate (rule%dn(dimension_of(kind), rule%nodes, rule%points))
    do q = 1, rule%points
      call shape_functions(kind, rule%xi(:, q), rule%n(:, q), rule%dn(:, :, q))
    end do
  end subroutine tabulate

  !> Gauss-Legendre on [-1, 1].
  pure subroutine line_rule(degree, x, w)
    integer(i4), intent(in) :: degree
    real(wp), allocatable, intent(out) :: x(:), w(:)
    real(wp) :: a, b
    select case (degree)
    case (:1)
      x = [0.0_wp]
      w = [2.0_wp]
    case (2:3)
      a = sqrt(third)
      x = [-a, a]
      w = [1.0_wp, 1.0_wp]
    case (4:5)
      a = sqrt(0.6_wp)
      x = [-a, 0.0_wp, a]
      w = [5.0_wp, 8.0_wp, 5.0_wp]/9.0_wp
    case (6:7)
      a = sqrt(3.0_wp/7.0_wp + 2.0_wp/7.0_wp*sqrt(1.2_wp))
      b = sqrt(3.0_wp/7.0_wp - 2.0_wp/7.0_wp*sqrt(1.2_wp))
      x = [-a, -b, b, a]
      w = 0.5_wp + [-1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp]*sqrt(30.0_wp)/36.0_wp
    case default
      error stop 'bug: no quadrature rule of this degree'
    end select
  end subroutine line_rule

  pure subroutine tensor_rule(kind, degree, points, weights)
    integer(i4), intent(in) :: kind, degree
    real(wp), allocatable, intent(out) :: points(:, :), weights(:)
    real(wp), allocatable :: x(:), w(:)
    integer(i4) :: d, m, q, i, place
    call line_rule(degree, x, w)
    d = dimension_of(kind)
    m = size(x)
    if (m == 2) then
      points = x(2)*reference_nodes(corner_kind(kind))
      allocate (weights(2**d), source=1.0_wp)
      return
    end if
    allocate (points(d, m**d), weights(m**d))
    do q = 1, m**d
      place = q - 1
      weights(q) = 1.0_wp
      do i = 1, d
        points(i, q) = x(1 + mod(place, m))
        weights(q) = weights(q)*w(1 + mod(place, m))
        place = place/m
      end do
    end do
  end subroutine tensor_rule

  pure subroutine triangle_rule(degree, points, weights)
    integer(i4), intent(in) :: degree
    real(wp), allocatable, intent(out) :: points(:, :), weights(:)
    select case (degree)
    case (:1)
      points = reshape([third, third], [2, 1])
      weights = [0.5_wp]
    case (2)
      points = orbit3(1.0_wp/6.0_wp)
      weights = spread(1.0_wp/6.0_wp, 1, 3)
    case (3:4)
      points = reshape([orbit3(0.445948490915964886_wp), orbit3(0.091576213509770743_wp)], [2, 6])
      weights = 0.5_wp*[spread(0.223381589678011466_wp, 1, 3), &
                        spread(0.109951743655321868_wp, 1, 3)]
    case (5)
      points = reshape([third, third, orbit3(0.470142064105115090_wp), &
                        orbit3(0.101286507323456339_wp)], [2, 7])
      weights = 0.5_wp*[0.225_wp, spread(0.132394152788506181_wp, 1, 3), &
                        spread(0.125939180544827153_wp, 1, 3)]
    case default
      error stop 'bug: no quadrature rule of this degree'
    end select
  end subroutine triangle_rule

  !> The three points (a, a), (1 - 2a, a), (a, 1 - 2a).
  pure function orbit3(a) result(x)
    real(wp), intent(in) :: a
    real(wp) :: x(2, 3)
    x = a
    x(1, 2) = 1.0_wp - 2.0_wp*a
    x(2, 3) = 1.0_wp - 2.0_wp*a
  end function orbit3

  pure subroutine tetrahedron_rule(degree, points, weights)
    integer(i4), intent(in) :: degree
    real(wp), allocatable, intent(out) :: points(:, :), weights(:)
    real(wp), parameter :: a = 0.0455037041256496494_wp, b = 0.5_wp - a
    select case (degree)
    case (:1)
      points = reshape([0.25_wp, 0.25_wp, 0.25_wp], [3, 1])
      weights = [1.0_wp/6.0_wp]
    case (2)
      points = orbit4((5.0_wp - sqrt(5.0_wp))/20.0_wp)
      weights = spread(1.0_wp/24.0_wp, 1, 4)
    case (3:5)
      points = reshape([orbit4(0.310885919263300610_wp), orbit4(0.0927352503108912264_wp), &
                        a, a, b, a, b, a, a, b, b, b, a, a, b, a, b, b, b, a], [3, 14])
      weights = [spread(0.0187813209530026418_wp, 1, 4), spread(0.0122488405193936583_wp, 1, 4), &
                 spread(0.00709100346284691107_wp, 1, 6)]
    case default
      error stop 'bug: no quadrature rule of this degree'
    end select
  end subroutine tetrahedron_rule

  !> The four points with barycentric coordinates a, a, a, 1 - 3a.
  pure function orbit4(a) result(x)
    real(wp), intent(in) :: a
    real(wp) :: x(3, 4)
    integer(i4) :: i
    x = a
    do i = 1, 3
      x(i, i + 1) = 1.0_wp - 3.0_wp*a
    end do
  end function orbit4

  !> Triangle times line.
  pure subroutine wedge_rule(degree, points, weights)
    integer(i4), intent(in) :: degree
    real(wp), allocatable, intent(out) :: points(:, :), weights(:)
    real(wp), allocatable :: flat(:, :), area(:), x(:), w(:)
    integer(i4) :: i, j, m
    call triangle_rule(degree, flat, area)
    call line_rule(degree, x, w)
    m = size(area)
    allocate (points(3, m*size(x)), weights(m*size(x)))
    do j = 1, size(x)
      do i = 1, m
        points(:, i + m*(j - 1)) = [flat(:, i), x(j)]
        weights(i + m*(j - 1)) = area(i)*w(j)
      end do
    end do
  end subroutine wedge_rule
end module fem_quadrature
