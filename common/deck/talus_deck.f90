!> The deck: groups and keys that the user gave, checked against the key table of the program.
!!
!! call deck%read(path, table, errors); after that every value has its type, size and range, and
!! get hands it out, or its default where the user gave none. What the table cannot say is checked
!! by the set-up code, which reports with deck%fault at the same places.
module talus_deck
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, str, append_string
  use talus_errors, only: error_list_type
  use talus_hash, only: hash_text
  use talus_deck_table, only: key_table_type
  use talus_deck_value, only: parse_real, parse_integer, parse_logical
  use talus_deck_source, only: deck_source_type
  use talus_deck_faults, only: deck_faults_type
  use talus_deck_tokens, only: token_text
  use talus_deck_scan, only: deck_syntax_type, scan_deck
  use talus_deck_check, only: check_deck
  use talus_deck_rules, only: key_belongs
  use talus_deck_values, only: resolve_path, word_number
  implicit none
  private
  public :: deck_type

  !> A deck that was read.
  type :: deck_type
    type(key_table_type) :: table
    type(deck_source_type) :: source
    type(deck_syntax_type) :: syntax
  contains
    procedure :: read => read_deck
    procedure :: count => count_groups
    procedure :: given
    procedure :: path => file_path
    procedure :: hash => deck_hash
    procedure :: fault
    procedure :: echo
    procedure, private :: values_of
    procedure, private :: entry_of
    procedure, private :: get_real, get_integer, get_logical, get_string
    procedure, private :: get_reals, get_integers, get_strings
    !> Value of a key, or its default; without default 0, .false., '' or an empty list.
    generic :: get => get_real, get_integer, get_logical, get_string, get_reals, get_integers, &
      get_strings
  end type deck_type

