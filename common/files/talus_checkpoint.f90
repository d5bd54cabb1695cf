!> Checkpoints: <stem>.chk.h5 is the newest, <stem>.chk.1.h5 the one before it, and so on; a tagged
!! one is <stem>.<tag>.chk.h5 and is never rotated.
!!
!! A checkpoint is an HDF5 file that ends with the attribute 'complete'. It is written under a
!! temporary name, synced and renamed, and the older one keeps its name until then: at every moment
!! a whole checkpoint is on the disk. S011 incomplete, S012 of another program, S013 none is usable,
!! S015 without a checksum.
module talus_checkpoint
  use talus_intervals, only: intervals_until
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, link_file, rename_file, remove_file, list_files, folder_of, &
    name_of, sync_folder
  use talus_hdf5, only: h5_file_type
  use talus_system, only: wall_clock
  use talus_text, only: str, string_type, append_string, ends_with
  use talus_version, only: version_text
  implicit none
  private
  public :: checkpoint_type, checkpoint_info_type

  character(len=*), parameter :: format = 'talus-checkpoint'
  character(len=*), parameter :: ending = '.chk.h5'
  integer(i8), parameter :: most_steps = 10_i8**15  !! a microsecond each are thirty years

  !> Description stored in a checkpoint.
  type :: checkpoint_info_type
    character(len=:), allocatable :: path, program, version, deck_hash, tag
    real(wp) :: time = 0.0_wp    !! [s]
    integer(i8) :: step = 0
    logical :: complete = .false.
  end type checkpoint_info_type

  !> Where and when the checkpoints of a run are written.
  type :: checkpoint_type
    character(len=:), allocatable :: stem       !! path without ending: 'out/grains'
    character(len=:), allocatable :: program    !! 'talus-dem'
    character(len=:), allocatable :: deck_hash
    integer(i4) :: keep = 2                     !! newest ones kept, at least 1
    real(wp) :: every_wall = 0.0_wp             !! [s], 0 never
    real(wp) :: every_time = 0.0_wp             !! simulated [s], 0 never
    real(wp), private :: next_wall = 0.0_wp     !! wall clock [s]
    real(wp), private :: next_time = 0.0_wp     !! [s]
    character(len=:), allocatable, private :: tag
    logical, private :: written = .false.       !! one without a tag, in this run
  contains
    procedure :: init
    procedure :: schedule
    procedure :: due
    procedure :: begin
    procedure :: finish
    procedure :: tag_path
    procedure :: find
    procedure :: open => open_checkpoint
  end type checkpoint_type

