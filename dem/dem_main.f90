!> talus-dem: grains. `talus-dem deck.nml` runs a deck, `mpirun -n 4 talus-dem deck.nml` with ranks;
!! see `talus-dem --help`. The first rank executes this program, the others execute its commands.
program talus_dem
  use, intrinsic :: iso_fortran_env, only: error_unit
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_answers, only: asks_a_question, answer_question
  use talus_memory_text, only: foretold_type
  use talus_options, only: options_type, parse_options
  use talus_ranks, only: ranks_type, join_ranks, leave_ranks
  use talus_report, only: report_check
  use talus_deck_table, only: key_table_type
  use talus_text, only: str
  use talus_system, only: begin_signals, keep_memory, talus_exit, talus_short_spins
  use dem_rank_team, only: dem_rank_team_type
  use dem_rank_worker, only: serve_leader
  use dem_swap, only: prefer_copies
  use dem_memory, only: foretell_memory, check_ranks
  use dem_model, only: dem_model_type, program_name
  use dem_measure_file, only: measure_file
  use dem_deck_keys, only: dem_deck_table
  use dem_port, only: serve
  implicit none

  type(options_type) :: options
  class(dem_model_type), allocatable :: model
  type(error_list_type) :: errors
  type(ranks_type) :: ranks
  integer(i4) :: exit_code

  call begin_signals()
  call talus_short_spins()
  call keep_memory()
  call prefer_copies()
  call join_ranks(ranks)
  if (.not. ranks%leads()) call follow()
  call parse_options(options, program_name, errors)
  if (errors%any()) call leave_with_faults()
  if (asks_a_question(options)) call answer()
  if (len(options%point) > 0 .and. len(options%port) == 0) options%port = 'attach:'//options%point
  allocate (model)
  model%ranks = ranks
  if (options%check) call check()
  if (len(options%measure) > 0) call measure()
  if (len(options%port) > 0) then
    call serve(model, options, exit_code, errors)
  else
    call model%read(options, errors)
    if (.not. errors%any()) call model%prepare(errors)
    if (errors%any()) call leave_with_faults()
    call model%open(errors)
    if (.not. errors%any()) call model%run(errors)
    call model%finish(exit_code, errors)
  end if
  call errors%locate(options%deck)
  if (errors%any()) call errors%print(error_unit)
  call go(exit_code)

contains

  !> All ranks leave.
  subroutine go(code)
    integer(i4), intent(in) :: code
    type(dem_rank_team_type) :: rank_team
    rank_team%team = ranks
    call rank_team%leave(code)
    call leave_ranks()
    call talus_exit(code)
  end subroutine go

  !> A rank that does not lead.
  subroutine follow()
    integer(i4) :: code
    call serve_leader(ranks, code)
    call leave_ranks()
    call talus_exit(code)
  end subroutine follow

  subroutine leave_with_faults()
    call errors%locate(options%deck)
    call errors%print(error_unit)
    call go(errors%exit_code())
  end subroutine leave_with_faults

  !> --help, --version, --keys.
  subroutine answer()
    type(key_table_type) :: table
    call dem_deck_table(table)
    call answer_question(program_name, options, table)
    call go(0_i4)
  end subroutine answer

  !> --check: read everything, evaluate the first forces, report with the required memory, exit.
  subroutine check()
    type(foretold_type) :: foretold
    if (options%ranks > 0 .and. ranks%several()) &
      call errors%add('D022', 'option --ranks is for one process, there are '// &
                      str(ranks%ranks), 'command line', 'leave out --ranks, or mpirun')
    if (.not. errors%any()) call model%read(options, errors)
    if (.not. errors%any()) call check_ranks(model, errors)
    if (.not. errors%any()) call model%prepare(errors)
    if (.not. errors%any() .and. (options%memory .or. .not. options%json)) &
      call foretell_memory(model, foretold)
    call errors%locate(options%deck)
    call report_check(program_name, model%deck, errors, options%json, foretold=foretold)
    call go(errors%exit_code())
  end subroutine check

  !> --measure=FILE: the measures of the deck on a field file.
  subroutine measure()
    call model%read(options, errors)
    if (.not. errors%any()) call measure_file(model, options%measure, errors)
    if (errors%any()) call leave_with_faults()
    call go(0_i4)
  end subroutine measure
end program talus_dem
