!> Tiny test harness: count checks, say which failed, leave with 1 if any did.
!> A NaN never passes: gfortran's maxval and max skip it, so arrays are compared by
!> check_all_close, and largest values are taken by max_abs and larger.
module talus_test
  use, intrinsic :: iso_fortran_env, only: output_unit
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use talus_kinds, only: wp
  use talus_text, only: str
  implicit none
  private
  public :: test_type, max_abs, larger

  !> Tally of one test program.
  type :: test_type
    integer :: passed = 0, failed = 0
    integer :: unit = output_unit !! where failures and the tally are written
  contains
    procedure :: check
    procedure :: check_close
    procedure :: check_text
    procedure :: finish
    !> |values - expected| <= tolerance (absolute), entry by entry; expected is an array of the
    !> same shape or one number. The worst entry is shown on failure. Fails with a NaN in either
    !> operand (in both too), where shapes differ, and with nothing to compare.
    generic :: check_all_close => &
      check_vector, check_vector_value, check_matrix, check_matrix_value, check_cube, &
      check_cube_value
    procedure, private :: check_vector, check_vector_value, check_matrix, check_matrix_value
    procedure, private :: check_cube, check_cube_value
    procedure, private :: judge_all
  end type test_type

  !> Largest |x|; NaN if an entry is NaN or there is none.
  interface max_abs
    module procedure max_abs_vector, max_abs_matrix, max_abs_cube
  end interface max_abs

contains

  subroutine check(self, name, condition)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical, intent(in) :: condition
    if (condition) then
      self%passed = self%passed + 1
    else
      self%failed = self%failed + 1
      write (self%unit, '(a)') 'FAILED: '//name
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

  subroutine check_vector(self, name, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:), expected(:), tolerance
    if (any(shape(values) /= shape(expected))) then
      call self%check(name//': shape ('//list_of(shape(values))//') for (' &
                      //list_of(shape(expected))//')', .false.)
    else
      call self%judge_all(name, shape(values), [values], [expected], tolerance)
    end if
  end subroutine check_vector

  subroutine check_vector_value(self, name, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:), expected, tolerance
    call self%judge_all(name, shape(values), [values], spread(expected, 1, size(values)), &
                        tolerance)
  end subroutine check_vector_value

  subroutine check_matrix(self, name, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :), expected(:, :), tolerance
    if (any(shape(values) /= shape(expected))) then
      call self%check(name//': shape ('//list_of(shape(values))//') for (' &
                      //list_of(shape(expected))//')', .false.)
    else
      call self%judge_all(name, shape(values), [values], [expected], tolerance)
    end if
  end subroutine check_matrix

  subroutine check_matrix_value(self, name, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :), expected, tolerance
    call self%judge_all(name, shape(values), [values], spread(expected, 1, size(values)), &
                        tolerance)
  end subroutine check_matrix_value

  subroutine check_cube(self, name, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :, :), expected(:, :, :), tolerance
    if (any(shape(values) /= shape(expected))) then
      call self%check(name//': shape ('//list_of(shape(values))//') for (' &
                      //list_of(shape(expected))//')', .false.)
    else
      call self%judge_all(name, shape(values), [values], [expected], tolerance)
    end if
  end subroutine check_cube

  subroutine check_cube_value(self, name, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :, :), expected, tolerance
    call self%judge_all(name, shape(values), [values], spread(expected, 1, size(values)), &
                        tolerance)
  end subroutine check_cube_value

  !> The check of all entries in array order, with the worst one named: the first NaN, else the
  !> one that is farthest off.
  subroutine judge_all(self, name, extents, values, expected, tolerance)
    class(test_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: extents(:) !! shape of the array compared
    real(wp), intent(in) :: values(:), expected(:), tolerance
    real(wp), allocatable :: off(:)
    integer :: worst
    if (size(values) == 0) then
      call self%check(name//': nothing to compare', .false.)
      return
    end if
    off = abs(values - expected)
    where (off > huge(off)) off = huge(off)
    where (ieee_is_nan(off)) off = huge(off)
    worst = maxloc(off, 1)
    if (any(ieee_is_nan(values - expected))) &
      worst = findloc(ieee_is_nan(values - expected), .true., 1)
    call self%check(name//': '//str(values(worst))//' for '//str(expected(worst))//' within ' &
                    //str(tolerance)//' at ('//list_of(place_of(worst, extents))//')', &
                    all(abs(values - expected) <= tolerance))
  end subroutine judge_all

  !> Indices of the n-th entry of an array of these extents.
  pure function place_of(n, extents) result(place)
    integer, intent(in) :: n, extents(:)
    integer :: place(size(extents)), rest, k
    rest = n - 1
    do k = 1, size(extents)
      place(k) = modulo(rest, extents(k)) + 1
      rest = rest/extents(k)
    end do
  end function place_of

  pure function list_of(numbers) result(text)
    integer, intent(in) :: numbers(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(numbers)
      if (k > 1) text = text//', '
      text = text//str(numbers(k))
    end do
  end function list_of

  pure real(wp) function max_abs_vector(x)
    real(wp), intent(in) :: x(:)
    if (size(x) == 0 .or. any(ieee_is_nan(x))) then
      max_abs_vector = ieee_value(1.0_wp, ieee_quiet_nan)
    else
      max_abs_vector = maxval(abs(x))
    end if
  end function max_abs_vector

  pure real(wp) function max_abs_matrix(x)
    real(wp), intent(in) :: x(:, :)
    max_abs_matrix = max_abs_vector([x])
  end function max_abs_matrix

  pure real(wp) function max_abs_cube(x)
    real(wp), intent(in) :: x(:, :, :)
    max_abs_cube = max_abs_vector([x])
  end function max_abs_cube

  !> The largest of up to four numbers; NaN if one of them is (max would return another).
  elemental real(wp) function larger(a, b, c, d)
    real(wp), intent(in) :: a, b
    real(wp), intent(in), optional :: c, d
    larger = merge(a, b, a >= b .or. ieee_is_nan(a))
    if (present(c)) larger = merge(larger, c, larger >= c .or. ieee_is_nan(larger))
    if (present(d)) larger = merge(larger, d, larger >= d .or. ieee_is_nan(larger))
  end function larger

  subroutine finish(self)
    class(test_type), intent(in) :: self
    write (self%unit, '(a)') str(self%passed)//' passed, '//str(self%failed)//' failed'
    if (self%failed > 0) stop 1, quiet=.true.
  end subroutine finish
end module talus_test
