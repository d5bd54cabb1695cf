!> Steps of one rank's part of a system, and their report to the leader.
module dem_part
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_ranks, only: sum_of_columns
  use dem_state, only: dem_data_type, dem_ledger_type, dem_cell_type, kind_mirror
  use dem_cell_stress, only: cell_sums
  use dem_contacts, only: dem_contacts_type, list_contacts
  use dem_exact_forces, only: sum_anew
  use dem_halo_state, only: cell_reals
  use dem_ledger, only: follow_step, refresh_stored, start_ledger
  use dem_limits, only: gershgorin_step, rayleigh_step, foreseen_step
  use dem_additional_state, only: liquid_size
  use dem_bond_counts, only: count_broken
  use dem_liquid_counts, only: held_liquid
  use dem_membrane, only: check_membranes, corner_stiffness, membrane_rate
  use dem_measure, only: check_overlap, fastest_grain, forces_left, wall_stiffnesses
  use dem_record_layout, only: plane_force, plane_moment, plane_impulse, plane_work
  use dem_records, only: index_of
  use dem_slabs, only: count_contacts
  use dem_steps, only: step_memory_type, take_steps, evaluate_forces
  use dem_swap, only: add_loads
  use dem_surface_measure, only: body_rows, body_rate
  use dem_surface_state, only: dem_surfaces_type
  use dem_surface_share, only: surface_reals, surface_report, take_surfaces
  implicit none
  private
  public :: start_part, move_part, report_of, add_reports, glance_of, add_glances, balance_of
  public :: rank_marks_type

  type(dem_ledger_type), parameter :: fresh = dem_ledger_type()
  integer(i4), parameter :: works = size(transfer(fresh, [0.0_wp]))  !! columns of the ledger
  integer(i4), parameter :: plane_size = plane_work  !! sums of a plane

  !> Places of the numbers in a report.
  integer(i4), parameter :: at_overlap = works + 1, at_limits = works + 2, at_speed = works + 5, &
    at_kinetic = works + 6, at_most = works + 7, at_exchange = works + 10, at_own = works + 11, &
    at_mirrors = works + 12, at_pairs = works + 13, at_bytes = works + 14, &
    at_messages = works + 15, at_broken = works + 16, at_liquid = works + 18, &
    report_size = works + 17 + liquid_size

  !> Last report of the ranks.
  type :: rank_marks_type
    real(wp) :: limit(3) = 0.0_wp      !! Gershgorin, Rayleigh, impact [s]
    real(wp) :: speed = 0.0_wp         !! of the fastest grain [m/s]
    real(wp) :: kinetic = 0.0_wp       !! of the free grains [J]
    real(wp) :: fastest(2) = 0.0_wp    !! id and speed of the grain with the most of it
    real(wp) :: exchange(3) = 0.0_wp   !! least, mean, most time in exchanges of a rank [s]
    real(wp) :: own(2) = 0.0_wp        !! least and most grains of a rank
    real(wp) :: mirrors(2) = 0.0_wp    !! least and most mirrors
    real(wp) :: imbalance = 1.0_wp     !! most candidate pairs over the mean [-]
    real(wp) :: pairs = 0.0_wp         !! candidates of all ranks
    real(wp) :: bytes = 0.0_wp         !! sent in a step by all ranks
    real(wp) :: messages = 0.0_wp      !! sent in a step by all ranks
    real(wp) :: contacts(2) = 0.0_wp   !! contacts at the last snapshot, those with a history
  end type rank_marks_type

