!> Nodes of faces that switch: who is held, who changes sides and when, what a node becomes that
!! does not come to rest, the reactions of two faces at a node, and pressures taken out of a matrix.
program test_fem_face_set
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_dofs, only: fem_dofs_type, number_fields
  use fem_face_set, only: begin_sets, cut_out, leaking, mark_held, put_outside, reactions_of, &
    turn_nodes
  use fem_kinds, only: hex8
  use fem_pore_faces, only: fem_leak_type, most_flips
  use fem_sparse, only: fem_pattern_type, make_pattern, multiply_general
  use fem_topology, only: set_elements
  use fem_types, only: fem_mesh_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: none(2) = [1.0e-6_wp, 1.0e-6_wp]

  call check_rules()
  call check_rain()
  call check_restless()
  call check_two_faces()
  call check_cut()
  call test%finish()

contains

  !> Nodes 1 to 3 of a seepage face.
  function seepage() result(face)
    type(fem_leak_type) :: face
    face%one_way = .true.
    face%block = [1_i4, 2_i4, 3_i4]
    face%conductance = [0.1_wp, 0.2_wp, 0.3_wp]
    allocate (face%held(3), face%open(3), source=.false.)
    allocate (face%flips(3), source=0_i4)
  end function seepage

  !> The state begins the set; then pressures above the air's are held, and what sucks lets go.
  subroutine check_rules()
    type(fem_leak_type) :: leak(1)
    real(wp) :: u(3, 3)
    logical :: fixed(3, 3)
    integer(i4) :: turned
    leak(1) = seepage()
    call begin_sets(leak, [-1.0_wp, 0.0_wp, 2.0_wp])
    call test%check('held where p is not below', all(leak(1)%held .eqv. [.false., .true., .true.]))
    call turn_nodes(leak, [-1.0_wp, 0.0_wp, 0.0_wp], [9.0_wp, -1.0_wp, -2.0_wp], none, turned)
    call test%check('suction and outflow may stay', turned == 0)
    call turn_nodes(leak, [5.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 3.0_wp, -2.0_wp], none, turned)
    call test%check('pressure is held, inflow let go', turned == 2 .and. &
      all(leak(1)%held .eqv. [.true., .false., .true.]))
    call turn_nodes(leak, [0.0_wp, 1.0e-7_wp, 0.0_wp], [1.0e-7_wp, 0.0_wp, 0.0_wp], none, turned)
    call test%check('round-off turns none', turned == 0)
    u = 7.0_wp
    call put_outside(leak, u)
    call test%check('held nodes have the pressure of the air', max_abs(u(1, :) &
      - [0.0_wp, 7.0_wp, 0.0_wp]) <= 0.0_wp .and. max_abs(u(2:, :) - 7.0_wp) <= 0.0_wp)
    fixed = .false.
    call mark_held(leak, fixed)
    call test%check('and are marked', all(fixed(1, :) .eqv. [.true., .false., .true.]) .and. &
      .not. any(fixed(2:, :)))
    call begin_sets(leak, u(1, :))
    call test%check('a step begins without turns', all(leak(1)%flips == 0))
  end subroutine check_rules

  !> A pond of pressure 3: it takes up to what rains, and lets go where it would take more.
  subroutine check_rain()
    type(fem_leak_type) :: leak(1)
    integer(i4) :: turned
    leak(1) = seepage()
    leak(1)%one_way = .false.
    leak(1)%now = 3.0_wp
    leak(1)%raining = 0.5_wp
    leak(1)%most = [2.0_wp, 2.0_wp, 2.0_wp]
    call begin_sets(leak, [3.0_wp, 3.0_wp, 2.9_wp])
    call turn_nodes(leak, [3.0_wp, 3.0_wp, 3.1_wp], [0.9_wp, 1.1_wp, 0.0_wp], none, turned)
    call test%check('ponds under less than the rain', turned == 2 .and. &
      all(leak(1)%held .eqv. [.true., .false., .true.]))
  end subroutine check_rain

  !> The fifth turn makes a leak, until the next step.
  subroutine check_restless()
    type(fem_leak_type) :: leak(1)
    integer(i4) :: k, turned
    leak(1) = seepage()
    call begin_sets(leak, [-1.0_wp, -1.0_wp, -1.0_wp])
    do k = 1, most_flips
      call test%check('no leak before', leaking(leak) == 0)
      call turn_nodes(leak, [1.0_wp, -1.0_wp, -1.0_wp], [1.0_wp, 0.0_wp, 0.0_wp], none, turned)
      call test%check('turns', turned == 1)
    end do
    call test%check('one leak', leaking(leak) == 1 .and. .not. any(leak(1)%held))
    call turn_nodes(leak, [1.0_wp, -1.0_wp, -1.0_wp], [1.0_wp, 0.0_wp, 0.0_wp], none, turned)
    call test%check('which stays one', turned == 0)
    call begin_sets(leak, [1.0_wp, -1.0_wp, -1.0_wp])
    call test%check('until the next step', leaking(leak) == 0 .and. leak(1)%held(1))
  end subroutine check_restless

  !> What passes a node of two faces is counted once, and its pressure is that of the first.
  subroutine check_two_faces()
    type(fem_leak_type) :: leak(2)
    real(wp) :: left(3), volume(2), u(3, 3)
    leak(1) = seepage()
    leak(2) = seepage()
    leak(2)%now = 4.0_wp
    leak(1)%held = [.false., .true., .true.]
    leak(2)%held = [.true., .true., .false.]
    left = [1.0_wp, 2.0_wp, 4.0_wp]
    call reactions_of(leak(1), left, volume(1))
    call reactions_of(leak(2), left, volume(2))
    call test%check('reactions', max_abs(volume - [6.0_wp, 1.0_wp]) <= 0.0_wp)
    u = 0.0_wp
    call put_outside(leak, u)
    call test%check('pressures', max_abs(u(1, :) - [4.0_wp, 0.0_wp, 0.0_wp]) <= 0.0_wp)
  end subroutine check_two_faces

  !> A matrix without marked pressures acts on the others as before, and they on none.
  subroutine check_cut()
    type(fem_mesh_type) :: mesh
    type(fem_dofs_type) :: dofs
    type(fem_pattern_type) :: pattern
    real(wp), allocatable :: k(:, :, :), lower(:, :, :)
    real(wp), dimension(3, 8) :: u, y, z
    logical :: fixed(8)
    integer(i4) :: i
    allocate (mesh%group(0))
    allocate (mesh%x(3, 8), source=0.0_wp)
    call set_elements(mesh, hex8, reshape([(i, i=1, 8)], [8, 1]))
    call number_fields(mesh, [0_i4], dofs)
    call make_pattern(dofs, pattern)
    allocate (k(3, 3, size(pattern%column)), lower(3, 3, size(pattern%column)))
    call random_number(k)
    call random_number(lower)
    call random_number(u)
    fixed = .false.
    fixed([2, 5]) = .true.
    u(1, [2, 5]) = 0.0_wp
    call multiply_general(pattern, k, lower, u, y)
    k(1, 1, pattern%start(5)) = 0.0_wp
    call cut_out(pattern, fixed, k, lower)
    call multiply_general(pattern, k, lower, u, z)
    y(1, [2, 5]) = z(1, [2, 5])
    call test%check('rows of others', max_abs(y - z) < 1.0e-14_wp)
    u = 0.0_wp
    u(1, [2, 5]) = 1.0_wp
    call multiply_general(pattern, k, lower, u, z)
    call test%check('columns', max_abs(z(1, [1, 3, 4, 6, 7, 8])) <= 0.0_wp)
    call test%check('diagonals', abs(z(1, 2)) > 0.0_wp .and. abs(z(1, 5) + 1.0_wp) <= 0.0_wp)
  end subroutine check_cut
end program test_fem_face_set
