!> Sparse rows of weights: interpolation from nodes to points, and its transpose, which transfers
!! forces of the points to the nodes. Sums are added in the order of the rows.
module cpl_rows
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: rows_type, curl_rows_type, lanes

  integer(i4), parameter :: lanes = 4  !! of a vector: three components, and one of zeros

  !> y_i = sum of weight times x of the columns of row i, for vectors of three components.
  type :: rows_type
    integer(i4) :: rows = 0, columns = 0
    integer(i4), allocatable :: first(:)  !! of each row's entries (rows + 1)
    integer(i4), allocatable :: column(:)
    real(wp), allocatable :: weight(:)    !! [-]
  contains
    procedure :: begin => begin_rows
    procedure :: add_row
    procedure :: finish => finish_rows
    procedure :: turn
    procedure :: apply
    procedure :: apply_some
    procedure :: transposed
    procedure :: transposed_some
  end type rows_type

  !> y_i = 1/2 sum of slope x u of the columns of row i: half the curl.
  type :: curl_rows_type
    integer(i4) :: rows = 0
    integer(i4), allocatable :: first(:)
    integer(i4), allocatable :: column(:)
    real(wp), allocatable :: slope(:, :)  !! (3, entries) [1/m]
  contains
    procedure :: apply => apply_curl
    procedure :: apply_some => apply_some_curl
    procedure :: transposed => transposed_curl
    procedure :: transposed_some => transposed_some_curl
  end type curl_rows_type

