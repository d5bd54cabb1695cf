!> Trial stress, state and tangents of the points of elements, and their internal forces, for
!! displacements since the accepted state. Elements are processed in chunks whose number does not
!! depend on the threads.
module fem_points_trial
  use talus_kinds, only: wp, i4, i8
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_element, only: fem_shape_type
  use fem_finite, only: deform, finite_force
  use fem_geometry, only: fem_geometry_type, make_geometry
  use fem_law, only: integrate
  use fem_law_finite, only: fem_law_finite_type, at_ratio
  use fem_law_polar, only: fem_law_polar_type
  use fem_mm_element, only: mm_response_type
  use fem_points, only: fem_points_type, fem_work_type
  use fem_polar, only: full_of, symmetric_of
  use fem_polar_element, only: polar_answer
  use fem_strain, only: strain_of, add_force
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: work_elements, has_plain_stress, stress_forces

  integer(i4), parameter :: chunks = 64

contains

  !> Some elements in chunks; `bad` of the points is the first without a state, 0 if there is none.
  subroutine work_elements(self, mesh, dofs, elastic, u, moved, list)
    class(fem_points_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)  !! (3, blocks)
    integer(i4), intent(in) :: list(:)            !! elements
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
    self%bad = 0
    do c = chunks, 1, -1
      if (failed(c) > 0) self%bad = failed(c)
    end do
    if (self%bad > 0 .and. self%micro%active) &
      call explain(self, dofs, elastic, u, moved, self%bad)
  end subroutine work_elements

  !> First of n elements of chunk c.
  pure integer(i4) function first_of(c, n)
    integer(i4), intent(in) :: c, n
    first_of = int((c - 1)*int(n, i8)/chunks, i4) + 1
  end function first_of

  !> `bad` is the first point without a state.
  subroutine work_micro(self, dofs, elastic, u, moved, list, bad)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :), moved(:, :)
    integer(i4), intent(in) :: list(:)
    integer(i4), intent(out) :: bad
    type(mm_response_type) :: response
    integer(i4) :: k, failed
    bad = 0
    do k = 1, size(list)
      associate (e => list(k), first => elastic%point(list(k)), &
                 last => elastic%point(list(k) + 1) - 1, &
                 a => dofs%start(list(k)), b => dofs%start(list(k) + 1) - 1)
        call self%micro%answer(e, u(:, dofs%block(a:b)) - moved(:, dofs%block(a:b)), &
          u(:, dofs%block(a:b)), self%accepted_state(:, first:last), response, &
          self%stress(:, first:last), self%state(:, first:last), failed)
        if (bad == 0 .and. failed > 0) bad = first + failed - 1
        if (failed == 0) self%nodal(:, a:b) = reshape(response%force, [3, b - a + 1])
      end associate
    end do
  end subroutine work_micro

  !> Why point p of a micromorphic body found no state.
  subroutine explain(self, dofs, elastic, u, moved, p)
    class(fem_points_type), intent(inout) :: self
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
    class(fem_points_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    integer(i4), intent(in) :: list(:)
    integer(i4), intent(out) :: bad
    type(fem_geometry_type) :: geometry
    type(fem_work_type) :: work
    integer(i4) :: k, rule, failed
    bad = 0
    rule = 0
    do k = 1, size(list)
      work%element = list(k)
      if (allocated(self%geometry)) then
        call work_element(self, dofs, elastic, moved, self%geometry(list(k)), work, failed)
      else
        if (elastic%rule_of(list(k)) /= rule) geometry = fem_geometry_type()
        rule = elastic%rule_of(list(k))
        call make_geometry(elastic%rule(rule), mesh, dofs, list(k), geometry)
        call work_element(self, dofs, elastic, moved, geometry, work, failed)
      end if
      if (bad == 0) bad = failed
    end do
  end subroutine work_part

  !> An element by its kind of law; `bad` is the first point without a state, 0 if there is none.
  subroutine work_element(self, dofs, elastic, moved, geometry, work, bad)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    type(fem_geometry_type), intent(in) :: geometry
    type(fem_work_type), intent(inout) :: work
    integer(i4), intent(out) :: bad
    bad = 0
    associate (e => work%element)
      if (elastic%is_absent(e) .or. is_weightless(self, elastic, e)) then
        self%nodal(:, dofs%start(e):dofs%start(e + 1) - 1) = 0.0_wp
      else if (self%law(self%law_of(e))%law%finite) then
        call deform_element(self, dofs, elastic, geometry%shape, work, bad)
      else if (self%law(self%law_of(e))%law%polar) then
        call turn_element(self, dofs, elastic, moved, geometry%shape, e, bad)
      else
        call update_element(self, dofs, elastic, moved, geometry, e, bad)
      end if
    end associate
  end subroutine work_element

  !> Has a partner taken all weight from element e? It keeps its state then.
  pure logical function is_weightless(self, elastic, e)
    class(fem_points_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    is_weightless = .not. any(abs(self%weight(elastic%point(e): &
      elastic%point(e + 1) - 1)) > 0.0_wp)
  end function is_weightless

  subroutine update_element(self, dofs, elastic, moved, geometry, e, bad)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    type(fem_geometry_type), intent(in) :: geometry
    integer(i4), intent(in) :: e
    integer(i4), intent(out) :: bad
    real(wp), dimension(3, elastic%rule(elastic%rule_of(e))%nodes) :: d, f
    real(wp) :: strain(6), stress(6)
    logical :: good, wide
    integer(i4) :: q, p, n
    bad = 0
    wide = size(self%stress, 1) > size(stress)  ! a body with micropolar parts
    associate (rule => elastic%rule(elastic%rule_of(e)), law => self%law(self%law_of(e))%law, &
               first => dofs%start(e), last => dofs%start(e + 1) - 1)
      n = self%law(self%law_of(e))%law%states
      d = moved(:, dofs%block(first:last))
      f = 0.0_wp
      do q = 1, rule%at%n
        p = elastic%point(e) + q - 1
        strain = strain_of(geometry%shape%u(:, :, q), d)
        if (rule%bbar) strain(:3) = strain(:3) &
          + (product_sum(geometry%volume(:, :, q), d) - sum(strain(:3)))/3.0_wp
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
        call add_stress(geometry, rule%bbar, q, self%weight(p)*stress, f)
      end do
      self%nodal(:, first:last) = f
    end associate
  end subroutine update_element

  !> Nodal forces of a stress times the weight of its point q.
  pure subroutine add_stress(geometry, bbar, q, given, f)
    type(fem_geometry_type), intent(in) :: geometry
    logical, intent(in) :: bbar
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: given(6)              !! [N m]
    real(wp), intent(inout), contiguous :: f(:, :)  !! (3, nodes) [N]
    real(wp) :: push(6), pressure
    push = given
    if (bbar) then
      pressure = sum(push(:3))/3.0_wp
      push(:3) = push(:3) - pressure
      f = f + pressure*geometry%volume(:, :, q)
    end if
    call add_force(geometry%shape%u(:, :, q), push, f)
  end subroutine add_stress

  !> Do the accepted stresses of all points give the forces, by geometry that is kept?
  pure logical function has_plain_stress(self) result(plain)
    class(fem_points_type), intent(in) :: self
    integer(i4) :: k
    plain = allocated(self%geometry) .and. .not. (self%micro%active .or. self%finite) &
            .and. size(self%stress, 1) == 6
    if (.not. plain) return
    do k = 1, size(self%law)
      plain = plain .and. .not. self%law(k)%law%polar
    end do
  end function has_plain_stress

  !> Forces of the accepted stresses, without a law: those of the update that was accepted, to
  !! rounding.
  subroutine stress_forces(self, dofs, elastic)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4) :: e
    !$omp parallel do default(none) shared(self, dofs, elastic) private(e)
    do e = 1, size(self%geometry)
      call stress_force(self, dofs, elastic, self%geometry(e), e)
    end do
    !$omp end parallel do
  end subroutine stress_forces

  subroutine stress_force(self, dofs, elastic, geometry, e)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_geometry_type), intent(in) :: geometry
    integer(i4), intent(in) :: e
    real(wp) :: f(3, elastic%rule(elastic%rule_of(e))%nodes)
    integer(i4) :: q, p
    f = 0.0_wp
    associate (rule => elastic%rule(elastic%rule_of(e)))
      if (.not. (elastic%is_absent(e) .or. is_weightless(self, elastic, e))) then
        do q = 1, rule%at%n
          p = elastic%point(e) + q - 1
          call add_stress(geometry, rule%bbar, q, self%weight(p)*self%accepted_stress(:, p), f)
        end do
      end if
    end associate
    self%nodal(:, dofs%start(e):dofs%start(e + 1) - 1) = f
  end subroutine stress_force

  !> Sum of products, component by component.
  pure real(wp) function product_sum(a, b)
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)
    product_sum = sum(a*b)
  end function product_sum

  !> A micropolar element.
  subroutine turn_element(self, dofs, elastic, moved, shape, e, bad)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: moved(:, :)
    type(fem_shape_type), intent(in) :: shape
    integer(i4), intent(in) :: e
    integer(i4), intent(out) :: bad
    associate (rule => elastic%rule(elastic%rule_of(e)), a => elastic%point(e), &
               b => elastic%point(e + 1) - 1, first => dofs%start(e), last => dofs%start(e + 1) - 1)
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
  subroutine deform_element(self, dofs, elastic, shape, work, bad)
    class(fem_points_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_shape_type), intent(in) :: shape
    type(fem_work_type), intent(inout) :: work
    integer(i4), intent(out) :: bad
    integer(i4) :: e

    e = work%element
    associate (rule => elastic%rule(elastic%rule_of(e)), a => elastic%point(e), &
               b => elastic%point(e + 1) - 1, first => dofs%start(e), last => dofs%start(e + 1) - 1)
      call deform(rule, shape, self%u(:, dofs%block(first:last)), work%motion, bad)
      if (bad > 0) then
        self%state(at_ratio, a:b) = work%motion%ratio
        self%nodal(:, first:last) = 0.0_wp
      else
        select type (law => self%law(self%law_of(e))%law)
        class is (fem_law_finite_type)
          call finite_force(law, shape, work%motion, self%weight(a:b), self%stress(:, a:b), &
                            self%state(:, a:b), self%nodal(:, first:last), bad)
        end select
      end if
      if (bad > 0) bad = a + bad - 1
    end associate
  end subroutine deform_element
end module fem_points_trial
