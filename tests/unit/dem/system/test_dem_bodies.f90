!> Surfaces that move freely: loads, one axis, what is held, reduced mass, step limit.
program test_dem_bodies
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, test_type
  use dem_state, only: kind_free, kind_fixed
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_figure, only: figure_type
  use dem_round_gap, only: bore_gap, most_places
  use dem_surface_body, only: no_free_bodies, is_free, load_left
  use dem_surface_state, only: surface_rigid
  use dem_surface_make, only: mesh_type, join_corners, check_mesh
  use dem_surface_values, only: add_mesh
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: radius = 2.0e-3_wp

  call omp_set_num_threads(1)
  call check_flight()
  call check_rebound()
  call check_limit()
  call check_bore()
  call test%finish()

contains

  !> A sphere in the origin and a square of side 20 mm at height z above it.
  subroutine make_pair(s, kind, z, damping)
    type(dem_system_type), intent(inout) :: s
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: z, damping
    type(error_list_type) :: errors
    type(mesh_type) :: mesh
    real(wp), parameter :: half = 0.01_wp
    real(wp) :: corner(3, 3, 2)

    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 1.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.3_wp, damping, &
                            damping)
    call make_grains(s%grains, s%materials, [1_i8], [kind], [1], reshape([0.0_wp, 0.0_wp, 0.0_wp], &
                     [3, 1]), reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1]), &
                     reshape([radius, radius, radius], [3, 1]), &
                     reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]), &
                     reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]), errors)
    corner(:, 1, 1) = [-half, -half, z]
    corner(:, 2, 1) = [half, -half, z]
    corner(:, 3, 1) = [half, half, z]
    corner(:, :, 2) = corner(:, [1, 3, 3], 1)
    corner(:, 3, 2) = [-half, half, z]
    mesh%name = 'plate'
    call join_corners(corner, mesh)
    call check_mesh(mesh, .false., errors)
    call add_mesh(s%surfaces, mesh, 'plate', surface_rigid, 1, 1.0_wp, [0.0_wp, 0.0_wp, z])
    call no_free_bodies(s%surfaces)
    call test%check('a plate over a sphere', .not. errors%any())
  end subroutine make_pair

  !> Free along z and about y, held along x: constant load, exact way; gravity and load in the
  !! ledger, what is held is not.
  subroutine check_flight()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp), parameter :: mass = 0.2_wp, inertia = 3.0e-4_wp, moment = 2.0e-3_wp, push = 0.5_wp
    real(wp), parameter :: dt = 1.0e-4_wp, g = 9.81_wp
    real(wp) :: t, a

    call make_pair(s, kind_fixed, 1.0_wp, 0.0_wp)
    call test%check('nothing is free yet', .not. is_free(s%surfaces, 1))
    s%surfaces%rigid%free(:, 1) = [0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 0.0_wp]
    s%surfaces%rigid%mass = mass
    s%surfaces%rigid%inertia = inertia
    s%surfaces%rigid%given(:, 1) = [7.0_wp, 0.0_wp, push, 5.0_wp, moment, 0.0_wp]
    s%surfaces%velocity(1, 1) = 0.3_wp
    s%par%gravity = [1.0_wp, 0.0_wp, -g]
    s%par%dt = dt
    call s%init(errors)
    call s%step(1000, errors)
    call s%refresh_ledger()
    t = 1000*dt
    a = push/mass - g
    call test%check_close('it falls', s%surfaces%centre(3, 1), 1.0_wp + 0.5_wp*a*t*t, 1.0e-13_wp)
    call test%check_close('with this velocity', s%surfaces%velocity(3, 1), a*t, 1.0e-13_wp)
    call test%check_close('it turns', s%surfaces%spin(2, 1), moment*t/inertia, 1.0e-13_wp)
    call test%check_close('by this angle', 2.0_wp*asin(s%surfaces%quat(3, 1)), &
                          0.5_wp*moment/inertia*t*t, 1.0e-13_wp)
    call test%check_close('x as given', s%surfaces%centre(1, 1), 0.3_wp*t, 1.0e-14_wp)
    call test%check_close('work of gravity', s%ledger%gravity, -mass*g*0.5_wp*a*t*t, 1.0e-14_wp)
    call test%check_close('work of the load', s%ledger%external, push*0.5_wp*a*t*t &
                          + 0.5_wp*moment**2/inertia*t*t, 1.0e-14_wp)
    call test%check_close('kinetic energy', s%ledger%kinetic, 0.5_wp*mass*(a*t)**2 &
                          + 0.5_wp*(moment*t)**2/inertia, 1.0e-14_wp)
    call test%check_close('the ledger closes', s%closure(), 0.0_wp, 1.0e-14_wp)
    call test%check('load left', norm2(load_left(s%surfaces, 1, s%par%gravity) &
                    - [0.0_wp, 0.0_wp, mass*a, 0.0_wp, moment, 0.0_wp]) < 1.0e-14_wp)
  end subroutine check_flight

  !> Restitution depends on the damping ratio alone, whatever the mass: m* is that of the plate on a
  !! fixed sphere and the reduced one on a free sphere. It is that of theory-dem for 0.05.
  subroutine check_rebound()
    real(wp), parameter :: known = 0.8468_wp
    call test%check_close('light plate, fixed sphere', rebound(kind_fixed, 1.0e-3_wp), known, &
                          2.0e-4_wp)
    call test%check_close('heavy plate, fixed sphere', rebound(kind_fixed, 0.1_wp), known, &
                          2.0e-4_wp)
    call test%check_close('light plate, free sphere', rebound(kind_free, 1.0e-4_wp), known, &
                          2.0e-4_wp)
  end subroutine check_rebound

  !> Relative velocity after over before an impact at 0.2 m/s [-].
  real(wp) function rebound(kind, mass)
    integer(i4), intent(in) :: kind
    real(wp), intent(in) :: mass
    real(wp), parameter :: speed = 0.2_wp
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    integer(i4) :: k

    call make_pair(s, kind, radius + 1.0e-6_wp, 0.05_wp)
    s%surfaces%rigid%free(3, 1) = 1.0_wp
    s%surfaces%rigid%mass = mass
    s%surfaces%velocity(3, 1) = -speed
    s%par%dt = 2.0e-6_wp*sqrt(min(mass, 1.0e-3_wp)/0.1_wp)
    call s%init(errors)
    do k = 1, 1000
      call s%step(100, errors)
      if (s%surfaces%centre(3, 1) - s%grains%x(3, 1) > radius + 2.0e-6_wp .and. k > 3) exit
    end do
    rebound = (s%surfaces%velocity(3, 1) - s%grains%v(3, 1))/speed
    call s%refresh_ledger()
    call test%check_close('momentum', mass*s%surfaces%velocity(3, 1) + merge( &
                          s%grains%mass(1)*s%grains%v(3, 1), mass*speed*(-1.0_wp - rebound), &
                          kind == kind_free), -mass*speed, 1.0e-12_wp)
    call test%check_close('ledger of the impact', s%closure()/(0.5_wp*mass*speed**2), 0.0_wp, &
                          1.0e-4_wp)
  end function rebound

  !> A light plate that may turn needs a smaller step than a heavy one; a held one for none.
  subroutine check_limit()
    type(dem_system_type) :: s, held
    type(error_list_type) :: errors
    real(wp) :: heavy, inverse_mass, turning

    call make_pair(s, kind_fixed, radius - 1.0e-6_wp, 0.0_wp)
    call make_pair(held, kind_fixed, radius - 1.0e-6_wp, 0.0_wp)
    held%par%dt = 1.0e-9_wp
    call held%init(errors)
    call test%check('no limit', held%step_limit() > 1.0_wp)
    s%surfaces%centre(1, 1) = 5.0e-3_wp
    s%surfaces%rigid%free(3, 1) = 1.0_wp
    s%surfaces%rigid%mass = 0.1_wp
    s%par%dt = 1.0e-9_wp
    call s%init(errors)
    heavy = s%step_limit()
    s%surfaces%rigid%mass = 0.001_wp
    inverse_mass = s%step_limit()
    call test%check_close('by the root of the mass', heavy/inverse_mass, 10.0_wp, 1.0e-12_wp)
    s%surfaces%rigid%free(5, 1) = 1.0_wp
    s%surfaces%rigid%inertia = 1.0e-9_wp
    turning = s%step_limit()
    call test%check('less if it turns', turning < inverse_mass)
  end subroutine check_limit

  !> A long ellipsoid across a bore reaches its wall in two places, alike; a round one in one; both
  !! at the greatest reach that 1e5 directions find.
  subroutine check_bore()
    real(wp), parameter :: a(6) = [25.0_wp, 1.0_wp, 4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    real(wp), parameter :: ball(6) = [4.0_wp, 4.0_wp, 4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp), parameter :: axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]
    type(figure_type) :: grain
    real(wp) :: e(3, most_places), gap(most_places), best, phi, d(3)
    integer(i4) :: n, k

    grain%a = a
    call bore_gap([0.0_wp, -4.0_wp, 7.0_wp], grain, axis, 7.0_wp, n, e, gap)
    call test%check('two places', n == 2)
    call test%check_close('alike', gap(2), gap(1), 1.0e-14_wp)
    best = 0.0_wp
    do k = 1, 100000
      phi = 2.0e-5_wp*pi*k
      d = [cos(phi), sin(phi), 0.0_wp]
      best = larger(best, -4.0_wp*d(2) + sqrt(a(1)*d(1)**2 + a(2)*d(2)**2))
    end do
    call test%check_close('where the reach is greatest', gap(1), 7.0_wp - best, 1.0e-8_wp)
    grain%a = ball
    call bore_gap([3.0_wp, 0.0_wp, 0.0_wp], grain, axis, 7.0_wp, n, e, gap)
    call test%check('one place', n == 1)
    call test%check_close('of a sphere', gap(1), 2.0_wp, 1.0e-15_wp)
    call bore_gap([0.0_wp, 0.0_wp, 0.0_wp], grain, axis, 7.0_wp, n, e, gap)
    call test%check('in the middle, too', n >= 1)
    call test%check_close('all ways', gap(1), 5.0_wp, 1.0e-14_wp)
  end subroutine check_bore
end program test_dem_bodies
