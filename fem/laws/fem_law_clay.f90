!> Modified Cam-clay (Roscoe and Burland 1968; theory-fem, Laws with a state):
!! f = q^2/M^2 + p (p - pc), associated
!! flow; p = p_n exp(v de/kappa) for the elastic compression e, pc = pc_n exp(v dy/(lambda - kappa))
!! for the plastic one y, p positive in compression; constant Poisson's ratio, the shear modulus of
!! an increment is its mean over the elastic path. Backward Euler: two equations, for y and the
!! multiplier, by Newton.
module fem_law_clay
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_constants, only: shear_ratio, given_or
  use fem_law, only: fem_law_type, common_size, at_flag, at_iterations, at_plastic, flag_elastic, &
    flag_yielding
  use fem_voigt, only: unit, twice, project, isotropic, trace, magnitude, outer
  implicit none
  private
  public :: fem_law_clay_type

  integer(i4), parameter :: at_preconsolidation = common_size + 1
  integer(i4), parameter :: most_iterations = 30
  real(wp), parameter :: converged = 1.0e-14_wp  !! of the relative residuals
  real(wp), parameter :: settled = 1.0e-10_wp    !! the same where rounding stops the iteration
  real(wp), parameter :: outside = 1.0e-9_wp     !! of pc^2, that an initial stress may exceed f = 0
  real(wp), parameter :: least_share = 1.0e-2_wp !! of pc, pressure that grains must have
  real(wp), parameter :: far = 10.0_wp           !! change of log p in an increment that is cut
  real(wp), parameter :: most_pressure = 1.0e40_wp  !! that no part of an increment starts from [Pa]

  type, extends(fem_law_type) :: fem_law_clay_type
    real(wp) :: slope = 1.0_wp             !! M of the critical state line [-]
    real(wp) :: swelling = 0.0_wp          !! kappa/v [-]
    real(wp) :: plastic = 0.0_wp           !! (lambda - kappa)/v [-]
    real(wp) :: ratio = 0.0_wp             !! shear over bulk modulus [-]
    real(wp) :: preconsolidation = 0.0_wp  !! pc at the start [Pa], 0: by the ratio
    real(wp) :: overconsolidation = 1.0_wp !! pc at the start over that of the initial stress [-]
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: begin
    procedure :: take_over
    procedure :: update
    procedure :: modulus
    procedure, private :: solve
    procedure, private :: look
    procedure, private :: finish
  end type fem_law_clay_type

  !> What an increment starts with, and the state of its iteration; pressures positive in
  !! compression.
  type :: path_type
    real(wp) :: p0, pc0, v              !! before [Pa]; compression of the increment [-]
    real(wp) :: s0(6), e(6)             !! deviators of stress before and of the strain increment
    real(wp) :: y = 0.0_wp, m = 0.0_wp  !! plastic compression; multiplier [1/Pa]
    real(wp) :: p, pc, g, dg, a(6), d, q2  !! dg: of g by the elastic compression; s = a/d
    real(wp) :: r(2), j(2, 2)           !! residuals, relative, and their slopes by y and m pc0
  end type path_type

