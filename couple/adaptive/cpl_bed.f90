!> The grains of a bed that sleep, and how they wake, fall asleep and change their kind as elements
!! change their part (theory-overlap, Conversion). Faults N463, N465.
module cpl_bed
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_relax, verb_set, verb_sleep, verb_wake
  use talus_port_names, only: field_guest, field_history, field_id, field_kind, field_knots, &
    field_mass, field_moved, field_omega, field_overlap, field_pressure, field_radius, &
    field_steps, field_stress, field_stretch, field_substeps, field_tolerance, field_turn, &
    field_unbalanced, field_v, field_what, field_woken, field_x, what_asleep, what_grains, &
    what_kind
  use talus_text, only: str
  use talus_timers, only: timers_type
  use talus_vectors, only: turned
  use cpl_cells, only: cells_type, spot_type
  use cpl_closing, only: fate_type
  use cpl_histories, only: histories_type, request_type
  use cpl_library, only: library_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_carry, only: carried_type
  use cpl_roles, only: roles_type
  use cpl_sets, only: pack_type, part_none, part_rest, part_ghost, part_free
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: bed_type, change_type, ask_places

  integer(i4), parameter :: free = 0, ghost = 3  !! kinds at the port
  integer(i4), parameter :: none = -1, gone = -2

  !> What a conversion has done.
  type :: change_type
    integer(i4) :: woken = 0, freed = 0, slept = 0, awake = 0  !! grains
    integer(i4) :: closed = 0                     !! elements
    integer(i4) :: replays = 0, replay_steps = 0  !! histories that the tile went through
    real(wp) :: pressure = 0.0_wp                 !! of the tile at rest [Pa]
    real(wp), allocatable :: stress(:, :)         !! (9, replays) that it has more after them [Pa]
    integer(i4), allocatable :: element(:)        !! (replays) that they are of
    integer(i4) :: steps = 0           !! to rest
    real(wp) :: unbalanced = 0.0_wp    !! at the end of them [-]
    real(wp) :: moved = 0.0_wp         !! by them, at most [m]
    integer(i4) :: guests = 0, lost = 0  !! of another tile than their element's, and for them
    real(wp) :: seam(3) = 0.0_wp       !! overlapped volume [-], farthest way [m] and force that is
                                       !! left [-] of grains between two tiles
  end type change_type

  type :: bed_type
    integer(i8), allocatable :: id(:)       !! of grains that sleep
    real(wp), allocatable :: x(:, :)        !! where, (3, n) [m]
    type(spot_type), allocatable :: spot(:)  !! in the mesh at rest
    integer(i4), allocatable :: kind(:)     !! with which it wakes at once, none: of its element
    type(change_type) :: change             !! of the last conversion
    type(histories_type) :: histories       !! of the elements
    type(cells_type) :: cells               !! the mesh at rest
    type(library_type) :: library           !! of several tiles
  contains
    procedure :: read => read_bed
    procedure :: begin => fit_to_parts
    procedure :: forget
    procedure :: convert
    procedure :: leave_behind
    procedure :: close_behind
    procedure, private :: lie_down
    procedure, private :: wake
    procedure, private :: rest
    procedure, private :: sleep
  end type bed_type

