!> What every program answers without a run: --help, --version, --keys.
module talus_answers
  use, intrinsic :: iso_fortran_env, only: output_unit
  use talus_kinds, only: i4
  use talus_deck_table, only: key_table_type
  use talus_options, only: options_type, usage_text
  use talus_report, only: report_keys
  use talus_text, only: string_type
  use talus_version, only: version_text, git_hash
  implicit none
  private
  public :: asks_a_question, answer_question

contains

  !> Does the command line only ask, so that nothing is to be run?
  pure logical function asks_a_question(options)
    type(options_type), intent(in) :: options
    asks_a_question = options%help .or. options%version .or. options%keys
  end function asks_a_question

  !> Print the answer on standard output.
  subroutine answer_question(program, options, table)
    character(len=*), intent(in) :: program  !! 'talus-dem'
    type(options_type), intent(in) :: options
    type(key_table_type), intent(in) :: table
    type(string_type), allocatable :: lines(:)
    integer(i4) :: k

    if (options%help) then
      call usage_text(program, lines)
      do k = 1, size(lines)
        write (output_unit, '(a)') lines(k)%s
      end do
    else if (options%version) then
      write (output_unit, '(a)') program//' '//version_text()//', git '//git_hash()
    else
      call report_keys(table, options%json)
    end if
  end subroutine answer_question
end module talus_answers
