!> Breakage of grains: those whose stress exceeds their strength break into fragments, between two
!! steps (theory-dem, Breakage of grains). Faults D356, D357, D359, N225.
!!
!! Strength and fragments are functions of ids alone; what has broken so far is part of the state
!! (crushed, lineage, fines).
!! eq. D.29
module dem_breakage
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: log_type, short_number
  use talus_system, only: memory_free
  use dem_breakage_choice, only: choose_grains
  use dem_breakage_group, only: breakage_type, read_breakage, check_foreseen, diameter_of
  use dem_breakage_growth, only: plan_growth, growth_due, grown_diameter
  use dem_breakage_masses, only: mass_scaled, check_masses, weigh_fragments, counted_mass
  use dem_breakage_pieces, only: put_pieces, balance_of
  use dem_entry, only: size_batch, make_batch, check_ids
  use dem_fragments, only: family_count, family_halves
  use dem_grain_stress, only: grain_stress_type, find_stresses, spare_safe, criterion_hertz
  use dem_packing, only: dem_packing_type
  use dem_shape_make, only: admit_shapes
  use dem_state, only: dem_data_type, dem_grains_type, crushed_size, grown_size, kind_free, &
    kind_ghost
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: dem_breakage_type, partner_type, generation_of

  ! places in crushed: grains broken, mass [kg], momentum [N s] and angular momentum about the
  ! origin [N m s] of fines, surface created [m^2], fragments
  integer(i4), parameter :: sum_broken = 1, sum_fines(2) = [2, 8], sum_surface = 9, &
    sum_fragments = 10
  real(wp), parameter :: most_jump = 0.2_wp  !! part of a growth in one look, without W310
  integer(i4), parameter :: bytes_a_grain = 8000  !! while lists are made anew
  character(len=26), parameter :: columns(13) = [character(len=26) :: 'time [s]', 'broken [-]', &
    'fragments [-]', 'fines_mass [kg]', 'momentum_x [N s]', 'momentum_y [N s]', &
    'momentum_z [N s]', 'angular_momentum_x [N m s]', 'angular_momentum_y [N m s]', &
    'angular_momentum_z [N m s]', 'surface [m2]', 'released [J]', 'fines [J]']
  character(len=14), parameter :: event_columns(10) = [character(len=14) :: 'time [s]', 'id [-]', &
    'generation [-]', 'diameter [m]', 'stress [Pa]', 'strength [Pa]', 'force [N]', 'x [m]', &
    'y [m]', 'z [m]']

  !> What a look has to know of a partner.
  type :: partner_type
    integer(i8) :: since = 0           !! steps taken at its last exchange
    logical, allocatable :: held(:)    !! (grains) that it counts on
  end type partner_type

  type :: dem_breakage_type
    type(breakage_type), allocatable :: item(:)
    character(len=:), allocatable :: path              !! of the deck
    integer(i4), allocatable, private :: group(:)      !! (materials) 0: none
    real(wp), allocatable, private :: limit(:)         !! (grains) strength; huge: none [Pa]
    integer(i8), allocatable, private :: known(:)      !! (grains) ids that it is of
    type(grain_stress_type), private :: found
    integer(i4), private :: above = 0                  !! prescribed grains above their strength,
    integer(i8), private :: first_above = 0            !! at most in a look; the first of them
    real(wp), private :: ratio_above = 0.0_wp          !! and its stress over its strength [-]
    type(history_type) :: history, events
    logical :: warned = .false.  !! of grains that told_above tells of
    real(wp), private :: jump = 0.0_wp  !! greatest part of its growth that a grain made at once [-]
  contains
    procedure :: read => read_groups
    procedure :: active
    procedure :: longest_block
    procedure :: due
    procedure :: look
    procedure :: told_above
    procedure :: foretold
    procedure :: log_groups
    procedure :: log_totals
    procedure :: open => open_histories
    procedure :: write => write_row
    procedure :: flush => flush_histories
    procedure :: close => close_histories
    procedure, private :: renew_limits
    procedure, private :: break_grains
    procedure, private :: grow
    procedure, private :: book
    procedure, private :: most
  end type dem_breakage_type

