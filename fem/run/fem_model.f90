!> A run of talus-fem: deck, body, analysis, files; input and preparation. Nothing is
!! written before the deck, the mesh and the factorisation have passed all checks.
module fem_model
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_options, only: options_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_files, only: folder_of, run_stem, same_file
  use talus_checkpoint, only: checkpoint_type
  use talus_lock, only: lock_type
  use talus_log, only: log_type
  use talus_ranks, only: ranks_type
  use talus_stop, only: stop_type
  use talus_system, only: environment
  use talus_timers, only: timers_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_consolidation, only: fast_warning, short_step_warning
  use fem_deck_keys, only: fem_deck_table
  use fem_deal, only: deal_out, is_dealt, may_be_dealt, take_piece
  use fem_distribute, only: share_out
  use fem_geostatic, only: settle
  use fem_locking, only: locking_warning
  use fem_mm_report, only: energy_warning, flow_warning, held_warning, inertia_warning
  use fem_output, only: fem_output_type
  use fem_pieces, only: fem_piece_type
  use fem_restart, only: write_checkpoint, read_checkpoint
  use fem_setup, only: read_body
  use fem_setup_micro, only: chi_held
  use fem_setup_solver, only: read_storage, choose_solver
  use fem_whole, only: fem_whole_type
  implicit none
  private
  public :: fem_model_type, program_name

  character(len=*), parameter :: program_name = 'talus-fem'

  type :: fem_model_type
    type(options_type) :: options
    type(ranks_type) :: ranks            !! that work on the run
    type(deck_type) :: deck
    type(fem_body_type) :: body
    class(fem_analysis_type), allocatable :: analysis
    type(fem_output_type) :: output
    type(checkpoint_type) :: checkpoint
    type(stop_type) :: stop
    type(timers_type) :: timers
    type(log_type) :: log
    type(lock_type) :: lock
    character(len=:), allocatable :: stem
    type(string_type), allocatable :: warnings(:)
    real(wp) :: start_time = -1.0_wp         !! of the checkpoint [s], < 0: a fresh run
    integer(i8) :: steps = 0, start_steps = 0
    integer(i8) :: row_step = -1             !! of the last row in the log
    integer(i4) :: logged_factors = 0
    logical :: served = .false., stopped = .false., opened = .false.
    logical :: auto_solver = .false.
    logical :: elliptic = .true.             !! all micromorphic points so far
    logical :: settled = .false.             !! under an initial stress, before the first step
    real(wp) :: settlement = 0.0_wp          !! largest displacement to it [m]
    real(wp) :: gradient = 0.0_wp            !! largest so far, see fem_judgement [-]
  contains
    procedure :: read => read_run
    procedure :: prepare
    procedure :: begin
    procedure :: look_at_supports
    procedure :: save_checkpoint
  end type fem_model_type

