!> The projection P of the free grains' motion on the nodes over them: D^ = P Q.
!!
!! 'l2': P = (N' W N)^-1 N' W, the best fit in the norm of W (1, masses or volumes), factored once.
!! 'mls': moving least squares, a linear fit around each node: no matrix is solved; P 1 = 1 and
!! P x = x hold, P N = 1 does not. (theory: overlap coupling)
!! eq. C.7
module cpl_projection
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_band, only: band_type, condition_of
  use cpl_order, only: sort_order
  use cpl_rows, only: rows_type, lanes
  implicit none
  private
  public :: projection_type, fit_row

  real(wp), parameter :: worst_condition = 1.0e8_wp
  integer(i4), parameter :: least_grains = 4      !! of a linear fit

  !> P of one field; rows of N are the grains, columns the nodes.
  type :: projection_type
    logical :: mls = .false.
    type(rows_type) :: n                    !! functions of the nodes at the grains
    real(wp), allocatable :: w(:)           !! weights of the grains
    integer(i4), allocatable :: place(:)    !! of each node in the factor
    integer(i4), allocatable :: at(:)       !! the same for the entries of N
    type(band_type) :: factor               !! of N' W N, scaled to a unit diagonal
    real(wp), allocatable :: scale(:)       !! 1/sqrt of the diagonal
    type(rows_type) :: fit                  !! rows of P itself (mls): nodes by grains
    type(rows_type) :: by_grain             !! the same by its columns, grains by nodes
    real(wp) :: condition = 1.0_wp
  contains
    procedure :: build_l2
    procedure :: build_loaded
    procedure :: build_massive
    procedure :: build_mls
    procedure :: apply
    procedure :: transposed
    procedure :: transposed_onto
    procedure :: solve_nodes
  end type projection_type

contains

  !> Make the factor. I425: fewer or badly placed grains; names are the ids of the nodes.
  subroutine build_l2(self, n, w, x_node, names, errors)
    class(projection_type), intent(inout) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: w(:)
    real(wp), intent(in) :: x_node(:, :)  !! (3, columns) [m]
    integer(i4), intent(in) :: names(:)
    type(error_list_type), intent(inout) :: errors
    type(band_type) :: matrix
    integer(i4) :: left(n%columns), k, bad

    self%mls = .false.
    self%n = n
    self%w = w/(sum(w)/max(1, size(w)))
    call order_nodes(x_node, self%place)
    call profile(n, self%place, left)
    call matrix%shape_by(left)
    call fill(self, matrix)
    do k = 1, n%columns
      if (self%scale(k) > 0.0_wp) cycle
      call errors%add('I425', 'no free grain reaches node '//str(names(findloc(self%place, k, &
        1))), '', 'fill the elements of &overlap free_elements with grains, or take fewer of them')
      return
    end do
    self%factor = matrix
    call self%factor%factor(bad)
    if (bad > 0) then
      self%condition = huge(1.0_wp)
      call errors%add('I425', "the projection N'WN is singular at node "// &
        str(names(findloc(self%place, bad, 1))), '', 'an element has too few grains, or they '// &
        'lie in a plane: about 30 an element are wanted for hex8, 60 for hex20')
      return
    end if
    self%condition = condition_of(matrix, self%factor)
    if (self%condition > worst_condition) &
      call errors%add('I425', "the condition of the projection N'WN is "//str(self%condition)// &
        ', more than '//str(worst_condition), '', 'take larger elements: about 30 grains an '// &
        'element are wanted for hex8, 60 for hex20')
  end subroutine build_l2

  !> (N' W N + M)^-1 N' W on the rows of another projection: the nodes carry masses M of their own,
  !! w are those of the grains.
  subroutine build_loaded(self, p, w, mass, errors)
    class(projection_type), intent(inout) :: self
    type(projection_type), intent(in) :: p
    real(wp), intent(in) :: w(:), mass(:)
    type(error_list_type), intent(inout) :: errors
    self%n = p%n
    self%place = p%place
    call factor_loaded(self, w, mass, errors)
  end subroutine build_loaded

  !> The same on rows of their own; every column has a mass.
  subroutine build_massive(self, n, w, mass, x_node, errors)
    class(projection_type), intent(inout) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: w(:), mass(:)
    real(wp), intent(in) :: x_node(:, :)  !! (3, columns) [m]
    type(error_list_type), intent(inout) :: errors
    self%n = n
    call order_nodes(x_node, self%place)
    call factor_loaded(self, w, mass, errors)
  end subroutine build_massive

  subroutine factor_loaded(self, w, mass, errors)
    type(projection_type), intent(inout) :: self
    real(wp), intent(in) :: w(:), mass(:)
    type(error_list_type), intent(inout) :: errors
    type(band_type) :: matrix
    integer(i4) :: left(self%n%columns), bad

    self%mls = .false.
    self%w = w
    call profile(self%n, self%place, left)
    call matrix%shape_by(left)
    call fill(self, matrix, mass)
    self%factor = matrix
    call self%factor%factor(bad)
    if (bad > 0) call errors%add('I425', "the masses N'MN that nodes carry are singular", '', &
                                 'take larger elements')
  end subroutine factor_loaded

  !> Nodes along the longest extent of all: the profile is as narrow as a slice.
  subroutine order_nodes(x, place)
    real(wp), intent(in) :: x(:, :)
    integer(i4), allocatable, intent(out) :: place(:)
    integer(i4) :: order(size(x, 2)), axis(3), k, spare
    real(wp) :: extent(3), key(size(x, 2)), step

    extent = maxval(x, 2) - minval(x, 2)
    axis = [1, 2, 3]
    do k = 1, 2
      spare = maxloc(extent(axis(k:)), 1) + k - 1
      axis([k, spare]) = axis([spare, k])
    end do
    step = 1.0e-6_wp
    key = ((x(axis(1), :) - minval(x(axis(1), :))) + step*(x(axis(2), :) - minval(x(axis(2), :))) &
           + step**2*(x(axis(3), :) - minval(x(axis(3), :))))
    call sort_order(key, order)
    allocate (place(size(order)))
    place(order) = [(k, k=1, int(size(order), i4))]
  end subroutine order_nodes

  !> First columns of the rows of N' W N.
  pure subroutine profile(n, place, left)
    type(rows_type), intent(in) :: n
    integer(i4), intent(in) :: place(:)
    integer(i4), intent(out) :: left(:)
    integer(i4) :: i, least, e
    left = [(i, i=1, int(size(left), i4))]
    do i = 1, n%rows
      associate (at => place(n%column(n%first(i):n%first(i + 1) - 1)))
        if (size(at) == 0) cycle
        least = minval(at)
        do e = 1, size(at)
          left(at(e)) = min(left(at(e)), least)
        end do
      end associate
    end do
  end subroutine profile

  !> N' W N, with masses of the nodes, scaled to a unit diagonal; scale is 0 where there is nothing.
  subroutine fill(self, matrix, mass)
    type(projection_type), intent(inout) :: self
    type(band_type), intent(inout) :: matrix
    real(wp), intent(in), optional :: mass(:)  !! of the columns
    integer(i4) :: i, e, f, a, b
    self%at = self%place(self%n%column)
    do i = 1, self%n%rows
      do e = self%n%first(i), self%n%first(i + 1) - 1
        a = self%at(e)
        do f = self%n%first(i), self%n%first(i + 1) - 1
          b = self%at(f)
          if (b <= a) call matrix%add(a, b, self%w(i)*self%n%weight(e)*self%n%weight(f))
        end do
      end do
    end do
    if (present(mass)) then
      do i = 1, size(mass)
        call matrix%add(self%place(i), self%place(i), mass(i))
      end do
    end if
    if (allocated(self%scale)) deallocate (self%scale)
    allocate (self%scale(matrix%n), source=0.0_wp)
    do i = 1, matrix%n
      if (matrix%value(matrix%base(i) + i) > 0.0_wp) &
        self%scale(i) = 1.0_wp/sqrt(matrix%value(matrix%base(i) + i))
    end do
    do i = 1, matrix%n
      do a = matrix%left(i), i
        matrix%value(matrix%base(i) + a) = matrix%value(matrix%base(i) + a) &
                                           *self%scale(i)*self%scale(a)
      end do
    end do
  end subroutine fill

  !> Rows of the fit around each node, of the grains within `reach` of it; N serves the fine scale.
  subroutine build_mls(self, n, w, x_node, x, reach, names, errors)
    class(projection_type), intent(inout) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: w(:)
    real(wp), intent(in) :: x_node(:, :), x(:, :)  !! nodes, grains (3, :) [m]
    real(wp), intent(in) :: reach(:)               !! of each node [m]
    integer(i4), intent(in) :: names(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: value(:)
    integer(i4), allocatable :: list(:)
    logical :: good
    integer(i4) :: a, k, most

    self%mls = .true.
    self%n = n
    self%w = w/(sum(w)/max(1, size(w)))
    most = 0
    do a = 1, size(x_node, 2)
      most = max(most, int(count(near(x, x_node(:, a), reach(a))), i4))
    end do
    call self%fit%begin(int(size(x_node, 2), i4), int(size(x, 2), i4), most)
    do a = 1, size(x_node, 2)
      list = pack([(k, k=1, int(size(x, 2), i4))], near(x, x_node(:, a), reach(a)))
      good = size(list) >= least_grains
      value = self%w(list)
      if (good) call fit_row(x(:, list), x_node(:, a), reach(a), value, good)
      if (.not. good) then
        call errors%add('I425', 'around node '//str(names(a))//' the '//str(size(list))// &
          ' free grains are too few, or lie in a plane', '', &
          'take larger elements, or fewer of them')
        return
      end if
      call self%fit%add_row(list, value)
    end do
    call self%fit%finish()
    call self%fit%turn(self%by_grain)
  end subroutine build_mls

  pure function near(x, at, reach)
    real(wp), intent(in) :: x(:, :), at(3), reach
    logical :: near(size(x, 2))
    integer(i4) :: k
    do k = 1, size(x, 2)
      near(k) = sum((x(:, k) - at)**2) < reach**2
    end do
  end function near

  !> Values at `at` of the linear fit to values at x, weighted by value (1 - r^2/reach^2)^2: weights
  !! in, coefficients out.
  pure subroutine fit_row(x, at, reach, value, good)
    real(wp), intent(in) :: x(:, :), at(3), reach
    real(wp), intent(inout) :: value(:)
    logical, intent(out) :: good
    real(wp) :: p(4, size(value)), m(4, 4), c(4), r, s
    integer(i4) :: k, i, j
    m = 0.0_wp
    do k = 1, size(value)
      p(:, k) = [1.0_wp, (x(:, k) - at)/reach]
      r = sum(p(2:, k)**2)
      value(k) = value(k)*(1.0_wp - r)**2
      do j = 1, 4
        m(:, j) = m(:, j) + value(k)*p(:, k)*p(j, k)
      end do
    end do
    good = .true.
    do i = 1, 4
      do j = 1, i
        s = m(i, j) - dot_product(m(i, :j - 1), m(j, :j - 1))
        if (j < i) then
          m(i, j) = s/m(j, j)
        else
          good = good .and. s > 1.0e-8_wp*m(i, i)
          if (.not. good) return
          m(i, i) = sqrt(s)
        end if
      end do
    end do
    c = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    do i = 1, 4
      c(i) = (c(i) - dot_product(m(i, :i - 1), c(:i - 1)))/m(i, i)
    end do
    do i = 4, 1, -1
      c(i) = (c(i) - dot_product(m(i + 1:, i), c(i + 1:)))/m(i, i)
    end do
    do k = 1, size(value)
      value(k) = value(k)*dot_product(c, p(:, k))
    end do
  end subroutine fit_row

  !> D^ = P Q (3, nodes) from the motion of the grains (3, grains).
  subroutine apply(self, q, d)
    class(projection_type), intent(in) :: self
    real(wp), intent(in) :: q(:, :)
    real(wp), intent(out) :: d(:, :)
    real(wp) :: r(lanes, self%n%columns), wq(lanes)
    integer(i4) :: i, e, l, a

    if (self%mls) then
      call self%fit%apply(q, d)
      return
    end if
    r = 0.0_wp
    wq = 0.0_wp
    do i = 1, self%n%rows
      wq(:3) = self%w(i)*q(:, i)
      do e = self%n%first(i), self%n%first(i + 1) - 1
        a = self%at(e)
        !$omp simd
        do l = 1, lanes
          r(l, a) = r(l, a) + self%n%weight(e)*wq(l)
        end do
      end do
    end do
    call solve(self, r)
    do a = 1, self%n%columns
      d(:, a) = r(:3, self%place(a))
    end do
  end subroutine apply

  !> p = p + P' f: forces of the nodes on the grains.
  subroutine transposed(self, f, p)
    class(projection_type), intent(in) :: self
    real(wp), intent(in) :: f(:, :)     !! (3, nodes)
    real(wp), intent(inout) :: p(:, :)  !! (3, grains)
    real(wp) :: r(lanes, self%n%columns)
    integer(i4) :: i

    if (self%mls) then
      call self%fit%transposed(f, p)
      return
    end if
    call gather(self, f, r)
    call solve(self, r)
    do i = 1, self%n%rows
      p(:, i) = p(:, i) + handed_to(self, i, r)
    end do
  end subroutine transposed

  !> p = base + P' f.
  subroutine transposed_onto(self, f, base, p)
    class(projection_type), intent(in) :: self
    real(wp), intent(in) :: f(:, :)     !! (3, nodes)
    real(wp), intent(in) :: base(:, :)  !! (3, grains)
    real(wp), intent(out) :: p(:, :)
    real(wp) :: r(lanes, self%n%columns)
    integer(i4) :: i

    if (self%mls) then
      p = base
      call self%fit%transposed(f, p)
      return
    end if
    call gather(self, f, r)
    call solve(self, r)
    do i = 1, self%n%rows
      p(:, i) = base(:, i) + handed_to(self, i, r)
    end do
  end subroutine transposed_onto

  !> What a grain gets of solved forces of the nodes.
  pure function handed_to(self, i, r) result(p)
    type(projection_type), intent(in) :: self
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: r(lanes, self%n%columns)
    real(wp) :: p(3), s(lanes)
    integer(i4) :: e
    s = 0.0_wp
    do e = self%n%first(i), self%n%first(i + 1) - 1
      s = s + self%n%weight(e)*r(:, self%at(e))
    end do
    p = self%w(i)*s(:3)
  end function handed_to

  !> (N' W N + M)^-1 f of the nodes, in place.
  subroutine solve_nodes(self, f)
    class(projection_type), intent(in) :: self
    real(wp), intent(inout) :: f(:, :)  !! (3, nodes)
    real(wp) :: r(lanes, self%n%columns)
    integer(i4) :: a
    call gather(self, f, r)
    call solve(self, r)
    do a = 1, self%n%columns
      f(:, a) = r(:3, self%place(a))
    end do
  end subroutine solve_nodes

  !> Values of the nodes in the order of the factor.
  pure subroutine gather(self, f, r)
    type(projection_type), intent(in) :: self
    real(wp), intent(in) :: f(:, :)                    !! (3, nodes)
    real(wp), intent(out) :: r(lanes, self%n%columns)
    integer(i4) :: a
    do a = 1, self%n%columns
      r(:3, self%place(a)) = f(:, a)
      r(4:, self%place(a)) = 0.0_wp
    end do
  end subroutine gather

  !> (N' W N)^-1 of a right-hand side of vectors, in place.
  pure subroutine solve(self, r)
    type(projection_type), intent(in) :: self
    real(wp), intent(inout) :: r(lanes, self%n%columns)
    integer(i4) :: a
    do a = 1, self%n%columns
      r(:, a) = self%scale(a)*r(:, a)
    end do
    call self%factor%solve_vectors(r)
    do a = 1, self%n%columns
      r(:, a) = self%scale(a)*r(:, a)
    end do
  end subroutine solve
end module cpl_projection
