!> Tangent of elements from those of their points, and its place in the matrix of a body.
module fem_points_tangent
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4
  use fem_assembly, only: share_nodes, elements_at
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_finite, only: fem_deformation_type, deform, finite_tangent
  use fem_geometry, only: fem_geometry_type, make_geometry
  use fem_law_finite, only: fem_law_finite_type
  use fem_law_polar, only: fem_law_polar_type
  use fem_points, only: fem_points_type, fem_work_type
  use fem_polar_element, only: polar_tangent
  use fem_scatter, only: add_element, clear_rows
  use fem_sparse, only: fem_pattern_type
  use fem_strain, only: strain_matrix, add_product
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: assemble_tangent, point_tangent

contains

  !> Stiffness of the trial state in blocks of the pattern; `lower` holds what is below the diagonal
  !! (row j, column i of entry i, j) where tangents are not symmetric.
  subroutine assemble_tangent(self, mesh, dofs, elastic, pattern, k, lower)
    class(fem_points_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: k(:, :, :), lower(:, :, :)
    integer(i4), allocatable :: first(:)
    integer(i4) :: t

    if (.not. allocated(k)) allocate (k(3, 3, size(pattern%column)))
    if (.not. allocated(lower)) &
      allocate (lower(3, 3, merge(0, size(pattern%column), self%symmetric)))
    call share_nodes(dofs, pattern, omp_get_max_threads(), first)
    !$omp parallel do default(none) shared(self, mesh, dofs, elastic, pattern, k, lower, first) &
    !$omp private(t) schedule(static, 1)
    do t = 1, size(first) - 1
      call share(first(t:t + 1))
    end do
    !$omp end parallel do

  contains

    !> The rows of the nodes of a range.
    subroutine share(range)
      integer(i4), intent(in) :: range(2)
      type(fem_work_type) :: work
      real(wp), allocatable :: ke(:, :)
      integer(i4), allocatable :: chosen(:)
      integer(i4) :: r, i

      call clear_rows(dofs, pattern, range, self%symmetric, k, lower)
      do r = 1, size(elastic%rule)
        work%geometry = fem_geometry_type()
        if (allocated(ke)) deallocate (ke)
        i = 3*(elastic%rule(r)%nodes + dofs%parts*elastic%rule(r)%rotations)
        allocate (ke(i, i))
        call elements_at(mesh, elastic, r, range, chosen)
        do i = 1, size(chosen)
          work%element = chosen(i)
          call point_tangent(self, mesh, dofs, elastic, work, ke)
          associate (block => dofs%block(dofs%start(chosen(i)):dofs%start(chosen(i) + 1) - 1), &
                     node => dofs%node)
            call add_element(block, node(block) >= range(1) .and. node(block) < range(2), pattern, &
                             self%symmetric, ke, k, lower)
          end associate
        end do
      end do
    end subroutine share
  end subroutine assemble_tangent

  !> Tangent of the present element (3 blocks, 3 blocks) in the trial state [N/m].
  subroutine point_tangent(self, mesh, dofs, elastic, work, ke)
    class(fem_points_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_work_type), intent(inout) :: work
    real(wp), intent(out) :: ke(:, :)
    associate (e => work%element)
      if (self%micro%active) then
        ke = self%micro%stiffness(:size(ke, 1), :size(ke, 1), e)
      else if (allocated(self%geometry)) then
        call law_tangent(self, dofs, elastic, self%geometry(e), work%motion, e, ke)
      else
        call make_geometry(elastic%rule(elastic%rule_of(e)), mesh, dofs, e, work%geometry)
        call law_tangent(self, dofs, elastic, work%geometry, work%motion, e, ke)
      end if
    end associate
  end subroutine point_tangent

  !> Tangent of element e by its kind of law.
  subroutine law_tangent(self, dofs, elastic, geometry, motion, e, ke)
    class(fem_points_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_geometry_type), intent(in) :: geometry
    type(fem_deformation_type), intent(inout) :: motion
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: ke(:, :)
    real(wp) :: b(size(ke, 1), 6), volume(size(ke, 1))
    integer(i4) :: q, p
    ke = 0.0_wp
    volume = 0.0_wp
    associate (rule => elastic%rule(elastic%rule_of(e)), first => elastic%point(e), &
               last => elastic%point(e + 1) - 1, shape => geometry%shape)
      select type (law => self%law(self%law_of(e))%law)
      class is (fem_law_polar_type)
        call polar_tangent(rule, shape, self%tangent(:, :, first:last), self%weight(first:last), ke)
        return
      class is (fem_law_finite_type)
        call deform(rule, shape, self%u(:, dofs%block(dofs%start(e):dofs%start(e + 1) - 1)), &
          motion, q)
        call finite_tangent(law, rule, shape, motion, self%weight(first:last), ke)
        return
      end select
      do q = 1, rule%at%n
        p = first + q - 1
        if (rule%bbar) volume = reshape(geometry%volume(:, :, q), [size(volume)])
        call strain_matrix(rule, shape, q, volume, b)
        call add_product(int(size(ke, 1), i4), b, self%tangent(:6, :6, p), self%weight(p), ke)
      end do
    end associate
  end subroutine law_tangent
end module fem_points_tangent
