!> The groups &fluid, &pore_grid and &drain, and their faults D364 to D368, D371, D372.
module dem_pore_deck
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use dem_state, only: dem_data_type
  use dem_pore_state, only: dem_pore_type, pore_grid_type, drain_none, drain_pressure, drain_flux
  use dem_pore_grid, only: brick_edges, brick_of, place_in, brick_count
  use dem_pore_fit, only: make_fit
  use dem_pore_hold, only: hold_nodes, find_empty, find_open
  use dem_pore_laws, only: law_index, law_constant
  implicit none
  private
  public :: check_run, read_liquid, read_drains, read_grid, check_start

  real(wp), parameter :: least_brick = 3.0_wp   !! edge over the largest diameter
  real(wp), parameter :: most_nodes = 5.0e4_wp
  real(wp), parameter :: off_side = 0.02_wp     !! of a wall from its side, in bricks
  real(wp), parameter :: upright = 1.0e-9_wp    !! cosine to the axis, less than 1 by this
  character(len=2), parameter :: side_names(6) = ['x0', 'x1', 'y0', 'y1', 'z0', 'z1']

contains

  !> What the liquid cannot do yet (D366), and groups that are alone (D364).
  subroutine check_run(deck, ranks, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: ranks
    type(error_list_type), intent(inout) :: errors
    character(len=12), parameter :: others(8) = [character(len=12) :: 'cell', 'membrane', &
      'source', 'sink', 'window', 'breakage', 'probe', 'tile']
    logical :: carried, total
    integer(i4) :: k

    if (deck%count('pore_grid') == 0) then
      do k = 1, deck%count('servo')
        call deck%get('servo', k, 'total', total)
        if (total) call deck%fault(errors, 'D364', 'there is no liquid whose pressure would '// &
                                   'count', 'servo', k, 'total', 'leave it out, or add &pore_grid')
      end do
      if (deck%count('fluid') + deck%count('drain') > 0) call deck%fault(errors, 'D364', &
        'there is no &pore_grid for it', trim(merge('fluid', 'drain', deck%count('fluid') > 0)), &
        1, '', 'add &pore_grid, or leave it out')
      return
    end if
    do k = 1, size(others)
      if (deck%count(trim(others(k))) == 0) cycle
      call deck%fault(errors, 'D366', 'a liquid among the grains does not work with &'// &
                      trim(others(k)), trim(others(k)), 1, '', 'leave one of both out')
    end do
    call deck%get('pore_grid', 1, 'carried', carried)
    if (carried .and. deck%count('relaxation') > 0) &
      call deck%fault(errors, 'D366', 'in &relaxation masses are no masses: grains carry none '// &
                      'of the liquid', 'pore_grid', 1, 'carried', 'set carried = .false.')
    if (ranks > 1) call deck%fault(errors, 'D366', 'a liquid among the grains works on one '// &
      'rank, not on '//str(ranks), 'pore_grid', 1, '', 'use threads')
  end subroutine check_run

  !> The liquid and how it flows (D364).
  subroutine read_liquid(deck, pore, errors)
    type(deck_type), intent(in) :: deck
    type(dem_pore_type), intent(inout) :: pore
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: atmosphere = 101325.0_wp  !! [Pa]
    character(len=:), allocatable :: name, id, word
    real(wp) :: bulk, air
    integer(i4) :: k

    call deck%get('pore_grid', 1, 'fluid', name)
    do k = 1, deck%count('fluid')
      call deck%get('fluid', k, 'id', id)
      if (id == name) exit
    end do
    if (k > deck%count('fluid')) then
      call deck%fault(errors, 'D364', "there is no liquid '"//name//"'", 'pore_grid', 1, 'fluid', &
                      'define it with &fluid id = ...')
      return
    end if
    associate (l => pore%liquid)
      call deck%get('fluid', k, 'density', l%density)
      call deck%get('fluid', k, 'viscosity', l%viscosity)
      call deck%get('fluid', k, 'bulk_modulus', bulk)
      call deck%get('fluid', k, 'air', air)
      l%compliance = air/atmosphere
      if (bulk > 0.0_wp) l%compliance = l%compliance + (1.0_wp - air)/bulk
      call deck%get('pore_grid', 1, 'law', word)
      l%law = law_index(word)
      if (l%law == law_constant) call deck%get('pore_grid', 1, 'permeability', l%permeability)
      call deck%get('pore_grid', 1, 'permeability_factor', l%factor)
    end associate
    call deck%get('pore_grid', 1, 'exchange', pore%every)
    if (pore%every == 3) call deck%fault(errors, 'D369', 'exchanges come every 1, 2 or 4 steps', &
      'pore_grid', 1, 'exchange', 'take 1, 2 or 4')
    call deck%get('pore_grid', 1, 'porosity_every', pore%refresh)
    call deck%get('pore_grid', 1, 'fluctuation', pore%fluctuation)
    call deck%get('pore_grid', 1, 'surface', word)
    pore%free_surface = word == 'free'
  end subroutine read_liquid

  !> Sides that let liquid through, each once (D364); a liquid that cannot be compressed needs a
  !! pressure that is held (D368).
  subroutine read_drains(deck, curves, served, pore, curve, errors)
    type(deck_type), intent(in) :: deck
    type(curve_type), intent(in) :: curves(:)
    logical, intent(in) :: served  !! a partner may hold pressures
    type(dem_pore_type), intent(inout) :: pore
    integer(i4), intent(inout) :: curve(2, 3)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, key
    integer(i4) :: k, side, end, axis
    do k = 1, deck%count('drain')
      call deck%get('drain', k, 'side', name)
      side = findloc(side_names == name, .true., 1)
      axis = (side + 1)/2
      end = 2 - modulo(side, 2)
      if (pore%drain(end, axis) /= drain_none) then
        call deck%fault(errors, 'D364', "side '"//name//"' is drained twice", 'drain', k, &
                        'side', 'one &drain a side')
        cycle
      end if
      key = 'flux'
      if (deck%given('drain', k, 'pressure')) key = 'pressure'
      pore%drain(end, axis) = merge(drain_pressure, drain_flux, key == 'pressure')
      call deck%get('drain', k, key, pore%drain_value(end, axis))
      call deck%get('drain', k, 'layer', pore%drain_layer(end, axis))
      call curve_index(deck, 'D250', curves, 'drain', k, curve(end, axis), errors)
    end do
    if (served .or. pore%liquid%compliance > 0.0_wp .or. any(pore%drain == drain_pressure)) return
    call deck%fault(errors, 'D368', 'the liquid cannot be compressed and no pressure is held: '// &
                    'its pressure is not known', 'pore_grid', 1, '', 'hold a side with &drain '// &
                    'pressure, or give the liquid a bulk_modulus')
  end subroutine read_drains

  !> The box, its bricks (D365) and the walls on its sides (D367).
  subroutine read_grid(deck, d, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: corner(:)
    integer(i4), allocatable :: bricks(:)
    real(wp) :: size_of, largest

    associate (grid => d%pore%grid)
      call deck%get('pore_grid', 1, 'lower', corner)
      grid%lower = corner
      call deck%get('pore_grid', 1, 'upper', corner)
      grid%upper = corner
      if (.not. all(grid%upper > grid%lower)) then
        call deck%fault(errors, 'D365', 'the grid has no volume', 'pore_grid', 1, 'upper', &
                        'upper must be above lower in x, y and z')
        return
      end if
      largest = 0.0_wp
      if (d%grains%n > 0) largest = 2.0_wp*maxval(product(d%grains%axes, 1))**(1.0_wp/3.0_wp)
      call deck%get('pore_grid', 1, 'size', size_of)
      if (deck%given('pore_grid', 1, 'bricks')) then
        call deck%get('pore_grid', 1, 'bricks', bricks)
        grid%bricks = bricks
      else
        grid%bricks = max(1, int(min((grid%upper - grid%lower)*(1.0_wp + 1.0e-9_wp) &
                                     /(size_of*max(largest, tiny(1.0_wp))), most_nodes), i4))
      end if
      call check_bricks(deck, grid, largest, errors)
      if (errors%any()) return
      call find_walls(deck, d, errors)
      call check_servos(deck, d, errors)
    end associate
  end subroutine read_grid

  !> Bricks hold enough grains, and are not too many (D365).
  subroutine check_bricks(deck, grid, largest, errors)
    type(deck_type), intent(in) :: deck
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: largest  !! diameter [m]
    type(error_list_type), intent(inout) :: errors
    if (.not. minval(brick_edges(grid)) >= least_brick*largest*(1.0_wp - 1.0e-9_wp)) &
      call deck%fault(errors, 'D365', 'a brick is '//str(minval(brick_edges(grid)))// &
                      ' m wide, less than 3 diameters of the largest grain, '//str(largest)// &
                      ' m', 'pore_grid', 1, 'bricks', 'fewer bricks, or a larger box')
    if (product(real(grid%bricks + 1, wp)) > most_nodes) &
      call deck%fault(errors, 'D365', 'the grid has '//str(product(real(grid%bricks + 1, wp)))// &
                      ' nodes', 'pore_grid', 1, 'bricks', 'at most 50000')
  end subroutine check_bricks

  !> Each wall lies on a side and faces inwards, or does not cut the box (D367).
  subroutine find_walls(deck, d, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: slack(3), deep
    integer(i4) :: k, axis, end
    slack = off_side*brick_edges(d%pore%grid)
    do k = 1, d%planes%n
      associate (n => d%planes%normal(:, k), x => d%planes%point(:, k), g => d%pore%grid)
        axis = maxloc(abs(n), 1)
        end = merge(1, 2, n(axis) > 0.0_wp)
        if (1.0_wp - abs(n(axis)) <= upright .and. &
            abs(x(axis) - merge(g%lower(axis), g%upper(axis), end == 1)) <= slack(axis)) then
          d%pore%wall(end, axis) = k
          cycle
        end if
        deep = dot_product(x, n) - sum(merge(g%lower, g%upper, n > 0.0_wp)*n)
        if (deep <= minval(slack)) cycle
        call deck%fault(errors, 'D367', 'wall '//str(k)//' cuts off '//short_number(deep)// &
                        ' m of the grid', 'wall', k, 'point', 'give the grid the sides of the '// &
                        'walls: lower and upper on them')
      end associate
    end do
  end subroutine find_walls

  !> Servos of total stress are those of walls on sides (D367).
  subroutine check_servos(deck, d, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, wall
    logical :: total
    integer(i4) :: k, j
    do k = 1, deck%count('servo')
      call deck%get('servo', k, 'total', total)
      if (.not. total) cycle
      call deck%get('servo', k, 'wall', name)
      do j = 1, deck%count('wall')
        call deck%get('wall', j, 'id', wall)
        if (wall /= name .or. any(d%pore%wall == j)) cycle
        call deck%fault(errors, 'D367', "wall '"//name//"' stands on no side of the grid: no "// &
                        'liquid presses it', 'servo', k, 'total', 'leave it out, or give the '// &
                        'grid the side of the wall')
      end do
    end do
  end subroutine check_servos

  !> All grains in the grid (D372), grains in all bricks of the bed (D371). A partner's ghosts may
  !! be outside and are not known yet: N226 tells later of others.
  subroutine check_start(deck, served, d, errors)
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: centre(3)
    integer(i4) :: i, c
    associate (pore => d%pore)
      do i = 1, merge(0, d%grains%n, served)
        if (brick_of(pore%grid, 1.0_wp/brick_edges(pore%grid), d%grains%x(:, i)) > 0) cycle
        call deck%fault(errors, 'D372', 'grain '//str(d%grains%id(i))//' at '// &
                        str(d%grains%x(:, i))//' m is outside the grid', 'pore_grid', 1, '', &
                        'a box that holds all grains')
        return
      end do
      call make_fit(pore%grid, d%grains%x, pore%volume, pore%fit)
      call hold_nodes(pore)
      call check_layers(deck, pore, errors)
      c = find_empty(pore)
      pore%fit%ready = .false.
      deallocate (pore%fit%inverse_mass)
      if (c == 0 .or. errors%any()) return
      centre = centre_of(pore%grid, c)
      call deck%fault(errors, 'D371', 'there is no grain in the brick around '//str(centre)// &
                      ' m, one of '//str(brick_count(pore%grid)), 'pore_grid', 1, '', &
                      "a box that the bed fills; above it surface = 'free' and a &drain with "// &
                      'pressure on that side')
    end associate
  end subroutine check_start

  !> Open water has the pressure of its drain, and so no layer before it (D379).
  subroutine check_layers(deck, pore, errors)
    type(deck_type), intent(in) :: deck
    type(dem_pore_type), intent(in) :: pore
    type(error_list_type), intent(inout) :: errors
    real(wp) :: layer
    integer(i4) :: c, k
    c = find_open(pore)
    if (c == 0) return
    do k = 1, deck%count('drain')
      call deck%get('drain', k, 'layer', layer)
      if (layer > 0.0_wp) exit
    end do
    call deck%fault(errors, 'D379', 'the brick around '//str(centre_of(pore%grid, c))// &
                    ' m, at a side behind a layer, is open water', 'drain', k, 'layer', &
                    "a box that the bed fills, surface = 'closed', or no layer there")
  end subroutine check_layers

  !> Centre of a brick [m].
  pure function centre_of(grid, c) result(centre)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c
    real(wp) :: centre(3)
    centre = grid%lower + brick_edges(grid)*(place_in(grid, c) + 0.5_wp)
  end function centre_of
end module dem_pore_deck
