!> How much liquid pores hold against suction, and how well it flows there: retention, relative
!! permeability and Bishop's factor, of the pressure p of the liquid over that of the air.
!!
!! With the suction s = -p > 0, S = S_r + (1 - S_r) S_e(s); all slopes are by p, at p = 0 those of
!! suctions. Mualem's law rises to 1 with an infinite slope, as may a power: a chord over the last
!! thousandth of S_e caps it.
!! eqs. F.80 to F.82
module fem_retention
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: fem_retention_type, retain, conduct, bear, begin_table, steep
  public :: no_retention, van_genuchten, brooks_corey, gardner, power, table
  public :: by_mualem, by_corey, by_gardner, by_power, by_table, least_relative, chord

  integer(i4), parameter :: no_retention = 0, van_genuchten = 1, brooks_corey = 2, gardner = 3, &
    power = 4, table = 5
  integer(i4), parameter :: by_mualem = 1, by_corey = 2, by_gardner = 3, by_power = 4, by_table = 5
  real(wp), parameter :: least_relative = 1.0e-6_wp  !! relative permeability of what is left
  real(wp), parameter :: least = 1.0e-20_wp          !! suction whose slopes are those at p = 0 [Pa]
  real(wp), parameter :: chord = 0.999_wp            !! S_e from which a chord leads to 1

  !> The laws of a material.
  type :: fem_retention_type
    integer(i4) :: law = no_retention
    real(wp) :: a = 0.0_wp         !! of the suction [1/Pa], or [Pa^-b]; entry suction [Pa]
    real(wp) :: b = 1.0_wp         !! exponent nu, lambda or b [-]
    real(wp) :: residual = 0.0_wp  !! S_r, saturation that suction does not take [-]
    integer(i4) :: relative = by_corey
    real(wp) :: c = 1.0_wp         !! of `by_gardner` [1/Pa] and `by_power` [-]
    real(wp) :: d = 1.0_wp         !! exponent of `by_corey` and `by_power` [-]
    logical :: effective = .false. !! Bishop's factor is S_e, otherwise S
    real(wp), allocatable :: at(:)        !! suctions of the tables [Pa]
    real(wp), allocatable :: kept(:, :)   !! (2, n) S_e there, and its slope [1/Pa]
    real(wp), allocatable :: flows(:, :)  !! (2, n) relative permeability, and its slope [1/Pa]
  end type fem_retention_type

