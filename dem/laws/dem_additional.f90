!> Additional contact models, block by block: forces, stored energy, stiffness, kept reals.
module dem_additional
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_state, only: dem_pairs_type, dem_law_type, dem_data_type, lanes, history_size, &
    column_count
  use dem_additional_state, only: dem_additional_type, kept_places_type, rolling_reals, &
    cohesion_reals, bond_reals, kept_part_type, part_rolling, part_cohesion, part_bond, &
    cohesion_none, cohesion_jkr, additional_work_count, &
    work_rolling, work_breakage, work_torn, work_sheared
  use dem_block, only: dem_block_type
  use dem_contact, only: constants_of
  use dem_law_registry, only: memory_places, place_of_memory
  use dem_additional_list, only: held_lanes, count_broken
  use dem_bond, only: bond_block, bond_energy, bond_stiffness
  use dem_cohesion, only: cohesion_block, cohesion_energy, neck_stiffness, tear_overlap
  use dem_rolling, only: rolling_block, rolling_energy
  implicit none
  private
  public :: plan_additional, check_necks, additional_forces, additional_energy
  public :: additional_stiffness, add_additional_work
  public :: add_laws, stored_on_top, stiffness_on_top

contains

  !> What contacts must keep for the laws of a run.
  subroutine plan_additional(laws, additional)
    type(dem_law_type), intent(in) :: laws(:, :)
    type(dem_additional_type), intent(inout) :: additional

    additional%active = any(laws%additional%used .or. laws%base%reals > 0) &
                        .or. additional%bond%given
    additional%reals = 0
    additional%rolling_at = 0
    additional%cohesion_at = 0
    additional%bond_at = 0
    if (any(laws%additional%rolling > 0.0_wp .or. laws%additional%twisting > 0.0_wp)) &
      call reserve(rolling_reals, additional%rolling_at)
    additional%part(part_rolling) = kept_part_type('rolling', rolling_reals, additional%rolling_at)
    if (any(laws%additional%cohesion /= cohesion_none)) &
      call reserve(cohesion_reals, additional%cohesion_at)
    additional%part(part_cohesion) = kept_part_type('cohesion', cohesion_reals, &
                                                    additional%cohesion_at)
    if (additional%bond%given) call reserve(bond_reals, additional%bond_at)
    additional%part(part_bond) = kept_part_type('bond', bond_reals, additional%bond_at)
    call memory_places(laws, additional)

  contains

    subroutine reserve(reals, place)
      integer(i4), intent(in) :: reals
      integer(i4), intent(out) :: place
      place = additional%reals + 1
      additional%reals = additional%reals + reals
    end subroutine reserve
  end subroutine plan_additional

  !> Necks must tear before the list loses their pairs (I219).
  subroutine check_necks(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: length
    integer(i4) :: a, b

    length = 0.0_wp
    do a = 1, size(d%laws, 1)
      do b = 1, size(d%laws, 2)
        if (d%laws(a, b)%additional%cohesion /= cohesion_jkr) cycle
        length = max(length, -tear_overlap(d%laws(a, b), maxval(d%grains%radius)))
      end do
    end do
    if (length <= 0.5_wp*d%pairs%skin) return
    call errors%add('I219', 'necks reach '//str(length)//' m, more than half the margin of the '// &
                    'list, '//str(d%pairs%skin)//' m', hint='give &search skin = '// &
                    str(3.0_wp*length)//', or less surface_energy: such grains are mere jelly')
  end subroutine check_necks

  !> After the base law: add forces and moments of the additional models to the block, works to the
  !! pairs.
  subroutine additional_forces(b, law, k, h, pairs)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k  !! block
    real(wp), intent(in) :: h     !! time since the last evaluation [s]
    type(dem_pairs_type), intent(inout) :: pairs
    real(wp) :: weight(lanes), work(2)
    integer(i4) :: at

    if (.not. law%additional%used .and. pairs%additional%bond_at == 0) return
    weight = pairs%weight(:, min(k, size(pairs%weight, 2)))
    call add_laws(b, law, pairs%additional%kept_places_type, pairs%round(k), h, &
                  pairs%m_star(:, k), weight, pairs%history(:, :, k), &
                  pairs%additional%kept(:, :, k), pairs%columns(:, k), &
                  pairs%additional%work(:, k))
    if (pairs%additional%bond_at > 0) then
      at = pairs%additional%bond_at
      call bond_block(b, law, pairs%additional%bond, h, pairs%m_star(:, k), weight, &
                      pairs%additional%kept(:, at:at + bond_reals - 1, k), work, &
                      pairs%additional%work(:, k))
      pairs%columns(1, k) = pairs%columns(1, k) + work(1)
      pairs%columns(3, k) = pairs%columns(3, k) + work(2)
    end if
    pairs%touched(k) = pairs%touched(k) .or. any(held_lanes(pairs%additional, k))
  end subroutine additional_forces

  !> Rolling resistance and cohesion of a block, wherever its history and kept reals lie.
  pure subroutine add_laws(b, law, at, round, h, m_star, weight, history, kept, columns, work)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    type(kept_places_type), intent(in) :: at
    logical, intent(in) :: round                          !! all pairs are of spheres
    real(wp), intent(in) :: h                             !! time since the last evaluation [s]
    real(wp), intent(in) :: m_star(lanes), weight(lanes)
    real(wp), intent(in) :: history(lanes, history_size)  !! already brought forward
    real(wp), intent(inout) :: kept(:, :)                 !! (lanes, reals)
    real(wp), intent(inout) :: columns(column_count), work(additional_work_count)
    real(wp) :: some(3), response(3, lanes)
    integer(i4) :: k, range(2)

    if (law%additional%rolling > 0.0_wp .or. law%additional%twisting > 0.0_wp) then
      if (associated(law%base%response)) then
        range = place_of_memory(law, at)
        do k = 1, lanes
          response(:, k) = law%base%response(law%law_numbers_type, kept(k, range(1):range(2)))
        end do
        call rolling_block(b, constants_of(law%law_numbers_type), law%additional, h, m_star, &
                           weight, history, &
                           kept(:, at%rolling_at:at%rolling_at + rolling_reals - 1), some, response)
      else
        call rolling_block(b, constants_of(law%law_numbers_type), law%additional, h, m_star, &
                           weight, history, &
                           kept(:, at%rolling_at:at%rolling_at + rolling_reals - 1), some)
      end if
      columns(1) = columns(1) + some(1)
      columns(3) = columns(3) + some(2)
      work(work_rolling) = work(work_rolling) + some(3)
    end if
    if (law%additional%cohesion /= cohesion_none) then
      call cohesion_block(b, law, round, h, weight, history, &
                          kept(:, at%cohesion_at:at%cohesion_at + cohesion_reals - 1), some(:2))
      columns(4) = columns(4) + some(2)
      work(work_breakage) = work(work_breakage) + some(1)
    end if
  end subroutine add_laws

  !> Energy that additional contact models store in block k [J].
  pure real(wp) function additional_energy(law, k, pairs) result(energy)
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k
    type(dem_pairs_type), intent(in) :: pairs
    real(wp) :: weight(lanes)
    integer(i4) :: at
    energy = 0.0_wp
    if (.not. law%additional%used .and. pairs%additional%bond_at == 0) return
    weight = pairs%weight(:, min(k, size(pairs%weight, 2)))
    energy = stored_on_top(law, pairs%additional%kept_places_type, weight, &
                           pairs%additional%kept(:, :, k))
    at = pairs%additional%bond_at
    if (at > 0) energy = energy + bond_energy(pairs%additional%bond, weight, &
                                              pairs%additional%kept(:, at:at + bond_reals - 1, k))
  end function additional_energy

  !> The same of rolling resistance and cohesion [J].
  pure real(wp) function stored_on_top(law, at, weight, kept) result(energy)
    type(dem_law_type), intent(in) :: law
    type(kept_places_type), intent(in) :: at
    real(wp), intent(in) :: weight(lanes), kept(:, :)  !! [-], (lanes, reals)
    energy = 0.0_wp
    if (law%additional%rolling > 0.0_wp .or. law%additional%twisting > 0.0_wp) &
      energy = energy + rolling_energy(law%additional, weight, &
                                       kept(:, at%rolling_at:at%rolling_at + rolling_reals - 1))
    if (law%additional%cohesion /= cohesion_none) &
      energy = energy + cohesion_energy(law, weight, &
        kept(:, at%cohesion_at:at%cohesion_at + cohesion_reals - 1))
  end function stored_on_top

  !> Stiffness that additional contact models add to a lane: of translation [N/m] and of rotation
  !! [N m].
  pure function additional_stiffness(law, lane, k, pairs) result(stiffness)
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: lane, k
    type(dem_pairs_type), intent(in) :: pairs
    real(wp) :: stiffness(2)
    integer(i4) :: at
    stiffness = 0.0_wp
    at = pairs%additional%bond_at
    if (at > 0) stiffness = bond_stiffness(pairs%additional%bond, &
                                           pairs%additional%kept(lane, at:at + bond_reals - 1, k))
    stiffness = stiffness + stiffness_on_top(law, pairs%additional%kept_places_type, &
                                             pairs%additional%kept(lane, :, k))
  end function additional_stiffness

  !> The same of rolling resistance and cohesion.
  pure function stiffness_on_top(law, at, kept) result(stiffness)
    type(dem_law_type), intent(in) :: law
    type(kept_places_type), intent(in) :: at
    real(wp), intent(in) :: kept(:)  !! (reals) of the lane
    real(wp) :: stiffness(2)
    stiffness = 0.0_wp
    if (.not. law%additional%used) return
    if (law%additional%rolling > 0.0_wp .or. law%additional%twisting > 0.0_wp) &
      stiffness(2) = kept(at%rolling_at + rolling_reals - 1) &
                     *max(law%additional%rolling_stiffness, law%additional%twisting_stiffness)
    if (law%additional%cohesion == cohesion_jkr) stiffness(1) = neck_stiffness( &
      law, kept(at%cohesion_at:at%cohesion_at + cohesion_reals - 1))
  end function stiffness_on_top

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
    d%ledger%rolling = d%ledger%rolling + total(1)
    d%ledger%breakage = d%ledger%breakage + total(2)
    d%pairs%additional%broken = d%pairs%additional%broken + total(work_torn:work_sheared)
    call count_broken(d%pairs%additional)
  end subroutine add_additional_work
end module dem_additional
