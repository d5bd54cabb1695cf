!> The pore liquid of a body: blocks of the pressures, matrix and forces of all elements and leaks
!! against each other, books, one-way leaks, permeability of the strain.
program test_fem_pore
  use talus_kinds, only: wp, i4
  use talus_curve, only: curve_type
  use talus_test, only: max_abs, test_type
  use fem_dofs, only: fem_dofs_type, number_fields, number_pressures
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: hex8
  use fem_pore, only: fem_pore_type
  use fem_pore_element, only: fem_flow_energy_type, fem_skeleton_type, kozeny_carman
  use fem_pore_faces, only: fem_leak_type, most_flips
  use fem_sparse, only: fem_pattern_type, make_pattern, multiply_general
  use fem_topology, only: set_elements
  use fem_types, only: fem_mesh_type
  implicit none
  type(test_type) :: test
  type(fem_mesh_type) :: mesh
  type(fem_dofs_type) :: dofs
  type(fem_elastic_type) :: elastic
  type(fem_pore_type) :: pore
  type(fem_pattern_type) :: pattern
  type(curve_type) :: none(0)
  integer(i4), parameter :: elements = 3, wet = 2

  call make_bar()
  call check_blocks()
  call make_pores()
  call check_matrix(.false.)
  call check_matrix(.true.)
  call check_books()
  call check_one_way()
  call check_permeability()
  call check_kept()
  call test%finish()

