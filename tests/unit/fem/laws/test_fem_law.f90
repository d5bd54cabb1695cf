!> Laws with a state: tangents against differences, closed forms of the return to cone and apex,
!! dissipation that is never negative, increments in parts, starts that are refused.
program test_fem_law
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: larger, max_abs, test_type
  use fem_law, only: fem_law_type, integrate, at_flag, at_stored, at_dissipated, at_numerical, &
    at_plastic, common_size, flag_yielding, flag_apex
  use fem_law_clay, only: fem_law_clay_type
  use fem_cone, only: cone_constants
  use fem_law_drucker, only: fem_law_drucker_type
  use fem_law_finite, only: fem_law_finite_type
  use fem_law_kirchhoff, only: fem_law_kirchhoff_type
  use fem_law_linear, only: fem_law_linear_type
  use fem_law_neo_hookean, only: fem_law_neo_hookean_type
  use fem_law_pressure, only: fem_law_pressure_type
  use fem_voigt, only: unit, trace, magnitude, deviator
  implicit none
  type(test_type) :: test
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: shape_of(6) = [0.3_wp, -0.5_wp, -1.0_wp, 0.4_wp, -0.7_wp, 0.2_wp]
  real(wp), parameter :: tangent_limit = 1.0e-7_wp  !! relative, of central differences
  real(wp), parameter :: press(6) = -1.0e5_wp*unit
  integer(i4) :: seed = 1
  type(fem_law_linear_type) :: linear
  type(fem_law_drucker_type) :: drucker, soft
  type(fem_law_pressure_type) :: pressure
  type(fem_law_clay_type) :: clay, stiff
  type(fem_law_kirchhoff_type) :: kirchhoff
  type(fem_law_neo_hookean_type) :: neo_hookean

  linear%bulk = 5.0e7_wp
  linear%shear = 3.0e7_wp
  drucker = drucker_law(35.0_wp, 10.0_wp, 2.0e4_wp, 5.0e5_wp)
  soft = drucker_law(30.0_wp, 0.0_wp, 2.0e4_wp, -2.0e6_wp)
  soft%cone%residual = 1.9e4_wp
  pressure%bulk = 5.0e7_wp
  pressure%ratio = 0.6_wp
  pressure%exponent = 0.5_wp
  pressure%reference = 1.0e5_wp
  pressure%least = 1.0e3_wp
  clay%slope = 1.2_wp
  clay%swelling = 0.05_wp/1.9_wp
  clay%plastic = 0.15_wp/1.9_wp
  clay%ratio = 0.46_wp
  call clay%define()
  call set_finite(kirchhoff)
  call set_finite(neo_hookean)
  stiff = clay
  stiff%overconsolidation = 5.0_wp

  call check_tangent('linear', linear, press, 1.0e-3_wp)
  call check_tangent('cone', drucker, press, 1.0e-2_wp, flag_yielding, 0.4_wp)
  call check_tangent('apex', drucker, 0.0_wp*unit, 1.0e-2_wp, flag_apex, 1.0_wp)
  call check_tangent('softening', soft, press, 3.0e-3_wp, flag_yielding, 0.4_wp)
  call check_tangent('residual', soft, press, 2.0e-2_wp, flag_yielding, 0.4_wp)
  call check_tangent('pressure', pressure, press, 1.0e-3_wp)
  call check_tangent('pressure, loose', pressure, -2.0e3_wp*unit, 1.0e-4_wp, more=1.0_wp)
  call check_tangent('pressure, n = 1', steep_law(1.0_wp), press, 1.0e-3_wp)
  call check_tangent('pressure, small step', pressure, press, 1.0e-9_wp)
  call check_tangent('clay, wet', clay, press, 1.0e-2_wp, flag_yielding)
  call check_tangent('clay, elastic', stiff, press, 1.0e-3_wp)
  call check_tangent('clay, dry', stiff, press, 4.0e-2_wp, flag_yielding)
  call check_tangent('St. Venant and Kirchhoff', kirchhoff, 0.0_wp*unit, 0.2_wp)
  call check_tangent('neo-Hookean', neo_hookean, 0.0_wp*unit, 0.2_wp)
  call check_tangent('neo-Hookean, stretched', neo_hookean, 0.0_wp*unit, 0.3_wp, &
                     more=4.0_wp)
  call check_finite()
  call check_rate()
  call check_returns()
  call check_walk('cone', drucker, 3.0e-3_wp)
  call check_walk('softening', soft, 3.0e-3_wp)
  call check_walk('clay', clay, 1.0e-3_wp)
  call check_walk('clay, overconsolidated', stiff, 3.0e-3_wp)
  call check_parts()
  call check_starts()
  call test%finish()

