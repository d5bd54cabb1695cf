!> Arrays of the leader, broadcast to all ranks, where they are allocated with the same shape.
module dem_broadcast
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  implicit none
  private
  public :: broadcast_matrix, broadcast_list, broadcast_table

contains

  subroutine broadcast_matrix(team, matrix)
    type(ranks_type), intent(in) :: team
    real(wp), intent(inout), contiguous :: matrix(:, :)
    real(wp), allocatable :: values(:)
    if (size(matrix) == 0) return
    values = reshape(matrix, [size(matrix)])
    call team%broadcast_values(values)
    matrix = reshape(values, shape(matrix))
  end subroutine broadcast_matrix

  subroutine broadcast_list(team, list)
    type(ranks_type), intent(in) :: team
    real(wp), intent(inout), contiguous :: list(:)
    if (size(list) > 0) call team%broadcast_values(list)
  end subroutine broadcast_list

  subroutine broadcast_table(team, table)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(inout), contiguous :: table(:, :)
    integer(i4), allocatable :: numbers(:)
    if (size(table) == 0) return
    numbers = reshape(table, [size(table)])
    call team%broadcast_numbers(numbers)
    table = reshape(numbers, shape(table))
  end subroutine broadcast_table
end module dem_broadcast
