!> One port message as one contiguous buffer of 64-bit words: header, then field after field.
!!
!! Layout (manual/port.md): 16 header words; each field is 10 words of description (name of 48
!! characters, kind, components, count, data words) followed by its data. The buffer is kept between
!! messages: a message no longer than the longest before it allocates nothing.
module talus_message_buffer
  use, intrinsic :: iso_c_binding, only: c_char, c_int64_t
  use talus_kinds, only: wp, i4, i8
  use talus_crc64, only: crc64
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_port_names, only: protocol_version, name_length, header_words, description_words, &
    kind_real, kind_integer, kind_text
  use talus_verbs, only: verb_name, verb_first, verb_last
  implicit none
  private
  public :: message_buffer_type, copy_bytes, text_to_words, words_to_text
  public :: kind_real, kind_integer, kind_text, kind_name
  public :: protocol_version, name_length, header_words, description_words, longest_message

  integer(i8), parameter :: longest_message = 2_i8**37  !! words; a longer one is taken as damage

  !> The bytes 'TALUSMSG', read as a little-endian word.
  integer(i8), parameter, public :: message_magic = int(z'47534D53554C4154', i8)

  integer(i4), parameter :: at_magic = 1, at_protocol = 2, at_sequence = 3, at_verb = 4
  integer(i4), parameter :: at_step = 5, at_t0 = 6, at_t1 = 7, at_status = 8, at_fields = 9
  integer(i4), parameter :: at_words = 10, at_checksum = 11, at_waited = 12

  !> Place of a field in the buffer.
  type, public :: field_type
    character(len=name_length) :: name = ''
    integer(i4) :: kind = 0        !! kind_real, kind_integer or kind_text
    integer(i8) :: components = 0  !! first extent; 1 for scalars, vectors and text
    integer(i8) :: count = 0       !! second extent; bytes of a text
    integer(i8) :: at = 0          !! first data word
    integer(i8) :: words = 0       !! data words
    logical :: read = .false.      !! the receiver has read it
  end type field_type

  !> Header, buffer and index of fields. `word`, `used` and `field` are for the transports only.
  type :: message_buffer_type
    integer(i4) :: verb = 0      !! verb_* of talus_verbs
    integer(i4) :: status = 0    !! 0 good; else the exit code of the fault in the error.* fields
    integer(i8) :: step = 0      !! number of the coupled step
    integer(i8) :: sequence = 0  !! set by the port: same in request and reply
    real(wp) :: t0 = 0.0_wp      !! start of the interval, s
    real(wp) :: t1 = 0.0_wp      !! end of the interval, s
    real(wp) :: waited = 0.0_wp  !! of a reply: how long its sender waited for the request, s
    integer(i4) :: field_count = 0
    integer(i8) :: used = header_words
    integer(i8), allocatable :: word(:)
    type(field_type), allocatable :: field(:)
    integer(i4), private :: last = 0  !! field found last: the next search starts behind it
  contains
    procedure :: start
    procedure :: reserve
    procedure :: add_field
    procedure :: find_field
    procedure :: shape => field_shape
    procedure :: has
    procedure :: expect
    procedure :: all_read
    procedure :: seal
    procedure :: parse
    procedure :: place
  end type message_buffer_type

  interface
    subroutine copy_bytes(to, from, bytes) bind(c, name='talus_copy_bytes')
      import :: c_int64_t
      type(*), intent(inout) :: to(*)
      type(*), intent(in) :: from(*)
      integer(c_int64_t), value :: bytes
    end subroutine copy_bytes
    subroutine text_to_words(word, text, bytes) bind(c, name='talus_text_to_words')
      import :: c_char, c_int64_t
      integer(c_int64_t), intent(inout) :: word(*)
      character(kind=c_char), intent(in) :: text(*)
      integer(c_int64_t), value :: bytes
    end subroutine text_to_words
    subroutine words_to_text(text, word, bytes) bind(c, name='talus_words_to_text')
      import :: c_char, c_int64_t
      character(kind=c_char), intent(inout) :: text(*)
      integer(c_int64_t), intent(in) :: word(*)
      integer(c_int64_t), value :: bytes
    end subroutine words_to_text
  end interface

