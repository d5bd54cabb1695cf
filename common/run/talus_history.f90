!> Time histories: CSV files whose first column is the time [s], one row an instant.
!!
!! Numbers have 17 digits and read back unchanged. On restart the rows after the time of the
!! checkpoint are cut, so that the file equals that of an uninterrupted run; for this, rows must be
!! flushed before the checkpoint of the same time is written. S002 full disk, S010 other columns,
!! N002 a value that is no number.
module talus_history
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: open_append, write_text, close_file, file_exists, read_file, truncate_file
  use talus_text, only: string_type, str, is_finite
  implicit none
  private
  public :: history_type

  integer(i4), parameter :: buffer_room = 65536  !! [byte] kept back before a write
  integer(i4), parameter :: cell_width = 25      !! widest cell with its comma

  !> One CSV file that is being written.
  type :: history_type
    character(len=:), allocatable :: path
    integer(i4) :: columns = 0                  !! including the time
    logical :: fresh = .false.                  !! begun with no row of an earlier run
    integer(i4), private :: descriptor = -1
    integer(i4), private :: used = 0            !! bytes waiting in buffer
    logical, private :: failed = .false.        !! a write has failed: no more are tried
    logical, private :: tainted = .false.       !! NaN or infinity was written (and reported once)
    type(string_type), allocatable, private :: title(:)  !! of the columns
    character(len=:), allocatable, private :: buffer
  contains
    procedure :: open => open_history
    generic :: begin => begin_names, begin_titles
    procedure :: resume
    procedure :: write => write_row
    procedure :: flush => flush_rows
    procedure :: close => close_history
    procedure :: is_open
    procedure, private :: begin_names, begin_titles
  end type history_type

