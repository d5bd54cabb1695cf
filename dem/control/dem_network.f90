!> Minimum cut of a network with whole capacities, by the largest flow (Dinic 1970): shortest ways
!! from the source to the sink are filled until none is left.
module dem_network
  use talus_kinds, only: i4, i8
  implicit none
  private
  public :: network_type, source, sink

  integer(i4), parameter :: source = 1, sink = 2  !! nodes
  integer(i4), parameter :: none = 0

  type :: network_type
    integer(i4) :: edges = 0
    integer(i4), allocatable :: last(:)   !! (nodes) the last edge that leaves each
    integer(i4), allocatable :: before(:)  !! (edges) the one before it of the same node
    integer(i4), allocatable :: to(:)     !! (edges); those of a pair lead to and fro
    integer(i8), allocatable :: room(:)   !! (edges)
  contains
    procedure :: begin
    procedure :: add
    procedure :: cut
    procedure, private :: find_levels
    procedure, private :: fill_one
  end type network_type

contains

  !> So many nodes, and room for so many edges.
  pure subroutine begin(self, nodes, edges)
    class(network_type), intent(inout) :: self
    integer(i4), intent(in) :: nodes, edges
    self%edges = 0
    self%last = spread(none, 1, nodes)
    self%before = spread(none, 1, 2*edges)
    self%to = self%before
    self%room = int(self%before, i8)
  end subroutine begin

  pure subroutine add(self, from, to, room)
    class(network_type), intent(inout) :: self
    integer(i4), intent(in) :: from, to
    integer(i8), intent(in) :: room
    associate (k => self%edges)
      self%to(k + 1:k + 2) = [to, from]
      self%room(k + 1:k + 2) = [room, 0_i8]
      self%before(k + 1) = self%last(from)
      self%last(from) = k + 1
      self%before(k + 2) = self%last(to)
      self%last(to) = k + 2
      k = k + 2
    end associate
  end subroutine add

  !> The edge back of an edge.
  pure integer(i4) function back(k)
    integer(i4), intent(in) :: k
    back = merge(k + 1, k - 1, mod(k, 2) == 1)
  end function back

  !> Which nodes are on the side of the source.
  pure subroutine cut(self, side)
    class(network_type), intent(inout) :: self
    logical, allocatable, intent(out) :: side(:)
    integer(i4) :: level(size(self%last)), next(size(self%last))
    logical :: filled
    do
      call self%find_levels(level)
      if (level(sink) < 0) exit
      next = self%last
      filled = .true.
      do while (filled)
        call self%fill_one(level, next, filled)
      end do
    end do
    side = level >= 0
  end subroutine cut

  !> Edges with room from the source to each node, -1: none lead there.
  pure subroutine find_levels(self, level)
    class(network_type), intent(in) :: self
    integer(i4), intent(out) :: level(:)
    integer(i4) :: queue(size(level)), head, tail, k
    level = -1
    level(source) = 0
    queue(1) = source
    head = 1
    tail = 1
    do while (head <= tail)
      k = self%last(queue(head))
      do while (k /= none)
        if (self%room(k) > 0 .and. level(self%to(k)) < 0) then
          level(self%to(k)) = level(queue(head)) + 1
          tail = tail + 1
          queue(tail) = self%to(k)
        end if
        k = self%before(k)
      end do
      head = head + 1
    end do
  end subroutine find_levels

  !> Fill one shortest way, if there is one; `next` are edges that may still lead on.
  pure subroutine fill_one(self, level, next, filled)
    class(network_type), intent(inout) :: self
    integer(i4), intent(in) :: level(:)
    integer(i4), intent(inout) :: next(:)
    logical, intent(out) :: filled
    integer(i4) :: way(size(level)), node, n, k
    integer(i8) :: least
    filled = .false.
    node = source
    n = 0
    do while (node /= sink)
      k = next(node)
      if (k == none) then
        if (n == 0) return
        node = self%to(back(way(n)))
        next(node) = self%before(way(n))
        n = n - 1
      else if (self%room(k) > 0 .and. level(self%to(k)) == level(node) + 1) then
        n = n + 1
        way(n) = k
        node = self%to(k)
      else
        next(node) = self%before(k)
      end if
    end do
    least = minval(self%room(way(:n)))
    self%room(way(:n)) = self%room(way(:n)) - least
    do k = 1, n
      self%room(back(way(k))) = self%room(back(way(k))) + least
    end do
    filled = .true.
  end subroutine fill_one
end module dem_network
