!> Crushing of grains: tangents against differences, the closed line of isotropic compression,
!! the share of crushing in the dissipation, the grading index, stress-free starts, open points.
program test_fem_law_breakage
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_law, only: integrate, at_flag, at_dissipated, at_plastic, at_stored, at_numerical, &
    common_size, flag_apex, flag_elastic, flag_yielding
  use fem_law_breakage, only: fem_law_breakage_type, grading_index
  use fem_voigt, only: unit, trace
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: states = common_size + 2, at_breakage = common_size + 1
  real(wp), parameter :: shape_of(6) = [0.1_wp, -0.3_wp, -1.0_wp, 0.4_wp, -0.7_wp, 0.2_wp]
  real(wp), parameter :: tangent_limit = 1.0e-6_wp  !! relative, of central differences
  type(fem_law_breakage_type) :: law, loose

  call law%define()
  law%bulk = 13833.0e6_wp
  law%shear = 7588.0e6_wp
  law%slope = 1.7_wp
  law%critical = 4.65e6_wp
  law%crush = cos(70.0_wp*acos(-1.0_wp)/180.0_wp)**2
  law%index = grading_index(0.001_wp/0.105_wp, 2.6_wp)
  loose = law
  loose%residual = 1.0e5_wp
  call test%check_close('grading index', law%index, 0.8026645858_wp, 1.0e-10_wp)
  call check_tangent('isotropic', -4.0e8_wp, -0.01_wp*unit, flag_yielding)
  call check_tangent('sheared', -1.0e8_wp, 0.03_wp*shape_of, flag_yielding)
  call check_tangent('sheared far', -1.0e8_wp, 0.1_wp*shape_of, flag_yielding)
  call check_tangent('elastic', -1.0e8_wp, 1.0e-4_wp*shape_of, flag_elastic)
  call check_line()
  call check_shares()
  call check_free_start()
  call check_open()
  call test%finish()

contains

  subroutine begin_at(of, p, stress, state)
    type(fem_law_breakage_type), intent(in) :: of
    real(wp), intent(in) :: p
    real(wp), intent(out) :: stress(6), state(states)
    character(len=:), allocatable :: fault, cure
    stress = p*unit
    call of%begin(stress, state, fault, cure)
    call test%check_text('begins', fault, '')
  end subroutine begin_at

  subroutine check_tangent(name, p, strain, flag)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: p, strain(6), flag
    real(wp) :: stress(6), state(states), tangent(6, 6), slopes(6, 6), unused(6, 6), moved(6)
    real(wp) :: high(6), low(6), step
    logical :: good
    integer(i4) :: j
    step = 1.0e-5_wp*max_abs(strain)
    do j = 1, 6
      moved = strain
      moved(j) = strain(j) + step
      call begin_at(law, p, high, state)
      call integrate(law, moved, high, state, unused, good)
      moved(j) = strain(j) - step
      call begin_at(law, p, low, state)
      call integrate(law, moved, low, state, unused, good)
      slopes(:, j) = (high - low)/(2.0_wp*step)
    end do
    call begin_at(law, p, stress, state)
    call integrate(law, strain, stress, state, tangent, good)
    call test%check(name//': converges', good)
    call test%check_close(name//': flag', state(at_flag), flag, 0.0_wp)
    call test%check_close(name//': tangent', max_abs(tangent - slopes)/law%bulk, 0.0_wp, &
                          tangent_limit)
  end subroutine check_tangent

  !> B is that of the pressure in any steps.
  subroutine check_line()
    real(wp) :: stress(6), state(states), tangent(6, 6), x
    logical :: good
    integer(i4) :: k
    call begin_at(law, -4.0e8_wp, stress, state)
    do k = 1, 10
      call integrate(law, -0.01_wp*unit, stress, state, tangent, good)
      call test%check('line: converges', good)
      x = -trace(stress)/3.0_wp/sqrt(2.0_wp*law%bulk*law%critical/law%index)
      call test%check_close('line: B', state(at_breakage), (x - 1.0_wp)/(x - law%index), &
                            1.0e-10_wp)
    end do
  end subroutine check_line

  !> p de_v^p = tan^2 omega E_B dB in the limit, here within an increment's change; the ledger is
  !! the work; dissipation and B grow.
  subroutine check_shares()
    real(wp) :: stress(6), state(states), was(states), before(6), tangent(6, 6), strain(6)
    logical :: good
    integer(i4) :: k
    strain = 1.0e-3_wp*(shape_of - 0.2_wp*unit)
    call begin_at(law, -2.0e8_wp, stress, state)
    do k = 1, 40
      was = state
      before = stress
      call integrate(law, strain, stress, state, tangent, good)
      call test%check('shares: converges', good)
      call test%check('shares: grow', state(at_dissipated) >= was(at_dissipated) .and. &
                      state(at_breakage) >= was(at_breakage))
      call test%check_close('shares: work', sum(state(at_stored:at_numerical) &
        - was(at_stored:at_numerical))/(0.5_wp*sum((before + stress)*strain)), 1.0_wp, 1.0e-10_wp)
    end do
    call test%check('shares: crushes', state(at_breakage) > was(at_breakage))
    ! backward Euler: dB (1 - B)/(1 - B_n) is 2 cos^2 lambda (1 - B)^2/E_c
    call test%check_close('shares: volume', -trace(stress)/3.0_wp &
      *(-trace(state(at_plastic:at_plastic + 5) - was(at_plastic:at_plastic + 5))) &
      /((1.0_wp - law%crush)/law%crush*state(common_size + 2)*(state(at_breakage) &
      - was(at_breakage))*(1.0_wp - state(at_breakage))/(1.0_wp - was(at_breakage))), 1.0_wp, &
      1.0e-8_wp)
  end subroutine check_shares

  !> A residual pressure admits a stress-free start, in compression and shear.
  subroutine check_free_start()
    real(wp) :: stress(6), state(states), tangent(6, 6)
    character(len=:), allocatable :: fault, cure
    logical :: good
    stress = 0.0_wp
    call law%begin(stress, state, fault, cure)
    call test%check('free start: not without it', index(fault, 'compressive') > 0)
    call begin_at(loose, 0.0_wp, stress, state)
    call integrate(loose, 1.0e-4_wp*[0.0_wp, 0.0_wp, -1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp], stress, &
                   state, tangent, good)
    call test%check('free start: compresses', good .and. -stress(3) > 0.0_wp)
  end subroutine check_free_start

  !> Expansion opens the point, with nothing left but the residual pressure.
  subroutine check_open()
    real(wp) :: stress(6), state(states), tangent(6, 6)
    logical :: good
    call begin_at(loose, -1.0e6_wp, stress, state)
    call integrate(loose, 1.0e-3_wp*unit, stress, state, tangent, good)
    call test%check('open: goes on', good)
    call test%check_close('open: flag', state(at_flag), flag_apex, 0.0_wp)
    call test%check_close('open: pressure', trace(stress)/3.0_wp/loose%residual, 1.0_wp, 1.0e-3_wp)
  end subroutine check_open
end program test_fem_law_breakage
