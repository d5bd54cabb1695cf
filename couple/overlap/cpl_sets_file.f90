!> <stem>_sets.h5: which grains and nodes of an overlap are in which set, for plots
!! (`talus render --sets`).
module cpl_sets_file
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use cpl_overlap, only: overlap_type
  implicit none
  private
  public :: write_sets

  integer(i4), parameter :: set_other = 0, set_free = 1, set_ghost = 2  !! of grains
  integer(i4), parameter :: set_prescribed = 1, set_edge = 2                   !! of nodes, else
                                                                               !! other

contains

  !> Grains by id, nodes and elements in the order of the mesh.
  subroutine write_sets(path, o, errors)
    character(len=*), intent(in) :: path
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    integer(i4) :: grain(size(o%pack%id)), node(o%cells%nodes)

    grain = set_other
    grain(pack(o%sets%free, o%map%seen)) = set_free
    grain(o%sets%ghost) = set_ghost
    node = set_other
    node(o%sets%prescribed) = set_prescribed
    node(o%sets%edge) = set_edge
    call file%create(path, errors, format='talus-sets')
    if (errors%any()) return
    call file%put('/grains/id', o%pack%id, errors)
    call file%put('/grains/set', grain, errors)
    call file%put('/nodes/set', node, errors)
    call file%put('/elements/part', o%sets%part, errors)
    call file%commit(errors)
  end subroutine write_sets
end module cpl_sets_file
