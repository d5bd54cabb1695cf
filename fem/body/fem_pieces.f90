!> Pieces of a mesh, one a rank: its elements with their nodes, its shares of the groups, and the
!! nodes that it shares with other ranks. Nodes and elements keep their order, so that sums over
!! them do. For bodies whose only field is the displacement: blocks are nodes.
module fem_pieces
  use talus_kinds, only: i4
  use fem_dofs, only: fem_dofs_type
  use fem_halo, only: fem_halo_type
  use fem_partition, only: rank_of, blocks_of_part
  use fem_sparse, only: elements_of_blocks
  use fem_types, only: fem_mesh_type, fem_group_type, group_facet
  implicit none
  private
  public :: fem_piece_type, fem_holders_type, find_holders, make_piece

  type :: fem_piece_type
    type(fem_mesh_type) :: mesh
    type(fem_halo_type) :: halo
    integer(i4), allocatable :: element(:)  !! ids of its elements in the whole mesh, ascending
  end type fem_piece_type

  !> Ranks of the facets of a group.
  type :: facet_ranks_type
    integer(i4), allocatable :: rank(:)
  end type facet_ranks_type

  !> Who has which nodes and facets of the whole mesh.
  type :: fem_holders_type
    integer(i4), allocatable :: part(:)            !! (elements) rank of each
    integer(i4), allocatable :: first(:), rank(:)  !! ranks of node n, ascending: the owner is first
    integer(i4), allocatable :: first_own(:)       !! (0:ranks) of those of each owner
    type(facet_ranks_type), allocatable :: facet(:)  !! (groups)
  end type fem_holders_type

