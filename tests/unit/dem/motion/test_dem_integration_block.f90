!> Distances moved that blocks report: never less than they have, and what they have where it
!! matters.
program test_dem_integration_block
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_integrate, only: drift_block
  use dem_make, only: make_grains, make_planes
  use dem_integration_block, only: integration_block_type, block_state_type, load_block, &
    load_side, ready_state, follow_travel, travel_of_block
  use dem_pairs, only: allocate_bodies
  use dem_state, only: dem_grains_type, dem_material_type, dem_pairs_type, &
    dem_planes_type, kind_free, lanes
  use talus_test, only: larger, test_type
  implicit none

  real(wp), parameter :: dt = 1.0e-5_wp, speed = 0.4_wp, spin = 300.0_wp
  type(test_type) :: test

  call follow('ellipsoids that turn', [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], 0.0_wp)
  call follow('ellipsoids that turn and go', [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], speed)
  call follow('spheres', [2.0e-3_wp, 2.0e-3_wp, 2.0e-3_wp], speed)
  call test%finish()

contains

  !> Grains without forces, until they have moved by the skin.
  subroutine follow(name, axes, v)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: axes(3), v
    type(dem_grains_type) :: grains
    type(dem_planes_type) :: planes
    type(dem_pairs_type) :: pairs
    type(integration_block_type) :: block
    type(block_state_type) :: state
    real(wp) :: exact, least, excess
    integer(i4) :: step
    logical :: found

    call make(grains, planes, pairs, axes, v)
    call load_block(grains, pairs, 0_i4, grains%n, block)
    call load_side(block, grains, pairs, state)
    call ready_state(block, grains, state)
    least = huge(least)
    excess = 0.0_wp
    found = .true.
    do step = 1, 1000
      call drift_block(block, state, dt)
      call follow_travel(block, state, pairs, dt, step == 1)
      exact = travel_of_block(block, state, pairs%reference_x(:, :lanes), &
                              pairs%reference_q(:, :lanes), pairs%reach(:lanes))
      least = min(least, block%travel/exact)
      excess = larger(excess, block%travel/exact)
      if (exact > 0.5_wp*pairs%skin) found = found .and. abs(block%travel - exact) <= 0.0_wp
      if (exact > pairs%skin) exit
    end do
    call test%check(name//': it goes as far', exact > pairs%skin .and. step > 10)
    call test%check(name//': never less than the travel', least >= 1.0_wp - 1.0e-12_wp)
    call test%check(name//': not much more', excess < 3.0_wp)
    call test%check(name//': beyond half the skin it is the travel', found)
  end subroutine follow

  !> Free grains of one form, turned and moving in all directions.
  subroutine make(grains, planes, pairs, axes, v)
    type(dem_grains_type), intent(out) :: grains
    type(dem_planes_type), intent(out) :: planes
    type(dem_pairs_type), intent(out) :: pairs
    real(wp), intent(in) :: axes(3), v
    type(error_list_type) :: errors
    real(wp) :: way(3, lanes), quat(4, lanes)
    integer(i8) :: id(lanes)
    integer(i4) :: k

    do k = 1, lanes
      id(k) = k
      way(:, k) = [cos(1.3_wp*k), sin(1.3_wp*k), cos(2.1_wp*k)]
      quat(:, k) = [cos(0.7_wp*k), 0.6_wp*sin(0.7_wp*k), 0.0_wp, 0.8_wp*sin(0.7_wp*k)]
    end do
    call make_grains(grains, [dem_material_type(1.0e7_wp, 0.25_wp, 2650.0_wp)], id, &
                     [(kind_free, k=1, lanes)], [(1_i4, k=1, lanes)], 0.01_wp*way, quat, &
                     spread(axes, 2, lanes), v*way, spin*way, errors)
    call test%check('grains are made', .not. errors%any())
    call make_planes(planes, reshape([real(wp) ::], [3, 0]), reshape([real(wp) ::], [3, 0]), &
                     reshape([real(wp) ::], [3, 0]), [integer(i4) ::])
    call allocate_bodies(pairs, grains, planes)
    pairs%reference_x(:, :lanes) = grains%x
    pairs%reference_q(:, :lanes) = grains%quat
    pairs%skin = 1.5e-4_wp
  end subroutine make
end program test_dem_integration_block
