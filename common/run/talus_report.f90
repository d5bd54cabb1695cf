!> Answers of the command line that all three programs give alike: faults, key table, deck as read.
module talus_report
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, str, join
  use talus_errors, only: error_list_type, error_type
  use talus_json, only: json_type
  use talus_memory_text, only: foretold_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type, deck_key_type, deck_group_type, &
    deck_condition_type, range_text, rule_text, conditions_text
  implicit none
  private
  public :: report_check, report_keys, faults_json, keys_json, split_place, put_faults

contains

  !> Outcome of --check: the deck as understood on stdout, or faults on stderr; with json one
  !! object on stdout. A deck that was never read (no path) is not echoed.
  subroutine report_check(program, deck, errors, json, analysis, foretold)
    character(len=*), intent(in) :: program
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(in) :: errors
    logical, intent(in) :: json
    character(len=*), intent(in), optional :: analysis  !! kind of a solid's analysis
    type(foretold_type), intent(in), optional :: foretold  !! memory that a run takes
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: path
    integer(i4) :: k

    path = ''
    if (allocated(deck%source%path)) path = deck%source%path
    if (json) then
      write (output_unit, '(a)', advance='no') faults_json(program, path, errors, &
        analysis, foretold)
    else if (errors%any()) then
      call errors%print(error_unit)
    else
      call deck%echo(lines)
      do k = 1, size(lines)
        write (output_unit, '(a)') lines(k)%s
      end do
      write (output_unit, '(a)') program//': '//path//' is good'
      if (present(foretold)) then
        if (allocated(foretold%text)) write (output_unit, '(a)') foretold%text
      end if
    end if
    flush (output_unit)
  end subroutine report_check

  !> Faults as JSON: program, deck, ok, analysis (of a solid), memory (of each rank, MiB),
  !! entities (grains or nodes),
  !! errors[code, message, place, line, column, source, hint].
  function faults_json(program, deck, errors, analysis, foretold) result(text)
    character(len=*), intent(in) :: program, deck
    type(error_list_type), intent(in) :: errors
    character(len=*), intent(in), optional :: analysis  !! kind of a solid's analysis
    type(foretold_type), intent(in), optional :: foretold  !! memory that a run takes
    character(len=:), allocatable :: text
    type(json_type) :: json

    call json%begin()
    call json%put('program', program)
    call json%put('deck', deck)
    call json%put('ok', .not. errors%any())
    call json%put('exit_code', errors%exit_code())
    if (present(analysis)) call json%put('analysis', analysis)
    if (present(foretold)) then
      if (allocated(foretold%most)) call json%put('memory', foretold%most)
      if (allocated(foretold%most)) call json%put('entities', foretold%entities)
    end if
    call put_faults(json, 'errors', errors)
    call json%end()
    text = json%text()
  end function faults_json

  !> Faults as an array of a JSON object that is being written.
  subroutine put_faults(json, name, errors)
    type(json_type), intent(inout) :: json
    character(len=*), intent(in) :: name
    type(error_list_type), intent(in) :: errors
    character(len=:), allocatable :: place, source
    integer(i4) :: k, line, column

    call json%begin_array(name)
    do k = 1, errors%count
      associate (fault => errors%item(k))
        call split_place(fault%place, place, line, column, source)
        call json%begin()
        call json%put('code', fault%code)
        call json%put('message', fault%message)
        call json%put('place', place)
        call json%put('line', line)
        call json%put('column', column)
        call json%put('source', source)
        call json%put('hint', fault%hint)
        call json%end()
      end associate
    end do
    call json%end()
  end subroutine put_faults

  !> A place as the deck reader writes it: first line, line and column number (0 if it has none),
  !! and the underlined source below it.
  pure subroutine split_place(full, place, line, column, source)
    character(len=*), intent(in) :: full
    character(len=:), allocatable, intent(out) :: place, source
    integer(i4), intent(out) :: line, column
    integer(i4) :: cut, last, middle
    integer :: stat

    cut = index(full, new_line('a'))
    place = full
    source = ''
    if (cut > 0) then
      place = full(:cut - 1)
      source = full(cut + 1:)
    end if
    line = 0
    column = 0
    last = index(place, ':', back=.true.)
    if (last < 3) return
    middle = index(place(:last - 1), ':', back=.true.)
    if (middle < 2 .or. middle + 1 == last .or. last == len(place)) return
    if (verify(place(middle + 1:last - 1)//place(last + 1:), '0123456789') /= 0) return
    read (place(middle + 1:last - 1), *, iostat=stat) line
    read (place(last + 1:), *, iostat=stat) column
  end subroutine split_place

  !> Answer of --keys: the key table on stdout, readable or as JSON.
  subroutine report_keys(table, json)
    type(key_table_type), intent(in) :: table
    logical, intent(in) :: json
    integer(i4) :: g, k

    if (json) then
      write (output_unit, '(a)', advance='no') keys_json(table)
      flush (output_unit)
      return
    end if
    write (output_unit, '(a)') 'Groups and keys of '//table%program//' (! marks what is required)'
    do g = 1, table%group_count
      associate (group => table%group(g))
        write (output_unit, '(a)') ''
        write (output_unit, '(a)') '&'//group%name//trim(merge(' !', '  ', group%required)) &
          //trim(merge('  (may occur several times)', '                           ', group%repeats))
        call write_folded(group%doc, 2)
        call write_group_rules(group)
        do k = 1, group%key_count
          call write_key(group%key(k))
        end do
      end associate
    end do
    flush (output_unit)
  end subroutine report_keys

  subroutine write_key(key)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text

    text = '  '//key%name//repeat(' ', max(1, 22 - len(key%name)))//kind_text(key)
    if (key%required) text = text//' !'
    if (len(key%unit) > 0) text = text//' ['//key%unit//']'
    if (allocated(key%preset)) text = text//'  default '//preset_text(key)
    if (len(range_text(key)) > 0) text = text//'  '//range_text(key)
    write (output_unit, '(a)') text
    call write_folded(key%doc, 24)
    if (len(rule_text(key)) > 0) call write_folded('('//rule_text(key)//')', 24)
  end subroutine write_key

  !> With which choices of other groups it has a meaning, and keys of which one must be given.
  subroutine write_group_rules(group)
    type(deck_group_type), intent(in) :: group
    integer(i4) :: k
    if (allocated(group%belongs)) &
      call write_folded('(only with '//conditions_text(group%belongs)//')', 2)
    if (.not. allocated(group%set)) return
    do k = 1, size(group%set)
      call write_folded('('//trim(merge('exactly one of ', 'at least one of', group%set(k)%exact)) &
                        //' '''//join(group%set(k)%key, ''', ''')//''')', 2)
    end do
  end subroutine write_group_rules

  pure function kind_text(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text
    text = key%kind
    if (key%most == huge(key%most)) then
      text = text//'('//str(key%least)//'...)'
    else if (key%most > key%least) then
      text = text//'('//str(key%least)//'-'//str(key%most)//')'
    else if (key%most > 1) then
      text = text//'('//str(key%most)//')'
    end if
  end function kind_text

  pure function preset_text(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text
    if (key%kind == 'string' .or. key%kind == 'file') then
      text = ''''//join(key%preset, ''', ''')//''''
    else
      text = join(key%preset, ', ')
    end if
  end function preset_text

  !> A text in lines of at most 96 columns, indented.
  subroutine write_folded(text, indent)
    character(len=*), intent(in) :: text
    integer(i4), intent(in) :: indent
    integer(i4) :: first, last, room

    room = 96 - indent
    first = 1
    do while (len(text) - first + 1 > room)
      last = first + index(text(first:first + room - 1), ' ', back=.true.) - 2
      if (last < first) last = first + room - 1
      write (output_unit, '(a)') repeat(' ', indent)//text(first:last)
      first = last + 1
      if (text(first:first) == ' ') first = first + 1
    end do
    write (output_unit, '(a)') repeat(' ', indent)//text(first:)
  end subroutine write_folded

  !> The key table as JSON: program, groups[name, doc, repeat, required, keys[...]].
  function keys_json(table) result(text)
    type(key_table_type), intent(in) :: table
    character(len=:), allocatable :: text
    type(json_type) :: json
    integer(i4) :: g, k

    call json%begin()
    call json%put('program', table%program)
    call json%begin_array('groups')
    do g = 1, table%group_count
      associate (group => table%group(g))
        call json%begin()
        call json%put('name', group%name)
        call json%put('doc', group%doc)
        call json%put('repeat', group%repeats)
        call json%put('required', group%required)
        call put_conditions(json, 'of', group%belongs)
        if (allocated(group%was)) call json%put('was', group%was)
        call put_sets(json, group)
        call json%begin_array('keys')
        do k = 1, group%key_count
          call put_key(json, group%key(k))
        end do
        call json%end()
        call json%end()
      end associate
    end do
    call json%end()
    call json%end()
    text = json%text()
  end function keys_json

  subroutine put_key(json, key)
    type(json_type), intent(inout) :: json
    type(deck_key_type), intent(in) :: key

    call json%begin()
    call json%put('name', key%name)
    call json%put('type', key%kind)
    call json%put('least', key%least)
    if (key%most == huge(key%most)) then
      call json%put_null('most')
    else
      call json%put('most', key%most)
    end if
    call json%put('unit', key%unit)
    call json%put('required', key%required)
    if (allocated(key%preset)) call json%put('default', key%preset)
    if (key%low > -huge(1.0_wp)) call json%put(trim(merge('above', 'min  ', key%low_open)), key%low)
    if (key%high < huge(1.0_wp)) &
      call json%put(trim(merge('below', 'max  ', key%high_open)), key%high)
    if (allocated(key%choice)) call json%put('choices', key%choice)
    if (allocated(key%word)) call json%put('words', key%word)
    call put_conditions(json, 'of', key%belongs)
    call put_conditions(json, 'required_with', key%need_if)
    if (allocated(key%needs)) call json%put('needs', key%needs)
    if (allocated(key%excludes)) call json%put('excludes', key%excludes)
    if (allocated(key%was)) call json%put('was', key%was)
    call put_choices_of(json, key)
    call json%put('doc', key%doc)
    call json%end()
  end subroutine put_key

  !> `name: {"law": ["linear"]}`, nothing where there are no conditions.
  subroutine put_conditions(json, name, list)
    type(json_type), intent(inout) :: json
    character(len=*), intent(in) :: name
    type(deck_condition_type), allocatable, intent(in) :: list(:)
    integer(i4) :: c
    if (.not. allocated(list)) return
    call json%begin(name)
    do c = 1, size(list)
      call json%put(chooser(list(c)), list(c)%value)
    end do
    call json%end()
  end subroutine put_conditions

  !> `choices_of: [{"choice": "jkr", "law": ["hertz"]}]`.
  subroutine put_choices_of(json, key)
    type(json_type), intent(inout) :: json
    type(deck_key_type), intent(in) :: key
    integer(i4) :: c
    if (.not. allocated(key%choice_if)) return
    call json%begin_array('choices_of')
    do c = 1, size(key%choice_if)
      call json%begin()
      call json%put('choice', key%choice_if(c)%choice)
      call json%put(chooser(key%choice_if(c)), key%choice_if(c)%value)
      call json%end()
    end do
    call json%end()
  end subroutine put_choices_of

  !> `sets: [{"keys": ["a", "b"], "exactly_one": true}]`.
  subroutine put_sets(json, group)
    type(json_type), intent(inout) :: json
    type(deck_group_type), intent(in) :: group
    integer(i4) :: c
    if (.not. allocated(group%set)) return
    call json%begin_array('sets')
    do c = 1, size(group%set)
      call json%begin()
      call json%put('keys', group%set(c)%key)
      call json%put('exactly_one', group%set(c)%exact)
      call json%end()
    end do
    call json%end()
  end subroutine put_sets

  !> 'law', or 'analysis.kind' of another group.
  pure function chooser(condition) result(name)
    type(deck_condition_type), intent(in) :: condition
    character(len=:), allocatable :: name
    name = condition%key
    if (len(condition%group) > 0) name = condition%group//'.'//name
  end function chooser
end module talus_report
