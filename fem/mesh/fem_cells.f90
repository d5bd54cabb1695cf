!> Cells of a mesh in field files: a dataset for each kind, and their description for XDMF.
module fem_cells
  use talus_kinds, only: i4, i8
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_xdmf, only: xdmf_type
  use fem_kinds, only: kind_name, node_count, solid_kinds
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: put_cells, describe_cells

  character(len=*), parameter :: topology(solid_kinds) = [character(len=14) :: 'Hexahedron', &
    'Hexahedron_20', 'Hexahedron_27', 'Tetrahedron', 'Tetrahedron_10', 'Wedge']
  integer(i4), parameter :: code(solid_kinds) = [9, 48, 50, 6, 38, 8]  !! in mixed topologies

contains

  !> Write /mesh/x, /mesh/<kind> of every kind, and /mesh/mixed where there are several: for each
  !! cell XDMF's code and its nodes.
  subroutine put_cells(mesh, file, errors)
    type(fem_mesh_type), intent(in) :: mesh
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: list(:)
    integer(i4) :: k, e, n, last

    call file%group('/mesh', errors)
    call file%put('/mesh/x', mesh%x, errors)
    do k = 1, solid_kinds
      n = int(count(mesh%kind == k), i4)
      if (n == 0) cycle
      e = int(findloc(mesh%kind, k, 1), i4)  ! elements of a kind follow each other
      call file%put('/mesh/'//kind_name(k), reshape(mesh%node(mesh%start(e):mesh%start(e + n) - 1) &
                                                    - 1, [node_count(k), n]), errors)
    end do
    if (all(mesh%kind == mesh%kind(1))) return
    allocate (list(size(mesh%node) + mesh%elements))
    last = 0
    do e = 1, mesh%elements
      n = mesh%start(e + 1) - mesh%start(e)
      list(last + 1) = code(mesh%kind(e))
      list(last + 2:last + 1 + n) = mesh%node(mesh%start(e):mesh%start(e + 1) - 1) - 1
      last = last + 1 + n
    end do
    call file%put('/mesh/mixed', list, errors)
  end subroutine put_cells

  !> Describe the cells that `put_cells` writes in XDMF.
  subroutine describe_cells(mesh, path, xdmf)
    type(fem_mesh_type), intent(in) :: mesh
    character(len=*), intent(in) :: path  !! of the .xdmf file
    type(xdmf_type), intent(inout) :: xdmf
    integer(i4) :: k
    k = mesh%kind(1)
    if (all(mesh%kind == k)) then
      call xdmf%describe_mesh(path, '/mesh/x', trim(topology(k)), '/mesh/'//kind_name(k), &
                              int([mesh%elements, node_count(k)], i8), int(mesh%nodes, i8), &
                              int(mesh%elements, i8))
    else
      call xdmf%describe_mesh(path, '/mesh/x', 'Mixed', '/mesh/mixed', &
                              [int(size(mesh%node) + mesh%elements, i8)], int(mesh%nodes, i8), &
                              int(mesh%elements, i8))
    end if
  end subroutine describe_cells
end module fem_cells
