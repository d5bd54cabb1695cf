!> A whole system of grains: what a program calls to set it up, move it and look at it.
!!
!! Order of use: fill grains (dem_make), planes, materials, laws (dem_law), par; init; then step, or
!! the split verbs kick, drift and forces. Prescribed grains are named by index (find gives it).
module dem_system
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use talus_ranks, only: ranks_type
  use dem_archive, only: dem_archive_type
  use dem_rank_team, only: dem_crew_type
  use dem_state, only: dem_data_type, kind_free
  use dem_bonds_make, only: make_bonds
  use dem_cell, only: is_periodic, least_width
  use dem_additional, only: plan_extras, check_necks
  use dem_membrane, only: check_membranes
  use dem_make, only: sorted_order, make_planes
  use dem_pairs, only: allocate_bodies, update_bodies, build_pairs
  use dem_relist, only: rebuild_if_needed
  use dem_steps, only: step_memory_type, take_steps, evaluate_forces, kick_and_drift
  use dem_ellipsoid, only: quaternion_from_rotation, rotation_between
  use dem_ledger, only: refresh_stored, start_ledger, follow_step, closure_of
  use dem_limits, only: gershgorin_step, rayleigh_step, foreseen_step
  use dem_parts, only: choose_border, place_ghosts
  use dem_parts_forces, only: forces_on_free, forces_between_ghosts
  use dem_measure, only: check_overlap, check_runaway, contact_count
  use dem_store, only: put_state, get_state
  use dem_contacts, only: dem_contacts_type, list_contacts
  use dem_records, only: index_of
  use dem_adaptive_damping, only: reset_sums, stop_slowing
  use dem_start_springs, only: start_springs_type, hang_springs, count_springs
  use dem_surface_search, only: list_near
  implicit none
  private
  public :: dem_system_type, dem_contacts_type

  !> The state of a system with its verbs; `kept` is what restore goes back to.
  type, extends(dem_data_type) :: dem_system_type
    type(dem_data_type), allocatable :: kept
    type(dem_crew_type), allocatable :: crew  !! of a run on many ranks
    type(start_springs_type) :: springs       !! that contacts begin with
    logical :: apart = .false.                !! whose first lists and forces each makes for itself
    type(step_memory_type), private :: memory
    real(wp), private :: limit = 0.0_wp            !! recent_limit [s]
    integer(i8), private :: limit_at = -1          !! evaluation of forces then
  contains
    procedure :: use_ranks        !! (team): steps are those of many ranks
    procedure :: slow_down        !! (): adaptive damping
    procedure :: loads_changed    !! (before): extra forces were others before
    procedure :: start_moved      !! (start): of the ledger, loads have changed
    procedure :: begin_anew       !! (): the state was replaced: ranks must know
    procedure :: look             !! (): grains and contacts as the ranks have them now
    procedure :: glance           !! (): ledger and stress in a cell as the ranks have them
    procedure :: follow_laws      !! (): laws have changed: so has what is stored
    procedure :: parted           !! (): ranks have been on since the last look
    procedure :: pair_number      !! (): of candidate pairs, over a border twice
    procedure :: contact_number   !! (): of contacts, once the ledger was refreshed
    procedure :: init             !! (errors): lists and forces at the start; no time passes
    procedure :: step             !! (n, errors): n sub-steps of par%dt
    procedure :: forces           !! (): forces at the current state; no time passes
    procedure :: place            !! (index, x, quat, v, omega): ghosts, for forces in parts
    procedure :: free_forces      !! (): what is left of those of contacts of free grains
    procedure :: ghost_forces     !! (alone): only those between ghosts
    procedure :: set_border       !! (index): ghosts near free grains; from now on in parts
    procedure :: kick_drift       !! (kick, drift): v += kick (F + X)/m, then x += drift v
    procedure :: first_skin       !! (): margin of the list at the start [m]
    procedure :: top_speed        !! (): of the fastest grain [m/s]
    procedure :: step_limit       !! (): Gershgorin limit [s], huge without contacts
    procedure :: recent_limit     !! (): the same, as it was a few steps ago at most [s]
    procedure :: rayleigh_limit   !! (): least Rayleigh time of the free grains [s]
    procedure :: automatic_step   !! (speed): dt_factor x least of all limits [s]
    procedure :: set_motion       !! (index, x1, quat1, steps): linear/slerp to the target
    procedure :: set_velocity     !! (index, v, omega): constant from now on
    procedure :: set_state        !! (index, x, quat, v, omega): placed at once
    procedure :: set_extra        !! (index, force, moment): held on free grains
    procedure :: clear_extra      !! ()
    procedure :: set_weights      !! (ids(2,:), value(:)): contact weights by pair id
    procedure :: reset_impulses   !! (): impulses and work of grains and planes to zero
    procedure :: find             !! (ids, index, errors): grain indices of ids
    procedure :: refresh_ledger   !! (): fills the 'now' columns of ledger
    procedure :: closure          !! (): closure error of the ledger as last refreshed [J]
    procedure :: contacts         !! (list): contacts at the last evaluation
    procedure :: save             !! (): keep the state in memory
    procedure :: forget           !! (): keep no state
    procedure :: restore          !! (): return to the kept state
    procedure :: export_state     !! (archive): complete state as named arrays
    procedure :: import_state     !! (archive, errors): instead of init, bit for bit
  end type dem_system_type

