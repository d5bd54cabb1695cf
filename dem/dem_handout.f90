!> What the leader tells the other ranks: how the system moves, its laws, planes and prescribed
!! grains at the start; what may change between steps before each of them.
module dem_handout
  use talus_kinds, only: wp, i4, i8
  use talus_ranks, only: ranks_type
  use dem_state, only: dem_data_type, dem_parameters_type, &
    dem_health_type, dem_ledger_type, kind_free
  use dem_make, only: make_planes
  use dem_migrate, only: pack_grains, make_local
  use dem_records, only: grain_size, part_size
  implicit none
  private
  public :: hand_out, tell_step

contains

  !> The leader's part is the whole system; the others get what all ranks know. Sums of planes and
  !! prescribed grains stay with the leader.
  subroutine hand_out(team, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part
    integer(i4) :: sizes(4)

    if (team%leads()) sizes = [size(part%materials, kind=i4), part%planes%n, &
                               int(count(part%grains%kind /= kind_free), i4), &
                               merge(9_i4, 15_i4, all_round(part))]
    call team%tell_numbers(sizes)
    part%halo%width = sizes(4)
    call tell_parameters(team, part%par)
    call tell_health(team, part%health)
    call tell_laws(team, sizes(1), part)
    call tell_planes(team, sizes(2), part)
    call tell_list(team, part)
    call tell_prescribed(team, sizes(3), part)
  end subroutine hand_out

  !> Are all grains spheres?
  pure logical function all_round(d)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: i
    all_round = .false.
    do i = 1, d%grains%n
      if (maxval(d%grains%axes(:, i)) > minval(d%grains%axes(:, i))) return
    end do
    all_round = .true.
  end function all_round

  !> What may have changed since the last steps: parameters and velocities of planes.
  subroutine tell_step(team, whole, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(in) :: whole  !! of the leader; the others name any
    type(dem_data_type), intent(inout) :: part
    if (team%leads()) then
      part%par = whole%par
      part%planes%velocity = whole%planes%velocity
    end if
    call tell_parameters(team, part%par)
    if (part%planes%n > 0) call tell_matrix(team, part%planes%velocity)
  end subroutine tell_step

  subroutine tell_parameters(team, par)
    type(ranks_type), intent(in) :: team
    type(dem_parameters_type), intent(inout) :: par
    integer(i4), allocatable :: numbers(:)
    numbers = transfer(par, [0_i4])
    call team%tell_numbers(numbers)
    par = transfer(numbers, par)
  end subroutine tell_parameters

  subroutine tell_health(team, health)
    type(ranks_type), intent(in) :: team
    type(dem_health_type), intent(inout) :: health
    integer(i4), allocatable :: numbers(:)
    numbers = transfer(health, [0_i4])
    call team%tell_numbers(numbers)
    health = transfer(numbers, health)
  end subroutine tell_health

  subroutine tell_laws(team, n, part)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(in) :: n  !! materials
    type(dem_data_type), intent(inout) :: part
    integer(i4), allocatable :: numbers(:)
    integer(i4) :: a, b
    if (.not. team%leads()) allocate (part%materials(n), part%laws(n, n))
    do a = 1, n
      numbers = transfer(part%materials(a), [0_i4])
      call team%tell_numbers(numbers)
      part%materials(a) = transfer(numbers, part%materials(a))
      do b = 1, n
        numbers = transfer(part%laws(a, b), [0_i4])
        call team%tell_numbers(numbers)
        part%laws(a, b) = transfer(numbers, part%laws(a, b))
      end do
    end do
  end subroutine tell_laws

  subroutine tell_planes(team, n, part)
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
    call team%tell_numbers(part%planes%material)
    call tell_matrix(team, part%planes%point)
    call tell_matrix(team, part%planes%normal)
    call tell_matrix(team, part%planes%velocity)
  end subroutine tell_planes

  subroutine tell_matrix(team, matrix)
    type(ranks_type), intent(in) :: team
    real(wp), intent(inout), contiguous :: matrix(:, :)
    real(wp) :: values(size(matrix))
    values = reshape(matrix, [size(matrix)])
    call team%tell_values(values)
    matrix = reshape(values, shape(matrix))
  end subroutine tell_matrix

  !> Skin of the list and when it was made; the step of the ledger, which the leader's part holds.
  subroutine tell_list(team, part)
    type(ranks_type), intent(in) :: team
    type(dem_data_type), intent(inout) :: part
    type(dem_ledger_type) :: fresh
    real(wp) :: values(5)
    values = [part%pairs%skin, part%pairs%least_skin, part%pairs%most_skin, part%ledger_dt, &
              real(part%pairs%built_at, wp)]
    call team%tell_values(values)
    part%pairs%skin = values(1)
    part%pairs%least_skin = values(2)
    part%pairs%most_skin = values(3)
    part%ledger_dt = values(4)
    part%pairs%built_at = nint(values(5), i8)
    if (.not. team%leads()) part%ledger = fresh
  end subroutine tell_list

  !> All ranks hold all prescribed grains; their sums so far are the leader's.
  subroutine tell_prescribed(team, n, part)
    type(ranks_type), intent(in) :: team
    integer(i4), intent(in) :: n
    type(dem_data_type), intent(inout) :: part
    real(wp), allocatable :: rows(:, :)
    if (team%leads()) then
      call pack_grains(part, part%grains%kind /= kind_free, rows)
    else
      allocate (rows(grain_size, n))
    end if
    if (n > 0) call tell_matrix(team, rows)
    if (team%leads()) return
    rows(:part_size, :) = 0.0_wp
    call make_local(part, rows)
  end subroutine tell_prescribed
end module dem_handout