contains

  !> Make room for the rows that `add_row` brings, `most` entries each.
  subroutine begin_rows(self, rows, columns, most)
    class(rows_type), intent(inout) :: self
    integer(i4), intent(in) :: rows, columns, most
    if (allocated(self%first)) deallocate (self%first, self%column, self%weight)
    allocate (self%first(rows + 1), self%column(rows*most), self%weight(rows*most))
    self%rows = 0
    self%columns = columns
    self%first(1) = 1
  end subroutine begin_rows

  !> Entries of column 0 are of a node that does not count here.
  subroutine add_row(self, column, weight)
    class(rows_type), intent(inout) :: self
    integer(i4), intent(in) :: column(:)
    real(wp), intent(in) :: weight(:)
    integer(i4) :: at, e
    at = self%first(self%rows + 1)
    do e = 1, size(column)
      if (column(e) == 0) cycle
      self%column(at) = column(e)
      self%weight(at) = weight(e)
      at = at + 1
    end do
    self%rows = self%rows + 1
    self%first(self%rows + 1) = at
  end subroutine add_row

  !> Give back the room that was not needed.
  subroutine finish_rows(self)
    class(rows_type), intent(inout) :: self
    integer(i4) :: n
    n = self%first(self%rows + 1) - 1
    self%column = self%column(:n)
    self%weight = self%weight(:n)
    self%first = self%first(:self%rows + 1)
  end subroutine finish_rows

  !> The same weights with rows for columns; each new row in the order of the old rows.
  pure subroutine turn(self, turned)
    class(rows_type), intent(in) :: self
    type(rows_type), intent(out) :: turned
    integer(i4) :: next(self%columns), i, e, a
    turned%rows = self%columns
    turned%columns = self%rows
    allocate (turned%first(self%columns + 1), turned%column(size(self%column)), &
              turned%weight(size(self%column)))
    next = 0
    do e = 1, size(self%column)
      next(self%column(e)) = next(self%column(e)) + 1
    end do
    turned%first(1) = 1
    do a = 1, self%columns
      turned%first(a + 1) = turned%first(a) + next(a)
    end do
    next = turned%first(:self%columns)
    do i = 1, self%rows
      do e = self%first(i), self%first(i + 1) - 1
        a = self%column(e)
        turned%column(next(a)) = i
        turned%weight(next(a)) = self%weight(e)
        next(a) = next(a) + 1
      end do
    end do
  end subroutine turn

  pure subroutine apply(self, x, y)
    class(rows_type), intent(in) :: self
    real(wp), intent(in) :: x(:, :)   !! (3, columns)
    real(wp), intent(out) :: y(:, :)  !! (3, rows)
    real(wp) :: padded(lanes, size(x, 2))
    integer(i4) :: i
    call pad(x, padded)
    do i = 1, self%rows
      y(:, i) = of_row(self, i, padded)
    end do
  end subroutine apply

  !> As apply, the rows named alone, one after another.
  pure subroutine apply_some(self, rows, x, y)
    class(rows_type), intent(in) :: self
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: x(:, :)   !! (3, columns)
    real(wp), intent(out) :: y(:, :)  !! (3, size(rows))
    real(wp) :: padded(lanes, size(x, 2))
    integer(i4) :: k
    call pad(x, padded)
    do k = 1, size(rows)
      y(:, k) = of_row(self, rows(k), padded)
    end do
  end subroutine apply_some

  !> Vectors of four: a component of zeros, so that one instruction takes all.
  pure subroutine pad(x, padded)
    real(wp), intent(in) :: x(:, :)                   !! (3, n)
    real(wp), intent(out) :: padded(lanes, size(x, 2))
    integer(i4) :: a
    do a = 1, size(x, 2)
      padded(:3, a) = x(:, a)
      padded(4:, a) = 0.0_wp
    end do
  end subroutine pad

  pure function of_row(self, i, x) result(y)
    type(rows_type), intent(in) :: self
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: x(lanes, self%columns)
    real(wp) :: y(3), s(lanes)
    integer(i4) :: e
    s = 0.0_wp
    do e = self%first(i), self%first(i + 1) - 1
      s = s + self%weight(e)*x(:, self%column(e))
    end do
    y = s(:3)
  end function of_row

  !> As transposed, for y of the rows named alone.
  pure subroutine transposed_some(self, rows, y, x)
    class(rows_type), intent(in) :: self
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: y(:, :)     !! (3, size(rows))
    real(wp), intent(inout) :: x(:, :)  !! (3, columns)
    real(wp) :: padded(lanes, size(x, 2))
    integer(i4) :: k
    call pad(x, padded)
    do k = 1, size(rows)
      call add_row_of(self, rows(k), y(:, k), padded)
    end do
    x = padded(:3, :)
  end subroutine transposed_some

  !> x = x + transpose y.
  pure subroutine transposed(self, y, x)
    class(rows_type), intent(in) :: self
    real(wp), intent(in) :: y(:, :)     !! (3, rows)
    real(wp), intent(inout) :: x(:, :)  !! (3, columns)
    real(wp) :: padded(lanes, size(x, 2))
    integer(i4) :: i
    call pad(x, padded)
    do i = 1, self%rows
      call add_row_of(self, i, y(:, i), padded)
    end do
    x = padded(:3, :)
  end subroutine transposed

  !> A y of zeros adds nothing: ghosts that nothing touches.
  pure subroutine add_row_of(self, i, y, x)
    type(rows_type), intent(in) :: self
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: y(3)
    real(wp), intent(inout) :: x(lanes, self%columns)
    real(wp) :: z(lanes)
    integer(i4) :: e, l, a
    if (all(abs(y) <= 0.0_wp)) return
    z = [y, 0.0_wp]
    do e = self%first(i), self%first(i + 1) - 1
      a = self%column(e)
      !$omp simd
      do l = 1, lanes
        x(l, a) = x(l, a) + self%weight(e)*z(l)
      end do
    end do
  end subroutine add_row_of

  pure subroutine apply_curl(self, u, y)
    class(curl_rows_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: y(:, :)
    integer(i4) :: i
    do i = 1, self%rows
      y(:, i) = curl_of_row(self, i, u)
    end do
  end subroutine apply_curl

  pure subroutine apply_some_curl(self, rows, u, y)
    class(curl_rows_type), intent(in) :: self
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: y(:, :)
    integer(i4) :: i
    do i = 1, size(rows)
      y(:, i) = curl_of_row(self, rows(i), u)
    end do
  end subroutine apply_some_curl

  pure function curl_of_row(self, i, u) result(y)
    type(curl_rows_type), intent(in) :: self
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: u(:, :)
    real(wp) :: y(3)
    integer(i4) :: e
    y = 0.0_wp
    do e = self%first(i), self%first(i + 1) - 1
      associate (g => self%slope(:, e), v => u(:, self%column(e)))
        y(1) = y(1) + g(2)*v(3) - g(3)*v(2)
        y(2) = y(2) + g(3)*v(1) - g(1)*v(3)
        y(3) = y(3) + g(1)*v(2) - g(2)*v(1)
      end associate
    end do
    y = 0.5_wp*y
  end function curl_of_row

  !> x = x + transpose y: a moment y gives the force 1/2 y x slope.
  pure subroutine transposed_curl(self, y, x)
    class(curl_rows_type), intent(in) :: self
    real(wp), intent(in) :: y(:, :)
    real(wp), intent(inout) :: x(:, :)
    integer(i4) :: i
    do i = 1, self%rows
      call add_curl_of_row(self, i, y(:, i), x)
    end do
  end subroutine transposed_curl

  pure subroutine transposed_some_curl(self, rows, y, x)
    class(curl_rows_type), intent(in) :: self
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: y(:, :)
    real(wp), intent(inout) :: x(:, :)
    integer(i4) :: i
    do i = 1, size(rows)
      call add_curl_of_row(self, rows(i), y(:, i), x)
    end do
  end subroutine transposed_some_curl

  !> A y of zeros adds nothing: ghosts that nothing touches.
  pure subroutine add_curl_of_row(self, i, y, x)
    type(curl_rows_type), intent(in) :: self
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: y(3)
    real(wp), intent(inout) :: x(:, :)
    real(wp) :: h(3)
    integer(i4) :: e, a
    if (all(abs(y) <= 0.0_wp)) return
    h = 0.5_wp*y
    do e = self%first(i), self%first(i + 1) - 1
      a = self%column(e)
      associate (g => self%slope(:, e))
        x(1, a) = x(1, a) + h(2)*g(3) - h(3)*g(2)
        x(2, a) = x(2, a) + h(3)*g(1) - h(1)*g(3)
        x(3, a) = x(3, a) + h(1)*g(2) - h(2)*g(1)
      end associate
    end do
  end subroutine add_curl_of_row
end module cpl_rows
