!> Micropolar Drucker-Prager: tangents against differences, closed forms of the return, the
!! classical law where nothing is polar, dissipation that is never negative.
program test_fem_law_polar_drucker
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use fem_law, only: integrate, at_flag, at_stored, at_dissipated, at_numerical, at_plastic, &
    common_size, flag_elastic, flag_yielding, flag_apex
  use fem_cone, only: cone_constants
  use fem_law_drucker, only: fem_law_drucker_type
  use fem_law_polar_drucker, only: fem_law_polar_drucker_type, polar_states
  use fem_polar, only: polar_size, families, eringen_families, family_squares, spread_families, &
    polar_unit, full_of, symmetric_of
  use fem_micropolar, only: micropolar_stress
  implicit none
  type(test_type) :: test
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: moduli(6) = [3.0e7_wp, 2.5e7_wp, 2.0e7_wp, 1.0e3_wp, 5.0e2_wp, 3.0e3_wp]
  real(wp), parameter :: length = 1.0e-2_wp     !! of the curvature in a strain [m]
  real(wp), parameter :: tangent_limit = 1.0e-7_wp
  real(wp), parameter :: press(6) = -1.0e5_wp*[1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  real(wp), parameter :: borst(3) = [0.25_wp, 0.25_wp, 0.5_wp]
  real(wp), parameter :: static(3) = [0.75_wp, -0.25_wp, 0.125_wp]
  real(wp), parameter :: kinematic(3) = [0.375_wp, 0.125_wp, 0.25_wp]
  integer(i4) :: seed = 7

  call check_elastic()
  call check_tangents('de Borst', polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp, borst))
  call check_tangents('static', polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp, static))
  call check_tangents('kinematic', polar_law(30.0_wp, 0.0_wp, 2.0e4_wp, -1.0e6_wp, kinematic))
  call check_tangents('no friction', polar_law(0.0_wp, 0.0_wp, 2.0e4_wp, 0.0_wp, static))
  call check_apex()
  call check_returns()
  call check_classical()
  call check_walk('de Borst', polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp, borst))
  call check_walk('static', polar_law(35.0_wp, 35.0_wp, 2.0e4_wp, 0.0_wp, static))
  call check_walk('softening', polar_law(30.0_wp, 0.0_wp, 2.0e4_wp, -1.0e6_wp, kinematic))
  call check_start()
  call test%finish()

