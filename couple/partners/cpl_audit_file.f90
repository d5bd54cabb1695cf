!> The audit of a coupled run, <stem>_audit.csv: a row for each exchange, taken when the exchange
!! ends and written when the solvers have work again.
module cpl_audit_file
  use talus_kinds, only: wp
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_history, only: history_type
  implicit none
  private
  public :: audit_file_type

  type :: audit_file_type
    type(history_type), private :: file
    real(wp), allocatable, private :: value(:)  !! not yet written
  contains
    procedure :: begin
    procedure :: put
    procedure :: write => write_pending
    procedure :: flush => flush_file
    procedure :: close => close_file
  end type audit_file_type

contains

  !> Begin the file, or after a restart at time [s] continue it.
  subroutine begin(self, path, columns, again, time, errors)
    class(audit_file_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(string_type), intent(in) :: columns(:)
    logical, intent(in) :: again
    real(wp), intent(in) :: time
    type(error_list_type), intent(inout) :: errors
    call self%file%begin(path, columns, merge(time, -1.0_wp, again), errors)
  end subroutine begin

  !> Take a row; the one before must have been written.
  subroutine put(self, value)
    class(audit_file_type), intent(inout) :: self
    real(wp), intent(in) :: value(:)
    if (allocated(self%value)) error stop 'bug: a row of the audit is lost'
    self%value = value
  end subroutine put

  !> Write the row that was taken, if there is one.
  subroutine write_pending(self, errors)
    class(audit_file_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (.not. allocated(self%value)) return
    call self%file%write(self%value, errors)
    deallocate (self%value)
  end subroutine write_pending

  subroutine flush_file(self, errors)
    class(audit_file_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%write(errors)
    call self%file%flush(errors)
  end subroutine flush_file

  subroutine close_file(self, errors)
    class(audit_file_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%write(errors)
    call self%file%close(errors)
  end subroutine close_file
end module cpl_audit_file