contains

  !> Begin a message: no fields, status 0; the buffers stay.
  subroutine start(self, verb, step, t0, t1)
    class(message_buffer_type), intent(inout) :: self
    integer(i4), intent(in) :: verb
    integer(i8), intent(in), optional :: step
    real(wp), intent(in), optional :: t0, t1  !! s

    self%verb = verb
    self%status = 0
    self%step = 0
    self%t0 = 0.0_wp
    self%t1 = 0.0_wp
    self%waited = 0.0_wp
    if (present(step)) self%step = step
    if (present(t0)) self%t0 = t0
    if (present(t1)) self%t1 = t1
    self%field_count = 0
    self%used = header_words
    self%last = 0
    call self%reserve(int(header_words, i8))
  end subroutine start

  !> Make room for so many words; the contents of the buffer are kept.
  subroutine reserve(self, words)
    class(message_buffer_type), intent(inout) :: self
    integer(i8), intent(in) :: words
    integer(i8), allocatable :: longer(:)
    integer(i8) :: n

    if (.not. allocated(self%word)) then
      allocate (self%word(max(words, 512_i8)))
    else if (size(self%word, kind=i8) < words) then
      n = size(self%word, kind=i8)
      allocate (longer(max(words, n + n/2)))
      longer(:n) = self%word
      call move_alloc(longer, self%word)
    end if
  end subroutine reserve

  !> Describe a new field and give the place of its data. The same name twice is a caller's bug.
  subroutine add_field(self, name, kind, components, count, at)
    class(message_buffer_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind
    integer(i8), intent(in) :: components, count
    integer(i8), intent(out) :: at  !! first data word
    type(field_type) :: field

    if (len_trim(name) > name_length) error stop 'bug: name of a message field is too long'
    if (position(self, name) > 0) error stop 'bug: message field is given twice'
    field%name = name
    field%kind = kind
    field%components = components
    field%count = count
    field%words = data_words(kind, components, count)
    at = self%used + description_words + 1
    field%at = at
    call self%reserve(at - 1 + field%words)
    call text_to_words(self%word(self%used + 1:), field%name, int(name_length, i8))
    self%word(self%used + 7:self%used + 10) = [int(kind, i8), components, count, field%words]
    if (field%words > 0) self%word(at + field%words - 1) = 0
    self%used = at - 1 + field%words
    call append_field(self, field)
  end subroutine add_field

  pure integer(i8) function data_words(kind, components, count)
    integer(i4), intent(in) :: kind
    integer(i8), intent(in) :: components, count
    data_words = components*count
    if (kind == kind_text) data_words = (count + 7)/8
  end function data_words

  subroutine append_field(self, field)
    class(message_buffer_type), intent(inout) :: self
    type(field_type), intent(in) :: field
    type(field_type), allocatable :: longer(:)

    if (.not. allocated(self%field)) allocate (self%field(32))
    if (self%field_count == size(self%field)) then
      allocate (longer(2*self%field_count))
      longer(:self%field_count) = self%field
      call move_alloc(longer, self%field)
    end if
    self%field_count = self%field_count + 1
    self%field(self%field_count) = field
  end subroutine append_field

  !> Index of a field, 0 when there is none. Fields are mostly read in their order.
  pure integer(i4) function position(self, name)
    class(message_buffer_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i4) :: k, j

    position = 0
    do k = 1, self%field_count
      j = self%last + k
      if (j > self%field_count) j = j - self%field_count
      if (self%field(j)%name /= name) cycle
      position = j
      exit
    end do
  end function position

  !> Find a field of this kind and mark it as read; at = 0 and a fault when it is not there.
  subroutine find_field(self, name, kind, field, errors)
    class(message_buffer_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind
    type(field_type), intent(out) :: field
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    k = position(self, name)
    if (k == 0) then
      call errors%add('P009', 'the field '''//trim(name)//''' is missing', self%place(), &
                      'both programs must use the same version of the port')
      return
    end if
    self%last = k
    self%field(k)%read = .true.
    if (self%field(k)%kind /= kind) then
      call errors%add('P011', 'the field '''//trim(name)//''' holds '// &
                      kind_name(self%field(k)%kind)//', '//kind_name(kind)//' are expected', &
                      self%place(), 'both programs must use the same version of the port')
      return
    end if
    field = self%field(k)
  end subroutine find_field

  !> Components and count of a field; [-1, -1] when it is not there.
  pure function field_shape(self, name) result(extent)
    class(message_buffer_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8) :: extent(2)
    integer(i4) :: k
    k = position(self, name)
    extent = -1
    if (k > 0) extent = [self%field(k)%components, self%field(k)%count]
  end function field_shape

  !> Whether the message holds the field (this does not count as reading it).
  pure logical function has(self, name)
    class(message_buffer_type), intent(in) :: self
    character(len=*), intent(in) :: name
    has = position(self, name) > 0
  end function has

  !> Fault for every field whose name is not in the list.
  subroutine expect(self, names, errors)
    class(message_buffer_type), intent(in) :: self
    character(len=*), intent(in) :: names(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, self%field_count
      if (.not. any(names == self%field(k)%name)) call unknown_field(self, k, errors)
    end do
  end subroutine expect

  !> Fault for every field that was not read (the error.* fields aside).
  subroutine all_read(self, errors)
    class(message_buffer_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, self%field_count
      if (self%field(k)%read .or. self%field(k)%name(:6) == 'error.') cycle
      call unknown_field(self, k, errors)
    end do
  end subroutine all_read

  subroutine unknown_field(self, k, errors)
    class(message_buffer_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    call errors%add('P012', 'the field '''//trim(self%field(k)%name)//''' is not known here', &
                    self%place(), 'both programs must use the same version of the port')
  end subroutine unknown_field

  !> Write the header; the message can then be sent.
  subroutine seal(self, sequence)
    class(message_buffer_type), intent(inout) :: self
    integer(i8), intent(in) :: sequence

    self%sequence = sequence
    self%word(:header_words) = 0
    self%word(at_magic) = message_magic
    self%word(at_protocol) = protocol_version
    self%word(at_sequence) = sequence
    self%word(at_verb) = self%verb
    self%word(at_step) = self%step
    self%word(at_t0) = transfer(self%t0, 0_i8)
    self%word(at_t1) = transfer(self%t1, 0_i8)
    self%word(at_waited) = transfer(self%waited, 0_i8)
    self%word(at_status) = self%status
    self%word(at_fields) = self%field_count
    self%word(at_words) = self%used
    self%word(at_checksum) = crc64(self%word, 8*self%used, 0_i8)
  end subroutine seal

  !> Read the header and the fields of `words` received words; every disagreement is a fault.
  subroutine parse(self, words, errors)
    class(message_buffer_type), intent(inout) :: self
    integer(i8), intent(in) :: words
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: sent

    call self%start(0)
    if (words < header_words) then
      call errors%add('P006', 'a message of '//str(8*words)//' bytes is shorter than its header', &
                      '', 'the partner does not implement this port')
    else if (self%word(at_magic) /= message_magic) then
      call errors%add('P005', 'what arrived at the port is no Talus message', '', &
                      'the partner does not implement this port')
    else if (self%word(at_protocol) /= protocol_version) then
      call errors%add('P005', 'the partner uses protocol '//str(self%word(at_protocol))// &
                      ', this program '//str(protocol_version), '', &
                      'use programs with the same version of the port')
    else if (self%word(at_words) /= words) then
      call errors%add('P006', 'a message of '//str(self%word(at_words))//' words arrived with '// &
                      str(words), '', 'the message is damaged')
    end if
    if (errors%any()) return
    call read_header(self)
    sent = self%word(at_checksum)
    self%word(at_checksum) = 0
    if (crc64(self%word, 8*words, 0_i8) /= sent) then
      call errors%add('P006', 'the checksum of a message is wrong', self%place(), &
                      'the message is damaged: memory or file system fault')
      return
    end if
    self%word(at_checksum) = sent
    call index_fields(self, words, errors)
  end subroutine parse

  subroutine read_header(self)
    class(message_buffer_type), intent(inout) :: self
    self%sequence = self%word(at_sequence)
    self%verb = -1
    if (self%word(at_verb) >= verb_first .and. self%word(at_verb) <= verb_last) &
      self%verb = int(self%word(at_verb), i4)
    self%step = self%word(at_step)
    self%t0 = transfer(self%word(at_t0), 0.0_wp)
    self%t1 = transfer(self%word(at_t1), 0.0_wp)
    self%waited = transfer(self%word(at_waited), 0.0_wp)
    self%status = int(min(self%word(at_status), int(huge(0_i4), i8)), i4)
  end subroutine read_header

  !> Loop over the field descriptions; a description that leaves the message is a fault.
  subroutine index_fields(self, words, errors)
    class(message_buffer_type), intent(inout) :: self
    integer(i8), intent(in) :: words
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    integer(i8) :: k, fields
    logical :: bad

    fields = self%word(at_fields)
    do k = 1, fields
      bad = self%used + description_words > words
      if (.not. bad) then
        call read_description(self, field)
        bad = field%kind < kind_real .or. field%kind > kind_text .or. field%components < 0 .or. &
              field%count < 0 .or. field%words < 0 .or. field%words > words - field%at + 1
      end if
      ! bounds first: a product of damaged numbers must not overflow
      if (.not. bad) bad = max(field%components, field%count) > 8*words
      if (.not. bad .and. field%count > 0) bad = field%components > 8*words/field%count
      if (.not. bad) bad = field%words /= data_words(field%kind, field%components, field%count)
      if (.not. bad) bad = position(self, field%name) > 0
      if (bad) exit
      self%used = field%at - 1 + field%words
      call append_field(self, field)
    end do
    if (self%field_count /= fields .or. self%used /= words) &
      call errors%add('P006', 'the description of field '//str(self%field_count + 1)//' of '// &
                      str(fields)//' is damaged', self%place(), &
                      'the partner does not implement this port')
  end subroutine index_fields

  subroutine read_description(self, field)
    class(message_buffer_type), intent(in) :: self
    type(field_type), intent(out) :: field
    integer(i8) :: word(4)
    call words_to_text(field%name, self%word(self%used + 1:), int(name_length, i8))
    word = self%word(self%used + 7:self%used + 10)
    field%kind = int(max(0_i8, min(word(1), 99_i8)), i4)
    field%components = word(2)
    field%count = word(3)
    field%words = word(4)
    field%at = self%used + description_words + 1
  end subroutine read_description

  !> Place of faults: 'message 12 (ADVANCE, step 3)'.
  pure function place(self) result(text)
    class(message_buffer_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = 'message '//str(self%sequence)//' ('//verb_name(self%verb)//', step '// &
           str(self%step)//')'
  end function place

  pure function kind_name(kind) result(name)
    integer(i4), intent(in) :: kind
    character(len=:), allocatable :: name
    select case (kind)
    case (kind_real)
      name = 'reals'
    case (kind_integer)
      name = 'integers'
    case (kind_text)
      name = 'characters'
    case default
      name = 'kind '//str(kind)
    end select
  end function kind_name
end module talus_message_buffer
