!> The liquid in the pores of a body at its elements: forces, matrices and contents of a step,
!! energies and flow. Elements are those of fem_pore_element; in statics their integrals are kept
!! (fem_pore_integrals), for each step takes the elements four times.
module fem_pore
  use talus_kinds, only: wp, i4, i8
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_pore_element, only: fem_flow_change_type, fem_flow_energy_type, fem_flow_step_type, &
    fem_skeleton_type, fem_wet_type, wet_shape, wet_force, wet_matrix, wet_energy, wet_content, &
    wet_size, constant_permeability, permeability_factor, mean_strain
  use fem_pore_faces, only: add_leaks, let_in
  use fem_pore_integrals, only: integrate_wet, integrals_size, flow_force, flow_matrix, &
    flow_energy, flow_content, flow_size, flow_strain
  use fem_pore_state, only: fem_pore_state_type
  use fem_retention, only: bear
  use fem_rules, only: fem_formulation_type
  use fem_scatter, only: add_flow
  use fem_sparse, only: fem_pattern_type
  use fem_types, only: fem_mesh_type
  use fem_unsaturated, only: has_retention, moist_energy, moist_force, moist_gain, moist_matrix, &
    moist_means, moist_size
  implicit none
  private
  public :: fem_pore_type, shape_of

  integer(i4), parameter :: chunks = 64       !! of elements, whatever the number of threads
  real(wp), parameter :: least = 1.0e-5_wp    !! share of volumes that cancel in a balance's size
  integer(i8), parameter :: most_kept = 2_i8**27  !! reals of integrals, 1 GiB

  type, extends(fem_pore_state_type) :: fem_pore_type
  contains
    procedure :: keep
    procedure :: borne_at
    procedure :: renew_mobility
    procedure, private :: change_of, gather
    procedure :: force
    procedure :: add_matrix
    procedure :: account
    procedure :: element_flow
  end type fem_pore_type

