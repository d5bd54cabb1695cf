!> Faults of a deck that concern the run as a whole: its files and its ranks.
module dem_setup_run
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_files, only: folder_of, name_of, same_file
  use talus_text, only: str
  implicit none
  private
  public :: spare_inputs, refuse_ranks

contains

  !> No result may take the place of the deck or the packing, or of another result (D249).
  subroutine spare_inputs(deck, stem, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: stem
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: hint = 'rename one of both; results are named as the deck'
    character(len=:), allocatable :: input, packing

    input = deck%path('particles', 1, 'file')
    if (deck%count('output') == 0) return
    if (same_file(input, stem//'.h5')) call deck%fault(errors, 'D249', &
      'the fields of this run would overwrite its packing', 'particles', 1, 'file', hint)
    call deck%get('output', 1, 'packing', packing)
    if (len(packing) == 0) return
    packing = folder_of(stem)//'/'//packing
    if (same_file(packing, input) .or. same_file(packing, deck%source%path)) then
      call deck%fault(errors, 'D249', 'the last state would overwrite an input of this run', &
                      'output', 1, 'packing', hint)
    else if (packing == folder_of(stem)//'/'//name_of(stem)//'.h5') then
      call deck%fault(errors, 'D249', 'the last state would overwrite the fields of this run', &
                      'output', 1, 'packing', hint)
    end if
  end subroutine spare_inputs

  !> What runs on one rank alone (D290): bodies that all forces of all grains move in every step.
  subroutine refuse_ranks(deck, ranks, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: ranks
    type(error_list_type), intent(inout) :: errors
    if (ranks == 1 .or. deck%count('body') == 0) return
    call deck%fault(errors, 'D290', 'a body that moves freely needs one rank, this run has '// &
                    str(ranks), 'body', 1, '', 'start it without mpirun, with as many threads '// &
                    'as there are cores')
  end subroutine refuse_ranks
end module dem_setup_run
