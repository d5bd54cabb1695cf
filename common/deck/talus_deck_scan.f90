!> Deck tokens to groups, keys and values.
module talus_deck_scan
  use talus_kinds, only: i4
  use talus_text, only: str, lower
  use talus_deck_source, only: deck_source_type
  use talus_deck_faults, only: deck_faults_type
  use talus_deck_tokens, only: token_type, token_list_type, read_tokens, token_text, token_word, &
    token_string, token_equals, token_comma, token_slash, token_group
  implicit none
  private
  public :: deck_syntax_type, deck_instance_type, deck_entry_type, scan_deck

  !> One group as written in the deck.
  type :: deck_instance_type
    type(token_type) :: head
    logical :: broken = .false.          !! a quote is missing in it: keys may be lost
    integer(i4) :: group = 0             !! number in the table, 0 unknown
    integer(i4) :: number = 0            !! 1-based among the groups of its name
    integer(i4) :: first_entry = 1, last_entry = 0
  end type deck_instance_type

  !> One `key = values` as written in the deck.
  type :: deck_entry_type
    type(token_type) :: name
    integer(i4) :: key = 0               !! number in the table, 0 unknown
    integer(i4) :: first = 1, last = 0   !! its values in value(:)
  end type deck_entry_type

  !> A deck taken apart.
  type :: deck_syntax_type
    integer(i4) :: instance_count = 0, entry_count = 0, value_count = 0
    type(deck_instance_type), allocatable :: instance(:)
    type(deck_entry_type), allocatable :: entry(:)
    type(token_type), allocatable :: value(:)
  end type deck_syntax_type

