!> Loads of the liquid on closed bodies, how free ones give way to pressures, and the works.
module dem_pore_tool_loads
  use talus_kinds, only: wp, i4
  use dem_pore_cavity, only: hydrostatic
  use dem_pore_state, only: sum_work, sum_drag, sum_tools, sum_held_drag
  use dem_pore_tips, only: load_tips
  use dem_pore_tools, only: tool_loads, tool_lift
  use dem_state, only: dem_data_type
  use dem_surface_body, only: body_energy, is_free, principal_axes, set_liquid, turns_freely
  implicit none
  private
  public :: load_tools, hold_loads, give_way, book_tools

contains

  !> Loads of the exchange that begins; the leapfrog's part of the energy of free bodies follows.
  subroutine load_tools(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: before, weight(3)
    if (d%pore%fit%tools%n == 0) return
    weight = d%pore%liquid%density*d%par%gravity_scale*d%par%gravity
    associate (tools => d%pore%fit%tools)
      tools%load = tool_loads(tools, d%pore%p)
      tools%lift = tool_lift(d%pore%grid, tools, weight, hydrostatic(d%pore%grid, weight))
      call load_tips(d%pore%grid, tools, d%pore%p, weight, hydrostatic(d%pore%grid, weight))
    end associate
    before = staggering(d)
    call hold_loads(d)
    d%ledger%start = d%ledger%start - (staggering(d) - before)
  end subroutine load_tools

  !> Bodies feel them from now on.
  subroutine hold_loads(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: load(6, d%surfaces%n)
    load = 0.0_wp
    associate (tools => d%pore%fit%tools)
      load(:, tools%body) = tools%load + tools%drag + tools%lift
    end associate
    call set_liquid(d%surfaces, load)
  end subroutine hold_loads

  !> The leapfrog's part of the energy of all bodies [J].
  pure real(wp) function staggering(d)
    type(dem_data_type), intent(in) :: d
    real(wp) :: part(2)
    integer(i4) :: b
    staggering = 0.0_wp
    do b = 1, d%surfaces%n
      if (.not. is_free(d%surfaces, b)) cycle
      part = body_energy(d%surfaces, b, d%ledger_dt, d%par%gravity_scale*d%par%gravity)
      staggering = staggering + part(2)
    end do
  end function staggering

  !> Columns w of which sum w w' is span^2 D M^-1 D' of the free bodies. eq. D.77
  subroutine give_way(d, span, w)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: span                 !! [s]
    real(wp), allocatable, intent(out) :: w(:, :)  !! (nodes, columns) [m^1.5 ...]
    real(wp) :: r(3, 3), scale(6)
    integer(i4) :: t, b, j, n
    allocate (w(size(d%pore%p), 6*d%pore%fit%tools%n))
    n = 0
    associate (tools => d%pore%fit%tools, s => d%surfaces)
      do t = 1, tools%n
        b = tools%body(t)
        if (.not. is_free(s, b)) cycle
        scale = span/sqrt([s%rigid%mass(b), s%rigid%mass(b), s%rigid%mass(b), &
                           s%rigid%inertia(:, b)])
        r = principal_axes(s, b)
        do j = 1, 6
          if (s%rigid%free(j, b) < 0.5_wp) cycle
          n = n + 1
          w(:, n) = scale(j)*tools%gives(j, :, t)
          if (j > 3 .and. turns_freely(s, b)) &
            w(:, n) = scale(j)*matmul(r(:, j - 3), tools%gives(4:, :, t))
        end do
      end do
    end associate
    w = w(:, :n)
  end subroutine give_way

  !> Works of an exchange: of free directions with those on the grains, of the others as those of
  !! walls; drag is lost either way.
  subroutine book_tools(d, way)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: way(:, :)  !! (6, tools) in the exchange [m], [rad]
    real(wp) :: free(6), pressed(6), dragged(6)
    integer(i4) :: t
    associate (tools => d%pore%fit%tools, sums => d%pore%sums)
      do t = 1, tools%n
        free = 0.0_wp
        if (is_free(d%surfaces, tools%body(t))) free = d%surfaces%rigid%free(:, tools%body(t))
        pressed = tools%load(:, t)*way(:, t)
        dragged = tools%drag(:, t)*way(:, t)
        tools%work(t) = tools%work(t) + sum(pressed + dragged)
        sums(sum_work) = sums(sum_work) + sum(free*pressed)
        sums(sum_drag) = sums(sum_drag) - sum(dragged)
        sums(sum_tools) = sums(sum_tools) - sum((1.0_wp - free)*(pressed + dragged))
        sums(sum_held_drag) = sums(sum_held_drag) + sum((1.0_wp - free)*dragged)
      end do
    end associate
  end subroutine book_tools
end module dem_pore_tool_loads
