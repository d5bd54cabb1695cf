!> Elements with unsaturated pores: matrices are the slopes of the forces, contents of two steps add
!! up to that of both, what corners lose is what the element gains, energies balance, suctions at
!! rest stay, the weight is that of the liquid, and full pores are those of fem_pore_element.
program test_fem_unsaturated
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_test, only: max_abs, test_type
  use fem_kinds, only: reference_nodes
  use fem_pore_element, only: fem_skeleton_type, fem_wet_type, fem_flow_step_type, &
    fem_flow_change_type, fem_flow_energy_type, wet_content, wet_force, wet_shape
  use fem_retention, only: fem_retention_type, by_mualem, retain, van_genuchten
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  use fem_unsaturated, only: moist_energy, moist_force, moist_gain, moist_inertia, moist_mass, &
    moist_matrix, moist_means
  implicit none
  character(len=*), parameter :: names(5) = [character(len=10) :: 'hex20', 'tet10', &
    'hex8_bbar', 'tet4', 'hex27']
  type(test_type) :: test
  type(fem_formulation_type) :: rule
  type(fem_skeleton_type) :: skeleton
  type(fem_flow_step_type) :: step
  type(fem_wet_type), allocatable :: wet
  type(fem_flow_change_type) :: change
  real(wp), allocatable :: x(:, :)
  integer(i4) :: k

  skeleton = fem_skeleton_type(0.8_wp, 3.0e-6_wp, [7.0e-6_wp, 2.0e-6_wp, 1.1e-5_wp], 0.4_wp, &
    1.3e3_wp, grains=1.0e-6_wp)
  skeleton%retention = fem_retention_type(van_genuchten, 2.0e-4_wp, 2.1_wp, 0.1_wp, by_mualem, &
    effective=.true.)
  step = fem_flow_step_type(0.5_wp, 0.75_wp, [0.3_wp, -0.2_wp, -2.0_wp])
  do k = 1, size(names)
    call make_rule(rule_index(trim(names(k))), rule)
    call place_element()
    call check_slopes(trim(names(k)))
    call check_motion(trim(names(k)))
    call check_sums(trim(names(k)))
    call check_energy(trim(names(k)))
    call check_weight(trim(names(k)))
    call check_full(trim(names(k)))
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
    call wet_shape(rule, x, 2.0e6_wp, wet)
    if (allocated(change%p)) deallocate (change%p, change%moved, change%gone)
    allocate (change%p(rule%corners, 2), change%moved(3, rule%nodes), change%gone(3, rule%nodes))
    do a = 1, rule%nodes
      change%moved(:, a) = 0.01_wp*[sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a + 1.0_wp)]
      change%gone(:, a) = 0.01_wp*[cos(0.3_wp*a), sin(3.1_wp*a), cos(1.7_wp*a)]
    end do
    do a = 1, rule%corners
      change%p(a, :) = 1.0e4_wp*[cos(1.9_wp*a), sin(2.7_wp*a) - 0.3_wp]
    end do
  end subroutine place_element

  !> Columns of the matrix are central differences, but for what those leave.
  subroutine check_slopes(name)
    character(len=*), intent(in) :: name
    real(wp) :: coupling(3*rule%nodes, rule%corners, 2), flow(rule%corners, rule%corners)
    real(wp) :: f(3, rule%nodes, 2), v(rule%corners, 2), off(3)
    real(wp), parameter :: dp = 1.0_wp, du = 1.0e-5_wp
    type(fem_flow_change_type) :: other
    integer(i4) :: a, i
    call moist_matrix(rule, skeleton, wet, step, change, coupling, flow)
    off = 0.0_wp
    do a = 1, rule%corners
      do i = 1, 2
        other = change
        other%p(a, 2) = other%p(a, 2) + dp*(2*i - 3)
        call moist_force(rule, skeleton, wet, step, other, f(:, :, i), v(:, i))
      end do
      off(1) = max(off(1), max_abs(reshape(f(:, :, 2) - f(:, :, 1), [3*rule%nodes])/(2*dp) &
        - coupling(:, a, 1)))
      off(2) = max(off(2), max_abs((v(:, 2) - v(:, 1))/(2*dp) - flow(:, a)))
    end do
    do a = 1, rule%nodes
      do i = 1, 2
        other = change
        other%moved(2, a) = other%moved(2, a) + du*(2*i - 3)
        call moist_force(rule, skeleton, wet, step, other, f(:, :, i), v(:, i))
      end do
      off(3) = max(off(3), max_abs((v(:, 2) - v(:, 1))/(2*du) - coupling(3*a - 1, :, 2)))
    end do
    off = off/[max_abs(coupling(:, :, 1)), max_abs(flow), max_abs(coupling(:, :, 2))]
    call test%check(name//': matrices are slopes, '//str(maxval(off)), maxval(off) < 1.0e-6_wp)
    call test%check(name//': not symmetric', max_abs(flow - transpose(flow)) &
      > 1.0e-3_wp*max_abs(flow))
  end subroutine check_slopes

  !> In dynamics the liquid falls with the acceleration, and pores lack its inertia: slopes are
  !! those of differences, a uniform acceleration makes the weight of what is lacking.
  subroutine check_motion(name)
    character(len=*), intent(in) :: name
    real(wp) :: coupling(3*rule%nodes, rule%corners, 2), flow(rule%corners, rule%corners)
    real(wp) :: f(3, rule%nodes, 2), v(rule%corners, 2), off(3), mass(rule%nodes, rule%nodes)
    real(wp) :: by_p(3*rule%nodes, rule%corners), a(3, rule%nodes)
    real(wp), parameter :: dp = 1.0_wp, du = 1.0e-5_wp
    type(fem_flow_change_type) :: other, shaken
    integer(i4) :: k, i
    step%inertia = 40.0_wp
    shaken = change
    shaken%a = step%theta*step%inertia*change%moved
    call moist_matrix(rule, skeleton, wet, step, shaken, coupling, flow)
    off = 0.0_wp
    do k = 1, rule%nodes
      do i = 1, 2
        other = shaken
        other%moved(3, k) = other%moved(3, k) + du*(2*i - 3)
        other%a = step%theta*step%inertia*other%moved
        call moist_force(rule, skeleton, wet, step, other, f(:, :, i), v(:, i))
      end do
      off(1) = max(off(1), max_abs((v(:, 2) - v(:, 1))/(2*du) - coupling(3*k, :, 2)))
    end do
    a = step%inertia*change%moved
    call moist_mass(rule, skeleton, wet, change%p(:, 2), a, mass, by_p)
    do k = 1, rule%corners
      do i = 1, 2
        other = shaken
        other%p(k, 2) = other%p(k, 2) + dp*(2*i - 3)
        f(:, :, i) = moist_inertia(rule, skeleton, wet, other%p(:, 2), a)
      end do
      off(2) = max(off(2), max_abs(reshape(f(:, :, 2) - f(:, :, 1), [3*rule%nodes])/(2*dp) &
        - by_p(:, k)))
    end do
    f(:, :, 1) = moist_inertia(rule, skeleton, wet, change%p(:, 2), a)
    off(3) = max_abs(f(:, :, 1) - matmul(a, mass))
    off = off/[max_abs(coupling(:, :, 2)), max_abs(by_p), max_abs(f(:, :, 1))]
    call test%check(name//': slopes of motion, '//str(maxval(off)), maxval(off) < 1.0e-6_wp)
    call check_uniform(name)
    step%inertia = 0.0_wp
  end subroutine check_motion

  !> A uniform acceleration of pores with one saturation.
  subroutine check_uniform(name)
    character(len=*), intent(in) :: name
    real(wp) :: a(3, rule%nodes), p(rule%corners), s, unused, total(3)
    a = spread([2.0_wp, -1.0_wp, 0.5_wp], 2, rule%nodes)
    p = -4.0e3_wp
    call retain(skeleton%retention, p(1), s, unused)
    total = sum(moist_inertia(rule, skeleton, wet, p, a), 2)
    call test%check_all_close(name//': inertia of what lacks', total/(skeleton%porosity &
      *skeleton%density*(s - 1.0_wp)*sum(wet%shape%weight)), a(:, 1), 1.0e-13_wp)
    call test%check(name//': full pores lack none', max_abs(moist_inertia(rule, skeleton, wet, &
      -p, a)) <= 0.0_wp)
  end subroutine check_uniform

  !> Corners lose what the element gains, by the state alone: one step or two.
  subroutine check_sums(name)
    character(len=*), intent(in) :: name
    real(wp) :: f(3, rule%nodes), v(rule%corners), parts(2), whole
    type(fem_flow_change_type) :: half
    integer(i4) :: a
    call moist_force(rule, skeleton, wet, step, change, f, v)
    whole = moist_gain(rule, skeleton, wet, change)
    call test%check(name//': contents add up', abs(sum(v) + whole) < 1.0e-14_wp)
    half = change
    half%p(:, 2) = -[(2.0e3_wp*a, a=1, rule%corners)]
    half%moved(:, 1) = 0.003_wp
    parts(1) = moist_gain(rule, skeleton, wet, half)
    half%gone = change%gone + half%moved
    half%moved = change%gone + change%moved - half%gone
    half%p = reshape([half%p(:, 2), change%p(:, 2)], shape(half%p))
    parts(2) = moist_gain(rule, skeleton, wet, half)
    call test%check_close(name//': two steps', sum(parts), whole, 1.0e-14_wp)
    call test%check(name//': gains', abs(whole) > 1.0e-3_wp)
  end subroutine check_sums

  !> Work of the mean pressure on what enters is stored, dissipated or given to the solid.
  subroutine check_energy(name)
    character(len=*), intent(in) :: name
    type(fem_flow_energy_type) :: after, before
    type(fem_flow_change_type) :: still
    real(wp) :: v(rule%corners), flow(rule%corners), given, off, ends(3, rule%nodes, 2)
    call moist_force(rule, skeleton, wet, step, change, ends(:, :, 2), v)
    still = change
    still%p(:, 2) = still%p(:, 1)
    call moist_force(rule, skeleton, wet, step, still, ends(:, :, 1), flow)
    given = 0.5_wp*sum(change%moved*sum(ends, 3))  ! to the pressures, by the solid
    after = moist_energy(rule, skeleton, wet, step, change)
    before = moist_energy(rule, skeleton, wet, step, still)
    off = -dot_product(0.5_wp*sum(change%p, 2), v) + given + after%fall + after%weight &
      - (after%stored - before%stored) - after%gained - after%darcy - after%numerical
    call test%check(name//': energies balance, '//str(off/after%darcy), &
                    abs(off) < 1.0e-12_wp*after%darcy)
    call test%check(name//': flow dissipates', after%darcy > 0.0_wp)
  end subroutine check_energy

  !> Suction at rest is a function of the height and does not flow; the force lacks the weight of
  !! what pores lack.
  subroutine check_weight(name)
    character(len=*), intent(in) :: name
    real(wp) :: f(3, rule%nodes), v(rule%corners), s, unused, means(5), lacks(3)
    type(fem_flow_change_type) :: rest
    if (rule%nodes > rule%corners) then  ! corners alone do not place curved elements
      x = matmul(x(:, :rule%corners), rule%middle)
      call wet_shape(rule, x, 2.0e6_wp, wet)
    end if
    rest = change
    rest%moved = 0.0_wp
    rest%p = spread(-2.0e4_wp + skeleton%density*matmul(step%gravity, x(:, :rule%corners)), 2, 2)
    call moist_force(rule, skeleton, wet, step, rest, f, v)
    call test%check(name//': suction at rest', max_abs(v) < 1.0e-13_wp)
    rest%p = -3.0e3_wp
    call moist_force(rule, skeleton, wet, step, rest, f, v)
    call retain(skeleton%retention, -3.0e3_wp, s, unused)
    lacks = (1.0_wp - s)*skeleton%porosity*skeleton%density*step%gravity*sum(wet%shape%weight)
    call test%check_all_close(name//': weight of the liquid', sum(f, 2)/norm2(lacks), &
      lacks/norm2(lacks), 1.0e-12_wp)
    means = moist_means(rule, skeleton, wet, step%gravity, rest%p(:, 1))
    call test%check_close(name//': mean saturation', means(5), s, 1.0e-14_wp)
    call test%check_close(name//': Bishop with S_e', means(4), -3.0e3_wp*(s - 0.1_wp)/0.9_wp, &
      1.0e-9_wp)
  end subroutine check_weight

  !> Above the pressure of the air pores are full: forces and sums are those of fem_pore_element.
  subroutine check_full(name)
    character(len=*), intent(in) :: name
    real(wp), dimension(3, rule%nodes, 2) :: f
    real(wp) :: v(rule%corners, 2)
    type(fem_flow_change_type) :: full
    full = change
    full%p = full%p + 2.0e4_wp
    call moist_force(rule, skeleton, wet, step, full, f(:, :, 1), v(:, 1))
    call wet_force(rule, skeleton, wet, step, full, f(:, :, 2), v(:, 2))
    call test%check(name//': full pores, force', max_abs(reshape(f(:, :, 1) - f(:, :, 2), &
      [3*rule%nodes])) < 1.0e-10_wp*max_abs(f))
    call test%check_close(name//': full pores, sum', sum(v(:, 1)), -wet_content(rule, skeleton, &
      wet, full%moved, full%p(:, 2) - full%p(:, 1)), 1.0e-13_wp)
  end subroutine check_full
end program test_fem_unsaturated
