!> Slabs of the whole from the parts of all ranks: a run of grains, or the contacts whose first
!! grain is one of them. The leader then holds no more than its own part and a slab.
module dem_slabs
  use talus_kinds, only: wp, i4, i8
  use talus_ranks, only: ranks_type
  use dem_contacts, only: dem_contacts_type, list_contacts
  use dem_shape_state, only: allocate_shapes, put_frame
  use dem_gather, only: pack_contacts, is_first_here
  use dem_make, only: allocate_grains, sorted_order
  use dem_measure, only: coordination_of
  use dem_record_layout, only: sum_reals, at_id, list_ids, list_point, list_normal, list_branch, &
    list_force, list_spring, list_stiffness, list_overlap
  use dem_records, only: grain_reals, pack_grain, unpack_grain, index_of
  use dem_state, only: dem_data_type, dem_grains_type, kind_free, kind_mirror, lanes, history_side
  use dem_surface_measure, only: surface_contact_count
  implicit none
  private
  public :: dem_slab_type, slab_of_grains, slab_of_contacts, slab_of_records, count_contacts
  public :: slab_grains, copy_state

  integer(i4), parameter :: slab_grains = 50000  !! in a slab

  !> Some grains, in the order of their ids.
  type :: dem_slab_type
    class(dem_data_type), allocatable :: some  !! grains, and their kinetic energies at the last
                                               !! check of damping
    integer(i4), allocatable :: coordination(:)    !! (grains) contacts of each
  end type dem_slab_type

