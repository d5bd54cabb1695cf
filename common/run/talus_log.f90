!> The log of a run: the same text on standard output and in a file.
!!
!! Order of a whole log: header, deck_echo, section/item for the model, row_titles and rows spaced
!! by wall time, health, timer_table, finish. A progress bar is drawn only on a terminal. A log that
!! can no longer be written does not stop the run: that is said once on standard error.
module talus_log
  use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_files, only: open_append, write_text, close_file
  use talus_system, only: compiler_text, date_text, host_name, is_terminal, memory_free, &
    memory_resident, process_id, wall_clock
  use talus_text, only: str, string_type, is_finite
  use talus_timers, only: timers_type
  use talus_version, only: git_hash, version_text
  implicit none
  private
  public :: log_type, short_number, duration_text

  integer(i4), parameter :: item_width = 26                !! column of values
  integer(i4), parameter :: narrowest = 10                 !! narrowest column of rows
  real(wp), parameter :: first_spacing = 0.5_wp            !! wall time between rows, at first [s]
  real(wp), parameter :: last_spacing = 30.0_wp            !! and at last [s]
  real(wp), parameter :: bar_spacing = 0.2_wp              !! between redraws of the bar [s]

  !> A log that is open, or on the screen only.
  type :: log_type
    character(len=:), allocatable :: path
    logical :: screen = .true.                             !! also to standard output
    integer(i4), private :: descriptor = -1
    character(len=:), allocatable, private :: kept         !! lines for a file that is opened later
    logical, private :: terminal = .false.
    logical, private :: bar_drawn = .false.
    real(wp), private :: begun = 0.0_wp                    !! wall clock at open [s]
    real(wp), private :: next_row = 0.0_wp                 !! wall clock of the next row [s]
    real(wp), private :: spacing = first_spacing           !! [s]
    real(wp), private :: next_bar = 0.0_wp                 !! [s]
    integer(i4), allocatable, private :: width(:)          !! of the columns of rows
  contains
    procedure :: hold
    procedure :: open => open_log
    procedure :: line
    procedure :: section
    procedure :: item
    procedure :: warn
    procedure :: header
    procedure :: deck_echo
    procedure :: memory
    procedure :: row_titles
    procedure :: row_due
    procedure, private :: row_texts, row_reals
    generic :: row => row_texts, row_reals
    procedure :: progress
    procedure :: health
    procedure :: timer_table
    procedure :: faults
    procedure :: finish
    procedure :: close => close_log
  end type log_type

