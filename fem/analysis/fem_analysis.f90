!> The interface of an analysis to talus-fem: it reads its part of the deck, prepares the body,
!! advances it, and defines entries of checkpoints, tables, log and summary. A kind of &analysis
!! is an extension in a file of its own and a line in fem_analyses; what a kind does not override
!! suits a linear static one. Called once a step: nothing here is inside a loop over elements.
module fem_analysis
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: string_type
  use talus_deck, only: deck_type
  use talus_hdf5, only: h5_file_type
  use talus_log, only: log_type
  use talus_summary, only: summary_type
  use fem_body, only: fem_body_type
  use fem_parts, only: fem_scheme_type
  use fem_supports, only: check_supports
  implicit none
  private
  public :: fem_analysis_type, demand_times, own_steps

  real(wp), parameter :: near = 1.0e-9_wp  !! of a step that counts as the end

  type, abstract :: fem_analysis_type
    character(len=:), allocatable :: kind  !! of &analysis
    character(len=:), allocatable :: follows  !! kind of the checkpoint that it begins from, where
                                              !! it is another
    character(len=:), allocatable :: table !! <deck>_<table>.csv has the rows of the analysis; ''
    real(wp) :: t_end = 0.0_wp, dt = 0.0_wp  !! end and step of a run of its own, 0: open [s]
    logical :: variable = .false.          !! steps have any length, see `next_time`
    logical :: listed = .false.            !! steps are items of a list (modes), not times
    logical :: iterative = .false.         !! iterations may solve the equations
    logical :: solves = .true.             !! answers SOLVE at the port
  contains
    procedure(read_kind), deferred :: read   !! numbers of the deck, before the sections are read
    procedure(take_step), deferred :: step   !! to time t1; the state found is a trial
    procedure :: check                       !! of the whole deck, once the body is read
    procedure :: check_port
    procedure :: read_times
    procedure :: before_matrices
    procedure :: after_matrices
    procedure :: begin
    procedure :: check_held
    procedure :: complete
    procedure :: next_time
    procedure :: steps_between
    procedure :: accept
    procedure :: reject
    procedure :: put
    procedure :: get
    procedure :: columns
    procedure :: row
    procedure :: describe
    procedure :: report
    procedure :: summarise
  end type fem_analysis_type

  abstract interface
    subroutine read_kind(self, deck, scheme, errors)
      import :: fem_analysis_type, deck_type, fem_scheme_type, error_list_type
      class(fem_analysis_type), intent(inout) :: self
      type(deck_type), intent(in) :: deck
      type(fem_scheme_type), intent(inout) :: scheme
      type(error_list_type), intent(inout) :: errors
    end subroutine read_kind

    subroutine take_step(self, body, t1, errors)
      import :: fem_analysis_type, fem_body_type, error_list_type, wp
      class(fem_analysis_type), intent(inout) :: self
      type(fem_body_type), intent(inout) :: body
      real(wp), intent(in) :: t1  !! [s]
      type(error_list_type), intent(inout) :: errors
    end subroutine take_step
  end interface

