!> A run of talus-fem: read, prepare, open, run, finish. Nothing is written before the deck, the
!! mesh and the factorisation are found good.
module fem_model
  use omp_lib, only: omp_set_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type, exit_stopped
  use talus_options, only: options_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_files, only: make_folder, folder_of, run_stem, same_file
  use talus_checkpoint, only: checkpoint_type
  use talus_lock, only: lock_type
  use talus_log, only: log_type, short_number
  use talus_stop, only: stop_type, stop_none
  use talus_summary, only: summary_type
  use talus_system, only: environment
  use talus_timers, only: timers_type
  use fem_body, only: fem_body_type
  use fem_critical, only: scale_rotations
  use fem_deck_keys, only: fem_deck_table
  use fem_geostatic, only: settle
  use fem_mm_report, only: energy_warning
  use fem_mm_watch, only: watch_ellipticity
  use fem_mumps, only: storage_memory, storage_disk
  use fem_output, only: fem_output_type, energy_error
  use fem_relaxation, only: relax
  use fem_supports, only: check_supports
  use fem_restart, only: write_checkpoint, read_checkpoint
  use talus_ranks, only: ranks_type
  use fem_setup, only: read_body
  use fem_distribute, only: share_out
  use fem_start, only: start_motion
  use fem_step, only: take_step
  implicit none
  private
  public :: fem_model_type, program_name

  character(len=*), parameter :: program_name = 'talus-fem'
  real(wp), parameter :: near = 1.0e-9_wp  !! of a step that counts as the end
  integer(i4), parameter :: large = 40000  !! degrees of freedom from which on iterating is faster
  real(wp), parameter :: few_steps = 10.0_wp
  real(wp), parameter :: round_off = 1.0e-10_wp  !! of sums that cancel
  real(wp), parameter :: runaway = 10.0_wp !! stored energy / work put in that ends a run

  type :: fem_model_type
    type(options_type) :: options
    type(ranks_type) :: ranks            !! that work on the run
    type(deck_type) :: deck
    type(fem_body_type) :: body
    type(fem_output_type) :: output
    type(checkpoint_type) :: checkpoint
    type(stop_type) :: stop
    type(timers_type) :: timers
    type(log_type) :: log
    type(lock_type) :: lock
    character(len=:), allocatable :: stem
    type(string_type), allocatable :: warnings(:)
    real(wp) :: dt = 0.0_wp, t_end = 0.0_wp  !! [s]
    real(wp) :: start_time = -1.0_wp         !! of the checkpoint [s], < 0: a fresh run
    integer(i8) :: steps = 0, start_steps = 0
    integer(i8) :: row_step = -1             !! of the last row in the log
    integer(i4) :: logged_factors = 0
    logical :: served = .false., stopped = .false., opened = .false., modal = .false.
    logical :: auto_solver = .false., relaxation = .false.
    real(wp) :: tolerance = 1.0e-8_wp        !! of dynamic relaxation
    integer(i4) :: most_iterations = 100000  !! of one of its steps
    logical :: elliptic = .true.             !! of micromorphic points no other was seen
    logical :: settled = .false.             !! under an initial stress, before the first step
    real(wp) :: settlement = 0.0_wp          !! on the way there, at most [m]
  contains
    procedure :: read => read_run
    procedure :: prepare
    procedure :: begin
    procedure :: look_at_supports
    procedure :: open => open_run
    procedure :: run
    procedure :: finish
    procedure :: save_checkpoint
    procedure :: log_row
    procedure :: log_factors
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
    call read_body(self%deck, self%body, errors)
    if (errors%any()) return
    call moduli_warnings(self)
    if (self%served .and. self%body%newton%arc%active) call self%deck%fault(errors, 'D340', &
      'a coupled run is not followed by arc length', 'analysis', 1, 'continuation', 'leave it out')
    if (self%served .and. self%body%stages%active) call self%deck%fault(errors, 'D339', &
      'a coupled run has no stages', 'stage', 1, '', 'run this deck alone')
    call read_times(self, errors)
    call choose_storage(self)
    if (.not. self%ranks%several() .or. errors%any()) return
    call choose_solver(self)
    call refuse_ranks(self, errors)
    if (.not. errors%any()) call share_out(self%body, self%ranks, errors)
  end subroutine read_run

  !> Fault D338 for what only one rank can do.
  subroutine refuse_ranks(self, errors)
    class(fem_model_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    what = ''
    if (self%served) what = 'a coupled run takes'
    if (self%modal) what = "kind = 'modal' takes"
    if (self%body%matter%micro%active) what = 'micromorphic solids take'
    if (self%body%stages%active) what = 'stages take'
    if (self%body%newton%arc%active) what = "continuation = 'arc_length' takes"
    if (len(what) > 0) call self%deck%fault(errors, 'D338', what//' one rank of talus-fem, not '// &
      str(self%ranks%ranks), 'analysis', 1, 'kind', 'start it without a launcher; threads work')
  end subroutine refuse_ranks

  !> Stored energies of micromorphic solids that could be negative.
  subroutine moduli_warnings(self)
    class(fem_model_type), intent(inout) :: self
    character(len=:), allocatable :: text
    integer(i4) :: m
    if (.not. self%body%matter%micro%active) return
    do m = 1, size(self%body%matter%micro%law)
      if (.not. any(self%body%matter%micro%law_of == m)) cycle
      text = energy_warning(self%body%matter%micro%law(m)%elastic)
      if (len(text) > 0) call append_string(self%warnings, 'the stored energy of micromorphic '// &
        'solid '//str(m)//' is not positive definite: '//text)
    end do
  end subroutine moduli_warnings

  !> Where factors are kept.
  subroutine choose_storage(self)
    class(fem_model_type), intent(inout) :: self
    character(len=:), allocatable :: factors
    call self%deck%get('analysis', 1, 'factors', factors)
    associate (mumps => self%body%solver%mumps)
      if (factors == 'memory') mumps%storage = storage_memory
      if (factors == 'disk') mumps%storage = storage_disk
      mumps%scratch = folder_of(self%options%deck)
      if (self%deck%given('analysis', 1, 'scratch')) &
        mumps%scratch = self%deck%path('analysis', 1, 'scratch')
    end associate
  end subroutine choose_storage

  !> End and step; statics takes one step to 1 s where the deck says nothing.
  subroutine read_times(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kind
    call self%deck%get('run', 1, 't_end', self%t_end)
    call self%deck%get('analysis', 1, 'dt', self%dt)
    call self%deck%get('analysis', 1, 'kind', kind)
    self%modal = kind == 'modal'
    self%relaxation = kind == 'relaxation'
    if (self%deck%given('analysis', 1, 'tolerance')) &
      call self%deck%get('analysis', 1, 'tolerance', self%tolerance)
    if (self%deck%given('analysis', 1, 'max_iterations')) &
      call self%deck%get('analysis', 1, 'max_iterations', self%most_iterations)
    if (self%relaxation .and. self%served) call self%deck%fault(errors, 'D325', &
      'a coupled run is not relaxed', 'analysis', 1, 'kind', "take kind = 'static'")
    if (self%modal .and. self%served) call self%deck%fault(errors, 'D325', &
      'a coupled run takes no modes', 'analysis', 1, 'kind', "run this deck alone")
    if (self%served) return
    if (self%body%dynamic) then
      if (.not. self%t_end > 0.0_wp) call self%deck%fault(errors, 'D308', 'the run has no end', &
        'run', 1, '', 'add t_end = ... in s; only under talus-couple it may be left out')
      if (.not. self%dt > 0.0_wp .and. .not. self%body%explicit) call self%deck%fault(errors, &
        'D308', 'the analysis has no step', 'analysis', 1, 'kind', 'add dt = ... in s')
      return
    end if
    if (.not. self%t_end > 0.0_wp) self%t_end = 1.0_wp
    if (.not. self%dt > 0.0_wp) self%dt = self%t_end
    self%body%newton%arc%t_end = self%t_end
    if (.not. self%body%newton%arc%first > 0.0_wp) self%body%newton%arc%first = self%dt/self%t_end
  end subroutine read_times

  !> Matrices; with a deck of its own also the factors. A checkpoint if one is asked for.
  subroutine prepare(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: path
    type(string_type), allocatable :: found(:)
    real(wp) :: every_wall, every_time
    integer(i4) :: keep, k
    logical :: changed

    call self%timers%start('assembly')
    if (self%body%explicit) call scale_inertia(self)
    call self%body%assemble()
    if (self%body%explicit) call choose_step(self, errors)
    if (.not. self%body%explicit .and. self%body%step_limit < huge(1.0_wp)) &
      call append_string(self%warnings, 'beta < gamma/2: Newmark is stable up to a step of '// &
                         short_number(self%body%step_limit)//' s')
    call self%timers%stop('assembly')
    if (errors%any()) return
    call self%deck%get('checkpoint', 1, 'keep', keep)
    call self%checkpoint%init(self%stem, program_name, self%deck%hash(), keep)
    if (len(self%options%restart) > 0 .and. .not. self%options%check) then
      call self%checkpoint%find(self%options%restart, path, found, errors)
      if (errors%any()) return
      do k = 1, size(found)
        call append_string(self%warnings, found(k)%s)
      end do
      if (len(path) > 0) then
        call read_checkpoint(self%checkpoint, path, self%body, self%steps, changed, errors)
        if (errors%any()) return
        self%start_time = self%body%accepted%time
        self%start_steps = self%steps
        if (changed) &
          call append_string(self%warnings, 'the deck is not the one that wrote '//path)
      else
        call append_string(self%warnings, 'there is no checkpoint to go on from: a fresh run')
      end if
    end if
    every_wall = 0.0_wp
    every_time = 0.0_wp
    if (.not. self%served) then
      call self%deck%get('checkpoint', 1, 'every_wall', every_wall)
      call self%deck%get('checkpoint', 1, 'every_time', every_time)
      if (.not. self%modal) call self%begin(self%dt, errors)
    end if
    call self%checkpoint%schedule(every_wall, every_time, self%body%accepted%time)
  end subroutine prepare

  !> Rotational mass scaling, before the mass is assembled.
  subroutine scale_inertia(self)
    class(fem_model_type), intent(inout) :: self
    real(wp) :: factor, most
    call self%deck%get('analysis', 1, 'rotation_mass', factor)
    if (self%body%dofs%blocks == self%body%mesh%nodes .or. abs(factor - 1.0_wp) <= 0.0_wp) return
    call scale_rotations(self%body%mesh, self%body%dofs, self%body%elastic, factor, most)
    call append_string(self%warnings, 'micro-inertia is raised by up to '//short_number(most)// &
                       ' (rotation_mass)')
  end subroutine scale_inertia

  !> Largest stable step, and the step of the run: that of the deck, or a factor times the largest
  !! and a whole number of them to t_end. Fault D324 for one that is too long.
  subroutine choose_step(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: factor
    logical :: allowed

    associate (body => self%body)
      call self%deck%get('analysis', 1, 'dt_factor', factor)
      call self%deck%get('analysis', 1, 'allow_unstable', allowed)
      if (self%dt > body%step_limit) then
        if (allowed) then
          call append_string(self%warnings, 'dt is '//short_number(self%dt/body%step_limit)// &
                             ' times the largest stable step (allow_unstable)')
        else
          call self%deck%fault(errors, 'D324', 'dt = '//short_number(self%dt)// &
            ' s is above the largest stable step '//short_number(body%step_limit)// &
            ' s, which element '//str(body%stiffest)//' sets', 'analysis', 1, 'dt', 'leave dt out')
        end if
      else if (.not. self%dt > 0.0_wp) then
        self%dt = factor*body%step_limit
        if (self%t_end > 0.0_wp) self%dt = self%t_end/ceiling(self%t_end/self%dt, i8)
      end if
    end associate
  end subroutine choose_step

  !> Conjugate gradients for large statics of few steps, factors for the rest.
  subroutine choose_solver(self)
    class(fem_model_type), intent(inout) :: self
    character(len=:), allocatable :: solver
    call self%deck%get('analysis', 1, 'solver', solver)
    associate (body => self%body)
      self%auto_solver = solver == 'auto'
      body%solver%iterative = solver == 'iterative'
      if (body%solver%iterative .and. self%deck%given('analysis', 1, 'tolerance')) &
        call self%deck%get('analysis', 1, 'tolerance', body%solver%tolerance)
      if (.not. self%auto_solver) return
      body%solver%iterative = .not. (body%dynamic .or. self%served .or. self%modal .or. &
                                     self%relaxation .or. body%matter%active) .and. &
        count(.not. body%held) >= large .and. self%t_end <= few_steps*self%dt
    end associate
  end subroutine choose_solver

  !> Factors for steps of dt, and the acceleration at the start of a dynamic run. A served dynamic
  !! run learns dt from its first step; after a restart the factors are for that of the checkpoint,
  !! bit for bit.
  subroutine begin(self, dt, errors)
    class(fem_model_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: iterations
    call self%timers%start('factorisation')
    call choose_solver(self)
    if (self%start_time < 0.0_wp .and. self%body%matter%active .and. &
        self%deck%count('geostatic') + self%deck%count('initial_stress') > 0) then
      call settle(self%body, self%settlement, iterations, errors)
      self%settled = .true.
    end if
    if (self%body%dynamic .and. self%start_time < 0.0_wp) call start_motion(self%body, errors)
    if (errors%any()) then
      continue
    else if (self%relaxation) then
      call check_supports(self%body%mesh, self%body%dofs, self%body%pattern, self%body%held, &
                          self%body%ground, errors)
    else if (self%body%dynamic .and. self%body%restored_dt > 0.0_wp) then
      call self%body%factor(self%body%restored_dt, errors)
    else if (dt > 0.0_wp .or. .not. self%body%dynamic) then
      call self%body%factor(dt, errors)
    end if
    call self%timers%stop('factorisation')
  end subroutine begin

  !> Choose the solver; a static body must be held (I307).
  subroutine look_at_supports(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call choose_solver(self)
    if (.not. self%body%dynamic) call check_supports(self%body%mesh, self%body%dofs, &
      self%body%pattern, self%body%held .or. self%body%prescribed, self%body%ground, errors)
  end subroutine look_at_supports

  !> Open log and results; the first state of a fresh run is written.
  subroutine open_run(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: title, stop_file
    real(wp) :: wall_limit
    integer(i4) :: k

    call open_log(self, errors)
    if (errors%any()) return
    self%opened = .true.
    call self%deck%get('run', 1, 'title', title)
    call self%log%header(program_name, title, self%options%deck, self%deck%hash(), &
                         self%ranks%ranks, int(omp_get_max_threads(), i4))
    call self%deck%echo(lines)
    call self%log%deck_echo(lines)
    call self%log%section('Model')
    call self%log%item('nodes', str(self%body%mesh%nodes))
    call self%log%item('elements', str(self%body%whole%elements(self%body%mesh%elements)))
    call self%log%item('mass', str(sum(self%body%lumped(:self%body%mesh%nodes)))//' kg')
    if (self%start_time >= 0.0_wp) call self%log%item('goes on from', str(self%start_time)//' s')
    if (self%body%explicit) call self%log%item('largest stable step', &
      short_number(self%body%step_limit)//' s', 'dt '//short_number(self%dt)//' s')
    if (self%settled) call self%log%item('settled under the initial stress', &
      short_number(self%settlement)//' m', 'displacements count from there')
    call self%log_factors()
    call self%log%memory()
    do k = 1, size(self%warnings)
      call self%log%warn(self%warnings(k)%s)
    end do
    call row_titles(self%log)
    call self%output%open(self%deck, self%stem, self%body, self%start_time, errors)
    wall_limit = 0.0_wp
    stop_file = ''
    if (.not. self%served) then
      call self%deck%get('run', 1, 'wall_limit', wall_limit)
      call self%deck%get('run', 1, 'stop_file', stop_file)
      if (len(stop_file) > 0) stop_file = self%deck%path('run', 1, 'stop_file')
    end if
    call self%stop%init(wall_limit, stop_file, obey_signals=.not. self%served)
    call self%ranks%agree(errors)
    if (self%start_time < 0.0_wp .and. .not. self%modal .and. .not. errors%any()) &
      call self%output%write_due(self%body, .false., errors)
    call self%ranks%agree(errors)
  end subroutine open_run

  !> Lock and log of the leader; the others are silent.
  subroutine open_log(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (self%ranks%leads()) then
      call make_folder(folder_of(self%stem), errors)
      if (.not. errors%any()) call self%lock%take(self%stem, program_name, errors)
      if (.not. errors%any()) &
        call self%log%open(self%stem//'.log', errors, append=self%start_time >= 0.0_wp)
    else
      call self%log%open('', errors, screen=.false.)
    end if
    call self%ranks%agree(errors)
  end subroutine open_log

  subroutine row_titles(log)
    type(log_type), intent(inout) :: log
    type(string_type) :: titles(6)
    titles(1)%s = 'time [s]'
    titles(2)%s = 'steps'
    titles(3)%s = 'largest u [m]'
    titles(4)%s = 'strain [J]'
    titles(5)%s = 'kinetic [J]'
    titles(6)%s = 'energy error'
    call log%row_titles(titles)
  end subroutine row_titles

  subroutine log_row(self)
    class(fem_model_type), intent(inout) :: self
    self%row_step = self%steps
    call self%log%row([self%body%accepted%time, real(self%steps, wp), &
                       sqrt(maxval(sum(self%body%accepted%u**2, 1))), &
                       self%body%accepted_energy%strain, self%body%accepted_energy%kinetic, &
                       energy_error(self%body)])
  end subroutine log_row

  !> Tell of factorisations that the log does not know yet.
  subroutine log_factors(self)
    class(fem_model_type), intent(inout) :: self
    real(wp), parameter :: giga = 1.0e9_wp
    associate (solver => self%body%solver)
      if (.not. self%opened .or. solver%factorisations <= self%logged_factors) return
      if (self%body%matter%active .and. self%logged_factors > 0) return  ! one an iteration
      self%logged_factors = solver%factorisations
      if (solver%iterative) then
        call self%log%item('solver', 'conjugate gradients', str(solver%free)// &
          ' free degrees of freedom, incomplete factors '// &
          short_number(solver%cg%factors%memory)//' MB, diagonal raised by '// &
          short_number(solver%cg%factors%raise))
        return
      end if
      call self%log%item('factorisation '//str(solver%factorisations), &
                         str(solver%free)//' free degrees of freedom', &
                         short_number(real(solver%mumps%entries, wp))//' entries, '// &
                         short_number(solver%mumps%flops/giga)//' GFlop, METIS order'// &
                         trim(merge(', on disk', '         ', solver%mumps%on_disk)))
    end associate
  end subroutine log_factors

  !> Steps to the end, a fault or a request to stop.
  subroutine run(self, errors)
    class(fem_model_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t1
    integer(i4) :: iterations
    logical :: last, save_now

    do
      if (self%body%accepted%time >= self%t_end - near*self%dt) exit
      call look_around(self, save_now)
      if (self%stopped) exit
      if (save_now) call self%save_checkpoint('', errors)
      t1 = real(self%steps + 1, wp)*self%dt
      last = t1 >= self%t_end - near*self%dt
      if (last) t1 = self%t_end
      call self%timers%start('steps')
      if (self%relaxation) then
        call relax(self%body, t1, self%tolerance, self%most_iterations, iterations, errors)
        call self%log%item('relaxed', str(iterations)//' iterations')
      else
        call take_step(self%body, t1, errors)
      end if
      if (errors%any() .and. self%auto_solver .and. self%body%solver%iterative) &
        call go_direct(self, t1, errors)
      call self%timers%stop('steps')
      if (self%body%matter%active) call self%output%write_iterations(self%body, errors)
      if (.not. errors%any()) call check_energy(self%body, errors)
      call watch_ellipticity(self%body, self%log, errors%any(), self%elliptic)
      call self%ranks%agree(errors)
      if (errors%any()) return
      call self%body%hand_over()
      self%steps = self%steps + 1
      call self%timers%start('output')
      call self%output%write_due(self%body, last, errors)
      call self%timers%stop('output')
      call self%ranks%agree(errors)
      if (errors%any()) return
      if (self%body%solver%iterative) call self%log%item('iterations', &
        str(self%body%solver%cg%iterations), 'residual '// &
        short_number(self%body%solver%cg%residual))
      if (self%log%row_due()) call self%log_row()
      if (.not. self%ranks%several()) &  ! a launcher's screen is a terminal, also into a file
        call self%log%progress(t1/self%t_end, 'time '//short_number(t1)//' s')
    end do
  end subroutine run

  !> Is the run to stop, or a checkpoint due? The leader decides.
  subroutine look_around(self, save_now)
    class(fem_model_type), intent(inout) :: self
    logical, intent(out) :: save_now
    integer(i4) :: asked(2)
    asked(1) = self%stop%check()
    save_now = self%stop%checkpoint_asked()
    if (.not. save_now .and. asked(1) == stop_none) &
      save_now = self%checkpoint%due(self%body%accepted%time)
    asked(2) = merge(1, 0, save_now)
    call self%ranks%tell_numbers(asked)
    save_now = asked(2) > 0 .and. asked(1) == stop_none
    self%stopped = asked(1) /= stop_none
    if (self%stopped) call self%log%line('stopped by '//self%stop%text())
  end subroutine look_around

  !> The step again by factors, where conjugate gradients were chosen and did not converge.
  subroutine go_direct(self, t1, errors)
    class(fem_model_type), intent(inout) :: self
    real(wp), intent(in) :: t1
    type(error_list_type), intent(inout) :: errors
    call self%log%warn('conjugate gradients did not converge; factors are made')
    call errors%clear()
    call self%body%reject()
    self%body%solver%iterative = .false.
    call self%body%solver%cg%drop()
    self%body%fresh_numbering = .false.
    self%body%factored_dt = -1.0_wp
    call take_step(self%body, t1, errors)
    call self%log_factors()
  end subroutine go_direct

  !> A dynamic body cannot store more than was put in; the fastest node is named.
  subroutine check_energy(body, errors)
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp) :: stored
    integer(i4) :: node
    if (.not. body%dynamic) return
    associate (e => body%energy)
      stored = e%strain + e%kinetic
      if (body%explicit) stored = stored + e%numerical
      if (stored <= runaway*(e%start + abs(e%load) + abs(e%support) + abs(e%spring)) &
          + round_off*(e%strain + e%kinetic)) return
      node = int(maxloc(sum(body%state%v**2, 1), 1), i4)
      call errors%add('N303', 'runaway energy: '//short_number(stored)// &
        ' J are stored, '//short_number(e%start + e%load + e%support)//' J were put in; node '// &
        str(node)//' is fastest', 'time '//str(body%state%time)//' s', &
        'is beta < gamma/2? Then the step must resolve the highest frequency of the mesh')
    end associate
  end subroutine check_energy

  subroutine save_checkpoint(self, tag, errors)
    class(fem_model_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors
    call self%timers%start('checkpoint')
    call self%output%flush(errors)
    call write_checkpoint(self%checkpoint, self%body, self%steps, tag, errors)
    call self%timers%stop('checkpoint')
  end subroutine save_checkpoint

  !> Checkpoint if stopped, close everything, summary, last line.
  subroutine finish(self, exit_code, errors)
    class(fem_model_type), intent(inout) :: self
    integer(i4), intent(out) :: exit_code
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: late
    type(summary_type) :: summary

    if (self%opened) then
      if (errors%any()) call self%output%write_last(self%body, late)
      if (self%stopped .and. .not. self%served .and. .not. errors%any()) &
        call self%save_checkpoint('', errors)
      call self%output%close(errors)
    end if
    call self%ranks%agree(errors)
    exit_code = errors%exit_code()
    if (exit_code == 0 .and. self%stopped) exit_code = exit_stopped
    if (.not. self%opened) call self%lock%release()
    if (.not. self%opened) return
    if (self%row_step < self%steps) call self%log_row()
    call self%log%health('energy error '//short_number(energy_error(self%body))//', '// &
                         str(self%body%solver%factorisations)//' factorisations')
    call self%log%timer_table(self%timers)
    call self%log%faults(errors)
    call summary%set_program(program_name, self%options%deck, self%deck%hash())
    call summary%set('exit_code', exit_code)
    call summary%set('wall_time_s', self%timers%elapsed())
    call summary%set('steps', self%steps)
    call summary%set('time_s', self%body%accepted%time)
    call summary%set('health.energy_error', energy_error(self%body))
    call summary%set('health.factorisations', self%body%solver%factorisations)
    if (.not. (self%body%explicit .or. self%relaxation .or. self%modal)) &
      call summary%set('health.residual', self%body%residual)
    call summary%set_timers(self%timers)
    call summary%set_errors(errors)
    if (self%ranks%leads()) call summary%write(self%stem//'_summary.json', late)
    call self%log%finish(program_name, exit_code, 'time '//short_number(self%body%accepted%time)// &
                         ' s, '//str(self%steps)//' steps', self%timers%elapsed())
    call self%log%close()
    call self%lock%release()
  end subroutine finish
end module fem_model
