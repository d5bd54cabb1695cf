!> The contacts of a system as a list, in an order that does not depend on its lists.
module dem_contacts
  use talus_kinds, only: wp, i4, i8
  use dem_contact, only: contact_point
  use dem_ellipsoid, only: line_of_centres
  use dem_pair_law, only: pair_stiffness
  use dem_measure, only: contact_count
  use dem_state, only: dem_data_type, lanes, history_side
  use dem_surface_measure, only: surface_stiffness, body_of_part
  implicit none
  private
  public :: dem_contacts_type, list_contacts, make_contacts, append_contacts, stiffness_on

  !> Contacts at one time, ordered by lower id, then higher id; planes have ids -1, -2, ...
  type :: dem_contacts_type
    integer(i4) :: n = 0
    integer(i8), allocatable :: ids(:, :)      !! (2, n) lower id first; (-plane, grain)
    real(wp), allocatable :: point(:, :)       !! (3, n) [m]
    real(wp), allocatable :: normal(:, :)      !! (3, n) from first to second [-]
    real(wp), allocatable :: branch(:, :)      !! (3, n) centre of second - first [m]
    real(wp), allocatable :: force(:, :)       !! (3, n) on the second [N]
    real(wp), allocatable :: spring(:, :)      !! (3, n) of the tangential spring, on the second [N]
    real(wp), allocatable :: stiffness(:, :)   !! (2, n) k_n, k_t [N/m]
    real(wp), allocatable :: overlap(:)        !! (n) [m]
  end type dem_contacts_type

