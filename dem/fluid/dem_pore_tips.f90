!> What the liquid does to the cone of a penetrometer, apart from its shaft.
!!
!! The cone is a closed body up to a disc at the shoulder; the pressure on the disc, which is not a
!! surface, is taken off again. What a displacement of the cone compresses is one matrix of three
!! columns, as for whole bodies. eq. D.79
module dem_pore_tips
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_ellipsoid, only: rotation_of
  use dem_pore_cut, only: add_cuts
  use dem_pore_grid, only: brick_count, brick_edges, brick_of, corners_of, node_count, place_in, &
    sign_of, slopes
  use dem_pore_solid, only: facets_of_tip, fill_bricks, size_of_facets
  use dem_pore_state, only: pore_grid_type, pore_fit_type, pore_tools_type
  use dem_surface_state, only: dem_surfaces_type, surface_cone
  implicit none
  private
  public :: begin_tips, span_tips, load_tips, clear_tip_drag, tip_drag, shoulder_pressure

  integer(i4), parameter :: rings = 8     !! of points on the disc, of one area each
  integer(i4), parameter :: around = 72   !! on each
  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> The penetrometers among the tools.
  subroutine begin_tips(s, tools)
    type(dem_surfaces_type), intent(in) :: s
    type(pore_tools_type), intent(inout) :: tools
    integer(i4) :: k, t, n
    associate (tips => tools%tips)
      tips%tool = pack([(t, t=1, tools%n)], [(s%kind(tools%body(t)) == surface_cone, t=1, tools%n)])
      n = size(tips%tool)
      tips%n = n
      allocate (tips%load(3, n), tips%drag(3, n), tips%lift(3, n), source=0.0_wp)
      if (n == 0) return
      allocate (tips%rest(3, 3, size(facets_of_tip(s, tools%body(tips%tool(1))), 3), n))
      do k = 1, n
        tips%rest(:, :, :, k) = facets_of_tip(s, tools%body(tips%tool(k)))
      end do
    end associate
  end subroutine begin_tips

  !> Triangles of a cone where its tool was placed [m].
  pure function tip_facets(tools, k) result(p)
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: k
    real(wp) :: p(3, 3, size(tools%tips%rest, 3)), r(3, 3)
    integer(i4) :: i
    r = rotation_of(tools%quat(:, tools%tips%tool(k)))
    do i = 1, size(p, 3)
      p(:, :, i) = matmul(r, tools%tips%rest(:, :, i, k)) &
                   + spread(tools%centre(:, tools%tips%tool(k)), 2, 3)
    end do
  end function tip_facets

  !> What displacements of the cones compress, once the fit is there. eq. D.79
  subroutine span_tips(grid, fit)
    type(pore_grid_type), intent(in) :: grid
    type(pore_fit_type), intent(inout) :: fit
    real(wp), allocatable :: cut(:, :), disc(:)
    integer(i4) :: k, t, j
    if (fit%tools%tips%n == 0) return
    associate (tips => fit%tools%tips)
      tips%moment = 0.0_wp*fit%tools%moment
      allocate (cut(6, node_count(grid)), disc(node_count(grid)))
      tips%cut = reshape([(0.0_wp, k=1, 3*size(disc)*tips%n)], [3, size(disc), tips%n])
      do k = 1, tips%n
        t = tips%tool(k)
        cut = 0.0_wp
        call add_cuts(grid, tip_facets(fit%tools, k), fit%tools%centre(:, t), cut)
        call weigh_disc(grid, fit%tools, k, disc)
        do j = 1, 3
          tips%cut(j, :, k) = cut(j, :) - shoulder_axis(fit%tools, k, j)*disc
        end do
        call share_tip(grid, fit%tools, k)
      end do
      tips%gives = tips%cut
      call add_bricks(grid, fit)
    end associate
  end subroutine span_tips

  !> The cone's parts of the shares of its tool.
  subroutine share_tip(grid, tools, k)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(inout) :: tools
    integer(i4), intent(in) :: k
    real(wp), allocatable :: part(:, :, :, :, :)
    integer(i4) :: low(3), at(3), c, i
    call fill_bricks(grid, tip_facets(tools, k), low, part)
    if (size(part) == 0) return
    do c = 1, brick_count(grid)
      at = place_in(grid, c) - low + 1
      if (any(at < 1 .or. at > [size(part, 3), size(part, 4), size(part, 5)])) cycle
      do i = tools%start(c), tools%start(c + 1) - 1
        if (tools%tool(i) == tools%tips%tool(k)) &
          tools%tips%moment(:, :, i) = part(:, :, at(1), at(2), at(3))
      end do
    end do
  end subroutine share_tip

  !> Add what displacements of the cones compress in the fits of their bricks.
  subroutine add_bricks(grid, fit)
    type(pore_grid_type), intent(in) :: grid
    type(pore_fit_type), intent(inout) :: fit
    integer(i4) :: c, i, k
    do c = 1, brick_count(grid)
      do i = fit%tools%start(c), fit%tools%start(c + 1) - 1
        k = findloc(fit%tools%tips%tool, fit%tools%tool(i), 1)
        if (k > 0) call add_share(grid, c, matmul(fit%inverse(:, :, c), &
                                  fit%tools%weight(c)*fit%tools%tips%moment(:, 1, i)), &
                                  fit%tools%tips%gives(:, :, k))
      end do
    end do
  end subroutine add_bricks

  !> The part of brick c, whose linear field by a displacement of one is known.
  pure subroutine add_share(grid, c, field, gives)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: field(4)         !! 1, places
    real(wp), intent(inout) :: gives(:, :)   !! (3, nodes)
    real(wp) :: g(4, 3, 8)
    integer(i4) :: a, node(8)
    g = slopes(brick_edges(grid))
    node = corners_of(grid, c)
    do a = 1, 8
      gives(:, node(a)) = gives(:, node(a)) + matmul(field, g(:, :, a))
    end do
  end subroutine add_share

  !> Component j of the axis up the shaft.
  pure real(wp) function shoulder_axis(tools, k, j) result(axis)
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: k, j
    real(wp) :: r(3, 3), up(3)
    r = rotation_of(tools%quat(:, tools%tips%tool(k)))
    up = tools%tips%rest(:, 1, 2, k)
    axis = dot_product(r(j, :), up)/norm2(up)
  end function shoulder_axis

  !> A point of the disc at the shoulder, at a radius in its own, which is that of its rim [m].
  pure function disc_point(tools, k, radius, angle) result(x)
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: radius, angle  !! [-], [rad]
    real(wp) :: x(3), up(3), e(3), f(3)
    up = tools%tips%rest(:, 1, 2, k)
    e = tools%tips%rest(:, 2, 2, k) - up
    e = e/norm2(e)
    f = cross(up/norm2(up), e)
    x = up + radius*disc_radius(tools, k)*(cos(angle)*e + sin(angle)*f)
    x = tools%centre(:, tools%tips%tool(k)) &
        + matmul(rotation_of(tools%quat(:, tools%tips%tool(k))), x)
  end function disc_point

  !> Radius of the circle of the area of the disc, a polygon of 72 corners [m].
  pure real(wp) function disc_radius(tools, k) result(radius)
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: k
    real(wp), parameter :: step = 2.0_wp*pi/around
    radius = norm2(tools%tips%rest(:, 2, 2, k) - tools%tips%rest(:, 1, 2, k))/sqrt(step/sin(step))
  end function disc_radius

  !> Integrals of the functions of the nodes over the disc at the shoulder, as far as it is in the
  !! grid; exact for linear pressures [m^2].
  pure subroutine weigh_disc(grid, tools, k, disc)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: disc(:)
    integer(i4) :: i, j
    disc = 0.0_wp
    do i = 1, rings
      do j = 1, around
        call add_point(grid, disc_point(tools, k, sqrt((i - 0.5_wp)/rings), 2.0_wp*pi*j/around), &
                       pi*disc_radius(tools, k)**2/(rings*around), disc)
      end do
    end do
  end subroutine weigh_disc

  !> Add a weight at a point, by the functions of the nodes there, less what they have of pressures
  !! that alternate from corner to corner: no fit sees these. None outside the grid.
  pure subroutine add_point(grid, x, weight, values)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(3), weight
    real(wp), intent(inout) :: values(:)
    real(wp) :: h(3), local(3), n(8), alternating(8)
    integer(i4) :: c, a, node(8)
    h = brick_edges(grid)
    c = brick_of(grid, 1.0_wp/h, x)
    if (c == 0) return
    local = (x - grid%lower)/h - place_in(grid, c) - 0.5_wp
    node = corners_of(grid, c)
    do a = 1, 8
      n(a) = product(0.5_wp + sign_of(:, a)*local)
      alternating(a) = product(sign_of(:, a))
    end do
    n = n - alternating*dot_product(alternating, n)/8.0_wp
    do a = 1, 8
      values(node(a)) = values(node(a)) + weight*n(a)
    end do
  end subroutine add_point

  !> Forces of the pressures and of the hydrostatic ones on the cones. eq. D.79
  subroutine load_tips(grid, tools, p, weight, rest)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(inout) :: tools
    real(wp), intent(in) :: p(:)       !! (nodes) over the hydrostatic pressure [Pa]
    real(wp), intent(in) :: weight(3)  !! of the liquid, density times gravity [N/m^3]
    real(wp), intent(in) :: rest(:)    !! (nodes) hydrostatic pressure [Pa]
    real(wp) :: volume, middle(3), facets(3, 3, size(tools%tips%rest, 3))
    integer(i4) :: k
    do k = 1, tools%tips%n
      associate (tips => tools%tips)
        tips%load(:, k) = -matmul(tips%gives(:, :, k), p)
        facets = tip_facets(tools, k)
        if (all(minval(minval(facets, 3), 2) >= grid%lower) .and. &
            all(maxval(maxval(facets, 3), 2) <= grid%upper)) then
          call size_of_facets(tips%rest(:, :, :, k), volume, middle)
        else
          volume = sum(tips%moment(1, 1, :), mask=tools%tool == tips%tool(k))
        end if
        tips%lift(:, k) = -volume*weight - matmul(tips%cut(:, :, k), rest)
      end associate
    end do
  end subroutine load_tips

  !> No drag yet.
  pure subroutine clear_tip_drag(tools)
    type(pore_tools_type), intent(inout) :: tools
    if (tools%tips%n > 0) tools%tips%drag = 0.0_wp
  end subroutine clear_tip_drag

  !> Add to the drag on the cones what share i of a tool, of weight w, gets by a density of force q.
  pure subroutine tip_drag(tools, i, w, q)
    type(pore_tools_type), intent(inout) :: tools
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: w        !! in the fit [-]
    real(wp), intent(in) :: q(4, 3)  !! as in tool_drag
    integer(i4) :: k
    k = 0
    if (tools%tips%n > 0) k = findloc(tools%tips%tool, tools%tool(i), 1)
    if (k > 0) tools%tips%drag(:, k) = tools%tips%drag(:, k) &
                                       - w*matmul(tools%tips%moment(1, :, i), q)
  end subroutine tip_drag

  !> Mean pressure over the hydrostatic one around the shoulder of cone k, where its exchange began;
  !! 0 outside the grid [Pa].
  pure real(wp) function shoulder_pressure(grid, tools, k, p) result(mean)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: p(:)  !! (nodes) [Pa]
    real(wp) :: share(size(p))
    integer(i4) :: j
    share = 0.0_wp
    do j = 1, around
      call add_point(grid, disc_point(tools, k, 1.0_wp, 2.0_wp*pi*j/around), 1.0_wp, share)
    end do
    mean = sum(share*p)/max(sum(share), 1.0_wp)
  end function shoulder_pressure
end module dem_pore_tips
