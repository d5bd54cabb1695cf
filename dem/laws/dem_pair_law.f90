!> Base laws of the contacts of candidate pairs, as measures see them: stiffness and stored energy.
module dem_pair_law
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_data_type, dem_law_type
  use dem_contact, only: contact_constants_type, constants_of, contact_stiffness, stored_energy
  use dem_law_registry, only: place_of_memory
  implicit none
  private
  public :: pair_stiffness, pair_energy, at_friction_limit

  real(wp), parameter :: at_limit = 1.0_wp - 1.0e-6_wp  !! of the friction limit counts as sliding

contains

  !> Normal and tangential stiffness of the contact in a lane of block k [N/m].
  pure function pair_stiffness(d, lane, k) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    real(wp) :: stiffness(2), none(0)
    integer(i4) :: range(2)
    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)))
      if (law%base%reals > 0) then
        range = place_of_memory(law, d%pairs%additional)
        stiffness = contact_stiffness(law, d%pairs%history(lane, :, k), &
                                      d%pairs%additional%kept(lane, range(1):range(2), k))
      else
        stiffness = contact_stiffness(law, d%pairs%history(lane, :, k), none)
      end if
    end associate
  end function pair_stiffness

  !> Normal and tangential energy that the base law stores in block k [J].
  pure function pair_energy(d, k) result(energy)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k
    real(wp) :: energy(2)
    integer(i4) :: range(2)
    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)), &
               weight => d%pairs%weight(:, min(k, size(d%pairs%weight, 2))))
      energy = stored_energy(constants_of(law%law_numbers_type), weight, d%pairs%history(:, :, k))
      if (.not. associated(law%base%energy)) return
      range = place_of_memory(law, d%pairs%additional)
      call law%base%energy(law%law_numbers_type, weight, &
                           d%pairs%additional%kept(:, range(1):range(2), k), energy)
    end associate
  end function pair_energy

  !> Has the tangential force of a contact reached the friction limit? Contacts without friction
  !! always slide.
  pure logical function at_friction_limit(law, force, normal, stiffness, overlap) result(slides)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: force(3)   !! [N]
    real(wp), intent(in) :: normal(3)  !! of the same sense [-]
    real(wp), intent(in) :: stiffness  !! normal [N/m]
    real(wp), intent(in) :: overlap    !! [m]
    type(contact_constants_type) :: constants
    real(wp) :: shear(3), elastic
    shear = force - dot_product(force, normal)*normal
    constants = constants_of(law%law_numbers_type)
    elastic = constants%normal_share*stiffness*overlap
    if (associated(law%base%response)) elastic = dot_product(force, normal)
    slides = norm2(shear) >= at_limit*law%friction*elastic
  end function at_friction_limit
end module dem_pair_law
