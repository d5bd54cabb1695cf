!> The order of keys.
module cpl_order
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: sort_order

contains

  !> Order of rising keys, equal ones as they came (merge sort).
  pure subroutine sort_order(key, order)
    real(wp), intent(in) :: key(:)
    integer(i4), intent(out) :: order(:)
    integer(i4) :: merged(size(key)), width, low, middle, high, k, n
    n = size(key)
    order = [(k, k=1, n)]
    width = 1
    do while (width < n)
      do low = 1, n, 2*width
        middle = min(low + width, n + 1)
        high = min(low + 2*width, n + 1)
        merged(low:high - 1) = merge_runs(key, order(low:middle - 1), order(middle:high - 1))
      end do
      order = merged
      width = 2*width
    end do
  end subroutine sort_order

  !> Two sorted runs as one, the first one's before equal ones of the second.
  pure function merge_runs(key, first, second) result(merged)
    real(wp), intent(in) :: key(:)
    integer(i4), intent(in) :: first(:), second(:)
    integer(i4) :: merged(size(first) + size(second)), a, b, k
    logical :: from_first
    a = 1
    b = 1
    do k = 1, size(merged)
      from_first = b > size(second)
      if (.not. from_first .and. a <= size(first)) from_first = key(first(a)) <= key(second(b))
      if (from_first) then
        merged(k) = first(a)
        a = a + 1
      else
        merged(k) = second(b)
        b = b + 1
      end if
    end do
  end function merge_runs
end module cpl_order
