!> Contacts received from elsewhere, stored as the last list: the next list inherits normals and
!! history from them as from its own.
module dem_received_contacts
  use talus_kinds, only: wp, i4, i8
  use dem_state, only: dem_data_type, lanes, history_size, entries_ahead
  use dem_cell, only: is_periodic
  use dem_forces, only: sum_body
  use dem_images, only: name_images, image_of
  use dem_candidates, only: slot_of
  use dem_record_layout, only: at_first_id, at_second_id
  use dem_records, only: unpack_contact, unpack_result, shift_of, index_of
  implicit none
  private
  public :: receive_contacts, give_results

  integer(i4), parameter :: most_gaps = 4  !! ids a contact, for a table of them

contains

  !> Contacts as the last list of d; those with a body that is not in d are left out.
  subroutine receive_contacts(d, contact)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: contact(:, :)  !! rows of dem_records, as columns
    integer(i4), allocatable :: first(:), second(:)
    integer(i4) :: k, m, at, lane, block
    integer(i4), allocatable :: fill(:)

    call find_bodies(d, contact, first, second)
    if (is_periodic(d%cell)) call name_images(d%pairs, d%grains%n, shifts_of(contact), second)
    m = size(first)
    call make_room(d, (m + lanes - 1)/lanes)
    associate (p => d%pairs)
      allocate (p%start(p%plain + 1), source=0_i4)
      allocate (p%entry(m + entries_ahead), source=0_i4)
      do k = 1, m
        if (first(k) == 0 .or. second(k) == 0) cycle
        p%start(first(k) + 1) = p%start(first(k) + 1) + 1
      end do
      p%start(1) = 1
      do k = 2, size(p%start)
        p%start(k) = p%start(k) + p%start(k - 1)
      end do
      fill = p%start
      do k = 1, m
        if (first(k) == 0 .or. second(k) == 0) cycle
        at = fill(first(k))
        fill(first(k)) = at + 1
        p%entry(at) = 2*(k - 1)
        lane = 1 + mod(k - 1, lanes)
        block = 1 + (k - 1)/lanes
        p%second(lane, block) = second(k)
        call unpack_contact(contact(:, k), d, lane, block)
      end do
    end associate
  end subroutine receive_contacts

  !> Bodies of contacts, 0 for those not known here. Where ids leave few gaps a table gives them.
  subroutine find_bodies(d, contact, first, second)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: contact(:, :)  !! rows of dem_records, as columns
    integer(i4), allocatable, intent(out) :: first(:), second(:)
    integer(i4), allocatable :: body(:)    !! of an id
    integer(i8) :: least, most
    integer(i4) :: k

    allocate (first(size(contact, 2)), second(size(contact, 2)))
    least = 1
    most = 0
    if (d%grains%n > 0) then
      least = d%grains%id(1)
      most = d%grains%id(d%grains%n)
    end if
    if (most - least < int(most_gaps, i8)*size(contact, 2)) then
      allocate (body(least:most), source=0_i4)
      do k = 1, d%grains%n
        body(d%grains%id(k)) = k
      end do
    end if
    do k = 1, size(contact, 2)
      first(k) = found(contact(at_first_id, k))
      second(k) = found(contact(at_second_id, k))
    end do

  contains

    pure integer(i4) function found(id)
      real(wp), intent(in) :: id
      if (id < 0.0_wp .or. .not. allocated(body)) then
        found = index_of(d, id)
        return
      end if
      found = 0
      if (nint(id, i8) >= least .and. nint(id, i8) <= most) found = body(nint(id, i8))
    end function found
  end subroutine find_bodies

  !> Shift of the second grain of each contact, in edges of the cell.
  pure function shifts_of(contact) result(shift)
    real(wp), intent(in) :: contact(:, :)
    integer(i4) :: shift(3, size(contact, 2)), k
    do k = 1, size(contact, 2)
      shift(:, k) = shift_of(contact(:, k))
    end do
  end function shifts_of

  !> Lists of d without any pair, blocks for some.
  subroutine make_room(d, blocks)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: blocks
    associate (p => d%pairs)
      if (allocated(p%first)) deallocate (p%first, p%second, p%weight, p%m_star, p%touched, &
                                          p%result, p%columns)
      if (allocated(p%start)) deallocate (p%start, p%entry)
      if (allocated(p%normal)) deallocate (p%normal, p%history)
      allocate (p%first(lanes, blocks), p%second(lanes, blocks), source=0_i4)
      allocate (p%normal(lanes, 3, blocks), p%history(lanes, history_size, blocks), source=0.0_wp)
      if (p%additional%active) then
        if (allocated(p%additional%kept)) deallocate (p%additional%kept)
        allocate (p%additional%kept(lanes, p%additional%reals, blocks), source=0.0_wp)
      end if
      allocate (p%weight(0, 0), p%m_star(0, 0), p%touched(0), p%result(0, 0), p%columns(0, 0))
    end associate
  end subroutine make_room

  !> History and forces of these contacts to the list of d, which has been made since: a new list
  !! finds the radius of two spheres anew, to rounding.
  subroutine give_results(d, contact)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: contact(:, :)
    integer(i4), allocatable :: first(:), second(:)
    integer(i4) :: k, slot
    real(wp) :: force(3), moment(3)
    call find_bodies(d, contact, first, second)
    do k = 1, size(contact, 2)
      if (first(k) == 0 .or. second(k) == 0) cycle
      if (d%pairs%images > 0) &
        second(k) = image_of(d%pairs, d%grains%n, second(k), shift_of(contact(:, k)))
      slot = slot_of(d%pairs, first(k), second(k))
      if (slot == 0) cycle
      call unpack_result(contact(:, k), d, slot)
    end do
    do k = 1, d%pairs%images
      call sum_body(d%pairs, d%pairs%plain + k, force, moment)
      d%pairs%image_force(:, k) = force
    end do
  end subroutine give_results
end module dem_received_contacts