contains

  !> Three cubes in a row, the last without a liquid.
  subroutine make_bar()
    integer(i4) :: i, j, k, e, r, n, connectivity(8, elements), corners(elements)
    allocate (mesh%x(3, 4*(elements + 1)), mesh%group(0))
    n = 0
    do i = 0, elements
      do k = 0, 1
        do j = 0, 1
          n = n + 1
          mesh%x(:, n) = [i + 0.1_wp*j*k, j + 0.05_wp*i, k + 0.07_wp*i*j]
        end do
      end do
    end do
    do e = 1, elements
      connectivity(:, e) = 4*(e - 1) + [1, 5, 6, 2, 3, 7, 8, 4]
    end do
    call set_elements(mesh, hex8, connectivity)
    call elastic%start(elements)
    call elastic%use_rule('hex8_bbar', r)
    elastic%rule_of = r
    elastic%moduli(1, :) = 2.0_wp
    elastic%moduli(2, :) = 3.0_wp
    call elastic%number_points()
    call number_fields(mesh, elastic%rotations(), dofs)
    corners = 0
    corners(:wet) = 8
    call number_pressures(mesh, corners, dofs)
    call make_pattern(dofs, pattern)
  end subroutine make_bar

  subroutine check_blocks()
    integer(i4) :: b
    call test%check('displacements first', dofs%solid == mesh%nodes)
    call test%check('a pressure at each wet node', dofs%blocks == dofs%solid + 4*(wet + 1))
    call test%check('none at dry nodes', all(dofs%p(4*(wet + 1) + 1:) == 0))
    call test%check('nodes of the blocks', all([(dofs%p(dofs%node(b)) == b, b=dofs%solid + 1, &
      dofs%blocks)]))
    call test%check('dry elements have none', dofs%wet_start(4) == dofs%wet_start(3))
  end subroutine check_blocks

  !> A leak at the first four nodes, a flow in a step of 0.3 s.
  subroutine make_pores()
    type(fem_leak_type) :: leak
    real(wp) :: u(3, dofs%blocks)
    pore%active = .true.
    pore%step%theta = 0.75_wp
    pore%step%gravity = [0.4_wp, 0.0_wp, -1.0_wp]
    pore%skeleton = [fem_skeleton_type(0.9_wp, 0.2_wp, [0.3_wp, 0.6_wp, 0.1_wp], 0.4_wp, 1.1_wp)]
    pore%skeleton_of = [1, 1, 0]
    allocate (pore%held(0), pore%inflow(0), pore%leak(1))
    leak%outside = 0.2_wp
    leak%block = dofs%p(:4)
    leak%conductance = [0.1_wp, 0.2_wp, 0.3_wp, 0.4_wp]
    allocate (leak%open(4), source=.true.)
    pore%leak(1) = leak
    u = 0.0_wp
    call pore%prepare(dofs, elastic%moduli, u)
    call pore%begin(none, 1.0_wp, 1.3_wp)
  end subroutine make_pores

  !> Some state of all blocks; pressures have one component.
  pure function state(shift) result(u)
    real(wp), intent(in) :: shift
    real(wp) :: u(3, dofs%blocks)
    integer(i4) :: b
    do b = 1, dofs%blocks
      u(:, b) = [sin(1.7_wp*b + shift), cos(2.3_wp*b + shift), sin(0.9_wp*b - shift)]
    end do
    u(2:, dofs%solid + 1:) = 0.0_wp
  end function state

  !> Forces are linear: their change is the matrix times that of the state.
  subroutine check_matrix(general)
    logical, intent(in) :: general
    real(wp), allocatable :: k(:, :, :), lower(:, :, :)
    real(wp), dimension(3, dofs%blocks) :: old, moved, more, f0, f1, wanted
    allocate (k(3, 3, size(pattern%column)), source=0.0_wp)
    allocate (lower(3, 3, merge(size(pattern%column), 0, general)), source=0.0_wp)
    old = state(0.3_wp)
    moved = state(1.1_wp)
    more = state(2.0_wp)
    f0 = 0.0_wp
    f1 = 0.0_wp
    call pore%force(mesh, dofs, elastic, old, moved, f0)
    call pore%force(mesh, dofs, elastic, old, moved + more, f1)
    call pore%add_matrix(mesh, dofs, elastic, pattern, k, lower)
    call multiply_general(pattern, k, lower, more, wanted)
    call test%check('the matrix has the slopes of the forces', max_abs(f1 - f0 - wanted) < 1e-13_wp)
    call test%check('no force on dry nodes', max_abs(f1(:, 4*(wet + 1) + 1:dofs%solid)) <= 0.0_wp)
  end subroutine check_matrix

  !> What enters less what stays is the sum of the rows of pressures.
  subroutine check_books()
    real(wp), dimension(3, dofs%blocks) :: old, moved, f
    type(fem_flow_energy_type) :: energy
    real(wp) :: before
    old = state(0.3_wp)
    moved = state(1.1_wp)
    f = 0.0_wp
    call pore%force(mesh, dofs, elastic, old, moved, f)
    call pore%account(mesh, dofs, elastic, old, old, energy)
    before = pore%books%content
    call pore%account(mesh, dofs, elastic, old, old + moved, energy)
    call pore%enter(0.0_wp*f(1, :))
    call test%check('the leak is booked', &
      abs(pore%books%entered(1) - 0.3_wp*pore%leak(1)%rate) < 1e-15_wp)
    call test%check('rows of pressures add up', abs(sum(f(1, dofs%solid + 1:)) &
      - (pore%books%entered(1) - (pore%books%content - before))) < 1e-13_wp)
    call pore%accept()
    call pore%forget_books()
    call test%check('books are cleared', max_abs(pore%accepted_books%entered) <= 0.0_wp)
  end subroutine check_books

  !> A restless one-way face lets out and nothing in; nodes that are held give their reaction.
  subroutine check_one_way()
    real(wp), dimension(3, dofs%blocks) :: old, moved, f
    pore%leak(1)%one_way = .true.
    pore%leak(1)%now = 0.0_wp
    allocate (pore%leak(1)%held(4), source=.false.)
    allocate (pore%leak(1)%flips(4), source=most_flips)
    old = 0.0_wp
    moved = 0.0_wp
    moved(1, dofs%solid + 1:) = 1.0_wp
    f = 0.0_wp
    call pore%force(mesh, dofs, elastic, old, moved, f)
    call test%check('pressure opens it', abs(pore%leak(1)%rate + 0.75_wp) < 1e-15_wp)
    call pore%force(mesh, dofs, elastic, old, -moved, f)
    call test%check('suction shuts it', abs(pore%leak(1)%rate) <= 0.0_wp)
    call test%check('all of it', .not. any(pore%leak(1)%open))
    call pore%enter(0.0_wp*f(1, :))
    call test%check('leaks are counted', pore%books%leaks == pore%accepted_books%leaks + 4)
    pore%leak(1)%held = [.true., .true., .false., .false.]
    pore%leak(1)%flips = 0
    call pore%force(mesh, dofs, elastic, old, moved, f)
    f(1, :) = 2.0_wp
    call pore%enter(f(1, :))
    call test%check('reactions of a face are booked', &
      abs(pore%books%entered(1) - pore%accepted_books%entered(1) - 4.0_wp) < 1e-15_wp)
  end subroutine check_one_way

  !> Uniform compression makes all elements less permeable by the law.
  subroutine check_permeability()
    real(wp) :: u(3, dofs%blocks), n
    u = 0.0_wp
    u(1, :mesh%nodes) = -0.05_wp*mesh%x(1, :)
    pore%skeleton(1)%law = kozeny_carman
    call pore%renew_mobility(mesh, dofs, elastic, u)
    n = (0.4_wp - 0.05_wp)/0.95_wp
    call test%check('Kozeny and Carman', max_abs(pore%pervious(:wet) - n**3/(1.0_wp - n)**2 &
      *0.36_wp/0.064_wp) < 1e-13_wp)
    call test%check('dry elements keep theirs', abs(pore%pervious(3) - 1.0_wp) <= 0.0_wp)
  end subroutine check_permeability

  !> Kept integrals change nothing but rounding, in forces, matrix, books and permeability.
  subroutine check_kept()
    real(wp), dimension(3, dofs%blocks) :: old, moved
    real(wp) :: f(3, dofs%blocks, 2), content(2), pervious(wet, 2)
    real(wp), allocatable :: k(:, :, :, :), lower(:, :, :, :)
    type(fem_flow_energy_type) :: energy(2)
    integer(i4) :: way
    allocate (k(3, 3, size(pattern%column), 2), lower(3, 3, size(pattern%column), 2), &
      source=0.0_wp)
    old = 0.1_wp*state(0.3_wp)
    moved = state(1.1_wp)
    f = 0.0_wp
    do way = 1, 2
      if (way == 2) call pore%keep(mesh, elastic)
      call pore%renew_mobility(mesh, dofs, elastic, old)
      pervious(:, way) = pore%pervious(:wet)
      call pore%force(mesh, dofs, elastic, old, moved, f(:, :, way))
      call pore%add_matrix(mesh, dofs, elastic, pattern, k(:, :, :, way), lower(:, :, :, way))
      call pore%account(mesh, dofs, elastic, old, old + moved, energy(way))
      content(way) = pore%books%content
    end do
    call test%check('kept for wet elements', allocated(pore%kept(wet)%column) .and. &
      .not. allocated(pore%kept(elements)%column))
    call test%check('kept: permeability', max_abs(pervious(:, 2) - pervious(:, 1)) < 1e-13_wp)
    call test%check('kept: permeability changed', abs(pervious(1, 1) - 1.0_wp) > 0.01_wp)
    call test%check('kept: forces', max_abs(f(:, :, 2) - f(:, :, 1)) < 1e-13_wp)
    call test%check('kept: matrix', max_abs(k(:, :, :, 2) - k(:, :, :, 1)) < 1e-13_wp)
    call test%check('kept: lower', max_abs(lower(:, :, :, 2) - lower(:, :, :, 1)) < 1e-13_wp)
    call test%check('kept: content', abs(content(2) - content(1)) < 1e-13_wp)
    call test%check('kept: stored', abs(energy(2)%stored - energy(1)%stored) < 1e-13_wp)
    call test%check('kept: dissipated', abs(energy(2)%darcy - energy(1)%darcy) < 1e-13_wp)
  end subroutine check_kept
end program test_fem_pore
