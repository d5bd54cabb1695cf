!> Data of a solid: mesh, materials, loads, supports and its state. Plain arrays.
module fem_types
  use talus_kinds, only: wp, i4
  use talus_port_names, only: role_report, role_prescribe, role_load
  implicit none
  private
  public :: fem_mesh_type, fem_group_type, fem_load_type
  public :: fem_state_type, fem_springs_type, fem_energy_type, fem_set_type
  public :: group_volume, group_facet, group_node, name_length
  public :: role_report, role_prescribe, role_load, place_in

  integer(i4), parameter :: group_volume = 3, group_facet = 2, group_node = 0
  integer(i4), parameter :: name_length = 64

  !> A named group of elements, facets or nodes.
  type :: fem_group_type
    character(len=name_length) :: name = ''
    integer(i4) :: kind = group_node
    integer(i4), allocatable :: element(:)     !! element ids (volume), element of each facet
    integer(i4), allocatable :: facet(:, :)    !! (most nodes, k) ids, normal outward, 0 beyond
    integer(i4), allocatable :: facet_kind(:)  !! (k) quad4, quad8, quad9, tri3, tri6 (fem_kinds)
    integer(i4), allocatable :: node(:)        !! ids of all its nodes, ascending
    logical :: empty = .false.                 !! it is so in the whole mesh
  end type fem_group_type

  !> Mesh of one or several kinds of elements; ids count from 1, in the order of the kinds
  !! (fem_kinds). Element e has the nodes node(start(e):start(e + 1) - 1).
  type :: fem_mesh_type
    integer(i4) :: nodes = 0, elements = 0
    real(wp), allocatable :: x(:, :)        !! (3, nodes) [m]
    integer(i4), allocatable :: kind(:)     !! (elements) hex8, hex20, ... (fem_kinds)
    integer(i4), allocatable :: start(:)    !! (elements + 1)
    integer(i4), allocatable :: node(:)     !! node ids of all elements, VTK order
    integer(i4), allocatable :: hex8(:, :)  !! (8, elements) the same if all are hex8
    type(fem_group_type), allocatable :: group(:)
    integer(i4), allocatable :: number(:)   !! (nodes) id in the whole mesh, of a piece of one
    integer(i4) :: all_nodes = 0            !! of the whole mesh, of a piece of one
  contains
    procedure :: is_piece
    procedure :: number_of
    procedure :: place_of
    procedure :: total_nodes
  end type fem_mesh_type

  !> A load pattern (3, blocks) that follows a curve; curve 0 means constant.
  type :: fem_load_type
    integer(i4) :: curve = 0
    real(wp), allocatable :: force(:, :)  !! [N]
  end type fem_load_type

  !> Springs that tie points of facets to where they were (Robin) or to the ground.
  type :: fem_springs_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: node(:, :)      !! (facet nodes, n) blocks, any where weight = 0
    real(wp), allocatable :: weight(:, :)       !! (facet nodes, n) shape functions
    real(wp), allocatable :: stiffness(:, :, :) !! (3, 3, n) [N/m]
    logical, allocatable :: here(:)             !! (n) in this rank's matrix? Not given: all are
  end type fem_springs_type

  !> Named set of nodes that the port has selected.
  type :: fem_set_type
    character(len=name_length) :: name = ''
    integer(i4) :: role = role_report
    logical :: moves = .true.              !! the set acts on displacements
    integer(i4), allocatable :: node(:)
    integer(i4), allocatable :: phi(:)     !! blocks of the micro-rotations; none: size 0
    integer(i4), allocatable :: element(:) !! elements with a node of the set; found on request
  end type fem_set_type

  !> Everything that changes in time.
  type :: fem_state_type
    real(wp) :: time = 0.0_wp
    real(wp), allocatable :: u(:, :), v(:, :), a(:, :)  !! (3, blocks) [m], [m/s], [m/s^2]
    real(wp), allocatable :: external(:, :)             !! loads without reactions [N]
    real(wp), allocatable :: reaction(:, :)             !! on prescribed dofs [N]
    real(wp), allocatable :: tie(:, :)                  !! of the Robin springs at its end [N]
    real(wp), allocatable :: viscous(:, :)              !! C v [N]
  end type fem_state_type

  !> Energy ledger [J].
  type :: fem_energy_type
    real(wp) :: strain = 0.0_wp   !! now
    real(wp) :: kinetic = 0.0_wp  !! now
    real(wp) :: load = 0.0_wp     !! work of all loads so far, gravity included
    real(wp) :: gravity = 0.0_wp  !! of this, gravity
    real(wp) :: support = 0.0_wp  !! work of prescribed motions so far
    real(wp) :: spring = 0.0_wp   !! work of facet springs so far
    real(wp) :: damping = 0.0_wp  !! dissipated by dashpots and Rayleigh damping so far
    real(wp) :: numerical = 0.0_wp  !! dissipated by the time integration so far
    real(wp) :: start = 0.0_wp      !! kinetic energy of the initial velocities
    real(wp) :: plastic = 0.0_wp    !! dissipated by plastic flow so far
    real(wp) :: largest = 0.0_wp    !! size of the largest of these at any accepted state
    real(wp) :: liquid = 0.0_wp     !! elastic energy of the pore liquid now
    real(wp) :: darcy = 0.0_wp      !! dissipated by its flow so far
    real(wp) :: flow = 0.0_wp       !! work of pressures on what entered, and of weight on the flow
  contains
    procedure :: keep_largest
  end type fem_energy_type

contains

  !> Does it have the nodes of one rank's elements alone?
  pure logical function is_piece(self)
    class(fem_mesh_type), intent(in) :: self
    is_piece = allocated(self%number)
  end function is_piece

  !> Id of node i in the whole mesh.
  elemental integer(i4) function number_of(self, i)
    class(fem_mesh_type), intent(in) :: self
    integer(i4), intent(in) :: i
    number_of = i
    if (allocated(self%number) .and. i > 0) number_of = self%number(i)
  end function number_of

  !> Place here of a node of the whole mesh, 0 if it is not here.
  pure integer(i4) function place_of(self, number)
    class(fem_mesh_type), intent(in) :: self
    integer(i4), intent(in) :: number
    place_of = number
    if (allocated(self%number)) place_of = place_in(self%number, number)
  end function place_of

  !> Nodes of the whole mesh.
  pure integer(i4) function total_nodes(self)
    class(fem_mesh_type), intent(in) :: self
    total_nodes = merge(self%all_nodes, self%nodes, allocated(self%number))
  end function total_nodes

  !> Place of a number in a list that ascends, 0 if it is not there.
  pure integer(i4) function place_in(list, number) result(place)
    integer(i4), intent(in) :: list(:), number
    integer(i4) :: low, high
    place = 0
    if (size(list) == 0) return
    low = 1
    high = int(size(list), i4)
    do while (low < high)
      place = (low + high)/2
      if (list(place) < number) low = place + 1
      if (list(place) >= number) high = place
    end do
    place = merge(low, 0_i4, list(low) == number)
  end function place_in

  !> The state is accepted: what its ledger's closure is measured by.
  pure subroutine keep_largest(self)
    class(fem_energy_type), intent(inout) :: self
    self%largest = max(self%largest, abs(self%load), abs(self%support), abs(self%strain), &
                       abs(self%kinetic), abs(self%plastic), abs(self%liquid), abs(self%darcy), &
                       abs(self%flow))
  end subroutine keep_largest
end module fem_types
