!> Margins of fast grains: lists last longer, and change no bit.
program test_dem_margin
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_archive, only: dem_archive_type
  use dem_law, only: make_law
  use dem_make, only: make_grains, make_planes
  use dem_margin, only: pair_skin, spare_margins
  use dem_state, only: kind_free
  use dem_system, only: dem_system_type
  implicit none

  integer(i4), parameter :: m = 6, n = m**3
  type(test_type) :: test

  call omp_set_num_threads(1)
  call compare('ellipsoids', [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp])
  call compare('spheres', [2.4e-3_wp, 2.4e-3_wp, 2.4e-3_wp])
  call go_on()
  call test%finish()

contains

  !> A slow lattice of grains in a box, among them four fast ones; the skin is given if > 0.
  subroutine make(s, axes, skin)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: axes(3), skin
    real(wp), parameter :: pitch = 5.2e-3_wp, half = 0.5_wp*m*pitch + 2.0e-3_wp
    type(error_list_type) :: errors
    integer(i8) :: id(n)
    integer(i4) :: i, k
    real(wp) :: x(3, n), q(4, n), a(3, n), v(3, n), w(3, n), point(3, 6), normal(3, 6)

    do i = 1, n
      id(i) = i
      x(:, i) = pitch*[mod(i - 1, m), mod((i - 1)/m, m), (i - 1)/m**2]
      x(:, i) = x(:, i) - 0.5_wp*(m - 1)*pitch
      q(:, i) = [cos(0.7_wp*i), 0.6_wp*sin(0.7_wp*i), 0.0_wp, 0.8_wp*sin(0.7_wp*i)]
      a(:, i) = axes
      v(:, i) = 0.02_wp*[cos(1.3_wp*i), sin(1.3_wp*i), cos(2.1_wp*i)]
      if (mod(i, 60) == 1) v(:, i) = 100.0_wp*v(:, i)
      w(:, i) = 100.0_wp*v(:, i)
    end do
    point = 0.0_wp
    normal = 0.0_wp
    do k = 1, 3
      point(k, k) = -half
      normal(k, k) = 1.0_wp
      point(k, 3 + k) = half
      normal(k, 3 + k) = -1.0_wp
    end do
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e6_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.2_wp, &
                            0.2_wp)
    call make_grains(s%grains, s%materials, id, [(kind_free, i=1, n)], [(1_i4, i=1, n)], x, q, a, &
                     v, w, errors)
    call make_planes(s%planes, point, normal, 0.0_wp*point, [(1_i4, k=1, 6)])
    s%par%skin = skin
    s%par%overlap_limit = 0.5_wp
    s%par%dt = 2.0e-6_wp
    call s%init(errors)
    call test%check('the box is made', .not. errors%any())
  end subroutine make

  !> The same bits as with lists of one skin, and fewer lists.
  subroutine compare(name, axes)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: axes(3)
    type(dem_system_type) :: free, plain
    type(error_list_type) :: errors
    real(wp) :: spare(n)
    integer(i4) :: k, eased

    call make(free, axes, -1.0_wp)
    call make(plain, axes, free%pairs%skin)
    eased = 0
    do k = 1, 40
      call free%step(100, errors)
      call plain%step(100, errors)
      spare = spare_margins(free%pairs, n)
      eased = max(eased, count(spare > 0.0_wp))
      call omp_set_num_threads(1 + mod(k, 2))
    end do
    call omp_set_num_threads(1)
    call test%check(name//': no faults', .not. errors%any())
    call test%check(name//': some grains have more margin, most have not', &
                    eased >= 4 .and. eased < n/4)
    call test%check(name//': same places', same(free%grains%x, plain%grains%x))
    call test%check(name//': same orientations', same(free%grains%quat, plain%grains%quat))
    call test%check(name//': same velocities', same(free%grains%v, plain%grains%v))
    call test%check(name//': same forces', same(free%grains%force, plain%grains%force))
    call test%check(name//': contacts were at work', free%ledger%friction > 0.0_wp &
                    .and. free%ledger%contact_damping > 0.0_wp)
    call test%check(name//': fewer lists', 2*free%health%rebuilds < plain%health%rebuilds)
    call test%check(name//': no list was late', free%health%late_rebuilds == 0_i8)
    call test%check(name//': a skin that is given stands', &
                    all(spare_margins(plain%pairs, n) <= 0.0_wp))
    call test%check_close(name//': margins of a pair', pair_skin(free%pairs, 1_i4, 2_i4), &
                          free%pairs%skin + sum(spare_margins(free%pairs, 2_i4)), 1.0e-15_wp)
  end subroutine compare

  !> A restart finds the margins of its list.
  subroutine go_on()
    type(dem_system_type) :: whole, second
    type(dem_archive_type) :: archive
    type(error_list_type) :: errors
    real(wp), parameter :: axes(3) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]

    call make(whole, axes, -1.0_wp)
    call whole%step(777, errors)
    call test%check('restart: with margins', any(whole%pairs%ease < 1.0_wp))
    call whole%export_state(archive)
    call make(second, axes, -1.0_wp)
    call second%import_state(archive, errors)
    call whole%step(800, errors)
    call second%step(800, errors)
    call test%check('restart: same places', same(whole%grains%x, second%grains%x))
    call test%check('restart: same margins', same(reshape(whole%pairs%ease, [1, &
                    size(whole%pairs%ease)]), reshape(second%pairs%ease, [1, &
                    size(second%pairs%ease)])))
    call test%check('restart: same lists', whole%health%rebuilds == second%health%rebuilds)
    call test%check('restart: no faults', .not. errors%any())
  end subroutine go_on

  pure logical function same(a, b)
    real(wp), intent(in) :: a(:, :), b(:, :)
    same = all(transfer(a, [0_i8]) == transfer(b, [0_i8]))
  end function same
end program test_dem_margin
