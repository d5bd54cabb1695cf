!> A run on many ranks: the leader holds the whole system, reads, writes and decides; every rank,
!! the leader too, holds and moves the grains of its domain.
!!
!! The others wait for orders: take over their parts, take steps, hand in what they have, leave. The
!! whole system is brought up to date when it is looked at, not before.
module dem_crew
  use omp_lib, only: omp_set_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_ranks, only: ranks_type
  use talus_system, only: install_signals
  use talus_text, only: str
  use dem_state, only: dem_data_type
  use dem_gather, only: hand_in, take_in
  use dem_handout, only: hand_out, tell_step
  use dem_measure, only: judge_runaway
  use dem_migrate, only: share_out
  use dem_pairs, only: build_pairs
  use dem_part, only: move_part, report_of, add_reports, rank_marks_type
  use dem_steps, only: step_memory_type
  implicit none
  private
  public :: dem_crew_type, serve_leader

  integer(i4), parameter :: order_start = 1, order_step = 2, order_look = 3, order_leave = 4

  type :: dem_crew_type
    type(ranks_type) :: team
    type(dem_data_type) :: part                !! grains of this rank's domain
    type(step_memory_type) :: memory
    type(rank_marks_type) :: marks             !! what the last steps told
    logical :: started = .false.               !! all ranks have their parts
    logical :: stale = .false.                 !! the whole is older than the parts
  contains
    procedure :: step
    procedure :: look
    procedure :: leave
    procedure :: text => crew_text
    procedure, private :: start
  end type dem_crew_type

contains

  !> n steps of the whole; its ledger, planes, health and limits are up to date afterwards, its
  !! grains and contacts only after a look.
  subroutine step(self, whole, n, errors)
    class(dem_crew_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4), intent(in) :: n
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: order(2)
    real(wp), allocatable :: reports(:, :)

    if (.not. self%started) call self%start(whole)
    order = [order_step, n]
    call self%team%await(order)
    call tell_step(self%team, whole, self%part)
    call move_part(self%part, self%memory, n, errors)
    call self%team%collect(report_of(self%part), reports)
    call add_reports(self%part, reports, whole, self%marks)
    self%stale = .true.
    call self%team%agree(errors)
    if (errors%any()) return
    call judge_runaway(whole, self%marks%kinetic, nint(self%marks%fastest(1), i8), &
                       self%marks%fastest(2), errors)
  end subroutine step

  !> Give every rank its part.
  subroutine start(self, whole)
    class(dem_crew_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: whole
    integer(i4) :: order(2)
    order = [order_start, int(omp_get_max_threads(), i4)]
    call self%team%await(order)
    self%part = whole
    self%part%halo%team = self%team
    call begin_part(self)
    self%started = .true.
  end subroutine start

  !> This rank's part from what the leader has.
  subroutine begin_part(self)
    type(dem_crew_type), intent(inout) :: self
    call hand_out(self%team, self%part)
    call share_out(self%part)
    associate (d => self%part)
      call build_pairs(d%pairs, d%grains, d%planes, d%weights, d%par%ghost_pairs, d%cell)
    end associate
  end subroutine begin_part

  !> Bring the whole up to date.
  subroutine look(self, whole)
    class(dem_crew_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4) :: order(2)
    real(wp), allocatable :: grains(:, :), contacts(:, :), prescribed(:, :)
    if (.not. self%stale) return
    order = [order_look, 0_i4]
    call self%team%await(order)
    call hand_in(self%team, self%part, grains, contacts, prescribed)
    call take_in(self%part, grains, contacts, prescribed, whole)
    self%stale = .false.
  end subroutine look

  !> The others leave with this exit code.
  subroutine leave(self, exit_code)
    class(dem_crew_type), intent(inout) :: self
    integer(i4), intent(in) :: exit_code
    integer(i4) :: order(2)
    if (.not. self%team%several()) return
    order = [order_leave, exit_code]
    call self%team%await(order)
  end subroutine leave

  !> Do what the leader orders until it sends this rank home. Signals are the leader's.
  subroutine serve_leader(team, exit_code)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(out) :: exit_code
    type(dem_crew_type), allocatable :: crew
    type(error_list_type) :: errors
    real(wp), allocatable :: grains(:, :), contacts(:, :), prescribed(:, :)
    integer(i4) :: order(2)

    call install_signals(.false.)
    allocate (crew)
    crew%team = team
    crew%part%halo%team = team
    do
      call team%await(order)
      select case (order(1))
      case (order_start)
        call omp_set_num_threads(order(2))
        call begin_part(crew)
      case (order_step)
        call tell_step(team, crew%part, crew%part)
        call move_part(crew%part, crew%memory, order(2), errors)
        call team%collect(report_of(crew%part), grains)
        call team%agree(errors)
      case (order_look)
        call hand_in(team, crew%part, grains, contacts, prescribed)
      case default
        exit_code = order(2)
        return
      end select
    end do
  end subroutine serve_leader

  !> How the ranks shared the work, for the log.
  function crew_text(self, steps_time) result(text)
    class(dem_crew_type), intent(in) :: self
    real(wp), intent(in) :: steps_time  !! in steps so far [s]
    character(len=:), allocatable :: text
    associate (m => self%marks)
      text = str(self%team%ranks)//', exchange '// &
        short_number(100.0_wp*m%exchange(2)/max(steps_time, tiny(1.0_wp)))//' % of the steps ('// &
        short_number(100.0_wp*m%exchange(1)/max(steps_time, tiny(1.0_wp)))//' to '// &
        short_number(100.0_wp*m%exchange(3)/max(steps_time, tiny(1.0_wp)))//' %), '// &
        short_number(m%own(1))//' to '//short_number(m%own(2))//' grains, '// &
        short_number(m%mirrors(1))//' to '//short_number(m%mirrors(2))//' mirrors, imbalance '// &
        short_number(m%imbalance)
    end associate
  end function crew_text
end module dem_crew
