!> The facet on which a point lies: of those whose boxes it is in.
module cpl_facet_search
  use talus_kinds, only: wp, i4
  use cpl_boxes, only: boxes_type
  use cpl_shapes, only: node_count, corner_count, shapes, shapes_at, centre_of, inside, &
    nearest_inside
  implicit none
  private
  public :: facet_search_type

  integer(i4), parameter :: most_steps = 20            !! of Newton's method
  real(wp), parameter :: settled = 1.0e-12_wp          !! last step, relative to the facet's size
  real(wp), parameter :: bulge = 0.25_wp               !! of a curved facet beyond its nodes, of its
                                                       !! size
  real(wp), parameter :: rim = 1.0e-6_wp               !! natural coordinates may pass 1 by this
  real(wp), parameter :: tie = 1.0e-9_wp               !! distances this close are equal, of the
                                                       !! size
  real(wp), parameter :: default_offset = 1.0e-3_wp    !! of the size of the facet

  !> Facets with the places of their nodes.
  type :: facet_search_type
    integer(i4), allocatable :: nodes(:)         !! of each facet, how many
    real(wp), allocatable :: node(:, :, :)       !! their places (3, most, facets) [m]
    real(wp), allocatable :: low(:, :), high(:, :)  !! around the nodes of each (3, facets) [m]
    real(wp), allocatable :: length(:)           !! of each, of its longest line [m]
    real(wp), allocatable :: limit(:)            !! how far off each a point may lie [m]
    real(wp), allocatable :: reach(:)            !! and off its box [m]
    type(boxes_type) :: boxes
  contains
    procedure :: make
    procedure :: locate
    procedure :: distance
    procedure, private :: off_box
  end type facet_search_type

