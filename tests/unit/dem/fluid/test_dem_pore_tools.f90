!> Closed bodies in the grid of the liquid: volumes and shares, rigid motions that compress nothing,
!! power and resultants, cross-sections at sides, weight of what they displace.
program test_dem_pore_tools
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: test_type, max_abs
  use talus_vectors, only: cross
  use dem_ellipsoid, only: rotation_of
  use dem_pore_fit, only: make_fit, fit_fields
  use dem_pore_grid, only: brick_count, node_count, brick_edges, corners_of, node_place, place_in, &
    slopes, side_share, on_side
  use dem_pore_operator, only: compress, add_hull, grain_forces, storage
  use dem_pore_solid, only: has_inside
  use dem_pore_state, only: pore_grid_type, pore_fit_type
  use dem_pore_tools, only: add_tool_fields, begin_tools, share_tools, span_tools, sweep_tools, &
    tool_lift, tool_loads, tool_share
  use dem_surface_make, only: mesh_type, round_type, join_corners, check_mesh
  use dem_surface_state, only: dem_surfaces_type, surface_rigid
  use dem_surface_values, only: add_cone, add_cylinder, add_mesh
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 4000
  real(wp), parameter :: h = 4.0e-3_wp, pi = acos(-1.0_wp)
  type(pore_grid_type) :: grid
  real(wp) :: x(3, n), volume(n)

  call make_cloud()
  call check_volumes()
  call check_aligned()
  call check_turned()
  call check_rigid()
  call check_filled()
  call check_strain()
  call check_power()
  call check_gradient()
  call check_lift()
  call test%finish()

