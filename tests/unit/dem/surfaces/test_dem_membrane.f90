!> Membranes: forces are gradients of energies, on grain and corners, however the membrane is bent;
!! a
!! membrane that is touched in one place counts once; pressure acts by area.
program test_dem_membrane
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: larger, test_type
  use talus_vectors, only: cross
  use dem_figure, only: figure_type
  use dem_integrate, only: motion_type, work_count
  use dem_membrane, only: no_membranes, shape_membrane, pull_membranes, finish_membranes, &
    membranes_energy
  use dem_ellipsoid, only: rotation_of
  use dem_surface_feature, only: features_type, touches_type, most_features
  use dem_surface_find, only: find_touches
  use dem_surface_make, only: mesh_type, join_corners, check_mesh
  use dem_surface_values, only: add_mesh
  use dem_surface_state, only: dem_surfaces_type, surface_membrane
  implicit none
  type(test_type) :: test
  real(wp), parameter :: axes(3, 2) = reshape([1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 0.8_wp, 0.7_wp], &
                                              [3, 2])
  real(wp), parameter :: radius = 1.0e-3_wp
  integer(i4), parameter :: m = 8

  call check_gradients(0.0_wp, 'flat')
  call check_gradients(2.0e-5_wp, 'slightly bent')
  call check_gradients(2.0e-4_wp, 'bent')
  call check_walk()
  call check_pressure()
  call check_work()
  call check_stretch()
  call check_masses()
  call test%finish()

