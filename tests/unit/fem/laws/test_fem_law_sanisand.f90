!> Critical-state sand: tangents against differences, rates against the tangent, turning of stress
!! and fabric, increments in parts, the least pressure, starts that are refused.
program test_fem_law_sanisand
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_law, only: integrate, at_flag, at_dissipated, at_plastic, at_stored, at_numerical, &
    common_size, flag_apex, flag_elastic, flag_yielding
  use fem_law_sanisand, only: fem_law_sanisand_type
  use fem_voigt, only: unit, trace, magnitude
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: states = common_size + 20, at_void = common_size + 19
  real(wp), parameter :: shape_of(6) = [0.3_wp, 0.5_wp, -1.0_wp, 0.4_wp, -0.7_wp, 0.2_wp]
  real(wp), parameter :: press(6) = -1.0e5_wp*unit
  type(fem_law_sanisand_type) :: law

  law = toyoura(0.8_wp, 500.0_wp)
  call check_tangents()
  call check_rate()
  call check_turned()
  call check_parts()
  call check_least()
  call check_elastic()
  call check_starts()
  call test%finish()

contains

  !> Toyoura sand (Dafalias and Manzari 2004) of a void ratio and a residual pressure.
  function toyoura(void_ratio, residual) result(sand_law)
    real(wp), intent(in) :: void_ratio, residual
    type(fem_law_sanisand_type) :: sand_law
    call sand_law%define()
    sand_law%void_ratio = void_ratio
    sand_law%least_void = 0.8_wp*void_ratio
    associate (sand => sand_law%sand)
      sand%shear = 125.0_wp
      sand%ratio = 2.0_wp*1.05_wp/(3.0_wp*0.9_wp)
      sand%slope = 1.25_wp
      sand%extension = 0.712_wp
      sand%line_void = 0.934_wp
      sand%line_slope = 0.019_wp
      sand%hardening = 7.05_wp
      sand%hardening_void = 0.968_wp
      sand%bounding_rate = 1.1_wp
      sand%dilatancy = 0.704_wp
      sand%dilatancy_rate = 3.5_wp
      sand%fabric_limit = 4.0_wp
      sand%fabric_rate = 600.0_wp
      sand%residual = residual
      sand%least = max(0.1_wp*residual, 1.0_wp)
    end associate
  end function toyoura

  !> A point after some increments of a strain from isotropic stress.
  subroutine run_to(strain, increments, stress, state)
    real(wp), intent(in) :: strain(6)
    integer(i4), intent(in) :: increments
    real(wp), intent(out) :: stress(6), state(states)
    real(wp) :: tangent(6, 6)
    character(len=:), allocatable :: fault, cure
    logical :: good
    integer(i4) :: k
    stress = press
    call law%begin(stress, state, fault, cure)
    call test%check_text('begins', fault, '')
    do k = 1, increments
      call integrate(law, strain/increments, stress, state, tangent, good)
      call test%check('converges', good)
    end do
  end subroutine run_to

  !> Tangents of increments of several sizes, first and later ones, against central differences.
  subroutine check_tangents()
    real(wp), parameter :: sizes(4) = [1.0e-5_wp, 1.0e-4_wp, 1.0e-3_wp, 1.0e-2_wp]
    real(wp) :: stress(6), state(states)
    integer(i4) :: k, before
    do k = 1, size(sizes)
      do before = 0, 10, 10
        call run_to(1.0e-2_wp*shape_of, before, stress, state)
        call check_tangent(sizes(k)*shape_of, stress, state)
        call check_tangent(-sizes(k)*shape_of, stress, state)
      end do
    end do
  end subroutine check_tangents

  subroutine check_tangent(strain, stress, state)
    real(wp), intent(in) :: strain(6), stress(6), state(states)
    real(wp) :: tangent(6, 6), slopes(6, 6), unused(6, 6), high(6), low(6), there(states), moved(6)
    real(wp) :: step
    logical :: good
    integer(i4) :: j
    high = stress
    there = state
    call integrate(law, strain, high, there, tangent, good)
    call test%check('tangent: converges', good)
    step = 1.0e-3_wp*max_abs(strain)
    do j = 1, 6
      moved = strain
      moved(j) = strain(j) + step
      high = stress
      there = state
      call integrate(law, moved, high, there, unused, good)
      moved(j) = strain(j) - step
      low = stress
      there = state
      call integrate(law, moved, low, there, unused, good)
      slopes(:, j) = (high - low)/(2.0_wp*step)
    end do
    call test%check_close('tangent', max_abs(tangent - slopes)/max_abs(slopes), 0.0_wp, 1.0e-3_wp)
  end subroutine check_tangent

  !> The tangent of no increment is the rate of a small one; the stress stays to the last bit.
  subroutine check_rate()
    real(wp) :: stress(6), state(states), tangent(6, 6), there(6), small(6)
    real(wp) :: unused(6, 6)
    logical :: good
    call run_to(1.0e-2_wp*shape_of, 10, stress, state)
    call test%check_close('rate: yields', state(at_flag), flag_yielding, 0.0_wp)
    there = stress
    call integrate(law, 0.0_wp*unit, there, state, tangent, good)
    call test%check('rate: converges', good)
    call test%check_close('rate: nothing moves', max_abs(there - stress), 0.0_wp, 1.0e-9_wp)
    small = 1.0e-8_wp*shape_of
    call integrate(law, small, there, state, unused, good)
    call test%check_close('rate: stress', max_abs(there - stress - matmul(tangent, small)) &
                          /max_abs(there - stress), 0.0_wp, 1.0e-3_wp)
  end subroutine check_rate

  !> A cyclic permutation of the axes permutes the results.
  subroutine check_turned()
    integer(i4), parameter :: turn(6) = [2, 3, 1, 5, 6, 4]
    real(wp) :: stress(6), state(states), other(6), moved(states), strain(6)
    strain = 2.0e-2_wp*shape_of
    call run_to(strain, 10, stress, state)
    call run_to(strain(turn), 10, other, moved)
    call test%check_close('turned: stress', max_abs(other - stress(turn))/max_abs(stress), 0.0_wp, &
                          1.0e-6_wp)
    call test%check_close('turned: plastic strain', max_abs(moved(at_plastic:at_plastic + 5) &
      - pick(state, turn)), 0.0_wp, 1.0e-8_wp)
  end subroutine check_turned

  pure function pick(state, turn) result(plastic)
    real(wp), intent(in) :: state(states)
    integer(i4), intent(in) :: turn(6)
    real(wp) :: plastic(6)
    plastic = state(at_plastic - 1 + turn)
  end function pick

  !> A straight path is the same in one increment and in many; the ledger closes; the void ratio is
  !! that of the volume; dissipation grows.
  subroutine check_parts()
    real(wp) :: once(6), state(states), often(6), there(states), strain(6)
    strain = 1.0e-2_wp*shape_of
    call run_to(strain, 1, once, state)
    call run_to(strain, 64, often, there)
    call test%check_close('parts: stress', max_abs(once - often)/max_abs(often), 0.0_wp, 1.0e-5_wp)
    call test%check_close('parts: void ratio', there(at_void), &
                          1.8_wp*exp(trace(strain)) - 1.0_wp, 1.0e-9_wp)
    call test%check('parts: dissipation', there(at_dissipated) > 0.0_wp)
    call test%check_close('parts: work of one increment', sum(state(at_stored:at_numerical)) &
                          /(0.5_wp*sum((press + once)*strain)), 1.0_wp, 1.0e-12_wp)
  end subroutine check_parts

  !> Expansion ends at the least pressure with the flag of an apex; compression leads back.
  subroutine check_least()
    real(wp) :: stress(6), state(states), tangent(6, 6)
    logical :: good
    call run_to(1.0e-2_wp*unit, 3, stress, state)
    call test%check_close('least: flag', state(at_flag), flag_apex, 0.0_wp)
    call test%check_close('least: pressure', -trace(stress)/3.0_wp, &
                          law%sand%least - law%sand%residual, 1.0e-9_wp)
    call integrate(law, -1.0e-3_wp*unit, stress, state, tangent, good)
    call test%check('least: back', good .and. -trace(stress) > 0.0_wp)
  end subroutine check_least

  !> Isotropic compression does not yield, and p follows the closed form where e hardly changes.
  subroutine check_elastic()
    real(wp) :: stress(6), state(states), k, wanted
    call run_to(-1.0e-4_wp*unit, 1, stress, state)
    call test%check_close('elastic: flag', state(at_flag), flag_elastic, 0.0_wp)
    k = 125.0_wp*sqrt(101.0e3_wp)*(2.97_wp - 0.8_wp)**2/1.8_wp*law%sand%ratio
    wanted = (sqrt(1.0e5_wp + 500.0_wp) + 0.5_wp*k*3.0e-4_wp)**2 - 500.0_wp
    call test%check_close('elastic: p', -trace(stress)/3.0_wp/wanted, 1.0_wp, 1.0e-4_wp)
    call test%check('elastic: moduli of waves are not below', &
                    all(law%modulus(stress) >= 0.999_wp*k*sqrt(1.0e5_wp)*[1.0_wp, &
                                                                       1.0_wp/law%sand%ratio]))
  end subroutine check_elastic

  !> No pressure, and a stress ratio beyond the bounding surface.
  subroutine check_starts()
    real(wp) :: state(states)
    character(len=:), allocatable :: fault, cure
    call law%begin(1.0e3_wp*unit, state, fault, cure)
    call test%check('start: tension', index(fault, 'compressive mean stress') > 0)
    call law%begin(-1.0e5_wp*[1.0_wp, 1.0_wp, 7.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], state, fault, cure)
    call test%check('start: too much shear', index(fault, 'bounding surface') > 0)
    call law%begin(-1.0e5_wp*[0.5_wp, 0.5_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], state, fault, cure)
    call test%check_text('start: at rest', fault, '')
    call test%check('start: axis of the surface', &
                    magnitude(state(common_size + 1:common_size + 6)) > 0.2_wp)
  end subroutine check_starts
end program test_fem_law_sanisand
