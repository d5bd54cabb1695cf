!> Stresses at Gauss points, element means, nodal means; forces of the initial stress.
module fem_recover
  use talus_kinds, only: wp, i4
  use fem_types, only: fem_mesh_type, fem_elastic_type
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stress, hex8_forces, hex8_points, &
    gauss_shape
  implicit none
  private
  public :: point_stress, mean_stress, nodal_stress, initial_stress_force, point_positions
  public :: point_weights, element_forces

contains

  !> Stress at all Gauss points (6, 8, elements) [Pa], the initial stress included.
  subroutine point_stress(mesh, elastic, u, stress)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: stress(:, :, :)
    type(hex8_geometry_type) :: geometry
    integer(i4) :: e
    !$omp parallel do default(none) shared(mesh, elastic, u, stress) private(e, geometry) &
    !$omp schedule(static)
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      call hex8_stress(geometry, u(:, mesh%hex8(:, e)), &
                       elastic%young(e)/(3.0_wp*(1.0_wp - 2.0_wp*elastic%poisson(e))), &
                       elastic%young(e)/(2.0_wp*(1.0_wp + elastic%poisson(e))), &
                       elastic%bbar(e), stress(:, :, e))
      if (elastic%has_initial) stress(:, :, e) = stress(:, :, e) + elastic%initial(:, :, e)
    end do
    !$omp end parallel do
  end subroutine point_stress

  !> Means over the elements (6, elements) by volume.
  subroutine mean_stress(mesh, stress, mean)
    type(fem_mesh_type), intent(in) :: mesh
    real(wp), intent(in) :: stress(:, :, :)
    real(wp), intent(out) :: mean(:, :)
    type(hex8_geometry_type) :: geometry
    integer(i4) :: e
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      mean(:, e) = matmul(stress(:, :, e), geometry%weight)/sum(geometry%weight)
    end do
  end subroutine mean_stress

  !> Nodal stresses (6, nodes): sum of N sigma w over sum of N w.
  subroutine nodal_stress(mesh, stress, nodal)
    type(fem_mesh_type), intent(in) :: mesh
    real(wp), intent(in) :: stress(:, :, :)
    real(wp), intent(out) :: nodal(:, :)
    type(hex8_geometry_type) :: geometry
    real(wp) :: share(mesh%nodes), n(8)
    integer(i4) :: e, q, a
    nodal = 0.0_wp
    share = 0.0_wp
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      do q = 1, hex8_points
        n = gauss_shape(q)*geometry%weight(q)
        do a = 1, 8
          share(mesh%hex8(a, e)) = share(mesh%hex8(a, e)) + n(a)
          nodal(:, mesh%hex8(a, e)) = nodal(:, mesh%hex8(a, e)) + n(a)*stress(:, q, e)
        end do
      end do
    end do
    do a = 1, mesh%nodes
      nodal(:, a) = nodal(:, a)/share(a)
    end do
  end subroutine nodal_stress

  !> Internal nodal forces of the (weighted) initial stress [N].
  subroutine initial_stress_force(mesh, elastic, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(out) :: force(:, :)
    type(hex8_geometry_type) :: geometry
    real(wp) :: fe(3, 8)
    integer(i4) :: e, a
    force = 0.0_wp
    if (.not. elastic%has_initial) return
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      call hex8_forces(geometry, elastic%initial(:, :, e), elastic%factor(:, e), &
        elastic%bbar(e), fe)
      do a = 1, 8
        force(:, mesh%hex8(a, e)) = force(:, mesh%hex8(a, e)) + fe(:, a)
      end do
    end do
  end subroutine initial_stress_force

  !> Internal nodal forces of chosen elements at displacements u [N].
  subroutine element_forces(mesh, elastic, u, chosen, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)
    logical, intent(in) :: chosen(:)
    real(wp), intent(out) :: force(:, :)
    type(hex8_geometry_type) :: geometry
    real(wp) :: stress(6, 8), fe(3, 8)
    integer(i4) :: e, a
    force = 0.0_wp
    do e = 1, mesh%elements
      if (.not. chosen(e)) cycle
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      call hex8_stress(geometry, u(:, mesh%hex8(:, e)), &
                       elastic%young(e)/(3.0_wp*(1.0_wp - 2.0_wp*elastic%poisson(e))), &
                       elastic%young(e)/(2.0_wp*(1.0_wp + elastic%poisson(e))), &
                       elastic%bbar(e), stress)
      if (elastic%has_initial) stress = stress + elastic%initial(:, :, e)
      call hex8_forces(geometry, stress, elastic%factor(:, e), elastic%bbar(e), fe)
      do a = 1, 8
        force(:, mesh%hex8(a, e)) = force(:, mesh%hex8(a, e)) + fe(:, a)
      end do
    end do
  end subroutine element_forces

  !> Positions of all Gauss points (3, 8 elements) [m], element by element.
  subroutine point_positions(mesh, x)
    type(fem_mesh_type), intent(in) :: mesh
    real(wp), intent(out) :: x(:, :)
    integer(i4) :: e, q
    do e = 1, mesh%elements
      do q = 1, hex8_points
        x(:, 8*(e - 1) + q) = matmul(mesh%x(:, mesh%hex8(:, e)), gauss_shape(q))
      end do
    end do
  end subroutine point_positions

  !> Volumes of all Gauss points (8 elements) [m^3].
  subroutine point_weights(mesh, weight)
    type(fem_mesh_type), intent(in) :: mesh
    real(wp), intent(out) :: weight(:)
    type(hex8_geometry_type) :: geometry
    integer(i4) :: e
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      weight(8*(e - 1) + 1:8*e) = geometry%weight
    end do
  end subroutine point_weights
end module fem_recover
