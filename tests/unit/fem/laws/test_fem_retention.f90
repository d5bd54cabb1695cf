!> Retention, relative permeability and Bishop's factor: values of the closed forms, slopes against
!! differences, no jump at the chord, residual and floor, tables that pass their points and never
!! rise.
program test_fem_retention
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_test, only: test_type
  use fem_retention, only: fem_retention_type, retain, conduct, bear, begin_table, &
    van_genuchten, brooks_corey, gardner, power, table, by_mualem, by_corey, by_gardner, by_power, &
    by_table, least_relative, chord
  implicit none
  type(test_type) :: test
  type(fem_retention_type) :: soil(6)
  character(len=*), parameter :: names(6) = [character(len=13) :: 'van Genuchten', &
    'Brooks, Corey', 'Gardner', 'power', 'table', 'steep power']
  integer(i4) :: k

  soil(1) = fem_retention_type(van_genuchten, 1.0e-4_wp, 1.7_wp, 0.1_wp, by_mualem)
  soil(2) = fem_retention_type(brooks_corey, 2.0e3_wp, 0.8_wp, 0.05_wp, by_corey, &
    d=3.0_wp + 2.0_wp/0.8_wp)
  soil(3) = fem_retention_type(gardner, 1.0e-4_wp, 1.0_wp, 0.15_wp, by_gardner, 2.0e-4_wp)
  soil(4) = fem_retention_type(power, 1.9722e-11_wp, 2.4279_wp, 0.0_wp, by_power, 2.207_wp, &
    1.0121_wp)
  soil(5) = fem_retention_type(table, residual=0.02_wp, relative=by_table)
  call begin_table(soil(5), [0.0_wp, 1.0e3_wp, 3.0e3_wp, 1.0e4_wp, 1.0e5_wp], &
    [1.0_wp, 0.9_wp, 0.5_wp, 0.5_wp, 0.1_wp], [1.0_wp, 0.7_wp, 0.2_wp, 0.1_wp, 1.0e-3_wp])
  soil(6) = fem_retention_type(gardner, 1.0e-4_wp, 1.0_wp, 0.0_wp, by_power, 0.9_wp, 0.6_wp)
  do k = 1, size(soil)
    soil(k)%effective = mod(k, 2) == 0
    call check_slopes(soil(k), trim(names(k)))
    call check_ends(soil(k), trim(names(k)))
  end do
  call check_values()
  call check_chord()
  call check_table()
  call test%finish()

