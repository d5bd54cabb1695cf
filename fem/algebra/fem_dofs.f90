!> Degrees of freedom by field. Every field is made of blocks of three components at nodes: the
!! displacement u has a block at every node, the micro-rotation phi one at those nodes where an
!! element interpolates it (the corner nodes of mixed pairs, all nodes of equal orders). The
!! micro-deformation of micromorphic bodies has three at these nodes, its columns.
!!
!! Blocks 1 to `nodes` are the displacements of nodes 1 to `nodes`; micro-rotations follow, and then
!! the pressures of the pore liquid, one a block in its first component, at the corner nodes of
!! elements that have one. All arrays of state, loads and supports are (3, blocks), so that the
!! fields share procedures.
module fem_dofs
  use talus_kinds, only: i4
  use fem_halo, only: fem_halo_type
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_dofs_type, number_fields, number_pressures, blocks_of

  type :: fem_dofs_type
    integer(i4) :: nodes = 0, blocks = 0
    integer(i4) :: solid = 0              !! blocks without the pressures
    integer(i4) :: parts = 1              !! blocks of the second field at a node
    integer(i4), allocatable :: phi(:)    !! (nodes) first block of the second field, 0 where none
    integer(i4), allocatable :: node(:)   !! (blocks) node of each block
    integer(i4), allocatable :: start(:)  !! (elements + 1) first entry of each element in `block`
    integer(i4), allocatable :: block(:)  !! of each element: u of all its nodes, then phi
    integer(i4), allocatable :: p(:)      !! (nodes) block of the pressure, 0 where none
    integer(i4), allocatable :: wet_start(:)  !! (elements + 1) first entry of each in `wet`
    integer(i4), allocatable :: wet(:)    !! pressures of each element; given with `p` alone
    type(fem_halo_type) :: halo           !! ranks that have a part of the elements each
  end type fem_dofs_type

contains

  !> Number the blocks of a mesh; `rotations` is how many of an element's nodes, from the first,
  !! have micro-rotations (corner nodes come first in every element), of `parts` blocks each.
  subroutine number_fields(mesh, rotations, dofs, parts)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: rotations(:)  !! (elements)
    type(fem_dofs_type), intent(out) :: dofs
    integer(i4), intent(in), optional :: parts
    integer(i4) :: e, a, c, n, k

    dofs%nodes = mesh%nodes
    if (present(parts)) dofs%parts = parts
    allocate (dofs%phi(mesh%nodes), source=0)
    allocate (dofs%start(mesh%elements + 1))
    dofs%start(1) = 1
    do e = 1, mesh%elements
      k = mesh%start(e)
      dofs%phi(mesh%node(k:k + rotations(e) - 1)) = 1
      dofs%start(e + 1) = dofs%start(e) + mesh%start(e + 1) - k + dofs%parts*rotations(e)
    end do
    dofs%blocks = mesh%nodes
    do n = 1, mesh%nodes
      if (dofs%phi(n) == 0) cycle
      dofs%phi(n) = dofs%blocks + 1
      dofs%blocks = dofs%blocks + dofs%parts
    end do
    allocate (dofs%node(dofs%blocks), dofs%block(dofs%start(mesh%elements + 1) - 1))
    dofs%node(:mesh%nodes) = [(n, n=1, mesh%nodes)]
    do n = 1, mesh%nodes
      if (dofs%phi(n) > 0) dofs%node(dofs%phi(n):dofs%phi(n) + dofs%parts - 1) = n
    end do
    do e = 1, mesh%elements
      k = dofs%start(e)
      n = mesh%start(e + 1) - mesh%start(e)
      dofs%block(k:k + n - 1) = mesh%node(mesh%start(e):mesh%start(e + 1) - 1)
      do a = 1, rotations(e)
        do c = 1, dofs%parts
          dofs%block(k + n + (a - 1)*dofs%parts + c - 1) = dofs%phi(mesh%node(mesh%start(e) &
                                                                         + a - 1)) + c - 1
        end do
      end do
    end do
    dofs%solid = dofs%blocks
  end subroutine number_fields

  !> Number the pressures after the other fields; `corners` is how many of an element's nodes, from
  !! the first, have one: its corners, or none in elements without a liquid.
  subroutine number_pressures(mesh, corners, dofs)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: corners(:)  !! (elements)
    type(fem_dofs_type), intent(inout) :: dofs
    integer(i4) :: e, n, k

    allocate (dofs%p(mesh%nodes), source=0)
    allocate (dofs%wet_start(mesh%elements + 1), dofs%wet(sum(corners)))
    dofs%wet_start(1) = 1
    do e = 1, mesh%elements
      k = mesh%start(e)
      dofs%p(mesh%node(k:k + corners(e) - 1)) = 1
      dofs%wet_start(e + 1) = dofs%wet_start(e) + corners(e)
    end do
    do n = 1, mesh%nodes
      if (dofs%p(n) == 0) cycle
      dofs%blocks = dofs%blocks + 1
      dofs%p(n) = dofs%blocks
    end do
    dofs%node = [dofs%node, pack([(n, n=1, mesh%nodes)], dofs%p > 0)]
    do e = 1, mesh%elements
      k = mesh%start(e)
      dofs%wet(dofs%wet_start(e):dofs%wet_start(e + 1) - 1) = &
        dofs%p(mesh%node(k:k + corners(e) - 1))
    end do
  end subroutine number_pressures

  !> Blocks of element e.
  pure function blocks_of(dofs, e) result(list)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e
    integer(i4) :: list(dofs%start(e + 1) - dofs%start(e))
    list = dofs%block(dofs%start(e):dofs%start(e + 1) - 1)
  end function blocks_of
end module fem_dofs
