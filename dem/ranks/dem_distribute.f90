!> Data that the leader broadcasts to the other ranks: parameters of the motion, laws, planes,
!! surfaces, cell and prescribed grains at the start; before each block of steps what may have
!! changed.
module dem_distribute
  use talus_kinds, only: wp, i4, i8
  use talus_ranks, only: ranks_type
  use dem_additional_numbers, only: most_models, most_own
  use dem_additional_state, only: dem_additional_type
  use dem_additional, only: plan_additional
  use dem_law_registry, only: bind_law
  use dem_shape_state, only: put_frame
  use dem_prescribed, only: put_body
  use dem_state, only: dem_data_type, dem_grains_type, dem_parameters_type, dem_cell_type, &
    dem_health_type, dem_ledger_type, kind_free, kind_mirror
  use dem_make, only: make_planes
  use dem_migrate, only: pack_grains, make_local
  use dem_record_layout, only: sum_reals, target_position, target_quat, target_velocity, &
    target_spin, target_given, target_end_position, target_end_quat, target_turn, target_id, &
    load_id, load_force, load_moment, swap_motion, swap_ellipsoid, swap_frame
  use dem_records, only: grain_reals, index_of
  use dem_membrane, only: set_pressures
  use dem_surface_body, only: set_loads
  use dem_surface_share, only: broadcast_surfaces, broadcast_motion
  use dem_surface_values, only: copy_velocities
  use dem_broadcast, only: broadcast_matrix
  implicit none
  private
  public :: distribute, broadcast_step, broadcast_energies, broadcast_targets, broadcast_loads