contains

  !> Numbers in (0, 1) without pattern.
  pure real(wp) function some(i, k)
    integer(i4), intent(in) :: i, k
    real(wp), parameter :: step(5) = [0.6180339887_wp, 0.7548776662_wp, 0.5698402909_wp, &
                                      0.8191725134_wp, 0.4501945237_wp]
    some = modulo(i*step(k) + 0.5_wp, 1.0_wp)
  end function some

  !> Grains all over a grid of 5 x 6 x 7 bricks, 0.6 of its volume.
  subroutine make_cloud()
    integer(i4) :: i
    grid%bricks = [5, 6, 7]
    grid%lower = [-0.01_wp, 0.005_wp, 0.1_wp]
    grid%upper = grid%lower + h*grid%bricks
    do i = 1, n
      x(:, i) = grid%lower + h*grid%bricks*[some(i, 1), some(i, 2), some(i, 3)]
      volume(i) = 0.5_wp + some(i, 4)
    end do
    volume = 0.6_wp*h**3*product(grid%bricks)/sum(volume)*volume
  end subroutine make_cloud

  !> A block of these edges around a centre, with its corners' normals outwards or inwards.
  subroutine add_block(s, edge, centre, inwards)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: edge(3), centre(3)
    logical, intent(in) :: inwards
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    real(wp) :: corner(3, 3, 12), p(3, 8)
    integer(i4), parameter :: of(3, 12) = reshape([1, 3, 2, 2, 3, 4, 5, 6, 7, 6, 8, 7, 1, 2, 5, 2, &
      6, 5, 3, 7, 4, 4, 7, 8, 1, 5, 3, 3, 5, 7, 2, 4, 6, 4, 8, 6], [3, 12])
    integer(i4) :: k
    do k = 1, 8
      p(:, k) = centre + 0.5_wp*edge*merge(1.0_wp, -1.0_wp, [btest(k - 1, 0), btest(k - 1, 1), &
                                                            btest(k - 1, 2)])
    end do
    do k = 1, 12
      corner(:, :, k) = p(:, of(:, k))
      if (inwards) corner(:, :, k) = corner(:, [1, 3, 2], k)
    end do
    mesh%name = 'block'
    call join_corners(corner, mesh)
    call check_mesh(mesh, .true., errors)
    call test%check('block is closed', .not. errors%any())
    call add_mesh(s, mesh, 'block', surface_rigid, 1, 0.9_wp, centre)
  end subroutine add_block

  !> Bodies become tools with shares, and the fit is made with them.
  subroutine make_tools(s, fit)
    type(dem_surfaces_type), intent(in) :: s
    type(pore_fit_type), intent(inout) :: fit
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    fit%tools%weight = 0.6_wp
    fit%inverse_mass = 1.0_wp/(2650.0_wp*volume)
    call make_fit(grid, x, volume, fit)
    call span_tools(grid, fit)
  end subroutine make_tools

  !> D v of grains and tools, sides at rest but where tools go through.
  subroutine press(fit, v, motion, rate)
    type(pore_fit_type), intent(in) :: fit
    real(wp), intent(in) :: v(:, :), motion(:, :)
    real(wp), intent(out) :: rate(:)
    real(wp) :: field(4, 3, brick_count(grid))
    call fit_fields(fit, v, field)
    call add_tool_fields(grid, fit, motion, field)
    call compress(grid, field, rate)
    rate = rate + sweep_tools(fit%tools, motion, size(rate, kind=i4))
  end subroutine press

  !> Volumes of a block that is seen from inside, a cylinder and a cone; a bore has no inside.
  subroutine check_volumes()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: found(3), middle(3), cone
    integer(i4) :: k
    middle = 0.5_wp*(grid%lower + grid%upper)
    call add_block(s, h*[1.3_wp, 2.1_wp, 1.7_wp], middle - h*[0.0_wp, 0.0_wp, 1.4_wp], .true.)
    call add_cylinder(s, 'rod', 1, round_type(middle + h*[0.0_wp, 0.0_wp, 1.2_wp], &
                      [1.0_wp, 2.0_wp, 0.5_wp], 0.9_wp*h, 1.1_wp*h), .false.)
    call add_cone(s, 'cone', [1, 1, 1], round_type(middle - h*[1.0_wp, 1.0_wp, 0.3_wp], &
                  [0.1_wp, 0.2_wp, 1.0_wp], 0.8_wp*h, 0.7_wp*h), pi/6.0_wp)
    call add_cylinder(s, 'bore', 1, round_type(middle, [0.0_wp, 0.0_wp, 1.0_wp], 2.0_wp*h, h), &
                      .true.)
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    call test%check('three tools', fit%tools%n == 3 .and. .not. has_inside(s, 4))
    cone = pi*(0.8_wp*h)**2*(0.7_wp*h + 0.8_wp*h/tan(pi/6.0_wp)/3.0_wp)
    call test%check_all_close('their volumes', fit%tools%volume/[1.3_wp*2.1_wp*1.7_wp*h**3, &
      pi*(0.9_wp*h)**2*2.2_wp*h, cone], 1.0_wp, 1.0e-12_wp)
    do k = 1, 3
      found(k) = sum(fit%tools%moment(1, 1, :), mask=fit%tools%tool == k)
    end do
    ! an edge is counted to a 36th of a brick by the columns of two of three directions
    call test%check_all_close('that of their shares', found/fit%tools%volume, 1.0_wp, &
      2.0_wp/3.0_wp/36.0_wp*(1.0_wp/1.3_wp + 1.0_wp/2.1_wp + 1.0_wp/1.7_wp))
  end subroutine check_volumes

  !> A block on the sides of bricks fills these to rounding, with their moments, and no others.
  subroutine check_aligned()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: wanted(4, 4)
    integer(i4) :: c, k
    call add_block(s, h*[1.0_wp, 2.0_wp, 3.0_wp], grid%lower + h*[2.5_wp, 3.0_wp, 3.5_wp], .false.)
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    call test%check('six bricks', size(fit%tools%tool) == 6)
    wanted = 0.0_wp
    wanted(1, 1) = 1.0_wp
    do k = 2, 4
      wanted(k, k) = 1.0_wp/12.0_wp
    end do
    do k = 1, 6
      call test%check_close('volume', fit%tools%moment(1, 1, k)/h**3, 1.0_wp, 1.0e-13_wp)
      call test%check_all_close('middle', fit%tools%moment(2:, 1, k)/h**3, 0.0_wp, 1.0e-13_wp)
      ! places of 36 columns in both directions across
      call test%check_all_close('moments', reshape(fit%tools%moment(:, :, k)/h**3, [16]), &
                                reshape(wanted, [16]), 0.01_wp)
    end do
    c = 1 + 2 + 5*(2 + 6*2)
    call test%check_close('first brick', tool_share(grid, fit%tools, c), 1.0_wp, 1.0e-13_wp)
    call test%check_close('beside it', tool_share(grid, fit%tools, c - 1), 0.0_wp, 0.0_wp)
  end subroutine check_aligned

  !> A block that is turned has the volume and the middle that it had.
  subroutine check_turned()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: middle(3), first(3), centre(3)
    integer(i4) :: c, k
    middle = 0.5_wp*(grid%lower + grid%upper)
    call add_block(s, h*[2.0_wp, 2.0_wp, 2.0_wp], middle, .false.)
    s%quat(:, 1) = [0.8_wp, 0.3_wp, -0.4_wp, 0.2_wp]/sqrt(0.93_wp)
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    call test%check_close('volume', sum(fit%tools%moment(1, 1, :))/h**3, 8.0_wp, 0.08_wp)
    first = 0.0_wp
    do c = 1, brick_count(grid)
      centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
      do k = fit%tools%start(c), fit%tools%start(c + 1) - 1
        first = first + h*fit%tools%moment(2:, 1, k) + fit%tools%moment(1, 1, k)*(centre - middle)
      end do
    end do
    call test%check_all_close('middle', first/h**4, 0.0_wp, 0.02_wp)
    call test%check('shares are positive', all(fit%tools%moment(1, 1, :) > 0.0_wp))
  end subroutine check_turned

  !> Two tools, one through a side: one motion of all compresses nothing.
  subroutine make_two(s, fit)
    type(dem_surfaces_type), intent(inout) :: s
    type(pore_fit_type), intent(inout) :: fit
    real(wp) :: middle(3)
    middle = 0.5_wp*(grid%lower + grid%upper)
    call add_block(s, h*[2.3_wp, 2.9_wp, 1.4_wp], middle - h*[0.3_wp, 0.4_wp, 1.6_wp], .false.)
    s%quat(:, 1) = [0.8_wp, 0.3_wp, -0.4_wp, 0.2_wp]/sqrt(0.93_wp)
    call add_cone(s, 'cone', [1, 1, 1], round_type(middle + h*[0.2_wp, 0.5_wp, 0.3_wp], &
                  [0.1_wp, 0.2_wp, 1.0_wp], 1.2_wp*h, 5.0_wp*h), pi/6.0_wp)
    call make_tools(s, fit)
  end subroutine make_two

  subroutine check_rigid()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: v(3, n), rate(node_count(grid)), scale, motion(6, 2)
    real(wp), parameter :: speed(3) = [0.3_wp, -0.7_wp, 0.4_wp]
    real(wp), parameter :: spin(3) = [40.0_wp, 25.0_wp, -9.0_wp]
    integer(i4) :: i, axis, t, end
    call make_two(s, fit)
    v = spread(speed, 2, n)
    motion = spread([speed, 0.0_wp, 0.0_wp, 0.0_wp], 2, 2)
    call press(fit, v, motion, rate)
    scale = max_abs(speed)*h**2
    do axis = 1, 3
      do end = 1, 2
        call add_hull(grid, end, axis, speed(axis), rate)
        do i = 1, size(rate)  ! the walls sweep what the tools leave
          if (on_side(grid, i, end, axis)) &
            rate(i) = rate(i) - speed(axis)*sum(fit%tools%cut(axis, i, :))
        end do
      end do
    end do
    call test%check_all_close('translation', rate/scale, 0.0_wp, 1.0e-12_wp)
    do i = 1, n
      v(:, i) = cross(spin, x(:, i))
    end do
    do t = 1, 2
      motion(:, t) = [cross(spin, fit%tools%centre(:, t)), spin]
    end do
    call press(fit, v, motion, rate)
    scale = max_abs(v)*h**2
    call test%check_all_close('rotation', inner(rate)/scale, 0.0_wp, 1.0e-12_wp)
  end subroutine check_rigid

  !> Values of nodes on no side.
  function inner(values) result(some_values)
    real(wp), intent(in) :: values(:)
    real(wp), allocatable :: some_values(:)
    integer(i4) :: a, at(3)
    allocate (some_values(0))
    do a = 1, node_count(grid)
      at = node_place(grid, a)
      if (all(at > 0 .and. at < grid%bricks)) some_values = [some_values, values(a)]
    end do
  end function inner

  !> A body around the whole grid: whatever it does compresses nothing, at the sides either.
  subroutine check_filled()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: v(3, 0), none(0), at(3, 0), rate(node_count(grid))
    real(wp), parameter :: motion(6, 1) = reshape([0.3_wp, -0.7_wp, 0.4_wp, 40.0_wp, 25.0_wp, &
                                                   -9.0_wp], [6, 1])
    call add_block(s, 10.0_wp*h*[1.0_wp, 1.1_wp, 1.2_wp], grid%lower + 2.0_wp*h, .false.)
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    call make_fit(grid, at, none, fit)
    v = 0.0_wp
    call press(fit, v, motion, rate)
    call test%check_all_close('any motion', rate/(5.0_wp*h**2), 0.0_wp, 1.0e-12_wp)
  end subroutine check_filled

  !> A bed that strains around a body at rest: away from it every node loses its share, and what is
  !! compressed in all is what the sides sweep.
  subroutine check_strain()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: v(3, n), rate(node_count(grid)), share(node_count(grid)), one(brick_count(grid))
    real(wp), parameter :: strain(3) = [0.02_wp, -0.05_wp, -0.01_wp], still(6, 1) = 0.0_wp
    logical :: far(node_count(grid))
    integer(i4) :: i, c, axis
    call add_block(s, 1.5_wp*h*[1.0_wp, 1.0_wp, 1.0_wp], grid%lower + 1.5_wp*h, .false.)
    call make_tools(s, fit)
    do i = 1, n
      v(:, i) = strain*x(:, i)
    end do
    call press(fit, v, still, rate)
    call test%check_close('in all', sum(rate), 0.0_wp, 1.0e-18_wp)
    do axis = 1, 3
      call add_hull(grid, 1, axis, strain(axis)*grid%lower(axis), rate)
      call add_hull(grid, 2, axis, strain(axis)*grid%upper(axis), rate)
    end do
    one = 1.0_wp
    call storage(grid, one, 1.0_wp, share)
    far = .true.
    do c = 1, brick_count(grid)
      if (tool_share(grid, fit%tools, c) > 0.0_wp) far(corners_of(grid, c)) = .false.
    end do
    call test%check('most nodes are far', count(far) > 200)
    call test%check_all_close('uniform strain', pack(rate/share, far), -sum(strain), 1.0e-12_wp)
  end subroutine check_strain

  !> F.v of grains and tools = -p.Dv for any motion and pressure; without cross-sections sums of
  !! forces and moments are those of -grad p over the bricks.
  subroutine check_power()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: v(3, n), force(3, n), rate(node_count(grid)), p(node_count(grid)), power(2)
    real(wp) :: motion(6, 2), load(6, 2), total(6), wanted(6)
    integer(i4) :: i, t
    call make_two(s, fit)
    do i = 1, n
      v(:, i) = [some(i, 5), some(i + 7, 2), some(i + 3, 4)] - 0.5_wp
    end do
    motion = reshape([(some(i, 2) - 0.5_wp, i=1, 12)], [6, 2])
    motion(4:, :) = 100.0_wp*motion(4:, :)
    p = [(1.0e5_wp*(some(i, 3) - 0.3_wp), i=1, size(p))]
    call press(fit, v, motion, rate)
    call grain_forces(grid, fit, p, force)
    load = tool_loads(fit%tools, p)
    power = [sum(force*v) + sum(load*motion), -sum(p*rate)]
    call test%check_close('power', power(1)/power(2), 1.0_wp, 1.0e-12_wp)
    total = 0.0_wp
    do i = 1, n
      total = total + [force(:, i), cross(x(:, i), force(:, i))]
    end do
    do t = 1, 2
      load(:, t) = load(:, t) + matmul(fit%tools%cut(:, :, t), p)  ! as if it went through no side
      total = total + [load(:3, t), load(4:, t) + cross(fit%tools%centre(:, t), load(:3, t))]
    end do
    wanted = resultant(p)
    call test%check_all_close('resultant', total(:3)/norm2(wanted(:3)), &
                              wanted(:3)/norm2(wanted(:3)), 1.0e-12_wp)
    call test%check_all_close('moment', total(4:)/norm2(wanted(4:)), wanted(4:)/norm2(wanted(4:)), &
                              1.0e-12_wp)
  end subroutine check_power

  !> Force and moment of -grad p over all bricks.
  function resultant(p) result(total)
    real(wp), intent(in) :: p(:)
    real(wp) :: total(6), g(4, 3, 8), pull(4, 3), edge(3)
    integer(i4) :: c, a, i, node(8)
    g = slopes(brick_edges(grid))
    total = 0.0_wp
    do c = 1, brick_count(grid)
      node = corners_of(grid, c)
      pull = 0.0_wp
      do a = 1, 8
        pull = pull - p(node(a))*g(:, :, a)
      end do
      total = total + [pull(1, :), cross(grid%lower + h*(place_in(grid, c) + 0.5_wp), pull(1, :))]
      do i = 1, 3
        edge = 0.0_wp
        edge(i) = h
        total(4:) = total(4:) + cross(edge, pull(1 + i, :))
      end do
    end do
  end function resultant

  !> No grains within a block.
  subroutine clear_block(edge, centre)
    real(wp), intent(in) :: edge(3), centre(3)
    integer(i4) :: i
    do i = 1, n
      if (all(abs(x(:, i) - centre) < 0.5_wp*edge)) volume(i) = 0.0_wp
    end do
  end subroutine clear_block

  !> A uniform gradient: a block on the sides of bricks bears -V grad p to rounding, wherever it is
  !! to a few per cent; one through both ends bears nothing along them.
  subroutine check_gradient()
    type(dem_surfaces_type) :: s, t, u
    type(pore_fit_type) :: fit, other, through
    real(wp) :: p(node_count(grid)), load(6, 1), middle(3), kept(n)
    real(wp), parameter :: slope(3) = [2.0e5_wp, -3.0e5_wp, 1.0e5_wp]
    integer(i4) :: a
    do a = 1, size(p)
      p(a) = dot_product(slope, h*node_place(grid, a))
    end do
    call add_block(s, h*[1.0_wp, 2.0_wp, 3.0_wp], grid%lower + h*[2.5_wp, 3.0_wp, 3.5_wp], .false.)
    kept = volume
    call clear_block(h*[1.0_wp, 2.0_wp, 3.0_wp], s%centre(:, 1))
    call make_tools(s, fit)
    volume = kept
    load = tool_loads(fit%tools, p)
    call test%check_all_close('force', load(:3, 1)/(6.0_wp*h**3*norm2(slope)), &
                              -slope/norm2(slope), 1.0e-12_wp)
    call test%check_all_close('moment', load(4:, 1)/(6.0_wp*h**4*norm2(slope)), 0.0_wp, 1.0e-12_wp)
    call add_block(t, h*[2.0_wp, 2.0_wp, 3.0_wp], grid%lower + h*[2.7_wp, 2.9_wp, 3.3_wp], .false.)
    call clear_block(h*[2.0_wp, 2.0_wp, 3.0_wp], t%centre(:, 1))
    call make_tools(t, other)
    volume = kept
    load = tool_loads(other%tools, p)
    call test%check_all_close('anywhere', load(:3, 1)/(12.0_wp*h**3*norm2(slope)), &
                              -slope/norm2(slope), 0.03_wp)
    middle = 0.5_wp*(grid%lower + grid%upper)
    call add_block(u, h*[1.0_wp, 2.0_wp, 9.0_wp], middle, .false.)
    call clear_block(h*[1.0_wp, 2.0_wp, 9.0_wp], middle)
    call make_tools(u, through)
    volume = kept
    load = tool_loads(through%tools, p)
    call test%check_close('through both ends: along', load(3, 1)/(14.0_wp*h**3*norm2(slope)), &
                          0.0_wp, 1.0e-12_wp)
    call test%check_all_close('and across', load(:2, 1)/(14.0_wp*h**3), -slope(:2), &
                              1.0e-12_wp*norm2(slope))
  end subroutine check_gradient

  !> Weight of the liquid displaced, about the middle; of one through the upper side the part below;
  !! through the lower side the pressure there is missing.
  subroutine check_lift()
    type(dem_surfaces_type) :: s
    type(pore_fit_type) :: fit
    real(wp) :: rest(node_count(grid)), lift(6, 3), middle(3)
    real(wp), parameter :: weight(3) = [0.0_wp, 0.0_wp, -9810.0_wp]
    integer(i4) :: a
    do a = 1, size(rest)
      rest(a) = 9810.0_wp*h*(grid%bricks(3) - dot_product([0, 0, 1], node_place(grid, a)))
    end do
    middle = 0.5_wp*(grid%lower + grid%upper)
    call add_block(s, h*[1.3_wp, 0.8_wp, 1.7_wp], middle - h*[1.0_wp, 1.0_wp, 0.0_wp], .false.)
    call add_block(s, h*[1.0_wp, 1.0_wp, 4.0_wp], grid%upper - h*[2.5_wp, 2.5_wp, 0.0_wp], .false.)
    call add_block(s, h*[1.0_wp, 1.0_wp, 4.0_wp], grid%lower + h*[2.5_wp, 2.5_wp, 0.0_wp], .false.)
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    lift = tool_lift(grid, fit%tools, weight, rest)
    call test%check_close('inside', lift(3, 1)/(9810.0_wp*1.3_wp*0.8_wp*1.7_wp*h**3), 1.0_wp, &
                          1.0e-12_wp)
    call test%check_close('through the top', lift(3, 2)/(9810.0_wp*2.0_wp*h**3), 1.0_wp, 1.0e-12_wp)
    call test%check_close('through the bottom', lift(3, 3)/(9810.0_wp*h**3), -5.0_wp, 1.0e-12_wp)
    call test%check_all_close('no moment', reshape(lift(4:, :)/(9810.0_wp*h**4), [9]), 0.0_wp, &
                              1.0e-12_wp)
  end subroutine check_lift
end program test_dem_pore_tools
