!> Forces of a mesh of one-point hexahedra: those of its stiffness, the same bits for any number of
!! threads; not used where the mesh has another formulation.
program test_fem_one_point
  use, intrinsic :: omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_assembly, only: assemble_stiffness
  use fem_dofs, only: fem_dofs_type, number_fields
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: hex8
  use fem_one_point, only: fem_one_point_type
  use fem_sparse, only: fem_pattern_type, make_pattern, multiply
  use fem_topology, only: set_elements
  use fem_types, only: fem_mesh_type
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 5

  call check_block()
  call test%finish()

contains

  !> n x n x n bricks, nodes moved about.
  subroutine make_block(mesh)
    type(fem_mesh_type), intent(out) :: mesh
    integer(i4) :: cell(8, n**3), i, j, k, e, a
    allocate (mesh%x(3, (n + 1)**3))
    do a = 1, (n + 1)**3
      mesh%x(:, a) = [mod(a - 1, n + 1), mod((a - 1)/(n + 1), n + 1), (a - 1)/(n + 1)**2] &
        + 0.1_wp*[sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a)]
    end do
    do e = 1, n**3
      i = mod(e - 1, n)
      j = mod((e - 1)/n, n)
      k = (e - 1)/n**2
      a = 1 + i + (n + 1)*(j + (n + 1)*k)
      cell(:4, e) = a + [0, 1, n + 2, n + 1]
      cell(5:, e) = cell(:4, e) + (n + 1)**2
    end do
    call set_elements(mesh, hex8, cell)
  end subroutine make_block

  subroutine check_block()
    type(fem_mesh_type) :: mesh
    type(fem_elastic_type) :: elastic
    type(fem_dofs_type) :: dofs
    type(fem_pattern_type) :: pattern
    type(fem_one_point_type) :: fast
    real(wp), allocatable :: k(:, :, :)
    real(wp), dimension(3, (n + 1)**3) :: u, wanted, f, again
    integer(i4) :: a, r

    call make_block(mesh)
    call elastic%start(mesh%elements)
    call elastic%use_rule('hex8_one_point', r)
    elastic%rule_of = r
    do a = 1, mesh%elements
      elastic%moduli(:2, a) = [1.2_wp + sin(1.0_wp*a)*0.2_wp, 0.8_wp]
    end do
    call elastic%number_points()
    elastic%factor = [(1.0_wp + 0.1_wp*cos(1.0_wp*a), a=1, elastic%points)]
    call number_fields(mesh, elastic%rotations(), dofs)
    call make_pattern(dofs, pattern)
    call assemble_stiffness(mesh, dofs, elastic, pattern, k)
    do a = 1, mesh%nodes
      u(:, a) = [sin(1.1_wp*a), cos(0.6_wp*a), sin(2.3_wp*a)]
    end do
    call multiply(pattern, k, u, wanted)
    call omp_set_num_threads(1)
    call fast%prepare(mesh, dofs, elastic, pattern)
    call test%check('ready', fast%ready)
    call fast%force(u, f)
    call test%check_close('forces are K u', max_abs(f - wanted)/max_abs(wanted), 0.0_wp, &
                          1.0e-14_wp)
    call omp_set_num_threads(3)
    call fast%prepare(mesh, dofs, elastic, pattern)
    call fast%force(u, again)
    call test%check('same bits with three threads', all(abs(f - again) <= 0.0_wp))
    call elastic%use_rule('hex8_full', r)
    call fast%prepare(mesh, dofs, elastic, pattern)
    call test%check('not for other formulations', .not. fast%ready)
  end subroutine check_block
end program test_fem_one_point
