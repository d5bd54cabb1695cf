!> Elements with a pore liquid: matrices are the slopes of the forces, contents of a step add up to
!! what the body gained, uniform flow and hydrostatic pressure are exact, energies balance, and
!! pressures that alternate are stiff in equal orders alone.
program test_fem_pore_element
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_test, only: max_abs, test_type
  use fem_kinds, only: reference_nodes
  use fem_pore_element, only: fem_skeleton_type, fem_wet_type, fem_flow_step_type, &
    fem_flow_change_type, fem_flow_energy_type, wet_shape, wet_force, wet_matrix, wet_energy, &
    wet_content, darcy_flow
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  implicit none
  character(len=*), parameter :: names(7) = [character(len=10) :: 'hex20', 'hex27', 'tet10', &
    'hex8_bbar', 'hex8_full', 'tet4', 'hex20/hex8']
  type(test_type) :: test
  type(fem_formulation_type) :: rule
  type(fem_skeleton_type) :: skeleton
  type(fem_flow_step_type) :: step
  type(fem_wet_type), allocatable :: wet
  type(fem_flow_change_type) :: change
  real(wp), allocatable :: x(:, :)
  integer(i4) :: k

  skeleton = fem_skeleton_type(0.8_wp, 0.3_wp, [0.7_wp, 0.2_wp, 1.1_wp], 0.4_wp, 1.3_wp)
  step = fem_flow_step_type(0.5_wp, 0.75_wp, [0.3_wp, -0.2_wp, -2.0_wp], 1.7_wp)
  do k = 1, size(names)
    call make_rule(rule_index(trim(names(k))), rule)
    call place_element()
    call check_slopes(trim(names(k)))
    call check_sums(trim(names(k)))
    call check_flow(trim(names(k)))
    call check_energy(trim(names(k)))
    call check_steadying(trim(names(k)))
  end do
  call test%finish()

