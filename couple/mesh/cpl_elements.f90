!> Volume elements of the solid as the overlap sees them: shape functions, their slopes, and where a
!! point lies in an element.
!!
!! Kinds have the numbers of the port; nodes in VTK order: corners, then middles of the edges.
!! Hexahedra span [-1, 1], tetrahedra are the unit simplex.
module cpl_elements
  use talus_kinds, only: wp, i4
  use talus_vectors, only: inverse
  implicit none
  private
  public :: hex8, hex20, tet4, tet10, most_nodes, is_known, node_count, corner_count, corner_kind
  public :: shapes, locate, inside

  integer(i4), parameter :: hex8 = 1, hex20 = 2, tet4 = 4, tet10 = 5, most_nodes = 20
  real(wp), parameter :: hex_node(3, 20) = reshape(real([ &
    -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1, &
    0, -1, -1, 1, 0, -1, 0, 1, -1, -1, 0, -1, 0, -1, 1, 1, 0, 1, 0, 1, 1, -1, 0, 1, &
    -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0], wp), [3, 20])
  integer(i4), parameter :: tet_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 1, 4, 2, 4, 3, 4], [2, 6])

contains

  pure logical function is_known(kind)
    integer(i4), intent(in) :: kind
    is_known = kind == hex8 .or. kind == hex20 .or. kind == tet4 .or. kind == tet10
  end function is_known

  pure integer(i4) function node_count(kind)
    integer(i4), intent(in) :: kind
    select case (kind)
    case (hex8)
      node_count = 8
    case (hex20)
      node_count = 20
    case (tet4)
      node_count = 4
    case default
      node_count = 10
    end select
  end function node_count

  pure integer(i4) function corner_count(kind)
    integer(i4), intent(in) :: kind
    corner_count = merge(8, 4, kind == hex8 .or. kind == hex20)
  end function corner_count

  !> The kind that the corners alone make.
  pure integer(i4) function corner_kind(kind)
    integer(i4), intent(in) :: kind
    corner_kind = merge(hex8, tet4, kind == hex8 .or. kind == hex20)
  end function corner_kind

  !> Functions n(nodes) and slopes dn(3, nodes) at natural coordinates.
  pure subroutine shapes(kind, xi, n, dn)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: n(:), dn(:, :)
    select case (kind)
    case (hex8, hex20)
      call brick(kind, xi, n, dn)
    case default
      call simplex(kind, xi, n, dn)
    end select
  end subroutine shapes

  !> Trilinear functions, or serendipity functions of 20 nodes.
  pure subroutine brick(kind, xi, n, dn)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: n(:), dn(:, :)
    real(wp) :: f(3), d(3), rest, part(3)
    integer(i4) :: a
    do a = 1, node_count(kind)
      associate (at => hex_node(:, a))
        where (abs(at) > 0.5_wp)
          f = 0.5_wp*(1.0_wp + xi*at)
          d = 0.5_wp*at
        elsewhere
          f = 1.0_wp - xi**2
          d = -2.0_wp*xi
        end where
        part = d*[f(2)*f(3), f(1)*f(3), f(1)*f(2)]
        rest = 1.0_wp
        if (kind == hex20 .and. a <= 8) then
          rest = sum(xi*at) - 2.0_wp
          part = part*rest + at*product(f)
        end if
        n(a) = product(f)*rest
        dn(:, a) = part
      end associate
    end do
  end subroutine brick

  !> Barycentric coordinates, or quadratic functions of 10 nodes.
  pure subroutine simplex(kind, xi, n, dn)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: n(:), dn(:, :)
    real(wp) :: l(4), dl(3, 4)
    integer(i4) :: a, i, j
    l = [1.0_wp - sum(xi), xi]
    dl = 0.0_wp
    dl(:, 1) = -1.0_wp
    do a = 1, 3
      dl(a, a + 1) = 1.0_wp
    end do
    if (kind == tet4) then
      n(:4) = l
      dn(:, :4) = dl
      return
    end if
    do a = 1, 4
      n(a) = l(a)*(2.0_wp*l(a) - 1.0_wp)
      dn(:, a) = (4.0_wp*l(a) - 1.0_wp)*dl(:, a)
    end do
    do a = 1, 6
      i = tet_edge(1, a)
      j = tet_edge(2, a)
      n(a + 4) = 4.0_wp*l(i)*l(j)
      dn(:, a + 4) = 4.0_wp*(dl(:, i)*l(j) + l(i)*dl(:, j))
    end do
  end subroutine simplex

  !> Natural coordinates of a point by Newton's method, and the gradients of the functions there
  !! [1/m]; found is false where the iteration does not settle.
  pure subroutine locate(kind, x_node, x, xi, n, gradient, found)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: x_node(:, :)      !! (3, nodes) [m]
    real(wp), intent(in) :: x(3)              !! [m]
    real(wp), intent(out) :: xi(3), n(:), gradient(:, :)
    logical, intent(out) :: found
    real(wp), parameter :: tight = 1.0e-13_wp, far = 10.0_wp
    integer(i4), parameter :: most_steps = 30
    real(wp) :: off(3), jacobian(3, 3), back(3, 3), change(3), dn(3, most_nodes)
    integer(i4) :: step, nodes

    nodes = node_count(kind)
    xi = merge(0.0_wp, 0.25_wp, corner_count(kind) == 8)
    found = .false.
    do step = 1, most_steps
      call shapes(kind, xi, n, dn)
      off = x - matmul(x_node, n(:nodes))
      jacobian = matmul(x_node, transpose(dn(:, :nodes)))
      back = inverse(jacobian)
      change = matmul(back, off)
      if (maxval(abs(change)) <= tight*max(1.0_wp, maxval(abs(xi)))) then
        found = .true.
        exit
      end if
      xi = xi + change
      if (maxval(abs(xi)) > far) return
    end do
    found = found .or. maxval(abs(change)) < 1.0e3_wp*tight
    gradient(:, :nodes) = matmul(transpose(back), dn(:, :nodes))
  end subroutine locate

  !> Is a point inside, or on the surface within `slack` of natural coordinates?
  pure logical function inside(kind, xi, slack)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: xi(3), slack
    if (corner_count(kind) == 8) then
      inside = all(abs(xi) <= 1.0_wp + slack)
    else
      inside = all(xi >= -slack) .and. sum(xi) <= 1.0_wp + slack
    end if
  end function inside
end module cpl_elements