contains

  !> Contacts at the last evaluation, ordered by ids; planes after all grain pairs.
  subroutine list_contacts(d, list)
    type(dem_data_type), intent(in) :: d
    type(dem_contacts_type), intent(inout) :: list
    integer(i4) :: i, e, lane, block

    call make_contacts(list, contact_count(d))
    do i = 1, d%grains%n + 3 + d%planes%n
      do e = d%pairs%start(i), d%pairs%start(i + 1) - 1
        if (.not. begins_contact(d, e, lane, block)) cycle
        call add_contact(d, lane, block, list)
      end do
    end do
    call add_surface_contacts(d, list)
  end subroutine list_contacts

  !> Is this entry of a body the first of a pair that touches? Then also where the pair stands.
  logical function begins_contact(d, entry, lane, block)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: entry
    integer(i4), intent(out) :: lane, block
    integer(i4) :: slot
    slot = d%pairs%entry(entry)/2
    lane = 1 + mod(slot, lanes)
    block = 1 + slot/lanes
    begins_contact = mod(d%pairs%entry(entry), 2) == 0
    if (begins_contact) &
      begins_contact = d%pairs%history(lane, history_side, block) > 0.0_wp
  end function begins_contact

  !> Sums of the normal stiffness of the contacts of some grains, in the order of the list [N/m].
  function stiffness_on(d, some) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: some(:)
    real(wp) :: stiffness(size(some)), whole(d%grains%n), k(2)
    logical :: wanted(d%grains%n + 3 + d%planes%n)
    integer(i4) :: i, e, g, lane, block

    wanted = .false.
    wanted(some) = .true.
    whole = 0.0_wp
    do i = 1, d%grains%n + 3 + d%planes%n
      do e = d%pairs%start(i), d%pairs%start(i + 1) - 1
        if (.not. begins_contact(d, e, lane, block)) cycle
        g = d%pairs%grain(d%pairs%second(lane, block))
        if (.not. (wanted(i) .or. wanted(g))) cycle
        k = pair_stiffness(d, lane, block)
        if (i <= d%grains%n) whole(i) = whole(i) + k(1)
        whole(g) = whole(g) + k(1)
      end do
    end do
    do i = 1, d%surfaces%list%near
      g = d%surfaces%list%near_grain(i)
      if (.not. wanted(g)) cycle
      do e = 1, d%surfaces%list%contacts(i)
        k = surface_stiffness(d, e, i)
        whole(g) = whole(g) + k(1)
      end do
    end do
    stiffness = whole(some)
  end function stiffness_on

  !> An empty list with room for m contacts.
  subroutine make_contacts(list, m)
    type(dem_contacts_type), intent(inout) :: list
    integer(i4), intent(in) :: m
    list%n = 0
    if (allocated(list%ids)) deallocate (list%ids, list%point, list%normal, list%branch, &
                                         list%force, list%spring, list%stiffness, list%overlap)
    allocate (list%ids(2, m), list%point(3, m), list%normal(3, m), list%branch(3, m))
    allocate (list%force(3, m), list%spring(3, m), list%stiffness(2, m), list%overlap(m))
  end subroutine make_contacts

  !> Some contacts behind those of a list that has room for them.
  subroutine append_contacts(list, some)
    type(dem_contacts_type), intent(inout) :: list
    type(dem_contacts_type), intent(in) :: some
    integer(i4) :: a, b
    a = list%n + 1
    b = list%n + some%n
    list%ids(:, a:b) = some%ids(:, :some%n)
    list%point(:, a:b) = some%point(:, :some%n)
    list%normal(:, a:b) = some%normal(:, :some%n)
    list%branch(:, a:b) = some%branch(:, :some%n)
    list%force(:, a:b) = some%force(:, :some%n)
    list%spring(:, a:b) = some%spring(:, :some%n)
    list%stiffness(:, a:b) = some%stiffness(:, :some%n)
    list%overlap(a:b) = some%overlap(:some%n)
    list%n = b
  end subroutine append_contacts

  subroutine add_contact(d, lane, block, list)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, block
    type(dem_contacts_type), intent(inout) :: list
    integer(i4) :: i, j, k

    i = d%pairs%first(lane, block)
    j = d%pairs%second(lane, block)
    list%n = list%n + 1
    k = list%n
    if (i > d%grains%n) then
      list%ids(1, k) = -int(i - d%grains%n - 3, i8)
    else
      list%ids(1, k) = d%grains%id(i)
    end if
    list%ids(2, k) = d%grains%id(d%pairs%grain(j))
    list%point(:, k) = d%pairs%body(1:3, i) + contact_point( &
      d%pairs, d%laws(d%pairs%law_first(block), d%pairs%law_second(block))%share, lane, block)
    list%normal(:, k) = d%pairs%normal(lane, :, block)
    list%branch(:, k) = d%pairs%body(1:3, j) - d%pairs%body(1:3, i)
    if (d%pairs%round(block)) list%normal(:, k) = line_of_centres(list%branch(:, k))
    list%force(:, k) = d%pairs%result(1:3, (block - 1)*lanes + lane)
    list%spring(:, k) = d%pairs%history(lane, 1:3, block)
    list%stiffness(:, k) = pair_stiffness(d, lane, block)
    list%overlap(k) = d%pairs%history(lane, history_side, block)**2
  end subroutine add_contact

  !> Contacts of surfaces, by grain; surfaces have the ids after those of the planes.
  subroutine add_surface_contacts(d, list)
    type(dem_data_type), intent(in) :: d
    type(dem_contacts_type), intent(inout) :: list
    integer(i4) :: g, k, n, b

    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        n = list%n + 1
        list%n = n
        b = body_of_part(d, d%surfaces%list%part(k, g))
        list%ids(:, n) = [-int(d%planes%n + b, i8), d%grains%id(d%surfaces%list%near_grain(g))]
        list%point(:, n) = d%surfaces%list%point(k, :, g)
        list%normal(:, n) = d%surfaces%list%normal(k, :, g)
        list%branch(:, n) = d%grains%x(:, d%surfaces%list%near_grain(g)) &
                            - d%surfaces%list%offset(k, :, g) - d%surfaces%centre(:, b)
        list%force(:, n) = d%surfaces%list%push(k, :, g)
        list%spring(:, n) = d%surfaces%list%history(k, 1:3, g)
        list%stiffness(:, n) = surface_stiffness(d, k, g)
        list%overlap(n) = d%surfaces%list%history(k, history_side, g)**2
      end do
    end do
  end subroutine add_surface_contacts
end module dem_contacts
