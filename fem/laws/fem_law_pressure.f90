!> Elasticity whose stiffness grows with the pressure, E = E0 (p/p0)^n at a constant Poisson's ratio
!! (p the mean compressive stress, not below a least one): a law of rates, integrated exactly along
!! a straight path of strain. Closed circuits of strain that turn may gain or lose energy.
module fem_law_pressure
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_constants, only: elastic_constants, pressure_constants
  use fem_law, only: fem_law_type, at_flag, at_iterations, flag_elastic
  use fem_voigt, only: unit, project, isotropic, trace, outer
  implicit none
  private
  public :: fem_law_pressure_type

  real(wp), parameter :: small = 1.0e-4_wp  !! relative change of the pressure that counts as none

  type, extends(fem_law_type) :: fem_law_pressure_type
    real(wp) :: bulk = 0.0_wp        !! at the reference pressure [Pa]
    real(wp) :: ratio = 0.0_wp       !! shear over bulk modulus [-]
    real(wp) :: exponent = 0.0_wp    !! n [-]
    real(wp) :: reference = 1.0_wp   !! p0 [Pa]
    real(wp) :: least = 0.0_wp       !! pressure below which the stiffness is constant [Pa]
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: update
    procedure :: modulus
    procedure, private :: bulk_at
    procedure, private :: pressure_after
  end type fem_law_pressure_type

contains

  subroutine define(self)
    class(fem_law_pressure_type), intent(inout) :: self
    self%name = 'pressure_elastic'
    self%symmetric = .false.
  end subroutine define

  subroutine read_constants(self, deck, m, errors)
    class(fem_law_pressure_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    call elastic_constants(deck, m, self%bulk, self%ratio, self%moduli)
    call pressure_constants(deck, m, self%exponent, self%reference, self%least)
  end subroutine read_constants

  !> Bulk modulus at a pressure [Pa].
  pure real(wp) function bulk_at(self, p)
    class(fem_law_pressure_type), intent(in) :: self
    real(wp), intent(in) :: p
    bulk_at = self%bulk*(max(p, self%least)/self%reference)**self%exponent
  end function bulk_at

  !> Pressure after a volumetric compression from p: dp/dv = K(p) in closed form.
  pure real(wp) function pressure_after(self, p, compression)
    class(fem_law_pressure_type), intent(in) :: self
    real(wp), intent(in) :: p, compression
    real(wp) :: place, soft, power
    soft = self%bulk_at(self%least)
    power = 1.0_wp - self%exponent
    ! place: integral of dp/K from the least pressure, the measure in which the path is straight
    if (p <= self%least) then
      place = (p - self%least)/soft
    else if (power > 0.0_wp) then
      place = self%reference/(self%bulk*power)*((p/self%reference)**power &
                                                - (self%least/self%reference)**power)
    else
      place = self%reference/self%bulk*log(p/self%least)
    end if
    place = place + compression
    if (place <= 0.0_wp) then
      pressure_after = self%least + soft*place
    else if (power > 0.0_wp) then
      pressure_after = self%reference*((self%least/self%reference)**power &
                                       + self%bulk*power/self%reference*place)**(1.0_wp/power)
    else
      pressure_after = self%least*exp(self%bulk/self%reference*place)
    end if
  end function pressure_after

  !> The shear modulus of the increment is the mean over it, ratio times (change of p)/compression.
  pure subroutine update(self, strain, stress, state, tangent, good)
    class(fem_law_pressure_type), intent(in) :: self
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: p, q, v, s(6), e(6), mean, slope, bulk

    p = -trace(stress)/3.0_wp
    v = -trace(strain)
    s = stress + p*unit
    e = matmul(project, strain)
    q = self%pressure_after(p, v)
    bulk = self%bulk_at(q)
    if (abs(v)*self%bulk_at(p) > small*max(abs(p), self%least)) then
      mean = (q - p)/v
      slope = (bulk - mean)/v
    else
      mean = self%bulk_at(0.5_wp*(p + q))
      slope = 0.0_wp
      if (p > self%least) slope = 0.5_wp*self%exponent*bulk**2/q
    end if
    stress = s + 2.0_wp*self%ratio*mean*e - q*unit
    tangent = bulk*isotropic + 2.0_wp*self%ratio*(mean*project - slope*outer(e, unit))
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    good = .true.
  end subroutine update

  pure function modulus(self, stress) result(moduli)
    class(fem_law_pressure_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)
    real(wp) :: moduli(2)
    moduli = self%bulk_at(-trace(stress)/3.0_wp)*[1.0_wp, self%ratio]
  end function modulus
end module fem_law_pressure