contains

  !> What sleeps, and in which elements.
  subroutine read_bed(self, grains, cells, timers, errors)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    type(cells_type), intent(in) :: cells  !! not displaced
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: rank(cells%elements), k

    call grains%describe(what_asleep, '', timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, self%id, errors)
    call grains%reply%take(field_x, self%x, errors)
    if (errors%any()) return
    if (allocated(self%spot)) deallocate (self%spot)
    allocate (self%spot(size(self%id)))
    self%kind = spread(none, 1, size(self%id))
    rank = 0
    do k = 1, size(self%spot)
      call cells%find(self%x(:, k), rank, self%spot(k))
    end do
  end subroutine read_bed

  !> Grains that sleep in elements that are not of continuum alone and hold others that are awake
  !! have made room for the body: they never wake.
  subroutine forget(self, roles, filled)
    class(bed_type), intent(inout) :: self
    type(roles_type), intent(in) :: roles
    logical, intent(in) :: filled(:)  !! (elements)
    logical :: gone(size(self%id))
    integer(i4) :: k
    do k = 1, size(gone)
      associate (e => self%spot(k)%element)
        gone(k) = e > 0
        if (gone(k)) gone(k) = roles%part(e) /= part_rest .and. filled(e)
      end associate
    end do
    call drop(self, gone)
  end subroutine forget

  !> Leave these out of the list.
  subroutine drop(self, gone)
    class(bed_type), intent(inout) :: self
    logical, intent(in) :: gone(:)
    integer(i4) :: k
    self%id = pack(self%id, .not. gone)
    self%spot = pack(self%spot, .not. gone)
    self%kind = pack(self%kind, .not. gone)
    self%x = self%x(:, pack([(k, k=1, size(gone))], .not. gone))
  end subroutine drop

  !> At a fresh start: awake are the grains of opened elements and of those of ghosts. Elements of
  !! which some are awake are as the packing has them, others are filled.
  subroutine fit_to_parts(self, grains, roles, pack_of, cells, timers, errors)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    type(roles_type), intent(in) :: roles
    type(pack_type), intent(in) :: pack_of
    type(cells_type), intent(in) :: cells  !! not displaced
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(spot_type) :: spot
    type(carried_type) :: still
    logical :: leaving(size(pack_of%id)), bound(size(pack_of%id)), filled(cells%elements)
    integer(i4) :: g

    leaving = .false.
    bound = .false.
    filled = .false.
    do g = 1, size(leaving)
      if (pack_of%kind(g) /= free .and. pack_of%kind(g) /= ghost) cycle
      spot = spot_type()
      call cells%find(pack_of%x(:, g), roles%part, spot)
      if (spot%element == 0) cycle
      leaving(g) = roles%part(spot%element) == part_rest
      bound(g) = roles%part(spot%element) == part_ghost
      filled(spot%element) = .true.
      call self%library%take_over(spot%element, int(pack_of%id(g), i8))
    end do
    allocate (still%u(3, cells%nodes), still%v(3, cells%nodes), still%phi(3, cells%nodes), &
              still%w(3, cells%nodes), source=0.0_wp)
    if (any(leaving)) call self%sleep(grains, pack(pack_of%id, leaving), timers, errors)
    if (errors%any()) return
    call self%read(grains, cells, timers, errors)
    if (errors%any()) return
    call self%forget(roles, filled)
    call self%wake(grains, roles, cells, still, timers, errors)
    if (any(bound) .and. .not. errors%any()) &
      call send_kinds(grains, pack(pack_of%id, bound), ghost, timers, errors)
  end subroutine fit_to_parts

  !> Within a run: grains of newly opened elements are free, those of new elements of ghosts wake.
  subroutine convert(self, o, grains, roles, carried, timers, errors)
    class(bed_type), intent(inout) :: self
    type(overlap_type), intent(in) :: o           !! until now
    type(cpl_solver_type), intent(inout) :: grains
    type(roles_type), intent(in) :: roles         !! from now on
    type(carried_type), intent(in) :: carried     !! motion of all nodes
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical :: freed(o%op%ghosts), again(o%op%ghosts)
    integer(i8), allocatable :: ids(:)
    integer(i4) :: k

    again = .false.
    do k = 1, o%op%ghosts
      associate (part => roles%part(o%sets%ghost_spot(k)%element))
        freed(k) = part == part_none .or. part == part_free
      end associate
    end do
    ids = pack(o%pack%id(o%sets%ghost), freed)
    self%change%freed = size(ids)
    if (self%histories%active) then
      call self%histories%close(o%cells, carried%u, carried%part == part_ghost)
      call choose_again(self, o, freed, again)
      if (any(again)) call self%lie_down(grains, pack(o%pack%id(o%sets%ghost), again), &
        pack(merge(free, ghost, freed), again), timers, errors)
      self%change%woken = -count(again)
    end if
    if (any(freed .and. .not. again) .and. .not. errors%any()) &
      call send_kinds(grains, pack(o%pack%id(o%sets%ghost), freed .and. .not. again), free, &
                      timers, errors)
    if (errors%any()) return
    call self%wake(grains, roles, o%cells, carried, timers, errors)
    if (errors%any()) return
    self%change%awake = size(o%pack%id) + self%change%woken - self%change%slept
    if (roles%rest_steps > 0) call self%rest(o, grains, roles, ids, timers, errors)
  end subroutine convert

  !> Ghosts that lie down, to wake in the state of their history: those that become free, and those
  !! that may touch them.
  subroutine choose_again(self, o, freed, again)
    class(bed_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    logical, intent(in) :: freed(:)      !! (ghosts)
    logical, intent(inout) :: again(:)   !! (ghosts)
    real(wp) :: x(3, size(freed))
    integer(i4) :: k, g

    x = o%map%x_ghost + o%motion%d
    again = freed
    do k = 1, size(freed)
      if (freed(k)) cycle
      do g = 1, size(freed)
        if (.not. freed(g)) cycle
        again(k) = sum((x(:, k) - x(:, g))**2) <= o%sets%d_max**2
        if (again(k)) exit
      end do
    end do
    do k = 1, size(freed)
      associate (e => o%sets%ghost_spot(k)%element)
        if (again(k)) again(k) = self%histories%is_strained(e)
      end associate
    end do
  end subroutine choose_again

  !> Ghosts fall asleep and stand in the list as those that always did, but wake at once.
  subroutine lie_down(self, grains, ids, kind, timers, errors)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    integer(i8), intent(in) :: ids(:)
    integer(i4), intent(in) :: kind(:)  !! with which they wake
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(bed_type) :: all
    integer(i4), allocatable :: waking(:)

    call self%sleep(grains, ids, timers, errors)
    if (.not. errors%any()) call all%read(grains, self%cells, timers, errors)
    if (errors%any()) return
    allocate (waking(maxval(all%id)), source=gone)
    waking(self%id) = none
    waking(ids) = kind
    all%kind = waking(all%id)
    call drop(all, all%kind == gone)
    call move_alloc(all%id, self%id)
    call move_alloc(all%x, self%x)
    call move_alloc(all%spot, self%spot)
    call move_alloc(all%kind, self%kind)
  end subroutine lie_down

  !> Grains far behind the body leave, a layer before them is held: by their places now.
  subroutine leave_behind(self, grains, roles, timers, errors)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    type(roles_type), intent(in) :: roles
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(pack_type) :: pack_of
    real(wp), allocatable :: before(:)
    logical, allocatable :: chosen(:)
    integer(i4) :: k

    if (.not. roles%keep_behind > 0.0_wp) return
    call ask_places(grains, pack_of, timers, errors)
    if (errors%any()) return
    associate (ids => pack_of%id, kind => pack_of%kind, x => pack_of%x)
      before = [(roles%far_behind(x(:, k), grains%time), k=1, size(ids))]
      chosen = before < 0.0_wp .and. (kind == free .or. kind == ghost)
      self%change%slept = count(chosen)
      self%change%awake = self%change%awake - self%change%slept
      if (any(chosen)) call self%sleep(grains, pack(ids, chosen), timers, errors)
      if (errors%any()) return
      chosen = before >= 0.0_wp .and. before < roles%hold_behind .and. kind == free
      if (any(chosen)) call send_kinds(grains, pack(ids, chosen), ghost, timers, errors)
    end associate
  end subroutine leave_behind

  !> Grains in elements that have closed become ghosts or fall asleep; before others wake.
  subroutine close_behind(self, grains, id, fate, timers, errors)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    integer(i8), intent(in) :: id(:)
    type(fate_type), intent(in) :: fate
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    self%change%slept = count(fate%leaving)
    if (any(fate%leaving)) call self%sleep(grains, pack(id, fate%leaving), timers, errors)
    if (any(fate%bound) .and. .not. errors%any()) &
      call send_kinds(grains, pack(id, fate%bound), ghost, timers, errors, &
                      fate%v(:, pack([(k, k=1, size(id))], fate%bound)))
  end subroutine close_behind

  !> Ids, kinds, radii, masses and places of the grains that are awake.
  subroutine ask_places(grains, pack_of, timers, errors)
    type(cpl_solver_type), intent(inout) :: grains
    type(pack_type), intent(out) :: pack_of
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call grains%describe(what_grains, '', timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, pack_of%id, errors)
    call grains%reply%take_int(field_kind, pack_of%kind, errors)
    call grains%reply%take(field_radius, pack_of%radius, errors)
    call grains%reply%take(field_mass, pack_of%mass, errors)
    call grains%reply%take(field_x, pack_of%x, errors)
  end subroutine ask_places

  !> WAKE what sleeps in elements that are no longer of continuum alone: moved with the nodes.
  subroutine wake(self, grains, roles, cells, carried, timers, errors)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    type(roles_type), intent(in) :: roles
    type(cells_type), intent(in) :: cells
    type(carried_type), intent(in) :: carried  !! motion of all nodes
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical :: waking(size(self%id))
    real(wp), allocatable :: x(:, :), speed(:, :)
    integer(i4), allocatable :: at(:), kind(:), marks(:)
    integer(i4) :: k, e, n

    do k = 1, size(waking)
      e = self%spot(k)%element
      waking(k) = e > 0
      if (waking(k)) waking(k) = roles%part(e) /= part_rest .or. self%kind(k) /= none
    end do
    call choose_waking(self, roles, waking, at, marks)
    if (size(at) == 0) then
      call drop(self, waking)
      return
    end if
    allocate (x(3, size(at)), speed(3, size(at)), kind(size(at)))
    do k = 1, size(at)
      associate (spot => self%spot(at(k)))
        n = spot%n
        e = spot%element
        associate (node => cells%node(cells%start(e):cells%start(e) + n - 1))
          x(:, k) = self%x(:, at(k)) + matmul(carried%u(:, node), spot%weight(:n))
          speed(:, k) = matmul(carried%v(:, node), spot%weight(:n))
        end associate
        kind(k) = merge(ghost, free, roles%part(e) == part_ghost)
        if (self%kind(at(k)) /= none) kind(k) = self%kind(at(k))
      end associate
    end do
    call grains%start_request(verb_wake, 0_i8, grains%time, grains%time)
    call grains%request%put_int(field_id, self%id(at))
    call grains%request%put_int(field_kind, kind)
    call grains%request%put(field_x, x)
    call grains%request%put(field_v, speed)
    if (self%histories%active) &
      call put_histories(self, grains, cells, carried, [(self%spot(at(k))%element, k=1, size(at))])
    if (any(cells%polar) .and. .not. self%histories%active) &
      call put_turns(cells, carried, self%spot(at), grains)
    if (any(marks > 0)) call grains%request%put_int(field_guest, marks)
    call grains%ask(timers, errors)
    if (errors%any()) return
    call drop(self, waking)
    call count_woken(grains, marks, self%change, errors)
    if (.not. grains%reply%has(field_stress)) return
    call grains%reply%take(field_stress, self%change%stress, errors)
    call grains%reply%get(field_pressure, self%change%pressure, errors)
    call grains%reply%get_int(field_substeps, self%change%replay_steps, errors)
  end subroutine wake

  !> Rows of the list that may wake, of those in elements that hold grains from now on, and their
  !! marks (cpl_library); of a single tile all do.
  pure subroutine choose_waking(self, roles, waking, at, marks)
    class(bed_type), intent(in) :: self
    type(roles_type), intent(in) :: roles
    logical, intent(in) :: waking(:)
    integer(i4), allocatable, intent(out) :: at(:), marks(:)
    integer(i4) :: k
    at = pack([(k, k=1, size(waking))], waking)
    allocate (marks(size(at)), source=0_i4)
    if (.not. self%library%active) return
    call self%library%mark(self%cells, roles%part, self%spot(at)%element, self%id(at), &
                           self%x(:, at), marks)
    at = pack(at, marks >= 0)
    marks = pack(marks, marks >= 0)
  end subroutine choose_waking

  !> How many have woken, and what became of those between two tiles.
  subroutine count_woken(grains, marks, change, errors)
    type(cpl_solver_type), intent(inout) :: grains
    integer(i4), intent(in) :: marks(:)
    type(change_type), intent(inout) :: change
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: woken(size(marks))
    woken = 1
    if (any(marks > 0)) then
      call grains%reply%get_int(field_woken, woken, errors)
      call grains%reply%get(field_overlap, change%seam(1), errors)
      call grains%reply%get(field_moved, change%seam(2), errors)
      call grains%reply%get(field_unbalanced, change%seam(3), errors)
      if (errors%any()) return
    end if
    change%woken = change%woken + sum(woken)
    change%guests = count(marks == 2 .and. woken == 1)
    change%lost = count(marks < 2 .and. woken == 0)
  end subroutine count_woken

  !> Grains that wake have turned with the micro-rotation, as ghosts do, and go on so.
  subroutine put_turns(cells, carried, spot, grains)
    type(cells_type), intent(in) :: cells
    type(carried_type), intent(in) :: carried
    type(spot_type), intent(in) :: spot(:)    !! (grains that wake)
    type(cpl_solver_type), intent(inout) :: grains
    real(wp) :: turn(4, size(spot)), spin(3, size(spot))
    integer(i4) :: k, first, n
    turn = spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, size(spot))
    spin = 0.0_wp
    do k = 1, size(spot)
      n = spot(k)%n_phi
      if (n == 0) cycle
      first = cells%start(spot(k)%element)
      associate (node => cells%node(first:first + n - 1), weight => spot(k)%weight_phi(:n))
        turn(:, k) = turned(turn(:, k), matmul(carried%phi(:, node), weight))
        spin(:, k) = matmul(carried%w(:, node), weight)
      end associate
    end do
    call grains%request%put(field_turn, turn)
    call grains%request%put(field_omega, spin)
  end subroutine put_turns

  !> Histories of the elements in which grains wake, their rotations and spins.
  subroutine put_histories(self, grains, cells, carried, element)
    class(bed_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: grains
    type(cells_type), intent(in) :: cells
    type(carried_type), intent(in) :: carried
    integer(i4), intent(in) :: element(:)  !! (grains that wake)
    type(request_type) :: request
    logical :: chosen(cells%elements)

    chosen = .false.
    chosen(element) = .true.
    call self%histories%close(cells, carried%u, chosen)
    call self%histories%ask(cells, carried%u, carried%v, chosen, request)
    call grains%request%put(field_turn, request%turn(:, element))
    call grains%request%put(field_omega, request%spin(:, element))
    self%change%replays = size(request%knots)
    self%change%element = request%element
    if (self%change%replays == 0) return
    call grains%request%put_int(field_history, request%number(element))
    call grains%request%put_int(field_knots, request%knots)
    call grains%request%put(field_stretch, request%stretch)
  end subroutine put_histories

  !> RELAX the new free grains and free ones that are near to them.
  subroutine rest(self, o, grains, roles, fresh, timers, errors)
    class(bed_type), intent(inout) :: self
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(roles_type), intent(in) :: roles
    integer(i8), intent(in) :: fresh(:)  !! ids
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical :: moving(size(o%sets%free)), new(o%op%ghosts)
    real(wp) :: reach
    integer(i4) :: k, g

    if (size(fresh) == 0) return
    reach = roles%rest_reach*o%sets%d_max
    do g = 1, o%op%ghosts
      new(g) = any(fresh == o%pack%id(o%sets%ghost(g)))
    end do
    moving = .false.
    do g = 1, o%op%ghosts
      if (.not. new(g)) cycle
      do k = 1, size(moving)
        if (moving(k)) cycle
        moving(k) = sum((o%map%x_free(:, k) + o%motion%q(:, k) - o%map%x_ghost(:, g) &
                         - o%motion%d(:, g))**2) <= reach**2
      end do
    end do
    call grains%start_request(verb_relax, 0_i8, grains%time, grains%time)
    call grains%request%put_int(field_id, [fresh, pack(o%pack%id(o%sets%free), moving)])
    call grains%request%put_int(field_steps, roles%rest_steps)
    call grains%request%put(field_tolerance, roles%unbalanced)
    call grains%ask(timers, errors)
    if (errors%any()) return
    call grains%reply%get_int(field_substeps, self%change%steps, errors)
    call grains%reply%get(field_unbalanced, self%change%unbalanced, errors)
    call grains%reply%get(field_moved, self%change%moved, errors)
  end subroutine rest

  subroutine sleep(self, grains, ids, timers, errors)
    class(bed_type), intent(in) :: self
    type(cpl_solver_type), intent(inout) :: grains
    integer(i8), intent(in) :: ids(:)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call grains%start_request(verb_sleep, 0_i8, grains%time, grains%time)
    call grains%request%put_int(field_id, ids)
    call grains%ask(timers, errors)
  end subroutine sleep

  !> SET kind; velocities of those that become ghosts.
  subroutine send_kinds(grains, ids, kind, timers, errors, speed)
    type(cpl_solver_type), intent(inout) :: grains
    integer(i8), intent(in) :: ids(:)
    integer(i4), intent(in) :: kind
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), intent(in), optional :: speed(:, :)  !! (3, ids) [m/s]
    call grains%start_request(verb_set, 0_i8, grains%time, grains%time)
    call grains%request%put_text(field_what, what_kind)
    call grains%request%put_int(field_id, ids)
    call grains%request%put_int(field_kind, spread(kind, 1, size(ids)))
    if (present(speed)) call grains%request%put(field_v, speed)
    call grains%ask(timers, errors)
  end subroutine send_kinds
end module cpl_bed
