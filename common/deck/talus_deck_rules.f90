!> Rules between the keys of a deck: keys that belong to a choice, need or exclude other keys.
!!
!! They are in the table (`of`, `required`, `needs`, `excludes`, `one_of` of deck.toml). Where the
!! value of a choosing key is not known, because it or its group is missing or faulty, nothing is
!! concluded.
module talus_deck_rules
  use talus_kinds, only: i4
  use talus_text, only: string_type, str, join
  use talus_deck_table, only: key_table_type, deck_group_type, deck_condition_type, &
    deck_set_type, condition_text
  use talus_deck_source, only: deck_source_type
  use talus_deck_faults, only: deck_faults_type
  use talus_deck_tokens, only: token_type, token_text, token_string
  use talus_deck_scan, only: deck_syntax_type
  implicit none
  private
  public :: check_rules, key_belongs

  !> Value of a choosing key.
  type :: chosen_type
    logical :: known = .false.             !! its value is one of its choices
    logical :: holds = .false.             !! and one of those required
    integer(i4) :: entry = 0               !! its place in the deck, 0: its default
    character(len=:), allocatable :: text  !! "law = 'linear'"
  end type chosen_type

contains

  !> Faults D013 (a key is missing), D024, D025 and D026 of all groups of a deck.
  subroutine check_rules(source, table, syntax, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    type(deck_faults_type), intent(inout) :: faults
    integer(i4) :: k

    do k = 1, syntax%instance_count
      if (syntax%instance(k)%group == 0) cycle
      if (group_belongs(source, table, syntax, k, faults)) &
        call check_instance(source, table, syntax, k, faults)
    end do
  end subroutine check_rules

  !> Does a group mean something in this deck (else D024)?
  logical function group_belongs(source, table, syntax, k, faults) result(belongs)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k
    type(deck_faults_type), intent(inout) :: faults
    type(chosen_type) :: chosen
    integer(i4) :: c

    belongs = .true.
    associate (group => table%group(syntax%instance(k)%group), head => syntax%instance(k)%head)
      if (.not. allocated(group%belongs)) return
      do c = 1, size(group%belongs)
        chosen = choice_of(source, table, syntax, k, group%belongs(c))
        if (chosen%holds .or. .not. chosen%known) cycle
        call faults%add(source, 'D024', 'group &'//group%name//' has no meaning with ' &
                        //chosen%text, head%line, head%first, head%last, &
                        'leave it out; it belongs to '//condition_text(group%belongs(c)))
        belongs = .false.
        return
      end do
    end associate
  end function group_belongs

  !> Rules of the keys of one group.
  subroutine check_instance(source, table, syntax, k, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k
    type(deck_faults_type), intent(inout) :: faults
    integer(i4), allocatable :: at(:)
    integer(i4) :: j

    call find_entries(table, syntax, k, at)
    associate (group => table%group(syntax%instance(k)%group))
      do j = 1, group%key_count
        if (at(j) > 0) then
          call check_given(source, table, syntax, k, j, at, faults)
        else if (complete(syntax, k)) then
          call check_missing(source, table, syntax, k, j, faults)
        end if
      end do
      if (.not. allocated(group%set)) return
      do j = 1, size(group%set)
        call check_set(source, table, syntax, k, group%set(j), at, faults)
      end do
    end associate
  end subroutine check_instance

  !> A key that was given: does it belong here, and fit its neighbours?
  subroutine check_given(source, table, syntax, k, j, at, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k, j, at(:)
    type(deck_faults_type), intent(inout) :: faults
    type(chosen_type) :: chosen
    integer(i4) :: c, other

    associate (group => table%group(syntax%instance(k)%group), name => syntax%entry(at(j))%name)
      associate (key => group%key(j))
        do c = 1, conditions(key%belongs)
          chosen = choice_of(source, table, syntax, k, key%belongs(c))
          if (chosen%holds .or. .not. chosen%known) cycle
          call faults%add(source, 'D024', key%name//' has no meaning with '//chosen%text, &
                          name%line, name%first, name%last, 'leave it out; it belongs to ' &
                          //condition_text(key%belongs(c)))
          return
        end do
        do c = 1, names(key%needs)
          other = group%find(key%needs(c)%s)
          if (at(other) > 0 .or. .not. complete(syntax, k)) cycle
          call faults%add(source, 'D013', 'key '''//key%name//''' needs key ''' &
                          //group%key(other)%name//'''', name%line, name%first, name%last, &
                          group%key(other)%name//': '//group%key(other)%doc)
        end do
        do c = 1, names(key%excludes)
          other = group%find(key%excludes(c)%s)
          if (at(other) > 0) call both_given(source, syntax, group, at, [j, other], faults)
        end do
      end associate
    end associate
    call check_choices(source, table, syntax, k, j, at(j), faults)
  end subroutine check_given

  !> Choices of a key that require other choices (D026).
  subroutine check_choices(source, table, syntax, k, j, entry, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k, j, entry
    type(deck_faults_type), intent(inout) :: faults
    type(chosen_type) :: chosen
    type(token_type) :: token
    integer(i4) :: c, v

    associate (key => table%group(syntax%instance(k)%group)%key(j))
      do c = 1, conditions(key%choice_if)
        do v = syntax%entry(entry)%first, syntax%entry(entry)%last
          token = syntax%value(v)
          if (token_text(source, token) /= key%choice_if(c)%choice) cycle
          chosen = choice_of(source, table, syntax, k, key%choice_if(c))
          if (chosen%holds .or. .not. chosen%known) cycle
          call faults%add(source, 'D026', key%name//' = '''//key%choice_if(c)%choice &
                          //''' does not go with '//chosen%text, token%line, token%first, &
                          token%last, 'it goes with '//condition_text(key%choice_if(c)))
        end do
      end do
    end associate
  end subroutine check_choices

  !> A key that was not given, but may have to be where a choosing key has some value (D013).
  subroutine check_missing(source, table, syntax, k, j, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k, j
    type(deck_faults_type), intent(inout) :: faults
    type(deck_condition_type), allocatable :: all(:)
    type(chosen_type) :: chosen
    type(token_type) :: place
    character(len=:), allocatable :: text
    integer(i4) :: c

    associate (group => table%group(syntax%instance(k)%group))
      associate (key => group%key(j))
        if (key%required .and. allocated(key%belongs)) all = key%belongs
        if (allocated(key%need_if)) all = key%need_if
        if (.not. allocated(all)) return
        text = ''
        place = syntax%instance(k)%head
        do c = 1, size(all)
          chosen = choice_of(source, table, syntax, k, all(c))
          if (.not. chosen%holds) return
          if (c > 1) text = text//' and '
          text = text//chosen%text
          if (chosen%entry > 0 .and. len(all(c)%group) == 0) place = whole(syntax, chosen%entry)
        end do
        call faults%add(source, 'D013', 'group &'//group%name//' needs key '''//key%name &
                        //''' with '//text, place%line, place%first, place%last, &
                        key%name//': '//key%doc)
      end associate
    end associate
  end subroutine check_missing

  !> Keys of which one must be given: D013 for none, D025 for several where one is wanted.
  subroutine check_set(source, table, syntax, k, set, at, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k, at(:)
    type(deck_set_type), intent(in) :: set
    type(deck_faults_type), intent(inout) :: faults
    type(string_type), allocatable :: asked(:)
    integer(i4), allocatable :: there(:)
    integer(i4) :: c, j, wanted
    logical :: known

    allocate (asked(size(set%key)), there(0))
    wanted = 0
    known = .true.
    associate (group => table%group(syntax%instance(k)%group), head => syntax%instance(k)%head)
      do c = 1, size(set%key)
        j = group%find(set%key(c)%s)
        if (.not. key_belongs(source, table, syntax, k, j)) cycle
        known = known .and. owner_known(source, table, syntax, k, j)
        wanted = wanted + 1
        asked(wanted)%s = group%key(j)%name
        if (at(j) > 0) there = [there, j]
      end do
      if (wanted == 0) return
      if (size(there) == 0 .and. known .and. complete(syntax, k)) &
        call faults%add(source, 'D013', 'group &'//group%name//' needs ' &
                        //set_text(set, asked(:wanted)), head%line, head%first, head%last, &
                        asked(1)%s//': '//group%key(group%find(asked(1)%s))%doc)
      if (.not. set%exact) return
      do c = 2, size(there)
        call both_given(source, syntax, group, at, there([1, c]), faults)
      end do
    end associate
  end subroutine check_set

  !> "key 'a'", "one of the keys 'a', 'b'".
  pure function set_text(set, asked) result(text)
    type(deck_set_type), intent(in) :: set
    type(string_type), intent(in) :: asked(:)
    character(len=:), allocatable :: text
    text = 'key '
    if (size(asked) > 1) text = trim(merge('one of the keys         ', &
                                           'one or more of the keys ', set%exact))//' '
    text = text//''''//join(asked, ''', ''')//''''
  end function set_text

  !> Two keys that exclude each other (D025), reported at the second one.
  subroutine both_given(source, syntax, group, at, pair, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_syntax_type), intent(in) :: syntax
    type(deck_group_type), intent(in) :: group
    integer(i4), intent(in) :: at(:)    !! entry of each key of the group
    integer(i4), intent(in) :: pair(2)  !! the two keys
    type(deck_faults_type), intent(inout) :: faults
    integer(i4) :: early, late

    late = merge(pair(1), pair(2), at(pair(1)) > at(pair(2)))
    early = sum(pair) - late
    associate (token => syntax%entry(at(late))%name, first => syntax%entry(at(early))%name)
      call faults%add(source, 'D025', group%key(early)%name//' (line '//str(first%line)//') and ' &
                      //group%key(late)%name//' are both given', token%line, token%first, &
                      token%last, 'they exclude each other: give one of them')
    end associate
  end subroutine both_given

  !> Does key j mean something in instance k, as far as is known?
  logical function key_belongs(source, table, syntax, k, j) result(belongs)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k, j
    type(chosen_type) :: chosen
    integer(i4) :: c

    belongs = .true.
    associate (key => table%group(syntax%instance(k)%group)%key(j))
      do c = 1, conditions(key%belongs)
        chosen = choice_of(source, table, syntax, k, key%belongs(c))
        if (chosen%known .and. .not. chosen%holds) belongs = .false.
      end do
    end associate
  end function key_belongs

  !> Have all choosing keys that key j belongs to a value that is one of their choices?
  logical function owner_known(source, table, syntax, k, j) result(known)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k, j
    type(chosen_type) :: chosen
    integer(i4) :: c

    known = .true.
    associate (key => table%group(syntax%instance(k)%group)%key(j))
      do c = 1, conditions(key%belongs)
        chosen = choice_of(source, table, syntax, k, key%belongs(c))
        known = known .and. chosen%known
      end do
    end associate
  end function owner_known

  !> The value of a choosing key, as seen from instance k.
  function choice_of(source, table, syntax, k, condition) result(chosen)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k
    type(deck_condition_type), intent(in) :: condition
    type(chosen_type) :: chosen
    character(len=:), allocatable :: value
    integer(i4) :: g, j, place, c

    g = syntax%instance(k)%group
    place = k
    if (len(condition%group) > 0) then
      g = table%find(condition%group)
      do place = syntax%instance_count, 1, -1
        if (syntax%instance(place)%group == g) exit
      end do
      if (place == 0) return
    end if
    if (g == 0) error stop 'bug: a rule of the key table names no group of it'
    j = table%group(g)%find(condition%key)
    if (j == 0) error stop 'bug: a rule of the key table names no key of its group'
    associate (key => table%group(g)%key(j))
      if (.not. allocated(key%choice)) error stop 'bug: a choosing key without choices'
      call read_choice(source, table, syntax, place, j, chosen%entry, value)
      if (chosen%entry == 0) then
        if (.not. allocated(key%preset)) return
        if (.not. complete(syntax, place)) return
        value = key%preset(1)%s
      end if
      do c = 1, size(key%choice)
        chosen%known = chosen%known .or. key%choice(c)%s == value
      end do
      do c = 1, size(condition%value)
        chosen%holds = chosen%holds .or. condition%value(c)%s == value
      end do
      chosen%text = key%name//' = '''//value//''''
      if (len(condition%group) > 0) chosen%text = chosen%text//' of &'//condition%group
      if (chosen%entry == 0) chosen%text = chosen%text//' (default)'
    end associate
  end function choice_of

  !> Entry and value of key j in an instance; entry 0: not given; '' where it is not one string.
  subroutine read_choice(source, table, syntax, place, j, entry, value)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: place, j
    integer(i4), intent(out) :: entry
    character(len=:), allocatable, intent(out) :: value
    integer(i4), allocatable :: at(:)

    value = ''
    call find_entries(table, syntax, place, at)
    entry = at(j)
    if (entry == 0) return
    associate (found => syntax%entry(entry))
      if (found%first /= found%last) return
      if (syntax%value(found%first)%kind == token_string) &
        value = token_text(source, syntax%value(found%first))
    end associate
  end subroutine read_choice

  !> Entry of each key of an instance, 0 where it was not given.
  pure subroutine find_entries(table, syntax, k, at)
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k
    integer(i4), allocatable, intent(out) :: at(:)
    integer(i4) :: e
    allocate (at(table%group(syntax%instance(k)%group)%key_count), source=0)
    do e = syntax%instance(k)%last_entry, syntax%instance(k)%first_entry, -1
      if (syntax%entry(e)%key > 0) at(syntax%entry(e)%key) = e
    end do
  end subroutine find_entries

  !> Is everything in an instance known, so that what is not seen was not given?
  pure logical function complete(syntax, k)
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: k
    associate (instance => syntax%instance(k))
      complete = .not. instance%broken .and. &
                 all(syntax%entry(instance%first_entry:instance%last_entry)%key > 0)
    end associate
  end function complete

  !> The place of an entry from its name to the last value on the same line.
  pure function whole(syntax, entry) result(place)
    type(deck_syntax_type), intent(in) :: syntax
    integer(i4), intent(in) :: entry
    type(token_type) :: place
    integer(i4) :: v
    place = syntax%entry(entry)%name
    do v = syntax%entry(entry)%first, syntax%entry(entry)%last
      if (syntax%value(v)%line == place%line) place%last = syntax%value(v)%last
    end do
  end function whole

  pure integer(i4) function conditions(list)
    type(deck_condition_type), allocatable, intent(in) :: list(:)
    conditions = 0
    if (allocated(list)) conditions = size(list)
  end function conditions

  pure integer(i4) function names(list)
    type(string_type), allocatable, intent(in) :: list(:)
    names = 0
    if (allocated(list)) names = size(list)
  end function names
end module talus_deck_rules
