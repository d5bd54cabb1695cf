!> Powers of many numbers at once, without the library: the same bits on every lane and for every
!! count of threads, in registers of any width.
module dem_power
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: raise

  real(wp), parameter :: ln2 = 0.693147180559945309417232121458_wp
  real(wp), parameter :: ln2_high = 0.693147180369123816490_wp     !! its first 33 bits
  real(wp), parameter :: ln2_low = 1.90821492927058770002e-10_wp   !! the rest
  real(wp), parameter :: whole = 6755399441055744.0_wp             !! 1.5 2^52: the sum is rounded
  integer(i8), parameter :: whole_bits = transfer(whole, 0_i8)
  integer(i8), parameter :: one_bits = transfer(1.0_wp, 0_i8)
  integer(i8), parameter :: mantissa = 2_i8**52 - 1_i8

contains

  !> y = x^e for normal x > 0 and |e ln x| < 700, to a few units in the last place of e ln x.
  pure subroutine raise(count, x, e, y)
    integer(i4), intent(in) :: count
    real(wp), intent(in) :: x(count), e(count)
    real(wp), intent(out) :: y(count)
    integer(i8) :: bits, power
    real(wp) :: f, s, s2, log_f, k, z, r, p
    integer(i4) :: i

    !$omp simd private(bits, power, f, s, s2, log_f, k, z, r, p)
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
      log_f = 1.0_wp/21.0_wp
      log_f = log_f*s2 + 1.0_wp/19.0_wp
      log_f = log_f*s2 + 1.0_wp/17.0_wp
      log_f = log_f*s2 + 1.0_wp/15.0_wp
      log_f = log_f*s2 + 1.0_wp/13.0_wp
      log_f = log_f*s2 + 1.0_wp/11.0_wp
      log_f = log_f*s2 + 1.0_wp/9.0_wp
      log_f = log_f*s2 + 1.0_wp/7.0_wp
      log_f = log_f*s2 + 1.0_wp/5.0_wp
      log_f = log_f*s2 + 1.0_wp/3.0_wp
      log_f = 2.0_wp*s + 2.0_wp*s*s2*log_f
      z = e(i)*(k*ln2 + log_f)
      ! e^z = 2^k e^r, |r| <= ln 2/2
      p = z*(1.0_wp/ln2) + whole
      power = transfer(p, 0_i8) - whole_bits
      k = p - whole
      r = (z - k*ln2_high) - k*ln2_low
      p = 1.0_wp/6227020800.0_wp
      p = p*r + 1.0_wp/479001600.0_wp
      p = p*r + 1.0_wp/39916800.0_wp
      p = p*r + 1.0_wp/3628800.0_wp
      p = p*r + 1.0_wp/362880.0_wp
      p = p*r + 1.0_wp/40320.0_wp
      p = p*r + 1.0_wp/5040.0_wp
      p = p*r + 1.0_wp/720.0_wp
      p = p*r + 1.0_wp/120.0_wp
      p = p*r + 1.0_wp/24.0_wp
      p = p*r + 1.0_wp/6.0_wp
      p = p*r + 0.5_wp
      p = p*r + 1.0_wp
      p = p*r + 1.0_wp
      y(i) = p*transfer(ishft(power + 1023_i8, 52), 0.0_wp)
    end do
  end subroutine raise
end module dem_power
