!> Make the link of the liquid: the side of the grains' grid that lies on the facets, its maps, its
!! sets, and the admittance of the interface.
module cpl_pore_setup
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_message, only: verb_set
  use talus_port_names, only: field_a, field_area, field_compressibility, field_fluid_in, &
    field_force, field_id, field_mass, field_mobility, field_p, field_set, &
    field_storage, field_u, field_v, field_value, field_what, field_x, role_load, role_pore, &
    what_grains, what_pore, what_pore_storage
  use cpl_facet_map, only: facet_map_type
  use cpl_pore, only: pore_link_type, hull_set, row_of, side_set, to_facets, wet_set
  use cpl_pore_file, only: read_pore_reference
  use cpl_run, only: cpl_run_type
  use cpl_setup, only: read_mesh
  use cpl_shapes, only: corner_count, node_count
  use cpl_solid_mesh, only: solid_mesh_type
  use cpl_solver, only: side_grains, side_solid
  implicit none
  private
  public :: make_pore, admittance

  character(len=2), parameter :: side_names(6) = ['x0', 'x1', 'y0', 'y1', 'z0', 'z1']

  !> Nodes on the sides of the grid, as the grains describe them.
  type :: grid_hull_type
    integer(i8), allocatable :: id(:)
    real(wp), allocatable :: x(:, :)      !! (3, n) [m]
    real(wp), allocatable :: area(:, :)   !! (6, n) [m^2]
    real(wp), allocatable :: storage(:)   !! [m^3/Pa]
    real(wp), allocatable :: mobility(:)  !! [m^2/(Pa s)]
    real(wp), allocatable :: soft(:)      !! compressibility [1/Pa]
    real(wp) :: density = 0.0_wp          !! of the grains with what they carry, by volume [kg/m^3]
  end type grid_hull_type

