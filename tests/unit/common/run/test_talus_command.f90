!> Words of command lines: blanks, quotes, variables, and nothing else of a shell.
program test_talus_command
  use talus_kinds, only: i4
  use talus_command, only: command_words
  use talus_system, only: set_environment
  use talus_test, only: test_type
  use talus_text, only: string_type
  implicit none
  type(test_type) :: test

  call set_environment('TALUS_TEST_WORD', 'two words', .true.)
  call check('mpirun -np 8  talus-dem', 'mpirun|-np|8|talus-dem')
  call check('  a  ', 'a')
  call check('', '')
  call check("'it is' ""one's""x", "it is|one'sx")
  call check("a '' b", 'a||b')
  call check('$TALUS_TEST_WORD ${TALUS_TEST_WORD}s', 'two words|two wordss')
  call check("'$TALUS_TEST_WORD' ""$TALUS_TEST_WORD""", '$TALUS_TEST_WORD|two words')
  call check('a $TALUS_TEST_NONE b$TALUS_TEST_NONE', 'a|b')
  call check('$ $(id) `id` a;b && c | d > e', '$|$(id)|`id`|a;b|&&|c|||d|>|e')
  call check('a\ b "\$HOME \"x\"" c\\d', 'a b|$HOME "x"|c\d')
  call check('a\', 'a\')
  call check('end$', 'end$')
  call check_open("python3 'my partner.py")
  call check_open('"')
  call test%finish()

contains

  !> `wanted`: the words with | between them.
  subroutine check(text, wanted)
    character(len=*), intent(in) :: text, wanted
    type(string_type), allocatable :: words(:)
    character(len=:), allocatable :: found
    logical :: closed
    integer(i4) :: k
    call command_words(text, words, closed)
    found = ''
    do k = 1, int(size(words), i4)
      if (k > 1) found = found//'|'
      found = found//words(k)%s
    end do
    call test%check_text('words of '//text, found, wanted)
    call test%check('quotes of '//text, closed)
  end subroutine check

  subroutine check_open(text)
    character(len=*), intent(in) :: text
    type(string_type), allocatable :: words(:)
    logical :: closed
    call command_words(text, words, closed)
    call test%check('an open quote in '//text, .not. closed)
  end subroutine check_open
end program test_talus_command
