!> Triangles from an OBJ file (Wavefront): lines 'v x y z' and faces 'f i j k ...'. Faults I279 and,
!! as of STL files, I221 and I222.
module dem_obj
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: read_file
  use dem_stl, only: check_numbers, cleaned
  implicit none
  private
  public :: read_obj

  character(len=*), parameter :: hint = 'export it again from the program that drew it'

  !> What has been read so far.
  type :: obj_type
    real(wp), allocatable :: x(:, :)          !! (3, room) corners
    integer(i4), allocatable :: of(:, :)      !! (3, room) triangles
    integer(i4) :: vertices = 0, triangles = 0
  end type obj_type

contains

  !> Corners of all triangles in the order of the file [unit of the file]; faces of more corners are
  !! fans about their first one. Textures, normals, groups and materials are not read.
  subroutine read_obj(path, corner, errors)
    character(len=*), intent(in) :: path
    real(wp), allocatable, intent(out) :: corner(:, :, :)  !! (3, 3, triangles): x, corner
    type(error_list_type), intent(inout) :: errors
    type(obj_type) :: obj
    character(len=:), allocatable :: text, line
    integer(i4) :: before, number, k
    integer(i8) :: at, next

    before = errors%count
    allocate (corner(3, 3, 0), obj%x(3, 64), obj%of(3, 64))
    call read_file(path, text, errors)
    number = 0
    at = 1
    do while (errors%count == before .and. at <= len(text, i8))
      next = index(text(at:), achar(10), kind=i8)
      if (next == 0) next = len(text, i8) - at + 2
      line = trim(adjustl(cleaned(text(at:at + next - 2))))
      at = at + next
      number = number + 1
      if (index(line, 'v ') == 1) call take_corner(obj, line, path, number, errors)
      if (index(line, 'f ') == 1) call take_face(obj, line, path, number, errors)
    end do
    if (errors%count > before) return
    deallocate (corner)
    allocate (corner(3, 3, obj%triangles))
    do k = 1, obj%triangles
      corner(:, :, k) = obj%x(:, obj%of(:, k))
    end do
    if (obj%triangles == 0) &
      call errors%add('I221', "'"//path//"' holds no triangles", path, hint)
    call check_numbers(path, corner, errors)
  end subroutine read_obj

  !> A line 'v x y z'; a weight or colours behind them are not read.
  subroutine take_corner(obj, line, path, number, errors)
    type(obj_type), intent(inout) :: obj
    character(len=*), intent(in) :: line, path
    integer(i4), intent(in) :: number
    type(error_list_type), intent(inout) :: errors
    real(wp) :: x(3)
    integer :: stat
    read (line(2:), *, iostat=stat) x
    if (stat /= 0) then
      call refuse("'"//line//"' is no corner", path, number, errors)
      return
    end if
    if (obj%vertices == size(obj%x, 2)) &
      obj%x = reshape([obj%x, obj%x], [3, 2*size(obj%x, 2)])
    obj%vertices = obj%vertices + 1
    obj%x(:, obj%vertices) = x
  end subroutine take_corner

  !> A line 'f i j k ...', each a number of a corner, maybe with '/texture/normal' behind it;
  !! negative ones count back from the last.
  subroutine take_face(obj, line, path, number, errors)
    type(obj_type), intent(inout) :: obj
    character(len=*), intent(in) :: line, path
    integer(i4), intent(in) :: number
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: corner(len(line)), n, k, start, behind
    integer :: stat

    n = 0
    start = 2
    do
      k = verify(line(start:), ' ')
      if (k == 0) exit
      start = start + k - 1
      behind = index(line(start:)//' ', ' ') + start - 1
      n = n + 1
      read (line(start:start + scan(line(start:behind - 1)//'/', '/') - 2), *, iostat=stat) &
        corner(n)
      if (stat == 0 .and. corner(n) < 0) corner(n) = obj%vertices + 1 + corner(n)
      if (stat /= 0 .or. corner(n) < 1 .or. corner(n) > obj%vertices) then
        call refuse("'"//line(start:behind - 1)//"' is none of the "//str(obj%vertices)// &
                    ' corners so far', path, number, errors)
        return
      end if
      start = behind
      if (start > len(line)) exit
    end do
    if (n < 3) call refuse('a face has '//str(n)//' corners', path, number, errors)
    do k = 3, n
      if (obj%triangles == size(obj%of, 2)) &
        obj%of = reshape([obj%of, obj%of], [3, 2*size(obj%of, 2)])
      obj%triangles = obj%triangles + 1
      obj%of(:, obj%triangles) = [corner(1), corner(k - 1), corner(k)]
    end do
  end subroutine take_face

  subroutine refuse(text, path, number, errors)
    character(len=*), intent(in) :: text, path
    integer(i4), intent(in) :: number
    type(error_list_type), intent(inout) :: errors
    call errors%add('I279', "'"//path//"': "//text, path//', line '//str(number), hint)
  end subroutine refuse
end module dem_obj
