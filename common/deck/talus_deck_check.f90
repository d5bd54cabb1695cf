!> A deck against its table: groups and keys that are unknown, repeated or missing.
module talus_deck_check
  use talus_kinds, only: i4
  use talus_text, only: string_type, str, lower
  use talus_suggest, only: nearest_name, did_you_mean
  use talus_deck_table, only: key_table_type
  use talus_deck_source, only: deck_source_type
  use talus_deck_faults, only: deck_faults_type
  use talus_deck_tokens, only: token_type, token_text, token_word
  use talus_deck_scan, only: deck_syntax_type, deck_entry_type
  use talus_deck_rules, only: check_rules
  use talus_deck_values, only: check_values
  implicit none
  private
  public :: check_deck

contains

  !> Give groups and keys their numbers in the table and report all that does not fit.
  subroutine check_deck(source, table, syntax, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(inout) :: syntax
    type(deck_faults_type), intent(inout) :: faults
    logical :: meant(table%group_count)
    integer(i4) :: k, first_line(table%group_count), number(table%group_count)

    meant = .false.
    first_line = 0
    number = 0
    do k = 1, syntax%instance_count
      call know_group(source, table, syntax, k, meant, faults)
      associate (instance => syntax%instance(k))
        if (instance%group == 0) cycle
        number(instance%group) = number(instance%group) + 1
        instance%number = number(instance%group)
        if (instance%number == 1) first_line(instance%group) = instance%head%line
        if (instance%number > 1 .and. .not. table%group(instance%group)%repeats) &
          call faults%add(source, 'D009', 'group &'//table%group(instance%group)%name//' is given' &
                          //' again (first on line '//str(first_line(instance%group))//')', &
                          instance%head%line, instance%head%first, instance%head%last, &
                          'it may occur only once: merge the two')
      end associate
      call check_keys(source, table, syntax, k, faults)
    end do
    do k = 1, table%group_count
      if (.not. table%group(k)%required .or. number(k) > 0 .or. meant(k)) cycle
      call faults%add(source, 'D010', 'group &'//table%group(k)%name//' is missing', 0, 0, 0, &
                      table%program//' needs it: '//table%group(k)%doc)
    end do
    call check_rules(source, table, syntax, faults)
  end subroutine check_deck

  !> Look up the name of a group.
  subroutine know_group(source, table, syntax, k, meant, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(inout) :: syntax
    integer(i4), intent(in) :: k
    logical, intent(inout) :: meant(:)  !! groups that a mistyped name may mean
    type(deck_faults_type), intent(inout) :: faults
    type(string_type), allocatable :: names(:)
    character(len=:), allocatable :: name, hint
    integer(i4) :: near

    associate (instance => syntax%instance(k))
      name = lower(token_text(source, instance%head))
      instance%group = table%find(name)
      if (instance%group > 0) return
      instance%group = table%find_old(name)
      if (instance%group > 0) then
        hint = table%group(instance%group)%name
        call faults%add(source, 'D023', 'group &'//name//' is now called &'//hint, &
                        instance%head%line, instance%head%first, instance%head%last, &
                        'write &'//hint)
        return
      end if
      call table%group_names(names)
      near = table%find(nearest_name(name, names))
      if (near > 0) meant(near) = .true.
      hint = did_you_mean(name, names, 'groups of '//table%program//':')
      if (name == '') hint = 'the name of the group follows the & at once: &run'
      if (name == 'end') hint = 'a group ends with /'
      call faults%add(source, 'D008', 'unknown group &'//name, instance%head%line, &
                      instance%head%first, instance%head%last, hint)
    end associate
  end subroutine know_group

  !> Keys of one group.
  subroutine check_keys(source, table, syntax, k, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    type(deck_syntax_type), intent(inout) :: syntax
    integer(i4), intent(in) :: k
    type(deck_faults_type), intent(inout) :: faults
    logical, allocatable :: meant(:)
    integer(i4), allocatable :: line(:)
    integer(i4) :: e

    associate (instance => syntax%instance(k), group => table%group(syntax%instance(k)%group))
      allocate (meant(group%key_count), source=.false.)
      allocate (line(group%key_count), source=0)
      do e = instance%first_entry, instance%last_entry
        associate (entry => syntax%entry(e))
          call know_key(source, table, instance%group, entry, meant, faults)
          if (entry%key == 0) cycle
          if (line(entry%key) > 0) &
            call faults%add(source, 'D012', 'key '''//group%key(entry%key)%name &
                            //''' is given again (first on line '//str(line(entry%key))//')', &
                            entry%name%line, entry%name%first, entry%name%last, &
                            'a key may occur once in a group')
          if (line(entry%key) == 0) line(entry%key) = entry%name%line
          call check_values(source, group, group%key(entry%key), &
                            syntax%value(entry%first:entry%last), entry%name, faults)
        end associate
      end do
      if (instance%broken) return
      do e = 1, group%key_count
        if (.not. group%key(e)%required .or. line(e) > 0 .or. meant(e)) cycle
        if (allocated(group%key(e)%belongs)) cycle  ! a rule, see talus_deck_rules
        call faults%add(source, 'D013', 'group &'//group%name//' needs key '''//group%key(e)%name &
                        //'''', instance%head%line, instance%head%first, instance%head%last, &
                        group%key(e)%name//': '//group%key(e)%doc)
      end do
    end associate
  end subroutine check_keys

  !> Look up the name of a key.
  subroutine know_key(source, table, group, entry, meant, faults)
    type(deck_source_type), intent(in) :: source
    type(key_table_type), intent(in) :: table
    integer(i4), intent(in) :: group
    type(deck_entry_type), intent(inout) :: entry
    logical, intent(inout) :: meant(:)  !! keys that a mistyped name may mean
    type(deck_faults_type), intent(inout) :: faults
    type(string_type), allocatable :: names(:)
    character(len=:), allocatable :: name, hint
    integer(i4) :: near, k

    name = lower(token_text(source, entry%name))
    entry%key = table%group(group)%find(name)
    if (entry%key > 0) return
    entry%key = table%group(group)%find_old(name)
    if (entry%key > 0) then
      hint = table%group(group)%key(entry%key)%name
      call faults%add(source, 'D023', 'key '''//name//''' is now called '''//hint//'''', &
                      entry%name%line, entry%name%first, entry%name%last, 'write '//hint//' = ...')
      return
    end if
    call table%group(group)%key_names(names)
    near = table%group(group)%find(nearest_name(name, names))
    if (near > 0) meant(near) = .true.
    hint = did_you_mean(name, names, '')
    do k = 1, table%group_count
      if (len(hint) > 0) exit
      if (table%group(k)%find(name) > 0) &
        hint = ''''//name//''' belongs to group &'//table%group(k)%name
    end do
    if (len(hint) == 0) hint = did_you_mean(name, names, 'keys of &'//table%group(group)%name//':')
    call faults%add(source, 'D011', 'unknown key '''//name//''' in group &' &
                    //table%group(group)%name, entry%name%line, entry%name%first, &
                    entry%name%last, hint)
  end subroutine know_key
end module talus_deck_check