contains

  !> First forces on a part whose list was made.
  subroutine start_part(part, errors)
    type(dem_data_type), intent(inout) :: part
    type(error_list_type), intent(inout) :: errors
    call evaluate_forces(part, 0.0_wp)
    call sum_anew(part)
    call add_loads(part)
    part%pending = 0.0_wp
    call check_overlap(part, 'I215', errors)
    call start_ledger(part, part%par%dt)
  end subroutine start_part

  !> n steps; the state is checked as on one rank.
  subroutine move_part(part, memory, n, errors)
    type(dem_data_type), intent(inout) :: part
    type(step_memory_type), intent(inout) :: memory
    integer(i4), intent(in) :: n
    type(error_list_type), intent(inout) :: errors
    call follow_step(part, part%par%dt)
    part%health%max_overlap = 0.0_wp
    call take_steps(part, memory, n, errors)
    if (errors%any()) return
    call check_overlap(part, 'N202', errors)
    call check_membranes(part, errors)
  end subroutine move_part

  !> Report to the leader after steps. Collective over all ranks.
  function report_of(part) result(report)
    type(dem_data_type), intent(in) :: part
    real(wp), allocatable :: report(:)
    real(wp) :: top(1), kinetic, most, speed
    integer(i4) :: worst, k, at

    allocate (report(report_size + plane_size*part%planes%n + surface_reals(part%surfaces)))
    top = 0.0_wp
    if (part%grains%n > 0) top = sqrt(maxval(sum(part%grains%v**2, 1)))
    call part%halo%team%most(top)
    report(:works) = transfer(part%ledger, report)
    report(at_overlap) = part%health%max_overlap
    report(at_limits:at_limits + 2) = [gershgorin_step(part), rayleigh_step(part), &
                                       foreseen_step(part, top(1))]
    report(at_speed) = top(1)
    call fastest_grain(part, kinetic, most, worst)
    report(at_kinetic) = kinetic
    report(at_most:at_most + 2) = [most, 0.0_wp, 0.0_wp]
    if (worst > 0) then
      speed = sqrt(sum(part%grains%v(:, worst)**2))
      report(at_most + 1:at_most + 2) = [real(part%grains%id(worst), wp), speed]
    end if
    report(at_exchange) = part%halo%seconds
    report(at_own:at_pairs) = [part%halo%own, part%halo%mirrors, part%pairs%count]
    report(at_bytes:at_messages) = [8*part%halo%width*(size(part%halo%out) &
                                                               + part%halo%partners), &
                                       part%halo%partners]
    report(at_broken:at_broken + 1) = part%pairs%additional%broken
    associate (l => part%pairs%additional%liquid)
      report(at_liquid:report_size) = [l%formed, l%ruptured, l%drawn, l%returned, held_liquid(part)]
    end associate
    do k = 1, part%planes%n
      at = report_size + plane_size*(k - 1)
      report(at + plane_force(1):at + plane_force(2)) = part%planes%force(:, k)
      report(at + plane_moment(1):at + plane_moment(2)) = part%planes%moment(:, k)
      report(at + plane_impulse(1):at + plane_impulse(2)) = part%planes%impulse(:, k)
      report(at + plane_work) = part%planes%work(k)
    end do
    report(report_size + plane_size*part%planes%n + 1:) = surface_report(part%surfaces)
    if (allocated(part%surfaces%rigid%free)) report = [report, body_rows(part)]
    if (allocated(part%surfaces%membranes)) report = [report, corner_stiffness(part)]
  end function report_of

  !> Sums over the ranks, in their order: ledger and planes of the whole, health, limits.
  subroutine add_reports(part, reports, whole, marks)
    type(dem_data_type), intent(in) :: part    !! of the leader
    real(wp), intent(in) :: reports(:, :)      !! (:, ranks)
    type(dem_data_type), intent(inout) :: whole
    type(rank_marks_type), intent(inout) :: marks
    real(wp) :: total(size(reports, 1)), overlap, reference
    integer(i4) :: k, at

    total(:works) = sum_of_columns(reports(:works, :))
    total(at_overlap:at_speed) = 0.0_wp  ! largest and least ones, which are no sums
    total(at_kinetic:) = sum_of_columns(reports(at_kinetic:, :))
    whole%ledger = transfer(total, whole%ledger)  ! stored energies are updated by the next snapshot
    whole%ledger_dt = part%ledger_dt
    overlap = max(whole%health%max_overlap, maxval(reports(at_overlap, :)))
    reference = whole%health%reference_energy
    whole%health = part%health
    whole%health%max_overlap = overlap
    whole%health%reference_energy = reference
    do k = 1, whole%planes%n
      at = report_size + plane_size*(k - 1)
      whole%planes%force(:, k) = total(at + plane_force(1):at + plane_force(2))
      whole%planes%moment(:, k) = total(at + plane_moment(1):at + plane_moment(2))
      whole%planes%impulse(:, k) = total(at + plane_impulse(1):at + plane_impulse(2))
      whole%planes%work(k) = total(at + plane_work)
    end do
    whole%planes%point = part%planes%point
    if (whole%surfaces%n > 0) call take_surfaces(part%surfaces, &
      total(report_size + plane_size*whole%planes%n + 1:), whole%surfaces)
    call take_cell(part%cell, whole%cell)
    whole%grains%has_target = .false.
    whole%pairs%additional%broken = total(at_broken:at_broken + 1)
    call count_broken(whole%pairs%additional)
    whole%pairs%additional%liquid = transfer(total(at_liquid:report_size), &
                                             whole%pairs%additional%liquid)
    call take_marks(reports, total(at_kinetic), marks)
    at = report_size + plane_size*whole%planes%n + surface_reals(whole%surfaces)
    call limit_surfaces(whole%surfaces, total(at + 1:), marks%limit(1))
  end subroutine add_reports

  !> Step limit of free bodies and membranes, by the rows of all their contacts.
  pure subroutine limit_surfaces(s, rows, limit)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: rows(:)      !! what a report ends with
    real(wp), intent(inout) :: limit     !! [s]
    real(wp) :: rate
    integer(i4) :: n
    n = 0
    rate = 0.0_wp
    if (allocated(s%rigid%free)) then
      n = 4*s%n
      rate = body_rate(s, reshape(rows(:n), [4_i4, s%n]))
    end if
    if (allocated(s%membranes)) rate = max(rate, membrane_rate(s, rows(n + 1:)))
    if (rate > 0.0_wp) limit = min(limit, 2.0_wp/sqrt(rate))
  end subroutine limit_surfaces

  !> What this rank stores, its contacts and their sums in a cell.
  function glance_of(part) result(row)
    type(dem_data_type), intent(inout) :: part
    real(wp) :: row(works + 2 + cell_reals)
    call follow_step(part, part%par%dt)
    call refresh_stored(part, part%par%dt, part%ledger)
    row(:works) = transfer(part%ledger, row)
    row(works + 1:works + 2) = count_contacts(part)
    row(works + 3:) = 0.0_wp
    if (part%cell%active) row(works + 3:) = cell_sums(part)
  end function glance_of

  !> Sums of snapshots over the ranks, in their order.
  subroutine add_glances(part, rows, whole, marks)
    type(dem_data_type), intent(in) :: part  !! of the leader
    real(wp), intent(in) :: rows(:, :)       !! (:, ranks)
    type(dem_data_type), intent(inout) :: whole
    type(rank_marks_type), intent(inout) :: marks
    real(wp) :: total(size(rows, 1))
    total = sum_of_columns(rows)
    whole%ledger = transfer(total, whole%ledger)
    whole%ledger_dt = part%ledger_dt
    marks%contacts = total(works + 1:works + 2)
    whole%halo%cell_sums = total(works + 3:)
    whole%halo%cell_seen = .true.
    whole%pairs%skin = part%pairs%skin
    whole%pairs%most_skin = part%pairs%most_skin
    whole%pairs%built_at = part%pairs%built_at
  end subroutine add_glances

  !> Forces left on own grains and their number, forces of own contacts and their number, stiffness
  !! of the contacts of each plane.
  function balance_of(part) result(row)
    type(dem_data_type), intent(in) :: part
    real(wp) :: row(4 + part%planes%n)
    type(dem_contacts_type) :: list
    integer(i4) :: k
    row = 0.0_wp
    row(1:2) = forces_left(part)
    call list_contacts(part, list)
    do k = 1, list%n
      if (list%ids(1, k) > 0) then
        if (part%grains%kind(index_of(part, real(list%ids(1, k), wp))) == kind_mirror) cycle
      end if
      row(3:4) = row(3:4) + [norm2(list%force(:, k)), 1.0_wp]
    end do
    row(5:) = wall_stiffnesses(part)
  end function balance_of

  !> The cell as it is now; rates are the leader's to set.
  pure subroutine take_cell(part, whole)
    type(dem_cell_type), intent(in) :: part
    type(dem_cell_type), intent(inout) :: whole
    real(wp) :: rate(3, 3), held(size(whole%held))
    rate = whole%rate
    held = whole%held
    whole = part
    whole%rate = rate
    whole%held = held
  end subroutine take_cell

  pure subroutine take_marks(reports, kinetic, marks)
    real(wp), intent(in) :: reports(:, :), kinetic
    type(rank_marks_type), intent(inout) :: marks
    integer(i4) :: r
    marks%limit = minval(reports(at_limits:at_limits + 2, :), 2)
    marks%speed = reports(at_speed, 1)
    marks%kinetic = kinetic
    r = maxloc(reports(at_most, :), 1)
    marks%fastest = reports(at_most + 1:at_most + 2, r)
    marks%exchange = [minval(reports(at_exchange, :)), &
                      sum(reports(at_exchange, :))/size(reports, 2), &
                      maxval(reports(at_exchange, :))]
    marks%own = [minval(reports(at_own, :)), maxval(reports(at_own, :))]
    marks%imbalance = maxval(reports(at_pairs, :))*size(reports, 2) &
                      /max(sum(reports(at_pairs, :)), 1.0_wp)
    marks%pairs = sum(reports(at_pairs, :))
    marks%bytes = sum(reports(at_bytes, :))
    marks%messages = sum(reports(at_messages, :))
    marks%mirrors = [minval(reports(at_mirrors, :)), maxval(reports(at_mirrors, :))]
  end subroutine take_marks
end module dem_part
