!> What each element of the bed has gone through since the start: knots of its deformation gradient,
!! and the histories of stretch after which grains wake in it (theory-overlap, Conversion).
!!
!! A knot is set where F has changed by more than `step` or turned since the last one; at most
!! `most` of them, then every second goes. Elements whose stretches agree at all knots share a
!! history; those that have hardly been strained have none: their grains wake as the tile is.
!! eqs. C.22, C.25
module cpl_histories
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_homogenise, only: inverse_of
  use cpl_cells, only: cells_type, spot_type
  implicit none
  private
  public :: histories_type, request_type

  integer(i4), parameter :: most = 64             !! knots of an element
  real(wp), parameter :: step = 5.0e-4_wp         !! change of F at which a knot is set
  real(wp), parameter :: turned = 0.866_wp        !! cosine of the turn at which one is set before
  real(wp), parameter :: still = 3.0e-5_wp        !! strain up to which the tile is as it was
  real(wp), parameter :: alike = 1.0e-4_wp        !! stretches that are taken as the same ...
  real(wp), parameter :: alike_part = 0.1_wp      !! ... or this part of the strain
  real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                               0.0_wp, 0.0_wp, 1.0_wp], [3, 3])

  !> Of one element.
  type :: element_history_type
    real(wp), allocatable :: knot(:, :, :)  !! (3, 3, knots) F
  end type element_history_type

  !> Histories after which grains wake.
  type :: request_type
    integer(i4), allocatable :: number(:)      !! (elements) of the history, 0: none
    real(wp), allocatable :: turn(:, :)        !! (4, elements) rotation now, as a quaternion
    real(wp), allocatable :: spin(:, :)        !! (3, elements) of the nodes' motion [rad/s]
    integer(i4), allocatable :: knots(:)       !! (histories)
    integer(i4), allocatable :: element(:)     !! (histories) that it is of
    real(wp), allocatable :: stretch(:, :)     !! (9, all knots) U
  end type request_type

  type :: histories_type
    logical :: active = .false.
    type(element_history_type), allocatable :: element(:)
    type(spot_type), allocatable :: middle(:)  !! of the elements
  contains
    procedure :: begin
    procedure :: note
    procedure :: close => close_histories
    procedure :: ask
    procedure :: is_strained
    procedure :: strain
    procedure :: put => put_histories
    procedure :: get => get_histories
    procedure, private :: gradient
  end type histories_type

