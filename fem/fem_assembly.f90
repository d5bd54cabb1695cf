!> Stiffness, mass and body forces of all elements on the pattern of the fields.
module fem_assembly
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type, blocks_of
  use fem_elastic, only: fem_elastic_type
  use fem_element, only: fem_shape_type, element_shape, element_stiffness, element_mass, &
    element_load
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stiffness
  use fem_sparse, only: fem_pattern_type, scatter, place
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: assemble_stiffness, assemble_mass, body_force, stiffness_of, lumped_mass_of

  integer(i4), parameter :: batch = 256  !! elements whose matrices are held at once

contains

  !> Stiffness blocks k(3, 3, entries) [N/m]. Elements are worked in parallel, added in order.
  subroutine assemble_stiffness(mesh, dofs, elastic, pattern, k)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: k(:, :, :)
    real(wp), allocatable :: ke(:, :, :, :, :)
    integer(i4) :: e, first, last, n

    if (.not. allocated(k)) allocate (k(3, 3, size(pattern%column)))
    k = 0.0_wp
    n = maxval(dofs%start(2:) - dofs%start(:mesh%elements))
    allocate (ke(3, 3, n, n, batch))
    do first = 1, mesh%elements, batch
      last = min(first + batch - 1, mesh%elements)
      !$omp parallel do default(none) shared(mesh, dofs, elastic, ke, first, last) &
      !$omp private(e, n) schedule(static)
      do e = first, last
        n = dofs%start(e + 1) - dofs%start(e)
        call stiffness_of(mesh, dofs, elastic, e, ke(:, :, :n, :n, e - first + 1))
      end do
      !$omp end parallel do
      do e = first, last
        call scatter(blocks_of(dofs, e), pattern, ke(:, :, :, :, e - first + 1), k)
      end do
    end do
  end subroutine assemble_stiffness

  !> Stiffness of element e, blocks a <= b [N/m, N, N m].
  subroutine stiffness_of(mesh, dofs, elastic, e, ke)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: ke(:, :, :, :)
    type(hex8_geometry_type) :: geometry
    type(fem_shape_type) :: shape

    associate (rule => elastic%rule(elastic%rule_of(e)), m => elastic%moduli(:, e), &
               factor => elastic%factor(elastic%point(e):elastic%point(e + 1) - 1), &
               node => dofs%block(dofs%start(e):))
      if (rule%brick) then
        call hex8_geometry(mesh%x(:, node(:8)), geometry)
        call hex8_stiffness(geometry, m(1) + 2.0_wp/3.0_wp*m(2), m(2), factor, rule%bbar, ke)
      else
        call element_shape(rule%at, mesh%x(:, node(:rule%nodes)), shape)
        call element_stiffness(rule, shape, m, factor, ke)
      end if
    end associate
  end subroutine stiffness_of

  !> Consistent mass, one scalar a pair of blocks, and lumped mass of the blocks [kg, kg m^2].
  subroutine assemble_mass(mesh, dofs, elastic, pattern, mass, lumped)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: mass(:), lumped(:)
    real(wp), allocatable :: me(:, :), le(:)
    integer(i4) :: e, a, b, p

    if (.not. allocated(mass)) allocate (mass(size(pattern%column)), lumped(dofs%blocks))
    mass = 0.0_wp
    lumped = 0.0_wp
    do e = 1, mesh%elements
      associate (block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
        call mass_of(mesh, elastic, e, block, me)
        do b = 1, size(block)
          do a = 1, b
            p = place(pattern, min(block(a), block(b)), max(block(a), block(b)))
            mass(p) = mass(p) + me(a, b)
          end do
        end do
        call lumped_of(elastic, e, me, le)
        lumped(block) = lumped(block) + le
      end associate
    end do
  end subroutine assemble_mass

  !> Consistent mass of element e.
  subroutine mass_of(mesh, elastic, e, block, mass)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e, block(:)
    real(wp), allocatable, intent(inout) :: mass(:, :)
    type(fem_shape_type) :: shape

    if (allocated(mass)) then
      if (size(mass, 1) /= size(block)) deallocate (mass)
    end if
    if (.not. allocated(mass)) allocate (mass(size(block), size(block)))
    associate (rule => elastic%rule(elastic%rule_of(e)))
      call element_shape(rule%mass_at, mesh%x(:, block(:rule%nodes)), shape)
      call element_mass(rule, shape, elastic%density(e), elastic%inertia(e), mass)
    end associate
  end subroutine mass_of

  !> Lumped mass of an element: row sums, or the diagonal scaled to the mass of each field (Hinton,
  !! Rock and Zienkiewicz 1976) where row sums would be negative.
  pure subroutine lumped_of(elastic, e, mass, lumped)
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: mass(:, :)
    real(wp), allocatable, intent(out) :: lumped(:)
    integer(i4) :: a, m
    lumped = sum(mass, 2)
    associate (rule => elastic%rule(elastic%rule_of(e)))
      if (.not. rule%hrz) return
      m = rule%nodes
      lumped = [(mass(a, a), a=1, size(mass, 1))]
      lumped(:m) = lumped(:m)*sum(mass(:m, :m))/sum(lumped(:m))
      if (rule%polar) lumped(m + 1:) = lumped(m + 1:)*sum(mass(m + 1:, m + 1:))/sum(lumped(m + 1:))
    end associate
  end subroutine lumped_of

  !> Lumped mass of element e [kg, kg m^2].
  subroutine lumped_mass_of(mesh, dofs, elastic, e, lumped)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), allocatable, intent(out) :: lumped(:)
    real(wp), allocatable :: mass(:, :)
    call mass_of(mesh, elastic, e, dofs%block(dofs%start(e):dofs%start(e + 1) - 1), mass)
    call lumped_of(elastic, e, mass, lumped)
  end subroutine lumped_mass_of

  !> Add the consistent forces (3, blocks) of a force per mass on all elements, and of a force and
  !! a couple per volume on chosen ones [N, N m].
  subroutine body_force(mesh, dofs, elastic, chosen, per_mass, per_volume, couple, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: chosen(:)       !! elements
    real(wp), intent(in) :: per_mass(3)        !! [m/s^2]
    real(wp), intent(in) :: per_volume(3)      !! [N/m^3]
    real(wp), intent(in) :: couple(3)          !! [N/m^2]
    real(wp), intent(inout) :: force(:, :)
    type(fem_shape_type) :: shape
    real(wp), allocatable :: f(:, :)
    integer(i4) :: k, e

    do k = 1, size(chosen)
      e = chosen(k)
      associate (rule => elastic%rule(elastic%rule_of(e)), &
                 block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
        if (allocated(shape%weight)) deallocate (shape%weight, shape%u, shape%phi)
        if (allocated(f)) deallocate (f)
        allocate (f(3, size(block)))
        call element_shape(rule%mass_at, mesh%x(:, block(:rule%nodes)), shape)
        call element_load(rule, shape, elastic%density(e)*per_mass + per_volume, couple, f)
        force(:, block) = force(:, block) + f
      end associate
    end do
  end subroutine body_force
end module fem_assembly
