!> Faults that all ranks share: what one of them met ends the run on all, with one message and one
!! exit code.
module fem_agree
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use fem_ranks, only: fem_ranks_type
  implicit none
  private
  public :: agree

  character(len=1), parameter :: mark = achar(0)  !! ends each text

contains

  !> Every rank has the faults of the first rank that has some. All ranks call it together.
  subroutine agree(ranks, errors)
    type(fem_ranks_type), intent(in) :: ranks
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i4) :: first, k
    if (.not. ranks%several()) return
    first = merge(ranks%rank, huge(first), errors%any())
    call ranks%least(first)
    if (first == huge(first)) return
    text = ''
    if (first == ranks%rank) then
      do k = 1, errors%count
        associate (e => errors%item(k))
          text = text//e%code//mark//e%message//mark//e%place//mark//e%hint//mark
        end associate
      end do
    end if
    call ranks%tell(first, text)
    if (first == ranks%rank) return
    call errors%clear()
    do while (len(text) > 0)
      call take_fault(text, errors)
    end do
  end subroutine agree

  !> The first fault of a text.
  subroutine take_fault(text, errors)
    character(len=:), allocatable, intent(inout) :: text
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: ends(0:4), k
    ends(0) = 0
    do k = 1, 4
      ends(k) = ends(k - 1) + index(text(ends(k - 1) + 1:), mark)
    end do
    call errors%add(text(:ends(1) - 1), text(ends(1) + 1:ends(2) - 1), &
                    text(ends(2) + 1:ends(3) - 1), text(ends(3) + 1:ends(4) - 1))
    text = text(ends(4) + 1:)
  end subroutine take_fault
end module fem_agree