contains

  !> A membrane of odd triangles around z = 0, its corners up and down by at most `bump`.
  subroutine make_test_membrane(s, bump)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: bump
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    real(wp) :: node(3, 0:m, 0:m), corner(3, 3, 2*m*m), odd(3)
    integer(i4) :: i, j, k

    do j = 0, m
      do i = 0, m
        odd = [sin(7.3_wp*i + 3.1_wp*j), sin(2.7_wp*i + 9.1_wp*j), sin(5.9_wp*i + 4.3_wp*j)]
        node(:, i, j) = [(i - 0.5_wp*m)*0.5_wp*radius, (j - 0.5_wp*m)*0.5_wp*radius, 0.0_wp] &
                        + odd*[0.1_wp*radius, 0.1_wp*radius, bump]
      end do
    end do
    k = 1
    do j = 1, m
      do i = 1, m
        corner(:, :, k) = node(:, [i - 1, i, i], j - 1)
        corner(:, 3, k) = node(:, i, j)
        corner(:, :, k + 1) = node(:, [i - 1, i, i - 1], j)
        corner(:, 1, k + 1) = node(:, i - 1, j - 1)
        k = k + 2
      end do
    end do
    mesh%name = 'sheet'
    call join_corners(corner, mesh)
    call check_mesh(mesh, .false., errors)
    call test%check('a membrane', .not. errors%any())
    call add_mesh(s, mesh, 'sheet', surface_membrane, 1, 0.94_wp, [0.0_wp, 0.0_wp, 0.0_wp])
    s%list%near = 1
    s%list%near_start = [1, s%mesh%triangles + 1]
    s%list%candidate = [(k, k=1, s%mesh%triangles)]
    allocate (s%list%history(most_features, 1, 1))
    allocate (s%list%image(3, size(s%list%candidate)), source=0.0_wp)
  end subroutine make_test_membrane

  pure type(figure_type) function grain_at(x, shape)
    real(wp), intent(in) :: x(3)
    integer(i4), intent(in) :: shape
    real(wp) :: r(3, 3), a(3, 3), q(4), semi(3)
    integer(i4) :: k
    q = [0.9_wp, 0.3_wp, -0.2_wp, 0.1_wp]
    r = rotation_of(q/norm2(q))
    semi = axes(:, shape)*radius
    do k = 1, 3
      a(:, k) = matmul(r, semi**2*r(k, :))
    end do
    grain_at%x = x
    grain_at%radius = radius
    grain_at%span = radius
    grain_at%a = [a(1, 1), a(2, 2), a(3, 3), a(1, 2), a(2, 3), a(3, 1)]
    grain_at%square = product(semi)**2
  end function grain_at

  !> Height of a centre whose grain dips into the plane z = 0 by some per cent [m].
  pure real(wp) function low(shape)
    integer(i4), intent(in) :: shape
    type(figure_type) :: grain
    grain = grain_at([0.0_wp, 0.0_wp, 0.0_wp], shape)
    low = 0.96_wp*sqrt(grain%a(3))
  end function low

  !> Energy (sum of overlap^2/2 by index), force on the grain and on the corners, sum of indices.
  subroutine look(s, x, shape, energy, force, corner, index, many)
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: x(3)
    integer(i4), intent(in) :: shape
    real(wp), intent(out) :: energy, force(3), corner(:, :)
    integer(i4), intent(out) :: index
    integer(i4), intent(out), optional :: many  !! minima, saddles and maxima
    type(features_type) :: f
    type(touches_type) :: touches
    integer(i4) :: k, j, vertex

    call find_touches(s, 1, grain_at(x, shape), f, touches)
    if (present(many)) many = f%n
    energy = 0.0_wp
    force = 0.0_wp
    corner = 0.0_wp
    index = 0
    do k = 1, f%n
      index = index + nint(f%sign(k))
      energy = energy + 0.5_wp*f%sign(k)*f%gap(k)**2
      force = force - f%sign(k)*f%gap(k)*f%normal(:, k)
      do j = 1, 3
        vertex = s%mesh%corner(j, f%candidate(k))
        corner(:, vertex) = corner(:, vertex) &
                            + f%sign(k)*f%gap(k)*f%share(j, k)*f%normal(:, k)
      end do
    end do
  end subroutine look

  !> Forces against differences of the energy, at many places.
  subroutine check_gradients(bump, name)
    real(wp), intent(in) :: bump
    character(len=*), intent(in) :: name
    type(dem_surfaces_type) :: s
    real(wp), parameter :: step = 1.0e-9_wp
    real(wp), allocatable :: corner(:, :), some(:, :)
    real(wp) :: x(3), y(3), force(3), none(3), u(2), worst(2), balance
    integer(i4) :: k, a, side, index, shape, v, most, touched

    call make_test_membrane(s, bump)
    allocate (corner(3, s%mesh%vertices), some(3, s%mesh%vertices))
    worst = 0.0_wp
    balance = 0.0_wp
    most = 0
    touched = 0
    do k = 1, 60
      shape = 1 + mod(k, 2)
      x = [radius*sin(1.7_wp*k), radius*cos(2.3_wp*k), low(shape)]
      call look(s, x, shape, u(1), force, corner, index)
      if (index == 0) cycle
      touched = touched + 1
      if (.not. bump > 0.0_wp) most = max(most, abs(index - 1))
      balance = larger(balance, norm2(force + sum(corner, 2))/norm2(force))
      v = maxloc(sum(abs(corner), 1), 1)
      do a = 1, 3
        do side = 1, 2
          y = x
          y(a) = y(a) + (2*side - 3)*step
          call look(s, y, shape, u(side), none, some, index)
        end do
        worst(1) = larger(worst(1), abs((u(2) - u(1))/(2.0_wp*step) + force(a))/norm2(force))
        do side = 1, 2
          s%mesh%x(a, v) = s%mesh%x(a, v) + (2*side - 3)*step
          call look(s, x, shape, u(side), none, some, index)
          s%mesh%x(a, v) = s%mesh%x(a, v) - (2*side - 3)*step
        end do
        worst(2) = larger(worst(2), abs((u(2) - u(1))/(2.0_wp*step) + corner(a, v))/norm2(force))
      end do
    end do
    call test%check(name//': touched', touched > 40)
    call test%check(name//': flat counts once', most == 0)
    call test%check_close(name//': sum of forces', balance, 0.0_wp, 1.0e-12_wp)
    call test%check_close(name//': force on the grain', worst(1), 0.0_wp, 1.0e-4_wp)
    call test%check_close(name//': force on a corner', worst(2), 0.0_wp, 1.0e-4_wp)
  end subroutine check_gradients

  !> A grain that slides over a bent membrane: work of the force is the energy, whatever it crosses.
  subroutine check_walk()
    type(dem_surfaces_type) :: s
    integer(i4), parameter :: steps = 4000
    real(wp), allocatable :: corner(:, :)
    real(wp) :: x(3), y(3), force(3), last(3), u, first, work, largest
    integer(i4) :: k, index, many, shape, fewest, most

    call make_test_membrane(s, 1.5e-4_wp)
    allocate (corner(3, s%mesh%vertices))
    do shape = 1, 2
      work = 0.0_wp
      largest = 0.0_wp
      fewest = huge(fewest)
      most = 0
      do k = 0, steps
        y = [radius*(2.0_wp*k/steps - 1.0_wp), 0.3_wp*radius*sin(5.0_wp*k/steps), low(shape)]
        call look(s, y, shape, u, force, corner, index, many)
        if (k == 0) first = u
        if (k > 0) work = work - 0.5_wp*dot_product(force + last, y - x)
        largest = larger(largest, u)
        fewest = min(fewest, many)
        most = max(most, many)
        x = y
        last = force
      end do
      call test%check('several contacts on the way', most > fewest)
      call test%check_close('work of the walk', (u - first - work)/largest, 0.0_wp, 1.0e-4_wp)
    end do
  end subroutine check_walk

  !> Pressure on a closed membrane sums to nothing, on one triangle it is p A along its normal.
  subroutine check_pressure()
    type(dem_surfaces_type) :: s, ball
    real(wp) :: area(3), p(3, 6)
    integer(i4), parameter :: side(3, 8) = reshape([1, 3, 5, 3, 2, 5, 2, 4, 5, 4, 1, 5, &
                                                    3, 1, 6, 2, 3, 6, 4, 2, 6, 1, 4, 6], [3, 8])

    p = reshape([1.0_wp, 0.0_wp, 0.0_wp, -1.1_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.9_wp, 0.1_wp, &
                 0.0_wp, -1.0_wp, 0.0_wp, 0.2_wp, 0.0_wp, 1.3_wp, 0.0_wp, 0.0_wp, -1.0_wp], [3, 6])
    call add_triangles(ball, p, side)
    ball%membranes%pressure = 5.0_wp
    call pull_membranes(ball)
    call test%check_close('pressure on a closed membrane', norm2(sum(ball%membranes%press, 2)), &
                          0.0_wp, 1.0e-14_wp)
    call test%check('pressure inwards', sum(ball%membranes%press*ball%mesh%x) < 0.0_wp)
    call test%check_close('three times pressure times volume', &
                          -sum(ball%membranes%press*ball%mesh%x)/5.0_wp, 3.0_wp*volume(ball), &
                          1.0e-13_wp)
    call add_triangles(s, p, side(:, :1))
    s%membranes%pressure = 5.0_wp
    call pull_membranes(s)
    area = 0.5_wp*cross(p(:, 3) - p(:, 1), p(:, 5) - p(:, 1))
    call test%check_close('pressure on a triangle', norm2(sum(s%membranes%press, 2)), &
                          5.0_wp*norm2(area), 1.0e-14_wp)
  end subroutine check_pressure

  !> A closed membrane that shrinks alike is given pressure times the volume that it loses; whatever
  !! holds its corners gets that and what the stretch gives.
  subroutine check_work()
    type(dem_surfaces_type) :: ball
    real(wp), parameter :: rate = 0.1_wp, dt = 1.0e-3_wp, much = 1.1_wp
    real(wp) :: p(3, 6), work(work_count), given
    integer(i4), parameter :: side(3, 8) = reshape([1, 3, 5, 3, 2, 5, 2, 4, 5, 4, 1, 5, &
                                                    3, 1, 6, 2, 3, 6, 4, 2, 6, 1, 4, 6], [3, 8])

    p = 0.0_wp
    p(1, 1:2) = [1.0_wp, -1.0_wp]
    p(2, 3:4) = [1.0_wp, -1.0_wp]
    p(3, 5:6) = [1.0_wp, -1.0_wp]
    call add_triangles(ball, p, side)
    ball%membranes%pressure = 5.0_wp
    ball%mesh%x = much*ball%mesh%x
    ball%mesh%v = -rate*ball%mesh%x
    call pull_membranes(ball)
    work = 0.0_wp
    ball%membranes%wall = -1
    call finish_membranes(ball, dt, work)
    given = 5.0_wp*3.0_wp*rate*volume(ball)*dt
    call test%check_close('work of the pressure', work(2)/given, 1.0_wp, 1.0e-12_wp)
    call test%check_close('free corners ask for no other', work(4), 0.0_wp, 0.0_wp)
    ball%membranes%wall = 0
    work = 0.0_wp
    call finish_membranes(ball, dt, work)
    call test%check_close('work of the pressure on held corners', work(2)/given, 1.0_wp, 1.0e-12_wp)
    given = given + dt*sum(ball%membranes%pull*ball%mesh%v)
    call test%check('a stretched membrane pulls inwards', &
                    sum(ball%membranes%pull*ball%mesh%v) > 0.0_wp)
    call test%check_close('work of what holds corners', work(4)/given, -1.0_wp, 1.0e-12_wp)
  end subroutine check_work

  pure real(wp) function volume(s)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4) :: k
    volume = 0.0_wp
    do k = 1, s%mesh%triangles
      associate (x => s%mesh%x(:, s%mesh%corner(:, k)))
        volume = volume + dot_product(x(:, 1), cross(x(:, 2), x(:, 3)))/6.0_wp
      end associate
    end do
    volume = abs(volume)
  end function volume

  subroutine add_triangles(s, p, node)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: p(:, :)
    integer(i4), intent(in) :: node(:, :)
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    mesh%name = 'triangles'
    call join_corners(reshape(p(:, [node]), [3, 3, size(node, 2)]), mesh)
    call check_mesh(mesh, .false., errors)
    call test%check('triangles', .not. errors%any())
    call add_mesh(s, mesh, 'triangles', surface_membrane, 1, 0.9_wp, [0.0_wp, 0.0_wp, 0.0_wp])
    call no_membranes(s)
    s%membranes%modulus = 7.0_wp
    s%membranes%poisson = 0.3_wp
    call shape_membrane(s, 1, 2.0_wp, [0.01_wp, 0.02_wp, 0.03_wp])
  end subroutine add_triangles

  !> The pull of the stretch is the gradient of its energy; a plane membrane stretched alike has the
  !! closed form.
  subroutine check_stretch()
    type(dem_surfaces_type) :: s
    type(motion_type) :: motion
    real(wp), parameter :: step = 1.0e-6_wp, much = 1.2_wp
    real(wp) :: p(3, 4), part(3), u(2), worst, strain
    integer(i4) :: a, k, side

    p = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.1_wp, 0.0_wp, 1.1_wp, 1.0_wp, 0.0_wp, &
                 0.0_wp, 0.9_wp, 0.0_wp], [3, 4])
    call add_triangles(s, p, reshape([1, 2, 3, 1, 3, 4], [3, 2]))
    s%mesh%x = much*s%mesh%x
    call pull_membranes(s)
    part = membranes_energy(s, motion)
    strain = 0.5_wp*(much**2 - 1.0_wp)
    call test%check_close('energy of an even stretch', part(3), &
                          sum(s%membranes%area)*7.0_wp*1.3_wp*strain**2, 1.0e-13_wp)
    call test%check_close('its largest stretch', s%membranes%stretch(1), much, 1.0e-12_wp)
    s%mesh%x(3, 2) = 0.2_wp
    s%mesh%x(1, 3) = 1.4_wp
    call pull_membranes(s)
    worst = 0.0_wp
    do k = 1, 4
      do a = 1, 3
        do side = 1, 2
          s%mesh%x(a, k) = s%mesh%x(a, k) + (2*side - 3)*step
          part = membranes_energy(s, motion)
          u(side) = part(3)
          s%mesh%x(a, k) = s%mesh%x(a, k) - (2*side - 3)*step
        end do
        worst = larger(worst, abs((u(2) - u(1))/(2.0_wp*step) + s%membranes%pull(a, k)))
      end do
    end do
    call test%check_close('pull of the stretch', worst, 0.0_wp, 1.0e-8_wp)
  end subroutine check_stretch

  !> Each corner has a third of the mass of its triangles.
  subroutine check_masses()
    type(dem_surfaces_type) :: s
    real(wp), parameter :: weight = 2.0_wp  ! of add_triangles [kg/m^2]
    real(wp) :: p(3, 4)

    p = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, &
                 0.0_wp, 2.0_wp, 0.0_wp], [3, 4])
    call add_triangles(s, p, reshape([1, 2, 3, 1, 3, 4], [3, 2]))  ! of 1/2 and 1 m^2
    call test%check_all_close('masses of corners', s%membranes%mass, &
                              weight*[0.5_wp, 1.0_wp/6.0_wp, 0.5_wp, 1.0_wp/3.0_wp], 1.0e-14_wp)
  end subroutine check_masses
end program test_dem_membrane
