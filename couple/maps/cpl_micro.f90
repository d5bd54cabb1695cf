!> Micro-deformations chi = 1 + phi in an overlap with a micromorphic solid (theory: overlap
!! coupling, Micro-deformation). Values are blocks: the three columns of phi at each node.
!!
!! Nodes over free grains: phi is the best linear fit of the grains' displacements around the node,
!! the grains weighed by mass and by the node's function,
!!   chi = (sum w x' Xi)(sum w Xi Xi)^-1,
!! its skew part, unless `positions`, that of the grains' mean rotation, which with `rigid` is all
!! of it: the micro-element is the grain. Ghosts turn by
!! w_k = -1/2 e_kij (chi' chi^-1)_ij of the interpolated chi; a moment m on a ghost is the couple
!! C_iK = -1/2 N_b e_kij m_k (chi^-1)_Kj on its nodes.
!! eqs. C.9 and C.10
module cpl_micro
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_vectors, only: cross
  use cpl_rows, only: rows_type
  implicit none
  private
  public :: micro_type, parts, moment_of, columns_of_turn

  integer(i4), parameter :: parts = 3            !! blocks of a node
  integer(i4), parameter :: least_grains = 4     !! of a linear fit
  real(wp), parameter :: least_spread = 1.0e-6_wp  !! determinant of moments, scaled, of a fit
  real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                               0.0_wp, 0.0_wp, 1.0_wp], [3, 3])

  type :: micro_type
    logical :: active = .false.
    logical :: positions = .false.         !! rotations of chi are those of positions, too
    logical :: rigid = .false.             !! chi is a rotation, without regard to positions
    integer(i4), allocatable :: first(:)   !! of each prescribed node's grains (nodes + 1)
    integer(i4), allocatable :: grain(:)
    real(wp), allocatable :: slope(:, :)   !! (3, entries) of the fit [1/m]
    real(wp), allocatable :: chi(:, :, :)      !! (3, 3, ghosts)
    real(wp), allocatable :: inverse(:, :, :)  !! the same
  contains
    procedure :: begin
    procedure :: fit
    procedure :: prescribed
    procedure :: pull_prescribed
    procedure :: turns
    procedure :: follow
    procedure :: take
    procedure :: pull
  end type micro_type

