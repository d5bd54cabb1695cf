!> Arrays of the leader, told to all ranks; the others have room for them.
module dem_broadcast
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  implicit none
  private
  public :: tell_matrix, tell_list, tell_table

contains

  subroutine tell_matrix(team, matrix)
    type(ranks_type), intent(in) :: team
    real(wp), intent(inout), contiguous :: matrix(:, :)
    real(wp), allocatable :: values(:)
    if (size(matrix) == 0) return
    values = reshape(matrix, [size(matrix)])
    call team%tell_values(values)
    matrix = reshape(values, shape(matrix))
  end subroutine tell_matrix

  subroutine tell_list(team, list)
    type(ranks_type), intent(in) :: team
    real(wp), intent(inout), contiguous :: list(:)
    if (size(list) > 0) call team%tell_values(list)
  end subroutine tell_list

  subroutine tell_table(team, table)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(inout), contiguous :: table(:, :)
    integer(i4), allocatable :: numbers(:)
    if (size(table) == 0) return
    numbers = reshape(table, [size(table)])
    call team%tell_numbers(numbers)
    table = reshape(numbers, shape(table))
  end subroutine tell_table
end module dem_broadcast
