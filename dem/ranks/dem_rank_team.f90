!> A run on many ranks: the leader holds the whole system, reads, writes and decides; every rank,
!! the leader too, holds and moves the grains of its domain.
!!
!! The others wait for commands (dem_rank_commands, dem_rank_worker): receive their parts, advance,
!! send their parts, exit. The whole system is updated only when it is accessed; what the leader
!! changes in it is broadcast before the next steps.
module dem_rank_team
  use omp_lib, only: omp_set_num_threads, omp_get_max_threads, omp_get_num_procs
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_ranks, only: ranks_type
  use talus_text, only: str
  use dem_state, only: dem_data_type, copy_data
  use dem_bonds_make, only: check_bonds
  use dem_contacts, only: dem_contacts_type, make_contacts, append_contacts
  use dem_gather, only: release_list, deliver, take_in, haul_type, deliver_driven
  use dem_halo_state, only: dem_halo_type
  use dem_distribute, only: broadcast_step, broadcast_energies, broadcast_targets, broadcast_loads
  use dem_measure, only: judge_runaway
  use dem_rank_commands, only: command_start, command_step, command_gather, command_leave, &
    command_targets, command_loads, command_reset, command_slow, command_glance, command_grains, &
    command_contacts, command_records, command_fresh, command_renew, command_weigh, command_again, &
    command_add, command_receive, command_balance, begin_part, receive_kept, weight_of
  use dem_part, only: start_part, move_part, report_of, add_reports, glance_of, add_glances, &
    balance_of, rank_marks_type
  use dem_record_heap, only: record_heap_type
  use dem_relist, only: rebuild_list
  use dem_slabs, only: dem_slab_type, slab_of_grains, slab_of_contacts, slab_of_records, &
    slab_grains, copy_state
  use dem_adaptive_damping, only: stop_slowing, reset_sums
  use dem_steps, only: step_memory_type
  use dem_broadcast, only: broadcast_matrix
  implicit none
  private
  public :: dem_rank_team_type

  type :: dem_rank_team_type
    type(ranks_type) :: team
    class(dem_data_type), allocatable :: part  !! grains of this rank's domain
    type(step_memory_type) :: memory
    type(rank_marks_type) :: marks             !! report of the last steps
    logical :: started = .false.               !! all ranks have their parts
    logical :: alone = .false.                 !! the leader moves all grains, the others are idle
    logical :: stale = .false.                 !! the whole is older than the parts
    logical :: redirected = .false.            !! motion of prescribed grains has changed
    logical :: glanced = .false.               !! the energies of the whole are up to date
    logical :: reset = .false.                 !! impulses and works restart from zero
    logical, allocatable :: loaded(:)          !! (grains) extra forces have changed
    real(wp) :: shift = 0.0_wp                 !! of the start of the ledger with them [J]
    type(record_heap_type) :: records          !! of contacts of a checkpoint
  contains
    procedure :: begin_fresh
    procedure :: begin_again
    procedure :: add_records
    procedure :: receive_records
    procedure :: step
    procedure :: gather
    procedure :: glance
    procedure :: balance
    procedure :: see_grains
    procedure :: see_contacts
    procedure :: some_grains
    procedure :: some_contacts
    procedure :: some_records
    procedure :: mark_loads
    procedure :: slow_down
    procedure :: begin_anew
    procedure :: try_out
    procedure :: go_alone
    procedure :: leave
    procedure :: text => rank_team_text
    procedure, private :: start
    procedure, private :: pending
    procedure, private :: broadcast_changes
  end type dem_rank_team_type

