!> Ghosts on facets of the solid, or facets as a surface of the grains (theory: facet coupling).
module cpl_facet_method
  use talus_kinds, only: wp, i8
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_health, only: health_type
  use talus_log, only: log_type, short_number
  use talus_scalars, only: scalar_max_overlap
  use talus_summary, only: summary_type
  use cpl_audit, only: audit_type, audit_columns
  use cpl_audit_file, only: audit_file_type
  use cpl_choices, only: rotation_fixed, scheme_symmetric
  use cpl_exchange, only: exchange
  use cpl_facet_log, only: log_interface, log_row, log_health, put_summary
  use cpl_interface, only: interface_type
  use cpl_judgement, only: judge_coupling
  use cpl_logbook, only: log_row_titles
  use cpl_method, only: cpl_method_type
  use cpl_ghost_mass, only: carry_ghosts
  use cpl_pore_file, only: read_pore_state
  use cpl_pore_probe, only: find_conductance
  use cpl_pore_setup, only: make_pore
  use cpl_pore_log, only: log_pore, pore_columns, pore_row, pore_health, summarise_pore
  use cpl_run, only: cpl_run_type
  use cpl_setup, only: find_ghosts, find_vertices, find_radii, make_map, select_sets, &
    begin_interface, end_rehearsal
  use cpl_start, only: relax_together
  use cpl_state_file, only: write_state, read_state, read_reference
  implicit none
  private
  public :: facet_method_type

  integer(i8), parameter :: flush_every = 64  !! exchanges, of the liquid's history

  type, extends(cpl_method_type) :: facet_method_type
    type(interface_type) :: face
    type(audit_type) :: worst
    real(wp) :: identity = 0.0_wp  !! largest error of the operators
    type(audit_file_type) :: liquid
  contains
    procedure :: make
    procedure :: restore
    procedure :: begin
    procedure :: start
    procedure :: exchange => exchange_facets
    procedure :: after
    procedure :: save
    procedure :: titles
    procedure :: row
    procedure :: health
    procedure :: summary
    procedure :: judge
  end type facet_method_type

