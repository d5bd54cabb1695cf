!> `--check` of a coupled deck: run both solvers' own `--check --json` and gather their faults.
module cpl_check
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_files, only: read_file, remove_file
  use talus_process, only: process_type, sibling_program
  use cpl_analysis, only: check_analysis
  use cpl_choices, only: cpl_choices_type
  use cpl_solver, only: cpl_solver_type, sides, side_grains, side_solid
  implicit none
  private
  public :: check_solvers, take_faults, take_analysis, take_memory

  real(wp), parameter :: patience = 600.0_wp  !! s

contains

  !> Check the decks of both solvers as decks of a coupled run, and whether the solid's analysis
  !! fits it; if asked, let them tell their memory. Those launched by mpirun are checked with its
  !! ranks, others by the program next to this one; the input of a solver of another make is left
  !! alone.
  subroutine check_solvers(solvers, choices, memory, errors)
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: memory
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, 2
      if (.not. allocated(solvers(k)%deck)) cycle
      if (len(solvers(k)%deck) > 0 .and. .not. is_foreign(solvers(k))) &
        call check_one(solvers(k), on_ranks(solvers(k), choices), memory, errors)
    end do
    if (.not. allocated(solvers(side_solid)%analysis)) return
    call check_analysis(solvers(side_solid), choices, errors)
  end subroutine check_solvers

  !> Is its command not one of ours, and its input no deck?
  pure function is_foreign(solver)
    type(cpl_solver_type), intent(in) :: solver
    logical :: is_foreign
    integer :: last
    is_foreign = .false.
    if (solver%launch /= 'command') return
    last = len_trim(solver%deck)
    is_foreign = index(solver%command, solver%program) == 0 .and. &
                 solver%deck(max(last - 3, 1):last) /= '.nml'
  end function is_foreign

  !> Is its command mpirun, or mpiexec, with our program? In an overlap the first rank has all
  !! grains and moves them alone: one process tells its memory.
  pure logical function on_ranks(solver, choices)
    type(cpl_solver_type), intent(in) :: solver
    type(cpl_choices_type), intent(in) :: choices
    on_ranks = solver%launch == 'command' .and. index(solver%command, solver%program) > 0
    if (on_ranks) on_ranks = index(' '//solver%command, 'mpirun ') > 0 .or. &
      index(' '//solver%command, 'mpiexec ') > 0
    if (choices%overlap%given .and. solver%side == sides(side_grains)) on_ranks = .false.
  end function on_ranks

  subroutine check_one(solver, launched, memory, errors)
    type(cpl_solver_type), intent(inout) :: solver
    logical, intent(in) :: launched  !! by its command
    logical, intent(in) :: memory
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i4) :: before

    before = errors%count
    call answer_of(solver, launched, memory, text, errors)
    if (launched .and. index(text, '"errors"') == 0) &  ! the launcher works elsewhere
      call answer_of(solver, .false., memory, text, errors)
    if (errors%count > before) return
    call take_faults(solver%program, text, errors)
    call take_analysis(text, solver%analysis)
    if (memory) call take_memory(text, solver%memory, solver%entities)
    if (errors%count == before .and. solver%process%exit_code /= 0) &
      call errors%add('P424', solver%program//' --check gave no answer: '// &
        solver%process%epitaph(), solver%deck, 'start it by hand to see why')
  end subroutine check_one

  !> What a solver's --check --json says, by its launcher or by the program next to this one.
  subroutine answer_of(solver, launched, memory, text, errors)
    type(cpl_solver_type), intent(inout) :: solver
    logical, intent(in) :: launched, memory
    character(len=:), allocatable, intent(out) :: text
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: faults
    type(string_type), allocatable :: argv(:)

    text = ''
    if (.not. launched) call append_string(argv, sibling_program(solver%program))
    call append_string(argv, solver%deck)
    call append_string(argv, '--check')
    call append_string(argv, '--json')
    if (memory) call append_string(argv, '--memory')
    call append_string(argv, '--port=check')
    associate (process => solver%process)
      if (launched) then
        call process%spawn_command(solver%command, '', solver%output, solver%threads, faults, argv)
        if (faults%any()) return
      else
        call process%spawn(argv, '', solver%output, solver%threads, errors)
        if (process%pid == 0) return
      end if
      if (.not. process%wait(patience)) call process%stop(0.0_wp)
    end associate
    call read_file(solver%output, text, errors)
    call remove_file(solver%output)
  end subroutine answer_of

  !> Faults in the answer of a program's --check --json (talus_report writes them).
  subroutine take_faults(program, json, errors)
    character(len=*), intent(in) :: program
    character(len=*), intent(in) :: json
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: code, message, place, source, hint
    integer :: at

    at = index(json, '"errors"')
    if (at == 0) return
    do
      call next_value(json, 'code', at, code)
      if (at == 0) return
      call next_value(json, 'message', at, message)
      if (at > 0) call next_value(json, 'place', at, place)
      if (at > 0) call next_value(json, 'source', at, source)
      if (at > 0) call next_value(json, 'hint', at, hint)
      if (at == 0) return
      if (len(source) > 0) place = place//new_line('a')//source
      call errors%add(code, program//': '//message, place, hint)
    end do
  end subroutine take_faults

  !> Kind of a solid's analysis in such an answer; not allocated where it names none.
  subroutine take_analysis(json, analysis)
    character(len=*), intent(in) :: json
    character(len=:), allocatable, intent(out) :: analysis
    character(len=:), allocatable :: value
    integer :: at
    at = 1
    call next_value(json, 'analysis', at, value)
    if (at > 0) analysis = value
  end subroutine take_analysis

  !> Memory of each rank [MiB], and grains or nodes, in such an answer; not allocated where it has
  !! none.
  subroutine take_memory(json, memory, entities)
    character(len=*), intent(in) :: json
    real(wp), allocatable, intent(out) :: memory(:)
    integer(i4), intent(out) :: entities
    character(len=:), allocatable :: value
    integer :: at, behind, k, status
    entities = 0
    at = index(json, '"memory":')
    if (at == 0) return
    behind = at + scan(json(at:)//']', ']') - 1
    at = at + scan(json(at:)//'[', '[')
    if (at > behind) return
    allocate (memory(count([(json(k:k) == ',', k=at, behind - 1)]) + 1), source=0.0_wp)
    read (json(at:behind - 1), *, iostat=status) memory
    if (status /= 0) deallocate (memory)
    if (status /= 0) return
    at = behind
    call next_value(json, 'entities', at, value)
    if (at > 0) read (value, *, iostat=status) entities
  end subroutine take_memory

  !> Value of the next "key": after position at, which moves behind it; 0 when there is none.
  subroutine next_value(json, key, at, value)
    character(len=*), intent(in) :: json, key
    integer, intent(inout) :: at
    character(len=:), allocatable, intent(out) :: value
    integer :: found

    value = ''
    found = index(json(at:), '"'//key//'":')
    if (found == 0) then
      at = 0
      return
    end if
    at = at + found - 1 + len(key) + 3
    do while (at < len(json) .and. json(at:at) == ' ')
      at = at + 1
    end do
    if (json(at:at) == '"') then
      call take_string(json, at, value)
    else
      found = scan(json(at:)//',', ',}'//new_line('a'))
      value = trim(json(at:at + found - 2))
      at = at + found - 1
    end if
    if (at > len(json)) at = 0
  end subroutine next_value

  !> A quoted text with its escapes; at moves from its first quote to behind its last.
  subroutine take_string(json, at, value)
    character(len=*), intent(in) :: json
    integer, intent(inout) :: at
    character(len=:), allocatable, intent(inout) :: value
    integer :: code, stat

    at = at + 1
    do while (at <= len(json))
      select case (json(at:at))
      case ('"')
        at = at + 1
        return
      case ('\')
        at = at + 1
        if (at > len(json)) return
        select case (json(at:at))
        case ('n')
          value = value//new_line('a')
        case ('t')
          value = value//achar(9)
        case ('u')
          code = iachar('?')
          if (at + 4 <= len(json)) read (json(at + 1:at + 4), '(z4)', iostat=stat) code
          value = value//achar(min(code, 127))
          at = at + 4
        case default
          value = value//json(at:at)
        end select
      case default
        value = value//json(at:at)
      end select
      at = at + 1
    end do
  end subroutine take_string
end module cpl_check
