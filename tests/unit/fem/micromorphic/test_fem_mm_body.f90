!> Micromorphic bodies: blocks of both fields, forces and tangents of the assembled body, the same
!! bits for any number of threads, points that start with a stress, ties of chi to F, failures.
program test_fem_mm_body
  use, intrinsic :: omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_elastic, only: micromorphic
  use fem_kinds, only: hex8, quad4
  use fem_mm_body, only: phi_columns
  use fem_mm_cones, only: make_cone
  use fem_mm_elastic, only: set_moduli
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, mm_spatial_type, pushed
  use fem_mm_plastic, only: mm_point_type, update_point
  use fem_mm_prestress, only: start_state
  use fem_mm_store, only: point_states, point_stresses, store_point, state_of
  use fem_mm_ties, only: tie_springs
  use fem_sparse, only: multiply_general, spring_force
  use fem_topology, only: set_elements
  use fem_types, only: fem_group_type, fem_springs_type, group_facet
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 3  !! elements along an edge
  real(wp), parameter :: moduli(18) = [29.0_wp, 7.0_wp, 60.0_wp, 10.0_wp, 10.0_wp, 8.0_wp, &
    5.0_wp, 0.3_wp, 0.1_wp, 0.2_wp, 0.4_wp, -0.1_wp, 0.5_wp, 8.0_wp, 0.2_wp, 0.6_wp, 0.3_wp, 0.1_wp]

  call check_blocks()
  call check_tangent(.false.)
  call check_tangent(.true.)
  call check_threads()
  call check_start()
  call check_states()
  call check_ties()
  call check_failures()
  call test%finish()

