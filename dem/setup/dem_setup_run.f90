!> Faults of a deck that concern the run as a whole: its files.
module dem_setup_run
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_files, only: folder_of, name_of, same_file
  use talus_h5_file, only: free_place
  implicit none
  private
  public :: spare_inputs

contains

  !> No result may take the place of the deck or the packing, or of another result (D249).
  subroutine spare_inputs(deck, stem, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: stem
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: hint = 'rename one of both; results are named as the deck'
    character(len=:), allocatable :: input, packing
    logical :: free

    input = deck%source%path
    if (deck%given('particles', 1, 'file')) input = deck%path('particles', 1, 'file')
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
    else if (index(name_of(packing), name_of(stem)//'.chk') == 1) then
      call deck%fault(errors, 'D249', 'the last state would overwrite checkpoints of this run', &
                      'output', 1, 'packing', hint)
    else
      free = free_place(packing, 'talus-packing', errors)
    end if
  end subroutine spare_inputs
end module dem_setup_run