contains

  !> The holders of all nodes and facets for the ranks of the elements.
  subroutine find_holders(mesh, dofs, part, ranks, holders)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:), ranks
    type(fem_holders_type), intent(out) :: holders
    integer(i4), allocatable :: next(:)
    logical, allocatable :: there(:)
    integer(i4) :: r, n, pass

    holders%part = part
    allocate (holders%first(mesh%nodes + 1), next(mesh%nodes), there(mesh%nodes))
    allocate (holders%first_own(0:ranks), source=0)
    next = 0
    do pass = 1, 2
      do r = 0, ranks - 1
        call blocks_of_part(dofs, part, r, there)
        do n = 1, mesh%nodes
          if (.not. there(n)) cycle
          if (pass == 2) holders%rank(next(n)) = r
          next(n) = next(n) + 1
        end do
      end do
      if (pass == 2) exit
      holders%first(1) = 1
      do n = 1, mesh%nodes
        holders%first(n + 1) = holders%first(n) + next(n)
        next(n) = holders%first(n)
      end do
      allocate (holders%rank(holders%first(mesh%nodes + 1) - 1))
    end do
    do n = 1, mesh%nodes
      r = holders%rank(holders%first(n)) + 1
      holders%first_own(r) = holders%first_own(r) + 1
    end do
    holders%first_own(0) = 1
    do r = 1, ranks
      holders%first_own(r) = holders%first_own(r) + holders%first_own(r - 1)
    end do
    call find_facets(mesh, dofs, part, holders)
  end subroutine find_holders

  !> A facet belongs to the rank of its element: that of the file, or the first with all its nodes.
  subroutine find_facets(mesh, dofs, part, holders)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:)
    type(fem_holders_type), intent(inout) :: holders
    integer(i4), allocatable :: first(:), list(:)
    integer(i4) :: g, f
    allocate (holders%facet(size(mesh%group)))
    if (.not. any(mesh%group%kind == group_facet)) return
    call elements_of_blocks(dofs, first, list)
    do g = 1, size(mesh%group)
      if (mesh%group(g)%kind /= group_facet) cycle
      associate (facet => mesh%group(g)%facet)
        holders%facet(g)%rank = [(rank_of(dofs, part, first, list, &
          pack(facet(:, f), facet(:, f) > 0)), f=1, size(facet, 2))]
      end associate
      if (.not. allocated(mesh%group(g)%element)) cycle
      do f = 1, size(mesh%group(g)%element)
        if (mesh%group(g)%element(f) > 0) holders%facet(g)%rank(f) = part(mesh%group(g)%element(f))
      end do
    end do
  end subroutine find_facets

  !> The piece of rank r.
  subroutine make_piece(mesh, holders, r, piece)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_holders_type), intent(in) :: holders
    integer(i4), intent(in) :: r
    type(fem_piece_type), intent(out) :: piece
    integer(i4), allocatable :: new_node(:), new_element(:)
    integer(i4) :: e, n, k, m

    piece%element = pack([(e, e=1, mesh%elements)], holders%part == r)
    allocate (new_node(0:mesh%nodes), new_element(0:mesh%elements), source=0)
    do k = 1, size(piece%element)
      new_element(piece%element(k)) = k
    end do
    do n = 1, mesh%nodes
      if (any(holders%rank(holders%first(n):holders%first(n + 1) - 1) == r)) new_node(n) = 1
    end do
    piece%mesh%number = pack([(n, n=1, mesh%nodes)], new_node(1:) > 0)
    do k = 1, size(piece%mesh%number)
      new_node(piece%mesh%number(k)) = k
    end do
    associate (own => piece%mesh)
      own%all_nodes = mesh%nodes
      own%nodes = size(own%number)
      own%elements = size(piece%element)
      own%x = mesh%x(:, own%number)
      own%kind = mesh%kind(piece%element)
      allocate (own%start(own%elements + 1))
      own%start(1) = 1
      do k = 1, own%elements
        e = piece%element(k)
        own%start(k + 1) = own%start(k) + mesh%start(e + 1) - mesh%start(e)
      end do
      allocate (own%node(own%start(own%elements + 1) - 1))
      do k = 1, own%elements
        e = piece%element(k)
        m = own%start(k)
        own%node(m:own%start(k + 1) - 1) = new_node(mesh%node(mesh%start(e):mesh%start(e + 1) - 1))
      end do
      allocate (own%group(size(mesh%group)))
      do k = 1, size(mesh%group)
        call keep_group(mesh%group(k), holders%facet(k), r, new_node, new_element, own%group(k))
      end do
    end associate
    call make_dealt_halo(holders, r, piece%mesh%number, new_node, piece%halo)
  end subroutine make_piece

  !> The share of a group.
  pure subroutine keep_group(whole, facets, r, new_node, new_element, group)
    type(fem_group_type), intent(in) :: whole
    type(facet_ranks_type), intent(in) :: facets
    integer(i4), intent(in) :: r, new_node(0:), new_element(0:)
    type(fem_group_type), intent(out) :: group
    integer(i4), allocatable :: chosen(:)
    integer(i4) :: f
    group%name = whole%name
    group%kind = whole%kind
    group%empty = whole%empty
    group%node = pack(new_node(whole%node), new_node(whole%node) > 0)
    if (whole%kind /= group_facet) then
      if (allocated(whole%element)) &
        group%element = pack(new_element(whole%element), new_element(whole%element) > 0)
      return
    end if
    chosen = pack([(f, f=1, size(whole%facet, 2))], facets%rank == r)
    allocate (group%facet(size(whole%facet, 1), size(chosen)))
    do f = 1, size(chosen)
      group%facet(:, f) = new_node(whole%facet(:, chosen(f)))
    end do
    group%facet_kind = whole%facet_kind(chosen)
    if (allocated(whole%element)) group%element = new_element(whole%element(chosen))
  end subroutine keep_group

  !> The nodes of rank r that others have, and who owns each. Ranks know each other's by the
  !! order: it is that of the whole mesh.
  pure subroutine make_dealt_halo(holders, r, number, new_node, halo)
    type(fem_holders_type), intent(in) :: holders
    integer(i4), intent(in) :: r, number(:), new_node(0:)
    type(fem_halo_type), intent(inout) :: halo
    integer(i4), allocatable :: counts(:)
    integer(i4) :: ranks, pass, i, k, s
    halo%dealt = .true.
    ranks = int(size(holders%first_own) - 1, i4)
    halo%first_own = holders%first_own
    halo%owner = holders%rank(holders%first(number))
    halo%mine = halo%owner == r
    halo%own = pack(new_node(number), halo%mine)
    halo%common = pack(new_node(number), holders%first(number + 1) > holders%first(number) + 1)
    allocate (counts(0:ranks))
    allocate (halo%first(0:ranks))
    do pass = 1, 2
      counts = 0
      do i = 1, size(halo%common)
        do k = holders%first(number(halo%common(i))), holders%first(number(halo%common(i)) + 1) - 1
          s = holders%rank(k)
          if (s == r) cycle
          if (pass == 2) halo%shared(halo%first(s) + counts(s)) = halo%common(i)
          counts(s) = counts(s) + 1
        end do
      end do
      if (pass == 2) exit
      halo%first(0) = 1
      do s = 0, ranks - 1
        halo%first(s + 1) = halo%first(s) + counts(s)
      end do
      allocate (halo%shared(halo%first(ranks) - 1))
    end do
  end subroutine make_dealt_halo
end module fem_pieces
