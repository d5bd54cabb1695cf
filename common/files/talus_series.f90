!> Field output over time in one HDF5 file: /steps/000000, /steps/000001, ... each with the
!! attributes time [s], count and complete.
!!
!! The file is opened, added to and closed for every step, so that an interrupted run leaves the
!! earlier steps readable and a viewer can read in between. Room for a step is reserved before the
!! file is touched: on a full disk the step is absent and the file whole. On restart the steps
!! later than the checkpoint are removed, and a last one that is extra; an unreadable file is moved
!! aside and reported in note.
module talus_series
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, file_size, rename_file, reserve_room, truncate_file
  use talus_hdf5, only: h5_file_type
  use talus_text, only: string_type
  implicit none
  private
  public :: series_type, step_type

  !> One step in the file.
  type :: step_type
    real(wp) :: time = 0.0_wp   !! [s]
    integer(i8) :: count = 0    !! grains, or whatever may change in number
    integer(i4) :: number = 0   !! of the group
  end type step_type

  !> A growing file of fields.
  type :: series_type
    character(len=:), allocatable :: path
    character(len=:), allocatable :: format
    character(len=:), allocatable :: note         !! what resume had to do, empty if nothing
    integer(i4) :: count = 0                      !! whole steps in the file
    logical :: extra = .false.                    !! the next step is off the output times
    type(step_type), allocatable :: step(:)
    type(step_type), private :: current
    integer(i8), private :: before = 0            !! bytes of the file without the current step
    integer(i8), private :: growth = 0            !! largest step so far [bytes]
  contains
    procedure :: start
    procedure :: resume
    procedure :: begin_step
    procedure :: end_step
    procedure :: step_path
  end type series_type

  integer(i8), parameter :: spare = 262144_i8  !! for what HDF5 adds to the arrays of a step

contains

  !> Begin a new file. The caller may put constant data (a mesh) into file and then commits it.
  subroutine start(self, path, format, file, errors)
    class(series_type), intent(inout) :: self
    character(len=*), intent(in) :: path, format  !! format: 'talus-grains', 'talus-solid'
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    self%path = path
    self%format = format
    self%note = ''
    self%count = 0
    if (allocated(self%step)) deallocate (self%step)
    allocate (self%step(64))
    call file%create(path, errors, format=format, grows=.true.)
    call file%group('/steps', errors)
  end subroutine start

  !> Go on after a restart at time [s]: later and unfinished steps are removed. found is .false.
  !! when there is no usable file: then call start.
  subroutine resume(self, path, format, time, found, errors)
    class(series_type), intent(inout) :: self
    character(len=*), intent(in) :: path, format
    real(wp), intent(in) :: time
    logical, intent(out) :: found
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(error_list_type) :: faults
    integer(i4) :: before

    self%path = path
    self%format = format
    self%note = ''
    self%count = 0
    if (allocated(self%step)) deallocate (self%step)
    allocate (self%step(64))
    found = file_exists(path)
    if (.not. found) return
    call file%open(path, faults, format=format, write=.true.)
    if (file%is_open()) call keep_until(self, file, time, faults)
    call file%close(faults)
    if (.not. faults%any()) return
    before = errors%count
    call rename_file(path, path//'.damaged', errors)
    found = errors%count > before
    self%count = 0
    self%note = "field file moved to '"//path//".damaged', a new one is begun: "// &
                faults%item(1)%message
  end subroutine resume

  subroutine keep_until(self, file, time, errors)
    class(series_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    real(wp), intent(in) :: time
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: missing, ignored
    type(string_type), allocatable :: names(:)
    type(step_type) :: step
    integer(i4) :: complete, extra
    integer :: k, stat

    call file%names('/steps', names)
    do k = 1, size(names)
      complete = 0
      extra = 0
      call file%attr_get('/steps/'//names(k)%s, 'time', step%time, missing)
      call file%attr_get('/steps/'//names(k)%s, 'count', step%count, missing)
      call file%attr_get('/steps/'//names(k)%s, 'complete', complete, missing)
      call file%attr_get('/steps/'//names(k)%s, 'extra', extra, ignored)
      read (names(k)%s, *, iostat=stat) step%number
      if (missing%any() .or. complete /= 1 .or. stat /= 0 .or. step%time > time &
        .or. extra == 1) then
        call file%delete('/steps/'//names(k)%s, errors)
      else
        call add(self, step)
      end if
      call missing%clear()
    end do
  end subroutine keep_until

  subroutine add(self, step)
    class(series_type), intent(inout) :: self
    type(step_type), intent(in) :: step
    type(step_type), allocatable :: longer(:)
    if (self%count == size(self%step)) then
      allocate (longer(2*self%count))
      longer(:self%count) = self%step(:self%count)
      call move_alloc(longer, self%step)
    end if
    self%count = self%count + 1
    self%step(self%count) = step
  end subroutine add

  !> Open the file for one more step: datasets go to group//'/...'.
  subroutine begin_step(self, time, file, group, errors)
    class(series_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(h5_file_type), intent(inout) :: file
    character(len=:), allocatable, intent(out) :: group
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: faults
    self%current = step_type(time=time)
    if (self%count > 0) self%current%number = self%step(self%count)%number + 1
    group = group_name(self%current%number)
    file%failed = .true.
    faults = errors%count
    call reserve_room(self%path, spare + self%growth + self%growth/4_i8, errors)
    if (errors%count > faults) return
    self%before = file_size(self%path)
    call file%open(self%path, errors, format=self%format, write=.true.)
    file%spare = spare
    if (file%exists(group)) call file%delete(group, errors)
    call file%group(group, errors)
    call file%attr_put(group, 'time', time, errors)
    if (self%extra) call file%attr_put(group, 'extra', 1_i4, errors)
    self%extra = .false.
  end subroutine begin_step

  !> Mark the step complete and close the file.
  subroutine end_step(self, count, file, errors)
    class(series_type), intent(inout) :: self
    integer(i8), intent(in) :: count  !! grains of this step
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: group
    logical :: whole
    group = group_name(self%current%number)
    self%current%count = count
    call file%attr_put(group, 'count', count, errors)
    call file%flush(errors)
    call file%attr_put(group, 'complete', 1_i4, errors)
    whole = .not. file%silent()
    call file%close(errors)
    if (whole .and. .not. file%failed) then
      call add(self, self%current)
      self%growth = max(self%growth, file_size(self%path) - self%before)
    end if
    if (file_exists(self%path)) call truncate_file(self%path, file_size(self%path), errors)
  end subroutine end_step

  !> Group of step k (1 is the first) in the file.
  pure function step_path(self, k) result(path)
    class(series_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: path
    path = group_name(self%step(k)%number)
  end function step_path

  pure function group_name(number) result(name)
    integer(i4), intent(in) :: number
    character(len=:), allocatable :: name
    character(len=16) :: digits
    write (digits, '(i6.6)') number
    name = '/steps/'//trim(digits)
  end function group_name
end module talus_series
