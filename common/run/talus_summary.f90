!> summary.json of a run: results and health under nested keys ('health.energy_error').
module talus_summary
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: replace_file
  use talus_text, only: str, string_type, append_string, is_finite
  use talus_timers, only: timers_type
  use talus_version, only: git_hash, version_text
  implicit none
  private
  public :: summary_type

  character(len=*), parameter :: nl = new_line('a')

  !> Keys with their values as JSON text, in the order in which they were set first.
  type :: summary_type
    type(string_type), allocatable, private :: keys(:), values(:)
  contains
    procedure, private :: set_real, set_int4, set_int8, set_logical, set_text, set_reals
    generic :: set => set_real, set_int4, set_int8, set_logical, set_text, set_reals
    procedure :: set_program
    procedure :: set_errors
    procedure :: set_timers
    procedure :: text => summary_text
    procedure :: write => write_summary
  end type summary_type

contains

  !> The keys that every program writes.
  subroutine set_program(self, program, deck, deck_hash)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: program, deck, deck_hash
    call self%set('program', program)
    call self%set('version', version_text())
    call self%set('git', git_hash())
    call self%set('deck', deck)
    call self%set('deck_hash', deck_hash)
  end subroutine set_program

  !> NaN and infinity become null: JSON has no word for them.
  subroutine set_real(self, key, value)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key
    real(wp), intent(in) :: value
    call put(self, key, json_real(value))
  end subroutine set_real

  subroutine set_reals(self, key, values)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: list
    integer :: k
    list = '['
    do k = 1, size(values)
      if (k > 1) list = list//', '
      list = list//json_real(values(k))
    end do
    call put(self, key, list//']')
  end subroutine set_reals

  subroutine set_int4(self, key, value)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key
    integer(i4), intent(in) :: value
    call put(self, key, str(value))
  end subroutine set_int4

  subroutine set_int8(self, key, value)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key
    integer(i8), intent(in) :: value
    call put(self, key, str(value))
  end subroutine set_int8

  subroutine set_logical(self, key, value)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key
    logical, intent(in) :: value
    call put(self, key, str(value))
  end subroutine set_logical

  subroutine set_text(self, key, value)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key, value
    call put(self, key, quoted(value))
  end subroutine set_text

  !> 'errors': a list of objects with code, message, place and hint; empty without faults.
  subroutine set_errors(self, errors)
    class(summary_type), intent(inout) :: self
    type(error_list_type), intent(in) :: errors
    character(len=:), allocatable :: list
    integer(i4) :: k
    list = '['
    do k = 1, errors%count
      if (k > 1) list = list//','
      associate (fault => errors%item(k))
        list = list//nl//'    {"code": '//quoted(fault%code)//', "message": '// &
               quoted(fault%message)//','//nl//'     "place": '//quoted(fault%place)// &
               ', "hint": '//quoted(fault%hint)//'}'
      end associate
    end do
    if (errors%count > 0) list = list//nl//'  '
    call put(self, 'errors', list//']')
  end subroutine set_errors

  !> 'timers.<name>' in seconds.
  subroutine set_timers(self, timers)
    class(summary_type), intent(inout) :: self
    type(timers_type), intent(in) :: timers
    integer(i4) :: k
    do k = 1, timers%count
      call self%set('timers.'//timers%name(k), timers%seconds(k))
    end do
  end subroutine set_timers

  !> Write the file in place of an older one.
  subroutine write_summary(self, path, errors)
    class(summary_type), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    call replace_file(path, self%text(), errors)
  end subroutine write_summary

  function summary_text(self) result(text)
    class(summary_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = '{}'
    if (allocated(self%keys)) text = object_text(self, '', 0)
    text = text//nl
  end function summary_text

  !> The object of all keys that begin with prefix; keys with a common first part nest.
  recursive function object_text(self, prefix, depth) result(text)
    class(summary_type), intent(in) :: self
    character(len=*), intent(in) :: prefix  !! '' or 'health.'
    integer, intent(in) :: depth
    character(len=:), allocatable :: text
    type(string_type), allocatable :: done(:)
    character(len=:), allocatable :: name, value
    integer :: k, dot

    allocate (done(0))
    text = '{'
    do k = 1, size(self%keys)
      if (index(self%keys(k)%s, prefix) /= 1) cycle
      name = self%keys(k)%s(len(prefix) + 1:)
      dot = index(name, '.')
      if (dot > 0) name = name(:dot - 1)
      if (holds(done, name)) cycle
      if (dot > 0) then
        value = object_text(self, prefix//name//'.', depth + 1)
      else
        value = self%values(k)%s
      end if
      if (size(done) > 0) text = text//','
      text = text//nl//repeat('  ', depth + 1)//quoted(name)//': '//value
      call append_string(done, name)
    end do
    text = text//nl//repeat('  ', depth)//'}'
  end function object_text

  pure logical function holds(list, name)
    type(string_type), intent(in) :: list(:)
    character(len=*), intent(in) :: name
    integer :: k
    holds = .false.
    do k = 1, size(list)
      if (list(k)%s == name) holds = .true.
    end do
  end function holds

  !> Set a key to a value in JSON; a key that is set again keeps its place.
  subroutine put(self, key, value)
    class(summary_type), intent(inout) :: self
    character(len=*), intent(in) :: key, value
    integer :: k
    if (.not. allocated(self%keys)) allocate (self%keys(0), self%values(0))
    do k = 1, size(self%keys)
      if (self%keys(k)%s == key) then
        self%values(k)%s = value
        return
      end if
    end do
    call append_string(self%keys, key)
    call append_string(self%values, value)
  end subroutine put

  pure function json_real(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = 'null'
    if (is_finite(value)) text = str(value)
  end function json_real

  !> JSON string: quotes, backslashes and control characters escaped.
  pure function quoted(text) result(json)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: json
    character(len=6) :: escape
    integer :: k, code
    json = '"'
    do k = 1, len(text)
      code = iachar(text(k:k))
      if (text(k:k) == '"' .or. text(k:k) == '\') then
        json = json//'\'//text(k:k)
      else if (text(k:k) == nl) then
        json = json//'\n'
      else if (code >= 0 .and. code < 32) then
        write (escape, '("\u", z4.4)') code
        json = json//escape
      else
        json = json//text(k:k)
      end if
    end do
    json = json//'"'
  end function quoted
end module talus_summary
