!> Shared memory transport of the port (talus_port_shm.c holds the segment and all atomics).
module talus_port_shm
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_double, c_ptr, c_null_ptr, &
    c_null_char, c_associated
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message_buffer, only: message_buffer_type, longest_message
  use talus_c_text, only: text_of
  use talus_partner, only: own_place, own_host, other_run_hint, report_stranger
  implicit none
  private
  public :: shm_port_type

  integer(i8), parameter :: slot_bytes = 2_i8**22  !! of each direction; longer messages in chunks
  integer(c_int), parameter :: stage_open = 1, stage_space = 2, stage_map = 3, stage_lock = 4
  integer(c_int), parameter :: stage_absent = 5, stage_foreign = 6, stage_damaged = 7, &
    stage_run = 8
  integer, parameter :: room = 128
  character(len=*), parameter :: damage_hint = 'memory fault, or a foreign program; '// &
    'the last checkpoint is valid'

  !> One end of a segment.
  type :: shm_port_type
    type(c_ptr), private :: handle = c_null_ptr
    integer(c_int64_t), private :: sent = 0                 !! bytes of the message sent so far
    integer(c_int64_t), private :: total = 0, received = 0  !! bytes of the message coming in
  contains
    procedure :: create => shm_create
    procedure :: connect => shm_connect
    procedure :: push => shm_push
    procedure :: pull => shm_pull
    procedure :: arrived => shm_arrived
    procedure :: partner => shm_partner
    procedure :: partner_beat => shm_partner_beat
    procedure :: partner_gone => shm_partner_gone
    procedure :: partner_waits => shm_partner_waits
    procedure :: inspect => shm_inspect
    procedure :: run_id => shm_run_id
    procedure :: beat => shm_beat
    procedure :: close => shm_close
  end type shm_port_type

  interface
    function c_create(name, slot, run_id, place, host, stage, code) result(handle) &
      bind(c, name='talus_shm_create')
      import :: c_char, c_int, c_int64_t, c_ptr
      character(kind=c_char), intent(in) :: name(*), run_id(*), place(*), host(*)
      integer(c_int64_t), value :: slot
      integer(c_int), intent(out) :: stage, code
      type(c_ptr) :: handle
    end function c_create
    function c_connect(name, run_id, place, host, stage, code) result(handle) &
      bind(c, name='talus_shm_connect')
      import :: c_char, c_int, c_ptr
      character(kind=c_char), intent(in) :: name(*), run_id(*), place(*), host(*)
      integer(c_int), intent(out) :: stage, code
      type(c_ptr) :: handle
    end function c_connect
    function c_write(handle, from, total, done, slice) result(state) &
      bind(c, name='talus_shm_write')
      import :: c_int, c_int64_t, c_double, c_ptr
      type(c_ptr), value :: handle
      integer(c_int64_t), intent(in) :: from(*)
      integer(c_int64_t), value :: total
      integer(c_int64_t), intent(inout) :: done
      real(c_double), value :: slice
      integer(c_int) :: state
    end function c_write
    function c_incoming(handle, slice) result(bytes) bind(c, name='talus_shm_incoming')
      import :: c_int64_t, c_double, c_ptr
      type(c_ptr), value :: handle
      real(c_double), value :: slice
      integer(c_int64_t) :: bytes
    end function c_incoming
    function c_read(handle, to, total, done, slice) result(state) bind(c, name='talus_shm_read')
      import :: c_int, c_int64_t, c_double, c_ptr
      type(c_ptr), value :: handle
      integer(c_int64_t), intent(inout) :: to(*)
      integer(c_int64_t), value :: total
      integer(c_int64_t), intent(inout) :: done
      real(c_double), value :: slice
      integer(c_int) :: state
    end function c_read
    function c_partner(handle, place, host, room) result(pid) bind(c, name='talus_shm_partner')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: handle
      character(kind=c_char), intent(inout) :: place(*), host(*)
      integer(c_int), value :: room
      integer(c_int) :: pid
    end function c_partner
    function c_partner_beat(handle) result(beat) bind(c, name='talus_shm_partner_beat')
      import :: c_int64_t, c_ptr
      type(c_ptr), value :: handle
      integer(c_int64_t) :: beat
    end function c_partner_beat
    function c_partner_gone(handle) result(gone) bind(c, name='talus_shm_partner_gone')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle
      integer(c_int) :: gone
    end function c_partner_gone
    function c_partner_waits(handle) result(slept) bind(c, name='talus_shm_partner_waits')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle
      integer(c_int) :: slept
    end function c_partner_waits
    function c_damage(handle, text, room) result(damaged) bind(c, name='talus_shm_damage')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: handle
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int), value :: room
      integer(c_int) :: damaged
    end function c_damage
    function c_stranger(handle) result(stranger) bind(c, name='talus_shm_stranger')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle
      integer(c_int) :: stranger
    end function c_stranger
    subroutine c_run_id(handle, text, room) bind(c, name='talus_shm_run_id')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: handle
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int), value :: room
    end subroutine c_run_id
    subroutine c_beat(handle) bind(c, name='talus_shm_beat')
      import :: c_ptr
      type(c_ptr), value :: handle
    end subroutine c_beat
    subroutine c_close(handle) bind(c, name='talus_shm_close')
      import :: c_ptr
      type(c_ptr), value :: handle
    end subroutine c_close
  end interface

