!> The blocks that ranks share at their elements (MPI).
!!
!! Vectors of blocks are complete and the same bits on every rank. What elements add to them is a
!! part on each rank; `sum_up` makes them complete: neighbours exchange the blocks they share, every
!! holder adds the parts in the order of the ranks, and the owner of a block, the first rank that
!! holds it, sends it to the others.
module fem_halo
  use mpi, only: mpi_allgatherv, mpi_alltoallv, mpi_double_precision
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  implicit none
  private
  public :: fem_halo_type

  !> The blocks of this rank's elements, and the other ranks that hold them.
  type, extends(ranks_type) :: fem_halo_type
    integer(i4), allocatable :: common(:)     !! blocks that other ranks hold too, ascending
    integer(i4), allocatable :: first(:)      !! (0:ranks) of those shared with each rank, in
    integer(i4), allocatable :: shared(:)     !! this list, ascending
    integer(i4), allocatable :: first_own(:)  !! (0:ranks) of the blocks of each owner, in
    integer(i4), allocatable :: own(:)        !! this list of all blocks
    logical, allocatable :: mine(:)           !! (blocks) is this rank the owner?
  contains
    procedure :: sum_up
    procedure :: exchange
    procedure :: spread_out
    procedure :: owns
  end type fem_halo_type

contains

  !> Make a vector complete to which each rank has given the part of its elements.
  subroutine sum_up(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: v(:, :)  !! (components, blocks)
    if (self%ranks == 1) return
    call self%exchange(v)
    call self%spread_out(v)
  end subroutine sum_up

  !> Make it complete at the blocks of this rank's elements alone.
  subroutine exchange(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: v(:, :)
    real(wp), allocatable :: give(:, :), take(:, :), home(:, :)
    integer :: counts(0:self%ranks - 1), places(0:self%ranks - 1), status, m, r
    integer(i4) :: k
    if (self%ranks == 1) return
    m = size(v, 1)
    give = v(:, self%shared)
    home = v(:, self%common)
    allocate (take, mold=give)
    do r = 0, self%ranks - 1
      counts(r) = m*(self%first(r + 1) - self%first(r))
      places(r) = m*(self%first(r) - 1)
    end do
    call mpi_alltoallv(give, counts, places, mpi_double_precision, take, counts, places, &
                       mpi_double_precision, self%comm, status)
    v(:, self%common) = 0.0_wp
    do r = 0, self%ranks - 1
      if (r == self%rank) then
        do k = 1, size(self%common)
          v(:, self%common(k)) = v(:, self%common(k)) + home(:, k)
        end do
      end if
      do k = self%first(r), self%first(r + 1) - 1
        v(:, self%shared(k)) = v(:, self%shared(k)) + take(:, k)
      end do
    end do
  end subroutine exchange

  !> Every block as its owner has it.
  subroutine spread_out(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: v(:, :)
    real(wp), allocatable :: give(:, :), all(:, :)
    integer :: counts(0:self%ranks - 1), places(0:self%ranks - 1), status, m, r
    integer(i4) :: k
    if (self%ranks == 1) return
    m = size(v, 1)
    do r = 0, self%ranks - 1
      counts(r) = m*(self%first_own(r + 1) - self%first_own(r))
      places(r) = m*(self%first_own(r) - 1)
    end do
    give = v(:, self%own(self%first_own(self%rank):self%first_own(self%rank + 1) - 1))
    allocate (all(m, size(self%own)))
    call mpi_allgatherv(give, size(give), mpi_double_precision, all, counts, places, &
                        mpi_double_precision, self%comm, status)
    do k = 1, size(self%own)
      v(:, self%own(k)) = all(:, k)
    end do
  end subroutine spread_out

  !> Is this rank the owner of block i?
  elemental logical function owns(self, i)
    class(fem_halo_type), intent(in) :: self
    integer(i4), intent(in) :: i
    owns = .true.
    if (allocated(self%mine)) owns = self%mine(i)
  end function owns
end module fem_halo
