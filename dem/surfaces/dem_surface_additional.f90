!> Additional contact models at surfaces: history of contacts, forces, energies, works.
module dem_surface_additional
  use talus_kinds, only: wp, i4
  use dem_block, only: dem_block_type
  use dem_cohesion, only: tear_overlap
  use dem_contact, only: contact_stiffness, constants_of, stored_energy
  use dem_law_registry, only: place_of_memory
  use dem_additional_state, only: kept_places_type, cohesion_jkr, additional_work_count
  use dem_additional, only: add_additional_work, add_laws, stored_on_top, stiffness_on_top
  use talus_vectors, only: cross
  use dem_state, only: dem_data_type, dem_law_type, lanes, history_size, column_count
  implicit none
  private
  public :: surface_kept_reals, neck_reach, held_by_necks, laws_of_surface, &
    surface_additional_energy, &
    surface_additional_stiffness, surface_base_stiffness, has_own_energy, has_hertz_energy, &
    own_energy, add_work_on_top, corner_couples

contains

  !> Reals that a contact with a surface keeps for additional contact models; 0 if no law of
  !! surfaces has any.
  pure integer(i4) function surface_kept_reals(d) result(reals)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: k
    reals = 0
    if (.not. d%pairs%additional%active) return
    do k = 1, d%surfaces%parts
      associate (laws => d%laws(d%surfaces%material(k), :))
        if (any(laws%additional%used .or. laws%base%reals > 0)) reals = d%pairs%additional%reals
      end associate
    end do
  end function surface_kept_reals

  !> Law of contact k of near grain g.
  pure function law_of(d, k, g) result(law)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    type(dem_law_type) :: law
    law = d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                 d%grains%material(d%surfaces%list%near_grain(g)))
  end function law_of

  !> Gap up to which the necks of near grain g may hold, 0 without necks [m].
  pure real(wp) function neck_reach(d, g) result(reach)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: g
    type(dem_law_type) :: law
    real(wp), parameter :: ample = 2.0_wp  !! radii grow as a grain turns
    integer(i4) :: k
    reach = 0.0_wp
    associate (at => d%pairs%additional%cohesion_at)
      if (at == 0) return
      do k = 1, d%surfaces%list%contacts(g)
        if (.not. d%surfaces%list%kept(k, at, g) > 0.0_wp) cycle
        law = law_of(d, k, g)
        if (law%additional%cohesion /= cohesion_jkr) cycle
        reach = max(reach, -tear_overlap(law, ample*d%surfaces%list%kept(k, at + 3, g)))
      end do
    end associate
  end function neck_reach

  !> Lanes that a neck holds.
  pure function held_by_necks(at, kept) result(held)
    type(kept_places_type), intent(in) :: at
    real(wp), intent(in) :: kept(:, :)  !! (lanes, reals)
    logical :: held(lanes)
    held = .false.
    if (at%cohesion_at > 0) held = kept(:, at%cohesion_at) > 0.0_wp
  end function held_by_necks

  !> Base law and additional models of the lanes of a block; history and kept are advanced by h.
  pure subroutine laws_of_surface(b, law, at, h, m_star, history, kept, columns, work)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    type(kept_places_type), intent(in) :: at
    real(wp), intent(in) :: h, m_star(lanes)
    real(wp), intent(inout) :: history(lanes, history_size), kept(:, :)
    real(wp), intent(out) :: columns(column_count)
    real(wp), intent(inout) :: work(additional_work_count)
    real(wp) :: weight(lanes), memory(lanes, law%base%reals)
    integer(i4) :: range(2)

    weight = 1.0_wp
    range = place_of_memory(law, at)
    memory = kept(:, range(1):range(2))
    call law%base%forces(b, law%law_numbers_type, .false., h, m_star, weight, history, memory, &
                          columns)
    kept(:, range(1):range(2)) = memory
    if (law%additional%used) &
      call add_laws(b, law, at, .false., h, m_star, weight, history, kept, columns, work)
  end subroutine laws_of_surface

  !> Energy that additional contact models store in the contacts with surfaces [J].
  pure real(wp) function surface_additional_energy(d) result(energy)
    type(dem_data_type), intent(in) :: d
    type(dem_law_type) :: law
    real(wp) :: weight(lanes)
    integer(i4) :: g, k
    energy = 0.0_wp
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        law = law_of(d, k, g)
        if (.not. law%additional%used) cycle
        weight = 0.0_wp
        weight(k) = 1.0_wp
        energy = energy + stored_on_top(law, d%pairs%additional%kept_places_type, weight, &
                                        d%surfaces%list%kept(:, :, g))
      end do
    end do
  end function surface_additional_energy

  !> Normal and tangential stiffness of contact k of near grain g by its base law [N/m].
  pure function surface_base_stiffness(d, k, g) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    real(wp) :: stiffness(2), none(0)
    integer(i4) :: range(2)
    associate (law => d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                             d%grains%material(d%surfaces%list%near_grain(g))))
      if (law%base%reals > 0) then
        range = place_of_memory(law, d%pairs%additional)
        stiffness = contact_stiffness(law, d%surfaces%list%history(k, :, g), &
                                      d%surfaces%list%kept(k, range(1):range(2), g))
      else
        stiffness = contact_stiffness(law, d%surfaces%list%history(k, :, g), none)
      end if
    end associate
  end function surface_base_stiffness

  !> Is the energy of contact k of near grain g not that of springs?
  pure logical function has_own_energy(d, k, g)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    associate (list => d%surfaces%list)
      has_own_energy = associated(d%laws(d%surfaces%material(list%part(k, g)), &
                                         d%grains%material(list%near_grain(g)))%base%energy)
    end associate
  end function has_own_energy

  !> Is its normal force that of Hertz?
  pure logical function has_hertz_energy(d, k, g) result(hertz)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    hertz = d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                   d%grains%material(d%surfaces%list%near_grain(g)))%base%hertz
  end function has_hertz_energy

  !> Then its normal and tangential energy [J].
  pure function own_energy(d, k, g) result(energy)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    real(wp) :: energy(2), weight(lanes), memory(lanes, d%pairs%additional%reals)
    real(wp) :: history(lanes, history_size)
    integer(i4) :: range(2)
    weight = 0.0_wp
    weight(1) = 1.0_wp
    memory = 0.0_wp
    memory(1, :) = d%surfaces%list%kept(k, :, g)
    history = 0.0_wp
    history(1, :) = d%surfaces%list%history(k, :, g)
    associate (law => d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                             d%grains%material(d%surfaces%list%near_grain(g))))
      energy = stored_energy(constants_of(law%law_numbers_type), weight, history)
      range = place_of_memory(law, d%pairs%additional)
      call law%base%energy(law%law_numbers_type, weight, memory(:, range(1):range(2)), energy)
    end associate
  end function own_energy

  !> Stiffness that additional contact models add to a contact: of translation [N/m] and of rotation
  !! [N m].
  pure function surface_additional_stiffness(d, k, g) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    real(wp) :: stiffness(2)
    type(dem_law_type) :: law
    stiffness = 0.0_wp
    if (.not. size(d%surfaces%list%kept) > 0) return
    law = law_of(d, k, g)
    stiffness = stiffness_on_top(law, d%pairs%additional%kept_places_type, &
      d%surfaces%list%kept(k, :, g))
  end function surface_additional_stiffness

  !> Works of the step of all additional contact models into the ledger, those at surfaces in the
  !! order of the grains.
  pure subroutine add_work_on_top(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: total(additional_work_count)
    integer(i4) :: g
    call add_additional_work(d)
    if (d%surfaces%list%near == 0) return
    if (.not. size(d%surfaces%list%kept) > 0) return
    total = 0.0_wp
    do g = 1, d%surfaces%list%near
      total = total + d%surfaces%list%additional_work(:, g)
    end do
    d%ledger%rolling = d%ledger%rolling + total(1)
    d%ledger%breakage = d%ledger%breakage + total(2)
  end subroutine add_work_on_top

  !> Forces on the corners of a soft triangle that do the work of a couple on its spin: the
  !! transpose of that spin (dem_surface_find) [N].
  pure function corner_couples(x, couple) result(force)
    real(wp), intent(in) :: x(3, 3), couple(3)  !! corners [m], [N m]
    real(wp) :: force(3, 3), e(3, 2), n(3), area, dual(3, 2)
    integer(i4) :: k

    e(:, 1) = x(:, 2) - x(:, 1)
    e(:, 2) = x(:, 3) - x(:, 1)
    n = cross(e(:, 1), e(:, 2))
    area = sqrt(sum(n*n))
    n = n/area
    dual(:, 1) = cross(e(:, 2), n)/area
    dual(:, 2) = cross(n, e(:, 1))/area
    do k = 1, 2
      force(:, k + 1) = -dot_product(couple, cross(n, dual(:, k)))*n &
                        + 0.5_wp*dot_product(couple, n)*cross(n, dual(:, k))
    end do
    force(:, 1) = -force(:, 2) - force(:, 3)
  end function corner_couples
end module dem_surface_additional
