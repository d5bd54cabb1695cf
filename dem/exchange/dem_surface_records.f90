!> Contacts of grains with surfaces as rows of reals, to be sent to other ranks, and back.
module dem_surface_records
  use talus_kinds, only: wp, i4, i8
  use dem_make, only: sorted_order
  use dem_record_layout, only: touch_grain, touch_count, touch_load, slot_history, slot_foot, &
    slot_normal, slot_point, slot_push, slot_motion, slot_part, slot_sign, slot_offset
  use dem_records, only: index_of
  use dem_state, only: dem_data_type, lanes
  use dem_surface_additional, only: surface_kept_reals
  use dem_surface_contacts, only: begin_list, allocate_contacts, drop_contacts, set_contacts, &
    set_slots, set_offsets, set_kept
  use dem_surface_state, only: dem_touches_type
  implicit none
  private
  public :: pack_touches, receive_touches, pack_touch, unpack_touch

  integer(i4), parameter :: head_reals = touch_load(2)  !! of a grain that has contacts
  integer(i4), parameter :: slot_reals = slot_offset(2)  !! of a contact, without additional models

contains

  !> Contacts of grains with surfaces: a column a grain, first its id. Collective over all ranks.
  subroutine pack_touches(d, rows)
    type(dem_data_type), intent(in) :: d
    real(wp), allocatable, intent(out) :: rows(:, :)
    integer(i4) :: g, n, slots
    slots = slots_in_use(d)
    n = 0
    if (d%surfaces%list%near > 0) n = int(count(d%surfaces%list%contacts > 0), i4)
    allocate (rows(head_reals + slots*reals_of(d), n))
    n = 0
    do g = 1, d%surfaces%list%near
      if (d%surfaces%list%contacts(g) == 0) cycle
      n = n + 1
      call pack_touch(d, g, slots, rows(:, n))
    end do
  end subroutine pack_touches

  !> Contacts of a grain that there is room for in a row. There is much room beside membranes, of
  !! which few grains need more than a little.
  integer(i4) function slots_in_use(d) result(slots)
    type(dem_data_type), intent(in) :: d
    real(wp) :: most(1)
    slots = lanes
    if (.not. allocated(d%surfaces%membranes)) return
    most = 1.0_wp
    if (d%surfaces%list%near > 0) most = max(most, real(maxval(d%surfaces%list%contacts), wp))
    call d%halo%team%most(most)
    slots = nint(most(1), i4)
  end function slots_in_use

  !> Reals of a contact in a row, with those that additional models keep.
  pure integer(i4) function reals_of(d) result(reals)
    type(dem_data_type), intent(in) :: d
    reals = surface_kept_reals(d)
    reals = slot_reals + merge(reals + 3, 0_i4, reals > 0)
  end function reals_of

  !> The n contacts of near grain g, and what is the grain's.
  pure subroutine pack_touch(d, g, n, row)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: g, n
    real(wp), intent(out) :: row(:)
    real(wp) :: slot(n, slot_reals)
    integer(i4) :: base
    base = head_reals + n*slot_reals
    associate (s => d%surfaces)
      row(touch_grain) = real(d%grains%id(s%list%near_grain(g)), wp)
      row(touch_count) = real(s%list%contacts(g), wp)
      row(touch_load(1):touch_load(2)) = s%list%load(:, g)
      slot(:, slot_history(1):slot_history(2)) = s%list%history(:n, :, g)
      slot(:, slot_foot(1):slot_foot(2)) = s%list%foot(:n, :, g)
      slot(:, slot_normal(1):slot_normal(2)) = s%list%normal(:n, :, g)
      slot(:, slot_point(1):slot_point(2)) = s%list%point(:n, :, g)
      slot(:, slot_push(1):slot_push(2)) = s%list%push(:n, :, g)
      slot(:, slot_motion(1):slot_motion(2)) = s%list%motion(:n, :, g)
      slot(:, slot_part) = real(s%list%part(:n, g), wp)
      slot(:, slot_sign) = s%list%sign(:n, g)
      slot(:, slot_offset(1):slot_offset(2)) = s%list%offset(:n, :, g)
      row(head_reals + 1:base) = reshape(slot, [size(slot)])
      if (size(s%list%kept) > 0) row(base + 1:) = [s%list%kept(:n, :, g), s%list%couple(:n, :, g)]
    end associate
  end subroutine pack_touch

  !> The same back, but for the grain's id.
  pure subroutine unpack_touch(row, list, g, n)
    real(wp), intent(in) :: row(:)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g, n
    real(wp) :: slot(n, slot_reals)
    integer(i4) :: base, kept
    base = head_reals + size(slot, kind=i4)
    slot = reshape(row(head_reals + 1:base), shape(slot))
    call set_contacts(list, g, nint(row(touch_count), i4), nint(slot(:, slot_part), i4), &
                      slot(:, slot_sign), row(touch_load(1):touch_load(2)))
    call set_slots(list, g, slot)
    call set_offsets(list, g, slot(:, slot_offset(1):slot_offset(2)))
    if (size(list%kept) == 0) return
    kept = size(list%kept, 2, i4)
    call set_kept(list, g, reshape(row(base + 1:base + n*kept), [n, kept]), &
                  reshape(row(base + n*kept + 1:), [n, 3_i4]))
  end subroutine unpack_touch

  !> Store these contacts as those of the last list of d: the next list inherits them.
  subroutine receive_touches(d, rows)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: rows(:, :)
    integer(i4), allocatable :: order(:), grain(:)
    integer(i4) :: g, n, slots

    slots = (size(rows, 1, i4) - head_reals)/reals_of(d)
    associate (s => d%surfaces)
      call drop_contacts(s%list)
      n = size(rows, 2)
      grain = [(index_of(d, rows(touch_grain, g)), g=1, n)]
      order = sorted_order(int(grain, i8))
      call begin_list(s%list, grain(order), [(1_i4, g=1, n + 1)], [integer(i4) ::], &
                      reshape([real(wp) ::], [3, 0]), [(0.0_wp, g=1, n)])
      call allocate_contacts(s, d%grains%n, surface_kept_reals(d))
      do g = 1, n
        call unpack_touch(rows(:, order(g)), s%list, g, slots)
      end do
    end associate
  end subroutine receive_touches
end module dem_surface_records
