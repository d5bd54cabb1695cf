!> The liquid's forces on the cone of a penetrometer and on its shaft: pressures that are uniform,
!! hydrostatic or of one gradient, inside the grid and through its side, and the drag.
program test_dem_pore_tips
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_pore_fit, only: make_fit
  use dem_pore_grid, only: brick_count, node_count, node_place
  use dem_pore_state, only: pore_grid_type, pore_fit_type
  use dem_pore_tips, only: load_tips, shoulder_pressure, span_tips
  use dem_pore_tools, only: begin_tools, share_tools, span_tools, tool_drag, tool_lift, tool_loads
  use dem_surface_make, only: round_type
  use dem_surface_state, only: dem_surfaces_type
  use dem_surface_values, only: add_cone
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 4000
  real(wp), parameter :: h = 4.0e-3_wp, pi = acos(-1.0_wp), radius = 1.1_wp*h
  real(wp), parameter :: apex = pi/6.0_wp, high = radius/tan(apex), area = pi*radius**2
  real(wp), parameter :: up(3) = [0.2_wp, -0.1_wp, 1.0_wp]/sqrt(1.05_wp)
  real(wp), parameter :: weight(3) = [0.0_wp, 0.0_wp, -9810.0_wp]
  real(wp), parameter :: none(3) = 0.0_wp
  type(pore_grid_type) :: grid
  real(wp) :: x(3, n), volume(n)

  grid%bricks = [6, 6, 8]
  grid%lower = [-0.01_wp, 0.005_wp, 0.1_wp]
  grid%upper = grid%lower + h*grid%bricks
  call check_uniform()
  call check_still()
  call check_gradient()
  call check_side()
  call check_drag()
  call test%finish()

