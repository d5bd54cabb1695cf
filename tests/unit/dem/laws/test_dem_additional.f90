!> Additional contact models: rolling, twisting, cohesion, bridges, turning points. Closed shapes,
!! ledger, and the same bits for threads, list margins and restarts.
program test_dem_additional
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_archive, only: dem_archive_type
  use dem_additional_registry, only: use_model
  use dem_cohesion, only: cohesion_type, neck_radius, tear_overlap, cohesion_jkr, cohesion_dmt
  use dem_law, only: make_law
  use dem_liquid_counts, only: held_liquid
  use dem_make, only: make_grains, make_planes
  use dem_state, only: kind_free, kind_fixed
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp)
  integer(i4), parameter :: wet = 9           !! bridges in place of a cohesion
  real(wp), parameter :: volume = 5.0e-13_wp  !! of a bridge [m^3]
  integer(i4) :: seed = 1
  character(len=24) :: base = 'hertz_mindlin'

  call omp_set_num_threads(1)
  call check_neck()
  call check_bits(cohesion_jkr)
  call check_ledger(cohesion_jkr, 3.0e-4_wp)
  call check_ledger(cohesion_dmt, 3.0e-4_wp)
  call check_bits(wet)
  call check_ledger(wet, 3.0e-4_wp)
  call check_liquid()
  call check_long_necks()
  base = 'mindlin_deresiewicz'
  call check_bits(cohesion_dmt)
  call check_ledger(cohesion_dmt, 3.0e-4_wp)
  call test%finish()

