!> XDMF description of a field file, so that ParaView opens it: a temporal collection of points or
!! of a mesh with attributes, rewritten and renamed after every step.
!!
!! Datasets are named relative to the group of a step ('grains/x'), or absolutely ('/mesh/x').
!! Attributes of four and six components are shown component by component: XDMF has no quaternion,
!! and its order of six is not ours.
module talus_xdmf
  use talus_kinds, only: i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: name_of, replace_file
  use talus_series, only: series_type
  use talus_json, only: utf8_bytes
  use talus_text, only: str, string_type
  implicit none
  private
  public :: xdmf_type, xdmf_node, xdmf_cell

  integer(i4), parameter :: xdmf_node = 1  !! attribute of nodes (or grains)
  integer(i4), parameter :: xdmf_cell = 2  !! attribute of cells
  integer(i4), parameter :: shape_points = 1, shape_mesh = 2
  integer(i4), parameter :: most = 64      !! attributes of one description
  character(len=*), parameter :: nl = new_line('a')

  type :: attribute_type
    character(len=64) :: name = '', dataset = ''
    integer(i4) :: centre = xdmf_node
    integer(i4) :: components = 1
    character(len=8) :: kind = 'real'      !! real, int4 or int8
  end type attribute_type

  !> Contents of a step.
  type :: xdmf_type
    character(len=:), allocatable :: path
    integer(i4), private :: form = shape_points
    character(len=:), allocatable, private :: points, cells, topology
    integer(i8), private :: node_count = 0, cell_count = 0  !! of a mesh
    integer(i8), allocatable, private :: extent(:)          !! of the dataset of cells
    integer(i4), private :: attribute_count = 0
    type(attribute_type), private :: list(most)
    character(len=:), allocatable, private :: body          !! text of the steps written so far
    integer(i4), private :: body_steps = 0
  contains
    procedure :: describe_points
    procedure :: describe_mesh
    procedure :: describe_hex8
    procedure :: attribute
    procedure :: write => write_xdmf
  end type xdmf_type

