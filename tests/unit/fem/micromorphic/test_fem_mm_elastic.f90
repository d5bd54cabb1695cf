!> Elastic law of the micromorphic solid: published stresses and moduli, forces as derivatives of
!! the energy, tangent by differences, objectivity, power, and the limits of simpler solids.
program test_fem_mm_elastic
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_micropolar, only: micropolar_strain, micropolar_stress
  use fem_mm_elastic, only: mm_elastic_type, mm_strain_type, mm_dual_type, mm_stress_type
  use fem_mm_elastic, only: set_moduli, duals, stresses, stored_energy, duals_from_stress
  use fem_mm_motion, only: mm_motion_type, mm_force_type, mm_spatial_type, strains, forces
  use fem_mm_motion, only: elastic_forces, elastic_tangent, pushed, packed_motion, packed_force
  use fem_mm_motion, only: unpacked_motion
  use fem_mm_report, only: strain_form, gradient_form, eigenvalues, energy_warning
  use fem_mm_report, only: micropolar_limit, homogeneous_limit
  use fem_mm_tensor, only: identity, inverse, determinant, leg_one, leg_two, leg_three, fold
  implicit none
  type(test_type) :: test
  real(wp), parameter :: displacement_gradient(9) = [ &
    -1.07901185_wp, -1.09656192_wp, -0.04629144_wp, -0.77749189_wp, -1.27877771_wp, &
    -0.82648234_wp, 0.66484637_wp, -0.05552567_wp, -1.65125738_wp]
  real(wp), parameter :: micro(9) = [ &
    -1.40391532_wp, -0.42715691_wp, 0.75393369_wp, 0.2849511_wp, -2.06484257_wp, &
    -0.52190902_wp, 1.07238446_wp, 0.19155907_wp, -0.39704566_wp]
  real(wp), parameter :: micro_gradient(27) = [ &
    0.14940184_wp, 0.12460812_wp, 0.31971128_wp, 0.67550862_wp, 0.61095383_wp, 0.87972732_wp, &
    0.30872424_wp, 0.32158187_wp, 0.25480281_wp, 0.45570006_wp, 0.69090695_wp, 0.72388584_wp, &
    0.14880964_wp, 0.67520596_wp, 0.15106516_wp, 0.77810545_wp, 0.07641724_wp, 0.09367471_wp, &
    0.15905979_wp, 0.0651695_wp, 0.52150417_wp, 0.91873444_wp, 0.5622355_wp, 0.50199447_wp, &
    0.26729942_wp, 0.89858519_wp, 0.09043229_wp]
  real(wp), parameter :: consistent_s(9) = [ &
    -34.9050076642_wp, 99.3588415488_wp, 135.854796427_wp, -57.4274690109_wp, &
    140.660274547_wp, 183.42580874_wp, -40.1845667499_wp, 126.9304566_wp, 147.288873518_wp]
  real(wp), parameter :: consistent_sigma(9) = [ &
    -63.8296950811_wp, 34.4697940079_wp, 96.1942470643_wp, 34.4697940079_wp, &
    284.388117504_wp, 309.459049177_wp, 96.1942470643_wp, 309.459049177_wp, 306.067535083_wp]
  real(wp), parameter :: consistent_m(27) = [ &
    -50.3728305411_wp, -23.2577814919_wp, -37.9296307744_wp, -19.1696218823_wp, &
    -32.9727922766_wp, -14.8910449704_wp, -33.4026236996_wp, -15.4794777918_wp, &
    -40.3146099377_wp, -16.2963743638_wp, -36.63942799_wp, -18.227772964_wp, &
    -39.3354666064_wp, -86.6947243873_wp, -59.2915014571_wp, -15.7648016396_wp, &
    -55.420397682_wp, -35.0972011822_wp, -28.9439450341_wp, -17.9672608205_wp, &
    -45.0973417571_wp, -16.4656841629_wp, -50.79898863_wp, -39.1912918281_wp, &
    -47.4637272386_wp, -42.9820147243_wp, -45.5786488348_wp]
  real(wp), parameter :: consistent_cauchy(9) = [ &
    166.276843746_wp, 153.999301714_wp, 173.066421665_wp, 219.627537067_wp, 204.589364004_wp, &
    215.074715316_wp, 23.7737519279_wp, 13.2594967968_wp, 13.8379103665_wp]
  real(wp), parameter :: consistent_micro(9) = [ &
    334.639351705_wp, 368.740920586_wp, 201.234327146_wp, 368.740920586_wp, 416.857902929_wp, &
    231.831618767_wp, 201.234327146_wp, 231.831618767_wp, 34.3264461483_wp]
  real(wp), parameter :: consistent_higher(27) = [ &
    10.1924409842_wp, 131.600160126_wp, -110.930468133_wp, 10.769733317_wp, 128.884206093_wp, &
    -105.038434861_wp, -2.78203388072_wp, 24.3506428402_wp, -12.8718695679_wp, &
    8.44400137551_wp, 121.979627829_wp, -107.10539511_wp, -6.60681638574_wp, &
    137.139893881_wp, -206.153256847_wp, 2.8786065055_wp, 18.880553084_wp, -9.01596663676_wp, &
    -7.4494124109_wp, 27.1184392292_wp, -13.9941442842_wp, -2.15178961805_wp, &
    25.7846181225_wp, -7.90066657288_wp, 10.8116878557_wp, 11.0795762542_wp, &
    -17.5397652142_wp]
  real(wp), parameter :: reduced_s(9) = [ &
    -8.62630503877_wp, 5.04552169775_wp, -7.32153693941_wp, 11.6565339925_wp, &
    -4.66549355145_wp, 9.77346408061_wp, 8.71956023712_wp, -4.60321058672_wp, &
    -13.3885271156_wp]
  real(wp), parameter :: reduced_sigma(9) = [ &
    -11.2722898302_wp, 9.24047716015_wp, 1.9220406853_wp, 9.24047716015_wp, &
    -6.26341869218_wp, 4.27303733033_wp, 1.9220406853_wp, 4.27303733033_wp, -15.2872661842_wp]
  real(wp), parameter :: reduced_cauchy(9) = [ &
    -3.50017688972_wp, 14.2673353068_wp, -2.10106730631_wp, -1.45166417438_wp, &
    -7.93036226064_wp, -10.2927282527_wp, -5.67542764669_wp, 4.22305318537_wp, &
    -9.27497171941_wp]
  real(wp), parameter :: reduced_micro(9) = [ &
    -4.91468956683_wp, 7.92975293768_wp, -3.38234139992_wp, 7.92975293768_wp, &
    -8.18154959991_wp, -2.57226841329_wp, -3.38234139992_wp, -2.57226841329_wp, &
    -11.8993180236_wp]
  integer(i4), parameter :: table_a(81) = [ &
    18, 0, 0, 0, 4, 0, 0, 0, 4, 0, 7, 0, 7, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 7, 0, 0, 0, 7, &
    0, 7, 0, 0, 0, 0, 0, 4, 0, 0, 0, 18, 0, 0, 0, 4, 0, 0, 0, 0, 0, 7, 0, 7, 0, 0, 0, 7, 0, &
    0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 7, 0, 7, 0, 4, 0, 0, 0, 4, 0, 0, 0, 18]
  integer(i4), parameter :: table_b(81) = [ &
    4, 0, 0, 0, -2, 0, 0, 0, -2, 0, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 4, 0, 0, 0, 4, &
    0, 2, 0, 0, 0, 0, 0, -2, 0, 0, 0, 4, 0, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 4, 0, 0, 0, 4, 0, &
    0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 4, 0, 2, 0, -2, 0, 0, 0, -2, 0, 0, 0, 4]
  integer(i4), parameter :: table_c(729) = [ &
    97, 0, 0, 0, 13, 0, 0, 0, 13, 0, 16, 0, 9, 0, 0, 0, 0, 0, 0, 0, 16, 0, 0, 0, 9, 0, 0, 0, &
    23, 0, 22, 0, 0, 0, 0, 0, 23, 0, 0, 0, 9, 0, 0, 0, 2, 0, 0, 0, 0, 0, 3, 0, 4, 0, 0, 0, &
    23, 0, 0, 0, 22, 0, 0, 0, 0, 0, 0, 0, 4, 0, 3, 0, 23, 0, 0, 0, 2, 0, 0, 0, 9, 0, 22, 0, &
    27, 0, 0, 0, 0, 0, 26, 0, 0, 0, 16, 0, 0, 0, 6, 0, 0, 0, 0, 0, 7, 0, 3, 0, 13, 0, 0, 0, &
    23, 0, 0, 0, 5, 0, 26, 0, 23, 0, 0, 0, 0, 0, 0, 0, 6, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 8, &
    0, 10, 0, 0, 0, 11, 0, 0, 0, 9, 0, 0, 0, 9, 0, 12, 0, 0, 0, 0, 0, 0, 0, 22, 0, 0, 0, 27, &
    0, 0, 0, 0, 0, 0, 0, 3, 0, 7, 0, 26, 0, 0, 0, 6, 0, 0, 0, 16, 0, 0, 0, 0, 0, 10, 0, 8, 0, &
    0, 0, 9, 0, 0, 0, 12, 0, 0, 0, 11, 0, 9, 0, 0, 0, 0, 0, 13, 0, 0, 0, 5, 0, 0, 0, 23, 0, &
    6, 0, 2, 0, 0, 0, 0, 0, 0, 0, 26, 0, 0, 0, 23, 0, 0, 0, 23, 0, 26, 0, 0, 0, 0, 0, 23, 0, &
    0, 0, 13, 0, 0, 0, 5, 0, 0, 0, 0, 0, 6, 0, 2, 0, 16, 0, 0, 0, 26, 0, 0, 0, 6, 0, 27, 0, &
    22, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 11, 0, 9, 0, 0, 0, 8, 0, 0, &
    0, 10, 0, 0, 0, 12, 0, 9, 0, 0, 0, 0, 0, 9, 0, 0, 0, 23, 0, 0, 0, 2, 0, 22, 0, 23, 0, 0, &
    0, 0, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 9, 0, 16, 0, 0, 0, 0, 0, 13, 0, 0, 0, 97, 0, 0, 0, &
    13, 0, 0, 0, 0, 0, 16, 0, 9, 0, 0, 0, 4, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 23, 0, 22, 0, &
    2, 0, 0, 0, 23, 0, 0, 0, 9, 0, 0, 0, 0, 0, 9, 0, 12, 0, 0, 0, 10, 0, 0, 0, 8, 0, 0, 0, 9, &
    0, 11, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 22, 0, 27, 0, 6, 0, 0, 0, &
    26, 0, 0, 0, 16, 0, 2, 0, 6, 0, 0, 0, 0, 0, 5, 0, 0, 0, 13, 0, 0, 0, 23, 0, 0, 0, 0, 0, &
    26, 0, 23, 0, 0, 0, 23, 0, 0, 0, 26, 0, 0, 0, 0, 0, 0, 0, 2, 0, 6, 0, 23, 0, 0, 0, 5, 0, &
    0, 0, 13, 0, 0, 0, 0, 0, 9, 0, 11, 0, 0, 0, 12, 0, 0, 0, 9, 0, 0, 0, 8, 0, 10, 0, 0, 0, &
    0, 0, 16, 0, 0, 0, 6, 0, 0, 0, 26, 0, 7, 0, 3, 0, 0, 0, 0, 0, 0, 0, 27, 0, 0, 0, 22, 0, &
    0, 0, 0, 0, 0, 0, 12, 0, 9, 0, 0, 0, 9, 0, 0, 0, 11, 0, 0, 0, 10, 0, 8, 0, 0, 0, 0, 0, 0, &
    0, 2, 0, 0, 0, 6, 0, 0, 0, 0, 0, 0, 0, 23, 0, 26, 0, 5, 0, 0, 0, 23, 0, 0, 0, 13, 0, 3, &
    0, 7, 0, 0, 0, 0, 0, 6, 0, 0, 0, 16, 0, 0, 0, 26, 0, 0, 0, 0, 0, 27, 0, 22, 0, 9, 0, 0, &
    0, 2, 0, 0, 0, 23, 0, 3, 0, 4, 0, 0, 0, 0, 0, 0, 0, 22, 0, 0, 0, 23, 0, 0, 0, 4, 0, 3, 0, &
    0, 0, 0, 0, 2, 0, 0, 0, 9, 0, 0, 0, 23, 0, 0, 0, 0, 0, 22, 0, 23, 0, 0, 0, 9, 0, 0, 0, &
    16, 0, 0, 0, 0, 0, 0, 0, 9, 0, 16, 0, 13, 0, 0, 0, 13, 0, 0, 0, 97]
  integer(i4), parameter :: table_d(81) = [ &
    13, 0, 0, 0, 5, 0, 0, 0, 5, 0, 4, 0, 4, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0, 4, &
    0, 4, 0, 0, 0, 0, 0, 5, 0, 0, 0, 13, 0, 0, 0, 5, 0, 0, 0, 0, 0, 4, 0, 4, 0, 0, 0, 4, 0, &
    0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 4, 0, 4, 0, 5, 0, 0, 0, 5, 0, 0, 0, 13]
  real(wp), parameter :: tardigrade(18) = [1.7_wp, 1.8_wp, 2.8_wp, 0.76_wp, 0.15_wp, 9.8_wp, &
    5.4_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp, 7.0_wp, 8.0_wp, 9.0_wp, 10.0_wp, &
    11.0_wp]
  real(wp), parameter :: isbuga(18) = [29.0_wp, 7.0_wp, 60.0_wp, 10.0_wp, 10.0_wp, 8.0_wp, 5.0_wp, &
    0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 8.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  logical, parameter :: form(2) = [.false., .true.]
  integer(i4) :: k

  call check_published(set_moduli(tardigrade, .false.), consistent_s, consistent_sigma, &
                       consistent_cauchy, consistent_micro)
  call check_published(set_moduli(tardigrade, .true.), reduced_s, reduced_sigma, reduced_cauchy, &
                       reduced_micro)
  call check_couples()
  call check_tables()
  call check_energy()
  do k = 1, 2
    call check_tangent(set_moduli(tardigrade, form(k)), .not. form(k))
    call check_tangent(set_moduli(isbuga, form(k)), .not. form(k))
    call check_objectivity(set_moduli(tardigrade, form(k)))
    call check_power(set_moduli(tardigrade, form(k)))
  end do
  call check_inverse_map()
  call check_stvk()
  call check_micropolar()
  call check_reports()
  call test%finish()

contains

  !> The state of the reference: far from the identity, not symmetric, all components differ.
  pure function far_state() result(motion)
    type(mm_motion_type) :: motion
    motion%f = identity + matrix(displacement_gradient)
    motion%chi = identity + matrix(micro)
    motion%g = cube(micro_gradient)
  end function far_state

  !> A moderate state.
  pure function near_state() result(motion)
    type(mm_motion_type) :: motion
    motion%f = identity + 0.1_wp*matrix(displacement_gradient)
    motion%chi = identity - 0.1_wp*matrix(micro)
    motion%g = cube(micro_gradient)
  end function near_state

  pure function matrix(v) result(a)
    real(wp), intent(in) :: v(9)
    real(wp) :: a(3, 3)
    a = transpose(reshape(v, [3, 3]))
  end function matrix

  pure function cube(v) result(a)
    real(wp), intent(in) :: v(27)
    real(wp) :: a(3, 3, 3)
    a = reshape(v, [3, 3, 3], order=[3, 2, 1])
  end function cube

  !> Second-order stresses of the reference, twelve digits of which are printed there.
  subroutine check_published(law, s, sigma, cauchy, small)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(in) :: s(9), sigma(9), cauchy(9), small(9)
    type(mm_stress_type) :: stress
    type(mm_spatial_type) :: spatial
    type(mm_strain_type) :: strain
    strain = strains(far_state())
    stress = stresses(law, strain, duals(law, strain))
    spatial = pushed(far_state(), stress)
    call close_to('S', reshape(stress%s - matrix(s), [9]), s)
    call close_to('Sigma', reshape(stress%sigma - matrix(sigma), [9]), sigma)
    call close_to('Cauchy stress', reshape(spatial%sigma - matrix(cauchy), [9]), cauchy)
    call close_to('micro-stress', reshape(spatial%s - matrix(small), [9]), small)
  end subroutine check_published

  subroutine close_to(name, error, wanted)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: error(:), wanted(:)
    call test%check_close(name//', error / largest', max_abs(error)/max_abs(wanted), &
                          0.0_wp, 1.0e-11_wp)
  end subroutine close_to

  subroutine check_couples()
    type(mm_elastic_type) :: law
    type(mm_stress_type) :: stress
    type(mm_spatial_type) :: spatial
    type(mm_strain_type) :: strain
    law = set_moduli(tardigrade, .false.)
    strain = strains(far_state())
    stress = stresses(law, strain, duals(law, strain))
    spatial = pushed(far_state(), stress)
    call close_to('M', reshape(stress%m - cube(consistent_m), [27]), consistent_m)
    call close_to('couple stress', reshape(spatial%m - cube(consistent_higher), [27]), &
                  consistent_higher)
  end subroutine check_couples

  !> A, B, C and D of small integers, as published.
  subroutine check_tables()
    type(mm_elastic_type) :: law
    type(mm_strain_type) :: strain
    type(mm_dual_type) :: dual
    real(wp) :: a(81), b(81), c(729), d(81), unit(9)
    integer(i4) :: n
    law = set_moduli([4.0_wp, 7.0_wp, 3.0_wp, 5.0_wp, 6.0_wp, 8.0_wp, 4.0_wp, 2.0_wp, 3.0_wp, &
      4.0_wp, 5.0_wp, 6.0_wp, 7.0_wp, 8.0_wp, 9.0_wp, 10.0_wp, 11.0_wp, 12.0_wp], .false.)
    c = reshape(transpose(ordered(gradient_form(law))), [729])
    call test%check_all_close('C', c, real(table_c, wp), 0.0_wp)
    do n = 1, 9
      unit = 0.0_wp
      unit(n) = 1.0_wp
      strain%c = identity
      strain%psi = identity + matrix(unit)
      dual = duals(law, strain)
      b(n::9) = reshape(transpose(dual%p), [9])
      d(n::9) = reshape(transpose(dual%e), [9])
      strain%c = identity + 2.0_wp*matrix(unit)
      strain%psi = identity
      dual = duals(law, strain)
      a(n::9) = reshape(transpose(dual%e + transpose(dual%e)), [9])/2.0_wp
    end do
    call test%check_all_close('B', b, real(table_b, wp), 0.0_wp)
    call test%check_all_close('D', d, real(table_d, wp), 0.0_wp)
    call test%check_all_close('A, symmetric part', a, real(table_a, wp), 0.0_wp)
  end subroutine check_tables

  !> Rows and columns with the last index running fastest.
  pure function ordered(c) result(d)
    real(wp), intent(in) :: c(27, 27)
    real(wp) :: d(27, 27)
    integer(i4) :: place(27), n
    place = reshape(reshape([(n, n=1, 27)], [3, 3, 3], order=[3, 2, 1]), [27])
    do n = 1, 27
      d(place(n), place) = c(n, :)
    end do
  end function ordered

  !> P, Q and R are the derivatives of the energy; of a polynomial of degree four, so that the
  !! five-point difference is exact but for rounding.
  subroutine check_energy()
    type(mm_elastic_type) :: law
    real(wp) :: found(45), wanted(45), x(45), w(4)
    real(wp), parameter :: h = 0.01_wp
    integer(i4) :: n
    law = set_moduli(tardigrade, .false.)
    wanted = packed_force(elastic_forces(law, far_state()))
    do n = 1, 45
      x = packed_motion(far_state())
      x(n) = x(n) - 2.0_wp*h
      w(1) = energy_at(law, x)
      x(n) = x(n) + h
      w(2) = energy_at(law, x)
      x(n) = x(n) + 2.0_wp*h
      w(3) = energy_at(law, x)
      x(n) = x(n) + h
      w(4) = energy_at(law, x)
      found(n) = (w(1) - 8.0_wp*w(2) + 8.0_wp*w(3) - w(4))/(12.0_wp*h)
    end do
    call test%check_close('forces against the energy', &
      max_abs(found - wanted)/max_abs(wanted), 0.0_wp, 1.0e-11_wp)
  end subroutine check_energy

  pure real(wp) function energy_at(law, x)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(in) :: x(45)
    energy_at = stored_energy(law, strains(unpacked_motion(x)))
  end function energy_at

  !> Tangent against five-point differences (truncation ~ h^4) and its transpose.
  subroutine check_tangent(law, consistent)
    type(mm_elastic_type), intent(in) :: law
    logical, intent(in) :: consistent
    type(mm_force_type) :: force
    real(wp) :: tangent(45, 45), found(45, 45), x(45), f(45, 4)
    real(wp), parameter :: h = 1.0e-3_wp, move(4) = [-2.0_wp, -1.0_wp, 1.0_wp, 2.0_wp]
    integer(i4) :: n, i
    call elastic_tangent(law, near_state(), force, tangent)
    call test%check_all_close('forces with and without tangent', &
      packed_force(force), packed_force(elastic_forces(law, near_state())), &
      0.0_wp)
    do n = 1, 45
      do i = 1, 4
        x = packed_motion(near_state())
        x(n) = x(n) + move(i)*h
        f(:, i) = packed_force(elastic_forces(law, unpacked_motion(x)))
      end do
      found(:, n) = (f(:, 1) - 8.0_wp*f(:, 2) + 8.0_wp*f(:, 3) - f(:, 4))/(12.0_wp*h)
    end do
    call test%check_close('tangent against differences', &
      max_abs(found - tangent)/max_abs(tangent), 0.0_wp, 1.0e-9_wp)
    if (.not. consistent) return
    call test%check_close('tangent of an energy is symmetric', &
      max_abs(tangent - transpose(tangent))/max_abs(tangent), 0.0_wp, 1.0e-14_wp)
  end subroutine check_tangent

  !> A rotation of everything turns the spatial stresses and leaves energy and S as they are.
  subroutine check_objectivity(law)
    type(mm_elastic_type), intent(in) :: law
    type(mm_motion_type) :: here, there
    type(mm_spatial_type) :: a, b
    type(mm_stress_type) :: s, t
    real(wp) :: q(3, 3)
    q = rotation([0.7_wp, -1.9_wp, 0.4_wp])
    here = far_state()
    there%f = matmul(q, here%f)
    there%chi = matmul(q, here%chi)
    there%g = leg_one(q, here%g)
    s = stresses(law, strains(here), duals(law, strains(here)))
    t = stresses(law, strains(there), duals(law, strains(there)))
    a = pushed(here, s)
    b = pushed(there, t)
    call test%check_close('S does not turn', max_abs(s%s - t%s)/max_abs(s%s), 0.0_wp, &
                          1.0e-12_wp)
    call test%check_close('sigma turns', max_abs(matmul(q, matmul(a%sigma, transpose(q))) &
      - b%sigma)/max_abs(a%sigma), 0.0_wp, 1.0e-12_wp)
    call test%check_close('m turns', max_abs(leg_three(q, leg_two(q, leg_one(q, a%m))) - b%m) &
      /max_abs(a%m), 0.0_wp, 1.0e-12_wp)
    call test%check_close('energy stays', stored_energy(law, strains(there)) &
      /stored_energy(law, strains(here)), 1.0_wp, 1.0e-12_wp)
  end subroutine check_objectivity

  !> Rotation about a vector by its length (Rodrigues).
  pure function rotation(v) result(q)
    real(wp), intent(in) :: v(3)
    real(wp) :: q(3, 3), w(3, 3), angle
    angle = norm2(v)
    w = reshape([0.0_wp, v(3), -v(2), -v(3), 0.0_wp, v(1), v(2), -v(1), 0.0_wp], [3, 3])/angle
    q = identity + sin(angle)*w + (1.0_wp - cos(angle))*matmul(w, w)
  end function rotation

  !> J [sigma:l + (s - sigma):nu + m:grad nu] is the power of P, Q and R.
  subroutine check_power(law)
    type(mm_elastic_type), intent(in) :: law
    type(mm_motion_type) :: state
    type(mm_spatial_type) :: spatial
    type(mm_strain_type) :: strain
    real(wp) :: rate(45), l(3, 3), nu(3, 3), g(3, 3, 3), power
    real(wp), dimension(3, 3) :: back, micro_back
    type(mm_motion_type) :: d
    integer(i4) :: n, i, j, k
    state = far_state()
    rate = [(sin(1.0_wp + 2.3_wp*n), n=1, 45)]
    d = unpacked_motion(rate)
    strain = strains(state)
    spatial = pushed(state, stresses(law, strain, duals(law, strain)))
    back = inverse(state%f)
    micro_back = inverse(state%chi)
    l = matmul(d%f, back)
    nu = matmul(d%chi, micro_back)
    ! nu_jk,i = (chi'_jK,I - nu_jm chi_mK,I) chi^-1_Kk F^-1_Ii
    g = leg_three(transpose(back), leg_two(transpose(micro_back), d%g - leg_one(nu, state%g)))
    power = 0.0_wp
    do k = 1, 3
      do j = 1, 3
        power = power + spatial%sigma(k, j)*l(j, k) &
          + (spatial%s(k, j) - spatial%sigma(k, j))*nu(j, k)
        do i = 1, 3
          power = power + spatial%m(i, j, k)*g(j, k, i)
        end do
      end do
    end do
    power = power*determinant(state%f)
    call test%check_close('power', sum(packed_force(elastic_forces(law, state))*rate)/power, &
                          1.0_wp, 1.0e-12_wp)
  end subroutine check_power

  !> The conjugates found from the stresses are those that made them.
  subroutine check_inverse_map()
    type(mm_elastic_type) :: law
    type(mm_strain_type) :: strain
    type(mm_dual_type) :: a, b
    law = set_moduli(tardigrade, .false.)
    strain = strains(far_state())
    a = duals(law, strain)
    b = duals_from_stress(strain, stresses(law, strain, a))
    call test%check_close('P^ from stresses', max_abs(a%p - b%p)/max_abs(a%p), 0.0_wp, &
                          1.0e-12_wp)
    call test%check_close('E^ from stresses', max_abs(a%e - b%e)/max_abs(a%e), 0.0_wp, &
                          1.0e-12_wp)
    call test%check_all_close('G^ from stresses', a%g, b%g, 0.0_wp)
  end subroutine check_inverse_map

  !> With lambda and mu alone: St. Venant-Kirchhoff, uniaxial stress at a stretch of 0.99.
  subroutine check_stvk()
    type(mm_elastic_type) :: law
    type(mm_motion_type) :: state
    type(mm_spatial_type) :: spatial
    type(mm_force_type) :: force
    type(mm_strain_type) :: strain
    real(wp) :: moduli(18)
    real(wp), parameter :: young = 165.0_wp, poisson = 0.39_wp, area = 19.634954084936208_wp
    moduli = 0.0_wp
    moduli(1) = young*poisson/((1.0_wp + poisson)*(1.0_wp - 2.0_wp*poisson))
    moduli(2) = young/(2.0_wp*(1.0_wp + poisson))
    law = set_moduli(moduli, .false.)
    state%f(3, 3) = 0.99_wp
    state%f(1, 1) = sqrt(1.0_wp - poisson*(0.99_wp**2 - 1.0_wp))
    state%f(2, 2) = state%f(1, 1)
    strain = strains(state)
    spatial = pushed(state, stresses(law, strain, duals(law, strain)))
    force = elastic_forces(law, state)
    call test%check_close('lateral stretch', state%f(1, 1), 1.00387299994_wp, 1.0e-11_wp)
    call test%check_close('axial Cauchy stress', spatial%sigma(3, 3), -1.61281543938_wp, 1.0e-10_wp)
    call test%check_close('no lateral stress', spatial%sigma(1, 1), 0.0_wp, 1.0e-12_wp)
    call test%check_close('axial force', force%p(3, 3)*area, -31.9133290103_wp, 1.0e-8_wp)
    call test%check_all_close('no micro-force', force%q, 0.0_wp, 0.0_wp)
  end subroutine check_stvk

  !> Small strains with chi a rotation: Eringen's law, to the second order of the strains.
  subroutine check_micropolar()
    type(mm_elastic_type) :: law
    type(mm_motion_type) :: state
    type(mm_stress_type) :: stress
    type(mm_strain_type) :: strain
    real(wp) :: phi(3), curvature(3, 3), sigma(9), couples(9), found(9), axis(3, 3, 3)
    real(wp), parameter :: small = 1.0e-7_wp
    integer(i4) :: i, j, n
    law = set_moduli(tardigrade, .false.)
    phi = small*[0.3_wp, -0.8_wp, 0.5_wp]
    curvature = small*matrix(micro)
    axis = 0.0_wp
    do n = 1, 3
      i = mod(n, 3) + 1
      j = mod(n + 1, 3) + 1
      axis(i, j, n) = 1.0_wp
      axis(j, i, n) = -1.0_wp
    end do
    state%f = identity + small*matrix(displacement_gradient)
    state%chi = rotation(phi)
    do n = 1, 3  ! chi_iK = -e_iKM phi_M
      state%g(:, :, n) = -(axis(:, :, 1)*curvature(1, n) + axis(:, :, 2)*curvature(2, n) &
                           + axis(:, :, 3)*curvature(3, n))
    end do
    strain = strains(state)
    stress = stresses(law, strain, duals(law, strain))
    call micropolar_stress(micropolar_limit(law), &
      micropolar_strain(small*matrix(displacement_gradient), phi), curvature, sigma, couples)
    call test%check_close('stress of Eringen', max_abs(matrix(sigma) - stress%s) &
      /max_abs(sigma), 0.0_wp, 2.0e-6_wp)
    do n = 1, 9  ! couple stress m_kl from M_kij: the power of phi_l,k is -e_ijl M_kij
      i = (n - 1)/3 + 1
      j = mod(n - 1, 3) + 1
      found(n) = -sum(axis(:, :, j)*stress%m(i, :, :))
    end do
    call test%check_close('couple stress of Eringen', max_abs(found - couples) &
      /max_abs(couples), 0.0_wp, 2.0e-6_wp)
  end subroutine check_micropolar

  !> Eigenvalues, warnings, and what a free homogeneous chi leaves of the moduli.
  subroutine check_reports()
    type(mm_elastic_type) :: law
    real(wp) :: value(15), of_gradient(27), found(2), moduli(18)
    law = set_moduli(isbuga, .false.)
    value = eigenvalues(strain_form(law))
    of_gradient = eigenvalues(gradient_form(law))
    call test%check('a positive energy has no warning', len(energy_warning(law)) == 0)
    call test%check('positive eigenvalues', all(value > 0.0_wp))
    call test%check_close('skew part of e: kappa - nu', minval(abs(value - 2.0_wp)), 0.0_wp, &
                          1.0e-12_wp)
    call test%check_all_close('tau_7 alone', of_gradient, 8.0_wp, 1.0e-12_wp)
    moduli = 0.0_wp
    moduli(:7) = [29480.0_wp, 25480.0_wp, 1000.0_wp, 400.0_wp, -1500.0_wp, -1400.0_wp, -3000.0_wp]
    moduli(14) = 1.0e6_wp
    law = set_moduli(moduli, .false.)
    call test%check('kappa below nu is named', index(energy_warning(law), &
      'kappa > nu is violated by 100') > 0)
    call test%check('with the eigenvalue', index(energy_warning(law), 'in E and e -100') > 0)
    found = homogeneous_limit(law)
    call test%check_close('effective modulus of Young', &
      9.0_wp*found(1)*found(2)/(3.0_wp*found(2) + found(1)), 51499.0_wp, 0.5_wp)
    moduli(14) = -1.0_wp
    call test%check('a negative gradient modulus is named', index(energy_warning( &
      set_moduli(moduli, .false.)), 'in Gamma -1') > 0)
    law = set_moduli(tardigrade, .false.)
    of_gradient = eigenvalues(gradient_form(law))
    call test%check('of the published moduli the gradient form is not definite', &
                    of_gradient(1) < 0.0_wp)
  end subroutine check_reports
end program test_fem_mm_elastic
