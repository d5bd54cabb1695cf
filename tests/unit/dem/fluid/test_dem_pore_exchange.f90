!> Exchanges of grains and liquid: the mass, the ledger, momentum, a motion that is none, restarts.
program test_dem_pore_exchange
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type, max_abs
  use dem_archive, only: dem_archive_type
  use dem_law, only: make_linear_law
  use dem_make, only: make_grains, make_planes
  use dem_pore_exchange, only: begin_exchange, book_liquid, end_exchange
  use dem_pore_laws, only: law_index
  use dem_pore_mixing, only: alternating
  use dem_pore_partner, only: node_storage
  use dem_pore_start, only: begin_pore, carry_liquid
  use dem_pore_state, only: drain_pressure, sum_work, sum_swept, sum_inflow, sum_drag
  use dem_state, only: kind_free, kind_driven
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: d = 1.0e-3_wp, edge = 8.0e-3_wp, dt = 1.0e-6_wp
  real(wp), parameter :: limit = 1.0e5_wp  !! cavitation [Pa]
  integer(i4), parameter :: n = 400

  call check_cloud()
  call check_box()
  call check_cavity()
  call check_mixing()
  call check_strain()
  call check_drift()
  call check_restart()
  call test%finish()

contains

  !> Numbers in (0, 1) without pattern.
  pure real(wp) function some(i, k)
    integer(i4), intent(in) :: i, k
    real(wp), parameter :: step(5) = [0.6180339887_wp, 0.7548776662_wp, 0.5698402909_wp, &
                                      0.8191725134_wp, 0.4501945237_wp]
    some = modulo(i*step(k) + 0.5_wp, 1.0_wp)
  end function some

  !> Small spheres apart from each other on a grid of 8 x 8 x 8 places (scale of velocities [m/s]),
  !! in 2 x 2 x 2 bricks; the first one is driven, all six sides have walls.
  subroutine make_cloud(s, speed, driven)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: speed
    logical, intent(in) :: driven
    type(error_list_type) :: errors
    real(wp), dimension(3, n) :: x, axes, v, omega
    real(wp) :: quat(4, n), point(3, 6), normal(3, 6), still(3, 6)
    integer(i8) :: id(n)
    integer(i4) :: kind(n), i

    do i = 1, n
      id(i) = i
      x(:, i) = d*([modulo(i, 8), modulo(i/8, 8), i/64] + 0.3_wp + 0.4_wp*[some(i, 1), &
                   some(i, 2), some(i, 3)])
      v(:, i) = speed*([some(i, 4), some(i, 5), some(i + 9, 1)] - 0.5_wp)
      axes(:, i) = d*(0.1_wp + 0.1_wp*some(i, 5))
    end do
    quat = spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, n)
    omega = 0.0_wp
    kind = kind_free
    if (driven) kind(1) = kind_driven
    allocate (s%materials(1))
    s%materials(1)%density = 2650.0_wp
    allocate (s%laws(1, 1))
    s%laws(1, 1) = make_linear_law(1.0e4_wp, 1.0e3_wp, 0.3_wp, 0.0_wp, 0.0_wp)
    call make_grains(s%grains, s%materials, id, kind, spread(1_i4, 1, n), x, quat, axes, v, omega, &
                     errors)
    point = 0.0_wp
    point(1, 2) = edge
    point(2, 4) = edge
    point(3, 6) = edge
    normal = 0.0_wp
    do i = 1, 3
      normal(i, 2*i - 1) = 1.0_wp
      normal(i, 2*i) = -1.0_wp
    end do
    still = 0.0_wp
    call make_planes(s%planes, point, normal, still, [1, 1, 1, 1, 1, 1])
    call test%check('grains', .not. errors%any())
    s%par%dt = dt
    call wet(s)
  end subroutine make_cloud

  !> A liquid in the box.
  subroutine wet(s)
    type(dem_system_type), intent(inout) :: s
    associate (p => s%pore)
      p%grid%bricks = 2
      p%grid%upper = edge
      p%liquid%density = 1000.0_wp
      p%liquid%viscosity = 1.0e-3_wp
      p%liquid%compliance = 1.0_wp/2.2e9_wp
      p%liquid%law = law_index('kozeny_carman')
      p%free_surface = .false.
      p%wall = reshape([1, 2, 3, 4, 5, 6], [2, 3])
      call begin_pore(s%grains, p)
    end associate
    call carry_liquid(s%dem_data_type)
    s%pore%active = .true.
  end subroutine wet

  !> Steps with an exchange every fourth.
  subroutine advance(s, steps, errors)
    type(dem_system_type), intent(inout) :: s
    integer(i4), intent(in) :: steps
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, steps/4
      call end_exchange(s%dem_data_type, s%health%steps*dt)
      call begin_exchange(s%dem_data_type, s%health%steps*dt, 4.0_wp*dt, limit, errors)
      if (errors%any()) return
      call s%step(4, errors)
    end do
    call end_exchange(s%dem_data_type, s%health%steps*dt)
  end subroutine advance

  !> Grains that move at random between drained and tight sides.
  subroutine check_cloud()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: scale, momentum(3)
    integer(i4) :: i
    call make_cloud(s, 0.2_wp, .true.)
    s%pore%drain(2, 3) = drain_pressure
    s%pore%drain_value(2, 3) = 500.0_wp
    s%par%damping = 2000.0_wp
    s%par%gravity = [1.0_wp, 2.0_wp, -9.81_wp]
    call s%init(errors)
    call advance(s, 40, errors)
    call test%check('no faults', .not. errors%any())
    call s%refresh_ledger()
    scale = s%ledger%kinetic
    call test%check_close('ledger', s%closure()/scale, 0.0_wp, 1.0e-12_wp)
    call test%check('work was done', abs(s%pore%sums(sum_work)) > 1.0e-7_wp*scale)
    call test%check('drag dissipates', s%pore%sums(sum_drag) > 0.0_wp)
    call test%check('Darcy dissipates', s%ledger%darcy > 0.0_wp)
    call test%check_close('mass', (sum(s%pore%omega) - s%pore%sums(sum_inflow) &
                          - s%pore%sums(sum_swept))/edge**3, 0.0_wp, 1.0e-14_wp)
    momentum = 0.0_wp
    do i = 1, n
      momentum = momentum + s%pore%drag(:, i)
    end do
    call test%check_all_close('drag has no resultant', momentum/max_abs(s%pore%drag), 0.0_wp, &
                              1.0e-11_wp)
    call test%check('drag is against the motion', sum(s%pore%drag*s%grains%v) < 0.0_wp)
    call advance(s, 4, errors)
    call begin_exchange(s%dem_data_type, s%health%steps*dt, 4.0_wp*dt, limit, errors)
    call s%step(2, errors)
    call s%refresh_ledger()
    call test%check_close('ledger within an exchange', s%closure()/scale, 0.0_wp, 1.0e-12_wp)
  end subroutine check_cloud

  !> A wall that moves into the box compresses the liquid by what it sweeps.
  subroutine check_box()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: swept
    call make_cloud(s, 0.0_wp, .false.)
    call s%init(errors)
    s%planes%velocity(3, 6) = -0.01_wp
    call advance(s, 40, errors)
    call s%refresh_ledger()
    swept = 0.01_wp*40.0_wp*dt*edge**2
    call test%check_close('swept volume', s%pore%sums(sum_swept)/swept, 1.0_wp, 1.0e-9_wp)
    call test%check_close('is in the liquid', sum(s%pore%omega)/swept, 1.0_wp, 1.0e-9_wp)
    call test%check_close('ledger', s%closure()/s%ledger%liquid_flow, 0.0_wp, 1.0e-9_wp)
    call test%check('walls work on the liquid', s%ledger%liquid_flow > 0.0_wp)
  end subroutine check_box

  !> A wall goes out and back: the liquid cavitates, lacks what is missing, is filled again.
  subroutine check_cavity()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    call make_cloud(s, 0.0_wp, .false.)
    s%par%damping = 1.0e5_wp
    call s%init(errors)
    s%planes%velocity(3, 6) = 0.05_wp
    call advance(s, 80, errors)
    call test%check_close('it cavitates', minval(s%pore%p)/limit, -1.0_wp, 1.0e-12_wp)
    call test%check('and lacks more than the tension gives', &
                    sum(s%pore%omega) < -2.0_wp*limit/2.2e9_wp*edge**3)
    call test%check_close('all of it', sum(s%pore%omega)/(-0.05_wp*80.0_wp*dt*edge**2), 1.0_wp, &
                          1.0e-9_wp)
    s%planes%velocity(3, 6) = -0.05_wp
    call advance(s, 80, errors)
    s%planes%velocity(3, 6) = 0.0_wp
    call advance(s, 400, errors)
    call test%check_all_close('filled again', s%pore%p/limit, 0.0_wp, 1.0e-2_wp)
    call test%check('no faults', .not. errors%any())
    call s%refresh_ledger()
    call test%check_close('ledger', s%closure()/s%ledger%liquid_flow, 0.0_wp, 1.0e-9_wp)
  end subroutine check_cavity

  !> Volumes of +1 and -1 in turn, which press no grain, mix until nothing is left; sums stay and
  !! what is lost is in the ledger.
  subroutine check_mixing()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: high = 1.0e4_wp  !! [Pa]
    real(wp) :: content, closure, stored, c(27)
    integer(i4) :: a
    call make_cloud(s, 0.0_wp, .false.)
    call s%init(errors)
    call advance(s, 4, errors)
    call node_storage(s%pore, c)
    s%pore%omega = high*c*[((-1)**a, a=1, size(c))]  ! of 3 x 3 x 3 nodes
    content = sum(s%pore%omega)
    stored = 0.5_wp*sum(s%pore%omega**2/c)
    s%pore%stored = stored
    call book_liquid(s%dem_data_type)
    call s%refresh_ledger()
    closure = s%closure()
    call advance(s, 4, errors)
    call test%check('they are mixed', alternating(s%pore) < 1.0e-3_wp*high)
    call advance(s, 40, errors)
    call test%check('for good', alternating(s%pore) < 1.0e-6_wp*high)
    call test%check_close('nothing came or went', (sum(s%pore%omega) - content)/edge**3, 0.0_wp, &
                          1.0e-16_wp)
    call s%refresh_ledger()
    call test%check('what they stored is lost', s%pore%stored < 1.0e-6_wp*stored)
    call test%check_close('ledger', (s%closure() - closure)/stored, 0.0_wp, 1.0e-9_wp)
  end subroutine check_mixing

  !> A uniform strain is not dragged.
  subroutine check_strain()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    integer(i4) :: i
    call make_cloud(s, 0.0_wp, .false.)
    s%pore%wall = 0
    s%pore%drain = drain_pressure
    do i = 1, n
      s%grains%v(:, i) = [2.0_wp, -3.0_wp, 1.0_wp]*s%grains%x([2, 2, 3], i)
    end do
    call s%init(errors)
    call begin_exchange(s%dem_data_type, 0.0_wp, 4.0_wp*dt, limit, errors)
    call test%check_all_close('no drag', s%pore%drag/1.0e-9_wp, 0.0_wp, 1.0e-6_wp)
    s%grains%v(3, :) = s%grains%v(3, :) + s%grains%x(3, :)**2
    call begin_exchange(s%dem_data_type, 0.0_wp, 4.0_wp*dt, limit, errors)
    call test%check('but what bends is', max_abs(s%pore%drag) > 1.0e-12_wp)
  end subroutine check_strain

  !> All grains drift alike without walls on the way: no pressure at all.
  subroutine check_drift()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    integer(i4) :: i
    call make_cloud(s, 0.0_wp, .false.)
    s%pore%wall = 0
    s%pore%drain = drain_pressure
    do i = 1, n
      s%grains%v(:, i) = [0.02_wp, -0.01_wp, 0.015_wp]
    end do
    call s%init(errors)
    call advance(s, 40, errors)
    call test%check_all_close('no pressure', s%pore%p, 0.0_wp, 1.0e-3_wp)
    call test%check_all_close('speeds stay', s%grains%v(1, :), 0.02_wp, 1.0e-12_wp)
  end subroutine check_drift

  !> The archive in the middle of an exchange: the same bits go on.
  subroutine check_restart()
    type(dem_system_type) :: s, copy
    type(dem_archive_type) :: archive
    type(error_list_type) :: errors
    call make_cloud(s, 0.2_wp, .true.)
    call make_cloud(copy, 0.2_wp, .true.)
    call s%init(errors)
    call advance(s, 20, errors)
    call begin_exchange(s%dem_data_type, s%health%steps*dt, 4.0_wp*dt, limit, errors)
    call s%step(2, errors)
    call s%refresh_ledger()
    call s%export_state(archive)
    call copy%import_state(archive, errors)
    call test%check('taken', .not. errors%any())
    call test%check('same pressures', all(abs(copy%pore%p - s%pore%p) <= 0.0_wp))
    call finish(s)
    call finish(copy)
    call test%check('same bits', all(abs(copy%pore%p - s%pore%p) <= 0.0_wp) .and. &
                    all(abs(copy%pore%omega - s%pore%omega) <= 0.0_wp) .and. &
                    all(abs(copy%grains%x - s%grains%x) <= 0.0_wp))
    call test%check_close('same closure', copy%closure(), s%closure(), 0.0_wp)
    copy%pore%active = .false.
    call copy%import_state(archive, errors)
    call test%check('a dry run does not go on from a wet one', errors%any())
  end subroutine check_restart

  subroutine finish(s)
    type(dem_system_type), intent(inout) :: s
    type(error_list_type) :: errors
    call s%step(2, errors)
    call advance(s, 20, errors)
    call s%refresh_ledger()
  end subroutine finish
end program test_dem_pore_exchange
