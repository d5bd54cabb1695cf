!> Relaxation on a scalar model: contacts fifty times stiffer than the facet below them.
program test_cpl_relax
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_choices, only: interface_springs, interface_theta, interface_aitken, interface_none
  use cpl_relax, only: relax_type
  use cpl_springs, only: springs_type
  implicit none

  real(wp), parameter :: k_facet = 1.0_wp, ratio = 50.0_wp, force_at_rest = 51.0_wp
  type(test_type) :: test
  real(wp) :: u

  call settle(interface_none, 0.0_wp, 0.0_wp, 20, u)
  call test%check('none diverges', abs(u - 1.0_wp) > 1.0e6_wp)
  call settle(interface_springs, ratio, 0.0_wp, 60, u)
  call test%check_close('springs as stiff as the contact', u, 1.0_wp, 1.0e-12_wp)
  call settle(interface_springs, 2.0_wp*ratio, 0.0_wp, 200, u)
  call test%check_close('springs twice as stiff', u, 1.0_wp, 1.0e-12_wp)
  call settle(interface_springs, 0.5_wp*ratio, 0.0_wp, 200, u)
  call test%check_close('springs half as stiff', u, 1.0_wp, 1.0e-12_wp)
  call settle(interface_springs, 0.25_wp*ratio, 0.0_wp, 200, u)
  call test%check('springs a quarter as stiff diverge', .not. abs(u - 1.0_wp) < 1.0_wp)
  call settle(interface_theta, 0.0_wp, 1.0_wp/(1.0_wp + ratio), 200, u)
  call test%check_close('theta', u, 1.0_wp, 1.0e-12_wp)
  call iterate_aitken(u)
  call test%check_close('Aitken, iterated', u, 1.0_wp, 1.0e-12_wp)
  call go_on()
  call test%finish()

contains

  !> Exchanges with the lagged predictor: the ghost moves from the facet's old to its new place,
  !! its mean force is force_at_rest - k (mean displacement); the facet carries the load.
  subroutine settle(method, stiffness, theta, exchanges, u)
    integer(i4), intent(in) :: method, exchanges
    real(wp), intent(in) :: stiffness, theta
    real(wp), intent(out) :: u
    type(relax_type) :: relax
    type(springs_type) :: springs
    real(wp) :: d, d_new, measured(3, 1), load(3, 1), at(3, 1), pull(3, 1)
    integer(i4) :: n

    call relax%init(method, theta, 3_i4, 1_i4)
    springs%n = 1
    springs%node = reshape([1, 1, 1, 1], [4, 1])
    springs%weight = reshape([0.25_wp, 0.25_wp, 0.25_wp, 0.25_wp], [4, 1])
    springs%each = [stiffness]
    u = 0.0_wp
    d = 0.0_wp
    do n = 1, exchanges
      d_new = u
      measured = force_at_rest - ratio*k_facet*0.5_wp*(d + d_new)
      at = 0.5_wp*(d + d_new)
      call relax%force(measured)
      call springs%force(at - u, pull)
      load = relax%held + pull
      u = (load(1, 1) + stiffness*u)/(k_facet + stiffness)
      d = d_new
    end do
  end subroutine settle

  !> A relaxation whose memory is put back goes on as the other does.
  subroutine go_on()
    type(relax_type) :: first, second
    real(wp) :: measured(3, 1)
    measured = 3.0_wp
    call first%init(interface_aitken, 0.0_wp, 3_i4, 1_i4)
    call first%hold(measured)
    call first%force(2.0_wp*measured)
    call first%force(-measured)
    call second%init(interface_aitken, 0.0_wp, 3_i4, 1_i4)
    call second%hold(first%held)
    second%residual = first%residual
    call second%resume(first%factor, first%begun)
    call first%force(measured)
    call second%force(measured)
    call test%check_all_close('memory put back', first%held - second%held, 0.0_wp, 0.0_wp)
  end subroutine go_on

  !> The ghost follows the facet within the iteration.
  subroutine iterate_aitken(u)
    real(wp), intent(out) :: u
    type(relax_type) :: relax
    real(wp) :: measured(3, 1)
    integer(i4) :: n

    call relax%init(interface_aitken, 0.0_wp, 3_i4, 1_i4)
    u = 0.0_wp
    do n = 1, 8
      measured = force_at_rest - ratio*k_facet*u
      call relax%force(measured)
      u = relax%held(1, 1)/k_facet
    end do
  end subroutine iterate_aitken
end program test_cpl_relax
