!> Deck text to tokens: words, strings, = , / and the &names of groups; comments go.
module talus_deck_tokens
  use talus_kinds, only: i4
  use talus_deck_source, only: deck_source_type
  use talus_deck_faults, only: deck_faults_type
  implicit none
  private
  public :: token_type, token_list_type, read_tokens, token_text
  public :: token_word, token_string, token_equals, token_comma, token_slash, token_group

  integer(i4), parameter :: token_word = 1, token_string = 2, token_equals = 3
  integer(i4), parameter :: token_comma = 4, token_slash = 5, token_group = 6
  character(len=*), parameter :: blanks = ' '//achar(9)//achar(12)
  character(len=*), parameter :: ends_word = blanks//',=&!"'''

  !> A token: bytes first..last of a line; strings with their quotes, groups with their &.
  type :: token_type
    integer(i4) :: kind = 0, line = 0, first = 0, last = 0
    logical :: broken = .false.   !! string without its closing quote
  end type token_type

  !> Tokens of a deck in order.
  type :: token_list_type
    integer(i4) :: count = 0
    type(token_type), allocatable :: item(:)
  end type token_list_type

contains

  !> All tokens of a deck. Faults: D004 text outside groups, D005 missing quote.
  subroutine read_tokens(source, tokens, faults)
    type(deck_source_type), intent(in) :: source
    type(token_list_type), intent(inout) :: tokens
    type(deck_faults_type), intent(inout) :: faults
    integer(i4) :: line, at
    logical :: inside, stray_above

    tokens%count = 0
    if (allocated(tokens%item)) deallocate (tokens%item)
    allocate (tokens%item(64))
    inside = .false.
    stray_above = .false.
    do line = 1, source%line_count
      at = source%first(line)
      do
        at = next_text(source, line, at)
        if (at > source%last(line)) exit
        if (inside .or. source%text(at:at) == '&') then
          call read_token(source, line, at, tokens, faults)
          inside = tokens%item(tokens%count)%kind /= token_slash
          stray_above = .false.
        else
          call pass_stray(source, line, at, stray_above, faults)
        end if
      end do
    end do
  end subroutine read_tokens

  !> First byte from `at` that is neither blank nor comment; last + 1 if there is none.
  pure integer(i4) function next_text(source, line, at)
    type(deck_source_type), intent(in) :: source
    integer(i4), intent(in) :: line, at
    do next_text = at, source%last(line)
      if (index(blanks, source%text(next_text:next_text)) > 0) cycle
      if (source%text(next_text:next_text) == '!') exit
      return
    end do
    next_text = source%last(line) + 1
  end function next_text

  !> Pass text outside groups, up to the next group, comment or end of line; lines that follow each
  !! other make one fault.
  subroutine pass_stray(source, line, at, stray_above, faults)
    type(deck_source_type), intent(in) :: source
    integer(i4), intent(in) :: line
    integer(i4), intent(inout) :: at
    logical, intent(inout) :: stray_above
    type(deck_faults_type), intent(inout) :: faults
    integer(i4) :: last, next

    next = scan(source%text(at:source%last(line)), '&!')
    next = merge(source%last(line) + 1, at + next - 1, next == 0)
    last = at - 1 + verify(source%text(at:next - 1), blanks, back=.true.)
    if (.not. stray_above) then
      if (source%text(at:last) == '/') then
        call faults%add(source, 'D004', 'this ''/'' closes no group', line, at, last, &
                        'the group before is closed already: remove one of the two')
      else
        call faults%add(source, 'D004', 'text outside groups', line, at, last, &
                        'text belongs inside a group, &name ... /, or behind a !')
      end if
    end if
    stray_above = .true.
    at = next
  end subroutine pass_stray

  !> One token inside a group, or the &name that opens one.
  subroutine read_token(source, line, at, tokens, faults)
    type(deck_source_type), intent(in) :: source
    integer(i4), intent(in) :: line
    integer(i4), intent(inout) :: at
    type(token_list_type), intent(inout) :: tokens
    type(deck_faults_type), intent(inout) :: faults
    type(token_type) :: token

    token%line = line
    token%first = at
    token%last = at
    select case (source%text(at:at))
    case ('=')
      token%kind = token_equals
    case (',')
      token%kind = token_comma
    case ('/')
      token%kind = token_slash
    case ('&')
      token%kind = token_group
      token%last = word_end(source, line, at + 1)
    case ('''', '"')
      token%kind = token_string
      call close_string(source, token, tokens, faults)
    case default
      token%kind = token_word
      token%last = word_end(source, line, at)
    end select
    at = token%last + 1
    call append_token(tokens, token)
  end subroutine read_token

  !> Last byte of a word that starts at `first`. A / belongs to it only between two other letters.
  pure integer(i4) function word_end(source, line, first)
    type(deck_source_type), intent(in) :: source
    integer(i4), intent(in) :: line, first
    integer(i4) :: k

    word_end = first - 1
    do k = first, source%last(line)
      if (index(ends_word, source%text(k:k)) > 0) return
      if (source%text(k:k) == '/') then
        if (k == first .or. k == source%last(line)) return
        if (index(ends_word//'/', source%text(k + 1:k + 1)) > 0) return
      end if
      word_end = k
    end do
  end function word_end

  !> Find the closing quote (a doubled one is the character itself), or report that it is missing.
  subroutine close_string(source, token, tokens, faults)
    type(deck_source_type), intent(in) :: source
    type(token_type), intent(inout) :: token
    type(token_list_type), intent(in) :: tokens
    type(deck_faults_type), intent(inout) :: faults
    character(len=1) :: quote
    integer(i4) :: k, from

    quote = source%text(token%first:token%first)
    k = token%first + 1
    do while (k <= source%last(token%line))
      if (source%text(k:k) == quote) then
        if (source%text(k + 1:k + 1) /= quote) then
          token%last = k
          return
        end if
        k = k + 1
      end if
      k = k + 1
    end do
    token%last = source%last(token%line)
    token%broken = .true.
    from = first_suspect(source, tokens, token)
    call faults%add(source, 'D005', 'a quote is missing: this string does not end on its line', &
                    token%line, from, token%last, 'close the string with '//quote)
    faults%murky(token%line) = min(from, faults%murky(token%line))
  end subroutine close_string

  !> Where the trouble of a line with an odd number of quotes starts: at the first string that is
  !! followed at once by other text, else at the string that does not end.
  pure integer(i4) function first_suspect(source, tokens, open_string)
    type(deck_source_type), intent(in) :: source
    type(token_list_type), intent(in) :: tokens
    type(token_type), intent(in) :: open_string
    integer(i4) :: k

    first_suspect = open_string%first
    do k = tokens%count, 1, -1
      associate (token => tokens%item(k))
        if (token%line /= open_string%line) exit
        if (token%kind /= token_string) cycle
        if (index(blanks//',/!', source%text(token%last + 1:token%last + 1)) > 0) cycle
        first_suspect = token%first
      end associate
    end do
  end function first_suspect

  subroutine append_token(tokens, token)
    type(token_list_type), intent(inout) :: tokens
    type(token_type), intent(in) :: token
    type(token_type), allocatable :: longer(:)

    if (tokens%count == size(tokens%item)) then
      allocate (longer(2*tokens%count))
      longer(:tokens%count) = tokens%item
      call move_alloc(longer, tokens%item)
    end if
    tokens%count = tokens%count + 1
    tokens%item(tokens%count) = token
  end subroutine append_token

  !> Value of a token: strings without quotes, groups without &, words unchanged.
  pure function token_text(source, token) result(text)
    type(deck_source_type), intent(in) :: source
    type(token_type), intent(in) :: token
    character(len=:), allocatable :: text
    character(len=1) :: quote
    integer(i4) :: k

    select case (token%kind)
    case (token_string)
      quote = source%text(token%first:token%first)
      text = ''
      k = token%first + 1
      do while (k < token%last + merge(1, 0, token%broken))
        text = text//source%text(k:k)
        k = k + merge(2, 1, source%text(k:k) == quote)
      end do
    case (token_group)
      text = source%text(token%first + 1:token%last)
    case default
      text = source%text(token%first:token%last)
    end select
  end function token_text
end module talus_deck_tokens
