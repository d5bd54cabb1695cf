!> Grains that leave a system and grains that enter it, between two steps.
!!
!! All others go on as if nothing had happened: a new list inherits the history of their contacts,
!! as it does when grains change their rank. What the system stores before and after is booked in
!! the ledger as taken along and brought along (eq. D.23).
module dem_population
  use talus_kinds, only: wp, i4, i8
  use dem_bond_counts, only: bond_at, count_broken
  use dem_cell, only: is_periodic, least_width
  use dem_gather, only: pack_contacts
  use dem_ledger, only: refresh_stored, content
  use dem_make, only: is_prescribed, prescribe_some
  use dem_membrane_forces, only: share_anew
  use dem_migrate, only: pack_grains, make_local
  use dem_pairs, only: build_pairs, effective_root
  use dem_prescribed, only: put_body
  use dem_received_contacts, only: receive_contacts, give_results
  use dem_record_layout, only: touch_grain, at_body, at_first_id, at_second_id
  use dem_records, only: grain_reals, pack_grain, index_of
  use dem_shape_make, only: scale_grain
  use dem_shape_state, only: put_frame
  use dem_start_springs, only: start_springs_type, hang_springs
  use dem_state, only: dem_data_type, dem_grains_type, dem_ledger_type, lanes, history_root
  use dem_steps, only: evaluate_forces
  use dem_surface_records, only: pack_touches, receive_touches
  use dem_surface_search, only: list_near
  implicit none
  private
  public :: remove_grains, add_grains, replace_grains, weigh_grains, resize_grains
  public :: memory_type, change_kinds, change_memory, gain

  !> What contacts remember, as rows of dem_records and dem_surface_records.
  type :: memory_type
    real(wp), allocatable :: contacts(:, :), touches(:, :)
  end type memory_type

