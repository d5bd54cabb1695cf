!> Read mesh.h5 and check it: ids in range, elements right way round, no hanging or lone nodes.
module fem_mesh
  use talus_kinds, only: i4
  use talus_suggest, only: did_you_mean
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use fem_kinds, only: hex8, solid_kinds, first_facet, kinds, kind_name, node_count
  use fem_mesh_checks, only: check_ids, check_mesh
  use fem_types, only: fem_mesh_type, fem_group_type, group_volume, group_facet, group_node
  use fem_topology, only: element_nodes
  implicit none
  private
  public :: read_mesh, find_group, group_hint

  integer(i4), parameter :: versions(2) = [1, 2]  !! 1: hex8 and quad4 alone; 2: all kinds

contains

  !> Mesh of a file; faults I301 to I305, I308.
  subroutine read_mesh(path, mesh, errors)
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(out) :: mesh
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    integer(i4) :: version

    call file%open(path, errors, format='talus-mesh')
    if (errors%any()) return
    version = 0
    call file%attr_get('/', 'version', version, errors)
    if (.not. errors%any() .and. .not. any(version == versions)) &
      call errors%add('I301', "'"//path//"' is a mesh of version "//str(version)//', '// &
                      str(versions(1))//' to '//str(versions(2))//' are read', path, &
                      "make it again with the 'talus mesh' of this version")
    call file%get('/nodes/x', mesh%x, errors)
    if (.not. errors%any()) then
      mesh%nodes = size(mesh%x, 2)
      if (size(mesh%x, 1) /= 3) call errors%add('I301', '/nodes/x must be (n, 3)', path)
    end if
    if (.not. errors%any()) call read_cells(file, path, mesh, errors)
    if (.not. errors%any()) call check_ids(path, mesh, errors)
    if (.not. errors%any()) call read_groups(file, path, mesh, errors)
    call file%close(errors)
    if (.not. errors%any()) call check_mesh(path, mesh, errors)
  end subroutine read_mesh

  !> Elements of all kinds, in the order of the kinds.
  subroutine read_cells(file, path, mesh, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path
    type(fem_mesh_type), intent(inout) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: cells(:, :)
    character(len=:), allocatable :: name
    integer(i4) :: k, e, known

    allocate (mesh%kind(0), mesh%node(0))
    do k = 1, solid_kinds
      name = '/cells/'//kind_name(k)
      if (.not. file%exists(name)) cycle
      call file%get(name, cells, errors)
      if (errors%any()) return
      if (size(cells, 1) /= node_count(k)) then
        call errors%add('I301', name//' must be (m, '//str(node_count(k))//')', path)
        return
      end if
      mesh%kind = [mesh%kind, spread(k, 1, size(cells, 2))]
      mesh%node = [mesh%node, row_of(reshape(cells, [size(cells)]))]
      if (k == hex8) mesh%hex8 = row_of(cells)
    end do
    mesh%elements = size(mesh%kind)
    if (mesh%elements == 0) then
      call errors%add('I301', 'there are no elements', path, &
                      '/cells must hold hex8, hex20, hex27, tet4, tet10 or wedge6')
      return
    end if
    if (any(mesh%kind /= hex8) .and. allocated(mesh%hex8)) deallocate (mesh%hex8)
    allocate (mesh%start(mesh%elements + 1))
    known = 1
    do e = 1, mesh%elements
      mesh%start(e) = known
      known = known + node_count(mesh%kind(e))
    end do
    mesh%start(mesh%elements + 1) = known
  end subroutine read_cells

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
      call read_facets(file, path, name, group, rows, errors)
    else
      call file%get(name, rows, errors)
      if (errors%any()) return
      rows = row_of(rows)
      if (group%kind == group_volume) limit = mesh%elements
    end if
    if (errors%any()) return
    if (any(rows < 1) .or. any(rows > limit)) then
      call errors%add('I305', 'group '//name//' names row '// &
                      str(pick(rows, limit))//' of '//str(limit), path)
      return
    end if
    group%empty = size(rows) == 0
    if (group%kind == group_volume) then
      group%element = rows
      call nodes_of_elements(mesh, rows, group%node)
    else
      call unique_nodes(mesh%nodes, rows, group%node)
    end if
  end subroutine read_group

  !> Facets of all kinds of a group, in the order of the kinds; `rows` are all their nodes.
  subroutine read_facets(file, path, name, group, rows, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path, name
    type(fem_group_type), intent(inout) :: group
    integer(i4), allocatable, intent(out) :: rows(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: part(:, :), longer(:, :)
    integer(i4) :: k, n, most

    allocate (rows(0), group%facet(0, 0), group%facet_kind(0))
    do k = first_facet, kinds
      if (.not. file%exists(name//'/'//kind_name(k))) cycle
      call file%get(name//'/'//kind_name(k), part, errors)
      if (errors%any()) return
      if (size(part, 1) /= node_count(k)) then
        call errors%add('I301', name//'/'//kind_name(k)//' must be (k, '// &
                        str(node_count(k))//')', path)
        return
      end if
      n = size(group%facet_kind)
      most = max(size(group%facet, 1), node_count(k))
      allocate (longer(most, n + size(part, 2)), source=0)
      longer(:size(group%facet, 1), :n) = group%facet
      longer(:node_count(k), n + 1:) = row_of(part)
      call move_alloc(longer, group%facet)
      group%facet_kind = [group%facet_kind, spread(k, 1, size(part, 2))]
      rows = [rows, row_of(reshape(part, [size(part)]))]
    end do
    if (size(group%facet, 1) == 0) then
      call errors%add('I301', name//' has no facets', path, &
                      'it must hold quad4, quad8, quad9, tri3 or tri6')
      return
    end if
    if (.not. file%exists(name//'/cell')) return
    call file%get(name//'/cell', group%element, errors)
    if (.not. errors%any()) group%element = row_of(group%element)
  end subroutine read_facets

  !> Row of a number of the file, which counts from 0; the largest stays what no mesh has.
  elemental integer(i4) function row_of(number)
    integer(i4), intent(in) :: number
    row_of = min(number, huge(1_i4) - 1) + 1
  end function row_of

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

  pure subroutine nodes_of_elements(mesh, element, list)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: element(:)
    integer(i4), allocatable, intent(out) :: list(:)
    logical :: in(mesh%nodes)
    integer(i4) :: k
    in = .false.
    do k = 1, size(element)
      in(element_nodes(mesh, element(k))) = .true.
    end do
    list = pack([(k, k=1, mesh%nodes)], in)
  end subroutine nodes_of_elements

  !> Index of a named group of one of the kinds; 0 if there is none, or an empty one, on which
  !! nothing would act.
  pure integer(i4) function find_group(mesh, name, kinds)
    type(fem_mesh_type), intent(in) :: mesh
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kinds(:)
    integer(i4) :: k, g
    find_group = 0
    do k = 1, size(kinds)
      do g = 1, size(mesh%group)
        if (mesh%group(g)%name /= name .or. mesh%group(g)%kind /= kinds(k)) cycle
        if (mesh%group(g)%empty) cycle
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
      if (.not. any(kinds == mesh%group(g)%kind) .or. mesh%group(g)%empty) cycle
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
    if (any(mesh%group%empty .and. mesh%group%name == name)) hint = 'that one is empty; '//hint
    do k = 1, size(names)
      hint = hint//trim(merge('it has:', ',      ', k == 1))//' '//names(k)%s
    end do
  end function group_hint
end module fem_mesh
