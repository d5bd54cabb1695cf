!> Prediction, on one process, of the memory that ranks would need: domains are cut as on ranks, and
!! the share of each is counted in the list of the whole.
!!
!! Bytes are those of the arrays that are allocated at the two peaks of memory: where the leader
!! distributes the whole, and where a rank sends grains and contacts while its old list is still
!! allocated. Freed memory is fragmented and not all reused; the factors for this are those of runs
!! of 10^5 to 10^6 ellipsoids on 2 to 8 ranks.
module dem_rank_memory
  use talus_kinds, only: wp, i4, i8
  use dem_domains, only: cut_domains, rank_at, ranks_near, place_of, turn_to_cell
  use dem_halo_state, only: dem_halo_type
  use dem_migrate, only: slab, most_imbalance
  use dem_record_layout, only: slot_offset
  use dem_records, only: grain_reals, contact_reals, carried
  use dem_state, only: dem_data_type, kind_free, lanes, body_size, history_size, result_size
  use dem_surface_additional, only: surface_kept_reals
  implicit none
  private
  public :: rank_loads_type, find_loads, memory_estimate

  real(wp), parameter :: bytes = 8.0_wp             !! of a real
  real(wp), parameter :: alone = 27.0_wp*2**20      !! a rank without grains [byte]
  real(wp), parameter :: alone_first = 32.0_wp*2**20
  real(wp), parameter :: pieces = 1.35_wp           !! of a rank's part: allocated over in use
  real(wp), parameter :: pieces_first = 1.1_wp      !! of the whole, while it is distributed
  integer(i4), parameter :: target_reals = 7        !! of a prescribed grain, not in its record
  integer(i4), parameter :: prescribed_reals = 11   !! in it, that others have no room for
  integer(i4), parameter :: list_reals = 9          !! of a body, in the list
  integer(i4), parameter :: touch_reals = slot_offset(2)  !! of a contact with a surface
  integer(i4), parameter :: candidate_reals = 13    !! of what is near a grain: forces on corners
  integer(i4), parameter :: vertex_reals = 30, triangle_reals = 10  !! of surfaces, on all ranks

  !> Load of each rank. Contacts are those with a history.
  type :: rank_loads_type
    integer(i8), allocatable :: own(:), mirrors(:), pairs(:), contacts(:)  !! (0:ranks-1)
    integer(i8), allocatable :: rooms(:)  !! (0:ranks-1) for contacts with surfaces, see rooms_of
  end type rank_loads_type

