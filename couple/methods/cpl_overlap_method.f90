!> What all methods with an overlap share (theory: overlap coupling): maps and sets, the state in a
!! checkpoint, the audit, log and summary. Each fills in how the overlap begins and what an exchange
!! does, and may add columns to the audit and datasets to the checkpoint.
module cpl_overlap_method
  use talus_kinds, only: wp
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_checkpoint, only: checkpoint_info_type
  use talus_hdf5, only: h5_file_type
  use talus_deck, only: deck_type
  use talus_health, only: health_type
  use talus_log, only: log_type
  use talus_scalars, only: scalar_max_overlap
  use talus_summary, only: summary_type
  use cpl_choices, only: cpl_choices_type
  use cpl_judgement, only: judge_coupling
  use cpl_logbook, only: log_row_titles, overhead_text
  use cpl_method, only: cpl_method_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_file, only: put_overlap, get_overlap, read_overlap_reference
  use cpl_overlap_log, only: log_census, log_masses, log_exchanges, overlap_columns, &
    overlap_values, overlap_row, overlap_health, overlap_summary, work_error
  use cpl_overlap_remap, only: rebuild_map, check_after
  use cpl_overlap_setup, only: make_overlap, give_masses
  use cpl_run, only: cpl_run_type
  use cpl_sets_file, only: write_sets
  use cpl_solver, only: side_grains
  implicit none
  private
  public :: overlap_method_type

  type, abstract, extends(cpl_method_type) :: overlap_method_type
    class(overlap_type), allocatable :: o  !! class for the sake of compilation, which else writes
                                           !! out copies of types within types
  contains
    procedure :: make => make_whole
    procedure :: restore
    procedure :: start => start_audit
    procedure :: after => put_row
    procedure :: save
    procedure :: titles
    procedure :: row
    procedure :: health => log_health
    procedure :: summary => put_summary
    procedure :: judge
    procedure :: start_audit   !! for methods that do more at the start
    procedure :: put_row       !! for methods that do more after an exchange
    procedure :: log_health
    procedure :: put_summary
    procedure :: check_map
    procedure :: share => share_masses
    procedure :: log_own => log_own_masses
    procedure :: own_columns => no_columns
    procedure :: own_values => no_values
    procedure :: own_health => no_text
    procedure :: put_own => put_nothing
    procedure :: get_own => get_nothing
    procedure :: fine_scale => unseen_motion
  end type overlap_method_type

contains

  !> Sets and operators, from the reference state after a restart.
  subroutine make_whole(self, run, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: reference(:, :)
    if (run%again) call read_overlap_reference(run%checkpoint, run%state, reference, errors)
    if (errors%any()) return
    call make_overlap(self%o, run%solvers, run%choices, run%dynamic, reference, run%timers, errors)
    if (.not. errors%any()) call self%share(run, errors)
  end subroutine make_whole

  !> Who owns which mass.
  subroutine share_masses(self, run, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call give_masses(self%o, run%choices, run%solvers(side_grains), errors)
  end subroutine share_masses

  subroutine restore(self, run, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    call run%checkpoint%open(run%state, file, info, errors)
    if (errors%any()) return
    call get_overlap(file, run%state, self%o, errors)
    if (.not. errors%any()) call self%get_own(file, errors)
    call file%close(errors)
    if (self%o%map%remaps > 0 .and. .not. errors%any()) call rebuild_map(self%o, errors)
    self%step = self%o%step
  end subroutine restore

  !> Census, sets for plots, audit.
  subroutine start_audit(self, run, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    call log_census(run%log, self%o, run%choices, run%choices%overlap%bound)
    call self%log_own(run%log, run%choices)
    call log_exchanges(run%log, self%o, run%choices)
    if (.not. run%again) call write_sets(run%stem//'_sets.h5', self%o, errors)
    call overlap_columns(columns)
    call self%own_columns(columns)
    call self%audit%begin(run%stem//'_audit.csv', columns, run%again, run%begins, errors)
  end subroutine start_audit

  !> Write the row before, take that of this exchange.
  subroutine put_row(self, run, t1, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    self%step = self%o%step
    call run%timers%start('audit and log')
    call self%audit%write(errors)
    call self%audit%put([overlap_values(self%o, t1), self%own_values()])
    call run%timers%stop('audit and log')
  end subroutine put_row

  !> Have free grains moved past the nodes? Then the maps are rebuilt.
  subroutine check_map(self, run, t1, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: said
    if (run%choices%overlap%free_rim) return  ! no node follows them
    call run%timers%start('audit and log')
    associate (wanted => run%choices%overlap)
      call check_after(self%o, wanted%remap, wanted%leaving, t1, said, errors)
    end associate
    if (len(said) > 0) call run%log%line(said)
    call run%timers%stop('audit and log')
  end subroutine check_map

  subroutine save(self, run, time, tag, errors)
    class(overlap_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: time
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    call run%checkpoint%begin(file, time, self%o%step, errors, tag)
    call put_overlap(file, self%o, errors)
    call self%put_own(file, errors)
    call run%checkpoint%finish(file, errors)
  end subroutine save

  subroutine titles(self, log)
    class(overlap_method_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    call log_row_titles(log, 'fine scale [m]')
  end subroutine titles

  subroutine row(self, log, time, overhead, left)
    class(overlap_method_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    real(wp), intent(in) :: time, overhead, left
    call overlap_row(log, self%o, self%fine_scale(), time, overhead, left)
  end subroutine row

  !> The health line: whether the run can be trusted.
  subroutine log_health(self, run, overhead)
    class(overlap_method_type), intent(in) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: overhead(2)
    call run%log%health(self%own_health()//overlap_health(self%o, self%fine_scale())// &
                        overhead_text(overhead))
  end subroutine log_health

  subroutine put_summary(self, page)
    class(overlap_method_type), intent(in) :: self
    type(summary_type), intent(inout) :: page
    call overlap_summary(page, self%o, self%fine_scale())
  end subroutine put_summary

  subroutine judge(self, deck, health)
    class(overlap_method_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(health_type), intent(inout) :: health
    call judge_coupling(deck, work_error(self%o), .true., &
                        self%o%ledger%grains(scalar_max_overlap), health)
  end subroutine judge

  !> The method's part of the census.
  subroutine log_own_masses(self, log, choices)
    class(overlap_method_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    type(cpl_choices_type), intent(in) :: choices
    call log_masses(log, self%o, choices)
  end subroutine log_own_masses

  !> Columns behind those that every overlap has.
  subroutine no_columns(self, columns)
    class(overlap_method_type), intent(in) :: self
    type(string_type), allocatable, intent(inout) :: columns(:)
  end subroutine no_columns

  !> Their values after an exchange.
  function no_values(self) result(values)
    class(overlap_method_type), intent(in) :: self
    real(wp), allocatable :: values(:)
    allocate (values(0))
  end function no_values

  !> What comes first in the health line.
  function no_text(self) result(text)
    class(overlap_method_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
  end function no_text

  !> Datasets beside those of every overlap.
  subroutine put_nothing(self, file, errors)
    class(overlap_method_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
  end subroutine put_nothing

  subroutine get_nothing(self, file, errors)
    class(overlap_method_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
  end subroutine get_nothing

  !> What the nodes do not see of the motion of the free grains, root mean square [m].
  function unseen_motion(self) result(fine)
    class(overlap_method_type), intent(in) :: self
    real(wp) :: fine
    fine = self%o%fine_scale()
  end function unseen_motion
end module cpl_overlap_method
