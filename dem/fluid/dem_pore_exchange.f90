!> One exchange between grains and liquid: it ends the last one and begins the next.
!!
!! At its begin the pressures follow from what is compressed and from what the grains' velocities
!! will compress, with the grains' giving way to them (implicit); their forces are held over its
!! steps. At its end the true motion of the grains counts: sums of the compressed volumes change by
!! what walls sweep and drains let through, whatever the pressures. eqs. D.38 to D.40
module dem_pore_exchange
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use talus_log, only: short_number
  use dem_integrate, only: motion_type, motion_of
  use dem_state, only: dem_data_type, kind_free, kind_ghost
  use dem_pore_state, only: dem_pore_type, sum_swept, sum_inflow, sum_hull, sum_flow, sum_work, &
    sum_darcy, sum_drag, sum_exchange, sum_seepage, sum_tools, sum_held_drag
  use dem_pore_grid, only: brick_count, brick_edges, node_count, on_side, place_in
  use dem_pore_fit, only: make_fit, fit_fields, fit_ways
  use dem_pore_layer, only: add_layers, take_layers
  use dem_pore_hold, only: hold_nodes, hold_pressures, add_sources, find_empty
  use dem_pore_drag, only: set_drag
  use dem_pore_medium, only: count_pores, set_mobility, see_flow, porosity_change
  use dem_pore_operator, only: compress, add_hull, grain_forces, add_flow, brick_matrices
  use dem_pore_partner, only: add_partner, add_yield, book_partner, move_partner, node_storage, &
    take_yield
  use dem_pore_mixing, only: add_mixing, begin_mixing
  use dem_pore_cavity, only: solve_bounded, hydrostatic
  use dem_pore_solve, only: pore_equations_type
  use dem_pore_start, only: boxes_of
  use dem_pore_tips, only: span_tips
  use dem_pore_tools, only: add_tool_fields, place_tools, share_tools, span_tools, sweep_tools, &
    tool_velocity, tool_way
  use dem_pore_tool_loads, only: load_tools, give_way, book_tools
  implicit none
  private
  public :: end_exchange, begin_exchange, follow_walls, book_liquid, see_ghosts

  real(wp), parameter :: loosest = 0.05_wp  !! solid fraction by which a tool counts at least