contains

  subroutine init(self, stem, program, deck_hash, keep)
    class(checkpoint_type), intent(inout) :: self
    character(len=*), intent(in) :: stem, program, deck_hash
    integer(i4), intent(in) :: keep
    self%stem = stem
    self%program = program
    self%deck_hash = deck_hash
    self%keep = max(1, keep)
    self%tag = ''
  end subroutine init

  !> Set when checkpoints are due, from time [s] on; 0 or less is never.
  subroutine schedule(self, every_wall, every_time, time)
    class(checkpoint_type), intent(inout) :: self
    real(wp), intent(in) :: every_wall  !! wall time between two [s]
    real(wp), intent(in) :: every_time  !! simulated time between two [s]
    real(wp), intent(in) :: time        !! [s]
    self%every_wall = every_wall
    self%every_time = every_time
    self%next_wall = wall_clock() + every_wall
    if (every_time > 0.0_wp) call next_multiple(self, time)
  end subroutine schedule

  !> First multiple of every_time that is later than time.
  subroutine next_multiple(self, time)
    class(checkpoint_type), intent(inout) :: self
    real(wp), intent(in) :: time
    real(wp), parameter :: round_off = 1.0e-9_wp  !! of an interval
    real(wp) :: early
    early = round_off*self%every_time
    self%next_time = self%every_time*(intervals_until(time + early, self%every_time) + 1_i8) - early
  end subroutine next_multiple

  !> Is a checkpoint due at this time [s]? Asking moves the schedule on.
  logical function due(self, time)
    class(checkpoint_type), intent(inout) :: self
    real(wp), intent(in) :: time
    due = .false.
    if (self%every_time > 0.0_wp .and. time >= self%next_time) then
      due = .true.
      call next_multiple(self, time)
    end if
    if (self%every_wall > 0.0_wp) then
      if (wall_clock() >= self%next_wall) due = .true.
      if (due) self%next_wall = wall_clock() + self%every_wall
    end if
  end function due

  !> Begin a checkpoint: the caller then puts its datasets into file and calls finish.
  subroutine begin(self, file, time, step, errors, tag)
    class(checkpoint_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    real(wp), intent(in) :: time     !! [s]
    integer(i8), intent(in) :: step
    type(error_list_type), intent(inout) :: errors
    character(len=*), intent(in), optional :: tag  !! a name that sets it apart; not rotated

    self%tag = ''
    if (present(tag)) self%tag = tag
    call file%create(self%tag_path(self%tag), errors, format=format, &
                     own=self%written .and. len(self%tag) == 0)
    call file%attr_put('/', 'program', self%program, errors)
    call file%attr_put('/', 'version', version_text(), errors)
    call file%attr_put('/', 'deck_hash', self%deck_hash, errors)
    call file%attr_put('/', 'tag', self%tag, errors)
    call file%attr_put('/', 'time', time, errors)
    call file%attr_put('/', 'step', step, errors)
  end subroutine begin

  !> Mark it complete, rename the older ones and it. After a fault the older ones remain.
  subroutine finish(self, file, errors)
    class(checkpoint_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kept
    integer(i4) :: before

    before = errors%count
    call file%attr_put('/', 'complete', 1_i4, errors)
    call file%flush(errors)
    if (errors%count > before .or. file%failed) then
      call file%discard()
      return
    end if
    kept = self%tag_path('')//'.kept'
    if (len(self%tag) == 0 .and. self%keep > 1 .and. file_exists(self%tag_path(''))) then
      call link_file(self%tag_path(''), kept, errors)
    end if
    call file%commit(errors)
    if (errors%count == before .and. len(self%tag) == 0) self%written = .true.
    if (.not. file_exists(kept)) return
    if (errors%count > before) then
      if (file_exists(self%tag_path(''))) call remove_file(kept)
      if (.not. file_exists(self%tag_path(''))) call rename_file(kept, self%tag_path(''), errors)
    else
      call rotate(self, kept, errors)
    end if
  end subroutine finish

  !> The one that was newest becomes number 1, number 1 becomes 2, and those beyond keep go.
  subroutine rotate(self, kept, errors)
    class(checkpoint_type), intent(in) :: self
    character(len=*), intent(in) :: kept
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    integer(i4) :: k, number
    do k = self%keep - 2, 1, -1
      if (file_exists(older_path(self, k))) &
        call rename_file(older_path(self, k), older_path(self, k + 1), errors)
    end do
    call rename_file(kept, older_path(self, 1), errors)
    call list_files(folder_of(self%stem), name_of(self%stem)//'.chk.', names)
    do k = 1, size(names)
      number = number_in(names(k)%s, name_of(self%stem))
      if (number >= self%keep) call remove_file(older_path(self, number), errors)
    end do
    call sync_folder(self%stem, errors)
  end subroutine rotate

  !> k of '<stem>.chk.<k>.h5', 0 for other names.
  pure integer(i4) function number_in(name, stem)
    character(len=*), intent(in) :: name, stem
    integer :: first, last, stat
    number_in = 0
    first = len(stem) + len('.chk.') + 1
    last = len(name) - len('.h5')
    if (last < first .or. .not. ends_with(name, '.h5')) return
    if (verify(name(first:last), '0123456789') /= 0) return
    read (name(first:last), *, iostat=stat) number_in
    if (stat /= 0) number_in = 0
  end function number_in

  !> Path of the newest checkpoint (empty tag) or of a tagged one.
  pure function tag_path(self, tag) result(path)
    class(checkpoint_type), intent(in) :: self
    character(len=*), intent(in) :: tag
    character(len=:), allocatable :: path
    path = self%stem
    if (len(tag) > 0) path = path//'.'//tag
    path = path//ending
  end function tag_path

  pure function older_path(self, number) result(path)
    class(checkpoint_type), intent(in) :: self
    integer(i4), intent(in) :: number
    character(len=:), allocatable :: path
    path = self%stem//'.chk.'//str(number)//'.h5'
  end function older_path

  !> The checkpoint to go on from. restart = 'auto': the newest whole one, with a warning for each
  !! that had to be passed over; path is empty when there is none at all. Otherwise it is a path.
  subroutine find(self, restart, path, warnings, errors)
    class(checkpoint_type), intent(in) :: self
    character(len=*), intent(in) :: restart
    character(len=:), allocatable, intent(out) :: path
    type(string_type), allocatable, intent(out) :: warnings(:)
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: candidates(:)
    type(error_list_type) :: faults
    type(checkpoint_info_type) :: info
    type(h5_file_type) :: file
    integer(i4) :: k

    path = ''
    allocate (warnings(0))
    if (restart /= 'auto') then
      path = restart
      return
    end if
    call list_candidates(self, candidates)
    do k = 1, size(candidates)
      call faults%clear()
      call self%open(candidates(k)%s, file, info, faults)
      call file%close(faults)
      if (.not. faults%any()) then
        path = candidates(k)%s
        return
      end if
      call append_string(warnings, 'checkpoint passed over: '//faults%item(1)%message)
    end do
    if (size(candidates) > 0) call errors%add('S013', 'none of the '//str(size(candidates))// &
        " checkpoints '"//self%tag_path('')//"' can be used: "//faults%item(1)%message, &
        self%tag_path(''), 'name another with --restart=FILE, or start without --restart')
  end subroutine find

  !> Checkpoints of this stem that are there, newest first.
  subroutine list_candidates(self, candidates)
    class(checkpoint_type), intent(in) :: self
    type(string_type), allocatable, intent(out) :: candidates(:)
    type(string_type), allocatable :: names(:)
    integer(i4) :: k, number, highest
    allocate (candidates(0))
    if (file_exists(self%tag_path(''))) call append_string(candidates, self%tag_path(''))
    if (file_exists(self%tag_path('')//'.kept')) &
      call append_string(candidates, self%tag_path('')//'.kept')
    call list_files(folder_of(self%stem), name_of(self%stem)//'.chk.', names)
    highest = 0
    do k = 1, size(names)
      highest = max(highest, number_in(names(k)%s, name_of(self%stem)))
    end do
    do number = 1, highest
      if (file_exists(older_path(self, number))) &
        call append_string(candidates, older_path(self, number))
    end do
  end subroutine list_candidates

  !> Open a checkpoint for reading: whole, and of this program. Another deck hash is no fault: the
  !! caller may warn (info%deck_hash against its own).
  subroutine open_checkpoint(self, path, file, info, errors)
    class(checkpoint_type), intent(in) :: self
    character(len=*), intent(in) :: path
    type(h5_file_type), intent(inout) :: file
    type(checkpoint_info_type), intent(inout) :: info
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: attributes
    integer(i4) :: complete

    complete = 0
    info%path = path
    call file%open(path, errors, format=format)
    if (.not. file%is_open()) return
    if (.not. file%checked) then
      call errors%add('S015', "checkpoint '"//path//"' has no checksum: it is of another "// &
                      'program or of an older version', path, &
                      'restart with the version that wrote it, or start from the beginning')
      call file%close(errors)
      return
    end if
    file%bounded = .true.
    call file%attr_get('/', 'complete', complete, attributes)
    info%complete = complete == 1
    call file%attr_get('/', 'program', info%program, attributes)
    call file%attr_get('/', 'version', info%version, attributes)
    call file%attr_get('/', 'deck_hash', info%deck_hash, attributes)
    call file%attr_get('/', 'tag', info%tag, attributes)
    call file%attr_get('/', 'time', info%time, attributes)
    call file%attr_get('/', 'step', info%step, attributes)
    if (.not. info%complete .or. attributes%any()) then
      call errors%add('S011', "checkpoint '"//path//"' is not complete", path, &
                      'take an older one: --restart=auto finds the newest whole one')
    else if (info%step < 0 .or. info%step > most_steps .or. info%time < 0.0_wp) then
      call errors%add('I006', "checkpoint '"//path//"' is of step "//str(info%step)//' at '// &
                      str(info%time)//' s, which no run reaches', path//':/@step', &
                      'the file is damaged or was changed: use an older one')
    else if (info%program /= self%program) then
      call errors%add('S012', "checkpoint '"//path//"' is of "//info%program//', not of '// &
                      self%program, path, 'each program continues from its own checkpoint')
    else
      return
    end if
    call file%close(errors)
  end subroutine open_checkpoint
end module talus_checkpoint
