!> How long a mesh is: the levels of a breadth-first search through its elements from one end.
!! Nodes over levels is the size of a cross-section, whatever the shape of the body.
module fem_breadth
  use talus_kinds, only: i4
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: level_count, levels_from

  !> The search: elements of every node, and what has been reached.
  type :: search_type
    integer(i4), allocatable :: first(:), element(:)  !! (nodes + 1), elements of the nodes
    integer(i4), allocatable :: level(:)              !! (nodes) 0: not reached
    logical, allocatable :: done(:)                   !! (elements)
  end type search_type

contains

  !> Levels from a node that is as far as possible from others; parts that do not hang together
  !! follow one another.
  pure integer(i4) function level_count(mesh)
    type(fem_mesh_type), intent(in) :: mesh
    type(search_type) :: search
    logical :: begun(mesh%nodes)
    integer(i4) :: n, far, last, depth
    call list_elements(mesh, search)
    begun = .false.
    level_count = 0
    do n = 1, mesh%nodes
      if (begun(n) .or. search%first(n + 1) == search%first(n)) cycle
      call sweep(mesh, [n], search, far, depth)
      begun = begun .or. search%level > 0
      call sweep(mesh, [far], search, last, depth)
      level_count = level_count + depth
    end do
  end function level_count

  !> Levels from a set of nodes, 0 for none.
  pure integer(i4) function levels_from(mesh, chosen)
    type(fem_mesh_type), intent(in) :: mesh
    logical, intent(in) :: chosen(:)  !! (nodes)
    type(search_type) :: search
    integer(i4) :: n, far
    levels_from = 0
    if (.not. any(chosen)) return
    call list_elements(mesh, search)
    call sweep(mesh, pack([(n, n=1, mesh%nodes)], chosen), search, far, levels_from)
  end function levels_from

  !> The elements of every node.
  pure subroutine list_elements(mesh, search)
    type(fem_mesh_type), intent(in) :: mesh
    type(search_type), intent(inout) :: search
    integer(i4) :: e, k, n
    integer(i4) :: next(mesh%nodes)
    allocate (search%first(mesh%nodes + 1), source=0)
    allocate (search%element(size(mesh%node)), search%level(mesh%nodes), search%done(mesh%elements))
    do k = 1, size(mesh%node)
      search%first(mesh%node(k) + 1) = search%first(mesh%node(k) + 1) + 1
    end do
    search%first(1) = 1
    do n = 1, mesh%nodes
      search%first(n + 1) = search%first(n + 1) + search%first(n)
    end do
    next = search%first(:mesh%nodes)
    do e = 1, mesh%elements
      do k = mesh%start(e), mesh%start(e + 1) - 1
        n = mesh%node(k)
        search%element(next(n)) = e
        next(n) = next(n) + 1
      end do
    end do
  end subroutine list_elements

  !> Levels of all that hangs together with some nodes; `far` is a node of the last one.
  pure subroutine sweep(mesh, seed, search, far, depth)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: seed(:)
    type(search_type), intent(inout) :: search
    integer(i4), intent(out) :: far, depth
    integer(i4) :: queue(mesh%nodes), head, tail, k, e
    search%level = 0
    search%done = .false.
    tail = int(size(seed), i4)
    queue(:tail) = seed
    search%level(seed) = 1
    head = 1
    do while (head <= tail)
      do k = search%first(queue(head)), search%first(queue(head) + 1) - 1
        e = search%element(k)
        if (search%done(e)) cycle
        search%done(e) = .true.
        call reach(mesh%node(mesh%start(e):mesh%start(e + 1) - 1), search%level(queue(head)) + 1, &
                   search%level, queue, tail)
      end do
      head = head + 1
    end do
    far = queue(tail)
    depth = search%level(far)
  end subroutine sweep

  !> Nodes that are reached for the first time.
  pure subroutine reach(node, now, level, queue, tail)
    integer(i4), intent(in) :: node(:), now
    integer(i4), intent(inout) :: level(:), queue(:), tail
    integer(i4) :: a
    do a = 1, size(node)
      if (level(node(a)) > 0) cycle
      level(node(a)) = now
      tail = tail + 1
      queue(tail) = node(a)
    end do
  end subroutine reach
end module fem_breadth
