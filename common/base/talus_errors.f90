!> Faults of users and machines: collected in a list, returned, printed by the main program.
!!
!! A code is a letter and three digits. The letter gives the exit code: D deck and I input data 1,
!! N numerical 2, S system and P partner 4 (but 1 where a file that was given is at fault), B bug 5.
!! Meaning of each code: */errors.toml.
module talus_errors
  use talus_kinds, only: i4
  use talus_text, only: str
  implicit none
  private
  public :: error_type, error_list_type
  public :: exit_ok, exit_input, exit_numerical, exit_stopped, exit_system, exit_bug

  integer(i4), parameter :: exit_ok = 0         !! finished
  integer(i4), parameter :: exit_input = 1      !! input faults, nothing run
  integer(i4), parameter :: exit_numerical = 2  !! numerical failure
  integer(i4), parameter :: exit_stopped = 3    !! stopped early on request, checkpoint written
  integer(i4), parameter :: exit_system = 4     !! file, memory, disk or partner
  integer(i4), parameter :: exit_bug = 5        !! a fault of the program itself

  character(len=*), parameter :: no_room = 'S002'
  !> Files that were given: no HDF5, damaged, of another format or program, in the way.
  character(len=4), parameter :: given(9) = ['S004', 'S005', 'S006', 'S010', 'S011', 'S012', &
                                             'S013', 'S015', 'S016']

  !> One fault.
  type :: error_type
    character(len=:), allocatable :: code     !! letter and three digits
    character(len=:), allocatable :: message  !! what is wrong, with the value seen
    character(len=:), allocatable :: place    !! file:line:column, grain, element; may be empty
    character(len=:), allocatable :: hint     !! what to do; may be empty
  end type error_type

  !> All faults met so far, in the order in which they were found.
  type :: error_list_type
    integer(i4) :: count = 0
    type(error_type), allocatable :: item(:)
  contains
    procedure :: add => error_list_add
    procedure :: any => error_list_any
    procedure :: exit_code => error_list_exit_code
    procedure :: text => error_list_text
    procedure :: print => error_list_print
    procedure :: clear => error_list_clear
    procedure :: take => error_list_take
    procedure :: locate => error_list_locate
  end type error_list_type

contains

  !> Add a fault; place and hint may be empty. A full disk fails each file: the first is reported.
  subroutine error_list_add(self, code, message, place, hint)
    class(error_list_type), intent(inout) :: self
    character(len=*), intent(in) :: code, message
    character(len=*), intent(in), optional :: place, hint
    type(error_type), allocatable :: longer(:)
    integer(i4) :: k

    do k = 1, merge(self%count, 0_i4, code == no_room)
      if (self%item(k)%code == no_room) return
    end do
    if (.not. allocated(self%item)) allocate (self%item(8))
    if (self%count == size(self%item)) then
      allocate (longer(2*self%count))
      do k = 1, self%count
        call move_fault(self%item(k), longer(k))
      end do
      call move_alloc(longer, self%item)
    end if
    self%count = self%count + 1
    self%item(self%count)%code = code
    self%item(self%count)%message = message
    self%item(self%count)%place = ''
    self%item(self%count)%hint = ''
    if (present(place)) self%item(self%count)%place = place
    if (present(hint)) self%item(self%count)%hint = hint
  end subroutine error_list_add

  subroutine move_fault(from, to)
    type(error_type), intent(inout) :: from
    type(error_type), intent(inout) :: to
    call move_alloc(from%code, to%code)
    call move_alloc(from%message, to%message)
    call move_alloc(from%place, to%place)
    call move_alloc(from%hint, to%hint)
  end subroutine move_fault

  pure logical function error_list_any(self)
    class(error_list_type), intent(in) :: self
    error_list_any = self%count > 0
  end function error_list_any

  !> Exit code of the run: that of the first fault, 0 without faults.
  pure integer(i4) function error_list_exit_code(self)
    class(error_list_type), intent(in) :: self
    if (self%count == 0) then
      error_list_exit_code = exit_ok
      return
    end if
    select case (self%item(1)%code(1:1))
    case ('D', 'I')
      error_list_exit_code = exit_input
    case ('N')
      error_list_exit_code = exit_numerical
    case ('S', 'P')
      error_list_exit_code = merge(exit_input, exit_system, any(given == self%item(1)%code))
    case default
      error_list_exit_code = exit_bug
    end select
  end function error_list_exit_code

  !> Text of fault k: 'error D012: message', then indented lines for place and hint.
  pure function error_list_text(self, k) result(text)
    class(error_list_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: text
    text = 'error '//self%item(k)%code//': '//self%item(k)%message
    if (len(self%item(k)%place) > 0) text = text//new_line('a')//'  at '//self%item(k)%place
    if (len(self%item(k)%hint) > 0) text = text//new_line('a')//'  hint: '//self%item(k)%hint
  end function error_list_text

  !> Write all faults to a unit, with a closing count when there are several.
  subroutine error_list_print(self, unit)
    class(error_list_type), intent(in) :: self
    integer, intent(in) :: unit
    integer(i4) :: k
    do k = 1, self%count
      write (unit, '(a)') self%text(k)
    end do
    if (self%count > 1) write (unit, '(a)') str(self%count)//' errors'
    flush (unit)
  end subroutine error_list_print

  subroutine error_list_clear(self)
    class(error_list_type), intent(inout) :: self
    self%count = 0
  end subroutine error_list_clear

  !> A place, the deck, for the faults that name none.
  subroutine error_list_locate(self, place)
    class(error_list_type), intent(inout) :: self
    character(len=*), intent(in) :: place
    integer(i4) :: k
    do k = 1, self%count
      if (len(self%item(k)%place) == 0) self%item(k)%place = place
    end do
  end subroutine error_list_locate

  !> Append all faults of another list.
  subroutine error_list_take(self, other)
    class(error_list_type), intent(inout) :: self
    type(error_list_type), intent(in) :: other
    integer(i4) :: k
    do k = 1, other%count
      call self%add(other%item(k)%code, other%item(k)%message, other%item(k)%place, &
        other%item(k)%hint)
    end do
  end subroutine error_list_take
end module talus_errors
