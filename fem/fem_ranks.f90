!> The ranks that work on a run together (MPI): who they are, sums and decisions of all of them, and
!! the blocks that neighbours share. A run of one rank calls nothing of MPI here.
!!
!! Vectors of blocks are complete and the same bits on every rank. What elements add to them is a
!! part on each rank; `sum_up` makes them complete: neighbours exchange the blocks they share, every
!! holder adds the parts in the order of the ranks, and the owner of a block, the first rank that
!! holds it, tells the others.
module fem_ranks
  use mpi, only: mpi_comm_self, mpi_comm_world, mpi_comm_size, mpi_comm_rank, mpi_allreduce, &
    mpi_allgatherv, mpi_alltoallv, mpi_bcast, mpi_gatherv, mpi_gather, mpi_in_place, mpi_max, &
    mpi_min, mpi_sum, mpi_maxloc, mpi_integer, mpi_character, mpi_double_precision, &
    mpi_2double_precision, mpi_init, mpi_initialized, mpi_finalize, mpi_finalized, &
    mpi_comm_split_type, mpi_comm_type_shared, mpi_comm_free, mpi_info_null
  use talus_kinds, only: wp, i4
  use talus_system, only: environment, set_environment, clear_environment
  implicit none
  private
  public :: fem_ranks_type, fem_halo_type, join_ranks, start_mpi, leave_ranks

  !> Who works on the run.
  type :: fem_ranks_type
    integer(i4) :: rank = 0             !! of this process; rank 0 leads: it reads, writes, decides
    integer(i4) :: ranks = 1
    integer(i4) :: on_host = 1          !! ranks on this host
    integer :: comm = mpi_comm_self
  contains
    procedure :: leads
    procedure :: several
    procedure :: add_up
    procedure :: any_of
    procedure :: least
    procedure :: least_each
    procedure :: least_holder
    procedure :: most
    procedure :: largest
    procedure :: tell
    procedure :: tell_values
    procedure :: tell_vector
    procedure :: collect
  end type fem_ranks_type

  !> The blocks of this rank's elements, and who else holds them.
  type, extends(fem_ranks_type) :: fem_halo_type
    integer(i4), allocatable :: common(:)     !! blocks that others hold too, ascending
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

  !> Join the other ranks, if a launcher of MPI started this process as one of several.
  subroutine join_ranks(ranks)
    type(fem_ranks_type), intent(out) :: ranks
    integer :: status, comm, count
    if (.not. launched()) return
    call start_mpi()
    ranks%comm = mpi_comm_world
    call mpi_comm_size(ranks%comm, count, status)
    ranks%ranks = count
    call mpi_comm_rank(ranks%comm, count, status)
    ranks%rank = count
    if (ranks%ranks == 1) return
    call mpi_comm_split_type(mpi_comm_world, mpi_comm_type_shared, 0, mpi_info_null, comm, status)
    call mpi_comm_size(comm, count, status)
    ranks%on_host = count
    call mpi_comm_free(comm, status)
  end subroutine join_ranks

  !> Did a launcher of MPI start this process?
  logical function launched()
    character(len=*), parameter :: launcher(3) = [character(len=20) :: 'OMPI_COMM_WORLD_SIZE', &
      'PMIX_RANK', 'PMI_RANK']
    integer(i4) :: k
    launched = any([(len(environment(trim(launcher(k)))) > 0, k=1, size(launcher))])
  end function launched

  !> Outside a launcher of MPI OpenMPI is told that this process is alone: it then needs no daemon
  !! (which would outlive a kill) and starts in a third of the time. A plain step of Slurm (srun
  !! without --mpi) is none, but OpenMPI would take it for one and end: it does not get to see it.
  subroutine start_mpi()
    logical :: running
    integer :: status
    call mpi_initialized(running, status)
    if (running) return
    if (.not. launched()) then
      call clear_environment('SLURM_STEPID')
      call clear_environment('SLURM_STEP_ID')
      call set_environment('OMPI_MCA_ess_singleton_isolated', '1', .false.)
      call set_environment('OMPI_MCA_pml', 'ob1', .false.)
      call set_environment('OMPI_MCA_btl', 'self', .false.)
    end if
    call mpi_init(status)
  end subroutine start_mpi

  !> End MPI if it was started.
  subroutine leave_ranks()
    logical :: running, ended
    integer :: status
    call mpi_initialized(running, status)
    if (.not. running) return
    call mpi_finalized(ended, status)
    if (.not. ended) call mpi_finalize(status)
  end subroutine leave_ranks

  !> Is this the rank that reads decks, writes files and decides?
  pure logical function leads(self)
    class(fem_ranks_type), intent(in) :: self
    leads = self%rank == 0
  end function leads

  pure logical function several(self)
    class(fem_ranks_type), intent(in) :: self
    several = self%ranks > 1
  end function several

  !> Sums of some numbers over the ranks.
  subroutine add_up(self, values)
    class(fem_ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, values, size(values), mpi_double_precision, mpi_sum, &
                       self%comm, status)
  end subroutine add_up

  !> Does it hold on any rank?
  subroutine any_of(self, flag)
    class(fem_ranks_type), intent(in) :: self
    logical, intent(inout) :: flag
    integer :: number(1), status
    if (self%ranks == 1) return
    number = merge(1, 0, flag)
    call mpi_allreduce(mpi_in_place, number, 1, mpi_integer, mpi_max, self%comm, status)
    flag = number(1) > 0
  end subroutine any_of

  !> The least of a number.
  subroutine least(self, number)
    class(fem_ranks_type), intent(in) :: self
    integer(i4), intent(inout) :: number
    integer(i4) :: numbers(1)
    numbers = number
    call self%least_each(numbers)
    number = numbers(1)
  end subroutine least

  !> The least of each of some numbers.
  subroutine least_each(self, numbers)
    class(fem_ranks_type), intent(in) :: self
    integer(i4), intent(inout), contiguous :: numbers(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, numbers, size(numbers), mpi_integer, mpi_min, self%comm, &
                       status)
  end subroutine least_each

  !> The least of a number, and the first rank that has it.
  subroutine least_holder(self, number, holder)
    class(fem_ranks_type), intent(in) :: self
    integer(i4), intent(inout) :: number
    integer(i4), intent(out) :: holder
    integer(i4) :: mine
    mine = number
    call self%least(number)
    holder = merge(self%rank, huge(mine), mine == number)
    call self%least(holder)
  end subroutine least_holder

  !> The largest of each of some numbers.
  subroutine most(self, values)
    class(fem_ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, values, size(values), mpi_double_precision, mpi_max, &
                       self%comm, status)
  end subroutine most

  !> The largest value and its label; the least label of several.
  subroutine largest(self, value, label)
    class(fem_ranks_type), intent(in) :: self
    real(wp), intent(inout) :: value
    integer(i4), intent(inout) :: label
    real(wp) :: pair(2)
    integer :: status
    if (self%ranks == 1) return
    pair = [value, real(label, wp)]
    call mpi_allreduce(mpi_in_place, pair, 1, mpi_2double_precision, mpi_maxloc, self%comm, status)
    value = pair(1)
    label = nint(pair(2), i4)
  end subroutine largest

  !> The text of one rank.
  subroutine tell(self, from, text)
    class(fem_ranks_type), intent(in) :: self
    integer(i4), intent(in) :: from
    character(len=:), allocatable, intent(inout) :: text
    integer :: length(1), status
    if (self%ranks == 1) return
    if (self%rank == from) length = len(text)
    call mpi_bcast(length, 1, mpi_integer, from, self%comm, status)
    if (self%rank /= from) text = repeat(' ', length(1))
    if (length(1) > 0) call mpi_bcast(text, length(1), mpi_character, from, self%comm, status)
  end subroutine tell

  !> Some numbers of the leader.
  subroutine tell_values(self, values)
    class(fem_ranks_type), intent(in) :: self
    integer(i4), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_bcast(values, size(values), mpi_integer, 0, self%comm, status)
  end subroutine tell_values

  !> A vector of the leader.
  subroutine tell_vector(self, values)
    class(fem_ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_bcast(values, size(values), mpi_double_precision, 0, self%comm, status)
  end subroutine tell_vector

  !> Columns of all ranks on the leader, one rank after the other; nothing on the others.
  subroutine collect(self, part, all)
    class(fem_ranks_type), intent(in) :: self
    real(wp), intent(in), contiguous :: part(:, :)
    real(wp), allocatable, intent(out) :: all(:, :)
    integer :: counts(0:self%ranks - 1), places(0:self%ranks - 1), status, r
    call mpi_gather([size(part)], 1, mpi_integer, counts, 1, mpi_integer, 0, self%comm, status)
    places = 0
    if (.not. self%leads()) counts = 0
    do r = 1, self%ranks - 1
      places(r) = places(r - 1) + counts(r - 1)
    end do
    allocate (all(size(part, 1), merge(sum(counts)/size(part, 1), 0, self%leads())))
    call mpi_gatherv(part, size(part), mpi_double_precision, all, counts, places, &
                     mpi_double_precision, 0, self%comm, status)
  end subroutine collect

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
end module fem_ranks
