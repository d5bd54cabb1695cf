!> Contact forces in parts (theory: overlap coupling, Time): pairs of two ghosts once an exchange,
!! the others in every step. Forces that a partner waits for are reported as early as possible:
!! pairs without ghosts may be evaluated before the ghosts are placed, or after the forces on them
!! were reported, a slice at a time while the partner works. Results do not depend on the slices.
module dem_parts_forces
  use, intrinsic :: omp_lib, only: omp_get_thread_num, omp_get_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4
  use dem_forces, only: block_forces, sum_body
  use dem_integrate, only: work_count
  use dem_lanes, only: finish_puts
  use dem_parts, only: sum_part, finish_part
  use dem_prescribed, only: finish_prescribed
  use dem_state, only: dem_data_type, kind_free, kind_fixed, kind_ghost
  use dem_law_state, only: column_count, column_plastic
  use dem_relist, only: rebuild_list, travel_of, larger
  use dem_chunks, only: finish_planes
  use dem_membrane_forces, only: share_near
  use dem_surface_forces, only: surface_load
  use dem_surface_motion, only: surface_travel, surface_columns
  implicit none
  private
  public :: begin_ahead, is_left, slice_of_free, forces_on_rim, forces_on_free, &
    forces_between_ghosts
  public :: stage_none, stage_reported

  integer(i4), parameter :: stage_none = 0   !! all forces are those of now
  integer(i4), parameter :: stage_ahead = 1  !! free grains have moved, ghosts have yet to
  integer(i4), parameter :: stage_reported = 2   !! forces on ghosts are those of now
  integer(i4), parameter :: slice = 16       !! blocks of a thread between two checks of the port

