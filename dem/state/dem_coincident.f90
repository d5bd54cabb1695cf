!> Grains whose centres coincide: a packing that holds a grain twice, or two packings in one file.
module dem_coincident
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_repeated_errors, only: repeated_errors_type
  use dem_state, only: kind_free
  implicit none
  private
  public :: check_centres, order_along

  real(wp), parameter :: same = 1.0e-6_wp  !! centres closer than this coincide, in least semi-axes
  !> Centres are sorted along it; lattices have few centres of one height over it.
  real(wp), parameter :: line(3) = [0.52573111_wp, 0.66276549_wp, 0.53316287_wp]

contains

  !> Fault I237 of every pair with one centre, the first few; both may not be prescribed, as parts
  !! of a body that is put together from grains are. The order sorts the heights, see order_along.
  subroutine check_centres(id, kind, x, axes, order, errors)
    integer(i8), intent(in) :: id(:)
    integer(i4), intent(in) :: kind(:)
    real(wp), intent(in) :: x(:, :)     !! (3, n) [m]
    real(wp), intent(in) :: axes(:, :)  !! (3, n) semi-axes [m]
    integer(i4), intent(in) :: order(:)  !! (n)
    type(error_list_type), intent(inout) :: errors
    type(repeated_errors_type) :: few
    real(wp) :: widest, apart
    integer(i4) :: a, b, i, j

    if (size(id) == 0) return
    widest = same*maxval(minval(axes, 1))
    do a = 1, size(order) - 1
      i = order(a)
      do b = a + 1, size(order)
        j = order(b)
        if (dot_product(x(:, j) - x(:, i), line) > widest) exit
        if (kind(i) /= kind_free .and. kind(j) /= kind_free) cycle
        apart = norm2(x(:, j) - x(:, i))
        if (apart > same*min(minval(axes(:, i)), minval(axes(:, j)))) cycle
        call few%add('I237', 'grains '//str(min(id(i), id(j)))//' and '//str(max(id(i), id(j)))// &
                     ' have the same centre, '//str(x(:, i))//' m', &
                     'the packing holds grains twice: make it again, or leave one of them out', &
                     errors)
      end do
    end do
    call few%finish('pairs', errors)
  end subroutine check_centres

  !> Whole numbers that ascend as the heights of centres over `line` do, to be sorted.
  pure function order_along(x) result(key)
    real(wp), intent(in) :: x(:, :)  !! (3, n) [m]
    integer(i8) :: key(size(x, 2))
    integer(i4) :: k
    do k = 1, size(x, 2)
      key(k) = transfer(dot_product(x(:, k), line), key(k))
      if (key(k) < 0) key(k) = ieor(key(k), huge(key(k)))
    end do
  end function order_along
end module dem_coincident