contains

  !> A penetrometer with its tip in the middle of bricks 3, 3 and one along z, and grains around it.
  subroutine make_cone(above, length, fit, axis)
    real(wp), intent(in) :: above, length   !! of the tip over the floor, of the shaft [bricks]
    type(pore_fit_type), intent(out) :: fit
    real(wp), intent(in) :: axis(3)
    type(dem_surfaces_type) :: s
    real(wp) :: away(3), along
    integer(i4) :: i
    call add_cone(s, 'cone', [1, 1, 1], round_type(grid%lower + h*[2.7_wp, 3.3_wp, above], axis, &
                                                   radius, length*h), apex)
    do i = 1, n
      x(:, i) = grid%lower + h*grid%bricks*[some(i, 1), some(i, 2), some(i, 3)]
      away = x(:, i) - s%centre(:, 1)
      along = dot_product(away, axis)
      volume(i) = 0.6_wp*h**3*product(grid%bricks)/n
      if (along > 0.0_wp .and. along < high + length*h .and. &
          norm2(away - along*axis) < min(radius, along*tan(apex))) volume(i) = 0.0_wp
    end do
    call begin_tools(s, fit%tools)
    call share_tools(grid, fit%tools)
    fit%tools%weight = [(0.6_wp, i=1, brick_count(grid))]
    call make_fit(grid, x, volume, fit)
    call span_tools(grid, fit)
    call span_tips(grid, fit)
  end subroutine make_cone

  !> Numbers in (0, 1) without pattern.
  pure real(wp) function some(i, k)
    integer(i4), intent(in) :: i, k
    real(wp), parameter :: step(3) = [0.8191725134_wp, 0.6710436067_wp, 0.5497004779_wp]
    some = modulo(i*step(k) + 0.5_wp, 1.0_wp)
  end function some

  !> A pressure that is linear in x [Pa].
  function linear(p0, slope) result(p)
    real(wp), intent(in) :: p0, slope(3)  !! at the lower corner [Pa], [Pa/m]
    real(wp) :: p(node_count(grid))
    integer(i4) :: a
    do a = 1, size(p)
      p(a) = p0 + dot_product(slope, h*node_place(grid, a))
    end do
  end function linear

  !> The same p around presses the cone up by p A and the upper end down by as much; of one through
  !! the top the shaft feels nothing along z.
  subroutine check_uniform()
    type(pore_fit_type) :: fit
    real(wp) :: p(node_count(grid)), load(6, 1)
    p = linear(3.0e4_wp, none)
    call make_cone(1.3_wp, 2.2_wp, fit, up)
    call load_tips(grid, fit%tools, p, none, 0.0_wp*p)
    load = tool_loads(fit%tools, p)
    call test%check('one tip', fit%tools%tips%n == 1)
    call test%check_all_close('cone', fit%tools%tips%load(:, 1)/(3.0e4_wp*area), up, 1.0e-12_wp)
    call test%check_all_close('all', load(:3, 1)/(3.0e4_wp*area), 0.0_wp, 1.0e-12_wp)
    call test%check_close('shoulder', shoulder_pressure(grid, fit%tools, 1, p), 3.0e4_wp, 1.0e-8_wp)
    call make_cone(1.3_wp, 12.0_wp, fit, up)
    call load_tips(grid, fit%tools, p, none, 0.0_wp*p)
    load = tool_loads(fit%tools, p)
    call test%check_all_close('cone of one through the top', &
                              fit%tools%tips%load(:, 1)/(3.0e4_wp*area), up, 1.0e-12_wp)
    ! the section with the top is one across the axis over its cosine
    call test%check_all_close('its shaft', (load(:3, 1) - fit%tools%tips%load(:, 1)) &
                              /(3.0e4_wp*area), [0.0_wp, 0.0_wp, 1.0_wp/up(3)] - up, 1.0e-12_wp)
  end subroutine check_uniform

  !> Still water: weight of what the cone displaces, and the pressure on its base missing.
  subroutine check_still()
    type(pore_fit_type) :: fit
    real(wp) :: rest(node_count(grid)), wanted(3), lift(6, 1), middle
    rest = linear(-weight(3)*h*grid%bricks(3), weight)
    call make_cone(1.3_wp, 2.2_wp, fit, up)
    call load_tips(grid, fit%tools, 0.0_wp*rest, weight, rest)
    lift = tool_lift(grid, fit%tools, weight, rest)
    middle = -weight(3)*(h*(grid%bricks(3) - 1.3_wp) - high*up(3))
    wanted = middle*area*up - area*high/3.0_wp*weight
    call test%check_all_close('cone', fit%tools%tips%lift(:, 1)/norm2(wanted), &
                              wanted/norm2(wanted), 1.0e-12_wp)
    call test%check_all_close('shaft', (lift(:3, 1) - fit%tools%tips%lift(:, 1))/norm2(wanted), &
                              (-middle*area*up - area*2.2_wp*h*weight)/norm2(wanted), 1.0e-12_wp)
    call test%check_close('shoulder', shoulder_pressure(grid, fit%tools, 1, rest), middle, &
                          1.0e-9_wp*middle)
  end subroutine check_still

  !> A gradient in the bed: the cone bears -V grad p and the pressure that its base lacks, to what
  !! brick fits are worth.
  subroutine check_gradient()
    type(pore_fit_type) :: fit
    real(wp) :: p(node_count(grid)), wanted(3)
    integer(i4) :: a
    real(wp), parameter :: slope(3) = [2.0e5_wp, -3.0e5_wp, 1.0e5_wp]
    call make_cone(1.3_wp, 2.2_wp, fit, up)
    p = linear(0.0_wp, slope)
    p = p - shoulder_pressure(grid, fit%tools, 1, p)
    call load_tips(grid, fit%tools, p, none, 0.0_wp*p)
    wanted = -area*high/3.0_wp*slope
    call test%check_all_close('gradient', fit%tools%tips%load(:, 1)/norm2(wanted), &
                              wanted/norm2(wanted), 0.05_wp)
    wanted = fit%tools%tips%load(:, 1)
    do a = 1, size(p)  ! what alternates from node to node presses nothing
      p(a) = p(a) + merge(1.0e6_wp, -1.0e6_wp, modulo(sum(node_place(grid, a)), 2) == 0)
    end do
    call load_tips(grid, fit%tools, p, none, 0.0_wp*p)
    call test%check_all_close('alternating', (fit%tools%tips%load(:, 1) - wanted)/(1.0e6_wp*area), &
                              0.0_wp, 1.0e-12_wp)
    call test%check_close('at the shoulder', shoulder_pressure(grid, fit%tools, 1, p), 0.0_wp, &
                          1.0e-6_wp)
  end subroutine check_gradient

  !> A cone whose shoulder is still above the top: its section there is all that a uniform pressure
  !! sees, and the shaft has no part.
  subroutine check_side()
    type(pore_fit_type) :: fit
    real(wp) :: p(node_count(grid)), load(6, 1), deep
    p = linear(3.0e4_wp, none)
    deep = 0.4_wp*high
    call make_cone(8.0_wp - deep/h, 4.0_wp, fit, [0.0_wp, 0.0_wp, 1.0_wp])
    call load_tips(grid, fit%tools, p, none, 0.0_wp*p)
    load = tool_loads(fit%tools, p)
    call test%check_all_close('cone', fit%tools%tips%load(:, 1)/(3.0e4_wp*area), &
                              [0.0_wp, 0.0_wp, 0.16_wp], 1.0e-12_wp)
    call test%check_all_close('shaft', (load(:3, 1) - fit%tools%tips%load(:, 1)) &
                              /(3.0e4_wp*area), 0.0_wp, 1.0e-12_wp)
    call test%check_close('shoulder', shoulder_pressure(grid, fit%tools, 1, p), 0.0_wp, 0.0_wp)
  end subroutine check_side

  !> A uniform density of drag is shared by volume.
  subroutine check_drag()
    type(pore_fit_type) :: fit
    real(wp) :: q(4, 3), wanted
    integer(i4) :: c
    call make_cone(1.3_wp, 2.2_wp, fit, up)
    q = 0.0_wp
    q(1, :) = [3.0_wp, -2.0_wp, 5.0_wp]
    do c = 1, brick_count(grid)
      call tool_drag(grid, c, q, fit%tools)
    end do
    wanted = high/3.0_wp/(high/3.0_wp + 2.2_wp*h)
    call test%check_all_close('its part', fit%tools%tips%drag(:, 1)/fit%tools%drag(:3, 1), wanted, &
                              0.02_wp)
    call test%check_close('its sense', fit%tools%tips%drag(1, 1)/(-1.8_wp*area*high/3.0_wp), &
                          1.0_wp, 0.02_wp)
  end subroutine check_drag
end program test_dem_pore_tips