contains

  subroutine define(self)
    class(fem_law_clay_type), intent(inout) :: self
    self%name = 'cam_clay'
    self%symmetric = .false.
    call self%add_states(['preconsolidation [Pa]'])
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_clay_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: lambda, kappa, volume, poisson

    call deck%get('material', m, 'critical_slope', self%slope)
    call deck%get('material', m, 'compression_index', lambda)
    call deck%get('material', m, 'swelling_index', kappa)
    call deck%get('material', m, 'specific_volume', volume)
    call deck%get('material', m, 'poisson', poisson)
    self%overconsolidation = given_or(deck, m, 'overconsolidation', self%overconsolidation)
    self%preconsolidation = given_or(deck, m, 'preconsolidation', self%preconsolidation)
    if (.not. lambda > kappa) call deck%fault(errors, 'D331', 'compression_index = '// &
      str(lambda)//' is not above swelling_index = '//str(kappa), 'material', m, &
      'compression_index', 'the virgin line is steeper than the swelling lines')
    self%swelling = kappa/volume
    self%plastic = (lambda - kappa)/volume
    self%ratio = shear_ratio(poisson)
  end subroutine read_constants

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_clay_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp) :: p, q2, pc
    state = 0.0_wp
    cure = ''
    fault = ''
    p = -trace(stress)/3.0_wp
    if (.not. p > 0.0_wp) then
      fault = 'Cam-clay needs a compressive mean stress, not p = '//str(p)//' Pa'
      cure = 'give the part an &initial_stress or a &geostatic stress'
      return
    end if
    q2 = 1.5_wp*magnitude(stress + p*unit)**2
    pc = self%preconsolidation
    if (.not. pc > 0.0_wp) pc = self%overconsolidation*needed(self, stress)
    state(at_preconsolidation) = pc
    if (q2/self%slope**2 + p*(p - pc) <= outside*pc**2) return
    fault = 'the initial stress is outside the yield surface: it needs pc = '// &
            str(needed(self, stress))//' Pa at p = '//str(p)//' Pa, q = '//str(sqrt(q2))// &
            ' Pa, and preconsolidation is '//str(pc)//' Pa'
    cure = 'raise preconsolidation, or give overconsolidation in its place'
  end subroutine begin

  !> Preconsolidation whose yield surface goes through a stress [Pa].
  pure real(wp) function needed(self, stress)
    class(fem_law_clay_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: p
    p = -trace(stress)/3.0_wp
    needed = p + 1.5_wp*magnitude(stress + p*unit)**2/(self%slope**2*p)
  end function needed

  !> The deviator goes back to the critical state line, the preconsolidation grows to the stress.
  !! eq. F.76
  subroutine take_over(self, density, stress, state, fault, cure)
    class(fem_law_clay_type), intent(in) :: self
    real(wp), intent(in) :: density
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    type(fem_law_clay_type) :: own
    real(wp) :: p, q, s(6)
    p = -trace(stress)/3.0_wp
    s = stress + p*unit
    q = sqrt(1.5_wp)*magnitude(s)
    p = max(p, least_share*state(at_preconsolidation))
    if (q > self%slope*p) s = s*self%slope*p/q
    stress = s - p*unit
    own = self
    if (own%preconsolidation > 0.0_wp) &
      own%preconsolidation = max(own%preconsolidation, needed(self, stress))
    call own%begin(stress, state, fault, cure)
  end subroutine take_over

  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_clay_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    type(path_type) :: path
    logical :: yields
    integer(i4) :: iterations

    path%p0 = -trace(stress)/3.0_wp
    path%pc0 = state(at_preconsolidation)
    path%v = -trace(strain)
    path%s0 = stress + path%p0*unit
    path%e = matmul(project, strain)
    iterations = 0
    good = abs(path%v) < far*self%swelling .and. path%p0 < most_pressure
    if (.not. good) return
    call self%look(path)
    yields = path%r(2) > 0.0_wp .or. (.not. any(abs(strain) > 0.0_wp) .and. &
                                      state(at_flag) > flag_elastic)
    if (yields) call self%solve(path, iterations, good)
    if (.not. good) return
    call self%finish(path, yields, stress, tangent)
    state(at_flag) = merge(flag_yielding, flag_elastic, yields)
    state(at_iterations) = iterations
    state(at_preconsolidation) = path%pc
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) - path%y/3.0_wp*unit &
      + 3.0_wp*path%m/self%slope**2*twice*path%a/path%d
  end subroutine update

  !> Newton for y and m; steps are limited so that pressures stay within a factor e^2.
  pure subroutine solve(self, path, iterations, good)
    class(fem_law_clay_type), intent(in) :: self
    type(path_type), intent(inout) :: path
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp) :: det, step(2), share, before

    before = huge(1.0_wp)
    do iterations = 1, most_iterations
      good = maxval(abs(path%r)) <= converged .or. &
             (maxval(abs(path%r)) <= settled .and. maxval(abs(path%r)) >= before)
      if (good .and. iterations > 1) exit
      before = maxval(abs(path%r))
      det = path%j(1, 1)*path%j(2, 2) - path%j(1, 2)*path%j(2, 1)
      good = abs(det) > 0.0_wp
      if (.not. good) return
      step = [path%j(2, 2)*path%r(1) - path%j(1, 2)*path%r(2), &
              path%j(1, 1)*path%r(2) - path%j(2, 1)*path%r(1)]/det
      share = min(1.0_wp, 2.0_wp*min(self%swelling, self%plastic)/max(abs(step(1)), tiny(1.0_wp)))
      path%y = path%y - share*step(1)
      path%m = path%m - share*step(2)/path%pc0
      call self%look(path)
    end do
    good = good .and. path%m*path%pc0 >= -settled .and. path%p > 0.0_wp
  end subroutine solve

  !> State for y and m, residuals y - m (2 p - pc) and f/pc0^2, and their slopes.
  pure subroutine look(self, path)
    class(fem_law_clay_type), intent(in) :: self
    type(path_type), intent(inout) :: path
    real(wp) :: x, dp, dpc, square, by_g, m2

    m2 = self%slope**2
    x = (path%v - path%y)/self%swelling
    path%p = path%p0*exp(x)
    path%pc = path%pc0*exp(path%y/self%plastic)
    path%g = self%ratio*path%p0/self%swelling*mean_growth(x)
    path%dg = self%ratio*path%p0/self%swelling**2*mean_slope(x)
    path%a = path%s0 + 2.0_wp*path%g*path%e
    path%d = 1.0_wp + 6.0_wp*path%g*path%m/m2
    square = magnitude(path%a)**2
    path%q2 = 1.5_wp*square/path%d**2
    dp = -path%p/self%swelling   ! by y
    dpc = path%pc/self%plastic
    ! q^2 by g at given m
    by_g = 6.0_wp*sum(twice*path%a*path%e)/path%d**2 - 18.0_wp*square*path%m/(m2*path%d**3)
    path%r(1) = path%y - path%m*(2.0_wp*path%p - path%pc)
    path%r(2) = (path%q2/m2 + path%p*(path%p - path%pc))/path%pc0**2
    path%j(1, 1) = 1.0_wp - path%m*(2.0_wp*dp - dpc)
    path%j(1, 2) = -(2.0_wp*path%p - path%pc)/path%pc0
    path%j(2, 1) = (-by_g*path%dg/m2 + (2.0_wp*path%p - path%pc)*dp - path%p*dpc)/path%pc0**2
    path%j(2, 2) = -18.0_wp*square*path%g/(m2**2*path%d**3)/path%pc0**3
  end subroutine look

  !> (exp(x) - 1)/x
  pure real(wp) function mean_growth(x)
    real(wp), intent(in) :: x
    real(wp), parameter :: near = 1.0e-2_wp
    if (abs(x) > near) then
      mean_growth = (exp(x) - 1.0_wp)/x
    else
      mean_growth = 1.0_wp + x/2.0_wp*(1.0_wp + x/3.0_wp*(1.0_wp + x/4.0_wp*(1.0_wp + x/5.0_wp* &
        (1.0_wp + x/6.0_wp))))
    end if
  end function mean_growth

  !> Its slope.
  pure real(wp) function mean_slope(x)
    real(wp), intent(in) :: x
    real(wp), parameter :: near = 1.0e-2_wp
    if (abs(x) > near) then
      mean_slope = ((x - 1.0_wp)*exp(x) + 1.0_wp)/x**2
    else
      mean_slope = 0.5_wp + x/3.0_wp + x**2/8.0_wp + x**3/30.0_wp + x**4/144.0_wp + x**5/840.0_wp
    end if
  end function mean_slope

  !> Stress and consistent tangent; with plastic flow y and m follow the strain by the two
  !! equations.
  pure subroutine finish(self, path, yields, stress, tangent)
    class(fem_law_clay_type), intent(in) :: self
    type(path_type), intent(in) :: path
    logical, intent(in) :: yields
    real(wp), intent(out) :: stress(6), tangent(6, 6)
    real(wp) :: by_v(2), by_e(6), z(2, 6), right(2), det, m2, by_g, dg, ds(6), de(6)
    integer(i4) :: j

    m2 = self%slope**2
    stress = path%a/path%d - path%p*unit
    z = 0.0_wp  ! slopes of y and m pc0 by the strain
    if (yields) then
      det = path%j(1, 1)*path%j(2, 2) - path%j(1, 2)*path%j(2, 1)
      by_g = 6.0_wp*sum(twice*path%a*path%e)/path%d**2 &
        - 18.0_wp*magnitude(path%a)**2*path%m/(m2*path%d**3)
      by_v(1) = -2.0_wp*path%m*path%p/self%swelling
      by_v(2) = (by_g*path%dg/m2 + (2.0_wp*path%p - path%pc)*path%p/self%swelling)/path%pc0**2
      by_e = 6.0_wp*path%g/(path%d**2*m2*path%pc0**2)*twice*path%a
    end if
    do j = 1, 6
      de = project(:, j)
      if (yields) then
        right = -by_v*unit(j)
        right(2) = right(2) + sum(by_e*de)
        z(:, j) = -[path%j(2, 2)*right(1) - path%j(1, 2)*right(2), &
                    path%j(1, 1)*right(2) - path%j(2, 1)*right(1)]/det
      end if
      dg = path%dg*(-unit(j) - z(1, j))
      ds = (2.0_wp*path%g*de + 2.0_wp*dg*path%e)/path%d &
        - path%a/path%d**2*6.0_wp/m2*(path%m*dg + path%g*z(2, j)/path%pc0)
      tangent(:, j) = ds + path%p/self%swelling*(unit(j) + z(1, j))*unit
    end do
  end subroutine finish

  pure function modulus(self, stress) result(moduli)
    class(fem_law_clay_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = max(-trace(stress)/3.0_wp, 0.0_wp)/self%swelling*[1.0_wp, self%ratio]
  end function modulus
end module fem_law_clay