contains

  !> Loads of the ranks after the first forces, the list being there.
  subroutine find_loads(d, ranks, loads)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: ranks
    type(rank_loads_type), intent(out) :: loads
    type(dem_halo_type) :: halo
    real(wp), allocatable :: place(:, :), work(:)
    integer(i4), allocatable :: own(:), home(:)
    integer(i4) :: k

    own = pack([(k, k=1, d%grains%n)], d%grains%kind == kind_free)
    halo%domains = ranks
    halo%range = 2.0_wp*max(maxval(d%grains%radius(own)), 0.0_wp) + d%pairs%skin
    call turn_to_cell(halo, d%cell)
    allocate (place(3, size(own)), work(size(own)))
    do k = 1, size(own)
      place(:, k) = place_of(halo, d%grains%x(:, own(k)))
    end do
    work = 2.0_wp  ! as long as there is no list
    call cut_domains(halo, place, work)
    do k = 1, size(own)
      work(k) = 2 + d%pairs%start(own(k) + 1) - d%pairs%start(own(k))
    end do
    if (imbalance_of(halo, place, work, ranks) > most_imbalance) &
      call cut_domains(halo, place, work)
    allocate (home(d%grains%n), source=-1_i4)
    allocate (loads%own(0:ranks - 1), source=0_i8)
    do k = 1, size(own)
      home(own(k)) = rank_at(halo, place(:, k))
      loads%own(home(own(k))) = loads%own(home(own(k))) + 1
    end do
    call count_mirrors(halo, place, ranks, loads%mirrors)
    call count_pairs(d, home, ranks, loads)
    allocate (loads%rooms(0:ranks - 1), source=0_i8)
    do k = 1, d%surfaces%list%near
      if (home(d%surfaces%list%near_grain(k)) < 0) cycle
      associate (rooms => loads%rooms(home(d%surfaces%list%near_grain(k))))
        rooms = rooms + rooms_of(d, k)
      end associate
    end do
  end subroutine find_loads

  !> Allocated contacts of near grain g while the list is rebuilt: the old contacts, if there are
  !! any, and the new ones.
  pure integer(i4) function rooms_of(d, g) result(rooms)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: g
    rooms = merge(2_i4, 1_i4, d%surfaces%list%contacts(g) > 0)
  end function rooms_of

  !> Most work of a domain over the mean.
  real(wp) function imbalance_of(halo, place, work, ranks) result(imbalance)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: place(:, :), work(:)
    integer(i4), intent(in) :: ranks
    real(wp) :: sums(0:ranks - 1)
    integer(i4) :: k, r
    sums = 0.0_wp
    do k = 1, size(work)
      r = rank_at(halo, place(:, k))
      sums(r) = sums(r) + work(k)
    end do
    imbalance = maxval(sums)*ranks/max(sum(sums), 1.0_wp)
  end function imbalance_of

  !> Mirrors of grains of others on each rank.
  subroutine count_mirrors(halo, place, ranks, mirrors)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: place(:, :)
    integer(i4), intent(in) :: ranks
    integer(i8), allocatable, intent(out) :: mirrors(:)
    integer(i4) :: near(0:ranks - 1), many, k
    allocate (mirrors(0:ranks - 1), source=0_i8)
    do k = 1, size(place, 2)
      call ranks_near(halo, place(:, k), halo%range, near, many)
      mirrors(near(:many - 1)) = mirrors(near(:many - 1)) + 1
      associate (here => mirrors(rank_at(halo, place(:, k))))
        here = here - 1
      end associate
    end do
  end subroutine count_mirrors

  !> Candidates and contacts of each rank; those over a border are on both sides.
  subroutine count_pairs(d, home, ranks, loads)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: home(:)  !! (grains) rank of a free grain, -1 for the others
    integer(i4), intent(in) :: ranks
    type(rank_loads_type), intent(inout) :: loads
    integer(i4) :: k, lane, a, b, contact
    allocate (loads%pairs(0:ranks - 1), loads%contacts(0:ranks - 1), source=0_i8)
    do k = 1, d%pairs%blocks
      do lane = 1, lanes
        if (d%pairs%grain(d%pairs%second(lane, k)) == 0) cycle  ! a pad
        a = -1
        if (d%pairs%first(lane, k) <= d%grains%n) a = home(d%pairs%first(lane, k))
        b = home(d%pairs%grain(d%pairs%second(lane, k)))
        contact = merge(1_i4, 0_i4, carried(d, lane, k))
        call add(a)
        if (b /= a) call add(b)
      end do
    end do

  contains

    subroutine add(rank)
      integer(i4), intent(in) :: rank
      if (rank < 0) return
      loads%pairs(rank) = loads%pairs(rank) + 1
      loads%contacts(rank) = loads%contacts(rank) + contact
    end subroutine add
  end subroutine count_pairs

  !> Peak memory of each rank [byte].
  function memory_estimate(d, loads, apart, gathers) result(most)
    type(dem_data_type), intent(in) :: d
    type(rank_loads_type), intent(in) :: loads
    logical, intent(in) :: apart    !! the whole is distributed before it has a list
    logical, intent(in) :: gathers  !! the first rank has the whole with its list from time to time
    real(wp) :: most(0:size(loads%own) - 1)
    real(wp) :: record, body, slot, row, contact, prescribed, whole, list, lean, held, part, room
    real(wp) :: rooms, surfaces
    integer(i4) :: r

    row = bytes*grain_reals(d%grains%shapes%in_use)
    contact = bytes*contact_reals(d)
    body = bytes*(body_size + list_reals)
    prescribed = real(count(d%grains%kind /= kind_free), wp)
    record = row + bytes*(1 - body_size)
    record = record + bytes*merge(target_reals, -prescribed_reals, prescribed > 0.5_wp)
    slot = bytes*(3 + history_size + result_size + 1 + 1 + 1) + bytes*d%pairs%additional%reals
    if (size(d%pairs%weight, 2) > 1) slot = slot + bytes
    slot = slot*lanes*d%pairs%blocks/max(d%pairs%count, 1)  ! with the pads
    room = bytes_of_room(d)
    surfaces = bytes*(vertex_reals*d%surfaces%mesh%vertices &
      + triangle_reals*d%surfaces%mesh%triangles)
    rooms = sum([(rooms_of(d, r), r=1, d%surfaces%list%near)])
    do r = 0, size(loads%own) - 1
      held = loads%own(r) + loads%mirrors(r) + prescribed
      ! the old list is there while contacts are sent; the old grains have gone when rows of all
      ! have come together
      part = loads%pairs(r)*slot + &
        max(held*(record + body) + loads%own(r)*row + 2.0_wp*loads%contacts(r)*contact, &
            2.0_wp*held*row + loads%contacts(r)*contact)
      most(r) = alone + pieces*part + surfaces + loads%rooms(r)*room
    end do
    whole = d%grains%n*(record + body)
    list = d%pairs%count*slot
    lean = d%grains%n*record
    most(0) = most(0) - alone + alone_first + lean + surfaces
    if (gathers) most(0) = most(0) + d%grains%n*(body + row) + list + sum(loads%contacts)*contact &
      + rooms*room
    held = 2.0_wp*(whole + surfaces) + 2.0_wp*row*(min(d%grains%n, slab) + loads%own(0))
    if (.not. apart) held = held + 2.0_wp*list + rooms*room
    most(0) = max(most(0), alone_first + pieces_first*held)
  end function memory_estimate

  !> Bytes allocated for a grain's contacts with surfaces and its candidates.
  pure real(wp) function bytes_of_room(d) result(room)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: kept
    room = 0.0_wp
    if (d%surfaces%list%near == 0) return
    kept = surface_kept_reals(d)
    if (kept > 0) kept = kept + 3
    room = bytes*d%surfaces%list%slots*(touch_reals + kept) &
           + bytes*candidate_reals*size(d%surfaces%list%candidate)/d%surfaces%list%near
  end function bytes_of_room
end module dem_rank_memory
