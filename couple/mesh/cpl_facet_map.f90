!> Ghost grains on facets of the solid: the position of each on its facet.
!!
!! x_g = sum_a N_a(xi, eta) x_a + offset, N_a the shape functions of the facet, of whatever kind;
!! cpl_transfer makes the operator between nodes and ghosts from it
!! (theory-coupling, Rotation and moments).
module cpl_facet_map
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_hash, only: hash_text
  use cpl_facet_search, only: facet_search_type
  use cpl_shapes, only: node_count, shapes_at
  implicit none
  private
  public :: facet_map_type

  real(wp), parameter :: identity_limit = 1.0e-12_wp
  integer(i4), parameter :: listed = 8                 !! ghosts named in a fault

  !> Facet, place on it and shape functions of each ghost.
  type :: facet_map_type
    integer(i4) :: ghosts = 0
    integer(i4) :: nodes = 0
    integer(i8), allocatable :: ghost_id(:)      !! ids of the grains
    integer(i8), allocatable :: node_id(:)       !! ids of the interface nodes, ascending
    integer(i4), allocatable :: facet(:)         !! of each ghost, from 1
    real(wp), allocatable :: natural(:, :)       !! xi, eta (2, ghosts)
    real(wp), allocatable :: offset(:, :)        !! ghost minus its point on the facet [m]
    real(wp), allocatable :: weight(:, :)        !! N_a (most nodes, ghosts), 0 beyond
    integer(i4), allocatable :: corner(:, :)     !! numbers in node_id (most nodes, ghosts),
                                                 !! the first again beyond
  contains
    procedure :: build
    procedure :: point_on_facet
    procedure :: number_nodes
    procedure :: identity_error
    procedure :: hash => map_hash
  end type facet_map_type

