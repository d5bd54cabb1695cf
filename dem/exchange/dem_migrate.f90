!> Migration of grains and contacts to the ranks in whose domains they are: at the start, and at
!! every rebuild of the list.
!!
!! Each rank then holds its own free grains, mirrors of the free grains of others within one
!! interaction range of its domain, and all prescribed grains (each rank has the part of their
!! forces that its own grains give). All are in the order of their ids, so that a contact over a
!! border has the same bits on both sides, and sums run in the same order as on one rank.
module dem_migrate
  use talus_kinds, only: wp, i4, i8
  use dem_state, only: dem_data_type, dem_grains_type, kind_free, kind_mirror, lanes
  use dem_received_contacts, only: receive_contacts
  use dem_domains, only: cut_domains, rank_at, ranks_near, distance_to_domain, place_of, &
    follow_cell, turn_to_cell
  use dem_shape_state, only: allocate_shapes
  use dem_halo_state, only: dem_halo_type
  use dem_make, only: allocate_grains, is_prescribed, sorted_order
  use dem_pairs, only: allocate_bodies
  use dem_record_layout, only: at_id, at_kind, at_position, at_body, touch_grain
  use dem_records, only: grain_reals, contact_reals, pack_grain, unpack_grain, pack_contact, &
    carried, index_of
  use dem_surface_records, only: pack_touches, receive_touches
  implicit none
  private
  public :: share_out, pack_grains, make_local, slab, most_imbalance

  integer(i4), parameter :: slab = 50000          !! grains that a rank sends at a time
  real(wp), parameter :: most_imbalance = 1.1_wp  !! domains are cut again above it