contains

  function polar_law(friction, dilation, cohesion, hardening, share) result(law)
    real(wp), intent(in) :: friction, dilation, cohesion, hardening, share(3)
    type(fem_law_polar_drucker_type) :: law
    law%modulus_of = eringen_families(moduli)
    law%weight_of = [1.0_wp, 2.0_wp*(share(1) - share(2)), 0.0_wp, &
                     2.0_wp*share(3)/length**2*[1.0_wp, 1.0_wp, 1.0_wp]]
    law%cone%cohesion = cohesion
    law%cone%hardening = hardening
    law%cone%residual = 0.5_wp*cohesion
    call law%define()
    call cone_constants(friction*degree, dilation*degree, -1, law%cone%a, law%cone%b)
    call cone_constants(dilation*degree, dilation*degree, -1, law%cone%a_flow, law%cone%b_flow)
  end function polar_law

  !> Uniform numbers in -1 .. 1, always the same.
  real(wp) function next()
    seed = mod(16807_i4*mod(seed, 127773_i4) - 2836_i4*(seed/127773_i4) + huge(seed), huge(seed))
    next = 2.0_wp*real(seed, wp)/real(huge(seed), wp) - 1.0_wp
  end function next

  function random_strain(size_of) result(strain)
    real(wp), intent(in) :: size_of
    real(wp) :: strain(polar_size)
    integer(i4) :: j
    strain = [(size_of*next(), j=1, polar_size)]
    strain = strain - 0.3_wp*sum(strain*polar_unit)*polar_unit  ! little change of volume
    strain(10:) = strain(10:)/length
  end function random_strain

  subroutine begin(law, stress, state)
    type(fem_law_polar_drucker_type), intent(in) :: law
    real(wp), intent(out) :: stress(polar_size)
    real(wp), intent(out) :: state(polar_states)
    character(len=:), allocatable :: fault, cure
    call law%begin(press, state, fault, cure)
    call test%check_text('begins', fault, '')
    stress = 0.0_wp
    stress(:9) = press(full_of)
  end subroutine begin

  !> Without yielding the law is Eringen's.
  subroutine check_elastic()
    type(fem_law_polar_drucker_type) :: law
    real(wp) :: stress(polar_size), state(polar_states), strain(polar_size), wanted(polar_size)
    real(wp) :: tangent(polar_size, polar_size)
    logical :: good
    law = polar_law(30.0_wp, 0.0_wp, 1.0e9_wp, 0.0_wp, borst)
    strain = random_strain(1.0e-3_wp)
    stress = 0.0_wp
    state = 0.0_wp
    call law%polar_update(strain, stress, state, tangent, good)
    call micropolar_stress(moduli, strain(:9), reshape(strain(10:), [3, 3]), wanted(:9), &
                           wanted(10:))
    call test%check('elastic', good .and. abs(state(at_flag) - flag_elastic) <= 0.0_wp)
    call test%check_close('elastic: stress', max_abs(stress(:9) - wanted(:9)) &
                          /max_abs(wanted(:9)), 0.0_wp, 1.0e-14_wp)
    call test%check_close('elastic: couple stress', max_abs(stress(10:) - wanted(10:)) &
                          /max_abs(wanted(10:)), 0.0_wp, 1.0e-14_wp)
    call test%check_close('elastic: tangent', max_abs(matmul(tangent, strain) - stress) &
                          /max_abs(stress), 0.0_wp, 1.0e-14_wp)
    call test%check_close('elastic: energy', state(at_stored)/(0.5_wp*sum(stress*strain)), 1.0_wp, &
                          1.0e-14_wp)
  end subroutine check_elastic

  !> Two increments into yielding, the tangent of the second by central differences, in components
  !! made strains by the length.
  subroutine check_tangents(name, law)
    character(len=*), intent(in) :: name
    type(fem_law_polar_drucker_type), intent(in) :: law
    real(wp) :: stress(polar_size), start(polar_size), state(polar_states), was(polar_states)
    real(wp) :: strain(polar_size), tangent(polar_size, polar_size), worst
    logical :: good
    integer(i4) :: k, yielded
    worst = 0.0_wp
    yielded = 0
    do k = 1, 20
      call begin(law, start, was)
      call law%polar_update(random_strain(5.0e-3_wp), start, was, tangent, good)
      strain = random_strain(5.0e-3_wp)
      stress = start
      state = was
      call law%polar_update(strain, stress, state, tangent, good)
      call test%check(name//': converges', good)
      if (abs(state(at_flag) - flag_yielding) > 0.0_wp) cycle
      yielded = yielded + 1
      worst = larger(worst, difference(law, strain, start, was, tangent))
    end do
    call test%check(name//': yields', yielded >= 10)
    call test%check_close(name//': tangent', worst, 0.0_wp, tangent_limit)
  end subroutine check_tangents

  !> Largest difference of a tangent from central differences, over the largest entry, with
  !! curvature times `length` as strains and couple stresses over it as stresses.
  real(wp) function difference(law, strain, start, was, tangent)
    type(fem_law_polar_drucker_type), intent(in) :: law
    real(wp), intent(in) :: strain(polar_size), start(polar_size), was(polar_states)
    real(wp), intent(in) :: tangent(polar_size, polar_size)
    real(wp), parameter :: step = 2.0e-8_wp
    real(wp), dimension(polar_size) :: moved, high, low, scale
    real(wp) :: state(polar_states), unused(polar_size, polar_size)
    logical :: good
    integer(i4) :: j
    difference = 0.0_wp
    scale(:9) = 1.0_wp
    scale(10:) = length
    do j = 1, polar_size
      moved = strain
      moved(j) = strain(j) + step/scale(j)
      high = start
      state = was
      call law%polar_update(moved, high, state, unused, good)
      moved(j) = strain(j) - step/scale(j)
      low = start
      state = was
      call law%polar_update(moved, low, state, unused, good)
      difference = larger(difference, max_abs((tangent(:, j)/scale(j) - (high - low) &
                                               /(2.0_wp*step))/scale))
    end do
    difference = difference/law%modulus_of(3)
  end function difference

  !> Apex: all that has a weight vanishes, p = A c/B, closed dilation; the tangent there.
  subroutine check_apex()
    type(fem_law_polar_drucker_type) :: law
    real(wp) :: stress(polar_size), state(polar_states), strain(polar_size), grown, c, bulk
    real(wp) :: tangent(polar_size, polar_size), left(families), none(polar_size)
    real(wp) :: was(polar_states)
    logical :: good
    law = polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp, borst)
    strain = random_strain(1.0e-4_wp) + 1.0e-2_wp*polar_unit
    none = 0.0_wp
    was = 0.0_wp
    stress = none
    state = was
    call law%polar_update(strain, stress, state, tangent, good)
    bulk = law%modulus_of(3)/3.0_wp
    grown = (bulk*sum(strain*polar_unit) - law%cone%a/law%cone%b*law%cone%cohesion) &
      /(bulk + law%cone%a/law%cone%b*law%cone%a_flow/law%cone%b_flow*law%cone%hardening)
    c = law%cone%cohesion + law%cone%hardening*law%cone%a_flow/law%cone%b_flow*grown
    left = family_squares(stress)
    call test%check_close('apex: flag', state(at_flag), flag_apex, 0.0_wp)
    call test%check_close('apex: p', sum(stress*polar_unit)/3.0_wp &
                          /(law%cone%a/law%cone%b*c), 1.0_wp, 1.0e-12_wp)
    call test%check_all_close('apex: shear and couples', left([1, 4, 5, 6]), 0.0_wp, &
                              1.0e-8_wp)
    call test%check('apex: the skew part has no weight', left(2) > 0.0_wp)
    call test%check_close('apex: tangent', difference(law, strain, none, was, tangent), 0.0_wp, &
                          tangent_limit)
  end subroutine check_apex

  !> f = 0 after the return, and the closed form where all products of modulus and weight are one.
  subroutine check_returns()
    type(fem_law_polar_drucker_type) :: law
    real(wp) :: stress(polar_size), state(polar_states), strain(polar_size), trial(polar_size)
    real(wp) :: tangent(polar_size, polar_size), q, step, c, bulk
    logical :: good
    law = polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp, static)
    call begin(law, stress, state)
    call law%polar_update(random_strain(5.0e-3_wp), stress, state, tangent, good)
    q = sqrt(sum(law%weight_of*family_squares(stress)))
    c = law%cone%cohesion + law%cone%hardening*state(common_size + 1)
    call test%check_close('cone: f', (q + law%cone%b*sum(stress*polar_unit)/3.0_wp &
                          - law%cone%a*c)/q, 0.0_wp, 1.0e-12_wp)
    call test%check('cone: takes more than one iteration', state(2) > 1.0_wp)
    law%weight_of([2, 4, 5, 6]) = law%modulus_of(1)/law%modulus_of([2, 4, 5, 6])
    call begin(law, stress, state)
    strain = random_strain(5.0e-3_wp)
    trial = stress + spread_families(law%modulus_of, strain)
    call law%polar_update(strain, stress, state, tangent, good)
    q = sqrt(sum(law%weight_of*family_squares(trial)))
    bulk = law%modulus_of(3)/3.0_wp
    step = (q + law%cone%b*sum(trial*polar_unit)/3.0_wp - law%cone%a*law%cone%cohesion) &
      /(law%modulus_of(1) + bulk*law%cone%b*law%cone%b_flow &
         + law%cone%a*law%cone%a_flow*law%cone%hardening)
    trial = trial - sum(trial*polar_unit)/3.0_wp*polar_unit
    trial = trial*(1.0_wp - law%modulus_of(1)*step/q)
    call test%check_close('closed form: couple stress', max_abs(stress(10:) - trial(10:)) &
                          /max_abs(trial(10:)), 0.0_wp, 1.0e-12_wp)
    call test%check_close('closed form: hardening', state(common_size + 1) &
                          /(law%cone%a_flow*step), 1.0_wp, 1.0e-12_wp)
  end subroutine check_returns

  !> Symmetric states without couple stress are those of the classical law, in 18 components and
  !! in six.
  subroutine check_classical()
    type(fem_law_polar_drucker_type) :: law
    type(fem_law_drucker_type) :: plain
    real(wp) :: wide(polar_size), state(polar_states), strain(polar_size), other(polar_states)
    real(wp) :: tangent(polar_size, polar_size), short(6), six(6), part(6), d(6, 6), unused(6, 6)
    real(wp) :: memory(common_size + 1)
    character(len=:), allocatable :: fault, cure
    logical :: good
    integer(i4) :: k
    law = polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp, static)
    plain%bulk = law%modulus_of(3)/3.0_wp
    plain%shear = 0.5_wp*law%modulus_of(1)
    plain%cone = law%cone
    plain%cone%residual = 0.0_wp
    call begin(law, wide, state)
    other = state
    short = press
    six = press
    call plain%begin(press, memory, fault, cure)
    do k = 1, 5
      strain = random_strain(2.0e-3_wp)
      strain(10:) = 0.0_wp
      strain([4, 8, 3]) = strain([2, 6, 7])
      part = strain(symmetric_of)
      part(4:) = 2.0_wp*part(4:)
      call law%polar_update(strain, wide, state, tangent, good)
      call integrate(plain, part, short, memory, d, good)
      call integrate(law, part, six, other, unused, good)
    end do
    call test%check_close('classical: stress', max_abs(wide(symmetric_of) - short) &
                          /max_abs(short), 0.0_wp, 1.0e-12_wp)
    call test%check_close('classical: hardening', state(common_size + 1)/memory(common_size + 1), &
                          1.0_wp, 1.0e-12_wp)
    call test%check_close('classical: plastic strain', max_abs(state(at_plastic:at_plastic + 5) &
      - memory(at_plastic:at_plastic + 5))/max_abs(memory(at_plastic:at_plastic + 5)), &
      0.0_wp, 1.0e-12_wp)
    call test%check_close('classical: dissipation', state(at_dissipated)/memory(at_dissipated), &
                          1.0_wp, 1.0e-12_wp)
    call test%check_close('six components: stress', max_abs(six - short)/max_abs(short), &
                          0.0_wp, 1.0e-12_wp)
    call test%check_close('six components: ledger', max_abs(other(at_stored:at_numerical) &
      - memory(at_stored:at_numerical))/memory(at_dissipated), 0.0_wp, 1.0e-12_wp)
    call test%check_close('six components: tangent', max_abs(unused - d)/max_abs(d), &
                          0.0_wp, 1.0e-12_wp)
  end subroutine check_classical

  !> A random path: dissipation never decreases, works add up.
  subroutine check_walk(name, law)
    character(len=*), intent(in) :: name
    type(fem_law_polar_drucker_type), intent(in) :: law
    real(wp), dimension(polar_size) :: stress, before, strain, whole
    real(wp) :: state(polar_states), tangent(polar_size, polar_size), lost, least, work
    logical :: good, all_good
    integer(i4) :: k
    call begin(law, stress, state)
    whole = 0.0_wp
    lost = 0.0_wp
    least = 0.0_wp
    work = 0.0_wp
    all_good = .true.
    do k = 1, 2000
      strain = random_strain(1.0e-3_wp) - 0.01_wp*whole
      whole = whole + strain
      before = stress
      call law%polar_update(strain, stress, state, tangent, good)
      all_good = all_good .and. good
      least = min(least, state(at_dissipated) - lost)
      lost = state(at_dissipated)
      work = work + 0.5_wp*sum((before + stress)*strain)
    end do
    call test%check(name//': walk converges', all_good)
    call test%check(name//': dissipation grows', least >= 0.0_wp .and. lost > 0.0_wp)
    call test%check_close(name//': works add up', sum(state(at_stored:at_numerical))/work, 1.0_wp, &
                          1.0e-10_wp)
  end subroutine check_walk

  subroutine check_start()
    type(fem_law_polar_drucker_type) :: law
    real(wp) :: state(polar_states)
    character(len=:), allocatable :: fault, cure
    law = polar_law(35.0_wp, 10.0_wp, 2.0e4_wp, 0.0_wp, borst)
    call law%begin([-1.0e6_wp, -1.0e4_wp, -1.0e4_wp, 0.0_wp, 0.0_wp, 0.0_wp], state, fault, cure)
    call test%check('start: outside the cone', index(fault, 'outside the yield surface') > 0)
  end subroutine check_start
end program test_fem_law_polar_drucker