contains

  pure function solid(plastic) result(law)
    logical, intent(in) :: plastic
    type(mm_law_type) :: law
    real(wp), parameter :: wide(2) = [-1.0_wp, -1.0_wp]
    law%elastic = set_moduli(moduli, .false.)
    law%length = 0.4_wp
    law%modulus = 60.0_wp
    law%plastic = plastic
    if (.not. plastic) return
    law%cone(1) = make_cone([0.5_wp, 0.15_wp], wide, 0.1_wp, 5.0_wp, 0.3_wp)
    law%cone(2) = make_cone([0.4_wp, 0.1_wp], wide, 0.15_wp, 5.0_wp, 0.3_wp)
    law%cone(3:) = make_cone([0.3_wp, 0.1_wp], wide, 0.1_wp, 1.0_wp, 0.3_wp)
  end function solid

  !> A cube of n^3 skewed hex8/hex8.
  subroutine make_cube(plastic, body)
    logical, intent(in) :: plastic
    type(fem_body_type), intent(inout) :: body
    integer(i4), parameter :: step(8) = [0, 1, n + 2, n + 1, (n + 1)**2, (n + 1)**2 + 1, &
                                         (n + 1)**2 + n + 2, (n + 1)**2 + n + 1]
    integer(i4) :: connectivity(8, n**3), i, j, k, e, r
    allocate (body%mesh%x(3, (n + 1)**3), body%mesh%group(0))
    do k = 0, n
      do j = 0, n
        do i = 0, n
          body%mesh%x(:, 1 + i + (n + 1)*(j + (n + 1)*k)) = &
            [i + 0.1_wp*j, j + 0.05_wp*k + 0.02_wp*i*k/n, real(k, wp)]
        end do
      end do
    end do
    do e = 1, n**3
      i = modulo(e - 1, n)
      j = modulo((e - 1)/n, n)
      k = (e - 1)/n**2
      connectivity(:, e) = 1 + i + (n + 1)*(j + (n + 1)*k) + step
    end do
    call set_elements(body%mesh, hex8, connectivity)
    call body%elastic%start(n**3)
    call body%elastic%use_rule('hex8/hex8', r)
    body%elastic%rule_of = r
    body%elastic%density = 3.0_wp
    body%elastic%inertia = 0.2_wp
    call body%elastic%number_points()
    body%elastic%components = micromorphic
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs, phi_columns)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    call make_matter(plastic, body)
    call body%assemble()
  end subroutine make_cube

  subroutine make_matter(plastic, body)
    logical, intent(in) :: plastic
    type(fem_body_type), intent(inout) :: body
    type(mm_motion_type) :: none
    type(mm_point_type) :: point
    type(mm_state_type) :: start
    real(wp) :: before(point_states)
    integer(i4) :: q
    associate (m => body%matter, micro => body%matter%micro)
      m%active = .true.
      m%symmetric = .not. plastic
      m%states = point_states
      micro%active = .true.
      allocate (micro%law(1), m%law(0))
      micro%law(1) = solid(plastic)
      micro%balance = [.false.]
      allocate (micro%law_of(n**3), m%law_of(n**3), source=1_i4)
      allocate (m%stress(point_stresses, body%elastic%points), source=0.0_wp)
      allocate (m%state(point_states, body%elastic%points))
      before = 0.0_wp
      call update_point(micro%law(1), [none, none], start, point)
      do q = 1, body%elastic%points
        call store_point([none, none], point, point%force, before, m%state(:, q))
      end do
    end associate
  end subroutine make_matter

  !> Pseudo-random numbers.
  pure function noise(blocks, size_of) result(u)
    integer(i4), intent(in) :: blocks
    real(wp), intent(in) :: size_of
    real(wp) :: u(3, blocks)
    integer(i4) :: i
    u = reshape([(size_of*sin(7.3_wp*i), i=1, 3*blocks)], [3, blocks])
  end function noise

  !> Three blocks of phi at a node, behind all displacements; mass of u and of each column of phi.
  subroutine check_blocks()
    type(fem_body_type) :: body
    real(wp) :: volume
    call make_cube(.false., body)
    associate (dofs => body%dofs, nodes => body%mesh%nodes)
      call test%check('four blocks a node', dofs%blocks == 4*nodes)
      call test%check('columns stand together', dofs%phi(1) == nodes + 1 .and. &
                      all(dofs%phi(2:) - dofs%phi(:nodes - 1) == 3))
      call test%check('and know their node', all(dofs%node(dofs%phi + 2) == dofs%node(:nodes)))
      call test%check('blocks of an element', dofs%start(2) - dofs%start(1) == 32)
      volume = sum(body%matter%weight)
      call test%check_close('mass', sum(body%system%lumped(:nodes)), 3.0_wp*volume, 1.0e-12_wp)
      call test%check_close('micro-inertia of the first column', &
        sum(body%system%lumped(dofs%phi)), &
                            0.6_wp*volume, 1.0e-12_wp)
      call test%check_close('and of the last', sum(body%system%lumped(dofs%phi + 2)), &
        0.6_wp*volume, &
                            1.0e-12_wp)
    end associate
  end subroutine check_blocks

  !> Slopes of the forces along a direction, by differences, are the tangent times it.
  subroutine check_tangent(plastic)
    logical, intent(in) :: plastic
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), way(:, :), high(:, :), low(:, :), product(:, :)
    real(wp), parameter :: step = 1.0e-6_wp
    character(len=:), allocatable :: name
    integer(i4) :: bad, counts(2)
    name = trim(merge('plastic', 'elastic', plastic))
    call make_cube(plastic, body)
    u = noise(body%dofs%blocks, 6.0e-3_wp)
    way = cshift(u, 1, 2)
    allocate (high, low, product, mold=u)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, product, bad)
    call test%check(name//': all points have a state', bad == 0)
    counts = body%matter%yielding()
    call test%check(name//': points yield', counts(1) > 0 .eqv. plastic)
    call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
      body%system%k, body%system%lower)
    call test%check(name//': symmetry', size(body%system%lower) == 0 .neqv. plastic)
    call multiply_general(body%system%pattern, body%system%k, body%system%lower, way, product)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u + step*way, u + step*way, high, &
                            bad)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u - step*way, u - step*way, low, &
                            bad)
    high = (high - low)/(2.0_wp*step)
    call test%check_close(name//': tangent', max_abs(high - product)/max_abs(product), &
                          0.0_wp, 1.0e-6_wp)
  end subroutine check_tangent

  !> Forces, states and stiffness have the same bits with 1, 2 and 3 threads.
  subroutine check_threads()
    type(fem_body_type) :: one, many
    real(wp), allocatable :: u(:, :), first(:, :), force(:, :)
    integer(i4) :: t, bad
    call omp_set_num_threads(1)
    call make_cube(.true., one)
    u = noise(one%dofs%blocks, 6.0e-3_wp)
    allocate (first, force, mold=u)
    call one%matter%update(one%mesh, one%dofs, one%elastic, u, u, first, bad)
    associate (a => one%system)
      call one%matter%assemble(one%mesh, one%dofs, one%elastic, a%pattern, a%k, a%lower)
    end associate
    call make_cube(.true., many)
    do t = 2, 3
      call omp_set_num_threads(t)
      call many%matter%update(many%mesh, many%dofs, many%elastic, u, u, force, bad)
      associate (a => many%system)
        call many%matter%assemble(many%mesh, many%dofs, many%elastic, a%pattern, a%k, a%lower)
      end associate
      call test%check('threads: forces', all(force == first))
      call test%check('threads: states', all(many%matter%state == one%matter%state))
      call test%check('threads: stiffness', all(many%system%k == one%system%k) .and. &
                      all(many%system%lower == one%system%lower))
    end do
    call omp_set_num_threads(1)
  end subroutine check_threads

  !> A point at F = chi = 1 has the wanted Cauchy and micro-stress and no force on chi.
  subroutine check_start()
    real(wp), parameter :: wanted(6) = 0.2_wp*[-1.0_wp, -0.4_wp, -0.7_wp, 0.2_wp, -0.1_wp, 0.15_wp]
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_motion_type) :: none
    type(mm_spatial_type) :: spatial
    character(len=:), allocatable :: fault
    real(wp) :: tensor(3, 3)
    integer(i4) :: k
    tensor = reshape(wanted([1, 4, 6, 4, 2, 5, 6, 5, 3]), [3, 3])
    do k = 1, 2
      law = solid(.false.)
      law%elastic%reduced = k == 2
      call start_state(law, wanted, state, fault)
      call test%check('start: it can be', len(fault) == 0)
      call update_point(law, [none, none], state, point)
      spatial = pushed(none, point%stress)
      call test%check_all_close('start: Cauchy stress', spatial%sigma, tensor, &
                            1.0e-12_wp)
      call test%check_all_close('start: micro-stress', spatial%s, tensor, &
                            1.0e-12_wp)
      call test%check_all_close('start: micro-force', point%force%q, 0.0_wp, 1.0e-12_wp)
    end do
    law = solid(.true.)
    call start_state(law, -wanted, state, fault)
    call test%check('start: outside of a cone', index(fault, 'outside the macro surface, f = ') > 0)
    call start_state(law, [10.0_wp, -10.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], state, fault)
    call test%check('start: no elastic strain', index(fault, 'no elastic strain') > 0)
    law%elastic = set_moduli([29.0_wp, 7.0_wp, spread(0.0_wp, 1, 16)], .false.)
    call start_state(solid_of(law), wanted, state, fault)
    call test%check('start: moduli of chi may vanish', len(fault) == 0)
  end subroutine check_start

  !> The law without its cones.
  pure function solid_of(law) result(bare)
    type(mm_law_type), intent(in) :: law
    type(mm_law_type) :: bare
    bare%elastic = law%elastic
    bare%modulus = law%modulus
  end function solid_of

  !> State stored of a point is restored.
  subroutine check_states()
    type(mm_motion_type) :: motion(2)
    type(mm_point_type) :: point
    type(mm_state_type) :: start, back
    real(wp) :: before(point_states), after(point_states)
    motion(2)%f(1, 2) = 0.05_wp
    motion(2)%chi(2, 1) = 0.03_wp
    motion(2)%g(1, 2, 3) = 0.1_wp
    before = 0.0_wp
    call update_point(solid(.true.), motion, start, point)
    call store_point(motion, point, point%force, before, after)
    back = state_of(after)
    call test%check('states: it yields', point%state%yielded .and. back%yielded)
    call test%check('states: parts', all(back%fp == point%state%fp) .and. &
      all(back%xp == point%state%xp) .and. all(back%gp == point%state%gp))
    call test%check('states: hardening', all(back%z == point%state%z) &
                    .and. back%dissipated == point%state%dissipated)
  end subroutine check_states

  !> k/2 |chi - F|^2 per area, without force where both are equal.
  subroutine check_ties()
    type(fem_body_type) :: body
    type(fem_group_type) :: group
    type(fem_springs_type) :: springs
    real(wp), allocatable :: u(:, :), force(:, :)
    real(wp), parameter :: slope(3, 3) = reshape([0.1_wp, 0.2_wp, -0.1_wp, 0.05_wp, -0.2_wp, &
      0.3_wp, 0.15_wp, 0.1_wp, 0.2_wp], [3, 3])
    real(wp) :: area
    integer(i4) :: i, c, lost
    call make_cube(.false., body)
    group%kind = group_facet
    group%element = [1_i4]
    group%facet_kind = [quad4]
    group%facet = reshape(body%mesh%node([1, 4, 3, 2]), [4, 1])  ! the face z = 0
    group%node = body%mesh%node([1, 2, 3, 4])
    call tie_springs(body%mesh, body%dofs, body%elastic, group, 4.0_wp, springs, lost)
    call test%check('ties: all found', lost == 0 .and. springs%n == 12)
    allocate (u(3, body%dofs%blocks), force(3, body%dofs%blocks))
    do i = 1, body%mesh%nodes
      u(:, i) = matmul(slope, body%mesh%x(:, i))
      do c = 1, 3
        u(:, body%dofs%phi(i) + c - 1) = slope(:, c)
      end do
    end do
    call spring_force(springs, 0.0_wp*u, u, force)
    call test%check_all_close('ties: nothing where chi = F', force, 0.0_wp, 1.0e-13_wp)
    u(2, body%dofs%phi + 2) = u(2, body%dofs%phi + 2) + 0.5_wp
    call spring_force(springs, 0.0_wp*u, u, force)
    area = 1.0_wp
    call test%check_close('ties: energy', -0.5_wp*sum(force*u), 0.5_wp*4.0_wp*0.25_wp*area, &
                          1.0e-12_wp)
    group%element = [27_i4]
    call tie_springs(body%mesh, body%dofs, body%elastic, group, 4.0_wp, springs, lost)
    call test%check('ties: a facet of another element', lost == 1)
  end subroutine check_ties

  !> A point that is turned inside out is named with the value.
  subroutine check_failures()
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), force(:, :)
    integer(i4) :: bad
    call make_cube(.true., body)
    allocate (u(3, body%dofs%blocks), source=0.0_wp)
    allocate (force, mold=u)
    u(3, :body%mesh%nodes) = -1.5_wp*body%mesh%x(3, :)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
    call test%check('failure: the first point', bad == 1)
    call test%check('failure: F is inside out', body%matter%micro%trouble == &
                    'the determinant of F is -0.5')
    u = 0.0_wp
    u(1, body%dofs%phi) = -3.0_wp
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
    call test%check('failure: chi is inside out', body%matter%micro%trouble == &
                    'the determinant of chi is -2')
    call test%check('failure: the state is that of before', &
                    all(body%matter%state == body%matter%accepted_state))
  end subroutine check_failures
end program test_fem_mm_body
