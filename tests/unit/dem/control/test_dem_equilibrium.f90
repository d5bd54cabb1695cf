!> Adaptive damping stops what it must and counts it; the unbalanced force of two spheres.
program test_dem_equilibrium
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_state, only: kind_free, kind_fixed
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_system, only: dem_system_type
  use dem_equilibrium, only: dem_equilibrium_type, mean_unbalanced
  use dem_adaptive_damping, only: stop_slowing
  implicit none
  type(test_type) :: test

  call check_stopping()
  call check_measures()
  call test%finish()

contains

  !> A free sphere on a fixed one, overlap 1 micrometre, and one that falls freely.
  subroutine make_three(s)
    type(dem_system_type), intent(inout) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: r = 1.0e-3_wp
    real(wp) :: x(3, 3), q(4, 3), a(3, 3), v(3, 3), w(3, 3)

    x = 0.0_wp
    x(3, 2) = 2.0_wp*r - 1.0e-6_wp
    x(1, 3) = 10.0_wp*r
    q = 0.0_wp
    q(1, :) = 1.0_wp
    a = r
    v = 0.0_wp
    w = 0.0_wp
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, &
                            0.0_wp)
    call make_grains(s%grains, s%materials, [1_i8, 2_i8, 3_i8], &
                     [kind_fixed, kind_free, kind_free], [1, 1, 1], x, q, a, v, w, errors)
    s%par%gravity = [0.0_wp, 0.0_wp, -9.81_wp]
    s%par%dt = 1.0e-8_wp
    call s%init(errors)
    call test%check('made without faults', .not. errors%any())
  end subroutine make_three

  !> Between two checks the second grain slows down and the third one falls faster.
  subroutine check_stopping()
    type(dem_system_type) :: s
    real(wp) :: before, closure, spin

    call make_three(s)
    s%grains%v(:, 2) = [0.01_wp, 0.0_wp, -0.1_wp]
    s%grains%v(:, 3) = [0.0_wp, 0.0_wp, -0.1_wp]
    s%grains%omega(:, 2) = [0.0_wp, 5.0_wp, 0.0_wp]
    call stop_slowing(s%dem_data_type)
    call test%check('the first check stops none', s%grains%v(3, 2) < -0.09_wp)
    spin = 0.5_wp*s%grains%inertia(1, 2)*5.0_wp**2
    call test%check_close('kinetic energy seen', s%seen_kinetic(2), &
                          0.5_wp*s%grains%mass(2)*0.0101_wp + spin, 1.0e-14_wp*s%seen_kinetic(2))
    s%grains%v(3, 2) = -0.099_wp
    s%grains%v(3, 3) = -0.101_wp
    call s%refresh_ledger()
    before = s%ledger%kinetic
    closure = s%closure()
    call stop_slowing(s%dem_data_type)
    call test%check('a slower grain stops', all(abs(s%grains%v(:, 2)) <= 0.0_wp))
    call test%check('and turns no more', all(abs(s%grains%omega(:, 2)) <= 0.0_wp))
    call test%check('a faster one goes on', s%grains%v(3, 3) < -0.1_wp)
    call s%refresh_ledger()
    call test%check_close('what is lost is background damping', s%ledger%background_damping, &
                          before - s%ledger%kinetic, 1.0e-14_wp*before)
    call test%check('something was lost', s%ledger%background_damping > 0.4_wp*before)
    call test%check_close('closure stays', s%closure(), closure, 1.0e-14_wp*before)
    s%grains%v(3, 2) = 0.001_wp
    call stop_slowing(s%dem_data_type)
    call test%check('a stopped grain may start again', s%grains%v(3, 2) > 0.0_wp)
  end subroutine check_stopping

  !> One contact of force F, two free grains: mean of |F - m g| and m g, over F.
  subroutine check_measures()
    type(dem_system_type) :: s
    type(dem_equilibrium_type) :: rest
    real(wp) :: force, weight, exact

    call make_three(s)
    force = s%grains%force(3, 2)
    weight = 9.81_wp*s%grains%mass(2)
    exact = 0.5_wp*((force - weight) + weight)/force
    call test%check('in contact', force > weight)
    call test%check_close('mean unbalanced force', mean_unbalanced(s), exact, 1.0e-12_wp)
    rest%watched = .true.
    rest%every = 200
    rest%unbalanced_limit = 0.6_wp
    rest%energy_limit = 1.0e-8_wp
    call rest%check(s, .true.)
    call test%check('at rest within the limits', rest%reached)
    rest%unbalanced_limit = 0.4_wp
    call rest%check(s, .true.)
    call test%check('force beyond its limit', .not. rest%reached)
    rest%unbalanced_limit = 0.6_wp
    s%grains%v(1, 3) = 1.0_wp
    call rest%check(s, .true.)
    call test%check('motion beyond its limit', .not. rest%reached .and. &
                    rest%energy_ratio > 1.0e-8_wp)
    s%grains%x(3, 2) = 1.0_wp
    call s%forces()
    call rest%check(s, .true.)
    call test%check('without contacts never', .not. rest%reached .and. rest%unbalanced < 0.0_wp)
    call test%check('due on its steps', rest%due(400_i8) .and. .not. rest%due(300_i8) &
                    .and. .not. rest%due(0_i8))
    rest%adaptive = .true.
    call test%check('adaptive damping shortens blocks', rest%longest_block() == 10_i4)
    rest%damping_every = 1000
    call test%check('rare checks leave them whole', rest%longest_block() == 100_i4)
  end subroutine check_measures
end program test_dem_equilibrium
