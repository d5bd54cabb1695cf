!> The blocks that ranks share at their elements (MPI).
!!
!! Vectors of blocks are complete and the same bits on every rank, or `dealt`: each rank has the
!! blocks of its elements alone, those that several hold with the same bits. What elements add to
!! them is a part on each rank; `sum_up` makes them complete: neighbours exchange the blocks they
!! share, and every holder adds the parts in the order of the ranks. Where vectors are not dealt
!! the owner of a block, the first rank that holds it, sends it to the others. Sums over blocks
!! that are dealt count each at its owner.
module fem_halo
  use mpi, only: mpi_allgatherv, mpi_alltoallv, mpi_double_precision, mpi_integer
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
    logical :: dealt = .false.                !! vectors have this rank's blocks alone
    integer(i4), allocatable :: owner(:)      !! (blocks) rank of each, of dealt ones
  contains
    procedure :: sum_up
    procedure :: exchange
    procedure :: spread_out
    procedure :: owns
    procedure :: counts
    procedure :: own_blocks
    procedure :: rows
    procedure :: total
    procedure :: total_of
    procedure :: highest
    procedure :: anywhere
    procedure :: extent
    procedure :: least_shared
  end type fem_halo_type

contains

  !> Make a vector complete to which each rank has given the part of its elements.
  subroutine sum_up(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: v(:, :)  !! (components, blocks)
    if (self%ranks == 1) return
    call self%exchange(v)
    if (.not. self%dealt) call self%spread_out(v)
  end subroutine sum_up

  !> Make it complete at the blocks of this rank's elements alone.
  subroutine exchange(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: v(:, :)
    real(wp), allocatable :: take(:, :), home(:, :)
    integer :: r
    integer(i4) :: k
    if (self%ranks == 1) return
    home = v(:, self%common)
    call swap(self, v, take)
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

  !> What the other holders have in the shared blocks.
  subroutine swap(self, v, take)
    type(fem_halo_type), intent(in) :: self
    real(wp), intent(in) :: v(:, :)
    real(wp), allocatable, intent(out) :: take(:, :)
    real(wp) :: give(size(v, 1), size(self%shared))
    integer :: counts(0:self%ranks - 1), places(0:self%ranks - 1), status, m, r
    m = size(v, 1)
    give = v(:, self%shared)
    allocate (take, mold=give)
    do r = 0, self%ranks - 1
      counts(r) = m*(self%first(r + 1) - self%first(r))
      places(r) = m*(self%first(r) - 1)
    end do
    call mpi_alltoallv(give, counts, places, mpi_double_precision, take, counts, places, &
                       mpi_double_precision, self%comm, status)
  end subroutine swap

  !> Every block as its owner has it.
  subroutine spread_out(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: v(:, :)
    real(wp), allocatable :: give(:, :), all(:, :)
    integer :: counts(0:self%ranks - 1), places(0:self%ranks - 1), status, m, r
    integer(i4) :: k
    if (self%ranks == 1) return
    if (self%dealt) then
      call take_from_owners(self, v)
      return
    end if
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

  !> The same of dealt blocks.
  subroutine take_from_owners(self, v)
    type(fem_halo_type), intent(in) :: self
    real(wp), intent(inout) :: v(:, :)
    real(wp), allocatable :: take(:, :)
    integer(i4) :: r, k
    call swap(self, v, take)
    do r = 0, self%ranks - 1
      do k = self%first(r), self%first(r + 1) - 1
        if (self%owner(self%shared(k)) == r) v(:, self%shared(k)) = take(:, k)
      end do
    end do
  end subroutine take_from_owners

  !> Is this rank the owner of block i?
  elemental logical function owns(self, i)
    class(fem_halo_type), intent(in) :: self
    integer(i4), intent(in) :: i
    owns = .true.
    if (allocated(self%mine)) owns = self%mine(i)
  end function owns

  !> Does block i count here in sums over all blocks?
  elemental logical function counts(self, i)
    class(fem_halo_type), intent(in) :: self
    integer(i4), intent(in) :: i
    counts = .true.
    if (self%dealt) counts = self%mine(i)
  end function counts

  !> The blocks that this rank owns, ascending.
  pure function own_blocks(self) result(list)
    class(fem_halo_type), intent(in) :: self
    integer(i4), allocatable :: list(:)
    if (self%dealt) then
      list = self%own
    else
      list = self%own(self%first_own(self%rank):self%first_own(self%rank + 1) - 1)
    end if
  end function own_blocks

  !> Place of each block in the order of the owners, from 0.
  function rows(self) result(place)
    class(fem_halo_type), intent(in) :: self
    integer(i4) :: place(size(self%mine))
    real(wp) :: values(1, size(self%mine))
    integer(i4) :: i
    if (.not. self%dealt) then
      place(self%own) = [(i - 1, i=1, size(self%own))]
      return
    end if
    values = 0.0_wp
    values(1, self%own) = [(real(self%first_own(self%rank) + i - 2, wp), i=1, size(self%own))]
    call self%spread_out(values)
    place = nint(values(1, :), i4)
  end function rows

  !> Sums over the blocks of each rank to those over all: added in the order of the ranks where
  !! blocks are dealt; where they are not every rank has them.
  subroutine total(self, values)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    if (self%dealt) call self%add_in_order(values)
  end subroutine total

  !> Sum of the entries of (components, blocks) values, over all blocks.
  real(wp) function total_of(self, v)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(in) :: v(:, :)
    real(wp) :: sums(1)
    if (self%dealt) then
      sums = sum(v(:, self%own))
      call self%add_in_order(sums)
    else
      sums = sum(v)
    end if
    total_of = sums(1)
  end function total_of

  !> The largest of a value over all blocks from that of each rank.
  subroutine highest(self, value)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(inout) :: value
    real(wp) :: values(1)
    if (.not. self%dealt) return
    values = value
    call self%most(values)
    value = values(1)
  end subroutine highest

  !> Does it hold at any block?
  subroutine anywhere(self, flag)
    class(fem_halo_type), intent(in) :: self
    logical, intent(inout) :: flag
    if (self%dealt) call self%any_of(flag)
  end subroutine anywhere

  !> The longest side of the box around points (3, n) of all ranks [m].
  real(wp) function extent(self, x)
    class(fem_halo_type), intent(in) :: self
    real(wp), intent(in) :: x(:, :)
    real(wp) :: ends(6)
    ends = [maxval(x, 2), -minval(x, 2)]
    if (self%dealt) call self%most(ends)
    extent = maxval(ends(:3) + ends(4:))
  end function extent

  !> The least of the numbers that the holders of each block have.
  subroutine least_shared(self, numbers)
    class(fem_halo_type), intent(in) :: self
    integer(i4), intent(inout) :: numbers(:)
    integer(i4) :: give(size(self%shared)), take(size(self%shared))
    integer :: counts(0:self%ranks - 1), status
    integer(i4) :: k
    if (.not. self%dealt) then
      call self%least_numbers(numbers)
      return
    end if
    give = numbers(self%shared)
    counts = self%first(1:) - self%first(:self%ranks - 1)
    call mpi_alltoallv(give, counts, self%first(:self%ranks - 1) - 1, mpi_integer, take, counts, &
                       self%first(:self%ranks - 1) - 1, mpi_integer, self%comm, status)
    do k = 1, size(take)
      numbers(self%shared(k)) = min(numbers(self%shared(k)), take(k))
    end do
  end subroutine least_shared
end module fem_halo
