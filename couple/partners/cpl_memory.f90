!> Memory of a coupled run, for --check: what both solvers tell of themselves, and what the coupling
!! adds on all three sides by measured rules (manual, Ranks), since what is exchanged is known from
!! the running solvers alone.
module cpl_memory
  use talus_kinds, only: wp, i4
  use talus_log, only: short_number
  use talus_memory_text, only: foretold_type
  use cpl_choices, only: cpl_choices_type, scheme_iterated
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: foretell_memory, coupling_memory

  real(wp), parameter :: mebibyte = 1048576.0_wp
  real(wp), parameter :: program = 13.0_wp  !! talus-couple without anything [MiB]
  !> What all three sides have together of each grain and of each node [byte]: messages, sets and
  !! maps.
  real(wp), parameter :: facets(2) = [1250.0_wp, 350.0_wp]
  real(wp), parameter :: kept = 1470.0_wp  !! of a grain, where intervals may be repeated
  real(wp), parameter :: overlap(2) = [4600.0_wp, 26000.0_wp]

contains

  !> Of both solvers with all their ranks, of the coupling, and of all; nothing where one of the
  !! solvers is of another make.
  subroutine foretell_memory(solvers, choices, foretold)
    type(cpl_solver_type), intent(in) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    type(foretold_type), intent(out) :: foretold
    real(wp) :: part(3)
    if (.not. (allocated(solvers(1)%memory) .and. allocated(solvers(2)%memory))) return
    part(1) = sum(solvers(side_grains)%memory)
    part(2) = sum(solvers(side_solid)%memory)
    part(3) = coupling_memory(choices%overlap%given, choices%scheme == scheme_iterated, &
                              solvers(side_grains)%entities, solvers(side_solid)%entities)
    foretold%most = [sum(part)]
    foretold%text = 'memory: grains '//short_number(part(1))//' MiB, solid '// &
      short_number(part(2))//' MiB, coupling '//short_number(part(3))//' MiB: '// &
      short_number(sum(part))//' MiB at most'
  end subroutine foretell_memory

  !> What the coupling takes on all sides [MiB]. Facets: the accepted state of grains is kept
  !! while they step only where they may have to go back to it.
  pure real(wp) function coupling_memory(in_overlap, repeats, grains, nodes)
    logical, intent(in) :: in_overlap, repeats
    integer(i4), intent(in) :: grains, nodes
    real(wp) :: each(2)
    each = merge(overlap, facets, in_overlap)
    if (repeats .and. .not. in_overlap) each(1) = each(1) + kept
    coupling_memory = program + (each(1)*grains + each(2)*nodes)/mebibyte
  end function coupling_memory
end module cpl_memory
