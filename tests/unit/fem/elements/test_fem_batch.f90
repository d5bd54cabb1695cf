!> Batches of elements against the routines of one element: stiffness and mass of every formulation
!! on distorted elements; assembly of a mixed mesh with any number of threads.
program test_fem_batch
  use, intrinsic :: omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use fem_assembly, only: assemble_stiffness, assemble_mass, stiffness_of, lumped_mass_of
  use fem_batch, only: fem_batch_type, batch_room, batch_shape, batch_stiffness, batch_mass, &
    lanes, pair
  use fem_dofs, only: fem_dofs_type, number_fields, blocks_of
  use fem_elastic, only: fem_elastic_type
  use fem_element, only: fem_shape_type, element_shape, element_stiffness, element_mass
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stiffness
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  use fem_shape, only: reference_nodes
  use fem_sparse, only: fem_pattern_type, make_pattern, place
  use fem_strain, only: volume_gradients, strain_matrix, add_product
  use fem_types, only: fem_mesh_type
  implicit none
  type(test_type) :: test
  character(len=*), parameter :: names(14) = [character(len=11) :: 'hex8_bbar', 'hex8_full', &
    'hex20', 'hex27', 'hex27_bbar', &
    'tet4', 'tet10', 'wedge6', 'hex8/hex8', 'hex20/hex8', 'hex27/hex8', &
    'hex20/hex20', 'tet4/tet4', 'tet10/tet4']
  real(wp), parameter :: moduli(6) = [1.3_wp, 0.8_wp, 0.4_wp, 0.1_wp, 0.2_wp, 0.5_wp]
  integer(i4) :: k

  do k = 1, size(names)
    call check_rule(trim(names(k)))
  end do
  call check_assembly()
  call test%finish()

