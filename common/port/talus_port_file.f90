!> hdf5 transport of the port: one file a message, written under a temporary name and renamed.
!!
!! In the folder of the port are couple.run (whose it is), SIDE.port (made by talus-couple, removed
!! by the solver), SIDE.joined, the heartbeats SIDE.beat and couple.beat, and
!! SIDE.NNNNNNNN.request.h5 / .reply.h5. It works across hosts on a shared file system; for an
!! exchange in every sub-step it is slow.
module talus_port_file
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_double, c_null_char
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_message_buffer, only: message_buffer_type
  use talus_message_file, only: write_message_file, read_message_file
  use talus_c_text, only: text_of
  use talus_port_remains, only: watch_asker
  use talus_system, only: system_error_text
  use talus_partner, only: own_pid, own_place, own_start, now, other_run_hint, &
    report_stranger
  implicit none
  private
  public :: file_port_type, read_lines, write_lines, remove_file

  real(wp), parameter :: beat_every = 0.25_wp  !! s between two writings of the heartbeat file
  real(wp), parameter :: folder_limit = 2.0_wp !! s for which the folder may be out of reach
  integer, parameter :: room = 1024
  character(len=*), parameter :: first_line = 'talus-port 1'

  !> One end of a port made of files.
  type :: file_port_type
    character(len=:), allocatable :: run_id
    logical, private :: stranger = .false.  !! the other side has not proved the run id
    character(len=:), allocatable, private :: folder, side, stem
    logical, private :: asks = .false., trace = .false.
    integer(i8), private :: due = 1       !! sequence of the message to read next
    integer(i8), private :: beats = 0
    real(wp), private :: beaten = -1.0_wp !! time of the last writing, s
    logical, private :: waits = .false.   !! our heartbeat file says that we wait
    integer, private :: trouble = 0       !! system error that kept the last beat from the folder
    real(wp), private :: reached = 0.0_wp !! time of the last beat that was written, s
    integer(i4), private :: ask_pid = 0
    character(len=:), allocatable, private :: ask_place
  contains
    procedure :: create => file_create
    procedure :: connect => file_connect
    procedure :: push => file_push
    procedure :: pull => file_pull
    procedure :: arrived => file_arrived
    procedure :: partner => file_partner
    procedure :: partner_beat => file_partner_beat
    procedure :: inspect => file_inspect
    procedure :: watch => file_watch
    procedure :: beat => file_beat
    procedure :: close => file_close
  end type file_port_type

  interface
    function c_wait(path, slice) result(there) bind(c, name='talus_file_wait')
      import :: c_char, c_int, c_double
      character(kind=c_char), intent(in) :: path(*)
      real(c_double), value :: slice
      integer(c_int) :: there
    end function c_wait
    function c_write(path, text) result(code) bind(c, name='talus_file_write')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*), text(*)
      integer(c_int) :: code
    end function c_write
    function c_read(path, text, room) result(bytes) bind(c, name='talus_file_read')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int), value :: room
      integer(c_int) :: bytes
    end function c_read
    function c_publish(temporary, path) result(code) bind(c, name='talus_file_publish')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: temporary(*), path(*)
      integer(c_int) :: code
    end function c_publish
    subroutine c_remove(path) bind(c, name='talus_file_remove')
      import :: c_char
      character(kind=c_char), intent(in) :: path(*)
    end subroutine c_remove
    function c_make_folder(path) result(code) bind(c, name='talus_file_make_folder')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int) :: code
    end function c_make_folder
    subroutine c_clear(folder, prefix, keep_messages) bind(c, name='talus_file_clear')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: folder(*), prefix(*)
      integer(c_int), value :: keep_messages
    end subroutine c_clear
    subroutine c_remove_folder(path) bind(c, name='talus_file_remove_folder')
      import :: c_char
      character(kind=c_char), intent(in) :: path(*)
    end subroutine c_remove_folder
  end interface