contains

  function drucker_law(friction, dilation, cohesion, hardening) result(law)
    real(wp), intent(in) :: friction, dilation, cohesion, hardening
    type(fem_law_drucker_type) :: law
    law%bulk = 6.0e7_wp
    law%shear = 4.0e7_wp
    law%cone%cohesion = cohesion
    law%cone%hardening = hardening
    call law%define()
    call cone_constants(friction*degree, dilation*degree, -1, law%cone%a, law%cone%b)
    call cone_constants(dilation*degree, dilation*degree, -1, law%cone%a_flow, law%cone%b_flow)
  end function drucker_law

  subroutine set_finite(law)
    class(fem_law_finite_type), intent(inout) :: law
    call law%define()
    law%lambda = 5.0e7_wp
    law%mu = 3.0e7_wp
  end subroutine set_finite

  !> Neo-Hookean uniaxial strain by hand; a path that closes stores nothing; a strain that no motion
  !! has is refused and changes nothing.
  subroutine check_finite()
    type(fem_law_neo_hookean_type) :: law
    real(wp) :: stress(6), tangent(6, 6), green, stretch, wanted
    real(wp), allocatable :: state(:), before(:)
    character(len=:), allocatable :: fault, cure
    logical :: good
    law = neo_hookean
    allocate (state(law%states))
    stress = 0.0_wp
    call law%begin(stress, state, fault, cure)
    stretch = 1.4_wp
    green = 0.5_wp*(stretch**2 - 1.0_wp)
    call integrate(law, [0.0_wp, green, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], stress, state, tangent, &
                   good)
    wanted = law%mu*(1.0_wp - stretch**(-2)) + law%lambda*log(stretch)/stretch**2
    call test%check_close('neo-Hookean: S', stress(2)/wanted, 1.0_wp, 1.0e-14_wp)
    wanted = 0.5_wp*law%mu*(stretch**2 - 1.0_wp) - law%mu*log(stretch) &
             + 0.5_wp*law%lambda*log(stretch)**2
    call test%check_close('neo-Hookean: energy', state(at_stored)/wanted, 1.0_wp, 1.0e-14_wp)
    before = state
    call integrate(law, [-1.0_wp - green, -1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], stress, state, &
                   tangent, good)
    call test%check('neo-Hookean: no motion has this strain', .not. good)
    call test%check('neo-Hookean: nothing changes', all(abs(state - before) <= 0.0_wp))
    call integrate(law, [0.1_wp, -green, 0.0_wp, 0.3_wp, 0.0_wp, 0.0_wp], stress, state, tangent, &
                   good)
    call integrate(law, [-0.1_wp, 0.0_wp, 0.0_wp, -0.3_wp, 0.0_wp, 0.0_wp], stress, state, &
                   tangent, good)
    call test%check_close('neo-Hookean: a closed path', state(at_stored)/law%mu, 0.0_wp, &
                          1.0e-15_wp)
    call test%check_close('neo-Hookean: stress of a closed path', max_abs(stress)/law%mu, &
                          0.0_wp, 1.0e-15_wp)
    call law%begin(press, state, fault, cure)
    call test%check('neo-Hookean: starts without stress', len(fault) > 0)
  end subroutine check_finite

  function steep_law(exponent) result(law)
    real(wp), intent(in) :: exponent
    type(fem_law_pressure_type) :: law
    law = pressure
    law%exponent = exponent
  end function steep_law

  !> Consistent tangent of an increment against central differences.
  subroutine check_tangent(name, law, stress, size_of, flag, more)
    character(len=*), intent(in) :: name
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: stress(6), size_of
    real(wp), intent(in), optional :: flag  !! where the point must be afterwards
    real(wp), intent(in), optional :: more  !! expansion added to the strain
    real(wp) :: strain(6), moved(6), high(6), low(6), end_stress(6), step
    real(wp) :: tangent(6, 6), unused(6, 6), differences(6, 6)
    real(wp), allocatable :: start(:), state(:)
    character(len=:), allocatable :: fault, cure
    logical :: good
    integer(i4) :: j

    allocate (start(law%states))
    call law%begin(stress, start, fault, cure)
    call test%check_text(name//': begins', fault, '')
    strain = size_of*shape_of
    if (present(more)) strain = strain + size_of*more*unit
    end_stress = stress
    state = start
    call integrate(law, strain, end_stress, state, tangent, good)
    call test%check(name//': converges', good)
    if (present(flag)) call test%check_close(name//': flag', state(at_flag), flag, 0.0_wp)
    step = 1.0e-5_wp*size_of
    do j = 1, 6
      moved = strain
      moved(j) = strain(j) + step
      high = stress
      state = start
      call integrate(law, moved, high, state, unused, good)
      moved(j) = strain(j) - step
      low = stress
      state = start
      call integrate(law, moved, low, state, unused, good)
      differences(:, j) = (high - low)/(2.0_wp*step)
    end do
    ! differences of stresses lose what round-off of the stress makes of the step
    call test%check_close(name//': tangent', max_abs(tangent - differences) &
      /larger(max_abs(tangent), max_abs(law%modulus(stress))), 0.0_wp, tangent_limit &
      + 4.0_wp*epsilon(1.0_wp)*max_abs(end_stress)/(step*max_abs(law%modulus(stress))))
  end subroutine check_tangent

  !> A point that yielded treats a zero increment as the limit of a small one, and does not move.
  subroutine check_rate()
    real(wp) :: stress(6), zero(6), tangent(6, 6), small(6, 6)
    real(wp), allocatable :: state(:), there(:)
    character(len=:), allocatable :: fault, cure
    logical :: good
    integer(i4) :: k
    do k = 1, 2
      stress = press
      if (k == 1) call run_one(drucker, stress, state)
      if (k == 2) call run_one(clay, stress, state)
      there = state
      zero = stress
      if (k == 1) call integrate(drucker, 0.0_wp*unit, zero, there, tangent, good)
      if (k == 2) call integrate(clay, 0.0_wp*unit, zero, there, tangent, good)
      call test%check('rate: converges', good)
      call test%check_all_close('rate: stress stays', zero, stress, 1.0e-4_wp)
      call test%check_close('rate: flag stays', there(at_flag), flag_yielding, 0.0_wp)
      there = state
      zero = stress
      if (k == 1) call integrate(drucker, 1.0e-9_wp*(shape_of + 0.4_wp*unit), zero, there, small, &
                                 good)
      if (k == 2) call integrate(clay, 1.0e-9_wp*shape_of, zero, there, small, good)
      call test%check_close('rate: limit of small steps', max_abs(tangent - small) &
                            /max_abs(small), 0.0_wp, 1.0e-5_wp)
    end do
    call drucker%begin(press, state, fault, cure)
  end subroutine check_rate

  subroutine run_one(law, stress, state)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(inout) :: stress(6)
    real(wp), allocatable, intent(out) :: state(:)
    real(wp) :: tangent(6, 6)
    character(len=:), allocatable :: fault, cure
    logical :: good
    allocate (state(law%states))
    call law%begin(stress, state, fault, cure)
    call integrate(law, 1.0e-2_wp*(shape_of + 0.4_wp*unit), stress, state, tangent, good)
  end subroutine run_one

  !> Cone: direction of the trial deviator, closed multiplier. Apex: p = A c/B, closed dilation.
  subroutine check_returns()
    real(wp) :: trial(6), stress(6), strain(6), state(common_size + 1), tangent(6, 6), step, p, c
    character(len=:), allocatable :: fault, cure
    logical :: good

    associate (law => drucker, cone => drucker%cone)
      strain = 1.0e-2_wp*(shape_of + 0.4_wp*unit)
      trial = press + 2.0_wp*law%shear*(strain - trace(strain)/3.0_wp*unit) &
        + law%bulk*trace(strain)*unit
      trial(4:6) = law%shear*strain(4:6)
      stress = press
      call law%begin(stress, state, fault, cure)
      call integrate(law, strain, stress, state, tangent, good)
      step = (magnitude(deviator(trial)) + cone%b*trace(trial)/3.0_wp - cone%a*cone%cohesion) &
        /(2.0_wp*law%shear + law%bulk*cone%b*cone%b_flow + cone%a*cone%a_flow*cone%hardening)
      call test%check_close('cone: stress', max_abs(stress - (deviator(trial) &
        *(1.0_wp - 2.0_wp*law%shear*step/magnitude(deviator(trial))) + (trace(trial)/3.0_wp &
        - law%bulk*cone%b_flow*step)*unit))/1.0e5_wp, 0.0_wp, 1.0e-8_wp)
      call test%check_close('cone: hardening', state(common_size + 1), cone%a_flow*step, 1.0e-14_wp)
      call test%check_close('cone: plastic volume', trace(state(at_plastic:at_plastic + 5)), &
                            cone%b_flow*step, 1.0e-14_wp)
      call test%check_close('cone: f', magnitude(deviator(stress)) + cone%b*trace(stress)/3.0_wp &
        - cone%a*(cone%cohesion + cone%hardening*cone%a_flow*step), 0.0_wp, 1.0e-8_wp*1.0e5_wp)
      strain = 1.0e-2_wp*unit + 1.0e-4_wp*shape_of
      stress = 0.0_wp
      call law%begin(stress, state, fault, cure)
      call integrate(law, strain, stress, state, tangent, good)
      p = law%bulk*trace(strain)
      step = (p - cone%a/cone%b*cone%cohesion) &
        /(law%bulk + cone%a/cone%b*cone%a_flow/cone%b_flow*cone%hardening)
      c = cone%cohesion + cone%hardening*cone%a_flow/cone%b_flow*step
      call test%check_close('apex: stress', max_abs(stress - cone%a/cone%b*c*unit)/1.0e5_wp, &
                            0.0_wp, 1.0e-8_wp)
      call test%check_close('apex: elastic volume', trace(strain) - step, trace(stress) &
                            /(3.0_wp*law%bulk), 1.0e-14_wp)
    end associate
  end subroutine check_returns

  !> A random path of strain about its start: dissipation never decreases, works add up.
  subroutine check_walk(name, law, size_of)
    character(len=*), intent(in) :: name
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: size_of  !! largest strain of an increment
    real(wp) :: stress(6), before(6), strain(6), tangent(6, 6), lost, least, work, total, whole(6)
    real(wp) :: state(law%states)
    character(len=:), allocatable :: fault, cure
    logical :: good, all_good
    integer(i4) :: k, j
    stress = press
    call law%begin(stress, state, fault, cure)
    whole = 0.0_wp
    lost = 0.0_wp
    least = 0.0_wp
    work = 0.0_wp
    all_good = .true.
    do k = 1, 2000
      do j = 1, 6
        strain(j) = size_of*next() - 0.01_wp*whole(j)
      end do
      whole = whole + strain
      before = stress
      call integrate(law, strain, stress, state, tangent, good)
      all_good = all_good .and. good
      least = min(least, state(at_dissipated) - lost)
      lost = state(at_dissipated)
      work = work + 0.5_wp*sum((before + stress)*strain)
    end do
    total = sum(state(at_stored:at_numerical))
    call test%check(name//': walk converges', all_good)
    call test%check(name//': dissipation grows', least >= 0.0_wp .and. lost > 0.0_wp)
    call test%check_close(name//': works add up', total/lost, work/lost, 1.0e-10_wp)
  end subroutine check_walk

  !> Uniform numbers in -1 .. 1, always the same.
  real(wp) function next()
    seed = int(mod(16807_i8*seed, int(huge(seed), i8)), i4)
    next = 2.0_wp*real(seed, wp)/real(huge(seed), wp) - 1.0_wp
  end function next

  !> An increment too large for the local Newton is subdivided; its tangent is that of the parts.
  subroutine check_parts()
    real(wp) :: stress(6), state(common_size + 1), tangent(6, 6), strain(6), trapezoid
    character(len=:), allocatable :: fault, cure
    logical :: good
    strain = -0.2_wp*unit + 0.05_wp*shape_of  ! more than ten swelling indices of volume
    stress = press
    call clay%begin(stress, state, fault, cure)
    call integrate(clay, strain, stress, state, tangent, good)
    call test%check('parts: converges', good)
    trapezoid = 0.5_wp*sum((press + stress)*strain)
    call test%check_close('parts: works add up', sum(state(at_stored:at_numerical))/trapezoid, &
                          1.0_wp, 1.0e-12_wp)
    call test%check('parts: dissipation', state(at_dissipated) > 0.0_wp)
    strain = -10.0_wp*unit  ! no number of parts helps
    stress = press
    call clay%begin(stress, state, fault, cure)
    call integrate(clay, strain, stress, state, tangent, good)
    call test%check('parts: refused', .not. good .and. max_abs(stress - press) <= 0.0_wp)
  end subroutine check_parts

  subroutine check_starts()
    real(wp) :: state(common_size + 1)
    character(len=:), allocatable :: fault, cure
    call drucker%begin([-1.0e6_wp, -1.0e4_wp, -1.0e4_wp, 0.0_wp, 0.0_wp, 0.0_wp], state, fault, &
                       cure)
    call test%check('start: outside the cone', index(fault, 'outside the yield surface') > 0)
    call clay%begin(0.0_wp*unit, state, fault, cure)
    call test%check('start: clay without pressure', index(fault, 'compressive mean stress') > 0)
    stiff%preconsolidation = 5.0e4_wp
    call stiff%begin(press, state, fault, cure)
    call test%check('start: above preconsolidation', index(fault, 'needs pc = 100000') > 0)
  end subroutine check_starts
end program test_fem_law