contains

  !> The operators: from the packing and the mesh, or from the stored reference state, whose hash
  !! must come out again (I404); sets.
  subroutine make(self, run, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    real(wp), allocatable :: x(:, :)
    character(len=:), allocatable :: map_hash
    real(wp) :: time

    self%face%dynamic = run%dynamic
    self%face%explicit = run%solvers(2)%analysis == 'explicit'
    self%face%kicks%active = run%choices%scheme == scheme_symmetric
    call self%face%pieces%begin(run%choices%pieces)
    associate (choices => run%choices, solvers => run%solvers)
      if (run%again) then
        call read_reference(run%checkpoint, run%state, ids, x, map_hash, time, errors)
      else if (len(choices%surface) > 0) then
        call find_vertices(solvers(2), choices%facets, ids, x, run%timers, errors)
      else
        call find_ghosts(solvers(1), choices%ghosts, ids, x, run%timers, errors)
      end if
      if (errors%any()) return
      call make_map(self%face, solvers(2), choices, ids, x, self%identity, run%timers, errors)
      if (choices%rotation /= rotation_fixed .and. .not. errors%any()) &
        call find_radii(self%face, solvers(1), run%timers, errors)
      if (errors%any()) return
      if (run%again) call compare_maps(self%face, map_hash, run%state, errors)
      if (.not. errors%any()) call select_sets(self%face, solvers, run%timers, errors)
      if (.not. errors%any()) call make_pore(self%face%pore, run, errors)
      self%face%springs%liquid = self%face%pore%stiffness
      if (choices%pore%given .and. .not. errors%any()) &
        call carry_ghosts(self%face, choices%pore%ghost_mass, run, errors)
    end associate
  end subroutine make

  !> I404: the map is another one than that of the checkpoint.
  subroutine compare_maps(face, map_hash, path, errors)
    type(interface_type), intent(in) :: face
    character(len=*), intent(in) :: map_hash, path
    type(error_list_type), intent(inout) :: errors
    character(len=16) :: own
    own = face%transfer%hash(face%map)
    if (own /= map_hash) &
      call errors%add('I404', 'the facet map is not the one of the checkpoint ('// &
                      own//', not '//map_hash//')', path, &
                      'go on with the mesh and the deck that wrote it')
  end subroutine compare_maps

  subroutine restore(self, run, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call read_state(run%checkpoint, run%state, self%face, errors)
    call read_pore_state(run%checkpoint, run%state, self%face%pore, errors)
    self%step = self%face%step
  end subroutine restore

  subroutine begin(self, run, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call begin_interface(self%face, run%solvers, run%choices, run%again, run%timers, errors)
  end subroutine begin

  !> Balance of both sides where the deck asks for it, census, audit.
  subroutine start(self, run, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    if (run%choices%relaxed .and. .not. run%again) then
      call relax_together(self%face, run%solvers, run%choices, run%log, run%stop, run%timers, &
                          errors)
      if (.not. errors%any()) call end_rehearsal(self%face, run%solvers, run%timers, errors)
    end if
    if (.not. (run%again .or. errors%any())) call find_conductance(self%face, run, errors)
    if (errors%any()) return
    call log_interface(run%log, self%face, run%choices, self%identity)
    call audit_columns(columns)
    call self%audit%begin(run%stem//'_audit.csv', columns, run%again, run%begins, errors)
    if (.not. self%face%pore%active) return
    call log_pore(run%log, self%face%pore)
    call pore_columns(columns)
    call self%liquid%begin(run%stem//'_pore.csv', columns, run%again, run%begins, errors)
  end subroutine start

  subroutine exchange_facets(self, run, t0, t1, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t0, t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    call exchange(self%face, run%solvers, run%choices, t0, t1, run%timers, errors)
    self%step = self%face%step
  end subroutine exchange_facets

  !> A row of the audit; one warning when the exchange does not settle.
  subroutine after(self, run, t1, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    real(wp) :: gap
    call run%timers%start('audit and log')
    call self%worst%note(self%face, gap)
    call self%audit%put(self%worst%row(self%face, t1, gap))
    call self%audit%write(errors)
    if (self%face%pore%active) then
      call self%liquid%put(pore_row(self%face%pore, t1))
      call self%liquid%write(errors)
      if (modulo(self%step, flush_every) == 0) call self%liquid%flush(errors)
      if (last_row(run, t1)) call self%liquid%close(errors)
    end if
    if (self%worst%lag%stalls > 0 .and. .not. self%worst%lag%warned) then
      text = self%worst%lag%warning(run%choices%interface, run%choices%scheme, &
        run%choices%exchange)
      call run%log%warn('time '//short_number(t1)//' s: '//text)
    end if
    text = self%face%kicks%warning(run%choices%exchange)
    if (len(text) > 0) call run%log%warn(text)
    call run%timers%stop('audit and log')
  end subroutine after

  !> Does the run end at t1?
  pure logical function last_row(run, t1)
    type(cpl_run_type), intent(in) :: run
    real(wp), intent(in) :: t1  !! [s]
    last_row = t1 > run%choices%t_end - 0.5_wp*run%choices%exchange
  end function last_row

  subroutine save(self, run, time, tag, errors)
    class(facet_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: time
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors
    call write_state(run%checkpoint, self%face, time, tag, errors)
    if (self%face%pore%active) call self%liquid%flush(errors)
  end subroutine save

  subroutine titles(self, log)
    class(facet_method_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    call log_row_titles(log, 'ghost force [N]')
  end subroutine titles

  subroutine row(self, log, time, overhead, left)
    class(facet_method_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    real(wp), intent(in) :: time, overhead, left
    call log_row(log, self%face, self%worst, time, overhead, left)
  end subroutine row

  subroutine health(self, run, overhead)
    class(facet_method_type), intent(in) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: overhead(2)
    call log_health(run%log, self%face, self%worst, run%choices%exchange, overhead)
    if (self%face%pore%active) call pore_health(run%log, self%face%pore)
  end subroutine health

  subroutine summary(self, page)
    class(facet_method_type), intent(in) :: self
    type(summary_type), intent(inout) :: page
    call put_summary(page, self%face, self%worst)
    if (self%face%pore%active) call summarise_pore(page, self%face%pore)
  end subroutine summary

  subroutine judge(self, deck, health)
    class(facet_method_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(health_type), intent(inout) :: health
    call judge_coupling(deck, self%worst%work_error(self%face), self%face%step >= 10, &
                        self%face%ledger%grains(scalar_max_overlap), health)
  end subroutine judge
end module cpl_facet_method
