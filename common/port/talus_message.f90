!> Messages of the exchange port: put named fields in, get named fields out.
!!
!! `call m%start(verb, step, t0, t1)`, then `put`, `put_int`, `put_text`; the receiver uses `get`,
!! `get_int`, `get_text` into arrays whose shape must agree, or `take`, `take_int` into allocatables
!! that take the shape of the field; `all_read` or `expect` finds unknown fields.
module talus_message
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_verbs, only: verb_hello, verb_describe, verb_select, verb_set, verb_ready, &
    verb_advance, verb_solve, verb_force, verb_kick_drift, verb_accept, verb_reject, &
    verb_checkpoint, verb_write, verb_stop, verb_abort, verb_wake, verb_sleep, verb_relax, verb_name
  use talus_message_buffer, only: message_buffer_type, field_type, copy_bytes, text_to_words, &
    words_to_text, kind_real, kind_integer, kind_text, protocol_version, name_length
  use talus_port_names, only: field_error_code, field_error_hint, field_error_message, &
    field_error_place
  implicit none
  private
  public :: message_type, protocol_version, name_length, verb_name
  public :: verb_hello, verb_describe, verb_select, verb_set, verb_ready
  public :: verb_advance, verb_solve, verb_force, verb_kick_drift, verb_accept, verb_reject
  public :: verb_checkpoint, verb_write, verb_stop, verb_abort, verb_wake, verb_sleep, verb_relax

  !> One request or reply. Reuse the same variable: its buffers are kept.
  type, extends(message_buffer_type) :: message_type
  contains
    procedure :: answer
    procedure, private :: put_scalar, put_vector, put_matrix
    procedure, private :: put_int_scalar, put_int_vector, put_int_matrix
    procedure, private :: put_i4_scalar, put_i4_vector, put_i4_matrix
    procedure, private :: get_scalar, get_vector, get_matrix, take_vector, take_matrix
    procedure, private :: get_int_scalar, get_int_vector, get_int_matrix
    procedure, private :: get_i4_scalar, get_i4_vector, get_i4_matrix
    procedure, private :: take_int_vector, take_int_matrix, take_i4_vector, take_i4_matrix
    generic :: put => put_scalar, put_vector, put_matrix
    generic :: put_int => put_int_scalar, put_int_vector, put_int_matrix, &
      put_i4_scalar, put_i4_vector, put_i4_matrix
    generic :: get => get_scalar, get_vector, get_matrix
    generic :: take => take_vector, take_matrix
    generic :: get_int => get_int_scalar, get_int_vector, get_int_matrix, &
      get_i4_scalar, get_i4_vector, get_i4_matrix
    generic :: take_int => take_int_vector, take_int_matrix, take_i4_vector, take_i4_matrix
    procedure :: put_text
    procedure :: get_text
    procedure :: fail_with
    procedure :: faults
  end type message_type

