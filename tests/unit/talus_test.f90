!> Tiny test harness: count checks, say which failed, leave with 1 if any did.
module talus_test
  use, intrinsic :: iso_fortran_env, only: output_unit
  use talus_kinds, only: wp
  use talus_text, only: str
  implicit none
  private
  public :: test_type

  !> Tally of one test program.
  type :: test_type
    integer :: passed = 0, failed = 0
  contains
    procedure :: check
    procedure :: check_close
    procedure :: check_text
    procedure :: finish
  end type test_type

contains

  subroutine check(self, name, condition)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical, intent(in) :: condition
    if (condition) then
      self%passed = self%passed + 1
    else
      self%failed = self%failed + 1
      write (output_unit, '(a)') 'FAILED: '//name
    end if
  end subroutine check

  !> |value - expected| <= tolerance (absolute); the numbers are shown on failure.
  subroutine check_close(self, name, value, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value, expected, tolerance
    call self%check(name//': '//str(value)//' for '//str(expected)//' within '//str(tolerance), &
                    abs(value - expected) <= tolerance)
  end subroutine check_close

  subroutine check_text(self, name, value, expected)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name, value, expected
    call self%check(name//': "'//value//'" for "'//expected//'"', value == expected)
  end subroutine check_text

  subroutine finish(self)
    class(test_type), intent(in) :: self
    write (output_unit, '(a)') str(self%passed)//' passed, '//str(self%failed)//' failed'
    if (self%failed > 0) stop 1, quiet=.true.
  end subroutine finish
end module talus_test
