!> Grains on surfaces: a plane of triangles is a plane, edges pass without a jump, a bent face
!! counts once, forces and moments of soft triangles are exact, threads and lists change no bit.
program test_dem_surface
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, max_abs, test_type
  use dem_state, only: kind_free
  use dem_additional_registry, only: find_model, use_model
  use dem_cohesion, only: cohesion_jkr, cohesion_dmt
  use dem_shape_make, only: make_shapes
  use dem_law, only: make_law
  use dem_law_registry, only: find_law, bind_law
  use dem_make, only: make_grains, make_planes
  use dem_surface_state, only: surface_rigid, surface_soft
  use dem_surface_make, only: mesh_type, join_corners, check_mesh
  use dem_surface_values, only: add_mesh
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: sphere(3) = 2.0e-3_wp
  real(wp), parameter :: ellipsoid(3) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]

  call omp_set_num_threads(1)
  call check_plane(sphere, 'sphere')
  call check_plane(ellipsoid, 'ellipsoid')
  call check_plane(ellipsoid, 'poly-ellipsoid', [0.3_wp, -0.2_wp, 0.1_wp], 2.0_wp)
  call check_plane(ellipsoid, 'superquadric', [0.0_wp, 0.0_wp, 0.0_wp], 4.0_wp)
  call check_plane(ellipsoid, 'both', [-0.2_wp, 0.1_wp, 0.2_wp], 2.5_wp)
  call check_plane(sphere, 'rolling sphere', on_top=1)
  call check_plane(ellipsoid, 'rolling ellipsoid', on_top=1)
  call check_plane(ellipsoid, 'necked ellipsoid', on_top=2)
  call check_plane(sphere, 'sticky sphere', on_top=3)
  call check_plane(ellipsoid, 'ellipsoid with turning points', on_top=4)
  call check_plane(ellipsoid, 'rolling necked form', [0.3_wp, -0.2_wp, 0.1_wp], 2.5_wp, on_top=5)
  call check_bend(0.02_wp, 'ridge')
  call check_bend(-0.02_wp, 'valley')
  call check_soft()
  call check_soft(1)
  call check_soft(5)
  call check_corner()
  call check_moving()
  call check_moving(5)
  call check_both_sides()
  call test%finish()

