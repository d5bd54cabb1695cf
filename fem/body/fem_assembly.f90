!> Stiffness, mass and body forces of all elements on the pattern of the fields.
!!
!! Elements are processed in batches of one formulation (fem_batch). Each thread owns the rows of a
!! range of nodes, computes all elements that touch them and adds to its own rows only, in the
!! order of the elements: the sums are the same bits for any number of threads.
module fem_assembly
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4
  use fem_batch, only: lanes, fem_batch_type, batch_room, batch_shape, batch_stiffness, &
    batch_mass, pair
  use fem_dofs, only: fem_dofs_type
  use fem_layered, only: layered_stiffness
  use fem_elastic, only: fem_elastic_type
  use fem_element, only: fem_shape_type, element_shape, element_stiffness, element_mass, &
    element_load
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stiffness
  use fem_sparse, only: fem_pattern_type, place
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: assemble_stiffness, assemble_mass, body_force, stiffness_of, lumped_mass_of, mass_of
  public :: share_nodes, elements_at, fill_batch

contains

  !> Stiffness blocks k(3, 3, entries) [N/m].
  subroutine assemble_stiffness(mesh, dofs, elastic, pattern, k)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: k(:, :, :)
    integer(i4), allocatable :: first(:)
    integer(i4) :: t

    if (.not. allocated(k)) allocate (k(3, 3, size(pattern%column)))
    call share_nodes(dofs, pattern, omp_get_max_threads(), first)
    !$omp parallel do default(none) shared(mesh, dofs, elastic, pattern, k, first) private(t) &
    !$omp schedule(static, 1)
    do t = 1, size(first) - 1
      call stiffness_share(mesh, dofs, elastic, pattern, first(t:t + 1), k)
    end do
    !$omp end parallel do
  end subroutine assemble_stiffness

  !> First node of each thread (and one past the last): about as many entries of the pattern each.
  subroutine share_nodes(dofs, pattern, threads, first)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: threads
    integer(i4), allocatable, intent(out) :: first(:)
    integer(i4) :: n, t, entries
    real(wp) :: sum_of
    allocate (first(threads + 1), source=dofs%nodes + 1)
    first(1) = 1
    t = 1
    sum_of = 0.0_wp
    do n = 1, dofs%nodes
      if (sum_of >= real(t, wp)*size(pattern%column)/threads .and. t < threads) then
        t = t + 1
        first(t) = n
      end if
      entries = pattern%start(n + 1) - pattern%start(n)
      if (dofs%phi(n) > 0) entries = entries + pattern%start(dofs%phi(n) + 1) &
                                     - pattern%start(dofs%phi(n))
      sum_of = sum_of + entries
    end do
  end subroutine share_nodes

  !> The elements of one formulation that touch the nodes range(1) to range(2) - 1.
  subroutine elements_at(mesh, elastic, r, range, chosen)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: r, range(2)
    integer(i4), allocatable, intent(out) :: chosen(:)
    integer(i4) :: e
    logical :: in(mesh%elements)
    do e = 1, mesh%elements
      in(e) = elastic%rule_of(e) == r
      if (in(e)) in(e) = any(mesh%node(mesh%start(e):mesh%start(e + 1) - 1) >= range(1) &
                             .and. mesh%node(mesh%start(e):mesh%start(e + 1) - 1) < range(2))
    end do
    chosen = pack([(e, e=1, mesh%elements)], in)
  end subroutine elements_at

  !> Positions, moduli and weights of points of up to `lanes` elements; the last one pads the batch.
  subroutine fill_batch(mesh, elastic, element, batch)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: element(:)
    type(fem_batch_type), intent(inout) :: batch
    integer(i4) :: l, e, a, q
    do l = 1, lanes
      e = element(min(l, size(element)))
      do a = 1, size(batch%x, 3)
        batch%x(l, :, a) = mesh%x(:, mesh%node(mesh%start(e) + a - 1))
      end do
      batch%moduli(l, :) = elastic%moduli(:, e)
      batch%share(l) = elastic%hourglass(e)
      if (size(batch%factor, 2) /= elastic%point(e + 1) - elastic%point(e)) cycle  ! mass points
      do q = 1, size(batch%factor, 2)
        batch%factor(l, q) = elastic%factor(elastic%point(e) + q - 1)
      end do
    end do
  end subroutine fill_batch

  !> The rows of the nodes of a range.
  subroutine stiffness_share(mesh, dofs, elastic, pattern, range, k)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: range(2)
    real(wp), intent(inout) :: k(:, :, :)
    type(fem_batch_type) :: batch
    integer(i4), allocatable :: chosen(:)
    integer(i4) :: r, i, l, n, e

    do n = range(1), range(2) - 1
      k(:, :, pattern%start(n):pattern%start(n + 1) - 1) = 0.0_wp
      if (dofs%phi(n) == 0) cycle
      k(:, :, pattern%start(dofs%phi(n)):pattern%start(dofs%phi(n) + 1) - 1) = 0.0_wp
    end do
    do r = 1, size(elastic%rule)
      call batch_room(elastic%rule(r), elastic%rule(r)%at, batch)
      call elements_at(mesh, elastic, r, range, chosen)
      do i = 1, size(chosen), lanes
        n = min(lanes, size(chosen) - i + 1)
        call fill_batch(mesh, elastic, chosen(i:i + n - 1), batch)
        call batch_shape(elastic%rule(r)%at, batch)
        call batch_stiffness(elastic%rule(r), batch)
        do l = 1, n
          e = chosen(i + l - 1)
          if (elastic%layered_of(e) > 0) &
            call layered_lane(mesh, dofs, elastic, e, batch%k(l, :, :))
          call add_blocks(dofs%block(dofs%start(e):dofs%start(e + 1) - 1), dofs%node, pattern, &
                          range, batch%k(l, :, :), k)
        end do
      end do
    end do
  end subroutine stiffness_share

  !> Stiffness of a layered element in its place in the batch.
  subroutine layered_lane(mesh, dofs, elastic, e, k)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(inout) :: k(:, :)  !! (9, pairs)
    real(wp), allocatable :: ke(:, :, :, :)
    integer(i4) :: a, b, n
    n = dofs%start(e + 1) - dofs%start(e)
    allocate (ke(3, 3, n, n))
    call stiffness_of(mesh, dofs, elastic, e, ke)
    do b = 1, n
      do a = 1, b
        k(:, pair(a, b)) = reshape(ke(:, :, a, b), [9])
      end do
    end do
  end subroutine layered_lane

  !> Add the blocks a <= b of an element to the rows of a range of nodes; a pair whose global order
  !! is turned is transposed.
  pure subroutine add_blocks(block, node, pattern, range, ke, k)
    integer(i4), intent(in) :: block(:), node(:), range(2)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: ke(:, :)
    real(wp), intent(inout) :: k(:, :, :)
    integer(i4) :: a, b, p, row
    do b = 1, size(block)
      do a = 1, b
        row = node(min(block(a), block(b)))
        if (row < range(1) .or. row >= range(2)) cycle
        p = place(pattern, min(block(a), block(b)), max(block(a), block(b)))
        call add_block(ke(:, pair(a, b)), block(a) > block(b), k(:, :, p))
      end do
    end do
  end subroutine add_blocks

  !> Add nine entries, column by column, or transposed.
  pure subroutine add_block(ke, transposed, k)
    real(wp), intent(in) :: ke(:)
    logical, intent(in) :: transposed
    real(wp), intent(inout) :: k(:, :)
    integer(i4) :: j
    if (transposed) then
      do j = 1, 3
        k(1, j) = k(1, j) + ke(j)
        k(2, j) = k(2, j) + ke(j + 3)
        k(3, j) = k(3, j) + ke(j + 6)
      end do
      return
    end if
    do j = 1, 3
      k(1, j) = k(1, j) + ke(3*j - 2)
      k(2, j) = k(2, j) + ke(3*j - 1)
      k(3, j) = k(3, j) + ke(3*j)
    end do
  end subroutine add_block

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
      if (rule%modes > 0 .or. rule%one_point .or. rule%linear_volume) then
        call batch_of_one(mesh, elastic, e, ke)
      else if (rule%brick) then
        call hex8_geometry(mesh%x(:, node(:8)), geometry)
        call hex8_stiffness(geometry, m(1) + 2.0_wp/3.0_wp*m(2), m(2), factor, rule%bbar, ke)
      else
        call element_shape(rule%at, mesh%x(:, node(:rule%nodes)), shape)
        if (elastic%layered_of(e) > 0) then
          call layered_stiffness(rule, shape, elastic%layered(elastic%layered_of(e)), factor, ke)
        else
          call element_stiffness(rule, shape, m, factor, ke)
        end if
      end if
    end associate
  end subroutine stiffness_of

  !> Stiffness of an element as a batch of one.
  subroutine batch_of_one(mesh, elastic, e, ke)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: ke(:, :, :, :)
    type(fem_batch_type) :: batch
    integer(i4) :: a, b
    associate (rule => elastic%rule(elastic%rule_of(e)))
      call batch_room(rule, rule%at, batch)
      call fill_batch(mesh, elastic, [e], batch)
      call batch_shape(rule%at, batch)
      call batch_stiffness(rule, batch)
      do b = 1, rule%nodes
        do a = 1, b
          ke(:, :, a, b) = reshape(batch%k(1, :, pair(a, b)), [3, 3])
        end do
      end do
    end associate
  end subroutine batch_of_one

  !> Consistent mass, one scalar a pair of blocks, and lumped mass of the blocks of all ranks'
  !! elements [kg, kg m^2].
  subroutine assemble_mass(mesh, dofs, elastic, pattern, mass, lumped)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), allocatable, intent(inout) :: mass(:), lumped(:)
    real(wp), allocatable :: sums(:, :)
    integer(i4), allocatable :: first(:)
    integer(i4) :: t

    if (.not. allocated(mass)) allocate (mass(size(pattern%column)), lumped(dofs%blocks))
    mass = 0.0_wp
    lumped = 0.0_wp
    call share_nodes(dofs, pattern, omp_get_max_threads(), first)
    !$omp parallel do default(none) shared(mesh, dofs, elastic, pattern, mass, lumped, first) &
    !$omp private(t) schedule(static, 1)
    do t = 1, size(first) - 1
      call mass_share(mesh, dofs, elastic, pattern, first(t:t + 1), mass, lumped)
    end do
    !$omp end parallel do
    if (.not. dofs%halo%several()) return
    sums = reshape(lumped, [1, size(lumped)])
    call dofs%halo%sum_up(sums)
    lumped = sums(1, :)
  end subroutine assemble_mass

  subroutine mass_share(mesh, dofs, elastic, pattern, range, mass, lumped)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: range(2)
    real(wp), intent(inout) :: mass(:), lumped(:)
    type(fem_batch_type) :: batch
    integer(i4), allocatable :: chosen(:)
    real(wp), allocatable :: me(:, :), le(:)
    integer(i4) :: r, i, l, m, e

    do r = 1, size(elastic%rule)
      call batch_room(elastic%rule(r), elastic%rule(r)%mass_at, batch)
      call elements_at(mesh, elastic, r, range, chosen)
      do i = 1, size(chosen), lanes
        m = min(lanes, size(chosen) - i + 1)
        call fill_batch(mesh, elastic, chosen(i:i + m - 1), batch)
        call batch_shape(elastic%rule(r)%mass_at, batch)
        call batch_mass(elastic%rule(r), batch)
        do l = 1, m
          e = chosen(i + l - 1)
          call whole_mass(elastic, e, batch%mass(l, :), me)
          call lumped_of(elastic, e, me, le)
          call add_mass(dofs, e, elastic%rule(r)%nodes, pattern, range, me, mass)
          call add_lumped(dofs, e, elastic%rule(r)%nodes, range, le, lumped)
        end do
      end do
    end do
  end subroutine mass_share

  !> Add the consistent mass of element e to the rows of a range of nodes.
  subroutine add_mass(dofs, e, nodes, pattern, range, me, mass)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e, nodes, range(2)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: me(:, :)
    real(wp), intent(inout) :: mass(:)
    integer(i4) :: of(2, dofs%start(e + 1) - dofs%start(e)), a, b, p, row
    associate (block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      of = places_of(int(size(block), i4), nodes, dofs%parts)
      do b = 1, size(block)
        do a = 1, b
          row = dofs%node(min(block(a), block(b)))
          if (row < range(1) .or. row >= range(2) .or. of(2, a) /= of(2, b)) cycle
          p = place(pattern, min(block(a), block(b)), max(block(a), block(b)))
          mass(p) = mass(p) + me(of(1, a), of(1, b))
        end do
      end do
    end associate
  end subroutine add_mass

  !> Add the lumped mass of element e to the blocks of a range of nodes.
  subroutine add_lumped(dofs, e, nodes, range, le, lumped)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e, nodes, range(2)
    real(wp), intent(in) :: le(:)
    real(wp), intent(inout) :: lumped(:)
    integer(i4) :: of(2, dofs%start(e + 1) - dofs%start(e)), b, row
    associate (block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      of = places_of(int(size(block), i4), nodes, dofs%parts)
      do b = 1, size(block)
        row = dofs%node(block(b))
        if (row < range(1) .or. row >= range(2)) cycle
        lumped(block(b)) = lumped(block(b)) + le(of(1, b))
      end do
    end associate
  end subroutine add_lumped

  !> Node of each block of an element, u first, counted through both fields, and its part: blocks of
  !! different parts have no mass between them.
  pure function places_of(blocks, nodes, parts) result(of)
    integer(i4), intent(in) :: blocks, nodes, parts
    integer(i4) :: of(2, blocks), b
    do b = 1, blocks
      of(:, b) = [b, 1]
      if (b > nodes) of(:, b) = [nodes + (b - nodes - 1)/parts + 1, mod(b - nodes - 1, parts) + 1]
    end do
  end function places_of

  !> Mass of element e from the integrals of its pairs.
  pure subroutine whole_mass(elastic, e, integrals, mass)
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: integrals(:)
    real(wp), allocatable, intent(inout) :: mass(:, :)
    integer(i4) :: a, b, m, n
    associate (rule => elastic%rule(elastic%rule_of(e)))
      m = rule%nodes
      n = m + rule%rotations
    end associate
    if (allocated(mass)) then
      if (size(mass, 1) /= n) deallocate (mass)
    end if
    if (.not. allocated(mass)) allocate (mass(n, n))
    do b = 1, n
      do a = 1, b
        mass(a, b) = elastic%density(e)*integrals(pair(a, b))
        if (a > m) mass(a, b) = elastic%inertia(e)*mass(a, b)
        mass(b, a) = mass(a, b)
      end do
    end do
  end subroutine whole_mass

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
      if (sum(lumped(:m)) > 0.0_wp) lumped(:m) = lumped(:m)*sum(mass(:m, :m))/sum(lumped(:m))
      if (sum(lumped(m + 1:)) > 0.0_wp) &
        lumped(m + 1:) = lumped(m + 1:)*sum(mass(m + 1:, m + 1:))/sum(lumped(m + 1:))
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
    integer(i4), allocatable :: of(:, :)
    integer(i4) :: n
    associate (rule => elastic%rule(elastic%rule_of(e)))
      n = rule%nodes + rule%rotations
      call mass_of(mesh, elastic, e, dofs%block(dofs%start(e):dofs%start(e) + n - 1), mass)
      call lumped_of(elastic, e, mass, lumped)
      if (dofs%parts == 1) return
      of = places_of(dofs%start(e + 1) - dofs%start(e), rule%nodes, dofs%parts)
      lumped = lumped(of(1, :))
    end associate
  end subroutine lumped_mass_of

  !> Add the consistent forces (3, blocks) of a force and a couple per volume on chosen elements
  !! [N, N m].
  subroutine body_force(mesh, dofs, elastic, chosen, per_volume, couple, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: chosen(:)       !! elements
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
        call element_load(rule, shape, per_volume, couple, f)
        force(:, block) = force(:, block) + f
      end associate
    end do
  end subroutine body_force
end module fem_assembly