contains

  !> Begin a file, or (append) go on at its end.
  subroutine open_history(self, path, columns, append, errors)
    class(history_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(string_type), intent(in) :: columns(:)  !! 'time [s]', 'kinetic [J]', ...
    logical, intent(in) :: append
    type(error_list_type), intent(inout) :: errors
    call start(self, path, columns, append .and. file_exists(path), errors)
  end subroutine open_history

  !> Begin a file, or go on in it after a restart at time >= 0.
  subroutine begin_names(self, path, columns, time, errors)
    class(history_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(string_type), intent(in) :: columns(:)
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (time < 0.0_wp) then
      call self%open(path, columns, .false., errors)
    else
      call self%resume(path, columns, time, errors)
    end if
  end subroutine begin_names

  !> The same with padded titles.
  subroutine begin_titles(self, path, titles, time, errors)
    class(history_type), intent(inout) :: self
    character(len=*), intent(in) :: path, titles(:)
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    type(string_type) :: columns(size(titles))
    integer(i4) :: k
    do k = 1, size(titles)
      columns(k)%s = trim(titles(k))
    end do
    call begin_names(self, path, columns, time, errors)
  end subroutine begin_titles

  !> Go on after a restart: rows later than time [s], and a last row without its end, are cut.
  subroutine resume(self, path, columns, time, errors)
    class(history_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(string_type), intent(in) :: columns(:)
    real(wp), intent(in) :: time
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i8) :: bytes
    integer(i4) :: before

    before = errors%count
    if (file_exists(path)) then
      call read_file(path, text, errors)
      if (errors%count > before) return
      bytes = kept_bytes(text, time)
      if (bytes == 0) then
        call start(self, path, columns, .false., errors)
        return
      end if
      if (text(:index(text, new_line('a')) - 1) /= header(columns)) then
        call errors%add('S010', "'"//path//"' has other columns than this run writes", path, &
                        'move it away, or restart with the deck that made it')
        return
      end if
      if (bytes < len(text, i8)) call truncate_file(path, bytes, errors)
      if (errors%count > before) return
    end if
    call start(self, path, columns, file_exists(path), errors)
  end subroutine resume

  subroutine start(self, path, columns, append, errors)
    class(history_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(string_type), intent(in) :: columns(:)
    logical, intent(in) :: append
    type(error_list_type), intent(inout) :: errors
    self%path = path
    self%columns = size(columns)
    self%used = 0
    self%failed = .false.
    self%tainted = .false.
    self%fresh = .not. append
    self%title = columns
    if (.not. allocated(self%buffer)) allocate (character(len=buffer_room) :: self%buffer)
    call open_append(path, .not. append, self%descriptor, errors)
    if (self%descriptor < 0 .or. append) return
    call write_text(self%descriptor, path, header(columns)//new_line('a'), errors)
  end subroutine start

  pure function header(columns) result(text)
    type(string_type), intent(in) :: columns(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(columns)
      if (k > 1) text = text//','
      text = text//columns(k)%s
    end do
  end function header

  !> Bytes of the header and of the whole rows not later than time.
  pure function kept_bytes(text, time) result(bytes)
    character(len=*), intent(in) :: text
    real(wp), intent(in) :: time  !! [s]
    integer(i8) :: bytes
    integer(i8) :: first, last
    integer :: comma, stat
    real(wp) :: row_time

    bytes = 0
    first = 1
    do while (first <= len(text, i8))
      last = index(text(first:), new_line('a'), kind=i8)
      if (last == 0) return
      last = first + last - 1
      if (first > 1) then
        comma = scan(text(first:last - 1)//',', ',')
        read (text(first:first + comma - 2), *, iostat=stat) row_time
        if (stat /= 0) return
        if (row_time > time) return
      end if
      bytes = last
      first = last + 1
    end do
  end function kept_bytes

  !> Add a row; it reaches the file at the next flush or when the buffer is full.
  subroutine write_row(self, values, errors)
    class(history_type), intent(inout) :: self
    real(wp), intent(in) :: values(:)  !! time first, one a column
    type(error_list_type), intent(inout) :: errors
    character(len=cell_width) :: cell
    integer(i4) :: k, n

    if (self%descriptor < 0 .or. self%failed) return
    if (size(values) /= self%columns) error stop 'bug: history row of another width'
    if (self%used + cell_width*size(values) + 1 > buffer_room) call self%flush(errors)
    do k = 1, size(values)
      write (cell, '(es24.16e3)') values(k)
      cell = adjustl(cell)
      n = len_trim(cell)
      if (k > 1) call append(self, ',')
      call append(self, cell(:n))
    end do
    call append(self, new_line('a'))
    if (.not. (self%tainted .or. all(is_finite(values)))) call taint(self, values, errors)
  end subroutine write_row

  !> Fault N002 for the first value of the file that is no number.
  subroutine taint(self, values, errors)
    class(history_type), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    self%tainted = .true.
    k = findloc(is_finite(values), .false., 1, kind=i4)
    call errors%add('N002', "'"//self%path//"': "//self%title(k)%s//' is '//str(values(k))// &
                    ' at time '//str(values(1))//' s', self%path, 'a time step too long or a ' &
                    //'material too weak for its loads are the usual causes')
  end subroutine taint

  subroutine append(self, text)
    class(history_type), intent(inout) :: self
    character(len=*), intent(in) :: text
    self%buffer(self%used + 1:self%used + len(text)) = text
    self%used = self%used + len(text)
  end subroutine append

  !> Bring all rows to the file; call it before a checkpoint.
  subroutine flush_rows(self, errors)
    class(history_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: before
    if (self%descriptor < 0 .or. self%failed .or. self%used == 0) return
    before = errors%count
    call write_text(self%descriptor, self%path, self%buffer(:self%used), errors)
    self%used = 0
    self%failed = errors%count > before
  end subroutine flush_rows

  subroutine close_history(self, errors)
    class(history_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (self%descriptor < 0) return
    call self%flush(errors)
    call close_file(self%descriptor, self%path, .not. self%failed, errors)
  end subroutine close_history

  pure logical function is_open(self)
    class(history_type), intent(in) :: self
    is_open = self%descriptor >= 0
  end function is_open
end module talus_history
