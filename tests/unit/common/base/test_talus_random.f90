!> Random numbers as hashes: known values, no trace of the key in the numbers, turns over all
!! rotations.
program test_talus_random
  use talus_kinds, only: wp, i4, i8
  use talus_random, only: uniform, unit_number, random_turn
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: many = 100000
  real(wp), parameter :: off = 4.0_wp  !! standard errors that a mean may be off

  call check_values()
  call check_spread()
  call check_turns()
  call test%finish()

contains

  !> The first is that of splitmix64 from the state 0, the others were computed in Python.
  subroutine check_values()
    call test%check_close('key 0', uniform([0_i8]), 0.8833108082136426_wp, 0.0_wp)
    call test%check_close('key 1', uniform([1_i8]), 0.5665615751722809_wp, 0.0_wp)
    call test%check_close('key 1, 2', uniform([1_i8, 2_i8]), 0.7376992526901169_wp, 0.0_wp)
    call test%check_close('key 2, 1', uniform([2_i8, 1_i8]), 0.8766756214195504_wp, 0.0_wp)
    call test%check_close('negative and large', uniform([-3_i8, 7_i8, 2_i8**40]), &
                          0.7846689938461164_wp, 0.0_wp)
    call test%check_close('id 1', unit_number(1_i8, 1_i8), 0.1760125625659424_wp, 0.0_wp)
    call test%check_close('id 2', unit_number(2_i8, 1_i8), 0.4590673121432685_wp, 0.0_wp)
    call test%check_close('id 1000000007', unit_number(1000000007_i8, 1_i8), &
                          0.4958735170765414_wp, 0.0_wp)
  end subroutine check_values

  !> Mean, variance and neighbours: what follows does not know what came before.
  subroutine check_spread()
    real(wp) :: u(many), v(many)
    integer(i4) :: k
    do k = 1, many
      u(k) = uniform([7_i8, int(k, i8)])
      v(k) = uniform([8_i8, int(k, i8)])
    end do
    call test%check('from 0 to 1', minval(u) >= 0.0_wp .and. maxval(u) < 1.0_wp)
    call test%check_close('mean', sum(u)/many, 0.5_wp, off*sqrt(1.0_wp/12.0_wp/many))
    call test%check_close('variance', sum((u - 0.5_wp)**2)/many, 1.0_wp/12.0_wp, &
                          off*sqrt(1.0_wp/180.0_wp/many))
    call test%check_close('neighbours', sum((u(2:) - 0.5_wp)*(u(:many - 1) - 0.5_wp))/many, &
                          0.0_wp, off/12.0_wp/sqrt(real(many, wp)))
    call test%check_close('other seeds', sum((u - 0.5_wp)*(v - 0.5_wp))/many, 0.0_wp, &
                          off/12.0_wp/sqrt(real(many, wp)))
  end subroutine check_spread

  !> Unit quaternions; each component has mean 0 and the square 1/4, no two go together.
  subroutine check_turns()
    real(wp) :: q(4, many), mean(4, 4)
    integer(i4) :: k, i, j
    do k = 1, many
      q(:, k) = random_turn([3_i8, int(k, i8)])
    end do
    call test%check_close('largest length', maxval(sum(q**2, 1)), 1.0_wp, 1.0e-14_wp)
    call test%check_close('least length', minval(sum(q**2, 1)), 1.0_wp, 1.0e-14_wp)
    mean = matmul(q, transpose(q))/many
    do i = 1, 4
      call test%check_close('mean of a component', sum(q(i, :))/many, 0.0_wp, &
                            off*0.5_wp/sqrt(real(many, wp)))
      do j = 1, 4
        call test%check_close('product of components', mean(i, j), merge(0.25_wp, 0.0_wp, i == j), &
                              off*0.25_wp/sqrt(real(many, wp)))
      end do
    end do
  end subroutine check_turns
end program test_talus_random
