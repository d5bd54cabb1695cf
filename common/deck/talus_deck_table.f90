!> What a deck may hold: groups and keys with type, size, unit, default, bounds and meaning.
!!
!! A table is built by the generated modules (dem_deck_keys, ...): add_group, then for each key
!! add_key followed by what else is to be said of it (need, sized, preset, bounds, allow, words).
module talus_deck_table
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string, join, str
  implicit none
  private
  public :: key_table_type, deck_group_type, deck_key_type, range_text, size_text

  !> One key of a group.
  type :: deck_key_type
    character(len=:), allocatable :: name
    character(len=:), allocatable :: kind         !! real, integer, logical, string or file
    character(len=:), allocatable :: unit         !! SI unit, '' for none
    character(len=:), allocatable :: doc          !! meaning
    logical :: required = .false.
    integer(i4) :: least = 1, most = 1            !! number of values
    type(string_type), allocatable :: preset(:)   !! default values as text; not allocated: none
    real(wp) :: low = -huge(1.0_wp), high = huge(1.0_wp)            !! bounds of each value
    logical :: low_open = .false., high_open = .false.              !! bound itself excluded
    type(string_type), allocatable :: choice(:)   !! strings that are allowed; not allocated: all
    type(string_type), allocatable :: word(:)     !! words that a real key takes
    real(wp), allocatable :: word_value(:)        !! and what they stand for
  end type deck_key_type

  !> One group.
  type :: deck_group_type
    character(len=:), allocatable :: name, doc
    logical :: repeats = .false., required = .false.
    integer(i4) :: key_count = 0
    type(deck_key_type), allocatable :: key(:)
  contains
    procedure :: find => find_key
    procedure :: key_names
  end type deck_group_type

  !> All groups of a program.
  type :: key_table_type
    character(len=:), allocatable :: program
    integer(i4) :: group_count = 0
    type(deck_group_type), allocatable :: group(:)
  contains
    procedure :: init => init_table
    procedure :: add_group
    procedure :: add_key
    procedure :: need
    procedure :: sized
    procedure :: preset
    procedure :: bounds
    procedure :: allow
    procedure :: words
    procedure :: find => find_group
    procedure :: group_names
  end type key_table_type

