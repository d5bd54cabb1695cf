!> Masses of fragments: of the solid, together that of the grain, or by which their Rayleigh time is
!! that of the grain; what gradings count.
program test_dem_breakage_masses
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_breakage_masses, only: mass_solid, mass_parent, mass_scaled, weigh_fragments, &
    density_factor, counted_mass, counted_masses
  use dem_fragments, only: fragment_type, make_fragments, family_fourteen
  use dem_state, only: dem_data_type, dem_grains_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp), radius = 1.0e-3_wp, density = 2650.0_wp
  real(wp), parameter :: whole = density*4.0_wp/3.0_wp*pi*radius**3
  integer(i4) :: choice

  do choice = mass_solid, mass_scaled
    call check_choice(choice)
  end do
  call test%check_close('parent, three generations', density_factor(mass_parent, 0.5_wp**3, &
                                                                    0.1_wp), 8.0_wp, 1.0e-14_wp)
  call test%finish()

contains

  !> Fragments of a sphere that moves, of which one is broken again.
  subroutine check_choice(choice)
    integer(i4), intent(in) :: choice
    type(dem_data_type) :: d
    type(dem_grains_type) :: entering, again
    real(wp) :: push(3), size(14)

    call make_spheres([radius], d%grains)
    allocate (d%materials(1))
    d%materials%density = density
    d%materials%fragments_scaled = choice == mass_scaled
    call break_sphere(d, 1_i4, entering)
    size = entering%axes(1, :)/radius
    call weigh_fragments(d, 1_i4, choice, 1_i4, 14_i4, entering)
    push = matmul(entering%v, entering%mass)
    select case (choice)
    case (mass_solid)
      call test%check_all_close('solid', entering%mass/whole, size**3, 1.0e-14_wp)
    case (mass_parent)
      call test%check_close('mass of all', sum(entering%mass), whole, 1.0e-13_wp*whole)
      call test%check_all_close('momentum of all', push, whole*d%grains%v(:, 1), 1.0e-13_wp*whole)
    case (mass_scaled)
      call test%check_all_close('scaled', entering%mass/whole, size, 1.0e-13_wp)
      call test%check_all_close('momentum stays', push, whole*d%grains%v(:, 1), 1.0e-13_wp*whole)
      call test%check_close('counted', counted_mass(d, entering, 1_i4)/whole, size(1)**3, &
                            1.0e-14_wp)
    end select
    call test%check_all_close('inertia', entering%inertia(1, :)/(0.4_wp*entering%mass), &
                              entering%axes(1, :)**2, 1.0e-20_wp)
    d%grains = entering
    call break_sphere(d, 14_i4, again)
    call weigh_fragments(d, 14_i4, choice, 1_i4, 14_i4, again)
    if (choice == mass_scaled) call test%check_all_close('Rayleigh time of the second generation', &
      again%axes(1, :)*sqrt(again%mass/again%axes(1, :)**3), spread(sqrt(whole/radius), 1, 14), &
      1.0e-9_wp*sqrt(whole/radius))
    if (choice == mass_parent) call test%check_close('mass of the second generation', &
      sum(again%mass), entering%mass(14), 1.0e-13_wp*whole)
    call test%check_close('sum that gradings count', sum(counted_masses(d))/whole, &
                          merge(1.0_wp, sum(size**3), choice == mass_parent), 1.0e-13_wp)
  end subroutine check_choice

  !> Spheres of the bare solid.
  subroutine make_spheres(radii, grains)
    real(wp), intent(in) :: radii(:)
    type(dem_grains_type), intent(out) :: grains
    integer(i4) :: n
    n = size(radii)
    grains%n = n
    allocate (grains%material(n), source=1_i4)
    grains%axes = spread(radii, 1, 3)
    grains%mass = density*4.0_wp/3.0_wp*pi*radii**3
    grains%inertia = spread(0.4_wp*grains%mass*radii**2, 1, 3)
    grains%v = spread([1.0_wp, -2.0_wp, 0.5_wp], 2, n)
    grains%omega = spread([0.0_wp, 0.0_wp, 0.0_wp], 2, n)
  end subroutine make_spheres

  !> Its fourteen fragments, with the masses of the solid.
  subroutine break_sphere(d, i, entering)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    type(dem_grains_type), intent(out) :: entering
    type(fragment_type), allocatable :: fragment(:)
    integer(i4) :: k
    call make_fragments(family_fourteen, d%grains%axes(:, i), d%grains%axes(:, i), 2.0_wp, &
                        [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1_i4, fragment)
    call make_spheres([(fragment(k)%upper(1), k=1, 14)], entering)
    entering%v = spread(d%grains%v(:, i), 2, 14)
  end subroutine break_sphere
end program test_dem_breakage_masses