contains

  !> One grain with its laws; nothing below it yet.
  subroutine make_grain(s, axes, x, v, omega)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: axes(3), x(3), v(3), omega(3)
    type(error_list_type) :: errors
    real(wp) :: q(4, 1)
    integer(i4) :: a, b

    allocate (s%materials(2), s%laws(2, 2))
    s%materials(1)%young = 29.0e7_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%materials(2) = s%materials(1)
    s%materials(2)%young = 210.0e8_wp
    do a = 1, 2
      do b = 1, 2
        s%laws(a, b) = make_law('hertz_mindlin', s%materials(a), s%materials(b), 0.4_wp, 0.1_wp, &
                                0.1_wp)
      end do
    end do
    q(:, 1) = [0.9_wp, 0.3_wp, -0.2_wp, 0.1_wp]
    q = q/norm2(q)
    call make_grains(s%grains, s%materials, [7_i8], [kind_free], [1], reshape(x, [3, 1]), q, &
                     reshape(axes, [3, 1]), reshape(v, [3, 1]), reshape(omega, [3, 1]), errors)
    s%par%gravity = [0.0_wp, 0.0_wp, -9.81_wp]
    s%par%dt = 2.0e-6_wp
    call test%check('a grain', .not. errors%any())
  end subroutine make_grain

  !> A floor of odd triangles, bent by an angle across y = 0 (positive: a ridge).
  subroutine make_floor(s, bend, kind)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: bend
    integer(i4), intent(in) :: kind
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    integer(i4), parameter :: m = 6
    real(wp) :: node(3, 0:m, 0:m), corner(3, 3, 2*m*m)
    integer(i4) :: i, j, k

    do j = 0, m
      do i = 0, m
        node(:, i, j) = 3.0e-3_wp*[real(i, wp) - 0.5_wp*m, real(j, wp) - 0.5_wp*m, 0.0_wp]
        if (j == m/2) cycle
        node(1, i, j) = node(1, i, j) + 1.0e-3_wp*sin(7.0_wp*i + 3.0_wp*j)
        node(2, i, j) = node(2, i, j) + 1.0e-3_wp*cos(5.0_wp*i + 2.0_wp*j)
        node(3, i, j) = -tan(0.5_wp*bend)*abs(node(2, i, j))
      end do
    end do
    k = 0
    do j = 1, m
      do i = 1, m
        corner(:, 1, k + 1) = node(:, i - 1, j - 1)
        corner(:, 2, k + 1) = node(:, i, j - 1)
        corner(:, 3, k + 1) = node(:, i, j)
        corner(:, 1, k + 2) = node(:, i - 1, j - 1)
        corner(:, 2, k + 2) = node(:, i, j)
        corner(:, 3, k + 2) = node(:, i - 1, j)
        k = k + 2
      end do
    end do
    mesh%name = 'floor'
    call join_corners(corner, mesh)
    call check_mesh(mesh, .false., errors)
    call test%check('a floor', .not. errors%any())
    call test%check('its rim', mesh%rim == 4*m .and. size(mesh%x, 2) == (m + 1)**2)
    call add_mesh(s%surfaces, mesh, 'floor', kind, 2, cos(0.35_wp), [0.0_wp, 0.0_wp, 0.0_wp])
  end subroutine make_floor

  !> Additional contact models: 1 rolling and twisting, 2 JKR, 3 DMT, 4 turning points, 5 both
  !! first ones.
  subroutine add_laws(s, which)
    type(dem_system_type), intent(inout) :: s
    integer(i4), intent(in) :: which
    integer(i4) :: a, b
    do b = 1, size(s%laws, 2)
      do a = 1, size(s%laws, 1)
        associate (law => s%laws(a, b)%additional)
          if (which == 1 .or. which == 5) &
            call use_model(law, 'rolling', [0.1_wp, 0.05_wp, 1.0_wp, 1.0_wp, 0.1_wp])
          if (which == 2 .or. which == 5) &
            call use_model(law, 'cohesion', [real(cohesion_jkr, wp), 0.0_wp, 1.0e-2_wp])
          if (which == 3) &
            call use_model(law, 'cohesion', [real(cohesion_dmt, wp), 0.0_wp, 1.0e-2_wp])
        end associate
      end do
    end do
    if (which == 4) call turn_laws(s)
  end subroutine add_laws

  !> The law of Mindlin and Deresiewicz for all pairs, with the constants that they have.
  subroutine turn_laws(s)
    type(dem_system_type), intent(inout) :: s
    integer(i4) :: a, b
    s%laws%kind = find_law('mindlin_deresiewicz')
    do a = 1, 2
      do b = 1, 2
        call bind_law(s%laws(a, b))
      end do
    end do
  end subroutine turn_laws

  !> The same throw onto a plane and onto triangles: bounces, slides and rolls over many edges.
  subroutine check_plane(axes, name, skew, exponent, on_top)
    real(wp), intent(in) :: axes(3)
    character(len=*), intent(in) :: name
    real(wp), intent(in), optional :: skew(3), exponent
    integer(i4), intent(in), optional :: on_top  !! laws, see add_laws
    type(dem_system_type) :: a, b
    real(wp) :: same
    type(error_list_type) :: errors
    real(wp), parameter :: x(3) = [-4.0e-3_wp, -4.0e-3_wp, 2.4e-3_wp]
    real(wp), parameter :: v(3) = [0.2_wp, 0.15_wp, -0.1_wp]
    real(wp) :: zero(3, 1), worst, turn
    integer(i4) :: k

    zero = 0.0_wp
    call make_grain(a, axes, x, v, [3.0_wp, -5.0_wp, 20.0_wp])
    call make_grain(b, axes, x, v, [3.0_wp, -5.0_wp, 20.0_wp])
    if (present(skew)) then
      call make_shapes(a%grains, a%materials, [7_i8], reshape(skew, [3, 1]), [exponent], errors)
      call make_shapes(b%grains, b%materials, [7_i8], reshape(skew, [3, 1]), [exponent], errors)
    end if
    if (present(on_top)) then
      call add_laws(a, on_top)
      call add_laws(b, on_top)
    end if
    call make_planes(a%planes, zero, reshape([0.0_wp, 0.0_wp, 1.0_wp], [3, 1]), zero, [2])
    call make_floor(b, 0.0_wp, surface_rigid)
    call a%init(errors)
    call b%init(errors)
    worst = 0.0_wp
    turn = 0.0_wp
    do k = 1, 200
      call a%step(100, errors)
      call b%step(100, errors)
      worst = larger(worst, max_abs(a%grains%x - b%grains%x)/axes(1), &
                  max_abs(a%grains%v - b%grains%v), &
                  max_abs(a%grains%omega - b%grains%omega)*axes(1))
      turn = larger(turn, max_abs(a%planes%impulse(:, 1) - b%surfaces%sums%impulse(:, 1)) &
                 /(a%grains%mass(1)*0.2_wp))
    end do
    call test%check(name//' touches', sum(a%planes%impulse(3, :)) < 0.0_wp)
    call test%check_close(name//' moves as on a plane', worst, 0.0_wp, 1.0e-10_wp)
    call test%check_close(name//' acts as on a plane', turn, 0.0_wp, 1.0e-10_wp)
    call test%check(name//' has left its first triangle', &
                    norm2(b%grains%x(:2, 1) - x(:2)) > 4.0e-3_wp)
    call b%refresh_ledger()
    call a%refresh_ledger()
    ! a cohesive contact that ends is judged where it was, on a plane where it would be
    same = 1.0e-10_wp*abs(b%ledger%start)
    if (any(b%laws%additional%acts(find_model('cohesion')))) same = 1.0e-8_wp*abs(b%ledger%start)
    call test%check_close(name//' ledger', b%closure(), a%closure(), same)
    call test%check_close(name//' friction', b%ledger%friction/a%ledger%friction, 1.0_wp, 1.0e-9_wp)
    if (.not. present(on_top)) return
    call test%check_close(name//' rolling', b%ledger%rolling, a%ledger%rolling, same)
    call test%check_close(name//' breakage', b%ledger%breakage, a%ledger%breakage, same)
    call test%check_close(name//' elastic', b%ledger%elastic_other, a%ledger%elastic_other, same)
  end subroutine check_plane

  !> A sphere loaded onto a floor with a bend rolls over it: the force has no jump from step to
  !! step, whatever counts as one face.
  subroutine check_bend(bend, name)
    real(wp), intent(in) :: bend
    character(len=*), intent(in) :: name
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: last(3), jump, most
    real(wp), parameter :: r = sphere(1), v = 0.05_wp, depth = 4.0e-6_wp
    integer(i4) :: k

    call make_grain(s, sphere, [0.3e-3_wp, -2.0e-4_wp, r - depth], [0.0_wp, v, 0.0_wp], &
                    [-v/r, 0.0_wp, 0.0_wp])
    s%grains%mass = 1.0e3_wp*s%grains%mass
    s%grains%inertia = 1.0e3_wp*s%grains%inertia
    s%par%gravity = 0.0_wp
    call make_floor(s, bend, surface_rigid)
    s%par%dt = 1.0e-7_wp
    call s%init(errors)
    most = 0.0_wp
    jump = 0.0_wp
    last = s%grains%force(:, 1)
    do k = 1, 8000
      s%grains%x(3, 1) = r - depth
      s%grains%v(:, 1) = [0.0_wp, v, 0.0_wp]
      call s%step(10, errors)
      most = larger(most, norm2(last))
      jump = larger(jump, norm2(s%grains%force(:, 1) - last))
      last = s%grains%force(:, 1)
    end do
    call test%check(name//' passed the bend', s%grains%x(2, 1) > 1.0e-4_wp)
    call test%check(name//' one contact', s%surfaces%list%contacts(1) == 1)
    call test%check_close(name//' no jump', jump/most, 0.0_wp, 1.0e-3_wp)
  end subroutine check_bend

  !> Forces of the vertices of a floor that is drawn out add up to force and moment exactly.
  subroutine check_soft(on_top)
    integer(i4), intent(in), optional :: on_top  !! laws, see add_laws
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: force(3), moment(3), f(3), r(3)
    integer(i4) :: k

    call make_grain(s, ellipsoid, [0.3e-3_wp, -1.0e-3_wp, 1.8e-3_wp], [0.1_wp, 0.2_wp, -0.1_wp], &
                    [0.0_wp, 0.0_wp, 0.0_wp])
    call make_floor(s, -0.02_wp, surface_soft)
    if (present(on_top)) call add_laws(s, on_top)
    call s%init(errors)
    s%surfaces%mesh%v = 0.5_wp*s%surfaces%mesh%x([2, 1, 3], :)
    s%par%dt = 2.0e-7_wp
    do k = 1, 1000
      call s%step(10, errors)
      if (s%surfaces%list%contacts(1) == 1 .and. norm2(s%grains%force) > 0.05_wp) exit
    end do
    call test%check('soft floor touched', s%surfaces%list%contacts(1) == 1)
    force = 0.0_wp
    moment = 0.0_wp
    do k = 1, s%surfaces%mesh%vertices
      f = s%surfaces%mesh%force(:, k)
      r = s%surfaces%mesh%x(:, k)
      force = force + f
      moment = moment + [r(2)*f(3) - r(3)*f(2), r(3)*f(1) - r(1)*f(3), r(1)*f(2) - r(2)*f(1)]
    end do
    call test%check_close('vertices carry the force', norm2(force + s%grains%force(:, 1)) &
                          /norm2(force), 0.0_wp, 1.0e-14_wp)
    call test%check_close('vertices carry the moment', &
                          norm2(moment - s%surfaces%sums%moment(:, 1)) /norm2(moment), 0.0_wp, &
                          1.0e-12_wp)
    call s%step(20000, errors)
    call s%refresh_ledger()
    call test%check_close('ledger on a soft floor', s%closure()/s%ledger%start, 0.0_wp, 1.0e-4_wp)
  end subroutine check_soft
  !> A floor and a wall of one mesh hold an ellipsoid in their corner as two planes do; more threads
  !! and a wider list change no bit.
  subroutine check_corner()
    type(dem_system_type) :: a, b, c
    type(error_list_type) :: errors
    real(wp), parameter :: x(3) = [2.6e-3_wp, 0.1e-3_wp, 2.6e-3_wp]
    real(wp), parameter :: v(3) = [-0.3_wp, 0.1_wp, -0.2_wp]
    real(wp) :: zero(3, 2), worst
    integer(i4) :: k

    zero = 0.0_wp
    call make_grain(a, ellipsoid, x, v, [1.0_wp, 2.0_wp, 3.0_wp])
    call make_grain(b, ellipsoid, x, v, [1.0_wp, 2.0_wp, 3.0_wp])
    call make_grain(c, ellipsoid, x, v, [1.0_wp, 2.0_wp, 3.0_wp])
    call make_planes(a%planes, zero, reshape([0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp], &
                                             [3, 2]), zero, [2, 2])
    call make_angle(b)
    call make_angle(c)
    c%par%skin = 1.0e-3_wp
    call a%init(errors)
    call b%init(errors)
    call omp_set_num_threads(2)
    call c%init(errors)
    worst = 0.0_wp
    do k = 1, 100
      call omp_set_num_threads(1)
      call a%step(100, errors)
      call b%step(100, errors)
      call omp_set_num_threads(2)
      call c%step(100, errors)
      worst = larger(worst, max_abs(a%grains%x - b%grains%x)/ellipsoid(1))
    end do
    call omp_set_num_threads(1)
    call test%check('the corner is touched on both sides', &
                    all(sum(abs(a%planes%impulse), 1) > 0.0_wp))
    call test%check_close('a corner of one mesh is two planes', worst, 0.0_wp, 1.0e-10_wp)
    call test%check_close('its force is that of both planes', max_abs( &
      sum(a%planes%impulse, 2) - b%surfaces%sums%impulse(:, 1))/(a%grains%mass(1)*0.3_wp), 0.0_wp, &
      1.0e-10_wp)
    call test%check('same bits with threads and list', &
                    all(abs(b%grains%x - c%grains%x) <= 0.0_wp) .and. &
                    all(abs(b%surfaces%sums%impulse - c%surfaces%sums%impulse) <= 0.0_wp))
  end subroutine check_corner

  !> Floor and wall that meet along y.
  subroutine make_angle(s)
    type(dem_system_type), intent(inout) :: s
    real(wp), parameter :: l = 2.0e-2_wp
    real(wp) :: p(3, 6)
    p = reshape([0.0_wp, -l, 0.0_wp, 0.0_wp, l, 0.0_wp, l, -l, 0.0_wp, l, l, 0.0_wp, &
                 0.0_wp, -l, l, 0.0_wp, l, l], [3, 6])
    call add_triangles(s, p, reshape([1, 3, 4, 1, 4, 2, 1, 2, 6, 1, 6, 5], [3, 4]))
  end subroutine make_angle

  subroutine add_triangles(s, p, node)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: p(:, :)
    integer(i4), intent(in) :: node(:, :)
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    mesh%name = 'triangles'
    call join_corners(reshape(p(:, [node]), [3, 3, size(node, 2)]), mesh)
    call check_mesh(mesh, .false., errors)
    call test%check('triangles', .not. errors%any())
    call add_mesh(s%surfaces, mesh, 'triangles', surface_rigid, 2, cos(0.35_wp), &
                  [0.0_wp, 0.0_wp, 0.0_wp])
  end subroutine add_triangles

  !> A floor that rises and one that turns: the work is what the grain has, force and moment are
  !! minus the grain's.
  subroutine check_moving(on_top)
    integer(i4), intent(in), optional :: on_top  !! laws, see add_laws
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: r(3), f(3), moment(3)
    integer(i4) :: k

    call make_grain(s, ellipsoid, [4.0e-3_wp, 1.0e-3_wp, 2.3e-3_wp], [0.0_wp, 0.0_wp, 0.0_wp], &
                    [0.0_wp, 0.0_wp, 0.0_wp])
    call make_floor(s, 0.02_wp, surface_rigid)
    if (present(on_top)) call add_laws(s, on_top)
    s%par%gravity = 0.0_wp
    s%par%dt = 2.0e-7_wp
    s%surfaces%velocity(:, 1) = [0.0_wp, 0.0_wp, 0.2_wp]
    s%surfaces%spin(:, 1) = [0.0_wp, -30.0_wp, 10.0_wp]
    call s%init(errors)
    do k = 1, 2000
      call s%step(10, errors)
      if (s%surfaces%list%contacts(1) == 1 .and. norm2(s%grains%force) > 0.05_wp) exit
    end do
    f = s%grains%force(:, 1)
    r = s%grains%x(:, 1) - s%surfaces%centre(:, 1)
    moment = s%grains%moment(:, 1) + [r(2)*f(3) - r(3)*f(2), r(3)*f(1) - r(1)*f(3), &
                                      r(1)*f(2) - r(2)*f(1)]
    call test%check('a floor that moves is touched', norm2(f) > 0.05_wp)
    call test%check_close('its force', norm2(s%surfaces%sums%force(:, 1) + f)/norm2(f), 0.0_wp, &
                          1.0e-14_wp)
    call test%check_close('its moment', norm2(s%surfaces%sums%moment(:, 1) &
                          + moment)/norm2(moment), 0.0_wp, 1.0e-12_wp)
    call s%step(20000, errors)
    call s%refresh_ledger()
    call test%check('the grain is thrown off', s%grains%v(3, 1) > 0.2_wp)
    call test%check_close('work of the floor', s%surfaces%sums%work(1), s%ledger%boundary, &
                          1.0e-14_wp*abs(s%ledger%boundary))
    call test%check_close('ledger with a floor that turns', s%closure()/s%ledger%boundary, 0.0_wp, &
                          1.0e-4_wp)
  end subroutine check_moving

  !> A membrane holds grains on both sides, and at its rim the force is in its plane.
  subroutine check_both_sides()
    real(wp), parameter :: r = sphere(1), depth = 1.0e-5_wp
    real(wp) :: force(3, 3), x(3, 3)
    integer(i4) :: k

    x = reshape([2.0e-3_wp, 1.0e-3_wp, r - depth, 2.0e-3_wp, 1.0e-3_wp, depth - r, &
                 depth - r, 0.5e-3_wp, 0.0_wp], [3, 3])
    do k = 1, 3
      call make_test_membrane(x(:, k), force(:, k))
    end do
    call test%check_close('same force on both sides', force(3, 1), -force(3, 2), &
                          1.0e-12_wp*force(3, 1))
    call test%check_close('same force at the rim', -force(1, 3), force(3, 1), 1.0e-9_wp*force(3, 1))
    call test%check_close('straight out', abs(force(3, 3)) + abs(force(2, 3)), 0.0_wp, &
                          1.0e-12_wp*force(3, 1))
  end subroutine check_both_sides

  !> Force on a sphere at x on or beside a membrane in x > 0.
  subroutine make_test_membrane(x, force)
    real(wp), intent(in) :: x(3)
    real(wp), intent(out) :: force(3)
    real(wp), parameter :: l = 1.0e-2_wp
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    call make_grain(s, sphere, x, [0.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 0.0_wp])
    call add_triangles(s, reshape([0.0_wp, -l, 0.0_wp, l, -l, 0.0_wp, l, l, 0.0_wp, 0.0_wp, l, &
                                   0.0_wp], [3, 4]), reshape([1, 2, 3, 1, 3, 4], [3, 2]))
    call s%init(errors)
    force = s%grains%force(:, 1)
  end subroutine make_test_membrane
end program test_dem_surface
