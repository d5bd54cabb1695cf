!> The text of a deck: read whole, cut into lines, shown with a place underlined.
module talus_deck_source
  use talus_kinds, only: i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: folder_exists, plain_file
  implicit none
  private
  public :: deck_source_type

  integer(i4), parameter :: shown_width = 110       !! longest piece of a line that is shown
  integer(i8), parameter :: largest_deck = 100000000_i8  !! bytes; what is longer is no deck
  character(len=*), parameter :: newline = achar(10)

  !> A deck as text. Positions are bytes in `text`, columns count characters from 1.
  type :: deck_source_type
    character(len=:), allocatable :: path         !! as the user gave it
    character(len=:), allocatable :: text         !! lines end with a line feed, all of them
    integer(i4) :: line_count = 0
    integer(i4), allocatable :: first(:), last(:) !! bytes of each line without its end
  contains
    procedure :: load
    procedure :: line_text
    procedure :: column
    procedure :: place
  end type deck_source_type

contains

  !> Read a file whole. Faults: D001 cannot be read, D002 no text, D003 empty.
  subroutine load(self, path, errors)
    class(deck_source_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: raw

    self%path = path
    self%text = ''
    self%line_count = 0
    call read_whole(path, raw, errors)
    if (.not. allocated(raw)) return
    if (len(raw) == 0) then
      call errors%add('D003', 'the deck is empty', path, 'a deck holds groups: &name key = value /')
      return
    end if
    if (is_binary(raw)) then
      call errors%add('D002', 'this is no text file', path, &
                      'give the deck (.nml); it names packings and meshes itself')
      return
    end if
    call unify_line_ends(raw, self%text)
    call cut_lines(self)
  end subroutine load

  subroutine read_whole(path, raw, errors)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: raw
    type(error_list_type), intent(inout) :: errors
    character(len=256) :: message
    integer(i8) :: bytes
    integer :: unit, stat
    logical :: there

    inquire (file=path, exist=there)
    if (.not. there) then
      call errors%add('D001', 'there is no deck '''//path//'''', path, 'see its name and folder')
      return
    end if
    if (.not. (plain_file(path) .or. folder_exists(path))) then
      call errors%add('D001', 'the deck cannot be read: it is a pipe or a device', path, &
                      'give a text file')
      return
    end if
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', &
          action='read', iostat=stat, iomsg=message)
    if (stat == 0) then
      inquire (unit=unit, size=bytes)
      if (bytes > largest_deck) then
        call errors%add('D002', 'this is no deck: it has '//str(bytes)//' bytes', path)
      else
        allocate (character(len=max(bytes, 0_i8)) :: raw)
        if (bytes > 0) read (unit, iostat=stat, iomsg=message) raw
      end if
      close (unit)
    end if
    if (stat /= 0) then
      if (allocated(raw)) deallocate (raw)
      call errors%add('D001', 'the deck cannot be read: '//trim(message), path, &
                      'it must be a text file that you may read')
    end if
  end subroutine read_whole

  !> Control characters other than tab, line feed, form feed, carriage return.
  pure logical function is_binary(raw)
    character(len=*), intent(in) :: raw
    integer(i4) :: k, code
    is_binary = .true.
    do k = 1, len(raw)
      code = iachar(raw(k:k))
      if (code == 127 .or. (code < 32 .and. code /= 9 .and. code /= 10 .and. code /= 12 &
                            .and. code /= 13)) return
    end do
    is_binary = .false.
  end function is_binary

  !> Line ends of any system become line feeds, also behind the last line; no byte order mark.
  pure subroutine unify_line_ends(raw, text)
    character(len=*), intent(in) :: raw
    character(len=:), allocatable, intent(out) :: text
    integer(i4) :: k, n, first

    allocate (character(len=len(raw) + 1) :: text)
    n = 0
    first = 1
    if (index(raw, char(239)//char(187)//char(191)) == 1) first = 4
    do k = first, len(raw)
      if (raw(k:k) == achar(13)) then
        if (k < len(raw)) then
          if (raw(k + 1:k + 1) == newline) cycle
        end if
        n = n + 1
        text(n:n) = newline
      else
        n = n + 1
        text(n:n) = raw(k:k)
      end if
    end do
    if (n > 0) then
      if (text(n:n) == newline) n = n - 1
    end if
    text(n + 1:n + 1) = newline
    text = text(:n + 1)
  end subroutine unify_line_ends

  pure subroutine cut_lines(self)
    type(deck_source_type), intent(inout) :: self
    integer(i4) :: k, n

    n = 0
    do k = 1, len(self%text)
      if (self%text(k:k) == newline) n = n + 1
    end do
    self%line_count = n
    if (allocated(self%first)) deallocate (self%first, self%last)
    allocate (self%first(n), self%last(n))
    n = 1
    self%first(1) = 1
    do k = 1, len(self%text)
      if (self%text(k:k) /= newline) cycle
      self%last(n) = k - 1
      n = n + 1
      if (n <= self%line_count) self%first(n) = k + 1
    end do
  end subroutine cut_lines

  !> A line without its end; tabs become blanks.
  pure function line_text(self, line) result(text)
    class(deck_source_type), intent(in) :: self
    integer(i4), intent(in) :: line
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = self%text(self%first(line):self%last(line))
    do k = 1, len(text)
      if (iachar(text(k:k)) < 32) text(k:k) = ' '
    end do
  end function line_text

  !> Column of a byte of a line: characters (UTF-8), not bytes, are counted.
  pure integer(i4) function column(self, line, position)
    class(deck_source_type), intent(in) :: self
    integer(i4), intent(in) :: line, position
    column = 1 + characters(self%text(self%first(line):position - 1))
  end function column

  pure integer(i4) function characters(text)
    character(len=*), intent(in) :: text
    integer(i4) :: k
    characters = 0
    do k = 1, len(text)
      if (iand(iachar(text(k:k)), 192) /= 128) characters = characters + 1
    end do
  end function characters

  !> 'deck.nml:12:8', the line, and first..last of it underlined with ^~~~.
  pure function place(self, line, first, last) result(text)
    class(deck_source_type), intent(in) :: self
    integer(i4), intent(in) :: line          !! 0: the file as a whole
    integer(i4), intent(in) :: first, last   !! bytes of the text
    character(len=:), allocatable :: text, shown, head, dots
    integer(i4) :: start, finish, from, width

    if (line == 0) then
      text = self%path
      return
    end if
    shown = self%line_text(line)
    start = min(first, self%last(line) + 1) - self%first(line) + 1
    finish = max(start, min(last, self%last(line)) - self%first(line) + 1)
    head = str(line)
    text = self%path//':'//head//':'//str(self%column(line, first))
    from = 1
    dots = ''
    if (len(shown) > shown_width .and. start > shown_width/2) then
      from = start - shown_width/2
      do while (iand(iachar(shown(from:from)), 192) == 128)
        from = from - 1
      end do
      dots = '...'
    end if
    width = max(0, characters(shown(start:min(finish, len(shown)))) - 1)
    width = min(width, shown_width)
    start = len(dots) + characters(shown(from:start - 1))
    text = text//newline//'  '//right(head)//' | '//dots//cut(shown(from:)) &
           //newline//'  '//right('')//' | '//repeat(' ', start)//'^'//repeat('~', width)
  end function place

  pure function cut(text) result(short)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: short
    integer(i4) :: last
    if (len(text) <= shown_width) then
      short = text
      return
    end if
    last = shown_width
    do while (iand(iachar(text(last + 1:last + 1)), 192) == 128)
      last = last - 1
    end do
    short = text(:last)//'...'
  end function cut

  pure function right(text) result(padded)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: padded
    padded = repeat(' ', max(0, 5 - len(text)))//text
  end function right
end module talus_deck_source