contains

  !> Free grains are at their new places, with their bodies up to date.
  subroutine begin_ahead(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: travel
    integer(i4) :: i
    travel = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_fixed .or. d%grains%kind(i) == kind_ghost) cycle
      travel = larger(travel, travel_of(d, i))
    end do
    do i = 1, d%planes%n
      travel = larger(travel, norm2(d%planes%point(:, i) &
                                    - d%pairs%reference_x(:, d%grains%n + 3 + i)))
    end do
    if (d%surfaces%n > 0) travel = larger(travel, surface_travel(d%surfaces))
    if (.not. travel <= 0.5_wp*d%pairs%skin) then
      call rebuild_list(d, travel, d%pending)
      travel = 0.0_wp
    end if
    d%parts%travel = travel
    d%parts%next = 1
    d%parts%stage = stage_ahead
  end subroutine begin_ahead

  !> Is there something to do before the partner speaks again?
  pure logical function is_left(d)
    type(dem_data_type), intent(in) :: d
    is_left = d%parts%stage == stage_reported .or. &
      (d%parts%stage == stage_ahead .and. d%parts%next <= d%pairs%bare_blocks)
  end function is_left

  !> A slice of the pairs without ghosts; after the last one, if forces on ghosts have been
  !! reported, the sums.
  subroutine slice_of_free(d)
    type(dem_data_type), intent(inout) :: d
    if (d%parts%stage == stage_none) return
    if (d%parts%next <= d%pairs%bare_blocks) then
      call evaluate_bare(d, d%parts%next + slice*omp_get_max_threads() - 1)
    else if (d%parts%stage == stage_reported) then
      call sum_up(d)
    end if
  end subroutine slice_of_free

  !> Contacts of ghosts with other grains over the pending drift. Bodies of ghosts near these are up
  !! to date.
  subroutine forces_on_rim(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: travel, force(3), moment(3), work(work_count)
    integer(i4) :: i, k

    if (d%parts%stage == stage_none) call begin_ahead(d)
    travel = 0.0_wp
    do k = 1, size(d%parts%near)
      travel = larger(travel, travel_of(d, d%parts%near(k)))
    end do
    call renew_on_the_way(d, travel)
    call evaluate(d, d%pairs%bare_blocks + 1, d%pairs%rim_blocks, d%pending, &
                  larger(d%parts%travel, travel))
    work = 0.0_wp
    do k = 1, size(d%parts%near)
      i = d%parts%near(k)
      call sum_part(d, i, .false., force, moment)
      call finish_part(d, i, d%pending, force, moment, d%parts%of_free(:, i), work)
    end do
    d%ledger%boundary = d%ledger%boundary + work(4)
    d%parts%stage = stage_reported
  end subroutine forces_on_rim

  !> All contacts of free grains over the pending drift, or what is left of them.
  subroutine forces_on_free(d)
    type(dem_data_type), intent(inout) :: d
    if (d%parts%stage /= stage_reported) call forces_on_rim(d)
    call evaluate_bare(d, d%pairs%bare_blocks)
    call sum_up(d)
  end subroutine forces_on_free

  !> Contacts between ghosts over the drift since they were evaluated, with the mean velocities of
  !! that time. All ghosts must have been placed. Alone: contacts of free grains do not come next.
  subroutine forces_between_ghosts(d, alone)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: alone
    real(wp) :: h, travel, force(3), moment(3), work(work_count)
    integer(i4) :: i

    if (d%parts%stage == stage_none .and. .not. alone) call begin_ahead(d)
    h = d%parts%pending
    travel = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_ghost) travel = larger(travel, travel_of(d, i))
    end do
    call renew_on_the_way(d, travel)
    call evaluate(d, d%pairs%rim_blocks + 1, d%pairs%grain_blocks, h, travel)
    call note_columns(d, d%pairs%rim_blocks + 1, d%pairs%grain_blocks)
    work = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_ghost) cycle
      call sum_part(d, i, .true., force, moment)
      call finish_part(d, i, h, force, moment, d%parts%of_ghosts(:, i), work)
      d%grains%theta(:, i) = d%grains%theta(:, i) + h*d%grains%omega(:, i)
    end do
    d%ledger%boundary = d%ledger%boundary + work(4)
    d%parts%pending = 0.0_wp
  end subroutine forces_between_ghosts

  !> The list is rebuilt if ghosts have used it up while pairs without them are under way: these are
  !! evaluated to the end first, and keep their forces.
  subroutine renew_on_the_way(d, travel)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(inout) :: travel  !! of ghosts [m]
    if (travel <= 0.5_wp*d%pairs%skin) return
    if (d%parts%stage /= stage_none) then
      call evaluate_bare(d, d%pairs%bare_blocks)
      call note_columns(d, 1_i4, d%pairs%bare_blocks)
    end if
    d%pairs%keep_results = .true.
    call rebuild_list(d, larger(d%parts%travel, travel), d%pending)
    d%pairs%keep_results = .false.
    d%parts%next = d%pairs%bare_blocks + 1
    d%parts%travel = 0.0_wp
    travel = 0.0_wp
  end subroutine renew_on_the_way

  !> Pairs without ghosts, from the one that is due up to `last`.
  subroutine evaluate_bare(d, last)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: last
    integer(i4) :: first
    first = d%parts%next
    d%parts%next = min(last, d%pairs%bare_blocks) + 1
    call evaluate(d, first, d%parts%next - 1, d%pending, d%parts%travel)
  end subroutine evaluate_bare

  !> What is no pair of grains, then the sums on free grains and planes, and the ledger.
  subroutine sum_up(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: force(3), moment(3), load(6), work(work_count)
    integer(i4) :: i

    call evaluate(d, d%pairs%grain_blocks + 1, d%pairs%blocks, d%pending, d%parts%travel)
    if (d%surfaces%list%near > 0) then
      !$omp parallel default(none) shared(d)
      call share_near(d, d%pending, d%parts%travel, omp_get_thread_num(), omp_get_num_threads())
      !$omp end parallel
    end if
    work = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_ghost) cycle
      call sum_body(d%pairs, i, force, moment)
      if (d%grains%kind(i) /= kind_free) then
        call finish_prescribed(d%grains, i, d%pending, force, moment, work)
        cycle
      end if
      if (d%surfaces%list%near > 0) then
        load = surface_load(d%surfaces, i)
        force = force + load(1:3)
        moment = moment + load(4:6)
      end if
      d%grains%force(:, i) = force
      d%grains%moment(:, i) = moment
    end do
    call finish_planes(d, d%pending, work)
    d%ledger%boundary = d%ledger%boundary + work(4)
    call note_columns(d, 1_i4, d%pairs%rim_blocks)
    call note_columns(d, d%pairs%grain_blocks + 1, d%pairs%blocks)
    if (d%surfaces%list%near > 0) call note(d, surface_columns(d%surfaces))
    d%health%evaluations = d%health%evaluations + 1
    d%pending = 0.0_wp
    d%parts%stage = stage_none
  end subroutine sum_up

  !> Blocks from first to last, those of each group shared among the threads.
  subroutine evaluate(d, first, last, h, travel)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: first, last
    real(wp), intent(in) :: h, travel  !! [s], [m]
    integer(i4) :: g, k, base
    logical :: deep  ! not noted: no step is taken

    if (first > last) return
    !$omp parallel default(none) shared(d, h, travel, first, last) private(g, k, base, deep)
    base = 0
    do g = 1, d%pairs%groups
      if (d%pairs%group_end(g) >= first .and. base < last) then
        !$omp do schedule(static)
        do k = max(first, base + 1), min(last, d%pairs%group_end(g))
          call block_forces(d%pairs, d%laws, d%grains%shapes, k, h, travel, deep)
        end do
        !$omp end do nowait
      end if
      base = d%pairs%group_end(g)
    end do
    if (d%pairs%past > 0) call finish_puts()
    !$omp end parallel
  end subroutine evaluate

  !> Works of the blocks from first to last go into the ledger, in their order.
  subroutine note_columns(d, first, last)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: first, last
    real(wp) :: total(column_count)
    integer(i4) :: k
    total = 0.0_wp
    do k = first, last
      total = total + d%pairs%columns(:, k)
    end do
    call note(d, total)
  end subroutine note_columns

  subroutine note(d, total)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: total(column_count)  !! see dem_law_state [J]
    d%ledger%contact_damping = d%ledger%contact_damping + total(1)
    d%ledger%friction = d%ledger%friction + total(2)
    d%ledger%tangential_relaxation = d%ledger%tangential_relaxation + total(3)
    d%ledger%curvature = d%ledger%curvature + total(4)
    d%ledger%plastic = d%ledger%plastic + total(column_plastic)
  end subroutine note
end module dem_parts_forces
