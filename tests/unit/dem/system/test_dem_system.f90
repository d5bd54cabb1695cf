!> A falling heap in a box: same bits for threads, list margins and restarts; ledger, momentum,
!! impulses, prescribed motion, split verbs, memory.
program test_dem_system
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, max_abs, test_type
  use dem_state, only: kind_free, kind_fixed, kind_driven, kind_ghost, &
    mode_relaxation
  use dem_law, only: make_law
  use dem_make, only: make_grains, make_planes, prescribe_some
  use dem_archive, only: dem_archive_type
  use dem_parts_forces, only: begin_ahead, is_left, slice_of_free, forces_on_rim
  use dem_contacts, only: stiffness_on
  use dem_measure, only: coordination_of, contact_count, momentum_of
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  type(test_type) :: test
  integer(i4) :: seed = 1
  type(dem_system_type) :: ripe  !! a heap with many contacts

  call omp_set_num_threads(1)
  call check_bits()
  call check_ledger()
  call check_restart()
  call check_memory()
  call check_prescribed()
  call check_split_verbs()
  call check_parts()
  call check_relaxation()
  call check_lists()
  call check_faults()
  call test%finish()

contains

  real(wp) function uniform()
    seed = int(mod(16807_i8*seed, 2147483647_i8), i4)
    uniform = seed/2147483647.0_wp
  end function uniform

  !> Five layers of ellipsoids above a floor of fixed spheres and one driven grain, planes around;
  !! listed backwards, so that the order of the file is not that of the ids.
  subroutine make_heap(s, skin, friction, ratio)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: skin, friction, ratio
    integer(i4), parameter :: m = 4, layers = 5, n = m*m*(layers + 1) + 1
    type(error_list_type) :: errors
    integer(i8) :: id(n)
    integer(i4) :: kind(n), material(n), i, j, k, at
    real(wp) :: x(3, n), q(4, n), a(3, n), v(3, n), w(3, n)

    seed = 4711
    at = n + 1
    v = 0.0_wp
    w = 0.0_wp
    do k = 0, layers
      do j = 1, m
        do i = 1, m
          at = at - 1
          id(at) = 10 + n - at
          x(:, at) = 5.0e-3_wp*[real(i, wp) - 2.5_wp, real(j, wp) - 2.5_wp, real(k, wp)]
          q(:, at) = [uniform() - 0.5_wp, uniform() - 0.5_wp, uniform() - 0.5_wp, &
                      uniform() - 0.5_wp]
          q(:, at) = q(:, at)/sqrt(sum(q(:, at)**2))
          a(:, at) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]
          v(:, at) = [0.2_wp*uniform(), 0.2_wp*uniform(), -0.5_wp]
          w(:, at) = 50.0_wp*[uniform(), uniform(), uniform()]
          kind(at) = kind_free
          if (k == 0) kind(at) = kind_fixed
          if (k == 0) a(:, at) = 2.45e-3_wp
          if (k == 0) v(:, at) = 0.0_wp
          if (k == 0) w(:, at) = 0.0_wp
        end do
      end do
    end do
    id(1) = 5000
    x(:, 1) = [0.0_wp, 0.0_wp, 34.0e-3_wp]
    q(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    a(:, 1) = [3.0e-3_wp, 3.0e-3_wp, 6.0e-3_wp]
    v(:, 1) = [0.0_wp, 0.0_wp, -0.5_wp]
    w(:, 1) = [0.0_wp, 0.0_wp, 20.0_wp]
    kind(1) = kind_driven
    material = 1
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e6_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), friction, ratio, &
                            ratio)
    call make_grains(s%grains, s%materials, id, kind, material, x, q, a, v, w, errors)
    call make_box(s)
    s%par%gravity = [0.0_wp, 0.0_wp, -9.81_wp]
    s%par%skin = skin
    s%par%overlap_limit = 0.5_wp
    s%par%dt = 1.2e-5_wp
    call s%init(errors)
    call test%check('heap made without faults', .not. errors%any())
  end subroutine make_heap

  !> Four walls, one of which moves.
  subroutine make_box(s)
    type(dem_system_type), intent(inout) :: s

    call make_planes(s%planes, reshape([-10.1e-3_wp, 0.0_wp, 0.0_wp, 10.1e-3_wp, 0.0_wp, 0.0_wp, &
                                        0.0_wp, -10.1e-3_wp, 0.0_wp, 0.0_wp, 10.1e-3_wp, 0.0_wp], &
                                            [3, 4]), &
                     reshape([1.0_wp, 0.0_wp, 0.0_wp, -1.0_wp, 0.0_wp, 0.0_wp, &
                              0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, -2.0_wp, 0.0_wp], [3, 4]), &
                     reshape([0.1_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                              0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [3, 4]), [1, 1, 1, &
                                                  1])
  end subroutine make_box

  logical function same_bits(a, b)
    type(dem_system_type), intent(in) :: a, b
    same_bits = same_motion(a, b) &
                .and. all(transfer(a%grains%impulse, [0_i8]) == transfer(b%grains%impulse, [0_i8]))
  end function same_bits

  !> The same but for impulses, which add up in the order of evaluations.
  logical function same_motion(a, b)
    type(dem_system_type), intent(in) :: a, b
    same_motion = all(transfer(a%grains%x, [0_i8]) == transfer(b%grains%x, [0_i8])) &
                .and. all(transfer(a%grains%quat, [0_i8]) == transfer(b%grains%quat, [0_i8])) &
                .and. all(transfer(a%grains%v, [0_i8]) == transfer(b%grains%v, [0_i8])) &
                .and. all(transfer(a%grains%omega, [0_i8]) == transfer(b%grains%omega, [0_i8])) &
                .and. all(transfer(a%grains%force, [0_i8]) == transfer(b%grains%force, [0_i8]))
  end function same_motion

  logical function same_ledger(a, b)
    type(dem_system_type), intent(in) :: a, b
    same_ledger = all(transfer(a%ledger, [0_i8]) == transfer(b%ledger, [0_i8]))
  end function same_ledger

  !> Forces in parts: pairs without ghosts evaluated before these are placed, or after they were
  !! given, a slice at a time, give the bits of forces evaluated at once; also where ghosts use up
  !! the list while slices are under way, and where those between ghosts are last and use it up.
  subroutine check_parts()
    type(dem_system_type) :: at_once, sliced, last
    integer(i8) :: rebuilds
    integer(i4) :: k
    logical :: same

    call make_half(at_once)
    call make_half(sliced)
    call make_half(last)
    same = .true.
    do k = 1, 300
      call at_once%kick_drift(1.2e-5_wp, 1.2e-5_wp)
      call move_ghosts(at_once, k, .true.)
      call at_once%free_forces()
      call last%kick_drift(1.2e-5_wp, 1.2e-5_wp)
      call move_ghosts(last, k, .false.)
      call last%free_forces()
      rebuilds = last%health%rebuilds
      if (k == 200) last%pairs%skin = 1.0e-6_wp
      if (mod(k, 5) == 0) call last%ghost_forces(.true.)
      if (k == 200) call test%check('ghosts used the list up at last', &
                                    last%health%rebuilds > rebuilds)
      same = same .and. same_motion(at_once, last)
      call sliced%kick_drift(1.2e-5_wp, 1.2e-5_wp)
      call omp_set_num_threads(1 + mod(k, 2))
      call begin_ahead(sliced%dem_data_type)
      rebuilds = sliced%health%rebuilds
      if (mod(k, 3) > 0) call slice_of_free(sliced%dem_data_type)
      call move_ghosts(sliced, k, .true.)
      call forces_on_rim(sliced%dem_data_type)
      if (k == 150) call test%check('ghosts used the list up on the way', &
                                    sliced%health%rebuilds > rebuilds .and. sliced%pairs%skin > 0)
      same = same .and. all(transfer(at_once%parts%of_free, [0_i8]) &
                            == transfer(sliced%parts%of_free, [0_i8]))
      do while (is_left(sliced%dem_data_type))
        call slice_of_free(sliced%dem_data_type)
      end do
      call omp_set_num_threads(1)
      same = same .and. same_bits(at_once, sliced)
    end do
    call test%check('parts: the same bits', same)
    call test%check('ghosts are pushed, and by ghosts', &
                    max_abs(sliced%parts%of_free) > 0.0_wp .and. &
                    max_abs(sliced%parts%of_ghosts) > 0.0_wp)
    call at_once%refresh_ledger()
    call sliced%refresh_ledger()
    associate (a => at_once%ledger, b => sliced%ledger)
      call test%check('friction and dashpots worked', a%friction > 0.0_wp .and. &
                      a%contact_damping > 0.0_wp)
      call test%check_close('parts: friction', b%friction, a%friction, 1.0e-12_wp*a%friction)
      call test%check_close('parts: dashpots', b%contact_damping, a%contact_damping, &
                            1.0e-12_wp*a%contact_damping)
      call test%check_close('parts: work of ghosts', b%boundary, a%boundary, &
                            1.0e-12_wp*abs(a%boundary))
      call test%check_close('parts: stored', b%elastic_normal + b%elastic_tangential, &
        a%elastic_normal + a%elastic_tangential, 1.0e-12_wp*a%elastic_normal)
    end associate

  end subroutine check_parts

  !> The heap, half of which are ghosts from some time on.
  subroutine make_half(s)
    type(dem_system_type), intent(inout) :: s
    type(error_list_type) :: errors
    integer(i4), allocatable :: ghosts(:)
    integer(i4) :: i
    call make_heap(s, 2.0e-4_wp, 0.5_wp, 0.05_wp)
    call s%step(2000, errors)
    where (s%grains%kind == kind_free .and. s%grains%x(1, :) > 0.0_wp) s%grains%kind = kind_ghost
    call prescribe_some(s%grains)
    s%par%ghost_pairs = .true.
    call s%init(errors)
    ghosts = pack([(i, i=1, s%grains%n)], s%grains%kind == kind_ghost)
    call s%set_border(ghosts)
    call test%check('half of the heap are ghosts', size(ghosts) > 10 .and. .not. errors%any())
  end subroutine make_half

  !> Ghosts sway; once they jump by more than half of the list's margin. Forces between them come
  !! with every fifth step, here or later.
  subroutine move_ghosts(s, k, between)
    type(dem_system_type), intent(inout) :: s
    integer(i4), intent(in) :: k
    logical, intent(in) :: between
    real(wp), allocatable :: x(:, :), v(:, :), w(:, :)
    allocate (x, source=s%grains%x(:, s%parts%near))
    allocate (v, w, mold=x)
    w = 0.0_wp
    v = 0.0_wp
    v(1, :) = 0.3_wp*cos(0.05_wp*k)
    if (k == 150) v(1, :) = -0.8_wp*s%pairs%skin/1.2e-5_wp
    x = x + 1.2e-5_wp*v
    call s%place(s%parts%near, x, s%grains%quat(:, s%parts%near), v, w)
    if (mod(k, 5) == 0 .and. between) call s%ghost_forces(.false.)
  end subroutine move_ghosts

  !> Threads, and lists made at other times, change no bit.
  subroutine check_bits()
    type(dem_system_type) :: one, two, wide
    type(error_list_type) :: errors
    call make_heap(one, 2.0e-4_wp, 0.5_wp, 0.05_wp)
    call one%step(2700, errors)
    ripe%dem_data_type = one%dem_data_type
    two%dem_data_type = one%dem_data_type
    call one%step(100, errors)
    call omp_set_num_threads(2)
    call two%step(100, errors)
    call omp_set_num_threads(1)
    call test%check('one and two threads: same bits', same_bits(one, two))
    call one%refresh_ledger()
    call two%refresh_ledger()
    call test%check('one and two threads: same ledger', same_ledger(one, two))
    call make_heap(wide, 5.0e-4_wp, 0.5_wp, 0.05_wp)
    call wide%step(2800, errors)
    call test%check('lists were rebuilt', one%health%rebuilds > wide%health%rebuilds &
                    .and. wide%health%rebuilds > 2)
    call test%check('other lists: same bits', same_bits(one, wide))
    call test%check('no list was late', one%health%late_rebuilds == 0_i8)
    call test%check('heap has contacts', contact_count(one%dem_data_type) > 60)
    call test%check('no faults on the way', .not. errors%any())
  end subroutine check_bits

  !> All columns at work: free, fixed, driven grains, a moving plane, gravity.
  subroutine check_ledger()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: input
    integer :: k
    call make_heap(s, 3.0e-4_wp, 0.5_wp, 0.05_wp)
    s%par%dt = 3.0e-6_wp
    do k = 1, 12
      call s%step(1000, errors)
    end do
    call s%refresh_ledger()
    input = s%ledger%start + abs(s%ledger%gravity) + abs(s%ledger%boundary)
    call test%check_close('ledger of the heap', s%closure()/input, 0.0_wp, 1.0e-4_wp)
    call test%check('friction at work', s%ledger%friction > 0.1_wp*input)
    call test%check('damping at work', s%ledger%contact_damping > 0.02_wp*input)
    call test%check('boundary at work', s%ledger%boundary > 0.01_wp*input)
    call test%check('relaxation positive', s%ledger%tangential_relaxation > 0.0_wp)
    call test%check_close('boundary work is that of the driven grain and the plane', &
                          sum(s%grains%work) + sum(s%planes%work), s%ledger%boundary, &
                              1.0e-12_wp*input)
  end subroutine check_ledger

  !> Steps, export, import into a fresh system, steps: the bits of an uninterrupted run.
  subroutine check_restart()
    type(dem_system_type) :: whole, first, second
    type(dem_archive_type) :: archive
    type(error_list_type) :: errors
    integer(i4) :: k

    whole%dem_data_type = ripe%dem_data_type
    call whole%step(400, errors)
    first%dem_data_type = ripe%dem_data_type
    call first%step(234, errors)
    call first%export_state(archive)
    call make_heap(second, 3.0e-4_wp, 0.5_wp, 0.05_wp)
    call second%import_state(archive, errors)
    call second%step(166, errors)
    call test%check('restart: same bits', same_bits(whole, second))
    call whole%refresh_ledger()
    call second%refresh_ledger()
    call test%check('restart: same ledger', same_ledger(whole, second))
    call test%check('restart: same counts', whole%health%steps == second%health%steps &
                    .and. whole%health%rebuilds == second%health%rebuilds)
    k = archive%find('grains.x')
    archive%item(k)%name = 'other'
    call second%import_state(archive, errors)
    call test%check('missing array is a fault', errors%any())
  end subroutine check_restart

  !> A state kept in memory is restored and continues alike.
  subroutine check_memory()
    type(dem_system_type) :: s, other
    type(error_list_type) :: errors
    s%dem_data_type = ripe%dem_data_type
    call s%step(10, errors)
    call s%save()
    call s%step(50, errors)
    call s%restore()
    call s%step(30, errors)
    other%dem_data_type = ripe%dem_data_type
    call other%step(40, errors)
    call test%check('restored: same bits', same_bits(s, other))
  end subroutine check_memory

  !> A ghost reaches its target exactly; momentum changes by what impulses say.
  subroutine check_prescribed()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    integer(i4), allocatable :: index(:)
    real(wp) :: x1(3, 1), q1(4, 1), before(3), weight(3)
    s%dem_data_type = ripe%dem_data_type
    call s%find([5000_i8], index, errors)
    s%grains%kind(index) = kind_ghost
    call prescribe_some(s%grains)
    x1(:, 1) = s%grains%x(:, index(1)) + [1.0e-4_wp, -2.0e-4_wp, -4.0e-4_wp]
    q1(:, 1) = [0.9_wp, 0.1_wp, -0.2_wp, 0.3_wp]
    q1 = q1/sqrt(sum(q1**2))
    call s%reset_impulses()
    before = momentum_of(s%dem_data_type)
    call s%set_motion(index, x1, q1, 700)
    call s%step(700, errors)
    call test%check('target reached', all(transfer(s%grains%x(:, index(1)), [0_i8]) &
                    == transfer(x1(:, 1), [0_i8])) .and. &
                    all(transfer(s%grains%quat(:, index(1)), [0_i8]) == transfer(q1(:, 1), [0_i8])))
    call test%check('ghost felt grains', sum(abs(s%grains%impulse(:, index(1)))) > 0.0_wp)
    weight = sum(s%grains%mass, mask=s%grains%kind == kind_free)*s%par%gravity
    before = before + 700*s%par%dt*weight - sum(s%grains%impulse, dim=2) - sum(s%planes%impulse, &
                                                  dim=2)
    call test%check_all_close('momentum follows the impulses', &
                          momentum_of(s%dem_data_type), before, 1.0e-14_wp)
    call s%find([7_i8], index, errors)
    call test%check('unknown id is a fault', errors%any())
  end subroutine check_prescribed

  !> Half kick, drift, forces, half kick are a step; a kick with a drift is one before the other.
  subroutine check_split_verbs()
    type(dem_system_type) :: s, split, apart
    type(error_list_type) :: errors
    real(wp) :: scale
    integer :: k
    s%dem_data_type = ripe%dem_data_type
    split%dem_data_type = ripe%dem_data_type
    call s%step(200, errors)
    do k = 1, 200
      call split%kick_drift(0.5_wp*s%par%dt, s%par%dt)
      call split%forces()
      call split%kick_drift(0.5_wp*s%par%dt, 0.0_wp)
    end do
    scale = max_abs(s%grains%v)
    call test%check_all_close('split verbs: positions', s%grains%x, split%grains%x, &
                          1.0e-10_wp)
    call test%check_close('split verbs: velocities', &
                          max_abs(s%grains%v - split%grains%v)/scale, &
                          0.0_wp, 1.0e-6_wp)
    call split%forces()
    call split%refresh_ledger()
    call s%refresh_ledger()
    call test%check_close('split verbs: ledger', split%closure()/s%ledger%start, &
                          s%closure()/s%ledger%start, 1.0e-6_wp)
    apart%dem_data_type = split%dem_data_type
    call apart%kick_drift(s%par%dt, 0.0_wp)
    call apart%kick_drift(0.0_wp, s%par%dt)
    call split%kick_drift(s%par%dt, s%par%dt)
    call test%check('kick and drift in one: same bits', &
                    all(abs(apart%grains%x - split%grains%x) <= 0.0_wp) .and. &
                    all(abs(apart%grains%quat - split%grains%quat) <= 0.0_wp) .and. &
                    all(abs(apart%grains%v - split%grains%v) <= 0.0_wp) .and. &
                    all(abs(apart%pairs%body - split%pairs%body) <= 0.0_wp))
  end subroutine check_split_verbs

  !> Full damping: v = F dt/(2 s m), whatever v was.
  subroutine check_relaxation()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), allocatable :: force(:, :), x(:, :)
    real(wp) :: step, worst
    integer :: i
    s%dem_data_type = ripe%dem_data_type
    s%par%mode = mode_relaxation
    s%par%mass_scale = 10.0_wp
    s%par%inertia_scale = 10.0_wp
    s%par%full_damping = .true.
    s%par%gravity_scale = 0.0_wp
    call s%set_extra([20], reshape([1.0e-3_wp, 0.0_wp, 0.0_wp], [3, 1]), &
                     reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]))
    force = s%grains%force + s%grains%extra_force
    x = s%grains%x
    call s%step(1, errors)
    worst = 0.0_wp
    do i = 1, s%grains%n
      if (s%grains%kind(i) /= kind_free) cycle
      step = s%par%dt**2/(2.0_wp*10.0_wp*s%grains%mass(i))
      worst = larger(worst, max_abs(s%grains%x(:, i) - x(:, i) - step*force(:, i)))
    end do
    call test%check_close('fully damped step', worst, 0.0_wp, 1.0e-17_wp)
    call test%check('unscaled limit is below the scaled one', s%step_limit() > 0.0_wp &
                    .and. s%step_limit() < 1.0e-2_wp)
  end subroutine check_relaxation

  !> Contact list, coordination, weights.
  subroutine check_lists()
    type(dem_system_type) :: s
    type(dem_contacts_type) :: list
    type(error_list_type) :: errors
    integer(i4), allocatable :: z(:), index(:)
    real(wp) :: force(3)
    integer :: k
    s%dem_data_type = ripe%dem_data_type
    call s%contacts(list)
    z = coordination_of(s%dem_data_type)
    call test%check('list and coordination agree', sum(z) == 2*count(list%ids(1, :) > 0) &
                    + count(list%ids(1, :) < 0))
    call test%check('planes are listed', any(list%ids(1, :) < 0))
    call test%check('lower ids first', all(list%ids(1, :) < list%ids(2, :)))
    call s%find([40_i8], index, errors)
    force = 0.0_wp
    do k = 1, list%n
      if (list%ids(1, k) == 40_i8) force = force - list%force(:, k)
      if (list%ids(2, k) == 40_i8) force = force + list%force(:, k)
    end do
    call test%check_all_close('forces of a grain add up', &
                          force, s%grains%force(:, index(1)), 1.0e-12_wp)
    call check_stiffness(s, list)
    k = maxloc(list%overlap, dim=1, mask=list%ids(1, :) > 0)
    force = list%force(:, k)
    call s%set_weights(reshape([list%ids(2, k), list%ids(1, k), 900_i8, 901_i8], [2, 2]), &
                       [0.25_wp, 3.0_wp])
    call s%forces()
    call s%contacts(list)
    call test%check_close('weighted contact', sqrt(sum(list%force(:, k)**2)/sum(force**2)), &
                          0.25_wp, &
                          1.0e-2_wp)
  end subroutine check_lists

  !> Sums of stiffness are those of the list, of one grain and of many, in any order.
  subroutine check_stiffness(s, list)
    type(dem_system_type), intent(in) :: s
    type(dem_contacts_type), intent(in) :: list
    real(wp) :: wanted(s%grains%n), one(1)
    integer(i4) :: i, k
    wanted = 0.0_wp
    do k = 1, list%n
      do i = 1, s%grains%n
        if (any(list%ids(:, k) == s%grains%id(i))) wanted(i) = wanted(i) + list%stiffness(1, k)
      end do
    end do
    associate (found => stiffness_on(s%dem_data_type, [(i, i=int(s%grains%n), 1, -1)]))
      call test%check('stiffness of all', all(found(s%grains%n:1:-1) == wanted) .and. &
                      any(wanted > 0.0_wp))
    end associate
    k = int(maxloc(wanted, 1), i4)
    one = stiffness_on(s%dem_data_type, [k])
    call test%check('stiffness of one', one(1) == wanted(k))
  end subroutine check_stiffness

  !> A step far too long ends with the grain named, not with a crash.
  subroutine check_faults()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    integer :: k
    s%dem_data_type = ripe%dem_data_type
    s%par%overlap_limit = 1.0e9_wp
    call s%step(10, errors)
    call test%check('stable so far', .not. errors%any())
    s%par%dt = 100.0_wp*s%step_limit()
    do k = 1, 200
      call s%step(10, errors)
      if (errors%any()) exit
    end do
    call test%check('runaway found', errors%any())
    if (errors%any()) call test%check('as a numerical fault', errors%exit_code() == 2)
  end subroutine check_faults
end program test_dem_system
