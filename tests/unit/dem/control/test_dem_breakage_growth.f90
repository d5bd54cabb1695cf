!> Growth of fragments: masses and sizes of its end, its way in time, a grain that breaks amid it.
program test_dem_breakage_growth
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: test_type
  use dem_breakage_growth, only: plan_growth, growth_due, growth_factor, grown_diameter, &
    left_to_grow
  use dem_state, only: dem_data_type, dem_grains_type, grown_size
  implicit none
  type(test_type) :: test
  real(wp), parameter :: span = 2.0e-3_wp, born = 5.0e-3_wp, size(3) = [0.5_wp, 0.4_wp, 0.3_wp]
  real(wp), parameter :: volume = 0.125_wp + 0.064_wp + 0.027_wp
  type(dem_data_type) :: d
  type(dem_grains_type) :: entering
  real(wp) :: factor(3), jump, strength_size(3)
  integer(i4) :: k

  call make_spheres([1.0_wp], [7_i8], d%grains)
  allocate (d%growing(grown_size, 0))
  call make_spheres(size, [8_i8, 9_i8, 10_i8], entering)
  call plan_growth(d, 1_i4, 1_i4, 3_i4, born, entering)
  call test%check_close('to the volume of the grain', growth_factor(1.0_wp, size**3), &
                        volume**(-1.0_wp/3.0_wp), 1.0e-15_wp)
  call test%check_close('mass of the grain', sum(entering%mass), 1.0_wp, 1.0e-15_wp)
  call test%check_all_close('inertia of the end', entering%inertia(1, :), &
    0.4_wp*entering%mass*(size*volume**(-1.0_wp/3.0_wp))**2, 1.0e-15_wp)

  d%grains = entering
  strength_size = [(grown_diameter(d, k), k=1, 3)]
  call test%check_all_close('sizes that strengths follow', strength_size, &
                            2.0_wp*size*volume**(-1.0_wp/3.0_wp), 1.0e-15_wp)
  call grow_to(born, 0.0_wp)
  call grow_to(born + 0.25_wp*span, 0.25_wp)
  call grow_to(born + 0.75_wp*span, 0.5_wp)
  call test%check_all_close('three quarters of the way', d%grains%axes(1, :), &
    size*(1.0_wp + 0.75_wp*(volume**(-1.0_wp/3.0_wp) - 1.0_wp)), 1.0e-15_wp)
  call test%check('strengths do not follow growth, to the bit', &
                  all(abs(strength_size - [(grown_diameter(d, k), k=1, 3)]) <= 0.0_wp))
  call break_first()
  call grow_to(born + 3.0_wp*span, 0.25_wp)
  call test%check_close('volume of the end', sum(d%grains%axes(1, :)**3), 1.0_wp, 1.0e-14_wp)
  call test%check_close('nothing is left', left_to_grow(d, 8_i8), 1.0_wp, 0.0_wp)
  call grow_to(born + 4.0_wp*span, 0.0_wp)
  call make_spheres([1.0_wp], [9_i8], d%grains)
  call growth_due(d, born + 5.0_wp*span, [span], factor(:1), jump)
  call test%check('rows of grains that left are gone', ubound(d%growing, 2) == 1)
  call test%finish()

contains

  !> All fragments as they are at a time; by which part they have grown.
  subroutine grow_to(time, part)
    real(wp), intent(in) :: time, part
    call growth_due(d, time, [span], factor, jump)
    d%grains%axes = d%grains%axes*spread(factor, 1, 3)
    call test%check_close('part of the growth', jump, part, 1.0e-12_wp)
  end subroutine grow_to

  !> The first breaks amid its growth: its fragments will have the volume that it would have had.
  subroutine break_first()
    type(dem_data_type) :: other
    type(dem_grains_type) :: second
    real(wp) :: whole, mass
    other = d
    whole = (0.5_wp*strength_size(1))**3
    mass = other%grains%mass(1)
    call make_spheres(other%grains%axes(1, 1)*[0.6_wp, 0.3_wp], [11_i8, 12_i8], second)
    call plan_growth(other, 1_i4, 1_i4, 2_i4, born + span, second)
    call test%check_close('mass of the second generation', sum(second%mass), mass, 1.0e-14_wp)
    other%grains = second
    call test%check_close('its volume', sum([(grown_diameter(other, k)**3, k=1, 2)])/8.0_wp, &
                          whole, 1.0e-14_wp)
  end subroutine break_first

  !> Spheres whose mass is the cube of the radius.
  subroutine make_spheres(radii, ids, grains)
    real(wp), intent(in) :: radii(:)
    integer(i8), intent(in) :: ids(:)
    type(dem_grains_type), intent(out) :: grains
    grains%n = ubound(radii, 1)
    grains%id = ids
    allocate (grains%material(grains%n), source=1_i4)
    grains%axes = spread(radii, 1, 3)
    grains%mass = radii**3
    grains%inertia = spread(0.4_wp*radii**5, 1, 3)
  end subroutine make_spheres
end program test_dem_breakage_growth
