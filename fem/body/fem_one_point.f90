!> Internal forces of a whole mesh of one-point hexahedra without its stiffness: for explicit steps.
!! Elements are in chunks of `lanes`, chunks in shares: each thread owns the nodes of a range and
!! processes all elements that touch them, so that the sums have the same bits for any threads.
module fem_one_point
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4
  use fem_assembly, only: share_nodes, elements_at, fill_batch
  use fem_batch, only: fem_batch_type, batch_room, batch_shape
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_hourglass, only: lanes, one_point_data, one_point_force, one_point_size
  use fem_leap, only: least_shared
  use fem_sparse, only: fem_pattern_type
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_one_point_type

  !> The elements of one share.
  type :: share_type
    integer(i4) :: range(2) = 1                !! first node, and one past the last
    integer(i4) :: elements = 0
    integer(i4), allocatable :: node(:, :)     !! (8, elements)
    real(wp), allocatable :: data(:, :, :)     !! (lanes, one_point_size, chunks)
  end type share_type

  type :: fem_one_point_type
    logical :: ready = .false.
    type(share_type), allocatable :: share(:)
  contains
    procedure :: prepare
    procedure :: force
  end type fem_one_point_type

contains

  !> Gather constant data; ready only if all elements are of this formulation.
  subroutine prepare(self, mesh, dofs, elastic, pattern)
    class(fem_one_point_type), intent(inout) :: self
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_pattern_type), intent(in) :: pattern
    integer(i4), allocatable :: first(:)
    integer(i4) :: t

    self%ready = size(elastic%rule) == 1
    if (self%ready) self%ready = elastic%rule(1)%one_point
    if (allocated(self%share)) deallocate (self%share)
    if (.not. self%ready) return
    call share_nodes(dofs, pattern, omp_get_max_threads(), first)
    allocate (self%share(size(first) - 1))
    !$omp parallel do default(none) shared(self, mesh, elastic, first) private(t) &
    !$omp schedule(static, 1)
    do t = 1, size(self%share)
      call fill_share(mesh, elastic, first(t:t + 1), self%share(t))
    end do
    !$omp end parallel do
  end subroutine prepare

  subroutine fill_share(mesh, elastic, range, share)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: range(2)
    type(share_type), intent(inout) :: share
    type(fem_batch_type) :: batch
    integer(i4), allocatable :: chosen(:)
    integer(i4) :: i, c

    call elements_at(mesh, elastic, 1, range, chosen)
    share%range = range
    share%elements = size(chosen)
    allocate (share%node(8, share%elements))
    allocate (share%data(lanes, one_point_size, (share%elements + lanes - 1)/lanes))
    call batch_room(elastic%rule(1), elastic%rule(1)%at, batch)
    do i = 1, share%elements
      share%node(:, i) = mesh%node(mesh%start(chosen(i)):mesh%start(chosen(i)) + 7)
    end do
    do c = 1, size(share%data, 3)
      i = (c - 1)*lanes
      call fill_batch(mesh, elastic, chosen(i + 1:min(i + lanes, share%elements)), batch)
      call batch_shape(elastic%rule(1)%at, batch)
      call one_point_data(batch%x, batch%u(:, :, 1, :), batch%weight(:, 1), batch%moduli, &
                          batch%factor(:, 1), batch%share, share%data(:, :, c))
    end do
  end subroutine fill_share

  !> Internal forces f (3, nodes) [N] of displacements u [m].
  subroutine force(self, u, f)
    class(fem_one_point_type), intent(in) :: self
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: f(:, :)
    integer(i4) :: t
    !$omp parallel do default(none) shared(self, u, f) private(t) schedule(static, 1) &
    !$omp if(size(f, 2) > least_shared)
    do t = 1, size(self%share)
      call share_force(self%share(t), u, f)
    end do
    !$omp end parallel do
  end subroutine force

  subroutine share_force(share, u, f)
    type(share_type), intent(in) :: share
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: f(:, :)
    real(wp) :: moved(lanes, 3, 8), part(lanes, 3, 8)
    integer(i4) :: c, i, l, a, n
    logical :: all_mine

    f(:, share%range(1):share%range(2) - 1) = 0.0_wp
    all_mine = share%range(1) == 1 .and. share%range(2) > size(f, 2)
    moved = 0.0_wp
    do c = 1, size(share%data, 3)
      i = (c - 1)*lanes
      do l = 1, min(lanes, share%elements - i)
        do a = 1, 8
          n = share%node(a, i + l)
          moved(l, 1, a) = u(1, n)
          moved(l, 2, a) = u(2, n)
          moved(l, 3, a) = u(3, n)
        end do
      end do
      call one_point_force(share%data(:, :, c), moved, part)
      do l = 1, min(lanes, share%elements - i)
        do a = 1, 8
          n = share%node(a, i + l)
          if (.not. all_mine) then
            if (n < share%range(1) .or. n >= share%range(2)) cycle
          end if
          f(1, n) = f(1, n) + part(l, 1, a)
          f(2, n) = f(2, n) + part(l, 2, a)
          f(3, n) = f(3, n) + part(l, 3, a)
        end do
      end do
    end do
  end subroutine share_force
end module fem_one_point
