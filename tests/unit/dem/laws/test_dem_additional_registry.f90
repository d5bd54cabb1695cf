!> Registry of additional contact models: names, order, constants, and where contacts keep what
!! belongs to each.
program test_dem_additional_registry
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_additional, only: plan_additional, models_stiffness, models_energy, models_damping
  use dem_additional_list, only: held_of
  use dem_additional_model, only: additional_given_type, additional_model_type
  use dem_additional_numbers, only: most_models
  use dem_additional_registry, only: list_models, find_model, use_model, use_in_run
  use dem_additional_state, only: dem_additional_type, kept_range, part_of_law, part_of_model, &
    most_laws, most_parts
  use dem_bond, only: bond_type, own_of
  use dem_law, only: make_law
  use dem_law_registry, only: law_count, place_of_memory
  use dem_state, only: dem_law_type, dem_material_type, lanes
  implicit none
  type(test_type) :: test
  character(len=8), parameter :: names(3) = ['rolling ', 'cohesion', 'bond    ']

  call check_names()
  call check_parts()
  call check_layout()
  call check_alone()
  call check_choice()
  call test%finish()

contains

  !> Found at its place, in the order in which forces are added; an unknown name at none.
  subroutine check_names()
    type(additional_model_type) :: list(most_models)
    integer(i4) :: n, k, j
    call list_models(list, n)
    call test%check('room in the registry', n >= size(names) .and. n <= most_models)
    do k = 1, size(names)
      call test%check('place of '//trim(names(k)), find_model(trim(names(k))) == k)
    end do
    call test%check('place of capillary', find_model('capillary') == size(names) + 1)
    do k = 1, n
      call test%check('found: '//trim(list(k)%name), find_model(trim(list(k)%name)) == k)
      call test%check('it has forces', associated(list(k)%forces))
      call test%check('what holds keeps that', list(k)%reals > 0 .or. .not. list(k)%holds)
      do j = 1, k - 1
        call test%check('a name of its own', list(j)%name /= list(k)%name)
      end do
    end do
    call test%check('no model of that name', find_model('glue') == 0)
    call test%check('nor without name', find_model('') == 0)
  end subroutine check_names

  !> Laws and models have each a row of their own in the table of parts, those of checkpoints as
  !! they always were.
  subroutine check_parts()
    logical :: taken(most_parts)
    integer(i4) :: k
    taken = .false.
    do k = 1, most_laws
      call test%check('part of a law', part_of_law(k) == 3 + k)
      taken(part_of_law(k)) = .true.
    end do
    do k = 1, most_models
      call test%check('part of a model is free', .not. taken(part_of_model(k)))
      taken(part_of_model(k)) = .true.
    end do
    call test%check('all parts in use', all(taken))
    call test%check('room for all laws', law_count() <= most_laws)
    call test%check('first models first', part_of_model(3) == 3 .and. part_of_model(1) == 1)
  end subroutine check_parts

  !> A law of Mindlin and Deresiewicz with all models: reals side by side, without overlap.
  subroutine check_layout()
    type(dem_law_type) :: laws(1, 1)
    type(dem_additional_type) :: additional
    integer(i4) :: range(2), k, next
    laws = law_of('mindlin_deresiewicz')
    call use_model(laws(1, 1)%additional, 'rolling', [0.2_wp, 0.1_wp, 1.0_wp, 2.0_wp, 0.3_wp])
    call use_model(laws(1, 1)%additional, 'cohesion', [1.0_wp, 1.0e-3_wp])
    call use_in_run(additional, 'bond', own_of(bond_type(young=1.0e9_wp)))
    call plan_additional(laws, additional)
    call test%check('active', additional%active)
    next = 1
    do k = 1, size(names)
      associate (part => additional%part(part_of_model(k)))
        call test%check('name of '//trim(names(k)), part%name == names(k))
        range = kept_range(part)
        call test%check('its reals follow', range(1) == next .and. range(2) > next)
        next = range(2) + 1
        call test%check('at surfaces', part%at_surfaces .eqv. k < 3)
        call test%check('over gaps', part%holds .eqv. k > 1)
      end associate
    end do
    range = place_of_memory(laws(1, 1), additional)
    call test%check('then those of the law', range(1) == next)
    call test%check('and no others', range(2) == additional%reals)
    call test%check('rolling, cohesion, bond: 8, 4, 17', next == 1 + 8 + 4 + 17)
  end subroutine check_layout

  !> A model alone begins at the first real; without any nothing is kept.
  subroutine check_alone()
    type(dem_law_type) :: laws(1, 1)
    type(dem_additional_type) :: additional, none
    laws = law_of('hertz_mindlin')
    call plan_additional(laws, none)
    call test%check('nothing is kept', none%reals == 0 .and. .not. none%active)
    call test%check('no range', all(kept_range(none%part(part_of_model(1))) == [1, 0]))
    call use_model(laws(1, 1)%additional, 'cohesion', [1.0_wp, 1.0e-3_wp])
    call plan_additional(laws, additional)
    call test%check('the only one', all(kept_range(additional%part(part_of_model(2))) == [1, 4]))
    call test%check('of the others none', additional%part(part_of_model(1))%at == 0 &
                                          .and. additional%part(part_of_model(3))%at == 0)
  end subroutine check_alone

  !> Bonds act between grains of all materials but not at surfaces; models of materials at both.
  subroutine check_choice()
    type(dem_law_type) :: laws(1, 1)
    type(dem_additional_type) :: additional
    type(additional_given_type) :: given
    real(wp) :: stiffness(2), energy
    real(wp), allocatable :: kept(:, :)
    integer(i4) :: bond_at

    laws = law_of('hertz_mindlin')
    call use_model(laws(1, 1)%additional, 'rolling', [0.2_wp, 0.1_wp, 1.0_wp, 2.0_wp, 0.3_wp])
    call use_in_run(additional, 'bond', own_of(bond_type(young=1.0e9_wp)))
    call plan_additional(laws, additional)
    allocate (kept(lanes, additional%reals), source=0.0_wp)
    kept(2, 8) = 5.0_wp
    bond_at = additional%part(part_of_model(3))%at
    stiffness = models_stiffness(laws(1, 1), additional, .false., kept(2, :))
    call test%check_all_close('of the twisting spring', stiffness, [0.0_wp, 10.0_wp], 1.0e-14_wp)
    kept(2, bond_at) = 1.0_wp
    kept(2, bond_at + 1) = 1.0_wp
    kept(2, bond_at + 9:bond_at + 10) = 1.0e-3_wp
    stiffness = models_stiffness(laws(1, 1), additional, .false., kept(2, :))
    call test%check('and of the bond', stiffness(1) > 0.0_wp .and. stiffness(2) > 10.0_wp)
    stiffness = models_stiffness(laws(1, 1), additional, .true., kept(2, :))
    call test%check_all_close('none of it at a surface', stiffness, [0.0_wp, 10.0_wp], 1.0e-14_wp)
    given%weight = 1.0_wp
    energy = models_energy(laws(1, 1), additional, given, kept)
    call test%check('the bond stores', energy > 0.0_wp)
    given%surface = .true.
    energy = models_energy(laws(1, 1), additional, given, kept)
    call test%check_close('not at a surface', energy, 0.0_wp, 0.0_wp)
    call test%check('held by the bond', count(held_of(additional%kept_places_type, kept)) == 1)
    call test%check_close('damping of turns', models_damping(laws(1, 1), additional), 0.3_wp, &
                          1.0e-15_wp)
  end subroutine check_choice

  type(dem_law_type) function law_of(name) result(law)
    character(len=*), intent(in) :: name
    type(dem_material_type) :: material
    material = dem_material_type(1.0e9_wp, 0.25_wp, 2650.0_wp)
    law = make_law(name, material, material, 0.5_wp, 0.1_wp, 0.1_wp)
  end function law_of
end program test_dem_additional_registry
