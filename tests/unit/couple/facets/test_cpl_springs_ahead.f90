!> Springs ahead of a moving ghost, on a scalar model: a soft wall of stiffness K under a contact
!! of stiffness k, held by springs. Right if errors die out at the rates of the manual (the largest
!! root of the recursion), and if a steady motion meets no springs in the end.
program test_cpl_springs_ahead
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_interface, only: interface_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: wall = 0.013_wp                            !! K over the springs'
  real(wp), parameter :: contact(5) = [0.2_wp, 0.4_wp, 0.67_wp, 1.1_wp, 1.8_wp]  !! k over them
  real(wp), parameter :: rate(5) = [0.94_wp, 0.87_wp, 0.78_wp, 0.81_wp, 0.985_wp]
  real(wp) :: lag, left(2)
  integer(i4) :: k

  do k = 1, size(contact)
    call run(contact(k), 0.0_wp, 40, lag, left(1))
    call run(contact(k), 0.0_wp, 60, lag, left(2))
    call test%check('errors die out', (left(2)/left(1))**0.05_wp < rate(k))
    call run(contact(k), 1.0_wp, 1500, lag, left(1))
    call test%check('no springs hold a steady motion', lag < 1.0e-6_wp)
  end do
  call check_steady()
  call test%finish()

contains

  !> A motion is steady that is small beside the whole, or one like those before it.
  subroutine check_steady()
    type(interface_type) :: face
    allocate (face%motion%w(3, 1), face%motion%w_new(3, 1), face%motion%drift(3, 1), source=0.0_wp)
    face%motion%w_new = 1.0_wp
    face%motion%drift = 0.004_wp
    call test%check('small beside the whole', face%is_steady())
    face%motion%drift = 0.8_wp
    call test%check('not small, without a liquid', .not. face%is_steady())
    face%pore%active = .true.
    call test%check('a quarter more than before', face%is_steady())
    face%motion%drift = 0.7_wp
    call test%check('a load has come', .not. face%is_steady())
  end subroutine check_steady

  !> Exchanges under a load that grows by so much in each; what the springs hold of the motion of
  !! an exchange, and the largest error of the last five.
  subroutine run(k, growth, exchanges, lag, error)
    real(wp), intent(in) :: k, growth
    integer(i4), intent(in) :: exchanges
    real(wp), intent(out) :: lag, error
    type(interface_type) :: face
    real(wp) :: load, before
    integer(i4) :: n

    allocate (face%motion%w(3, 1), face%motion%w_new(3, 1), face%motion%w_spring(3, 1), &
              face%motion%drift(3, 1), face%motion%u(3, 1), source=0.0_wp)
    error = 0.0_wp
    do n = 1, exchanges
      load = 1.0_wp + growth*n
      face%motion%w_new = face%motion%u
      call face%mean_motion()
      call face%lay_springs_ahead()
      before = face%motion%u(1, 1)
      face%motion%u = (load - 0.5_wp*k*(face%motion%w + face%motion%w_new) &
                       + face%motion%w_spring)/(1.0_wp + wall)
      face%motion%w = face%motion%w_new
      if (n > exchanges - 5) error = max(error, abs(face%motion%u(1, 1) - load/(wall + k)))
    end do
    lag = abs(face%motion%w_spring(1, 1) - face%motion%u(1, 1))/max(abs(face%motion%u(1, 1) &
          - before), tiny(1.0_wp))
  end subroutine run
end program test_cpl_springs_ahead