contains

  !> What the grains and walls have done since the exchange began, at a time [s].
  subroutine end_exchange(d, time)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time
    real(wp), dimension(size(d%pore%p)) :: moved, hull, flow, mixed, source, c, inflow, &
      before, cut
    real(wp) :: span, power, field(4, 3, brick_count(d%pore%grid)), way(6, d%pore%fit%tools%n)

    if (.not. d%pore%open) return
    associate (pore => d%pore)
      span = time - pore%since
      if (.not. pore%fit%ready) then
        call share_tools(pore%grid, pore%fit%tools)
        call fit_here(d)
        call begin_mixing(pore)
      end if
      call fit_ways(pore%grid, pore%fit, d%grains%x, field)
      way = tool_way(d%surfaces, pore%fit%tools)
      call add_tool_fields(pore%grid, pore%fit, way, field)
      cut = sweep_tools(pore%fit%tools, way, size(cut, kind=i4))
      call compress(pore%grid, field, moved)
      call hull_motion(d, .true., hull)
      call add_partner(pore, span, hull)
      flow = 0.0_wp
      call add_flow(pore%grid, pore%mobility, pore%p, flow, power)
      mixed = 0.0_wp
      call add_mixing(pore%mixing, 1.0_wp, pore%p, mixed)
      source = 0.0_wp
      call add_sources(pore, source)
      call node_storage(pore, c)
      before = pore%omega
      pore%omega = before + moved + hull + cut - span*(flow + mixed - source)
      inflow = 0.0_wp
      where (pore%hold > 0)
        inflow = c*pore%hold_p - pore%omega
        pore%omega = c*pore%hold_p
      end where
      call take_yield(pore, span, inflow)
      call take_layers(pore, span, inflow)
      call add_up(d, hull, inflow, span*source, span*power)
      call book_tools(d, way)
      pore%sums(sum_swept) = pore%sums(sum_swept) + sum(cut)
      pore%sums(sum_exchange) = pore%sums(sum_exchange) + sum(pore%p*(pore%omega - before)) &
                                - (0.5_wp*sum(c*pore%p**2) - pore%stored) &
                                + span*sum(pore%p*mixed)
      pore%stored = 0.5_wp*sum(c*pore%p**2)
      call add_seepage(pore, span*flow)
      call book_partner(pore, span, inflow, hydrostatic(pore%grid, &
                        pore%liquid%density*d%par%gravity_scale*d%par%gravity))
      call move_partner(pore, span)
      pore%open = .false.
      call book_liquid(d)
    end associate
  end subroutine end_exchange

  !> Volumes and works of an exchange into the sums.
  subroutine add_up(d, hull, inflow, source, lost)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: hull(:), inflow(:), source(:)  !! (nodes) [m^3]
    real(wp), intent(in) :: lost                           !! to the flow [J]
    real(wp) :: work(2)
    work = force_work(d)
    associate (s => d%pore%sums, p => d%pore%p)
      s(sum_swept) = s(sum_swept) + sum(hull)
      s(sum_inflow) = s(sum_inflow) + sum(inflow) + sum(source)
      s(sum_hull) = s(sum_hull) + sum(p*hull)
      s(sum_flow) = s(sum_flow) + sum(p*(inflow + source))
      s(sum_darcy) = s(sum_darcy) + lost
      s(sum_work) = s(sum_work) + work(1)
      s(sum_drag) = s(sum_drag) - work(2)
    end associate
  end subroutine add_up

  !> What Darcy's flow brought to the nodes whose pressure is held, by their sides.
  subroutine add_seepage(pore, gone)
    type(dem_pore_type), intent(inout) :: pore
    real(wp), intent(in) :: gone(:)  !! (nodes) [m^3]
    integer(i4) :: a, k
    do a = 1, size(pore%hold)
      k = pore%hold(a)
      if (k > 0) pore%sums(sum_seepage + k) = pore%sums(sum_seepage + k) - gone(a)
    end do
  end subroutine add_seepage

  !> Work of the forces -D'p and of the drag on all grains since the exchange began, by their ways:
  !! the ledger closes if it is -p D dx [J].
  function force_work(d) result(work)
    type(dem_data_type), intent(in) :: d
    real(wp) :: work(2), way(3)
    integer(i4) :: i
    work = 0.0_wp
    do i = 1, d%grains%n
      way = d%grains%x(:, i) - d%pore%start_x(:, i)
      work(1) = work(1) + dot_product(d%pore%held(:, i), way)
      work(2) = work(2) + dot_product(d%pore%drag(:, i), way)
    end do
  end function force_work

  !> The liquid's part of the ledger.
  subroutine book_liquid(d)
    type(dem_data_type), intent(inout) :: d
    associate (s => d%pore%sums, l => d%ledger)
      l%liquid = d%pore%stored
      l%darcy = s(sum_darcy)
      l%liquid_drag = s(sum_drag)
      l%liquid_exchange = s(sum_exchange)
      l%liquid_flow = s(sum_hull) + s(sum_flow) + s(sum_tools)
      l%liquid_work = s(sum_work) - s(sum_drag) - s(sum_held_drag)
    end associate
  end subroutine book_liquid

  !> Sides that have walls go with them.
  subroutine follow_walls(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: axis
    associate (pore => d%pore)
      do axis = 1, 3
        if (pore%wall(1, axis) > 0) &
          pore%grid%lower(axis) = d%planes%point(axis, pore%wall(1, axis))
        if (pore%wall(2, axis) > 0) &
          pore%grid%upper(axis) = d%planes%point(axis, pore%wall(2, axis))
      end do
    end associate
  end subroutine follow_walls

  !> What moving walls compress: by their velocities, or (done) by their ways since the begin.
  subroutine hull_motion(d, done, hull)
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: done
    real(wp), intent(out) :: hull(:)  !! (nodes) [m^3] or [m^3/s]
    real(wp) :: v
    integer(i4) :: axis, end, k
    hull = 0.0_wp
    do axis = 1, 3
      do end = 1, 2
        k = d%pore%wall(end, axis)
        if (k == 0) cycle
        v = d%planes%velocity(axis, k)
        if (done) v = d%planes%point(axis, k) - merge(d%pore%grid%lower(axis), &
                                                      d%pore%grid%upper(axis), end == 1)
        call add_hull(d%pore%grid, end, axis, v, hull)
        call leave_cuts(d, end, axis, v, hull)
      end do
    end do
  end subroutine hull_motion

  !> Where a tool goes through a side the wall there sweeps nothing.
  subroutine leave_cuts(d, end, axis, v, hull)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: end, axis
    real(wp), intent(in) :: v            !! along the axis
    real(wp), intent(inout) :: hull(:)
    integer(i4) :: a, t
    associate (tools => d%pore%fit%tools)
      do t = 1, tools%n
        do a = 1, size(hull)
          if (on_side(d%pore%grid, a, end, axis)) hull(a) = hull(a) - v*tools%cut(axis, a, t)
        end do
      end do
    end associate
  end subroutine leave_cuts

  !> The fit where the exchange began. Masses and kinds of grains stay in a run.
  subroutine fit_here(d)
    type(dem_data_type), intent(inout) :: d
    type(motion_type) :: motion
    associate (fit => d%pore%fit)
      if (.not. allocated(fit%inverse_mass)) then
        motion = motion_of(d, d%par%dt)
        fit%inverse_mass = merge(1.0_wp/(motion%mass_scale*d%grains%mass(:d%grains%n)), 0.0_wp, &
                                 d%grains%kind(:d%grains%n) == kind_free)
      end if
      if (fit%tools%n > 0) fit%tools%weight = max(1.0_wp - d%pore%porosity, loosest)
      call make_fit(d%pore%grid, d%pore%start_x, d%pore%volume, fit)
      call span_tools(d%pore%grid, fit)
      call span_tips(d%pore%grid, fit)
    end associate
  end subroutine fit_here

  !> Grains that have become ghosts count in no fit, and their part outside of the grid in no brick,
  !! from the first exchange on.
  subroutine see_ghosts(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: reach(3, d%grains%n)
    if (.not. d%pore%active) return
    d%pore%fit%counts = d%grains%kind(:d%grains%n) /= kind_ghost
    if (d%pore%exchanges > 0) return
    call boxes_of(d%grains, reach)
    call count_pores(d%pore, d%grains%x, reach)
    d%pore%first_porosity = d%pore%porosity
    call set_mobility(d%pore)
  end subroutine see_ghosts

  !> Pores, and the nodes that are held, as they are now (N229).
  subroutine renew_pores(d, time, errors)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: reach(3, d%grains%n)
    call boxes_of(d%grains, reach)
    call count_pores(d%pore, d%grains%x, reach)
    if (porosity_change(d%pore) > d%pore%changed(1)) &
      d%pore%changed = [porosity_change(d%pore), time]
    call hold_nodes(d%pore)
    call check_pores(d, time, errors)
  end subroutine renew_pores

  !> Pressures and forces of the steps to come, over `span` from `time` [s] (N226 to N229).
  subroutine begin_exchange(d, time, span, cavitation, errors)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time, span
    real(wp), intent(in) :: cavitation  !! tension of the liquid at which it cavitates [Pa]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: field(4, 3, brick_count(d%pore%grid))

    associate (pore => d%pore)
      call follow_walls(d)
      call place_tools(d%surfaces, pore%fit%tools)
      call share_tools(pore%grid, pore%fit%tools)
      call hold_pressures(pore)
      if (modulo(pore%exchanges, int(pore%refresh, i8)) == 0) call renew_pores(d, time, errors)
      call set_mobility(pore)
      pore%start_x = d%grains%x
      call fit_here(d)
      if (find_empty(pore) > 0) call renew_pores(d, time, errors)  ! a bed sinks out of its brick
      call check_bricks(d, time, errors)
      if (errors%any()) return
      pore%since = time
      pore%span = span
      call fit_fields(pore%fit, d%grains%v, field)
      call add_tool_fields(pore%grid, pore%fit, tool_velocity(d%surfaces, pore%fit%tools), field)
      call predict(d, field, cavitation, errors)
      if (errors%any()) return
      call grain_forces(pore%grid, pore%fit, pore%p, pore%held)
      if (pore%fluctuation) call set_drag(d, field)
      call see_flow(pore)
      call load_grains(d)
      call load_tools(d)
      pore%exchanges = pore%exchanges + 1
      pore%open = .true.
    end associate
  end subroutine begin_exchange

  !> C p + T (L + S) p + T^2 D M^-1 D' p = omega + T (D v + q), or p where it cavitates.
  !! eqs. D.38, D.42, D.80
  subroutine predict(d, field, cavitation, errors)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: field(:, :, :)  !! of the grains' velocities
    real(wp), intent(in) :: cavitation
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(size(d%pore%p)) :: rate, hull, free, low
    type(pore_equations_type) :: e

    associate (pore => d%pore)
      allocate (e%matrix(8, 8, brick_count(pore%grid)), e%storage(size(pore%p)))
      call compress(pore%grid, field, rate)
      call hull_motion(d, .false., hull)
      call add_partner(pore, 1.0_wp, hull)
      rate = rate + hull + sweep_tools(pore%fit%tools, tool_velocity(d%surfaces, pore%fit%tools), &
                                       size(rate, kind=i4))
      call add_sources(pore, rate)
      call node_storage(pore, e%storage)
      call brick_matrices(pore%grid, pore%fit, pore%mobility, pore%span, e%matrix)
      call begin_mixing(pore)
      e%mixing = pore%mixing
      e%span = pore%span
      call give_way(d, pore%span, e%give)
      free = merge(1.0_wp, 0.0_wp, pore%hold == 0)
      e%rhs = pore%omega + pore%span*rate
      call add_yield(pore, pore%span, e%storage, e%rhs)
      call add_layers(pore, pore%span, e%storage, e%rhs)
      where (pore%hold > 0) pore%p = pore%hold_p
      low = -cavitation - hydrostatic(pore%grid, pore%liquid%density*d%par%gravity_scale* &
                                      d%par%gravity)
      call solve_bounded(pore%grid, e, free, low, pore%p, pore%turns)
      if (pore%turns < 0) &
        call errors%add('N228', 'the pressures of the liquid were not found at '// &
                        short_number(pore%since)//' s', 'group pore_grid', 'hold a pressure '// &
                        'somewhere, or take a liquid that is compressible')
    end associate
  end subroutine predict

  !> Forces of the liquid to the free grains, with their buoyancy and without the weight of what
  !! they carry; the leapfrog's part of the energy follows, added up in runs of grains that do not
  !! depend on the threads.
  subroutine load_grains(d)
    type(dem_data_type), intent(inout) :: d
    type(motion_type) :: motion
    integer(i4), parameter :: long = 512
    real(wp) :: part((d%grains%n + long - 1)/long)
    integer(i4) :: k

    motion = motion_of(d, d%ledger_dt)
    !$omp parallel do default(none) schedule(static) private(k) shared(d, motion, part)
    do k = 1, size(part)
      call load_run(d, motion, (k - 1)*long + 1, min(k*long, d%grains%n), part(k))
    end do
    !$omp end parallel do
    d%ledger%start = d%ledger%start - d%ledger_dt**2/8.0_wp*sum(part)
  end subroutine load_grains

  !> Grains low to high, and the change of the sum of G^2/m, G their total forces.
  subroutine load_run(d, motion, low, high, change)
    type(dem_data_type), intent(inout) :: d
    type(motion_type), intent(in) :: motion
    integer(i4), intent(in) :: low, high
    real(wp), intent(out) :: change
    real(wp) :: new, lift, down, m, inverse, more
    integer(i4) :: i, j
    change = 0.0_wp
    associate (g => d%grains, pore => d%pore)
      do i = low, high
        if (g%kind(i) /= kind_free) cycle
        m = motion%mass_scale*g%mass(i)
        inverse = 1.0_wp/m
        lift = -(pore%carried(i) + pore%liquid%density*pore%volume(i))
        down = 0.0_wp
        if (allocated(d%surcharge)) down = d%surcharge(i)
        do j = 1, 3
          new = pore%held(j, i) + pore%drag(j, i) + lift*motion%gravity(j)
          if (j == 3) new = new - down
          more = new - g%extra_force(j, i)
          change = change + inverse*more*(more + 2.0_wp*(g%force(j, i) + g%extra_force(j, i) &
                   + g%mass(i)*motion%gravity(j) - motion%damping*m*g%v(j, i)))
          g%extra_force(j, i) = new
        end do
      end do
    end associate
  end subroutine load_run

  !> Porosities within (0, 1), and not far from those at the start (N229).
  subroutine check_pores(d, time, errors)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: time
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: least = 0.05_wp
    integer(i4) :: c
    do c = 1, size(d%pore%porosity)
      if (d%pore%porosity(c) > least) cycle
      call errors%add('N229', 'the pores of brick '//str(c)//' have closed to '// &
                      short_number(d%pore%porosity(c))//' at '//short_number(time)//' s', &
                      'group pore_grid', 'grains overlap too much, or stand in a brick twice')
      return
    end do
  end subroutine check_pores

  !> All grains are in the grid (N226), all bricks of the bed have some (N227).
  subroutine check_bricks(d, time, errors)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: time
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i, c
    real(wp) :: centre(3)
    associate (pore => d%pore)
      i = findloc(pore%fit%brick, 0_i4, 1)
      if (i > 0) then
        call errors%add('N226', 'grain '//str(d%grains%id(i))//' has left the grid of the '// &
                        'liquid at '//short_number(time)//' s, to '//str(d%grains%x(:, i))// &
                        ' m', 'group pore_grid', 'a larger grid, or walls that hold the grains')
        return
      end if
      c = find_empty(pore)
      if (c == 0) return
      centre = pore%grid%lower + brick_edges(pore%grid)*(place_in(pore%grid, c) + 0.5_wp)
      call errors%add('N227', 'no grain is left in the brick around '//str(centre)//' m at '// &
                      short_number(time)//' s', 'group pore_grid', 'larger bricks; above a '// &
                      "bed, surface = 'free' and a &drain at the side")
    end associate
  end subroutine check_bricks
end module dem_pore_exchange