contains

  !> The grains of these ids, complete on the leader.
  subroutine slab_of_grains(team, part, ids, slab)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: part
    integer(i8), intent(in) :: ids(:)  !! of the leader: all from its first to its last, ascending
    type(dem_slab_type), intent(out) :: slab
    real(wp) :: range(2)
    real(wp), allocatable :: rows(:, :), taken(:, :), sums(:, :)
    integer(i4) :: number(0:team%ranks - 1), came(0:team%ranks - 1), reals, k, i
    integer(i4), allocatable :: z(:)

    if (team%leads()) range = real([ids(1), ids(size(ids))], wp)
    call team%broadcast_values(range)
    reals = grain_reals(part%halo%shaped)
    z = coordination_of(part)
    call pack_own(part, range, z, rows)
    number = 0
    number(0) = size(rows, 2)
    call team%trade(rows, number, taken, came)
    call add_prescribed(team, part, range, z, sums)
    if (.not. team%leads()) return
    call make_slab(part, ids, slab)
    do k = 1, size(taken, 2)
      i = index_of(slab%some, taken(at_id, k))
      call unpack_grain(taken(:reals, k), slab%some, i)
      slab%coordination(i) = nint(taken(reals + 1, k), i4)
    end do
    call take_prescribed(part, range, sums, slab)
  end subroutine slab_of_grains

  !> Own free grains with ids in a range, each with its coordination.
  subroutine pack_own(part, range, z, rows)
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: range(2)
    integer(i4), intent(in) :: z(:)
    real(wp), allocatable, intent(out) :: rows(:, :)
    integer(i4) :: i, n, round, reals
    reals = grain_reals(part%halo%shaped)
    do round = 1, 2
      n = 0
      do i = 1, part%grains%n
        if (part%grains%kind(i) /= kind_free .or. .not. within(part, i, range)) cycle
        n = n + 1
        if (round == 1) cycle
        call pack_grain(part, i, rows(:reals, n))
        rows(reals + 1, n) = z(i)
      end do
      if (round == 1) allocate (rows(reals + 1, n))
    end do
  end subroutine pack_own

  !> Is the id of grain i in a range?
  pure logical function within(d, i, range)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: range(2)
    within = d%grains%id(i) >= nint(range(1), i8) .and. d%grains%id(i) <= nint(range(2), i8)
  end function within

  !> Is grain i a prescribed one with its id in a range?
  pure logical function prescribed_within(d, i, range) result(yes)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: range(2)
    yes = d%grains%kind(i) /= kind_free .and. d%grains%kind(i) /= kind_mirror .and. &
          within(d, i, range)
  end function prescribed_within

  !> What all ranks have of the sums of prescribed grains in a range, and their coordination.
  subroutine add_prescribed(team, part, range, z, sums)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: range(2)
    integer(i4), intent(in) :: z(:)
    real(wp), allocatable, intent(out) :: sums(:, :)  !! (sum_reals+1, grains)
    real(wp) :: row(grain_reals(part%halo%shaped))
    real(wp), allocatable :: flat(:)
    integer(i4) :: i, n
    n = count([(prescribed_within(part, i, range), i=1, part%grains%n)])
    allocate (flat((sum_reals + 1)*n))
    n = 0
    do i = 1, part%grains%n
      if (.not. prescribed_within(part, i, range)) cycle
      call pack_grain(part, i, row)
      flat(n + 1:n + sum_reals) = row(:sum_reals)
      flat(n + sum_reals + 1) = z(i)
      n = n + sum_reals + 1
    end do
    if (n > 0) call team%add_up(flat)
    sums = reshape(flat, [sum_reals + 1, n/(sum_reals + 1)])
  end subroutine add_prescribed

  !> Room for the grains of these ids.
  subroutine make_slab(part, ids, slab)
    type(dem_data_type), intent(in) :: part
    integer(i8), intent(in) :: ids(:)
    type(dem_slab_type), intent(out) :: slab
    allocate (slab%some)
    associate (d => slab%some)
      d%grains%n = size(ids)
      call allocate_grains(d%grains, size(part%grains%work) > 0)
      if (part%halo%shaped) call allocate_shapes(d%grains%shapes, d%grains%n)
      d%grains%id = ids
      if (allocated(part%seen_kinetic)) allocate (d%seen_kinetic(d%grains%n), source=0.0_wp)
    end associate
    allocate (slab%coordination(size(ids)), source=0)
  end subroutine make_slab

  !> What changes of some grains, to those from number `low` on of a whole.
  subroutine copy_state(some, low, whole)
    type(dem_grains_type), intent(in) :: some
    integer(i4), intent(in) :: low
    type(dem_grains_type), intent(inout) :: whole
    integer(i4) :: i, k
    do k = 1, some%n
      i = low + k - 1
      whole%x(:, i) = some%x(:, k)
      whole%quat(:, i) = some%quat(:, k)
      whole%v(:, i) = some%v(:, k)
      whole%omega(:, i) = some%omega(:, k)
      whole%theta(:, i) = some%theta(:, k)
      whole%force(:, i) = some%force(:, k)
      whole%moment(:, i) = some%moment(:, k)
      call put_frame(whole%shapes, i, whole%quat(:, i))
    end do
  end subroutine copy_state

  !> Prescribed grains are where the leader has them.
  subroutine take_prescribed(part, range, sums, slab)
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: range(2), sums(:, :)
    type(dem_slab_type), intent(inout) :: slab
    real(wp) :: row(grain_reals(part%halo%shaped))
    integer(i4) :: i, k, n
    n = 0
    do i = 1, part%grains%n
      if (.not. prescribed_within(part, i, range)) cycle
      n = n + 1
      call pack_grain(part, i, row)
      row(:sum_reals) = sums(:sum_reals, n)
      k = index_of(slab%some, row(at_id))
      call unpack_grain(row, slab%some, k)
      slab%coordination(k) = nint(sums(sum_reals + 1, n), i4)
    end do
  end subroutine take_prescribed

  !> Contacts whose first id is in a range, on the leader, ordered as on one rank: by the first id,
  !! those with planes (-1, -2, ...) by plane and grain, those with surfaces by grain.
  subroutine slab_of_contacts(team, part, first, last, list)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: part
    integer(i8), intent(in) :: first, last  !! of the leader
    type(dem_contacts_type), intent(out) :: list
    type(dem_contacts_type) :: mine
    real(wp) :: range(2)
    real(wp), allocatable :: rows(:, :), taken(:, :)
    integer(i4) :: number(0:team%ranks - 1), came(0:team%ranks - 1), k, n, round

    range = real([first, last], wp)
    call team%broadcast_values(range)
    call list_contacts(part, mine)
    do round = 1, 2
      n = 0
      do k = 1, mine%n
        if (mine%ids(1, k) < nint(range(1), i8) .or. mine%ids(1, k) > nint(range(2), i8)) cycle
        if (mine%ids(1, k) > 0) then
          if (part%grains%kind(index_of(part, real(mine%ids(1, k), wp))) == kind_mirror) cycle
        end if
        n = n + 1
        if (round == 2) call pack_listed(mine, k, rows(:, n))
      end do
      if (round == 1) allocate (rows(list_overlap, n))
    end do
    number = 0
    number(0) = n
    call team%trade(rows, number, taken, came)
    if (team%leads()) call make_list(taken, part%planes%n, list)
  end subroutine slab_of_contacts

  !> A contact as it is written to fields.
  pure subroutine pack_listed(list, k, row)
    type(dem_contacts_type), intent(in) :: list
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: row(:)
    row(list_ids(1):list_ids(2)) = real(list%ids(:, k), wp)
    row(list_point(1):list_point(2)) = list%point(:, k)
    row(list_normal(1):list_normal(2)) = list%normal(:, k)
    row(list_branch(1):list_branch(2)) = list%branch(:, k)
    row(list_force(1):list_force(2)) = list%force(:, k)
    row(list_spring(1):list_spring(2)) = list%spring(:, k)
    row(list_stiffness(1):list_stiffness(2)) = list%stiffness(:, k)
    row(list_overlap) = list%overlap(k)
  end subroutine pack_listed

  !> The list of these rows, in order.
  subroutine make_list(rows, planes, list)
    real(wp), intent(in) :: rows(:, :)
    integer(i4), intent(in) :: planes
    type(dem_contacts_type), intent(out) :: list
    integer(i4), allocatable :: order(:)
    integer(i4) :: k

    allocate (order, source=[(k, k=1, size(rows, 2))])
    if (size(order) > 0) then
      associate (first => rows(list_ids(1), :), second => rows(list_ids(2), :))
        if (first(1) < 0.0_wp) order = sorted_order(nint(second, i8))
        if (first(1) > -planes - 0.5_wp) order = order(sorted_order(nint(abs(first(order)), i8)))
      end associate
    end if
    list%n = size(order)
    list%ids = nint(rows(list_ids(1):list_ids(2), order), i8)
    list%point = rows(list_point(1):list_point(2), order)
    list%normal = rows(list_normal(1):list_normal(2), order)
    list%branch = rows(list_branch(1):list_branch(2), order)
    list%force = rows(list_force(1):list_force(2), order)
    list%spring = rows(list_spring(1):list_spring(2), order)
    list%stiffness = rows(list_stiffness(1):list_stiffness(2), order)
    list%overlap = rows(list_overlap, order)
  end subroutine make_list

  !> Records of contacts (see dem_records) whose first id is in a range, on the leader.
  subroutine slab_of_records(team, part, first, last, taken)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: part
    integer(i8), intent(in) :: first, last  !! of the leader
    real(wp), allocatable, intent(out) :: taken(:, :)
    real(wp) :: range(2)
    real(wp), allocatable :: rows(:, :)
    integer(i4) :: number(0:team%ranks - 1), came(0:team%ranks - 1)
    range = real([first, last], wp)
    call team%broadcast_values(range)
    call pack_contacts(part, range, rows)
    number = 0
    number(0) = size(rows, 2)
    call team%trade(rows, number, taken, came)
  end subroutine slab_of_records

  !> Contacts of this rank's grains, and records of contacts that have a history; those over a
  !! border count on one rank alone.
  pure function count_contacts(part) result(n)
    type(dem_data_type), intent(in) :: part
    real(wp) :: n(2)
    integer(i4) :: k, lane
    n = 0.0_wp
    do k = 1, part%pairs%blocks
      do lane = 1, lanes
        if (.not. is_first_here(part, lane, k)) cycle
        n(2) = n(2) + 1.0_wp
        if (part%pairs%touched(k) .and. part%pairs%history(lane, history_side, k) > 0.0_wp) &
          n(1) = n(1) + 1.0_wp
      end do
    end do
    n(1) = n(1) + surface_contact_count(part)
  end function count_contacts
end module dem_slabs
