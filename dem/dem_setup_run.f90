!> Faults of a deck that concern the run as a whole: its files and its ranks.
module dem_setup_run
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_files, only: folder_of, name_of, same_file
  use talus_text, only: str
  use dem_state, only: dem_data_type
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

  !> What runs on one rank alone (D290): whatever changes grains between steps, bodies other than
  !! grains and planes, and a partner.
  subroutine refuse_ranks(deck, d, ranks, adaptive, served, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: ranks
    logical, intent(in) :: adaptive  !! damping that stops grains
    logical, intent(in) :: served    !! by a partner
    type(error_list_type), intent(inout) :: errors

    if (served) call errors%add('D290', 'a run that a partner drives has one rank, not '// &
                                str(ranks), deck%source%path, &
                                'ranks = 1 in &program; threads may be more')
    if (d%cell%active) call refuse('cell', '', 'a cell')
    if (d%surfaces%n > 0) call refuse('surface', '', 'a surface')
    if (d%grains%forms%n > 0) call refuse('particles', 'file', 'a grain that is no ellipsoid')
    if (deck%count('bond') > 0) call refuse('bond', '', 'a bond')
    if (any(d%laws%extra%used)) call refuse('contact', '', 'a law on top of the base law')
    if (deck%count('surcharge') > 0) call refuse('surcharge', '', 'a surcharge')
    if (deck%count('probe') > 0) call refuse('probe', '', 'a probe')
    if (adaptive) call refuse('relaxation', 'damping', 'adaptive damping')

  contains

    subroutine refuse(group, key, what)
      character(len=*), intent(in) :: group, key, what
      call deck%fault(errors, 'D290', what//' needs one rank, this run has '//str(ranks), group, &
                      1, key, 'start it without mpirun, with as many threads as there are cores')
    end subroutine refuse
  end subroutine refuse_ranks
end module dem_setup_run