contains

  !> Faults of what the kind cannot be combined with, and keys that need the body.
  subroutine check(self, deck, body, errors)
    class(fem_analysis_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
  end subroutine check

  !> Fault of a kind that a coupled run does not support; none here.
  subroutine check_port(self, deck, errors)
    class(fem_analysis_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
  end subroutine check_port

  !> End and step; one step to 1 s where the deck gives none. A coupled run has those of the
  !! partner.
  subroutine read_times(self, deck, served, errors)
    class(fem_analysis_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    call deck%get('run', 1, 't_end', self%t_end)
    call deck%get('analysis', 1, 'dt', self%dt)
    if (served) return
    if (.not. self%t_end > 0.0_wp) self%t_end = 1.0_wp
    if (.not. self%dt > 0.0_wp) self%dt = self%t_end
  end subroutine read_times

  !> Fault D308 for a run in time without an end, or (`needed`) without a step.
  subroutine demand_times(deck, t_end, dt, needed, errors)
    type(deck_type), intent(in) :: deck
    real(wp), intent(in) :: t_end, dt  !! [s]
    logical, intent(in) :: needed
    type(error_list_type), intent(inout) :: errors
    if (.not. t_end > 0.0_wp) call deck%fault(errors, 'D308', 'the run has no end', 'run', 1, '', &
      'add t_end = ... in s; only under talus-couple it may be left out')
    if (needed .and. .not. dt > 0.0_wp) call deck%fault(errors, 'D308', &
      'the analysis has no step', 'analysis', 1, 'kind', 'add dt = ... in s')
  end subroutine demand_times

  !> What changes the body before its matrices are assembled.
  subroutine before_matrices(self, deck, body, warnings)
    class(fem_analysis_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(string_type), allocatable, intent(inout) :: warnings(:)
  end subroutine before_matrices

  !> What follows from the matrices: the largest stable step, for one.
  subroutine after_matrices(self, deck, body, warnings, errors)
    class(fem_analysis_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(string_type), allocatable, intent(inout) :: warnings(:)
    type(error_list_type), intent(inout) :: errors
  end subroutine after_matrices

  !> The start of a run, `fresh` or from a checkpoint: factors for steps of dt.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s], 0: not yet determined
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    call body%factor(dt, errors)
  end subroutine begin

  !> The body cannot move as a rigid one (I307); kinds with inertia do not check.
  subroutine check_held(self, body, errors)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    call check_supports(body%mesh, body%dofs, body%system%pattern, &
                        body%supports%held .or. body%port%prescribed, body%supports%ground, errors)
  end subroutine check_held

  !> Has the accepted state reached the end?
  logical function complete(self, body)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    complete = body%accepted%time >= self%t_end - near*self%dt
  end function complete

  !> Time of the next step of a kind whose steps vary; it may come out shorter [s].
  pure real(wp) function next_time(self, body)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    next_time = body%accepted%time + self%dt
  end function next_time

  !> Number of steps in a time interval at the port, one if the deck gives no step.
  integer(i4) function steps_between(self, body, t0, t1)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: t0, t1  !! [s]
    steps_between = own_steps(self%dt, t0, t1)
  end function steps_between

  !> Steps of about dt between two times, one if dt is not given.
  pure integer(i4) function own_steps(dt, t0, t1)
    real(wp), intent(in) :: dt, t0, t1  !! [s]
    own_steps = 1
    if (dt > 0.0_wp) own_steps = max(1, nint((t1 - t0)/dt))
  end function own_steps

  !> The trial is the state.
  subroutine accept(self, body)
    class(fem_analysis_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    call body%accept()
  end subroutine accept

  !> Back to the last accepted state.
  subroutine reject(self, body)
    class(fem_analysis_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    call body%reject()
  end subroutine reject

  !> What the analysis itself has in a checkpoint, beside the state of the body.
  subroutine put(self, body, file, errors)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
  end subroutine put

  !> Restore these, before the state of the body is read.
  subroutine get(self, body, file, errors)
    class(fem_analysis_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
  end subroutine get

  !> Columns of the table, of a kind that has one.
  subroutine columns(self, body, names)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable, intent(out) :: names(:)
    allocate (names(0))
  end subroutine columns

  !> Its row for the accepted state.
  subroutine row(self, body, values)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable, intent(out) :: values(:)
    allocate (values(0))
  end subroutine row

  !> Lines of the log about the model, before the run.
  subroutine describe(self, body, log)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
  end subroutine describe

  !> Lines of the log after a step.
  subroutine report(self, body, log)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
  end subroutine report

  !> Values of the summary.
  subroutine summarise(self, body, summary)
    class(fem_analysis_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(summary_type), intent(inout) :: summary
  end subroutine summarise
end module fem_analysis
