!> `sanisand`: sand with a critical state, bounding and dilatancy surfaces and a fabric (Dafalias
!! and Manzari 2004); one set of constants serves all densities and pressures. Equations in
!! fem_sanisand, sub-steps in fem_sanisand_path; here constants, start, and the tangent of an
!! increment by differences in the same sub-steps.
!! eq. F.41, F.42, F.43
module fem_law_sanisand
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_cone, only: remnant
  use fem_constants, only: shear_ratio, given_or
  use fem_law, only: fem_law_type, common_size, at_flag, at_iterations, at_plastic, flag_elastic, &
    flag_apex
  use fem_sanisand, only: sand_type, continuum, critical_void, bulk_and_shear, bounding, lode, &
    at_void, at_sand_flow => at_flow, sand_size
  use fem_sanisand_lanes, only: follow_lanes, sand_lanes
  use fem_sanisand_path, only: sand_record_type, follow_strain
  use fem_voigt, only: unit, twice, trace, magnitude, elastic_matrix
  implicit none
  private
  public :: fem_law_sanisand_type

  integer(i4), parameter :: at_alpha = common_size + 1     !! six components, compression positive
  integer(i4), parameter :: at_fabric = common_size + 7    !! six
  integer(i4), parameter :: at_start = common_size + 13    !! six, alpha where the loading began
  integer(i4), parameter :: at_ratio = common_size + 19    !! void ratio
  integer(i4), parameter :: at_psi = common_size + 20      !! e - e_c
  real(wp), parameter :: residual_share = 5.0e-3_wp  !! of the atmospheric pressure
  real(wp), parameter :: held_share = 0.1_wp         !! of the residual pressure
  real(wp), parameter :: least_share = 1.0e-5_wp     !! of the atmospheric pressure
  real(wp), parameter :: densest = 0.8_wp            !! of the void ratio at the start, for waves
  real(wp), parameter :: most_density = 1.2_wp       !! relative; denser than the standard test's
  real(wp), parameter :: inside = 1.0_wp - 1.0e-6_wp !! of the bounding surface
  real(wp), parameter :: no_strain = 1.0e-9_wp       !! that has the tangent of a zero increment
  real(wp), parameter :: probe = 1.0e-5_wp           !! of the increment, for differences
  real(wp), parameter :: tensor(6) = -1.0_wp/twice   !! from a strain to the compressive tensor

  type, extends(fem_law_type) :: fem_law_sanisand_type
    type(sand_type) :: sand
    real(wp) :: void_ratio = 0.0_wp  !! at the start
    real(wp) :: least_void = 0.0_wp  !! of waves
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: begin
    procedure :: take_over
    procedure, private :: begin_at
    procedure, private :: most_ratio
    procedure :: update
    procedure :: modulus
    procedure, private :: read_density
    procedure, private :: differences
  end type fem_law_sanisand_type

