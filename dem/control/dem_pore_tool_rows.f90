!> Closed bodies in the grid of a liquid: what the deck may have of them (D366, D377 to D379), and
!! the history of the liquid's loads on them.
module dem_pore_tool_rows
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use talus_text, only: str
  use dem_pore_grid, only: brick_count, brick_edges, node_count
  use dem_pore_solid, only: columns
  use dem_pore_state, only: dem_pore_type
  use dem_pore_tips, only: shoulder_pressure
  use dem_pore_tools, only: begin_tools, share_tools, tool_share
  use dem_state, only: dem_data_type
  use dem_surface_state, only: dem_surfaces_type, is_cylinder
  implicit none
  private
  public :: read_tools, open_tool_history, write_tool_rows, open_tip_history, write_tip_rows

  real(wp), parameter :: most_numbers = 3.0e7_wp  !! of all tools at all nodes
  real(wp), parameter :: overlap = 0.05_wp        !! of a brick that two tools may share, as bodies
                                                  !! with sides meet
  character(len=16), parameter :: titles(22) = [character(len=16) :: 'time [s]', 'surface [-]', &
    'x [m]', 'y [m]', 'z [m]', 'force_x [N]', 'force_y [N]', 'force_z [N]', 'moment_x [N m]', &
    'moment_y [N m]', 'moment_z [N m]', 'drag_x [N]', 'drag_y [N]', 'drag_z [N]', 'lift_x [N]', &
    'lift_y [N]', 'lift_z [N]', 'turning_x [N m]', 'turning_y [N m]', 'turning_z [N m]', &
    'volume [m3]', 'work [J]']
  character(len=21), parameter :: tip_titles(24) = [character(len=21) :: 'time [s]', &
    'surface [-]', 'x [m]', 'y [m]', 'z [m]', 'tip_contacts_x [N]', 'tip_contacts_y [N]', &
    'tip_contacts_z [N]', 'tip_liquid_x [N]', 'tip_liquid_y [N]', 'tip_liquid_z [N]', &
    'tip_lift_x [N]', 'tip_lift_y [N]', 'tip_lift_z [N]', 'shaft_contacts_x [N]', &
    'shaft_contacts_y [N]', 'shaft_contacts_z [N]', 'shaft_liquid_x [N]', 'shaft_liquid_y [N]', &
    'shaft_liquid_z [N]', 'shaft_lift_x [N]', 'shaft_lift_y [N]', 'shaft_lift_z [N]', &
    'shoulder [Pa]']

