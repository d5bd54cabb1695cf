!> The points of a body as its analyses use them: allocation at the start, trial values and internal
!! forces of all ranks, stiffness, forces of some elements. The state of points: fem_points, how
!! an element finds it in fem_points_trial, its tangent in fem_points_tangent.
module fem_matter
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_geometry, only: keep_geometry
  use fem_mm_element, only: mm_response_type
  use fem_points, only: fem_points_type, fem_work_type
  use fem_points_tangent, only: assemble_tangent, point_tangent
  use fem_points_trial, only: work_elements, has_plain_stress, stress_forces
  use fem_recover, only: point_weights
  use fem_sparse, only: fem_pattern_type
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_matter_type

  type, extends(fem_points_type) :: fem_matter_type
  contains
    procedure :: prepare
    procedure :: update
    procedure :: update_some
    procedure :: held_force
    procedure :: stiffen
    procedure :: assemble
    procedure :: element_tangent
    procedure :: element_forces
  end type fem_matter_type

contains

  !> Allocate all points, once the initial state is set.
  subroutine prepare(self, mesh, dofs, elastic)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    if (.not. allocated(self%weight)) &
      allocate (self%weight(elastic%points), self%nodal(3, size(dofs%block)))
    call point_weights(mesh, dofs, elastic, self%weight)
    self%weight = self%weight*elastic%factor
    if (self%micro%active) then
      call prepare_micro(self, mesh, dofs, elastic)
    else
      call keep_geometry(mesh, dofs, elastic, self%geometry)
      if (.not. allocated(self%tangent)) &
        allocate (self%tangent(elastic%components, elastic%components, elastic%points), &
                  source=0.0_wp)
    end if
    self%accepted_stress = self%stress
    self%accepted_state = self%state
  end subroutine prepare

  !> Tables of micromorphic elements.
  subroutine prepare_micro(self, mesh, dofs, elastic)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4) :: e, n
    n = 3*maxval(dofs%start(2:) - dofs%start(:mesh%elements))
    if (.not. allocated(self%micro%element)) &
      allocate (self%micro%element(mesh%elements), self%micro%stiffness(n, n, mesh%elements))
    do e = 1, mesh%elements
      associate (rule => elastic%rule(elastic%rule_of(e)))
        call self%micro%prepare(e, rule, mesh%x(:, dofs%block(dofs%start(e):dofs%start(e) &
          + rule%nodes - 1)), self%weight(elastic%point(e):elastic%point(e + 1) - 1))
      end associate
    end do
  end subroutine prepare_micro

  !> Trial stress, state and tangents for displacements since the accepted state, and the internal
  !! forces of all ranks. `bad` is the first point whose law found no state, 0 if there is none.
  !! Laws of finite strain depend on total displacements, `u`.
  subroutine update(self, mesh, dofs, elastic, u, moved, force, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)          !! (3, blocks) [m]
    real(wp), intent(in) :: moved(:, :)      !! (3, blocks) [m]
    real(wp), intent(out) :: force(:, :)     !! (3, blocks) [N]
    integer(i4), intent(out) :: bad
    integer(i4) :: k
    call work_elements(self, mesh, dofs, elastic, u, moved, [(k, k=1, mesh%elements)])
    bad = self%bad
    call agree_on_bad(self, elastic, bad)
    self%bad = bad
    call sum_nodal(self, dofs, force)
  end subroutine update

  !> Sum of the nodal forces of all elements and ranks.
  subroutine sum_nodal(self, dofs, force)
    class(fem_matter_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(out) :: force(:, :)  !! (3, blocks) [N]
    integer(i4) :: k
    force = 0.0_wp
    do k = 1, size(dofs%block)
      force(:, dofs%block(k)) = force(:, dofs%block(k)) + self%nodal(:, k)
    end do
    call dofs%halo%sum_up(force)
  end subroutine sum_nodal

  !> Internal forces of the accepted state, as it was updated; it is the trial state then. `found`
  !! is false where only an update gives them: micropolar, micromorphic and finite laws.
  subroutine held_force(self, dofs, elastic, force, found)
    class(fem_matter_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(out) :: force(:, :)  !! (3, blocks) [N]
    logical, intent(out) :: found
    found = has_plain_stress(self)
    force = 0.0_wp
    if (.not. found) return
    call self%reject()
    call stress_forces(self, dofs, elastic)
    call sum_nodal(self, dofs, force)
  end subroutine held_force

  !> Of the ranks that have a bad point the one with the first element names it, for the others it
  !! is -1.
  subroutine agree_on_bad(self, elastic, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(inout) :: bad
    integer(i4) :: at(2), element
    if (.not. self%ranks%several()) return
    element = huge(element)
    if (bad > 0) then
      at = self%element_of(elastic, bad)
      element = elastic%number_of(at(1))
    end if
    call self%ranks%least_holder(element, self%bad_rank)
    if (element < huge(element) .and. self%bad_rank /= self%ranks%rank) bad = -1
  end subroutine agree_on_bad

  !> Trial stress and state of some elements; of micromorphic ones without their stiffness. All
  !! ranks call it together.
  subroutine update_some(self, mesh, dofs, elastic, u, moved, list)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)  !! (3, blocks)
    integer(i4), intent(in) :: list(:)            !! elements
    integer(i4) :: bad
    logical :: wanted
    wanted = self%micro%wants_stiffness
    self%micro%wants_stiffness = .false.
    call work_elements(self, mesh, dofs, elastic, u, moved, list)
    self%micro%wants_stiffness = wanted
    bad = self%bad
    call agree_on_bad(self, elastic, bad)
    self%bad = bad
  end subroutine update_some

  !> Elastic stiffness of micromorphic elements at displacements u and the trial states.
  subroutine stiffen(self, mesh, dofs, elastic, u)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)  !! (3, blocks) [m]
    type(mm_response_type) :: response
    integer(i4) :: e
    !$omp parallel do default(none) shared(self, mesh, dofs, elastic, u) private(e, response) &
    !$omp schedule(dynamic)
    do e = 1, mesh%elements
      call self%micro%stiffen(e, u(:, dofs%block(dofs%start(e):dofs%start(e + 1) - 1)), &
        self%state(:, elastic%point(e):elastic%point(e + 1) - 1), response)
    end do
    !$omp end parallel do
  end subroutine stiffen

  !> Stiffness of the trial state in blocks of the pattern; `lower` holds what is below the diagonal
  !! (row j, column i of entry i, j) where tangents are not symmetric.
  subroutine assemble(self, mesh, dofs, elastic, pattern, k, lower)
    class(fem_matter_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: k(:, :, :), lower(:, :, :)
    call assemble_tangent(self, mesh, dofs, elastic, pattern, k, lower)
  end subroutine assemble

  !> Tangent of the present element (3 blocks, 3 blocks) in the trial state [N/m].
  subroutine element_tangent(self, mesh, dofs, elastic, work, ke)
    class(fem_matter_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_work_type), intent(inout) :: work
    real(wp), intent(out) :: ke(:, :)
    call point_tangent(self, mesh, dofs, elastic, work, ke)
  end subroutine element_tangent

  !> Sum of the forces of some elements after an update (3, blocks) [N].
  pure subroutine element_forces(self, dofs, list, force)
    class(fem_matter_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: list(:)  !! elements
    real(wp), intent(out) :: force(:, :)
    integer(i4) :: i, k
    force = 0.0_wp
    do i = 1, size(list)
      do k = dofs%start(list(i)), dofs%start(list(i) + 1) - 1
        force(:, dofs%block(k)) = force(:, dofs%block(k)) + self%nodal(:, k)
      end do
    end do
  end subroutine element_forces
end module fem_matter
