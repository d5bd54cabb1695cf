!> A rank other than the leader: it executes the leader's commands until the command to exit.
module dem_rank_worker
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_ranks, only: ranks_type
  use talus_system, only: install_signals
  use dem_state, only: dem_data_type
  use dem_contacts, only: dem_contacts_type
  use dem_gather, only: deliver, haul_type, deliver_driven
  use dem_distribute, only: broadcast_step, broadcast_energies, broadcast_targets, broadcast_loads
  use dem_rank_commands, only: command_start, command_step, command_gather, command_targets, &
    command_loads, command_reset, command_slow, command_glance, command_grains, command_contacts, &
    command_records, command_fresh, command_renew, command_weigh, command_again, command_add, &
    command_receive, command_balance, begin_part, receive_kept, weight_of
  use dem_part, only: start_part, move_part, report_of, glance_of, balance_of
  use dem_record_heap, only: record_heap_type
  use dem_records, only: contact_reals
  use dem_relist, only: rebuild_list
  use dem_slabs, only: dem_slab_type, slab_of_grains, slab_of_contacts, slab_of_records
  use dem_adaptive_damping, only: stop_slowing, reset_sums
  use dem_steps, only: step_memory_type
  use dem_broadcast, only: broadcast_matrix
  implicit none
  private
  public :: serve_leader

  !> What a rank holds.
  type :: follower_type
    type(ranks_type) :: team
    class(dem_data_type), allocatable :: part
    type(step_memory_type) :: memory
    type(record_heap_type) :: records  !! of contacts of a checkpoint
  end type follower_type

contains

  !> Execute commands one after another. Signals are handled by the leader.
  subroutine serve_leader(team, exit_code)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(out) :: exit_code
    class(follower_type), allocatable :: self
    integer(i4) :: command(2)
    logical :: done

    call install_signals(.false.)
    allocate (self)
    allocate (self%part)
    self%team = team
    self%part%halo%team = team
    do
      call team%await(command)
      call move_on(self, command, done)
      if (.not. done) call hand_over(self, command, done)
      if (done) cycle
      exit_code = command(2)
      return
    end do
  end subroutine serve_leader

  !> Commands that change the part.
  subroutine move_on(self, command, done)
    type(follower_type), intent(inout) :: self
    integer(i4), intent(in) :: command(2)
    logical, intent(out) :: done
    type(error_list_type) :: errors
    real(wp), allocatable :: rows(:, :)
    logical :: none(0)

    done = .true.
    associate (team => self%team, part => self%part)
      select case (command(1))
      case (command_start, command_fresh)
        call omp_set_num_threads(command(2))
        call begin_part(team, part, .false.)
        if (command(1) == command_start) return
        call start_part(part, errors)
        call send_report(self)
        call team%agree(errors)
      case (command_step)
        call broadcast_step(team, part, part)
        call move_part(part, self%memory, command(2), errors)
        call send_report(self)
        call team%agree(errors)
      case (command_reset)
        call reset_sums(part)
      case (command_targets)
        call broadcast_targets(team, part, command(2) > 0, part)
      case (command_loads)
        call broadcast_loads(team, part, none, part)
      case (command_slow)
        call stop_slowing(part)
        call send_report(self)
      case (command_again)
        call omp_set_num_threads(command(2))
        call begin_part(team, part, .true.)
      case (command_add)
        allocate (rows(contact_reals(part), command(2)))
        call broadcast_matrix(team, rows)
        call self%records%keep(part, rows)
      case (command_receive)
        call receive_kept(self%records, part)
        call send_report(self)
      case (command_renew)
        call rebuild_list(part, 0.0_wp, 0.0_wp)
      case default
        done = .false.
      end select
    end associate
  end subroutine move_on

  !> Commands to send data of the part.
  subroutine hand_over(self, command, done)
    type(follower_type), intent(inout) :: self
    integer(i4), intent(in) :: command(2)
    logical, intent(out) :: done
    type(haul_type) :: haul
    type(dem_slab_type) :: slab
    type(dem_contacts_type) :: list
    real(wp), allocatable :: rows(:, :)
    integer(i8) :: no_id(0)

    done = .true.
    associate (team => self%team, part => self%part)
      select case (command(1))
      case (command_gather)
        call deliver(team, part, haul)
      case (command_glance)
        call broadcast_energies(team, part, part)
        call team%collect(glance_of(part), rows)
        call deliver_driven(team, part, part)
      case (command_balance)
        call team%collect(balance_of(part), rows)
      case (command_grains)
        call slab_of_grains(team, part, no_id, slab)
      case (command_contacts)
        call slab_of_contacts(team, part, 0_i8, 0_i8, list)
      case (command_records)
        call slab_of_records(team, part, 0_i8, 0_i8, rows)
      case (command_weigh)
        call team%collect(weight_of(part), rows)
      case default
        done = .false.
      end select
    end associate
  end subroutine hand_over

  !> Report to the leader after steps.
  subroutine send_report(self)
    type(follower_type), intent(in) :: self
    real(wp), allocatable :: reports(:, :)
    call self%team%collect(report_of(self%part), reports)
  end subroutine send_report
end module dem_rank_worker