contains

  subroutine define(self)
    class(fem_law_sanisand_type), intent(inout) :: self
    character(len=2), parameter :: part(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'zx']
    integer(i4) :: k
    self%name = 'sanisand'
    self%symmetric = .false.
    call self%add_states([character(len=24) :: ('back_stress_'//part(k)//' [-]', k=1, 6), &
      ('fabric_'//part(k)//' [-]', k=1, 6), ('loading_start_'//part(k)//' [-]', k=1, 6), &
      'void_ratio [-]', 'state_parameter [-]'])
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_sanisand_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: poisson

    call deck%get('material', m, 'poisson', poisson)
    self%sand%ratio = 1.0_wp/shear_ratio(poisson)
    call deck%get('material', m, 'stiffness_number', self%sand%shear)
    call deck%get('material', m, 'critical_slope', self%sand%slope)
    call deck%get('material', m, 'extension_ratio', self%sand%extension)
    call deck%get('material', m, 'critical_void_ratio', self%sand%line_void)
    call deck%get('material', m, 'critical_line_slope', self%sand%line_slope)
    call deck%get('material', m, 'critical_line_exponent', self%sand%line_exponent)
    call deck%get('material', m, 'yield_opening', self%sand%opening)
    call deck%get('material', m, 'plastic_hardening', self%sand%hardening)
    call deck%get('material', m, 'hardening_void', self%sand%hardening_void)
    call deck%get('material', m, 'bounding_rate', self%sand%bounding_rate)
    call deck%get('material', m, 'dilatancy', self%sand%dilatancy)
    call deck%get('material', m, 'dilatancy_rate', self%sand%dilatancy_rate)
    call deck%get('material', m, 'fabric_limit', self%sand%fabric_limit)
    call deck%get('material', m, 'fabric_rate', self%sand%fabric_rate)
    call deck%get('material', m, 'atmospheric_pressure', self%sand%atmosphere)
    self%sand%residual = given_or(deck, m, 'residual_pressure', &
                                  residual_share*self%sand%atmosphere)
    self%sand%least = max(held_share*self%sand%residual, least_share*self%sand%atmosphere)
    call self%read_density(deck, m, errors)
  end subroutine read_constants

  !> Void ratio at the start, by itself or by the relative density; faults D470, and D331 where the
  !! yield surface does not fit between the critical states.
  subroutine read_density(self, deck, m, errors)
    class(fem_law_sanisand_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    real(wp) :: loosest, dense, share

    call deck%get('material', m, 'void_ratio', self%void_ratio)
    call read_limits(deck, m, loosest, dense, errors)
    if (deck%given('material', m, 'relative_density')) then
      call deck%get('material', m, 'relative_density', share)
      self%void_ratio = loosest - share*(loosest - dense)
    else if (.not. deck%given('material', m, 'void_ratio')) then
      call deck%fault(errors, 'D470', 'the sand has no density at the start', 'material', m, 'id', &
        'give void_ratio, or relative_density with void_ratio_max and void_ratio_min')
      return
    else
      call check_limits(deck, m, self%void_ratio, [loosest, dense], errors)
    end if
    if (self%void_ratio*self%sand%hardening_void >= 1.0_wp) call deck%fault(errors, 'D470', &
      'the void ratio '//str(self%void_ratio)//' leaves no hardening: h0 (1 - c_h e) is not '// &
      'positive', 'material', m, 'hardening_void', 'hardening_void must be below 1/e = '// &
      str(1.0_wp/self%void_ratio))
    if (self%sand%opening >= self%sand%extension*self%sand%slope) call deck%fault(errors, 'D331', &
      'yield_opening = '//str(self%sand%opening)//' is not below extension_ratio critical_slope'// &
      ' = '//str(self%sand%extension*self%sand%slope), 'material', m, 'yield_opening', &
      'the yield surface is a narrow cone between the critical states: 0.01 is usual')
    self%least_void = densest*self%void_ratio
  end subroutine read_density

  !> e_max and e_min, huge and 0 where they are not given.
  subroutine read_limits(deck, m, loosest, dense, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(out) :: loosest, dense
    type(error_list_type), intent(inout) :: errors
    loosest = huge(1.0_wp)
    dense = 0.0_wp
    if (.not. deck%given('material', m, 'void_ratio_max')) return
    call deck%get('material', m, 'void_ratio_max', loosest)
    if (.not. deck%given('material', m, 'void_ratio_min')) return
    call deck%get('material', m, 'void_ratio_min', dense)
    if (.not. loosest > dense) call deck%fault(errors, 'D470', 'void_ratio_max = '// &
      str(loosest)//' is not above void_ratio_min = '//str(dense), 'material', m, &
      'void_ratio_max', 'the loosest state has the largest void ratio')
  end subroutine read_limits

  !> Is a given void ratio among those that a relative density could give?
  subroutine check_limits(deck, m, void, limits, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    real(wp), intent(in) :: void, limits(2)  !! e_max and e_min
    type(error_list_type), intent(inout) :: errors
    real(wp) :: least
    if (void > limits(1)) call deck%fault(errors, 'D470', 'void_ratio = '//str(void)// &
      ' is above void_ratio_max = '//str(limits(1)), 'material', m, 'void_ratio', &
      'grains that touch leave no more voids than those of the loosest state')
    if (.not. (limits(2) > 0.0_wp .and. limits(1) > limits(2))) return
    least = limits(1) - most_density*(limits(1) - limits(2))
    if (void < least) call deck%fault(errors, 'D470', 'void_ratio = '//str(void)// &
      ' is a relative density of '//str((limits(1) - void)/(limits(1) - limits(2))), 'material', &
      m, 'void_ratio', 'at most '//str(most_density)//', that is void_ratio = '//str(least))
  end subroutine check_limits

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    call self%begin_at(self%void_ratio, stress, state, fault, cure)
  end subroutine begin

  !> The void ratio is that of the grains, the ratio of stresses goes back to the bounding surface.
  !! eq. F.77
  subroutine take_over(self, density, stress, state, fault, cure)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: density
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp) :: p, void, s(6), most
    p = -trace(stress)/3.0_wp
    s = stress + p*unit
    p = max(p + self%sand%residual, self%sand%residual, 2.0_wp*self%sand%least)
    void = max((1.0_wp + self%void_ratio)/max(density, tiny(density)) - 1.0_wp, self%least_void)
    most = inside*p*self%most_ratio(-s, p, void)
    if (magnitude(s) > most) s = s*max(0.0_wp, most)/magnitude(s)
    stress = s - (p - self%sand%residual)*unit
    call self%begin_at(void, stress, state, fault, cure)
  end subroutine take_over

  !> Size of the ratio of stresses on the bounding surface, in the direction of a deviator.
  pure real(wp) function most_ratio(self, s, p, void)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: s(6), p, void  !! compression positive, p with the residual one [Pa]
    real(wp) :: g, cosine
    g = 1.0_wp
    if (magnitude(s) > 0.0_wp) call lode(self%sand, s/magnitude(s), g, cosine)
    most_ratio = bounding(self%sand, g, void - critical_void(self%sand, p))
  end function most_ratio

  !> The start with a void ratio.
  subroutine begin_at(self, void, stress, state, fault, cure)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: void, stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp) :: p, ratio(6), size_of, most

    state = 0.0_wp
    fault = ''
    cure = ''
    p = -trace(stress)/3.0_wp + self%sand%residual
    if (.not. p > self%sand%least) then
      fault = 'sanisand needs a compressive mean stress, not p = '// &
              str(p - self%sand%residual)//' Pa'
      cure = 'give the part an &initial_stress or a &geostatic stress'
      return
    end if
    ratio = (-stress - (p - self%sand%residual)*unit)/p
    size_of = magnitude(ratio)
    state(at_alpha:at_alpha + 5) = ratio
    state(at_start:at_start + 5) = ratio
    state(at_ratio) = void
    state(at_psi) = void - critical_void(self%sand, p)
    if (.not. size_of > 0.0_wp) return
    most = self%most_ratio(ratio, p, void)
    if (size_of < most) return
    fault = 'the initial stress is outside the bounding surface: q/p = '// &
            str(sqrt(1.5_wp)*size_of)//', and the sand bears '//str(sqrt(1.5_wp)*most)// &
            ' at void ratio '//str(void)//' and p = '//str(p)//' Pa'
    cure = 'begin nearer to isotropic stress, or denser'
  end subroutine begin_at

  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    type(sand_record_type) :: record
    real(wp) :: y(sand_size), from(sand_size), start(6), begun(6), flag

    from(:6) = self%sand%residual*unit - stress
    from(7:18) = state(at_alpha:at_alpha + 11)
    from(at_void) = state(at_ratio)
    from(at_sand_flow:) = 0.0_wp
    begun = state(at_start:at_start + 5)
    y = from
    start = begun
    flag = state(at_flag)
    good = .true.
    if (any(abs(strain) > 0.0_wp)) call follow_strain(self%sand, tensor*strain, y, start, record, &
                                                      flag, good)
    if (.not. good) return
    if (flag >= flag_apex) then
      tangent = remnant*elastic_matrix(self%sand%ratio, 1.0_wp)*self%sand%shear &
        *self%sand%atmosphere
    else if (maxval(abs(strain)) <= no_strain) then
      tangent = continuum(self%sand, y, start, flag > flag_elastic)
    else
      call self%differences(strain, from, begun, y, record, tangent)
    end if
    stress = self%sand%residual*unit - y(:6)
    state(at_flag) = flag
    state(at_iterations) = record%count
    state(at_plastic:at_plastic + 5) = state(at_plastic:at_plastic + 5) - twice*y(at_sand_flow:)
    state(at_alpha:at_alpha + 11) = y(7:18)
    state(at_start:at_start + 5) = start
    state(at_ratio) = y(at_void)
    state(at_psi) = y(at_void) - critical_void(self%sand, trace(y(:6))/3.0_wp)
  end subroutine update

  !> Tangent of an increment: that of its sub-steps, which are the same for neighbours.
  pure subroutine differences(self, strain, from, begun, y, record, tangent)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(in) :: from(sand_size), begun(6)  !! the point before
    real(wp), intent(in) :: y(sand_size)               !! and after
    type(sand_record_type), intent(inout) :: record
    real(wp), intent(out) :: tangent(6, 6)
    real(wp) :: moved(6), there(sand_size), start(6), flag, step
    logical :: good
    integer(i4) :: j
    record%known = .true.
    step = probe*maxval(abs(strain))
    call side_by_side(self, strain, from, begun, record, tangent, good)
    if (good) return
    do j = 1, 6
      moved = strain
      moved(j) = strain(j) + step
      there = from
      start = begun
      call follow_strain(self%sand, tensor*moved, there, start, record, flag, good)
      tangent(:, j) = (y(:6) - there(:6))/step
    end do
  end subroutine differences

  !> The same for an increment that yields all the way, the last lanes being the increment itself.
  pure subroutine side_by_side(self, strain, from, begun, record, tangent, good)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: strain(6), from(sand_size), begun(6)
    type(sand_record_type), intent(in) :: record
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: moved(sand_lanes, 6), y(sand_lanes, sand_size), start(sand_lanes, 6), step
    integer(i4) :: j
    step = probe*maxval(abs(strain))
    moved = spread(tensor*strain, 1, sand_lanes)
    y = spread(from, 1, sand_lanes)
    start = spread(begun, 1, sand_lanes)
    do j = 1, 6
      moved(j, j) = tensor(j)*(strain(j) + step)
    end do
    call follow_lanes(self%sand, moved, y, start, record, good)
    if (.not. good) return
    do j = 1, 6
      tangent(:, j) = (y(sand_lanes, :6) - y(j, :6))/step
    end do
  end subroutine side_by_side

  !> The void ratio of a point is not known here: that of a sand denser than at the start.
  pure function modulus(self, stress) result(moduli)
    class(fem_law_sanisand_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = bulk_and_shear(self%sand, max(-trace(stress)/3.0_wp + self%sand%residual, &
                                           self%sand%least), self%least_void)
  end function modulus
end module fem_law_sanisand