contains

  !> Make the segment; a full /dev/shm fails here.
  subroutine shm_create(self, name, run_id, errors)
    class(shm_port_type), intent(inout) :: self
    character(len=*), intent(in) :: name  !! '/talus-...'
    character(len=*), intent(in) :: run_id
    type(error_list_type), intent(inout) :: errors
    integer(c_int) :: stage, code

    self%handle = c_create(name//c_null_char, slot_bytes, run_id//c_null_char, &
                           own_place()//c_null_char, own_host()//c_null_char, stage, code)
    if (c_associated(self%handle)) return
    select case (stage)
    case (stage_space)
      call errors%add('P015', 'no room in shared memory: '//str(2*slot_bytes/1024/1024)// &
                      ' MiB are needed (system error '//str(code)//')', '/dev/shm'//name, &
                      'free space in /dev/shm, or use transport = ''hdf5''')
    case default
      call errors%add('P015', 'the shared memory segment cannot be made (system error '// &
                      str(code)//', stage '//str(stage)//')', '/dev/shm'//name, &
                      'another run may use the name; else use transport = ''hdf5''')
    end select
  end subroutine shm_create

  !> Try to join the segment; `absent` when it is not there yet.
  subroutine shm_connect(self, name, run_id, absent, errors)
    class(shm_port_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: run_id  !! as this program was told, empty if it was not
    logical, intent(out) :: absent
    type(error_list_type), intent(inout) :: errors
    integer(c_int) :: stage, code

    self%handle = c_connect(name//c_null_char, run_id//c_null_char, own_place()//c_null_char, &
                            own_host()//c_null_char, stage, code)
    absent = stage == stage_absent
    if (c_associated(self%handle) .or. absent) return
    select case (stage)
    case (stage_foreign)
      call errors%add('P005', 'the shared memory segment is not of this version of Talus', &
                      '/dev/shm'//name, 'use programs with the same version of the port')
    case (stage_damaged)
      call errors%add('P023', 'the head of the shared memory segment is damaged', &
                      '/dev/shm'//name, damage_hint)
    case (stage_run)
      call errors%add('P027', 'the shared memory segment is not of the run '//run_id, &
                      '/dev/shm'//name, other_run_hint)
    case (stage_lock)
      call errors%add('P016', 'another process has already joined this port', '/dev/shm'//name, &
                      'one solver a port; a solver on several ranks uses rank 0 only')
    case default
      call errors%add('P016', 'the shared memory segment cannot be opened (system error '// &
                      str(code)//', stage '//str(stage)//')', '/dev/shm'//name, &
                      'both sides must run as the same user')
    end select
  end subroutine shm_connect

  !> Send on; `finished` when the whole message is in the segment.
  subroutine shm_push(self, message, slice, finished)
    class(shm_port_type), intent(inout) :: self
    class(message_buffer_type), intent(in) :: message
    real(wp), intent(in) :: slice  !! s
    logical, intent(out) :: finished
    finished = c_write(self%handle, message%word, 8*message%used, self%sent, slice) == 0
    if (finished) self%sent = 0
  end subroutine shm_push

  !> Receive on; `words` > 0 when a whole message is here, -1 when it is damaged.
  subroutine shm_pull(self, message, slice, words)
    class(shm_port_type), intent(inout) :: self
    class(message_buffer_type), intent(inout) :: message
    real(wp), intent(in) :: slice  !! s
    integer(i8), intent(out) :: words
    integer(c_int) :: state

    words = 0
    if (self%total == 0) then
      self%total = c_incoming(self%handle, slice)
      if (self%total == 0) return
      self%received = 0
      if (self%total < 8 .or. self%total > 8*longest_message) then
        words = -1
        return
      end if
      call message%reserve((self%total + 7)/8)
    end if
    state = c_read(self%handle, message%word, self%total, self%received, slice)
    if (state == 1) return
    words = merge((self%total + 7)/8, -1_i8, state == 0)
    self%total = 0
  end subroutine shm_pull

  !> Whether something waits to be read.
  logical function shm_arrived(self)
    class(shm_port_type), intent(in) :: self
    shm_arrived = c_incoming(self%handle, 0.0_wp) /= 0
  end function shm_arrived

  !> Who has joined on the other side: process number (0 none) and place.
  subroutine shm_partner(self, pid, place)
    class(shm_port_type), intent(in) :: self
    integer(i4), intent(out) :: pid
    character(len=:), allocatable, intent(out) :: place
    character(kind=c_char) :: place_text(room), host_text(room)

    place = ''
    pid = c_partner(self%handle, place_text, host_text, int(room, c_int))
    if (pid > 0) place = text_of(place_text)
  end subroutine shm_partner

  integer(i8) function shm_partner_beat(self)
    class(shm_port_type), intent(in) :: self
    shm_partner_beat = c_partner_beat(self%handle)
  end function shm_partner_beat

  !> Whether the other side had joined and its process has ended.
  logical function shm_partner_gone(self)
    class(shm_port_type), intent(in) :: self
    shm_partner_gone = c_partner_gone(self%handle) /= 0
  end function shm_partner_gone

  !> How often the other side has slept while it waits for a message; -1 when it does not wait.
  integer(i8) function shm_partner_waits(self)
    class(shm_port_type), intent(in) :: self
    shm_partner_waits = c_partner_waits(self%handle)
  end function shm_partner_waits

  !> P023 when a control word of the segment was found damaged, P027 when a stranger has joined.
  subroutine shm_inspect(self, partner, errors)
    class(shm_port_type), intent(in) :: self
    character(len=*), intent(in) :: partner  !! its title
    type(error_list_type), intent(inout) :: errors
    character(kind=c_char) :: text(room)
    if (c_damage(self%handle, text, int(room, c_int)) /= 0) &
      call errors%add('P023', partner//': a control word of the shared memory is damaged: '// &
                      text_of(text), '', damage_hint)
    if (c_stranger(self%handle) /= 0) call report_stranger(partner, errors)
  end subroutine shm_inspect

  function shm_run_id(self) result(run_id)
    class(shm_port_type), intent(in) :: self
    character(len=:), allocatable :: run_id
    character(kind=c_char) :: text(room)
    call c_run_id(self%handle, text, int(room, c_int))
    run_id = text_of(text)
  end function shm_run_id

  subroutine shm_beat(self)
    class(shm_port_type), intent(in) :: self
    call c_beat(self%handle)
  end subroutine shm_beat

  subroutine shm_close(self)
    class(shm_port_type), intent(inout) :: self
    if (c_associated(self%handle)) call c_close(self%handle)
    self%handle = c_null_ptr
    self%total = 0
    self%sent = 0
  end subroutine shm_close
end module talus_port_shm
