!> Absorbing faces: dashpots rho c_p along the normal and rho c_s in the plane let plane waves out
!! that come in along the normal (Lysmer and Kuhlemeyer 1969). Micro-rotations have their own, rho j
!! times the speeds of their waves far above the cut-off (theory: absorbing faces).
module fem_absorbing
  use talus_kinds, only: wp, i4
  use fem_damping, only: fem_damping_type
  use fem_elastic, only: fem_elastic_type
  use fem_facets, only: facet_point
  use fem_dofs, only: fem_dofs_type
  use fem_kinds, only: node_count, most_facet_nodes
  use fem_quadrature, only: quadrature_rule
  use fem_shape, only: corner_kind, shape_functions
  use fem_topology, only: facet_total
  use fem_types, only: fem_mesh_type, fem_group_type
  implicit none
  private
  public :: absorb

  integer(i4), parameter :: degree = 4  !! three points a direction, six on triangles

contains

  !> Add the dashpots of the facets of a group to the nodes, whose shares are int N^2 scaled to the
  !! area, so that none is negative. `lost` is a facet whose element is missing, else 0. The waves
  !! of a saturated solid are undrained.
  subroutine absorb(mesh, dofs, elastic, group, damping, lost, liquid)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_group_type), intent(in) :: group
    type(fem_damping_type), intent(inout) :: damping
    integer(i4), intent(out) :: lost
    real(wp), intent(in), optional :: liquid(:)  !! (elements) modulus that pore liquid adds [Pa]
    real(wp) :: c(3, 3, most_facet_nodes), press, shear, spin(2)
    integer(i4) :: f, m, e, kind

    lost = 0
    do f = 1, facet_total(group)
      e = 0
      if (allocated(group%element)) e = group%element(f)
      if (e == 0) lost = f
      if (e == 0) return
      associate (k => elastic%moduli(:, e), rho => elastic%density(e))
        press = sqrt(rho*(k(1) + 2.0_wp*k(2) + k(3)))
        if (present(liquid)) press = sqrt(press**2 + rho*liquid(e))
        shear = sqrt(rho*(k(2) + 0.5_wp*k(3)))
        spin = sqrt(rho*elastic%inertia(e)*[k(4) + k(5) + k(6), k(6)])
      end associate
      m = node_count(group%facet_kind(f))
      kind = group%facet_kind(f)
      call facet_dashpots(kind, kind, mesh%x(:, group%facet(:m, f)), press, shear, c(:, :, :m))
      call damping%add_face(group%facet(:m, f), c(:, :, :m))
      if (.not. elastic%rule(elastic%rule_of(e))%polar) cycle
      if (any(dofs%phi(group%facet(:m, f)) == 0)) kind = corner_kind(kind)
      call facet_dashpots(group%facet_kind(f), kind, mesh%x(:, group%facet(:m, f)), spin(1), &
                          spin(2), c(:, :, :node_count(kind)))
      m = node_count(kind)
      call damping%add_face(dofs%phi(group%facet(:m, f)), c(:, :, :m))
    end do
  end subroutine absorb

  !> Dashpots of the nodes of one facet [N s/m], of a field with the shape functions of `field`.
  pure subroutine facet_dashpots(kind, field, x, press, shear, c)
    integer(i4), intent(in) :: kind, field     !! of the facet, of the field's functions on it
    real(wp), intent(in) :: x(:, :)            !! (3, nodes) [m]
    real(wp), intent(in) :: press, shear       !! rho c_p, rho c_s [N s/m^3]
    real(wp), intent(out) :: c(:, :, :)
    real(wp), allocatable :: xi(:, :), weight(:)
    real(wp) :: u(size(x, 2)), n(node_count(field)), slope(2, node_count(field))
    real(wp) :: area(3), size_of, whole, squares
    integer(i4) :: q, a

    call quadrature_rule(kind, degree, xi, weight)
    c = 0.0_wp
    whole = 0.0_wp
    squares = 0.0_wp
    do q = 1, size(weight)
      call facet_point(kind, x, xi(:, q), u, area)
      call shape_functions(field, xi(:, q), n, slope)
      size_of = norm2(area)
      whole = whole + weight(q)*size_of
      squares = squares + weight(q)*size_of*sum(n**2)
      do a = 1, size(n)
        call add_dashpot(weight(q)*size_of*n(a)**2, press, shear, area, c(:, :, a))
      end do
    end do
    c = c*whole/squares
  end subroutine facet_dashpots

  !> Add the dashpot of a share [m^2] of a facet with the area vector `area` [m^2].
  pure subroutine add_dashpot(share, press, shear, area, c)
    real(wp), intent(in) :: share, press, shear, area(3)
    real(wp), intent(inout) :: c(3, 3)  !! [N s/m]
    real(wp) :: size_of
    integer(i4) :: i, j
    size_of = norm2(area)
    do j = 1, 3
      do i = 1, 3
        c(i, j) = c(i, j) + share*(press - shear)*area(i)*area(j)/size_of**2
      end do
      c(j, j) = c(j, j) + share*shear
    end do
  end subroutine add_dashpot
end module fem_absorbing