contains

  !> Begin the reply to a request: same verb, step and times.
  subroutine answer(self, request)
    class(message_type), intent(inout) :: self
    class(message_buffer_type), intent(in) :: request
    call self%start(request%verb, request%step, request%t0, request%t1)
  end subroutine answer

  subroutine put_scalar(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value
    integer(i8) :: at
    call self%add_field(name, kind_real, 1_i8, 1_i8, at)
    self%word(at) = transfer(value, 0_i8)
  end subroutine put_scalar

  subroutine put_vector(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous :: value(:)
    integer(i8) :: at
    call self%add_field(name, kind_real, 1_i8, size(value, kind=i8), at)
    if (size(value) > 0) call copy_bytes(self%word(at:), value, 8*size(value, kind=i8))
  end subroutine put_vector

  subroutine put_matrix(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous :: value(:, :)  !! (components, count)
    integer(i8) :: at
    call self%add_field(name, kind_real, size(value, 1, i8), size(value, 2, i8), at)
    if (size(value) > 0) call copy_bytes(self%word(at:), value, 8*size(value, kind=i8))
  end subroutine put_matrix

  subroutine put_int_scalar(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value
    integer(i8) :: at
    call self%add_field(name, kind_integer, 1_i8, 1_i8, at)
    self%word(at) = value
  end subroutine put_int_scalar

  subroutine put_int_vector(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value(:)
    integer(i8) :: at
    call self%add_field(name, kind_integer, 1_i8, size(value, kind=i8), at)
    self%word(at:at + size(value, kind=i8) - 1) = value
  end subroutine put_int_vector

  subroutine put_int_matrix(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value(:, :)  !! (components, count)
    integer(i8) :: at
    integer(i4) :: j
    call self%add_field(name, kind_integer, size(value, 1, i8), size(value, 2, i8), at)
    do j = 1, size(value, 2)
      self%word(at:at + size(value, 1, i8) - 1) = value(:, j)
      at = at + size(value, 1, i8)
    end do
  end subroutine put_int_matrix

  subroutine put_i4_scalar(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: value
    call self%put_int_scalar(name, int(value, i8))
  end subroutine put_i4_scalar

  subroutine put_i4_vector(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: value(:)
    integer(i8) :: at
    call self%add_field(name, kind_integer, 1_i8, size(value, kind=i8), at)
    self%word(at:at + size(value, kind=i8) - 1) = value
  end subroutine put_i4_vector

  subroutine put_i4_matrix(self, name, value)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: value(:, :)  !! (components, count)
    integer(i8) :: at
    integer(i4) :: j
    call self%add_field(name, kind_integer, size(value, 1, i8), size(value, 2, i8), at)
    do j = 1, size(value, 2)
      self%word(at:at + size(value, 1, i8) - 1) = value(:, j)
      at = at + size(value, 1, i8)
    end do
  end subroutine put_i4_matrix

  subroutine put_text(self, name, text)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name, text
    integer(i8) :: at
    call self%add_field(name, kind_text, 1_i8, len(text, i8), at)
    if (len(text) > 0) call text_to_words(self%word(at:), text, len(text, i8))
  end subroutine put_text

  !> Find a field of this kind and shape; field%at = 0 after a fault.
  subroutine find_shaped(self, name, kind, extent, field, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind
    integer(i8), intent(in) :: extent(2)
    type(field_type), intent(out) :: field
    type(error_list_type), intent(inout) :: errors

    call self%find_field(name, kind, field, errors)
    if (field%at == 0) return
    if (field%components == extent(1) .and. field%count == extent(2)) return
    call errors%add('P010', 'the field '''//trim(name)//''' is '//str(field%components)//' x '// &
                    str(field%count)//', '//str(extent(1))//' x '//str(extent(2))// &
                    ' is expected', self%place(), &
                    'components x count; the sets of both sides differ')
    field%at = 0
  end subroutine find_shaped

  subroutine get_scalar(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_real, [1_i8, 1_i8], field, errors)
    if (field%at > 0) value = transfer(self%word(field%at), 0.0_wp)
  end subroutine get_scalar

  subroutine get_vector(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout), contiguous :: value(:)
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_real, [1_i8, size(value, kind=i8)], field, errors)
    if (field%at > 0 .and. field%words > 0) &
      call copy_bytes(value, self%word(field%at:), 8*field%words)
  end subroutine get_vector

  subroutine get_matrix(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout), contiguous :: value(:, :)
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_real, shape(value, i8), field, errors)
    if (field%at > 0 .and. field%words > 0) &
      call copy_bytes(value, self%word(field%at:), 8*field%words)
  end subroutine get_matrix

  !> Take a real field of one component; `value` is reallocated only when its size differs.
  subroutine take_vector(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout), allocatable :: value(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: extent(2)
    extent = max(0_i8, self%shape(name))
    if (allocated(value)) then
      if (size(value, kind=i8) /= extent(2)) deallocate (value)
    end if
    if (.not. allocated(value)) allocate (value(extent(2)))
    call self%get_vector(name, value, errors)
  end subroutine take_vector

  !> Take a real field of any shape; `value` is reallocated only when its shape differs.
  subroutine take_matrix(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout), allocatable :: value(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: extent(2)
    extent = max(0_i8, self%shape(name))
    if (allocated(value)) then
      if (any(shape(value, i8) /= extent)) deallocate (value)
    end if
    if (.not. allocated(value)) allocate (value(extent(1), extent(2)))
    call self%get_matrix(name, value, errors)
  end subroutine take_matrix

  subroutine get_int_scalar(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_integer, [1_i8, 1_i8], field, errors)
    if (field%at > 0) value = self%word(field%at)
  end subroutine get_int_scalar

  subroutine get_int_vector(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout) :: value(:)
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_integer, [1_i8, size(value, kind=i8)], field, errors)
    if (field%at > 0) value = self%word(field%at:field%at + field%words - 1)
  end subroutine get_int_vector

  subroutine get_int_matrix(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout), contiguous :: value(:, :)
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_integer, shape(value, i8), field, errors)
    if (field%at > 0 .and. field%words > 0) &
      call copy_bytes(value, self%word(field%at:), 8*field%words)
  end subroutine get_int_matrix

  !> A 64-bit field as 32-bit indices; a value that does not fit is a fault.
  subroutine narrow(self, name, field, value, errors)
    class(message_type), intent(in) :: self
    character(len=*), intent(in) :: name
    type(field_type), intent(in) :: field
    integer(i4), intent(inout) :: value(field%words)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: k

    do k = 1, field%words
      if (abs(self%word(field%at + k - 1)) > huge(0_i4)) then
        call errors%add('P013', 'the field '''//trim(name)//''' holds '// &
                        str(self%word(field%at + k - 1))//', more than 32 bits', self%place(), &
                        'indices inside a program must stay below 2147483648')
        return
      end if
      value(k) = int(self%word(field%at + k - 1), i4)
    end do
  end subroutine narrow

  subroutine get_i4_scalar(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: one(1)
    one = value
    call self%get_i4_vector(name, one, errors)
    value = one(1)
  end subroutine get_i4_scalar

  subroutine get_i4_vector(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout), contiguous :: value(:)
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_integer, [1_i8, size(value, kind=i8)], field, errors)
    if (field%at > 0) call narrow(self, name, field, value, errors)
  end subroutine get_i4_vector

  subroutine get_i4_matrix(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout), contiguous :: value(:, :)
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field
    call find_shaped(self, name, kind_integer, shape(value, i8), field, errors)
    if (field%at > 0) call narrow(self, name, field, value, errors)
  end subroutine get_i4_matrix

  subroutine take_int_vector(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout), allocatable :: value(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: extent(2)
    extent = max(0_i8, self%shape(name))
    if (allocated(value)) deallocate (value)
    allocate (value(extent(2)))
    call self%get_int_vector(name, value, errors)
  end subroutine take_int_vector

  subroutine take_int_matrix(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout), allocatable :: value(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: extent(2)
    extent = max(0_i8, self%shape(name))
    if (allocated(value)) deallocate (value)
    allocate (value(extent(1), extent(2)))
    call self%get_int_matrix(name, value, errors)
  end subroutine take_int_matrix

  subroutine take_i4_vector(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout), allocatable :: value(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: extent(2)
    extent = max(0_i8, self%shape(name))
    if (allocated(value)) deallocate (value)
    allocate (value(extent(2)))
    call self%get_i4_vector(name, value, errors)
  end subroutine take_i4_vector

  subroutine take_i4_matrix(self, name, value, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout), allocatable :: value(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: extent(2)
    extent = max(0_i8, self%shape(name))
    if (allocated(value)) deallocate (value)
    allocate (value(extent(1), extent(2)))
    call self%get_i4_matrix(name, value, errors)
  end subroutine take_i4_matrix

  subroutine get_text(self, name, text, errors)
    class(message_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(inout) :: text
    type(error_list_type), intent(inout) :: errors
    type(field_type) :: field

    call self%find_field(name, kind_text, field, errors)
    if (allocated(text)) deallocate (text)
    allocate (character(len=field%count) :: text)
    if (field%at == 0 .or. field%count == 0) return
    call words_to_text(text, self%word(field%at:), field%count)
  end subroutine get_text

  !> Turn this reply into a report of the first fault; its fields so far are dropped.
  subroutine fail_with(self, errors)
    class(message_type), intent(inout) :: self
    type(error_list_type), intent(in) :: errors
    character(len=:), allocatable :: more
    integer(i8) :: step
    real(wp) :: t0, t1

    if (.not. errors%any()) error stop 'bug: a reply can fail only with a fault'
    step = self%step
    t0 = self%t0
    t1 = self%t1
    call self%start(self%verb, step, t0, t1)
    self%status = errors%exit_code()
    more = ''
    if (errors%count > 1) more = ' (and '//str(errors%count - 1)//' more, see its log)'
    call self%put_text(field_error_code, errors%item(1)%code)
    call self%put_text(field_error_message, errors%item(1)%message//more)
    call self%put_text(field_error_place, errors%item(1)%place)
    call self%put_text(field_error_hint, errors%item(1)%hint)
  end subroutine fail_with

  !> Add the fault that a reply reports; nothing when its status is 0.
  subroutine faults(self, errors)
    class(message_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: code, message, place, hint

    if (self%status == 0) return
    call self%get_text(field_error_code, code, errors)
    call self%get_text(field_error_message, message, errors)
    call self%get_text(field_error_place, place, errors)
    call self%get_text(field_error_hint, hint, errors)
    if (len(code) /= 4) code = 'P014'
    call errors%add(code, message, place, hint)
  end subroutine faults
end module talus_message