contains

  !> Steps are taken by these ranks, of which this process leads.
  subroutine use_ranks(self, team)
    class(dem_system_type), intent(inout) :: self
    type(ranks_type), intent(in) :: team
    if (.not. team%several()) return
    allocate (self%crew)
    self%crew%team = team
  end subroutine use_ranks

  !> Of many ranks the leader's grains and contacts are as old as its last look.
  subroutine look(self)
    class(dem_system_type), intent(inout) :: self
    if (allocated(self%crew)) call self%crew%look(self%dem_data_type)
  end subroutine look

  !> Ledger, number of contacts, stress in a cell and driven grains as the ranks have them.
  subroutine glance(self)
    class(dem_system_type), intent(inout) :: self
    if (parted(self)) call self%crew%glance(self%dem_data_type)
  end subroutine glance

  !> Contact laws may have changed since the checkpoint: what the new ones store was there at the
  !! start, so that the ledger closes as it did.
  subroutine follow_laws(self)
    class(dem_system_type), intent(inout) :: self
    real(wp) :: error, stored
    associate (ledger => self%ledger)
      error = self%closure()
      stored = ledger%elastic_normal + ledger%elastic_tangential + ledger%elastic_other
      call self%refresh_ledger()
      if (.not. abs(ledger%elastic_normal + ledger%elastic_tangential + ledger%elastic_other &
                    - stored) > 0.0_wp) return
      ledger%start = ledger%start + error - self%closure()
    end associate
  end subroutine follow_laws

  !> Adaptive damping.
  subroutine slow_down(self)
    class(dem_system_type), intent(inout) :: self
    if (shared(self)) then
      call self%crew%slow_down(self%dem_data_type)
    else
      call stop_slowing(self%dem_data_type)
    end if
  end subroutine slow_down

  !> Extra forces of some grains have been others before: ranks must know.
  subroutine loads_changed(self, before)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: before(:, :)  !! (3, grains) [N]
    if (allocated(self%crew)) &
      call self%crew%mark_loads(any(abs(self%grains%extra_force - before) > 0.0_wp, 1))
  end subroutine loads_changed

  !> With a change of loads the ledger has got another start: so has that of the ranks.
  subroutine start_moved(self, start)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: start  !! before the change [J]
    if (.not. allocated(self%crew)) return
    if (self%crew%started) self%crew%shift = self%crew%shift + (self%ledger%start - start)
  end subroutine start_moved

  !> Another state has taken the place of this one: ranks get their parts of it before they step.
  subroutine begin_anew(self)
    class(dem_system_type), intent(inout) :: self
    if (allocated(self%crew)) call self%crew%begin_anew()
  end subroutine begin_anew

  !> Do many ranks take the steps?
  pure logical function shared(self)
    class(dem_system_type), intent(in) :: self
    shared = .false.
    if (allocated(self%crew)) shared = .not. self%crew%alone
  end function shared

  !> Have the ranks been on since the last look? The whole's grains are then old, it has no
  !! contacts, and what is written comes from the ranks in slabs.
  pure logical function parted(self)
    class(dem_system_type), intent(in) :: self
    parted = .false.
    if (allocated(self%crew)) parted = self%crew%stale
  end function parted

  !> Number of candidate pairs.
  integer(i8) function pair_number(self)
    class(dem_system_type), intent(in) :: self
    pair_number = self%pairs%count
    if (parted(self)) pair_number = nint(self%crew%marks%pairs, i8)
  end function pair_number

  !> Number of contacts, as the ranks told it with the ledger.
  integer(i8) function contact_number(self)
    class(dem_system_type), intent(in) :: self
    if (parted(self)) then
      contact_number = nint(self%crew%marks%contacts(1), i8)
    else
      contact_number = contact_count(self%dem_data_type)
    end if
  end function contact_number

  !> Lists and forces at the start. Needs grains, materials, laws, par; planes may be absent.
  subroutine init(self, errors)
    class(dem_system_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors

    if (.not. allocated(self%planes%point)) call no_planes(self)
    call check_laws(self)
    call plan_extras(self%laws, self%pairs%extras)
    self%pairs%skin = self%first_skin()
    self%pairs%most_skin = self%pairs%skin
    if (.not. self%par%skin > 0.0_wp) self%pairs%most_skin = 4.0_wp*self%pairs%skin
    self%pairs%least_skin = self%pairs%skin
    if (is_periodic(self%cell)) &
      self%pairs%most_skin = min(self%pairs%most_skin, &
                                 0.5_wp*least_width(self%cell) - 2.0_wp*maxval(self%grains%radius))
    call check_necks(self%dem_data_type, errors)
    if (errors%any()) return
    call allocate_bodies(self%pairs, self%grains, self%planes)
    call update_bodies(self%pairs, self%grains, self%planes, self%cell)
    if (self%apart) then
      call self%crew%begin_fresh(self%dem_data_type, errors)
      self%ready = .true.
      return
    end if
    call self%begin_anew()
    call build_pairs(self%pairs, self%grains, self%planes, self%weights, self%par%ghost_pairs, &
                     self%cell)
    call make_bonds(self%dem_data_type, errors)
    if (errors%any()) return
    if (self%surfaces%n > 0) call list_near(self%dem_data_type)
    if (self%springs%given > 0) call hang_springs(self%dem_data_type, self%springs)
    call evaluate_forces(self%dem_data_type, 0.0_wp)
    self%springs%used = count_springs(self%dem_data_type, self%springs)
    self%pending = 0.0_wp
    self%ready = .true.
    call check_overlap(self%dem_data_type, 'I215', errors)
    call start_ledger(self%dem_data_type, self%par%dt)
  end subroutine init

  subroutine no_planes(self)
    class(dem_system_type), intent(inout) :: self
    real(wp) :: none(3, 0)
    integer(i4) :: no_material(0)
    call make_planes(self%planes, none, none, none, no_material)
  end subroutine no_planes

  !> Margin of the list: as given, or a tenth of the mean least semi-axis of the grains that move.
  pure real(wp) function first_skin(self) result(skin)
    class(dem_system_type), intent(in) :: self
    integer(i4) :: i, n
    real(wp), parameter :: part = 0.1_wp
    skin = self%par%skin
    if (skin > 0.0_wp) return
    skin = 0.0_wp
    n = 0
    do i = 1, self%grains%n
      if (self%grains%kind(i) /= kind_free) cycle
      n = n + 1
      skin = skin + minval(self%grains%axes(:, i))
    end do
    if (n > 0) then
      skin = part*skin/n
    else
      skin = part*minval(self%grains%axes)
    end if
  end function first_skin

  !> The reader of the deck gives every pair of materials that can meet a law.
  subroutine check_laws(self)
    class(dem_system_type), intent(in) :: self
    integer(i4) :: a, b

    do a = 1, size(self%materials)
      if (.not. any(self%grains%material == a)) cycle
      do b = 1, size(self%materials)
        if (.not. (any(self%grains%material == b) .or. any(self%planes%material == b))) cycle
        if (self%laws(a, b)%kind > 0 .and. self%laws(b, a)%kind > 0) cycle
        error stop 'bug: no contact law for two materials that meet'
      end do
    end do
  end subroutine check_laws

  !> n sub-steps of par%dt; afterwards the state is checked (N200, N201, N202).
  subroutine step(self, n, errors)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: n
    type(error_list_type), intent(inout) :: errors

    if (allocated(self%springs%ids)) deallocate (self%springs%ids, self%springs%force)
    if (shared(self)) then
      call self%crew%step(self%dem_data_type, n, errors)
      return
    end if
    call follow_step(self%dem_data_type, self%par%dt)
    call take_steps(self%dem_data_type, self%memory, n, errors)
    if (errors%any()) return
    call check_runaway(self%dem_data_type, errors)
    call check_overlap(self%dem_data_type, 'N202', errors)
    call check_membranes(self%dem_data_type, errors)
  end subroutine step

  !> Forces at the current state; the drift since the last evaluation moves the history on.
  subroutine forces(self)
    class(dem_system_type), intent(inout) :: self
    call update_bodies(self%pairs, self%grains, self%planes, self%cell)
    if (self%parts%active) then
      call self%ghost_forces(.false.)
      call self%free_forces()
      return
    end if
    call rebuild_if_needed(self%dem_data_type)
    call evaluate_forces(self%dem_data_type, self%pending)
    self%pending = 0.0_wp
  end subroutine forces

  !> Ghosts stand at x, quat with velocity v and spin omega at once; bodies are up to date.
  subroutine place(self, index, x, quat, v, omega)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x(:, :), quat(:, :), v(:, :), omega(:, :)
    call place_ghosts(self%dem_data_type, index, x, quat, v, omega)
  end subroutine place
  subroutine free_forces(self)
    class(dem_system_type), intent(inout) :: self
    call forces_on_free(self%dem_data_type)
  end subroutine free_forces
  subroutine ghost_forces(self, alone)
    class(dem_system_type), intent(inout) :: self
    logical, intent(in) :: alone
    call forces_between_ghosts(self%dem_data_type, alone)
  end subroutine ghost_forces

  subroutine set_border(self, index)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    call choose_border(self%dem_data_type, index)
  end subroutine set_border

  !> v += kick F/m of all free grains, then x += drift v of all grains and planes, rotation alike
  !! [s]; zero leaves one out; no forces.
  subroutine kick_drift(self, kick, drift)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: kick, drift
    if (.not. (kick > 0.0_wp .or. drift > 0.0_wp)) return
    call kick_and_drift(self%dem_data_type, kick, drift)
    if (.not. drift > 0.0_wp) return
    self%pending = self%pending + drift
    self%parts%pending = self%parts%pending + drift
    self%health%steps = self%health%steps + 1
  end subroutine kick_drift

  !> Speed of the fastest grain [m/s].
  real(wp) function top_speed(self) result(speed)
    class(dem_system_type), intent(in) :: self
    speed = 0.0_wp
    if (parted(self)) then
      speed = self%crew%marks%speed
    else if (self%grains%n > 0) then
      speed = sqrt(maxval(sum(self%grains%v**2, 1)))
    end if
  end function top_speed

  !> Gershgorin limit of the contacts in hand [s].
  real(wp) function step_limit(self)
    class(dem_system_type), intent(in) :: self
    if (parted(self)) then
      step_limit = self%crew%marks%limit(1)
    else
      step_limit = gershgorin_step(self%dem_data_type)
    end if
  end function step_limit

  !> Gershgorin limit of the contacts not long ago [s].
  real(wp) function recent_limit(self)
    class(dem_system_type), intent(inout) :: self
    integer(i8), parameter :: long = 100  !! evaluations
    if (self%limit_at < 0 .or. self%health%evaluations - self%limit_at >= long .or. &
        self%health%evaluations < self%limit_at) then
      self%limit = self%step_limit()
      self%limit_at = self%health%evaluations
    end if
    recent_limit = self%limit
  end function recent_limit

  !> Least Rayleigh time of the free grains [s].
  real(wp) function rayleigh_limit(self)
    class(dem_system_type), intent(in) :: self
    if (parted(self)) then
      rayleigh_limit = self%crew%marks%limit(2)
    else
      rayleigh_limit = rayleigh_step(self%dem_data_type)
    end if
  end function rayleigh_limit

  !> par%dt_factor times the least of the contact limit, the Rayleigh time and the limit of an
  !! impact at the given speed; no more than the dashpots of contacts allow [s].
  real(wp) function automatic_step(self, speed)
    class(dem_system_type), intent(in) :: self
    real(wp), intent(in) :: speed  !! approach speed, 0: none; of ranks the fastest grain's [m/s]
    real(wp) :: impact
    if (parted(self)) then
      impact = self%crew%marks%limit(3)
    else
      impact = foreseen_step(self%dem_data_type, speed)
    end if
    automatic_step = self%par%dt_factor*min(self%step_limit(), self%rayleigh_limit(), impact)
  end function automatic_step

  !> Prescribed grains go to x1, quat1 in `steps` steps of par%dt: constant velocity and spin.
  subroutine set_motion(self, index, x1, quat1, steps)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x1(:, :)     !! (3, :) [m]
    real(wp), intent(in) :: quat1(:, :)  !! (4, :) [-]
    integer(i4), intent(in) :: steps     !! sub-steps to get there
    real(wp) :: time, rotation(3)
    integer(i4) :: k, i

    time = steps*self%par%dt
    do k = 1, size(index)
      i = index(k)
      rotation = rotation_between(self%grains%quat(:, i), quat1(:, k))
      self%grains%v(:, i) = (x1(:, k) - self%grains%x(:, i))/time
      self%grains%omega(:, i) = rotation/time
      self%grains%turn(:, i) = quaternion_from_rotation(rotation/steps)
      self%grains%target_x(:, i) = x1(:, k)
      self%grains%target_quat(:, i) = quat1(:, k)
      self%grains%has_target(i) = .true.
    end do
    if (allocated(self%crew)) self%crew%redirected = .true.
  end subroutine set_motion

  !> Prescribed grains move with constant velocity and spin from now on.
  subroutine set_velocity(self, index, v, omega)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: v(:, :), omega(:, :)  !! (3, :) [m/s], [rad/s]
    integer(i4) :: k, i
    do k = 1, size(index)
      i = index(k)
      self%grains%v(:, i) = v(:, k)
      self%grains%omega(:, i) = omega(:, k)
      self%grains%turn(:, i) = quaternion_from_rotation(self%par%dt*omega(:, k))
      self%grains%has_target(i) = .false.
    end do
    if (allocated(self%crew)) self%crew%redirected = .true.
  end subroutine set_velocity

  !> Prescribed grains stand at x, quat with velocity v and spin omega at once.
  subroutine set_state(self, index, x, quat, v, omega)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x(:, :), quat(:, :), v(:, :), omega(:, :)
    integer(i4) :: k
    do k = 1, size(index)
      self%grains%x(:, index(k)) = x(:, k)
      self%grains%quat(:, index(k)) = quat(:, k)
    end do
    call self%set_velocity(index, v, omega)
  end subroutine set_state

  !> Forces and moments held on free grains until changed, besides the surcharge.
  subroutine set_extra(self, index, force, moment)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: force(:, :), moment(:, :)  !! (3, :) [N], [N m]
    logical, allocatable :: marked(:)
    integer(i4) :: k
    do k = 1, size(index)
      self%grains%extra_force(:, index(k)) = force(:, k)
      self%grains%extra_moment(:, index(k)) = moment(:, k)
      if (allocated(self%surcharge)) self%grains%extra_force(3, index(k)) = &
        force(3, k) - self%surcharge(index(k))
    end do
    if (.not. allocated(self%crew)) return
    allocate (marked(self%grains%n), source=.false.)
    marked(index) = .true.
    call self%crew%mark_loads(marked)
  end subroutine set_extra

  subroutine clear_extra(self)
    class(dem_system_type), intent(inout) :: self
    self%grains%extra_force = 0.0_wp
    self%grains%extra_moment = 0.0_wp
    if (allocated(self%surcharge)) self%grains%extra_force(3, :) = -self%surcharge
    if (allocated(self%crew)) call self%crew%mark_loads(spread(.true., 1, self%grains%n))
  end subroutine clear_extra

  !> Contact weights by pair id, all others 1; takes effect at the next evaluation.
  subroutine set_weights(self, ids, value)
    class(dem_system_type), intent(inout) :: self
    integer(i8), intent(in) :: ids(:, :)   !! (2, :) in any order
    real(wp), intent(in) :: value(:)       !! [-]
    integer(i8), allocatable :: low(:), high(:)
    integer(i4), allocatable :: order(:)
    logical :: same

    allocate (low(size(value)), high(size(value)))
    low = min(ids(1, :), ids(2, :))
    high = max(ids(1, :), ids(2, :))
    order = sorted_order(high)
    order = order(sorted_order(low(order)))
    same = self%ready .and. size(value) > 0 .and. self%weights%n == size(value)
    if (same) same = all(self%weights%id(1, :) == low(order)) .and. &
      all(self%weights%id(2, :) == high(order)) .and. &
      .not. any(abs(self%weights%value - value(order)) > 0.0_wp)
    if (same) return  ! after a restart: they came with the list, which stays as it is
    self%weights%n = size(value)
    self%weights%id = reshape([low(order), high(order)], [2, size(order)], order=[2, 1])
    self%weights%value = value(order)
    if (self%ready) then
      call build_pairs(self%pairs, self%grains, self%planes, self%weights, self%par%ghost_pairs, &
                       self%cell)
      if (self%surfaces%n > 0) call list_near(self%dem_data_type)
    end if
  end subroutine set_weights

  !> Impulses and works of grains and planes to zero (start of an exchange).
  subroutine reset_impulses(self)
    class(dem_system_type), intent(inout) :: self
    call reset_sums(self%dem_data_type)
    if (allocated(self%crew)) self%crew%reset = .true.
  end subroutine reset_impulses

  !> Indices of ids; unknown ones are faults (I216) and give 0.
  subroutine find(self, ids, index, errors)
    class(dem_system_type), intent(in) :: self
    integer(i8), intent(in) :: ids(:)
    integer(i4), allocatable, intent(out) :: index(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    allocate (index(size(ids)))
    do k = 1, size(ids)
      index(k) = 0
      if (ids(k) > 0) index(k) = index_of(self%dem_data_type, real(ids(k), wp))
      if (index(k) == 0) call errors%add('I216', 'there is no grain with id '//str(ids(k)), &
                                         hint='ids are those of the packing file')
    end do
  end subroutine find

  !> Fill the 'now' columns of the ledger.
  subroutine refresh_ledger(self)
    class(dem_system_type), intent(inout) :: self
    if (parted(self)) then
      call self%glance()
      return
    end if
    call follow_step(self%dem_data_type, self%par%dt)
    call refresh_stored(self%dem_data_type, self%par%dt, self%ledger)
  end subroutine refresh_ledger

  !> Closure error of the ledger as last refreshed [J].
  real(wp) function closure(self)
    class(dem_system_type), intent(in) :: self
    closure = closure_of(self%ledger)
  end function closure

  !> Contacts at the last evaluation, ordered by ids; planes after all grain pairs.
  subroutine contacts(self, list)
    class(dem_system_type), intent(in) :: self
    type(dem_contacts_type), intent(inout) :: list
    call list_contacts(self%dem_data_type, list)
  end subroutine contacts

  !> Keep the state in memory.
  subroutine save(self)
    class(dem_system_type), intent(inout) :: self
    call self%look()
    if (.not. allocated(self%kept)) allocate (self%kept)
    self%kept = self%dem_data_type
  end subroutine save

  !> Keep no state: nothing will be rejected.
  subroutine forget(self)
    class(dem_system_type), intent(inout) :: self
    if (allocated(self%kept)) deallocate (self%kept)
  end subroutine forget

  !> Return to the kept state; what was set through par stays kept too.
  subroutine restore(self)
    class(dem_system_type), intent(inout) :: self
    if (allocated(self%kept)) self%dem_data_type = self%kept
    call self%begin_anew()
  end subroutine restore

  !> The complete state as named arrays.
  subroutine export_state(self, archive)
    class(dem_system_type), intent(in) :: self
    type(dem_archive_type), intent(inout) :: archive
    call put_state(self%dem_data_type, archive)
  end subroutine export_state

  !> Take the state from an archive, instead of init; grains, planes, laws, par were set as before.
  subroutine import_state(self, archive, errors)
    class(dem_system_type), intent(inout) :: self
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    if (.not. allocated(self%planes%point)) call no_planes(self)
    call plan_extras(self%laws, self%pairs%extras)
    call get_state(self%dem_data_type, archive, errors)
    self%ready = .not. errors%any()
  end subroutine import_state
end module dem_system
