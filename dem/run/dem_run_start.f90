!> The start of a run: deck and packing, first forces and time step, or the state of a checkpoint.
module dem_run_start
  use omp_lib, only: omp_set_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_options, only: options_type
  use talus_deck_table, only: key_table_type
  use talus_files, only: run_stem
  use dem_setup_cell, only: read_cell, check_regions
  use dem_setup, only: read_model, check_initial_overlap, check_step, read_step_curve
  use dem_setup_run, only: spare_inputs
  use dem_clock, only: event_history, event_output, event_checkpoint, event_measure, event_count, &
    event_opening
  use dem_restart, only: read_checkpoint
  use dem_start_springs, only: count_unreachable
  use dem_surcharge_renew, only: renew_surcharge
  use dem_setup_bodies, only: read_bodies
  use dem_setup_membranes, only: read_membranes
  use dem_setup_surface_cell, only: check_surfaces_in_cell
  use dem_view, only: wall_stiffness_of
  use dem_deck_keys, only: dem_deck_table
  use dem_run_state, only: dem_run_state_type, program_name
  use dem_setup_clumps, only: refuse_clumps
  use dem_setup_polyhedra, only: refuse_polyhedra
  use dem_setup_wear, only: read_wear
  use dem_setup_heat, only: read_heat, check_heat_step
  implicit none
  private
  public :: dem_started_run_type

  integer(i4), parameter :: grains_a_thread = 500  !! fewer are not worth another thread

  !> A run that can be read and prepared.
  type, extends(dem_run_state_type) :: dem_started_run_type
  contains
    procedure :: read => read_run
    procedure :: prepare
    procedure :: renew_grains
    procedure :: break_grains
    procedure :: begin_fresh
    procedure :: begin_again
  end type dem_started_run_type