contains

  !> Keep the integrals of the elements over the steps of a static analysis, where there is room.
  subroutine keep(self, mesh, elastic)
    class(fem_pore_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_wet_type) :: wet
    integer(i8) :: reals
    integer(i4) :: e, rule
    if (.not. self%active .or. self%unsaturated) return
    reals = 0
    do e = 1, mesh%elements
      if (self%skeleton_of(e) > 0) reals = reals + integrals_size(elastic%rule(elastic%rule_of(e)))
    end do
    if (allocated(self%kept)) deallocate (self%kept)
    if (reals > most_kept) return
    allocate (self%kept(mesh%elements))
    rule = 0
    do e = 1, mesh%elements
      if (self%skeleton_of(e) == 0) cycle
      call shape_of(self, mesh, elastic, e, rule, wet)
      call integrate_wet(elastic%rule(rule), self%skeleton(self%skeleton_of(e)), wet, &
        mesh%x(:, mesh%node(mesh%start(e):mesh%start(e) + elastic%rule(rule)%nodes - 1)), &
        self%step%gravity, self%kept(e))
    end do
  end subroutine keep

  !> Pressure that the skeleton bears at point q of element e [Pa].
  pure real(wp) function borne_at(self, dofs, elastic, u, e, q) result(p)
    class(fem_pore_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)  !! (3, blocks)
    integer(i4), intent(in) :: e, q
    real(wp), dimension(elastic%rule(elastic%rule_of(e))%corners) :: borne, slope
    p = 0.0_wp
    if (.not. self%active) return
    if (self%skeleton_of(e) == 0) return
    call bear(self%skeleton(self%skeleton_of(e))%retention, &
              u(1, dofs%wet(dofs%wet_start(e):dofs%wet_start(e + 1) - 1)), borne, slope)
    p = dot_product(elastic%rule(elastic%rule_of(e))%at%corner(:, q), borne)
  end function borne_at

  !> Permeabilities of a step are those of the state `u` at its start.
  subroutine renew_mobility(self, mesh, dofs, elastic, u)
    class(fem_pore_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)  !! (3, blocks)
    type(fem_wet_type) :: wet
    real(wp) :: strain
    integer(i4) :: e, rule, k
    if (all(self%skeleton%law == constant_permeability)) return
    rule = 0
    do e = 1, mesh%elements
      k = self%skeleton_of(e)
      if (k == 0) cycle
      if (self%skeleton(k)%law == constant_permeability) cycle
      associate (block => dofs%block(dofs%start(e):dofs%start(e) &
                                     + elastic%rule(elastic%rule_of(e))%nodes - 1))
        if (allocated(self%kept)) then
          strain = flow_strain(self%kept(e), u(:, block) - self%start(:, block))
        else
          call shape_of(self, mesh, elastic, e, rule, wet)
          strain = mean_strain(wet, u(:, block) - self%start(:, block))
        end if
        self%pervious(e) = permeability_factor(self%skeleton(k), strain)
      end associate
    end do
  end subroutine renew_mobility

  !> The step of element e from the state `old`.
  pure function change_of(self, dofs, elastic, e, old, moved) result(change)
    class(fem_pore_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: old(:, :), moved(:, :)  !! (3, blocks)
    type(fem_flow_change_type) :: change
    associate (n => elastic%rule(elastic%rule_of(e))%nodes, &
               p => dofs%wet(dofs%wet_start(e):dofs%wet_start(e + 1) - 1))
      associate (block => dofs%block(dofs%start(e):dofs%start(e) + n - 1))
        allocate (change%moved(3, n), change%p(size(p), 2))
        change%moved = moved(:, block)
        change%p(:, 1) = old(1, p)
        change%p(:, 2) = old(1, p) + moved(1, p)
        if (self%unsaturated) change%gone = old(:, block) - self%start(:, block)
        if (.not. allocated(self%swing)) return
        allocate (change%a(3, n))
        change%a = self%swing(:, block)
      end associate
    end associate
  end function change_of

  !> What a step moves at the nodes of element e, and the pressures of its corners at start and end.
  pure subroutine gather(self, dofs, e, old, moved, d, p)
    class(fem_pore_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: old(:, :), moved(:, :)  !! (3, blocks)
    real(wp), intent(out) :: d(:, :)                !! (3, nodes) [m]
    real(wp), intent(out) :: p(:, :)                !! (corners, 2) [Pa]
    integer(i4) :: a, block
    do a = 1, self%kept(e)%solid/3
      block = dofs%block(dofs%start(e) + a - 1)
      d(:, a) = moved(:, block)
    end do
    do a = 1, self%kept(e)%corners
      block = dofs%wet(dofs%wet_start(e) + a - 1)
      p(a, 1) = old(1, block)
      p(a, 2) = old(1, block) + moved(1, block)
    end do
  end subroutine gather

  !> Add internal forces to the rows of displacements [N], and to those of pressures the inflow less
  !! the content gained in a step from the state `old` [m^3].
  subroutine force(self, mesh, dofs, elastic, old, moved, total)
    class(fem_pore_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: old(:, :), moved(:, :)  !! (3, blocks)
    real(wp), intent(inout) :: total(:, :)
    real(wp), allocatable :: nodal(:, :), volume(:, :)
    integer(i4) :: c, k
    if (.not. self%active) return
    call self%note_trial(old, moved)
    allocate (nodal(3, size(dofs%block)), volume(2, size(dofs%wet)), source=0.0_wp)
    !$omp parallel do default(none) private(c) schedule(dynamic) &
    !$omp shared(self, mesh, dofs, elastic, old, moved, nodal, volume)
    do c = 1, chunks
      call chunk_forces(self, mesh, dofs, elastic, old, moved, c)
    end do
    !$omp end parallel do
    do k = 1, size(dofs%block)
      total(:, dofs%block(k)) = total(:, dofs%block(k)) + nodal(:, k)
    end do
    self%rate = self%given
    self%gross = abs(self%step%dt*self%given)
    call let_in(self%leak, self%step, old(1, :), old(1, :) + moved(1, :), self%rate, self%gross)
    total(1, :) = total(1, :) + self%step%dt*self%rate
    call self%store_beside(moved, total)
    do k = 1, size(dofs%wet)
      total(1, dofs%wet(k)) = total(1, dofs%wet(k)) + volume(1, k)
      self%gross(dofs%wet(k)) = self%gross(dofs%wet(k)) + abs(volume(1, k)) + least*volume(2, k)
    end do

  contains

    subroutine chunk_forces(self, mesh, dofs, elastic, old, moved, c)
      class(fem_pore_type), intent(in) :: self
      type(fem_mesh_type), intent(in) :: mesh
      type(fem_dofs_type), intent(in) :: dofs
      type(fem_elastic_type), intent(in) :: elastic
      real(wp), intent(in) :: old(:, :), moved(:, :)
      integer(i4), intent(in) :: c
      type(fem_wet_type) :: wet
      type(fem_flow_change_type) :: change
      integer(i4) :: e, rule
      rule = 0
      do e = first_of(c, mesh%elements), first_of(c + 1_i4, mesh%elements) - 1
        if (self%skeleton_of(e) == 0) cycle
        associate (n => elastic%rule(elastic%rule_of(e))%nodes, a => dofs%start(e), &
                   b => dofs%wet_start(e), m => dofs%wet_start(e + 1) - 1)
          if (allocated(self%kept)) then
            call kept_forces(self, dofs, old, moved, e, nodal(:, a:a + n - 1), volume(:, b:m))
            cycle
          end if
          call shape_of(self, mesh, elastic, e, rule, wet)
          change = self%change_of(dofs, elastic, e, old, moved)
          call element_force(elastic%rule(rule), self%solid_of(e), wet, self%step, change, &
                             nodal(:, a:a + n - 1), volume(:, b:m))
        end associate
      end do
    end subroutine chunk_forces
  end subroutine force

  !> Forces of an element at its points; `volume` has what its corners lose and its size.
  pure subroutine element_force(rule, solid, wet, step, change, nodal, volume)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: solid
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    real(wp), intent(out) :: nodal(:, :), volume(:, :)
    real(wp) :: flow(size(volume, 2))
    if (has_retention(solid)) then
      call moist_force(rule, solid, wet, step, change, nodal, flow)
      volume(2, :) = moist_size(solid, wet, step, change)
    else
      call wet_force(rule, solid, wet, step, change, nodal, flow)
      volume(2, :) = wet_size(solid, wet, step, change)
    end if
    volume(1, :) = flow
  end subroutine element_force

  !> Forces of element e by its kept integrals; `volume` has what its corners lose and its size.
  subroutine kept_forces(self, dofs, old, moved, e, nodal, volume)
    class(fem_pore_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(in) :: old(:, :), moved(:, :)
    integer(i4), intent(in) :: e
    real(wp), intent(out), contiguous :: nodal(:, :), volume(:, :)
    real(wp) :: d(3, self%kept(e)%solid/3), p(self%kept(e)%corners, 2), flow(size(p, 1))
    call self%gather(dofs, e, old, moved, d, p)
    call flow_force(self%kept(e), self%pervious(e), self%step, d, p, nodal, flow)
    volume(1, :) = flow
    volume(2, :) = flow_size(self%kept(e), self%solid_of(e), self%step, d, p)
  end subroutine kept_forces

  !> First of n elements of chunk c.
  pure integer(i4) function first_of(c, n)
    integer(i4), intent(in) :: c, n
    first_of = int((c - 1)*int(n, i8)/chunks, i4) + 1
  end function first_of

  !> Element e at its points; `rule` is that of the element before, and then its own.
  pure subroutine shape_of(self, mesh, elastic, e, rule, wet)
    class(fem_pore_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    integer(i4), intent(inout) :: rule
    type(fem_wet_type), intent(inout) :: wet
    if (elastic%rule_of(e) /= rule .and. allocated(wet%slope)) then
      deallocate (wet%slope, wet%volume, wet%steady)
      deallocate (wet%shape%u, wet%shape%phi, wet%shape%weight)
    end if
    rule = elastic%rule_of(e)
    call wet_shape(elastic%rule(rule), mesh%x(:, mesh%node(mesh%start(e):mesh%start(e) &
                   + elastic%rule(rule)%nodes - 1)), self%shear(e), wet)
  end subroutine shape_of

  !> Add the slopes of `force` to a matrix in blocks of the pattern.
  subroutine add_matrix(self, mesh, dofs, elastic, pattern, k, lower)
    class(fem_pore_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    type(fem_wet_type) :: wet
    real(wp), allocatable :: coupling(:, :, :), flow(:, :)
    integer(i4) :: e, rule
    if (.not. self%active) return
    call add_leaks(self%leak, self%step, pattern, k)
    if (allocated(self%beside)) then
      do e = dofs%solid + 1, dofs%blocks
        k(1, 1, pattern%start(e)) = k(1, 1, pattern%start(e)) - self%beside(e)
      end do
    end if
    rule = 0
    do e = 1, mesh%elements
      if (self%skeleton_of(e) == 0) cycle
      associate (n => elastic%rule(elastic%rule_of(e))%nodes, &
                 m => elastic%rule(elastic%rule_of(e))%corners)
        if (allocated(flow)) then
          if (size(coupling) /= 6*n*m) deallocate (coupling, flow)
        end if
        if (.not. allocated(flow)) allocate (coupling(3*n, m, 2), flow(m, m))
        if (allocated(self%kept)) then
          call flow_matrix(self%kept(e), self%pervious(e), self%step, coupling, flow)
        else
          call shape_of(self, mesh, elastic, e, rule, wet)
          call element_matrix(self, dofs, elastic, wet, e, coupling, flow)
        end if
        call add_flow(dofs%block(dofs%start(e):dofs%start(e) + n - 1), &
          dofs%wet(dofs%wet_start(e):dofs%wet_start(e + 1) - 1), pattern, coupling, flow, k, lower)
      end associate
    end do
  end subroutine add_matrix

  !> Matrix of element e at its points.
  subroutine element_matrix(self, dofs, elastic, wet, e, coupling, flow)
    class(fem_pore_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_wet_type), intent(in) :: wet
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: coupling(:, :, :), flow(:, :)
    associate (rule => elastic%rule(elastic%rule_of(e)))
      if (has_retention(self%skeleton(self%skeleton_of(e)))) then
        call moist_matrix(rule, self%solid_of(e), wet, self%step, &
          self%change_of(dofs, elastic, e, self%tried_from, self%tried), coupling, flow)
      else
        call wet_matrix(rule, self%solid_of(e), wet, self%step, coupling, flow)
      end if
    end associate
  end subroutine element_matrix

  !> Energies of a step to the state `u`, and the content there beyond that of the start [m^3].
  subroutine account(self, mesh, dofs, elastic, old, u, energy)
    class(fem_pore_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: old(:, :), u(:, :)  !! (3, blocks)
    type(fem_flow_energy_type), intent(out) :: energy
    real(wp) :: part(7, chunks)  !! content and energies
    real(wp) :: kept(2)
    real(wp), allocatable :: moved(:, :), gone(:, :)
    integer(i4) :: c
    allocate (moved, gone, mold=u)
    moved = u - old
    gone = u - self%start
    part = 0.0_wp
    !$omp parallel do default(none) private(c) schedule(dynamic) &
    !$omp shared(self, mesh, dofs, elastic, old, moved, gone, part)
    do c = 1, chunks
      if (allocated(self%kept)) then
        call account_kept(self, dofs, old, moved, gone, c, part(:, c))
      else
        call account_points(c)
      end if
    end do
    !$omp end parallel do
    kept = self%kept_beside(u)
    self%books%content = kept(1)
    energy%stored = energy%stored + kept(2)
    do c = 1, chunks
      self%books%content = self%books%content + part(1, c)
      energy%stored = energy%stored + part(2, c)
      energy%darcy = energy%darcy + part(3, c)
      energy%fall = energy%fall + part(4, c)
      energy%numerical = energy%numerical + part(5, c)
      energy%gained = energy%gained + part(6, c)
      energy%weight = energy%weight + part(7, c)
    end do

  contains

    subroutine account_points(c)
      integer(i4), intent(in) :: c
      type(fem_wet_type) :: wet
      type(fem_flow_change_type) :: since, change
      integer(i4) :: e, rule
      rule = 0
      do e = first_of(c, mesh%elements), first_of(c + 1_i4, mesh%elements) - 1
        if (self%skeleton_of(e) == 0) cycle
        call shape_of(self, mesh, elastic, e, rule, wet)
        since = self%change_of(dofs, elastic, e, self%start, gone)
        change = self%change_of(dofs, elastic, e, old, moved)
        call sum_element(elastic%rule(rule), self%solid_of(e), wet, self%step, since, change, &
                         part(:, c))
      end do
    end subroutine account_points
  end subroutine account

  !> Add content and energies of an element at its points; `since` is the change since the start.
  pure subroutine sum_element(rule, solid, wet, step, since, change, part)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: solid
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: since, change
    real(wp), intent(inout) :: part(7)
    if (has_retention(solid)) then
      call sum_up(moist_gain(rule, solid, wet, since), &
                  moist_energy(rule, solid, wet, step, change), part)
    else
      call sum_up(wet_content(rule, solid, wet, since%moved, since%p(:, 2) - since%p(:, 1)), &
                  wet_energy(rule, solid, wet, step, change), part)
    end if
  end subroutine sum_element

  !> `account` of a chunk by kept integrals; `gone` is the change since the start.
  subroutine account_kept(self, dofs, old, moved, gone, c, part)
    class(fem_pore_type), intent(in) :: self
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(in) :: old(:, :), moved(:, :), gone(:, :)  !! (3, blocks)
    integer(i4), intent(in) :: c
    real(wp), intent(inout) :: part(7)
    integer(i4) :: e
    do e = first_of(c, size(self%kept)), first_of(c + 1_i4, size(self%kept)) - 1
      if (self%skeleton_of(e) > 0) call account_element()
    end do

  contains

    subroutine account_element()
      real(wp) :: d(3, self%kept(e)%solid/3), p(self%kept(e)%corners, 2)
      real(wp) :: content
      call self%gather(dofs, e, gone, gone, d, p)
      content = flow_content(self%kept(e), d, p(:, 1))
      call self%gather(dofs, e, old, moved, d, p)
      call sum_up(content, flow_energy(self%kept(e), self%pervious(e), self%step, p), part)
    end subroutine account_element
  end subroutine account_kept

  !> Add content and energies of an element.
  pure subroutine sum_up(content, energy, part)
    real(wp), intent(in) :: content
    type(fem_flow_energy_type), intent(in) :: energy
    real(wp), intent(inout) :: part(7)
    part = part + [content, energy%stored, energy%darcy, energy%fall, energy%numerical, &
      energy%gained, energy%weight]
  end subroutine sum_up

  !> Means over element e: Darcy's flow [m/s], the pressure that the skeleton bears [Pa] and the
  !! saturation.
  subroutine element_flow(self, mesh, dofs, elastic, u, e, flow)
    class(fem_pore_type), intent(in) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)   !! (3, blocks)
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: flow(5)
    type(fem_wet_type) :: wet
    integer(i4) :: rule
    flow = 0.0_wp
    if (self%skeleton_of(e) == 0) return
    rule = 0
    call shape_of(self, mesh, elastic, e, rule, wet)
    flow = moist_means(elastic%rule(rule), self%solid_of(e), wet, self%step%gravity, &
                       u(1, dofs%wet(dofs%wet_start(e):dofs%wet_start(e + 1) - 1)))
  end subroutine element_flow
end module fem_pore