contains

  !> Take facets, at least one.
  subroutine make(self, facets, x_node, max_offset)
    class(facet_search_type), intent(inout) :: self
    integer(i4), intent(in) :: facets(:, :)    !! (most, k) node ids from 1, 0 beyond
    real(wp), intent(in) :: x_node(:, :)       !! (3, nodes), all nodes of the mesh, by id [m]
    real(wp), intent(in) :: max_offset         !! [m], below 0: a share of the facet's size
    integer(i4) :: k, n, count_of

    count_of = size(facets, 2)
    allocate (self%nodes(count_of), self%length(count_of), self%limit(count_of), &
              self%reach(count_of), self%low(3, count_of), self%high(3, count_of), &
              self%node(3, size(facets, 1), count_of))
    do k = 1, count_of
      n = node_count(facets(:, k))
      self%nodes(k) = n
      self%node(:, :n, k) = x_node(:, facets(:n, k))
      self%low(:, k) = minval(self%node(:, :n, k), 2)
      self%high(:, k) = maxval(self%node(:, :n, k), 2)
      self%length(k) = facet_size(self%node(:, :n, k))
      self%limit(k) = max_offset
      if (max_offset < 0.0_wp) self%limit(k) = default_offset*self%length(k)
      self%limit(k) = self%limit(k) + rim*self%length(k)
      self%reach(k) = self%limit(k)
      if (n > corner_count(n)) self%reach(k) = self%reach(k) + bulge*self%length(k)
    end do
    call self%boxes%make(self%low - spread(self%reach, 1, 3), self%high + spread(self%reach, 1, 3))
  end subroutine make

  !> The facet nearest to a point, the lowest number among equals; 0 when none is near enough.
  subroutine locate(self, x, facet, natural)
    class(facet_search_type), intent(in) :: self
    real(wp), intent(in) :: x(3)             !! [m]
    integer(i4), intent(out) :: facet
    real(wp), intent(out) :: natural(2)
    real(wp) :: off, seen(2), best
    integer(i4) :: k, n, p, range(2)
    logical :: found

    facet = 0
    natural = 0.0_wp
    best = huge(1.0_wp)
    range = self%boxes%holding(x)
    do p = range(1), range(2)
      k = self%boxes%listed(p)
      n = self%nodes(k)
      if (self%off_box(k, x) > self%reach(k)) cycle
      call project(x, self%node(:, :n, k), self%length(k), seen, found)
      if (.not. found) cycle
      if (.not. inside(n, seen, rim)) cycle
      off = norm2(x - matmul(self%node(:, :n, k), shapes_at(n, seen)))
      if (off > self%limit(k) .or. off >= best - tie*self%length(k)) cycle
      best = off
      facet = k
      natural = seen
    end do
  end subroutine locate

  !> Distance between a point and the nearest facet [m]; beyond the reach of a facet, to its box.
  real(wp) function distance(self, x) result(nearest)
    class(facet_search_type), intent(in) :: self
    real(wp), intent(in) :: x(3)  !! [m]
    real(wp) :: seen(2)
    integer(i4) :: k, n
    logical :: found

    nearest = huge(1.0_wp)
    do k = 1, size(self%nodes)
      n = self%nodes(k)
      nearest = min(nearest, self%off_box(k, x))
      if (self%off_box(k, x) > self%reach(k)) cycle
      call project(x, self%node(:, :n, k), self%length(k), seen, found)
      if (.not. found) cycle
      seen = nearest_inside(n, seen)
      nearest = min(nearest, norm2(x - matmul(self%node(:, :n, k), shapes_at(n, seen))))
    end do
  end function distance

  !> Length of the longest line between corners [m].
  pure real(wp) function facet_size(node)
    real(wp), intent(in) :: node(:, :)
    integer(i4) :: a, b
    facet_size = 0.0_wp
    do a = 2, corner_count(size(node, 2))
      do b = 1, a - 1
        facet_size = max(facet_size, norm2(node(:, a) - node(:, b)))
      end do
    end do
  end function facet_size

  !> Distance between a point and the box around the nodes of a facet [m].
  pure real(wp) function off_box(self, k, x)
    class(facet_search_type), intent(in) :: self
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: x(3)
    off_box = norm2(max(0.0_wp, self%low(:, k) - x, x - self%high(:, k)))
  end function off_box

  !> Natural coordinates of the point of a facet nearest to x: Newton's method on r.t1 = r.t2 = 0
  !! with r = x - x(xi, eta); where that leads to no minimum, without the curvature.
  pure subroutine project(x, node, h, natural, found)
    real(wp), intent(in) :: x(3), node(:, :)
    real(wp), intent(in) :: h            !! size of the facet [m]
    real(wp), intent(out) :: natural(2)
    logical, intent(out) :: found
    real(wp), dimension(size(node, 2)) :: value
    real(wp) :: slope(2, size(node, 2)), bend(3, size(node, 2)), r(3), t(3, 2), a(3), b(2), &
      step(2), det
    integer(i4) :: k

    natural = centre_of(int(size(node, 2), i4))
    found = .false.
    do k = 1, most_steps
      call shapes(int(size(node, 2), i4), natural, value, slope, bend)
      r = x - matmul(node, value)
      t = matmul(node, transpose(slope))
      b = matmul(r, t)
      a = [dot_product(t(:, 1), t(:, 1)), dot_product(t(:, 1), t(:, 2)), &
           dot_product(t(:, 2), t(:, 2))]
      a = a - matmul(bend, matmul(r, node))
      det = a(1)*a(3) - a(2)**2
      if (.not. (det > tiny(1.0_wp) .and. a(1) > 0.0_wp)) then
        a = a + matmul(bend, matmul(r, node))
        det = a(1)*a(3) - a(2)**2
      end if
      if (.not. det > tiny(1.0_wp)) return
      step = [a(3)*b(1) - a(2)*b(2), a(1)*b(2) - a(2)*b(1)]/det
      natural = natural + step
      if (any(abs(natural) > 1.0e3_wp)) return
      found = norm2(matmul(t, step)) < settled*h
      if (found) return
    end do
  end subroutine project
end module cpl_facet_search
