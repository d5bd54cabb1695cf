!> Shape functions of facets: tri3, quad4, tri6, quad8, quad9, by their number of nodes.
!!
!! Nodes in the order of the files: corners, then middles of the edges 12, 23, ..., then the centre.
!! Natural coordinates of quadrilaterals go from -1 to 1, those of triangles from 0 to 1 with
!! xi + eta <= 1.
module cpl_shapes
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: most_nodes, node_count, corner_count, is_facet, shapes, shapes_at, centre_of, inside, &
    nearest_inside

  integer(i4), parameter :: most_nodes = 9
  integer(i4), parameter :: known(5) = [3, 4, 6, 8, 9]
  integer(i4), parameter :: place(2, 9) = reshape( &
    [1, 1, 2, 1, 2, 2, 1, 2, 3, 1, 2, 3, 3, 2, 1, 3, 3, 3], [2, 9])  !! of quad9 in the product

contains

  !> Nodes of a facet whose list is filled up with zeros.
  pure integer(i4) function node_count(nodes)
    integer(i4), intent(in) :: nodes(:)
    node_count = count(nodes /= 0)
  end function node_count

  pure logical function is_facet(nodes)
    integer(i4), intent(in) :: nodes(:)
    is_facet = any(known == node_count(nodes))
    if (is_facet) is_facet = all(nodes(:node_count(nodes)) /= 0)
  end function is_facet

  pure integer(i4) function corner_count(n)
    integer(i4), intent(in) :: n  !! nodes
    corner_count = merge(3, 4, n == 3 .or. n == 6)
  end function corner_count

  !> Functions of a facet of n nodes alone.
  pure function shapes_at(n, natural) result(value)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: natural(2)
    real(wp) :: value(n), slope(2, n), bend(3, n)
    call shapes(n, natural, value, slope, bend)
  end function shapes_at

  !> Functions of a facet of n nodes, their slopes along xi and eta, and their second derivatives
  !! (xi xi, xi eta, eta eta).
  pure subroutine shapes(n, natural, value, slope, bend)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: natural(2)
    real(wp), intent(out) :: value(n), slope(2, n), bend(3, n)
    select case (n)
    case (3)
      value = [1.0_wp - natural(1) - natural(2), natural]
      slope = reshape([-1.0_wp, -1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 3])
      bend = 0.0_wp
    case (6)
      call triangle(natural, value, slope, bend)
    case default
      call quadrilateral(n, natural, value, slope, bend)
    end select
  end subroutine shapes

  !> Six nodes, of the areas l: l (2 l - 1) at corners, 4 l m at the middles.
  pure subroutine triangle(natural, value, slope, bend)
    real(wp), intent(in) :: natural(2)
    real(wp), intent(out) :: value(6), slope(2, 6), bend(3, 6)
    real(wp), parameter :: rise(2, 3) = reshape([-1.0_wp, -1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
                                                 1.0_wp], [2, 3])
    real(wp) :: l(3)
    integer(i4) :: a, b
    l = [1.0_wp - natural(1) - natural(2), natural]
    do a = 1, 3
      b = 1 + mod(a, 3)
      value(a) = l(a)*(2.0_wp*l(a) - 1.0_wp)
      slope(:, a) = (4.0_wp*l(a) - 1.0_wp)*rise(:, a)
      bend(:, a) = 4.0_wp*[rise(1, a)**2, rise(1, a)*rise(2, a), rise(2, a)**2]
      value(3 + a) = 4.0_wp*l(a)*l(b)
      slope(:, 3 + a) = 4.0_wp*(l(a)*rise(:, b) + l(b)*rise(:, a))
      bend(:, 3 + a) = 4.0_wp*[2.0_wp*rise(1, a)*rise(1, b), rise(1, a)*rise(2, b) &
                               + rise(2, a)*rise(1, b), 2.0_wp*rise(2, a)*rise(2, b)]
    end do
  end subroutine triangle

  !> Products of polynomials of one coordinate; the eight nodes' functions are those of nine with
  !! the centre's shared out.
  pure subroutine quadrilateral(n, natural, value, slope, bend)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: natural(2)
    real(wp), intent(out) :: value(n), slope(2, n), bend(3, n)
    real(wp), parameter :: share(8) = [-0.25_wp, -0.25_wp, -0.25_wp, -0.25_wp, 0.5_wp, 0.5_wp, &
                                       0.5_wp, 0.5_wp]
    real(wp) :: l(3, 2), d(3, 2), c(3, 2), all_n(9), all_s(2, 9), all_b(3, 9)
    integer(i4) :: a, i, j
    do i = 1, 2
      associate (s => natural(i))
        if (n == 4) then
          l(:, i) = [0.5_wp*(1.0_wp - s), 0.5_wp*(1.0_wp + s), 0.0_wp]
          d(:, i) = [-0.5_wp, 0.5_wp, 0.0_wp]
          c(:, i) = 0.0_wp
        else
          l(:, i) = [0.5_wp*s*(s - 1.0_wp), 0.5_wp*s*(s + 1.0_wp), 1.0_wp - s*s]
          d(:, i) = [s - 0.5_wp, s + 0.5_wp, -2.0_wp*s]
          c(:, i) = [1.0_wp, 1.0_wp, -2.0_wp]
        end if
      end associate
    end do
    do a = 1, 9
      i = place(1, a)
      j = place(2, a)
      all_n(a) = l(i, 1)*l(j, 2)
      all_s(:, a) = [d(i, 1)*l(j, 2), l(i, 1)*d(j, 2)]
      all_b(:, a) = [c(i, 1)*l(j, 2), d(i, 1)*d(j, 2), l(i, 1)*c(j, 2)]
    end do
    value = all_n(:n)
    slope = all_s(:, :n)
    bend = all_b(:, :n)
    if (n /= 8) return
    do a = 1, 8
      value(a) = value(a) + share(a)*all_n(9)
      slope(:, a) = slope(:, a) + share(a)*all_s(:, 9)
      bend(:, a) = bend(:, a) + share(a)*all_b(:, 9)
    end do
  end subroutine quadrilateral

  !> Natural coordinates of the middle.
  pure function centre_of(n) result(natural)
    integer(i4), intent(in) :: n
    real(wp) :: natural(2)
    natural = merge(1.0_wp/3.0_wp, 0.0_wp, corner_count(n) == 3)
  end function centre_of

  !> Is a place on the facet, its rim widened by some of the natural coordinates?
  pure logical function inside(n, natural, rim)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: natural(2), rim
    if (corner_count(n) == 3) then
      inside = all(natural >= -rim) .and. sum(natural) <= 1.0_wp + rim
    else
      inside = all(abs(natural) <= 1.0_wp + rim)
    end if
  end function inside

  !> A place drawn back to the facet.
  pure function nearest_inside(n, natural) result(back)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: natural(2)
    real(wp) :: back(2)
    if (corner_count(n) == 3) then
      back = max(0.0_wp, natural)
      if (sum(back) > 1.0_wp) back = back/sum(back)
    else
      back = max(-1.0_wp, min(1.0_wp, natural))
    end if
  end function nearest_inside
end module cpl_shapes
