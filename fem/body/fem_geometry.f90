!> Geometry of elements in which laws with a state work: gradients and weights of the points, and
!! the gradients of the volumetric strain of B-bar. It is kept per element until places or rules
!! change, as far as memory allows.
module fem_geometry
  use talus_kinds, only: wp, i4, i8
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_element, only: fem_shape_type, element_shape
  use fem_rules, only: fem_formulation_type
  use fem_strain, only: volume_gradients
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_geometry_type, make_geometry, keep_geometry

  integer(i8), parameter :: most_kept = 2_i8**27  !! reals of all elements, 1 GiB

  type :: fem_geometry_type
    type(fem_shape_type) :: shape
    real(wp), allocatable :: volume(:, :, :)  !! (3, nodes, points), empty without B-bar [1/m]
  end type fem_geometry_type

contains

  !> Geometry of element e; what `geometry` has allocated is that of a rule of the same name.
  subroutine make_geometry(rule, mesh, dofs, e, geometry)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e
    type(fem_geometry_type), intent(inout) :: geometry
    real(wp) :: fitted(3*rule%nodes, rule%at%n)
    associate (x => mesh%x(:, dofs%block(dofs%start(e):dofs%start(e) + rule%nodes - 1)))
      call element_shape(rule%at, x, geometry%shape)
      if (.not. allocated(geometry%volume)) &
        allocate (geometry%volume(3, rule%nodes, merge(rule%at%n, 0, rule%bbar)))
      if (.not. rule%bbar) return
      call volume_gradients(rule, x, geometry%shape, fitted)
      geometry%volume = reshape(fitted, shape(geometry%volume))
    end associate
  end subroutine make_geometry

  !> Geometry of all elements, not allocated where it takes too much memory.
  subroutine keep_geometry(mesh, dofs, elastic, geometry)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_geometry_type), allocatable, intent(inout) :: geometry(:)
    integer(i8) :: reals
    integer(i4) :: e
    if (allocated(geometry)) deallocate (geometry)
    reals = 0
    do e = 1, mesh%elements
      reals = reals + reals_of(elastic%rule(elastic%rule_of(e)))
    end do
    if (reals > most_kept) return
    allocate (geometry(mesh%elements))
    !$omp parallel do default(none) shared(mesh, dofs, elastic, geometry) private(e)
    do e = 1, mesh%elements
      call make_geometry(elastic%rule(elastic%rule_of(e)), mesh, dofs, e, geometry(e))
    end do
    !$omp end parallel do
  end subroutine keep_geometry

  !> Reals that an element takes.
  pure integer(i8) function reals_of(rule)
    type(fem_formulation_type), intent(in) :: rule
    reals_of = int(rule%at%n, i8)*(3*(rule%nodes + rule%rotations) + 1)
    if (rule%bbar) reals_of = reals_of + 3_i8*rule%at%n*rule%nodes
  end function reals_of
end module fem_geometry