contains

  !> Begin a log on the screen; its lines also go to the file that `open` makes later.
  subroutine hold(self)
    class(log_type), intent(inout) :: self
    type(error_list_type) :: none
    call self%open('', none)
    self%kept = ''
  end subroutine hold

  !> Begin a log; with an empty path on the screen only.
  subroutine open_log(self, path, errors, append, screen)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    logical, intent(in), optional :: append  !! go on in the file of an earlier part of the run
    logical, intent(in), optional :: screen  !! .false.: file only
    logical :: fresh

    self%path = path
    fresh = .true.
    if (present(append)) fresh = .not. append
    if (present(screen)) self%screen = screen
    if (allocated(self%kept)) then
      call open_append(path, fresh, self%descriptor, errors)
      if (self%descriptor >= 0) &
        call write_text(self%descriptor, path, self%kept, errors)
      deallocate (self%kept)
      return
    end if
    self%terminal = self%screen .and. is_terminal(1_i4)
    self%begun = wall_clock()
    self%next_row = self%begun
    self%next_bar = self%begun
    self%spacing = first_spacing
    if (len(path) > 0) call open_append(path, fresh, self%descriptor, errors)
  end subroutine open_log

  !> One line, or several with line ends between them.
  subroutine line(self, text)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: text
    type(error_list_type) :: errors
    integer :: stat

    if (self%screen) then
      if (self%bar_drawn) write (output_unit, '(a)', advance='no', iostat=stat) &
        achar(13)//repeat(' ', 79)//achar(13)
      self%bar_drawn = .false.
      write (output_unit, '(a)', iostat=stat) text
      flush (output_unit, iostat=stat)
    end if
    if (allocated(self%kept)) self%kept = self%kept//text//new_line('a')
    if (self%descriptor < 0) return
    call write_text(self%descriptor, self%path, text//new_line('a'), errors)
    if (.not. errors%any()) return
    write (error_unit, '(a)', iostat=stat) 'warning: the log is not written further: '// &
      errors%item(1)%message
    errors%count = 0
    call close_file(self%descriptor, self%path, .false., errors)
  end subroutine line

  !> A heading with an empty line before it.
  subroutine section(self, title)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: title
    call self%line('')
    call self%line(title)
  end subroutine section

  !> '  name                    value   note'
  subroutine item(self, name, value, note)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: name, value
    character(len=*), intent(in), optional :: note
    character(len=:), allocatable :: text
    text = '  '//name
    text = text//repeat(' ', max(1, item_width - len(text)))//value
    if (present(note)) text = text//'   '//note
    call self%line(text)
  end subroutine item

  subroutine warn(self, text)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: text
    call self%line('warning: '//text)
  end subroutine warn

  !> Who runs what, where, with what.
  subroutine header(self, program, title, deck, deck_hash, ranks, threads)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: program    !! 'talus-dem'
    character(len=*), intent(in) :: title      !! of the deck; may be empty
    character(len=*), intent(in) :: deck       !! path
    character(len=*), intent(in) :: deck_hash
    integer(i4), intent(in) :: ranks, threads
    call self%line(program//' '//version_text()//', git '//git_hash())
    if (len(title) > 0) call self%line(title)
    call self%line('')
    call self%item('deck', deck)
    call self%item('deck hash', deck_hash)
    call self%item('date', date_text())
    call self%item('host', host_name(), 'process '//str(process_id()))
    call self%item('ranks x threads', str(ranks)//' x '//str(threads))
    call self%item('compiler', compiler_text())
  end subroutine header

  !> The deck as understood, as talus_deck's echo gives it.
  subroutine deck_echo(self, lines)
    class(log_type), intent(inout) :: self
    type(string_type), intent(in) :: lines(:)
    integer :: k
    call self%section('Deck as understood')
    do k = 1, size(lines)
      call self%line('  '//lines(k)%s)
    end do
  end subroutine deck_echo

  !> Memory that the program holds and that is left.
  subroutine memory(self)
    class(log_type), intent(inout) :: self
    real(wp), parameter :: mebibyte = 1048576.0_wp
    call self%item('memory', short_number(real(memory_resident(), wp)/mebibyte)//' MiB in use', &
                   short_number(real(memory_free(), wp)/mebibyte)//' MiB free')
  end subroutine memory

  !> Titles of the columns of rows; they also fix the widths.
  subroutine row_titles(self, titles)
    class(log_type), intent(inout) :: self
    type(string_type), intent(in) :: titles(:)
    integer :: k
    if (allocated(self%width)) deallocate (self%width)
    allocate (self%width(size(titles)))
    do k = 1, size(titles)
      self%width(k) = max(narrowest, len(titles(k)%s))
    end do
    call self%line('')
    call self%row(titles)
  end subroutine row_titles

  !> Time for a row? First at once, then at wall intervals that double from 0.5 s to 30 s.
  logical function row_due(self)
    class(log_type), intent(inout) :: self
    real(wp) :: now
    now = wall_clock()
    row_due = now >= self%next_row
    if (.not. row_due) return
    self%next_row = now + self%spacing
    self%spacing = min(2.0_wp*self%spacing, last_spacing)
  end function row_due

  subroutine row_texts(self, cells)
    class(log_type), intent(inout) :: self
    type(string_type), intent(in) :: cells(:)
    character(len=:), allocatable :: text
    integer :: k
    if (.not. allocated(self%width)) error stop 'bug: a log row before its titles'
    if (size(cells) /= size(self%width)) error stop 'bug: log row of another width'
    text = ''
    do k = 1, size(cells)
      text = text//repeat(' ', 2 + max(0, self%width(k) - len(cells(k)%s)))//cells(k)%s
    end do
    call self%line(text)
  end subroutine row_texts

  subroutine row_reals(self, values)
    class(log_type), intent(inout) :: self
    real(wp), intent(in) :: values(:)
    type(string_type) :: cells(size(values))
    integer :: k
    do k = 1, size(values)
      cells(k)%s = short_number(values(k))
    end do
    call self%row(cells)
  end subroutine row_reals

  !> Bar with percentage and a note, on a terminal only; cheap enough for every step.
  subroutine progress(self, fraction, note)
    class(log_type), intent(inout) :: self
    real(wp), intent(in) :: fraction  !! 0 to 1
    character(len=*), intent(in) :: note
    integer(i4), parameter :: room = 40
    integer(i4) :: filled
    integer :: stat
    if (.not. self%terminal) return
    if (wall_clock() < self%next_bar) return
    self%next_bar = wall_clock() + bar_spacing
    filled = int(room*max(0.0_wp, min(1.0_wp, fraction)), i4)
    write (output_unit, '(a, i4, a)', advance='no', iostat=stat) achar(13)//'['// &
      repeat('=', filled)//repeat(' ', room - filled)//']', nint(100.0_wp*fraction), ' % '// &
      note(:min(len(note), 30))//'  '
    flush (output_unit, iostat=stat)
    self%bar_drawn = .true.
  end subroutine progress

  !> The line that shows whether to trust the run.
  subroutine health(self, text)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: text
    call self%line('')
    call self%line('health: '//text)
  end subroutine health

  subroutine timer_table(self, timers)
    class(log_type), intent(inout) :: self
    type(timers_type), intent(in) :: timers
    type(string_type), allocatable :: lines(:)
    integer :: k
    call timers%table(lines)
    call self%line('')
    do k = 1, size(lines)
      call self%line(lines(k)%s)
    end do
  end subroutine timer_table

  !> All faults, as the main program also shows them on standard error.
  subroutine faults(self, errors)
    class(log_type), intent(inout) :: self
    type(error_list_type), intent(in) :: errors
    integer(i4) :: k
    logical :: screen
    screen = self%screen
    self%screen = .false.
    do k = 1, errors%count
      call self%line(errors%text(k))
    end do
    self%screen = screen
  end subroutine faults

  !> Last line of every log: 'talus-dem: finished, exit 0, wall 12.3 s, detail'.
  subroutine finish(self, program, exit_code, detail, wall)
    class(log_type), intent(inout) :: self
    character(len=*), intent(in) :: program
    integer(i4), intent(in) :: exit_code
    character(len=*), intent(in) :: detail  !! may be empty
    real(wp), intent(in), optional :: wall  !! of the whole run [s]; else since the log was opened
    character(len=:), allocatable :: text
    real(wp) :: took

    took = wall_clock() - self%begun
    if (present(wall)) took = wall
    text = program//': '//outcome(exit_code)//', exit '//str(exit_code)//', wall '// &
           short_number(took)//' s'
    if (len(detail) > 0) text = text//', '//detail
    call self%line('')
    call self%line(text)
  end subroutine finish

  pure function outcome(exit_code) result(text)
    integer(i4), intent(in) :: exit_code
    character(len=:), allocatable :: text
    select case (exit_code)
    case (0)
      text = 'finished'
    case (1)
      text = 'input faults, nothing run'
    case (2)
      text = 'numerical failure'
    case (3)
      text = 'stopped early on request'
    case (4)
      text = 'system failure'
    case default
      text = 'bug'
    end select
  end function outcome

  subroutine close_log(self)
    class(log_type), intent(inout) :: self
    type(error_list_type) :: ignored
    call close_file(self%descriptor, self%path, .true., ignored)
  end subroutine close_log

  !> A number for people: five digits, whole numbers without a point.
  pure function short_number(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=32) :: buffer, form
    real(wp) :: magnitude
    if (.not. is_finite(value)) then
      write (buffer, *) value
      text = trim(adjustl(buffer))
      return
    end if
    magnitude = abs(value)
    if (magnitude < 1.0e7_wp .and. abs(value - anint(value)) <= 0.0_wp) then
      write (buffer, '(i0)') nint(value)
    else if (magnitude >= 1.0e-3_wp .and. magnitude < 1.0e6_wp) then
      write (form, '(a, i0, a)') '(f32.', max(0, 4 - floor(log10(magnitude))), ')'
      write (buffer, form) value
    else
      write (buffer, '(es12.4e2)') value
    end if
    text = trim(adjustl(buffer))
  end function short_number

  !> A span of wall time for people: '42 s', '3 min 20 s', '5 h 12 min'.
  pure function duration_text(seconds) result(text)
    real(wp), intent(in) :: seconds
    character(len=:), allocatable :: text
    integer(i4) :: whole
    whole = nint(max(0.0_wp, min(seconds, 1.0e9_wp)))
    if (whole < 60) then
      text = str(whole)//' s'
    else if (whole < 3600) then
      text = str(whole/60)//' min '//str(mod(whole, 60))//' s'
    else
      text = str(whole/3600)//' h '//str(mod(whole, 3600)/60)//' min'
    end if
  end function duration_text
end module talus_log