contains

  subroutine set_names(self, path)
    class(file_port_type), intent(inout) :: self
    character(len=*), intent(in) :: path  !! FOLDER/SIDE
    integer :: slash
    slash = index(path, '/', back=.true.)
    self%folder = path(:slash - 1)
    self%side = path(slash + 1:)
    self%stem = path
    self%due = 1
    self%beats = 0
    self%beaten = -1.0_wp
    self%waits = .false.
    self%trouble = 0
  end subroutine set_names

  !> Make the folder, remove what an earlier run left for this side, and offer the port.
  subroutine file_create(self, path, run_id, trace, errors)
    class(file_port_type), intent(inout) :: self
    character(len=*), intent(in) :: path, run_id
    logical, intent(in) :: trace
    type(error_list_type), intent(inout) :: errors
    integer(c_int) :: code
    character(len=1), parameter :: nl = new_line('a')

    call set_names(self, path)
    self%asks = .true.
    self%trace = trace
    self%run_id = run_id
    code = c_make_folder(self%folder//c_null_char)
    if (code == 0) then
      call c_clear(self%folder//c_null_char, self%side//'.'//c_null_char, 0_c_int)
      code = c_write(self%folder//'/couple.run'//c_null_char, 'talus-run 1'//nl//own_place()// &
                     nl//str(own_pid())//nl//str(own_start())//nl// &
                     merge('1', '0', trace)//nl//c_null_char)
      call self%beat()
      if (code == 0) code = c_write(self%stem//'.port'//c_null_char, &
                     first_line//nl//run_id//nl//own_place()//nl//str(own_pid())//nl// &
                     str(trace)//nl//c_null_char)
    end if
    if (code /= 0) &
      call errors%add('P018', 'the port''s folder cannot be written (system error '// &
                      str(code)//')', self%folder, 'a writable folder that both sides see')
  end subroutine file_create

  !> Try to join; `absent` when the port is not offered yet.
  subroutine file_connect(self, path, run_id, absent, errors)
    class(file_port_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: run_id  !! as this program was told, empty if it was not
    logical, intent(out) :: absent
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: line(:)
    integer :: stat
    integer(c_int) :: code

    absent = c_wait(path//'.port'//c_null_char, 0.01_wp) == 0
    if (absent) return
    call set_names(self, path)
    self%asks = .false.
    call read_lines(path//'.port', line)
    stat = 1
    if (size(line) == 5) then
      if (line(1)%s == first_line) read (line(4)%s, *, iostat=stat) self%ask_pid
    end if
    if (stat /= 0) then
      call errors%add('P005', 'the port file is not of this version of Talus', path//'.port', &
                      'use programs with the same version of the port')
      return
    end if
    self%run_id = line(2)%s
    if (run_id /= '' .and. run_id /= self%run_id) then
      call errors%add('P027', 'the port file is not of the run '//run_id, path//'.port', &
                      other_run_hint)
      return
    end if
    self%ask_place = line(3)%s
    self%trace = line(5)%s == 'true'
    call c_remove(path//'.port'//c_null_char)
    call self%beat()
    code = c_write(path//'.joined'//c_null_char, own_place()//new_line('a')//str(own_pid())// &
                   new_line('a')//self%run_id//new_line('a')//c_null_char)
    if (code /= 0) &
      call errors%add('P018', 'the port''s folder cannot be written (system error '// &
                      str(code)//')', self%folder, 'a writable folder that both sides see')
  end subroutine file_connect

  !> Write a small text file under a temporary name and rename it; 0 or the system's error number.
  integer function write_lines(path, text)
    character(len=*), intent(in) :: path, text
    write_lines = c_write(path//c_null_char, text//c_null_char)
  end function write_lines

  subroutine remove_file(path)
    character(len=*), intent(in) :: path
    call c_remove(path//c_null_char)
  end subroutine remove_file

  !> The lines of a small text file; none when it is not there.
  subroutine read_lines(path, line)
    character(len=*), intent(in) :: path
    type(string_type), allocatable, intent(out) :: line(:)
    character(kind=c_char) :: buffer(room)
    character(len=:), allocatable :: text
    integer :: first, length

    allocate (line(0))
    if (c_read(path//c_null_char, buffer, int(room, c_int)) <= 0) return
    text = text_of(buffer)
    first = 1
    do
      length = index(text(first:), new_line('a')) - 1
      if (length < 0) exit
      call append_string(line, text(first:first + length - 1))
      first = first + length + 1
    end do
  end subroutine read_lines

  pure function message_path(self, sequence, request) result(path)
    class(file_port_type), intent(in) :: self
    integer(i8), intent(in) :: sequence
    logical, intent(in) :: request
    character(len=:), allocatable :: path
    character(len=20) :: number
    write (number, '(i0.8)') sequence
    path = self%stem//'.'//trim(number)//trim(merge('.request.h5', '.reply.h5  ', request))
  end function message_path

  !> Write a sealed message and give it its name.
  subroutine file_push(self, message, errors)
    class(file_port_type), intent(inout) :: self
    class(message_buffer_type), intent(in) :: message
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: path, failed
    integer(c_int) :: code

    path = message_path(self, message%sequence, self%asks)
    call write_message_file(path//'.tmp', message, failed)
    if (failed == '') then
      code = c_publish(path//'.tmp'//c_null_char, path//c_null_char)
      if (code /= 0) failed = 'its name (system error '//str(code)//')'
    end if
    if (failed /= '') then
      call c_remove(path//'.tmp'//c_null_char)
      call errors%add('P018', 'the message file '//path//' cannot be written: '//failed, path, &
                      'is the disk full, or the folder removed?')
    end if
    call self%beat()
  end subroutine file_push

  !> Read the message that is due, when it is there; `words` > 0 then.
  subroutine file_pull(self, message, slice, words, errors)
    class(file_port_type), intent(inout) :: self
    class(message_buffer_type), intent(inout) :: message
    real(wp), intent(in) :: slice  !! s
    integer(i8), intent(out) :: words
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: path, failed

    words = 0
    path = message_path(self, self%due, .not. self%asks)
    if (c_wait(path//c_null_char, slice) == 0) return
    call read_message_file(path, message, failed)
    if (failed /= '') then
      call errors%add('P019', 'the message file '//path//' cannot be read: '//failed, path, &
                      'the file is damaged, or of another program')
      return
    end if
    words = message%used
    self%due = self%due + 1
    if (self%waits) then
      self%beaten = -1.0_wp
      call self%beat()
    end if
    if (.not. self%trace) call c_remove(path//c_null_char)
  end subroutine file_pull

  logical function file_arrived(self)
    class(file_port_type), intent(in) :: self
    file_arrived = c_wait(message_path(self, self%due, .not. self%asks)//c_null_char, 0.0_wp) /= 0
  end function file_arrived

  !> Who has joined on the other side: process number (0 none, or a stranger) and place.
  subroutine file_partner(self, pid, place)
    class(file_port_type), intent(inout) :: self
    integer(i4), intent(out) :: pid
    character(len=:), allocatable, intent(out) :: place
    type(string_type), allocatable :: line(:)
    integer :: stat

    pid = 0
    place = ''
    if (.not. self%asks) then
      pid = self%ask_pid
      place = self%ask_place
      return
    end if
    call read_lines(self%stem//'.joined', line)
    if (size(line) < 2) return
    self%stranger = size(line) < 3
    if (.not. self%stranger) self%stranger = line(3)%s /= self%run_id
    if (self%stranger) return
    read (line(2)%s, *, iostat=stat) pid
    if (stat /= 0) pid = 0
    place = line(1)%s
  end subroutine file_partner

  !> Heartbeat word of the other side, 0 before its first beat; whether it says that it waits.
  subroutine file_partner_beat(self, beats, waits)
    class(file_port_type), intent(in) :: self
    integer(i8), intent(out) :: beats
    logical, intent(out) :: waits
    type(string_type), allocatable :: line(:)
    integer :: stat

    beats = 0
    waits = .false.
    if (self%asks) then
      call read_lines(self%stem//'.beat', line)
    else
      call read_lines(self%folder//'/couple.beat', line)
    end if
    if (size(line) == 0) return
    read (line(1)%s, *, iostat=stat) beats
    if (stat /= 0) beats = 0
    if (size(line) > 1) waits = line(2)%s == 'waits'
  end subroutine file_partner_beat

  !> Write the heartbeat file, at most every quarter of a second, and whether this solver waits;
  !! talus-couple, with one heartbeat for both sides, never says so.
  subroutine file_beat(self, waits)
    class(file_port_type), intent(inout) :: self
    logical, intent(in), optional :: waits
    character(len=:), allocatable :: path
    real(wp) :: t
    integer(c_int) :: code

    t = now()
    if (self%beaten >= 0.0_wp .and. t - self%beaten < beat_every) return
    self%beaten = t
    self%beats = self%beats + 1
    path = self%stem//'.beat'
    if (self%asks) path = self%folder//'/couple.beat'
    self%waits = .false.
    if (present(waits)) self%waits = waits .and. .not. self%asks
    code = c_write(path//c_null_char, str(self%beats)//new_line('a')// &
                   merge('waits', 'works', self%waits)//new_line('a')//c_null_char)
    if (code == 0) self%reached = t
    self%trouble = code
  end subroutine file_beat

  !> P025 when the folder has been out of reach for so long that it will not come back, P027 when a
  !! stranger has joined.
  subroutine file_inspect(self, partner, errors)
    class(file_port_type), intent(in) :: self
    character(len=*), intent(in) :: partner  !! its title
    type(error_list_type), intent(inout) :: errors
    if (self%stranger) call report_stranger(partner, errors)
    if (self%trouble == 0 .or. now() - self%reached < folder_limit) return
    call errors%add('P025', 'the port''s folder cannot be reached any more ('// &
                    system_error_text(self%trouble)//')', self%folder, &
                    'it was removed, or its file system is full or gone')
  end subroutine file_inspect

  !> Solver: watch talus-couple's process, which is on this machine; once it has ended the folder is
  !! removed.
  subroutine file_watch(self)
    class(file_port_type), intent(in) :: self
    call watch_asker(self%ask_pid, '', self%folder, self%trace)
  end subroutine file_watch

  !> Leave; talus-couple, or the last side when it has ended, removes the files.
  subroutine file_close(self, last)
    class(file_port_type), intent(inout) :: self
    logical, intent(in) :: last
    integer(c_int) :: keep

    if (.not. allocated(self%folder)) return
    if (self%asks .or. last) then
      keep = merge(1_c_int, 0_c_int, self%trace)
      call c_clear(self%folder//c_null_char, self%side//'.'//c_null_char, keep)
      call c_remove(self%folder//'/couple.beat'//c_null_char)
      call c_remove(self%folder//'/couple.run'//c_null_char)
      call c_remove_folder(self%folder//c_null_char)
    else
      call c_remove(self%stem//'.beat'//c_null_char)
    end if
    deallocate (self%folder)
  end subroutine file_close
end module talus_port_file
