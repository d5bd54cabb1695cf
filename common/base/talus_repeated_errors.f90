!> Faults that can occur once a grain: the first few of each code are reported, the rest counted.
module talus_repeated_errors
  use talus_kinds, only: i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  implicit none
  private
  public :: repeated_errors_type, most_alike

  integer(i4), parameter :: most_alike = 5    !! faults of a code that are reported one by one
  integer(i4), parameter :: most_codes = 8    !! different codes of one check
  integer(i4), parameter :: code_length = 4   !! letter and three digits

  !> call few%add(...) in place of errors%add(...), call few%finish(...) behind the loop.
  type :: repeated_errors_type
    private
    integer(i4) :: codes = 0                             !! met so far
    character(len=code_length) :: code(most_codes) = ''
    integer(i4) :: number(most_codes) = 0                !! faults of each
  contains
    procedure :: add
    procedure :: finish
  end type repeated_errors_type

contains

  !> Add a fault to the list, or count it where there are enough of its code.
  subroutine add(self, code, message, hint, errors)
    class(repeated_errors_type), intent(inout) :: self
    character(len=*), intent(in) :: code, message, hint
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: c

    do c = 1, self%codes
      if (self%code(c) == code) exit
    end do
    if (c > most_codes) error stop 'bug: one check has too many codes of repeated faults'
    if (c > self%codes) then
      self%codes = c
      self%code(c) = code
    end if
    self%number(c) = self%number(c) + 1
    if (self%number(c) <= most_alike) call errors%add(code, message, hint=hint)
  end subroutine add

  !> Say how many faults of each code were not reported one by one.
  subroutine finish(self, what, errors)
    class(repeated_errors_type), intent(inout) :: self
    character(len=*), intent(in) :: what  !! has these faults, as in 'grains'
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: c

    do c = 1, self%codes
      if (self%number(c) > most_alike) &
        call errors%add(self%code(c), 'and '//str(self%number(c) - most_alike)//' more '//what// &
                        ' with this fault', hint='the first '//str(most_alike)//' are named above')
    end do
    self%codes = 0
    self%number = 0
  end subroutine finish
end module talus_repeated_errors
