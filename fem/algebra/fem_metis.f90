!> Fill-reducing order of the nodes by METIS' nested dissection (METIS 5.1, 32-bit indices).
!! The node graph is ordered, not the degrees of freedom: those of a node share a vertex.
module fem_metis
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr, c_null_ptr
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use fem_dofs, only: fem_dofs_type
  use fem_sparse, only: fem_pattern_type
  implicit none
  private
  public :: dissect

  integer(c_int), parameter :: metis_ok = 1
  integer, parameter :: at_ufactor = 16             !! METIS_OPTION_UFACTOR, counted from 0
  integer(c_int), parameter :: usual = -1, even = 30  !! METIS' own choice; halves differ by 3 %

  interface
    integer(c_int) function metis_node_nd(n, xadj, adjncy, weight, options, perm, iperm) &
      bind(c, name='METIS_NodeND')
      import :: c_int, c_ptr
      integer(c_int), intent(in) :: n
      integer(c_int), intent(inout) :: xadj(*), adjncy(*)
      type(c_ptr), value :: weight
      integer(c_int), intent(inout) :: options(*)
      integer(c_int), intent(out) :: perm(*), iperm(*)
    end function metis_node_nd
  end interface

contains

  !> Position of each node in the elimination order, from 1. Where ranks share the work the halves
  !! are kept even: METIS' own limit of 20 % costs two ranks a tenth of their speed.
  subroutine dissect(dofs, pattern, ranks, position, errors)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), intent(in) :: ranks
    integer(i4), allocatable, intent(out) :: position(:)
    type(error_list_type), intent(inout) :: errors
    integer(c_int), allocatable :: xadj(:), adjncy(:), perm(:), iperm(:)
    integer(c_int) :: status, options(0:39)

    options = usual
    if (ranks > 1) options(at_ufactor) = even
    call full_graph(dofs%nodes, pattern, xadj, adjncy)
    allocate (perm(dofs%nodes), iperm(dofs%nodes))
    status = metis_node_nd(int(dofs%nodes, c_int), xadj, adjncy, c_null_ptr, options, &
      perm, iperm)
    if (status /= metis_ok) then
      call errors%add('S301', 'METIS could not order the nodes (status '//str(int(status, i4))// &
        ')', &
                      hint='this is mostly a lack of memory')
      return
    end if
    position = int(iperm, i4) + 1
  end subroutine dissect

  !> Both triangles of the pattern of the displacements (all nodes of an element have them)
  !! without the diagonal, counted from 0 as METIS requires.
  subroutine full_graph(nodes, pattern, xadj, adjncy)
    integer(i4), intent(in) :: nodes
    type(fem_pattern_type), intent(in) :: pattern
    integer(c_int), allocatable, intent(out) :: xadj(:), adjncy(:)
    integer(c_int), allocatable :: next(:)
    integer(i4) :: i, j, p

    allocate (xadj(nodes + 1))
    xadj = 0
    do i = 1, nodes
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        if (j > nodes) exit
        xadj(i + 1) = xadj(i + 1) + 1
        xadj(j + 1) = xadj(j + 1) + 1
      end do
    end do
    do i = 1, nodes
      xadj(i + 1) = xadj(i) + xadj(i + 1)
    end do
    next = xadj + 1
    allocate (adjncy(xadj(nodes + 1)))
    do i = 1, nodes
      do p = pattern%start(i) + 1, pattern%start(i + 1) - 1
        j = pattern%column(p)
        if (j > nodes) exit
        adjncy(next(i)) = int(j - 1, c_int)
        next(i) = next(i) + 1
        adjncy(next(j)) = int(i - 1, c_int)
        next(j) = next(j) + 1
      end do
    end do
  end subroutine full_graph
end module fem_metis
