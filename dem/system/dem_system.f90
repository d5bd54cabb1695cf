!> A whole system of grains: procedures to set it up, advance and examine it.
!!
!! Order of use: fill grains (dem_make), planes, materials, laws (dem_law), par; init; then step, or
!! the split verbs kick, drift and forces. With ranks: dem_ranked_system; prescribed motion and
!! forces: dem_driven_system.
module dem_system
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_kinds, only: moved_by_forces
  use dem_state, only: dem_data_type, copy_data, keep_data, dem_grains_type, dem_parts_type, &
    dem_ledger_type, fed_size, drained_size
  use dem_bonds_make, only: make_bonds, check_bond_reach
  use dem_cell, only: is_periodic, least_width
  use dem_additional, only: plan_additional, check_reach
  use dem_membrane, only: check_membranes
  use dem_make, only: make_planes
  use dem_pairs, only: allocate_bodies, update_bodies, build_pairs
  use dem_relist, only: rebuild_if_needed
  use dem_steps, only: step_memory_type, take_steps, evaluate_forces, kick_and_drift
  use dem_ledger, only: start_ledger, follow_step, refresh_stored
  use dem_parts, only: choose_border, place_ghosts
  use dem_parts_forces, only: forces_on_free, forces_between_ghosts
  use dem_measure, only: check_overlap, check_runaway
  use dem_hold, only: held_type, hold_others, let_others_go
  use dem_population, only: remove_grains, add_grains, replace_grains, weigh_grains, &
    resize_grains, gain
  use dem_store, only: put_state, get_state
  use dem_contacts, only: dem_contacts_type, list_contacts
  use dem_exact_forces, only: sum_anew
  use dem_start_springs, only: start_springs_type, hang_springs, count_springs
  use dem_surface_search, only: list_near
  use dem_driven_system, only: dem_driven_system_type
  implicit none
  private
  public :: dem_system_type, dem_contacts_type, held_type

  !> The state of a system with its verbs; `kept` is the state that restore returns to.
  type, extends(dem_driven_system_type) :: dem_system_type
    class(dem_data_type), allocatable :: kept
    type(start_springs_type) :: springs       !! that contacts begin with
    real(wp) :: coming_axis = 1.0_wp          !! least semi-axis of what enters an empty system [m]
    logical :: apart = .false.                !! whose first lists and forces each makes for itself
    type(step_memory_type), private :: memory
  contains
    procedure :: init             !! (errors): lists and forces at the start; no time passes
    procedure :: step             !! (n, errors): n sub-steps of par%dt
    procedure :: forces           !! (): forces at the current state; no time passes
    procedure :: place            !! (index, x, quat, v, omega): ghosts, for forces in parts
    procedure :: free_forces      !! (): what is left of those of contacts of free grains
    procedure :: ghost_forces     !! (alone): only those between ghosts
    procedure :: set_border       !! (index): ghosts near free grains; from now on in parts
    procedure :: kick_drift       !! (kick, drift): v += kick (F + X)/m, then x += drift v
    procedure :: first_skin       !! (): margin of the list at the start [m]
    procedure :: contacts         !! (list): contacts at the last evaluation
    procedure :: save             !! (): keep the state in memory
    procedure :: forget           !! (): keep no state
    procedure :: restore          !! (): return to the kept state
    procedure :: leave            !! (leaving): grains leave; no time passes
    procedure :: enter            !! (entering, springs): grains enter; no time passes
    procedure :: replace          !! (leaving, entering): grains break; no time passes
    procedure :: change_weights   !! (ids, value, ghost_pairs): within a run; no time passes
    procedure :: weigh            !! (mass, inertia): of all grains; no time passes
    procedure :: resize           !! (factor): on the sizes of all grains; no time passes
    procedure :: hold             !! (moving, held): all but some free grains; no time passes
    procedure :: let_go           !! (held): those again; no time passes
    procedure :: be_open          !! (): grains may enter and leave from now on
    procedure :: export_state     !! (archive): complete state as named arrays
    procedure :: import_state     !! (archive, errors): instead of init, bit for bit
  end type dem_system_type

