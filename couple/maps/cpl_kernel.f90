!> Weights of a ghost whose force is smeared over the facets around it.
!!
!! Coarse-graining kernel phi(r) = (1 - r^2/w^2)^2 within the width w, times a linear function of
!! the place in the tangent plane, so that the weights add up to 1 and their centre is the ghost,
!! also at the rim of the facets and with the quadrature that is used. What is left of the centre is
!! along the normal, where facets are curved; it is part of the ghost's arm.
module cpl_kernel
  use talus_kinds, only: wp, i4
  use cpl_shapes, only: node_count, corner_count, shapes, shapes_at, centre_of
  use cpl_solid_mesh, only: solid_mesh_type
  implicit none
  private
  public :: spread_weights

  real(wp), parameter :: turned = 0.5_wp        !! least cosine between normals of facets that share
  real(wp), parameter :: fineness = 8.0_wp      !! quadrature points across the width
  integer(i4), parameter :: most_parts = 40     !! of a facet's edge
  real(wp), parameter :: least_points = 1.0e-6_wp !! of the moments' determinant: too few points

  !> Sums over the quadrature points: 1, t1, t2 and their products, and of each node reached.
  type :: moments_type
    real(wp) :: m(3, 3) = 0.0_wp
    integer(i4), allocatable :: list(:)      !! nodes
    real(wp), allocatable :: share(:, :)     !! (3, list): sums of phi N (1, t1, t2)
  end type moments_type

