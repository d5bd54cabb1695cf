!> Micropolar elasticity whose moduli all grow with the pressure, `micropolar_pressure`: the
!! hyperelastic power law of Houlsby, Amorosi and Rojas (2005) with the families of fem_polar in
!! place of the deviator (eq. F.24). With the moduli E_i of the families at the
!! reference pressure p0, K that of the volume, and sigma_i = S E_i e_i, p = -S (1 - n) K tr(e),
!!   P^2 = p^2 + (1 - n) K sum_i |sigma_i|^2/E_i,  S = (P/p0)^n, P not below a least pressure in S.
!! The stored energy is a function of P alone; under isotropic pressure all moduli are S times those
!! of the reference. Stress gives the elastic strain in closed form, and back.
module fem_law_polar_pressure
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_constants, only: pressure_constants
  use fem_law, only: common_size, at_flag, at_iterations, at_stored, at_numerical, flag_elastic
  use fem_law_polar, only: fem_law_polar_type, mean_family
  use fem_polar, only: polar_size, families, spread_families, family_matrix, family_squares, &
    polar_outer, full_of
  implicit none
  private
  public :: fem_law_polar_pressure_type, at_factor

  integer(i4), parameter :: at_factor = common_size + 1  !! S

  type, extends(fem_law_polar_type) :: fem_law_polar_pressure_type
    real(wp) :: exponent = 0.0_wp    !! n < 1 [-]
    real(wp) :: reference = 1.0_wp   !! p0 [Pa]
    real(wp) :: least = 0.0_wp       !! P below which S is constant [Pa]
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: begin
    procedure :: polar_update
    procedure :: modulus
    procedure :: moduli_at
    procedure, private :: secants
    procedure, private :: factor
    procedure, private :: measure
    procedure, private :: energy
  end type fem_law_polar_pressure_type

contains

  subroutine define(self)
    class(fem_law_polar_pressure_type), intent(inout) :: self
    self%name = 'micropolar_pressure'
    self%polar = .true.
    self%eringen = .true.
    call self%add_states(['stiffness_factor [-]'])
  end subroutine define

  !> Fault D331 for n = 1, where the measure of strain is a logarithm without a zero.
  subroutine read_constants(self, deck, m, errors)
    class(fem_law_polar_pressure_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    call self%read_eringen(deck, m, errors)
    call pressure_constants(deck, m, self%exponent, self%reference, self%least)
    if (.not. self%exponent < 1.0_wp) call deck%fault(errors, 'D331', 'exponent = '// &
      str(self%exponent)//' leaves micropolar_pressure without a stored energy', 'material', m, &
      'exponent', 'it must be below 1: sand has about 0.5')
  end subroutine read_constants

  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    state = 0.0_wp
    state(at_factor) = self%factor(self%measure(widened(stress)))
    fault = ''
    cure = ''
  end subroutine begin

  !> Six components, or all, as all.
  pure function widened(stress) result(wide)
    real(wp), intent(in) :: stress(:)
    real(wp) :: wide(polar_size)
    wide = 0.0_wp
    if (size(stress) == polar_size) then
      wide = stress
    else
      wide(:9) = stress(full_of)
    end if
  end function widened

  !> Moduli of the families at S = 1, from strain to stress [Pa, N].
  pure function secants(self) result(c)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp) :: c(families)
    c = self%modulus_of
    c(mean_family) = (1.0_wp - self%exponent)*c(mean_family)
  end function secants

  !> S at a measure of the stress.
  pure real(wp) function factor(self, p)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: p  !! P [Pa]
    factor = (max(p, self%least)/self%reference)**self%exponent
  end function factor

  !> P of a stress [Pa]; a family without stiffness has no stress.
  pure real(wp) function measure(self, stress)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: stress(polar_size)
    real(wp) :: c(families)
    c = self%secants()
    measure = sqrt(c(mean_family)/3.0_wp*sum(inverse_of(c)*family_squares(stress)))
  end function measure

  !> 1/c, 0 for c = 0.
  pure function inverse_of(c) result(inverse)
    real(wp), intent(in) :: c(families)
    real(wp) :: inverse(families)
    inverse = 0.0_wp
    where (c > 0.0_wp) inverse = 1.0_wp/c
  end function inverse_of

  !> Stored energy at a measure of the stress [J/m^3].
  pure real(wp) function energy(self, p)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: p  !! P [Pa]
    real(wp) :: bulk, n, low
    n = self%exponent
    bulk = self%modulus_of(mean_family)/3.0_wp
    low = min(p, self%least)
    energy = 0.5_wp*low**2/((1.0_wp - n)*bulk*self%factor(low))
    if (p > low) energy = energy &
      + (p**2/self%factor(p) - low**2/self%factor(low))/((2.0_wp - n)*bulk)
  end function energy

  pure subroutine polar_update(self, strain, stress, state, tangent, good)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: strain(polar_size)
    real(wp), intent(inout) :: stress(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    logical, intent(out) :: good
    real(wp) :: e(polar_size), new(polar_size), c(families), before, p, s, bulk, stored

    good = .true.
    c = self%secants()
    bulk = self%modulus_of(mean_family)/3.0_wp
    before = self%measure(stress)
    e = spread_families(inverse_of(c)/self%factor(before), stress) + strain
    ! P/S from the strain: linear in it below the least pressure, a power of it above
    p = sqrt(c(mean_family)/3.0_wp*sum(c*family_squares(e)))
    if (p*self%factor(0.0_wp) <= self%least) then
      p = p*self%factor(0.0_wp)
    else
      p = self%reference*(p/self%reference)**(1.0_wp/(1.0_wp - self%exponent))
    end if
    s = self%factor(p)
    new = spread_families(s*c, e)
    tangent = family_matrix(s*c)
    if (p > self%least) tangent = tangent + polar_outer(self%exponent*bulk*s/p**2*new, new)
    stored = self%energy(p) - self%energy(before)
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    state(at_stored) = state(at_stored) + stored
    state(at_numerical) = state(at_numerical) + 0.5_wp*sum((stress + new)*strain) - stored
    state(at_factor) = s
    stress = new
  end subroutine polar_update

  !> About the isotropic pressure P.
  pure function modulus(self, stress) result(moduli)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = self%factor(self%measure(widened(stress))) &
      *[self%modulus_of(mean_family)/3.0_wp, 0.5_wp*self%modulus_of(1)]
  end function modulus

  !> Moduli that the tangent nowhere exceeds: its part of rank one, n K S/P^2 sigma sigma', is not
  !! above what the sums of its rows give each family.
  pure function moduli_at(self, stress) result(moduli)
    class(fem_law_polar_pressure_type), intent(in) :: self
    real(wp), intent(in) :: stress(:)
    real(wp) :: moduli(6), c(families), share(families), wide(polar_size), p
    wide = widened(stress)
    c = self%secants()
    p = self%measure(wide)
    share = 0.0_wp
    if (p > self%least) share = sqrt(c(mean_family)/3.0_wp*inverse_of(c)*family_squares(wide))/p
    c = self%factor(p)*c*(1.0_wp + self%exponent/(1.0_wp - self%exponent)*share*sum(share))
    moduli = [(c(3) - c(1))/3.0_wp, 0.5_wp*(c(1) - c(2)), c(2), (c(6) - c(4))/3.0_wp, &
              0.5_wp*(c(4) - c(5)), 0.5_wp*(c(4) + c(5))]
  end function moduli_at
end module fem_law_polar_pressure
