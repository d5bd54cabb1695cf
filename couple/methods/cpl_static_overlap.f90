!> Overlap of the bridging scale with a static solid (theory: overlap coupling, Static).
module cpl_static_overlap
  use talus_kinds, only: wp
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_summary, only: summary_type
  use cpl_overlap_method, only: overlap_method_type
  use cpl_overlap_setup, only: begin_overlap
  use cpl_overlap_static, only: static_step
  use cpl_run, only: cpl_run_type
  implicit none
  private
  public :: static_overlap_type

  type, extends(overlap_method_type) :: static_overlap_type
  contains
    procedure :: begin
    procedure :: exchange
    procedure :: after
    procedure :: own_columns
    procedure :: own_values
    procedure :: own_health
    procedure :: health
    procedure :: summary
  end type static_overlap_type

contains

  subroutine begin(self, run, errors)
    class(static_overlap_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call begin_overlap(self%o, run%solvers, run%choices, run%again, run%timers, errors)
  end subroutine begin

  subroutine exchange(self, run, t0, t1, errors)
    class(static_overlap_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t0, t1
    type(error_list_type), intent(inout) :: errors
    call static_step(self%o, run%solvers, run%choices%exchange, t0, t1, run%timers, errors)
  end subroutine exchange

  subroutine after(self, run, t1, errors)
    class(static_overlap_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t1
    type(error_list_type), intent(inout) :: errors
    call self%put_row(run, t1, errors)
    call self%check_map(run, t1, errors)
  end subroutine after

  subroutine own_columns(self, columns)
    class(static_overlap_type), intent(in) :: self
    type(string_type), allocatable, intent(inout) :: columns(:)
    call append_string(columns, 'unbalanced [-]')
  end subroutine own_columns

  function own_values(self) result(values)
    class(static_overlap_type), intent(in) :: self
    real(wp), allocatable :: values(:)
    values = [self%o%ledger%unbalanced]
  end function own_values

  !> The rest of a static run.
  function own_health(self) result(text)
    class(static_overlap_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = 'unbalanced '//short_number(self%o%ledger%unbalanced)//' of a contact force, '
  end function own_health

  subroutine health(self, run, overhead)
    class(static_overlap_type), intent(in) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: overhead(2)
    associate (settled => run%choices%overlap%settled)
      if (self%o%ledger%unbalanced > settled) call run%log%warn( &
        'the run has not settled: a force of '//short_number(self%o%ledger%unbalanced)// &
        ' of the mean contact force is not balanced (settled = '//short_number(settled)// &
        '): let it run longer, or check the damping of the grains')
    end associate
    call self%log_health(run, overhead)
  end subroutine health

  subroutine summary(self, page)
    class(static_overlap_type), intent(in) :: self
    type(summary_type), intent(inout) :: page
    call self%put_summary(page)
    call page%set('health.unbalanced', self%o%ledger%unbalanced)
  end subroutine summary
end module cpl_static_overlap