contains

  !> Nodes, ascending, and weights of a ghost at x on facet `own`; a kernel narrower than the
  !! quadrature can see leaves it with the shape functions of its facet.
  subroutine spread_weights(x, own, mesh, width, own_weight, list, weight)
    real(wp), intent(in) :: x(3)             !! [m]
    integer(i4), intent(in) :: own
    type(solid_mesh_type), intent(in) :: mesh
    real(wp), intent(in) :: width            !! [m]
    real(wp), intent(in) :: own_weight(:)  !! of the nodes of `own`
    integer(i4), allocatable, intent(out) :: list(:)
    real(wp), allocatable, intent(out) :: weight(:)
    type(moments_type) :: moments
    real(wp) :: axes(3, 3), alpha(3)
    logical :: good
    integer(i4) :: k, n

    n = node_count(mesh%facets(:, own))
    axes = tangents(mesh%x(:, mesh%facets(:n, own)))
    allocate (moments%list(0), moments%share(3, 0))
    do k = 1, size(mesh%facets, 2)
      n = node_count(mesh%facets(:, k))
      associate (nodes => mesh%facets(:n, k))
        if (beyond(x, mesh%x(:, nodes), width)) cycle
        call add_facet(x, axes, nodes, mesh%x(:, nodes), width, moments)
      end associate
    end do
    call solve(moments%m, alpha, good)
    if (good) then
      list = moments%list
      weight = matmul(alpha, moments%share)
    else
      n = node_count(mesh%facets(:, own))
      list = mesh%facets(:n, own)
      weight = own_weight(:n)
    end if
    call sort(list, weight)
  end subroutine spread_weights

  !> Two unit tangents and the unit normal of a facet at its centre.
  pure function tangents(node) result(axes)
    real(wp), intent(in) :: node(:, :)
    real(wp) :: axes(3, 3), t(3, 2)
    t = slopes(node, centre_of(int(size(node, 2), i4)))
    axes(:, 1) = t(:, 1)/norm2(t(:, 1))
    t(:, 2) = t(:, 2) - dot_product(t(:, 2), axes(:, 1))*axes(:, 1)
    axes(:, 2) = t(:, 2)/norm2(t(:, 2))
    axes(:, 3) = normal_of(axes(:, :2))
  end function tangents

  !> Derivatives of the place along the natural coordinates [m].
  pure function slopes(node, natural) result(t)
    real(wp), intent(in) :: node(:, :), natural(2)
    real(wp) :: t(3, 2), value(size(node, 2)), slope(2, size(node, 2)), bend(3, size(node, 2))
    call shapes(int(size(node, 2), i4), natural, value, slope, bend)
    t = matmul(node, transpose(slope))
  end function slopes

  pure function normal_of(t) result(n)
    real(wp), intent(in) :: t(3, 2)
    real(wp) :: n(3)
    n = [t(2, 1)*t(3, 2) - t(3, 1)*t(2, 2), t(3, 1)*t(1, 2) - t(1, 1)*t(3, 2), &
         t(1, 1)*t(2, 2) - t(2, 1)*t(1, 2)]
  end function normal_of

  pure logical function beyond(x, node, width)
    real(wp), intent(in) :: x(3), node(:, :), width
    beyond = norm2(max(0.0_wp, minval(node, 2) - x, x - maxval(node, 2))) > width
  end function beyond

  !> Midpoint rule over the parts of a facet with the same orientation as the ghost's.
  subroutine add_facet(x, axes, nodes, place, width, moments)
    real(wp), intent(in) :: x(3), axes(3, 3), place(:, :), width
    integer(i4), intent(in) :: nodes(:)
    type(moments_type), intent(inout) :: moments
    real(wp) :: sums(3, size(nodes)), own(3, 3), basis(3), n(size(nodes)), r(3), phi, whole
    real(wp), allocatable :: natural(:, :)
    integer(i4) :: k, a, b

    own = tangents(place)
    if (dot_product(own(:, 3), axes(:, 3)) < turned) return
    natural = parts_of(place, width)
    whole = merge(0.5_wp, 4.0_wp, corner_count(int(size(nodes), i4)) == 3)
    sums = 0.0_wp
    do k = 1, size(natural, 2)
      n = shapes_at(int(size(nodes), i4), natural(:, k))
      r = matmul(place, n) - x
      if (dot_product(r, r) >= width**2) cycle
      phi = whole*norm2(normal_of(slopes(place, natural(:, k))))/size(natural, 2) &
            *(1.0_wp - dot_product(r, r)/width**2)**2
      basis = [1.0_wp, dot_product(r, axes(:, 1))/width, dot_product(r, axes(:, 2))/width]
      do a = 1, size(nodes)
        sums(:, a) = sums(:, a) + phi*n(a)*basis
      end do
      do b = 1, 3
        moments%m(:, b) = moments%m(:, b) + phi*basis*basis(b)
      end do
    end do
    if (.not. any(sums(1, :) > 0.0_wp)) return
    do a = 1, size(nodes)
      b = findloc(moments%list, nodes(a), 1)
      if (b == 0) then
        moments%list = [moments%list, nodes(a)]
        b = size(moments%list)
        moments%share = reshape([moments%share, 0.0_wp, 0.0_wp, 0.0_wp], [3, b])
      end if
      moments%share(:, b) = moments%share(:, b) + sums(:, a)
    end do
  end subroutine add_facet

  !> Middles of equal parts of a facet in natural coordinates: squares, or triangles of a triangle.
  pure function parts_of(place, width) result(natural)
    real(wp), intent(in) :: place(:, :), width
    real(wp), allocatable :: natural(:, :)
    real(wp) :: longest
    integer(i4) :: parts, corners, i, j, k
    corners = corner_count(int(size(place, 2), i4))
    longest = 0.0_wp
    do j = 2, corners
      do i = 1, j - 1
        longest = max(longest, norm2(place(:, j) - place(:, i)))
      end do
    end do
    parts = min(most_parts, max(2, ceiling(fineness*longest/width)))
    allocate (natural(2, parts**2))
    k = 0
    do j = 1, parts
      do i = 1, parts
        if (corners == 4) then
          k = k + 1
          natural(:, k) = (2.0_wp*real([i, j], wp) - 1.0_wp)/parts - 1.0_wp
          cycle
        end if
        if (i + j <= parts + 1) then
          k = k + 1
          natural(:, k) = (real([i, j], wp) - 2.0_wp/3.0_wp)/parts
        end if
        if (i + j <= parts) then
          k = k + 1
          natural(:, k) = (real([i, j], wp) - 1.0_wp/3.0_wp)/parts
        end if
      end do
    end do
  end function parts_of

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
