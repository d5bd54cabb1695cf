!> Memory that a run takes, foretold by --check: figures and words.
module talus_memory_text
  use talus_kinds, only: wp, i4
  use talus_log, only: short_number
  use talus_text, only: str
  implicit none
  private
  public :: foretold_type, text_of_ranks, span

  !> Nothing is told where `most` is not allocated.
  type :: foretold_type
    real(wp), allocatable :: most(:)       !! memory of each rank [MiB]
    integer(i4) :: entities = 0            !! grains, or nodes of the mesh
    character(len=:), allocatable :: text  !! the same in words
  end type foretold_type

contains

  !> Most of the first rank and of the others: `memory of 3 ranks at most: the first 60 MiB, the
  !! others 40 to 45 MiB`.
  pure function text_of_ranks(most) result(text)
    real(wp), intent(in) :: most(:)  !! (ranks) [MiB]
    character(len=:), allocatable :: text
    text = 'memory of '//str(size(most))//' ranks at most: the first '//short_number(most(1))// &
           ' MiB'
    if (size(most) > 1) text = text//', the others '//span(most(2:))//' MiB'
  end function text_of_ranks

  !> Least and most.
  pure function span(values) result(text)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    text = short_number(minval(values))
    if (maxval(values) > minval(values)) text = text//' to '//short_number(maxval(values))
  end function span
end module talus_memory_text
