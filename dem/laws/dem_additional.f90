!> Additional contact models, block by block: forces, stored energy, stiffness, kept reals.
module dem_additional
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_state, only: dem_pairs_type, dem_law_type, dem_data_type, lanes, history_size, &
    column_count
  use dem_additional_state, only: dem_extras_type, extra_places_type, rolling_reals, &
    cohesion_reals, bond_reals, kept_part_type, part_rolling, part_cohesion, part_bond, &
    cohesion_none, cohesion_jkr, extra_work_count, &
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
  public :: plan_extras, check_necks, extra_forces, extra_energy, extra_stiffness, add_extra_work
  public :: add_laws, stored_on_top, stiffness_on_top

contains

  !> What contacts must keep for the laws of a run.
  subroutine plan_extras(laws, extras)
    type(dem_law_type), intent(in) :: laws(:, :)
    type(dem_extras_type), intent(inout) :: extras

    extras%active = any(laws%extra%used .or. laws%base%reals > 0) .or. extras%bond%given
    extras%reals = 0
    extras%rolling_at = 0
    extras%cohesion_at = 0
    extras%bond_at = 0
    if (any(laws%extra%rolling > 0.0_wp .or. laws%extra%twisting > 0.0_wp)) &
      call reserve(rolling_reals, extras%rolling_at)
    extras%part(part_rolling) = kept_part_type('rolling', rolling_reals, extras%rolling_at)
    if (any(laws%extra%cohesion /= cohesion_none)) &
      call reserve(cohesion_reals, extras%cohesion_at)
    extras%part(part_cohesion) = kept_part_type('cohesion', cohesion_reals, extras%cohesion_at)
    if (extras%bond%given) call reserve(bond_reals, extras%bond_at)
    extras%part(part_bond) = kept_part_type('bond', bond_reals, extras%bond_at)
    call memory_places(laws, extras)

  contains

    subroutine reserve(reals, place)
      integer(i4), intent(in) :: reals
      integer(i4), intent(out) :: place
      place = extras%reals + 1
      extras%reals = extras%reals + reals
    end subroutine reserve
  end subroutine plan_extras

  !> Necks must tear before the list loses their pairs (I219).
  subroutine check_necks(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: length
    integer(i4) :: a, b

    length = 0.0_wp
    do a = 1, size(d%laws, 1)
      do b = 1, size(d%laws, 2)
        if (d%laws(a, b)%extra%cohesion /= cohesion_jkr) cycle
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
  subroutine extra_forces(b, law, k, h, pairs)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k  !! block
    real(wp), intent(in) :: h     !! time since the last evaluation [s]
    type(dem_pairs_type), intent(inout) :: pairs
    real(wp) :: weight(lanes), work(2)
    integer(i4) :: at

    if (.not. law%extra%used .and. pairs%extras%bond_at == 0) return
    weight = pairs%weight(:, min(k, size(pairs%weight, 2)))
    call add_laws(b, law, pairs%extras%extra_places_type, pairs%round(k), h, pairs%m_star(:, k), &
                  weight, pairs%history(:, :, k), pairs%extras%kept(:, :, k), pairs%columns(:, k), &
                  pairs%extras%work(:, k))
    if (pairs%extras%bond_at > 0) then
      at = pairs%extras%bond_at
      call bond_block(b, law, pairs%extras%bond, h, pairs%m_star(:, k), weight, &
                      pairs%extras%kept(:, at:at + bond_reals - 1, k), work, &
                      pairs%extras%work(:, k))
      pairs%columns(1, k) = pairs%columns(1, k) + work(1)
      pairs%columns(3, k) = pairs%columns(3, k) + work(2)
    end if
    pairs%touched(k) = pairs%touched(k) .or. any(held_lanes(pairs%extras, k))
  end subroutine extra_forces

  !> Rolling resistance and cohesion of a block, wherever its history and kept reals lie.
  pure subroutine add_laws(b, law, at, round, h, m_star, weight, history, kept, columns, work)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    type(extra_places_type), intent(in) :: at
    logical, intent(in) :: round                          !! all pairs are of spheres
    real(wp), intent(in) :: h                             !! time since the last evaluation [s]
    real(wp), intent(in) :: m_star(lanes), weight(lanes)
    real(wp), intent(in) :: history(lanes, history_size)  !! already brought forward
    real(wp), intent(inout) :: kept(:, :)                 !! (lanes, reals)
    real(wp), intent(inout) :: columns(column_count), work(extra_work_count)
    real(wp) :: some(3), response(3, lanes)
    integer(i4) :: k, range(2)

    if (law%extra%rolling > 0.0_wp .or. law%extra%twisting > 0.0_wp) then
      if (associated(law%base%response)) then
        range = place_of_memory(law, at)
        do k = 1, lanes
          response(:, k) = law%base%response(law%law_numbers_type, kept(k, range(1):range(2)))
        end do
        call rolling_block(b, constants_of(law%law_numbers_type), law%extra, h, m_star, weight, &
                           history, &
                           kept(:, at%rolling_at:at%rolling_at + rolling_reals - 1), some, response)
      else
        call rolling_block(b, constants_of(law%law_numbers_type), law%extra, h, m_star, weight, &
                           history, &
                           kept(:, at%rolling_at:at%rolling_at + rolling_reals - 1), some)
      end if
      columns(1) = columns(1) + some(1)
      columns(3) = columns(3) + some(2)
      work(work_rolling) = work(work_rolling) + some(3)
    end if
    if (law%extra%cohesion /= cohesion_none) then
      call cohesion_block(b, law, round, h, weight, history, &
                          kept(:, at%cohesion_at:at%cohesion_at + cohesion_reals - 1), some(:2))
      columns(4) = columns(4) + some(2)
      work(work_breakage) = work(work_breakage) + some(1)
    end if
  end subroutine add_laws

  !> Energy that additional contact models store in block k [J].
  pure real(wp) function extra_energy(law, k, pairs) result(energy)
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: k
    type(dem_pairs_type), intent(in) :: pairs
    real(wp) :: weight(lanes)
    integer(i4) :: at
    energy = 0.0_wp
    if (.not. law%extra%used .and. pairs%extras%bond_at == 0) return
    weight = pairs%weight(:, min(k, size(pairs%weight, 2)))
    energy = stored_on_top(law, pairs%extras%extra_places_type, weight, pairs%extras%kept(:, :, k))
    at = pairs%extras%bond_at
    if (at > 0) energy = energy + bond_energy(pairs%extras%bond, weight, &
                                              pairs%extras%kept(:, at:at + bond_reals - 1, k))
  end function extra_energy

  !> The same of rolling resistance and cohesion [J].
  pure real(wp) function stored_on_top(law, at, weight, kept) result(energy)
    type(dem_law_type), intent(in) :: law
    type(extra_places_type), intent(in) :: at
    real(wp), intent(in) :: weight(lanes), kept(:, :)  !! [-], (lanes, reals)
    energy = 0.0_wp
    if (law%extra%rolling > 0.0_wp .or. law%extra%twisting > 0.0_wp) &
      energy = energy + rolling_energy(law%extra, weight, &
                                       kept(:, at%rolling_at:at%rolling_at + rolling_reals - 1))
    if (law%extra%cohesion /= cohesion_none) &
      energy = energy + cohesion_energy(law, weight, &
        kept(:, at%cohesion_at:at%cohesion_at + cohesion_reals - 1))
  end function stored_on_top

  !> Stiffness that additional contact models add to a lane: of translation [N/m] and of rotation
  !! [N m].
  pure function extra_stiffness(law, lane, k, pairs) result(stiffness)
    type(dem_law_type), intent(in) :: law
    integer(i4), intent(in) :: lane, k
    type(dem_pairs_type), intent(in) :: pairs
    real(wp) :: stiffness(2)
    integer(i4) :: at
    stiffness = 0.0_wp
    at = pairs%extras%bond_at
    if (at > 0) stiffness = bond_stiffness(pairs%extras%bond, &
                                           pairs%extras%kept(lane, at:at + bond_reals - 1, k))
    stiffness = stiffness + stiffness_on_top(law, pairs%extras%extra_places_type, &
                                             pairs%extras%kept(lane, :, k))
  end function extra_stiffness

  !> The same of rolling resistance and cohesion.
  pure function stiffness_on_top(law, at, kept) result(stiffness)
    type(dem_law_type), intent(in) :: law
    type(extra_places_type), intent(in) :: at
    real(wp), intent(in) :: kept(:)  !! (reals) of the lane
    real(wp) :: stiffness(2)
    stiffness = 0.0_wp
    if (.not. law%extra%used) return
    if (law%extra%rolling > 0.0_wp .or. law%extra%twisting > 0.0_wp) &
      stiffness(2) = kept(at%rolling_at + rolling_reals - 1) &
                     *max(law%extra%rolling_stiffness, law%extra%twisting_stiffness)
    if (law%extra%cohesion == cohesion_jkr) stiffness(1) = neck_stiffness( &
      law, kept(at%cohesion_at:at%cohesion_at + cohesion_reals - 1))
  end function stiffness_on_top

  !> Block sums into the ledger, in the order of blocks.
  pure subroutine add_extra_work(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: total(extra_work_count)
    integer(i4) :: k
    total = 0.0_wp
    if (allocated(d%pairs%share)) then
      do k = 1, d%pairs%blocks
        total = total + d%pairs%share(k)*d%pairs%extras%work(:, k)
      end do
    else
      do k = 1, d%pairs%blocks
        total = total + d%pairs%extras%work(:, k)
      end do
    end if
    d%ledger%rolling = d%ledger%rolling + total(1)
    d%ledger%breakage = d%ledger%breakage + total(2)
    d%pairs%extras%broken = d%pairs%extras%broken + total(work_torn:work_sheared)
    call count_broken(d%pairs%extras)
  end subroutine add_extra_work
end module dem_additional