contains

  !> Nothing has happened yet.
  subroutine begin(self, cells)
    class(histories_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells  !! not displaced
    integer(i4) :: rank(cells%elements), e, n
    n = merge(cells%elements, 0_i4, self%active)
    allocate (self%element(n), self%middle(cells%elements))
    rank = 0
    do e = 1, cells%elements
      rank(e) = 1
      associate (node => cells%nodes_of(e))
        call cells%find(sum(cells%x(:, node), 2)/size(node), rank, self%middle(e))
      end associate
      rank(e) = 0
      if (self%active) allocate (self%element(e)%knot(3, 3, 0))
    end do
  end subroutine begin

  !> Gradient of a nodal field in the middle of an element, d/dx_j of component i at (i, j).
  pure function gradient(self, cells, field, e) result(g)
    class(histories_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: field(:, :)  !! (3, nodes)
    integer(i4), intent(in) :: e
    real(wp) :: g(3, 3)
    integer(i4) :: k, j
    g = 0.0_wp
    associate (spot => self%middle(e))
      do k = 1, spot%n
        do j = 1, 3
          g(:, j) = g(:, j) + field(:, cells%node(cells%start(e) + k - 1))*spot%gradient(j, k)
        end do
      end do
    end associate
  end function gradient

  !> Largest component of the strain U - 1 in the middle of an element.
  pure real(wp) function strain(self, cells, u, e)
    class(histories_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: u(:, :)      !! of all nodes since the start (3, nodes) [m]
    integer(i4), intent(in) :: e
    real(wp) :: f(3, 3)
    f = unit + self%gradient(cells, u, e)
    strain = maxval(abs(stretches(reshape(f, [3, 3, 1])) - reshape(unit, [3, 3, 1])))
  end function strain

  !> Knots where the deformation asks for them.
  subroutine note(self, cells, u, closed)
    class(histories_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: u(:, :)      !! of all nodes since the start (3, nodes) [m]
    logical, intent(in) :: closed(:)     !! (elements) that were not opened
    integer(i4) :: e
    if (.not. self%active) return
    do e = 1, size(closed)
      if (closed(e)) call extend(self%element(e)%knot, unit + self%gradient(cells, u, e), .false.)
    end do
  end subroutine note

  !> The histories of some elements end in what they are now.
  subroutine close_histories(self, cells, u, chosen)
    class(histories_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: u(:, :)      !! (3, nodes) [m]
    logical, intent(in) :: chosen(:)     !! (elements)
    integer(i4) :: e
    do e = 1, size(chosen)
      if (chosen(e)) call extend(self%element(e)%knot, unit + self%gradient(cells, u, e), .true.)
    end do
  end subroutine close_histories

  !> A knot more, if there is a reason.
  pure subroutine extend(knot, f, now)
    real(wp), allocatable, intent(inout) :: knot(:, :, :)
    real(wp), intent(in) :: f(3, 3)
    logical, intent(in) :: now  !! also a small change is one
    real(wp), allocatable :: longer(:, :, :)
    real(wp) :: last(3, 3), before(3, 3), change
    integer(i4) :: n
    logical :: wanted

    n = size(knot, 3)
    last = unit
    before = unit
    if (n > 0) last = knot(:, :, n)
    if (n > 1) before = knot(:, :, n - 1)
    change = norm2(f - last)
    wanted = change > step .or. (now .and. change > 0.1_wp*still)
    if (n > 0 .and. change > 0.1_wp*step) &
      wanted = wanted .or. sum((f - last)*(last - before)) < turned*change*norm2(last - before)
    if (.not. wanted) return
    if (n == most) then
      longer = knot(:, :, 2:n:2)
      n = n/2
      call move_alloc(longer, knot)
    end if
    allocate (longer(3, 3, n + 1))
    longer(:, :, :n) = knot
    longer(:, :, n + 1) = f
    call move_alloc(longer, knot)
  end subroutine extend

  !> Histories after which grains wake in some elements, closed before, and their motion now.
  subroutine ask(self, cells, u, v, chosen, request)
    class(histories_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: u(:, :), v(:, :)  !! of all nodes (3, nodes) [m], [m/s]
    logical, intent(in) :: chosen(:)          !! (elements)
    type(request_type), intent(out) :: request
    real(wp) :: g(3, 3), turn(3, 3)
    integer(i4) :: e

    allocate (request%number(size(chosen)), source=0_i4)
    allocate (request%turn(4, size(chosen)), request%spin(3, size(chosen)), source=0.0_wp)
    allocate (request%knots(0), request%element(0), request%stretch(9, 0))
    request%turn(1, :) = 1.0_wp
    do e = 1, size(chosen)
      if (.not. chosen(e)) cycle
      turn = rotation_in(unit + self%gradient(cells, u, e))
      request%turn(:, e) = quaternion_of(turn)
      g = self%gradient(cells, v, e)
      request%spin(:, e) = 0.5_wp*[g(3, 2) - g(2, 3), g(1, 3) - g(3, 1), g(2, 1) - g(1, 2)]
      if (.not. self%is_strained(e)) cycle
      call add_history(request, e, stretches(self%element(e)%knot))
    end do
  end subroutine ask

  !> The history of an element, unless one is there that is alike.
  pure subroutine add_history(request, e, stretch)
    type(request_type), intent(inout) :: request
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: stretch(:, :, :)
    integer(i4) :: k, last

    last = 0
    do k = 1, size(request%knots)
      associate (n => request%knots(k))
        request%number(e) = merge(k, 0_i4, n == size(stretch, 3))
        if (request%number(e) > 0) then
          if (are_alike(reshape(request%stretch(:, last + 1:last + n), [3, 3, n]), stretch)) return
        end if
        last = last + n
      end associate
    end do
    request%knots = [request%knots, size(stretch, 3, kind=i4)]
    request%element = [request%element, e]
    request%stretch = reshape([request%stretch, stretch], [9, size(request%stretch, 2) &
                                                           + size(stretch, 3)])
    request%number(e) = size(request%knots)
  end subroutine add_history

  !> Has an element been strained so much that the tile is another one there?
  pure logical function is_strained(self, e)
    class(histories_type), intent(in) :: self
    integer(i4), intent(in) :: e
    real(wp), allocatable :: stretch(:, :, :)
    stretch = stretches(self%element(e)%knot)
    is_strained = any(abs(stretch - spread(unit, 3, size(stretch, 3))) > still)
  end function is_strained

  !> Do two histories agree at all knots?
  pure logical function are_alike(a, b)
    real(wp), intent(in) :: a(:, :, :), b(:, :, :)
    are_alike = maxval(abs(a - b)) &
      <= max(alike, alike_part*maxval(abs(a - spread(unit, 3, size(a, 3)))))
  end function are_alike

  !> Right stretch tensors U of F = R U.
  pure function stretches(knot) result(u)
    real(wp), intent(in) :: knot(:, :, :)
    real(wp), allocatable :: u(:, :, :)
    real(wp) :: r(3, 3)
    integer(i4) :: k
    allocate (u(3, 3, size(knot, 3)))
    do k = 1, size(knot, 3)
      r = rotation_in(knot(:, :, k))
      u(:, :, k) = matmul(transpose(r), knot(:, :, k))
      u(:, :, k) = 0.5_wp*(u(:, :, k) + transpose(u(:, :, k)))
    end do
  end function stretches

  !> Rotation of a deformation gradient: the mean with the inverse of the transposed, over and over
  !! (Higham, Computing the polar decomposition with applications, 1986).
  pure function rotation_in(f) result(r)
    real(wp), intent(in) :: f(3, 3)
    real(wp) :: r(3, 3), inverse(3, 3)
    integer(i4) :: k
    r = f
    do k = 1, 30
      inverse = inverse_of(r)
      if (maxval(abs(transpose(inverse) - r)) < 1.0e-15_wp) exit
      r = 0.5_wp*(r + transpose(inverse))
    end do
  end function rotation_in

  !> Quaternion of a rotation of less than half a turn.
  pure function quaternion_of(r) result(q)
    real(wp), intent(in) :: r(3, 3)
    real(wp) :: q(4)
    q(1) = 0.5_wp*sqrt(max(1.0e-12_wp, 1.0_wp + r(1, 1) + r(2, 2) + r(3, 3)))
    q(2:) = [r(3, 2) - r(2, 3), r(1, 3) - r(3, 1), r(2, 1) - r(1, 2)]/(4.0_wp*q(1))
    q = q/norm2(q)
  end function quaternion_of

  !> Knots of all elements, one after the other.
  subroutine put_histories(self, file, errors)
    class(histories_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: knot(:, :)
    integer(i4) :: count_of(size(self%element)), e, last
    if (.not. self%active) return
    count_of = [(size(self%element(e)%knot, 3), e=1, size(count_of))]
    allocate (knot(9, sum(count_of)))
    last = 0
    do e = 1, size(count_of)
      knot(:, last + 1:last + count_of(e)) = reshape(self%element(e)%knot, [9, count_of(e)])
      last = last + count_of(e)
    end do
    call file%put('/adapt/knots', count_of, errors)
    call file%put('/adapt/deformation', knot, errors)
  end subroutine put_histories

  !> The same from a checkpoint (I404).
  subroutine get_histories(self, file, errors)
    class(histories_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: knot(:, :)
    integer(i4) :: count_of(size(self%element)), e, last
    if (.not. self%active) return
    count_of = 0
    call file%get_into('/adapt/knots', count_of, errors)
    if (errors%any()) return
    if (any(count_of < 0 .or. count_of > most)) then
      call errors%add('I404', "'"//file%path//"': /adapt/knots has other numbers than 0 to 64", &
                      file%path//':/adapt/knots', 'use an older checkpoint')
      return
    end if
    allocate (knot(9, sum(count_of)), source=0.0_wp)
    call file%get_into('/adapt/deformation', knot, errors)
    if (errors%any()) return
    if (.not. all(abs(knot) < 10.0_wp)) then
      call errors%add('I404', "'"//file%path//"': /adapt/deformation is none", &
                      file%path//':/adapt/deformation', 'use an older checkpoint')
      return
    end if
    last = 0
    do e = 1, size(count_of)
      self%element(e)%knot = reshape(knot(:, last + 1:last + count_of(e)), [3, 3, count_of(e)])
      last = last + count_of(e)
    end do
  end subroutine get_histories
end module cpl_histories