contains

  !> Send grains and contacts to their ranks; the list of d then holds the contacts alone and must
  !! be rebuilt. Skin and range must be the same on all ranks.
  subroutine share_out(d, contacts)
    type(dem_data_type), intent(inout) :: d
    real(wp), allocatable, intent(out) :: contacts(:, :)  !! of this rank's grains, see dem_records
    integer(i4), allocatable :: home(:)
    integer(i4) :: rounds
    integer(i4) :: came(0:d%halo%team%ranks - 1)
    real(wp), allocatable :: held(:, :), own(:, :), mirrors(:, :), touches(:, :), rows(:, :)
    real(wp), allocatable :: targets(:, :)
    type(dem_grains_type) :: none

    call find_range(d)
    call find_homes(d, home, rounds)
    call pack_grains(d, d%grains%kind /= kind_free .and. d%grains%kind /= kind_mirror, held)
    call send_grains(d, home, rounds, own)
    call send_contacts(d, home, contacts)
    if (d%surfaces%n > 0) call send_touches(d, home, touches)
    call send_mirrors(d%halo, own, mirrors, came)
    d%halo%own = size(own, 2)
    d%halo%mirrors = size(mirrors, 2)
    call keep_targets(d%grains, targets)
    d%grains = none  ! of the leader at the start those of all ranks
    allocate (rows(size(own, 1), size(held, 2) + size(own, 2) + size(mirrors, 2)))
    rows(:, :size(held, 2)) = held
    rows(:, size(held, 2) + 1:size(held, 2) + size(own, 2)) = own
    rows(:, size(held, 2) + size(own, 2) + 1:) = mirrors
    deallocate (held, own)
    call make_local(d, rows)
    call put_targets(targets, d%grains)
    call receive_contacts(d, contacts)
    if (d%surfaces%n > 0) call receive_touches(d, touches)
    call list_bodies(d, mirrors, came)
  end subroutine share_out

  !> Where prescribed grains end the steps under way, in the order of their ids: 1 or 0, place,
  !! orientation. A list made within these steps leaves it as it is.
  pure subroutine keep_targets(g, targets)
    type(dem_grains_type), intent(in) :: g
    real(wp), allocatable, intent(out) :: targets(:, :)  !! (8, grains), none without such grains
    integer(i4), allocatable :: held(:)
    integer(i4) :: k
    held = [integer(i4) ::]
    if (size(g%has_target) > 0) held = pack([(k, k=1, g%n)], is_prescribed(g%kind))
    allocate (targets(8, size(held)))
    do k = 1, size(held)
      targets(:, k) = [merge(1.0_wp, 0.0_wp, g%has_target(held(k))), g%target_x(:, held(k)), &
                       g%target_quat(:, held(k))]
    end do
  end subroutine keep_targets

  pure subroutine put_targets(targets, g)
    real(wp), intent(in) :: targets(:, :)
    type(dem_grains_type), intent(inout) :: g
    integer(i4) :: i, k
    k = 0
    do i = 1, merge(g%n, 0_i4, size(targets) > 0)
      if (.not. is_prescribed(g%kind(i))) cycle
      k = k + 1
      g%has_target(i) = targets(1, k) > 0.5_wp
      g%target_x(:, i) = targets(2:4, k)
      g%target_quat(:, i) = targets(5:8, k)
    end do
  end subroutine put_targets

  !> Depth of the halo: two largest free grains and the skin.
  subroutine find_range(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: radius(1)
    radius = max(maxval(d%grains%radius, mask=d%grains%kind == kind_free), 0.0_wp)
    call d%halo%team%most(radius)
    d%halo%range = 2.0_wp*radius(1) + d%pairs%skin
  end subroutine find_range

  !> Rank of each free grain of this rank, -1 for the others. Domains are cut again when the work is
  !! too uneven; a grain that has gone beyond the halo of its domain is a stray.
  subroutine find_homes(d, home, rounds)
    type(dem_data_type), intent(inout) :: d
    integer(i4), allocatable, intent(out) :: home(:)
    integer(i4), intent(out) :: rounds  !! of slabs until all ranks have sent all
    real(wp), allocatable :: work(:), place(:, :)
    integer(i4), allocatable :: own(:)
    real(wp) :: mean(1), most(3), way
    integer(i4) :: k

    own = pack([(k, k=1, d%grains%n)], d%grains%kind == kind_free)
    allocate (work(size(own)))
    do k = 1, size(own)
      ! in whole numbers, so that all ranks find the same cuts
      work(k) = 2
      if (allocated(d%pairs%start)) &
        work(k) = work(k) + d%pairs%start(own(k) + 1) - d%pairs%start(own(k))
    end do
    mean = sum(work)
    d%halo%stray = 0
    if (d%halo%cut) then
      call follow_cell(d%halo, d%cell)
      do k = 1, size(own)
        way = distance_to_domain(d%halo, d%halo%team%rank, place_of(d%halo, d%grains%x(:, own(k))))
        if (way <= d%halo%range) cycle
        d%halo%stray = d%grains%id(own(k))
        d%halo%stray_way = way
      end do
    end if
    most = [mean, real(d%halo%stray, wp), real(size(own), wp)]
    call d%halo%team%add_up(mean)
    call d%halo%team%most(most)
    d%halo%imbalance = most(1)*d%halo%team%ranks/max(mean(1), 1.0_wp)
    d%halo%strayed = most(2) > 0.0_wp
    rounds = 1 + int(most(3), i4)/slab
    call turn_to_cell(d%halo, d%cell)
    allocate (place(3, size(own)))
    do k = 1, size(own)
      place(:, k) = place_of(d%halo, d%grains%x(:, own(k)))
    end do
    if (.not. d%halo%cut .or. d%halo%imbalance > most_imbalance) &
      call cut_domains(d%halo, place, work)
    allocate (home(d%grains%n), source=-1_i4)
    do k = 1, size(own)
      home(own(k)) = rank_at(d%halo, place(:, k))
    end do
  end subroutine find_homes

  !> Records of the selected grains, as columns.
  subroutine pack_grains(d, wanted, rows)
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: wanted(:)
    real(wp), allocatable, intent(out) :: rows(:, :)
    integer(i4) :: i, k
    allocate (rows(grain_reals(d%halo%shaped), count(wanted)))
    k = 0
    do i = 1, d%grains%n
      if (.not. wanted(i)) cycle
      k = k + 1
      call pack_grain(d, i, rows(:, k))
    end do
  end subroutine pack_grains

  !> This rank's free grains to their ranks, in slabs.
  subroutine send_grains(d, home, rounds, own)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: home(:), rounds
    real(wp), allocatable, intent(out) :: own(:, :)
    real(wp), allocatable :: some(:, :), longer(:, :)
    integer(i4), allocatable :: mine(:)
    integer(i4) :: i, k

    mine = pack([(i, i=1, size(home))], home >= 0)
    do k = 1, rounds
      call send_some(d, home, mine(min(slab*(k - 1) + 1, size(mine) + 1):min(slab*k, size(mine))), &
                     some)
      if (k == 1) then
        call move_alloc(some, own)
        cycle
      end if
      allocate (longer(size(own, 1), size(own, 2) + size(some, 2)))
      longer(:, :size(own, 2)) = own
      longer(:, size(own, 2) + 1:) = some
      call move_alloc(longer, own)
    end do
  end subroutine send_grains

  !> Send these grains to their ranks and receive those of all others.
  subroutine send_some(d, home, list, taken)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: home(:), list(:)
    real(wp), allocatable, intent(out) :: taken(:, :)
    integer(i4) :: k, r
    integer(i4) :: number(0:d%halo%team%ranks - 1), at(0:d%halo%team%ranks - 1), &
      came(0:d%halo%team%ranks - 1)
    real(wp), allocatable :: rows(:, :)

    number = 0
    do k = 1, size(list)
      number(home(list(k))) = number(home(list(k))) + 1
    end do
    at(0) = 0
    do r = 1, d%halo%team%ranks - 1
      at(r) = at(r - 1) + number(r - 1)
    end do
    allocate (rows(grain_reals(d%halo%shaped), size(list)))
    do k = 1, size(list)
      at(home(list(k))) = at(home(list(k))) + 1
      call pack_grain(d, list(k), rows(:, at(home(list(k)))))
    end do
    call d%halo%team%trade(rows, number, taken, came)
  end subroutine send_some

  !> Contacts of this rank's free grains to the ranks of these grains: once for each of two ranks.
  subroutine send_contacts(d, home, contacts)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: home(:)
    real(wp), allocatable, intent(out) :: contacts(:, :)
    integer(i4) :: k, lane, a, b, round, r
    integer(i4) :: number(0:d%halo%team%ranks - 1), at(0:d%halo%team%ranks - 1), &
      came(0:d%halo%team%ranks - 1)
    real(wp), allocatable :: rows(:, :)

    number = 0
    do round = 1, 2
      do k = 1, d%pairs%blocks
        do lane = 1, lanes
          if (.not. carried(d, lane, k)) cycle
          a = -1
          if (d%pairs%first(lane, k) <= d%grains%n) a = home(d%pairs%first(lane, k))
          b = home(d%pairs%grain(d%pairs%second(lane, k)))
          call put(a)
          if (b /= a) call put(b)
        end do
      end do
      if (round == 2) exit
      at(0) = 0
      do r = 1, d%halo%team%ranks - 1
        at(r) = at(r - 1) + number(r - 1)
      end do
      allocate (rows(contact_reals(d), sum(number)))
    end do
    call d%halo%team%trade(rows, number, contacts, came)

  contains

    !> Count it in the first round, pack it in the second.
    subroutine put(rank)
      integer(i4), intent(in) :: rank
      if (rank < 0) return
      if (round == 1) then
        number(rank) = number(rank) + 1
      else
        at(rank) = at(rank) + 1
        call pack_contact(d, lane, k, rows(:, at(rank)))
      end if
    end subroutine put
  end subroutine send_contacts

  !> Contacts of this rank's grains with surfaces go with their grains, those of prescribed grains
  !! to the leader.
  subroutine send_touches(d, home, touches)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: home(:)
    real(wp), allocatable, intent(out) :: touches(:, :)
    integer(i4) :: number(0:d%halo%team%ranks - 1), came(0:d%halo%team%ranks - 1), k
    integer(i4), allocatable :: to(:)
    real(wp), allocatable :: rows(:, :)

    call pack_touches(d, rows)
    allocate (to(size(rows, 2)))
    number = 0
    do k = 1, size(to)
      to(k) = max(home(index_of(d, rows(touch_grain, k))), 0)
      number(to(k)) = number(to(k)) + 1
    end do
    call d%halo%team%trade(rows(:, sorted_order(int(to, i8))), number, touches, came)
  end subroutine send_touches

  !> Send mirrors of grains near the domains of others to these.
  subroutine send_mirrors(halo, own, mirrors, came)
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(in) :: own(:, :)
    real(wp), allocatable, intent(out) :: mirrors(:, :)
    integer(i4), intent(out) :: came(0:)
    integer(i4) :: number(0:halo%team%ranks - 1), at(0:halo%team%ranks - 1), &
      near(0:halo%team%ranks - 1)
    integer(i4) :: i, k, r, many, round
    real(wp), allocatable :: rows(:, :)

    at = 0
    do round = 1, 2
      do i = 1, size(own, 2)
        call ranks_near(halo, place_of(halo, own(at_position(1):at_position(2), i)), halo%range, &
                        near, many)
        do k = 0, many - 1
          r = near(k)
          if (r == halo%team%rank) cycle
          at(r) = at(r) + 1
          if (round == 1) cycle  ! there is no room before they are counted
          rows(:, at(r)) = own(:, i)
          rows(at_kind, at(r)) = real(kind_mirror, wp)
        end do
      end do
      if (round == 2) exit
      number = at
      at(0) = 0
      do r = 1, halo%team%ranks - 1
        at(r) = at(r - 1) + number(r - 1)
      end do
      allocate (rows(size(own, 1), sum(number)))
    end do
    call halo%team%trade(rows, number, mirrors, came)
    call name_partners(halo, rows, number, came)
  end subroutine send_mirrors

  !> Ranks that exchange bodies with this one, and how many; `out` holds ids until list_bodies.
  subroutine name_partners(halo, rows, number, came)
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(in) :: rows(:, :)
    integer(i4), intent(in) :: number(0:), came(0:)
    integer(i4) :: r, p

    halo%partner = pack([(r, r=0, halo%team%ranks - 1)], number + came > 0)
    halo%partners = size(halo%partner)
    if (allocated(halo%first_out)) deallocate (halo%first_out, halo%first_in)
    allocate (halo%first_out(halo%partners + 1), halo%first_in(halo%partners + 1), source=1_i4)
    do p = 1, halo%partners
      halo%first_out(p + 1) = halo%first_out(p) + number(halo%partner(p))
      halo%first_in(p + 1) = halo%first_in(p) + came(halo%partner(p))
    end do
    halo%out = nint(rows(at_id, :), i4)
  end subroutine name_partners

  !> Bodies that are exchanged in every step, and room for them. A rank with nothing to send still
  !! has a first element.
  subroutine list_bodies(d, mirrors, came)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: mirrors(:, :)
    integer(i4), intent(in) :: came(0:)
    integer(i4) :: k, least

    associate (halo => d%halo)
      do k = 1, size(halo%out)
        halo%out(k) = index_of(d, real(halo%out(k), wp))
      end do
      if (allocated(halo%in)) deallocate (halo%in)
      allocate (halo%in(sum(came)))
      do k = 1, size(halo%in)
        halo%in(k) = index_of(d, mirrors(at_id, k))
      end do
      if (allocated(halo%sent)) deallocate (halo%sent, halo%came, halo%request)
      allocate (halo%sent(halo%width, size(halo%out) + halo%partners + 1), source=0.0_wp)
      allocate (halo%came(halo%width, size(halo%in) + halo%partners + 1), source=0.0_wp)
      allocate (halo%request(2*halo%partners + 1), source=0)
      least = halo%partners
      call halo%team%least_number(least)
      halo%all_near = least == halo%team%ranks - 1
      halo%before = 0.0_wp
    end associate
  end subroutine list_bodies

  !> The grains of these rows, in the order of their ids, become those of d.
  subroutine make_local(d, rows)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: rows(:, :)
    type(dem_grains_type) :: none
    integer(i4), allocatable :: order(:)
    integer(i4) :: k, body

    allocate (order, source=sorted_order(nint(rows(at_id, :), i8)))
    d%grains = none
    d%grains%n = size(order)
    call allocate_grains(d%grains, any(is_prescribed(nint(rows(at_kind, :), i4))))
    if (d%halo%shaped) call allocate_shapes(d%grains%shapes, d%grains%n)
    if (allocated(d%seen_kinetic)) d%seen_kinetic = spread(0.0_wp, 1, d%grains%n)
    do k = 1, size(order)
      call unpack_grain(rows(:, order(k)), d, k)
    end do
    call allocate_bodies(d%pairs, d%grains, d%planes)
    do k = 1, size(order)
      d%pairs%body(:, k) = rows(at_body(1):at_body(2), order(k))
    end do
    do k = 1, d%planes%n
      body = d%grains%n + 3 + k
      d%pairs%body(1:3, body) = d%planes%point(:, k)
      d%pairs%body(4:6, body) = d%planes%velocity(:, k)
    end do
  end subroutine make_local
end module dem_migrate