contains

  !> Deck and mesh.
  subroutine read_run(self, options, errors)
    class(fem_model_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(key_table_type) :: table
    integer(i4) :: threads

    self%options = options
    self%served = len(options%port) > 0
    allocate (self%warnings(0))
    call self%timers%init()
    call fem_deck_table(table)
    call self%deck%read(options%deck, table, errors)
    if (errors%any()) return
    self%stem = run_stem(options%deck, options%output_dir)
    threads = options%threads
    if (threads == 0) call self%deck%get('run', 1, 'threads', threads)
    if (threads == 0 .and. self%ranks%several() .and. len(environment('OMP_NUM_THREADS')) == 0) &
      threads = 1
    if (threads > 0) call omp_set_num_threads(threads)
    if (self%deck%count('output') > 0 .and. same_file(self%deck%path('mesh', 1, 'file'), &
        self%stem//'.h5')) call self%deck%fault(errors, 'D327', &
      'the fields of this run would overwrite its mesh', 'mesh', 1, 'file', &
      'results are named as the deck: rename one of both')
    if (errors%any()) return
    if (self%ranks%several()) then
      call read_on_ranks(self, errors)
    else
      call read_whole(self, errors)
    end if
  end subroutine read_run

  !> The whole body.
  subroutine read_whole(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call read_body(self%deck, self%body, self%analysis, errors)
    if (errors%any()) return
    call element_warnings(self)
    if (self%served) call self%analysis%check_port(self%deck, errors)
    if (self%served .and. self%body%pore%active) &
      call self%body%pore%expect_partner(self%body%dofs%blocks)
    call read_the_rest(self, errors)
  end subroutine read_whole

  subroutine read_the_rest(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%analysis%read_times(self%deck, self%served, errors)
    call read_storage(self%deck, folder_of(self%options%deck), self%served, &
                      self%body%system%solver)
  end subroutine read_the_rest

  !> The whole body by the leader, and a piece of it for each rank where the deck allows it; in
  !! other decks every rank reads the whole and keeps its own elements.
  subroutine read_on_ranks(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: dealt(1)
    dealt = merge(1, 0, may_be_dealt(self%deck, self%served))
    if (dealt(1) > 0) then
      if (self%ranks%leads()) then
        self%body%lean = .true.
        call read_whole(self, errors)
        if (.not. errors%any()) call choose_solver(self%deck, self%body, self%analysis, &
          self%served, self%auto_solver)
        if (.not. errors%any()) dealt = merge(1, 0, is_dealt(self%body, self%ranks))
      end if
      call self%ranks%agree(errors)
      if (errors%any()) return
      call self%ranks%broadcast_numbers(dealt)
      if (dealt(1) > 0) then
        call read_piece(self, errors)
        return
      end if
    end if
    if (.not. allocated(self%analysis)) call read_whole(self, errors)
    if (errors%any()) return
    if (self%body%lean) call self%body%allocate_rest()
    call choose_solver(self%deck, self%body, self%analysis, self%served, self%auto_solver)
    call refuse_ranks(self, errors)
    if (.not. errors%any()) call share_out(self%body, self%ranks, errors)
  end subroutine read_on_ranks

  !> The body again, from the piece of the mesh that this rank gets. Faults of the deck were found
  !! in the whole.
  subroutine read_piece(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(fem_piece_type) :: piece
    type(fem_whole_type) :: whole
    real(wp) :: costs(2)
    if (self%ranks%leads()) then
      call deal_out(self%body, self%ranks, whole, piece)
      costs = [self%body%system%cost_quotient, &
               merge(1.0_wp, 0.0_wp, self%body%system%multigrid_is_less)]
    else
      call take_piece(self%ranks, whole, piece)
    end if
    call self%ranks%broadcast_values(costs)
    call begin_anew(self%body)
    if (allocated(self%analysis)) deallocate (self%analysis)
    self%body%whole = whole
    self%body%mesh = piece%mesh
    self%body%dofs%halo = piece%halo
    self%body%system%cost_quotient = costs(1)
    self%body%system%multigrid_is_less = costs(2) > 0.5_wp
    call read_body(self%deck, self%body, self%analysis, errors)
    if (errors%any()) return
    self%body%elastic%id = piece%element
    self%body%matter%ranks = self%ranks
    self%body%supports%sprung_elsewhere = self%body%supports%ground%n > 0
    call self%ranks%any_of(self%body%supports%sprung_elsewhere)
    call read_the_rest(self, errors)
    call choose_solver(self%deck, self%body, self%analysis, self%served, self%auto_solver)
  end subroutine read_piece

  !> Forget a body.
  subroutine begin_anew(body)
    type(fem_body_type), intent(out) :: body
  end subroutine begin_anew

  !> Fault D338 for features of a single rank.
  subroutine refuse_ranks(self, errors)
    class(fem_model_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    if (self%body%pore%active) call self%deck%fault(errors, 'D338', 'pore pressures require '// &
      'one rank of talus-fem, not '//str(self%ranks%ranks), 'analysis', 1, 'kind', &
      'start it without a launcher; threads work')
  end subroutine refuse_ranks

  !> Elements that lock, and stored energies of micromorphic solids that could be negative.
  subroutine element_warnings(self)
    class(fem_model_type), intent(inout) :: self
    character(len=:), allocatable :: text
    integer(i4) :: m
    if (.not. self%body%matter%micro%active) then
      text = locking_warning(self%body%elastic)
      if (len(text) > 0) call append_string(self%warnings, text)
      return
    end if
    do m = 1, size(self%body%matter%micro%law)
      if (.not. any(self%body%matter%micro%law_of == m)) cycle
      text = energy_warning(self%body%matter%micro%law(m)%elastic)
      if (len(text) > 0) call append_string(self%warnings, 'the stored energy of micromorphic '// &
        'solid '//str(m)//' is not positive definite: '//text)
      text = flow_warning(self%body%matter%micro%law(m))
      if (len(text) > 0) call append_string(self%warnings, text)
      text = held_warning(self%body%matter%micro%law(m), chi_held(self%deck))
      if (len(text) > 0) call append_string(self%warnings, text)
      text = inertia_warning(self%body%matter%micro%law(m), self%body%scheme%massive)
      if (len(text) > 0) call append_string(self%warnings, text)
    end do
  end subroutine element_warnings

  !> Matrices; with a deck of its own also the factors. A checkpoint if one is requested.
  subroutine prepare(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: every_wall, every_time
    integer(i4) :: keep

    call self%timers%start('assembly')
    call self%analysis%before_matrices(self%deck, self%body, self%warnings)
    call self%body%assemble()
    call self%analysis%after_matrices(self%deck, self%body, self%warnings, errors)
    call self%timers%stop('assembly')
    if (errors%any()) return
    call warn_short_step(self)
    call self%deck%get('checkpoint', 1, 'keep', keep)
    call self%checkpoint%init(self%stem, program_name, self%deck%hash(), keep)
    if (len(self%options%restart) > 0 .and. .not. self%options%check) &
      call restart_from(self, errors)
    if (errors%any()) return
    every_wall = 0.0_wp
    every_time = 0.0_wp
    if (.not. self%served) then
      call self%deck%get('checkpoint', 1, 'every_wall', every_wall)
      call self%deck%get('checkpoint', 1, 'every_time', every_time)
      call self%begin(errors)
    end if
    call self%checkpoint%schedule(every_wall, every_time, self%body%accepted%time)
  end subroutine prepare

  !> Steps that consolidation does not resolve, or that resolve what the pores do not.
  subroutine warn_short_step(self)
    class(fem_model_type), intent(inout) :: self
    character(len=:), allocatable :: text
    text = ''
    if (.not. self%body%scheme%dynamic) text = short_step_warning(self%body, self%analysis%dt)
    if (len(text) > 0) call append_string(self%warnings, text)
    text = fast_warning(self%body, self%analysis%dt)
    if (len(text) > 0) call append_string(self%warnings, text)
  end subroutine warn_short_step

  !> The state of the requested checkpoint, if there is one.
  subroutine restart_from(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: path
    type(string_type), allocatable :: found(:)
    integer(i4) :: k
    logical :: changed
    call self%checkpoint%find(self%options%restart, path, found, errors)
    if (errors%any()) return
    do k = 1, size(found)
      call append_string(self%warnings, found(k)%s)
    end do
    if (len(path) == 0) then
      call append_string(self%warnings, 'there is no checkpoint to restart from: a fresh run')
      return
    end if
    call read_checkpoint(self%checkpoint, path, self%body, self%analysis, self%steps, changed, &
                         errors)
    if (errors%any()) return
    self%start_time = self%body%accepted%time
    self%start_steps = self%steps
    if (changed) &
      call append_string(self%warnings, 'the deck is not the one that wrote '//path)
  end subroutine restart_from

  !> The start of the analysis, after equilibrium under an initial stress.
  subroutine begin(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: iterations
    logical :: fresh
    fresh = self%start_time < 0.0_wp
    call self%timers%start('factorisation')
    call choose_solver(self%deck, self%body, self%analysis, self%served, self%auto_solver)
    if (fresh .and. self%body%matter%active .and. &
        self%deck%count('geostatic') + self%deck%count('initial_stress') &
        + self%deck%count('water_table') > 0) then
      call settle(self%body, self%settlement, iterations, errors)
      self%settled = .true.
    end if
    if (.not. errors%any()) &
      call self%analysis%begin(self%body, self%analysis%dt, fresh, errors)
    call self%timers%stop('factorisation')
  end subroutine begin

  !> Choose the solver; a static body must be held (I307).
  subroutine look_at_supports(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call choose_solver(self%deck, self%body, self%analysis, self%served, self%auto_solver)
    call self%analysis%check_held(self%body, errors)
  end subroutine look_at_supports

  subroutine save_checkpoint(self, tag, errors)
    class(fem_model_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors
    call self%timers%start('checkpoint')
    call self%output%flush(errors)
    call write_checkpoint(self%checkpoint, self%body, self%analysis, self%steps, &
                          tag, errors)
    call self%timers%stop('checkpoint')
  end subroutine save_checkpoint
end module fem_model
