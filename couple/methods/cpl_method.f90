!> A coupling method: the way in which states and forces of one side become motions and forces of
!! the other. The model calls a method in this order and knows none by name:
!!
!!   check                        what can be checked from the deck alone
!!   make, restore, begin, start  maps and sets; the checkpoint's state; READY; with an open log
!!   exchange, after              every exchange; its row of the audit, what may change after it
!!   save                         the coupling's own state into a checkpoint
!!   titles, row, health, summary what is reported to the user
!!   judge                        figures of its health
module cpl_method
  use talus_kinds, only: wp, i8
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_health, only: health_type
  use talus_log, only: log_type
  use talus_summary, only: summary_type
  use cpl_audit_file, only: audit_file_type
  use cpl_run, only: cpl_run_type
  implicit none
  private
  public :: cpl_method_type

  type, abstract :: cpl_method_type
    integer(i8) :: step = 0         !! accepted exchanges
    type(audit_file_type) :: audit
  contains
    procedure :: check => nothing_to_check
    procedure(phase), deferred :: make     !! maps and sets from what the solvers describe
    procedure(phase), deferred :: restore  !! state of the checkpoint, after make
    procedure(phase), deferred :: begin    !! to READY of both solvers
    procedure(phase), deferred :: start    !! census and audit, when the log is a file
    procedure(exchange_phase), deferred :: exchange  !! from t0 to t1, accepted on both sides
    procedure(after_phase), deferred :: after
    procedure(save_phase), deferred :: save
    procedure(titles_part), deferred :: titles
    procedure(row_part), deferred :: row
    procedure(health_part), deferred :: health
    procedure(summary_part), deferred :: summary
    procedure(judge_part), deferred :: judge
  end type cpl_method_type

  abstract interface
    subroutine phase(self, run, errors)
      import
      class(cpl_method_type), intent(inout) :: self
      type(cpl_run_type), intent(inout) :: run
      type(error_list_type), intent(inout) :: errors
    end subroutine phase

    subroutine exchange_phase(self, run, t0, t1, errors)
      import
      class(cpl_method_type), intent(inout) :: self
      type(cpl_run_type), intent(inout) :: run
      real(wp), intent(in) :: t0, t1  !! [s]
      type(error_list_type), intent(inout) :: errors
    end subroutine exchange_phase

    subroutine after_phase(self, run, t1, errors)
      import
      class(cpl_method_type), intent(inout) :: self
      type(cpl_run_type), intent(inout) :: run
      real(wp), intent(in) :: t1  !! [s]
      type(error_list_type), intent(inout) :: errors
    end subroutine after_phase

    subroutine save_phase(self, run, time, tag, errors)
      import
      class(cpl_method_type), intent(inout) :: self
      type(cpl_run_type), intent(inout) :: run
      real(wp), intent(in) :: time        !! [s]
      character(len=*), intent(in) :: tag !! of the checkpoint
      type(error_list_type), intent(inout) :: errors
    end subroutine save_phase

    subroutine titles_part(self, log)
      import
      class(cpl_method_type), intent(in) :: self
      type(log_type), intent(inout) :: log
    end subroutine titles_part

    subroutine row_part(self, log, time, overhead, left)
      import
      class(cpl_method_type), intent(in) :: self
      type(log_type), intent(inout) :: log
      real(wp), intent(in) :: time      !! [s]
      real(wp), intent(in) :: overhead  !! share of the run time
      real(wp), intent(in) :: left      !! wall time [s], < 0 not known
    end subroutine row_part

    subroutine health_part(self, run, overhead)
      import
      class(cpl_method_type), intent(in) :: self
      type(cpl_run_type), intent(inout) :: run
      real(wp), intent(in) :: overhead(2)  !! shares that the grains waited for, and worked
    end subroutine health_part

    subroutine summary_part(self, page)
      import
      class(cpl_method_type), intent(in) :: self
      type(summary_type), intent(inout) :: page
    end subroutine summary_part

    subroutine judge_part(self, deck, health)
      import
      class(cpl_method_type), intent(in) :: self
      type(deck_type), intent(in) :: deck
      type(health_type), intent(inout) :: health
    end subroutine judge_part
  end interface

contains

  !> Most methods' choices are checked where they are read.
  subroutine nothing_to_check(self, run, errors)
    class(cpl_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
  end subroutine nothing_to_check
end module cpl_method
