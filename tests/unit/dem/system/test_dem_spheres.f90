!> Spheres go a way of their own through the forces: it must be that of ellipsoids as round as they.
program test_dem_spheres
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: max_abs, test_type
  use dem_state, only: kind_free
  use dem_law, only: make_law, make_linear_law
  use dem_make, only: make_grains, make_planes
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: m = 3, n = m*m*m
  real(wp), parameter :: flat = 1.0e-14_wp  !! of a semi-axis: an ellipsoid for the program

  call omp_set_num_threads(1)
  call compare('Hertz-Mindlin', 'hertz_mindlin')
  call compare('linear', 'linear')
  call test%finish()

contains

  !> A cluster of spheres of two sizes that fall together, spinning, without walls.
  subroutine make_cluster(s, law, off)
    type(dem_system_type), intent(inout) :: s
    character(len=*), intent(in) :: law
    real(wp), intent(in) :: off  !! of the last semi-axis, relative
    type(error_list_type) :: errors
    integer(i8) :: id(n)
    real(wp) :: x(3, n), q(4, n), a(3, n), v(3, n), w(3, n), middle(3), none(3, 0)
    integer(i4) :: k

    middle = 0.5_wp*(m - 1)
    do k = 1, n
      id(k) = k
      x(:, k) = [real(mod(k - 1, m), wp), real(mod((k - 1)/m, m), wp), real((k - 1)/m**2, wp)]
      a(:, k) = merge(1.0e-3_wp, 0.9e-3_wp, mod(k, 2) == 0)
      a(3, k) = a(3, k)*(1.0_wp + off)
      v(:, k) = -0.1_wp*(x(:, k) - middle)
      w(:, k) = [100.0_wp*cos(3.0_wp*k), 80.0_wp*sin(5.0_wp*k), 60.0_wp*cos(7.0_wp*k)]
      x(:, k) = 1.95e-3_wp*x(:, k) + 2.0e-5_wp*[sin(2.0_wp*k), cos(3.0_wp*k), sin(5.0_wp*k)]
    end do
    q = spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, n)
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 1.0e7_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.4_wp, 0.1_wp, &
                            0.1_wp)
    if (law == 'linear') &
      s%laws(1, 1) = make_linear_law(500.0_wp, 400.0_wp, 0.4_wp, 0.1_wp, 0.1_wp)
    call make_grains(s%grains, s%materials, id, spread(kind_free, 1, n), spread(1, 1, n), x, q, a, &
                     v, w, errors)
    call make_planes(s%planes, none, none, none, [integer(i4) ::])
    s%par%gravity = 0.0_wp
    s%par%overlap_limit = 0.5_wp
    s%par%dt = 1.0e-6_wp
    call s%init(errors)
    call test%check('cluster made without faults', .not. errors%any())
  end subroutine make_cluster

  subroutine compare(name, law)
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: law
    type(dem_system_type) :: round, oval
    type(dem_contacts_type) :: a, b
    type(error_list_type) :: errors

    call make_cluster(round, law, 0.0_wp)
    call make_cluster(oval, law, flat)
    call round%step(600, errors)
    call oval%step(600, errors)
    call test%check(name//': no faults', .not. errors%any())
    call test%check(name//': the two ways were gone', any(round%pairs%round) &
                    .and. .not. any(oval%pairs%round))
    call round%contacts(a)
    call oval%contacts(b)
    call test%check(name//': the same contacts, some sliding', a%n == b%n .and. a%n > n &
                    .and. round%ledger%friction > 0.0_wp)
    if (a%n /= b%n) return
    call near(name//': positions', round%grains%x, oval%grains%x)
    call near(name//': velocities', round%grains%v, oval%grains%v)
    call near(name//': spins', round%grains%omega, oval%grains%omega)
    call near(name//': contact forces', a%force, b%force)
    call near(name//': contact points', a%point, b%point)
    call near(name//': contact stiffnesses', a%stiffness, b%stiffness)
    call near(name//': works', reshape([round%ledger%friction, round%ledger%contact_damping, &
                                round%ledger%tangential_relaxation], [3, 1]), &
              reshape([oval%ledger%friction, oval%ledger%contact_damping, &
                       oval%ledger%tangential_relaxation], [3, 1]))
    call test%check(name//': spheres do no curvature work', &
                    .not. abs(round%ledger%curvature) > 0.0_wp)
  end subroutine compare

  !> Equal to 1e-9 of the largest.
  subroutine near(what, x, y)
    character(len=*), intent(in) :: what
    real(wp), intent(in) :: x(:, :), y(:, :)
    call test%check_close(what, max_abs(x - y)/max_abs(y), 0.0_wp, 1.0e-9_wp)
  end subroutine near
end program test_dem_spheres
