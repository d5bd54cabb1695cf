!> Read mesh.h5 and check it: ids in range, elements right way round, no hanging or lone nodes.
module fem_mesh
  use talus_kinds, only: wp, i4
  use talus_suggest, only: did_you_mean
  use talus_text, only: str, string_type, append_string, is_finite
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use fem_types, only: fem_mesh_type, fem_group_type, group_volume, group_facet, group_node
  use fem_hex8, only: hex8_geometry, hex8_geometry_type
  use fem_mesh_checks, only: check_hanging, check_facets
  implicit none
  private
  public :: read_mesh, find_group, group_hint

  integer(i4), parameter :: format_version = 1

contains

  !> Mesh of a file; faults I301 to I305.
  subroutine read_mesh(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(out) :: mesh
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    integer(i4), allocatable :: cells(:, :)
    integer(i4) :: version

    call file%open(path, errors, format='talus-mesh')
    if (errors%any()) return
    version = 0
    call file%attr_get('/', 'version', version, errors)
    if (.not. errors%any() .and. version /= format_version) &
      call errors%add('I301', "'"//path//"' is a mesh of version "//str(version)//', '// &
                      str(format_version)//' is read', path, &
                      "make it again with the 'talus mesh' of this version")
    call file%get('/nodes/x', mesh%x, errors)
    call file%get('/cells/hex8', cells, errors)
    if (.not. errors%any()) then
      if (size(mesh%x, 1) /= 3 .or. size(cells, 1) /= 8 .or. size(cells, 2) == 0) then
        call errors%add('I301', '/nodes/x must be (n, 3) and /cells/hex8 (m, 8), m > 0', path)
      else
        mesh%nodes = size(mesh%x, 2)
        mesh%elements = size(cells, 2)
        mesh%hex8 = cells + 1
        call read_groups(file, path, mesh, errors)
      end if
    end if
    call file%close(errors)
    if (.not. errors%any()) call check_ids(path, mesh, errors)
    if (.not. errors%any()) call check_shape(path, mesh, errors)
    if (.not. errors%any()) call check_facets(path, mesh, errors)
    if (.not. errors%any()) call check_hanging(path, mesh, errors)
  end subroutine read_mesh

  subroutine read_groups(file, path, mesh, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(inout) :: mesh
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: folder(3) = [character(len=14) :: 'volume_groups', &
                                                'facet_groups', 'node_groups']
    integer(i4), parameter :: kind(3) = [group_volume, group_facet, group_node]
    type(string_type), allocatable :: names(:)
    type(fem_group_type), allocatable :: longer(:)
    integer(i4) :: f, k, n

    allocate (mesh%group(0))
    do f = 1, 3
      call file%names('/'//trim(folder(f)), names)
      n = size(mesh%group)
      allocate (longer(n + size(names)))
      longer(:n) = mesh%group
      call move_alloc(longer, mesh%group)
      do k = 1, size(names)
        mesh%group(n + k)%name = names(k)%s
        mesh%group(n + k)%kind = kind(f)
        call read_group(file, path, '/'//trim(folder(f))//'/'//names(k)%s, mesh, &
                        mesh%group(n + k), errors)
        if (errors%any()) return
      end do
    end do
  end subroutine read_groups

  subroutine read_group(file, path, name, mesh, group, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path, name
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_group_type), intent(inout) :: group
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: rows(:)
    integer(i4) :: limit

    limit = mesh%nodes
    if (group%kind == group_facet) then
      call file%get(name//'/quad4', group%facet, errors)
      if (errors%any()) return
      if (size(group%facet, 1) /= 4) then
        call errors%add('I301', name//'/quad4 must be (k, 4)', path)
        return
      end if
      group%facet = group%facet + 1
      rows = [group%facet]
      if (file%exists(name//'/cell')) then
        call file%get(name//'/cell', group%element, errors)
        if (errors%any()) return
        group%element = group%element + 1
      end if
    else
      call file%get(name, rows, errors)
      if (errors%any()) return
      rows = rows + 1
      if (group%kind == group_volume) limit = mesh%elements
    end if
    if (any(rows < 1) .or. any(rows > limit)) then
      call errors%add('I305', 'group '//name//' names row '// &
                      str(pick(rows, limit))//' of '//str(limit), path)
      return
    end if
    if (group%kind == group_volume) then
      group%element = rows
      rows = [mesh%hex8(:, group%element)]
    end if
    call unique_nodes(mesh%nodes, rows, group%node)
  end subroutine read_group

  !> The first row out of range.
  pure integer(i4) function pick(rows, limit)
    integer(i4), intent(in) :: rows(:), limit
    integer(i4) :: k
    pick = 0
    do k = 1, size(rows)
      if (rows(k) >= 1 .and. rows(k) <= limit) cycle
      pick = rows(k)
      return
    end do
  end function pick

  pure subroutine unique_nodes(nodes, rows, list)
    integer(i4), intent(in) :: nodes, rows(:)
    integer(i4), allocatable, intent(out) :: list(:)
    logical :: in(nodes)
    integer(i4) :: k
    in = .false.
    do k = 1, size(rows)
      in(rows(k)) = .true.
    end do
    list = pack([(k, k=1, nodes)], in)
  end subroutine unique_nodes

  subroutine check_ids(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    logical :: used(mesh%nodes)
    integer(i4) :: e, a, n

    do n = 1, mesh%nodes
      if (all(is_finite(mesh%x(:, n)))) cycle
      call errors%add('I305', 'node '//str(n)//' has the coordinates '//str(mesh%x(:, n)), path)
      return
    end do
    used = .false.
    do e = 1, mesh%elements
      do a = 1, 8
        n = mesh%hex8(a, e)
        if (n < 1 .or. n > mesh%nodes) then
          call errors%add('I305', 'element '//str(e)//' names node '//str(n)//' of '// &
                          str(mesh%nodes), path)
          return
        end if
        if (any(mesh%hex8(:a - 1, e) == n)) then
          call errors%add('I305', 'element '//str(e)//' names node '//str(n)//' twice', path)
          return
        end if
        used(n) = .true.
      end do
    end do
    if (all(used)) return
    call errors%add('I304', 'node '//str(int(findloc(used, .false., 1), i4))// &
                    ' belongs to no element ('//str(int(count(.not. used), i4))// &
                      ' such nodes)', path, &
                    'drop such nodes: `talus mesh convert` does so')
  end subroutine check_ids

  subroutine check_shape(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    type(hex8_geometry_type) :: geometry
    integer(i4) :: e, bad, first

    bad = 0
    first = 0
    do e = 1, mesh%elements
      call hex8_geometry(mesh%x(:, mesh%hex8(:, e)), geometry)
      if (geometry%least > 0.0_wp) cycle
      bad = bad + 1
      if (first == 0) first = e
    end do
    if (bad == 0) return
    call hex8_geometry(mesh%x(:, mesh%hex8(:, first)), geometry)
    call errors%add('I302', str(bad)//' elements are inside out, the first is element '// &
      str(first)// &
                    ' (least Jacobian '//str(geometry%least)//' m3)', path, &
                    'nodes must follow the VTK order: bottom face, then top face')
  end subroutine check_shape

  !> Index of a named group of one of the kinds; 0 if there is none.
  pure integer(i4) function find_group(mesh, name, kinds)
    type(fem_mesh_type), intent(in) :: mesh
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kinds(:)
    integer(i4) :: k, g
    find_group = 0
    do k = 1, size(kinds)
      do g = 1, size(mesh%group)
        if (mesh%group(g)%name /= name .or. mesh%group(g)%kind /= kinds(k)) cycle
        find_group = g
        return
      end do
    end do
  end function find_group

  !> Names of all groups of some kinds, each once, for hints.
  pure subroutine group_names(mesh, kinds, names)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: kinds(:)
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: g, k
    logical :: known
    allocate (names(0))
    do g = 1, size(mesh%group)
      if (.not. any(kinds == mesh%group(g)%kind)) cycle
      known = .false.
      do k = 1, size(names)
        known = known .or. names(k)%s == mesh%group(g)%name
      end do
      if (.not. known) call append_string(names, trim(mesh%group(g)%name))
    end do
  end subroutine group_names

  !> Hint where a group does not exist: the nearest name and all that there are.
  pure function group_hint(mesh, name, kinds) result(hint)
    type(fem_mesh_type), intent(in) :: mesh
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kinds(:)
    character(len=:), allocatable :: hint
    type(string_type), allocatable :: names(:)
    integer(i4) :: k
    call group_names(mesh, kinds, names)
    hint = did_you_mean(name, names, '')
    if (len(hint) > 0) hint = hint//' '
    if (size(names) == 0) hint = 'it has none'
    do k = 1, size(names)
      hint = hint//trim(merge('it has:', ',      ', k == 1))//' '//names(k)%s
    end do
  end function group_hint
end module fem_mesh