contains

  !> Nodes of a distorted element, another one for each number l.
  pure function nodes_of(rule, l) result(x)
    type(fem_formulation_type), intent(in) :: rule
    integer(i4), intent(in) :: l
    real(wp) :: x(3, rule%nodes)
    integer(i4) :: a
    x = reference_nodes(rule%kind)
    do a = 1, rule%nodes
      x(:, a) = x(:, a)*(1.0_wp + 0.05_wp*l) + 0.04_wp*[sin(1.3_wp*a + l), cos(2.1_wp*a), &
                                                        sin(0.7_wp*a*l)]
    end do
  end function nodes_of

  subroutine check_rule(name)
    character(len=*), intent(in) :: name
    type(fem_formulation_type) :: rule
    type(fem_batch_type) :: batch
    real(wp), allocatable :: k(:, :, :, :), mass(:, :)
    real(wp) :: m(6), worst(2)
    integer(i4) :: a, b, l, n

    call make_rule(rule_index(name), rule)
    n = rule%nodes + rule%rotations
    m = moduli
    if (.not. rule%polar) m(3:) = 0.0_wp
    call batch_room(rule, rule%at, batch)
    do l = 1, lanes
      batch%x(l, :, :) = nodes_of(rule, l)
      batch%moduli(l, :) = m*l
      batch%factor(l, :) = [(1.0_wp + 0.1_wp*sin(1.0_wp*a*l), a=1, rule%at%n)]
    end do
    call batch_shape(rule%at, batch)
    call batch_stiffness(rule, batch)
    allocate (k(3, 3, n, n), mass(n, n))
    worst = 0.0_wp
    do l = 1, lanes
      call single(rule, nodes_of(rule, l), batch%factor(l, :), m*l, k)
      do b = 1, n
        do a = 1, b
          worst(1) = larger(worst(1), max_abs(reshape(k(:, :, a, b), [9]) &
                                              - batch%k(l, :, pair(a, b)))/max_abs([k]))
        end do
      end do
    end do
    call test%check_close(name//': stiffness', worst(1), 0.0_wp, 1.0e-14_wp)
    call batch_room(rule, rule%mass_at, batch)
    do l = 1, lanes
      batch%x(l, :, :) = nodes_of(rule, l)
    end do
    call batch_shape(rule%mass_at, batch)
    call batch_mass(rule, batch)
    do l = 1, lanes
      call single_mass(rule, nodes_of(rule, l), mass)
      do b = 1, n
        do a = 1, b
          worst(2) = larger(worst(2), abs(mass(a, b) - batch%mass(l, pair(a, b)))/max_abs(mass))
        end do
      end do
    end do
    call test%check_close(name//': mass', worst(2), 0.0_wp, 1.0e-14_wp)
  end subroutine check_rule

  !> Stiffness by the routines of one element.
  subroutine single(rule, x, factor, m, k)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :), factor(:), m(6)
    real(wp), intent(out) :: k(:, :, :, :)
    type(fem_shape_type) :: shape
    type(hex8_geometry_type) :: geometry
    k = 0.0_wp
    if (rule%brick) then
      call hex8_geometry(x, geometry)
      call hex8_stiffness(geometry, m(1) + 2.0_wp/3.0_wp*m(2), m(2), factor, rule%bbar, k)
    else
      call element_shape(rule%at, x, shape)
      call element_stiffness(rule, shape, m, factor, k)
      if (rule%linear_volume) call by_strains(rule, x, shape, factor, m, k)
    end if
  end subroutine single

  !> Stiffness by the strains of B-bar at every point: sum w B' D B.
  subroutine by_strains(rule, x, shape, factor, m, k)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :), factor(:), m(6)
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(out) :: k(:, :, :, :)
    real(wp) :: fitted(3*rule%nodes, rule%at%n), b(3*rule%nodes, 6), d(6, 6)
    real(wp) :: whole(3*rule%nodes, 3*rule%nodes)
    integer(i4) :: q, i, j
    d = 0.0_wp
    d(:3, :3) = m(1)
    do i = 1, 6
      d(i, i) = d(i, i) + merge(2.0_wp, 1.0_wp, i <= 3)*m(2)
    end do
    whole = 0.0_wp
    call volume_gradients(rule, x, shape, fitted)
    do q = 1, rule%at%n
      call strain_matrix(rule, shape, q, fitted(:, q), b)
      call add_product(3*rule%nodes, b, d, shape%weight(q)*factor(q), whole)
    end do
    do j = 1, rule%nodes
      do i = 1, rule%nodes
        k(:, :, i, j) = whole(3*i - 2:3*i, 3*j - 2:3*j)
      end do
    end do
  end subroutine by_strains

  subroutine single_mass(rule, x, mass)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(out) :: mass(:, :)
    type(fem_shape_type) :: shape
    call element_shape(rule%mass_at, x, shape)
    call element_mass(rule, shape, 1.0_wp, 1.0_wp, mass)
  end subroutine single_mass

  !> Hexahedra of which every second one is polar, as their own stiffnesses one by one; the same
  !! bits with four threads.
  subroutine check_assembly()
    type(fem_mesh_type) :: mesh
    type(fem_elastic_type) :: elastic
    type(fem_dofs_type) :: dofs
    type(fem_pattern_type) :: pattern
    real(wp), allocatable :: k(:, :, :), again(:, :, :), mass(:), lumped(:), mass2(:), lumped2(:)

    call make_bar(11, mesh, elastic)
    call number_fields(mesh, elastic%rotations(), dofs)
    call make_pattern(dofs, pattern)
    call omp_set_num_threads(1)
    call assemble_stiffness(mesh, dofs, elastic, pattern, k)
    call assemble_mass(mesh, dofs, elastic, pattern, mass, lumped)
    call omp_set_num_threads(4)
    call assemble_stiffness(mesh, dofs, elastic, pattern, again)
    call assemble_mass(mesh, dofs, elastic, pattern, mass2, lumped2)
    call test%check('same stiffness with four threads', all(abs(k - again) <= 0.0_wp))
    call test%check('same mass with four threads', all(abs(mass - mass2) <= 0.0_wp) &
                    .and. all(abs(lumped - lumped2) <= 0.0_wp))
    call compare(mesh, elastic, dofs, pattern, k, lumped)
  end subroutine check_assembly

  subroutine make_bar(n, mesh, elastic)
    integer(i4), intent(in) :: n
    type(fem_mesh_type), intent(out) :: mesh
    type(fem_elastic_type), intent(out) :: elastic
    integer(i4) :: e, a, r
    mesh%nodes = 4*(n + 1)
    mesh%elements = n
    allocate (mesh%x(3, mesh%nodes), mesh%kind(n), mesh%start(n + 1), mesh%node(8*n))
    do a = 1, mesh%nodes
      e = mod(a - 1, 4) + 1
      mesh%x(:, a) = [merge(1.0_wp, 0.0_wp, e == 2 .or. e == 3), merge(1.0_wp, 0.0_wp, e > 2), &
                      real((a - 1)/4, wp)] + 0.1_wp*sin(1.7_wp*a)
    end do
    mesh%kind = 1
    mesh%start = [(8*e - 7, e=1, n + 1)]
    mesh%node = [((4*(e - 1) + a, a=1, 8), e=1, n)]
    call elastic%start(n)
    do e = 1, n
      call elastic%use_rule(trim(merge('hex8/hex8', 'hex8_bbar', mod(e, 2) == 0)), r)
      elastic%rule_of(e) = r
      elastic%moduli(:, e) = moduli*(1.0_wp + e)
      if (mod(e, 2) /= 0) elastic%moduli(3:, e) = 0.0_wp
      elastic%density(e) = 2.0_wp + e
      elastic%inertia(e) = 0.3_wp
    end do
    call elastic%number_points()
  end subroutine make_bar

  !> The sum of element matrices, added with a search of each place.
  subroutine compare(mesh, elastic, dofs, pattern, k, lumped)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :), lumped(:)
    real(wp) :: wanted(3, 3, size(k, 3)), heavy(dofs%blocks), upper(3, 3)
    real(wp), allocatable :: ke(:, :, :, :), le(:)
    integer(i4), allocatable :: block(:)
    integer(i4) :: e, a, b, p
    wanted = 0.0_wp
    heavy = 0.0_wp
    do e = 1, mesh%elements
      block = blocks_of(dofs, e)
      allocate (ke(3, 3, size(block), size(block)), source=0.0_wp)
      call stiffness_of(mesh, dofs, elastic, e, ke)
      call lumped_mass_of(mesh, dofs, elastic, e, le)
      heavy(block) = heavy(block) + le
      do b = 1, size(block)
        do a = 1, b
          p = place(pattern, min(block(a), block(b)), max(block(a), block(b)))
          upper = ke(:, :, a, b)
          if (block(a) > block(b)) upper = transpose(upper)
          wanted(:, :, p) = wanted(:, :, p) + upper
        end do
      end do
      deallocate (ke)
    end do
    call test%check_close('stiffness of the mesh', max_abs(k - wanted)/max_abs(wanted), &
                          0.0_wp, 1.0e-14_wp)
    call test%check_close('lumped mass of the mesh', &
                          max_abs(lumped - heavy)/maxval(heavy), 0.0_wp, 1.0e-14_wp)
  end subroutine compare
end program test_fem_batch
