!> Powers of many numbers at once, without the library: the same bits on every lane and for every
!! count of threads, in registers of any width.
module dem_power
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: raise, raise_near

  real(wp), parameter :: ln2 = 0.693147180559945309417232121458_wp
  real(wp), parameter :: ln2_high = 0.693147180369123816490_wp     !! its first 33 bits
  real(wp), parameter :: ln2_low = 1.90821492927058770002e-10_wp   !! the rest
  real(wp), parameter :: whole = 6755399441055744.0_wp             !! 1.5 2^52: the sum is rounded
  integer(i8), parameter :: whole_bits = transfer(whole, 0_i8)
  integer(i8), parameter :: one_bits = transfer(1.0_wp, 0_i8)
  integer(i8), parameter :: mantissa = 2_i8**52 - 1_i8

  real(wp), parameter :: middle = 1.32_wp, log_middle = 0.27763173659827955_wp

  !> (ln((1+s)/(1-s)) - 2s)/s^3 in s^2 up to ((sqrt 2 - 1)/(sqrt 2 + 1))^2, and (e^r - 1 - r)/r^2 in
  !! r up to ln 2/2: through the points of Chebyshev, to 5e-18 and 2e-17 of ln and exp.
  real(wp), parameter :: a(7) = [0.666666666666667_wp, 0.39999999999899505_wp, &
    0.28571428625975487_wp, 0.2222221113479508_wp, 0.18182889125261723_wp, 0.15331721600556042_wp, &
    0.14616449685043406_wp]
  real(wp), parameter :: b(10) = [0.5000000000000001_wp, 0.16666666666666669_wp, &
    0.041666666666624164_wp, 0.008333333333330065_wp, 0.0013888888917196719_wp, &
    0.00019841269863040545_wp, 2.4801521322368692e-05_wp, 2.7557268480310024e-06_wp, &
    2.7620075879983367e-07_wp, 2.5100375832561234e-08_wp]

contains

  !> y = x^e for normal x > 0 and |e ln x| < 700, to a few units in the last place of e ln x.
  pure subroutine raise(count, x, e, y)
    integer(i4), intent(in) :: count
    real(wp), intent(in) :: x(count), e(count)
    real(wp), intent(out) :: y(count)
    integer(i8) :: bits, power
    real(wp) :: f, s, s2, s4, log_f, k, z, r, r2, r4, p
    integer(i4) :: i

    !$omp simd private(bits, power, f, s, s2, s4, log_f, k, z, r, r2, r4, p)
    do i = 1, count
      ! x = f 2^k, f in (1/sqrt 2, sqrt 2): ln f = 2 artanh((f - 1)/(f + 1))
      bits = transfer(x(i), 0_i8)
      power = ishft(bits, -52) - 1023_i8
      f = transfer(ior(iand(bits, mantissa), one_bits), 0.0_wp)
      k = transfer(power + whole_bits, 0.0_wp) - whole
      k = merge(k + 1.0_wp, k, f > 1.4142135623730951_wp)
      f = merge(0.5_wp*f, f, f > 1.4142135623730951_wp)
      s = (f - 1.0_wp)/(f + 1.0_wp)
      s2 = s*s
      s4 = s2*s2
      log_f = s2*((a(1) + a(2)*s2) + s4*((a(3) + a(4)*s2) + s4*((a(5) + a(6)*s2) + s4*a(7))))
      log_f = 2.0_wp*s + s*log_f
      z = e(i)*(k*ln2 + log_f)
      ! e^z = 2^k e^r, |r| <= ln 2/2
      p = z*(1.0_wp/ln2) + whole
      power = transfer(p, 0_i8) - whole_bits
      k = p - whole
      r = (z - k*ln2_high) - k*ln2_low
      r2 = r*r
      r4 = r2*r2
      p = ((b(1) + b(2)*r) + r2*(b(3) + b(4)*r)) &
          + r4*(((b(5) + b(6)*r) + r2*(b(7) + b(8)*r)) + r4*(b(9) + b(10)*r))
      p = 1.0_wp + (r + r2*p)
      y(i) = p*transfer(ishft(power + 1023_i8, 52), 0.0_wp)
    end do
  end subroutine raise

  !> The same for 1 <= x <= 1.8 and |e| <= 1/2, whose powers need no powers of 2.
  pure subroutine raise_near(count, x, e, y)
    integer(i4), intent(in) :: count
    real(wp), intent(in) :: x(count), e(count)
    real(wp), intent(out) :: y(count)
    real(wp) :: s, s2, s4, z, z2, z4
    integer(i4) :: i

    !$omp simd private(s, s2, s4, z, z2, z4)
    do i = 1, count
      s = (x(i) - middle)/(x(i) + middle)
      s2 = s*s
      s4 = s2*s2
      z = s2*((a(1) + a(2)*s2) + s4*((a(3) + a(4)*s2) + s4*((a(5) + a(6)*s2) + s4*a(7))))
      z = e(i)*(log_middle + (2.0_wp*s + s*z))
      z2 = z*z
      z4 = z2*z2
      y(i) = ((b(1) + b(2)*z) + z2*(b(3) + b(4)*z)) &
             + z4*(((b(5) + b(6)*z) + z2*(b(7) + b(8)*z)) + z4*(b(9) + b(10)*z))
      y(i) = 1.0_wp + (z + z2*y(i))
    end do
  end subroutine raise_near
end module dem_power
