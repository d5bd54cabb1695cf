!> Faults of a deck with their places, reported in the order of the text.
module talus_deck_faults
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_deck_source, only: deck_source_type
  implicit none
  private
  public :: deck_faults_type

  !> Faults found so far. Faults behind a missing quote are not reported (murky).
  type :: deck_faults_type
    type(error_list_type) :: list
    integer(i4), allocatable :: position(:)  !! first byte of each fault; huge: the deck as a whole
    integer(i4), allocatable :: murky(:)     !! per line: first byte after a missing quote
  contains
    procedure :: init
    procedure :: add
    procedure :: hand_over
  end type deck_faults_type

contains

  subroutine init(self, source)
    class(deck_faults_type), intent(inout) :: self
    type(deck_source_type), intent(in) :: source
    call self%list%clear()
    self%position = [integer(i4) ::]
    if (allocated(self%murky)) deallocate (self%murky)
    allocate (self%murky(source%line_count), source=huge(1_i4))
  end subroutine init

  !> Add a fault at bytes first..last of a line (line 0: the deck as a whole).
  subroutine add(self, source, code, message, line, first, last, hint)
    class(deck_faults_type), intent(inout) :: self
    type(deck_source_type), intent(in) :: source
    character(len=*), intent(in) :: code, message, hint
    integer(i4), intent(in) :: line, first, last

    if (line > 0) then
      if (first >= self%murky(line)) return
    end if
    call self%list%add(code, message, source%place(line, first, last), hint)
    self%position = [self%position, merge(first, huge(first), line > 0)]
  end subroutine add

  !> Append all faults to a list, in the order of their places.
  subroutine hand_over(self, errors)
    class(deck_faults_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: order(self%list%count), k, j, item

    order = [(k, k=1, self%list%count)]
    do k = 2, self%list%count
      item = order(k)
      j = k - 1
      do while (j >= 1)
        if (self%position(order(j)) <= self%position(item)) exit
        order(j + 1) = order(j)
        j = j - 1
      end do
      order(j + 1) = item
    end do
    do k = 1, self%list%count
      associate (fault => self%list%item(order(k)))
        call errors%add(fault%code, fault%message, fault%place, fault%hint)
      end associate
    end do
    call self%list%clear()
  end subroutine hand_over
end module talus_deck_faults
