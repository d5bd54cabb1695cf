!> talus-couple: grains and solid together. `talus-couple deck.nml` runs a coupled deck.
program talus_couple
  use, intrinsic :: iso_fortran_env, only: error_unit
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_answers, only: asks_a_question, answer_question
  use talus_memory_text, only: foretold_type
  use talus_options, only: options_type, parse_options
  use talus_report, only: report_check
  use talus_deck_table, only: key_table_type
  use talus_system, only: begin_signals, talus_exit
  use cpl_check, only: check_solvers
  use cpl_memory, only: foretell_memory
  use cpl_deck_keys, only: cpl_deck_table
  use cpl_model, only: cpl_model_type, program_name
  use cpl_partition_file, only: weigh_file
  implicit none

  type(options_type) :: options
  type(cpl_model_type), allocatable :: model
  type(error_list_type) :: errors
  integer(i4) :: exit_code

  call begin_signals()
  call parse_options(options, program_name, errors)
  if (errors%any()) call leave_with_faults()
  if (asks_a_question(options)) call answer()
  if (options%weights) call weigh()
  allocate (model)
  call model%read(options, errors)
  if (options%check) call check()
  if (errors%any()) call leave_with_faults()
  call model%open(errors)
  if (.not. errors%any()) call model%prepare(errors)
  if (.not. errors%any()) call model%execute(errors)
  call model%finish(exit_code, errors)
  call errors%locate(options%deck)
  if (errors%any()) call errors%print(error_unit)
  call talus_exit(exit_code)

contains

  subroutine leave_with_faults()
    call errors%locate(options%deck)
    call errors%print(error_unit)
    call talus_exit(errors%exit_code())
  end subroutine leave_with_faults

  !> --help, --version, --keys.
  subroutine answer()
    type(key_table_type) :: table
    call cpl_deck_table(table)
    call answer_question(program_name, options, table)
    call talus_exit(0_i4)
  end subroutine answer

  !> --weights: the energy partition of an overlap in a file.
  subroutine weigh()
    call weigh_file(options%deck, options%output_dir, errors)
    if (errors%any()) call leave_with_faults()
    call talus_exit(0_i4)
  end subroutine weigh

  !> --check: the coupled deck, then both solvers' own checks, all faults together; the memory.
  subroutine check()
    type(foretold_type) :: foretold
    logical :: memory
    memory = options%memory .or. .not. options%json
    call check_solvers(model%run%solvers, model%run%choices, memory, errors)
    if (memory .and. .not. errors%any()) &
      call foretell_memory(model%run%solvers, model%run%choices, foretold)
    call errors%locate(options%deck)
    call report_check(program_name, model%run%deck, errors, options%json, foretold=foretold)
    call talus_exit(errors%exit_code())
  end subroutine check
end program talus_couple