contains

  !> These grains leave: their contacts are gone, and what they and those stored. Of the others some
  !! may be held from now on, or be free; springs hang on contacts of those.
  subroutine remove_grains(d, leaving, kind, springs, v)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: leaving(:)          !! (grains)
    integer(i4), intent(in), optional :: kind(:)  !! (grains) from now on
    type(start_springs_type), intent(in), optional :: springs
    real(wp), intent(in), optional :: v(:, :)     !! (3, grains) of what becomes held [m/s]
    real(wp), allocatable :: none(:, :)
    type(dem_ledger_type) :: before
    call refresh_stored(d, d%ledger_dt, before)
    if (present(kind)) call change_kinds(d, kind, v)
    allocate (none(grain_reals(d%grains%shapes%in_use), 0))
    call exchange_grains(d, leaving, none)
    if (present(springs)) call hang_springs(d, springs)
    call find_forces(d)
    d%ledger%left = d%ledger%left - gain(d, before)
  end subroutine remove_grains

  !> These grains enter; ids differ from all that are there. Springs hang on their contacts. Of the
  !! others some may be held from now on, or be free.
  subroutine add_grains(d, entering, springs, kind)
    type(dem_data_type), intent(inout) :: d
    type(dem_grains_type), intent(in) :: entering  !! shapes, if the system has any
    type(start_springs_type), intent(in) :: springs
    integer(i4), intent(in), optional :: kind(:)   !! (grains) from now on
    logical :: leaving(d%grains%n)
    type(dem_ledger_type) :: before

    call refresh_stored(d, d%ledger_dt, before)
    if (present(kind)) call change_kinds(d, kind)
    leaving = .false.
    call exchange_grains(d, leaving, rows_of(entering, d%grains%shapes%in_use))
    if (springs%given > 0) call hang_springs(d, springs)
    call find_forces(d)
    d%ledger%entered = d%ledger%entered + gain(d, before)
    d%last_id = max(d%last_id, maxval(entering%id))
  end subroutine add_grains

  !> These grains break, and those enter in their places: what was stored is released, kinetic
  !! energy goes with the fines. Their bonds break with them, and fragments carry no load of a
  !! surcharge yet. eq. D.29
  subroutine replace_grains(d, leaving, entering)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: leaving(:)              !! (grains)
    type(dem_grains_type), intent(in) :: entering  !! shapes, if the system has any
    type(dem_ledger_type) :: before, now
    real(wp) :: change

    call end_bonds(d, leaving)
    call refresh_stored(d, d%ledger_dt, before)
    if (allocated(d%surcharge)) call pass_loads(d, leaving, entering%n)
    call exchange_grains(d, leaving, rows_of(entering, d%grains%shapes%in_use))
    call find_forces(d)
    change = gain(d, before, now)
    d%ledger%fines = d%ledger%fines + before%kinetic - now%kinetic
    d%ledger%released = d%ledger%released - change - (before%kinetic - now%kinetic)
    if (entering%n > 0) d%last_id = max(d%last_id, maxval(entering%id))
  end subroutine replace_grains

  !> All bonds of these grains break: they count as torn, what they stored is lost. eq. D.72
  subroutine end_bonds(d, leaving)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: leaving(:)  !! (grains)
    type(dem_ledger_type) :: before, after
    integer(i4) :: k, lane, at, torn
    at = bond_at(d%pairs%additional)
    if (at == 0) return
    call refresh_stored(d, d%ledger_dt, before)
    torn = 0
    do k = 1, d%pairs%grain_blocks
      do lane = 1, lanes
        if (.not. d%pairs%additional%kept(lane, at, k) > 0.0_wp) cycle
        if (.not. (leaving(d%pairs%first(lane, k)) &
                   .or. leaving(d%pairs%grain(d%pairs%second(lane, k))))) cycle
        d%pairs%additional%kept(lane, at, k) = 0.0_wp
        torn = torn + 1
      end do
    end do
    d%pairs%additional%broken(1) = d%pairs%additional%broken(1) + torn
    call count_broken(d%pairs%additional)
    call refresh_stored(d, d%ledger_dt, after)
    d%ledger%breakage = d%ledger%breakage + before%elastic_other - after%elastic_other
  end subroutine end_bonds

  !> Loads of the surcharge for the grains that stay, none for those that enter behind them.
  pure subroutine pass_loads(d, leaving, entering)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: leaving(:)       !! (grains)
    integer(i4), intent(in) :: entering     !! how many
    integer(i4) :: k
    d%surcharge = [pack(d%surcharge, .not. leaving), [(0.0_wp, k=1, entering)]]
    d%surcharge_top = [pack(d%surcharge_top, .not. leaving), [(.false., k=1, entering)]]
  end subroutine pass_loads

  !> Records of grains that enter.
  function rows_of(entering, shaped) result(rows)
    type(dem_grains_type), intent(in) :: entering
    logical, intent(in) :: shaped  !! some grain of the system is, or may come to be, no ellipsoid
    real(wp) :: rows(grain_reals(shaped), entering%n)
    class(dem_data_type), allocatable :: others
    integer(i4) :: i
    allocate (others)
    others%grains = entering
    allocate (others%pairs%body(at_body(2) - at_body(1) + 1, entering%n))
    do i = 1, entering%n
      call put_frame(others%grains%shapes, i, entering%quat(:, i))
      call put_body(others%grains, i, others%pairs%body(:, i))
      call pack_grain(others, i, rows(:, i))
    end do
  end function rows_of

  !> Masses and moments of inertia from now on.
  subroutine weigh_grains(d, mass, inertia)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: mass(:), inertia(:, :)  !! (grains) [kg], (3, grains) [kg m^2]
    type(dem_ledger_type) :: before
    call refresh_stored(d, d%ledger_dt, before)
    d%grains%mass = mass
    d%grains%inertia = inertia
    call change_memory(d)
    d%ledger%entered = d%ledger%entered + gain(d, before)
  end subroutine weigh_grains

  !> Sizes from now on; contacts keep what they remember. What they store more is the work of the
  !! growth, since no time passes. eq. D.71
  subroutine resize_grains(d, factor)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: factor(:)  !! (grains) on all lengths [-]
    type(dem_ledger_type) :: before
    integer(i4) :: i
    call refresh_stored(d, d%ledger_dt, before)
    do i = 1, d%grains%n
      if (.not. abs(factor(i) - 1.0_wp) > 0.0_wp) cycle
      call scale_grain(d%grains, i, factor(i))
      call put_body(d%grains, i, d%pairs%body(:, i))
    end do
    call fit_radii(d)
    call change_memory(d)
    d%ledger%growth = d%ledger%growth + gain(d, before)
  end subroutine resize_grains

  !> What contacts of spheres remember of their radii, which a new list inherits.
  pure subroutine fit_radii(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: i, j, k, lane
    do k = 1, d%pairs%grain_blocks
      if (.not. d%pairs%round(k)) cycle
      do lane = 1, lanes
        i = d%pairs%first(lane, k)
        j = d%pairs%grain(d%pairs%second(lane, k))
        if (i > d%grains%n .or. j == 0) cycle
        d%pairs%history(lane, history_root, k) = effective_root(d%grains%radius(i)**2, &
                                                                d%grains%radius(j)**2)
      end do
    end do
  end subroutine fit_radii

  !> A new list for grains whose kinds have changed. Of grains that were held meanwhile contacts
  !! remember what they did before.
  subroutine change_memory(d, memory, moving)
    type(dem_data_type), intent(inout) :: d
    type(memory_type), intent(in), optional :: memory  !! from before
    logical, intent(in), optional :: moving(:)         !! (grains) that were not held
    real(wp) :: none(grain_reals(d%grains%shapes%in_use), 0)
    logical :: leaving(d%grains%n)
    leaving = .false.
    call exchange_grains(d, leaving, none, memory, moving)
    call find_forces(d)
  end subroutine change_memory

  !> Kinds from now on; what becomes held stands still, or goes on at v.
  subroutine change_kinds(d, kind, v)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: kind(:)             !! (grains)
    real(wp), intent(in), optional :: v(:, :)      !! (3, grains) [m/s]
    integer(i4) :: i
    do i = 1, d%grains%n
      if (kind(i) == d%grains%kind(i)) cycle
      d%grains%kind(i) = kind(i)
      if (is_prescribed(kind(i))) then
        d%grains%v(:, i) = 0.0_wp
        d%grains%omega(:, i) = 0.0_wp
        if (present(v)) d%grains%v(:, i) = v(:, i)
      end if
      call put_body(d%grains, i, d%pairs%body(:, i))
    end do
    if (any(is_prescribed(kind))) call prescribe_some(d%grains)
  end subroutine change_kinds

  !> Forces of the new list; no work is done, as no time passes. Pairs without contact begin the
  !! next step as they do on ranks that get their parts of the system: with the normals of the list,
  !! which has parted them already.
  subroutine find_forces(d)
    type(dem_data_type), intent(inout) :: d
    type(dem_ledger_type) :: before
    before = d%ledger
    call evaluate_forces(d, 0.0_wp)
    d%ledger = before
    if (d%surfaces%n > 0) call list_near(d)
  end subroutine find_forces

  !> Kinetic and elastic energy more than before [J]. What steps leave out of it is no energy of the
  !! grains: the start of the ledger moves along.
  real(wp) function gain(d, before, after)
    type(dem_data_type), intent(inout) :: d
    type(dem_ledger_type), intent(in) :: before
    type(dem_ledger_type), intent(out), optional :: after  !! what is stored now
    type(dem_ledger_type) :: now
    call refresh_stored(d, d%ledger_dt, now)
    if (present(after)) after = now
    d%ledger%start = d%ledger%start - (now%staggering - before%staggering)
    gain = content(now) + now%staggering - (content(before) + before%staggering)
  end function gain

  !> New arrays of grains and a new list for them; bodies are up to date, forces are not.
  subroutine exchange_grains(d, leaving, entering, memory, moving)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: leaving(:)        !! (grains)
    real(wp), intent(in) :: entering(:, :)   !! rows of dem_records, as columns
    type(memory_type), intent(in), optional :: memory  !! of grains that have not moved
    logical, intent(in), optional :: moving(:)         !! (grains)
    real(wp), allocatable :: stay(:, :), rows(:, :), contacts(:, :), touches(:, :)

    d%halo%shaped = d%grains%shapes%in_use
    call pack_grains(d, .not. leaving, stay)
    call pack_contacts(d, [-huge(1.0_wp), huge(1.0_wp)], contacts)
    if (d%surfaces%n > 0) call pack_touches(d, touches)
    if (d%surfaces%n > 0) call drop_touches(d, leaving, touches)
    if (present(memory)) call recall(d, moving, memory, contacts, touches)
    allocate (rows(size(stay, 1), size(stay, 2) + size(entering, 2)))
    rows(:, :size(stay, 2)) = stay
    rows(:, size(stay, 2) + 1:) = entering
    deallocate (stay)
    call make_local(d, rows)
    call fit_list(d)
    call receive_contacts(d, contacts)
    if (d%surfaces%n > 0) call receive_touches(d, touches)
    call build_pairs(d%pairs, d%grains, d%planes, d%weights, d%par%ghost_pairs, d%cell)
    call give_results(d, contacts)
    if (d%surfaces%n == 0) return
    call list_near(d)
    if (allocated(d%surfaces%membranes)) call share_anew(d)
  end subroutine exchange_grains

  !> The list is made at this step; larger grains leave less room for its margin in a cell.
  subroutine fit_list(d)
    type(dem_data_type), intent(inout) :: d
    d%pairs%built_at = d%health%steps
    d%pairs%ease = 1.0_wp
    if (.not. is_periodic(d%cell) .or. d%grains%n == 0) return
    d%pairs%most_skin = min(d%pairs%most_skin, 0.5_wp*least_width(d%cell) &
                            - 2.0_wp*maxval(d%grains%radius))
    d%pairs%skin = min(d%pairs%skin, d%pairs%most_skin)
  end subroutine fit_list

  !> In place of contacts of which no grain has moved those of before.
  subroutine recall(d, moving, memory, contacts, touches)
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: moving(:)
    type(memory_type), intent(in) :: memory
    real(wp), allocatable, intent(inout) :: contacts(:, :), touches(:, :)
    contacts = joined(contacts, moved(contacts, [at_first_id, at_second_id]), memory%contacts, &
                      .not. moved(memory%contacts, [at_first_id, at_second_id]))
    if (allocated(touches)) touches = joined(touches, moved(touches, [touch_grain]), &
      memory%touches, .not. moved(memory%touches, [touch_grain]))

  contains

    !> Has one of a record's grains moved?
    pure function moved(rows, at)
      real(wp), intent(in) :: rows(:, :)
      integer(i4), intent(in) :: at(:)
      logical :: moved(size(rows, 2))
      integer(i4) :: k, j, i
      moved = .false.
      do k = 1, size(rows, 2)
        do j = 1, size(at)
          if (rows(at(j), k) < 0.0_wp) cycle  ! a plane
          i = index_of(d, rows(at(j), k))
          if (i > 0) moved(k) = moved(k) .or. moving(i)
        end do
      end do
    end function moved
  end subroutine recall

  !> Chosen columns of both.
  pure function joined(a, of_a, b, of_b) result(c)
    real(wp), intent(in) :: a(:, :), b(:, :)
    logical, intent(in) :: of_a(:), of_b(:)
    real(wp) :: c(max(size(a, 1), size(b, 1)), count(of_a) + count(of_b))
    integer(i4) :: k
    c = 0.0_wp
    c(:size(a, 1), :count(of_a)) = a(:, pack([(k, k=1, size(a, 2))], of_a))
    c(:size(b, 1), count(of_a) + 1:) = b(:, pack([(k, k=1, size(b, 2))], of_b))
  end function joined

  !> Leave out the contacts of leaving grains with surfaces.
  subroutine drop_touches(d, leaving, touches)
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: leaving(:)
    real(wp), allocatable, intent(inout) :: touches(:, :)
    integer(i4), allocatable :: rest(:)
    integer(i4) :: k
    allocate (rest(0))
    do k = 1, size(touches, 2)
      if (.not. leaving(index_of(d, touches(touch_grain, k)))) rest = [rest, k]
    end do
    touches = touches(:, rest)
  end subroutine drop_touches
end module dem_population
