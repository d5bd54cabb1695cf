!> Masses of fragments (theory-dem, Breakage of grains): of the solid, together that of the grain,
!! or scaled so that the step stays. Faults D373, D374.
!! eqs. D.50 and D.51
module dem_breakage_masses
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_breakage_growth, only: left_to_grow
  use dem_state, only: dem_data_type, dem_grains_type, mode_relaxation
  implicit none
  private
  public :: mass_names, mass_solid, mass_parent, mass_scaled
  public :: check_masses, weigh_fragments, density_factor, counted_mass, counted_masses

  integer(i4), parameter :: mass_solid = 1, mass_parent = 2, mass_scaled = 3
  character(len=6), parameter :: mass_names(3) = [character(len=6) :: 'solid', 'parent', 'scaled']
  real(wp), parameter :: third = 1.0_wp/3.0_wp

contains

  !> Scaled masses belong into relaxation without gravity.
  subroutine check_masses(deck, k, choice, d, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k        !! the group
    integer(i4), intent(in) :: choice   !! mass_...
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: key = 'fragment_mass'
    if (choice /= mass_scaled) return
    if (d%par%mode /= mode_relaxation) call deck%fault(errors, 'D373', 'masses that are not '// &
      'those of the solid belong into &relaxation', 'breakage', k, key, &
      "take &relaxation, or fragment_mass = 'solid' or 'parent'")
    if (norm2(d%par%gravity_scale*d%par%gravity) > 0.0_wp) call deck%fault(errors, 'D374', &
      'fragments of scaled mass would weigh more', 'breakage', k, key, &
      "set gravity = 0.0, 0.0, 0.0, or fragment_mass = 'solid' or 'parent'")
  end subroutine check_masses

  !> Factor on the density of fragments of a generation, that of their grain being 1.
  pure real(wp) function density_factor(choice, kept, ratio) result(factor)
    integer(i4), intent(in) :: choice  !! mass_...
    real(wp), intent(in) :: kept       !! of the volume, by all fragments [-]
    real(wp), intent(in) :: ratio      !! diameter over that of the grain [-]
    factor = 1.0_wp
    if (choice == mass_parent .and. kept > 0.0_wp) factor = 1.0_wp/kept
    if (choice == mass_scaled) factor = 1.0_wp/ratio**2
  end function density_factor

  !> Masses, moments of inertia and velocities of the fragments of grain i, made of the bare solid.
  !! Scaled ones share the momentum of the grain, so that no kinetic energy appears.
  pure subroutine weigh_fragments(d, i, choice, first, last, entering)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, choice    !! mass_...
    integer(i4), intent(in) :: first, last  !! of its fragments
    type(dem_grains_type), intent(inout) :: entering
    real(wp) :: factor(first:last), share
    integer(i4) :: k

    if (choice == mass_solid .or. first < 1) return
    associate (g => d%grains)
      if (choice == mass_parent) then
        factor = g%mass(i)/sum(entering%mass(first:last))
      else
        do k = first, last
          factor(k) = g%mass(i)/solid_mass(d, g, i)*density_factor(choice, 1.0_wp, &
            (solid_mass(d, entering, k)/solid_mass(d, g, i))**third)
        end do
      end if
      do k = first, last
        entering%mass(k) = factor(k)*entering%mass(k)
        entering%inertia(:, k) = factor(k)*entering%inertia(:, k)
      end do
      share = g%mass(i)/sum(entering%mass(first:last))
      if (choice == mass_parent) return
      entering%v(:, first:last) = share*entering%v(:, first:last)
      entering%omega(:, first:last) = share*entering%omega(:, first:last)
    end associate
  end subroutine weigh_fragments

  !> Mass that gradings and sums of masses count [kg].
  pure real(wp) function counted_mass(d, g, i) result(mass)
    type(dem_data_type), intent(in) :: d
    type(dem_grains_type), intent(in) :: g  !! those of d, or some that enter
    integer(i4), intent(in) :: i
    mass = g%mass(i)
    if (d%materials(g%material(i))%fragments_scaled) mass = solid_mass(d, g, i)
  end function counted_mass

  !> Mass of the solid of a grain, of one that grows at its end [kg].
  pure real(wp) function solid_mass(d, g, i) result(mass)
    type(dem_data_type), intent(in) :: d
    type(dem_grains_type), intent(in) :: g  !! those of d, or some that enter
    integer(i4), intent(in) :: i
    real(wp), parameter :: pi = acos(-1.0_wp)
    mass = d%materials(g%material(i))%density*4.0_wp/3.0_wp*pi*product(g%axes(:, i))
    if (allocated(d%growing)) mass = mass*left_to_grow(d, g%id(i))**3
  end function solid_mass

  !> The same of all grains [kg].
  pure function counted_masses(d) result(mass)
    type(dem_data_type), intent(in) :: d
    real(wp) :: mass(d%grains%n)
    integer(i4) :: i
    do i = 1, d%grains%n
      mass(i) = counted_mass(d, d%grains, i)
    end do
  end function counted_masses
end module dem_breakage_masses
