!> Points that begin within a run with the stress of grains: what a law bears stays as it is, what
!! it does not goes back to its yield surface, and the state follows stress and density.
program test_fem_law_take_over
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_law, only: common_size, fem_law_type, integrate
  use fem_law_breakage, only: fem_law_breakage_type
  use fem_law_clay, only: fem_law_clay_type
  use fem_law_drucker, only: fem_law_drucker_type
  use fem_law_sanisand, only: fem_law_sanisand_type
  use fem_voigt, only: magnitude, trace, unit
  implicit none
  type(test_type) :: test
  real(wp), parameter :: shape_of(6) = [1.0_wp, -2.0_wp, 1.0_wp, 0.5_wp, 0.0_wp, -0.3_wp]
  real(wp), parameter :: tight = 1.0e-12_wp

  call check_drucker()
  call check_clay()
  call check_sand()
  call check_breakage()
  call test%finish()

contains

  !> Take over a stress; an increment of nothing must leave it where it is.
  subroutine take(law, density, stress, state)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: density
    real(wp), intent(inout) :: stress(6), state(:)
    character(len=:), allocatable :: fault, cure
    real(wp) :: still(6), tangent(6, 6)
    logical :: good
    call law%take_over(density, stress, state, fault, cure)
    call test%check_text(trim(law%name)//': begins', fault, '')
    still = stress
    call integrate(law, 0.0_wp*stress, still, state, tangent, good)
    call test%check(trim(law%name)//': goes on', good)
    call test%check_all_close(trim(law%name)//': as it begins', still - stress, 0.0_wp, &
                              1.0e-6_wp*max_abs(stress) + 1.0e-9_wp)
  end subroutine take

  !> |s| + 0.8 p = 0.9 x 100 Pa.
  subroutine check_drucker()
    type(fem_law_drucker_type) :: law
    real(wp) :: stress(6), state(common_size + 1), s(6)
    call law%define()
    law%bulk = 1.0e7_wp
    law%shear = 6.0e6_wp
    law%cone%a = 0.9_wp
    law%cone%b = 0.8_wp
    law%cone%b_flow = 0.2_wp
    law%cone%cohesion = 100.0_wp
    state = 0.0_wp
    s = shape_of - trace(shape_of)/3.0_wp*unit
    stress = -500.0_wp*unit + 10.0_wp*s
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('inside the cone', stress, -500.0_wp*unit + 10.0_wp*s, tight)
    stress = -500.0_wp*unit + 1.0e3_wp*s
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('back to the cone', stress, -500.0_wp*unit &
      + (90.0_wp + 400.0_wp)/magnitude(s)*s, 1.0e-9_wp)
    stress = 300.0_wp*unit + 10.0_wp*s
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('back to the apex', stress, 112.5_wp*unit, 1.0e-9_wp)
  end subroutine check_drucker

  !> With q = M p the surface goes through 2 p.
  subroutine check_clay()
    type(fem_law_clay_type) :: law
    real(wp), parameter :: s(6) = [0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp]/sqrt(3.0_wp)
    real(wp) :: stress(6), state(common_size + 1), before(6)
    call law%define()
    law%slope = 1.2_wp
    law%swelling = 0.005_wp
    law%plastic = 0.05_wp
    law%ratio = 0.5_wp
    law%overconsolidation = 1.5_wp
    state = 0.0_wp
    before = -100.0_wp*unit + 60.0_wp*s  ! q = 60
    stress = before
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('clay inside', stress, before, tight)
    call test%check_close('its preconsolidation', state(common_size + 1), 1.5_wp*125.0_wp, tight)
    stress = -100.0_wp*unit + 500.0_wp*s
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('to critical state', stress, -100.0_wp*unit + 120.0_wp*s, 1.0e-9_wp)
    call test%check_close('overconsolidated there', state(common_size + 1), 300.0_wp, tight)
    stress = 10.0_wp*unit
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('least pressure, of the one before', stress, -3.0_wp*unit, 1.0e-9_wp)
    law%preconsolidation = 150.0_wp
    stress = -100.0_wp*unit + 120.0_wp*s
    call take(law, 1.0_wp, stress, state)
    call test%check_close('pc grows to the stress', state(common_size + 1), 200.0_wp, tight)
    stress = before
    call take(law, 1.0_wp, stress, state)
    call test%check_close('pc of the deck', state(common_size + 1), 150.0_wp, tight)
  end subroutine check_clay

  !> 1 + e follows the density; triaxial compression on the bounding surface.
  subroutine check_sand()
    type(fem_law_sanisand_type) :: law
    real(wp), parameter :: down(6) = [1.0_wp, 1.0_wp, -2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    real(wp) :: stress(6), state(common_size + 20), psi, most
    call law%define()
    law%void_ratio = 0.8_wp
    law%least_void = 0.64_wp
    associate (sand => law%sand)
      sand%shear = 125.0_wp
      sand%slope = 1.25_wp
      sand%extension = 0.712_wp
      sand%line_void = 0.934_wp
      sand%line_slope = 0.019_wp
      sand%hardening = 7.05_wp
      sand%hardening_void = 0.968_wp
      sand%bounding_rate = 1.1_wp
      sand%dilatancy = 0.704_wp
      sand%dilatancy_rate = 3.5_wp
      sand%residual = 505.0_wp
      sand%least = 50.5_wp
    end associate
    state = 0.0_wp
    stress = -1.0e5_wp*unit + 1.0e4_wp*down
    call take(law, 1.02_wp, stress, state)
    call test%check_all_close('sand inside', stress, -1.0e5_wp*unit + 1.0e4_wp*down, tight)
    call test%check_close('void ratio', state(common_size + 19), 1.8_wp/1.02_wp - 1.0_wp, tight)
    stress = -1.0e5_wp*unit + 1.0e6_wp*down
    call take(law, 1.0_wp, stress, state)
    psi = 0.8_wp - (0.934_wp - 0.019_wp*(100505.0_wp/101.0e3_wp)**0.7_wp)
    most = sqrt(2.0_wp/3.0_wp)*(1.25_wp*exp(-1.1_wp*psi) - 0.01_wp)
    call test%check_close('back to the bounding surface', &
                          magnitude(stress + 1.0e5_wp*unit)/100505.0_wp, most, 2.0e-6_wp)
    stress = 2.0e4_wp*unit
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('no tension', stress, 0.0_wp, 1.0e-9_wp)
  end subroutine check_sand

  !> Isotropic crushing (1 - B)^2 E = E_c: the pressure where it begins; B of before is kept.
  subroutine check_breakage()
    type(fem_law_breakage_type) :: law
    real(wp) :: stress(6), state(common_size + 2), crushing, s(6), q
    call law%define()
    law%bulk = 1.0e7_wp
    law%shear = 6.0e6_wp
    law%slope = 1.2_wp
    law%critical = 1.0e2_wp
    law%index = 0.8_wp
    law%residual = 100.0_wp
    state = 0.0_wp
    state(common_size + 1) = 0.2_wp
    s = shape_of - trace(shape_of)/3.0_wp*unit
    stress = -1.0e4_wp*unit + 10.0_wp*s
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('whole enough', stress, -1.0e4_wp*unit + 10.0_wp*s, tight)
    call test%check_close('breakage is kept', state(common_size + 1), 0.2_wp, tight)
    ! theta K v^2/2 (1 - B)^2 = E_c, p = (1 - theta B) K v
    crushing = 0.84_wp*1.0e7_wp*sqrt(2.0_wp*100.0_wp/(0.8_wp*1.0e7_wp))/0.8_wp
    stress = -2.0_wp*crushing*unit
    call take(law, 1.0_wp, stress, state)
    call test%check_all_close('back to crushing', stress, -crushing*unit, 1.0e-9_wp)
    stress = -1.0e4_wp*unit + 1.0e5_wp*s
    call take(law, 1.0_wp, stress, state)
    q = sqrt(1.5_wp)*magnitude(stress + 1.0e4_wp*unit)
    call test%check_close('the pressure stays', -trace(stress)/3.0_wp, 1.0e4_wp, tight)
    ! 40 halvings of a deviator of 4e5 Pa leave 4e-7 Pa
    call test%check_close('q goes back', q, q_of_yield(1.0e4_wp), 1.0e-6_wp)
  end subroutine check_breakage

  !> q on y = 0 with B = 0.2: E_B (1 - B)^2/E_c + (q/(M (p + p_r)))^2 = 1, E_B by p and q.
  pure real(wp) function q_of_yield(p) result(q)
    real(wp), intent(in) :: p
    real(wp), parameter :: left = 0.84_wp, share = 0.8_wp*0.8_wp**2/1.0e2_wp
    real(wp) :: by_p, by_q
    by_p = 0.5_wp*share*p**2/(left**2*1.0e7_wp)
    by_q = share/(6.0_wp*left**2*6.0e6_wp) + 1.0_wp/(1.2_wp*(p + 100.0_wp))**2
    q = sqrt((1.0_wp - by_p)/by_q)
  end function q_of_yield
end program test_fem_law_take_over
