!> A small JSON writer: objects and arrays nested as they are opened, texts escaped, numbers that
!! read back unchanged; NaN and infinity, which JSON lacks, become null.
module talus_json
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: string_type, str, is_finite
  implicit none
  private
  public :: json_type, json_escape, utf8_bytes

  integer(i4), parameter :: deepest = 32          !! levels of nesting
  character(len=*), parameter :: newline = achar(10)

  !> A JSON text under construction.
  type :: json_type
    private
    character(len=:), allocatable :: buffer
    integer(i4) :: used = 0
    integer(i4) :: depth = 0
    logical :: first(0:deepest) = .true.          !! this level is still empty
    logical :: is_array(0:deepest) = .false.
  contains
    procedure :: begin => begin_object            !! call json%begin() or json%begin('name')
    procedure :: begin_array
    procedure :: end => end_level
    procedure :: text => json_text
    procedure :: put_null
    procedure, private :: put_text, put_real, put_i4, put_i8, put_logical
    procedure, private :: put_texts, put_reals, put_integers
    !> call json%put('name', value) in an object, json%put('', value) in an array.
    generic :: put => put_text, put_real, put_i4, put_i8, put_logical, put_texts, put_reals, &
      put_integers
    procedure, private :: key
    procedure, private :: write_raw
    procedure, private :: open_level
  end type json_type

contains

  !> Open an object: the whole text, a member of an object by name, or an item of an array.
  subroutine begin_object(self, name)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in), optional :: name
    call self%open_level('{', .false., name)
  end subroutine begin_object

  !> Open an array.
  subroutine begin_array(self, name)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in), optional :: name
    call self%open_level('[', .true., name)
  end subroutine begin_array

  subroutine open_level(self, bracket, is_array, name)
    class(json_type), intent(inout) :: self
    character(len=1), intent(in) :: bracket
    logical, intent(in) :: is_array
    character(len=*), intent(in), optional :: name

    if (self%depth == deepest) error stop 'bug: JSON nested too deeply'
    if (self%depth > 0) then
      if (present(name)) then
        call self%key(name)
      else
        call self%key('')
      end if
    end if
    call self%write_raw(bracket)
    self%depth = self%depth + 1
    self%first(self%depth) = .true.
    self%is_array(self%depth) = is_array
  end subroutine open_level

  !> Close the innermost object or array.
  subroutine end_level(self)
    class(json_type), intent(inout) :: self
    logical :: empty, array

    if (self%depth == 0) error stop 'bug: JSON level closed that was not open'
    empty = self%first(self%depth)
    array = self%is_array(self%depth)
    self%depth = self%depth - 1
    if (.not. empty) call self%write_raw(newline//repeat('  ', self%depth))
    call self%write_raw(merge(']', '}', array))
  end subroutine end_level

  !> The finished text, with a line feed at its end.
  pure function json_text(self) result(text)
    class(json_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (self%used > 0) text = self%buffer(:self%used)//newline
  end function json_text

  !> Comma, line and name before a value; the name is left out in arrays.
  subroutine key(self, name)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    if (.not. self%first(self%depth)) call self%write_raw(',')
    self%first(self%depth) = .false.
    call self%write_raw(newline//repeat('  ', self%depth))
    if (.not. self%is_array(self%depth)) call self%write_raw('"'//json_escape(name)//'": ')
  end subroutine key

  subroutine write_raw(self, text)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: longer

    if (.not. allocated(self%buffer)) allocate (character(len=1024) :: self%buffer)
    if (self%used + len(text) > len(self%buffer)) then
      allocate (character(len=2*(self%used + len(text))) :: longer)
      longer(:self%used) = self%buffer(:self%used)
      call move_alloc(longer, self%buffer)
    end if
    self%buffer(self%used + 1:self%used + len(text)) = text
    self%used = self%used + len(text)
  end subroutine write_raw

  subroutine put_null(self, name)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    call self%key(name)
    call self%write_raw('null')
  end subroutine put_null

  subroutine put_text(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name, value
    call self%key(name)
    call self%write_raw('"'//json_escape(value)//'"')
  end subroutine put_text

  subroutine put_real(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value
    call self%key(name)
    call self%write_raw(number(value))
  end subroutine put_real

  subroutine put_i4(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: value
    call self%key(name)
    call self%write_raw(str(value))
  end subroutine put_i4

  subroutine put_i8(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value
    call self%key(name)
    call self%write_raw(str(value))
  end subroutine put_i8

  subroutine put_logical(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical, intent(in) :: value
    call self%key(name)
    call self%write_raw(str(value))
  end subroutine put_logical

  subroutine put_texts(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(string_type), intent(in) :: value(:)
    integer(i4) :: k
    call self%key(name)
    call self%write_raw('[')
    do k = 1, size(value)
      if (k > 1) call self%write_raw(', ')
      call self%write_raw('"'//json_escape(value(k)%s)//'"')
    end do
    call self%write_raw(']')
  end subroutine put_texts

  subroutine put_reals(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value(:)
    integer(i4) :: k
    call self%key(name)
    call self%write_raw('[')
    do k = 1, size(value)
      if (k > 1) call self%write_raw(', ')
      call self%write_raw(number(value(k)))
    end do
    call self%write_raw(']')
  end subroutine put_reals

  subroutine put_integers(self, name, value)
    class(json_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: value(:)
    call self%key(name)
    call self%write_raw('['//str(value)//']')
  end subroutine put_integers

  pure function number(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = 'null'
    if (is_finite(value)) text = str(value)
  end function number

  !> A text with quotes, backslashes and control characters escaped.
  pure function json_escape(text) result(escaped)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: escaped
    character(len=6) :: code
    integer(i4) :: k, last  !! last: of the character that is being copied

    escaped = ''
    last = 0
    do k = 1, len(text)
      if (k <= last) cycle
      last = k
      select case (iachar(text(k:k)))
      case (34, 92)
        escaped = escaped//'\'//text(k:k)
      case (9)
        escaped = escaped//'\t'
      case (10)
        escaped = escaped//'\n'
      case (13)
        escaped = escaped//'\r'
      case (0:8, 11, 12, 14:31)
        write (code, '(a,z4.4)') '\u', iachar(text(k:k))
        escaped = escaped//code
      case (128:)
        last = k + utf8_bytes(text(k:)) - 1
        write (code, '(a,z4.4)') '\u', iachar(text(k:k))
        if (last >= k) code = text(k:last)
        last = max(last, k)
        escaped = escaped//trim(code)
      case default
        escaped = escaped//text(k:k)
      end select
    end do
  end function json_escape

  !> Bytes of the character of UTF-8 with which the text begins; 0 if it begins with none.
  pure integer(i4) function utf8_bytes(text) result(bytes)
    character(len=*), intent(in) :: text
    integer(i4) :: k, low, high
    low = 128
    high = 191
    bytes = 0
    select case (iachar(text(1:1)))
    case (:127); bytes = 1
    case (194:223); bytes = 2
    case (224:239); bytes = 3
    case (240:244); bytes = 4
    end select
    if (iachar(text(1:1)) == 224) low = 160   ! no second form of shorter ones
    if (iachar(text(1:1)) == 240) low = 144
    if (iachar(text(1:1)) == 237) high = 159  ! no halves of pairs
    if (iachar(text(1:1)) == 244) high = 143  ! none beyond the last
    if (bytes > len(text)) bytes = 0
    do k = 2, bytes
      if (iachar(text(k:k)) < low .or. iachar(text(k:k)) > high) then
        bytes = 0
        return
      end if
      low = 128
      high = 191
    end do
  end function utf8_bytes
end module talus_json
