!> Parts of a mesh for ranks: none is empty, all blocks have one owner, neighbours agree on what
!! they share; one process acts for all ranks.
program test_fem_partition
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_dofs, only: fem_dofs_type, number_fields
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: hex8, quad4
  use fem_partition, only: part_elements, make_halo
  use fem_pieces, only: fem_piece_type, fem_holders_type, find_holders, make_piece
  use fem_halo, only: fem_halo_type
  use fem_sparse, only: fem_pattern_type, make_pattern, holders_of
  use fem_topology, only: set_elements
  use fem_types, only: fem_mesh_type, fem_springs_type, group_node, group_facet
  implicit none
  type(test_type) :: test

  call parts(4, 3)
  call parts(4, 7)
  call parts(2, 8)
  call places()
  call springs_of_one()
  call test%finish()

contains

  !> Numbers in the mesh become those of this rank, 0 where another has the element.
  subroutine places()
    type(fem_elastic_type) :: elastic
    integer(i4) :: n
    call test%check('one rank', all([(elastic%place_of(n), n=1, 4)] == [1, 2, 3, 4]))
    elastic%id = [2, 5, 6, 9]
    call test%check('some of ten', all([(elastic%place_of(n), n=1, 10)] == &
                                       [0, 1, 0, 0, 2, 3, 0, 0, 4, 0]))
    elastic%id = [7]
    call test%check('one of ten', all([(elastic%place_of(n), n=6, 8)] == [0, 1, 0]))
  end subroutine places

  !> Springs are held by who has an element with all of their nodes.
  subroutine springs_of_one()
    type(fem_mesh_type) :: mesh
    type(fem_dofs_type) :: dofs
    type(fem_pattern_type) :: pattern
    type(fem_springs_type) :: springs
    integer(i4) :: holder(4)
    call make_cube(2, mesh)
    call number_fields(mesh, spread(0_i4, 1, mesh%elements), dofs)
    call make_pattern(dofs, pattern)
    springs%n = 4
    springs%node = reshape([1, 2, 4, 1, 3, 3, 28, 1, 5, 5, 5, 5], [3, 4])
    call holders_of(pattern, springs, holder)
    call test%check('neighbours, apart, no node, one', all(holder == [0, -1, -1, 0]))
  end subroutine springs_of_one

  !> A cube of n^3 elements for some ranks.
  subroutine parts(n, ranks)
    integer(i4), intent(in) :: n, ranks
    type(fem_mesh_type) :: mesh
    type(fem_dofs_type) :: dofs
    type(fem_elastic_type) :: elastic
    type(fem_halo_type), allocatable :: halo(:)
    integer(i4), allocatable :: part(:)
    integer(i4) :: r, rule, owners(((n + 1)**3))

    call make_cube(n, mesh)
    call elastic%start(mesh%elements)
    call elastic%use_rule('hex8/hex8', rule)
    elastic%rule_of = rule
    call elastic%number_points()
    call number_fields(mesh, elastic%rotations(), dofs)
    call part_elements(mesh, elastic, ranks, part)
    do r = 0, ranks - 1
      call test%check('a part of the work', count(part == r) >= 1 .and. &
                      count(part == r) <= 2*n**3/ranks)
    end do
    allocate (halo(0:ranks - 1))
    owners = 0
    do r = 0, ranks - 1
      halo(r)%ranks = ranks
      halo(r)%rank = r
      call make_halo(dofs, part, halo(r))
      owners = owners + merge(1, 0, halo(r)%mine(:mesh%nodes))
      call test%check('all blocks', size(halo(r)%own) == dofs%blocks)
      call test%check('the owner knows it', all(halo(r)%owns( &
        halo(r)%own(halo(r)%first_own(r):halo(r)%first_own(r + 1) - 1))))
    end do
    call test%check('one owner each', all(owners == 1))
    call neighbours(dofs, part, halo)
    call pieces(mesh, part, ranks)
  end subroutine parts

  !> Pieces that are dealt out: together the mesh and its groups, each node with one owner; what two
  !! share they list in the same order of the same nodes.
  subroutine pieces(mesh, part, ranks)
    type(fem_mesh_type), intent(inout) :: mesh
    integer(i4), intent(in) :: part(:), ranks
    type(fem_dofs_type) :: dofs
    type(fem_holders_type) :: holders
    type(fem_piece_type) :: piece(0:ranks - 1)
    integer(i4) :: owners(mesh%nodes), elements(mesh%elements), r, k, c, facets
    logical :: same
    call add_groups(mesh)
    call number_fields(mesh, spread(0_i4, 1, mesh%elements), dofs)
    call find_holders(mesh, dofs, part, ranks, holders)
    owners = 0
    elements = 0
    facets = 0
    same = .true.
    do r = 0, ranks - 1
      call make_piece(mesh, holders, r, piece(r))
      associate (own => piece(r)%mesh, halo => piece(r)%halo)
        owners(own%number) = owners(own%number) + merge(1, 0, halo%mine)
        elements(piece(r)%element) = elements(piece(r)%element) + 1
        same = same .and. all(abs(own%x - mesh%x(:, own%number)) <= 0.0_wp) .and. &
          all(own%number(own%node) == [(mesh%node(mesh%start(piece(r)%element(k)): &
            mesh%start(piece(r)%element(k)) + 7), k=1, own%elements)])
        same = same .and. size(halo%own) == halo%first_own(r + 1) - halo%first_own(r)
        same = same .and. all(own%number(own%group(1)%node) == pack(own%number, own%number <= 9))
        facets = facets + size(own%group(2)%facet, 2)
        do k = 1, size(own%group(2)%facet, 2)
          same = same .and. all([(any(own%node(own%start(own%group(2)%element(k)): &
            own%start(own%group(2)%element(k)) + 7) == own%group(2)%facet(c, k)), c=1, 4)])
        end do
      end associate
    end do
    call test%check('one owner of each node in pieces', all(owners == 1))
    call test%check('each element once', all(elements == 1))
    call test%check('each facet once', facets == size(mesh%group(2)%facet, 2))
    call test%check('places, nodes, groups', same)
    call common_nodes(piece)
  end subroutine pieces

  subroutine common_nodes(piece)
    type(fem_piece_type), intent(in) :: piece(0:)
    integer(i4) :: a, b
    logical :: same
    same = .true.
    do a = 0, ubound(piece, 1)
      do b = 0, a - 1
        associate (mine => piece(a)%halo%shared(piece(a)%halo%first(b): &
                                                piece(a)%halo%first(b + 1) - 1), &
                   others => piece(b)%halo%shared(piece(b)%halo%first(a): &
                                                  piece(b)%halo%first(a + 1) - 1))
          same = same .and. size(mine) == size(others)
          if (same) same = all(piece(a)%mesh%number(mine) == piece(b)%mesh%number(others)) .and. &
            all(piece(a)%halo%owner(mine) == piece(b)%halo%owner(others))
        end associate
      end do
    end do
    call test%check('the same nodes in common', same)
  end subroutine common_nodes

  !> The first nine nodes, and the lower faces of the elements on the floor.
  subroutine add_groups(mesh)
    type(fem_mesh_type), intent(inout) :: mesh
    integer(i4) :: e
    allocate (mesh%group(2))
    mesh%group(1)%name = 'nodes'
    mesh%group(1)%kind = group_node
    mesh%group(1)%node = [(e, e=1, 9)]
    mesh%group(2)%name = 'floor'
    mesh%group(2)%kind = group_facet
    mesh%group(2)%element = pack([(e, e=1, mesh%elements)], &
      [(mesh%x(3, mesh%node(mesh%start(e))) <= 0.0_wp, e=1, mesh%elements)])
    mesh%group(2)%facet = mesh%hex8(:4, mesh%group(2)%element)
    mesh%group(2)%facet_kind = spread(quad4, 1, size(mesh%group(2)%element))
    mesh%group(2)%node = pack([(e, e=1, mesh%nodes)], mesh%x(3, :) <= 0.0_wp)
  end subroutine add_groups

  !> What two ranks share they list in the same order, and both have it.
  subroutine neighbours(dofs, part, halo)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:)
    type(fem_halo_type), intent(in) :: halo(0:)
    integer(i4) :: a, b
    logical :: same
    do a = 0, ubound(halo, 1)
      do b = 0, a - 1
        associate (mine => halo(a)%shared(halo(a)%first(b):halo(a)%first(b + 1) - 1), &
                   others => halo(b)%shared(halo(b)%first(a):halo(b)%first(a + 1) - 1))
          same = size(mine) == size(others)
          if (same) same = all(mine == others)
          call test%check('the same list', same)
          call test%check('both have it', all_of_part(dofs, part, b, mine))
        end associate
      end do
    end do
  end subroutine neighbours

  !> Has an element of part b each of these blocks?
  logical function all_of_part(dofs, part, b, blocks)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:), b, blocks(:)
    integer(i4) :: e, k
    all_of_part = .true.
    do k = 1, size(blocks)
      all_of_part = all_of_part .and. any([(part(e) == b .and. any(dofs%block(dofs%start(e): &
        dofs%start(e + 1) - 1) == blocks(k)), e=1, size(part))])
    end do
  end function all_of_part

  subroutine make_cube(n, mesh)
    integer(i4), intent(in) :: n
    type(fem_mesh_type), intent(out) :: mesh
    integer(i4) :: connectivity(8, n**3), step(8), i, j, k, e
    step = [0, 1, n + 2, n + 1, (n + 1)**2, (n + 1)**2 + 1, (n + 1)**2 + n + 2, (n + 1)**2 + n + 1]
    mesh%x = reshape([(((real([i, j, k], wp), i=0, n), j=0, n), k=0, n)], [3, (n + 1)**3])
    mesh%nodes = (n + 1)**3
    mesh%elements = n**3
    e = 0
    do k = 0, n - 1
      do j = 0, n - 1
        do i = 0, n - 1
          e = e + 1
          connectivity(:, e) = 1 + i + (n + 1)*(j + (n + 1)*k) + step
        end do
      end do
    end do
    call set_elements(mesh, hex8, connectivity)
  end subroutine make_cube
end program test_fem_partition
