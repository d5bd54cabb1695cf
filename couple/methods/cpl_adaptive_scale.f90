!> Overlap of the bridging scale that goes with a body: elements before it are opened and the grains
!! that slept in them wake, ghosts become free (theory: overlap coupling, Conversion).
!!
!! A conversion is made at an accepted exchange: the population of the grains is changed, then the
!! sets, maps, weights, masses and limits are made by the set-up's own code, with the places now as
!! the reference. Motion goes on; what jumps in the forces on nodes is held from then on. Elements
!! behind the body may close again. Faults N460, N463, D460.
module cpl_adaptive_scale
  use talus_kinds, only: wp, i4, i8
  use talus_port_names, only: can_element_stress, what_asleep
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_checkpoint, only: checkpoint_info_type
  use talus_hdf5, only: h5_file_type
  use talus_history, only: history_type
  use talus_log, only: log_type, short_number
  use talus_timers, only: timers_type
  use talus_scalars, only: scalar_kinetic, scalar_elastic, scalar_momentum
  use cpl_bed, only: bed_type, change_type, ask_places
  use cpl_bridging_scale, only: bridging_scale_type
  use cpl_cells, only: cells_type
  use cpl_choices, only: cpl_choices_type
  use cpl_closing, only: closing_type, fate_type
  use cpl_gap, only: find_gap, mass_gap, density_of, stress_type, read_stress, mobilised, &
    yielded
  use cpl_overlap, only: overlap_type
  use cpl_overlap_carry, only: carried_type, carry_from, look_at_motion
  use cpl_overlap_file, only: read_overlap_reference
  use cpl_overlap_limit, only: kick_watch_type
  use cpl_overlap_setup, only: make_overlap, begin_overlap, read_grains, read_mesh
  use cpl_rebirth, only: rebirth_type
  use cpl_reborn, only: reborn_type
  use cpl_roles, only: roles_type, by_ratio, by_plastic, by_strain
  use cpl_run, only: cpl_run_type
  use cpl_sets, only: pack_type, part_none, part_rest, part_ghost, part_free
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: adaptive_scale_type

  real(wp), parameter :: far = 1.0e6_wp       !! [m] where no node is
  real(wp), parameter :: most_apart = 0.1_wp  !! of the masses of grains and continuum [-]

  character(len=18), parameter :: columns(31) = [character(len=18) :: 'time [s]', 'opened [-]', &
    'without [-]', 'ghosts [-]', 'woken [-]', 'freed [-]', 'left [-]', 'awake [-]', &
    'replays [-]', 'replay_steps [-]', 'gap_stress [-]', 'rest_steps [-]', &
    'unbalanced [-]', 'moved [m]', 'kinetic [J]', 'elastic [J]', 'largest_hold [N]', &
    'momentum [kg m/s]', 'closed [-]', 'strain [-]', 'past_strain [-]', &
    'front_strain [-]', 'gap_mass [-]', 'reborn [-]', 'gap_yield [-]', 'gap_yield_mean [-]', &
    'guests [-]', 'lost [-]', 'seam_overlap [-]', 'seam_moved [m]', 'seam_unbalanced [-]']

  type, extends(bridging_scale_type) :: adaptive_scale_type
    type(roles_type) :: roles
    type(bed_type) :: bed
    type(closing_type) :: closing
    type(rebirth_type) :: rebirth
    type(reborn_type) :: reborn
    integer(i8) :: conversions = 0
    real(wp) :: energy = 0.0_wp        !! that conversions have brought [J]
    real(wp) :: gap = 0.0_wp           !! of the stress where grains woke, over the tile's mean [-]
    real(wp) :: front = 0.0_wp         !! largest strain of an element of ghosts [-]
    type(history_type) :: history
  contains
    procedure :: check
    procedure :: make
    procedure :: start
    procedure :: after
    procedure :: own_columns
    procedure :: own_values
    procedure :: own_health
    procedure :: put_own
    procedure :: get_own
    procedure :: log_own
    procedure, private :: convert
    procedure, private :: note
  end type adaptive_scale_type