contains

  !> Saturation and its slope by pressure [1/Pa].
  elemental subroutine retain(self, p, saturation, slope)
    type(fem_retention_type), intent(in) :: self
    real(wp), intent(in) :: p  !! [Pa]
    real(wp), intent(out) :: saturation, slope
    real(wp) :: se, by_suction
    saturation = 1.0_wp
    slope = 0.0_wp
    if (p > 0.0_wp .or. self%law == no_retention) return
    call effective(self, max(-p, least), se, by_suction)
    saturation = self%residual + (1.0_wp - self%residual)*se
    slope = -(1.0_wp - self%residual)*by_suction
  end subroutine retain

  !> Permeability over that of full pores, and its slope by pressure [1/Pa].
  elemental subroutine conduct(self, p, share, slope)
    type(fem_retention_type), intent(in) :: self
    real(wp), intent(in) :: p  !! [Pa]
    real(wp), intent(out) :: share, slope
    real(wp) :: se, by_suction
    share = 1.0_wp
    slope = 0.0_wp
    if (p > 0.0_wp .or. self%law == no_retention) return
    select case (self%relative)
    case (by_gardner)
      share = exp(self%c*p)
      slope = self%c*share
    case (by_table)
      call look_up(self%at, self%flows, -p, share, by_suction)
      slope = -by_suction
    case default
      call effective(self, max(-p, least), se, by_suction)
      call through(self, se, share, slope)
      slope = -slope*by_suction
    end select
    if (share > least_relative) return
    share = least_relative
    slope = 0.0_wp
  end subroutine conduct

  !> Bishop's factor times the pressure, what the skeleton feels of it [Pa], and its slope.
  elemental subroutine bear(self, p, borne, slope)
    type(fem_retention_type), intent(in) :: self
    real(wp), intent(in) :: p  !! [Pa]
    real(wp), intent(out) :: borne, slope
    real(wp) :: factor, rise
    borne = p
    slope = 1.0_wp
    if (p > 0.0_wp .or. self%law == no_retention) return
    call retain(self, p, factor, rise)
    if (self%effective) then
      factor = (factor - self%residual)/(1.0_wp - self%residual)
      rise = rise/(1.0_wp - self%residual)
    end if
    borne = factor*p
    slope = factor + rise*p
  end subroutine bear

  !> S_e at a suction above 0 and its slope by that [1/Pa].
  elemental subroutine effective(self, s, se, slope)
    type(fem_retention_type), intent(in) :: self
    real(wp), intent(in) :: s  !! [Pa]
    real(wp), intent(out) :: se, slope
    real(wp) :: x, m
    se = 1.0_wp
    slope = 0.0_wp
    select case (self%law)
    case (van_genuchten)
      x = (self%a*s)**self%b
      m = 1.0_wp - 1.0_wp/self%b
      se = (1.0_wp + x)**(-m)
      slope = -m*self%b*x/(s*(1.0_wp + x))*se
    case (brooks_corey)
      if (s <= self%a) return
      se = (self%a/s)**self%b
      slope = -self%b*se/s
    case (gardner)
      se = exp(-self%a*s)
      slope = -self%a*se
    case (power)
      se = 1.0_wp - self%a*s**self%b
      slope = -self%a*self%b*s**(self%b - 1.0_wp)
      if (se > 0.0_wp) return
      se = 0.0_wp
      slope = 0.0_wp
    case (table)
      call look_up(self%at, self%kept, s, se, slope)
    end select
  end subroutine effective

  !> Relative permeability of S_e and its slope by that, with the chord.
  elemental subroutine through(self, se, share, slope)
    type(fem_retention_type), intent(in) :: self
    real(wp), intent(in) :: se
    real(wp), intent(out) :: share, slope
    if (se > chord .and. steep(self)) then
      call curved(self, chord, share, slope)
      slope = (1.0_wp - share)/(1.0_wp - chord)
      share = 1.0_wp - slope*(1.0_wp - se)
    else
      call curved(self, se, share, slope)
    end if
  end subroutine through

  !> Does the relative permeability reach 1 with an infinite slope?
  elemental logical function steep(self)
    type(fem_retention_type), intent(in) :: self
    steep = self%law /= no_retention .and. (self%relative == by_mualem .or. &
      (self%relative == by_power .and. self%d < 1.0_wp))
  end function steep

  !> The same without the chord.
  elemental subroutine curved(self, se, share, slope)
    type(fem_retention_type), intent(in) :: self
    real(wp), intent(in) :: se
    real(wp), intent(out) :: share, slope
    real(wp) :: m, y, inner
    share = 0.0_wp
    slope = 0.0_wp
    select case (self%relative)
    case (by_mualem)
      if (se <= 0.0_wp) return
      m = 1.0_wp - 1.0_wp/self%b
      y = se**(1.0_wp/m)
      inner = 1.0_wp - (1.0_wp - y)**m
      share = sqrt(se)*inner**2
      slope = 0.5_wp*share/se + 2.0_wp*sqrt(se)*inner*(1.0_wp - y)**(m - 1.0_wp)*y/se
    case (by_corey)
      share = se**self%d
      if (se > 0.0_wp) slope = self%d*share/se
    case (by_power)
      share = 1.0_wp - self%c*(1.0_wp - se)**self%d
      if (se < 1.0_wp) slope = self%c*self%d*(1.0_wp - se)**(self%d - 1.0_wp)
    end select
  end subroutine curved

  !> Values at a suction between those of a table, by cubics, and their slope; constant outside.
  pure subroutine look_up(at, curve, s, value, slope)
    real(wp), intent(in) :: at(:), curve(:, :), s
    real(wp), intent(out) :: value, slope
    real(wp) :: h, t
    integer(i4) :: k, n
    n = int(size(at), i4)
    slope = 0.0_wp
    value = curve(1, 1)
    if (s <= at(1)) return
    value = curve(1, n)
    if (s >= at(n)) return
    k = int(count(at <= s), i4)
    h = at(k + 1) - at(k)
    t = (s - at(k))/h
    value = curve(1, k)*(1.0_wp + 2.0_wp*t)*(1.0_wp - t)**2 + curve(2, k)*h*t*(1.0_wp - t)**2 &
      + curve(1, k + 1)*t**2*(3.0_wp - 2.0_wp*t) + curve(2, k + 1)*h*t**2*(t - 1.0_wp)
    slope = 6.0_wp*t*(1.0_wp - t)*(curve(1, k + 1) - curve(1, k))/h &
      + curve(2, k)*(1.0_wp - t)*(1.0_wp - 3.0_wp*t) + curve(2, k + 1)*t*(3.0_wp*t - 2.0_wp)
  end subroutine look_up

  !> Slopes of cubics through values that never rise, which then do not rise either: means of the
  !! secants (Fritsch and Carlson 1980), none at the ends, where the curve goes on as a constant.
  pure function table_slopes(at, value) result(slope)
    real(wp), intent(in) :: at(:), value(:)
    real(wp) :: slope(size(at))
    real(wp) :: secant(size(at) - 1)
    integer(i4) :: k, n
    n = int(size(at), i4)
    secant = (value(2:) - value(:n - 1))/(at(2:) - at(:n - 1))
    slope = 0.0_wp
    do k = 2, n - 1
      if (secant(k - 1)*secant(k) > 0.0_wp) slope(k) = 2.0_wp*secant(k - 1)*secant(k) &
        /(secant(k - 1) + secant(k))
    end do
  end function table_slopes

  !> Take tables of S_e and, where it has values, of the relative permeability.
  pure subroutine begin_table(self, at, kept, flows)
    type(fem_retention_type), intent(inout) :: self
    real(wp), intent(in) :: at(:), kept(:), flows(:)
    self%at = at
    self%kept = transpose(reshape([kept, table_slopes(at, kept)], [size(at), 2]))
    if (size(flows) == size(at)) &
      self%flows = transpose(reshape([flows, table_slopes(at, flows)], [size(at), 2]))
  end subroutine begin_table
end module fem_retention
