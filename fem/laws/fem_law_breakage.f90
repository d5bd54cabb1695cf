!> `breakage`: crushing of grains in the continuum (Einav 2007; theory-fem, Laws with a state).
!! Breakage B measures how far the grading has gone from that of the start to the ultimate one; it
!! takes stiffness and, with friction, yields. Backward Euler in volume and shear of the elastic
!! strain and the multiplier, in which B is exact. Pressures are positive in compression.
!! eq. F.44, F.45
module fem_law_breakage
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_cone, only: remnant
  use fem_constants, only: elastic_constants, given_or
  use fem_law, only: fem_law_type, common_size, at_flag, at_iterations, at_plastic, at_stored, &
    at_dissipated, flag_elastic, flag_yielding, flag_apex
  use fem_voigt, only: unit, twice, project, isotropic, trace, magnitude, elastic_matrix, outer
  implicit none
  private
  public :: fem_law_breakage_type, grading_index

  integer(i4), parameter :: at_breakage = common_size + 1
  integer(i4), parameter :: at_energy = common_size + 2
  integer(i4), parameter :: most_iterations = 40
  real(wp), parameter :: converged = 1.0e-13_wp    !! of the residuals, relative
  real(wp), parameter :: settled = 1.0e-10_wp      !! where rounding stops the iteration
  real(wp), parameter :: held = 1.0e-9_wp          !! of the bulk modulus, pressure of an open point
  real(wp), parameter :: least_share = 0.1_wp      !! of the volume that an iteration must leave
  real(wp), parameter :: outside = 1.0e-9_wp       !! of f at the start
  integer(i4), parameter :: halvings = 40          !! of the share of a deviator
  real(wp), parameter :: root_2_3 = sqrt(2.0_wp/3.0_wp)

  type, extends(fem_law_type) :: fem_law_breakage_type
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp  !! of grains that are whole [Pa]
    real(wp) :: slope = 1.0_wp       !! M [-]
    real(wp) :: critical = 1.0_wp    !! E_c [J/m^3]
    real(wp) :: crush = 1.0_wp       !! cos^2 omega
    real(wp) :: index = 0.5_wp       !! theta [-]
    real(wp) :: residual = 0.0_wp    !! p_r [Pa]
    real(wp) :: initial = 0.0_wp     !! B at the start
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: begin
    procedure :: take_over
    procedure :: update
    procedure :: modulus
    procedure, private :: look
    procedure, private :: solve
    procedure, private :: finish
    procedure, private :: open_up
  end type fem_law_breakage_type

  !> The increment and its iteration: x is volume and shear of the elastic strain and the multiplier
  !! over E_c.
  type :: crush_type
    real(wp) :: v, w, b0             !! trial volume and shear, breakage before
    real(wp) :: e(6)                 !! deviator of the trial strain, tensor shears
    real(wp) :: x(3)
    real(wp) :: b, left, p, q, energy  !! left: 1 - theta B
    real(wp) :: by_p(3), by_q(3)     !! slopes by x
    real(wp) :: r(3), j(3, 3)        !! residuals and their slopes by x
  end type crush_type

