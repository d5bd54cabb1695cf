!> Laws of drag against the table of reference P14: gradients of beds of spheres of 1 mm in water.
program test_dem_pore_laws
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_pore_laws, only: drag_of, law_index
  implicit none
  type(test_type) :: test
  real(wp), parameter :: viscosity = 1.0e-3_wp, density = 1.0e3_wp, d = 1.0e-3_wp
  real(wp), parameter :: pi = acos(-1.0_wp)

  call check_row(0.36_wp, 1.0e-4_wp, [158.024691358_wp, 131.927297668_wp, 158.257385902_wp, &
                 158.937261609_wp, 4.1770933208e-8_wp])
  call check_row(0.36_wp, 0.05_wp, [79012.345679_wp, 125857.33882_wp, 137185.981654_wp, &
                 135250.39473_wp, 3.8431864749e-5_wp])
  call check_row(0.476_wp, 0.01_wp, [4582.62395418_wp, 4669.1068914_wp, 5114.49289253_wp, &
                 5163.73633133_wp, 1.84504726142e-6_wp])
  call check_row(0.9_wp, 0.001_wp, [2.46913580247_wp, 2.29766803841_wp, 5.19682307339_wp, &
                 4.99632059174_wp, 1.67226972195e-8_wp])
  call test%check('the constant law has its number', law_index('constant') == 1)
  call test%check('no law', law_index('stokes') == 0)
  call test%finish()

contains

  !> Gradients by Kozeny and Carman, Ergun, Koch & Hill, Beetstra [Pa/m]; Di Felice's drag [N].
  subroutine check_row(n, u, wanted)
    real(wp), intent(in) :: n, u, wanted(5)
    character(len=13), parameter :: names(5) = [character(len=13) :: 'kozeny_carman', 'ergun', &
      'koch_hill', 'beetstra', 'di_felice']
    real(wp) :: found
    integer(i4) :: k
    do k = 1, 5
      found = drag_of(law_index(trim(names(k))), n, d, viscosity, density*u*d/viscosity)*u/n**2
      if (k == 5) found = n*found*pi/6.0_wp*d**3/(1.0_wp - n)
      call test%check_close(trim(names(k)), found/wanted(k), 1.0_wp, 1.0e-9_wp)
    end do
  end subroutine check_row
end program test_dem_pore_laws
