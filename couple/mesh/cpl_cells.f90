!> The solid's mesh of volume elements as the overlap sees it, and in which element a point lies.
module cpl_cells
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use cpl_boxes, only: boxes_type
  use cpl_elements, only: is_known, node_count, corner_count, corner_kind, shapes, locate, inside, &
    most_nodes
  implicit none
  private
  public :: cells_type, spot_type

  real(wp), parameter, public :: edge_slack = 1.0e-9_wp  !! of natural coordinates, on a face

  !> Elements, and boxes of space that list the elements in them.
  type :: cells_type
    integer(i4) :: nodes = 0, elements = 0
    real(wp), allocatable :: x(:, :)          !! (3, nodes) [m]
    integer(i4), allocatable :: kind(:)       !! (elements)
    integer(i4), allocatable :: start(:)      !! (elements + 1)
    integer(i4), allocatable :: node(:)       !! of element e: start(e) .. start(e+1)-1
    real(wp), allocatable :: mass(:)          !! lumped, of the nodes [kg]
    real(wp), allocatable :: inertia(:)       !! lumped micro-inertia, 0 where none [kg m^2]
    logical, allocatable :: polar(:)          !! the node has a micro-rotation, or a
    logical :: micromorphic = .false.         !! micro-deformation
    real(wp), allocatable :: low(:, :), high(:, :)  !! boxes around the elements (3, elements) [m]
    type(boxes_type) :: boxes                       !! of space
  contains
    procedure :: check
    procedure :: prepare
    procedure :: place
    procedure :: find
    procedure :: find_beside
    procedure :: nodes_of
    procedure :: volume
    procedure :: shares
  end type cells_type

  !> A point in an element: functions of u, of phi, and gradients of those of u.
  type :: spot_type
    integer(i4) :: element = 0            !! 0: in none
    integer(i4) :: n = 0                  !! nodes
    integer(i4) :: n_phi = 0              !! of these (the first), with micro-rotation; 0 none
    real(wp) :: weight(most_nodes) = 0.0_wp
    real(wp) :: weight_phi(most_nodes) = 0.0_wp
    real(wp) :: gradient(3, most_nodes) = 0.0_wp  !! [1/m]
  end type spot_type