contains

  !> Lists and forces at the start. Needs grains, materials, laws, par; planes may be absent.
  subroutine init(self, errors)
    class(dem_system_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors

    if (.not. allocated(self%planes%point)) call no_planes(self)
    call check_laws(self)
    call plan_additional(self%laws, self%pairs%additional)
    self%pairs%skin = self%first_skin()
    self%pairs%most_skin = self%pairs%skin
    if (.not. self%par%skin > 0.0_wp) self%pairs%most_skin = 4.0_wp*self%pairs%skin
    self%pairs%least_skin = self%pairs%skin
    if (is_periodic(self%cell)) &
      self%pairs%most_skin = min(self%pairs%most_skin, &
                                 0.5_wp*least_width(self%cell) - 2.0_wp*maxval(self%grains%radius))
    call check_reach(self%dem_data_type, errors)
    call check_bond_reach(self%dem_data_type, errors)
    if (errors%any()) return
    call allocate_bodies(self%pairs, self%grains, self%planes)
    call update_bodies(self%pairs, self%grains, self%planes, self%cell)
    if (self%apart) then
      call self%rank_team%begin_fresh(self%dem_data_type, errors)
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
    call sum_anew(self%dem_data_type)
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

  !> Margin of the list: as given, or a tenth of the mean least semi-axis of the grains that move,
  !! with polyhedra of the mean radius of spheres about them and features.
  pure real(wp) function first_skin(self) result(skin)
    class(dem_system_type), intent(in) :: self
    integer(i4) :: i, n
    real(wp), parameter :: part = 0.1_wp
    skin = self%par%skin
    if (skin > 0.0_wp) return
    skin = 0.0_wp
    n = 0
    do i = 1, self%grains%n
      if (.not. moved_by_forces(self%grains%kind(i))) cycle
      n = n + 1
      if (allocated(self%pairs%features)) then
        skin = skin + self%grains%radius(i)
      else
        skin = skin + minval(self%grains%axes(:, i))
      end if
    end do
    if (n > 0) then
      skin = part*skin/n
    else if (self%grains%n == 0) then
      skin = part*self%coming_axis
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
    if (allocated(self%springs%shift)) deallocate (self%springs%shift)
    if (self%shared()) then
      call self%rank_team%step(self%dem_data_type, n, errors)
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

  !> Place ghosts at x, quat with velocity v and spin omega; bodies are up to date.
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

  !> Contacts at the last evaluation, ordered by ids; planes after all grain pairs.
  subroutine contacts(self, list)
    class(dem_system_type), intent(in) :: self
    type(dem_contacts_type), intent(inout) :: list
    call list_contacts(self%dem_data_type, list)
  end subroutine contacts

  !> Keep the state in memory.
  subroutine save(self)
    class(dem_system_type), intent(inout) :: self
    call self%gather()
    call keep_data(self%dem_data_type, self%kept)
  end subroutine save

  !> Keep no state: nothing will be rejected.
  subroutine forget(self)
    class(dem_system_type), intent(inout) :: self
    if (allocated(self%kept)) deallocate (self%kept)
  end subroutine forget

  !> Return to the kept state; what was set through par stays kept too.
  subroutine restore(self)
    class(dem_system_type), intent(inout) :: self
    if (allocated(self%kept)) call copy_data(self%kept, self%dem_data_type)
    call self%begin_anew()
  end subroutine restore

  !> These grains leave between two steps; the whole has been gathered.
  subroutine leave(self, leaving, kind, springs, v)
    class(dem_system_type), intent(inout) :: self
    logical, intent(in) :: leaving(:)             !! (grains)
    integer(i4), intent(in), optional :: kind(:)  !! (grains) of those that stay, from now on
    type(start_springs_type), intent(in), optional :: springs  !! of contacts of those let go
    real(wp), intent(in), optional :: v(:, :)  !! (3, grains) of those held from now on [m/s]
    call follow_step(self%dem_data_type, self%par%dt)
    call remove_grains(self%dem_data_type, leaving, kind, springs, v)
    call settle_change(self)
  end subroutine leave

  !> These grains enter between two steps, with the friction of their contacts; the whole has been
  !! gathered.
  subroutine enter(self, entering, springs, kind)
    class(dem_system_type), intent(inout) :: self
    type(dem_grains_type), intent(in) :: entering
    type(start_springs_type), intent(in) :: springs
    integer(i4), intent(in), optional :: kind(:)  !! (grains) of those there are, from now on
    call follow_step(self%dem_data_type, self%par%dt)
    call add_grains(self%dem_data_type, entering, springs, kind)
    call settle_change(self)
  end subroutine enter

  !> These grains break, those enter in their places between two steps; the whole has been gathered.
  subroutine replace(self, leaving, entering)
    class(dem_system_type), intent(inout) :: self
    logical, intent(in) :: leaving(:)  !! (grains)
    type(dem_grains_type), intent(in) :: entering
    call follow_step(self%dem_data_type, self%par%dt)
    call replace_grains(self%dem_data_type, leaving, entering)
    call settle_change(self)
  end subroutine replace

  !> Weights of contacts from now on, and whether those between ghosts are listed; what the contacts
  !! store less or more by it is booked.
  subroutine change_weights(self, ids, value, ghost_pairs)
    class(dem_system_type), intent(inout) :: self
    integer(i8), intent(in) :: ids(:, :)   !! (2, :)
    real(wp), intent(in) :: value(:)       !! [-]
    logical, intent(in) :: ghost_pairs
    type(dem_ledger_type) :: before
    call follow_step(self%dem_data_type, self%par%dt)
    call refresh_stored(self%dem_data_type, self%ledger_dt, before)
    self%par%ghost_pairs = ghost_pairs
    call self%set_weights(ids, value)
    self%ledger%left = self%ledger%left - gain(self%dem_data_type, before)
  end subroutine change_weights

  !> Masses and moments of inertia of all grains from now on; the whole has been gathered.
  subroutine weigh(self, mass, inertia)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: mass(:), inertia(:, :)  !! (grains) [kg], (3, grains) [kg m^2]
    call follow_step(self%dem_data_type, self%par%dt)
    call weigh_grains(self%dem_data_type, mass, inertia)
    call settle_change(self)
  end subroutine weigh

  !> Other sizes of grains from now on; the whole has been gathered.
  subroutine resize(self, factor)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: factor(:)  !! (grains) on all lengths [-]
    call follow_step(self%dem_data_type, self%par%dt)
    call resize_grains(self%dem_data_type, factor)
    call settle_change(self)
  end subroutine resize

  !> Hold all but some free grains, until let_go; the whole has been gathered.
  subroutine hold(self, moving, held)
    class(dem_system_type), intent(inout) :: self
    logical, intent(in) :: moving(:)  !! (grains)
    type(held_type), intent(out) :: held
    call follow_step(self%dem_data_type, self%par%dt)
    call hold_others(self%dem_data_type, moving, held)
    call settle_change(self)
  end subroutine hold

  subroutine let_go(self, held)
    class(dem_system_type), intent(inout) :: self
    type(held_type), intent(inout) :: held
    call follow_step(self%dem_data_type, self%par%dt)
    call let_others_go(self%dem_data_type, held)
    call settle_change(self)
  end subroutine let_go

  !> Checkpoints hold all of the grains from now on, not only their motion.
  subroutine be_open(self)
    class(dem_system_type), intent(inout) :: self
    if (self%open) return
    self%open = .true.
    if (self%grains%n > 0) self%last_id = maxval(self%grains%id)
    allocate (self%fed(fed_size, 0), self%drained(drained_size, 0))
  end subroutine be_open

  !> Ranks and memory of steps know other grains.
  subroutine settle_change(self)
    class(dem_system_type), intent(inout) :: self
    type(step_memory_type) :: fresh
    type(dem_parts_type) :: whole
    self%memory = fresh
    self%parts = whole
    self%pending = 0.0_wp
    call self%begin_anew()
  end subroutine settle_change

  !> The complete state as named arrays.
  subroutine export_state(self, archive)
    class(dem_system_type), intent(in) :: self
    class(dem_archive_type), intent(inout) :: archive
    call put_state(self%dem_data_type, archive)
  end subroutine export_state

  !> Take the state from an archive, instead of init; grains, planes, laws, par were set as before.
  subroutine import_state(self, archive, errors)
    class(dem_system_type), intent(inout) :: self
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    if (.not. allocated(self%planes%point)) call no_planes(self)
    call plan_additional(self%laws, self%pairs%additional)
    if (archive%find('last_id') > 0) call self%be_open()
    call get_state(self%dem_data_type, archive, errors)
    self%ready = .not. errors%any()
  end subroutine import_state
end module dem_system