contains

  !> A distorted element with displacements and pressures that are not linear.
  subroutine place_element()
    real(wp) :: xi(3, rule%nodes)
    integer(i4) :: a
    xi = reference_nodes(rule%kind)
    x = xi
    do a = 1, rule%nodes
      x(:, a) = matmul(reshape([1.0_wp, 0.1_wp, -0.2_wp, 0.0_wp, 1.3_wp, 0.1_wp, 0.2_wp, 0.0_wp, &
        0.8_wp], [3, 3]), xi(:, a)) + 0.05_wp*[xi(2, a)*xi(3, a), xi(1, a)**2, xi(1, a)*xi(2, a)]
    end do
    if (allocated(wet)) deallocate (wet)
    allocate (wet)
    call wet_shape(rule, x, 2.0_wp, wet)
    if (allocated(change%p)) deallocate (change%p, change%moved, change%a)
    allocate (change%p(rule%corners, 2), change%moved(3, rule%nodes), change%a(3, rule%nodes))
    do a = 1, rule%nodes
      change%moved(:, a) = [sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a + 1.0_wp)]
      change%a(:, a) = [cos(0.3_wp*a), sin(3.1_wp*a), cos(1.7_wp*a)]
    end do
    do a = 1, rule%corners
      change%p(a, :) = [cos(1.9_wp*a), sin(2.7_wp*a)]
    end do
  end subroutine place_element

  !> The forces are linear: columns of the matrix are exact differences.
  subroutine check_slopes(name)
    character(len=*), intent(in) :: name
    real(wp) :: coupling(3*rule%nodes, rule%corners, 2), flow(rule%corners, rule%corners)
    real(wp) :: f(3, rule%nodes, 2), v(rule%corners, 2), off
    type(fem_flow_change_type) :: other
    integer(i4) :: a
    call wet_matrix(rule, skeleton, wet, step, coupling, flow)
    call wet_force(rule, skeleton, wet, step, change, f(:, :, 1), v(:, 1))
    off = 0.0_wp
    do a = 1, rule%corners
      other = change
      other%p(a, 2) = other%p(a, 2) + 1.0_wp
      call wet_force(rule, skeleton, wet, step, other, f(:, :, 2), v(:, 2))
      off = max(off, max_abs(reshape(f(:, :, 2) - f(:, :, 1), [3*rule%nodes]) - coupling(:, a, 1)))
      off = max(off, max_abs(v(:, 2) - v(:, 1) - flow(:, a)))
    end do
    do a = 1, rule%nodes
      other = change
      other%moved(2, a) = other%moved(2, a) + 1.0_wp
      other%a(2, a) = other%a(2, a) + step%theta*step%inertia
      call wet_force(rule, skeleton, wet, step, other, f(:, :, 2), v(:, 2))
      off = max(off, max_abs(v(:, 2) - v(:, 1) - coupling(3*a - 1, :, 2)))
    end do
    call test%check(name//': matrices are slopes, '//str(off), off < 1.0e-12_wp)
    call test%check(name//': symmetric', max_abs(flow - transpose(flow)) < 1.0e-14_wp)
  end subroutine check_slopes

  !> The sum over the corners is the content lost.
  subroutine check_sums(name)
    character(len=*), intent(in) :: name
    real(wp) :: f(3, rule%nodes), v(rule%corners), gained
    call wet_force(rule, skeleton, wet, step, change, f, v)
    gained = wet_content(rule, skeleton, wet, change%moved, change%p(:, 2) - change%p(:, 1))
    call test%check(name//': contents add up', abs(sum(v) + gained) < 1.0e-13_wp)
  end subroutine check_sums

  !> Linear pressures flow uniformly, hydrostatic ones rest; a uniform one is a uniform stress.
  subroutine check_flow(name)
    character(len=*), intent(in) :: name
    real(wp) :: slope(3), p(rule%corners), off, still, f(3, rule%nodes), v(rule%corners)
    type(fem_flow_change_type) :: rest
    integer(i4) :: q
    slope = [0.4_wp, -1.2_wp, 0.9_wp]
    p = matmul(slope, x(:, :rule%corners))
    off = 0.0_wp
    still = 0.0_wp
    if (rule%nodes > rule%corners) then  ! corners alone do not place curved elements
      x = matmul(x(:, :rule%corners), rule%middle)
      call wet_shape(rule, x, 2.0_wp, wet)
    end if
    do q = 1, rule%at%n
      off = max(off, max_abs(darcy_flow(skeleton, wet, step%gravity, p, q) + skeleton%mobility &
        *(slope - skeleton%density*step%gravity)))
      still = max(still, max_abs(darcy_flow(skeleton, wet, step%gravity, &
        skeleton%density*matmul(step%gravity, x(:, :rule%corners)), q)))
    end do
    call test%check(name//': uniform flow, '//str(off), off < 1.0e-13_wp)
    call test%check(name//': hydrostatic rest, '//str(still), still < 1.0e-13_wp)
    rest%moved = 0.0_wp*change%moved
    allocate (rest%p(rule%corners, 2), source=1.0_wp)
    call wet_force(rule, skeleton, wet, step, rest, f, v)
    call test%check(name//': forces of a pressure balance', max_abs(sum(f, 2)) < 1.0e-13_wp)
    off = sum(f*x)/sum(wet%shape%weight) + 3.0_wp*skeleton%biot
    call test%check(name//': virial of a pressure', abs(off) < 1.0e-12_wp)
  end subroutine check_flow

  !> Work of the mean pressure on what enters is stored, dissipated or given to the solid.
  subroutine check_energy(name)
    character(len=*), intent(in) :: name
    type(fem_flow_energy_type) :: after, before
    type(fem_flow_change_type) :: first
    real(wp) :: f(3, rule%nodes), v(rule%corners), mean(rule%corners), given, off
    real(wp) :: ends(3, rule%nodes, 2)
    call wet_force(rule, skeleton, wet, step, change, f, v)
    mean = 0.5_wp*sum(change%p, 2)
    ends(:, :, 2) = f
    first = change
    first%p(:, 2) = first%p(:, 1)
    call wet_force(rule, skeleton, wet, step, first, ends(:, :, 1), v)
    given = 0.5_wp*sum(change%moved*sum(ends, 3))  ! to the pressures, by the solid
    call wet_force(rule, skeleton, wet, step, change, f, v)
    after = wet_energy(rule, skeleton, wet, step, change)
    first%p = spread(change%p(:, 1), 2, 2)
    before = wet_energy(rule, skeleton, wet, step, first)
    off = -dot_product(mean, v) + given + after%fall - (after%stored - before%stored) &
          - after%darcy - after%numerical
    call test%check(name//': energies balance, '//str(off), abs(off) < 1.0e-12_wp)
    call test%check(name//': flow dissipates', after%darcy > 0.0_wp)
  end subroutine check_energy

  !> A pressure that alternates is stiff where orders are equal, a uniform one never.
  subroutine check_steadying(name)
    character(len=*), intent(in) :: name
    real(wp) :: p(rule%corners)
    integer(i4) :: a
    call test%check(name//': no liquid from steadying', &
      max_abs(sum(wet%steady, 1)) < 1.0e-14_wp)
    p = [(real((-1)**a, wp), a=1, rule%corners)]
    if (rule%corners == 8) p = [1, -1, 1, -1, -1, 1, -1, 1]
    call test%check(name//': steadying', &
      (dot_product(p, matmul(wet%steady, p)) > 1.0e-3_wp) .eqv. rule%corners == rule%nodes)
  end subroutine check_steadying
end program test_fem_pore_element
