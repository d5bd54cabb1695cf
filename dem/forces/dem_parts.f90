!> Forces in two parts for a partner that moves ghosts: contacts of free grains in every step, those
!! between ghosts once an exchange (theory: overlap coupling, Time).
!!
!! Only active ghosts, those near free grains, are then placed in every step. The partner selects
!! them again after each rebuild of the list; until then no other ghost can reach a free grain.
module dem_parts
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use dem_cells, only: find_candidates
  use dem_shape_state, only: put_frame
  use dem_integrate, only: work_count
  use dem_margin, only: spare_margins, chosen_spare
  use dem_prescribed, only: put_body, finish_prescribed
  use dem_state, only: dem_data_type, kind_free, kind_ghost, lanes, history_side
  implicit none
  private
  public :: find_border, choose_border, border_is_old, place_ghosts, check_border, sum_part, &
    finish_part

  real(wp), parameter :: reach = 2.6_wp  !! of the border in skins: two lists, the next one wider

contains

  !> Ghosts that a free grain can reach before the second rebuild of the list.
  subroutine find_border(d, near)
    type(dem_data_type), intent(in) :: d
    integer(i4), allocatable, intent(out) :: near(:)
    integer(i4), allocatable :: first(:), second(:)
    logical :: mark(d%grains%n)
    integer(i4) :: count, k, i

    call find_candidates(d%pairs%body, d%grains%radius, spare_margins(d%pairs, d%grains%n) &
                         + chosen_spare(d), d%grains%kind, reach*d%pairs%skin, .false., first, &
                         second, count)
    mark = .false.
    do k = 1, count
      mark(first(k)) = .true.
      mark(second(k)) = .true.
    end do
    near = pack([(i, i=1, d%grains%n)], mark .and. d%grains%kind == kind_ghost)
  end subroutine find_border

  !> Begin evaluation in parts, with these ghosts active.
  subroutine choose_border(d, near)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: near(:)
    integer(i4) :: i
    associate (parts => d%parts)
      parts%near = near
      if (.not. allocated(parts%is_near)) allocate (parts%is_near(d%grains%n))
      parts%is_near = .false.
      parts%is_near(near) = .true.
      parts%chosen = d%health%rebuilds
      parts%spare = chosen_spare(d)
      parts%active = .true.
      if (allocated(parts%of_free)) return
      allocate (parts%of_free(6, d%grains%n), parts%of_ghosts(6, d%grains%n), source=0.0_wp)
      do i = 1, d%grains%n
        if (d%grains%kind(i) /= kind_ghost) cycle
        call sum_part(d, i, .false., parts%of_free(:3, i), parts%of_free(4:, i))
        call sum_part(d, i, .true., parts%of_ghosts(:3, i), parts%of_ghosts(4:, i))
      end do
    end associate
  end subroutine choose_border

  !> Was the list rebuilt since the border was chosen?
  pure logical function border_is_old(d)
    type(dem_data_type), intent(in) :: d
    border_is_old = d%parts%active .and. d%parts%chosen /= d%health%rebuilds
  end function border_is_old

  !> Place, velocity and spin of ghosts now.
  subroutine place_ghosts(d, index, x, quat, v, omega)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x(:, :), quat(:, :), v(:, :), omega(:, :)
    integer(i4) :: k, i
    do k = 1, size(index)
      i = index(k)
      d%grains%x(:, i) = x(:, k)
      d%grains%quat(:, i) = quat(:, k)
      d%grains%v(:, i) = v(:, k)
      d%grains%omega(:, i) = omega(:, k)
      call put_body(d%grains, i, d%pairs%body(:, i))
      call put_frame(d%grains%shapes, i, d%grains%quat(:, i))
    end do
  end subroutine place_ghosts

  !> Impulse and work of one part of what acts on a ghost; the grain holds the sum of both.
  subroutine finish_part(d, i, h, force, moment, part, work)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: h, force(3), moment(3)
    real(wp), intent(inout) :: part(6)          !! force and moment before and after [N], [N m]
    real(wp), intent(inout) :: work(work_count)
    d%grains%force(:, i) = part(:3)
    d%grains%moment(:, i) = part(4:)
    call finish_prescribed(d%grains, i, h, force, moment, work)
    part = [force, moment]
    d%grains%force(:, i) = d%parts%of_free(:3, i) + d%parts%of_ghosts(:3, i)
    d%grains%moment(:, i) = d%parts%of_free(4:, i) + d%parts%of_ghosts(4:, i)
  end subroutine finish_part

  !> N224: a ghost that is not active touches a free grain.
  subroutine check_border(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i, e, slot, lane, block

    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_ghost .or. d%parts%is_near(i)) cycle
      do e = d%pairs%start(i), d%pairs%start(i + 1) - 1
        slot = d%pairs%entry(e)/2
        lane = 1 + mod(slot, lanes)
        block = 1 + slot/lanes
        if (.not. d%pairs%history(lane, history_side, block) > 0.0_wp) cycle
        if (block > d%pairs%rim_blocks .and. block <= d%pairs%grain_blocks) cycle
        call errors%add('N224', 'ghost '//str(d%grains%id(i))//' touches a free grain, but was '// &
                        'too far from all when the ghosts near them were chosen', &
                        place='step '//str(d%health%steps), &
                        hint='shorten &clock exchange: grains come too far in one')
        return
      end do
    end do
  end subroutine check_border

  !> Force and moment on a ghost: its contacts with ghosts, or those with free grains, in the order
  !! of partner ids.
  pure subroutine sum_part(d, i, ghosts, force, moment)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    logical, intent(in) :: ghosts
    real(wp), intent(out) :: force(3), moment(3)
    real(wp) :: total(6)
    integer(i4) :: e, slot, low, high

    total = 0.0_wp
    low = lanes*d%pairs%rim_blocks
    high = lanes*d%pairs%grain_blocks
    do e = d%pairs%start(i), d%pairs%start(i + 1) - 1
      slot = d%pairs%entry(e)/2
      if (slot >= low .and. slot < high) then  ! two ghosts
        if (.not. ghosts) cycle
      else if (with_free(d, d%pairs%entry(e)) .eqv. ghosts) then
        cycle
      end if
      if (mod(d%pairs%entry(e), 2) == 1) then
        total = total + d%pairs%result(1:6, slot + 1)
      else
        total = total - d%pairs%result(1:6, slot + 1)
      end if
    end do
    force = total(1:3)
    associate (x => d%pairs%body(1:3, i))
      moment(1) = total(4) - (x(2)*total(3) - x(3)*total(2))
      moment(2) = total(5) - (x(3)*total(1) - x(1)*total(3))
      moment(3) = total(6) - (x(1)*total(2) - x(2)*total(1))
    end associate
  end subroutine sum_part

  !> Is the partner in this pair a free grain, or no grain?
  pure logical function with_free(d, entry)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: entry
    integer(i4) :: slot, other
    slot = entry/2
    if (mod(entry, 2) == 1) then
      other = d%pairs%first(1 + mod(slot, lanes), 1 + slot/lanes)
    else
      other = d%pairs%second(1 + mod(slot, lanes), 1 + slot/lanes)
    end if
    with_free = .true.
    if (other <= d%grains%n) with_free = d%grains%kind(other) == kind_free
  end function with_free
end module dem_parts