contains

  !> The leader holds the whole system; the others receive what is common to all ranks. Sums of
  !! planes and prescribed grains remain on the leader.
  subroutine distribute(team, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part
    integer(i4) :: sizes(6)

    if (team%leads()) sizes = [size(part%materials, kind=i4), part%planes%n, &
                               int(count(part%grains%kind /= kind_free), i4), &
                               merge(swap_motion(2), swap_ellipsoid(2), all_round(part)), &
                               merge(1_i4, 0_i4, part%grains%shapes%in_use), &
                               merge(1_i4, 0_i4, allocated(part%seen_kinetic))]
    call team%broadcast_numbers(sizes)
    part%halo%width = sizes(4)
    part%halo%shaped = sizes(5) > 0
    if (part%halo%shaped) part%halo%width = swap_frame(2)
    if (sizes(6) > 0 .and. .not. team%leads()) part%seen_kinetic = [real(wp) ::]
    call broadcast_parameters(team, part%par)
    call broadcast_health(team, part%health)
    call broadcast_laws(team, sizes(1), part)
    call broadcast_additional(team, part)
    call broadcast_cell(team, part%cell)
    call broadcast_planes(team, sizes(2), part)
    call broadcast_surfaces(team, part%surfaces)
    call broadcast_list(team, part)
    call broadcast_prescribed(team, sizes(3), part)
  end subroutine distribute

  !> Are all grains spheres?
  pure logical function all_round(d)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: i
    all_round = .false.
    if (d%grains%shapes%in_use) return
    do i = 1, d%grains%n
      if (maxval(d%grains%axes(:, i)) > minval(d%grains%axes(:, i))) return
    end do
    all_round = .true.
  end function all_round

  !> What may have changed since the last steps: parameters, rate of the cell, velocities of planes
  !! and surfaces, pressure of membranes.
  subroutine broadcast_step(team, whole, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: whole  !! used on the leader alone
    type(dem_data_type), intent(inout) :: part
    if (team%leads()) then
      part%par = whole%par
      part%planes%velocity = whole%planes%velocity
      part%cell%rate = whole%cell%rate
      part%cell%held = whole%cell%held
      if (part%surfaces%n > 0) then
        call copy_velocities(whole%surfaces, part%surfaces)
        if (allocated(part%surfaces%rigid%free)) &
          call set_loads(part%surfaces, whole%surfaces%rigid%given)
        if (allocated(part%surfaces%membranes)) &
          call set_pressures(part%surfaces, whole%surfaces%membranes%pressure)
      end if
    end if
    call broadcast_parameters(team, part%par)
    call broadcast_matrix(team, part%planes%velocity)
    if (part%cell%active) call broadcast_matrix(team, part%cell%rate)
    if (part%surfaces%n > 0) call broadcast_motion(team, part%surfaces)
  end subroutine broadcast_step

  !> What energies depend on besides grains and contacts: parameters, loads of free bodies.
  subroutine broadcast_energies(team, whole, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: whole  !! used on the leader alone
    type(dem_data_type), intent(inout) :: part
    if (team%leads()) part%par = whole%par
    call broadcast_parameters(team, part%par)
    if (.not. allocated(part%surfaces%rigid%free)) return
    if (team%leads()) call set_loads(part%surfaces, whole%surfaces%rigid%given)
    call broadcast_matrix(team, part%surfaces%rigid%given)
  end subroutine broadcast_energies

  !> Prescribed motion for the next steps.
  subroutine broadcast_targets(team, whole, placed, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: whole  !! used on the leader alone
    logical, intent(in) :: placed             !! the leader has their present positions
    type(dem_data_type), intent(inout) :: part
    real(wp), allocatable :: rows(:, :)
    integer(i4) :: i, k, at

    allocate (rows(target_id, count(part%grains%kind /= kind_free &
                                    .and. part%grains%kind /= kind_mirror)))
    k = 0
    do i = 1, part%grains%n
      if (part%grains%kind(i) == kind_free .or. part%grains%kind(i) == kind_mirror) cycle
      k = k + 1
      if (.not. team%leads()) cycle
      at = index_of(whole, real(part%grains%id(i), wp))
      call pack_target(whole%grains, at, rows(:, k))
    end do
    call broadcast_matrix(team, rows)
    do k = 1, size(rows, 2)
      call take_target(part, rows(:, k), placed)
    end do
  end subroutine broadcast_targets

  pure subroutine pack_target(g, i, row)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: row(:)
    row(target_position(1):target_position(2)) = g%x(:, i)
    row(target_quat(1):target_quat(2)) = g%quat(:, i)
    row(target_velocity(1):target_velocity(2)) = g%v(:, i)
    row(target_spin(1):target_spin(2)) = g%omega(:, i)
    row(target_given) = merge(1.0_wp, 0.0_wp, g%has_target(i))
    row(target_end_position(1):target_end_position(2)) = g%target_x(:, i)
    row(target_end_quat(1):target_end_quat(2)) = g%target_quat(:, i)
    row(target_turn(1):target_turn(2)) = g%turn(:, i)
    row(target_id) = real(g%id(i), wp)
  end subroutine pack_target

  subroutine take_target(part, row, placed)
    type(dem_data_type), intent(inout) :: part
    real(wp), intent(in) :: row(:)
    logical, intent(in) :: placed
    integer(i4) :: i
    i = index_of(part, row(target_id))
    associate (g => part%grains)
      if (placed) g%x(:, i) = row(target_position(1):target_position(2))
      if (placed) g%quat(:, i) = row(target_quat(1):target_quat(2))
      g%v(:, i) = row(target_velocity(1):target_velocity(2))
      g%omega(:, i) = row(target_spin(1):target_spin(2))
      g%has_target(i) = row(target_given) > 0.0_wp
      g%target_x(:, i) = row(target_end_position(1):target_end_position(2))
      g%target_quat(:, i) = row(target_end_quat(1):target_end_quat(2))
      g%turn(:, i) = row(target_turn(1):target_turn(2))
      call put_body(g, i, part%pairs%body(:, i))
      call put_frame(g%shapes, i, g%quat(:, i))
    end associate
  end subroutine take_target

  !> Extra forces of the grains that are marked.
  subroutine broadcast_loads(team, whole, marked, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: whole  !! used on the leader alone
    logical, intent(in) :: marked(:)          !! grains of the whole, used on the leader alone
    type(dem_data_type), intent(inout) :: part
    real(wp), allocatable :: rows(:, :)
    integer(i4) :: n(1), i, k

    n = count(marked)
    call team%broadcast_numbers(n)
    allocate (rows(load_moment(2), n(1)))
    k = 0
    do i = 1, merge(whole%grains%n, 0_i4, team%leads())
      if (.not. marked(i)) cycle
      k = k + 1
      rows(load_id, k) = real(whole%grains%id(i), wp)
      rows(load_force(1):load_force(2), k) = whole%grains%extra_force(:, i)
      rows(load_moment(1):load_moment(2), k) = whole%grains%extra_moment(:, i)
    end do
    call broadcast_matrix(team, rows)
    do k = 1, size(rows, 2)
      i = index_of(part, rows(load_id, k))
      if (i == 0) cycle
      part%grains%extra_force(:, i) = rows(load_force(1):load_force(2), k)
      part%grains%extra_moment(:, i) = rows(load_moment(1):load_moment(2), k)
    end do
  end subroutine broadcast_loads

  subroutine broadcast_parameters(team, par)
    type(ranks_type), intent(in) :: team
    type(dem_parameters_type), intent(inout) :: par
    integer(i4), allocatable :: numbers(:)
    allocate (numbers, source=transfer(par, [0_i4]))
    call team%broadcast_numbers(numbers)
    par = transfer(numbers, par)
  end subroutine broadcast_parameters

  subroutine broadcast_health(team, health)
    type(ranks_type), intent(in) :: team
    type(dem_health_type), intent(inout) :: health
    integer(i4), allocatable :: numbers(:)
    allocate (numbers, source=transfer(health, [0_i4]))
    call team%broadcast_numbers(numbers)
    health = transfer(numbers, health)
  end subroutine broadcast_health

  subroutine broadcast_laws(team, n, part)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(in) :: n  !! materials
    type(dem_data_type), intent(inout) :: part
    integer(i4), allocatable :: numbers(:)
    integer(i4) :: a, b
    if (.not. team%leads()) then
      if (allocated(part%materials)) deallocate (part%materials, part%laws)
      allocate (part%materials(n), part%laws(n, n))
    end if
    do a = 1, n
      numbers = transfer(part%materials(a), [0_i4])
      call team%broadcast_numbers(numbers)
      part%materials(a) = transfer(numbers, part%materials(a))
      do b = 1, n
        numbers = transfer(part%laws(a, b), [0_i4])
        call team%broadcast_numbers(numbers)
        part%laws(a, b) = transfer(numbers, part%laws(a, b))
        call bind_law(part%laws(a, b))
      end do
    end do
  end subroutine broadcast_laws

  subroutine broadcast_planes(team, n, part)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(in) :: n
    type(dem_data_type), intent(inout) :: part
    real(wp) :: none(3, n), up(3, n)
    integer(i4) :: material(n)
    none = 0.0_wp
    up = 1.0_wp
    material = 1
    if (.not. team%leads()) call make_planes(part%planes, none, up, none, material)
    if (n == 0) return
    call team%broadcast_numbers(part%planes%material)
    call broadcast_matrix(team, part%planes%point)
    call broadcast_matrix(team, part%planes%normal)
    call broadcast_matrix(team, part%planes%velocity)
  end subroutine broadcast_planes

  !> Additional contact models, and bonds. Those made and broken so far are the leader's.
  subroutine broadcast_additional(team, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part
    type(dem_additional_type) :: fresh
    real(wp) :: given(1), of_run(most_models), own(most_own*most_models)

    if (.not. team%leads()) part%pairs%additional = fresh
    associate (additional => part%pairs%additional)
      given = merge(1.0_wp, 0.0_wp, additional%bond%given)
      of_run = merge(1.0_wp, 0.0_wp, additional%of_run)
      own = reshape(additional%own, [size(own)])
      call team%broadcast_values(given)
      call team%broadcast_values(of_run)
      call team%broadcast_values(own)
      if (team%leads()) return
      additional%bond%given = given(1) > 0.0_wp
      additional%of_run = of_run > 0.0_wp
      additional%own = reshape(own, [most_own, most_models])
    end associate
    call plan_additional(part%laws, part%pairs%additional)
  end subroutine broadcast_additional

  subroutine broadcast_cell(team, cell)
    type(ranks_type), intent(in) :: team
    type(dem_cell_type), intent(inout) :: cell
    integer(i4), allocatable :: numbers(:)
    allocate (numbers, source=transfer(cell, [0_i4]))
    call team%broadcast_numbers(numbers)
    cell = transfer(numbers, cell)
  end subroutine broadcast_cell

  !> Skin of the list and when it was made; the step of the ledger, which the leader's part holds.
  subroutine broadcast_list(team, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part
    type(dem_ledger_type) :: fresh
    real(wp) :: values(5)
    values = [part%pairs%skin, part%pairs%least_skin, part%pairs%most_skin, part%ledger_dt, &
              real(part%pairs%built_at, wp)]
    call team%broadcast_values(values)
    part%pairs%skin = values(1)
    part%pairs%least_skin = values(2)
    part%pairs%most_skin = values(3)
    part%ledger_dt = values(4)
    part%pairs%built_at = nint(values(5), i8)
    if (.not. team%leads()) part%ledger = fresh
  end subroutine broadcast_list

  !> All ranks hold all prescribed grains; their sums so far are the leader's.
  subroutine broadcast_prescribed(team, n, part)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(in) :: n
    type(dem_data_type), intent(inout) :: part
    real(wp), allocatable :: rows(:, :)
    if (team%leads()) then
      call pack_grains(part, part%grains%kind /= kind_free, rows)
    else
      allocate (rows(grain_reals(part%halo%shaped), n))
    end if
    call broadcast_matrix(team, rows)
    if (team%leads()) return
    rows(:sum_reals, :) = 0.0_wp
    part%pairs%blocks = 0  ! contacts of an earlier state do not belong to this one
    call make_local(part, rows)
  end subroutine broadcast_prescribed
end module dem_distribute