contains

  !> Closed surfaces become tools; others do not work with a liquid.
  subroutine read_tools(deck, d, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: b, before
    before = errors%count
    if (d%surfaces%n == 0) return
    call begin_tools(d%surfaces, d%pore%fit%tools)
    do b = 1, d%surfaces%n
      if (any(d%pore%fit%tools%body == b)) cycle
      call refuse(deck, d%surfaces, b, errors)
    end do
    call check_sizes(deck, d, errors)
    if (errors%count > before) return
    call share_tools(d%pore%grid, d%pore%fit%tools)
    call check_overlaps(deck, d%pore, errors)
  end subroutine read_tools

  !> A body without an inside (D366).
  subroutine refuse(deck, s, b, errors)
    type(deck_type), intent(in) :: deck
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: group, hint
    integer(i4) :: number
    call group_of(deck, b, group, number)
    hint = 'close the surface, or leave one of both out'
    if (is_cylinder(s, b)) hint = "give the cylinder a length, and grains outside"
    call deck%fault(errors, 'D366', "surface '"//s%name(b)%s//"' has no inside: the liquid "// &
                    'would go through it', group, number, 'id', hint)
  end subroutine refuse

  !> Group and number in the deck of body b.
  subroutine group_of(deck, b, group, number)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: b
    character(len=:), allocatable, intent(out) :: group
    integer(i4), intent(out) :: number
    number = b
    group = 'surface'
    if (number <= deck%count('surface')) return
    number = number - deck%count('surface')
    group = 'penetrometer'
    if (number <= deck%count('penetrometer')) return
    number = number - deck%count('penetrometer')
    group = 'cylinder'
  end subroutine group_of

  !> Bodies thinner than half of a column by which they are counted (D377); more of them than there
  !! is room for (D376).
  subroutine check_sizes(deck, d, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: group
    integer(i4) :: t, number
    real(wp) :: thin, least
    associate (tools => d%pore%fit%tools)
      least = 0.5_wp*minval(brick_edges(d%pore%grid))/columns
      do t = 1, tools%n
        associate (p => tools%rest(:, :, tools%first(t):tools%first(t + 1) - 1))
          thin = 2.0_wp*abs(tools%volume(t))/surface_of(p)
        end associate
        if (thin >= least) cycle
        call group_of(deck, tools%body(t), group, number)
        call deck%fault(errors, 'D377', "surface '"//d%surfaces%name(tools%body(t))%s//"' is "// &
                        short_number(thin)//' m thick (twice its volume over its surface), a '// &
                        'twelfth of a brick is '//short_number(least)//' m', group, number, 'id', &
                        'a thicker body, or smaller bricks: the liquid would go through this one')
      end do
      if (6.0_wp*tools%n*node_count(d%pore%grid) <= most_numbers) return
      call deck%fault(errors, 'D376', str(tools%n)//' bodies in a grid of '// &
                      str(node_count(d%pore%grid))//' nodes are more than there is room for', &
                      'pore_grid', 1, '', 'fewer bodies or larger bricks: bodies times nodes '// &
                      'stay below 5e6')
    end associate
  end subroutine check_sizes

  !> Area of triangles [m^2].
  pure real(wp) function surface_of(p) result(area)
    real(wp), intent(in) :: p(:, :, :)
    real(wp) :: a(3), b(3)
    integer(i4) :: k
    area = 0.0_wp
    do k = 1, size(p, 3)
      a = p(:, 2, k) - p(:, 1, k)
      b = p(:, 3, k) - p(:, 1, k)
      area = area + 0.5_wp*sqrt((a(2)*b(3) - a(3)*b(2))**2 + (a(3)*b(1) - a(1)*b(3))**2 &
                                + (a(1)*b(2) - a(2)*b(1))**2)
    end do
  end function surface_of

  !> Two bodies are not at one place (D378).
  subroutine check_overlaps(deck, pore, errors)
    type(deck_type), intent(in) :: deck
    type(dem_pore_type), intent(in) :: pore
    type(error_list_type), intent(inout) :: errors
    real(wp) :: share
    integer(i4) :: c
    do c = 1, brick_count(pore%grid)
      share = tool_share(pore%grid, pore%fit%tools, c)
      if (share <= 1.0_wp + overlap) cycle
      call deck%fault(errors, 'D378', 'bodies fill brick '//str(c)//' by '// &
                      short_number(share)//' of its volume', 'pore_grid', 1, '', &
                      'bodies that overlap count twice: make them one surface')
      return
    end do
  end subroutine check_overlaps

  !> Begin <stem>_tools.csv, or go on in it after a restart at time >= 0.
  subroutine open_tool_history(history, d, stem, time, errors)
    type(history_type), intent(inout) :: history
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (d%pore%fit%tools%n > 0) call history%begin(stem//'_tools.csv', titles, time, errors)
  end subroutine open_tool_history

  !> A row a body: force and moment of the pressure over the hydrostatic one, drag by grains in its
  !! bricks, force and moment of the hydrostatic pressure, its volume in the grid, work of the first
  !! two on it.
  subroutine write_tool_rows(history, time, d, errors)
    type(history_type), intent(inout) :: history
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: volume
    integer(i4) :: t
    if (.not. history%is_open()) return
    associate (tools => d%pore%fit%tools)
      do t = 1, tools%n
        volume = sum(tools%moment(1, 1, :), mask=tools%tool == t)
        call history%write([time, real(tools%body(t), wp), d%surfaces%centre(:, tools%body(t)), &
                           tools%load(:, t), tools%drag(:3, t), tools%lift(:, t), volume, &
                           tools%work(t)], errors)
      end do
    end associate
  end subroutine write_tool_rows

  !> Begin <stem>_penetrometers.csv, or go on in it after a restart at time >= 0.
  subroutine open_tip_history(history, d, stem, time, errors)
    type(history_type), intent(inout) :: history
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (d%pore%fit%tools%tips%n > 0) &
      call history%begin(stem//'_penetrometers.csv', tip_titles, time, errors)
  end subroutine open_tip_history

  !> A row a penetrometer: forces on tip (with its cone) and shaft of contacts, of the pressure over
  !! the hydrostatic one with the drag, and of the hydrostatic pressure; mean pressure at the
  !! shoulder.
  subroutine write_tip_rows(history, time, d, errors)
    type(history_type), intent(inout) :: history
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: contacts(3, 2), liquid(3, 2), lift(3, 2)
    integer(i4) :: k, b, t
    if (.not. history%is_open()) return
    associate (tools => d%pore%fit%tools, tips => d%pore%fit%tools%tips, s => d%surfaces)
      do k = 1, tips%n
        t = tips%tool(k)
        b = tools%body(t)
        contacts(:, 2) = s%sums%force(:, s%first_part(b + 1) - 1)
        contacts(:, 1) = sum(s%sums%force(:, s%first_part(b):s%first_part(b + 1) - 2), 2)
        liquid(:, 1) = tips%load(:, k) + tips%drag(:, k)
        liquid(:, 2) = tools%load(:3, t) + tools%drag(:3, t) - liquid(:, 1)
        lift(:, 1) = tips%lift(:, k)
        lift(:, 2) = tools%lift(:3, t) - lift(:, 1)
        call history%write([time, real(b, wp), s%centre(:, b), contacts(:, 1), liquid(:, 1), &
                           lift(:, 1), contacts(:, 2), liquid(:, 2), lift(:, 2), &
                           shoulder_pressure(d%pore%grid, tools, k, d%pore%p)], errors)
      end do
    end associate
  end subroutine write_tip_rows
end module dem_pore_tool_rows
