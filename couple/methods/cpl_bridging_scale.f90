!> Overlap of the bridging scale with a solid that has inertia (theory: overlap coupling, Time).
module cpl_bridging_scale
  use talus_kinds, only: wp, i8
  use talus_errors, only: error_list_type
  use cpl_overlap_limit, only: kick_watch_type
  use cpl_overlap_method, only: overlap_method_type
  use cpl_overlap_setup, only: begin_overlap
  use cpl_overlap_step, only: overlap_step
  use cpl_run, only: cpl_run_type
  implicit none
  private
  public :: bridging_scale_type

  type, extends(overlap_method_type) :: bridging_scale_type
    type(kick_watch_type) :: kick_watch
  contains
    procedure :: begin
    procedure :: exchange
    procedure :: after => follow_exchange
    procedure :: follow_exchange  !! for methods that do more after an exchange
  end type bridging_scale_type

contains

  subroutine begin(self, run, errors)
    class(bridging_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call begin_overlap(self%o, run%solvers, run%choices, run%again, run%timers, errors)
    if (.not. (run%again .or. errors%any())) &
      call self%kick_watch%begin(self%o, run%solvers, run%timers, errors)
  end subroutine begin

  subroutine exchange(self, run, t0, t1, errors)
    class(bridging_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t0, t1
    type(error_list_type), intent(inout) :: errors
    call overlap_step(self%o, run, t0, t1, self%audit, errors)
  end subroutine exchange

  !> The row of the audit, and new maps where grains have moved past the nodes: they may have
  !! another limit of their kicks.
  subroutine follow_exchange(self, run, t1, errors)
    class(bridging_scale_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: said
    integer(i8) :: remaps
    call self%put_row(run, t1, errors)
    remaps = self%o%map%remaps
    call self%check_map(run, t1, errors)
    if (errors%any() .or. self%o%map%remaps == remaps) return
    call self%kick_watch%renew(self%o, run%choices%exchange, run%timers, said)
    if (len(said) > 0) call run%log%line(said)
  end subroutine follow_exchange
end module cpl_bridging_scale
