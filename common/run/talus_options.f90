!> The command line that all three programs share.
module talus_options
  use talus_kinds, only: i4
  use talus_text, only: string_type, append_string, starts_with, str
  use talus_errors, only: error_list_type
  use talus_suggest, only: did_you_mean
  use talus_deck_value, only: parse_integer, value_good
  implicit none
  private
  public :: options_type, parse_options, parse_arguments, usage_text

  integer(i4), parameter :: most_threads = 1024
  integer(i4), parameter :: most_ranks = 100000

  !> Options of the user.
  type :: options_type
    character(len=:), allocatable :: deck        !! path of the deck, '' if none was given
    logical :: check = .false.                   !! read, check, echo, leave
    logical :: json = .false.                    !! answers of --check and --keys as JSON
    logical :: memory = .false.                  !! with check and json: the memory too
    logical :: keys = .false.                    !! print the key table
    logical :: version = .false., help = .false.
    character(len=:), allocatable :: restart     !! '', 'auto' or a checkpoint
    character(len=:), allocatable :: port        !! '' or where talus-couple listens
    character(len=:), allocatable :: measure     !! '' or a field file for talus-dem to measure
    character(len=:), allocatable :: output_dir  !! '' or the folder of the results
    logical :: one_point = .false.               !! talus-fem --point: a material, without mesh
    logical :: weights = .false.                 !! talus-couple --weights: of an overlap in a file
    character(len=:), allocatable :: point       !! '' or the rendezvous file of launch = 'attach'
    integer(i4) :: threads = 0                   !! 0: not said
    integer(i4) :: ranks = 0                     !! talus-dem --check: foretell memory; 0: not said
  end type options_type

