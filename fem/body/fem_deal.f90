!> The mesh dealt out to the ranks in pieces: the leader reads it and the deck, checks them and
!! sends each rank the elements, nodes and groups that are its own. Nobody else has the whole, and
!! the leader keeps of it what results are written with. Which decks are dealt out so is decided
!! here alone; in others every rank has all nodes (fem_distribute).
module fem_deal
  use talus_kinds, only: i4
  use talus_deck, only: deck_type
  use talus_ranks, only: ranks_type
  use fem_body, only: fem_body_type
  use fem_distribute, only: list_laws
  use fem_elastic, only: classical
  use fem_partition, only: part_elements
  use fem_pieces, only: fem_piece_type, fem_holders_type, find_holders, make_piece
  use fem_types, only: fem_mesh_type, fem_group_type, group_facet, name_length
  use fem_whole, only: fem_whole_type
  implicit none
  private
  public :: may_be_dealt, is_dealt, deal_out, take_piece

contains

  !> Can the nodes be dealt out, as far as the deck tells? Analyses that solve by factors, groups
  !! that move as one and forces that are found by searching all facets need all nodes.
  logical function may_be_dealt(deck, served)
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served  !! a partner drives the run
    character(len=*), parameter :: groups(5) = [character(len=12) :: 'rigid', 'stage', 'pore', &
      'micromorphic', 'water_table']
    character(len=:), allocatable :: kind, continuation, solver
    integer(i4) :: k
    call deck%get('analysis', 1, 'kind', kind)
    call deck%get('analysis', 1, 'continuation', continuation)
    call deck%get('analysis', 1, 'solver', solver)
    if (kind == 'explicit') then  ! factors find the equilibrium under an initial stress
      may_be_dealt = deck%count('initial_stress') + deck%count('geostatic') == 0
    else
      may_be_dealt = kind == 'static' .and. continuation == 'load' .and. solver /= 'direct'
    end if
    may_be_dealt = may_be_dealt .and. .not. served
    do k = 1, size(groups)
      may_be_dealt = may_be_dealt .and. deck%count(trim(groups(k))) == 0
    end do
    do k = 1, deck%count('point_load')
      may_be_dealt = may_be_dealt .and. .not. deck%given('point_load', k, 'position')
    end do
  end function may_be_dealt

  !> Are they, once the leader has read the whole body? There must be an element for each rank.
  logical function is_dealt(body, ranks)
    type(fem_body_type), intent(in) :: body
    type(ranks_type), intent(in) :: ranks
    is_dealt = body%elastic%components == classical .and. body%dofs%blocks == body%mesh%nodes &
      .and. (body%scheme%explicit .or. body%system%solver%iterative) &
      .and. .not. allocated(body%loads%follower) &
      .and. body%mesh%elements >= ranks%ranks
  end function is_dealt

  !> The leader's part: its own piece, what it keeps of the whole, and those of the others sent.
  subroutine deal_out(body, ranks, whole, piece)
    type(fem_body_type), intent(inout) :: body
    type(ranks_type), intent(in) :: ranks
    type(fem_whole_type), intent(out) :: whole
    type(fem_piece_type), intent(out) :: piece
    type(fem_holders_type) :: holders
    integer(i4), allocatable :: part(:), next(:)
    integer(i4) :: r, n, m

    call body%drop_state()
    call part_elements(body%mesh, body%elastic, ranks%ranks, part)
    call find_holders(body%mesh, body%dofs, part, ranks%ranks, holders)
    call count_whole(body, whole)
    do r = 1, ranks%ranks - 1
      call make_piece(body%mesh, holders, r, piece)
      call ranks%give_numbers(r, [whole%all_elements, whole%all_points])
      call ranks%give_numbers(r, whole%laws)
      call give_piece(ranks, r, piece)
    end do
    call make_piece(body%mesh, holders, 0_i4, piece)
    piece%halo%ranks_type = ranks
    whole%ranks = ranks
    allocate (next(0:ranks%ranks), source=holders%first_own)
    allocate (whole%block_of(body%mesh%nodes))
    do n = 1, body%mesh%nodes
      m = holders%rank(holders%first(n))
      whole%block_of(next(m)) = n
      next(m) = next(m) + 1
    end do
    call move_alloc(holders%part, whole%part)
    call move_alloc(body%elastic%point, whole%point)
    whole%mesh%nodes = body%mesh%nodes
    whole%mesh%elements = body%mesh%elements
    call move_alloc(body%mesh%x, whole%mesh%x)
    call move_alloc(body%mesh%kind, whole%mesh%kind)
    call move_alloc(body%mesh%start, whole%mesh%start)
    call move_alloc(body%mesh%node, whole%mesh%node)
  end subroutine deal_out

  !> Elements, points and laws of the whole body.
  subroutine count_whole(body, whole)
    type(fem_body_type), intent(in) :: body
    type(fem_whole_type), intent(inout) :: whole
    whole%dealt = .true.
    whole%all_elements = body%mesh%elements
    whole%all_points = body%elastic%points
    call list_laws(body%matter%law_of, whole%laws)
  end subroutine count_whole

  !> The part of the other ranks.
  subroutine take_piece(ranks, whole, piece)
    type(ranks_type), intent(in) :: ranks
    type(fem_whole_type), intent(out) :: whole
    type(fem_piece_type), intent(out) :: piece
    integer(i4), allocatable :: numbers(:)
    integer(i4) :: g
    whole%ranks = ranks
    whole%dealt = .true.
    call ranks%take_numbers(0_i4, numbers)
    whole%all_elements = numbers(1)
    whole%all_points = numbers(2)
    call ranks%take_numbers(0_i4, whole%laws)
    call ranks%take_numbers(0_i4, numbers)
    associate (mesh => piece%mesh)
      mesh%all_nodes = numbers(1)
      allocate (mesh%group(numbers(2)))
      call ranks%take_numbers(0_i4, piece%element)
      call ranks%take_numbers(0_i4, mesh%number)
      call ranks%take_numbers(0_i4, mesh%kind)
      call ranks%take_numbers(0_i4, mesh%start)
      call ranks%take_numbers(0_i4, mesh%node)
      mesh%nodes = size(mesh%number)
      mesh%elements = size(piece%element)
      allocate (mesh%x(3, mesh%nodes))
      call ranks%take_values(0_i4, mesh%x)
      do g = 1, size(mesh%group)
        call take_group(ranks, mesh%group(g))
      end do
    end associate
    call take_halo(ranks, piece)
  end subroutine take_piece

  !> Send a piece to rank r.
  subroutine give_piece(ranks, r, piece)
    type(ranks_type), intent(in) :: ranks
    integer(i4), intent(in) :: r
    type(fem_piece_type), intent(in) :: piece
    integer(i4) :: g
    associate (mesh => piece%mesh, halo => piece%halo)
      call ranks%give_numbers(r, [mesh%all_nodes, int(size(mesh%group), i4)])
      call ranks%give_numbers(r, piece%element)
      call ranks%give_numbers(r, mesh%number)
      call ranks%give_numbers(r, mesh%kind)
      call ranks%give_numbers(r, mesh%start)
      call ranks%give_numbers(r, mesh%node)
      call ranks%give_values(r, mesh%x)
      do g = 1, size(mesh%group)
        call give_group(ranks, r, mesh%group(g))
      end do
      call ranks%give_numbers(r, halo%first)
      call ranks%give_numbers(r, halo%shared)
      call ranks%give_numbers(r, halo%common)
      call ranks%give_numbers(r, halo%owner)
      call ranks%give_numbers(r, halo%first_own)
    end associate
  end subroutine give_piece

  subroutine take_halo(ranks, piece)
    type(ranks_type), intent(in) :: ranks
    type(fem_piece_type), intent(inout) :: piece
    integer(i4), allocatable :: numbers(:)
    integer(i4) :: n
    associate (halo => piece%halo)
      halo%ranks_type = ranks
      halo%dealt = .true.
      call ranks%take_numbers(0_i4, numbers)
      allocate (halo%first(0:ranks%ranks), source=numbers)
      call ranks%take_numbers(0_i4, halo%shared)
      call ranks%take_numbers(0_i4, halo%common)
      call ranks%take_numbers(0_i4, halo%owner)
      call ranks%take_numbers(0_i4, numbers)
      allocate (halo%first_own(0:ranks%ranks), source=numbers)
      halo%mine = halo%owner == ranks%rank
      halo%own = pack([(n, n=1, size(halo%mine))], halo%mine)
    end associate
  end subroutine take_halo

  !> Send a group, its name letter by letter.
  subroutine give_group(ranks, r, group)
    type(ranks_type), intent(in) :: ranks
    integer(i4), intent(in) :: r
    type(fem_group_type), intent(in) :: group
    integer(i4) :: k
    call ranks%give_numbers(r, [(iachar(group%name(k:k)), k=1, name_length)])
    call ranks%give_numbers(r, [group%kind, merge(1_i4, 0_i4, group%empty), &
                                merge(1_i4, 0_i4, allocated(group%element))])
    call ranks%give_numbers(r, group%node)
    if (allocated(group%element)) call ranks%give_numbers(r, group%element)
    if (group%kind /= group_facet) return
    call ranks%give_numbers(r, group%facet_kind)
    call ranks%give_numbers(r, [int(size(group%facet, 1), i4), &
                                reshape(group%facet, [size(group%facet)])])
  end subroutine give_group

  subroutine take_group(ranks, group)
    type(ranks_type), intent(in) :: ranks
    type(fem_group_type), intent(inout) :: group
    integer(i4), allocatable :: numbers(:)
    integer(i4) :: k
    call ranks%take_numbers(0_i4, numbers)
    do k = 1, name_length
      group%name(k:k) = achar(numbers(k))
    end do
    call ranks%take_numbers(0_i4, numbers)
    group%kind = numbers(1)
    group%empty = numbers(2) > 0
    call ranks%take_numbers(0_i4, group%node)
    if (numbers(3) > 0) call ranks%take_numbers(0_i4, group%element)
    if (group%kind /= group_facet) return
    call ranks%take_numbers(0_i4, group%facet_kind)
    call ranks%take_numbers(0_i4, numbers)
    group%facet = reshape(numbers(2:), [numbers(1), int(size(group%facet_kind), i4)])
  end subroutine take_group
end module fem_deal