contains

  !> Ghosts at rest.
  subroutine begin(self, ghosts)
    class(micro_type), intent(inout) :: self
    integer(i4), intent(in) :: ghosts
    self%active = .true.
    self%chi = spread(unit, 3, ghosts)
    self%inverse = self%chi
  end subroutine begin

  !> Slopes of the fit around each node, from the functions n of the nodes at the grains and the
  !! grains' places in the reference state. I425: too few grains, or in a plane.
  subroutine fit(self, n, w, x, names, errors)
    class(micro_type), intent(inout) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: w(:)           !! of the grains; 0: not seen
    real(wp), intent(in) :: x(:, :)        !! (3, grains) [m]
    integer(i4), intent(in) :: names(:)    !! ids of the nodes
    type(error_list_type), intent(inout) :: errors
    type(rows_type) :: turned
    real(wp) :: share(size(n%column))
    integer(i4) :: a
    logical :: good

    call n%turn(turned)
    self%first = turned%first
    self%grain = turned%column
    share = w(turned%column)*turned%weight
    if (allocated(self%slope)) deallocate (self%slope)
    allocate (self%slope(3, size(n%column)))
    do a = 1, n%columns
      associate (from => self%first(a), to => self%first(a + 1) - 1)
        call fit_node(x(:, self%grain(from:to)), share(from:to), self%slope(:, from:to), good)
      end associate
      if (good) cycle
      call errors%add('I425', 'around node '//str(names(a))//' the free grains are too few '// &
        'for a micro-deformation, or lie in a plane', '', &
        'take larger elements, or fewer of them')
      return
    end do
  end subroutine fit

  !> Slopes w (sum w Xi Xi)^-1 Xi of the grains of one node, Xi from their weighted middle.
  pure subroutine fit_node(x, w, slope, good)
    real(wp), intent(in) :: x(:, :), w(:)
    real(wp), intent(out) :: slope(:, :)
    logical, intent(out) :: good
    real(wp) :: middle(3), moment(3, 3), inverse(3, 3), total, mean, det
    integer(i4) :: k, j

    slope = 0.0_wp
    total = sum(w)
    good = count(w > 0.0_wp) >= least_grains .and. total > 0.0_wp
    if (.not. good) return
    middle = matmul(x, w)/total
    moment = 0.0_wp
    do k = 1, size(w)
      do j = 1, 3
        moment(:, j) = moment(:, j) + w(k)*(x(:, k) - middle)*(x(j, k) - middle(j))
      end do
    end do
    mean = (moment(1, 1) + moment(2, 2) + moment(3, 3))/3.0_wp
    good = mean > 0.0_wp
    if (.not. good) return
    call invert(moment/mean, inverse, det)
    good = det > least_spread
    if (.not. good) return
    do k = 1, size(w)
      slope(:, k) = w(k)/mean*matmul(inverse, x(:, k) - middle)
    end do
  end subroutine fit_node

  !> Inverse of a matrix by its cofactors; of one with too small a determinant no more than these.
  pure subroutine invert(a, inverse, det)
    real(wp), intent(in) :: a(3, 3)
    real(wp), intent(out) :: inverse(3, 3), det
    inverse(1, :) = cross(a(:, 2), a(:, 3))
    inverse(2, :) = cross(a(:, 3), a(:, 1))
    inverse(3, :) = cross(a(:, 1), a(:, 2))
    det = dot_product(inverse(1, :), a(:, 1))
    if (det > least_spread) inverse = inverse/det
  end subroutine invert

  !> Blocks of the prescribed nodes from displacements of the grains and mean rotations at the
  !! nodes.
  pure subroutine prescribed(self, q, turn, phi)
    class(micro_type), intent(in) :: self
    real(wp), intent(in) :: q(:, :)        !! (3, grains) [m]
    real(wp), intent(in) :: turn(:, :)     !! (3, prescribed nodes) [rad]
    real(wp), intent(out) :: phi(:, :)     !! (3, 3 prescribed nodes)
    real(wp) :: a(3, 3)
    integer(i4) :: b, e, k
    do b = 1, size(self%first) - 1
      if (self%rigid) then
        phi(:, parts*b - 2:parts*b) = columns_of_turn(turn(:, b))
        cycle
      end if
      a = 0.0_wp
      do e = self%first(b), self%first(b + 1) - 1
        do k = 1, 3
          a(:, k) = a(:, k) + q(:, self%grain(e))*self%slope(k, e)
        end do
      end do
      if (.not. self%positions) a = 0.5_wp*(a + transpose(a)) + columns_of_turn(turn(:, b))
      phi(:, parts*b - 2:parts*b) = a
    end do
  end subroutine prescribed

  !> Columns of the skew matrix of a small rotation.
  pure function columns_of_turn(turn) result(a)
    real(wp), intent(in) :: turn(3)
    real(wp) :: a(3, 3)
    integer(i4) :: k
    do k = 1, 3
      a(:, k) = cross(turn, unit(:, k))
    end do
  end function columns_of_turn

  !> Couples on the prescribed nodes transferred: forces on the grains, and moments of mean
  !! rotations.
  pure subroutine pull_prescribed(self, c, force, moment)
    class(micro_type), intent(in) :: self
    real(wp), intent(in) :: c(:, :)            !! (3, 3 prescribed nodes) [N m]
    real(wp), intent(inout) :: force(:, :)     !! (3, grains) [N]
    real(wp), intent(out) :: moment(:, :)      !! (3, prescribed nodes) [N m]
    real(wp) :: a(3, 3)
    integer(i4) :: b, e
    moment = 0.0_wp
    do b = 1, size(self%first) - 1
      a = c(:, parts*b - 2:parts*b)
      if (.not. self%positions) then
        moment(:, b) = moment_of(a)
        a = 0.5_wp*(a + transpose(a))
      end if
      if (self%rigid) cycle
      do e = self%first(b), self%first(b + 1) - 1
        force(:, self%grain(e)) = force(:, self%grain(e)) + matmul(a, self%slope(:, e))
      end do
    end do
  end subroutine pull_prescribed

  !> Moment of couples on blocks in the reference state: sum over K of e_K x C_K [N m].
  pure function moment_of(c) result(moment)
    real(wp), intent(in) :: c(:, :)  !! (3, 3 nodes)
    real(wp) :: moment(3)
    integer(i4) :: k
    moment = 0.0_wp
    do k = 1, size(c, 2)
      moment = moment + cross(unit(:, mod(k - 1_i4, parts) + 1), c(:, k))
    end do
  end function moment_of

  !> Small rotations of the ghosts in the reference state.
  pure subroutine turns(self, n, phi, turn)
    class(micro_type), intent(in) :: self
    type(rows_type), intent(in) :: n           !! functions of the nodes at the ghosts
    real(wp), intent(in) :: phi(:, :)          !! (3, 3 nodes)
    real(wp), intent(out) :: turn(:, :)        !! (3, ghosts) [rad]
    real(wp) :: at(3, 3, n%rows)
    integer(i4) :: g
    call interpolate(n, phi, at)
    do g = 1, size(self%chi, 3)
      turn(:, g) = axis(at(:, :, g))
    end do
  end subroutine turns

  !> Rotations of the ghosts go on to those of phi: by (chi - chi_old) chi^-1, whose power with the
  !! couples of `pull` at chi is that of the moments.
  pure subroutine follow(self, n, phi, turn)
    class(micro_type), intent(inout) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: phi(:, :)
    real(wp), intent(inout) :: turn(:, :)      !! (3, ghosts) [rad]
    real(wp) :: old(3, 3, size(self%chi, 3))
    integer(i4) :: g
    old = self%chi
    call self%take(n, phi)
    do g = 1, size(old, 3)
      turn(:, g) = turn(:, g) + axis(matmul(self%chi(:, :, g) - old(:, :, g), &
                                            self%inverse(:, :, g)))
    end do
  end subroutine follow

  !> chi of the ghosts, without turning them.
  pure subroutine take(self, n, phi)
    class(micro_type), intent(inout) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: phi(:, :)
    real(wp) :: det
    integer(i4) :: g
    call interpolate(n, phi, self%chi)
    do g = 1, size(self%chi, 3)
      self%chi(:, :, g) = self%chi(:, :, g) + unit
      call invert(self%chi(:, :, g), self%inverse(:, :, g), det)
    end do
  end subroutine take

  !> Columns of phi at the ghosts.
  pure subroutine interpolate(n, phi, at)
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: phi(:, :)
    real(wp), intent(out) :: at(:, :, :)       !! (3, 3, ghosts)
    real(wp) :: column(3, n%rows)
    integer(i4) :: k
    do k = 1, 3
      call n%apply(phi(:, k::parts), column)
      at(:, k, :) = column
    end do
  end subroutine interpolate

  !> Axial vector -1/2 e_kij a_ij.
  pure function axis(a) result(v)
    real(wp), intent(in) :: a(3, 3)
    real(wp) :: v(3)
    v = 0.5_wp*[a(3, 2) - a(2, 3), a(1, 3) - a(3, 1), a(2, 1) - a(1, 2)]
  end function axis

  !> Add the couples of moments on the ghosts: C_K = 1/2 m x (row K of chi^-1).
  pure subroutine pull(self, n, m, c)
    class(micro_type), intent(in) :: self
    type(rows_type), intent(in) :: n
    real(wp), intent(in) :: m(:, :)            !! (3, ghosts) [N m]
    real(wp), intent(inout) :: c(:, :)         !! (3, 3 nodes) [N m]
    real(wp) :: at(3, n%rows), column(3, size(c, 2)/parts)
    integer(i4) :: g, k
    do k = 1, 3
      do g = 1, n%rows
        at(:, g) = 0.5_wp*cross(m(:, g), self%inverse(k, :, g))
      end do
      column = 0.0_wp
      call n%transposed(at, column)
      c(:, k::parts) = c(:, k::parts) + column
    end do
  end subroutine pull
end module cpl_micro