contains

  subroutine define(self)
    class(fem_law_breakage_type), intent(inout) :: self
    self%name = 'breakage'
    self%symmetric = .false.
    self%accounts = .true.
    call self%add_states([character(len=24) :: 'breakage [-]', 'breakage_energy [J/m3]'])
  end subroutine define

  !> theta of the fractal grading between two sizes, from grains of the larger one.
  pure real(wp) function grading_index(ratio, dimension_of)
    real(wp), intent(in) :: ratio         !! smallest over largest size
    real(wp), intent(in) :: dimension_of  !! D
    grading_index = 1.0_wp - (3.0_wp - dimension_of)/(5.0_wp - dimension_of) &
      *(1.0_wp - ratio**(5.0_wp - dimension_of))/(1.0_wp - ratio**(3.0_wp - dimension_of))
  end function grading_index

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_breakage_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: ratio, angle, largest, least, fractal

    call elastic_constants(deck, m, self%bulk, ratio, self%moduli)
    self%shear = ratio*self%bulk
    call deck%get('material', m, 'critical_slope', self%slope)
    call deck%get('material', m, 'breakage_energy', self%critical)
    call deck%get('material', m, 'breakage_angle_deg', angle)
    self%crush = cos(angle*acos(-1.0_wp)/180.0_wp)**2
    call deck%get('material', m, 'initial_breakage', self%initial)
    self%residual = given_or(deck, m, 'residual_pressure', 0.0_wp)
    if (deck%given('material', m, 'grading_index')) then
      call deck%get('material', m, 'grading_index', self%index)
    else if (deck%given('material', m, 'grain_size_max')) then
      call deck%get('material', m, 'grain_size_max', largest)
      call deck%get('material', m, 'grain_size_min', least)
      call deck%get('material', m, 'fractal_dimension', fractal)
      if (largest > least) then
        self%index = grading_index(least/largest, fractal)
      else
        call deck%fault(errors, 'D471', 'grain_size_max = '//str(largest)// &
          ' m is not above grain_size_min = '//str(least)//' m', 'material', m, &
          'grain_size_max', 'the ultimate grading reaches from the smallest to the largest size')
      end if
    else
      call deck%fault(errors, 'D471', 'nothing says how far the grading can go', 'material', m, &
        'id', 'give grain_size_max and grain_size_min, or grading_index')
    end if
    call check_tip(self, deck, m, errors)
  end subroutine read_constants

  !> Fault D473 where grains would crush in tension before friction lets them part.
  subroutine check_tip(self, deck, m, errors)
    class(fem_law_breakage_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: crushing
    crushing = (1.0_wp - self%index*self%initial)/(1.0_wp - self%initial) &
      *sqrt(2.0_wp*self%bulk*self%critical/self%index)
    if (self%residual < crushing) return
    call deck%fault(errors, 'D473', 'residual_pressure = '//str(self%residual)//' Pa is not '// &
      'below '//str(crushing)//' Pa, at which the grains crush', 'material', m, &
      'residual_pressure', 'a share of it that is small beside the stresses will do')
  end subroutine check_tip

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    type(crush_type) :: point
    real(wp) :: p
    state = 0.0_wp
    state(at_breakage) = self%initial
    fault = ''
    cure = ''
    p = -trace(stress)/3.0_wp
    if (.not. p + self%residual > 0.0_wp) then
      fault = 'breakage needs a compressive mean stress, not p = '//str(p)//' Pa'
      cure = 'give the part an &initial_stress or a &geostatic stress, or a residual_pressure'
      return
    end if
    call start_of(self, stress, state, 0.0_wp*unit, point)
    call self%look(point)
    state(at_energy) = point%energy
    if (point%r(3) <= outside) return
    fault = 'the initial stress is outside the yield surface: f = '//str(point%r(3))//' at p = '// &
            str(point%p)//' Pa, q = '//str(point%q)//' Pa'
    cure = 'crush the grains before: a larger initial_breakage, or begin nearer to isotropic stress'
  end subroutine begin

  !> The deviator is divided by what f has too much, then the pressure; breakage goes on. eq. F.77
  subroutine take_over(self, density, stress, state, fault, cure)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: density
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    type(fem_law_breakage_type) :: own
    type(crush_type) :: point
    real(wp) :: p, s(6), share, step
    integer(i4) :: k
    p = -trace(stress)/3.0_wp
    s = stress + p*unit
    p = max(p, 2.0_wp*held*self%bulk)
    share = 0.0_wp
    step = 1.0_wp
    do k = 0, halvings
      call start_of(self, (share + step)*s - p*unit, state, 0.0_wp*unit, point)
      call self%look(point)
      if (point%r(3) <= 0.0_wp) share = share + step
      if (share >= 1.0_wp) exit
      step = 0.5_wp*step
    end do
    call start_of(self, share*s - p*unit, state, 0.0_wp*unit, point)
    call self%look(point)
    if (.not. share > 0.0_wp) p = p/max(1.0_wp, 1.0_wp + point%r(3))
    stress = share*s - p*unit
    own = self
    own%initial = state(at_breakage)
    call own%begin(stress, state, fault, cure)
  end subroutine take_over

  !> Trial of an increment from a stress, whose elastic strain it has by B.
  pure subroutine start_of(self, stress, state, strain, point)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: stress(6), state(:), strain(6)
    type(crush_type), intent(out) :: point
    real(wp) :: p
    point%b0 = state(at_breakage)
    p = -trace(stress)/3.0_wp
    associate (left => 1.0_wp - self%index*point%b0)
      point%v = p/(left*self%bulk) - trace(strain)
      point%e = -(stress + p*unit)/(2.0_wp*left*self%shear) - matmul(project, strain)
    end associate
    point%w = root_2_3*magnitude(point%e)
    point%x = [point%v, point%w, 0.0_wp]
  end subroutine start_of

  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    type(crush_type) :: point
    real(wp) :: before
    logical :: yields
    integer(i4) :: iterations

    call start_of(self, stress, state, 0.0_wp*unit, point)
    call self%look(point)
    before = point%left/self%index*point%energy
    call start_of(self, stress, state, strain, point)
    iterations = 0
    good = .true.
    if ((1.0_wp - self%index*point%b0)*self%bulk*point%v + self%residual < held*self%bulk) then
      call self%open_up(strain, stress, state, tangent, before)
      return
    end if
    call self%look(point)
    yields = point%r(3) > 0.0_wp .or. (.not. any(abs(strain) > 0.0_wp) .and. &
                                      state(at_flag) > flag_elastic)
    if (yields) call self%solve(point, iterations, good)
    if (.not. good) return
    call self%finish(point, yields, stress, tangent)
    state(at_flag) = merge(flag_yielding, flag_elastic, yields)
    state(at_iterations) = iterations
    state(at_breakage) = point%b
    state(at_energy) = point%energy
    state(at_stored) = state(at_stored) + point%left/self%index*point%energy - before
    state(at_dissipated) = state(at_dissipated) + 2.0_wp*point%x(3)*self%critical
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) &
      - (point%v - point%x(1))/3.0_wp*unit - (1.0_wp - share_of(self, point))*twice*point%e
  end subroutine update

  !> Residuals and slopes; the third is that of sqrt(y + 1) = 1.
  pure subroutine look(self, point)
    class(fem_law_breakage_type), intent(in) :: self
    type(crush_type), intent(inout) :: point
    real(wp) :: grow, cut, by_energy(3), friction, mp, flow, by_flow(3), f, by_cut(3), by_b(3)
    real(wp) :: by_f(3)

    associate (v => point%x(1), w => point%x(2), l => point%x(3))
      point%b = 1.0_wp - 1.0_wp/(1.0_wp/(1.0_wp - point%b0) + 2.0_wp*self%crush*l)
      grow = 2.0_wp*self%crush*(1.0_wp - point%b)**2
      by_b = [0.0_wp, 0.0_wp, grow]
      point%left = 1.0_wp - self%index*point%b
      point%p = point%left*self%bulk*v
      point%q = 3.0_wp*point%left*self%shear*w
      point%by_p = [point%left*self%bulk, 0.0_wp, -self%index*grow*self%bulk*v]
      point%by_q = [0.0_wp, 3.0_wp*point%left*self%shear, -3.0_wp*self%index*grow*self%shear*w]
      point%energy = self%index*(0.5_wp*self%bulk*v**2 + 1.5_wp*self%shear*w**2)
      by_energy = self%index*[self%bulk*v, 3.0_wp*self%shear*w, 0.0_wp]
      cut = (1.0_wp - point%b)**2*point%energy/self%critical
      by_cut = (1.0_wp - point%b)**2*by_energy/self%critical &
        - 2.0_wp*(1.0_wp - point%b)*point%energy/self%critical*by_b
      mp = self%slope*(point%p + self%residual)
      friction = point%q/mp
      f = sqrt(cut + friction**2)
      ! plastic volume of a unit multiplier times E_c
      flow = 2.0_wp*cut*(1.0_wp - self%crush)*self%critical*inverse(self, point%p)
      by_flow = 2.0_wp*(1.0_wp - self%crush)*self%critical*(by_cut*inverse(self, point%p) &
                                           + cut*inverse_slope(self, point%p)*point%by_p)
      point%r(1) = v - point%v + l*flow
      point%r(2) = w - point%w + 2.0_wp*l*self%critical*point%q/mp**2
      point%r(3) = f - 1.0_wp
      point%j(1, :) = [1.0_wp, 0.0_wp, flow] + l*by_flow
      point%j(2, :) = [0.0_wp, 1.0_wp, 2.0_wp*self%critical*point%q/mp**2] &
        + 2.0_wp*l*self%critical/mp**2*(point%by_q - 2.0_wp*friction*self%slope*point%by_p)
      by_f = (0.5_wp*by_cut + friction*(point%by_q - friction*self%slope*point%by_p)/mp) &
        /max(f, tiny(1.0_wp))
      point%j(3, :) = by_f
    end associate
  end subroutine look

  !> 1/p of the flow; with a residual pressure it has no pole.
  pure real(wp) function inverse(self, p)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: p
    inverse = p/max(p**2 + (1.0e-2_wp*self%residual)**2, tiny(1.0_wp))
  end function inverse

  pure real(wp) function inverse_slope(self, p)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: p
    real(wp) :: square
    square = (1.0e-2_wp*self%residual)**2
    inverse_slope = (square - p**2)/max((p**2 + square)**2, tiny(1.0_wp))
  end function inverse_slope

  !> Newton; an iteration leaves some pressure, and a multiplier that is not negative.
  pure subroutine solve(self, point, iterations, good)
    class(fem_law_breakage_type), intent(in) :: self
    type(crush_type), intent(inout) :: point
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp) :: step(3), scale, before, error, room
    before = huge(1.0_wp)
    good = .false.
    do iterations = 1, most_iterations
      scale = max(abs(point%v), point%w)
      error = max(maxval(abs(point%r(:2)))/scale, abs(point%r(3)))
      good = error <= converged .or. (error <= settled .and. error >= before)
      if (good) return
      before = error
      step = solution(point%j, point%r)
      if (.not. all(abs(step) < huge(1.0_wp))) return
      room = point%x(1) + self%residual/(point%left*self%bulk)
      if (step(1) > 0.0_wp) step = step*min(1.0_wp, (1.0_wp - least_share)*room/step(1))
      point%x = point%x - step
      point%x(2:) = max(point%x(2:), 0.0_wp)
      call self%look(point)
    end do
  end subroutine solve

  !> Solution of three equations (Cramer).
  pure function solution(a, b) result(x)
    real(wp), intent(in) :: a(3, 3), b(3)
    real(wp) :: x(3), det
    det = sum(a(:, 1)*cross(a(:, 2), a(:, 3)))
    x = [sum(b*cross(a(:, 2), a(:, 3))), sum(a(:, 1)*cross(b, a(:, 3))), &
         sum(a(:, 1)*cross(a(:, 2), b))]/det
  end function solution

  pure function cross(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross

  !> Share of the trial's deviator that is elastic.
  pure real(wp) function share_of(self, point)
    class(fem_law_breakage_type), intent(in) :: self
    type(crush_type), intent(in) :: point
    share_of = 1.0_wp/(1.0_wp + 6.0_wp*point%x(3)*self%critical*point%left*self%shear &
                       /(self%slope*(point%p + self%residual))**2)
  end function share_of

  !> Stress and consistent tangent, from the slopes of the three unknowns by the trial strain.
  pure subroutine finish(self, point, yields, stress, tangent)
    class(fem_law_breakage_type), intent(in) :: self
    type(crush_type), intent(in) :: point
    logical, intent(in) :: yields
    real(wp), intent(out) :: stress(6), tangent(6, 6)
    real(wp) :: by_v(3), by_w(3), m(6), two_g, slope(2, 2)
    two_g = 2.0_wp*point%left*self%shear
    if (yields) two_g = two_g*share_of(self, point)
    stress = -two_g*point%e - point%p*unit
    by_v = [1.0_wp, 0.0_wp, 0.0_wp]
    by_w = [0.0_wp, 1.0_wp, 0.0_wp]
    if (yields) by_v = solution(point%j, by_v)
    if (yields) by_w = solution(point%j, by_w)
    slope(:, 1) = [sum(point%by_p*by_v), sum(point%by_q*by_v)]
    slope(:, 2) = [sum(point%by_p*by_w), sum(point%by_q*by_w)]
    m = 0.0_wp
    if (point%w > 0.0_wp) m = point%e/magnitude(point%e)
    tangent = slope(1, 1)*isotropic + two_g*(project - outer(m, m)) &
      + root_2_3*slope(2, 1)*outer(m, unit) + root_2_3*slope(1, 2)*outer(unit, m) &
      + slope(2, 2)/1.5_wp*outer(m, m)
    if (.not. point%w > 0.0_wp) tangent = slope(1, 1)*isotropic + two_g*project
  end subroutine finish

  !> A point that has no pressure is held without stress; the strain is plastic.
  pure subroutine open_up(self, strain, stress, state, tangent, before)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: strain(6), before
    real(wp), intent(inout) :: stress(6), state(:)
    real(wp), intent(out) :: tangent(6, 6)
    real(wp) :: left, now(6), p, stored
    left = 1.0_wp - self%index*state(at_breakage)
    now = (self%residual - 2.0_wp*held*self%bulk)*unit
    p = -trace(stress)/3.0_wp
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) + strain &
      + twice*(stress + p*unit)/(2.0_wp*left*self%shear) &
      - (p - 2.0_wp*held*self%bulk + self%residual)/(3.0_wp*left*self%bulk)*unit
    stored = 0.5_wp*(self%residual - 2.0_wp*held*self%bulk)**2/(left*self%bulk)
    state(at_dissipated) = state(at_dissipated) + max(0.0_wp, sum(now*strain) + before - stored)
    state(at_stored) = state(at_stored) + stored - before
    state(at_energy) = self%index*stored/left
    state(at_flag) = flag_apex
    state(at_iterations) = 0.0_wp
    stress = now
    tangent = remnant*elastic_matrix(self%bulk, self%shear)
  end subroutine open_up

  pure function modulus(self, stress) result(moduli)
    class(fem_law_breakage_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = [self%bulk, self%shear]
  end function modulus
end module fem_law_breakage