contains

  !> Take a deck apart. Faults: D003 nothing in it, D004 to D007.
  subroutine scan_deck(source, syntax, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_syntax_type), intent(inout) :: syntax
    type(deck_faults_type), intent(inout) :: faults
    type(token_list_type) :: tokens
    integer(i4) :: at

    call read_tokens(source, tokens, faults)
    syntax%instance_count = 0
    syntax%entry_count = 0
    syntax%value_count = 0
    if (allocated(syntax%instance)) deallocate (syntax%instance, syntax%entry, syntax%value)
    allocate (syntax%instance(count(tokens%item(:tokens%count)%kind == token_group)))
    allocate (syntax%entry(tokens%count), syntax%value(tokens%count))
    at = 1
    do while (at <= tokens%count)
      call scan_group(source, tokens, at, syntax, faults)
    end do
    if (syntax%instance_count == 0 .and. .not. faults%list%any()) &
      call faults%add(source, 'D003', 'the deck holds no group', 0, 0, 0, &
                      'a deck holds groups: &name key = value /')
  end subroutine scan_deck

  !> One group, from its &name to its / or its substitute.
  subroutine scan_group(source, tokens, at, syntax, faults)
    type(deck_source_type), intent(in) :: source
    type(token_list_type), intent(in) :: tokens
    integer(i4), intent(inout) :: at
    type(deck_syntax_type), intent(inout) :: syntax
    type(deck_faults_type), intent(inout) :: faults

    syntax%instance_count = syntax%instance_count + 1
    associate (instance => syntax%instance(syntax%instance_count))
      instance%head = tokens%item(at)
      instance%first_entry = syntax%entry_count + 1
      at = at + 1
      do while (at <= tokens%count)
        if (tokens%item(at)%kind == token_slash .or. tokens%item(at)%kind == token_group) exit
        if (starts_entry(tokens, at)) then
          call scan_entry(source, tokens, at, syntax, faults)
        else
          call pass_unexpected(source, tokens, at, faults)
        end if
      end do
      instance%last_entry = syntax%entry_count
      instance%broken = lost_quote(tokens, instance%head, at)
      call close_group(source, tokens, at, instance, faults)
    end associate
  end subroutine scan_group

  !> Pass the / of a group, or report that it is missing.
  subroutine close_group(source, tokens, at, instance, faults)
    type(deck_source_type), intent(in) :: source
    type(token_list_type), intent(in) :: tokens
    integer(i4), intent(inout) :: at
    type(deck_instance_type), intent(in) :: instance
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: name, before

    if (at <= tokens%count) then
      if (tokens%item(at)%kind == token_slash) then
        at = at + 1
        return
      end if
    end if
    if (instance%broken) return
    name = '&'//token_text(source, instance%head)
    before = 'the end of the deck'
    if (at <= tokens%count) before = source%text(tokens%item(at)%first:tokens%item(at)%last)
    associate (token => tokens%item(min(at, tokens%count)))
      call faults%add(source, 'D006', 'a ''/'' is missing: group '//name//' (line ' &
                      //str(instance%head%line)//') is still open at '//before, token%line, &
                      merge(token%first, token%last + 1, at <= tokens%count), token%last, &
                      'close '//name//' with a / before this place')
    end associate
  end subroutine close_group

  pure logical function lost_quote(tokens, head, next)
    type(token_list_type), intent(in) :: tokens
    type(token_type), intent(in) :: head
    integer(i4), intent(in) :: next
    integer(i4) :: k
    lost_quote = .false.
    do k = next - 1, 1, -1
      if (tokens%item(k)%first <= head%first) exit
      lost_quote = lost_quote .or. tokens%item(k)%broken
    end do
  end function lost_quote

  !> A word and an equals sign.
  pure logical function starts_entry(tokens, at)
    type(token_list_type), intent(in) :: tokens
    integer(i4), intent(in) :: at
    starts_entry = .false.
    if (at >= tokens%count) return
    starts_entry = tokens%item(at)%kind == token_word .and. tokens%item(at + 1)%kind == token_equals
  end function starts_entry

  !> `key = value, value`: from the word to the last value (and a comma behind it).
  subroutine scan_entry(source, tokens, at, syntax, faults)
    type(deck_source_type), intent(in) :: source
    type(token_list_type), intent(in) :: tokens
    integer(i4), intent(inout) :: at
    type(deck_syntax_type), intent(inout) :: syntax
    type(deck_faults_type), intent(inout) :: faults
    type(token_type) :: token
    logical :: comma

    syntax%entry_count = syntax%entry_count + 1
    associate (entry => syntax%entry(syntax%entry_count))
      entry%name = tokens%item(at)
      entry%first = syntax%value_count + 1
      at = at + 2
      comma = .true.
      do while (at <= tokens%count)
        token = tokens%item(at)
        if (token%kind == token_comma) then
          if (comma) call faults%add(source, 'D007', 'a value is missing before this comma', &
                                     token%line, token%first, token%last, &
                                     'write the value, or remove the comma')
          comma = .true.
        else if (starts_entry(tokens, at)) then
          exit
        else if (token%kind == token_word .or. token%kind == token_string) then
          syntax%value_count = syntax%value_count + 1
          syntax%value(syntax%value_count) = token
          comma = .false.
        else
          exit
        end if
        at = at + 1
      end do
      entry%last = syntax%value_count
    end associate
  end subroutine scan_entry

  !> Text in a group that belongs to no key: one fault for all of it on a line.
  subroutine pass_unexpected(source, tokens, at, faults)
    type(deck_source_type), intent(in) :: source
    type(token_list_type), intent(in) :: tokens
    integer(i4), intent(inout) :: at
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: message, hint
    integer(i4) :: from, last

    from = at
    do while (at <= tokens%count)
      if (tokens%item(at)%kind == token_slash .or. tokens%item(at)%kind == token_group) exit
      if (starts_entry(tokens, at)) exit
      at = at + 1
    end do
    associate (token => tokens%item(from))
      last = from
      do while (last + 1 < at)
        if (tokens%item(last + 1)%line /= token%line) exit
        last = last + 1
      end do
      hint = 'a group holds key = value, value ...'
      select case (token%kind)
      case (token_equals)
        message = 'there is no key before this ''='''
        if (from > 1) then
          if (tokens%item(from - 1)%kind == token_string) hint = 'a key is written without quotes'
        end if
      case (token_comma)
        message = 'this comma follows no value'
      case (token_string)
        message = 'this string belongs to no key'
      case default
        message = 'there is no ''='' after '''//lower(token_text(source, token))//''''
      end select
      call faults%add(source, 'D007', message, token%line, token%first, tokens%item(last)%last, &
                      hint)
    end associate
  end subroutine pass_unexpected
end module talus_deck_scan
