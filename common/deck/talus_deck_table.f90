!> What a deck may hold: groups and keys with type, size, unit, default, bounds and meaning.
!!
!! A table is built by the generated modules (dem_deck_keys, ...): add_group, then for each key
!! add_key followed by what else is to be said of it (need, sized, preset, bounds, allow, words, and
!! how it depends on other keys: only_with, need_with, needs, excludes, choice_with).
module talus_deck_table
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string, join, str
  implicit none
  private
  public :: key_table_type, deck_group_type, deck_key_type, deck_condition_type, deck_set_type
  public :: range_text, size_text, rule_text, condition_text, conditions_text

  !> A choosing key has one of these values.
  type :: deck_condition_type
    character(len=:), allocatable :: group       !! of the choosing key; '': the same group
    character(len=:), allocatable :: key         !! the choosing key, a string with choices
    character(len=:), allocatable :: choice      !! what depends on it: a choice; '': the whole key
    type(string_type), allocatable :: value(:)   !! of the choosing key
  end type deck_condition_type

  !> Keys of which exactly one (or, not `exact`, at least one) must be given.
  type :: deck_set_type
    type(string_type), allocatable :: key(:)
    logical :: exact = .true.
  end type deck_set_type

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
    real(wp) :: smallest = 0.0_wp, largest = huge(1.0_wp)           !! magnitudes, but for zero
    logical :: low_open = .false., high_open = .false.              !! bound itself excluded
    type(string_type), allocatable :: choice(:)   !! strings that are allowed; not allocated: all
    type(string_type), allocatable :: word(:)     !! words that a real key accepts
    real(wp), allocatable :: word_value(:)        !! and their values
    type(deck_condition_type), allocatable :: belongs(:)    !! all must hold, else it means nothing
    type(deck_condition_type), allocatable :: need_if(:)    !! required where all of them hold
    type(deck_condition_type), allocatable :: choice_if(:)  !! choices that require other choices
    type(string_type), allocatable :: needs(:)     !! keys without which it means nothing
    type(string_type), allocatable :: excludes(:)  !! keys that exclude it
    type(string_type), allocatable :: was(:)       !! names that it had
    type(string_type), allocatable :: old_choice(:), new_choice(:)  !! choices that were renamed
  end type deck_key_type

  !> One group.
  type :: deck_group_type
    character(len=:), allocatable :: name, doc
    logical :: repeats = .false., required = .false.
    integer(i4) :: key_count = 0
    type(deck_key_type), allocatable :: key(:)
    type(deck_condition_type), allocatable :: belongs(:)  !! all must hold, else it means nothing
    type(deck_set_type), allocatable :: set(:)            !! keys of which one must be given
    type(string_type), allocatable :: was(:)              !! names that it had
  contains
    procedure :: find => find_key
    procedure :: find_old => find_old_key
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
    procedure :: magnitude
    procedure :: allow
    procedure :: words
    procedure :: only_with
    procedure :: need_with
    procedure :: choice_with
    procedure :: needs
    procedure :: excludes
    procedure :: was
    procedure :: choices_were
    procedure :: group_with
    procedure :: group_was
    procedure :: one_of
    procedure :: find => find_group
    procedure :: find_old => find_old_group
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

  !> The last key accepts least to most values.
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
      call split_names(values, group%key(group%key_count)%preset)
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

  !> Smallest and largest magnitude of a value of the last key that is not zero.
  subroutine magnitude(self, smallest, largest)
    class(key_table_type), intent(inout) :: self
    real(wp), intent(in) :: smallest, largest
    associate (group => self%group(self%group_count))
      group%key(group%key_count)%smallest = smallest
      group%key(group%key_count)%largest = largest
    end associate
  end subroutine magnitude

  !> Strings that the last key may take, apart by '|'.
  subroutine allow(self, choices)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: choices
    associate (group => self%group(self%group_count))
      call split_names(choices, group%key(group%key_count)%choice)
    end associate
  end subroutine allow

  !> Words, apart by '|', that the last (real) key accepts besides numbers, and their values.
  subroutine words(self, names, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    real(wp), intent(in) :: values(:)
    associate (group => self%group(self%group_count))
      call split_names(names, group%key(group%key_count)%word)
      group%key(group%key_count)%word_value = values
    end associate
  end subroutine words

  !> The last key means something only where the key `chooser` (or 'group.key') has one of the
  !! values, apart by '|'. Said several times: all must hold.
  subroutine only_with(self, chooser, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: chooser, values
    associate (group => self%group(self%group_count))
      call add_condition(group%key(group%key_count)%belongs, '', chooser, values)
    end associate
  end subroutine only_with

  !> The last key must be given where the key `chooser` has one of the values.
  subroutine need_with(self, chooser, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: chooser, values
    associate (group => self%group(self%group_count))
      call add_condition(group%key(group%key_count)%need_if, '', chooser, values)
    end associate
  end subroutine need_with

  !> A choice of the last key, allowed only with these values of the key `chooser`.
  subroutine choice_with(self, choice, chooser, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: choice, chooser, values
    associate (group => self%group(self%group_count))
      call add_condition(group%key(group%key_count)%choice_if, choice, chooser, values)
    end associate
  end subroutine choice_with

  !> Keys, apart by '|', that must be given where the last key is.
  subroutine needs(self, names)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    associate (group => self%group(self%group_count))
      call split_names(names, group%key(group%key_count)%needs)
    end associate
  end subroutine needs

  !> Keys, apart by '|', that may not be given where the last key is.
  subroutine excludes(self, names)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    associate (group => self%group(self%group_count))
      call split_names(names, group%key(group%key_count)%excludes)
    end associate
  end subroutine excludes

  !> Names, apart by '|', that the last key had in older decks.
  subroutine was(self, names)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    associate (group => self%group(self%group_count))
      call split_names(names, group%key(group%key_count)%was)
    end associate
  end subroutine was

  !> Choices of the last key that have new names, in the same order, apart by '|'.
  subroutine choices_were(self, old, new)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: old, new
    associate (group => self%group(self%group_count))
      call split_names(old, group%key(group%key_count)%old_choice)
      call split_names(new, group%key(group%key_count)%new_choice)
    end associate
  end subroutine choices_were

  !> The last group means something only where the key 'group.key' has one of the values.
  subroutine group_with(self, chooser, values)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: chooser, values
    call add_condition(self%group(self%group_count)%belongs, '', chooser, values)
  end subroutine group_with

  !> Names, apart by '|', that the last group had in older decks.
  subroutine group_was(self, names)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    call split_names(names, self%group(self%group_count)%was)
  end subroutine group_was

  !> Keys of the last group of which exactly one (with at_least: one or more) must be given.
  subroutine one_of(self, names, at_least)
    class(key_table_type), intent(inout) :: self
    character(len=*), intent(in) :: names
    logical, intent(in), optional :: at_least
    type(deck_set_type), allocatable :: more(:)
    integer(i4) :: k, n

    associate (group => self%group(self%group_count))
      n = 0
      if (allocated(group%set)) n = size(group%set)
      allocate (more(n + 1))
      do k = 1, n
        more(k) = group%set(k)
      end do
      call split_names(names, more(n + 1)%key)
      if (present(at_least)) more(n + 1)%exact = .not. at_least
      call move_alloc(more, group%set)
    end associate
  end subroutine one_of

  !> Append a condition; the chooser is 'key' or 'group.key'.
  subroutine add_condition(list, choice, chooser, values)
    type(deck_condition_type), allocatable, intent(inout) :: list(:)
    character(len=*), intent(in) :: choice, chooser, values
    type(deck_condition_type), allocatable :: more(:)
    integer(i4) :: k, n, dot

    n = 0
    if (allocated(list)) n = size(list)
    allocate (more(n + 1))
    do k = 1, n
      more(k) = list(k)
    end do
    dot = index(chooser, '.')
    more(n + 1)%choice = choice
    more(n + 1)%group = chooser(:max(0, dot - 1))
    more(n + 1)%key = chooser(dot + 1:)
    call split_names(values, more(n + 1)%value)
    call move_alloc(more, list)
  end subroutine add_condition

  !> Names of a list apart by '|'.
  pure subroutine split_names(text, parts)
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
  end subroutine split_names

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

  !> Number of the group that once had this name, 0 if there is none.
  pure integer(i4) function find_old_group(self, name)
    class(key_table_type), intent(in) :: self
    character(len=*), intent(in) :: name
    do find_old_group = self%group_count, 1, -1
      if (holds(self%group(find_old_group)%was, name)) return
    end do
  end function find_old_group

  !> Number of the key that once had this name, 0 if there is none.
  pure integer(i4) function find_old_key(self, name)
    class(deck_group_type), intent(in) :: self
    character(len=*), intent(in) :: name
    do find_old_key = self%key_count, 1, -1
      if (holds(self%key(find_old_key)%was, name)) return
    end do
  end function find_old_key

  pure logical function holds(names, name)
    type(string_type), allocatable, intent(in) :: names(:)
    character(len=*), intent(in) :: name
    integer(i4) :: k
    holds = .false.
    if (.not. allocated(names)) return
    do k = 1, size(names)
      holds = holds .or. names(k)%s == name
    end do
  end function holds

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

  !> "kind = 'newmark', 'hht'", or "kind = 'newmark' of &analysis".
  pure function condition_text(condition) result(text)
    type(deck_condition_type), intent(in) :: condition
    character(len=:), allocatable :: text
    text = condition%key//' = '''//join(condition%value, ''', ''')//''''
    if (len(condition%group) > 0) text = text//' of &'//condition%group
  end function condition_text

  !> "only with law = 'linear'; required; not with 'b'": how a key depends on others, '' not at all.
  pure function rule_text(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text
    integer(i4) :: k

    text = ''
    if (allocated(key%belongs)) text = '; only with '//conditions_text(key%belongs)
    if (allocated(key%need_if)) text = text//'; required with '//conditions_text(key%need_if)
    if (allocated(key%needs)) text = text//'; needs '''//join(key%needs, ''', ''')//''''
    if (allocated(key%excludes)) text = text//'; not beside '''//join(key%excludes, ''', ''') &
      //''''
    if (allocated(key%choice_if)) then
      do k = 1, size(key%choice_if)
        text = text//'; '''//key%choice_if(k)%choice//''' only with ' &
          //condition_text(key%choice_if(k))
      end do
    end if
    text = text(min(len(text), 2) + 1:)
  end function rule_text

  !> Conditions that must all hold.
  pure function conditions_text(list) result(text)
    type(deck_condition_type), intent(in) :: list(:)
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = condition_text(list(1))
    do k = 2, size(list)
      text = text//' and '//condition_text(list(k))
    end do
  end function conditions_text
end module talus_deck_table
