!> Stress and state of every quadrature point of a body whose laws have a state: trial values for
!! displacements since the accepted state, internal forces, stiffness; accepted values. Elements are
!! worked in chunks whose number does not depend on the threads.
module fem_matter
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use fem_assembly, only: share_nodes, elements_at
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_element, only: fem_shape_type, element_shape
  use fem_finite, only: fem_deformation_type, deform, finite_force, finite_tangent
  use fem_law, only: fem_law_box_type, integrate, at_flag, at_iterations, at_stored, &
    at_dissipated, at_numerical, common_size
  use fem_law_finite, only: fem_law_finite_type, at_ratio
  use fem_law_polar, only: fem_law_polar_type
  use fem_mm_body, only: fem_micro_type
  use fem_mm_element, only: mm_response_type
  use fem_polar, only: full_of, symmetric_of
  use fem_polar_element, only: polar_answer, polar_tangent
  use talus_ranks, only: ranks_type
  use fem_recover, only: point_weights
  use fem_scatter, only: add_element, clear_rows
  use fem_sparse, only: fem_pattern_type
  use fem_strain, only: mean_gradient, strain_matrix, add_product, strain_of, add_force
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_matter_type

  integer(i4), parameter :: chunks = 64

  type :: fem_matter_type
    logical :: active = .false.               !! some law of the body has a state
    logical :: symmetric = .true.             !! all tangents are
    logical :: finite = .false.               !! some law is one of finite strain
    integer(i4) :: bad = 0                    !! first point without a state in the last update,
                                              !! < 0: one that another rank has
    integer(i4) :: bad_rank = 0               !! who has it
    type(ranks_type) :: ranks             !! that have the other elements
    type(fem_law_box_type), allocatable :: law(:)
    integer(i4), allocatable :: law_of(:)     !! (elements)
    integer(i4) :: states = common_size       !! most of any law
    real(wp), allocatable :: weight(:)        !! (points) volume times factor [m^3]
    real(wp), allocatable :: stress(:, :), accepted_stress(:, :)  !! (components, points) [Pa]
    real(wp), allocatable :: state(:, :), accepted_state(:, :)    !! (states, points)
    real(wp), allocatable :: tangent(:, :, :)  !! (components, components, points) [Pa]
    real(wp), allocatable :: nodal(:, :)      !! (3, blocks of all elements) forces [N]
    real(wp), allocatable :: u(:, :)          !! (3, blocks) of the trial, with finite strains [m]
    type(fem_micro_type) :: micro             !! if the body is micromorphic
  contains
    procedure :: prepare
    procedure :: update
    procedure :: assemble
    procedure :: accept
    procedure :: reject
    procedure :: works
    procedure :: growth
    procedure :: yielding
    procedure :: element_of
    procedure :: trouble
    procedure :: stiffen
    procedure :: element_forces
    procedure :: update_some
    procedure :: element_tangent
  end type fem_matter_type