contains

  real(wp) function uniform()
    seed = int(mod(16807_i8*seed, 2147483647_i8), i4)
    uniform = seed/2147483647.0_wp
  end function uniform

  !> Ellipsoids, some of them spheres, dropped on fixed spheres between two planes.
  subroutine make_heap(s, skin, cohesion, energy)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: skin, energy
    integer(i4), intent(in) :: cohesion
    integer(i4), parameter :: m = 3, layers = 3, n = m*m*(layers + 1)
    type(error_list_type) :: errors
    integer(i4) :: kind(n), i, j, k, at
    real(wp) :: x(3, n), q(4, n), a(3, n), v(3, n), w(3, n)

    seed = 4711
    at = 0
    do k = 0, layers
      do j = 1, m
        do i = 1, m
          at = at + 1
          x(:, at) = 5.0e-3_wp*[real(i, wp) - 2.0_wp, real(j, wp) - 2.0_wp, real(k, wp)]
          q(:, at) = [uniform() - 0.5_wp, uniform() - 0.5_wp, uniform() - 0.5_wp, &
                      uniform() - 0.5_wp]
          a(:, at) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]
          if (mod(at, 3) == 0 .or. k == 0) a(:, at) = 2.3e-3_wp
          v(:, at) = [0.2_wp*uniform(), 0.2_wp*uniform(), -0.5_wp]*merge(0.0_wp, 1.0_wp, k == 0)
          w(:, at) = 50.0_wp*uniform()*merge(0.0_wp, 1.0_wp, k == 0)
          kind(at) = merge(kind_fixed, kind_free, k == 0)
          q(:, at) = q(:, at)/norm2(q(:, at))
        end do
      end do
    end do
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e6_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law(trim(base), s%materials(1), s%materials(1), 0.5_wp, 0.05_wp, &
                            0.05_wp)
    call use_model(s%laws(1, 1)%additional, 'rolling', [0.2_wp, 0.1_wp, 1.0_wp, 1.0_wp, 0.05_wp])
    if (cohesion == wet) then
      call use_model(s%laws(1, 1)%additional, 'capillary', [0.072_wp, 0.2_wp, volume])
    else
      call use_model(s%laws(1, 1)%additional, 'cohesion', [real(cohesion, wp), 0.0_wp, energy])
    end if
    call make_grains(s%grains, s%materials, [(int(k, i8), k=1, n)], kind, spread(1_i4, 1, n), x, &
                     q, a, v, w, errors)
    call make_planes(s%planes, reshape([-7.6e-3_wp, 0.0_wp, 0.0_wp, 7.6e-3_wp, 0.0_wp, 0.0_wp], &
                                       [3, 2]), &
                     reshape([1.0_wp, 0.0_wp, 0.0_wp, -1.0_wp, 0.0_wp, 0.0_wp], [3, 2]), &
                     reshape(spread(0.0_wp, 1, 6), [3, 2]), [1, 1])
    s%par%gravity = [0.0_wp, 0.0_wp, -9.81_wp]
    s%par%skin = skin
    s%par%overlap_limit = 0.5_wp
    s%par%dt = 1.0e-5_wp
    call s%init(errors)
    if (energy < 10.0_wp) call test%check('heap made without faults', .not. errors%any())
    if (energy > 10.0_wp) call test%check('long necks are a fault', errors%any())
  end subroutine make_heap

  logical function same_bits(a, b)
    type(dem_system_type), intent(inout) :: a, b
    call a%refresh_ledger()
    call b%refresh_ledger()
    same_bits = all(transfer(a%grains%x, [0_i8]) == transfer(b%grains%x, [0_i8])) &
                .and. all(transfer(a%grains%omega, [0_i8]) == transfer(b%grains%omega, [0_i8])) &
                .and. all(transfer(a%grains%moment, [0_i8]) == transfer(b%grains%moment, [0_i8]))
  end function same_bits

  !> Pull-off 3/2 pi w R at a^3 = 9 pi w R^2/(8 E*), overlap 0 at a^3 = 2 pi w R^2/E*.
  subroutine check_neck()
    type(dem_system_type) :: s
    type(cohesion_type) :: law
    real(wp), parameter :: radius = 1.0e-3_wp, w = 0.1_wp
    real(wp) :: a, least, overlap
    integer(i4) :: k
    call make_heap(s, 3.0e-4_wp, cohesion_jkr, w)
    law%kind = cohesion_jkr
    law%surface_energy = w
    law%e_star = s%laws(1, 1)%e_star
    a = (2.0_wp*pi*w*radius**2/law%e_star)**(1.0_wp/3.0_wp)
    call test%check_close('neck at the first touch', neck_radius(law, radius, 0.0_wp)/a, 1.0_wp, &
                          1.0e-14_wp)
    a = a/16.0_wp**(1.0_wp/3.0_wp)
    call test%check_close('neck as it tears', neck_radius(law, radius, tear_overlap(law, &
                          radius)*(1.0_wp - 1.0e-12_wp))/a, 1.0_wp, 1.0e-5_wp)
    call test%check_close('overlap as it tears', tear_overlap(law, radius), &
                          -0.75_wp*(pi**2*w**2*radius/law%e_star**2)**(1.0_wp/3.0_wp), &
                          1.0e-14_wp*radius)
    least = 0.0_wp
    do k = 0, 10000
      overlap = tear_overlap(law, radius)*(1.0_wp - real(k, wp)/1.0e4_wp)
      a = neck_radius(law, radius, overlap)
      least = min(least, 4.0_wp*law%e_star*a**3/(3.0_wp*radius) &
                  - sqrt(8.0_wp*pi*w*law%e_star*a**3))
    end do
    call test%check_close('pull-off', least/(1.5_wp*pi*w*radius), -1.0_wp, 1.0e-6_wp)
  end subroutine check_neck

  !> Threads, other lists and a restart change no bit.
  subroutine check_bits(cohesion)
    integer(i4), intent(in) :: cohesion
    type(dem_system_type) :: one, two, wide, again
    type(dem_archive_type) :: archive
    type(error_list_type) :: errors
    call make_heap(one, 2.0e-4_wp, cohesion, 0.02_wp)
    call one%step(900, errors)
    two%dem_data_type = one%dem_data_type
    call one%export_state(archive)
    call one%step(250, errors)
    call omp_set_num_threads(2)
    call two%step(250, errors)
    call omp_set_num_threads(1)
    call test%check('one and two threads: same bits', same_bits(one, two))
    call test%check('and the same ledger', all(transfer(one%ledger, [0_i8]) &
                                               == transfer(two%ledger, [0_i8])))
    call make_heap(wide, 5.0e-4_wp, cohesion, 0.02_wp)
    call wide%step(1150, errors)
    call test%check('lists were rebuilt', one%health%rebuilds > wide%health%rebuilds)
    call test%check('other lists: same bits', same_bits(one, wide))
    call make_heap(again, 2.0e-4_wp, cohesion, 0.02_wp)
    call again%import_state(archive, errors)
    call again%step(250, errors)
    call test%check('restart: same bits', same_bits(one, again))
    call test%check('restart: same ledger', all(transfer(one%ledger, [0_i8]) &
                                                == transfer(again%ledger, [0_i8])))
    if (cohesion == cohesion_jkr) call test%check('necks have formed and torn', &
                                                  one%ledger%breakage > 0.0_wp)
    if (cohesion == wet) then
      call test%check('bridges have broken', one%pairs%additional%liquid%ruptured > 10.0_wp)
      call test%check('liquid: same bits', &
        all(transfer(one%pairs%additional%liquid, [0_i8]) == &
            transfer(again%pairs%additional%liquid, [0_i8])))
    end if
    call test%check('sliding', one%ledger%friction > 0.0_wp)
    call test%check('no faults on the way', .not. errors%any())
  end subroutine check_bits

  !> All columns close.
  subroutine check_ledger(cohesion, limit)
    integer(i4), intent(in) :: cohesion
    real(wp), intent(in) :: limit
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: input
    call make_heap(s, 3.0e-4_wp, cohesion, 0.02_wp)
    s%par%dt = 2.0e-6_wp
    call s%step(5000, errors)
    call s%refresh_ledger()
    input = s%ledger%start + abs(s%ledger%gravity)
    call test%check_close('ledger of the heap', s%closure()/input, 0.0_wp, limit)
    call test%check('rolling at work', s%ledger%rolling > 0.01_wp*input)
    call test%check('cohesion stores', abs(s%ledger%elastic_other) > 0.0_wp)
  end subroutine check_ledger

  !> What is drawn and not returned is held, by as many bridges as formed and did not break.
  subroutine check_liquid()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: held(2)
    call make_heap(s, 3.0e-4_wp, wet, 0.0_wp)
    call s%step(1200, errors)
    held = held_liquid(s%dem_data_type)
    associate (l => s%pairs%additional%liquid)
      call test%check('bridges hold', held(1) > 0.5_wp .and. l%ruptured > 10.0_wp)
      call test%check_close('as many as formed', held(1), l%formed - l%ruptured, 1.0e-9_wp)
      call test%check_close('liquid held', held(2)/(volume*held(1)), 1.0_wp, 1.0e-12_wp)
      call test%check_close('liquid drawn', (l%drawn - l%returned)/held(2), 1.0_wp, 1.0e-12_wp)
    end associate
  end subroutine check_liquid

  !> Necks longer than half the margin of the list are refused.
  subroutine check_long_necks()
    type(dem_system_type) :: s
    call make_heap(s, 1.0e-5_wp, cohesion_jkr, 100.0_wp)
  end subroutine check_long_necks
end program test_dem_additional
