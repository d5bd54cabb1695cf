!> Micropolar elasticity that grows with the pressure: stress as the slope of the stored energy,
!! tangents against differences, isotropic compression in closed form, circuits that return all
!! work, Eringen's solid without an exponent, moduli that bound the tangent.
program test_fem_law_polar_pressure
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use fem_law, only: at_stored, at_numerical, common_size
  use fem_law_polar_pressure, only: fem_law_polar_pressure_type, at_factor
  use fem_micropolar, only: micropolar_stress
  use fem_polar, only: polar_size, families, eringen_families, family_matrix, polar_unit, full_of
  implicit none
  type(test_type) :: test
  real(wp), parameter :: moduli(6) = [3.0e7_wp, 2.5e7_wp, 2.0e7_wp, 1.0e3_wp, 5.0e2_wp, 3.0e3_wp]
  real(wp), parameter :: length = 1.0e-2_wp     !! of the curvature in a strain [m]
  real(wp), parameter :: tangent_limit = 1.0e-7_wp  !! relative, of central differences
  integer(i4), parameter :: states = common_size + 1
  integer(i4) :: seed = 11

  call check_tangents('n = 1/2', sand(0.5_wp))
  call check_tangents('n = 0.9', sand(0.9_wp))
  call check_tangents('a family without stiffness', loose_law())
  call check_compression(0.5_wp)
  call check_compression(0.8_wp)
  call check_linear()
  call check_circuit()
  call check_bound()
  call test%finish()

