!> talus-fem: solids. `talus-fem deck.nml` runs a deck, `mpirun -n 4 talus-fem deck.nml` with ranks;
!! See `talus-fem --help`.
program talus_fem
  use, intrinsic :: iso_fortran_env, only: error_unit
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_answers, only: asks_a_question, answer_question
  use talus_memory_text, only: foretold_type
  use talus_options, only: options_type, parse_options
  use talus_report, only: report_check
  use talus_deck_table, only: key_table_type
  use talus_system, only: begin_signals, talus_blas_kernels, talus_exit, &
    talus_short_spins
  use fem_model, only: fem_model_type, program_name
  use fem_memory, only: foretell_memory
  use fem_deck_keys, only: fem_deck_table
  use talus_ranks, only: ranks_type, join_ranks, leave_ranks
  use fem_point, only: run_point
  use fem_port, only: serve
  use fem_run, only: run_model
  use fem_run_files, only: open_run, finish_run
  implicit none

  type(options_type) :: options
  class(fem_model_type), allocatable :: model
  type(ranks_type) :: ranks
  type(error_list_type) :: errors
  integer(i4) :: exit_code

  call begin_signals()
  call talus_short_spins()
  call talus_blas_kernels()
  call join_ranks(ranks)
  call parse_options(options, program_name, errors)
  if (errors%any()) call leave_with_faults()
  if (asks_a_question(options)) call answer()
  if (options%one_point) then
    if (ranks%leads()) call run_point(options, errors)
    call ranks%agree(errors)
    call leave_with_faults()
  end if
  allocate (model)
  model%ranks = ranks
  if (options%check) call check()
  if (len(options%port) > 0) then
    call serve(model, options, exit_code, errors)
  else
    call read_and_prepare()
    if (errors%any()) call leave_with_faults()
    call open_run(model, errors)
    if (.not. errors%any()) call run_model(model, errors)
    call finish_run(model, exit_code, errors)
  end if
  call errors%locate(options%deck)
  if (errors%any() .and. ranks%leads()) call errors%print(error_unit)
  call model%body%system%solver%drop()
  call leave_ranks()
  call talus_exit(exit_code)

contains

  !> Faults of one rank are those of all.
  subroutine read_and_prepare()
    call model%read(options, errors)
    call ranks%agree(errors)
    if (errors%any()) return
    call model%prepare(errors)
    call ranks%agree(errors)
  end subroutine read_and_prepare

  subroutine leave_with_faults()
    call errors%locate(options%deck)
    if (ranks%leads()) call errors%print(error_unit)
    call leave_ranks()
    call talus_exit(errors%exit_code())
  end subroutine leave_with_faults

  !> --help, --version, --keys.
  subroutine answer()
    type(key_table_type) :: table
    call fem_deck_table(table)
    if (ranks%leads()) call answer_question(program_name, options, table)
    call leave_ranks()
    call talus_exit(0_i4)
  end subroutine answer

  !> --check: read everything, assemble and factor, report with the memory of a run, leave.
  subroutine check()
    character(len=:), allocatable :: analysis
    type(foretold_type) :: foretold
    call read_and_prepare()
    if (.not. errors%any() .and. (options%memory .or. .not. options%json)) &
      call foretell_memory(model, foretold)
    call errors%locate(options%deck)
    if (allocated(model%analysis)) analysis = model%analysis%kind
    if (ranks%leads()) call report_check(program_name, model%deck, errors, options%json, &
                                         analysis, foretold)
    call leave_ranks()
    call talus_exit(errors%exit_code())
  end subroutine check
end program talus_fem
