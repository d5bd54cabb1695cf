!> Kept integrals of elements with a pore liquid give the forces, matrices, contents and energies of
!! their points, in statics, on distorted elements; a liquid at rest dissipates nothing in a step of
!! any length.
program test_fem_pore_integrals
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_test, only: max_abs, test_type
  use fem_kinds, only: reference_nodes
  use fem_pore_element, only: fem_skeleton_type, fem_wet_type, fem_flow_step_type, &
    fem_flow_change_type, fem_flow_energy_type, wet_shape, wet_force, wet_matrix, wet_energy, &
    wet_content, wet_size, mean_strain
  use fem_pore_integrals, only: fem_wet_integrals_type, integrate_wet, integrals_size, flow_force, &
    flow_matrix, flow_energy, flow_content, flow_size, flow_strain
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  implicit none
  character(len=*), parameter :: names(7) = [character(len=10) :: 'hex20', 'hex27', 'tet10', &
    'hex8_bbar', 'hex8_full', 'tet4', 'hex20/hex8']
  real(wp), parameter :: pervious = 0.6_wp, small = 1.0e-12_wp
  type(test_type) :: test
  type(fem_formulation_type) :: rule
  type(fem_skeleton_type) :: skeleton, now
  type(fem_flow_step_type) :: step
  type(fem_wet_type), allocatable :: wet
  type(fem_wet_integrals_type) :: kept
  type(fem_flow_change_type) :: change
  real(wp), allocatable :: x(:, :)
  integer(i4) :: k

  skeleton = fem_skeleton_type(0.8_wp, 0.3_wp, [0.7_wp, 0.2_wp, 1.1_wp], 0.4_wp, 1.3_wp)
  now = skeleton
  now%mobility = pervious*now%mobility
  do k = 1, size(names)
    step = fem_flow_step_type(0.5_wp, 0.75_wp, [0.3_wp, -0.2_wp, -2.0_wp], 0.0_wp)
    call make_rule(rule_index(trim(names(k))), rule)
    call place_element()
    call check_forces(trim(names(k)))
    call check_sums(trim(names(k)))
    call check_energies(trim(names(k)))
    call check_rest(trim(names(k)))
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
    if (allocated(change%p)) deallocate (change%p, change%moved)
    allocate (change%p(rule%corners, 2), change%moved(3, rule%nodes))
    do a = 1, rule%nodes
      change%moved(:, a) = [sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a + 1.0_wp)]
    end do
    do a = 1, rule%corners
      change%p(a, :) = [cos(1.9_wp*a), sin(2.7_wp*a)]
    end do
    call integrate()
  end subroutine place_element

  subroutine integrate()
    if (allocated(wet)) deallocate (wet)
    allocate (wet)
    call wet_shape(rule, x, 2.0_wp, wet)
    call integrate_wet(rule, skeleton, wet, x, step%gravity, kept)
  end subroutine integrate

  subroutine check_forces(name)
    character(len=*), intent(in) :: name
    real(wp) :: f(3, rule%nodes, 2), v(rule%corners, 2)
    real(wp) :: coupling(3*rule%nodes, rule%corners, 2, 2), flow(rule%corners, rule%corners, 2)
    call wet_force(rule, now, wet, step, change, f(:, :, 1), v(:, 1))
    call flow_force(kept, pervious, step, change%moved, change%p, f(:, :, 2), v(:, 2))
    call test%check(name//': forces', max_abs(f(:, :, 2) - f(:, :, 1)) < small)
    call test%check(name//': flow', max_abs(v(:, 2) - v(:, 1)) < small)
    call wet_matrix(rule, now, wet, step, coupling(:, :, :, 1), flow(:, :, 1))
    call flow_matrix(kept, pervious, step, coupling(:, :, :, 2), flow(:, :, 2))
    call test%check(name//': couplings', &
      max_abs(reshape(coupling(:, :, :, 2) - coupling(:, :, :, 1), [size(coupling)/2])) < small)
    call test%check(name//': matrix', max_abs(flow(:, :, 2) - flow(:, :, 1)) < small)
    call test%check(name//': reals kept', size(kept%column) == integrals_size(rule))
  end subroutine check_forces

  subroutine check_sums(name)
    character(len=*), intent(in) :: name
    call test%check(name//': content', abs(flow_content(kept, change%moved, &
      change%p(:, 2)) - wet_content(rule, now, wet, change%moved, change%p(:, 2))) < small)
    call test%check(name//': size', abs(flow_size(kept, now, step, change%moved, change%p) &
      - wet_size(now, wet, step, change)) < small)
    call test%check(name//': strain', abs(flow_strain(kept, change%moved) &
      - mean_strain(wet, change%moved)) < small)
  end subroutine check_sums

  subroutine check_energies(name)
    character(len=*), intent(in) :: name
    type(fem_flow_energy_type) :: a, b
    a = wet_energy(rule, now, wet, step, change)
    b = flow_energy(kept, pervious, step, change%p)
    call test%check(name//': stored', abs(b%stored - a%stored) < small)
    call test%check(name//': Darcy', abs(b%darcy - a%darcy) < small .and. b%darcy > 0.1_wp)
    call test%check(name//': fall', abs(b%fall - a%fall) < small)
    call test%check(name//': numerical', abs(b%numerical - a%numerical) < small)
  end subroutine check_energies

  !> Under hydrostatic pressure at great depth, in a step of 1e6 s, of an element with straight
  !! edges: the square of rounding is all.
  subroutine check_rest(name)
    character(len=*), intent(in) :: name
    real(wp), parameter :: depth = 1.0e3_wp
    type(fem_flow_energy_type) :: energy
    real(wp) :: p(rule%corners, 2)
    if (rule%nodes > rule%corners) x = matmul(x(:, :rule%corners), rule%middle)
    call integrate()
    step%dt = 1.0e6_wp
    p = spread(skeleton%density*(matmul(step%gravity, x(:, :rule%corners)) + depth), 2, 2)
    energy = flow_energy(kept, pervious, step, p)
    call test%check(name//': rest dissipates nothing, '//str(energy%darcy), &
      abs(energy%darcy) < step%dt*(depth*epsilon(depth))**2*1.0e3_wp)
  end subroutine check_rest
end program test_fem_pore_integrals