contains

  !> n steps of the whole; its ledger, planes, health and limits are up to date afterwards, its
  !! grains and contacts only when accessed.
  subroutine step(self, whole, n, errors)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4), intent(in) :: n
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: command(2)
    real(wp), allocatable :: reports(:, :)

    if (.not. self%started) call self%start(whole, command_start)
    call self%broadcast_changes(whole)
    call release_list(whole%pairs)
    whole%halo%cell_seen = .false.
    self%glanced = .false.
    command = [command_step, n]
    call self%team%await(command)
    call broadcast_step(self%team, whole, self%part)
    call move_part(self%part, self%memory, n, errors)
    call self%team%collect(report_of(self%part), reports)
    call add_reports(self%part, reports, whole, self%marks)
    self%stale = .true.
    call self%team%agree(errors)
    if (errors%any()) return
    if (whole%pairs%additional%lost > 0) call check_bonds(whole, errors)
    call judge_runaway(whole, self%marks%kinetic, nint(self%marks%fastest(1), i8), &
                       self%marks%fastest(2), errors)
  end subroutine step

  !> Every rank makes the list of its part of a whole without one, and finds the first forces.
  subroutine begin_fresh(self, whole, errors)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: reports(:, :)
    call self%start(whole, command_fresh)
    call release_list(whole%pairs)
    call start_part(self%part, errors)
    call self%team%collect(report_of(self%part), reports)
    call add_reports(self%part, reports, whole, self%marks)
    self%stale = .true.
    call self%team%agree(errors)
    if (.not. errors%any()) call self%glance(whole)
  end subroutine begin_fresh

  !> Every rank gets its grains of a whole without a list; contacts follow, in any order.
  subroutine begin_again(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: whole
    call self%start(whole, command_again)
  end subroutine begin_again

  !> Some contacts, see dem_records: every rank keeps those of its own grains.
  subroutine add_records(self, rows)
    class(dem_rank_team_type), intent(inout) :: self
    real(wp), intent(inout), contiguous :: rows(:, :)
    integer(i4) :: command(2)
    command = [command_add, size(rows, 2, i4)]
    call self%team%await(command)
    call broadcast_matrix(self%team, rows)
    call self%records%keep(self%part, rows)
  end subroutine add_records

  !> After the last one: every rank makes its list.
  subroutine receive_records(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    real(wp), allocatable :: reports(:, :)
    integer(i4) :: command(2)
    command = [command_receive, 0_i4]
    call self%team%await(command)
    call receive_kept(self%records, self%part)
    call self%team%collect(report_of(self%part), reports)
    call add_reports(self%part, reports, whole, self%marks)
    self%stale = .true.
    call self%glance(whole)
  end subroutine receive_records

  !> Give every rank its part.
  subroutine start(self, whole, how)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: whole
    integer(i4), intent(in) :: how  !! command_start, command_fresh or command_again
    integer(i4) :: command(2)
    type(dem_halo_type) :: halo
    command = [how, int(omp_get_max_threads(), i4)]
    call self%team%await(command)
    halo = self%part%halo
    call copy_data(whole, self%part)
    self%part%halo = halo
    self%part%halo%team = self%team
    call begin_part(self%team, self%part, how == command_again)
    self%started = .true.
    self%redirected = any(whole%grains%has_target)
    self%reset = .false.
    self%shift = 0.0_wp
    if (allocated(self%loaded)) deallocate (self%loaded)
  end subroutine start

  !> Broadcast what the leader has changed since the last steps.
  subroutine broadcast_changes(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: whole
    integer(i4) :: command(2)
    if (self%reset) then
      command = [command_reset, 0_i4]
      call self%team%await(command)
      call reset_sums(self%part)
    end if
    if (self%redirected) then
      command = [command_targets, merge(0_i4, 1_i4, self%stale)]
      call self%team%await(command)
      call broadcast_targets(self%team, whole, command(2) > 0, self%part)
    end if
    if (allocated(self%loaded)) then
      command = [command_loads, 0_i4]
      call self%team%await(command)
      call broadcast_loads(self%team, whole, self%loaded, self%part)
      deallocate (self%loaded)
    end if
    self%part%ledger%start = self%part%ledger%start + self%shift
    self%shift = 0.0_wp
    self%reset = .false.
    self%redirected = .false.
  end subroutine broadcast_changes

  !> Extra forces of these grains have changed in the whole.
  subroutine mark_loads(self, marked)
    class(dem_rank_team_type), intent(inout) :: self
    logical, intent(in) :: marked(:)  !! (grains)
    if (.not. self%started) return
    if (.not. allocated(self%loaded)) allocate (self%loaded(size(marked)), source=.false.)
    self%loaded = self%loaded .or. marked
  end subroutine mark_loads

  !> Adaptive damping of all grains.
  subroutine slow_down(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4) :: command(2)
    real(wp), allocatable :: reports(:, :)
    if (.not. self%started) call self%start(whole, command_start)
    self%glanced = .false.
    command = [command_slow, 0_i4]
    call self%team%await(command)
    call stop_slowing(self%part)
    call self%team%collect(report_of(self%part), reports)
    call add_reports(self%part, reports, whole, self%marks)
    self%stale = .true.
  end subroutine slow_down

  !> The state of the whole was replaced: ranks receive new parts of it before the next steps.
  subroutine begin_anew(self)
    class(dem_rank_team_type), intent(inout) :: self
    self%started = .false.
    self%stale = .false.
    self%glanced = .false.
  end subroutine begin_anew

  !> The leader moves all grains from now on, with the threads of the idle ranks on its host: as
  !! many as this has processors.
  subroutine go_alone(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4) :: threads
    if (self%alone) return
    call self%gather(whole)
    call self%begin_anew()
    self%alone = .true.
    threads = int(omp_get_max_threads(), i4)
    call omp_set_num_threads(max(threads, min(threads*self%team%on_host, &
                                              int(omp_get_num_procs(), i4))))
  end subroutine go_alone

  !> Bring the whole up to date.
  subroutine gather(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4) :: command(2)
    type(haul_type) :: haul
    if (.not. self%stale) return
    command = [command_gather, 0_i4]
    call self%team%await(command)
    call deliver(self%team, self%part, haul)
    call take_in(self%part, haul, whole)
    whole%halo%cell_seen = .false.
    self%stale = .false.
  end subroutine gather

  !> Energies, contacts' number, the stress in a cell and driven grains of the whole, without the
  !! rest.
  subroutine glance(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    integer(i4) :: command(2)
    real(wp), allocatable :: rows(:, :)
    if (self%glanced .and. .not. self%pending(whole)) return
    call self%broadcast_changes(whole)
    command = [command_glance, 0_i4]
    call self%team%await(command)
    call broadcast_energies(self%team, whole, self%part)
    call self%team%collect(glance_of(self%part), rows)
    call add_glances(self%part, rows, whole, self%marks)
    call deliver_driven(self%team, self%part, whole)
    self%glanced = .true.
  end subroutine glance

  !> Has the leader changed anything that energies depend on since the last report?
  logical function pending(self, whole)
    class(dem_rank_team_type), intent(in) :: self
    type(dem_data_type), intent(in) :: whole
    pending = self%reset .or. self%redirected .or. allocated(self%loaded) .or. &
      allocated(whole%surfaces%rigid%free)
    pending = pending .or. any(transfer(whole%par, [0_i4]) /= transfer(self%part%par, [0_i4]))
  end function pending

  !> Sums of all ranks, see balance_of.
  subroutine balance(self, sums)
    class(dem_rank_team_type), intent(inout) :: self
    real(wp), intent(out) :: sums(:)
    real(wp), allocatable :: rows(:, :)
    integer(i4) :: command(2)
    command = [command_balance, 0_i4]
    call self%team%await(command)
    call self%team%collect(balance_of(self%part), rows)
    sums = sum(rows, 2)
  end subroutine balance

  !> Places, motion and forces of all grains of the whole as they are now, without their contacts.
  subroutine see_grains(self, whole)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    type(dem_slab_type) :: slab
    integer(i4) :: low, high
    do low = 1, whole%grains%n, slab_grains
      high = min(low + slab_grains - 1, whole%grains%n)
      call self%some_grains(whole%grains%id(low:high), slab)
      call copy_state(slab%some%grains, low, whole%grains)
    end do
  end subroutine see_grains

  !> All contacts as they are now, in the order of those of one rank.
  subroutine see_contacts(self, whole, list)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    type(dem_contacts_type), intent(inout) :: list
    type(dem_contacts_type) :: some
    integer(i8) :: planes, surfaces
    integer(i4) :: low
    call self%glance(whole)
    call make_contacts(list, nint(self%marks%contacts(1), i4))
    associate (id => whole%grains%id, n => whole%grains%n)
      do low = 1, n, slab_grains
        call self%some_contacts(id(low), id(min(low + slab_grains - 1, n)), some)
        call append_contacts(list, some)
      end do
    end associate
    planes = whole%planes%n
    surfaces = whole%surfaces%n
    if (planes > 0) call self%some_contacts(-planes, -1_i8, some)
    if (planes > 0) call append_contacts(list, some)
    if (surfaces == 0) return
    call self%some_contacts(-planes - surfaces, -planes - 1_i8, some)
    call append_contacts(list, some)
  end subroutine see_contacts

  !> Some grains of the whole as they are now.
  subroutine some_grains(self, ids, slab)
    class(dem_rank_team_type), intent(inout) :: self
    integer(i8), intent(in) :: ids(:)  !! all from the first to the last, ascending
    type(dem_slab_type), intent(out) :: slab
    integer(i4) :: command(2)
    command = [command_grains, 0_i4]
    call self%team%await(command)
    call slab_of_grains(self%team, self%part, ids, slab)
  end subroutine some_grains

  !> Contacts whose first id is between two, planes and surfaces being -1, -2, ...
  subroutine some_contacts(self, first, last, list)
    class(dem_rank_team_type), intent(inout) :: self
    integer(i8), intent(in) :: first, last
    type(dem_contacts_type), intent(out) :: list
    integer(i4) :: command(2)
    command = [command_contacts, 0_i4]
    call self%team%await(command)
    call slab_of_contacts(self%team, self%part, first, last, list)
  end subroutine some_contacts

  !> The same with all that they keep, see dem_records.
  subroutine some_records(self, first, last, rows)
    class(dem_rank_team_type), intent(inout) :: self
    integer(i8), intent(in) :: first, last
    real(wp), allocatable, intent(out) :: rows(:, :)
    integer(i4) :: command(2)
    command = [command_records, 0_i4]
    call self%team%await(command)
    call slab_of_records(self%team, self%part, first, last, rows)
  end subroutine some_records

  !> Perform the steps of a run that need most memory: distribution, a rebuild of the list, the
  !! slabs of a checkpoint, gathering the whole if the run does so. Returns the peak bytes of each
  !! rank, its grains, mirrors and candidate pairs. The run cannot continue from here.
  subroutine try_out(self, whole, gathers, rows)
    class(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: whole
    logical, intent(in) :: gathers
    real(wp), allocatable, intent(out) :: rows(:, :)  !! (4, ranks)
    integer(i4) :: command(2), round

    if (.not. self%started) call self%start(whole, command_start)
    call release_list(whole%pairs)
    self%stale = .true.
    do round = 1, 2  ! memory freed by the first is not all reused by the second
      command = [command_renew, 0_i4]
      call self%team%await(command)
      call rebuild_list(self%part, 0.0_wp, 0.0_wp)
      call try_slabs(self, whole)
    end do
    if (gathers) call self%gather(whole)
    command = [command_weigh, 0_i4]
    call self%team%await(command)
    call self%team%collect(weight_of(self%part), rows)
  end subroutine try_out

  !> The slabs of fields and of a checkpoint.
  subroutine try_slabs(self, whole)
    type(dem_rank_team_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: whole
    type(dem_slab_type) :: slab
    type(dem_contacts_type) :: list
    real(wp), allocatable :: records(:, :)
    integer(i4) :: low, high
    associate (id => whole%grains%id)
      do low = 1, whole%grains%n, slab_grains
        high = min(low + slab_grains - 1, whole%grains%n)
        call self%some_grains(id(low:high), slab)
        call self%some_contacts(id(low), id(high), list)
        call self%some_records(id(low), id(high), records)
      end do
    end associate
  end subroutine try_slabs

  !> The other ranks exit with this code.
  subroutine leave(self, exit_code)
    class(dem_rank_team_type), intent(inout) :: self
    integer(i4), intent(in) :: exit_code
    integer(i4) :: command(2)
    if (.not. self%team%several()) return
    command = [command_leave, exit_code]
    call self%team%await(command)
  end subroutine leave

  !> How the ranks shared the work, for the log.
  function rank_team_text(self, steps_time) result(text)
    class(dem_rank_team_type), intent(in) :: self
    real(wp), intent(in) :: steps_time  !! in steps so far [s]
    character(len=:), allocatable :: text
    associate (m => self%marks)
      text = str(self%team%ranks)//', exchange '// &
        short_number(100.0_wp*m%exchange(2)/max(steps_time, tiny(1.0_wp)))//' % of the steps ('// &
        short_number(100.0_wp*m%exchange(1)/max(steps_time, tiny(1.0_wp)))//' to '// &
        short_number(100.0_wp*m%exchange(3)/max(steps_time, tiny(1.0_wp)))//' %), '// &
        short_number(m%own(1))//' to '//short_number(m%own(2))//' grains, '// &
        short_number(m%mirrors(1))//' to '//short_number(m%mirrors(2))//' mirrors, imbalance '// &
        short_number(m%imbalance)
    end associate
  end function rank_team_text
end module dem_rank_team
