!> The ranks that work on a run together (MPI): their numbers and what they send each other.
!!
!! A run of one rank calls nothing of MPI here. Ranks that wait for their leader sleep: collectives
!! of MPI spin.
module talus_ranks
  use, intrinsic :: iso_c_binding, only: c_int
  use mpi, only: mpi_comm_self, mpi_comm_world, mpi_comm_size, mpi_comm_rank, mpi_allreduce, &
    mpi_allgather, mpi_alltoall, mpi_alltoallv, mpi_bcast, mpi_gather, mpi_gatherv, &
    mpi_in_place, mpi_max, mpi_min, mpi_maxloc, mpi_sum, mpi_integer, mpi_integer8, &
    mpi_character, &
    mpi_double_precision, mpi_2double_precision, mpi_init, mpi_initialized, mpi_finalize, &
    mpi_finalized, mpi_comm_split_type, mpi_comm_type_shared, mpi_comm_free, mpi_info_null, &
    mpi_ibcast, mpi_recv, mpi_send, mpi_test, mpi_status_ignore, &
    mpi_type_contiguous, mpi_type_commit, mpi_type_free
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_system, only: environment, set_environment, clear_environment
  implicit none
  private
  public :: ranks_type, join_ranks, start_mpi, leave_ranks, sum_of_columns

  integer(c_int), parameter :: pause = 100_c_int  !! between two checks of a rank that waits [us]
  integer(i4), parameter :: spins = 2000          !! checks before it sleeps
  integer(i4), parameter :: few = 512             !! values that are worth one message less
  integer(i8), parameter :: slab = 2_i8**27       !! words of a message: MPI counts by 32 bits
  character(len=1), parameter :: mark = achar(0)  !! ends each text of a fault

  !> Who works on the run.
  type :: ranks_type
    integer(i4) :: rank = 0     !! of this process; rank 0 leads: it reads, writes, decides
    integer(i4) :: ranks = 1
    integer(i4) :: on_host = 1  !! ranks on this host
    integer :: comm = mpi_comm_self
  contains
    procedure :: leads            !! (): is this the rank that leads?
    procedure :: several          !! (): more than one
    procedure :: await            !! (numbers): those of the leader; others sleep until they arrive
    procedure :: broadcast_numbers     !! (numbers): those of the leader
    procedure :: broadcast_values      !! (values): those of the leader
    procedure :: broadcast_words       !! (words): those of the leader
    procedure :: broadcast_text        !! (from, text): that of one rank
    procedure :: add_up           !! (values): sums over the ranks
    procedure :: add_in_order     !! (values): the same, added in the order of the ranks
    procedure :: any_of           !! (flag): does it hold on any rank?
    procedure :: most             !! (values): the largest of each
    procedure :: least            !! (values): the least of each
    procedure :: least_number     !! (number): the least of a whole number
    procedure :: least_numbers    !! (numbers): the least of each of some
    procedure :: least_holder     !! (number, holder): the least, and the first rank that has it
    procedure :: largest          !! (value, label): the largest and its label
    procedure :: collect          !! (row, table): rows of all ranks, on the leader
    procedure :: collect_columns  !! (part, all): as many columns as each has, on the leader
    procedure :: give_numbers     !! (to, numbers): a list for one rank, which takes it
    procedure :: take_numbers     !! (from, numbers): the list that a rank gives
    procedure :: give_values      !! (to, values): columns for one rank, which takes them
    procedure :: take_values      !! (from, values): the columns that a rank gives
    procedure :: trade            !! (rows, count, taken, came): rows for each rank
    procedure :: agree            !! (errors): the faults of the first rank that has some
  end type ranks_type

  interface
    integer(c_int) function c_usleep(microseconds) bind(c, name='usleep')
      import :: c_int
      integer(c_int), value, intent(in) :: microseconds
    end function c_usleep
  end interface