contains

  !> Find the facet of every ghost. Faults: I401 ghosts beside the facets, I402 no ghosts or facets.
  subroutine build(self, ids, x_ghost, facets, x_node, max_offset, errors)
    class(facet_map_type), intent(inout) :: self
    integer(i8), intent(in) :: ids(:)
    real(wp), intent(in) :: x_ghost(:, :)      !! (3, ghosts) [m]
    integer(i4), intent(in) :: facets(:, :)    !! (most, k) node ids from 1, 0 beyond
    real(wp), intent(in) :: x_node(:, :)       !! (3, nodes), all nodes of the mesh, by id [m]
    real(wp), intent(in) :: max_offset         !! [m], below 0: a share of the facet's size
    type(error_list_type), intent(inout) :: errors
    type(facet_search_type) :: search
    logical :: none(size(x_node, 2))
    integer(i4) :: g, n, number(size(x_node, 2))

    self%ghosts = size(ids)
    if (size(ids) == 0 .or. size(facets, 2) == 0) then
      call errors%add('I402', str(size(ids))//' ghosts and '//str(size(facets, 2))//' facets: '// &
                      'there is nothing to couple', '', 'check the groups that &facets names')
      return
    end if
    self%ghost_id = ids
    if (allocated(self%facet)) deallocate (self%facet, self%natural, self%offset, self%weight)
    allocate (self%facet(size(ids)), self%natural(2, size(ids)), self%offset(3, size(ids)), &
              self%weight(size(facets, 1), size(ids)))
    call search%make(facets, x_node, max_offset)
    do g = 1, size(ids)
      call search%locate(x_ghost(:, g), self%facet(g), self%natural(:, g))
      self%weight(:, g) = 0.0_wp
      if (self%facet(g) == 0) cycle
      n = node_count(facets(:, self%facet(g)))
      self%weight(:n, g) = shapes_at(n, self%natural(:, g))
      self%offset(:, g) = x_ghost(:, g) - self%point_on_facet(g, facets, x_node)
    end do
    if (any(self%facet == 0)) then
      call report_outside(ids, self%facet, x_ghost, search, errors)
      return
    end if
    none = .false.
    call self%number_nodes(facets, none, number)
  end subroutine build

  subroutine report_outside(ids, facet, x_ghost, search, errors)
    integer(i8), intent(in) :: ids(:)
    integer(i4), intent(in) :: facet(:)
    real(wp), intent(in) :: x_ghost(:, :)  !! (3, ghosts) [m]
    type(facet_search_type), intent(in) :: search
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: list
    integer(i4) :: g, n

    list = ''
    n = 0
    do g = 1, size(ids)
      if (facet(g) /= 0) cycle
      n = n + 1
      if (n > listed) cycle
      if (n > 1) list = list//', '
      list = list//'grain '//str(ids(g))//' ('// &
             str(search%distance(x_ghost(:, g)))//' m)'
    end do
    if (n > listed) list = list//', ...'
    call errors%add('I401', str(n)//' of '//str(size(ids))//' ghosts lie on no facet: '//list, '', &
                    'move the facets under the ghosts'' centres, or set &facets max_offset')
  end subroutine report_outside

  !> Number the interface nodes, ascending by id: those of the ghosts' facets and the further
  !! ones that are needed; `number` is 0 for all others.
  subroutine number_nodes(self, facets, needed, number)
    class(facet_map_type), intent(inout) :: self
    integer(i4), intent(in) :: facets(:, :)
    logical, intent(in) :: needed(:)        !! (all nodes)
    integer(i4), intent(out) :: number(:)   !! (all nodes)
    integer(i4) :: g, k, n

    number = merge(1, 0, needed)
    do g = 1, self%ghosts
      n = node_count(facets(:, self%facet(g)))
      number(facets(:n, self%facet(g))) = 1
    end do
    self%nodes = sum(number)
    if (allocated(self%node_id)) deallocate (self%node_id, self%corner)
    allocate (self%node_id(self%nodes), self%corner(size(facets, 1), self%ghosts))
    self%nodes = 0
    do k = 1, size(number)
      if (number(k) == 0) cycle
      self%nodes = self%nodes + 1
      number(k) = self%nodes
      self%node_id(self%nodes) = k
    end do
    do g = 1, self%ghosts
      n = node_count(facets(:, self%facet(g)))
      self%corner(:, g) = number(facets(1, self%facet(g)))
      self%corner(:n, g) = number(facets(:n, self%facet(g)))
    end do
  end subroutine number_nodes

  !> Where a ghost's facet is nearest to it [m].
  pure function point_on_facet(self, g, facets, x_node) result(x)
    class(facet_map_type), intent(in) :: self
    integer(i4), intent(in) :: g
    integer(i4), intent(in) :: facets(:, :)
    real(wp), intent(in) :: x_node(:, :)
    real(wp) :: x(3)
    integer(i4) :: a
    x = 0.0_wp
    do a = 1, node_count(facets(:, self%facet(g)))
      x = x + self%weight(a, g)*x_node(:, facets(a, self%facet(g)))
    end do
  end function point_on_facet

  !> Largest violation of sum N = 1 and of sum N x + offset = x_g, relative to the extent of the
  !! facets. Should be below 1e-12; N405 says so.
  subroutine identity_error(self, x_ghost, x_node, worst, errors)
    class(facet_map_type), intent(in) :: self
    real(wp), intent(in) :: x_ghost(:, :)  !! (3, ghosts) [m]
    real(wp), intent(in) :: x_node(:, :)   !! (3, all nodes) [m]
    real(wp), intent(out) :: worst
    type(error_list_type), intent(inout) :: errors
    real(wp) :: x(3, self%nodes), extent
    integer(i4) :: g

    x = x_node(:, self%node_id)
    extent = max(maxval(abs(x)), maxval(maxval(x, 2) - minval(x, 2)), tiny(1.0_wp))
    worst = maxval(abs(sum(self%weight, 1) - 1.0_wp))
    do g = 1, self%ghosts
      worst = max(worst, maxval(abs(matmul(x(:, self%corner(:, g)), self%weight(:, g)) &
                                    + self%offset(:, g) - x_ghost(:, g)))/extent)
    end do
    if (worst <= identity_limit) return
    call errors%add('N405', 'the facet map violates sum N = 1 or sum N x = x_g by '// &
                    str(worst), '', 'check the facets'' shape: a corner may be turned in')
  end subroutine identity_error

  !> Hash of the map: ids, nodes and the bits of the weights.
  pure function map_hash(self) result(hex)
    class(facet_map_type), intent(in) :: self
    character(len=16) :: hex
    character(len=:), allocatable :: text
    integer(i4) :: g, a, at

    allocate (character(len=self%ghosts*(1 + 2*size(self%weight, 1))*16) :: text)
    at = 0
    do g = 1, self%ghosts
      write (text(at + 1:at + 16), '(z16.16)') self%ghost_id(g)
      at = at + 16
      do a = 1, size(self%weight, 1)
        write (text(at + 1:at + 16), '(z16.16)') self%node_id(self%corner(a, g))
        write (text(at + 17:at + 32), '(z16.16)') transfer(self%weight(a, g), 0_i8)
        at = at + 32
      end do
    end do
    hex = hash_text(text)
  end function map_hash
end module cpl_facet_map