contains

  !> Room for all points, once the initial state is there.
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
    else if (.not. allocated(self%tangent)) then
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
  !! Laws of finite strain go by all displacements, `u`.
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
    call work_elements(self, mesh, dofs, elastic, u, moved, [(k, k=1, mesh%elements)], bad)
    call agree_on_bad(self, elastic, bad)
    self%bad = bad
    force = 0.0_wp
    do k = 1, size(dofs%block)
      force(:, dofs%block(k)) = force(:, dofs%block(k)) + self%nodal(:, k)
    end do
    call dofs%halo%sum_up(force)
  end subroutine update

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

  !> Trial stress and state of some elements; of micromorphic ones without their stiffness.
  subroutine update_some(self, mesh, dofs, elastic, u, moved, list)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)  !! (3, blocks)
    integer(i4), intent(in) :: list(:)            !! elements
    logical :: wanted
    wanted = self%micro%wants_stiffness
    self%micro%wants_stiffness = .false.
    call work_elements(self, mesh, dofs, elastic, u, moved, list, self%bad)
    self%micro%wants_stiffness = wanted
  end subroutine update_some

  !> Some elements in chunks; `bad` is the first point without a state, 0 if there is none.
  subroutine work_elements(self, mesh, dofs, elastic, u, moved, list, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)  !! (3, blocks)
    integer(i4), intent(in) :: list(:)            !! elements
    integer(i4), intent(out) :: bad
    integer(i4) :: c, failed(chunks)
    if (self%finite) self%u = u
    !$omp parallel do default(none) shared(self, mesh, dofs, elastic, u, moved, list, failed) &
    !$omp private(c) schedule(dynamic)
    do c = 1, chunks
      associate (part => list(first_of(c, size(list)):first_of(c + 1_i4, size(list)) - 1))
        if (self%micro%active) then
          call work_micro(self, dofs, elastic, u, moved, part, failed(c))
        else
          call work_part(self, mesh, dofs, elastic, moved, part, failed(c))
        end if
      end associate
    end do
    !$omp end parallel do
    bad = 0
    do c = chunks, 1, -1
      if (failed(c) > 0) bad = failed(c)
    end do
    if (bad > 0 .and. self%micro%active) call explain(self, dofs, elastic, u, moved, bad)
  end subroutine work_elements

  !> First of n elements that chunk c works.
  pure integer(i4) function first_of(c, n)
    integer(i4), intent(in) :: c, n
    first_of = int((c - 1)*int(n, i8)/chunks, i4) + 1
  end function first_of

  subroutine work_micro(self, dofs, elastic, u, moved, list, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)
    integer(i4), intent(in) :: list(:)
    integer(i4), intent(out) :: bad
    type(mm_response_type) :: response
    integer(i4) :: k, failed
    bad = 0
    do k = 1, size(list)
      call answer_micro(self, dofs, elastic, u, moved, list(k), response, failed)
      if (bad == 0) bad = failed
    end do
  end subroutine work_micro

  !> Element e; `bad` is its first point without a state.
  subroutine answer_micro(self, dofs, elastic, u, moved, e, response, bad)
    type(fem_matter_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)
    integer(i4), intent(in) :: e
    type(mm_response_type), intent(inout) :: response
    integer(i4), intent(out) :: bad
    integer(i4) :: failed
    associate (first => elastic%point(e), last => elastic%point(e + 1) - 1, &
               a => dofs%start(e), b => dofs%start(e + 1) - 1)
      call self%micro%answer(e, u(:, dofs%block(a:b)) - moved(:, dofs%block(a:b)), &
        u(:, dofs%block(a:b)), self%accepted_state(:, first:last), response, &
        self%stress(:, first:last), self%state(:, first:last), failed)
      bad = merge(first + failed - 1, 0_i4, failed > 0)
      if (failed == 0) self%nodal(:, a:b) = reshape(response%force, [3, b - a + 1])
    end associate
  end subroutine answer_micro

  !> Why point p of a micromorphic body found no state.
  subroutine explain(self, dofs, elastic, u, moved, p)
    class(fem_matter_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)
    integer(i4), intent(in) :: p
    integer(i4) :: at(2)
    at = self%element_of(elastic, p)
    associate (block => dofs%block(dofs%start(at(1)):dofs%start(at(1) + 1) - 1))
      call self%micro%explain(at(1), at(2), u(:, block) - moved(:, block), u(:, block), &
        self%accepted_state(:, elastic%point(at(1)):elastic%point(at(1) + 1) - 1))
    end associate
  end subroutine explain

  subroutine work_part(self, mesh, dofs, elastic, moved, list, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    integer(i4), intent(in) :: list(:)
    integer(i4), intent(out) :: bad
    type(fem_shape_type) :: shape
    type(fem_deformation_type) :: motion
    integer(i4) :: e, k, rule, failed
    bad = 0
    rule = 0
    do k = 1, size(list)
      e = list(k)
      if (allocated(shape%weight) .and. elastic%rule_of(e) /= rule) &
        deallocate (shape%weight, shape%u, shape%phi)
      rule = elastic%rule_of(e)
      failed = 0
      if (elastic%is_absent(e)) then
        self%nodal(:, dofs%start(e):dofs%start(e + 1) - 1) = 0.0_wp
      else if (self%law(self%law_of(e))%law%finite) then
        call deform_element(self, mesh, dofs, elastic, e, shape, motion, failed)
      else if (self%law(self%law_of(e))%law%polar) then
        call turn_element(self, mesh, dofs, elastic, moved, e, shape, failed)
      else
        call update_element(self, mesh, dofs, elastic, moved, e, shape, failed)
      end if
      if (bad == 0) bad = failed
    end do
  end subroutine work_part

  subroutine update_element(self, mesh, dofs, elastic, moved, e, shape, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    integer(i4), intent(in) :: e
    type(fem_shape_type), intent(inout) :: shape
    integer(i4), intent(out) :: bad
    real(wp), dimension(3, elastic%rule(elastic%rule_of(e))%nodes) :: d, f, share
    real(wp) :: mean(size(d))
    real(wp) :: strain(6), stress(6), push(6), pressure
    logical :: good, wide
    integer(i4) :: q, p, n
    bad = 0
    wide = size(self%stress, 1) > size(stress)  ! a body with micropolar parts
    associate (rule => elastic%rule(elastic%rule_of(e)), law => self%law(self%law_of(e))%law, &
               block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      n = self%law(self%law_of(e))%law%states
      call element_shape(rule%at, mesh%x(:, block), shape)
      if (rule%bbar) call mean_gradient(shape, mean)
      if (rule%bbar) share = reshape(mean, [3, rule%nodes])
      d = moved(:, block)
      f = 0.0_wp
      do q = 1, rule%at%n
        p = elastic%point(e) + q - 1
        strain = strain_of(shape%u(:, :, q), d)
        if (rule%bbar) strain(:3) = strain(:3) + (sum(share*d) - sum(strain(:3)))/3.0_wp
        if (wide) then
          stress = self%accepted_stress(symmetric_of, p)
        else
          stress = self%accepted_stress(:, p)
        end if
        self%state(:, p) = self%accepted_state(:, p)
        call integrate(law, strain, stress, self%state(:n, p), self%tangent(:6, :6, p), good)
        if (.not. good .and. bad == 0) bad = p
        if (wide) then
          self%stress(:9, p) = stress(full_of)
        else
          self%stress(:, p) = stress
        end if
        push = self%weight(p)*stress
        if (rule%bbar) then
          pressure = sum(push(:3))/3.0_wp
          push(:3) = push(:3) - pressure
          f = f + pressure*share
        end if
        call add_force(shape%u(:, :, q), push, f)
      end do
      self%nodal(:, dofs%start(e):dofs%start(e + 1) - 1) = f
    end associate
  end subroutine update_element

  !> A micropolar element.
  subroutine turn_element(self, mesh, dofs, elastic, moved, e, shape, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    integer(i4), intent(in) :: e
    type(fem_shape_type), intent(inout) :: shape
    integer(i4), intent(out) :: bad
    associate (rule => elastic%rule(elastic%rule_of(e)), a => elastic%point(e), &
               b => elastic%point(e + 1) - 1, first => dofs%start(e), last => dofs%start(e + 1) - 1)
      call element_shape(rule%at, mesh%x(:, dofs%block(first:first + rule%nodes - 1)), shape)
      self%stress(:, a:b) = self%accepted_stress(:, a:b)
      self%state(:, a:b) = self%accepted_state(:, a:b)
      select type (law => self%law(self%law_of(e))%law)
      class is (fem_law_polar_type)
        call polar_answer(law, rule, shape, moved(:, dofs%block(first:last)), &
                          elastic%factor(a:b), self%stress(:, a:b), self%state(:, a:b), &
                          self%tangent(:, :, a:b), self%nodal(:, first:last), bad)
      end select
      if (bad > 0) bad = a + bad - 1
    end associate
  end subroutine turn_element

  !> An element at finite strain; where a point is turned inside out its volume ratio is kept.
  subroutine deform_element(self, mesh, dofs, elastic, e, shape, motion, bad)
    class(fem_matter_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    type(fem_shape_type), intent(inout) :: shape
    type(fem_deformation_type), intent(inout) :: motion
    integer(i4), intent(out) :: bad

    associate (rule => elastic%rule(elastic%rule_of(e)), a => elastic%point(e), &
               b => elastic%point(e + 1) - 1, first => dofs%start(e), last => dofs%start(e + 1) - 1)
      call element_shape(rule%at, mesh%x(:, dofs%block(first:last)), shape)
      call deform(rule, shape, self%u(:, dofs%block(first:last)), motion, bad)
      if (bad > 0) then
        self%state(at_ratio, a:b) = motion%ratio
        self%nodal(:, first:last) = 0.0_wp
      else
        select type (law => self%law(self%law_of(e))%law)
        class is (fem_law_finite_type)
          call finite_force(law, shape, motion, self%weight(a:b), self%stress(:, a:b), &
                            self%state(:, a:b), self%nodal(:, first:last), bad)
        end select
      end if
      if (bad > 0) bad = a + bad - 1
    end associate
  end subroutine deform_element

  !> Stiffness of the trial state in blocks of the pattern; `lower` holds what is below the diagonal
  !! (row j, column i of entry i, j) where tangents are not symmetric.
  subroutine assemble(self, mesh, dofs, elastic, pattern, k, lower)
    class(fem_matter_type), intent(in) :: self
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
      call share(self, mesh, dofs, elastic, pattern, first(t:t + 1), k, lower)
    end do
    !$omp end parallel do
  end subroutine assemble

  !> The rows of the nodes of a range.
  subroutine share(self, mesh, dofs, elastic, pattern, range, k, lower)
    class(fem_matter_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: range(2)
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    type(fem_shape_type) :: shape
    type(fem_deformation_type) :: motion
    real(wp), allocatable :: ke(:, :)
    integer(i4), allocatable :: chosen(:)
    integer(i4) :: r, i

    call clear_rows(dofs, pattern, range, self%symmetric, k, lower)
    do r = 1, size(elastic%rule)
      if (allocated(shape%weight)) deallocate (shape%weight, shape%u, shape%phi)
      if (allocated(ke)) deallocate (ke)
      i = 3*(elastic%rule(r)%nodes + dofs%parts*elastic%rule(r)%rotations)
      allocate (ke(i, i))
      call elements_at(mesh, elastic, r, range, chosen)
      do i = 1, size(chosen)
        call self%element_tangent(mesh, dofs, elastic, chosen(i), shape, motion, ke)
        call add_element(dofs%block(dofs%start(chosen(i)):dofs%start(chosen(i) + 1) - 1), &
                         dofs%node, pattern, range, self%symmetric, ke, k, lower)
      end do
    end do
  end subroutine share

  !> Tangent of element e (3 blocks, 3 blocks) in the trial state [N/m].
  subroutine element_tangent(self, mesh, dofs, elastic, e, shape, motion, ke)
    class(fem_matter_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    type(fem_shape_type), intent(inout) :: shape
    type(fem_deformation_type), intent(inout) :: motion
    real(wp), intent(out) :: ke(:, :)
    real(wp) :: mean(size(ke, 1)), b(size(ke, 1), 6)
    integer(i4) :: q, p
    if (self%micro%active) then
      ke = self%micro%stiffness(:size(ke, 1), :size(ke, 1), e)
      return
    end if
    ke = 0.0_wp
    associate (rule => elastic%rule(elastic%rule_of(e)), &
               block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      call element_shape(rule%at, mesh%x(:, block(:rule%nodes)), shape)
      select type (law => self%law(self%law_of(e))%law)
      class is (fem_law_polar_type)
        call polar_tangent(rule, shape, self%tangent(:, :, elastic%point(e):elastic%point(e + 1) &
          - 1), self%weight(elastic%point(e):elastic%point(e + 1) - 1), ke)
        return
      class is (fem_law_finite_type)
        call deform(rule, shape, self%u(:, block), motion, q)
        call finite_tangent(law, rule, shape, motion, &
                            self%weight(elastic%point(e):elastic%point(e + 1) - 1), ke)
        return
      end select
      if (rule%bbar) call mean_gradient(shape, mean)
      do q = 1, rule%at%n
        p = elastic%point(e) + q - 1
        call strain_matrix(rule, shape, q, mean, b)
        call add_product(int(size(ke, 1), i4), b, self%tangent(:6, :6, p), self%weight(p), ke)
      end do
    end associate
  end subroutine element_tangent

  subroutine accept(self)
    class(fem_matter_type), intent(inout) :: self
    if (.not. self%active) return
    self%accepted_stress = self%stress
    self%accepted_state = self%state
  end subroutine accept

  subroutine reject(self)
    class(fem_matter_type), intent(inout) :: self
    if (.not. self%active) return
    self%stress = self%accepted_stress
    self%state = self%accepted_state
  end subroutine reject

  !> Stored energy, dissipation and what the integration took, of the trial state [J].
  pure function works(self)
    class(fem_matter_type), intent(in) :: self
    real(wp) :: works(3)
    works = [sum(self%weight*self%state(at_stored, :)), &
             sum(self%weight*self%state(at_dissipated, :)), &
             sum(self%weight*self%state(at_numerical, :))]
  end function works

  !> What the integration took since the accepted state [J].
  pure real(wp) function growth(self)
    class(fem_matter_type), intent(in) :: self
    growth = sum(self%weight*(self%state(at_numerical, :) - self%accepted_state(at_numerical, :)))
  end function growth

  !> Points that yielded in the trial increment, and the most local iterations.
  pure function yielding(self) result(counts)
    class(fem_matter_type), intent(in) :: self
    integer(i4) :: counts(2)
    counts = [int(count(self%state(at_flag, :) > 0.0_wp), i4), &
              nint(maxval(self%state(at_iterations, :)))]
  end function yielding

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

  !> What is wrong with the first point without a state, and whether its element is turned inside
  !! out; all ranks ask together.
  subroutine trouble(self, elastic, text, inverted)
    class(fem_matter_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    character(len=:), allocatable, intent(out) :: text
    logical, intent(out) :: inverted
    inverted = .false.
    text = ''
    if (self%bad > 0) call trouble_here(self, elastic, text, inverted)
    call self%ranks%tell_text(self%bad_rank, text)
    call self%ranks%any_of(inverted)
  end subroutine trouble

  subroutine trouble_here(self, elastic, text, inverted)
    class(fem_matter_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    character(len=:), allocatable, intent(out) :: text
    logical, intent(out) :: inverted
    integer(i4) :: at(2)
    character(len=:), allocatable :: element
    at = self%element_of(elastic, self%bad)
    element = 'element '//str(elastic%number_of(at(1)))
    if (self%micro%active) then
      inverted = index(self%micro%trouble, 'determinant') > 0
      text = 'the law of point '//str(at(2))//' of '//element//' finds no state: '// &
        self%micro%trouble
      return
    end if
    inverted = self%law(self%law_of(at(1)))%law%finite
    if (inverted) then
      text = element//' is turned inside out at point '//str(at(2))// &
        ', its volume is '//str(self%state(at_ratio, self%bad))//' of what it was'
    else
      text = 'the law of point '//str(at(2))//' of '//element//' finds no state'
    end if
  end subroutine trouble_here

  !> Element and number in it of a point.
  pure function element_of(self, elastic, p) result(where_it_is)
    class(fem_matter_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: p
    integer(i4) :: where_it_is(2)
    where_it_is(1) = int(count(elastic%point <= p), i4)
    where_it_is(2) = p - elastic%point(where_it_is(1)) + 1
  end function element_of
end module fem_matter
