!> Command lines without a shell: words, quotes, and variables of the environment.
module talus_command
  use talus_kinds, only: i4
  use talus_system, only: environment
  use talus_text, only: string_type, append_string
  implicit none
  private
  public :: command_words

  character(len=*), parameter :: of_names = &
    'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_'

  !> Where the reading stands.
  type :: reader_type
    character(len=:), allocatable :: word
    logical :: begun = .false.  !! a word, though it may be empty
    character :: quote = ' '    !! that is open
  end type reader_type

contains

  !> Words of a command line: blanks part them, '...' and "..." hold them together; outside of '...'
  !! $NAME and ${NAME} stand for variables of the environment, and \ takes what follows as it is.
  !! Nothing else of a shell: no pipes, no commands put in. `closed`: no quote is left open.
  subroutine command_words(text, words, closed)
    character(len=*), intent(in) :: text
    type(string_type), allocatable, intent(out) :: words(:)
    logical, intent(out) :: closed
    type(reader_type) :: now
    integer(i4) :: k

    allocate (words(0))
    now%word = ''
    k = 1
    do while (k <= len(text))
      call take(text, k, now)
      if (.not. now%begun .or. now%quote /= ' ') cycle
      if (len_trim(text(k:min(k, len(text)))) > 0) cycle  ! it goes on
      call append_string(words, now%word)
      now%word = ''
      now%begun = .false.
    end do
    closed = now%quote == ' '
  end subroutine command_words

  !> The next character, or what it stands for; k goes on behind it.
  subroutine take(text, k, now)
    character(len=*), intent(in) :: text
    integer(i4), intent(inout) :: k
    type(reader_type), intent(inout) :: now
    character(len=:), allocatable :: value
    character :: c

    c = text(k:k)
    k = k + 1
    if (c == now%quote .and. c /= ' ') then
      now%quote = ' '
    else if (now%quote == "'") then
      now%word = now%word//c
    else if (now%quote == ' ' .and. scan(c, '"''') > 0) then
      now%quote = c
      now%begun = .true.
    else if (c == '$') then
      call take_variable(text, k, value)
      now%word = now%word//value
      now%begun = now%begun .or. len(value) > 0
    else if (c /= ' ' .or. now%quote /= ' ') then
      if (c == '\' .and. k <= len(text)) then
        c = text(k:k)
        k = k + 1
      end if
      now%word = now%word//c
      now%begun = .true.
    end if
  end subroutine take

  !> Value of the variable whose name, in braces or not, begins at k; '$' where none does.
  subroutine take_variable(text, k, value)
    character(len=*), intent(in) :: text
    integer(i4), intent(inout) :: k
    character(len=:), allocatable, intent(out) :: value
    integer(i4) :: first, length

    first = k
    if (k <= len(text)) first = k + merge(1, 0, text(k:k) == '{')
    length = verify(text(first:)//'$', of_names) - 1
    value = '$'
    if (length == 0) return
    value = environment(text(first:first + length - 1))
    k = first + length
    if (text(first - 1:first - 1) == '{' .and. k <= len(text)) k = k + merge(1, 0, text(k:k) == '}')
  end subroutine take_variable
end module talus_command