contains

  !> The group &adapt.
  subroutine check(self, run, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call self%roles%read(run%deck, run%choices, errors)
    call self%closing%read(run%deck)
  end subroutine check

  !> Parts of the elements and who is awake, then the sets; after a restart those of the checkpoint.
  subroutine make(self, run, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(overlap_type) :: plain
    integer(i4), allocatable :: part(:)
    real(wp), allocatable :: reference(:, :)

    associate (grains => run%solvers(side_grains), timers => run%timers)
      call read_mesh(plain, run%solvers(side_solid), timers, errors)
      if (errors%any()) return
      call self%roles%set_mesh(plain%cells, run%choices%t_end, run%deck%source%path, errors)
      call check_solid(self, plain%cells, run%solvers(side_solid), errors)
      if (any(plain%cells%polar) .and. .not. (run%again .or. errors%any())) &
        call check_stressless(run%solvers(side_solid), timers, errors)
      if (errors%any()) return
      self%bed%histories%active = self%roles%replay
      call self%bed%histories%begin(plain%cells)
      self%bed%cells = plain%cells
      self%rebirth%cells = plain%cells
      self%rebirth%x = plain%cells%x
      self%reborn%density = density_of(plain%cells)
      if (run%again) then
        call read_overlap_reference(run%checkpoint, run%state, reference, errors)
        if (.not. errors%any()) call read_parts(self, run, errors)
        if (.not. errors%any()) call self%bed%read(grains, plain%cells, timers, errors)
        if (.not. errors%any()) call self%bed%library%read(grains%reply, plain%cells, &
          self%roles, run%solvers(side_solid), errors)
        if (.not. errors%any()) call self%bed%forget(self%roles, spread(.true., 1, &
                                                                        plain%cells%elements))
      else
        call self%roles%plan(plain%cells, 0.0_wp, spell(self, run), part)
        call move_alloc(part, self%roles%part)
        call self%closing%note_parts(self%roles%part, self%roles%part)
        call grains%describe(what_asleep, '', timers, errors)
        if (.not. errors%any()) call self%bed%library%read(grains%reply, plain%cells, &
          self%roles, run%solvers(side_solid), errors)
        if (.not. errors%any()) call choose_tiles(self, run, plain%cells, errors)
        if (.not. errors%any()) call read_grains(plain, grains, timers, errors)
        if (.not. errors%any()) call self%bed%begin(grains, self%roles, plain%pack, plain%cells, &
                                                    timers, errors)
      end if
      if (self%closing%active .and. .not. errors%any()) &
        call self%rebirth%begin(run%solvers(side_solid), timers, errors)
      if (errors%any()) return
      self%o%sets%part = self%roles%part
      self%o%sets%by_kind = .true.
      call make_overlap(self%o, run%solvers, run%choices, run%dynamic, reference, timers, errors)
      if (.not. errors%any()) call self%share(run, errors)
    end associate
  end subroutine make

  !> D460: a solid whose state is not transferred.
  subroutine check_solid(self, cells, solid, errors)
    class(adaptive_scale_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    type(cpl_solver_type), intent(in) :: solid
    type(error_list_type), intent(inout) :: errors
    if (.not. solid%can(can_element_stress)) then
      if (self%roles%opening(by_ratio) > 0.0_wp) call errors%add('D460', 'open_ratio is given, '// &
        'and '//solid%title()//' has no stress of the bed', solid%deck, &
        'take a law with a state, or open_strain')
      if (self%roles%opening(by_plastic) > 0.0_wp) call errors%add('D460', 'open_plastic is '// &
        'given, and '//solid%title()//' has no plastic strain', solid%deck, &
        'take a law with a state, or open_strain')
    end if
    if (cells%micromorphic) then
      call errors%add('D460', 'the solid has micro-deformations', solid%deck, &
        'grains follow a body in classical and micropolar solids')
    else if (any(cells%polar) .and. self%closing%active) then
      call errors%add('D460', 'elements of a micropolar solid do not close', solid%deck, &
        'leave close_behind out of &adapt, or take a classical solid')
    end if
  end subroutine check_solid

  !> D460: what a micropolar solid bears before the start is not held at conversions.
  subroutine check_stressless(solid, timers, errors)
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(stress_type) :: points
    call read_stress(solid, points, timers, errors)
    if (errors%any()) return
    if (any(abs(points%stress) > 0.0_wp)) call errors%add('D460', 'the micropolar solid begins '// &
      'with a stress', solid%deck, 'leave the initial stress out, or take a classical law')
  end subroutine check_stressless

  !> Tiles of the elements that wake grains: by their density and plastic strain now.
  subroutine choose_tiles(self, run, placed, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(cells_type), intent(in) :: placed  !! the mesh now
    type(error_list_type), intent(inout) :: errors
    type(stress_type) :: points
    real(wp) :: volume(placed%elements), plastic(placed%elements)
    integer(i4) :: e
    associate (bed => self%bed)
      if (.not. bed%library%active) return
      plastic = 0.0_wp
      if (bed%library%by_strain()) then
        call read_stress(run%solvers(side_solid), points, run%timers, errors)
        if (errors%any()) return
        plastic = yielded(points, placed%elements)
      end if
      volume = [(placed%volume(e)/bed%cells%volume(e), e=1, placed%elements)]
      call bed%library%choose(self%roles%part, volume, plastic)
    end associate
  end subroutine choose_tiles

  !> Time that a plan looks ahead: two of its intervals [s].
  pure real(wp) function spell(self, run)
    class(adaptive_scale_type), intent(in) :: self
    type(cpl_run_type), intent(in) :: run
    spell = 2.0_wp*self%roles%every*run%choices%exchange
  end function spell

  !> Parts, and displacements when the sets were made.
  subroutine read_parts(self, run, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(in) :: run
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    call run%checkpoint%open(run%state, file, info, errors)
    if (errors%any()) return
    allocate (self%roles%part(size(self%roles%middle, 2)), source=0_i4)
    call file%get_into('/adapt/part', self%roles%part, errors)
    if (file%exists('/adapt/base')) then
      allocate (self%o%map%base(3, size(self%roles%start) - 1), source=0.0_wp)
      call file%get_into('/adapt/base', self%o%map%base, errors)
      if (.not. all(abs(self%o%map%base) < far)) call errors%add('I404', "'"//file%path// &
        "': /adapt/base is no displacement", file%path//':/adapt/base', 'use an older checkpoint')
    end if
    if (file%exists('/adapt/base_phi')) then
      allocate (self%o%map%base_phi, mold=self%o%map%base)
      call file%get_into('/adapt/base_phi', self%o%map%base_phi, errors)
    end if
    call self%bed%histories%get(file, errors)
    call self%bed%library%get(size(self%roles%part, kind=i4), file, errors)
    call self%closing%get(size(self%roles%part, kind=i4), file, errors)
    if (self%closing%active .and. .not. errors%any()) call self%rebirth%get(file, errors)
    if (any(self%roles%part < part_none .or. self%roles%part > part_free)) &
      call errors%add('I404', "'"//file%path//"': /adapt/part names parts that there are not", &
                      file%path//':/adapt/part', 'use an older checkpoint')
    call file%close(errors)
  end subroutine read_parts

  subroutine start(self, run, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call self%start_audit(run, errors)
    if (errors%any()) return
    call self%history%begin(run%stem//'_conversions.csv', columns, &
                            merge(run%begins, -1.0_wp, run%again), errors)
    if (.not. (run%again .or. errors%any())) &
      call self%note(0.0_wp, change_type(awake=size(self%o%pack%id)), spread(0.0_wp, 1, 4), errors)
  end subroutine start

  !> The row of the audit; then a conversion, if the plan is another one.
  subroutine after(self, run, t1, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: part(:)
    logical, dimension(size(self%roles%part)) :: closing, strained
    type(pack_type) :: pack_of

    call self%follow_exchange(run, t1, errors)
    if (errors%any() .or. .not. self%roles%is_due(self%step)) return
    if (self%step >= run%choices%exchanges) return
    call find_closing(self, run, t1, pack_of, closing, errors)
    if (errors%any()) return
    call note_strain(self, run, t1, strained, errors)
    if (errors%any()) return
    call self%roles%plan(self%o%cells, t1, spell(self, run), part, closing, strained)
    if (all(part == self%roles%part)) return
    call self%closing%note_parts(self%roles%part, part)
    call move_alloc(part, self%roles%part)
    call self%convert(run, t1, count(closing, kind=i4), pack_of, errors)
  end subroutine after

  !> Elements that close now: those that may, if they are quiet.
  subroutine find_closing(self, run, t1, pack_of, closing, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1         !! [s]
    type(pack_type), intent(out) :: pack_of  !! grains now, if elements may close
    logical, intent(out) :: closing(:)       !! (elements)
    type(error_list_type), intent(inout) :: errors
    logical :: quiet
    closing = .false.
    if (.not. self%closing%active) return
    call ask_places(run%solvers(side_grains), pack_of, run%timers, errors)
    if (errors%any()) return
    call self%roles%may_close(self%o%cells, t1, spell(self, run), closing)
    call self%closing%look(self%o%cells, self%roles%part, pack_of, closing, quiet)
    closing = closing .and. quiet
  end subroutine find_closing

  !> What the elements have gone through, and which of ghosts are strained so much that they are
  !! opened; those that have closed once are not.
  subroutine note_strain(self, run, t1, strained, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1            !! [s]
    logical, intent(out) :: strained(:)   !! (elements)
    type(error_list_type), intent(inout) :: errors
    type(carried_type) :: carried
    type(stress_type) :: points
    real(wp) :: found(3, size(strained))
    integer(i4) :: e

    strained = .false.
    if (.not. (self%roles%replay .or. any(self%roles%opening > 0.0_wp))) return
    run%solvers%time = t1
    call look_at_motion(self%o, run%solvers(side_solid), carried, run%timers, errors)
    if (errors%any()) return
    call self%bed%histories%note(self%o%cells, carried%u, &
                                 carried%part == part_rest .or. carried%part == part_ghost)
    if (.not. any(self%roles%opening > 0.0_wp)) return
    found = 0.0_wp
    if (any(self%roles%opening(by_ratio:) > 0.0_wp)) then
      call read_stress(run%solvers(side_solid), points, run%timers, errors)
      if (errors%any()) return
      found(by_ratio, :) = mobilised(points, size(strained, kind=i4))
      found(by_plastic, :) = yielded(points, size(strained, kind=i4))
    end if
    do e = 1, size(strained)
      if (carried%part(e) /= part_ghost .or. self%closing%shut(e)) cycle
      found(by_strain, e) = self%bed%histories%strain(self%o%cells, carried%u, e)
      strained(e) = any(self%roles%opening > 0.0_wp .and. found(:, e) > self%roles%opening)
      if (.not. strained(e)) cycle
      if (any(all(carried%held(:, self%o%cells%nodes_of(e)), 1))) then
        call errors%add('N460', 'element '//str(e)//', which the deck of the solid holds, is '// &
          'strained more than open_strain or open_plastic, or stressed more than open_ratio of '// &
          '&adapt', 'conversion at '//str(t1)//' s', 'a wider mesh, or a larger number of &adapt')
        return
      end if
    end do
  end subroutine note_strain

  !> Largest strain of an element of ghosts that has not closed before.
  pure real(wp) function front_strain(self, carried) result(largest)
    class(adaptive_scale_type), intent(in) :: self
    type(carried_type), intent(in) :: carried
    integer(i4) :: e
    largest = 0.0_wp
    do e = 1, size(carried%part)
      if (carried%part(e) == part_ghost .and. .not. self%closing%shut(e)) &
        largest = max(largest, self%bed%histories%strain(self%o%cells, carried%u, e))
    end do
  end function front_strain

  !> Elements are opened: who wakes, who is free, and the overlap made anew.
  subroutine convert(self, run, t1, closed, pack_of, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1             !! [s]
    integer(i4), intent(in) :: closed      !! elements
    type(pack_type), intent(in) :: pack_of  !! grains now, if elements may close
    type(error_list_type), intent(inout) :: errors
    type(carried_type) :: carried
    type(cells_type) :: placed
    real(wp) :: before(5), change(5)

    run%solvers%time = t1
    before = totals(self%o)
    call run%timers%start('conversions')
    call carry_from(self%o, run%solvers(side_solid), carried, run%timers, errors)
    self%bed%change = change_type(closed=closed)
    if (.not. errors%any()) self%front = front_strain(self, carried)
    if (self%closing%active .and. .not. errors%any()) &
      call close_elements(self, run, pack_of, carried, errors)
    if (self%bed%library%active .and. .not. errors%any()) then
      call self%bed%cells%place(self%bed%cells%x + carried%u, placed)
      call choose_tiles(self, run, placed, errors)
    end if
    if (.not. errors%any()) call self%bed%convert(self%o, run%solvers(side_grains), self%roles, &
                                                  carried, run%timers, errors)
    if (.not. errors%any()) call self%bed%leave_behind(run%solvers(side_grains), self%roles, &
                                                       run%timers, errors)
    if (.not. errors%any()) call check_awake(self, t1, errors)
    if (.not. errors%any()) call find_gap(run%solvers(side_solid), self%bed%change, &
                                          self%roles%most_gap, run%timers, self%gap, errors)
    if (.not. errors%any()) call renew(self, run, carried, errors)
    call run%timers%stop('conversions')
    if (errors%any()) return
    change = totals(self%o) - before
    self%energy = self%energy + sum(change(:2))
    self%conversions = self%conversions + 1
    associate (told => self%bed%change)
      call self%note(t1, told, [change(:2), maxval(abs(self%o%forces%f_hold)), &
                                norm2(change(3:))], errors)
      call run%log%line('time '//short_number(t1)//' s: '//str(told%woken)//' grains woke, '// &
        str(told%freed)//' ghosts are free, '//str(told%slept)//' left, '//str(told%awake)// &
        ' are awake'//closed_text(told, self%reborn)//replays_text(told, self%gap)// &
        seam_text(told))
    end associate
    call renew_watch(self, run, errors)
  end subroutine convert

  !> Elements that have closed: nodes where the grains are, who becomes a ghost and who sleeps.
  subroutine close_elements(self, run, pack_of, carried, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(pack_type), intent(in) :: pack_of
    type(carried_type), intent(inout) :: carried
    type(error_list_type), intent(inout) :: errors
    type(cells_type) :: placed
    type(fate_type) :: fate
    call self%rebirth%place(run%solvers(side_solid), self%roles%part, pack_of, carried, &
                            run%timers, errors)
    if (errors%any()) return
    call self%bed%cells%place(self%rebirth%x + carried%u, placed)
    call self%reborn%give_stress(run%solvers, placed, reshape([carried%part, self%roles%part], &
      [size(self%roles%part), 2]), pack_of, run%timers, errors)
    if (errors%any()) return
    call self%closing%sort_out(placed, self%roles, pack_of, carried%v, fate)
    call self%bed%close_behind(run%solvers(side_grains), pack_of%id, fate, run%timers, errors)
  end subroutine close_elements

  !> Of elements that have closed, if there are any.
  pure function closed_text(change, reborn) result(text)
    type(change_type), intent(in) :: change
    type(reborn_type), intent(in) :: reborn
    character(len=:), allocatable :: text
    text = ''
    if (change%closed > 0) text = '; '//str(change%closed)//' elements have closed'
    if (reborn%count > 0) text = text//', '//str(reborn%count)//' with the stress of their '// &
      'grains, of which the law took back '//short_number(reborn%beyond(1))//' of the pressure'
  end function closed_text

  !> Of replays, if there were any.
  pure function replays_text(change, gap) result(text)
    type(change_type), intent(in) :: change
    real(wp), intent(in) :: gap
    character(len=:), allocatable :: text
    text = ''
    if (change%replays > 0) text = '; '//str(change%replays)//' replays of '// &
      str(change%replay_steps)//' steps, stress of tile and continuum differ by '// &
      short_number(gap)//' of the pressure'
  end function replays_text

  !> Of grains between two tiles, if there were any.
  pure function seam_text(change) result(text)
    type(change_type), intent(in) :: change
    character(len=:), allocatable :: text
    text = ''
    if (change%guests + change%lost > 0) text = '; between two tiles '//str(change%guests)// &
      ' woke for '//str(change%lost)//' others, '//short_number(change%seam(1))//' of their '// &
      'volume overlapped'
  end function seam_text

  !> N463: more grains are awake than the deck allows.
  subroutine check_awake(self, t1, errors)
    class(adaptive_scale_type), intent(in) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (self%bed%change%awake <= self%roles%most_grains) return
    call errors%add('N463', str(self%bed%change%awake)//' grains are awake, more than '// &
      'most_grains = '//str(self%roles%most_grains), 'conversion at '//str(t1)//' s', &
      'raise &adapt most_grains, or open fewer elements: a smaller free_within, fewer layers')
  end subroutine check_awake

  !> The overlap for the parts from now on.
  subroutine renew(self, run, carried, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(carried_type), intent(in) :: carried
    type(error_list_type), intent(inout) :: errors
    class(overlap_type), allocatable :: fresh
    real(wp), allocatable :: none(:, :)

    allocate (fresh)
    call fresh%go_on_from(self%o)
    fresh%sets%part = self%roles%part
    fresh%sets%by_kind = .true.
    fresh%map%base = carried%u
    if (any(self%o%cells%polar)) fresh%map%base_phi = carried%phi
    call make_overlap(fresh, run%solvers, run%choices, run%dynamic, none, run%timers, errors)
    if (errors%any()) return
    call move_alloc(fresh, self%o)
    call self%share(run, errors)
    if (.not. errors%any()) call begin_overlap(self%o, run%solvers, run%choices, .false., &
                                               run%timers, errors, carried)
  end subroutine renew

  !> The limit of kicks of the new maps.
  subroutine renew_watch(self, run, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(kick_watch_type) :: watch
    self%kick_watch = watch
    if (.not. errors%any()) &
      call self%kick_watch%begin(self%o, run%solvers, run%timers, errors)
  end subroutine renew_watch

  !> Kinetic and elastic energy of all [J], and their momentum [kg m/s].
  pure function totals(o) result(total)
    type(overlap_type), intent(in) :: o
    real(wp) :: total(5), edge(6)
    edge = o%edge_momentum()
    associate (g => o%ledger%grains, s => o%ledger%solid, p => scalar_momentum)
      total = [g(scalar_kinetic) + s(scalar_kinetic) + o%edge_kinetic(), &
               g(scalar_elastic) + s(scalar_elastic), g(p:p + 2) + s(p:p + 2) + edge(:3)]
    end associate
  end function totals

  !> A row of <stem>_conversions.csv.
  subroutine note(self, time, change, numbers, errors)
    class(adaptive_scale_type), intent(inout) :: self
    real(wp), intent(in) :: time         !! [s]
    type(change_type), intent(in) :: change
    real(wp), intent(in) :: numbers(4)   !! change of energies, held load, change of momentum
    type(error_list_type), intent(inout) :: errors
    associate (part => self%roles%part)
      call self%history%write([time, real(count(part == part_free .or. part == part_none), wp), &
        real(count(part == part_none), wp), real(count(part == part_ghost), wp), &
        real(change%woken, wp), real(change%freed, wp), real(change%slept, wp), &
        real(change%awake, wp), real(change%replays, wp), real(change%replay_steps, wp), &
        self%gap, real(change%steps, wp), change%unbalanced, change%moved, numbers, &
        real(change%closed, wp), self%closing%found, self%front, &
        mass_gap(self%o, self%bed%cells), real(self%reborn%count, wp), self%reborn%beyond, &
        real(change%guests, wp), real(change%lost, wp), change%seam], errors)
      call self%history%flush(errors)
    end associate
  end subroutine note

  subroutine own_columns(self, columns)
    class(adaptive_scale_type), intent(in) :: self
    type(string_type), allocatable, intent(inout) :: columns(:)
    call append_string(columns, 'conversion_energy [J]')
  end subroutine own_columns

  function own_values(self) result(values)
    class(adaptive_scale_type), intent(in) :: self
    real(wp), allocatable :: values(:)
    values = [self%energy]
  end function own_values

  function own_health(self) result(text)
    class(adaptive_scale_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = str(self%conversions)//' conversions, '//str(size(self%o%pack%id))//' grains awake, '
  end function own_health

  subroutine put_own(self, file, errors)
    class(adaptive_scale_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/adapt/part', self%roles%part, errors)
    if (allocated(self%o%map%base)) call file%put('/adapt/base', self%o%map%base, errors)
    if (allocated(self%o%map%base_phi)) &
      call file%put('/adapt/base_phi', self%o%map%base_phi, errors)
    call self%bed%histories%put(file, errors)
    call self%bed%library%put(file, errors)
    call self%closing%put(file, errors)
    if (self%closing%active) call self%rebirth%put(file, errors)
    call self%o%ledger%put_bond(file, errors)
    call file%put('/adapt/numbers', [real(self%conversions, wp), self%energy], errors)
  end subroutine put_own

  subroutine get_own(self, file, errors)
    class(adaptive_scale_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp) :: numbers(2)
    numbers = 0.0_wp
    call self%o%ledger%get_bond(file, errors)
    call file%get_into('/adapt/numbers', numbers, errors)
    self%conversions = nint(numbers(1), i8)
    self%energy = numbers(2)
  end subroutine get_own

  !> How the elements are opened.
  subroutine log_own(self, log, choices)
    class(adaptive_scale_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    type(cpl_choices_type), intent(in) :: choices
    real(wp) :: apart
    call self%bridging_scale_type%log_own(log, choices)
    apart = mass_gap(self%o, self%bed%cells)
    if (abs(apart) > most_apart) call log%warn('W432'//': ghosts have '// &
      short_number(1.0_wp + apart)//' of the mass of the continuum in their elements: give the '// &
      'solid the density of the bed, its solid fraction times that of the grains, and a mesh '// &
      'that ends where the bed does')
    if (self%bed%library%active .and. self%roles%rest_steps == 0) call log%warn('W436'// &
      ': grains of several tiles meet and do not come to rest before they move: give &adapt '// &
      'rest_steps')
    call log%item('elements are opened', 'within '//short_number(self%roles%within)// &
      ' m of the way of the body', 'every '//str(self%roles%every)//' exchanges; '// &
      str(size(self%bed%id))//' grains sleep')
  end subroutine log_own
end module cpl_adaptive_scale
