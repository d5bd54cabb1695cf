!> Forces of a few elements as an affine map of the displacements, f = f0 + K u, made once: for a
!! partner that requests them far more often than the body steps.
!!
!! The maps are found by evaluating the elements and so include all their parts; laws with
!! a state have none. Elements of one shape and stiffness share a map.
module fem_edge
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_recover, only: element_forces, add_element_forces
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_edge_type

  real(wp), parameter :: alike = 1.0e-13_wp  !! of the largest entry: rounding of the coordinates

  type :: fem_edge_type
    logical :: ready = .false.
    integer(i4), allocatable :: start(:)  !! (elements + 1) first of their blocks
    integer(i4), allocatable :: block(:)  !! of all elements
    integer(i4), allocatable :: at(:)     !! (elements) first entry of k
    real(wp), allocatable :: k(:)         !! maps, (3 blocks)^2 each, column by column [N/m, N, N m]
    real(wp), allocatable :: f0(:, :)     !! (3, all blocks) at zero displacements [N], [N m]
    integer(i4), allocatable :: of(:)     !! the blocks of all elements, each once
    real(wp), allocatable :: f(:, :)      !! (3, all blocks) what `force` found
  contains
    procedure :: build
    procedure :: force
  end type fem_edge_type

contains

  !> The maps of listed elements.
  subroutine build(self, mesh, dofs, elastic, list)
    class(fem_edge_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: list(:)
    real(wp), dimension(3, dofs%blocks) :: u, f
    real(wp), allocatable :: map(:, :)
    integer(i4) :: first(size(list) + 1)  ! entry of k of each map that differs, and behind the last
    integer(i4) :: k, n, maps
    logical :: touched(dofs%blocks)

    if (allocated(self%start)) deallocate (self%start, self%block, self%at, self%k, self%f0)
    allocate (self%start(size(list) + 1), self%at(size(list)), self%f0(3, dofs%blocks), self%k(0))
    u = 0.0_wp
    call element_forces(mesh, dofs, elastic, u, list, self%f0)
    call list_blocks(self, dofs, list)
    maps = 0
    first(1) = 1
    do k = 1, size(list)
      n = 3*(self%start(k + 1) - self%start(k))
      allocate (map(n, n))
      call map_of(mesh, dofs, elastic, list(k), u, f, map)
      self%at(k) = place_of(self%k, first(:maps + 1), reshape(map, [n*n]))
      if (self%at(k) == first(maps + 1)) then
        maps = maps + 1
        first(maps + 1) = first(maps) + n*n
        call keep(self%k, first(maps), reshape(map, [n*n]))
      end if
      deallocate (map)
    end do
    self%k = self%k(:first(maps + 1) - 1)
    touched = .false.
    touched(self%block) = .true.
    self%of = pack([(k, k=1, dofs%blocks)], touched)
    self%f = self%f0
    self%ready = .true.
  end subroutine build

  !> Blocks of the elements, one element after the other.
  pure subroutine list_blocks(self, dofs, list)
    type(fem_edge_type), intent(inout) :: self
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: list(:)
    integer(i4) :: k
    self%start(1) = 1
    do k = 1, size(list)
      self%start(k + 1) = self%start(k) + size(blocks_of(dofs, list(k)))
    end do
    allocate (self%block(self%start(size(list) + 1) - 1))
    do k = 1, size(list)
      self%block(self%start(k):self%start(k + 1) - 1) = blocks_of(dofs, list(k))
    end do
  end subroutine list_blocks

  !> Append a map; the storage doubles when it is full.
  pure subroutine keep(k, at, map)
    real(wp), allocatable, intent(inout) :: k(:)
    integer(i4), intent(in) :: at  !! first entry
    real(wp), intent(in) :: map(:)
    real(wp), allocatable :: larger(:)
    if (at + size(map) - 1 > size(k)) then
      allocate (larger(max(2*size(k), at + size(map) - 1)))
      larger(:at - 1) = k(:at - 1)
      call move_alloc(larger, k)
    end if
    k(at:at + size(map) - 1) = map
  end subroutine keep

  !> Forces of one element for a unit of each of its degrees of freedom. Vectors of all blocks are
  !! handed in: u is zero, and of f only what the element has is touched.
  subroutine map_of(mesh, dofs, elastic, e, u, f, map)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(inout) :: u(:, :), f(:, :)  !! (3, all blocks)
    real(wp), intent(out) :: map(:, :)           !! (3 blocks, 3 blocks)
    integer(i4), allocatable :: block(:)
    real(wp), allocatable :: rest(:, :)
    integer(i4) :: a, c
    block = blocks_of(dofs, e)
    f(:, block) = 0.0_wp
    call add_element_forces(mesh, dofs, elastic, u, e, f)
    rest = f(:, block)
    do a = 1, size(block)
      do c = 1, 3
        f(:, block) = 0.0_wp
        u(c, block(a)) = 1.0_wp
        call add_element_forces(mesh, dofs, elastic, u, e, f)
        u(c, block(a)) = 0.0_wp
        map(:, 3*(a - 1) + c) = reshape(f(:, block) - rest, [3*size(block)])
      end do
    end do
  end subroutine map_of

  !> Position of such a map among those stored, or behind all.
  pure integer(i4) function place_of(k, first, map) result(at)
    real(wp), intent(in) :: k(:)
    integer(i4), intent(in) :: first(:)  !! entry of each map, and behind the last
    real(wp), intent(in) :: map(:)
    real(wp) :: limit
    integer(i4) :: m
    limit = alike*maxval(abs(map))
    do m = 1, size(first) - 1
      at = first(m)
      if (first(m + 1) - at /= size(map)) cycle
      if (all(abs(k(at:at + size(map) - 1) - map) <= limit)) return
    end do
    at = first(size(first))
  end function place_of

  !> Blocks of an element, each once.
  pure function blocks_of(dofs, e) result(block)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: e
    integer(i4), allocatable :: block(:)
    integer(i4) :: a
    associate (all_of => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      block = pack(all_of, [(.not. any(all_of(:a - 1) == all_of(a)), a=1, size(all_of))])
    end associate
  end function blocks_of

  !> Their forces at displacements u, in f: of the blocks of these elements; zero elsewhere.
  pure subroutine force(self, u)
    class(fem_edge_type), intent(inout) :: self
    real(wp), intent(in) :: u(:, :)
    integer(i4) :: k, e
    do k = 1, size(self%of)
      self%f(:, self%of(k)) = self%f0(:, self%of(k))
    end do
    do e = 1, size(self%start) - 1
      call add_element(self%block(self%start(e):self%start(e + 1) - 1), &
                       3*(self%start(e + 1) - self%start(e)), &
                       self%k(self%at(e):), u, self%f)
    end do
  end subroutine force

  pure subroutine add_element(block, n, k, u, f)
    integer(i4), intent(in) :: block(:), n
    real(wp), intent(in) :: k(n, n)
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(inout) :: f(:, :)
    real(wp) :: total(n), part
    integer(i4) :: a, c
    total = 0.0_wp
    do a = 1, size(block)
      do c = 1, 3
        part = u(c, block(a))
        total = total + k(:, 3*(a - 1) + c)*part
      end do
    end do
    do a = 1, size(block)
      f(:, block(a)) = f(:, block(a)) + total(3*a - 2:3*a)
    end do
  end subroutine add_element
end module fem_edge
