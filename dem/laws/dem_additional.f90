!> Additional contact models of a run, in the order of their registry, block by block: forces,
!! stored energy, stiffness, what contacts keep.
module dem_additional
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_state, only: dem_pairs_type, dem_law_type, dem_data_type, lanes, history_size
  use dem_additional_model, only: additional_given_type, additional_works_type
  use dem_additional_numbers, only: additional_work_count, work_rolling, work_breakage, &
    work_torn, work_sheared
  use dem_additional_state, only: dem_additional_type, kept_part_type, kept_range, part_of_model
  use dem_block, only: dem_block_type
  use dem_law_registry, only: memory_places, place_of_memory
  use dem_additional_registry, only: list_models
  use dem_additional_list, only: held_lanes
  use dem_bond_counts, only: count_broken
  use dem_liquid_counts, only: count_liquid
  implicit none
  private
  public :: plan_additional, check_reach
  public :: additional_forces, additional_energy, additional_stiffness, add_additional_work
  public :: add_models, models_energy, models_stiffness, models_reach, models_damping, book_works

contains

  !> What contacts must keep for the laws and models of a run.
  subroutine plan_additional(laws, additional)
    type(dem_law_type), intent(in) :: laws(:, :)
    type(dem_additional_type), intent(inout) :: additional
    type(kept_part_type) :: none
    integer(i4) :: m

    call list_models(additional%model, additional%models)
    additional%active = any(laws%additional%used .or. laws%base%reals > 0) &
                        .or. any(additional%of_run)
    additional%reals = 0
    additional%part = none
    do m = 1, additional%models
      associate (part => additional%part(part_of_model(m)), model => additional%model(m))
        part%name = model%name
        part%reals = model%reals
        part%holds = model%holds
        part%at_surfaces = associated(model%at_surfaces)
        if (model%reals == 0) cycle
        if (.not. (additional%of_run(m) .or. any(laws%additional%acts(m)))) cycle
        part%at = additional%reals + 1
        additional%reals = additional%reals + model%reals
      end associate
    end do
    call memory_places(laws, additional)
  end subroutine plan_additional

  !> What holds over a gap must end before the list loses the pair (I219), and constants must fit
  !! the grains.
  subroutine check_reach(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: length
    integer(i4) :: m

    do m = 1, d%pairs%additional%models
      call fit_grains(d, m, errors)
      length = longest_reach(d, m)
      if (length <= 0.5_wp*d%pairs%skin) cycle
      associate (model => d%pairs%additional%model(m))
        call errors%add('I219', trim(model%name)//' reaches over '//str(length)//' m, more '// &
                        'than half the margin of the list, '//str(d%pairs%skin)//' m', &
                        hint='give &search skin = '//str(3.0_wp*length)//', or '// &
                        trim(model%shorter))
      end associate
    end do
  end subroutine check_reach

  !> Do the constants of model m fit the grains? One fault a model.
  subroutine fit_grains(d, m, errors)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    type(additional_given_type) :: given
    integer(i4) :: a, b, before
    if (.not. associated(d%pairs%additional%model(m)%fit) .or. d%grains%n == 0) return
    before = errors%count
    do a = 1, size(d%laws, 1)
      do b = a, size(d%laws, 2)
        if (.not. d%laws(a, b)%additional%acts(m) .or. errors%count > before) cycle
        given%law = d%laws(a, b)%law_numbers_type
        given%own = d%laws(a, b)%additional%own(:, m)
        call d%pairs%additional%model(m)%fit(given, minval(d%grains%radius), errors)
      end do
    end do
  end subroutine fit_grains

  !> Longest gap over which model m holds contacts, by the largest grain [m].
  pure real(wp) function longest_reach(d, m) result(length)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: m
    type(additional_given_type) :: given
    integer(i4) :: a, b
    length = 0.0_wp
    associate (model => d%pairs%additional%model(m))
      if (.not. associated(model%longest)) return
      do a = 1, size(d%laws, 1)
        do b = 1, size(d%laws, 2)
          if (.not. d%laws(a, b)%additional%acts(m)) cycle
          given%law = d%laws(a, b)%law_numbers_type
          given%own = d%laws(a, b)%additional%own(:, m)
          length = max(length, model%longest(given, maxval(d%grains%radius)))
        end do
      end do
    end associate
  end function longest_reach

  !> After the base law: add forces and moments of the models to the block, works to the pairs.
  pure subroutine additional_forces(b, law, k, h, pairs)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k  !! block
    real(wp), intent(in) :: h     !! time since the last evaluation [s]
    type(dem_pairs_type), intent(inout) :: pairs
    type(additional_given_type) :: given
    type(additional_works_type) :: works

    if (.not. (law%additional%used .or. any(pairs%additional%of_run))) return
    given%round = pairs%round(k)
    given%h = h
    given%m_star = pairs%m_star(:, k)
    given%weight = pairs%weight(:, min(k, size(pairs%weight, 2)))
    works%columns = pairs%columns(:, k)
    works%models = pairs%additional%work(:, k)
    call add_models(b, law, pairs%additional, given, pairs%history(:, :, k), &
                    pairs%additional%kept(:, :, k), works)
    pairs%columns(:, k) = works%columns
    pairs%additional%work(:, k) = works%models
    pairs%touched(k) = pairs%touched(k) .or. any(held_lanes(pairs%additional, k))
  end subroutine additional_forces

  !> All models of a block, wherever its history and kept reals lie.
  pure subroutine add_models(b, law, additional, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    type(additional_given_type), intent(inout) :: given   !! of the model after the other
    real(wp), intent(in) :: history(lanes, history_size)  !! already brought forward
    real(wp), intent(inout), contiguous :: kept(:, :)     !! (lanes, reals)
    type(additional_works_type), intent(inout) :: works
    integer(i4) :: m, range(2)
    logical :: acts

    do m = 1, additional%models
      call choose_model(law, additional, m, given, acts)
      if (.not. acts) cycle
      range = kept_range(additional%part(part_of_model(m)))
      associate (model => additional%model(m))
        if (model%wants_response) call respond(law, additional, kept, given)
        if (given%surface) then
          call model%at_surfaces(b, given, history, kept(:, range(1):range(2)), works)
        else
          call model%forces(b, given, history, kept(:, range(1):range(2)), works)
        end if
      end associate
    end do
  end subroutine add_models

  !> Does model m act between two materials? With which constants?
  pure subroutine choose_model(law, additional, m, given, acts)
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    integer(i4), intent(in) :: m
    type(additional_given_type), intent(inout) :: given
    logical, intent(out) :: acts
    logical :: of_run
    of_run = additional%of_run(m) .and. .not. given%surface
    acts = of_run .or. law%additional%acts(m)
    if (given%surface) acts = acts .and. associated(additional%model(m)%at_surfaces)
    if (.not. acts) return
    given%law = law%law_numbers_type
    given%own = law%additional%own(:, m)
    if (of_run) given%own = additional%own(:, m)
  end subroutine choose_model

  !> Stiffness and normal force of base laws that have their own.
  pure subroutine respond(law, additional, kept, given)
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    real(wp), intent(in) :: kept(:, :)
    type(additional_given_type), intent(inout) :: given
    integer(i4) :: k, range(2)
    given%responds = associated(law%base%response)
    if (.not. given%responds) return
    range = place_of_memory(law, additional)
    do k = 1, lanes
      given%response(:, k) = law%base%response(law%law_numbers_type, kept(k, range(1):range(2)))
    end do
  end subroutine respond

  !> Energy that the models store in block k [J].
  pure real(wp) function additional_energy(law, k, pairs) result(energy)
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k
    type(dem_pairs_type), intent(in) :: pairs
    type(additional_given_type) :: given
    energy = 0.0_wp
    if (.not. (law%additional%used .or. any(pairs%additional%of_run))) return
    given%weight = pairs%weight(:, min(k, size(pairs%weight, 2)))
    energy = models_energy(law, pairs%additional, given, pairs%additional%kept(:, :, k))
  end function additional_energy

  !> The same of lanes that keep these; given: weight and surface [J].
  pure real(wp) function models_energy(law, additional, given, kept) result(energy)
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:, :)  !! (lanes, reals)
    type(additional_given_type) :: mine
    integer(i4) :: m, range(2)
    logical :: acts
    energy = 0.0_wp
    mine = given
    do m = 1, additional%models
      if (.not. associated(additional%model(m)%energy)) cycle
      call choose_model(law, additional, m, mine, acts)
      if (.not. acts) cycle
      range = kept_range(additional%part(part_of_model(m)))
      energy = energy + additional%model(m)%energy(mine, kept(:, range(1):range(2)))
    end do
  end function models_energy

  !> Stiffness that the models add to a lane: of translation [N/m] and of rotation [N m].
  pure function additional_stiffness(law, lane, k, pairs) result(stiffness)
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: lane, k
    type(dem_pairs_type), intent(in) :: pairs
    real(wp) :: stiffness(2)
    stiffness = models_stiffness(law, pairs%additional, .false., pairs%additional%kept(lane, :, k))
  end function additional_stiffness

  !> The same of a contact that keeps these.
  pure function models_stiffness(law, additional, surface, kept) result(stiffness)
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    logical, intent(in) :: surface   !! of a grain with a surface
    real(wp), intent(in) :: kept(:)  !! (reals)
    real(wp) :: stiffness(2)
    type(additional_given_type) :: given
    integer(i4) :: m, range(2)
    logical :: acts
    stiffness = 0.0_wp
    given%surface = surface
    do m = 1, additional%models
      if (.not. associated(additional%model(m)%stiffness)) cycle
      call choose_model(law, additional, m, given, acts)
      if (.not. acts) cycle
      range = kept_range(additional%part(part_of_model(m)))
      stiffness = stiffness + additional%model(m)%stiffness(given, kept(range(1):range(2)))
    end do
  end function models_stiffness

  !> Gap up to which models may hold a contact with a surface that keeps these [m].
  pure real(wp) function models_reach(law, additional, kept) result(reach)
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    real(wp), intent(in) :: kept(:)  !! (reals)
    type(additional_given_type) :: given
    integer(i4) :: m, range(2)
    logical :: acts
    reach = 0.0_wp
    given%surface = .true.
    do m = 1, additional%models
      if (.not. associated(additional%model(m)%reach)) cycle
      call choose_model(law, additional, m, given, acts)
      if (.not. acts) cycle
      range = kept_range(additional%part(part_of_model(m)))
      reach = max(reach, additional%model(m)%reach(given, kept(range(1):range(2))))
    end do
  end function models_reach

  !> Largest damping ratio of turns of all models between two materials, 0: none [-].
  pure real(wp) function models_damping(law, additional) result(ratio)
    type(dem_law_type), intent(in) :: law
    type(dem_additional_type), intent(in) :: additional
    integer(i4) :: m
    ratio = 0.0_wp
    do m = 1, additional%models
      if (additional%model(m)%damping == 0) cycle
      ratio = max(ratio, law%additional%own(additional%model(m)%damping, m))
    end do
  end function models_damping

  !> Block sums into the ledger, in the order of blocks.
  pure subroutine add_additional_work(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: total(additional_work_count)
    integer(i4) :: k
    total = 0.0_wp
    if (allocated(d%pairs%share)) then
      do k = 1, d%pairs%blocks
        total = total + d%pairs%share(k)*d%pairs%additional%work(:, k)
      end do
    else
      do k = 1, d%pairs%blocks
        total = total + d%pairs%additional%work(:, k)
      end do
    end if
    call book_works(d, total)
  end subroutine add_additional_work

  !> Works of a step into the columns of the ledger, and what it counts.
  pure subroutine book_works(d, works)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: works(additional_work_count)
    d%ledger%rolling = d%ledger%rolling + works(work_rolling)
    d%ledger%breakage = d%ledger%breakage + works(work_breakage)
    d%pairs%additional%broken = d%pairs%additional%broken + works(work_torn:work_sheared)
    call count_broken(d%pairs%additional)
    call count_liquid(d%pairs%additional, works)
  end subroutine book_works
end module dem_additional
