!> Degrees of freedom by field. Every field is made of blocks of three components at nodes: the
!! displacement u has a block at every node, the micro-rotation phi one at those nodes where an
!! element interpolates it (the corner nodes of mixed pairs, all nodes of equal orders). The
!! micro-deformation of micromorphic bodies has three at these nodes, its columns.
!!
!! Blocks 1 to `nodes` are the displacements of nodes 1 to `nodes`; micro-rotations follow. All
!! arrays of state, loads and supports are (3, blocks), so that u and phi share procedures.
module fem_dofs
  use talus_kinds, only: i4
  use fem_halo, only: fem_halo_type
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_dofs_type, number_fields, blocks_of

  type :: fem_dofs_type
    integer(i4) :: nodes = 0, blocks = 0
    integer(i4) :: parts = 1              !! blocks of the second field at a node
    integer(i4), allocatable :: phi(:)    !! (nodes) first block of the second field, 0 where none
    integer(i4), allocatable :: node(:)   !! (blocks) node of each block
    integer(i4), allocatable :: start(:)  !! (elements + 1) first entry of each element in `block`
    integer(i4), allocatable :: block(:)  !! of each element: u of all its nodes, then phi
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
  end subroutine number_fields

  !> Blocks of element e.
  pure function blocks_of(dofs, e) result(list)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e
    integer(i4) :: list(dofs%start(e + 1) - dofs%start(e))
    list = dofs%block(dofs%start(e):dofs%start(e + 1) - 1)
  end function blocks_of
end module fem_dofs
