!> Work of a step: chunks of grains and their shares of it, and what a step adds to the ledger, in a
!! fixed order, so that the thread count changes no bit.
module dem_step_work
  use talus_kinds, only: wp, i4, i8
  use dem_state, only: dem_data_type, kind_free, lanes
  use dem_law_state, only: column_count, column_plastic
  use dem_integrate, only: work_count
  use dem_integration_block, only: integration_block_type
  use dem_surface_additional, only: add_all_work
  use dem_surface_motion, only: surface_columns
  implicit none
  private
  public :: step_memory_type, plan_work, settle_work, share_chunks, add_grain_work, &
    add_contact_work, chunk

  integer(i4), parameter :: chunk = lanes  !! grains in a unit of work

  !> What a region works on beside the system itself: memory that one call of take_steps leaves to
  !! the next. It carries no state.
  type :: step_memory_type
    type(integration_block_type), allocatable :: blocks(:)    !! of each chunk; the last chunk is
                                                              !! the planes'
    real(wp), allocatable :: started(:, :)        !! (work_count, chunks, then those of clumps) of
                                                  !! the first half [J]
    real(wp), allocatable :: finished(:, :)       !! (the same) of the second half [J]
    real(wp), allocatable :: travel(:)            !! (the same) since the list was made [m]
    integer(i4), allocatable :: load(:)           !! (chunks) work up to and with each chunk
  end type step_memory_type

contains

  !> Chunks of grains and how much work each is: a free grain counts ten, another one one.
  subroutine plan_work(d, work)
    type(dem_data_type), intent(in) :: d
    type(step_memory_type), intent(inout) :: work
    integer(i4) :: chunks, c, low, high, all

    chunks = (d%grains%n + chunk - 1)/chunk + 1
    if (allocated(work%load)) then
      if (size(work%load) /= chunks) deallocate (work%load, work%started, work%finished)
    end if
    if (allocated(work%blocks)) then
      if (size(work%blocks) /= chunks - 1) deallocate (work%blocks)
    end if
    if (.not. allocated(work%blocks)) allocate (work%blocks(chunks - 1))
    if (.not. allocated(work%load)) then
      if (allocated(work%travel)) deallocate (work%travel)
      all = chunks + (d%clumps%n + chunk - 1)/chunk
      allocate (work%load(chunks), work%travel(all))
      allocate (work%started(work_count, all), work%finished(work_count, all))
      work%started = 0.0_wp
      work%finished = 0.0_wp
    end if
    do c = 1, chunks
      low = (c - 1)*chunk + 1
      high = min(c*chunk, d%grains%n)
      work%load(c) = 1 + 9*count(d%grains%kind(low:high) == kind_free) + max(high - low + 1, 0)
      if (c > 1) work%load(c) = work%load(c) + work%load(c - 1)
    end do
  end subroutine plan_work

  !> Works of a step that is half done into the ledger, before the grains go to other chunks.
  subroutine settle_work(d, work, begun)
    type(dem_data_type), intent(inout) :: d
    type(step_memory_type), intent(inout) :: work
    logical, intent(in) :: begun  !! steps were taken before this one
    if (begun) call add_grain_work(d, work%finished)
    call add_grain_work(d, work%started)
    deallocate (work%load, work%started, work%finished)
  end subroutine settle_work

  !> Chunks low..high of one of the threads: runs of equal work.
  pure subroutine share_chunks(load, me, threads, low, high)
    integer(i4), intent(in) :: load(:)      !! running sum
    integer(i4), intent(in) :: me, threads  !! me from 0
    integer(i4), intent(out) :: low, high
    integer(i8) :: total
    total = load(size(load))
    low = 1 + count(load <= total*me/threads)
    high = count(load <= total*(me + 1)/threads)
  end subroutine share_chunks

  !> Chunk sums into the ledger, in the order of chunks.
  subroutine add_grain_work(d, work)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: work(:, :)
    real(wp) :: total(work_count)
    integer(i4) :: c
    total = 0.0_wp
    do c = 1, size(work, 2)
      total = total + work(:, c)
    end do
    d%ledger%gravity = d%ledger%gravity + total(1)
    d%ledger%external = d%ledger%external + total(2)
    d%ledger%background_damping = d%ledger%background_damping + total(3)
    d%ledger%boundary = d%ledger%boundary + total(4)
  end subroutine add_grain_work

  !> Block sums into the ledger, in the order of blocks.
  subroutine add_contact_work(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: total(column_count)
    integer(i4) :: k
    total = 0.0_wp
    if (allocated(d%pairs%share)) then
      do k = 1, d%pairs%blocks
        total = total + d%pairs%share(k)*d%pairs%columns(:, k)
      end do
    else
      do k = 1, d%pairs%blocks
        total = total + d%pairs%columns(:, k)
      end do
    end if
    if (d%surfaces%list%near > 0) total = total + surface_columns(d%surfaces)
    if (d%pairs%additional%active) call add_all_work(d)
    d%ledger%contact_damping = d%ledger%contact_damping + total(1)
    d%ledger%friction = d%ledger%friction + total(2)
    d%ledger%tangential_relaxation = d%ledger%tangential_relaxation + total(3)
    d%ledger%curvature = d%ledger%curvature + total(4)
    d%ledger%plastic = d%ledger%plastic + total(column_plastic)
    d%health%evaluations = d%health%evaluations + 1
  end subroutine add_contact_work
end module dem_step_work
