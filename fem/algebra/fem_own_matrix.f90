!> The part of a matrix between the blocks of one rank's elements: what elements of
!! other ranks add there is received from them. Preconditioners by ranks use it.
module fem_own_matrix
  use mpi, only: mpi_alltoall, mpi_alltoallv, mpi_double_precision, mpi_integer
  use talus_kinds, only: wp, i4
  use fem_sparse, only: fem_pattern_type, place
  implicit none
  private
  public :: own_matrix

contains

  !> The matrix between the blocks of this rank's elements, complete where these couple them. All
  !! ranks call it together.
  subroutine own_matrix(pattern, k, whole)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)                 !! (3, 3, entries) of this rank's elements
    real(wp), allocatable, intent(out) :: whole(:, :, :)
    integer(i4), allocatable :: pair(:, :), got_pair(:, :)
    real(wp), allocatable :: value(:, :), got_value(:, :)
    integer :: counts(0:pattern%halo%ranks - 1), got(0:pattern%halo%ranks - 1)
    integer :: status
    integer(i4) :: n, p, r, last

    allocate (whole, source=k)
    call choose_pairs(pattern, k, counts, pair, value)
    call mpi_alltoall(counts, 1, mpi_integer, got, 1, mpi_integer, pattern%halo%comm, status)
    allocate (got_pair(2, sum(got)), got_value(9, sum(got)))
    call mpi_alltoallv(pair, 2*counts, 2*starts(counts), mpi_integer, got_pair, 2*got, &
                       2*starts(got), mpi_integer, pattern%halo%comm, status)
    call mpi_alltoallv(value, 9*counts, 9*starts(counts), mpi_double_precision, got_value, 9*got, &
                       9*starts(got), mpi_double_precision, pattern%halo%comm, status)
    last = 0
    do r = 0, pattern%halo%ranks - 1
      associate (shared => pattern%halo%shared(pattern%halo%first(r):))
        do n = last + 1, last + got(r)
          p = place(pattern, shared(got_pair(1, n)), shared(got_pair(2, n)))
          if (p > 0) whole(:, :, p) = whole(:, :, p) + reshape(got_value(:, n), [3, 3])
        end do
      end associate
      last = last + got(r)
    end do
  end subroutine own_matrix

  !> What this rank has between blocks that it shares with each other one; these go by their places
  !! in what the two share, which both have in the same order.
  subroutine choose_pairs(pattern, k, counts, pair, value)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)
    integer, intent(out) :: counts(0:)
    integer(i4), allocatable, intent(out) :: pair(:, :)
    real(wp), allocatable, intent(out) :: value(:, :)
    integer(i4) :: at(pattern%nodes)  !! place in what is shared with a rank, 0: not shared
    integer(i4), allocatable :: most(:, :), entry(:)
    integer(i4) :: n, i, p, r, l
    associate (list => pattern%halo%shared)
      n = int(sum(pattern%start(list + 1) - pattern%start(list)), i4)
    end associate
    allocate (most(2, n), entry(n))
    n = 0
    counts = 0
    do r = 0, size(counts) - 1
      at = 0
      do l = pattern%halo%first(r), pattern%halo%first(r + 1) - 1
        at(pattern%halo%shared(l)) = l - pattern%halo%first(r) + 1
      end do
      do l = pattern%halo%first(r), pattern%halo%first(r + 1) - 1
        i = pattern%halo%shared(l)
        do p = pattern%start(i), pattern%start(i + 1) - 1
          if (at(pattern%column(p)) == 0) cycle
          n = n + 1
          counts(r) = counts(r) + 1
          most(:, n) = [at(i), at(pattern%column(p))]
          entry(n) = p
        end do
      end do
    end do
    allocate (pair, source=most(:, :n))
    allocate (value(9, n))
    do l = 1, n
      value(:, l) = reshape(k(:, :, entry(l)), [9])
    end do
  end subroutine choose_pairs

  !> Number of entries before those of each rank.
  pure function starts(counts)
    integer, intent(in) :: counts(:)
    integer :: starts(size(counts)), r
    starts(1) = 0
    do r = 2, size(counts)
      starts(r) = starts(r - 1) + counts(r - 1)
    end do
  end function starts
end module fem_own_matrix