contains

  !> Deck, packing and all that can be checked without forces.
  subroutine read_run(self, options, errors)
    class(dem_started_run_type), intent(inout) :: self
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(key_table_type) :: table

    allocate (self%system)
    self%options = options
    self%served = len(options%port) > 0
    self%restart_path = ''
    allocate (self%warnings(0))
    call self%timers%init()
    call dem_deck_table(table)
    call self%deck%read(options%deck, table, errors)
    if (errors%any()) return
    self%stem = run_stem(options%deck, options%output_dir)
    call self%deck%get('run', 1, 't_end', self%clock%t_end)
    if (.not. self%served .and. .not. self%deck%given('run', 1, 't_end')) &
      call self%deck%fault(errors, 'D246', 'the run has no end', 'run', 1, '', &
                           'add t_end = ... in s; only under talus-couple it may be left out')
    call spare_inputs(self%deck, self%stem, errors)
    call read_model(self%deck, self%system, self%packing, self%choices, errors)
    call read_features(self, errors)
    call self%system%use_ranks(self%ranks)
    call use_threads(self)
    if (errors%any() .or. self%served) return
    if (size(self%choices%idle) > 0) &
      call self%deck%fault(errors, 'D243', 'grain '//str(self%choices%idle(1))//' is marked as '// &
                           'driven in the packing, but no &driven group moves it', 'particles', 1, &
                           'file', 'add &driven ids = '//str(self%choices%idle(1))// &
                           ', velocity = ... /, or &fixed')
  end subroutine read_run

  !> What moves walls, surfaces and the cell, what ends the run, what is measured.
  subroutine read_features(self, errors)
    class(dem_started_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%measures%read(self%deck, errors)
    call self%equilibrium%read(self%deck, self%choices%adaptive, self%served, errors)
    call self%servo%read(self%deck, self%system%dem_data_type, self%choices%wall, self%served, &
                         errors)
    call read_step_curve(self%deck, self%servo%curve, self%choices, errors)
    if (errors%any()) return
    call read_cell(self%deck, self%packing, self%choices%wall, self%served, self%system, errors)
    call self%surcharge%read(self%deck, self%system%dem_data_type, self%servo%curve, errors)
    call check_regions(self%deck, self%system, self%measures, errors)
    call self%flow%read(self%deck, self%system%dem_data_type, self%servo%curve, errors)
    call read_bodies(self%deck, self%served, self%system%surfaces, errors)
    call check_surfaces_in_cell(self%deck, self%system%cell, self%system%surfaces, errors)
    call read_membranes(self%deck, self%choices%wall, self%served, self%system, errors)
    call self%drive%read(self%deck, self%system%dem_data_type, self%servo%curve, self%served, &
                         errors)
    call self%probe%read(self%deck, self%system%dem_data_type, errors)
    call self%openings%read(self%deck, self%choices%of_entering, self%served, self%system, &
                            errors)
    call self%bed%read(self%deck, self%served, errors)
    call self%breakage%read(self%deck, self%choices%of_breakage, &
                            merge(0.0_wp, self%choices%dt, self%choices%allow_unstable), &
                            self%served, self%system, errors)
    call self%grading%read(self%deck, self%system%dem_data_type, errors)
    call self%pore%read(self%deck, self%system%dem_data_type, self%servo%curve, self%served, &
                        int(self%ranks%ranks, i4), errors)
    call read_heat(self%deck, self%choices%wall, self%choices%material, self%packing%group, &
                   self%system%dem_data_type, errors)
    call refuse_heat(self, errors)
    call refuse_clumps(self%deck, self%system%dem_data_type, self%served, &
                       int(self%ranks%ranks, i4), self%choices%adaptive, errors)
    call refuse_polyhedra(self%deck, self%packing%clumps, self%system%dem_data_type, errors)
    call read_wear(self%deck, self%choices%wall, self%served, int(self%ranks%ranks, i4), &
                   self%system%dem_data_type, errors)
  end subroutine read_features

  !> Heat is followed on one rank, without a partner (D393).
  subroutine refuse_heat(self, errors)
    class(dem_started_run_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    if (.not. self%system%heat%active) return
    if (self%served) call self%deck%fault(errors, 'D393', 'heat is not followed under a partner', &
                                          'heat', 1, '', 'leave &heat out, or run talus-dem alone')
    if (self%ranks%several()) call self%deck%fault(errors, 'D393', 'heat is followed on one rank', &
                                                   'heat', 1, '', 'run with threads')
  end subroutine refuse_heat

  !> Threads as requested, or as many as the number of grains justifies.
  subroutine use_threads(self)
    class(dem_started_run_type), intent(in) :: self
    integer(i4) :: threads
    threads = self%options%threads
    if (threads == 0) call self%deck%get('run', 1, 'threads', threads)
    if (threads == 0) threads = min(max(1_i4, int(omp_get_max_threads(), i4)/self%ranks%on_host), &
                                    1 + self%system%grains%n/(grains_a_thread*self%ranks%ranks))
    call omp_set_num_threads(threads)
  end subroutine use_threads

  !> First forces and time step, or the state of a checkpoint.
  subroutine prepare(self, errors)
    class(dem_started_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: every(event_count), every_wall

    call prepare_files(self, every, errors)
    if (errors%any()) return
    call self%histories%init(self%system)
    self%system%apart = self%ranks%several() .and. .not. self%starts_whole()
    if (len(self%restart_path) > 0) then
      call self%begin_again(self%restart_path, every, errors)
    else
      call self%begin_fresh(every, errors)
    end if
    every_wall = 0.0_wp
    if (.not. self%served) call self%deck%get('checkpoint', 1, 'every_wall', every_wall)
    call self%checkpoint%schedule(every_wall, 0.0_wp, self%clock%time())
    if (errors%any()) return
    if (self%pore%active) call self%pore%check(self%deck, self%system%dem_data_type, &
                                               self%system%step_limit(), errors)
    if (self%servo%active()) call self%servo%start(self%system%dem_data_type, self%clock%time(), &
                                                   wall_stiffness_of(self%system))
    call renew_surcharge(self%surcharge, self%system, self%clock, .true., errors)
  end subroutine prepare

  !> Times of output, and the checkpoint to go on from.
  subroutine prepare_files(self, every, errors)
    class(dem_started_run_type), intent(inout) :: self
    real(wp), intent(out) :: every(event_count)
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: found(:)
    integer(i4) :: keep, k

    call self%deck%get('checkpoint', 1, 'keep', keep)
    call self%checkpoint%init(self%stem, program_name, self%deck%hash(), keep)
    call self%deck%get('history', 1, 'every_time', every(event_history))
    call self%deck%get('output', 1, 'every_time', every(event_output))
    call self%deck%get('checkpoint', 1, 'every_time', every(event_checkpoint))
    if (self%served) every(event_checkpoint) = 0.0_wp
    every(event_measure) = self%measures%every
    every(event_opening) = self%openings%every
    self%clock%automatic = .not. self%choices%dt > 0.0_wp
    if (len(self%options%restart) > 0 .and. .not. self%options%check) then
      call self%checkpoint%find(self%options%restart, self%restart_path, found, errors)
      if (errors%any()) return
      do k = 1, size(found)
        call append_string(self%warnings, found(k)%s)
      end do
      if (len(self%restart_path) == 0) call append_string(self%warnings, &
        'there is no checkpoint to go on from: a fresh run')
    end if
  end subroutine prepare_files

  !> Start at time zero from the packing.
  subroutine begin_fresh(self, every, errors)
    class(dem_started_run_type), intent(inout) :: self
    real(wp), intent(in) :: every(event_count)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: warning
    real(wp) :: dt
    integer(i4) :: lost

    self%system%par%dt = self%choices%dt
    call self%system%init(errors)
    if (errors%any()) return
    call check_initial_overlap(self%system, self%choices, self%deck%path('particles', 1, 'file'), &
                               errors)
    call check_step(self%deck, self%system, self%choices, warning, errors)
    if (errors%any()) return
    if (len(warning) > 0) call append_string(self%warnings, warning)
    lost = count_unreachable(self%system%springs, self%system%cell)
    if (lost > 0) call append_string(self%warnings, str(lost)//' contacts of the packing lie '// &
      'over faces of its cell that are not periodic in this run: their forces are left out')
    call self%clock%set_events(every)
    dt = self%choices%dt
    if (self%clock%automatic) dt = self%clock%chosen_step(self%automatic_dt())
    call self%clock%start_at(0.0_wp, dt)
    call self%use_step(dt)
    call check_heat_step(self%deck, self%system%dem_data_type, dt, errors)
    call self%system%glance()
    call self%flow%update(self%system%dem_data_type, 0.0_wp)
    call self%drive_surfaces()
    if (self%openings%n > 0) call self%renew_grains([0_i8, -1_i8], errors)
  end subroutine begin_fresh

  !> Grains leave and enter.
  subroutine renew_grains(self, turns, errors)
    class(dem_started_run_type), intent(inout) :: self
    integer(i8), intent(in) :: turns(2)  !! intervals until now, and at the last time; -1: none
    type(error_list_type), intent(inout) :: errors
    logical :: changed
    call self%openings%update(self%system, turns, changed, errors)
    if (errors%any() .or. .not. changed) return
    call follow_grains(self)
  end subroutine renew_grains

  !> Grains above their strength break.
  subroutine break_grains(self, errors)
    class(dem_started_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    logical :: changed
    call self%breakage%look(self%system, self%clock%steps, self%clock%time(), changed, errors)
    if (errors%any() .or. .not. changed) return
    if (self%surcharge%active) call renew_surcharge(self%surcharge, self%system, self%clock, &
                                                    .false., errors)
    call follow_grains(self)
  end subroutine break_grains

  !> Grains are others: driven ones have other numbers, and the step follows.
  subroutine follow_grains(self)
    class(dem_started_run_type), intent(inout) :: self
    call self%histories%find_driven(self%system)
    call self%clock%review(self%automatic_dt(), self%system%step_limit())
    if (abs(self%clock%dt - self%system%par%dt) > 0.0_wp) call self%use_step(self%clock%dt)
  end subroutine follow_grains

  !> Start from a checkpoint.
  subroutine begin_again(self, path, every, errors)
    class(dem_started_run_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: every(event_count)
    type(error_list_type), intent(inout) :: errors

    call read_checkpoint(self%checkpoint, path, self%system, self%clock, self%histories, &
                         self%new_deck, errors)
    if (errors%any()) return
    call self%histories%find_driven(self%system)
    self%restart_path = path
    self%start_time = self%clock%time()
    self%start_steps = self%clock%steps
    call self%clock%set_events(every)
    if (self%new_deck) call self%system%follow_laws()
    if (self%new_deck) call self%flow%update(self%system%dem_data_type, self%clock%time())
    if (self%new_deck .and. .not. self%servo%active()) &
      self%system%planes%velocity = self%servo%wall_velocity
    if (self%new_deck) call self%drive%follow(self%system%dem_data_type, self%clock%time())
    if (self%new_deck) call append_string(self%warnings, 'another deck wrote '//path// &
      ': grains, contacts, driven motion and places of walls are those of the checkpoint, all '// &
      'else is that of this deck; right if one run is meant to follow another')
    if (self%clock%automatic .or. abs(self%choices%dt - self%clock%dt) <= 0.0_wp) return
    call self%clock%start_at(self%clock%time(), self%choices%dt)
    call self%use_step(self%choices%dt)
  end subroutine begin_again
end module dem_run_start
