!> Orders of the leader to the ranks, and what each rank, the leader too, does with its part on some
!! of them.
module dem_rank_commands
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  use talus_system, only: memory_most
  use dem_state, only: dem_data_type
  use dem_received_contacts, only: adopt_contacts, give_results
  use dem_distribute, only: hand_out
  use dem_migrate, only: share_out
  use dem_pairs, only: build_pairs
  use dem_record_heap, only: record_heap_type
  use dem_surface_search, only: list_near
  implicit none
  private
  public :: order_start, order_step, order_look, order_leave, order_targets, order_loads, &
    order_reset, order_slow, order_glance, order_grains, order_contacts, order_records, &
    order_fresh, order_renew, order_weigh, order_again, order_add, order_adopt, order_balance
  public :: begin_part, adopt_kept, weight_of

  integer(i4), parameter :: order_start = 1, order_step = 2, order_look = 3, order_leave = 4, &
    order_targets = 5, order_loads = 6, order_reset = 7, order_slow = 8, order_glance = 9, &
    order_grains = 10, order_contacts = 11, order_records = 12, order_fresh = 13, &
    order_renew = 14, order_weigh = 15, order_again = 16, &
    order_add = 17, order_adopt = 18, order_balance = 19

contains

  !> This rank's part from what the leader has.
  subroutine begin_part(team, part, bare)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part  !! of the leader the whole
    logical, intent(in) :: bare                 !! contacts come afterwards
    real(wp), allocatable :: contacts(:, :)
    part%halo%cut = .false.
    call hand_out(team, part)
    call share_out(part, contacts)
    if (.not. bare) call list_part(part, contacts)
  end subroutine begin_part

  !> The list of a part, with what these contacts keep.
  subroutine list_part(d, contacts)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: contacts(:, :)  !! see dem_records
    call build_pairs(d%pairs, d%grains, d%planes, d%weights, d%par%ghost_pairs, d%cell)
    call give_results(d, contacts)
    if (d%surfaces%n > 0) call list_near(d)
  end subroutine list_part

  !> All contacts of a checkpoint have come by: the list of a part with those that were kept.
  subroutine adopt_kept(kept, part)
    type(record_heap_type), intent(inout) :: kept
    type(dem_data_type), intent(inout) :: part
    real(wp), allocatable :: contacts(:, :)
    call kept%take(part, contacts)
    call adopt_contacts(part, contacts)
    call list_part(part, contacts)
  end subroutine adopt_kept

  !> Most memory that this process has had [bytes], its grains, mirrors, candidate pairs.
  function weight_of(part) result(row)
    type(dem_data_type), intent(in) :: part
    real(wp) :: row(4)
    row = [real(memory_most(), wp), real(part%halo%own, wp), real(part%halo%mirrors, wp), &
           real(part%pairs%count, wp)]
  end function weight_of
end module dem_rank_commands
