!> A rank that does not lead: it does what the leader orders until that sends it home.
module dem_rank_worker
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_ranks, only: ranks_type
  use talus_system, only: install_signals
  use dem_state, only: dem_data_type
  use dem_contacts, only: dem_contacts_type
  use dem_gather, only: hand_in, haul_type, hand_in_driven
  use dem_distribute, only: tell_step, tell_energies, tell_targets, tell_loads
  use dem_rank_commands, only: order_start, order_step, order_look, order_targets, order_loads, &
    order_reset, order_slow, order_glance, order_grains, order_contacts, order_records, &
    order_fresh, order_renew, order_weigh, order_again, order_add, order_adopt, order_balance, &
    begin_part, adopt_kept, weight_of
  use dem_part, only: start_part, move_part, report_of, glance_of, balance_of
  use dem_record_heap, only: record_heap_type
  use dem_records, only: contact_reals
  use dem_relist, only: rebuild_list
  use dem_slabs, only: dem_slab_type, slab_of_grains, slab_of_contacts, slab_of_records
  use dem_adaptive_damping, only: stop_slowing, reset_sums
  use dem_steps, only: step_memory_type
  use dem_broadcast, only: tell_matrix
  implicit none
  private
  public :: serve_leader

  !> What a rank holds.
  type :: follower_type
    type(ranks_type) :: team
    type(dem_data_type) :: part
    type(step_memory_type) :: memory
    type(record_heap_type) :: records  !! of contacts that a run goes on with
  end type follower_type

contains

  !> Orders, one after the other. Signals are the leader's.
  subroutine serve_leader(team, exit_code)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(out) :: exit_code
    type(follower_type), allocatable :: self
    integer(i4) :: order(2)
    logical :: done

    call install_signals(.false.)
    allocate (self)
    self%team = team
    self%part%halo%team = team
    do
      call team%await(order)
      call move_on(self, order, done)
      if (.not. done) call hand_over(self, order, done)
      if (done) cycle
      exit_code = order(2)
      return
    end do
  end subroutine serve_leader

  !> Orders that change the part.
  subroutine move_on(self, order, done)
    type(follower_type), intent(inout) :: self
    integer(i4), intent(in) :: order(2)
    logical, intent(out) :: done
    type(error_list_type) :: errors
    real(wp), allocatable :: rows(:, :)
    logical :: none(0)

    done = .true.
    associate (team => self%team, part => self%part)
      select case (order(1))
      case (order_start, order_fresh)
        call omp_set_num_threads(order(2))
        call begin_part(team, part, .false.)
        if (order(1) == order_start) return
        call start_part(part, errors)
        call tell_report(self)
        call team%agree(errors)
      case (order_step)
        call tell_step(team, part, part)
        call move_part(part, self%memory, order(2), errors)
        call tell_report(self)
        call team%agree(errors)
      case (order_reset)
        call reset_sums(part)
      case (order_targets)
        call tell_targets(team, part, order(2) > 0, part)
      case (order_loads)
        call tell_loads(team, part, none, part)
      case (order_slow)
        call stop_slowing(part)
        call tell_report(self)
      case (order_again)
        call omp_set_num_threads(order(2))
        call begin_part(team, part, .true.)
      case (order_add)
        allocate (rows(contact_reals(part), order(2)))
        call tell_matrix(team, rows)
        call self%records%keep(part, rows)
      case (order_adopt)
        call adopt_kept(self%records, part)
        call tell_report(self)
      case (order_renew)
        call rebuild_list(part, 0.0_wp)
      case default
        done = .false.
      end select
    end associate
  end subroutine move_on

  !> Orders to hand in what the part holds.
  subroutine hand_over(self, order, done)
    type(follower_type), intent(inout) :: self
    integer(i4), intent(in) :: order(2)
    logical, intent(out) :: done
    type(haul_type) :: haul
    type(dem_slab_type) :: slab
    type(dem_contacts_type) :: list
    real(wp), allocatable :: rows(:, :)
    integer(i8) :: no_id(0)

    done = .true.
    associate (team => self%team, part => self%part)
      select case (order(1))
      case (order_look)
        call hand_in(team, part, haul)
      case (order_glance)
        call tell_energies(team, part, part)
        call team%collect(glance_of(part), rows)
        call hand_in_driven(team, part, part)
      case (order_balance)
        call team%collect(balance_of(part), rows)
      case (order_grains)
        call slab_of_grains(team, part, no_id, slab)
      case (order_contacts)
        call slab_of_contacts(team, part, 0_i8, 0_i8, list)
      case (order_records)
        call slab_of_records(team, part, 0_i8, 0_i8, rows)
      case (order_weigh)
        call team%collect(weight_of(part), rows)
      case default
        done = .false.
      end select
    end associate
  end subroutine hand_over

  !> What the leader must know after steps.
  subroutine tell_report(self)
    type(follower_type), intent(in) :: self
    real(wp), allocatable :: reports(:, :)
    call self%team%collect(report_of(self%part), reports)
  end subroutine tell_report
end module dem_rank_worker