contains

  !> Slopes are those of differences, between the kinks.
  subroutine check_slopes(law, name)
    type(fem_retention_type), intent(in) :: law
    character(len=*), intent(in) :: name
    real(wp), parameter :: suction(6) = [30.0_wp, 700.0_wp, 2.5e3_wp, 6.0e3_wp, 1.1e4_wp, 4.0e4_wp]
    real(wp) :: p, h, low(3), high(3), here(3), slope(3), off(3), unused
    integer(i4) :: i
    off = 0.0_wp
    do i = 1, size(suction)
      p = -suction(i)
      h = 1.0e-4_wp*suction(i)
      call retain(law, p - h, low(1), unused)
      call conduct(law, p - h, low(2), unused)
      call bear(law, p - h, low(3), unused)
      call retain(law, p + h, high(1), unused)
      call conduct(law, p + h, high(2), unused)
      call bear(law, p + h, high(3), unused)
      call retain(law, p, here(1), slope(1))
      call conduct(law, p, here(2), slope(2))
      call bear(law, p, here(3), slope(3))
      off = max(off, abs((high - low)/(2.0_wp*h) - slope)*[suction(i), suction(i), 1.0_wp])
    end do
    call test%check(name//': slopes of S, k_r and what the skeleton feels, '//str(maxval(off)), &
                    maxval(off) < 1.0e-6_wp)
  end subroutine check_slopes

  !> Full pores without suction; residual saturation and the floor of k_r at much of it; both fall.
  subroutine check_ends(law, name)
    type(fem_retention_type), intent(in) :: law
    character(len=*), intent(in) :: name
    real(wp), parameter :: rounding = 1.0e-15_wp
    real(wp) :: s, k, slope, before(2)
    integer(i4) :: i
    logical :: falls
    call retain(law, 0.0_wp, s, slope)
    call conduct(law, 10.0_wp, k, slope)
    call test%check(name//': full without suction', s >= 1.0_wp .and. s <= 1.0_wp .and. &
                    k >= 1.0_wp .and. k <= 1.0_wp .and. abs(slope) <= 0.0_wp)
    before = 1.0_wp
    falls = .true.
    do i = 1, 600
      call retain(law, -exp(0.04_wp*i), s, slope)
      falls = falls .and. s <= before(1) + rounding .and. slope >= 0.0_wp
      call conduct(law, -exp(0.04_wp*i), k, slope)
      falls = falls .and. k <= before(2) + rounding .and. slope >= 0.0_wp &
        .and. k >= least_relative
      before = [s, k]
    end do
    call test%check(name//': falls with suction', falls)
    call test%check(name//': residual', s >= law%residual .and. s < law%residual + 0.11_wp)
  end subroutine check_ends

  !> Values by hand.
  subroutine check_values()
    real(wp) :: s, k, b, slope
    call retain(soil(1), -2.0e4_wp, s, slope)
    call test%check_close('van Genuchten: S', s, 0.1_wp + 0.9_wp*(1.0_wp &
      + 2.0_wp**1.7_wp)**(-0.7_wp/1.7_wp), 1.0e-14_wp)
    call conduct(soil(2), -4.0e3_wp, k, slope)
    call test%check_close('Corey: k_r', k, 0.5_wp**(0.8_wp*5.5_wp), 1.0e-14_wp)
    call retain(soil(3), -1.0e4_wp, s, slope)
    call test%check_close('Gardner: S', s, 0.15_wp + 0.85_wp*exp(-1.0_wp), 1.0e-14_wp)
    call conduct(soil(3), -1.0e4_wp, k, slope)
    call test%check_close('Gardner: k_r', k, exp(-2.0_wp), 1.0e-14_wp)
    call retain(soil(4), -1.0e4_wp, s, slope)
    call test%check_close('power: S', s, 1.0_wp - 0.19722_wp*10.0_wp**(-0.2884_wp), 1.0e-12_wp)
    call conduct(soil(4), -1.0e4_wp, k, slope)
    call test%check_close('power: k_r', k, 1.0_wp - 2.207_wp*(1.0_wp - s)**1.0121_wp, 1.0e-14_wp)
    call bear(soil(3), -1.0e4_wp, b, slope)
    call retain(soil(3), -1.0e4_wp, s, slope)
    call test%check_close('Bishop: S p', b, -1.0e4_wp*s, 1.0e-10_wp)
    call bear(soil(2), -4.0e3_wp, b, slope)
    call test%check_close('Bishop: S_e p', b, -4.0e3_wp*0.5_wp**0.8_wp, 1.0e-10_wp)
  end subroutine check_values

  !> The chord meets Mualem's law, and caps its slope by S_e at that of the chord.
  subroutine check_chord()
    real(wp) :: se, s, k(2), slope(2), unused, most, m, suction, inner
    m = 1.0_wp - 1.0_wp/1.7_wp
    suction = (chord**(-1.0_wp/m) - 1.0_wp)**(1.0_wp/1.7_wp)/1.0e-4_wp
    call conduct(soil(1), -suction*(1.0_wp + 1.0e-9_wp), k(1), slope(1))
    call conduct(soil(1), -suction*(1.0_wp - 1.0e-9_wp), k(2), slope(2))
    inner = 1.0_wp - (1.0_wp - chord**(1.0_wp/m))**m
    call test%check_close('chord: meets the law', k(1), sqrt(chord)*inner**2, 1.0e-7_wp)
    call test%check_close('chord: no jump', k(2), k(1), 1.0e-7_wp)
    most = (1.0_wp - k(1))/(1.0_wp - chord)
    call retain(soil(1), -1.0_wp, s, unused)
    se = (s - 0.1_wp)/0.9_wp
    call conduct(soil(1), -1.0_wp, k(1), slope(1))
    call test%check_close('chord: is straight', k(1), 1.0_wp - most*(1.0_wp - se), 1.0e-6_wp)
  end subroutine check_chord

  !> A table passes its points.
  subroutine check_table()
    real(wp) :: s, k, slope
    call retain(soil(5), -3.0e3_wp, s, slope)
    call conduct(soil(5), -1.0e4_wp, k, slope)
    call test%check_close('table: S', s, 0.02_wp + 0.98_wp*0.5_wp, 1.0e-14_wp)
    call test%check_close('table: k_r', k, 0.1_wp, 1.0e-14_wp)
    call retain(soil(5), -5.0e3_wp, s, slope)
    call test%check_close('table: level between equal values', s, 0.51_wp, 1.0e-14_wp)
  end subroutine check_table
end program test_fem_retention
