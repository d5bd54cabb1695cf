!> Triangles from an STL file, binary or text. Faults I220 to I222 name the triangle.
module dem_stl
  use, intrinsic :: iso_fortran_env, only: int32, real32
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, lower, is_finite
  use talus_errors, only: error_list_type
  use talus_files, only: read_file
  implicit none
  private
  public :: read_stl, check_numbers, cleaned

  integer(i4), parameter :: header = 80, record = 50  !! bytes
  character(len=*), parameter :: number_letters = ' 0123456789+-.edinfaty'  !! nan, infinity too
  character(len=*), parameter :: hint = 'export it again from the program that drew it'

contains

  !> Corners of all triangles in the order of the file [unit of the file].
  subroutine read_stl(path, corner, errors)
    character(len=*), intent(in) :: path
    real(wp), allocatable, intent(out) :: corner(:, :, :)  !! (3, 3, triangles): x, corner
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i8) :: said
    integer(i4) :: before

    before = errors%count
    allocate (corner(3, 3, 0))
    call read_file(path, text, errors)
    if (errors%count > before) return
    said = -1
    if (len(text) >= header + 4) said = iand(int(transfer(text(header + 1:header + 4), 0_int32), &
                                                 i8), int(z'FFFFFFFF', i8))
    if (said >= 0 .and. len(text, i8) == header + 4 + said*record) then
      call read_binary(text, int(said, i4), corner)
    else if (starts_as_text(text)) then
      call read_text(path, text, corner, errors)
    else
      call errors%add('I220', "'"//path//"' is no STL file: it does not begin with "// &
                      "'solid', and as a binary file it would have "//str(said)// &
                      ' triangles and '// &
                      str(header + 4 + max(said, 0_i8)*record)//' bytes, not '// &
                      str(len(text, i8)), path, hint)
    end if
    if (errors%count > before) return
    if (size(corner, 3) == 0) &
      call errors%add('I221', "'"//path//"' holds no triangles", path, hint)
    call check_numbers(path, corner, errors)
  end subroutine read_stl

  pure logical function starts_as_text(text)
    character(len=*), intent(in) :: text
    integer :: at
    at = verify(text(:min(len(text), 200)), ' '//achar(9)//achar(10)//achar(13))
    starts_as_text = .false.
    if (at > 0) starts_as_text = lower(text(at:min(at + 4, len(text)))) == 'solid'
  end function starts_as_text

  subroutine read_binary(text, n, corner)
    character(len=*), intent(in) :: text
    integer(i4), intent(in) :: n
    real(wp), allocatable, intent(out) :: corner(:, :, :)
    real(real32) :: numbers(12)
    integer(i4) :: k, at

    allocate (corner(3, 3, n))
    do k = 1, n
      at = header + 4 + (k - 1)*record
      numbers = transfer(text(at + 1:at + 48), numbers)
      corner(:, :, k) = reshape(real(numbers(4:12), wp), [3, 3])
    end do
  end subroutine read_binary

  !> Lines 'vertex x y z', three between 'outer loop' and 'endloop'; normals are not read.
  subroutine read_text(path, text, corner, errors)
    character(len=*), intent(in) :: path, text
    real(wp), allocatable, intent(out) :: corner(:, :, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: longer(:, :, :)
    character(len=:), allocatable :: line
    integer(i4) :: found, number, corners, stat
    integer(i8) :: at, next

    allocate (corner(3, 3, 64))
    found = 0
    corners = 0
    number = 0
    at = 1
    do while (at <= len(text, i8))
      next = index(text(at:), achar(10), kind=i8)
      if (next == 0) next = len(text, i8) - at + 2
      line = lower(trim(adjustl(cleaned(text(at:at + next - 2)))))
      at = at + next
      number = number + 1
      if (index(line, 'endloop') == 1 .and. corners /= 3) then
        call errors%add('I220', "'"//path//"': triangle "//str(found + 1)//' has '//str(corners)// &
                        ' corners', path//', line '//str(number), hint)
        return
      else if (index(line, 'endloop') == 1) then
        corners = 0
        found = found + 1
      else if (index(line, 'vertex') == 1) then
        if (found == size(corner, 3)) then
          allocate (longer(3, 3, 2*found))
          longer(:, :, :found) = corner
          call move_alloc(longer, corner)
        end if
        corners = corners + 1
        stat = verify(line(7:), number_letters)
        if (corners <= 3 .and. stat == 0) read (line(7:), *, iostat=stat) corner(:, corners, &
          found + 1)
        if (stat /= 0) then
          call errors%add('I220', "'"//path//"': triangle "//str(found + 1)//", '"//line// &
                          "' is no corner", path//', line '//str(number), hint)
          return
        end if
      end if
    end do
    corner = corner(:, :, :found)
  end subroutine read_text

  !> Blanks for tabs and carriage returns.
  pure function cleaned(line) result(text)
    character(len=*), intent(in) :: line
    character(len=len(line)) :: text
    integer :: k
    text = line
    do k = 1, len(line)
      if (iachar(line(k:k)) < 32) text(k:k) = ' '
    end do
  end function cleaned

  !> Coordinates are numbers (I222).
  subroutine check_numbers(path, corner, errors)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: corner(:, :, :)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, size(corner, 3)
      if (all(is_finite(corner(:, :, k)))) cycle
      call errors%add('I222', "'"//path//"': triangle "//str(k)//' has a corner that is not a '// &
                      'number: '//str(reshape(corner(:, :, k), [9])), path, hint)
      return
    end do
  end subroutine check_numbers
end module dem_stl
