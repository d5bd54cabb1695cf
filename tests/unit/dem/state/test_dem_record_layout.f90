!> Columns of records: each block begins at 1, has neither gap nor overlap, and ends where declared.
program test_dem_record_layout
  use talus_kinds, only: i4
  use talus_test, only: test_type
  use dem_record_layout, only: grain_columns, shape_columns, contact_columns, touch_head_columns, &
    slot_columns, list_columns, target_columns, load_columns, plane_columns, swap_columns, &
    sum_reals, at_id
  use dem_shape, only: shape_size
  use dem_state, only: body_size, history_size, result_size
  implicit none
  type(test_type) :: test

  call check_block('grain', grain_columns, 1_i4, 50_i4 + body_size)
  call check_block('shape', shape_columns, 51_i4 + body_size, 14_i4 + shape_size)
  call check_block('contact', contact_columns, 1_i4, 8_i4 + history_size + result_size)
  call check_block('grain at surfaces', touch_head_columns, 1_i4, 8_i4)
  call check_block('contact with a surface', slot_columns, 1_i4, history_size + 23_i4)
  call check_block('listed contact', list_columns, 1_i4, 20_i4)
  call check_block('target', target_columns, 1_i4, 26_i4)
  call check_block('load', load_columns, 1_i4, 7_i4)
  call check_block('plane', plane_columns, 1_i4, 10_i4)
  call check_block('exchange', swap_columns, 1_i4, 19_i4)
  call test%check('sums are the first of a grain', sum_reals == 13 .and. at_id == 14)
  call test%check('an overlap is seen', any(covered(reshape([1, 3, 3, 4], [2, 2]), 1_i4) == 2))
  call test%check('a gap is seen', any(covered(reshape([1, 3, 5, 6], [2, 2]), 1_i4) == 0))
  call test%finish()

contains

  !> Each column from the first to the last of a block belongs to one quantity.
  subroutine check_block(name, columns, first, reals)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: columns(:, :)  !! (2, quantities) first and last column
    integer(i4), intent(in) :: first, reals
    call test%check(name//': ends after its begin', all(columns(2, :) >= columns(1, :)))
    call test%check(name//': first column', minval(columns) == first)
    call test%check(name//': as many reals as quantities have', &
                    maxval(columns) == first + reals - 1)
    call test%check(name//': no gap, no overlap', all(covered(columns, first) == 1))
  end subroutine check_block

  !> Quantities that each column belongs to.
  pure function covered(columns, first) result(times)
    integer(i4), intent(in) :: columns(:, :), first
    integer(i4) :: times(first:maxval(columns))
    integer(i4) :: k
    times = 0
    do k = 1, size(columns, 2)
      times(columns(1, k):columns(2, k)) = times(columns(1, k):columns(2, k)) + 1
    end do
  end function covered
end program test_dem_record_layout