contains

  !> Read and check a deck; all faults (D001 to D019) are reported in one go, in order of the text.
  subroutine read_deck(self, path, table, errors)
    class(deck_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(key_table_type), intent(in) :: table
    type(error_list_type), intent(inout) :: errors
    type(deck_faults_type) :: faults

    self%table = table
    call self%source%load(path, errors)
    if (self%source%line_count == 0) then
      self%syntax%instance_count = 0
      return
    end if
    call faults%init(self%source)
    call scan_deck(self%source, self%syntax, faults)
    if (self%syntax%instance_count > 0) &
      call check_deck(self%source, self%table, self%syntax, faults)
    call faults%hand_over(errors)
  end subroutine read_deck

  !> How many groups of a name the deck holds.
  pure integer(i4) function count_groups(self, group)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group
    integer(i4) :: number

    number = self%table%find(group)
    if (number == 0) error stop 'bug: no such group in the key table'
    count_groups = 0
    if (self%syntax%instance_count > 0) count_groups = &
      count(self%syntax%instance(:self%syntax%instance_count)%group == number)
  end function count_groups

  !> The user gave this key.
  pure logical function given(self, group, instance, key)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    given = self%entry_of(group, instance, key) > 0
  end function given

  !> Number of the entry of a key in the deck, 0 if it was not given.
  pure integer(i4) function entry_of(self, group, instance, key)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    integer(i4) :: g, k, place

    g = self%table%find(group)
    if (g == 0) error stop 'bug: no such group in the key table'
    k = self%table%group(g)%find(key)
    if (k == 0) error stop 'bug: no such key in the key table'
    entry_of = 0
    do place = 1, self%syntax%instance_count
      associate (found => self%syntax%instance(place))
        if (found%group /= g .or. found%number /= instance) cycle
        do entry_of = found%last_entry, found%first_entry, -1
          if (self%syntax%entry(entry_of)%key == k) return
        end do
        entry_of = 0
        return
      end associate
    end do
  end function entry_of

  !> Values of a key as text: what the user gave, or the default.
  subroutine values_of(self, group, instance, key, kind, values)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key, kind
    integer(i4), intent(in) :: instance
    type(string_type), allocatable, intent(out) :: values(:)
    integer(i4) :: at, g

    at = self%entry_of(group, instance, key)
    g = self%table%find(group)
    associate (definition => self%table%group(g)%key(self%table%group(g)%find(key)))
      if (index(kind, definition%kind) == 0) &
        error stop 'bug: get of key '''//key//''' into a variable of another type'
      if (at > 0) then
        call texts_of(self, at, values)
      else if (allocated(definition%preset)) then
        values = definition%preset
      else
        allocate (values(0))
      end if
    end associate
  end subroutine values_of

  !> Values of an entry of the deck as text.
  subroutine texts_of(self, at, values)
    class(deck_type), intent(in) :: self
    integer(i4), intent(in) :: at  !! number of the entry
    type(string_type), allocatable, intent(out) :: values(:)
    integer(i4) :: k

    associate (entry => self%syntax%entry(at))
      allocate (values(entry%last - entry%first + 1))
      do k = 1, size(values)
        values(k)%s = token_text(self%source, self%syntax%value(entry%first + k - 1))
      end do
    end associate
  end subroutine texts_of

  subroutine get_reals(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    real(wp), allocatable, intent(out) :: value(:)
    type(string_type), allocatable :: values(:)
    integer(i4) :: g, k, status, word

    call self%values_of(group, instance, key, 'real', values)
    allocate (value(size(values)))
    g = self%table%find(group)
    associate (definition => self%table%group(g)%key(self%table%group(g)%find(key)))
      do k = 1, size(values)
        word = word_number(definition, values(k)%s)
        if (word > 0) then
          value(k) = definition%word_value(word)
        else
          call parse_real(values(k)%s, value(k), status)
        end if
      end do
    end associate
  end subroutine get_reals

  subroutine get_real(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    real(wp), intent(out) :: value
    real(wp), allocatable :: values(:)
    call self%get_reals(group, instance, key, values)
    value = 0.0_wp
    if (size(values) > 0) value = values(1)
  end subroutine get_real

  subroutine get_integers(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    integer(i4), allocatable, intent(out) :: value(:)
    type(string_type), allocatable :: values(:)
    integer(i4) :: k, status

    call self%values_of(group, instance, key, 'integer', values)
    allocate (value(size(values)))
    do k = 1, size(values)
      call parse_integer(values(k)%s, value(k), status)
    end do
  end subroutine get_integers

  subroutine get_integer(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    integer(i4), intent(out) :: value
    integer(i4), allocatable :: values(:)
    call self%get_integers(group, instance, key, values)
    value = 0
    if (size(values) > 0) value = values(1)
  end subroutine get_integer

  subroutine get_logical(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    logical, intent(out) :: value
    type(string_type), allocatable :: values(:)
    integer(i4) :: status

    call self%values_of(group, instance, key, 'logical', values)
    value = .false.
    if (size(values) > 0) call parse_logical(values(1)%s, value, status)
  end subroutine get_logical

  subroutine get_strings(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    type(string_type), allocatable, intent(out) :: value(:)
    call self%values_of(group, instance, key, 'string file', value)
  end subroutine get_strings

  subroutine get_string(self, group, instance, key, value)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    character(len=:), allocatable, intent(out) :: value
    type(string_type), allocatable :: values(:)
    call self%values_of(group, instance, key, 'string file', values)
    value = ''
    if (size(values) > 0) value = values(1)%s
  end subroutine get_string

  !> File name of a key, relative to the folder of the deck; '' if there is none.
  function file_path(self, group, instance, key) result(path)
    class(deck_type), intent(in) :: self
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    character(len=:), allocatable :: path, name
    call self%get(group, instance, key, name)
    path = resolve_path(self%source%path, name)
  end function file_path

  !> Hash of the deck's text, ends of line made alike.
  pure function deck_hash(self) result(hex)
    class(deck_type), intent(in) :: self
    character(len=16) :: hex
    hex = hash_text(self%source%text)
  end function deck_hash

  !> Report what the table cannot say; the place is the key, or its group where it was not given.
  subroutine fault(self, errors, code, message, group, instance, key, hint)
    class(deck_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=*), intent(in) :: code, message, group
    integer(i4), intent(in) :: instance
    character(len=*), intent(in) :: key   !! '' for the group as a whole
    character(len=*), intent(in), optional :: hint
    integer(i4) :: at, k, last

    at = 0
    if (len(key) > 0) at = self%entry_of(group, instance, key)
    if (at > 0) then
      associate (entry => self%syntax%entry(at))
        last = entry%name%last
        do k = entry%first, entry%last
          if (self%syntax%value(k)%line == entry%name%line) last = self%syntax%value(k)%last
        end do
        call errors%add(code, message, &
                        self%source%place(entry%name%line, entry%name%first, last), hint)
      end associate
      return
    end if
    do k = 1, self%syntax%instance_count
      associate (found => self%syntax%instance(k))
        if (found%group == 0 .or. found%number /= instance) cycle
        if (self%table%group(found%group)%name /= group) cycle
        call errors%add(code, message, self%source%place(found%head%line, found%head%first, &
                                                         found%head%last), hint)
        return
      end associate
    end do
    call errors%add(code, message, self%source%path, hint)
  end subroutine fault

  !> The deck as understood, a line a key, defaults marked with (default); groups are in the order
  !! of the deck; then follow groups that were left out and have a default for every key.
  subroutine echo(self, lines)
    class(deck_type), intent(in) :: self
    type(string_type), allocatable, intent(out) :: lines(:)
    integer(i4) :: k

    allocate (lines(0))
    do k = 1, self%syntax%instance_count
      associate (instance => self%syntax%instance(k))
        if (instance%group > 0) call echo_group(self, instance%group, instance%number, &
                                                 k, lines)
      end associate
    end do
    do k = 1, self%table%group_count
      associate (group => self%table%group(k))
        if (self%count(group%name) > 0 .or. group%repeats) cycle
        if (all_preset(self%table, k)) call echo_group(self, k, 1, 0, lines)
      end associate
    end do
  end subroutine echo

  pure logical function all_preset(table, group)
    type(key_table_type), intent(in) :: table
    integer(i4), intent(in) :: group
    integer(i4) :: k
    all_preset = .true.
    do k = 1, table%group(group)%key_count
      all_preset = all_preset .and. allocated(table%group(group)%key(k)%preset)
    end do
  end function all_preset

  !> One group; defaults of keys that mean nothing with its choices are left out.
  subroutine echo_group(self, group, instance, place, lines)
    class(deck_type), intent(in) :: self
    integer(i4), intent(in) :: group, instance
    integer(i4), intent(in) :: place  !! among all groups of the deck, 0: it was left out
    type(string_type), allocatable, intent(inout) :: lines(:)
    type(string_type), allocatable :: values(:)
    character(len=:), allocatable :: text, name, unit
    integer(i4) :: k, j
    logical :: is_text, was_given

    name = self%table%group(group)%name
    call append_string(lines, '&'//name)
    do k = 1, self%table%group(group)%key_count
      associate (key => self%table%group(group)%key(k))
        call self%values_of(name, instance, key%name, key%kind, values)
        if (size(values) == 0) cycle
        was_given = self%given(name, instance, key%name)
        if (place > 0 .and. .not. was_given) then
          if (.not. key_belongs(self%source, self%table, self%syntax, place, k)) cycle
        end if
        text = ''
        do j = 1, size(values)
          is_text = key%kind == 'string' .or. key%kind == 'file' &
                    .or. word_number(key, values(j)%s) > 0
          if (is_text) values(j)%s = ''''//values(j)%s//''''
          if (j > 1) text = text//', '
          text = text//values(j)%s
        end do
        unit = ''
        if (len(key%unit) > 0) unit = '  ['//key%unit//']'
        call append_string(lines, '  '//key%name//repeat(' ', max(0, 16 - len(key%name)))//' = ' &
                           //text//unit//trim(merge('             ', '  (default)  ', was_given)))
      end associate
    end do
    call append_string(lines, '/')
  end subroutine echo_group
end module talus_deck
