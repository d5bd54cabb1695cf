!> Closed bodies in the grid of the liquid: they count in the fits of their bricks as solid that
!! moves as they do, and bear their share of the forces there.
!!
!! What a motion of a body compresses is one matrix of six columns; loads on it are the transpose,
!! so that powers agree to rounding. eqs. D.75 to D.78
module dem_pore_tools
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_ellipsoid, only: rotation_of, rotation_between
  use dem_pore_cut, only: add_cuts
  use dem_pore_grid, only: brick_count, brick_edges, corners_of, node_count, place_in, slopes
  use dem_pore_solid, only: facets_of, fill_bricks, has_inside, size_of_facets
  use dem_pore_state, only: pore_grid_type, pore_fit_type, pore_tools_type
  use dem_pore_tips, only: begin_tips, tip_drag
  use dem_surface_state, only: dem_surfaces_type
  implicit none
  private
  public :: begin_tools, place_tools, share_tools, span_tools, add_tool_fields, sweep_tools
  public :: tool_velocity, tool_way, tool_loads, tool_drag, tool_share, is_in, tool_lift

  real(wp), parameter :: least = 1.0e-9_wp  !! of a brick, that is a share of it

contains

  !> Surfaces with an inside become tools.
  subroutine begin_tools(s, tools)
    type(dem_surfaces_type), intent(in) :: s
    type(pore_tools_type), intent(inout) :: tools
    real(wp), allocatable :: p(:, :, :), all(:, :, :)
    integer(i4) :: b, k, n
    tools%body = pack([(b, b=1, s%n)], [(has_inside(s, b), b=1, s%n)])
    n = size(tools%body)
    tools%n = n
    allocate (tools%volume(n), tools%middle(3, n), tools%centre(3, n), tools%quat(4, n))
    allocate (tools%load(6, n), tools%drag(6, n), tools%lift(6, n), tools%work(n), source=0.0_wp)
    tools%first = [(1_i4, k=0, n)]
    allocate (tools%rest(3, 3, 0))
    do k = 1, n
      p = facets_of(s, tools%body(k))
      call size_of_facets(p, tools%volume(k), tools%middle(:, k))
      tools%first(k + 1) = tools%first(k) + size(p, 3, kind=i4)
      allocate (all(3, 3, tools%first(k + 1) - 1))
      all(:, :, :tools%first(k) - 1) = tools%rest
      all(:, :, tools%first(k):) = p
      call move_alloc(all, tools%rest)
    end do
    call place_tools(s, tools)
    call begin_tips(s, tools)
  end subroutine begin_tools

  !> Where the tools are now.
  subroutine place_tools(s, tools)
    type(dem_surfaces_type), intent(in) :: s
    type(pore_tools_type), intent(inout) :: tools
    if (tools%n == 0) return
    tools%centre = s%centre(:, tools%body)
    tools%quat = s%quat(:, tools%body)
  end subroutine place_tools

  !> Triangles of a tool where it was placed [m].
  pure function facets_now(tools, t) result(p)
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: t
    real(wp) :: p(3, 3, tools%first(t + 1) - tools%first(t)), r(3, 3), x(3)
    integer(i4) :: k, j
    r = rotation_of(tools%quat(:, t))
    do k = 1, size(p, 3)
      do j = 1, 3
        x = tools%rest(:, j, tools%first(t) + k - 1)
        p(:, j, k) = tools%centre(:, t) + (r(:, 1)*x(1) + r(:, 2)*x(2) + r(:, 3)*x(3))
      end do
    end do
  end function facets_now

  !> Shares of all bricks, in the order of the tools, and cross-sections at the sides. eq. D.75
  subroutine share_tools(grid, tools)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(inout) :: tools
    real(wp), allocatable :: p(:, :, :)
    integer(i4), allocatable :: brick(:), tool(:), order(:)
    real(wp), allocatable :: moment(:, :, :)
    integer(i4) :: t, c, k
    if (tools%n == 0) return
    allocate (brick(0), tool(0), moment(4, 4, 0))
    if (allocated(tools%cut)) deallocate (tools%cut)
    allocate (tools%cut(6, node_count(grid), tools%n), source=0.0_wp)
    do t = 1, tools%n
      p = facets_now(tools, t)
      call add_shares(grid, t, p, brick, tool, moment)
      call add_cuts(grid, p, tools%centre(:, t), tools%cut(:, :, t))
    end do
    if (.not. allocated(tools%weight)) allocate (tools%weight(brick_count(grid)), source=1.0_wp)
    tools%start = [(0_i4, c=0, brick_count(grid))]
    do k = 1, size(brick)
      tools%start(brick(k) + 1) = tools%start(brick(k) + 1) + 1
    end do
    tools%start(1) = 1
    do c = 2, size(tools%start)
      tools%start(c) = tools%start(c) + tools%start(c - 1)
    end do
    order = tools%start
    tools%tool = tool
    tools%moment = moment
    do k = 1, size(brick)
      tools%tool(order(brick(k))) = tool(k)
      tools%moment(:, :, order(brick(k))) = moment(:, :, k)
      order(brick(k)) = order(brick(k)) + 1
    end do
  end subroutine share_tools

  !> Those of one tool, after the ones that are there.
  subroutine add_shares(grid, t, p, brick, tool, moment)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: t
    real(wp), intent(in) :: p(:, :, :)
    integer(i4), allocatable, intent(inout) :: brick(:), tool(:)
    real(wp), allocatable, intent(inout) :: moment(:, :, :)
    real(wp), allocatable :: part(:, :, :, :, :), more(:, :, :)
    integer(i4), allocatable :: found(:)
    integer(i4) :: low(3), i, j, k, n
    call fill_bricks(grid, p, low, part)
    allocate (more(4, 4, size(part)/16), found(size(part)/16))
    n = 0
    do k = 1, size(part, 5)
      do j = 1, size(part, 4)
        do i = 1, size(part, 3)
          if (part(1, 1, i, j, k) <= least*product(brick_edges(grid))) cycle
          n = n + 1
          more(:, :, n) = part(:, :, i, j, k)
          found(n) = low(1) + i + grid%bricks(1)*(low(2) + j - 1 &
                     + grid%bricks(2)*(low(3) + k - 1))
        end do
      end do
    end do
    brick = [brick, found(:n)]
    tool = [tool, spread(t, 1, n)]
    moment = reshape([moment, more(:, :, :n)], [4, 4, size(brick)])
  end subroutine add_shares

  !> Part of a brick that tools are in [-].
  pure real(wp) function tool_share(grid, tools, c) result(share)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: c
    integer(i4) :: k
    share = 0.0_wp
    if (tools%n == 0) return
    do k = tools%start(c), tools%start(c + 1) - 1
      share = share + tools%moment(1, 1, k)
    end do
    share = share/product(brick_edges(grid))
  end function tool_share

  !> Is a tool in a brick?
  pure logical function is_in(tools, c)
    type(pore_tools_type), intent(in) :: tools
    integer(i4), intent(in) :: c
    is_in = .false.
    if (tools%n > 0) is_in = tools%start(c + 1) > tools%start(c)
  end function is_in

  !> Velocities and spins (6, tools) [m/s], [rad/s].
  pure function tool_velocity(s, tools) result(motion)
    type(dem_surfaces_type), intent(in) :: s
    type(pore_tools_type), intent(in) :: tools
    real(wp) :: motion(6, tools%n)
    if (tools%n == 0) return
    motion(:3, :) = s%velocity(:, tools%body)
    motion(4:, :) = s%spin(:, tools%body)
  end function tool_velocity

  !> Displacements and rotations since they were placed (6, tools) [m], [rad].
  pure function tool_way(s, tools) result(motion)
    type(dem_surfaces_type), intent(in) :: s
    type(pore_tools_type), intent(in) :: tools
    real(wp) :: motion(6, tools%n)
    integer(i4) :: t
    do t = 1, tools%n
      motion(:3, t) = s%centre(:, tools%body(t)) - tools%centre(:, t)
      motion(4:, t) = rotation_between(tools%quat(:, t), s%quat(:, tools%body(t)))
      if (all(abs(s%quat(:, tools%body(t)) - tools%quat(:, t)) <= 0.0_wp)) motion(4:, t) = 0.0_wp
    end do
  end function tool_way

  !> Coefficients of a rigid motion in a brick, as those of fit_fields.
  pure function rigid(centre, h, middle, motion) result(field)
    real(wp), intent(in) :: centre(3)  !! of the brick [m]
    real(wp), intent(in) :: h(3)       !! its edges [m]
    real(wp), intent(in) :: middle(3)  !! about which it turns [m]
    real(wp), intent(in) :: motion(6)
    real(wp) :: field(4, 3), edge(3)
    integer(i4) :: i
    field(1, :) = motion(:3) + cross(motion(4:), centre - middle)
    do i = 1, 3
      edge = 0.0_wp
      edge(i) = h(i)
      field(1 + i, :) = cross(motion(4:), edge)
    end do
  end function rigid

  !> Add the tools' part of the linear fields of all bricks. eq. D.75
  subroutine add_tool_fields(grid, fit, motion, field)
    type(pore_grid_type), intent(in) :: grid
    type(pore_fit_type), intent(in) :: fit
    real(wp), intent(in) :: motion(:, :)       !! (6, tools)
    real(wp), intent(inout) :: field(:, :, :)  !! (4, 3, bricks)
    real(wp) :: h(3), centre(3)
    integer(i4) :: c, k, t
    if (fit%tools%n == 0) return
    h = brick_edges(grid)
    do c = 1, brick_count(grid)
      centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
      do k = fit%tools%start(c), fit%tools%start(c + 1) - 1
        t = fit%tools%tool(k)
        field(:, :, c) = field(:, :, c) + fit%tools%weight(c)*matmul(fit%inverse(:, :, c), &
          matmul(fit%tools%moment(:, :, k), rigid(centre, h, fit%tools%centre(:, t), motion(:, t))))
      end do
    end do
  end subroutine add_tool_fields

  !> What each unit of motion compresses, once the fit is there. eq. D.77
  subroutine span_tools(grid, fit)
    type(pore_grid_type), intent(in) :: grid
    type(pore_fit_type), intent(inout) :: fit
    integer(i4) :: c, k
    if (fit%tools%n == 0) return
    fit%tools%gives = fit%tools%cut
    do c = 1, brick_count(grid)
      do k = fit%tools%start(c), fit%tools%start(c + 1) - 1
        call span_share(grid, c, k, fit)
      end do
    end do
  end subroutine span_tools

  !> The part of share k, in brick c.
  pure subroutine span_share(grid, c, k, fit)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c, k
    type(pore_fit_type), intent(inout) :: fit
    real(wp) :: g(4, 3, 8), h(3), centre(3), unit(6), field(4, 3)
    integer(i4) :: j, a, t, node(8)
    h = brick_edges(grid)
    g = slopes(h)
    node = corners_of(grid, c)
    centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
    t = fit%tools%tool(k)
    do j = 1, 6
      unit = 0.0_wp
      unit(j) = 1.0_wp
      field = fit%tools%weight(c)*matmul(fit%inverse(:, :, c), &
        matmul(fit%tools%moment(:, :, k), rigid(centre, h, fit%tools%centre(:, t), unit)))
      do a = 1, 8
        fit%tools%gives(j, node(a), t) = fit%tools%gives(j, node(a), t) + sum(g(:, :, a)*field)
      end do
    end do
  end subroutine span_share

  !> What motions of the tools sweep at the sides, by node.
  pure function sweep_tools(tools, motion, nodes) result(swept)
    type(pore_tools_type), intent(in) :: tools
    real(wp), intent(in) :: motion(:, :)  !! (6, tools)
    integer(i4), intent(in) :: nodes
    real(wp) :: swept(nodes)
    integer(i4) :: t
    swept = 0.0_wp
    do t = 1, tools%n
      swept = swept + matmul(motion(:, t), tools%cut(:, :, t))
    end do
  end function sweep_tools

  !> Forces and moments of pressures on the tools (6, tools) [N], [N m]. eq. D.77
  pure function tool_loads(tools, p) result(load)
    type(pore_tools_type), intent(in) :: tools
    real(wp), intent(in) :: p(:)  !! (nodes) [Pa]
    real(wp) :: load(6, tools%n)
    integer(i4) :: t
    do t = 1, tools%n
      load(:, t) = -matmul(tools%gives(:, :, t), p)
    end do
  end function tool_loads

  !> Add to the drag on the tools of brick c what its grains are not dragged by: density of force q
  !! of the fit, as in dem_pore_drag.
  pure subroutine tool_drag(grid, c, q, tools)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: q(4, 3)
    type(pore_tools_type), intent(inout) :: tools
    real(wp) :: h(3), centre(3), unit(6), pull(4, 3)
    integer(i4) :: k, j, t
    h = brick_edges(grid)
    centre = grid%lower + h*(place_in(grid, c) + 0.5_wp)
    do k = tools%start(c), tools%start(c + 1) - 1
      t = tools%tool(k)
      pull = tools%weight(c)*matmul(tools%moment(:, :, k), q)
      call tip_drag(tools, k, tools%weight(c), q)
      do j = 1, 6
        unit = 0.0_wp
        unit(j) = 1.0_wp
        tools%drag(j, t) = tools%drag(j, t) - sum(pull*rigid(centre, h, tools%centre(:, t), unit))
      end do
    end do
  end subroutine tool_drag

  !> Loads of the hydrostatic pressure: weight of the liquid that each tool displaces in the grid,
  !! and pressure missing where it goes through a side. eq. D.78
  pure function tool_lift(grid, tools, weight, rest) result(lift)
    type(pore_grid_type), intent(in) :: grid
    type(pore_tools_type), intent(in) :: tools
    real(wp), intent(in) :: weight(3)  !! of the liquid, density times gravity [N/m^3]
    real(wp), intent(in) :: rest(:)    !! (nodes) hydrostatic pressure [Pa]
    real(wp) :: lift(6, tools%n), held(4, tools%n), h(3), low(3), high(3), p(3), arm(3)
    integer(i4) :: c, k, t
    h = brick_edges(grid)
    held = 0.0_wp
    do c = 1, merge(brick_count(grid), 0, tools%n > 0)
      do k = tools%start(c), tools%start(c + 1) - 1
        t = tools%tool(k)
        associate (m => tools%moment(1, :, k))
          held(1, t) = held(1, t) + m(1)
          held(2:, t) = held(2:, t) + h*m(2:) + m(1)*(grid%lower + h*(place_in(grid, c) + 0.5_wp) &
                                                       - tools%centre(:, t))
        end associate
      end do
    end do
    do t = 1, tools%n
      low = minval(minval(facets_now(tools, t), 3), 2)
      high = maxval(maxval(facets_now(tools, t), 3), 2)
      arm = matmul(rotation_of(tools%quat(:, t)), tools%middle(:, t))
      if (all(low >= grid%lower .and. high <= grid%upper)) &
        held(:, t) = tools%volume(t)*[1.0_wp, arm]  ! as the body has it
      p = -weight
      lift(:3, t) = held(1, t)*p
      lift(4:, t) = cross(held(2:, t), p)
      lift(:, t) = lift(:, t) - matmul(tools%cut(:, :, t), rest)
    end do
  end function tool_lift
end module dem_pore_tools