contains

  !> All &breakage groups; the system is open from now on if there are any.
  subroutine read_groups(self, deck, materials, dt, served, system, errors)
    class(dem_breakage_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: materials(:)  !! of each group
    real(wp), intent(in) :: dt               !! fixed step that must suit fragments [s]; 0: none
    logical, intent(in) :: served            !! a partner drives the run
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k, before

    before = errors%count
    self%path = deck%source%path
    allocate (self%item(size(materials)))
    allocate (self%group(size(system%materials)), source=0_i4)
    do k = 1, size(materials)
      if (materials(k) == 0) cycle
      call deck%get('breakage', k, 'material', name)
      call read_breakage(deck, k, materials(k), name, self%item(k), errors)
      if (self%group(materials(k)) > 0) call deck%fault(errors, 'D356', "material '"//name// &
        "' has two groups", 'breakage', k, 'material', 'give one for each material that breaks')
      self%group(materials(k)) = k
      call check_laws(deck, k, self%item(k), system%dem_data_type, errors)
      call check_masses(deck, k, self%item(k)%mass, system%dem_data_type, errors)
      if (errors%count == before) &
        call check_foreseen(deck, k, system%dem_data_type, self%item(k), dt, errors)
    end do
    if (.not. self%active() .or. errors%count > before) return
    do k = 1, size(self%item)
      system%materials(self%item(k)%material)%fragments_scaled = self%item(k)%mass == mass_scaled
    end do
    call check_run(deck, served, errors)
    do k = 1, size(self%item)
      if (served .and. self%item(k)%regrow > 0.0_wp) call deck%fault(errors, 'D375', &
        'fragments do not grow under a partner', 'breakage', k, 'regrow', &
        'leave it out; a partner counts on the sizes of grains between its exchanges')
    end do
    if (.not. served) call system%be_open()
    if (any(self%item%family == family_halves)) &
      call admit_shapes(system%grains, system%materials, errors)
    allocate (system%crushed(crushed_size), source=0.0_wp)
    allocate (system%lineage(3, 0), system%fines(2, 0))
    if (any(self%item%regrow > 0.0_wp)) allocate (system%growing(grown_size, 0))
  end subroutine read_groups

  !> Contact pressures want Hertz's law (D359).
  subroutine check_laws(deck, k, group, d, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(breakage_type), intent(in) :: group
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    if (group%criterion /= criterion_hertz) return
    associate (laws => d%laws(:, group%material))
      if (all(laws%base%hertz .or. laws%kind == 0)) return
    end associate
    call deck%fault(errors, 'D359', "a contact law of material '"//group%name//"' has no "// &
                    'contact pressure: its normal force is not that of Hertz', 'breakage', k, &
                    'criterion', "take 'nominal' or 'octahedral', or law = 'hertz_mindlin'")
  end subroutine check_laws

  !> What numbers its grains by those of the start, or has a partner to share them with, does not go
  !! with breakage (D357).
  subroutine check_run(deck, served, errors)
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served  !! a partner drives the run
    type(error_list_type), intent(inout) :: errors
    character(len=9), parameter :: groups(4) = [character(len=9) :: 'window', 'tile', 'surcharge', &
      'bond']
    integer(i4) :: k
    do k = 1, merge(4, 2, served)
      if (deck%count(trim(groups(k))) == 0) cycle
      if (k <= 2) then
        call deck%fault(errors, 'D357', '&'//trim(groups(k))//' numbers its copies by the '// &
          'grains of the tile: their ids would meet those of fragments', 'breakage', 1, '', &
          'leave one of the two out, or run in two stages: crush, then go on from the packing')
      else
        call deck%fault(errors, 'D357', '&'//trim(groups(k))//' under a partner counts on the '// &
          'grains of the start', 'breakage', 1, '', 'leave one of the two out: a partner takes '// &
          'what loads and binds grains as it was when the run began')
      end if
    end do
  end subroutine check_run

  pure logical function active(self)
    class(dem_breakage_type), intent(in) :: self
    active = .false.
    if (allocated(self%item)) active = size(self%item) > 0
  end function active

  !> Largest number of steps without a look.
  pure integer(i4) function longest_block(self)
    class(dem_breakage_type), intent(in) :: self
    longest_block = huge(1_i4)
    if (self%active()) longest_block = minval(self%item%every)
  end function longest_block

  pure logical function due(self, steps, since)
    class(dem_breakage_type), intent(in) :: self
    integer(i8), intent(in) :: steps            !! taken so far
    integer(i8), intent(in), optional :: since  !! taken at a partner's last exchange
    integer(i4) :: k
    due = .false.
    if (.not. self%active()) return
    due = any([(self%item(k)%due(steps, since), k=1, size(self%item))])
  end function due

  !> Grains above their strength break, but for those that a partner counts on.
  subroutine look(self, system, steps, time, changed, errors, partner)
    class(dem_breakage_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i8), intent(in) :: steps  !! taken so far
    real(wp), intent(in) :: time      !! [s]
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    type(partner_type), intent(in), optional :: partner
    integer(i4) :: criterion(size(self%group)), k
    integer(i4), allocatable :: order(:)
    logical :: due

    call system%gather()
    call self%renew_limits(system%dem_data_type)
    criterion = 0
    do k = 1, size(self%item)
      due = self%item(k)%due(steps)
      if (present(partner)) due = self%item(k)%due(steps, partner%since)
      if (due) criterion(self%item(k)%material) = self%item(k)%criterion
    end do
    call find_stresses(system%dem_data_type, criterion, self%found)
    if (present(partner)) call note_above(self, system%dem_data_type, partner%held)
    call choose_grains(system%dem_data_type, self%found%stress, self%limit, order)
    changed = size(order) > 0
    if (changed) call self%break_grains(system, order, time, errors)
    if (errors%any() .or. .not. allocated(system%growing)) return
    if (size(system%growing, 2) > 0) call self%grow(system, time, changed)
  end subroutine look

  !> Fragments that grow have the size that is due.
  subroutine grow(self, system, time, changed)
    class(dem_breakage_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    real(wp), intent(in) :: time  !! [s]
    logical, intent(inout) :: changed
    real(wp) :: span(size(self%group)), factor(system%grains%n), jump
    integer(i4) :: k
    span = 0.0_wp
    do k = 1, size(self%item)
      span(self%item(k)%material) = self%item(k)%regrow
    end do
    call growth_due(system%dem_data_type, time, span, factor, jump)
    self%jump = max(self%jump, jump)
    if (.not. jump > 0.0_wp) return
    call system%resize(factor)
    changed = .true.
  end subroutine grow

  !> Grains of a partner that are above their strength are counted; they stay.
  subroutine note_above(self, d, held)
    class(dem_breakage_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: held(:)
    logical :: above(size(held))
    integer(i4) :: first
    above = held .and. self%found%stress > self%limit
    if (count(above) > self%above) then
      first = findloc(above, .true., 1)
      self%above = count(above)
      self%first_above = d%grains%id(first)
      self%ratio_above = self%found%stress(first)/self%limit(first)
    end if
    where (held) self%found%stress = 0.0_wp
  end subroutine note_above

  !> What is told of them (W433), '' as long as there are none.
  function told_above(self) result(text)
    class(dem_breakage_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (self%above == 0) return
    text = 'W433'//': '//str(self%above)//trim(merge(' grain  ', ' grains ', self%above == 1))// &
      ' that the partner counts on, grain '//str(self%first_above)//' the first, would break: '// &
      short_number(self%ratio_above)//' of its strength; the solid is too near to what crushes'
  end function told_above

  !> Strengths, if grains have entered or left since the last look.
  subroutine renew_limits(self, d)
    class(dem_breakage_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    real(wp), allocatable :: limit(:)
    real(wp) :: size_of
    integer(i4) :: i, j, k, criterion(size(self%group))

    if (.not. allocated(self%known)) allocate (self%known(0), self%limit(0))
    if (size(self%known) == d%grains%n) then
      if (all(self%known == d%grains%id)) return
    end if
    allocate (limit(d%grains%n), source=huge(1.0_wp))
    j = 1
    do i = 1, d%grains%n
      k = self%group(d%grains%material(i))
      if (k == 0 .or. all(d%grains%kind(i) /= [kind_free, kind_ghost])) cycle
      do while (j < size(self%known))
        if (self%known(j) >= d%grains%id(i)) exit
        j = j + 1
      end do
      if (j <= size(self%known)) then
        if (self%known(j) == d%grains%id(i)) limit(i) = self%limit(j)
      end if
      if (limit(i) < huge(1.0_wp)) cycle
      size_of = grown_diameter(d, i)
      if (size_of > self%item(k)%smallest) &
        limit(i) = self%item(k)%strength_of(d%grains%id(i), size_of)
    end do
    call move_alloc(limit, self%limit)
    self%known = d%grains%id
    criterion = 0
    do k = 1, size(self%item)
      criterion(self%item(k)%material) = self%item(k)%criterion
    end do
    call spare_safe(self%found, d, criterion, self%limit)
  end subroutine renew_limits

  !> They leave, their fragments enter; sums and rows of the events follow.
  subroutine break_grains(self, system, order, time, errors)
    class(dem_breakage_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i4), intent(in) :: order(:)
    real(wp), intent(in) :: time
    type(error_list_type), intent(inout) :: errors
    type(dem_packing_type) :: batch
    type(dem_grains_type) :: entering
    logical :: leaving(system%grains%n)
    integer(i4), allocatable :: parent(:), material(:)
    real(wp) :: surface
    integer(i4) :: i, k, n

    leaving = .false.
    leaving(order) = .true.
    n = sum(family_count(self%item(self%group(system%grains%material(order)))%family))
    if (real(system%grains%n, wp) - size(order) + n > self%most(system%grains%n)) then
      call errors%add('N225', str(size(order))//' grains would break into '//str(n)// &
                      ' fragments: more than '//short_number(self%most(system%grains%n))// &
                      ' grains may be', self%path, 'go on from the last checkpoint with a '// &
                      'larger &breakage most_grains or on a larger machine, or take a larger '// &
                      'smallest')
      return
    end if
    call size_batch(batch, n)
    allocate (parent(n), material(n))
    do i = 1, system%grains%n
      if (.not. leaving(i)) cycle
      k = batch%n
      call put_pieces(system%dem_data_type, i, self%item(self%group(system%grains%material(i))), &
                      self%found%toward(:, i), system%last_id + k + 1, batch, surface)
      parent(k + 1:batch%n) = i
      material(k + 1:batch%n) = system%grains%material(i)
      system%crushed(sum_surface) = system%crushed(sum_surface) + surface
    end do
    if (n > 0) call check_ids('breakage', batch, self%path, errors)
    if (errors%any()) return
    call make_batch(batch, material, system, entering, errors)
    if (errors%any()) return
    do i = 1, system%grains%n
      if (leaving(i)) call weigh(i, findloc(parent, i, 1), findloc(parent, i, 1, back=.true.))
    end do
    do k = 1, size(order)
      call write_event(self, system%dem_data_type, order(k), time, errors)
    end do
    call self%book(system%dem_data_type, leaving, parent, entering)
    call system%replace(leaving, entering)

  contains

    !> Masses of the fragments first to last of a grain.
    subroutine weigh(i, first, last)
      integer(i4), intent(in) :: i, first, last
      associate (group => self%item(self%group(system%grains%material(i))))
        if (group%regrow > 0.0_wp) &
          call plan_growth(system%dem_data_type, i, first, last, time, entering)
        call weigh_fragments(system%dem_data_type, i, group%mass, first, last, entering)
      end associate
    end subroutine weigh
  end subroutine break_grains

  !> How many grains there may be: as the deck says, or as fit into the memory that is free.
  real(wp) function most(self, n)
    class(dem_breakage_type), intent(in) :: self
    integer(i4), intent(in) :: n  !! grains now
    most = huge(1.0_wp)
    if (any(self%item%most_grains > 0)) &
      most = minval(self%item%most_grains, mask=self%item%most_grains > 0)
    if (memory_free() > 0) most = min(most, real(n, wp) + real(memory_free(), wp)/bytes_a_grain)
  end function most

  !> Sums, lineage and fines of broken grains, before they leave.
  subroutine book(self, d, leaving, parent, entering)
    class(dem_breakage_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: leaving(:)
    integer(i4), intent(in) :: parent(:)           !! of the entering grains
    type(dem_grains_type), intent(in) :: entering
    integer(i8), allocatable :: line(:, :)
    real(wp), allocatable :: fines(:, :)
    real(wp) :: balance(7), part(7)
    integer(i4) :: i, k, n

    n = 0
    allocate (line(3, entering%n), fines(2, count(leaving)))
    k = 0
    do i = 1, d%grains%n
      if (.not. leaving(i)) cycle
      balance = balance_of(d%grains, i)
      balance(1) = counted_mass(d, d%grains, i)
      n = n + 1
      fines(2, n) = diameter_of(d, i)
      do while (k < entering%n)
        if (parent(k + 1) /= i) exit
        k = k + 1
        part = balance_of(entering, k)
        part(1) = counted_mass(d, entering, k)
        balance = balance - part
        fines(2, n) = min(fines(2, n), 2.0_wp*product(entering%axes(:, k))**(1.0_wp/3.0_wp))
        line(:, k) = [entering%id(k), d%grains%id(i), generation_of(d, d%grains%id(i)) + 1_i8]
      end do
      fines(1, n) = balance(1)
      d%crushed(sum_fines(1):sum_fines(2)) = d%crushed(sum_fines(1):sum_fines(2)) + balance
    end do
    d%crushed(sum_broken) = d%crushed(sum_broken) + n
    d%crushed(sum_fragments) = d%crushed(sum_fragments) + entering%n
    d%lineage = reshape([d%lineage, line], [3, size(d%lineage, 2) + size(line, 2)])
    d%fines = reshape([d%fines, fines], [2, size(d%fines, 2) + size(fines, 2)])
  end subroutine book

  !> How many times the grains that a grain comes from have broken.
  elemental integer(i4) function generation_of(d, id) result(generation)
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: id
    integer(i4) :: low, high, middle
    generation = 0
    if (.not. allocated(d%lineage)) return
    low = 1
    high = size(d%lineage, 2)
    do while (low <= high)
      middle = (low + high)/2
      if (d%lineage(1, middle) == id) then
        generation = int(d%lineage(3, middle), i4)
        return
      else if (d%lineage(1, middle) < id) then
        low = middle + 1
      else
        high = middle - 1
      end if
    end do
  end function generation_of

  !> What breaks and what may come of it, for the log.
  subroutine log_groups(self, log)
    class(dem_breakage_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    integer(i4) :: k
    if (.not. self%active()) return
    do k = 1, size(self%item)
      call log%item(trim(merge('breakage', '        ', k == 1)), self%item(k)%text())
    end do
    if (len(too_many(self)) > 0) call log%warn(too_many(self))
  end subroutine log_groups

  !> The same for --check, in lines.
  function foretold(self) result(text)
    class(dem_breakage_type), intent(in) :: self
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = ''
    do k = 1, size(self%item)
      text = text//new_line('a')//'breakage: '//self%item(k)%text()
    end do
    if (len(too_many(self)) > 0) text = text//new_line('a')//'warning: '//too_many(self)
  end function foretold

  !> Warning of more grains than may be, '' for none.
  function too_many(self) result(text)
    class(dem_breakage_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (sum(self%item%grains) <= self%most(0_i4)) return
    text = 'if all grains broke down to &breakage smallest there would be '// &
      short_number(sum(self%item%grains))//' of them, more than '// &
      short_number(self%most(0_i4))//' that may be: the run ends before (N225)'
  end function too_many

  !> What has broken, for the log.
  subroutine log_totals(self, log, d)
    class(dem_breakage_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    type(dem_data_type), intent(in) :: d
    character(len=:), allocatable :: text
    if (.not. self%active()) return
    associate (sums => d%crushed, released => d%ledger%released)
      text = 'breakage: '//str(nint(sums(sum_broken), i8))//' grains broken into '// &
        str(nint(sums(sum_fragments), i8))//' fragments, fines '// &
        short_number(sums(sum_fines(1)))//' kg, surface '//short_number(sums(sum_surface))//' m2'
      if (sums(sum_surface) > 0.0_wp) text = text//', released '// &
        short_number(released/sums(sum_surface))//' J/m2'
      if (any(self%item%fracture_energy > 0.0_wp)) text = text//' (fracture energy '// &
        short_number(maxval(self%item%fracture_energy))//' J/m2)'
    end associate
    call log%line(text)
    if (self%above > 0) call log%warn(self%told_above())
    if (self%jump > most_jump) call log%warn('W310'//': a fragment made '// &
      short_number(self%jump)//' of its growth in one look: its contacts jump; give a longer '// &
      '&breakage regrow, or a smaller check_every')
  end subroutine log_totals

  !> <stem>_breakage.csv, one row a time; <stem>_broken.csv, one row a broken grain.
  subroutine open_histories(self, stem, time, errors)
    class(dem_breakage_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active()) return
    call self%history%begin(stem//'_breakage.csv', columns, time, errors)
    call self%events%begin(stem//'_broken.csv', event_columns, time, errors)
  end subroutine open_histories

  subroutine write_row(self, time, d, errors)
    class(dem_breakage_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    if (.not. self%history%is_open()) return
    call self%history%write([time, d%crushed(sum_broken), d%crushed(sum_fragments), &
                             d%crushed(sum_fines(1):sum_surface), d%ledger%released, &
                             d%ledger%fines], errors)
  end subroutine write_row

  subroutine write_event(self, d, i, time, errors)
    class(dem_breakage_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (.not. self%events%is_open()) return
    call self%events%write([time, real(d%grains%id(i), wp), &
                            real(generation_of(d, d%grains%id(i)), wp), diameter_of(d, i), &
                            self%found%stress(i), self%limit(i), self%found%force(i), &
                            d%grains%x(:, i)], errors)
  end subroutine write_event

  subroutine flush_histories(self, errors)
    class(dem_breakage_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%history%flush(errors)
    call self%events%flush(errors)
  end subroutine flush_histories

  subroutine close_histories(self, errors)
    class(dem_breakage_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%history%close(errors)
    call self%events%close(errors)
  end subroutine close_histories
end module dem_breakage
