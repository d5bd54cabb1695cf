!> Weights of a ghost whose force is smeared over the facets around it.
!!
!! Coarse-graining kernel phi(r) = (1 - r^2/w^2)^2 within the width w, times a linear function of
!! the place in the tangent plane, so that the weights add up to 1 and their centre is the ghost,
!! also at the rim of the facets and with the quadrature that is used. What is left of the centre is
!! along the normal, where facets are curved; it is part of the ghost's arm.
module cpl_kernel
  use talus_kinds, only: wp, i4
  use cpl_facet_map, only: shape_functions
  implicit none
  private
  public :: spread_weights

  real(wp), parameter :: turned = 0.5_wp        !! least cosine between normals of facets that share
  real(wp), parameter :: fineness = 8.0_wp      !! quadrature points across the width
  integer(i4), parameter :: most_parts = 40     !! of a facet's edge
  real(wp), parameter :: least_points = 1.0e-6_wp !! of the moments' determinant: too few points

  !> Sums over the quadrature points: 1, t1, t2 and their products.
  type :: moments_type
    real(wp) :: m(3, 3) = 0.0_wp
  end type moments_type

contains

  !> Nodes, ascending, and weights of a ghost at x on facet `own`; a kernel narrower than the
  !! quadrature can see leaves it with the shape functions of its facet.
  subroutine spread_weights(x, own, facets, x_node, width, own_weight, list, weight)
    real(wp), intent(in) :: x(3)             !! [m]
    integer(i4), intent(in) :: own
    integer(i4), intent(in) :: facets(:, :)  !! (4, k) node ids from 1
    real(wp), intent(in) :: x_node(:, :)     !! (3, all nodes) [m]
    real(wp), intent(in) :: width            !! [m]
    real(wp), intent(in) :: own_weight(4)
    integer(i4), allocatable, intent(out) :: list(:)
    real(wp), allocatable, intent(out) :: weight(:)
    type(moments_type) :: moments
    real(wp), allocatable :: share(:, :)
    real(wp) :: axes(3, 3), alpha(3)
    logical :: good
    integer(i4) :: k

    axes = tangents(x_node(:, facets(:, own)))
    allocate (list(0), share(3, 0))
    do k = 1, size(facets, 2)
      if (beyond(x, x_node(:, facets(:, k)), width)) cycle
      call add_facet(x, axes, facets(:, k), x_node(:, facets(:, k)), width, moments, list, share)
    end do
    call solve(moments%m, alpha, good)
    if (good) then
      weight = matmul(alpha, share)
    else
      list = facets(:, own)
      weight = own_weight
    end if
    call sort(list, weight)
  end subroutine spread_weights

  !> Two unit tangents and the unit normal of a facet at its centre.
  pure function tangents(corners) result(axes)
    real(wp), intent(in) :: corners(3, 4)
    real(wp) :: axes(3, 3), b(3)
    axes(:, 1) = corners(:, 2) + corners(:, 3) - corners(:, 1) - corners(:, 4)
    axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
    b = corners(:, 3) + corners(:, 4) - corners(:, 1) - corners(:, 2)
    b = b - dot_product(b, axes(:, 1))*axes(:, 1)
    axes(:, 2) = b/norm2(b)
    axes(:, 3) = [axes(2, 1)*axes(3, 2) - axes(3, 1)*axes(2, 2), &
                  axes(3, 1)*axes(1, 2) - axes(1, 1)*axes(3, 2), &
                  axes(1, 1)*axes(2, 2) - axes(2, 1)*axes(1, 2)]
  end function tangents

  pure logical function beyond(x, corners, width)
    real(wp), intent(in) :: x(3), corners(3, 4), width
    beyond = norm2(max(0.0_wp, minval(corners, 2) - x, x - maxval(corners, 2))) > width
  end function beyond

  !> Midpoint rule over the parts of a facet that looks the same way as the ghost's.
  subroutine add_facet(x, axes, nodes, corners, width, moments, list, share)
    real(wp), intent(in) :: x(3), axes(3, 3), corners(3, 4), width
    integer(i4), intent(in) :: nodes(4)
    type(moments_type), intent(inout) :: moments
    integer(i4), allocatable, intent(inout) :: list(:)
    real(wp), allocatable, intent(inout) :: share(:, :)  !! (3, list): sums of phi N (1, t1, t2)
    real(wp) :: sums(3, 4), own(3, 3), basis(3), n(4), r(3), area, phi, natural(2)
    integer(i4) :: parts, i, j, a, b

    own = tangents(corners)
    if (dot_product(own(:, 3), axes(:, 3)) < turned) return
    parts = min(most_parts, max(2, ceiling(fineness*max(norm2(corners(:, 3) - corners(:, 1)), &
                                                        norm2(corners(:, 4) - corners(:, 2))) &
                                           /width)))
    sums = 0.0_wp
    do j = 1, parts
      do i = 1, parts
        natural = (2.0_wp*real([i, j], wp) - 1.0_wp)/parts - 1.0_wp
        n = shape_functions(natural)
        r = matmul(corners, n) - x
        if (dot_product(r, r) >= width**2) cycle
        area = area_at(corners, natural)/real(parts, wp)**2
        phi = area*(1.0_wp - dot_product(r, r)/width**2)**2
        basis = [1.0_wp, dot_product(r, axes(:, 1))/width, dot_product(r, axes(:, 2))/width]
        do a = 1, 4
          sums(:, a) = sums(:, a) + phi*n(a)*basis
        end do
        do b = 1, 3
          moments%m(:, b) = moments%m(:, b) + phi*basis*basis(b)
        end do
      end do
    end do
    if (.not. any(sums(1, :) > 0.0_wp)) return
    do a = 1, 4
      b = findloc(list, nodes(a), 1)
      if (b == 0) then
        list = [list, nodes(a)]
        b = size(list)
        share = reshape([share, 0.0_wp, 0.0_wp, 0.0_wp], [3, b])
      end if
      share(:, b) = share(:, b) + sums(:, a)
    end do
  end subroutine add_facet

  !> Area of the facet per unit of the natural coordinates [m2].
  pure real(wp) function area_at(corners, natural) result(area)
    real(wp), intent(in) :: corners(3, 4), natural(2)
    real(wp) :: t1(3), t2(3)
    t1 = (1.0_wp - natural(2))*(corners(:, 2) - corners(:, 1)) &
      + (1.0_wp + natural(2))*(corners(:, 3) - corners(:, 4))
    t2 = (1.0_wp - natural(1))*(corners(:, 4) - corners(:, 1)) &
      + (1.0_wp + natural(1))*(corners(:, 3) - corners(:, 2))
    area = norm2([t1(2)*t2(3) - t1(3)*t2(2), t1(3)*t2(1) - t1(1)*t2(3), &
                  t1(1)*t2(2) - t1(2)*t2(1)])/16.0_wp
  end function area_at

  !> m alpha = (1, 0, 0): the linear function that makes the weights add up and centres them.
  pure subroutine solve(m, alpha, good)
    real(wp), intent(in) :: m(3, 3)
    real(wp), intent(out) :: alpha(3)
    logical, intent(out) :: good
    real(wp) :: c(3), det
    c = [m(2, 2)*m(3, 3) - m(2, 3)*m(3, 2), m(2, 3)*m(3, 1) - m(2, 1)*m(3, 3), &
         m(2, 1)*m(3, 2) - m(2, 2)*m(3, 1)]
    det = dot_product(m(1, :), c)
    good = det > least_points*m(1, 1)**3
    alpha = 0.0_wp
    if (good) alpha = c/det
  end subroutine solve

  !> By node id, ascending.
  pure subroutine sort(list, weight)
    integer(i4), intent(inout) :: list(:)
    real(wp), intent(inout) :: weight(:)
    integer(i4) :: k, j, id
    real(wp) :: w
    do k = 2, size(list)
      id = list(k)
      w = weight(k)
      j = k - 1
      do while (j >= 1)
        if (list(j) < id) exit
        list(j + 1) = list(j)
        weight(j + 1) = weight(j)
        j = j - 1
      end do
      list(j + 1) = id
      weight(j + 1) = w
    end do
  end subroutine sort
end module cpl_kernel
