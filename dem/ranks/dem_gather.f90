!> The whole system from the parts of all ranks.
module dem_gather
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  use dem_state, only: dem_data_type, dem_pairs_type, kind_free, kind_driven, kind_mirror, lanes
  use dem_received_contacts, only: receive_contacts, give_results
  use dem_migrate, only: pack_grains
  use dem_pairs, only: allocate_bodies, build_pairs
  use dem_record_layout, only: sum_reals, at_id, at_body
  use dem_records, only: grain_reals, contact_reals, pack_grain, unpack_grain, pack_contact, &
    carried, index_of
  use dem_membrane_forces, only: share_anew
  use dem_surface_search, only: list_near
  use dem_surface_records, only: pack_touches, receive_touches
  implicit none
  private
  public :: release_list, deliver, take_in, haul_type, deliver_driven, pack_contacts, is_first_here

  !> Data of all ranks, gathered on the leader.
  type :: haul_type
    real(wp), allocatable :: grains(:, :)      !! rows as columns, see dem_records
    real(wp), allocatable :: contacts(:, :)
    real(wp), allocatable :: touches(:, :)     !! contacts with surfaces, see dem_surface_share
    real(wp), allocatable :: prescribed(:, :)  !! (sum_reals n, ranks)
  end type haul_type

contains

  !> The whole needs no list while ranks have the contacts.
  subroutine release_list(pairs)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_pairs_type) :: fresh
    fresh%skin = pairs%skin
    fresh%least_skin = pairs%least_skin
    fresh%most_skin = pairs%most_skin
    fresh%built_at = pairs%built_at
    if (allocated(pairs%additional%kept)) deallocate (pairs%additional%kept)
    if (allocated(pairs%additional%work)) deallocate (pairs%additional%work)
    fresh%additional = pairs%additional
    pairs = fresh
  end subroutine release_list

  !> Free grains, contacts and the parts of prescribed grains' sums, from all ranks to the leader.
  subroutine deliver(team, part, haul)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: part
    type(haul_type), intent(out) :: haul
    real(wp), allocatable :: rows(:, :)
    integer(i4) :: number(0:team%ranks - 1), came(0:team%ranks - 1)

    number = 0
    call pack_grains(part, part%grains%kind == kind_free, rows)
    number(0) = size(rows, 2)
    call team%trade(rows, number, haul%grains, came)
    call pack_contacts(part, [-huge(1.0_wp), huge(1.0_wp)], rows)
    number(0) = size(rows, 2)
    call team%trade(rows, number, haul%contacts, came)
    if (part%surfaces%n > 0) then
      call pack_touches(part, rows)
      number(0) = size(rows, 2)
      call team%trade(rows, number, haul%touches, came)
    end if
    call pack_grains(part, .not. (part%grains%kind == kind_free &
                                  .or. part%grains%kind == kind_mirror), rows)
    call team%collect(reshape(rows(:sum_reals, :), [sum_reals*size(rows, 2)]), &
                      haul%prescribed)
  end subroutine deliver

  !> Every contact of a rank whose first id is in a range, planes as -1, -2, ...; those over a
  !! border from the rank of the lower id alone.
  subroutine pack_contacts(part, range, rows)
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: range(2)
    real(wp), allocatable, intent(out) :: rows(:, :)
    integer(i4) :: k, lane, n, round
    real(wp) :: first

    do round = 1, 2
      n = 0
      do k = 1, part%pairs%blocks
        do lane = 1, lanes
          if (.not. is_first_here(part, lane, k)) cycle
          first = first_id(part, lane, k)
          if (first < range(1) .or. first > range(2)) cycle
          n = n + 1
          if (round == 2) call pack_contact(part, lane, k, rows(:, n))
        end do
      end do
      if (round == 1) allocate (rows(contact_reals(part), n))
    end do
  end subroutine pack_contacts

  !> Is it a contact with a history, and its first grain no mirror?
  pure logical function is_first_here(part, lane, block)
    type(dem_data_type), intent(in) :: part
    integer(i4), intent(in) :: lane, block
    is_first_here = carried(part, lane, block)
    if (.not. is_first_here .or. part%pairs%first(lane, block) > part%grains%n) return
    is_first_here = part%grains%kind(part%pairs%first(lane, block)) /= kind_mirror
  end function is_first_here

  !> Id of the first of a pair, planes as -1, -2, ...
  pure real(wp) function first_id(part, lane, block)
    type(dem_data_type), intent(in) :: part
    integer(i4), intent(in) :: lane, block
    integer(i4) :: body
    body = part%pairs%first(lane, block)
    if (body > part%grains%n) then
      first_id = -real(body - part%grains%n - 3, wp)
    else
      first_id = real(part%grains%id(body), wp)
    end if
  end function first_id

  !> Driven grains of the whole as they are now: sums over the ranks of what acts on them.
  subroutine deliver_driven(team, part, whole)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: part
    type(dem_data_type), intent(inout) :: whole  !! used on the leader alone
    real(wp), allocatable :: rows(:, :), table(:, :)
    integer(i4) :: k, i
    call pack_grains(part, part%grains%kind == kind_driven, rows)
    if (size(rows, 2) == 0) return
    call team%collect(reshape(rows(:sum_reals, :), [sum_reals*size(rows, 2)]), table)
    if (.not. team%leads()) return
    do k = 1, size(rows, 2)
      rows(:sum_reals, k) = sum(table(sum_reals*(k - 1) + 1:sum_reals*k, :), 2)
      i = index_of(whole, rows(at_id, k))
      call unpack_grain(rows(:, k), whole, i)
    end do
  end subroutine deliver_driven

  !> The whole as it is now.
  subroutine take_in(part, haul, whole)
    type(dem_data_type), intent(in) :: part  !! of the leader
    type(haul_type), intent(in) :: haul
    type(dem_data_type), intent(inout) :: whole
    integer(i4) :: k, i

    if (allocated(part%seen_kinetic) .and. .not. allocated(whole%seen_kinetic)) &
      allocate (whole%seen_kinetic(whole%grains%n), source=0.0_wp)
    if (.not. allocated(whole%pairs%body)) call allocate_bodies(whole%pairs, whole%grains, &
                                                                whole%planes)
    do k = 1, size(haul%grains, 2)
      i = index_of(whole, haul%grains(at_id, k))
      call unpack_grain(haul%grains(:, k), whole, i)
      whole%pairs%body(:, i) = haul%grains(at_body(1):at_body(2), k)
    end do
    call take_prescribed(part, haul%prescribed, whole)
    whole%planes%point = part%planes%point
    do k = 1, whole%planes%n
      i = whole%grains%n + 3 + k
      whole%pairs%body(1:6, i) = [whole%planes%point(:, k), whole%planes%velocity(:, k)]
    end do
    whole%pairs%skin = part%pairs%skin
    whole%pairs%built_at = part%pairs%built_at
    call receive_contacts(whole, haul%contacts)
    call build_pairs(whole%pairs, whole%grains, whole%planes, whole%weights, &
                     whole%par%ghost_pairs, whole%cell)
    call give_results(whole, haul%contacts)
    if (whole%surfaces%n == 0) return
    call receive_touches(whole, haul%touches)
    call list_near(whole)
    if (allocated(whole%surfaces%membranes)) call share_anew(whole)
  end subroutine take_in

  !> Prescribed grains are where the leader has them; forces on them are sums over the ranks.
  subroutine take_prescribed(part, prescribed, whole)
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: prescribed(:, :)
    type(dem_data_type), intent(inout) :: whole
    real(wp) :: row(grain_reals(part%halo%shaped))
    integer(i4) :: i, k, n, r

    n = 0
    do i = 1, part%grains%n
      if (part%grains%kind(i) == kind_free .or. part%grains%kind(i) == kind_mirror) cycle
      call pack_grain(part, i, row)
      row(:sum_reals) = 0.0_wp
      do r = 1, size(prescribed, 2)
        row(:sum_reals) = row(:sum_reals) + prescribed(n + 1:n + sum_reals, r)
      end do
      n = n + sum_reals
      k = index_of(whole, row(at_id))
      call unpack_grain(row, whole, k)
      whole%pairs%body(:, k) = part%pairs%body(:, i)
    end do
  end subroutine take_prescribed
end module dem_gather
