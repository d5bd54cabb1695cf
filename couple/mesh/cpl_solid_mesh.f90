!> What the coupling knows of the solid's mesh, from its replies to DESCRIBE.
module cpl_solid_mesh
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use cpl_shapes, only: node_count, is_facet
  implicit none
  private
  public :: solid_mesh_type

  !> Nodes, the facets that ghosts may be attached to, and what is behind them.
  type :: solid_mesh_type
    real(wp), allocatable :: x(:, :)          !! (3, nodes) [m]
    integer(i4), allocatable :: facets(:, :)  !! (most nodes, facets) node ids from 1, 0 beyond
    integer(i4), allocatable :: hex8(:, :)    !! (8, elements) node ids, none if there are others
    integer(i4), allocatable :: polar(:)      !! (nodes) 1: the node has a micro-rotation
  contains
    procedure :: check
  end type solid_mesh_type

  character(len=*), parameter :: place = 'the solid''s reply to DESCRIBE'
  character(len=*), parameter :: hint = 'make the mesh again, and see that the partner is whole'

contains

  !> P413: coordinates that are no numbers, nodes that do not exist, facets of no known kind.
  subroutine check(self, errors)
    class(solid_mesh_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, nodes
    nodes = size(self%x, 2)
    if (.not. all(is_finite(self%x))) then
      k = findloc(all(is_finite(self%x), 1), .false., 1)
      call errors%add('P413', 'the position of node '//str(k)//' is no number', place, hint)
    else if (size(self%polar) /= nodes) then
      call errors%add('P413', str(size(self%polar))//' marks of micro-rotation for '// &
                      str(nodes)//' nodes', place, hint)
    else if (size(self%hex8) > 0 .and. size(self%hex8, 1) /= 8) then
      call errors%add('P413', 'hexahedra have '//str(size(self%hex8, 1))//' nodes', place, hint)
    else if (any(self%hex8 < 1) .or. any(self%hex8 > nodes)) then
      k = findloc(any(self%hex8 < 1 .or. self%hex8 > nodes, 1), .true., 1)
      call errors%add('P413', 'element '//str(k)//' has the nodes '//str(self%hex8(:, k))// &
                      ', the mesh has '//str(nodes), place, hint)
    end if
    do k = 1, size(self%facets, 2)
      if (errors%any()) return
      if (.not. is_facet(self%facets(:, k))) then
        call errors%add('P413', 'facet '//str(k)//' has '//str(node_count(self%facets(:, k)))// &
                        ' nodes', place, 'facets have 3, 4, 6, 8 or 9')
      else if (any(self%facets(:, k) < 0) .or. any(self%facets(:, k) > nodes)) then
        call errors%add('P413', 'facet '//str(k)//' has the nodes '//str(self%facets(:, k))// &
                        ', the mesh has '//str(nodes), place, hint)
      end if
    end do
  end subroutine check
end module cpl_solid_mesh