contains

  !> Join the other ranks, if a launcher of MPI started this process.
  subroutine join_ranks(ranks)
    type(ranks_type), intent(out) :: ranks
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

  !> Outside an MPI launcher OpenMPI is configured for a single process: it then needs no daemon
  !! (which would outlive a kill), starts in a third of the time, and makes no folder that several
  !! programs starting at once would make and remove for each other. A plain step of Slurm (srun
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
      call set_environment('OMPI_MCA_orte_create_session_dirs', '0', .false.)
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
    class(ranks_type), intent(in) :: self
    leads = self%rank == 0
  end function leads

  pure logical function several(self)
    class(ranks_type), intent(in) :: self
    several = self%ranks > 1
  end function several

  !> Numbers of the leader; the others sleep until it sends.
  subroutine await(self, numbers)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(inout), contiguous, asynchronous :: numbers(:)
    integer :: request, status, look
    integer(c_int) :: slept
    logical :: done
    call mpi_ibcast(numbers, size(numbers), mpi_integer, 0, self%comm, request, status)
    look = 0
    do
      call mpi_test(request, done, mpi_status_ignore, status)
      if (done) exit
      look = look + 1
      if (look > spins) slept = c_usleep(pause)
    end do
  end subroutine await

  subroutine broadcast_numbers(self, numbers)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(inout), contiguous :: numbers(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_bcast(numbers, size(numbers), mpi_integer, 0, self%comm, status)
  end subroutine broadcast_numbers

  subroutine broadcast_values(self, values)
    class(ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_bcast(values, size(values), mpi_double_precision, 0, self%comm, status)
  end subroutine broadcast_values

  subroutine broadcast_words(self, words)
    class(ranks_type), intent(in) :: self
    integer(i8), intent(inout), contiguous :: words(:)
    integer(i8) :: first, last
    integer :: status
    if (self%ranks == 1) return
    do first = 1, size(words, kind=i8), slab
      last = min(first + slab - 1, size(words, kind=i8))
      call mpi_bcast(words(first:last), int(last - first + 1), mpi_integer8, 0, self%comm, status)
    end do
  end subroutine broadcast_words

  subroutine broadcast_text(self, from, text)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(in) :: from
    character(len=:), allocatable, intent(inout) :: text
    integer :: length(1), status
    if (self%ranks == 1) return
    if (self%rank == from) length = len(text)
    call mpi_bcast(length, 1, mpi_integer, from, self%comm, status)
    if (self%rank /= from) text = repeat(' ', length(1))
    if (length(1) > 0) call mpi_bcast(text, length(1), mpi_character, from, self%comm, status)
  end subroutine broadcast_text

  subroutine add_up(self, values)
    class(ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, values, size(values), mpi_double_precision, mpi_sum, &
                       self%comm, status)
  end subroutine add_up

  !> Sums in the order of the ranks: every rank has the same bits. Many values are added up in
  !! pieces, one a rank, so that none gets those of all.
  subroutine add_in_order(self, values)
    class(ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    real(wp), allocatable :: parts(:, :), piece(:, :)
    integer(i4) :: n
    integer :: status
    if (self%ranks == 1 .or. size(values) == 0) return
    if (size(values)*(self%ranks - 2) <= few) then
      allocate (parts(size(values), self%ranks))
      call mpi_allgather(values, size(values), mpi_double_precision, parts, size(values), &
                         mpi_double_precision, self%comm, status)
      values = sum_of_columns(parts)
      return
    end if
    n = (size(values) + self%ranks - 1)/self%ranks
    allocate (parts(n, self%ranks), piece(n, self%ranks))
    parts = reshape(values, [n, self%ranks], pad=[0.0_wp])
    call mpi_alltoall(parts, n, mpi_double_precision, piece, n, mpi_double_precision, self%comm, &
                      status)
    piece(:, 1) = sum_of_columns(piece)
    call mpi_allgather(piece, n, mpi_double_precision, parts, n, mpi_double_precision, self%comm, &
                       status)
    values = reshape(parts, [size(values)])
  end subroutine add_in_order

  !> Columns added from the first to the last: what ranks have, in their order.
  pure function sum_of_columns(columns) result(total)
    real(wp), intent(in) :: columns(:, :)
    real(wp) :: total(size(columns, 1))
    integer(i4) :: r
    total = 0.0_wp
    do r = 1, size(columns, 2)
      total = total + columns(:, r)
    end do
  end function sum_of_columns

  !> Does it hold on any rank?
  subroutine any_of(self, flag)
    class(ranks_type), intent(in) :: self
    logical, intent(inout) :: flag
    integer :: number(1), status
    if (self%ranks == 1) return
    number = merge(1, 0, flag)
    call mpi_allreduce(mpi_in_place, number, 1, mpi_integer, mpi_max, self%comm, status)
    flag = number(1) > 0
  end subroutine any_of

  subroutine most(self, values)
    class(ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, values, size(values), mpi_double_precision, mpi_max, &
                       self%comm, status)
  end subroutine most

  subroutine least(self, values)
    class(ranks_type), intent(in) :: self
    real(wp), intent(inout), contiguous :: values(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, values, size(values), mpi_double_precision, mpi_min, &
                       self%comm, status)
  end subroutine least

  !> The least of a whole number.
  subroutine least_number(self, number)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(inout) :: number
    integer(i4) :: numbers(1)
    numbers = number
    call self%least_numbers(numbers)
    number = numbers(1)
  end subroutine least_number

  !> The least of each of some numbers.
  subroutine least_numbers(self, numbers)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(inout), contiguous :: numbers(:)
    integer :: status
    if (self%ranks == 1) return
    call mpi_allreduce(mpi_in_place, numbers, size(numbers), mpi_integer, mpi_min, self%comm, &
                       status)
  end subroutine least_numbers

  !> The least of a number, and the first rank that has it.
  subroutine least_holder(self, number, holder)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(inout) :: number
    integer(i4), intent(out) :: holder
    integer(i4) :: mine
    mine = number
    call self%least_number(number)
    holder = merge(self%rank, huge(mine), mine == number)
    call self%least_number(holder)
  end subroutine least_holder

  !> The largest value and its label; the least label of several.
  subroutine largest(self, value, label)
    class(ranks_type), intent(in) :: self
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

  !> A row of each rank, on the leader in the order of the ranks.
  subroutine collect(self, row, table)
    class(ranks_type), intent(in) :: self
    real(wp), intent(in), contiguous :: row(:)
    real(wp), allocatable, intent(out) :: table(:, :)  !! (size(row), ranks), empty elsewhere
    integer :: status
    allocate (table(size(row), merge(self%ranks, 0, self%leads())))
    call mpi_gather(row, size(row), mpi_double_precision, table, size(row), mpi_double_precision, &
                    0, self%comm, status)
  end subroutine collect

  !> Columns of all ranks on the leader, one rank after the other; nothing on the others.
  subroutine collect_columns(self, part, all)
    class(ranks_type), intent(in) :: self
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
  end subroutine collect_columns

  !> A list for one rank.
  subroutine give_numbers(self, to, numbers)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(in) :: to
    integer(i4), intent(in), contiguous :: numbers(:)
    integer :: status
    call mpi_send([size(numbers)], 1, mpi_integer, to, 0, self%comm, status)
    call mpi_send(numbers, size(numbers), mpi_integer, to, 0, self%comm, status)
  end subroutine give_numbers

  !> The list that a rank gives.
  subroutine take_numbers(self, from, numbers)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(in) :: from
    integer(i4), allocatable, intent(out) :: numbers(:)
    integer :: length(1), status
    call mpi_recv(length, 1, mpi_integer, from, 0, self%comm, mpi_status_ignore, status)
    allocate (numbers(length(1)))
    call mpi_recv(numbers, length(1), mpi_integer, from, 0, self%comm, mpi_status_ignore, status)
  end subroutine take_numbers

  !> Columns for one rank, which knows their shape.
  subroutine give_values(self, to, values)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(in) :: to
    real(wp), intent(in), contiguous :: values(:, :)
    integer :: status
    call mpi_send(values, size(values), mpi_double_precision, to, 0, self%comm, status)
  end subroutine give_values

  !> The columns that a rank gives.
  subroutine take_values(self, from, values)
    class(ranks_type), intent(in) :: self
    integer(i4), intent(in) :: from
    real(wp), intent(out), contiguous :: values(:, :)
    integer :: status
    call mpi_recv(values, size(values), mpi_double_precision, from, 0, self%comm, &
                  mpi_status_ignore, status)
  end subroutine take_values

  !> Send rows to their ranks; received rows are ordered by their sender.
  subroutine trade(self, rows, count, taken, came)
    class(ranks_type), intent(in) :: self
    real(wp), intent(in), contiguous :: rows(:, :)      !! ordered by the rank they go to
    integer(i4), intent(in) :: count(0:)                !! rows for each rank
    real(wp), allocatable, intent(out) :: taken(:, :)
    integer(i4), intent(out) :: came(0:self%ranks - 1)  !! rows from each rank
    integer :: give(0:self%ranks - 1), take(0:self%ranks - 1), row, status
    integer(i4) :: r
    call mpi_alltoall(count, 1, mpi_integer, came, 1, mpi_integer, self%comm, status)
    allocate (taken(size(rows, 1), sum(came)))
    give = 0
    take = 0
    do r = 1, self%ranks - 1
      give(r) = give(r - 1) + count(r - 1)
      take(r) = take(r - 1) + came(r - 1)
    end do
    call mpi_type_contiguous(size(rows, 1), mpi_double_precision, row, status)
    call mpi_type_commit(row, status)
    call mpi_alltoallv(rows, count, give, row, taken, came, take, row, self%comm, status)
    call mpi_type_free(row, status)
  end subroutine trade

  !> Every rank has the faults of the first rank that has some.
  subroutine agree(self, errors)
    class(ranks_type), intent(in) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    real(wp) :: first(1)
    integer(i4) :: k
    if (self%ranks == 1) return
    first = merge(real(self%rank, wp), huge(1.0_wp), errors%any())
    call self%least(first)
    if (first(1) > self%ranks) return
    text = ''
    if (nint(first(1)) == self%rank) then
      do k = 1, errors%count
        associate (e => errors%item(k))
          text = text//e%code//mark//e%message//mark//e%place//mark//e%hint//mark
        end associate
      end do
    end if
    call self%broadcast_text(nint(first(1), i4), text)
    if (nint(first(1)) == self%rank) return
    call errors%clear()
    do while (len(text) > 0)
      call take_fault(text, errors)
    end do
  end subroutine agree

  !> The first fault of a text.
  subroutine take_fault(text, errors)
    character(len=:), allocatable, intent(inout) :: text
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: ends(0:4), k
    ends(0) = 0
    do k = 1, 4
      ends(k) = ends(k - 1) + index(text(ends(k - 1) + 1:), mark)
    end do
    call errors%add(text(:ends(1) - 1), text(ends(1) + 1:ends(2) - 1), &
                    text(ends(2) + 1:ends(3) - 1), text(ends(3) + 1:ends(4) - 1))
    text = text(ends(4) + 1:)
  end subroutine take_fault
end module talus_ranks
