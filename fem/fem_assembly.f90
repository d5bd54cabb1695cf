!> Stiffness and mass of all elements on the pattern of the fields.
module fem_assembly
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type, blocks_of
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stiffness, gauss_shape, hex8_points
  use fem_sparse, only: fem_pattern_type, scatter, place
  use fem_types, only: fem_mesh_type, fem_elastic_type
  implicit none
  private
  public :: assemble_stiffness, assemble_mass

  integer(i4), parameter :: batch = 512  !! elements whose matrices are held at once

contains

  !> Stiffness blocks k(3, 3, entries) [N/m]. Elements are worked in parallel, added in order.
  subroutine assemble_stiffness(mesh, dofs, elastic, pattern, k)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: k(:, :, :)
    real(wp), allocatable :: ke(:, :, :, :, :)
    type(hex8_geometry_type) :: geometry
    integer(i4) :: e, first, last

    if (.not. allocated(k)) allocate (k(3, 3, size(pattern%column)))
    k = 0.0_wp
    allocate (ke(3, 3, 8, 8, batch))
    do first = 1, mesh%elements, batch
      last = min(first + batch - 1, mesh%elements)
      !$omp parallel do default(none) shared(mesh, elastic, ke, first, last) private(e, geometry) &
      !$omp schedule(static)
      do e = first, last
        call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
        call hex8_stiffness(geometry, bulk(elastic, e), shear(elastic, e), elastic%factor(:, e), &
                            elastic%bbar(e), ke(:, :, :, :, e - first + 1))
      end do
      !$omp end parallel do
      do e = first, last
        call scatter(blocks_of(dofs, e), pattern, ke(:, :, :, :, e - first + 1), k)
      end do
    end do
  end subroutine assemble_stiffness

  pure real(wp) function bulk(elastic, e)
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    bulk = elastic%young(e)/(3.0_wp*(1.0_wp - 2.0_wp*elastic%poisson(e)))
  end function bulk

  pure real(wp) function shear(elastic, e)
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    shear = elastic%young(e)/(2.0_wp*(1.0_wp + elastic%poisson(e)))
  end function shear

  !> Consistent mass: one scalar a node pair [kg].
  subroutine assemble_mass(mesh, elastic, pattern, mass)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: mass(:)
    type(hex8_geometry_type) :: geometry
    real(wp) :: n(8, hex8_points), w
    integer(i4) :: e, a, b, q, i, j, p

    if (.not. allocated(mass)) allocate (mass(size(pattern%column)))
    mass = 0.0_wp
    do q = 1, hex8_points
      n(:, q) = gauss_shape(q)
    end do
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      do b = 1, 8
        do a = 1, b
          w = elastic%density(e)*sum(geometry%weight*n(a, :)*n(b, :))
          i = min(mesh%hex8(a, e), mesh%hex8(b, e))
          j = max(mesh%hex8(a, e), mesh%hex8(b, e))
          p = place(pattern, i, j)
          mass(p) = mass(p) + w
        end do
      end do
    end do
  end subroutine assemble_mass
end module fem_assembly