contains

  !> Maps and sets of the liquid, if the deck has an interface for it.
  subroutine make_pore(link, run, errors)
    type(pore_link_type), intent(inout) :: link
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(solid_mesh_type) :: mesh
    type(grid_hull_type) :: grid
    integer(i8), allocatable :: ids(:)
    integer(i4) :: side

    associate (choices => run%choices%pore, solvers => run%solvers)
      if (.not. choices%given) return
      link%permeable = choices%permeable
      link%returned = choices%returned
      link%yields = choices%yields
      call read_mesh(solvers(side_solid), choices%facets, mesh, run%timers, errors)
      if (errors%any()) return
      if (run%again) then
        call read_pore_reference(run%checkpoint, run%state, ids, link, errors)
      else
        call read_grid(run, grid, errors)
        if (errors%any()) return
        call find_side(grid, mesh, run, side, errors)
        if (errors%any()) return
        ids = pack(grid%id, grid%area(side, :) > 0.0_wp)
        call place_nodes(grid, side, link)
      end if
      if (errors%any()) return
      call map_nodes(link, ids, mesh, run%choices%max_offset, errors)
      if (errors%any()) return
      if (.not. run%again .and. link%permeable) call open_side(link, grid, side, run, errors)
      if (errors%any()) return
      call link%init()
      call select_nodes(link, run, errors)
    end associate
  end subroutine make_pore

  !> DESCRIBE pore of the grains, and their mass in the volume of the grid.
  subroutine read_grid(run, grid, errors)
    type(cpl_run_type), intent(inout) :: run
    type(grid_hull_type), intent(inout) :: grid
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: mass(:)
    associate (grains => run%solvers(side_grains))
      call grains%describe(what_pore, '', run%timers, errors)
      if (errors%any()) return
      call grains%reply%take_int(field_id, grid%id, errors)
      call grains%reply%take(field_x, grid%x, errors)
      call grains%reply%take(field_area, grid%area, errors)
      call grains%reply%take(field_storage, grid%storage, errors)
      call grains%reply%take(field_mobility, grid%mobility, errors)
      call grains%reply%take(field_compressibility, grid%soft, errors)
      call grains%describe(what_grains, '', run%timers, errors)
      if (errors%any()) return
      call grains%reply%take(field_mass, mass, errors)
      if (.not. errors%any()) grid%density = sum(mass) &
        /product(maxval(grid%x, 2) - minval(grid%x, 2))
    end associate
  end subroutine read_grid

  !> The side all of whose nodes lie on the facets (I448).
  subroutine find_side(grid, mesh, run, side, errors)
    type(grid_hull_type), intent(in) :: grid
    type(solid_mesh_type), intent(in) :: mesh
    type(cpl_run_type), intent(in) :: run
    integer(i4), intent(out) :: side
    type(error_list_type), intent(inout) :: errors
    type(facet_map_type) :: map
    type(error_list_type) :: ignored
    integer(i8), allocatable :: ids(:)
    real(wp) :: off(6)
    integer(i4) :: nearest

    do side = 1, 6
      ids = pack(grid%id, grid%area(side, :) > 0.0_wp)
      call map%build(ids, of_side(grid, side), mesh%facets, mesh%x, run%choices%max_offset, ignored)
      if (all(map%facet > 0)) return
      off(side) = farthest(of_side(grid, side), mesh)
    end do
    nearest = minloc(off, 1)
    call errors%add('I448', "no side of the liquid's grid lies on the facets '"// &
                    run%choices%pore%facets//"': "//side_names(nearest)//', the nearest, is up '// &
                    'to '//short_number(off(nearest))//' m beside them', &
                    run%solvers(side_grains)%deck, &
                    'let lower or upper of &pore_grid be where the facets are')
  end subroutine find_side

  !> How far off the box around the facets nodes are, the most [m].
  pure real(wp) function farthest(x, mesh)
    real(wp), intent(in) :: x(:, :)  !! (3, n)
    type(solid_mesh_type), intent(in) :: mesh
    real(wp) :: low(3), high(3)
    integer(i4), allocatable :: node(:)
    integer(i4) :: k
    node = pack(mesh%facets, mesh%facets > 0)
    low = minval(mesh%x(:, node), 2)
    high = maxval(mesh%x(:, node), 2)
    farthest = maxval([(norm2(max(0.0_wp, low - x(:, k), x(:, k) - high)), k=1, size(x, 2))])
  end function farthest

  !> Places of the nodes of a side.
  pure function of_side(grid, side) result(x)
    type(grid_hull_type), intent(in) :: grid
    integer(i4), intent(in) :: side
    real(wp), allocatable :: x(:, :)
    integer(i4) :: k
    x = grid%x(:, pack([(k, k=1, size(grid%id))], grid%area(side, :) > 0.0_wp))
  end function of_side

  subroutine place_nodes(grid, side, link)
    type(grid_hull_type), intent(in) :: grid
    integer(i4), intent(in) :: side
    type(pore_link_type), intent(inout) :: link
    link%x_ref = of_side(grid, side)
  end subroutine place_nodes

  !> The nodes on the facets, and on their corners, which have the pressures.
  subroutine map_nodes(link, ids, mesh, max_offset, errors)
    type(pore_link_type), intent(inout) :: link
    integer(i8), intent(in) :: ids(:)
    type(solid_mesh_type), intent(in) :: mesh
    real(wp), intent(in) :: max_offset  !! [m]
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: corners(:, :)
    integer(i4) :: k
    call link%hull%build(ids, link%x_ref, mesh%facets, mesh%x, max_offset, errors)
    if (.not. link%permeable .or. errors%any()) return
    corners = mesh%facets
    do k = 1, size(corners, 2)
      corners(corner_count(node_count(mesh%facets(:, k))) + 1:, k) = 0
    end do
    call link%wet%build(ids, link%x_ref, corners, mesh%x, max_offset, errors)
  end subroutine map_nodes

  !> Storage of the half bricks, and the admittance times the interval, at the corners. eq. C.41
  subroutine open_side(link, grid, side, run, errors)
    type(pore_link_type), intent(inout) :: link
    type(grid_hull_type), intent(in) :: grid
    integer(i4), intent(in) :: side
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: id(:)
    real(wp), allocatable :: mobility(:), soft(:)
    real(wp) :: nodal(2, link%wet%nodes), mine(2), span
    integer(i4) :: a, k

    associate (solid => run%solvers(side_solid), choices => run%choices%pore)
      call solid%describe(what_pore, '', run%timers, errors)
      if (errors%any()) return
      call solid%reply%take_int(field_id, id, errors)
      call solid%reply%take(field_mobility, mobility, errors)
      call solid%reply%take(field_compressibility, soft, errors)
      if (errors%any()) return
      link%area = pack(grid%area(side, :), grid%area(side, :) > 0.0_wp)
      nodal = to_facets(link%wet, two_rows(grid, side))
      link%storage = nodal(1, :)
      link%ahead = 0.0_wp*link%storage
      span = run%choices%exchange
      link%estimate = sum(link%storage)/sum(link%area) + sqrt(maxval(mobility)*maxval(soft)*span)
      if (link%yields) return  ! the solid is asked itself
      mine = [maxval(grid%mobility, mask=grid%area(side, :) > 0.0_wp), &
              maxval(grid%soft, mask=grid%area(side, :) > 0.0_wp)]
      if (choices%modulus > 0.0_wp) mine(2) = mine(2) + 1.0_wp/choices%modulus
      do a = 1, link%wet%nodes
        k = findloc(id, link%wet%node_id(a), 1)
        if (k == 0) cycle
        link%ahead(a) = choices%robin*nodal(2, a)*span*admittance( &
          max(mine(1), mobility(k)), max(mine(2), soft(k)), grid%density, span)
      end do
    end associate
  end subroutine open_side

  !> Storage and area of the nodes of a side.
  pure function two_rows(grid, side) result(rows)
    type(grid_hull_type), intent(in) :: grid
    integer(i4), intent(in) :: side
    real(wp) :: rows(2, count(grid%area(side, :) > 0.0_wp))
    rows(1, :) = pack(grid%storage, grid%area(side, :) > 0.0_wp)
    rows(2, :) = pack(grid%area(side, :), grid%area(side, :) > 0.0_wp)
  end function two_rows

  !> Liquid that a half space takes in an interval for a pressure that comes with it, over pressure,
  !! area and time [m/(Pa s)]: by its flow, and by a wave of its grains. eq. C.41
  pure real(wp) function admittance(mobility, soft, density, span)
    real(wp), intent(in) :: mobility  !! [m^2/(Pa s)]
    real(wp), intent(in) :: soft      !! compressibility [1/Pa]
    real(wp), intent(in) :: density   !! of the grains, by volume [kg/m^3]
    real(wp), intent(in) :: span      !! [s]
    admittance = sqrt(mobility*soft/span) + sqrt(soft/density)
  end function admittance

  !> SELECT the nodes of both sides; SET what the solid stores for the grains and the coupling.
  subroutine select_nodes(link, run, errors)
    type(pore_link_type), intent(in) :: link
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fields
    associate (grains => run%solvers(side_grains), solid => run%solvers(side_solid))
      fields = field_force//','//field_fluid_in
      if (link%permeable) fields = field_p//','//fields
      call grains%start_select(0_i8, side_set, role_pore, link%hull%ghost_id, fields)
      call grains%ask(run%timers, errors)
      if (errors%any()) return
      call solid%start_select(0_i8, hull_set, role_load, link%hull%node_id, &
                              field_u//','//field_v//','//field_a)
      call solid%ask(run%timers, errors)
      if (.not. link%permeable .or. errors%any()) return
      call solid%start_select(0_i8, wet_set, role_pore, link%wet%node_id)
      call solid%ask(run%timers, errors)
      if (errors%any()) return
      call solid%start_request(verb_set, 0_i8, solid%time, solid%time)
      call solid%request%put_text(field_what, what_pore_storage)
      call solid%request%put_text(field_set, wet_set)
      call solid%request%put(field_value, link%storage + link%ahead)
      call solid%ask(run%timers, errors)
    end associate
  end subroutine select_nodes
end module cpl_pore_setup
