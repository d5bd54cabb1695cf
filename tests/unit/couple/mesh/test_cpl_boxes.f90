!> Boxes of space: every thing is listed where it reaches, ascending, and few others are.
program test_cpl_boxes
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_boxes, only: boxes_type
  implicit none

  type(test_type) :: test

  call scattered()
  call flat()
  call one()
  call test%finish()

contains

  !> Things of many sizes: those that hold a point are in its list, whatever its place.
  subroutine scattered()
    integer(i4), parameter :: n = 400
    real(wp) :: low(3, n), high(3, n), x(3)
    type(boxes_type) :: boxes
    integer(i4) :: k, e, range(2), most
    logical :: complete, ascending

    do k = 1, n
      low(:, k) = modulo(k*[0.618_wp, 0.414_wp, 0.732_wp], 1.0_wp)
      high(:, k) = low(:, k) + 0.01_wp*[1 + mod(k, 3), 1 + mod(k, 5), 1 + mod(k, 20)]
    end do
    call boxes%make(low, high)
    complete = .true.
    ascending = .true.
    most = 0
    do k = 1, 1000
      x = modulo(k*[0.271_wp, 0.577_wp, 0.161_wp], 1.0_wp)
      if (mod(k, 3) == 0) x = merge(low(:, 1 + mod(k, n)), high(:, 1 + mod(k, n)), mod(k, 2) == 0)
      range = boxes%holding(x)
      most = max(most, range(2) - range(1) + 1)
      associate (list => boxes%listed(range(1):range(2)))
        do e = 1, n
          if (all(x >= low(:, e)) .and. all(x <= high(:, e))) &
            complete = complete .and. any(list == e)
        end do
        ascending = ascending .and. all(list(2:) > list(:size(list) - 1))
      end associate
    end do
    call test%check('what holds a point is listed', complete)
    call test%check('ascending', ascending)
    call test%check('few are listed', most > 0 .and. most < n/10)
    range = boxes%holding([2.0_wp, 0.5_wp, 0.5_wp])
    call test%check('nothing beyond', range(2) < range(1))
  end subroutine scattered

  !> A plane of things without thickness: no more boxes than are useful.
  subroutine flat()
    real(wp) :: low(3, 900), high(3, 900)
    type(boxes_type) :: boxes
    integer(i4) :: k, range(2)
    do k = 1, 900
      low(:, k) = [1.0_wp*mod(k - 1, 30), 1.0_wp*((k - 1)/30), 5.0_wp]
      high(:, k) = low(:, k) + [1.0_wp, 1.0_wp, 0.0_wp]
    end do
    call boxes%make(low, high)
    call test%check('boxes of a plane', product(boxes%boxes) <= 27*900)
    range = boxes%holding([7.5_wp, 3.5_wp, 5.0_wp])
    call test%check('place in a plane', any(boxes%listed(range(1):range(2)) == 3*30 + 8))
  end subroutine flat

  !> One thing without any extent.
  subroutine one()
    type(boxes_type) :: boxes
    integer(i4) :: range(2)
    call boxes%make(spread([1.0_wp, 2.0_wp, 3.0_wp], 2, 1), spread([1.0_wp, 2.0_wp, 3.0_wp], 2, 1))
    range = boxes%holding([1.0_wp, 2.0_wp, 3.0_wp])
    call test%check('a point', range(2) == range(1))
  end subroutine one
end program test_cpl_boxes