contains

  !> P413 what cannot be; I427 elements of other kinds than the overlap knows.
  subroutine check(self, errors)
    class(cells_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: place = 'the solid''s reply to DESCRIBE'
    integer(i4) :: e
    if (.not. all(is_finite(self%x))) then
      call errors%add('P413', 'the position of a node is no number', place, 'make the mesh again')
    else if (any(self%node < 1) .or. any(self%node > self%nodes) .or. &
             size(self%start) /= self%elements + 1) then
      call errors%add('P413', 'elements name nodes that do not exist', place, 'make the mesh again')
    end if
    if (errors%any()) return
    do e = 1, self%elements
      if (is_known(self%kind(e))) cycle
      call errors%add('I427', 'element '//str(e)//' is of kind '//str(self%kind(e))// &
                      ', which the overlap does not know', place, &
                      'it knows hex8, hex20, tet4 and tet10')
      return
    end do
  end subroutine check

  !> The same elements with their nodes elsewhere.
  subroutine place(self, x, placed)
    class(cells_type), intent(in) :: self
    real(wp), intent(in) :: x(:, :)  !! (3, nodes) [m]
    type(cells_type), intent(out) :: placed
    placed%nodes = self%nodes
    placed%elements = self%elements
    placed%x = x
    placed%kind = self%kind
    placed%start = self%start
    placed%node = self%node
    placed%polar = self%polar
    call placed%prepare()
  end subroutine place

  !> Boxes around the elements, and boxes of space.
  subroutine prepare(self)
    class(cells_type), intent(inout) :: self
    real(wp) :: slack(3)
    integer(i4) :: e

    allocate (self%low(3, self%elements), self%high(3, self%elements))
    do e = 1, self%elements
      associate (x => self%x(:, self%node(self%start(e):self%start(e + 1) - 1)))
        slack = 1.0e-6_wp*(maxval(x, 2) - minval(x, 2))
        self%low(:, e) = minval(x, 2) - slack
        self%high(:, e) = maxval(x, 2) + slack
      end associate
    end do
    call self%boxes%make(self%low, self%high)
  end subroutine prepare

  !> The element a point lies in: of several (on a face) the one with the highest rank, then the
  !! lowest number.
  subroutine find(self, x, rank, spot)
    class(cells_type), intent(in) :: self
    real(wp), intent(in) :: x(3)        !! [m]
    integer(i4), intent(in) :: rank(:)  !! of the elements
    type(spot_type), intent(out) :: spot
    real(wp) :: xi(3), n(most_nodes), gradient(3, most_nodes)
    integer(i4) :: e, k, range(2)
    logical :: found

    range = self%boxes%holding(x)
    do k = range(1), range(2)
      e = self%boxes%listed(k)
      if (any(x < self%low(:, e)) .or. any(x > self%high(:, e))) cycle
      if (spot%element > 0) then
        if (rank(e) <= rank(spot%element)) cycle
      end if
      call locate(self%kind(e), self%x(:, self%node(self%start(e):self%start(e + 1) - 1)), x, &
                  xi, n, gradient, found)
      if (.not. found) cycle
      if (.not. inside(self%kind(e), xi, edge_slack)) cycle
      spot%element = e
      spot%n = node_count(self%kind(e))
      spot%weight(:spot%n) = n(:spot%n)
      spot%gradient(:, :spot%n) = gradient(:, :spot%n)
      call find_rotation(self, xi, spot)
    end do
  end subroutine find

  !> The first of some elements that a point lies in, or so near beside it.
  subroutine find_beside(self, x, wanted, slack, spot)
    class(cells_type), intent(in) :: self
    real(wp), intent(in) :: x(3)           !! [m]
    logical, intent(in) :: wanted(:)       !! (elements)
    real(wp), intent(in) :: slack          !! of natural coordinates
    type(spot_type), intent(out) :: spot
    real(wp) :: xi(3), n(most_nodes), gradient(3, most_nodes), reach(3)
    integer(i4) :: e
    logical :: found
    do e = 1, self%elements
      if (.not. wanted(e)) cycle
      reach = slack*(self%high(:, e) - self%low(:, e))
      if (any(x < self%low(:, e) - reach) .or. any(x > self%high(:, e) + reach)) cycle
      call locate(self%kind(e), self%x(:, self%node(self%start(e):self%start(e + 1) - 1)), x, &
                  xi, n, gradient, found)
      if (.not. found) cycle
      if (.not. inside(self%kind(e), xi, slack)) cycle
      spot%element = e
      spot%n = node_count(self%kind(e))
      spot%weight(:spot%n) = n(:spot%n)
      spot%gradient(:, :spot%n) = gradient(:, :spot%n)
      call find_rotation(self, xi, spot)
      return
    end do
  end subroutine find_beside

  !> Functions of the micro-rotation: all nodes have one, or the corners alone.
  subroutine find_rotation(self, xi, spot)
    type(cells_type), intent(in) :: self
    real(wp), intent(in) :: xi(3)
    type(spot_type), intent(inout) :: spot
    real(wp) :: dn(3, most_nodes)
    integer(i4) :: corners, e
    e = spot%element
    corners = corner_count(self%kind(e))
    associate (polar => self%polar(self%node(self%start(e):self%start(e + 1) - 1)))
      spot%n_phi = 0
      if (.not. all(polar(:corners))) return
      if (all(polar)) then
        spot%n_phi = spot%n
        spot%weight_phi = spot%weight
      else
        spot%n_phi = corners
        call shapes(corner_kind(self%kind(e)), xi, spot%weight_phi, dn)
      end if
    end associate
  end subroutine find_rotation

  pure function nodes_of(self, e) result(node)
    class(cells_type), intent(in) :: self
    integer(i4), intent(in) :: e
    integer(i4) :: node(self%start(e + 1) - self%start(e))
    node = self%node(self%start(e):self%start(e + 1) - 1)
  end function nodes_of

  !> Volume of an element [m^3].
  pure real(wp) function volume(self, e)
    class(cells_type), intent(in) :: self
    integer(i4), intent(in) :: e
    real(wp) :: share(most_nodes)
    call shares(self, e, share)
    volume = sum(share(:node_count(self%kind(e))))
  end function volume

  !> Integrals of the corner functions (0 at other nodes) over an element [m^3].
  pure subroutine shares(self, e, share)
    class(cells_type), intent(in) :: self
    integer(i4), intent(in) :: e
    real(wp), intent(out) :: share(:)
    real(wp), parameter :: g = 0.577350269189625764509_wp, t = 0.138196601125010515180_wp
    real(wp) :: n(most_nodes), dn(3, most_nodes), j(3, 3), xi(3), weight
    integer(i4) :: q, points, c, kind

    kind = corner_kind(self%kind(e))
    c = corner_count(kind)
    points = merge(8, 4, c == 8)
    share = 0.0_wp
    associate (x => self%x(:, self%node(self%start(e):self%start(e) + c - 1)))
      do q = 0, points - 1
        if (c == 8) then
          xi = g*[2*mod(q, 2) - 1, 2*mod(q/2, 2) - 1, 2*mod(q/4, 2) - 1]
          weight = 1.0_wp
        else
          xi = t
          if (q > 0) xi(q) = 1.0_wp - 3.0_wp*t
          weight = 1.0_wp/24.0_wp
        end if
        call shapes(kind, xi, n, dn)
        j = matmul(x, transpose(dn(:, :c)))
        weight = weight*abs(j(1, 1)*(j(2, 2)*j(3, 3) - j(2, 3)*j(3, 2)) &
                            - j(1, 2)*(j(2, 1)*j(3, 3) - j(2, 3)*j(3, 1)) &
                            + j(1, 3)*(j(2, 1)*j(3, 2) - j(2, 2)*j(3, 1)))
        share(:c) = share(:c) + weight*n(:c)
      end do
    end associate
  end subroutine shares
end module cpl_cells