contains

  function sand(exponent) result(law)
    real(wp), intent(in) :: exponent
    type(fem_law_polar_pressure_type) :: law
    call law%define()
    law%moduli = moduli
    law%modulus_of = eringen_families(moduli)
    law%exponent = exponent
    law%reference = 1.0e5_wp
    law%least = 2.0e3_wp
  end function sand

  !> beta = gamma: the skew part of the curvature has no couple stress.
  function loose_law() result(law)
    type(fem_law_polar_pressure_type) :: law
    law = sand(0.4_wp)
    law%moduli(5) = law%moduli(6)
    law%modulus_of = eringen_families(law%moduli)
  end function loose_law

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
    strain(10:) = strain(10:)/length
  end function random_strain

  subroutine begin(law, pressure, stress, state)
    type(fem_law_polar_pressure_type), intent(in) :: law
    real(wp), intent(in) :: pressure  !! [Pa]
    real(wp), intent(out) :: stress(polar_size), state(states)
    character(len=:), allocatable :: fault, cure
    real(wp) :: six(6)
    six = [-pressure, -pressure, -pressure, 0.0_wp, 0.0_wp, 0.0_wp]
    call law%begin(six, state, fault, cure)
    call test%check_text('begins', fault, '')
    stress = 0.0_wp
    stress(:9) = six(full_of)
  end subroutine begin

  !> Tangent and stress of increments in all directions against central differences, of the stress
  !! and of the stored energy; below the least pressure too.
  subroutine check_tangents(name, law)
    character(len=*), intent(in) :: name
    type(fem_law_polar_pressure_type), intent(in) :: law
    real(wp), parameter :: pressure(4) = [1.0e5_wp, 2.0e4_wp, 1.0e6_wp, 5.0e2_wp]
    real(wp) :: stress(polar_size), start(polar_size), state(states), was(states)
    real(wp) :: strain(polar_size), tangent(polar_size, polar_size), worst(2), found(2), skew, step
    logical :: good
    integer(i4) :: k
    worst = 0.0_wp
    skew = 0.0_wp
    do k = 1, 40
      call begin(law, pressure(1 + mod(k, 4)), start, was)
      ! a step that stays on its side of the least pressure
      step = 0.2_wp*pressure(1 + mod(k, 4))/(was(at_factor)*law%modulus_of(3))
      strain = random_strain(step)
      call law%polar_update(strain, start, was, tangent, good)
      strain = random_strain(step)
      stress = start
      state = was
      call law%polar_update(strain, stress, state, tangent, good)
      call test%check(name//': has a state', good)
      found = differences(law, strain, start, was, tangent, stress, 1.0e-4_wp*step)
      worst = [larger(worst(1), found(1)), larger(worst(2), found(2))]
      skew = larger(skew, max_abs(tangent - transpose(tangent))/max_abs(tangent))
    end do
    call test%check_close(name//': tangent', worst(1), 0.0_wp, tangent_limit)
    call test%check_close(name//': stress is the slope of the energy', worst(2), 0.0_wp, &
                          tangent_limit)
    call test%check_close(name//': the tangent is symmetric', skew, 0.0_wp, 1.0e-15_wp)
  end subroutine check_tangents

  !> Largest differences of a tangent and of a stress from central differences, over the largest
  !! entries, with curvature times `length` as strains and couple stresses over it as stresses.
  function differences(law, strain, start, was, tangent, stress, step) result(worst)
    type(fem_law_polar_pressure_type), intent(in) :: law
    real(wp), intent(in) :: strain(polar_size), start(polar_size), was(states)
    real(wp), intent(in) :: tangent(polar_size, polar_size), stress(polar_size), step
    real(wp) :: worst(2)
    real(wp), dimension(polar_size) :: moved, high, low, scale
    real(wp) :: up(states), down(states), unused(polar_size, polar_size)
    logical :: good
    integer(i4) :: j
    worst = 0.0_wp
    scale(:9) = 1.0_wp
    scale(10:) = length
    do j = 1, polar_size
      moved = strain
      moved(j) = strain(j) + step/scale(j)
      high = start
      up = was
      call law%polar_update(moved, high, up, unused, good)
      moved(j) = strain(j) - step/scale(j)
      low = start
      down = was
      call law%polar_update(moved, low, down, unused, good)
      worst(1) = larger(worst(1), max_abs((tangent(:, j)/scale(j) - (high - low)/(2.0_wp*step)) &
                                      /scale))
      worst(2) = larger(worst(2), abs(stress(j)/scale(j) - (up(at_stored) - down(at_stored)) &
                                   /(2.0_wp*step)))
    end do
    worst = worst/[max_abs(tangent(:9, :9)), max_abs(stress(:9))]
  end function differences

  !> p^(1-n) grows in proportion to the compression, above the least pressure; the factor on the
  !! moduli is (p/p0)^n.
  subroutine check_compression(exponent)
    real(wp), intent(in) :: exponent
    type(fem_law_polar_pressure_type) :: law
    real(wp) :: stress(polar_size), state(states), tangent(polar_size, polar_size), wanted, bulk
    real(wp), parameter :: compression = 1.0e-3_wp
    logical :: good
    law = sand(exponent)
    bulk = law%modulus_of(3)/3.0_wp
    call begin(law, 1.0e4_wp, stress, state)
    call law%polar_update(-compression/3.0_wp*polar_unit, stress, state, tangent, good)
    wanted = 0.1_wp**(1.0_wp - exponent) + (1.0_wp - exponent)*bulk*compression/1.0e5_wp
    wanted = 1.0e5_wp*wanted**(1.0_wp/(1.0_wp - exponent))
    call test%check_close('compression: p', -stress(1)/wanted, 1.0_wp, 1.0e-13_wp)
    call test%check_close('compression: factor', state(at_factor), (wanted/1.0e5_wp)**exponent, &
                          1.0e-13_wp)
    ! the tangent there is that of Eringen's solid with all moduli times the factor
    call test%check_close('compression: moduli of reference and pressure', &
      max_abs(tangent - state(at_factor)*family_matrix(law%modulus_of)) &
      /max_abs(tangent), 0.0_wp, 1.0e-13_wp)
  end subroutine check_compression

  !> n = 0 is Eringen's solid.
  subroutine check_linear()
    type(fem_law_polar_pressure_type) :: law
    real(wp) :: stress(polar_size), state(states), strain(polar_size), wanted(polar_size)
    real(wp) :: tangent(polar_size, polar_size)
    logical :: good
    law = sand(0.0_wp)
    call begin(law, 0.0_wp, stress, state)
    strain = random_strain(1.0e-3_wp)
    call law%polar_update(strain, stress, state, tangent, good)
    call micropolar_stress(moduli, strain(:9), reshape(strain(10:), [3, 3]), wanted(:9), &
                           wanted(10:))
    call test%check_close('linear: stress', max_abs(stress(:9) - wanted(:9)) &
                          /max_abs(wanted(:9)), 0.0_wp, 1.0e-14_wp)
    call test%check_close('linear: couple stress', max_abs(stress(10:) - wanted(10:)) &
                          /max_abs(wanted(10:)), 0.0_wp, 1.0e-14_wp)
    call test%check_close('linear: energy', state(at_stored)/(0.5_wp*sum(stress*strain)), 1.0_wp, &
                          1.0e-13_wp)
  end subroutine check_linear

  !> A path that ends where it began, through tension too: stress and energy are those of the start,
  !! works add up.
  subroutine check_circuit()
    type(fem_law_polar_pressure_type) :: law
    real(wp), dimension(polar_size) :: stress, start, before, strain, whole
    real(wp) :: state(states), tangent(polar_size, polar_size), work, gross
    logical :: good
    integer(i4) :: k
    law = sand(0.5_wp)
    call begin(law, 1.0e5_wp, start, state)
    stress = start
    whole = 0.0_wp
    work = 0.0_wp
    gross = 0.0_wp
    do k = 1, 200
      strain = random_strain(5.0e-4_wp)
      if (k == 200) strain = -whole
      whole = whole + strain
      before = stress
      call law%polar_update(strain, stress, state, tangent, good)
      work = work + 0.5_wp*sum((before + stress)*strain)
      gross = gross + abs(0.5_wp*sum((before + stress)*strain))
    end do
    call test%check_close('circuit: stress', max_abs(stress - start)/max_abs(start), &
                          0.0_wp, 1.0e-11_wp)
    call test%check_close('circuit: stored energy', state(at_stored)/gross, 0.0_wp, 1.0e-12_wp)
    call test%check_close('circuit: works add up', (state(at_stored) + state(at_numerical) - work) &
                          /gross, 0.0_wp, 1.0e-13_wp)
  end subroutine check_circuit

  !> Work of the tangent is nowhere above that of `moduli_at`, and equal in some direction where the
  !! stress is isotropic.
  subroutine check_bound()
    type(fem_law_polar_pressure_type) :: law
    real(wp) :: stress(polar_size), state(states), v(polar_size)
    real(wp) :: tangent(polar_size, polar_size), bound(polar_size, polar_size), most
    logical :: good
    integer(i4) :: k, j
    law = sand(0.7_wp)
    most = 0.0_wp
    do k = 1, 20
      call begin(law, 1.0e5_wp, stress, state)
      call law%polar_update(random_strain(2.0e-3_wp), stress, state, tangent, good)
      bound = family_matrix(eringen_families(law%moduli_at(stress)))
      do j = 1, 200
        v = random_strain(1.0_wp)
        most = larger(most, dot_product(v, matmul(tangent, v))/dot_product(v, matmul(bound, v)))
      end do
      v = matmul(tangent, stress)  ! close to where the part of rank one is largest
      v(10:) = v(10:)/length**2
      most = larger(most, dot_product(v, matmul(tangent, v))/dot_product(v, matmul(bound, v)))
    end do
    call test%check('bound: above the tangent', most <= 1.0_wp)
    call test%check('bound: not far above it', most > 0.5_wp)
    call begin(law, 1.0e5_wp, stress, state)
    call test%check_close('bound: isotropic', max_abs(law%moduli_at(stress)/moduli - 1.0_wp), &
                          0.0_wp, 1.0e-13_wp)
  end subroutine check_bound
end program test_fem_law_polar_pressure