contains

  !> Empty table of a program, with room for a number of groups.
  subroutine init_table(self, program, room)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: program
    integer(i4), intent(in) :: room
    self%program = program
    self%group_count = 0
    if (allocated(self%group)) deallocate (self%group)
    allocate (self%group(room))
  end subroutine init_table

  !> Add a group with room for a number of keys; keys added later belong to it.
  subroutine add_group(self, name, room, doc, repeats, required)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: name, doc
    integer(i4), intent(in) :: room
    logical, intent(in), optional :: repeats, required

    self%group_count = self%group_count + 1
    if (self%group_count > size(self%group)) error stop 'bug: key table has no room for a group'
    associate (group => self%group(self%group_count))
      group%name = name
      group%doc = doc
      if (present(repeats)) group%repeats = repeats
      if (present(required)) group%required = required
      group%key_count = 0
      allocate (group%key(room))
    end associate
  end subroutine add_group

  !> Add a key to the last group; the calls that follow say more of it.
  subroutine add_key(self, name, kind, unit, doc)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: name, kind, unit, doc

    associate (group => self%group(self%group_count))
      group%key_count = group%key_count + 1
      if (group%key_count > size(group%key)) error stop 'bug: key table has no room for a key'
      associate (key => group%key(group%key_count))
        key%name = name
        key%kind = kind
        key%unit = unit
        key%doc = doc
      end associate
    end associate
  end subroutine add_key

  !> The last key must be given.
  subroutine need(self)
    class(key_table_type), intent(inout) :: self
    associate (group => self%group(self%group_count))
      group%key(group%key_count)%required = .true.
    end associate
  end subroutine need

  !> The last key takes least to most values.
  subroutine sized(self, least, most)
    class(key_table_type), intent(inout) :: self
    integer(i4), intent(in) :: least, most
    associate (group => self%group(self%group_count))
      group%key(group%key_count)%least = least
      group%key(group%key_count)%most = most
    end associate
  end subroutine sized

  !> Default of the last key: values as text, apart by '|'.
  subroutine preset(self, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: values
    associate (group => self%group(self%group_count))
      call split(values, group%key(group%key_count)%preset)
    end associate
  end subroutine preset

  !> Bounds of each value of the last key.
  subroutine bounds(self, min, max, above, below)
    class(key_table_type), intent(inout) :: self
    real(wp), intent(in), optional :: min, max, above, below

    associate (group => self%group(self%group_count))
      associate (key => group%key(group%key_count))
        if (present(min)) key%low = min
        if (present(max)) key%high = max
        if (present(above)) key%low = above
        if (present(below)) key%high = below
        key%low_open = present(above)
        key%high_open = present(below)
      end associate
    end associate
  end subroutine bounds

  !> Strings that the last key may take, apart by '|'.
  subroutine allow(self, choices)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: choices
    associate (group => self%group(self%group_count))
      call split(choices, group%key(group%key_count)%choice)
    end associate
  end subroutine allow

  !> Words, apart by '|', that the last (real) key takes besides numbers, and their values.
  subroutine words(self, names, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    real(wp), intent(in) :: values(:)
    associate (group => self%group(self%group_count))
      call split(names, group%key(group%key_count)%word)
      group%key(group%key_count)%word_value = values
    end associate
  end subroutine words

  pure subroutine split(text, parts)
    character(len=*), intent(in) :: text
    type(string_type), allocatable, intent(out) :: parts(:)
    integer(i4) :: first, bar

    first = 1
    do
      bar = index(text(first:), '|')
      if (bar == 0) exit
      call append_string(parts, text(first:first + bar - 2))
      first = first + bar
    end do
    call append_string(parts, text(first:))
  end subroutine split

  !> Number of a group, 0 if there is none of that name.
  pure integer(i4) function find_group(self, name)
    class(key_table_type), intent(in) :: self
    character(len=*), intent(in) :: name
    do find_group = self%group_count, 1, -1
      if (self%group(find_group)%name == name) return
    end do
  end function find_group

  !> Number of a key, 0 if there is none of that name.
  pure integer(i4) function find_key(self, name)
    class(deck_group_type), intent(in) :: self
    character(len=*), intent(in) :: name
    do find_key = self%key_count, 1, -1
      if (self%key(find_key)%name == name) return
    end do
  end function find_key

  !> Names of all groups.
  pure subroutine group_names(self, names)
    class(key_table_type), intent(in) :: self
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: k
    allocate (names(self%group_count))
    do k = 1, self%group_count
      names(k)%s = self%group(k)%name
    end do
  end subroutine group_names

  !> Names of all keys of a group.
  pure subroutine key_names(self, names)
    class(deck_group_type), intent(in) :: self
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: k
    allocate (names(self%key_count))
    do k = 1, self%key_count
      names(k)%s = self%key(k)%name
    end do
  end subroutine key_names

  !> '> 0 and <= 1', '''a'' or ''b''', '' without limits.
  pure function range_text(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text

    text = ''
    if (allocated(key%choice)) then
      text = ''''//join(key%choice, ''', ''')//''''
      return
    end if
    if (key%low > -huge(1.0_wp)) text = trim(merge('> ', '>=', key%low_open))//' '//str(key%low)
    if (key%high < huge(1.0_wp)) then
      if (len(text) > 0) text = text//' and '
      text = text//trim(merge('< ', '<=', key%high_open))//' '//str(key%high)
    end if
    if (allocated(key%word)) then
      if (len(text) > 0) text = text//', '
      text = text//'or '''//join(key%word, ''', ''')//''''
    end if
  end function range_text

  !> '1 value', '3 values', '1 to 3 values', '1 or more values'.
  pure function size_text(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text

    if (key%most == huge(key%most)) then
      text = str(key%least)//' or more values'
    else if (key%most > key%least) then
      text = str(key%least)//' to '//str(key%most)//' values'
    else
      text = str(key%least)//trim(merge(' value ', ' values', key%least == 1))
    end if
  end function size_text
end module talus_deck_table