contains

  !> Read the command line. Faults: D020 unknown option, D021 deck, D022 value of an option.
  subroutine parse_options(options, program, errors)
    type(options_type), intent(out) :: options
    character(len=*), intent(in) :: program
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: arguments(:)
    character(len=:), allocatable :: text
    integer :: k, length

    allocate (arguments(0))
    do k = 1, command_argument_count()
      call get_command_argument(k, length=length)
      text = repeat(' ', length)
      if (length > 0) call get_command_argument(k, value=text)
      call append_string(arguments, text)
    end do
    call parse_arguments(options, program, arguments, errors)
  end subroutine parse_options

  !> Read a list of arguments.
  subroutine parse_arguments(options, program, arguments, errors)
    type(options_type), intent(out) :: options
    character(len=*), intent(in) :: program
    type(string_type), intent(in) :: arguments(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    options%deck = ''
    options%restart = ''
    options%port = ''
    options%output_dir = ''
    options%point = ''
    options%measure = ''
    do k = 1, size(arguments)
      associate (text => arguments(k)%s)
        if (starts_with(text, '-')) then
          call take_option(options, program, text, errors)
        else if (len(text) == 0) then
          call errors%add('D021', 'an argument is empty', 'command line', usage_line(program))
        else if (len(options%deck) > 0) then
          call errors%add('D021', 'one deck at a time, but there are '''//options%deck &
                          //''' and '''//text//'''', 'command line', usage_line(program))
        else
          options%deck = text
        end if
      end associate
    end do
    if (errors%any()) return
    if (options%help .or. options%version .or. options%keys) return
    if (options%ranks > 0 .and. .not. options%check) &
      call errors%add('D022', 'option --ranks goes with --check alone', 'command line', &
                      'a run gets its ranks from its launcher: mpirun -n '//str(options%ranks)// &
                      ' '//program//' deck.nml')
    if (len(options%deck) == 0) call errors%add('D021', 'no deck was given', 'command line', &
                                                usage_line(program)//'; see --help')
  end subroutine parse_arguments

  !> One option: a flag, or name=value.
  subroutine take_option(options, program, text, errors)
    type(options_type), intent(inout) :: options
    character(len=*), intent(in) :: program, text
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, value
    integer(i4) :: equals

    equals = index(text, '=')
    name = text
    value = ''
    if (equals > 0) then
      name = text(:equals - 1)
      value = text(equals + 1:)
    end if
    select case (name)
    case ('--check', '--json', '--memory', '--keys', '--version', '--help', '-h')
      if (equals > 0) then
        call errors%add('D022', 'option '//name//' accepts no value', 'command line', &
                        'write '//name)
        return
      end if
    case ('--weights')
      if (program /= 'talus-couple') then
        call unknown_option(program, name, errors)
        return
      else if (equals > 0) then
        call errors%add('D022', 'option --weights accepts no value', 'command line', &
                        'write talus-couple FILE.h5 --weights')
        return
      end if
    case ('--restart', '--port', '--output', '--point', '--threads', '--measure', '--ranks')
      if (any(name == [character(len=9) :: '--measure', '--ranks']) .and. &
          program /= 'talus-dem') then
        call unknown_option(program, name, errors)
        return
      end if
      if (name == '--point' .and. equals == 0 .and. program == 'talus-fem') then
        options%one_point = .true.
        return
      end if
      if (len(value) == 0) then
        call errors%add('D022', 'option '//name//' needs a value', 'command line', &
                        'write '//name//'='//example_of(name)//' in one piece')
        return
      end if
    case default
      call unknown_option(program, name, errors)
      return
    end select
    call set_option(options, name, value, errors)
  end subroutine take_option

  subroutine set_option(options, name, value, errors)
    type(options_type), intent(inout) :: options
    character(len=*), intent(in) :: name, value
    type(error_list_type), intent(inout) :: errors

    select case (name)
    case ('--check')
      options%check = .true.
    case ('--json')
      options%json = .true.
    case ('--memory')
      options%memory = .true.
    case ('--keys')
      options%keys = .true.
    case ('--version')
      options%version = .true.
    case ('--help', '-h')
      options%help = .true.
    case ('--restart')
      options%restart = value
    case ('--port')
      options%port = value
    case ('--output')
      options%output_dir = value
    case ('--point')
      options%point = value
    case ('--measure')
      options%measure = value
    case ('--weights')
      options%weights = .true.
    case ('--threads')
      call take_number(name, value, most_threads, options%threads, errors)
    case ('--ranks')
      call take_number(name, value, most_ranks, options%ranks, errors)
    end select
  end subroutine set_option

  subroutine take_number(name, value, most, number, errors)
    character(len=*), intent(in) :: name, value
    integer(i4), intent(in) :: most
    integer(i4), intent(inout) :: number
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: status
    call parse_integer(value, number, status)
    if (status == value_good .and. number >= 1 .and. number <= most) return
    call errors%add('D022', name//'='//value//' is no number from 1 to '//str(most), &
                    'command line', 'write '//name//'='//example_of(name))
    number = 0
  end subroutine take_number

  subroutine unknown_option(program, name, errors)
    character(len=*), intent(in) :: program, name
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)

    call append_string(names, '--check')
    call append_string(names, '--json')
    call append_string(names, '--memory')
    call append_string(names, '--keys')
    call append_string(names, '--version')
    call append_string(names, '--help')
    call append_string(names, '--restart=')
    call append_string(names, '--port=')
    call append_string(names, '--output=')
    call append_string(names, '--point=')
    call append_string(names, '--threads=')
    if (program == 'talus-dem') call append_string(names, '--measure=')
    if (program == 'talus-dem') call append_string(names, '--ranks=')
    if (program == 'talus-couple') call append_string(names, '--weights')
    call errors%add('D020', program//' has no option '//name, 'command line', &
                    did_you_mean(name, names, 'options:'))
  end subroutine unknown_option

  pure function example_of(name) result(text)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    select case (name)
    case ('--restart')
      text = 'auto'
    case ('--threads')
      text = '2'
    case ('--ranks')
      text = '64'
    case ('--output')
      text = 'results'
    case ('--port')
      text = 'shm:/name'
    case default
      text = 'FILE'
    end select
  end function example_of

  pure function usage_line(program) result(text)
    character(len=*), intent(in) :: program
    character(len=:), allocatable :: text
    text = 'usage: '//program//' deck.nml [--check] [--json] [--restart=auto|FILE] [--output=DIR]' &
           //' [--threads=N]'
  end function usage_line

  !> The answer to --help.
  subroutine usage_text(program, lines)
    character(len=*), intent(in) :: program
    type(string_type), allocatable, intent(out) :: lines(:)

    call append_string(lines, usage_line(program))
    call append_string(lines, '       '//program//' --keys [--json] | --version | --help')
    call append_string(lines, '')
    call append_string(lines, '  --check         read the deck and all that it names, report'// &
                       ' every fault, run nothing')
    call append_string(lines, '  --json          with --check or --keys: answer as JSON')
    call append_string(lines, '  --memory        with --check --json: the memory that a run takes')
    call append_string(lines, '  --keys          groups and keys of a deck')
    call append_string(lines, '  --restart=auto  go on from the newest complete checkpoint')
    call append_string(lines, '  --restart=FILE  go on from this checkpoint')
    call append_string(lines, '  --output=DIR    folder of the results (default: that of the deck)')
    call append_string(lines, '  --threads=N     OpenMP threads')
    if (program /= 'talus-couple') &
      call append_string(lines, '  --port=SPEC     serve talus-couple there (set by talus-couple)')
    call append_string(lines, '  --point=FILE    rendezvous file, where all three are started'// &
                       ' by hand')
    if (program == 'talus-dem') &
      call append_string(lines, '  --ranks=N       with --check: memory that the run would take'// &
                         ' on N ranks')
    if (program == 'talus-dem') &
      call append_string(lines, '  --measure=FILE  &measure and &grid of the deck, on a field'// &
                         ' file of an earlier run')
    if (program == 'talus-couple') &
      call append_string(lines, '  --weights       energy partition of an overlap in a file'// &
                         ' in place of the deck, without solvers')
    if (program == 'talus-fem') &
      call append_string(lines, '  --point         one material along the &path states of the'// &
                         ' deck, without mesh')
    call append_string(lines, '')
    call append_string(lines, 'exit codes: 0 finished, 1 input faults, 2 numerical failure,'// &
                       ' 3 stopped on request, 4 system, 5 bug')
  end subroutine usage_text
end module talus_options
