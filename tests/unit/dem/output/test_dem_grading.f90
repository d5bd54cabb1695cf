!> Gradings: what passes sieves with and without fines; potentials are areas above the curves.
program test_dem_grading
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_grading, only: grading_of, potential_of
  implicit none
  type(test_type) :: test
  real(wp), parameter :: sizes(4) = [1.0e-3_wp, 0.5e-3_wp, 2.0e-3_wp, 0.05e-3_wp]
  real(wp), parameter :: mass(4) = [2.0_wp, 1.0_wp, 4.0_wp, 1.0_wp]
  real(wp), parameter :: fines(2, 2) = reshape([3.0_wp, 0.4e-3_wp, 1.0_wp, 0.2e-3_wp], [2, 2])
  real(wp), parameter :: power = 0.5_wp

  call check_passing()
  call check_area(0.074e-3_wp)
  call check_area(1.0e-6_wp)
  call test%finish()

contains

  subroutine check_passing()
    call test%check_all_close('all', grading_of(sizes, mass, fines, power, 3.0e-3_wp), 1.0_wp, &
                              1.0e-15_wp)
    call test%check_all_close('some', grading_of(sizes, mass, fines, power, 0.6e-3_wp), &
                              [6.0_wp/12.0_wp, 2.0_wp/8.0_wp], 1.0e-15_wp)
    call test%check_all_close('among fines', grading_of(sizes, mass, fines, power, 0.1e-3_wp), &
                              [(1.0_wp + 3.0_wp*0.5_wp + sqrt(0.5_wp))/12.0_wp, 1.0_wp/8.0_wp], &
                              1.0e-14_wp)
  end subroutine check_passing

  !> Area above the curve from the least size up, by the rule of the midpoint.
  subroutine check_area(least)
    real(wp), intent(in) :: least
    real(wp) :: area, passing(2), width
    integer(i4), parameter :: many = 200000
    integer(i4) :: k
    width = log(3.0e-3_wp/least)/many
    area = 0.0_wp
    do k = 1, many
      passing = grading_of(sizes, mass, fines, power, least*exp((k - 0.5_wp)*width))
      area = area + width*(1.0_wp - passing(1))
    end do
    call test%check_close('area', potential_of(sizes, mass, fines, power, least), area, 1.0e-4_wp)
  end subroutine check_area
end program test_dem_grading
