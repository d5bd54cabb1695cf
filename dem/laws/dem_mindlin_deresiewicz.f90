!> Base law 'mindlin_deresiewicz': Hertz, and slip that starts at the rim of contacts, all turning
!! points kept (dem_turning, dem_turning_springs).
module dem_mindlin_deresiewicz
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  use dem_law_state, only: base_law_type, law_numbers_type, history_size, column_count, &
    column_relaxation
  use dem_block, only: dem_block_type
  use dem_additional_state, only: turning_reals
  use dem_contact, only: contact_constants_type, contact_scratch_type, constants_of, &
    begin_contacts, approach_contacts, finish_contacts
  use dem_turning_springs, only: springs_step_type
  use dem_turning_block, only: advance_turnings
  implicit none
  private
  public :: mindlin_deresiewicz

contains

  pure function mindlin_deresiewicz() result(base)
    type(base_law_type) :: base
    base%name = 'mindlin_deresiewicz'
    base%forces => forces
    base%energy => energy
    base%memory = 'turning'
    base%reals = turning_reals
    base%starts = .false.
  end function mindlin_deresiewicz

  !> See forces_routine of dem_law_state.
  pure subroutine forces(b, law, round, h, m_star, weight, history, memory, columns)
    type(dem_block_type), intent(inout) :: b
    type(law_numbers_type), intent(in) :: law
    logical, intent(in) :: round
    real(wp), intent(in) :: h, m_star(lanes), weight(lanes)
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: memory(:, :)
    real(wp), intent(out) :: columns(column_count)
    type(contact_constants_type) :: c
    type(contact_scratch_type) :: s
    real(wp) :: excess(lanes)

    c = constants_of(law)
    call begin_contacts(b, c, round, h, m_star, history, s)
    call approach_contacts(b, c, h, s)
    call turning_springs(b, c, h, history, memory, s, excess)
    call finish_contacts(b, c, round, h, weight, s, history, columns)
    columns(column_relaxation) = columns(column_relaxation) - sum(weight*excess)
  end subroutine forces

  !> Tangential energy is that of all springs.
  pure subroutine energy(law, weight, memory, energy_of)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: weight(lanes), memory(:, :)
    real(wp), intent(inout) :: energy_of(2)
    integer(i4) :: k
    energy_of(2) = 0.0_wp
    do k = 1, lanes
      energy_of(2) = energy_of(2) + weight(k)*memory(k, 2)
    end do
  end subroutine energy

  !> Tangential forces with the memory of turning points.
  pure subroutine turning_springs(b, c, h, history, turning, s, excess)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: h, history(lanes, history_size)
    real(wp), intent(inout) :: turning(lanes, turning_reals)
    type(contact_scratch_type), intent(inout) :: s
    real(wp), intent(out) :: excess(lanes)  !! stored energy gained over that of one spring [J]
    type(springs_step_type) :: step
    real(wp) :: force(lanes, 3), stored(lanes)
    integer(i4) :: k

    step%stiffness = c%kt_a
    step%cone = c%friction*c%kn_a/c%kt_a
    !$omp simd
    do k = 1, lanes
      s%was(k) = history(k, 1)**2 + history(k, 2)**2 + history(k, 3)**2
      step%shift(k, 1) = -h*s%wx(k)
      step%shift(k, 2) = -h*s%wy(k)
      step%shift(k, 3) = -h*s%wz(k)
      step%normal(k, 1) = b%nx(k)
      step%normal(k, 2) = b%ny(k)
      step%normal(k, 3) = b%nz(k)
      step%spin(k) = 0.5_wp*h*((b%a%wx(k) + b%b%wx(k))*b%nx(k) + (b%a%wy(k) + b%b%wy(k))*b%ny(k) &
                               + (b%a%wz(k) + b%b%wz(k))*b%nz(k))
      step%overlap(k) = -b%gap(k)
      step%root(k) = s%root(k)
      stored(k) = turning(k, 2)
    end do
    call advance_turnings(s%on > 0.0_wp, step, turning, force, s%slip)
    !$omp simd
    do k = 1, lanes
      s%tx(k) = force(k, 1)
      s%ty(k) = force(k, 2)
      s%tz(k) = force(k, 3)
      s%t2(k) = force(k, 1)**2 + force(k, 2)**2 + force(k, 3)**2
      excess(k) = turning(k, 2) - stored(k) - 0.5_wp*(s%t2(k)*s%soft(k) &
                                                      - s%was(k)*s%soft_last(k))
    end do
  end subroutine turning_springs
end module dem_mindlin_deresiewicz
