!> The command line: every option, and what is wrong with one.
program test_talus_options
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use talus_options, only: options_type, parse_arguments, usage_text
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test
  type(options_type) :: options
  type(error_list_type) :: errors
  type(string_type), allocatable :: lines(:)

  call parse('a b.nml|--check|--json|--restart=auto|--port=shm:/x|--threads=4|--output=out'// &
             '|--point=p')
  call test%check('no fault', .not. errors%any())
  call test%check_text('deck', options%deck, 'a b.nml')
  call test%check('flags', options%check .and. options%json .and. .not. options%keys)
  call test%check_text('restart', options%restart, 'auto')
  call test%check_text('port', options%port, 'shm:/x')
  call test%check_text('output', options%output_dir, 'out')
  call test%check_text('point', options%point, 'p')
  call test%check('threads', options%threads == 4)
  call parse('deck.nml')
  call test%check('nothing said', options%threads == 0 .and. options%restart == '' &
                  .and. options%port == '' .and. options%output_dir == '' .and. .not. options%check)
  call parse('--help')
  call test%check('help needs no deck', options%help .and. .not. errors%any())
  call parse('--keys|--json')
  call test%check('keys need no deck', options%keys .and. .not. errors%any())
  call parse('--version')
  call test%check('version', options%version .and. .not. errors%any())
  call fault('unknown option', 'deck.nml|--chek', 'D020', 'did you mean ''--check''?')
  call fault('unknown option with a value', 'deck.nml|--thread=2', 'D020', '--threads=')
  call fault('no deck', '--check', 'D021', 'no deck')
  call fault('two decks', 'a.nml|b.nml', 'D021', '''a.nml'' and ''b.nml''')
  call fault('value missing', 'deck.nml|--restart', 'D022', '--restart=auto')
  call fault('value empty', 'deck.nml|--output=', 'D022', '--output=results')
  call fault('value too much', 'deck.nml|--check=1', 'D022', 'accepts no value')
  call fault('threads no number', 'deck.nml|--threads=two', 'D022', '--threads=two')
  call fault('threads zero', 'deck.nml|--threads=0', 'D022', 'from 1 to 1024')
  call parse('deck.nml|--check|--ranks=64')
  call test%check('ranks', options%ranks == 64 .and. .not. errors%any())
  call fault('ranks zero', 'deck.nml|--check|--ranks=0', 'D022', 'from 1 to')
  call fault('ranks of a run', 'deck.nml|--ranks=4', 'D022', 'mpirun -n 4 talus-dem')
  call parse('--chek|--jsn')
  call test%check('all options in one go', errors%count == 2)
  call usage_text('talus-dem', lines)
  call test%check('usage', index(lines(1)%s, 'usage: talus-dem deck.nml') == 1 &
                  .and. size(lines) > 8)
  call test%finish()

contains

  !> Parse arguments separated by |.
  subroutine parse(text)
    character(len=*), intent(in) :: text
    type(string_type), allocatable :: arguments(:)
    integer :: first, bar
    first = 1
    do
      bar = index(text(first:), '|')
      if (bar == 0) exit
      call append_string(arguments, text(first:first + bar - 2))
      first = first + bar
    end do
    call append_string(arguments, text(first:))
    call errors%clear()
    call parse_arguments(options, 'talus-dem', arguments, errors)
  end subroutine parse

  subroutine fault(name, text, code, piece)
    character(len=*), intent(in) :: name, text, code, piece
    call parse(text)
    call test%check(name//': one fault', errors%count == 1)
    if (errors%count == 0) return
    call test%check_text(name//': code', errors%item(1)%code, code)
    call test%check(name//': '//errors%text(1), index(errors%text(1), piece) > 0)
  end subroutine fault
end program test_talus_options
