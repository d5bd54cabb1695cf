!> The order of keys.
module cpl_order
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: sort_order

contains

  !> Order of rising keys, equal ones as they came (merge sort).
  subroutine sort_order(key, order)
    real(wp), intent(in) :: key(:)
    integer(i4), intent(out) :: order(:)
    integer(i4) :: spare(size(key)), width, low, middle, high, a, b, k, n
    n = size(key)
    order = [(k, k=1, n)]
    width = 1
    do while (width < n)
      do low = 1, n, 2*width
        middle = min(low + width, n + 1)
        high = min(low + 2*width, n + 1)
        a = low
        b = middle
        do k = low, high - 1
          if (b >= high) then
            spare(k) = order(a)
            a = a + 1
          else if (a < middle .and. key(order(min(a, n))) <= key(order(b))) then
            spare(k) = order(a)
            a = a + 1
          else
            spare(k) = order(b)
            b = b + 1
          end if
        end do
      end do
      order = spare
      width = 2*width
    end do
  end subroutine sort_order
end module cpl_order
