!> Commands of the leader to the ranks, and how each rank, including the leader, executes some of
!! them.
module dem_rank_commands
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  use talus_system, only: memory_most
  use dem_state, only: dem_data_type
  use dem_received_contacts, only: receive_contacts, give_results
  use dem_distribute, only: distribute
  use dem_migrate, only: share_out
  use dem_pairs, only: build_pairs
  use dem_record_heap, only: record_heap_type
  use dem_surface_search, only: list_near
  implicit none
  private
  public :: command_start, command_step, command_gather, command_leave, command_targets, &
    command_loads, &
    command_reset, command_slow, command_glance, command_grains, command_contacts, &
    command_records, &
    command_fresh, command_renew, command_weigh, command_again, command_add, command_receive, &
    command_balance
  public :: begin_part, receive_kept, weight_of

  integer(i4), parameter :: command_start = 1, command_step = 2, command_gather = 3, &
    command_leave = 4, &
    command_targets = 5, command_loads = 6, command_reset = 7, command_slow = 8, &
    command_glance = 9, &
    command_grains = 10, command_contacts = 11, command_records = 12, command_fresh = 13, &
    command_renew = 14, command_weigh = 15, command_again = 16, &
    command_add = 17, command_receive = 18, command_balance = 19

contains

  !> Receive this rank's part from the leader.
  subroutine begin_part(team, part, bare)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part  !! of the leader the whole
    logical, intent(in) :: bare                 !! contacts come afterwards
    real(wp), allocatable :: contacts(:, :)
    part%halo%cut = .false.
    call distribute(team, part)
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

  !> After the last contact of a checkpoint: the list of a part with those that were kept.
  subroutine receive_kept(kept, part)
    type(record_heap_type), intent(inout) :: kept
    type(dem_data_type), intent(inout) :: part
    real(wp), allocatable :: contacts(:, :)
    call kept%take(part, contacts)
    call receive_contacts(part, contacts)
    call list_part(part, contacts)
  end subroutine receive_kept

  !> Most memory that this process has had [bytes], its grains, mirrors, candidate pairs.
  function weight_of(part) result(row)
    type(dem_data_type), intent(in) :: part
    real(wp) :: row(4)
    row = [real(memory_most(), wp), real(part%halo%own, wp), real(part%halo%mirrors, wp), &
           real(part%pairs%count, wp)]
  end function weight_of
end module dem_rank_commands
