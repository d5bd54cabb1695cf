!> Triangles from a facet group of a mesh. Faults I227.
module dem_surface_file
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_suggest, only: did_you_mean
  implicit none
  private
  public :: read_facets

  character(len=*), parameter :: kinds(5) = ['quad4', 'quad8', 'quad9', 'tri3 ', 'tri6 ']

contains

  !> Corners of the facets' triangles; mid-side nodes are left out. A facet with four corners is cut
  !! along its shorter diagonal, along that of its first node if both are equal.
  subroutine read_facets(path, name, corner, errors)
    character(len=*), intent(in) :: path, name
    real(wp), allocatable, intent(out) :: corner(:, :, :)  !! (3, 3, triangles) [m]
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(string_type), allocatable :: names(:)
    real(wp), allocatable :: x(:, :)
    integer(i4), allocatable :: nodes(:, :)
    integer(i4) :: k, before
    character(len=:), allocatable :: group

    before = errors%count
    allocate (corner(3, 3, 0))
    call file%open(path, errors)
    if (errors%count > before) return
    group = '/facet_groups/'//name
    if (.not. file%exists(group)) then
      call file%names('/facet_groups', names)
      call errors%add('I227', "'"//path//"' has no facet group '"//name//"'", path, &
                      did_you_mean(name, names, 'facet groups of this mesh:'))
    else
      call file%get('/nodes/x', x, errors)
      do k = 1, size(kinds)
        if (errors%count > before) exit
        if (.not. file%exists(group//'/'//trim(kinds(k)))) cycle
        call file%get(group//'/'//trim(kinds(k)), nodes, errors)
        if (errors%count > before) exit
        call add_facets(path, group, x, nodes, merge(4, 3, k <= 3), corner, errors)
      end do
      if (errors%count == before .and. size(corner, 3) == 0) &
        call errors%add('I227', "'"//path//"': facet group '"//name//"' has no facets", path, &
                        'choose another group, or make the mesh again')
    end if
    call file%close(errors)
  end subroutine read_facets

  subroutine add_facets(path, group, x, nodes, corners, corner, errors)
    character(len=*), intent(in) :: path, group
    real(wp), intent(in) :: x(:, :)
    integer(i4), intent(in) :: nodes(:, :), corners
    real(wp), allocatable, intent(inout) :: corner(:, :, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: longer(:, :, :)
    integer(i4) :: k, n, node(4)

    if (size(nodes, 1) < corners .or. any(nodes < 0) .or. any(nodes >= size(x, 2))) then
      call errors%add('I227', "'"//path//"': "//group//' names nodes that the mesh has not', path, &
                      'make the mesh again')
      return
    end if
    n = size(corner, 3)
    allocate (longer(3, 3, n + (corners - 2)*size(nodes, 2)))
    longer(:, :, :n) = corner
    do k = 1, size(nodes, 2)
      node(:corners) = nodes(:corners, k) + 1
      if (corners == 4) then
        if (sum((x(:, node(3)) - x(:, node(1)))**2) &
            > (1.0_wp + 1.0e-12_wp)*sum((x(:, node(4)) - x(:, node(2)))**2)) node = cshift(node, 1)
        longer(:, :, n + 2) = x(:, node([1, 3, 4]))
      end if
      longer(:, :, n + 1) = x(:, node([1, 2, 3]))
      n = n + corners - 2
    end do
    call move_alloc(longer, corner)
  end subroutine add_facets
end module dem_surface_file
