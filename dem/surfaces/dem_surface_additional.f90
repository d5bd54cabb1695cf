!> Additional contact models at surfaces: history of contacts, forces, energies, works.
module dem_surface_additional
  use talus_kinds, only: wp, i4
  use dem_block, only: dem_block_type
  use dem_contact, only: contact_stiffness, constants_of, stored_energy
  use dem_law_registry, only: place_of_memory
  use dem_additional_model, only: additional_given_type, additional_works_type
  use dem_additional_numbers, only: additional_work_count
  use dem_additional_state, only: dem_additional_type
  use dem_additional, only: add_additional_work, add_models, models_energy, models_stiffness, &
    models_reach, book_works
  use talus_vectors, only: cross
  use dem_state, only: dem_data_type, dem_law_type, lanes, history_size
  implicit none
  private
  public :: surface_kept_reals, held_reach, laws_of_surface, surface_additional_energy, &
    surface_additional_stiffness, surface_base_stiffness, has_own_energy, has_hertz_energy, &
    own_energy, add_all_work, corner_couples

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

  !> Gap up to which models may hold contacts of near grain g, 0 without such models [m].
  pure real(wp) function held_reach(d, g) result(reach)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: g
    integer(i4) :: k
    reach = 0.0_wp
    if (.not. any(d%pairs%additional%part%holds .and. d%pairs%additional%part%at > 0)) return
    do k = 1, d%surfaces%list%contacts(g)
      associate (law => d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                               d%grains%material(d%surfaces%list%near_grain(g))))
        reach = max(reach, models_reach(law, d%pairs%additional, d%surfaces%list%kept(k, :, g)))
      end associate
    end do
  end function held_reach

  !> Base law and additional models of the lanes of a block, given the step and masses; history and
  !! kept are advanced, works of models added.
  pure subroutine laws_of_surface(b, law, additional, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    type(additional_given_type), intent(inout) :: given
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: kept(:, :)
    type(additional_works_type), intent(inout) :: works
    real(wp) :: memory(lanes, law%base%reals)
    integer(i4) :: range(2)

    given%surface = .true.
    given%weight = 1.0_wp
    range = place_of_memory(law, additional)
    memory = kept(:, range(1):range(2))
    call law%base%forces(b, law%law_numbers_type, given%round, given%h, given%m_star, &
                         given%weight, history, memory, works%columns)
    kept(:, range(1):range(2)) = memory
    if (law%additional%used) &
      call add_models(b, law, additional, given, history, kept, works)
  end subroutine laws_of_surface

  !> Energy that additional contact models store in the contacts with surfaces [J].
  pure real(wp) function surface_additional_energy(d) result(energy)
    type(dem_data_type), intent(in) :: d
    type(dem_law_type) :: law
    type(additional_given_type) :: given
    integer(i4) :: g, k
    energy = 0.0_wp
    given%surface = .true.
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        law = law_of(d, k, g)
        if (.not. law%additional%used) cycle
        given%weight = 0.0_wp
        given%weight(k) = 1.0_wp
        energy = energy + models_energy(law, d%pairs%additional, given, &
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
    stiffness = models_stiffness(law, d%pairs%additional, .true., d%surfaces%list%kept(k, :, g))
  end function surface_additional_stiffness

  !> Works of the step of all additional contact models into the ledger, those at surfaces in the
  !! order of the grains.
  pure subroutine add_all_work(d)
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
    call book_works(d, total)
  end subroutine add_all_work

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