contains

  !> Grains as points; their number is the count of each step.
  subroutine describe_points(self, path, points)
    class(xdmf_type), intent(inout) :: self
    character(len=*), intent(in) :: path    !! of the .xdmf file
    character(len=*), intent(in) :: points  !! dataset (3, n), for example 'grains/x'
    self%path = path
    self%form = shape_points
    self%points = points
    self%attribute_count = 0
    self%body_steps = 0
  end subroutine describe_points

  !> A mesh that stays the same: XDMF's name of the topology ('Hexahedron_20', 'Mixed', ...) and the
  !! dataset of cells (int32, nodes from 0, VTK order) with its extent in HDF5.
  subroutine describe_mesh(self, path, points, topology, cells, extent, node_count, cell_count)
    class(xdmf_type), intent(inout) :: self
    character(len=*), intent(in) :: path, points, topology, cells
    integer(i8), intent(in) :: extent(:), node_count, cell_count
    call self%describe_points(path, points)
    self%form = shape_mesh
    self%topology = topology
    self%cells = cells
    self%extent = extent
    self%node_count = node_count
    self%cell_count = cell_count
  end subroutine describe_mesh

  !> A mesh of bricks.
  subroutine describe_hex8(self, path, points, cells, node_count, cell_count)
    class(xdmf_type), intent(inout) :: self
    character(len=*), intent(in) :: path, points
    character(len=*), intent(in) :: cells   !! dataset (8, m) of int32, nodes from 0, VTK order
    integer(i8), intent(in) :: node_count, cell_count
    call self%describe_mesh(path, points, 'Hexahedron', cells, [cell_count, 8_i8], node_count, &
                            cell_count)
  end subroutine describe_hex8

  !> One more attribute, in every step.
  subroutine attribute(self, name, dataset, centre, components, kind)
    class(xdmf_type), intent(inout) :: self
    character(len=*), intent(in) :: name, dataset
    integer(i4), intent(in) :: centre      !! xdmf_node or xdmf_cell
    integer(i4), intent(in) :: components  !! 1 scalar, 3 vector, 9 tensor, others one by one
    character(len=*), intent(in), optional :: kind  !! 'real' (default), 'int4', 'int8'
    if (self%attribute_count == most) error stop 'bug: more attributes than talus_xdmf holds'
    self%attribute_count = self%attribute_count + 1
    self%list(self%attribute_count) = attribute_type(name, dataset, centre, components)
    if (present(kind)) self%list(self%attribute_count)%kind = kind
  end subroutine attribute

  !> Describe all steps in the field file; call it after each step and after a restart.
  subroutine write_xdmf(self, series, errors)
    class(xdmf_type), intent(inout) :: self
    type(series_type), intent(in) :: series
    type(error_list_type), intent(inout) :: errors
    if (.not. allocated(self%body) .or. self%body_steps > series%count) self%body_steps = 0
    if (self%body_steps == 0) self%body = ''
    do while (self%body_steps < series%count)
      self%body_steps = self%body_steps + 1
      self%body = self%body//step_text(self, series, self%body_steps)
    end do
    call replace_file(self%path, '<?xml version="1.0"?>'//nl//'<Xdmf Version="3.0"><Domain>'//nl// &
                      '<Grid Name="steps" GridType="Collection" CollectionType="Temporal">'//nl// &
                      self%body//'</Grid>'//nl//'</Domain></Xdmf>'//nl, errors)
  end subroutine write_xdmf

  function step_text(self, series, k) result(text)
    class(xdmf_type), intent(in) :: self
    type(series_type), intent(in) :: series
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: text, group, source
    integer(i8) :: nodes
    integer(i4) :: a

    group = series%step_path(k)
    source = xml_text(name_of(series%path))//':'//group
    nodes = merge(series%step(k)%count, self%node_count, self%form == shape_points)
    text = '<Grid Name="'//group(len('/steps/') + 1:)//'"><Time Value="'// &
           str(series%step(k)%time)//'"/>'//nl
    if (self%form == shape_points) then
      text = text//'<Topology TopologyType="Polyvertex" NumberOfElements="'//str(nodes)// &
             '" NodesPerElement="1"/>'//nl
    else
      text = text//'<Topology TopologyType="'//self%topology//'" NumberOfElements="'// &
             str(self%cell_count)//'">'// &
             data_item(source, self%cells, 'int4', self%extent)//'</Topology>'//nl
    end if
    text = text//'<Geometry GeometryType="XYZ">'// &
           data_item(source, self%points, 'real', [nodes, 3_i8])//'</Geometry>'//nl
    do a = 1, self%attribute_count
      text = text//attribute_text(self%list(a), source, &
                                  merge(nodes, self%cell_count, self%list(a)%centre == xdmf_node))
    end do
    text = text//'</Grid>'//nl
  end function step_text

  !> Reference to a dataset, with its shape in HDF5.
  function data_item(source, dataset, kind, extent) result(item)
    character(len=*), intent(in) :: source   !! 'file.h5:/steps/000000'
    character(len=*), intent(in) :: dataset, kind
    integer(i8), intent(in) :: extent(:)
    character(len=:), allocatable :: item
    integer :: m
    item = '<DataItem Format="HDF" NumberType="Int" '
    if (kind == 'real') item = '<DataItem Format="HDF" NumberType="Float" '
    item = item//'Precision="'//merge('4', '8', kind == 'int4')//'" Dimensions="'//str(extent(1))
    do m = 2, size(extent)
      item = item//' '//str(extent(m))
    end do
    if (dataset(1:1) == '/') then
      item = item//'">'//source(:index(source, ':/'))//trim(dataset)//'</DataItem>'
    else
      item = item//'">'//source//'/'//trim(dataset)//'</DataItem>'
    end if
  end function data_item

  function attribute_text(attribute, source, rows) result(text)
    type(attribute_type), intent(in) :: attribute
    character(len=*), intent(in) :: source
    integer(i8), intent(in) :: rows
    character(len=:), allocatable :: text, whole
    integer(i4) :: c
    whole = data_item(source, attribute%dataset, attribute%kind, &
                      [rows, int(attribute%components, i8)])
    select case (attribute%components)
    case (1)
      text = opening(attribute, trim(attribute%name), 'Scalar')// &
             data_item(source, attribute%dataset, attribute%kind, [rows])//'</Attribute>'//nl
    case (3)
      text = opening(attribute, trim(attribute%name), 'Vector')//whole//'</Attribute>'//nl
    case (9)
      text = opening(attribute, trim(attribute%name), 'Tensor')//whole//'</Attribute>'//nl
    case default
      text = ''
      do c = 1, attribute%components
        text = text//opening(attribute, component_name(attribute, c), 'Scalar')// &
               '<DataItem ItemType="HyperSlab" Dimensions="'//str(rows)//'">'// &
               '<DataItem Dimensions="3 2" Format="XML">0 '//str(c - 1)//' 1 1 '//str(rows)// &
               ' 1</DataItem>'//whole//'</DataItem></Attribute>'//nl
      end do
    end select
  end function attribute_text

  !> A text inside a quoted attribute or an element: marks of XML escaped; what XML cannot hold
  !! becomes a question mark.
  pure function xml_text(text) result(escaped)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: escaped
    integer(i4) :: k, more
    escaped = ''
    more = 0
    do k = 1, len(text)
      more = more - 1
      select case (iachar(text(k:k)))
      case (34); escaped = escaped//'&quot;'
      case (38); escaped = escaped//'&amp;'
      case (60); escaped = escaped//'&lt;'
      case (62); escaped = escaped//'&gt;'
      case (0:8, 11, 12, 14:31); escaped = escaped//'?'
      case (128:)
        if (more <= 0) more = utf8_bytes(text(k:))
        escaped = escaped//merge(text(k:k), '?', more > 0)
      case default; escaped = escaped//text(k:k)
      end select
    end do
  end function xml_text

  pure function opening(attribute, name, type_name) result(text)
    type(attribute_type), intent(in) :: attribute
    character(len=*), intent(in) :: name, type_name
    character(len=:), allocatable :: text
    text = '<Attribute Name="'//xml_text(name)//'" AttributeType="'//type_name//'" Center="'// &
           merge('Node', 'Cell', attribute%centre == xdmf_node)//'">'
  end function opening

  !> 'stress_xx' for six components, 'quat_w' for four, otherwise a number from 1.
  pure function component_name(attribute, c) result(name)
    type(attribute_type), intent(in) :: attribute
    integer(i4), intent(in) :: c
    character(len=2), parameter :: six(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'zx']
    character(len=1), parameter :: four(4) = ['w', 'x', 'y', 'z']
    character(len=:), allocatable :: name
    name = trim(attribute%name)//'_'
    select case (attribute%components)
    case (4)
      name = name//four(c)
    case (6)
      name = name//six(c)
    case default
      name = name//str(c)
    end select
  end function component_name
end module talus_xdmf
